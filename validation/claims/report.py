"""The report of `claims`."""

from importlib import import_module

from ..pages import Report
from ..statistics.check import VERDICTS
from .plan import Claims


def claims_of(name: str) -> Claims:
    """The list of claims of this name."""
    return import_module(f".{name}", __package__).CLAIMS


def describe(summary: dict) -> Report:
    """The report: the answer, all checks, and the list's further tables."""
    claims = claims_of(summary["claims"])
    return Report(
        claims.title,
        claims.question,
        _answer(claims, summary),
        tables=claims.tables(summary),
        checks=summary["checks"],
        parts=claims.parts,
        checks_file=claims.checks_file,
        notes=claims.notes,
        failures=[f"{name}: {why}" for name, why in summary.get("failed", {}).items()],
    )


def _answer(claims: Claims, summary: dict) -> str:
    """Say how many checks hold, and which parts have checks that do not, or that are open."""
    parts: dict[str, list[str]] = {verdict: [] for verdict in VERDICTS}
    for check in summary["checks"]:
        if check["verdict"]:
            parts[check["verdict"]].append(claims.parts[check["part"]])
    held, lost, unknown = parts.values()
    text = f"{len(held)} of {len(held + lost + unknown)} {claims.noun} hold"
    for words, group in ("do not", lost), ("are undecided", unknown):
        where = ", ".join(f"{part} ({group.count(part)})" for part in dict.fromkeys(group))
        text += f"; {len(group)} {words}: {where}" if group else ""
    return f"{text}."
