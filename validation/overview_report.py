"""The report of all verbs: finds their results, and writes what they say to one self-contained page, with their figures made light."""

import base64
import io
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from validation import machine, overview, overview_pieces
from validation.report import page

WIDEST, COLOURS = (
    1400,
    256,
)  # of a figure: pixels; lines and text need no more, and a PNG's palette has no more
INTERRUPTED = 130  # exit status of a verb after a Ctrl-C
SHORT = {"sweep": ("--ranks", "2"), "stability": ()}  # what --short runs, on two cores
COMMITTED = Path(__file__).parent / "results"
ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Section:
    """A part with what was found of it.

    Attributes:
        part: the ``overview.Part``.
        name: of the folder that was looked for.
        folder: where the results are; None if nowhere.
        summary: as it was read; empty if it could not be.
        said: what it ``overview_pieces.Said``.
        warnings: why something is missing.
    """

    part: overview.Part
    name: str
    folder: Path | None
    summary: dict
    said: overview_pieces.Said
    warnings: list

    @property
    def measured(self):
        """When, and with which package."""
        return f"Measured {_days(self.summary)} with {machine.package(self.summary)}."

    @property
    def commands(self):
        """What makes these results, or would."""
        made = (
            [self.summary["command"]]
            if "command" in self.summary
            else [f"python -m validation {self.part.verb}"]
        )
        return self.said.commands or made


def _days(summary):
    """The days of a summary: of its parts, where these were measured at different times."""
    parts = (
        [*(scene.get("swept", {}) for scene in summary.get("scenes", {}).values())]
        or [*summary.get("points", ())]
        or [summary]
    )
    days = sorted(
        {
            told[:10]
            for part in parts
            if (told := part.get("date") or part.get("begin") or summary.get("date"))
        }
    )
    if not days:
        return "on a day that is not told"
    return days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"


def gather(results):
    """A `Section` for each of ``overview.PARTS``, and for each folder of a pattern.

    Args:
        results: folder in which the results are looked for first; those that are not there are taken from `COMMITTED`.
    """
    sections = []
    for part in overview.PARTS:
        found = {}
        for root in results, COMMITTED:
            for name in part.name, f"{part.name}-short":
                for summary in sorted(root.glob(f"{name}/summary.json")):
                    found.setdefault(summary.parent.name.removesuffix("-short"), summary)
        sections += [_read(part, name, path) for name, path in found.items()] or [
            _missing(part, part.name, None, [])
        ]
    return sections


def has(results, name):
    """Whether a folder has a complete summary of a part, or of its short form."""
    for path in results / name / "summary.json", results / f"{name}-short" / "summary.json":
        try:
            if not json.loads(path.read_text())["interrupted"]:
                return True
        except (OSError, ValueError, KeyError, TypeError):
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
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError) as problem:
        why = f"{_place(path)} is not what `{part.verb}` writes ({type(problem).__name__}: {str(problem)[:80]})."
        return _missing(part, name, path.parent, [why])
    warnings = []
    if summary.get("interrupted"):
        warnings.append(
            "Interrupted: what had been measured by then. The same command goes on from there."
        )
    if path.parent.name.endswith("-short") or "--short" in summary.get("command", ""):
        warnings.append(f"A short run, for a first look{': ' * bool(said.extent)}{said.extent}.")
    return Section(part, name, path.parent, summary, said, warnings)


def _missing(part, name, folder, warnings):
    """The section of results that are not there."""
    return Section(
        part,
        name,
        folder,
        {},
        overview_pieces.Said(),
        [*warnings, f"No results; this makes them: python -m validation {part.verb}."],
    )


def _facts(sections):
    """Machine and versions: {what: {value: names of the sections that have it}}."""
    seen = {}
    for section in sections:
        for key, value in (
            section.summary.get("machine", {}) | section.summary.get("versions", {})
        ).items():
            if key not in (
                "load_at_start",
                "package",
                "fix_nosquish",
            ):  # the package stands beside each result
                seen.setdefault(key.replace("_", " "), {}).setdefault(value, []).append(
                    section.name
                )
    return seen


def common(sections):
    """With what all was measured, as far as the sections do not differ in it, in one line."""
    return ", ".join(
        f"{key} {value}"
        for key, values in _facts(sections).items()
        if len(values) == 1
        for value in values
    )


def differing(sections):
    """In which of the machine and versions the sections differ: {what: {value: names of the sections that have it}}."""
    return {key: values for key, values in _facts(sections).items() if len(values) > 1}


def circumstances(sections):
    """A ``overview_pieces.Table``: by which command each section was measured, and in what its machine and versions differ from others'."""
    seen, rows = differing(sections), []
    for section in sections:
        of_it = [
            ", ".join(str(value) for value, names in values.items() if section.name in names)
            or "not told"
            for values in seen.values()
        ]
        rows.append(
            [
                overview_pieces.Cell(text)
                for text in (
                    section.part.title,
                    *of_it,
                    _place(section.folder),
                    "; ".join(section.commands),
                )
            ]
        )
    return overview_pieces.Table("Each part", ("part", *seen, "results", "command"), rows)


def write(sections, path):
    """Write the page.

    Args:
        sections: list of `Section`.
        path: of the page.
    """
    found = [section for section in sections if section.folder]
    short = [(section, line) for section in found for line in section.said.short]
    page("overview.html", path, [], sections=sections, short=short, picture=picture, date=machine.now(), commit=commit(), common=common(found),
         differing=differing(found), circumstances=circumstances(found), renamed=" and ".join(overview.NAMES))  # fmt: skip


def picture(section, figure):
    """A section's ``overview_pieces.Figure``: its data, and why there is none."""
    path = section.folder / figure.file
    try:
        return light(path), None
    except FileNotFoundError:
        return None, f"{_place(path)} is not there."
    except (
        OSError,
        SyntaxError,
    ) as problem:  # what Pillow raises of a file that is no image, or is cut short
        return None, f"{_place(path)} cannot be shown: {problem}."


def _place(path):
    """A path as text, from the checkout where it is in it."""
    return (
        str(path.resolve().relative_to(ROOT)) if path.resolve().is_relative_to(ROOT) else str(path)
    )


def run_short(verb, out):
    """Run a verb's short form, in a process of its own so that its results tell its own command; whether a Ctrl-C ended it.

    It has a session of its own: a Ctrl-C comes here, and is passed on once.
    """
    command = [
        sys.executable,
        "-m",
        "validation",
        verb,
        "--short",
        *SHORT[verb],
        "--out",
        str(out.resolve()),
    ]
    process = subprocess.Popen(command, cwd=ROOT, start_new_session=True)
    try:
        process.wait()
    except KeyboardInterrupt:
        process.terminate()
        process.wait()
        return True
    return process.returncode == INTERRUPTED


def light(path):
    """A figure as base64 text of a PNG that is not larger than need be: no wider than `WIDEST`, with `COLOURS` colours, those of its areas kept.

    Raises:
        OSError, SyntaxError: the file is not a whole image.
    """
    original = Path(path).read_bytes()
    with Image.open(io.BytesIO(original)) as image:
        shape = image.size
        made = image.convert("RGB")
    made.thumbnail((WIDEST, shape[1]), Image.Resampling.LANCZOS)
    buffer = io.BytesIO()
    made.quantize(COLOURS, kmeans=1, dither=Image.Dither.NONE).save(buffer, "PNG", optimize=True)
    return base64.b64encode(min(original, buffer.getvalue(), key=len)).decode()


def commit():
    """The checkout's commit, and whether files differ from it; None if git does not know."""
    if not (ROOT / ".git").exists():
        return None
    try:
        words = [
            "git",
            "-C",
            str(ROOT),
            "describe",
            "--always",
            "--exclude=*",
            "--dirty= with changes",
            "--abbrev=12",
        ]
        told = subprocess.run(words, check=False, capture_output=True, text=True)
    except OSError:
        return None
    return told.stdout.strip() or None
