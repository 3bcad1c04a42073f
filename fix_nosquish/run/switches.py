"""Keywords force and torque: which components of force and torque act on a body."""

import numpy as np

from ..bodies.membership import POINTS
from ..errors import RunError


class Switches:
    """The components switched off, for bodies chosen by number as in fix rigid; collective.

    Bodies are numbered from 1 in the order of their IDs. No rank holds all IDs: the ID that has
    a number is found by bisection. An open end is one for bodies that come later, too.

    Args:
        command: the `Command`.  dimension: 2 or 3.  communicator: the `Communicator` or `ALONE`.
        bodies: the `Bodies`.
    Raises:
        RunError: for numbers without a body, and in two dimensions for what cannot be on.
    """

    def __init__(self, command, dimension, communicator, bodies):
        self._plane = dimension == 2
        self.choices = []  # (lowest ID, highest ID, rows of the wrench, 0 or 1 for each)
        asked = [
            (choice, rows)
            for choices, rows in ((command.force, slice(0, 3)), (command.torque, slice(3, 6)))
            for choice in choices
        ]
        if not asked:
            return
        owned = bodies.listed
        count = communicator.count(owned.sum())
        ends = []
        for (low, high, flags), rows in asked:
            first, last = low or 1, high or count
            text = f"keyword {'torque' if rows.start else 'force'}: "
            if (low or high) and not 1 <= first <= last <= count:
                raise RunError(
                    text
                    + f"bodies {first} to {last} were asked for, and there are bodies 1 to {count}",
                    everywhere=True,
                )
            if self._plane and (any(flags[:2]) if rows.start else flags[2]):
                raise RunError(
                    text
                    + ("x and y are" if rows.start else "z is")
                    + " off in two dimensions: say off",
                    everywhere=True,
                )
            ends += [first, last]
        ends = _id_of_number(np.array(ends), communicator, np.sort(bodies.id[owned]))
        for ((low, high, flags), rows), first, last in zip(asked, ends[::2], ends[1::2]):
            ids = first if low else -2 * POINTS, last if high else POINTS - 1
            self.choices.append((*ids, rows, flags))

    def mask(self, bodies):
        """What to multiply the wrench of bodies by, (6, n) or (6, 1); None if all of it acts."""
        if not self.choices:
            return np.array([[1.0], [1.0], [0.0], [0.0], [0.0], [1.0]]) if self._plane else None
        mask, ids = np.ones((6, len(bodies))), bodies.id
        for low, high, rows, flags in self.choices:
            mask[rows, (low <= ids) & (ids <= high)] = np.array(flags, float)[:, None]
        if self._plane:
            mask[2:5] = 0.0
        return mask


def _id_of_number(numbers, communicator, ids):
    """The ID at each of these numbers when all ranks' IDs are in order.

    ids: this rank's, in order.
    """
    low, high = np.full(len(numbers), -(2**62)), np.full(len(numbers), 2**62)
    while (low < high).any():
        middle = (low + high) // 2
        enough = communicator.total(np.searchsorted(ids, middle, "right")) >= numbers
        low, high = np.where(enough, low, middle + 1), np.where(enough, middle, high)
    return low
