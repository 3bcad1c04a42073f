"""The free rotation in the compiled loops, split and exact: its error, and what a step costs.

Bodies with water's moments and atoms turn without forces, in all directions alike.  A step is the
whole pass of a run: force and torque from the atoms, both half kicks, the motion, and the atoms'
places.  Costs are of steps that are timed in turn.
"""

from collections.abc import Callable, Iterator
from time import perf_counter

import numpy as np

from fix_nosquish.bodies.bodies import MASS, MOMENT, Bodies, P, Q
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.loops.compiled import F2, Cell, F
from fix_nosquish.motion import block, step
from fix_nosquish.motion.operations import EXACT, Parameters

from ..scenes.units import BOLTZMANN
from .reference import multiply
from .top import free_top

ROTORS = {"split": 1, "split, mrot 2": 2, "split, mrot 4": 4, "exact": EXACT}
ANGLES = 0.0125, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8  # rad in a step
TOTAL = 20.0  # rad
TOPS = 40
THERMAL = 298.0 * BOLTZMANN * 4.184e-4  # kT in amu Å² / fs²
BODIES, ROUNDS, STEPS = 8192, 15, 12  # of what is timed
SITES = np.array([[0.0, 0.0655, 0.0], [0.757, -0.520, 0.0], [-0.757, -0.520, 0.0]])  # TIP3P, Å
MASSES = np.array([15.9994, 1.008, 1.008])


class Waters:
    """So many bodies with water's shape in the loops of NVE.

    Attributes:
        moments: (3,) principal moments, the largest first.
    """

    def __init__(self, n: int, rotor: float) -> None:
        # in the principal frame, whose axis 1 has the largest moment: it is that of the plane
        sites = SITES - MASSES @ SITES / MASSES.sum()
        squares = MASSES @ sites**2
        order = np.argsort(-(squares.sum() - squares))
        self.moments = (squares.sum() - squares)[order]
        state = np.zeros((block.ROWS, n))
        state[MASS], state[MOMENT], state[Q] = MASSES.sum(), self.moments[:, None], 1.0
        state[block.NATOMS], state[block.ID] = len(sites), np.arange(n)
        body, index = np.repeat(np.arange(n), 3), np.arange(3 * n, dtype=np.int32)
        places = np.concatenate([np.tile(sites[:, order].T, n), index[None]])
        self._bodies = Bodies(state, body, places, index, False, False)
        names = "atom_x", "atom_f", "atom_v"
        cells = self._bodies.cells | {name: Cell(F2, np.zeros((3 * n, 3))) for name in names}
        self._dt = Cell(F)
        cells |= {"dt": self._dt, "parameters": Parameters.new(ftm2v=1.0, mrot=rotor)}
        whole = {"gathers": step.GATHERS, "ends": True, "begins": True, "part": block.ALL}
        self._advance = NVE.advance.bind_to(cells, **whole)

    def turn(self, q: np.ndarray, p: np.ndarray, dt: float, steps: int) -> np.ndarray:
        """The quaternions (4, n) after so many steps."""
        state, order = self._bodies.state, self._bodies.id
        state[Q], state[P] = q[:, order], p[:, order]
        self._dt.set(dt)
        self.advance(steps)
        return state[Q][:, np.argsort(order)]

    def advance(self, steps: int) -> None:
        """Turn the bodies on, for so many further steps."""
        for _ in range(steps):
            self._advance()


def tops(n: int, moments: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Quaternions (4, n), angular momenta in the principal frame (3, n) as of one temperature, and
    quaternion momenta (4, n); a unit of time is that in which they turn by 1 rad, rms."""
    rng = np.random.default_rng(2007)
    q = rng.normal(size=(4, n))
    q /= np.linalg.norm(q, axis=0)
    L = rng.normal(size=(3, n)) * np.sqrt(moments)[:, None]
    L /= np.sqrt(((L / moments[:, None]) ** 2).sum(axis=0).mean())
    return q, L, 2 * multiply(q, np.concatenate([np.zeros((1, n)), L]))


def thermal() -> float:
    """How far water turns in 1 fs at 298 K, rad, rms."""
    return float(np.sqrt((THERMAL / Waters(1, 1).moments).sum()))


def errors() -> Iterator[tuple[str, list[float]]]:
    """The root mean square error of the orientation, rad, of each rotor, at each of `ANGLES`."""
    for name, rotor in ROTORS.items():
        waters = Waters(TOPS, rotor)
        q, L, p = tops(TOPS, waters.moments)
        exact = np.transpose([free_top(*top, waters.moments, TOTAL)[0] for top in zip(q.T, L.T)])
        off = []
        for angle in ANGLES:
            end = waters.turn(q, p, angle, round(TOTAL / angle))
            end = end * np.sign((end * exact).sum(axis=0))
            off.append(float(2 * np.sqrt(((end - exact) ** 2).sum(axis=0).mean())))
        yield name, off


def costs(tick: Callable[[], None]) -> dict[str, list[float]]:
    """The time of a step of each rotor over that of the first one, in each of some rounds, of which
    `tick` is told."""
    every = {name: Waters(BODIES, rotor) for name, rotor in ROTORS.items()}
    times: dict[str, list[float]] = {name: [] for name in every}
    for k in range(ROUNDS + 1):
        for name, waters in every.items():
            q, _, p = tops(BODIES, waters.moments)
            waters.turn(q, p, 0.1, 1)
            begin = perf_counter()
            waters.advance(STEPS)
            if k:  # the first round warms up
                times[name].append(perf_counter() - begin)
        if k:
            tick()
    first = times[next(iter(ROTORS))]
    return {name: [a / b for a, b in zip(own, first)] for name, own in times.items()}
