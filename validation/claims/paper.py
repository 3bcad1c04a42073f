"""The paper's test problems, section III: the water dimer, liquid water and the peptide of its
figures, and its statements about them.

The paper's measure is Delta E(t) = [E(t) - <E>] / |<E>|, with the averages along the trajectory
(caption of figure 2); its average is here the mean of |Delta E|.  |<E>| depends on the zero of
energy and on the number of molecules, which the paper does not state.

Only complete trajectories are judged, except for those of Gear's scheme.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ..pages import Column, Table
from ..scenes import FS_PER_PS, SCENES, Scene, constrained_peptide, steps
from ..scenes.integrators import INTEGRATORS, PAPER
from ..statistics import measures
from ..statistics.check import Check
from ..statistics.estimate import Estimate, plain
from .plan import FEW, Bench, Claims, Outputs, Series, Simulation

Pairs = list[tuple[Series, ...]]  # of trajectories from the same start

PARTS = {
    "dimer": "The light water dimer, figure 2a",
    "liquid": "Liquid water, figure 2b",
    "peptide": "The peptide in water, figure 3",
    "gear": "Gear's scheme",
}
# The paper's statements, in its words; no number is read off its figures.
STATEMENTS = {
    "dimer": "Section III, figure 2a: NO_SQUISH is more accurate than Ref. 12 but both methods are "
    "stable at long times.",
    "liquid": "Section III, figure 2b: similar trends; the phase space volume preserving "
    "integrator performs well but not as well as the symplectic NO_SQUISH.",
    "peptide": "Section III, figure 3: NO_SQUISH and SHAKE/RATTLE perform well and the average "
    "energy conservation measure is about 1e-5 for both methods.",
    "gear": "Section IV: far more accurate than standard Gear predictor corrector or Runge-Kutta "
    "methods.",
}
AVERAGE_MEASURE = 1e-5  # of figure 3, section III
DIMER_DT, DT = 0.3, 3.0  # fs, of figure 2a, and of figures 2b and 3
OTHER = "matubayasi-nakahara"
SIDE = 8  # parts of a trajectory, for the error of a ratio
SURE_DRIFT = 2.5  # margins (95 %) of a drift that counts as significant
LOST = 0.05  # largest fraction of Richardson's drift that another one may be
# "far more accurate", "about": one order of magnitude, and the same one
FAR, NEAR = 10.0, np.sqrt(10.0)
EQUAL = 0.15  # distance of a ratio from 1
# steps after which Gear's scheme, started with a free body's derivatives, has correct ones; its
# energy changes abruptly in them
BEGINNING = 20
OVER = "reference 12 over NO_SQUISH"


# ---- what is run


class Lengths(NamedTuple):
    """Lengths of the trajectories, in ps.

    Attributes:
        dimer: each trajectory of the dimer.  starts: their number.
        apart: time between two starts.
        liquid: 1,000 waters.
        peptide: figure 3's trajectories.
        drifting: the peptide with ``rigid/small``.
        gear: Gear's trajectories of the liquid and the peptide.
        gear_starts: number of starts of the dimer with Gear's scheme.
        every: default number of steps between samples of the energy.
    """

    dimer: float
    starts: int
    apart: float
    liquid: float
    peptide: float
    drifting: float
    gear: float
    gear_starts: int
    every: int


SHORT = Lengths(50.0, 10, 60.0, 3.6, 3.6, 2.4, 0.15, 4, 10)
# the paper's, except for figure 2b's 6,000 ps of the liquid
FULL = Lengths(300.0, 32, 1000.0, 3000.0, 300.0, 30.0, 2.0, 4, 50)


def _lengths(bench: Bench) -> Lengths:
    usual = FULL if bench.full else SHORT
    return usual._replace(liquid=bench.time) if bench.time else usual


def plan(bench: Bench) -> list[Simulation]:
    """All trajectories, in the order in which they run: those of figures 2a and 3, then those of
    figure 2b."""
    lengths, peptide, liquid = _lengths(bench), constrained_peptide(), SCENES["water"]
    make = partial(_simulation, bench, lengths)
    simulations = [*_dimers(make, lengths)]
    for name in "nosquish", "shake", "rigid/nve/small":
        simulations.append(make(peptide, name, lengths.peptide))
    simulations.append(make(peptide, "rigid/small", lengths.drifting))
    simulations += [make(scene, "gear", lengths.gear, every=2) for scene in (liquid, peptide)]
    return simulations + [make(liquid, name, lengths.liquid) for name in ("nosquish", OTHER)]


def _simulation(
    bench: Bench, lengths: Lengths, scene: Scene, integrator: str, time: float, **more
) -> Simulation:
    """A simulation of so many ps with an integrator; ``more`` overrides the usual settings."""
    who = (INTEGRATORS | PAPER)[integrator]
    usual: dict = {
        "name": f"{scene.name}-{integrator}",
        "label": f"{scene.name}, {who.label}",
        "every": lengths.every,
        "ranks": bench.ranks,
        "dt": DT,
        "steps": steps(time, more.get("dt", DT)),
        "may_fail": integrator == "gear",
    }
    return Simulation(scene=scene, integrator=who, **usual | more)


def _dimers(make: Callable[..., Simulation], lengths: Lengths) -> Iterator[Simulation]:
    """Yield figure 2a's trajectories: from several starts of one trajectory; Gear's scheme from the
    first ones only."""
    scene, how = SCENES["dimer"], {"ranks": 1, "dt": DIMER_DT}
    apart, starts = steps(lengths.apart, DIMER_DT), "dimer-starts"
    named = {"name": starts, "label": "dimer, starts", "every": 1000, "state": apart}
    yield make(scene, "nosquish", 0.0, steps=lengths.starts * apart, **named, **how)
    for number in range(1, lengths.starts + 1):
        names = "nosquish", OTHER, *["gear"] * (number <= lengths.gear_starts)
        for name in names:
            named = {
                "name": f"dimer-{name}-{number}",
                "label": f"dimer {number}, {PAPER[name].label}",
                "start": (starts, number * apart),
                "every": 2 * lengths.every,
            }
            yield make(scene, name, lengths.dimer, **named, **how)


# ---- checks of the statements


def judge(outputs: Outputs, bench: Bench) -> dict:
    """The numbers of all trajectories, complete or not, as plain data: ``rows``, ``checks``,
    ``lengths``."""
    whole = {
        name: trajectory
        for name, trajectory in outputs.items()
        if not trajectory.error and len(trajectory.total) >= FEW
    }
    checks = *_dimer(whole), *_liquid(whole), *_peptide(whole), *_gear(outputs, whole)
    return {
        "rows": [row(trajectory) for trajectory in outputs.values()],
        "checks": [check.plain() for check in checks],
        "lengths": _lengths(bench)._asdict(),
    }


def row(trajectory: Series) -> dict:
    """The numbers of one trajectory; those that could not be measured are absent."""
    simulation = trajectory.simulation
    numbers = {
        "name": simulation.name,
        "scene": simulation.scene.name,
        "integrator": simulation.integrator.label,
        "lines": simulation.integrator.commands(simulation.scene),
        "dt": simulation.dt,
        "error": trajectory.error,
        "ps": float(trajectory.time[-1]) if len(trajectory.time) else 0.0,
        "seconds": trajectory.seconds,
    }
    if len(trajectory.total) >= FEW:
        numbers |= {
            "temperature": measures.mean(trajectory.temperature),
            "energy": float(trajectory.total.mean()),
            "sd": measures.standard_deviation(trajectory.total),
            "sd_line": measures.about_line(trajectory.time, trajectory.total),
            "measure": measures.mean(measure(trajectory.total)),
            "drift": measures.drift(trajectory.time, trajectory.total),
        }
    return plain(numbers)


def measure(total: np.ndarray) -> np.ndarray:
    """|Delta E| of each sample."""
    return np.abs(total - total.mean()) / abs(total.mean())


# ---- of several trajectories


def _length(*series: Series) -> str:
    """The length of the shortest one, in words."""
    return f"{min(trajectory.time[-1] for trajectory in series):.4g} ps"


def _shortest(pair: Sequence[Series]) -> int:
    return min(len(trajectory.total) for trajectory in pair)


def _dimer_pairs(whole: Outputs, second: str) -> Pairs:
    """Dimers of NO_SQUISH and of another integrator from the same starts."""
    names = [(f"dimer-nosquish-{n}", f"dimer-{second}-{n}") for n in range(1, 1 + len(whole))]
    return [
        (whole[first], whole[other]) for first, other in names if {first, other} <= whole.keys()
    ]


def _ratio(pairs: Pairs, of: Callable[[Series], float]) -> Estimate:
    """A number of the second trajectory over that of the first one: mean of all pairs, with the
    error from their scatter."""
    return measures.ratio(*([of(trajectory) for trajectory in series] for series in zip(*pairs)))


def _drift(series: Sequence[Series]) -> Estimate:
    """The mean drift of trajectories; with several starts its error is from their scatter."""
    fits = [measures.drift(trajectory.time, trajectory.total) for trajectory in series]
    return fits[0] if len(fits) == 1 else measures.mean_of_few([fit.value for fit in fits])


def _steady(check: Callable, name: str, series: Sequence[Series]) -> Check:
    """Check stability: the drift changes the energy by less than its fluctuation."""
    slope = _drift(series)
    deviation = np.sqrt(np.mean([trajectory.total.var() for trajectory in series]))
    scale = min(trajectory.time[-1] for trajectory in series) / deviation
    several = f", mean of {len(series)} starts" * (len(series) > 1)
    return check(
        PAPER[name].label,
        f"stable: drift of the energy, times {_length(*series)}, over its sd",
        slope.times(scale),
        low=-1.0,
        high=1.0,
        note=f"drift {slope.text()} kcal/mol/ps{several}",
    )


# ---- figures 2a, 2b and 3


def _dimer(whole: Outputs) -> Iterator[Check]:
    """Yield the checks of figure 2a."""
    check = partial(Check.of, "dimer", source=STATEMENTS["dimer"])
    pairs = _dimer_pairs(whole, OTHER)
    if len(pairs) > 1:
        span, starts = _length(*sum(pairs, ())), f"{len(pairs)} starts"
        yield check(
            OVER,
            f"more accurate: average measure, {span}, mean of {starts}",
            _ratio(pairs, lambda trajectory: measure(trajectory.total).mean()),
            low=1.0,
        )
        for name, series in zip(("nosquish", OTHER), zip(*pairs)):
            yield _steady(check, name, series)


def _liquid(whole: Outputs) -> Iterator[Check]:
    """Yield the checks of figure 2b."""
    check = partial(Check.of, "liquid", source=STATEMENTS["liquid"])
    series = {name: whole.get(f"water-{name}") for name in ("nosquish", OTHER)}
    ours, other = series.values()
    if ours and other:
        span = _length(ours, other)
        over = measures.quotient(
            *(measures.standard_deviation(trajectory.total) for trajectory in (other, ours))
        )
        yield check(OVER, f"more accurate: sd of energy about its mean, {span}", over, low=1.0)
    for name, trajectory in series.items():
        if trajectory:
            yield _steady(check, name, [trajectory])


def _in_parts(total: np.ndarray) -> np.ndarray:
    """The energy in equal parts of a trajectory: (parts, samples)."""
    size = len(total) // SIDE
    return total[: SIDE * size].reshape(SIDE, size)


def _peptide(whole: Outputs) -> Iterator[Check]:
    """Yield the checks of figure 3."""
    check = partial(Check.of, "peptide", source=STATEMENTS["peptide"])
    names = "nosquish", "shake", "rigid/nve/small"
    series = {name: whole[f"peptide-{name}"] for name in names if f"peptide-{name}" in whole}
    richardson = whole.get("peptide-rigid/small")
    for name, trajectory in series.items():
        what = f"average measure about {AVERAGE_MEASURE:g}, {_length(trajectory)}"
        yield check(
            PAPER[name].label,
            what,
            measures.mean(measure(trajectory.total)),
            low=AVERAGE_MEASURE / NEAR,
            high=AVERAGE_MEASURE * NEAR,
        )
    if {"nosquish", "shake"} <= series.keys():
        yield _equal(check, series["nosquish"], series["shake"])
    for name, trajectory in series.items():
        if richardson is None:
            yield _steady(check, name, [trajectory])
            continue
        slope = _drift([trajectory])
        over = measures.quotient(slope, _drift([richardson]))
        what = f"stable: drift over that of rigid/small, {_length(trajectory)}"
        yield check(
            PAPER[name].label, what, over, low=-LOST, high=LOST, note=f"{slope.text()} kcal/mol/ps"
        )
    if richardson:
        slope = _drift([richardson])
        yield check(
            "rigid/small",
            f"drifts: |drift| of the energy, {_length(richardson)}",
            abs(slope.value) / slope.margin,
            low=SURE_DRIFT,
            note=f"{slope.text()} kcal/mol/ps",
            unit="margins",
            source="Richardson's scheme, which is not symplectic",
        )


def _equal(check: Callable, ours: Series, shake: Series) -> Check:
    """Compare NO_SQUISH and SHAKE, in parts of the same length."""
    both = shake, ours
    label = f"NO_SQUISH over {PAPER['shake'].label}"
    what = f"equal: sd of energy about the means of {SIDE} parts, {_length(*both)}"
    samples = _shortest(both)
    over = measures.ratio(
        *(_in_parts(trajectory.total[:samples]).std(axis=1, ddof=1) for trajectory in both)
    )
    return check(label, what, over, low=1.0 - EQUAL, high=1.0 + EQUAL)


# ---- Gear's scheme


def _after_beginning(trajectory: Series) -> Series:
    """A trajectory without its first `BEGINNING` steps."""
    mask = trajectory.time > BEGINNING * trajectory.simulation.dt / FS_PER_PS
    return replace(trajectory, time=trajectory.time[mask], total=trajectory.total[mask])


def _gear_pairs(whole: Outputs) -> Pairs:
    """Complete dimers of NO_SQUISH and of Gear's scheme from the same starts, both
    `_after_beginning`, if there are several."""
    pairs = [tuple(map(_after_beginning, pair)) for pair in _dimer_pairs(whole, "gear")]
    pairs = [pair for pair in pairs if _shortest(pair) >= FEW]
    return pairs if len(pairs) > 1 else []


def _gear(outputs: Outputs, whole: Outputs) -> Iterator[Check]:
    """Yield the checks of Gear's scheme: at the usual step, and compared with NO_SQUISH from the
    same starts of the dimer.

    Its error grows with time because of its drift, and so does the ratio of the average measures:
    "far" is therefore tested for the drift.
    """
    check = partial(Check.of, "gear", source=STATEMENTS["gear"])
    for scene in "water", "peptide":
        if gear := outputs.get(f"{scene}-gear"):
            span = f"{gear.simulation.steps * DT / FS_PER_PS:g} ps"
            what = f"unstable at {DT:g} fs: largest |E − E(0)| over the kinetic energy, {span}"
            total, note = gear.total, f"ended: {gear.error}" if gear.error else ""
            value = np.abs(total - total[0]).max() / gear.kinetic[0] if len(total) else None
            yield check(f"Gear, {scene}", what, value, low=1.0, note=note)
    if not (pairs := _gear_pairs(whole)):
        return
    ours, theirs = zip(*pairs)
    where, first = f"at {DIMER_DT:g} fs", f"without the first {BEGINNING} steps"
    when = f"{_length(*ours, *theirs)} {first}, {len(pairs)} starts"
    ours_drift, drift = _drift(ours), _drift(theirs)
    note, off = f"{drift.text()} kcal/mol/ps", abs(drift.value) / drift.margin
    far, what = None, f"far more accurate {where}: drift of the energy, {when}"
    text = f"Gear's drift itself cannot be told: {note}"
    if off >= SURE_DRIFT:  # no ratio to a drift that is not significant
        far, text = measures.quotient(ours_drift, drift), f"{ours_drift.text()} and {note}"
    yield check("NO_SQUISH over Gear, dimer", what, far, low=-1 / FAR, high=1 / FAR, note=text)


def tables(summary: dict) -> list[Table]:
    """A table of all trajectories."""
    return [
        Table(
            "All trajectories",
            COLUMNS,
            [{**row, "status": row["error"] or "ok"} for row in summary["rows"]],
            file="table",
            long=True,
        )
    ]


COLUMNS = (
    Column("name", "trajectory", kind="text"),
    Column("integrator", "integrator", kind="text"),
    Column("dt", "dt", "fs", "number"),
    Column("ps", "length", "ps", "number"),
    Column("temperature", "temperature", "K", "estimate"),
    Column("sd", "sd of energy", "kcal/mol", "estimate"),
    Column("sd_line", "sd about its line", "kcal/mol", "estimate", wide=True),
    Column("measure", "average measure", "ratio", "estimate"),
    Column("drift", "drift", "kcal/mol/ps", "estimate"),
    Column("status", "status", kind="text", wide=True),
)
CLAIMS = Claims(
    "The paper's test problems again",
    "Are the paper's statements on its test problems confirmed?",
    "numbers that test the paper's statements",
    PARTS,
    plan,
    judge,
    tables=tables,
    checks_file="claims",
    ours=False,
)
