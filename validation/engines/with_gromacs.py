"""GROMACS: leap-frog with SETTLE, thermostats sd and v-rescale.

Its Lennard-Jones force switch is the scene's.  With the Verlet scheme it has no shifted Coulomb
forces and no tables of one's own, so these forces are others than the scene's: they end with a
reaction field of infinite permittivity, where the force is zero, and its slope is not.
"""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np

from .engine import BAR, KJ, NM, Course, Engine, Samples, wait
from .water import Water

GMX = "gmx"
RUN, ENERGIES = "run", "energies.xvg"
SAID = "Potential\nPressure\n\n"  # what gmx energy is asked for
LIST_STEPS, TOLERANCE = 10, 1e-4  # steps between pair lists; kJ/mol/ps an atom, of lists too short
LOGGED = 100  # times that the log tells the step, about
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
    """Of the one on PATH; None if there is none."""
    if not shutil.which(GMX):
        return None
    said = subprocess.run([GMX, "--version"], capture_output=True, text=True).stdout
    found = re.search(r"^GROMACS version: *(\S+)", said, re.M)
    return found and found.group(1)


def settings(course: Course, water: Water) -> str:
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
        coulomb=water.coulomb.outer * NM,
        inner=water.dispersion.inner * NM,
        outer=water.dispersion.outer * NM,
        time=1 / course.friction,
        temperature=course.temperature,
        seed=course.seed,
    )


def topology(water: Water) -> str:
    """The text of a top file."""
    return TOPOLOGY.format(
        oxygen=water.mass[0],
        hydrogen=water.mass[1],
        size=water.size * NM,
        depth=water.depth * KJ,
        negative=water.charge[0],
        positive=water.charge[1],
        bond=water.bond * NM,
        across=water.across * NM,
        molecules=water.molecules,
    )


def start(water: Water) -> str:
    """The text of a gro file; it takes the number of digits from the first line of atoms."""
    lines = ["water", f"{len(water.x)}"]
    for i, place in enumerate(water.x * NM):
        number, name = i // 3 + 1, ("OW", "HW1", "HW2")[i % 3]
        told = "".join(f"{one:15.10f}" for one in place)
        lines.append(f"{number % 100000:5d}{'SOL':<5}{name:>5}{(i + 1) % 100000:5d}{told}")
    return "\n".join([*lines, " ".join(f"{one:.10f}" for one in water.box * NM), ""])


def inputs(course: Course, water: Water) -> dict[str, str]:
    """See `Engine`."""
    made = settings(course, water), topology(water), start(water)
    return dict(zip(("run.mdp", "topol.top", "start.gro"), made))


def words(course: Course, water: Water) -> list[str]:
    """See `Engine`."""
    return settings(course, water).splitlines()


def run(course: Course, folder: Path, silence: float, on_step) -> Samples:
    """See `Engine`."""
    prepare = [
        GMX,
        "grompp",
        "-f",
        "run.mdp",
        "-p",
        "topol.top",
        "-c",
        "start.gro",
        "-o",
        "run.tpr",
    ]
    wait(prepare, folder)
    one_core = "-ntmpi", "1", "-ntomp", "1", "-pin", "off", "-nb", "cpu"
    words = [GMX, "mdrun", "-deffnm", RUN, *one_core]
    seconds = wait(words, folder, silence, on_step, f"{RUN}.log")
    with open(folder / "said.txt", "w+") as said:
        said.write(SAID)
        said.seek(0)
        words = [GMX, "energy", "-f", f"{RUN}.edr", "-o", ENERGIES, "-dp", "-xvg", "none"]
        wait(words, folder, stdin=said)
    return samples((folder / ENERGIES).read_text(), course.dt, seconds)


def samples(text: str, dt: float, seconds: float) -> Samples:
    """From the text of an xvg file without a head: ps, kJ/mol, bar."""
    time, potential, pressure = np.loadtxt(text.splitlines(), ndmin=2, unpack=True)
    return Samples(np.rint(time * 1e3 / dt), potential / KJ, pressure * BAR, seconds)


ENGINE = Engine("GROMACS", "apt-get install gromacs", version, inputs, words, run)
