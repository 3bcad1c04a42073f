"""One cheap number of each verb is measured again: the committed ones are those of today's code.

``compare`` has its own such test, in compare/test_compare.py.
"""

import json
from pathlib import Path

import pytest

from validation import RESULTS
from validation.__main__ import main
from validation.statistics import measures
from validation.statistics.estimate import Estimate


def summary(folder: Path) -> dict:
    return json.loads((folder / "summary.json").read_text())


@pytest.mark.timeout(300)
def test_stress(tmp_path):
    """Locks out another order of respa's levels, or another accuracy far from the origin."""
    words = ["far-away", "respa-order", "--full", "--only", "nosquish", "rigid/nve"]
    main(["stress", *words, "--out", str(tmp_path)])

    def values(folder):
        cases = {case["name"]: case["rows"] for case in summary(folder)["cases"]}
        return {
            (name, row["integrator"]): row["value"]
            for name in ("far-away", "respa-order")
            for row in cases[name]
            if row["integrator"] in ("nosquish", "rigid/nve")
        }

    result = values(tmp_path)
    assert len(result) == 4
    known = values(RESULTS / "stress")
    assert result == pytest.approx({place: known[place] for place in result}, rel=0.05)


@pytest.mark.timeout(300)
def test_claims(tmp_path):
    """Locks out another map of a step than the one that the committed numbers are of."""

    def values(folder):
        return {
            (check["subject"], check["what"]): check["value"]
            for check in summary(folder)["checks"]
            if check["part"] == "symplectic" and check["value"] > 1e-8  # others are rounding
        }

    main(["claims", "theory/symplectic", "--full", "--out", str(tmp_path)])
    result = values(tmp_path / "theory")
    assert len(result) > 3
    assert result == pytest.approx(values(RESULTS / "theory"), rel=0.02)


@pytest.mark.timeout(300)
def test_cost(tmp_path):
    """Locks out a message more in a step, or larger ones."""

    def counts(folder):
        names = "messages", "bytes", "collectives", "collective_bytes"
        (result,) = (
            one
            for one in summary(folder)["counts"]
            if (one["decomposition"], one["integrator"], one["ranks"], one["bodies"])
            == ("brick", "nosquish", 2, 2000)
        )
        return {name: result[name] for name in names}

    main(["cost", "messages", "--ranks", "2", "--only", "nosquish", "--out", str(tmp_path)])
    assert counts(tmp_path) == pytest.approx(counts(RESULTS / "cost-messages"), rel=0.05)


@pytest.mark.timeout(300)
def test_sample(tmp_path):
    """Locks out another distribution than the one that was sampled. The squared torque is sharp: a
    thermostat or a moment that is 1 % off moves it by several errors."""
    words = ["--ps", "5", "--only", "langevin-20-equal-6", "--dt", "12", "--out", str(tmp_path)]
    assert main(["sample", "water", *words]) == 0

    def torque(folder):
        (row,) = (
            row
            for row in summary(folder)["rows"]
            if (row["scheme"], row["dt"]) == ("langevin-20-equal-6", 12)
        )
        return Estimate.of(row["means"]["torque"])

    off = measures.difference(torque(tmp_path), torque(RESULTS / "sample-water-steps"))
    assert abs(off.value) < 2.5 * off.margin and off.margin < 0.05 * torque(tmp_path).value
