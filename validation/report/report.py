"""The page of all results: the reader's question and its answer, one figure, our defeats,
and then the report of each verb."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from .. import CHECKOUT, NAME, RESULTS
from ..pages import Report, Section
from ..pages.contents import MARGINS
from ..pages.rendering import page
from ..sample import answers
from . import replacements

TITLE = "Rigid bodies in LAMMPS: time step, speed-up and error"
ORDER = "sample", "compare", "stress", "cost", "claims", "check"  # of the verbs' sections
ROWS = 6  # of the longest table on this page; longer ones are in folders
BROKEN = OSError, ValueError, KeyError, TypeError, AttributeError, IndexError  # of any file


def gather(results: Path) -> tuple[list[Section], list[str]]:
    """The reports of all verbs, and what could not be read.

    Args:
        results: folder of results; missing ones are read from `RESULTS`.
    """
    paths: dict[str, Path] = {}
    for root in RESULTS, results:
        for pattern in "*/summary.json", "*/*/summary.json":
            files = sorted(root.glob(pattern))
            paths |= {path.parent.relative_to(root).as_posix(): path for path in files}
    sections, problems = [], []
    for name, path in paths.items():
        try:
            summary = json.loads(path.read_text())
            verb, report = report_of(summary)
        except (*BROKEN, ImportError) as problem:
            problems.append(f"{_place(path)}: {type(problem).__name__}: {str(problem)[:90]}")
        else:
            place = ORDER.index(verb) if verb in ORDER else len(ORDER)
            sections.append((place, Section(report, summary, path.parent, name)))
    return [section for _, section in sorted(sections, key=lambda pair: pair[0])], problems


def report_of(summary: Mapping) -> tuple[str, Report]:
    """The verb of a summary, and its report."""
    verb = summary["command"].split()[1]  # of "nosquish VERB ..."
    return verb, import_module(f"{NAME}.{verb}.report").describe(summary)


def _place(path: Path) -> str:
    """A path as text, relative to the checkout if it is in it."""
    whole = path.resolve()
    return str(whole.relative_to(CHECKOUT) if whole.is_relative_to(CHECKOUT) else path)


def write(sections: Sequence[Section], problems: Sequence[str], path: Path) -> None:
    """Write the page."""
    summaries = [section.summary for section in sections]
    best = answers.table(summaries)
    lost = [
        *answers.defeats(best.rows),
        *(text for section in sections for text in section.report.defeats),
    ]
    page(
        path,
        TITLE,
        [_brief(section) for section in sections],
        "overview.html",
        first=replacements.table(summaries),
        best=best,
        data=answers.figure(summaries),
        defeats=lost,
        problems=problems,
        definitions={"±": MARGINS}
        | dict(pair for section in sections for pair in section.report.notes.items()),
    )


def _brief(section: Section) -> Section:
    """Shorten a section: without long tables and common notes; of numbers with bounds only those
    that do not hold or are open."""
    tables = [
        table for table in section.report.tables if not table.long and len(table.rows) <= ROWS
    ]
    report = replace(section.report, tables=tables, notes={}, parts={})
    summary = dict(section.summary)
    for part, words in ("machine", {"cpu"}), ("versions", {"lammps", "fix_nosquish", "package"}):
        summary[part] = {key: text for key, text in summary[part].items() if key in words}
    return section._replace(report=report, summary=summary)
