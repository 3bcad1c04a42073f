"""Build data.dimer: two rigid TIP3P water molecules, bound by a hydrogen bond, at 155 K.

    python build_dimer.py

One molecule points a hydrogen at the other's oxygen, 2.75 Angstrom from its own, near the
lowest energy of a TIP3P dimer (-6.5 kcal/mol).  Each molecule moves as a rigid body; the
total momentum and the total angular momentum are zero, so that the dimer neither
leaves its box nor is torn apart.  The temperature is that of 6 * 2 - 3 degrees of freedom,
as LAMMPS counts them.  Needs numpy.
"""

from pathlib import Path

import numpy as np

OUTPUT = Path(__file__).resolve().parent / "data.dimer"
SEED = 155
TEMPERATURE = 155.0  # K
BOLTZMANN, MVV2E = 0.0019872067, 48.88821291**2  # LAMMPS's, units real

MASS = np.array([15.9994, 1.008, 1.008])
CHARGE = np.array([-0.834, 0.417, 0.417])
R_OH = 0.9572  # Angstrom
THETA_HOH = np.radians(104.52)
R_OO = 2.75  # Angstrom
TILT = np.radians(40.0)  # of the acceptor's symmetry axis from the line of the oxygens
HALF_BOX = 20.0  # Angstrom


def molecule(angle):
    """O, H, H with O at the origin and the symmetry axis in the xz plane, at `angle` from x."""
    x, y = R_OH * np.cos(THETA_HOH / 2), R_OH * np.sin(THETA_HOH / 2)
    axis = np.array([np.cos(angle), 0.0, np.sin(angle)])
    across = np.array([0.0, 1.0, 0.0])
    return np.array([[0, 0, 0], x * axis + y * across, x * axis - y * across], float)


def donor():
    """O at the origin, one H on the x axis, the other in the xz plane."""
    return R_OH * np.array([[0, 0, 0], [1, 0, 0], [np.cos(THETA_HOH), 0, np.sin(THETA_HOH)]])


def rigid_part(r, v, mass):
    """Angular velocity and linear velocity of the rigid motion with the momenta of v (n, 3)."""
    centre = mass @ r / mass.sum()
    d = r - centre
    inertia = (mass * (d * d).sum(axis=1)).sum() * np.eye(3) - np.einsum("a,ai,aj->ij", mass, d, d)
    return np.linalg.solve(inertia, mass @ np.cross(d, v)), mass @ v / mass.sum(), d


def main():
    acceptor = molecule(-TILT) + [R_OO, 0, 0]
    x = np.concatenate([donor(), acceptor])
    mass = np.tile(MASS, 2)
    x -= mass @ x / mass.sum()

    v = np.random.default_rng(SEED).normal(size=(6, 3)) / np.sqrt(mass)[:, None]
    for m in (slice(0, 3), slice(3, 6)):
        omega, linear, d = rigid_part(x[m], v[m], mass[m])
        v[m] = linear + np.cross(omega, d)
    omega, linear, d = rigid_part(x, v, mass)
    v -= linear + np.cross(omega, d)
    v *= np.sqrt(TEMPERATURE * 9 * BOLTZMANN / (MVV2E * (mass * (v * v).sum(axis=1)).sum()))

    lines = ["two rigid TIP3P water molecules, 155 K; real units; written by build_dimer.py", ""]
    lines += ["6 atoms", "4 bonds", "2 angles", "", "2 atom types", "1 bond types", "1 angle types", ""]
    lines += [f"{-HALF_BOX} {HALF_BOX} {k}lo {k}hi" for k in "xyz"]
    lines += ["", "Masses", "", f"1 {MASS[0]}  # O", f"2 {MASS[1]}  # H", "", "Atoms # full", ""]
    for i in range(6):
        lines.append(f"{i + 1} {i // 3 + 1} {1 if i % 3 == 0 else 2} {CHARGE[i % 3]} " + " ".join(f"{c:.15f}" for c in x[i]))
    lines += ["", "Velocities", ""]
    lines += [f"{i + 1} " + " ".join(f"{c:.16e}" for c in v[i]) for i in range(6)]
    lines += ["", "Bonds # O-H", "", "1 1 1 2", "2 1 1 3", "3 1 4 5", "4 1 4 6"]
    lines += ["", "Angles # H-O-H", "", "1 1 2 1 3", "2 1 5 4 6"]
    OUTPUT.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
