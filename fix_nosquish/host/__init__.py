"""The surroundings of an integrator: LAMMPS, the fix line, and the host that calls its hooks."""
