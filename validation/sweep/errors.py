"""From the runs of a sweep's points to errors with margins.

Numbers of one run are ``Estimate``s, with an error from the correlation in time of its samples or
from the scatter of its bodies.  Those of a point are means over its starts, with the larger margin
of what the runs tell and what their scatter tells.  Averages are held against their limits for
steps of zero length, extrapolated, start by start.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from ..running.run import Result
from ..scenes import FS_PER_PS, peptide
from ..scenes.units import BOLTZMANN
from ..statistics import measures, structure
from ..statistics.measures import Estimate
from ..statistics.structure import Motion
from .plan import Parts, Point, Sweep

PS_PER_NS, FS_PER_NS = 1000.0, 1e6
APART = 0.25  # ps after which a body's kinetic energy is another one
ENOUGH = 4  # starts whose scatter is an error by itself
SMALL = 1.0  # fs; the symplectic schemes' g(r) up to this step is what all others are held against
# whose averages go with dt^2
SYMPLECTIC = ("nosquish", "nosquish-2", "nosquish-4", "rigid/nve", "rigid/nve/small", "shake-1e-8")
AVERAGES = "potential", "equipartition", "pressure"
LARGEST = "bond", "angle"
_FINEST, _SHORT = "ours at a 16th of the smallest step", "the limit of short steps"
_FRAMES = "the start; the largest of all frames, which has no statistical error"
_PV, _DEVIATIONS = "(physical_validation)", "standard deviations"
# title, unit, what it is held against; all are drawn on logarithmic axes
_TOLD = {
    "energy_sd": (
        "standard deviation of the total energy",
        "kcal/mol",
        "its mean; of an energy that drifts it grows with the run",
    ),
    "energy_sd_line": (
        "standard deviation of the total energy about its line",
        "kcal/mol",
        "the least-squares line through it",
    ),
    "drift": ("drift of the total energy", "kT per ns and degree of freedom", "none"),
    "paper": ("mean of |E − ⟨E⟩| / |⟨E⟩|, the paper's measure", "", "its mean"),
    "position": ("rms distance of the bodies' centres after the horizon", "Å", _FINEST),
    "orientation": ("rms angle of the bodies' orientations after the horizon", "rad", _FINEST),
    "potential": ("mean potential energy", "kcal/mol per body", _SHORT),
    "equipartition": ("T of translation − T of rotation", "K", _SHORT),
    "pressure": ("mean pressure", "atm", _SHORT),
    "g_oo": (
        "rms of g_OO(r), 2 to 8 Å, its noise taken off",
        "",
        f"start by start, the symplectic schemes with steps up to {SMALL:g} fs",
    ),
    "helix": (
        "part of the start's helical residues that are lost, by DSSP",
        "",
        "the start. In runs this short it tells a helix that breaks, no integrator's error: one "
        "residue is 0.08 and flickers. For that see the peptide's 300 ps of paper --full",
    ),
    "bond": ("largest error of a bond's length", "Å", _FRAMES),
    "angle": ("largest error of an angle, in bodies of three atoms", "rad", _FRAMES),
    "convergence": (
        f"energy's deviation over that of the next shorter step, off the square of the steps' "
        f"ratio {_PV}",
        "",
        "a deviation ∝ Δt²",
    ),
    "ke_distribution": (
        f"kinetic energies of single bodies: mean or width off the gamma distribution {_PV}",
        _DEVIATIONS,
        "the run's temperature; it grows with the number of frames",
    ),
    "pv_equipartition": (
        f"kinetic energy of translation or rotation off the temperature {_PV}",
        _DEVIATIONS,
        "the run's temperature",
    ),
}
MEASURES = {
    name: {"title": title, "unit": unit, "relative_to": relative_to}
    for name, (title, unit, relative_to) in _TOLD.items()
}


@dataclass(frozen=True)
class Numbers:
    """All numbers of a run."""

    # of the measures an ``Estimate``, or where only all starts together give one, what it is made
    # of: ``g_oo`` (blocks, bins); ``convergence`` the energy less its mean, (samples,);
    # ``ke_distribution`` of bodies; ``pv_equipartition`` of translation and rotation, (2, samples)
    measures: dict
    cost: Sequence[float] = ()  # s per simulated ns of each timed segment, of the clock
    cpu: Sequence[float] = ()  # and of all cores
    temperature: float = 0.0  # K
    freedom: int = 0  # degrees of it, and those of translation and of rotation
    moving: float = 0.0
    turning: float = 0.0


Found = Mapping[Point, Sequence[Numbers]]  # of each start


def failure(result: Result, temperature: float) -> str | None:
    """None, or in a line why a run is none: it ended early, or its energy has changed by more than
    all the kinetic energy, reckoned from the temperature, K."""
    if result.error:
        return result.error
    step, energy = result.thermo["Step"], result.thermo["TotEng"]
    if not np.isfinite(energy).all():
        return f"the energy is not finite from step {step[np.argmin(np.isfinite(energy))]:.0f} on"
    off = np.abs(energy - energy[0]) > degrees_of_freedom(result) * BOLTZMANN * temperature / 2
    if not off.any():
        return None
    return f"the energy is off by more than the kinetic energy from step {step[off][0]:.0f} on"


def degrees_of_freedom(result: Result) -> int:
    """As LAMMPS counts them for the temperature."""
    return round(2 * result.thermo["KinEng"][0] / (BOLTZMANN * result.thermo["Temp"][0]))


def of_run(
    result: Result, reference: Result, dt: float, parts: Parts, asked: Sequence[str]
) -> Numbers:
    """The numbers of a complete run, of the measures that are asked for; the reference solution
    ends at the horizon."""
    sampled = (result.thermo["Step"] >= parts.begin) & (result.thermo["Step"] <= parts.end)
    thermo = {name: values[sampled] for name, values in result.thermo.items()}
    energy, time = thermo["TotEng"], thermo["Step"] * dt / FS_PER_PS
    kelvin, total = thermo["Temp"].mean(), degrees_of_freedom(result)
    assert result.positions and reference.positions  # a complete run has them
    motion, at, exact = Motion(result.positions), parts.at_horizon, reference.positions.x[-1]
    # LAMMPS's are three less, for the momentum is kept: of translations, free atoms' alike
    moving = 3 * motion.count * (1 - 1 / (motion.count + motion.free))
    turning = total - 3 * (motion.count + motion.free - 1)
    kinetic = np.array([thermo["v_translation"], thermo["v_rotation"]])
    kt_per_ns = PS_PER_NS / (BOLTZMANN * kelvin * total)
    apart = ceil(APART * FS_PER_PS / (parts.frame * dt))
    makers = {
        "energy_sd": lambda: measures.standard_deviation(energy),
        "energy_sd_line": lambda: measures.about_line(time, energy),
        "drift": lambda: measures.drift(time, energy).times(kt_per_ns),
        "paper": lambda: measures.mean(np.abs(energy - energy.mean()) / abs(energy.mean())),
        "position": lambda: motion.distance(at, exact),
        "orientation": lambda: motion.angle(at, exact),
        "potential": lambda: measures.mean(thermo["PotEng"] / motion.count),
        "equipartition": lambda: measures.mean(
            2 / BOLTZMANN * (kinetic[0] / moving - kinetic[1] / turning)
        ),
        "pressure": lambda: measures.mean(thermo["Press"]),
        "g_oo": lambda: structure.pair_distribution(motion, parts.frames),
        "helix": lambda: measures.mean(
            peptide.helicity(motion.x, motion.cell, motion.periodic)[parts.frames]
        ),
        "bond": lambda: Estimate(motion.bond_error()),
        "angle": lambda: Estimate(motion.angle_error()),
        "convergence": lambda: energy - energy.mean(),
        "ke_distribution": lambda: motion.kinetic(parts.frames)[::apart].ravel(),
        "pv_equipartition": lambda: kinetic,
    }
    cost, cpu = [], []
    for one in (result.timings[index] for index in parts.segments):
        cost.append(one.seconds / one.steps / dt * FS_PER_NS)
        if one.cpu is not None:
            cpu.append(cost[-1] * one.ranks * one.cpu / 100)
    found = {name: makers[name]() for name in asked}
    return Numbers(found, cost, cpu, kelvin, total, moving, turning)


def pooled(starts: Sequence[Estimate]) -> Estimate:
    """The mean over starts, with the larger margin of what the runs tell and what their scatter
    tells."""
    if len(starts) == 1:
        return starts[0]
    scattered = measures.of_few([one.value for one in starts])
    error = measures.combined(*(one.times(1 / len(starts))[1:] for one in starts))
    return max(Estimate(scattered.value, *error), scattered, key=lambda one: one.margin)


def limits(found: Found, swept: Sweep) -> dict[str, list[Estimate]]:
    """Averages at steps of zero length, of each start, from the symplectic schemes' points with
    steps up to ``Sweep.law``; without those for which there are too few points.

    Fitted is, start by start, a + b dt^2, weighted, with one a for all and a b for each integrator,
    which differ in what they leave out.  Runs from the same start are near each other at first, so
    a limit is not surer than the surest average that it is from.
    """
    used = [
        one for one in found if one.dt <= swept.law and _is_good(one) and swept.same(one.integrator)
    ]
    number = min((len(found[point]) for point in used), default=0)
    names = list(dict.fromkeys(point.integrator.name for point in used))
    slopes = [[one.dt**2 * (one.integrator.name == name) for name in names] for one in used]
    matrix = np.array([[1.0, *row] for row in slopes])
    if not number or np.linalg.matrix_rank(matrix) < 1 + len(names):
        return {}
    return {
        name: [
            _limit(matrix, [found[one][start].measures[name] for one in used])
            for start in range(number)
        ]
        for name in set(AVERAGES) & set(swept.measures)
    }


def _is_good(point):
    return point.integrator.name in SYMPLECTIC


def _limit(matrix, averages):
    """Of one start, from the points' ``Estimate``s: the fit's first parameter."""
    values, errors = (np.array([one[k] for one in averages]) for k in (0, 1))
    covariance = np.linalg.inv(matrix.T / errors**2 @ matrix)
    fit = covariance @ (matrix.T / errors**2 @ values)
    more, scale = len(values) - len(fit), 1.0
    if more:
        scale = max(1.0, np.sqrt(np.sum(((values - matrix @ fit) / errors) ** 2) / more))
    surest = min(averages, key=lambda one: one.margin)
    freedom = more if scale > 1 else surest.freedom
    fitted = Estimate(fit[0], scale * np.sqrt(covariance[0, 0]), freedom)
    return max(fitted, surest._replace(value=fit[0]), key=lambda one: one.margin)


def _off_limit(averages, limit):
    """An average less its limit, start by start; its error is, of ``ENOUGH`` starts, their scatter,
    which knows how much of a start's chance both share, else, too large, as if they shared none."""
    pairs = list(zip(averages, limit))
    off = [Estimate(one.value - at.value, *measures.combined(one[1:], at[1:])) for one, at in pairs]
    return measures.of_few([one.value for one in off]) if len(off) >= ENOUGH else pooled(off)


def of_points(
    found: Found, limits: Mapping[str, Sequence[Estimate]], swept: Sweep
) -> dict[Point, tuple[dict, dict]]:
    """The errors of all points: (errors, signed), each measure to an ``Estimate`` as plain data;
    errors are not negative."""
    known = (point for point, numbers in found.items() if numbers)
    return {point: _of_point(point, found, limits, swept) for point in known}


def _of_point(point, found, limits, swept):
    errors, signed = {}, {}
    for name in swept.measures_of(point.integrator):
        if name in TOGETHER:
            together = TOGETHER[name](point, found)
            if together:
                errors[name] = together.plain()
            continue
        if name in AVERAGES and name not in limits:
            continue
        each = [one.measures[name] for one in found[point]]
        if name in AVERAGES:
            one = _off_limit(each, limits[name])
        else:
            one = max(each) if name in LARGEST else pooled(each)
        if name == "helix":
            one = one._replace(value=1 - one.value)
        if name in ("drift", "helix", *AVERAGES):
            signed[name] = one.plain()
        size = max(one.value, 0.0) if name == "helix" else abs(one.value)
        errors[name] = one._replace(value=size).plain()
    return errors, signed


def _pair_distribution(point, found):
    """The rms difference from the mean of the symplectic schemes at steps up to `SMALL`, without
    what noise makes of it; None without these.

    The mean product of the differences from two starts has no noise of its own. Of fewer than
    ``ENOUGH`` starts their blocks stand for starts.
    """
    held = [
        one for one in found if _is_good(one) and one.dt <= SMALL and one != point and found[one]
    ]
    if not held:
        return None
    starts = range(min(len(found[one]) for one in (point, *held)))
    g = {one: [numbers.measures["g_oo"] for numbers in found[one]] for one in (point, *held)}
    means = [np.mean([g[one][start] for one in held], axis=0) for start in starts]
    off = np.array([g[point][start] - means[start] for start in starts])
    off = off.mean(axis=1) if len(starts) >= ENOUGH else off.reshape(-1, off.shape[-1])
    return measures.without_noise(off)


def _convergence(point, found):
    """Against the same integrator's next shorter step; None if there is none."""
    same = (one for one in found if one.integrator is point.integrator and found[one])
    shorter = [one for one in same if one.dt < point.dt]
    if not shorter:
        return None
    pair = point, max(shorter, key=lambda one: one.dt)
    known = {one: [numbers.measures for numbers in found[one]] for one in pair}
    series = {one.dt: np.concatenate([each["convergence"] for each in known[one]]) for one in pair}
    widths = (pooled([each["energy_sd"] for each in known[one]]) for one in pair)
    scaled = measures.quotient(*widths).times((pair[1].dt / pair[0].dt) ** 2)
    return scaled._replace(value=structure.convergence(series))


def _kelvin(numbers):
    return np.mean([one.temperature for one in numbers])


def _distribution(point, found):
    """Of all starts together, in standard deviations."""
    numbers = found[point]
    energies = np.concatenate([one.measures["ke_distribution"] for one in numbers])
    return Estimate(structure.distribution(energies, _kelvin(numbers)), 1.0)


def _equipartition(point, found):
    """Of all starts together, of each those samples that are independent; in standard
    deviations."""
    numbers, series = found[point], []
    for one in numbers:
        pair = one.measures["pv_equipartition"]
        series.append(pair[:, :: ceil(max(map(measures.statistical_inefficiency, pair)))])
    freedom = numbers[0].moving, numbers[0].turning
    translation, rotation = np.concatenate(series, axis=1)
    off = structure.equipartition(translation, rotation, *freedom, _kelvin(numbers))
    return Estimate(off, 1.0)


TOGETHER = {
    "g_oo": _pair_distribution,
    "convergence": _convergence,
    "ke_distribution": _distribution,
    "pv_equipartition": _equipartition,
}
