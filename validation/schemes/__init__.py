"""Schemes for comparison with NO_SQUISH, as LAMMPS imports them.

They are written as a user of fix_nosquish would write them, see docs/extending.md.  A module here
imports nothing from the harness.
"""
