"""The report of all verbs: finds their results, and writes what they say to one self-contained page, with their figures made light."""

import base64
import io
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from validation import machine, overview
from validation.report import page

WIDEST, COLOURS = 1400, 128  # of a figure: pixels; lines and text need no more
INTERRUPTED = 130  # exit status of a verb after a Ctrl-C
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
        said: what it ``overview.Said``.
        warnings: why something is missing.
    """

    part: overview.Part
    name: str
    folder: Path | None
    summary: dict
    said: overview.Said
    warnings: list

    @property
    def commands(self):
        """What makes these results, or would."""
        made = [self.summary["command"]] if "command" in self.summary else [f"python -m validation {self.part.verb}"]
        return self.said.commands or made


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
        sections += [_read(part, name, path) for name, path in found.items()] or [_missing(part, part.name, None, [])]
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
        summary = json.loads(path.read_text())
        said = part.says(summary)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError) as problem:
        why = f"{_place(path)} is not what `{part.verb}` writes ({type(problem).__name__}: {str(problem)[:80]})."
        return _missing(part, name, path.parent, [why])
    warnings = []
    if summary.get("interrupted"):
        warnings.append("Interrupted: what had been measured by then. The same command goes on from there.")
    if path.parent.name.endswith("-short") or "--short" in summary.get("command", ""):
        warnings.append(f"A short run, for a first look{': ' * bool(said.extent)}{said.extent}.")
    return Section(part, name, path.parent, summary, said, warnings)


def _missing(part, name, folder, warnings):
    """The section of results that are not there."""
    return Section(part, name, folder, {}, overview.Said([]), [*warnings, "No results: the command below makes them."])


def _facts(sections):
    """Machine and versions: {what: {value: names of the sections that have it}}."""
    seen = {}
    for section in sections:
        for facts in section.summary.get("machine", {}), section.summary.get("versions", {}):
            for key, value in facts.items():
                if key != "load_at_start":
                    seen.setdefault(key.replace("_", " "), {}).setdefault(value, []).append(section.name)
    return seen


def common(sections):
    """When, where and with what all was measured, as far as the sections do not differ in it, in one line; empty without results."""
    days = sorted({section.summary["date"][:10] for section in sections if "date" in section.summary})
    told = [f"{key} {value}" for key, values in _facts(sections).items() if len(values) == 1 for value in values]
    return ", ".join([f"Measured {' to '.join(dict.fromkeys((days[0], days[-1])))}", *told]) if days else ""


def differences(sections):
    """In what code and machines differ between the sections that have results, and what they do not tell of it; None if nothing."""
    seen, found = _facts(sections), [section for section in sections if section.summary]
    differing = [
        f"{key} " + ", ".join(f"{value} ({', '.join(names)})" for value, names in values.items()) for key, values in seen.items() if len(values) > 1
    ]
    told = {name for values in seen.get("package", {}).values() for name in values}
    silent = [section.name for section in found if section.name not in told]
    sentences = [f"Not all was measured with the same code on the same machine: {'; '.join(differing)}."] * bool(differing)
    sentences += [f"Which commit's code was measured is not told by: {', '.join(silent)}."] * bool(silent)
    return " ".join(sentences) or None


def write(sections, path):
    """Write the page.

    Args:
        sections: list of `Section`.
        path: of the page.
    """
    shown = {section.name: list(_figures(section)) for section in sections}
    page("overview.html", path, [], sections=sections, shown=shown, where=where, date=machine.now(), commit=commit(), common=common(sections),
         differences=differences(sections))  # fmt: skip


def _figures(section):
    """A section's figures: (data, or why there is none, the ``overview.Figure``) of each file."""
    for figure in section.said.figures:
        paths = sorted(section.folder.glob(figure.file))
        if not paths:
            yield None, f"{_place(section.folder / figure.file)} is not there.", figure
        for path in paths:
            try:
                yield light(path), None, figure
            except (OSError, SyntaxError) as problem:  # what Pillow raises of a file that is no image, or is cut short
                yield None, f"{_place(path)} cannot be shown: {problem}.", figure


def where(section):
    """When, where and with what a section's results were measured, in one line."""
    if not section.folder:
        return ""
    told = [pair for group in ("machine", "versions") for pair in section.summary.get(group, {}).items()]
    facts = [f"{key.replace('_', ' ')} {round(value, 2) if isinstance(value, float) else value}" for key, value in told]
    return " · ".join([f"Results: {_place(section.folder)}", *([f"measured {section.summary['date']}"] if "date" in section.summary else []), *facts])


def _place(path):
    """A path as text, from the checkout where it is in it."""
    return str(path.resolve().relative_to(ROOT)) if path.resolve().is_relative_to(ROOT) else str(path)


def run_short(verb, out):
    """Run a verb's short form, in a process of its own so that its results tell its own command; whether a Ctrl-C ended it.

    It has a session of its own: a Ctrl-C comes here, and is passed on once.
    """
    command = [sys.executable, "-m", "validation", verb, "--short", "--out", str(out.resolve())]
    process = subprocess.Popen(command, cwd=ROOT, start_new_session=True)
    try:
        process.wait()
    except KeyboardInterrupt:
        process.terminate()
        process.wait()
        return True
    return process.returncode == INTERRUPTED


def light(path):
    """A figure as base64 text of a PNG that is not larger than need be: no wider than `WIDEST`, with `COLOURS` colours.

    Raises:
        OSError, SyntaxError: the file is not a whole image.
    """
    original = Path(path).read_bytes()
    with Image.open(io.BytesIO(original)) as image:
        shape = image.size
        made = image.convert("RGB")
    made.thumbnail((WIDEST, shape[1]), Image.Resampling.LANCZOS)
    buffer = io.BytesIO()
    made.quantize(COLOURS, dither=Image.Dither.NONE).save(buffer, "PNG", optimize=True)
    return base64.b64encode(min(original, buffer.getvalue(), key=len)).decode()


def commit():
    """The checkout's commit, and whether files differ from it; None if git does not know."""
    if not (ROOT / ".git").exists():
        return None
    try:
        words = ["git", "-C", str(ROOT), "describe", "--always", "--exclude=*", "--dirty= with changes", "--abbrev=12"]
        told = subprocess.run(words, check=False, capture_output=True, text=True)
    except OSError:
        return None
    return told.stdout.strip() or None
