"""What surrounds an integrator: LAMMPS, the words of the fix line, and who calls it."""
