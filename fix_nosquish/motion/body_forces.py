"""Forces on bodies besides those on their atoms: their weight, and external forces."""

import numpy as np

from ..loops.compiled import F1, F2, loop
from .block import ID, MASS, MOMENT, Kinds, Q, four
from .frames import rotation_matrix, to_body, to_space


@loop
def weigh(state: F2, wrench: F2, gravity: F1):
    """Add the bodies' weight, by an acceleration (3,), to their forces."""
    for row in range(3):
        for b in range(wrench.shape[1]):
            wrench[row, b] += state[MASS, b] * gravity[row]


@loop
def push(state: F2, kinds: Kinds, wrench: F2, pushed: F1, external: F2):
    """Add external forces and torques, (n, 6), of the bodies with these IDs, (n,) in order.

    A torque about an axis without moment, which a linear body and a point have, turns nothing.
    """
    for b in range(wrench.shape[1]):
        low = np.searchsorted(pushed, state[ID, b])
        if low == pushed.shape[0] or pushed[low] != state[ID, b]:
            continue
        x, y, z = external[low, 3], external[low, 4], external[low, 5]
        if b >= kinds.rotors:
            r = rotation_matrix(four(state, Q, b))
            t1, t2, t3 = to_body(r, x, y, z)
            t1 = t1 if state[MOMENT, b] > 0.0 else 0.0
            t2 = t2 if state[MOMENT + 1, b] > 0.0 else 0.0
            t3 = t3 if state[MOMENT + 2, b] > 0.0 else 0.0
            x, y, z = to_space(r, t1, t2, t3)
        for row in range(3):
            wrench[row, b] += external[low, row]
        wrench[3, b] += x
        wrench[4, b] += y
        wrench[5, b] += z
