"""Whether a script's bodies are what its author thinks, and its step is safe: numbers with bounds.

From the state at the script's run, and from some steps with each integrator.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from .. import COMMAND
from ..own import counted, finding, shapes
from ..own.finding import Unclear
from ..own.script import texts
from ..own.system import Own
from ..running import machine, run
from ..statistics.check import Check
from . import suffix

STEPS = 20  # with each integrator
# rad: a body that turns further in a step is not followed any more
TURN = 0.5
# Verlet's scheme is unstable for frequency x step of 2; with 1 a spring's mean energy is a sixth
# off (1 / (1 - (wh/2)^2) = 1.33 in its position), with 0.6 a tenth
STIFF = 0.6
ALIKE = 1e-3  # of the largest moment: rounding of a data file's digits is less
TITLES = {"bodies": "The bodies", "step": "The step", "script": "The rest of the script"}


def check(own: Own, out: Path, ranks: int, silence: float, meter: run.Meter) -> dict:
    """All of it, as plain data: ``kinds``, ``checks``, ``integrators`` and circumstances."""
    made = shapes.bodies(own)
    kinds = shapes.kinds(own, made)
    checks = [*_bodies(own, made, kinds), *_step(own, made, kinds), *_script(own)]
    rows, interrupted = _starts(own, out, ranks, silence, meter)
    return machine.circumstances() | {
        "title": own.scene.title,
        "notes": own.notes,
        "suffix": suffix.note(own.found, own.said["commands"]),
        "units": own.scene.units,
        "dt": own.scene.dt,
        "temperature": shapes.temperature(own),
        "kinds": [asdict(kind) for kind in kinds],
        "checks": [_told(one).plain() for one in checks],
        "integrators": rows,
        "interrupted": interrupted,
    }


def _told(one: Check) -> Check:
    """Without the note on what is wrong, where nothing is, but the longest step."""
    return replace(one, note="") if one.holds and one.part != "step" else one


def _bodies(own, made, kinds):
    """Kinds, images, neighbours."""
    units = own.units
    for kind in kinds:
        note = (
            "bodies of these atoms differ in shape: each keeps the one that it has. If they are to "
            f"be alike, '{COMMAND} bodies' writes a data file with mean shapes"
        )
        what = "largest difference of a moment from the kind's mean"
        yield Check("bodies", kind.name, what, kind.scatter, high=ALIKE, note=note)
    half = float(np.min(np.diag(np.array(own.said["cell"]))) / 2)
    size = max(kind.size for kind in kinds)
    note = "a body is nearly as wide as the box: its image flags decide where its atoms are"
    yield Check(
        "bodies", "the largest", "its size", size, high=half, unit=units.length, note=note,
        source="half of the box",
    )  # fmt: skip
    note = "by its image flags a body is wider than by nearest images: is it cut by a face?"
    yield Check(
        "bodies", "image flags", "wider by them", made.gap, high=half, unit=units.length, note=note
    )
    near = shapes.nearest(own)
    if near:
        note = f"atoms {near[1]} and {near[2]}, of different bodies and not bonded, nearly overlap"
        least = 0.4 * _usual_distance(own)
        yield Check(
            "bodies", "nearest atoms", f"{near[1]} and {near[2]}", near[0], low=least,
            unit=units.length, note=note, source="0.4 of the mean distance of neighbours",
        )  # fmt: skip


def _usual_distance(own) -> float:
    volume = abs(np.linalg.det(np.array(own.said["cell"])))
    return float((volume / len(own.found.body)) ** (1 / 3))


def _step(own, made, kinds):
    turns = max(kinds, key=lambda kind: kind.angle)
    safe = own.scene.dt * TURN / max(turns.angle, 1e-300)
    note = f"by this number alone, {safe:.3g} {own.units.time} and below is safe"
    what = "rms angle that a body turns in a step at the temperature, about its fastest axis"
    yield Check("step", turns.name, what, turns.angle, high=TURN, unit="rad", note=note)
    found = shapes.fastest(own, made)
    for name, frequency in found.items():
        note = (
            f"by this number alone, {STIFF / frequency:.3g} {own.units.time} and below is safe, if "
            "the start is in equilibrium. One that is not shows more"
        )
        what = "frequency of the stiffest motion × step"
        yield Check("step", name, what, frequency * own.scene.dt, high=STIFF, note=note)


def _script(own):
    """Exclusions, groups, other fixes."""
    movers = shapes.moved(own)
    count = np.sum([*movers.values()], axis=0)
    idle, twice = int(np.sum(count == 0)), int(np.sum(count > 1))
    note = "these atoms stand still, unless a fix that is not known here moves them"
    yield Check("script", "atoms", "that no fix moves", idle, high=0, note=note)
    note = f"two of these fixes move the same atoms: {', '.join(movers)}"
    yield Check("script", "atoms", "that two fixes move", twice, high=0, note=note)
    pairs = _computed(own)
    note = f"these forces cost time and do nothing: {_exclusion(own)}"
    if pairs is None:
        note = "the script's neigh_modify exclude leaves out a part of them: this is not counted"
    yield Check(
        "script", "forces within bodies", "pairs of atoms that have them", pairs, high=0, note=note
    )
    heats = finding.thermostats(own.said, own.atoms, own.found)
    yield from _mesh(own)
    number = len(heats) + bool(own.found.state.temp)
    note = f"more than one thermostat acts on the bodies: {', '.join((*own.found.ids, *heats))}"
    yield Check("script", "thermostats", "of the bodies", number, high=1, note=note)


def _mesh(own):
    """Whether a run that is continued has another mesh: LAMMPS chooses it for the box as it is when
    a run begins."""
    free = chosen_mesh(own.said["commands"]) if own.found.state.press else ()
    note = (
        "at constant pressure LAMMPS chooses them anew for the box of each run, so the energy "
        "jumps between runs, and a run in parts parts from one run. Give those that the log of the "
        "first run names (G vector, grid): kspace_modify mesh NX NY NZ gewald G"
    )
    if free:
        what = f"{' and '.join(free)} that each run chooses anew"
        yield Check("script", "the mesh", what, len(free), high=0, note=note)


def chosen_mesh(commands: Iterable[str]) -> list[str]:
    """What of a kspace_style with a mesh LAMMPS chooses by itself: none where both are given."""
    style, given = "none", {"mesh": "", "gewald": ""}
    for words in map(texts, commands):
        if words[0] == "kspace_style":
            style = words[1]
        for at, word in enumerate(words if words[0] == "kspace_modify" else ()):
            if word in given:
                value = words[at + 1 : at + (4 if word == "mesh" else 2)]
                given[word] = "".join(value) if any(map(float, value)) else ""
    return [name for name, value in given.items() if not value] if "pppm" in style else []


def _exclusion(own) -> str:
    """What leaves out the forces within bodies, and nothing else."""
    told = f"neigh_modify exclude molecule/intra {own.found.group} leaves out all of them"
    if "molecule" not in own.atoms:
        told = "neigh_modify exclude molecule/intra GROUP, where atoms have molecule IDs"
    elif not _one_body_a_molecule(own):
        told = (
            "give each body a molecule ID of its own, then neigh_modify exclude molecule/intra "
            f"{own.found.group}. Now a molecule has several bodies, whose forces this would leave "
            "out, too"
        )
    if reached := _reached(own):
        told = f"special_bonds lj/coul 0 0 0 leaves out {reached:,} of them; {told}"
    styles = [words[1] for words in map(texts, own.said["commands"]) if words[0] == "kspace_style"]
    if styles and styles[-1] != "none":
        told += (
            ". Of what exclude leaves out, the mesh's part stays, which adds a constant to the "
            "energy: LAMMPS warns of it, and motion and pressure are right"
        )
    return told


def _one_body_a_molecule(own) -> bool:
    inside = own.found.body > 0
    pairs = np.stack([np.asarray(own.atoms["molecule"])[inside], own.found.body[inside]])
    return len(np.unique(pairs, axis=1).T) == len(np.unique(pairs[0]))


def _reached(own) -> int:
    """Pairs within bodies that special_bonds would leave out and does not yet; 0 if it would leave
    out others, too."""
    more = ~_left_out_by_bonds(own)
    within, every = (_bonded(own, body)[more] for body in (own.found.body, own.found.body * 0 + 1))
    return int(within.sum()) if (within == every).all() else 0


def _bonded(own, body) -> np.ndarray:
    return finding.bonded_pairs(own.atoms.get("bonds", np.empty((0, 3), int)), body)


def _left_out_by_bonds(own) -> np.ndarray:
    """Whether special_bonds leaves out pairs that are one, two and three bonds apart, (3,)."""
    return np.all(np.array(own.said["special"]) == 0, axis=0)[1:]


def _computed(own) -> int | None:
    """Pairs of atoms within bodies whose forces are computed: all but those that bonds tell, as far
    as their factors of special_bonds are 0; none where an exclusion leaves all of them out, and
    None where it leaves out a part."""
    left_out = [_left_out(own, words) for words in exclusions(own.said["commands"])]
    if True in left_out:
        return 0
    if None in left_out:
        return None
    sizes = np.bincount(own.found.body)[1:].astype(np.int64)
    near = _bonded(own, own.found.body)[_left_out_by_bonds(own)]
    return int(np.sum(sizes * (sizes - 1) // 2) - sum(near))


def exclusions(commands: Iterable[str]) -> list[list[str]]:
    """The words behind ``exclude`` of all neigh_modify that are in force."""
    found: list[list[str]] = []
    for words in map(texts, commands):
        for at, word in enumerate(words if words[0] == "neigh_modify" else ()):
            if word == "exclude":
                found = [] if words[at + 1] == "none" else [*found, words[at + 1 : at + 4]]
    return found


def _left_out(own, words: Sequence[str]) -> bool | None:
    """Whether an exclusion leaves out all pairs within bodies; False for none of them, None for a
    part, or if this is not known."""
    kind, *names = words
    inside = own.found.body > 0
    try:
        if kind in ("molecule/intra", "molecule"):
            here = there = _named(own, "group", names[0])
            body, molecule = own.found.body[inside], np.asarray(own.atoms["molecule"])[inside]
            pairs = np.unique(np.stack([body, molecule]), axis=1)
            whole = pairs.shape[1] == own.found.body.max()  # each body in one molecule
        elif kind in ("group", "type"):
            here, there = (_named(own, kind, name) for name in names[:2])
            whole = True
        else:
            return None
    except (Unclear, ValueError, KeyError):  # a group that is no more, or a range of types
        return None
    if whole and (here & there)[inside].all():
        return True
    count = own.found.body.max() + 1
    one, other, both = (
        np.bincount(own.found.body[some & inside], minlength=count)
        for some in (here, there, here & there)
    )
    return None if (one * other > both).any() else False


def _named(own, kind: str, name: str) -> np.ndarray:
    """The mask of the atoms of a group or a type."""
    if kind == "type":
        return np.asarray(own.atoms["type"]) == int(name)
    return finding.in_group(own.said, own.atoms, name)


def _starts(own, out, ranks, silence, meter):
    """A row for each integrator: what it makes of the start, and of some steps."""
    rows = []
    for one in own.integrators.values():
        directory = out / "runs" / run.folder_name(one.name)
        how: dict = {"dt": own.scene.dt, "ranks": ranks, "silence": silence, "keeps": "nothing"}
        origin = machine.origin(own.scene, one)
        meter.begin(one.label, STEPS)
        job = run.job(own.scene, one, directory, [STEPS], every=1, origin=origin, **how)
        result = run.once(job)
        meter.end(result.error)
        error = result.error or _no_number(result.thermo)
        row: dict = {"name": one.name, "label": one.label, "error": error}
        row["uncounted"] = counted.wrongly(one)
        if result.thermo and not error:
            row |= _start(own, result.thermo)
            if not row["uncounted"]:
                energy = result.thermo.get("Econserve", result.thermo["TotEng"])
                row["change"] = float(np.ptp(energy))
        rows.append(row)
        if result.interrupted:
            return rows, True
    return rows, False


def _start(own, thermo) -> dict:
    """What an integrator makes of the start."""
    heat = own.said["boltzmann"] * thermo["Temp"][0]
    return {
        "temperature": float(thermo["Temp"][0]),
        "freedom": round(float(2 * thermo["KinEng"][0] / max(heat, 1e-300))),
        "pressure": float(thermo["Press"][0]),
        "potential": float(thermo["PotEng"][0]),
    }


def _no_number(thermo: Mapping[str, np.ndarray]) -> str | None:
    """From which step on a quantity of a run is no number; None if all are.  LAMMPS goes on."""
    bad = {name: ~np.isfinite(values) for name, values in thermo.items()}
    first = min((int(one.argmax()) for one in bad.values() if one.any()), default=None)
    if first is None:
        return None
    names = ", ".join(name for name, one in bad.items() if one[first])
    return f"no number from step {thermo['Step'][first]:.0f} on: {names}"
