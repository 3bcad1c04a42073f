"""Loops over arrays, written as functions and compiled once to machine code that a file keeps.

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

An argument's annotation is its `Kind`, or a NamedTuple whose fields have kinds: a bundle.  Numbers
that belong together are a `record`, which has a name for each, in Python as in loops:

    Thermostat = record("Thermostat", rate=F, draws=I, sums=(F, 2))

    @loop
    def count(thermostat: Thermostat):
        thermostat.draws += 1

    thermostat = Thermostat(rate=0.5)
    count(thermostat)

Where the machine code is kept, and who makes it, `machine_code` says.

A loop can use functions of `math`, functions that are `inlined`, what `lower.PRIMITIVES` names,
and numbers and tuples of numbers, which are constants to the compiler.  It makes no array and
raises no exception; it returns nothing or an integer.  Nothing checks its indices.
"""

import ctypes
import math
import operator
from collections.abc import Mapping
from functools import partial, update_wrapper
from types import NoneType, SimpleNamespace
from typing import Any, NamedTuple, cast, get_type_hints

import numpy as np

from .machine_code import INLINED, LOOPS, load_here


class Kind(NamedTuple):
    """What an argument of a loop is: a scalar or a `record` (of no dimension), or a C-contiguous
    array."""

    name: str
    dtype: np.dtype
    dimensions: int
    columns: int = 0  # if not 0, the loop is compiled for an array of so many

    def __str__(self):
        if self.dtype.names:
            return f"a record {self.name}"
        if self.dimensions:
            return f"a C-contiguous {self.dtype} array of {self.dimensions} dimensions"
        return f"a {self.dtype}"

    def describe(self, value):
        """A value as integers: a number's bits, or an array's address and shape.

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

    def fits(self, dtype):
        """Whether this is a record, and numbers of that type have its fields where it has them."""
        own: Mapping[str, Any] = self.dtype.fields or {}
        theirs = dtype.fields or {}
        return bool(own) and all(theirs.get(name) == place for name, place in own.items())

    # (Python 3.10 takes as a NamedTuple's annotations only what can be called)
    def __call__(self, **values):
        """A record of zeros, but for these fields.

        Returns:
            a `numpy.record`: its fields are attributes.
        Raises:
            TypeError: for a name that it does not have.
        """
        made = np.zeros(1, self.dtype)[0]
        for name, value in values.items():
            if name not in made.dtype.names:
                raise TypeError(
                    f"the record {self.name} has no field {name}, but {', '.join(made.dtype.names)}"
                )
            setattr(made, name, value)
        return made

    def of(self, array):
        """The record whose memory is the begin of an array."""
        return array.view(np.uint8)[: self.dtype.itemsize].view(self.dtype)[0]


F, F1, F2 = (Kind(f"F{n or ''}", np.dtype(np.float64), n) for n in range(3))
I, L1, L2 = (  # noqa: E741  a kind's letter, as F
    Kind(f"L{n}" if n else "I", np.dtype(np.int64), n) for n in range(3)
)
I1, I2 = (Kind(f"I{n}", np.dtype(np.int32), n) for n in (1, 2))
LANES = 64
F64 = Kind("F64", np.dtype(np.float64), 2, LANES)


def record(name, extends=None, **fields):
    """The `Kind` of numbers that have names; an argument of this kind is a `numpy.record`.

    Args:
        extends: another record, whose fields come before. Loops that take that one take this, too.
        fields: each is F or I, or a pair of this and how many there are.
    Raises:
        TypeError: for a field that there is already, or a name that all numpy's records have.
    """
    before = extends.dtype.fields if extends else {}
    for field in fields:
        if field in before or hasattr(np.record, field):
            owner = f"the record {extends.name}" if field in before else "each numpy.record"
            raise TypeError(f"record {name}: {owner} has a field {field} already")
    all_fields = [(field, place[0]) for field, place in before.items()]
    for field, what in fields.items():
        kind, *count = (what,) if isinstance(what, Kind) else what
        all_fields.append((field, kind.dtype, *count))
    return Kind(name, np.dtype((np.record, all_fields)), 0)


def array(address, shape, dtype):
    """A numpy view of memory that something else owns."""
    if not address:
        return np.empty(shape, dtype)
    place = {"version": 3, "data": (address, False), "shape": tuple(shape)}
    place["typestr"] = np.dtype(dtype).str
    return np.asarray(SimpleNamespace(__array_interface__=place))


class Cell:
    """Where loops find an argument each time they run: a bound loop follows it when it is set anew.

    Args:
        kind: the argument's `Kind`.
        value: what is in it from the start, or None.
        numbers: int64, memory for 1 + dimensions numbers; None for its own.

    Attributes:
        numbers: the value as integers (see `Kind.describe`); who writes others here sets the cell.
        address: of these integers.
    """

    def __init__(self, kind, value=None, numbers=None):
        self.kind = kind
        numbers = np.zeros(3, np.int64) if numbers is None else numbers
        self.numbers = numbers[: 1 + kind.dimensions]
        self.address, self._owner = self.numbers.ctypes.data, None
        if value is not None:
            self.set(value)

    def set(self, value):
        """Put an array, which lives as long as it is here, or a number here.

        Raises:
            TypeError: if it is not of the kind.
        """
        self.numbers[:] = self.kind.describe(value)
        self._owner = value

    @property
    def array(self):
        """A view of the array that is here now; it keeps the memory of one that was set here."""
        place, *shape = self.numbers.tolist()
        if isinstance(self._owner, np.ndarray) and self._owner.ctypes.data == place:
            return self._owner.reshape(-1)[: math.prod(shape)].reshape(shape)
        return array(place, shape, self.kind.dtype)

    @property
    def number(self):
        """The number that is here now."""
        return self.numbers.view(self.kind.dtype)[0].item()


def cells(kinds):
    """Cells side by side, so that a loop can set them.

    Args:
        kinds: a dictionary from names to `Kind`.
    Returns:
        (cells (len(kinds), 3), dictionary): their integers, and from names to each `Cell`.
    """
    table = np.zeros((len(kinds), 3), np.int64)
    named = zip(kinds.items(), table, strict=True)
    return table, {name: Cell(kind, numbers=numbers) for (name, kind), numbers in named}


# ---------------------------------------------------------------- loops


def inlined(function=None, *, contract=False):
    """Decorator of a function that loops inline; Python's own callers have the plain function.

    Args:
        contract: whether a product and a sum may be rounded as one (fused multiply-add).
    """
    if function is None:
        return partial(inlined, contract=contract)
    INLINED[function] = {"fastmath": {"contract"}} if contract else {}
    return function


# what only loops can call
def prefetch(array, row, column):
    """Have the processor fetch an element of a two-dimensional array that a loop needs soon."""


def address(array):
    """Where an array begins in memory."""


def longs(place, n):
    """The int64 array (n,) at this place in memory."""


def call(place, *arguments):
    """The integer that the C function at this place gives for up to 7 integers or addresses."""


def annotations(of):
    """The annotations of a function or a class, by names, in whatever form Python keeps them.

    Raises:
        TypeError: for a text that tells nothing, as `from __future__ import annotations` leaves it.
    """
    try:
        return get_type_hints(of)
    except NameError as error:
        raise TypeError(
            f"{of.__qualname__}: an annotation means nothing in its module ({error}): import or "
            "define it there, or leave out 'from __future__ import annotations'"
        ) from None


class Loop:
    """A loop that is compiled; it runs when its arguments are bound, by `bind_to`.

    `loop` is the decorator that makes one of a function: see the head of this file.

    Args:
        owner: of a function that is made in another one, the name of the module whose loop it is,
            and what its own name stands behind.
    """

    def __init__(self, function, owner=None):
        update_wrapper(cast(Any, self), function)
        module, within = owner or (function.__module__, "")
        own_name = function.__name__ if owner else function.__qualname__
        name = f"{within}.{own_name}" if within else own_name
        self.name = f"{module}.{name}"
        self.parameters = notes = annotations(function)
        self.returns = notes.pop("return", NoneType) is not NoneType
        arguments = function.__code__.co_varnames[: function.__code__.co_argcount]
        if bare := [name for name in arguments if name not in notes]:
            raise TypeError(
                f"{self.name}: {' and '.join(bare)} must be annotated with a kind, such as F1"
            )
        self.kinds: dict[str, Kind] = {}  # of the parameters and of the fields of bundles
        for name, what in self.parameters.items():
            more = {name: what} if isinstance(what, Kind) else annotations(what)
            if twice := self.kinds.keys() & more.keys():
                raise TypeError(f"{self.name} has two arguments {' and '.join(sorted(twice))}")
            self.kinds |= more
        self.machine_code: Any = None  # a function of ctypes, once it is loaded
        self.level, self.module = None, module
        # a module that is imported once more has its loops once
        others = [one for one in LOOPS.get(module, ()) if one.name != self.name]
        LOOPS[module] = [*others, self]

    def take(self, address, owner, level):
        """Have the machine code at an address, for a level, in memory that the owner has."""
        self.machine_code, self.level = ctypes.CFUNCTYPE(ctypes.c_int64)(address), level
        self.machine_code.address, self.machine_code.owner = address, owner

    def bind_to(self, named, **more):
        """Fix the arguments to what has their names (in a bundle, its fields') in a dictionary.

        Returns:
            a function without arguments that runs the loop on what is in the arrays and cells then,
            and returns the loop's integer, or 0.
        Raises:
            TypeError: for an argument that has no name there, or is not of its kind.
            RuntimeError, OSError: if the loop cannot be compiled or loaded.
        """
        named = {**named, **more}
        missing = [name for name in self.kinds if name not in named]
        if missing:
            raise TypeError(
                f"{self.name} takes {' and '.join(missing)}, of which there is no cell: an "
                f"integrator gives its own by the method own_cells, besides {', '.join(named)}"
            )
        used = []
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
            load_here(self.module)
        addresses = (ctypes.c_int64 * len(used))(*[cell.address for cell in used])
        call = partial(self.machine_code, addresses)
        call.cells = used  # they live as long as their addresses are in use
        call.name = self.name.rpartition(".")[2]
        return call


loop = Loop
