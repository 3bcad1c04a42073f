"""A script's runs timed in turn, without samples.

They are done once by all processes of a folder, and kept.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..own.system import Own
from ..running import machine, rounds, run
from ..running.store import Store
from ..scenes.integrators import Integrator


@dataclass(frozen=True)
class Timed:
    """What is timed: an integrator with a step, in ``runs`` as `rounds.lengths` has them, with
    ``more`` LAMMPS commands before them."""

    label: str
    integrator: Integrator
    dt: float
    runs: list[int]
    more: tuple[str, ...] = ()


def loops(
    own: Own,
    what: str,
    some: Mapping[str, Timed],
    number: int,
    out: Path,
    ranks: int,
    silence: float,
    meter: run.Meter,
) -> dict[str, list[float]]:
    """s of a step by the clock, of each round; of one that fails those before it.

    Args:
        what: name of the record, and of the folder of the runs.
        some: by name.
        number: of rounds.

    Raises:
        KeyboardInterrupt: after a Ctrl-C.
    """

    def make(name: str, turn: int) -> run.Job:
        one = some[name]
        how: dict = {"ranks": ranks, "silence": silence, "keeps": "nothing", "more": one.more}
        how |= {"dt": one.dt, "every": 0, "origin": machine.origin(own.scene, one.integrator)}
        folder = out / "runs" / what / f"{name}-{turn}"
        return run.job(own.scene, one.integrator, folder, one.runs, **how)

    def measure() -> dict:
        labels = {name: one.label for name, one in some.items()}
        found, _, interrupted = rounds.in_turn(labels, make, number, meter)
        if interrupted:
            raise KeyboardInterrupt
        return {name: [1e-6 * (one.loop or 0.0) for one in times] for name, times in found.items()}

    jobs = [(name, make(name, 0)) for name in some]
    known = [[name, job.commands, job.runs, job.origin] for name, job in jobs]
    store = Store(out / "records", __name__)
    with store.locked(what):
        return store.once(what, store.origin(number, ranks, known), measure)
