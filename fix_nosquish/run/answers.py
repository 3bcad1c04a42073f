"""What LAMMPS and its users ask of the bodies, at any time from the first run on.

Public functions here are methods of `Integrator`, most of them hooks.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TypeVar, cast

import numpy as np

from ..bodies import infile
from ..bodies.bodies import Bodies
from ..errors import refuse
from . import making, output, thermo, velocities
from .schedule import SEEN, Phase

if TYPE_CHECKING:
    from .integrator import Integrator

VALUES = 4  # of f_ID[i] that all integrators have
Found = TypeVar("Found")


@contextmanager
def _as_they_are(bodies: Bodies) -> Iterator[None]:
    """Have the bodies afterwards as they are now, whatever is tried with them."""
    kept = bodies.state.copy()
    yield
    bodies.state[:] = kept


def made(integrator: "Integrator", forces: bool = True) -> Bodies:
    """The bodies, with their forces, if wanted, as a step that is looked at leaves them.

    Raises:
        RunError: on all ranks, before the first run.
    """
    refuse(
        integrator.bodies is None,
        "there is nothing to tell of the bodies before the first run: 'run 0' makes them",
    )
    integrator.come_to_rest(forces)
    return integrator.bodies


def _once(
    integrator: "Integrator", name: str, make: Callable[[Bodies], Found], forces: bool = True
) -> Found:
    """What make(bodies) returned, if nothing has changed the bodies since it was called.

    Args:
        forces: whether it needs the bodies' forces.
    """
    when, found = integrator.known.get(name, (None, None))
    if when != _when(integrator):
        found = make(made(integrator, forces))  # which may change them
        integrator.known[name] = _when(integrator), found
    return found


def _when(integrator: "Integrator") -> tuple[int, int, int]:
    return integrator.lammps.step, integrator.phase, integrator.host.changes


def _see_changed_velocities(integrator: "Integrator") -> None:
    seen = integrator.phase != Phase.NEW and integrator.host.facts & SEEN
    if integrator.lammps.running and seen:
        velocities.take_late(integrator, integrator.lammps.step)


# ----------------------------------------------------------------- tables of bodies


def table(integrator: "Integrator") -> np.ndarray:
    """The bodies that are counted on this rank as they are now: see `output.table`."""
    return output.table(made(integrator), integrator.lammps)


def write_table(integrator: "Integrator") -> None:
    """Write the table of this step to the file of keyword output, if it is due and not written
    yet; collective."""
    asked, file, step = integrator.command.output, integrator.file, integrator.lammps.step
    if asked and file and step % asked.steps == 0 and file.last != step:
        file.write(step, table(integrator))


def compute_array(integrator: "Integrator", i: int, j: int) -> float:
    """Value j of body i: see `output.global_array`; collective."""
    _see_changed_velocities(integrator)
    gather = integrator.communicator.gather_to_all
    rows = _once(
        integrator,
        "array",
        lambda bodies: output.global_array(gather(output.table(bodies, integrator.lammps))),
    )
    integrator.host.lend_array(rows)
    return rows[i, j]


def rows_of_rank(integrator: "Integrator", words: str, groupbit: int) -> tuple[int, int]:
    """What compute rigid/local says of the bodies: see `output.rows_of_rank`; collective.

    Args:
        words: the values, with a space between.  groupbit: of the compute's group.
    Returns:
        the address of the rows, which stay until the next call, and how many there are.
    """
    rows = output.rows_of_rank(made(integrator), integrator.lammps, words.split(), groupbit)
    integrator.rows_lent = rows
    return rows.ctypes.data, len(rows)


def write_restart_file(integrator: "Integrator", name: str) -> None:
    """LAMMPS writes a restart file: keep bodies of which more is known than their atoms beside it,
    to be read as infile; collective."""
    if not integrator.keeps_bodies:
        return
    several = sum(mate.keeps_bodies for mate in integrator.mates) > 1
    own = f".{integrator.host.fix_id}" if several else ""
    path = f"{name}{own}.rigid"
    infile.write(path, integrator.counts_from_one, made(integrator), integrator.membership)


# ----------------------------------------------------------------- thermodynamics


def dof(integrator: "Integrator", group: int) -> int:
    """Degrees of freedom that the bodies take from LAMMPS's group of this number; collective."""
    bodies, lammps, command = integrator.bodies, integrator.lammps, integrator.host.command
    between = integrator.phase == Phase.OVER or not lammps.running
    sets = command[2:3] if between and "velocity" in command[:1] else ()
    if "create" in sets:
        # all atoms' velocities are scaled now; a body keeps its share of them when the run makes
        # them rigid motion
        return 0
    if not lammps.running or bodies is None or "scale" in sets:
        # atoms may be other ones and elsewhere; the bodies of the last run stay as they are
        bodies = making.bodies_of_atoms(integrator)
    scales = "scale" in sets and not bodies.spin
    removed = thermo.removed_freedom_to_scale if scales else thermo.removed_freedom
    return removed(bodies, integrator.communicator, lammps, 1 << group)


def energies(integrator: "Integrator") -> thermo.Energies:
    """Kinetic energies and temperatures: see `thermo.energies`; collective."""
    _see_changed_velocities(integrator)
    ranks, lammps = integrator.communicator, integrator.lammps
    return _once(
        integrator, "energies", lambda bodies: thermo.energies(bodies, ranks, lammps), forces=False
    )


def compute_scalar(integrator: "Integrator") -> float:
    """Temperature of the bodies; collective.

    It is of all components, whether force and torque act on them or not; in the place of a fix
    rigid of those that these act on, as there.
    """
    command, ranks, lammps = integrator.command, integrator.communicator, integrator.lammps
    if command.line.replaces and (command.force or command.torque):

        def of_what_acts(bodies: Bodies) -> float:
            mask = cast(np.ndarray, integrator.mask)  # not all acts
            return thermo.temperature_of(mask, bodies, ranks, lammps)

        return _once(integrator, "active", of_what_acts, forces=False)
    return energies(integrator).temperature


def compute_vector(integrator: "Integrator", i: int) -> float:
    """Kinetic energy of translation and of rotation, temperature of each, and behind them the
    integrator's own; collective."""
    own = i - VALUES
    return energies(integrator)[i] if own < 0 else integrator.own_values()[own]


def kinetic_at_end(integrator: "Integrator") -> tuple[float, float]:
    """The kinetic energy of the bodies at the end of the step, and that of the velocities that the
    atoms have, in LAMMPS's units; collective."""
    now = energies(integrator).kinetic

    def closed(bodies: Bodies) -> float:
        if integrator.mid_step and integrator.phase == Phase.OVER:
            return now + integrator.gained_at_end  # LAMMPS's atoms may be other ones now
        if not integrator.mid_step or integrator.phase != Phase.WAITING:
            return now
        with _as_they_are(bodies):
            integrator.do("close")
            return thermo.energies(bodies, integrator.communicator, integrator.lammps).kinetic

    return _once(integrator, "kinetic", closed, forces=False), now


# ----------------------------------------------------------------- the virial, for LAMMPS's own fix


def virial_of_all(integrator: "Integrator") -> np.ndarray:
    """The virial of all bodies on all ranks, between LAMMPS's forces and final_integrate."""
    virial = np.zeros(6)
    for mate in integrator.mates:
        _add_virial(mate, virial)
    return integrator.communicator.total(virial)


def _add_virial(integrator: "Integrator", virial: np.ndarray) -> None:
    begun = integrator.phase == Phase.HALF
    if begun and not integrator.host.vflag:
        return
    if integrator.host.atoms_moved() or not begun:
        integrator.post_neighbor()
    with _as_they_are(integrator.bodies):
        integrator.do("close" if begun and not integrator.mid_step else "gather")
        integrator.lammps.cells["virial"].set(virial)
        integrator.lammps.cells["atom_virial"].set(np.empty((0, 9)))
        integrator.do("constraint_virial")
