"""The bodies of a run: made of the atoms as it begins, and made and dropped in it."""

from functools import partial
from typing import TYPE_CHECKING, Any, cast
from weakref import WeakMethod

import numpy as np

from ..bodies import infile, templates, turnover
from ..bodies.bodies import Bodies
from ..bodies.build import Recipe, build, nothing
from ..bodies.membership import PreviousBodies
from ..bodies.shapes import ShapeCorrection
from ..bodies.species import compare
from ..errors import refuse
from . import external, log, rotation, switches
from .refusals import refuse_turnover

if TYPE_CHECKING:
    from .integrator import Integrator


def _recipe(integrator: "Integrator") -> Recipe:
    """How a run makes the bodies of its atoms; see `build`."""
    path = integrator.infile
    return Recipe(
        integrator.membership,
        integrator.shapes(),
        integrator.oriented,
        partial(infile.read, path, integrator.counts_from_one) if path else nothing,
        integrator.rows + integrator.kept,
        keeps_shapes=integrator.ran and not path,
    )


def bodies_of_atoms(integrator: "Integrator") -> Bodies:
    """The bodies that a run would make of the atoms as they are now; collective."""
    integrator.membership.find_groups()
    integrator.host.point()
    return build(_recipe(integrator), _former(integrator)).bodies


def _former(integrator: "Integrator") -> PreviousBodies | None:
    """What the atoms were in the bodies of the last run, None if there are none; collective."""
    refuse(
        integrator.bodies is None and integrator.ran and not integrator.infile,
        "the bodies of the last run are gone, because this one could not begin: "
        "unfix this fix and define it again",
    )
    if integrator.bodies is None:
        return None
    return integrator.bodies.as_previous(integrator.lammps, integrator.host.follows)


def decide(integrator: "Integrator") -> None:
    """Decide which bodies atoms are in that came since the fix was defined; collective."""
    host, membership = integrator.host, integrator.membership
    membership.find_groups()
    host.point()
    changes = "" if host.follows else membership.changes()
    refuse(
        changes,
        f"atoms have changed since this fix was defined ({changes}), or got other IDs, which "
        "LAMMPS's own fix python/move cannot tell apart: unfix this fix and define it again",
    )
    membership.decide()


def make(integrator: "Integrator") -> None:
    """Make the bodies of a run of the atoms as they are; collective."""
    lammps, host, command = integrator.lammps, integrator.host, integrator.command
    before = integrator.bodies
    ids, wrench = (before.id, before.wrench.copy()) if before else (np.empty(0), np.empty((6, 0)))
    former, recipe = _former(integrator), _recipe(integrator)
    host.carry(lammps, None)
    integrator.bodies = integrator.passes = cast(Any, None)  # there may be no room for both
    bodies, notes, kept = build(recipe, former)
    integrator.bodies, integrator.notes = bodies, notes
    integrator.started = False
    refuse(
        not np.isfinite(notes.kinetic),
        "the velocities of the bodies' atoms are too large, or no numbers: their kinetic "
        "energy is not finite. Look at what has set them (velocity, read_data)",
    )
    rotation.choose(integrator)
    # a rerun is to tell of the atoms as they stand in the file, which has rounded places
    bodies.tolerates_shifts = command.reinit and "rerun" in host.command[:1]
    _say_kept(integrator, kept)
    if np.array_equal(np.sort(ids), np.sort(bodies.id)):
        # commands like write_data compute no forces
        bodies.wrench[:, np.argsort(bodies.id)] = wrench[:, np.argsort(ids)]
    bodies.force_receiver = WeakMethod(integrator.give_forces)
    bodies.bind(integrator.membership)
    bodies.update_box(lammps.box)
    integrator.unchanged.note(integrator)
    host.carry(lammps, bodies)
    host.point()
    bodies.note()
    host.noted()
    integrator.switches = switches.choices(command, integrator.communicator, bodies)
    if kept.new:
        notes.warnings += compare(bodies, integrator.membership)


def _say_kept(integrator: "Integrator", kept: ShapeCorrection) -> None:
    """Put atoms where the shape that their body keeps has them, and tell the user."""
    host = integrator.host
    if kept.text and not integrator.bodies.tolerates_shifts:
        integrator.lammps.x[kept.atoms] += kept.shift
        host.log(kept.text)
    if kept.turned:
        host.log(
            f"{kept.turned} particles were turned with their bodies, which something has moved "
            "between the runs (an orientation that 'set' gave them there is dropped)\n"
        )


def turn_over(integrator: "Integrator") -> None:
    """Atoms of bodies came or are gone in a run, and their bodies with them; collective."""
    molecules = templates.inserted(integrator.host, integrator.communicator)
    find_prescribed = partial(templates.read, molecules) if molecules else nothing
    recipe = _recipe(integrator)._replace(find_prescribed=find_prescribed)
    lines, given = turnover.update_bodies(integrator.bodies, recipe)
    integrator.notes.prescribed_ids = np.union1d(integrator.notes.prescribed_ids, given)
    refuse_turnover(integrator)
    log.warn(integrator, lines)
    rotation.choose(integrator)
    integrator.parameters.mrot = rotation.inner_steps(integrator)
    external.learn(integrator)
    integrator.turned_over()
    integrator.unchanged.note(integrator)
    integrator.tell_count()
    integrator.known.clear()
