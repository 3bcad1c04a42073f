"""Which ranks share a body, and how bodies follow atoms that LAMMPS moves between ranks."""
