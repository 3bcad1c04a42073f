"""Keywords force and torque: which components of force and torque act on a body."""

from typing import NamedTuple

import numpy as np

from ..bodies.bodies import Bodies
from ..bodies.membership import FLEXIBLE
from ..errors import refuse
from ..host.command import Command
from ..ranks.communicator import Ranks

_FORCE, _TORQUE = slice(0, 3), slice(3, 6)  # rows of a wrench


class Choice(NamedTuple):
    """Which components of force or torque act on bodies with IDs in a range."""

    lowest: int
    highest: int
    rows: slice
    on: tuple[bool, ...]


def choices(command: Command, communicator: Ranks, bodies: Bodies) -> list[Choice]:
    """What the keywords say, in their order; collective.

    Bodies are numbered from 1 in the order of their IDs, as in fix rigid. An open end is one for
    bodies that come later, too.

    Raises:
        RunError: for numbers without a body, and in two dimensions for what cannot be on.
    """
    switched = [("force", _FORCE, switch) for switch in command.force]
    switched += [("torque", _TORQUE, switch) for switch in command.torque]
    result: list[Choice] = []
    ids = np.sort(communicator.gather_to_all(bodies.id[bodies.listed])) if switched else np.empty(0)
    for name, rows, switch in switched:
        first, last = switch.first or 1, switch.last or len(ids)
        refuse(
            (switch.first or switch.last) and not 1 <= first <= last <= len(ids),
            f"keyword {name}: bodies {first} to {last} were asked for, and there are "
            f"bodies 1 to {len(ids)}",
        )
        off, flat = ("x and y are", switch.on[:2]) if rows is _TORQUE else ("z is", switch.on[2:])
        refuse(bodies.planar and any(flat), f"keyword {name}: {off} off in two dimensions: say off")
        lowest = ids[first - 1] if switch.first else -2 * FLEXIBLE
        highest = ids[last - 1] if switch.last else FLEXIBLE - 1
        result.append(Choice(lowest, highest, rows, switch.on))
    return result


def mask(choices: list[Choice], bodies: Bodies) -> np.ndarray | None:
    """Mask of the components of force and torque that act, (6, n), or (6, 1) in two dimensions
    without keywords; None if all do."""
    in_plane = np.array([[1.0], [1.0], [0.0], [0.0], [0.0], [1.0]]) if bodies.planar else None
    if not choices:
        return in_plane
    mask, ids = np.ones((6, len(bodies))), bodies.id
    for choice in choices:
        chosen = (choice.lowest <= ids) & (ids <= choice.highest)
        mask[choice.rows, chosen] = np.array(choice.on, float)[:, None]
    return mask if in_plane is None else mask * in_plane
