"""JSON files that are written atomically: a process may end at any moment."""

import json
import os
import sys
from pathlib import Path
from typing import Any


def write(path: Path, plain: Any) -> None:
    """Write plain data atomically."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    part.write_text(json.dumps(plain, indent=1, ensure_ascii=False) + "\n")
    part.replace(path)


def read(path: Path) -> dict | None:
    """The object in a file; None if there is no file, or, with a message, if it is damaged."""
    try:
        data = json.loads(path.read_text())
    except FileNotFoundError:
        return None
    except ValueError as error:
        report_damage(path, error)
        return None
    if not isinstance(data, dict):
        report_damage(path, "no JSON object")
        return None
    return data


def report_damage(path: Path, why: object) -> None:
    """Print, once for each file, that it is ignored."""
    if path not in _reported:
        _reported.add(path)
        print(f"{path} is damaged ({why}): its work is done again", file=sys.stderr)


_reported: set[Path] = set()
