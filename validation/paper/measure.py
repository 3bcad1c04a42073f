"""From the energies of ``paper`` to numbers with errors, and what they say of the paper's
statements.

The paper's measure is Delta E(t) = [E(t) - <E>] / |<E>|, with the averages along the trajectory
(caption of figure 2); its average is here the mean of |Delta E|.  |<E>| depends on the zero of
energy, which the paper does not name: so each measure is given for several zeros.

Only trajectories that are complete are judged, but for Gear's.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..running.trajectory import Series
from ..scenes import FS_PER_PS, TEMPERATURE
from ..scenes import peptide as paper_peptide
from ..scenes.integrators import PAPER
from ..statistics import measures
from ..statistics.check import Check
from ..statistics.estimate import Estimate, combined, plain
from ..statistics.positions import Positions
from .plan import AVERAGE_MEASURE, DT, ORDERED, SMALL_DT, STATEMENTS, STEPS

Found = Mapping[str, Series]  # by the trajectory's name
Pairs = list[tuple[Series, ...]]  # of trajectories from the same start

TITLES = {
    "dimer": "The light water dimer, figure 2a",
    "liquid": "Liquid water, figure 2b",
    "peptide": "The peptide in water, figure 3",
    "helix": "The peptide's helix",
    "gear": "Gear's scheme",
    "force field": "The force field's own part",
    "scaling": "How the energy's deviation goes with time step and size",
    "rigidity": "Rigid groups",
}
PARTS = 8  # of a trajectory, for the error of a ratio
SURE_DRIFT = 2.5  # margins (95 %) that a drift has which is none by chance
LOST = 0.05  # of Richardson's drift, that another one may be
# "far more accurate", "about": one order of magnitude, and the same one
FAR, NEAR = 10.0, np.sqrt(10.0)
# off 1: a ratio, also in its 95 % margins; the margin that tells something
EQUAL, EQUAL_MARGINS, TELLING = 0.15, 1.5, 0.1
SAME = 0.02  # off 1: a ratio of deviations from the same start
SOON = 0.5  # ps for which two schemes stay near each other
# steps in which Gear's scheme, begun with a free body's derivatives, finds the right ones: its
# energy jumps meanwhile
BEGINNING = 20
KELVIN = 5.0  # that a mean temperature may be off
RIGID = 1e-10  # Angstrom
DOMINATES = 0.5  # of the energy's variance
UNCHANGED = 0.01  # of the energy's deviation
HELIX, BENT = 0.75, 2.5  # of the residues that are helical at the start; Angstrom from it
FEW = 16  # samples: less says nothing
# ps, about whose means a deviation is taken; of a run, that new velocities settle in
WINDOW, SETTLED = 0.5, 0.2
# exponents of the deviation
TIME_LAW, TIME_LAW_WITHIN, SIZE_LAW, SIZE_LAW_WITHIN = 2.0, 0.3, 0.5, 0.15
OTHER = "matubayasi-nakahara"
OVER = "reference 12 over NO_SQUISH"
_ABOUT = f"sd of energy about the means of {WINDOW:g} ps ∝"
TIME_WORDS = f"peptide: {_ABOUT} Δt to the power of"
SIZE_WORDS = f"water: {_ABOUT} number of molecules to the power of"


def judge(found: Found) -> dict:
    """All numbers of trajectories, complete or not, as plain data: ``rows`` of the table,
    ``checks``, ``conventions``, ``force_field``, ``sizes``, ``helix``."""
    complete = {name: one for name, one in found.items() if not one.error}
    whole = {name: one for name, one in complete.items() if len(one.total) >= FEW}
    helix, sizes, force_field = _helix(whole), _sizes(whole), list(_force_field(whole))
    laws = list(_laws(whole, sizes))
    exponents = {check.what: check.value for check in laws}
    conventions = list(_conventions(complete, whole, exponents))
    checks = [*_dimer(whole), *_liquid(whole), *_peptide(whole, conventions)]
    checks += [*_helix_checks(helix), *_gear(found, whole)]
    checks += [*_force_field_checks(whole, force_field), *laws, *_rigidity(complete)]
    paths = {name: {key: x.tolist() for key, x in one.items()} for name, one in helix.items()}
    return {
        "rows": [row(one) for one in found.values()],
        "checks": [check.plain() for check in checks],
        "conventions": conventions,
        "force_field": [plain(vars(one)) for one in force_field],
        "sizes": [plain(one) for one in sizes],
        "helix": paths,
    }


def row(one: Series) -> dict:
    """The numbers of one trajectory; those that could not be measured are not there."""
    made = one.trajectory
    found = {
        "name": made.name,
        "scene": made.scene.name,
        "integrator": made.integrator.label,
        "lines": made.integrator.commands(made.scene),
        "dt": made.dt,
        "error": one.error,
        "ps": float(one.time[-1]) if len(one.time) else 0.0,
        "seconds": one.seconds,
    }
    if len(one.total) >= FEW:
        found |= {
            "temperature": measures.mean(one.temperature),
            "energy": float(one.total.mean()),
            "sd": measures.standard_deviation(one.total),
            "sd_line": measures.about_line(one.time, one.total),
            "measure": measures.mean(measure(one.total)),
            "drift": measures.drift(one.time, one.total),
        }
    return plain(found | ({"rigidity": rigidity(one.positions)} if one.positions else {}))


def measure(total: np.ndarray) -> np.ndarray:
    """|Delta E| of each sample."""
    return np.abs(total - total.mean()) / abs(total.mean())


def rigidity(positions: Positions) -> float:
    """Largest change of a distance within a rigid body, Angstrom, from the start to the end."""
    pairs, (start, *_, end) = measures.body_pairs(positions.bodies), positions.x
    cell = positions.cell, positions.periodic
    return float(measures.rigidity_error(start, end, pairs, *cell))


def parts_of(total: np.ndarray, parts: int = PARTS) -> np.ndarray:
    """The energy in equal parts of a trajectory: (parts, samples)."""
    size = len(total) // parts
    return total[: parts * size].reshape(parts, size)


# ---- of several trajectories


def _length(*series: Series) -> str:
    """How long the shortest is, in words."""
    return f"{min(one.time[-1] for one in series):.4g} ps"


def _shortest(pair: Sequence[Series]) -> int:
    return min(len(one.total) for one in pair)


def _numbered(whole: Found, start: str) -> dict[str, Series]:
    """Trajectories whose names are a number behind this, by the number."""
    return {name.removeprefix(start): one for name, one in whole.items() if name.startswith(start)}


def _pairs(first: Found, second: Found) -> Pairs:
    """Trajectories from the same start."""
    return [(first[n], second[n]) for n in first if n in second]


def _ratio(pairs: Pairs, of: Callable[[Series], float]) -> Estimate:
    """A number of the second trajectory over that of the first one, mean of all pairs, with the
    error that their scatter tells."""
    return measures.ratio(*([of(one) for one in series] for series in zip(*pairs)))


def _average(one: Series) -> float:
    return measure(one.total).mean()


def _drift(series: Sequence[Series]) -> Estimate:
    """The mean drift of trajectories; of several starts its error is from their scatter."""
    fits = [measures.drift(one.time, one.total) for one in series]
    return fits[0] if len(fits) == 1 else measures.of_few([fit.value for fit in fits])


def _scatters(ours: Sequence[float], others: Sequence[float]) -> str:
    """The two standard deviations and their ratio, in words."""
    first, second = (np.std(one, ddof=1) for one in (ours, others))
    return f"{second:.2g} and {first:.2g} kcal/mol, {second / first:.2g} times"


def _deviation(series: Sequence[Series]) -> float:
    """sd of the energy about each trajectory's mean, root mean square of all."""
    return np.sqrt(np.mean([one.total.var() for one in series]))


def _steady(check: Callable, name: str, series: Sequence[Series]) -> Check:
    """Stable: the drift moves the energy by less than it fluctuates anyway."""
    slope = _drift(series)
    scale = min(one.time[-1] for one in series) / _deviation(series)
    several = f", mean of {len(series)} starts" * (len(series) > 1)
    what = f"stable: drift of the energy, times {_length(*series)}, over its sd"
    note = f"drift {slope.text()} kcal/mol/ps{several}"
    return check(PAPER[name].label, what, slope.times(scale), low=-1.0, high=1.0, note=note)


# ---- figures 2a, 2b and 3


def _dimer(whole: Found) -> Iterator[Check]:
    """Figure 2a.

    All starts are of one trajectory of NO_SQUISH, so they have one shadow energy.  Reference 12's,
    did it exist, would be the same up to the rotor splitting's small part.  What keeps a shadow
    energy has the same mean energy from each start; what has none wanders.
    """
    check = partial(Check.of, "dimer", source=STATEMENTS["dimer"])
    ours, other = (_numbered(whole, f"dimer-{name}-") for name in ("nosquish", OTHER))
    pairs = _pairs(ours, other)
    if len(pairs) > 1:
        span, starts = _length(*sum(pairs, ())), f"{len(pairs)} starts"
        what = f"more accurate: average measure, {span}, mean of {starts}"
        yield check(OVER, what, _ratio(pairs, _average), low=1.0)
        first, second = ([one.total.mean() for one in series] for series in zip(*pairs))
        what = f"its slow part: log10 of the scatter of ⟨E⟩ over {starts} with one shadow energy, "
        note = (
            f"{_scatters(first, second)}; all starts lie on one trajectory of NO_SQUISH, and the "
            "shadow energy that they share is NO_SQUISH's"
        )
        over = measures.scatters_apart(first, second)
        yield check(OVER, what + f"{span} each", over, low=0.0, note=note)
        what = f"sd of energy in the first {SOON:g} ps, mean of {starts}"
        same = _ratio(pairs, lambda one: one.total[one.time <= SOON].std())
        note = (
            "nearly all of it is the force splitting's error, which both share: see the theory's "
            "page for the two splittings' H⁽²⁾"
        )
        yield check(OVER, what, same, low=1.0 - SAME, high=1.0 + SAME, source="", note=note)
    if starting := whole.get("dimer-starts"):
        aim, mean = TEMPERATURE["dimer"], measures.mean(starting.temperature)
        what = f"mean temperature of the trajectory that all starts are of, {_length(starting)}"
        usual = {"unit": "K", "source": "Caption of figure 2"}
        yield check("NO_SQUISH", what, mean, low=aim - KELVIN, high=aim + KELVIN, **usual)
    for name, series in ("nosquish", ours), (OTHER, other):
        if len(series) > 1:
            yield _steady(check, name, list(series.values()))


def _liquid(whole: Found) -> Iterator[Check]:
    """Figure 2b."""
    check = partial(Check.of, "liquid", source=STATEMENTS["liquid"])
    ours, other, small = (whole.get(f"water-{name}") for name in ("nosquish", OTHER, "small-step"))
    if ours and other:
        span = _length(ours, other)
        over = measures.quotient(*(measures.standard_deviation(one.total) for one in (other, ours)))
        yield check(OVER, f"more accurate: sd of energy about its mean, {span}", over, low=1.0)
        first, second = (parts_of(one.total).mean(axis=1) for one in (ours, other))
        note = _scatters(first, second)
        if small:
            walk = measures.random_walk(small.time, small.total)
            rates = np.maximum([walk.value, walk.value + walk.margin], 0)
            made, most = np.sqrt(ours.time[-1] / 6 * rates)
            note += f"; the force field's own random walk, as with {SMALL_DT:g} fs, makes "
            note += f"{made:.2g} in {span}, at most {most:.2g}"
        what = f"wander: log10 of the sd of the energy's means in {PARTS} parts, {span}"
        over = measures.scatters_apart(first, second, measures.freedom_of_walk(PARTS))
        yield check(OVER, what, over, low=0.0, note=note)
    for name, one in ("nosquish", ours), (OTHER, other):
        if one:
            yield _steady(check, name, [one])


def _peptide(whole: Found, conventions: list[dict]) -> Iterator[Check]:
    """Figure 3."""
    check = partial(Check.of, "peptide", source=STATEMENTS["peptide"])
    names = "nosquish", "shake", "rigid/nve/small", "rigid/small", ORDERED
    series = {name: whole[f"peptide-{name}"] for name in names if f"peptide-{name}" in whole}
    for entry in conventions:
        name = entry["name"].removeprefix("peptide-")
        if name in series and entry["convention"] == "over |total energy|":
            what = f"average measure about {AVERAGE_MEASURE:g}, {_length(series[name])}"
            bounds = {"low": AVERAGE_MEASURE / NEAR, "high": AVERAGE_MEASURE * NEAR}
            yield check(PAPER[name].label, what, Estimate.of(entry), **bounds)
    for name, against in (ORDERED, "rigid/nve/small"), ("nosquish", "shake"):
        if {name, against} <= series.keys():
            yield from _equal(check, series, name, against)
    drifts = {name: _drift([one]) for name, one in series.items() if name != ORDERED}
    for name, slope in drifts.items():
        label, span = PAPER[name].label, _length(series[name])
        note = f"{slope.text()} kcal/mol/ps"
        if name == "rigid/small":
            off, what = abs(slope.value) / slope.margin, f"drifts: |drift| of the energy, {span}"
            how = {"unit": "margins", "source": "Richardson's scheme, which is not symplectic"}
            yield check(label, what, off, low=SURE_DRIFT, note=note, **how)
        elif "rigid/small" in drifts:
            over = measures.quotient(slope, drifts["rigid/small"])
            what = f"stable: drift over that of rigid/small, {span}"
            yield check(label, what, over, low=-LOST, high=LOST, note=note)
        else:
            yield _steady(check, name, [series[name]])


def _equal(check: Callable, series: Found, name: str, against: str) -> Iterator[Check]:
    """Two integrators, in parts of the same length."""
    both = series[against], series[name]
    label = f"NO_SQUISH{' order 123' if name == ORDERED else ''} over {PAPER[against].label}"
    what = f"equal: sd of energy about the means of {PARTS} parts, {_length(*both)}"
    samples = _shortest(both)
    over = measures.ratio(*(parts_of(one.total[:samples]).std(axis=1, ddof=1) for one in both))
    yield check(label, what, over, low=1.0 - EQUAL, high=1.0 + EQUAL)
    if name == ORDERED:  # these are one scheme; shake is another
        tells = over.margin < TELLING
        note = f"margin {over.margin:.2g}" + ("" if tells else f", must be below {TELLING:g}")
        off = abs(over.value - 1) / over.margin if tells else None
        what = "equal within the margin: that ratio less 1"
        yield check(label, what, off, high=EQUAL_MARGINS, unit="margins", note=note)


def _conventions(complete: Found, whole: Found, exponents: dict) -> Iterator[dict]:
    """The average measure with several zeros of energy, and what size and step would give the
    paper's.

    Args:
        exponents: of `TIME_WORDS` and `SIZE_WORDS`, as far as they are measured.
    """
    zero = {
        name: complete[f"peptide-{name}"].potential[0]
        for name in ("nosquish", "alone", "within")
        if f"peptide-{name}" in complete
    }
    peptides = ("nosquish", "shake", "rigid/nve/small")
    names = *(f"peptide-{name}" for name in peptides), "water-nosquish", f"water-{OTHER}"
    for name in (name for name in names if name in whole):
        one = whole[name]
        total, potential, kinetic = (x.mean() for x in (one.total, one.potential, one.kinetic))
        scales = {"total energy": total, "potential energy": potential, "kinetic energy": kinetic}
        if name.startswith("peptide") and "alone" in zero:
            what = "potential energy less that of the molecules apart"
            scales[what] = potential - zero["alone"]
        if name.startswith("peptide") and {"within", "nosquish"} <= zero.keys():
            what = "total energy with the Coulomb energy of bonded atoms"
            scales[what] = total + zero["within"] - zero["nosquish"]
        off = np.abs(one.total - total)
        entries = [(f"over |{what}|", scale, off) for what, scale in scales.items()]
        what = "E - E(0) in place of E - <E>, over |total energy|"
        entries.append((what, total, np.abs(one.total - one.total[0])))
        for convention, scale, deviations in entries:
            average = measures.mean(deviations).times(1 / abs(scale))
            entry = {"name": name, "convention": convention, "scale": float(scale)}
            entry |= average.plain() | _for_it(one, average.value / AVERAGE_MEASURE, exponents)
            yield entry


def _for_it(one: Series, over: float, exponents: dict) -> dict:
    """How many bodies, whether the measure is about the paper's, and what step and size would make
    it so: it is so many times ``over``."""
    made = one.trajectory
    found: dict = {"bodies": made.scene.unit, "about": bool(1 / NEAR < over < NEAR)}
    if TIME_WORDS in exponents:
        found["dt_for_it"] = float(made.dt * (1 / over) ** (1 / exponents[TIME_WORDS]))
    if SIZE_WORDS in exponents:  # the scale goes with the size itself
        found["size_for_it"] = float(made.scene.unit * over ** (1 / (1 - exponents[SIZE_WORDS])))
    return found


# ---- time step and size


def _settled(one: Series) -> np.ndarray:
    return one.total[one.time > SETTLED * one.time[-1]]


def _in_windows(one: Series) -> Estimate:
    """sd of the energy about the means of windows of `WINDOW`, so without what wanders."""
    kept, size = _settled(one), round(WINDOW / (one.time[1] - one.time[0]))
    windows = parts_of(kept, max(1, len(kept) // size))
    return measures.standard_deviation((windows - windows.mean(axis=1, keepdims=True)).ravel())


def _sizes(whole: Found) -> list[dict]:
    """sd of the energy and average measure of boxes of water."""
    rows = []
    for one in (one for name, one in whole.items() if name.removeprefix("water-").isdigit()):
        average = measures.mean(measure(_settled(one)))
        bodies = one.trajectory.scene.unit
        rows.append({"bodies": bodies, "sd": _in_windows(one), "measure": average})
    return sorted(rows, key=lambda entry: entry["bodies"])


def _laws(whole: Found, sizes: list[dict]) -> Iterator[Check]:
    """The exponents with which the deviation goes with time step and size."""
    names = {dt: f"peptide-at-{dt:g}-fs" for dt in STEPS}
    steps = [(dt, _in_windows(whole[name])) for dt, name in names.items() if name in whole]
    boxes = [(row["bodies"], row["sd"]) for row in sizes]
    for what, points, law, off in (
        (TIME_WORDS, steps, TIME_LAW, TIME_LAW_WITHIN),
        (SIZE_WORDS, boxes, SIZE_LAW, SIZE_LAW_WITHIN),
    ):
        if len(points) > 1:
            how: dict = {"low": law - off, "high": law + off}
            how["note"] = ", ".join(f"{x:g}: {sd.text()}" for x, sd in points) + " kcal/mol"
            yield Check.of("scaling", "NO_SQUISH", what, measures.power(*zip(*points)), **how)


# ---- Gear's scheme


def begun(one: Series) -> Series:
    """A trajectory without its first `BEGINNING` steps."""
    kept = one.time > BEGINNING * one.trajectory.dt / FS_PER_PS
    names = "time", "total", "kinetic", "potential", "temperature"
    return replace(one, **{name: getattr(one, name)[kept] for name in names})


def gear_pairs(whole: Found) -> dict[str, Pairs]:
    """Complete trajectories of NO_SQUISH and of Gear's scheme from the same starts, both `begun`:
    scene to pairs, where there are several."""
    names = {"dimer": "dimer-{}-"}
    names |= {scene: scene + "-{}-short-step-" for scene in ("water", "peptide")}
    found = {}
    for scene, start in names.items():
        both = (_numbered(whole, start.format(name)) for name in ("nosquish", "gear"))
        pairs = [tuple(map(begun, pair)) for pair in _pairs(*both)]
        found[scene] = [pair for pair in pairs if _shortest(pair) >= FEW]
    return {scene: pairs for scene, pairs in found.items() if len(pairs) > 1}


def _gear(found: Found, whole: Found) -> Iterator[Check]:
    """Gear's scheme: at the same step, and from the same starts at a step at which it does not fail
    at once.

    Its error grows with the time, by its drift, and so does the ratio of the average measures: it
    is the drift that "far" is asked of.
    """
    check = partial(Check.of, "gear", source=STATEMENTS["gear"])
    for scene in "water", "peptide":
        if gear := found.get(f"{scene}-gear"):
            span = f"{gear.trajectory.steps * DT / FS_PER_PS:g} ps"
            what = f"unstable at {DT:g} fs: largest |E − E(0)| over the kinetic energy, {span}"
            total, note = gear.total, f"ended: {gear.error}" if gear.error else ""
            value = np.abs(total - total[0]).max() / gear.kinetic[0] if len(total) else None
            yield check(f"Gear, {scene}", what, value, low=1.0, note=note)
    for scene, pairs in gear_pairs(whole).items():
        yield from _against_gear(check, scene, pairs)


def _against_gear(check: Callable, scene: str, pairs: Pairs) -> Iterator[Check]:
    """Both schemes from the same starts."""
    ours, theirs = zip(*pairs)
    span = min(one.time[-1] for pair in pairs for one in pair)
    where = f"at {theirs[0].trajectory.dt:g} fs"
    when = f"{span:.4g} ps without the first {BEGINNING} steps, {len(pairs)} starts"
    ours_drift, drift = _drift(ours), _drift(theirs)
    note, off = f"{drift.text()} kcal/mol/ps", abs(drift.value) / drift.margin
    subject, what = f"Gear, {scene}", f"drifts {where}: |drift| of the energy, {when}"
    yield check(subject, what, off, low=SURE_DRIFT, unit="margins", note=note)
    what = f"less accurate {where}: average measure, {when}"
    yield check(f"Gear over NO_SQUISH, {scene}", what, _ratio(pairs, _average), low=1.0)
    far, what = None, f"far more accurate {where}: drift of the energy, {when}"
    told = f"Gear's drift itself cannot be told: {note}"
    if off >= SURE_DRIFT:  # nothing can be said over a drift that may be none
        far, told = measures.quotient(ours_drift, drift), f"{ours_drift.text()} and {note}"
    bounds = {"low": -1 / FAR, "high": 1 / FAR}
    yield check(f"NO_SQUISH over Gear, {scene}", what, far, **bounds, note=told)
    if far is None:
        return
    speed = drift._replace(value=abs(drift.value))
    crossing = measures.quotient(Estimate(_deviation(ours)), speed)
    soon = [
        tuple(replace(one, total=one.total[one.time < crossing.value]) for one in pair)
        for pair in pairs
    ]
    note = ""
    if min(map(_shortest, soon)) >= FEW:
        times = _ratio(soon, _average).text()
        note = f"up to there Gear's average measure is {times} times NO_SQUISH's"
    what = f"after which time its drift {where} is more than the sd of NO_SQUISH's energy"
    yield check(subject, what, crossing, high=span, unit="ps", note=note)


# ---- the force field, the helix, rigid groups


@dataclass(frozen=True)
class ForceField:
    """The energy at a small step, of one variant of the force field."""

    name: str
    ps: float  # how long
    sd: Estimate  # the energy's fluctuation, kcal/mol
    walk: Estimate  # its random walk, (kcal/mol)^2/ps
    variance: Estimate | None = None  # what both make of a run at the usual step, if there is one
    usual_ps: float | None = None  # that run's length, and its variance
    usual_variance: float | None = None


def _force_field(whole: Found) -> Iterator[ForceField]:
    usual = whole.get("peptide-nosquish")
    for name, one in _numbered(whole, "force-field-").items():
        sd, walk = measures.standard_deviation(one.total), measures.random_walk(one.time, one.total)
        entry = ForceField(name, float(one.time[-1]), sd, walk)
        if usual:
            # a walk's variance about its own mean goes with a sixth of the time
            longer = (usual.time[-1] - one.time[-1]) / 6
            square, wander = sd.times(2 * sd.value), walk.times(longer)
            error = combined(square[1:], wander[1:])
            variance = Estimate(sd.value**2 + wander.value, *error)
            of_usual = float(usual.time[-1]), float(usual.total.var())
            entry = ForceField(name, entry.ps, sd, walk, variance, *of_usual)
        yield entry


def _force_field_checks(whole: Found, rows: list[ForceField]) -> Iterator[Check]:
    """Of the force field as it is: its part of the variance, and what the neighbour list does to
    it."""
    check = partial(Check.of, "force field", "peptide, NO_SQUISH")
    for one in rows:
        if one.name == "as it is" and one.variance and one.usual_variance:
            part = one.variance.times(1 / one.usual_variance)
            what = f"its part of the energy's variance in {one.usual_ps:.4g} ps at {DT:g} fs"
            note = f"from {one.ps:.3g} ps at {SMALL_DT:g} fs: sd {one.sd.text()} kcal/mol, "
            note += f"random walk {one.walk.text()} (kcal/mol)²/ps"
            yield check(f"does not dominate: {what}", part, high=DOMINATES, note=note)
    names = (f"force-field-{name}" for name in ("as it is", "neighbour list each step"))
    as_it_is, renewed = map(whole.get, names)
    if as_it_is and renewed:
        # later the two are different trajectories, for rounding grows with chaos
        soon = as_it_is.time <= SOON
        value = np.abs(renewed.total - as_it_is.total)[soon].max() / as_it_is.total.std()
        what = "neighbour list made each step: largest change of the energy, over its sd"
        span = f"{min(SOON, as_it_is.time[-1]):.3g} ps"
        yield check(f"{what}, {span}", value, high=UNCHANGED)


def _helix(whole: Found) -> dict[str, dict]:
    names = (f"peptide-{name}" for name in ("nosquish", "shake", "rigid/nve/small"))
    found = {
        name: paper_peptide.helix(whole[name].pieces, DT / FS_PER_PS)
        for name in names
        if name in whole
    }
    return {name: path for name, path in found.items() if path}


def _helix_checks(helix: dict[str, dict]) -> Iterator[Check]:
    for name, path in helix.items():
        late, begun = path["time"] > 0.5 * path["time"][-1], path["helical"][0]
        if late.sum() < 2:
            continue
        check = partial(Check.of, "helix", PAPER[name.removeprefix("peptide-")].label)
        span = f"second half of {path['time'][-1]:.4g} ps"
        kept, bent = (measures.mean(x[late]) for x in (path["helical"] / begun, path["rmsd"]))
        what = f"kept: helical residues by DSSP over those of the start, {span}"
        yield check(what, kept, low=HELIX, note=f"{begun} at the start")
        what = f"kept: backbone's RMSD from the start, {span}"
        yield check(what, bent, high=BENT, unit="Å")


def _rigidity(complete: Found) -> Iterator[Check]:
    """The worst of all runs with rigid-body fixes."""
    worst = {
        name: rigidity(one.positions)
        for name, one in complete.items()
        if one.positions and one.trajectory.integrator.kind != "constraints"
    }
    if worst:
        name = max(worst, key=lambda name: worst[name])
        who = f"all {len(worst)} runs with rigid-body fixes"
        what = "largest change of a distance within a group"
        yield Check.of("rigidity", who, what, worst[name], high=RIGID, unit="Å", note=name)
