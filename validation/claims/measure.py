"""The loop of all claims: run what has no result yet, then judge."""

from collections.abc import Sequence

from .. import experiment
from ..running import machine
from ..running.store import Store
from .plan import Bench, Claims, Simulation, failure, series


def total(claims: Claims, bench: Bench) -> int:
    """The number of steps of all runs together."""
    return sum(simulation.steps for simulation in _chosen(claims, bench))


def measure(name: str, claims: Claims, bench: Bench) -> dict:
    """Run and judge the simulations that the bench names.

    Args:
        name: of the list.

    Returns:
        plain data: circumstances, ``claims`` (the name), ``interrupted``, ``failed`` (reasons by
        name, for simulations that should not fail), and the result of the list's judge.
    """
    circumstances, simulations = machine.circumstances(), _chosen(claims, bench)
    done = experiment.perform(
        [simulation.trajectory(bench) for simulation in simulations],
        Store(bench.runs),
        bench.meter,
        judge=failure,
        ladders=False,
    )
    outputs = {
        simulation.name: series(simulation, done.jobs[simulation.name])
        for simulation in simulations
        if simulation.name in done.jobs
    }
    failed = {
        simulation.name: done.failed.get(simulation.name, "")
        for simulation in simulations
        if not simulation.may_fail
    }
    failed |= dict.fromkeys(done.left_out, "its start has failed")
    failed = {failing: why for failing, why in failed.items() if why}
    return {
        **circumstances,
        "claims": name,
        "interrupted": done.interrupted,
        "failed": failed,
        **claims.judge(outputs, bench),
    }


def _chosen(claims: Claims, bench: Bench) -> Sequence[Simulation]:
    """The requested simulations, and those that create their starts."""
    every = claims.plan(bench)
    starts = {
        simulation.start[0]
        for simulation in every
        if simulation.start and simulation.name in bench.names
    }
    return [simulation for simulation in every if simulation.name in starts.union(bench.names)]


def wrong(claims: Claims, summary: dict) -> bool:
    """Whether something has failed, or a claim of ours does not hold or was not measured."""
    lost = [check for check in summary["checks"] if check["verdict"] == "does not hold"]
    missing = [check for check in summary["checks"] if check["value"] is None]
    return bool(summary["failed"] or (claims.ours and (lost or missing)))
