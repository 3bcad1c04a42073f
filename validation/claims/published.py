"""The spread of rigid water's energy at several time steps, compared with published numbers.

A. J. Silveira and C. R. A. Abreu, J. Chem. Phys. 150, 114110 (2019), integrated TIP3P water with
the free rotor's exact solution and forces that end smoothly; `inputs/water_smooth` has their
potential, except for how it ends.  Their paper plots the energies and prints no number for their
spread: `PUBLISHED` and its error are computed from the authors' files, as `ORIGINS` states number
by number.
"""

from collections.abc import Iterator

import numpy as np

from ..scenes import Scene, smooth_water, steps
from ..scenes.integrators import INTEGRATORS
from ..statistics import measures
from ..statistics.check import Check
from ..statistics.estimate import Estimate, combined
from .plan import FEW, Bench, Claims, Outputs, Simulation

SOURCE = "Silveira and Abreu, J. Chem. Phys. 150, 114110 (2019)"
# the authors' manuscript, and the data of its figures; commit 0ff8a20 and before
SERIES = "github.com/craabreu/rigid_nvt_paper"
FILE = "Figures/NVE_{:g}fs.csv"  # there: energies of their trajectories at constant energy
# fs: standard deviation of TotEng in `FILE`, kcal/mol
PUBLISHED = {1.0: 0.0603, 2.0: 0.2205, 3.0: 0.4871, 4.0: 0.8872}
ENERGIES = 667  # in each `FILE`, 9 ps apart: neighbours' correlation is below 0.06 in all four
THEIR_ERROR = 1 / np.sqrt(2 * ENERGIES)  # relative, because the energies are independent
# All four have the same energy, above its mean at 298 K, so they are warmer: the mean of TotEng of
# all four; E and Cv1 of Figures/S1.csv at 1 fs
ENERGY, ENERGY_AT_298, HEAT_CAPACITY = -6475.0, -6616.5, 17.5  # kcal/mol, kcal/mol, kcal/mol/K
TEMPERATURE = 298.0 + (ENERGY - ENERGY_AT_298) / HEAT_CAPACITY  # K
ORIGINS = {
    "standard deviations of the energy": "computed here: of TotEng in the authors' "
    f"Figures/NVE_1fs.csv to NVE_4fs.csv ({SERIES}); the paper draws these energies and prints no "
    "standard deviation",
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
PARTS = {
    "spread": "Standard deviation of the energy over the published one, 903 TIP3P molecules at "
    f"{TEMPERATURE:.0f} K",
}
# ps with a heat bath, then with one and averaged, then without; time step (fs) of all
BATH, MEAN, REST, BATH_DT = 4.0, 6.0, 1.0, 2.0
SHORT, FULL = 4.0, 48.0  # ps of each time step
SAMPLED = 12.0  # fs between samples of the energy


def scene() -> Scene:
    """Their water."""
    return smooth_water(
        "water-smooth",
        "903 TIP3P molecules at 0.97 g/cm³, smooth cutoff",
        "water_smooth",
        "smooth",
        903,
    )


def _time(bench: Bench) -> float:
    return bench.time or (FULL if bench.full else SHORT)


def plan(bench: Bench) -> list[Simulation]:
    """One trajectory that creates the start, and one with each time step, the longest first."""
    water, rest = scene(), steps(REST, BATH_DT)
    how: dict = {"scene": water, "ranks": bench.ranks}
    more = _to_the_mean(water.group)
    start: dict = {"dt": BATH_DT, "steps": rest, "every": 100, "state": rest, "more": more}
    ours = INTEGRATORS["nosquish"]
    simulations = [Simulation("start", "start", integrator=ours, **start, **how)]
    for dt in sorted(PUBLISHED, reverse=True):
        simulations.append(
            Simulation(
                f"{dt:g}-fs",
                f"{dt:g} fs",
                integrator=ours,
                dt=dt,
                steps=steps(_time(bench), dt),
                every=max(1, round(SAMPLED / dt)),
                start=("start", rest),
                **how,
            )
        )
    return simulations


def _to_the_mean(group):
    """LAMMPS commands that bring water to its mean energy at `TEMPERATURE`."""
    return (
        f"fix bath {group} langevin {TEMPERATURE} {TEMPERATURE} 100.0 7123",
        f"run {steps(BATH, BATH_DT)}",
        "variable energy equal etotal",
        f"fix mean {group} ave/time 1 1 1 v_energy ave running",
        f"run {steps(MEAN, BATH_DT)}",
        "unfix bath",
        # to the mean energy, not to a random one
        f"velocity {group} scale $(temp*(1.0+(f_mean-etotal)/ke))",
        "unfix mean",
        "reset_timestep 0",
    )


def judge(outputs: Outputs, bench: Bench) -> dict:
    """``checks`` against the published numbers, and ``time``."""
    return {"checks": [check.plain() for check in checks(outputs)], "time": _time(bench)}


def checks(outputs: Outputs) -> Iterator[Check]:
    """Yield a check for each time step (fs); if all spreads are known also one for their mean,
    weighted by their errors."""
    measured = []
    for dt, theirs in PUBLISHED.items():
        result = outputs.get(f"{dt:g}-fs")
        value, note = None, f"no complete run: {result.error if result else 'not begun'}"
        if result and not result.error:
            note = f"{len(result.total)} samples"
            if len(result.total) >= FEW:
                value, note = _over(result.time, result.total, theirs)
        measured.append(_check(f"{dt:g} fs", FILE.format(dt), value, note))
    yield from measured
    if all(check.value is not None for check in measured):
        weights = np.array([check.error for check in measured]) ** -2.0
        weights /= weights.sum()
        errors = ((weight * check.error, check.freedom) for weight, check in zip(weights, measured))
        yield _check(
            ALL,
            "all four",
            Estimate(weights @ [check.value for check in measured], *combined(*errors)),
        )


def _over(time, energy, theirs):
    """A standard deviation over theirs, and how it was obtained, in words."""
    spread, slope = measures.standard_deviation(energy), measures.drift(time, energy)
    other = Estimate(theirs, theirs * THEIR_ERROR)
    line = measures.about_line(time, energy).text()
    drifting = f", drifts by {slope.text()} kcal/mol/ps" * bool(abs(slope.value) > slope.margin)
    note = f"{spread.text()} (about its line {line}{drifting}) over {other.text()} kcal/mol"
    return measures.quotient(spread, other), note


def _check(subject, file, estimate, note=""):
    return Check.of(
        "spread",
        subject,
        "standard deviation of the total energy over the published one",
        estimate,
        note=note,
        source=f"{SOURCE}; theirs and its error computed here from TotEng in {file}, {SERIES}",
        low=1 - WITHIN,
        high=1 + WITHIN,
    )


CLAIMS = Claims(
    "The energy's spread beside published numbers",
    f"Is the standard deviation of the energy of water that of {SOURCE}?",
    f"comparisons, of a spread within {100 * WITHIN:g} % of the published one,",
    PARTS,
    plan,
    judge,
    notes=ORIGINS,
)
