"""Other fixes on the atoms of the bodies: those that add forces,
those that change velocities, those that only look.

Each test runs several systems in one process, one after the other with `clear` between them.
"""

import re

import numpy as np
import pytest

from support.builds import NUMBER
from support.endings import assert_ended
from support.running import read_thermo
from support.scripts import spce
from support.systems import LIKE_LAMMPS, OURS, RIGID, Result, charged, differ, mixture, water

TOOK = "The velocities of the bodies' atoms were changed at the end of step"
COLUMNS = (
    "thermo_style custom step temp press pe etotal {}\nthermo_modify format float %.16g norm no\n"
    "thermo {}\ntimestep {}"
)


@pytest.fixture
def run_all(run_lammps, tmp_path):
    """A function that runs the same atoms with different input, all in one process,
    and gives a Result of each."""

    def run(system, scripts, **how):
        """Args: scripts is a dictionary from a name to what follows the system's setup."""
        parts = [
            f'clear\nprint "PART {k}"\n{system.setup}\n{text}\n'
            f"write_dump all custom end.{k} id x y z vx vy vz modify sort id format float %.16g\n"
            for k, (name, text) in enumerate(scripts.items())
        ]
        run = run_lammps("\n".join(parts), files=system.files, **how)
        logs = re.split(r"^PART .*\n", run.log, flags=re.M)[1:]
        assert len(logs) == len(scripts)
        results = {}
        for k, (name, log) in enumerate(zip(scripts, logs)):
            atoms = np.loadtxt(tmp_path / f"end.{k}", skiprows=9)
            results[name] = Result(atoms[:, 1:4], atoms[:, 4:], read_thermo(log), log)
        return results

    return run


def lines(system, fix, *more, columns="", every=20, group="bodies", words="molecule"):
    """Input with a rigid fix, in place of RIGID, and what follows it."""
    table, first = (
        COLUMNS.format(columns, every, f"{system.dt:.17g}"),
        next(k for k, line in enumerate(more) if line.startswith("run")),
    )
    return "\n".join([*more[:first], table, *more[first:]]).replace(
        "RIGID", fix.format(group=group, words=words)
    )


# ---- forces

FORCES = {
    "langevin": "fix 5 bodies langevin 1.5 1.5 0.5 4928",
    "langevin zero": "fix 5 bodies langevin 1.5 1.5 0.5 4928 zero yes tally yes",
    "spring tether": "fix 5 one spring tether 5.0 1.0 2.0 NULL 0.5",
    "spring self": "fix 5 one spring/self 5.0",
    "efield": "set type 1 charge 0.5\nset type 2 charge -0.7\nfix 5 bodies efield 1.0 -0.5 0.3",
    "addforce": "fix 5 one addforce 1.0 v_f -0.5 every 2",
    "setforce": "fix 5 one setforce 0.0 NULL 0.3",
    "viscous": "fix 5 bodies viscous 0.8",
    "gravity": "fix 5 bodies gravity 2.0 vector 1 -1 0.5",
    "aveforce": "fix 5 bodies aveforce 0.2 NULL 0.0",
}
# both start from rigid velocities, which LAMMPS's fixes see only after their first setup
START = (
    "thermo_style custom step temp press pe etotal\ngroup one molecule 2 3 4\n"
    "variable f equal 2.0*cos(step/5)\nfix 0 bodies rigid/nve molecule\nrun 0\nunfix 0"
)


def test_forces(run_all):
    """Locks out the force of another fix that the bodies do not get, or get at another time than
    with rigid/nve behind that fix. And one that they get from the second half step on, because its
    fix stands behind this one, as with rigid/nve."""
    system = charged(mixture("solid planar"))
    # two runs: each begins with a set-up
    runs = "run 10", "run 10"
    scripts = {("none", "", None): lines(system, RIGID, START, "RIGID", *runs)}
    for name, force in FORCES.items():
        for place, both in (("before", (force, "RIGID")), ("after", ("RIGID", force))):
            for fix in (RIGID, LIKE_LAMMPS)[place == "after" :]:
                scripts[name, place, fix] = lines(system, fix, START, *both, *runs)
    results = run_all(system, scripts)
    free, off, idle = results["none", "", None], {}, []
    for name in FORCES:
        theirs = results[name, "before", RIGID]
        for place in "before", "after":
            off[name, place] = differ(results[name, place, LIKE_LAMMPS], theirs, system.h)
        idle += [name] if differ(free, theirs, system.h) < 1e-6 else []
    assert not idle
    assert max(off.values()) < 1e-9, off


# ---- fixes that constrain atoms

FLEXIBLE = (
    "group wet molecule <= 500\ngroup flexible subtract all wet\nset group flexible bond 2\n"
    "set group flexible angle 2"
)


def half_rigid():
    """inputs/water, where the bonds and angles of the second half
    of the molecules have types of their own."""
    system = water()
    setup = system.setup.replace("data.water", "data.water extra/bond/types 1 extra/angle/types 1")
    forcefield = system.files["forcefield.water"] + "bond_coeff 2 0.9572\nangle_coeff 2 104.52\n"
    return system._replace(
        setup=f"{setup}\n{FLEXIBLE}", files=system.files | {"forcefield.water": forcefield}
    )


@pytest.mark.parametrize(
    "style, words, first, ranks",
    [
        ("shake", "molecule", "theirs", 2),
        ("rattle", "molecule", "ours", 1),
        ("shake", "group 1 bodies", "theirs", 1),
        *([("ilves", "molecule", "theirs", 2)] if NUMBER >= 20260704 else []),
        *([("ilves", "group 1 bodies", "ours", 1)] if NUMBER >= 20260704 else []),
    ],
)
def test_constraints_on_bodies_are_refused(run_lammps, tmp_path, style, words, first, ranks):
    """Locks out a fix that constrains the bodies' atoms beside ours,
    with a temperature and a pressure that are wrong."""
    theirs, ours = (
        f"fix hold bodies {style} 1e-4 25 0 b 1 a 1",
        OURS.format(group="bodies", words=words),
    )
    system = water()
    fixes = f"{theirs}\n{ours}" if first == "theirs" else f"{ours}\n{theirs}"
    run = run_lammps(
        f"{system.setup}\n{fixes}\nrun 1", files=system.files, ranks=ranks, check=False
    )
    says = f"fix hold (style {style}) constrains", f'fix 1 ("nosquish/nve {words}")'
    assert_ended(run, (*says, "unfix it", "without the bodies' atoms"), tmp_path)


def constrained(run_all, system, hold, steps, ranks=1):
    """Runs in which a fix that constrains bonds has all atoms, or only those in no body: the
    results by its group."""
    ours = OURS.format(group="wet", words="molecule")
    scripts = {
        group: (
            f"fix hold {group} {hold} b 2 a 2\nfix 2 flexible nve\n{ours}\n"
            f"{COLUMNS.format('', 5, 1.0)}\nrun {steps}"
        )
        for group in ("all", "flexible")
    }
    return run_all(system, scripts, ranks=ranks)


def test_constraints_beside_bodies(run_all):
    """Locks out the refusal of a fix that may constrain all atoms,
    and constrains none of the bodies'."""
    system = half_rigid()
    both = constrained(run_all, system, "shake 1e-4 100 0", 5)
    assert differ(both["all"], both["flexible"], system.h) == 0


if NUMBER >= 20260704:

    @pytest.mark.parametrize("ranks", [1, 4])
    def test_ilves_beside_bodies(run_all, ranks):
        """Locks out the refusal of fix ilves on a group with bodies whose bonds it leaves alone,
        another trajectory beside them, and bonds that it does not hold there."""
        system = half_rigid()
        both = constrained(run_all, system, "ilves 1e-10 25 0", 20, ranks)
        assert differ(both["all"], both["flexible"], system.h) == 0
        flexible = both["all"].x[1500:].reshape(-1, 3, 3)
        bonds = flexible[:, 1:] - flexible[:, :1]
        bonds -= np.round(bonds / np.diag(system.h)) * np.diag(system.h)
        np.testing.assert_allclose(np.linalg.norm(bonds, axis=2), 0.9572, rtol=1e-6)

    def test_baoab_on_bodies(refused):
        """Locks out fix baoab, which integrates atoms, on those of the bodies."""
        system = water()
        fixes = (
            f"fix 2 bodies baoab 300 300 100 4928\n{OURS.format(group='bodies', words='molecule')}"
        )
        says = "is also integrated by fix 2 (style baoab): give that fix a group without"
        refused(f"{system.setup}\n{fixes}\nrun 1", says, system.files)


# ---- commands that make velocities

CREATE = """
velocity all create 2.0 99 loop geom
print "MADE $(ke(all))"
run 20
velocity all create 2.0 99 loop geom
print "MADE $(ke(all))"
run 10
velocity all create 2.0 98 loop geom temp thermo_temp
print "MADE $(ke(all))"
run 0
velocity some create 2.0 98 loop geom
print "MADE $(ke(some))"
run 2 every 1 "velocity all create 2.0 99 loop geom" "print 'MADE $(ke(all))'"
run 0
velocity all scale 3.0
run 0
"""


@pytest.mark.parametrize("ranks", [1, 4])
def test_velocity_create(run_all, ranks):
    """Locks out degrees of freedom that are taken from random velocities before they are rigid
    motion, and then again: velocities as without bodies, before a first run as with rigid/nve,
    where it makes none either; and velocity scale that has lost them."""
    system = mixture("solid planar")
    text = "group some molecule 1 2 3 5"
    first = [text, "RIGID", "velocity all create 2.0 99 loop geom", "run 20"]
    theirs, ours = (lines(system, fix, *first) for fix in (RIGID, LIKE_LAMMPS))
    results = run_all(
        system,
        {
            "theirs": theirs,
            "ours": ours,
            "more": lines(system, OURS, text, "RIGID", *CREATE.splitlines()),
        },
        ranks=ranks,
    )
    assert differ(results["ours"], results["theirs"], system.h) < 1e-9

    log = results["more"].log
    atoms, some = len(system.mass), np.isin(system.molecule, [1, 2, 3, 5]).sum()
    made = [float(number) for number in re.findall(r"^MADE (\S+)", log, re.M)]
    np.testing.assert_allclose(
        made, 3.0 * (np.array([atoms, atoms, atoms, some, atoms, atoms]) - 1), rtol=1e-10
    )

    starts = [float(line.split()[1]) for line in re.findall(r"^ *Step .*\n(.*)", log, re.M)]
    said = [float(now) for now in re.findall(r"removed; temperature (\S+) of the bodies", log)]
    assert len(starts) == 7 and len(said) == 6, (
        "a line for each start whose velocities were not rigid motion"
    )
    np.testing.assert_allclose(said, starts[:-1], rtol=1e-7)
    assert all(0.7 < now / 2.0 < 1.3 for now in said), "random to a few percent of 2.0"
    assert starts[-1] == pytest.approx(3.0, rel=1e-10)


def test_temperature_behind_shake(run_lammps, tmp_path):
    """Locks out a temperature of the atoms before, counted as if nothing had held them: 94 K of
    heating where fix shake had left rigid water, but for its tolerance."""
    text = spce(tmp_path, lines="thermo_style custom step temp").read_text()
    text += "unfix hold\nunfix move\nfix 1 all nosquish/nve molecule\nrun 0\n"
    run_lammps(text)
    log = (tmp_path / "water.log").read_text()
    (line,) = re.findall(r"  start velocities: (.*)", log)
    held = read_thermo(log)["Temp"][-2]
    told = [float(t) for t in re.findall(r"temperature (\S+)", line)]
    np.testing.assert_allclose(told, held, rtol=0.02)


@pytest.mark.parametrize("ranks", [1, 2])
def test_velocity_scale(run_all, ranks):
    """Locks out velocities that are scaled by the bodies' degrees of freedom while they have those
    of all atoms, or almost those of rigid bodies, or both: the bodies have the temperature that was
    asked for when the run has made their motion rigid."""
    system = mixture("solid planar", side=5)
    asked = (
        ("velocity all create 1.0 99 loop geom", "all", 3.0),
        ("", "all", 2.0),
        ("displace_atoms all random 0.001 0.001 0.001 77", "all", 3.0),
        ("velocity some create 1.0 98 loop geom", "all", 1.5),
        ("velocity some create 1.0 97 loop geom", "some", 3.0),
        ("displace_atoms all random 0.001 0.001 0.001 78", "rest", 2.0),
    )
    text = ["group some molecule 1:60", "group rest subtract all some", "RIGID"]
    for before, group, kelvin in asked:
        text += [before, f"velocity {group} scale {kelvin}", "run 0", f'print "HAS $(ke({group}))"']
    log = run_all(system, {"one": lines(system, OURS, *text)}, ranks=ranks)["one"].log
    bodies = len(np.unique(system.molecule))
    bodies = {"all": bodies, "some": 60, "rest": bodies - 60}
    expected = [0.5 * kelvin * (6 * bodies[group] - 3) for _, group, kelvin in asked]
    actual = [float(number) for number in re.findall(r"^HAS (\S+)", log, re.M)]
    # a whole number of degrees of freedom is removed from the atoms'
    np.testing.assert_allclose(actual, expected, rtol=0.6 / (6 * 60 - 3))
    np.testing.assert_allclose(actual[1], expected[1], rtol=1e-10)  # rigid motion already


# ---- fixes that change velocities at the end of a step

DRIFTING = "velocity all set 0.5 0.3 -0.2 sum yes"


@pytest.mark.parametrize("ranks", [1, 2])
def test_velocities_in_local_rows(run_lammps, ranks):
    """Locks out rows of compute rigid/local with the velocities from before a fix has changed them
    in this step, where f_ID[i][j] has those from after it."""
    system = mixture("solid planar")
    fix = OURS.format(group="all", words="molecule")
    script = f"""{system.setup}
{DRIFTING}
{fix}
fix 2 all momentum 10 linear 1 1 1
compute rows all rigid/local/nosquish 1 vx
compute local all reduce sum c_rows inputs local
variable array equal sum(f_1[4])
thermo_style custom step c_local v_array
thermo_modify norm no format float %.16g
thermo 10
run 20
"""
    table = run_lammps(script, files=system.files, ranks=ranks).thermo
    assert abs(table["c_local"][0]) > 1.0 and np.ptp(table["c_local"]) > 1.0
    np.testing.assert_allclose(table["c_local"], table["v_array"], rtol=0, atol=1e-9)


@pytest.mark.quick("1")
@pytest.mark.parametrize("ranks", [1, 4])
def test_velocities_changed_by_fixes(run_all, ranks):
    """Locks out bodies that go on as before when a fix has changed their atoms' velocities
    (LAMMPS's rigid fixes do): it must be as with rigid/nve and the command velocity at the same
    step, between two runs."""
    system = mixture("solid planar")
    cases = {
        "linear": ("momentum 10 linear 1 1 1", "velocity all zero linear"),
        "one direction": (
            "momentum 10 linear 0 1 0",
            "variable w atom vy-vcm(all,y)\nvelocity all set NULL v_w NULL",
        ),
        "angular": ("momentum 10 angular", "velocity all zero angular"),
        "rescale": ("temp/rescale 10 3.0 3.0 0.0 1.0", "velocity all scale 3.0 temp thermo_temp"),
    }
    scripts = {("", "none"): lines(system, RIGID, DRIFTING, "RIGID", "run 15")}
    for name, (fix, command) in cases.items():
        scripts[name, "ours"] = lines(
            system, LIKE_LAMMPS, DRIFTING, "RIGID", f"fix 5 all {fix}", "run 15"
        )
        scripts[name, "theirs"] = lines(
            system, RIGID, DRIFTING, "RIGID", "run 10", command, "run 5"
        )
        scripts[name, "ignored"] = lines(
            system, RIGID, DRIFTING, "RIGID", f"fix 5 all {fix}", "run 15"
        )
    if ranks > 1:
        scripts = {
            (name, who): text for (name, who), text in scripts.items() if who in ("ours", "theirs")
        }
    results = run_all(system, scripts, ranks=ranks)
    for name in cases:
        ours, theirs = (results[name, who] for who in ("ours", "theirs"))
        assert differ(ours, theirs, system.h) < 1e-9, name
        if ranks == 1:
            ignored, none = results[name, "ignored"], results["", "none"]
            assert differ(ignored, theirs, system.h) > 1e-4, name
            assert differ(ignored, none, system.h) == 0, (
                f"rigid/nve no longer ignores {name}: say so in docs/from-rigid.md"
            )


@pytest.mark.parametrize("ranks", [1, 2])
def test_thermostats_at_the_end_of_a_step(run_all, ranks):
    """Locks out thermostats that do not act on bodies, as on LAMMPS's rigid fixes, and a
    temperature of the bodies (f_1) that is not that of their atoms; and the refusal of factors that
    change a part of a body's motion."""
    system = mixture()
    plane = "compute xy all temp/partial 1 1 0\nfix_modify 5 temp xy"
    thermostats = {
        "rescale": "temp/rescale 1 3.0 3.0 0.0 1.0",
        "berendsen": f"temp/berendsen 3.0 3.0 {5 * system.dt}",
        "partial": f"temp/berendsen 3.0 3.0 {5 * system.dt}\n{plane}",
        "csvr": f"temp/csvr 3.0 3.0 {5 * system.dt} 4928",
    }
    scripts = {
        name: lines(
            system, OURS, "RIGID", f"fix 5 all {fix}", "run 60", columns="f_1", every=4, group="all"
        )
        for name, fix in thermostats.items()
    }
    scripts["none"] = lines(system, OURS, "RIGID", "run 60", columns="f_1", every=4, group="all")
    results = run_all(system, scripts, ranks=ranks)
    off = []
    for name, result in results.items():
        temp = result.thermo["Temp"]
        late = temp[5:].mean()
        assert (
            (late < 1.5)
            if name == "none"
            else abs(late - 3.0)
            < {"rescale": 1e-6, "berendsen": 0.1, "partial": 0.8, "csvr": 0.5}[name]
        ), name
        # the bodies' own temperature does not count the motion of the centre of mass out
        ratio = result.thermo["f_1"] / temp
        near = 1e-2 if name == "partial" else 1e-9  # the atoms' is of no rigid motion there
        off += [name] if np.abs(ratio / ratio[0] - 1).max() > near else []
    assert not off, f"f_1 is of another time than temp with {off}"


@pytest.mark.parametrize("how", ["run 10\nrun 10", "run 10\nrun 10 pre no"])
@pytest.mark.parametrize("words", ["molecule", "molecule reinit no"])
def test_change_at_the_last_step(run_all, how, words):
    """Locks out a change of the last step of a run that is lost before the next:
    two runs are one run."""
    system = mixture("solid planar")
    more = [DRIFTING, "RIGID", "fix 5 all momentum 10 linear 1 1 1"]
    results = run_all(
        system, {run: lines(system, OURS, *more, run, words=words) for run in ("run 20", how)}
    )
    assert differ(results[how], results["run 20"], system.h) < 1e-9


# ---- those that look in the middle of a step


def test_temperature_read_in_mid_step(run_all):
    """Locks out half a kick that is lost where a variable reads f_ID between the two halves of a
    step, and a line in the log on velocities that nothing has changed (the thermostat's window is
    never left)."""
    system = mixture("solid planar pair row single")
    move = (
        "variable px equal 0.0*{}\nvariable pv equal 0.0\n"
        "fix 3 single move variable v_px v_px v_px v_pv v_pv v_pv\n"
        "fix p all temp/rescale 1 1 1 1000 1"
    )
    fix = OURS.format(group="bodies", words="molecule")
    with_f, without = run_all(
        system,
        {
            name: f"{fix}\n{move.format(what)}\n{COLUMNS.format('', 50, system.dt)}\nrun 100"
            for name, what in (("f_1", "f_1"), ("number", "1.0"))
        },
    ).values()
    assert TOOK not in with_f.log
    np.testing.assert_allclose(with_f.thermo["TotEng"], without.thermo["TotEng"], rtol=1e-12)


@pytest.mark.parametrize("style", ["", "run_style respa 2 4 inner 1 1.3 1.8 outer 2"])
def test_values_at_the_end_of_a_step_that_was_looked_into(run_all, style):
    """Locks out values of the bodies that something has read in the middle of the step, or before
    the first forces, and that are told again at its end."""
    system = mixture("solid planar pair row single")
    fix, columns = (
        OURS.format(group="bodies", words="molecule"),
        "f_1 f_1[1] f_1[1][4] f_1[1][7] f_1[2][10]",
    )
    reader = (
        "fix 7 all ave/time 1 1 1 v_m\nfix 8 single addforce v_m 0 0\n{}\n"
        "fix 2 single addforce v_m 0 0"
    )
    read, plain = run_all(
        system,
        {
            name: (
                f"variable m equal {m}\n{reader.format(fix)}\n{style}\n"
                f"{COLUMNS.format(columns, 3, system.dt)}\nrun 6"
            )
            for name, m in (("read", "0.0*f_1+0.0*f_1[1][7]"), ("plain", "0.0"))
        },
    ).values()
    for name in columns.split():
        np.testing.assert_allclose(
            read.thermo[name], plain.thermo[name], rtol=1e-12, atol=1e-13, err_msg=name
        )


def test_values_read_before_a_step_begins(simulate):
    """Locks out values of the last step that are printed for this one, because a fix that comes
    before ours has read them when the step's number was this one's already."""
    system = mixture("solid planar pair row")
    reader = (
        "variable d equal 0.0*f_1\nvariable z equal 0.0\ngroup nothing empty\n"
        "fix 7 nothing move variable v_d v_z v_z v_z v_z v_z"
    )
    columns = "f_1 f_1[1] f_1[2] f_1[1][1]"
    read, plain = (
        simulate(system, OURS, 8, every=1, before=before, columns=columns)
        for before in (reader, "")
    )
    for name in columns.split():
        np.testing.assert_array_equal(read.thermo[name], plain.thermo[name], err_msg=name)


# ---- those that read velocities, in whatever way

PULL = "fix_modify 1 external force {} 0 0"
READERS = {
    "equal-style variable": PULL.format("v_v"),
    "compute in a vector": "compute ch bodies chunk/atom molecule compress yes\n"
    f"compute cm bodies vcm/chunk ch\nvariable w vector c_cm[1]\n{PULL.format('v_w')}",
    "average": "fix a all ave/time 1 1 1 v_v\nvariable w equal f_a\n" + PULL.format("v_w"),
    "another fix of ours": "unfix 1\nfix 3 one nosquish/nve molecule\n"
    f"group rest subtract bodies one\nfix 1 rest nosquish/nve molecule\n{PULL.format('v_v')}",
    "dynamic group": "variable on atom sin(1e3*v_v)>0\nunfix 2\n"
    "group moving dynamic single var on\nfix 2 moving nve",
    "moving region": "region r block -2 2 INF INF INF INF move v_v NULL NULL units box\n"
    "fix 3 bodies addforce 1 0 0 region r",
    "addforce": "fix 3 bodies addforce v_v 0 0",
    "move": "variable z equal 0\nunfix 2\nfix 2 single move variable v_v v_z v_z v_z v_z v_z",
    "deform": "fix 3 all deform 1 x variable v_v v_v remap x",
    "scaled pair style": "pair_style hybrid/scaled v_v lj/cut 1.5\npair_coeff * * lj/cut 1 1",
}


@pytest.mark.parametrize("ranks, words", [(1, ""), (2, "temp 1 1 1 seed 3")])
@pytest.mark.parametrize("reader", READERS)
def test_trajectory_does_not_depend_on_thermo(run_all, reader, ranks, words):
    """Locks out velocities that are those of the last output, for whatever reads them within a
    step: the trajectory then depends on how often there is output."""
    system = mixture("solid planar pair row single")
    fix = f"fix 1 bodies nosquish/{'nvt' if words else 'nve'} molecule {words}"
    start = f"group one molecule 1\nvariable v equal 0.3*vcm(one,x)\n{fix}\nfix 2 single nve\n"
    often, rarely = run_all(
        system,
        {
            every: f"{start}{READERS[reader]}\nthermo {every}\ntimestep {system.dt}\nrun 30"
            for every in (1, 100)
        },
        ranks=ranks,
    ).values()
    assert (often.x == rarely.x).all() and (often.v == rarely.v).all()


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("change", ["diameter", "none"])
def test_masses_that_change(run_lammps, change, ranks):
    """Locks out bodies that keep their masses while fix adapt changes those of their atoms, without
    a word, and a refusal where it changes none."""
    what = "atom diameter v_d mass yes" if change == "diameter" else "atom charge v_d"
    script = f"""units lj
atom_style hybrid sphere 1 molecular charge
region b block 0 10 0 10 0 10
create_box 1 b
mass 1 1
molecule d pair.mol
create_atoms 0 random 30 1 NULL mol d 5
set group all diameter 0.8 density 1.0
pair_style zero 1.12
pair_coeff * *
comm_modify cutoff 4
variable d equal 0.8+step*0.004
timestep 0.002
fix 1 all nosquish/nve molecule
fix a all adapt 20 {what}
compute t all temp/sphere
thermo_modify temp t
run 60
"""
    pair = "a pair\n\n2 atoms\n\nCoords\n\n1 0 0 0\n2 1 0 0\n\nTypes\n\n1 1\n2 1\n"
    run = run_lammps(script, files={"pair.mol": pair}, ranks=ranks, check=change == "none")
    assert ("bodies keep their masses in a run" in run.screen) is (change == "diameter")


OF_FIX_SET = [  # which older LAMMPS do not have
    ("set 6 0 group all x v_x", r"atom \d+ is 0.1 away from where its .* fix s \(style set\)"),
    ("set 6 0 group all type v_t", "bodies keep their masses"),
    ("set 30 0 group all type v_t", "bodies keep their masses"),
    ("set 6 0 group all vx v_x", ""),
] * (NUMBER >= 20250722)


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    "fix, said",
    [("atom/swap 6 40 4 2.0 types 1 2 ke no", "bodies keep their masses"), *OF_FIX_SET],
)
def test_atoms_that_a_fix_sets(run_system, fix, said, ranks):
    """Locks out atoms that a fix moves in a run and that are put back without a word, and bodies
    that keep their masses while atoms get those of other types, also where two atoms exchange
    theirs or the run is over: temperatures and energies would be those of other masses."""
    system = mixture("solid planar pair row")
    done = run_system(
        system,
        f"variable x atom x+0.1\nvariable t atom 4-type\ntimestep {system.dt}\n"
        f"fix 1 all nosquish/nve molecule\nfix s all {fix}\nrun 30",
        ranks=ranks,
        check=not said,
    )
    assert bool(said) == ("ERROR" in done.screen) and re.search(said, done.screen)
