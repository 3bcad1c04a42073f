"""Degrees of freedom, kinetic energies and temperatures of bodies."""

from typing import NamedTuple

import numpy as np

from ..bodies.bodies import Bodies
from ..bodies.extended import DIPOLE, ORIENT
from ..host.lammps import Lammps
from ..ranks.communicator import Ranks


class Energies(NamedTuple):
    """Kinetic energies and temperatures of bodies, in LAMMPS's units.

    Attributes:
        translation, rotation: kinetic energies.
        t_translation, t_rotation, temperature: of translation, of rotation, and of both; 0 where
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


# f_ID[1] to f_ID[4] of all integrators, in the order of `Energies`: names, and whether extensive.
# Computes ke/rigid and erotate/rigid are the first two, see `plugin/computes.h`
VALUES = {"ke_trans": True, "ke_rot": True, "temp_trans": False, "temp_rot": False}


def freedom(bodies: Bodies, dimension: int) -> np.ndarray:
    """Degrees of freedom of each body, (n,): 6, 5 or 3; in two dimensions 3 or 2."""
    result = np.full(len(bodies), dimension)
    result[: bodies.turning] = 5 if dimension == 3 else 3
    result[: bodies.rotors] = 6 if dimension == 3 else 3
    return result


class Thermo(NamedTuple):
    """The thermodynamics of bodies; all methods are collective.

    Attributes:
        bodies: the `Bodies`.  lammps: the `Lammps` that has their atoms.
        ranks: the `Communicator`, or `ALONE`.
    """

    bodies: Bodies
    lammps: Lammps
    ranks: Ranks

    def removed_freedom(self, bit: int) -> int:
        """Degrees of freedom that rigidity takes from a group of atoms.

        Args:
            bit: of the group.
        Returns:
            the sum, over the bodies that are wholly in the group, of the degrees of freedom of
            their atoms (3, of a sphere 6; in two dimensions 2 and 3), less their own (as LAMMPS's
            fix rigid counts).
        """
        bodies, lammps = self.bodies, self.lammps
        inside = lammps.groups[bodies.index] & bit != 0
        degrees = np.full(len(inside), lammps.dimension)
        if bodies.spin:
            finite = bodies.displace[ORIENT:DIPOLE].any(axis=0) & bodies.oriented
            if lammps.radius is not None:
                finite |= lammps.radius[bodies.index] > 0
            degrees[finite] = 6 if lammps.dimension == 3 else 3
        whole, (sums,) = self._whole(inside, degrees)
        removed = sums[whole].sum() - freedom(bodies, lammps.dimension)[whole].sum()
        return round(self.ranks.total(np.array([removed]))[0])

    def _whole(self, inside: np.ndarray, *of_atoms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which bodies are counted here and wholly in a group, (n,) bool, and sums over the atoms
        of each, (len(of_atoms), n). Args: inside: (m,) bool, which atoms are in the group."""
        bodies = self.bodies
        sums = bodies.sharers.total(bodies.body, [inside, *of_atoms])
        return (sums[0] == bodies.natoms) & bodies.sharers.owned, sums[1:]

    def removed_freedom_to_scale(self, bit: int) -> int:
        """What to give for `removed_freedom` so that LAMMPS, which scales the velocities of all
        atoms of a group to a temperature, gives the bodies that temperature.

        A body keeps a part of its atoms' kinetic energy when the run makes their velocities rigid
        motion: all if they are that already, and the part of its degrees of freedom if they were
        drawn.  The atoms of the bodies must be points.

        Args:
            bit: of the group.
        """
        bodies, lammps = self.bodies, self.lammps
        v, mass = lammps.v, lammps.masses
        of_group = np.flatnonzero(lammps.groups & bit)
        squares = mass * (v**2).sum(axis=1)
        inside = lammps.groups[bodies.index] & bit != 0
        whole, (of_atoms,) = self._whole(inside, squares[bodies.index])
        lost = of_atoms[whole].sum() - 2.0 * bodies.kinetic()[:, whole].sum()
        sums = np.array([squares[of_group].sum(), lost, len(of_group)])
        kinetic, lost, atoms = self.ranks.total(sums)
        removed = self.removed_freedom(bit)
        degrees = lammps.dimension * (atoms - 1)  # compute temp leaves out those of the momentum
        if not kinetic - lost > 0.0:
            return removed
        return round(degrees - (degrees - removed) * kinetic / (kinetic - lost))

    def energies(self) -> Energies:
        """Kinetic energies and temperatures of the bodies."""
        bodies, lammps = self.bodies, self.lammps
        owned = bodies.sharers.owned
        translation = np.full(len(bodies), lammps.dimension)
        rotation = freedom(bodies, lammps.dimension) - translation
        freedoms = translation[owned].sum(), rotation[owned].sum()
        sums = self.ranks.total([*bodies.kinetic()[:, owned].sum(axis=1), *freedoms])
        energy, degrees = (
            np.append(part, part.sum()) for part in (lammps.mvv2e * sums[:2], sums[2:])
        )
        temperatures = np.divide(
            2 * energy, degrees * lammps.boltz, out=np.zeros(3), where=degrees > 0
        )
        return Energies(*energy[:2], *temperatures)

    def temperature_of(self, mask: np.ndarray) -> float:
        """The temperature of some components of translation and of rotation.

        Args:
            mask: (6, n), 1.0 for each of those, as LAMMPS's fix rigid takes them: velocities in
                the space frame, and angular velocities in the principal frame.
        """
        bodies, lammps = self.bodies, self.lammps
        owned, turns = bodies.sharers.owned, bodies.moment > 0
        mask = mask * np.ones((6, len(bodies)))
        mask[3:] *= turns
        momentum = np.concatenate([bodies.mass * bodies.v, bodies.angular_momentum()])
        twice = mask * momentum * np.concatenate([bodies.v, bodies.angular_velocity()])
        sums = np.array([twice[:, owned].sum(), mask[:, owned].sum()])
        twice, degrees = self.ranks.total(sums)
        return lammps.mvv2e * twice / (degrees * lammps.boltz) if degrees else 0.0

    def momentum_part(self) -> float:
        """The part of the kinetic energy that is of the total momentum."""
        bodies, owned = self.bodies, self.bodies.sharers.owned
        mass, v = bodies.mass[owned], bodies.v[:, owned]
        whole, *momentum = self.ranks.total(np.array([mass.sum(), *(mass * v).sum(axis=1)]))
        kinetic = self.energies().kinetic
        return 0.5 * self.lammps.mvv2e * np.square(momentum).sum() / (whole * kinetic or np.inf)
