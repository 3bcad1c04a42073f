"""Bodies that act on each other, or that something acts on, hard: walls, springs, gradients, unequal masses, fast flight, far places, ranks.

Reduced units; most bodies are bent triatomics, which fix shake can hold too.
"""

from dataclasses import replace

import numpy as np

from validation import criteria, measures, motion
from validation import stability_bodies as bodies
from validation.stability import (
    EXTREME,
    LINE,
    Case,
    Number,
    drift_of_starts,
    lowest_of_starts,
    mean_of_starts,
    of_parts,
)
from validation.stability_molecules import (
    ALLOWED,
    DRIFT,
    DRIFTS,
    GRID,
    HEAVY,
    LONGEST,
    SOME,
    STARTS,
    limit,
)

REPULSIVE = (
    "pair_style lj/cut 1.122462048309373",
    "pair_modify shift yes",
    "pair_coeff * * 1.0 1.0",
    "neigh_modify every 1 delay 0 check yes exclude molecule/intra all",
)
RANKS = 2, 4, 8
BOX = 10.0
FAR = 1e6  # box lengths
ROUNDING = 1e-15  # σ, of positions in a box of 8 σ
DT = 0.004
FLIGHTS = 0.5, 2.0, 4.0  # in a step, where the skin is 0.4 and a rank's part of the box 5 wide
RESONANT = np.arange(0.9, 1.605, 0.01)  # ωΔt
ALONG = np.array([0.8, 0.0, 0.6])


def _liquid(
    stand, name, count, box, *, seed, dt, masses=None, corner=(0, 0, 0), least=0.0, more=()
):
    """Bent triatomics on a lattice of count³ places, each turned at random so that no atoms are nearer than ``least``, thermal at temperature 1."""
    rng, found = np.random.default_rng(seed), []
    side = box / count
    for k, site in enumerate(np.ndindex(count, count, count)):
        mass = bodies.MASSES * (1.0 if masses is None else masses[k])
        turn = _turn(rng, side * (np.array(site) + 0.5) + corner, found, box, least)
        moments, axes = bodies.moments(bodies.BENT, mass)
        spin = turn.apply(axes @ (rng.normal(size=3) / np.sqrt(moments)))
        velocity = rng.normal(size=3) / np.sqrt(mass.sum())
        found.append(
            bodies.body(
                bodies.BENT,
                mass,
                place=side * (np.array(site) + 0.5) + corner,
                turn=turn,
                velocity=velocity,
                spin=spin,
            )
        )
    return bodies.scene(
        stand.folder.parent,
        found,
        (*REPULSIVE, "neighbor 0.4 bin", *more),
        box=box,
        corner=corner,
        dt=dt,
        name=name,
        bonded=True,
    )


def _turn(rng, place, others, box, least):
    """A random turn with which no atom of a body at that place is nearer than ``least`` to the others' or their periodic images."""
    there = np.concatenate([np.empty((0, 3)), *(one.x for one in others)])
    while True:
        turn = bodies.Rotation.from_quat(rng.normal(size=4))
        apart = bodies.body(bodies.BENT, bodies.MASSES, place=place, turn=turn).x[:, None] - there
        if (np.linalg.norm(apart - box * np.round(apart / box), axis=2) >= least).all():
            return turn


def _drift(result):
    """Change of the energy, by a straight line, over the mean kinetic energy, in a ns of argon."""
    slope = measures.drift(result.thermo["Time"], result.thermo["TotEng"]).times(
        criteria.NS_OF_REDUCED / result.thermo["KinEng"].mean()
    )
    return Number(slope.value, slope.error, freedom=slope.freedom)


def mass_ratio(stand, steps):
    """A body a million times as heavy among light ones."""
    masses = np.ones(27)
    masses[13] = 1e6
    scene = _liquid(
        stand, f"masses-{stand.start}", 3, 6.0, seed=3 + stand.start, dt=0.008, masses=masses
    )
    result, _ = stand.run(
        scene, f"start {stand.start + 1}", [steps], dt=scene.dt, every=max(1, steps // 1000)
    )
    return _drift(result)


def contact(stand, steps):
    """Two bodies that a spring presses together, centre to centre."""
    turns = bodies.turned(5 + 2 * stand.start), bodies.turned(6 + 2 * stand.start)
    found = [
        bodies.body(bodies.BENT, bodies.MASSES, place=(x, 0, 0), turn=turn, spin=(0.3, 0.5, x))
        for x, turn in zip((-0.9, 0.9), turns)
    ]
    setup = (
        *REPULSIVE,
        "neighbor 6.0 bin",
        "group one molecule 1",
        "group two molecule 2",
        "fix press one spring couple two 300.0 0 0 0 0.0",
        "fix_modify press energy yes",
    )
    scene = bodies.scene(stand.folder.parent, found, setup, box=40.0, corner=(-20, -20, -20), dt=0.001, name=f"pair-{stand.start}",
                         bonded=True)  # fmt: skip
    result, _ = stand.run(
        scene, f"start {stand.start + 1}", [steps], dt=scene.dt, every=max(1, steps // 1000)
    )
    return _drift(result)


def springs(stand, periods):
    """Two equal bodies with a stiff spring between each two like atoms: the longest Δt times the highest frequency, for so many periods from each start."""
    stiffness, M = 1000.0, bodies.MASSES.sum()
    r = bodies.BENT - bodies.MASSES @ bodies.BENT / M
    cross = np.array([[[0, -z, y], [z, 0, -x], [-y, x, 0]] for x, y, z in r])
    jacobian = np.concatenate([np.tile(np.eye(3), (3, 1, 1)), -cross], axis=2)
    inertia = np.einsum("i,iab,iac->bc", bodies.MASSES, cross, cross)
    mobility = np.zeros((6, 6))
    mobility[:3, :3], mobility[3:, 3:] = np.eye(3) * 2 / M, 2 * np.linalg.inv(inertia)
    omega = np.sqrt(
        np.linalg.eigvals(
            mobility @ np.einsum("iab,iac->bc", jacobian, jacobian) * stiffness
        ).real.max()
    )
    setup = [*bodies.FREE, "neighbor 3.0 bin", "neigh_modify once yes"]
    for k in (1, 2, 3):
        setup += [
            f"group a{k} id {k}",
            f"group b{k} id {k + 3}",
            f"fix s{k} a{k} spring couple b{k} {stiffness} 0 0 0 0.0",
            f"fix_modify s{k} energy yes",
        ]
    rng = np.random.default_rng(stand.start)
    velocity = 0.3 * rng.normal(size=3)
    found = [
        bodies.body(bodies.BENT, bodies.MASSES, velocity=sign * velocity, spin=rng.normal(size=3))
        for sign in (1, -1)
    ]
    scene = bodies.scene(stand.folder.parent, found, setup, box=40.0, corner=(-20, -20, -20), dt=1 / omega, name=f"springs-{stand.start}",
                         bonded=True)  # fmt: skip
    return limit(
        stand,
        scene,
        np.arange(0.1, 2.3, 0.1) / omega,
        periods * 2 * np.pi / omega,
        unit=1 / omega,
        name="",
    )


def gradient(stand, steps):
    """Dipoles in a field that changes over their length, and a trap that keeps them there."""
    charge, rng, found = np.array([-2.0, 1.0, 1.0]), np.random.default_rng(9 + stand.start), []
    for k in range(20):
        found.append(bodies.body(bodies.BENT, bodies.MASSES, place=rng.normal(size=3), turn=bodies.turned(k + 20 * stand.start), velocity=rng.normal(size=3),
                                 spin=rng.normal(size=3), charge=charge))  # fmt: skip
    setup = (
        *bodies.FREE, "neighbor 6.0 bin", "neigh_modify once yes",
        "variable e atom 1000*q*x*y+50*(x*x+y*y+z*z)",  # field (-1000 y, -1000 x, 0)
        "variable fx atom -1000*q*y-100*x", "variable fy atom -1000*q*x-100*y", "variable fz atom -100*z",
        "fix field all addforce v_fx v_fy v_fz energy v_e", "fix_modify field energy yes",
    )  # fmt: skip
    scene = bodies.scene(stand.folder.parent, found, setup, box=100.0, corner=(-50, -50, -50), dt=DT, name=f"dipoles-{stand.start}",
                         bonded=True)  # fmt: skip
    result, _ = stand.run(
        scene, f"start {stand.start + 1}", [steps], dt=scene.dt, every=max(1, steps // 1000)
    )
    return _drift(result)


def far_away(stand, steps):
    """The same bodies in a box at the origin and in one far off."""
    ends, pressures = [], []
    for name, corner in ("near", 0.0), ("far", FAR * BOX):
        scene = _liquid(stand, name, 4, BOX, seed=4, dt=DT, corner=np.full(3, corner))
        result, folder = stand.run(
            scene, name, [steps], dt=scene.dt, every=1, more=motion.dump(steps)
        )
        ends.append(motion.frames(folder)[2][-1] - corner)
        pressures.append(result.thermo["Press"])
    distance = np.linalg.norm(ends[1] - ends[0], axis=1).max()
    pressure = np.abs(pressures[1] / pressures[0] - 1).max()
    return of_parts(
        {"far place": distance, "far pressure": pressure},
        f"motion: {distance:.1e} σ; pressure: {pressure:.1e} of itself",
    )


def ranks(stand, steps):
    """Fast bodies on 1, 2, 4, 8 ranks, neighbour lists and owners new at every other step: how far from the trajectory of one rank, over how far that
    is from itself with every atom moved by `ROUNDING` at the start?

    Each atom feels dozens, and many a body is parted among ranks: what is added up, is added up in another order for each number of ranks.
    """
    dense = (
        "pair_style lj/cut 2.5",
        "pair_coeff * * 1.0 1.0",
        "neigh_modify every 2 delay 0 check no",
        "velocity all set 40 -40 40 sum yes",
    )
    scene = _liquid(stand, "dense", 4, 0.64 * BOX, seed=8, dt=DT, least=0.9, more=dense)
    moved = replace(
        scene,
        setup=(*scene.setup, f"displace_atoms all random {ROUNDING} {ROUNDING} {ROUNDING} 4928"),
    )
    ends = {}
    for name, start, count in (
        ("1", scene, 1),
        ("1, moved", moved, 1),
        *((f"{count}", scene, count) for count in RANKS),
    ):
        _, folder = stand.run(
            start, name, [steps], dt=scene.dt, every=steps, ranks=count, more=motion.dump(steps)
        )
        ends[name] = motion.frames(folder)[2][-1]
    apart = {name: np.linalg.norm(end - ends["1"], axis=1).max() for name, end in ends.items()}
    rounding = apart["1, moved"]
    told = ", ".join(f"{count} ranks: {apart[str(count)]:.1e}" for count in RANKS)
    return Number(
        max(apart[str(count)] for count in RANKS) / rounding,
        note=f"{told} σ; one rank, moved: {rounding:.1e} σ",
    )


def beyond_skin(stand, steps):
    """The same liquid at rest and flying by `FLIGHTS` in a step, on two ranks: how far apart, in the frame that flies with it?"""
    ends = {}
    for flight in (0.0, *FLIGHTS):
        velocity = flight / DT * ALONG
        scene = bodies.drifting(_liquid(stand, "flight", 4, BOX, seed=8, dt=DT), velocity)
        _, folder = stand.run(
            scene, f"{flight:g}", [steps], dt=DT, every=steps, ranks=2, more=motion.dump(steps)
        )
        ends[flight] = motion.frames(folder)[2][-1] - steps * DT * velocity
    apart = {flight: np.linalg.norm(ends[flight] - ends[0.0], axis=1).max() for flight in FLIGHTS}
    return Number(
        max(apart.values()),
        note=", ".join(f"{flight:g} σ a step: {value:.1e}" for flight, value in apart.items()),
    )


def resonance(stand, periods):
    """Bodies with a loose atom each on a stiff spring, ω its frequency: up to which step is the energy kept?"""
    stiffness, rest, count, loose = 5000.0, 1.0, 6, 1.0
    r = bodies.BENT[1] - bodies.MASSES @ bodies.BENT / bodies.MASSES.sum()
    outward = np.array([r[1], -r[0], 0.0]) / np.linalg.norm(
        r
    )  # across, so that the spring turns the body
    moments, axes = bodies.moments(bodies.BENT, bodies.MASSES)
    lever = np.cross(r, outward) @ axes
    omega = np.sqrt(stiffness * (1 / loose + 1 / bodies.MASSES.sum() + (lever**2 / moments).sum()))
    setup = [
        *REPULSIVE,
        "neighbor 0.4 bin",
        f"group held molecule <= {count}",
        "group loose subtract all held",
    ]
    for k in range(count):
        setup += [
            f"group a{k} id {3 * k + 2}",
            f"group b{k} id {3 * count + k + 1}",
            f"fix s{k} a{k} spring couple b{k} {stiffness} 0 0 0 {rest}",
        ]
        setup += [f"fix_modify s{k} energy yes"]
    rng, found, atoms = np.random.default_rng(12 + stand.start), [], []
    for k in range(count):
        turn, place = bodies.turned(k), 3.2 * np.array([k % 2, k // 2 % 2, k // 4]) + 1.6
        found.append(
            bodies.body(
                bodies.BENT,
                bodies.MASSES,
                place=place,
                turn=turn,
                velocity=rng.normal(size=3),
                spin=rng.normal(size=3),
            )
        )
        atoms.append(
            bodies.body(
                np.zeros((1, 3)),
                [loose],
                place=place + turn.apply(r + rest * outward),
                velocity=rng.normal(size=3),
            )
        )
    scene = bodies.scene(stand.folder.parent, found + atoms, setup, box=6.4, dt=1 / omega, name=f"loose-{12 + stand.start}", bonded=True, group="held",
                         others=("fix others loose nve",))  # fmt: skip
    return limit(
        stand, scene, RESONANT / omega, periods * 2 * np.pi / omega, unit=1 / omega, name=""
    )


SOME_DRIFTS = {"starts": DRIFTS, "together": drift_of_starts}
CASES = (
    Case(
        "mass-ratio", "A body of 1e6 times the mass of those that hit it.", DRIFT, LINE, mass_ratio, 40_000, 400_000, **SOME_DRIFTS,
    ),
    Case(
        "contact", "Two bodies pressed against each other's r⁻¹² walls by a spring of 300 ε/σ².", DRIFT, LINE, contact, 200_000, 2_000_000,
        **SOME_DRIFTS,
    ),
    Case(
        "springs", "Two bodies joined by stiff springs from atom to atom, ω the highest frequency.",
        LONGEST.format("ωΔt", ALLOWED, "100 periods", "5,000") + ", a mean over starts", SOME,
        springs, 100, 5000, starts=STARTS, together=mean_of_starts,
    ),
    Case(
        "gradient", "Dipolar bodies in a field whose gradient changes it over their own length.", DRIFT, LINE, gradient, 10_000, 500_000, **SOME_DRIFTS,
    ),
    Case(
        "beyond-skin", "Bodies that collide while all fly along by 0.5 to 4 σ in a step, on two ranks; the neighbour skin is 0.4 σ.",
        "largest distance from the same bodies without that flight", EXTREME, beyond_skin, 50, 500,
    ),
    Case(
        "far-away", "Bodies that collide, 1e6 box lengths from the origin.",
        "larger of: distance from the same bodies at the origin; relative change of the pressure; each over its bound",
        EXTREME, far_away, 100, 100,
    ),
    Case(
        "ranks", "Fast bodies of a dense liquid, each atom with dozens in reach, on 1, 2, 4 and 8 ranks, owners new every other step.",
        "largest distance from the trajectory of one rank, over how far that one gets when its start is moved by rounding, 1e-15 σ",
        EXTREME, ranks, 40, 200, few=HEAVY,
    ),
    Case(
        "resonance", "Rigid bodies that collide, each with a loose atom on a stiff spring, the stiffest bond of the scene, of frequency ω.",
        LONGEST.format("ωΔt, from 0.9 by 0.01,", ALLOWED, "50 periods", "1,000") + ", the lowest of all starts", GRID,
        resonance, 50, 1000, starts=STARTS, together=lowest_of_starts, every=True,
    ),
)  # fmt: skip
