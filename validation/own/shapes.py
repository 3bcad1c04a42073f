"""What a script's bodies are: kinds, shapes, moments, how fast they turn and shake.

From the atoms that ``reader`` has left; in LAMMPS's units of the script.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..statistics import measures
from . import finding
from .system import Own

THIN = 1e-7  # of its largest moment: a smaller one counts as zero, as in fix_nosquish
# (kinetic energy in LAMMPS's units) over (mass x velocity^2), which LAMMPS calls mvv2e
MVV2E = {"real": 2390.0573615334906, "metal": 1.0364269e-4, "electron": 1.06657236}
PAIRS, SWEEPS = 100, 5  # atoms of a body whose pairs are all looked at; ways across a larger one
NEAR, MOST, AT_ONCE = 8, 512, 5_000_000  # neighbours of an atom; of all atoms at a time


@dataclass(frozen=True)
class Kind:
    """Bodies of the same atoms.

    Attributes:
        name: its atoms' types with their numbers, as "2:1 1:2".
        number: of bodies.  atoms: of each.
        shape: in a word.  freedom: degrees of freedom of each.
        mass, size: of each; its largest distance between two atoms, see `width`.
        moments: (3,) principal moments, the largest first, means.
        scatter: largest relative deviation of a body's moment from the mean.
        angle: rms angle that one turns in a step at the temperature about its fastest axis.
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


@dataclass(frozen=True)
class Bodies:
    """All bodies, as arrays in order of their number.

    Attributes:
        groups: arrays (bodies, n): atoms of all bodies of n atoms, for each n.
        keys: of each group the name of each body's kind.
        apart: of each group (bodies, n, 3), atoms about their centres, put together by images.
        moments: of each group (bodies, 3), the largest first; and ``axes`` (bodies, 3, 3), columns.
        gap: how much larger a body is by its image flags than by nearest images, at most.
    """

    groups: list[np.ndarray]
    keys: list[np.ndarray]
    apart: list[np.ndarray]
    moments: list[np.ndarray]
    axes: list[np.ndarray]
    gap: float


def bodies(own: Own) -> Bodies:
    """The script's bodies."""
    body, atoms = own.found.body, own.atoms
    order = np.argsort(body, kind="stable")
    order = order[body[order] > 0]
    _, first, sizes = np.unique(body[order], return_index=True, return_counts=True)
    found = Bodies([], [], [], [], [], 0.0)
    cell = np.array(own.said["cell"])
    periodic = own.said["periodic"]
    gap = 0.0
    for n in np.unique(sizes):
        group = order[first[sizes == n][:, None] + np.arange(n)]
        x, mass = atoms["x"][group], atoms["mass"][group]
        flagged = x + atoms["image"][group] @ cell
        near = x[:, :1] + measures.nearest_image(x - x[:, :1], cell, periodic)
        gap = max(gap, float(np.max(np.ptp(flagged, axis=1) - np.ptp(near, axis=1), initial=0.0)))
        r = near if n < 3 or gap > 0.5 * cell.max() else flagged
        r = r - np.average(r, axis=1, weights=np.broadcast_to(mass[..., None], r.shape))[:, None]
        square = (r**2).sum(axis=2)
        tensor = np.einsum("bn,bn,ij->bij", mass, square, np.eye(3))
        tensor -= np.einsum("bn,bni,bnj->bij", mass, r, r)
        moments, axes = np.linalg.eigh(tensor)
        found.groups.append(group)
        found.apart.append(r)
        found.moments.append(moments[:, ::-1])
        found.axes.append(axes[:, :, ::-1])
        types = np.sort(atoms["type"][group], axis=1)
        found.keys.append(np.array([_name(row) for row in types]))
    return Bodies(found.groups, found.keys, found.apart, found.moments, found.axes, gap)


def _name(types) -> str:
    kinds, counts = np.unique(types, return_counts=True)
    return " ".join(f"{number}×{kind}" for kind, number in zip(kinds, counts))


def kinds(own: Own, made: Bodies) -> list[Kind]:
    """The bodies by kind."""
    found, flat = [], own.said["dimension"] == 2
    energy = thermal(own)
    for group, keys, r, moments in zip(made.groups, made.keys, made.apart, made.moments):
        for key in dict.fromkeys(keys):
            mine = keys == key
            own_moments = moments[mine]
            mean = own_moments.mean(axis=0)
            shape, freedom = _shape(mean, flat)
            least = (
                mean[0] if flat else mean[mean > THIN * max(mean[0], 1e-300)].min(initial=np.inf)
            )
            turning = np.sqrt(energy / (least * mvv2e(own))) * own.scene.dt if freedom > 3 else 0.0
            off = np.abs(own_moments - mean).max() / max(mean[0], 1e-300)
            mass = float(own.atoms["mass"][group[mine]].sum(axis=1).mean())
            number, atoms = group[mine].shape
            found.append(
                Kind(
                    *(str(key), number, atoms, shape, freedom, mass, width(r[mine])),
                    *(tuple(map(float, mean)), float(off), float(turning)),
                )
            )
    return found


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


def width(r: np.ndarray) -> float:
    """The largest distance between two atoms of a body.

    Of bodies of more than `PAIRS` atoms it is looked for from the centre to the farthest atom, from
    there to the farthest one, and so on: so it can be too small by some per cent.

    Args:
        r: (bodies, n, 3), atoms about their centres.
    """
    number, n, _ = r.shape
    if n <= PAIRS:
        turned = (np.roll(r, shift, axis=1) for shift in range(1, n // 2 + 1))
        return max((float(np.linalg.norm(r - one, axis=2).max()) for one in turned), default=0.0)
    end, apart = np.zeros((number, 3)), np.zeros(number)
    for _ in range(SWEEPS):
        far = np.linalg.norm(r - end[:, None], axis=2)
        end, apart = r[np.arange(number), far.argmax(axis=1)], far.max(axis=1)
    return float(apart.max())


def mvv2e(own: Own) -> float:
    """Energy over mass times the square of velocity, in the script's units."""
    return MVV2E.get(own.scene.units, 1.0)


def temperature(own: Own) -> float:
    """That the script keeps, where it is a number; else what it has at its start."""
    try:
        return float((own.found.state.temp or ("",))[0])
    except ValueError:
        return own.said["temperature"]


def thermal(own: Own) -> float:
    """kT in the script's energy."""
    return own.said["boltzmann"] * temperature(own)


def fastest(own: Own, made: Bodies) -> dict[str, float]:
    """Angular frequencies (1/time) of the stiffest motions that forces of the start tell, if they
    are those of springs in equilibrium: mean square force = kT x spring constant.  A thermostat's
    noise is none of them.

    Returns:
        of ``centres``, ``turning`` (about the axis where it is largest) and ``other atoms``, those
        that have a force: an ideal gas and what ``fix setforce`` holds have none.
    """
    energy, atoms = thermal(own), own.atoms
    force = atoms["f"]
    found: dict[str, float] = {}
    if not energy > 0:
        return found
    for group, keys, r, moments, axes in zip(
        made.groups, made.keys, made.apart, made.moments, made.axes
    ):
        f = force[group]
        torque = np.einsum("bik,bi->bk", axes, np.cross(r, f).sum(axis=1))
        mass = atoms["mass"][group].sum(axis=1)
        for key in dict.fromkeys(keys):
            mine = keys == key
            square = (f[mine].sum(axis=1) ** 2).mean() / mass[mine].mean()
            found["centres"] = max(found.get("centres", 0.0), square)
            mean = moments[mine].mean(axis=0)
            some = mean > THIN * max(mean[0], 1e-300)
            if own.said["dimension"] == 2:
                some &= np.array([True, False, False])
            if some.any():
                each = (torque[mine] ** 2).mean(axis=0)[some] / mean[some]
                found["turning"] = max(found.get("turning", 0.0), each.max())
    free = own.found.body == 0
    for kind in np.unique(atoms["type"][free]):
        mine = free & (atoms["type"] == kind)
        square = (force[mine] ** 2).mean() / atoms["mass"][mine].mean()
        found["other atoms"] = max(found.get("other atoms", 0.0), square)
    unit = energy * mvv2e(own)
    return {name: float(np.sqrt(one / unit)) for name, one in found.items() if one > 0}


def nearest(own: Own) -> tuple[float, int, int] | None:
    """The nearest two atoms of different bodies (or of none) that are not bonded: distance and IDs.

    An atom deep in a large body, with `MOST` nearer ones of its own, is left out.
    """
    cell, periodic = np.array(own.said["cell"]), own.said["periodic"]
    if not np.allclose(cell, np.diag(np.diag(cell))):
        return None
    x = own.atoms["x"] - own.atoms["x"].min(axis=0)
    box = np.where(periodic, np.diag(cell), 0.0)
    x = np.where(periodic, np.mod(own.atoms["x"], np.diag(cell)), x)
    tree, number, body = cKDTree(x, boxsize=box), len(x), own.found.body
    bonds = np.sort(np.asarray(own.atoms.get("bonds", np.empty((0, 3), int)))[:, 1:] - 1, axis=1)
    bonded = bonds @ (number, 1)
    best, left, k = (np.inf, 0, 0), np.arange(number), min(NEAR, number)
    while len(left):
        rest = []
        for some in np.array_split(left, -(-len(left) * k // AT_ONCE)):
            apart, other = map(np.asarray, tree.query(x[some], k=np.arange(1, k + 1)))
            own_body = ((body[other] == body[some, None]) & (body[other] > 0)) | (
                other == some[:, None]
            )
            pairs = np.minimum(other, some[:, None]) * number + np.maximum(other, some[:, None])
            free = np.where(own_body | np.isin(pairs, bonded), np.inf, apart)
            i, j = np.unravel_index(np.argmin(free), free.shape)
            if free[i, j] < best[0]:
                best = float(free[i, j]), int(some[i]), int(other[i, j])
            rest.append(some[apart[:, -1] < best[0]])
        left = np.concatenate(rest)
        if k == min(MOST, number):
            break
        k = min(4 * k, MOST, number)
    return (best[0], best[1] + 1, best[2] + 1) if np.isfinite(best[0]) else None


def moved(own: Own) -> Mapping[str, np.ndarray]:
    """Which atoms each fix of the script moves that is known to move atoms, as masks."""
    found: dict[str, np.ndarray] = {}
    for one, line in own.said["fixes"].items():
        style = finding.style_of(line)
        mover = style.split("/")[0] in ("nve", "nvt", "npt", "nph", "rigid", "move", "nosquish")
        if mover or style == "python/move" or style.startswith("brownian"):
            found[one] = finding.acted_on(own.said, own.atoms, line)
    return found
