"""Schemes that NO_SQUISH is compared with, as LAMMPS imports them.

They are written as a user of fix_nosquish would write them, from outside, see docs/extending.md. A
module here imports nothing of the harness.
"""
