"""A step of run_style respa: each level's forces begin and end a step with its own time step.

The functions here are hooks of `Integrator`.
"""

from typing import TYPE_CHECKING

from . import schedule

if TYPE_CHECKING:
    from .integrator import Integrator


def initial_integrate_respa(integrator: "Integrator", vflag: int, level: int, loop: int) -> None:
    """A level begins a step; the innermost one, 0, moves the bodies."""
    integrator.host.vflag, integrator.stepped = vflag, True
    outermost = level == len(integrator.respa_dt) - 1
    if outermost:
        schedule.follow(integrator, "begin")
    elif integrator.host.atoms_moved():
        integrator.follow_atoms()
    integrator.passes.level_dt.set(integrator.respa_dt[level])
    integrator.do("kick", integrator.lammps.step - outermost)
    if level == 0:
        schedule.follow(integrator, "move")


def final_integrate_respa(integrator: "Integrator", level: int, loop: int) -> None:
    """A level's new forces end its step."""
    if integrator.host.atoms_moved():
        integrator.follow_atoms()
    if integrator.unchanged.box_may_change:
        integrator.refuse_new_box()
    integrator.passes.level_dt.set(integrator.respa_dt[level])
    integrator.do("close")
    integrator.known.clear()
    if level == len(integrator.respa_dt) - 1 or integrator.half_step_velocities:
        integrator.set_velocities()


def end_of_step(integrator: "Integrator") -> None:
    """The step is over, and LAMMPS has added up the forces of its levels."""
    integrator.known.clear()
    schedule.follow(integrator, "end_levels")
