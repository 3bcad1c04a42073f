"""Writes rigid parts of a user's molecules: the files and the lines that a script needs to use
them.

The script keeps all commands that create its atoms.  One file has the body of each atom, another
has positions in which all bodies of a kind have the same shape; a few lines that replace the
script's fixes read both.  A script with a rigid fix keeps this fix and its bodies, and reads only
the positions.
"""

import os
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from itertools import count
from pathlib import Path

import numpy as np

from ..scenes.integrators import OURS
from ..user_script import candidates, loader, rigid_atoms, thermostat, time_step
from ..user_script.commands import split_words
from ..user_script.rigid_atoms import RigidAtoms
from . import parts

GROUP, BODY = "own_bodies", "own_body"
OTHERS = "own_others"  # atoms in no body, which the bodies' fix does not move
STYLE = f"custom v_{BODY}"
PLACES = "x y z ix iy iz"
LANGEVIN = (
    " With chains and a long step stiff groups leave the rest too cold: write 'seed N' instead of "
    "'{}', for Langevin's thermostat."
)
FAR = 0.5  # Å: parts of a kind whose atoms differ by more have no mean shape
ALIKE = (
    "read_dump gives all parts of a kind their mean shape: for this an atom moves by {:.3g} Å at "
    "most. Without that line each part keeps its own shape."
)
DIFFER = (
    f"Each part keeps its own shape: parts of a kind differ by more than {FAR:g} Å, in shape or in "
    "the order of their atoms."
)


def write_bodies(
    options: loader.ScriptOptions, out: Path, silence: float, wanted: Collection[str]
) -> tuple[dict[str, int], list[str]]:
    """Write the files; return the number of parts of each kind, and sentences and lines for the
    user.

    Args:
        out: folder of the files.
        silence: s without a sign of life after which the reading of the script is given up.
        wanted: of `parts.PARTS`.

    Raises:
        SystemExit: with a message: what is wrong, and what to do.
    """
    request = replace(options, group=GROUP, bodies=STYLE)  # at its first run, with any fixes
    reading, atoms, _ = loader.read(request, out, 1, silence)
    cell, periodic = np.array(reading["cell"]), reading["periodic"]
    movers = {"ours", "rigid"} & {*map(rigid_atoms.kind_of, reading["fixes"].values())}
    if movers and not (options.group or options.bodies):
        rigid = _found(reading, atoms, options)
        x, moved = parts.alike(atoms, rigid.body, cell, periodic)
        counts = {f"body of fix {' and '.join(rigid.ids)}": int(rigid.body.max())}
        if moved > FAR:
            return counts, [DIFFER]
        place = f"This line, directly before '{reading['run']}', gives bodies their mean shape:"
        return counts, [place, f"    {_read_shapes(x, atoms, options, out)}", ALIKE.format(moved)]
    if not len(atoms.get("bonds", ())):
        raise SystemExit(f"{options.name}: the atoms have no bonds, by which rigid parts are found")
    if reading["units"] not in ("real", "metal"):
        raise SystemExit(
            f"{options.name}: elements cannot be told by masses in units {reading['units']}"
        )
    body, counts = parts.rigid(atoms, cell, periodic, wanted)
    if not body.any():
        return counts, ["No rigid part, so no file is written."]
    inside, groups = body > 0, [*reading["groups"], GROUP]
    mask = atoms["mask"].astype(np.int64) | inside.astype(np.int64) << len(reading["groups"])
    known = atoms | {"mask": mask, f"v_{BODY}": body}
    rigid = _found(reading | {"groups": groups}, known, request)
    x, moved = parts.alike(atoms, body, cell, periodic)
    file, read = out / f"{options.name}.bodies", _read_shapes(x, atoms, options, out)
    file.write_text(_bodies(body))
    lines = [
        f"variable {BODY} atomfile {_named(file, Path(options.script).parent)}",
        f"variable own_inside atom v_{BODY}>0",
        f"group {GROUP} variable own_inside",
        *([read] if moved <= FAR else []),
        *_moving_lines(rigid, reading, known),
        *time_step.lists_in_time(reading["commands"]),
    ]
    replaced = dict(zip(rigid.ids, rigid.lines))
    longer = (
        "A longer timestep may be stable now: 'check' without --rigid estimates it, and the error "
        "of temperatures."
    )
    if chains := re.search("thermostat nh( barostat mtk)?", "\n".join(lines)):
        longer += LANGEVIN.format(chains[0])
    sentences = [
        f"{candidates.replacement_notice(replaced)}:",
        *(f"    {line}" for line in lines),
        longer,
        ALIKE.format(moved) if moved <= FAR else DIFFER,
        *candidates.removal_notice(replaced, reading["commands"], lines),
    ]
    if rigid.dropped:
        sentences.append(f"Keywords that ours does not have: {', '.join(rigid.dropped)}.")
    return counts, [*sentences, *_unconstrained_bonds(rigid, reading, atoms)]


def _found(reading: Mapping, atoms: parts.Atoms, options: loader.ScriptOptions) -> RigidAtoms:
    """The rigid atoms, or the end with a message."""
    try:
        return rigid_atoms.find(reading, atoms, options.fix, options.group, options.bodies)
    except rigid_atoms.AmbiguousScript as unclear:
        raise SystemExit(f"{options.name}: {unclear}") from None


def _read_shapes(
    x: np.ndarray, atoms: parts.Atoms, options: loader.ScriptOptions, out: Path
) -> str:
    """Write the file of positions; return the command that reads it."""
    file = out / f"{options.name}.shapes"
    file.write_text(_dump(x, atoms))
    shapes = _named(file, Path(options.script).parent)
    return f"read_dump {shapes} 0 {PLACES} box no replace yes timestep no format native"


def _named(file: Path, folder: Path) -> str:
    """The name of a file for a script in the folder: the whole path if LAMMPS accepts it."""
    text = str(file.resolve())
    if not text.isascii() or '"' in text:
        text = os.path.relpath(text, folder)
    return text if re.fullmatch(r"[\w./+-]+", text, re.A) else f'"{text}"'


def _bodies(body: np.ndarray) -> str:
    """The text of a file for a variable of style atomfile: the body of each atom in a body."""
    inside = np.flatnonzero(body)
    return f"{len(inside)}\n" + "".join(f"{atom + 1} {body[atom]}\n" for atom in inside)


def _dump(x: np.ndarray, atoms: parts.Atoms) -> str:
    """A dump of the positions of all atoms; LAMMPS does not read its box."""
    head = ("TIMESTEP\n0", f"NUMBER OF ATOMS\n{len(x)}", "BOX BOUNDS pp pp pp" + "\n0 1" * 3)
    rows = zip(count(1), x, atoms["image"])
    text = (f"{atom} {' '.join(f'{value:.17g}' for value in (*at, *image))}\n"
            for atom, at, image in rows)  # fmt: skip
    return "".join((*(f"ITEM: {item}\n" for item in (*head, f"ATOMS id {PLACES}")), *text))


def _moving_lines(rigid: RigidAtoms, reading: Mapping, atoms: parts.Atoms) -> list[str]:
    """The lines that move the bodies, and those for other atoms that the script's fixes moved."""
    ours = {
        integrator.name: integrator
        for integrator in candidates.integrators(rigid, reading["units"])[0]
        if integrator.kind == "ours"
    }
    same = f"{OURS}-nh" if thermostat.kind_of([rigid.mover]) == "nh" else OURS
    commands = [line.format(group=GROUP, bodies=STYLE) for line in ours[same].lines]
    moved = rigid_atoms.in_group(reading, atoms, split_words(rigid.mover)[2])
    if rigid.state.press and not (moved | (rigid.body > 0)).all():  # the box scales others, too
        groups = (
            f"{GROUP} {candidates.REST}" if f"flexible {candidates.REST}" in commands[-1] else GROUP
        )
        line = commands.pop().replace(f" dilate {candidates.REST}", "")
        commands += [f"group {OTHERS} subtract all {groups}", f"{line} dilate {OTHERS}"]
    return commands


def _unconstrained_bonds(rigid: RigidAtoms, reading: Mapping, atoms: parts.Atoms) -> Iterator[str]:
    """Yield notices on bonds between bodies and other atoms that are not constrained."""
    bonds = np.asarray(atoms["bonds"])
    first, second = rigid.body[bonds[:, 1:].T - 1]
    styles = [
        words[1] for words in map(split_words, reading["commands"]) if words[0] == "bond_style"
    ]
    loose = np.full(len(bonds), styles[-1:] == ["zero"])
    for line in rigid.lines:
        if rigid_atoms.kind_of(line) == "constraints":
            loose |= rigid_atoms.held_bonds(
                atoms, rigid_atoms.in_group(reading, atoms, split_words(line)[2])
            )
    if number := int((loose & (first != second)).sum()):
        yield (
            f"{number:,} bonds between bodies and other atoms have no force, or shake held them: "
            "nothing holds these together. Give such bonds a style with forces."
        )
