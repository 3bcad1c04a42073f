"""What the report of all verbs says: from each verb's summary to sentences and tables.

Nothing is measured or judged here: numbers, errors and verdicts are those of the summaries.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from validation import (
    breaks_report,
    goals,
    overview_stability,
    overview_sweep,
    paper_claims,
    published,
    report,
    theory_report,
)
from validation.bench_report import spread
from validation.bench_report import title as point_title
from validation.check import SURE, bound, measured, number
from validation.integrators import INTEGRATORS
from validation.longrun import QUANTITIES
from validation.measures import Estimate
from validation.overview_pieces import Cell, Figure, Said, Table, sortable
from validation.paper import STATEMENTS

OURS = "nosquish"
NAMES = {
    "reference 12": "Matubayasi-Nakahara"
}  # what summaries call a scheme: what the page calls it
VERDICTS = "holds", "does not hold", "cannot tell"


@dataclass(frozen=True)
class Part:
    """A verb whose results the report gathers.

    Attributes:
        name: of its folder, or a pattern for several folders; that of a short run has ``-short`` behind it.
        title: heading.
        verb: words after ``python -m validation`` that make the results.
        says: function from a summary to what it `Said`.
    """

    name: str
    title: str
    verb: str
    says: Callable


def _bench(summary):
    """Time in the fixes and of the whole step against the fixes of LAMMPS, and the goals."""
    headlines, best, rows, whole, short = [], [], [], {}, []
    for point in summary["points"]:
        ratios = {
            row["name"]: row["modify_ratio"]
            for row in point["integrators"]
            if row.get("modify_ratio")
        }
        ours = next(row for row in point["integrators"] if row["name"] == OURS)
        loops = [
            row["loop_ratio"]
            for row in point["integrators"]
            if row.get("loop_ratio") and row["kind"] == "rigid"
        ]
        fastest = max(loops, key=lambda ratio: ratio["median"], default=None)
        if ours.get("modify") and fastest:
            whole[point_title(point)] = fastest["median"]
        if ours.get("modify"):
            best.append(
                [
                    Cell(point_title(point)),
                    _spread(ours["modify"]),
                    *(_spread(ratios.get(name)) for name in _USUAL),
                    _spread(fastest),
                ]
            )
        for row in point["integrators"]:
            rows.append([Cell(point_title(point)), Cell(row["label"]), *(_spread(row.get(key)) for key in ("modify", "modify_ratio", "loop", "loop_ratio")),
                         Cell(row["error"] or "ok")])  # fmt: skip
    slow = {point_title(point): min((row["cpu"] for row in point["integrators"] if row.get("cpu") is not None), default=report.FREE)
            for point in summary["points"]}  # fmt: skip
    busy = [where for where, share in slow.items() if share < report.FREE]
    if busy:
        worst = min(busy, key=slow.get)
        headlines.append(f"The machine was busy, in {len(busy)} of {len(slow)} rows below: of a core a rank had as little as {slow[worst]:.0f} % "
                         f"({worst}); ratios of one round still hold, times are too long.")  # fmt: skip
    if whole:
        least, most = min(whole, key=whole.get), max(whole, key=whole.get)
        headlines.insert(0, f"A whole step with ours takes {whole[least]:.2f} ({least}) to {whole[most]:.2f} ({most}) times that with the fastest of "
                            "LAMMPS's rigid fixes.")  # fmt: skip
        water = [ratio for where, ratio in whole.items() if where.startswith("water")]
        short.append(f"A whole step of water takes {min(water):.2f} to {max(water):.2f} times that with the fastest of LAMMPS's rigid fixes; "
                     f"over all scenes {whole[least]:.2f} to {whole[most]:.2f}." if water else headlines[0])  # fmt: skip
    judged = [goal for goal in summary["goals"] if goal["met"] is not None]
    lines = [
        f"Of the goals {sum(goal['met'] for goal in judged)} are met, of {len(judged)} that were measured; each is in the first table."
    ]
    for start in summary["starts"]:
        if "first" in start and "later_added" in start:
            first, later = start["first"]["wall"], start["later_added"]["wall"]
            lines.append(
                f"Start, {goals.ranks_of(start['ranks'])}: a first use takes {spread(first)} s, a later one {spread(later)} s more than LAMMPS alone."
            )
    words = {True: "met", False: "not met", None: "not measured"}
    judgements = [[Cell(goal["where"]), Cell(goal["what"]), Cell(f"{goal['limit']:g}", goal["limit"]), _spread(goal["measured"]), Cell(words[goal["met"]])]
                  for goal in summary["goals"]]  # fmt: skip
    columns = (
        "where",
        "integrator",
        "Modify, µs/step",
        "ours / it, Modify",
        "loop, µs/step",
        "ours / it, loop",
        "status",
    )
    return Said(
        headlines, lines, [Table("Goals", ("where", "what", "at most", "measured", "verdict"), judgements), Table("Times", columns, rows)],
        [Figure("size.png", "Time in LAMMPS's Modify against the number of molecules."), Figure("scenes.png", "Time in LAMMPS's Modify of each scene.")],
        [Table("Time in the fixes (LAMMPS's Modify) and of the whole step; below 1 ours is the faster; median [minimum–maximum] of rounds", (
            "bodies, ranks", "ours, µs a step", *(f"ours / {INTEGRATORS[name].label}" for name in _USUAL),
            "whole step, ours / the fastest rigid fix"), best)],
        commands=_bench_commands(summary), short=short,
    )  # fmt: skip


def _bench_commands(summary):
    """What measures all of it: the summary's own command is the last of several parts."""
    parts = [*dict.fromkeys(point["scene"] for point in summary["points"])]
    parts += [
        verb
        for verb, key in (("passes", "passes"), ("start", "starts"), ("memory", "memory"))
        if summary[key]
    ]
    sizes, ranks = (
        sorted(
            {
                point[key]
                for point in summary["points"]
                if key == "ranks" or point["scene"] == "water"
            }
        )
        for key in ("bodies", "ranks")
    )
    words = [f"--sizes {','.join(map(str, sizes))}"] * bool(sizes) + [
        f"--ranks {','.join(map(str, ranks))}"
    ] * bool(ranks)
    return [" ".join(["python -m validation bench", *parts, *words])]


_USUAL = "rigid/nve", "rigid/nve/small", "shake"


def _checks(summary, titles, noun, shown):
    """Numbers between bounds: how many hold, and those with a ``shown`` verdict."""
    checks = [check for check in summary["checks"] if check["verdict"]]
    counts = {verdict: sum(check["verdict"] == verdict for check in checks) for verdict in VERDICTS}
    others = [
        f"{counts[verdict]} {words}"
        for verdict, words in (("does not hold", "do not"), ("cannot tell", "cannot be told"))
        if counts[verdict]
    ]
    headlines = [
        f"Of {len(checks)} {noun} {', '.join([f'{counts[VERDICTS[0]]} hold', *others])}."
        if others
        else f"All {len(checks)} {noun} hold."
    ]
    lines = []
    for part, title in titles.items():
        some = [check["verdict"] == "holds" for check in checks if check["part"] == part]
        lines += [f"{title}: {sum(some)} of {len(some)} hold."] * bool(some)
    few = [[Cell(titles[check["part"]]), Cell(f"{check['subject']}: {check['what']}"), Cell(measured(check), sortable(check["value"])), Cell(bound(check)),
            Cell(check["verdict"])] for check in checks if check["verdict"] in shown]  # fmt: skip
    rows = [[Cell(titles[check["part"]]), Cell(check["subject"]), Cell(check["what"]), Cell(measured(check), sortable(check["value"])), Cell(bound(check)),
             Cell(check["verdict"]), Cell(check["note"])] for check in summary["checks"]]  # fmt: skip
    return Said(
        headlines, lines, [Table("All numbers", ("part", "of", "number", "measured", "bound", "verdict", "note"), rows)],
        best=[Table("All of them" if VERDICTS[0] in shown else "Those that do not hold, or cannot be told",
                    ("of", "number", "measured", "bound", "verdict"), few)],
        short=headlines,
    )  # fmt: skip


def _theory(summary):
    said = _checks(
        summary, theory_report.TITLES, "numbers that the paper's theory bounds", VERDICTS[1:]
    )
    captions = {
        "reversal": "Distance from the start after N steps and back.",
        "conserved": "Spread of the energy and of the conserved quantity.",
    }
    return replace(
        said, figures=[Figure(f"{name}.png", caption) for name, caption in captions.items()]
    )


def _published(summary):
    said = _checks(
        summary,
        published.TITLES,
        f"statements that the energy's spread is within {100 * published.WITHIN:g} % of that of others",
        VERDICTS,
    )
    origins = [[Cell(what), Cell(where)] for what, where in published.ORIGINS.items()]
    return replace(said, best=[*said.best, Table("Where each number comes from", ("number", "from"), origins)],
                   figures=[Figure("spread.png", f"Beside {published.SOURCE}.")])  # fmt: skip


def _paper(summary):
    said = _checks(
        summary,
        paper_claims.TITLES,
        "numbers that bear on what the paper says of its test problems",
        VERDICTS[1:],
    )
    failed = [f"{row['name']}: {row['error']}" for row in summary["rows"] if row["error"]]
    figures = {"2a": "dimer", "2b": "liquid", "3": "peptide"}
    return replace(
        said, lines=[*said.lines, *[f"Not complete: {'; '.join(failed)}."] * bool(failed)],
        figures=[Figure(f"figure_{name}.png", f"Figure {name}, run again. The paper says of its own:", STATEMENTS[scene]) for name, scene in figures.items()],
    )  # fmt: skip


def _breaks(summary):
    """What users report of LAMMPS's rigid fixes, beside ours."""
    cases, fixes = breaks_report.cases(summary), breaks_report.fixes(summary)
    told = []
    for fix in fixes:
        verdicts = [of_it[fix]["verdict"] for of_it in cases.values() if fix in of_it]
        bad = [
            f"{sum(one == word for one in verdicts)} {words}"
            for word, words in (("fail", "wrong"), ("ends", "ended by an error or a crash"))
            if word in verdicts
        ]
        told.append(
            f"{fix} {sum(one == 'pass' for one in verdicts)}" + f" ({', '.join(bad)})" * bool(bad)
        )
    rows = [
        [Cell(name), Cell(next(iter(of_it.values()))["what"]), Cell(f"{next(iter(of_it.values()))['most']:.2g}", next(iter(of_it.values()))["most"]),
         *(Cell(breaks_report.shown(of_it.get(fix)), sortable(of_it.get(fix, {}).get("value")), of_it.get(fix, {}).get("verdict", "")) for fix in fixes)]
        for name, of_it in cases.items()
    ]  # fmt: skip
    sentence = f"Passed, of {len(cases)} cases that users report as broken: {'; '.join(told)}."
    return Said(
        [sentence],
        best=[Table("Small is good", ("case", "what is measured", "at most", *fixes), rows)],
        short=[sentence],
    )


def _scaling(summary):
    """What ranks send each other."""
    counted = [row for row in summary["counts"] if not row["error"]]
    lines = []
    for cut in dict.fromkeys(row["decomposition"] for row in counted):
        most = max(row["ranks"] for row in counted if row["decomposition"] == cut)
        rows = [row for row in counted if row["decomposition"] == cut and row["ranks"] == most]
        told = (f"{row['integrator']} {row['messages']:.1f} messages of {row['bytes']:,.0f} bytes in all and {row['collectives']:.2f} collective calls"
                f" with {row['collective_bytes']:,.0f} bytes" for row in rows)  # fmt: skip
        lines.append(f"A rank hands to MPI in a step, {most} ranks, {cut}s: {'; '.join(told)}.")
    for link in summary["links"]:
        rows = [
            row
            for row in summary["model"]
            if row["link"] == link["name"] and row["decomposition"] == "brick"
        ]
        most = max((row["ranks"] for row in rows), default=0)
        told = ", ".join(
            f"{row['integrator']} {row['seconds'] * 1e6:,.1f} µs"
            for row in rows
            if row["ranks"] == most
        )
        lines += [
            f"By the model, {most:,} ranks, bricks, a link {link['name']}: {told} a step."
        ] * bool(rows)
    keys = "messages", "bytes", "collectives", "collective_bytes"
    rows = [[Cell(row["decomposition"]), Cell(row["integrator"]), Cell(f"{row['ranks']}", row["ranks"]), *(Cell(f"{row[key]:,.2f}", row[key]) for key in keys)]
            for row in counted]  # fmt: skip
    return Said(
        lines=lines,
        tables=[
            Table(
                "Counted, per rank and step",
                ("cut", "fix", "ranks", *(key.replace("_", " ") for key in keys)),
                rows,
            )
        ],
        figures=[Figure("scaling.png", "Per rank and step: bytes counted, and time by the model.")],
    )


def _compare(summary):
    """Energies from the same start."""
    rows = summary["integrators"]
    settings = summary["settings"]
    measured_rows = [row for row in rows if row.get("energy_sd")]
    told = [f"{row['label']} {number(**row['energy_sd'])}" for row in measured_rows]
    span = f"{settings['steps']:,} steps of {settings['dt_fs']:g} fs, {goals.ranks_of(settings['ranks'])}"
    lines = [
        f"{summary['title']}, {span}: standard deviation of the energy in kcal/mol: {', '.join(told) or 'none was measured'}."
    ]
    drifts = [
        f"{row['label']} {number(**row['drift'])}"
        for row in measured_rows
        if abs(row["drift"]["value"]) > Estimate(**row["drift"]).margin
    ]
    lines += [f"Energy drifts for sure ({SURE}), kcal/mol/ps: {', '.join(drifts) or 'none'}."]
    failed = [f"{row['label']}: {report.status(row)}" for row in rows if row["error"]]
    lines += [f"Failed: {'; '.join(failed)}."] * bool(failed) + [report.busy(summary)] * bool(
        report.busy(summary)
    )
    table = [[Cell(row["label"]), *(Cell(report.cell(row, column), sortable(row.get(column.key))) for column in report.COLUMNS), Cell(report.status(row))]
             for row in rows]  # fmt: skip
    return Said(
        lines=lines,
        tables=[
            Table(
                "All columns",
                ("integrator", *(f"{one.title}, {one.unit}" for one in report.COLUMNS), "status"),
                table,
            )
        ],
        figures=[Figure("energy.png", "Change of the total energy, on one scale.")],
    )


def _long(summary):
    """A free body."""
    lines, rows = [], []
    for row in summary["runs"]:
        if "steps" in row:
            told = ", ".join(f"{what} {row[key]:.1e}" for key, what in QUANTITIES.items())
            lines.append(
                f"{row['label']}, {row['angle']:g} rad a step, {row['steps']:,} steps: {told}."
            )
        rows.append([Cell(row["label"]), Cell(f"{row['angle']:g}", row["angle"]), *(_plain_cell(row.get(key)) for key in ("steps", *QUANTITIES)),
                     Cell(row["error"] or "ok")])  # fmt: skip
    short = [row for row in summary["runs"] if row["step"] == "short" and "steps" in row]
    kept = [
        row["label"] for row in short if all(row[key] <= summary["bound"] for key in QUANTITIES)
    ]
    lost = [row["label"] for row in short if row["label"] not in kept]
    what = f"A free body keeps energy, both momenta and its shape to {summary['bound']:g} at the short step"
    return Said(
        lines=[
            f"{what} with {', '.join(kept) or 'none'}; not with {', '.join(lost) or 'none'}.",
            *lines,
        ],
        tables=[
            Table(
                "Largest relative error",
                ("integrator", "rad a step", "steps", *QUANTITIES.values(), "status"),
                rows,
            )
        ],
        figures=[Figure("long-run.png", "Largest relative error against steps.")],
    )


def _plain(value):
    return (
        "–" if value is None else f"{value:.3g}" if isinstance(value, (int, float)) else str(value)
    )


def _plain_cell(value):
    return Cell(_plain(value), math.nan if value is None else value)


def _spread(value):
    return Cell(spread(value), math.nan if value is None else value["median"])


PARTS = (
    Part("sweep", "What to use", "sweep", overview_sweep.say),
    Part("stability", "What breaks where", "stability", overview_stability.say),
    Part("breaks", "What breaks others", "breaks", _breaks),
    Part("bench", "What it costs", "bench", _bench),
    Part("theory", "Whether the theory holds", "theory", _theory),
    Part("paper", "The paper's test problems again", "paper --full", _paper),
    Part("published", "The energy's spread beside published numbers", "published", _published),
    Part("compare-*", "The same start with all fixes", "compare water", _compare),
    Part("long-run", "A free body for very many steps", "long", _long),
    Part("scaling", "What ranks send each other", "scaling", _scaling),
)
