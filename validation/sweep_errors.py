"""From the runs of a sweep's points to errors with margins.

Numbers of one run are ``measures.Estimate``s, with an error from the correlation in time of its samples or from the scatter of
its bodies.  Those of a point are means over its starts, with the larger margin of what the runs tell and what their scatter tells.  Averages are held against their limits for steps of zero length, extrapolated, start by start.
"""

from math import ceil

import numpy as np

from validation import measures, sweep_structure
from validation.compare import FS_PER_PS
from validation.measures import Estimate
from validation.sweep_structure import Motion

BOLTZMANN = 0.0019872067  # kcal/mol/K, LAMMPS's
PS_PER_NS = 1000.0
FS_PER_NS = 1e6
APART = 0.25  # ps after which a body's kinetic energy is another one
ENOUGH = 4  # starts whose scatter is an error by itself
SMALL = 1.0  # fs; the symplectic schemes' g(r) up to this step is what all others are held against
SYMPLECTIC = (
    "nosquish",
    "nosquish-2",
    "nosquish-4",
    "rigid/nve",
    "rigid/nve/small",
    "shake-1e-8",
)  # whose averages go with dt^2
AVERAGES = "potential", "equipartition", "pressure"
LARGEST = "bond", "angle"

# title, unit, what it is held against; all are drawn on logarithmic axes
MEASURES = {
    name: {"title": title, "unit": unit, "relative_to": relative_to, "log": True}
    for name, title, unit, relative_to in (
        ("energy_sd", "standard deviation of the total energy", "kcal/mol", "its mean; of an energy that drifts it grows with the run"),
        ("energy_sd_line", "standard deviation of the total energy about its line", "kcal/mol", "the least-squares line through it"),
        ("drift", "drift of the total energy", "kT per ns and degree of freedom", "none"),
        ("paper", "mean of |E − ⟨E⟩| / |⟨E⟩|, the paper's measure", "", "its mean"),
        ("position", "rms distance of the bodies' centres after the horizon", "Å", "ours at a 16th of the smallest step"),
        ("orientation", "rms angle of the bodies' orientations after the horizon", "rad", "ours at a 16th of the smallest step"),
        ("potential", "mean potential energy", "kcal/mol per body", "the limit of short steps"),
        ("equipartition", "T of translation − T of rotation", "K", "the limit of short steps"),
        ("pressure", "mean pressure", "atm", "the limit of short steps"),
        ("g_oo", "rms of g_OO(r), 2 to 8 Å, its noise taken off", "", f"start by start, the symplectic schemes with steps up to {SMALL:g} fs"),
        ("helix", "part of the start's helical residues that are lost, by DSSP", "",
         "the start. In runs this short it tells a helix that breaks, no integrator's error: one residue is 0.08 and flickers. For that see the "
         "peptide's 300 ps of paper --full"),
        ("bond", "largest error of a bond's length", "Å", "the start; the largest of all frames, which has no statistical error"),
        ("angle", "largest error of an angle, in bodies of three atoms", "rad",
         "the start; the largest of all frames, which has no statistical error"),
        ("convergence", "energy's deviation over that of the next shorter step, off the square of the steps' ratio (physical_validation)", "",
         "a deviation ∝ Δt²"),
        ("ke_distribution", "kinetic energies of single bodies: mean or width off the gamma distribution (physical_validation)",
         "standard deviations", "the run's temperature; it grows with the number of frames"),
        ("pv_equipartition", "kinetic energy of translation or rotation off the temperature (physical_validation)", "standard deviations",
         "the run's temperature"),
    )
}  # fmt: skip


def failure(result, temperature):
    """None, or in a line why a run is none: it ended early, or its energy has changed by more than all the kinetic energy.

    Args:
        result: a ``run.Result``.
        temperature: K, from which the kinetic energy is reckoned.
    """
    if result.error:
        return result.error
    step, energy = result.thermo["Step"], result.thermo["TotEng"]
    if not np.isfinite(energy).all():
        return f"the energy is not finite from step {step[np.argmin(np.isfinite(energy))]:.0f} on"
    off = np.abs(energy - energy[0]) > degrees_of_freedom(result) * BOLTZMANN * temperature / 2
    return (
        f"the energy is off by more than the kinetic energy from step {step[np.argmax(off)]:.0f} on"
        if off.any()
        else None
    )


def degrees_of_freedom(result):
    """As LAMMPS counts them for the temperature."""
    return round(2 * result.thermo["KinEng"][0] / (BOLTZMANN * result.thermo["Temp"][0]))


def of_run(result, reference, dt, parts, asked):
    """All numbers of a run.

    Args:
        result: the complete ``run.Result``.
        reference: the reference solution's, which ends at the horizon; None if no measure asks for it.
        dt: fs.
        parts: the run's ``sweep.Parts``.
        asked: names of the measures; nothing else is computed.

    Returns:
        dict: of the measures an ``Estimate``, or where only all starts together give one, what it is made of: ``g_oo`` (blocks, bins);
        ``convergence`` the energy's deviations from its mean, (samples,); ``ke_distribution`` energies of single bodies; ``pv_equipartition`` kinetic
        energies of translation and rotation, (2, samples).  Also ``cost`` and ``cpu``, lists: s per simulated ns of each timed segment;
        ``temperature``; degrees of freedom: ``all``, ``moving`` and ``turning``.
    """
    sampled = (result.thermo["Step"] >= parts.begin) & (result.thermo["Step"] <= parts.end)
    thermo = {name: values[sampled] for name, values in result.thermo.items()}
    energy, time, kelvin, total = (
        thermo["TotEng"],
        thermo["Step"] * dt / FS_PER_PS,
        thermo["Temp"].mean(),
        degrees_of_freedom(result),
    )
    motion = Motion(result.positions)
    # LAMMPS's degrees of freedom are three less, for the momentum is kept: these are translations, of bodies and free atoms alike
    moving = 3 * motion.count * (1 - 1 / (motion.count + motion.free))
    turning = total - 3 * (motion.count + motion.free - 1)
    makers = {
        "energy_sd": lambda: measures.standard_deviation(energy),
        "energy_sd_line": lambda: measures.about_line(time, energy),
        "drift": lambda: measures.drift(time, energy).times(
            PS_PER_NS / (BOLTZMANN * kelvin * total)
        ),
        "paper": lambda: measures.mean(np.abs(energy - energy.mean()) / abs(energy.mean())),
        "position": lambda: motion.distance(parts.at_horizon, reference.positions["x"][-1]),
        "orientation": lambda: motion.angle(parts.at_horizon, reference.positions["x"][-1]),
        "potential": lambda: measures.mean(thermo["PotEng"] / motion.count),
        "equipartition": lambda: measures.mean(
            2 / BOLTZMANN * (thermo["v_translation"] / moving - thermo["v_rotation"] / turning)
        ),
        "pressure": lambda: measures.mean(thermo["Press"]),
        "g_oo": lambda: sweep_structure.pair_distribution(motion, parts.frames),
        "helix": lambda: measures.mean(sweep_structure.helicity(motion, parts.frames)),
        "bond": lambda: Estimate(motion.bond_error()),
        "angle": lambda: Estimate(motion.angle_error()),
        "convergence": lambda: energy - energy.mean(),
        "ke_distribution": lambda: motion.kinetic(parts.frames)[
            :: ceil(APART * FS_PER_PS / (parts.frame * dt))
        ].ravel(),
        "pv_equipartition": lambda: np.array([thermo["v_translation"], thermo["v_rotation"]]),
    }
    timed = [
        (one, one["loop"] / one["steps"] / dt * FS_PER_NS)
        for one in (result.timings[index] for index in parts.segments)
    ]
    return {name: makers[name]() for name in asked} | {
        "cost": [seconds for _, seconds in timed],
        "cpu": [seconds * one["ranks"] * one["cpu"] / 100 for one, seconds in timed if one["cpu"] is not None],
        "temperature": kelvin, "all": total, "moving": moving, "turning": turning,
    }  # fmt: skip


def pooled(starts):
    """The mean over starts, with the larger margin of what the runs tell and what their scatter tells.

    Args:
        starts: an ``Estimate`` of each.
    """
    scattered = measures.of_few([one.value for one in starts])
    runs = Estimate(
        scattered.value, *measures.combined(*(one.times(1 / len(starts))[1:] for one in starts))
    )
    return max(runs, scattered, key=lambda one: one.margin)


def limits(found, swept):
    """Averages at steps of zero length, from the symplectic schemes' points with steps up to ``Sweep.law``.

    Fitted is, start by start, a + b dt^2, weighted, with one a for all and a b for each integrator, which differ in what they leave out.  Runs from
    the same start are near each other at first, so a limit is not surer than the surest average that it is from.

    Args:
        found: ``Point`` to the list of its starts' numbers.
        swept: the ``Sweep``.

    Returns:
        dict: measure to ``starts``, a list of each start's ``Estimate``, and ``all``, of all, as plain data; without those for which
        there are too few points.
    """
    used = [
        point
        for point in found
        if point.integrator.name in SYMPLECTIC
        and point.dt <= swept.law
        and swept.same(point.integrator)
    ]
    number = min((len(found[point]) for point in used), default=0)
    names = list(dict.fromkeys(point.integrator.name for point in used))
    matrix = np.array(
        [
            [1.0, *(point.dt**2 * (point.integrator.name == name) for name in names)]
            for point in used
        ]
    )
    if not number or np.linalg.matrix_rank(matrix) < 1 + len(names):
        return {}
    fitted = {}
    for name in set(AVERAGES) & set(swept.measures):
        each = [
            _limit(matrix, [found[point][start][name] for point in used]) for start in range(number)
        ]
        fitted[name] = {"starts": each, "all": pooled(each).plain()}
    return fitted


def _limit(matrix, averages):
    """Of one start, from the points' ``Estimate``s: the fit's first parameter."""
    values, errors = (np.array([one[k] for one in averages]) for k in (0, 1))
    covariance = np.linalg.inv(matrix.T / errors**2 @ matrix)
    fit = covariance @ (matrix.T / errors**2 @ values)
    more = len(values) - len(fit)
    scale = (
        max(1.0, np.sqrt(np.sum(((values - matrix @ fit) / errors) ** 2) / more)) if more else 1.0
    )
    surest = min(averages, key=lambda one: one.margin)
    fitted = Estimate(
        fit[0], scale * np.sqrt(covariance[0, 0]), more if scale > 1 else surest.freedom
    )
    return max(fitted, surest._replace(value=fit[0]), key=lambda one: one.margin)


def _off_limit(averages, limit):
    """An average less its limit, start by start.

    Of ``ENOUGH`` starts that is their scatter, which knows how much of a start's chance both share; else, too large then, as if they shared none.
    """
    pairs = list(zip(averages, limit["starts"]))
    if len(pairs) >= ENOUGH:
        return measures.of_few([one.value - at.value for one, at in pairs])
    return pooled(
        [Estimate(one.value - at.value, *measures.combined(one[1:], at[1:])) for one, at in pairs]
    )


def of_points(found, limits, swept):
    """The errors of all points.

    Args:
        found: ``Point`` to the list of its starts' numbers.
        limits: see `limits`.
        swept: the ``Sweep``.

    Returns:
        dict: ``Point`` to (errors, signed), each measure to an ``Estimate`` as plain data; errors are not negative.
    """
    return {
        point: _of_point(point, found, limits, swept) for point, numbers in found.items() if numbers
    }


def _of_point(point, found, limits, swept):
    numbers, errors, signed = found[point], {}, {}
    for name in swept.measures_of(point.integrator):
        if name in TOGETHER:
            together = TOGETHER[name](point, found)
            if together:
                errors[name] = together.plain()
            continue
        each = [one[name] for one in numbers]
        if name in AVERAGES and name not in limits:
            continue
        if name in AVERAGES:
            one = _off_limit(each, limits[name])
        elif name in LARGEST:
            one = max(each)
        else:
            one = pooled(each)
        if name == "helix":
            one = one._replace(value=1 - one.value)
        if name in ("drift", "helix", *AVERAGES):
            signed[name] = one.plain()
        errors[name] = one._replace(
            value=max(one.value, 0.0) if name == "helix" else abs(one.value)
        ).plain()
    return errors, signed


def _pair_distribution(point, found):
    """The rms difference from the mean of the symplectic schemes at steps up to `SMALL`, without what noise makes of it; None without these.

    It is taken start by start, for runs from one start are like each other: the mean product of the differences from two starts has no noise of its own.
    Its error is by the jackknife over starts.  Of fewer than ``ENOUGH`` starts their blocks stand for starts, which shares the start's chance.
    """
    held = [
        one
        for one in found
        if one.integrator.name in SYMPLECTIC and one.dt <= SMALL and one != point and found[one]
    ]
    if not held:
        return None
    starts = min(len(found[one]) for one in (point, *held))
    differences = np.array(
        [
            found[point][start]["g_oo"]
            - np.mean([found[one][start]["g_oo"] for one in held], axis=0)
            for start in range(starts)
        ]
    )
    differences = (
        differences.mean(axis=1)
        if starts >= ENOUGH
        else differences.reshape(-1, differences.shape[-1])
    )
    products = differences @ differences.T / differences.shape[1]
    number, own = len(products), np.diag(products)
    square = (products.sum() - own.sum()) / (number * (number - 1))
    without = (products.sum() - own.sum() - 2 * (products.sum(axis=1) - own)) / (
        (number - 1) * (number - 2)
    )  # one of them
    margin = measures.margin(
        np.sqrt((number - 1) / number * np.sum((without - without.mean()) ** 2)), number - 1
    )
    value, least, most = np.sqrt(
        np.maximum([square, square - margin, max(square, 0.0) + margin], 0.0)
    )
    return Estimate(
        value, max(value - least, most - value) / measures.margin(1.0, number - 1), number - 1
    )


def _convergence(point, found):
    """Against the same integrator's next shorter step; None if there is none."""
    shorter = [
        one
        for one in found
        if one.integrator is point.integrator and one.dt < point.dt and found[one]
    ]
    if not shorter:
        return None
    pair = point, max(shorter, key=lambda one: one.dt)
    value = sweep_structure.convergence(
        {one.dt: np.concatenate([numbers["convergence"] for numbers in found[one]]) for one in pair}
    )
    scaled = measures.quotient(
        *(pooled([numbers["energy_sd"] for numbers in found[one]]) for one in pair)
    ).times((pair[1].dt / pair[0].dt) ** 2)
    return scaled._replace(value=value)


def _distribution(point, found):
    """Of all starts together, in standard deviations."""
    numbers = found[point]
    energies = np.concatenate([one["ke_distribution"] for one in numbers])
    return Estimate(
        sweep_structure.distribution(energies, np.mean([one["temperature"] for one in numbers])),
        1.0,
    )


def _equipartition(point, found):
    """Of all starts together, of each those samples that are independent; in standard deviations."""
    numbers = found[point]
    each = (one["pv_equipartition"] for one in numbers)
    series = np.concatenate(
        [pair[:, :: ceil(max(map(measures.statistical_inefficiency, pair)))] for pair in each],
        axis=1,
    )
    temperature = np.mean([one["temperature"] for one in numbers])
    return Estimate(
        sweep_structure.equipartition(
            *series, numbers[0]["moving"], numbers[0]["turning"], temperature
        ),
        1.0,
    )


TOGETHER = {
    "g_oo": _pair_distribution,
    "convergence": _convergence,
    "ke_distribution": _distribution,
    "pv_equipartition": _equipartition,
}
