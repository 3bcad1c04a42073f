"""A step of run_style respa: each level's forces begin and end a step with its own time step."""

from typing import TYPE_CHECKING

from . import schedule

if TYPE_CHECKING:
    from .integrator import Integrator


def begin_step(integrator: "Integrator", level: int) -> None:
    """A level begins a step; the innermost one, 0, moves the bodies."""
    outermost = level == len(integrator.respa_dt) - 1
    if outermost:
        schedule.follow(integrator, "begin")
    elif integrator.host.atoms_moved():
        integrator.follow_atoms()
    integrator.passes.level_dt.set(integrator.respa_dt[level])
    integrator.do("kick", integrator.lammps.step - outermost)
    if level == 0:
        schedule.follow(integrator, "move")


def end_step(integrator: "Integrator", level: int) -> None:
    """A level's new forces end its step."""
    if integrator.host.atoms_moved():
        integrator.follow_atoms()
    if integrator.unchanged.box_may_change:
        integrator.refuse_new_box()
    integrator.passes.level_dt.set(integrator.respa_dt[level])
    integrator.do("close")
    integrator.reports.forget()
    if level == len(integrator.respa_dt) - 1 or integrator.half_step_velocities:
        integrator.set_velocities()
