"""What is known of bodies besides their atoms: from an infile, or from a molecule template."""

from typing import NamedTuple

import numpy as np


class Start(NamedTuple):
    """What follows from the atoms of this rank's bodies.

    Attributes:
        place, image: (3, n) of each body's first atom, and delta (atoms, 3) from there: see
            `unfold`.
        natoms, mass: (n,).  centre: (3, n) of mass, from the first atom.
        particles: (3, 3, n) what particles that are no points add to the inertia, or 0.
    """

    place: np.ndarray
    image: np.ndarray
    delta: np.ndarray
    natoms: np.ndarray
    mass: np.ndarray
    centre: np.ndarray
    particles: np.ndarray


class Given(NamedTuple):
    """What else is known of some of this rank's bodies.

    Attributes:
        bodies: (m,) their places in this rank's list of bodies.
        absent: (n,) bool, the other ones of the list.
        ids: (m,) their IDs.  named: IDs of all such bodies, on any rank.
        mass: (m,).  centre: (3, m) of mass, from the body's first atom.
        inertia: (m, 3, 3), space frame.  momenta: (6, m) linear and angular, space frame.
        warnings: lines for the log.
    """

    bodies: np.ndarray
    absent: np.ndarray
    ids: np.ndarray
    named: np.ndarray
    mass: np.ndarray
    centre: np.ndarray
    inertia: np.ndarray
    momenta: np.ndarray
    warnings: tuple = ()

    def momenta_among(self, ids):
        """The bodies' places in a list of IDs, and their momenta, (6, m)."""
        order = np.argsort(ids)
        return order[np.searchsorted(ids, self.ids, sorter=order)], self.momenta
