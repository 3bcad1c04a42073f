"""The same start with every integrator: energy, thermodynamics, trajectory, cost.

First each integrator runs the whole trajectory; then short segments are timed in
turn (A B C A B C ...), each a fresh process on the same start, so that a change in
the machine's load meets all of them alike.
"""

import numpy as np

from validation import machine, measures, run
from validation.integrators import REFERENCE

DISTANCE_STEPS = 100  # after so many steps trajectories are compared
DISCARD = 0.05  # fraction of the run that energies and averages leave out
EVERY = 10  # steps between thermo samples
WARM_UP = 20  # steps before a timed segment
FS_PER_PS = 1000.0


def compare(scene, integrators, out, *, ranks, steps, dt, rounds, segment, silence, meter):
    """Run, measure, summarise.

    Args:
        scene: a ``Scene``.
        integrators: list of ``Integrator``.
        out: folder for the runs' files.
        ranks: MPI ranks of each run.
        steps: length of each trajectory.
        dt: time step in fs.
        rounds, segment: how often each is timed, and over how many steps.
        silence: s without a sign of life after which a run is given up.
        meter: progress, with ``begin(label, total)``, ``at(step)``, ``end(note)``.

    Returns:
        (summary, series): all numbers as plain data for JSON, and a dict of
        integrator name to its thermo table.  A Ctrl-C leaves what there is, with
        ``summary["interrupted"]`` set.
    """
    summary = _circumstances(scene, ranks, steps, dt, rounds, segment)
    results = {integrator.name: [] for integrator in integrators}  # trajectory, then timings

    def plan():
        """(integrator, label, job) of each run, in order; a failed one is not timed."""
        runs = [min(DISTANCE_STEPS, steps)] + [steps - DISTANCE_STEPS] * (steps > DISTANCE_STEPS)
        common = dict(dt=dt, ranks=ranks, silence=silence)
        for one in integrators:
            folder = out / "runs" / run.folder_name(one.name)
            yield one, one.label, run.job(scene, one, folder, runs, every=EVERY, **common)
        for number in range(1, rounds + 1):
            for one in integrators:
                if not results[one.name][0].error:
                    folder = out / "runs" / run.folder_name(one.name) / f"timing-{number}"
                    label = f"{one.label}, timing {number}/{rounds}"
                    lengths = [WARM_UP, segment]
                    yield one, label, run.job(scene, one, folder, lengths, every=0, **common)

    for one, label, job in plan():
        meter.begin(label, sum(job.runs))
        result = run.run(job, meter.at)
        meter.end(result.error)
        results[one.name].append(result)
        if result.interrupted:
            summary["interrupted"] = True
            break
    for found in results.values():
        for result in found:
            summary["versions"].update(machine.worker_versions(result.versions))
    reference = results.get(REFERENCE, [])
    summary["integrators"] = [
        _row(one, scene, results[one.name], reference, steps) for one in integrators
    ]
    series = {name: found[0].thermo for name, found in results.items() if found}
    return summary, {name: thermo for name, thermo in series.items() if thermo}


def _row(integrator, scene, results, reference, steps):
    """All numbers of one integrator; those that could not be measured are not there."""
    row = {
        "name": integrator.name,
        "label": integrator.label,
        "lines": integrator.commands(scene),
        "error": "not started",
        "steps": 0,
    }
    if not results:
        return row
    trajectory, timed = results[0], results[1:]
    row["error"] = trajectory.error
    if trajectory.thermo:
        row |= _thermodynamics(trajectory.thermo, steps)
        if not row["error"] and row["steps"] < steps:
            row["error"] = "energy is not finite"
    if trajectory.positions:
        row |= _geometry(trajectory.positions, reference[0].positions if reference else None)
    row |= _cost(timed, reference[1:])
    broken = next((one.error for one in timed if one.error), None)
    if broken and not row["error"]:
        row["error"] = f"while timed: {broken}"
    return row


def _thermodynamics(thermo, steps):
    """Energy and averages over the part of the series that is kept."""
    finite = np.isfinite(thermo["TotEng"])
    until = len(finite) if finite.all() else int(np.argmin(finite))
    step = thermo["Step"][:until]
    row = {"steps": int(step[-1]) if until else 0}
    kept = np.flatnonzero(step >= DISCARD * steps)
    if len(kept) < 8:  # too few for an error
        return row
    time, energy, temperature, pressure = (
        thermo[name][kept] for name in ("Time", "TotEng", "Temp", "Press")
    )
    row["energy_sd"] = measures.standard_deviation(energy).plain()
    row["energy_sd_line"] = measures.about_line(time, energy).plain()
    row["drift"] = measures.drift(time / FS_PER_PS, energy).plain()
    row["temperature"] = measures.mean(temperature).plain()
    row["pressure"] = measures.mean(pressure).plain()
    return row


def _geometry(own, reference):
    """Distance from the reference after the first run, rigidity at the end."""
    box = own["cell"], own["periodic"]
    pairs = measures.body_pairs(own["bodies"])
    row = {"rigidity": float(measures.rigidity_error(own["x"][0], own["x"][-1], pairs, *box))}
    if reference is not None:
        row["distance"] = float(measures.largest_distance(own["x"][1], reference["x"][1], *box))
    return row


def _cost(timed, reference_timed):
    """Modify and loop time per step: spread over the timed segments, and ratios."""
    last = [one.timings[-1] for one in timed if _complete(one)]
    if not last:
        return {}
    row = {
        "modify": measures.spread(_modify(one) for one in last),
        "loop": measures.spread(one["loop"] / one["steps"] * 1e3 for one in last),
    }
    if all(one["cpu"] is not None for one in last):
        row["cpu"] = min(one["cpu"] for one in last)
    pairs = [
        (own.timings[-1], other.timings[-1])
        for own, other in zip(timed, reference_timed)
        if _complete(own) and _complete(other)
    ]
    if pairs:
        row["modify_ratio"] = measures.spread(_modify(a) / _modify(b) for a, b in pairs)
        row["loop_ratio"] = measures.spread(
            a["loop"] / a["steps"] / (b["loop"] / b["steps"]) for a, b in pairs
        )
    return row


def _modify(timing):
    """Time in LAMMPS's Modify, us per step, average over ranks."""
    return timing["sections"]["Modify"] / timing["steps"] * 1e6


def _complete(result):
    return not result.error and len(result.timings) == 2


def _circumstances(scene, ranks, steps, dt, rounds, segment):
    """What was asked for, where and with what."""
    return machine.circumstances() | {
        "scene": scene.name,
        "title": scene.title,
        "interrupted": False,
        "settings": {
            "ranks": ranks,
            "steps": steps,
            "dt_fs": dt,
            "sample_every_steps": EVERY,
            "discarded_fraction": DISCARD,
            "distance_after_steps": min(DISTANCE_STEPS, steps),
            "timing_rounds": rounds,
            "timing_steps": segment,
            "reference": REFERENCE,
        },
        "units": {
            "energy_sd": "kcal/mol",
            "energy_sd_line": "kcal/mol",
            "drift": "kcal/mol/ps",
            "temperature": "K",
            "pressure": "atm",
            "distance": "Angstrom",
            "rigidity": "Angstrom",
            "modify": "us/step",
            "loop": "ms/step",
            "cpu": "percent of a core per rank",
        },
    }
