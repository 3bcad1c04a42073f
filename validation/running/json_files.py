"""Files of plain data that are there as a whole, or not at all: a process may end at any moment."""

import json
import os
import sys
from pathlib import Path
from typing import Any


def write(path: Path, plain: Any) -> None:
    """Write plain data as JSON, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    part.write_text(json.dumps(plain, indent=1, ensure_ascii=False) + "\n")
    part.replace(path)


def read(path: Path) -> dict | None:
    """The data in a file, with names; None if there is no file, or it is damaged, which is said."""
    try:
        found = json.loads(path.read_text())
    except FileNotFoundError:
        return None
    except ValueError as error:
        report_damage(path, error)
        return None
    if not isinstance(found, dict):
        report_damage(path, "no data with names")
        return None
    return found


def report_damage(path: Path, why: object) -> None:
    """Say, once for each file, that what it is for is done again."""
    if path not in _said:
        _said.add(path)
        print(f"{path} is damaged ({why}): what it belongs to is done again", file=sys.stderr)


_said: set[Path] = set()
