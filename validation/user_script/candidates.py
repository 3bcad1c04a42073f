"""Integrators in the place of a script's own: all that keep the same temperature and pressure."""

import itertools
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

import fix_nosquish
from fix_nosquish.host.command import Command, Line

from ..scenes.integrators import OLDER, OURS, Integrator
from . import rigid_atoms
from .commands import OUTPUT, commands_between, join_words, split_words
from .rigid_atoms import RigidAtoms, State, short_name, style_of

SEED = 4928
TOLERANCE = "1e-4"
REST = "own_rest"  # group of the atoms that the script's fixes move, and that are in no body
ALL = "own_all"  # these and the bodies
YOURS = "yours"
NO_LINE = Line("", "", ())


def integrators(found: RigidAtoms, units: str) -> tuple[list[Integrator], str, list[str]]:
    """All integrators for the script's bodies, in LAMMPS units of this name.

    Returns:
        them, the script's own first unless nothing was rigid there; the name of the one that the
        others are compared with; and what is to be said of those that are left out.
    """
    made = [*_ours(found, units), *_rigid(found), *_constrained(found)]
    notes = []
    if found.modified:
        told = "; ".join(found.modified)
        notes.append(f"For the script's own integrator only: {told}.")
    if not found.constraints:
        notes.append(f"No shake: {found.why or 'it does not hold these bodies'}.")
    for family, lacks in (
        ("rigid", _lacks(found, "rigid")),
        ("rigid/small", _lacks(found, "small")),
    ):
        notes += [f"No {family}: it has no keyword {' and no '.join(lacks)}."] * bool(lacks)
    if found.state.tilts:
        notes.append("No rigid: LAMMPS's rigid fixes do not change the angles of a box.")
    if found.kind == "plain":  # the script's own moves other bodies: it has none
        return made, OURS, notes
    own = script_integrator(found)
    same = next((other for other in made if _done(other, found) == _done(own, found)), None)
    if same is None:
        return [own, *made], YOURS, notes
    return [same, *(integrator for integrator in made if integrator is not same)], same.name, notes


def _done(integrator, found):
    """What an integrator's commands make LAMMPS do, whatever their words are."""
    lines = [line.format(group=found.group, bodies=found.bodies) for line in integrator.lines]
    done = [_meant(line) for line in (*lines, *integrator.then)]
    # rattle corrects velocities that others have set, and a box that changes comes behind shake;
    # others act one by one at other times of a step
    in_turn = found.state.press or any(style_of(line) == "rattle" for line in _fixes(lines))
    return done if in_turn else sorted(done, key=str)


def _fixes(lines):
    return [line for line in lines if split_words(line)[0] == "fix"]


def _meant(line):
    """A command that means the same as others that are equal to it: a fix without its ID; of ours
    all that the class reads, but for the seed, and not the group of a fix python/move.
    """
    if not _fixes([line]):
        return split_words(line)
    _, _, group, _, *words = split_words(line)
    ours = rigid_atoms.parse_fix(line)
    if not ours or ours.name in OLDER:
        return [style_of(line), group, *map(_value, words)]
    known = fix_nosquish.of_style(ours.name.lower())
    said = Line(ours.name, line, (ours.group, *ours.bodies, *ours.keywords))
    return known, replace(Command.parse(said, known.keywords), line=NO_LINE, seed=None)


def _value(word):
    try:
        return float(word)
    except ValueError:
        return word


def _literal(line: str) -> str:
    return line.replace("{", "{{").replace("}", "}}")


def script_integrator(found: RigidAtoms) -> Integrator:
    """The fixes that move the script's bodies, as they are."""
    styles = " + ".join(dict.fromkeys(map(short_name, found.lines)))
    label = f"yours: {styles}"
    whole = found.kind == "rigid" and "small" in found.style
    lines = tuple(map(_literal, found.lines))
    return Integrator(YOURS, label, lines, whole, found.kind, then=found.modified)


def state_words(state) -> str:
    """Temperature and pressure as a fix has them."""
    told = ["temp", *state.temp] if state.temp else []
    for axis in state.press:
        told += axis
    told += ["couple", state.couple] if state.couple else []
    return "".join(" " + word for word in told)


def _rest(found: RigidAtoms) -> tuple[list[str], list[str]]:
    """Commands that make the group of the atoms that are in no body, and those that move them."""
    if not found.rest:
        return [], []
    state, group, made = found.state, found.flexible, []
    if not group:
        group, made = REST, [f"group {REST} subtract {split_words(found.mover)[2]} {{group}}"]
    if state.press or found.flexible:
        style = "nvt" if state.temp else "nve"
        heat = state_words(State(state.temp))
        moves = [f"fix {REST} {group} {style}{heat}"]
    else:  # its own words
        moves = [_again(found.mover, REST)]
    if found.holder:
        moves.append(_again(found.holder, "own_held"))
    return made, moves


def _again(line: str, name: str) -> str:
    """A fix with another ID, for the atoms that are in no body."""
    return _literal(join_words(("fix", name, REST, *split_words(line)[3:])))


def _id(found):
    return split_words(found.mover)[1] if found.mover else found.ids[0]


def _ours(found: RigidAtoms, units: str) -> Iterator[Integrator]:
    state, (made, moves), others = found.state, _rest(found), ""
    rest = [*made, *moves]
    if found.rest and (state.press or found.flexible):
        rest, others = made, f" flexible {found.flexible or REST}"
        if found.holder:  # atoms that shake holds have their own fix: the box scales them
            rest, others = [*made, *moves], f" dilate {REST}"
    kept = "".join(f" {word}" for word in found.keywords)
    if found.kind == "rigid" and state.press and (found.body == 0).any() and "dilate" not in kept:
        others = " dilate all"  # the default there, and not with ours
    style = f"nosquish/{state.ensemble}"
    for number, (kind, more) in enumerate(_kinds(state, units)):
        said = state_words(state) + more + kept + others
        lines = (*rest, f"fix {_id(found)} {{group}} {style} {{bodies}}{said}")
        title = f"{OURS}-{kind.split()[0]}" if number else OURS
        yield Integrator(title, f"{style} {kind}".strip(), lines)


def _kinds(state: State, units: str) -> list[tuple[str, str]]:
    """Our thermostats with a barostat that fits, as labels and keywords; the usual one first."""
    if not state.temp:
        return [("", "")]
    made = []
    for thermostat in ("langevin", "csvr", "nh"):
        # in reduced units nobody knows a compressibility
        reduced = units in ("lj", "micro", "nano")
        barostat = "mtk" if thermostat == "nh" or reduced else "crescale"
        seed = f" seed {SEED}" * (thermostat != "nh")
        said = f" thermostat {thermostat}{seed}" + f" barostat {barostat}" * bool(state.press)
        made.append((f"{thermostat} {barostat}" if state.press else thermostat, said))
    return made


def _rigid(found: RigidAtoms) -> Iterator[Integrator]:
    state, rest = found.state, [*itertools.chain(*_rest(found))]
    if state.tilts or (state.press and found.rest and found.holder):
        return
    small = found.bodies.split()[0] in ("molecule", "custom")
    more = state_words(state)
    for style in (f"rigid/{state.ensemble}", f"rigid/{state.ensemble}/small"):
        yield from _of_style(found, style, style, style, more, rest, small)
    if state.ensemble == "nve":
        for style in ("rigid", "rigid/small"):
            yield from _of_style(found, style, style, style, "", rest, small)
    if state.ensemble == "nvt":
        # a fix of its own: the keyword langevin of rigid/small adds memory that nobody has set to
        # the forces of a run's first step, and tells no energy
        noise = f"langevin {' '.join(state.temp or ())} {SEED} tally yes"
        name, label = "rigid/small+langevin", "rigid/small + langevin"
        bath = [f"fix own_bath {{group}} {noise}"]
        yield from _of_style(found, name, label, "rigid/small", "", [*rest, *bath], small)


def _lacks(found: RigidAtoms, family: str) -> list[str]:
    """Which of the script's keywords a family of LAMMPS's fixes, rigid or small, does not have."""
    names = dict.fromkeys(words.split()[0] for words in found.keywords)
    return [
        name
        for name in names
        if name != "reinit" and family not in rigid_atoms.SHARED_KEYWORDS[name]
    ]


def _of_style(found, name, label, style, more, rest, small) -> Iterator[Integrator]:
    is_small = style.endswith("small")
    family = "small" if is_small else "rigid"
    if (is_small and not small) or _lacks(found, family):
        return
    kept = (f" {words}" for words in found.keywords if not words.startswith("reinit"))
    line = f"fix {_id(found)} {{group}} {style} {{bodies}}{more}{''.join(kept)}"
    yield Integrator(name, label, (*rest, line), is_small, "rigid")


def _constrained(found: RigidAtoms) -> Iterator[Integrator]:
    """Points that shake or rattle holds."""
    if not found.constraints:
        return
    state = found.state
    group, made = split_words(found.mover)[2] if found.mover else found.group, []
    if found.flexible:
        group, made = ALL, [f"group {ALL} union {{group}} {found.flexible}"]
    of = split_words(found.holder)[2] if found.holder else found.group
    move = f"fix {_id(found)} {_literal(group)} {state.ensemble}" + state_words(state)
    held = f"fix own_held {of} {{style}} {TOLERANCE} 100 0 {found.constraints}"
    for style in ("shake", "rattle"):
        if style == "rattle" and state.press:
            continue  # LAMMPS wants it last, and a changing box first
        hold = held.format(style=style)
        # rattle corrects the velocities that the other has set; a box that changes wants shake
        # before it
        lines = (*made, hold, move) if state.press else (*made, move, hold)
        label = f"{style} {TOLERANCE} + {state.ensemble}"
        tolerance = float(TOLERANCE)
        yield Integrator(style, label, lines, kind="constraints", tolerance=tolerance)


def commands_naming(ids: Collection[str], commands: Sequence[str]) -> list[str]:
    """Commands that name a fix with one of these IDs, as f_ID or as a rigid fix, or a compute that
    it makes."""
    made, own = [], rigid_atoms.compute_ids(ids)
    for line in (line for line in commands if split_words(line)[0] not in OUTPUT):
        word, *rest = split_words(line)
        named = any(re.search(rf"(?<!\w)f_{re.escape(fix_id)}\b", line) for fix_id in ids)
        named |= any(re.search(rf"(?<!\w)c_{re.escape(fix_id)}\b", line) for fix_id in own)
        named |= word in ("fix_modify", "compute_modify") and not own.isdisjoint(rest)
        if word == "compute" and len(rest) > 3 and rest[3] in ids:
            named |= rest[2].startswith(("ke/rigid", "erotate/rigid", "rigid/local"))
        if word == "fix" and "rigid" in rest[3:]:
            named |= not {*ids}.isdisjoint(rest)
        made += [line] * named
    return made


def replacement_notice(gone: Mapping[str, str]) -> str:
    """What lines replace, and where they stand: of fixes, by ID."""
    fixes = [f"fix {fix_id} ({style_of(line)})" for fix_id, line in gone.items()]
    if len(fixes) < 2:
        return f"These lines replace {(fixes or ['what moves its atoms'])[0]}"
    return f"These lines, at the place of the last one, replace {' and '.join(fixes)}"


def removal_notice(
    gone: Mapping[str, str], commands: Sequence[str], lines: Sequence[str]
) -> list[str]:
    """What is to be said of commands that name fixes which go, or what these make, if these lines
    come in their place."""
    kept = {split_words(line)[1]: style_of(line) for line in _fixes(lines)}
    lost = {fix_id for fix_id, line in gone.items() if kept.get(fix_id) != style_of(line)}
    made = [
        line
        for line in commands
        if split_words(line)[0] == "fix_modify" and split_words(line)[1] in lost
    ]
    made += commands_naming(lost, commands)
    some = "; ".join(made)
    told = f"These name a fix that goes, or what it makes, and have to go, too: {some}."
    return [told] * bool(made)


def _ensemble(found, said, atoms):
    """What integrators keep, and which other fix keeps the temperature beside them."""
    name, baths = found.state.ensemble.upper(), rigid_atoms.other_thermostats(said, atoms, found)
    if found.state.temp:
        name += f" ({state_words(found.state).strip()})"
    if found.state.temp or not baths:
        return f"Ensemble: {name}. Everything else in the script stays."
    keeps = "pressure and enthalpy" if found.state.press else "energy"
    told = " and ".join(f"fix {fix_id} ({style})" for fix_id, style in baths.items())
    return (
        f"Integrators are compared at constant {keeps} ({name}). The temperature is kept by "
        f"{told}, which stays, as all else of the script does."
    )


def describe(found: RigidAtoms, said: Mapping, atoms: Mapping[str, np.ndarray]) -> list[str]:
    """What was found, in sentences."""
    bodies, inside = int(found.body.max()), found.body > 0
    told = " and ".join(
        f"fix {fix_id} ({short_name(line)})" for fix_id, line in zip(found.ids, found.lines)
    )
    moves = "moves" if len(found.ids) == 1 else "move"
    lines = [
        f"At '{said['run']}' {told} {moves} {bodies:,} bodies of {inside.sum():,} "
        f"atoms: group {found.group}, body style {found.bodies}; {len(found.body):,} atoms in all.",
        _ensemble(found, said, atoms),
    ]
    if found.state.ramps:
        told = " and ".join(found.state.ramps)
        lines.append(f"A run changes {told}: here each does, however short it is.")
    if found.bodies == "molecule" and (stray := (atoms["molecule"][inside] == 0).sum()) > 1:
        lines.append(
            f"The {stray:,} atoms with molecule-ID 0 are one rigid body, as in LAMMPS: give every "
            "body a molecule-ID of its own, or leave these atoms out of the group."
        )
    if found.flexible:
        lines.append(
            f"Atoms of group {found.flexible}, in no body, move, too: with ours by keyword "
            "flexible, with others by a fix of their own."
        )
    elif found.rest:
        lines.append("The other atoms that these fixes move keep their integrator.")
    if between := commands_between(said["run"]):
        some = "; ".join(between)
        lines.append(
            f"What is done between the parts of that run is left out: {some}. Where it changes "
            "atoms, the script's own run is another one."
        )
    if replaced := commands_naming(found.ids, said["commands"]):
        lines.append(
            "These read numbers of a fix that is replaced, which others may not have: where such "
            f"a row fails, leave them out of the script: {'; '.join(replaced[:6])}."
        )
    if found.dropped:
        lines.append(f"Keywords for the script's own integrator only: {', '.join(found.dropped)}.")
    if said["skipped"]:
        lines.append(f"{said['skipped']} runs or minimizations before it were done as they are.")
    if said["later"]:
        some = ", ".join(map(repr, said["later"][:3])) + " ..." * (len(said["later"]) > 3)
        lines.append(
            f"Behind it the script has {some}: --run {said['at'] + 1} takes the next run in which "
            "a fix keeps atoms rigid."
        )
    if said["step"]:
        lines.append(f"Steps count from 0 here, and from {said['step']:,} in the script.")
    if said["left_out"]:
        some = "; ".join(said["left_out"][:6]) + " ..." * (len(said["left_out"]) > 6)
        lines.append(f"Left out: {some}.")
    return lines
