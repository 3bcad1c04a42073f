"""A scene from a user's script, and the integrators that can move it.

`load` has LAMMPS run the script up to the run that is asked for (see ``reader``), finds what moves
the rigid atoms (``finding``) and makes of the commands that LAMMPS executed a `Scene`, as the
harness's own ones are.  LAMMPS works in the script's folder, and all that it writes goes into the
output folder (see ``recorder``).
"""

import glob
import json
import os
import re
import shutil
import subprocess
import sys
from argparse import Namespace
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from .. import command_line
from ..running import json_files, machine, recorder, run, starts, store
from ..running.recorder import ALIAS
from ..scenes import Scene
from ..scenes.integrators import Integrator
from ..scenes.units import UNITS, Units
from . import candidates, rigid_atoms
from .commands import OUTPUT, split_words, thermo_settings
from .rigid_atoms import AmbiguousScript, RigidAtoms

READER = Path(__file__).with_name("reader.py")
STATE = f"read_restart {ALIAS}/script/state.restart"
BOXES = "read_data", "read_restart", "create_box"
STEERING = "dt/reset", "halt"  # fixes that change the step, or end a run before its time
SAME = 1e-6  # of the potential and the thermal energy: more is another system


@dataclass(frozen=True)
class ScriptOptions:
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
    def of(cls, arguments: Namespace, script: str) -> "ScriptOptions":
        """Of a script, with the options that `command_line.add_script_options` adds."""
        given = tuple(map(tuple, arguments.variables or ()))
        for words in given:
            if len(words) < 2:
                arguments.parser.error(f"-var {words[0]}: a value is missing behind the name")
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
class UserScript:
    """A user's script as a scene.

    Attributes:
        integrators: that can move it, by name; the script's own first.
        reference: the name of the one that others are compared with.
        rigid: its rigid atoms, and the fixes that move them.
        reading, atoms: what ``reader`` has left: read.json and atoms.npz.
        notes: what the user is to be told, in sentences.
    """

    ask: ScriptOptions
    scene: Scene
    integrators: dict[str, Integrator]
    reference: str
    rigid: RigidAtoms
    reading: Mapping
    atoms: Mapping[str, np.ndarray]
    notes: tuple[str, ...]

    @property
    def units(self) -> Units:
        """Of the script."""
        return UNITS[self.scene.units]

    @property
    def bodies(self) -> int:
        """Their number."""
        return int(self.rigid.body.max())

    @property
    def room(self) -> float:
        """Of a body at the start: the edge of a cube of its part of the box."""
        return float((abs(np.linalg.det(np.array(self.reading["cell"]))) / self.bodies) ** (1 / 3))


def parse_options(
    arguments: Namespace, script: str, short: bool = False
) -> tuple[ScriptOptions, Path]:
    """What a verb's command line says of a script, and the output folder, which is made.

    Args:
        short: see `command_line.output_folder`.
    """
    ask = ScriptOptions.of(arguments, script)
    arguments.usual = f"results/{arguments.verb}-{ask.name}"
    return ask, command_line.output_folder(arguments, short)


def load(
    ask: ScriptOptions, out: Path, ranks: int, silence: float, tell: Callable[[str], object] = print
) -> UserScript:
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
            found = rigid_atoms.find(said, atoms, ask.fix, ask.group, ask.bodies)
        except AmbiguousScript as unclear:
            raise SystemExit(f"{name}: {unclear}") from None
        those, reference, more = candidates.integrators(found, said["units"])
        scene, late = _scene(ask, folder, said, atoms, found)
        how: dict = {"ranks": ranks, "silence": silence}
        if found.kind in ("constraints", "plain"):
            scene = _at_rest(scene, those, folder, how)
        late += _otherwise(scene, those, said, len(found.body), folder, how)
        scene = replace(scene, origin=_files_of(said, folder))
    notes = (*candidates.describe(found, said, atoms), *more, *late)
    for line in notes:
        tell(line)
    named = {integrator.name: integrator for integrator in those}
    return UserScript(ask, scene, named, reference, found, said, atoms, notes)


def refuse_ramps(own: UserScript) -> None:
    """Refuse a script whose temperature or pressure changes in its run, for what is measured by
    means.

    Raises:
        SystemExit: with one message.
    """
    if own.rigid.state.ramps:
        raise SystemExit(
            f"{own.scene.subject}: '{own.reading['run']}' changes "
            f"{' and '.join(own.rigid.state.ramps)}, so means do not tell what a step does: give a "
            "run that keeps them. 'check' and 'cost' take this one"
        )


def read(
    ask: ScriptOptions, out: Path, ranks: int, silence: float
) -> tuple[dict, dict[str, np.ndarray], Path]:
    """What ``reader`` says of a script, and its atoms; and the folder where it left that."""
    with _locked(out):
        return _reading(ask, out, ranks, silence)


def _locked(out: Path):
    """A context in which no other process reads a script in this output folder."""
    return store.Store(out).locked("script")


def _reading(ask, out, ranks, silence):
    if not Path(ask.script).is_file():
        raise SystemExit(f"there is no script {ask.script}, and no scene of that name")
    folder = (out / "script").resolve()
    said = _known(ask, folder, ranks)
    if said is None:
        said = _read(ask, folder, ranks, silence)
    with np.load(folder / "atoms.npz") as file:
        return said, dict(file), folder


def overlay_folder(folder: Path) -> Path:
    """What stands for the root of all files, where the script writes to its own."""
    return folder / "overlay"


def _known(ask: ScriptOptions, folder: Path, ranks: int) -> dict | None:
    """What was read before, if nothing has changed since."""
    said, kept = json_files.read(folder / "read.json"), json_files.read(folder / "known.json")
    same = said and kept and kept["origin"] == _origin(ask, ranks, said)
    return said if same else None


def _origin(ask: ScriptOptions, ranks: int, said: Mapping) -> str:
    """Hash of all that a reading follows from."""
    patterns, environment = said["asked"]
    found = [sorted(glob.glob(name)) for name in patterns], [*map(os.environ.get, environment)]
    code = store.code(), machine.versions()
    return store.digest(asdict(ask), ranks, *code, _contents(said["files"]), *found)


def _contents(files: Sequence[str]) -> str:
    """Hash of what is in the user's files, in whatever folders they are, or were looked for."""
    there = (machine.contents(Path(file)) if os.path.isfile(file) else "" for file in files)
    return store.digest(files, [*there])


def _files_of(said: Mapping, folder: Path) -> str:
    """Hash of the files that a script's runs follow from: the user's, those that the script has
    written, the state and the bodies."""
    made = (folder / file for file in ("state.restart", "bodies.npy", "bodies.dump", "overlay"))
    known = [machine.contents(file) for file in made if file.exists()]
    return store.digest(_contents(said["files"]), known)


def _read(ask: ScriptOptions, folder: Path, ranks: int, silence: float) -> dict:
    """Have a script read in its own folder; or, if it fails there, in the one in which the harness
    was started, of which LAMMPS takes names.

    Raises:
        SystemExit: it fails in both, in which case the first message is told; or it could be read
            in both, and files differ.
    """
    here, start = Path(ask.script).parent, Path(ask.folder)
    name, messages = Path(ask.script).name, list[str]()
    for workplace in dict.fromkeys((here, start)):
        message = _read_in(workplace, ask, folder, ranks, silence)
        if not message:
            break
        messages.append(message)
    else:
        raise SystemExit(f"{name}: {messages[0]}")
    said = json.loads((folder / "read.json").read_text())
    for file in map(Path, said["files"] if workplace == here != start else ()):
        other = start / os.path.relpath(file, here)
        both = file.is_relative_to(here) and file.is_file() and other.is_file()
        if both and other.read_bytes() != file.read_bytes():
            raise SystemExit(
                f"{name}: {file.name} is another file in {here} than in {start}. LAMMPS takes the "
                "one of the folder in which it is started: start this command in the script's "
                "folder, or rename one of them"
            )
    # the last file: it tells that the others are whole
    json_files.write(folder / "known.json", {"origin": _origin(ask, ranks, said)})
    return said


def _read_in(workplace, ask, folder, ranks, silence) -> str:
    """Have a script read in a folder; why that failed."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    plain = {
        "script": ask.script,
        "workplace": str(workplace),
        "overlay": str(overlay_folder(folder)),
        "variables": ask.variables,
        "fix": ask.fix,
        "any": bool(ask.group or ask.bodies),
        "at": ask.at,
    }
    (folder / "ask.json").write_text(json.dumps(plain))
    beside = str(Path(ask.script).parent)  # modules of its own
    path = os.pathsep.join(filter(None, (beside, os.environ.get("PYTHONPATH"))))
    words = [*run.launcher(ranks), sys.executable, str(READER), str(folder / "ask.json")]
    how = {"OMP_NUM_THREADS": "1", **os.environ, "PYTHONPATH": path}
    how |= recorder.environment(overlay_folder(folder), preloaded=how.get("LD_PRELOAD"))
    output, error = folder / "output.txt", folder / "error.txt"
    with (
        open(output, "w") as file,
        run.started(words, stdout=file, stderr=subprocess.STDOUT, env=how) as process,
    ):
        hung = run.watch(process, folder / "log.lammps", silence)
    if hung:
        return (
            f"nothing was written for {silence:g} s while it was read. A run before the one that "
            "is asked for is done as it is: if it takes so long between two lines of thermo "
            "output, --silence S waits longer"
        )
    if (folder / "read.json").exists() and not error.exists():
        return ""
    return run.one_line(error.read_text()) if error.exists() else f"ended, see {output}"


def setup_commands(said: Mapping, gone: Collection[str] = ()) -> list[tuple[int, str]]:
    """The script's commands that a run begins with, and each one's number: the state of what there
    is in the place of the command that makes the box, and what acts beyond that.

    Args:
        gone: IDs of fixes that are left out.
    """
    commands: list[str] = said["commands"]
    left = {*rigid_atoms.modify_commands(commands, gone)}
    box = next(i for i, line in enumerate(commands) if split_words(line)[0] in BOXES)
    before: list[tuple[int, str]] = []
    behind = [(box, STATE), (box, run.RESET)]  # before fixes that forbid it
    for number, (line, once) in enumerate(zip(commands, said["at_once"])):
        word, *rest = split_words(line)
        if once or word in OUTPUT or line in left or (word == "fix" and rest[0] in gone):
            continue
        if word == "group" and rest[1:2] != ["dynamic"]:  # the state has it
            continue
        # a fix that begins before the box, as cmap does, finds its values of atoms in the state
        early = number < box and word not in ("fix", "fix_modify")
        (before if early else behind).append((number, line))
    return before + behind


def _scene(
    ask: ScriptOptions,
    folder: Path,
    said: Mapping,
    atoms: Mapping[str, np.ndarray],
    found: RigidAtoms,
) -> tuple[Scene, list[str]]:
    """The script's commands, with a gap where the found fixes were; and what is to be said."""
    stray = {fix_id: line for fix_id, line in said["fixes"].items()
             if rigid_atoms.style_of(line) in STEERING}  # fmt: skip
    commands, first = said["commands"], len(said["commands"])
    if found.kind != "plain" and not ask.group:
        words = [split_words(line)[:2] for line in commands]
        first = min(words.index(["fix", fix_id]) for fix_id in found.ids)
    kept = setup_commands(said, {*found.ids, *stray})
    before, then = ([line for i, line in kept if (i < first) == early] for early in (True, False))
    known = np.array([found.body, atoms["type"]], dtype=np.int32)
    _keep(known, folder / "bodies.npy")
    of_fixes, output = rigid_atoms.compute_ids(found.ids), thermo_settings(commands)
    number = int(found.body.max())
    scene = Scene(
        name=ask.name,
        title=f"{Path(ask.script).name}: {number:,} bodies, {len(found.body):,} atoms",
        folder=Path(said["workplace"]),
        overlay=str(overlay_folder(folder)),
        setup=(*before, *found.setup),
        group=found.group,
        bodies=found.bodies,
        constraints=found.constraints,
        body_property=str(folder / "bodies.npy"),
        units=said["units"],
        dt=said["dt"],
        unit=number,
        sizes=(number,),
        subject=Path(ask.script).name,
        then=tuple(then),
        columns=("econserve", "density"),
        output=tuple(f"thermo_modify {key} {value}" for key, value in output.items()
                     if value not in of_fixes),
        dimension=said["dimension"],
    )  # fmt: skip
    late = []
    if said["sized"]:
        late.append(
            "Atoms may have moments of inertia of their own, as spheres and ellipsoids have. What "
            "is said here of the bodies' moments and of the turning in a step leaves these out."
        )
    if unknown := [f"{key} {value}" for key, value in output.items() if value in of_fixes]:
        late.append(
            f"Left out, for a fix that is replaced makes these computes: thermo_modify "
            f"{' '.join(unknown)}."
        )
    if stray:
        some = "; ".join(stray.values())
        late.append(f"Left out, for they change the step or end a run early: {some}.")
        if readers := candidates.commands_naming(stray, [*before, *then]):
            late.append(
                f"These read numbers of them, so no run begins with them: {'; '.join(readers)}."
            )
    return scene, late


def _keep(array: np.ndarray, path: Path) -> None:
    """Write an array, whole or not at all: runs of another process may read it."""
    part = path.with_suffix(".part")
    with open(part, "wb") as file:
        np.save(file, array)
    part.replace(path)


def _begun(scene, those, place, how, more) -> tuple[run.Result | None, list[str]]:
    """What the first of these integrators that can begin leaves of ``run 0``, and why others
    cannot."""
    why: list[str] = []
    for integrator in those:
        job = run.job(scene, integrator, place, [0], more=more, dt=scene.dt, every=1, **how)
        result = run.once(job, failures=True)
        if result.interrupted:
            raise KeyboardInterrupt
        if not result.error:
            return result, why
        why.append(f"{integrator.label} cannot begin: {result.error}")
    return None, why


def _at_rest(scene, those, folder, how) -> Scene:
    """The scene with velocities of rigid bodies: what all integrators make of the script's.

    Raises:
        SystemExit: none that moves rigid bodies can begin.
    """
    rigid = [integrator for integrator in those if integrator.kind in ("ours", "rigid")]
    if not rigid:
        return scene
    state, made = folder / "bodies.dump", folder / "bodies" / "state.dump"
    if not state.exists():
        result, why = _begun(scene, rigid, made.parent, how, starts.to_dump(made, 1))
        if result is None:
            raise SystemExit(f"{scene.subject}: {'; '.join(why)}")
        made.replace(state)
    begun = starts.read(f"{ALIAS}/script/{state.name}", 0, scene.dimension, box=True)
    return replace(scene, setup=(*scene.setup, begun))


def _otherwise(scene, those, said, atoms, folder, how) -> list[str]:
    """What is to be said where the start is another system than the script has behind earlier runs:
    these may have changed coefficients that the script's commands set.

    Args:
        atoms: how many there are.
    """
    if not said["skipped"] or said["potential"] is None:
        return []
    more = (*run.thermo(), *scene.output)
    result, _ = _begun(scene, those, folder / "beginning", how, more)
    if result is None or not len(result.thermo.get("PotEng", ())):
        return []
    here, there = float(result.thermo["PotEng"][0]), said["potential"]
    scale = abs(there) + atoms * said["boltzmann"] * said["temperature"]
    if abs(here - there) <= SAME * scale:
        return []
    return [
        f"The potential energy is {here:.8g} at the start here, and {there:.8g} in the script: "
        "an earlier run changes more than a restart file has, as coefficients of fix adapt, or its "
        "variables count steps. So this is another system. Run the script so far, keep it by "
        "write_data, and give one that reads that file."
    ]
