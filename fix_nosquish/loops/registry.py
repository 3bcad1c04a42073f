"""The loops that modules declare, and the functions that loops inline."""

from collections.abc import Callable
from typing import Any

PACKAGE = __name__.partition(".")[0]

INLINED: dict[Callable, dict[str, Any]] = {}  # function: the options that numba compiles it with
LOOPS: dict[str, list[Any]] = {}  # of each module, by its name, the `compiled.Loop`s
