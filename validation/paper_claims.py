"""From the energies of ``paper`` to numbers with errors, and what they say of the paper's statements.

The paper's measure is Delta E(t) = [E(t) - <E>] / |<E>|, with the averages along the trajectory (caption of figure 2); its
average is here the mean of |Delta E|.  |<E>| depends on the zero of energy, which the paper does not name: so each
measure is given for several zeros.

Only trajectories that are complete are judged, but for Gear's.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from validation import measures, paper_peptide
from validation.check import Check, number
from validation.integrators import PAPER
from validation.paper import (
    AVERAGE_MEASURE,
    DT,
    FS_PER_PS,
    ORDERED,
    SMALL_DT,
    STATEMENTS,
    STEPS,
    TEMPERATURE,
)

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
STABLE = 2.5  # margins (95 %) that a drift may have
LOST = 0.05  # of Richardson's drift, that another one may be
FAR, NEAR = (
    10.0,
    np.sqrt(10.0),
)  # "far more accurate", "about": one order of magnitude, and the same one
EQUAL, EQUAL_MARGINS, TELLING = (
    0.15,
    1.5,
    0.1,
)  # off 1: a ratio, also in its 95 % margins; the margin that tells something
SAME = 0.02  # off 1: a ratio of deviations from the same start
SOON = 0.5  # ps for which two schemes stay near each other
BEGINNING = 20  # steps in which Gear's scheme, begun with a free body's derivatives, finds the right ones: its energy jumps meanwhile
KELVIN = 5.0  # that a mean temperature may be off
RIGID = 1e-10  # Angstrom
DOMINATES = 0.5  # of the energy's variance
UNCHANGED = 0.01  # of the energy's deviation
HELIX, BENT = 0.75, 2.5  # of the residues that are helical at the start; Angstrom from it
FEW = 16  # samples: less says nothing
WINDOW, SETTLED = (
    0.5,
    0.2,
)  # ps, about whose means a deviation is taken; of a run, that new velocities settle in
TIME_LAW, TIME_LAW_WITHIN, SIZE_LAW, SIZE_LAW_WITHIN = (
    2.0,
    0.3,
    0.5,
    0.15,
)  # exponents of the deviation
OTHER = "matubayasi-nakahara"
OVER = "reference 12 over NO_SQUISH"
TIME_WORDS = f"peptide: sd of energy about the means of {WINDOW:g} ps ∝ Δt to the power of"
SIZE_WORDS = (
    f"water: sd of energy about the means of {WINDOW:g} ps ∝ number of molecules to the power of"
)


def judge(found):
    """All numbers, as plain data.

    Args:
        found: name to ``paper.Series``, complete or not.

    Returns:
        dict: ``rows`` of the table, ``checks``, ``conventions``, ``force_field``, ``sizes``, ``helix``: lists and dicts.
    """
    complete = {name: one for name, one in found.items() if not one.error}
    whole = {name: one for name, one in complete.items() if len(one.total) >= FEW}
    helix, sizes, force_field = _helix(whole), _sizes(whole), _force_field(whole)
    laws = _laws(whole, sizes)
    conventions = _conventions(complete, whole, {check.what: check.value for check in laws})
    checks = [
        *_dimer(whole),
        *_liquid(whole),
        *_peptide(whole, conventions),
        *_helix_checks(helix),
        *_gear(found, whole),
    ]
    checks += [*_force_field_checks(whole, force_field), *laws, *_rigidity(complete)]
    return {
        "rows": [row(one) for one in found.values()],
        "checks": [check.plain() for check in checks],
        "conventions": conventions,
        "force_field": force_field,
        "sizes": sizes,
        "helix": {
            name: {key: values.tolist() for key, values in one.items()}
            for name, one in helix.items()
        },
    }


def row(one):
    """The numbers of one trajectory; those that could not be measured are not there."""
    made = one.trajectory
    found = {
        "name": made.name, "scene": made.scene.name, "integrator": made.integrator.label, "lines": made.integrator.commands(made.scene),
        "dt": made.dt, "error": one.error, "ps": float(one.time[-1]) if len(one.time) else 0.0, "seconds": one.seconds,
    }  # fmt: skip
    if len(one.total) >= FEW:
        found |= {
            "temperature": measures.mean(one.temperature).plain(),
            "energy": float(one.total.mean()),
            "sd": measures.standard_deviation(one.total).plain(),
            "sd_line": measures.about_line(one.time, one.total).plain(),
            "measure": measures.mean(measure(one.total)).plain(),
            "drift": measures.drift(one.time, one.total).plain(),
        }
    if one.positions:
        found["rigidity"] = rigidity(one.positions)
    return found


def measure(total):
    """|Delta E| of each sample."""
    return np.abs(total - total.mean()) / abs(total.mean())


def rigidity(positions):
    """Largest change of a distance within a rigid body, Angstrom, from the start to the end."""
    pairs = measures.body_pairs(positions["bodies"])
    return float(
        measures.rigidity_error(
            positions["x"][0], positions["x"][-1], pairs, positions["cell"], positions["periodic"]
        )
    )


def parts_of(total, parts=PARTS):
    """The energy in equal parts of a trajectory: (parts, samples)."""
    size = len(total) // parts
    return total[: parts * size].reshape(parts, size)


def _length(*series):
    """How long the shortest is, in words."""
    return f"{min(one.time[-1] for one in series):.4g} ps"


def _shortest(pair):
    return min(len(one.total) for one in pair)


def _starts(whole, name):
    """The dimer's trajectories of an integrator: number of the start to ``Series``."""
    return {
        key.rpartition("-")[2]: one
        for key, one in whole.items()
        if key.startswith(f"dimer-{name}-")
    }


def _pairs(first, second):
    """Trajectories from the same start."""
    return [(first[n], second[n]) for n in first if n in second]


def _measures(pairs):
    """The second trajectory's average measure over the first one's, mean of all pairs, with the error that their scatter tells."""
    return measures.ratio(
        *([measure(one.total).mean() for one in series] for series in zip(*pairs))
    )


def _drift(series):
    """The mean drift of trajectories; of several starts its error is from their scatter."""
    fits = [measures.drift(one.time, one.total) for one in series]
    if len(fits) == 1:
        return fits[0]
    return measures.of_few([fit.value for fit in fits])


def _deviation(series):
    """sd of the energy about each trajectory's mean, root mean square of all."""
    return np.sqrt(np.mean([one.total.var() for one in series]))


def _steady(check, name, series):
    """Stable: the drift moves the energy by less than it fluctuates anyway."""
    slope = _drift(series)
    scale = min(one.time[-1] for one in series) / _deviation(series)
    note = f"drift {number(*slope)} kcal/mol/ps" + f", mean of {len(series)} starts" * (
        len(series) > 1
    )
    what = f"stable: drift of the energy, times {_length(*series)}, over its sd"
    return check(
        PAPER[name].label, what, **slope.times(scale).plain(), low=-1.0, high=1.0, note=note
    )


def _dimer(whole):
    """Figure 2a.

    All starts are of one trajectory of NO_SQUISH, so they have one shadow energy.  Reference 12's, did it exist, would be the same up to the rotor
    splitting's small part.  What keeps a shadow energy has the same mean energy from each start; what has none wanders.
    """
    check = partial(Check, "dimer", source=STATEMENTS["dimer"])
    ours, other = _starts(whole, "nosquish"), _starts(whole, OTHER)
    pairs = _pairs(ours, other)
    if len(pairs) > 1:
        span = _length(*(one for pair in pairs for one in pair))
        yield check(
            OVER,
            f"more accurate: average measure, {span}, mean of {len(pairs)} starts",
            **_measures(pairs).plain(),
            low=1.0,
        )
        first, second = (
            measures.scatter([one.total.mean() for one in series]) for series in zip(*pairs)
        )
        yield check(OVER, f"its slow part: scatter of ⟨E⟩ over {len(pairs)} starts with one shadow energy, {span} each", **measures.quotient(second, first).plain(),
                    low=1.0, note=f"of {second.value:.2g} and {first.value:.2g} kcal/mol; all starts lie on one trajectory of NO_SQUISH, and the shadow "
                    "energy that they share is NO_SQUISH's")  # fmt: skip
        same = measures.ratio(
            *([one.total[one.time <= SOON].std() for one in series] for series in zip(*pairs))
        )
        yield check(OVER, f"sd of energy in the first {SOON:g} ps, mean of {len(pairs)} starts", **same.plain(), low=1.0 - SAME, high=1.0 + SAME, source="",
                    note="nearly all of it is the force splitting's error, which both share: see the theory's page for the two splittings' H⁽²⁾")  # fmt: skip
    if "dimer-starts" in whole:
        first, aim = whole["dimer-starts"], TEMPERATURE["dimer"]
        what = f"mean temperature of the trajectory that all starts are of, {_length(first)}"
        yield check(
            "NO_SQUISH",
            what,
            **measures.mean(first.temperature).plain(),
            low=aim - KELVIN,
            high=aim + KELVIN,
            unit="K",
            source="Caption of figure 2",
        )
    for name, series in ("nosquish", ours), (OTHER, other):
        if len(series) > 1:
            yield _steady(check, name, list(series.values()))


def _liquid(whole):
    """Figure 2b."""
    check = partial(Check, "liquid", source=STATEMENTS["liquid"])
    ours, other, small = (whole.get(f"water-{name}") for name in ("nosquish", OTHER, "small-step"))
    if ours and other:
        span = _length(ours, other)
        over = measures.quotient(*(measures.standard_deviation(one.total) for one in (other, ours)))
        yield check(
            OVER, f"more accurate: sd of energy about its mean, {span}", **over.plain(), low=1.0
        )
        first, second = (
            measures.scatter(parts_of(one.total).mean(axis=1)) for one in (ours, other)
        )
        note = f"of {second.value:.2g} and {first.value:.2g} kcal/mol"
        if small:
            walk = measures.random_walk(small.time, small.total)
            made, most = np.sqrt(
                ours.time[-1] / 6 * np.maximum([walk.value, walk.value + walk.margin], 0)
            )
            note += f"; the force field's own random walk, as with {SMALL_DT:g} fs, makes {made:.2g} in {span}, at most {most:.2g}"
        yield check(
            OVER,
            f"wander: sd of the energy's means in {PARTS} parts, {span}",
            **measures.quotient(second, first).plain(),
            low=1.0,
            note=note,
        )
    for name, one in ("nosquish", ours), (OTHER, other):
        if one:
            yield _steady(check, name, [one])


def _peptide(whole, conventions):
    """Figure 3."""
    check = partial(Check, "peptide", source=STATEMENTS["peptide"])
    names = "nosquish", "shake", "rigid/nve/small", "rigid/small", ORDERED
    series = {name: whole[f"peptide-{name}"] for name in names if f"peptide-{name}" in whole}
    for entry in conventions:
        name = entry["name"].removeprefix("peptide-")
        if name in series and entry["convention"] == "over |total energy|":
            what = f"average measure about {AVERAGE_MEASURE:g}, {_length(series[name])}"
            yield check(
                PAPER[name].label,
                what,
                entry["value"],
                entry["error"],
                AVERAGE_MEASURE / NEAR,
                AVERAGE_MEASURE * NEAR,
                freedom=entry["freedom"],
            )
    for name, against in (ORDERED, "rigid/nve/small"), ("nosquish", "shake"):
        if {name, against} <= series.keys():
            label = (
                f"NO_SQUISH{' order 123' if name == ORDERED else ''} over {PAPER[against].label}"
            )
            what = f"equal: sd of energy about the means of {PARTS} parts, {_length(series[name], series[against])}"
            samples = min(
                len(series[one].total) for one in (against, name)
            )  # parts of the same length
            over = measures.ratio(
                *(
                    parts_of(series[one].total[:samples]).std(axis=1, ddof=1)
                    for one in (against, name)
                )
            )
            yield check(label, what, **over.plain(), low=1.0 - EQUAL, high=1.0 + EQUAL)
            if name == ORDERED:  # these are one scheme; shake is another
                off = abs(over.value - 1) / over.margin if over.margin < TELLING else None
                note = f"margin {over.margin:.2g}" + f", must be below {TELLING:g}" * (off is None)
                yield check(
                    label,
                    "equal within the margin: that ratio less 1",
                    off,
                    high=EQUAL_MARGINS,
                    unit="margins",
                    note=note,
                )
    drifts = {
        name: measures.drift(one.time, one.total) for name, one in series.items() if name != ORDERED
    }
    for name, slope in drifts.items():
        label, span = PAPER[name].label, _length(series[name])
        drifting = partial(
            check,
            value=abs(slope.value) / slope.margin,
            unit="margins",
            note=f"{number(*slope)} kcal/mol/ps",
        )
        if name == "rigid/small":
            yield drifting(
                label,
                f"drifts: |drift| of the energy, {span}",
                low=STABLE,
                source="Richardson's scheme, which is not symplectic",
            )
            continue
        yield drifting(label, f"no drift: |drift| of the energy, {span}", high=STABLE)
        if "rigid/small" in drifts:
            over = measures.quotient(slope, drifts["rigid/small"])
            yield check(
                label,
                f"stable: drift over that of rigid/small, {span}",
                **over.plain(),
                low=-LOST,
                high=LOST,
            )
        else:
            yield _steady(check, name, [series[name]])


def _conventions(complete, whole, exponents):
    """The average measure with several zeros of energy, and what size and step would give the paper's.

    Args:
        exponents: of `TIME_WORDS` and `SIZE_WORDS`, as far as they are measured.
    """
    rows = []
    start, alone, within = (
        complete[f"peptide-{name}"].potential[0] if f"peptide-{name}" in complete else None
        for name in ("nosquish", "alone", "within")
    )
    for name in (
        "peptide-nosquish",
        "peptide-shake",
        "peptide-rigid/nve/small",
        "water-nosquish",
        f"water-{OTHER}",
    ):
        if name not in whole:
            continue
        one = whole[name]
        scales = {
            "total energy": one.total.mean(),
            "potential energy": one.potential.mean(),
            "kinetic energy": one.kinetic.mean(),
        }
        if name.startswith("peptide") and alone is not None:
            scales["potential energy less that of the molecules apart"] = (
                one.potential.mean() - alone
            )
        if name.startswith("peptide") and within is not None and start is not None:
            scales["total energy with the Coulomb energy of bonded atoms"] = (
                one.total.mean() + within - start
            )
        entries = [
            (f"over |{what}|", scale, np.abs(one.total - one.total.mean()))
            for what, scale in scales.items()
        ]
        entries.append(
            (
                "E - E(0) in place of E - <E>, over |total energy|",
                one.total.mean(),
                np.abs(one.total - one.total[0]),
            )
        )
        for convention, scale, deviations in entries:
            average, bodies = (
                measures.mean(deviations).times(1 / abs(scale)).plain(),
                one.trajectory.scene.unit,
            )
            value = average["value"]
            entry = {"name": name, "convention": convention, "scale": float(scale), **average, "bodies": bodies,
                     "about": bool(1 / NEAR < value / AVERAGE_MEASURE < NEAR)}  # fmt: skip
            if TIME_WORDS in exponents:
                entry["dt_for_it"] = float(
                    one.trajectory.dt * (AVERAGE_MEASURE / value) ** (1 / exponents[TIME_WORDS])
                )
            if SIZE_WORDS in exponents:  # the scale goes with the size itself
                entry["size_for_it"] = float(
                    bodies * (value / AVERAGE_MEASURE) ** (1 / (1 - exponents[SIZE_WORDS]))
                )
            rows.append(entry)
    return rows


def _in_windows(one):
    """sd of the energy about the means of windows of `WINDOW`, so without what wanders."""
    kept = one.total[one.time > SETTLED * one.time[-1]]
    size = round(WINDOW / (one.time[1] - one.time[0]))
    windows = parts_of(kept, max(1, len(kept) // size))
    return measures.standard_deviation((windows - windows.mean(axis=1, keepdims=True)).ravel())


def _sizes(whole):
    """sd of the energy and average measure of boxes of water."""
    rows = []
    for name, one in whole.items():
        if name.removeprefix("water-").isdigit():
            settled = one.total[one.time > SETTLED * one.time[-1]]
            rows.append(
                {
                    "bodies": one.trajectory.scene.unit,
                    "sd": _in_windows(one).plain(),
                    "measure": measures.mean(measure(settled)).plain(),
                }
            )
    return sorted(rows, key=lambda entry: entry["bodies"])


def _laws(whole, sizes):
    """The exponents with which the deviation goes with time step and size."""
    steps = [
        (dt, _in_windows(whole[f"peptide-at-{dt:g}-fs"]))
        for dt in STEPS
        if f"peptide-at-{dt:g}-fs" in whole
    ]
    boxes = [(row["bodies"], measures.Estimate(**row["sd"])) for row in sizes]
    checks = []
    for what, points, law, off in (
        (TIME_WORDS, steps, TIME_LAW, TIME_LAW_WITHIN),
        (SIZE_WORDS, boxes, SIZE_LAW, SIZE_LAW_WITHIN),
    ):
        if len(points) > 1:
            exponent = measures.power(*zip(*points))
            note = ", ".join(f"{x:g}: {number(*sd)}" for x, sd in points) + " kcal/mol"
            checks.append(
                Check(
                    "scaling",
                    "NO_SQUISH",
                    what,
                    **exponent.plain(),
                    low=law - off,
                    high=law + off,
                    note=note,
                )
            )
    return checks


def begun(one):
    """A trajectory without its first `BEGINNING` steps."""
    kept = one.time > BEGINNING * one.trajectory.dt / FS_PER_PS
    return replace(
        one,
        **{
            name: getattr(one, name)[kept]
            for name in ("time", "total", "kinetic", "potential", "temperature")
        },
    )


def gear_pairs(whole):
    """Trajectories of NO_SQUISH and of Gear's scheme from the same starts, both `begun`: scene to list of pairs, where there are several.

    Args:
        whole: name to ``paper.Series``, complete ones.
    """
    found = {"dimer": _pairs(*(_starts(whole, name) for name in ("nosquish", "gear")))}
    for scene in "water", "peptide":
        names = [f"{scene}-{name}-short-step-" for name in ("nosquish", "gear")]
        found[scene] = _pairs(
            *(
                {key.removeprefix(name): one for key, one in whole.items() if key.startswith(name)}
                for name in names
            )
        )
    long = {
        scene: [
            pair for pair in (tuple(map(begun, pair)) for pair in pairs) if _shortest(pair) >= FEW
        ]
        for scene, pairs in found.items()
    }
    return {scene: pairs for scene, pairs in long.items() if len(pairs) > 1}


def _gear(found, whole):
    """Gear's scheme: at the same step, and from the same starts at a step at which it does not fail at once.

    Its error grows with the time, by its drift, and so does the ratio of the average measures: it is the drift that "far" is asked of.
    """
    check = partial(Check, "gear", source=STATEMENTS["gear"])
    for scene in "water", "peptide":
        gear = found.get(f"{scene}-gear")
        if gear:
            value = (
                float(np.abs(gear.total - gear.total[0]).max() / gear.kinetic[0])
                if len(gear.total)
                else None
            )
            what = f"unstable at {DT:g} fs: largest |E − E(0)| over the kinetic energy, {gear.trajectory.steps * DT / FS_PER_PS:g} ps"
            yield check(
                f"Gear, {scene}",
                what,
                value,
                low=1.0,
                note=f"ended: {gear.error}" if gear.error else "",
            )
    for scene, pairs in gear_pairs(whole).items():
        ours, theirs = zip(*pairs)
        span = min(one.time[-1] for pair in pairs for one in pair)
        where, when = (
            f"at {theirs[0].trajectory.dt:g} fs",
            f"{span:.4g} ps without the first {BEGINNING} steps, {len(pairs)} starts",
        )
        ours_drift, drift = _drift(ours), _drift(theirs)
        note, off = f"{number(*drift)} kcal/mol/ps", abs(drift.value) / drift.margin
        yield check(
            f"Gear, {scene}",
            f"drifts {where}: |drift| of the energy, {when}",
            off,
            low=STABLE,
            unit="margins",
            note=note,
        )
        yield check(
            f"Gear over NO_SQUISH, {scene}",
            f"less accurate {where}: average measure, {when}",
            **_measures(pairs).plain(),
            low=1.0,
        )
        over = partial(
            check,
            f"NO_SQUISH over Gear, {scene}",
            f"far more accurate {where}: drift of the energy, {when}",
            low=-1 / FAR,
            high=1 / FAR,
        )
        if off < STABLE:  # nothing can be said over a drift that may be none
            yield over(value=None, note=f"Gear's drift itself cannot be told: {note}")
            continue
        yield over(
            **measures.quotient(ours_drift, drift).plain(), note=f"{number(*ours_drift)} and {note}"
        )
        crossing, note = (
            measures.quotient(
                measures.Estimate(_deviation(ours)), drift._replace(value=abs(drift.value))
            ),
            "",
        )
        soon = [
            tuple(replace(one, total=one.total[one.time < crossing.value]) for one in pair)
            for pair in pairs
        ]
        if min(map(_shortest, soon)) >= FEW:
            note = f"up to there Gear's average measure is {number(*_measures(soon))} times NO_SQUISH's"
        what = f"after which time its drift {where} is more than the sd of NO_SQUISH's energy"
        yield check(f"Gear, {scene}", what, **crossing.plain(), high=span, unit="ps", note=note)


def _force_field(whole):
    """The energy at a small step: its fluctuation, its random walk, and what they come to in the time of the run at the usual step."""
    usual, rows = whole.get("peptide-nosquish"), []
    for name, one in whole.items():
        if not name.startswith("force-field-"):
            continue
        sd, walk = measures.standard_deviation(one.total), measures.random_walk(one.time, one.total)
        entry = {
            "name": name.removeprefix("force-field-"),
            "ps": float(one.time[-1]),
            "sd": sd.plain(),
            "walk": walk.plain(),
        }
        if usual:
            longer = (
                usual.time[-1] - one.time[-1]
            ) / 6  # a walk's variance about its own mean goes with a sixth of the time
            square, wander = sd.times(2 * sd.value), walk.times(longer)
            entry["variance"] = measures.Estimate(
                sd.value**2 + wander.value, *measures.combined(square[1:], wander[1:])
            ).plain()
            entry |= {"usual_ps": float(usual.time[-1]), "usual_variance": float(usual.total.var())}
        rows.append(entry)
    return rows


def _force_field_checks(whole, rows):
    """Of the force field as it is: its part of the variance, and what the neighbour list does to it."""
    check = partial(Check, "force field", "peptide, NO_SQUISH")
    for entry in rows:
        if entry["name"] == "as it is" and "variance" in entry:
            part = measures.Estimate(**entry["variance"]).times(1 / entry["usual_variance"]).plain()
            note = f"from {entry['ps']:.3g} ps at {SMALL_DT:g} fs: sd {number(**entry['sd'])} kcal/mol, random walk {number(**entry['walk'])} (kcal/mol)²/ps"
            yield check(f"does not dominate: its part of the energy's variance in {entry['usual_ps']:.4g} ps at {DT:g} fs", **part, high=DOMINATES,
                        note=note)  # fmt: skip
    as_it_is, renewed = (
        whole.get(f"force-field-{name}") for name in ("as it is", "neighbour list each step")
    )
    if as_it_is and renewed:
        soon = (
            as_it_is.time <= SOON
        )  # later the two are different trajectories, for rounding grows with chaos
        value = float(np.abs(renewed.total - as_it_is.total)[soon].max() / as_it_is.total.std())
        subject = f"neighbour list made each step: largest change of the energy, over its sd, {min(SOON, as_it_is.time[-1]):.3g} ps"
        yield check(subject, value, high=UNCHANGED)


def _helix(whole):
    found = {}
    for name in "peptide-nosquish", "peptide-shake", "peptide-rigid/nve/small":
        if name in whole:
            path = paper_peptide.helix(whole[name].pieces, DT / FS_PER_PS)
            if path:
                found[name] = path
    return found


def _helix_checks(helix):
    for name, path in helix.items():
        late = path["time"] > 0.5 * path["time"][-1]
        if late.sum() < 2:
            continue
        label, span, begun = (
            PAPER[name.removeprefix("peptide-")].label,
            f"second half of {path['time'][-1]:.4g} ps",
            path["helical"][0],
        )
        kept, bent = (
            measures.mean(path["helical"][late] / begun).plain(),
            measures.mean(path["rmsd"][late]).plain(),
        )
        yield Check(
            "helix",
            label,
            f"kept: helical residues by DSSP over those of the start, {span}",
            **kept,
            low=HELIX,
            note=f"{begun} at the start",
        )
        yield Check(
            "helix",
            label,
            f"kept: backbone's RMSD from the start, {span}",
            **bent,
            high=BENT,
            unit="Å",
        )


def _rigidity(complete):
    """The worst of all runs with rigid-body fixes."""
    worst = {
        name: rigidity(one.positions)
        for name, one in complete.items()
        if one.positions and one.trajectory.integrator.kind != "constraints"
    }
    if worst:
        name = max(worst, key=worst.get)
        yield Check("rigidity", f"all {len(worst)} runs with rigid-body fixes", "largest change of a distance within a group", worst[name], high=RIGID,
                    unit="Å", note=name)  # fmt: skip
