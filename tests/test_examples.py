"""The claims on LAMMPS's own examples: with its own rigid fixes and with ours."""

import json

import numpy as np
import pytest
from systems import mixture, script

from validation import __main__ as harness
from validation.claims import examples

# rods and bent bodies of three atoms that meet; `kick` is the word of the command line by which a
# test makes one side start otherwise
TINY = """\
units       lj
atom_style  molecular
variable    kick index 1.0
lattice     sc 0.03
region      box block 0 3 0 3 0 3
create_box  1 box
mass        1 1.0
molecule    bent mol.bent
create_atoms 0 region box mol bent 71328
pair_style  lj/cut 2.5
pair_coeff  1 1 1.0 1.0
neigh_modify exclude molecule/intra all
velocity    all create $(1.5*v_kick) 4928459 mom yes rot yes
{fix}
thermo_style custom step cpu temp pe &
             etotal press
thermo      50
timestep    0.002
{then}
"""
BENT = """\
three atoms

3 atoms

Coords

1 0 0 0
2 1 0 0
3 0.3 1.1 0

Types

1 1
2 1
3 1
"""
SCRIPTS = {
    "in.same": ("fix 1 all rigid/nve/small molecule", "run 1000"),
    "in.refused": ("fix 1 all rigid/small molecule", "minimize 0 0 10 10"),
    "in.lost": ("fix 1 all rigid/nve/small molecule infile none", "run 100"),
    "in.rigid": ("fix 1 all rigid molecule", "run 40\nrun 60"),
}


@pytest.fixture
def folder(tmp_path):
    """A folder of examples, one of them without bodies."""
    place = tmp_path / "examples" / "tiny"
    place.mkdir(parents=True)
    for name, (fix, then) in SCRIPTS.items():
        (place / name).write_text(TINY.format(fix=fix, then=then))
    (place / "mol.bent").write_text(BENT)
    (place / "in.atoms").write_text(TINY.format(fix="fix 1 all nve", then="run 100"))
    return tmp_path / "examples"


def rows(folder, out, part=""):
    words = ["claims", f"examples/{part}", "--lammps", str(folder), "--out", str(out)]
    status = harness.main(words)
    summary = json.loads((out / "examples" / "summary.json").read_text())
    return status, {row["example"]: row for row in summary["rows"]}, summary["checks"]


def test_what_comes_of_examples(folder, tmp_path):
    """Locks out a verb that runs ours where it says LAMMPS's, that takes an input apart that is
    none, or a refusal for an agreement: rigid/nve agrees to rounding, rigid to the error of the
    step, of second order, and LAMMPS's pressure to one of first order."""
    status, found, checks = rows(folder, tmp_path / "out")
    assert status == 0
    assert {name: row["verdict"] for name, row in found.items()} == {
        "tiny/in.lost": "not with theirs",
        "tiny/in.refused": "refused",
        "tiny/in.rigid": "agrees",
        "tiny/in.same": "agrees",
    }
    assert [check["verdict"] for check in checks] == ["cannot tell"] * 2 + ["holds"] * 2
    assert "minimisation" in found["tiny/in.refused"]["note"]
    assert found["tiny/in.same"]["said"] == ["nosquish/nve takes the place of rigid/nve/small"]
    assert max(found["tiny/in.same"]["begin"][::2]) < 1e-12
    assert found["tiny/in.same"]["falls"] == [pytest.approx(2, rel=0.3)]
    assert max(row["whole"] for row in found.values() if "whole" in row) < 1e-5


def test_examples_that_differ_are_told(folder, tmp_path, monkeypatch):
    """Locks out a comparison that passes all: a start that is two per cent warmer is told, and so
    is the exit status."""
    monkeypatch.setattr(examples, "SUFFIX", (*examples.SUFFIX, "-var", "kick", "1.02"))
    status, found, (check,) = rows(folder, tmp_path / "out", "tiny/in.same")
    assert status == 1 and check["verdict"] == "does not hold"
    assert found["tiny/in.same"]["verdict"] == "differs"
    assert "first steps" in found["tiny/in.same"]["note"]


def test_copies_differ_by_output_and_length_only(folder):
    """Locks out a copy whose ramps are shorter, whose seeds change in the first start, or that
    changes more of an input than what it prints."""
    example = examples.inputs(folder)["tiny/in.rigid"]
    assert example.tables == (2, 0)
    before = [" ".join(line.split()) for line in example.commands]
    after = [" ".join(line.split()) for line in example.copy([30, 60], 1).splitlines()]
    changed = [line for line in after if line not in before]
    assert [line for line in changed if line.startswith("run")] == [
        "run 30 start $(step) stop $(step+40)"
    ]
    assert {line.split()[0] for line in changed} == {
        *("variable", "thermo", "thermo_modify", "run")
    }
    other = example.copy([30, 60], 1, start=1)
    assert "4929459" in other and "72328" in other and "all rigid molecule" in other
    finer = example.copy([30, 60], 1, finer=2, nve=True).splitlines()
    assert finer[-2:] == ["timestep $(dt/2)", "run 40 start $(step) stop $(step+80)"]
    assert "fix 1 all rigid/nve molecule" in finer


@pytest.mark.parametrize("shift, often", [(0.0, 0.05), (0.5, 1.0)])
def test_means(shift, often):
    """Locks out means that are compared without their errors, or whose errors hide all: of equal
    ones five in a hundred are outside, as an interval of 95 % says, and of others all."""
    random = np.random.default_rng(5)

    def table(more):
        values = [*random.normal(10 + more, 1, 121)]
        return {"tables": [{"Step": [*range(121)], "Temp": values, "CPU": values}]}

    found = [examples.means([(table(0.0), table(shift)) for _ in range(4)], 0) for _ in range(200)]
    assert {one["columns"] for one in found} == {1}
    share = sum(bool(one["far"]) for one in found) / len(found)
    assert share == pytest.approx(often, abs=0.04)


def test_box_of_the_suffix_moves_in_each_step(run_lammps):
    """Locks out a box that leaves the path of fix rigid's at the start of a run far from its
    pressure, because it moves in one of many steps, as our own does by default."""
    system, vol = mixture("solid planar"), {}
    fix = "fix 1 {group} rigid/npt/small molecule temp 1.25 1.25 0.75 iso 20 20 2.5"
    text = script(system, fix, 40, words="", group="bodies", dt=0.5, every=1, columns="vol")
    for options in (), ("-sf", "nosquish"):
        vol[options] = run_lammps(text, files=system.files, options=options).thermo["Volume"]
    theirs, ours = vol.values()
    assert np.ptp(theirs) > 1e-3 * theirs[0]
    assert np.abs(ours - theirs).max() < 0.05 * np.ptp(theirs)
