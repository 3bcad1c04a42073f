"""Stored results, which are not measured again as long as all that they depend on is the same.

`Store.origin` is a hash of what a result depends on: versions, the installed package, the harness's
code, files, and settings.  Code that only shows numbers does not count, see `code`.

`Store.once` returns the complete record of the same origin, or does the work and stores it.
Records of other origins stay beside it.  (A run of LAMMPS is stored by ``run.once`` in the same
way, with its job, which has the input itself.)
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
# files on which no number depends; criteria judges numbers only
SHOWN = {"pages", "report.py", "figures.py", "command.py", "command_line.py", "criteria.py"}


class Store:
    """Records of a verb: plain data, each in a file of a folder.

    Args:
        folder: of the files; it is created with the first record.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)

    @functools.cached_property
    def base(self) -> str:
        """Hash of what all records depend on: versions, package and code."""
        return digest(machine.versions(), machine.package_hash(), code())

    def origin(self, *settings, files: Iterable[Path] = ()) -> str:
        """Hash of all that a record depends on.

        Args:
            settings: plain data, or dataclasses of such.
            files: files, and folders of files.
        """
        return digest(self.base, settings, [*map(machine.contents, files)])

    def once(self, name: str, origin: str, make: Callable[[], dict]) -> dict:
        """The complete record of this name and origin; if there is none, ``make`` returns it.

        After Ctrl-C in ``make`` nothing is stored.

        Args:
            name: of the record; with slashes, its file is in such folders.
        """
        stored = self.load(name, origin)
        if stored and stored["complete"]:
            return stored["record"]
        record = make()
        self.save(name, origin, record)
        return record

    def load(self, name: str, origin: str) -> dict | None:
        """The stored ``record``, ``complete``, ``date``, ``origin`` and ``base``; None if none."""
        return _record(self._file(name, origin))

    def save(self, name: str, origin: str, record: dict, complete: bool = True) -> None:
        """Store a record; one that is not ``complete`` is continued later."""
        json_files.write(
            self._file(name, origin),
            {
                "name": name,
                "origin": origin,
                "base": self.base,
                "complete": complete,
                "date": machine.now(),
                "record": record,
            },
        )

    def shared(self, names: Iterable[str]) -> Iterator[str]:
        """The names, each locked against other processes; those locked by others come last."""
        waiting: list[str] = []
        for batch, wait in (list(names), False), (waiting, True):
            for name in batch:
                with self.locked(name, wait) as mine:
                    if mine:
                        yield name
                    else:
                        waiting.append(name)

    def locked(self, name: str, wait: bool = True) -> contextlib.AbstractContextManager[bool]:
        """Context with the name locked; yields whether this process has the lock."""
        return locked(self.folder / f"{name}.lock", wait)

    def _file(self, name: str, origin: str) -> Path:
        return self.folder / f"{name}-{origin[:16]}.json"


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Context with an output folder locked, for verbs whose runs are not shared among processes.

    Raises:
        SystemExit: another process has the lock.
    """
    with locked(folder / "alone.lock", wait=False) as mine:
        if not mine:
            raise SystemExit(
                f"another command uses {folder} now: wait until it ends, or give another "
                "folder by --out"
            )
        yield


def _record(file: Path) -> dict | None:
    """What `Store.save` has written; None if there is none."""
    record = json_files.read(file)
    if record is not None and not record.keys() >= RECORD:
        json_files.report_damage(file, "no record")
        return None
    return record


def digest(*data) -> str:
    """Hash of plain data, and of dataclasses of such."""
    return hashlib.sha256(json.dumps(data, default=_plain).encode()).hexdigest()


def _plain(value):
    if is_dataclass(value) and not isinstance(value, type):
        return [type(value).__name__, asdict(value)]
    if isinstance(value, Path):
        return str(value)
    raise TypeError(f"{value!r} is no plain data, so a result cannot depend on it")


@functools.cache
def code() -> str:
    """Hash of the harness's files on which numbers can depend: all but those of `SHOWN`."""
    files = sorted(
        path.relative_to(HARNESS)
        for kind in ("*.py", "*/*.py", "*/*.c", "*/*.cpp")
        for path in HARNESS.glob(kind)
    )
    return digest(
        [
            (str(file), (HARNESS / file).read_text())
            for file in files
            if not SHOWN.intersection(file.parts)
        ]
    )
