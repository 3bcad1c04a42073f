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
    MASSES,
    SHAPES,
    UNITS,
    Result,
    System,
    Units,
    apart,
    assemble,
    mixture,
    turned,
)
from validation.statistics import motion

# what a restart file does not have
AFTER = "neighbor 0.4 bin\nneigh_modify every 1 delay 0 check yes exclude molecule/intra all\n"
OURS = 'fix 1 {group} python/move "fix_nosquish.NVE {group} {words}"'
LIKE_LAMMPS = OURS.replace("{words}", "{words} order 123")
RIGID = "fix 1 {group} rigid/nve {words}"
SMALL = "fix 1 {group} rigid/nve/small {words}"
INPUTS = Path(__file__).resolve().parents[2] / "inputs" / "water"


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


def script(
    system: System,
    fix: str,
    steps: int,
    *,
    words: str = "molecule",
    group: str | None = None,
    dt: float = 1.0,
    every: int = 10,
    before: str = "",
    columns: str = "",
    after: str = "",
) -> str:
    """The input that runs a `System` with a fix, and writes its atoms to the file ``end``.

    Args:
        fix: a LAMMPS line with the words ``{group}`` and ``{words}``; LAMMPS's own fixes leave
            single atoms to fix nve.
        dt: time step, in units of the system's own.
        before, after: further lines: before the fix, and after the run.
    """
    ours = "python/move" in fix
    group = group or ("all" if ours else system.group)
    return f"""{system.setup}
{before}
{fix.format(group=group, words=words)}
{"" if ours or not system.singles else "fix 2 single nve"}
thermo_style custom step temp press pe etotal pxx pyy pzz pxy pxz pyz {columns}
thermo_modify format float %.16g norm no
thermo {every}
timestep {dt * system.dt:.17g}
run {steps}
{after}
write_dump all custom end id x y z vx vy vz modify sort id format float %.16g
"""


def result(path: Path, thermo: dict[str, np.ndarray], log: str) -> Result:
    """The `Result` whose atoms `script` has written to a file."""
    atoms = motion.read(path)[1][0]
    return Result(atoms[:, 1:4], atoms[:, 4:], thermo, log)


def tensor(result: Result) -> np.ndarray:
    """The six pressure components of all printed steps, (steps, 6)."""
    names = "Pxx", "Pyy", "Pzz", "Pxy", "Pxz", "Pyz"
    return np.stack([result.thermo[name] for name in names], axis=1)
