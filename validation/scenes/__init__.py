"""The simulated systems: each scene is a folder of inputs/ and its LAMMPS commands.

Scenes in LAMMPS units ``real`` are in Angstrom, fs, kcal/mol, K and atm, those in ``lj`` in reduced
units.
"""

import itertools
from dataclasses import dataclass, replace
from pathlib import Path

from .. import INPUTS

FS_PER_PS = 1000.0
# K, of the captions of the paper's figures
TEMPERATURE = {"dimer": 155.0, "water": 295.0, "peptide": 300.0}


@dataclass(frozen=True)
class Scene:
    """A start configuration with its force field.

    Attributes:
        name: on the command line.
        title: one line for tables and figures.
        folder: where LAMMPS runs, so that file names in ``setup`` are relative.
        setup: LAMMPS commands from ``units`` to the last ``group``; no fix, no run.
        group: LAMMPS group of the atoms in rigid bodies.
        bodies: body style as fix rigid's command has it.
        constraints: the same bodies as arguments of fix shake; None if it cannot constrain them.
        body_property: per-atom integer that identifies the bodies, as
            ``gather_atoms`` names it, or a file (.npy) that has it and the type of each atom, as
            rows, in order of ID; 0 is no body.
        others: LAMMPS commands that move the atoms in no body.
        units: as LAMMPS calls them, see ``units``.
        dt: a usual time step, in these units.
        unit: bodies in ``setup``; larger sizes are copies of it.
        sizes: numbers of bodies that the benchmark measures.
        cutter: script in the folder, ``python SCRIPT BODIES FILE``, that writes a data file with
            any number of bodies; None if there are only whole copies.
        subject: the title without a size, if there are several.
        ghost_cutoff: distance of ghost atoms for a fix that needs the whole of each body.
        then: LAMMPS commands after the fix that moves the bodies.
        columns: of the thermodynamic output, in addition to the usual ones.
        output: LAMMPS commands after those of the output.
        dimension: of space, 2 or 3.
        origin: hash of its files; empty if all are in the folder.
        overlay: of a user's script, see ``running.recorder``; empty for the harness's own scenes.
    """

    name: str
    title: str
    folder: Path
    setup: tuple[str, ...]
    group: str
    bodies: str
    constraints: str | None
    body_property: str = "molecule"
    others: tuple[str, ...] = ()
    units: str = "real"
    dt: float = 2.0
    unit: int = 1
    sizes: tuple[int, ...] = ()
    cutter: str | None = None
    subject: str | None = None
    ghost_cutoff: float | None = None
    then: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    output: tuple[str, ...] = ()
    dimension: int = 3
    origin: str = ""
    overlay: str = ""

    def on_mesh(self, accuracy: str) -> "Scene":
        """The scene with another accuracy of its PPPM; no effect without PPPM."""
        # LAMMPS keeps the first of two definitions
        return replace(self, setup=(f"variable kspace_accuracy index {accuracy}", *self.setup))

    def is_whole_copies(self, bodies: int) -> bool:
        """Whether so many bodies are ``unit`` copied to a block at most twice as long as wide."""
        return bodies % self.unit == 0 and _block(bodies // self.unit) is not None

    def of_size(self, bodies: int, data: Path | None = None) -> "Scene":
        """The scene with so many bodies.

        Args:
            bodies: their number.
            data: for a number that is not a block of whole copies, the data file with so many.
        """
        lines = enumerate(self.setup)
        place = next((i for i, line in lines if line.startswith("read_data ")), len(self.setup))
        if data is not None:
            setup = (*self.setup[:place], f"read_data {data}", *self.setup[place + 1 :])
        elif not self.is_whole_copies(bodies):
            raise ValueError(f"scene {self.name} has no start with {bodies} bodies")
        elif bodies == self.unit:
            setup = self.setup
        else:
            copies = "replicate {} {} {}".format(*_block(bodies // self.unit))
            setup = (*self.setup[: place + 1], copies, *self.setup[place + 1 :])
        return replace(self, setup=setup, unit=bodies)


def _block(copies):
    """Three factors of ``copies``, from the smallest, nearest to a cube; None if no block is at
    most twice as long as wide."""
    factors = [n for n in range(1, copies + 1) if copies % n == 0]
    blocks = [
        (a, b, copies // (a * b))
        for a, b in itertools.combinations_with_replacement(factors, 2)
        if copies % (a * b) == 0 and b <= copies // (a * b) <= 2 * a
    ]
    return min(blocks, key=lambda block: block[2] / block[0], default=None)


_SCENES = (
    Scene(
        name="water",
        title="1,000 TIP3P molecules at 295 K and 1 g/cm³, PPPM 1e-5",
        folder=INPUTS / "water",
        setup=(
            "units real",
            "atom_style full",
            "read_data data.water",
            "include forcefield.water",
            "group water type 1 2",
        ),
        group="water",
        bodies="molecule",
        constraints="b 1 a 1",
        unit=1000,
        sizes=(1000, 10648, 100000),
        cutter="cut_water.py",
        subject="TIP3P molecules at 295 K and 1 g/cm³",
    ),
    Scene(
        name="peptide",
        title="the helix WEAQAREALAKEAARA in 1,417 TIP3P molecules, partly rigid",
        folder=INPUTS / "peptide",
        setup=(
            "units real",
            "atom_style full",
            "include forcefield.peptide",
            "read_data data.peptide.gz",
            "group rigid molecule > 0",
            "group rest subtract all rigid",
        ),
        group="rigid",
        bodies="molecule",
        constraints=None,  # shake cannot hold CH3 or NH3 completely rigid
        others=("fix others rest nve",),
        dt=3.0,
        unit=1493,
        sizes=(1493,),
    ),
    Scene(
        name="mixed",
        title="flexible chains and bodies of 2 to 200 atoms, Lennard-Jones",
        folder=INPUTS / "mixed",
        setup=(
            "units lj",
            "atom_style bond",
            "read_data data.mixed",
            "include forcefield.mixed",
        ),
        group="bodies",
        bodies="molecule",
        constraints=None,
        others=("fix others chains nve",),
        units="lj",
        dt=0.004,
        unit=48,
        sizes=(1296,),
        ghost_cutoff=8.0,
    ),
    Scene(
        name="big",
        title="one body of 100,000 atoms in a thin gas, Lennard-Jones",
        folder=INPUTS / "big",
        setup=("include scene.big",),
        group="body",
        bodies="molecule",
        constraints=None,
        others=("fix others gas nve",),
        units="lj",
        dt=0.005,
        sizes=(1,),
        ghost_cutoff=52.0,
    ),
    Scene(
        name="dimer",
        title="two TIP3P molecules with hydrogens of 0.1 amu, bound, in empty space",
        folder=INPUTS / "water_dimer",
        setup=(
            "units real",
            "atom_style full",
            "boundary f f f",
            "read_data data.dimer",
            "include forcefield.dimer",
            "group water type 1 2",
        ),
        group="water",
        bodies="molecule",
        constraints="b 1 a 1",
        dt=0.3,
        unit=2,
        sizes=(2,),
    ),
)
SCENES = {scene.name: scene for scene in _SCENES}


def smooth_water(name: str, title: str, folder: str, ending: str, molecules: int) -> Scene:
    """Water whose forces end smoothly: only the time step makes its energy fluctuate.

    Args:
        name, title: of the scene.
        folder: in inputs/, with data.ENDING and forcefield.ENDING.
    """
    files = f"read_data data.{ending}", f"include forcefield.{ending}"
    return replace(
        SCENES["water"],
        name=name,
        title=title,
        folder=INPUTS / folder,
        setup=("units real", "atom_style full", *files, "group water type 1 2"),
        unit=molecules,
        sizes=(),
        cutter=None,
        subject=None,
    )


# Bonds within a rigid group, and the angle of groups of three atoms (water, CH2, NH2): CH, NH, CH2,
# NH2 and water are as rigid as with the rigid fixes.  A group of four (CH3, NH3) has three bonds
# only, because fix shake cannot constrain more of it.
HELD = "b 1 3 6 10 12 19 24 27 29 31 a 1 11 42 46 53 57"


def constrained_peptide() -> Scene:
    """The peptide with the constraints that fix shake supports, as its arguments."""
    return replace(SCENES["peptide"], constraints=HELD)


def steps(time: float, dt: float) -> int:
    """The number of steps of dt (fs) in a time (ps)."""
    return round(time * FS_PER_PS / dt)
