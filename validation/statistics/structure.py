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
# samples, for physical_validation; the seed is of its resampling
INDEPENDENT = {"verbosity": 0, "bootstrap_seed": 1, "data_is_uncorrelated": True}


class Motion:
    """Bodies and atoms of a run (see ``worker``).

    Attributes:
        x, v: (frames, atoms, 3), Angstrom and Angstrom/fs.
        mass: (atoms,) g/mol.
        cells: (frames, 3, 3), vectors as rows.
        groups: arrays (bodies, n): the atoms of all bodies of n atoms, for each n.
        count: number of bodies.
    """

    def __init__(self, positions: Positions) -> None:
        self.x, self.v, self.mass = positions.x, positions.v, positions.mass
        self.cell, self.cells, self.periodic = positions.cell, positions.cells, positions.periodic
        self.groups = measures.body_groups(positions.bodies)
        self.count = sum(map(len, self.groups))

    def turning(self, dimension: int) -> int:
        """Rotational degrees of freedom of all bodies."""
        freedom = 0
        for group in self.groups:
            bodies, atoms = group.shape
            if atoms > 1 and dimension == 2:
                freedom += bodies
            elif atoms > 1:
                freedom += 3 * bodies - int(self._linear(group).sum())
        return freedom

    def _linear(self, group: np.ndarray) -> np.ndarray:
        """Mask of the linear bodies of a group, in the first frame."""
        if group.shape[1] == 2:
            return np.ones(len(group), bool)
        r = self.x[0][group]
        r = measures.nearest_image(r - r[:, :1], self.cells[0], self.periodic)
        singular = np.linalg.svd(r - r.mean(axis=1, keepdims=True), compute_uv=False)
        return singular[:, 1] < STRAIGHT * singular[:, 0]


def pair_distribution(
    motion: Motion, frames: slice, reach: Sequence[float], width: float
) -> np.ndarray:
    """g(r) of the heaviest atom of each body, (bins,), see `of_sites`."""
    most = [(group, np.argmax(motion.mass[group], axis=1)) for group in motion.groups]
    heaviest = np.concatenate([group[np.arange(len(group)), at] for group, at in most])
    return of_sites(motion.x[frames][:, heaviest], motion.cells[frames], reach, width)


def of_sites(x: np.ndarray, cells: np.ndarray, reach: Sequence[float], width: float) -> np.ndarray:
    """g(r) of equal atoms, (bins,), by mdtraj.

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
    path.unitcell_vectors = (cells * scale).astype(np.float32)  # as positions
    # by a width it rounds their number down, as where 53 of them come to 52.999...
    return mdtraj.compute_rdf(
        path,
        top.select_pairs("all", "all"),
        r_range=[end * scale for end in reach],
        n_bins=round((reach[1] - reach[0]) / width),
    )[1]


def _quiet(function, *arguments, **more):
    """Call a function without its output."""
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return function(*arguments, **more)


def _data(temperature, natoms, held=0, pressure=None, **more):
    """physical_validation's record of a whole at this temperature, and pressure if there is one."""
    system = records.SystemData(
        natoms=natoms,
        mass=np.ones(natoms),
        ndof_reduction_tra=held,
        **dict.fromkeys(("nconstraints", "ndof_reduction_rot"), 0),
        molecule_idx=[0],
        nconstraints_per_molecule=[0],
    )
    ensemble = records.EnsembleData(
        "NVT" if pressure is None else "NPT",
        natoms=natoms,
        volume=1.0,
        temperature=temperature,
        pressure=pressure,
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
    deviations = _quiet(
        physical_validation.kinetic_energy.distribution,
        _data(temperature, 2 * bodies, held, kinetic_energy=energies),
        **INDEPENDENT,
    )
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
