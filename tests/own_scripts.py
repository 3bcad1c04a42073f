"""What tests of user's scripts have in common: how they are taken, and how they are refused."""

from pathlib import Path

import pytest

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


def take(path, out, ranks=1, **ask):
    """What the harness makes of a script."""
    from validation.own import system  # an extra has what it needs

    asked = system.Ask(str(path), str(Path(path).parent), **ask)
    return system.take(asked, out, ranks, 300.0, tell=lambda line: None)


def refused(text, tmp_path, **ask):
    """The one message that ends the reading of a script with these commands."""
    path = tmp_path / "in.bad"
    path.write_text(text)
    with pytest.raises(SystemExit) as end:
        take(path, tmp_path / "out", **ask)
    message = str(end.value.code)
    assert "\n" not in message and message.startswith("in.bad: ")
    return message
