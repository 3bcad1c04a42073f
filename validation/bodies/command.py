"""``bodies``: its words, and what they run."""

import gzip
import json
import os
import re
import subprocess
import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path

from .. import command_line
from ..own.script import texts

PARTS = "water", "CH3", "NH3", "rings"


def add(verbs: command_line.Verbs) -> None:
    """Add the verb to the command line."""
    parser = command_line.verb(
        verbs,
        "bodies",
        run,
        help="find rigid parts in a script's molecules, and write a data file that has them",
        description="Find water, CH3, NH3 and aromatic rings with their hydrogens by bonds and "
        "masses, at the first run of a LAMMPS input script, and write a data file in which each is "
        "a body: by an integer property of the atoms, or by molecule IDs. Each kind of part gets "
        "its mean shape. No file of yours is written to.",
        epilog="Exit status: 0 if there are parts, 1 if there are none.",
    )
    command_line.script(parser)
    help = "what is rigid, of: %(choices)s (default all)"
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help=help)
    help = "where bodies stand in the data file (default property: molecule IDs stay as they are)"
    parser.add_argument("--as", choices=("property", "molecule"), default="property", dest="kind",
                        help=help)  # fmt: skip
    help = "keep each part's own shape, in place of the mean of its kind"
    parser.add_argument("--shapes-stay", action="store_true", help=help)
    command_line.silence(parser, 120.0)
    command_line.out(parser, "results/bodies-SCRIPT")
    command_line.launch(parser)
    command_line.own(parser)


def run(arguments: Namespace) -> int:
    """Run the verb; the exit status."""
    import numpy as np  # heavy: not for --help

    from ..own import recorder, system
    from ..own.recorder import ALIAS
    from . import lines, making, parts

    ask, out = system.begin(arguments, arguments.scene)
    out = out.resolve()
    said, atoms, folder = system.read(ask, out, 1, arguments.silence, everything=True)
    if not len(atoms.get("bonds", ())):
        raise SystemExit(f"{ask.name}: the atoms have no bonds, by which rigid parts are found")
    if said["units"] not in ("real", "metal"):
        raise SystemExit(f"{ask.name}: elements cannot be told by masses in units {said['units']}")
    cell, periodic = np.array(said["cell"]), said["periodic"]
    body, counts = parts.rigid(atoms, cell, periodic, arguments.parts)
    print("Found: " + ", ".join(f"{number:,} × {name}" for name, number in counts.items()))
    if not body.any():
        print("No rigid part, so no data file is written.")
        return 1
    x, moved = atoms["x"], 0.0
    if not arguments.shapes_stay:
        x, moved = parts.alike(atoms, body, cell, periodic)
    np.savez(out / "bodies.npz", x=x, body=body)
    data = out / f"{ask.name}.data"
    styles = out / "styles" if making.from_restart(said) else None
    plain = {
        "folder": said["workplace"],
        "commands": system.without_fixes(said),
        "arrays": str(out / "bodies.npz"),
        "kind": arguments.kind,
        "data": f"{ALIAS}/{data.name}",
        "log": str(out / "write.log"),
        "styles": styles and str(styles),
    }
    (out / "write.json").write_text(json.dumps(plain))
    writer = Path(__file__).with_name("writer.py")
    overlay = system.overlay(folder)
    done = subprocess.run([sys.executable, str(writer), str(out / "write.json")],
                          stdin=subprocess.DEVNULL, capture_output=True, text=True,
                          env={**os.environ, **recorder.environment(overlay)})  # fmt: skip
    if done.returncode:
        raise SystemExit(f"{ask.name}: no data file: {done.stderr.strip().splitlines()[-1]}")
    lost = _give_coefficients(said["commands"], (Path(said["workplace"]), overlay), data)
    if moved:
        print(f"Each kind has its mean shape: for this an atom moved by {moved:.3g} Å at most.")
    restart = making.NOTHING
    if styles:
        restart = _of_restart(said, styles, data.with_suffix(".coeffs"), Path(ask.script).parent)
    name = lines.named(data, Path(ask.script).parent)
    print("\n".join(lines.told(arguments.kind, said, atoms, body, name, restart)))
    if lost:
        print(f"The coefficients in {lost} are not in it: give them by commands.")
    return 0


def _of_restart(said: Mapping, styles: Path, file: Path, folder: Path):
    """What a script that reads a restart file needs beside the data file; writes ``file``, which
    has its styles and coefficients."""
    from . import lines, making  # heavy: not for --help

    known = json.loads(styles.with_suffix(".json").read_text())
    first, lost, commands = making.styles(said, styles.with_suffix(".coeffs").read_text())
    file.write_text(commands)
    return making.of_restart(said, known, first, lost, lines.named(file, folder))


def coefficients(text: str) -> str:
    """The sections of a data file that have coefficients, as they are."""
    section = r"^[ \t]*\w+ Coeffs\b.*\n(?:[ \t]*\n)+(?:.*\S.*\n?)+"
    return "\n".join(re.findall(section, text, re.M))


def _give_coefficients(commands: Sequence[str], folders: Sequence[Path], data: Path) -> str:
    """Put coefficients of the script's data file into the new one; the files whose own cannot be
    there.

    Args:
        folders: in which, or below which, the data file is.
    """
    reads = [words for words in map(texts, commands) if words[0] == "read_data"]
    found = {}
    for _, name, *words in reads:
        if "nocoeff" in words:
            continue
        opened = gzip.open if name.endswith(".gz") else open
        here, overlay = folders
        plain, last = os.path.normpath(here / name), Path(name).name
        files = [Path(f"{overlay}{plain}"), Path(plain), *overlay.rglob(last), *here.rglob(last)]
        path = next(one for one in files if one.is_file())
        with opened(path, "rt", errors="replace") as file:
            found[name] = coefficients(file.read())
    having = [name for name, sections in found.items() if sections]
    more_types = any(re.fullmatch(r"extra/\w+/types", word) for words in reads for word in words)
    if len(reads) > 1 or more_types:  # then there are more types than lines
        return ", ".join(having)
    with open(data, "a") as file:
        file.writelines(f"\n{found[name]}" for name in having)
    return ""
