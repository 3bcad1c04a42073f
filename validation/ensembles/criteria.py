"""The bounds of ``ensembles``, all in one place, and what is held against them.

They were set before the data: from what users need of a mean energy, a pressure and a density, and
from a trial of the same thermostats in another program.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from ..statistics.check import Check
from ..statistics.estimate import Estimate, combined
from .lengths import LEAST, Point
from .plan import (
    EQUAL_STEPS,
    KNOWN_STEPS,
    LIMIT_STEPS,
    MOMENTS_STEPS,
    SCHEMES,
    label,
)

OURS = [name for name, scheme in SCHEMES.items() if scheme.ours]
OURS_NVT = [name for name in OURS if SCHEMES[name].pressure is None]
OURS_NPT = [name for name in OURS if name not in OURS_NVT and not SCHEMES[name].first]
BESIDE_FIRST = [name for name in OURS if SCHEMES[name].first]
THEIRS_NPT = "shake+npt", "rigid/npt/small"
MODERATE = 2.0, 4.0, 6.0  # fs
MOLECULE = "kcal/mol a molecule"
TITLES = {
    "potential": "Bias of the mean potential energy",
    "trial": "The same bias beside that of a trial",
    "temperature": "Printed temperature",
    "equipartition": "Printed temperatures of translation and of rotation",
    "pressure": "Bias of the mean pressure",
    "density": "Bias of the mean density",
    "states": "Enthalpies at two temperatures, volumes at two pressures",
    "compressibility": "Compressibility from two pressures and from fluctuations",
}


class Bound(NamedTuple):
    """A row's number, and how far from ``around`` it may be at a point."""

    part: str
    key: str  # in `measure.Row`
    what: str
    unit: str
    scheme: str
    dt: float
    within: float
    around: float = 0.0


def _bounds(
    part: str, key: str, what: str, unit: str, within: Mapping[str, Mapping[float, float]]
) -> list[Bound]:
    """Of {scheme: {fs: how far from zero}}."""
    return [
        Bound(part, key, what, unit, scheme, dt, most)
        for scheme, those in within.items()
        for dt, most in those.items()
    ]


BOUNDS = [
    *_bounds(
        "potential", "bias", "bias of the mean potential energy", MOLECULE,
        {"langevin-5": {4.0: 0.010, 6.0: 0.018, 8.0: 0.025},
         "langevin-20": dict.fromkeys((4.0, 6.0, 8.0), 0.010),
         # what users accept today at 2 fs
         "langevin-20-equal": dict.fromkeys(EQUAL_STEPS, 0.006),
         "langevin-20-step": dict.fromkeys(MOMENTS_STEPS, 0.006)},
    ),
    *(
        Bound("temperature", "temperature", "mean of temp", "K", name, dt, 0.01 * aim, aim)
        for name in OURS for aim in [SCHEMES[name].temperature] for dt in KNOWN_STEPS[1:]
    ),
    *_bounds(
        "equipartition", "apart", "temperature of translation less that of rotation", "K",
        {"langevin-5": {4.0: 1.5, 6.0: 4.0}, "langevin-20": {4.0: 0.5, 6.0: 1.0},
         "npt-langevin": {4.0: 1.5, 6.0: 4.0}},
    ),
    *_bounds(
        "pressure", "pressure_bias", "bias of the mean pressure", "atm",
        dict.fromkeys(OURS_NVT, dict.fromkeys(MODERATE, 25.0))
        | {"langevin-20-equal": dict.fromkeys(EQUAL_STEPS, 25.0),
           "langevin-20-step": dict.fromkeys(MOMENTS_STEPS, 25.0)},
    ),
    # what is printed is the pressure that the barostat keeps, so the bound is that at constant
    # volume; 25 atm change the density of water by 0.1 %
    *_bounds(
        "pressure", "pressure_bias", "mean of press less the barostat's pressure", "atm",
        dict.fromkeys(OURS_NPT, dict.fromkeys(MODERATE, 25.0)),
    ),
    # what a density of water is trusted to; LAMMPS's schemes have to agree at short steps only
    # (at 2 fs since 2026-11-26, before there was a run of it)
    *_bounds(
        "density", "density_bias", "bias of the mean density", "%",
        dict.fromkeys(OURS_NPT, dict.fromkeys(MODERATE, 0.2))
        | dict.fromkeys(THEIRS_NPT, dict.fromkeys(LIMIT_STEPS, 0.2)),
    ),
    # two standard deviations: a right scheme is within them in 19 of 20 cases
    *_bounds(
        "states", "deviation", "slope of the ratio of distributions less the exact one", "sd",
        dict.fromkeys(BESIDE_FIRST, dict.fromkeys(MODERATE, 2.0)),
    ),
]  # fmt: skip
MISSING = {"deviation": "run longer: too few independent samples, no first state, or no overlap"}

# bias of the mean potential energy, kcal/mol a molecule, that the trial found, and its standard
# error: one number for all, the middle of the 0.003 to 0.006 that they have
TRIAL = {
    "langevin-5": {2.0: -0.003, 4.0: -0.005, 6.0: -0.014, 8.0: -0.020},
    "langevin-20": {6.0: -0.003, 8.0: -0.006},
    "csvr": {4.0: -0.004, 6.0: -0.011, 8.0: -0.032},
}
TRIAL_ERROR, APART = 0.0045, 2.0  # how many standard errors of both together they may be apart
UNSURE = 0.15  # of a compressibility, its standard error above which any other one agrees
TRIED = "a trial with 512 TIP3P molecules, a reaction field, 180 to 400 ps and one start a point"


Rows = Mapping[Point, Mapping[str, Any]]  # of each point that was run its `measure.Row` by name


def checks(rows: Rows, time: float) -> list[Check]:
    """What is held against the bounds, of points of so many ps; nothing if these are too few."""
    return [*_judged(rows), *_tried(rows), *_compressed(rows)] if time >= LEAST else []


def _judged(rows: Rows) -> Iterator[Check]:
    for one in BOUNDS:
        if (row := rows.get(Point(one.scheme, one.dt))) is not None:
            ends = {"low": one.around - one.within, "high": one.around + one.within}
            none = MISSING.get(one.key, "there is no reference")
            note = "" if row.get(one.key) else row.get("error") or none
            yield Check.of(
                one.part, label(Point(one.scheme, one.dt)), one.what, row.get(one.key),
                **ends, unit=one.unit, note=note,
            )  # fmt: skip


def _tried(rows: Rows) -> Iterator[Check]:
    what = "distance from the trial's bias, in standard errors of both"
    for scheme, those in TRIAL.items():
        for dt, theirs in those.items():
            if (row := rows.get(Point(scheme, dt))) is None:
                continue
            other = Estimate(theirs, TRIAL_ERROR)
            found = _distance(row, row.get("bias"), other, TRIAL_ERROR, f"{theirs:+.3f} {MOLECULE}")
            subject = label(Point(scheme, dt))
            yield Check.of(
                "trial", subject, what, found[0], high=APART, note=found[1], source=TRIED
            )


def _compressed(rows: Rows) -> Iterator[Check]:
    what = "distance between both compressibilities, in standard errors of both"
    for (scheme, dt), row in rows.items():
        one = SCHEMES[scheme]
        if scheme in BESIDE_FIRST and one.pressure != SCHEMES[one.first].pressure:
            other = row.get("fluctuations") or Estimate(1.0)
            told = f"{other.text()} of fluctuations, 1e-5/atm"
            found = _distance(row, row.get("two_pressures"), other, UNSURE * other.value, told)
            subject = label(Point(scheme, dt))
            yield Check.of("compressibility", subject, what, found[0], high=APART, note=found[1])


def _distance(
    row: Mapping, found: Estimate | None, other: Estimate, most: float, told: str
) -> tuple[float | None, str]:
    """Standard errors of both between two numbers, and what to say; None if either has an error
    above ``most``: a run that is short enough agrees with anything."""
    if not found:
        return None, row.get("error") or "there is nothing to hold it against"
    error, _ = combined(found[1:], other[1:])
    told = f"{found.text()} beside {told}"
    if max(found.error, other.error) > most:
        return None, f"{told}: run longer, for a standard error above {most:.2g} tells nothing"
    return abs(found.value - other.value) / error, told
