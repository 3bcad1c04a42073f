"""The cost of a start, beside that of LAMMPS alone.

Each is one process that reads the scene, defines the fix and does one step.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

from ..scenes import Scene
from ..scenes.integrators import Integrator
from ..statistics import measures
from . import run
from .run import Meter

PLAIN = Integrator("nve", "fix nve", ("fix 1 {group} nve",), kind="free")


def package() -> Path:
    """Folder of the fix_nosquish that LAMMPS imports; it may differ from the checkout's."""
    code = (
        "from importlib.util import find_spec; "
        "print(find_spec('fix_nosquish').submodule_search_locations[0])"
    )
    process = subprocess.run([sys.executable, "-c", code], cwd="/", capture_output=True, text=True)
    if process.returncode:
        raise SystemExit("fix_nosquish is not installed for this Python: pip install .")
    return Path(process.stdout.strip())


def measure(
    scene: Scene, ours: Integrator, folder: Path, ranks: int, rounds: int, meter: Meter
) -> dict:
    """Time starts with our fix and with fix nve in turn; Ctrl-C raises KeyboardInterrupt.

    A start before these does what is done once: it compiles loops that are in no library.

    Args:
        folder: for the files of the runs.
        ranks: MPI ranks; a single rank runs on one core, including threads of a compiler.

    Returns:
        spreads of ``wall`` and ``cpu`` (s, all processes together) of ``ours``, of ``plain`` (fix
        nve) and of ``added`` (their difference in the same round); ``ranks``, ``error``.
    """
    times: dict[str, list[tuple[float, float]]] = {"ours": [], "plain": []}
    folder.mkdir(parents=True, exist_ok=True)
    error = None
    try:
        for number in range(rounds + 1):
            for kind, integrator in (("ours", ours), ("plain", PLAIN)):
                meter.begin(f"start: {kind}, {ranks} rank(s), {number}/{rounds}", 1)
                times[kind].append(_start(scene, integrator, folder.resolve(), ranks))
                meter.end(None)
    except ChildProcessError as failure:
        error = str(failure)
        meter.end(error)
    times["added"] = [
        (wall - plain, cpu - other)
        for (wall, cpu), (plain, other) in zip(times["ours"], times["plain"])
    ]
    spreads = {
        kind: dict(zip(("wall", "cpu"), map(measures.spread, zip(*starts[1:]))))
        for kind, starts in times.items()
        if starts[1:]
    }
    return {"ranks": ranks, "error": error} | spreads


def _start(scene: Scene, integrator: Integrator, place: Path, ranks: int) -> tuple[float, float]:
    """(wall, cpu) of a process that does one step.

    Raises:
        ChildProcessError: it failed.
    """
    script, errors = place / "in.start", place / "stderr.txt"
    commands = *scene.setup, *integrator.commands(scene), f"timestep {scene.dt}", "run 1", ""
    script.write_text("\n".join(commands))
    lmp = Path(sys.executable).parent / "lmp"
    command = [
        *(str(lmp) if lmp.exists() else "lmp", "-in", str(script)),
        *("-log", "none", "-screen", "none"),
    ]
    if ranks > 1:
        command = [*run.launcher(ranks), *command]
    cores, environment = os.sched_getaffinity(0), {"OMP_NUM_THREADS": "1", **os.environ}
    how: dict = {"stdout": subprocess.DEVNULL, "cwd": scene.folder, "env": environment}
    if ranks == 1:
        os.sched_setaffinity(0, {min(cores)})  # which the process inherits
    try:
        begin = time.perf_counter()
        with open(errors, "w") as stderr, run.started(command, stderr=stderr, **how) as process:
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
    finally:
        os.sched_setaffinity(0, cores)
    times = time.perf_counter() - begin, used.ru_utime + used.ru_stime
    if process.returncode:
        message = errors.read_text().strip().replace("\n", " ")
        raise ChildProcessError(message[-200:] or f"exit code {process.returncode}")
    return times
