"""Error of averages against cost: the limit of small steps, work and precision, plan, runs."""

import json
import re

import numpy as np
import pytest
from scipy import signal

from validation import __main__
from validation.ensembles import plan as ensembles
from validation.ensembles import runs
from validation.ensembles.lengths import Lengths, Point
from validation.ensembles.schemes import SEED
from validation.running import rounds, run
from validation.sampling import criteria, measure, plan
from validation.statistics import limit, measures, precision
from validation.statistics.estimate import Estimate
from validation.statistics.limit import Model

MODELS = {"a": Model(4.0), "b": Model(8.0), "exact": Model()}
STEPS = {
    **{("a", dt): 0.05 for dt in (1.0, 2.0, 4.0)},
    **{("b", dt): 0.02 for dt in (2.0, 4.0, 6.0, 8.0)},
    ("exact", 6.0): 0.04,
    ("a", 6.0): 0.01,  # beyond its reach
    ("other", 2.0): 0.01,  # with a limit of its own
}


def exact(scheme, dt):
    """A mean whose limit is -9, with another error of the step for each scheme."""
    if scheme == "other":
        return -8.0
    return -9.0 + {"a": 0.02 * dt**2, "b": -0.003 * dt**2 + 1e-4 * dt**4, "exact": 0.0}[scheme]


def fit(points):
    return limit.fit(points, {key: key for key in points}, MODELS)


def test_the_limit_of_exact_numbers():
    """Locks out a limit or a bias that is off where nothing is uncertain, a term that is missing,
    and points that have no place in the fit."""
    found = fit({key: Estimate(exact(*key), error) for key, error in STEPS.items()})
    assert found.limit.value == pytest.approx(-9.0, abs=1e-9) and found.chi2 < 1e-9
    assert found.freedom == 8 - 1 - 1 - 2
    assert ("a", 6.0) not in found.weights and ("other", 2.0) not in found.weights
    for key in STEPS:
        assert found.bias(key).value == pytest.approx(exact(*key) + 9.0, abs=1e-9)


@pytest.mark.parametrize("freedom", [None, 11])
def test_the_limits_error_covers(freedom):
    """Locks out an error of U0 or of a bias that is too small or too large: of 1,500 samples the
    95 % interval has the truth in 95 %, of points in the fit, outside of it, and of their chi2."""
    rng = np.random.default_rng(5)
    inside: dict = dict.fromkeys((None, *STEPS), 0)
    agree, number = 0, 1500
    for _ in range(number):
        points = {}
        for key, error in STEPS.items():
            told = error if freedom is None else error * np.sqrt(rng.chisquare(freedom) / freedom)
            points[key] = Estimate(exact(*key) + error * rng.normal(), told, freedom)
        found = fit(points)
        agree += found.agrees
        inside[None] += abs(found.limit.value + 9.0) < found.limit.margin
        for key in STEPS:
            one = found.bias(key)
            inside[key] += abs(one.value - exact(*key) - 9.0) < one.margin
    # with errors that few values tell a margin is too wide rather than too narrow
    low, high = (0.93, 0.97) if freedom is None else (0.93, 0.995)
    for key, count in inside.items():
        assert low < count / number < high, key
    assert 0.92 < agree / number < 0.98


def test_a_point_of_the_fit_is_correlated_with_it():
    """Locks out errors of a point and the limit that are added as if they were independent: the
    only exact point is the limit."""
    points = {("exact", 6.0): Estimate(-9.0, 0.04), ("other", 2.0): Estimate(-8.0, 0.03)}
    found = fit(points)
    assert found.limit == Estimate(-9.0, 0.04) and found.bias(("exact", 6.0)).error == 0
    assert found.bias(("other", 2.0)).error == pytest.approx(0.05)


def test_a_wrong_model_is_seen():
    """Locks out a chi2 that agrees with everything."""
    points = {key: Estimate(exact(*key), error) for key, error in STEPS.items()}
    points["exact", 6.0] = Estimate(-8.7, 0.04)
    found = fit(points)
    assert not found.agrees and found.probability < 1e-4


def test_no_limit():
    """Locks out a limit of schemes with one step each, which is that of nothing."""
    assert fit({("a", 2.0): Estimate(1.0, 0.1), ("b", 2.0): Estimate(1.0, 0.1)}) is None
    assert fit({("other", 2.0): Estimate(1.0, 0.1)}) is None and fit({}) is None


# ---- work and precision


def remembering(rng, samples, time):
    """Standard normal numbers with an exponential autocorrelation."""
    keep = np.exp(-1 / time)
    noise = rng.normal(size=samples + round(20 * time))
    return signal.lfilter([np.sqrt(1 - keep**2)], [1, -keep], noise)[-samples:]


def test_the_error_of_an_autocorrelation_time():
    """Locks out a time of an independent sample without its error, or with another one."""
    rng, truth = np.random.default_rng(2), 1 / np.tanh(0.5 / 10.0)
    found = [measures.autocorrelation(remembering(rng, 20000, 10.0)) for _ in range(300)]
    off = np.array([(one.value - truth) / one.error for one in found])
    assert 0.75 < off.std() < 1.3 and abs(off.mean()) < 0.5


def test_the_memory_of_a_square():
    """Locks out the memory of a squared dipole as that of the dipole, a value that noise makes too
    large, and an error that does not cover: runs of 100 memories, as those of water."""
    rng, memory, samples = np.random.default_rng(6), 40.0, 4000
    keep = np.exp(-2 / memory)  # of the square: that of a component, squared
    truth, found = (1 + keep) / (1 - keep), {1: [], 6: []}
    for starts, some in found.items():
        for _ in range(150):
            parts = []
            for _ in range(starts):
                x = [remembering(rng, samples, memory) for _ in range(3)]
                parts.append(measures.autocovariance(np.stack(x, axis=1)))
            some.append(measures.autocorrelation_of_square(np.concatenate(parts)))
    for starts, some in found.items():
        values = np.array([one.value for one in some])
        assert abs(values.mean() / truth - 1) < 0.03
        assert np.mean([abs(one.value - truth) < one.margin for one in some]) > 0.85
        assert some[0].freedom == 3 * starts - 1
    # the square of the same series tells much less
    squares = [
        measures.autocorrelation(sum(remembering(rng, samples, memory) ** 2 for _ in range(3)))
        for _ in range(150)
    ]
    assert np.std([one.value for one in squares]) > 1.3 * np.std([one.value for one in found[1]])


def test_total_error_against_brute_force():
    """Locks out another formula of bias and noise: the rms error of means of many runs that last so
    long, of a series with a bias."""
    rng, cost, apart, bias = np.random.default_rng(3), 2.5, 0.1, 0.05
    x = 3.0 * remembering(rng, 400000, 8.0)
    remembers = measures.autocorrelation(x).times(apart)
    assert remembers.value == pytest.approx(apart / np.tanh(0.5 / 8.0), rel=0.1)
    worth = precision.Worth(Estimate(bias), remembers.times(np.var(x) * cost))
    for samples in 2000, 20000:
        errors = [3.0 * remembering(rng, samples, 8.0).mean() + bias for _ in range(400)]
        seconds = samples * apart * cost
        brute = np.sqrt(np.mean(np.square(errors)))
        assert worth.error(seconds) == pytest.approx(brute, rel=0.15)
        assert precision.seconds(worth, brute).value == pytest.approx(seconds, rel=0.5)


def test_time_to_an_error():
    """Locks out a time to an error that the bias alone exceeds, and a ratio upside down."""
    good = precision.Worth(Estimate(0.0), Estimate(2.0))
    bad = precision.Worth(Estimate(0.1), Estimate(1.0))
    assert precision.seconds(good, 0.1) == (pytest.approx(200.0),) * 3
    assert precision.seconds(bad, 0.1).value == np.inf
    # at sqrt(2) of its bias its noise is as large: 1 / 0.01 s
    assert precision.times(bad, good).value == pytest.approx((1 / 0.01) / (2 / 0.02))
    assert precision.times(good, bad, 0.05).value == 0
    assert precision.times(bad, good, 0.05).plain()["value"] is None
    nothing = precision.Worth(Estimate(np.nan), Estimate(1.0))
    assert set(precision.times(nothing, good).plain().values()) == {None}
    unsure = precision.Worth(Estimate(0.0, 0.1), Estimate(2.0, 0.2))
    spread = precision.seconds(unsure, 0.1)
    assert 180 < spread.low < spread.value < np.inf and spread.high == np.inf
    assert unsure.error(1e12) == pytest.approx(0.1)


# ---- the plan


@pytest.mark.parametrize("name", plan.CASES)
def test_what_runs(name, tmp_path):
    """Locks out a scheme at another temperature than the scene's, words that LAMMPS cuts, points
    of another distribution that count for the limit (in the peptide shake holds less than rigid
    fixes), and trajectories that a sample or a run cuts."""
    case = plan.CASES[name](tmp_path)
    made = list(case.runs(case.points(), Lengths(1.0, 2)))
    assert len({one.name for _, one in made}) == len(made) == 2 * len(case.points())
    assert set(case.known) <= set(case.points())
    other = {one for one in case.schemes if one.startswith("shake") and name == "peptide"}
    assert set(case.schemes) - set(case.models) == (
        other | {"rigid/nvt/small"} | ({"langevin-20-step"} & set(case.schemes))
    )
    for scheme in case.schemes.values():
        words = " ".join(scheme.seeded(1).commands(case.scene))
        assert f" {case.temperature:g} " in words and SEED not in words and "{" not in words
        for dt in scheme.steps:
            lengths = Lengths(1.0)
            for steps in (*lengths.runs(dt, scheme.stride), lengths.every(dt, scheme.stride)):
                assert steps % scheme.stride == 0
    short = case.points(short=True)
    assert set(case.known) <= set(short) and len(short) < len(case.points()) / 3
    assert case.points(["nh"], [3.0]) == [Point("nh", 3.0)]
    text = " ".join(case.prints(Lengths(1.0))(case.schemes["rigid+langevin"], 2.0, tmp_path))
    assert "f_raw[1]" in text  # not the thermostat's noise


def test_liquids():
    """Locks out another density, molecules that overlap, and shapes of another size."""
    for one, room in (plan.BENZENE, 2.48), (plan.CARBON_DIOXIDE, 1.16):
        lines = one.data().splitlines()
        atoms = lines.index("Atoms # full") + 2
        number = one.molecules * len(one.types)
        x = np.array([line.split()[1:] for line in lines[atoms : atoms + number]], float)
        box = np.array([float(line.split()[1]) for line in lines if line.endswith("hi")])
        mass = np.array(one.mass)[x[:, 1].astype(int) - 1].sum()
        assert mass / box.prod() / 0.602214076 == pytest.approx(one.density)
        assert abs(x[:, 2].sum()) < 1e-9
        far = x[:, None, 3:6] - x[:, 3:6]
        far = np.linalg.norm(far - np.rint(far / box) * box, axis=2)
        same = x[:, :1] == x[:, 0]
        assert far[~same].min() > 2.5 and far[same].max() == pytest.approx(2 * room, abs=0.01)


def test_bounds():
    """Locks out a bound that a wrong number passes, and verdicts on runs that are too short."""

    def verdicts(time=20.0, less=(5.1, 0.01), scheme="langevin-5", **biases):
        row = {"ours": True, "error": None, "label": "x", "scheme": scheme, "dt": 8.0}
        row |= {"less": {"shake": {}}}
        row["less"]["shake"] = Estimate(*less).plain()
        row["biases"] = {key: Estimate(one, 1e-6).plain() for key, one in biases.items()}
        summary = {"settings": {"time": time}, "known": [{"dt": 2.0}], "rows": [row]}
        return [one.holds for one in criteria.checks(summary | {"title": "x"})]

    for key, most in criteria.BOUNDS.items():
        assert verdicts(**{key: -0.99 * most}) == [True, True]
        assert verdicts(**{key: 1.01 * most}) == [False]  # samples of something else
    assert verdicts(potential=0.005, scheme="hmc-equal") == [False]
    assert verdicts(time=19.0) == []
    assert verdicts(potential=0.0, less=(1.0, 0.5)) == [True]  # known to a factor only


def test_bounds_of_thermostats():
    """Locks out bounds of one thermostat on another's numbers, on another water, or twice; a
    temperature or its parts in other units; an error of the one that leaves out the other; and a
    traceback where there is no limit of small steps."""

    def checks(title=ensembles.TITLE, scheme="langevin-5", dt=6.0, **more):
        biases = {"potential": -0.01, "pressure": 24.0, "translation": -2.5, "rotation": 1.0} | more
        biases = {key: one for key, one in biases.items() if one is not None}
        label = plan.CASES["water"](None).schemes[scheme].label
        row = {"scheme": scheme, "ours": True, "error": None, "label": label, "dt": dt, "less": {}}
        row["biases"] = {key: Estimate(one, 1e-3).plain() for key, one in biases.items()}
        summary = {"settings": {"time": 20.0}, "known": [{"dt": 2.0}], "rows": [row]}
        made = criteria.checks(summary | {"title": title, "temperature": 298.0})
        return {one.part: one for one in made if one.part != "bias"}, made

    found, _ = checks()
    assert set(found) == {"potential", "trial", "temperature", "equipartition"}
    assert found["potential"].high == 0.018 and found["potential"].value == -0.01
    assert found["temperature"].value == pytest.approx(297.25)
    assert found["temperature"].error == pytest.approx(1e-3 / np.sqrt(2))
    assert found["equipartition"].value == -3.5 and found["equipartition"].holds is True
    assert found["equipartition"].error == pytest.approx(1e-3 * np.sqrt(2))
    assert checks(rotation=1.6)[0]["equipartition"].holds is False
    assert not checks(title="another water")[0]
    assert not checks(scheme="langevin-2-equal")[0]
    same, every = checks(scheme="langevin-20-equal", dt=12.0)
    assert set(same) == {"temperature"}
    assert len({(one.what, one.high) for one in every}) == len(every)
    without, _ = checks(potential=None, pressure=None)
    assert without["potential"].holds is without["trial"].holds is None
    assert without["equipartition"] == found["equipartition"]


def test_seeds_of_a_scripts_own_integrators():
    """Locks out starts that share the noise of their thermostat."""
    lines = {
        'fix 1 all python/move "fix_nosquish.NVT all molecule temp 1 1 2 seed 4928"': "4928",
        "fix own_bath {group} langevin 300 300 100 4928 tally yes": "4928",
        "fix langevin all rigid/small molecule langevin 300 300  100 77": "77",
        'fix 1 a python/move "fix_nosquish.NVT a molecule thermostat langevin seed  5 mrot 2"': "5",
    }
    for line, seed in lines.items():
        assert plan.SEEDS.sub(r"\1SEED", line) == line.replace(seed, "SEED")
    assert plan.SEEDS.sub(r"\1SEED", "fix 1 all nvt temp 300 300 100") == (
        "fix 1 all nvt temp 300 300 100"
    )


# ---- numbers

KT = 0.0019872067 * 298.0  # kcal/mol
N, SAMPLES, VOLUME = 512, 40000, 15360.0


def printed(rng, **columns):
    """Columns that each scheme prints, of samples without memory, 24 fs apart."""
    energy = -9.5 * N + 30 * rng.normal(size=SAMPLES)
    alike = dict.fromkeys(("Press", "v_torque", *plan.DIPOLE), np.full(SAMPLES, 2.0))
    time = 24.0 * np.arange(SAMPLES)
    return {"Time": time, "PotEng": energy, "Volume": np.full(SAMPLES, VOLUME), **alike, **columns}


def test_numbers_of_a_series():
    """Locks out a pressure that lacks the part of a total momentum that a scheme keeps at zero, a
    temperature of other degrees of freedom, fluctuations in other units, and a noise without the
    cost."""
    case, rng = plan.CASES["water"](None), np.random.default_rng(3)
    gas = KT / VOLUME * 68568.415  # atm, of one molecule
    free = {"Press": np.full(SAMPLES, N * gas)}
    held = {"Press": np.full(SAMPLES, (N - 1) * gas)}
    moves, turns = 1.5 * N * KT * 1.1, 1.5 * N * KT * 0.9
    theirs = {"c_kinetic": np.full(SAMPLES, moves + turns), "v_moves": np.full(SAMPLES, moves)}
    ours = {"f_1[3]": np.full(SAMPLES, 298 * 1.1), "f_1[4]": np.full(SAMPLES, 298 * 0.9)}
    for name, columns in {
        "langevin-20": free | ours, "csvr": held | ours, "shake+langevin": free | theirs,
        "rigid/nvt/small": held | theirs,
    }.items():  # fmt: skip
        found = measure.of_series(printed(rng, **columns), case, case.schemes[name])
        means = {key: one.value for key, one in found.means.items()}
        assert means["pressure"] == pytest.approx(N * gas, rel=1e-6), name
        assert means["translation"] == pytest.approx(298 * 1.1), name
        assert means["rotation"] == pytest.approx(298 * 0.9), name
        assert means["capacity"] == pytest.approx(900 / KT**2 / N, rel=0.04)
        # <M^2> / (3 epsilon_0 V kT), in Gaussian units 4 pi <M^2> / (3 V kT)
        moment = 4 * np.pi * 332.06371 * 12.0 / (3 * VOLUME * KT)
        assert means["dipole"] == pytest.approx(moment) and means["torque"] == 2.0 / N
        assert found.remembers["potential"].value == pytest.approx(0.024, rel=0.1)
        noise = (30 / N) ** 2 * 0.024
        assert found.noise("potential").value == pytest.approx(noise, rel=0.1)
    few = printed(rng)
    few = {key: one[:8] for key, one in few.items()}
    found = [
        measure.of_series(
            few | {"PotEng": 30 * rng.normal(size=8)}, case, case.schemes["nh"]
        ).means["capacity"].value
        for _ in range(2000)
    ]  # fmt: skip
    assert np.mean(found) == pytest.approx(900 / KT**2 / N, rel=0.06)  # 0.875 of it without n - 1


def test_variances_of_all_starts():
    """Locks out the noise of one start for that of all."""
    some = [measure.Numbers({}, {}, {"potential": one}) for one in (1.0, 3.0)]
    assert measure.pooled(some).variances == {"potential": 2.0}


def test_rows_of_known_schemes():
    """Locks out a gain that is its inverse, biases and noises in other units than their bounds, and
    a sample of another average than the slowest."""
    case = plan.CASES["water"](None)
    found = measure.Found()
    factors = {"langevin-20": -1e-4, "shake+langevin": 1e-3}
    cost = {"langevin-20": 6.0, "shake+langevin": 10.0}
    for scheme, factor in factors.items():
        for dt in (1.0, 2.0, 4.0):
            means = {"potential": -9.5 + factor * dt**2, "torque": 40 * (1 + factor * dt**2)}
            remembers = {"potential": Estimate(0.5, 0.0), "torque": Estimate(3.0, 0.0)}
            point, spent = Point(scheme, dt), cost[scheme] / dt
            variances = {key: 1.6e-3 / spent / one.value for key, one in remembers.items()}
            exact = {key: Estimate(one, 1e-9) for key, one in means.items()}
            found.numbers[point] = [measure.Numbers(exact, remembers, variances)]
            found.costs[point] = [0.9 * spent, spent, 2.0 * spent]
    told = measure.told(found, case, list(found.numbers))
    rows = {(row["scheme"], row["dt"]): row for row in told["rows"]}
    assert told["limits"]["potential"]["value"] == pytest.approx(-9.5, abs=1e-6)
    for (scheme, dt), row in rows.items():
        bias = factors[scheme] * dt**2
        assert row["biases"]["potential"]["value"] == pytest.approx(bias, abs=1e-6)
        assert row["biases"]["torque"]["value"] == pytest.approx(100 * bias, abs=1e-4)
        assert row["noise"]["potential"]["value"] == pytest.approx(1.6e-3)
        assert row["noise"]["torque"]["value"] == pytest.approx(1.6e-3 * 2.5**2, rel=1e-6)
        assert row["slowest"] == "torque"
        assert row["sample"]["value"] == pytest.approx(3.0 * cost[scheme] / dt)
        assert row["less"]["shake+langevin"]["value"] == pytest.approx(5.0 * dt / cost[scheme])
        room = 0.006**2 - bias**2
        seconds = row["seconds"]["potential"]
        assert seconds["value"] == (pytest.approx(1.6e-3 / room, rel=1e-3) if room > 0 else None)
    # to the error sqrt(2) x 0.004 of shake at 2 fs, whose noise then is 0.004^2
    faster = rows["langevin-20", 4.0]["faster"]["potential"]["value"]
    assert faster == pytest.approx((2 * 0.004**2 - 0.0016**2) / 0.004**2, rel=1e-3)


def test_frames_that_are_left_out(tmp_path):
    """Locks out a g(r) of frames from before the part that counts."""
    lines = []
    for frame in range(5 * measure.BLOCKS):
        apart = 3.05 if frame < measure.BLOCKS else 4.05
        lines += ["ITEM: TIMESTEP", str(10 * frame), "ITEM: NUMBER OF ATOMS", "2"]
        lines += ["ITEM: BOX BOUNDS pp pp pp", *["0 12"] * 3, "ITEM: ATOMS x y z"]
        lines += ["1 1 1", f"1 1 {1 + apart}"]
    path = tmp_path / "sites.dump"
    path.write_text("\n".join(lines) + "\n")
    rdf = measure.of_frames(path, 10 * measure.BLOCKS)
    assert rdf.shape[0] == measure.BLOCKS and np.ptp(rdf, axis=0).max() < 1e-9
    assert np.flatnonzero(rdf[0]).tolist() == [39]  # from 0.1 A on
    assert measure.of_frames(path, 10 * 5 * measure.BLOCKS - 20) is None


def test_dipoles_of_all_starts_together():
    """Locks out the memory of the dipole from each start by itself, and in samples."""
    rng, memory = np.random.default_rng(9), 40.0
    starts = []
    for _ in range(4):
        parts = [remembering(rng, 4000, memory) for _ in range(3)]
        columns = dict(zip(plan.DIPOLE, parts))
        table = {key: one[:4000] for key, one in printed(rng).items()} | columns
        case = plan.CASES["water"](None)
        starts.append(measure.of_series(table, case, case.schemes["nh"]))
    remembers = measure.pooled(starts).remembers["dipole"]
    assert remembers.value == pytest.approx(0.024 * memory, rel=0.15)
    assert remembers.freedom == 3 * 4 - 1


@pytest.mark.parametrize("starts", [1, 2, 5])
def test_the_error_of_a_dipoles_fluctuation_covers(starts):
    """Locks out margins that are too sure of how much runs of five memories remember: they covered
    in 75 to 86 % of cases."""
    rng, case = np.random.default_rng(starts), plan.CASES["water"](None)
    apart, memory, lasts, covered = 0.1, 21.0, 100.0, []  # ps
    samples, rest = round(lasts / apart), printed(rng)
    ones = {key: np.ones(samples) for key in rest} | {"Time": np.arange(samples) * 1e3 * apart}
    scale = measure._dipole(ones | dict.fromkeys(plan.DIPOLE, np.ones(samples)), case, None)[0]
    for _ in range(200):
        some = []
        for _ in range(starts):
            columns = {key: remembering(rng, samples, memory / apart) for key in plan.DIPOLE}
            some.append(measure.of_series(ones | columns, case, case.schemes["nh"]))
        mean = measure.pooled(some).means["dipole"]
        covered.append(abs(mean.value - scale) < mean.margin)
    assert 0.88 < np.mean(covered) < 0.98


# ---- runs


def test_time_that_others_had_is_no_cost(tmp_path, monkeypatch):
    """Locks out the time of a core that other processes had, and a step's time for a ps's."""
    case = plan.CASES["water"](None)
    point, lengths = Point("langevin-20", 4.0), Lengths(1.0)
    ((_, one),) = case.runs([point], lengths)
    batch = runs.Runs(case.scene, case.starter, lengths, tmp_path, 60.0, case.prints(lengths))

    def in_turn(labels, make, rounds_, meter):
        timing = rounds.Timing(loop=800.0, cpu=50.0)
        return {name: [timing] * rounds_ for name in labels}, {}, False

    monkeypatch.setattr(runs.rounds, "in_turn", in_turn)
    costs = batch.costs({one: 1e-3}, None, "sampling.measure")
    assert costs == {one.name: pytest.approx([800e-6 * 250 / 2] * runs.ROUNDS)}


@pytest.mark.timeout(300)
def test_the_verb_runs(tmp_path, monkeypatch):
    """Locks out a verb that fails, runs that are done twice, a folder that forgets what an earlier
    command has left, a Ctrl-C that loses it, and a start that takes all others with it."""
    monkeypatch.setattr(runs, "ROUNDS", 2)
    monkeypatch.setattr(runs, "SECONDS", 0.02)
    words = ["sampling", "water", "--ps", "0.05", "--out", str(tmp_path), "--only"]
    assert __main__.main([*words, "langevin-20", "shake+langevin", "hmc", "--dt", "1,2"]) == 0
    files = {path.name for path in tmp_path.iterdir()}
    assert {"summary.json", "table.csv", "checks.csv", "report.html", "precision.png"} <= files
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert len(summary["rows"]) == 6 and not summary["checks"]
    for row in summary["rows"]:
        assert row["error"] is None and -10 < row["means"]["potential"]["value"] < -9
        assert 30 < row["means"]["torque"]["value"] < 60 and row["cost"]["median"] > 0
        assert 200 < row["means"]["rotation"]["value"] < 400
        assert set(row["biases"]) == set(row["means"]) and "shake+langevin" in row["less"]
    logs = list(tmp_path.rglob("log.lammps"))
    timed = [path for path in logs if runs.TIMED in path.parts]
    # a run from each point and the start; points in turn, without samples
    assert len(logs) - len(timed) == 6 + 1 and len(timed) == 6 * runs.ROUNDS
    for path in timed:
        text = path.read_text()
        assert "dump sites" not in text and "c_dipole" not in text and "\nthermo 0" in text
    for path in [one for one in timed if "hmc" in str(one)]:
        steps = re.findall(r"\nrun (\d+)", path.read_text())
        assert all(int(one) % plan.TRAJECTORY == 0 for one in steps)
    done = {path: path.stat().st_mtime_ns for path in logs}

    once = run.once

    def stopped(job, *rest, **more):
        if "nh" in job.directory.rpartition("/")[2]:
            return run.Result("interrupted", {}, [], None, {}, interrupted=True)
        return once(job, *rest, **more)

    monkeypatch.setattr(run, "once", stopped)
    assert __main__.main([*words, "nh", "--dt", "2"]) == 130
    again = json.loads((tmp_path / "summary.json").read_text())
    assert again["interrupted"] and again["rows"] == summary["rows"]
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("log.lammps")} == done

    def silent(job, *rest, **more):
        if any(f"start-{number}/start" in job.directory for number in lost):
            return run.Result("no sign of life", {}, [], None, {})
        return once(job, *rest, **more)

    monkeypatch.setattr(run, "once", silent)
    twice, lost = [*words, "langevin-20", "--dt", "2", "--starts", "2"], [2]
    assert __main__.main(twice) == 0
    rows = json.loads((tmp_path / "summary.json").read_text())["rows"]
    assert all(row["starts"] == 1 and not row["error"] for row in rows) and len(rows) == 6
    told = "No average has start 2, which failed: no sign of life."
    assert told in (tmp_path / "report.html").read_text()
    lost.append(1)
    assert __main__.main([*twice, "--out", str(tmp_path / "none")]) == 1
    (row,) = json.loads((tmp_path / "none" / "summary.json").read_text())["rows"]
    assert row["error"] == "all starts failed, start 1: no sign of life"
