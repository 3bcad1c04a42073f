"""What is known of bodies besides their atoms: from an infile, or from a molecule template."""

from typing import NamedTuple

import numpy as np

from .unfold import Unfolded


class Given(NamedTuple):
    """What else is known of some of this rank's bodies.

    Attributes:
        which: (n,) bool, of which of this rank's bodies; m of them, in their order.
        ids: IDs of all such bodies, on any rank.
        mass: (m,).
        centre: (3, m) of mass, from the body's first atom.
        inertia: (m, 3, 3), space frame.
        momenta: (6, m) linear and angular, space frame.
        warnings: lines for the log.
    """

    which: np.ndarray
    ids: np.ndarray
    mass: np.ndarray
    centre: np.ndarray
    inertia: np.ndarray
    momenta: np.ndarray
    warnings: list[str]


def nothing(unfolded: Unfolded) -> Given:
    """`Given` of no body."""
    which = np.zeros(len(unfolded.members.ids), bool)
    none = np.empty((6, 0))
    return Given(
        which, np.empty(0, np.int64), none[0], none[:3], np.empty((0, 3, 3)), none, warnings=[]
    )
