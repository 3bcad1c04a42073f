"""What ranks send each other: messages, bytes and collectives of a run, counted in MPI itself.

    environment = counting.environment(folder)      # variables with which to start mpirun
    ...                                             # the run
    counts = counting.read(folder)                  # one dictionary per rank

The run calls ``MPI_Pcontrol(0)`` (``MPI.Pcontrol(0)`` in mpi4py) to leave out what follows, and
``MPI_Pcontrol(1)`` to go on counting; without a count these do nothing.
"""

import json
import os
import shlex
import shutil
import subprocess
from importlib import metadata
from pathlib import Path

SOURCE = Path(__file__).with_name("mpi_count.c")


def environment(folder: Path) -> dict[str, str]:
    """Environment variables for a run that is counted, with this interpreter's mpich.

    Args:
        folder: where the ranks leave their counts; made if it is not there, and emptied of older
            counts.
    Raises:
        SystemExit: if there is no C compiler, no mpich or the compiler fails, with what to do about
            it.
    """
    folder = Path(folder).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.json"):
        old.unlink()
    library = folder / "mpi_count.so"
    headers, mpi = _mpich("mpi.h").parent, _mpich("libmpi.so.12")
    command = [
        *(*_compiler(), "-O2", "-shared", "-fPIC", "-I", str(headers), str(SOURCE)),
        *("-o", str(library), str(mpi), f"-Wl,-rpath,{mpi.parent}", "-ldl"),
    ]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode:
        raise SystemExit(
            f"{SOURCE.name}, which counts messages, does not compile: {shlex.join(command)}\n"
            f"{done.stdout}"
        )
    preload = " ".join(filter(None, (str(library), os.environ.get("LD_PRELOAD"))))
    return {"LD_PRELOAD": preload, "MPI_COUNT_FOLDER": str(folder)}


def read(folder: Path) -> list[dict]:
    """The counts of a run that has ended, one dictionary per rank in the order of the ranks.

    ``messages`` and ``bytes``: sends to other ranks and their data; ``collectives`` and
    ``collective_bytes``: calls such as MPI_Allreduce, and the size of what the rank gives into
    them; with ``fix_`` before each: those that fixes made, in their turns in LAMMPS's class Modify.

    Raises:
        FileNotFoundError: if a run left no counts.
    """
    files = sorted(Path(folder).glob("*.json"), key=lambda file: int(file.stem))
    if not files:
        raise FileNotFoundError(
            f"no counts in {folder}: the run did not reach MPI_Finalize, or was without "
            "environment()"
        )
    return [json.loads(file.read_text()) for file in files]


def _compiler():
    known = filter(shutil.which, ("cc", "gcc", "clang"))
    command = shlex.split(os.environ.get("CC", "")) or [next(known, "")]
    if not shutil.which(command[0]):
        raise SystemExit(
            "messages are counted by a small C program, but there is no C compiler "
            "(looked for CC, cc, gcc, clang): install one (Debian and Ubuntu: apt-get install gcc)"
        )
    return command


def _mpich(name):
    """The path of an installed file of the package mpich."""
    try:
        files = metadata.files("mpich") or ()
    except metadata.PackageNotFoundError:
        files = ()
    for file in files:
        if file.name == name:
            return Path(file.locate()).resolve()
    raise SystemExit(
        f"messages are counted with the package mpich, which is not here, or without its {name}: "
        "pip install mpich"
    )
