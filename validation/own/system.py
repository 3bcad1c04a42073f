"""A scene from a user's script, and the integrators that can move it.

`take` has LAMMPS read the script (see ``reader``), finds what moves the rigid atoms (``finding``)
and makes of the script's commands a `Scene`, as the harness's own ones are.  All that LAMMPS does
happens in the output folder: no file of the user's is written to.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from .. import command_line
from ..running import machine, run, starts, store, whole
from ..scenes import Scene
from ..scenes.integrators import Integrator
from ..scenes.units import UNITS, Units
from . import finding, schemes
from .files import STATES, asked_now
from .finding import Found, Unclear
from .script import CHANGES, DONE, RUNS, computed, remembers, texts

READER = Path(__file__).with_name("reader.py")
SAME = 1e-6  # of the potential and the thermal energy: more is another system


@dataclass(frozen=True)
class Ask:
    """What the command line says of a script.

    Attributes:
        script: its path.  folder: in which the harness was started.
        variables: of the option -var: a name and its values, each.
        fix: IDs of the fixes whose place is taken; empty finds them.
        group, bodies: the rigid atoms, where no fix tells them.
        at: the how many-th run with rigid bodies it is, from 1.
    """

    script: str
    folder: str
    variables: tuple[tuple[str, ...], ...] = ()
    fix: tuple[str, ...] = ()
    group: str | None = None
    bodies: str | None = None
    at: int = 1

    @classmethod
    def of(cls, arguments: Namespace, script: str) -> "Ask":
        """Of a script, with the options that `command_line.own` adds."""
        given = tuple(map(tuple, arguments.variables or ()))
        for one in given:
            if len(one) < 2:
                arguments.parser.error(f"-var {one[0]}: a value is missing behind the name")
        return cls(
            os.path.abspath(script),  # a link's own folder, as LAMMPS takes it
            os.getcwd(),
            given,
            tuple(arguments.fix or ()),
            arguments.group,
            arguments.bodies,
            arguments.run_number,
        )

    @property
    def name(self) -> str:
        """For folders: my.in and in.my both are "my"."""
        stem = re.sub(r"^in\.|\.(in|lmp|inp|lammps|txt)$", "", Path(self.script).name)
        return re.sub(r"[^\w.+-]", "-", stem) or "script"


@dataclass(frozen=True)
class Own:
    """A user's script as a scene.

    Attributes:
        integrators: that can move it, by name; the script's own first.
        reference: the name of the one that others are compared with.
        found: what moves the bodies in the script.
        said, atoms: what ``reader`` has left.
        notes: what the user is to be told, in sentences.
    """

    ask: Ask
    scene: Scene
    integrators: dict[str, Integrator]
    reference: str
    found: Found
    said: Mapping
    atoms: Mapping[str, np.ndarray]
    notes: tuple[str, ...]

    @property
    def units(self) -> Units:
        """Of the script."""
        return UNITS[self.scene.units]

    @property
    def bodies(self) -> int:
        """Their number."""
        return int(self.found.body.max())

    @property
    def room(self) -> float:
        """Of a body at the start: the edge of a cube of its part of the box."""
        return float((abs(np.linalg.det(np.array(self.said["cell"]))) / self.bodies) ** (1 / 3))


def begin(arguments: Namespace, script: str, short: bool = False) -> tuple[Ask, Path]:
    """What a verb's command line says of a script, and the output folder, which is made.

    Args:
        short: see `command_line.folder`.
    """
    ask = Ask.of(arguments, script)
    arguments.usual = f"results/{arguments.verb}-{ask.name}"
    return ask, command_line.folder(arguments, short)


def take(
    ask: Ask, out: Path, ranks: int, silence: float, tell: Callable[[str], object] = print
) -> Own:
    """Read a script, or take over what was read of the same script and files.

    Args:
        out: folder for all that LAMMPS does with the script.
        ranks: that read it: as many as it is to run on.
        silence: s without a sign of life after which the reading is given up.
        tell: is given each sentence of what was found.

    Raises:
        SystemExit: with one message, what is wrong and the way out.
    """
    with _locked(out):
        said, atoms, folder = _reading(ask, out, ranks, silence)
        name = Path(ask.script).name
        try:
            found = finding.find(said, atoms, ask.fix, ask.group, ask.bodies)
        except Unclear as unclear:
            raise SystemExit(f"{name}: {unclear}") from None
        those, reference, more = schemes.schemes(found, said["units"])
        scene, late = _scene(ask, folder, said, atoms, found)
        if found.kind in ("constraints", "plain"):
            scene = _at_rest(scene, those, folder, ranks, silence)
        late += _otherwise(scene, those, said, len(found.body), folder, ranks, silence)
        scene = replace(scene, origin=_files_of(said, scene.folder))
    notes = (*schemes.summary(found, said, atoms), *more, *late)
    for line in notes:
        tell(line)
    return Own(ask, scene, {one.name: one for one in those}, reference, found, said, atoms, notes)


def refuse_ramps(own: Own) -> None:
    """Refuse a script whose temperature or pressure changes in its run, for what is measured by
    means.

    Raises:
        SystemExit: with one message.
    """
    if own.found.state.ramps:
        raise SystemExit(
            f"{own.scene.subject}: '{schemes.plain(own.said['run'])}' changes "
            f"{' and '.join(own.found.state.ramps)}, so means do not tell what a step does: give a "
            "run that keeps them. 'check', 'compare' and 'cost' take this one"
        )


def read(
    ask: Ask, out: Path, ranks: int, silence: float, everything: bool = False
) -> tuple[dict, dict[str, np.ndarray], Path]:
    """What ``reader`` says of a script, and its atoms; and the folder where it did that.

    Args:
        everything: stop at the first run whatever moves atoms there.
    """
    with _locked(out):
        return _reading(ask, out, ranks, silence, everything)


def _locked(out: Path):
    """A context in which no other process reads a script in this output folder."""
    return store.Store(out, "own.system").locked("script")


def _reading(ask, out, ranks, silence, everything=False):
    if not Path(ask.script).is_file():
        raise SystemExit(f"there is no script {ask.script}, and no scene of that name")
    folder = (out / "script").resolve()
    how = ranks, everything
    said = _known(ask, folder, *how) or _read(ask, folder, *how, silence)
    with np.load(folder / "atoms.npz") as file:
        return said, dict(file), folder


def without_fixes(said: Mapping) -> list[str]:
    """The script's commands without fixes that act in runs, and the state of the atoms."""
    kept = [
        line
        for line in said["commands"]
        if texts(line)[0] not in (*DONE, "fix", "fix_modify", "unfix", "compute_modify")
        or texts(line)[3:4] in (["property/atom"], ["cmap"])
    ]
    return [*kept, said["state"]]


def _known(ask: Ask, folder: Path, ranks: int, everything: bool) -> dict | None:
    """What was read before, if nothing has changed since."""
    try:
        kept = whole.read(folder / "known.json") or {}
        how = ranks, everything, kept["files"], asked_now(*kept["asked"])
        same = kept["origin"] == _origin(ask, *how)
        return whole.read(folder / "read.json") if same else None
    except (OSError, KeyError):
        return None


def _origin(ask, ranks, everything, files, asked) -> str:
    code, found = store.code_of("own.system"), [files, _contents(files), asked]
    return store.digest(asdict(ask), ranks, everything, code, machine.versions(), found)


def _contents(files) -> str:
    """Hash of what is in the user's files that a script reads, in whatever folders they are."""
    return store.digest([machine.contents(Path(file)) for file in files])


def _files_of(said: Mapping, inputs: Path) -> str:
    """Hash of the files that a script's runs follow from: the user's, those that its reading made,
    and the bodies. Others in the folder are written by the runs themselves."""
    bodies = [
        one
        for one in (inputs / STATES / "bodies.npy", inputs / STATES / "bodies.dump")
        if one.exists()
    ]
    return store.digest(_contents(said["files"]), said["made"], [*map(machine.contents, bodies)])


def _read(ask: Ask, folder: Path, ranks: int, everything: bool, silence: float) -> dict:
    shutil.rmtree(folder, ignore_errors=True)
    (folder / "inputs").mkdir(parents=True)
    plain = {
        "script": ask.script,
        "folder": ask.folder,
        "inputs": str(folder / "inputs"),
        "variables": ask.variables,
        "fix": ask.fix,
        "any": bool(ask.group or ask.bodies),
        "everything": everything,
        "at": ask.at,
    }
    (folder / "ask.json").write_text(json.dumps(plain))
    beside = str(Path(ask.script).parent)  # modules of its own
    path = os.pathsep.join(filter(None, (beside, os.environ.get("PYTHONPATH"))))
    words = [*run.launcher(ranks), sys.executable, str(READER), str(folder / "ask.json")]
    how = {"OMP_NUM_THREADS": "1", **os.environ, "PYTHONPATH": path}
    with (
        open(folder / "output.txt", "w") as output,
        run.started(words, stdout=output, stderr=subprocess.STDOUT, env=how) as process,
    ):
        hung = run.watch(process, folder / "log.lammps", silence)
    error = folder / "error.txt"
    if hung:
        error.write_text(
            f"nothing was written for {silence:g} s while it was read. A run before the one that "
            "is asked for is done as it is: if it takes so long between two lines of thermo "
            "output, --silence S waits longer"
        )
    if error.exists() or not (folder / "read.json").exists():
        why = error.read_text() if error.exists() else f"ended, see {folder / 'output.txt'}"
        raise SystemExit(f"{Path(ask.script).name}: {run.one_line(why)}")
    said = json.loads((folder / "read.json").read_text())
    globs, environment = said["asked"]  # with values as they are outside of the ranks
    known = said["files"], [globs, {one: os.environ.get(one) for one in environment}]
    kept = {"files": known[0], "asked": known[1], "origin": _origin(ask, ranks, everything, *known)}
    whole.write(folder / "known.json", kept)  # the last file: it tells that the others are whole
    return said


def _scene(
    ask: Ask, folder: Path, said: Mapping, atoms: Mapping[str, np.ndarray], found: Found
) -> tuple[Scene, list[str]]:
    """The script's commands, with a gap where the found fixes were; and what is to be said."""
    commands: list[str] = said["commands"]
    first, gone = len(commands), set[int]()
    for one in found.ids:
        own = [i for i, line in enumerate(commands) if texts(line)[1:2] == [one]]
        ended = max((i for i in own if texts(commands[i])[0] == "unfix"), default=-1)
        gone |= {i for i in own if i > ended and texts(commands[i])[0] in ("fix", "fix_modify")}
        first = min(first, max(i for i in own if texts(commands[i])[0] == "fix"))
    gone |= {i for i, line in enumerate(commands) if finding.modifies_compute(line, found.ids)}
    if found.kind == "plain" or ask.group:
        first = len(commands)
    stray = schemes.steering(commands)
    gone |= stray
    states = said["states"]
    # behind the state that runs begin with, these would change it a second time
    changes = [
        i for i, line in enumerate(commands) if texts(line)[0] in CHANGES and line not in states
    ]
    first = max([first, *(i + 1 for i in changes)])
    kept = [i for i, line in enumerate(commands) if i not in gone and texts(line)[0] not in DONE]
    before, then = ([commands[i] for i in kept if (i < first) == early] for early in (True, False))
    before.insert(_box(before), run.RESET)  # before fixes that forbid it
    of_fixes = finding.computes(found.ids)
    output = {key: one for key, one in computed(commands).items() if one not in of_fixes}
    inputs = folder / "inputs"
    known = np.array([found.body, atoms["type"]], dtype=np.int32)
    _keep(known, folder, inputs / STATES / "bodies.npy")
    number = int(found.body.max())
    scene = Scene(
        name=ask.name,
        title=f"{Path(ask.script).name}: {number:,} bodies, {len(found.body):,} atoms",
        folder=inputs,
        setup=(*before, *found.setup, *said["spins"], said["state"]),
        group=found.group,
        bodies=found.bodies,
        constraints=found.constraints,
        body_property=str(inputs / STATES / "bodies.npy"),
        units=said["units"],
        dt=said["dt"],
        unit=number,
        sizes=(number,),
        subject=Path(ask.script).name,
        then=tuple(line for line in then if line not in states),
        columns=("econserve", "density"),
        output=tuple(f"thermo_modify {key} {one}" for key, one in output.items()),
        dimension=said["dimension"],
    )
    late = []
    if said["sized"]:
        late.append(
            "Atoms may have moments of inertia of their own, as spheres and ellipsoids have. What "
            "is said here of the bodies' moments and of the turning in a step leaves these out."
        )
    if said["oriented"] and said["skipped"]:
        late.append(
            "Atoms have directions of their own, as ellipsoids and dipoles have, and these are not "
            "carried over from earlier runs: give a script that reads a data file of the state "
            "behind them."
        )
    late += _late([commands[i] for i in range(first, len(commands)) if i not in gone])
    if unknown := [f"{key} {one}" for key, one in computed(commands).items() if one in of_fixes]:
        late.append(
            f"Left out, for a fix that is replaced makes these computes: thermo_modify "
            f"{' '.join(unknown)}."
        )
    if stray:
        some = "; ".join(schemes.plain(commands[i]) for i in sorted(stray))
        late.append(f"Left out, for they change the step or end a run early: {some}.")
        ids = {texts(commands[i])[1] for i in stray}
        if readers := schemes.reading(ids, [*before, *then]):
            some = "; ".join(map(schemes.plain, readers))
            late.append(f"These read numbers of them, so no run begins with them: {some}.")
    return scene, late


def _keep(array: np.ndarray, folder: Path, path: Path) -> None:
    """Write an array, whole or not at all: runs of another process may read it."""
    part = folder / f"{path.name}.part"
    with open(part, "wb") as file:
        np.save(file, array)
    part.replace(path)


def _late(then: Sequence[str]) -> list[str]:
    """What is to be said of commands between the bodies' fix and an earlier run of it."""
    last = max((i for i, line in enumerate(then) if texts(line)[0] in RUNS), default=0)
    late = [line for line in then[:last] if remembers(line)]
    if not late:
        return []
    some = "; ".join(map(schemes.plain, late[:6])) + " ..." * (len(late) > 6)
    return [
        "These stand before earlier runs, and find atoms here where the run that is compared "
        f"begins: {some}."
    ]


def _box(commands) -> int:
    """Behind the command that makes the box."""
    makes = "read_data", "create_box", "read_restart"
    return 1 + max(i for i, line in enumerate(commands) if texts(line)[0] in makes)


def _at_rest(scene, those, folder, ranks, silence) -> Scene:
    """The scene with velocities of rigid bodies: what all integrators make of the script's.

    Raises:
        SystemExit: none that moves rigid bodies can begin.
    """
    rigid = [one for one in those if one.kind in ("ours", "rigid")]
    if not rigid:
        return scene
    state, made = scene.folder / STATES / "bodies.dump", folder / "bodies" / "state.dump"
    if not state.exists():
        how: dict = {"dt": scene.dt, "every": 0, "ranks": ranks, "silence": silence}
        more, why = starts.to_dump(made, 1), []
        for one in rigid:
            result = run.run(run.job(scene, one, made.parent, [0], more=more, **how))
            if not result.error:
                made.replace(state)
                break
            why.append(f"{one.label} cannot begin: {result.error}")
        else:
            raise SystemExit(f"{scene.subject}: {'; '.join(why)}")
    begun = starts.read(f"{STATES}/{state.name}", 0, scene.dimension, box=True)
    return replace(scene, setup=(*scene.setup[:-1], begun))


def _otherwise(scene, those, said, atoms, folder, ranks, silence) -> list[str]:
    """What is to be said where the start is another system than the script has behind earlier runs:
    these may have changed what is no motion of atoms, as charges, bonds, coefficients.

    Args:
        atoms: how many there are.
    """
    if not said["skipped"] or said["potential"] is None:
        return []
    place = folder / "beginning"
    how: dict = {"dt": scene.dt, "every": 1, "ranks": ranks, "silence": silence}
    more = (*run.thermo(), *scene.output)
    for one in those:
        job = run.job(scene, one, place, [0], more=more, **how)
        result = run.once(job, failures=True)
        if result.error or not len(result.thermo.get("PotEng", ())):
            continue
        here, there = float(result.thermo["PotEng"][0]), said["potential"]
        scale = abs(there) + atoms * said["boltzmann"] * said["temperature"]
        if abs(here - there) <= SAME * scale:
            return []
        return [
            f"The potential energy is {here:.8g} at the start here, and {there:.8g} in the script: "
            "an earlier run changes more than the motion of atoms, as charges, bonds or "
            "coefficients, or its variables count steps. So this is another system. Run the script "
            "so far, keep it by write_data, and give one that reads that file."
        ]
    return []
