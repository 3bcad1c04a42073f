"""The machine code of loops, and the files that keep it.

Where the file of a module's loops is, numba is not even imported, which alone would take longer
than all else at the start of a run; if not, `compile` makes it.
"""

import ctypes
import fcntl
import importlib
import importlib.util
import inspect
import operator
import os
import pickle
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from contextlib import ExitStack, contextmanager
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

from . import bitcode

INLINED: dict[Callable, dict[str, Any]] = {}  # function: the options that numba compiles it with
MODULES: dict[str, "Module"] = {}  # name: the `Module`
PACKAGE = __name__.partition(".")[0]
_HASH = 8  # bytes of a file before its machine code
COMPILERS = "lower.py", "compile.py"
UNLIKE = (
    f"{PACKAGE}: the ranks run on processors of several kinds, whose rounding differs. So two "
    "copies of a body that ranks share drift apart by rounding: run on nodes of one kind"
)


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
    unlike = False
    with communicator.together("the loops cannot be compiled or loaded"):
        unlike = processor != _processor()
        for name, module in modules.items():
            if not module.ready:
                if not unlike:
                    module.code = codes[name]
                module.load()
    if communicator.any(unlike) and communicator.rank == 0:
        _tell_once(UNLIKE)


def module_of(name):
    """The `Module` with the loops of the module of this name."""
    return MODULES.setdefault(name, Module(name))


def of_package(package):
    """The modules with loops of a package that have been imported."""
    return [one for name, one in MODULES.items() if name.partition(".")[0] == package]


class Module:
    """The loops of a module, and the file of their machine code.

    Attributes:
        code: the machine code, or None while it is not known.
        left: why files that were found are not used.
    """

    def __init__(self, name):
        self.name, self.loops, self.ready, self.left = name, [], False, []
        self.code: bytes | None = None

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
                danger = self._danger(place) or self._danger(place.parent)
            except OSError:
                continue
            if danger:
                self.left.append(f"{danger}, so {place} is not used")
            elif content[:_HASH] == importlib.util.source_hash(content[_HASH:]):
                self.code = content[_HASH:]
                break
        return self.code is not None

    def _danger(self, path):
        """Why others than who runs this, or whose source is run anyway, may have put machine code
        there; nothing if they cannot."""
        owners = {os.geteuid(), 0, os.stat(inspect.getfile(sys.modules[self.name])).st_uid}
        there = path.stat()
        if there.st_uid not in owners:
            return f"{path} belongs to another user ({there.st_uid})"
        return f"{path} can be written by others (chmod go-w)" if there.st_mode & 0o022 else None

    def _compile(self):
        """Compile these loops, and all that the package has imported: a later run may need more."""
        package = self.name.partition(".")[0]
        missing = [one for one in of_package(package) if one is self or not one.read()]
        for reason in sorted({reason for one in missing for reason in one.left}):
            _tell_once(f"{package}: {reason}")
        short = {one.name for one in missing} <= set(bitcode.kept())
        long = "usually 5 to 30 s" if short else "usually 20 to 60 s"
        _tell(f"{package} compiles its loops, once for each integrator on this machine: {long}")
        begin = time.perf_counter()
        codes = in_processes("compile", missing)
        _tell(f"{package} has compiled its loops: {time.perf_counter() - begin:.0f} s")
        for one in missing:
            one.save(codes[one.name])

    def weight(self):
        """About how long it takes to compile the loops, in a unit of its own."""
        return sum(len(repr(_contents(one.__wrapped__))) for one in self.loops)

    def save(self, code: bytes):
        """Keep this machine code, also in a file."""
        self.code, places = code, self.places()
        content = importlib.util.source_hash(code) + code
        if not any(_save(place, content, self._danger) for place in places):
            folders = " nor ".join(str(place.parent) for place in places)
            warnings.warn(
                f"the loops of {self.name} are compiled at each start, because neither "
                f"{folders} can be written, and by you alone",
                RuntimeWarning,
                stacklevel=2,
            )

    def places(self):
        """Where the file may be: beside the module's own compiled file, or in the user's cache.

        Its name tells the processor, the compiler, and all that the code follows from.
        """
        from importlib import metadata  # here, because other ranks can do without

        if self.name == "__main__":  # of another process, the compiler, this is another file
            raise RuntimeError(
                "loops of a driver script cannot be compiled: have the class with its operations "
                "in a file of its own, NAME.py, import it, and write NAME.CLASS in the fix line"
            )
        beside = Path(importlib.util.cache_from_source(inspect.getfile(sys.modules[self.name])))
        compiler = (
            f"{_processor()} {metadata.version('llvmlite')} {metadata.version('numba')} "
            f"{[Path(__file__).with_name(name).read_text() for name in COMPILERS]}"
        )
        loops = repr([(one.name, one.kinds, _contents(one.__wrapped__)) for one in self.loops])
        beside = beside.with_suffix(f".{_hash(compiler)}.{_hash(loops)}.o")
        cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
        return beside, Path(cache, PACKAGE, _hash(str(beside.parent)), beside.name)


# LLVM works when all functions are one: see `lower._simplify`
NUMBA = {"NUMBA_OPT": "0", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}


def in_processes(program, modules):
    """What `lower` or `compile` makes of modules, by their names, in at most four processes.

    Raises:
        RuntimeError: with what a process says that cannot do it.
    """
    allowed = getattr(os, "sched_getaffinity", None)  # not on macOS
    cores = len(allowed(0)) if allowed else os.cpu_count() or 1
    groups: list[tuple[int, list[str]]] = [(0, []) for _ in range(min(4, cores, len(modules)))]
    for one in sorted(modules, key=Module.weight, reverse=True):
        weight, names = groups.pop(0)
        groups.append((weight + one.weight(), [*names, one.name]))
        groups.sort(key=operator.itemgetter(0))
    # by this process's path: with -m a folder that LAMMPS runs in would come before the library
    start = f"import sys; sys.path[:] = {sys.path}; from runpy import run_module as run; "
    start += f"run({f'{__package__}.{program}'!r}, run_name='__main__')"
    quiet = {"MPI4PY_RC_INITIALIZE": "0"}
    codes: dict[str, bytes] = {}
    problem = None
    with ExitStack() as stack:
        # not standard output, to which a user's module may print
        answers = [stack.enter_context(tempfile.TemporaryFile()) for _ in groups]
        processes = [
            subprocess.Popen(
                [sys.executable, "-c", start, str(file.fileno()), *names],
                env=os.environ | quiet | NUMBA,  # a user's module may import numba
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                pass_fds=[file.fileno()],
            )
            for file, (_, names) in zip(answers, groups)
        ]
        for process, file in zip(processes, answers):
            _, errors = process.communicate()
            if process.returncode:
                problem = errors.decode(errors="replace").strip() or "the compiler ended"
            else:
                file.seek(0)
                codes |= pickle.load(file)
    if problem:
        raise RuntimeError(problem)
    return codes


def answer(make):
    """What the processes do: `make` codes of the modules that the command line names, behind the
    number of the file to write to."""
    file, *names = sys.argv[1:]
    for name in names:
        importlib.import_module(name)
    try:
        codes = make(names)
    except RuntimeError as error:
        sys.exit(str(error))
    with open(int(file), "wb") as answers:
        pickle.dump(codes, answers)


def _tell(text):
    print(text, file=sys.stderr, flush=True)


_tell_once = cache(_tell)


def _hash(text):
    return importlib.util.source_hash(text.encode()).hex()


def _save(place, content, danger):
    """Write a file, whole or not at all, where there is no danger that others change it, and remove
    the module's older ones. Returns: whether."""
    part = place.with_name(f"{place.name}.{os.urandom(4).hex()}")
    try:
        place.parent.mkdir(0o755, parents=True, exist_ok=True)
        if danger(place.parent):
            return False
        with open(part, "xb") as file:
            os.fchmod(file.fileno(), os.fstat(file.fileno()).st_mode & 0o755)
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
                place.parent.mkdir(0o755, parents=True, exist_ok=True)
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


def _contents(function, within=()):
    """All that the machine code of a function follows from, but for functions that it is within,
    whose name may be that of a field."""
    within = *within, function
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
        if isinstance(value, FunctionType) and value in INLINED and value not in within:
            return _contents(value, within)
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
