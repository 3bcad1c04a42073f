"""What LAMMPS must know of the bodies: degrees of freedom, energies, temperatures."""

from typing import NamedTuple

import numpy as np

from ..bodies.bodies import Bodies
from ..bodies.extended import DIPOLE, ORIENT
from ..host.lammps import Lammps
from ..ranks.communicator import Alone


class Energies(NamedTuple):
    """What the bodies' motion has, in LAMMPS's units.

    Attributes:
        translation, rotation: kinetic energies.
        t_translation, t_rotation, temperature: temperatures of these, and of both together; 0 where
            there is no such degree of freedom.
    """

    translation: float
    rotation: float
    t_translation: float
    t_rotation: float
    temperature: float

    @property
    def kinetic(self) -> float:
        """The kinetic energy of both."""
        return self.translation + self.rotation


def freedom(bodies: Bodies, dimension: int) -> np.ndarray:
    """Degrees of freedom of each body, (n,): 6, 5 or 3; in two dimensions 3 or 2."""
    result = np.full(len(bodies), dimension)
    result[: bodies.turning] = 5 if dimension == 3 else 3
    result[: bodies.rotors] = 6 if dimension == 3 else 3
    return result


def removed_freedom(bodies: Bodies, communicator: Alone, lammps: Lammps, bit: int) -> int:
    """Degrees of freedom that rigidity takes from a group of atoms; collective.

    Args:
        bit: of the group.
    Returns:
        the sum, over the bodies that are wholly in the group, of the degrees of freedom of
        their atoms (3, of a sphere 6; in two dimensions 2 and 3), less their own (as LAMMPS's fix
        rigid counts).
    """
    inside = lammps.groups[bodies.index] & bit != 0
    degrees = np.full(len(inside), lammps.dimension)
    if bodies.spin:
        finite = bodies.displace[ORIENT:DIPOLE].any(axis=0) & bodies.oriented
        if lammps.radius is not None:
            finite |= lammps.radius[bodies.index] > 0
        degrees[finite] = 6 if lammps.dimension == 3 else 3
    whole, (sums,) = _of_whole(bodies, inside, degrees)
    removed = sums[whole].sum() - freedom(bodies, lammps.dimension)[whole].sum()
    return round(communicator.total(np.array([removed]))[0])


def _of_whole(
    bodies: Bodies, inside: np.ndarray, *of_atoms: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Which bodies are counted here and wholly in a group, (n,) bool, and sums over the atoms of
    each, (len(of_atoms), n); collective. Args: inside: (m,) bool, which atoms are in the group."""
    sums = bodies.sharers.total(bodies.body, inside, *of_atoms)
    return (sums[0] == bodies.natoms) & bodies.sharers.owned, sums[1:]


def removed_freedom_to_scale(bodies: Bodies, communicator: Alone, lammps: Lammps, bit: int) -> int:
    """What to give for `removed_freedom` so that LAMMPS, which scales the velocities of all atoms
    of a group to a temperature, gives the bodies that temperature; collective.

    A body keeps a part of its atoms' kinetic energy when the run makes their velocities rigid
    motion: all if they are that already, and the part of its degrees of freedom if they were drawn.

    Args:
        bodies: the `Bodies` of these velocities, whose atoms are points.  bit: of the group.
    """
    v, mass = lammps.v, lammps.masses
    of_group = np.flatnonzero(lammps.groups & bit)
    squares = mass * (v**2).sum(axis=1)
    inside = lammps.groups[bodies.index] & bit != 0
    whole, (of_atoms,) = _of_whole(bodies, inside, squares[bodies.index])
    lost = of_atoms[whole].sum() - 2.0 * bodies.kinetic()[:, whole].sum()
    sums = np.array([squares[of_group].sum(), lost, len(of_group)])
    kinetic, lost, atoms = communicator.total(sums)
    removed = removed_freedom(bodies, communicator, lammps, bit)
    degrees = lammps.dimension * (atoms - 1)  # compute temp leaves out those of the momentum
    if not kinetic - lost > 0.0:
        return removed
    return round(degrees - (degrees - removed) * kinetic / (kinetic - lost))


def energies(bodies: Bodies, communicator: Alone, lammps: Lammps) -> Energies:
    """Kinetic energies and temperatures of the bodies; collective."""
    owned = bodies.sharers.owned
    translation = np.full(len(bodies), lammps.dimension)
    rotation = freedom(bodies, lammps.dimension) - translation
    own = [*bodies.kinetic()[:, owned].sum(axis=1), translation[owned].sum(), rotation[owned].sum()]
    sums = communicator.total(np.array(own))
    energy, degrees = (np.append(part, part.sum()) for part in (lammps.mvv2e * sums[:2], sums[2:]))
    temperatures = np.divide(2 * energy, degrees * lammps.boltz, out=np.zeros(3), where=degrees > 0)
    return Energies(*energy[:2], *temperatures)


def temperature_of(mask: np.ndarray, bodies: Bodies, communicator: Alone, lammps: Lammps) -> float:
    """The temperature of some components of translation and of rotation; collective.

    Args:
        mask: (6, n), 1.0 for each of those, as LAMMPS's fix rigid takes them: velocities in the
            space frame, and angular velocities in the principal frame.
    """
    owned, turns = bodies.sharers.owned, bodies.moment > 0
    mask = mask * np.ones((6, len(bodies)))
    mask[3:] *= turns
    momentum = np.concatenate([bodies.mass * bodies.v, bodies.angular_momentum()])
    twice = mask * momentum * np.concatenate([bodies.v, bodies.angular_velocity()])
    sums = np.array([twice[:, owned].sum(), mask[:, owned].sum()])
    twice, degrees = communicator.total(sums)
    return lammps.mvv2e * twice / (degrees * lammps.boltz) if degrees else 0.0
