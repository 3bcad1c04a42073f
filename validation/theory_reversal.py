"""Reversibility, in LAMMPS: so many steps forward, velocities reversed, as many steps; how far from the start?

After the reversal a new run begins. Integrators that keep a state of their own, as fix_nosquish does, make it anew of the
atoms' positions and velocities then, which adds a rounding error: that of one step is what this costs.
"""

import numpy as np

from fix_nosquish import INTEGRATORS as OURS
from validation import machine, run
from validation.integrators import constrained, nosquish, rigid

STEPS = 1, 3, 10, 30, 100, 300, 1000, 3000, 10000
COMPARED = 10  # of these, that after which positions on the way are kept
TOLERANCES = "1e-3", "1e-4", "1e-6", "1e-8", "1e-10", "1e-12"
ITERATIONS = 2000  # at most, of shake and rattle: a tolerance is reached, not given up

# all that can be named on a fix line, each with its tolerance or None
INTEGRATORS = [
    *((nosquish(name, f"fix_nosquish.{name}", scheme=name), None) for name in OURS),
    *((rigid(style), None) for style in ("rigid/nve", "rigid/nve/small", "rigid", "rigid/small")),
    *(
        (constrained(style, tolerance, ITERATIONS), float(tolerance))
        for style in ("shake", "rattle")
        for tolerance in TOLERANCES
    ),
]


def reverse(scene, integrator, folder, silence=120.0):
    """Run a scene forward and back with an integrator, for each of `STEPS` from the same start.

    Args:
        scene: a `Scene` without periodic directions, run at its own time step.
        integrator: an `Integrator`.
        folder: where the files go.
        silence: s without a word in the log after which the run is given up.
    Returns:
        dict: name, label, error (None, or why there are no numbers); for each of `STEPS` in Angstrom ``distance``, of the atom that ends
        furthest from its start, and ``moved``, of the atom that had gone furthest; ``positions`` (atoms, 3) after `COMPARED` steps.
    """
    folder = folder.resolve()
    job = run.job(
        scene,
        integrator,
        folder,
        [0],
        dt=scene.dt,
        every=0,
        positions=False,
        silence=silence,
        origin=machine.origin(scene, integrator),
    )
    dump = 'write_dump all custom "{}/{}" id x y z vx vy vz modify sort id format float %.17g'
    job.commands.append(dump.format(folder, "start"))
    job.commands.extend(f"variable {c} atom -v{c}" for c in "xyz")
    for n in STEPS:
        job.commands.extend([
            f'read_dump "{folder}/start" 0 x y z vx vy vz replace yes',
            "reset_timestep 0",
            f"run {n}",
            dump.format(folder, f"there-{n}"),
            "velocity all set v_x v_y v_z",
            f"run {n}",
            dump.format(folder, f"back-{n}"),
        ])  # fmt: skip
    result = run.once(job)
    row = {"name": integrator.name, "label": integrator.label, "error": result.error}
    if not result.error:
        start = _positions(folder / "start")
        for key, file in ("distance", "back"), ("moved", "there"):
            row[key] = [
                float(np.linalg.norm(_positions(folder / f"{file}-{n}") - start, axis=1).max())
                for n in STEPS
            ]
        row["positions"] = _positions(folder / f"there-{COMPARED}")
    return row


def _positions(dump):
    return np.loadtxt(dump, skiprows=9)[:, 1:4]
