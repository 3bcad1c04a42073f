"""Integrators that can replace a script's own: all that sample the same ensemble."""

import itertools
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

import fix_nosquish
from fix_nosquish.host.command import Command, Line
from fix_nosquish.integrators import nose_hoover

from ..scenes.integrators import CONSTRAINING, OLDER, OURS, Integrator
from . import rigid_atoms
from .commands import (
    OUTPUT,
    RIGID_COMPUTES,
    SUFFIX,
    commands_between,
    join_words,
    rigid_reports,
    split_words,
)
from .rigid_atoms import RigidAtoms, State, short_name, style_of

SEED = 4928
TOLERANCE = "1e-4"
REST = "own_rest"  # group of the atoms in no body that the replaced fixes move
ALL = "own_all"  # these and the bodies
YOURS = "yours"
NO_LINE = Line("", "", ())


def integrators(rigid: RigidAtoms, units: str) -> tuple[list[Integrator], str, list[str]]:
    """All integrators for the script's bodies.

    Args:
        units: the script's, by LAMMPS's name.

    Returns:
        the integrators, the script's own first unless it has no rigid bodies; the name of the
        reference; and notes on those that are left out.
    """
    others = [*_ours(rigid, units), *_rigid(rigid), *_constrained(rigid)]
    notes = []
    if rigid.modified:
        notes.append(f"For the script's own integrator only: {'; '.join(rigid.modified)}.")
    if not rigid.constraints:
        notes.append(f"No shake: {rigid.why or 'it cannot constrain these bodies'}.")
    for style, family in ("rigid", "rigid"), ("rigid/small", "small"):
        if missing := _missing_keywords(rigid, family):
            notes.append(f"No {style}: it has no keyword {' and no '.join(missing)}.")
    if rigid.state.tilts:
        notes.append("No rigid: LAMMPS's rigid fixes do not change the angles of a box.")
    if rigid.kind == "plain":  # the script's own integrator moves points
        return others, OURS, notes
    original = script_integrator(rigid)
    same = next(
        (other for other in others if _effect(other, rigid) == _effect(original, rigid)), None
    )
    if same is None:
        return [original, *others], YOURS, notes
    return [same, *(other for other in others if other is not same)], same.name, notes


def _effect(integrator: Integrator, rigid: RigidAtoms) -> list:
    """The meaning of an integrator's commands, however they are written."""
    lines = [line.format(group=rigid.group, bodies=rigid.bodies) for line in integrator.lines]
    meanings = [_meaning(line) for line in (*lines, *integrator.then)]
    # rattle corrects velocities that another fix has set, and a changing box comes after shake:
    # there the order matters
    ordered = rigid.state.press or any(style_of(line) == "rattle" for line in _fixes(lines))
    return meanings if ordered else sorted(meanings, key=str)


def _fixes(lines: Iterable[str]) -> list[str]:
    return [line for line in lines if split_words(line)[0] == "fix"]


def _meaning(line: str):
    """What commands with the same effect have in common: of a fix all but its ID; of ours what the
    class reads, without the seed, and without the group of a fix python/move."""
    if not _fixes([line]):
        return split_words(line)
    _, _, group, _, *words = split_words(line)
    ours = rigid_atoms.parse_fix(line)
    if not ours or ours.name in OLDER:
        return [style_of(line), group, *map(_as_number, words)]
    integrator = fix_nosquish.of_style(ours.name.lower())
    parsed = Line(ours.name, line, (ours.group, *ours.bodies, *ours.keywords))
    command = replace(Command.parse(parsed, integrator.keywords), line=NO_LINE, seed=None)
    thermostats, barostats = (
        getattr(integrator, kind, ()) for kind in ("thermostats", "barostats")
    )
    return integrator, replace(  # with the defaults that are not written
        command,
        thermostat=command.thermostat or next(iter(thermostats), None),
        barostat=command.barostat or next(iter(barostats), None),
        tchain=command.tchain or nose_hoover.LENGTH,
    )


def _as_number(word: str) -> float | str:
    try:
        return float(word)
    except ValueError:
        return word


def _literal(line: str) -> str:
    return line.replace("{", "{{").replace("}", "}}")


def script_integrator(rigid: RigidAtoms) -> Integrator:
    """The fixes that move the script's bodies, unchanged."""
    styles = " + ".join(dict.fromkeys(map(short_name, rigid.lines)))
    return Integrator(
        YOURS,
        f"yours: {styles}",
        tuple(map(_literal, rigid.lines)),
        rigid.kind == "rigid" and "small" in rigid.style,
        rigid.kind,
        then=rigid.modified,
    )


def state_words(state: State) -> str:
    """Temperature and pressure as words of a fix."""
    words = ["temp", *state.temp] if state.temp else []
    words += itertools.chain(*state.press)
    words += ["couple", state.couple] if state.couple else []
    return "".join(" " + word for word in words)


def _rest(rigid: RigidAtoms) -> tuple[list[str], list[str]]:
    """The commands that define the group of the atoms in no body, and those that move them."""
    if not rigid.rest:
        return [], []
    state, group, groups = rigid.state, rigid.flexible, []
    if not group:
        group = REST
        groups = [f"group {REST} subtract {split_words(rigid.mover)[2]} {{group}}"]
    if state.press or rigid.flexible:
        style = "nvt" if state.temp else "nve"
        fixes = [f"fix {REST} {group} {style}{state_words(State(state.temp))}"]
    else:
        fixes = [_copy(rigid.mover, REST)]
    if rigid.holder:
        fixes.append(_copy(rigid.holder, "own_held"))
    return groups, fixes


def _copy(line: str, fix_id: str) -> str:
    """The same fix with another ID, for the atoms in no body."""
    return _literal(join_words(("fix", fix_id, REST, *split_words(line)[3:])))


def _id(rigid: RigidAtoms) -> str:
    return split_words(rigid.mover)[1] if rigid.mover else rigid.ids[0]


def _ours(rigid: RigidAtoms, units: str) -> Iterator[Integrator]:
    """Yield ours: with each thermostat, and a barostat that fits."""
    state, (groups, fixes), others = rigid.state, _rest(rigid), ""
    before = [*groups, *fixes]
    if rigid.rest and (state.press or rigid.flexible):
        before, others = groups, f" flexible {rigid.flexible or REST}"
        if rigid.holder:  # constrained atoms have a separate fix, and are scaled with the box
            before, others = [*groups, *fixes], f" dilate {REST}"
    keywords = "".join(f" {words}" for words in rigid.keywords)
    scales_all = rigid.kind == "rigid" and not rigid.flexible
    if scales_all and state.press and (rigid.body == 0).any() and "dilate" not in keywords:
        others = " dilate all"  # the default of LAMMPS's rigid fixes, not of ours
    style = f"nosquish/{state.ensemble}"
    for number, (label, more) in enumerate(_thermostats(state, units)):
        words = state_words(state) + more + keywords + others
        lines = (*before, f"fix {_id(rigid)} {{group}} {style} {{bodies}}{words}")
        yield Integrator(
            f"{OURS}-{label.split()[0]}" if number else OURS, f"{style} {label}".strip(), lines
        )


def _thermostats(state: State, units: str) -> list[tuple[str, str]]:
    """Our thermostats with a barostat that fits, as labels and keywords; the default first."""
    if not state.temp:
        return [("", "")]
    reduced = units in ("lj", "micro", "nano")  # crescale needs a compressibility
    choices = []
    for thermostat in ("langevin", "csvr", "nh"):
        barostat = "mtk" if thermostat == "nh" or reduced else "crescale"
        words = f" thermostat {thermostat}" + f" seed {SEED}" * (thermostat != "nh")
        words += f" barostat {barostat}" * bool(state.press)
        choices.append((f"{thermostat} {barostat}" if state.press else thermostat, words))
    return choices


def _rigid(rigid: RigidAtoms) -> Iterator[Integrator]:
    """Yield LAMMPS's rigid fixes."""
    state, rest = rigid.state, [*itertools.chain(*_rest(rigid))]
    if state.tilts or (state.press and rigid.rest and rigid.holder):
        return
    words = state_words(state)
    for style in (f"rigid/{state.ensemble}", f"rigid/{state.ensemble}/small"):
        yield from _of_style(rigid, style, words, rest)
    if state.ensemble == "nve":
        for style in ("rigid", "rigid/small"):
            yield from _of_style(rigid, style, "", rest)
    if state.ensemble == "nvt":
        # a separate fix langevin: the keyword of rigid/small adds uninitialized memory to the
        # forces of a run's first step, and has no energy
        bath = f"fix own_bath {{group}} langevin {' '.join(state.temp or ())} {SEED} tally yes"
        for integrator in _of_style(rigid, "rigid/small", "", [*rest, bath]):
            yield replace(integrator, name="rigid/small+langevin", label="rigid/small + langevin")


def _missing_keywords(rigid: RigidAtoms, family: str) -> list[str]:
    """Which of the script's keywords a family of LAMMPS's fixes, rigid or small, does not have."""
    names = dict.fromkeys(words.split()[0] for words in rigid.keywords)
    shared = rigid_atoms.SHARED_KEYWORDS
    return [name for name in names if name != "reinit" and family not in shared[name]]


def _of_style(
    rigid: RigidAtoms, style: str, words: str, before: Sequence[str]
) -> Iterator[Integrator]:
    """Yield one of LAMMPS's rigid fixes, unless it lacks a keyword or the body style."""
    small = style.endswith("small")
    if small and rigid.bodies.split()[0] not in ("molecule", "custom"):
        return
    if _missing_keywords(rigid, "small" if small else "rigid"):
        return
    words += "".join(
        f" {keyword}" for keyword in rigid.keywords if not keyword.startswith("reinit")
    )
    line = f"fix {_id(rigid)} {{group}} {style} {{bodies}}{words}"
    yield Integrator(style, style, (*before, line), small, "rigid")


def _constrained(rigid: RigidAtoms) -> Iterator[Integrator]:
    """Yield integrators of points with constraints of LAMMPS's fixes."""
    if not rigid.constraints:
        return
    state = rigid.state
    group, groups = split_words(rigid.mover)[2] if rigid.mover else rigid.group, []
    if rigid.flexible:
        group, groups = ALL, [f"group {ALL} union {{group}} {rigid.flexible}"]
    held = split_words(rigid.holder)[2] if rigid.holder else rigid.group
    move = f"fix {_id(rigid)} {_literal(group)} {state.ensemble}" + state_words(state)
    for style in CONSTRAINING:
        if style == "rattle" and state.press:
            continue  # LAMMPS requires it last, and a changing box first
        hold = f"fix own_held {held} {style} {TOLERANCE} 100 0 {rigid.constraints}"
        # rattle corrects velocities that the other fix has set; a changing box requires shake first
        yield Integrator(
            style,
            f"{style} {TOLERANCE} + {state.ensemble}",
            (*groups, hold, move) if state.press else (*groups, move, hold),
            kind="constraints",
            tolerance=float(TOLERANCE),
        )


def commands_naming(ids: Collection[str], commands: Sequence[str]) -> list[str]:
    """Commands that refer to a fix with one of these IDs, or to a compute that it defines."""
    return [
        line
        for line in commands
        if split_words(line)[0] not in OUTPUT
        and _names_fix(line, ids, rigid_atoms.compute_ids(ids))
    ]


def _names_fix(line: str, ids: Collection[str], computes: Collection[str]) -> bool:
    word, *rest = split_words(line)
    references = {*(f"f_{name}" for name in ids), *(f"c_{name}" for name in computes)}
    if any(re.search(rf"(?<!\w){re.escape(reference)}\b", line) for reference in references):
        return True
    if word in ("fix_modify", "compute_modify"):
        return not {*computes}.isdisjoint(rest)
    if word == "compute":
        return len(rest) > 3 and rest[3] in ids and rest[2].startswith(RIGID_COMPUTES)
    return word == "fix" and "rigid" in rest[3:] and not {*ids}.isdisjoint(rest)


def replacement_notice(replaced: Mapping[str, str]) -> str:
    """Say what the lines replace, and where they belong; ``replaced``: fixes by ID."""
    fixes = [f"fix {fix_id} ({style_of(line)})" for fix_id, line in replaced.items()]
    if len(fixes) < 2:
        return f"These lines replace {(fixes or ['what moves its atoms'])[0]}"
    return f"These lines, at the place of the last one, replace {' and '.join(fixes)}"


def removal_notice(
    replaced: Mapping[str, str], commands: Sequence[str], lines: Sequence[str]
) -> list[str]:
    """Sentences on commands that must be changed or removed with the replaced fixes, because they
    name them or their computes; none if there are no such commands.

    Args:
        replaced: fixes by ID.  lines: those that replace them.
    """
    styles = {split_words(line)[1]: style_of(line) for line in _fixes(lines)}
    removed = {fix_id for fix_id, line in replaced.items() if styles.get(fix_id) != style_of(line)}
    naming = [
        line
        for line in commands
        if split_words(line)[0] == "fix_modify" and split_words(line)[1] in removed
    ]
    naming += commands_naming(removed, commands)
    notices, reports = [], rigid_reports(commands, removed)
    computes = [line for line in reports if line in naming]
    if computes and any(style.startswith("nosquish") for style in styles.values()):
        written = (
            join_words((*words[:3], words[3] + SUFFIX, *words[4:]))
            for words in map(split_words, computes)
        )
        notices.append(f"Write these computes with {SUFFIX}: {'; '.join(written)}.")
        naming = [line for line in naming if line not in computes]
    else:
        naming += [line for line in reports if line not in naming]
    if naming:
        notices.append(
            "Remove these commands, too, and what thermo_style has of them: they use a fix that is "
            f"replaced, or its computes: {'; '.join(naming)}."
        )
    return notices


def _ensemble(rigid: RigidAtoms, reading: Mapping, atoms: Mapping[str, np.ndarray]) -> str:
    """A sentence on the ensemble, and on another fix that controls the temperature."""
    name = rigid.state.ensemble.upper()
    baths = rigid_atoms.other_thermostats(reading, atoms, rigid)
    if rigid.state.temp:
        name += f" ({state_words(rigid.state).strip()})"
    if rigid.state.temp or not baths:
        return f"Ensemble: {name}. Everything else in the script stays."
    conserved = "pressure and enthalpy" if rigid.state.press else "energy"
    fixes = " and ".join(f"fix {fix_id} ({style})" for fix_id, style in baths.items())
    return (
        f"Integrators are compared at constant {conserved} ({name}). The temperature is controlled "
        f"by {fixes}, which stays, like everything else in the script."
    )


def describe(rigid: RigidAtoms, reading: Mapping, atoms: Mapping[str, np.ndarray]) -> Iterator[str]:
    """Yield sentences on what was found in a script."""
    inside, commands = rigid.body > 0, reading["commands"]
    fixes = " and ".join(
        f"fix {fix_id} ({short_name(line)})" for fix_id, line in zip(rigid.ids, rigid.lines)
    )
    yield (
        f"At '{reading['run']}' {fixes} {'moves' if len(rigid.ids) == 1 else 'move'} "
        f"{rigid.body.max():,} bodies of {inside.sum():,} atoms: group {rigid.group}, body style "
        f"{rigid.bodies}; {len(rigid.body):,} atoms in all."
    )
    yield _ensemble(rigid, reading, atoms)
    if rigid.state.ramps:
        yield f"The run changes {' and '.join(rigid.state.ramps)}: so does each run here."
    if rigid.bodies == "molecule" and (stray := (atoms["molecule"][inside] == 0).sum()) > 1:
        yield (
            f"The {stray:,} atoms with molecule-ID 0 are one rigid body, as in LAMMPS: give every "
            "body its own molecule-ID, or leave these atoms out of the group."
        )
    if rigid.flexible:
        yield (
            f"Atoms of group {rigid.flexible}, in no body, move, too: with ours by keyword "
            "flexible, with others by a separate fix."
        )
    elif rigid.rest:
        yield "The other atoms that these fixes move keep their integrator."
    if between := commands_between(reading["run"]):
        yield (
            f"Commands between the parts of that run are left out: {'; '.join(between)}. If they "
            "change atoms, the script's own run is another one."
        )
    reports = rigid_reports(commands, rigid.ids)
    if users := commands_naming(rigid.ids, [line for line in commands if line not in reports]):
        yield (
            "These commands name a fix that is replaced, and may fail without it: "
            f"{'; '.join(users[:6])}."
        )
    if rigid.dropped:
        yield f"Keywords for the script's own integrator only: {', '.join(rigid.dropped)}."
    yield from _describe_reading(reading)


def _describe_reading(reading: Mapping) -> Iterator[str]:
    """Yield sentences on how the run was reached, and on what follows it."""
    if reading["skipped"]:
        yield f"{reading['skipped']} runs or minimizations before it were executed as they are."
    if later := reading["later"]:
        following = ", ".join(map(repr, later[:3])) + " ..." * (len(later) > 3)
        yield (
            f"After it the script has {following}: --run {reading['at'] + 1} takes the next run in "
            "which a fix keeps atoms rigid."
        )
    if reading["step"]:
        yield f"Steps count from 0 here, and from {reading['step']:,} in the script."
    if left_out := reading["left_out"]:
        yield f"Left out: {'; '.join(left_out[:6])}{' ...' * (len(left_out) > 6)}."
