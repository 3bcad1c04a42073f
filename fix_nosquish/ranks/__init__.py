"""Bodies shared by several ranks, and the migration of bodies with LAMMPS's atoms."""
