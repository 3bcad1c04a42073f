"""What `compare` measures of a scene and of a user's script, and what it says of it."""

import json
import math
import re
import shlex
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fix_nosquish.integrators.nvt import THERMOSTATS
from support import (
    scripts,
)
from support.comparison import row
from support.harness import GAS, Silent, replaced, take, with_lines, written
from support.running import read_thermo
from validation import RESULTS
from validation.__main__ import main, parser
from validation.check import measure as check
from validation.compare import case as cases
from validation.compare import choice, errors, lists, measure, plan, report
from validation.experiment import Point
from validation.running import lammps_log, rounds, run
from validation.scenes.integrators import Integrator
from validation.statistics import measures, structure
from validation.statistics.estimate import Estimate
from validation.user_script import conserved_energy, shapes, thermostat, time_step


def series(own, x, v, frames, thermo=(), dt=1.0):
    """Positions and velocities of a script's atoms as a run leaves them."""
    cells, periodic = np.array([own.reading["cell"]] * len(v)), np.array([True] * 3)
    mass, body = own.atoms["mass"], own.rigid.body
    positions = run.Positions(x, body, cells, periodic, v=v, mass=mass)
    return errors.Series(dict(thermo), structure.Motion(positions), frames, dt), positions


def test_temperatures_of_bodies_are_those_they_were_given(tmp_path):
    """Locks out degrees of freedom that are counted wrongly: bodies with velocities drawn for a
    temperature have it, in translation and in rotation; also where faces cut bodies and the box
    has another size in the end (the rotation of 20 of 180 had one degree of freedom too many)."""
    own = take(scripts.co2(tmp_path), tmp_path / "out")
    random, kelvin, frames = np.random.default_rng(1), 250.0, 400
    groups, _ = shapes.body_groups(own)
    ((_, group, r, moments, axes),) = groups
    scale = own.reading["boltzmann"] * kelvin / shapes.mvv2e(own)
    mass = own.atoms["mass"]
    centre = random.normal(size=(frames, len(group), 3)) * np.sqrt(scale / mass[group[0]].sum())
    spin = random.normal(size=(frames, len(group), 3)) * np.sqrt(
        np.where(moments > 1e-6 * moments[:, :1], scale / np.maximum(moments, 1e-12), 0.0)
    )
    omega = np.einsum("bik,fbk->fbi", axes, spin)
    v = np.zeros((frames, len(mass), 3))
    v[:, group] = centre[:, :, None] + np.cross(omega[:, :, None], r)
    edges = np.diag(np.array(own.reading["cell"]))
    x = np.broadcast_to(np.mod(own.atoms["x"] - 2.9, edges), v.shape)
    result, positions = series(own, x, v, range(frames))
    assert np.ptp(x[0][group], axis=1).max() > edges.max() / 2  # a face cuts it
    assert result.motion.turning(3) == 2 * own.bodies  # of linear ones
    positions.cells[-1] *= 1.02
    assert structure.Motion(positions).turning(3) == 2 * own.bodies
    moving, turning = errors.temperatures(cases.of_script(own), result)
    assert moving.mean() == pytest.approx(kelvin, rel=0.01)
    assert turning.mean() == pytest.approx(kelvin, rel=0.01)


def test_numbers_are_of_what_counts_of_a_run(tmp_path):
    """Locks out the energy of the atoms in the place of the one that is to be kept, and frames from
    before the part that counts."""
    own = take(scripts.co2(tmp_path), tmp_path / "out")
    case, random, frames, first = cases.of_script(own), np.random.default_rng(1), 40, 10
    v = np.tile(random.normal(size=(len(own.atoms["mass"]), 3)), (1 + frames, 1, 1))
    v[: 1 + first] *= 3.0
    x = np.broadcast_to(own.atoms["x"], v.shape)
    thermo = dict.fromkeys(("PotEng", "KinEng", "Temp", "TotEng", "Density"), np.ones(1 + frames))
    thermo |= {"Step": np.arange(1.0 + frames), "Econserve": np.arange(1.0 + frames)}
    (made, positions) = series(own, x, v, [frames])
    result = SimpleNamespace(positions=positions, thermo=thermo)
    actual = errors.numbers(case, 1.0, result, first / frames)
    rest = np.arange(first, 1.0 + frames)
    assert actual.estimates["energy_sd"].value == pytest.approx(np.std(rest, ddof=1))
    (moving,), (turning,) = errors.temperatures(case, made)
    assert actual.kinds[0].value == pytest.approx((moving - turning) / case.temperature, rel=1e-9)
    assert len(actual.rdf) > 10


def test_what_a_failure_is():
    """Locks out a run without numbers that counts as one, an explosion that LAMMPS survives, and a
    small system's temperature that merely fluctuates."""

    def why(energy, kelvin, kinetic=1e5, error=None):
        thermo = {"Step": np.arange(3.0), "Temp": np.array(kelvin), "TotEng": np.array(energy)}
        thermo["KinEng"] = np.full(3, kinetic)
        return errors.failure(SimpleNamespace(error=error, thermo=thermo), 300.0, 0.002)

    assert why([1.0, 1.0, 1.0], [300.0, 310.0, 590.0]) is None
    assert "heats" in why([1.0, 1.0, 1.0], [300.0, 310.0, 650.0])
    assert (
        why([1.0, 1.0, 1.0], [300.0, 310.0, 650.0], kinetic=3.0) is None
    )  # ten degrees of freedom
    assert why([1.0, np.nan, 1.0], [300.0] * 3) and why([1.0] * 3, [300.0, np.nan, 300.0])
    assert why([1.0] * 3, [300.0] * 3, error="ERROR: Lost atoms") == "ERROR: Lost atoms"


def of(own, wanted):
    """The targets of a script."""
    return cases.targets(cases.of_script(own), wanted)


def test_targets_are_those_that_a_script_has(tmp_path):
    """Locks out a target that says nothing of a script, one that is not known, and a barostat
    whose work counts as unknown: econserve has it, with each of ours."""
    lines = "compute t all temp/sphere\nthermo_modify temp t"
    spheres = take(scripts.spheres(tmp_path, lines), tmp_path / "out1")
    assert set(of(spheres, {})) == {"drift", "energy", "rdf"}
    assert any("their own moments of inertia" in one for one in spheres.notes)
    assert set(of(spheres, {"rdf": math.inf})) == {"drift", "energy"}  # --target rdf=none
    with pytest.raises(LookupError, match="no target is left"):
        of(spheres, dict.fromkeys(("drift", "energy", "rdf"), math.inf))
    co2 = take(scripts.co2(tmp_path), tmp_path / "out")
    assert set(of(co2, {})) == {"drift", "energy", "temperature", "density", "rdf"}
    assert of(co2, {"drift": 1.0})["drift"] == 1.0
    with pytest.raises(LookupError, match="there is no target speed"):
        of(co2, {"speed": 1.0})
    spce = take(scripts.spce(tmp_path), tmp_path / "out2")
    results = of(spce, {"energy": 0.1})
    assert results["energy"] == 0.1 and results["drift"] == pytest.approx(10.0)  # TDAMP 100
    assert "density" not in results
    path = scripts.rings(tmp_path)
    rings = take(path, tmp_path / "out3")
    assert "energy" not in of(rings, {})  # fix langevin stays
    with pytest.raises(LookupError, match=r"drift says nothing of .*in\.rings"):
        of(rings, {"drift": 1.0})
    text = path.read_text().replace("timestep 4", "unfix heat\ntimestep 4")
    path.write_text(text)
    assert "energy" in of(take(path, tmp_path / "out3"), {})
    press = "unfix heat\nfix press all press/berendsen iso 1 1 1000\ntimestep 4"
    path.write_text(text.replace("unfix heat\ntimestep 4", press))
    assert "energy" not in of(take(path, tmp_path / "out3"), {})  # as this one does


def test_energies_that_other_fixes_give_and_nobody_counts(tmp_path):
    """Locks out a drift that is the work of a wall, whose energy LAMMPS counts only if it is asked
    to; and one that is asked for and then left out."""
    path = scripts.clusters(tmp_path)
    own = take(path, tmp_path / "out")
    assert conserved_energy.acting_fixes(own) == ["wall"] and not conserved_energy.uncounted_fixes(
        own
    )
    assert {"drift", "energy"} <= set(of(own, {}))
    own = take(replaced(path, "fix_modify wall energy yes\n", ""), tmp_path / "out")
    assert conserved_energy.uncounted_fixes(own) == ["wall"]
    assert set(of(own, {})) == {"temperature"}
    with pytest.raises(LookupError, match="what fix wall does to the energy is not counted"):
        of(own, {"drift": 1.0})
    for commands, asked in (
        (["fix a all indent", "fix_modify a energy yes"], {"a"}),
        (["fix_modify a energy yes", "fix a all indent"], set()),
        (["fix_modify a virial yes energy yes", "fix_modify a energy no"], set()),
    ):
        assert conserved_energy._with_energy(commands) == asked


def energies(own, kept, every):
    """What is made of a series of the energy, with samples so many steps apart."""
    thermo = {"Step": every * np.arange(len(kept)), "Econserve": kept, "TotEng": kept}
    kinetic = 2.0 * np.resize([1.0, -1.0], len(kept))
    thermo |= {"KinEng": kinetic, "Temp": np.ones(len(kept)), "PotEng": kept, "Density": kept}
    made = errors.Series(thermo, SimpleNamespace(count=1), [], own.scene.dt)
    known = ("energy", "energy_sd")
    every = errors.observables(cases.of_script(own))
    return {one.key: one.of(made) for one in every if one.key in known}


@pytest.mark.parametrize("kind", ["clusters", "spce"])
def test_the_energys_change_is_what_is_said_of_it(kind, taken):
    """Locks out a number that depends on how often the energy is looked at, which errors of some
    steps vanish from, or on the length of the run, which the wander at a cutoff grows with."""
    own = taken(kind)
    step = own.scene.dt
    span = cases.SPAN * step
    random = np.random.default_rng(2)
    walk = np.cumsum(random.normal(size=400_000)) / np.sqrt(cases.SPAN)  # a variance of 1 in it
    angle = np.cumsum(0.2 * random.normal(size=len(walk)))  # forgotten in about 50 steps
    energy = walk + np.sqrt(2) * np.sin(angle) + random.normal(size=len(walk))
    for stride in (1, 12, 48, 96):
        for part in (1, 10):
            result = energies(own, energy[: len(energy) // part : stride], stride)["energy"]
            forgotten = 1 - np.exp(-0.02 * cases.SPAN)
            right = np.sqrt(0.5 + forgotten + 1) / 2.0
            assert abs(result.value - right) < 2 * result.margin < 0.3
    about = cases.about(cases.of_script(own))
    assert f"kept in {span:g} {own.units.time}, rms" in about["energy"]["what"]
    heated = kind == "spce"
    usual = 10.0 if heated else 0.01  # the page says it, too
    assert about["drift"]["default"] == pytest.approx(usual)


@pytest.mark.parametrize("unit", (1e-10, 1e-8, 1e-4, 1.0))
def test_g_is_the_same_in_each_unit_of_length(unit):
    """Locks out a g(r) of zeros, and an error of it that is zero, in units si and cgs, where a
    volume in single precision is none."""
    x = np.random.default_rng(1).uniform(0, 20, (40, 60, 3))
    cells = np.array([20 * np.eye(3)] * len(x))
    result = structure.of_sites(x * unit, cells * unit, (2.0 * unit, 9.5 * unit), 0.5 * unit)
    r = np.abs(x[:, :, None] - x[:, None])
    r = np.linalg.norm(np.minimum(r, 20 - r), axis=3)[:, np.triu(np.ones((60, 60), bool), 1)]
    edges = 2.0 + 0.5 * np.arange(16)
    ideal = r.size * 4 / 3 * np.pi * np.diff(edges**3) / 20**3
    np.testing.assert_allclose(result, np.histogram(r, edges)[0] / ideal, rtol=0.01)


WATER = "fix 1 all python/move 'fix_nosquish.NVT water molecule temp 298 298 100 seed 9'"


RIGID_COMPUTE = """fix 1 all rigid/nvt/small molecule temp 298 298 100
compute k all ke/rigid 1
variable twice equal 2*c_k
fix out all ave/time 1 1 1 v_twice"""
PRINTED = {  # of scripts whose integrators are printed, a function of ``scripts`` and words
    "two fixes": ("spce", {}, {}),
    "in quotes": ("spce", {"fix": f"group water type 1 2\n{WATER}\nfix_modify 1 virial yes"}, {}),
    "no rigid fix": (
        "spce",
        {"fix": "group water type 1 2\nfix move all nve"},
        {"group": "water", "bodies": "molecule"},
    ),
    "others beside bodies": ("solute", {}, {}),
    "points of ours": ("staged", {}, {}),
    "pressure": ("co2", {}, {}),
    "computes of rigid fixes": ("spce", {"fix": RIGID_COMPUTE}, {}),
}


@pytest.mark.parametrize("which", PRINTED)
def test_what_is_printed_runs_as_it_is(which, tmp_path, run_lammps, capsys):
    """Locks out lines that LAMMPS refuses in the place where they are said to stand, or that begin
    with another system than the one that was tried; and a place that is not said."""
    kind, how, ask = PRINTED[which]
    path = getattr(scripts, kind)(tmp_path, **how)
    own = take(path, tmp_path / "out", **ask)
    first = next(one for one in own.integrators.values() if one.kind in ("ours", "rigid"))
    (start,), _ = check._starts(
        replace(own, integrators={"": first}), tmp_path / "out", 1, 300.0, Silent()
    )
    text = path.read_text().replace("log water.log", "")
    columns = "thermo_style custom step time temp pe\nthermo_modify norm no\nrun 3"
    case = cases.of_script(own)
    for one in own.integrators.values():
        best = row(own.scene.dt / 2, one.name, drift=(0.1, 0.01 if one is first else 1.0))
        best |= dict(zip(("lines", "place", "lost"), case.written(one)))
        _, lines = told(summary_of({"drift": 1.0}, best))
        assert any("to try it:" in line for line in lines) == (one is not first)
        made = with_lines(text, "\n".join(lines))
        done = run_lammps(re.sub(r"^run [1-9]\d*$(?!(.|\n)*^run )", columns, made, flags=re.M))
        rows = read_thermo(done.log[done.log.rindex("   Step") :])
        assert rows["Step"][-1] - rows["Step"][0] == 3
        assert rows["Time"][-1] - rows["Time"][0] == pytest.approx(1.5 * own.scene.dt)
        assert rows["PotEng"][0] == pytest.approx(start["potential"], rel=1e-6)


@pytest.mark.parametrize(("kind", "able"), [("co2", True), ("rings", True), ("spce", False)])
def test_the_suffix_is_named_where_it_can_be_used(taken, kind, able):
    """Locks out two ways to the same thermostat, of which only one is told; and the suffix for a
    script without a rigid fix, or beside another fix's line."""
    case = cases.of_script(taken(kind))
    for one in case.integrators.values():
        _, _, notices = case.written(one)
        assert ("lmp -sf nosquish" in " ".join(notices)) is (able and one.kind == "ours"), one.name


def test_integrators_whose_energy_says_nothing(taken):
    """Locks out a drift of rigid/nvt that is LAMMPS's bookkeeping, and one of ours that is left
    out."""
    yours = Integrator("yours", "yours", ("fix 1 {group} rigid/small molecule langevin 1 1 1 5",))
    assert conserved_energy.misses_own_error(yours)
    case = cases.of_script(taken("spce"))
    assert case.unknown == dict.fromkeys(("rigid/nvt", "rigid/nvt/small"), cases.ENERGIES)


# ---- what is said


def summary_of(targets, *rows, **more):
    """A comparison's summary."""
    about = {name: {"unit": "", "what": name, "why": "", "default": most}
             for name, most in targets.items()}  # fmt: skip
    summary = {"targets": targets, "points": list(rows), "units": "real", "about": about}
    summary |= {"ns": "ns", "ranks": 1, "minutes": 5.0, "level": 0.95, "time": 100.0, "dt": 2.0}
    summary |= {"title": "a scene", "notes": [], "why": "nobody counts it", "unknown": {}}
    summary |= {"machine": {"cpu": "a processor", "cores": 2}, "versions": {"lammps": "2025"}}
    return summary | {"command": "nosquish compare water", "date": "2026"} | more


def told(summary):
    """The answer, and further sentences."""
    result = report.describe(summary)
    return result.answer, list(result.lines)


def test_the_answer_is_the_choice_with_its_lines():
    """Locks out an answer without the step, its cost, how sure it is, the lines for the script, or
    what there is beside it; and the reference's row that is advised though nobody asked for it."""
    held = row(1.0, drift=(0.1, 0.01)) | {"is_reference": True}
    good, bad = row(4.0, cost=[1.5, 1.25, 2.0], drift=(0.1, 0.01)), row(6.0, drift=(9.0, 0.1))
    summary = summary_of({"drift": 1.0}, held | {"asked": False}, good, bad)
    answer, lines = told(summary)
    assert answer.startswith(
        "nosquish with a step of 4 fs: 1.5 s of CPU time per ns, on 1 rank. Within"
    )
    assert "With 6 fs: too much of drift: 9.00 ± 0.20." in lines
    assert lines[-2:] == ["    fix 1 all nosquish molecule", "    timestep 4"]
    assert report.answered(summary)["advised"]["dt"] == 4.0
    answer, lines = told(summary_of({"drift": 1.0}, good))
    assert any("longest step that was tried" in line for line in lines)
    assert told(summary_of({"drift": 1.0}, held))[0].startswith("nosquish with a step of 1 fs")
    nothing = summary_of({"drift": 1.0}, held | {"asked": False})
    assert told(nothing) == ("No run is complete yet.", [])
    other = row(6.0, "other", cost=[1.0], drift=(0.9, 0.3))
    _, lines = told(summary_of({"drift": 1.0}, good, other))
    assert "As fast or faster, if they are within the targets: other, 6 fs." in lines


def test_an_answer_without_g_as_advised():
    """Locks out --target rdf=none, advised where few runs are complete, that changes nothing."""
    targets, one = {"drift": 1.0, "rdf": 0.1}, row(4.0, drift=(0.1, 0.01))
    answer, lines = told(summary_of(targets, one))
    assert answer.startswith("Not sure")
    (words,) = re.findall(r"--target \w+=\w+", " ".join(lines))
    asked = parser().parse_args(["compare", "my.in", *words.split()]).target
    left = {name: most for name, most in (targets | dict(asked)).items() if most < math.inf}
    assert told(summary_of(left, one))[0].startswith("nosquish with a step of 4 fs")


@pytest.mark.quick
def test_thermostats_are_those_of_the_package():
    """Locks out a thermostat that was added to the package, and that `compare` cannot describe."""
    assert thermostat.NAMES.keys() == thermostat.EFFECTS.keys() == THERMOSTATS.keys()


def test_the_answer_keeps_the_scripts_thermostat(tmp_path):
    """Locks out Langevin's friction in the answer to a script with chains and compute msd, a
    silence on what it does to dynamics, and a faster one for averages that nobody is told of."""
    fix = "fix 1 all rigid/nvt/small molecule temp 298 298 100\ncompute m all msd com yes"
    case = cases.of_script(take(scripts.spce(tmp_path, fix=fix), tmp_path / "out"))
    kinds = {key: thermostat.kind_of(one.lines) for key, one in case.integrators.items()}
    assert {*case.usual} == {"nosquish-nh", "rigid/nvt/small"} and case.reference == "nosquish-nh"
    assert (kinds["nosquish"], kinds["nosquish-csvr"]) == ("langevin", "csvr")
    assert kinds["rigid/small+langevin"] == "langevin" and kinds["shake"] == "nh"
    assert case.thermostat == {"kind": "nh", "damp": "100 fs", "dynamics": ["compute m msd"]}
    for line, kind in (
        ("fix 1 all nve", None),
        ("fix 1 all rigid/small molecule langevin 1 1 1 5", "langevin"),
        ("fix 1 all rigid/npt/small/nosquish molecule temp 1 1 1 iso 1 1 1", "nh"),
        ("fix 1 all nosquish/npt molecule temp 1 1 1 iso 1 1 1 seed 1 thermostat csvr", "csvr"),
        ("fix 1 all nosquish/nvt molecule temp 1 1 1 seed 1", "langevin"),
    ):
        assert thermostat.kind_of([line]) == kind, line
    own = row(2.0, "rigid/nvt/small", cost=[4.0], drift=(0.1, 0.01)) | {"thermostat": "nh"}
    ours = row(4.0, cost=[2.0], drift=(0.1, 0.01)) | {"thermostat": "nh"}
    other = row(6.0, "langevin", cost=[1.0], drift=(0.1, 0.01)) | {"thermostat": "langevin"}
    usual = {"integrator": "rigid/nvt/small", "dt": 2.0}
    more = {"thermostat": case.thermostat, "usual": usual}
    answer, lines = told(summary_of({"drift": 1.0}, own, ours, other, **more))
    assert "nosquish with a step of 4 fs" in answer
    assert "2 times as fast as your rigid/nvt/small at 2 fs (4 s)" in answer
    (kept,) = [line for line in lines if line.startswith("Your script reads dynamics (compute m")]
    assert "Nosé–Hoover chains with a damping time of 100 fs" in kept
    place = next(n for n, line in enumerate(lines) if line.startswith("For averages only"))
    assert "langevin, 6 fs, 2 times as fast" in lines[place] and "slows diffusion" in lines[place]
    assert lines[place + 1 :] == ["    fix 1 all langevin molecule", "    timestep 6"]
    assert any("--only all" in line for line in told(summary_of({"drift": 1.0}, ours, **more))[1])
    _, lines = told(summary_of({"drift": 1.0}, other, **more))
    assert any(line.startswith("Your thermostat was not compared") for line in lines)


def test_one_rule_and_one_number():
    """Locks out a cost in the answer that is another one than the table's, a row that is met where
    the answer says that none is, a shorter step that is open although the named one is longer, and
    silence about a busy machine."""
    rows = [row(dt, cost=[5 / dt, 4 / dt, 8 / dt], drift=(0.1, 0.6)) for dt in (1.0, 2.0, 3.0)]
    rows[2]["errors"]["drift"] = Estimate(0.1, 0.1).plain()  # by itself it would be met
    result = report.describe(summary_of({"drift": 1.0}, *rows))
    verdicts = [one["verdict"] for one in result.tables[1].rows]
    assert result.answer.startswith("Not sure") and verdicts == ["cannot tell"] * 3
    rows[2] |= {"alone": True, "share": 40.0}
    result = report.describe(summary_of({"drift": 1.0}, *rows))
    assert [one["verdict"] for one in result.tables[1].rows] == ["met"] * 3
    shown = result.tables[1].columns[2].cell(result.tables[1].rows[2], short=True).text
    assert result.tables[1].columns[2].heading == "CPU time (s/ns)"
    assert f"3 fs: {shown} s of CPU time per ns" in result.answer and shown == "1.67"
    assert any(
        "The machine was busy: a rank had as little as 40 %" in line for line in result.lines
    )
    assert any(choice.RULE in line for line in result.lines)


def test_where_nothing_is_good_for_sure_it_is_said_what_tells():
    """Locks out an answer that says nothing, without lines to try, or with lines that are bad; a
    budget that would not tell, and one of years, from runs of a few samples; and an error of no
    step that is taken for one."""

    def minutes(value, error, freedom=None):
        one = row(4.0, drift=(value, error, freedom))
        summary = summary_of({"drift": 0.02}, one)
        return report.answered(summary)["minutes_that_tell"], told(summary)[0]

    # 2 ((1.96 + 0.84) * 0.1 / 0.02)^(2/3) times 5; then noise is half of the square
    for (value, error), least in ((0.0, 0.1), 58), ((0.014, 0.01), 20), ((0.11, 0.1), 150):
        result, answer = minutes(value, error)
        assert result == least and f"About --budget {least} (minutes) would decide" in answer
    result, answer = minutes(0.0, 10.0, 1)
    assert result is None and "100 times this --budget would not decide" in answer
    assert "Larger targets may (--target)" in answer
    larger = summary_of({"drift": 1e5}, row(4.0, drift=(0.0, 10.0, 1)))
    assert told(larger)[0].startswith("nosquish with a step of 4 fs")
    # the nearest of all, but one that saves time if the script has a line of its own
    rows = row(2.0, cost=[4.0], drift=(0.9, 0.3)), row(4.0, cost=[2.0], drift=(0.9, 0.7))
    own = {"integrator": "nosquish", "dt": 2.0}
    for dt, usual in (2, None), (4, own):
        _, lines = told(summary_of({"drift": 1.0}, *rows, usual=usual))
        place = next(i for i, line in enumerate(lines) if line.endswith("timestep, to try it:"))
        assert lines[place + 1 :] == ["    fix 1 all nosquish molecule", f"    timestep {dt}"]
    # of a step whose error is hardly known nothing is said
    unknown = row(2.0, cost=[4.0], drift=(0.9, 2.0)), row(4.0, cost=[2.0], drift=(0.9, 3.0))
    _, lines = told(summary_of({"drift": 1.0}, *unknown, usual=own))
    assert not any("timestep" in line or "nearest" in line for line in lines)
    bad = row(1.0, drift=(1.5, 0.1)) | {"is_reference": True}
    answer, lines = told(summary_of({"drift": 1.0}, bad, row(2.0, drift=(0.9, 0.3))))
    assert answer.startswith("No step that was tried is within the targets")
    assert lines[0].startswith("Even with 1 fs there is too much of drift")
    assert lines[1].startswith("The nearest: nosquish, 2 fs")
    assert not any("timestep" in line for line in lines)
    rows = [row(dt) | {"failed": "1: ERROR: no"} for dt in (1.0, 2.0)]
    answer = told(summary_of({"drift": 1.0}, *rows))[0]
    assert answer == "All runs failed, also with the shortest step: 1: ERROR: no"


# ---- from end to end


def steady(patch, step=2e-4):
    """Let a step take so many s, whatever the machine does."""
    patch.setattr(rounds, "calibrate", lambda make: run.run(make([3, 40])) and step)
    patch.setattr(plan, "STARTUP", 0.0)
    patch.setattr(plan, "TIMED", (0.0, 1.0))


@pytest.fixture(scope="module")
def rings(tmp_path_factory):
    """Rings at constant energy, with steps that are safe and one that is far too long: the words,
    the output folder, and what the verb came to."""
    folder = tmp_path_factory.mktemp("rings")
    path = replaced(scripts.rings(folder), "fix heat all langevin 300 300 200 11\n", "")
    words = ["compare", str(path), "--budget", "0.05", "--steps", "2,3,4,60", "--only", "nosquish"]
    words += ["--target", "energy=0.2", "drift=1e5", "temperature=9", "rdf=99"]
    words += ["--out", str(folder / "out")]

    def command():
        with pytest.MonkeyPatch.context() as patch:
            steady(patch, 3e-4)
            patch.setattr(lists, "LATEST", math.inf)  # that they have their turn, too
            return main(words)

    return command, folder / "out", command()


def cpu_per_ns(logs, dt):
    """Median CPU time, s per ns, of the runs in LAMMPS's logs, each log without its first run."""
    pattern = r"Loop time of (\S+) on 1 procs for (\d+) steps(?s:.*?)([\d.]+)% CPU use"
    runs = [found for log in logs for found in re.findall(pattern, log)[1:]]
    return np.median([float(s) * float(use) / 100 / int(n) / dt * 1e6 for s, n, use in runs])


@pytest.mark.timeout(900)
def test_a_step_that_is_good_is_named_and_not_one_that_fails(rings):
    """Locks out advice for a step at which the run heats or its energy fluctuates above the target,
    a row without its starts or costs, and a cost that contains the sampling."""
    _, out, status = rings
    summary = json.loads((out / "summary.json").read_text())
    short, _, good, bad = summary["points"]
    assert status == 0 and summary["advised"]["dt"] in (2, 3, 4)
    assert (short["is_reference"], good["dt"], bad["dt"]) == (True, 4, 60)
    assert short["starts"] == 2 and short["errors"]["energy"]["value"] < 0.2
    assert bad["failed"] and bad["cost"] is None and bad["failures"] == 1
    assert set(short["errors"]) >= set(summary["targets"]) and short["cost"]["min"] > 0
    logs = [path.read_text() for path in out.glob("runs/*/nosquish/4/*/benchmark.lammps")]
    assert len(logs) >= plan.STARTS and good["cpu"]["median"] == pytest.approx(cpu_per_ns(logs, 4))
    page = (out / "report.html").read_text()
    assert "with a step of" in page and "pair_modify shift yes" in page
    assert len(summary["neighbour_lists"]) == plan.OTHER_LISTS
    assert "eighbour lists" in " ".join(report.answered(summary)["answer"])


@pytest.mark.timeout(900)
def test_the_same_command_runs_nothing_again(rings):
    """Locks out runs that are done again, a long run that is judged by what chose it, and another
    answer the second time."""
    command, out, status = rings
    begin = {one: one.stat().st_mtime_ns for one in out.glob("runs/**/done.json")}
    assert command() == status and begin
    now = {one: one.stat().st_mtime_ns for one in out.glob("runs/**/done.json")}
    del now[out / "runs" / "calibration" / "done.json"]
    assert now == {one: begin[one] for one in now}
    summary = json.loads((out / "summary.json").read_text())
    for alone in (one for one in summary["points"] if one["alone"]):
        assert alone["time"] > summary["time"]  # of which as much is left out


@pytest.mark.timeout(900)
def test_options_that_are_advised(tmp_path, monkeypatch):
    """Locks out options of an answer that do not help: shorter steps where none is good, and
    longer ones where the longest is."""
    steady(monkeypatch, 3e-3)
    path = replaced(scripts.rings(tmp_path), "fix heat all langevin 300 300 200 11\n", "")

    def compare(words):
        out = tmp_path / re.sub("[ =]", "-", words)
        more = ["--only", "nosquish", "--out", str(out), *words.split()]
        status = main(["compare", str(path), *more])
        return status, " ".join(json.loads((out / "summary.json").read_text())["answer"])

    wide = "--budget 0.05 --target drift=1e5 energy=9 rdf=none temperature=9"
    for steps, why in ("30,44", "No step that was tried"), ("4", "the longest step that was tried"):
        _, answer = compare(f"{wide} --steps {steps}")
        (advised,) = re.findall(r"--steps [\d.,]*\d", answer)
        assert why in answer and compare(f"{wide} {advised}")[0] == 0


def test_other_thermostats_that_are_advised(tmp_path, monkeypatch):
    """Locks out --only all, which an answer advises for averages only, that compares nothing more
    than the script's own kind of thermostat."""
    own = row(4.0, cost=[2.0], drift=(0.1, 0.01)) | {"thermostat": "nh"}
    bath = {"kind": "nh", "damp": "100 fs", "dynamics": []}
    _, lines = told(summary_of({"drift": 1.0}, own, thermostat=bath))
    (advised,) = re.findall(r"--only \w+", " ".join(lines))
    fix = "fix 1 all rigid/nvt/small molecule temp 298 298 100"
    path, kinds = scripts.spce(tmp_path, fix=fix), set()

    def prepare(case, points, *_):
        kinds.update(thermostat.kind_of(case.integrators[one.scheme].lines) for one in points)
        raise SystemExit(0)

    monkeypatch.setattr(measure, "prepare", prepare)
    with pytest.raises(SystemExit):
        main(["compare", str(path), *advised.split(), "--out", str(tmp_path / "out")])
    assert kinds == {"nh", "langevin", "csvr"}


@pytest.mark.timeout(600)
def test_a_scene_goes_the_same_way(tmp_path, monkeypatch):
    """Locks out a scene whose errors are not those of the square of the step, that is held against
    another start, or whose failures are not told; points of both starts that are one; and
    numbers of today's code that differ from the committed ones: of the dimer, whose energy is an
    orbit's, within the spread of its starts."""
    steady(monkeypatch, 2e-6)
    words = ["compare", "dimer", "--budget", "0.0278", "--steps", "0.2,0.4,8"]
    words += ["--out", str(tmp_path)]
    assert main([*words, "--only", "nosquish", "shake-1e-8"]) in (0, 1)
    summary = json.loads((tmp_path / "summary.json").read_text())
    rows = {(one["integrator"], one["dt"]): one for one in summary["points"]}
    known = json.loads((RESULTS / "compare-dimer" / "summary.json").read_text())["points"]
    (known,) = (row for row in known if (row["integrator"], row["dt"]) == ("nosquish", 0.4))
    result, known = (
        Estimate.of(row["errors"]["energy_sd"]) for row in (rows["nosquish", 0.4], known)
    )
    apart = measures.difference(result, known)
    assert abs(apart.value) < apart.margin
    for name in "nosquish", "shake-1e-8":
        short, long = (rows[name, dt]["errors"]["energy_sd"]["value"] for dt in (0.2, 0.4))
        assert long / short == pytest.approx(4.0, rel=0.2)
        assert rows[name, 8.0]["failed"]
    jobs = [json.loads((tmp_path / f"runs/short/nosquish/0.2/{n}/job.json").read_text())
            for n in (1, 2)]  # fmt: skip
    read = [[line for line in job["commands"] if line.startswith("read_dump")] for job in jobs]
    assert read[0] == [] and "start/state.dump" in read[1][0]


def test_after_a_long_run_that_fails_comes_another(monkeypatch):
    """Locks out half of a budget that is not used: the long run of a step fails in its first
    seconds, and no shorter step is tried."""
    rows, tried = [row(dt) for dt in (2.0, 4.0, 8.0)], []

    def longest(prepared, rows):
        good = [one for one in rows if not one["failed"]]
        return SimpleNamespace(row=good[-1], point=None) if len(tried) < 5 else None

    def long(prepared, best, runs, meter):
        tried.append(best.row["dt"])
        fails = "8: ERROR" if best.row["dt"] > 5 else None
        return SimpleNamespace(interrupted=False), best.row | {"failed": fails, "alone": True}

    done = SimpleNamespace(interrupted=False, versions={})
    for name, value in {
        "_summary": lambda *_: {"versions": {}}, "_perform": lambda *_: done,
        "_rows": lambda *_: rows, "collected": lambda *_: None, "_lists": lambda *_: [],
        "choose_long_run": longest, "run_longer": long,
    }.items():  # fmt: skip
        monkeypatch.setattr(measure, name, value)
    monkeypatch.setattr(plan, "trajectories", lambda *_: [])
    prepared = SimpleNamespace(case=None, every=[], lengths=None, settings=None, parts=True)
    found = measure.compare(prepared, None)["points"]
    assert tried == [8.0, 4.0]
    assert [one["failed"] for one in found] == [None, None, "8: ERROR"]
    assert [one["alone"] for one in found] == [False, True, True]


def test_a_plan_keeps_its_budget():
    """Locks out runs that take longer together than they may, and runs too short to fail."""
    here = plan.Machine(1e-3, 2.0, 1000)
    points = [Point(name, dt) for name in "ab" for dt in (1.0, 2.0, 4.0)]
    time = plan.time_of(points, here, 600.0)
    spent = sum(here.startup + here.step * time / point.dt for point in points)
    assert spent == pytest.approx(600.0)
    case = SimpleNamespace(scene=SimpleNamespace(dt=2.0))
    lengths = plan.lengths(case, points, here, 0.0)
    assert all(sum(lengths.runs(point.dt)) >= 100 for point in points)
    case = cases.Case("", SimpleNamespace(dt=1.0), {}, "a", ("a",), (1.0, 2.0), 1.0)
    case = replace(case, integrators={"a": None, "b": None})
    assert plan.points(case, case.usual, (3.0,)) == ([Point("a", 3.0)], Point("a", 1.5))
    assert plan.points(case, ["b"], None) == ([Point("b", 1.0), Point("b", 2.0)], Point("a", 1.0))


def test_lists_of_neighbours_are_timed_as_they_are_advised(tmp_path, monkeypatch):
    """Locks out advice that its runs did not have, a skin that is narrower than the script's, bins
    of another size than a third of the neighbour cutoff, and a budget without time for it."""
    monkeypatch.setattr(plan, "STARTUP", 0.0)
    case = cases.of_script(take(scripts.spce(tmp_path), tmp_path / "out"))
    wide = replace(case.scene, setup=(*case.scene.setup, "neighbor 2.4 bin"))
    settings = plan.Settings(tmp_path / "out", 0.1)
    point = Point("nosquish", 4.0)
    result = lists.measure(replace(case, scene=wide), point, settings, 0.0, Silent())
    wider, smaller, both = (one["lines"] for one in result)
    logs = tmp_path / "out" / "runs" / "lists"
    usual, other = (
        (logs / run.folder_name(name) / "log.lammps").read_text()
        for name in (lists.AS_IT_IS, " and ".join(both))
    )
    size = float(re.findall(r"binsize = ([\d.]+), bins", other)[-1])
    before, after = (lammps_log.lists(text) for text in (usual, other))
    assert (before.skin, after.skin) == (2.4, pytest.approx(3.6)) and after.sized > before.sized
    assert after.cutoff - after.skin == pytest.approx(before.cutoff - before.skin)
    assert both == wider + smaller and size == pytest.approx(before.cutoff / 3, rel=1e-2)
    assert all(len(one["ratio"]["values"]) == plan.ROUNDS for one in result)
    for minutes, startup in (0.0, 0.0), (0.1, 9.0):  # none for lists; too little of it
        short = replace(settings, minutes=minutes)
        assert lists.measure(case, point, short, startup, Silent()) == []


@pytest.mark.parametrize("minutes", [0.5, 5.9, 6.1, 60.0])
def test_all_of_a_budget_goes_somewhere(minutes):
    """Locks out time that is kept for lists which are not timed."""
    settings = plan.Settings(None, minutes)
    assert settings.for_points + settings.for_lists == pytest.approx(60 * minutes)
    assert (settings.for_lists > 0) == (minutes > 6)


@pytest.mark.parametrize(
    ("lines", "others"),
    [
        ("neighbor 1.0 bin", 3),
        ("neighbor ${skin} bin\nneighbor 0.5 bin\nneighbor 4 multi", 0),
        ("neighbor 0.5 nsq", 0),
        ("neigh_modify every 1 binsize 3.0 delay 0", 0),
        ("units lj", 3),
        ("units micro", 0),
    ],
)
def test_whose_lists_are_left_as_they_are(lines, others):
    """Locks out a change of the style, of bins that were chosen, and a skin that is not known."""
    text = f"units real\n{lines}\n  master list distance cutoff = 10.5\n"
    assert len(lists._others(lammps_log.lists(text))) == others
    assert lists._others(lammps_log.lists(lines)) == {}


def test_what_is_said_of_lists():
    """Locks out advice that one slow round makes, or one where a faster setting has no doubt."""

    def told(*ratios):
        results = [{"lines": [f"line {k}"], "ratio": measures.spread(one)}
                 for k, one in enumerate(ratios)]  # fmt: skip
        return [*lists.advise(results)]

    assert told() == [] and "not faster" in told((0.9, 0.8, 0.99))[0]
    assert "by 10 % (5 to 20 %" in told((0.9, 0.8, 0.95))[0]
    assert told((0.7, 0.7, 1.1), (0.95, 0.9, 0.97))[1:] == ["    line 1"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("butter", "dimer, water, peptide"),
        ("water --steps 1,-2", "positive"),
        ("water --only rigit", "rigit"),
        ("dimer --target energi=1", "there is no target energi"),
        ("dimer --target density=1", "density says nothing of dimer"),
        ("water --target energy", "MEASURE=VALUE"),
        ("water --budget 0", "positive"),
        ("water --run 2", "--run is for a script"),
        ("water --launch srun", "{ranks} is missing"),
        ("water --launch ''", "{ranks} is missing"),
        ("water --launch 'nolauncher -n {ranks}'", "there is no program nolauncher"),
    ],
)
def test_words_that_are_wrong_are_refused(words, said, capsys, tmp_path, monkeypatch):
    """Locks out a traceback, a night's work, or runs on another number of ranks than the table
    says, where something is misspelt."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as end:
        main(["compare", *shlex.split(words)])
    assert end.value.code == 2 and said in capsys.readouterr().err


def test_a_step_that_is_far_too_long_is_told_so(tmp_path, capsys, monkeypatch):
    """Locks out "Bond atoms missing" as the answer to --steps 200, and neighbour lists of a short
    step in runs with longer ones."""
    path = scripts.spce(tmp_path, lines="neigh_modify delay 5")
    words = ["compare", str(path), "--out", str(tmp_path / "out")]
    monkeypatch.setattr(measure, "prepare", lambda *_: 1 / 0)
    with pytest.raises(SystemExit) as end:
        main([*words, "--steps", "200"])
    said = capsys.readouterr()
    assert end.value.code == 2 and "a step of 100 fs is too long for this system" in said.err
    (bound,) = re.findall(
        r"unstable above about (\S+) fs\. Give shorter steps by --steps$", said.err
    )
    with pytest.raises(ZeroDivisionError):  # the first run
        main([*words, "--steps", f"{0.9 * float(bound):g}"])
    assert "'neigh_modify every 1 delay 0 check yes' is added" in said.out
    case = cases.of_script(time_step.with_lists_in_time(take(path, tmp_path / "again")))
    lines, _, _ = case.written(case.integrators["nosquish-nh"])
    assert lines[-1] == time_step.LISTS and 4 < case.unstable < 20
    found = measure.Runs(failed={Point("a", 200.0): ["Bond atoms"], Point("a", 2.0): ["other"]})
    found.judge(case)
    assert found.failed[Point("a", 200.0)][0].startswith("the step is too long (unstable above")
    assert found.failed[Point("a", 2.0)] == ["other"]


def test_targets_of_bodies_at_rest_are_refused(tmp_path):
    """Locks out runs of some minutes that end in a division by zero, for nothing moves."""
    path = written(tmp_path, GAS + "fix 1 a rigid/nve  single\nrun  1\n")
    with pytest.raises(LookupError, match="the atoms are at rest at 'run 1'"):
        of(take(path, tmp_path / "out"), {})
    replaced(path, "fix 1", "velocity all create 1 5\nfix 1")
    assert of(take(path, tmp_path / "out"), {})  # as advised
