"""Degrees of freedom of bodies, g(r), and tests of sampled distributions."""

import contextlib
import io
import logging
import warnings
from collections.abc import Sequence
from typing import NamedTuple

import mdtraj
import numpy as np

from . import measures
from .positions import Positions

logging.getLogger("pymbar").setLevel(logging.ERROR)  # that it has no JAX

import physical_validation  # noqa: E402  it imports pymbar

records = physical_validation.data

STRAIGHT = 1e-6  # largest width of a linear body, in parts of its length
REACH, BIN = (2.0, 8.0), 0.1  # Angstrom, of g(r)
BLOCKS = 5  # of a run's frames, for the noise of g(r)
# samples, for physical_validation; the seed is of its resampling
INDEPENDENT = {"verbosity": 0, "bootstrap_seed": 1, "data_is_uncorrelated": True}


class Motion:
    """Bodies and atoms of a run (see ``worker``).

    Attributes:
        x, v: (frames, atoms, 3), Angstrom and Angstrom/fs.
        mass: (atoms,) g/mol.
        groups: arrays (bodies, n): the atoms of all bodies of n atoms, for each n.
        count: number of bodies.  free: number of atoms in no body.
    """

    def __init__(self, positions: Positions) -> None:
        self.x, self.v, self.mass = positions.x, positions.v, positions.mass
        self.bodies = positions.bodies
        self.cell, self.periodic = positions.cell, positions.periodic
        self.cells = positions.cells
        self.groups = measures.body_groups(self.bodies)
        self.count, self.free = sum(map(len, self.groups)), int(np.sum(self.bodies == 0))

    def _image(self, d):
        return measures.nearest_image(d, self.cell, self.periodic)

    def _parts(self, x, group):
        """Centres of mass (bodies, 3) and atoms about them (bodies, n, 3), unwrapped."""
        r, mass = x[group], self.mass[group][..., None]
        r = r[:, :1] + self._image(r - r[:, :1])
        centre = (mass * r).sum(axis=1) / mass.sum(axis=1)
        return centre, r - centre[:, None]

    def turning(self, dimension: int) -> int:
        """Rotational degrees of freedom of all bodies."""
        freedom = 0
        for group in self.groups:
            bodies, atoms = group.shape
            if atoms > 1 and dimension == 2:
                freedom += bodies
            elif atoms > 1:
                freedom += 3 * bodies - int(_straight(self._parts(self.x[0], group)[1]).sum())
        return freedom


def _straight(r):
    """Mask of the linear bodies; ``r``: atoms about their centres (bodies, n, 3)."""
    if r.shape[1] == 2:
        return np.ones(len(r), bool)
    singular = np.linalg.svd(r, compute_uv=False)
    return singular[:, 1] < STRAIGHT * singular[:, 0]


def pair_distribution(
    motion: Motion,
    frames: Sequence[int] | slice,
    reach: Sequence[float] = REACH,
    width: float = BIN,
    blocks: int = BLOCKS,
) -> np.ndarray:
    """g(r) of the heaviest atom of each body, by mdtraj: (blocks, bins), for successive blocks of
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
    """g(r) of equal atoms, (blocks, bins), for successive blocks of frames.

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
    """Call a function without its output."""
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function(*arguments, **more)


def _data(temperature, natoms, held=0, pressure=None, **more):
    """physical_validation's record of a whole at this temperature, and pressure if there is one."""
    none = dict.fromkeys(("nconstraints", "ndof_reduction_rot"), 0)
    system = records.SystemData(
        natoms=natoms,
        mass=np.ones(natoms),
        ndof_reduction_tra=held,
        **none,
        molecule_idx=[0],
        nconstraints_per_molecule=[0],
    )
    kind = "NVT" if pressure is None else "NPT"
    ensemble = records.EnsembleData(
        kind, natoms=natoms, volume=1.0, temperature=temperature, pressure=pressure
    )
    return records.SimulationData(
        observables=records.ObservableData(**more),
        units=records.UnitData.units("LAMMPS real"),
        system=system,
        ensemble=ensemble,
    )


def distribution(energies: np.ndarray, temperature: float, bodies: int = 1, held: int = 0) -> float:
    """Deviation of the kinetic energies of nonlinear bodies from the canonical distribution, in
    standard deviations.

    The distribution of a single body among many is canonical even at constant total energy.
    physical_validation compares mean and width with the gamma distribution; the larger deviation
    is returned.

    Args:
        energies: independent ones, kcal/mol.
        temperature: K.
        bodies: number of bodies in each energy.
        held: missing degrees of freedom, for example of a total momentum that is zero.
    """
    # two atoms' degrees of freedom are six, a body's
    data = _data(temperature, 2 * bodies, held, kinetic_energy=energies)
    deviations = _quiet(physical_validation.kinetic_energy.distribution, data, **INDEPENDENT)
    return max(abs(distance) for distance in deviations)


class Sampled(NamedTuple):
    """A series at constant temperature and pressure: K, atm, and (2, samples) of the potential
    energy, kcal/mol, and the volume, Angstrom^3; a few samples for each independent one."""

    temperature: float
    pressure: float
    values: np.ndarray


def between_states(first: Sampled, second: Sampled) -> float | None:
    """Deviation of the distributions of two states from the canonical ones, in standard
    deviations; None if they overlap too little.

    By physical_validation (Shirts, J. Chem. Theory Comput. 9, 909, 2013): the logarithm of the
    ratio of the distributions of volumes at two pressures, or of enthalpies at two temperatures, is
    a straight line with a known slope.
    """
    runs = [
        _data(temperature, 2, pressure=pressure, potential_energy=energies, volume=volumes)
        for temperature, pressure, (energies, volumes) in (first, second)
    ]
    try:
        (deviation,) = _quiet(physical_validation.ensemble.check, *runs, **INDEPENDENT)
    except (physical_validation.util.error.InputError, np.linalg.LinAlgError):
        return None
    return deviation
