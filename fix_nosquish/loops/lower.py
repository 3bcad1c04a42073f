"""From the loops of `compiled.Loop` to machine code: numba makes LLVM's bitcode of them.

`cache` has another process do it: numba's memory, and the level at which it works, end with it.
Only the public interfaces of numba and llvmlite are used.
"""

import gc
import importlib
import math
import os
import sys
from collections.abc import Callable
from functools import cache as cached
from functools import partial
from itertools import count
from multiprocessing import get_context
from pathlib import Path

from . import cache, compiled
from .machine_code import ADDED
from .memory import LENGTH, PLACE, WIDTH, floats_in, int_rows_in, ints_in, longs_in
from .registry import INLINED, LOOPS

# before numba is imported: LLVM works when all functions are one, see `_simplify`
os.environ |= {"NUMBA_OPT": "0", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}

from llvmlite import binding as llvm
from llvmlite import ir
from numba import carray, cfunc, from_dtype, types
from numba.core.errors import NumbaError
from numba.extending import intrinsic, overload

CELLS = types.CPointer(types.int64)  # their addresses
OPTIONS = {
    "error_model": "numpy",  # a division by zero raises nothing
    "no_cpython_wrapper": True,  # nothing but other loops calls an inlined function
    "no_cfunc_wrapper": True,
}
LONG = ir.IntType(64)


def compile_modules(folder, names, levels):
    """Write the machine code of these modules' loops, a file for each and each level.

    Raises:
        SystemExit: if it cannot be done; what was printed says why.
    """
    gc.disable()  # it would search very many objects all the time
    for function, options in INLINED.items():
        _teach(function, function, **options)
    for function, meaning in PRIMITIVES.items():
        _teach(function, meaning)
    longest_first = sorted(names, key=lambda name: len(LOOPS[name]), reverse=True)
    # each process takes the number of a module from this pipe, as soon as it has compiled one
    turns, numbers = os.pipe()
    os.write(numbers, bytes(range(len(names))))
    os.close(numbers)
    work = partial(_work, turns, folder, longest_first, levels)
    at_most = min(4, os.cpu_count() or 1, len(names))
    processes = [get_context("fork").Process(target=work) for _ in range(at_most)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    if any(process.exitcode for process in processes):
        sys.exit(1)


def _work(turns, folder, names, levels):
    """Compile modules as their turns come."""
    try:
        while turn := os.read(turns, 1):
            name = names[turn[0]]
            code = _bitcode(LOOPS[name])
            for level in levels:
                cache.save(cache.file_of(folder, name, level), _object(code, level))
    except (RuntimeError, OSError) as error:
        sys.exit(str(error))


def _teach(function, meaning, **options):
    """Let numba compile `meaning` where a compiled function calls `function`."""
    overload(function, OPTIONS | options, strict=False)(lambda *types: meaning)


# ---------------------------------------------------------------- what loops can use besides


def _from_address(what):
    """A function from an address to a pointer, or to a record."""

    @intrinsic
    def found(typing, place):
        def code(context, builder, signature, values):
            return builder.inttoptr(values[0], context.get_value_type(signature.return_type))

        return what(types.int64), code

    return found


_to_float, _to_long, _to_int = (
    _from_address(types.CPointer(scalar)) for scalar in (types.float64, types.int64, types.int32)
)


@intrinsic
def _fetch(typing, place):
    def code(context, builder, signature, values):
        number, pointer = ir.IntType(32), ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
        fetch = builder.module.declare_intrinsic("llvm.prefetch.p0", (), kind)
        to_read, into_second_cache, of_data = number(0), number(2), number(1)
        pointer = builder.inttoptr(values[0], pointer)
        builder.call(fetch, [pointer, to_read, into_second_cache, of_data])
        return context.get_dummy_value()

    return types.void(types.int64), code


def _prefetch(array, row, column):
    _fetch(array.ctypes.data + array.itemsize * (row * array.shape[1] + column))


@intrinsic
def _call(typing, place, arguments):
    def code(context, builder, signature, values):
        place, packed = values
        numbers = [builder.extract_value(packed, k) for k in range(len(arguments))]
        kind = ir.FunctionType(LONG, [LONG] * len(numbers))
        return builder.call(builder.inttoptr(place, kind.as_pointer()), numbers)

    return types.int64(types.int64, types.UniTuple(types.int64, len(arguments))), code


PRIMITIVES: dict[Callable, Callable] = {
    compiled.prefetch: _prefetch,
    compiled.address: lambda array: array.ctypes.data,
    compiled.longs: lambda place, n: carray(_to_long(place), (n,)),
    compiled.call: lambda place, *arguments: _call(place, arguments),
    longs_in: lambda memory, row: carray(_to_long(memory[row, PLACE]), (memory[row, LENGTH],)),
    ints_in: lambda memory, row: carray(_to_int(memory[row, PLACE]), (memory[row, LENGTH],)),
    int_rows_in: lambda memory, row: carray(
        _to_int(memory[row, PLACE]), (memory[row, LENGTH], memory[row, WIDTH])
    ),
    floats_in: lambda memory, row: carray(
        _to_float(memory[row, PLACE]), (memory[row, LENGTH], memory[row, WIDTH])
    ),
}


# ---------------------------------------------------------------- from cells to arguments


@cached
def _reader(kind):
    """A function from the address of a cell, a few integers, to the argument of that kind."""
    is_record, columns = bool(kind.dtype.names), kind.columns
    what = from_dtype(kind.dtype)
    pointer = _from_address(what if is_record else types.CPointer(what))
    readers = {
        "I": lambda cell: _to_long(cell)[0],
        "F": lambda cell: _to_float(cell)[0],
        "F64": lambda cell: carray(pointer(_to_long(cell)[0]), (_to_long(cell)[1], columns)),
        0: lambda cell: pointer(_to_long(cell)[0]),
        1: lambda cell: carray(pointer(_to_long(cell)[0]), (_to_long(cell)[1],)),
        2: lambda cell: carray(pointer(_to_long(cell)[0]), (_to_long(cell)[1], _to_long(cell)[2])),
    }
    read = (not is_record and readers.get(kind.name)) or readers[kind.dimensions]
    _teach(read, read)
    return read


def _entry(loop):
    """A function that takes a loop's arguments out of their cells, and runs it."""
    function = loop.__wrapped__
    _teach(function, function)
    known, places, arguments = {"loop": function}, count(), []

    def argument(kind):
        place = next(places)
        known[f"read_{place}"] = _reader(kind)
        return f"read_{place}(cells[{place}])"

    for what in loop.parameters.values():
        if isinstance(what, compiled.Kind):
            arguments.append(argument(what))
        else:
            fields = [argument(kind) for kind in compiled.annotations(what).values()]
            arguments.append(f"{what.__name__}({', '.join(fields)})")
            known[what.__name__] = what
    run = f"loop({', '.join(arguments)})"
    exec(f"def entry(cells):\n    {f'return {run}' if loop.returns else f'{run}; return 0'}", known)
    return known["entry"]


# ---------------------------------------------------------------- LLVM


def _bitcode(loops):
    """The bitcode of loops: for each a function `int64 NAME(int64 *cells)`, of their addresses.

    Raises:
        RuntimeError: for a loop that needs Python when it runs.
    """
    linked = llvm.parse_assembly("")
    for loop in loops:
        try:
            entry = cfunc(types.int64(CELLS), **OPTIONS)(_entry(loop))
        except NumbaError as error:
            raise RuntimeError(
                f"{loop.name} is not what numba can compile (is each function that it calls marked "
                f"@inlined, and made of numbers, tuples and functions of math?): {error}"
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
                f"{loop.name} makes an array or raises an exception, for which it needs "
                f"{', '.join(needed)}"
            )
        linked.link_in(module)
    return linked.as_bitcode()


def _simplify(module):
    """Make one short function of many: what follows from the processor is for `_object`.

    Returns:
        the names of Python's functions that are left: those for errors that a second round may
        find impossible.
    """
    _optimize(module, _target(), vectorize=False)
    left = [function.name for function in module.functions if function.is_declaration]
    return [name for name in left if not name.startswith("llvm.") and not hasattr(math, name)]


def _object(code, level):
    """An object file of bitcode.

    LLVM does what its -O2 does.  -O3, and loops that do several vectors at a time, make much more
    code that is not faster: between two steps LAMMPS drives what there is out of the caches.
    """
    module, target = llvm.parse_bitcode(code), _target(level)
    module.triple, module.data_layout = target.triple, str(target.target_data)
    _optimize(module, target, vectorize=True)
    return target.emit_object(module)


def _optimize(module, target, vectorize):
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    options.loop_vectorization, options.loop_interleaving = vectorize, False
    builder = llvm.create_pass_builder(target, options)
    builder.getModulePassManager().run(module, builder)


def _target(level=""):
    """LLVM's idea of a processor: what all of a level have in common.

    Without a level it is none that there is. What LLVM takes to be good for one of them is done by
    `_object`: done twice, it makes steps slower by some 6 %.
    """
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    triple, cpu = llvm.get_process_triple(), level
    if level and level not in ADDED:
        triple, cpu = f"{level}{triple[triple.index('-') :]}", "generic"
    target = llvm.Target.from_triple(triple)
    return target.create_target_machine(cpu=cpu, opt=3, reloc="pic", codemodel="default")


def main():
    """Compile modules, as `compile_modules`: FOLDER LEVEL,... MODULE ..."""
    folder, levels, *names = sys.argv[1:]
    for name in names:
        importlib.import_module(name)
    compile_modules(Path(folder), names, levels.split(","))
