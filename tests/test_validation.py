"""The comparison's measures against exact answers, and one small comparison from end to end.

Statistical tests pass within five standard errors and use fixed random seeds.
"""

import contextlib
import csv
import io
import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import Silent
from scipy.signal import lfilter

ROOT = Path(__file__).resolve().parent.parent

for needed in ("rich", "jinja2", "matplotlib"):
    pytest.importorskip(needed, reason="the extra 'validation' is not installed")

from matplotlib.figure import Figure
from rich.console import Console

from validation import RESULTS
from validation.compare import figures, report
from validation.compare import measure as compare
from validation.pages import figures as page_figures
from validation.pages import report as skeleton
from validation.pages import tables
from validation.running import lammps_log, run
from validation.scenes import Scene
from validation.scenes.data_file import data_file
from validation.scenes.integrators import Integrator, rigid
from validation.scenes.units import UNITS
from validation.statistics import measures, motion
from validation.statistics.estimate import margin


def ar1(n, phi, seed):
    """Stationary noise with unit variance and autocorrelation phi^k."""
    noise = np.random.default_rng(seed).normal(size=n)
    x = np.empty(n)
    x[0] = noise[0]
    for i in range(1, n):
        x[i] = phi * x[i - 1] + np.sqrt(1 - phi**2) * noise[i]
    return x


@pytest.mark.parametrize("phi", [0.0, 0.8])
def test_drift_is_recovered(phi):
    """Locks out a slope per sample instead of per unit of time, and a wrong sign."""
    t = np.arange(4000) * 0.02
    slope, error, _ = measures.drift(t, 7.0 - 0.03 * t + ar1(len(t), phi, seed=1))
    assert abs(slope + 0.03) < 5 * error
    assert error < 0.03, "an error so large that the check above cannot fail"


def random_walk(n, seed):
    return np.cumsum(np.random.default_rng(seed).normal(size=n))


STEPS = (
    0.0,
    0.003,
    0.01,
    0.02,
    0.04,
    0.1,
    0.3,
    1.0,
    10.0,
    None,
)  # of a walk over a 64th of a series; a walk alone


def noise_of(rng, series, n, time, step):
    """White noise (time 0) or AR(1) with this correlation time in samples, with a walk: its
    variance in a 64th of the series over that of that part's mean without it, as far as that is
    white; None for a walk alone."""
    phi = np.exp(-1 / time) if time else 0.0
    white = rng.normal(size=(series, n))
    white[:, 0] /= np.sqrt(1 - phi**2)
    x = lfilter([np.sqrt(1 - phi**2)], [1, -phi], white)
    walk = np.cumsum(rng.normal(size=(series, n)), axis=1) * np.sqrt((1 + phi) / (1 - phi)) * 64 / n
    return walk if step is None else x + np.sqrt(step) * walk


@pytest.mark.parametrize(
    "n, time", [(100, 0), (100, 1 / 50), (119, 1 / 200), (640, 0), (640, 1 / 50)]
)
def test_drift_error_covers(n, time):
    """Locks out an error that covers too seldom or too often, whatever the noise: white or
    correlated, with a walk of any size.

    An error by the most likely walk covered 45 % of weak walks, and two errors 65 %; one that
    averages over all walks 98 % of white noise.
    """
    rng, t = np.random.default_rng(n), np.arange(n) * 0.1
    for step in STEPS:
        found = measures.drift(t, 0.3 * t - 7.0 + noise_of(rng, 6000, n, time * n, step))
        off = np.abs(found.value - 0.3)
        assert 0.64 < np.mean(off < found.error) < 0.72, step
        assert 0.93 < np.mean(off < 2 * found.error) < 0.96, step
        assert 0.94 < np.mean(off < found.margin) < 0.97, step
        if step is None and not time:
            least = (
                64 / n / (0.1 * np.sqrt(n))
            )  # no slope of a walk scatters less than that of its ends
            assert np.std(found.value) < 1.4 * least, (
                "an error so large that the checks above cannot fail"
            )


@pytest.mark.parametrize("n, time", [(120, 0), (640, 0), (640, 1 / 50)])
def test_the_drift_of_one_line_covers_and_is_surer(n, time):
    """Locks out a margin that covers too seldom, whatever walks, as one by the most likely walk
    does (76 % of a weak walk), and one that is no smaller than by stretches in noise that does
    not wander."""
    rng, t = np.random.default_rng(n), np.arange(n) * 0.1
    for step in (0.0, 0.03, 0.3, 10.0, None):
        series = 0.3 * t - 7.0 + noise_of(rng, 250, n, time * n, step)
        found = [measures.line_drift(t, row) for row in series]
        margins = [one.margin for one in found]
        hits = np.abs([one.value - 0.3 for one in found]) < margins
        assert np.mean(hits) > 0.93, step
        stretches = np.median(measures.drift(t, series).margin)
        assert np.median(margins) < (0.7 if step == 0.0 else 1.2) * stretches, step
    assert measures.line_drift(t[:7], t[:7]).error == np.inf


def test_deviation_about_the_line():
    """Locks out a drift that passes for scatter: about the line the deviation is the noise's, with
    and without a drift."""
    t, x = np.arange(4000) * 0.1, ar1(4000, 0.5, seed=8)
    assert measures.standard_deviation(x + 0.1 * t).value > 10
    assert measures.about_line(t, x + 0.1 * t) == pytest.approx(measures.about_line(t, x))
    assert measures.about_line(t, x).value == pytest.approx(1.0, rel=0.05)


@pytest.mark.parametrize("slope, said", [(0.02, ""), (-0.05, ", drifts")])
def test_a_deviation_that_is_a_drift_says_so(slope, said):
    """Locks out a standard deviation that hides that the energy drifts."""
    summary = {"settings": {"reference": "rigid/nve"}}
    column = next(one for one in report.columns(summary) if one.key == "energy_sd")
    row = {
        "energy_sd": {"value": 2.0, "error": 0.1},
        "drift": {"value": slope, "error": 0.02, "freedom": 12.0},
    }
    assert tables.cell(row, column) == f"2.00 ± 0.20{said}"


def test_a_ratio_of_a_busy_machine_shows_its_range():
    """Locks out two identical integrators that differ threefold in the terminal, with the word that
    such ratios compare like with like: one had a core for each rank, the other had not."""
    spread = {"median": 0.32, "min": 0.3, "max": 1.0}
    row = {"name": "yours", "label": "yours", "modify_ratio": spread, "modify": spread, "cpu": 31.0}
    ratio, time = (tables.Column(name, "", "") for name in ("modify_ratio", "modify"))
    assert tables.cell(row, ratio, short=True) == "0.32 [0.30–1.00]"
    assert tables.cell(row, time, short=True) == "0.32"
    told = tables.busy({"integrators": [row]})
    assert "31 % of a core" in told and "ratio is wrong" in told and "like with like" not in told


def test_figure_and_table_have_the_same_margins():
    """Locks out standard errors in the figure where the table has 95 % margins, both behind ±."""
    estimate = {"value": 0.02, "error": 0.01, "freedom": 6.0}
    row = {"name": "rigid", "label": "rigid", "error": None, "energy_sd": estimate}
    row |= {"drift": estimate}
    axis, summary = Figure().add_subplot(), {"settings": {"reference": "rigid/nve"}}
    figures._panel(axis, row, (np.zeros(1), np.zeros(1), np.ones(1, bool)), 1.0, UNITS["real"])
    column = next(one for one in report.columns(summary) if one.key == "drift")
    assert f"drift {tables.cell(row, column)} per ps" in axis.get_title("right")


def test_files_and_words_of_a_report(tmp_path):
    """Locks out whole numbers that an empty cell beside them makes broken ones, an empty table that
    is printed, and a failure or a Ctrl-C that nothing is said of."""
    rows = [{"ranks": 1000, "time": 0.1 + 0.2}, {"ranks": None, "time": None}]
    tables = {"table": skeleton.frame(rows, ["time", "ranks"])}
    skeleton.write({"interrupted": True}, tmp_path, tables)
    text = (tmp_path / "table.csv").read_text()
    assert text == "time,ranks\n0.30000000000000004,1000\n,\n"
    screen = Console(record=True, width=80, file=io.StringIO())
    skeleton.table(screen, "nothing", ["a"], [])
    skeleton.table(screen, "something", ["name", "number"], [["[b]", "7"]], left=[])
    skeleton.end(screen, {"interrupted": True}, tmp_path, ["rigid: lost [atoms]"])
    said = screen.export_text()
    assert "nothing" not in said and "something" in said and "[b]" in said
    assert "✗ rigid: lost [atoms]" in said and "Interrupted" in said and str(tmp_path) in said


def test_figures_of_an_earlier_command(tmp_path):
    """Locks out a figure of other numbers beside those of now."""

    def cost(number):
        return (Figure(), "caption") if number else None

    path = tmp_path / "cost.png"
    assert page_figures.draw_each([cost], tmp_path, 1) == [(path, "caption")] and path.exists()
    assert page_figures.draw_each([cost], tmp_path, 0) == [] and not path.exists()


@pytest.mark.parametrize(
    "verb, write",
    [
        ("compare-water", lambda summary, out: report.write(summary, {}, out)),
    ],
)
def test_tables_of_committed_summaries(verb, write, tmp_path):
    """Locks out a column or a number of a table that is lost, renamed or rounded: documents read
    the committed tables, and the same code has to make them of the committed summaries."""
    write(json.loads((RESULTS / verb / "summary.json").read_text()), tmp_path)
    tables = sorted(path.name for path in (RESULTS / verb).glob("*.csv"))
    assert tables
    for name in tables:
        made, known = (
            list(csv.DictReader((folder / name).open())) for folder in (tmp_path, RESULTS / verb)
        )
        assert made == known, name


def test_drift_of_several_series_and_of_none():
    """Locks out series that are mixed up, and a series without noise that has some or ends in a
    division by zero."""
    t = np.arange(500) * 0.1
    x = np.cumsum(np.random.default_rng(2).normal(size=(3, 500)), axis=1)
    both = measures.drift(t, x)
    for row, value, error in zip(x, both.value, both.error):
        assert measures.drift(t, row)[:2] == pytest.approx((value, error))
    assert measures.drift(t, np.full(500, 7.0))[:2] == pytest.approx((0.0, 0.0), abs=1e-14)
    assert measures.drift(t, 3 * t)[:2] == pytest.approx((3.0, 0.0), abs=1e-12)
    assert all(
        np.isfinite(measures.drift(t[:n], x[0, :n])).all() for n in (4, 5, 8, 13, 23, 24, 47)
    )
    assert measures.drift(t[:3], x[0, :3]).error == np.inf, "three values tell no error"
    assert measures.drift(t[:1], x[:, :1]).error == np.inf


def test_of_one_or_two_values_no_error_is_known():
    """Locks out a number for sure, of a single start or of two samples."""
    assert measures.of_few([2.0]) == (2.0, np.inf, None)
    assert measures.ratio([1.0], [2.0]).margin == np.inf
    assert measures.mean([3.0]).margin == np.inf
    for x in [1.0], [1.0, 2.0]:
        assert measures.standard_deviation(np.array(x)).error == np.inf


def test_ratio_of_pairs():
    """Locks out the ratio turned round, and the scatter of the single ratios given as the error of
    their mean."""
    rng = np.random.default_rng(6)
    found = np.array(
        [
            measures.ratio(*np.exp(rng.normal(size=(2, 50)) * 0.1 + [[0.0], [0.3]]))
            for _ in range(200)
        ]
    )
    assert found[:, 0].mean() == pytest.approx(np.exp(0.3), rel=0.01)
    assert found[:, 1].mean() == pytest.approx(found[:, 0].std(), rel=0.2)


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_error_of_mean_with_correlation(phi):
    """Locks out sd/sqrt(n): for AR(1) noise the error is sqrt((1+phi)/(1-phi)/n)."""
    n = 20000
    errors = [measures.mean(ar1(n, phi, seed))[1] for seed in range(10)]
    assert np.mean(errors) == pytest.approx(
        np.sqrt((1 + phi) / (1 - phi) / n), rel=0.2
    )  # the larger of two is 8 % too large


SLOW = 500  # samples of correlation time


def two_times(n, seed):
    """White noise with unit variance, of which 6 % is slow."""
    return np.sqrt(0.94) * ar1(n, 0.0, seed) + np.sqrt(0.06) * ar1(
        n, np.exp(-1 / SLOW), 1000 + seed
    )


def test_errors_with_two_times():
    """Locks out a slow part of the noise that is lost behind a fast one, in the error of a mean and
    in that of a standard deviation.

    The variance of the mean is that of both parts by themselves, (0.94 + 0.06 * 2 * 500) / n.
    """
    n, rng = 60000, np.random.default_rng(7)
    noise = [two_times(n, seed) for seed in range(10)]
    expected = np.sqrt((0.94 + 0.06 * 2 * SLOW) / n)
    assert np.mean([measures.mean(x)[1] for x in noise]) == pytest.approx(expected, rel=0.25)
    turned = [
        np.sqrt(1 + 0.1 * x) * rng.choice([-1, 1], n) for x in noise
    ]  # (turned - 0)^2 is 1 + 0.1 x
    assert np.mean([measures.standard_deviation(x)[1] for x in turned]) == pytest.approx(
        0.1 * expected / 2, rel=0.25
    )


@pytest.mark.parametrize("n", [4, 13, 23])
def test_error_of_the_mean_of_few(n):
    """Locks out blocks of a short series that leave samples out, or are none: of independent ones
    the error is 1 / sqrt(n)."""
    errors = [measures.mean(ar1(n, 0.0, seed))[1] for seed in range(400)]
    assert np.mean(errors) == pytest.approx(1 / np.sqrt(n), rel=0.25)


@pytest.mark.parametrize("time", [0.0, 0.01, 0.03, 0.1, 0.3])
def test_the_mean_of_a_short_series_covers(time):
    """Locks out a margin that takes g's value for sure: where the correlation time was a tenth of
    the series it covered in 80 % of cases, at 0.3 in 62 %; a variance that is too small by what the
    mean's error takes off it; and a margin so wide that it covers always."""
    rng, n = np.random.default_rng(8), 300
    found = [
        (measures.mean(x), measures.squares(x).mean()) for x in noise_of(rng, 600, n, time * n, 0)
    ]
    hits = np.mean([abs(one.value) < one.margin for one, _ in found])
    assert (0.93 if time < 0.3 else 0.86) < hits < 0.985
    scatter = margin(np.std([one.value for one, _ in found]))
    assert np.median([one.margin for one, _ in found]) < (1.3 if time < 0.03 else 2.0) * scatter
    if time < 0.3:
        assert np.mean([square for _, square in found]) == pytest.approx(1.0, abs=0.06)


def test_error_of_standard_deviation():
    """Locks out an error of the variance given as that of its root: sd / sqrt(2n)."""
    sd, error, _ = measures.standard_deviation(3.0 * ar1(20000, 0.0, seed=4))
    assert error == pytest.approx(3.0 / np.sqrt(2 * 20000), rel=0.1)
    assert abs(sd - 3.0) < 5 * error


@pytest.mark.parametrize("number, table", [(2, 12.706), (4, 3.182), (32, 2.040)])
def test_margin_of_few_is_students(number, table):
    """Locks out two standard errors of few values that are called 95 %, where they cover 83 % (two)
    or 90 % (four); a table of Student's t beside it."""
    rows = np.random.default_rng(number).normal(size=(4000, number))
    found = [measures.of_few(row) for row in rows]
    assert found[0].margin / found[0].error == pytest.approx(table, rel=1e-3)
    assert np.mean([abs(one.value) < one.margin for one in found]) == pytest.approx(0.95, abs=0.012)
    assert measures.margin(1.0) == pytest.approx(1.960, abs=1e-3)


@pytest.mark.parametrize(
    "sizes, second", [((4, 4), 1.0), ((2, 32), 0.2), ((3, 5), 3.0), ((4, 200), 3.0)]
)
def test_sum_of_numbers_with_few_values_each(sizes, second):
    """Locks out the larger number of degrees of freedom, or Welch's where a part has one: the
    interval of a sum of two means then covers too seldom."""
    rng, covered = np.random.default_rng(5), []
    for _ in range(3000):
        one, other = (
            measures.of_few(size * rng.normal(size=number))
            for number, size in zip(sizes, (1.0, second))
        )
        error, freedom = measures.combined(one[1:], other[1:])
        covered.append(abs(one.value + other.value) < measures.margin(error, freedom))
    assert 0.94 < np.mean(covered) < 0.99
    assert measures.combined((3.0, None), (4.0, None)) == (5.0, None) and measures.combined(
        (0.0, 3), (0.0, None)
    ) == (0.0, None)


def test_quotient_and_power_have_the_freedom_of_their_parts():
    """Locks out a quotient whose error counts as sure, and a law through points that few values
    tell."""
    few, many = measures.Estimate(2.0, 0.2, 3), measures.Estimate(-4.0, 0.4)
    assert measures.quotient(few, many)[:2] == pytest.approx((-0.5, 0.05 * np.sqrt(2)), rel=1e-9)
    assert measures.quotient(few, many).margin == pytest.approx(
        np.hypot(0.05 * 3.182, 0.05 * 1.960), rel=1e-3
    )
    assert measures.quotient(many, many).freedom is None
    x = np.array([1.0, 2.0, 4.0])
    law = measures.power(x, [measures.Estimate(3 * one**2, 0.3 * one**2, 5) for one in x])
    assert law[:2] == pytest.approx(
        (2.0, 0.1 / (np.sqrt(2) * np.log(2)))
    ) and law.freedom == pytest.approx(5.0)


CUBE = np.diag([10.0, 10.0, 10.0])
SKEWED = np.array([[10.0, 0, 0], [4.0, 9.0, 0], [-3.0, 2.0, 8.0]])
ALL = (True, True, True)


@pytest.mark.parametrize("cell", [CUBE, SKEWED], ids=["cube", "triclinic"])
def test_distance_ignores_periodic_images(cell):
    """Locks out distances of a box length between images of one atom."""
    x = np.random.default_rng(2).uniform(0, 8, size=(20, 3))
    y = x + np.random.default_rng(3).integers(-2, 3, size=(20, 3)) @ cell
    y[7] += [0.03, 0.0, -0.04]
    assert measures.largest_distance(x, y, cell, ALL) == pytest.approx(0.05, abs=1e-12)


def test_distance_counts_in_a_direction_that_is_not_periodic():
    """Locks out folding across a wall."""
    x, y = np.zeros((1, 3)), np.array([[0.0, 0.0, 9.0]])
    assert measures.largest_distance(x, y, CUBE, (True, True, False)) == pytest.approx(9.0)


def test_rigidity_error_of_a_displaced_atom():
    """Locks out missed pairs, pairs across bodies, and a body that merely crossed a face, also one
    of a box that has another size at the end."""
    bodies = np.array([5, 2, 5, 2, 5, 0, 0])  # two bodies, two atoms in none
    start = np.random.default_rng(5).uniform(4, 6, size=(7, 3))
    pairs = measures.body_pairs(bodies)
    assert {tuple(sorted(pair)) for pair in pairs.tolist()} == {(0, 2), (0, 4), (2, 4), (1, 3)}
    end = start.copy()
    end[bodies == 5] += [7.0, 0.0, 0.0]  # the body moved; one of its atoms was wrapped
    end[2] -= [10.0, 0.0, 0.0]
    end[5:] += 1.0  # atoms in no body may move
    assert measures.rigidity_error(start, end, pairs, CUBE, ALL) < 1e-12
    wider = end.copy()
    wider[2] -= [1.0, 0.0, 0.0]
    assert measures.rigidity_error(start, wider, pairs, CUBE, ALL, 1.1 * CUBE) < 1e-12
    assert measures.rigidity_error(start, wider, pairs, CUBE, ALL) > 0.1
    along = (start[3] - start[1]) / np.linalg.norm(start[3] - start[1])
    end[3] += 2e-6 * along
    error = measures.rigidity_error(start, end, pairs, CUBE, ALL)
    assert error == pytest.approx(2e-6, abs=1e-12)


LOG = """\
run 20
   Step          Time          TotEng
         0              0  -8049.5
        10             20  -8049.25
WARNING: something happened (src/x.cpp:1)
        20             40  -8049.75
Loop time of 0.5 on 2 procs for 20 steps with 3000 atoms

46.4% CPU use with 2 MPI tasks x 1 OpenMP threads

MPI task timing breakdown:
Section |  min time  |  avg time  |  max time  |%varavg| %total
---------------------------------------------------------------
Pair    | 0.3        | 0.31       | 0.32       |   2.0 | 63.75
Modify  | 0.045      | 0.046      | 0.047      |   0.1 |  2.19
Other   |            | 0.02792    |            |       |  1.33

Nlocal:           1500 ave        1502 max        1498 min
run 200 pre no
   Step          Time          TotEng
        20             40  -8049.75
        30             60  -8050
Loop time of 4 on 2 procs for 200 steps with 3000 atoms

99.4% CPU use with 2 MPI tasks x 1 OpenMP threads

Section |  min time  |  avg time  |  max time  |%varavg| %total
Modify  | 1e-3       | 2e-3       | 3e-3       |   0.1 |  2.19
ERROR: Lost atoms: original 3000 current 2997 (src/thermo.cpp:526)
"""


def test_timing_table():
    """Locks out minimum or maximum for average, and sections of one run given to another."""
    first, second = lammps_log.timings(LOG)
    assert first.sections == {"Pair": 0.31, "Modify": 0.046, "Other": 0.02792}
    assert second.sections == {"Modify": 2e-3}
    assert (first.seconds, first.steps, first.cpu) == (0.5, 20, 46.4)
    assert (second.seconds, second.steps, second.cpu) == (4.0, 200, 99.4)


def test_results_of_a_run_that_was_ended_as_it_wrote(tmp_path):
    """Locks out a verb that fails where Ctrl-C cut a log or a dump, and half a number read as a
    whole one."""
    whole = lammps_log.timings(LOG)[-1]
    rows = "Section |  min time  |  avg time\nPair    | 1.5        | 2.25\n"
    for end in range(len(rows) + 1):
        (*_, last) = lammps_log.timings(f"{LOG}\n{rows[:end]}")
        more = {"Pair": 2.25} if end == len(rows) else {}
        assert last.sections == whole.sections | more

    frame = "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n2\n" + "\n" * 5 + "1 2.5\n2 -12.25\n"
    first, second = frame.format(0), frame.format(20)
    dump = tmp_path / "atoms.dump"
    for end in range(len(first + second) + 1):
        dump.write_text((first + second)[:end])
        steps, values = motion.read(dump)
        count = (end >= len(first)) + (end == len(first + second))
        assert steps.tolist() == [0, 20][:count] and motion.has_frames(tmp_path) == bool(count)
        assert values.tolist() == [[[1, 2.5], [2, -12.25]]] * count


def test_thermo_table():
    """Locks out the step printed by both of two runs counted twice, and warnings read as rows."""
    table = lammps_log.thermo(LOG)
    assert table["Step"].tolist() == [0, 10, 20, 30]
    assert table["TotEng"].tolist() == [-8049.5, -8049.25, -8049.75, -8050.0]


def test_thermo_of_runs_that_print_different_columns():
    """Locks out a traceback where the second run prints more columns than the first, or others."""
    more = LOG.replace("Time          TotEng\n        20             40  -8049.75", "Time          "
                       "TotEng     Press\n        20             40  -8049.75  7")  # fmt: skip
    more = more.replace("60  -8050", "60  -8050   8")
    table = lammps_log.thermo(more)
    assert table["TotEng"].tolist() == [-8049.5, -8049.25, -8049.75, -8050.0]
    np.testing.assert_array_equal(table["Press"], [np.nan, np.nan, 7, 8])
    assert lammps_log.thermo("Step Temp\n")["Temp"].tolist() == []


def test_thermo_of_a_log_cut_in_a_number():
    """Locks out '-80' read from a log that ends in the middle of '-8049.75'."""
    cut = LOG[: LOG.index("-8049.75") + 3]
    assert lammps_log.thermo(cut)["TotEng"].tolist() == [-8049.5, -8049.25]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """27 rigid bent triatomic molecules of Lennard-Jones atoms."""
    folder = tmp_path_factory.mktemp("scene")
    body = np.repeat(np.arange(27), 3)
    corner = 5.0 * np.stack([body % 3, body // 3 % 3, body // 9], axis=1)
    place = corner + np.tile([(0, 0, 0), (1.0, 0, 0), (0, 1.2, 0)], (27, 1))
    kind = np.ones(81, int)
    (folder / "data.tiny").write_text(
        data_file("molecular", [body + 1, kind, place], (0, 15), mass=[12])
    )
    setup = (
        "units real",
        "atom_style molecular",
        "read_data data.tiny",
        "pair_style lj/cut 6.0",
        "pair_coeff 1 1 0.1 3.2",
        "neigh_modify exclude molecule/intra all",
        "velocity all create 100 1",
        "group water type 1",
    )
    return Scene("tiny", "27 triatomics", folder, setup, "water", "molecule", "b 1 a 1")


BROKEN = Integrator("broken", "broken", ("fix 1 {group} no/such/fix",))
SETTINGS = compare.Settings(1, 200, 1.0, timing_rounds=1, timing_steps=20, silence=60.0)


@pytest.mark.timeout(120)
def test_comparison_from_end_to_end(scene, tmp_path):
    """Locks out a failed integrator that ends the run, hides its cause, or lacks its row."""
    integrators = [BROKEN, rigid("rigid/nve"), rigid("rigid/nve/small")]
    summary, series = compare.compare(scene, integrators, tmp_path, SETTINGS, Silent())
    report.write(summary, series, tmp_path)

    broken, reference, small = json.loads((tmp_path / "summary.json").read_text())["integrators"]
    assert "no/such/fix" in broken["error"]
    assert broken.get("energy_sd") is None and broken.get("modify") is None
    assert reference["error"] is None and small["error"] is None
    assert reference["steps"] == small["steps"] == 200
    assert reference["distance"] == 0.0
    assert small["distance"] < 1e-6, "rigid/nve/small is the same method as rigid/nve"
    assert small["rigidity"] < 1e-10
    assert small["modify"]["median"] > 0 and small["modify_ratio"]["median"] > 0

    rows = list(csv.DictReader((tmp_path / "table.csv").open()))
    assert [row["integrator"] for row in rows] == ["broken", "rigid/nve", "rigid/nve/small"]
    assert "no/such/fix" in rows[0]["status"] and rows[1]["status"] == "ok"
    assert float(rows[1]["temperature (K)"]) == reference["temperature"]["value"]

    page = (tmp_path / "report.html").read_text()
    assert "no/such/fix" in page
    assert page.count("data:image/png;base64,") == 2
    assert 'src="http' not in page and "href=" not in page, "the report is one file"


def running(word):
    """IDs of the processes whose command has a word."""
    found = []
    for one in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            if word.encode() in one.read_bytes() and int(one.parent.name) != os.getpid():
                found.append(int(one.parent.name))
    return found


@pytest.fixture
def unfinished(tmp_path, monkeypatch):
    """A job whose ranks sleep, and what ends its processes in the end; SIGTERM is a Ctrl-C."""
    worker = tmp_path / "worker.py"
    worker.write_text("import time\ntime.sleep(100)\n")
    monkeypatch.setattr(run, "WORKER", worker)
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    yield run.Job(str(tmp_path / "run"), ".", [], [], None, ranks=2)
    signal.signal(signal.SIGTERM, before)
    for one in running(str(worker)):
        os.kill(one, signal.SIGKILL)


@pytest.mark.timeout(60)
def test_ranks_end_with_a_harness_that_is_killed():
    """Locks out ranks that go on when the harness was killed: another process that shares its runs
    does the same run again, in the same folder."""
    code = (
        "import subprocess, sys, time; from validation.running import run\n"
        "with run.started([sys.executable, '-c', 'import time; time.sleep(50)']) as process:\n"
        "    print(process.pid, flush=True); time.sleep(50)"
    )
    how: dict = {"stdout": subprocess.PIPE, "text": True, "cwd": ROOT}
    with subprocess.Popen([sys.executable, "-c", code], **how) as harness:
        assert harness.stdout
        begun = int(harness.stdout.readline())
        harness.kill()
    until = time.monotonic() + 10
    while running("time.sleep(50)"):
        assert time.monotonic() < until, f"process {begun} is left"
        time.sleep(0.1)


@pytest.mark.timeout(60)
@pytest.mark.parametrize("moment", ["begin", "end", "behind", "again"])
def test_a_signal_at_a_bad_moment_leaves_no_process(unfinished, monkeypatch, moment):
    """Locks out ranks that go on for ever: a signal came while their mpirun was being started, or
    a second one while they were being ended. And one that is lost, as it came when a run's
    processes had just ended: the verb would go on with the next run. And one that comes again soon
    after, which ends the verb as it writes what it has."""
    popen, kill = subprocess.Popen, os.killpg

    def stop():
        os.kill(os.getpid(), signal.SIGTERM)

    def begins(*words, **more):
        process = popen(*words, **more)
        if moment == "begin":
            stop()
        return process

    def ends(*one):
        stop()
        kill(*one)
        if moment == "again":
            threading.Timer(0.3, stop).start()

    def watch(*_):
        time.sleep(1)  # until there are ranks
        if moment == "end":
            stop()
        return False

    monkeypatch.setattr(subprocess, "Popen", begins)
    monkeypatch.setattr(os, "killpg", ends)
    monkeypatch.setattr(run, "watch", watch)
    try:
        result = run.run(unfinished)
        time.sleep(0.5 * (moment == "again"))  # at its report
    except KeyboardInterrupt:  # it would end pytest
        pytest.fail("the signal has passed through")
    assert result.interrupted and result.error == run.INTERRUPTED
    until = time.monotonic() + 10
    while running(str(run.WORKER)):
        assert time.monotonic() < until, "processes are left"
        time.sleep(0.1)
    assert signal.getsignal(signal.SIGTERM) is signal.default_int_handler


@pytest.mark.timeout(120)
@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGHUP])
def test_a_verb_in_the_background_ends_all_by_a_signal(tmp_path, sign):
    """Locks out a worker that goes on when the verb was ended: it runs in the background of a shell
    script, so Ctrl-C is ignored, and the signal comes three times."""

    def in_background():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(sign, signal.SIG_DFL)  # these tests may run behind nohup

    words = ["claims", "--full", "long-run/nosquish", "--out", str(tmp_path)]
    command = [sys.executable, "-m", "validation", *words]
    said = tmp_path / "said.txt"
    with open(said, "w") as output:
        verb = subprocess.Popen(
            command,
            cwd=ROOT,
            start_new_session=True,
            preexec_fn=in_background,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
        )
    try:
        until = time.monotonic() + 60
        while not any(tmp_path.rglob("log.lammps")):
            assert time.monotonic() < until and verb.poll() is None
            time.sleep(0.1)
        for _ in range(3):
            verb.send_signal(sign)
            time.sleep(0.02)
        assert verb.wait(40) == 130, said.read_text()
        assert not running(str(tmp_path))
    finally:
        for one in {verb.pid, *running(str(tmp_path))}:
            with contextlib.suppress(ProcessLookupError):
                os.kill(one, signal.SIGKILL)
        verb.wait()


@pytest.mark.timeout(60)
def test_a_hung_run_is_given_up_with_all_its_ranks(scene, tmp_path):
    """Locks out a comparison that waits for ever, and ranks that live on."""
    marker = str(tmp_path)
    hang = Integrator("hang", "hang", ("shell sleep 47",))
    job = run.job(scene, hang, tmp_path / "hang", [10], dt=1.0, every=10, ranks=2, silence=4.0)
    begin = time.monotonic()
    result = run.run(job)
    assert "no sign of life" in result.error
    assert time.monotonic() - begin < 40
    time.sleep(1.0)
    left = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True).stdout
    assert marker not in left, "a rank outlived its run"


def test_a_run_that_was_stopped_is_not_hung(tmp_path, monkeypatch):
    """Locks out a run given up because it and the harness were stopped for longer than a hung run
    may be silent."""
    process = subprocess.Popen(["sleep", "1.5"])
    sleep = time.sleep
    monkeypatch.setattr(
        run.time, "sleep", lambda seconds: sleep(seconds + 0.5)
    )  # as if stopped between two looks
    assert not run.watch(process, tmp_path / "log", 1.0, print)


@pytest.mark.timeout(60)
def test_a_crash_is_a_result(scene, tmp_path, monkeypatch):
    """Locks out a rank killed by the system that takes the comparison with it."""
    killed = tmp_path / "killed.py"
    killed.write_text("import os\nos.kill(os.getpid(), 9)\n")
    monkeypatch.setattr(run, "WORKER", killed)
    job = run.job(scene, rigid("rigid"), tmp_path / "crash", [10], dt=1.0, every=10)
    result = run.run(job)
    assert "signal 9" in result.error or "exit code 9" in result.error


def test_positions_that_0_1_0_has_left(tmp_path):
    """Locks out a results folder that cannot be gone on with: its runs have the box of their end,
    and not that of each frame."""
    x, cell = np.zeros((3, 4, 3)), np.diag([5.0, 6.0, 7.0])
    plain = {"bodies": np.ones(4, int), "periodic": np.ones(3, bool)}
    np.savez(tmp_path / "positions.npz", x=x, cell=cell, **plain)
    found = run.collect(tmp_path).positions
    assert found.cells.shape == (3, 3, 3) and (found.cells == cell).all()
    cells = np.array([cell, 1.1 * cell, 1.2 * cell])
    np.savez(tmp_path / "positions.npz", x=x, cells=cells, **plain)
    assert (run.collect(tmp_path).positions.cell == cells[-1]).all()


def test_help_is_instant():
    """Locks out heavy imports before the command line is read."""
    code = (
        "import sys; sys.argv[1:] = ['compare', '--help']\n"
        "from validation.__main__ import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'matplotlib', 'rich', 'lammps', 'mpi4py'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "--ranks" in done.stdout
