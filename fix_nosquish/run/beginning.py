"""How a run begins: what it finds out, and what its passes are bound to.

Public functions here are methods of `Integrator`.
"""

from math import gcd
from typing import TYPE_CHECKING, cast

import numpy as np

from ..box import deform
from ..errors import refuse
from ..loops import machine_code
from . import cards, external, log, making, refusals, rotation, velocities
from .minimization import Minimization
from .other_fixes import (
    OtherFixes,
    reading_pair_style,
    refuse_constraints,
    refuse_other_integrators,
)
from .output import BodyFile
from .passes import Passes
from .schedule import GATHERS, LATE, LEVELS, LOOKS, MID_STEP, RESETS, SEEN, WATCHED, Phase

if TYPE_CHECKING:
    from .integrator import Integrator


def _look_at_fixes(integrator: "Integrator") -> None:
    """Find out what other fixes may read and change, and whether bodies move with a box that one of
    them changes; collective."""
    host, lammps = integrator.host, integrator.lammps
    ours = {mate.host.fix_id for mate in integrator.mates}
    fixes = integrator.other_fixes = OtherFixes(host.fixes(), ours, host.command, lammps.step)
    reading = [mate for mate in integrator.mates if mate.external.may_read_atoms(ours)]
    integrator.half_step_velocities = bool(fixes.half_step or reading or reading_pair_style(host))
    if any(mate is not integrator for mate in reading):  # it may end its step behind this one
        fixes.velocities_every = (1,)
    follows = fixes.deform and not integrator.box_every and not lammps.respa_dt
    integrator.told_box = host.told_box if follows else None
    integrator.streams = integrator.told_box is not None and bool(host.stream_group)
    if integrator.told_box is not None:
        machine_code.load(integrator.communicator, deform.__name__)
    integrator.unchanged.begin_run(integrator)
    refusals.refuse_streams(integrator)


def _bind(integrator: "Integrator") -> None:
    """Bind the passes of the run to its bodies; collective."""
    cells = integrator.bodies.cells
    integrator.gravity = refusals.weight(integrator)
    external.begin(integrator)
    cells["rate"].set(integrator.host.rate if integrator.streams else np.zeros(6))
    if (mask := integrator.mask) is not None:
        cells["mask"].set(mask)
    integrator.parameters = integrator.numbers(
        ftm2v=integrator.lammps.ftm2v,
        mrot=rotation.inner_steps(integrator),
        **integrator.own_parameters(),
    )
    integrator.passes = Passes(integrator)


def _give_velocities(integrator: "Integrator") -> None:
    """Have the atoms move as the bodies that were made of them."""
    if integrator.streams:  # velocities are those that bodies have where the box has them
        integrator.bodies.settle(integrator.lammps)
        velocities.take(integrator)
    integrator.passes.do("orient")
    integrator.set_velocities()
    if integrator.streams and not integrator.runs:
        velocities.set_plain(integrator)


def _open_table(integrator: "Integrator") -> None:
    """Open the file of keyword output, if there is to be one and it is not open."""
    asked, lammps = integrator.command.output, integrator.lammps
    if not asked or integrator.file:
        return
    path = lammps.text(asked.file)
    refuse(
        any(mate.file and mate.file.path == path for mate in integrator.mates),
        f"two fixes write their table of bodies (keyword output) to {path}: "
        "give each a file of its own",
    )
    refuse(
        integrator.respa_dt and not integrator.host.calls_setup,
        "keyword output needs the plugin's fix python/move under run_style respa: "
        "this LAMMPS's own knows no end of a step",
    )
    integrator.file = BodyFile(path, lammps.units, integrator.communicator)


def _plan(integrator: "Integrator") -> None:
    """Tell the host what holds in this run, and have it follow the schedule."""
    kept, fixes, host = integrator.unchanged, integrator.other_fixes, integrator.host
    looks = kept.box_may_change or kept.masses_may_change or integrator.rigid_flag
    holds = {
        SEEN: host.facts & SEEN,
        LATE: fixes.late,
        MID_STEP: integrator.mid_step,
        LEVELS: bool(integrator.respa_dt),
        WATCHED: kept.box_may_change,
        LOOKS: looks or bool(integrator.switches),
        RESETS: integrator.mid_step and integrator.waiting not in (None, integrator.dt),
    }
    host.facts = sum(bit for bit, so in holds.items() if so)
    if host.facts & RESETS:
        integrator.passes.level_dt.set(integrator.waiting)
    asked = integrator.command.output
    host.follow_schedule(
        None if integrator.has_own_hooks else integrator.passes.lists,
        velocities_every=gcd(*fixes.velocities_every),
        table_every=asked.steps if asked else 0,
    )


def init(integrator: "Integrator") -> None:
    """A run begins: make the bodies of the atoms, leave the atoms rigid motion only; collective."""
    host, lammps = integrator.host, integrator.lammps
    refusals.refuse_levels(integrator)
    refusals.refuse_time_step(integrator)
    host.follow_schedule(None)
    integrator.note_waiting()
    integrator.first_step = lammps.step
    integrator.mid_step = type(integrator).mid_step and not lammps.respa_dt and not host.dmax
    host.phase = Phase.NEW
    integrator.taken_away = velocities.Taken()
    integrator.known.clear()
    host.set_bodies(None, None)  # the atoms are not those of the last run
    if anew := not integrator.goes_on:
        making.decide(integrator)
    else:
        integrator.membership.find_groups()
    _look_at_fixes(integrator)
    if anew:
        making.make(integrator)
    else:
        integrator.bodies.bind(integrator.membership)
    _bind(integrator)
    if anew:
        _give_velocities(integrator)
    refuse_other_integrators(integrator)
    refuse_constraints(integrator)
    integrator.take_time_step()
    integrator.cards = cards.find(integrator)
    wrong = integrator.cards.problem(
        energy=integrator.needs_energy,
        levels=bool(integrator.respa_dt),
        counts=bool(host.counts),
    )
    refuse(wrong, wrong)
    _open_table(integrator)
    _plan(integrator)
    host.begin_run(integrator.virial_of_all)
    if not host.calls_setup:
        log.say(integrator, host.has_virial)
    integrator.tell_count()
    integrator.minimization = cast(Minimization, None)
    if host.dmax:
        _begin_minimization(integrator)


def _begin_minimization(integrator: "Integrator") -> None:
    """Tell LAMMPS of the bodies' coordinates in a minimization; collective."""
    host = integrator.host
    unknown = "minimize needs the energy of all forces, which does not include that of "
    refuse(
        integrator.gravity is not None,
        f"{unknown}keyword gravity: remove 'disable' from fix gravity and use 'fix_modify energy "
        "yes' instead",
    )
    refuse(
        integrator.external.acts,
        f"{unknown}fix_modify external: use a run with fix nosquish/nvt at a low temperature",
    )
    refuse(
        any(fix.style.startswith("box/relax") for fix in integrator.other_fixes),
        "fix box/relax would deform the rigid bodies with the box: unfix it before minimize, and "
        "use fix nosquish/npt or fix nosquish/nph and a run for the box",
    )
    begun = integrator.minimization = Minimization(
        integrator.bodies, integrator.communicator, bool(integrator.switches)
    )
    host.min_dof = 6 * len(begun.ids)
    host.log(
        f"Minimization: bodies stay rigid. LAMMPS's {host.min_dof} extra global DOFs are their "
        "coordinates, which add no energy\n"
    )


def start_run(integrator: "Integrator") -> None:
    """Begin to move, now that the first forces are known; collective."""
    if integrator.unchanged.masses_may_change:
        integrator.unchanged.refuse_new_masses(integrator)
    if integrator.goes_on:  # with the IDs and masses that a script has given atoms between runs
        integrator.bodies.update_tags(integrator.lammps)
        integrator.unchanged.note_masses(integrator)
    refuse_constraints(integrator)
    refusals.refuse_weight_twice(integrator)
    integrator.do("gather")
    integrator.known.clear()
    if type(integrator).mid_step and not integrator.mid_step and integrator.waiting:
        _end_waiting(integrator, integrator.waiting)
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


def _end_waiting(integrator: "Integrator", dt: float) -> None:
    """Do what a run without levels has left: with levels a step ends with its second half."""
    integrator.passes.level_dt.set(dt)
    integrator.do("close")
    integrator.take_time_step()
    integrator.set_velocities()
    integrator.waiting = 0.0


def tell_start(integrator: "Integrator") -> None:
    """Tell the user of the bodies as a run begins; collective."""
    bodies, host = integrator.bodies, integrator.host
    if host.calls_setup:
        log.say(integrator, bool(host.vflag))
        integrator.write_table()
    start = bodies.start = log.forces_at_start(integrator)
    suspects = integrator.other_fixes.suspects()
    names = " or ".join(f"fix {fix.id} (style {fix.style})" for fix in suspects)
    bodies.possible_causes = names and f", perhaps {names}"
    if start.diagnosis and not integrator.minimization:
        host.log(integrator.line.naming(f"WARNING: {start.diagnosis}: {start.advice}\n"))


def continue_run(integrator: "Integrator") -> None:
    """Begin a run that is not set up, with 'pre no'; collective."""
    integrator.unchanged.refuse_new_box(integrator, integrator.lammps.box.periodic)
    integrator.host.point()
    integrator.bodies.refuse_moved_atoms(integrator.lammps)
    external.refuse_change(integrator)
    integrator.resumed()
    velocities.say_ignored(integrator, "pre no")
