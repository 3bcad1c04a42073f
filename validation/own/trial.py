"""A script's integrators with its step and longer ones: what is wrong where, and what it costs.

A point is an integrator with a time step.  All begin with the same state and last the same time;
of each the first part is left out.  Means are held against those of ours with half of the script's
step.  An integrator's longer steps are left out when one has failed.  At the end what could be
advised is timed in turn, without samples.

Several processes with the same command share the points, through locks in the folder.
"""

import math
import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from validation.own import counted, law, schemes, shapes, turns
from validation.own.system import Own
from validation.running import machine, rounds, run
from validation.running.store import Store
from validation.scenes.integrators import OURS, Integrator
from validation.statistics import measures, structure
from validation.statistics.estimate import CONFIDENCE, Estimate
from validation.statistics.structure import Motion
from validation.sweep.choice import (
    Choice,
    before_bad,
    choose,
    from_the_shortest,
    least,
    level_of_each,
    meets,
)

FACTORS = 1.0, 1.5, 2.0, 3.0, 4.0, 6.0  # of the script's step
FINER = 0.5  # the reference's step, of the script's
USUAL = 2  # integrators: ours and the script's, or a rigid fix of LAMMPS; the fewer share a budget
FRAMES, MOST = 200, 1000  # of a run, and of one with many steps that the budget is to hold
APART = 50  # steps between the frames of such a run
ATOMS, FEW = 2_000_000, 20  # in all frames of a run at most, but so many frames at least
SETTLES = 0.25  # of the frames are left out
# of the script's steps: the energy's changes in it count.  Errors of the step are as large as they
# get by then.  What is added up later, by noise or by forces that a cutoff ends, is the same at all
# steps: the standard deviation of a whole run is mostly this
SPAN = 96
PARTS, MANY = (8, 4, 2), 8000  # samples of the energy in it; more than one for so many in all
LEAST = 400  # steps of a run
LATE = 1.5  # of the budget: then no further run begins
BIN, REACH = 0.04, 0.95  # of g(r): of a body's room, and of half the box
# of a run's kept frames, at most, for the noise of g(r).  Few of them make margins wide, the more
# so for a choice among several; if so many are not independent, their noise counts as error
BLOCKS = 20
ROUNDS, SECONDS = 3, 0.5  # of what is timed in turn; s of each of its segments
# what is timed costs so many times the fastest good one at most, by the runs; else so many points
SLOWER, FASTEST = 1.25, 6
ENERGIES = "drift", "energy"  # targets that econserve tells
NS = {"real": 1e6, "metal": 1e3, "electron": 1e6}  # times in a ns; elsewhere in 1,000 of them
TARGETS = {
    "drift": (
        0.01,
        "kT per {ns} and degree of freedom",
        "drift of the energy that is to be kept",
        "in 1 {ns} the temperature changes by some per cent at most",
    ),
    "temperature": (
        0.01,
        "of T",
        "translation against rotation, or against the thermostat",
        "3 K at 300 K: what thermometers of force fields tell apart",
    ),
    "energy": (
        0.2,
        "of the kinetic energy's standard deviation",
        "change of the energy that is to be kept in {span}, rms, over √2",
        "a fifth, the old rule for a step that is short enough",
    ),
    "potential": (
        0.05,
        "kT per body",
        "mean potential energy",
        "0.03 kcal/mol at 300 K: less than most force fields' own error in a heat of vaporization",
    ),
    "density": (0.005, "of it", "mean density", "half a per cent, as force fields are fitted to"),
    "rdf": (
        0.03,
        "",
        "rms of g(r) of the bodies' heaviest atoms",
        "less than the width of a line in a figure of g(r)",
    ),
}
COUNTED = (
    "what {fixes} does to the energy is not counted; of a fix that adds a force, 'fix_modify ID "
    "energy yes' has LAMMPS count it, if it can"
)
# the default drift with a thermostat: what GROMACS allows by default, 0.005 kJ/mol per ps and atom
# (verlet-buffer-tolerance), of rigid water at 300 K.  With a damping time of 1 ps it heats by 0.2 %
HEATED, WHY_HEATED = 1.0, "as much as GROMACS allows by default; the thermostat takes it out"


@dataclass(frozen=True)
class Point:
    """An integrator with a time step, in the script's units."""

    integrator: Integrator
    dt: float

    @property
    def name(self) -> str:
        """Of its folder."""
        return f"{run.folder_name(self.integrator.name)}/{self.dt:g}"


@dataclass(frozen=True)
class Lengths:
    """How long runs are: ``time`` of each in the script's units, of so many ``frames`` at most."""

    time: float
    frames: int
    step: float  # s of a step, as it was measured once
    dt: float  # the script's

    @property
    def sample(self) -> float:
        """Time between two samples of the energy: `SPAN`, or a part of it."""
        span = SPAN * self.dt
        parts = next((one for one in PARTS if one * self.time <= MANY * span), 1)
        return min(span / parts, self.time / self.frames)

    def every(self, dt: float) -> int:
        """Steps between two samples."""
        return max(1, round(self.sample / dt))

    def runs(self, dt: float) -> list[int]:
        """Steps between frames."""
        samples = math.ceil(self.time / self.frames / self.sample * (1 - 1e-9))
        frames = max(FEW, round(self.time / (samples * self.sample)))
        return [samples * self.every(dt)] * frames


def targets(own: Own, wanted: Mapping[str, float]) -> dict[str, float]:
    """Largest errors that are good enough, by name; those that the script has no use for are left
    out of the default ones.

    Raises:
        LookupError: there is no such target; the message lists all. Or the script's atoms are at
            rest, and nothing can be told.
    """
    state = own.found.state
    if not shapes.temperature(own) > 0:
        raise LookupError(
            f"the atoms are at rest at '{schemes.plain(own.said['run'])}', so there is no "
            "temperature to measure errors by: give them velocities (velocity all create T SEED), "
            "and let them come to equilibrium"
        )
    for name in wanted:
        if name not in TARGETS:
            known = "; ".join(f"{key}: {what}" for key, (_, _, what, _) in TARGETS.items())
            raise LookupError(f"there is no target {name}. There are {known}")
    found = {name: default for name, (default, *_) in TARGETS.items()}
    if state.temp:
        found["drift"] = HEATED
    lacking = counted.lacking(own)
    if lacking:
        found = {name: most for name, most in found.items() if name not in ENERGIES}
    if not state.press:
        del found["density"]
    if not _has_rdf(own):
        del found["rdf"]
    if "potential" not in wanted:  # it takes long runs to tell
        del found["potential"]
    missing = [name for name in wanted if name not in found]
    if missing:
        fixes = f"fix {' and fix '.join(lacking)}"
        raise LookupError(
            f"{missing[0]} says nothing of this script: "
            + {
                **dict.fromkeys(ENERGIES, COUNTED.format(fixes=fixes)),
                "density": "its box does not change",
                "rdf": "its box is not periodic, or has less than ten bodies",
            }[missing[0]]
        )
    return {name: wanted.get(name, most) for name, most in found.items()}


def _about(own: Own, wanted: Mapping[str, float]) -> dict[str, dict]:
    """What each target is, in words, and its default for this script."""
    words = {"ns": name_of_ns(own), "span": f"{SPAN * own.scene.dt:g} {own.units.time}"}
    found = {}
    for name in wanted:
        usual, *texts = TARGETS[name]
        unit, what, why = (text.format(**words) for text in texts)
        if name == "drift" and own.found.state.temp:
            usual, why = HEATED, WHY_HEATED
        found[name] = {"default": usual, "unit": unit, "what": what, "why": why}
    return found


def judged(point: Mapping, wanted: Mapping[str, float]) -> dict[str, float]:
    """The targets that a row of `trial` has errors for."""
    lost = ENERGIES if point["uncounted"] else ()
    return {name: most for name, most in wanted.items() if name not in lost}


def _has_rdf(own):
    return all(own.said["periodic"]) and own.bodies >= 10


def points(
    own: Own, only: Sequence[str] | None, steps: Sequence[float] | None, many: bool
) -> list[Point]:
    """What is run, in this order; ``many`` for all integrators, else the usual ones."""
    known = own.integrators
    if not only:
        usual = [OURS, own.reference, "rigid/nve/small", "rigid/nvt/small", "rigid/npt/small"]
        only = [one for one in known if many or one in usual][: None if many else USUAL]
    dts = sorted(steps or (factor * own.scene.dt for factor in FACTORS))
    return [Point(known[name], dt) for dt in dts for name in only]


def reference(own: Own) -> Point:
    """What means are held against."""
    ours = next((one for one in own.integrators.values() if one.kind == "ours"), None)
    return Point(ours or own.integrators[own.reference], FINER * own.scene.dt)


def total(some: Collection[Point]) -> int:
    """Runs that a meter counts, about."""
    return len(some) + 2 + ROUNDS * min(len(some), FASTEST)


def trial(
    own: Own,
    some: Sequence[Point],
    minutes: float,
    out: Path,
    ranks: int,
    silence: float,
    meter: run.Meter,
    wanted: Mapping[str, float],
    long: float | None = None,
) -> dict:
    """Run what is not there yet, and measure.

    Args:
        some: of `points`.
        minutes: that all may take, by the time of a step now.
        wanted: of `targets`.
        long: how long each run lasts, in the script's units; None for what the minutes allow.

    Returns:
        plain data; after a Ctrl-C of what is complete, with ``interrupted``.
    """
    held = reference(own)
    every = [held, *(one for one in some if one != held)]
    store = Store(
        out / "records", "validation.own.system"
    )  # of lengths, which no error follows from
    summary = machine.circumstances() | {
        "title": own.scene.title,
        "script": Path(own.ask.script).name,
        "notes": own.notes,
        "units": own.scene.units,
        "ns": name_of_ns(own),
        "ranks": ranks,
        "dt": own.scene.dt,
        "bodies": own.bodies,
        "reference": held.dt,
        "minutes": minutes,
        "targets": dict(wanted),
        "about": _about(own, wanted),
        "interrupted": False,
        "late": False,
        "points": [],
    }
    alike = own.scene, long or minutes, ranks, [one.name for one in every]
    origin = store.origin(*alike, files=[own.scene.folder])
    try:
        with store.locked("plan"):
            make = partial(_plan, own, every, minutes, long, out, ranks, silence, meter)
            lengths = Lengths(dt=own.scene.dt, **store.once("plan", origin, make))
        failed: dict[Point, str | None] = {}
        names, begin = {one.name: one for one in every}, time.monotonic()
        for name in store.shared(names):
            one = names[name]
            if time.monotonic() - begin > LATE * 60 * minutes:
                summary["late"] = True
                break
            if _skipped(one, every, failed, own, out, lengths, ranks, silence):
                continue
            job = _job(own, one, out, lengths, ranks, silence)
            meter.begin(f"{one.integrator.label}, {one.dt:g} {own.units.time}", 1)
            result = run.once(job, failures=True)
            failed[one] = failure(own, result)
            meter.end(result.error)
            if result.interrupted:
                raise KeyboardInterrupt
    except KeyboardInterrupt:
        summary["interrupted"] = True
        if "lengths" not in locals():
            return summary
    summary["time"] = lengths.time
    found, rest = {}, shapes.freedom_of_turning(own)
    for one in every:
        job = _job(own, one, out, lengths, ranks, silence)
        if run.is_there(job, failures=True):
            found[one] = _done(own, one, run.collect(job.directory), rest)
    summary["points"] = rows = _rows(own, every, some, found, held, wanted)
    if not summary["interrupted"]:
        try:
            _time(own, _candidates(rows, wanted), out, ranks, silence, meter)
        except KeyboardInterrupt:
            summary["interrupted"] = True
    return summary


def chosen(points: Iterable[Any], wanted: Mapping[str, float], level: float = CONFIDENCE) -> Choice:
    """The `Choice` among rows of `trial`, of each integrator's up to the first one that is not good
    for sure; ``level`` is that of all integrators, see `level_of_each`."""

    def within(some, targets):
        return from_the_shortest(some, targets, level)

    return choose(before_bad(points, wanted), wanted, within)


def _candidates(rows: list, wanted: Mapping[str, float]) -> list:
    """The rows that could be advised, by what the runs themselves took."""
    asked = [row | {"cost": row["rough"]} for row in rows if row["asked"]]
    best = chosen(asked, wanted, level_of_each(asked)).fastest
    found = []
    for row in rows:
        own = judged(row, wanted)
        if row["asked"] and row["rough"] and own and meets(row, own) is not False:
            found.append(row)
    found.sort(key=lambda row: row["rough"]["min"])
    if best is None:
        return found[:FASTEST]
    return [row for row in found if row["rough"]["min"] <= SLOWER * least(best)]


def _time(own, rows, out, ranks, silence, meter) -> None:
    """Give rows their costs, which are timed in turn and without samples."""
    if not rows:
        return
    by_name, some = {}, {}
    for row in rows:
        one = Point(own.integrators[row["integrator"]], row["dt"])
        runs = rounds.lengths(row["rough"]["min"] / steps_of_cost(own, one.dt), SECONDS).runs
        label = f"{row['label']}, {row['dt']:g} {own.units.time}, timed"
        by_name[one.name] = row
        some[one.name] = turns.Timed(label, one.integrator, one.dt, runs)
    found = turns.loops(own, "timed", some, ROUNDS, out, ranks, silence, meter)
    for name, row in by_name.items():
        if found[name]:
            steps = steps_of_cost(own, row["dt"])
            row["cost"] = measures.spread(loop * steps for loop in found[name])


def steps_of_cost(own: Own, dt: float) -> float:
    """How many steps the time has that costs are told of."""
    return NS.get(own.scene.units, 1e3) / dt


def name_of_ns(own: Own) -> str:
    """What costs and drifts are told of."""
    return "ns" if own.scene.units in NS else f"1,000 {own.units.time}"


def _plan(own, every, minutes, long, out, ranks, silence, meter) -> dict:
    """How long runs are, if that is not known, from the time of a step now."""
    one = every[0]
    meter.begin("a step's time", 1)

    def make(runs):
        how: dict = {"dt": one.dt, "every": 0, "ranks": ranks, "silence": silence}
        folder = out / "runs" / "calibration"
        return run.job(own.scene, one.integrator, folder, runs, keeps="nothing", **how)

    step = rounds.calibrate(make)
    meter.end(None if isinstance(step, float) else step.error)
    if not isinstance(step, float):
        if step.interrupted:
            raise KeyboardInterrupt
        raise SystemExit(f"{own.scene.subject}: {one.integrator.label}: {step.error}")
    startup = 3.0 + 2e-5 * len(own.found.body)
    timed = ROUNDS * min(len(every), FASTEST) * (startup + (1 + rounds.SEGMENTS) * SECONDS)
    left = max(0.2 * 60 * minutes, 60 * minutes - startup * len(every) - timed)
    most = max(FEW, ATOMS // len(own.found.body))
    if long is None:
        most = min(most, MOST)
        long = left / (step * sum(1 / one.dt for one in every))
        long = max(long, LEAST * max(one.dt for one in every) / 4, LEAST * own.scene.dt)
    frames = min(most, max(FRAMES, int(long / max(one.dt for one in every) / APART)))
    return {"time": long, "frames": frames, "step": step}


def _job(own, one, out, lengths, ranks, silence) -> run.Job:
    runs = lengths.runs(one.dt)
    origin = machine.origin(own.scene, one.integrator)
    how: dict = {"ranks": ranks, "silence": silence, "keeps": "motion", "origin": origin}
    every = lengths.every(one.dt)
    directory = out / "runs" / one.name
    return run.job(own.scene, one.integrator, directory, runs, dt=one.dt, every=every, **how)


def _skipped(one, every, failed, own, out, lengths, ranks, silence) -> bool:
    """Whether a shorter step of the same integrator has failed, here or in another process."""
    for other in every:
        if other.integrator is one.integrator and other.dt < one.dt:
            job = _job(own, other, out, lengths, ranks, silence)
            if other not in failed and run.is_there(job, failures=True):
                failed[other] = failure(own, run.collect(job.directory))
            if failed.get(other):
                return True
    return False


def failure(own: Own, result: run.Result) -> str | None:
    """None, or in a line why a run is none."""
    if result.error:
        return result.error
    kelvin, at = result.thermo["Temp"], shapes.temperature(own)
    bad = ~np.isfinite(result.thermo["TotEng"]) | (kelvin > 2 * max(at, kelvin[0]))
    if not bad.any():
        return None
    step = result.thermo["Step"][bad][0]
    return f"it heats: the temperature is {kelvin[bad][0]:.4g} at step {step:.0f}"


class _Done(NamedTuple):
    """What is kept of a run: its positions would be too much memory."""

    failed: str | None
    seconds: list[float]  # of a step, in order
    numbers: dict


def _done(own, one, result, rest) -> _Done:
    failed = failure(own, result)
    spent = [timing.seconds / timing.steps for timing in result.timings]
    return _Done(failed, spent, {} if failed else _numbers(own, one, result, rest))


def _rows(own, every, some, found, held, wanted) -> list[dict]:
    """A row for each point, as ``sweep.choice`` takes them; ``some`` are those that are wanted."""
    failed = {one: done.failed for one, done in found.items()}
    numbers = {one: done.numbers for one, done in found.items() if not done.failed}
    rows = []
    for one in every:
        integrator, done = one.integrator, found.get(one)
        fails = [
            f"{other.dt:g}: {failed[other]}"
            for other in every
            if other.integrator is integrator and other.dt <= one.dt and failed.get(other)
        ]
        if done is None and not fails:
            continue
        row: dict = {
            "integrator": integrator.name,
            "label": integrator.label,
            "ours": integrator.kind == "ours",
            "lines": [*own.found.setup, *integrator.commands(own.scene)],
            "dt": one.dt,
            "starts": 1,
            "failed": fails[0] if fails else None,
            "is_reference": one == held,
            "asked": one in some,
            "uncounted": counted.wrongly(integrator),
            "rough": None,  # its cost by its run, with samples
            "cost": None,
            "errors": {},
            "signed": {},
        }
        if not fails and done is not None:
            spent = np.array(done.seconds) * steps_of_cost(own, one.dt)
            parts = np.array_split(spent, 5)
            row["rough"] = measures.spread(float(part.mean()) for part in parts if len(part))
            alike = {
                other.dt: said for other, said in numbers.items() if other.integrator is integrator
            }
            finer = held.dt if held.integrator is integrator else 0.0
            signed = _errors(own, one, alike, numbers.get(held), finer)
            row["signed"] = {name: error.plain() for name, error in signed.items()}
            row["errors"] = {
                name: Estimate(abs(error.value), error.error, error.freedom).plain()
                for name, error in signed.items()
                if name in wanted
            }
        rows.append(row)
    return rows


def _numbers(own, one, result, rest) -> dict:
    """Means and series of a run's kept part; ``rest`` as for `_temperatures`."""
    assert result.positions
    frames = len(result.positions.x) - 1
    first = round(SETTLES * frames)
    kept = result.thermo["Step"] >= first * result.thermo["Step"][-1] / frames
    thermo = {name: values[kept] for name, values in result.thermo.items()}
    motion = Motion(result.positions)
    moving, turning = _temperatures(own, motion, range(1 + first, 1 + frames), rest)
    found = {
        "time": thermo["Step"] * one.dt,
        "conserved": thermo.get("Econserve", thermo["TotEng"]),
        "potential": measures.mean(thermo["PotEng"] / own.bodies),
        "kinetic": float(np.std(thermo["KinEng"])),
        "kinds": _kinds(own, moving, turning),
        "freedom": 2 * thermo["KinEng"].mean() / (own.said["boltzmann"] * thermo["Temp"].mean()),
    }
    if "Density" in thermo:
        found["density"] = measures.mean(thermo["Density"])
    if _has_rdf(own):
        half = REACH * np.min(np.abs(np.diag(own.said["cell"]))) / 2
        ends = 0.3 * own.room, min(half, 2.2 * own.room)
        found["rdf"] = structure.pair_distribution(
            motion,
            slice(1 + first, 1 + frames),
            ends,
            BIN * own.room,
            min(BLOCKS, frames - first),
        )
    return found


def _temperatures(own, motion, frames, rest) -> tuple[np.ndarray, np.ndarray | None]:
    """Temperatures of the bodies' centres and of their turning, (frames,); ``rest``: degrees of
    freedom of all bodies' turning."""
    mass, v = motion.mass, motion.v[list(frames)]
    v = v - np.average(v, axis=1, weights=mass)[:, None]
    axes = own.said["dimension"]
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
    scale = shapes.mvv2e(own) / own.said["boltzmann"]
    return moving * scale / freedom, turning * scale / rest if rest else None


def _kinds(own, moving, turning) -> list[Estimate]:
    """By which part of it temperatures differ: of translation from that of rotation, and of either
    from the thermostat's."""
    kelvin = shapes.temperature(own)
    series = [] if turning is None else [moving - turning]
    if own.found.state.temp:
        series += [one - kelvin for one in (moving, turning) if one is not None]
    return [measures.mean(one / kelvin) for one in series]


def _errors(own, one, alike, held, finer) -> dict[str, Estimate]:
    """By the names of `TARGETS`; without those that cannot be told.

    Args:
        alike: of each step of this integrator what `_numbers` says.
        held, finer: see `law.by_law`.
    """
    dt, mine, energy = one.dt, alike[one.dt], shapes.thermal(own)
    found = {} if counted.wrongly(one.integrator) else _of_energy(own, mine)
    series = [
        law.by_law(dt, {other: numbers["kinds"][k] for other, numbers in alike.items()})
        for k in range(len(mine["kinds"]))
    ]
    kinds = [one for one in series if one]
    if kinds:
        found["temperature"] = max(kinds, key=lambda one: abs(one.value) + one.margin)
    if held is None:
        return found
    for name in ("potential", "density"):
        if name in mine:
            scale = energy if name == "potential" else held[name].value
            means = {other: numbers[name] for other, numbers in alike.items()}
            error = law.by_law(dt, means, held[name], finer)
            if error:
                found[name] = error.times(1 / scale)
    if "rdf" in mine:
        g = {other: numbers["rdf"] for other, numbers in alike.items()}
        error = law.rms_by_law(dt, g, held["rdf"], finer)
        if error:
            found["rdf"] = error
    return found


def _of_energy(own, mine) -> dict[str, Estimate]:
    """What the energy that is to be kept does: its drift, and its change in `SPAN`."""
    time, energy, kt = mine["time"], mine["conserved"], shapes.thermal(own)
    drift = measures.line_drift(time, energy).times(
        steps_of_cost(own, 1.0) / (kt * mine["freedom"])
    )
    lag = max(1, round(SPAN * own.scene.dt / (time[1] - time[0])))
    square = measures.mean((energy[lag:] - energy[:-lag]) ** 2 / 2)
    change = np.sqrt(max(square.value, 1e-300))
    rms = Estimate(change, square.error / (2 * change), square.freedom)
    return {"drift": drift, "energy": rms.times(1 / max(mine["kinetic"], 1e-300))}
