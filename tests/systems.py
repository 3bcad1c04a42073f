"""Systems that several test modules run: the water of inputs/,
and the harness's small boxes of Lennard-Jones bodies.

The fixture `simulate` runs one of them with a fix and gives its atoms and thermodynamics;
one result is computed once.
"""

import re
from pathlib import Path

import numpy as np
from scipy.spatial.distance import pdist

from validation.scenes.boxes import (  # noqa: F401 (for the tests)
    LIKE_LAMMPS,
    MASSES,
    OURS,
    RIGID,
    SHAPES,
    SMALL,
    UNITS,
    Result,
    System,
    Units,
    apart,
    assemble,
    mixture,
    result,
    script,
    tensor,
    turned,
)

# what a restart file does not have
AFTER = "neighbor 0.4 bin\nneigh_modify every 1 delay 0 check yes exclude molecule/intra all\n"
INPUTS = Path(__file__).resolve().parent.parent / "inputs" / "water"


def water():
    """inputs/water as it is."""
    files = {name: (INPUTS / name).read_text() for name in ("data.water", "forcefield.water")}
    setup = (
        "units real\natom_style full\nread_data data.water\ninclude forcefield.water\n"
        "group bodies type 1 2"
    )
    box = re.search(r"(\S+) xlo", files["data.water"].replace("0.0 ", "", 1))[1]
    return System(setup, files, float(box) * np.eye(3), 1.0)


def differ(ours, theirs, h):
    """How far two Results lie apart, of the largest coordinate and of the highest velocity."""
    return max(
        apart(ours, theirs, h) / np.abs(theirs.x).max(),
        np.abs(ours.v - theirs.v).max() / np.abs(theirs.v).max(),
    )


def assert_same(ours, theirs, h, tolerance=1e-9):
    """Two Results end at the same places with the same velocities, relative to the largest."""
    assert differ(ours, theirs, h) < tolerance


def close(ours, theirs, tolerance):
    """Assert that numbers are the same, relative to the largest."""
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=tolerance * np.abs(theirs).max())


def sizes(molecule, x):
    """All distances between two atoms of one molecule."""
    return np.concatenate([pdist(x[molecule == k]) for k in np.unique(molecule)])
