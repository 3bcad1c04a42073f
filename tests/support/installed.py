"""Which fix_nosquish is tested: the one that LAMMPS's processes import,
if its files are the checkout's."""

import importlib.util
import subprocess
import sys
from importlib import metadata
from pathlib import Path

from validation.running import startup

SOURCE = Path(__file__).resolve().parents[2] / "fix_nosquish"
SCHEMES = "fix_nosquish_validation/schemes"  # the harness's, which LAMMPS imports, too

COMPILE = """
from fix_nosquish.loops import machine_code
from fix_nosquish.loops.__main__ import modules
from fix_nosquish.loops.registry import LOOPS
from fix_nosquish.ranks import communicator
from fix_nosquish_validation.schemes import gear, matubayasi_nakahara
modules()
machine_code.load(communicator.ALONE, *LOOPS)
"""


def tested():
    """Say which package is tested: its version, its folder, and that its files are the checkout's.

    Raises:
        SystemExit: if there is none, or it is another one; the message says what to do.
    """
    package = startup.package().resolve()
    here = Path(importlib.util.find_spec("fix_nosquish").origin).resolve().parent
    if here != package:
        raise SystemExit(
            f"this Python imports {here}, LAMMPS's processes import {package}: unset PYTHONPATH"
        )
    editable = package == SOURCE
    places = package.parent / SCHEMES, SOURCE.parent / "validation/schemes"
    if other := [] if editable else differences(package, SOURCE) + differences(*places):
        raise SystemExit(
            f"the fix_nosquish that is installed, {package}, is not the one of this checkout. "
            f"Files that are not the same: {', '.join(other)}. Install it first: pip install ."
        )
    if editable and not compiled(package / "plugin"):
        raise SystemExit(
            f"{package / 'plugin'} is not compiled as it is now. Do it first: pip install -e ."
        )
    kind = "the checkout's own files" if editable else "the same files as the checkout's"
    return f"fix_nosquish {metadata.version('fix_nosquish')}: {package}, {kind}"


def differences(package, other):
    """The files of a package that are not the same in another folder,
    or only in one of them; sorted names."""
    ours, theirs = sources(package), sources(other)
    return sorted(
        name for name in ours.keys() | theirs.keys() if ours.get(name) != theirs.get(name)
    )


def sources(folder):
    """From relative names to contents of a package's files, without what is compiled from them."""
    paths = (path for path in folder.rglob("*") if path.suffix in (".py", ".cpp", ".h"))
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def compile_loops():
    """Compile all loops of the package, if they are not: else the first tests would,
    while their clocks run."""
    subprocess.run([sys.executable, "-c", COMPILE], cwd="/", check=True)  # not of the checkout


def compiled(folder):
    """Whether what is compiled in a folder is there, and is as new as its source."""
    made = [path.stat().st_mtime for path in folder.glob("for_*/*plugin.so")]
    source = [*folder.glob("*.cpp"), *folder.glob("*.h"), folder.parent / "structs.py"]
    return bool(made) and min(made) >= max(path.stat().st_mtime for path in source)
