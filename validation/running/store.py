"""What was measured is kept, and not measured again while all that it follows from is the same.

There is one rule for what a result follows from, `Store.origin`: versions, the installed package,
the harness's code that measures it, files, and settings.  Of the code only that counts which can
change a number: a comment, a text or a figure that is another drops nothing, see `code_of`.

There is one rule for resuming, `Store.once`: a complete record of the same origin is taken, else
the work is done, and what it gives is kept, whole or not at all.  Records of other origins stay
beside it.  (One run of LAMMPS is kept by ``run.once`` in the same way: with its job, which has the
input itself.)
"""

import ast
import contextlib
import fcntl
import functools
import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, is_dataclass
from pathlib import Path

from . import machine, whole
from .lock import Lock

RECORD = {"name", "base", "complete", "date", "record"}
HARNESS = Path(__file__).resolve().parents[1]
# files that no number follows from; criteria judges numbers, and makes none
SHOWN = (
    *("pages/*.py", "report.py", "section.py", "figures.py"),
    *("command.py", "command_line.py", "criteria.py"),
)
# arguments by these names that are text are only shown
TEXTS = "title", "label", "subject", "what", "why", "note", "physics", "text", "help", "source"


class Store:
    """Records of a verb, plain data, each in a file of a folder.

    Args:
        folder: of the files; it is made when a record is kept.
        module: name of the harness's module that measures, as ``stress.measure``.
    """

    def __init__(self, folder: Path, module: str) -> None:
        self.folder, self.module = Path(folder), module

    @functools.cached_property
    def base(self) -> str:
        """Hash of what all records follow from: versions, package and code, as it is now."""
        return digest(machine.versions(), machine.package_hash(), code_of(self.module))

    def origin(self, *settings, files: Iterable[Path] = ()) -> str:
        """Hash of all that a record follows from.

        Args:
            settings: plain data, or dataclasses of such.
            files: further files, and folders, whose files count.
        """
        return digest(self.base, settings, [*map(machine.contents, files)])

    def once(self, name: str, origin: str, make: Callable[[], dict], again: bool = False) -> dict:
        """The record of this name and origin; ``make`` gives it if there is none, or none complete.

        A Ctrl-C in ``make`` passes through, and nothing is kept then.

        Args:
            name: of the record; with slashes, its file is in such folders.
            again: make it anew whatever there is.
        """
        kept = None if again else self.kept(name, origin)
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
        whole.write(self._file(name, origin), plain)

    def alike(self) -> dict[str, dict]:
        """All that is kept, of the same versions, package and code; of a name the newest only."""
        found: dict[str, dict] = {}
        for file in self.folder.rglob("*.json"):
            kept = _record(file)
            if kept is None:
                continue
            known = found.get(kept["name"])
            if kept["base"] == self.base and not (known and known["date"] >= kept["date"]):
                found[kept["name"]] = kept
        return found

    def shared(self, names: Iterable[str]) -> Iterator[str]:
        """The names, each while no other process has it; those that others have come last."""
        waiting: list[str] = []
        for some, how in (list(names), fcntl.LOCK_EX | fcntl.LOCK_NB), (waiting, fcntl.LOCK_EX):
            for name in some:
                with self.locked(name, how) as mine:
                    if mine:
                        yield name
                    else:
                        waiting.append(name)

    def locked(self, name: str, how: int = fcntl.LOCK_EX) -> Lock:
        """A context in which no other process has the name; it gives whether it is ours."""
        return Lock(self.folder / f"{name}.lock", how)

    def _file(self, name: str, origin: str) -> Path:
        return self.folder / f"{name}-{origin[:16]}.json"


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[None]:
    """A context in which no other process measures in an output folder: for verbs that do not share
    their runs.  Else one would write where the other's LAMMPS is at work, or reads.

    Raises:
        SystemExit: another one does.
    """
    with Lock(folder / "alone.lock", fcntl.LOCK_EX | fcntl.LOCK_NB) as mine:
        if not mine:
            raise SystemExit(
                f"another command measures in {folder} now: wait for its end, or give another "
                "folder by --out"
            )
        yield


def _record(file: Path) -> dict | None:
    """What `Store.keep` wrote; None if there is none."""
    kept = whole.read(file)
    if kept is not None and not kept.keys() >= RECORD:
        whole.damaged(file, "no record")
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
def code_of(module: str) -> str:
    """Hash of what a module of the harness runs: its code, and that of all it imports there.

    Comments, docstrings and texts (arguments that `TEXTS` names) do not count, nor files that
    `SHOWN` names.  A file that a module names by ``with_name`` counts as one that it imports.
    """
    harness, found = HARNESS, {}
    wanted = [_module(harness.joinpath(*module.split(".")))]
    while wanted:
        path = wanted.pop()
        if path is None or path in found or any(path.match(pattern) for pattern in SHOWN):
            continue
        text = path.read_text()
        if path.suffix != ".py":
            found[path] = text
            continue
        tree = _Bare().visit(ast.parse(text))
        found[path] = ast.dump(tree)
        wanted += _imported(tree, path)
    named = sorted((path.relative_to(harness).as_posix(), text) for path, text in found.items())
    return hashlib.sha256(json.dumps(named).encode()).hexdigest()


def _module(path: Path) -> Path | None:
    """The file of a module, of which this is the path without an ending; None if it is none."""
    file = path.with_suffix(".py")
    return file if file.exists() else path / "__init__.py" if path.is_dir() else None


def _imported(tree: ast.AST, path: Path) -> Iterator[Path | None]:
    """The files that a file of the harness names; it imports others of the harness relatively."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level:
            place = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            if node.module:
                yield _module(place)
            yield from (_module(place / one.name) for one in node.names)
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "with_name":
            name = node.args[0]
            if isinstance(name, ast.Constant) and path.with_name(str(name.value)).exists():
                yield path.with_name(str(name.value))


class _Bare(ast.NodeTransformer):
    """Code without docstrings, and without texts by name."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return None if isinstance(node.value, ast.Constant) else self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        node.keywords = [one for one in node.keywords if not self._text(one)]
        return self.generic_visit(node)

    @staticmethod
    def _text(one: ast.keyword) -> bool:
        words = ast.JoinedStr, ast.Constant
        return one.arg in TEXTS and isinstance(one.value, words)
