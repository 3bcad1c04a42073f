"""A scene from a user's script, and the integrators that can move it.

`load` has LAMMPS execute the script up to the requested run (see ``reader``), finds what moves the
rigid atoms (``rigid_atoms``), and makes a `Scene` like the built-in ones from the commands that
LAMMPS executed.  LAMMPS runs in the script's folder; what it writes is redirected to the output
folder (see ``recorder``).
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
from typing import Any

import numpy as np

from .. import command_line
from ..running import json_files, machine, recorder, run, starts, store
from ..running.recorder import ALIAS
from ..scenes import Scene
from ..scenes.integrators import Integrator
from ..scenes.units import UNITS, Units
from . import candidates, rigid_atoms
from .commands import OUTPUT, rigid_reports, split_words, thermo_settings
from .rigid_atoms import AmbiguousScript, RigidAtoms

READER = Path(__file__).with_name("reader.py")
STATE = f"read_restart {ALIAS}/script/state.restart"
BOXES = "read_data", "read_restart", "create_box"
STEERING = "dt/reset", "halt"  # fixes that change the step, or end a run early
SAME = 1e-6  # relative difference of energies; above it the system is not the same


@dataclass(frozen=True)
class ScriptOptions:
    """A script, and the options of the command line that select what is rigid in it.

    Attributes:
        script: its path.  folder: the working folder of the harness.
        variables: of the option -var: a name with its values, each.
        fix: IDs of the fixes to replace; empty finds them.
        group, bodies: the rigid atoms, where no fix defines them.
        at: number of the run among those with rigid bodies, from 1.
    """

    script: str
    folder: str
    variables: tuple[tuple[str, ...], ...] = ()
    fix: tuple[str, ...] = ()
    group: str | None = None
    bodies: str | None = None
    at: int = 1

    @property
    def name(self) -> str:
        """A name for folders: "my" for my.in and for in.my."""
        stem = re.sub(r"^in\.|\.(in|lmp|inp|lammps|txt)$", "", Path(self.script).name)
        return re.sub(r"[^\w.+-]", "-", stem) or "script"


@dataclass(frozen=True)
class UserScript:
    """A user's script as a scene.

    Attributes:
        integrators: that can move it, by name; the script's own first.
        reference: name of the integrator that others are compared with.
        rigid: its rigid atoms, and the fixes that move them.
        reading, atoms: output of ``reader``: read.json and atoms.npz.
        notes: sentences for the user.
    """

    options: ScriptOptions
    scene: Scene
    integrators: dict[str, Integrator]
    reference: str
    rigid: RigidAtoms
    reading: Mapping
    atoms: Mapping[str, np.ndarray]
    notes: tuple[str, ...]

    @property
    def units(self) -> Units:
        """The script's units."""
        return UNITS[self.scene.units]

    @property
    def bodies(self) -> int:
        """Number of bodies."""
        return int(self.rigid.body.max())

    def changed(self, note: str, tell: Callable[[str], object], **fields: Any) -> "UserScript":
        """The script with other fields of its scene, and a note on them, with which ``tell`` is
        called."""
        tell(note)
        return replace(self, scene=replace(self.scene, **fields), notes=(*self.notes, note))

    @property
    def room(self) -> float:
        """Edge of a cube with the volume that each body has at the start."""
        return float((abs(np.linalg.det(np.array(self.reading["cell"]))) / self.bodies) ** (1 / 3))


def parse_options(
    arguments: Namespace, script: str, short: bool = False
) -> tuple[ScriptOptions, Path]:
    """The options for a script, from those that `command_line.add_script_options` adds, and the
    output folder, which is created.

    Args:
        short: see `command_line.output_folder`.
    """
    variables = tuple(map(tuple, arguments.variables or ()))
    for words in variables:
        if len(words) < 2:
            arguments.parser.error(f"-var {words[0]}: a value is missing after the name")
    options = ScriptOptions(
        os.path.abspath(script),  # the folder of a link, not of its target, as in LAMMPS
        os.getcwd(),
        variables,
        tuple(arguments.fix or ()),
        arguments.group,
        arguments.bodies,
        arguments.run_number,
    )
    arguments.usual = f"results/{arguments.verb}-{options.name}"
    return options, command_line.output_folder(arguments, short)


def load(
    options: ScriptOptions,
    out: Path,
    ranks: int,
    silence: float,
    tell: Callable[[str], object] = print,
) -> UserScript:
    """Read a script, unless it was read before with the same options and files.

    Args:
        out: folder for all that LAMMPS does with the script.
        ranks: that read it: as many as runs of it will have.
        silence: s without output after which the reading is given up.
        tell: is called with each note.

    Raises:
        SystemExit: the script cannot be used; the message says why and what to do.
    """
    with _locked(out):
        reading, atoms, folder = _reading(options, out, ranks, silence)
        name = Path(options.script).name
        try:
            rigid = rigid_atoms.find(reading, atoms, options.fix, options.group, options.bodies)
        except AmbiguousScript as unclear:
            raise SystemExit(f"{name}: {unclear}") from None
        those, reference, more = candidates.integrators(rigid, reading["units"])
        scene, late = _scene(options, folder, reading, atoms, rigid)
        how: dict = {"ranks": ranks, "silence": silence}
        if rigid.kind in ("constraints", "plain"):
            scene = _with_rigid_velocities(scene, those, folder, how)
        late += _energy_notes(scene, those, reading, len(rigid.body), folder, how)
        scene = replace(scene, origin=_files_of(reading, folder))
    notes = (*candidates.describe(rigid, reading, atoms), *more, *late)
    for line in notes:
        tell(line)
    return UserScript(
        options,
        scene,
        {integrator.name: integrator for integrator in those},
        reference,
        rigid,
        reading,
        atoms,
        notes,
    )


def refuse_ramps(script: UserScript) -> None:
    """Refuse a script whose temperature or pressure changes in its run, because its means would be
    meaningless.

    Raises:
        SystemExit: it changes; the message says what to do.
    """
    if script.rigid.state.ramps:
        raise SystemExit(
            f"{script.scene.subject}: '{script.reading['run']}' changes "
            f"{' and '.join(script.rigid.state.ramps)}, so means do not show the error of a step: "
            "give a run at constant ones"
        )


def read(
    options: ScriptOptions, out: Path, ranks: int, silence: float
) -> tuple[dict, dict[str, np.ndarray], Path]:
    """The output of ``reader``: read.json, atoms.npz, and their folder."""
    with _locked(out):
        return _reading(options, out, ranks, silence)


def _locked(out: Path):
    """A context in which no other process reads a script in this output folder."""
    return store.Store(out).locked("script")


def _reading(options, out, ranks, silence):
    if not Path(options.script).is_file():
        raise SystemExit(f"there is no script {options.script}, and no scene of that name")
    folder = (out / "script").resolve()
    reading = _known(options, folder, ranks)
    if reading is None:
        reading = _read(options, folder, ranks, silence)
    with np.load(folder / "atoms.npz") as file:
        return reading, dict(file), folder


def overlay_folder(folder: Path) -> Path:
    """The folder that replaces the root of the file system for the script's output."""
    return folder / "overlay"


def _known(options: ScriptOptions, folder: Path, ranks: int) -> dict | None:
    """An earlier reading, if nothing has changed since; else None."""
    reading, stored = json_files.read(folder / "read.json"), json_files.read(folder / "known.json")
    same = reading and stored and stored["origin"] == _origin(options, ranks, reading)
    return reading if same else None


def _origin(options: ScriptOptions, ranks: int, reading: Mapping) -> str:
    """A hash of everything that a reading depends on."""
    patterns, environment = reading["sought"]
    surroundings = (
        [sorted(glob.glob(name)) for name in patterns],
        [*map(os.environ.get, environment)],
    )
    code = store.code(), machine.versions()
    return store.digest(asdict(options), ranks, *code, _contents(reading["files"]), *surroundings)


def _contents(files: Sequence[str]) -> str:
    """A hash of the contents of the user's files that LAMMPS has looked for."""
    there = (machine.contents(Path(file)) if os.path.isfile(file) else "" for file in files)
    return store.digest(files, [*there])


def _files_of(reading: Mapping, folder: Path) -> str:
    """A hash of the files that a script's runs depend on: the user's, those that the script has
    written, the state and the bodies."""
    files = (folder / file for file in ("state.restart", "bodies.npy", "bodies.dump", "overlay"))
    return store.digest(
        _contents(reading["files"]), [machine.contents(file) for file in files if file.exists()]
    )


def _read(options: ScriptOptions, folder: Path, ranks: int, silence: float) -> dict:
    """Have a script read in its own folder or, if that fails, in the working folder.

    Raises:
        SystemExit: it fails in both (the first message is shown); or files of the same name differ.
    """
    here, start = Path(options.script).parent, Path(options.folder)
    name, messages = Path(options.script).name, list[str]()
    for workplace in dict.fromkeys((here, start)):
        message = _read_in(workplace, options, folder, ranks, silence)
        if not message:
            break
        messages.append(message)
    else:
        raise SystemExit(f"{name}: {messages[0]}")
    reading = json.loads((folder / "read.json").read_text())
    for file in map(Path, reading["files"] if workplace == here != start else ()):
        other = start / os.path.relpath(file, here)
        both = file.is_relative_to(here) and file.is_file() and other.is_file()
        if both and other.read_bytes() != file.read_bytes():
            raise SystemExit(
                f"{name}: {file.name} is another file in {here} than in {start}. LAMMPS takes the "
                "one of the folder in which it is started: start this command in the script's "
                "folder, or rename one of them"
            )
    # the last file: its presence means that the others are complete
    json_files.write(folder / "known.json", {"origin": _origin(options, ranks, reading)})
    return reading


def _read_in(workplace, options, folder, ranks, silence) -> str:
    """Have a script read in a folder; return the message if that failed, else empty."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    plain = {
        "script": options.script,
        "workplace": str(workplace),
        "overlay": str(overlay_folder(folder)),
        "variables": options.variables,
        "fix": options.fix,
        "any": bool(options.group or options.bodies),
        "at": options.at,
    }
    (folder / "request.json").write_text(json.dumps(plain))
    beside = str(Path(options.script).parent)  # the script's own modules
    path = os.pathsep.join(filter(None, (beside, os.environ.get("PYTHONPATH"))))
    words = [*run.launcher(ranks), sys.executable, str(READER), str(folder / "request.json")]
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
            f"nothing was written for {silence:g} s while it was read. Runs before the requested "
            "one are executed as they are: if one takes so long between two lines of thermo "
            "output, give a larger --silence"
        )
    if (folder / "read.json").exists() and not error.exists():
        return ""
    return run.one_line(error.read_text()) if error.exists() else f"ended, see {output}"


def setup_commands(reading: Mapping, gone: Collection[str] = ()) -> list[tuple[int, str]]:
    """The script's commands that each run begins with, and their numbers in the script.

    The restart file replaces the command that creates the box.  Commands that act once are omitted,
    because the restart file contains their effect.

    Args:
        gone: IDs of fixes that are left out.
    """
    commands: list[str] = reading["commands"]
    left = {*rigid_atoms.modify_commands(commands, gone)}
    box = next(i for i, line in enumerate(commands) if split_words(line)[0] in BOXES)
    before: list[tuple[int, str]] = []
    behind = [(box, STATE), (box, run.RESET)]  # before fixes that forbid this
    for number, (line, once) in enumerate(zip(commands, reading["at_once"])):
        word, *rest = split_words(line)
        if once or word in OUTPUT or line in left or (word == "fix" and rest[0] in gone):
            continue
        if word == "group" and rest[1:2] != ["dynamic"]:  # it is in the state
            continue
        # a fix defined before the box, such as cmap, reads its per-atom values from the state
        early = number < box and word not in ("fix", "fix_modify")
        (before if early else behind).append((number, line))
    return before + behind


def _scene(
    options: ScriptOptions,
    folder: Path,
    reading: Mapping,
    atoms: Mapping[str, np.ndarray],
    rigid: RigidAtoms,
) -> tuple[Scene, list[str]]:
    """The script's commands without the fixes that are replaced; and notes on them."""
    stray = {fix_id: line for fix_id, line in reading["fixes"].items()
             if rigid_atoms.style_of(line) in STEERING}  # fmt: skip
    commands, first = reading["commands"], len(reading["commands"])
    if rigid.kind != "plain" and not options.group:
        words = [split_words(line)[:2] for line in commands]
        first = min(words.index(["fix", fix_id]) for fix_id in rigid.ids)
    reports = rigid_reports(commands, rigid.ids)
    setup = setup_commands(reading, {*rigid.ids, *stray})
    setup = [(number, line) for number, line in setup if line not in reports]
    before, then = ([line for i, line in setup if (i < first) == early] for early in (True, False))
    _save_array(np.array([rigid.body, atoms["type"]], dtype=np.int32), folder / "bodies.npy")
    of_fixes, output = rigid_atoms.compute_ids(rigid.ids), thermo_settings(commands)
    number = int(rigid.body.max())
    scene = Scene(
        name=options.name,
        title=f"{Path(options.script).name}: {number:,} bodies, {len(rigid.body):,} atoms",
        folder=Path(reading["workplace"]),
        overlay=str(overlay_folder(folder)),
        setup=(*before, *rigid.setup),
        group=rigid.group,
        bodies=rigid.bodies,
        constraints=rigid.constraints,
        body_property=str(folder / "bodies.npy"),
        units=reading["units"],
        dt=reading["dt"],
        unit=number,
        sizes=(number,),
        subject=Path(options.script).name,
        then=tuple(then),
        columns=("econserve", "density"),
        output=tuple(f"thermo_modify {key} {value}" for key, value in output.items()
                     if value not in of_fixes),
        dimension=reading["dimension"],
    )  # fmt: skip
    late = []
    if reports:
        late.append(
            f"Left out, because they only report numbers of rigid fixes: {'; '.join(reports)}."
        )
    if reading["sized"]:
        late.append(
            "Atoms may have their own moments of inertia, such as spheres and ellipsoids. They are "
            "not included in the moments of bodies and in the angles per step shown here."
        )
    if unknown := [f"{key} {value}" for key, value in output.items() if value in of_fixes]:
        late.append(
            f"Left out, because a fix that is replaced defines these computes: thermo_modify "
            f"{' '.join(unknown)}."
        )
    if stray:
        late.append(
            "Left out, because they change the step or end a run early: "
            f"{'; '.join(stray.values())}."
        )
        if readers := candidates.commands_naming(stray, [*before, *then]):
            late.append(
                f"These commands use such a fix, and may fail without it: {'; '.join(readers)}."
            )
    return scene, late


def _save_array(array: np.ndarray, path: Path) -> None:
    """Write an array atomically, because runs of another process may read it."""
    part = path.with_suffix(".part")
    with open(part, "wb") as file:
        np.save(file, array)
    part.replace(path)


def _run_first_able(scene, those, place, how, more) -> tuple[run.Result | None, list[str]]:
    """The result of ``run 0`` with the first of these integrators that can start, and why those
    before it cannot."""
    why: list[str] = []
    for integrator in those:
        result = run.once(
            run.job(scene, integrator, place, [0], more=more, dt=scene.dt, every=1, **how),
            failures=True,
        )
        if result.interrupted:
            raise KeyboardInterrupt
        if not result.error:
            return result, why
        why.append(f"{integrator.label} cannot start: {result.error}")
    return None, why


def _with_rigid_velocities(scene, those, folder, how) -> Scene:
    """The scene with the script's velocities, projected to rigid motion by a rigid integrator.

    Raises:
        SystemExit: none of them can start.
    """
    rigid = [integrator for integrator in those if integrator.kind in ("ours", "rigid")]
    if not rigid:
        return scene
    state, dump = folder / "bodies.dump", folder / "bodies" / "state.dump"
    if not state.exists():
        result, why = _run_first_able(scene, rigid, dump.parent, how, starts.to_dump(dump, 1))
        if result is None:
            raise SystemExit(f"{scene.subject}: {'; '.join(why)}")
        dump.replace(state)
    begun = starts.read(f"{ALIAS}/script/{state.name}", 0, scene.dimension, box=True)
    return replace(scene, setup=(*scene.setup, begun))


def _energy_notes(scene, those, reading, atoms, folder, how) -> list[str]:
    """A note if the start differs from the script's state after earlier runs, which may have
    changed coefficients that the script's commands set.

    Args:
        atoms: their number.
    """
    if not reading["skipped"] or reading["potential"] is None:
        return []
    more = (*run.thermo(), *scene.output)
    result, _ = _run_first_able(scene, those, folder / "beginning", how, more)
    if result is None or not len(result.thermo.get("PotEng", ())):
        return []
    here, there = float(result.thermo["PotEng"][0]), reading["potential"]
    scale = abs(there) + atoms * reading["boltzmann"] * reading["temperature"]
    if abs(here - there) <= SAME * scale:
        return []
    return [
        f"The potential energy is {here:.8g} at the start here, and {there:.8g} in the script: "
        "an earlier run changes more than a restart file stores, such as coefficients by fix "
        "adapt, or variables depend on the step. So this is another system. Run the script up to "
        "there, use write_data, and give a script that reads that file."
    ]
