"""The report of all verbs: finds their results, and writes what they say to one self-contained
page, with their figures made light."""

import base64
import io
import json
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from .. import CHECKOUT, COMMAND, NAME, RESULTS
from ..command_line import INTERRUPTED
from ..pages.page import page
from ..pages.said import Figure, Said, Table
from ..running import machine
from . import sections as overview

# of a figure: pixels; lines and text need no more, and a PNG's palette has no more
WIDEST, COLOURS = 1400, 256
SHORT = {"sweep": ("--ranks", "2"), "stability": ()}  # what --short runs, on two cores
BROKEN = OSError, ValueError, KeyError, TypeError, AttributeError, IndexError  # of any file


@dataclass(frozen=True)
class Section:
    """A part with what was found of it."""

    part: overview.Part
    name: str  # of the folder that was looked for
    folder: Path | None  # where the results are; None if nowhere
    summary: dict  # as it was read; empty if it could not be
    said: Said
    warnings: list[str]  # why something is missing

    @property
    def measured(self) -> str:
        """When, and with which package."""
        return f"Measured {_days(self.summary)} with {machine.package(self.summary)}."

    @property
    def commands(self) -> list[str]:
        """What makes these results, or would."""
        usual = self.summary.get("command", f"{COMMAND} {self.part.verb}")
        return self.said.commands or [usual]


def _days(summary):
    """The days of a summary: of its parts, where these were measured at different times."""
    scenes = [scene.get("swept", {}) for scene in summary.get("scenes", {}).values()]
    parts = scenes or [*summary.get("points", ())] or [summary]
    told = (one.get("date") or one.get("begin") or summary.get("date") for one in parts)
    days = sorted({day[:10] for day in told if day})
    if not days:
        return "on a day that is not told"
    return " to ".join(dict.fromkeys((days[0], days[-1])))


def gather(results: Path) -> list[Section]:
    """A `Section` for each of ``overview.PARTS``, and for each folder of a pattern.

    Args:
        results: folder in which the results are looked for first; those that are not there are
            taken from `RESULTS`.
    """
    sections = []
    for part in overview.PARTS:
        found: dict[str, Path] = {}
        for root in results, RESULTS:
            for name in part.name, f"{part.name}-short":
                for summary in sorted(root.glob(f"{name}/summary.json")):
                    found.setdefault(summary.parent.name.removesuffix("-short"), summary)
        sections += [_read(part, *one) for one in found.items()] or [_missing(part, part.name)]
    return sections


def has(results: Path, name: str) -> bool:
    """Whether a folder has a complete summary of a part, or of its short form."""
    for path in results / name / "summary.json", results / f"{name}-short" / "summary.json":
        try:
            if not json.loads(path.read_text())["interrupted"]:
                return True
        except BROKEN:
            continue
    return False


def _read(part, name, path):
    """The section of a summary, whatever its file holds."""
    try:
        text = path.read_text()
        for old, new in overview.NAMES.items():
            text = text.replace(old, new)
        summary = json.loads(text)
        said = part.says(summary)
    except BROKEN as problem:
        told = f"({type(problem).__name__}: {str(problem)[:80]})"
        why = f"{_place(path)} is not what `{part.verb}` writes {told}."
        return _missing(part, name, path.parent, why)
    warnings = []
    if summary.get("interrupted"):
        told = "Interrupted: what had been measured by then."
        warnings.append(f"{told} The same command goes on from there.")
    if path.parent.name.endswith("-short") or "--short" in summary.get("command", ""):
        extent = f": {said.extent}" if said.extent else ""
        warnings.append(f"A short run, for a first look{extent}.")
    return Section(part, name, path.parent, summary, said, warnings)


def _missing(part, name, folder=None, *warnings):
    """The section of results that are not there."""
    told = f"No results; this makes them: {COMMAND} {part.verb}."
    return Section(part, name, folder, {}, Said(), [*warnings, told])


def _facts(sections):
    """Machine and versions: {what: {value: names of the sections that have it}}."""
    seen: dict = defaultdict(lambda: defaultdict(list))
    for section in sections:
        told = section.summary.get("machine", {}) | section.summary.get("versions", {})
        for key, value in told.items():
            # the package stands beside each result
            if key not in ("load_at_start", "package", "fix_nosquish"):
                seen[key.replace("_", " ")][value].append(section.name)
    return seen


def common(sections: Iterable[Section]) -> str:
    """With what all was measured, as far as the sections do not differ in it, in one line."""
    same = {what: values for what, values in _facts(sections).items() if len(values) == 1}
    return ", ".join(f"{what} {value}" for what, values in same.items() for value in values)


def differing(sections: Iterable[Section]) -> dict[str, dict]:
    """In which of the machine and versions the sections differ: {what: {value: names of the
    sections that have it}}."""
    return {key: values for key, values in _facts(sections).items() if len(values) > 1}


def circumstances(sections: Sequence[Section]) -> Table:
    """By which command each section was measured, and in what its machine and versions differ from
    others'."""
    seen, rows = differing(sections), []
    for one in sections:
        told = (
            ", ".join(str(value) for value, names in values.items() if one.name in names)
            for values in seen.values()
        )
        where = _place(one.folder), "; ".join(one.commands)
        rows.append([one.part.title, *(words or "not told" for words in told), *where])
    return Table.of("Each part", ("part", *seen, "results", "command"), rows)


def write(sections: Sequence[Section], path: Path) -> None:
    """Write the page."""
    found = [section for section in sections if section.folder]
    short = [(section, line) for section in found for line in section.said.short]
    values = {
        "sections": sections,
        "short": short,
        "picture": picture,
        "date": machine.now(),
        "commit": commit(),
        "common": common(found),
        "differing": differing(found),
        "circumstances": circumstances(found),
        "renamed": " and ".join(overview.NAMES),
    }
    page("overview.html", path, [], **values)


def picture(section: Section, figure: Figure) -> tuple[str | None, str | None]:
    """A section's figure: its data, and why there is none."""
    path = (section.folder or RESULTS) / figure.file
    try:
        return light(path), None
    except FileNotFoundError:
        return None, f"{_place(path)} is not there."
    except (OSError, SyntaxError) as problem:  # Pillow's, of what is no image, or is cut short
        return None, f"{_place(path)} cannot be shown: {problem}."


def _place(path):
    """A path as text, from the checkout where it is in it."""
    whole = path.resolve()
    return str(whole.relative_to(CHECKOUT) if whole.is_relative_to(CHECKOUT) else path)


def run_short(verb: str, out: Path) -> bool:
    """Run a verb's short form, in a process of its own so that its results tell its own command;
    whether a Ctrl-C ended it.

    It has a session of its own: a Ctrl-C comes here, and is passed on once.
    """
    command = [sys.executable, "-m", NAME, verb, "--short", *SHORT[verb]]
    command += ["--out", str(out.resolve())]
    process = subprocess.Popen(command, cwd=CHECKOUT, start_new_session=True)
    try:
        process.wait()
    except KeyboardInterrupt:
        process.terminate()
        process.wait()
        return True
    return process.returncode == INTERRUPTED


def light(path: Path) -> str:
    """A figure as base64 text of a PNG that is not larger than need be: no wider than `WIDEST`,
    with `COLOURS` colours, those of its areas kept.

    Raises:
        OSError, SyntaxError: the file is not a whole image.
    """
    original = Path(path).read_bytes()
    with Image.open(io.BytesIO(original)) as image:
        height = image.size[1]
        made = image.convert("RGB")
    made.thumbnail((WIDEST, height), Image.Resampling.LANCZOS)
    buffer = io.BytesIO()
    made.quantize(COLOURS, kmeans=1, dither=Image.Dither.NONE).save(buffer, "PNG", optimize=True)
    return base64.b64encode(min(original, buffer.getvalue(), key=len)).decode()


def commit() -> str | None:
    """The checkout's commit, and whether files differ from it; None if git does not know."""
    if not (CHECKOUT / ".git").exists():
        return None
    words = ["git", "-C", str(CHECKOUT), "describe", "--always", "--exclude=*", "--abbrev=12"]
    try:
        told = subprocess.run([*words, "--dirty= with changes"], capture_output=True, text=True)
    except OSError:
        return None
    return told.stdout.strip() or None
