"""How a run begins: what it finds out, and what its passes are bound to."""

from math import gcd
from typing import TYPE_CHECKING

import numpy as np

from ..bodies.bodies import Start
from ..bodies.membership import Membership
from ..box import deform
from ..loops import machine_code
from . import log, making, refusals, rotation, velocities
from .other_fixes import OtherFixes, refuse_other_integrators
from .passes import Passes
from .schedule import GATHERS, LATE, LEVELS, LOOKS, MID_STEP, RESETS, SEEN, WATCHED, Phase

if TYPE_CHECKING:
    from .integrator import Integrator


def look_at_fixes(integrator: "Integrator") -> None:
    """Find out what other fixes may read and change."""
    host, lammps = integrator.host, integrator.lammps
    ours = {mate.host.fix_id for mate in integrator.mates}
    integrator.other_fixes = OtherFixes(host.fixes(), ours, host.command, lammps.step)
    integrator.half_step_velocities = host.ghost_velocity or integrator.other_fixes.half_step
    look_at_box(integrator)


def look_at_box(integrator: "Integrator") -> None:
    """Find out whether another fix changes the box, and bodies move with it."""
    deforms = integrator.other_fixes.deform and not integrator.box_every
    follows = deforms and not integrator.lammps.respa_dt
    integrator.told_box = integrator.host.told_box if follows else None
    integrator.streams = integrator.told_box is not None and bool(integrator.host.stream_group)
    if integrator.told_box is not None:
        machine_code.load(integrator.communicator, deform.__name__)
    integrator.unchanged.begin_run(integrator)


def bind(integrator: "Integrator") -> None:
    """Bind the passes of the run to its bodies; collective."""
    bodies, host = integrator.bodies, integrator.host
    integrator.gravity = refusals.weight(integrator)
    integrator.external.begin()
    bodies.cells["rate"].set(host.rate if integrator.streams else np.zeros(6))
    integrator.mask = integrator.switches.mask(bodies)
    mrot = rotation.inner_steps(integrator)
    integrator.parameters = integrator.numbers.new(
        ftm2v=integrator.lammps.ftm2v, mrot=mrot, **integrator.own_parameters()
    )
    integrator.passes = Passes(
        integrator, bodies, integrator.lammps, integrator.communicator, integrator.mask,
        integrator.half_step_velocities, integrator.own_cells(),
    )  # fmt: skip


def give_velocities(integrator: "Integrator") -> None:
    """Have the atoms move as the bodies that were made of them."""
    if integrator.streams:  # velocities are those that bodies have where the box has them
        integrator.bodies.settle(integrator.lammps)
        velocities.take(integrator)
    integrator.passes.do("orient")
    integrator.set_velocities()
    if integrator.streams and not integrator.runs:
        velocities.set_plain(integrator)


def plan(integrator: "Integrator") -> None:
    """Tell the host what holds in this run, and have it follow the schedule."""
    kept, fixes, host = integrator.unchanged, integrator.other_fixes, integrator.host
    looks = kept.box_may_change or kept.masses_may_change or integrator.rigid_flag
    holds = {
        SEEN: host.facts & SEEN,
        LATE: fixes.late,
        MID_STEP: integrator.mid_step,
        LEVELS: bool(integrator.respa_dt),
        WATCHED: kept.box_may_change,
        LOOKS: looks or integrator.switches.choices,
        RESETS: integrator.mid_step and integrator.waiting not in (None, integrator.dt),
    }
    host.facts = sum(bit for bit, so in holds.items() if so)
    table = integrator.command.output if integrator.reports.file else None
    if host.facts & RESETS:
        integrator.passes.level_dt.set(integrator.waiting)
    host.follow_schedule(
        None if integrator.has_own_hooks else integrator.passes.lists,
        velocities_every=gcd(*fixes.velocities_every),
        table_every=table[0] if table else 0,
    )


def begin_run(integrator: "Integrator") -> None:
    """Make the bodies of the atoms, leave the atoms rigid motion only; collective."""
    host, lammps = integrator.host, integrator.lammps
    refusals.refuse_levels(integrator)
    refusals.refuse_time_step(integrator)
    host.follow_schedule(None)
    integrator.note_waiting()
    integrator.first_step = lammps.step
    integrator.mid_step = type(integrator).mid_step and not lammps.respa_dt
    host.phase = Phase.NEW
    integrator.reports.begin()
    host.set_bodies(None, None)  # the atoms are not those of the last run
    # nor are the groups: deleted ones leave their bits to others
    integrator.membership = Membership(lammps, integrator.communicator, integrator.command)
    look_at_fixes(integrator)
    refusals.refuse_streams(integrator)
    anew = not integrator.goes_on
    if anew:
        making.make(integrator)
    else:
        integrator.bodies.bind(integrator.membership)
    bind(integrator)
    if anew:
        give_velocities(integrator)
    refuse_other_integrators(integrator)
    integrator.take_time_step()
    integrator.reports.open()
    plan(integrator)
    host.begin_run(integrator.reports.virial_of_all)
    if not host.calls_setup:
        integrator.reports.say(host.has_virial)
    integrator.tell_count()


def start_run(integrator: "Integrator") -> None:
    """Begin to move, now that the first forces are known; collective."""
    middle = type(integrator).mid_step
    integrator.unchanged.refuse_new_masses(integrator)
    refusals.refuse_weight_twice(integrator)
    integrator.do("gather")
    integrator.reports.forget()
    if middle and not integrator.mid_step:
        _end_waiting(integrator)
    if integrator.start and not integrator.started:
        integrator.start.bind_to(integrator.passes.cells)()
    integrator.started = True
    if integrator.goes_on:
        if not integrator.streams:  # where LAMMPS takes an atom into the box, it is faster then
            own = "some have what their molecule template says"
            why = own if integrator.command.reinit else "reinit no"
            velocities.say_ignored(integrator, why)
        integrator.set_velocities()
    integrator.ran = True
    # LAMMPS asks the fixes behind this one for their forces after it
    if integrator.other_fixes.change_forces and not integrator.mid_step:
        integrator.host.facts |= GATHERS


def _end_waiting(integrator: "Integrator") -> None:
    """Do what a run without levels has left: with levels a step ends with its second half."""
    if integrator.waiting:
        integrator.passes.level_dt.set(integrator.waiting)
        integrator.do("close")
        integrator.take_time_step()
        integrator.set_velocities()
        integrator.waiting = 0.0


def tell_start(integrator: "Integrator") -> None:
    """Tell the user of the bodies as a run begins; collective."""
    bodies, host = integrator.bodies, integrator.host
    if host.calls_setup:
        integrator.reports.say(bool(host.vflag))
        integrator.reports.write()
    cause, remedy, spacing = log.forces_at_start(integrator)
    bodies.start = Start(integrator.lammps.step, cause, remedy, spacing)
    suspects = integrator.other_fixes.suspects()
    names = " or ".join(f"fix {fix.id} (style {fix.style})" for fix in suspects)
    bodies.suspects = names and f", perhaps {names}"
    if cause and not integrator.quenches:
        host.log(integrator.line.naming(f"WARNING: {cause}: {remedy}\n"))


def continue_run(integrator: "Integrator") -> None:
    """Begin a run that is not set up, with 'pre no'; collective."""
    integrator.unchanged.refuse_new_box(integrator, integrator.lammps.box.periodic)
    integrator.host.point()
    integrator.bodies.refuse_moved_atoms(integrator.lammps)
    integrator.external.refuse_change()
    integrator.resumed()
    velocities.say_ignored(integrator, "pre no")
