"""Systems that several test modules run: the water of inputs/,
and the harness's small boxes of Lennard-Jones bodies.

The fixture `simulate` runs one of them with a fix and gives its atoms and thermodynamics;
one result is computed once.
"""

import re
from pathlib import Path

import numpy as np

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
