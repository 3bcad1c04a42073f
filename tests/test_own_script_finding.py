"""What moves the bodies of a user's script, and what the bodies are, held against what is known of
the scripts that `scripts` writes.
"""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scripts
from conftest import Silent
from own_scripts import GAS, refused, take
from scipy.sparse.csgraph import shortest_path

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from validation.__main__ import main
from validation.bodies import lines as bodies
from validation.bodies import parts
from validation.check import measure as check
from validation.own import finding, schemes, shapes
from validation.running import lammps_log
from validation.scenes.integrators import Integrator
from validation.statistics import measures


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
    body = finding.numbers(said, atoms, "all", ["molecule"])
    assert body.tolist() == [1, 2, 2, 1, 0]
    line = "fix 1 all rigid/nve molecule"
    found = finding.Found(
        ("1",), (line,), "rigid/nve", "rigid", "all", "molecule", finding.State(), body
    )
    assert any(
        "The 2 atoms with molecule-ID 0" in one for one in schemes.summary(found, said, atoms)
    )


def test_another_fix_that_keeps_the_temperature_is_named(taken):
    """Locks out a thermostat beside the bodies' fix that is not seen: "Ensemble: NVE", alone."""
    lines = " ".join(taken("rings").notes)
    assert (
        "compared at constant energy (NVE). The temperature is kept by fix heat (langevin)" in lines
    )
    assert "Ensemble: NVE" not in lines
    assert any(one.startswith("Ensemble: NVT (temp ") for one in taken("spce").notes)


def test_water_beside_a_molecule_that_shake_holds_in_part(tmp_path):
    """Locks out a rigid part that is none: shake holds a bond of a flexible molecule beside rigid
    water, as scripts of proteins do. Only the water becomes bodies; all begins with each line."""
    path = scripts.solute(tmp_path)
    own = take(path, tmp_path / "out")
    assert own.bodies == 27
    assert own.found.rest and own.found.holder
    assert (own.found.body[-4:] == 0).all()
    rows, _ = check._starts(own, tmp_path / "out", 1, 300.0, Silent())
    assert [row["error"] for row in rows] == [None] * len(rows)


def test_flexible_water_is_made_rigid_by_options(tmp_path):
    """Locks out a script without rigid fix that --group and --bodies do not make rigid."""
    path = scripts.spce(tmp_path, fix="group w type 1 2\nfix move all nve", number=3)
    assert "no run of the script has a fix" in refused(
        path.read_text().replace("parts/", f"{tmp_path}/parts/"), tmp_path
    )
    own = take(path, tmp_path / "own", group="w", bodies="molecule")
    assert own.bodies == 27 and own.reference == "nosquish"


@pytest.mark.parametrize("ranks", [1, 2])
def test_bodies_by_an_atom_style_variable(ranks, tmp_path):
    """Locks out bodies that a variable tells and nobody reads, in LAMMPS's examples/rigid, or that
    are put to the wrong atoms where these are on two ranks."""
    path = tmp_path / "in.variable"
    told = "variable b atom 5*(id<=2)+2*(id>2)\n"
    mapped = GAS.replace("units lj\n", "units lj\natom_modify map yes\n")
    for one, other in (("1 1 1", "5 4 4"), ("2 1 1", "5 4.8 4"), ("4 4 4", "1 1 1"),
                       ("4 4.8 4", "2 1 1")):  # fmt: skip
        mapped = mapped.replace(f"single {one}", f"single  {other}", 1)
    path.write_text(mapped + told + "fix 1 all rigid/nve custom v_b\nrun 1\n")
    own = take(path, tmp_path / "out", ranks)
    assert own.found.body.tolist() == [2, 2, 1, 1]
    rows, _ = check._starts(own, tmp_path / "out", ranks, 300.0, Silent())
    assert [row["error"] for row in rows] == [None] * len(rows)


def test_shapes_of_known_bodies(tmp_path):
    """Locks out a moment, a size or a number of degrees of freedom that is not the body's own."""
    own = take(scripts.co2(tmp_path), tmp_path / "out")
    (kind,) = shapes.kinds(own, shapes.bodies(own))
    assert (kind.number, kind.atoms, kind.shape, kind.freedom) == (125, 3, "linear", 5)
    assert kind.size == pytest.approx(2.32, rel=1e-9)
    assert kind.moments[0] == pytest.approx(2 * 15.999 * 1.16**2, rel=1e-9)
    kt = 0.0019872067 * 250 / 2390.0573615334906
    assert kind.angle == pytest.approx(2 * np.sqrt(kt / kind.moments[0]), rel=1e-6)


@pytest.mark.parametrize("ranks", [1, 2])
def test_noise_is_no_stiff_force(ranks, tmp_path):
    """Locks out a step that `check` calls too long for the noise of a thermostat, which is no
    spring: it adds twice the step over the damping time to the square of frequency x step."""
    path, found = scripts.rings(tmp_path), []
    text = path.read_text()
    for line in "", "fix heat all langevin 300 300 1 11\nfix heat all langevin 300 300 2 11\n":
        path.write_text(text.replace("fix heat all langevin 300 300 200 11\n", line))
        own = take(path, tmp_path / "out", ranks)
        found.append(shapes.fastest(own, shapes.bodies(own)))
        assert not any("store/force" in one for one in own.scene.setup + own.scene.then)
    quiet, noisy = found
    assert noisy == pytest.approx(quiet, rel=1e-9) and set(quiet) == {"centres", "turning"}


def test_sizes_and_nearest_atoms_of_large_bodies(taken):
    """Locks out memory that grows as the square of a body's atoms, a size that is not a body's, and
    nearest atoms that are of one body, bonded, or not the nearest."""
    random = np.random.default_rng(8)
    for shape in ((1, 1, 1), (5, 1, 1), (3, 3, 0.01), (1, 0, 0)):
        small = random.normal(size=(7, 30, 3)) * shape
        apart = np.linalg.norm(small[:, :, None] - small[:, None], axis=3)
        assert shapes.width(small) == pytest.approx(apart.max())
        large = random.uniform(-1, 1, size=(3, 400, 3)) * shape
        apart = np.linalg.norm(large[:, :, None] - large[:, None], axis=3)
        assert 0.95 * apart.max() < shapes.width(large) <= apart.max() * (1 + 1e-12)
    assert shapes.width(np.zeros((5, 1, 3))) == 0.0
    huge = random.normal(size=(2, 20_000, 3))
    assert shapes.width(huge) > 2 * np.linalg.norm(huge, axis=2).max() * 0.8
    own = taken("rings")
    edge, places = own.said["cell"][0][0], own.atoms["x"]
    for number, seed in ((1, 0), (60, 1), (300, 2)):  # atoms of each body
        random = np.random.default_rng(seed)
        body = np.arange(len(places)) // number + 1
        x = random.uniform(0, edge, size=places.shape)
        if number != 60:
            body[:20] = 0
        else:  # dense ones, each far from the next: the nearest are of the same body
            x = edge * body[:, None] / (1 + body.max()) + random.uniform(0, 0.5, size=x.shape)
        x[1] = x[0] + 1e-4  # bonded, and in no body
        bonds = np.array([[1, 1, 2]])
        made = replace(own, found=replace(own.found, body=body),
                       atoms=own.atoms | {"x": x, "bonds": bonds})  # fmt: skip
        near = measures.nearest_image(x[:, None] - x, np.array(own.said["cell"]), [True] * 3)
        apart = np.linalg.norm(near, axis=2)
        apart[(body[:, None] == body) & (body > 0)] = np.inf
        apart[np.diag_indices(len(x))] = apart[0, 1] = apart[1, 0] = np.inf
        distance, i, j = shapes.nearest(made)
        assert distance == pytest.approx(apart.min()) == pytest.approx(apart[i - 1, j - 1])


def test_rigid_parts_are_found_by_their_chemistry(tmp_path):
    """Locks out a part that is none, or one that is missed: toluene, methylammonium, cyclohexane
    and water, held against what chemistry says of them."""
    number, bonds, mass, x = 0, [], [], []

    def atom(element, place, to=None):
        nonlocal number
        number += 1
        mass.append(parts.ELEMENTS[element])
        x.append(place)
        if to:
            bonds.append((1, to, number))
        return number

    corners = 1.39 * np.array([[np.cos(a), np.sin(a), 0] for a in np.arange(6) * np.pi / 3])
    ring = [atom("C", place) for place in corners]
    bonds += [(1, a, b) for a, b in zip(ring, ring[1:] + ring[:1])]
    hydrogens = [atom("H", 1.8 * place, at) for place, at in zip(corners[1:], ring[1:])]
    methyl = atom("C", 2.1 * corners[0], ring[0])
    of_methyl = [atom("H", [3.3, y, z], methyl) for y, z in ((1, 0), (-0.5, 0.9), (-0.5, -0.9))]
    carbon = atom("C", [10, 0, 0])
    nitrogen = atom("N", [11.5, 0, 0], carbon)
    for at in carbon, nitrogen:
        for place in range(3):
            atom("H", [10.5 + place, 1, 1], at)
    chair = [atom("C", place + np.array([0, 10, (-1) ** i / 4])) for i, place in enumerate(corners)]
    bonds += [(1, a, b) for a, b in zip(chair, chair[1:] + chair[:1])]
    for at in chair:
        atom("H", [0, 12, 1], at), atom("H", [0, 12, -1], at)
    water = [atom("O", [0, 0, 9])]
    water += [atom("H", [1, 0, 9], water[0]), atom("H", [0, 1, 9], water[0])]
    atoms = {"mass": np.array(mass), "x": np.array(x, float), "bonds": np.array(bonds)}
    body, counts = parts.rigid(atoms, 40 * np.eye(3), [True] * 3)
    assert counts == {"water": 1, "CH3": 2, "NH3": 1, "rings": 1}
    found = {frozenset(1 + np.flatnonzero(body == one)) for one in range(1, 6)}
    assert {frozenset(ring + hydrogens), frozenset([methyl, *of_methyl]), frozenset(water)} < found
    assert body.max() == 5 and not body[np.array(chair) - 1].any()
    _, counts = parts.rigid(atoms, 40 * np.eye(3), [True] * 3, ["CH3"])
    assert counts == {"CH3": 2}


def test_a_data_file_with_bodies_is_read_by_lammps(tmp_path, capsys):
    """Locks out a data file that LAMMPS or our fix does not read as it was meant, or bodies of one
    kind that differ: flexible water, distorted, becomes bodies of one shape."""
    path = scripts.spce(tmp_path, fix="fix move all nve", number=3)
    field = tmp_path / "parts" / "spce.ff"  # the data file's coefficients have to go with it
    field.write_text(field.read_text().replace("bond_style harmonic\nbond_coeff 1 0 1.0\n", ""))
    with open(tmp_path / "parts" / "spce.data", "a") as file:
        file.write("\nBond Coeffs # harmonic\n\n1 0 1.0\n")
    text = path.read_text().replace("read_data", "bond_style harmonic\nread_data")
    path.write_text(text)
    assert main(["bodies", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "27 × water" in capsys.readouterr().out
    (tmp_path / "spce.data").write_bytes((tmp_path / "out" / "spce.data").read_bytes())
    lines = bodies.reads("property", "spce.data", bodies.Names())
    assert "group bodies variable is_in" in lines
    text = text.replace("read_data parts/spce.data", "\n".join(lines))
    moving = "fix move bodies nosquish/nve custom i_body"
    text = text.replace("fix move all nve", moving)
    again = tmp_path / "in.again"
    again.write_text(text)
    own = take(again, tmp_path / "again")
    assert own.bodies == 27 and own.found.bodies == "custom i_body"
    (kind,) = shapes.kinds(own, shapes.bodies(own))
    assert kind.number == 27 and kind.scatter < 1e-6


TEMPLATE = """water

3 atoms
2 bonds
1 angles

Coords

1 0 0 0
2 0.8165 0.5774 0
3 -0.8165 0.5774 0

Types

1 1
2 2
3 2

Charges

1 -0.8476
2 0.4238
3 0.4238

Bonds

1 1 1 2
2 1 1 3

Angles

1 1 2 1 3
"""
FORCES = "include parts/spce.ff\n"
PAIRS = "pair_style lj/cut/coul/cut 6.0"
HEAD, TAIL = "units real\natom_style full\n", "timestep 1\nfix 1 all nvt temp 298 298 100\nrun 3\n"
MADE = {  # of scripts, what makes their atoms, and the number of bodies
    "replicate": (f"{HEAD}read_data parts/spce.data\nreplicate 2 1 1\n{FORCES}", 54),
    "restart": ("read_restart parts/water.restart\nvelocity ox scale 298\n", 27),
    "restart and its pair style": (f"read_restart parts/water.restart\n{PAIRS}\n", 27),
    "molecules": (
        f"{HEAD}region box block 0 12 0 12 0 12\ncreate_box 2 box bond/types 1 angle/types 1 "
        "extra/bond/per/atom 2 extra/angle/per/atom 1 extra/special/per/atom 2\nmass 1 15.9994\n"
        "mass 2 1.008\nmolecule w parts/water.mol\nlattice sc 4.0 origin 0.5 0.5 0.5\n"
        f"create_atoms 0 box mol w 4567\ngroup some molecule 1:9\n"
        f"displace_atoms some move 0.3 0 0\n{FORCES}", 27,
    ),
    "groups": (
        f"{HEAD}fix tag all property/atom i_tag\nread_data parts/spce.data group solvent "
        f"extra/bond/per/atom 1\nset group all i_tag 7\n{FORCES}group few molecule 1:3\n"
        "delete_atoms group few\nreset_atoms id\nvelocity solvent create 298 1\n", 24,
    ),
}  # fmt: skip


def with_lines(text, told):
    """A script with what ``bodies`` tells of it: commands that go, and lines in the place of the
    first of them and of the last fix that goes."""
    kept, gone, made, now = text.splitlines(), [], {"first": [], "fix": []}, None
    fixes, lost = [], []
    for line in told.splitlines():
        if line.startswith("    "):
            now.append(line.strip())
        elif "commands of the script, which all go:" in line:
            now = gone
        elif "the place of" in line:
            fixes = re.findall(r"fix (\S+) \(", line)
            now = made["fix" if fixes else "first"]
        elif line.startswith("These name a fix that goes"):
            lost = line.rstrip(".").partition("have to go, too: ")[2].split("; ")
    own = [line for line in kept if line.startswith("fix ") and line.split()[1] in fixes]
    assert len(own) == len(fixes) > 0
    gone = gone or [line for line in kept if line.startswith("read_data")]
    places = sorted(kept.index(line) for line in gone)
    assert len(places) == len(gone)
    kept[places[0]] = "\n".join(made["first"])
    kept[kept.index(own[-1])] = "\n".join(made["fix"])
    kept = [line for line in kept if line not in (*gone, *own, *lost)]
    return "\n".join(kept) + "\n"


@pytest.mark.parametrize("kind", MADE)
def test_lines_for_bodies_run_whatever_makes_the_atoms(kind, tmp_path, run_lammps, capsys):
    """Locks out lines that LAMMPS refuses, and bodies that are there twice, where a script's atoms
    are not read_data's alone: copies, molecules of a template, a restart file, and atoms that are
    deleted; and groups, styles and coefficients that go with the command that had them."""
    scripts.spce(tmp_path, number=3)
    (tmp_path / "parts" / "water.mol").write_text(TEMPLATE)
    if kind.startswith("restart"):
        run_lammps(
            f"{HEAD}read_data parts/spce.data\n{FORCES}velocity all create 298 1\n"
            "group ox type 1\ngroup some id 1:4 9\ngroup none empty\n"
            "write_restart parts/water.restart\n"
        )
    text, number = MADE[kind][0] + TAIL, MADE[kind][1]
    (tmp_path / "in.made").write_text(text)
    assert main(["bodies", str(tmp_path / "in.made"), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    changed = with_lines(text, told)
    if kind == "restart":
        assert "words behind pair_style lj/cut/coul/cut" in told
        changed = changed.replace("include /", f"{PAIRS}\ninclude /")
    log = run_lammps(f"{changed}print 'atoms $(atoms) $(step)'\n").log
    assert f"atoms {3 * number} 3" in log and f"{number} rigid bodies" in log
    own, new = (lammps_log.thermo(one)["E_pair"][0] for one in (run_lammps(text).log, log))
    assert new == pytest.approx(own, rel=1e-6)


MOVES = {  # of scripts with water and a solute of four atoms, fixes; and what has to be printed
    "nve": ("fix 1 all nve", [
        "group points subtract all bodies",
        'fix 1 bodies nosquish/nve custom i_body',
        "fix 1_points points nve",
    ]),
    "langevin": ("fix 1 all nve\nfix 2 all langevin 300 300 100 5", ["fix 1_points points nve"]),
    "chains": ("fix 1 all nvt temp 300.5 300.5 100 tchain 5", [
        'fix 1 bodies nosquish/nvt custom i_body temp 300.5 300.5 100'
        ' thermostat nh tchain 5',
        "fix 1_points points nvt temp 300.5 300.5 100 tchain 5",
    ]),
    "shake": ("fix 4 all shake 1e-6 200 0 b 1 3 a 1\nfix 1 all nvt temp 300 300 100", [
        "group points_4 subtract all bodies",
        "fix 4 points_4 shake 1e-6 200 0 b 1 3 a 1",
        "fix 1_points points nvt temp 300 300 100",
    ]),
    "shake of water alone": (
        "fix 4 all shake 1e-6 200 0 b 1 a 1\nfix_modify 4 virial yes\n"
        "fix 1 all nvt temp 300 300 100", ["fix 1_points points nvt temp 300 300 100"],
    ),
    "shake of the solute": (
        "group solute type 3\nfix 4 solute shake 1e-6 200 0 b 2\nfix 1 all nve",
        ["fix 1_points points nve"],
    ),
    "rattle": ("fix 1 all nve\nfix 4 all rattle 1e-6 200 0 b 1 3 a 1", [
        "fix 4 points_4 rattle 1e-6 200 0 b 1 3 a 1",
    ]),
    "pressure": ("fix 1 all npt temp 300 300 100 iso 1 1 1000 drag 0.2", [
        'fix 1 bodies nosquish/npt custom i_body temp 300 300 100 '
        'iso 1 1 1000 thermostat nh barostat mtk points points',
    ]),
    "pressure and shake": (
        "fix 4 all shake 1e-6 200 0 b 1 3 a 1\nfix 1 all npt temp 300 300 100 iso 1 1 1000\n"
        "compute_modify 1_temp extra/dof 3", [
            "fix 4 points_4 shake 1e-6 200 0 b 1 3 a 1",
            "fix 1_points points nvt temp 300 300 100",
            'fix 1 bodies nosquish/npt custom i_body temp 300 300 100 '
            'iso 1 1 1000 thermostat nh barostat mtk dilate others',
        ],
    ),
    "enthalpy": ("fix 1 all nph iso 1 1 1000", [
        'fix 1 bodies nosquish/nph custom i_body iso 1 1 1000 '
        'points points',
    ]),
    "a part stands still": ("group frozen id 82\ngroup mobile subtract all frozen\n"
        "fix 1 mobile nve", ["group points subtract mobile bodies", "fix 1_points points nve"],
    ),
    "a part stands still, at constant pressure": (
        "group frozen id 82\ngroup mobile subtract all frozen\n"
        "fix 1 mobile npt temp 300 300 100 iso 1 1 1000",
        ["group others subtract all bodies points"],
    ),
    "two fixes": ("group water molecule 1:27\ngroup solute subtract all water\n"
        "fix 1 water nvt temp 300 300 100\nfix 2 solute nvt temp 280 280 50", [
            'fix 1 bodies nosquish/nvt custom i_body temp 300 300 100 '
            'thermostat nh',
    ]),
    "names that are taken": ("group bodies type 3\ngroup points id 1\nfix 1 all nve", [
        "group own_points subtract all own_bodies",
        'fix 1 own_bodies nosquish/nve custom i_body',
    ]),
    "rigid": ("group water molecule 1:27\ngroup solute subtract all water\nfix 2 solute nve\n"
        "fix 1 water rigid/nvt/small molecule temp 300 300 100 tparam 4 1 3", [
            'fix 1 bodies nosquish/nvt custom i_body temp 300 300 100 '
            'thermostat nh tchain 4',
    ]),
    "rigid and noise": ("group water molecule 1:27\ngroup solute subtract all water\n"
        "fix 2 solute nve\nfix 1 water rigid/small molecule langevin 300 300 100 77", [
            'fix 1 bodies nosquish/nvt custom i_body temp 300 300 100 '
            'seed 4928',
    ]),
    "ours": (
        "group water molecule 1:27\ngroup solute subtract all water\n"
        "fix 1 water nosquish/npt molecule temp 300 300 100 seed 8 iso 1.5 1.5 1000 every 5 "
        "points solute", [
            "group points subtract solute bodies",
            "fix 1 bodies nosquish/npt custom i_body temp 300 300 100 seed 8 iso 1.5 1.5 1000 "
            "every 5 points points",
    ]),
    "ours in quotes": (
        "group water molecule 1:27\ngroup solute subtract all water\n"
        'fix 1 all python/move "fix_nosquish.NVT water molecule temp 300 300 100 seed 8 mrot 2 '
        'points solute"', [
            "group points subtract solute bodies",
            "fix 1 bodies nosquish/nvt custom i_body temp 300 300 100 seed 8 mrot 2 points points",
    ]),
}  # fmt: skip


@pytest.mark.parametrize("which", MOVES)
def test_what_bodies_prints_runs_as_it_is(which, tmp_path, run_lammps, capsys):
    """Locks out lines that our fix or LAMMPS refuses, and motion that is another one without a
    word: a thermostat of another kind, what shake held, atoms that stood still."""
    text = scripts.solute(tmp_path).read_text()
    (first,) = [line for line in text.splitlines() if line.startswith("fix hold")]
    (second,) = [line for line in text.splitlines() if line.startswith("fix move")]
    fixes, lines = MOVES[which]
    text = text.replace(f"{first}\n{second}", fixes).replace("run 100", "run 20")
    text = text.replace("timestep 1", "timestep 0.5\ncompute d all displace/atom\nthermo 10\n"
        "compute far all reduce max c_d[4]\ngroup one id 82\ncompute still one reduce max c_d[4]\n"
        "thermo_style custom step temp press pe etotal econserve c_far c_still")  # fmt: skip
    (tmp_path / "in.solute").write_text(text)
    assert main(["bodies", str(tmp_path / "in.solute"), "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    printed = [line.strip() for line in told.splitlines() if line.startswith("    ")]
    assert not [line for line in lines if line not in printed], printed
    done = run_lammps(with_lines(text, told), options=("-log", "log.lammps"))
    assert "27 rigid bodies with 81 atoms" in done.log
    rows = done.thermo
    assert rows["Step"][-1] == 20 and rows["c_far"][-1] > 0.01
    stands = "stands still" in which and "pressure" not in which
    assert (rows["c_still"][-1] == 0) == stands
    holds = which in ("shake", "rattle", "pressure and shake")
    assert bool(re.search(r"^ *2 = # of size 2 clusters$", done.log, re.M)) == holds
    assert ("keywords that ours does not have: drag 0.2" in told) == (which == "pressure")


def test_lines_for_bodies_say_what_they_cannot(tmp_path, capsys):
    """Locks out parts that nothing holds together, and constraints that are lost without a word."""
    path = scripts.rings(tmp_path)
    text = path.read_text().replace("fix bodies all rigid/nve/small molecule", "fix 1 all nve")
    path.write_text(text)
    (tmp_path / "rings.data").write_text(
        (tmp_path / "rings.data").read_text().replace("13.019", "12.011")
    )
    assert main(["bodies", str(path), "--out", str(tmp_path / "out"), "--parts", "rings"]) == 0
    assert "bond_style zero" not in capsys.readouterr().out  # whole molecules
    said = {"commands": ["bond_style zero"]}
    atoms = {"bonds": np.array([[1, 1, 2], [1, 2, 3]])}
    assert bodies._torn(said, atoms, np.array([1, 1, 0]))
    atoms |= {"type": [1, 1, 1], "mask": np.ones(3, int), "held_bonds": np.ones(2, bool)}
    said |= {"groups": ["all"]}
    shake = "fix 1 all shake 1e-4 100 0 b 1"
    (told,) = bodies._cut(said, atoms, "1", shake, np.array([True, True, False]))
    assert told.startswith("Fix 1 holds 1 bonds between bodies and other atoms")
    rigid = "fix 1 all rigid/nvt/small molecule temp 1 1 1"
    assert finding.kept_by(rigid) == finding.State(("1", "1", "1"))


@pytest.mark.parametrize("name", ["Zürich", "two words", 'a"b'])
def test_bodies_in_folders_with_other_letters(name, tmp_path, run_lammps, capsys):
    """Locks out a data file that LAMMPS cannot write or find by the printed line."""
    place = tmp_path / name
    place.mkdir()
    text = scripts.spce(place, fix="fix 1 all nve", number=3).read_text()
    assert main(["bodies", str(place / "in.spce"), "--out", str(place / "out")]) == 0
    changed = with_lines(text, capsys.readouterr().out)
    (place / "in.changed").write_text(changed.replace("run 100", "run 2"))
    command = [str(Path(sys.executable).with_name("lmp")), "-in", "in.changed", "-log", "log"]
    subprocess.run(command, cwd=place, check=True, stdout=subprocess.DEVNULL)
    assert "27 rigid bodies" in (place / "water.log").read_text()


def test_bonded_pairs():
    """Locks out pairs that are counted twice, at another distance than the shortest one, or over
    atoms of other bodies."""
    rng = np.random.default_rng(5)
    body = np.repeat([0, 1, 2, 3], [3, 7, 6, 5])
    bonds = np.unique(np.sort(rng.integers(1, len(body) + 1, size=(22, 2)), axis=1), axis=0)
    bonds = bonds[bonds[:, 0] < bonds[:, 1]]
    graph = np.zeros((len(body), len(body)))
    graph[tuple(bonds.T - 1)] = 1
    apart = shortest_path(graph, directed=False, unweighted=True)
    same = (body[:, None] == body) & (body > 0) & np.triu(np.ones_like(graph, dtype=bool), 1)
    found = finding.bonded_pairs(np.insert(bonds, 0, 1, axis=1), body)
    assert found.tolist() == [np.sum(apart[same] == one) for one in (1, 2, 3)]
    assert found.min() > 0


def test_a_fix_of_ours_acts_on_the_group_of_its_class():
    """Locks out `check` that counts atoms as moved, or heated, which no fix touches: the class has
    a group and points of its own, and the fix's group says nothing."""
    said = {"groups": ["all", "bodies", "points"]}
    atoms = {"mask": np.array([3, 3, 5, 1])}
    words = {
        "rigid molecule": [True] * 4,
        'python/move "fix_nosquish.NVE bodies molecule"': [True, True, False, False],
        'python/move "fix_nosquish.HMC bodies molecule temp 1 every 9 seed 5"': [1, 1, 0, 0],
        'python/move "fix_nosquish.NVT bodies molecule temp 1 1 1 points points seed 5"': [
            1,
            1,
            1,
            0,
        ],
        'python/move "fix_nosquish.NVE bodies molecule moments step points points"': [1, 1, 1, 0],
        "nosquish/npt molecule temp 1 1 1 seed 5 iso 1 1 9 points points": [True] * 4,
        'python/move "other.Class bodies"': [True] * 4,
    }
    for text, wanted in words.items():
        assert finding.acted_on(said, atoms, f"fix 1 all {text}").tolist() == list(
            map(bool, wanted)
        )


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
    atoms = {"mask": np.ones(4, int), "type": np.ones(4, int), "mass": np.ones(4),
             "molecule": np.array([1, 1, 2, 2]),
             "bonds": np.array([[1, 1, 2], [1, 3, 4]]),
             "held_bonds": np.ones(2, bool)}  # fmt: skip
    said = {"groups": ["all"], "fixes": fixes, "commands": [*fixes.values()]}
    found = finding.find(said, atoms)
    assert found.state.ensemble == ("nve" if "temp" not in " ".join(lines) else "nvt")
    those, reference, _ = schemes.schemes(found, "lj")
    assert reference == those[0].name == name
    assert len({one.name for one in those}) == len(those)
    assert sum(one.name == "yours" for one in those) == (name == "yours")


@pytest.mark.parametrize("tilts", ["tri 1 1 9", "aniso 1 1 9 xy 0 0 9"])
def test_a_box_that_changes_its_angles_has_no_rigid_fix(tilts):
    """Locks out a script with tilts that none answers for, a rigid fix that takes none, and one
    of ours or shake in a box whose angles stay."""
    line = f"npt temp 1 1 2 {tilts}"
    fixes = {"1": "fix 1 all shake 1e-4 100 0 b 1", "2": f"fix 2 all {line}"}
    atoms = {"mask": np.ones(4, int), "type": np.ones(4, int), "mass": np.ones(4),
             "molecule": np.array([1, 1, 2, 2]),
             "bonds": np.array([[1, 1, 2], [1, 3, 4]]),
             "held_bonds": np.ones(2, bool)}  # fmt: skip
    said = {"groups": ["all"], "fixes": fixes, "commands": [*fixes.values()]}
    found = finding.find(said, atoms)
    assert found.state.ensemble == "npt" and found.state.tilts
    those, reference, notes = schemes.schemes(found, "real")
    assert reference == "shake"
    assert {one.kind for one in those} == {"ours", "constraints"}
    assert all(tilts in " ".join(one.lines) for one in those)
    assert sum("angles of a box" in one for one in notes) == 1
    made = bodies.moves("molecule", said, atoms, np.array([1, 1, 2, 2]), bodies.Names())
    (own,) = made.lines
    assert own.startswith("fix 2 bodies nosquish/npt molecule temp 1 1 2") and tilts in own
    assert [*made.gone] == ["1", "2"]
    plain = finding.state_of(["temp", "1", "1", "2", "aniso", "1", "1", "9"])[0]
    assert not plain.tilts


def test_kinds_of_fixes():
    """Locks out a fix that is taken for another kind."""
    known = {
        "fix 1 all rigid/nvt/small molecule temp 1 1 1": "rigid",
        "fix 1 all rigid/small/omp molecule": "rigid",
        'fix 1 all python/move "fix_nosquish.NVT all molecule temp 1 1 1"': "ours",
        "fix 1 all python/move other.Class": None,
        "fix 1 all shake 1e-4 20 0 b 1": "constraints",
        "fix 1 all npt temp 1 1 1 iso 1 1 1": "plain",
        "fix 1 all langevin 1 1 1 3": None,
    }
    assert {line: finding.kind_of(line) for line in known} == known
    assert isinstance(Integrator("a", "a", ()), Integrator)


def test_native_styles_are_ours():
    """Locks out a script with a native style whose fix the harness takes for another's, or whose
    group and words it reads at other places than those in quotes; and quotes in what is printed."""
    words = "custom i_a temp 1.5 1.5 2.0 seed 5 mrot 2"
    native = f"fix 1 water nosquish/nvt {words}"
    quoted = f'fix 1 all python/move "fix_nosquish.NVT water {words}"'
    wanted = "NVT", "water", ("custom", "i_a"), tuple(words.split()[2:])
    assert finding.words_of(native) == finding.words_of(quoted) == wanted
    for one in quoted, native:
        assert finding.kind_of(one) == "ours" and finding.kept_by(one).temp == ("1.5", "1.5", "2.0")
    spaced = 'fix 1 water nosquish/nve group 1 a infile "a b"'
    assert finding.words_of(spaced).fix("1") == spaced
    # which has no fix style
    old = 'fix 1 a python/move "fix_nosquish_validation.schemes.gear.Gear a molecule"'
    assert finding.words_of('fix 1 a python/move "fix_nosquish.Gear a molecule"').fix("1") == old
    others = "", "run 5", "fix 1 water", "fix 1 water nve", 'fix 1 a python/move "mine.NVE a b"'
    assert not any(map(finding.words_of, others))
