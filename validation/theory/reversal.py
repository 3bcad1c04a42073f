"""Reversibility, in LAMMPS: so many steps forward, velocities reversed, as many steps; how far from
the start?

After the reversal a new run begins. Integrators that keep a state of their own, as fix_nosquish
does, make it anew of the atoms' positions and velocities then, which adds a rounding error: that of
one step is what this costs.
"""

from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from ..running import machine, run
from ..scenes import Scene
from ..scenes.integrators import OLDER, Integrator, constrained, nosquish, rigid
from ..statistics import motion

STEPS = 1, 3, 10, 30, 100, 300, 1000, 3000, 10000
COMPARED = 10  # of these, that after which positions on the way are kept
TOLERANCES = "1e-3", "1e-4", "1e-6", "1e-8", "1e-10", "1e-12"
ITERATIONS = 2000  # at most, of shake and rattle: a tolerance is reached, not given up

OURS = "NVE", *OLDER  # those without a thermostat, barostat or quench
INTEGRATORS = [
    nosquish("NVE", "fix_nosquish.NVE"),
    *(nosquish(name, name, scheme=name) for name in OLDER),
    *(rigid(style) for style in ("rigid/nve", "rigid/nve/small", "rigid", "rigid/small")),
    *(constrained(style, one, ITERATIONS) for style in ("shake", "rattle") for one in TOLERANCES),
]


@dataclass(frozen=True)
class Reversed:
    """What a run forward and back came to; lists for each of `STEPS`, Angstrom."""

    name: str
    label: str
    error: str | None  # why there are no numbers
    tolerance: float | None  # of constraints
    distance: list[float] = field(default_factory=list)  # of the atom that ends furthest away
    moved: list[float] = field(default_factory=list)  # of the atom that had gone furthest
    positions: np.ndarray | None = None  # (atoms, 3) after `COMPARED` steps

    def plain(self) -> dict:
        """For JSON, without positions."""
        return {key: value for key, value in asdict(self).items() if key != "positions"}


def reverse(scene: Scene, integrator: Integrator, out: Path, silence: float = 120.0) -> Reversed:
    """Run a scene forward and back with an integrator, for each of `STEPS` from the same start.

    Args:
        scene: without periodic directions, run at its own time step.
        out: folder of all such runs.
        silence: s without a word in the log after which the run is given up.

    Raises:
        KeyboardInterrupt: the run was interrupted.
    """
    folder = (out / run.folder_name(integrator.label)).resolve()
    how: dict = {"dt": scene.dt, "every": 0, "keeps": "nothing", "silence": silence}
    origin = machine.origin(scene, integrator)
    job = run.job(scene, integrator, folder, [0], origin=origin, **how)
    dump = 'write_dump all custom "{}/{}" id x y z vx vy vz modify sort id format float %.17g'
    job.commands.append(dump.format(folder, "start"))
    job.commands.extend(f"variable {c} atom -v{c}" for c in "xyz")
    for n in STEPS:
        job.commands.extend(
            [
                f'read_dump "{folder}/start" 0 x y z vx vy vz replace yes',
                "reset_timestep 0",
                f"run {n}",
                dump.format(folder, f"there-{n}"),
                "velocity all set v_x v_y v_z",
                f"run {n}",
                dump.format(folder, f"back-{n}"),
            ]
        )
    error = run.once(job).error
    if error == run.INTERRUPTED:
        raise KeyboardInterrupt
    named = integrator.name, integrator.label, error, integrator.tolerance
    if error:
        return Reversed(*named)
    start = _positions(folder / "start")
    distance, moved = (
        [
            float(np.linalg.norm(_positions(folder / f"{file}-{n}") - start, axis=1).max())
            for n in STEPS
        ]
        for file in ("back", "there")
    )
    return Reversed(*named, distance, moved, _positions(folder / f"there-{COMPARED}"))


def _positions(dump):
    return motion.read(dump)[1][0, :, 1:4]
