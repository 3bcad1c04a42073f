"""What the report of all verbs says: from each verb's summary to sentences and tables.

Nothing is measured or judged here: numbers, errors and verdicts are those of the summaries.  A
verb says its own section by ``say`` in its ``report.py``; those of sweep, stability, bench,
compare, long and scaling are in this folder.
"""

from collections.abc import Callable
from dataclasses import dataclass

from validation.bench import goals
from validation.bench.report import spread
from validation.bench.report import title as point_title
from validation.breaks import report as breaks_report
from validation.compare import report
from validation.ensembles import report as ensembles_report
from validation.long.measure import QUANTITIES
from validation.pages.said import NONE, Cell, Figure, Said, Table, sortable
from validation.pages.tables import FREE, busy, cell
from validation.paper import report as paper_report
from validation.published import report as published_report
from validation.report import stability, sweep
from validation.scenes.integrators import INTEGRATORS
from validation.statistics.estimate import SURE, Estimate
from validation.theory import report as theory_report

OURS = "nosquish"
# what summaries call a scheme: what the page calls it
NAMES = {"reference 12": "Matubayasi-Nakahara"}
_USUAL = "rigid/nve", "rigid/nve/small", "shake"
_SAMPLED = "What thermostats with long steps sample"
_SPREAD = "The energy's spread beside published numbers"


@dataclass(frozen=True)
class Part:
    """A verb whose results the report gathers."""

    name: str  # of its folder, or a pattern for several; a short run's has ``-short`` behind it
    title: str  # heading
    verb: str  # words after ``python -m validation`` that make the results
    says: Callable[[dict], Said]  # from a summary


def _bench(summary):
    """Time in the fixes and of the whole step against the fixes of LAMMPS, and the goals."""
    best, rows, whole, slow = [], [], {}, {}
    for point in summary["points"]:
        where, found = point_title(point), {row["name"]: row for row in point["integrators"]}
        rigid = (row.get("loop_ratio") for row in found.values() if row["kind"] == "rigid")
        fastest = max(filter(None, rigid), key=lambda ratio: ratio["median"], default=None)
        if found[OURS].get("modify"):
            whole |= {where: fastest["median"]} if fastest else {}
            ratios = [found.get(name, {}).get("modify_ratio") for name in _USUAL]
            best.append([where, *map(_spread, (found[OURS]["modify"], *ratios, fastest))])
        keys = "modify", "modify_ratio", "loop", "loop_ratio"
        for row in found.values():
            cells = (_spread(row.get(key)) for key in keys)
            rows.append([where, row["label"], *cells, row["error"] or "ok"])
        shares = [row["cpu"] for row in found.values() if row.get("cpu") is not None]
        slow[where] = min(shares, default=FREE)
    headlines, short = _whole(whole)
    late = [where for where, share in slow.items() if share < FREE]
    if late:
        worst = min(late, key=slow.get)
        headlines.append(
            f"The machine was busy, in {len(late)} of {len(slow)} rows below: of a core a rank had "
            f"as little as {slow[worst]:.0f} % ({worst}); ratios of one round still hold, times "
            "are too long."
        )
    usual = (f"ours / {INTEGRATORS[name].label}" for name in _USUAL)
    head = "bodies, ranks", "ours, µs a step", *usual, "whole step, ours / the fastest rigid fix"
    title = "Time in the fixes (LAMMPS's Modify) and of the whole step; below 1 ours is the faster;"
    figures = {
        "size.png": "Time in LAMMPS's Modify against the number of molecules.",
        "scenes.png": "Time in LAMMPS's Modify of each scene.",
    }
    columns = "where", "integrator", "Modify, µs/step", "ours / it, Modify", "loop, µs/step"
    return Said(
        headlines,
        _met_and_starts(summary),
        [_goals(summary), Table.of("Times", [*columns, "ours / it, loop", "status"], rows)],
        [Figure(*figure) for figure in figures.items()],
        [Table.of(f"{title} median [minimum–maximum] of rounds", head, best)],
        commands=_bench_commands(summary),
        short=short,
    )


def _whole(whole):
    """A headline, and what is said in short, of the time of a whole step over the fastest fix's."""
    if not whole:
        return [], []
    least, most = min(whole, key=whole.get), max(whole, key=whole.get)
    headline = (
        f"A whole step with ours takes {whole[least]:.2f} ({least}) to {whole[most]:.2f} ({most}) "
        "times that with the fastest of LAMMPS's rigid fixes."
    )
    water = [ratio for where, ratio in whole.items() if where.startswith("water")]
    if not water:
        return [headline], [headline]
    return [headline], [
        f"A whole step of water takes {min(water):.2f} to {max(water):.2f} times that with the "
        f"fastest of LAMMPS's rigid fixes; over all scenes {whole[least]:.2f} to {whole[most]:.2f}."
    ]


def _met_and_starts(summary):
    met = [goal["met"] for goal in summary["goals"] if goal["met"] is not None]
    told = f"Of the goals {sum(met)} are met, of {len(met)} that were measured; each is in the"
    lines = [f"{told} first table."]
    for start in summary["starts"]:
        if "first" in start and "later_added" in start:
            first, later = (spread(start[key]["wall"]) for key in ("first", "later_added"))
            told = f"Start, {goals.ranks_of(start['ranks'])}: a first use takes {first} s, a later"
            lines.append(f"{told} one {later} s more than LAMMPS alone.")
    return lines


def _goals(summary):
    words = {True: "met", False: "not met", None: "not measured"}
    rows = []
    for goal in summary["goals"]:
        numbers = Cell.number(goal["limit"]), _spread(goal["measured"])
        rows.append([goal["where"], goal["what"], *numbers, words[goal["met"]]])
    return Table.of("Goals", "where, what, at most, measured, verdict", rows)


def _bench_commands(summary):
    """What measures all of it: the summary's own command is the last of several parts."""
    points = summary["points"]
    parts = [*dict.fromkeys(point["scene"] for point in points)]
    others = {"passes": "passes", "start": "starts", "memory": "memory"}
    parts += [verb for verb, key in others.items() if summary[key]]
    values = {
        "--sizes": {point["bodies"] for point in points if point["scene"] == "water"},
        "--ranks": {point["ranks"] for point in points},
    }
    parts += [f"{word} {','.join(map(str, sorted(some)))}" for word, some in values.items() if some]
    return [" ".join(["python -m validation bench", *parts])]


def _scaling(summary):
    """What ranks send each other."""
    counted = [row for row in summary["counts"] if not row["error"]]
    lines = []
    for cut in dict.fromkeys(row["decomposition"] for row in counted):
        most, rows = _most([row for row in counted if row["decomposition"] == cut])
        told = (
            f"{row['integrator']} {row['messages']:.1f} messages of {row['bytes']:,.0f} bytes in "
            f"all and {row['collectives']:.2f} collective calls with "
            f"{row['collective_bytes']:,.0f} bytes"
            for row in rows
        )
        lines.append(f"A rank hands to MPI in a step, {most} ranks, {cut}s: {'; '.join(told)}.")
    bricks = [row for row in summary["model"] if row["decomposition"] == "brick"]
    for link in (link["name"] for link in summary["links"]):
        most, rows = _most([row for row in bricks if row["link"] == link])
        told = ", ".join(f"{row['integrator']} {row['seconds'] * 1e6:,.1f} µs" for row in rows)
        if rows:
            where = f"By the model, {most:,} ranks, bricks, a link {link}"
            lines.append(f"{where}: {told} a step.")
    keys = "messages", "bytes", "collectives", "collective_bytes"
    rows = []
    for row in counted:
        numbers = (Cell.number(row[key], ",.2f") for key in keys)
        ranks = Cell(f"{row['ranks']}", row["ranks"])
        rows.append([row["decomposition"], row["integrator"], ranks, *numbers])
    head = "cut, fix, ranks, messages, bytes, collectives, collective bytes"
    caption = "Per rank and step: bytes counted, and time by the model."
    return Said(
        lines=lines,
        tables=[Table.of("Counted, per rank and step", head, rows)],
        figures=[Figure("scaling.png", caption)],
    )


def _most(rows):
    """The largest number of ranks, and the rows with so many."""
    most = max((row["ranks"] for row in rows), default=0)
    return most, [row for row in rows if row["ranks"] == most]


def _compare(summary):
    """Energies from the same start."""
    rows, settings = summary["integrators"], summary["settings"]
    known = [row for row in rows if row.get("energy_sd")]
    told = ", ".join(f"{row['label']} {Estimate.of(row['energy_sd']).text()}" for row in known)
    span = f"{settings['steps']:,} steps of {settings['dt_fs']:g} fs"
    where = f"{summary['title']}, {span}, {goals.ranks_of(settings['ranks'])}"
    what = "standard deviation of the energy in kcal/mol"
    lines = [f"{where}: {what}: {told or 'none was measured'}."]
    drifts = ((row["label"], Estimate.of(row["drift"])) for row in known)
    sure = [f"{label} {one.text()}" for label, one in drifts if abs(one.value) > one.margin]
    lines.append(f"Energy drifts for sure ({SURE}), kcal/mol/ps: {', '.join(sure) or 'none'}.")
    failed = [f"{row['label']}: {report.status(row)}" for row in rows if row["error"]]
    lines += [f"Failed: {'; '.join(failed)}."] * bool(failed)
    lines += filter(None, [busy(summary)])
    table = [
        [row["label"]]
        + [Cell(cell(row, one), sortable(row.get(one.key))) for one in report.COLUMNS]
        + [report.status(row)]
        for row in rows
    ]
    head = "integrator", *(f"{one.title}, {one.unit}" for one in report.COLUMNS), "status"
    figure = Figure("energy.png", "Change of the total energy, on one scale.")
    return Said(lines=lines, tables=[Table.of("All columns", head, table)], figures=[figure])


def _long(summary):
    """A free body."""
    lines, rows, limit = [], [], summary["bound"]
    kept: dict[bool, list[str]] = {True: [], False: []}
    for row in summary["runs"]:
        if "steps" in row:
            told = ", ".join(f"{what} {row[key]:.1e}" for key, what in QUANTITIES.items())
            where = f"{row['label']}, {row['angle']:g} rad a step, {row['steps']:,} steps"
            lines.append(f"{where}: {told}.")
            if row["step"] == "short":
                kept[all(row[key] <= limit for key in QUANTITIES)].append(row["label"])
        numbers = (Cell.number(row.get(key), ".3g") for key in ("steps", *QUANTITIES))
        angle = Cell.number(row["angle"])
        rows.append([row["label"], angle, *numbers, row["error"] or "ok"])
    told = f"with {', '.join(kept[True]) or 'none'}; not with {', '.join(kept[False]) or 'none'}."
    what = f"A free body keeps energy, both momenta and its shape to {limit:g} at the short step"
    head = "integrator", "rad a step", "steps", *QUANTITIES.values(), "status"
    return Said(
        lines=[f"{what} {told}", *lines],
        tables=[Table.of("Largest relative error", head, rows)],
        figures=[Figure("long-run.png", "Largest relative error against steps.")],
    )


def _spread(value):
    return Cell(spread(value), NONE.value if value is None else value["median"])


PARTS = (
    Part("sweep", "What to use", "sweep", sweep.say),
    Part("stability", "What breaks where", "stability", stability.say),
    Part("breaks", "What breaks others", "breaks", breaks_report.say),
    Part("bench", "What it costs", "bench", _bench),
    Part("theory", "Whether the theory holds", "theory", theory_report.say),
    Part("paper", "The paper's test problems again", "paper --full", paper_report.say),
    Part("published", _SPREAD, "published", published_report.say),
    Part("ensembles", _SAMPLED, "ensembles --full", ensembles_report.say),
    Part("compare-*", "The same start with all fixes", "compare water", _compare),
    Part("long-run", "A free body for very many steps", "long", _long),
    Part("scaling", "What ranks send each other", "scaling", _scaling),
)
