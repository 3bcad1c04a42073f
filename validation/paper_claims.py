"""From the energies of ``paper`` to numbers with errors, and what they say of the paper's statements.

The paper's measure is Delta E(t) = [E(t) - <E>] / |<E>|, with the averages along the trajectory (caption of figure 2); its
average is here the mean of |Delta E|.  |<E>| depends on the zero of energy, which the paper does not name: so each
measure is given for several zeros.
"""

from dataclasses import dataclass

import numpy as np

from validation import measures, paper_peptide
from validation.paper import AVERAGE_MEASURE, DIMER_DT, DT, FS_PER_PS, GEAR_DT, SMALL_DT, STATEMENTS

PARTS = 8  # of a trajectory, for the error of a ratio
CERTAIN, EQUAL, STABLE = 2.0, 3.0, 5.0  # errors that decide, that a ratio may be from 1, and that a drift may have
FAR, NEAR = 10.0, np.sqrt(10.0)  # "far more accurate", "about": one order of magnitude, and the same one
RIGID = 1e-10  # Angstrom
DOMINATES = 0.5  # of the energy's variance
HELIX, BENT = 0.75, 2.5  # of the residues that are helical at the start; Angstrom from it
FEW = 16  # samples: less says nothing


@dataclass(frozen=True)
class Claim:
    """One statement and what was found.

    Attributes:
        what: the statement in words.
        source: where the paper says so, or why it is asked.
        value, error, unit: the number and its standard error.
        bound: what it is held against, in words.
        holds: True, False, or None where it is not decided.
    """

    what: str
    source: str
    value: float
    error: float
    unit: str
    bound: str
    holds: bool | None


def judge(found):
    """All numbers, as plain data.

    Args:
        found: name to ``paper.Series``, complete or not.

    Returns:
        dict: ``rows`` of the table, ``claims``, ``conventions``, ``force_field``, ``sizes``, ``helix``: lists and dicts.
    """
    good = {name: one for name, one in found.items() if len(one.total) >= FEW}
    helix = _helix(good)
    conventions = _conventions(found, good)
    force_field = _force_field(good)
    claims = [*_accuracy(good), *_stability(good), *_peptide(good, conventions), *_gear(found, good), *_force_field_claim(force_field)]
    claims += [*_helix_claims(helix), *_rigidity(found)]
    return {
        "rows": [row(one) for one in found.values()],
        "claims": [vars(claim) for claim in claims],
        "conventions": conventions,
        "force_field": force_field,
        "sizes": _sizes(good),
        "helix": {name: {key: values.tolist() for key, values in one.items()} for name, one in helix.items()},
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
            "temperature": _pair(measures.mean(one.temperature)),
            "energy": float(one.total.mean()),
            "sd": _pair(measures.standard_deviation(one.total)),
            "measure": _pair(measures.mean(measure(one.total))),
            "drift": _pair(measures.drift(one.time, one.total)),
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
    return float(measures.rigidity_error(positions["x"][0], positions["x"][-1], pairs, positions["cell"], positions["periodic"]))


def part_deviations(total, parts=PARTS):
    """Standard deviations of the energy in equal parts of a trajectory, each about its own mean: (parts,)."""
    size = len(total) // parts
    return total[: parts * size].reshape(parts, size).std(axis=1, ddof=1)


def _pair(pair):
    return {"value": float(pair[0]), "error": float(pair[1])}


def _decide(value, error, bound):
    """Whether the value is above the bound: None if it is within the errors."""
    return None if abs(value - bound) < CERTAIN * error else bool(value > bound)


def _accuracy(good):
    """Reference 12 over NO_SQUISH."""
    source = {"dimer": STATEMENTS["dimer"], "water": STATEMENTS["liquid"]}
    starts = [name.rpartition("-")[2] for name in good if name.startswith("dimer-nosquish-")]
    pairs = [(good[f"dimer-nosquish-{n}"], good[f"dimer-matubayasi-nakahara-{n}"]) for n in starts if f"dimer-matubayasi-nakahara-{n}" in good]
    if len(pairs) > 1:
        value, error = measures.ratio([one.total.std() for one, _ in pairs], [other.total.std() for _, other in pairs])
        yield Claim("dimer: NO_SQUISH is more accurate than reference 12 (sd of energy, reference 12 over NO_SQUISH)", source["dimer"],
                    value, error, f"mean of {len(pairs)} starts", "> 1", _decide(value, error, 1.0))  # fmt: skip
    if {"water-nosquish", "water-matubayasi-nakahara"} <= good.keys():
        value, error = _ratio(good["water-nosquish"], good["water-matubayasi-nakahara"])
        yield Claim("liquid: NO_SQUISH is more accurate than reference 12 (sd of energy, reference 12 over NO_SQUISH)", source["water"],
                    value, error, f"mean of {PARTS} parts", "> 1", _decide(value, error, 1.0))  # fmt: skip


def _ratio(first, second):
    return measures.ratio(part_deviations(first.total), part_deviations(second.total))


def _stability(good):
    """Drifts against their errors."""
    for name, label in ("nosquish", "NO_SQUISH"), ("matubayasi-nakahara", "reference 12"):
        drifts = [measures.drift(one.time, one.total) for key, one in good.items() if key.startswith(f"dimer-{name}-")]
        if drifts:
            value, error = np.mean([slope for slope, _ in drifts]), np.sqrt(np.sum([e**2 for _, e in drifts])) / len(drifts)
            yield _drifts_not(f"dimer, {label}: stable", STATEMENTS["dimer"], value, error)
        if f"water-{name}" in good:
            one = good[f"water-{name}"]
            yield _drifts_not(f"liquid, {label}: stable", STATEMENTS["liquid"], *measures.drift(one.time, one.total))
    for name, label in ("nosquish", "NO_SQUISH"), ("shake", "SHAKE"), ("rigid/nve/small", "rigid/nve/small"):
        if f"peptide-{name}" in good:
            one = good[f"peptide-{name}"]
            yield _drifts_not(f"peptide, {label}: stable", STATEMENTS["peptide"], *measures.drift(one.time, one.total))
    if "peptide-rigid/small" in good:
        one = good["peptide-rigid/small"]
        value, error = measures.drift(one.time, one.total)
        yield Claim("peptide, rigid/small (Richardson's scheme): drifts", "beside it: not symplectic", value, error, "kcal/mol/ps",
                    f"> {STABLE:g} errors", bool(abs(value) > STABLE * error))  # fmt: skip


def _drifts_not(what, source, value, error):
    return Claim(what, source, value, error, "kcal/mol/ps", f"|drift| < {STABLE:g} errors", bool(abs(value) < STABLE * error))


def _conventions(found, good):
    """The average measure with several zeros of energy, and what size and step would give the paper's."""
    rows = []
    start, alone, within = (
        found[f"peptide-{name}"].potential[0] if f"peptide-{name}" in found and len(found[f"peptide-{name}"].potential) else None
        for name in ("nosquish", "alone", "within")
    )
    for name in "peptide-nosquish", "peptide-shake", "peptide-rigid/nve/small", "water-nosquish", "water-matubayasi-nakahara":
        if name not in good:
            continue
        one = good[name]
        scales = {
            "total energy": one.total.mean(),
            "potential energy": one.potential.mean(),
            "kinetic energy": one.kinetic.mean(),
        }
        if name.startswith("peptide") and alone is not None:
            scales["potential energy less that of the molecules apart"] = one.potential.mean() - alone
        if name.startswith("peptide") and within is not None and start is not None:
            scales["total energy with the Coulomb energy of bonded atoms"] = one.total.mean() + within - start
        deviation, error = measures.mean(np.abs(one.total - one.total.mean()))
        bodies = one.trajectory.scene.unit
        for what, scale in scales.items():
            value = deviation / abs(scale)
            rows.append({
                "name": name, "convention": f"over |{what}|", "scale": float(scale), "value": float(value), "error": float(error / abs(scale)),
                "about": bool(1 / NEAR < value / AVERAGE_MEASURE < NEAR), "bodies": bodies,
                # |E - <E>| goes with the root of the size and with dt^2, the scale with the size
                "size_for_it": float(bodies * (value / AVERAGE_MEASURE) ** 2),
                "dt_for_it": float(one.trajectory.dt * (AVERAGE_MEASURE / value) ** 0.5),
            })  # fmt: skip
        changes = np.abs(one.total - one.total[0])
        rows.append({
            "name": name, "convention": "E - E(0) in place of E - <E>, over |total energy|", "scale": float(one.total.mean()),
            "value": float(changes.mean() / abs(one.total.mean())), "error": float(measures.mean(changes)[1] / abs(one.total.mean())),
            "about": bool(1 / NEAR < changes.mean() / abs(one.total.mean()) / AVERAGE_MEASURE < NEAR), "bodies": bodies,
        })  # fmt: skip
    return rows


def _peptide(good, conventions):
    """Figure 3."""
    for entry in conventions:
        if entry["name"].startswith("peptide") and entry["convention"] == "over |total energy|":
            yield Claim(f"{entry['name'].replace('-', ', ', 1)}: average measure about 1e-5", STATEMENTS["peptide"], entry["value"], entry["error"],
                        "", "within a factor of 3.2 of 1e-5", entry["about"])  # fmt: skip
    for name, what in ("rigid/nve/small", "equal to rigid/nve/small's"), ("shake", "equal to SHAKE's"):
        if {"peptide-nosquish", f"peptide-{name}"} <= good.keys():
            value, error = _ratio(good[f"peptide-{name}"], good["peptide-nosquish"])
            yield Claim(f"peptide: sd of NO_SQUISH's energy {what} (ratio)", STATEMENTS["peptide"], value, error, f"mean of {PARTS} parts",
                        f"1 within {EQUAL:g} errors", bool(abs(value - 1) < EQUAL * error))  # fmt: skip


def _gear(found, good):
    """Gear's scheme, at the same step and over the same time."""
    for scene, dt in ("water", DT), ("peptide", DT), ("water", GEAR_DT), ("peptide", GEAR_DT):
        gear, ours = (found.get(f"{scene}-{name}" + ("-short-step" if dt == GEAR_DT else "")) for name in ("gear", "nosquish"))
        if not gear or not ours or len(gear.total) < 2 or len(ours.total) < 2:
            continue
        until = max(gear.trajectory.steps * dt / FS_PER_PS, ours.time[1])
        pair = [np.abs(one.total - one.total[0])[(one.time > 0) & (one.time <= until)] for one in (ours, gear)]
        value = pair[1].mean() / pair[0].mean()
        lasted = f"; Gear's run ended at {gear.time[-1]:g} ps: {gear.error}" if gear.error else ""
        yield Claim(f"{scene} at {dt:g} fs, {until:g} ps: far more accurate than Gear (mean |E - E(0)|, Gear's over NO_SQUISH's)",
                    STATEMENTS["gear"] + lasted, float(value), 0.0, "", f"> {FAR:g}", bool(value > FAR))  # fmt: skip
    starts = [name.removeprefix("dimer-gear-") for name in good if name.startswith("dimer-gear-")]
    pairs = [(good[f"dimer-nosquish-{n}"], good[f"dimer-gear-{n}"]) for n in starts if f"dimer-nosquish-{n}" in good]
    if len(pairs) > 1:
        over = f"{pairs[0][0].time[-1]:g} ps"
        value, error = measures.ratio([one.total.std() for one, _ in pairs], [other.total.std() for _, other in pairs])
        yield Claim(f"dimer at {DIMER_DT:g} fs, {over}: far more accurate than Gear (sd of energy, Gear's over NO_SQUISH's)", STATEMENTS["gear"],
                    value, error, f"mean of {len(pairs)} starts", f"> {FAR:g}", _decide(value, error, FAR))  # fmt: skip
        slopes = [measures.drift(other.time, other.total)[0] for _, other in pairs]
        value, error = np.mean(slopes), np.std(slopes, ddof=1) / np.sqrt(len(slopes))
        yield Claim(f"dimer at {DIMER_DT:g} fs, {over}: Gear drifts", STATEMENTS["gear"], value, error, "kcal/mol/ps", f"> {STABLE:g} errors",
                    bool(abs(value) > STABLE * error))  # fmt: skip


def _force_field(good):
    """The energy's fluctuation at a small step, and its part of the variance at the usual one over the same time."""
    usual = good.get("peptide-nosquish")
    rows = []
    for name, one in good.items():
        if not name.startswith("force-field-"):
            continue
        value, error = measures.standard_deviation(one.total)
        entry = {"name": name.removeprefix("force-field-"), "sd": float(value), "error": float(error), "ps": float(one.time[-1])}
        if usual is not None and usual.time[-1] >= one.time[-1]:
            parts = int(usual.time[-1] / one.time[-1])
            size = len(usual.total) // parts
            same = np.sqrt(np.mean(usual.total[: parts * size].reshape(parts, size).var(axis=1)))
            entry |= {"usual_sd": float(same), "part": float((value / same) ** 2), "part_error": float(2 * value * error / same**2),
                      "by_dt": float((SMALL_DT / DT) ** 4)}  # fmt: skip
        rows.append(entry)
    return rows


def _force_field_claim(rows):
    for entry in rows:
        if "part" in entry:
            value, error = entry["part"], entry["part_error"]
            yield Claim(f"peptide, force field {entry['name']}: its part of the energy's variance at {DT:g} fs does not dominate",
                        f"sd {entry['sd']:.3f} kcal/mol at {SMALL_DT:g} fs, of {entry['usual_sd']:.3f} in as long at {DT:g} fs; by the dt^2 law the "
                        f"integrator leaves {entry['by_dt']:.1e} of it", value, error, "", f"< {DOMINATES:g}",
                        None if (above := _decide(value, error, DOMINATES)) is None else not above)  # fmt: skip


def _sizes(good):
    """sd of the energy and average measure of boxes of water."""
    rows = []
    for name, one in good.items():
        made = one.trajectory
        if name == "water-nosquish" or name.startswith("water-") and name.removeprefix("water-").isdigit():
            kept = one.time > 0.2 * one.time[-1]  # velocities that were made anew take a moment
            sd, average = measures.standard_deviation(one.total[kept]), measures.mean(measure(one.total[kept]))
            rows.append({"bodies": made.scene.unit, "sd": _pair(sd), "measure": _pair(average)})
    rows.sort(key=lambda entry: entry["bodies"])
    return rows


def _helix(good):
    found = {}
    for name in "peptide-nosquish", "peptide-shake", "peptide-rigid/nve/small":
        if name in good:
            path = paper_peptide.helix(good[name].pieces, DT / FS_PER_PS)
            if path:
                found[name] = path
    return found


def _helix_claims(helix):
    for name, path in helix.items():
        late = path["time"] > 0.5 * path["time"][-1]
        if late.sum() < 2:
            continue
        label, source = name.replace("-", ", ", 1), f"kept for {path['time'][-1]:.0f} ps"
        (kept, kept_error), (bent, bent_error) = measures.mean(path["helical"][late]), measures.mean(path["rmsd"][late])
        yield Claim(f"{label}: helical residues by DSSP, second half of the run", source, kept, kept_error, f"of {path['helical'][0]} at the start",
                    f"> {HELIX:g} of the start's", bool(kept > HELIX * path["helical"][0]))  # fmt: skip
        yield Claim(f"{label}: backbone's RMSD from the start, second half of the run", source, bent, bent_error, "Angstrom", f"< {BENT:g}",
                    bool(bent < BENT))  # fmt: skip


def _rigidity(found):
    """The worst of all runs with rigid-body fixes."""
    worst = {
        name: rigidity(one.positions) for name, one in found.items()
        if one.positions and not one.error and one.trajectory.integrator.kind != "constraints"
    }  # fmt: skip
    if worst:
        name = max(worst, key=worst.get)
        yield Claim(f"rigid groups keep their distances, all {len(worst)} runs with rigid-body fixes: largest change ({name})",
                    "bond lengths and angles of rigid groups", worst[name], 0.0, "Angstrom", f"< {RIGID:g}", bool(worst[name] < RIGID))  # fmt: skip
