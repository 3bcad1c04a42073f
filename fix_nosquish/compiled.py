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

An argument's annotation is its `Kind`, or a NamedTuple whose fields have kinds: a bundle.  Where
the file of a module's loops is, numba is not even imported, which alone would take longer than all
else at the start of a run; if not, `compile` makes it.

A loop can use functions of `math`, functions that are `inlined`, what `lower.PRIMITIVES` names,
and numbers and tuples of numbers, which are constants to the compiler.  It makes no array and
raises no exception; it returns nothing or an integer.  Nothing checks its indices.
"""

import ctypes
import fcntl
import importlib
import importlib.util
import math
import operator
import os
import pickle
import subprocess
import sys
import time
import warnings
from contextlib import ExitStack, contextmanager
from functools import cache, partial, update_wrapper
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import NamedTuple

import numpy as np

INLINED = {}  # function: the options that numba compiles it with
MODULES = {}  # name: the `Module`
_HASH = 8  # bytes of a file before its machine code
COMPILERS = "lower.py", "compile.py"


class Kind(NamedTuple):
    """What an argument of a loop is: a scalar (of no dimension) or a C-contiguous array."""

    name: str
    dtype: np.dtype
    dimensions: int
    columns: int = 0  # if not 0, the loop is compiled for an array of so many

    def __str__(self):
        if self.columns:
            return f"a C-contiguous {self.dtype} array of {self.columns} columns"
        if self.dimensions:
            return f"a C-contiguous {self.dtype} array of {self.dimensions} dimensions"
        return f"a {self.dtype}"

    def describe(self, value):
        """A value as integers: a number's bits, or an array's address and shape.

        Raises:
            TypeError: for a value that is not of this kind.
        """
        if self is I:
            return [operator.index(value)]
        if self is F:
            return [ctypes.c_int64.from_buffer(ctypes.c_double(value)).value]
        alike = isinstance(value, np.ndarray) and value.dtype == self.dtype
        alike = alike and value.ndim == self.dimensions and value.flags.c_contiguous
        if alike and (not self.columns or value.shape[1] == self.columns):
            return [_address(value), *value.shape]
        raise TypeError


def _address(array):
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(array))
    except (TypeError, ValueError):  # read-only, or empty; this takes four times as long
        return array.ctypes.data


F, F1, F2 = (Kind(f"F{n or ''}", np.dtype(np.float64), n) for n in range(3))
I, L1, L2 = (  # noqa: E741  a kind's letter, as F
    Kind(f"L{n}" if n else "I", np.dtype(np.int64), n) for n in range(3)
)
I1, I2 = (Kind(f"I{n}", np.dtype(np.int32), n) for n in (1, 2))
LANES = 64
F64 = Kind("F64", np.dtype(np.float64), 2, LANES)
KINDS = F, F1, F2, F64, I, L1, L2, I1, I2

_memory = ctypes.pythonapi.PyMemoryView_FromMemory
_memory.restype = ctypes.py_object
_memory.argtypes = [ctypes.c_void_p, ctypes.c_ssize_t, ctypes.c_int]
_WRITABLE = 0x200  # PyBUF_WRITE


def array(address, shape, dtype):
    """A numpy view of memory that something else owns."""
    count = math.prod(shape) * np.dtype(dtype).itemsize
    if not address or not count:
        return np.empty(shape, dtype)
    # (ctypes would make a class for each size)
    return np.frombuffer(_memory(address, count, _WRITABLE), dtype).reshape(shape)


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
        if isinstance(self._owner, np.ndarray) and _address(self._owner) == place:
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


def floats(place, rows, columns):
    """The float64 array (rows, columns) at this place in memory."""


def longs(place, n):
    """The int64 array (n,) at this place in memory."""


def ints(place, n):
    """The int32 array (n,) at this place in memory."""


def int_rows(place, rows, columns):
    """The int32 array (rows, columns) at this place in memory."""


def call(place, *arguments):
    """The integer that the C function at this place gives for up to 7 integers or addresses."""


def loop(function):
    """Decorator of a loop to be compiled: see the head of this file. Returns: the `Loop`."""
    return Loop(function)


class Loop:
    """A compiled loop: call it, or `bind` it to arguments that stay the same."""

    def __init__(self, function):
        update_wrapper(self, function)
        self.name = f"{function.__module__}.{function.__qualname__}"
        notes = function.__annotations__
        self.returns = bool(notes.get("return"))
        self.parameters = {name: what for name, what in notes.items() if name != "return"}
        self.kinds = {}  # of the parameters and of the fields of bundles
        for name, what in self.parameters.items():
            self.kinds |= {name: what} if isinstance(what, Kind) else what.__annotations__
        self.machine_code = None
        self.module = MODULES.setdefault(function.__module__, Module(function.__module__))
        self.module.loops.append(self)

    def __call__(self, *values):
        """Run the loop. Args, Raises: as `bind`. Returns: the loop's integer, or 0."""
        return self.bind(*values)()

    def bind(self, *values):
        """Fix the arguments: each a value, the `Cell` that it is in, or a bundle of such.

        Returns:
            a function without arguments that runs the loop on what is in the arrays and cells then,
            and returns the loop's integer, or 0.
        Raises:
            TypeError: for an argument that is not of its kind.
        """
        if len(values) != len(self.parameters):
            raise TypeError(
                f"{self.name} takes {len(self.parameters)} arguments, not {len(values)}"
            )
        flat = []
        for what, value in zip(self.parameters.values(), values, strict=True):
            flat += [value] if isinstance(what, Kind) else value
        return self._bind(flat)

    def bind_to(self, named, **more):
        """Fix the arguments to what has their names (in a bundle, its fields') in a dictionary."""
        named = {**named, **more}
        return self._bind([named[name] for name in self.kinds])

    def _bind(self, values):
        used = []
        for (name, kind), value in zip(self.kinds.items(), values, strict=True):
            try:
                used.append(value if isinstance(value, Cell) else Cell(kind, value))
                if used[-1].kind != kind:
                    raise TypeError
            except TypeError:
                given = value.kind if isinstance(value, Cell) else type(value).__name__
                if isinstance(value, np.ndarray):
                    layout = "" if value.flags.c_contiguous else ", not contiguous"
                    given = f"{value.dtype} array of {value.ndim} dimensions{layout}"
                message = f"{self.name}: {name} must be {kind}, not a {given}"
                raise TypeError(message) from None
        if not self.machine_code:
            self.module.load()
        addresses = (ctypes.c_int64 * len(used))(*[cell.address for cell in used])
        call = partial(self.machine_code, addresses)
        call.cells = used  # they live as long as their addresses are in use
        return call


# ---------------------------------------------------------------- machine code and its files


def load(communicator, *names):
    """Make the loops of some modules ready; rank 0 reads or makes their code; collective.

    Without this a loop's first use does it, on each rank for itself.

    Args:
        communicator: the `Communicator` or `ALONE`.
        names: of the modules, as `__name__`; those without loops are left out.
    Raises:
        RunError: on all ranks, if they cannot be compiled.
    """
    modules = {name: MODULES[name] for name in names if name in MODULES}
    if not communicator.any(not all(module.ready for module in modules.values())):
        return
    sent = None
    with communicator.together("the loops cannot be compiled or loaded"):
        try:
            if communicator.rank == 0:
                sent = _processor(), {name: module.found() for name, module in modules.items()}
        finally:
            communicator.rest()  # while rank 0 compiles
    processor, codes = communicator.share(sent)
    with communicator.together("the loops cannot be compiled or loaded"):
        for name, module in modules.items():
            if not module.ready:
                if processor == _processor():
                    module.code = codes[name]
                module.load()


def of_package(package):
    """The modules with loops of a package that have been imported."""
    return [one for name, one in MODULES.items() if name.partition(".")[0] == package]


class Module:
    """The loops of a module, and the file of their machine code.

    Attributes:
        code: the machine code, or None while it is not known.
    """

    def __init__(self, name):
        self.name, self.loops, self.ready, self.code = name, [], False, None

    def load(self):
        """Make the loops ready."""
        engine = _engine(self.found())
        for one in self.loops:
            address = engine.get_function_address(one.name)
            one.machine_code = ctypes.CFUNCTYPE(ctypes.c_int64)(address)
            one.machine_code.address = address
            one.machine_code.engine = engine  # which owns the memory
        self.ready = True

    def found(self):
        """The machine code: the file's, or newly compiled."""
        if not self.read():
            with _locked(self.places()):
                if not self.read():  # nor has another process made it meanwhile
                    self._compile()
        return self.code

    def read(self):
        """Look for the machine code in the files. Returns: whether it is known now."""
        for place in self.places() if self.code is None else ():
            try:
                content = place.read_bytes()
            except OSError:
                continue
            if content[:_HASH] == importlib.util.source_hash(content[_HASH:]):
                self.code = content[_HASH:]
                break
        return self.code is not None

    def _compile(self):
        """Compile these loops, and all that the package has imported: a later run may need more."""
        from . import bitcode  # which imports this module

        package = self.name.partition(".")[0]
        missing = [one for one in of_package(package) if one is self or not one.read()]
        long = "3 to 10 s" if {one.name for one in missing} <= set(bitcode.kept()) else "20 to 60 s"
        _tell(f"{package} compiles its loops, once for this machine and version: {long}")
        begin = time.perf_counter()
        codes = in_processes("compile", missing)
        _tell(f"{package} has compiled its loops: {time.perf_counter() - begin:.0f} s")
        for one in missing:
            one.code = codes[one.name]
            one.save()

    def weight(self):
        """About how long it takes to compile the loops, in a unit of its own."""
        return sum(len(repr(_contents(one.__wrapped__))) for one in self.loops)

    def save(self):
        """Keep the machine code in a file."""
        places = self.places()
        content = importlib.util.source_hash(self.code) + self.code
        if not any(_save(place, content) for place in places):
            folders = " nor ".join(str(place.parent) for place in places)
            warnings.warn(
                f"the loops of {self.name} are compiled at each start, because neither "
                f"{folders} can be written",
                RuntimeWarning,
                stacklevel=2,
            )

    def places(self):
        """Where the file may be: beside the module's own compiled file, or in the user's cache.

        Its name tells the processor, the compiler, and all that the code follows from.
        """
        from importlib import metadata  # here, because other ranks can do without

        beside = Path(importlib.util.cache_from_source(sys.modules[self.name].__file__))
        compiler = (
            f"{_processor()} {metadata.version('llvmlite')} {metadata.version('numba')} "
            f"{[Path(__file__).with_name(name).read_text() for name in COMPILERS]}"
        )
        loops = repr([(one.name, one.kinds, _contents(one.__wrapped__)) for one in self.loops])
        beside = beside.with_suffix(f".{_hash(compiler)}.{_hash(loops)}.o")
        cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
        return beside, Path(cache, __package__, _hash(str(beside.parent)), beside.name)


# LLVM works when all functions are one: see `lower._simplify`
NUMBA = {"NUMBA_OPT": "0", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}


def in_processes(program, modules):
    """What `lower` or `compile` makes of modules, by their names, in at most four processes.

    Raises:
        RuntimeError: with what a process says that cannot do it.
    """
    allowed = getattr(os, "sched_getaffinity", None)  # not on macOS
    cores = len(allowed(0)) if allowed else os.cpu_count() or 1
    groups = [(0, []) for _ in range(min(4, cores, len(modules)))]
    for one in sorted(modules, key=Module.weight, reverse=True):
        weight, names = groups.pop(0)
        groups.append((weight + one.weight(), [*names, one.name]))
        groups.sort(key=operator.itemgetter(0))
    # by this process's path: with -m a folder that LAMMPS runs in would come before the library
    start = f"import sys; sys.path[:] = {sys.path}; from runpy import run_module as run; "
    start += f"run({f'{__package__}.{program}'!r}, run_name='__main__')"
    quiet = {"MPI4PY_RC_INITIALIZE": "0"}
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", start, *names],
            env=os.environ | quiet | NUMBA,  # a user's module may import numba
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        for _, names in groups
    ]
    codes, problem = {}, None
    for process in processes:
        output, errors = process.communicate()
        if process.returncode:
            problem = errors.decode(errors="replace").strip() or "the compiler ended"
        else:
            codes |= pickle.loads(output)
    if problem:
        raise RuntimeError(problem)
    return codes


def answer(make):
    """What the processes do: `make` codes of the modules that the command line names."""
    for name in sys.argv[1:]:
        importlib.import_module(name)
    try:
        sys.stdout.buffer.write(pickle.dumps(make(sys.argv[1:])))
    except RuntimeError as error:
        sys.exit(str(error))


def _tell(text):
    print(text, file=sys.stderr, flush=True)


def _hash(text):
    return importlib.util.source_hash(text.encode()).hex()


def _save(place, content):
    """Write a file, whole or not at all, and remove the module's older ones. Returns: whether."""
    part = place.with_name(f"{place.name}.{os.urandom(4).hex()}")
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with open(part, "xb") as file:
            file.write(content)
        part.replace(place)
    except OSError:
        return False
    for old in place.parent.glob(f"{place.name.rsplit('.', 2)[0]}.*.o"):
        if old != place:
            old.unlink(missing_ok=True)
    return True


@contextmanager
def _locked(places):
    """Wait for other processes that compile for these places, if a folder can be locked."""
    with ExitStack() as stack:
        for place in places:
            try:
                place.parent.mkdir(parents=True, exist_ok=True)
                folder = os.open(place.parent, os.O_RDONLY)
                stack.callback(os.close, folder)
                fcntl.flock(folder, fcntl.LOCK_EX)
                break
            except OSError:
                continue
        yield


@cache
def _processor():
    from llvmlite import binding as llvm

    features = llvm.get_host_cpu_features().flatten()
    return f"{llvm.get_process_triple()} {llvm.get_host_cpu_name()} {features}"


def target(cpu=None, features=None):
    """LLVM's idea of a processor, this one by default; an engine that is made with one owns it."""
    from llvmlite import binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    if cpu is None:
        cpu, features = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    default = llvm.Target.from_default_triple()
    return default.create_target_machine(cpu=cpu, features=features, opt=3, jit=True)


def _engine(code):
    """The owner of machine code that is ready to run."""
    from llvmlite import binding as llvm

    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine


def _codes(code):
    """A function's code and that of what is defined in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _contents(function):
    """All that the machine code of a function follows from."""
    codes = list(_codes(function.__code__))
    names = sorted({name for code in codes for name in code.co_names})
    known = function.__globals__
    used = {name: known[name] for name in names if name in known}
    for module in [value for value in used.values() if isinstance(value, ModuleType)]:
        found = [name for name in names if hasattr(module, name)]
        used |= {f"{module.__name__}.{name}": getattr(module, name) for name in found}
    free, cells = function.__code__.co_freevars, function.__closure__ or ()
    used |= {name: cell.cell_contents for name, cell in zip(free, cells, strict=True)}

    def content(value):
        if isinstance(value, FunctionType) and value in INLINED:
            return _contents(value)
        return getattr(value, "__name__", value)

    own = [
        (
            code.co_code,
            [constant for constant in code.co_consts if not isinstance(constant, CodeType)],
            code.co_names,
            code.co_varnames,
        )
        for code in codes
    ]
    values = {name: content(value) for name, value in used.items()}
    return own, values, function.__defaults__, INLINED.get(function)
