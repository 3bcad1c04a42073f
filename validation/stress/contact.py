"""Bodies that rotate in a field, and bodies that collide far from the origin.

Reduced units; most bodies are bent triatomics, which fix shake can constrain too.
"""

import numpy as np

from ..scenes import bodies
from ..scenes.units import NS_OF_REDUCED
from ..statistics import motion
from . import molecules
from .measure import EXACT, Case, Number, Runner, of_parts

REPULSIVE = (
    "pair_style lj/cut 1.122462048309373",
    "pair_modify shift yes",
    "pair_coeff * * 1.0 1.0",
    "neigh_modify every 1 delay 0 check yes exclude molecule/intra all",
)
BOX = 10.0
FAR = 1e6  # box lengths
DT = 0.004
WHOLE = bodies.MASSES.sum()


def _liquid(runner, name, corner):
    """Bent triatomics on a lattice of 4³ sites with random orientations, at temperature 1."""
    rng, members = np.random.default_rng(4), []
    moments, axes = bodies.moments(bodies.BENT, bodies.MASSES)
    for site in np.ndindex(4, 4, 4):
        turn = bodies.Rotation.from_quat(rng.normal(size=4))
        spin = turn.apply(axes @ (rng.normal(size=3) / np.sqrt(moments)))
        place, velocity = BOX / 4 * (np.array(site) + 0.5) + corner, rng.normal(size=3)
        how: dict = {"place": place, "turn": turn, "velocity": velocity / np.sqrt(WHOLE)}
        members.append(bodies.body(bodies.BENT, bodies.MASSES, spin=spin, **how))
    return _scene(runner, name, members, [*REPULSIVE, "neighbor 0.4 bin"], BOX, corner)


def _scene(runner, name, members, setup, box, corner):
    folder, ends = runner.folder.parent, {"box": box, "corner": np.full(3, corner)}
    return bodies.scene(folder, members, setup, dt=DT, name=name, bonded=True, **ends)


@Case.of(
    "gradient",
    "Dipolar bodies in a field whose gradient changes it over their own length.",
    10_000,
    500_000,
    **molecules.OF_DRIFT,
)
def gradient(runner: Runner, steps: int) -> Number:
    """Measure dipoles in a field that varies over their length, and in a harmonic trap."""
    charge, rng, members = np.array([-2.0, 1.0, 1.0]), np.random.default_rng(9 + runner.start), []
    for k in range(20):
        turn, keys = bodies.turned(k + 20 * runner.start), ("place", "velocity", "spin")
        members.append(
            bodies.body(
                bodies.BENT,
                bodies.MASSES,
                turn=turn,
                charge=charge,
                **{key: rng.normal(size=3) for key in keys},
            )
        )
    setup = (
        *bodies.FREE,
        "neighbor 6.0 bin",
        "neigh_modify once yes",
        "variable e atom 1000*q*x*y+50*(x*x+y*y+z*z)",  # field (-1000 y, -1000 x, 0)
        "variable fx atom -1000*q*y-100*x",
        "variable fy atom -1000*q*x-100*y",
        "variable fz atom -100*z",
        "fix field all addforce v_fx v_fy v_fz energy v_e",
        "fix_modify field energy yes",
    )
    return molecules.drift(
        runner,
        _scene(runner, f"dipoles-{runner.start}", members, setup, 100.0, -50.0),
        steps,
        NS_OF_REDUCED,
        max(1, steps // 1000),
    )


@Case.of(
    "far-away",
    "Bodies that collide, 1e6 box lengths from the origin.",
    100,
    100,
    criterion="larger of: distance from the same bodies at the origin; relative change of the "
    "pressure; each over its bound",
    bars=EXACT,
)
def far_away(runner: Runner, steps: int) -> Number:
    """Measure the same bodies in a box at the origin and in one far from it."""
    ends, pressures = [], []
    for name, corner in ("near", 0.0), ("far", FAR * BOX):
        scene, more = _liquid(runner, name, corner), motion.dump(steps)
        result, folder = runner.run(scene, name, [steps], dt=DT, every=1, more=more)
        ends.append(motion.frames(folder)[2][-1] - corner)
        pressures.append(result.thermo["Press"])
    distance = np.linalg.norm(ends[1] - ends[0], axis=1).max()
    pressure = np.abs(pressures[1] / pressures[0] - 1).max()
    return of_parts(
        {"far place": distance, "far pressure": pressure},
        f"motion: {distance:.1e} σ; pressure: {pressure:.1e} of itself",
    )


CASES = gradient, far_away
