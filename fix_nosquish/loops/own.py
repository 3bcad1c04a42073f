"""Loops of one's own: numba and LLVM compile them when they are first used, and files keep them.

The files are in the user's cache. Their names tell all that the machine code follows from, so that
code of a changed source is never used.
"""

import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from importlib import metadata
from importlib.util import source_hash
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

from .machine_code import INLINED, LOOPS, PACKAGE

_tell = partial(print, file=sys.stderr, flush=True)


def codes(names, level):
    """The machine code of modules' loops for a level, by their names; compiled if need be.

    Raises:
        RuntimeError: if it cannot be made; the message says why.
        OSError: if the user's cache cannot be written.
    """
    if "__main__" in names:  # of another process, the compiler, this is another file
        raise RuntimeError(
            "loops of a driver script cannot be compiled: have the class with its operations "
            "in a file of its own, NAME.py, import it, and write NAME.CLASS in the fix line"
        )
    kept = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), PACKAGE)
    places = {name: place(kept, name, level) for name in names}
    if missing := [name for name, file in places.items() if not read(file)]:
        package, begin = missing[0].partition(".")[0], time.perf_counter()
        _tell(f"{package} compiles its loops, once for each integrator on this machine: 5 to 60 s")
        kept.mkdir(0o700, parents=True, exist_ok=True)
        compile_all(kept, missing, [level])
        _tell(f"{package} has compiled its loops: {time.perf_counter() - begin:.0f} s")
    found = {name: read(file) for name, file in places.items()}
    if other := [name for name, code in found.items() if not code]:
        raise RuntimeError(
            f"the file of {other[0]} has changed since this process imported it: start the process "
            "anew"
        )
    return found


def compile_all(within, names, levels):
    """Have a process of its own, whose memory ends with it, compile loops, for `read`.

    Raises:
        RuntimeError: with what the process says if it cannot do it.
    """
    # by this process's path: with -m a folder that LAMMPS runs in would come before the library
    start = f"import sys; sys.path[:] = {sys.path}; from {__package__}.lower import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", start, str(within), ",".join(levels), *names],
        env=os.environ | {"MPI4PY_RC_INITIALIZE": "0"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(done.stderr.strip() or "the compiler ended")


def take(codes, level):
    """Have loops take machine code for the level of this number, by the names of their modules."""
    from llvmlite import binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    for name, code in codes.items():
        target = llvm.Target.from_default_triple().create_target_machine(jit=True)
        owner = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
        owner.add_object_file(llvm.ObjectFileRef.from_data(code))
        owner.finalize_object()
        for one in LOOPS[name]:
            one.take(owner.get_function_address(one.name), owner, level)


# ---------------------------------------------------------------- the cache


def place(within, name, level):
    """The file of the machine code of a module's loops; its name says what that follows from."""
    try:
        versions = metadata.version("numba"), metadata.version("llvmlite")
    except metadata.PackageNotFoundError:
        raise RuntimeError(
            f"the loops of {name} are not in {PACKAGE}'s library: to compile them, install numba: "
            f"pip install '{PACKAGE}[numba]'"
        ) from None
    compiler = Path(__file__).with_name("lower.py").read_text()
    loops = [(one.name, one.kinds, _meaning(one.__wrapped__)) for one in LOOPS[name]]
    made_of = source_hash(repr((versions, compiler, loops)).encode()).hex()
    return within / f"{name}.{made_of}.{level}.o"


def read(place):
    """The machine code in a file, or nothing if there is none that only this user can write."""
    try:
        with open(place, "rb") as file:
            about, content = os.fstat(file.fileno()), file.read()
    except OSError:
        return b""
    safe = about.st_uid == os.geteuid() and not about.st_mode & 0o022
    return content if safe else b""


def save(place, code):
    """Write a file, whole or not at all."""
    with tempfile.NamedTemporaryFile(dir=place.parent, delete=False) as file:  # for this user only
        file.write(code)
    os.replace(file.name, place)


def _codes(code):
    """A function's code and that of what is defined in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _meaning(function, within=()):
    """All that the machine code of a function follows from, but for functions that it is within,
    whose name may be that of a field."""
    within = *within, function
    codes = list(_codes(function.__code__))
    names = sorted({name for code in codes for name in code.co_names})
    used = {name: function.__globals__[name] for name in names if name in function.__globals__}
    for module in [value for value in used.values() if isinstance(value, ModuleType)]:
        found = [name for name in names if hasattr(module, name)]
        used |= {f"{module.__name__}.{name}": getattr(module, name) for name in found}
    free, cells = function.__code__.co_freevars, function.__closure__ or ()
    used |= {name: cell.cell_contents for name, cell in zip(free, cells, strict=True)}
    for name, value in used.items():
        inlines = isinstance(value, FunctionType) and value in INLINED and value not in within
        used[name] = _meaning(value, within) if inlines else getattr(value, "__name__", value)
    plain = [
        (
            code.co_code,
            [constant for constant in code.co_consts if not isinstance(constant, CodeType)],
            code.co_names,
            code.co_varnames,
        )
        for code in codes
    ]
    return plain, used, function.__defaults__, INLINED.get(function)
