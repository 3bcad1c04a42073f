"""The verb ``check``: whether a user's script is sound, and which parts of its molecules are rigid.

What it prints for rigid parts is put into the script, which LAMMPS then runs.
"""

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from support import (
    scripts,
)
from support.harness import advised, replaced, run_lmp, started, take, with_lines
from support.running import ROOT, read_thermo
from validation.__main__ import main
from validation.check import measure as check
from validation.check import parts, report
from validation.running import json_files, lammps_log, run
from validation.statistics import measures
from validation.user_script import shapes, time_step


def forces_within(own, out):
    """How many pairs within a body have forces, the verdict, and the remark."""
    result = check._forces_within(own, shapes.body_groups(own)[0], out, 1, 300.0)
    return result.value, result.verdict, check._without_note(result).note


def steps(own, tolerance=0.01):
    """What is said of the time step."""
    groups, _ = shapes.body_groups(own)
    return [*check._step(own, groups, shapes.body_kinds(own, groups), tolerance)]


def answer_of(checks, rows=(), dt=4.0):
    """The answer to these checks, and rows of integrators."""
    summary = {"checks": checks, "integrators": rows, "title": "", "notes": [], "suffix": []}
    return report.describe(summary | {"kinds": [], "units": "real", "dt": dt}).answer


# ---- is the script sound

MESH = (
    "variable q atom 0.2*(id%2)-0.1\nset group all charge v_q\npair_style lj/cut/coul/long 8.0\n"
    "pair_coeff * * 0.11 3.75\nkspace_style pppm 1e-3\n"
)


@pytest.mark.parametrize(
    ("words", "pairs"),
    [
        ("", 0),  # LAMMPS's own factors are 0
        ("special_bonds lj/coul 0 0 1\n", 3),  # opposite atoms of a ring
        ("special_bonds lj 0 1 1 coul 0 0 0\n", 9),
        ("special_bonds lj/coul 1 1 1\ngroup exclude type 1\n", 15),
        ("special_bonds lj/coul 1 1 1\nneigh_modify exclude molecule/intra all\n", 0),
        ("special_bonds lj/coul 1 1 1\nneigh_modify exclude molecule/intra all\n"
         "neigh_modify exclude none\n", 15),
        (f"special_bonds lj/coul 0 0 0\n{MESH}", 0),
        (f"special_bonds lj/coul 0 0 1\n{MESH}", 3),
        (f"special_bonds lj/coul 0 0 0\n{MESH}neigh_modify exclude molecule/intra all\n", 0),
        ("special_bonds lj/coul 1 1 1\ngroup some id 1:3\n"
         "neigh_modify exclude molecule/intra some\n", 12),
        ("special_bonds lj/coul 1 1 1\nneigh_modify exclude type 1 1\n", 0),
    ],
)  # fmt: skip
def test_forces_within_bodies_are_counted(tmp_path, words, pairs):
    """Locks out a warning of forces that bonds leave out by LAMMPS's defaults, exclusions that are
    none (also beside a mesh, where LAMMPS lists them), and silence where forces are computed; of a
    ring of six atoms, as combinatorics has it."""
    path = replaced(scripts.rings(tmp_path), "special_bonds lj/coul 0 0 0\n", words)
    value, _, note = forces_within(take(path, tmp_path / "out"), tmp_path / "out")
    assert value == pairs
    assert ("exclude molecule/intra all leaves them out" in note) == (pairs > 0)


@pytest.mark.parametrize(
    ("factors", "style", "verdict"),
    [
        ("1 1 1", "atm 4.5 2.5", "holds"),
        ("0 0 0", "atm 4.5 2.5", "does not hold"),
        ("0 0 0", "hybrid/overlay lj/cut 8.0 atm 4.5 2.5", ""),
    ],
)
def test_a_many_body_potential_needs_the_pairs_of_bodies(tmp_path, factors, style, verdict):
    """Locks out the advice to exclude a molecule's pairs, without which a many-body potential has
    other forces on the molecule, too; and silence where they are left out."""
    name = "atm " * style.startswith("hybrid")
    more = "pair_coeff * * lj/cut 0.11 3.75\n" * bool(name)
    words = f"pair_style {style}\n{more}pair_coeff * * {name}* 0.072\n"
    bonds = f"special_bonds lj/coul {factors}\n{words}"
    path = replaced(scripts.rings(tmp_path), "special_bonds lj/coul 0 0 0\n", bonds)
    _, told, note = forces_within(take(path, tmp_path / "out"), tmp_path / "out")
    assert told == verdict and ("must not be left out" in note) == (verdict != "holds")


def test_check_finds_what_does_not_fit(tmp_path):
    """Locks out a script whose atoms stand still, whose thermostats are not counted or whose step
    is far too long, and that passes; and a note on what is wrong where nothing is."""
    path = scripts.rings(tmp_path)
    path.write_text(
        path.read_text()
        .replace("fix bodies all rigid/nve/small molecule", "group some molecule 1:60\n"
                 "fix bodies some rigid/nve/small molecule")
        .replace("timestep 4", "timestep 400")
    )  # fmt: skip
    own = take(path, tmp_path / "out")
    groups, gap = shapes.body_groups(own)
    kinds = shapes.body_kinds(own, groups)
    checks = [*check._bodies(own, gap, kinds), *check._script(own), *steps(own)]
    found = {(one.subject, one.what): one.holds for one in checks}
    assert found["atoms", "that no fix moves"] is False
    assert found["thermostats", "of the bodies"] is True
    assert [holds for (_, what), holds in found.items() if what.startswith("rms angle")] == [False]
    for one in map(check._without_note, checks):
        assert bool(one.note) == (one.part == "step" or not one.holds), one


@pytest.mark.parametrize(
    ("words", "holds"), [("delay 0", True), ("delay 10", False), ("check no", None)]
)
def test_lists_of_neighbours_that_are_too_old(tmp_path, words, holds):
    """Locks out silence where LAMMPS looks every tenth step, which was often enough for 2 fs, a
    word that lists are in time where LAMMPS does not look, and a line that does not help."""

    def lists(*lines):
        path = scripts.spce(tmp_path, lines="\n".join([*lines, "timestep 6.0"]))
        (row,) = started(take(path, tmp_path / "out"), tmp_path / "out", only=["nosquish"])
        return check._lists(row.get("late"))

    result = lists(f"neigh_modify {words}")
    assert result.holds is holds
    if not holds:
        (line,) = re.findall("With long steps use '(.*)'$", result.note)
        assert lists(f"neigh_modify {words}", line).holds is True


def test_check_says_what_its_table_cannot(tmp_path, capsys):
    """Locks out an energy that LAMMPS counts wrongly and that stands beside ours as if ours were a
    thousand times better; three different steps that are all called safe; a page, or a screen,
    without it; a start on a lattice of which nothing says so; and a head that is printed twice."""
    path, out = scripts.spce(tmp_path), tmp_path / "out"
    assert main(["check", str(path), "--out", str(out)]) == 0
    summary = json_files.read(out / "summary.json")
    shown = {one["label"]: "change" in one for one in summary["integrators"]}
    assert not shown["rigid/nvt/small"] and shown["nosquish/nvt langevin"]
    # of a lattice, whose forces are not those of water
    (settles,) = re.findall("from (.*) to (.*) K", summary["suffix"][0])
    assert "not in equilibrium" in summary["suffix"][0] and float(settles[1]) > 2 * float(
        settles[0]
    )
    told, printed = "LAMMPS's econserve is not the conserved quantity", capsys.readouterr().out
    assert told in printed and printed.count("Ensemble: NVT") == 1
    assert told in (out / "report.html").read_text().replace("&#39;", "'")
    ask = advised(summary["suffix"][0], N="2")
    own = take(replaced(path, "\nrun 100", "\nrun 800\nrun 100"), tmp_path / "later", **ask)
    (row,) = started(own, tmp_path / "later", only=["nosquish"])
    assert "settles" not in row
    steps = [one["note"] for one in summary["checks"] if one["part"] == "step"]
    assert len(steps) == 4 and "by this number alone, " in steps[0]
    assert all("unstable above about" in note for note in steps[1:3])
    assert "and below is within the tolerance (--tolerance)" in steps[3], steps


def test_the_line_of_the_readme(tmp_path):
    """Locks out a line that the README recommends and that `check` rejects: for moments that the
    line replaces, or for neighbour lists of integrators without them, which 12 fs breaks."""
    (row,) = re.findall(r"^\| water, averages .*", (ROOT / "README.md").read_text(), re.M)
    fix, timestep = re.findall(r"`(.*?)`", row)
    text = (ROOT / "inputs" / "water_smooth" / "in.smooth").read_text()
    text, count = re.subn(r"(?m)^fix .*", fix, text)
    assert count == 1
    path, out = tmp_path / "in.smooth", tmp_path / "out"
    exclude = "neigh_modify exclude molecule/intra water"  # as `check` advises for this scene
    path.write_text(re.sub(r"(?m)^timestep .*", f"{exclude}\n{timestep}", text))
    for file in "data.smooth", "forcefield.smooth":
        shutil.copy(ROOT / "inputs" / "water_smooth" / file, tmp_path)
    assert main(["check", str(path), "--out", str(out)]) == 0
    summary = json_files.read(out / "summary.json")
    assert summary["dt"] == 12.0 and "not in equilibrium" not in " ".join(summary["suffix"])


def test_a_start_whose_run_has_no_numbers_fails(taken):
    """Locks out "ok" of an integrator whose energy is nan after some steps: LAMMPS goes on."""
    own = taken("spce")
    names = "Step", "Temp", "Press", "KinEng", "PotEng", "TotEng", "Econserve"
    thermo = {name: np.ones(5) for name in names} | {"Step": 2.0 * np.arange(5)}
    result = SimpleNamespace(error=None, thermo=thermo, timings=[SimpleNamespace(late=0)])
    ours = own.integrators["nosquish"]
    row = check._row(own, ours, result)
    assert row["error"] is None and row["temperature"] == 1.0
    thermo["TotEng"] = np.array([1.0, 1.0, np.nan, np.inf, np.nan])
    thermo["Press"] = np.array([1.0, 1.0, 1.0, np.nan, np.nan])
    row = check._row(own, ours, result)
    assert row["error"] == "no number from step 4 on: TotEng" and "change" not in row


def test_a_script_that_no_integrator_can_start():
    """Locks out "all numbers are within their bounds" of a script with which nothing runs."""
    rows = [{"label": "a", "error": "ERROR: no", "uncounted": False}]
    assert answer_of([], rows).startswith("No integrator can run the start")
    rows.append({"label": "b", "error": None, "uncounted": False})
    assert answer_of([], rows).startswith("All numbers")


def test_one_verdict_of_numbers_that_are_not_known(tmp_path, capsys):
    """Locks out "All numbers that have bounds are within them", and exit status 0, beside a line
    "cannot tell" with LAMMPS's error or without one."""
    path = scripts.spce(tmp_path, lines="neigh_modify check no")
    assert main(["check", str(path), "--out", str(tmp_path / "out")]) == 1
    told = capsys.readouterr().out
    assert "\nNot known: neighbour lists.\n" in told and "All numbers" not in told
    summary = json_files.read(tmp_path / "out" / "summary.json")
    assert not report.is_sound(summary)
    for entry in summary["checks"]:
        if entry["subject"] in ("neighbour lists", "atoms"):
            entry["verdict"] = "holds" if entry["subject"] == "neighbour lists" else "does not hold"
    assert report.describe(summary).answer == "Out of their bounds: atoms."


@pytest.mark.parametrize(
    ("dt", "tolerance", "lost"),
    [
        (4.0, 0.01, []),  # averages of committed runs are off by 0.8 % (csvr)
        (8.0, 0.01, ["averages (the step is inaccurate)"]),  # 3 %, but it is stable
        (8.0, 0.04, []),
        (12.0, 0.04, ["turning (the step is unstable)", "averages (the step is inaccurate)"]),
    ],
)
def test_a_step_that_is_unstable_and_one_that_is_inaccurate(
    taken, monkeypatch, dt, tolerance, lost
):
    """Locks out one bound for both: the peptide's recipe at 4 fs was rejected, although 120 ps of
    runs bear it out; held against committed runs of water, which rotates at this frequency."""
    own = replace(taken("spce"), scene=replace(taken("spce").scene, dt=dt))
    monkeypatch.setattr(shapes, "fastest_motions", lambda *_: {"turning": 0.148})
    monkeypatch.setattr(shapes, "mean_square_frequency", lambda *_: 0.0052)  # as of TIP3P
    rows = [one.plain() for one in steps(own, tolerance) if one.part == "step"][1:]
    assert answer_of(rows, dt=dt) == (f"Out of their bounds: {', '.join(lost)}." if lost else
                      "All numbers that have bounds are within them.")  # fmt: skip


@pytest.mark.parametrize(
    ("commands", "changes"),
    [
        ([], False),
        (["neigh_modify delay 5"], True),
        (["neigh_modify delay 5 every 1", "neigh_modify every 1 delay 0 check yes"], False),
        (["neigh_modify every 2"], True),
        (["neigh_modify check no"], True),
        (["neigh_modify exclude molecule/intra all"], False),
    ],
)
def test_lists_that_are_in_time_for_longer_steps(commands, changes):
    """Locks out lines for a step of 4 fs beside 'neigh_modify delay 5' of a script for 2 fs: 22 of
    45 builds were dangerous; and a line that changes nothing."""
    assert time_step.lists_in_time(commands) == [time_step.LISTS] * changes


def test_bodies_beside_a_barostat_get_one_line(tmp_path, run_lammps):
    """Locks out silence on bodies that the barostat of other atoms does not scale, and a line that
    LAMMPS refuses."""
    path = scripts.solute(tmp_path)
    text = path.read_text()
    fixes = [line for line in text.splitlines() if line.startswith("fix ")]
    text = text.replace(fixes[0], "group water molecule 1:27\ngroup solute subtract all water\n"
                        "fix bodies water rigid/nvt/small molecule temp 300 300 100")  # fmt: skip
    text = text.replace(fixes[1], "fix box solute npt temp 300 300 100 iso 1 1 1000")
    path.write_text(text)
    told = [*check._barostat(take(path, tmp_path / "out"))]
    (line,) = [one.strip() for one in told if "flexible solute" in one]
    assert "nosquish/npt molecule temp 300 300 100 iso 1 1 1000" in line
    assert "thermostat nh" in line and "replace fix bodies (rigid/nvt/small) and fix box" in told[0]
    columns = "thermo_style custom step vol\nrun 20"
    followed = with_lines(re.sub(r"(?m)^run \d+$", columns, text), "\n".join(told))
    rows = read_thermo(run_lammps(followed).log)
    assert rows["Volume"][0] != rows["Volume"][-1]  # the box follows


def test_the_suffix_acts_as_it_is_said(tmp_path, run_lammps):
    """Locks out a command that does not replace the fix, and a quoted line that no log has."""
    path = scripts.rings(tmp_path)
    own = take(path, tmp_path / "out")
    (told,) = check._suffix(own, tmp_path / "out", 1, 300.0)
    suffix, line = re.fullmatch(r"'lmp (.*) -in SCRIPT' replaces .*has the line '(.*)' then.*",
                                told).groups()  # fmt: skip
    text = path.read_text().replace("run 1000", "run 1")
    assert line not in run_lammps(text).log
    assert line in run_lammps(text, options=suffix.split()).log


# ---- which parts can be rigid


def test_rigid_parts_are_found_by_their_chemistry():
    """Locks out a part that is none, or one that is missed: toluene, methylammonium, cyclohexane
    and water, held against what chemistry says of them."""
    bonds, mass, x = [], [], []

    def atom(element, place, to=None):
        mass.append(parts.ELEMENTS[element])
        x.append(place)
        if to:
            bonds.append((1, to, len(x)))
        return len(x)

    def ring_of(places):
        ring = [atom("C", place) for place in places]
        bonds.extend((1, a, b) for a, b in zip(ring, ring[1:] + ring[:1]))
        return ring

    corners = 1.39 * np.array([[np.cos(a), np.sin(a), 0] for a in np.arange(6) * np.pi / 3])
    ring = ring_of(corners)
    hydrogens = [atom("H", 1.8 * place, at) for place, at in zip(corners[1:], ring[1:])]
    methyl = atom("C", 2.1 * corners[0], ring[0])
    of_methyl = [atom("H", [3.3, y, z], methyl) for y, z in ((1, 0), (-0.5, 0.9), (-0.5, -0.9))]
    carbon = atom("C", [10, 0, 0])
    nitrogen = atom("N", [11.5, 0, 0], carbon)
    for at in carbon, nitrogen:
        for place in range(3):
            atom("H", [10.5 + place, 1, 1], at)
    chair = ring_of(place + np.array([0, 10, (-1) ** i / 4]) for i, place in enumerate(corners))
    for at in chair:
        atom("H", [0, 12, 1], at), atom("H", [0, 12, -1], at)
    water = [atom("O", [0, 0, 9])]
    water += [atom("H", [1, 0, 9], water[0]), atom("H", [0, 1, 9], water[0])]
    atoms = {"mass": np.array(mass), "x": np.array(x, float), "bonds": np.array(bonds)}
    body, counts = parts.rigid(atoms, 40 * np.eye(3), [True] * 3)
    assert counts == {"water": 1, "CH3": 2, "NH3": 1, "rings": 1}
    results = {frozenset(1 + np.flatnonzero(body == one)) for one in range(1, 6)}
    assert {
        frozenset(ring + hydrogens),
        frozenset([methyl, *of_methyl]),
        frozenset(water),
    } < results
    assert body.max() == 5 and not body[np.array(chair) - 1].any()
    for wanted, number in (["CH3"], 2), (["water", "XH"], 14), (["water", "rings", "XH"], 9):
        body, counts = parts.rigid(atoms, 40 * np.eye(3), [True] * 3, wanted)
        assert counts[wanted[-1]] == number and body.max() == sum(counts.values())


def test_parts_of_a_kind_get_one_shape():
    """Locks out bodies of one kind that differ, mirror images of CH3 that spoil the mean, places
    that are turned, and bodies that a periodic face tears."""
    rng, cell = np.random.default_rng(4), 30.0 * np.eye(3)
    angles = np.arange(3) * 2 * np.pi / 3
    hydrogens = np.stack([np.full(3, 0.37), np.cos(angles), np.sin(angles)], axis=1)
    methyl = np.concatenate([np.zeros((1, 3)), hydrogens])
    x, types = [], np.tile([1, 2, 2, 2], 40)
    for number in range(40):
        shape = methyl[[0, 1, 3, 2]] if number % 3 == 0 else methyl
        turned = Rotation.random(random_state=number).apply(shape)
        x.append(turned + rng.uniform(0, 30, 3) + 0.02 * rng.normal(size=(4, 3)))
    x = np.mod(np.concatenate(x), 30.0)
    atoms = {"x": x, "type": types, "mass": np.where(types == 1, 12.011, 1.008)}
    made, moved = parts.alike(atoms, np.repeat(np.arange(1, 41), 4), cell, [True] * 3)
    assert 0.02 < moved < 0.2
    r = made.reshape(40, 4, 3)
    r = r[:, :1] + measures.nearest_image(r - r[:, :1], cell, [True] * 3)
    apart = np.sort(np.linalg.norm(r[:, [0, 0, 0, 1, 1, 2]] - r[:, [1, 2, 3, 2, 3, 3]], axis=2))
    np.testing.assert_allclose(apart, apart[:1].repeat(40, axis=0), atol=1e-12)
    exact = np.sort(np.linalg.norm(methyl[[0, 0, 0, 1, 1, 2]] - methyl[[1, 2, 3, 2, 3, 3]], axis=1))
    np.testing.assert_allclose(apart[0], exact, atol=0.02)


REST = "group own_rest subtract all own_bodies"
BODIES = "fix 1 own_bodies nosquish/{} custom v_own_body"
NVT = f"{BODIES} temp 300 300 100".format("nvt")
NPT = f"{BODIES} temp 300 300 100 iso 1 1 1000 thermostat nh barostat mtk".format("npt")
MOVES = {  # of scripts with water and a solute of four atoms, fixes; and what has to be printed
    "nve": ("fix 1 all nve", [REST, "fix own_rest own_rest nve", BODIES.format("nve")]),
    "langevin": ("fix 1 all nve\nfix 2 all langevin 300 300 100 5", [BODIES.format("nve")]),
    "chains": ("fix 1 all nvt temp 300 300 100 tchain 5", [
        "fix own_rest own_rest nvt temp 300 300 100 tchain 5", f"{NVT} thermostat nh",
    ]),
    "shake": ("fix 4 all shake 1e-6 200 0 b 1 3 a 1\nfix 1 all nvt temp 300 300 100", [
        "fix own_held own_rest shake 1e-6 200 0 b 1 3 a 1", f"{NVT} thermostat nh",
    ]),
    "shake of water alone": (
        "fix 4 all shake 1e-6 200 0 b 1 a 1\nfix_modify 4 virial yes\n"
        "fix 1 all nvt temp 300 300 100", ["fix own_rest own_rest nvt temp 300 300 100"],
    ),
    "rattle": ("fix 1 all nve\nfix 4 all rattle 1e-6 200 0 b 1 3 a 1", [
        "fix own_held own_rest rattle 1e-6 200 0 b 1 3 a 1",
    ]),
    "pressure": ("fix 1 all npt temp 300 300 100 iso 1 1 1000 drag 0.2", [
        f"{NPT} flexible own_rest",
    ]),
    "pressure and shake": (
        "fix 4 all shake 1e-6 200 0 b 1 3 a 1\nfix 1 all npt temp 300 300 100 iso 1 1 1000\n"
        "compute_modify 1_temp extra/dof 3",
        ["fix own_held own_rest shake 1e-6 200 0 b 1 3 a 1", f"{NPT} dilate own_rest"],
    ),
    "a part stands still": ("group frozen id 82\ngroup mobile subtract all frozen\n"
        "fix 1 mobile nve", ["group own_rest subtract mobile own_bodies"],
    ),
    "a part stands still, at constant pressure": (
        "group frozen id 82\ngroup mobile subtract all frozen\n"
        "fix 1 mobile npt temp 300 300 100 iso 1 1 1000",
        ["group own_others subtract all own_bodies own_rest",
         f"{NPT} flexible own_rest dilate own_others"],
    ),
    "two fixes": ("group water molecule 1:27\ngroup solute subtract all water\n"
        "fix 1 water nvt temp 300 300 100\nfix 2 solute nvt temp 280 280 50",
        [f"{NVT} thermostat nh"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("which", MOVES)
def test_what_is_printed_for_rigid_parts_runs_as_it_is(which, tmp_path, run_lammps, capsys):
    """Locks out lines that our fix or LAMMPS refuses, and motion that is another one without a
    word: a thermostat of another kind, what shake held, atoms that stood still; and other words
    for the thermostat that are refused."""
    text = scripts.solute(tmp_path).read_text()
    (first,) = [line for line in text.splitlines() if line.startswith("fix hold")]
    (second,) = [line for line in text.splitlines() if line.startswith("fix move")]
    fixes, lines = MOVES[which]
    text = text.replace(f"{first}\n{second}", fixes).replace("run 100", "run 20")
    text = text.replace("timestep 1", "timestep 0.5\ncompute d all displace/atom\nthermo 10\n"
        "compute far all reduce max c_d[4]\ngroup one id 82\ncompute still one reduce max c_d[4]\n"
        "thermo_style custom step temp press pe etotal econserve c_far c_still")  # fmt: skip
    (tmp_path / "in.solute").write_text(text)
    words = ["check", str(tmp_path / "in.solute"), "--rigid", "--out", str(tmp_path / "out")]
    assert main(words) == 0
    output = capsys.readouterr().out
    printed = [line.strip() for line in output.splitlines() if line.startswith("    ")]
    assert not [line for line in lines if line not in printed], printed
    done = run_lammps(with_lines(text, output), options=("-log", "log.lammps"))
    assert "27 rigid bodies with 81 atoms" in done.log
    rows = done.thermo
    assert rows["Step"][-1] == 20 and rows["c_far"][-1] > 0.01
    assert (rows["c_still"][-1] == 0) == (which == "a part stands still")
    holds = which in ("shake", "rattle", "pressure and shake")
    assert bool(re.search(r"^ *2 = # of size 2 clusters$", done.log, re.M)) == holds
    assert ("Keywords that ours does not have: drag 0.2" in output) == (which == "pressure")
    advice = re.search("write '(seed) N' instead of '(.*?)'", output)
    assert bool(advice) == ("thermostat nh" in output)
    if advice:
        other = with_lines(text, output).replace(advice[2], f"{advice[1]} 1")
        assert run_lammps(other).thermo["Step"][-1] == 20 and "thermostat nh" not in other


@pytest.mark.parametrize("name", ["plain", "Zürich", 'a"b', "two words"])
def test_rigid_parts_whatever_makes_the_atoms(name, tmp_path, run_lammps, capsys):
    """Locks out bodies of other atoms than the script's where replicate, delete_atoms or a
    minimization stand before the run, and files that LAMMPS does not find by the printed lines; the
    script is then one that the harness takes."""
    place = tmp_path / name
    place.mkdir()
    scripts.spce(place, number=3)
    text = (
        "units real\natom_style full\nread_data parts/spce.data\nreplicate 2 1 1\n"
        "include parts/spce.ff\ngroup few molecule 1:3\ndelete_atoms group few\nreset_atoms id\n"
        "velocity all create 298 1\ntimestep 1\nminimize 0 0 3 3\n"
        "fix 1 all nvt temp 298 298 100\nrun 3\n"
    )
    (place / "in.made").write_text(text)
    assert main(["check", str(place / "in.made"), "--rigid", "--out", str(place / "out")]) == 0
    printed = capsys.readouterr().out
    assert "51 × water" in printed
    (place / "in.changed").write_text(with_lines(text, printed))
    run_lmp(place / "in.changed", "-log", "log")
    log = (place / "log").read_text()
    assert "51 rigid bodies with 153 atoms" in log
    assert lammps_log.thermo(log)["Step"][-1] == 6
    own = take(place / "in.changed", tmp_path / "again")
    (kind,) = shapes.body_kinds(own, shapes.body_groups(own)[0])
    assert own.bodies == 51 and kind.number == 51 and kind.scatter < 1e-9
    assert "A longer timestep may be stable now: 'check' without --rigid estimates it," in printed
    assert any("unstable above" in one.note for one in steps(own))


def test_rigid_parts_of_a_peptide_with_cross_terms(tmp_path, run_lammps, capsys):
    """Locks out printed lines that lose fix cmap or its terms of a script as CHARMM-GUI writes it,
    where this fix begins before the box is made, and a harness that cannot begin such a script."""
    shutil.copytree(ROOT / "inputs" / "recipes" / "peptide", tmp_path, dirs_exist_ok=True)
    builder = [sys.executable, "build_cmap.py", ROOT / "inputs"]
    subprocess.run(builder, cwd=tmp_path, check=True)
    script = tmp_path / "in.shake"
    words = ["--rigid", "water", "XH", "--out", str(tmp_path / "out")]
    assert main(["check", str(script), *words]) == 0
    printed = capsys.readouterr().out
    assert "1,417 × water, 76 × XH" in printed
    (tmp_path / "in.rigid").write_text(with_lines(script.read_text(), printed))
    shown = script.read_text().replace("econserve", "econserve f_cmap")
    shown = shown.replace("run             ${steps}", "run 0")
    before, after = (run_lammps(text).thermo[0] for text in (shown, with_lines(shown, printed)))
    for name in "PotEng", "f_cmap":
        assert after[name] == pytest.approx(before[name], rel=1e-8)
    assert before["f_cmap"] < -5
    own = take(tmp_path / "in.rigid", tmp_path / "again")
    assert forces_within(own, tmp_path / "again")[0] == 0  # with dihedrals that need a pair style
    place, yours = tmp_path / "yours", own.integrators[own.reference]
    begun = run.run(run.job(own.scene, yours, place, [0], dt=own.scene.dt, every=1))
    assert begun.thermo["PotEng"][0] == pytest.approx(before["PotEng"], abs=1e-3)


def test_bodies_of_a_rigid_fix_get_one_shape(tmp_path, capsys):
    """Locks out advice of `check` that fails for the scripts to which it is given: those of rigid
    fixes, whose minimization has bent the bodies."""
    bent, out = "displace_atoms all random 0.05 0.05 0.05 7\nrun 1000", tmp_path / "out"
    path = replaced(scripts.rings(tmp_path), 'run 50 every 10 "print done"\nrun 1000', bent)
    own = take(path, tmp_path / "bent")
    groups, gap = shapes.body_groups(own)
    kinds = shapes.body_kinds(own, groups)
    (note,) = [one.note for one in check._bodies(own, gap, kinds) if one.subject == kinds[0].name]
    assert kinds[0].scatter > check.ALIKE and "check SCRIPT --rigid'" in note
    assert main(["check", str(path), "--rigid", "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    assert "Found: 64 × body of fix bodies" in printed and "directly before 'run 1000'" in printed
    (line,) = [line.strip() for line in printed.splitlines() if line.startswith("    ")]
    own = take(replaced(path, "run 1000", f"{line}\nrun 1000"), tmp_path / "again")
    (kind,) = shapes.body_kinds(own, shapes.body_groups(own)[0])
    assert kind.number == 64 and kind.scatter < 1e-9


def test_rigid_parts_that_cannot_be_told(tmp_path, capsys):
    """Locks out a traceback, or parts that nothing holds together without a word: no bonds, no
    rigid parts, units without elements, and bonds without forces."""

    def told(path, status=None):
        words = ["check", str(path), "--rigid", "--out", str(tmp_path / "out")]
        if status is None:
            with pytest.raises(SystemExit) as end:
                main(words)
            return str(end.value.code)
        assert main(words) == status
        return capsys.readouterr().out

    path = replaced(scripts.polymer(tmp_path), "rigid/nvt/small molecule", "nvt")
    assert "cannot be told by masses in units lj" in told(path)
    path = replaced(scripts.co2(tmp_path), "rigid/npt/small molecule", "npt")
    assert "the atoms have no bonds" in told(path)
    fix = "fix bodies all rigid/nve/small molecule"
    path = replaced(scripts.rings(tmp_path), fix, "fix 1 all nve")
    assert "No rigid part, so no file" in told(path, 1)
    data = replaced(tmp_path / "rings.data", "13.019", "12.011")
    of_rings = told(path, 0)
    assert "64 × rings" in of_rings and "have no force" not in of_rings
    data.write_text(data.read_text().replace("384 bonds", "385 bonds") + "385 1 1 7\n")
    loose = "1 bonds between bodies and other atoms have no force"
    assert loose in told(path, 0)
    replaced(path, "zero\nbond_coeff * 1.39", "harmonic\nbond_coeff * 99 1.39")
    assert loose not in told(path, 0)  # as advised


def test_check_of_atoms_that_a_fix_holds(tmp_path):
    """Locks out a check that ends in a traceback where other atoms have no force, so that no step
    is too long for them."""
    path = scripts.spce(tmp_path, fix="group some molecule <= 63\nfix 1 some rigid/nve molecule",
                        lines="group one molecule 64\nfix still one setforce 0 0 0")  # fmt: skip
    found = [one.subject for one in steps(take(path, tmp_path / "out"))]
    assert found[1:] == ["centres", "turning", "averages"]
