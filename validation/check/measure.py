"""Checks of a script: whether the bodies are as intended, and whether its step is safe.

From the state at the script's run, and from some steps with each integrator.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np

from .. import COMMAND
from ..experiment import Trajectory, perform
from ..running import machine, run
from ..running.store import Store
from ..scenes.integrators import Integrator
from ..statistics.check import Check
from ..user_script import candidates, conserved_energy, rigid_atoms, shapes, thermostat, time_step
from ..user_script.commands import SUFFIX, join_words, split_words
from ..user_script.loader import UserScript
from ..user_script.shapes import BodyGroup, BodyKind

STEPS = 20  # with each integrator
# of the temperature, besides four standard deviations; in equilibrium 0.014, from lattices 1.8
CHANGE = 0.1
# rad: a body that rotates further in a step is not resolved
TURN = 0.5
ALIKE = 1e-3  # relative to the largest moment; the rounding of a data file's digits is smaller
SOME = 200  # atoms of a body whose pairs are counted, at most
IDLE = (
    "these forces cost time and do nothing: neigh_modify exclude molecule/intra {} leaves them "
    "out, where each body has a molecule ID of its own; special_bonds lj/coul 0 0 0 does, where "
    "bonds tell them, but for all bonds. With a mesh, its part of what exclude leaves out stays: "
    "this adds a constant to the energy"
)
MANYBODY = (
    "the potential is a many-body one: forces on a body depend on all atoms nearby, also those of "
    "its own, so a molecule's pairs must not be left out, neither by neigh_modify exclude nor by "
    "special_bonds (use lj/coul 1 1 1)"
)
TITLES = {"bodies": "The bodies", "step": "The step", "script": "The rest of the script"}


def check(
    script: UserScript,
    out: Path,
    ranks: int,
    silence: float,
    meter: run.Meter,
    tolerance: float = time_step.TOLERANCE,
) -> dict:
    """All checks, as plain data: ``kinds``, ``checks``, ``integrators`` and circumstances.

    Args:
        tolerance: largest relative error of temperatures, as an average.
    """
    groups, gap = shapes.body_groups(script)
    kinds = shapes.body_kinds(script, groups)
    rows, interrupted = _starts(script, out, ranks, silence, meter)
    own = next((row for row in rows if row["name"] == script.reference), {})
    suffix = [] if all(row["error"] for row in rows) else [*_suffix(script, out, ranks, silence)]
    checks = (
        *_bodies(script, gap, kinds),
        *_step(script, groups, kinds, tolerance),
        *_script(script),
        _lists(own.get("late")),
        _forces_within(script, groups, out, ranks, silence),
    )
    return machine.circumstances() | {
        "title": script.scene.title,
        "notes": script.notes,
        "suffix": [*filter(None, [own.get("settles")]), *_barostat(script), *suffix],
        "units": script.scene.units,
        "dt": script.scene.dt,
        "temperature": shapes.temperature(script),
        "kinds": [asdict(kind) for kind in kinds],
        "checks": [_without_note(entry).plain() for entry in checks],
        "integrators": rows,
        "interrupted": interrupted,
    }


def _job(script: UserScript, integrator: Integrator, folder: Path, steps: int, **how) -> run.Job:
    how |= {"origin": machine.origin(script.scene, integrator), "keeps": "nothing"}
    return run.job(script.scene, integrator, folder, [steps], dt=script.scene.dt, every=1, **how)


def _starts(
    script: UserScript, out: Path, ranks: int, silence: float, meter: run.Meter
) -> tuple[list[dict], bool]:
    """A row for each integrator, on the start and some steps; and whether a Ctrl-C ended it."""
    integrators, runs = script.integrators.values(), out / "runs"
    how = {"ranks": ranks, "silence": silence}
    trajectories = [
        Trajectory(
            integrator.name,
            integrator.label,
            partial(
                _job, script, integrator, runs / run.folder_name(integrator.name), STEPS, **how
            ),
        )
        for integrator in integrators
    ]
    done = perform(trajectories, Store(out), meter)
    rows = [
        _row(script, integrator, run.collect(done.jobs[integrator.name].directory))
        for integrator in integrators
        if integrator.name in done.jobs
    ]
    return rows, done.interrupted


def _without_note(entry: Check) -> Check:
    """Remove the note on what is wrong if nothing is, except from the longest step."""
    return replace(entry, note="") if entry.holds and entry.part != "step" else entry


def _bodies(script: UserScript, gap: float, kinds: Sequence[BodyKind]) -> Iterator[Check]:
    """Check kinds, images and neighbours."""
    units = script.units
    for kind in kinds:
        yield Check(
            "bodies",
            kind.name,
            "largest difference of a moment from the kind's mean",
            kind.scatter,
            high=ALIKE,
            note="bodies of these atoms differ in shape: each keeps the one that it has. Molecules "
            f"get one shape by '{COMMAND} check SCRIPT --rigid'",
        )
    half = float(np.min(np.diag(np.array(script.reading["cell"]))) / 2)
    yield Check(
        "bodies",
        "the largest",
        "its size",
        max(kind.size for kind in kinds),
        high=half,
        unit=units.length,
        note="a body is nearly as wide as the box: its image flags decide where its atoms are",
        source="half of the box",
    )
    yield Check(
        "bodies",
        "image flags",
        "wider by them",
        gap,
        high=half,
        unit=units.length,
        note="by its image flags a body is wider than by nearest images: is it cut by a face?",
    )


def _step(
    script: UserScript, groups: Sequence[BodyGroup], kinds: Sequence[BodyKind], tolerance: float
) -> Iterator[Check]:
    turns, dt, unit = max(kinds, key=lambda kind: kind.angle), script.scene.dt, script.units.time
    safe = dt * TURN / max(turns.angle, 1e-300)
    yield Check(
        "step",
        turns.name,
        "rms angle that a body turns in a step at the temperature, about its fastest axis",
        turns.angle,
        high=TURN,
        unit="rad",
        note=f"by this number alone, {safe:.3g} {unit} and below is safe",
    )
    frequencies = shapes.fastest_motions(script, groups)
    for name, frequency in frequencies.items():
        yield Check(
            "step",
            name,
            "stability: frequency of the stiffest motion × step",
            frequency * dt,
            high=time_step.UNSTABLE[name],
            note=f"unstable above about {time_step.UNSTABLE[name] / frequency:.3g} {unit}, by the "
            "forces of the start, which are larger before equilibration",
        )
    if frequencies:
        coefficient = time_step.error_coefficient(script, groups)
        yield Check(
            "step",
            "averages",
            "accuracy: estimated error of the temperatures of translation and rotation",
            coefficient * dt**2,
            high=tolerance,
            unit="of T",
            note=f"{(tolerance / coefficient) ** 0.5:.3g} {unit} and below is within the tolerance "
            "(--tolerance), with your thermostat",
        )


def _script(script: UserScript) -> Iterator[Check]:
    """Check groups and other fixes."""
    movers = shapes.atoms_moved_by_fixes(script)
    count = np.sum([*movers.values()], axis=0)
    idle, twice = int(np.sum(count == 0)), int(np.sum(count > 1))
    yield Check(
        "script",
        "atoms",
        "that no fix moves",
        idle,
        high=0,
        note="these atoms stand still, unless a fix that is not known here moves them",
    )
    yield Check(
        "script",
        "atoms",
        "that two fixes move",
        twice,
        high=0,
        note=f"two of these fixes move the same atoms: {', '.join(movers)}",
    )
    heats = rigid_atoms.other_thermostats(script.reading, script.atoms, script.rigid)
    yield Check(
        "script",
        "thermostats",
        "of the bodies",
        len(heats) + bool(script.rigid.state.temp),
        high=1,
        note="more than one thermostat acts on the bodies: "
        f"{', '.join((*script.rigid.ids, *heats))}",
    )


def _lists(late: int | None) -> Check:
    """Check whether neighbour lists are built in time, with a step that may be longer than the one
    for which the script sets how often LAMMPS checks them.

    Args:
        late: builds that may have been too late, with the script's own integrator.
    """
    note = (
        "LAMMPS has not looked"
        if late is None
        else "atoms may have come within the cutoff before LAMMPS looked"
    )
    return Check(
        "script",
        "neighbour lists",
        f"built too late, perhaps, in {STEPS} steps",
        late,
        high=0,
        note=f"{note}. With long steps use '{time_step.LISTS}'",
    )


def _forces_within(
    script: UserScript, groups: Sequence[BodyGroup], out: Path, ranks: int, silence: float
) -> Check:
    """Count the pairs of atoms with forces in one body of each kind (in a large one, among its
    first `SOME` atoms).  LAMMPS lists them, because it knows exclusions and special bonds.  Forces
    of pairs do nothing within a body; a many-body potential needs the pairs.

    With a kspace style its list also contains special pairs of factor 0, from which the pair style
    subtracts the contribution of the mesh.  Without both it lists the same pairs without these.
    """
    atoms = np.concatenate([1 + group.atoms[0, :SOME] for group in groups])
    folder = (out / "runs" / "pairs").resolve()
    more = [
        f"group own_sample id {' '.join(map(str, atoms))}",
        "compute own_pairs own_sample property/local patom1 patom2",
        f'dump own_pairs own_sample local 1 "{folder}/pairs" c_own_pairs[1] c_own_pairs[2]',
    ]
    styles = {words[0]: words[1] for words in map(split_words, script.reading["commands"])
              if words[0] in ("kspace_style", "pair_style")}  # fmt: skip
    if styles.get("kspace_style", "none") != "none":
        size = 2 * max(np.linalg.norm(group.apart[0], axis=1).max() for group in groups)
        more += [
            "group own_others subtract all own_sample",
            "neigh_modify exclude group own_others all",  # otherwise a long list
            "kspace_style none",
            "dihedral_style none",  # that of CHARMM takes its 1-4 forces from the pair style
            f"pair_style zero {1.01 * size or 1.0:g}",
            "pair_coeff * *",
        ]
    result = run.once(
        _job(
            script,
            script.integrators[script.reference],
            folder,
            0,
            ranks=ranks,
            silence=silence,
            more=more,
        ),
        failures=True,
    )
    many = script.reading["manybody"]
    hybrid = styles.get("pair_style", "").startswith("hybrid")  # perhaps not within bodies
    counts = partial(
        Check,
        "script",
        "forces within bodies",
        "pairs of atoms that have them, in one body of each kind",
        low=1.0 if many and not hybrid else None,
        high=None if many else 0.0,
    )
    if result.error:
        return counts(None, note=f"not counted: {result.error}")
    rows = (folder / "pairs").read_text().partition("ITEM: ENTRIES")[2].splitlines()[1:]
    pairs = np.array([row.split() for row in rows], float).astype(int).reshape(-1, 2) - 1
    first, second = script.rigid.body[pairs.T]
    note = MANYBODY if many else IDLE.format(script.rigid.group)
    return counts(int(np.sum(first == second)), note=note)


def _barostat(script: UserScript) -> Iterator[str]:
    """Yield the lines for bodies beside a barostat of other atoms, which does not scale bodies."""
    rigid = script.rigid
    if len(rigid.ids) < 2 or not (rigid.flexible and rigid.state.press):
        return
    kind = thermostat.kind_of(rigid.lines)
    ours = [integrator for integrator in script.integrators.values() if integrator.kind == "ours"]
    same = next(
        (integrator for integrator in ours if thermostat.kind_of(integrator.lines) == kind), ours[0]
    )
    replaced = dict(zip(rigid.ids, rigid.lines))
    yield (
        "With separate fixes the barostat does not see the bodies' pressure, and does not scale "
        f"them. One fix with keyword flexible does both. {candidates.replacement_notice(replaced)}:"
    )
    lines = [*rigid.setup, *same.commands(script.scene)]
    yield from (f"    {line}" for line in lines)
    yield from candidates.removal_notice(replaced, script.reading["commands"], lines)


def _suffix(script: UserScript, out: Path, ranks: int, silence: float) -> Iterator[str]:
    """Yield sentences on whether the suffix nosquish has replaced or would replace the script's
    fix; none for a fix without such a suffix."""
    (line, *_), rigid = script.rigid.lines, script.rigid
    style, suffixes = (
        rigid_atoms.style_of(line),
        (command.split() for command in script.reading["commands"]),
    )
    scripts = [
        " ".join(words) for words in suffixes if words[0] == "suffix" and "nosquish" in words
    ]
    fix = f"fix {rigid.ids[0]} ({style.removesuffix(SUFFIX)})"
    if style.endswith(SUFFIX):
        yield (
            f"The suffix nosquish replaces {fix} by {rigid.style}. Integrators that are named "
            "after LAMMPS's fixes run without this suffix."
        )
    elif rigid.kind == "rigid" and scripts:
        yield (
            f"In spite of '{scripts[-1]}' {fix} is LAMMPS's own: a suffix acts on the lines after "
            "it, until another one or 'suffix off', and of two suffixes the first one is preferred."
        )
    elif rigid.kind == "rigid":
        yield _with_suffix(script, fix, out / "runs" / "suffix", ranks, silence)


def _with_suffix(script: UserScript, fix: str, folder: Path, ranks: int, silence: float) -> str:
    """How ``lmp -sf nosquish`` replaces the script's fix, as LAMMPS reports it."""
    rigid, line = script.rigid, script.rigid.lines[0]
    words = split_words(line)
    ours = join_words((*words[:3], rigid_atoms.style_of(line) + SUFFIX, *words[4:]))
    trial = candidates.script_integrator(replace(rigid, kind="ours", lines=(ours,)))
    result = run.once(_job(script, trial, folder, 0, ranks=ranks, silence=silence), failures=True)
    if result.error:
        return f"'lmp -sf nosquish -in SCRIPT' does not replace {fix}: {result.error}"
    logged = (folder / "log.lammps").read_text().splitlines()
    notice = next(text for text in logged if text.startswith(f"Fix {rigid.ids[0]}: "))
    return (
        f"'lmp -sf nosquish -in SCRIPT' replaces {fix} by one of fix_nosquish, without an edit. "
        f"Its log has the line '{notice.removesuffix(SUFFIX)}' then. Without this line LAMMPS's "
        "own fix has run."
    )


def _row(script: UserScript, integrator: Integrator, result: run.Result) -> dict:
    """The row of an integrator: its start, and some steps."""
    thermo = result.thermo
    error = result.error or run.no_number(thermo)
    row: dict = {
        "name": integrator.name,
        "label": integrator.label,
        "error": error,
        "uncounted": conserved_energy.misses_own_error(integrator),
    }
    if error or not thermo:
        return row
    first, last = thermo["Temp"][[0, -1]].tolist()
    freedom = 2 * thermo["KinEng"][0] / max(script.reading["boltzmann"] * first, 1e-300)
    if abs(last - first) > first * (CHANGE + 4 * (2 / max(freedom, 1.0)) ** 0.5):
        row["settles"] = (
            f"The start is not in equilibrium, or the step is far too long: in {STEPS} steps the "
            f"temperature changes from {first:.4g} to {last:.4g} {script.units.temperature}. What "
            "follows from its forces is true of this start only: check a run after equilibration "
            "(--run N)."
        )
    row |= {
        "temperature": first,
        "freedom": round(float(freedom)),
        "pressure": float(thermo["Press"][0]),
        "potential": float(thermo["PotEng"][0]),
        "late": result.timings[-1].late,
    }
    if not row["uncounted"]:
        row["change"] = float(np.ptp(thermo.get("Econserve", thermo["TotEng"])))
    return row
