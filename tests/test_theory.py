"""The theory: its tools against exact answers, its statements themselves, and that broken
schemes are found out."""

import csv
import json
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from conftest import Silent
from scipy.spatial.transform import Rotation

ROOT = Path(__file__).resolve().parent.parent

for needed in ("rich", "jinja2", "matplotlib"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from fix_nosquish.motion import rotor
from validation.scenes import SCENES
from validation.statistics import measures
from validation.theory import calculus
from validation.theory import loops as theory_loops
from validation.theory import measure as theory
from validation.theory import reversal as theory_reversal
from validation.theory.reference import FS, Dimer, Oscillator
from validation.theory.top import free_top

SCENE = SCENES["dimer"]


@pytest.fixture(scope="module")
def dimer():
    return Dimer(SCENE)


def failed(*parts, out=None):
    """The numbers of parts of the theory that are out of their bounds, as text."""
    checks, _, interrupted = theory.theory(parts, out, Silent())
    assert checks and not interrupted
    return [f"{check.subject}: {check.what}: {check.value}" for check in checks if not check.holds]


# ---- the tools


@pytest.mark.parametrize("seed", range(6))
def test_exact_top_obeys_the_equations_of_motion(seed):
    """Locks out a wrong modulus, sign, branch or direction of the elliptic functions, an angle
    about the angular momentum that loses whole turns, and one of the two kinds of motion:
    Euler's equations, dA^T/dt = A^T [w], and the start itself."""
    rng = np.random.default_rng(seed)
    moments, q = np.array([3.0, 1.7, 0.8]), rng.normal(size=4)
    q /= np.linalg.norm(q)
    axis = np.eye(3)[2 * (seed % 2)]  # the motion circles about this one
    L = rng.normal(size=3) * 0.3 + axis * (-1) ** seed

    def at(time):
        q_then, L_then = free_top(q, L, moments, time)
        return Rotation.from_quat(q_then, scalar_first=True).as_matrix(), L_then

    turn, spin = at(0.0)
    np.testing.assert_allclose(
        turn, Rotation.from_quat(q, scalar_first=True).as_matrix(), atol=1e-14
    )
    np.testing.assert_allclose(spin, L, atol=1e-14)
    h = 1e-3
    for time in (-31.0, 0.0, 0.4, 5.0, 200.0):
        turn, spin = at(time)
        slopes = [
            sum(c * at(time + k * h)[i] for k, c in ((-2, 1), (-1, -8), (1, 8), (2, -1))) / (12 * h)
            for i in (0, 1)
        ]
        w = spin / moments
        cross = np.cross(np.eye(3), w)  # [w] times a vector is w x that vector
        np.testing.assert_allclose(slopes[0], turn @ cross, atol=1e-9)
        np.testing.assert_allclose(slopes[1], np.cross(spin, w), atol=1e-9)


def test_kick_is_the_gradient(dimer):
    """Locks out forces and torques that are not those of the potential energy, or miss a factor
    of (2.60)."""
    gradient = calculus.jacobian(lambda x: dimer.potential(x)[None], dimer.start)[0]
    kick = dimer.kick(dimer.start, 1.0) - dimer.start
    np.testing.assert_allclose(
        kick, np.concatenate([-gradient[14:], np.zeros(14)]), atol=1e-12 * np.abs(kick).max()
    )


def test_rotor_parts_are_the_packages_step(dimer):
    """Locks out an H^(2) of another splitting than the package's, and a Hamiltonian whose motion
    (2.56) is not."""
    dt = 4 * SCENE.dt * FS
    apart = calculus.strang(dimer.rotor_parts())(dimer.start, dt) - dimer.rotate_freely(
        dimer.start, dt
    )
    assert np.abs(apart).max() < 1e-14
    for energy, motion in dimer.rotor_parts():
        gradient = calculus.jacobian(lambda x, energy=energy: energy(x)[None], dimer.start)[0]
        slope = calculus.taylor(partial(motion, dimer.start[:, None]), 1, dt).real
        np.testing.assert_allclose(
            slope, gradient @ calculus.metric(14), atol=1e-12 * np.abs(slope).max()
        )


def test_leading_term_of_an_oscillator():
    """Locks out a wrong sign, a factor, or the two parts taken for each other in (2.37)."""
    oscillator, x = Oscillator(mass=1.3, omega=0.7), np.array([0.4, 0.2, -1.1, 0.6])
    p2, force2 = (x[:2] ** 2).sum(), (oscillator.stiffness**2 * x[2:] ** 2).sum()
    want = p2 * oscillator.stiffness / (12 * 1.3**2) - force2 / (24 * 1.3)
    np.testing.assert_allclose(calculus.leading_term(oscillator.parts(), 0.1)(x), want, rtol=1e-11)
    want = -p2 * oscillator.stiffness / (24 * 1.3**2) + force2 / (12 * 1.3)
    np.testing.assert_allclose(
        calculus.leading_term(oscillator.parts()[::-1], 0.1)(x), want, rtol=1e-11
    )


def test_leading_term_of_the_rotor(dimer):
    """Locks out a wrong nesting of three parts in (2.37): Poisson brackets of h_k = L_k^2 / 2
    I_k by {f, g} = L . (f' x g')."""
    *_, p, _, q = dimer.split(dimer.start)
    want = 0.0
    for b in (0, 1):
        i = dimer.moments[:, b]
        L = 0.5 * np.array([q[:, b] @ matrix.T @ p[:, b] for matrix in P])
        h = {k: np.eye(3)[k] * L[k] / i[k] for k in range(3)}  # derivatives by L
        product = np.array([L[1] * L[2], L[0] * L[2], L[0] * L[1]])  # of L_1 L_2 L_3
        outer = (1 / i[0] - 1 / i[1]) / i[
            2
        ]  # {h_3, h_1 + h_2} = outer L_1 L_2 L_3, by L . (e_3 x e_1) = L_2, L . (e_3 x e_2) = -L_1
        inner = -1 / (i[0] * i[1])  # {h_2, h_1} = inner L_1 L_2 L_3
        want -= outer * L @ np.cross(h[2] + 2 * h[0] + 2 * h[1], product) / 24
        want -= inner * L @ np.cross(h[1] + 2 * h[0], product) / 24
    got = calculus.leading_term(dimer.rotor_parts(), SCENE.dt * FS / 2)(dimer.start)
    np.testing.assert_allclose(got, want, rtol=1e-9)


# P_k of (2.18), so that L_k = p . P_k q / 2
P = [
    np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]]),
    np.array([[0, 0, -1, 0], [0, 0, 0, -1], [1, 0, 0, 0], [0, 1, 0, 0]]),
    np.array([[0, 0, 0, -1], [0, 0, 1, 0], [0, -1, 0, 0], [1, 0, 0, 0]]),
]


def test_defects_are_seen():
    """Locks out a measure that calls a map symplectic that is not, or misses a change of volume:
    shears and stretches."""
    shear = np.eye(4)
    shear[:2, 2:] = [[1.0, 0.3], [0.3, -2.0]]
    assert calculus.symplectic_defect(shear) < 1e-15
    basis = np.eye(4)[:, [0, 2]]
    assert calculus.restricted(shear @ basis, basis) == (0.0, 1.0)
    turned = shear.copy()
    turned[0, 3] += 1e-8  # the force has a curl
    assert calculus.symplectic_defect(turned) == pytest.approx(1e-8, rel=1e-6)
    stretched = shear @ np.diag([1 + 1e-8, 1, 1, 1])
    assert calculus.symplectic_defect(stretched) == pytest.approx(1e-8, rel=1e-6)
    defect, volume = calculus.restricted(stretched @ basis, basis)
    assert defect == pytest.approx(1e-8, rel=1e-6) and volume - 1 == pytest.approx(1e-8, rel=1e-6)


# ---- the statements


@pytest.mark.parametrize(
    "part", ["symplectic", "conserved", "mrot", "rotors", "recursion", "loops"]
)
def test_the_theory_holds(monkeypatch, part):
    """Locks out a rotor or a reference that loses what the paper proves of it."""
    monkeypatch.setattr(theory, "RANDOM", 50)
    monkeypatch.setattr(theory.free, "ROUNDS", 1)
    assert not failed(part)


def test_shake_rattle_keeps_lengths(dimer):
    """Locks out a model of SHAKE and RATTLE that is not one: distances, velocities along them,
    the rigid bodies' motion."""
    x, y, dt = dimer.atoms.start, dimer.start, SCENE.dt * FS
    assert np.abs(dimer.atoms.constraints(dimer.atoms.shake_rattle(x, dt, 1e-14))).max() < 1e-12
    far = []
    for n in (10, 20):
        shaken = calculus.repeated(partial(dimer.atoms.shake_rattle, tolerance=1e-13), n)(
            x, 10 * dt
        )
        far.append(
            np.abs(
                shaken[18:]
                - dimer.positions(calculus.repeated(dimer.nosquish, n)(y, 10 * dt)).ravel()
            ).max()
        )
    assert far[0] < 1e-3
    assert far[0] / far[1] == pytest.approx(
        4, rel=0.05
    )  # both are of second order, for the same motion


# ---- broken schemes

LONG = 1.0, 2.0, 4.0  # time steps that are enough for the laws below, of right schemes, to hold


def test_a_wrong_torque_is_found(monkeypatch):
    """Locks out checks of (2.42) and of the conserved quantity that a missing factor in (2.60)
    passes."""
    right = Dimer.kick

    def wrong(self, x, time):
        y = right(self, x, time)
        y[6:14] = x[6:14] + 0.999 * (y[6:14] - x[6:14])
        return y

    monkeypatch.setattr(Dimer, "kick", wrong)
    monkeypatch.setattr(theory, "MULTIPLES", LONG)
    text = " ".join(failed("symplectic", "conserved"))
    assert "NO_SQUISH: |J g⁻¹ Jᵀ − g⁻¹|" in text and "NO_SQUISH: |Jᵀ g J − g|" in text
    assert "NO_SQUISH: spread of H ∝" in text


def test_another_order_of_axes_is_found(monkeypatch):
    """Locks out an H^(2) that any splitting of the rotor conserves."""

    def other(q, p, moment_1, moment_2, moment_3, dt, small):
        for k, moment, time in (
            (1, moment_1, dt / 2),
            (2, moment_2, dt / 2),
            (3, moment_3, dt),
            (2, moment_2, dt / 2),
            (1, moment_1, dt / 2),
        ):
            permute = (rotor.permute_1, rotor.permute_2, rotor.permute_3)[k - 1]
            q, p = rotor.rotation(q, p, permute(q), permute(p), 0.25 / moment, time, small)
        return q, p

    monkeypatch.setattr(rotor, "free_rotor", other)
    monkeypatch.setattr(theory, "MULTIPLES", LONG)
    text = " ".join(failed("conserved"))
    assert "NO_SQUISH: spread of H + Δt² H⁽²⁾ ∝" in text and "spread of H ∝" not in text, text


def test_a_lossy_rotation_is_found(monkeypatch):
    """Locks out a determinant and a defect of other functions than those of the package's rotor."""
    right = rotor.turn

    def lossy(s, lost, a, b):
        return tuple((1 - 1e-10) * value for value in right(s, lost, a, b))

    monkeypatch.setattr(rotor, "turn", lossy)
    text = " ".join(failed("symplectic"))
    assert "NO_SQUISH: |det J − 1|" in text and "NO_SQUISH: |J g⁻¹ Jᵀ − g⁻¹|" in text


@pytest.mark.parametrize("kind", ["solid", "planar", "linear", "point"])
def test_forces_without_a_potential_are_found(monkeypatch, kind):
    """Locks out differences of the compiled loops that call any step symplectic: an addition to
    the forces that has a curl."""
    rng = np.random.default_rng(1)
    pair = theory_loops.Scene(kind, 2, rng)
    start, right = pair.random(rng), pair.forces
    assert pair.defects(start, 0.2)[0] < theory.DIFFERENCES
    monkeypatch.setattr(
        pair, "forces", lambda r: right(r) + 1e-4 * np.roll(r, 1, axis=1) * [1, -1, 1]
    )
    assert pair.defects(start, 0.2)[0] > 100 * theory.DIFFERENCES


@pytest.mark.parametrize("kind", ["solid", "planar", "equal moments", "linear", "nearly linear"])
@pytest.mark.parametrize("scheme", ["NVE", "MatubayasiNakahara"])
def test_other_equations_are_found(kind, scheme):
    """Locks out a tie of loops and equations that a moment of inertia off by 1e-10 passes."""
    rng = np.random.default_rng(1)
    scene = theory_loops.Scene(kind, 200, rng, scheme)
    scene.moments = scene.moments * (1 + 1e-10)
    assert max(scene.apart(rng, scheme)) > theory.TIED


# ---- in LAMMPS


def test_reversal(monkeypatch, tmp_path):
    """Locks out a reversal that does not come back, or does where it must not (shake and rattle
    before convergence, Gear), one that has not gone anywhere, one of ours that cannot run without
    further words, and equations in Python that are not the fixes'."""
    free, tolerances = (*theory_reversal.OURS, "rigid/nve", "rigid"), ("1e-4", "1e-12")
    some = [
        one
        for one in theory_reversal.INTEGRATORS
        if one.name in free or one.tolerance in map(float, tolerances)
    ]
    monkeypatch.setattr(theory_reversal, "INTEGRATORS", some)
    monkeypatch.setattr(theory_reversal, "TOLERANCES", tolerances)
    monkeypatch.setattr(theory_reversal, "STEPS", (theory_reversal.COMPARED, theory.REVERSED))
    checks, data, _ = theory.theory(["reversal"], tmp_path, Silent())
    assert [check for check in checks if not check.holds] == []
    assert (
        len(checks) == len(free) + 2 * 3 + 2
    )  # three of shake and rattle each, and the equations of two schemes
    left = {
        (row["name"], row["tolerance"]): row["distance"][-1] for row in data["reversal"]["runs"]
    }
    for key in ("Gear", None), ("rigid", None), ("shake", 1e-4), ("rattle", 1e-4):
        assert left.pop(key) > 1e-8, f"{key} is reversible"
    assert set(left) == {(name, None) for name in ("NVE", "MatubayasiNakahara", "rigid/nve")} | {
        (style, 1e-12) for style in ("shake", "rattle")
    }
    assert max(left.values()) < 1e-10
    for row in data["reversal"]["runs"]:
        assert min(row["moved"]) > 0.1, "the dimer was not moved"


def test_command(tmp_path):
    """Locks out a verb that loses a number on the way to its files, a page that needs others,
    and a wrong exit status."""
    command = [
        sys.executable,
        "-m",
        "validation",
        "theory",
        "mrot",
        "symplectic",
        "--out",
        str(tmp_path),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stdout + done.stderr
    checks = json.loads((tmp_path / "summary.json").read_text())["checks"]
    rows = list(csv.DictReader((tmp_path / "table.csv").open()))
    assert {check["part"] for check in checks} == {"mrot", "symplectic"}
    assert [float(row["value"]) for row in rows] == [check["value"] for check in checks]
    assert [row["margin"] and float(row["margin"]) for row in rows] == [
        measures.margin(check["error"], check["freedom"]) or "" for check in checks
    ]
    page = (tmp_path / "report.html").read_text()
    assert (
        page.count("data:image/png;base64,") == 2
        and 'src="http' not in page
        and "href=" not in page
    )
    assert page.count('class="holds"') == len(checks)
    wrong = subprocess.run(
        [*command[:4], "nothing"], cwd=ROOT, capture_output=True, text=True, timeout=100
    )
    assert wrong.returncode == 2 and "nothing" in wrong.stderr
