"""The committed results as tables and numbers of the documentation: no page has one typed in.

A page with such tables is a Jinja template; `render` fills it. Each function in TABLES is a
Markdown table of that name. The README's table lies between two marks, and
`python docs/_ext/committed.py` writes it anew.
"""

import csv
import functools
import json
import math
import re
import statistics
import sys
from collections import Counter, defaultdict
from importlib import import_module
from pathlib import Path

import jinja2

ROOT = Path(__file__).resolve().parents[2]
if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # behind site-packages

from validation import pages  # noqa: E402

RESULTS = ROOT / "validation" / "results"
BEGIN, END = "<!-- table of the committed results: begin -->", "<!-- end -->"
OURS = "fix_nosquish.NVE"
NOTHING = "–"
NBSP = "\N{NO-BREAK SPACE}"
PM = f"{NBSP}±{NBSP}"


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
    """As a table shows it. Results name our styles as the classes that they are in quotes."""
    styled = re.sub(
        r"fix_nosquish\.(NV[ET]|NP[TH]|HMC)", lambda one: f"nosquish/{one[1].lower()}", str(text)
    )
    return styled.replace("|", "\\|").replace("\n", " ")


def markdown(head, body):
    """A Markdown table."""
    lines = ["| " + " | ".join(map(cell, head)) + " |", "|" + "---|" * len(head)]
    return "\n".join([*lines, *("| " + " | ".join(map(cell, line)) + " |" for line in body)])


def full(text):
    """A case's text with the lengths of the full atlas only."""
    text = re.sub(r"\S+ (\S+) \(--full: ([\d,]+)\)", r"\2 \1", text)
    text = re.sub(r"\S+ \S+ \(--full: ([^)]*)\)", r"\1", text)
    return re.sub(r",? with --full", "", text)


# ---- water: compare, sweep, published


def compare_water():
    body = []
    for row in rows("compare-water"):
        kept = float(row["distance (Å)"])
        body.append(
            [
                code(row["integrator"]),
                margin(row["sd of energy (kcal/mol)"], row["sd of energy margin (kcal/mol)"]),
                margin(row["energy drift (kcal/mol/ps)"], row["energy drift margin (kcal/mol/ps)"]),
                margin(row["temperature (K)"], row["temperature margin (K)"]),
                margin(row["pressure (atm)"], row["pressure margin (atm)"]),
                significant(kept, 2) if kept else NOTHING,
                significant(row["rigidity (Å)"], 1),
            ]
        )
    head = "integrator", "sd of energy, kcal/mol", "drift, kcal/mol/ps", "T, K", "P, atm"
    return markdown([*head, "distance, Å", "rigidity, Å"], body)


SHOWN = "rigid/nve", "rigid", "shake 1e-8 + nve", "rattle 1e-8 + nve", "Gear"


def _points(scene):
    """From integrator and step to a point of the sweep."""
    found = [row for row in rows("sweep", "points") if row["scene"] == scene]
    return {(row["label"], float(row["dt (fs)"])): row for row in found}


def _errors(scene):
    points = _points(scene)
    steps = sorted({step for _, step in points})
    body = []
    for step in steps:
        line = [f"{step:g}"]
        for label in ("NO_SQUISH", *SHOWN):
            point = points.get((label, step))
            line.append(
                margin(point["energy_sd (kcal/mol)"], point["energy_sd margin (kcal/mol)"])
                if point and point["status"] == "ok"
                else "breaks" * bool(point)
            )
        body.append(line)
    return markdown(["step, fs", "ours", *map(code, SHOWN)], body)


def sweep_water():
    return _errors("water")


def sweep_peptide():
    return _errors("peptide")


def sweep_dimer():
    return _errors("dimer")


def sweep_times():
    """Time of LAMMPS's fixes over ours, at the same step, over all steps that both bear."""
    body = []
    for scene in "water", "peptide", "dimer":
        points = _points(scene)
        for label in "rigid/nve", "rigid/nve/small", "shake 1e-8 + nve":
            ratios = {"min": [], "median": []}
            for (name, step), point in points.items():
                ours = points["NO_SQUISH", step]
                if name == label and point["status"] == ours["status"] == "ok":
                    for kind, found in ratios.items():
                        word = f"wall {kind} (s/ns)"
                        found.append(float(point[word]) / float(ours[word]))
            ends = [spread(min(found), max(found)) for found in ratios.values()]
            body.append([scene, code(label), *ends])
    return markdown(["scene", "fix", "shortest times, over ours", "medians, over ours"], body)


def sweep_fastest():
    body = []
    for row in rows("sweep", "fastest"):
        if row["scene"] == "water" and row["measure"] == "energy_sd":
            met = row["verdict"] == "met"
            ties = len(row["a tie with"].split(";")) if row["a tie with"] else 0
            body.append(
                [
                    f"{float(row['target']):g}",
                    code(row["use"]) if met else row["verdict"],
                    f"{float(row['dt (fs)']):g}" if met else "",
                    ties if met else "",
                    f"{float(row['ours dt (fs)']):g}" if row["ours dt (fs)"] else "",
                    f"{float(row['ours / fastest']):.2f}" if row["ours / fastest"] else "",
                ]
            )
    head = "sd of energy below, kcal/mol", "fastest", "its step, fs", "as fast", "our step, fs"
    return markdown([*head, "our time over the fastest's"], body)


def published(verb="published", part="spread"):
    names = {"all": "all together"}
    body = [
        [
            names.get(row["subject"], row["subject"]),
            margin(row["value"], row["margin"]),
            f"{plain(row['low'])} to {plain(row['high'])}"
            if row["low"]
            else f"at most {plain(row['high'])}",
            row["verdict"],
            row["note"],
        ]
        for row in rows(verb)
        if row["part"] == part
    ]
    head = "step", "our spread over theirs", "bound", "verdict", "kcal/mol, with standard errors"
    return markdown(head, body)


# ---- what breaks, where: stress


def _of(part):
    """The cases of a part, and their rows of the table."""
    found = [case for case in summary("stress")["cases"] if case["part"] == part]
    names = {case["name"] for case in found}
    return found, [row for row in rows("stress") if row["case"] in names]


def standing():
    """Which integrator passes how many cases, and which ones it does not."""
    found = defaultdict(lambda: defaultdict(list))
    for row in _of("extreme")[1]:
        verdict = "fail" if row["verdict"] == "blow-up" else row["verdict"]
        found[row["label"]][verdict].append(row["case"])
    body = []
    for label, verdicts in found.items():
        lost = (verdicts[key] for key in ("fail", "cannot tell", "cannot run"))
        counted = (f"{len(cases)}: {', '.join(cases)}" if cases else "0" for cases in lost)
        body.append([code(label), len(verdicts["pass"]), *counted])
    return markdown(["integrator", "passes", "fails", "cannot tell", "cannot run"], body)


def cases():
    found, lines = _of("extreme")
    ours = {row["case"]: row for row in lines if row["label"] == OURS}
    body = []
    for case in found:
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
    found, table = _of("reported")
    fixes = list(dict.fromkeys(row["label"] for row in table))
    body = []
    for case in found:
        numbers = (row["value"] for row in table if row["case"] == case["name"])
        what = f"{case['physics'].rstrip('.')}: {case['criterion']}"
        body.append([what, *(significant(one, 2) if one else "ends" for one in numbers)])
    return markdown(["case", *map(code, fixes)], body)


# ---- tables as the verbs have them


@functools.cache
def said(folder):
    """What a verb says of a committed summary."""
    verb = summary(folder)["command"].split()[3]
    return import_module(f"validation.{verb}.report").said(summary(folder))


def table(folder, title, *keys):
    """The table of a committed summary whose title begins so, with the columns of these keys."""
    (found,) = (one for one in said(folder).all_tables if one.title.startswith(title))
    return pages.markdown(found, keys)


# ---- ensembles


def _schemes(verb, *columns):
    """A row for each scheme and step, with columns of the committed table, (name, unit) each; those
    that the table does not have are left out."""
    table, body = rows(verb), []
    columns = [(name, unit) for name, unit in columns if f"{name} ({unit})" in table[0]]
    schemes = list(dict.fromkeys(row["scheme"] for row in table))
    for row in sorted(table, key=lambda one: (schemes.index(one["scheme"]), _step(one))):
        told = (_number(row, name, unit) for name, unit in columns)
        body.append([row["scheme"], f"{_step(row):g}", row["starts"], *told])
    heads = (f"{name}, {unit}" for name, unit in columns)
    return markdown(["scheme", "step, fs", "starts", *heads], body)


def _number(row, name, unit):
    value = row[f"{name} ({unit})"]
    return margin(value, row.get(f"{name} margin ({unit})")) if value else NOTHING


def _step(row):
    return float(row["step (fs)"])


_OF_SAMPLING = "bias", "cost"  # parts of its bounds; the others are those of thermostats
_TEMPERATURES = ("temp", "K"), ("T_trans − T_rot", "K")


def ensembles_pressure():
    """Means at constant pressure."""
    volumes = ("density", "g/cm³"), ("density", "%"), ("κ of V's sd", "1e-5/atm")
    two_states = ("κ of two P", "1e-5/atm"), ("two states", "sd")
    return _schemes("sample-pressure", *volumes, *two_states, *_TEMPERATURES)


def ensembles_density():
    """Biases of the density that follow from those of the pressure at constant volume, in per cent:
    to first order that of the pressure times the compressibility.  Of one per cent and more the
    first order says little, so these are left out."""
    column = "κ of V's sd (1e-5/atm)"
    kappa = statistics.fmean(float(row[column]) for row in rows("sample-pressure"))
    body = []
    for row in rows("sample-water"):
        if not row["scheme"].startswith("NVT"):
            continue
        names = "pressure (atm)", "pressure margin (atm)"
        value, error = (-1e-3 * kappa * float(row[name]) for name in names)
        if abs(value) < 1:
            pressure = _number(row, "pressure", "atm")
            body.append([row["scheme"], f"{_step(row):g}", pressure, margin(value, error)])
    heads = "scheme", "step, fs", "bias of the pressure, atm", "of the density from it, %"
    return markdown(heads, body)


def ensembles_bounds():
    """What is held against bounds, at constant volume and at constant pressure."""
    volume = [row for row in rows("sample-water", "checks") if row["part"] not in _OF_SAMPLING]
    table = [*volume, *rows("sample-pressure", "checks")]
    return _checks(table, {row["part"] for row in table})


# ---- sampling


def sampling_bias():
    """Distances of means from the limit of small steps."""
    configurations = ("U/N", "kcal/mol a molecule"), ("heat capacity", "%"), ("pressure", "atm")
    more = ("squared torque", "%"), ("dipole fluctuation", "%"), ("T_trans", "K"), ("T_rot", "K")
    return _schemes("sample-water", *configurations, *more)


def sampling_cost():
    """What an independent sample costs."""
    times = ("2τ of U/N", "ps"), ("2τ of dipole fluctuation", "ps")
    less = ((f"less than {one['scheme']}", "times") for one in summary("sample-water")["known"])
    sample = "sample of the slowest", "s"
    return _schemes("sample-water", ("cost median", "s/ps"), *times, sample, *less)


def _times(row, observable):
    """How many times less time a point takes to the error of the first known one, with its 95 %
    interval; empty where that is unknown or 0."""
    value, low, high = (
        row[f"times faster, {observable}{end} (times)"] for end in ("", " low", " high")
    )
    if not value or not float(value):
        return ""
    most = significant(high, 2) if high else "∞"
    return f"{significant(value, 2)} ({significant(low, 2)} to {most})"


def sampling_faster():
    """How many times less time points take to the total error of what users have today."""
    observables = "U/N", "squared torque"
    body = [
        [row["scheme"], f"{_step(row):g}", *told]
        for row in rows("sample-water")
        if any(told := [_times(row, one) for one in observables])
    ]
    return markdown(["scheme", "step, fs", *(f"{one}, times less" for one in observables)], body)


def sampling_bounds():
    """What is held against bounds."""
    return _checks(rows("sample-water", "checks"), _OF_SAMPLING)


def _other(scene):
    """Biases and costs of a scene of `sample` beside water."""
    verb = f"sample-{scene}"
    biases = ("U/N", "kcal/mol a molecule"), ("pressure", "atm"), ("squared torque", "%")
    less = ((f"less than {one['scheme']}", "times") for one in summary(verb)["known"])
    return _schemes(verb, *biases, ("T_rot", "K"), ("cost median", "s/ps"), *less)


def sampling_peptide():
    """A peptide in water."""
    return _other("peptide")


def sampling_benzene():
    """Benzene."""
    return _other("benzene")


def sampling_co2():
    """Carbon dioxide."""
    return _other("co2")


def engines_bias():
    """Distances of means in other engines from their limit of small steps."""
    return _schemes("sample-engines", ("U/N", "kcal/mol a molecule"), ("pressure", "atm"))


def engines_bounds():
    """How far limits are from LAMMPS's, and what is known to be within bounds or outside."""
    table = rows("sample-engines", "checks")
    told = [one for one in table if one["part"] == "limit" or one["verdict"] != "cannot tell"]
    return _checks(told, {row["part"] for row in told})


# ---- long runs, theory, paper


def long_run():
    body = [
        [
            code(row["label"]),
            plain(row["angle"]),
            significant(row["energy"], 1),
            significant(row["angular_momentum"], 1),
            significant(row["momentum"], 1),
            significant(row["shape"], 1),
        ]
        for row in summary("long-run")["runs"]
    ]
    head = "integrator", "step, rad", "kinetic energy", "angular momentum", "momentum", "distances"
    return markdown(head, body)


def _checks(table, parts):
    body = []
    for row in table:
        if row["part"] not in parts:
            continue
        unit = NBSP + row["unit"] if row["unit"] else ""
        low, high = row["low"], row["high"]
        if low and high:
            bound = f"{plain(low)} to {plain(high)}"
        else:
            bound = f"≥{NBSP}{plain(low)}" if low else f"≤{NBSP}{plain(high)}" if high else ""
        value = margin(row["value"], row["margin"]) + unit if row["value"] else NOTHING
        body.append([row["subject"], row["what"], value, bound, row["verdict"]])
    return markdown(["of", "what", "number", "bound", "verdict"], body)


def _theory(*parts):
    return _checks(rows("theory"), parts)


def theory_reversal():
    return _theory("reversal")


def theory_symplectic():
    return _theory("symplectic")


def theory_conserved():
    return _theory("conserved")


def theory_rotors():
    """Error of the free rotation, by how far a body turns in a step."""
    found = summary("theory")["data"]["rotors"]
    head = ["rotation", *(f"{plain(angle)} rad" for angle in found["angles"])]
    lines = []
    for name, errors in found["error"].items():
        lines.append([name, *(significant(error, 2) for error in errors)])
    return markdown(head, lines)


def _confirmed(row, targets, unit):
    """What a long run says of a step: its verdict, and what that could not be told of."""
    step = f"{plain(row['step'])}{NBSP}{unit}"
    if row["failed"]:
        return f"{step}: the run ends with an error"
    open_ = [
        f"{name} {margin(row[name], row[f'{name} margin'])}, at most {plain(most)}"
        for name, most in targets.items()
        if row[name] and abs(float(row[name]) - most) < float(row[f"{name} margin"])
    ]
    return f"{step}: {row['verdict']}" + (f" ({'; '.join(open_)})" if open_ else "")


def own_scripts():
    """What was advised for each of five scripts, and what longer runs say of it."""
    folders = sorted(one.name for one in (RESULTS / "own-scripts").iterdir())
    known = {folder: summary(f"own-scripts/{folder}") for folder in folders}
    confirms = any(found.get("confirmed") for found in known.values())
    lines = []
    for folder, found in known.items():
        unit = "τ" if found["units"] == "lj" else "fs"
        best = found["advised"]
        name = f"{best['label']}, {plain(best['dt'])}{NBSP}{unit}" if best else "no step for sure"
        own = f"{plain(found['dt'])}{NBSP}{unit}"
        title = found["title"] + f", {found['ranks']} ranks" * (found["ranks"] > 1)
        line = [title, own, plain(found["minutes"]), name, found["minutes_that_tell"] or NOTHING]
        longer = rows(f"own-scripts/{folder}", "confirmed") if found.get("confirmed") else []
        line += [_confirmed(row, found["targets"], unit) for row in longer]
        line += [NOTHING] * (2 * confirms - len(longer))  # not run, or the answer itself tells
        lines.append(line)
    head = ["script", "its step", "budget, minutes", "advised", "minutes that would tell, about"]
    if confirms:
        head += ["ten times as long", "1.5 times that step"]
    return markdown(head, lines)


def _paper(*parts):
    return _checks(rows("paper", "claims"), parts)


def paper_dimer():
    return _paper("dimer")


def paper_liquid():
    return _paper("liquid")


def paper_peptide():
    return _paper("peptide")


def paper_gear():
    return _paper("gear")


def paper_rigidity():
    return _paper("rigidity")


def examples():
    """LAMMPS's examples with the suffix: what comes of each, beside LAMMPS's own fix."""
    body = []
    for row in summary("examples")["rows"]:
        begin, falls = row.get("begin"), row.get("falls", ())
        motion = significant(max(begin[::2]), 1) if begin else NOTHING
        half = " and ".join(f"{one:.1f}" for one in falls) or NOTHING
        means = f"{len(row['outside'])} of {row['columns']}" if row.get("columns") else NOTHING
        body.append([code(row["example"]), _outcome(row), motion, half, means])
    head = "input", "result", "first 20 steps", "smaller with half the step", "means outside 95 %"
    return markdown([*head], body)


def _outcome(row):
    """What came of an example, in words."""
    if row["verdict"] == "agrees":
        return "agrees"
    if row["verdict"] == "known":
        return f"differs: {row['why']}"
    note = re.sub(r"^ERROR( on proc \d+)?: (Fix \S+ \S+: )?| \(\S+:\d+\)$", "", row["note"])
    if row["verdict"] == "not with theirs":
        ours = "with the suffix, too" if row["ours"] else "with the suffix it runs"
        return f"LAMMPS's own fix ends ({ours}): {code(note)}"
    return f"{row['verdict']}: {code(note) if row['verdict'] == 'refused' else note}"


# ---- where results come from


def made(verb):
    """How a verb's results were made: command, date, machine, versions; a sentence each."""
    found = summary(verb)
    again = found.get("again")  # parts that were made later
    later = f" Since then {again['parts']}: {_made(again)}" if again else ""
    return f"Made by {_made(found)}{later}"


def _made(found):
    versions = found["versions"]
    return (
        f"`{found['command']}`, {found['date'][:10]}, on {found['machine']['cpu']}. "
        f"LAMMPS {versions['lammps']}, package {versions['package']}."
    )


def scene(verb):
    """What a verb ran, and how long; a sentence."""
    found = summary(verb)
    return f"The scene: {found['title']}, {found['settings']['time']:g} ps from each start."


def holding(verb, name="table"):
    """How many of a table's statements hold, a sentence."""
    verdicts = [row["verdict"] for row in rows(verb, name)]
    count = {verdict: verdicts.count(verdict) for verdict in dict.fromkeys(verdicts)}
    others = [f"{verdict}: {found}" for verdict, found in count.items() if verdict != "holds"]
    text = f"{count.get('holds', 0)} of {len(verdicts)} statements hold"
    return text + (f" ({', '.join(others)})." if others else ".")


def apart(column):
    """How far the first four rows of compare-water lie apart: their standard deviation."""
    found = [float(row[column]) for row in rows("compare-water")[:4]]
    return significant(statistics.stdev(found), 2)


# ---- pages and the README


def render(text):
    """A page of which the braces are filled with what is committed."""
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    names = {function.__name__: function for function in TABLES}
    others = {
        function.__name__: function
        for function in (made, scene, holding, apart, said, summary, significant, table)
    }
    return environment.from_string(text).render(**names, **others)


def readme_table():
    """The README's table: what ours and LAMMPS's fixes give, by the committed results."""
    fixes = OURS, "rigid/nve", "rigid/nve/small", "shake 1e-4 + nve"
    water = {row["integrator"]: row for row in rows("compare-water")}
    free = {
        row["label"]: row["energy"]
        for row in summary("long-run")["runs"]
        if row["step"] == "practical"
    }
    broken = {(row["case"], row["label"]): row["value"] for row in rows("stress")}
    verdicts = defaultdict(Counter)
    extreme, lines = _of("extreme")
    for row in lines:
        verdicts[row["label"]][row["verdict"]] += 1
    ratios = {
        (row["scene"], row["bodies"], row["ranks"], row["integrator"]): [
            row[f"ours / it {part} (loop)"] for part in ("median", "min", "max")
        ]
        for row in rows("cost")
    }

    def energy(fix):
        row = water[fix]
        return margin(row["sd of energy (kcal/mol)"], row["sd of energy margin (kcal/mol)"])

    def whole(*scene):
        def give(fix):
            found = ratios.get((*scene, fix), [""])
            median, low, high = (f"{float(text):.2f}" for text in found) if found[0] else [""] * 3
            return median and f"{median} ({low}–{high})"

        return give

    def judged(fix):
        found = verdicts[fix]
        return f"{found['pass']}, {found['fail'] + found['blow-up']}"

    def broke(case):
        return lambda fix: significant(broken[case, fix], 2) if (case, fix) in broken else ""

    lines = {
        "water at 2 fs: standard deviation of the energy, kcal/mol": energy,
        "1,000 waters: time per step of ours, relative to this fix": whole("water", "1000", "1"),
        "bodies of 2 to 200 atoms: the same": whole("mixed", "1296", "1"),
        f"{len(extreme)} extreme cases: passed, failed": judged,
        "free body, 10⁷ steps: relative change of the energy": lambda fix: (
            significant(free[fix], 1) if fix in free else ""
        ),
        "run in two parts: distance from one long run, σ": broke("tops-runs"),
        "with `fix temp/csvr`: relative error of the temperature": broke("temp-csvr"),
    }
    body = [[what, *(give(fix) or NOTHING for fix in fixes)] for what, give in lines.items()]
    return markdown(["", *map(code, fixes)], body)


def readme_sampling():
    """The README's sentences on the longest step of equal moments, beside what users have today."""
    scheme, step = "NVT langevin 20/ps, moments of 6 amu Å²", 12.0
    today = summary("sample-water")["known"][0]
    (row,) = (one for one in rows("sample-water") if (one["scheme"], _step(one)) == (scheme, step))
    energy, torque = (_times(row, one) for one in ("U/N", "squared torque"))
    less = _number(row, f"less than {today['scheme']}", "times")
    return (
        f"At constant temperature, [larger moments of inertia](docs/fix-nvt.md#moments) allow time "
        f"steps of {step:g} fs for water.\n"
        f"To reach the total error of `fix shake` and `fix langevin` at {today['dt']:g} fs, the "
        f"mean potential energy then needs {energy} times less CPU time.\n"
        f"The squared torque needs {torque} times less.\n"
        f"An independent sample of the total dipole, which is slow, needs {less} times less."
    )


def readme(text):
    """The README with its table as the committed results have it."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{readme_table()}\n\n{readme_sampling()}\n\n{END}{after}"


TABLES = [
    compare_water,
    sweep_water,
    sweep_peptide,
    sweep_dimer,
    sweep_times,
    sweep_fastest,
    published,
    standing,
    cases,
    reported,
    ensembles_pressure,
    ensembles_density,
    ensembles_bounds,
    sampling_bias,
    sampling_cost,
    sampling_faster,
    sampling_bounds,
    sampling_peptide,
    sampling_benzene,
    sampling_co2,
    engines_bias,
    engines_bounds,
    long_run,
    theory_reversal,
    theory_symplectic,
    theory_conserved,
    theory_rotors,
    own_scripts,
    paper_dimer,
    paper_liquid,
    paper_peptide,
    paper_gear,
    paper_rigidity,
    examples,
    readme_table,
]


def main():
    path = ROOT / "README.md"
    path.write_text(readme(path.read_text()))


if __name__ == "__main__":
    sys.exit(main())
