"""What moves the bodies of a user's script, and what the bodies are, held against what is known of
the scripts that `scripts` writes.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

from support import (
    scripts,
)
from support.harness import GAS, advised, started, take, with_lines, written
from validation.__main__ import main
from validation.user_script import candidates, commands, rigid_atoms, shapes


def test_atoms_with_molecule_id_0_are_a_body():
    """Locks out atoms that are taken for free, while all rigid fixes weld them into one body."""
    atoms = {"molecule": np.array([0, 3, 3, 0, 1]), "mask": np.array([1, 1, 1, 1, 0])}
    said = {
        "groups": ["all"],
        "fixes": {},
        "commands": [],
        "run": "run 1",
        "skipped": 0,
        "step": 0,
        "left_out": [],
        "later": [],
    }
    body = rigid_atoms.number_bodies(said, atoms, "all", ["molecule"])
    assert body.tolist() == [1, 2, 2, 1, 0]
    line = "fix 1 all rigid/nve molecule"
    result = rigid_atoms.RigidAtoms(
        ("1",), (line,), "rigid/nve", "rigid", "all", "molecule", rigid_atoms.State(), body
    )
    stray = "The 2 atoms with molecule-ID 0"
    assert any(stray in one for one in candidates.describe(result, said, atoms))
    for name, values in ("molecule", [1, 3, 3, 2, 1]), ("mask", [0, 1, 1, 0, 1]):  # as advised
        other = atoms | {name: np.array(values)}
        body = rigid_atoms.number_bodies(said, other, "all", ["molecule"])
        result = replace(result, body=body)
        assert not any("molecule-ID 0" in one for one in candidates.describe(result, said, other))


ROWS = ("nosquish", "rigid/{}", "rigid/{}/small", "shake")
WORDS = {  # of the script's fix: which of these rows there are
    "rigid/nvt/small molecule temp 1 1 1 mol g": (0, 2),
    "nosquish/nvt molecule temp 1 1 1 seed 4 mol g": (0, 2),
    "rigid/nve molecule force * off on on torque 1 on on on": (0, 1),
    "rigid/nve/small molecule gravity down": (0, 1, 2),
    "rigid/nve/small molecule infile bodies": (0, 1, 2),
    "rigid/npt/small molecule temp 1 1 1 iso 1 1 1": (0, 1, 2, 3),
    "rigid/npt molecule temp 1 1 1 iso 1 1 1 dilate some": (0, 1, 2),
    "nosquish/nve molecule flexible rest": (0, 1, 2, 3),
}


@pytest.mark.parametrize("line", WORDS)
def test_keywords_go_into_all_rows_that_have_them(line):
    """Locks out rows of another system than the script's: molecules of a template that a fix
    inserts and no fix knows, bodies without their weight or with components that are switched on
    again, a box that leaves out other atoms. A fix without such a keyword has no row, and the
    reason is told."""
    ids = np.array([[1, 2], [3, 4]])
    atoms = {
        "molecule": np.array([1, 1, 2, 2, 3]),
        "mask": np.array([3, 3, 3, 3, 1]),
        "type": np.array([1, 1, 1, 1, 2]),
        "bonds": np.insert(ids, 0, 1, axis=1),
        "held_bonds": np.zeros(2, bool),
    }
    said = {"groups": ["all", "some"], "fixes": {"1": f"fix 1 some {line}"}, "commands": []}
    result = rigid_atoms.find(said, atoms)
    made, _, notes = candidates.integrators(result, "lj")
    lines = {one.name: one.lines[-1] for one in made}
    rows = [name.format(result.state.ensemble) for name in ROWS]
    assert [k for k, name in enumerate(rows) if name in lines] == [*WORDS[line]], lines
    kept, words = "".join(f" {word}" for word in result.keywords), line.split()
    assert [word.split()[0] for word in result.keywords] == [
        w for w in words if w in rigid_atoms.SHARED_KEYWORDS
    ]
    for name in rows[:3]:
        assert kept in lines.get(name, kept)
    assert ("dilate all" in lines["nosquish"]) == line.startswith("rigid/npt/small")
    assert line.startswith("nosquish") or "yours" not in lines  # each has a row already
    assert len([note for note in notes if note.startswith("No ")]) == 4 - len(WORDS[line])


def test_water_beside_a_molecule_that_shake_holds_in_part(tmp_path):
    """Locks out a rigid part that is none: shake holds a bond of a flexible molecule beside rigid
    water, as scripts of proteins do. Only the water becomes bodies; all begins with each line."""
    own = take(scripts.solute(tmp_path), tmp_path / "out")
    assert own.bodies == 27
    assert own.rigid.rest and own.rigid.holder
    assert (own.rigid.body[-4:] == 0).all()
    started(own, tmp_path / "out")


@pytest.mark.parametrize("ranks", [1, 2])
def test_bodies_by_an_atom_style_variable(ranks, tmp_path):
    """Locks out bodies that a variable tells and nobody reads, in LAMMPS's examples/rigid, or that
    are put to the wrong atoms where these are on two ranks."""
    told = "variable b atom 5*(id<=2)+2*(id>2)\n"
    mapped = GAS.replace("units lj\n", "units lj\natom_modify map yes\n")
    for one, other in (("1 1 1", "5 4 4"), ("2 1 1", "5 4.8 4"), ("4 4 4", "1 1 1"),
                       ("4 4.8 4", "2 1 1")):  # fmt: skip
        mapped = mapped.replace(f"single {one}", f"single  {other}", 1)
    path = written(tmp_path, mapped + told + "fix 1 all rigid/nve custom v_b\nrun 1\n")
    own = take(path, tmp_path / "out", ranks)
    assert own.rigid.body.tolist() == [2, 2, 1, 1]
    started(own, tmp_path / "out", ranks)


@pytest.mark.parametrize("ranks", [1, 2])
def test_noise_is_no_stiff_force(ranks, tmp_path):
    """Locks out a step that `check` calls too long for the noise of a thermostat, which is no
    spring: it adds twice the step over the damping time to the square of frequency x step. And
    a thermostat beside the bodies' fix that is not seen."""
    path, results = scripts.rings(tmp_path), []
    text = path.read_text()
    for line in "", "fix heat all langevin 300 300 1 11\nfix heat all langevin 300 300 2 11\n":
        path.write_text(text.replace("fix heat all langevin 300 300 200 11\n", line))
        own = take(path, tmp_path / "out", ranks)
        results.append(shapes.fastest_motions(own, shapes.body_groups(own)[0]))
        assert not any("store/force" in one for one in own.scene.setup + own.scene.then)
    quiet, noisy = results
    assert noisy == pytest.approx(quiet, rel=1e-9) and set(quiet) == {"centres", "turning"}
    assert "The temperature is controlled by fix heat (langevin)" in " ".join(own.notes)


def test_a_fix_of_ours_acts_on_the_group_of_its_class():
    """Locks out `check` that counts atoms as moved, or heated, which no fix touches: the class has
    a group and points of its own, and the fix's group says nothing."""
    said = {"groups": ["all", "bodies", "points"]}
    atoms = {"mask": np.array([3, 3, 5, 1])}
    words = {
        "rigid molecule": [True] * 4,
        'python/move "fix_nosquish.NVE bodies molecule"': [True, True, False, False],
        'python/move "fix_nosquish.HMC bodies molecule temp 1 every 9 seed 5"': [1, 1, 0, 0],
        'python/move "fix_nosquish.NVT bodies molecule temp 1 1 1 flexible points seed 5"': [
            1,
            1,
            1,
            0,
        ],
        'python/move "fix_nosquish.NVE bodies molecule moments step flexible points"': [1, 1, 1, 0],
        "nosquish/npt molecule temp 1 1 1 seed 5 iso 1 1 9 flexible points": [True] * 4,
        'python/move "other.Class bodies"': [True] * 4,
    }
    for text, wanted in words.items():
        assert rigid_atoms.atoms_of_fix(said, atoms, f"fix 1 all {text}").tolist() == list(
            map(bool, wanted)
        )


HELD = {  # two molecules of two atoms, whose bonds shake holds
    "mask": np.ones(4, int), "type": np.ones(4, int), "mass": np.ones(4),
    "molecule": np.array([1, 1, 2, 2]), "bonds": np.array([[1, 1, 2], [1, 3, 4]]),
    "held_bonds": np.ones(2, bool),
}  # fmt: skip


@pytest.mark.parametrize(
    ("lines", "name"),
    [
        (['python/move "fix_nosquish.NVT all molecule temp 1 1 2 seed 4928"'], "nosquish"),
        (
            ['python/move "fix_nosquish.NVT all  molecule seed 17 temp 1 1 2"'],
            "nosquish",
        ),
        (
            ['python/move "fix_nosquish.NVT all molecule tchain 3 thermostat nh temp 1 1 2"'],
            "nosquish-nh",
        ),
        (['python/move "fix_nosquish.NVT all molecule temp 1 1 2 seed 5 mrot 2"'], "yours"),
        (['python/move "fix_nosquish.NVT all molecule moments step temp 1 1 2 seed 5"'], "yours"),
        (['python/move "fix_nosquish.NVE all molecule"'], "nosquish"),
        (["nosquish/nvt molecule temp 1.0 1.0 2.0 seed 17"], "nosquish"),
        (["nosquish/nvt molecule temp 1 1 2 seed 17 mrot 2"], "yours"),
        (['python/move "fix_nosquish_validation.schemes.gear.Gear all molecule"'], "yours"),
        (["rigid/nvt/small molecule temp 1 1 2"], "rigid/nvt/small"),
        (["shake 1e-4 100 0 b 1", "nvt temp 1 1 2"], "shake"),
        (["nvt temp 1 1 2", "shake 0.0001 100 0 b 1"], "shake"),
        (["shake 1e-6 100 0 b 1", "nvt temp 1 1 2"], "yours"),
        (["nvt temp 1 1 2", "rattle 1e-4 100 0 b 1"], "rattle"),
        (["rattle 1e-4 100 0 b 1", "nvt temp 1 1 2"], "yours"),  # another order, another motion
    ],
)
def test_a_scripts_own_integrator_stands_in_the_table_once(lines, name):
    """Locks out two rows of one trajectory, of which one takes another integrator's place: its
    fixes say the same as ours in other words, in another order, or with another seed."""
    fixes = {str(i): f"fix {i} all {line}" for i, line in enumerate(lines, 1)}
    said = {"groups": ["all"], "fixes": fixes, "commands": [*fixes.values()]}
    result = rigid_atoms.find(said, HELD)
    assert result.state.ensemble == ("nve" if "temp" not in " ".join(lines) else "nvt")
    those, reference, _ = candidates.integrators(result, "lj")
    assert reference == those[0].name == name
    assert len({one.name for one in those}) == len(those)
    assert sum(one.name == "yours" for one in those) == (name == "yours")


SEVERAL = {  # fixes of the script, what is asked for, and an ID that may be chosen
    "two rigid fixes": (["left rigid molecule", "right rigid molecule"], {}, "2"),
    "a fix that moves nothing": (["all rigid molecule", "all momentum 1"], {"fix": ["2"]}, "1"),
    "no bodies": (["all nve"], {"group": "all"}, "1"),
    "fixes for parts": (["all shake 1e-4 9 0 b 1", "left nve", "right nve"], {}, "2"),
}


@pytest.mark.parametrize("which", SEVERAL)
def test_options_that_refusals_advise_select_a_fix(which):
    """Locks out options that a message advises and that lead nowhere."""
    lines, ask, fix_id = SEVERAL[which]
    fixes = {str(i): f"fix {i} {line}" for i, line in enumerate(lines, 1)}
    said = {"groups": ["all", "left", "right"], "fixes": fixes, "commands": [*fixes.values()]}
    atoms, refusals, result = HELD | {"mask": np.array([3, 3, 5, 5])}, [], None
    while result is None and len(refusals) < 3:
        try:
            words = ask.get("fix", ()), ask.get("group"), ask.get("bodies")
            result = rigid_atoms.find(said, atoms, *words)
        except rigid_atoms.AmbiguousScript as refusal:
            refusals.append(str(refusal))
            ask = ask | advised(refusals[-1], ID=fix_id)
    assert refusals and result and fix_id in result.ids, refusals
    alone = said | {"fixes": {"1": "fix 1 all shake 1e-4 9 0 b 1"}}
    with pytest.raises(rigid_atoms.AmbiguousScript, match=r"move the rigid atoms: no fix$"):
        rigid_atoms.find(alone, atoms)


LOOSE = {  # fixes of water, which no rigid fix and no molecule-ID makes bodies of
    "no rigid fix": "fix 1 all nvt temp 298 298 100",
    "one molecule-ID": "set group all mol 1\nfix 1 all shake 1e-6 100 0 b 1 a 1\n"
    "fix 2 all nvt temp 298 298 100",
}


@pytest.mark.parametrize("which", LOOSE)
def test_bodies_are_made_as_refusals_advise(which, tmp_path, capsys):
    """Locks out options and a command that a message advises, and after which the script is refused
    again."""
    path = scripts.spce(tmp_path, LOOSE[which], number=2)
    with pytest.raises(SystemExit) as end:
        take(path, tmp_path / "out")
    message = str(end.value)
    ask = advised(message, GROUP="all")
    assert ("group" in ask) == (which == "no rigid fix")
    if "group" in ask:
        assert take(path, tmp_path / "out", **ask).bodies == 8
    (words,) = re.findall("'nosquish (check SCRIPT --rigid)'", message)
    words = [str(path) if word == "SCRIPT" else word for word in words.split()]
    assert main([*words, "--out", str(tmp_path / "out")]) == 0
    path.write_text(with_lines(path.read_text(), capsys.readouterr().out))
    assert take(path, tmp_path / "out").bodies == 8


@pytest.mark.parametrize("tilts", ["tri 1 1 9", "aniso 1 1 9 xy 0 0 9"])
def test_a_box_that_changes_its_angles_has_no_rigid_fix(tilts):
    """Locks out a script with tilts that none answers for, a rigid fix that takes none, and one
    of ours or shake in a box whose angles stay."""
    line = f"npt temp 1 1 2 {tilts}"
    fixes = {"1": "fix 1 all shake 1e-4 100 0 b 1", "2": f"fix 2 all {line}"}
    said = {"groups": ["all"], "fixes": fixes, "commands": [*fixes.values()]}
    result = rigid_atoms.find(said, HELD)
    assert result.state.ensemble == "npt" and result.state.tilts
    those, reference, notes = candidates.integrators(result, "real")
    assert reference == "shake"
    assert {one.kind for one in those} == {"ours", "constraints"}
    assert all(tilts in " ".join(one.lines) for one in those)
    assert sum("angles of a box" in one for one in notes) == 1
    plain = rigid_atoms.state_of(["temp", "1", "1", "2", "aniso", "1", "1", "9"])[0]
    assert not plain.tilts


def test_native_styles_are_ours():
    """Locks out a script with a native style whose fix the harness takes for another's, or whose
    group and words it reads at other places than those in quotes; and quotes in what is printed."""
    words = "custom i_a temp 1.5 1.5 2.0 seed 5 mrot 2"
    native = f"fix 1 water nosquish/nvt {words}"
    quoted = f'fix 1 all python/move "fix_nosquish.NVT water {words}"'
    wanted = "NVT", "water", ("custom", "i_a"), tuple(words.split()[2:])
    assert rigid_atoms.parse_fix(native) == rigid_atoms.parse_fix(quoted) == wanted
    for one in quoted, native:
        assert rigid_atoms.kind_of(one) == "ours"
    spaced = 'fix 1 water nosquish/nve group 1 a infile "a b"'
    assert rigid_atoms.parse_fix(spaced).fix("1") == spaced
    # which has no fix style
    old = 'fix 1 a python/move "fix_nosquish_validation.schemes.gear.Gear a molecule"'
    assert (
        rigid_atoms.parse_fix('fix 1 a python/move "fix_nosquish.Gear a molecule"').fix("1") == old
    )
    others = "", "run 5", "fix 1 water", "fix 1 water nve", 'fix 1 a python/move "mine.NVE a b"'
    assert not any(map(rigid_atoms.parse_fix, others))


def test_reports_of_rigid_fixes():
    """Locks out runs that fail because computes of rigid fixes stay without such a fix, and
    commands that act on atoms left out with them."""
    output = [
        "variable early equal c_k*2",
        "compute k all ke/rigid 1",
        "fix a all ave/time 1 1 1 v_early file o",
        "fix_modify a energy no",
    ]
    others = ["compute t all temp", "compute e all erotate/rigid 2", "fix 1 all rigid molecule"]
    lines = [*output, *others, "thermo_style custom step c_k"]
    assert commands.rigid_reports(lines, ["1"]) == output
    assert commands.rigid_reports([*lines, "fix q all langevin v_early 1 1 1"], ["1"]) == []
