"""External forces: a force and a torque that are handed in for each body.

They come from fix_modify external, whose words are numbers and variables, and from Python, by
`bodies.Bodies.add_force`.  Each rank knows those of all bodies,
by their IDs, so that they need not follow a body to another rank.
"""

import re
from typing import NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike

from ..bodies.bodies import Bodies
from ..errors import refuse
from ..host.command import is_number
from ..host.hosts import Host
from ..host.lammps import Box, Lammps
from ..loops.compiled import F1, F2, Cell
from ..ranks.communicator import Ranks

ENERGY, COLUMNS = 6, 7  # after three components of the force and three of the torque
_PARTS = {"force": range(3), "torque": range(3, 6), "energy": range(6, 7)}
_VARIABLE = re.compile(r"v_\w+")
_EXPECTED = (
    "a number, or v_NAME of an equal-style or vector-style variable, is expected (for a column of "
    "a fix or a compute: 'variable NAME vector f_ID[i]')"
)
_COMPONENTS = (0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)  # of LAMMPS's virial


def _refuse(problem: object, why: str) -> None:
    """As `refuse`, for the words of fix_modify external."""
    refuse(problem, f"fix_modify external: {why}")


class Words(NamedTuple):
    """The words of fix_modify external.

    Attributes:
        numbers: (COLUMNS,) of each column, 0 where a word stands for it.
        named: of columns, the variables that give their numbers.
        python: whether Python may hand in forces.
        virial: whether LAMMPS counts their virial.
        energy: whether it counts their energy.
    """

    numbers: np.ndarray
    named: dict[int, str]
    python: bool = False
    virial: bool = False
    energy: bool = False


class _Given(NamedTuple):
    """What Python has handed in: IDs of bodies (n,), and force and torque on each (n, 6)."""

    ids: np.ndarray
    wrenches: np.ndarray


NO_WORDS = Words(np.zeros(COLUMNS), {})
_NOTHING_GIVEN = _Given(np.empty(0, np.int64), np.empty((0, 6)))


class ExternalForces:
    """The external forces on a fix's bodies.

    Args:
        lammps, ranks, host: see `fix.Fix`.

    Attributes:
        present: whether there may be some in this run.
        changed: whether there are others since it began.
        words: those of fix_modify external.
        cells: of the loop `passes.push`: the IDs of all bodies, in order, and what acts on each.
    """

    def __init__(self, lammps: Lammps, ranks: Ranks, host: Host) -> None:
        self._lammps, self._ranks, self._host = lammps, ranks, host
        self.present = self.changed = False
        self.words, self._given = NO_WORDS, _NOTHING_GIVEN
        self.cells = {"pushed": Cell(F1, np.empty(0)), "external": Cell(F2, np.empty((0, 6)))}

    @property
    def moves_centres(self) -> bool:
        """Whether there may be forces, not torques alone."""
        words = self.words
        of_words = words.numbers[:3].any() or any(column < 3 for column in words.named)
        return self.present and bool(of_words or words.python or len(self._given.ids))

    # ------------------------------------------------------------- what gives them

    def modify(self, text: str) -> None:
        """Read the words of fix_modify external, which replace those of before.

        Raises:
            RunError: naming the word, and what is expected; the words of before stay.
        """
        _refuse(self._lammps.running, "a run is under way: give it between runs")
        words = _read(text.split())
        if words is NO_WORDS:
            self._given = _NOTHING_GIVEN
        self.words, self.changed = words, True
        self._host.ask_for([*words.named.values()], energy=words.energy, virial=words.virial)

    def give(
        self, all_ids: np.ndarray, ids: ArrayLike, force: ArrayLike, torque: ArrayLike
    ) -> None:
        """Take what Python hands in: see `bodies.Bodies.add_force`; collective.

        Args:
            all_ids: the IDs of all bodies.
        """
        refuse(
            not self.present and self._lammps.running,
            "add_force was called in a run that began without external forces: call it before "
            "the run, or have 'fix_modify ID external python' before it",
        )
        ids, problem = np.atleast_1d(ids), None
        rows = np.zeros((len(ids), 6))
        try:
            rows[:, :3], rows[:, 3:] = force, torque
        except (TypeError, ValueError) as error:
            problem = str(error)
        unknown = np.setdiff1d(ids, all_ids)
        for wrong, why in (
            (not np.isfinite(rows).all(), "a force or torque is not finite"),
            (len(unknown), f"there is no body with ID {next(iter(unknown), '')}"),
            (len(np.unique(ids)) < len(ids), "a body's ID is given twice"),
        ):
            problem = problem or (why if wrong else None)
        self._ranks.agree(
            problem
            and f"add_force: {problem}: expected IDs of bodies, a force (n, 3) and a torque "
            "(n, 3), or (3,) for the same on all of them"
        )
        ids = ids.astype(np.int64)
        checksum = crc32(ids.tobytes() + rows.tobytes())
        self._ranks.agree(
            "add_force: this rank passes other forces than rank 0: pass the same on all ranks"
            if self._ranks.share(checksum) != checksum
            else None
        )
        stay = ~np.isin(self._given.ids, ids)
        self._given = _Given(
            np.concatenate([self._given.ids[stay], ids]),
            np.concatenate([self._given.wrenches[stay], rows]),
        )
        self.changed |= not self.present
        self._host.pushes = self.present

    # ------------------------------------------------------------- a run

    def begin(self, *, levels: bool) -> None:
        """A run begins: find out whether there are external forces in it.

        Args:
            levels: whether the run has the levels of run_style respa.
        Raises:
            RunError: on all ranks, with run_style respa.
        """
        words, self.changed = self.words, False
        self.present = bool(
            words.python or words.named or words.numbers[:ENERGY].any() or len(self._given.ids)
        )
        refuse(
            self.present and levels,
            "external forces cannot be used with run_style respa: use run_style verlet",
        )

    def refuse_change(self) -> None:
        """End a run that is not set up, and would lack external forces that are new."""
        refuse(
            self.changed,
            "external forces (fix_modify external, add_force) are new since the last run: "
            "begin the run with 'pre yes'",
        )

    def set_bodies(self, bodies: Bodies) -> None:
        """Know the bodies that there are now, and keep what acts on those of before; collective."""
        self._host.pushes = self.present
        if not self.present:
            return
        before, rows = (cell.array for cell in self.cells.values())
        ids = all_ids(bodies, self._ranks)
        _, here, there = np.intersect1d(ids, before, return_indices=True)
        wrenches = np.zeros((len(ids), 6))
        wrenches[here] = rows[there]
        self.cells["pushed"].set(ids.astype(float))
        self.cells["external"].set(wrenches)
        stay = np.isin(self._given.ids, ids)
        self._given = _Given(self._given.ids[stay], self._given.wrenches[stay])

    def evaluate(self, bodies: Bodies, *, about_centre: bool) -> None:
        """The forces of a step are known: find what acts besides them; collective.

        Args:
            about_centre: whether the virial is about the centre of the box.
        Raises:
            RunError: on all ranks, for a word that stands for another number of numbers than there
                are bodies, or for some that are not finite.
        """
        host, words, given = self._host, self.words, self._given
        if not host.pushes:
            return
        ids, wrenches = (cell.array for cell in self.cells.values())
        wrenches[:], energy = words.numbers[:ENERGY], words.numbers[ENERGY]
        wrenches[np.searchsorted(ids, given.ids)] += given.wrenches
        for (column, word), value in zip(words.named.items(), host.values(), strict=True):
            # in each step: so texts are made only where one is wanted
            if value.ndim and value.size != len(ids):
                _refuse(
                    True,
                    f"{word} has {value.size} values, and there are {len(ids)} bodies: give it a "
                    "value for each body, in the order of f_ID[i][j]",
                )
            if not np.isfinite(value).all():
                _refuse(True, f"{word} is not finite in step {self._lammps.step}")
            if column == ENERGY:
                energy = value.sum()
            else:
                wrenches[:, column] += value
        if host.external_sums is not None:
            box, force = self._lammps.box, wrenches[:, :3]
            counted = _virial(bodies, box, ids, force, about_centre) if words.virial else 0.0
            host.external_sums[0], host.external_sums[1:] = energy, counted
        host.pushes = bool(words.named or words.virial)  # else nothing changes


def all_ids(bodies: Bodies, ranks: Ranks) -> np.ndarray:
    """The IDs of all bodies, in order; collective."""
    return np.sort(ranks.gather_to_all(bodies.id[bodies.listed]))


def _virial(
    bodies: Bodies, box: Box, ids: np.ndarray, force: np.ndarray, about_centre: bool
) -> list[float]:
    """Virial of forces (n, 3) on the bodies that are counted here, (6,); their positions are
    unwrapped.

    It is about the origin, as that of fix addforce, which matters if the forces have a sum.  A
    barostat stretches the box about its centre, so with one it is about the centre.

    Args:
        ids: (n,) IDs of all bodies, in order.
    """
    x = (bodies.x + box.h @ bodies.image)[:, bodies.listed]
    if about_centre:
        x -= (box.lo + 0.5 * box.h.sum(axis=1))[:, None]
    of_these = force[np.searchsorted(ids, bodies.id[bodies.listed])].T
    return [(of_these[a] * x[b]).sum() for a, b in _COMPONENTS]


def _read(words: list[str]) -> Words:
    """Read the words of fix_modify external; `NO_WORDS` for the word none.

    Raises:
        RunError: naming the word, and what is expected.
    """
    numbers, named, yes_or_no = np.zeros(COLUMNS), {}, "no"
    left, parts = [*words], set()
    while left:
        part = left.pop(0)
        _refuse(part in parts, f"{part} is given twice")
        parts.add(part)
        if part == "virial":
            yes_or_no = left.pop(0) if left else "nothing"
            _refuse(
                yes_or_no not in ("yes", "no"),
                f"'{yes_or_no}' was given where virial expects yes or no",
            )
        elif part in _PARTS:
            for column in _PARTS[part]:
                word = left.pop(0) if left else "nothing"
                if is_number(word):
                    numbers[column] = float(word)
                else:
                    _refuse(
                        not _VARIABLE.fullmatch(word),
                        f"'{word}' was given after {part}, where {_EXPECTED}",
                    )
                    named[column] = word
        else:
            _refuse(
                part not in ("python", "none"),
                f"'{part}' was given where force FX FY FZ, torque TX TY TZ, energy E, virial "
                "yes or no, python, or none is expected",
            )
    if parts == {"none"}:
        return NO_WORDS
    _refuse(
        "none" in parts or not parts & {"force", "torque", "python"},
        "expected at least one of force, torque and python, or none alone",
    )
    return Words(numbers, named, "python" in parts, yes_or_no == "yes", "energy" in parts)
