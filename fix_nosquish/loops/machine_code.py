"""Load the machine code of loops: the package's own from its library, others from `cache`.

The build compiles the package's loops into one library for each level of instructions.  The ranks
of a run use the highest level that all of them have.  An editable install has no library: its loops
are compiled like those of users, so that none is older than its source.
"""

import ctypes
import os
from collections.abc import Iterable
from functools import cache as cached
from itertools import takewhile
from pathlib import Path
from typing import Any

from .registry import LOOPS, PACKAGE

FOLDER = Path(__file__).parent.parent
# what each level of x86-64 adds to those before, as /proc/cpuinfo names it (levels of the psABI)
ADDED: dict[str, set[str]] = {
    "x86-64": set(),
    "x86-64-v2": {"cx16", "lahf_lm", "popcnt", "pni", "sse4_1", "sse4_2", "ssse3"},
    "x86-64-v3": {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"},
    "x86-64-v4": {"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"},
}
MACHINE = os.uname().machine
LEVELS = list(ADDED) if MACHINE == "x86_64" else [MACHINE]  # lowest first
FAILED = "the loops cannot be compiled or loaded"


@cached
def level() -> int:
    """The index in `LEVELS` of the highest level of this processor."""
    if LEVELS == [MACHINE]:
        return 0
    with open("/proc/cpuinfo") as lines:
        flags = set(next(line for line in lines if line.startswith("flags")).split())
    return len(list(takewhile(lambda name: ADDED[name] <= flags, LEVELS))) - 1


@cached
def library(highest: int) -> ctypes.CDLL | None:
    """The package's loops for a level, or for the next lower one that was built.

    Returns:
        None in an editable install.
    Raises:
        RuntimeError: if only higher levels were built.
    """
    for name in reversed(LEVELS[: highest + 1]):
        if (file := FOLDER / f"loops_{name}.so").exists():
            return ctypes.CDLL(str(file))
    if others := sorted(file.stem.removeprefix("loops_") for file in FOLDER.glob("loops_*.so")):
        raise RuntimeError(
            f"{PACKAGE} was compiled for {others[0]}, which the processor of a rank is not: "
            f"compile it again with NOSQUISH_LEVELS={LEVELS[highest]} in the environment"
        )
    return None


def load(communicator: Any, *names: str) -> None:
    """Load the loops of modules; rank 0 reads or compiles those that are not the package's.

    Collective.

    Args:
        communicator: the `Communicator` or `ALONE`.
        names: of the modules, as `__name__`; modules without loops are ignored.
    Raises:
        RunError: on all ranks, if loops cannot be compiled or loaded.
    """
    agreed = communicator.least(level())
    others: list[str] = []
    codes: dict[str, bytes] = {}
    wanted = [name for name in names if name in LOOPS]
    if not communicator.any(any(loop.level != agreed for name in wanted for loop in LOOPS[name])):
        return
    with communicator.together(FAILED):
        others = _load_from_library(wanted, agreed)
    if not others:
        return
    from . import cache  # few runs need it

    with communicator.together(FAILED):
        try:
            if communicator.rank == 0:
                codes = cache.machine_code(others, LEVELS[agreed])
        finally:
            communicator.wait()  # while rank 0 compiles
    codes = communicator.share(codes)
    with communicator.together(FAILED):
        cache.load(codes, agreed)


def load_on_this_rank(name: str) -> None:
    """Load the loops of a module that is used without `load`.

    Raises:
        RuntimeError, OSError: if they cannot be compiled or loaded.
    """
    if others := _load_from_library([name], level()):
        from . import cache

        cache.load(cache.machine_code(others, LEVELS[level()]), level())


def _load_from_library(names: Iterable[str], agreed: int) -> list[str]:
    """Load loops of the library. Returns: the names of the modules that it does not have."""
    compiled, others = library(agreed), []
    for name in names:
        functions: list[Any] = [getattr(compiled, loop.name, None) for loop in LOOPS[name]]
        if not all(functions):
            others.append(name)
            continue
        for loop, function in zip(LOOPS[name], functions, strict=True):
            address = ctypes.cast(function, ctypes.c_void_p).value
            loop.set_machine_code(address, compiled, agreed)
    return others
