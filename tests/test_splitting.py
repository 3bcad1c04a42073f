"""Splittings: which ones are refused, and in what passes a step is done."""

import pytest

from fix_nosquish.integrators.nve import NVE
from fix_nosquish.motion.operations import kick
from fix_nosquish.motion.step import Operation, stages

PAUSE = Operation(kick, prepared=True, measures=kick)
KNOWN = NVE.operations | {
    "O": Operation(kick, prepared=True), "M": PAUSE, "D": PAUSE._replace(moves=True),
}  # fmt: skip


@pytest.mark.parametrize(
    ("splitting", "more", "says"),
    [
        ("B A X B", {}, "there is no operation X, only A, B"),
        ("B A F B", {"F": Operation(kick)}, "the letter F stands for the forces"),
        ("B B", {}, "none of its operations moves the bodies"),
        ("B A O A O A B", {}, "stands once, and from the first on that moves"),
        ("O B A B", {}, "stands once, and from the first on that moves"),
        ("B A B O", {}, "stands once, and from the first on that moves"),
    ],
)
def test_refused(splitting, more, says):
    """Locks out a letter that is taken for something else, and random numbers that are drawn twice
    in a step or with the temperature of another."""
    with pytest.raises(ValueError, match=says):
        stages(splitting, KNOWN | more)


@pytest.mark.parametrize(
    ("splitting", "passes", "tail_moves", "prepared"),
    [
        ("B A B", 1, False, False),
        ("B A F A B", 1, True, False),
        ("B A O A B", 1, False, True),
        ("B A M A B", 2, False, True),
        ("B D B", 2, False, True),
    ],
)
def test_passes(splitting, passes, tail_moves, prepared):
    """Locks out a second pass over the bodies where nothing is measured, and none where it is."""
    found = stages(splitting, KNOWN)
    assert len(found.middle) == passes
    assert (found.tail_moves, found.prepared) == (tail_moves, prepared)
