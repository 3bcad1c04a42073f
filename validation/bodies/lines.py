"""What a script says in the place of its own lines, so that rigid parts move as bodies."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from validation.bodies import making
from validation.bodies.making import NOTHING, Beside
from validation.own import finding, schemes
from validation.own.script import texts


def told(
    kind: str,
    said: Mapping,
    atoms: Mapping[str, np.ndarray],
    body: np.ndarray,
    data: Path,
    restart: Beside = NOTHING,
) -> list[str]:
    """Lines for a script, and which of its own they replace.

    Args:
        kind: property or molecule.
        said, atoms: of ``own.reader``.
        body: (atoms,) number of each atom's body, from 1, 0 for none.
        data: the data file that has them.
        restart: of `making.of_restart`.
    """
    points = bool((body == 0).any())
    gone = {one: line for one, line in said["fixes"].items() if finding.kind_of(line)}
    held = [one for one, line in gone.items() if finding.kind_of(line) == "constraints"]
    fixes = " and ".join(f"fix {one} ({finding.style_of(line)})" for one, line in gone.items())
    found = [f"{data} has them. {_place(making.gone(said))}:"]
    more = making.beside(said, atoms).within(restart)
    found += (f"    {line}" for line in reads(kind, str(data), points, more))
    found += more.sentences
    states = [finding.kept_by(line) for line in gone.values()]
    state = next((one for one in states if one.temp or one.press), finding.State())
    own = next((one for one in reversed(gone) if one not in held), "1")
    found.append(f"In the place of {fixes or 'what moves its atoms'}:")
    found += (f"    {line}" for line in moves(kind, own, state, points))
    if held and points:
        found.append(f"What fix {held[0]} holds of group points stays with such a fix.")
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


def reads(kind: str, data: str, points: bool, beside: Beside = NOTHING) -> list[str]:
    """What stands in the place of a script's read_data; ``points``: whether some atoms are in no
    body."""
    more = [*beside.behind, *["group points subtract all bodies"] * points]
    read = f"read_data {data} {beside.words}".rstrip()
    if kind == "molecule":
        return [*beside.before, read, "group bodies molecule > 0", *more]
    return [
        *beside.before,
        "fix body all property/atom i_body",
        f"{read} fix body NULL body",
        "variable is_in atom i_body>0",
        "group bodies variable is_in",
        *more,
    ]


def moves(kind: str, own: str, state: finding.State, points: bool) -> list[str]:
    """Fixes that keep a temperature and a pressure, the bodies' with the ID ``own``."""
    bodies = "molecule" if kind == "molecule" else "custom i_body"
    words = schemes.state_words(state) + f" seed {schemes.SEED}" * bool(state.temp)
    words += " points points" * bool(points and state.press)  # one barostat for all atoms
    name = f"fix_nosquish.{state.ensemble.upper()}"
    made = [f'fix {own} bodies python/move "{name} bodies {bodies}{words}"']
    if points and not state.press:
        heat = schemes.state_words(state, plain=True)
        made.append(f"fix {own}_points points {state.ensemble}{heat}")
    return made


def _torn(said: Mapping, atoms: Mapping[str, np.ndarray], body: np.ndarray) -> bool:
    """Whether bonds that are not within a body have no forces."""
    styles = [words[1] for words in map(texts, said["commands"]) if words[0] == "bond_style"]
    one, other = body[np.asarray(atoms["bonds"])[:, 1:].T - 1]
    return styles[-1:] == ["zero"] and bool(((one != other) | (one == 0)).any())
