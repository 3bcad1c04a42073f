"""Rigid groups of flexible CHARMM22 molecules in rigid water:
this fix against LAMMPS's fix rigid/nve.

The bodies are bonded to atoms that fix nve moves; the force field is that of `charmm.py`. The body
styles run one after the other in one process, so a style that fails may fail those after it too.
"""

from typing import NamedTuple

import charmm
import numpy as np
import pytest
from systems import LIKE_LAMMPS, OURS, RIGID
from test_hmc import MINE
from test_npt import FORCES, TELLS, assert_lammps_virial
from test_nvt import thermo

STEPS, DT = 10, 0.25  # fs
STYLES = {  # the words of each body style, and the groups that its fix moves
    "molecule": ("molecule", "rigid"),
    "custom i_NAME": ("custom i_body", "rigid"),
    "custom v_NAME": ("custom v_body", "rigid"),
    "group": ("group 3 ammonium methyls water", "ammonium methyls water"),
    "single": ("single", "methyls"),
}
RUNS = [("real", 1), ("real", 2), ("real", 4), ("metal", 1), ("lj", 1)]
TERMS = ("E_bond", "E_angle", "E_dihed", "E_impro", "E_vdwl", "E_coul")


class Result(NamedTuple):
    """Atoms in order of ID at the end of a run, in units real and not wrapped; its thermo table."""

    x: np.ndarray
    v: np.ndarray
    thermo: np.ndarray


def groups(scene):
    """The groups of the body style group: an NH3, both CH3 of a butane (one body), a water."""
    first = {
        name: scene.number == scene.number[scene.molecule == name][0] for name in charmm.COUNTS
    }
    ammonium = first["glycine"] & np.isin(scene.type, ("NH3", "HC"))
    return {
        "ammonium": ammonium,
        "methyls": first["butane"] & (scene.body >= 0),
        "water": first["water"],
    }


def molecules(scene, atoms):
    """Molecule-IDs: bodies are numbered from 0 on, and 0 is also that of atoms in no body."""
    return np.where(atoms, np.searchsorted(np.unique(scene.body[atoms]), scene.body), 0)


def script(scene, scale, long, fix, styles, atoms, dt, steps):
    """An input script that runs body styles one after the other,
    each from where the last one ended."""
    lines = [charmm.script(scale, long)]
    for name, members in {"rigid": atoms, **groups(scene)}.items():
        lines += [f"group {name} id " + " ".join(str(k + 1) for k in np.flatnonzero(members))]
    lines += [
        "variable molecule atom mol",
        "fix 3 all property/atom i_body",
        # not whole: a body has both n and 1.001 n for n = -2, -1, 1, 2 ..., and one has both -0.7
        # and 0.7
        "variable body atom (mol-2)*(1+0.001*(id%2))+0.7*(2*(id%2)-1)*(mol==2)",
        "set group all i_body v_molecule",
        f"timestep {dt * scale.time:.17g}",
        f"thermo {steps}",
        "thermo_style custom step temp etotal ebond eangle edihed eimp evdwl ecoul fmax",
        "thermo_modify format float %.16g norm no",
        f"dump 1 all custom {steps} end id xu yu zu vx vy vz",
        "dump_modify 1 sort id format float %.16g",
    ]
    for style in styles:
        words, moved = STYLES[style]
        lines += [
            f"group body union {moved}",
            "group rest subtract all body",
            fix.format(group="body", words=words),
        ]
        lines += [
            "fix 2 rest nve",
            f"run {steps} post no",
            "unfix 1",
            "unfix 2",
            "group body delete",
            "group rest delete",
        ]
    return "\n".join([*lines, ""])


@pytest.fixture(scope="module")
def known():
    """What several tests need: the start and results of runs."""
    return {}


@pytest.fixture
def start(run_lammps, tmp_path, known):
    """The Scene after a short minimisation without bodies."""
    if "start" not in known:
        made, scale = charmm.scene(), charmm.SCALES["real"]
        files = {"data.charmm": charmm.data(made, scale, made.number)}
        run_lammps(
            f"{charmm.script(scale)}\nminimize 0 0.5 60 200\n"
            "write_dump all custom end id xu yu zu modify sort id format float %.17g\n",
            files=files,
        )
        known["start"] = made._replace(x=np.loadtxt(tmp_path / "end", skiprows=9)[:, 1:])
    return known["start"]


@pytest.fixture
def simulate(start, run_lammps, tmp_path, known):
    """A function that runs body styles in one process and gives their Results;
    no run is done twice."""

    def run(
        fix,
        *,
        units="real",
        ranks=1,
        long=False,
        styles=tuple(STYLES),
        size=(3, 4),
        dt=DT,
        steps=STEPS,
    ):
        """Run these styles.

        Args:
            long: Whether with PPPM.
            size: How many atoms the bodies have (not those of single and group).
        """
        scale, atoms = charmm.SCALES[units], np.isin(start.size, size)
        text = script(start, scale, long, fix, styles, atoms, dt, steps)
        if (text, ranks, size) not in known:
            files = {"data.charmm": charmm.data(start, scale, molecules(start, atoms))}
            table = run_lammps(text, files=files, ranks=ranks).thermo
            frames = (
                (tmp_path / "end").read_text().split("ITEM: TIMESTEP")[2:]
            )  # without the start's
            assert len(table) == 2 * len(styles) == 2 * len(frames)
            known[text, ranks, size] = {}
            for k, (style, frame) in enumerate(zip(styles, frames)):
                end = np.array([line.split() for line in frame.splitlines()[9:]], float)
                x, v = end[:, 1:4] / scale.length, end[:, 4:] * (scale.time / scale.length)
                known[text, ranks, size][style] = Result(x, v, table[2 * k : 2 * k + 2])
        return known[text, ranks, size]

    return run


def assert_same(a, b, tolerance):
    """Positions and velocities are equal to this part of the largest."""
    np.testing.assert_allclose(a.x, b.x, rtol=0, atol=tolerance * np.abs(b.x).max())
    np.testing.assert_allclose(a.v, b.v, rtol=0, atol=tolerance * np.abs(b.v).max())


@pytest.mark.parametrize("units, ranks", RUNS)
@pytest.mark.parametrize("style", STYLES)
def test_bonded_bodies_move_as_with_rigid_nve(simulate, style, units, ranks):
    """Locks out forces on bodies that miss those of bonds, angles, dihedrals and impropers to
    flexible atoms (also across ranks), constants of one unit style, and a body style that takes
    other atoms than rigid/nve does: a body of number or molecule-ID 0, numbers below 0 or not
    whole, a body of two parts.  (All ranks in all units take minutes; the units' constants know
    nothing of ranks.)"""
    theirs, ours = (
        simulate(RIGID, units=units)[style],
        simulate(LIKE_LAMMPS, units=units, ranks=ranks)[style],
    )
    assert_same(ours, theirs, 1e-10)
    for name in "Temp", "TotEng":
        np.testing.assert_allclose(ours.thermo[name], theirs.thermo[name], rtol=1e-10)


@pytest.mark.parametrize("units", ["metal", "lj"])
@pytest.mark.parametrize("style", STYLES)
def test_units_do_not_matter(simulate, style, units):
    """Locks out a constant of LAMMPS's unit styles that is used wrongly
    where rigid/nve does the same."""
    assert_same(simulate(LIKE_LAMMPS, units=units)[style], simulate(LIKE_LAMMPS)[style], 1e-10)


def test_with_pppm(simulate):
    """Locks out bodies without the mesh's forces on partly rigid molecules, and motion in which the
    bonded and the mesh's forces do not do the work that the energies say."""
    how = dict(long=True, styles=("molecule",))
    theirs, ours = (
        simulate(RIGID, **how)["molecule"],
        simulate(LIKE_LAMMPS, ranks=2, **how)["molecule"],
    )
    assert_same(ours, theirs, 1e-10)
    assert np.abs(np.diff(ours.thermo["E_bond"])) > 3
    assert np.abs(np.diff(ours.thermo["TotEng"])) < 0.1


def among_others(start, module):
    """The begin of a script with all bodies in group rigid and other atoms in group rest, by PPPM;
    and its files, with this text in mine.py."""
    scale, bodies = charmm.SCALES["real"], start.body >= 0
    files = {"data.charmm": charmm.data(start, scale, np.where(bodies, 1 + start.body, 0))}
    members = " ".join(str(k + 1) for k in np.flatnonzero(bodies))
    script = f"{charmm.script(scale, True)}\ngroup rigid id {members}\n"
    return script + "group rest subtract all rigid\n", files | {"mine.py": module}


@pytest.mark.parametrize("ranks", [1, 2])
def test_virial_of_bonded_bodies(start, run_lammps, ranks):
    """Locks out a barostat that leaves out the virial of bonds, angles, dihedrals, impropers or of
    the mesh, or takes its components in another order; and a mesh that is for the box of before."""
    script, files = among_others(start, TELLS)
    words = "molecule iso 1 5000 5 every 1 dilate all"
    script += f'fix 2 rest nve\nfix 1 rigid python/move "mine.Tells rigid {words}"\n'
    script += f"timestep 0.25\n{FORCES}"
    for steps in 0, 10:
        assert_lammps_virial(run_lammps(f"{script}run {steps}\n", files=files, ranks=ranks))
    rows = run_lammps(f"{script}run 10\nrun 0\n", files=files, ranks=ranks).thermo
    assert np.abs(rows["Volume"][-1] / rows["Volume"][0] - 1) > 1e-3
    assert rows["E_long"][-1] == pytest.approx(rows["E_long"][-2], rel=1e-9)


@pytest.mark.parametrize("ranks", [1, 2])
def test_rejected_trajectory_of_bonded_bodies(start, run_lammps, ranks):
    """Locks out terms of the force field that are not computed anew where a rejected trajectory
    goes back, or not for each atom: all energies, forces and pressures are those of before."""
    script, files = among_others(start, MINE)
    words = "molecule temp 300 steps 10 seed 7 points rest"
    script += f'fix 1 rigid python/move "mine.Rejects rigid {words}"\ntimestep 0.5\n'
    script += "compute each all pe/atom\ncompute sum all reduce sumsq c_each\n"
    script += "compute f all pressure NULL pair bond angle dihedral improper kspace\n"
    script += thermo("ebond eangle edihed eimp evdwl ecoul elong fmax c_sum c_f[*]", 5)
    of_start, of_away, of_end = run_lammps(f"{script}run 10\n", files=files, ranks=ranks).thermo
    for name in of_start.dtype.names[3:]:
        assert of_end[name] == pytest.approx(of_start[name], rel=1e-7), name
        assert of_end[name] != pytest.approx(of_away[name], rel=1e-5), name


def test_linear_groups(simulate):
    """Locks out a linear body's torque that misses bonded forces: CO and NH, bonded to each other,
    come as close to rigid/nve as dt^2 (LAMMPS splits the rotation of linear bodies)."""
    distance = []
    for steps in 10, 20:
        how = dict(styles=("molecule",), size=(2,), dt=5 / steps, steps=steps)
        ours, theirs = (simulate(fix, **how)["molecule"].x for fix in (OURS, RIGID))
        distance.append(np.abs(ours - theirs).max())
    assert distance[0] / distance[1] == pytest.approx(4.0, rel=0.1)
    assert distance[1] < 1e-4


def test_what_the_bodies_are_bonded_to(simulate, start):
    """Locks out a system in which the other tests could not fail: bodies of three and four atoms
    with bonds, angles, dihedrals and impropers to flexible atoms, all terms with forces, and atoms
    that have moved."""
    flexible, bodies = start.size < 3, start.size >= 3
    for terms in start.terms.values():
        both = [
            k
            for k, (_, atoms) in enumerate(terms)
            if flexible[list(atoms)].any() and bodies[list(atoms)].any()
        ]
        assert len(both) > 3
    assert {"CT3 HA HA HA", "CT2 HA HA", "NH3 HC HC HC", "OT HT HT"} <= {
        " ".join(start.type[start.body == body]) for body in range(start.body.max() + 1)
    }
    run = simulate(RIGID)["molecule"]
    for name in TERMS:
        assert np.abs(np.diff(run.thermo[name])).min() > 1e-3, name
    assert run.thermo["Fmax"].max() < 200
    assert np.median(np.abs(run.x - start.x)) > 0.005
