"""What is simulated: each scene is a folder of inputs/ and LAMMPS's words for it.

All scenes use LAMMPS units ``real`` (Angstrom, fs, kcal/mol, K, atm).
"""

from dataclasses import dataclass
from pathlib import Path

INPUTS = Path(__file__).resolve().parent.parent / "inputs"


@dataclass(frozen=True)
class Scene:
    """A start configuration with its force field.

    Attributes:
        name: the word on the command line.
        title: one line for tables and figures.
        folder: where LAMMPS runs, so that file names in ``setup`` are relative.
        setup: LAMMPS commands from ``units`` to the last ``group``; no fix, no run.
        group: LAMMPS group of the atoms in rigid bodies.
        bodies: body style as fix rigid's command has it.
        body_property: per-atom integer that tells the bodies apart, as
            ``gather_atoms`` names it; 0 is no body.
        constraints: the same bodies in the words of fix shake.
    """

    name: str
    title: str
    folder: Path
    setup: tuple[str, ...]
    group: str
    bodies: str
    constraints: str
    body_property: str = "molecule"


SCENES = {
    scene.name: scene
    for scene in (
        Scene(
            name="water",
            title="1,000 TIP3P molecules at 295 K and 1 g/cm³, PPPM 1e-5",
            folder=INPUTS / "water",
            setup=(
                "units real",
                "atom_style full",
                "read_data data.water",
                # the mesh's own error in the energy must not hide the integrator's
                "variable kspace_accuracy index 1e-5",
                "include forcefield.water",
                "group water type 1 2",
            ),
            group="water",
            bodies="molecule",
            constraints="b 1 a 1",
        ),
    )
}
