"""Small scenes in reduced units for `stress`: bodies and their data file."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from . import Scene
from .data_file import data_file

# a bent triatomic, which fix shake can constrain too; lengths in sigma
BOND, ANGLE = 0.7, 104.0
_HALF = np.radians(ANGLE) / 2
BENT = BOND * np.array(
    [[0, 0, 0], [np.sin(_HALF), np.cos(_HALF), 0], [-np.sin(_HALF), np.cos(_HALF), 0]]
)
MASSES = np.array([2.0, 1.0, 0.5])  # all different: an asymmetric top
SHAKEN = "b 1 a 1"  # BENT as arguments of fix shake
FREE = "pair_style zero 1.0", "pair_coeff * *"


class Body(NamedTuple):
    """Atoms of a rigid body: positions (n, 3), masses (n,), velocities (n, 3), charges (n,) or
    None."""

    x: np.ndarray
    mass: np.ndarray
    v: np.ndarray
    charge: np.ndarray | None = None


def body(
    x: ArrayLike,
    mass: ArrayLike,
    *,
    place: ArrayLike = (0, 0, 0),
    turn: Rotation | None = None,
    velocity: ArrayLike = (0, 0, 0),
    spin: ArrayLike = (0, 0, 0),
    charge: np.ndarray | None = None,
) -> Body:
    """A `Body` in rigid motion.

    Args:
        x: (n, 3) shape.  mass: (n,).
        place: of the centre of mass.  turn: rotation of the shape about it.
        velocity: of the centre.  spin: angular velocity, space frame.
    """
    r, mass = np.array(x, float), np.array(mass, float)
    r = r - mass @ r / mass.sum()
    r = turn.apply(r) if turn is not None else r
    v = np.cross(np.asarray(spin, float), r) + np.asarray(velocity, float)
    return Body(r + np.asarray(place, float), mass, v, charge)


def moments(x: np.ndarray, mass: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The principal moments, from the largest, and their axes as columns."""
    r = x - mass @ x / mass.sum()
    inertia = np.einsum("i,ij,ik->jk", mass, r, r)
    inertia = np.trace(inertia) * np.eye(3) - inertia
    values, vectors = np.linalg.eigh(inertia)
    return values[::-1], vectors[:, ::-1]


def three_rods(moment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and masses of six atoms on three axes with these principal moments, about x, y, z;
    none above the sum of the others."""
    # two atoms of unit mass on each axis add 2 d_k^2 to the moments of the other axes
    square = np.maximum(0.0, moment.sum() / 2 - moment) / 2
    return np.concatenate([np.diag(np.sqrt(square)), -np.diag(np.sqrt(square))]), np.ones(6)


def symmetric_top(turn: Rotation, spin: np.ndarray, moment: np.ndarray, time: float) -> Rotation:
    """The exact orientation of a free top with two equal moments after some time: its axis
    precesses about the angular momentum, and it rotates about its axis, both at constant rates
    (Landau and Lifshitz, Mechanics, section 33).

    Args:
        turn: rotation from the top's frame to space at time 0.
        spin: (3,) angular velocity at that time, in the top's frame.
        moment: (3,) principal moments, the first two equal.
    """
    circle = Rotation.from_rotvec(time * turn.apply(moment * spin) / moment[0])
    about = spin[2] * (1 - moment[2] / moment[0])
    return circle * turn * Rotation.from_rotvec([0, 0, time * about])


def scene(
    folder: Path | str,
    bodies: list[Body],
    setup: Sequence[str],
    *,
    box: ArrayLike,
    dt: float,
    corner: ArrayLike = (0, 0, 0),
    bonded: bool = False,
    name: str = "bodies",
    **more,
) -> Scene:
    """Write a data file and return its ``Scene``.

    Args:
        folder: parent of a folder ``name``.
        setup: LAMMPS commands after read_data.
        box: (3,) lengths.  corner: the lowest one.
        bonded: whether the bodies are `BENT`, with bonds and angle for fix shake; single atoms may
            follow.
        more: fields of ``Scene``.
    """
    # a separate folder: other files in it would change the hash of the inputs of its runs
    folder = Path(folder) / name
    folder.mkdir(parents=True, exist_ok=True)
    sizes = [len(body.mass) for body in bodies]
    mass, x, v = (
        np.concatenate([getattr(body, key) for body in bodies]) for key in ("mass", "x", "v")
    )
    charge = [np.zeros(len(body.mass)) if body.charge is None else body.charge for body in bodies]
    molecule = np.repeat(np.arange(1, len(bodies) + 1), sizes)
    kinds, kind = np.unique(mass, return_inverse=True)
    box, corner = np.broadcast_to(box, 3).astype(float), np.array(corner, float)
    image = np.floor((x - corner) / box).astype(int)
    n = sum(size > 1 for size in sizes)
    atoms = [molecule, kind + 1, np.concatenate(charge), x - image * box, image]
    terms: dict[str, list] = {
        "bonds": [
            (1, atom + 1, atom + 1 + other) for atom in range(0, 3 * n, 3) for other in (1, 2)
        ],
        "angles": [(1, atom + 2, atom + 1, atom + 3) for atom in range(0, 3 * n, 3)],
    }
    content = data_file(
        "full",
        atoms,
        np.stack([corner, corner + box], axis=1),
        mass=kinds,
        velocities=[v],
        terms=terms if bonded else None,
    )
    data = folder / "data.bodies"
    if not data.exists() or data.read_text() != content:
        data.write_text(content)
    styles = ("bond_style zero", "angle_style zero") if bonded else ()
    held = (f"bond_coeff 1 {BOND}", f"angle_coeff 1 {ANGLE}") if bonded else ()
    read = "units lj", "atom_style full", "atom_modify map yes", *styles, "read_data data.bodies"
    more = {
        "group": "all",
        "constraints": SHAKEN if bonded else None,
        **more,
        "folder": folder.resolve(),
        "setup": (*read, *held, *setup),
        "dt": dt,
        "unit": n,
    }
    return Scene(name=name, title="", bodies="molecule", units="lj", **more)


def turned(seed: int) -> Rotation:
    """A random ``Rotation``."""
    return Rotation.random(random_state=np.random.default_rng(seed))
