"""The rigid bodies, and how they are made from LAMMPS's atoms."""
