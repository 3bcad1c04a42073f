"""Rigid bodies in LAMMPS's command minimize.

A fix may have degrees of freedom of its own in a minimization, as fix box/relax has.  LAMMPS's min
styles cg and sd ask for the forces on these, and have the fix move along a direction from where the
line search began.  Here they are six coordinates of each body: the centre of mass, and about each
principal axis an angle times the radius of gyration about it.  So their forces are the force on the
body and the torque over that radius, and a direction's length is the root mean square displacement
of the atoms.  A rotation about a fixed axis has the torque about it as the exact slope of the
energy, however far it goes: line searches with gradients rely on that.
"""

import numpy as np

from ..bodies.bodies import Bodies
from ..loops.compiled import array
from ..motion.frames import product, quaternion_momentum
from ..ranks.communicator import Ranks


class Minimization:
    """The coordinates of all bodies, which every rank knows.

    Args:
        bodies: this rank's.
        communicator: the `Communicator` or `ALONE`.
        alike: whether the three radii of a body must be alike, because only some components of its
            force and torque act: then a torque turns the body about its own direction.

    Attributes:
        ids: (n,) IDs of all bodies, in order.
        per_radius: (3, n) the inverse radius of gyration about each principal axis, of atoms that
            weigh alike; 0 if the body does not turn about it.
    """

    def __init__(self, bodies: Bodies, communicator: Ranks, alike: bool) -> None:
        self._bodies, self._communicator = bodies, communicator
        owned = bodies.sharers.owned
        self.ids = np.sort(communicator.gather_to_all(bodies.id[owned]))
        squares = [np.bincount(bodies.body, d**2, len(bodies)) for d in bodies.displace[:3]]
        alone = owned * bodies.moments_of_atoms / bodies.mass  # of a particle alone
        square, least = np.split(self._of_all(np.array([*squares / bodies.natoms, *alone])), 2)
        square = np.maximum(square.sum(axis=0) - square, least) * (least > 0.0)
        square = np.where(alike & (square > 0.0), square.max(axis=0), square)
        self.per_radius = np.power(square, -0.5, out=np.zeros_like(square), where=square > 0.0)

    def at(self, address: int) -> np.ndarray:
        """LAMMPS's numbers for the coordinates, (n, 6), which are at this address."""
        return array(address, (len(self.ids), 6), float)

    def _here(self) -> np.ndarray:
        """Where this rank's bodies are among all."""
        return np.searchsorted(self.ids, self._bodies.id)

    def _of_all(self, values: np.ndarray) -> np.ndarray:
        """The sum over ranks of values (k, bodies here) for each body, (k, n); collective."""
        all_values = np.zeros((len(values), len(self.ids)))
        all_values[:, self._here()] = values
        return self._communicator.total(all_values)

    def store(self) -> None:
        """A line search begins here; collective."""
        bodies = self._bodies
        x = bodies.x + bodies.cells["h"].array @ bodies.image
        self._start = self._of_all(np.concatenate([x, bodies.q]) * bodies.sharers.owned)

    def forces(self) -> np.ndarray:
        """The forces on the coordinates, (n, 6), from those on the bodies; collective."""
        bodies = self._bodies
        force, owned = bodies.acting_wrench[:3], bodies.sharers.owned
        turning = bodies.principal_torque() * self.per_radius[:, self._here()]
        return self._of_all(np.concatenate([force, turning]) * owned).T

    def move(self, direction: np.ndarray) -> None:
        """Move this rank's bodies by a direction (n, 6) from where the line search began.

        They keep their velocity, and their angular momentum in the principal frame.
        """
        bodies, here = self._bodies, self._here()
        start, along, momentum = self._start[:, here], direction[here].T, bodies.angular_momentum()
        turn = along[3:] * self.per_radius[:, here]
        half = 0.5 * np.linalg.norm(turn, axis=0)
        turned = np.cos(half), *(0.5 * np.sinc(half / np.pi) * turn)
        q = np.array(product(start[3:], turned))
        bodies.x[:] = start[:3] + along[:3] - bodies.cells["h"].array @ bodies.image
        bodies.q[:] = q / np.linalg.norm(q, axis=0)
        bodies.p[:] = quaternion_momentum(bodies.q, *momentum)
