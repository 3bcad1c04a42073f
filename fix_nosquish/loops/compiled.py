"""How loops over arrays are written as functions, declared and bound to memory.

    class Points(NamedTuple):
        x: F2
        index: I1

    @inlined
    def square(a, b):
        return a * a + b * b

    @loop
    def lengths(points: Points, result: F1):
        for i in range(len(points.x)):
            result[i] = sqrt(square(points.x[i, 0], points.x[i, 1]))

The annotation of an argument is its `Kind`, or a NamedTuple of kinds (a bundle).  A `record` is a
set of named numbers that Python and loops share:

    Thermostat = record("Thermostat", rate=F, draws=I, sums=(F, 2))

    @loop
    def count(thermostat: Thermostat):
        thermostat.draws += 1

    thermostat = Thermostat(rate=0.5)
    count.bind_to({"thermostat": thermostat})()

A loop can use functions of `math`, functions that are `inlined`, those of `lower.PRIMITIVES`, and
numbers and tuples of numbers, which are constants for the compiler.  It makes no array and raises
no exception; it returns nothing or an integer.  Its indices are not checked.
"""

import ctypes
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from functools import partial, update_wrapper
from types import NoneType, SimpleNamespace
from typing import TYPE_CHECKING, Any, NamedTuple, cast, get_type_hints

import numpy as np

from .machine_code import load_on_this_rank
from .registry import INLINED, LOOPS


class Kind(NamedTuple):
    """What an argument of a loop is: a number, a `record`, or a C-contiguous array.

    Attributes:
        dimensions: 0 for a number and for a record.
        columns: if not 0, the array has this number of columns, which the compiler knows.
    """

    name: str
    dtype: np.dtype
    dimensions: int
    columns: int = 0

    def __str__(self) -> str:
        if self.dtype.names:
            return f"a record {self.name}"
        if self.dimensions:
            return f"a C-contiguous {self.dtype} array of {self.dimensions} dimensions"
        return f"a {self.dtype}"

    def describe(self, value: Any) -> list[int]:
        """A value as integers: the bits of a number, or the address and the shape of an array.

        Raises:
            TypeError: for a value that is not of this kind.
        """
        if self.dtype.names and isinstance(value, np.record) and self.fits(value.dtype):
            return [value.__array_interface__["data"][0]]
        if self is I:
            return [operator.index(value)]
        if self is F:
            return [ctypes.c_int64.from_buffer(ctypes.c_double(value)).value]
        alike = isinstance(value, np.ndarray) and value.dtype == self.dtype
        alike = alike and value.ndim == self.dimensions and value.flags.c_contiguous
        if alike and (not self.columns or value.shape[1] == self.columns):
            return [value.ctypes.data, *value.shape]
        raise TypeError

    def fits(self, dtype: np.dtype) -> bool:
        """Whether this is a record, and a record of that type begins with its fields."""
        fields: Mapping[str, Any] = self.dtype.fields or {}
        others: Mapping[str, Any] = dtype.fields or {}
        return bool(fields) and all(others.get(name) == place for name, place in fields.items())

    # (in Python 3.10 the annotations of a NamedTuple must be callable)
    def __call__(self, **values: Any) -> Any:
        """A record with these values, and zeros in its other fields.

        Returns:
            a `numpy.record`: its fields are attributes.
        Raises:
            TypeError: for a name that is not a field.
        """
        result: Any = np.zeros(1, self.dtype)[0]
        for name, value in values.items():
            if name not in result.dtype.names:
                fields = ", ".join(result.dtype.names)
                raise TypeError(f"the record {self.name} has no field {name}, but {fields}")
            setattr(result, name, value)
        return result

    def of(self, array: np.ndarray) -> Any:
        """The record that is in the first bytes of an array."""
        return array.view(np.uint8)[: self.dtype.itemsize].view(self.dtype)[0]


# `Any` for mypy, for which an annotation by a kind is then no error
F: Any
F1: Any
F2: Any
I: Any  # noqa: E741  a kind's letter, as F
L1: Any
L2: Any
I1: Any
I2: Any
F, F1, F2 = (Kind(f"F{n or ''}", np.dtype(np.float64), n) for n in range(3))
I, L1, L2 = (  # noqa: E741
    Kind(f"L{n}" if n else "I", np.dtype(np.int64), n) for n in range(3)
)
I1, I2 = (Kind(f"I{n}", np.dtype(np.int32), n) for n in (1, 2))
LANES = 64
F64: Any = Kind("F64", np.dtype(np.float64), 2, LANES)


def record(name: str, extends: Kind | None = None, **fields: Any) -> Kind:
    """The `Kind` of a set of named numbers; an argument of this kind is a `numpy.record`.

    Args:
        extends: a record whose fields come first; its loops accept the new record, too.
        fields: F or I for a number, (F, n) or (I, n) for an array of n.
    Raises:
        TypeError: for a field of `extends`, or a name that every `numpy.record` has.
    """
    before: Mapping[str, Any] = (extends.dtype.fields if extends else None) or {}
    for field in fields:
        if field in before or hasattr(np.record, field):
            owner = f"the record {extends.name}" if extends and field in before else "numpy.record"
            raise TypeError(f"record {name}: {owner} has a field {field} already")
    all_fields: list[tuple] = [(field, place[0]) for field, place in before.items()]
    for field, what in fields.items():
        kind, *length = (what,) if isinstance(what, Kind) else what
        all_fields.append((field, kind.dtype, *length))
    return Kind(name, np.dtype((np.record, all_fields)), 0)


def array(address: int | None, shape: Sequence[int], dtype: Any) -> np.ndarray:
    """A numpy view of memory that something else owns; an empty array if there is no address."""
    if not address:
        return np.empty(shape, dtype)
    interface = {"version": 3, "data": (address, False), "shape": tuple(shape)}
    interface["typestr"] = np.dtype(dtype).str
    return np.asarray(SimpleNamespace(__array_interface__=interface))


class Cell:
    """An argument of loops that may change: bound loops read it each time they run.

    Args:
        kind: the `Kind` of the argument.
        value: the first value, or None.
        numbers: int64, memory for 1 + dimensions numbers; None to allocate it.

    Attributes:
        numbers: the value as integers (see `Kind.describe`); C++ and loops set a cell by these.
        address: of these integers.
    """

    def __init__(self, kind: Kind, value: Any = None, numbers: np.ndarray | None = None) -> None:
        self.kind = kind
        numbers = np.zeros(3, np.int64) if numbers is None else numbers
        self.numbers = numbers[: 1 + kind.dimensions]
        self.address: int = self.numbers.ctypes.data
        self._owner: Any = None
        if value is not None:
            self.set(value)

    def set(self, value: Any) -> None:
        """Set the cell to a number or an array, of which it holds a reference.

        Raises:
            TypeError: if the value is not of this kind.
        """
        self.numbers[:] = self.kind.describe(value)
        self._owner = value

    @property
    def array(self) -> np.ndarray:
        """A view of the array; it keeps the memory of an array that was `set`."""
        address, *shape = self.numbers.tolist()
        if isinstance(self._owner, np.ndarray) and self._owner.ctypes.data == address:
            return self._owner.reshape(-1)[: math.prod(shape)].reshape(shape)
        return array(address, shape, self.kind.dtype)

    @property
    def number(self) -> Any:
        """The number."""
        return self.numbers.view(self.kind.dtype)[0].item()


def cells(kinds: Mapping[str, Kind]) -> tuple[np.ndarray, dict[str, Cell]]:
    """Cells whose integers are the rows of one table, (len(kinds), 3); the table, and the cells."""
    table = np.zeros((len(kinds), 3), np.int64)
    named = zip(kinds.items(), table, strict=True)
    return table, {name: Cell(kind, numbers=numbers) for (name, kind), numbers in named}


# ---------------------------------------------------------------- loops


if TYPE_CHECKING:  # functions that numba compiles have no types
    from typing import no_type_check as contracted
    from typing import no_type_check as inlined
    from typing import no_type_check as loop
    from typing import no_type_check as untyped
else:

    def inlined(function):
        """Decorator of a function that loops inline; in Python it stays the plain function."""
        INLINED[function] = {}
        return function

    def contracted(function):
        """Like `inlined`, with fused multiply-add, which rounds a product and a sum once."""
        INLINED[function] = {"fastmath": {"contract"}}
        return function

    def untyped(function):
        """Decorator of a function of which a function makes a `Loop`."""
        return function


# Only loops can call these.
def prefetch(array: Any, row: Any, column: Any) -> None:
    """Prefetch an element of a two-dimensional array into the cache of the processor."""


def address(array: Any) -> Any:
    """The address of an array."""


def call(place: Any, *arguments: Any) -> Any:
    """Call the C function at an address with up to 7 integers or addresses; return its integer."""


def annotations(of: Any) -> dict[str, Any]:
    """The annotations of a function or a class, by name.

    Raises:
        TypeError: for a text that its module does not define, as `from __future__ import
            annotations` may leave.
    """
    try:
        return get_type_hints(of)
    except NameError as error:
        raise TypeError(
            f"{of.__qualname__}: an annotation means nothing in its module ({error}): import or "
            "define it there, or leave out 'from __future__ import annotations'"
        ) from None


class Loop:
    """A loop that is compiled; `bind_to` makes a function of it that runs.

    `loop` is the decorator that makes it from a function: see the beginning of this file.

    Args:
        owner: for a function that another function returns, the module that the loop belongs to,
            and the prefix of its name.
    """

    def __init__(self, function: Callable, owner: tuple[str, str] | None = None) -> None:
        update_wrapper(cast(Any, self), function)
        module, within = owner or (function.__module__, "")
        name = function.__name__ if owner else function.__qualname__
        self.name = ".".join(filter(None, (module, within, name)))
        self.parameters = notes = annotations(function)
        self.returns = notes.pop("return", NoneType) is not NoneType
        arguments = function.__code__.co_varnames[: function.__code__.co_argcount]
        if bare := [name for name in arguments if name not in notes]:
            raise TypeError(
                f"{self.name}: {' and '.join(bare)} must be annotated with a kind, such as F1"
            )
        self.kinds: dict[str, Kind] = {}  # of the parameters, and of the fields of bundles
        for name, what in self.parameters.items():
            more = {name: what} if isinstance(what, Kind) else annotations(what)
            if twice := self.kinds.keys() & more.keys():
                raise TypeError(f"{self.name} has two arguments {' and '.join(sorted(twice))}")
            self.kinds |= more
        self.machine_code: Any = None  # a function of ctypes, once it is loaded
        self.level: int | None = None
        self.module = module
        # a module that is imported again replaces its loops
        others = [loop for loop in LOOPS.get(module, ()) if loop.name != self.name]
        LOOPS[module] = [*others, self]

    def set_machine_code(self, address: int, owner: Any, level: int) -> None:
        """Set the machine code for a level; its memory lives as long as its owner."""
        self.machine_code, self.level = ctypes.CFUNCTYPE(ctypes.c_int64)(address), level
        self.machine_code.address, self.machine_code.owner = address, owner

    def bind_to(self, named: Mapping[str, Any], **more: Any) -> Any:
        """Bind each argument, and each field of a bundle, to the value or `Cell` of its name.

        Returns:
            a function without arguments that runs the loop, and returns its integer, or 0.
        Raises:
            TypeError: for an argument that is missing, or is not of its kind.
            RuntimeError, OSError: if the loop cannot be compiled or loaded.
        """
        named = {**named, **more}
        missing = [name for name in self.kinds if name not in named]
        if missing:
            raise TypeError(
                f"{self.name} takes {' and '.join(missing)}, for which there is no cell: an "
                f"integrator adds cells by the method own_cells to {', '.join(named)}"
            )
        used: list[Cell] = []
        for name, kind in self.kinds.items():
            value = named[name]
            try:
                used.append(value if isinstance(value, Cell) else Cell(kind, value))
                if not (used[-1].kind == kind or kind.fits(used[-1].kind.dtype)):
                    raise TypeError
            except TypeError:
                given = value.kind if isinstance(value, Cell) else type(value).__name__
                if isinstance(value, np.ndarray):
                    layout = "" if value.flags.c_contiguous else ", not contiguous"
                    given = f"{value.dtype} array of {value.ndim} dimensions{layout}"
                message = f"{self.name}: {name} must be {kind}, not a {given}"
                raise TypeError(message) from None
        if not self.machine_code:
            load_on_this_rank(self.module)
        addresses = (ctypes.c_int64 * len(used))(*[cell.address for cell in used])
        call: Any = partial(self.machine_code, addresses)
        call.cells = used  # keeps their addresses valid
        call.name = self.name.rpartition(".")[2]
        return call


if not TYPE_CHECKING:
    loop = Loop
