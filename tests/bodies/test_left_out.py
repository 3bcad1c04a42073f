"""Atoms that share the molecule-ID of a body, but are not in the fix's group."""

import pytest

from support.systems import mixture

LEFT_OUT = "WARNING: 5 atoms have the molecule-ID of a body, but are not in group some"


@pytest.mark.parametrize("ranks", [1, 2, 4])
def test_a_part_of_each_molecule(run_lammps, refused, ranks):
    """Locks out molecules that fly apart without a word, because the group of the fix has only a
    part of them; a warning of other molecules' atoms, or of other rules; and a refusal of atoms in
    no body that asks to move them alone; on several ranks, of which two have a molecule's atoms."""
    system = mixture("pair", side=2)
    setup = f"{system.setup}\ngroup whole molecule 1:3\ngroup ends id 1 3 5 7 9\n"
    setup += "group some subtract all ends\n"
    fix = "fix 1 {} nosquish/nve {}\nrun 0\n"
    some = run_lammps(setup + fix.format("some", "molecule"), files=system.files, ranks=ranks)
    assert LEFT_OUT in some.log
    for words in ("whole", "molecule"), ("some", "single"):
        whole = run_lammps(setup + fix.format(*words), files=system.files, ranks=ranks)
        assert "have the molecule-ID" not in whole.log
    npt = "fix 1 some nosquish/npt molecule temp 2 2 1 iso 1 1 1 seed 4\nrun 0\n"
    refused(setup + npt, "5 atoms are in no body; 5 of them have the molecule-ID", system.files)
