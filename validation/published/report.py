"""From the checks of ``published`` to files and the terminal."""

from validation.pages.figures import draw_each
from validation.pages.page import page, save
from validation.published.figures import spread
from validation.published.measure import ORIGINS, SOURCE, TEMPERATURE, THEIR_ERROR, TITLES
from validation.statistics import check
from validation.statistics.estimate import margin


def write(summary, made, out):
    """Write summary.json, table.csv, the figure and report.html into the folder ``out``.

    Args:
        summary: plain data: ``checks``, ``interrupted`` and the circumstances.
        made: the checks themselves.
    """
    save(summary, out)
    check.write(summary["checks"], out / "table.csv")
    page("published.html", out / "report.html", draw_each((spread,), out, made), summary=summary, titles=TITLES, source=SOURCE, origins=ORIGINS,
         temperature=TEMPERATURE, their_margin=margin(THEIR_ERROR))  # fmt: skip


def show(console, summary, out) -> None:
    """Print the checks, and where the files are."""
    check.show(console, summary["checks"], TITLES)
    console.print(f"{out}/report.html and the numbers beside it", soft_wrap=True)
