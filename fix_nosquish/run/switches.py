"""Keywords force and torque: which components of force and torque act on a body."""

from typing import NamedTuple

import numpy as np

from ..bodies.bodies import Bodies
from ..bodies.membership import POINTS
from ..errors import RunError
from ..host.command import Command
from ..ranks.communicator import Alone

_FORCE, _TORQUE = slice(0, 3), slice(3, 6)  # rows of a wrench


class _Choice(NamedTuple):
    """Which components of force or torque act on bodies with IDs in a range."""

    lowest: int
    highest: int
    rows: slice
    on: tuple[bool, ...]


class Switches:
    """The components switched off, for bodies chosen by number as in fix rigid; collective.

    Bodies are numbered from 1 in the order of their IDs. No rank holds all IDs: the ID that has
    a number is found by bisection. An open end is one for bodies that come later, too.

    Args:
        command: the `Command`.  dimension: 2 or 3.  communicator: the `Communicator` or `ALONE`.
        bodies: the `Bodies`.
    Raises:
        RunError: for numbers without a body, and in two dimensions for what cannot be on.
    Attributes:
        choices: what the keywords say, in their order.
    """

    def __init__(
        self, command: Command, dimension: int, communicator: Alone, bodies: Bodies
    ) -> None:
        self._in_plane = dimension == 2
        self.choices: list[_Choice] = []
        asked = [(switch, _FORCE) for switch in command.force]
        asked += [(switch, _TORQUE) for switch in command.torque]
        if not asked:
            return
        ids = np.sort(bodies.id[bodies.listed])
        count = communicator.count(len(ids))
        ends = [[switch.first or 1, switch.last or count] for switch, _ in asked]
        for (switch, rows), (first, last) in zip(asked, ends):
            name, off = ("torque", "x and y are") if rows is _TORQUE else ("force", "z is")
            if (switch.first or switch.last) and not 1 <= first <= last <= count:
                raise RunError(
                    f"keyword {name}: bodies {first} to {last} were asked for, and there are "
                    f"bodies 1 to {count}",
                    everywhere=True,
                )
            if self._in_plane and any(switch.on[:2] if rows is _TORQUE else switch.on[2:]):
                raise RunError(
                    f"keyword {name}: {off} off in two dimensions: say off", everywhere=True
                )
        found = _id_of_number(np.array(ends), communicator, ids)
        for (switch, rows), (low, high) in zip(asked, found):
            lowest = low if switch.first else -2 * POINTS
            highest = high if switch.last else POINTS - 1
            self.choices.append(_Choice(lowest, highest, rows, switch.on))

    def mask(self, bodies: Bodies) -> np.ndarray | None:
        """What to multiply the wrench of bodies by, (6, n) or (6, 1); None if all of it acts."""
        if not self.choices:
            plane = np.array([[1.0], [1.0], [0.0], [0.0], [0.0], [1.0]])
            return plane if self._in_plane else None
        mask, ids = np.ones((6, len(bodies))), bodies.id
        for one in self.choices:
            chosen = (one.lowest <= ids) & (ids <= one.highest)
            mask[one.rows, chosen] = np.array(one.on, float)[:, None]
        if self._in_plane:
            mask[2:5] = 0.0
        return mask


def _id_of_number(numbers: np.ndarray, communicator: Alone, ids: np.ndarray) -> np.ndarray:
    """The ID at each of these numbers when all ranks' IDs are in order; collective.

    Args:
        numbers: of any shape.  ids: this rank's, in order.
    """
    low, high = np.full(numbers.shape, -(2**62)), np.full(numbers.shape, 2**62)
    while (low < high).any():
        mid = (low + high) // 2
        enough = communicator.total(np.searchsorted(ids, mid, "right")) >= numbers
        low, high = np.where(enough, low, mid + 1), np.where(enough, mid, high)
    return low
