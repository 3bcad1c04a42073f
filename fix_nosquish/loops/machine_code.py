"""The machine code of loops: the package's own is in a library, that of others is made by `own`.

The build compiles the package's loops for levels of what processors can do, a library each. The
ranks of a run take the one for the highest level that all of them have. An editable install has no
library: then all loops are compiled as one's own, and none is older than its source.
"""

import ctypes
import os
from collections.abc import Callable
from functools import cache
from itertools import takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .compiled import Loop

PACKAGE = __name__.partition(".")[0]
FOLDER = Path(__file__).parent.parent
# what each level of x86-64 adds to those before, in Linux's words (the levels are the psABI's)
ADDED = {
    "x86-64": set(),
    "x86-64-v2": {"cx16", "lahf_lm", "popcnt", "pni", "sse4_1", "sse4_2", "ssse3"},
    "x86-64-v3": {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"},
    "x86-64-v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
}
MACHINE = os.uname().machine
LEVELS = list(ADDED) if MACHINE == "x86_64" else [MACHINE]  # from the lowest one on
FAILED = "the loops cannot be compiled or loaded"

INLINED: dict[Callable, dict[str, Any]] = {}  # function: the options that numba compiles it with
LOOPS: dict[str, list["Loop"]] = {}  # by their modules' names


@cache
def level():
    """The number in `LEVELS` of the highest that this processor has."""
    if LEVELS == [MACHINE] or not os.path.exists("/proc/cpuinfo"):
        return 0
    with open("/proc/cpuinfo") as lines:
        known = set(next(line for line in lines if line.startswith("flags")).split())
    return len(list(takewhile(lambda name: ADDED[name] <= known, LEVELS))) - 1


@cache
def built(highest):
    """The package's loops for a level, or for the next one below that there is.

    Returns:
        None in an editable install.
    Raises:
        RuntimeError: if there are others only.
    """
    for name in reversed(LEVELS[: highest + 1]):
        if (file := FOLDER / f"loops_{name}.so").exists():
            return ctypes.CDLL(str(file))
    if others := sorted(file.stem.removeprefix("loops_") for file in FOLDER.glob("loops_*.so")):
        raise RuntimeError(
            f"a rank's processor is no {others[0]}, for which {PACKAGE} was compiled: compile it "
            f"with NOSQUISH_LEVELS={LEVELS[highest]} in the environment"
        )
    return None


def load(communicator, *names):
    """Make the loops of some modules ready; rank 0 reads or makes those of one's own; collective.

    Args:
        communicator: the `Communicator` or `ALONE`.
        names: of the modules, as `__name__`; those without loops are left out.
    Raises:
        RunError: on all ranks, if they cannot be compiled or loaded.
    """
    agreed, others, codes = communicator.least(level()), [], None
    wanted = [name for name in names if name in LOOPS]
    if not communicator.any(any(one.level != agreed for name in wanted for one in LOOPS[name])):
        return
    with communicator.together(FAILED):
        others = _take_ours(wanted, agreed)
    if not others:
        return
    from . import own  # few need it

    with communicator.together(FAILED):
        try:
            if communicator.rank == 0:
                codes = own.codes(others, LEVELS[agreed])
        finally:
            communicator.rest()  # while rank 0 compiles
    codes = communicator.share(codes)
    with communicator.together(FAILED):
        own.take(codes, agreed)


def load_here(name):
    """Make the loops of a module ready on this rank, at the first use of one without `load`.

    Raises:
        RuntimeError, OSError: if they cannot be compiled or loaded.
    """
    if others := _take_ours([name], level()):
        from . import own

        own.take(own.codes(others, LEVELS[level()]), level())


def _take_ours(names, agreed):
    """Take loops of the library. Returns: the names of the modules that it has not."""
    known, others = built(agreed), []
    for name in names:
        functions: list[Any] = [getattr(known, one.name, None) for one in LOOPS[name]]
        if all(functions):
            for one, function in zip(LOOPS[name], functions, strict=True):
                one.take(ctypes.cast(function, ctypes.c_void_p).value, known, agreed)
        else:
            others.append(name)
    return others
