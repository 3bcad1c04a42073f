"""The committed results and files as tables, sentences and code of the pages and the README.

A page has such text between two marks, of which the first names a function of `FILLS` and its
arguments.  `python docs/_ext/committed.py` writes all of them anew after results have changed.
"""

import csv
import functools
import json
import math
import re
import shlex
import sys
import textwrap
from dataclasses import replace
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # behind site-packages

from validation import pages  # noqa: E402
from validation.compare import choice  # noqa: E402
from validation.report import replacements, report  # noqa: E402
from validation.sample import answers, extrapolation  # noqa: E402
from validation.sample.observables import BY_KEY  # noqa: E402
from validation.statistics.estimate import Estimate  # noqa: E402
from validation.statistics.measures import difference  # noqa: E402

RESULTS = ROOT / "validation" / "results"
PAGES = ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))
MARKS = re.compile(r"(<!-- results: (.*?) -->\n).*?(<!-- end of results -->)", re.DOTALL)
OURS = "nosquish/nve"
NOTHING = "–"
SPENT = "CPU time median (s/ns)"
NBSP = "\N{NO-BREAK SPACE}"
PM = f"{NBSP}±{NBSP}"
ENDS = "low", "high"
DENSITY = "density, g/cm³"
AT_PRESSURE = (  # systems of the README, results and commands
    ("water, NPT averages", "density", "water/density.ini"),
    ("solute with fix shake, NPT", "solute", "recipes/solute/compare.ini"),
)


# ---- reading


def rows(verb, name="table"):
    """The rows of a committed table: a list of dictionaries of text."""
    with open(RESULTS / verb / f"{name}.csv", newline="") as file:
        return list(csv.DictReader(file))


def summary(verb):
    """A committed summary.json."""
    return json.loads((RESULTS / verb / "summary.json").read_text())


# ---- numbers as text


def significant(value, digits=3):
    """A number with so many significant digits: 0.0222, 202, 1,990, 2.2e-13."""
    value = float(value)
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if power < -3 or power > 6:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return sign(f"{mantissa}e{int(exponent)}")
    return sign(f"{round(value, digits - 1 - power):,.{max(0, digits - 1 - power)}f}")


def plain(value):
    """A bound as it is written: 6, 0.02, 1e-9."""
    return sign(re.sub(r"e([+-]?)0*", r"e\1", f"{float(value):.4g}").replace("e+", "e"))


def sign(text):
    """The text with a minus sign in place of a hyphen in front."""
    return "−" + text[1:] if text.startswith("-") else text


def margin(value, error):
    """A number with its 95 % margin, which has two significant digits."""
    if error in ("", None):
        return significant(value)
    value, error = float(value), abs(float(error))
    if not error:
        return significant(value)
    digits = max(0, 1 - math.floor(math.log10(error)))
    if digits > 5:
        return f"{significant(value)}{PM}{significant(error, 2)}"
    return sign(f"{value:,.{digits}f}") + f"{PM}{error:,.{digits}f}"


def spread(low, high, digits=2):
    """A range; one number if both are the same."""
    low, high = (f"{float(end):.{digits}f}" for end in (low, high))
    return low if low == high else f"{low} to {high}"


def code(text):
    return f"`{text}`"


def cell(text):
    """As a table shows it."""
    return styled(str(text)).replace("|", "\\|").replace("\n", " ")


def markdown(head, body):
    """A Markdown table."""
    lines = ["| " + " | ".join(map(cell, head)) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(map(cell, line)) + " |" for line in body)])


def full(text):
    """A case's text with the lengths of the full atlas only."""
    text = re.sub(r"\S+ (\S+) \(--full: ([\d,]+)\)", r"\2 \1", text)
    text = re.sub(r"\S+ \S+ \(--full: ([^)]*)\)", r"\1", text)
    return re.sub(r",? with --full", "", text)


# ---- water: compare, published

SHOWN = "rigid/nve", "rigid", "shake 1e-8 + nve", "rattle 1e-8 + nve", "Gear"


def _points(scene):
    """From integrator and step to a point of a comparison."""
    lines = rows(f"compare-{scene}", "points")
    return {(row["label"], float(row["dt (fs)"])): row for row in lines}


def compare_water(*steps):
    """The standard deviations of the energy of water at these steps."""
    points, body = _points("water"), []
    for step in steps:
        line = [step]
        for label in ("NO_SQUISH", *SHOWN):
            point = points.get((label, float(step)))
            line.append(
                margin(point["energy_sd (kcal/mol)"], point["energy_sd margin (kcal/mol)"])
                if point and point["status"] == "ok"
                else "breaks" * bool(point)
            )
        body.append(line)
    return markdown(["step, fs", "ours", *map(code, SHOWN)], body)


def compare_times():
    """CPU time of LAMMPS's fixes over ours, at each step that both can run."""
    body = []
    for scene in "water", "peptide", "dimer":
        points = _points(scene)
        for label in "rigid/nve", "rigid/nve/small", "shake 1e-8 + nve":
            ratios = []
            for (name, step), point in points.items():
                ours = points["NO_SQUISH", step]
                if name == label and point["status"] == ours["status"] == "ok":
                    ratios.append(float(point[SPENT]) / float(ours[SPENT]))
            body.append([scene, code(label), spread(min(ratios), max(ratios))])
    return markdown(["scene", "fix", "CPU time, over ours"], body)


# ---- what breaks, where: stress


def _of(part):
    """The cases of a part, and their rows of the table."""
    selected = [case for case in summary("stress")["cases"] if case["part"] == part]
    names = {case["name"] for case in selected}
    return selected, [row for row in rows("stress") if row["case"] in names]


def cases():
    extreme, lines = _of("extreme")
    ours = {row["case"]: row for row in lines if row["label"] == OURS}
    body = []
    for case in extreme:
        row = ours[case["name"]]
        unit = f" {case['unit']}" if case["unit"] else ""
        body.append(
            [
                code(case["name"]),
                full(case["physics"]),
                f"{full(case['criterion'])}: {case['bound']}{unit}",
                margin(row["value"], row["margin"]),
                row["verdict"],
            ]
        )
    return markdown(["case", "what it is", "number and bound", "ours", "verdict"], body)


def reported():
    """What users report: each case's number with ours and with LAMMPS's fixes."""
    selected, table = _of("reported")
    fixes = list(dict.fromkeys(row["label"] for row in table))
    body = []
    for case in selected:
        numbers = (row["value"] for row in table if row["case"] == case["name"])
        what = f"{case['physics'].rstrip('.')}: {case['criterion']}"
        body.append([what, *(significant(number, 2) if number else "ends" for number in numbers)])
    return markdown(["case", *map(code, fixes)], body)


# ---- tables as the verbs have them


@functools.cache
def report_of(folder):
    """What a verb says of a committed summary."""
    return report.report_of(summary(folder))[1]


def table(folder, title, *keys):
    """The table of a committed summary whose title begins so, with the columns of these keys.

    A key that begins with a minus sign leaves out the rows whose label and step, such as
    `shake + langevin, 4 fs`, begin with the rest.
    """
    (chosen,) = (entry for entry in report_of(folder).all_tables if entry.title.startswith(title))
    dropped = tuple(key[1:] for key in keys if key.startswith("-"))
    rows = [
        row
        for row in chosen.rows
        if not f"{row.get('label')}, {row.get('dt', 0):g} fs".startswith(dropped)
    ]
    return styled(pages.markdown(replace(chosen, rows=rows), keys))


def printed(folder, *without):
    """What a verb prints, without its tables, and without the lines that begin so."""
    told = report_of(folder)
    shown = (line for line in (told.answer, *told.lines) if not line.startswith(without))
    lines = (part for line in shown for part in textwrap.wrap(line, 110))
    return "\n".join(["```{code-block} text", *lines, "```"])


def checks(folder, *titles):
    """Numbers beside their bounds, of the parts whose titles begin with one of these; none: all.

    A title that is a minus sign and a verdict leaves out the numbers with this verdict."""
    contents = report_of(folder)
    begin = tuple(title for title in titles if not title.startswith("-")) or ""
    wanted = [title for title in contents.parts.values() if title.startswith(begin)]
    parts = [entry for entry in contents.all_tables if entry.title in wanted]
    rows = [row for part in parts for row in part.rows if f"-{row['verdict']}" not in titles]
    keys = "subject", "what", "value", "bound", "verdict"
    return styled(pages.markdown(replace(parts[0], rows=rows), keys))


def styled(text):
    """The text with minus signs."""
    return re.sub(r"(?<![\w.)-])-(?=[\d.])", "−", re.sub(r"(?<![\w.)-])-0 ±", "0 ±", text))


PLAIN = {"U/N": "energy", "dipole fluctuation": "dipole"}


# ---- advice for scripts


def _confirmed(row, targets, unit):
    """What a long run says of a step: its verdict, and what that could not be told of."""
    step = f"{plain(row['dt'])}{NBSP}{unit}"
    if row["failed"]:
        return f"{step}: the run ends with an error"
    errors = {name: Estimate.of(row["errors"][name]) for name in targets if name in row["errors"]}
    open_ = [
        f"{name} {margin(error.value, error.margin)}, at most {plain(targets[name])}"
        for name, error in errors.items()
        if abs(error.value - targets[name]) < error.margin
    ]
    measured = {name: most for name, most in targets.items() if name not in row["without"]}
    met = {True: "met", False: "not met", None: "cannot tell"}[choice.meets(row, measured)]
    verdict = met + " by the rest" * (measured != targets)
    return f"{step}: {verdict}" + (f" ({'; '.join(open_)})" if open_ else "")


def own_scripts():
    """What was advised for each of five scripts, and what longer runs say of it."""
    folders = sorted(folder.name for folder in (RESULTS / "own-scripts").iterdir())
    known = {folder: summary(f"own-scripts/{folder}") for folder in folders}
    confirms = any(result.get("confirmed") for result in known.values())
    lines = []
    for result in known.values():
        unit = "τ" if result["units"] == "lj" else "fs"
        best = result["advised"]
        name = f"{best['label']}, {plain(best['dt'])}{NBSP}{unit}" if best else "not decided"
        step = f"{plain(result['dt'])}{NBSP}{unit}"
        line = [
            result["title"],
            step,
            plain(result["minutes"]),
            name,
            result["minutes_that_tell"] or NOTHING,
        ]
        longer = (result.get("confirmed") or {"points": []})["points"]
        line += [_confirmed(row, result["targets"], unit) for row in longer]
        line += [NOTHING] * (2 * confirms - len(longer))  # not run, or the answer itself tells
        lines.append(line)
    head = ["script", "its step", "budget, minutes", "advised", "minutes that would decide, about"]
    if confirms:
        head += ["a run ten times as long", "one with 1.5 times that step"]
    return markdown(head, lines)


def step_zero():
    """Averages of water at step zero from three long steps, beside the limit of all points."""
    keys, steps, body = ("potential", "pressure", "torque"), (4, 6, 8), []
    sample = summary("sample-water-steps")
    for scheme in "langevin-5", "langevin-20", "csvr":
        selected = [row for row in sample["rows"] if row["scheme"] == scheme and row["dt"] in steps]
        zero = extrapolation.extrapolate(selected, sample["settings"]["time"])
        body.append([selected[0]["label"], *(estimate(zero[key]) for key in keys)])
    body.append(["the limit of all points", *(estimate(sample["limits"][key]) for key in keys)])
    titles = {key: PLAIN.get(BY_KEY[key].title, BY_KEY[key].title) for key in keys}
    heads = (f"{title}, {extrapolation.unit(key)}" for key, title in titles.items())
    text = ", ".join(map(str, steps))
    return markdown([f"scheme, from steps of {text} fs", *heads], body)


def recipe(name):
    """A committed summary.json of a script of `inputs/recipes`."""
    return json.loads((RESULTS / f"{name}-recipe.json").read_text())


def comparison(name):
    """Averages and speeds of commands that `inputs/recipes/compare.py` compared, which averages
    differ from the first command's by more than their errors, and how they were measured."""
    told = recipe(name)
    (first, *others), titles, keys = told["rows"], [*told["rows"][0]["means"]], ("speed", "times")
    body = [
        [
            row["label"],
            *(estimate(row["means"][title]) for title in titles),
            *(spread(row[key]["min"], row[key]["max"]) for key in keys),
        ]
        for row in told["rows"]
    ]
    sentences = [f"Speeds are ranges over {told['starts']} starts."] * (told["starts"] > 1)
    differ = {
        row["label"]: [
            title.partition(",")[0]
            for title, mean in row["means"].items()
            for apart in [difference(Estimate.of(mean), Estimate.of(first["means"][title]))]
            if abs(apart.value) > apart.margin
        ]
        for row in others
    }
    if titles:
        apart = "; ".join(f"{label} ({', '.join(far)})" for label, far in differ.items() if far)
        sentences.append(f"Significantly different from {first['label']}: {apart or 'none'}.")
    table = markdown(["", *titles, "ns/day", "relative to the first"], body)
    return "\n\n".join([table, " ".join(sentences), f"Made by `{told['command']}`{_where(told)}"])


def gains(*folders):
    """How many times less CPU time ours needs for the same error than the best of LAMMPS's fixes,
    where the interval excludes 1; a row for each folder."""
    body = []
    for folder in folders:
        rows = answers.table([summary(folder)]).rows
        decided, others = [], []
        for row in rows:
            low, high = (math.inf if row["gain"][end] is None else row["gain"][end] for end in ENDS)
            average = PLAIN.get(row["average"], row["average"])
            if low <= 1 <= high:
                others.append(average)
            else:
                decided.append(f"{average} {_gain(row['gain'])}")
        scheme = f"{rows[0]['scheme']}, {rows[0]['dt']:g} fs"
        body.append(
            [rows[0]["scene"], scheme, *("; ".join(part) or NOTHING for part in (decided, others))]
        )
    return markdown(["liquid", "ours", "times less CPU time", "not decided"], body)


def estimate(average):
    """A number of a summary with its 95 % margin; nothing for one that is refused."""
    known = Estimate(None) if average.get("why") else Estimate.of(average)
    return NOTHING if known.value is None else margin(known.value, known.margin)


# ---- where results come from


def _where(result):
    versions = result["versions"]
    return (
        f", {result['date'][:10]}, on {result['machine']['cpu']}. LAMMPS {versions['lammps']}, "
        f"fix_nosquish {versions['fix_nosquish']} (checksum {versions['package']})."
    )


def scene(folder):
    """What a verb ran, and how long; a sentence."""
    result = summary(folder)
    if "settings" in result:
        return f"Scene: {result['title']}, {result['settings']['time']:g} ps from each start."
    return f"Scene: {result['title']}, {result['starts']} starts."


def holding(verb, name="table"):
    """How many of a table's statements hold, a sentence."""
    verdicts = [row["verdict"] for row in rows(verb, name)]
    count = {verdict: verdicts.count(verdict) for verdict in dict.fromkeys(verdicts)}
    others = [f"{verdict}: {number}" for verdict, number in count.items() if verdict != "holds"]
    text = f"{count.get('holds', 0)} of {len(verdicts)} statements hold"
    return text + (f" ({', '.join(others)})." if others else ".")


# ---- files


def listing(path, start=""):
    """A file, from the line that begins so."""
    text = (ROOT / path).read_text()
    text = text[re.search(f"^{re.escape(start)}", text, re.M).start() :].rstrip()
    language = {".py": "python", ".ini": "ini"}.get(Path(path).suffix, "lammps")
    return f"```{language}\n{text}\n```"


# ---- the README


def what_to_type(*keys):
    """What to type instead of the usual lines, with the columns of these keys, by speed-up."""
    folders = sorted(path.parent.name for path in RESULTS.glob("*/summary.json"))
    usual = replacements.table(map(summary, folders))
    rows = [*usual.rows, *(_of_recipe(*words) for words in AT_PRESSURE)]
    rows.sort(key=lambda row: float(row["times"].split()[0]), reverse=True)
    return styled(pages.markdown(replace(usual, rows=rows), keys))


def _of_recipe(system, name, file):
    """The row of the last of a recipe's commands, beside the first."""
    usual, *_, ours = recipe(name)["rows"]
    path = ROOT / "inputs" / file
    (command,) = re.findall(rf"^{re.escape(ours['label'])} = (.*)$", path.read_text(), re.M)
    words = shlex.split(command.replace("{seed}", "4928"))
    given = {words[at + 1]: words[at + 2] for at, word in enumerate(words) if word == "-var"}
    script = (path.parent / words[words.index("-in") + 1]).read_text()
    told = re.sub(r"\$\{(\w+)\}", lambda match: given.get(match[1], match[0]), script)
    lines = re.findall(r'fix +1 .*nosquish/npt [^"\n]*|^timestep .*', told, re.M)
    densities = [estimate(row["means"][DENSITY]) for row in (usual, ours) if row["means"]]
    return {
        "system": system,
        "usual": usual["label"],
        "times": pages.digits(ours["times"]["median"], 2),
        "warmer": replacements.NONE,
        "pressure": f"density {' → '.join(densities)} g/cm³" if densities else replacements.NONE,
        "lines": [" ".join(line.split()) for line in sorted(lines)],
    }


def _gain(ratio):
    """A ratio of times with its interval."""
    value, low, high = (pages.digits(ratio[name], 2) for name in ("value", "low", "high"))
    return f"{value} ({low} to {high})"


# ---- pages


FILLS = {
    function.__name__: function
    for function in (
        *(compare_water, compare_times, cases, reported, own_scripts),
        *(step_zero, comparison, gains),
        *(scene, holding, checks, printed, table, what_to_type, listing),
    )
}


def filled(text):
    """A page with what the committed results say now between its marks."""

    def fill(match):
        name, *words = shlex.split(match[2])
        return f"{match[1]}\n{FILLS[name](*words)}\n\n{match[3]}"

    return MARKS.sub(fill, text)


def main():
    for path in PAGES:
        path.write_text(filled(path.read_text()))


if __name__ == "__main__":
    sys.exit(main())
