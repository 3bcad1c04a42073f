"""A step of run_style respa: each level's forces begin and end a step with its own time step.

The functions here are hooks of `Integrator`, for what follows the `schedule` in Python.
"""

from typing import TYPE_CHECKING

from . import schedule

if TYPE_CHECKING:
    from .integrator import Integrator


def _follow_atoms(integrator: "Integrator") -> None:
    if integrator.host.atoms_moved():
        integrator.follow_atoms()


def initial_integrate_respa(integrator: "Integrator", vflag: int, level: int, loop: int) -> None:
    """A level begins a step; the innermost one, 0, moves the bodies."""
    integrator.host.vflag, integrator.stepped = vflag, True
    integrator.passes.level_dt.set(integrator.respa_dt[level])
    if level == len(integrator.respa_dt) - 1:
        schedule.follow(integrator, "begin")
    else:
        _follow_atoms(integrator)
        schedule.follow(integrator, "kick")
    if level == 0:
        schedule.follow(integrator, "move")


def final_integrate_respa(integrator: "Integrator", level: int, loop: int) -> None:
    """A level's new forces end its step."""
    _follow_atoms(integrator)
    integrator.passes.level_dt.set(integrator.respa_dt[level])
    schedule.follow(integrator, "level")
    if level == len(integrator.respa_dt) - 1:
        schedule.follow(integrator, "outermost")
    integrator.known.clear()


def end_of_step(integrator: "Integrator") -> None:
    """The step is over, and LAMMPS has added up the forces of its levels."""
    integrator.known.clear()
    schedule.follow(integrator, "end_levels")
