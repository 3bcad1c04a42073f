"""Kinds, shapes and moments of inertia of a script's bodies, and their fastest motions.

From the output of ``reader``, in the script's units.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fix_nosquish.bodies.build import TURN

from ..statistics import measures
from . import rigid_atoms
from .commands import split_words
from .loader import UserScript

THIN = 1e-7  # relative to the largest moment: a smaller one counts as zero, as in fix_nosquish
# (kinetic energy in LAMMPS's units) over (mass x velocity^2), which LAMMPS calls mvv2e
MVV2E = {"real": 2390.0573615334906, "metal": 1.0364269e-4, "electron": 1.06657236}
# a force counts as at most this times its rms: one close contact in a start is no estimate
MOST = 5.0
# of `Motion.contacts`: its standard error times the root of the number of bodies; between which
# values motion is no longer harmonic, and how much faster than by mean squares contacts are then
NOISE, CONTACTS, FASTER = 1.63, (1.1, 1.4), (1.0, 3.0)


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
        largest, moved = max(mean[0], 1e-300), chosen_moments(script, mean)
        least = moved[0] if flat else moved[mean > THIN * largest].min(initial=np.inf)
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


def chosen_moments(script: UserScript, moments: np.ndarray) -> np.ndarray:
    """The moments with which bodies rotate, (3,): those of the atoms, or of keyword moments."""
    every = map(split_words, script.rigid.dropped)
    how, *value = next((words[1:] for words in every if words[0] == "moments"), ("scale", "1"))
    if how == "step":
        heat = thermal_energy(script) / mvv2e(script)
        return np.maximum(moments, heat * (script.scene.dt / TURN) ** 2)
    return (np.ones_like(moments) if how == "equal" else moments) * float(value[0])


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


class Motion(NamedTuple):
    """A kind of motion, from the forces of the start.

    Attributes:
        square: mean square of the angular frequency, 1/time^2.  For harmonic motions in equilibrium
            mean square force = kT x spring constant.
        number: of degrees of freedom.
        contacts: <f^4> / (3 <f^2>^2) less its noise, at least 1, as for harmonic motion.  It is
            larger where forces act in short contacts, whose frequency is higher than the mean.
    """

    square: float
    number: int
    contacts: float

    @classmethod
    def of(
        cls, force: np.ndarray, inertia: np.ndarray | float, beside: np.ndarray | None = None
    ) -> list["Motion"]:
        """The motions along the axes, or one for all of them.

        Args:
            force: forces or torques, (bodies, axes).
            inertia: mass or moments times kT, (axes,), or one for all axes.
            beside: the bodies' torques or forces.  Contacts are in both.  In TIP3P water the forces
                alone look like contacts, and yet steps of 14 fs are stable with larger moments.
        """
        contacts = _contacts(force)
        if beside is not None and beside.any() and _contacts(beside) < CONTACTS[0]:
            contacts = 1.0
        square = (force**2).mean(axis=0) / inertia
        if np.ndim(inertia):
            return [cls(float(value), len(force), contacts) for value in square]
        return [cls(float(square.mean()), force.size, contacts)]

    @property
    def fastest(self) -> float:
        """The angular frequency by which a run becomes unstable."""
        faster = float(np.interp(self.contacts, CONTACTS, FASTER))
        return faster * self.contacts * self.square**0.5


def _contacts(force: np.ndarray) -> float:
    """See `Motion`."""
    return max(1.0, _fourth(force) - NOISE / max(len(force), 1) ** 0.5)


def _fourth(force: np.ndarray) -> float:
    """<f^4> / (3 <f^2>^2), mean over the columns that have forces; 1 without any."""
    if not force.any():
        return 1.0
    acting = force[:, force.any(axis=0)]
    square = (acting**2).mean(axis=0)
    relative = np.minimum(acting**2 / square, MOST**2)
    return float((relative**2).mean() / 3)


def fastest_motions(script: UserScript, groups: Sequence[BodyGroup]) -> dict[str, float]:
    """Angular frequencies (1/time) of the stiffest motions, from the forces of the start, which do
    not include the noise of thermostats.

    Returns:
        of ``centres``, ``turning`` (about the stiffest axis) and ``other atoms``, without those
        that have no force.
    """
    every = motions(script, groups)
    most = {
        name: max((motion.fastest for motion in motions_of_part), default=0.0)
        for name, motions_of_part in every.items()
    }
    return {name: float(frequency) for name, frequency in most.items() if frequency > 0}


def mean_square_frequency(script: UserScript, groups: Sequence[BodyGroup]) -> float:
    """The mean square of the angular frequency over all degrees of freedom, 1/time^2."""
    every = [
        motion for motions_of_part in motions(script, groups).values() for motion in motions_of_part
    ]
    total = sum(motion.square * motion.number for motion in every)
    return float(total / max(sum(motion.number for motion in every), 1))


def motions(script: UserScript, groups: Sequence[BodyGroup]) -> dict[str, list[Motion]]:
    """The kinds of motion of ``centres``, ``turning`` and ``other atoms``."""
    mass, force, free = script.atoms["mass"], script.atoms["f"], script.rigid.body == 0
    unit, axes_of_space = thermal_energy(script) * mvv2e(script), script.reading["dimension"]
    motions_by_part: dict[str, list[Motion]] = {"centres": [], "turning": [], "other atoms": []}
    if not unit > 0:
        return motions_by_part
    for _, group, r, moments, axes in groups:
        f, mean = force[group], moments.mean(axis=0)
        moved = chosen_moments(script, mean)
        torque = np.einsum("bik,bi->bk", axes, np.cross(r, f).sum(axis=1))
        whole = mass[group].sum(axis=1).mean() * unit
        pushes = f.sum(axis=1)[:, :axes_of_space]
        rotating = mean > THIN * max(mean[0], 1e-300)
        if axes_of_space == 2:
            rotating[1:] = False
        turns = torque[:, rotating]
        motions_by_part["centres"] += Motion.of(pushes, whole, turns)
        motions_by_part["turning"] += Motion.of(turns, moved[rotating] * unit, pushes)
    for kind in np.unique(script.atoms["type"][free]):
        mine = free & (script.atoms["type"] == kind)
        each = mass[mine].mean() * unit
        motions_by_part["other atoms"] += Motion.of(force[mine, :axes_of_space], each)
    return motions_by_part


def atoms_moved_by_fixes(script: UserScript) -> Mapping[str, np.ndarray]:
    """Masks of the atoms that each fix of the script moves, by ID."""
    masks: dict[str, np.ndarray] = {}
    for fix_id, line in script.reading["fixes"].items():
        style = rigid_atoms.style_of(line)
        first, rest = style.partition("/")[::2]
        if (
            (first in ("nve", "nvt", "npt", "nph", "rigid", "move", "nosquish") and rest != "pairs")
            or style == "python/move"
            or style.startswith("brownian")
        ):
            masks[fix_id] = rigid_atoms.atoms_of_fix(script.reading, script.atoms, line)
    return masks
