"""What ranks ask each other of atoms, for messages and a LAMMPS that takes nothing along."""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..loops.compiled import L1, I, loop
from .communicator import Alone
from .mpi import Mpi, deliver
from .sharing import places


@loop
def deliver_parts(mpi: Mpi, to: L1, many: L1, parts: L1, sources: L1, known: I):
    """`mpi.deliver`."""
    deliver(mpi, to, many, parts, sources, known)


def find(keys: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """For each entry of `wanted` its place in `keys` (unique integers), or -1."""
    order = np.argsort(keys)
    found = np.append(order, -1)[np.searchsorted(keys, wanted, sorter=order)]
    return np.where(np.append(keys, -1)[found] == wanted, found, -1)


class Messages:
    """Messages to single ranks; all methods are collective.

    Args:
        communicator: the `Communicator`.
    """

    def __init__(self, communicator: Alone) -> None:
        self._communicator = communicator

    def deliver(
        self, to: np.ndarray, numbers: np.ndarray, sources: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Send numbers to ranks.

        Args:
            to: (n,) the rank to which each row goes, in order.  numbers: (n, width) int64.
            sources: the ranks that send something to this one, if all ranks know theirs.
        Returns:
            (ranks, counts, numbers): who sent something, how many rows each, and the rows.
        """
        (ranks, counts), width = np.unique(to, return_counts=True), numbers.shape[1]
        deliver_parts.bind_to(
            self._communicator.cells,
            to=ranks,
            many=counts * width,
            parts=numbers.ravel(),
            sources=ranks if sources is None else sources,
            known=sources is not None,
        )()
        cells = self._communicator.messages.cells
        senders, sent, got = (cells[name].array for name in ("senders", "sent", "numbers"))
        sender_of_row = np.repeat(senders, sent // width)
        in_order = got.reshape(-1, width)[np.argsort(sender_of_row, kind="stable")]
        return *np.unique(sender_of_row, return_counts=True), in_order

    def ask(
        self, to: np.ndarray, questions: np.ndarray, answer: Callable[[np.ndarray], np.ndarray]
    ) -> np.ndarray:
        """Ask other ranks, and answer what they ask.

        Args:
            to: (m,) int64, the rank that is asked each question.  questions: (m,) int64.
            answer: a function of the questions (k,) to this rank, which gives (k, width) numbers.
        Returns:
            (m, width) the answers to this rank's questions.
        """
        order = np.argsort(to, kind="stable")
        asked = to[order]
        askers, counts, wanted = self.deliver(asked, questions[order, None])
        answers = np.ascontiguousarray(answer(wanted[:, 0]))
        kind = answers.dtype
        back = self.deliver(np.repeat(askers, counts), answers.view(np.int64), np.unique(asked))[2]
        result = np.empty((len(to), answers.shape[1]), kind)
        result[order] = back.view(kind).reshape(result.shape)
        return result


def look_up(communicator: Alone, keys: Any, values: Any, wanted: np.ndarray) -> np.ndarray:
    """Ask all ranks for values, through a directory that is spread over them; collective.

    Args:
        keys: (n,) int64, each on one rank only.  values: (n,) int64.  wanted: (m,) keys.
    Returns:
        (m,) the values of these keys, -1 for a key that no rank has.
    """
    if communicator.size == 1:  # what this rank has it need not ask for
        return np.full(len(wanted), -1)
    messages, to = Messages(communicator), keys % communicator.size
    order = np.argsort(to, kind="stable")
    told = messages.deliver(to[order], np.stack([keys, values], axis=1)[order])[2]

    def answer(asked: np.ndarray) -> np.ndarray:
        return np.append(told[:, 1], -1)[find(told[:, 0], asked), None]

    return messages.ask(wanted % communicator.size, wanted, answer)[:, 0]


def fetch(
    communicator: Alone, origins: np.ndarray, rows_of: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Ask for what the ranks that lost atoms know of them; collective.

    Args:
        origins: (m,) int64, where each atom gained was before: another rank, and its place there.
        rows_of: a function of (n,) places that gives (n, width) float64, what goes with these
            atoms.
    Returns:
        (m, width) rows, in the order of origins.
    """
    if communicator.size == 1:
        return rows_of(origins)
    return Messages(communicator).ask(origins >> 32, places(origins), rows_of)


def gone(communicator: Alone, lost: np.ndarray, gained: np.ndarray) -> np.ndarray:
    """Which of the places of lost atoms are of atoms that no rank has; collective.

    Args:
        lost: (k,) places of atoms that this rank no longer has.
        gained: origins of atoms from other ranks.
    """
    if communicator.size == 1:
        return lost
    gained = np.sort(gained)
    told = Messages(communicator).deliver(gained >> 32, places(gained)[:, None])[2]
    return np.setdiff1d(lost, told[:, 0])
