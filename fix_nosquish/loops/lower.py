"""Compile loops: numba makes LLVM bitcode of each `compiled.Loop`, and LLVM machine code.

This runs in a separate process (see `cache`), because numba takes much memory and is configured by
environment variables.  Only the public interfaces of numba and llvmlite are used.
"""

import gc
import importlib
import inspect
import math
import os
import re
import sys
from collections.abc import Callable, Sequence
from functools import cache as cached
from functools import partial
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from . import cache, compiled
from .machine_code import ADDED
from .memory import ADDRESS, LENGTH, WIDTH, floats_in, int_rows_in, ints_in, longs_in, reallocate
from .registry import INLINED, LOOPS

# set before numba is imported: LLVM optimizes once all functions are one, see `_simplify`
os.environ |= {"NUMBA_OPT": "0", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}

from llvmlite import binding as llvm
from llvmlite import ir
from numba import carray, cfunc, from_dtype, types
from numba.core.errors import NumbaError
from numba.extending import intrinsic, overload

CELLS = types.CPointer(types.int64)  # the addresses of cells
OPTIONS = {
    "error_model": "numpy",  # division by zero raises no exception
    "no_cpython_wrapper": True,  # only loops call an inlined function
    "no_cfunc_wrapper": True,
}
LONG = ir.IntType(64)
LONGEST = 1500  # characters of an error
C_FUNCTIONS = "realloc", "perror", "_exit"  # which loops call, besides those of math
NO_MEMORY = (
    "ERROR: fix_nosquish: there is no memory left on this node for the bodies of this rank. Use "
    "more nodes, or fewer ranks on each"
)


def compile_modules(folder: Path, names: Sequence[str], levels: Sequence[str]) -> None:
    """Write the machine code of modules' loops: a file for each module and level.

    Raises:
        SystemExit: with a message, if a loop cannot be compiled.
    """
    gc.disable()  # numba has very many objects that live until the end
    for function, options in INLINED.items():
        _implement(function, function, **options)
    for function, implementation in PRIMITIVES.items():
        _implement(function, implementation)
    longest_first = sorted(names, key=lambda name: len(LOOPS[name]), reverse=True)
    processes = min(4, os.cpu_count() or 1, len(names))
    try:
        with get_context("fork").Pool(processes) as pool:
            pool.map(partial(_compile_module, folder, levels), longest_first, chunksize=1)
    except (RuntimeError, OSError) as error:
        sys.exit(str(error))


def _compile_module(folder: Path, levels: Sequence[str], name: str) -> None:
    """Write the machine code of a module's loops."""
    code = _bitcode(LOOPS[name])
    for level in levels:
        cache.save(cache.file_of(folder, name, level), _object(code, level))


def _implement(function: Callable, implementation: Callable, **options: Any) -> None:
    """Have numba compile `implementation` where a compiled function calls `function`."""
    overload(function, OPTIONS | options, strict=False)(lambda *types: implementation)


# ---------------------------------------------------------------- primitives


def _from_address(kind: Any) -> Any:
    """A function from an address to a pointer, or to a record."""

    @intrinsic
    def converted(typing: Any, address: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

        return kind(types.int64), code

    return converted


_to_float, _to_long, _to_int = (
    _from_address(types.CPointer(scalar)) for scalar in (types.float64, types.int64, types.int32)
)


@intrinsic
def _fetch(typing: Any, address: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        number, pointer = ir.IntType(32), ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
        fetch = builder.module.declare_intrinsic("llvm.prefetch.p0", (), kind)
        to_read, into_second_cache, of_data = number(0), number(2), number(1)
        pointer = builder.inttoptr(values[0], pointer)
        builder.call(fetch, [pointer, to_read, into_second_cache, of_data])
        return context.get_dummy_value()

    return types.void(types.int64), code


def _prefetch(array: Any, row: Any, column: Any) -> None:
    _fetch(array.ctypes.data + array.itemsize * (row * array.shape[1] + column))


@intrinsic
def _call(typing: Any, address: Any, arguments: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        address, packed = values
        numbers = [builder.extract_value(packed, k) for k in range(len(arguments))]
        kind = ir.FunctionType(LONG, [LONG] * len(numbers))
        return builder.call(builder.inttoptr(address, kind.as_pointer()), numbers)

    return types.int64(types.int64, types.UniTuple(types.int64, len(arguments))), code


@intrinsic
def _reallocate(typing: Any, address: Any, size: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        def call(name: str, *numbers: Any) -> Any:
            kind, module = ir.FunctionType(LONG, [LONG] * len(numbers)), builder.module
            return builder.call(
                module.globals.get(name) or ir.Function(module, kind, name), numbers
            )

        address = call("realloc", *values)
        with builder.if_then(builder.icmp_signed("==", address, LONG(0)), likely=False):
            text = context.insert_const_string(builder.module, NO_MEMORY)
            call("perror", builder.ptrtoint(text, LONG))
            call("_exit", LONG(1))
        return address

    return types.int64(types.int64, types.int64), code


PRIMITIVES: dict[Callable, Callable] = {
    compiled.prefetch: _prefetch,
    compiled.address: lambda array: array.ctypes.data,
    compiled.call: lambda address, *arguments: _call(address, arguments),
    reallocate: lambda address, size: _reallocate(address, size),
    longs_in: lambda memory, row: carray(_to_long(memory[row, ADDRESS]), (memory[row, LENGTH],)),
    ints_in: lambda memory, row: carray(_to_int(memory[row, ADDRESS]), (memory[row, LENGTH],)),
    int_rows_in: lambda memory, row: carray(
        _to_int(memory[row, ADDRESS]), (memory[row, LENGTH], memory[row, WIDTH])
    ),
    floats_in: lambda memory, row: carray(
        _to_float(memory[row, ADDRESS]), (memory[row, LENGTH], memory[row, WIDTH])
    ),
}


# ---------------------------------------------------------------- from cells to arguments


@cached
def _reader(kind: compiled.Kind) -> Callable:
    """A function from the address of a cell to the argument of that kind."""
    is_record, columns = bool(kind.dtype.names), kind.columns
    dtype = from_dtype(kind.dtype)
    pointer = _from_address(dtype if is_record else types.CPointer(dtype))
    readers = {
        "I": lambda cell: _to_long(cell)[0],
        "F": lambda cell: _to_float(cell)[0],
        "F64": lambda cell: carray(pointer(_to_long(cell)[0]), (_to_long(cell)[1], columns)),
        0: lambda cell: pointer(_to_long(cell)[0]),
        1: lambda cell: carray(pointer(_to_long(cell)[0]), (_to_long(cell)[1],)),
        2: lambda cell: carray(pointer(_to_long(cell)[0]), (_to_long(cell)[1], _to_long(cell)[2])),
    }
    read = (not is_record and readers.get(kind.name)) or readers[kind.dimensions]
    _implement(read, read)
    return read


def _entry(loop: Any) -> Callable:
    """A function that reads the arguments of a loop from their cells, and runs it."""
    function = loop.__wrapped__
    _implement(function, function)
    names: dict[str, Any] = {"loop": function}
    indices, arguments = count(), []

    def argument(kind: compiled.Kind) -> str:
        k = next(indices)
        names[f"read_{k}"] = _reader(kind)
        return f"read_{k}(cells[{k}])"

    for kind in loop.parameters.values():
        if isinstance(kind, compiled.Kind):
            arguments.append(argument(kind))
        else:
            fields = [argument(field) for field in compiled.annotations(kind).values()]
            arguments.append(f"{kind.__name__}({', '.join(fields)})")
            names[kind.__name__] = kind
    run = f"loop({', '.join(arguments)})"
    # numba compiles no function of a variable number of arguments, so this one is written
    exec(f"def entry(cells):\n    {f'return {run}' if loop.returns else f'{run}; return 0'}", names)
    return names["entry"]


# ---------------------------------------------------------------- LLVM


def _bitcode(loops: Sequence[compiled.Loop]) -> bytes:
    """The bitcode of loops: for each a function `int64 NAME(int64 *cells)` of addresses of cells.

    Raises:
        RuntimeError: for a loop that would call Python.
    """
    linked = llvm.parse_assembly("")
    for loop in loops:
        try:
            entry = cfunc(types.int64(CELLS), **OPTIONS)(_entry(loop))
        except (NumbaError, KeyError) as error:
            raise RuntimeError(
                f"numba cannot compile {loop.name}: {_cause(error)}. Is each function that it "
                "calls marked @inlined, and made of numbers, tuples and functions of math?"
            ) from error
        module = llvm.parse_assembly(entry.inspect_llvm())
        for value in (*module.functions, *module.global_variables):
            if not value.is_declaration and value.name != entry.native_name:
                value.linkage = "internal"
                if value.is_function:
                    value.add_function_attribute("alwaysinline")
        module.get_function(entry.native_name).name = loop.name
        needed = _simplify(module) and _simplify(module)
        if needed:
            raise RuntimeError(
                f"{loop.name} makes an array or raises an exception, which a loop cannot do: it "
                f"calls {', '.join(needed)}"
            )
        linked.link_in(module)
    return linked.as_bitcode()


def _cause(error: Exception) -> str:
    """What is wrong, and in which function; numba's text says this after all functions that call
    it."""
    if isinstance(error, KeyError):  # by a record, without a place
        (field,) = error.args
        users = (user.__qualname__ for user in INLINED if field in user.__code__.co_names)
        return f"there is no field {field} (in function {' or '.join(users)})"
    cause, _, callers = str(error).rpartition("nopython frontend)")[2].partition("raised from")
    function = re.search(r"<function (\S+) at", callers)
    place = f" (in function {function[1]})" if function else ""
    return f"{type(error).__name__}: {inspect.cleandoc(cause)[:LONGEST]}{place}"


def _simplify(module: Any) -> list[str]:
    """Inline all functions into one, and optimize it for no processor in particular.

    Returns:
        the names of Python's functions that are left. A second call may remove those that raise
        errors which cannot occur.
    """
    _optimize(module, _target(), vectorize=False)
    left = [function.name for function in module.functions if function.is_declaration]
    known = "llvm.", *C_FUNCTIONS
    return [name for name in left if not name.startswith(known) and not hasattr(math, name)]


def _object(code: bytes, level: str) -> bytes:
    """An object file of bitcode.

    The optimization is -O2 without interleaving.  -O3 and interleaving make much more code, which
    is not faster, because LAMMPS evicts it from the caches between steps.
    """
    module, target = llvm.parse_bitcode(code), _target(level)
    module.triple, module.data_layout = target.triple, str(target.target_data)
    _optimize(module, target, vectorize=True)
    return target.emit_object(module)


def _optimize(module: Any, target: Any, vectorize: bool) -> None:
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    options.loop_vectorization, options.loop_interleaving = vectorize, False
    builder = llvm.create_pass_builder(target, options)
    builder.getModulePassManager().run(module, builder)


def _target(level: str = "") -> Any:
    """LLVM's description of the processors of a level.

    Without a level it is no real processor: tuning for one twice makes steps 6 % slower, so only
    `_object` does it.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    triple, cpu = llvm.get_process_triple(), level
    if level and level not in ADDED:
        triple, cpu = f"{level}{triple[triple.index('-') :]}", "generic"
    target = llvm.Target.from_triple(triple)
    return target.create_target_machine(cpu=cpu, opt=3, reloc="pic", codemodel="default")


def main() -> None:
    """Run `compile_modules` with the arguments FOLDER LEVEL,... MODULE ..."""
    folder, levels, *names = sys.argv[1:]
    for name in names:
        importlib.import_module(name)
    compile_modules(Path(folder), names, levels.split(","))
