"""The loop of all claims: what is not there yet is run, then judged."""

from collections.abc import Sequence

from .. import experiment
from ..running import machine
from ..running.store import Store
from .plan import Bench, Claims, Simulation, failure, series


def names(claims: Claims, bench: Bench) -> list[str]:
    """Of all that can be asked for."""
    return [simulation.name for simulation in claims.plan(bench)] + [*claims.names(bench)]


def total(claims: Claims, bench: Bench) -> int:
    """Steps of all runs of LAMMPS together, and what is measured without them."""
    others = sum(name in bench.names for name in claims.names(bench))
    return others + sum(simulation.steps for simulation in _chosen(claims, bench))


def measure(name: str, claims: Claims, bench: Bench) -> dict:
    """Run and judge what the bench names.

    Args:
        name: of the list.

    Returns:
        plain data: the circumstances, ``claims`` (the name), ``interrupted``, ``failed`` (name of
        what should not have failed to why), and what the list's judge gives.
    """
    circumstances, simulations = machine.circumstances(), _chosen(claims, bench)
    trajectories = [simulation.trajectory(bench) for simulation in simulations]
    store = Store(bench.runs)
    done = experiment.perform(trajectories, store, bench.meter, judge=failure, ladders=False)
    bench.interrupted |= done.interrupted
    found = {
        simulation.name: series(simulation, done.jobs[simulation.name])
        for simulation in simulations
        if simulation.name in done.jobs
    }
    failed = {one.name: done.failed.get(one.name, "") for one in simulations if not one.may_fail}
    failed |= dict.fromkeys(done.left_out, "its start has failed")
    judged = claims.judge(found, bench)
    summary = circumstances | {"claims": name, "interrupted": bench.interrupted} | judged
    failed |= judged.get("failed", {})
    return summary | {"failed": {name: why for name, why in failed.items() if why}}


def _chosen(claims: Claims, bench: Bench) -> Sequence[Simulation]:
    """The simulations that are asked for, and those that make their starts."""
    every = claims.plan(bench)
    starts = {one.start[0] for one in every if one.start and one.name in bench.names}
    return [one for one in every if one.name in starts.union(bench.names)]


def wrong(claims: Claims, summary: dict) -> bool:
    """Whether something has failed, or a claim of ours does not hold, or was not measured."""
    lost = [check for check in summary["checks"] if check["verdict"] == "does not hold"]
    missing = [check for check in summary["checks"] if check["value"] is None]
    return bool(summary["failed"] or (claims.ours and (lost or missing)))
