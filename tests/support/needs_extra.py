"""The extra `validation`: a module of tests that imports this is skipped where it is missing."""

import pytest

for needed in ("rich", "jinja2", "matplotlib", "mdtraj", "pandas", "physical_validation"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")
