"""The energy's spread of rigid water at several time steps, beside published numbers.

A. J. Silveira and C. R. A. Abreu, J. Chem. Phys. 150, 114110 (2019), integrated TIP3P water with the free rotor's exact solution
and forces that end smoothly; `inputs/water_smooth` has their potential, but for the form of its end.  Their paper draws the energies
and prints no number of their spread: `PUBLISHED` and its error are worked out from the authors' files, as `ORIGINS` says number by number.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from validation import check, machine, measures, run
from validation.check import Check
from validation.compare import FS_PER_PS
from validation.figures import OTHERS, OURS, draw_each
from validation.integrators import INTEGRATORS
from validation.report import page, save
from validation.scenes import INPUTS, SCENES
from validation.starts import from_dump, to_dump

SOURCE = "Silveira and Abreu, J. Chem. Phys. 150, 114110 (2019)"
SERIES = "github.com/craabreu/rigid_nvt_paper"  # the authors' manuscript, and the data of its figures; commit 0ff8a20 and before
FILE = "Figures/NVE_{:g}fs.csv"  # there: energies of their trajectories of constant energy
PUBLISHED = {
    1.0: 0.0603,
    2.0: 0.2205,
    3.0: 0.4871,
    4.0: 0.8872,
}  # fs: standard deviation of TotEng in `FILE`, kcal/mol
ENERGIES = 667  # in each `FILE`, 9 ps apart: neighbours' correlation is below 0.06 in all four
THEIR_ERROR = 1 / np.sqrt(2 * ENERGIES)  # of these, relative, for they do not depend on each other
# All four have one energy, above its mean at 298 K, so they are warmer: the mean of TotEng of all four; E and Cv1 of Figures/S1.csv at 1 fs
ENERGY, ENERGY_AT_298, HEAT_CAPACITY = -6475.0, -6616.5, 17.5  # kcal/mol, kcal/mol, kcal/mol/K
TEMPERATURE = 298.0 + (ENERGY - ENERGY_AT_298) / HEAT_CAPACITY  # K
ORIGINS = {
    "standard deviations of the energy": f"computed here: of TotEng in the authors' Figures/NVE_1fs.csv to NVE_4fs.csv ({SERIES}); the paper draws "
    "these energies and prints no standard deviation",
    "their errors": f"computed here: 1/√(2·{ENERGIES}) of each, for {ENERGIES} energies that do not depend on each other",
    "903 molecules, 970 kg/m³, cutoff 10 Å from 9.5 Å on, erfc(0.29 r/Å)": f"the authors' manuscript, as in the paper (rigid_bodies.tex, {SERIES})",
    "parameters of the potential": "the input of the authors' program (github.com/craabreu/rigid_nvt); the paper cites TIP3P's first ones",
    f"temperature, {TEMPERATURE:.0f} K": f"computed here: from the mean of these energies, and from energy and heat capacity at 298 K in Figures/S1.csv ({SERIES})",
}
WITHIN = 0.10  # of the published numbers
ALL = "all"  # time steps together
TITLES = {
    "spread": f"Standard deviation of the energy over the published one, 903 TIP3P molecules at {TEMPERATURE:.0f} K"
}

BATH, MEAN, REST, BATH_DT = (
    4.0,
    6.0,
    1.0,
    2.0,
)  # ps with a heat bath, then with one and averaged, then without; time step (fs) of all
SAMPLED = 12.0  # fs between samples of the energy


def scene():
    """Their water."""
    setup = (
        "units real",
        "atom_style full",
        "read_data data.smooth",
        "include forcefield.smooth",
        "group water type 1 2",
    )
    return replace(SCENES["water"], name="water-smooth", title="903 TIP3P molecules at 0.97 g/cm³, smooth cutoff", folder=INPUTS / "water_smooth",
                   setup=setup, unit=903, sizes=(), cutter=None, subject=None)  # fmt: skip


def steps(time, dt):
    """How many steps of dt (fs) a time (ps) has."""
    return round(time * FS_PER_PS / dt)


def total(time):
    """Steps of all runs together; time in ps."""
    return steps(BATH + MEAN + REST, BATH_DT) + sum(steps(time, dt) for dt in PUBLISHED)


def published(out, time, ranks, silence, meter):
    """Run what is not there yet.

    Args:
        out: folder.  time: ps of each time step.  ranks: MPI ranks.
        silence: s without a sign of life after which a run is given up.
        meter: a ``console.Meter``.

    Returns:
        (found, interrupted): time step (fs) to ``run.Result``, of those that were begun.
    """
    water, ours, start = scene(), INTEGRATORS["nosquish"], out / "start"
    dump = (start / "state.dump").resolve()
    rest = steps(REST, BATH_DT)

    def do(label, job):
        meter.begin(label, sum(job.runs))
        result = run.once(job, meter.at)
        meter.end(result.error)
        return result

    more = [
        f"fix bath {water.group} langevin {TEMPERATURE} {TEMPERATURE} 100.0 7123",
        f"run {steps(BATH, BATH_DT)}",
        "variable energy equal etotal",
        f"fix mean {water.group} ave/time 1 1 1 v_energy ave running",
        f"run {steps(MEAN, BATH_DT)}",
        "unfix bath",
        f"velocity {water.group} scale $(temp*(1.0+(f_mean-etotal)/ke))",  # to the mean energy, not the one that chance has left
        "unfix mean",
        "reset_timestep 0",
        *to_dump(dump, rest),
    ]
    first = do("start", run.job(water, ours, start, [rest], dt=BATH_DT, every=100, ranks=ranks, silence=silence, positions=False, more=more,
                                origin=machine.origin(water, ours)))  # fmt: skip
    found = {}
    if first.error:
        return {dt: first for dt in PUBLISHED}, first.interrupted
    for dt in sorted(PUBLISHED, reverse=True):
        job = run.job(from_dump(water, dump, rest), ours, out / f"{dt:g}-fs", [steps(time, dt)], dt=dt, every=max(1, round(SAMPLED / dt)), ranks=ranks,
                      silence=silence, positions=False, origin=machine.origin(water, ours, dump))  # fmt: skip
        found[dt] = do(f"{dt:g} fs", job)
        if found[dt].interrupted:
            return found, True
    return found, False


def checks(found):
    """What was found over what is published, for each time step; where all are known, their mean too, each weighted by what it is worth.

    Args:
        found: time step (fs) to ``run.Result``.
    """
    made = []
    for dt, theirs in PUBLISHED.items():
        result = found.get(dt)
        value = measures.Estimate(None)
        if result is not None and not result.error:
            spread, published = (
                measures.standard_deviation(result.thermo["TotEng"]),
                measures.Estimate(theirs, theirs * THEIR_ERROR),
            )
            value = measures.quotient(spread, published)
            line = measures.about_line(result.thermo["Time"], result.thermo["TotEng"])
            slope = measures.drift(result.thermo["Time"] / FS_PER_PS, result.thermo["TotEng"])
            drifts = (
                f", drifts by {check.number(*slope)} kcal/mol/ps"
                if abs(slope.value) > slope.margin
                else ""
            )
            note = f"{check.number(*spread)} (about its line {check.number(*line)}{drifts}) over {check.number(*published)} kcal/mol"
        else:
            note = f"no complete run: {result.error if result else 'not begun'}"
        made.append(_check(f"{dt:g} fs", value, note))
    if all(one.value is not None for one in made):
        values, weights = (
            np.array([one.value for one in made]),
            np.array([one.error for one in made]) ** -2.0,
        )
        parts = (
            (weight * one.error, one.freedom) for weight, one in zip(weights / weights.sum(), made)
        )
        made.append(
            _check(
                ALL,
                measures.Estimate(np.average(values, weights=weights), *measures.combined(*parts)),
                "",
            )
        )
    return made


def _check(subject, found, note):
    what = "standard deviation of the total energy over the published one"
    value, error, freedom = found
    file = "all four" if subject == ALL else FILE.format(float(subject.split()[0]))
    source = f"{SOURCE}; theirs and its error computed here from TotEng in {file}, {SERIES}"
    return Check(
        "spread",
        subject,
        what,
        value,
        error,
        1 - WITHIN,
        1 + WITHIN,
        "",
        note,
        source,
        freedom=freedom,
    )


def spread(made):
    """The figure: ours over theirs against the time step."""
    known = [one for one in made if one.value is not None and one.subject != ALL]
    if not known:
        return None, ""
    figure, axis = plt.subplots(figsize=(5.5, 3.6), layout="constrained")
    axis.axhspan(1 - WITHIN, 1 + WITHIN, color=OTHERS, alpha=0.15, lw=0)
    axis.axhline(1.0, color=OTHERS, lw=0.8)
    dts = [float(one.subject.split()[0]) for one in known]
    axis.errorbar(
        dts,
        [one.value for one in known],
        [one.margin for one in known],
        fmt="o",
        color=OURS,
        capsize=3,
    )
    axis.set_xlabel("time step (fs)")
    axis.set_ylabel("standard deviation of the energy,\nfix_nosquish.NVE over published")
    axis.set_xticks(list(PUBLISHED), [f"{dt:g}" for dt in PUBLISHED])
    return (
        figure,
        f"Error bars: {check.SURE} intervals, of both together (theirs alone: ± {100 * measures.margin(THEIR_ERROR):.1f} %); shaded: within {100 * WITHIN:g} %.",
    )


def write(summary, made, out):
    """Write summary.json, table.csv, the figure and report.html into the folder ``out``.

    Args:
        summary: plain data: ``checks``, ``interrupted`` and the circumstances.
        made: the checks themselves.
    """
    save(summary, out)
    check.write(summary["checks"], out / "table.csv")
    page("published.html", out / "report.html", draw_each((spread,), out, made), summary=summary, titles=TITLES, source=SOURCE, origins=ORIGINS,
         temperature=TEMPERATURE, their_margin=measures.margin(THEIR_ERROR), measured=check.measured, bound=check.bound, sure=check.SURE)  # fmt: skip
