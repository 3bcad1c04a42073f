"""What is done at each step of a run, and what LAMMPS and the log are told."""
