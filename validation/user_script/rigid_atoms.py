"""Which fix of a script moves its rigid atoms, and which are they.  From what ``reader`` has left.

What cannot be told is not guessed: an `AmbiguousScript` says which option tells it.
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
from ..scenes.integrators import OLDER, target
from . import commands
from .commands import split_words

OURS = "NVE", "NVT", "NPT", "NPH", *OLDER  # others can take their place
NATIVE = "NVE", "NVT", "NPT", "NPH", "HMC"  # classes that have a fix style of the plugin
# the text in quotes; committed results have the older schemes as classes of fix_nosquish
QUOTED = re.compile(rf"({'|'.join(('fix_nosquish', *OLDER.values()))})\.\w+\s+\S+\s+\S")
CONSTRAINTS = "shake", "rattle"
POINT_FIXES = "nve", "nvt", "npt", "nph"  # fixes that move points, whose place ours can take
AXES = "iso", "aniso", "x", "y", "z"
TILTS = "tri", "xy", "xz", "yz"
# of a fix's keywords how many words follow
ARGUMENT_COUNTS = dict.fromkeys((*AXES, *TILTS, "temp", "tparam", "fixedpoint"), 3)
ARGUMENT_COUNTS |= {"force": 4, "torque": 4, "langevin": 4, "output": 2, "moments": 2}
# keywords that are not of one integrator, and which of LAMMPS's rigid fixes have them, too
SHARED_KEYWORDS: dict[str, tuple[str, ...]]
SHARED_KEYWORDS = dict.fromkeys(("infile", "gravity", "dilate"), ("rigid", "small"))
SHARED_KEYWORDS |= {"force": ("rigid",), "torque": ("rigid",), "mol": ("small",), "reinit": ()}
SCHEME_KEYWORDS = (
    "seed",
    "thermostat",
    "barostat",
    "flexible",
    "details",
)  # others have these in their way
LARGEST_CLUSTER = 3  # atoms of the largest cluster that shake holds as a rigid body


class FixCommand(NamedTuple):
    """What a fix of this package, or of an older scheme, says, native or in the quotes of fix
    python/move.

    Attributes:
        name: of the class.
        group: of the bodies' atoms.  In quotes it is the class's, whatever the fix's own is.
        bodies: the body style with its words.
        keywords: all that stands behind these.
    """

    name: str
    group: str
    bodies: tuple[str, ...]
    keywords: tuple[str, ...]

    def fix(self, fix_id: str) -> str:
        """The command with this ID: native, but of a class without fix style."""
        words = (*self.bodies, *self.keywords)
        if self.name in NATIVE:
            told = " ".join(f'"{word}"' if re.search(r"\s", word) else word for word in words)
            return f"fix {fix_id} {self.group} nosquish/{self.name.lower()} {told}"
        told = " ".join((target(self.name), self.group, *words))
        return f'fix {fix_id} {self.group} python/move "{told}"'


class AmbiguousScript(SystemExit):
    """What was found is not enough; the message says which option tells more."""


@dataclass(frozen=True)
class State:
    """Temperature and pressure, in the script's own words.

    Attributes:
        temp: start, stop, damping; None at constant energy.
        press: words of axes and tilts with start, stop, damping each.
        couple: the word behind ``couple``; None for none.
    """

    temp: tuple[str, ...] | None = None
    press: tuple[tuple[str, ...], ...] = ()
    couple: str | None = None

    @property
    def ensemble(self) -> str:
        """As the names of fixes have it."""
        heat, box = bool(self.temp), bool(self.press)
        return {(0, 0): "nve", (1, 0): "nvt", (1, 1): "npt", (0, 1): "nph"}[heat, box]

    @property
    def tilts(self) -> bool:
        """Whether the box changes its angles."""
        return any(name in TILTS for name, *_ in self.press)

    @property
    def ramps(self) -> list[str]:
        """What has another value at the end of a run than at its begin, with both."""
        known = [("temp", *self.temp)] if self.temp else []
        return [
            f"{name} from {start} to {stop}"
            for name, start, stop, *_ in (*known, *self.press)
            if float(start) != float(stop)
        ]


@dataclass(frozen=True)
class RigidAtoms:
    """The fixes that move a script's rigid atoms.

    Attributes:
        ids: of the fixes, in the script's order; all are replaced.
        lines: their commands.
        style: of the one that keeps the atoms rigid (or moves them), without ``/omp`` and the like.
        kind: ``ours``, ``rigid``, ``constraints`` or ``plain`` (nothing is rigid there).
        group: of the bodies' atoms, and ``bodies``, the body style with its words.
        state: temperature and pressure that these fixes keep.
        body: (atoms,) number of each atom's body from 1, 0 for none.
        rest: whether the fixes also move other atoms, ``mover`` is the command that does, and
            ``holder`` the one that holds some of these.
        flexible: group of these other atoms, where one of ours moves them with the bodies.
        constraints: the words of shake that hold the same bodies; None if there are none.
        why: why not.
        keywords: that go into other fixes, too, each with its words.
        dropped: keywords that do not.
        modified: commands ``fix_modify`` of these fixes, and ``compute_modify`` of their computes.
        setup: commands that make the group, if the script has none.
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
    """Of a fix, without suffixes of accelerated variants: rigid/nvt/nosquish, also for
    nosquish/rigid/nvt, and nosquish/nvt for nosquish/nvt/small."""
    plain = re.sub(r"/(omp|intel|kk|gpu|opt)$", "", split_words(line)[3])
    plain = re.sub(r"^nosquish/(rigid.*)", r"\1/nosquish", plain)
    return re.sub(r"^(nosquish/\w+)/small$", r"\1", plain)


def parse_fix(line: str) -> FixCommand | None:
    """What a fix of any class of this package, or of an older scheme, says; None of another
    command, and of a fix that lacks words, which LAMMPS tells."""
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
    """What a fix does, in a word: its style, or its class in quotes."""
    style, words = style_of(line), split_words(line)
    if style.endswith(commands.SUFFIX):
        name = rigid_fixes.integrator(str(rigid_fixes.plain(style)), words)
        return f"nosquish/{name.lower()}"
    return words[4].split()[0] if style == "python/move" else style


def moves_atoms(line: str) -> bool:
    """Whether a fix moves atoms, as far as is known."""
    return bool(kind_of(line) or parse_fix(line)) or style_of(line) == "python/move"


def kind_of(line: str) -> str | None:
    """What a fix is to the atoms; None if it is none that ours can take the place of."""
    style, ours = style_of(line), parse_fix(line)
    if ours:
        return "ours" if ours.name in OURS else None
    if style.endswith(commands.SUFFIX):
        return "ours"
    if style == "rigid" or style.startswith("rigid/"):
        return "rigid"
    if style in CONSTRAINTS:
        return "constraints"
    return "plain" if style in POINT_FIXES else None


def rigid_fix_ids(fixes: Mapping[str, str], wanted: Collection[str] = ()) -> list[str]:
    """IDs of the fixes that keep atoms rigid; of those that are wanted, if any are."""
    if wanted:
        return list(wanted) if set(wanted) <= fixes.keys() else []
    return [fix_id for fix_id, line in fixes.items() if kind_of(line) not in (None, "plain")]


def describe_fixes(fixes: Mapping[str, str]) -> str:
    """The fixes in words."""
    said = (
        f"{fix_id} ({style_of(line)} on {split_words(line)[2]})" for fix_id, line in fixes.items()
    )
    return ", ".join(said) or "no fix"


def no_rigid_run(
    seen: Sequence[str], wanted: Collection[str] = (), at: int = 1, had: int = 0
) -> str:
    """What to say where no run has a fix that keeps atoms rigid.

    Args:
        seen: the runs, with their fixes.
        wanted: of --fix.  at: of --run.  had: how many such runs there are.
    """
    if had:
        return f"--run {at}: the script has {had} such runs, and no other behind them"
    if not seen:
        return (
            "the script has no run of a step or more, so there is nothing to compare: give the "
            "script that runs, not one that it includes"
        )
    some = "; ".join(seen[:4]) + " ..." * (len(seen) > 4)
    if wanted:
        return f"no run of the script has fix {' and '.join(wanted)}. Its runs and fixes: {some}"
    return (
        f"no run of the script has a fix that keeps atoms rigid. Its runs and their fixes: {some}. "
        "If some molecules are to be rigid, say which: --group GROUP --bodies molecule (and --fix "
        "ID, if several fixes move that group). Where atoms have no molecule IDs, "
        f"'{COMMAND} check SCRIPT --rigid' finds rigid parts and writes lines for them"
    )


def find(
    said: Mapping,
    atoms: Mapping[str, np.ndarray],
    wanted: Sequence[str] = (),
    group: str | None = None,
    bodies: str | None = None,
) -> RigidAtoms:
    """What moves the rigid atoms.

    Args:
        said, atoms: of ``reader``: read.json and atoms.npz.
        wanted: --fix.  group: --group.  bodies: --bodies.

    Raises:
        Unclear: it cannot be told, or is none that another integrator can take the place of.
    """
    fixes: dict[str, str] = said["fixes"]
    if absent := [fix_id for fix_id in wanted if fix_id not in fixes]:
        raise AmbiguousScript(
            f"there is no fix {absent[0]} at that run; it has {describe_fixes(fixes)}"
        )
    known = rigid_fix_ids(fixes, wanted)
    if not known:
        known = _movers(said, atoms, fixes, in_group(said, atoms, group or "all"))
    kinds = {fix_id: kind_of(fixes[fix_id]) for fix_id in known}
    strange = [fix_id for fix_id, kind in kinds.items() if kind is None]
    if strange:
        raise AmbiguousScript(
            f"fix {strange[0]} ({style_of(fixes[strange[0]])}) is none whose place another "
            "integrator can take: name one of these styles by --fix: nosquish/*, rigid*, "
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
        found = _of_rigid(said, atoms, held[0], line, kind)
    else:
        found = _of_points(said, atoms, fixes, held[0], str(kind), known, group, bodies)
    return replace(found, modified=tuple(modify_commands(said["commands"], found.ids)))


def compute_ids(ids: Collection[str]) -> set[str]:
    """IDs of computes that fixes with these IDs make for themselves."""
    return {f"{fix_id}_{kind}" for fix_id in ids for kind in ("temp", "press")}


def modify_commands(commands: Sequence[str], ids: Collection[str]) -> list[str]:
    """The commands ``fix_modify`` of fixes with these IDs, and ``compute_modify`` of their
    computes."""
    named = {"fix_modify": {*ids}, "compute_modify": compute_ids(ids)}
    split = ((line, split_words(line)) for line in commands)
    return [line for line, words in split if words[1:2] and words[1] in named.get(words[0], ())]


def in_group(said: Mapping, atoms: Mapping[str, np.ndarray], group: str) -> np.ndarray:
    """The mask of a group's atoms.

    Raises:
        Unclear: there is no such group.
    """
    if group not in said["groups"]:
        names = ", ".join(filter(None, said["groups"]))
        raise AmbiguousScript(f"the script has no group {group} at its run; it has {names}")
    return atoms["mask"] & (1 << said["groups"].index(group)) != 0


def atoms_of_fix(said: Mapping, atoms: Mapping[str, np.ndarray], line: str) -> np.ndarray:
    """The mask of the atoms that a fix with this command acts on: those of its group; of a class of
    fix_nosquish those of the class's group, and its flexible atoms, whatever the fix's group is."""
    ours = parse_fix(line)
    if not ours:
        return in_group(said, atoms, split_words(line)[2])
    flexible = _flexible(ours.keywords)
    mask = in_group(said, atoms, ours.group)
    return mask | in_group(said, atoms, flexible) if flexible else mask


def other_thermostats(
    said: Mapping, atoms: Mapping[str, np.ndarray], found: RigidAtoms
) -> dict[str, str]:
    """The script's other fixes that keep a temperature of the bodies: their styles by ID."""
    kept = ((fix_id, line) for fix_id, line in said["fixes"].items() if fix_id not in found.ids)
    return {
        fix_id: style_of(line)
        for fix_id, line in kept
        if style_of(line).split("/")[0] in ("langevin", "temp", "nvt", "npt")
        and (atoms_of_fix(said, atoms, line) & (found.body > 0)).any()
    }


def _flexible(keywords: Sequence[str]) -> str:
    """The group of keyword flexible of one of ours; empty for none."""
    return next((part[1] for part in _split(keywords) if part[0] == "flexible"), "")


def _movers(said, atoms, fixes, mask) -> list[str]:
    """IDs of fixes that move some of these atoms as points."""
    own = [fix_id for fix_id, line in fixes.items() if kind_of(line) == "plain"]
    return [fix_id for fix_id in own if (atoms_of_fix(said, atoms, fixes[fix_id]) & mask).any()]


def _split(words: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """Keywords with the words that follow them."""
    position = 0
    while position < len(words):
        alone = [*words[position : position + 2]] == ["moments", "step"]
        count = 2 if alone else 1 + ARGUMENT_COUNTS.get(words[position], 1)
        yield tuple(words[position : position + count])
        position += count


def state_of(words: Sequence[str]) -> tuple[State, list[str], list[str]]:
    """A fix's temperature and pressure; keywords for other fixes, too; and those that are not."""
    temp: tuple[str, ...] | None = None
    press, couple, kept, dropped = [], None, [], []
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
            kept.append(" ".join(part))
        elif part[0] not in SCHEME_KEYWORDS:
            dropped.append(" ".join(part))
    return State(temp, tuple(press), couple), kept, dropped


def body_words(words: Sequence[str]) -> int:
    """How many words a body style takes."""
    if words[:1] == ["custom"]:
        return 2
    counted = words[:1] == ["group"] and words[1:2] and words[1].isdigit()
    return 2 + int(words[1]) if counted else 1


def _of_rigid(said, atoms, fix_id, line, kind) -> RigidAtoms:
    words, ours = split_words(line), parse_fix(line)
    if ours:
        _, group, bodies, keywords = ours
    else:
        count = body_words(words[4:])
        group, bodies, keywords = words[2], (*words[4 : 4 + count],), (*words[4 + count :],)
    flexible = _flexible(keywords)
    state, kept, dropped = state_of(keywords)
    body = number_bodies(said, atoms, group, bodies)
    constraints, why = _held_by_shake(atoms, body)
    if names := [word.split()[0] for word in kept if not word.startswith("reinit")]:
        constraints, why = None, f"it has nothing like keyword {' and '.join(dict.fromkeys(names))}"
    return RigidAtoms(
        (fix_id,),
        (line,),
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
        keywords=tuple(kept),
        dropped=tuple(dropped),
    )


def number_bodies(said, atoms, group: str, bodies: Sequence[str]) -> np.ndarray:
    """The body of each atom, from 1; 0 for none. Atoms with molecule-ID 0 are one, as in LAMMPS."""
    mask = in_group(said, atoms, group)
    if bodies[0] == "single":
        return mask.astype(int)
    if bodies[0] == "group":
        found = np.zeros(len(mask), int)
        for number, name in enumerate(bodies[2:], 1):
            found[in_group(said, atoms, name) & mask] = number
        return found
    name = "molecule" if bodies[0] == "molecule" else bodies[1]
    if name not in atoms:
        raise AmbiguousScript(
            f"atoms have no {name}, which body style '{' '.join(bodies)}' needs: "
            f"'{COMMAND} check SCRIPT --rigid' finds rigid parts and writes lines for them"
        )
    value = np.asarray(atoms[name])
    found = np.zeros(len(value), int)
    _, found[mask] = np.unique(value[mask], return_inverse=True)
    found[mask] += 1
    return found


def _held_by_shake(atoms: Mapping[str, np.ndarray], body: np.ndarray) -> tuple[str | None, str]:
    """The words of shake that hold the bodies; or None, and why."""
    sizes, words = np.bincount(body)[1:], []
    if len(sizes) == 0 or sizes.max() > LARGEST_CLUSTER:
        return None, f"bodies of {sizes.max(initial=0)} atoms: shake holds up to 3 rigid"
    if sizes.min() < 2 or "bonds" not in atoms:
        return None, "without bonds in each body"
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
            return None, f"bodies have too few {name}, or {name} of types that others have, too"
        words += [name[0], *map(str, types)]
    return " ".join(words), ""


def _rows(atoms: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    """Bonds or angles, as rows of a type and atoms."""
    return np.asarray(atoms.get(name, np.empty((0, {"bonds": 3, "angles": 4}[name]), int)))


def connected_parts(bonds: np.ndarray, atoms: int) -> np.ndarray:
    """The connected part, from 0, of each atom, of bonds as rows (type, atom, atom)."""
    i, j = bonds[:, 1] - 1, bonds[:, 2] - 1
    graph = coo_array((np.ones(len(bonds)), (i, j)), shape=(atoms, atoms))
    return connected_components(graph, directed=False)[1]


def _of_points(said, atoms, fixes, fix_id, kind, known, group, bodies) -> RigidAtoms:
    """Of atoms that are held by shake, or not at all."""
    line, body = fixes[fix_id], None
    holder = line if kind == "constraints" else ""
    if holder and not (group or bodies):
        body = rigid_clusters(atoms, in_group(said, atoms, split_words(holder)[2]))
        style = "molecule"
    elif kind in ("ours", "rigid"):
        raise AmbiguousScript(
            "--group and --bodies are for scripts whose fixes do not say what is rigid"
        )
    else:
        if not bodies:
            raise AmbiguousScript("say what is one body, too: --bodies molecule (or custom i_NAME)")
        if not _are_bodies(bodies.split(), said["groups"]):
            raise AmbiguousScript(
                f"--bodies {bodies}: molecule, custom i_NAME, single, or group N with N names of "
                "groups that there are, is expected"
            )
        style = bodies
        body = number_bodies(said, atoms, group or split_words(line)[2], bodies.split())
    name, setup = _group_of(said, atoms, body, group)
    if bodies is None and not _same(atoms, body):
        raise AmbiguousScript(
            f"what shake holds rigid has no molecule IDs of its own: '{COMMAND} check SCRIPT "
            "--rigid' writes lines that tell the bodies, or tell by --group and --bodies"
        )
    moving = [own for own in known if kind_of(fixes[own]) == "plain"]
    movers = moving or _movers(said, atoms, fixes, body > 0)
    if len(movers) != 1:
        raise AmbiguousScript(
            f"{len(movers) or 'no'} fixes of the styles {', '.join(POINT_FIXES)} move the rigid "
            f"atoms: {describe_fixes({own: fixes[own] for own in movers})}. Select one by --fix, "
            f"together with {fix_id}"
        )
    mover = fixes[movers[0]]
    words = split_words(mover)
    state, _, dropped = state_of(words[4:])
    moved = in_group(said, atoms, words[2])
    if not moved[body > 0].all():
        raise AmbiguousScript(
            f"fix {movers[0]} moves a part of the rigid atoms only, those of group {words[2]}. If "
            f"these are whole bodies, say so: --group {words[2]} --bodies molecule"
        )
    ids = [own for own in fixes if own == movers[0] or fixes[own] == holder]
    held, why = ((holder and shake_words(holder)) or None), ""
    if not held:
        held, why = _held_by_shake(atoms, body)
    free = (
        holder and held_atoms(atoms, in_group(said, atoms, split_words(holder)[2]))[body == 0].any()
    )
    return RigidAtoms(
        tuple(ids),
        tuple(fixes[own] for own in ids),
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
    """What a fix shake holds: its words from b, a, t, m on."""
    words = split_words(line)[7:]
    until = next((i for i, word in enumerate(words) if word in ("mol", "kbond")), len(words))
    return " ".join(words[:until])


def held_bonds(atoms: Mapping[str, np.ndarray], mask: np.ndarray) -> np.ndarray:
    """Which bonds shake holds whose atoms are in a mask."""
    ends = _rows(atoms, "bonds")[:, 1:] - 1
    return atoms["held_bonds"] & mask[ends].all(axis=1) if len(ends) else np.zeros(0, bool)


def held_atoms(atoms: Mapping[str, np.ndarray], mask: np.ndarray) -> np.ndarray:
    """Which atoms are in a bond of `held_bonds`."""
    found = np.zeros(len(atoms["type"]), bool)
    found[_rows(atoms, "bonds")[held_bonds(atoms, mask), 1:] - 1] = True
    return found


def rigid_clusters(atoms: Mapping[str, np.ndarray], mask: np.ndarray) -> np.ndarray:
    """The bodies that shake makes of atoms in a mask: whole molecules of two atoms, or of three
    whose angle is held; numbers from 1, 0 for other atoms."""
    bonds, angles = _rows(atoms, "bonds"), _rows(atoms, "angles")
    number = len(atoms["type"])
    part = connected_parts(bonds, number)
    sizes = np.bincount(part)
    kept = np.bincount(part[bonds[:, 1] - 1], held_bonds(atoms, mask), minlength=len(sizes))
    every = np.bincount(part[bonds[:, 1] - 1], minlength=len(sizes))
    bent = angles[atoms["held_angles"]] if len(angles) else angles
    stiff = np.bincount(part[bent[:, 2] - 1], minlength=len(sizes)) > 0
    rigid = (every == kept) & (every == sizes - 1) & ((sizes == 2) | ((sizes == 3) & stiff))
    chosen = rigid[part]
    if not chosen.any():
        raise AmbiguousScript(
            "shake holds no molecule that is rigid as a whole here: none of two atoms, and none of "
            "three with its angle. What it holds are parts of flexible molecules, and no rigid fix "
            "does that"
        )
    found = np.zeros(number, int)
    _, found[chosen] = np.unique(part[chosen], return_inverse=True)
    found[chosen] += 1
    return found


def _same(atoms, body) -> bool:
    """Whether molecule IDs tell the same bodies."""
    if "molecule" not in atoms:
        return False
    inside = body > 0
    pairs = np.unique(np.stack([np.asarray(atoms["molecule"])[inside], body[inside]]), axis=1)
    return pairs.shape[1] == body.max() == len(np.unique(pairs[0])) and pairs[0].min() > 0


def _group_of(said, atoms, body, group) -> tuple[str, list[str]]:
    """A group of the bodies' atoms, and the commands that make it."""
    inside = body > 0
    for name in [group] if group else filter(None, said["groups"]):
        if (in_group(said, atoms, name) == inside).all():
            return name, []
    types = np.asarray(atoms["type"])
    own = np.unique(types[inside])
    if not np.isin(types[~inside], own).any():
        words = "type " + " ".join(map(str, own))
    else:
        edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
        words = "id " + " ".join(f"{a + 1}:{b}" for a, b in edges.reshape(-1, 2))
    return "own_bodies", [f"group own_bodies {words}"]
