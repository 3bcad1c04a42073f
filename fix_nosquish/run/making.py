"""The bodies of a run: made of the atoms as it begins, and made and dropped in it."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..bodies import infile, templates, turnover
from ..bodies.bodies import Bodies
from ..bodies.build import build, count
from ..bodies.kinds import compare
from ..errors import RunError
from ..motion.operations import MROT
from . import rotation
from .refusals import refuse_turnover
from .switches import Switches

if TYPE_CHECKING:
    from .integrator import Integrator


def count_bodies(integrator: "Integrator") -> int | None:
    """How many bodies the first run will have, None if others may come."""
    if integrator.template:
        return None
    return count(integrator.communicator, integrator.membership)


def particles(integrator: "Integrator") -> dict[str, Any]:
    """What `build` must know of atoms that are more than points."""
    return {"shapes": integrator.shapes(), "oriented": integrator.oriented}


def _told(integrator: "Integrator") -> Any:
    """What tells of bodies besides their atoms when a run makes them; see `build`."""
    path = integrator.infile
    return partial(infile.read, path, integrator.counts_from_one) if path else None


def bodies_of_atoms(integrator: "Integrator") -> Bodies:
    """The bodies that a run would make of the atoms as they are now; collective."""
    return build(
        integrator.lammps, integrator.communicator, integrator.membership, _told(integrator),
        former=former(integrator), **particles(integrator),
    )[0]  # fmt: skip


def former(integrator: "Integrator") -> Any:
    """What the atoms were in the bodies of the last run, None if that says nothing; collective.

    An atom that was in a body stays in it; a variable is asked for the others only.  (LAMMPS's own
    fix cannot know which these are.)
    """
    if integrator.lost:
        raise RunError(
            "the bodies of the last run are gone, because this one could not begin: "
            "unfix this fix and define it again",
            everywhere=True,
        )
    if integrator.bodies is None:
        return None
    host, membership = integrator.host, integrator.membership
    host.point()
    known = integrator.bodies.of_atoms(integrator.lammps, host.follows)
    if membership.variable and known.followed:
        membership.before = known.id, known.known
    return known if integrator.ran and not integrator.infile else None


def make(integrator: "Integrator") -> None:
    """Make the bodies of a run of the atoms as they are; collective."""
    lammps, host, command = integrator.lammps, integrator.host, integrator.command
    before = integrator.bodies
    ids = before.id if before else np.empty(0)
    wrench = before.wrench.copy() if before else np.empty((6, 0))
    of_last_run = former(integrator)
    host.carry(None, None)
    integrator.let_bodies_go()  # there may be no room for both
    integrator.lost = of_last_run is not None
    bodies, notes = build(
        lammps, integrator.communicator, integrator.membership, _told(integrator),
        integrator.rows + integrator.kept, of_last_run, **particles(integrator),
    )  # fmt: skip
    integrator.bodies, integrator.notes = bodies, notes
    integrator.lost = integrator.started = False
    if not np.isfinite(notes["kinetic"]):
        raise RunError(
            "the velocities of the bodies' atoms are too large, or no numbers: their kinetic "
            "energy is not finite. Look at what has set them (velocity, read_data)",
            everywhere=True,
        )
    rotation.choose(integrator)
    # a rerun is to tell of the atoms as they stand in the file, which has rounded places
    bodies.loose = command.reinit and "rerun" in host.command[:1]
    _say_kept(integrator, notes.pop("kept"))
    if np.array_equal(np.sort(ids), np.sort(bodies.id)):
        # commands like write_data compute no forces
        bodies.wrench[:, np.argsort(bodies.id)] = wrench[:, np.argsort(ids)]
    bodies.external = integrator.external
    bodies.bind(lammps, integrator.membership)
    bodies.know_box(lammps.box)
    integrator.unchanged.note(integrator)
    host.carry(lammps, bodies)
    host.point()
    bodies.note()
    host.noted()
    integrator.switches = Switches(command, lammps.dimension, integrator.communicator, bodies)
    if notes.pop("new"):
        notes["warnings"] += compare(bodies, lammps, integrator.communicator, integrator.membership)


def _say_kept(integrator: "Integrator", kept: Any) -> None:
    """Put atoms where the shape that their body keeps has them, and tell the user."""
    host = integrator.host
    if kept and kept.text and not integrator.bodies.loose:
        integrator.lammps.x[kept.atoms] += kept.shift
        host.log(kept.text)
    if kept and kept.turned:
        host.log(
            f"{kept.turned} particles were turned with their bodies, which something has moved "
            "between the runs (an orientation that 'set' gave them there is dropped)\n"
        )


def turn_over(integrator: "Integrator") -> None:
    """Atoms of bodies came or are gone in a run, and their bodies with them; collective."""
    molecules = templates.inserted(integrator.host, integrator.communicator)
    told = partial(templates.read, molecules) if molecules else None
    rows = integrator.rows + integrator.kept
    how = {"told": told, "own_rows": rows, **particles(integrator)}
    lines, given = turnover.turn_over(
        integrator.bodies, integrator.lammps, integrator.communicator, integrator.membership, how
    )
    integrator.notes["given"] = np.union1d(integrator.notes["given"], given)
    refuse_turnover(integrator)
    integrator.reports.warn(lines)
    rotation.choose(integrator)
    integrator.parameters[MROT] = rotation.inner_steps(integrator)
    integrator.mask = integrator.switches.mask(integrator.bodies)
    integrator.external.learn()
    integrator.turned_over()
    integrator.unchanged.note(integrator)
    integrator.tell_count()
    integrator.reports.forget()
