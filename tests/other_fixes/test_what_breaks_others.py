"""What users of rigid bodies in LAMMPS report as broken, held against exact answers and
conservation laws.

The cases that the documentation tells of are those of ``validation.stress.reported``; the committed
results have the numbers of LAMMPS's own fixes, too. Where these pass, the two are compared; where
they do not, nothing is asserted of them.
"""

import itertools
import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from support.bad_input import Case
from support.endings import BENT, assert_ended
from support.systems import (
    LIKE_LAMMPS,
    OURS,
    RIGID,
    SHAPES,
    SMALL,
    apart,
    assemble,
    mixture,
    tensor,
    turned,
)
from validation.stress import cases, reported

FREE = "pair_style zero 2.5\npair_coeff * *\n"
SMOOTH = "pair_style lj/smooth/linear 2.5\npair_coeff * * 1 1\n"
SUMS = {  # momentum P, angular momentum L about the origin, force F, torque N; sizes of P's and L's
    "P": "mass*v{x}",
    "L": "mass*({y}*v{z}-{z}*v{y})",
    "F": "f{x}",
    "N": "{y}*f{z}-{z}*f{y}",
    "p": "abs(mass*v{x})",
    "l": "abs(mass*{y}*v{z})+abs(mass*{z}*v{y})",
}


def sums():
    """Lines that define compute sums: `SUMS` of all atoms."""
    formulas = [f.format(x=x, y=y, z=z) for f in SUMS.values() for x, y, z in ("xyz", "yzx", "zxy")]
    lines = [f'variable s{k} atom "{formula}"' for k, formula in enumerate(formulas)]
    names = " ".join(f"v_s{k}" for k in range(len(formulas)))
    return "\n".join([*lines, f"compute sums all reduce sum {names}", ""])


def columns(result, *names):
    """Columns of the thermo table, (steps, names)."""
    return np.stack([result.thermo[name] for name in names], axis=-1)


def vector(result, name):
    """A printed vector of SUMS, (steps, 3)."""
    first = 3 * list(SUMS).index(name)
    return columns(result, *(f"c_sums[{first + k}]" for k in (1, 2, 3)))


def bent(angle):
    """A triatomic like CO2, its arms 0.5 long, bent by an angle: linear to the fix (and to LAMMPS)
    below 2e-3."""
    c, s = 0.5 * np.cos(0.5 * angle), 0.5 * np.sin(0.5 * angle)
    return [[-c, s, 0], [0, 0, 0], [c, s, 0]], [2, 3, 2]


def moved_images(system, count):
    """The same system with all image flags moved; a flag that LAMMPS's ten bits do not hold wraps
    in its hands."""
    head, atoms, tail = system.files["data.bodies"].replace("Velocities", "Atoms").split("Atoms", 2)
    lines = atoms.splitlines()
    for k, line in enumerate(lines):
        words = line.split()
        if len(words) == 9:
            lines[k] = " ".join(words[:6] + [str(int(w) + n) for w, n in zip(words[6:], count)])
    data = head + "Atoms" + "\n".join(lines) + "\nVelocities" + tail
    return system._replace(files={"data.bodies": data})


def restarted(system, file):
    """The system in a script that goes on from this restart file."""
    text = f"read_restart {file}\nneigh_modify every 1 delay 0 check yes exclude molecule/intra all"
    return system._replace(setup=text, files={})


def distances(x, molecule):
    """All distances within bodies."""
    return np.array(
        [
            np.linalg.norm(x[i] - x[j])
            for i, j in itertools.combinations(range(len(x)), 2)
            if molecule[i] == molecule[j]
        ]
    )


# ---- small moments of inertia


# ---- linear and nearly linear bodies


@pytest.fixture
def triatomics(monkeypatch):
    """A function that makes a box of 27 triatomics, bent by these angles in turn."""

    def make(*angles):
        names = [f"bent{k}" for k in range(len(angles))]
        for name, angle in zip(names, angles):
            monkeypatch.setitem(SHAPES, name, bent(angle))
        return mixture(" ".join(names), seed=4)

    return make


@pytest.mark.parametrize("angle", [1e-12, 1e-8, 1e-5, 1e-3])
def test_nearly_linear_bodies_conserve_energy(simulate, triatomics, angle):
    """Locks out the blow-up of bodies whose smallest moment is tiny and not quite zero: their
    energy is as steady as that of straight ones. (rigid/nve: 0.0097 and 0.0097 in 1,000 steps;
    from 2e-3 on, where bodies count as three-dimensional and the spin turns far in one step, all
    fixes need shorter steps.)"""
    ours, straight = (simulate(triatomics(a), OURS, 400, before=SMOOTH, dt=2) for a in (angle, 0.0))
    assert np.ptp(ours.thermo["TotEng"]) == pytest.approx(
        np.ptp(straight.thermo["TotEng"]), rel=0.02 + 100 * angle
    )
    assert np.abs(ours.v).max() < 2 * np.abs(straight.v).max()


def test_bodies_just_not_linear(simulate, triatomics):
    """Locks out a rotor that fails where one moment is 1e-7 of the others and the spin about its
    axis thousands of times as fast: with steps that resolve that spin, energy is kept as by
    rigid/nve/small. And silence where the step does not resolve it (2e-3 rad, steps 20 times as
    long: the energy varies by 6 with ours, 0.8 with rigid/nve)."""
    system = triatomics(3e-3)
    still = system._replace(setup=system.setup + "\nvelocity all set 0 0 0")
    spun = simulate(still, OURS, 0, before=SMOOTH, after="velocity all create 1 4928\nrun 0").log
    assert spun.count("rad in a step") == 1, "not told in a later run"
    for angle, step, told in (3e-3, 1, 1), (3e-3, 0.05, 0), (1e-3, 1, 0):
        log = simulate(triatomics(angle), OURS, 0, before=SMOOTH, dt=step).log
        assert log.count("rad in a step") == told, f"bent by {angle}, {step} steps"
    spread = [
        np.ptp(simulate(system, fix, 400, before=SMOOTH, dt=0.05).thermo["TotEng"])
        for fix in (OURS, SMALL)
    ]
    assert spread[0] < 2 * spread[1]


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 1e-3, 3e-3])
def test_nearly_linear_bodies_under_random_forces(simulate, monkeypatch, angle):
    """Locks out momentum that is lost or made where an axis has (nearly) no moment: under random
    forces on every atom, the body's momentum and angular momentum change by the impulse of these
    forces, to rounding errors (and the torque about the axis of a body that counts as linear,
    whose lever is 1e-4 long at most)."""
    monkeypatch.setitem(SHAPES, "bent", bent(angle))
    system = assemble(
        [turned("bent", np.full(3, 4.0), [], 8 * np.eye(3), np.random.default_rng(7))],
        8 * np.eye(3),
        setup="boundary f f f",
    )
    random = "\n".join(f"variable f{c} atom 40*(random(0,1,1{k})-0.5)" for k, c in enumerate("xyz"))
    before = FREE + sums() + random + "\nfix 7 all addforce v_fx v_fy v_fz\n"
    result = simulate(system, OURS, 500, before=before, columns="c_sums[*]", every=1)
    assert len(result.thermo) == 501
    P, L, F, N = (vector(result, name) for name in "PLFN")
    lever = 0.5 * np.sin(0.5 * angle) if 0 < angle < 2e-3 else 0.0
    for momentum, rate, slack in ((P, F, 0.0), (L, N, lever * 20 * 3 * system.dt)):
        impulse = 0.5 * system.dt * (rate[1:] + rate[:-1])
        off = np.abs(np.diff(momentum, axis=0) - impulse).max()
        assert off < slack + 1e-11, f"off by {off:.3g} a step"
    assert np.abs(result.v).max() < 30


# ---- two dimensions


def rows_in_the_plane(h):
    """Rows of three to five atoms on a square lattice, each bent a little within the plane."""
    rng, bodies = np.random.default_rng(5), []
    for k, (i, j) in enumerate(itertools.product(range(4), range(4))):
        n = 3 + k % 3
        s = (np.arange(n) - 0.5 * (n - 1)) * 0.5
        bend = [0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 3e-3, 1e-2][k % 10]
        shape = np.stack([s, bend * s**2, 0 * s], axis=1)
        turn = Rotation.from_rotvec([0, 0, rng.uniform(0, 6.3)])
        x = np.add(turn.apply(shape), [3.1 * i, 3.1 * j, 0])
        bodies.append(("row", x, rng.integers(1, 4, n)))
    return assemble(bodies, h, dimension=2, seed=5)


PLANE = np.diag([12.4, 12.4, 1.0])


@pytest.mark.parametrize("flat", ["", "fix 9 all enforce2d\n"], ids=["free", "enforce2d"])
def test_nearly_linear_bodies_in_the_plane_move_as_with_rigid_nve(simulate, flat):
    """Locks out wrong torques or moments of such rows that interact: rigid/nve's trajectory."""
    system = rows_in_the_plane(PLANE)
    ours, theirs = (simulate(system, fix, 200, before=flat) for fix in (OURS, RIGID))
    assert apart(ours, theirs, system.h) < 1e-9


NOISE = "fix 7 all langevin 1.0 1.0 1.0 9371\n"


@pytest.mark.parametrize("flat", ["", "fix 9 all enforce2d\n"], ids=["free", "enforce2d"])
@pytest.mark.parametrize("force", ["", NOISE], ids=["pairs", "heat bath"])
def test_nothing_leaves_the_plane(simulate, flat, force):
    """Locks out bodies that tilt out of the plane by rounding errors, which grow, or by forces
    that have a part across it: z and vz stay 0 to the last bit. (rigid/nve: 0, but in a heat
    bath without enforce2d abs(z)+abs(vz) comes to 2.6.)"""
    bodies = mixture("planar pair row single", side=4, dimension=2)
    check = 'variable out atom "abs(z)+abs(vz)"\ncompute out all reduce max v_out\n'
    result = simulate(bodies, OURS, 10000, before=check + force + flat, columns="c_out", every=500)
    assert (result.thermo["c_out"] == 0).all(), result.thermo["c_out"].max()
    assert (result.x[:, 2] == 0).all() and (result.v[:, 2] == 0).all()
    assert len(result.thermo) == 21


# ---- image flags


FLAGS = [(500, -500, 500), (512, -512, 512), (511, 512, -511), (100000, -7, 3)]
DRIFT = "velocity all set 6 -6 6 sum yes\n"


@pytest.mark.parametrize("count", FLAGS, ids=str)
def test_image_flags_far_from_zero(simulate, count):
    """Locks out bodies torn where the counters of images run over (from 511 to -512, within one
    body too), at the start or on the way: they move as with flags near 0, as those of rigid/nve
    do, and rebuilt by a second run, go on so. (rigid/nve: 1e-10 apart with flags of 500, refuses
    a body that the run-over cuts or loses its atoms.)"""
    near = mixture("solid planar")
    far = moved_images(near, count)
    how = {"before": DRIFT, "after": "run 50"}
    ours, reference, theirs = (
        simulate(s, f, 50, **how)
        for s, f in ((far, LIKE_LAMMPS), (near, LIKE_LAMMPS), (near, RIGID))
    )
    assert apart(ours, reference, near.h) < 1e-10
    assert apart(ours, theirs, near.h) < 1e-9
    np.testing.assert_allclose(
        tensor(ours), tensor(reference), rtol=0, atol=1e-9 * np.abs(tensor(reference)).max()
    )


@pytest.mark.parametrize(
    "count, ranks", [((0, 0, 0), 1), ((512, -512, 512), 1), ((512, -512, 512), 2)], ids=str
)
def test_restart_with_image_flags_far_from_zero(simulate, count, ranks):
    """Locks out a restart that does not continue the trajectory, because of image flags or
    anything else: run 50, write_restart, read_restart, run 50 is run 100. (rigid/nve: 2e-7 apart
    with flags near 0, breaks with the others.)"""
    far, file = moved_images(mixture(), count), f"half.{'.'.join(map(str, count))}.{ranks}"
    whole = simulate(far, OURS, 100, before=DRIFT)
    simulate(far, OURS, 50, before=DRIFT, after=f"write_restart {file}")
    ours = simulate(restarted(far, file), OURS, 50, ranks=ranks)
    assert apart(ours, whole, far.h) < 1e-10
    np.testing.assert_allclose(ours.v, whole.v, rtol=0, atol=1e-10 * np.abs(whole.v).max())


# ---- a periodic face


def test_ten_thousand_crossings(simulate, tmp_path):
    """Locks out what adds up when a body crosses a periodic face: bodies on springs swing over
    eight tilted boxes and cross faces 12,000 times each way. At the end the centres of mass
    stand where the exact solution of the discretised oscillator has them, and shape, energy and
    image flags are those of the start. (rigid/nve passes too.)"""
    h, rng, bodies = 3.0 * np.eye(3), np.random.default_rng(2), []
    h[0, 1] = 0.4
    for kind in ("solid", "row"):
        name, x, _ = turned(kind, rng.uniform(0, 3, 3), [], h, rng)
        bodies.append(
            (name, x, np.ones(len(x), int))
        )  # equal masses on equal springs: none turns the body as it swings
    system = assemble(bodies, h, temperature=0.05)
    period, amplitude = 32, np.array([12.0, -12.0, 12.0])  # up to 2.4 of a box of 3 in a step
    steps = 500 * period
    theta = 2 * np.pi / period
    stiffness = (
        2 * (1 - np.cos(theta)) / system.dt**2
    )  # so that velocity Verlet has this very period
    speed = amplitude * np.sin(theta) / system.dt
    before = (
        FREE
        + "neigh_modify every 1 delay 0 check no\n"
        f"fix 7 all spring/self {stiffness:.17g}\nfix_modify 7 energy yes\n"
        "velocity all set {:.17g} {:.17g} {:.17g} sum yes\n".format(*speed)
        + f"dump 1 all custom {steps} path id xu yu zu vx vy vz\n"
        "dump_modify 1 sort id format float %.17g\n"
    )
    result = simulate(system, OURS, steps, before=before, every=8)
    lines = (tmp_path / "path").read_text().splitlines()
    n = len(system.mass)
    start, end = (
        np.array([line.split() for line in lines[k : k + n]], float)[:, 1:] for k in (9, 2 * 9 + n)
    )
    for body in np.unique(system.molecule):
        mine = system.molecule == body
        centre = [frame[mine].mean(axis=0) for frame in (start, end)]
        np.testing.assert_allclose(centre[1][:3], centre[0][:3], rtol=0, atol=1e-8)
        np.testing.assert_allclose(
            centre[1][3:], centre[0][3:], rtol=0, atol=1e-8 * np.abs(speed).max()
        )
    np.testing.assert_allclose(
        distances(end[:, :3], system.molecule),
        distances(start[:, :3], system.molecule),
        rtol=0,
        atol=1e-10,
    )
    swing = result.thermo["TotEng"][:: period // 8]  # at one phase of the oscillation
    np.testing.assert_allclose(
        swing, swing[0], rtol=1e-12
    )  # next to the swing, turning is a small part


# ---- momentum


@pytest.mark.parametrize("ranks, steps", [(1, 2000), (2, 2000), (4, 20), (8, 10)])
def test_momentum_and_angular_momentum(simulate, ranks, steps):
    """Locks out momentum that leaks where force and torque are summed, exchanged or follow the
    atoms: of a drop of bodies over the ranks' common corner, in a box without periodic faces, total
    momentum and angular momentum stay, to 1e-12 of the sum of their parts' sizes. (Fewer steps on
    more ranks, where time goes into switching between them. rigid/nve and rigid/nve/small: 5e-15
    and, angular, 7e-9.)"""
    h, rng, bodies = 24.0 * np.eye(3), np.random.default_rng(11), []
    sites = itertools.product(range(2), repeat=3)
    for kind, site in zip(itertools.cycle(("solid", "planar", "row", "single")), sites):
        bodies.append(turned(kind, 12.0 + 2.2 * (np.array(site) - 0.5), bodies, h, rng))
    bodies.sort(key=lambda body: body[0])
    drop = assemble(bodies, h, temperature=0.3, setup="boundary s s s", seed=11)
    before = SMOOTH + "neigh_modify every 5 delay 0 check no\n" + sums()
    how = {"columns": "c_sums[*]", "every": steps // 5, "ranks": ranks}
    result = simulate(drop, OURS, steps, before=before, **how)
    for name in "PL":
        change = np.abs(vector(result, name) - vector(result, name)[0]).max()
        off = change / vector(result, name.lower()).sum(axis=1).min()
        assert off < 1e-12, f"{name} off by {off:.3g}"


# ---- an exception on one rank


LOST = """
import numpy as np
from ctypes import CFUNCTYPE, c_int64, c_void_p
from fix_nosquish.host.command import Line
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.run.fix import fix_of

def Lost(ptr):
    fix = fix_of(NVE, ptr, Line.quoted("NVE all molecule output 1 table.csv"))
    run_action = fix.run_action
    def loses(*arguments):
        run_action(*arguments)
        if fix.ranks.rank == fix.ranks.size - 1 and fix.lammps.step == 3:
            fix.lammps.x[0] = np.nan
            flip, address = map(int, fix.host.flip_box)
            CFUNCTYPE(c_int64, c_void_p, c_void_p)(flip)(address, np.zeros(12).ctypes.data)
    fix.run_action = loses
    return fix
"""
GOES_ON = """
import gc, sys, lammps
for k in range(5):
    try:
        lammps.lammps(cmdargs=["-screen", "none"]).file(sys.argv[1])
    except Exception as error:
        said = str(error)
    gc.collect()
sys.exit(said.split("\\n")[0])
"""


@pytest.mark.parametrize("ranks", [1, 2])
def test_error_of_lammps_below_python(run_lammps, tmp_path, ranks):
    """Locks out a crash of the program that runs LAMMPS, or a hang, where LAMMPS itself ends the
    run in a function of the plugin that loops or Python call: its exception went through both."""
    how = {"launcher": [sys.executable, "-c", GOES_ON]} if ranks == 1 else {"ranks": ranks}
    files = {"mol.bent": BENT, "spoil.py": LOST}
    text = Case("", module="spoil.Lost").script
    run = run_lammps(text, files=files, check=False, timeout=60, **how)
    assert_ended(run, ("Non-numeric atom coords",), tmp_path)
    assert run.code == 1


# ---- the cases of the documentation


@pytest.mark.parametrize("name", reported.MEASURES)
def test_cases(simulate, name):
    """Locks out what each case says: bodies that depend on where a run was cut or on image
    counters, that leave the plane or ignore other fixes, and r-RESPA that does not converge. The
    committed results have what LAMMPS's fixes come to."""
    result = reported.MEASURES[name](
        lambda system, steps, **how: simulate(system, OURS, steps, **how)
    )
    number = result if isinstance(result, reported.Number) else reported.Number(result)
    assert cases.CASES[name].verdict([number]) == "pass", number


BREAKS = """
from fix_nosquish.host.command import Line
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.run.fix import fix_of

def breaking(name):
    def made(ptr):
        fix = fix_of(NVE, ptr, Line.quoted("NVE all molecule output 1 table.csv"))
        original = getattr(fix, name)
        def method(*arguments):
            result = original(*arguments)
            if fix.ranks.rank == 2:
                raise ValueError("no such luck in " + name)
            return result
        setattr(fix, name, method)
        return fix
    return made

for name in ("init", "run_action", "post_run", "dof"):
    globals()["Breaks_" + name] = breaking(name)
"""


@pytest.mark.parametrize("method", ["init", "run_action", "post_run", "dof"])
def test_exception_on_one_rank(run_lammps, tmp_path, method):
    """Locks out a hang, or more than one message, where one method breaks on one rank while the
    others go on."""
    case = Case("", module=f"spoil.Breaks_{method}", before="neigh_modify every 1 delay 0 check no")
    run = run_lammps(
        case.script, files={"mol.bent": BENT, "spoil.py": BREAKS}, ranks=4, check=False, timeout=60
    )
    assert_ended(run, (f"ValueError: no such luck in {method}",), tmp_path)
