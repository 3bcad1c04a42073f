"""The user's files that a script names, and what stands for them in the folder where LAMMPS works.

No file of the user's is written to.  LAMMPS works in one folder, ``root``, whatever ``shell cd``
says: a file below the script's folder stands there under the same relative name, as a link if the
command only reads it, else as a copy.  One that is elsewhere stands in a folder of its own there.
So no command has a path from the root of all files, which may have letters that LAMMPS does not
take.  What a command writes is written below ``root``, too, or not at all.
"""

import fnmatch
import glob
import hashlib
import itertools
import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

from . import script

# commands with names of files, and the first word that may be one
FIRST = {"fix": 4, "variable": 3}
NAMING = "_coeff", "_style"
ASIDE = "elsewhere-"  # begins names of folders below root that stand for others
STATES = "validation-states"  # below root: a folder of the harness's own files, which no user has


class Failure(Exception):
    """The script cannot be taken; the message says why."""


class Files:
    """Finds the files of a script.

    Args:
        folders: where relative names may be: the script's, and the one in which the harness was
            started, as LAMMPS takes them.
        root: where LAMMPS works.
        world: the ranks.

    Attributes:
        read: paths of the user's files that are read.
        globs: patterns and names that were looked for, with the paths that there were.
        environment: names of variables of the environment that were asked for.
    """

    def __init__(self, folders: Sequence[Path], root: Path, world) -> None:
        self.folders, self.root, self.world = tuple(dict.fromkeys(folders)), root, world
        self.at = "."  # the folder of relative names, below each of these, or a whole path
        self.made: set[str] = set()  # folders that the script makes
        self.read: set[str] = set()
        self.globs: dict[str, list[str]] = {}
        self.environment: list[str] = []
        self.used: set[str] = set()  # places below root that commands read
        self.written: dict[str, str] = {}  # what the script writes, and its place below root
        self.lacking: dict[str, str] = {}  # what is not written, and the command that would

    # ------------------------------------------------------------ names

    def place(self, name: str) -> str:
        """A name as it is from the script's folder, or from the root of all files."""
        return os.path.normpath(os.path.join(self.at, name))

    def find(self, name: str, wild: bool = False) -> list[Path]:
        """The files of this name; of those that a wildcard stands for, if ``wild``.

        Raises:
            Failure: it is another file in each of the folders.
        """
        if not name or "\0" in name or len(name) > 255:
            return []
        place = self.place(name)
        if place in self.written:
            return [self.root / self.written[place]]
        every = [folder / place for folder in self.folders]
        if name.startswith(ASIDE):  # as an earlier command has it, in a variable
            every = [self.root / name]
        if wild and ("*" in name or "%" in name):
            patterns = [str(one).replace("%", "*") for one in every]
            self.globs |= {one: matching(one) for one in patterns}
            found = [[Path(one) for one in self.globs[own]] for own in patterns if self.globs[own]]
        else:
            found = [[one] for one in dict.fromkeys(every) if one.is_file()]
        if len(found) > 1 and not _same(*found):
            raise Failure(
                f"{name} is another file in {self.folders[0]} than in {self.folders[1]}. LAMMPS "
                "takes the one of the folder in which it is started: start this command in the "
                "script's folder, or rename one of them"
            )
        return found[0] if found else []

    def text(self, name: str, asked: str) -> str:
        """What is in a file of commands.

        Args:
            asked: the command that reads it.
        """
        self._refuse_lacking(name, asked)
        path = next(iter(self.find(name)), Path(self.folders[0], self.place(name)))
        if path.exists() and not path.is_file() and not path.is_dir():
            raise Failure(
                f"'{asked}' reads what someone types in a terminal: put the commands that would be "
                "typed in its place"
            )
        if not path.is_file():
            raise Failure(f"there is no file {name} in {path.parent}, which the script reads")
        self._note(path)
        content = path.read_bytes()
        if b"\0" in content or content[:2] in (b"\xff\xfe", b"\xfe\xff"):  # marks of UTF-16
            raise Failure(
                f"{name} is no text: give the input script, not a restart file or a picture"
            )
        try:
            return content.decode()
        except UnicodeDecodeError:  # LAMMPS reads bytes: such letters stand in comments
            return content.decode("latin-1")

    def cd(self, name: str) -> None:
        """Relative names are of another folder from now on."""
        place = self.place(name)
        if place not in self.made and not any((one / place).is_dir() for one in self.folders):
            raise Failure(
                f"'shell cd {name}': there is no folder {self.folders[0] / place}. Other commands "
                "of the shell are left out: make the folder, with what is to be in it"
            )
        self.at = place

    # ------------------------------------------------------------ commands

    def brought(self, line: str) -> str:
        """A command with names under which LAMMPS finds its files, which are there then.

        Raises:
            Failure: it reads what a command that is left out writes.
        """
        word, *_ = script.texts(line)
        first = FIRST.get(word, 1 if word in script.READS or word.endswith(NAMING) else None)
        # a name that stands in a variable is looked up where a command has it
        moves = first is not None and not (word == "variable" and not _of_file(line))
        number = itertools.count()

        def changed(own: script.Word) -> str:
            at = next(number)
            named = moves and at >= (first or 0) and self.at != "."
            return self._name(own, word, named, line)

        changed_line = script.with_words(line, changed)
        self.world.Barrier()
        return changed_line

    def _name(self, own: script.Word, command: str, named: bool, line: str) -> str:
        """A word of a command, see `brought`; ``named``: whether a file's name may be changed."""
        reads, fix, place = command in script.READS, command == "fix", self.place(own.text)
        found = self.find(own.text, wild=reads)
        if reads or (found and not fix):  # else the word may be no file's name
            self._refuse_lacking(own.text, line)
        if not found:
            away = fix and is_elsewhere(os.path.normpath(own.text))
            if away and (self.folders[0] / place).parent.is_dir():
                return f'"{self._aside(self.folders[0] / place, make=True)}"'  # it may write there
            return f'"{place}"' if reads and named and own.text else own.quoted
        if place in self.written:
            name = self.written[place]
            self.used.add(name)
            return own.quoted if name == own.text else f'"{name}"'
        if self.root in found[0].parents:
            for path in found if fix else ():
                self._put(path.resolve(), path, link=False)
            return own.quoted
        for path in found:
            self._note(path)
        if not is_elsewhere(place):
            for path in found:
                below = os.path.join(os.path.dirname(place), path.name)
                self.used.add(below)
                self._put(path, self.root / below, reads)
            return f'"{place}"' if named else own.quoted
        for path in found:
            self._put(path, self.root / self._aside(path), link=not fix)
        return f'"{self._aside(found[0]).with_name(os.path.basename(place))}"'

    def asks(self, text: str, expand: Callable[[str], str]) -> str:
        """A command whose ``is_file(NAME)`` finds what LAMMPS would find in the user's folder."""

        def looked(match):
            name = expand(match[1]) if "$" in match[1] else match[1]
            for folder in self.folders:
                pattern = glob.escape(str(folder / self.place(name)))
                self.globs[pattern] = matching(pattern)
            *_, there = script.texts(self.brought(f"include {name}"))
            return f"is_file({there})"

        return script.IS_FILE.sub(looked, text)

    def writable(self, line: str) -> str | None:
        """A command that writes a file, with a name below ``root``; None if it is to be left out,
        for it writes elsewhere, or a file for each step or rank."""
        at, found = script.written_at(line), script.words(line)
        if at is None:
            return None
        name = found[at].text
        place = self.place(name)
        if is_elsewhere(place) or "*" in name or "%" in name:
            return None
        below, earlier = self.written.get(place, place), self.find(name)
        if below in self.used:  # runs read again what was there before
            below = f"{place}.{len(self.used)}"
        if self.world.rank == 0:
            target = self.root / below
            target.parent.mkdir(parents=True, exist_ok=True)
            if script.appends(line) and earlier and earlier[0] != target:
                shutil.copyfile(earlier[0], target)
        self.world.Barrier()
        self.written[place] = below
        told = [one.quoted for one in found]
        return " ".join((*told[:at], f'"{below}"', *told[at + 1 :]))

    def leave_out(self, names: Sequence[str], line: str) -> None:
        """Note that these files are not written, for this command is left out."""
        self.lacking |= {self.place(name).replace("%", "*"): line for name in names}

    def _refuse_lacking(self, name: str, asked: str) -> None:
        place = self.place(name)
        if place in self.written:
            return
        for pattern, line in self.lacking.items():
            if fnmatch.fnmatch(place, pattern):
                raise Failure(
                    f"'{asked}' reads {name}, which '{line}' writes before it, and that command is "
                    "left out here, for it writes as the script runs. Run the script so far, and "
                    "give one that begins with that file"
                )

    # ------------------------------------------------------------ links and copies

    def _note(self, path: Path) -> None:
        if self.root not in path.parents:
            self.read.add(str(path))

    def _aside(self, path: Path, make: bool = False) -> Path:
        """The name of a file that is elsewhere, in a folder where LAMMPS works that stands for
        its own."""
        name = hashlib.sha256(str(path.parent.resolve()).encode()).hexdigest()[:8]
        folder = Path(ASIDE + name)
        if make and self.world.rank == 0:
            (self.root / folder).mkdir(exist_ok=True)
        return folder / path.name

    def _put(self, path: Path, place: Path, link: bool) -> None:
        """A copy of a file, or a link to it, if there is none; rank 0 makes it."""
        if self.world.rank != 0 or path == place:
            return
        if place.is_symlink() and not link:
            place.unlink()
        if not place.exists():
            place.parent.mkdir(parents=True, exist_ok=True)
            if link:
                place.symlink_to(path.resolve())
            else:
                shutil.copyfile(path, place)


def _same(one: list[Path], other: list[Path]) -> bool:
    """Whether two folders have the same files."""
    return [a.name for a in one] == [b.name for b in other] and all(
        a.samefile(b) or a.read_bytes() == b.read_bytes() for a, b in zip(one, other)
    )


def _of_file(line: str) -> bool:
    """Whether a command is a variable that reads a file."""
    return script.texts(line)[2:3] in (["file"], ["atomfile"])


def is_elsewhere(place: str) -> bool:
    """Whether a file at this place is in no folder in which LAMMPS works."""
    return place.startswith("/") or place.split("/")[0] == ".."


def asked_now(globs: Sequence[str], environment: Sequence[str]) -> list:
    """What patterns and variables of the environment stand for at present."""
    return [
        {one: matching(one) for one in globs},
        {one: os.environ.get(one) for one in environment},
    ]


def matching(pattern: str) -> list[str]:
    """Paths of the files that a pattern stands for."""
    return sorted(one for one in glob.glob(pattern) if os.path.isfile(one))
