"""The notebook of the documentation: its bodies are those of the atoms."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from support.running import ROOT

for needed in ("matplotlib", "pandas"):
    pytest.importorskip(needed)
CELLS = json.loads((ROOT / "docs" / "nitrogen.ipynb").read_text())["cells"]
SAVE = """
np.savez("results", t=t, c1=c1, c2=c2, omega2=omega2, first=first["x"], second=second["x"])
"""


def correlations(axes):
    """Orientational correlations of first and second rank, (lags,), of axes (times, bodies, 3)."""
    lags = range(len(axes))
    cosine = [np.einsum("tna,tna->tn", axes[: len(axes) - lag], axes[lag:]) for lag in lags]
    return [[p(c).mean() for c in cosine] for p in (lambda c: c, lambda c: 1.5 * c**2 - 0.5)]


@pytest.mark.usefixtures("lammps_from_python")
def test_notebook(tmp_path):
    """Locks out a notebook that does not run or has no output to read, axes that are not those of
    the atoms, a wrong unit of the angular velocity, and a restart that continues another run."""
    code = [cell for cell in CELLS if cell["cell_type"] == "code"]
    assert sum(bool(cell["outputs"]) for cell in code) == 5
    script = "\n".join("".join(cell["source"]) for cell in code)
    dump = "dump 1 all custom 8 atoms id xu yu zu\ndump_modify 1 sort id format float %.15g\n"
    script = script.replace("run 1600\n", f"{dump}run 1600\nundump 1\n") + SAVE
    environment = os.environ | {"MPLBACKEND": "agg"}
    command = [sys.executable, "-c", script]
    subprocess.run(command, cwd=tmp_path, env=environment, check=True, timeout=120)
    results = np.load(tmp_path / "results.npz")

    rows = [row.split() for row in (tmp_path / "atoms").read_text().splitlines()]
    places = np.array([row for row in rows if len(row) == 4 and row[0] != "ITEM:"], float)
    bonds = np.diff(places[:, 1:].reshape(-1, 216, 2, 3), axis=2)[:, :, 0]
    lengths = np.linalg.norm(bonds, axis=2, keepdims=True)
    np.testing.assert_allclose(lengths, 1.09, rtol=1e-9)
    expected = correlations(bonds / lengths)
    for name, values in zip(("c1", "c2"), expected):
        np.testing.assert_allclose(results[name], values[: len(results["t"])], atol=1e-9)

    # <omega^2> = 2 kT / I, with the temperature of 216 molecules at constant energy
    assert results["omega2"] == pytest.approx(2 * 0.83145 * 77 / (2 * 14.007 * 0.545**2), rel=0.15)
    np.testing.assert_allclose(results["first"], results["second"], atol=1e-9)
