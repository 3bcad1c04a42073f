"""From the points of ``ensembles`` to files and the terminal."""

from pathlib import Path

from rich.console import Console

from ..pages import points
from ..pages.points import Part
from ..pages.said import Figure, Said, of_checks
from ..pages.tables import Column, cell
from .criteria import MOLECULE, TITLES
from .figures import bias, density
from .lengths import Point, beside_tables
from .plan import BESIDE, REFERENCES, SCHEMES, beside_which, label

TEMPERATURES = (
    Column("temperature", "temp", "K", "estimate"),
    Column("translation", "T_trans", "K", "estimate"),
    Column("rotation", "T_rot", "K", "estimate"),
    Column("apart", "T_trans − T_rot", "K", "estimate"),
)
ALL = (
    Column("distribution", "K", "sd"),
    Column("cost", "cost", "s/ps"),
)
BIAS = Column("bias", "bias of U/N", "kcal/mol", "estimate")
PRESSURE_BIAS = Column("pressure_bias", "bias of P", "atm", "estimate")
DENSITY_BIAS = Column("density_bias", "bias of ρ", "%", "estimate")
DRIFT = Column("drift", "drift", "kcal/mol/ps", "estimate")
DENSITY = Column("density", "density", "g/cm³", "estimate")
COMPRESSIBILITIES = (
    Column("compressibility", "κ of V's sd", "1e-5/atm", "estimate"),
    Column("two_pressures", "κ of two P", "1e-5/atm", "estimate"),
    Column("deviation", "two states", "sd", "estimate"),
)
MEANS = (
    Column("potential", "potential energy", MOLECULE, "estimate"),
    Column("pressure", "pressure", "atm", "estimate"),
)
NVT = (BIAS, *TEMPERATURES, PRESSURE_BIAS, DRIFT, *ALL)
NPT = (DENSITY, DENSITY_BIAS, BIAS, *COMPRESSIBILITIES, *TEMPERATURES, PRESSURE_BIAS, *ALL)
COLUMNS = (*MEANS, *dict.fromkeys((*NVT, *NPT)))
LONG = "translation", "rotation"  # not in the terminal
# of each reference: what is told of it, and what of the point beside it
TOLD = (MEANS, (BIAS, PRESSURE_BIAS)), ((DENSITY, MEANS[0]), (DENSITY_BIAS, BIAS))


def limits(summary: dict) -> list[str]:
    """What the references' means are, and how near these are to the limit of small steps."""
    found = {(row["scheme"], row["dt"]): row for row in summary["rows"] if not row["error"]}
    return [
        _limit(found, reference, *told)
        for reference, told in zip(REFERENCES, TOLD)
        if any(beside_which(Point(*point)) == reference for point in found)
    ]


def _limit(found, reference, means, biases):
    if (one := found.get(reference)) is None:
        return f"The reference, {label(reference)}, was not measured: there are no biases from it."
    told = [f"{cell(one, column)} {column.unit} ({column.title})" for column in means]
    said = f"The reference, {label(reference)}, has {' and '.join(told)}. "
    beside = reference._replace(dt=BESIDE)
    if (two := found.get(beside)) is None:
        return said + f"How near it is to the limit is not known without {label(beside)}."
    told = [f"{cell(two, column)} {column.unit}" for column in biases]
    return said + f"{BESIDE:g} fs are apart from it by {' and '.join(told)}."


def parts(summary: dict) -> list[Part]:
    """The tables at constant volume and at constant pressure."""
    split: tuple[list[dict], list[dict]] = [], []
    for row in summary["rows"]:
        split[SCHEMES[row["scheme"]].pressure is not None].append(row)
    titles = "Constant volume", "Constant pressure"
    return [Part(*one) for one in zip(titles, (NVT, NPT), split) if one[2]]


def _told(summary):
    return beside_tables(summary, TITLES, limits(summary))


def write(summary: dict, out: Path) -> None:
    """Write summary.json, table.csv, checks.csv, figures and report.html into a folder.

    Args:
        summary: plain data: ``rows``, ``checks``, settings and circumstances.
    """
    table, drawn = points.frame(summary["rows"], COLUMNS), (bias, density)
    told = _told(summary)
    points.write(summary, out, table, "ensembles.html", drawn, parts(summary), **told)


def show(console: Console, summary: dict, out: Path) -> None:
    """Print the points, the checks, what failed and where the files are."""
    points.show(console, summary, out, parts(summary), **_told(summary), hidden=LONG)


def say(summary: dict) -> Said:
    """For the report of all verbs."""
    noun = "statements about what thermostats and barostats with long steps sample"
    figures = [
        Figure("bias.png", "Bias of the mean potential energy against the time step."),
        Figure("density.png", "Bias of the mean density against the time step."),
    ]
    return of_checks(summary, TITLES, noun, lines=_told(summary)["limits"], figures=figures)
