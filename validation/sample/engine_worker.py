"""A run of an engine other than LAMMPS, as a separate process: ``python engine_worker.py JOB``.

The job is that of ``running/run.py``, and the files beside it are those of ``running/worker.py``:

log.lammps      a thermodynamic table with LAMMPS's columns and units, and the time it took
done.json       the engine's version; written last, so its presence means success
error.txt       why it failed; begins with ERROR if the engine reports it
"""

import json
import sys
import time
import traceback
from importlib import import_module
from pathlib import Path

COLUMNS = "Step Time PotEng Press Volume"


def work(job: dict, folder: Path) -> None:
    """Do the job in the folder, and write its files there."""
    harness = Path(__file__).resolve().parents[1]
    sys.path[0] = str(harness.parent)  # instead of this file's folder
    data, log = job["input"], folder / "log.lammps"
    engine, begin = import_module(f"{harness.name}.sample.{data['module']}"), 0.0
    for number, (step, potential, pressure) in enumerate(engine.samples(data, folder)):
        begin = begin or time.perf_counter()  # of the steps
        values = step * data["dt"], potential, pressure, data["volume"]
        line = f"{step} " + " ".join(f"{value:.15g}" for value in values) + "\n"
        # before the first sample there may be the engine's own log
        with open(log, "a" if number else "w") as file:
            file.write(line if number else f"{COLUMNS}\n{line}")
    seconds, size = time.perf_counter() - begin, f"{data['atoms']} atoms"
    if engine.ENGINE.seconds:
        seconds = engine.ENGINE.seconds(folder)
    with open(log, "a") as file:
        file.write(f"Loop time of {seconds} on 1 procs for {step} steps with {size}\n")
    json_files = import_module(f"{harness.name}.running.json_files")
    json_files.write(folder / "done.json", {engine.ENGINE.name: engine.version()})


def main() -> None:
    path = Path(sys.argv[1])
    try:
        work(json.loads(path.read_text()), path.parent)
    except BaseException as failure:
        traceback.print_exc()
        (path.parent / "error.txt").write_text(f"{failure}" or type(failure).__name__)
        sys.exit(1)


if __name__ == "__main__":
    main()
