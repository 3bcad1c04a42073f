"""Look up data on other ranks, by atom or by body."""

import numpy as np

from .communicator import Ranks
from .mpi import deliver_parts
from .sharing import places


def find(keys: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The index in `keys` (integers) of each entry of `wanted`, or -1."""
    order = np.argsort(keys)
    index = np.append(order, -1)[np.searchsorted(keys, wanted, sorter=order)]
    return np.where(np.append(keys, -1)[index] == wanted, index, -1)


def exchange(
    communicator: Ranks, to: np.ndarray, rows: np.ndarray, sources: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Send rows to ranks; collective.

    Args:
        to: (n,) destination rank of each row, ascending.
        rows: (n, width) int64.
        sources: the ranks that send rows to this one, if all ranks know their sources.
    Returns:
        the source rank of each row, (k,) ascending, and the rows, (k, width).
    """
    if communicator.size == 1:
        return to, rows
    (ranks, counts), width = np.unique(to, return_counts=True), rows.shape[1]
    deliver_parts.bind_to(
        communicator.cells,
        to=ranks,
        many=counts * width,
        parts=rows.ravel(),
        sources=ranks if sources is None else sources,
        known=sources is not None,
    )()
    senders, sent, received = (
        communicator.messages.cells[name].array for name in ("senders", "sent", "numbers")
    )
    sender = np.repeat(senders, sent // width)
    order = np.argsort(sender, kind="stable")
    return sender[order], received.reshape(-1, width)[order]


def look_up(
    communicator: Ranks, keys: np.ndarray, rows: np.ndarray, wanted: np.ndarray
) -> np.ndarray:
    """Look up rows by key in a directory that is distributed over the ranks; collective.

    Args:
        keys: (n,) int64. A key that several ranks have has the same row there.
        rows: (n, width) int64.
        wanted: (m,) keys.
    Returns:
        (m, width) the rows of these keys; -1 for a key that does not exist.
    """
    entries, order = np.column_stack([keys, rows]), np.argsort(keys % communicator.size)
    _, entries = exchange(communicator, keys[order] % communicator.size, entries[order])
    order = np.argsort(wanted % communicator.size)
    to = wanted[order] % communicator.size
    askers, questions = exchange(communicator, to, wanted[order, None])
    none = np.full((1, rows.shape[1]), -1)
    answers = np.concatenate([entries[:, 1:], none])[find(entries[:, 0], questions[:, 0])]
    result = np.empty((len(wanted), rows.shape[1]), np.int64)
    result[order] = exchange(communicator, askers, answers, np.unique(to))[1]
    return result


def gone(communicator: Ranks, lost: np.ndarray, gained: np.ndarray) -> np.ndarray:
    """The lost atoms that no rank has received; collective.

    Args:
        lost: (k,) indices of atoms that this rank no longer has.
        gained: origins (see `migration.Atoms`) of atoms that arrived from other ranks.
    """
    gained = np.sort(gained)
    _, index = exchange(communicator, gained >> 32, places(gained)[:, None])
    return np.setdiff1d(lost, index)
