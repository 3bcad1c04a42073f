"""What a start costs: the first use of the package, which compiles, later ones, and LAMMPS alone.

Each is a process of its own that reads the scene, defines the fix and does one step.  A copy of the installed
package without anything compiled stands for a first use.
"""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

from validation import measures, run
from validation.integrators import Integrator

PLAIN = Integrator("nve", "fix nve", ("fix 1 {group} nve",), kind="free")


def package():
    """Folder of the fix_nosquish that LAMMPS would import, which need not be the checkout's."""
    code = "import importlib.util as u; print(u.find_spec('fix_nosquish').submodule_search_locations[0])"
    found = subprocess.run([sys.executable, "-c", code], cwd="/", capture_output=True, text=True)
    if found.returncode:
        raise SystemExit("fix_nosquish is not installed for this Python: pip install .")
    return Path(found.stdout.strip())


def measure(scene, ours, folder, ranks, rounds, meter):
    """Time the three kinds of start in turn; a Ctrl-C passes through.

    Args:
        scene: a ``Scene``.
        ours: the ``Integrator``.
        folder: for the runs' files.
        ranks: MPI ranks; one rank has one core to itself, also for what a compiler does in threads.
        meter: a ``console.Meter``.

    Returns:
        dict: of ``first``, ``later`` and ``plain`` the spreads of ``wall`` and ``cpu`` (s, of all processes
        together), and ``first_added`` and ``later_added``: wall and cpu more than ``plain`` in the same round; ``error``.
    """
    folder = Path(folder).resolve()
    found = {"first": [], "later": [], "plain": []}
    error = None
    for number in range(1, rounds + 1):
        place = folder / f"{ranks}-{number}"
        shutil.rmtree(place, ignore_errors=True)
        shutil.copytree(
            package(), place / "fix_nosquish", ignore=shutil.ignore_patterns("__pycache__")
        )
        environment = {
            "PYTHONPATH": str(place),
            "XDG_CACHE_HOME": str(place / "cache"),
            "NUMBA_CACHE_DIR": str(place / "cache"),
        }
        for kind in found:
            meter.begin(f"start: {kind}, {ranks} rank(s), {number}/{rounds}", 1)
            wall, cpu, error = _start(
                scene, PLAIN if kind == "plain" else ours, place, ranks, environment
            )
            meter.end(error)
            if error:
                break
            found[kind].append({"wall": wall, "cpu": cpu})
        shutil.rmtree(place, ignore_errors=True)
        if error:
            break
    result = {"ranks": ranks, "error": error}
    for kind, times in found.items():
        if times:
            result[kind] = {
                key: measures.spread(one[key] for one in times) for key in ("wall", "cpu")
            }
            pairs = list(zip(times, found["plain"]))
            if kind != "plain" and pairs:
                result[f"{kind}_added"] = {
                    key: measures.spread(a[key] - b[key] for a, b in pairs)
                    for key in ("wall", "cpu")
                }
    return result


def _start(scene, integrator, place, ranks, environment):
    """(wall, cpu, error) of a process that does one step."""
    script = place / "in.start"
    script.write_text(
        "\n".join([*scene.setup, *integrator.commands(scene), f"timestep {scene.dt}", "run 1", ""])
    )
    lmp = Path(sys.executable).parent / "lmp"
    command = [
        str(lmp) if lmp.exists() else "lmp",
        "-in",
        str(script),
        "-log",
        "none",
        "-screen",
        "none",
    ]
    if ranks > 1:
        command = [run.mpirun(), "-np", str(ranks), *command]
    core = min(os.sched_getaffinity(0))
    begin = time.perf_counter()
    process = subprocess.Popen(
        command, cwd=scene.folder, env={"OMP_NUM_THREADS": "1", **os.environ, **environment}, stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, stderr=open(place / "stderr.txt", "w"), start_new_session=True,
        preexec_fn=(lambda: os.sched_setaffinity(0, {core})) if ranks == 1 else None,
    )  # fmt: skip
    try:
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    finally:
        run.end(process)
    wall = time.perf_counter() - begin
    error = None
    if process.returncode:
        error = (place / "stderr.txt").read_text().strip().replace("\n", " ")[
            -200:
        ] or f"exit code {process.returncode}"
    return wall, used.ru_utime + used.ru_stime, error
