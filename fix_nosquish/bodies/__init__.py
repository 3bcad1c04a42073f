"""What the rigid bodies are, and how they are made of LAMMPS's atoms."""
