"""A script's rigid atoms, and the fixes that move them, from the output of ``reader``.

Nothing is guessed: an `AmbiguousScript` error names the option that decides.
"""

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fix_nosquish.host import rigid_fixes

from .. import COMMAND
from ..scenes.integrators import CONSTRAINING, OLDER, target
from . import commands
from .commands import split_words

OURS = "NVE", "NVT", "NPT", "NPH", *OLDER  # classes that can be replaced
NATIVE = "NVE", "NVT", "NPT", "NPH", "HMC"  # classes that have a fix style of the plugin
# the text in quotes; in committed results the older schemes are classes of fix_nosquish
QUOTED = re.compile(rf"({'|'.join(('fix_nosquish', *OLDER.values()))})\.\w+\s+\S+\s+\S")
POINT_FIXES = "nve", "nvt", "npt", "nph"  # fixes that move points, and can be replaced by ours
AXES = "iso", "aniso", "x", "y", "z"
TILTS = "tri", "xy", "xz", "yz"
# numbers of arguments of keywords; other keywords have one
ARGUMENT_COUNTS = dict.fromkeys((*AXES, *TILTS, "temp", "tparam", "fixedpoint"), 3)
ARGUMENT_COUNTS |= {"force": 4, "torque": 4, "langevin": 4, "output": 2, "moments": 2}
# keywords that any integrator may have, and the families of LAMMPS's rigid fixes that have them
SHARED_KEYWORDS: dict[str, tuple[str, ...]]
SHARED_KEYWORDS = dict.fromkeys(("infile", "gravity", "dilate"), ("rigid", "small"))
SHARED_KEYWORDS |= {"force": ("rigid",), "torque": ("rigid",), "mol": ("small",), "reinit": ()}
# keywords that each integrator gets in its own form
SCHEME_KEYWORDS = "seed", "thermostat", "barostat", "flexible"  # others have them in another form
LARGEST_CLUSTER = 3  # atoms of the largest cluster that shake keeps rigid


class FixCommand(NamedTuple):
    """A fix of this package or of an older scheme, as a fix style or quoted in a fix python/move.

    Attributes:
        name: of the class.
        group: of the bodies' atoms; in quotes the group of the class, not of the fix.
        bodies: the body style with its arguments.
        keywords: all words after these.
    """

    name: str
    group: str
    bodies: tuple[str, ...]
    keywords: tuple[str, ...]

    def fix(self, fix_id: str) -> str:
        """The command with this ID: quoted only for a class without fix style."""
        words = (*self.bodies, *self.keywords)
        if self.name in NATIVE:
            text = " ".join(f'"{word}"' if re.search(r"\s", word) else word for word in words)
            return f"fix {fix_id} {self.group} nosquish/{self.name.lower()} {text}"
        text = " ".join((target(self.name), self.group, *words))
        return f'fix {fix_id} {self.group} python/move "{text}"'


class AmbiguousScript(SystemExit):
    """The script does not determine what is rigid; the message names the option that does."""


@dataclass(frozen=True)
class State:
    """Temperature and pressure, in the script's own words.

    Attributes:
        temp: start, stop, damping; None at constant energy.
        press: words of axes and tilts with start, stop, damping each.
        couple: argument of ``couple``; None without it.
    """

    temp: tuple[str, ...] | None = None
    press: tuple[tuple[str, ...], ...] = ()
    couple: str | None = None

    @property
    def ensemble(self) -> str:
        """The ensemble, as in the names of fixes."""
        heat, box = bool(self.temp), bool(self.press)
        return {(0, 0): "nve", (1, 0): "nvt", (1, 1): "npt", (0, 1): "nph"}[heat, box]

    @property
    def tilts(self) -> bool:
        """Whether the angles of the box change."""
        return any(name in TILTS for name, *_ in self.press)

    @property
    def ramps(self) -> list[str]:
        """Quantities whose value at the end of a run differs from that at its start, with both."""
        temp = [("temp", *self.temp)] if self.temp else []
        return [
            f"{name} from {start} to {stop}"
            for name, start, stop, *_ in (*temp, *self.press)
            if float(start) != float(stop)
        ]


@dataclass(frozen=True)
class RigidAtoms:
    """A script's rigid atoms, and the fixes that move them.

    Attributes:
        ids: of these fixes, in the script's order; all are replaced.
        lines: their commands.
        style: of the fix that keeps the atoms rigid (or moves them), without ``/omp`` etc.
        kind: ``ours``, ``rigid``, ``constraints`` or ``plain`` (nothing is rigid there).
        group, bodies: of the bodies' atoms, and the body style with its arguments.
        state: temperature and pressure that these fixes control.
        body: (atoms,) number of each atom's body from 1, 0 for none.
        rest: whether the fixes also move atoms in no body.
        mover, holder: the commands that move these, and that constrain some of them.
        flexible: group of these atoms, if it has a name.
        constraints: words of shake that keep the same bodies rigid; None if it cannot.
        why: why it cannot.
        keywords: those that other integrators get, too, each with its arguments.
        dropped: those that they do not get.
        modified: commands ``fix_modify`` of these fixes, and ``compute_modify`` of their computes.
        setup: commands that define the group, if the script has none.
    """

    ids: tuple[str, ...]
    lines: tuple[str, ...]
    style: str
    kind: str
    group: str
    bodies: str
    state: State
    body: np.ndarray
    rest: bool = False
    mover: str = ""
    holder: str = ""
    flexible: str = ""
    constraints: str | None = None
    why: str = ""
    keywords: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    modified: tuple[str, ...] = ()
    setup: tuple[str, ...] = field(default=())


def style_of(line: str) -> str:
    """The style of a fix without suffixes of accelerated variants: rigid/nvt/nosquish, also for
    nosquish/rigid/nvt, and nosquish/nvt for nosquish/nvt/small."""
    plain = re.sub(r"/(omp|intel|kk|gpu|opt)$", "", split_words(line)[3])
    plain = re.sub(r"^nosquish/(rigid.*)", r"\1/nosquish", plain)
    return re.sub(r"^(nosquish/\w+)/small$", r"\1", plain)


def parse_fix(line: str) -> FixCommand | None:
    """The command of a fix of this package or of an older scheme; None for another command, and for
    a fix that lacks arguments (LAMMPS reports it)."""
    word, *rest = split_words(line) or [""]
    if word != "fix" or len(rest) < 4:
        return None
    _, group, _, *words = rest
    if (style := style_of(line)).startswith("nosquish/"):
        name = style.partition("/")[2].upper()
    elif style == "python/move" and QUOTED.match(words[0]):
        named, group, *words = words[0].split()
        name = named.rpartition(".")[2]
    else:
        return None
    count = body_words(words)
    return FixCommand(name, group, tuple(words[:count]), tuple(words[count:]))


def short_name(line: str) -> str:
    """A fix in one word: its style, or the class in quotes."""
    style, words = style_of(line), split_words(line)
    if style.endswith(commands.SUFFIX):
        name = rigid_fixes.integrator(str(rigid_fixes.plain(style)), words)
        return f"nosquish/{name.lower()}"
    return words[4].split()[0] if style == "python/move" else style


def kind_of(line: str) -> str | None:
    """How a fix moves atoms, see `RigidAtoms`; None if ours cannot replace it."""
    style, ours = style_of(line), parse_fix(line)
    if ours:
        return "ours" if ours.name in OURS else None
    if style.endswith(commands.SUFFIX):
        return "ours"
    if style == "rigid" or style.startswith("rigid/"):
        return "rigid"
    if style in CONSTRAINING:
        return "constraints"
    return "plain" if style in POINT_FIXES else None


def rigid_fix_ids(fixes: Mapping[str, str], wanted: Collection[str] = ()) -> list[str]:
    """The IDs of the fixes that keep atoms rigid; of the wanted ones, if any, once all are
    defined."""
    if wanted:
        return list(wanted) if set(wanted) <= fixes.keys() else []
    return [fix_id for fix_id, line in fixes.items() if kind_of(line) not in (None, "plain")]


def describe_fixes(fixes: Mapping[str, str]) -> str:
    """Describe the fixes in words."""
    texts = (
        f"{fix_id} ({style_of(line)} on {split_words(line)[2]})" for fix_id, line in fixes.items()
    )
    return ", ".join(texts) or "no fix"


def no_rigid_run(
    seen: Sequence[str], wanted: Collection[str] = (), at: int = 1, had: int = 0
) -> str:
    """The message for a script without a run in which a fix keeps atoms rigid.

    Args:
        seen: the runs, with their fixes.
        wanted: of --fix.  at: of --run.  had: number of runs with rigid atoms.
    """
    if had:
        return f"--run {at}: the script has only {had} such runs"
    if not seen:
        return "the script has no run of at least one step"
    runs = "; ".join(seen[:4]) + " ..." * (len(seen) > 4)
    if wanted:
        return f"no run of the script has fix {' and '.join(wanted)}. Its runs and fixes: {runs}"
    return (
        f"no run of the script has a fix that keeps atoms rigid. Its runs and their fixes: {runs}. "
        "To make molecules rigid, give --group GROUP --bodies molecule. For parts of molecules, "
        f"'{COMMAND} check SCRIPT --rigid' writes the lines"
    )


def find(
    reading: Mapping,
    atoms: Mapping[str, np.ndarray],
    wanted: Sequence[str] = (),
    group: str | None = None,
    bodies: str | None = None,
) -> RigidAtoms:
    """Find the rigid atoms, and what moves them.

    Args:
        reading, atoms: of ``reader``: read.json and atoms.npz.
        wanted: --fix.  group: --group.  bodies: --bodies.

    Raises:
        AmbiguousScript: the script does not determine them, or no integrator can replace the fix.
    """
    fixes: dict[str, str] = reading["fixes"]
    if absent := [fix_id for fix_id in wanted if fix_id not in fixes]:
        raise AmbiguousScript(
            f"there is no fix {absent[0]} at that run; it has {describe_fixes(fixes)}"
        )
    known = rigid_fix_ids(fixes, wanted)
    if not known:
        known = _movers(reading, atoms, fixes, in_group(reading, atoms, group or "all"))
    kinds = {fix_id: kind_of(fixes[fix_id]) for fix_id in known}
    strange = [fix_id for fix_id, kind in kinds.items() if kind is None]
    if strange:
        raise AmbiguousScript(
            f"fix {strange[0]} ({style_of(fixes[strange[0]])}) cannot be replaced by "
            "another integrator: select one by --fix ID, of the styles nosquish/*, rigid*, "
            f"shake, rattle, {', '.join(POINT_FIXES)}"
        )
    held = [fix_id for fix_id in known if kinds[fix_id] != "plain"] or known
    if len(held) > 1:
        raise AmbiguousScript(
            f"{len(held)} fixes could be replaced: "
            f"{describe_fixes({name: fixes[name] for name in held})}. Select one by --fix ID, with "
            f"ID one of {', '.join(held)}. The others stay as they are"
        )
    line, kind = fixes[held[0]], kinds[held[0]]
    if kind in ("ours", "rigid") and not (group or bodies):
        rigid = _of_rigid(reading, atoms, held[0], line, kind)
    else:
        rigid = _of_points(reading, atoms, fixes, held[0], str(kind), known, group, bodies)
    return replace(rigid, modified=tuple(modify_commands(reading["commands"], rigid.ids)))


def compute_ids(ids: Collection[str]) -> set[str]:
    """The IDs of computes that fixes with these IDs define."""
    return {f"{fix_id}_{kind}" for fix_id in ids for kind in ("temp", "press")}


def modify_commands(commands: Sequence[str], ids: Collection[str]) -> list[str]:
    """The commands ``fix_modify`` of fixes with these IDs, and ``compute_modify`` of their
    computes."""
    named = {"fix_modify": {*ids}, "compute_modify": compute_ids(ids)}
    split = ((line, split_words(line)) for line in commands)
    return [line for line, words in split if words[1:2] and words[1] in named.get(words[0], ())]


def in_group(reading: Mapping, atoms: Mapping[str, np.ndarray], group: str) -> np.ndarray:
    """The mask of a group's atoms, (atoms,).

    Raises:
        AmbiguousScript: there is no such group.
    """
    if group not in reading["groups"]:
        names = ", ".join(filter(None, reading["groups"]))
        raise AmbiguousScript(f"the script has no group {group} at its run; it has {names}")
    return atoms["mask"] & (1 << reading["groups"].index(group)) != 0


def atoms_of_fix(reading: Mapping, atoms: Mapping[str, np.ndarray], line: str) -> np.ndarray:
    """The mask of the atoms that a fix acts on: those of its group; for ours those of the class's
    group and its flexible atoms."""
    ours = parse_fix(line)
    if not ours:
        return in_group(reading, atoms, split_words(line)[2])
    flexible = _flexible(ours.keywords)
    mask = in_group(reading, atoms, ours.group)
    return mask | in_group(reading, atoms, flexible) if flexible else mask


def other_thermostats(
    reading: Mapping, atoms: Mapping[str, np.ndarray], rigid: RigidAtoms
) -> dict[str, str]:
    """The styles of the script's other fixes that control the temperature of bodies, by ID."""
    others = (
        (fix_id, line) for fix_id, line in reading["fixes"].items() if fix_id not in rigid.ids
    )
    return {
        fix_id: style_of(line)
        for fix_id, line in others
        if style_of(line).split("/")[0] in ("langevin", "temp", "nvt", "npt")
        and (atoms_of_fix(reading, atoms, line) & (rigid.body > 0)).any()
    }


def _flexible(keywords: Sequence[str]) -> str:
    """The argument of keyword flexible; empty without it."""
    return next((part[1] for part in _split(keywords) if part[0] == "flexible"), "")


def _movers(reading, atoms, fixes, mask) -> list[str]:
    """The IDs of fixes that move some of these atoms as points."""
    points = [fix_id for fix_id, line in fixes.items() if kind_of(line) == "plain"]
    return [
        fix_id for fix_id in points if (atoms_of_fix(reading, atoms, fixes[fix_id]) & mask).any()
    ]


def _split(words: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Yield keywords with their arguments."""
    position = 0
    while position < len(words):
        alone = [*words[position : position + 2]] == ["moments", "step"]
        count = 2 if alone else 1 + ARGUMENT_COUNTS.get(words[position], 1)
        yield tuple(words[position : position + count])
        position += count


def state_of(words: Sequence[str]) -> tuple[State, list[str], list[str]]:
    """A fix's temperature and pressure, the keywords that other integrators get, and the others."""
    temp: tuple[str, ...] | None = None
    press, couple, shared, dropped = [], None, [], []
    for part in _split(words):
        if part[0] == "temp":
            temp = part[1:]
        elif part[0] == "langevin":
            temp = part[1:4]
        elif part[0] in (*AXES, *TILTS):
            press.append(part)
        elif part[0] == "couple":
            couple = part[1] if part[1] != "none" else None
        elif part[0] in SHARED_KEYWORDS:
            shared.append(" ".join(part))
        elif part[0] not in SCHEME_KEYWORDS:
            dropped.append(" ".join(part))
    return State(temp, tuple(press), couple), shared, dropped


def body_words(words: Sequence[str]) -> int:
    """The number of words of the body style that begins these."""
    if words[:1] == ["custom"]:
        return 2
    counted = words[:1] == ["group"] and words[1:2] and words[1].isdigit()
    return 2 + int(words[1]) if counted else 1


def _of_rigid(reading, atoms, fix_id, line, kind) -> RigidAtoms:
    """The bodies of one of ours or of LAMMPS's rigid fixes, and of a barostat beside it."""
    words, ours = split_words(line), parse_fix(line)
    if ours:
        _, group, bodies, keywords = ours
    else:
        count = body_words(words[4:])
        group, bodies, keywords = words[2], (*words[4 : 4 + count],), (*words[4 + count :],)
    flexible, ids = _flexible(keywords), [fix_id]
    state, shared, dropped = state_of(keywords)
    body = number_bodies(reading, atoms, group, bodies)
    constraints, why = _held_by_shake(atoms, body)
    if names := [word.split()[0] for word in shared if not word.startswith("reinit")]:
        constraints, why = None, f"it has nothing like keyword {' and '.join(dict.fromkeys(names))}"
    barostat = _barostat_beside(reading, atoms, body) if kind == "rigid" else None
    if barostat and not state.press:
        ids.append(barostat)
        _, _, flexible, _, *words = split_words(reading["fixes"][barostat])
        box, _, lost = state_of(words)
        state, dropped = replace(box, temp=state.temp or box.temp), [*dropped, *lost]
    ids = [name for name in reading["fixes"] if name in ids]
    return RigidAtoms(
        tuple(ids),
        tuple(reading["fixes"][name] for name in ids),
        short_name(line),
        kind,
        group,
        " ".join(bodies),
        state,
        body,
        rest=bool(flexible),
        flexible=flexible,
        constraints=constraints,
        why=why,
        keywords=tuple(shared),
        dropped=tuple(dropped),
    )


def _barostat_beside(reading, atoms, body) -> str | None:
    """The ID of the fix npt or nph that moves only atoms in no body, and the box with them: a fix
    that moves bodies and controls the pressure has to move these atoms, too."""
    for fix_id, line in reading["fixes"].items():
        if style_of(line) in ("npt", "nph"):
            mask = atoms_of_fix(reading, atoms, line)
            if mask.any() and not (mask & (body > 0)).any():
                return fix_id
    return None


def number_bodies(reading, atoms, group: str, bodies: Sequence[str]) -> np.ndarray:
    """The number of each atom's body, (atoms,), from 1; 0 for none.

    Atoms with molecule-ID 0 are one body, as in LAMMPS.
    """
    mask = in_group(reading, atoms, group)
    if bodies[0] == "single":
        return mask.astype(int)
    if bodies[0] == "group":
        body = np.zeros(len(mask), int)
        for number, name in enumerate(bodies[2:], 1):
            body[in_group(reading, atoms, name) & mask] = number
        return body
    name = "molecule" if bodies[0] == "molecule" else bodies[1]
    if name not in atoms:
        raise AmbiguousScript(f"atoms have no {name}, which body style '{' '.join(bodies)}' needs")
    value = np.asarray(atoms[name])
    body = np.zeros(len(value), int)
    _, body[mask] = np.unique(value[mask], return_inverse=True)
    body[mask] += 1
    return body


def _held_by_shake(atoms: Mapping[str, np.ndarray], body: np.ndarray) -> tuple[str | None, str]:
    """The words of shake that keep the bodies rigid; or None, and why it cannot."""
    sizes, words = np.bincount(body)[1:], []
    if len(sizes) == 0 or sizes.max() > LARGEST_CLUSTER:
        return None, f"it keeps at most 3 atoms rigid, and bodies have {sizes.max(initial=0)}"
    if sizes.min() < 2 or "bonds" not in atoms:
        return None, "there are bodies without bonds"
    needed = {"bonds": sizes - 1, "angles": (sizes == LARGEST_CLUSTER).astype(int)}
    for name, least in needed.items():
        rows = _rows(atoms, name)
        ends = body[rows[:, 1:] - 1]
        within = (ends[:, 0] > 0) & (ends == ends[:, :1]).all(axis=1)
        counted = np.bincount(ends[within, 0], minlength=len(sizes) + 1)[1:]
        types = np.unique(rows[within, 0])
        if not least.any():
            continue
        if (counted < least).any() or np.isin(rows[~within, 0], types).any():
            return (
                None,
                f"bodies have too few {name}, or {name} of types that other atoms have, too",
            )
        words += [name[0], *map(str, types)]
    return " ".join(words), ""


def _rows(atoms: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    """Bonds or angles, as rows of a type and atom IDs."""
    return np.asarray(atoms.get(name, np.empty((0, {"bonds": 3, "angles": 4}[name]), int)))


def connected_parts(bonds: np.ndarray, atoms: int) -> np.ndarray:
    """The molecule of each atom, (atoms,), from 0, by bonds: rows of (type, atom ID, atom ID)."""
    i, j = bonds[:, 1] - 1, bonds[:, 2] - 1
    graph = coo_array((np.ones(len(bonds)), (i, j)), shape=(atoms, atoms))
    return connected_components(graph, directed=False)[1]


def _of_points(reading, atoms, fixes, fix_id, kind, known, group, bodies) -> RigidAtoms:
    """Points: constrained by shake or rattle, or free."""
    line, body = fixes[fix_id], None
    holder = line if kind == "constraints" else ""
    if holder and not (group or bodies):
        body = rigid_clusters(atoms, in_group(reading, atoms, split_words(holder)[2]))
        style = "molecule"
    elif kind in ("ours", "rigid"):
        raise AmbiguousScript(
            "--group and --bodies are for scripts whose fixes do not define bodies"
        )
    else:
        if not bodies:
            raise AmbiguousScript("--bodies is missing: give --bodies molecule (or custom i_NAME)")
        if not _are_bodies(bodies.split(), reading["groups"]):
            raise AmbiguousScript(
                f"--bodies {bodies}: molecule, custom i_NAME, single, or group N with N names of "
                "groups that there are, is expected"
            )
        style = bodies
        body = number_bodies(reading, atoms, group or split_words(line)[2], bodies.split())
    name, setup = _group_of(reading, atoms, body, group)
    if bodies is None and not _same(atoms, body):
        raise AmbiguousScript(
            f"the clusters of shake are not whole molecules by molecule ID: '{COMMAND} check "
            "SCRIPT --rigid' writes lines that define bodies"
        )
    moving = [other for other in known if kind_of(fixes[other]) == "plain"]
    movers = moving or _movers(reading, atoms, fixes, body > 0)
    if len(movers) != 1:
        raise AmbiguousScript(
            f"{len(movers) or 'no'} fixes of the styles {', '.join(POINT_FIXES)} move the rigid "
            f"atoms: {describe_fixes({other: fixes[other] for other in movers})}"
            + f". Select one by --fix ID --fix {fix_id}"
            * bool(movers)
        )
    mover = fixes[movers[0]]
    words = split_words(mover)
    state, _, dropped = state_of(words[4:])
    moved = in_group(reading, atoms, words[2])
    if not moved[body > 0].all():
        raise AmbiguousScript(
            f"fix {movers[0]} moves only part of the rigid atoms, those of group {words[2]}. If "
            f"these are whole bodies, give --group {words[2]} --bodies molecule"
        )
    ids = [other for other in fixes if other == movers[0] or fixes[other] == holder]
    held, why = ((holder and shake_words(holder)) or None), ""
    if not held:
        held, why = _held_by_shake(atoms, body)
    free = (
        holder
        and held_atoms(atoms, in_group(reading, atoms, split_words(holder)[2]))[body == 0].any()
    )
    return RigidAtoms(
        tuple(ids),
        tuple(fixes[other] for other in ids),
        style_of(line),
        kind,
        name,
        style,
        state,
        body,
        rest=bool(moved[body == 0].any()),
        mover=mover,
        holder=holder if free else "",
        constraints=held,
        why=why,
        dropped=tuple(dropped),
        setup=tuple(setup),
    )


def _are_bodies(words: Sequence[str], groups: Collection[str]) -> bool:
    """Whether words of --bodies are those of a body style."""
    if words[:1] == ["group"]:
        names = words[2:]
        return words[1:2] == [str(len(names))] and bool(names) and set(names) <= set(groups)
    if words[:1] == ["custom"]:
        return len(words) == 2 and words[1].startswith(("i_", "v_"))
    return list(words) in (["molecule"], ["single"])


def shake_words(line: str) -> str:
    """What a fix shake constrains: its words from b, a, t, m on."""
    words = split_words(line)[7:]
    until = next((i for i, word in enumerate(words) if word in ("mol", "kbond")), len(words))
    return " ".join(words[:until])


def held_bonds(atoms: Mapping[str, np.ndarray], mask: np.ndarray) -> np.ndarray:
    """The mask of the bonds that shake constrains between atoms of a mask."""
    ends = _rows(atoms, "bonds")[:, 1:] - 1
    return atoms["held_bonds"] & mask[ends].all(axis=1) if len(ends) else np.zeros(0, bool)


def held_atoms(atoms: Mapping[str, np.ndarray], mask: np.ndarray) -> np.ndarray:
    """The mask of the atoms in a bond of `held_bonds`."""
    held = np.zeros(len(atoms["type"]), bool)
    held[_rows(atoms, "bonds")[held_bonds(atoms, mask), 1:] - 1] = True
    return held


def rigid_clusters(atoms: Mapping[str, np.ndarray], mask: np.ndarray) -> np.ndarray:
    """The bodies that shake makes of atoms in a mask, (atoms,), numbers from 1, 0 for none: whole
    molecules of two atoms, or of three with a constrained angle."""
    bonds, angles = _rows(atoms, "bonds"), _rows(atoms, "angles")
    number = len(atoms["type"])
    part = connected_parts(bonds, number)
    sizes = np.bincount(part)
    constrained = np.bincount(part[bonds[:, 1] - 1], held_bonds(atoms, mask), minlength=len(sizes))
    every = np.bincount(part[bonds[:, 1] - 1], minlength=len(sizes))
    bent = angles[atoms["held_angles"]] if len(angles) else angles
    stiff = np.bincount(part[bent[:, 2] - 1], minlength=len(sizes)) > 0
    rigid = (every == constrained) & (every == sizes - 1) & ((sizes == 2) | ((sizes == 3) & stiff))
    chosen = rigid[part]
    if not chosen.any():
        raise AmbiguousScript(
            "shake keeps no whole molecule rigid here: none of two atoms, and none of three with "
            "its angle. It constrains parts of flexible molecules, which no rigid fix does"
        )
    body = np.zeros(number, int)
    _, body[chosen] = np.unique(part[chosen], return_inverse=True)
    body[chosen] += 1
    return body


def _same(atoms, body) -> bool:
    """Whether molecule IDs define the same bodies."""
    if "molecule" not in atoms:
        return False
    inside = body > 0
    pairs = np.unique(np.stack([np.asarray(atoms["molecule"])[inside], body[inside]]), axis=1)
    return pairs.shape[1] == body.max() == len(np.unique(pairs[0])) and pairs[0].min() > 0


def _group_of(reading, atoms, body, group) -> tuple[str, list[str]]:
    """The name of a group of the bodies' atoms, and the commands that define it."""
    inside = body > 0
    for name in [group] if group else filter(None, reading["groups"]):
        if (in_group(reading, atoms, name) == inside).all():
            return name, []
    types = np.asarray(atoms["type"])
    of_bodies = np.unique(types[inside])
    if not np.isin(types[~inside], of_bodies).any():
        words = "type " + " ".join(map(str, of_bodies))
    else:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
        words = "id " + " ".join(f"{a + 1}:{b}" for a, b in edges.reshape(-1, 2))
    return "own_bodies", [f"group own_bodies {words}"]
