"""What a start costs: the first use of the package, which compiles, later ones, and LAMMPS alone.

Each is a process of its own that reads the scene, defines the fix and does one step.  A copy of the
installed package without anything compiled stands for a first use.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from ..scenes import Scene
from ..scenes.integrators import Integrator
from ..statistics import measures
from . import run
from .run import Meter

PLAIN = Integrator("nve", "fix nve", ("fix 1 {group} nve",), kind="free")


def package() -> Path:
    """Folder of the fix_nosquish that LAMMPS would import, which need not be the checkout's."""
    find = "find_spec('fix_nosquish').submodule_search_locations[0]"
    code = f"from importlib.util import find_spec; print({find})"
    found = subprocess.run([sys.executable, "-c", code], cwd="/", capture_output=True, text=True)
    if found.returncode:
        raise SystemExit("fix_nosquish is not installed for this Python: pip install .")
    return Path(found.stdout.strip())


def measure(
    scene: Scene, ours: Integrator, folder: Path, ranks: int, rounds: int, meter: Meter
) -> dict:
    """Time the three kinds of start in turn; a Ctrl-C passes through.

    Args:
        folder: for the runs' files.
        ranks: MPI ranks; one rank has one core to itself, also for what a compiler does in threads.

    Returns:
        of ``first``, ``later`` and ``plain`` the spreads of ``wall`` and ``cpu`` (s, of all
        processes together), and ``first_added`` and ``later_added``, more than ``plain`` in the
        same round; ``ranks`` and ``error``.
    """
    kinds = {"first": ours, "later": ours, "plain": PLAIN}
    found: dict[str, list[tuple[float, float]]] = {kind: [] for kind in kinds}
    result: dict = {"ranks": ranks, "error": None}
    Path(folder).mkdir(parents=True, exist_ok=True)
    try:
        for number in range(1, rounds + 1):
            with tempfile.TemporaryDirectory(dir=Path(folder).resolve()) as place:
                nothing_compiled = shutil.ignore_patterns("__pycache__")
                shutil.copytree(package(), Path(place) / "fix_nosquish", ignore=nothing_compiled)
                for kind, integrator in kinds.items():
                    meter.begin(f"start: {kind}, {ranks} rank(s), {number}/{rounds}", 1)
                    found[kind].append(_start(scene, integrator, Path(place), ranks))
                    meter.end(None)
    except ChildProcessError as failure:
        result["error"] = str(failure)
        meter.end(result["error"])
    for kind, times in found.items():
        if times:
            result[kind] = _spreads(times)
        more = [(a - c, b - d) for (a, b), (c, d) in zip(times, found["plain"])]
        if more and kind != "plain":
            result[f"{kind}_added"] = _spreads(more)
    return result


def _spreads(times: list[tuple[float, float]]) -> dict:
    return dict(zip(("wall", "cpu"), map(measures.spread, zip(*times))))


def _start(scene: Scene, integrator: Integrator, place: Path, ranks: int) -> tuple[float, float]:
    """(wall, cpu) of a process that does one step; a ChildProcessError says why it did not."""
    script, said = place / "in.start", place / "stderr.txt"
    lines = *scene.setup, *integrator.commands(scene), f"timestep {scene.dt}", "run 1", ""
    script.write_text("\n".join(lines))
    lmp = Path(sys.executable).parent / "lmp"
    command = [str(lmp) if lmp.exists() else "lmp", "-in", str(script)]
    command += ["-log", "none", "-screen", "none"]
    if ranks > 1:
        command = [*run.launcher(ranks), *command]
    cache = str(place / "cache")
    own = {"PYTHONPATH": str(place), "XDG_CACHE_HOME": cache, "NUMBA_CACHE_DIR": cache}
    cores = os.sched_getaffinity(0)
    environment = {"OMP_NUM_THREADS": "1", **os.environ, **own}
    how: dict = {"stdout": subprocess.DEVNULL, "cwd": scene.folder, "env": environment}
    if ranks == 1:
        os.sched_setaffinity(0, {min(cores)})  # which the process inherits
    try:
        begin = time.perf_counter()
        with open(said, "w") as stderr, run.started(command, stderr=stderr, **how) as process:
            _, status, used = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
    finally:
        os.sched_setaffinity(0, cores)
    times = time.perf_counter() - begin, used.ru_utime + used.ru_stime
    if process.returncode:
        told = said.read_text().strip().replace("\n", " ")
        raise ChildProcessError(told[-200:] or f"exit code {process.returncode}")
    return times
