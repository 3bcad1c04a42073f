"""Small scenes in reduced units for the stability atlas: bodies and their data file."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from validation.scenes import Scene

# a bent triatomic, which fix shake can hold too; lengths in sigma
BOND, ANGLE = 0.7, 104.0
_HALF = np.radians(ANGLE) / 2
BENT = BOND * np.array(
    [[0, 0, 0], [np.sin(_HALF), np.cos(_HALF), 0], [-np.sin(_HALF), np.cos(_HALF), 0]]
)
MASSES = np.array([2.0, 1.0, 0.5])  # all different: an asymmetric top
SHAKEN = "b 1 a 1"  # BENT in fix shake's words
FREE = "pair_style zero 1.0", "pair_coeff * *"


class Body(NamedTuple):
    """Atoms that are rigid together: positions (n, 3), masses (n,), velocities (n, 3), charges (n,) or None."""

    x: np.ndarray
    mass: np.ndarray
    v: np.ndarray
    charge: np.ndarray | None = None


def body(x, mass, *, place=(0, 0, 0), turn=None, velocity=(0, 0, 0), spin=(0, 0, 0), charge=None):
    """A `Body` in rigid motion.

    Args:
        x: (n, 3) shape.  mass: (n,).
        place: of the centre of mass.  turn: a scipy ``Rotation`` of the shape about it.
        velocity: of the centre.  spin: angular velocity, space frame.
    """
    x, mass = np.array(x, float), np.array(mass, float)
    x = x - mass @ x / mass.sum()
    x = turn.apply(x) if turn is not None else x
    return Body(x + place, mass, np.cross(spin, x) + velocity, charge)


def moments(x, mass):
    """Principal moments, from the largest, and their axes as columns."""
    r = x - mass @ x / mass.sum()
    inertia = np.einsum("i,ij,ik->jk", mass, r, r)
    inertia = np.trace(inertia) * np.eye(3) - inertia
    values, vectors = np.linalg.eigh(inertia)
    return values[::-1], vectors[:, ::-1]


def three_rods(moment):
    """Shape and masses of six atoms on three axes with these principal moments, axis by axis; no one above the sum of the others.

    Args:
        moment: (3,), about x, y, z.
    """
    square = (
        np.maximum(0.0, moment.sum() / 2 - moment) / 2
    )  # two atoms of unit mass on each axis: 2 d_k^2 is what this axis adds to the others
    return np.concatenate([np.diag(np.sqrt(square)), -np.diag(np.sqrt(square))]), np.ones(6)


def symmetric_top(turn, spin, moment, time):
    """Where a free top with two equal moments is turned to after some time, exactly: its axis circles about the angular momentum, and it turns
    about its axis, both at constant rates (Landau and Lifshitz, Mechanics, section 33).

    Args:
        turn: ``Rotation`` from the top's frame to space at time 0.
        spin: (3,) angular velocity then, in the top's frame.
        moment: (3,) principal moments, the first two equal.
    Returns:
        the ``Rotation`` then.
    """
    about = spin[2] * (1 - moment[2] / moment[0])
    return (
        Rotation.from_rotvec(time * turn.apply(moment * spin) / moment[0])
        * turn
        * Rotation.from_rotvec([0, 0, time * about])
    )


def scene(folder, bodies, setup, *, box, dt, corner=(0, 0, 0), bonded=False, name="bodies", **more):
    """Write a data file and give the ``Scene`` of it.

    Args:
        folder: where to: into a folder called ``name`` there.
        bodies: list of `Body`.
        setup: LAMMPS commands after read_data.
        box: (3,) lengths.  corner: the lowest one.
        dt: time step.
        bonded: whether the bodies are `BENT`, with bonds and angle so that fix shake takes them; single atoms may follow.
        more: as ``Scene`` has it.
    """
    folder = (
        Path(folder) / name
    )  # of its own: what else comes there would change the hash of what its runs follow from
    folder.mkdir(parents=True, exist_ok=True)
    mass = np.concatenate([one.mass for one in bodies])
    x, v = (np.concatenate([getattr(one, key) for one in bodies]) for key in ("x", "v"))
    charge = np.concatenate(
        [np.zeros(len(one.mass)) if one.charge is None else one.charge for one in bodies]
    )
    molecule = np.concatenate([[k] * len(one.mass) for k, one in enumerate(bodies, 1)])
    kinds, kind = np.unique(mass, return_inverse=True)
    box, corner = np.broadcast_to(box, 3).astype(float), np.array(corner, float)
    image = np.floor((x - corner) / box).astype(int)
    x = x - image * box
    n = sum(len(one.mass) > 1 for one in bodies)
    text = ["rigid bodies", "", f"{len(x)} atoms", f"{len(kinds)} atom types"]
    text += [f"{2 * n} bonds", "1 bond types", f"{n} angles", "1 angle types"] if bonded else []
    text += [
        "",
        *(
            f"{low:.17g} {low + length:.17g} {c}lo {c}hi"
            for low, length, c in zip(corner, box, "xyz")
        ),
    ]
    text += [
        "",
        "Masses",
        "",
        *(f"{k} {m:.17g}" for k, m in enumerate(kinds, 1)),
        "",
        "Atoms # full",
        "",
    ]
    rows = zip(molecule, kind + 1, charge, x, image)
    text += [
        f"{i} {m} {k} {q:.17g} {_words(r)} {' '.join(map(str, w))}"
        for i, (m, k, q, r, w) in enumerate(rows, 1)
    ]
    text += ["", "Velocities", "", *(f"{i} {_words(u)}" for i, u in enumerate(v, 1)), ""]
    if bonded:
        text += [
            "Bonds",
            "",
            *(f"{2 * k + j} 1 {3 * k + 1} {3 * k + 1 + j}" for k in range(n) for j in (1, 2)),
        ]
        text += [
            "",
            "Angles",
            "",
            *(f"{k + 1} 1 {3 * k + 2} {3 * k + 1} {3 * k + 3}" for k in range(n)),
            "",
        ]
    data = folder / "data.bodies"
    content = "\n".join(text)
    if not data.exists() or data.read_text() != content:
        data.write_text(content)
    held = (f"bond_coeff 1 {BOND}", f"angle_coeff 1 {ANGLE}") if bonded else ()
    styles = ("bond_style zero", "angle_style zero") if bonded else ()
    return Scene(
        name=name, title="", folder=folder.resolve(), bodies="molecule", units="lj", dt=dt, unit=n,
        constraints=SHAKEN if bonded else None,
        setup=("units lj", "atom_style full", "atom_modify map yes", *styles, "read_data data.bodies", *held, *setup), **{"group": "all"} | more,
    )  # fmt: skip


def _words(vector):
    return " ".join(f"{c:.17g}" for c in vector)


def turned(seed):
    """A random ``Rotation``."""
    return Rotation.random(random_state=np.random.default_rng(seed))


def drifting(scene, velocity):
    """The scene with a velocity more for all atoms."""
    more = "velocity all set {:.17g} {:.17g} {:.17g} sum yes units box".format(*velocity)
    return replace(scene, setup=(*scene.setup, more))
