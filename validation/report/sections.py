"""The sections of the report of all verbs: which verb says each, and from what.

Nothing is measured or judged here, or by a verb's ``say``: numbers, errors and verdicts are those
of the summaries.
"""

from collections.abc import Callable
from dataclasses import dataclass

from ..breaks import report as breaks
from ..compare import report as compare
from ..engines import report as engines
from ..ensembles import report as ensembles
from ..long import report as long
from ..pages.said import Said
from ..paper import report as paper
from ..published import report as published
from ..sampling import report as sampling
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
    Part("theory", "Whether the theory holds", "theory", theory.say),
    Part("paper", "The paper's test problems again", "paper --full", paper.say),
    Part(
        "published",
        "The energy's spread beside published numbers",
        "published",
        published.say,
    ),
    Part(
        "ensembles*",
        "What thermostats and barostats with long steps sample",
        "ensembles --full",
        ensembles.say,
    ),
    Part(
        "sampling-*",
        "What averages cost with long steps",
        "sampling --full",
        sampling.say,
    ),
    Part("engines", "Averages in other engines", "engines --full", engines.say),
    Part("compare-*", "The same start with all fixes", "compare water", compare.say),
    Part("long-run", "A free body for very many steps", "long", long.say),
)
