"""Python scripts of inputs, which users start from any folder."""

import re

from support.running import ROOT


def test_modules_of_scripts():
    """Locks out the checkout's name of the harness, which is found in the root only."""
    scripts = {path: path.read_text() for path in (ROOT / "inputs").rglob("*.py")}
    assert any("fix_nosquish_validation" in text for text in scripts.values())
    root_only = re.compile(r"^\s*(from|import) validation\b", re.M)
    assert not [path for path, text in scripts.items() if root_only.search(text)]
