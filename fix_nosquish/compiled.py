"""Loops over arrays, written as functions and compiled once to machine code that is kept in a file.

    @inlined
    def square(a, b):
        return a * a + b * b

    @loop
    def lengths(x: F2, result: F1):
        for i in range(len(x)):
            result[i] = sqrt(square(x[i, 0], x[i, 1]))

numba compiles a loop with the functions that it inlines, and a file keeps what it made of a module's loops. Where that
file is, numba is not even imported, which alone would take longer than all else at the start of a run.

Beside its arguments a loop can use functions of `math`, functions that are `inlined` and numbers and tuples of
numbers, which the compiler takes as constants. It must not make an array nor raise an exception; it returns nothing or
an integer. Nothing checks its indices.
"""

import ctypes
import fcntl
import gc
import importlib.util
import math
import operator
import os
import sys
import time
import warnings
from contextlib import ExitStack, contextmanager
from functools import cache, partial, update_wrapper
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import NamedTuple

import numpy as np

_inlined = {}  # function: the options that numba compiles it with
_modules = {}  # name: the `_Module`
_HASH = 8  # bytes of a file before its machine code


class Kind(NamedTuple):
    """What an argument of a loop is: a scalar (of no dimension) or a C-contiguous array."""

    dtype: np.dtype
    dimensions: int

    def __str__(self):
        return (
            f"a C-contiguous {self.dtype} array of {self.dimensions} dimensions"
            if self.dimensions
            else f"a {self.dtype}"
        )

    def describe(self, value):
        """A value as integers: a number's bits, or an array's address and shape. Raises: TypeError."""
        if self is I:
            return [operator.index(value)]
        if self is F:
            return [ctypes.c_int64.from_buffer(ctypes.c_double(value)).value]
        if (
            isinstance(value, np.ndarray)
            and value.dtype == self.dtype
            and value.ndim == self.dimensions
            and value.flags.c_contiguous
        ):
            return [_address(value), *value.shape]
        raise TypeError


def _address(array):
    try:
        return ctypes.addressof(ctypes.c_char.from_buffer(array))
    except (TypeError, ValueError):  # read-only, or empty; this takes four times as long
        return array.ctypes.data


F, F1, F2 = (Kind(np.dtype(np.float64), dimensions) for dimensions in range(3))
I, L1, L2 = (Kind(np.dtype(np.int64), dimensions) for dimensions in range(3))
I1, I2 = (Kind(np.dtype(np.int32), dimensions) for dimensions in (1, 2))

_memory = ctypes.pythonapi.PyMemoryView_FromMemory
_memory.restype, _memory.argtypes = (
    ctypes.py_object,
    [ctypes.c_void_p, ctypes.c_ssize_t, ctypes.c_int],
)
_WRITABLE = 0x200  # PyBUF_WRITE


def array(address, shape, dtype):
    """A numpy view of memory that something else owns."""
    count = math.prod(shape) * np.dtype(dtype).itemsize
    if not address or not count:
        return np.empty(shape, dtype)
    # (ctypes would make a class for each size)
    return np.frombuffer(_memory(address, count, _WRITABLE), dtype).reshape(shape)


class Cell:
    """Where loops find an argument each time they run: those that are bound to a cell follow it when it is set anew.

    Args:
        kind: the argument's `Kind`.
        value: what is in it from the start, or None.
        numbers: int64, memory for 1 + dimensions numbers; None for its own.

    Attributes:
        numbers: the value as integers (see `Kind.describe`); whoever writes other ones here sets the cell, too.
        address: of these integers.
        owners: arrays, by their addresses, that live as long as the cell: those at which it may be pointed.
    """

    def __init__(self, kind, value=None, numbers=None):
        self.kind = kind
        self.numbers = (np.zeros(3, np.int64) if numbers is None else numbers)[
            : 1 + kind.dimensions
        ]
        self.address, self.owners = self.numbers.ctypes.data, {}
        if value is not None:
            self.set(value)

    def set(self, value):
        """Put an array or a number here. Raises: TypeError, if it is not of the kind."""
        self.numbers[:] = self.kind.describe(value)
        self.owners = {self.numbers[0].item(): value} if self.kind.dimensions else {}

    @property
    def array(self):
        """A view of the array that is here now; it keeps the memory if the cell's owners do."""
        address, *shape = self.numbers.tolist()
        if address in self.owners:
            return self.owners[address].reshape(-1)[: math.prod(shape)].reshape(shape)
        return array(address, shape, self.kind.dtype)

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
    return table, {
        name: Cell(kind, numbers=numbers) for (name, kind), numbers in zip(kinds.items(), table)
    }


def inlined(function=None, *, contract=False):
    """Decorator of a function that loops inline; Python's own callers have the plain function.

    Args:
        contract: whether the compiler may round a product and a sum as one (fused multiply-add).
    """
    if function is None:
        return partial(inlined, contract=contract)
    _inlined[function] = {"fastmath": {"contract"}} if contract else {}
    return function


def loop(function):
    """Decorator of a loop to be compiled; each argument's annotation is its `Kind`. Returns: the `Loop`."""
    return Loop(function)


def prefetch(array, row, column):
    """Have the processor fetch an element of a two-dimensional array that a loop will soon need; does nothing in Python."""


def load(world, *names):
    """Make the loops of some modules ready now, with the machine code that rank 0 reads or compiles; collective.

    Without this a loop's first use does it, on each rank for itself.  Rank 0 tells standard error when it compiles.

    Args:
        world: the `World` or `Alone`.
        names: of the modules, as `__name__`; those without loops are left out.
    Raises:
        RunError: on all ranks, if they cannot be compiled.
    """
    modules = {name: _modules[name] for name in names if name in _modules}
    if not world.any(not all(module.ready for module in modules.values())):
        return
    sent = None
    with _together(world):
        if world.rank == 0:
            sent = _processor(), {name: module.found() for name, module in modules.items()}
    processor, codes = world.share(sent)
    with _together(world):
        for name, module in modules.items():
            if not module.ready:
                if processor == _processor():
                    module.code = codes[name]
                module.load()


@contextmanager
def _together(world):
    """What fails on one rank ends the run on all; collective."""
    try:
        yield
    except Exception as error:
        world.agree(f"the loops cannot be compiled or loaded: {type(error).__name__}: {error}")
    else:
        world.agree(None)


class Loop:
    """A compiled loop: call it, or `bind` it to arguments that stay the same."""

    def __init__(self, function):
        update_wrapper(self, function)
        self.name = f"{function.__module__}.{function.__name__}"
        self.kinds = {
            name: kind for name, kind in function.__annotations__.items() if name != "return"
        }
        self.machine_code = None
        self.module = _modules.setdefault(function.__module__, _Module(function.__module__))
        self.module.loops.append(self)

    def __call__(self, *values):
        """Run the loop. Args, Raises: as `bind`. Returns: the loop's integer, or 0."""
        return self.bind(*values)()

    def bind(self, *values):
        """Fix the arguments: each a value or the `Cell` that it is in.

        Returns:
            a function without arguments that runs the loop on what is in the arrays and cells then, and returns the
            loop's integer, or 0.
        Raises:
            TypeError: for an argument that is not of its kind.
        """
        if len(values) != len(self.kinds):
            raise TypeError(f"{self.name} takes {len(self.kinds)} arguments, not {len(values)}")
        used = []
        for (name, kind), value in zip(self.kinds.items(), values):
            try:
                used.append(value if isinstance(value, Cell) else Cell(kind, value))
                if used[-1].kind != kind:
                    raise TypeError
            except TypeError:
                given = value.kind if isinstance(value, Cell) else type(value).__name__
                if isinstance(value, np.ndarray):
                    layout = "" if value.flags.c_contiguous else ", not contiguous"
                    given = f"{value.dtype} array of {value.ndim} dimensions{layout}"
                raise TypeError(f"{self.name}: {name} must be {kind}, not a {given}") from None
        if not self.machine_code:
            self.module.load()
        call = partial(
            self.machine_code, (ctypes.c_int64 * len(used))(*[cell.address for cell in used])
        )
        call.cells = used  # they live as long as their addresses are in use
        return call

    def bind_to(self, named, **more):
        """`bind` to those of these values and cells, a dictionary and more, that have the names of its arguments."""
        named = {**named, **more}
        return self.bind(*[named[name] for name in self.kinds])


class _Module:
    """The loops of a module, and the file of their machine code.

    Attributes:
        code: the machine code, or None while it is not known.
    """

    def __init__(self, name):
        self.name, self.loops, self.ready, self.code = name, [], False, None

    def load(self):
        """Make the loops ready."""
        engine = _engine(self.found())
        for loop in self.loops:
            address = engine.get_function_address(loop.name)
            loop.machine_code = ctypes.CFUNCTYPE(ctypes.c_int64)(address)
            loop.machine_code.address = address
            loop.machine_code.engine = engine  # which owns the memory
        self.ready = True

    def found(self):
        """The machine code: the file's, or newly compiled.

        All that the package has imported is compiled with it, so that a later run, which may need more of it, compiles nothing.
        """
        if not self.read():
            package = self.name.partition(".")[0]
            modules = [
                module for name, module in _modules.items() if name.partition(".")[0] == package
            ]
            with _locked(self.places()):
                if not self.read():  # nor has another process made it meanwhile
                    print(
                        f"{package} compiles its loops, once for this machine and version: about 15 s",
                        file=sys.stderr,
                        flush=True,
                    )
                    begin = time.perf_counter()
                    for module in sorted(modules, key=lambda module: module is not self):
                        if not module.read() and not module.compile():
                            break  # what cannot be kept is compiled for this run alone
                    print(
                        f"{package} has compiled its loops: {time.perf_counter() - begin:.0f} s",
                        file=sys.stderr,
                        flush=True,
                    )
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

    def compile(self):
        """Make the machine code, and keep it if there is a place for it. Returns: whether there is."""
        places, self.code = self.places(), _compile(self.loops)
        kept = any(
            _save(place, importlib.util.source_hash(self.code) + self.code) for place in places
        )
        if not kept:
            folders = " nor ".join(str(place.parent) for place in places)
            warnings.warn(
                f"the loops of {self.name} are compiled at each start, because neither {folders} can be written",
                RuntimeWarning,
            )
        return kept

    def places(self):
        """Where the file may be: beside the module's own compiled file, or in the user's cache.

        It has a name of its own for each processor and compiler, and for all that the code follows from.
        """
        from importlib import metadata  # here, because other ranks can do without

        beside = Path(importlib.util.cache_from_source(sys.modules[self.name].__file__))
        compiler = f"{_processor()} {metadata.version('llvmlite')} {metadata.version('numba')}"
        loops = repr(
            [(loop.name, loop.__annotations__, _contents(loop.__wrapped__)) for loop in self.loops]
        )
        beside = beside.with_suffix(
            f".{_hash(compiler)}.{_hash(__loader__.get_source(__name__) + loops)}.o"
        )
        cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
        return beside, Path(cache, __package__, _hash(str(beside.parent)), beside.name)


def _hash(text):
    return importlib.util.source_hash(text.encode()).hex()


def _save(place, content):
    """Write a file, whole or not at all, and remove the older ones of that module. Returns: whether it could."""
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
    """Wait for other processes that compile for one of these places; where no folder can be locked, do not."""
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

    return f"{llvm.get_process_triple()} {llvm.get_host_cpu_name()} {llvm.get_host_cpu_features().flatten()}"


@cache
def _target():
    """LLVM's idea of this processor."""
    from llvmlite import binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_default_triple().create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        jit=True,
    )


def _engine(code):
    """The owner of machine code that is ready to run."""
    from llvmlite import binding as llvm

    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())
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
    used = {name: function.__globals__[name] for name in names if name in function.__globals__}
    for module in [value for value in used.values() if isinstance(value, ModuleType)]:
        used |= {
            f"{module.__name__}.{name}": getattr(module, name)
            for name in names
            if hasattr(module, name)
        }
    used |= {
        name: cell.cell_contents
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or ())
    }
    return (
        [(code.co_code, [c for c in code.co_consts if not isinstance(c, CodeType)], code.co_names, code.co_varnames) for code in codes],
        {name: _contents(value) if isinstance(value, FunctionType) and value in _inlined else getattr(value, "__name__", value)
         for name, value in used.items()},
        function.__defaults__, _inlined.get(function),
    )  # fmt: skip


_OPTIONS = {"_nrt": False}  # nothing counts who uses an array: no loop makes one


@cache
def _teach(function):
    """Let numba compile a function wherever a compiled one calls it, and inline it there."""
    from numba.extending import overload

    options = (
        _OPTIONS | {"no_cfunc_wrapper": True, "error_model": "numpy"} | _inlined.get(function, {})
    )
    overload(function, options, strict=False)(lambda *types: function)


def _compile(loops):
    """The machine code of loops, an object file with a function `int64 NAME(int64 **cells)` for each.

    Raises:
        RuntimeError: for a loop that needs Python when it runs.
    """
    from llvmlite import binding as llvm
    from numba.core.errors import NumbaError

    for function in (*_inlined, *(loop.__wrapped__ for loop in loops)):
        _teach(function)
    _teach_prefetch()
    linked = llvm.parse_assembly("")
    entries = []
    with _only_what_is_needed():
        for loop in loops:
            try:
                entries.append((loop, _entry(loop)))
            except NumbaError as error:
                raise RuntimeError(
                    f"{loop.name} makes an array or raises an exception, or is not what numba can compile: {error}"
                ) from error
    for loop, entry in entries:
        module = llvm.parse_assembly(entry.inspect_llvm())
        for value in (*module.functions, *module.global_variables):
            if not value.is_declaration and value.name != entry.native_name:
                value.linkage = "internal"
                if value.is_function:
                    value.add_function_attribute(
                        "alwaysinline"
                    )  # of LLVM, which simplifies it first
        module.get_function(entry.native_name).name = loop.name
        needed = _optimise(module) and _optimise(module)
        if needed:
            raise RuntimeError(
                f"{loop.name} makes an array or raises an exception, for which it needs {', '.join(needed)}"
            )
        linked.link_in(module)
    return _target().emit_object(linked)


@cache
def _teach_prefetch():
    """Let numba compile `prefetch`."""
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic, overload

    @intrinsic
    def fetch(typing, array, row, column):
        def generate(context, builder, signature, arguments):
            view = context.make_array(array)(context, builder, arguments[0])
            place = cgutils.get_item_pointer(
                context, builder, array, view, arguments[1:], wraparound=False
            )
            number = ir.IntType(32)
            kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t, number, number, number])
            function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
            builder.call(
                function,
                [builder.bitcast(place, cgutils.voidptr_t), number(0), number(2), number(1)],
            )
            return context.get_dummy_value()

        return types.void(array, types.int64, types.int64), generate

    @overload(prefetch, _OPTIONS, strict=False)
    def fetching(array, row, column):
        def call(array, row, column):
            fetch(array, row, column)

        return call


def _optimise(module):
    """Do what LLVM's -O2 does.

    -O3, and loops that do several vectors at a time, make much more code that is not faster; between two steps LAMMPS drives
    what there is out of the caches.

    Returns:
        the names of Python's functions that are left: those for errors that a second round may find impossible.
    """
    from llvmlite import binding as llvm

    options = llvm.create_pipeline_tuning_options(speed_level=2)
    options.loop_vectorization, options.loop_interleaving = True, False
    builder = llvm.create_pass_builder(_target(), options)
    builder.getModulePassManager().run(module, builder)
    return [
        f.name
        for f in module.functions
        if f.is_declaration and not f.name.startswith("llvm.") and not hasattr(math, f.name)
    ]


def _entry(loop):
    """The C function that takes a loop's arguments out of their cells and runs it, as numba's cfunc."""
    from numba import cfunc, types
    from numba.core import cgutils
    from numba.extending import intrinsic

    scalars = [getattr(types, kind.dtype.name) for kind in loop.kinds.values()]
    kinds = [
        types.Array(scalar, kind.dimensions, "C") if kind.dimensions else scalar
        for scalar, kind in zip(scalars, loop.kinds.values())
    ]

    @intrinsic
    def arguments(typing, slots):
        def generate(context, builder, signature, given):
            word = context.get_value_type(types.int64)
            table = builder.inttoptr(given[0], word.as_pointer().as_pointer())
            values = []
            for n, (kind, scalar) in enumerate(zip(kinds, scalars)):
                cell = builder.load(cgutils.gep_inbounds(builder, table, n))
                value = builder.load(cell)
                if kind is scalar:
                    values.append(builder.bitcast(value, context.get_value_type(scalar)))
                    continue
                view = context.make_array(kind)(context, builder)
                view.itemsize = context.get_constant(
                    types.intp, context.get_abi_sizeof(context.get_value_type(scalar))
                )
                shape = [
                    builder.load(cgutils.gep_inbounds(builder, cell, 1 + k))
                    for k in range(kind.ndim)
                ]
                strides = [view.itemsize]
                for length in shape[:0:-1]:
                    strides.insert(0, builder.mul(strides[0], length))
                view.data = builder.inttoptr(value, view.data.type)
                view.shape, view.strides = (
                    cgutils.pack_array(builder, shape),
                    cgutils.pack_array(builder, strides),
                )
                view.nitems = builder.mul(shape[0], shape[-1]) if kind.ndim == 2 else shape[0]
                for unused in "meminfo", "parent":
                    setattr(view, unused, cgutils.get_null_value(getattr(view, unused).type))
                values.append(view._getvalue())
            return context.make_tuple(builder, signature.return_type, values)

        return types.Tuple(kinds)(types.int64), generate

    function = loop.__wrapped__
    if loop.__annotations__.get("return"):

        def entry(slots):
            return function(*arguments(slots))

    else:

        def entry(slots):
            function(*arguments(slots))
            return 0

    return cfunc(types.int64(types.int64), forceinline=True, **_OPTIONS)(entry)


@contextmanager
def _only_what_is_needed():
    """Have numba put functions into LLVM's language, and nothing else.

    It would optimise each function, and each again in all that call it, and make machine code of all these, which `_compile` does once,
    when all are one.  And Python would look for garbage all the time among very many objects.
    """
    from unittest.mock import patch

    from numba import config
    from numba.core.codegen import JITCodeLibrary, JITCPUCodegen
    from numba.core.registry import cpu_target

    cpu_target.target_context  # makes, at the level that is set now, what all other users of numba have in this process
    left_out = (
        (JITCodeLibrary, "_finalize_specific"),
        (JITCPUCodegen, "_add_module"),
        (JITCPUCodegen, "set_env"),
    )
    collects = gc.isenabled()
    with ExitStack() as stack:
        stack.enter_context(patch.object(config, "OPT", type(config.OPT)(0)))
        if all(
            hasattr(*one) for one in left_out
        ):  # they are not for the public, and a later numba may have others
            for one in left_out:
                stack.enter_context(patch.object(*one, lambda *_: None))
        gc.disable()
        try:
            yield
        finally:
            if collects:
                gc.enable()
