"""The passes of a step as kernels for a graphics card: a first step, which no fix uses.

    python -m validation.card                   checks them against the host's loops, times them
    python -m validation.card --ptx FOLDER 9.0  writes them in PTX, for which no card is needed

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

# ---------------------------------------------------------------- what is done with a body


@inlined
def gather(layout, k, atoms, dt, parameters, mask, given):
    """Sum force and torque over its atoms."""
    take(layout, 0, Q, Q + 4, Q)
    rotation_matrices(layout.block)
    write(layout.block, FORCE, 0, NO_FORCE)
    for j in range(layout.rounds[k], layout.rounds[k + 1]):
        force = atoms[layout.index[j]]
        write(layout.block, ATOM, 0, (force[0], force[1], force[2]))
        add_forces(layout.block, j, j + 1, layout.displace)
    put(layout, 0, FORCE, TORQUE + 3, FORCE)


@inlined
def place(layout, k, atoms, dt, parameters, mask, given):
    """Place its atoms, in its own periodic image."""
    take(layout, 0, X, Q + 4, X)
    rotation_matrices(layout.block)
    for j in range(layout.rounds[k], layout.rounds[k + 1]):
        apply_matrices(layout.block, X, j, j + 1, layout.displace)
        for c in range(3):
            atoms[layout.index[j], c] = layout.block[ATOM + c, 0]


move = NVE.operations["A"].does


@inlined
def kick_and_rotate(layout, k, atoms, dt, parameters, mask, given):
    """Do what a step of NVE does before it places atoms."""
    take(layout, 0, MASS, TORQUE + 3, MASS)
    kick(layout.block, kind_of(layout, k), 0.5 * dt, parameters)
    move(layout.block, kind_of(layout, k), dt, parameters)
    put(layout, 0, X, P + 4, X)


@inlined
def damp(layout, k, atoms, dt, parameters, mask, given):
    """Do what Langevin's thermostat does, and note the energy that it gives to the body."""
    take(layout, 0, MASS, P + 4, MASS)
    take_names(layout, 0, 0, mask)
    thermalise(layout.block, kind_of(layout, k), dt, parameters)
    put(layout, 0, X, P + 4, X)
    given[k] = parameters.heat


DOES = {
    "gather": gather, "kick_and_rotate": kick_and_rotate, "thermalise": damp, "place": place,
}  # fmt: skip


def kernel(does: Any) -> Any:
    """The function of a kernel that does something with each body, a thread one; not compiled.

    The layout that it makes is that of one block, with one body, for what moves rows between the
    `state` and the block. In place of rounds it has `first`: of each body its first atom.
    """

    def go(
        state: F2, kinds: Kinds, first: I1, index: I1, displace: F2, atoms: F2,
        dt: F, parameters: Bath, mask: F2, given: F1,
    ):  # fmt: skip
        k = cuda.grid(1)
        if k < state.shape[1]:
            lane, limits = cuda.local.array(SHAPE, NUMBER), cuda.local.array(LIMITS, COUNT)
            limits[0, 0], limits[1, 0] = k, k + 1
            layout = Layout(state, kinds[0], limits, first, index, displace, lane)
            own = cuda.local.array(1, BATH)  # all threads would add to the heat of one record
            own[0] = parameters[0]
            own[0].heat = 0.0
            does(layout, k, atoms, dt, own[0], mask, given)

    return go


# ---------------------------------------------------------------- from functions to a card's code


# by names, what stands in for functions: for some numba asks what card there is; math's root of a
# negative number is an error in Python, and not a number on a card
INSTEAD = {
    "min": inlined(lambda a, b: b if b < a else a),
    "max": inlined(lambda a, b: b if b > a else a),
} | ({"sqrt": np.sqrt} if config.ENABLE_CUDASIM else {"int": np.int64})


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
    return cuda.jit(for_one_body(kernel(DOES[name])))


def bind(name: str, arrays: dict[str, Any]) -> Callable[[], Any]:
    """What launches a kernel on the arrays and numbers that have its arguments' names."""
    arguments = [arrays[argument] for argument in annotations(kernel(DOES[name]))]
    cuda_blocks = -(-arrays["state"].shape[1] // THREADS)
    return partial(compiled(name)[cuda_blocks, THREADS], *arguments)


def ptx(name: str, capability: tuple[int, int]) -> str:
    """A kernel in PTX: each argument that is an array is seven numbers or more, as numba has it."""
    function, signature = kernel(DOES[name]), []
    for kind in annotations(function).values():
        what = from_dtype(kind.dtype)
        array = kind.dimensions or kind.dtype.names
        signature.append(types.Array(what, kind.dimensions or 1, "C") if array else what)
    return cuda.compile_ptx(for_one_body(function), tuple(signature), cc=capability)[0]


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


def bath(mrot: int, heat: float = 0.0) -> Any:
    """Parameters of a step; heat is what bodies have been given before."""
    random = {"step": 2**33 + 5, "draw": 1, "key_0": 7, "key_1": 22}
    return Bath(ftm2v=0.4, mrot=mrot, rate=0.3, kt=1.3, heat=heat, **random)


# ---------------------------------------------------------------- against the host, and the clock


def check() -> dict[str, float]:
    """The largest difference of each kernel from the host's loops, for all kinds of bodies.

    Each begins with the host's arrays of before. A difference is relative to the largest number of
    its row of the state, of the atoms' positions, or of the heat.
    """
    warnings.simplefilter("ignore")  # of power series where they do not serve
    worst = dict.fromkeys(DOES, 0.0)
    for bodies in bodies_of_all_kinds():
        for mrot in EXACT, 1, 3:
            for name, values, wanted in _pairs(bodies, mrot):
                size = np.abs(wanted).max(axis=-1, keepdims=True)
                apart = np.abs(values - wanted) / np.where(size > 0.0, size, 1.0)
                worst[name] = max(worst[name], float(apart.max()))
    return worst


def _pairs(bodies: Bodies, mrot: int) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Of each kernel its name, and what it and the host make of the same."""
    n, dt, heat = len(bodies.index), 0.2, 1.0
    forces, places = np.random.default_rng(2).normal(size=(n, 3)), np.zeros((n, 3))
    parameters, mask = bath(mrot, heat), bodies.cells["mask"].array
    host = bodies.cells | {"block": aligned((SHAPE[0], block.LANES)), "dt": dt}
    host |= {"atom_x": places, "atom_f": forces, "parameters": parameters}
    steps = {
        "gather": gather_on_host.bind_to(host, all_bodies=1),
        "thermalise": draw_momenta.bind_to(host),
        "kick_and_rotate": NVE.advance.bind_to(host, gathers=0, ends=0, begins=1, part=block.ALL),
        "place": lambda: None,  # it was done by the last one
    }
    card = {"dt": dt, "mask": mask, "given": np.zeros(len(bodies)), "atoms": forces}
    for name, step in steps.items():
        card |= on_card(bodies) | {"parameters": np.array([parameters], Bath.dtype)}
        step()
        bind(name, card)()
        yield name, card["state"], bodies.state
    yield "place", card["atoms"].T, places.T
    yield "thermalise", card["given"].sum(keepdims=True), np.array([parameters.heat - heat])


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
        host = {"atoms": np.zeros((3 * n, 3)), "mask": np.ones((6, 1)), "given": np.zeros(n)}
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
    parser.add_argument(
        "--ptx", nargs=2, metavar=("FOLDER", "X.Y"), help="write PTX for cards of this capability"
    )
    if asked := parser.parse_args().ptx:
        major, minor = map(int, asked[1].split("."))
        for name in DOES:
            Path(asked[0], f"{name}.ptx").write_text(ptx(name, (major, minor)))
        return
    if not cuda.is_available():
        parser.error("numba finds no card; with NUMBA_ENABLE_CUDASIM=1 it simulates one")
    said: dict[str, Any] = {"difference": check()}
    if not config.ENABLE_CUDASIM:
        said |= {"card": fsdecode(cuda.get_current_device().name), "times": clock()}
    print(json.dumps(said, indent=1))
    if not max(said["difference"].values()) < ROUNDING:
        parser.exit(1, f"a kernel is off the host's loops by more than {ROUNDING}\n")


if __name__ == "__main__":
    main()
