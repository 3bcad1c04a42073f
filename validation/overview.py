"""What the report of all verbs says: from each verb's summary to sentences and tables.

Nothing is measured or judged here: numbers, errors and verdicts are those of the summaries.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from validation import goals, paper_claims, published, report, sweep_choice, sweep_figures, sweep_report, theory_report
from validation.bench_report import spread
from validation.bench_report import title as point_title
from validation.check import bound, measured, number
from validation.compare import FS_PER_PS
from validation.integrators import INTEGRATORS
from validation.longrun import QUANTITIES
from validation.paper import STATEMENTS
from validation.scenes import SCENES
from validation.sweep_plan import SWEEPS

OURS = "nosquish"
FEW = 3  # points that are named
HEADLINES = "energy_sd", "position", "equipartition"  # a sweep's measures at the top of the page: energy, trajectory, thermodynamics
VERDICTS = "holds", "does not hold", "cannot tell"
RAN, BROKEN = ("pass", "fail", "cannot tell", "blow-up"), ("fail", "blow-up")  # verdicts of the atlas
STYLES = {"holds": "holds", "does not hold": "does-not-hold", "cannot tell": "cannot-tell", "pass": "holds", "fail": "does-not-hold",
          "blow-up": "does-not-hold", "met": "holds", "not met": "does-not-hold", "not measured": "cannot-tell"}  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """Text of a table, and the number that it is sorted by (None: by the text; not a number: last)."""

    text: str
    value: float | None = None

    @property
    def style(self):
        """The page's class for a verdict."""
        return STYLES.get(self.text.split(":")[0], "")


@dataclass(frozen=True)
class Table:
    """Rows of `Cell` under headings."""

    title: str
    columns: tuple[str, ...]
    rows: list


@dataclass(frozen=True)
class Figure:
    """A figure to show: its file (or a pattern) in the results' folder, its caption, and the paper's words that stand beside it."""

    file: str
    caption: str
    words: str = ""


@dataclass(frozen=True)
class Said:
    """What a summary says.

    Attributes:
        headlines: sentences for the top of the page.
        best: a table for the top of the page, or None.
        lines: further sentences.
        tables: list of `Table`.
        figures: list of `Figure`.
        commands: what makes these results; None takes the summary's own.
        extent: how long the runs were, in words.
    """

    headlines: list
    lines: list = field(default_factory=list)
    tables: list = field(default_factory=list)
    figures: list = field(default_factory=list)
    best: Table | None = None
    commands: list | None = None
    extent: str = ""


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


def _sweep(summary):
    """The fastest way to small errors, scene by scene."""
    measures, best, every, points = summary["measures"], [], [], []
    for name, scene in summary["scenes"].items():
        points += scene["points"]
        usual = [point for point in scene["points"] if point["dt"] >= SCENES[name].dt]
        for measure in scene["measures"]:
            every += [_way(name, scene, measure, measures[measure], target) for target in sweep_choice.ladder(scene["points"], measure)]
            targets = [target for target in sweep_choice.ladder(usual, measure) if sweep_choice.choose(usual, {measure: target}).best]
            if measure in HEADLINES and targets:
                best.append(_way(name, scene, measure, measures[measure], min(targets)))
    columns = "scene", "wanted", "fastest", "wall s per ns, least (median)", "ours / fastest", "how sure"
    steps = ", ".join(f"{name} {SCENES[name].dt:g} fs" for name in summary["scenes"])
    failed = sum(bool(point["failed"]) for point in points)
    broken = [f"{name}: {scene['error']}" for name, scene in summary["scenes"].items() if scene.get("error")]
    lonely = [f"{name}: {sweep_report.ONE_START}." for name, scene in summary["scenes"].items() if scene["starts"] < 2]
    return Said(
        [*lonely, *([] if best else ["No error of these is reached for sure with a usual time step."])],
        [f"{len(points)} points (an integrator with a time step), {goals.ranks_of(summary['ranks'])}; {failed} failed.", *broken],
        [Table("Fastest way to every error", columns, every), _points(summary)],
        [Figure(f"{name}.png", f"{scene['title']}. {sweep_figures.READ}") for name, scene in summary["scenes"].items()],
        Table(f"The fastest way to the smallest round error that a usual time step or a longer one reaches ({steps}); "
              "whether it lasts, the next part tells", columns, best),
        extent=_swept(summary),
    )


def _swept(summary):
    """How many starts of what length each scene has."""
    told = []
    for name, scene in summary["scenes"].items():
        many = f"{scene['bodies']:,} bodies, {scene['starts']} start{'s' if scene['starts'] > 1 else ''}"
        told += [f"{name} {many} of {summary['lengths'][name]['time']:.3g} ps"] if name in summary["lengths"] else []
    return "; ".join(told)


def _way(scene, data, measure, words, target):
    """A row: who is the fastest, how long that takes, how much longer ours takes, and how sure that is."""
    points, targets = data["points"], {measure: target}
    title = words["title"].replace("the horizon", f"{SWEEPS[scene].horizon:g} fs")
    wanted = [Cell(scene), Cell(f"{title} ≤ {target:g} {words['unit']}".strip())]
    choice, own = sweep_choice.choose(points, targets), sweep_choice.ours(points, targets)
    best, ours = choice.best, own.best
    if not best:
        return [*wanted, Cell("–"), Cell("–", math.nan), Cell("–", math.nan), Cell(choice.verdict)]

    def rival(point):  # of ours, what is not ours, whatever its mrot
        return point["integrator"] != best["integrator"] and not (point["ours"] and best["ours"])

    others = [one.best for one in sweep_choice.each(points, targets).values() if one.best and rival(one.best)]
    second = min(others, key=lambda point: point["cost"]["min"], default=None)
    rivals, maybe = list(filter(rival, choice.ties)), list(filter(rival, choice.perhaps))
    if rivals:
        sure = f"a tie with {sweep_report.names(rivals, FEW)}"
    elif second:
        longer = second["cost"]["min"] / best["cost"]["min"]
        sure = f"{'clear' if data['starts'] > 1 else 'ahead'}: {second['label']} takes {longer:.2f} times as long"
    else:
        sure = "nothing else reaches it for sure"
    sure += f"; no telling of {sweep_report.names(maybe, FEW)}" if maybe else ""
    ratio = ours["cost"]["min"] / best["cost"]["min"] if ours else math.nan
    return [*wanted, Cell(sweep_report.named(best)), Cell(sweep_report.seconds(best["cost"]), best["cost"]["min"]),
            Cell(sweep_report.over(ours, best) if ours else own.verdict, ratio), Cell(sure)]  # fmt: skip


def _points(summary):
    """All points of a sweep."""
    measures, rows = summary["measures"], []
    for name, scene in summary["scenes"].items():
        for point in scene["points"]:
            cost = point["cost"]
            rows.append([
                Cell(name), Cell(point["label"]), Cell(f"{point['dt']:g}", point["dt"]),
                Cell(sweep_report.seconds(cost), cost["min"] if cost else math.nan),
                *(Cell(sweep_report.error_of(point, measure), _sortable(point["errors"].get(measure))) for measure in measures),
                Cell(point["failed"] or "ok"), Cell(point["command"]),
            ])  # fmt: skip
    titles = (f"{one['title']}{sweep_report.unit_of(one)}" for one in measures.values())
    return Table("All points", ("scene", "integrator", "Δt, fs", "s per ns", *titles, "status", "command"), rows)


def _stability(summary):
    """Who breaks where."""
    cases, found = summary["cases"], {}
    for case in cases:
        for row in case["rows"]:
            found.setdefault(row["integrator"], []).append((case, row))
    headlines = []
    for told in summary["summary"]:
        headlines.append(f"{told['what']}: {'yes' if told['holds'] else 'no'}" + (f" ({', '.join(told['where'])})" if told["where"] else "") + ".")
    counts = [(case["name"], len(case["rows"]), len(case["integrators"])) for case in cases]
    partial = [f"{name} ({there} of {all_})" for name, there, all_ in counts if there < all_]
    headlines += [f"Not all integrators have had their turn yet in {', '.join(partial)}."] * bool(partial)
    lines = []
    for case in cases:
        broken = [f"{row['label']} ({_result(row, case)})" for row in case["rows"] if row["verdict"] in BROKEN]
        lines += [f"{case['name']} ({case['criterion']}, {_bound(case)}) breaks {', '.join(broken)}."] * bool(broken)
    rows = [
        [Cell(case["name"]), Cell(case["physics"]), Cell(case["criterion"]), Cell(_bound(case)), Cell(row["label"]),
         Cell(number(row["value"], row["error"] or 0.0), _sortable(row["value"])), Cell(case["bars"]),
         Cell(row["verdict"]), Cell(row["note"] or ""), Cell(row["command"])]
        for case in cases for row in case["rows"]
    ]  # fmt: skip
    columns = "case", "physics", "criterion", "bound", "integrator", "value", "± is", "verdict", "note", "command"
    times = [np.atleast_1d(case["length"])[0] / FS_PER_PS for case in cases if case["unit"] == "fs"]
    return Said(
        headlines, lines, [_atlas(cases, found), Table("Every number", columns, rows)], [Figure("matrix.png", "Each case with each integrator.")],
        _breaks(found), extent=f"the limits of the time step are those of {min(times):g} to {max(times):g} ps" if times else "",
    )  # fmt: skip


def _breaks(found):
    """Integrators with the cases that they do not pass."""
    rows = []
    for of in found.values():
        names = {verdict: ", ".join(case["name"] for case, row in of if row["verdict"] == verdict) for verdict in RAN}
        passed, ran = (sum(row["verdict"] in some for _, row in of) for some in (("pass",), RAN))
        rows.append([Cell(of[0][1]["label"]), Cell(f"{passed} of {ran}", passed / ran if ran else math.nan),
                     *(Cell(names[verdict] or "–") for verdict in RAN if verdict != "pass")])  # fmt: skip
    columns = "integrator", "passes, of what it can run", "outside the bound", "cannot tell", "breaks: not finite, atoms lost, crash or hang"
    return Table("Cases that an integrator does not pass; each is told in full below", columns, rows)


def _bound(case):
    return f"{case['bound']} {case['unit']}".strip()


def _result(row, case):
    """What an integrator came to in a case, as text."""
    return row["verdict"] if row["value"] is None else f"{row['verdict']}, {number(row['value'], row['error'] or 0.0)} {case['unit']}".strip()


def _atlas(cases, found):
    """Cases against integrators."""
    labels = {name: rows[0][1]["label"] for name, rows in found.items()}
    rows = []
    for case in cases:
        verdicts = {row["integrator"]: row["verdict"] for row in case["rows"]}
        rows.append([Cell(case["name"]), *(Cell(verdicts.get(name, "–")) for name in labels)])
    return Table("Cases and integrators", ("case", *labels.values()), rows)


def _bench(summary):
    """Time in the fixes and of the whole step against the fixes of LAMMPS, and the goals."""
    headlines, best, rows = [], [], []
    for point in summary["points"]:
        ratios = {row["name"]: row["modify_ratio"] for row in point["integrators"] if row.get("modify_ratio")}
        ours = next(row for row in point["integrators"] if row["name"] == OURS)
        loops = [row["loop_ratio"] for row in point["integrators"] if row.get("loop_ratio") and row["kind"] == "rigid"]
        fastest = max(loops, key=lambda ratio: ratio["median"], default=None)
        if ours.get("modify"):
            best.append([Cell(point_title(point)), _spread(ours["modify"]), *(_spread(ratios.get(name)) for name in _USUAL), _spread(fastest)])
        for row in point["integrators"]:
            rows.append([Cell(point_title(point)), Cell(row["label"]), *(_spread(row.get(key)) for key in ("modify", "modify_ratio", "loop", "loop_ratio")),
                         Cell(row["error"] or "ok")])  # fmt: skip
    slow = {point_title(point): min((row["cpu"] for row in point["integrators"] if row.get("cpu") is not None), default=report.FREE)
            for point in summary["points"]}  # fmt: skip
    busy = [where for where, share in slow.items() if share < report.FREE]
    if busy:
        worst = min(busy, key=slow.get)
        headlines.append(f"The machine was busy, in {len(busy)} of {len(slow)} rows below: of a core a rank had as little as {slow[worst]:.0f} % "
                         f"({worst}). Ratios of one round still hold, times are too long.")  # fmt: skip
    judged = [goal for goal in summary["goals"] if goal["met"] is not None]
    lines = [f"Of the goals {sum(goal['met'] for goal in judged)} are met, of {len(judged)} that were measured; each is in the first table."]
    for start in summary["starts"]:
        if "first" in start and "later_added" in start:
            first, later = start["first"]["wall"], start["later_added"]["wall"]
            lines.append(
                f"Start, {goals.ranks_of(start['ranks'])}: a first use takes {spread(first)} s, a later one {spread(later)} s more than LAMMPS alone."
            )
    words = {True: "met", False: "not met", None: "not measured"}
    judgements = [[Cell(goal["where"]), Cell(goal["what"]), Cell(f"{goal['limit']:g}", goal["limit"]), _spread(goal["measured"]), Cell(words[goal["met"]])]
                  for goal in summary["goals"]]  # fmt: skip
    columns = "where", "integrator", "Modify, µs/step", "ours / it, Modify", "loop, µs/step", "ours / it, loop", "status"
    return Said(
        headlines, lines, [Table("Goals", ("where", "what", "at most", "measured", "verdict"), judgements), Table("Times", columns, rows)],
        [Figure("size.png", "Time in LAMMPS's Modify against the number of molecules."), Figure("scenes.png", "Time in LAMMPS's Modify of each scene.")],
        Table("Time in the fixes (LAMMPS's Modify), ours, and over that of others; median [minimum–maximum] of rounds", (
            "bodies, ranks", "ours, µs a step", *(f"ours / {INTEGRATORS[name].label}" for name in _USUAL),
            "whole step, ours / the fastest rigid fix"), best),
        commands=_bench_commands(summary),
    )  # fmt: skip


def _bench_commands(summary):
    """What measures all of it: the summary's own command is the last of several parts."""
    parts = [*dict.fromkeys(point["scene"] for point in summary["points"])]
    parts += [verb for verb, key in (("passes", "passes"), ("start", "starts"), ("memory", "memory")) if summary[key]]
    sizes, ranks = (sorted({point[key] for point in summary["points"] if key == "ranks" or point["scene"] == "water"}) for key in ("bodies", "ranks"))
    words = [f"--sizes {','.join(map(str, sizes))}"] * bool(sizes) + [f"--ranks {','.join(map(str, ranks))}"] * bool(ranks)
    return [" ".join(["python -m validation bench", *parts, *words])]


_USUAL = "rigid/nve", "rigid/nve/small", "shake"


def _checks(summary, titles, noun):
    """Numbers between bounds: how many hold, and which do not."""
    checks = summary["checks"]
    counts = {verdict: sum(check["verdict"] == verdict for check in checks) for verdict in VERDICTS}
    headlines = [
        f"Of {sum(counts.values())} {noun} {counts['holds']} hold, {counts['does not hold']} do not, {counts['cannot tell']} cannot be told."
    ]
    some = [f"{check['subject']}, {check['what']}: {measured(check)} ({bound(check)})" for check in checks if check["verdict"] == "does not hold"]
    headlines += [f"Does not hold: {'; '.join(some)}."] * bool(some)
    lines = []
    for part, title in titles.items():
        some = [check for check in checks if check["part"] == part and check["verdict"]]
        if some:
            first = some[0]
            held = sum(check["verdict"] == "holds" for check in some)
            lines.append(
                f"{title}: {held} of {len(some)} hold; for one, {first['subject']}, {first['what']}: {measured(first)} (bound {bound(first)})."
            )
    rows = [[Cell(titles[check["part"]]), Cell(check["subject"]), Cell(check["what"]), Cell(measured(check), _sortable(check["value"])), Cell(bound(check)),
             Cell(check["verdict"]), Cell(check["note"])] for check in checks]  # fmt: skip
    return Said(headlines, lines, [Table("All numbers", ("part", "of", "number", "measured", "bound", "verdict", "note"), rows)])


def _theory(summary):
    said = _checks(summary, theory_report.TITLES, "numbers that the paper's theory bounds")
    captions = {"reversal": "Distance from the start after N steps and back.", "conserved": "Spread of the energy and of the conserved quantity."}
    return replace(said, figures=[Figure(f"{name}.png", caption) for name, caption in captions.items()])


def _published(summary):
    said = _checks(summary, published.TITLES, "standard deviations of the energy are held against published ones:")
    return replace(said, figures=[Figure("spread.png", f"Beside {published.SOURCE}.")])


def _paper(summary):
    said = _checks(summary, paper_claims.TITLES, "numbers that bear on what the paper says of its test problems")
    failed = [f"{row['name']}: {row['error']}" for row in summary["rows"] if row["error"]]
    figures = {"2a": "dimer", "2b": "liquid", "3": "peptide"}
    return replace(
        said, lines=[*said.lines, *[f"Not complete: {'; '.join(failed)}."] * bool(failed)],
        figures=[Figure(f"figure_{name}.png", f"Figure {name}, run again. The paper says of its own:", STATEMENTS[scene]) for name, scene in figures.items()],
    )  # fmt: skip


def _scaling(summary):
    """What ranks send each other."""
    counted = [row for row in summary["counts"] if not row["error"]]
    headlines = []
    for cut in dict.fromkeys(row["decomposition"] for row in counted):
        most = max(row["ranks"] for row in counted if row["decomposition"] == cut)
        rows = [row for row in counted if row["decomposition"] == cut and row["ranks"] == most]
        told = (f"{row['integrator']} {row['messages']:.1f} messages of {row['bytes']:,.0f} bytes in all and {row['collectives']:.2f} collective calls"
                f" with {row['collective_bytes']:,.0f} bytes" for row in rows)  # fmt: skip
        headlines.append(f"A rank hands to MPI in a step, {most} ranks, {cut}s: {'; '.join(told)}.")
    lines = []
    for link in summary["links"]:
        rows = [row for row in summary["model"] if row["link"] == link["name"] and row["decomposition"] == "brick"]
        most = max((row["ranks"] for row in rows), default=0)
        told = ", ".join(f"{row['integrator']} {row['seconds'] * 1e6:,.1f} µs" for row in rows if row["ranks"] == most)
        lines += [f"By the model, {most:,} ranks, bricks, a link {link['name']}: {told} a step."] * bool(rows)
    keys = "messages", "bytes", "collectives", "collective_bytes"
    rows = [[Cell(row["decomposition"]), Cell(row["integrator"]), Cell(f"{row['ranks']}", row["ranks"]), *(Cell(f"{row[key]:,.2f}", row[key]) for key in keys)]
            for row in counted]  # fmt: skip
    return Said(
        headlines,
        lines,
        [Table("Counted, per rank and step", ("cut", "fix", "ranks", *(key.replace("_", " ") for key in keys)), rows)],
        [Figure("scaling.png", "Per rank and step: bytes counted, and time by the model.")],
    )


def _compare(summary):
    """Energies from the same start."""
    rows = summary["integrators"]
    settings = summary["settings"]
    measured_rows = [row for row in rows if row.get("energy_sd")]
    told = [f"{row['label']} {number(**row['energy_sd'])}" for row in measured_rows]
    span = f"{settings['steps']:,} steps of {settings['dt_fs']:g} fs, {goals.ranks_of(settings['ranks'])}"
    headlines = [f"{summary['title']}, {span}: standard deviation of the energy in kcal/mol: {', '.join(told) or 'none was measured'}."]
    drifts = [f"{row['label']} {number(**row['drift'])}" for row in measured_rows if abs(row["drift"]["value"]) > DRIFTS * row["drift"]["error"]]
    lines = [f"Energy drifts by more than {DRIFTS:g} of its errors, kcal/mol/ps: {', '.join(drifts) or 'none'}."]
    failed = [f"{row['label']}: {report.status(row)}" for row in rows if row["error"]]
    lines += [f"Failed: {'; '.join(failed)}."] * bool(failed) + [report.busy(summary)] * bool(report.busy(summary))
    table = [[Cell(row["label"]), *(Cell(report.cell(row, column), _sortable(row.get(column.key))) for column in report.COLUMNS), Cell(report.status(row))]
             for row in rows]  # fmt: skip
    return Said(
        headlines,
        lines,
        [Table("All columns", ("integrator", *(f"{one.title}, {one.unit}" for one in report.COLUMNS), "status"), table)],
        [Figure("energy.png", "Change of the total energy, on one scale.")],
    )


DRIFTS = 5.0  # standard errors


def _long(summary):
    """A free body."""
    lines, rows = [], []
    for row in summary["runs"]:
        if "steps" in row:
            told = ", ".join(f"{what} {row[key]:.1e}" for key, what in QUANTITIES.items())
            lines.append(f"{row['label']}, {row['angle']:g} rad a step, {row['steps']:,} steps: {told}.")
        rows.append([Cell(row["label"]), Cell(f"{row['angle']:g}", row["angle"]), *(_plain_cell(row.get(key)) for key in ("steps", *QUANTITIES)),
                     Cell(row["error"] or "ok")])  # fmt: skip
    short = [row for row in summary["runs"] if row["step"] == "short" and "steps" in row]
    kept = [row["label"] for row in short if all(row[key] <= summary["bound"] for key in QUANTITIES)]
    lost = [row["label"] for row in short if row["label"] not in kept]
    what = f"A free body keeps energy, both momenta and its shape to {summary['bound']:g} at the short step"
    headlines = [f"{what} with {', '.join(kept) or 'none'}; not with {', '.join(lost) or 'none'}."]
    return Said(
        headlines,
        lines,
        [Table("Largest relative error", ("integrator", "rad a step", "steps", *QUANTITIES.values(), "status"), rows)],
        [Figure("long-run.png", "Largest relative error against steps.")],
    )


def _plain(value):
    return "–" if value is None else f"{value:.3g}" if isinstance(value, (int, float)) else str(value)


def _plain_cell(value):
    return Cell(_plain(value), math.nan if value is None else value)


def _spread(value):
    return Cell(spread(value), math.nan if value is None else value["median"])


def _sortable(value):
    return math.nan if value is None else value.get("median", value.get("value")) if isinstance(value, dict) else value


PARTS = (
    Part("sweep", "What is best for which scene", "sweep", _sweep),
    Part("stability", "What breaks where", "stability", _stability),
    Part("bench", "What it costs", "bench", _bench),
    Part("theory", "Whether the theory holds", "theory", _theory),
    Part("paper", "The paper's test problems again", "paper --full", _paper),
    Part("published", "The energy's spread beside published numbers", "published", _published),
    Part("compare-*", "The same start with all fixes", "compare water", _compare),
    Part("long-run", "A free body for very many steps", "long", _long),
    Part("scaling", "What ranks send each other", "scaling", _scaling),
)
