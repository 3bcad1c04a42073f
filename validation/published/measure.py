"""The spread of energy and shadow energy of rigid water at several time steps, beside published
numbers.

A. J. Silveira and C. R. A. Abreu, J. Chem. Phys. 150, 114110 (2019), integrated TIP3P water with
the free rotor's exact solution and forces that end smoothly; `inputs/water_smooth` has their
potential, but for the form of its end.  Their paper draws the energies and prints no number of
their spread: `PUBLISHED` and its error are worked out from the authors' files, as `ORIGINS` says
number by number.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..running import run
from ..running.trajectory import SHADOW, WHOLE, Series, Trajectory, do
from ..scenes import Scene, smooth_water, steps
from ..scenes.integrators import Integrator, nosquish
from ..statistics import measures
from ..statistics.check import Check
from ..statistics.estimate import Estimate, combined

SOURCE = "Silveira and Abreu, J. Chem. Phys. 150, 114110 (2019)"
# the authors' manuscript, and the data of its figures; commit 0ff8a20 and before
SERIES = "github.com/craabreu/rigid_nvt_paper"
FILE = "Figures/NVE_{:g}fs.csv"  # there: energies of their trajectories of constant energy
# fs: standard deviation of TotEng in `FILE`, kcal/mol
PUBLISHED = {1.0: 0.0603, 2.0: 0.2205, 3.0: 0.4871, 4.0: 0.8872}
ENERGIES = 667  # in each `FILE`, 9 ps apart: neighbours' correlation is below 0.06 in all four
# kcal/mol: of Hs there, their shadow energy
PUBLISHED_SHADOW = {1.0: 0.00438, 2.0: 0.0352, 3.0: 0.0997, 4.0: 0.306}
THEIR_ERROR = 1 / np.sqrt(2 * ENERGIES)  # of these, relative, for they do not depend on each other
# All four have one energy, above its mean at 298 K, so they are warmer: the mean of TotEng of all
# four; E and Cv1 of Figures/S1.csv at 1 fs
ENERGY, ENERGY_AT_298, HEAT_CAPACITY = -6475.0, -6616.5, 17.5  # kcal/mol, kcal/mol, kcal/mol/K
TEMPERATURE = 298.0 + (ENERGY - ENERGY_AT_298) / HEAT_CAPACITY  # K
ORIGINS = {
    "standard deviations of the energy": "computed here: of TotEng in the authors' "
    f"Figures/NVE_1fs.csv to NVE_4fs.csv ({SERIES}); the paper draws these energies and prints no "
    "standard deviation",
    "standard deviations of the shadow energy": "computed here: of Hs in the same files",
    "their errors": f"computed here: 1/√(2·{ENERGIES}) of each, for {ENERGIES} energies that do "
    "not depend on each other",
    "903 molecules, 970 kg/m³, cutoff 10 Å from 9.5 Å on, erfc(0.29 r/Å)": "the authors' "
    f"manuscript, as in the paper (rigid_bodies.tex, {SERIES})",
    "parameters of the potential": "the input of the authors' program "
    "(github.com/craabreu/rigid_nvt); the paper cites TIP3P's first ones",
    f"temperature, {TEMPERATURE:.0f} K": "computed here: from the mean of these energies, and from "
    f"energy and heat capacity at 298 K in Figures/S1.csv ({SERIES})",
}
WITHIN = 0.10  # of the published numbers
ALL = "all"  # time steps together
TITLES = {
    "spread": "Standard deviation of the energy over the published one, 903 TIP3P molecules at "
    f"{TEMPERATURE:.0f} K",
    "shadow": "Standard deviation of the shadow energy over the published one, the same runs",
}

# ps with a heat bath, then with one and averaged, then without; time step (fs) of all
BATH, MEAN, REST, BATH_DT = 4.0, 6.0, 1.0, 2.0
PS_PER_NS = 1000.0
SAMPLED = 12.0  # fs between samples of the energy


def scene() -> Scene:
    """Their water."""
    title = "903 TIP3P molecules at 0.97 g/cm³, smooth cutoff"
    return smooth_water("water-smooth", title, "water_smooth", "smooth", 903)


def ours(words: str = "", scheme: str = "NVE") -> Integrator:
    """What moves it, with the keywords ``words``: NVE, or `Shadowed`, with the same steps."""
    return nosquish("nosquish", "fix_nosquish.NVE", words, scheme)


def total(time: float) -> int:
    """Steps of all runs together; time in ps."""
    return steps(BATH + MEAN + REST, BATH_DT) + sum(steps(time, dt) for dt in PUBLISHED)


def published(
    out: Path, time: float, ranks: int, silence: float, meter: run.Meter
) -> tuple[dict[float, Series], bool]:
    """Run what is not there yet.

    Args:
        time: ps of each time step.
        silence: s without a sign of life after which a run is given up.

    Returns:
        by time step (fs), of those that were begun; whether a Ctrl-C ended it.
    """
    how: dict = {"scene": scene(), "integrator": ours(), "ranks": ranks}
    how["piece"] = WHOLE
    rest, more = steps(REST, BATH_DT), _to_the_mean(scene().group)
    start = Trajectory("start", "start", dt=BATH_DT, steps=rest, every=100, more=more, **how)
    first, interrupted = do(start, out, silence, meter)
    if first.error:
        return dict.fromkeys(PUBLISHED, first), interrupted
    found: dict[float, Series] = {}
    for dt in sorted(PUBLISHED, reverse=True):
        every = max(1, round(SAMPLED / dt))
        how |= {"steps": steps(time, dt), "every": every, "more": (*run.thermo(SHADOW),)}
        how["integrator"] = ours(f" every {every}", "Shadowed")
        one = Trajectory(f"{dt:g}-fs", f"{dt:g} fs", dt=dt, start=start.end(out), **how)
        found[dt], interrupted = do(one, out, silence, meter)
        if interrupted:
            break
    return found, interrupted


def _to_the_mean(group):
    """LAMMPS commands that bring water to the energy that it has on average at `TEMPERATURE`."""
    return (
        f"fix bath {group} langevin {TEMPERATURE} {TEMPERATURE} 100.0 7123",
        f"run {steps(BATH, BATH_DT)}",
        "variable energy equal etotal",
        f"fix mean {group} ave/time 1 1 1 v_energy ave running",
        f"run {steps(MEAN, BATH_DT)}",
        "unfix bath",
        # to the mean energy, not the one that chance has left
        f"velocity {group} scale $(temp*(1.0+(f_mean-etotal)/ke))",
        "unfix mean",
        "reset_timestep 0",
    )


def checks(found: dict[float, Series]) -> list[Check]:
    """What was found over what is published, for each time step (fs); where all are known, their
    mean too, each weighted by what it is worth."""
    made, shadows = list(_each(found)), list(_shadows(found))
    if all(one.value is not None for one in made):
        weights = np.array([one.error for one in made]) ** -2.0
        weights /= weights.sum()
        parts = ((weight * one.error, one.freedom) for weight, one in zip(weights, made))
        mean = weights @ [one.value for one in made]
        made.append(_check(ALL, "all four", Estimate(mean, *combined(*parts))))
    return made + shadows


def _each(found) -> Iterator[Check]:
    for dt, theirs in PUBLISHED.items():
        result, value = found.get(dt), None
        note = f"no complete run: {result.error if result else 'not begun'}"
        if result and not result.error:
            time, energy = result.time, result.total
            spread = measures.standard_deviation(energy)
            other = Estimate(theirs, theirs * THEIR_ERROR)
            value, line = measures.quotient(spread, other), measures.about_line(time, energy)
            slope = measures.drift(time, energy)
            told = f", drifts by {slope.text()} kcal/mol/ps"
            drifts = told if abs(slope.value) > slope.margin else ""
            note = f"{spread.text()} (about its line {line.text()}{drifts}) over {other.text()}"
            note += " kcal/mol"
        yield _check(f"{dt:g} fs", FILE.format(dt), value, note)


def _shadows(found) -> Iterator[Check]:
    for dt, theirs in PUBLISHED_SHADOW.items():
        result, value = found.get(dt), None
        note = f"no complete run: {result.error if result else 'not begun'}"
        if result and not result.error:
            known = np.isfinite(result.shadow)  # three steps tell it first
            time, energy = result.time[known], result.shadow[known]
            spread, slope = measures.standard_deviation(energy), measures.drift(time, energy)
            value = measures.quotient(spread, Estimate(theirs, theirs * THEIR_ERROR))
            drifts = slope.times(PS_PER_NS)
            note = f"{spread.text()} over {theirs:.3g} kcal/mol, drifts by {drifts.text()} a ns"
        yield _check(f"{dt:g} fs", FILE.format(dt), value, note, "shadow")


def _check(subject, file, found, note="", part="spread"):
    name, column = ("total", "TotEng") if part == "spread" else ("shadow", "Hs")
    what = f"standard deviation of the {name} energy over the published one"
    source = f"{SOURCE}; theirs and its error computed here from {column} in {file}, {SERIES}"
    # ours may be better: its derivatives in time are others
    low = 1 - WITHIN if part == "spread" else None
    high = 1 + WITHIN if part == "spread" else 1.0
    how = {"low": low, "high": high, "note": note, "source": source}
    return Check.of(part, subject, what, found, **how)
