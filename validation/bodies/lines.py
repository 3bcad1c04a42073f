"""What a script says in the place of its own lines, so that rigid parts move as bodies."""

import itertools
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..own import finding, schemes
from ..own.finding import State, Words
from ..own.script import line_of, texts
from . import making
from .making import NOTHING, Beside


class Names(NamedTuple):
    """Of groups, none of which the script has."""

    bodies: str = "bodies"
    points: str = "points"  # what the bodies' fix moved, and is in no body
    others: str = "others"  # all else that is in no body

    @classmethod
    def of(cls, said: Mapping) -> "Names":
        """Names that are free in a script."""
        return cls(*(_free(one, said["groups"]) for one in cls()))


def _free(name: str, taken: Sequence[str]) -> str:
    return _free(f"own_{name}", taken) if name in taken else name


class Moves(NamedTuple):
    """The lines that move bodies, and what they need.

    Attributes:
        gone: the script's fixes that go, by ID.
        lines: in their place.
        sentences: what else the user has to know.
    """

    gone: Mapping[str, str]
    lines: Sequence[str]
    sentences: Sequence[str]


def named(file: Path, folder: Path) -> str:
    """A file as a script in the folder names it, by its whole path if LAMMPS takes that."""
    text = str(file)
    if not text.isascii() or '"' in text:
        text = os.path.relpath(file, folder)
    return text if re.fullmatch(r"[\w./+-]+", text, re.A) else f'"{text}"'


def told(
    kind: str,
    said: Mapping,
    atoms: Mapping[str, np.ndarray],
    body: np.ndarray,
    data: str,
    restart: Beside = NOTHING,
) -> list[str]:
    """Lines for a script, and which of its own they replace.

    Args:
        kind: property or molecule.
        said, atoms: of ``own.reader``.
        body: (atoms,) number of each atom's body, from 1, 0 for none.
        data: the data file that has them, as the script names it.
        restart: of `making.of_restart`.
    """
    names = Names.of(said)
    found = [f"{data} has them. {_place(making.gone(said))}:"]
    more = making.beside(said, atoms).within(restart)
    found += (f"    {line}" for line in reads(kind, data, names, more))
    found += more.sentences
    made = moves(kind, said, atoms, body, names)
    found.append(f"{schemes.place(made.gone)}:")
    found += (f"    {line}" for line in made.lines)
    found += made.sentences
    if _torn(said, atoms, body):
        found.append(
            "Bonds between bodies and other atoms have bond_style zero, so nothing holds these "
            "together: give such bonds a style with forces, or have whole molecules as bodies."
        )
    return found


def _place(gone: list[str]) -> str:
    """Where lines for the data file stand, if these commands go."""
    if len(gone) == 1 and texts(gone[0])[0] == "read_data":
        return "In the script, in the place of its read_data"
    some = "".join(f"\n    {line}" for line in gone)
    return (
        f"It has the work of these commands of the script, which all go:{some}\n"
        "In the place of the first of them"
    )


def reads(kind: str, data: str, names: Names, beside: Beside = NOTHING) -> list[str]:
    """What stands in the place of a script's read_data."""
    read = f"read_data {data} {beside.words}".rstrip()
    if kind == "molecule":
        return [*beside.before, read, f"group {names.bodies} molecule > 0", *beside.behind]
    return [
        *beside.before,
        "fix body all property/atom i_body",
        f"{read} fix body NULL body",
        "variable is_in atom i_body>0",
        f"group {names.bodies} variable is_in",
        *beside.behind,
    ]


def moves(
    kind: str,
    said: Mapping,
    atoms: Mapping[str, np.ndarray],
    body: np.ndarray,
    names: Names,
) -> Moves:
    """Fixes that move the bodies as the script's fixes have moved their atoms, and what else these
    have moved and held.  The script's fixes that do not act on the bodies' atoms stay."""
    inside = body > 0
    known = {one: line for one, line in said["fixes"].items() if finding.kind_of(line)}
    acting = {one: finding.acted_on(said, atoms, line) for one, line in known.items()}
    held = [one for one, line in known.items() if finding.kind_of(line) == "constraints"]
    bound = np.zeros(len(body), bool)
    for one in held:
        acting[one] = finding.held_atoms(atoms, acting[one])
        bound |= acting[one]
    gone = {one: line for one, line in known.items() if (acting[one] & inside).any()}
    movers = [one for one in gone if one not in held]
    states = {one: finding.kept_by(gone[one]) for one in movers}
    kept = [one for one in movers if states[one].temp or states[one].press]
    own = (kept or movers or ["1"])[-1]
    line, state = gone.get(own, ""), states.get(own, State())
    of = finding.kind_of(line) if line else None
    sentences = [
        f"Fix {one} kept another temperature or pressure than fix {own}, whose bodies have now."
        for one in movers
        if states[one] != state
    ]
    points = acting[own] & ~inside if line else ~inside & (not set(known) - set(held))
    made, more = [], []
    if points.any():
        made.append(f"group {names.points} subtract {_group_of(line)} {names.bodies}")
    for one in (one for one in movers if one != own and (acting[one] & ~inside).any()):
        made += _again(said, one, gone[one], names)
    held_again = [_again(said, one, gone[one], names) for one in held
                  if one in gone and _holds(said, atoms, gone[one], ~inside)]  # fmt: skip
    sentences += [text for one in held if one in gone
                  for text in _cut(said, atoms, one, gone[one], inside)]  # fmt: skip
    if of == "rigid" and points.any():
        sentences.append(
            f"Fix {own} holds other atoms rigid, too, group {names.points}: they need a fix of "
            "their own."
        )
    elif points.any() and not (points & bound).any() and (state.press or of == "ours"):
        more = ["points", names.points]  # one thermostat and one barostat for all atoms
    elif points.any():
        made.append(_of_points(line, own, names.points, state))
    if state.press and (~inside & ~(points if more else inside)).any():
        taken = f"{names.bodies} {names.points}" if more else names.bodies
        made.append(f"group {names.others} subtract all {taken}")
        more += ["dilate", names.others]
    told, dropped = _words(line, state)
    if dropped:
        sentences.append(f"Fix {own} has keywords that ours does not have: {', '.join(dropped)}.")
    ours = finding.words_of(line)
    name = ours.name if ours else state.ensemble.upper()
    style = ("molecule",) if kind == "molecule" else ("custom", "i_body")
    moving = Words(name, names.bodies, style, (*told, *more)).fix(own)
    # rattle stands behind what sets velocities, shake in front of what changes the box
    last = [one for one in held_again if finding.style_of(one[-1]) == "rattle"]
    first = [one for one in held_again if one not in last]
    made = [*made, *itertools.chain(*first), moving, *itertools.chain(*last)]
    return Moves(gone, made, [*sentences, *schemes.naming(gone, said["commands"], made)])


def _group_of(line: str) -> str:
    """The group of the atoms that a fix moves, and as points if it is one of ours."""
    if not line:
        return "all"
    keywords = finding.keywords_of(line)
    return next((one[1] for one in keywords if one[0] == "points"), texts(line)[2])


def _again(said: Mapping, one: str, line: str, names: Names) -> list[str]:
    """A fix of the script's, with its ID and words, for those of its atoms that are in no body."""
    group = _free(f"{names.points}_{one}", said["groups"])
    made = f"group {group} subtract {texts(line)[2]} {names.bodies}"
    return [made, _with_group(line, one, group)]


def _holds(said: Mapping, atoms: Mapping[str, np.ndarray], line: str, free: np.ndarray) -> bool:
    """Whether a fix shake holds bonds between atoms that are in no body."""
    mask = finding.in_group(said, atoms, texts(line)[2]) & free
    return bool(finding.held_atoms(atoms, mask).any())


def _with_group(line: str, one: str, group: str) -> str:
    """A fix with another ID and group."""
    return line_of(("fix", one, group, *texts(line)[3:]))


def _of_points(line: str, own: str, group: str, state: State) -> str:
    """What moves points that the bodies' fix does not."""
    if line and not state.press and finding.kind_of(line) == "plain":
        return _with_group(line, f"{own}_points", group)  # in its own words
    heat = schemes.state_words(State(state.temp))
    return f"fix {own}_points {group} {'nvt' if state.temp else 'nve'}{heat}"


def _cut(said, atoms, one, line, inside) -> Iterator[str]:
    """What is to be said of bonds that shake holds between bodies and other atoms."""
    mask = finding.in_group(said, atoms, texts(line)[2])
    held = finding.held_bonds(atoms, mask)
    ends = inside[np.asarray(atoms["bonds"])[held, 1:] - 1]
    number = int((ends[:, 0] != ends[:, 1]).sum())
    if number:
        yield (
            f"Fix {one} holds {number:,} bonds between bodies and other atoms, which no fix can "
            "hold beside them: give such bonds a style with forces."
        )


def _words(line: str, state: State) -> tuple[list[str], list[str]]:
    """The words of ours that do what a fix does, and keywords of it that have no such words."""
    if not line:
        return [], []
    keywords = finding.keywords_of(line)
    if finding.kind_of(line) == "ours":
        parts = [one for one in keywords if one[0] not in ("points", "output", "dilate")]
        return [*itertools.chain(*parts)], []
    found = schemes.state_words(state).split()
    noise = any(one[0] == "langevin" for one in keywords)
    chain = next((one[1] for one in keywords if one[0] in ("tchain", "tparam")), None)
    if state.temp and noise:
        found += ["seed", str(schemes.SEED)]
    elif state.temp:
        found += ["thermostat", "nh", *(["tchain", chain] if chain else [])]
    if state.temp and state.press:
        found += ["barostat", "mtk"]
    _, _, dropped = finding.state_of([*itertools.chain(*keywords)])
    return found, [one for one in dropped if not one.startswith(("tchain", "tparam"))]


def _torn(said: Mapping, atoms: Mapping[str, np.ndarray], body: np.ndarray) -> bool:
    """Whether bonds that are not within a body have no forces."""
    styles = [words[1] for words in map(texts, said["commands"]) if words[0] == "bond_style"]
    one, other = body[np.asarray(atoms["bonds"])[:, 1:].T - 1]
    return styles[-1:] == ["zero"] and bool(((one != other) | (one == 0)).any())
