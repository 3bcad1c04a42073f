"""What an engine is: it runs a scene's water at constant temperature, and gives two series."""

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from errno import ENOSPC
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..running import run as running
from .water import Water

KJ, NM, BAR = 4.184, 0.1, 1 / 1.01325  # kJ/mol in a kcal/mol, nm in an Angstrom, atm in a bar
# signals by which a process ends itself, as where atoms are beyond all bounds
OWN = signal.SIGSEGV, signal.SIGFPE, signal.SIGABRT, signal.SIGBUS
OUTPUT = "output.txt"  # of a run: all that its processes say
MESSAGES = r"Fatal error:\n(.+?)\n\n", r"^ERROR: ([^\n]+)", r"^(\w*(?:Error|Exception)\b[^\n]*)"


@dataclass(frozen=True)
class Course:
    """A run.

    Attributes:
        thermostat: the engine's word.
        temperature: K.
        friction: 1/ps; of a thermostat that scales velocities the inverse of its time.
        dt: fs.
        steps: all of them, and ``every``, steps between samples.
        seed: of random numbers.
    """

    thermostat: str
    temperature: float
    friction: float
    dt: float
    steps: int
    every: int
    seed: int


class Samples(NamedTuple):
    """Of each sample its step, the potential energy, kcal/mol, and the pressure, atm; and s of the
    whole run by the clock."""

    step: np.ndarray
    potential: np.ndarray
    pressure: np.ndarray
    seconds: float


class Failed(Exception):
    """A run has ended before its end; ``lasts`` is False where it was not by what it is."""

    def __init__(self, message: str, lasts: bool = True) -> None:
        super().__init__(running.one_line(message))
        self.lasts = lasts and os.strerror(ENOSPC) not in message


@dataclass(frozen=True)
class Engine:
    """An engine.

    Attributes:
        name: as it calls itself.
        install: how to get it.
        version: of the one that is here; None if there is none.
        inputs: of a course of a water the files that it is given, by name.
        words: of the same what the page says of it, lines.
        run: does that course in the folder that has these files.  A run that says nothing for some
            s counts as hung; the last argument is called with steps that are done.  Raises
            `Failed`.
    """

    name: str
    install: str
    version: Callable[[], str | None]
    inputs: Callable[[Course, Water], dict[str, str]]
    words: Callable[[Course, Water], list[str]]
    run: Callable[[Course, Path, float, Callable[[int], object]], Samples]


def wait(
    words: Sequence[str],
    folder: Path,
    silence: float = 60.0,
    on_step: Callable[[int], object] = lambda step: None,
    log: str = OUTPUT,
    **more,
) -> float:
    """Run a command in a folder on one core to its end, and give its s by the clock; a Ctrl-C ends
    it.  What it says is added to `OUTPUT`.

    Args:
        silence: s without a word in the log after which it counts as hung.
        log: file of the folder whose lines begin with steps.
        more: keywords of Popen.

    Raises:
        Failed: it hung, or its status is another than 0.
    """
    begin, output = time.monotonic(), folder / OUTPUT
    how: dict = {"cwd": folder, "env": {**os.environ, "OMP_NUM_THREADS": "1"}, **more}
    with (
        open(output, "a") as file,
        running.started(words, stdout=file, stderr=subprocess.STDOUT, **how) as process,
    ):
        if running.watch(process, folder / log, silence, on_step):
            raise Failed(f"{running.HUNG} for {silence:g} s, ended")
    status = process.returncode
    if status:
        said = message(output.read_text(errors="replace"), status)
        raise Failed(said, lasts=status > 0 or -status in OWN)
    return time.monotonic() - begin


def message(text: str, status: int) -> str:
    """Why a command ended, from what it said and its status."""
    for pattern in MESSAGES:
        if found := re.search(pattern, text, re.M | re.S):
            return found.group(1)
    ended = f"signal {signal.Signals(-status).name}" if status < 0 else f"status {status}"
    return f"ended without a message, by {ended}"
