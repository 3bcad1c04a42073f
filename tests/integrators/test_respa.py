"""run_style respa: the kicks of each level, the drift on the innermost,
against Verlet and conservation laws.

LAMMPS's rigid/nve is no reference here: its first half kick of the innermost level takes the force
that the outer level has just stored, so that its trajectory does not converge to that of small
steps.
"""

import numpy as np
import pytest

from support.body_table import read_table, vector
from support.systems import OURS, TWO, apart, assert_same, close, mixture, smooth, tensor, water

THREE = "run_style respa 3 2 2 inner 1 1.2 1.5 middle 2 1.8 2.2 outer 3"


def chains():
    """Rigid bodies among flexible chains of three atoms; the input,
    and the chains' fix and group."""
    system = smooth("solid planar row pair")
    rows = [f"create_bonds single/bond 1 {a} {a + 1} special no" for a in atoms_of_rows(system)]
    more = "read_data data.bodies extra/bond/types 1 extra/bond/per/atom 2 extra/special/per/atom 4"
    bonds = [
        "bond_style harmonic",
        "bond_coeff 1 300 0.7",
        *rows,
        "group rigid subtract all row",
        "fix 3 row nve",
    ]
    return system._replace(
        setup="\n".join([system.setup.replace("read_data data.bodies", more), *bonds])
    )


def atoms_of_rows(system):
    """The IDs of the first two atoms of each row."""
    molecule = int(
        next(line for line in system.setup.splitlines() if line.startswith("group row")).split()[3]
    )
    first = np.flatnonzero(system.molecule == molecule)[0] + 1
    count = (
        len(
            next(line for line in system.setup.splitlines() if line.startswith("group row")).split()
        )
        - 3
    )
    return [first + 3 * k + j for k in range(count) for j in (0, 1)]


@pytest.mark.quick("one level")
@pytest.mark.parametrize(
    "style, ranks",
    [
        ("run_style respa 1", 1),
        (THREE.replace("3 2 2", "3 1 1"), 1),
        (THREE.replace("3 2 2", "3 1 1"), 4),
    ],
    ids=["one level", "factors 1", "factors 1 on 4 ranks"],
)
def test_equal_steps_are_verlet(simulate, style, ranks):
    """Locks out a level's force that is kicked with twice, or with another level's step, or not at
    all: where all levels have the same step, their sum is velocity Verlet."""
    system = smooth()
    verlet = simulate(system, OURS, 40)
    ours = simulate(system, OURS, 40, before=style, ranks=ranks)
    assert_same(ours, verlet, system.h)
    for name in "Temp", "PotEng", "TotEng":
        np.testing.assert_allclose(ours.thermo[name], verlet.thermo[name], rtol=1e-9)
    np.testing.assert_allclose(
        tensor(ours), tensor(verlet), rtol=0, atol=1e-8 * np.abs(tensor(verlet)).max()
    )


@pytest.mark.parametrize("style", [TWO, THREE], ids=["two levels", "three levels"])
def test_second_order(simulate, style):
    """Locks out a splitting that converges to another trajectory than Verlet's small steps, or with
    the first power of the outer step only, and an energy that is not conserved to second order."""
    system = smooth()
    exact = simulate(system, OURS, 400, dt=0.2, every=400)
    runs = [simulate(system, OURS, n, dt=80 / n, before=style, every=1) for n in (10, 20, 40)]
    error = [apart(run, exact, system.h) for run in runs]
    energy = [run.thermo["TotEng"].std() for run in runs]
    assert error[0] / error[2] == pytest.approx(16, rel=0.3) and error[2] < 1e-5
    assert energy[0] / energy[2] == pytest.approx(16, rel=0.3)
    coarse = simulate(system, OURS, 20, dt=4, every=1)
    assert error[1] < 0.5 * apart(coarse, exact, system.h)


def test_among_flexible_chains(simulate):
    """Locks out bodies and fix nve's atoms that are at different times within a step: with stiff
    bonds on the inner level, the whole converges as dt^2 to the trajectory of small steps of
    Verlet."""
    system = chains()
    exact = simulate(system, OURS, 800, group="rigid", dt=40 / 800, every=800)
    runs = [
        simulate(
            system,
            OURS,
            n,
            group="rigid",
            dt=40 / n,
            every=1,
            ranks=ranks,
            before="run_style respa 3 4 2 bond 1 inner 2 1.3 1.8 outer 3",
        )
        for n, ranks in ((10, 1), (20, 2), (40, 1))
    ]
    error = [apart(run, exact, system.h) for run in runs]
    energy = [run.thermo["TotEng"].std() for run in runs]
    assert error[0] / error[2] == pytest.approx(16, rel=0.3) and error[2] < 1e-4
    assert energy[0] / energy[2] == pytest.approx(16, rel=0.4)


LIFT = "fix lift type1 addforce 1.0 0.5 -0.7\nfix_modify lift respa 1 virial yes"


@pytest.mark.parametrize(
    "fixes, ranks", [("", 2), (LIFT, 1)], ids=["pairs only", "with fix addforce"]
)
def test_pressure(simulate, fixes, ranks):
    """Locks out a constraint virial of one level's forces only, at step 0 or later: in the limit of
    small steps pressure and energy are Verlet's. (Not at step 0 after a fix that has a level of its
    own: it leaves that level's force behind when a run is set up, and LAMMPS has no call that adds
    the levels up again.)"""
    system = smooth()
    fixes = "group type1 type 1\n" + fixes if fixes else ""
    how = dict(dt=1e-4, every=1)
    verlet = simulate(system, OURS, 3, before=fixes.replace("respa 1 ", ""), **how)
    ours = simulate(system, OURS, 3, before=f"{TWO}\n{fixes}", ranks=ranks, **how)
    first = 1 if fixes else 0
    np.testing.assert_allclose(
        tensor(ours)[first:],
        tensor(verlet)[first:],
        rtol=0,
        atol=1e-6 * np.abs(tensor(verlet)).max(),
    )
    np.testing.assert_allclose(ours.thermo["Temp"], verlet.thermo["Temp"], rtol=1e-9)


def test_fix_on_inner_level(simulate):
    """Locks out the force of a fix on one level that acts on another, or on none:
    with equal steps it is Verlet."""
    system = smooth()
    fixes = (
        "group type1 type 1\n" + LIFT + "\nfix hold type1 spring/self 5.0\nfix_modify hold respa 2"
    )
    verlet = simulate(
        system,
        OURS,
        20,
        before=fixes.replace("respa 1 ", "").replace("\nfix_modify hold respa 2", ""),
    )
    ours = simulate(system, OURS, 20, before=f"{TWO.replace('2 4', '2 1', 1)}\n{fixes}")
    assert_same(ours, verlet, system.h)
    exact = simulate(
        system,
        OURS,
        400,
        dt=0.2,
        every=400,
        before=fixes.replace("respa 1 ", "").replace("\nfix_modify hold respa 2", ""),
    )
    error = [
        apart(simulate(system, OURS, n, dt=80 / n, before=f"{TWO}\n{fixes}"), exact, system.h)
        for n in (10, 40)
    ]
    assert error[0] / error[1] == pytest.approx(16, rel=0.3) and error[1] < 1e-5


def test_values_read_on_an_inner_level(simulate):
    """Locks out values of the bodies that something has read on an inner level, and that are told
    again in that level's next step: a force that depends on them is that of Verlet with the inner
    step, where no other level has a force."""
    system, free = smooth(), "pair_style zero 2.5\npair_coeff * *\n"
    push = f"{OURS}\nfix push all addforce v_push 0 0\n"
    before = f"{free}variable push equal 0.5*f_1[1]\n"
    inner = f"{before}run_style respa 2 4 pair 2\n"
    verlet = simulate(system, push, 40, before=before)
    ours = simulate(system, f"{push}fix_modify push respa 1", 10, dt=4, before=inner)
    assert_same(ours, verlet, system.h)
    assert apart(verlet, simulate(system, OURS, 40, before=free), system.h) > 0.01


@pytest.mark.parametrize("ranks", [1, 2])
def test_friction_on_the_outer_level(simulate, ranks):
    """Locks out velocities of the middle of an inner step where a fix reads them on the outer
    level: bodies of one atom go as with fix nve."""
    system = mixture("single", side=4, spacing=1.3)._replace(singles=False)
    friction = "\nfix drag all viscous 2.0\nfix_modify drag respa 2"
    theirs = simulate(system, f"fix 1 all nve{friction}", 20, dt=4, before=TWO)
    ours = simulate(system, f"{OURS}{friction}", 20, dt=4, before=TWO, ranks=ranks)
    assert_same(ours, theirs, system.h)


@pytest.mark.parametrize("steps", [7, 9])
def test_output(simulate, tmp_path, steps):
    """Locks out a table of bodies with one level's force, at the end of a run or in a step at which
    LAMMPS itself does not look: the forces in it are the atoms' total."""
    system = smooth()
    simulate(system, OURS, steps, words="molecule output 7 table", before=TWO, ranks=2)
    table = read_table(tmp_path / "table")
    assert set(table["step"]) == {0, 7} and len(table) == 2 * system.molecule.max()
    dump = "write_dump all custom forces id mol fx fy fz modify sort id format float %.16g"
    simulate(system, OURS, 7, before=TWO, after=f"{dump} # of {steps}", ranks=2)
    f = np.loadtxt(tmp_path / "forces", skiprows=9)
    totals = [np.bincount(f[:, 1].astype(int), column)[1:] for column in f[:, 2:].T]
    close(vector(table[table["step"] == 7], "fx", "fy", "fz"), np.transpose(totals), 1e-9)


def test_velocities_changed_at_the_last_step(simulate):
    """Locks out a change of velocities by a fix at the end of the last step that the bodies undo:
    where all levels have the same step, it ends as with Verlet."""
    system = smooth()
    still = f"{OURS}\nfix still all momentum 10 linear 1 1 1"
    drift = "velocity all set 0.5 0.2 -0.3 sum yes"
    verlet = simulate(system, still, 10, before=drift)
    ours = simulate(system, still, 10, before=f"{drift}\nrun_style respa 2 1 pair 1")
    assert_same(ours, verlet, system.h)
    assert np.abs(system.mass @ ours.v).max() < 1e-9


def test_water(simulate):
    """Locks out a force of PPPM on the outermost level that bodies do not get: the trajectory
    converges as dt^2 to that of small steps of Verlet."""
    system = water()
    exact = simulate(system, OURS, 32, dt=0.25, every=32)
    style = "run_style respa 2 2 inner 1 4.0 5.0 outer 2 kspace 2"
    error = [
        apart(simulate(system, OURS, n, dt=8 / n, before=style), exact, system.h) for n in (2, 4)
    ]
    assert error[0] / error[1] == pytest.approx(4, rel=0.2) and error[1] < 3e-3


def test_time_step_that_changes(simulate):
    """Locks out levels that keep the time step of the start of the run where fix dt/reset changes
    it: bodies go as far as with Verlet, and energy stays."""
    system = smooth()
    reset = "fix 2 all dt/reset 1 NULL 0.01 0.002"
    verlet = simulate(system, OURS, 40, before=reset)
    ours = simulate(system, OURS, 40, before=f"{reset}\nrun_style respa 2 1 pair 1")
    assert_same(ours, verlet, system.h)


@pytest.mark.parametrize("style", [TWO, THREE], ids=["two levels", "three levels"])
def test_time_reversal(simulate, style):
    """Locks out levels that are kicked in an order that is not symmetric: with all velocities
    turned round, the bodies go back to where they came from."""
    system = smooth()
    start = simulate(system, OURS, 0)
    back = "\n".join(
        [*(f"variable u{c} atom -v{c}" for c in "xyz"), "velocity all set v_ux v_uy v_uz", "run 40"]
    )
    end = simulate(system, OURS, 40, dt=4, before=style, after=back)
    assert apart(simulate(system, OURS, 40, dt=4, before=style), start, system.h) > 0.1
    assert apart(end, start, system.h) < 1e-9
    np.testing.assert_allclose(end.v, -start.v, rtol=0, atol=1e-9)
