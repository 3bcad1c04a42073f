"""Kinds, shapes and moments of inertia of a script's bodies, and their fastest motions.

From the output of ``reader``, in the script's units.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..statistics import measures
from . import rigid_atoms
from .loader import UserScript

THIN = 1e-7  # relative to the largest moment: a smaller one counts as zero, as in fix_nosquish
# (kinetic energy in LAMMPS's units) over (mass x velocity^2), which LAMMPS calls mvv2e
MVV2E = {"real": 2390.0573615334906, "metal": 1.0364269e-4, "electron": 1.06657236}


@dataclass(frozen=True)
class BodyKind:
    """Bodies of the same atoms.

    Attributes:
        name: its atoms' types with their numbers, as "2:1 1:2".
        number: of bodies.  atoms: of each.
        shape: one word.  freedom: degrees of freedom of each.
        mass, size: of each; twice the largest distance of an atom from its centre.
        moments: (3,) principal moments, the largest first, means.
        scatter: largest deviation of a body's moment from the mean, relative to the largest.
        angle: rms rotation in a step about the fastest axis, rad.
    """

    name: str
    number: int
    atoms: int
    shape: str
    freedom: int
    mass: float
    size: float
    moments: tuple[float, ...]
    scatter: float
    angle: float


class BodyGroup(NamedTuple):
    """All bodies of the same atoms, as arrays.

    Attributes:
        name: see `BodyKind`.
        atoms: (bodies, n), from 0.
        apart: (bodies, n, 3), atoms relative to their centres, unwrapped.
        moments: (bodies, 3), the largest first; and ``axes`` (bodies, 3, 3), columns.
    """

    name: str
    atoms: np.ndarray
    apart: np.ndarray
    moments: np.ndarray
    axes: np.ndarray


def body_groups(script: UserScript) -> tuple[list[BodyGroup], float]:
    """The script's bodies by kind; and the largest difference of a body's extent by image flags
    from that by nearest images."""
    atoms, cell, periodic = (
        script.atoms,
        np.array(script.reading["cell"]),
        script.reading["periodic"],
    )
    groups, gap = [], 0.0
    for every in measures.body_groups(script.rigid.body):
        names = np.array([_name(row) for row in np.sort(atoms["type"][every], axis=1)])
        for name in dict.fromkeys(names):
            group = every[names == name]
            x, mass = atoms["x"][group], atoms["mass"][group]
            flagged = x + atoms["image"][group] @ cell
            near = x[:, :1] + measures.nearest_image(x - x[:, :1], cell, periodic)
            wider = np.ptp(flagged, axis=1) - np.ptp(near, axis=1)
            gap = max(gap, float(np.max(wider, initial=0.0)))
            r = near if group.shape[1] < 3 or gap > 0.5 * cell.max() else flagged
            r = r - (np.einsum("bn,bnk->bk", mass, r) / mass.sum(axis=1)[:, None])[:, None]
            tensor = np.einsum("bn,bnk,bnk,ij->bij", mass, r, r, np.eye(3))
            tensor -= np.einsum("bn,bni,bnj->bij", mass, r, r)
            moments, axes = np.linalg.eigh(tensor)
            groups.append(BodyGroup(str(name), group, r, moments[:, ::-1], axes[:, :, ::-1]))
    return groups, gap


def _name(types) -> str:
    kinds, counts = np.unique(types, return_counts=True)
    return " ".join(f"{number}×{kind}" for kind, number in zip(kinds, counts))


def body_kinds(script: UserScript, groups: Sequence[BodyGroup]) -> list[BodyKind]:
    """The bodies by kind."""
    kinds, flat = [], script.reading["dimension"] == 2
    for name, group, r, moments, _ in groups:
        mean = moments.mean(axis=0)
        shape, freedom = _shape(mean, flat)
        largest = max(mean[0], 1e-300)
        least = mean[0] if flat else mean[mean > THIN * largest].min(initial=np.inf)
        turning = (
            np.sqrt(thermal_energy(script) / (least * mvv2e(script))) * script.scene.dt
            if freedom > 3
            else 0
        )
        off = np.abs(moments - mean).max() / largest
        mass = float(script.atoms["mass"][group].sum(axis=1).mean())
        size = 2 * float(np.linalg.norm(r, axis=2).max())
        moment = tuple(map(float, mean))
        number, atoms = group.shape
        kinds.append(
            BodyKind(
                name, number, atoms, shape, freedom, mass, size, moment, float(off), float(turning)
            )
        )
    return kinds


def _shape(moments, flat) -> tuple[str, int]:
    if moments[0] <= 0:
        return "point", 2 if flat else 3
    if flat:
        return "planar (in two dimensions)", 3
    if moments[2] < THIN * moments[0]:
        return "linear", 5
    if abs(moments[0] - moments[1] - moments[2]) < 1e-3 * moments[0]:
        return "planar", 6
    return "three-dimensional", 6


def mvv2e(script: UserScript) -> float:
    """Energy over mass times the square of velocity, in the script's units."""
    return MVV2E.get(script.scene.units, 1.0)


def temperature(script: UserScript) -> float:
    """The temperature of the thermostat if it is a number, else that of the start."""
    try:
        return float((script.rigid.state.temp or ("",))[0])
    except ValueError:
        return script.reading["temperature"]


def thermal_energy(script: UserScript) -> float:
    """kT in the script's units of energy."""
    return script.reading["boltzmann"] * temperature(script)


def fastest_motions(script: UserScript, groups: Sequence[BodyGroup]) -> dict[str, float]:
    """Angular frequencies (1/time) of the stiffest motions, from the forces of the start.

    For harmonic motions in equilibrium mean square force = kT x spring constant.  The forces do not
    include the noise of thermostats.

    Returns:
        of ``centres``, ``turning`` (about the stiffest axis) and ``other atoms``, without those
        that have no force.
    """
    squares = _squares(script, groups)
    most = {
        name: max((square for square, _ in pairs), default=0.0) for name, pairs in squares.items()
    }
    return {name: float(np.sqrt(square)) for name, square in most.items() if square > 0}


def mean_square_frequency(script: UserScript, groups: Sequence[BodyGroup]) -> float:
    """The mean of the squares of `fastest_motions` over all degrees of freedom, 1/time^2."""
    every = [pair for pairs in _squares(script, groups).values() for pair in pairs]
    return float(sum(square * n for square, n in every) / max(sum(n for _, n in every), 1))


def _squares(script: UserScript, groups: Sequence[BodyGroup]) -> dict[str, list]:
    """Squares of angular frequencies, 1/time^2, each with its number of degrees of freedom."""
    mass, force, free = script.atoms["mass"], script.atoms["f"], script.rigid.body == 0
    unit, axes_of_space = thermal_energy(script) * mvv2e(script), script.reading["dimension"]
    squares: dict[str, list] = {"centres": [], "turning": [], "other atoms": []}
    if not unit > 0:
        return squares
    for _, group, r, moments, axes in groups:
        f, mean, number = force[group], moments.mean(axis=0), len(group)
        torque = np.einsum("bik,bi->bk", axes, np.cross(r, f).sum(axis=1))
        centre = (f.sum(axis=1) ** 2).mean() / mass[group].sum(axis=1).mean()
        squares["centres"].append((centre / unit, axes_of_space * number))
        rotating = mean > THIN * max(mean[0], 1e-300)
        if axes_of_space == 2:
            rotating[1:] = False
        turning = (torque**2).mean(axis=0)[rotating] / mean[rotating] / unit
        squares["turning"] += [(square, number) for square in turning]
    for kind in np.unique(script.atoms["type"][free]):
        mine = free & (script.atoms["type"] == kind)
        square = (force[mine] ** 2).mean() / mass[mine].mean() / unit
        squares["other atoms"].append((square, axes_of_space * int(mine.sum())))
    return squares


def atoms_moved_by_fixes(script: UserScript) -> Mapping[str, np.ndarray]:
    """Masks of the atoms that each fix of the script moves, by ID."""
    masks: dict[str, np.ndarray] = {}
    for fix_id, line in script.reading["fixes"].items():
        style = rigid_atoms.style_of(line)
        mover = style.split("/")[0] in ("nve", "nvt", "npt", "nph", "rigid", "move", "nosquish")
        if mover or style == "python/move" or style.startswith("brownian"):
            masks[fix_id] = rigid_atoms.atoms_of_fix(script.reading, script.atoms, line)
    return masks
