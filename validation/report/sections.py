"""The sections of the report of all verbs: which verb says each, and from what.

Nothing is measured or judged here, or by a verb's ``say``: numbers, errors and verdicts are those
of the summaries.
"""

from collections.abc import Callable
from dataclasses import dataclass

from ..bench import report as bench
from ..breaks import report as breaks
from ..compare import report as compare
from ..long import report as long
from ..pages.said import Said
from ..paper import report as paper
from ..published import report as published
from ..sample import report as sample
from ..scaling import report as scaling
from ..stability import section as stability
from ..sweep import section as sweep
from ..theory import report as theory

# what summaries call a scheme: what the page calls it
NAMES = {"reference 12": "Matubayasi-Nakahara"}


@dataclass(frozen=True)
class Part:
    """A verb whose results the report gathers."""

    name: str  # of its folder, or a pattern for several; a short run's has ``-short`` behind it
    title: str  # heading
    verb: str  # words after ``python -m validation`` that make the results
    says: Callable[[dict], Said]  # from a summary


PARTS = (
    Part("sweep", "What to use", "sweep", sweep.say),
    Part("stability", "What breaks where", "stability", stability.say),
    Part("breaks", "What breaks others", "breaks", breaks.say),
    Part("bench", "What it costs", "bench", bench.say),
    Part("theory", "Whether the theory holds", "theory", theory.say),
    Part("paper", "The paper's test problems again", "paper --full", paper.say),
    Part(
        "published",
        "The energy's spread beside published numbers",
        "published",
        published.say,
    ),
    Part("sample-*", "What averages cost with their error", "sample --full", sample.say),
    Part("compare-*", "The same start with all fixes", "compare water", compare.say),
    Part("long-run", "A free body for very many steps", "long", long.say),
    Part("scaling", "What ranks send each other", "scaling", scaling.say),
)
