"""The passes of a step as kernels for a graphics card: a first step, which no fix uses.

    python -m validation.card               checks them against the host's loops, and times them
    python -m validation.card --ptx FOLDER  writes them in PTX, for which no card is needed

The first prints JSON. With `NUMBA_ENABLE_CUDASIM=1` numba simulates a card, and nothing is timed.

A thread moves one body. Nothing of the physics is written here: kernels call the functions that the
host's loops inline, compiled for blocks of one lane (`LANES` = 1). Such a block is an array of the
thread's own, which the compiler keeps in registers. The bodies' `state` is the host's; the atoms
of a body stand behind each other in `index` and `displace`, from `first` of the body on.
"""

import argparse
import json
import warnings
from collections.abc import Callable, Iterator
from dis import get_instructions
from functools import cache, partial
from os import fsdecode
from pathlib import Path
from types import CellType, FunctionType
from typing import Any

import numpy as np
from numba import config, cuda, from_dtype, njit, types

from fix_nosquish.bodies.bodies import Bodies, aligned
from fix_nosquish.integrators.hmc import draw_momenta
from fix_nosquish.integrators.langevin import WORK, thermalise
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.integrators.thermostat import Bath
from fix_nosquish.loops.compiled import F1, F2, I1, F, annotations, inlined
from fix_nosquish.loops.machine_code import INLINED
from fix_nosquish.motion import block
from fix_nosquish.motion.block import (
    ATOM,
    BLOCK_ROWS,
    FORCE,
    ID,
    MASS,
    MOMENT,
    NATOMS,
    TORQUE,
    Kinds,
    Layout,
    P,
    Q,
    V,
    X,
    kind_of,
    put,
    take,
    take_names,
    three,
    write,
)
from fix_nosquish.motion.frames import quaternion_momentum
from fix_nosquish.motion.operations import EXACT, kick
from fix_nosquish.motion.step import add_forces, apply_matrices, rotation_matrices
from fix_nosquish.motion.step import gather as gather_on_host

SHAPE, LIMITS = (BLOCK_ROWS + WORK, 1), (2, 3)  # of a thread's block, and of its Layout.blocks
NUMBER, COUNT, BATH = np.dtype(np.float64), np.dtype(np.int64), Bath.dtype
NO_FORCE = (0.0,) * 6
THREADS = 128  # in a block of CUDA's
ROUNDING = 1e-12
HEAT = 1.0  # that bodies have been given before
KERNELS: dict[str, Any] = {}  # functions whose arguments are annotated as those of a loop


def kernel(function: Any) -> Any:
    """Decorator of a kernel."""
    KERNELS[function.__name__] = function
    return function


@inlined
def layout_of(k, state, kinds, first, index, displace, lane, limits):
    """The layout of body k alone, for what moves rows between `state` and the thread's lane: its
    atoms have no rounds."""
    limits[0, 0], limits[1, 0] = k, k + 1
    return Layout(state, kinds, limits, first, index, displace, lane)


@kernel
def gather(state: F2, kinds: Kinds, first: I1, index: I1, displace: F2, atom_f: F2):
    """Sum force and torque over the atoms of each body."""
    k = cuda.grid(1)
    if k < state.shape[1]:
        lane, limits = cuda.local.array(SHAPE, NUMBER), cuda.local.array(LIMITS, COUNT)
        layout = layout_of(k, state, kinds[0], first, index, displace, lane, limits)
        take(layout, 0, Q, Q + 4, Q)
        rotation_matrices(lane)
        write(lane, FORCE, 0, NO_FORCE)
        for j in range(first[k], first[k + 1]):
            force = atom_f[index[j]]
            write(lane, ATOM, 0, (force[0], force[1], force[2]))
            add_forces(lane, j, j + 1, displace)
        put(layout, 0, FORCE, TORQUE + 3, FORCE)


@kernel
def place(state: F2, kinds: Kinds, first: I1, index: I1, displace: F2, atom_x: F2):
    """Place the atoms of each body, in the body's periodic image."""
    k = cuda.grid(1)
    if k < state.shape[1]:
        lane, limits = cuda.local.array(SHAPE, NUMBER), cuda.local.array(LIMITS, COUNT)
        layout = layout_of(k, state, kinds[0], first, index, displace, lane, limits)
        take(layout, 0, X, Q + 4, X)
        rotation_matrices(lane)
        for j in range(first[k], first[k + 1]):
            apply_matrices(lane, X, j, j + 1, displace)
            x, y, z = three(lane, ATOM, 0)
            i = index[j]
            atom_x[i, 0], atom_x[i, 1], atom_x[i, 2] = x, y, z


def operation(name: str, does: Any, named: bool) -> None:
    """Make the kernel that does one thing with all bodies, as `step.make_pass` makes a loop."""

    def go(
        state: F2, kinds: Kinds, first: I1, index: I1, displace: F2,
        dt: F, parameters: Bath, mask: F2, given: F1,
    ):  # fmt: skip
        # parameters are the thread's own, as is the energy that it gives to the body
        k = cuda.grid(1)
        if k < state.shape[1]:
            lane, limits = cuda.local.array(SHAPE, NUMBER), cuda.local.array(LIMITS, COUNT)
            layout = layout_of(k, state, kinds[0], first, index, displace, lane, limits)
            own = cuda.local.array(1, BATH)
            own[0] = parameters[0]
            own[0].heat = 0.0
            take(layout, 0, MASS, TORQUE + 3, MASS)
            if named:
                take_names(layout, 0, 0, mask)
            does(lane, kind_of(layout, k), dt, own[0])
            put(layout, 0, X, P + 4, X)
            if named:
                given[k] = own[0].heat

    go.__name__ = name
    kernel(go)


move = NVE.operations["A"].does


@inlined
def kick_and_move(block, kind, dt, parameters):
    """What a step of NVE does before it places atoms."""
    kick(block, kind, 0.5 * dt, parameters)
    move(block, kind, dt, parameters)


operation("kick_and_rotate", kick_and_move, named=False)
operation("thermalise", thermalise, named=True)

# ---------------------------------------------------------------- from functions to a card's code


@inlined
def smaller(a, b):
    return b if b < a else a


@inlined
def larger(a, b):
    return b if b > a else a


# by names, what stands in for functions: for some numba asks what card there is; math's root of a
# negative number is an error in Python, and not a number on a card
INSTEAD = {"min": smaller, "max": larger}
INSTEAD |= {"sqrt": np.sqrt} if config.ENABLE_CUDASIM else {"int": np.int64}


def for_one_body(function: Any) -> Any:
    """The function with `LANES` = 1, as have the inlined functions that it calls."""

    def known(name: str, value: Any) -> Any:
        if isinstance(value, FunctionType) and value in INLINED:
            return device_function(value)
        return 1 if name == "LANES" else value

    code, around = function.__code__, function.__globals__ | INSTEAD
    loads = [step.argval for step in get_instructions(code) if step.opname == "LOAD_GLOBAL"]
    names = {name: known(name, around[name]) for name in loads if name in around}
    cells = zip(code.co_freevars, function.__closure__ or ())
    closure = tuple(CellType(known(name, cell.cell_contents)) for name, cell in cells)
    return FunctionType(code, names, function.__name__, closure=closure)


@cache
def device_function(function: Any) -> Any:
    """An inlined function for one body. Numba inlines it before it looks for types, since else it
    asks what card there is."""
    made = for_one_body(function)
    return made if config.ENABLE_CUDASIM else njit(inline="always")(made)


@cache
def compiled(name: str) -> Any:
    return cuda.jit(for_one_body(KERNELS[name]))


def bind(name: str, arrays: dict[str, Any]) -> Callable[[], Any]:
    """What launches a kernel on the arrays and numbers that have its arguments' names."""
    arguments = [arrays[argument] for argument in annotations(KERNELS[name])]
    cuda_blocks = -(-arrays["state"].shape[1] // THREADS)
    return partial(compiled(name)[cuda_blocks, THREADS], *arguments)


def ptx(name: str, capability: tuple[int, int]) -> str:
    """A kernel in PTX: each argument that is an array is seven numbers or more, as numba has it."""
    signature = []
    for kind in annotations(KERNELS[name]).values():
        what = from_dtype(kind.dtype)
        array = kind.dimensions or kind.dtype.names
        signature.append(types.Array(what, kind.dimensions or 1, "C") if array else what)
    code, _ = cuda.compile_ptx(for_one_body(KERNELS[name]), tuple(signature), cc=capability)
    return code


# ---------------------------------------------------------------- bodies


def make_bodies(counts: np.ndarray, moments: np.ndarray, planar: bool = False) -> Bodies:
    """Bodies of random places, orientations and momenta.

    Args:
        counts: (n,) how many atoms each has.  moments: (3, n) its principal moments.
        planar: whether all turn about axis 3 only.
    """
    random, n = np.random.default_rng(1), len(counts)
    q, turns = random.normal(size=(4, n)), random.normal(size=(3, n)) * np.sqrt(moments)
    if planar:
        q[1:3] = turns[:2] = 0.0
    state = np.zeros((block.ROWS, n))
    state[MASS], state[MOMENT : MOMENT + 3] = random.uniform(1, 20, n), moments
    state[X : V + 3] = random.normal(size=(6, n))
    state[Q : Q + 4] = q / np.linalg.norm(q, axis=0)
    state[P : P + 4] = quaternion_momentum(state[Q : Q + 4], *turns)
    state[NATOMS], state[ID] = counts, np.arange(1, n + 1)
    body = np.repeat(np.arange(n), counts)
    displace = random.normal(size=(4, len(body)))
    displace[:2, moments[2, body] == 0.0] = 0.0  # linear bodies have their atoms on axis 3
    displace[:3, moments[0, body] == 0.0] = 0.0
    return Bodies(state, body, displace, np.arange(len(body)), planar, False)


def bodies_of_all_kinds() -> Iterator[Bodies]:
    """Bodies of all kinds and sizes, in space and in a plane; some turn fast."""
    shapes = np.array([
        [3.0, 1.7, 0.8], [1.8, 1.2, 0.6], [1.0, 1.0, 1.0], [2.0, 2.0, 0.5], [2.0, 0.5, 0.5],
        [0.2, 0.15, 0.1], [0.02, 0.01, 0.005], [1.2, 1.2, 0.0], [0.0, 0.0, 0.0],
    ]).T  # fmt: skip
    moments = np.tile(shapes, 4)
    counts = np.tile([3, 3, 4, 5, 6, 70, 3, 2, 1], 4)
    yield make_bodies(counts, moments)
    yield make_bodies(counts[:9], moments[:, :9] + 1.0, planar=True)


def on_card(bodies: Bodies) -> dict[str, np.ndarray]:
    """Copies of the arrays of a `Layout` for blocks of one body, by name."""
    order = np.argsort(bodies.body, kind="stable")
    first = np.searchsorted(bodies.body[order], np.arange(len(bodies) + 1))
    return {
        "state": bodies.state.copy(),
        "kinds": np.array([bodies.kinds], Kinds.dtype),
        "first": first.astype(np.int32),
        "index": bodies.index[order],
        "displace": np.ascontiguousarray(bodies.displace[:, order]),
    }


def bath(mrot: int) -> Any:
    """Parameters of a step."""
    random = {"step": 2**33 + 5, "draw": 1, "key_0": 7, "key_1": 22}
    return Bath(ftm2v=0.4, mrot=mrot, rate=0.3, kt=1.3, heat=HEAT, **random)


# ---------------------------------------------------------------- against the host, and the clock


def check() -> dict[str, float]:
    """The largest difference of each kernel from the host's loops, for all kinds of bodies.

    Each begins with the host's arrays of before. A difference is relative to the largest number of
    its row of the state, or of the atoms' positions or forces.
    """
    worst = dict.fromkeys(KERNELS, 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of power series where they do not serve
        for bodies in bodies_of_all_kinds():
            for mrot in EXACT, 1, 3:
                for name, difference in _differences(bodies, mrot):
                    worst[name] = max(worst[name], difference)
    return worst


def _differences(bodies: Bodies, mrot: int) -> Iterator[tuple[str, float]]:
    """Of each kernel its name and how far it is from the host."""
    random, dt = np.random.default_rng(2), 0.2
    n = len(bodies.index)
    atoms = {"atom_x": np.zeros((n, 3)), "atom_f": random.normal(size=(n, 3))}
    lane = {"block": aligned((SHAPE[0], block.LANES))}
    parameters = bath(mrot)
    host = bodies.cells | atoms | lane | {"dt": dt, "parameters": parameters}
    steps = {
        "gather": gather_on_host.bind_to(host, all_bodies=1),
        "thermalise": draw_momenta.bind_to(host),
        "kick_and_rotate": NVE.advance.bind_to(host, gathers=0, ends=0, begins=1, part=block.ALL),
    }
    mask = bodies.cells["mask"].array
    numbers = {"dt": dt, "mask": mask, "given": np.zeros(len(bodies))}
    for name, step in steps.items():
        card = on_card(bodies) | {key: value.copy() for key, value in atoms.items()} | numbers
        card["parameters"] = np.array([parameters], Bath.dtype)
        step()
        bind(name, card)()
        yield name, _apart(card["state"], bodies.state)
        if name == "thermalise":
            given = card["given"].sum(keepdims=True)
            yield name, _apart(given, np.array([parameters.heat - HEAT]))
    card = on_card(bodies) | {"atom_x": np.zeros((n, 3))}
    bind("place", card)()
    yield "place", _apart(card["atom_x"].T, atoms["atom_x"].T)


def _apart(values: np.ndarray, wanted: np.ndarray) -> float:
    """The largest difference of two arrays, relative to the largest number of its row."""
    size = np.abs(wanted).max(axis=-1, keepdims=True)
    return float((np.abs(values - wanted) / np.where(size > 0.0, size, 1.0)).max())


# what a kernel reads and writes (its PTX says so): bytes for each body, and for each of its atoms
BYTES = {
    "gather": (8 * (4 + 6) + 4, 8 * (3 + 3) + 4),
    "place": (8 * 7 + 4, 8 * (3 + 3) + 4),
    "kick_and_rotate": (8 * (24 + 14), 0),
    "thermalise": (8 * (17 + 12), 0),
}
SIZES = 1, 10**4, 10**5, 10**6  # the first shows what a launch takes


def microseconds(does: Callable[[], Any], times: int = 50) -> float:
    """The time of each of several launches, one behind the other, on the card."""
    does()  # which compiles it
    begin, end = cuda.event(), cuda.event()
    begin.record()
    for _ in range(times):
        does()
    end.record()
    end.synchronize()
    return 1e3 * cuda.event_elapsed_time(begin, end) / times


def clock() -> list[dict[str, Any]]:
    """The kernels' times for water, beside what the memory would take for the bytes alone."""
    source, target = (cuda.device_array(2**27) for _ in range(2))
    bandwidth = 2 * 8 * 2**27 / microseconds(partial(target.copy_to_device, source))  # bytes per us
    rows = []
    for n in SIZES:
        bodies = make_bodies(np.full(n, 3), np.tile([[1.8], [1.2], [0.6]], n))
        zeros = np.zeros((3 * n, 3))
        host = {"atom_x": zeros, "atom_f": zeros, "mask": np.ones((6, 1)), "given": np.zeros(n)}
        host |= on_card(bodies) | {"parameters": np.array([bath(1)], Bath.dtype)}
        arrays = {name: cuda.to_device(array) for name, array in host.items()} | {"dt": 1e-3}
        for name, (each, atom) in BYTES.items():
            taken = microseconds(bind(name, arrays))
            moved = (each + 3 * atom) * n
            rows.append({"kernel": name, "waters": n, "us": taken, "bytes": moved})
            rows[-1] |= {"us of memory": moved / bandwidth}
            rows[-1] |= {"registers": compiled(name).get_regs_per_thread().popitem()[1]}
    return [{"copy, GB/s": bandwidth / 1e3}, *rows]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m validation.card", description=__doc__)
    parser.add_argument("--ptx", metavar="FOLDER", type=Path, help="write PTX there instead")
    parser.add_argument(
        "--capability", metavar="X.Y", default="8.0", help="of the card that PTX is for"
    )
    arguments = parser.parse_args()
    if arguments.ptx:
        arguments.ptx.mkdir(parents=True, exist_ok=True)
        major, minor = map(int, arguments.capability.split("."))
        for name in KERNELS:
            (arguments.ptx / f"{name}.ptx").write_text(ptx(name, (major, minor)))
        return
    said: dict[str, Any] = {"difference": check()}
    if not config.ENABLE_CUDASIM:
        said |= {"card": fsdecode(cuda.get_current_device().name), "times": clock()}
    print(json.dumps(said, indent=1))
    if not max(said["difference"].values()) < ROUNDING:
        parser.exit(1, f"a kernel is off the host's loops by more than {ROUNDING}\n")


if __name__ == "__main__":
    main()
