"""How Sphinx builds these pages: sphinx-build -W --keep-going -n docs docs/_build/html"""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "_ext"))
sys.path.append(str(HERE.parent))  # after site-packages

from lammps_lexer import LammpsLexer  # noqa: E402

import fix_nosquish  # noqa: E402
from validation.report import report as all_results  # noqa: E402

project = author = "fix_nosquish"
copyright = "the authors of fix_nosquish"
release = version = fix_nosquish.__version__
html_title = f"fix_nosquish {release}"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "mathml",
]
# of the class from which integrators derive
napoleon_custom_sections = [(title, "params_style") for title in ("The step", "What it supports")]
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 120
exclude_patterns = ["_build", "_ext"]
html_theme = "furo"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["tables.css"]
nitpicky = True
nitpick_ignore_regex = [("py:class", r"[^.]*")]  # docstrings say types in words
autodoc_typehints = "none"  # the docstrings say the types
napoleon_attr_annotations = False
autodoc_member_order = "bysource"
copybutton_prompt_text = r"\$ "
copybutton_prompt_is_regexp = True


def report(app, failure):
    """Write the page of all results beside the pages that are built."""
    if failure is None and app.builder.format == "html":
        sections, problems = all_results.gather(Path(app.outdir) / "none")
        all_results.write(sections, problems, Path(app.outdir) / "report.html")


def setup(app):
    app.add_lexer("lammps", LammpsLexer)
    app.connect("build-finished", report)
