"""Errors from runs: observables of a run, their noise, and the errors of each point.

All points run from the same starts.  Deviations that all runs from a start share are the chance of
that start, and are subtracted.  The remaining scatter of a point from start to start is noise,
whatever its correlation time; all points together give its ratio to the error of a single run.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from ..experiment import Observable, Point
from ..running import run
from ..statistics import measures, structure
from ..statistics.estimate import Estimate, combined
from ..statistics.structure import Motion
from ..user_script.shapes import MVV2E
from .case import MEANS, SPAN, Case, about
from .law import by_law

BIN, REACH = 0.04, (0.3, 2.2)  # of g(r), in units of the edge of the volume per body
HALF = 0.95  # largest distance of g(r), in halves of the box
UNLIKELY = 5.0  # standard deviations of a temperature
LEFT = 3.0  # remaining deviation from equilibrium, in units of its decrease between starts
FEWEST = 3  # independent vectors of noise that the error of g(r) needs


class Series(NamedTuple):
    """The data of a run: thermodynamic output by column, and positions in its frames."""

    thermo: Mapping[str, np.ndarray]
    motion: Motion
    frames: Sequence[int]
    dt: float


class Numbers(NamedTuple):
    """Results of a run.

    Attributes:
        estimates: by the names of `case.TARGETS`.
        kinds: relative temperature differences: of translation and rotation, and of either and the
            thermostat.
        rdf: (bins,) g(r), or None.
    """

    estimates: Mapping[str, Estimate]
    kinds: Sequence[Estimate] = ()
    rdf: np.ndarray | None = None


Results = Mapping[Point, Mapping[int, Numbers]]  # by start number


def failure(result: run.Result, temperature: float, boltzmann: float) -> str | None:
    """Why a run failed, in a line: it ended early, has NaN, or heats; None if it is good."""
    if result.error:
        return result.error
    kelvin, energy = result.thermo["Temp"], result.thermo["TotEng"]
    freedom = 2 * result.thermo["KinEng"][0] / (boltzmann * kelvin[0]) if kelvin[0] > 0 else 1.0
    most = max(temperature, kelvin[0]) * (2 + UNLIKELY * math.sqrt(2 / freedom))
    bad = ~np.isfinite(energy) | ~(kelvin <= most)
    if not bad.any():
        return None
    step = result.thermo["Step"][bad][0]
    return f"it heats: the temperature is {kelvin[bad][0]:.4g} at step {step:.0f}"


def observables(case: Case) -> list[Observable]:
    """The observables of a single run's `Series`, by the names of `case.TARGETS`."""

    def conserved(series):
        return series.thermo.get("Econserve", series.thermo["TotEng"])

    def drift(series):
        """Drift in kT per ns and degree of freedom."""
        thermo = series.thermo
        freedom = 2 * thermo["KinEng"].mean() / (case.boltzmann * thermo["Temp"].mean())
        slope = measures.drift(thermo["Step"] * series.dt, conserved(series))
        return slope.times(case.ns / (case.kt * freedom))

    def energy(series):
        """Rms change in `SPAN` steps of the usual length over √2, in units of the standard
        deviation of the kinetic energy."""
        apart = (series.thermo["Step"][1] - series.thermo["Step"][0]) * series.dt
        econserve = conserved(series)
        lag = max(1, min(len(econserve) // 2, round(SPAN * case.scene.dt / apart)))
        square = measures.mean((econserve[lag:] - econserve[:-lag]) ** 2 / 2)
        change = np.sqrt(max(square.value, 1e-300))
        rms = Estimate(change, square.error / (2 * change), square.freedom)
        return rms.times(1 / max(float(np.std(series.thermo["KinEng"])), 1e-300))

    functions = {
        "drift": drift,
        "energy": energy,
        "energy_sd": lambda series: measures.standard_deviation(conserved(series)),
        "potential": lambda series: measures.mean(series.thermo["PotEng"] / series.motion.count),
        "density": lambda series: measures.mean(series.thermo["Density"]),
    }
    descriptions = about(case)
    return [
        Observable(key, descriptions[key]["what"], descriptions[key]["unit"], of)
        for key, of in functions.items()
        if key not in case.lost
    ]


def numbers(case: Case, dt: float, result: run.Result, settles: float) -> Numbers:
    """The results of a run without its first part, the fraction ``settles``."""
    assert result.positions
    frames = len(result.positions.x) - 1
    first = math.ceil(settles * frames * (1 - 1e-9))
    mask = result.thermo["Step"] >= first * result.thermo["Step"][-1] / frames
    thermo = {name: values[mask] for name, values in result.thermo.items()}
    series = Series(thermo, Motion(result.positions), range(1 + first, 1 + frames), dt)
    estimates = {observable.key: observable.of(series) for observable in observables(case)}
    known = {key: estimate for key, estimate in estimates.items() if estimate is not None}
    kinds = [] if "temperature" in case.lost else _kinds(case, *temperatures(case, series))
    return Numbers(known, kinds, None if "rdf" in case.lost else _rdf(series))


def temperatures(case: Case, series: Series) -> tuple[np.ndarray, np.ndarray | None]:
    """Temperatures of the bodies' centres and of their rotation, (frames,); the latter is None if
    no body rotates."""
    motion, axes = series.motion, case.scene.dimension
    mass, v = motion.mass, motion.v[list(series.frames)]
    v = v - np.average(v, axis=1, weights=mass)[:, None]
    moving, turning, inside = np.zeros(len(v)), np.zeros(len(v)), 0.0
    for group in motion.groups:
        own_mass = mass[group]
        whole = own_mass.sum(axis=1)
        centre = np.einsum("bn,fbnk->fbk", own_mass, v[:, group]) / whole[:, None]
        translation = np.einsum("b,fbk->f", whole, centre**2)
        moving += translation
        turning += np.einsum("bn,fbnk->f", own_mass, v[:, group] ** 2) - translation
        inside += whole.sum()
    freedom = axes * motion.count - axes * inside / mass.sum()
    scale, rest = MVV2E.get(case.scene.units, 1.0) / case.boltzmann, motion.turning(axes)
    return moving * scale / freedom, turning * scale / rest if rest else None


def _kinds(case, moving, turning) -> list[Estimate]:
    series = [] if turning is None else [moving - turning]
    if case.bath:
        series += [kelvin - case.temperature for kelvin in (moving, turning) if kelvin is not None]
    return [measures.mean(difference / case.temperature) for difference in series]


def _rdf(series) -> np.ndarray:
    cell = series.motion.cell
    room = (abs(np.linalg.det(cell)) / series.motion.count) ** (1 / 3)
    most = HALF * np.min(np.abs(np.diag(cell))) / 2
    ends = REACH[0] * room, min(most, REACH[1] * room)
    return structure.pair_distribution(
        series.motion, slice(series.frames[0], series.frames[-1] + 1), ends, BIN * room
    )


Starts = Mapping[Point, Mapping[int, Estimate]]  # of each start of each point, by its number


class Noise(NamedTuple):
    """Factor by which errors are larger than single runs show, and its degrees of freedom.

    It is one factor for all points together (R. T. Birge, Phys. Rev. 40, 207, 1932): the scatter of
    runs of the same point over their errors.
    """

    wider: float
    freedom: int

    @classmethod
    def of(cls, starts: Starts, chance: Mapping[int, float]) -> "Noise":
        """The noise of points that run from several starts; ``chance`` is subtracted."""
        square, freedom = 0.0, 0
        for estimates in starts.values():
            deviations = {
                n: estimate.value - chance.get(n, 0.0) for n, estimate in estimates.items()
            }
            mean = float(np.mean([*deviations.values()]))
            square += sum(
                ((deviations[n] - mean) / estimate.error) ** 2
                for n, estimate in estimates.items()
                if estimate.error
            )
            freedom += len(deviations) - 1
        freedom = max(0, freedom - max(0, len(chance) - 1))  # used for the chance of the starts
        return cls(math.sqrt(max(1.0, square / freedom)) if freedom else 1.0, freedom)


class Pooled(NamedTuple):
    """Means over starts, with the noise that a single run does not show.

    If means are compared with another run, the chance of each start cancels.  Otherwise the starts
    may not have been in equilibrium, so all means may still contain part of the difference between
    the starts' chances.

    Attributes:
        settles: standard error of all means together, due to starts that are not in equilibrium.
    """

    means: Mapping[Point, Estimate]
    settles: float

    @classmethod
    def of(
        cls, starts: Starts, shared: bool, like: Starts | None = None, times: float = 1.0
    ) -> "Pooled":
        """The means over the points' starts.

        Args:
            shared: whether they are compared with another run.
            like: runs from which the noise is estimated; None means these.
            times: length of the runs in ``starts``, in lengths of those in ``like``.
        """
        noise_source = starts if like is None else like
        known = _chance(_values(noise_source))
        noise, chance = Noise.of(noise_source, known), _chance(_values(starts)) if shared else {}
        means = {}
        for point, estimates in starts.items():
            mean = float(
                np.mean([estimate.value - chance.get(n, 0.0) for n, estimate in estimates.items()])
            )
            error, freedom = combined(
                *(estimate.times(1 / len(estimates))[1:] for estimate in estimates.values())
            )
            few = noise.wider > 1 and (freedom is None or noise.freedom < freedom)
            means[point] = Estimate(mean, noise.wider * error, noise.freedom if few else freedom)
        # a deviation that decays between the starts to LEFT times its decrease, at the slowest, is
        # gone after as many short runs
        part = 0.0 if shared else min(1.0, LEFT / times)
        return cls(means, part * _settling(noise_source, known))

    def with_settling(self, estimate: Estimate | None) -> Estimate | None:
        """An error of these means with that of starts that are not in equilibrium added."""
        return estimate and estimate._replace(error=math.hypot(estimate.error, self.settles))


def _settling(starts: Starts, chance: Mapping[int, float]) -> float:
    """Estimate the remaining deviation of the first start from equilibrium, from the difference
    between the starts' chances beyond their errors."""
    if len(chance) < 2:
        return 0.0
    squares = (
        estimate.error**2 for estimates in starts.values() for estimate in estimates.values()
    )
    error = math.sqrt(sum(squares)) / len(starts)
    return LEFT * max(0.0, max(chance.values()) - min(chance.values()) - error)


def _values(starts: Starts) -> dict[Point, dict[int, float]]:
    return {
        point: {n: estimate.value for n, estimate in estimates.items()}
        for point, estimates in starts.items()
    }


def _chance(values: Mapping[Point, Mapping[int, Any]]) -> dict[int, Any]:
    """The deviation that all runs from a start share, by start, from the points that have all
    starts."""
    number = max(map(len, values.values()), default=0)
    complete = [starts for starts in values.values() if len(starts) == number]
    means = {n: np.mean([starts[n] for starts in complete], axis=0) for n in (complete or [{}])[0]}
    return {n: mean - np.mean([*means.values()], axis=0) for n, mean in means.items()}


class Structure(NamedTuple):
    """g(r) of points.

    Attributes:
        means: (bins,) over starts.
        runs: number of runs, in lengths of those whose noise is known.
        noise: (vectors, bins), independent, each the noise of one run: the scatter of runs of the
            same point.
    """

    means: Mapping[Point, np.ndarray]
    runs: Mapping[Point, float]
    noise: np.ndarray

    @classmethod
    def of(cls, results: Results, like: Results, times: float = 1.0) -> "Structure | None":
        """g(r) from the runs of points; None if they have none. For the arguments see `errors`."""
        distributions, noise_source = (
            _starts(source, lambda numbers: numbers.rdf) for source in (results, like)
        )
        every = [
            g
            for source in (distributions, noise_source)
            for starts in source.values()
            for g in starts.values()
        ]
        bins = min(map(len, every), default=0)
        if not bins:
            return None
        rows = _rows(noise_source, bins).values()
        parts = [linalg.helmert(len(starts)) @ starts for starts in rows if len(starts) > 1]
        noise = np.concatenate([np.empty((0, bins)), *parts])
        lost = max(map(len, rows)) - 1  # used for the chance of the starts
        if len(noise) > lost:
            noise *= math.sqrt(len(noise) / (len(noise) - lost))
        means = {point: starts.mean(axis=0) for point, starts in _rows(distributions, bins).items()}
        return cls(
            means, {point: times * len(starts) for point, starts in distributions.items()}, noise
        )

    def error(self, point: Point, held: Point) -> Estimate | None:
        """The rms error without the part due to noise; None if the noise is not known.

        The scatter of runs of a point contains no error of the step.  The noise is thus correct
        for any correlation time, which it would not be if blocks of a run counted as independent.
        """
        ours = [other for other in self.means if other.scheme == held.scheme and other.dt > held.dt]
        shorter = [other for other in ours if other.dt <= point.dt] or sorted(ours)[:1]
        if not shorter or not {point, held} <= self.means.keys() or len(self.noise) < FEWEST:
            return None
        # the reference has an error, too, proportional to the square of its step
        far = max(shorter)
        part = held.dt**2 / (far.dt**2 - held.dt**2)
        weights = dict.fromkeys((point, far, held), 0.0)
        for other, weight in (point, 1.0), (far, part), (held, -1.0 - part):
            weights[other] += weight
        off = sum(weight * self.means[other] for other, weight in weights.items())
        each = sum(weight**2 / self.runs[other] for other, weight in weights.items())
        # as many measurements, whose mean is the difference, and whose scatter is its noise
        number = len(self.noise) + 1
        scatter = math.sqrt(number * each) * linalg.helmert(number).T @ self.noise
        return measures.without_noise(off + scatter)


def _rows(values: Mapping[Point, Mapping[int, np.ndarray]], bins: int) -> dict[Point, np.ndarray]:
    """The starts of each point as rows, without the deviation that all runs from a start share, in
    the bins that all runs have."""
    cut = {point: {n: g[:bins] for n, g in starts.items()} for point, starts in values.items()}
    chance = _chance(cut)
    return {
        point: np.array([g - chance.get(n, 0.0) for n, g in starts.items()])
        for point, starts in cut.items()
    }


def errors(
    case: Case,
    results: Results,
    held: Point,
    by_itself: bool = False,
    like: Results | None = None,
    times: float = 1.0,
) -> dict[Point, dict[str, Estimate]]:
    """The error of each point, with sign, by the names of `case.TARGETS`; errors that cannot be
    estimated are omitted.

    Args:
        held: the reference of means.
        by_itself: use the point's own runs only; else also longer steps of its integrator.
        like: shorter runs from which the noise is estimated; None means these.
        times: length of the runs in ``results``, in lengths of those in ``like``.
    """
    results, noise_source = (
        _without(source, case.unknown) for source in (results, results if like is None else like)
    )

    def means(of, shared=False):
        return Pooled.of(_starts(results, of), shared, _starts(noise_source, of), times)

    every = [numbers for starts in results.values() for numbers in starts.values()]
    scalars = {
        name: means(lambda numbers: numbers.estimates.get(name), name in MEANS)  # noqa: B023
        for name in {name for numbers in every for name in numbers.estimates}
    }
    number = min((len(numbers.kinds) for numbers in every), default=0)
    kinds = [means(lambda numbers: numbers.kinds[k]) for k in range(number)]  # noqa: B023
    structures = Structure.of(results, noise_source, times)
    result = {}
    for point in results:
        estimates = {
            name: pooled.with_settling(pooled.means.get(point)) for name, pooled in scalars.items()
        }
        for name in MEANS & estimates.keys():
            estimates[name] = _of_mean(case, name, scalars[name].means, point, held, by_itself)
        differences = (
            pooled.with_settling(
                by_law(point.dt, _steps_of_integrator(pooled.means, point, by_itself))
            )
            for pooled in kinds
        )
        estimates["temperature"] = max(  # the one with the largest possible error
            filter(None, differences), key=lambda one: abs(one.value) + one.margin, default=None
        )
        estimates["rdf"] = structures and structures.error(point, held)
        lost = case.unknown.get(point.scheme, ())
        result[point] = {
            name: estimate for name, estimate in estimates.items() if estimate and name not in lost
        }
    return result


def _without(results: Results, unknown: Mapping[str, Sequence[str]]) -> Results:
    """The results without estimates that an integrator's runs cannot measure: the noise and the
    starts' chances of all points together must not contain them."""
    return {
        point: {
            n: numbers._replace(
                estimates={
                    name: estimate
                    for name, estimate in numbers.estimates.items()
                    if name not in unknown.get(point.scheme, ())
                }
            )
            for n, numbers in starts.items()
        }
        for point, starts in results.items()
    }


def _starts(results: Results, of: Callable[[Numbers], Any]) -> dict[Point, dict[int, Any]]:
    """A value of each start's numbers, where it exists."""
    every = {
        point: {n: of(numbers) for n, numbers in starts.items() if of(numbers) is not None}
        for point, starts in results.items()
    }
    return {point: starts for point, starts in every.items() if starts}


def _steps_of_integrator(
    means: Mapping[Point, Estimate], point: Point, by_itself: bool
) -> dict[float, Estimate]:
    """The means from which the point's error is estimated, by step of its integrator."""
    return {
        other.dt: mean
        for other, mean in means.items()
        if other.scheme == point.scheme and (other.dt == point.dt or not by_itself)
    }


def _of_mean(case, name, means, point, held, by_itself) -> Estimate | None:
    if point not in means or held not in means:
        return None
    finer = held.dt if held.scheme == point.scheme else 0.0
    error = by_law(
        point.dt,
        _steps_of_integrator(means, point, by_itself and point != held),
        means[held],
        finer,
    )
    return error and error.times(1 / (case.kt if name == "potential" else means[held].value))
