"""From the points of ``sample`` to files and the terminal."""

from pathlib import Path

from rich.console import Console

from ..pages import points
from ..pages.points import Part
from ..pages.said import Figure, Said, of_checks
from ..pages.tables import Column
from ..statistics.estimate import Estimate
from .criteria import BOUNDS, TITLES
from .figures import bias, precision
from .measure import NESTED
from .observables import BY_KEY, CONFIGURATIONS, OBSERVABLES
from .plan import LEAST

MEANS = (
    Column("means density", "density", "g/cm³", "estimate"),
    Column("means compressibility", "κ of V's sd", "1e-5/atm", "estimate"),
    Column("means two_pressures", "κ of two P", "1e-5/atm", "estimate"),  # of committed results
    Column("deviation", "two states", "sd", "estimate"),
)
BIASES = (
    *(Column(f"biases {one.key}", one.title, one.unit, "estimate") for one in OBSERVABLES),
    Column("rdf", "g(r)", "rms", "estimate"),
)
REMEMBERS = tuple(
    Column(f"remembers {key}", f"2τ of {BY_KEY[key].title}", "ps", "estimate")
    for key in CONFIGURATIONS
)
COSTS = (
    Column("cost", "cost", "s/ps"),
    *REMEMBERS,
    Column("sample", "sample of the slowest", "s", "estimate"),
)
CLOCK = Column("clock", "clock", "s/ps")
WORKS = (
    *(
        Column(f"seconds {key}", f"time of {BY_KEY[key].title} to ±{most:g}", "s", "interval")
        for key, most in BOUNDS.items()
    ),
    *(
        Column(f"faster {key}", f"times faster, {BY_KEY[key].title}", "times", "interval")
        for key in CONFIGURATIONS
    ),
)


def flat(row: dict) -> dict:
    """A row whose numbers of each observable stand beside the others."""
    more = {f"{name} {key}": one for name in NESTED for key, one in row[name].items()}
    return row | more


def parts(summary: dict) -> list[Part]:
    """The tables, with the columns that any row has a number in."""
    known = summary["known"]
    less = tuple(
        Column(f"less {one['scheme']}", f"less than {one['scheme']}", "times", "estimate")
        for one in known
    )
    rows = [flat(row) for row in summary["rows"]]
    every = {
        "Bias, from the limit of small steps": BIASES,
        "Means": MEANS,
        "What an independent sample costs": (*COSTS, *less, CLOCK),
        "Time to a total error": WORKS,
    }
    made = []
    for title, columns in every.items():
        some = tuple(one for one in columns if any(row.get(one.key) for row in rows))
        made += [Part(title, some, rows)] * bool(some)
    return made


def limits(summary: dict) -> list[str]:
    """The limits of small steps, and whether the points agree with a common one."""
    told = [of_limit(BY_KEY[key].title, one) for key, one in summary["limits"].items()]
    for engine, own in summary.get("others", {}).items():
        told += [of_limit(f"{engine}, {BY_KEY[key].title}", one) for key, one in own.items()]
    return told or [
        "No limit of small steps: it takes a scheme with two short steps, or one without error."
    ]


def of_limit(name: str, one: dict) -> str:
    """A limit, of `told_limit`, in a sentence."""
    text = f"{name}: the limit of small steps is {Estimate.of(one).text()}"
    schemes = len({scheme for scheme, *_ in one["points"]})
    text += f", of {len(one['points'])} points of {schemes} schemes"
    if one["left"]:
        agrees = "agree" if one["agrees"] else "do NOT agree"
        text += f", which {agrees} with it: χ² is {one['chi2']:.1f} with {one['left']} degrees "
        text += f"of freedom, probability {one['probability']:.2g}"
    return text + "."


def _told(summary):
    failed = summary.get("lost", {}).items()  # a former summary does not tell
    lost = (f"No average has start {number}, which failed: {why}." for number, why in failed)
    short = ""
    if summary["settings"]["time"] < LEAST:
        short = (
            f"Nothing is held against bounds, for points of less than {LEAST:g} ps do not tell "
            "their own errors."
        )
    return {"titles": TITLES, "limits": [*limits(summary), *lost], "too_short": short}


def write(summary: dict, out: Path) -> None:
    """Write summary.json, table.csv, checks.csv, figures and report.html into a folder.

    Args:
        summary: plain data: ``rows``, ``limits``, ``checks``, settings and circumstances.
    """
    made, rows = parts(summary), [flat(row) for row in summary["rows"]]
    table = points.frame(rows, (one for part in made for one in part.columns))
    table["slowest"] = [row["slowest"] for row in rows]
    drawn = precision, bias
    points.write(summary, out, table, "sample.html", drawn, made, **_told(summary))


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the points, the limits, the checks, what failed and where the files are."""
    points.show(console, summary, out, parts(summary), **_told(summary))


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    noun = "statements about the error and the cost of averages with long steps"
    figures = [
        Figure("precision.png", "Total error of averages against the time that is spent."),
        Figure("bias.png", "Bias of averages against the time step."),
    ]
    return of_checks(summary, TITLES, noun, lines=_told(summary)["limits"], figures=figures)
