"""External forces: fix_modify external, and add_force from Python."""

import sys

import numpy as np
import pytest
from systems import SHAPES, assemble, mixture
from validation.statistics import motion

ALL = "solid planar pair row single"
NVE = "fix 1 all nosquish/nve molecule\n"
THERMO = (
    "thermo_style custom step pe ke etotal press pxx pyy pzz pxy pxz pyz {}\n"
    "thermo_modify format float %.16g norm no\n"
)
END = "write_dump all custom end id xu yu zu vx vy vz modify sort id format float %.16g\n"
# places that periodic faces do not cut
UNWRAPPED = "".join(
    f"variable {axis} vector f_1[{k}]+{{length}}*f_1[{12 + k}]\n" for k, axis in enumerate("xyz", 1)
)
GAS = "pair_style zero 2.5\npair_coeff * *\n"


def masses(system):
    """Of the bodies, in the order of their IDs."""
    return np.bincount(system.molecule, system.mass)[1:]


def vector(name, values):
    """A vector-style variable of these numbers."""
    return f"variable {name} vector [{','.join(f'{value:.17g}' for value in values)}]\n"


@pytest.fixture
def run_bodies(run_lammps, tmp_path):
    """Run lines with the bodies of a system, and give its thermo table and atoms at the end."""

    def run(system, lines, **how):
        script = f"{system.setup}\ntimestep {system.dt}\n{lines}\n{END}"
        done = run_lammps(script, files=system.files, **how)
        return done.thermo, motion.read(tmp_path / "end")[1][0][:, 1:], done

    return run


# ---- against LAMMPS's own


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_as_addforce(run_bodies, ranks):
    """Locks out a force on a body that is not the sum of such forces on its atoms, at any time, and
    its energy and virial that are not those of fix addforce."""
    system = mixture(ALL)
    atoms = (
        "compute u all property/atom xu yu\n"
        "variable fx atom 0.4*mass*(1+0.1*step)\nvariable e atom -v_fx*c_u[1]+0.3*mass*c_u[2]\n"
        "variable fy atom -0.3*mass\n"
        "fix push all addforce v_fx v_fy 0.0 energy v_e\nfix_modify push energy yes virial yes\n"
    )
    m = masses(system)
    bodies = (
        vector("m", m) + UNWRAPPED.format(length=system.h[0, 0])
        + "variable fx vector 0.4*v_m*(1+0.1*step)\nvariable fy vector -0.3*v_m\n"
        "variable e vector -v_fx*v_x-v_fy*v_y\n"
        "fix_modify 1 external force v_fx v_fy 0.0 energy v_e virial yes\n"
    )  # fmt: skip
    runs = THERMO.format("") + "thermo 5\nrun 20\nrun 20"
    theirs, their_atoms, _ = run_bodies(system, atoms + NVE + runs, ranks=ranks)
    ours, our_atoms, _ = run_bodies(system, NVE + bodies + runs, ranks=ranks)
    for name in theirs.dtype.names:
        scale = np.abs(theirs[name]).max()
        assert np.abs(ours[name] - theirs[name]).max() < 1e-10 * scale, name
    assert np.abs(our_atoms - their_atoms).max() < 1e-10
    free, *_ = run_bodies(system, NVE + runs, ranks=ranks)
    assert np.abs(ours["KinEng"] / free["KinEng"] - 1)[-1] > 1e-3


@pytest.mark.parametrize("ranks", [1, 2])
def test_as_addtorque(run_bodies, ranks):
    """Locks out a torque that is not about the centre of mass, in the space frame, or of another
    body, as by the order of rows of f_ID."""
    system = mixture("solid planar")
    groups = "".join(f"group b{k} molecule {k}\n" for k in (2, 20))
    theirs = "fix a b2 addtorque 0.5 -1.0 2.0\nfix b b20 addtorque -1.5 0.3 v_t\n"
    torque = np.zeros((3, 27))
    torque[:, 1], torque[:2, 19] = (0.5, -1.0, 2.0), (-1.5, 0.3)
    where = np.zeros(27)
    where[19] = 1.0
    ours = (
        "".join(vector(f"t{axis}", row) for axis, row in zip("xyz", torque)) + vector("w", where)
        + "variable tzt vector v_tz+v_t*v_w\n"
        "fix_modify 1 external torque v_tx v_ty v_tzt\n"
    )  # fmt: skip
    runs = "variable t equal cos(step/10)\n" + THERMO.format("") + "run 40"
    theirs, their_atoms, _ = run_bodies(system, groups + NVE + theirs + runs, ranks=ranks)
    ours, our_atoms, _ = run_bodies(system, NVE + ours + runs, ranks=ranks)
    assert ours["PotEng"] == pytest.approx(theirs["PotEng"], rel=1e-11)
    assert np.abs(our_atoms - their_atoms).max() < 1e-10


# ---- exact solutions


def alone(*kinds, spacing=4.0):
    """Bodies at rest, far apart, without forces, whose atoms' masses are 1.0, 1.6 and 0.4."""
    h = spacing * max(2, len(kinds)) * np.eye(3)
    bodies = [
        (kind, np.array(SHAPES[kind][0]) + spacing * (k + 0.5), SHAPES[kind][1])
        for k, kind in enumerate(kinds)
    ]
    return assemble(bodies, h, setup="", temperature=0.0)


def test_constant_torque_about_a_principal_axis(run_bodies):
    """Locks out a torque of another size, at another time or twice: a rotor at rest turns by
    T t^2 / 2 I, in steps, too. And what turns about an axis without moment: a torque along a linear
    body, and one on a single atom."""
    system = alone("planar", "pair", "row", "single")
    steps, torque = 400, 0.3
    lines = (
        GAS + NVE + vector("tz", [torque, 0.0, torque, 0.0]) + vector("tx", [0, 1e3, 0, 1e3])
        + "fix_modify 1 external torque v_tx 0 v_tz\n"
        + THERMO.format("f_1[1][12] f_1[4][12] f_1[2][10]") + f"run {steps}"
    )  # fmt: skip
    thermo, atoms, _ = run_bodies(system, lines)
    t, x, v = steps * system.dt, atoms[:, :3], atoms[:, 3:]
    for first, last in (0, 4), (6, 9):  # the planar body, and the row, which lies along x
        m, r = system.mass[first:last], x[first:last]
        start = np.array(SHAPES["planar" if first == 0 else "row"][0])
        start = start - m @ start / m.sum()
        r = r - m @ r / m.sum()
        moment = m @ (start[:, :2] ** 2).sum(axis=1)
        omega, angle = torque * t / moment, 0.5 * torque * t**2 / moment
        turned = start @ np.array(
            [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        )
        assert np.abs(r[:, :2] - turned[:, :2]).max() < 1e-9
        assert np.abs(v[first:last] - omega * np.cross([0, 0, 1], r)).max() < 1e-9
    assert np.abs(v[[4, 5, 9]]).max() == 0.0
    assert thermo["f_1[4][12]"][-1] == thermo["f_1[2][10]"][-1] == 0.0


TRAP = (
    "{unwrapped}"
    "variable fx vector -{k}*(v_x-{c})\nvariable fy vector -{k}*(v_y-{c})\n"
    "variable fz vector -{k}*(v_z-{c})\n"
    "variable u vector 0.5*{k}*((v_x-{c})^2+(v_y-{c})^2+(v_z-{c})^2)\n"
    "fix_modify 1 external force v_fx v_fy v_fz energy v_u\n"
)


def trap(system, stiffness):
    """A harmonic trap for all centres of mass, at the centre of the box, with its energy."""
    edge = system.h[0, 0]
    unwrapped = UNWRAPPED.format(length=edge)
    return TRAP.format(unwrapped=unwrapped, k=stiffness, c=0.5 * edge)


def test_harmonic_trap(run_bodies):
    """Locks out forces of another step, half a step off, or from places in the box: the motion is
    that of the discrete oscillator, cos(w h) = 1 - (k / m) h^2 / 2, in steps that are looked at and
    in others, over runs, and across periodic faces."""
    system = alone("single", "single", "single")._replace(dt=0.05)
    k, steps, centre = 0.7, 333, 12.0 / 2
    ends = {}
    for how in f"run {steps}", f"run 100\nrun {steps - 100} pre no", f"thermo 1\nrun {steps}":
        move = "change_box all x final 4 16 y final 4 16 z final 4 16\nreset_atoms image all\n"
        lines = GAS + NVE + trap(system, k) + THERMO.format("") + how
        ends[how], atoms, _ = run_bodies(system, lines)
        frequency = np.arccos(1 - 0.5 * k / system.mass * system.dt**2)
        start = np.array([2.0, 6.0, 10.0]) - centre
        expected = centre + start * np.cos(frequency * steps)
        assert np.abs(atoms[:, :3] - expected[:, None]).max() < 1e-10
    one, *others = (thermo[-1] for thermo in ends.values())
    for other in others:
        assert list(other) == pytest.approx(list(one), rel=1e-12, abs=1e-13)


@pytest.mark.parametrize(
    "fix",
    [
        "nve molecule",
        "nve molecule shadow 10",
        "nvt molecule temp 1 1 5.0 seed 7",
        "nvt molecule temp 1 1 5.0 seed 7 thermostat csvr",
        "nvt molecule temp 1 1 5.0 thermostat nh",
    ],
)
def test_energy_in_a_trap(run_bodies, fix):
    """Locks out an energy of external forces that econserve lacks, and a total momentum that a
    thermostat takes as constant while a trap pushes."""
    system = mixture("solid planar pair", seed=3)
    lines = f"{GAS}fix 1 all nosquish/{fix}\n{trap(system, 2.0)}" + THERMO.format("econserve")
    off = []
    for dt, steps in (0.02, 250), (0.01, 500):
        more = f"timestep {dt}\nthermo {steps // 50}\nrun {steps}"
        thermo, _, done = run_bodies(system, lines + more)
        off.append(np.std(thermo["Econserve"] - thermo["Econserve"][0]))
        assert np.ptp(thermo["PotEng"]) > 100 * off[-1]
    assert off[1] < 0.4 * off[0]
    if "thermostat" in fix:
        assert "with the total momentum (external forces)" in done.log
