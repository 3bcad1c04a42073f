"""Start a LAMMPS run in its own process group, watch it, and collect its result.

A crash, a hang or a bad command ends that run only: its ``Result`` says why.
"""

import contextlib
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from errno import ENOSPC
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from ..scenes import Scene
from ..scenes.integrators import Integrator
from ..statistics.positions import Positions
from . import json_files, lammps_log, recorder
from .lock import locked

WORKER = Path(__file__).with_name("worker.py")
END_WITH_PARENT = Path(__file__).with_name("end_with_parent.py")
RESET = "reset_timestep 0"  # in a scene's setup if its fixes forbid it later
SUFFIX = "nosquish"  # with which LAMMPS replaces its rigid fixes by ours
THERMO = "thermo_style custom step time temp press pe ke etotal"
LOOK = 0.2  # s between two looks at a running job
COMPILING, COMPILES = 600.0, " compiles its loops, once"  # s of a first use, and its message
HUNG = "no sign of life"  # beginning of the message of a run that hung
GRACE = 5.0  # s that processes have to end after SIGTERM
AGAIN = 0.5  # s in which further signals count as the same one


class Meter(Protocol):
    """Shows progress: ``pages.console.Meter``, or a silent one."""

    def begin(self, label: str, total: int) -> None: ...

    def at(self, step: float) -> None: ...

    def end(self, error: str | None) -> None: ...


@dataclass(frozen=True)
class Job:
    """One trajectory.

    Attributes:
        directory: for its files; those of an earlier run are removed.
        folder: working directory of LAMMPS.
        commands: LAMMPS commands before the first run.
        runs: numbers of steps; positions are kept at the start and after each.
        body_property: per-atom integer that identifies bodies; None keeps no positions.
        setups: number of timed `run 0`, all preparations of a run, before the runs.
        ranks: number of MPI ranks.
        silence: s without output in the log after which the run counts as hung.
        origin: hash of what else the result depends on (see ``machine.origin``).
        motion: whether velocities and masses are kept with the positions.
        overlay: see ``Scene``; what the run writes goes into its own overlay.
        worker: path of its worker in the harness; empty for that of LAMMPS.
        input: of another worker, plain data.
        benchmark: numbers of steps of runs after these, without output, which are timed only.
    """

    directory: str
    folder: str
    commands: list[str]
    runs: list[int]
    body_property: str | None
    setups: int = 0
    ranks: int = 1
    silence: float = field(default=120.0, compare=False)  # the result does not depend on it
    origin: str | None = None
    motion: bool = False
    overlay: str = ""
    worker: str = ""
    input: dict = field(default_factory=dict)
    benchmark: list[int] = field(default_factory=list)


@dataclass
class Result:
    """The result of a run, complete or not.

    Attributes:
        error: one line on why the run is not complete; None if it is.
        thermo: column name to array (see ``lammps_log.thermo``).
        timings: of each completed run.  benchmark: of those after them (see ``Job``).
        positions: None if they were not kept.
        versions: of the worker, or {}.
        memory: peak memory of each rank in KiB.
        seconds: wall time of each `run 0` and of each run (see ``worker``).
        interrupted: whether Ctrl-C was pressed.
    """

    error: str | None
    thermo: dict[str, np.ndarray]
    timings: list[lammps_log.Loop]
    positions: Positions | None
    versions: dict[str, str]
    memory: list[int] = field(default_factory=list)
    seconds: dict[str, list[float]] = field(default_factory=dict)
    interrupted: bool = False
    benchmark: list[lammps_log.Loop] = field(default_factory=list)


def job(
    scene: Scene,
    integrator: Integrator,
    directory: Path | str,
    runs: list[int],
    *,
    dt: float,
    every: int,
    ranks: int = 1,
    silence: float = 120.0,
    keeps: Literal["nothing", "positions", "motion"] = "positions",
    setups: int = 0,
    more: Sequence[str] = (),
    origin: str | None = None,
) -> Job:
    """The job of one integrator on a scene.

    Args:
        runs: numbers of steps, done one after the other.
        dt: time step in the scene's units.
        every: steps between thermo samples; 0 samples the ends of each run only.
        keeps: what to store of the atoms at the start and after each run; see ``Job.motion``.
        setups, origin: see ``Job``.
        more: LAMMPS commands before the first run.
    """
    reach = integrator.whole_bodies and scene.ghost_cutoff
    ours = integrator.kind == "ours"
    commands = [
        *scene.setup,
        *([f"comm_modify cutoff {reach}"] if reach else []),
        *([] if RESET in scene.setup else [RESET]),
        f"timestep {dt}",
        *(scene.others if integrator.kind != "free" else []),
        *integrator.commands(scene),
        *scene.then,
        *integrator.then,
        *thermo(*scene.columns),
        *scene.output,
        f"thermo {every}",
        *more,
    ]
    return Job(
        directory=str(directory),
        folder=str(scene.folder),
        commands=commands if ours else [without_suffix(line) for line in commands],
        runs=list(runs),
        body_property=None if keeps == "nothing" else scene.body_property,
        setups=setups,
        ranks=ranks,
        silence=silence,
        origin=origin,
        motion=keeps == "motion",
        overlay=scene.overlay,
    )


def without_suffix(line: str) -> str:
    """The command without the suffix nosquish, with which LAMMPS would replace its own fixes."""
    names = line.split()[1:]
    if not line.startswith("suffix ") or SUFFIX not in names:
        return line
    others = [name for name in names if name not in ("hybrid", SUFFIX)]
    return f"suffix {others[0] if others else 'none'}"  # not off: the script may switch it on again


def no_number(thermo: Mapping[str, np.ndarray]) -> str | None:
    """The first step at which a quantity is NaN, in words; None if there is none.  LAMMPS goes
    on."""
    bad = {name: ~np.isfinite(values) for name, values in thermo.items()}
    first = min((int(mask.argmax()) for mask in bad.values() if mask.any()), default=None)
    if first is None:
        return None
    names = ", ".join(name for name, mask in bad.items() if mask[first])
    return f"no number from step {thermo['Step'][first]:.0f} on: {names}"


def thermo(*more) -> list[str]:
    """LAMMPS commands for the standard columns of the output, and these."""
    return [" ".join((THERMO, *more)), 'thermo_modify norm no flush yes format float "%.15g"']


def folder_name(name: str) -> str:
    """The name of an integrator or a run as that of a folder."""
    return re.sub(r"[/ ]", "-", name)


def run(
    job: Job,
    on_step: Callable[[int], object] = lambda step: None,
    environment: Mapping[str, str] | None = None,
) -> Result:
    """Do a job and collect its result; Ctrl-C ends the run, and is noted in the result.

    Args:
        on_step: called now and then with the last step in the log.
        environment: further environment variables of the ranks.
    """
    directory = Path(job.directory)
    if (directory / "job.json").exists():
        _empty(directory)
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / "job.json"
    json_files.write(path, asdict(job))
    interrupted = False
    worker = WORKER.parents[1] / job.worker if job.worker else WORKER
    words = [*launcher(job.ranks), sys.executable, str(worker), str(path.resolve())]
    how = {"OMP_NUM_THREADS": "1", **os.environ, **(environment or {})}
    how |= recorder.environment(job.overlay, directory / "overlay", how.get("LD_PRELOAD"))
    with open(directory / "output.txt", "w") as output:
        try:
            with started(words, stdout=output, stderr=subprocess.STDOUT, env=how) as process:
                if watch(process, directory / "log.lammps", job.silence, on_step):
                    (directory / "error.txt").write_text(f"{HUNG} for {job.silence:g} s, ended")
        except KeyboardInterrupt:
            interrupted = True
    result = collect(directory)
    if interrupted:  # if it was complete all the same, the next command finds it
        result.error, result.interrupted = INTERRUPTED, True
    return result


def once(
    job: Job, on_step: Callable[[int], object] = lambda step: None, failures: bool = False
) -> Result:
    """Do a job, unless the complete result of the same job with the same origin exists.

    Waits for another process that works in its directory.

    Args:
        on_step: see `run`.  failures: see `is_there`.
    """
    try:
        with locked(Path(job.directory) / LOCK):
            return collect(job.directory) if is_there(job, failures) else run(job, on_step)
    except KeyboardInterrupt:  # while waiting
        return replace(collect(job.directory), error=INTERRUPTED, interrupted=True)


def _empty(directory: Path) -> None:
    """Remove the files of a run except the lock, for which another process may wait."""
    for path in directory.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.name != LOCK:
            path.unlink()


def is_there(job: Job, failures: bool = False) -> bool:
    """Whether the complete result of the same job with the same origin is in its directory.

    Args:
        failures: whether a run that LAMMPS or a fix ended with a message, or that hung for at
            least ``job.silence``, counts as complete.  A run that was killed does not, nor one
            that the machine ended, for example by a full disk.
    """
    directory = Path(job.directory)
    known = _stored_job(directory)
    if known is None:
        return False
    failed = failures and _lasts(directory) and known.silence >= job.silence
    return known == job and (failed or json_files.read(directory / "done.json") is not None)


def _stored_job(directory: Path) -> Job | None:
    """The job whose files are in a directory; None without a job of this version."""
    path = directory / "job.json"
    plain = json_files.read(path)
    try:
        return None if plain is None else Job(**plain)
    except TypeError as error:
        json_files.report_damage(path, error)
        return None


def _lasts(directory: Path) -> bool:
    """Whether a run would fail again: LAMMPS or a fix has ended it, or it hung."""
    message = _read(directory / "error.txt")
    return bool(re.match(rf"'?ERROR|{HUNG}", message)) and os.strerror(ENOSPC) not in message


INTERRUPTED, LOCK = "interrupted", "lock"


def collect(directory: Path | str) -> Result:
    """The result in a job's directory, complete or not."""
    directory = Path(directory)
    log = _read(directory / "log.lammps")
    output = _read(directory / "output.txt")
    positions = None
    if (directory / "positions.npz").exists():
        with np.load(directory / "positions.npz") as file:
            positions = Positions(**file)
    done = json_files.read(directory / "done.json")
    message = (
        _read(directory / "error.txt")
        or lammps_log.error(log)
        or lammps_log.error(output)
        or f"ended without a message: {_exit(output)}, see {directory / 'output.txt'}"
    )
    facts = dict(done or {})
    return Result(
        error=one_line(message) if done is None else None,
        thermo=lammps_log.thermo(log),
        timings=lammps_log.timings(log),
        positions=positions,
        memory=facts.pop("memory", []),
        seconds=facts.pop("seconds", {}),
        versions=facts,
        benchmark=lammps_log.timings(_read(directory / "benchmark.lammps")),
    )


def watch(
    process: subprocess.Popen,
    log: Path,
    silence: float,
    on_step: Callable[[int], object] = lambda step: None,
) -> bool:
    """Wait for the end; True if the run counts as hung.

    Time is counted in looks, not by the clock: a run that was suspended together with this process
    is not hung when both continue.
    """
    size, quiet, waited = 0, 0.0, 0.0
    while process.poll() is None:
        time.sleep(LOOK)
        now = log.stat().st_size if log.exists() else 0
        if now != size:
            with open(log, "rb") as file:
                file.seek(max(0, now - 400))
                last = re.findall(rb"^ *(\d+) .*\n", file.read(), re.M)
            size, quiet = now, 0.0
            if last:
                on_step(int(last[-1]))
        else:
            quiet += LOOK
            if quiet > silence:
                if waited > COMPILING or not _is_compiling(log):
                    return True
                waited, quiet = waited + quiet, 0.0
    return False


def _is_compiling(log: Path) -> bool:
    """Whether our fix is compiling its loops, in the run with this log."""
    return COMPILES in _read(log.with_name("output.txt")).rstrip().rpartition("\n")[2]


@contextlib.contextmanager
def started(words: Sequence[str], **more) -> Iterator[subprocess.Popen]:
    """A process in its own group, which ends with the block and with this process.

    Ctrl-C, and the signals that count as one (see ``validation.__main__``), raise one
    KeyboardInterrupt in the block or after it.  They are held back while the process starts, while
    it is ended, and for `AGAIN` afterwards, so that its result is written.

    Args:
        more: keywords of Popen.
    """
    stop = _Stop()
    handled = [number for number in signal.valid_signals()
             if signal.getsignal(number) is signal.default_int_handler]  # fmt: skip
    for number in handled:
        signal.signal(number, stop)
    try:
        how: dict = {
            "stdin": subprocess.DEVNULL,
            "start_new_session": True,
        }
        parent = sys.executable, "-IS", str(END_WITH_PARENT), str(os.getpid())
        process = subprocess.Popen([*parent, *words], **how | more)
        try:
            try:
                stop.open()
                yield process
            finally:
                stop.raises = False
        finally:
            end(process)
    finally:
        if stop.came:
            time.sleep(AGAIN)
        for number in handled:
            signal.signal(number, signal.default_int_handler)
    if stop.waits:
        raise KeyboardInterrupt


class _Stop:
    """A signal handler that raises KeyboardInterrupt once while it is open, and else defers it."""

    def __init__(self) -> None:
        self.came = self.raises = self.waits = False

    def __call__(self, *_) -> None:
        self.came = True
        if self.raises:
            self.raises = False
            raise KeyboardInterrupt
        self.waits = True

    def open(self) -> None:
        """Raise from now on; a deferred signal raises at once."""
        self.raises = True
        if self.waits:
            self()


def end(process: subprocess.Popen) -> None:
    """End all processes of the group."""
    for sign, grace in ((signal.SIGTERM, GRACE), (signal.SIGKILL, GRACE)):
        try:
            os.killpg(process.pid, sign)
        except ProcessLookupError:
            break
        try:
            process.wait(grace)
        except subprocess.TimeoutExpired:
            continue
    process.wait()


def launch_by(command: str | None) -> None:
    """Start ranks by this command from now on, such as ``srun -n {ranks}``; None is mpirun."""
    global _launch
    _launch = command


_launch: str | None = None


def launcher(ranks: int) -> list[str]:
    """The words before a command that start it on this number of ranks."""
    if _launch is None:
        return [mpirun(), "-np", str(ranks)]
    return [word.replace("{ranks}", str(ranks)) for word in shlex.split(_launch)]


def mpirun() -> str:
    """mpirun of this interpreter's environment, else the one on PATH."""
    beside = Path(sys.executable).parent / "mpirun"
    program = str(beside) if beside.exists() else shutil.which("mpirun")
    if not program:
        raise SystemExit("no mpirun beside this Python and none on PATH: pip install mpich")
    return program


def _exit(output):
    """How a rank has ended, from mpirun's message."""
    match = re.search(r"EXIT STRING: (.+?) *$|EXIT CODE: (\d+)", output, re.M)
    return (match.group(1) or f"exit code {match.group(2)}") if match else "cause unknown"


def _read(path):
    return path.read_text(errors="replace") if path.exists() else ""


def one_line(message: str) -> str:
    """A message without line breaks and without LAMMPS's row of ^^^^ under a word."""
    return " ".join(word for word in message.split() if set(word) != {"^"})
