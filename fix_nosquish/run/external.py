"""External forces: a force and a torque that are handed in for each body.

They come from fix_modify external, whose words are numbers, variables, and columns of other fixes
and computes, and from Python, by `bodies.Bodies.add_force`.  Each rank knows those of all bodies,
by their IDs, so that they need not follow a body to another rank.
"""

import re
from collections.abc import Collection
from typing import TYPE_CHECKING, NamedTuple
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike

from ..errors import refuse
from ..host.command import is_number
from ..loops.compiled import F1, F2, Cell

if TYPE_CHECKING:
    from .integrator import Integrator

ENERGY, COLUMNS = 6, 7  # behind three components of the force and three of the torque
_PARTS = {"force": range(3), "torque": range(3, 6), "energy": range(6, 7)}
_STANDS_FOR_NUMBERS = re.compile(r"v_\w+|[fc]_\w+(\[[1-9]\d*\])?")
_EXPECTED = (
    "a number, v_NAME of an equal-style or vector-style variable, or f_ID[i] or c_ID[i], a column "
    "of the global array of a fix or a compute, is expected"
)
# what is known to depend on nothing but positions: columns of f_ID; styles of computes, of groups
# that stay; and what formulas may name
_PLACES = "1", "2", "3", "13", "14", "15"
_COMPUTES = (
    *("com", "com/chunk", "dipole", "dipole/chunk", "gyration", "gyration/chunk", "inertia/chunk"),
)
_IN_FORMULAS = re.compile(
    "PI|a?(sin|cos|tan)|atan2|abs|ceil|exp|floor|ln|log|round|sign|sqrt|ternary|ave|max|min|slope|"
    "sum|trap|[xyz](lo|hi)?|l[xyz]|xy|xz|yz|vol|atoms|density|id|mass|mol|q|type|"
    "undefined|inf|nan"  # what an equal-style variable has been
)
_NAMES = re.compile(r"[vcfCF]_\w+(?:\[\d+\])*|(?<![\w.])[A-Za-z]\w*")
_DEFINED = re.compile(r"style = (\w+), +def =(.*)")
_STYLES = "equal", "vector", "index", "loop", "world", "universe", "uloop", "string", "getenv"
_COMPONENTS = (0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)  # of LAMMPS's virial


def _refuse(problem: object, why: str) -> None:
    """As `refuse`, for what fix_modify external says."""
    refuse(problem, f"fix_modify external: {why}")


class Said(NamedTuple):
    """The words of fix_modify external.

    Attributes:
        numbers: (COLUMNS,) of each column, 0 where a word stands for it.
        words: of columns, variables and columns of other fixes that stand for numbers.
        python: whether Python may hand in forces.
        virial: whether LAMMPS counts their virial.
        energy: whether it counts their energy.
    """

    numbers: np.ndarray
    words: dict[int, str]
    python: bool = False
    virial: bool = False
    energy: bool = False


class _Given(NamedTuple):
    """What Python has handed in: IDs of bodies (n,), and force and torque on each (n, 6)."""

    ids: np.ndarray
    wrenches: np.ndarray


_NOTHING_SAID = Said(np.zeros(COLUMNS), {})
_NOTHING_GIVEN = _Given(np.empty(0, np.int64), np.empty((0, 6)))


class External:
    """The external forces of an integrator's bodies.

    Attributes:
        acts: whether there may be some in this run.
        changed: whether there are others since it began.
        said, given: where they come from.
        cells: of the loop `passes.push`: the IDs of all bodies, in order, and what acts on each.
    """

    acts = changed = False
    said, given = _NOTHING_SAID, _NOTHING_GIVEN

    def __init__(self) -> None:
        self.cells = {"pushed": Cell(F1, np.empty(0)), "external": Cell(F2, np.empty((0, 6)))}

    def may_read_atoms(self, ours: Collection[str | None]) -> bool:
        """Whether a word may depend on atoms: all but columns of fixes of this package, `ours`."""
        words = self.said.words.values()
        return any(word[0] != "f" or word[2:].partition("[")[0] not in ours for word in words)

    @property
    def moves_centres(self) -> bool:
        """Whether there may be forces, not torques alone."""
        said = self.said
        of_words = said.numbers[:3].any() or any(column < 3 for column in said.words)
        return self.acts and bool(of_words or said.python or len(self.given.ids))


def without_energy(integrator: "Integrator") -> str | None:
    """What to say of external forces whose energy LAMMPS does not count; None if it does."""
    told, others = f"{integrator.host.fix_id}_external", integrator.other_fixes
    if not integrator.external.acts or any(f.id == told and f.energy_in_pe for f in others):
        return None
    return (
        "the energy of external forces is not in pe: give it by the word energy of fix_modify "
        "external"
    )


def not_of_positions(integrator: "Integrator") -> str | None:
    """What to say of external forces that positions alone may not decide; None if they do."""
    host, words = integrator.host, integrator.external.said.words.values()
    parts = [(word, True) for word in words]
    for word, in_vectors in parts:  # which grow
        name, *indices = re.findall(r"\w+", word)
        if name[:2] == "v_":
            ((style, formula),) = _DEFINED.findall(host.definition(name)) or [("equal", "")]
            more = [(part, style == "vector") for part in _NAMES.findall(formula)]
            parts += [part for part in more if part not in parts]
            fits = style in _STYLES
        elif name[:2] == "c_":
            fits = host.definition(name) in _COMPUTES
        else:  # f_ID[i] is a column where the formula is of vectors, else a number of the fix
            of_bodies = name == f"f_{host.fix_id}" and len(indices) == 2 - in_vectors
            fits = bool(_IN_FORMULAS.fullmatch(word)) or (of_bodies and indices[-1] in _PLACES)
        if not fits:
            return (
                f"{word}, in what fix_modify external gives, may depend on velocities, on the time "
                f"or on chance. Take the places of the bodies (columns 1 to 3 and 13 to 15 of "
                f"f_{host.fix_id}), numbers, and computes such as com and dipole/chunk"
            )
    return None


# ----------------------------------------------------------------- where they come from


def modify_external(integrator: "Integrator", text: str) -> None:
    """Read the words of fix_modify external, which replace those of before.

    Raises:
        RunError: naming the word, and what is expected; the words of before stay.
    """
    external = integrator.external
    _refuse(integrator.lammps.running, "a run is under way: give it between runs")
    said = _read(text.split())
    if said is _NOTHING_SAID:
        external.given = _NOTHING_GIVEN
    external.said, external.changed = said, True
    integrator.host.ask_for([*said.words.values()], energy=said.energy, virial=said.virial)


def give_forces(
    integrator: "Integrator", ids: ArrayLike, force: ArrayLike, torque: ArrayLike
) -> None:
    """Take what Python hands in: see `bodies.Bodies.add_force`; collective."""
    external, communicator = integrator.external, integrator.communicator
    refuse(
        not external.acts and integrator.lammps.running,
        "add_force was called in a run that began without external forces: call it before "
        "the run, or have 'fix_modify ID external python' before it",
    )
    ids, problem = np.atleast_1d(ids), None
    rows = np.empty((len(ids), 6))
    try:
        rows[:, :3], rows[:, 3:] = force, torque
    except (TypeError, ValueError) as error:
        problem = str(error)
    known = _ids_of_all(integrator)
    if not problem and not np.isfinite(rows).all():
        problem = "a force or torque is not finite"
    if not problem and len(unknown := np.setdiff1d(ids, known)):
        problem = f"there is no body with ID {unknown[0]}"
    if not problem and len(np.unique(ids)) < len(ids):
        problem = "a body's ID is given twice"
    if problem:
        problem = (
            f"{problem}: expected IDs of bodies, a force (n, 3) and a torque (n, 3), or (3,) "
            "for the same on all of them"
        )
    communicator.agree(problem and f"add_force: {problem}")
    ids = ids.astype(np.int64)
    own = crc32(ids.tobytes() + rows.tobytes())
    communicator.agree(
        "add_force: this rank passes other forces than rank 0: pass the same on all ranks"
        if communicator.share(own) != own
        else None
    )
    stay = ~np.isin(external.given.ids, ids)
    external.given = _Given(
        np.concatenate([external.given.ids[stay], ids]),
        np.concatenate([external.given.wrenches[stay], rows]),
    )
    external.changed |= not external.acts
    integrator.host.pushes = external.acts


def _read(words: list[str]) -> Said:
    """What the words of fix_modify external say, `_NOTHING_SAID` for the word none.

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
                        not _STANDS_FOR_NUMBERS.fullmatch(word),
                        f"'{word}' was given behind {part}, where {_EXPECTED}",
                    )
                    named[column] = word
        else:
            _refuse(
                part not in ("python", "none"),
                f"'{part}' was given where force FX FY FZ, torque TX TY TZ, energy E, virial "
                "yes or no, python, or none is expected",
            )
    if parts == {"none"}:
        return _NOTHING_SAID
    _refuse(
        "none" in parts or not parts & {"force", "torque", "python"},
        "expected at least one of force, torque and python, or none alone",
    )
    return Said(numbers, named, "python" in parts, yes_or_no == "yes", "energy" in parts)


# ----------------------------------------------------------------- a run


def begin(integrator: "Integrator") -> None:
    """A run begins: find out whether there are external forces in it; collective.

    Raises:
        RunError: on all ranks, with run_style respa.
    """
    external, said = integrator.external, integrator.external.said
    external.changed = False
    external.acts = bool(
        said.python or said.words or said.numbers[:ENERGY].any() or len(external.given.ids)
    )
    refuse(
        external.acts and integrator.lammps.respa_dt,
        "external forces are not for run_style respa: use run_style verlet",
    )
    learn(integrator)


def refuse_change(integrator: "Integrator") -> None:
    """End a run that is not set up, if it would not have the external forces that it is to."""
    refuse(
        integrator.external.changed,
        "external forces (fix_modify external, add_force) are new since the last run: "
        "begin the run with 'pre yes'",
    )


def learn(integrator: "Integrator") -> None:
    """Know the bodies that there are now, and keep what acts on those of before; collective."""
    external = integrator.external
    integrator.host.pushes = external.acts
    if not external.acts:
        return
    before, rows = (cell.array for cell in external.cells.values())
    ids = _ids_of_all(integrator)
    _, here, there = np.intersect1d(ids, before, return_indices=True)
    wrenches = np.zeros((len(ids), 6))
    wrenches[here] = rows[there]
    external.cells["pushed"].set(ids.astype(float))
    external.cells["external"].set(wrenches)
    stay = np.isin(external.given.ids, ids)
    external.given = _Given(external.given.ids[stay], external.given.wrenches[stay])


def _ids_of_all(integrator: "Integrator") -> np.ndarray:
    """The IDs of all bodies, in order; collective."""
    bodies = integrator.bodies
    return np.sort(integrator.communicator.gather_to_all(bodies.id[bodies.listed]))


def push(integrator: "Integrator") -> None:
    """The forces of a step are known: find what acts besides them; collective.

    Raises:
        RunError: on all ranks, for a word that stands for another number of numbers than there are
            bodies, or for some that are not finite.
    """
    host, said, given = integrator.host, integrator.external.said, integrator.external.given
    if not host.pushes:
        return
    ids, wrenches = (cell.array for cell in integrator.external.cells.values())
    wrenches[:], energy = said.numbers[:ENERGY], said.numbers[ENERGY]
    wrenches[np.searchsorted(ids, given.ids)] += given.wrenches
    for (column, word), value in zip(said.words.items(), host.values(), strict=True):
        # in each step: so texts are made only where one is wanted
        if value.ndim and value.size != len(ids):
            _refuse(
                True,
                f"{word} has {value.size} values, and there are {len(ids)} bodies: give it a value "
                "for each body, in the order of f_ID[i][j]",
            )
        if not np.isfinite(value).all():
            _refuse(True, f"{word} is not finite in step {integrator.lammps.step}")
        if column == ENERGY:
            energy = value.sum()
        else:
            wrenches[:, column] += value
    if host.told is not None:
        host.told[0] = energy
        host.told[1:] = _virial(integrator, ids, wrenches) if said.virial else 0.0
    host.pushes = bool(said.words or said.virial)  # else nothing changes


def _virial(integrator: "Integrator", ids: np.ndarray, wrenches: np.ndarray) -> list[float]:
    """Of the forces on the bodies that are counted here, (6,); faces do not cut their places.

    It is about the origin, as that of fix addforce, which matters if the forces have a sum.  A
    barostat stretches the box about its centre, so there this is the point.
    """
    bodies, box = integrator.bodies, integrator.lammps.box
    x = (bodies.x + box.h @ bodies.image)[:, bodies.listed]
    if integrator.box_every:
        x -= (box.lo + 0.5 * box.h.sum(axis=1))[:, None]
    force = wrenches[np.searchsorted(ids, bodies.id[bodies.listed]), :3].T
    return [(force[a] * x[b]).sum() for a, b in _COMPONENTS]
