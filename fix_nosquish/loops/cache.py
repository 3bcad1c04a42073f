"""Loops that are not in the package's library: compiled at first use, and kept in the user's cache.

The name of a file contains a hash of all that the machine code depends on, so the code of a changed
source is never used.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from importlib import metadata
from importlib.util import source_hash
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

from .registry import INLINED, LOOPS, PACKAGE

_print = partial(print, file=sys.stderr, flush=True)


def machine_code(names: Sequence[str], level: str) -> dict[str, bytes]:
    """The machine code of modules' loops for a level, by the modules' names; compiled if missing.

    Raises:
        RuntimeError: if they cannot be compiled; the message says why.
        OSError: if the user's cache cannot be written.
    """
    if "__main__" in names:  # in the process that compiles this is another file
        raise RuntimeError(
            "loops of a driver script cannot be compiled: put the class and its operations into a "
            "separate file, NAME.py, import it, and write NAME.CLASS in the fix line"
        )
    folder = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), PACKAGE)
    files = {name: file_of(folder, name, level) for name in names}
    if missing := [name for name, file in files.items() if not read(file)]:
        package, begin = missing[0].partition(".")[0], time.perf_counter()
        _print(f"{package} compiles its loops, once for each integrator on this machine: 5 to 60 s")
        folder.mkdir(0o700, parents=True, exist_ok=True)
        run_compiler(folder, missing, [level])
        _print(f"{package} has compiled its loops: {time.perf_counter() - begin:.0f} s")
    codes = {name: read(file) for name, file in files.items()}
    if changed := [name for name, code in codes.items() if not code]:
        raise RuntimeError(
            f"the file of {changed[0]} has changed since this process imported it: restart the "
            "process"
        )
    return codes


def run_compiler(folder: Path, names: Iterable[str], levels: Iterable[str]) -> None:
    """Compile the loops of modules in another process, which frees its memory when it ends.

    Raises:
        RuntimeError: with the message of that process.
    """
    # with the path of this process: -m would put the folder of the run before all others
    start = f"import sys; sys.path[:] = {sys.path}; from {__package__}.lower import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", start, str(folder), ",".join(levels), *names],
        env=os.environ | {"MPI4PY_RC_INITIALIZE": "0"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(done.stderr.strip() or "the compiler ended")


def load(codes: dict[str, bytes], level: int) -> None:
    """Load machine code for the level of this index into the loops of modules."""
    from llvmlite import binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    for name, code in codes.items():
        target = llvm.Target.from_default_triple().create_target_machine(jit=True)
        owner = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
        owner.add_object_file(llvm.ObjectFileRef.from_data(code))
        owner.finalize_object()
        for loop in LOOPS[name]:
            loop.set_machine_code(owner.get_function_address(loop.name), owner, level)


# ---------------------------------------------------------------- the cache


def file_of(folder: Path, name: str, level: str) -> Path:
    """The file of the machine code of a module's loops.

    Raises:
        RuntimeError: if the compiler is not installed.
    """
    try:
        versions = metadata.version("numba"), metadata.version("llvmlite")
    except metadata.PackageNotFoundError:
        raise RuntimeError(
            f"the loops of {name} are not in {PACKAGE}'s library. To compile them, install numba: "
            f"pip install '{PACKAGE}[numba]'"
        ) from None
    compiler = Path(__file__).with_name("lower.py").read_text()
    loops = [(loop.name, loop.kinds, _meaning(loop.__wrapped__)) for loop in LOOPS[name]]
    digest = source_hash(repr((versions, compiler, loops)).encode()).hex()
    return folder / f"{name}.{digest}.{level}.o"


def read(path: Path) -> bytes:
    """The machine code in a file; empty if there is none that only this user can write."""
    try:
        with open(path, "rb") as file:
            status, content = os.fstat(file.fileno()), file.read()
    except OSError:
        return b""
    return content if status.st_uid == os.geteuid() and not status.st_mode & 0o022 else b""


def save(path: Path, code: bytes) -> None:
    """Write a file, completely or not at all."""
    with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:  # for this user only
        file.write(code)
    os.replace(file.name, path)


def _codes(code: CodeType) -> Iterator[CodeType]:
    """The code of a function, and of the functions that are defined in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _meaning(function: Any, outer: tuple = ()) -> Any:
    """All that the machine code of a function depends on.

    Args:
        outer: the functions that inline this one, which are not visited again.
    """
    outer = *outer, function
    codes = list(_codes(function.__code__))
    names = sorted({name for code in codes for name in code.co_names})
    used = {name: function.__globals__[name] for name in names if name in function.__globals__}
    for module in [value for value in used.values() if isinstance(value, ModuleType)]:
        members = [name for name in names if hasattr(module, name)]
        used |= {f"{module.__name__}.{name}": getattr(module, name) for name in members}
    free, cells = function.__code__.co_freevars, function.__closure__ or ()
    used |= {name: cell.cell_contents for name, cell in zip(free, cells, strict=True)}
    for name, value in used.items():
        inlines = isinstance(value, FunctionType) and value in INLINED and value not in outer
        used[name] = _meaning(value, outer) if inlines else getattr(value, "__name__", value)
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
