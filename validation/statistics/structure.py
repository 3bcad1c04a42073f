"""What a run's atoms tell: how far bodies are from a reference, what holds them, g(r),
kinetic energies of single bodies."""

import contextlib
import io
import logging
import warnings
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import mdtraj
import numpy as np
from scipy.spatial.transform import Rotation

from . import measures
from .estimate import Estimate
from .positions import Positions

logging.getLogger("pymbar").setLevel(logging.ERROR)  # that it has no JAX

import physical_validation  # noqa: E402  it imports pymbar

records = physical_validation.data

KCAL = 1e7 / 4184  # kcal/mol in a g/mol (Angstrom/fs)^2
STRAIGHT = 1e-6  # of a body's length that a linear one may be wide
REACH, BIN = (2.0, 8.0), 0.1  # Angstrom, of g(r)
BLOCKS = 5  # of a run's frames, for the noise of g(r)
# samples, for physical_validation; the seed is of its resampling
INDEPENDENT = {"verbosity": 0, "bootstrap_seed": 1, "data_is_uncorrelated": True}


class Motion:
    """Bodies and atoms of a run, from what it left (see ``worker``).

    Attributes:
        x, v: (frames, atoms, 3), Angstrom and Angstrom/fs.
        mass: (atoms,) g/mol.
        groups: arrays (bodies, n): the atoms of all bodies of n atoms, for each n.
        count: number of bodies.  free: number of atoms in no body.
    """

    def __init__(self, positions: Positions) -> None:
        self.x, self.v, self.mass = positions.x, positions.v, positions.mass
        self.bodies, self._bonds, self._angles = positions.bodies, positions.bonds, positions.angles
        self.cell, self.periodic = positions.cell, positions.periodic
        self.cells = positions.cells
        order = np.argsort(self.bodies, kind="stable")
        order = order[self.bodies[order] != 0]
        _, first, sizes = np.unique(self.bodies[order], return_index=True, return_counts=True)
        self.groups = [order[first[sizes == n][:, None] + np.arange(n)] for n in np.unique(sizes)]
        self.count, self.free = len(first), int(np.sum(self.bodies == 0))

    def _image(self, d):
        return measures.nearest_image(d, self.cell, self.periodic)

    def _parts(self, x, group):
        """Centres of mass (bodies, 3) and atoms about them (bodies, n, 3), each body put
        together."""
        r, mass = x[group], self.mass[group][..., None]
        r = r[:, :1] + self._image(r - r[:, :1])
        centre = (mass * r).sum(axis=1) / mass.sum(axis=1)
        return centre, r - centre[:, None]

    def distance(self, frame: int, exact: np.ndarray) -> Estimate:
        """Root mean square over all bodies of how far their centres of mass are from those of
        ``exact``, (atoms, 3); Angstrom."""
        moved = [
            self._image(self._parts(self.x[frame], group)[0] - self._parts(exact, group)[0])
            for group in self.groups
        ]
        return _rms(np.linalg.norm(np.concatenate(moved), axis=1))

    def angle(self, frame: int, exact: np.ndarray) -> Estimate:
        """Root mean square over all bodies of the angle of the rotation that fits them best to
        ``exact``; radians.

        Of linear bodies the angle between their axes; single atoms do not count.  The fit is by
        singular values (Kabsch, Acta Cryst. A32, 922, 1976).
        """
        angles = []
        for group in self.groups:
            if group.shape[1] > 1:
                a, b = self._parts(exact, group)[1], self._parts(self.x[frame], group)[1]
                straight = _straight(a)
                angles += [_between(a[straight], b[straight]), _turned(a[~straight], b[~straight])]
        return _rms(np.concatenate(angles))

    def bond_error(self) -> float:
        """Largest change of a bond within a body from its length at the start, in all frames;
        Angstrom."""
        i, j = self._within(self._bonds).T
        length = np.linalg.norm(self._image(self.x[:, i] - self.x[:, j]), axis=-1)
        return np.abs(length - length[0]).max()

    def angle_error(self) -> float:
        """Largest change of an angle within a body of three atoms from the start's, in all frames;
        radians."""
        sizes = np.bincount(self.bodies)
        rows = self._within(self._angles)
        i, centre, k = rows[sizes[self.bodies[rows[:, 0]]] == 3].T
        a, b = (self._image(self.x[:, end] - self.x[:, centre]) for end in (i, k))
        angle = np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))
        return np.abs(angle - angle[0]).max()

    def _within(self, rows):
        """Those of which all atoms are in one body."""
        body = self.bodies[rows]
        return rows[(body[:, 0] != 0) & (body == body[:, :1]).all(axis=1)]

    def turning(self, dimension: int) -> int:
        """Degrees of freedom of all bodies' turning."""
        found = 0
        for group in self.groups:
            bodies, atoms = group.shape
            if atoms > 1 and dimension == 2:
                found += bodies
            elif atoms > 1:
                found += 3 * bodies - int(_straight(self._parts(self.x[0], group)[1]).sum())
        return found

    def kinetic(self, frames: Sequence[int] | slice) -> np.ndarray:
        """Kinetic energies of the nonlinear bodies of three atoms, which every integrator holds as
        a whole: (frames, bodies), kcal/mol."""
        (group,) = (group for group in self.groups if group.shape[1] == 3)
        group = group[~_straight(self._parts(self.x[0], group)[1])]
        square = self.mass[group][..., None] * self.v[frames][:, group] ** 2
        return KCAL / 2 * square.sum(axis=(2, 3))


def _rms(distances):
    """`Estimate` of it, of independent distances."""
    square = distances**2
    value, number = np.sqrt(square.mean()), len(square)
    if not value or number < 2:
        return Estimate(value)
    return Estimate(value, square.std(ddof=1) / np.sqrt(number) / (2 * value), number - 1)


def _straight(r):
    """Which bodies are linear, of atoms (bodies, n, 3) about their centres."""
    if r.shape[1] == 2:
        return np.ones(len(r), bool)
    singular = np.linalg.svd(r, compute_uv=False)
    return singular[:, 1] < STRAIGHT * singular[:, 0]


def _between(a, b):
    """Angles (bodies,) between the axes of linear bodies, each from its centre to its farthest
    atom."""
    far = np.argmax((a**2).sum(axis=2), axis=1)
    a, b = a[np.arange(len(a)), far], b[np.arange(len(b)), far]
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))


def _turned(a, b):
    """Angles (bodies,) of the rotations that fit ``a`` to ``b`` best, both (bodies, n, 3) about
    their centres."""
    u, _, v = np.linalg.svd(np.swapaxes(b, 1, 2) @ a)
    u[:, :, 2] *= np.linalg.det(u @ v)[:, None]
    return Rotation.from_matrix(u @ v).magnitude() if len(a) else np.empty(0)


def pair_distribution(
    motion: Motion,
    frames: Sequence[int] | slice,
    reach: Sequence[float] = REACH,
    width: float = BIN,
    blocks: int = BLOCKS,
) -> np.ndarray:
    """g(r) of the bodies' heaviest atoms, by mdtraj: (blocks, bins), of successive parts of the
    frames; bins of ``width`` in ``reach``."""
    most = [(group, np.argmax(motion.mass[group], axis=1)) for group in motion.groups]
    heaviest = np.concatenate([group[np.arange(len(group)), at] for group, at in most])
    x = motion.x[frames][:, heaviest]
    return of_sites(x, motion.cells[frames], reach, width, blocks)


def of_sites(
    x: np.ndarray,
    cells: np.ndarray,
    reach: Sequence[float],
    width: float = BIN,
    blocks: int = BLOCKS,
) -> np.ndarray:
    """g(r) of equal atoms, (blocks, bins), of successive parts of the frames.

    Args:
        x: (frames, atoms, 3), in any unit of length.  cells: (frames, 3, 3), vectors as rows.
        reach: ends of the bins, which have this ``width``.
    """
    # mdtraj has single precision, in which a volume in m^3 is 0: lengths go in of order one
    scale = 1 / reach[1]
    top = mdtraj.Topology()
    residue = top.add_residue("HOH", top.add_chain())
    for _ in range(x.shape[1]):
        top.add_atom("O", mdtraj.element.oxygen, residue)
    path = mdtraj.Trajectory(x * scale, top)
    path.unitcell_vectors = cells * scale
    pairs = top.select_pairs("all", "all")
    ends = [end * scale for end in reach]
    parts = np.array_split(np.arange(path.n_frames), blocks)
    # by a width it rounds their number down, as where 53 of them come to 52.999...
    how = {"r_range": ends, "n_bins": round((reach[1] - reach[0]) / width)}
    return np.array([mdtraj.compute_rdf(path[part], pairs, **how)[1] for part in parts])


def _quiet(function, *arguments, **more):
    """Call, without what it prints."""
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function(*arguments, **more)


def _data(temperature, natoms, held=0, pressure=None, **more):
    """physical_validation's record of a whole at this temperature, and pressure if there is one."""
    none = dict.fromkeys(("nconstraints", "ndof_reduction_rot"), 0)
    first = {"molecule_idx": [0], "nconstraints_per_molecule": [0]}
    system = records.SystemData(
        natoms=natoms, mass=np.ones(natoms), ndof_reduction_tra=held, **none, **first
    )
    kind = "NVT" if pressure is None else "NPT"
    state = {"volume": 1.0, "temperature": temperature, "pressure": pressure}
    ensemble = records.EnsembleData(kind, natoms=natoms, **state)
    how = {"units": records.UnitData.units("LAMMPS real"), "system": system, "ensemble": ensemble}
    return records.SimulationData(observables=records.ObservableData(**more), **how)


def distribution(energies: np.ndarray, temperature: float, bodies: int = 1, held: int = 0) -> float:
    """How far the kinetic energies of nonlinear bodies are from the canonical distribution, in
    standard deviations.

    A single body among many is a small part of a large whole, so its distribution is canonical also
    where the whole's energy is constant.  physical_validation holds mean and width against the
    gamma distribution; the larger distance counts.

    Args:
        energies: independent ones, kcal/mol.
        temperature: K.
        bodies: how many an energy is of.
        held: degrees of freedom that are not theirs, as those of a total momentum that is zero.
    """
    # two atoms' degrees of freedom are six, a body's
    data = _data(temperature, 2 * bodies, held, kinetic_energy=energies)
    found = _quiet(physical_validation.kinetic_energy.distribution, data, **INDEPENDENT)
    return max(abs(distance) for distance in found)


def equipartition(
    translation: np.ndarray,
    rotation: np.ndarray,
    moving: float,
    turning: float,
    temperature: float,
) -> float:
    """How far the mean kinetic energies of translation and of rotation are from the temperature, in
    standard deviations.

    By physical_validation; the larger distance of the two counts.  The widths are not looked at,
    which are not canonical where the whole's energy is constant.

    Args:
        translation, rotation: (samples,) kcal/mol of the whole, independent ones.
        moving, turning: their degrees of freedom.
        temperature: K.
    """
    names = "total", "translational", "rotational and internal", "rotational", "internal"
    data = _data(temperature, natoms=2)
    data.system.ndof_per_molecule = [
        dict(zip(names, (moving + turning, moving, turning, turning, 0)))
    ]
    data.observables.kinetic_energy_per_molecule = [
        dict(zip(names, ([t + r], [t], [r], [r], [0]))) for t, r in zip(translation, rotation)
    ]
    # not looked at, for energies are there
    nothing = np.zeros((len(translation), 2, 3))
    data.trajectory = records.TrajectoryData(nothing, nothing)
    found = _quiet(physical_validation.kinetic_energy.equipartition, data, **INDEPENDENT)
    _, (translational, _), (rotational, _), *_ = found
    return max(abs(translational), abs(rotational))


class Sampled(NamedTuple):
    """A series at constant temperature and pressure: K, atm, and (2, samples) of the potential
    energy, kcal/mol, and the volume, Angstrom^3; a few samples for each independent one."""

    temperature: float
    pressure: float
    values: np.ndarray


def between_states(first: Sampled, second: Sampled) -> float | None:
    """How far two states' distributions are from the canonical ones, in standard deviations; None
    if they overlap too little to tell.

    By physical_validation (Shirts, J. Chem. Theory Comput. 9, 909, 2013).  The logarithm of the
    ratio of two distributions is a straight line, whatever is sampled, and its slope is known: of
    volumes at two pressures, or of enthalpies at two temperatures.  No force field and no limit of
    small steps is needed.
    """
    runs = [
        _data(temperature, 2, pressure=pressure, potential_energy=energies, volume=volumes)
        for temperature, pressure, (energies, volumes) in (first, second)
    ]
    try:
        (found,) = _quiet(physical_validation.ensemble.check, *runs, **INDEPENDENT)
    except (physical_validation.util.error.InputError, np.linalg.LinAlgError):
        return None
    return found


def convergence(deviations: Mapping[float, np.ndarray]) -> float:
    """physical_validation's largest deviation of the ratios of the energy's standard deviations
    from the square of the steps' ratios.

    Args:
        deviations: time step to (samples,).
    """
    units, runs = records.UnitData.units("LAMMPS real"), []
    for dt, values in deviations.items():
        observables = records.ObservableData(constant_of_motion=values)
        runs.append(records.SimulationData(units=units, dt=dt, observables=observables))
    return _quiet(physical_validation.integrator.convergence, runs, verbose=False)
