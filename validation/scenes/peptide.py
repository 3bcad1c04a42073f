"""The peptide of figure 3, and the constraints of SHAKE on it."""

from dataclasses import replace

from . import SCENES, Scene

# Bonds within a rigid group, and the angle of groups of three atoms (water, CH2, NH2): CH, NH, CH2,
# NH2 and water are as rigid as with the rigid fixes.  A group of four (CH3, NH3) has three bonds
# only, because fix shake cannot constrain more of it.
HELD = "b 1 3 6 10 12 19 24 27 29 31 a 1 11 42 46 53 57"


def scene() -> Scene:
    """The scene with the constraints that fix shake supports, as its arguments."""
    return replace(SCENES["peptide"], constraints=HELD)
