"""The integrator in LAMMPS against LAMMPS's own rigid fixes, plain formulas and conservation laws.

Order of axes: in 22 Jul 2025 LAMMPS's fix rigid/nve turns a body about the axis of its largest
moment outermost, NVE about that of the smallest.  Where a test asks for the very trajectory of
rigid/nve, it runs NVE with `order 123`; in its own order the two differ by terms of dt^2, which has
tests of its own.
"""

import itertools
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from support.systems import (
    LIKE_LAMMPS,
    OURS,
    RIGID,
    SMALL,
    UNITS,
    System,
    apart,
    assemble,
    assert_same,
    hot_rods,
    mixture,
    tensor,
    turned,
    water,
)

# ---- trajectories


@pytest.mark.quick("1", "2")
@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_water_moves_as_with_rigid_nve(simulate, ranks):
    """Locks out force, torque, exchange between ranks or migration that are off by more than
    round-off, and a temperature or energy with the wrong degrees of freedom or of velocities from
    another time."""
    system = water()
    theirs = simulate(system, RIGID, 50)
    ours = simulate(system, LIKE_LAMMPS, 50, ranks=ranks)
    assert apart(ours, theirs, system.h) < 1e-8
    assert len(ours.thermo) == 6
    np.testing.assert_allclose(ours.thermo["Temp"], theirs.thermo["Temp"], rtol=1e-10)


@pytest.mark.quick("cube-1", "plane-1", "triclinic-4")
@pytest.mark.parametrize("ranks", [1, 4])
@pytest.mark.parametrize("shape", ["cube", "triclinic", "plane"])
def test_bodies_move_as_with_rigid_nve(simulate, shape, ranks):
    """Locks out bodies put together wrongly across tilted faces, wrong moments or torques of planar
    and three-dimensional bodies, and in two dimensions of any body, rotation out of the plane
    included."""
    system = {
        "cube": lambda: mixture("solid planar"),
        "triclinic": lambda: mixture("solid planar", tilt=0.3),
        "plane": lambda: mixture("planar pair row single", side=5, dimension=2),
    }[shape]()
    flat = "fix 9 all enforce2d" if shape == "plane" else ""
    theirs = simulate(system, RIGID, 50, before=flat)
    ours = simulate(system, LIKE_LAMMPS, 50, before=flat, ranks=ranks)
    assert_same(ours, theirs, system.h)
    np.testing.assert_allclose(ours.thermo["Temp"], theirs.thermo["Temp"], rtol=1e-10)


@pytest.mark.quick("pair row")
@pytest.mark.parametrize("kinds", ["solid planar pair row single", "solid", "pair row"])
def test_difference_from_rigid_nve_is_of_second_order(simulate, kinds):
    """Locks out a splitting with the class's own order of axes, or a linear rotor, that solves
    other equations: after the same time the distance falls with dt^2.  (LAMMPS splits linear
    rotors.)"""
    system = mixture(kinds)
    coarse, fine = (
        apart(simulate(system, OURS, n, dt=20 / n), simulate(system, RIGID, n, dt=20 / n), system.h)
        for n in (40, 80)
    )
    assert coarse / fine == pytest.approx(4.0, rel=0.1)
    assert fine < 1e-4


@pytest.mark.quick
@pytest.mark.parametrize("order, turns", [("", (0, 1, 2, 1, 0)), ("order 123", (2, 1, 0, 1, 2))])
def test_order_of_axes(simulate, order, turns):
    """Locks out moments numbered otherwise than I_1 >= I_2 >= I_3, and another order of turns than
    3,2,1,2,3, or 1,2,3,2,1 where that is asked for: one free step in plain numpy."""
    system = mixture("solid planar")
    free = "pair_style zero 2.5\npair_coeff * *\n"
    start, got = (
        simulate(system, OURS, n, dt=20, before=free, words="molecule " + order) for n in (0, 1)
    )
    x, time, parts = start.x, 20 * system.dt, (0.5, 0.5, 1.0, 0.5, 0.5)
    for body in np.unique(system.molecule):
        mine = system.molecule == body
        mass = system.mass[mine]
        r = x[mine] - x[mine][0]
        r -= np.rint(r @ np.linalg.inv(system.h).T) @ system.h.T
        centre = mass @ r / mass.sum()
        r, velocity = r - centre, mass @ start.v[mine] / mass.sum()
        L = mass @ np.cross(r, start.v[mine] - velocity)
        inertia = sum(m * (d @ d * np.eye(3) - np.outer(d, d)) for m, d in zip(mass, r))
        moments, axes = np.linalg.eigh(inertia)  # the smallest first
        frame = axes.copy()
        for k, part in zip(turns, parts):
            about = frame[:, k]
            frame = (
                Rotation.from_rotvec(L @ about / moments[k] * part * time * about).apply(frame.T).T
            )
        want = x[mine][0] + centre + velocity * time + r @ axes @ frame.T
        delta = got.x[mine] - want
        delta -= np.rint(delta @ np.linalg.inv(system.h).T) @ system.h.T
        assert np.abs(delta).max() < 1e-12, f"body {body}"


# ---- start


@pytest.mark.quick("1")
@pytest.mark.parametrize("ranks", [1, 4])
def test_start_velocities(simulate, ranks):
    """Locks out a projection that changes a body's linear or angular momentum, leaves motion that
    is not rigid, or logs another loss of kinetic energy than there is."""
    system = mixture()
    before, after = (simulate(system, fix, 0, ranks=n) for fix, n in (("", 1), (OURS, ranks)))
    inverse, lost = np.linalg.inv(system.h).T, 0.0
    for body in np.unique(system.molecule):
        mine = system.molecule == body
        mass, r = system.mass[mine], before.x[mine] - before.x[mine][0]
        r -= np.rint(r @ inverse) @ system.h.T
        old, new = before.v[mine], after.v[mine]
        np.testing.assert_allclose(mass @ new, mass @ old, rtol=0, atol=1e-13)
        np.testing.assert_allclose(
            mass @ np.cross(r, new), mass @ np.cross(r, old), rtol=0, atol=1e-13
        )
        # rigid: no pair of atoms comes nearer or goes away
        for i, j in itertools.combinations(range(len(mass)), 2):
            assert abs((r[i] - r[j]) @ (new[i] - new[j])) < 1e-13
        lost += 0.5 * mass @ (old**2 - new**2).sum(axis=1)
    kinetic = 0.5 * system.mass @ (before.v**2).sum(axis=1)
    logged = re.search(r"start velocities: (\S+) of the kinetic energy (\S+)", after.log)
    np.testing.assert_allclose([float(logged[1]), float(logged[2])], [lost, kinetic], rtol=1e-6)
    assert lost > 0.1 * kinetic


def wide(flags):
    """A bent rod over 0.7 of a periodic box, across its face, among pairs of atoms; the rod with
    its image flags or with 0 0 0."""
    h, k, rng = 10.0 * np.eye(3), np.arange(12), np.random.default_rng(3)
    rod = np.stack([6.0 + 7.0 / 11 * k, 1.4 + 0.1 * np.cos(k), 1.4 + 0.1 * np.sin(k)]).T
    bodies = [("rod", rod, np.ones(12, int))]
    for site in itertools.product(range(4), range(4), range(4)):
        if site[1:] not in ((0, 0), (0, 1), (1, 0), (1, 1)):
            bodies.append(turned("pair", 2.5 * np.array(site), bodies, h, rng))
    system = assemble(bodies, h)
    if not flags:
        system.files["data.bodies"] = re.sub(
            r"(?m)^(\d+ 1 \d \S+ \S+ \S+) \S+ \S+ \S+$", r"\1 0 0 0", system.files["data.bodies"]
        )
    return system


@pytest.mark.parametrize("ranks", [1, 4])
def test_body_wider_than_half_the_box(simulate, ranks):
    """Locks out the nearest image where the image flags are right
    and the body is too wide for it."""
    system = wide(True)
    theirs, ours = (
        simulate(system, fix, 50, ranks=n, dt=0.05) for fix, n in ((RIGID, 1), (OURS, ranks))
    )
    # tiny steps, in which LAMMPS's splitting of the pairs' rotation makes no difference
    assert apart(ours, theirs, system.h) < 1e-7


@pytest.mark.parametrize("ranks", [1, 2])
def test_wide_body_with_wrong_flags(simulate, ranks):
    """Locks out silence where a body's image flags may not fit and it is too wide to guess, and
    another shape than fix rigid/nve has by the same flags."""
    system = wide(False)
    theirs, ours = (
        simulate(system, fix, 20, ranks=n, dt=0.05) for fix, n in ((RIGID, 1), (OURS, ranks))
    )
    assert apart(ours, theirs, system.h) < 1e-7
    logged = [line for line in ours.log.splitlines() if line.startswith("WARNING")]
    assert len(logged) == 1 and logged[0].startswith(
        "WARNING: the body of molecule 1 (its first atom is 1) may be cut by a periodic face"
    ), logged
    assert "WARNING" not in simulate(wide(True), OURS, 50, dt=0.05).log


WALL = """units lj
atom_style molecular
atom_modify map array
lattice sc 1.0
region box block 0 {0} 0 {1} 0 20 units lattice
create_box 2 box
region layer block 0 {0} 0 {1} 0 0.5
create_atoms 1 region layer
region gas block 0 {0} 0 {1} 1.5 5.5
create_atoms 2 region gas
mass * 1.0
group bodies type 1
group single type 2
velocity all create 2.0 4928
pair_style lj/cut 2.5
pair_coeff * * 1.0 1.0
neigh_modify every 1 delay 0 check yes exclude group bodies bodies"""


@pytest.mark.parametrize("rows, ranks", [(2, 2), (3, 1), (4, 2), (8, 1), (9, 2)])
def test_periodic_wall(simulate, rows, ranks):
    """Locks out the refusal, and any doubt of, a wall that spans the periodic box, whose image
    flags are all 0, and a shape other than fix rigid/nve's."""
    system = System(
        WALL.format(rows, rows + 1), {}, np.diag([rows, rows + 1, 20.0]), 0.002, singles=True
    )
    theirs = simulate(system, RIGID, 50, words="single")
    ours = simulate(
        system, LIKE_LAMMPS + "\nfix 2 single nve", 50, words="single", group="bodies", ranks=ranks
    )
    assert apart(ours, theirs, system.h) < 1e-9
    assert "may be cut by" not in ours.log and "1 rigid bodies" in ours.log
    assert "it meets its own images" in ours.log  # for this one may turn


@pytest.mark.parametrize("ranks", [1, 4])
def test_body_of_scattered_molecules(simulate, ranks):
    """Locks out the refusal of a body whose parts lie anywhere in the periodic box, with image
    flags that are all 0 (LAMMPS's unit tests of fix rigid have such ones)."""
    system = mixture("solid planar", flags=False)
    how = dict(
        words="group 2 some more", before="group some molecule 2 9 14\ngroup more molecule 5 21"
    )
    how["before"] += (
        "\ngroup rest subtract all some more\nfix 3 rest nve\ngroup bodies clear\n"
        "group bodies union some more"
    )
    theirs = simulate(system, RIGID, 20, dt=0.2, **how)
    ours = simulate(system, LIKE_LAMMPS, 20, dt=0.2, group="bodies", ranks=ranks, **how)
    assert apart(ours, theirs, system.h) < 1e-9
    assert (
        "2 rigid bodies" in ours.log
        and "WARNING: the body of group more (its first atom is 21) may be cut" in ours.log
    )


# ---- what LAMMPS reports


KINDS = "solid planar pair row single"


@pytest.mark.quick("3-1")
@pytest.mark.parametrize("ranks", [1, 4])
@pytest.mark.parametrize("dimension", [2, 3])
def test_temperature_of_a_mixture(simulate, dimension, ranks):
    """Locks out wrong degrees of freedom of one kind of body, of bodies on several ranks, in a
    group of atoms, or of bodies of which a group has a part; at every printed step, 0 included."""
    kinds = KINDS if dimension == 3 else KINDS.replace("solid ", "")
    system = mixture(kinds, side=3 if dimension == 3 else 5, dimension=dimension)
    names = [*kinds.split(), "part"]
    before = "group part type 1 3\n" + "\n".join(f"compute {name} {name} temp" for name in names)
    before += "\nfix 9 all enforce2d" * (dimension == 2)
    how = dict(before=before, columns=" ".join(f"c_{name}" for name in names), every=2, dt=1e-4)
    theirs, ours = (
        simulate(system, RIGID, 10, **how),
        simulate(system, OURS, 10, ranks=ranks, **how),
    )
    for name in ["Temp", *(f"c_{name}" for name in names)]:
        assert (theirs.thermo[name] > 0).all() or name == "c_part"
        np.testing.assert_allclose(ours.thermo[name], theirs.thermo[name], rtol=1e-10, err_msg=name)


@pytest.mark.parametrize("kinds", ["solid", "planar", "pair", "row"])
def test_pressure_in_the_limit_of_small_steps(simulate, kinds):
    """Locks out a wrong term of the constraint virial for one kind of body: the six components
    differ from rigid/nve/small's in proportion to dt (LAMMPS averages two half steps)."""
    system = mixture(kinds)
    size = []
    for n in 80, 160:
        ours, theirs = (
            tensor(simulate(system, fix, n, dt=40 / n, every=n))[-1] for fix in (OURS, SMALL)
        )
        size.append(np.linalg.norm(ours - theirs) / np.linalg.norm(ours))
    print("relative difference:", size)
    assert size[0] / size[1] == pytest.approx(2.0, rel=0.15)
    assert size[1] < 0.02


@pytest.mark.quick("3-1")
@pytest.mark.parametrize("ranks", [1, 4])
@pytest.mark.parametrize("dimension", [2, 3])
def test_pressure_at_step_0(simulate, dimension, ranks):
    """Locks out the impulse that makes random start velocities rigid, or forces not yet gathered,
    in the first pressure: it equals that of a vanishing step later, by this fix and by
    rigid/nve/small."""
    kinds = KINDS if dimension == 3 else KINDS.replace("solid ", "")
    system = mixture(kinds, side=3 if dimension == 3 else 5, dimension=dimension)
    before = "fix 9 all enforce2d" * (dimension == 2)
    ours, theirs = (
        simulate(system, fix, 4, dt=1e-6, every=1, before=before, ranks=n)
        for fix, n in ((OURS, ranks), (SMALL, 1))
    )
    scale = np.abs(tensor(ours)).max()
    np.testing.assert_allclose(
        tensor(ours)[1:], tensor(ours)[:1].repeat(4, axis=0), rtol=0, atol=1e-6 * scale
    )
    np.testing.assert_allclose(tensor(ours)[2:], tensor(theirs)[2:], rtol=0, atol=1e-5 * scale)


STEP_0 = """
velocity all create 295 4928 loop geom
{fix}
compute atomic all pressure NULL pair kspace
thermo_style custom step temp press c_atomic vol
thermo_modify format float %.17g
timestep {dt}
dump 1 all custom 1 forces id mol mass xu yu zu vx vy vz fx fy fz
dump_modify 1 sort id format float %.17g
run 0
"""


@pytest.mark.parametrize("ranks", [1, 4])
def test_pressure_of_made_velocities_is_the_molecular_one(run_lammps, tmp_path, ranks):
    """Locks out a virial that misses the force of PPPM within molecules, and a step 0 with the
    impulse that makes the velocities of `velocity create` rigid, as LAMMPS's rigid fixes print it:
    the pressure is that of the molecules' centres, by hand from the
    forces on the atoms, and does not depend on the time step.

    P V = (sum of M V^2 + atomic virial - sum of f (r - R)) / 3, where M, R and V are of a molecule.
    """
    system, mvv2p = water(), UNITS["real"].mvv2e * 68568.415
    for dt in 1.0, 0.01:
        script = STEP_0.format(fix=OURS.format(group="bodies", words="molecule"), dt=dt)
        thermo = run_lammps(f"{system.setup}\n{script}", files=system.files, ranks=ranks).thermo[0]
        _, molecule, mass, *columns = np.loadtxt(tmp_path / "forces", skiprows=9).T
        x, v, f = np.array(columns).reshape(3, 3, -1)
        molecule = molecule.astype(int) - 1
        of_body = np.bincount(molecule, mass)
        total = np.array([[np.bincount(molecule, mass * c) for c in of] for of in (x, v)])
        centre, velocity = total / of_body
        kinetic = mvv2p * (of_body * velocity**2).sum() / (3 * thermo["Volume"])
        inside = 68568.415 * (f * (x - centre[:, molecule])).sum() / (3 * thermo["Volume"])
        terms = np.array([kinetic, thermo["c_atomic"], -inside])
        assert abs(thermo["Press"] - terms.sum()) < 1e-12 * np.abs(terms).max(), dt


@pytest.mark.quick("0.3-2")
@pytest.mark.parametrize("tilt, ranks", [(0.0, 1), (0.3, 2)])
def test_pressure_does_not_depend_on_place(simulate, tilt, ranks):
    """Locks out a virial with absolute positions in it,
    or of an atom in the wrong periodic image."""
    system, rng = mixture(tilt=tilt, flags=False), np.random.default_rng(2)
    offsets = [(0.3, 0, 0), *(system.h @ rng.uniform(-1.5, 1.5, 3) for _ in range(5))]
    after = "\n".join(
        "displace_atoms all move {:.15g} {:.15g} {:.15g} units box\nrun 0".format(*d)
        for d in offsets
    )
    table = tensor(simulate(system, OURS, 0, after=after, ranks=ranks))
    assert len(table) == 7
    np.testing.assert_allclose(
        table, table[:1].repeat(7, axis=0), rtol=0, atol=1e-9 * np.abs(table).max()
    )


# ---- migration


@pytest.mark.quick("(1, 2, 1)")
@pytest.mark.parametrize("grid", [(8, 1, 1), (2, 2, 1), (1, 2, 1)], ids=str)
def test_migration(simulate, grid):
    """Locks out state that does not follow atoms, copies of a body that come apart, and a limit on
    how many ranks share a body: a hot system that re-neighbours at every step moves as on one
    rank."""
    system = hot_rods()
    cut = "processors {} {} {}\nread_data".format(*grid)
    split = system._replace(setup=system.setup.replace("read_data", cut))
    how = dict(before="neigh_modify every 1 delay 0 check no", every=50)
    start, alone = simulate(system, OURS, 0, **how), simulate(system, OURS, 150, **how)
    many = simulate(split, OURS, 150, ranks=int(np.prod(grid)), **how)
    cells = [np.floor(run.x / np.diag(system.h) * grid) for run in (start, many)]
    assert (cells[0] != cells[1]).any(axis=1).sum() > 5, "hardly an atom has changed its rank"
    assert apart(many, alone, system.h) < 1e-8
    np.testing.assert_allclose(system.mass @ many.v, 0, atol=1e-10)
    np.testing.assert_allclose(many.thermo["TotEng"], alone.thermo["TotEng"], rtol=1e-9)


@pytest.mark.parametrize("molecule", [1, 125])
def test_forces_that_are_not_finite(refused, molecule):
    """Locks out bad forces on the first body or the last that go unseen."""
    system = mixture(side=5, spacing=2.9)
    push = f"group one molecule {molecule}\nvariable push equal exp(1000.0*(step>9))\n"
    push += "fix push one addforce v_push 0 0\n"
    fix = OURS.format(group="all", words="molecule")
    says = f"the force on the body of molecule {molecule} is not finite at step 10"
    refused(f"{system.setup}\n{fix}\n{push}run 20\n", says, system.files)
