"""From the loops of `compiled.Loop` to machine code for this processor, by LLVM.

    python -m fix_nosquish.loops.compile FILE MODULE ...

writes to the open file of this number a pickled dictionary from the modules' names to the machine
code of their loops. It is a process of its own: LLVM's memory ends with it. Of the package's own
loops it takes the bitcode that came with the package, else `lower` makes it, for which numba takes
most of a minute.
"""

from llvmlite import binding as llvm

from . import bitcode, machine_code


def object_files(names):
    """The machine code of the loops of these modules, an object file each, by their names."""
    known = bitcode.kept()
    missing = [name for name in names if name not in known]
    if missing:
        from . import lower  # which imports numba

        known |= lower.bitcode(missing)
    return {name: _object_file(known[name]) for name in names}


def _object_file(code):
    """An object file of bitcode.

    LLVM does what its -O2 does.  -O3, and loops that do several vectors at a time, make much more
    code that is not faster: between two steps LAMMPS drives what there is out of the caches.
    """
    module, target = llvm.parse_bitcode(code), machine_code.target()
    options = llvm.create_pipeline_tuning_options(speed_level=2)
    options.loop_vectorization, options.loop_interleaving = True, False
    builder = llvm.create_pass_builder(target, options)
    builder.getModulePassManager().run(module, builder)
    return target.emit_object(module)


if __name__ == "__main__":
    machine_code.answer(object_files)
