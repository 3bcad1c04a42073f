"""What was measured is kept, and not measured again while all that it follows from is the same.

There is one rule for what a result follows from, `Store.origin`: versions, the installed package,
the harness's code, files, and settings.  Files of the code that only show numbers do not count, see
`code`.

There is one rule for resuming, `Store.once`: a complete record of the same origin is taken, else
the work is done, and what it gives is kept, whole or not at all.  Records of other origins stay
beside it.  (One run of LAMMPS is kept by ``run.once`` in the same way: with its job, which has the
input itself.)
"""

import contextlib
import functools
import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, is_dataclass
from pathlib import Path

from . import json_files, machine
from .lock import locked

RECORD = {"name", "base", "complete", "date", "record"}
HARNESS = Path(__file__).resolve().parents[1]
# files that no number follows from; criteria judges numbers, and makes none
SHOWN = {"pages", "report.py", "figures.py", "command.py", "command_line.py", "criteria.py"}


class Store:
    """Records of a verb, plain data, each in a file of a folder.

    Args:
        folder: of the files; it is made when a record is kept.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)

    @functools.cached_property
    def base(self) -> str:
        """Hash of what all records follow from: versions, package and code, as it is now."""
        return digest(machine.versions(), machine.package_hash(), code())

    def origin(self, *settings, files: Iterable[Path] = ()) -> str:
        """Hash of all that a record follows from.

        Args:
            settings: plain data, or dataclasses of such.
            files: further files, and folders, whose files count.
        """
        return digest(self.base, settings, [*map(machine.contents, files)])

    def once(self, name: str, origin: str, make: Callable[[], dict]) -> dict:
        """The record of this name and origin; ``make`` gives it if there is none, or none complete.

        A Ctrl-C in ``make`` passes through, and nothing is kept then.

        Args:
            name: of the record; with slashes, its file is in such folders.
        """
        kept = self.kept(name, origin)
        if kept and kept["complete"]:
            return kept["record"]
        record = make()
        self.keep(name, origin, record)
        return record

    def kept(self, name: str, origin: str) -> dict | None:
        """What is kept, or None: ``record``, ``complete``, ``date``, ``origin`` and ``base``."""
        return _record(self._file(name, origin))

    def keep(self, name: str, origin: str, record: dict, complete: bool = True) -> None:
        """Keep a record; one that is not ``complete`` is for its maker to go on from."""
        plain = {
            "name": name,
            "origin": origin,
            "base": self.base,
            "complete": complete,
            "date": machine.now(),
            "record": record,
        }
        json_files.write(self._file(name, origin), plain)

    def shared(self, names: Iterable[str]) -> Iterator[str]:
        """The names, each while no other process has it; those that others have come last."""
        waiting: list[str] = []
        for some, wait in (list(names), False), (waiting, True):
            for name in some:
                with self.locked(name, wait) as mine:
                    if mine:
                        yield name
                    else:
                        waiting.append(name)

    def locked(self, name: str, wait: bool = True) -> contextlib.AbstractContextManager[bool]:
        """A context in which no other process has the name; it gives whether it is ours."""
        return locked(self.folder / f"{name}.lock", wait)

    def _file(self, name: str, origin: str) -> Path:
        return self.folder / f"{name}-{origin[:16]}.json"


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[None]:
    """A context in which no other process measures in an output folder: for verbs that do not share
    their runs.  Else one would write where the other's LAMMPS is at work, or reads.

    Raises:
        SystemExit: another one does.
    """
    with locked(folder / "alone.lock", wait=False) as mine:
        if not mine:
            raise SystemExit(
                f"another command measures in {folder} now: wait for its end, or give another "
                "folder by --out"
            )
        yield


def _record(file: Path) -> dict | None:
    """What `Store.keep` wrote; None if there is none."""
    kept = json_files.read(file)
    if kept is not None and not kept.keys() >= RECORD:
        json_files.report_damage(file, "no record")
        return None
    return kept


def digest(*data) -> str:
    """Hash of plain data, and of dataclasses of such."""
    return hashlib.sha256(json.dumps(data, default=_plain).encode()).hexdigest()


def _plain(found):
    if is_dataclass(found) and not isinstance(found, type):
        return [type(found).__name__, asdict(found)]
    if isinstance(found, Path):
        return str(found)
    raise TypeError(f"{found!r} is no plain data: a result cannot be said to follow from it")


@functools.cache
def code() -> str:
    """Hash of the harness's files that numbers can follow from: all but those of `SHOWN`."""
    kinds = "*.py", "*/*.py", "*/*.c", "*/*.cpp"
    files = sorted(path.relative_to(HARNESS) for kind in kinds for path in HARNESS.glob(kind))
    kept = (file for file in files if not SHOWN.intersection(file.parts))
    return digest([(str(file), (HARNESS / file).read_text()) for file in kept])
