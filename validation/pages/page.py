"""From plain data to self-contained HTML pages."""

import base64
from collections.abc import Sequence
from pathlib import Path

import jinja2

from .. import COMMAND
from ..running import machine
from ..statistics.check import bound, measured
from ..statistics.estimate import SURE, Estimate

TEMPLATES = Path(__file__).parent / "templates"


def page(template: str, path: Path, figures: Sequence[tuple[Path, str]], **values) -> None:
    """Write a self-contained HTML page.

    Args:
        template: its name in ``templates``; most fill the blocks of ``base.html``.
        path: of the page.
        figures: list of (PNG path, caption).
        values: what else the template uses.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {
        "command": COMMAND,
        "package": machine.package,
        "number": lambda *estimate, **named: Estimate(*estimate, **named).text(),
        "measured": measured,
        "bound": bound,
        "sure": SURE,
    }
    embedded = [
        (base64.b64encode(Path(png).read_bytes()).decode(), caption) for png, caption in figures
    ]
    Path(path).write_text(environment.get_template(template).render(figures=embedded, **values))
