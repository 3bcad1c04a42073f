"""Bodies that collide or that a field turns, far from the origin, on many ranks.

Reduced units; most bodies are bent triatomics, which fix shake can hold too.
"""

from dataclasses import replace

import numpy as np

from ..scenes import bodies
from ..scenes.units import NS_OF_REDUCED
from ..statistics import motion
from . import molecules
from .measure import EXACT, Case, Number, Stand, of_parts

REPULSIVE = (
    "pair_style lj/cut 1.122462048309373",
    "pair_modify shift yes",
    "pair_coeff * * 1.0 1.0",
    "neigh_modify every 1 delay 0 check yes exclude molecule/intra all",
)
DENSE = (
    "pair_style lj/cut 2.5",
    "pair_coeff * * 1.0 1.0",
    "neigh_modify every 2 delay 0 check no",
    "velocity all set 40 -40 40 sum yes",
)
RANKS = 2, 4, 8
BOX = 10.0
FAR = 1e6  # box lengths
ROUNDING = 1e-15  # σ, of positions in a box of 8 σ
DT = 0.004
WHOLE = bodies.MASSES.sum()


def _liquid(stand, name, count, box, *, seed, corner=0.0, least=0.0, more=()):
    """Bent triatomics on a lattice of count³ places, each turned at random so that no atoms are
    nearer than ``least``, thermal at temperature 1."""
    rng, side = np.random.default_rng(seed), box / count
    moments, axes = bodies.moments(bodies.BENT, bodies.MASSES)
    found: list[bodies.Body] = []
    for site in np.ndindex(count, count, count):
        place = side * (np.array(site) + 0.5) + corner
        turn = _turn(rng, place, found, box, least)
        spin = turn.apply(axes @ (rng.normal(size=3) / np.sqrt(moments)))
        found.append(
            bodies.body(
                bodies.BENT,
                bodies.MASSES,
                place=place,
                turn=turn,
                velocity=rng.normal(size=3) / np.sqrt(WHOLE),
                spin=spin,
            )
        )
    return _scene(stand, name, found, [*REPULSIVE, "neighbor 0.4 bin", *more], box, corner, DT)


def _turn(rng, place, others, box, least):
    """A random turn with which no atom of a body at that place is nearer than ``least`` to the
    others' or their periodic images."""
    there = np.concatenate([np.empty((0, 3)), *(other.x for other in others)])
    while True:
        turn = bodies.Rotation.from_quat(rng.normal(size=4))
        apart = bodies.body(bodies.BENT, bodies.MASSES, place=place, turn=turn).x[:, None] - there
        if (np.linalg.norm(apart - box * np.round(apart / box), axis=2) >= least).all():
            return turn


def _scene(stand, name, found, setup, box, corner, dt, **more):
    folder, corner = stand.folder.parent, np.full(3, corner)
    more |= {"box": box, "corner": corner, "dt": dt, "name": name, "bonded": True}
    return bodies.scene(folder, found, setup, **more)


def _end(stand, scene, label, steps, every=None, **how):
    """The result of a run, and where the atoms are at its end."""
    how |= {"dt": scene.dt, "every": every or steps, "more": motion.dump(steps)}
    result, folder = stand.run(scene, label, [steps], **how)
    return result, motion.frames(folder)[2][-1]


def _apart(end, other):
    """How far an atom is from where it is at another end, at most."""
    return np.linalg.norm(end - other, axis=1).max()


@Case.of(
    "gradient",
    "Dipolar bodies in a field whose gradient changes it over their own length.",
    10_000,
    500_000,
    **molecules.OF_DRIFT,
)
def gradient(stand: Stand, steps: int) -> Number:
    """Dipoles in a field that changes over their length, and a trap that keeps them there."""
    charge, rng, found = np.array([-2.0, 1.0, 1.0]), np.random.default_rng(9 + stand.start), []
    for k in range(20):
        turn, keys = bodies.turned(k + 20 * stand.start), ("place", "velocity", "spin")
        how = {key: rng.normal(size=3) for key in keys}
        found.append(bodies.body(bodies.BENT, bodies.MASSES, turn=turn, charge=charge, **how))
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
    scene = _scene(stand, f"dipoles-{stand.start}", found, setup, 100.0, -50.0, DT)
    return molecules.drift(stand, scene, steps, NS_OF_REDUCED, max(1, steps // 1000))


@Case.of(
    "far-away",
    "Bodies that collide, 1e6 box lengths from the origin.",
    100,
    100,
    criterion="larger of: distance from the same bodies at the origin; relative change of the "
    "pressure; each over its bound",
    bars=EXACT,
)
def far_away(stand: Stand, steps: int) -> Number:
    """The same bodies in a box at the origin and in one far off."""
    ends, pressures = [], []
    for name, corner in ("near", 0.0), ("far", FAR * BOX):
        scene = _liquid(stand, name, 4, BOX, seed=4, corner=corner)
        result, x = _end(stand, scene, name, steps, every=1)
        ends.append(x - corner)
        pressures.append(result.thermo["Press"])
    distance, pressure = _apart(*ends), np.abs(pressures[1] / pressures[0] - 1).max()
    return of_parts(
        {"far place": distance, "far pressure": pressure},
        f"motion: {distance:.1e} σ; pressure: {pressure:.1e} of itself",
    )


@Case.of(
    "ranks",
    "Fast bodies of a dense liquid, each atom with dozens in reach, on 1, 2, 4 and 8 ranks, owners "
    "new every other step.",
    40,
    200,
    criterion="largest distance from the trajectory of one rank, over how far that one gets when "
    "its start is moved by rounding, 1e-15 σ",
    bars=EXACT,
)
def ranks(stand: Stand, steps: int) -> Number:
    """Many a body is parted among ranks: what is added up, is so in another order for each number
    of ranks."""
    scene = _liquid(stand, "dense", 4, 0.64 * BOX, seed=8, least=0.9, more=DENSE)
    shift = f"displace_atoms all random {ROUNDING} {ROUNDING} {ROUNDING} 4928"
    moved = replace(scene, setup=(*scene.setup, shift))
    one = _end(stand, scene, "1", steps)[1]
    rounding = _apart(_end(stand, moved, "1, moved", steps)[1], one)
    apart = {n: _apart(_end(stand, scene, f"{n}", steps, ranks=n)[1], one) for n in RANKS}
    told = ", ".join(f"{count} ranks: {far:.1e}" for count, far in apart.items())
    return Number(
        max(apart.values()) / rounding, note=f"{told} σ; one rank, moved: {rounding:.1e} σ"
    )


CASES = gradient, far_away, ranks
