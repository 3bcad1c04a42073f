"""The one renderer, and the page of all: what they say are the summaries' numbers, whatever is
missing or broken, and the page works in a browser from one file."""

import html
import io
import json
import re
import shutil
import subprocess

import pytest
from matplotlib.figure import Figure as Drawing
from rich.console import Console

from support.running import ROOT
from validation import __main__ as command
from validation import pages
from validation.pages import Cell, Column, Figure, Report, Table
from validation.report import replacements, report
from validation.sample import answers, criteria, rivals
from validation.statistics.check import Check
from validation.statistics.estimate import Estimate

COMMITTED = ROOT / "validation" / "results"
FOLDERS = sorted(path.parent for path in COMMITTED.rglob("summary.json"))
WHERE = {
    "command": "nosquish cost water",
    "date": "2026-01-01T00:00:00+00:00",
    "machine": {"cpu": "Abacus"},
    "versions": {"fix_nosquish": "0.1.0", "package": "0123456789ab"},
}
COLUMNS = (
    Column("name", "name", kind="text"),
    Column("sd", "sd", "kcal", "estimate"),
    Column("loop", "loop", "µs"),
    Column("loop_ratio", "ours / it", "loop"),
    Column("gain", "gain", "times", "interval"),
    Column("ranks", "ranks", kind="number", form=","),
    Column("verdict", "verdict", kind="verdict"),
    Column("nothing", "nothing", kind="text"),
)
SPREAD = {"median": 0.32, "min": 0.3, "max": 1.0}
ROWS = [
    {"name": "ours", "ours": True, "sd": {"value": 2.0, "error": 0.1, "freedom": None}}
    | {"loop": SPREAD, "loop_ratio": SPREAD, "gain": {"value": 2.0, "low": 1.5, "high": None}}
    | {"ranks": 1000, "verdict": "holds"},
    {"name": "[b] <i>", "error": "lost atoms", "verdict": Cell("odd", 3.0, "does not hold")},
]


def describe(figure=None):
    """Of everything something."""
    checks = [
        Check("one", "ours", "drift", 1.0, 0.1, high=2.0).plain(),
        Check("one", "theirs", "drift", 3.0, 0.1, high=2.0, note="so far").plain(),
    ]
    return Report(
        *("Title", "Question?", "Answer."),
        tables=[Table("All", COLUMNS, ROWS, "table"), Table("None", COLUMNS, [], "empty")],
        figures=[Figure("cost", lambda: figure, "How to read it")],
        checks=checks,
        parts={"one": "Of drifts"},
        failures=["rigid: lost [atoms]"],
    )


@pytest.mark.quick
def test_terminal_files_and_page(tmp_path):
    """Locks out a number that terminal, file or page lose or change, whole numbers that an empty
    cell beside them makes broken ones, markup or HTML in
    a name, an empty table, a failure or a Ctrl-C that nothing is said of, and a figure of an
    earlier command beside the numbers of now."""
    (tmp_path / "empty.csv").write_text("of an earlier command")
    summary = WHERE | {"interrupted": True}
    pages.write(describe(Drawing()), summary, tmp_path)
    assert (tmp_path / "cost.png").exists() and not (tmp_path / "empty.csv").exists()
    assert json.loads((tmp_path / "summary.json").read_text()) == summary
    head, first, second = (tmp_path / "table.csv").read_text().splitlines()
    assert head == (
        "name,sd (kcal),sd margin (kcal),loop median (µs),loop min (µs),loop max (µs),"
        "ours / it median (loop),ours / it min (loop),ours / it max (loop),"
        "gain (times),gain low (times),gain high (times),ranks,verdict,nothing"
    )
    assert (
        first
        == f"ours,2.0,{0.1 * 1.959963984540054},0.32,0.3,1.0,0.32,0.3,1.0,2.0,1.5,,1000,holds,"
    )
    assert second == "[b] <i>" + 13 * "," + "odd,"
    page = (tmp_path / "report.html").read_text()
    for text in "2.00 ± 0.20", "0.32 [0.3–1]", "2 (1.5–∞)", "1,000", "[b] &lt;i&gt;", "Abacus":
        assert text in page, text
    assert "nothing" not in page and "was interrupted" in page and "does not hold" in page.lower()
    assert not re.search(r"@import|url\(|fetch\(|<link|<iframe|(src|href)=\"(?!data:|#)", page)
    screen = Console(record=True, width=150, file=io.StringIO())
    pages.show(screen, describe(), summary, tmp_path)
    printed = screen.export_text()
    for text in "Question?", "Answer.", "✗ [b] <i>", "✗ rigid: lost [atoms]", "Interrupted":
        assert text in printed, text
    assert (
        printed.count("✗") == 2
        and re.search(r"0\.32 +0\.32 ", printed)
        and "does not hold: theirs: drift: 3.00 ± 0.20" in printed
    )
    pages.draw(describe(), tmp_path)
    assert not (tmp_path / "cost.png").exists()
    assert pages.markdown(describe().tables[0], ["name", "gain"]).splitlines() == [
        *("| name | gain, times |", "|---|---|", "| ours | 2 (1.5–∞) |", "| [b] <i> | – |")
    ]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.relative_to(COMMITTED).as_posix())
def test_tables_of_committed_summaries(folder, tmp_path):
    """Locks out a committed number that does not follow from the committed summary any more: the
    same code has to make the same CSV files of it, byte for byte."""
    summary = json.loads((folder / "summary.json").read_text())
    verb = summary["command"].split()[1]
    module = pytest.importorskip(f"validation.{verb}.report")
    pages.write_tables(module.describe(summary), tmp_path)
    for path in folder.glob("*.csv"):
        assert (tmp_path / path.name).read_bytes() == path.read_bytes(), path.name


def sample(*rows):
    """A summary of `sample`: scheme, step, s of a ps, biases of U/N and torque, their noises."""
    keys = "potential", "torque"
    made = [
        {"scheme": label, "label": label, "dt": dt, "ours": label.startswith("ours"), "error": None}
        | {"cost": {"median": cost, "min": cost, "max": cost}}
        | {"biases": dict(zip(keys, (Estimate(*one).plain() for one in biases)))}
        | {"noise": dict(zip(keys, (Estimate(one, one / 20).plain() for one in noises)))}
        for label, dt, cost, biases, noises in rows
    ]
    goals = rivals.compare(made, criteria.LEAST_ERRORS)
    return WHERE | {"scene": "water", "known": [], "limits": {}, "rows": made, "goals": goals}


RIVALS = (
    ("shake", 2.0, 2.0, [(0.02, 1e-6), (0.9, 1e-6)], (1.0, 5.0)),  # off in U/N, however cheap
    ("small", 2.0, 2.2, [(0.002, 1e-6), (0.2, 1e-6)], (6.0, 8.0)),
    ("small", 4.0, 1.2, [(0.007, 1e-6), (0.2, 1e-6)], (4.0, 5.5)),
)


def test_the_answer_follows_the_numbers():
    """Locks out an error to reach that is not the best rival's, a rival that is off or at another
    than its best step, a gain that the numbers do not tell, a point that is good for one average
    only, and a defeat that is kept quiet.

    By hand: U/N is to reach 0.006, the bound, as 0.002 is below it; torque 1 %.  At 4 fs small
    takes 4 / (2 0.006² - 0.007²) = 173913 s, at 2 fs 6 / (2 0.006² - 0.002²) = 88235 s, and ours at
    6 fs 2 / (2 0.006² - 0.004²) = 35714 s.  Of the torque shake takes 5 / (2 - 0.81) = 4.2017,
    small at 4 fs 5.5 / (2 - 0.04) = 2.806, and ours at 6 fs 5.1 / (2 - 0.09) = 2.670 s.
    """
    ours = [
        ("ours", 4.0, 1.0, [(0.001, 1e-6), (0.1, 1e-6)], (3.0, 8.0)),
        ("ours", 6.0, 0.7, [(0.004, 1e-6), (0.3, 1e-6)], (2.0, 5.1)),
        ("ours", 8.0, 0.5, [(0.007, 1e-6), (0.5, 1e-6)], (1.0, 1.0)),
    ]
    energy, torque = answers.table([sample(*ours, *RIVALS)]).rows
    assert (energy["dt"], energy["rival"], energy["rival dt"]) == (6.0, "small", 2.0)
    assert (torque["dt"], torque["rival"], torque["rival dt"]) == (6.0, "small", 4.0)
    assert energy["goal"] == 0.006 and torque["goal"] == 1.0
    assert energy["gain"]["value"] == pytest.approx(88235 / 35714, rel=0.01)
    assert torque["gain"]["value"] == pytest.approx(2.806 / 2.670, rel=0.01)
    (told,) = answers.sentences([energy, torque])
    assert told.startswith("Water: ours at 6 fs.") and "U/N 2.5 (95 % CI 2.1–2.9)" in told
    (defeat,) = answers.defeats([energy, torque])
    assert "squared torque" in defeat and "small at 4 fs" in defeat
    assert answers.table([sample(ours[2], *RIVALS)]).rows[0]["gain"]["value"] == 0.0
    worse = ("ours", 4.0, 1.0, [(0.02, 1e-6), (0.5, 1e-6)], (1.0, 4.0))  # also off in U/N
    assert answers.table([sample(worse, ours[2], *RIVALS)]).rows[0]["dt"] == 8.0
    assert not answers.table([sample(*ours), WHERE]).rows


def test_replacements_follow_the_numbers():
    """Locks out a table for users whose speeds, errors or lines are not those of the points that it
    names, and a row made of other points where one of the two was not measured.

    By hand: 2 s of CPU time per ps are 43.2 ns/day and 0.5 s 172.8; U/N is off by 0.02 and 0.01
    of a heat capacity of 5 kB: 0.01 / (5 0.0019872) = 1.006 K, and twice as much.
    """
    line = 'fix 1 water python/move "fix_nosquish.NVT water molecule temp 298 298 50 seed SEED"'
    usual = ("shake+langevin", 2.0, 2.0, [(0.02, 1e-6), (0.9, 1e-6)], (1.0, 5.0))
    ours = ("langevin-20-equal-6", 12.0, 0.5, [(0.01, 1e-6), (0.9, 1e-6)], (1.0, 5.0))
    summary = sample(usual, ours) | {"limits": {"capacity": Estimate(5.0, 1e-6).plain()}}
    for row in summary["rows"]:
        row["lines"] = ["fix bath", line]
    (row,) = replacements.table([WHERE, summary]).rows
    assert row["speed"] == "43.2 → 173" and row["times"] == "4"
    assert re.match(r"2\.012\d* ± \S+ → 1\.006\d* ±", row["warmer"])
    assert row["lines"][0] == "fix 1 water nosquish/nvt molecule temp 298 298 50 seed 4928"
    assert row["lines"][1] == "timestep 12" and row["pressure"] == "not measured"
    assert not replacements.table([sample(usual)]).rows


def test_page_of_all_is_short(tmp_path):
    """Locks out a page of all results that nobody reads: of 20,000 words or more."""
    sections, problems = report.gather(tmp_path)
    report.write(sections, problems, tmp_path / "report.html")
    text = re.sub(
        r"<(script|style).*?</\1>|<[^>]*>", " ", (tmp_path / "report.html").read_text(), flags=re.S
    )
    assert not problems and 5000 < len(text.split()) < 20000


# ------------------------------------------------------------- in a browser

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")
LOOK = """<script>
addEventListener("load", () => {
  const tell = text => {
    const line = parent.document.createElement("pre");
    line.className = "found";
    line.textContent = `${innerWidth} ${text}`;
    parent.document.body.append(line);
  };
  for (const details of document.querySelectorAll("details")) details.open = true;
  const wide = [...document.querySelectorAll("body > *, section > *")].filter(
    one => one.getBoundingClientRect().right > innerWidth + 1);
  tell(`wide ${wide.map(one => one.textContent.trim().slice(0, 60)).join("; ")}`);
  const spilled = [...document.querySelectorAll("td, th")].filter(cell => {
    const range = document.createRange();
    range.selectNodeContents(cell);
    return range.getBoundingClientRect().right > cell.getBoundingClientRect().right + 1;
  });
  tell(`spilled ${spilled.map(one => one.textContent.trim().slice(0, 60)).join("; ")}`);
  const table = [...document.querySelectorAll("table")].find(
    one => one.rows[0].cells[0].textContent === "number");
  for (let n = 0; table && n < 2; n++) {
    table.rows[0].cells[0].querySelector("button").click();
    tell(`sorted ${[...table.tBodies[0].rows].map(row => row.cells[0].textContent).join()}`);
  }
  if (!document.getElementById("figure")) return;
  const marks = () => [...document.querySelectorAll("#figure g.mark title")].map(
    one => one.textContent);
  tell(`marks ${marks().join("; ")}`);
  document.querySelector("#figure input").click();
  tell(`left ${marks().length}`);
});
</script></body>"""


@pytest.mark.skipif(BROWSER is None, reason="no Chromium on PATH")
def test_page_in_a_browser(tmp_path):
    """Locks out tables over the page's edge, cells over one another, numbers sorted as words, and a
    figure that does not draw a point, or whose schemes cannot be switched off."""
    numbers = Table.of(
        "Sorted", "number", [[Cell("10", 10)], [Cell("9", 9)], ["–"], [Cell("1e2", 1e2)]]
    )
    summary = sample(("ours", 4.0, 1.0, [(0.001, 0.001), (0.1, 0.1)], (3.0, 6.0)), *RIVALS)
    section = pages.Section(Report("Title", "", "", tables=[numbers]), summary, tmp_path, "one")
    report.write([section], [], tmp_path / "one.html")
    every, _ = report.gather(tmp_path)
    report.write(every, [], tmp_path / "all.html")
    frames = "".join(
        f'<iframe style="width: {width}px; height: 900px" srcdoc="{html.escape(text)}"></iframe>'
        for name, widths in (("one", (401, 1301)), ("all", (400, 1300)))
        for text in [(tmp_path / f"{name}.html").read_text().replace("</body>", LOOK)]
        for width in widths
    )
    (tmp_path / "look.html").write_text(f"<!doctype html><body>{frames}</body>")
    words = "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}"
    done = subprocess.run(
        [BROWSER, *words, "--dump-dom", (tmp_path / "look.html").as_uri()],
        capture_output=True, text=True, timeout=200, check=True,
    )  # fmt: skip
    result = re.findall(r'<pre class="found">(\d+) (\w+) (.*?)</pre>', done.stdout, re.S)
    lines = {(width, what): text for width, what, text in result}
    for width in "400", "401", "1300", "1301":
        assert not lines[width, "wide"].strip() and not lines[width, "spilled"].strip(), width
    assert [text for width, what, text in result if (width, what) == ("401", "sorted")] == [
        *("9,10,1e2,–", "1e2,10,9,–")
    ]
    marks = html.unescape(lines["401", "marks"]).split("; ")
    assert len(marks) == 4 and lines["401", "left"] == "3"
    assert (
        "ours, 4 fs: error of U/N 0.0010 ± 0.0020 kcal/mol a molecule, 1 s of CPU time per ps"
        in marks
    )


def test_own_results_before_committed_ones_and_broken_ones_told(tmp_path, monkeypatch, capsys):
    """Locks out committed numbers in place of the user's own, and a crash where a file is cut short
    or is of no verb, which takes the other parts with it."""
    monkeypatch.setattr(report, "RESULTS", tmp_path / "committed")
    whole = (COMMITTED / "cost-start" / "summary.json").read_text()
    for name, text in {
        "committed/cost-start": "{}",
        "own/cost-start": whole.replace("AMD EPYC", "Abacus"),
        "own/cut": whole[:999],
        "own/odd": whole.replace("nosquish cost", "nosquish butter"),
    }.items():
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "summary.json").write_text(text)
    assert command.main(["report", "--results", str(tmp_path / "own")]) == 0
    page, printed = (tmp_path / "own" / "report.html").read_text(), capsys.readouterr().out
    assert page.count('<section id="') == 1 and "Abacus" in page and "No results of" in page
    assert "cut/summary.json: JSONDecodeError" in printed and "odd/summary.json: Module" in printed
