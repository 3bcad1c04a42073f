"""The figure of ``engines``."""

from ..pages.figures import Drawn
from ..sampling import figures
from ..statistics.estimate import SURE


def bias(summary: dict) -> Drawn:
    """Bias of each average against the time step, with some schemes of LAMMPS beside."""
    rows = [*summary["beside"], *summary["rows"]]
    figure, _ = figures.bias({"rows": rows}) or (None, "")
    if figure is None:
        return None
    return figure, (
        "Distance of averages from the limit of small steps: of LAMMPS's runs, or, where an "
        f"engine's forces are others, of its own. Whiskers: {SURE} intervals. Shaded: the bounds. "
        f"The axis is linear up to {figures.LINEAR} times them. Beside: rows of the verb sampling."
    )
