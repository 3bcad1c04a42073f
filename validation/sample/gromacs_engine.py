"""GROMACS: leap-frog with SETTLE, thermostats sd and v-rescale.

Its Lennard-Jones force switch is the scene's.  With the Verlet scheme it has neither shifted
Coulomb forces nor user-defined tables, so its Coulomb forces differ from the scene's: they end with
a reaction field of infinite permittivity, where the force is zero but not its slope.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..running import run
from . import engine
from .engine import BAR, KJ, NM, Engine, EngineRun, Failed, Sample, Water
from .schemes import Scheme

GMX = "gmx"
ENERGIES, LOG = "energies.xvg", "run.log"  # the log of mdrun -deffnm run
# signals by which a process ends itself, for example if atoms are far outside the box
OWN = signal.SIGSEGV, signal.SIGFPE, signal.SIGABRT, signal.SIGBUS
LIST_STEPS, TOLERANCE = 10, 1e-4  # steps between pair lists; buffer tolerance, kJ/mol/ps per atom
LOGGED = 100  # number of log entries, about
SETTINGS = """\
integrator              = {integrator}
dt                      = {dt!r}
nsteps                  = {steps}
nstcalcenergy           = {every}
nstenergy               = {every}
nstlog                  = {log}
cutoff-scheme           = Verlet
nstlist                 = {list_steps}
verlet-buffer-tolerance = {tolerance!r}
coulombtype             = Reaction-field
epsilon-rf              = 0
rcoulomb                = {coulomb!r}
vdwtype                 = Cut-off
vdw-modifier            = Force-switch
rvdw-switch             = {inner!r}
rvdw                    = {outer!r}
tcoupl                  = {tcoupl}
nsttcouple              = 1
tc-grps                 = System
tau-t                   = {time!r}
ref-t                   = {temperature!r}
comm-mode               = {momentum}
ld-seed                 = {seed}
gen-vel                 = yes
gen-temp                = {temperature!r}
gen-seed                = {seed}
"""
TOPOLOGY = """\
[ defaults ]
1 2 no

[ atomtypes ]
OW {oxygen!r} 0.0 A {size!r} {depth!r}
HW {hydrogen!r} 0.0 A 0.0 0.0

[ moleculetype ]
SOL 2

[ atoms ]
1 OW 1 SOL OW 1 {negative!r} {oxygen!r}
2 HW 1 SOL HW1 1 {positive!r} {hydrogen!r}
3 HW 1 SOL HW2 1 {positive!r} {hydrogen!r}

[ settles ]
1 1 {bond!r} {across!r}

[ exclusions ]
1 2 3
2 1 3
3 1 2

[ system ]
water

[ molecules ]
SOL {molecules}
"""


def version() -> str | None:
    """The version on PATH; None if there is none."""
    if not shutil.which(GMX):
        return None
    output = subprocess.run([GMX, "--version"], capture_output=True, text=True).stdout
    match = re.search(r"^GROMACS version: *(\S+)", output, re.M)
    return match and match.group(1)


def settings(course: EngineRun) -> str:
    """The text of an mdp file."""
    sd = course.thermostat == "sd"
    return SETTINGS.format(
        integrator="sd" if sd else "md",
        tcoupl="no" if sd else course.thermostat,
        momentum="None" if sd else "Linear",  # noise acts on the total momentum, too
        dt=course.dt / 1e3,
        steps=course.steps,
        every=course.every,
        log=max(1, course.steps // LOGGED // course.every) * course.every,
        list_steps=LIST_STEPS,
        tolerance=TOLERANCE,
        coulomb=engine.COULOMB.outer * NM,
        inner=engine.DISPERSION.inner * NM,
        outer=engine.DISPERSION.outer * NM,
        time=1 / course.friction,
        temperature=course.temperature,
        seed=course.seed,
    )


def topology(water: Water) -> str:
    """The text of a top file."""
    return TOPOLOGY.format(
        oxygen=engine.MASS[0],
        hydrogen=engine.MASS[1],
        size=engine.SIZE * NM,
        depth=engine.DEPTH * KJ,
        negative=engine.CHARGE[0],
        positive=engine.CHARGE[1],
        bond=engine.BOND * NM,
        across=engine.ACROSS * NM,
        molecules=water.molecules,
    )


def start(water: Water) -> str:
    """The text of a gro file; GROMACS reads the number of digits from the first line of atoms."""
    lines = ["water", f"{len(water.x)}"]
    for i, place in enumerate(water.x * NM):
        number, name = i // 3 + 1, ("OW", "HW1", "HW2")[i % 3]
        digits = "".join(f"{coordinate:15.10f}" for coordinate in place)
        lines.append(f"{number % 100000:5d}{'SOL':<5}{name:>5}{(i + 1) % 100000:5d}{digits}")
    return "\n".join([*lines, " ".join(f"{length:.10f}" for length in water.box * NM), ""])


def worker_input(course: EngineRun, water: Water) -> dict:
    """See `Engine`: the files that GROMACS reads."""
    return {
        "files": {
            "run.mdp": settings(course),
            "topol.top": topology(water),
            "start.gro": start(water),
        }
    }


def words(data: dict) -> list[str]:
    """See `Engine`."""
    return data["files"]["run.mdp"].splitlines()


def samples(data: dict, folder: Path) -> Iterator[Sample]:
    """See `Engine`."""
    for name, text in data["files"].items():
        (folder / name).write_text(text)
    _gmx(folder, "grompp", "-f", "run.mdp", "-p", "topol.top", "-c", "start.gro", "-o", "run.tpr")
    watched = folder / "log.lammps"  # where output shows that the run goes on
    watched.symlink_to(LOG)
    one_core = "-ntmpi", "1", "-ntomp", "1", "-pin", "off", "-nb", "cpu"
    _gmx(folder, "mdrun", "-deffnm", "run", *one_core)
    shutil.copy(folder / LOG, folder / "log.part")
    (folder / "log.part").replace(watched)  # it is never missing
    _gmx(
        folder,
        *("energy", "-f", "run.edr", "-o", ENERGIES, "-dp", "-xvg", "none"),
        typed="Potential\nPressure\n\n",
    )
    yield from read((folder / ENERGIES).read_text(), data["dt"])


def seconds(folder: Path) -> float:
    """See `Engine`: the last number of the line "Time:", core time, wall time, percent."""
    (wall,) = re.findall(r"^ +Time: +\S+ +(\S+)", (folder / LOG).read_text(), re.M)
    return float(wall)


def read(text: str, dt: float) -> Iterator[Sample]:
    """Yield samples from the text of an xvg file without header: ps, kJ/mol, bar."""
    for time, potential, pressure in np.loadtxt(text.splitlines(), ndmin=2):
        yield Sample(round(time * 1e3 / dt), potential / KJ, pressure * BAR)


def _gmx(folder: Path, *words: str, typed: str = "") -> None:
    """Run a command of GROMACS, which also ends with this process.

    Raises:
        Failed: it ended without success.
        ChildProcessError: it was killed.
    """
    tied = sys.executable, "-IS", str(run.END_WITH_PARENT), str(os.getpid())
    done = subprocess.run(
        [*tied, GMX, *words],
        cwd=folder,
        input=typed,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    print(done.stdout, flush=True)
    status = done.returncode
    by = f"signal {signal.Signals(-status).name}" if status < 0 else f"status {status}"
    if status < 0 and -status not in OWN:
        raise ChildProcessError(f"gmx {words[0]} was ended by {by}")
    if status:
        match = re.search(r"Fatal error:\n(.+?)\n\n", done.stdout, re.S)
        raise Failed(
            match.group(1) if match else f"gmx {words[0]} ended without a message, by {by}"
        )


ENGINE = Engine(
    "GROMACS", "apt-get install gromacs", version, worker_input, words, samples, seconds
)
_STEPS = (1.0, 2.0, 4.0, 6.0)
SCHEMES = [
    Scheme(
        name, label, (thermostat,), kind="engine", engine=ENGINE, friction=5.0, steps=_STEPS,
        reach=6.0, held=held,
    )
    for name, label, thermostat, held in (
        ("gromacs-sd", "GROMACS sd 5/ps", "sd", 0),
        ("gromacs-v-rescale", "GROMACS v-rescale 0.2 ps", "v-rescale", 3),
    )
]  # fmt: skip
