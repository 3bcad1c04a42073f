"""Build data.dipeptide.gz: alanine dipeptide, ACE-ALA-NME, in TIP3P water, CHARMM22 without CMAP,
at 300 K and about 1 atm.

    python build_dipeptide.py

As build_peptide.py, which says what it needs and what it does.  PeptideBuilder has no caps, so they
are made of the heavy atoms of GLY-ALA-GLY.  The box is nearly the smallest that GROMACS takes with
this cutoff, 310 molecules of water.  dipeptide.pdb has the names of the peptide's atoms, in the
data file's order.
"""

from build_peptide import HERE, build, chain

OUTPUT, NAMES = HERE / "data.dipeptide.gz", HERE / "dipeptide.pdb"
TITLE = "ACE-ALA-NME in TIP3P water, CHARMM22, 300 K; written by build_dipeptide.py"
PHI, PSI = -75.0, 145.0  # degrees, of polyproline II
BOX = 2.11, 2.11, 2.11  # nm, to begin with


def dipeptide():
    """The heavy atoms of ACE-ALA-NME; GROMACS's CHARMM calls NME's residue CT3."""
    structure = chain("GAG", PHI, PSI)
    first, _, last = structure.get_residues()
    for residue, name, others in (first, "ACE", "N"), (last, "CT3", "CO"):
        residue.resname = name
        residue["CA"].fullname = " CH3"
        for other in others:
            residue.detach_child(other)
    return structure


if __name__ == "__main__":
    build(OUTPUT, TITLE, NAMES, dipeptide(), box=BOX, ends="3\n5\n")
