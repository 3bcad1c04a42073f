"""The experiment that all verbs are plans of: which trajectories run, and which do not."""

import multiprocessing
from pathlib import Path

from support.harness import Silent
from validation import experiment
from validation.experiment import Point, Trajectory
from validation.running import run
from validation.running.store import Store
from validation.scenes import SCENES
from validation.scenes.integrators import INTEGRATORS


def trajectory(folder, name, *, bad=False, point=None, start=""):
    """A run of the dimer for three steps; one that is ``bad`` ends with LAMMPS's message."""
    more = ["fix nothing all no_such_style"] if bad else []
    ours = INTEGRATORS["nosquish"]
    how = {"dt": 0.2, "every": 1, "keeps": "nothing", "more": more}

    def job():
        return run.job(SCENES["dimer"], ours, folder / name, [3], **how)

    return Trajectory(name, name, job, point, start)


def ladder(folder):
    """Starts, one of which fails, and a scheme that fails at its second step."""
    names = ("a", 1.0, False), ("a", 2.0, True), ("a", 3.0, False), ("b", 3.0, False)
    return [
        *(
            trajectory(
                folder,
                f"{scheme}-{dt:g}-{start}",
                bad=bad,
                point=Point(scheme, dt),
                start=f"start-{start}",
            )
            for start in (1, 2)
            for scheme, dt, bad in names
        ),
        trajectory(folder, "start-1"),
        trajectory(folder, "start-2", bad=True),
    ]


def when(folder):
    """When each run ended."""
    return {path.parent.name: path.stat().st_mtime_ns for path in folder.glob("*/job.json")}


def test_what_runs(tmp_path):
    """Locks out a run from a start that there is not, of a longer step after a failure, and one
    that is done again by the same command."""
    done = experiment.perform(ladder(tmp_path), Store(tmp_path), Silent())
    assert done.failed.keys() == {"start-2", "a-2-1"}
    assert "no_such_style" in done.failed["a-2-1"]
    assert done.left_out == {"a-3-1", "a-1-2", "a-2-2", "a-3-2", "b-3-2"}
    assert done.jobs.keys() == {"start-1", "start-2", "a-1-1", "a-2-1", "b-3-1"}
    assert when(tmp_path).keys() == done.jobs.keys()
    before = when(tmp_path)
    again = experiment.perform(ladder(tmp_path), Store(tmp_path), Silent())
    assert (again.failed, again.left_out, when(tmp_path)) == (done.failed, done.left_out, before)


def test_all_steps_where_a_failure_says_nothing_of_longer_ones(tmp_path):
    """Locks out ladders that cannot be turned off, and a judge who is not asked."""
    some = ladder(tmp_path)[:4]
    done = experiment.perform(
        some,
        Store(tmp_path),
        Silent(),
        judge=lambda result: result.error or "heats",
        ladders=False,
    )
    assert done.failed.keys() == {"a-1-1", "a-2-1", "a-3-1", "b-3-1"}
    assert done.failed["a-1-1"] == "heats"


def _share(folder):
    experiment.perform(ladder(Path(folder)), Store(folder), Silent())


def test_two_processes_do_each_run_once(tmp_path):
    """Locks out runs that two processes with the same command do twice, or in one folder at once:
    LAMMPS's logs of all have one run each. A longer step may run in one process while the other
    runs the shorter one, which fails."""
    spawn = multiprocessing.get_context("spawn")
    both = [spawn.Process(target=_share, args=(str(tmp_path),)) for _ in range(2)]
    for process in both:
        process.start()
    for process in both:
        process.join(300)
    assert [process.exitcode for process in both] == [0, 0]
    done = experiment.perform(ladder(tmp_path), Store(tmp_path), Silent())
    assert done.failed.keys() == {"start-2", "a-2-1"}
    assert when(tmp_path).keys() - {"a-3-1"} == done.jobs.keys() - {"a-3-1"}
    assert (tmp_path / "a-1-1/log.lammps").read_text().count("Loop time") == 1
