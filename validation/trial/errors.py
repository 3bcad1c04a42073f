"""What a run of a trial gives, and how far it is off."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..own import counted, shapes
from ..own.system import Own
from ..running import run
from ..scenes.integrators import Integrator
from ..statistics import measures, structure
from ..statistics.estimate import Estimate, margin
from ..statistics.structure import Motion
from . import law
from .targets import SPAN, has_rdf, steps_of_cost

BIN, REACH = 0.04, 0.95  # of g(r): of a body's room, and of half the box
# of a run's kept frames, at most, for the noise of g(r).  Few of them make margins wide, the more
# so for a choice among several; if so many are not independent, their noise counts as error
BLOCKS = 20
# independent parts of a run, of two correlation times each, without which nothing is said of g(r)
LEAST = 5
NARROW = 3  # times below a target is noise with which a run tells whether an error is within
SETTLED = 0.99  # the confidence by which a run is told to be still settling
# why g(r) has no error
SHORT, SETTLING, ERRATIC = "short", "settling", "erratic"


class Untold(NamedTuple):
    """Why g(r) has no error.

    Attributes:
        why: one of the words above.
        parts: as how many independent parts a run counts, as far as it tells.
        off: how far g(r) is off, rms, which is noise.
    """

    why: str
    parts: float
    off: float

    def plain(self, target: float) -> dict:
        """``why``, and how many times as long runs should tell whether the error is below a target;
        None where longer ones of the same start do not."""
        times = {
            SHORT: LEAST / max(self.parts, 1.0),
            SETTLING: None,
            ERRATIC: (NARROW * self.off / target) ** 2,
        }[self.why]
        return {"why": self.why, "longer": times}


def numbers(own: Own, dt: float, result: run.Result, settles: float, rest: int) -> dict:
    """Means and series of a run without its first part.

    Args:
        settles: the part of the run that is left out.
        rest: degrees of freedom of all bodies' turning.
    """
    assert result.positions
    frames = len(result.positions.x) - 1
    first = math.ceil(settles * frames * (1 - 1e-9))
    kept = result.thermo["Step"] >= first * result.thermo["Step"][-1] / frames
    thermo = {name: values[kept] for name, values in result.thermo.items()}
    motion = Motion(result.positions)
    moving, turning = _temperatures(own, motion, range(1 + first, 1 + frames), rest)
    found = {
        "time": thermo["Step"] * dt,
        "conserved": thermo.get("Econserve", thermo["TotEng"]),
        "potential": measures.mean(thermo["PotEng"] / own.bodies),
        "kinetic": float(np.std(thermo["KinEng"])),
        **_temperature_errors(own, moving, turning),
        "freedom": 2 * thermo["KinEng"].mean() / (own.said["boltzmann"] * thermo["Temp"].mean()),
    }
    if "Density" in thermo:
        found["density"] = measures.mean(thermo["Density"])
    if has_rdf(own):
        half = REACH * np.min(np.abs(np.diag(own.said["cell"]))) / 2
        ends = 0.3 * own.room, min(half, 2.2 * own.room)
        found["rdf"] = structure.pair_distribution(
            motion,
            slice(1 + first, 1 + frames),
            ends,
            BIN * own.room,
            min(BLOCKS, frames - first),
        )
        halves = np.array_split(thermo["PotEng"] / (own.bodies * shapes.thermal(own)), 2)
        found["settling"] = measures.difference(*(measures.mean(half) for half in halves[::-1]))
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


def _temperature_errors(own, moving, turning) -> dict:
    """``kinds``: by which part of it temperatures differ, of translation from that of rotation, and
    of either from the thermostat's.  ``independent``: how many such frames would have the error of
    the first, if there were no correlation."""
    kelvin = shapes.temperature(own)
    series = [] if turning is None else [moving - turning]
    if own.found.state.temp:
        series += [one - kelvin for one in (moving, turning) if one is not None]
    kinds = [measures.mean(one / kelvin) for one in series]
    independent = float(len(moving))
    if kinds and kinds[0].error:
        independent = min(independent, float(np.var(series[0] / kelvin)) / kinds[0].error ** 2)
    return {"kinds": kinds, "independent": independent}


def errors(
    own: Own,
    one: Integrator,
    dt: float,
    alike: Mapping[float, Mapping],
    held: Mapping | None,
    finer: float,
) -> dict[str, Estimate]:
    """How far an integrator with a step is off, by the names of `TARGETS`; without those that
    cannot be told.  For the arguments see `of_means`."""
    energies = {} if counted.wrongly(one) else _of_energy(own, alike[dt])
    return energies | of_means(own, dt, alike, held, finer)


def of_means(
    own: Own, dt: float, alike: Mapping[float, Mapping], held: Mapping | None, finer: float
) -> dict[str, Estimate]:
    """The part of `errors` that other steps tell, too.

    Args:
        alike: what `numbers` gives of this step, and of others of this integrator that help to
            tell its errors, by step.
        held: what it gives of the run that means are held against.
        finer: that run's step if it is of this integrator, else 0: see `law.by_law`.
    """
    mine, found = alike[dt], dict[str, Estimate]()
    series = [
        law.by_law(dt, {other: said["kinds"][k] for other, said in alike.items()})
        for k in range(len(mine["kinds"]))
    ]
    kinds = [one for one in series if one]
    if kinds:
        found["temperature"] = max(kinds, key=lambda one: abs(one.value) + one.margin)
    if held is None:
        return found
    for name in ("potential", "density"):
        if name in mine:
            scale = shapes.thermal(own) if name == "potential" else held[name].value
            means = {other: said[name] for other, said in alike.items()}
            error = law.by_law(dt, means, held[name], finer)
            if error:
                found[name] = error.times(1 / scale)
    if "rdf" in mine:
        error, _ = of_g(dt, alike, held, finer)
        if error:
            found["rdf"] = error
    return found


def of_g(
    dt: float, alike: Mapping[float, Mapping], held: Mapping, finer: float
) -> tuple[Estimate | None, Untold | None]:
    """The error of g(r), or why there is none: runs are too short, the start was not in
    equilibrium, or the error does not follow the step.  For the arguments see `of_means`.

    Parts of a run that are not independent would make noise an error.  How many are follows from
    all these runs, which have the same motion and length.
    """
    runs = [held["rdf"], *(said["rdf"] for said in alike.values())]
    number, variance = measures.parts_of_runs(runs)
    settling, mine = held["settling"], alike[dt]["rdf"]
    if mine.shape[1:] != held["rdf"].shape[1:]:
        return None, None
    off = float(np.sqrt(np.mean((mine.mean(axis=0) - held["rdf"].mean(axis=0)) ** 2)))
    if number < LEAST:
        return None, Untold(SHORT, number, off)
    if abs(settling.value) > margin(settling.error, settling.freedom, SETTLED):
        return None, Untold(SETTLING, number, off)
    against, *others = measures.independent(runs, int(number), variance)
    error = law.rms_by_law(dt, dict(zip(alike, others)), against, finer)
    erratic = error is None and dt != finer
    return error, Untold(ERRATIC, number, off) if erratic else None


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
