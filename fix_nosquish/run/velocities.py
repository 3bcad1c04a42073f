"""Velocities of the bodies' atoms: given by their motion, and taken from what changes them."""

from typing import TYPE_CHECKING

import numpy as np

from ..bodies.particles import particles_of
from ..box import deform
from ..errors import refuse
from ..motion import step
from . import log, making
from .other_fixes import TEMPER, may_move
from .schedule import Phase

if TYPE_CHECKING:
    from .integrator import Integrator


# of what a thermostat adds to velocities: the part that is no rigid motion, from which on it is
# looked at; and the squared cosine between it and the velocities, below which it is no factor
# (1 for a factor, 1/2 for velocities that are drawn anew)
_LEAST_SHARE, _ALONG = 0.05, 0.75


class Taken:
    """What was no rigid motion of the velocities that bodies took over in a run.

    Attributes:
        said: whether the log tells of it.
        lost: its kinetic energy.  least: the least of it that is no rounding.
    """

    said, lost, least = False, 0.0, 0.0


def set_plain(integrator: "Integrator") -> None:
    """Give the atoms the velocities of their body, in whatever image of it an atom is."""
    step.set_velocities.bind_to(integrator.passes.cells)()


def _change(integrator: "Integrator") -> np.ndarray | None:
    """What others have added to the velocities that the bodies give their atoms, (m, 3); None if it
    is nothing on any rank; collective."""
    bodies, v = integrator.bodies, integrator.lammps.v
    expected = np.empty_like(v)
    step.set_velocities.bind_to(bodies.cells, atom_v=expected)()
    if integrator.streams and integrator.phase != Phase.OVER:
        deform.speed_up.bind_to(bodies.cells, atom_v=expected, sign=1.0)()
    added = v[bodies.index] - expected[bodies.index]
    return added if integrator.communicator.any(added.any()) else None


def say_ignored(integrator: "Integrator", why: str) -> None:
    """Tell the user if velocities were changed between runs that go on; collective."""
    if _change(integrator) is not None:
        integrator.host.log(
            "The velocities of the bodies' atoms were changed between runs: "
            f"without effect, because the bodies go on ({why})\n"
        )


def take_late(integrator: "Integrator", at: int) -> None:
    """If a fix has changed the atoms' velocities at the end of this step, have the bodies move with
    them; collective."""
    due = [fix for fix in integrator.other_fixes.late if at % fix.nevery == 0]
    if integrator.host.follows and any(map(may_move, due)):
        integrator.bodies.refuse_moved_atoms(integrator.lammps)
    added = _change(integrator) if due else None
    if added is None:
        return
    if integrator.streams:
        deform.speed_up.bind_to(integrator.passes.cells, sign=-1.0)()
    energies = take(integrator)
    before, now = integrator.lammps.mvv2e * integrator.communicator.total(energies)
    if log.projected(before - now, before) and any(fix.counts_heat for fix in due):
        _refuse_drawn(integrator, due, added, before - now)
    integrator.set_velocities()
    integrator.known.clear()
    taken = integrator.taken_away
    taken.lost += before - now
    taken.least = log.ROUNDING * before
    if not taken.said:
        taken.said = True
        _say_taken_over(integrator, at, [fix.id for fix in due], before, now)


def _refuse_drawn(integrator: "Integrator", due: list, added: np.ndarray, lost: float) -> None:
    """End the run if a thermostat that counts its heat has given atoms velocities that are not the
    former ones times a factor, and a part of them is lost; collective.

    What factors lose, as of some atoms of a body, is of the second order in the time step, and the
    heat is right to the first; noise loses as much as it counts.

    Args:
        added: (m, 3) to the atoms' velocities.  lost: the kinetic energy that is no rigid motion.
    """
    lammps, index = integrator.lammps, integrator.bodies.index
    mass, v = lammps.masses[index, None], lammps.v[index] - added
    sums = [(mass * part).sum() for part in (v * added, added**2, v**2 * (added != 0))]
    along, square, of_changed = integrator.communicator.total(np.array(sums))
    share = 2.0 * lost / (lammps.mvv2e * square)
    for fix in due:
        refuse(
            fix.counts_heat and share > _LEAST_SHARE and along**2 < _ALONG * square * of_changed,
            f"fix {fix.id} (style {fix.style}) gives each atom of the rigid bodies a velocity of "
            f"its own, and {share:.2g} of that is no rigid motion, but counts as heat: the bodies "
            "would be too cold. Use a thermostat of this package (fix nosquish/nvt, nosquish/npt), "
            "fix langevin, or one that scales velocities, such as temp/csvr",
        )


def _say_taken_over(
    integrator: "Integrator", at: int, fixes: list[str], before: float, now: float
) -> None:
    """Log that bodies took over the velocities that these fixes gave atoms.

    Args:
        before, now: kinetic energy of these velocities, and of the bodies' motion.
    """
    names = " or ".join(fixes)
    names = names if fixes[0] == TEMPER else f"fix {names}"
    kept = " (not those of the infile)" if integrator.infile else ""
    if integrator.keeps_bodies and not kept:
        kept = " (not those with a mass, com or inertia of their molecule template)"
    lost = f"; {before - now:.4g} of the kinetic energy {before:.8g} was none, and is lost"
    lost = lost if log.projected(before - now, before) else ""
    integrator.host.log(
        f"The velocities of the bodies' atoms were changed at the end of step {at} (by "
        f"{names}): the bodies take them over, as rigid motion{kept}{lost}\n"
    )


def say_lost(integrator: "Integrator") -> None:
    """Log, at the end of a run, how much kinetic energy was lost as velocities were taken over."""
    if integrator.taken_away.lost > integrator.taken_away.least:
        integrator.host.log(
            f"In this run {integrator.taken_away.lost:.6g} of the kinetic energy that other fixes "
            "gave was no rigid motion, and is lost\n"
        )


def take(integrator: "Integrator") -> np.ndarray:
    """Have the bodies move as their atoms do, but for those of which more is known; collective.

    Returns:
        (2,) the kinetic energy of this rank's atoms before and of its bodies now, but for those of
        which more is known.
    """
    bodies, lammps, particles = integrator.bodies, integrator.lammps, None
    given = np.isin(bodies.id, integrator.notes.prescribed_ids)
    before = bodies.kinetic_of_atoms(lammps)
    if bodies.spin:
        particles = particles_of(lammps, integrator.shapes(), bodies.index)
        before = before + particles.kinetic()
    bodies.take_velocities(lammps, particles, given, bodies.momenta()[:, given])
    after = bodies.kinetic()[:, bodies.sharers.owned & ~given]
    return np.array([before[~given[bodies.body]].sum(), after.sum()])


def zero_momentum(integrator: "Integrator") -> None:
    """Stop the bodies' translation, between runs; collective."""
    _zero(integrator, "v")


def zero_rotation(integrator: "Integrator") -> None:
    """Stop the bodies' rotation, between runs; collective."""
    _zero(integrator, "p")


def _zero(integrator: "Integrator", name: str) -> None:
    """Stop a motion of the bodies, v or p, that the next run will have: those of the last one, or
    those that it makes of the atoms; collective."""
    lammps = integrator.lammps
    if integrator.goes_on:
        bodies = integrator.bodies
    else:
        bodies = making.bodies_of_atoms(integrator)
        bodies.bind(integrator.membership)
        bodies.update_box(lammps.box)
    getattr(bodies, name)[:] = 0.0
    atom_v = lammps.v  # before a first run no cell points there
    step.set_velocities.bind_to(bodies.cells, atom_v=atom_v)()
    integrator.known.clear()
