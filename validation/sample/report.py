"""The report of `sample`."""

from collections.abc import Iterable, Iterator, Mapping
from functools import partial

from ..pages import Column, Figure, Report, Table
from ..statistics import measures
from ..statistics.check import VERDICTS
from ..statistics.estimate import SURE, Estimate
from . import answers, figures
from .criteria import TITLES
from .measure import NESTED
from .observables import BY_KEY, CONFIGURATIONS, OBSERVABLES, warmer
from .plan import LEAST

PER_HOUR = 3600.0  # s
POINT = (
    Column("label", "scheme", kind="text"),
    Column("dt", "step", "fs", "number"),
    Column("starts", "starts", kind="number"),
)
BIASES = (
    *(
        Column(
            f"biases {observable.key}",
            observable.title,
            observable.unit,
            "estimate",
            wide=observable.moves,
        )
        for observable in OBSERVABLES
    ),
    Column("warmer", "T of U/N", "K", "estimate"),
    Column("rdf", "g(r)", "rms", "estimate"),  # of committed results
)
MEANS = (
    Column("means density", "density", "g/cm³", "estimate"),
    Column("means compressibility", "κ of V's sd", "1e-5/atm", "estimate"),
    Column("means two_pressures", "κ of two P", "1e-5/atm", "estimate"),  # of committed results
    Column("deviation", "two states", "sd", "estimate"),
    Column("means temperature", "temp", "K", "estimate"),
    Column("means apart", "T_trans − T_rot", "K", "estimate"),
)
REMEMBERS = tuple(
    Column(f"remembers {key}", f"2τ of {BY_KEY[key].title}", "ps", "estimate", wide=True)
    for key in CONFIGURATIONS
)
COSTS = (
    Column("cost", "cost", "s/ps"),
    *REMEMBERS,
    Column("sample", "sample of the slowest", "s", "estimate"),
)
WORKS = tuple(
    Column(
        f"{what} {key}", f"{heading}{BY_KEY[key].title}", unit, "interval", wide=what == "seconds"
    )
    for what, heading, unit in (("faster", "", "times less"), ("seconds", "time of ", "s"))
    for key in CONFIGURATIONS
)
GOALS = (
    Column("title", "average", kind="text"),
    Column("goal", "E", kind="number", form=".3g"),
    Column("unit", "unit", kind="text"),
    Column("label", "best rival", kind="text"),
    Column("dt", "its step", "fs", "number"),
    Column("seconds", "its time", "s", "interval"),
)
SIDES = (
    Column("speed", "speed", "ns/day, one core"),
    Column("warmer", "energy error", "as K", "estimate"),
    Column("biases pressure", "pressure error", "atm", "estimate"),
    Column("biases torque", "squared torque error", "%", "estimate"),
    Column("hourly potential", "samples of the energy", "per CPU hour", "estimate"),
    Column("hourly dipole", "samples of the dipole", "per CPU hour", "estimate"),
    Column("memory dipole", "memory of the dipole", "ps", "estimate"),
)
TO_ERROR = "How many times less time than the best rival"
FAR = Column("distribution", "K", "sd", wide=True)  # of the kinetic energy
ENDS = Column("status", "status", kind="text"), Column("slowest", "slowest", kind="text")
NOTES = {
    "biases": "The mean minus the limit of small steps. The interval includes the error of the "
    "limit, and its correlation with the point. For the limit, U(h) = U₀ + a h² is fitted to all "
    "points with short steps of the schemes that sample the same distribution. U₀ is common to "
    "all, a differs from scheme to scheme, and a scheme with four steps or more has a term in h⁴, "
    "too. rigid/nvt/small is compared with this limit but not part of the fit, because it counts "
    "three degrees of freedom of the total momentum and so has another limit. OpenMM has the "
    "scene's forces, so its points are compared with LAMMPS's limit. GROMACS does not support this "
    "Coulomb cutoff: it runs with a reaction field, and has its own limit.",
    "U/N": "Potential energy of a molecule.",
    "T of U/N": "The bias of U/N divided by the heat capacity of configurations: the change of the "
    "temperature that would shift U/N as much.",
    "pressure": "At constant volume corrected for a total momentum that is kept at zero. At "
    "constant pressure the limit is the pressure of the barostat.",
    "heat capacity": "The configurational part, var(U) / (kT)², in per cent of the limit.",
    "squared torque": "Mean squared torque of the forces on a molecule about its centre, in per "
    "cent of the limit. It measures how well librations are sampled.",
    "dipole fluctuation": "⟨M²⟩ / (3 ε₀ V kT) of the total dipole M, in per cent of the limit. The "
    "dielectric constant follows from it.",
    "temp, T_trans, T_rot": "LAMMPS's temp, and the temperatures of the molecules' centres and of "
    "their rotation, minus that of the thermostat. temp counts three degrees of freedom less than "
    "a Langevin thermostat moves.",
    "K": "How far mean and width of the bodies' kinetic energy are from the canonical "
    "distribution, in standard deviations, by physical_validation; the larger one counts. A true "
    "bias grows in these units with the length of the run.",
    "density, κ of V's sd": "Mean density, and the compressibility var(V) / (kT ⟨V⟩).",
    "two states": "How far the slope of the logarithm of the ratio of two distributions is from "
    "the exact one, in standard deviations, by physical_validation: of enthalpies at two "
    "temperatures, of volumes at two pressures. The first state is that of the scheme with the "
    "same name, at the same step.",
    "speed": "ns of simulated time in a day of one core.",
    "energy error": "T of U/N.",
    "samples": "Independent samples in an hour of one core.",
    "memory": "Simulated time per independent sample, 2τ.",
    "2τ, cost": "Simulated time per independent sample; CPU time per ps without output, of other "
    "engines wall time on one core. All points were timed in turn.",
    "sample of the slowest": "Cost times the largest of these 2τ: CPU time per independent sample "
    "of the slowest average.",
    "E": "The error to reach: the upper end of the 95 % interval of the bias of the best of "
    "LAMMPS's fixes, and at least the bound.",
    "times less": "CPU time of the best rival divided by that of the point, until bias² + variance "
    f"= 2 E², with the {SURE} interval. The best rival is the one of LAMMPS's fixes that takes the "
    "least time. 0 means that the bias alone is above E, or may be; ∞ that the rival's may be.",
}


def describe(summary: dict) -> Report:
    """The report on the averages of one scene, and on their cost."""
    rows = [_flat(row, summary["limits"]) for row in summary["rows"]]
    settings = summary["settings"]
    answer = " ".join(answers.sentences(answers.table([summary]).rows)) or _verdicts(summary)
    starts = f"{settings['starts']} start" + "s" * (settings["starts"] != 1)
    each = "each of up to " if settings["starts"] > 1 else ""
    length = (
        f"Each point: {settings['time']:g} ps from {each}{starts}, after {settings['settle']:g} ps "
        "of equilibration."
    )
    return Report(
        f"What averages cost: {summary['title']}",
        "How large is the error of an average with each scheme and step, and what does it cost?",
        answer,
        lines=[length, *_limits(summary), *_lost(summary)],
        tables=[table for table in _tables(summary, rows) if table.rows],
        figures=[
            Figure(
                figure.__name__, partial(figure, summary), " ".join((figure.__doc__ or "").split())
            )
            for figure in (figures.precision, figures.bias, figures.temperature)
        ],
        checks=summary["checks"],
        parts=TITLES,
        notes=NOTES,
        failures=[
            f"{row['label']}, {row['dt']:g} fs: {row['error']}" for row in rows if row["error"]
        ],
    )


def _flat(row: dict, limits: Mapping) -> dict:
    """A row with the numbers of each observable at its top level."""
    more = {f"{name} {key}": value for name in NESTED for key, value in row.get(name, {}).items()}
    if change := warmer(row.get("biases", {}), limits):
        more["warmer"] = change.plain()
    if cost := row.get("cost"):
        ends = ("median", "median"), ("min", "max"), ("max", "min")
        more["speed"] = {part: figures.PER_DAY / cost[other] for part, other in ends}
        for key, plain in row["remembers"].items():
            time = Estimate.of(plain)
            if time.margin < time.value:  # else neither is measured
                samples = measures.quotient(Estimate(PER_HOUR / cost["median"]), time)
                more |= {f"hourly {key}": samples.plain(), f"memory {key}": time.plain()}
    return row | more | {"status": row["error"] or "ok"}


def _tables(summary: dict, rows: list[dict]) -> Iterator[Table]:
    """Yield the tables of the page and of the file."""
    yield Table("Side by side", (*POINT, *_shown(SIDES, rows)), rows)
    pressed = MEANS if any("means density" in row for row in rows) else ()
    parts = {
        "Bias, from the limit of small steps": (*BIASES, FAR),
        "At constant pressure": pressed,
        "": COSTS,  # in the file only
        TO_ERROR: WORKS,
    }
    every = []
    for title, columns in parts.items():
        every += (shown := _shown(columns, rows))
        if shown and title:
            yield Table(title, (*POINT, *shown), rows)
    yield Table("", (*POINT, *every, *_shown(ENDS, rows)), rows, "table")
    goals = [
        goal
        | {"title": BY_KEY[key].title, "unit": BY_KEY[key].unit, "goal": goal["error"], "error": ""}
        for key, goal in summary["goals"].items()
    ]
    yield Table("Errors to reach, and the best rival", GOALS, goals)
    lines = {row["label"]: row for row in rows}
    lines_column = Column("lines", "input lines", kind="code")
    yield Table("Input of each scheme", (POINT[0], lines_column), [*lines.values()], long=True)


def _shown(columns: Iterable[Column], rows: list[dict]) -> list[Column]:
    """The columns with a number in any row."""
    return [column for column in columns if any(row.get(column.key) for row in rows)]


def _verdicts(summary: Mapping) -> str:
    """Say how many numbers are within their bounds."""
    if summary["settings"]["time"] < LEAST:
        return (
            f"Nothing is compared with bounds, because the errors of runs shorter than {LEAST:g} "
            "ps cannot be estimated."
        )
    verdicts = [check["verdict"] for check in summary["checks"]]
    held, lost, unknown = (verdicts.count(verdict) for verdict in VERDICTS)
    return (
        f"{len(verdicts)} numbers have bounds: {held} within, {lost} outside, {unknown} undecided "
        "in runs of this length."
    )


def _limits(summary: Mapping) -> list[str]:
    """Describe the limits of small steps, and whether the points agree with a common one."""
    by_engine = {"": summary["limits"]} | {
        f"{name}, ": limits for name, limits in summary["others"].items()
    }
    sentences = [
        _limit(f"{name}{BY_KEY[key].title}", limit)
        for name, limits in by_engine.items()
        for key, limit in limits.items()
    ]
    return sentences or [
        "There is no limit of small steps: it needs a scheme with two short steps, or one "
        "without a time step error."
    ]


def _limit(name: str, limit: Mapping) -> str:
    """Describe a limit, of `measure.limit_as_dict`, in a sentence."""
    text = f"{name}: the limit of small steps is {Estimate.of(limit).text()}"
    schemes = {scheme for scheme, *_ in limit["points"]}
    text += f", of {len(limit['points'])} points of {len(schemes)} schemes"
    if limit["left"]:
        agrees = "agree" if limit["agrees"] else "do NOT agree"
        text += f", which {agrees} with it: χ² is {limit['chi2']:.1f} with {limit['left']} degrees "
        text += f"of freedom, probability {limit['probability']:.2g}"
    return text + "."


def _lost(summary: Mapping) -> list[str]:
    """Explain which starts are left out of the averages; older summaries do not store this."""
    return [
        f"Start {number} failed and is left out of all averages: {why}."
        for number, why in summary.get("lost", {}).items()
    ]
