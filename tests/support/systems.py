"""Systems that several test modules run: the water of inputs/,
and the harness's small boxes of Lennard-Jones bodies.

The fixture `simulate` runs one of them with a fix and gives its atoms and thermodynamics;
one result is computed once.
"""

import itertools
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
OURS = "fix 1 {group} nosquish/nve {words}"
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


def line_of_class(name):
    """The fix line of a class of one's own, module.Class, as `OURS`."""
    return f'fix 1 {{group}} python/move "{name} {{group}} {{words}}"'


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
    ours = "nosquish/" in fix or "python/move" in fix
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


def droplet(boundary, *, setup="", margin=0.05, spacing=2.55, seed=1):
    """27 bodies in a box with these faces; along non-periodic directions it ends `margin`
    from the outermost atoms."""
    rng, free = np.random.default_rng(seed), np.array([face != "p" for face in boundary.split()])
    edge = np.where(free, 1e3, 3.0 * np.array(spacing))
    bodies = []
    for kind, site in zip(
        itertools.cycle(["solid", "planar"]), itertools.product(range(3), repeat=3)
    ):
        bodies.append(turned(kind, np.multiply(spacing, site), bodies, np.diag(edge), rng))
    x = np.concatenate([x for _, x, _ in bodies])
    low = np.where(free, x.min(axis=0) - margin, 0.0)
    edge = np.where(free, x.max(axis=0) + margin - low, edge)
    bodies = [(kind, x - low, types) for kind, x, types in bodies]
    return assemble(bodies, np.diag(edge), setup=f"boundary {boundary}\n{setup}")


def charged(system):
    """The same atoms, with atom_style full."""
    text, done = [], False
    for line in system.files["data.bodies"].splitlines():
        words = line.split()
        done = done or line == "Velocities"
        text.append(
            " ".join([*words[:3], "0.0", *words[3:]]) if len(words) == 9 and not done else line
        )
    files = {"data.bodies": "\n".join(text).replace("# molecular", "# full") + "\n"}
    return system._replace(
        setup=system.setup.replace("atom_style molecular", "atom_style full"), files=files
    )


def hot_rods():
    """Three coiled rods of 40 atoms over nearly the whole length of the box,
    and a hot bath of other bodies."""
    h, s, rng = np.diag([27.0, 9.0, 9.0]), np.arange(40), np.random.default_rng(4)
    coil = np.stack([0.62 * s, 0.4 * np.cos(0.9 * s), 0.4 * np.sin(0.9 * s)]).T
    rods = {(1.5, 1.5): 0.0, (4.5, 4.5): 9.0, (7.5, 1.5): 20.0}
    bodies = [("rod", np.add(coil, [x, y, z]), 1 + s % 3) for (y, z), x in rods.items()]
    kinds = itertools.cycle(["pair", "solid", "single", "row"])
    for x, y, z in itertools.product(np.arange(9) * 3.0, (1.5, 4.5, 7.5), (1.5, 4.5, 7.5)):
        if (y, z) not in rods:
            bodies.append(turned(next(kinds), [x, y, z], bodies, h, rng))
    return assemble(bodies, h, temperature=8.0)


TWO = "run_style respa 2 4 inner 1 1.3 1.8 outer 2"


def smooth(kinds="solid planar pair row single"):
    """A mixture with a potential that is nearly smooth at the cutoff,
    so that errors fall with dt^2."""
    system = mixture(kinds, temperature=0.5)
    return system._replace(
        setup=system.setup.replace("lj/cut 2.5", "lj/cut 3.6") + "\npair_modify shift yes"
    )
