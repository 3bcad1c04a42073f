"""What thermostats with long steps sample: its plan, its arithmetic, its verdicts, its runs."""

import json
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from conftest import BIN, Silent, read_thermo
from scipy import signal

from validation import __main__
from validation.ensembles import criteria, lengths, measure, plan, runs, schemes
from validation.ensembles.lengths import Lengths, Point
from validation.ensembles.plan import REFERENCES, SCHEMES
from validation.running import run
from validation.running.lammps_log import Loop
from validation.statistics import measures, structure
from validation.statistics.estimate import Estimate

NAMES = "potential", "temperature", "translation", "rotation", "apart", "pressure", "drift"
REFERENCE, AT_PRESSURE = REFERENCES
VOLUME = 15318.0  # of 512 waters, Angstrom^3
TINY = ["ensembles", "--ps", "0.05", "--dt", "4", "--only"]


def numbers(**known):
    """Numbers of a run: those that are named, and others."""
    rest = dict.fromkeys(NAMES, Estimate(1.0, 0.1, 20.0))
    return rest | {"cost": Estimate(2.0), "distribution": Estimate(0.5)} | known


def table(rng, molecules, samples, temperature=298.0, held=0):
    """Output of a canonical sample: kinetic energies of as many normal numbers as there are degrees
    of freedom, in both ways of printing them."""
    unit = measure.BOLTZMANN * temperature / 2
    moves, turns = (unit * rng.chisquare(3 * molecules - off, samples) for off in (held, 0))
    half = 3 * molecules * measure.BOLTZMANN / 2
    common = {
        "PotEng": -9.5 * molecules + rng.normal(size=samples),
        "Temp": (moves + turns) / (2 * half),
        "KinEng": moves + turns,
        "Press": 1.0 + rng.normal(size=samples) - measure.of_momentum(held, temperature, VOLUME),
        "Volume": np.full(samples, VOLUME),
        "Time": 24.0 * np.arange(samples),
        "Econserve": 0.05 * np.arange(samples) * 0.024 + 1e-9 * rng.normal(size=samples),
    }
    return common | {"f_1[3]": moves / half, "f_1[4]": turns / half}, common | {"v_moves": moves}


def test_what_runs():
    """Locks out a reference that is left out or runs twice, a settled part that is sampled, and
    samples at other times with other steps."""
    every = plan.points()
    number = 2 + sum(len(scheme.steps) for scheme in SCHEMES.values())
    assert every[0] == REFERENCE and len(set(every)) == len(every) == number
    assert all(every.index(plan.beside_which(one)) <= every.index(one) for one in every)
    assert plan.points(["csvr"], [6.0]) == [REFERENCE, Point("csvr", 6.0)]
    assert plan.points(["npt-csvr"], [6.0]) == [AT_PRESSURE, Point("npt-csvr", 6.0)]
    pressed, first = Point("npt-csvr-400atm", 6.0), Point("npt-csvr", 6.0)
    assert plan.points(["npt-csvr-400atm"], [6.0]) == [first, pressed]
    assert [dt for _, dt in plan.points(["shake+npt"])] == [1.0, *plan.LIMIT_STEPS]
    assert plan.points(["langevin-5"], [1.0, 4.0]) == [REFERENCE, Point("langevin-5", 4.0)]
    full = Lengths(300.0)
    assert full.runs(6.0) == [1667, 50000] and Lengths(2.0).runs(4.0) == [50, 500]
    for dt in plan.KNOWN_STEPS:
        assert full.every(dt) * dt == lengths.SAMPLED
    assert Lengths(0.05).every(8.0) == 1
    assert plan.total([Point("csvr", 4.0)], Lengths(20.0, 2)) == 2 * (10000 + 500 + 5000)
    names = [one.name for _, one in plan.names(every, Lengths(1.0, 2))]
    assert len(set(names)) == 2 * len(every)


def test_each_start_has_its_own_random_numbers():
    """Locks out starts that repeat each other."""
    certain = "nh", "npt-mtk", "rigid/nvt/small", "rigid/npt/small", "shake+npt"
    scene = plan.scene()
    for scheme in SCHEMES.values():
        first, second = (scheme.seeded(start).commands(scene) for start in (1, 2))
        assert (first == second) == ((scheme.first or scheme.name) in certain)
        assert schemes.SEED not in " ".join(first)
        assert scheme.ours == scheme.label.startswith(("NVT ", "NPT "))
    assert "langevin 298 298 50 " not in " ".join(SCHEMES["langevin-5"].integrator.lines)
    assert " 298 298 50 " in " ".join(SCHEMES["langevin-20"].integrator.lines)


def test_states():
    """Locks out a scheme that runs at another state than the one that its numbers count on."""
    for scheme in SCHEMES.values():
        words = " ".join(scheme.integrator.lines)
        at = f"{scheme.temperature:g} {scheme.temperature:g} "
        assert f"temp {at}" in words or f"langevin {at}" in words
        if scheme.pressure is None:
            assert " iso " not in words and plan.reference(scheme) == REFERENCE
        else:
            pressure = f"{scheme.pressure:g} {scheme.pressure:g} {plan.PRESSURE_DAMPING:g}"
            assert f" iso {pressure}" in words
            assert plan.reference(scheme) == AT_PRESSURE
        if scheme.first:
            first = SCHEMES[scheme.first]
            assert (first.temperature, first.pressure) == (298.0, 1.0) and not first.first
            state = scheme.temperature, scheme.pressure
            assert state in {(308.0, 1.0), (298.0, 400.0)} and scheme.held == first.held


def of_scheme(held):
    return replace(SCHEMES["nh"], held=held)


@pytest.mark.parametrize("held", [0, 3])
def test_numbers_of_a_canonical_sample(held):
    """Locks out energies of the whole box for those of a molecule, temperatures that count other
    degrees of freedom, and a way of LAMMPS's fixes that gives another number than ours."""
    molecules, samples = 64, 4000
    ours, theirs = table(np.random.default_rng(3), molecules, samples, held=held)
    found = measure.of_series(ours, molecules, of_scheme(held))
    assert found["potential"].value == pytest.approx(-9.5, abs=5 / molecules / np.sqrt(samples))
    assert found["drift"].value == pytest.approx(0.05, rel=1e-6)  # a ps
    # a total momentum that is kept at zero takes kT / V of 512 waters off, 2.65 atm
    assert found["pressure"].value == pytest.approx(1.0, abs=4 * found["pressure"].error)
    assert measure.of_momentum(3, 298.0, VOLUME) == pytest.approx(2.65, abs=0.01)
    expected = 298.0 * (1 - held / 3 / molecules)
    for name, mean in ("translation", expected), ("rotation", 298.0):
        assert abs(found[name].value - mean) < 4 * found[name].error < 2.0
    apart = found["translation"].value - found["rotation"].value
    assert found["apart"].value == pytest.approx(apart, abs=1e-9)
    assert found["distribution"].value < 4
    for name, one in measure.of_series(theirs, molecules, of_scheme(held)).items():
        assert one.value == pytest.approx(found[name].value, rel=1e-9)
    series, _ = table(np.random.default_rng(3), molecules, samples, 304.0, held)
    assert measure.of_series(series, molecules, of_scheme(held))["distribution"].value > 6
    warm = replace(of_scheme(held), temperature=304.0)
    assert measure.of_series(series, molecules, warm)["distribution"].value < 4


# ---- constant pressure


def gas(seed, temperature, pressure, samples=400, bodies=2000, wide=1.0):
    """Independent samples of an ideal gas whose bodies have the potential energy of three springs:
    volumes, Å³, and energies, kcal/mol, have gamma distributions. ``wide`` makes both wider."""
    rng, kt = np.random.default_rng(seed), measure.BOLTZMANN * temperature
    energies = kt * rng.gamma(1.5 * bodies, size=samples)
    volumes = kt * measure.ATM / pressure * rng.gamma(bodies + 1, size=samples)
    values = np.array([energies, volumes])
    mean = values.mean(axis=1, keepdims=True)
    return structure.Sampled(temperature, pressure, mean + wide * (values - mean))


@pytest.mark.parametrize("other", [(305.0, 1000.0), (298.0, 1040.0)])
def test_two_states(other):
    """Locks out another unit of a pressure or a volume, enthalpies for volumes, a slope with the
    wrong sign, and a verdict that a wrong width passes: a gas has the exact distributions."""
    first, second = gas(1, 298.0, 1000.0), gas(2, *other)
    assert structure.between_states(first, second) < 2.5
    assert structure.between_states(second, first) < 2.5
    for wide in 0.75, 1.3:
        pair = gas(1, 298.0, 1000.0, wide=wide), gas(2, *other, wide=wide)
        assert structure.between_states(*pair) > 3
    exchanged = first._replace(values=second.values), second._replace(values=first.values)
    assert structure.between_states(*exchanged) > 4
    far = second._replace(values=3 * second.values)
    assert structure.between_states(first, far) is None


def remembering(rng, samples=12500, time=50.0):
    """Standard normal numbers with an exponential autocorrelation, as a volume of 300 ps has it."""
    keep = np.exp(-1 / time)
    noise = rng.normal(size=samples + round(20 * time))
    return signal.lfilter([np.sqrt(1 - keep**2)], [1, -keep], noise)[-samples:]


@pytest.mark.parametrize(("wide", "low", "high"), [(1.0, 0.4, 1.4), (0.85, 2, 4), (1.15, 2, 4)])
def test_two_states_of_series(wide, low, high):
    """Locks out samples that remember each other and pass for independent ones, of which a right
    ensemble has several standard deviations, and a check that a width 15 % off passes."""
    rng, volume, sd = np.random.default_rng(7), 15800.0, 178.0
    kt = measure.BOLTZMANN * plan.TEMPERATURE * measure.ATM
    apart = sd**2 * (plan.PRESSED - plan.PRESSURE) / kt  # of two normal distributions
    assert 1.5 < apart / sd < 2.5
    found = []
    for _ in range(12):
        pair = []
        for pressure, mean in (plan.PRESSURE, volume), (plan.PRESSED, volume - apart):
            values = measure.thinned(mean + wide * sd * remembering(rng), times=measure.DENSER)
            both = np.concatenate([0 * values, values])
            pair.append(structure.Sampled(plan.TEMPERATURE, pressure, both))
        found.append(structure.between_states(*pair))
    assert low < np.sqrt(np.mean(np.square(found))) < high


def test_compressibility_of_a_gas():
    """Locks out another unit, and two compressibilities that a right ensemble has apart: an ideal
    gas has 1/P, so 100e-5 and 80e-5 at 1000 and 1250 atm, and between them ln(1.25)/250."""
    found = []
    for seed, pressure in (1, 1000.0), (2, 1250.0):
        scheme = replace(SCHEMES["npt-langevin"], pressure=pressure)
        values = gas(seed, 298.0, pressure, 20000).values
        series, _ = table(np.random.default_rng(seed), 512, 20000)
        more = {"Volume": values[1], "Density": 15000.0 / values[1]}
        found.append(measure.of_series(series | more, 512, scheme))
        one = found[-1]["compressibility"]
        assert abs(one.value - 1e5 / pressure) < 4 * one.error < 0.1 * one.value
        assert found[-1]["density"].value == pytest.approx(15000 / values[1].mean(), rel=1e-3)
        off = 1.0 - pressure  # of the table's pressure, of mean 1
        assert found[-1]["pressure_bias"].value == pytest.approx(off, abs=0.1)
    both = measure.of_two_pressures(*found, 250.0)
    exact = 1e5 * np.log(1.25) / 250
    assert abs(both["two_pressures"].value - exact) < 4 * both["two_pressures"].error < 0.02 * exact
    assert both["fluctuations"].value == pytest.approx(90.0, rel=0.05)
    errors = [one["volume"].error / one["volume"].value for one in found]
    expected = 1e5 / 250 * np.hypot(*errors)
    assert both["two_pressures"].margin == pytest.approx(
        measures.Estimate(0.0, expected).margin, rel=0.2
    )


def test_independent_samples():
    """Locks out samples that remember each other: of two series the slower one counts."""
    rng = np.random.default_rng(5)
    fast, slow = rng.normal(size=20000), np.zeros(20000)
    for i in range(1, len(slow)):
        slow[i] = 0.9 * slow[i - 1] + fast[i]
    for times in 1, 4:
        apart = len(slow) / measure.thinned(fast, slow, times=times).shape[1]
        assert apart == pytest.approx(1.9 / 0.1 / times, rel=0.2)  # (1 + 0.9) / (1 - 0.9)
    assert measure.thinned(fast).shape == (1, 20000)


def at_pressure(volume, **known):
    return numbers(
        volume=volume, density=Estimate(1.0, 0.001), compressibility=Estimate(5.0, 0.3), **known
    )


def test_rows_at_constant_pressure():
    """Locks out a density beside that of constant volume, a second state that has a bias, a pair
    of which one has too few samples, and a compressibility of two temperatures."""
    names = "npt-langevin", "npt-langevin-308K", "npt-langevin-400atm"
    known = {
        REFERENCE: [numbers()],
        AT_PRESSURE: [at_pressure(Estimate(15800.0, 10.0))],
        Point(names[0], 6.0): [at_pressure(Estimate(15800.0, 10.0))],
        Point(names[1], 6.0): [at_pressure(Estimate(15900.0, 10.0))],
        Point(names[2], 6.0): [at_pressure(Estimate(15500.0, 10.0))],
    }
    known[Point(names[0], 6.0)][0]["density"] = Estimate(1.004, 0.001)
    states = (298.0, 1000.0), (305.0, 1000.0), (298.0, 1040.0)
    samples = {
        Point(name, 6.0): [gas(2 * i, *state, 100), gas(2 * i + 1, *state, 100)]
        for i, (name, state) in enumerate(zip(names, states))
    }
    found = measure.Found(known, samples)
    _, first, six, warm, pressed = measure.rows(found, known)
    assert first.density_bias is None and first.compressibility.value == 5.0
    assert six.density_bias.value == pytest.approx(0.4)
    assert six.density_bias.error == pytest.approx(0.1 * np.sqrt(2), rel=0.01)
    assert six.deviation is None and six.two_pressures is None and six.pressure_bias is None
    for one in warm, pressed:
        assert one.density_bias is None and one.bias is None and 0 < one.deviation.value < 4
    assert warm.two_pressures is None
    assert pressed.two_pressures.value == pytest.approx(1e5 * np.log(15800 / 15500) / 40)
    assert pressed.fluctuations.value == 5.0
    assert pressed.fluctuations.error == pytest.approx(0.3 / np.sqrt(2))
    found.samples[Point(names[0], 6.0)].pop()
    assert [row.deviation for row in measure.rows(found, known)] == [None] * 5


def test_cost_is_of_one_core():
    """Locks out a time that others who use the core make longer: 8 ms a step by the clock, of
    which half was ours, 250 steps in a ps."""
    assert runs.cost(8000.0, 50.0, 4.0) == pytest.approx(1.0)
    assert runs.cost(8000.0, None, 4.0) == pytest.approx(2.0)


def test_a_bias_has_the_error_of_both():
    """Locks out a reference that is taken as exact."""
    one = measures.difference(Estimate(7.0, 3.0), Estimate(2.0, 4.0))
    assert one.value == 5.0 and one.error == pytest.approx(5.0) and one.freedom is None
    few = measures.difference(Estimate(7.0, 3.0, 4.0), Estimate(2.0, 4.0, 4.0))
    assert few.margin == pytest.approx(np.hypot(*(Estimate(0, e, 4.0).margin for e in (3, 4))))


def test_rows():
    """Locks out a bias against another scheme, a bias of the reference itself, and numbers of a
    point of which a start failed."""
    known = {
        REFERENCE: [numbers(potential=Estimate(-9.0, 0.03), pressure=Estimate(500.0, 3.0))],
        Point("csvr", 6.0): [
            numbers(potential=Estimate(-8.9, 0.04), pressure=Estimate(490.0, 4.0))
        ],
        Point("nh", 6.0): [numbers()],
    }
    found = measure.Found(known, errors={Point("nh", 6.0): "Lost atoms"})
    first, second, third = measure.rows(found, known)
    assert first.bias is None and first.pressure_bias is None and first.potential.value == -9.0
    assert second.bias.value == pytest.approx(0.1) and second.bias.error == pytest.approx(0.05)
    assert second.pressure_bias.value == -10.0 and second.pressure_bias.error == pytest.approx(5.0)
    assert second.cost["median"] == 2.0 and second.starts == 1
    assert third.error == "Lost atoms" and third.potential is None
    found = measure.Found(known, errors={REFERENCE: "Lost atoms"})
    assert [row.bias for row in measure.rows(found, known)] == [None] * 3


def test_the_scatter_of_starts_tells_their_errors():
    """Locks out errors of the series where starts are further apart than these say: -9, -9.1 and
    -9.2 have a mean with the error 0.1/√3, and Student's t of two degrees of freedom. And a margin
    of 12.7 errors of two starts that are as near as their own errors say."""
    starts = [numbers(potential=Estimate(-9.0 - 0.1 * i, 1e-6)) for i in range(3)]
    one = measure.pooled(starts)["potential"]
    assert one.value == pytest.approx(-9.1) and one.error == pytest.approx(0.1 / np.sqrt(3))
    assert one.margin == pytest.approx(4.302653 * one.error, rel=1e-6)
    assert measure.pooled(starts[:1])["potential"] == starts[0]["potential"]
    near = [numbers(potential=Estimate(-9.0 - 0.1 * i, 0.1, 20.0)) for i in range(2)]
    one = measure.pooled(near)["potential"]
    assert one == pytest.approx((-9.05, 0.1 / np.sqrt(2), 40.0))
    known = [numbers(potential=Estimate(-9.0 - 0.1 * i, 0.1)) for i in range(2)]
    assert measure.pooled(known)["potential"].margin == pytest.approx(1.96 * 0.1 / np.sqrt(2), 1e-3)
    exact = [numbers(potential=Estimate(-9.0 - 0.1 * i, 0.0)) for i in range(2)]
    assert measure.pooled(exact)["potential"].margin == pytest.approx(12.706 * 0.05, 1e-3)


@pytest.mark.timeout(300)
def test_margins_of_several_starts_cover():
    """Locks out a margin that covers too seldom or too often, and one that is of no use with two
    starts: of AR(1) noise with correlation times of 0.2 to 5 ps, as long as a run of 300 ps and
    sampled as one is.

    The scatter alone covers 95 %, with margins that are 4.5, 1.9 and 1.2 times those of an error
    that is known.
    """
    samples, series = round(300e3 / lengths.SAMPLED), 720
    rng, covered = np.random.default_rng(11), {2: [], 3: [], 8: []}
    for time in 0.2, 1.0, 5.0:  # ps
        phi = np.exp(-lengths.SAMPLED / 1e3 / time)
        white = np.sqrt(1 - phi**2) * rng.normal(size=(series, samples))
        white[:, 0] /= np.sqrt(1 - phi**2)
        found = [measures.mean(signal.lfilter([1], [1, -phi], one)) for one in white]
        exact = np.sqrt((1 + phi) / (1 - phi) / samples)
        for number in covered:
            # each with others beside it, so that there are as many groups of them as series
            turns = np.array([rng.permutation(series) for _ in range(number)])
            rows = turns.reshape(-1, number)
            some = [measures.of_starts([found[one] for one in row]) for row in rows]
            covered[number].append(np.mean([abs(one.value) < one.margin for one in some]))
            usual = np.median([one.margin for one in some])
            assert usual < 1.2 * 1.96 * exact / np.sqrt(number)
    for number, those in covered.items():
        assert all(0.93 < one < 0.98 for one in those), (number, those)
        assert 0.93 < np.mean(those) < 0.98, (number, those)


def judged(dt=6.0, scheme="langevin-5", time=100.0, **row):
    """The verdicts on a point's numbers, by part."""
    return {
        one.part: one for one in criteria.checks({Point(scheme, dt): {"error": None} | row}, time)
    }


@pytest.mark.parametrize(
    ("key", "part", "scheme", "dt", "inside", "outside"),
    [
        ("bias", "potential", "langevin-5", 4.0, -0.0099, -0.0101),
        ("bias", "potential", "langevin-5", 6.0, 0.0179, 0.0181),
        ("bias", "potential", "langevin-5", 8.0, -0.0249, -0.0251),
        ("bias", "potential", "langevin-20", 8.0, 0.0099, 0.0101),
        ("bias", "potential", "langevin-20-equal", 12.0, 0.0059, 0.0061),
        ("pressure_bias", "pressure", "langevin-20-equal", 12.0, 24.9, 25.1),
        ("temperature", "temperature", "langevin-20-equal", 12.0, 295.03, 295.01),
        ("temperature", "temperature", "nh", 8.0, 300.97, 300.99),
        ("temperature", "temperature", "csvr", 2.0, 295.03, 295.01),
        ("apart", "equipartition", "langevin-5", 4.0, -1.49, -1.51),
        ("apart", "equipartition", "langevin-5", 6.0, -3.99, -4.01),
        ("apart", "equipartition", "langevin-20", 4.0, 0.49, 0.51),
        ("apart", "equipartition", "langevin-20", 6.0, -0.99, -1.01),
        ("pressure_bias", "pressure", "langevin-5", 6.0, -24.9, -25.1),
        ("pressure_bias", "pressure", "csvr", 6.0, 24.9, 25.1),
        ("pressure_bias", "pressure", "npt-csvr", 6.0, 24.9, 25.1),
        ("temperature", "temperature", "npt-langevin-308K", 6.0, 311.07, 311.09),
        ("apart", "equipartition", "npt-langevin", 6.0, -3.99, -4.01),
        ("density_bias", "density", "npt-langevin", 6.0, 0.199, 0.201),
        ("density_bias", "density", "npt-csvr", 2.0, -0.199, -0.201),
        ("density_bias", "density", "shake+npt", 1.0, -0.199, -0.201),
        ("density_bias", "density", "rigid/npt/small", 1.0, 0.199, 0.201),
        ("deviation", "states", "npt-langevin-308K", 6.0, 1.99, 2.01),
        ("deviation", "states", "npt-csvr-400atm", 2.0, 1.99, 2.01),
    ],
)
def test_bounds(key, part, scheme, dt, inside, outside):
    """Locks out a bound at another place, for another sign, and a verdict where the interval
    reaches over it."""
    for value, holds in (inside, True), (outside, False):
        for error, expected in (1e-6, holds), (0.02 * abs(inside), None):
            one = judged(dt, scheme, **{key: Estimate(value, error)})[part]
            assert one.holds is expected and one.value == value


def test_beside_the_trial():
    """Locks out agreement with the trial by a run that is too short to disagree, and a distance
    in other errors: 0.005 and the trial's 0.0045."""
    near = judged(bias=Estimate(-0.014 + 0.006, 0.0045))["trial"]
    assert near.value == pytest.approx(0.006 / (0.0045 * np.sqrt(2))) and near.holds is True
    far = judged(bias=Estimate(-0.014 + 0.010, 0.001))["trial"]
    assert far.value == pytest.approx(0.010 / np.hypot(0.0045, 0.001)) and far.holds is False
    short = judged(bias=Estimate(-0.014, 0.0046))["trial"]
    assert short.verdict == "cannot tell" and "run longer" in short.note
    assert "trial" not in judged(2.0, "csvr", bias=Estimate(0.0, 0.001))


def test_two_compressibilities():
    """Locks out agreement of numbers that are too uncertain to disagree, a distance in the error of
    one, and a verdict on a state without a pressure of its own."""

    def one(two, error, other=0.4, scheme="npt-langevin-400atm"):
        row = {"two_pressures": Estimate(two, error), "fluctuations": Estimate(5.0, other)}
        return judged(6.0, scheme, **row).get("compressibility")

    near, far = one(5.0 + 0.99, 0.3), one(5.0 - 1.01, 0.3)
    assert near.value == pytest.approx(0.99 / 0.5) and near.holds is True
    assert far.value == pytest.approx(1.01 / 0.5) and far.holds is False
    for unsure in one(5.0, 0.76), one(5.0, 0.3, 0.76):
        assert unsure.verdict == "cannot tell" and "run longer" in unsure.note
    assert one(5.0, 0.3, scheme="npt-langevin-308K") is None
    missing = judged(6.0, "npt-langevin-400atm")
    assert missing["compressibility"].holds is None and missing["compressibility"].note
    assert "run longer" in missing["states"].note


def test_what_is_not_judged():
    """Locks out verdicts on points that are too short or were not run, and a failed run that
    passes."""
    good = {"bias": Estimate(0.0, 1e-6), "temperature": Estimate(298.0, 1e-3)}
    assert judged(time=criteria.LEAST, **good) and not judged(time=0.99 * criteria.LEAST, **good)
    assert not judged(scheme="shake+langevin", bias=Estimate(9.0, 0.1))
    assert not judged(5.0, bias=Estimate(9.0, 0.1))
    for one in judged(error="Lost atoms").values():
        assert one.verdict == "cannot tell" and one.note == "Lost atoms"
    assert "reference" in judged(temperature=Estimate(298.0, 1e-3))["potential"].note


# ---- runs


@pytest.mark.timeout(200)
def test_the_verb_runs(tmp_path, monkeypatch):
    """Locks out a verb that fails, runs that are done twice, a folder that forgets what an earlier
    command has left, and a Ctrl-C that loses it."""
    out = ["--out", str(tmp_path)]
    first = ["langevin-5", "rigid/nvt/small"]
    then = ["npt-langevin", "npt-langevin-400atm", "shake+npt", "rigid/npt/small"]
    assert __main__.main([*TINY, *first, *then, *out]) == 0
    files = {path.name for path in tmp_path.iterdir()}
    assert {"summary.json", "table.csv", "checks.csv", "report.html"} <= files
    assert {"bias.png", "density.png"} <= files
    summary = json.loads((tmp_path / "summary.json").read_text())
    points = [(row["scheme"], row["dt"]) for row in summary["rows"]]
    wanted = [REFERENCE, *((name, 4.0) for name in first)]
    wanted += [AT_PRESSURE, *((name, 4.0) for name in then)]
    assert points == wanted and not summary["checks"]
    for row in summary["rows"]:
        assert row["error"] is None and 250 < row["temperature"]["value"] < 350
        assert -10 < row["potential"]["value"] < -9 and row["cost"]["median"] > 0
        pressure = SCHEMES[row["scheme"]].pressure is not None
        biased = (row["scheme"], row["dt"]) not in REFERENCES and not row["scheme"].endswith("atm")
        assert ("bias" in row) == biased and ("density_bias" in row) == (biased and pressure)
        assert ("density" in row) == pressure == ("compressibility" in row)
        assert not pressure or 0.9 < row["density"]["value"] < 1.1
        assert ("two_pressures" in row) == row["scheme"].endswith("atm")
    page = (tmp_path / "report.html").read_text()
    assert page.count("not known without") == 2 and "Constant pressure" in page

    done = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("log.lammps")}
    assert len(done) == len(points) + 1  # and the start

    once = run.once

    def stopped(job, *rest, **more):
        if "csvr" in job.directory:
            return run.Result("interrupted", {}, [], None, {}, interrupted=True)
        return once(job, *rest, **more)

    monkeypatch.setattr(run, "once", stopped)
    assert __main__.main([*TINY, "csvr", *out]) == 130
    again = json.loads((tmp_path / "summary.json").read_text())
    assert again["interrupted"] and len(again["rows"]) == len(points)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("log.lammps")} == done


@pytest.mark.timeout(200)
def test_runs_of_another_length_stay(tmp_path):
    """Locks out a command with longer runs that throws the shorter ones away: both lengths stay
    in the folder, and the first command finds its own again."""

    def do(time):
        words = ["--ps", time, "--dt", "4", "--only", "rigid/nvt/small", "--out", str(tmp_path)]
        assert __main__.main(["ensembles", *words]) == 0
        summary = json.loads((tmp_path / "summary.json").read_text())
        assert summary["settings"]["time"] == float(time)
        assert [row["error"] for row in summary["rows"]] == [None, None]
        return {path: path.stat().st_mtime_ns for path in tmp_path.rglob("log.lammps")}, summary

    short, first = do("0.05")
    both, second = do("0.07")
    assert len(short) == 3 and len(both) == 6 and short.items() < both.items()
    assert (tmp_path / "runs" / "0.05-ps" / "start-1" / "start" / "done.json").exists()
    again, third = do("0.05")
    assert again == both and third["rows"] == first["rows"] != second["rows"]


def test_what_settles_is_left_out(tmp_path, monkeypatch):
    """Locks out samples of the part that is run before: of 20 and 40 steps only the second's."""
    series, _ = table(np.random.default_rng(4), 512, 61)
    series |= {"Step": np.arange(61.0)}
    series["PotEng"] = np.where(series["Step"] < 20, 0.0, -512 * 9.5)
    timings = [
        Loop(time, 1, steps, 1536, 100.0, {"Modify": 0.1}) for time, steps in ((9.0, 20), (0.4, 40))
    ]
    result = run.Result(None, series, timings, None, {}, [1], {"commands": [], "setups": []})
    monkeypatch.setattr(run, "collect", lambda directory: result)
    found, job = measure.Found(), run.Job(str(tmp_path), "", [], [20, 40], None)
    measure._measure(found, Point("csvr", 8.0), job)
    ((only,),) = found.numbers.values()
    assert only["potential"].value == -9.5
    assert only["cost"].value == pytest.approx(0.4 / 40 * 125)
    series["PotEng"][50] = np.nan
    measure._measure(found, Point("nh", 8.0), job)
    assert found.errors == {Point("nh", 8.0): "energy is not finite"}


def test_a_start_that_fails_is_said(tmp_path, monkeypatch):
    """Locks out points that run from a start which is not there."""
    bad = replace(SCHEMES["csvr"].integrator, lines=("fix 1 {group} no/such",))
    monkeypatch.setattr(measure, "STARTER", plan.Scheme(bad))
    points = [REFERENCE, Point("csvr", 4.0)]
    _, rows = measure.ensembles(points, Lengths(0.05), tmp_path, Silent(), 60.0)
    assert all("start 1" in row.error and "no/such" in row.error for row in rows) and len(rows) == 2


def test_translation_is_that_of_the_centres(tmp_path):
    """Locks out a kinetic energy of translation, of LAMMPS's fixes, that is not the centres': the
    same as that of the fix, which knows its bodies."""
    scene, scheme = plan.scene(), SCHEMES["nosquish+langevin"]
    more = [line.format(group=scene.group) for line in schemes.MOVES]
    more += run.thermo("v_moves", "f_1[1]", "f_1[2]")
    how = {"dt": 4.0, "every": 5, "more": more, "keeps": "nothing"}
    result = run.run(run.job(scene, scheme.seeded(1), tmp_path / "run", [20], **how))
    assert result.error is None
    found = result.thermo
    np.testing.assert_allclose(found["v_moves"], found["f_1[1]"], rtol=1e-6)
    np.testing.assert_allclose(found["KinEng"] - found["v_moves"], found["f_1[2]"], rtol=1e-6)


def test_the_scene_runs_by_itself(tmp_path):
    """Locks out an input script that is another scene than the verb's."""
    log, scene = tmp_path / "alone.log", plan.scene()
    done = subprocess.run(
        [str(BIN / "lmp"), "-in", "in.512", "-log", str(log), "-var", "nsteps", "1"],
        cwd=scene.folder,
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert done.returncode == 0, done.stdout
    one = run.run(
        run.job(scene, SCHEMES["langevin-5"].seeded(1), tmp_path / "scene", [0], dt=4.0, every=1)
    )
    energy = read_thermo(log.read_text())["PotEng"][0]
    assert energy == pytest.approx(one.thermo["PotEng"][0], rel=1e-6)
