"""What averages cost with their error: the verb's plan, numbers, verdicts and runs."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from validation import __main__
from validation.experiment import Point
from validation.running import rounds, run
from validation.running.lammps_log import Loop
from validation.sample import criteria, measure, observables, report, scenes, schemes
from validation.sample import plan as plans
from validation.sample.observables import BY_KEY, of_momentum
from validation.sample.plan import DIPOLE, Lengths, Runs
from validation.statistics.estimate import Estimate

KT = 0.0019872067 * 298.0  # kcal/mol
N, SAMPLES, VOLUME = 512, 40000, 15360.0
GAS = KT / VOLUME * 68568.415  # atm, of one molecule


def planned(name="water", folder=None):
    return scenes.SCENES[name](folder)


def runs_of(plan, folder, time=1.0, starts=1, **more):
    return Runs(plan, Lengths(time, starts, **more), folder, 60.0)


# ---- the plan


def test_a_start_has_no_longer_step_than_the_script(tmp_path):
    """Locks out a start that breaks, of a script whose step is a short one."""
    scene = replace(planned().scene, dt=0.5)
    start = runs_of(replace(planned(), scene=scene), tmp_path, 0.02).start(1)
    assert "timestep 0.5" in start.commands


@pytest.mark.parametrize("name", scenes.SCENES)
def test_what_runs(name, tmp_path):
    """Locks out a scheme at another state than the one that its numbers count on, words that LAMMPS
    cuts, points of another distribution that count for the limit (in the peptide shake holds less
    than rigid fixes), and trajectories that a sample or a run cuts."""
    plan = planned(name, tmp_path)
    points = plan.points()
    some = runs_of(plan, tmp_path, starts=2)
    names = [trajectory.name for trajectory in some.trajectories(points)]
    assert len(set(names)) == len(names) == 2 * (1 + len(points))
    assert set(plan.known) <= set(points) and len(set(points)) == len(points)
    others = {"rigid/nvt/small"} | {
        one
        for one, scheme in plan.schemes.items()
        if scheme.first or scheme.refined or one.endswith("-step")
    }
    if name == "peptide":
        others |= {one for one in plan.schemes if one.startswith("shake")}
    limited = {one: scheme for one, scheme in plan.schemes.items() if not scheme.engine}
    alone = {one for one, scheme in limited.items() if scheme.reach is None}
    assert alone == others & set(plan.schemes)
    certain = {one for one in plan.schemes if one.startswith("nh")}
    certain |= {"npt-mtk", "rigid/nvt/small", "rigid/npt/small", "shake+npt", "shake+nvt"}
    for scheme in plan.schemes.values():
        if scheme.engine:
            continue
        words = " ".join(scheme.seeded(1).commands(plan.scene))
        assert (
            f" {scheme.temperature:g} " in words and schemes.SEED not in words and "{" not in words
        )
        same = words == " ".join(scheme.seeded(2).commands(plan.scene))
        assert same == ((scheme.first or scheme.name) in certain)
        pressure = (
            "" if scheme.pressure is None else f" iso {scheme.pressure:g} {scheme.pressure:g} "
        )
        assert pressure in words and (" iso " in words) == bool(pressure)
        for dt in scheme.steps:
            lengths = Lengths(1.0)
            for steps in (*lengths.runs(dt, scheme.stride), lengths.every(dt, scheme)):
                assert steps % scheme.stride == 0
    short = plan.points(short=True)
    assert set(plan.known) <= set(short) and len(short) < len(points) / 3
    langevin = plan.schemes["rigid+langevin"] if name != "pressure" else None
    if langevin:
        printed = " ".join(plan.prints(langevin))
        assert "f_raw[1]" in printed  # not the thermostat's noise
        assert plan.points(["nh"], [3.0]) == [Point("nh", 3.0)]


def test_lengths():
    """Locks out a settled part that is sampled, and samples at other times with other steps."""
    assert Lengths(300.0).runs(6.0) == [1667, 50000] and Lengths(2.0).runs(4.0) == [50, 500]
    for dt in 1.0, 2.0, 4.0, 6.0, 8.0, 12.0:
        assert Lengths(300.0).every(dt, schemes.Scheme("x", "x", ())) * dt == 24.0
    assert Lengths(0.05).every(8.0, schemes.Scheme("x", "x", ())) == 1
    assert Lengths(300.0).every(2.0, schemes.Scheme("x", "x", (), refined=True)) == 1
    total = runs_of(planned(), None, 20.0, 2).steps([Point("csvr", 4.0)])
    assert total == 2 * (10000 + 500 + 5000)


def test_seeds_of_a_scripts_own_integrators():
    """Locks out starts that share the noise of their thermostat."""
    lines = {
        'fix 1 all python/move "fix_nosquish.NVT all molecule temp 1 1 2 seed 4928"': "4928",
        "fix own_bath {group} langevin 300 300 100 4928 tally yes": "4928",
        "fix langevin all rigid/small molecule langevin 300 300  100 77": "77",
        'fix 1 a python/move "fix_nosquish.NVT a molecule thermostat langevin seed  5 mrot 2"': "5",
    }
    for line, seed in lines.items():
        assert scenes.SEEDS.sub(r"\1SEED", line) == line.replace(seed, "SEED")
    assert scenes.SEEDS.sub(r"\1SEED", "fix 1 all nvt temp 300 300 100") == (
        "fix 1 all nvt temp 300 300 100"
    )


# ---- numbers


def printed(rng, samples=SAMPLES, **columns):
    """Columns that each scheme prints, of samples without memory, 24 fs apart."""
    alike = dict.fromkeys(("Press", "Temp", "v_torque", *DIPOLE), np.full(samples, 2.0))
    energy = -9.5 * N + 30 * rng.normal(size=samples)
    common = {"Time": 24.0 * np.arange(samples), "PotEng": energy, "Density": np.ones(samples)}
    return common | {"Volume": np.full(samples, VOLUME)} | alike | columns


def test_numbers_of_a_series():
    """Locks out a pressure that lacks the part of a total momentum that a scheme keeps at zero, a
    temperature of other degrees of freedom, fluctuations in other units, and a noise without the
    cost."""
    plan, rng = planned(), np.random.default_rng(3)
    free = {"Press": np.full(SAMPLES, N * GAS)}
    held = {"Press": np.full(SAMPLES, (N - 1) * GAS)}
    moves, turns = 1.5 * N * KT * 1.1, 1.5 * N * KT * 0.9
    both = {"c_kinetic": np.full(SAMPLES, moves + turns), "v_moves": np.full(SAMPLES, moves)}
    for name, columns in {
        "langevin-20": free, "csvr": held, "shake+langevin": free, "rigid/nvt/small": held,
    }.items():  # fmt: skip
        result = measure.of_series(printed(rng, **columns | both), plan, plan.schemes[name])
        means = {key: one.value for key, one in result.means.items()}
        assert means["pressure"] == pytest.approx(N * GAS, rel=1e-6), name
        assert means["translation"] == pytest.approx(298 * 1.1), name
        assert means["rotation"] == pytest.approx(298 * 0.9), name
        assert means["apart"] == pytest.approx(298 * 0.2), name
        assert means["capacity"] == pytest.approx(900 / KT**2 / N, rel=0.04)
        # <M^2> / (3 epsilon_0 V kT), in Gaussian units 4 pi <M^2> / (3 V kT)
        moment = 4 * np.pi * 332.06371 * 12.0 / (3 * VOLUME * KT)
        assert means["dipole"] == pytest.approx(moment) and means["torque"] == 2.0 / N
        assert not {"density", "compressibility"} & means.keys()
        assert result.remembers["potential"].value == pytest.approx(0.024, rel=0.1)
        noise = (30 / N) ** 2 * 0.024
        assert result.noise("potential").value == pytest.approx(noise, rel=0.1)
    assert of_momentum(3, 298.0, VOLUME) == pytest.approx(2.65, abs=0.01)
    few = [
        measure.of_series(printed(rng, 8), plan, plan.schemes["nh"]).means["capacity"].value
        for _ in range(2000)
    ]
    assert np.mean(few) == pytest.approx(900 / KT**2 / N, rel=0.06)  # 0.875 of it without n - 1


@pytest.mark.parametrize("pressure", [1000.0, 1250.0])
def test_compressibility_of_a_gas(pressure):
    """Locks out another unit: an ideal gas has 1/P. And a pressure that has the momentum's part,
    which a barostat does not count."""
    rng, plan = np.random.default_rng(4), planned("pressure")
    volume = KT * 68568.415 / pressure * rng.gamma(2001, size=20000)
    columns = {"Volume": volume, "Density": 15000.0 / volume}
    scheme = replace(plan.schemes["npt-mtk"], pressure=pressure)
    means = measure.of_series(printed(rng, 20000, **columns), plan, scheme).means
    result = means["compressibility"]
    assert abs(result.value - 1e5 / pressure) < 4 * result.error < 0.1 * result.value
    assert means["density"].value == pytest.approx(15000 / volume.mean(), rel=1e-3)
    assert means["pressure"].value == 2.0 and "capacity" not in means
    assert BY_KEY["pressure"].exact(plan, scheme) == pressure


@pytest.mark.parametrize("name, dof", [("water", 6 * 512), ("co2", 5 * 500)])
def test_the_kinetic_energy_is_canonical(tmp_path, name, dof):
    """Locks out a distribution of other degrees of freedom, as of linear bodies or of a total
    momentum that is kept at zero, and one of another temperature that passes."""
    plan, rng = planned(name, tmp_path), np.random.default_rng(3)

    def far(scheme, held, temperature):
        kinetic = KT / 298 * temperature / 2 * rng.chisquare(dof - held, 4000)
        columns = printed(rng, 4000, c_kinetic=kinetic, v_moves=kinetic / 2)
        return measure.of_series(columns, plan, plan.schemes[scheme]).far

    for scheme, held in ("langevin-20", 0), ("csvr", 3):
        assert far(scheme, held, plan.temperature) < 4
        assert far(scheme, held, 1.02 * plan.temperature) > 6
    assert far("rigid/nvt/small", 0, plan.temperature) is None


def found_of(plan, numbers, costs):
    """What a point gave: {point: (means, memories, variances)}, and costs in each round."""
    result = measure.Results(costs=costs)
    for point, (means, memories, variances) in numbers.items():
        exact = {key: Estimate(value, 1e-9) for key, value in means.items()}
        remembers = {key: Estimate(ps, 0.0) for key, ps in memories.items()}
        result.numbers[point] = {1: measure.Numbers(exact, remembers, variances)}
    return result


def test_rows_of_known_schemes(tmp_path):
    """Locks out a gain that is its inverse, biases and noises in other units than their bounds, and
    a sample of another average than the slowest."""
    plan, factors = planned(), {"langevin-20": -1e-4, "shake+langevin": 1e-3}
    numbers, costs, cost = {}, {}, {"langevin-20": 6.0, "shake+langevin": 10.0}
    memories = {"potential": 0.5, "torque": 3.0}
    for scheme, factor in factors.items():
        for dt in (1.0, 2.0, 4.0):
            spent = cost[scheme] / dt
            means = {"potential": -9.5 + factor * dt**2, "torque": 40 * (1 + factor * dt**2)}
            variances = {key: 1.6e-3 / spent / ps for key, ps in memories.items()}
            numbers[Point(scheme, dt)] = means, memories, variances
            costs[Point(scheme, dt)] = [0.9 * spent, spent, 2.0 * spent]
    result = found_of(plan, numbers, costs)
    told = measure.summarize(result, runs_of(plan, tmp_path), list(numbers), {})
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
        room = 2 * 0.006**2 - bias**2  # the rival's bias at 1 fs is below the bound
        seconds = row["seconds"]["potential"]
        assert seconds["value"] == (pytest.approx(1.6e-3 / room, rel=1e-3) if room > 0 else None)
    # shake takes the least time at 1 fs, where its bias is smallest
    assert told["goals"]["potential"]["dt"] == 1.0
    faster = rows["langevin-20", 4.0]["faster"]["potential"]["value"]
    room = 2 * 0.006**2
    assert faster == pytest.approx((room - 0.0016**2) / (room - 0.001**2), rel=1e-3)
    result.errors[Point("langevin-20", 4.0)] = "Lost atoms"
    lost = measure.summarize(result, runs_of(plan, tmp_path), list(numbers), {})["rows"][2]
    assert lost["error"] == "Lost atoms" and not lost["means"] and not lost["starts"]


def test_a_step_that_is_too_long():
    """Locks out a step that was meant in another unit, and ends in lost atoms after the starts."""
    planned().refuse_long((14.0, 60.0))
    with pytest.raises(SystemExit, match="--dt 200: 200 fs is too long for a step"):
        planned().refuse_long((2.0, 200.0))


def test_averages_of_another_folder(tmp_path):
    """Locks out averages of another scene, of starts that count twice, of a point that failed, and
    of a script's fix that was another one; and a sum in which they weigh differently from more
    starts of the same command."""
    plan, rng = planned(), np.random.default_rng(2)
    points = [Point("langevin-20", dt) for dt in (2.0, 4.0, 8.0)]
    drawn = {point: rng.normal(-9.5, 0.01, 6) for point in points}

    def result_of(points, starts):
        result = measure.Results()
        for point in points:
            result.numbers[point] = {
                n: measure.Numbers(
                    {"potential": Estimate(drawn[point][n], 0.01)},
                    {"potential": Estimate(0.5)},
                    {"potential": 1.0},
                )
                for n in starts
            }
        return result

    def summary(result, earlier=None):
        points = list(result.numbers)
        return measure.summarize(result, runs_of(plan, tmp_path), points, earlier or {})

    whole = summary(result_of(points, range(6)))
    before = summary(result_of(points, range(2)))
    settings = {"time": 1.0, "starts": 2}
    failed = before["rows"][0] | {"dt": 6.0, "error": "Lost atoms"}
    rows = [*before["rows"], failed]
    for scene, its in ("co2", rows), ("water", rows):
        told = json.dumps({"scene": scene, "rows": its, "settings": settings})
        (tmp_path / f"{scene}.json").write_text(told)

    def from_folder(folder=tmp_path, seed=7500, plan=plan):
        return measure.earlier_rows(folder, runs_of(plan, tmp_path, 1.0, 4, seed=seed))

    with pytest.raises(SystemExit, match="no averages of the scene water"):
        from_folder(tmp_path / "nothing")
    (tmp_path / "co2.json").rename(tmp_path / "summary.json")
    with pytest.raises(SystemExit, match="no averages of the scene water"):
        from_folder()
    (tmp_path / "water.json").rename(tmp_path / "summary.json")
    for seed in 7097, 7100, 7101:
        with pytest.raises(SystemExit, match=r"the same starts, .* another --seed") as refusal:
            from_folder(seed=seed)
        assert from_folder(seed=int(re.findall(r"such as (\d+)$", str(refusal.value))[0]))
    earlier = from_folder(seed=7102)
    assert list(earlier) == points
    parts = summary(result_of(points[1:], range(2, 6)), earlier)
    assert [row["starts"] for row in parts["rows"]] == [6, 6]
    for row, same in zip(parts["rows"], whole["rows"][1:]):
        assert row["means"]["potential"] == pytest.approx(same["means"]["potential"])
    # all of both for the points of this command, two starts for the shortest step
    weights = {dt: weight for _, dt, weight in parts["limits"]["potential"]["points"]}
    mean = {point.dt: np.mean(values[:6]) for point, values in drawn.items()}
    mean[2.0] = np.mean(drawn[points[0]][:2])
    assert sum(weights.values()) == pytest.approx(1.0) and set(weights) == {2.0, 4.0, 8.0}
    limit = sum(weight * mean[dt] for dt, weight in weights.items())
    assert parts["limits"]["potential"]["value"] == pytest.approx(limit)
    script = replace(plan, schemes={"yours": plan.schemes["langevin-20"]})
    for row in rows:
        row["scheme"] = "yours"
    told = {"scene": "water", "rows": rows, "settings": settings}
    (tmp_path / "summary.json").write_text(json.dumps(told))
    assert list(from_folder(plan=script)) == [Point("yours", dt) for dt in (2.0, 4.0, 8.0)]
    script = replace(plan, schemes={"yours": plan.schemes["nh"]})
    with pytest.raises(SystemExit, match=r"another fix of the script: .* thermostat langevin"):
        from_folder(plan=script)


def test_rows_of_engines(tmp_path):
    """Locks out an engine that is held against another limit than is told: OpenMM has the scene's
    forces, GROMACS has others."""
    plan, limits = planned(), {"langevin-20": -9.5, "openmm-langevin-5": -9.4, "gromacs-sd": -9.0}
    numbers = {
        Point(scheme, dt): (
            {"potential": value + 1e-3 * dt**2},
            {"potential": 0.5},
            {"potential": 1.0},
        )
        for scheme, value in limits.items()
        for dt in (1.0, 2.0)
    }
    told = measure.summarize(
        found_of(plan, numbers, {}), runs_of(plan, tmp_path), list(numbers), {}
    )
    for row in told["rows"]:
        off = 0.1 if row["engine"] == "OpenMM" else 0.0
        assert row["biases"]["potential"]["value"] == pytest.approx(off + 1e-3 * row["dt"] ** 2)
    assert told["others"]["GROMACS"]["potential"]["value"] == pytest.approx(-9.0)
    assert told["others"]["OpenMM"]["potential"]["value"] == pytest.approx(-9.4)


def test_rows_at_two_states(tmp_path):
    """Locks out a second state that has a bias from the first one's limit, a deviation of too few
    samples, and one of one start only."""
    plan, rng = planned("pressure"), np.random.default_rng(1)
    names, result = ("npt-langevin", "npt-langevin-400atm"), measure.Results()
    for scheme in names:
        for dt in (2.0, 6.0):
            mean = Estimate(1.0, 1e-3)
            numbers = [measure.Numbers({"density": mean}, {"density": mean}, {}) for _ in range(2)]
            for start in numbers:
                # of an ideal gas, whose distributions are exact
                pressure = 1040.0 if scheme in names[1:] else 1000.0
                volume = KT * 68568.415 / pressure * rng.gamma(2001, size=120)
                values = np.array([KT * rng.gamma(3000, size=120), volume])
                start.state = measure.structure.Sampled(298.0, pressure, values)
            result.numbers[Point(scheme, dt)] = dict(enumerate(numbers, 1))
    result.numbers[Point(names[1], 2.0)].pop(2)
    rows = measure.summarize(result, runs_of(plan, tmp_path), list(result.numbers), {})["rows"]
    first, six, few, pressed = rows
    assert first["deviation"] is six["deviation"] is few["deviation"] is None
    assert 0 <= pressed["deviation"]["value"] < 4
    assert "density" in six["biases"] and "density" not in pressed["biases"]


def test_side_by_side():
    """Locks out a speed, or a number of samples, that is its inverse or of another unit.

    By hand: 2 s of CPU time per ps are 43.2 ns/day, and an hour has 360 memories of 5 ps.
    """
    row = {
        "label": "ours",
        "dt": 8.0,
        "error": None,
        "cost": {"median": 2.0, "min": 1.8, "max": 2.4},
    }
    row |= {"remembers": {"dipole": Estimate(5.0, 0.5).plain()}}
    flat = report._flat(row, {})
    table = next(report._tables({"goals": {}}, [flat | {"lines": []}]))
    assert table.title == "Side by side"
    assert flat["speed"] == pytest.approx({"median": 43.2, "min": 36.0, "max": 48.0})
    assert flat["hourly dipole"]["value"] == pytest.approx(360.0)
    assert flat["hourly dipole"]["error"] == pytest.approx(36.0)


# ---- verdicts


def checks(
    scene="water",
    scheme="langevin-5",
    dt=6.0,
    time=20.0,
    gain=(4.1, 4.05, 4.2),
    error=1e-6,
    limit=None,
    **numbers,
):
    """The checks of one point, by part; the limit is that of a shorter step, if none is given."""
    deviation = numbers.pop("deviation", None)
    row = {
        "scheme": scheme,
        "label": "x",
        "engine": "LAMMPS",
        "ours": True,
        "error": None,
        "dt": dt,
        "starts": 2,
        "cost": {"median": 7.2},
    }
    row |= {"faster": {"potential": dict(zip(("value", "low", "high"), gain))}}
    row["deviation"] = deviation and Estimate(deviation, error).plain()
    row["biases"] = {key: Estimate(value, error).plain() for key, value in numbers.items()}
    lengths = {"time": time, "settle": 5.0}
    summary = {"scene": scene, "temperature": 298.0, "settings": lengths}
    short = row | {"scheme": "short", "dt": 2.0, "starts": 1, "cost": {"median": 14.4}}
    summary |= {"known": [{"dt": 2.0}], "rows": [row, short | {"faster": {}}]}
    limit = limit or {"points": [["short", 2.0, 1.0]]}
    summary |= {"limits": dict.fromkeys(numbers, limit)}
    summary |= {"goals": {"potential": {"label": "rigid", "dt": 2.0}}, "others": {}}
    return {check.part: check for check in criteria.checks(summary)}


def test_an_observable_gets_a_bound(monkeypatch):
    """Locks out a bound that needs an entry elsewhere, and ends in a KeyError without it."""
    monkeypatch.setitem(criteria.BOUNDS, "capacity", 2.0)
    made = checks(capacity=1.0)["bias"]
    assert (made.what, made.high, made.unit) == ("bias of the mean heat capacity", 2.0, "%")


@pytest.mark.parametrize(
    ("key", "part", "scheme", "dt", "most"),
    [
        *((key, "bias", "langevin-5", 6.0, most) for key, most in criteria.BOUNDS.items()),
        ("potential", "bias", "hmc-equal-9", 8.0, 0.004),
        ("temperature", "temperature", "csvr", 4.0, 2.98),
        ("apart", "equipartition", "langevin-5", 4.0, 1.5),
        ("apart", "equipartition", "langevin-20", 6.0, 1.0),
        ("apart", "equipartition", "npt-langevin", 6.0, 4.0),
        ("deviation", "states", "npt-langevin-308K", 6.0, 2.0),
    ],
)
def test_bounds(key, part, scheme, dt, most):
    """Locks out a bound at another place, for another sign, and a verdict where the interval
    reaches over it."""
    for sign in (1, -1) if key != "deviation" else (1,):
        for value, holds in (0.99 * sign * most, True), (1.01 * sign * most, False):
            made = checks(scheme=scheme, dt=dt, **{key: value})
            assert made[part].holds is holds and made[part].value == value
            unsure = checks(scheme=scheme, dt=dt, error=0.02 * most, **{key: value})
            assert unsure[part].holds is None


def test_what_is_not_judged():
    """Locks out verdicts on points that are too short or no longer than today's, temperatures of
    scenes without a bound, and a gain that may be less than what is asked for."""
    assert checks(potential=0.0).keys() == {"bias", "cost"}
    assert not checks(time=19.9, potential=0.0) and "bias" not in checks(dt=2.0, potential=0.0)
    assert checks("benzene", potential=0.0, apart=9.0, temperature=9.0).keys() == {"bias", "cost"}
    for gain, holds in (
        ((4.1, 4.01, 4.2), True),
        ((4.1, 3.9, 4.3), None),
        ((3.9, 3.8, 3.99), False),
        ((None, 4.5, None), None),
    ):
        assert checks(gain=gain, potential=0.0)["cost"].holds is holds


def test_a_bias_of_the_energy_as_a_temperature():
    """Locks out a heat capacity in another unit, or without its error: harmonic oscillators have
    kT/2 of energy each."""
    oscillators, k, more = 6, KT / 298.0, 1.5
    bias = {"value": oscillators / 2 * k * more, "error": 0.2 * k * more, "freedom": None}
    limits = {"capacity": {"value": oscillators / 2, "error": 0.1, "freedom": None}}
    result = observables.warmer({"potential": bias}, limits)
    rng = np.random.default_rng(3)
    drawn = rng.normal(bias["value"], bias["error"], 100000) / rng.normal(3.0, 0.1, 100000) / k
    assert result.value == pytest.approx(more, rel=1e-6)
    assert result.error == pytest.approx(drawn.std(), rel=0.03)
    assert observables.warmer({}, limits) is observables.warmer({"potential": bias}, {}) is None


# ---- runs


def test_time_that_others_had_is_no_cost(tmp_path, monkeypatch):
    """Locks out the time of a core that other processes had, and a step's time for a ps's."""
    assert plans.cost(8000.0, 50.0, 4.0) == pytest.approx(1.0)
    assert plans.cost(8000.0, None, 4.0) == pytest.approx(2.0)

    def in_turn(labels, make, number, meter):
        timing = rounds.Timing(loop=800.0, cpu=50.0)
        return {name: [timing] * number for name in labels}, {}, False

    monkeypatch.setattr(plans.rounds, "in_turn", in_turn)
    point = Point("langevin-20", 4.0)
    costs = runs_of(planned(), tmp_path).costs({point: (1, 1e-3)}, None, True)
    assert costs == {point: pytest.approx([800e-6 * 250 / 2] * plans.ROUNDS)}


def test_what_settles_is_left_out(tmp_path, monkeypatch):
    """Locks out samples of the part that is run before: of 20 and 40 steps only the second's; and
    numbers that are not finite."""
    series = printed(np.random.default_rng(4), 61, Step=np.arange(61.0))
    series["PotEng"] = np.where(series["Step"] < 20, 0.0, -N * 9.5)
    loops = [Loop(9.0, 1, 20, 3 * N, 100.0, {}), Loop(0.4, 1, 40, 3 * N, 100.0, {})]
    result = run.Result(None, series, loops, None, {}, [1], {"commands": [], "setups": []})
    monkeypatch.setattr(run, "collect", lambda directory: result)
    actual, job = measure.Results(), run.Job(str(tmp_path), "", [], [20, 40], None)
    plan = planned()
    measure._measure(actual, plan, Point("csvr", 8.0), 1, job)
    only = actual.numbers[Point("csvr", 8.0)][1]
    assert only.means["potential"].value == -9.5 and only.loop == pytest.approx(0.01)
    series["PotEng"][50] = np.nan
    measure._measure(actual, plan, Point("nh", 8.0), 1, job)
    assert actual.errors == {Point("nh", 8.0): "energy is not finite"}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """The words of a command before its schemes, its folder, and the summary that it has left."""
    folder = tmp_path_factory.mktemp("measured")
    words = ["sample", "water", "--ps", "0.05", "--out", str(folder), "--only"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plans, "ROUNDS", 1)
        patch.setattr(plans, "SECONDS", 0.02)
        status = __main__.main([*words, "langevin-20", "shake+langevin", "hmc", "--dt", "2"])
        assert status == 0
        yield words, folder, json.loads((folder / "summary.json").read_text())


@pytest.mark.timeout(300)
def test_the_verb_runs(measured):
    """Locks out a verb that fails, a number in other units, runs that are done twice, and samples
    that cost a timed run its time."""
    _, folder, summary = measured
    assert {"table.csv", "report.html", "precision.png"} <= {path.name for path in folder.iterdir()}
    assert len(summary["rows"]) == 3 and not summary["checks"]
    for row in summary["rows"]:
        assert row["error"] is None and -10 < row["means"]["potential"]["value"] < -9
        assert 30 < row["means"]["torque"]["value"] < 60 and row["cost"]["median"] > 0
        assert 200 < row["means"]["rotation"]["value"] < 400
        assert set(row["biases"]) == set(row["means"])
    logs = list(folder.rglob("log.lammps"))
    timed = [path for path in logs if plans.TIMED in path.parts]
    # a run from each point and the start; points in turn, without samples
    assert len(logs) - len(timed) == 3 + 1 and len(timed) == 3
    for path in timed:
        text = path.read_text()
        assert "c_dipole" not in text and "\nthermo 0" in text
        if "hmc" in str(path):
            steps = map(int, re.findall(r"\nrun (\d+)", text))
            assert not any(number % schemes.HYBRID for number in steps)


@pytest.mark.timeout(300)
def test_a_folder_keeps_what_there_is(measured, tmp_path, monkeypatch):
    """Locks out a folder that forgets what an earlier command has left, with fewer starts too, a
    Ctrl-C that loses it, and a start that takes all others with it."""
    words, folder, summary = measured
    once, lost = run.once, []
    done = {path: path.stat().st_mtime_ns for path in folder.rglob("log.lammps")}

    def other(job, *rest, **more):
        if "nh" in job.directory.rpartition("/")[2]:
            return run.Result("interrupted", {}, [], None, {}, interrupted=True)
        if any(f"start-{number}/start" in job.directory for number in lost):
            return run.Result("no sign of life", {}, [], None, {})
        return once(job, *rest, **more)

    monkeypatch.setattr(run, "once", other)
    assert __main__.main([*words, "nh", "--dt", "2"]) == 130
    again = json.loads((folder / "summary.json").read_text())
    assert again["interrupted"] and again["rows"] == summary["rows"]
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("log.lammps")} == done
    twice, lost[:] = [*words, "langevin-20", "--dt", "2", "--starts", "2"], [2]
    assert __main__.main(twice) == 0
    rows = json.loads((folder / "summary.json").read_text())["rows"]
    assert all(row["starts"] == 1 and not row["error"] for row in rows) and len(rows) == 3
    told = "Start 2 failed and is left out of all averages: no sign of life."
    assert told in (folder / "report.html").read_text()
    lost.clear()
    for command in twice, [*words, "langevin-20", "--dt", "2"]:
        assert __main__.main(command) == 0
        rows = json.loads((folder / "summary.json").read_text())["rows"]
        assert [row["starts"] for row in rows if row["scheme"] == "langevin-20"] == [2]
    lost[:] = 1, 2
    assert __main__.main([*twice, "--out", str(tmp_path)]) == 1
    (row,) = json.loads((tmp_path / "summary.json").read_text())["rows"]
    assert row["error"] == "all starts failed, start 1: no sign of life"


def test_translation_is_that_of_the_centres(tmp_path):
    """Locks out a kinetic energy of translation, of LAMMPS's fixes, that is not the centres': the
    same as that of the fix, which knows its bodies."""
    plan = planned()
    scheme = schemes.ours("nve", "nve", "", "NVE")
    lines = plan.prints(replace(scheme, kind="rigid"))
    more = [*lines[:-2], *run.thermo("v_moves", "f_1[1]", "f_1[2]")]
    how = {"dt": 4.0, "every": 5, "more": more, "keeps": "nothing"}
    result = run.run(run.job(plan.scene, scheme, tmp_path / "run", [20], **how))
    assert result.error is None
    actual = result.thermo
    np.testing.assert_allclose(actual["v_moves"], actual["f_1[1]"], rtol=1e-6)
    np.testing.assert_allclose(actual["KinEng"] - actual["v_moves"], actual["f_1[2]"], rtol=1e-6)
