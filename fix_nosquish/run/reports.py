"""What LAMMPS and the user are told of bodies: log, degrees of freedom, virial, thermo, table."""

import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from ..bodies import infile
from ..bodies.bodies import Bodies
from ..errors import RunError
from . import log, making, other_fixes, output, thermo, velocities
from .schedule import SEEN, Phase

if TYPE_CHECKING:
    from .integrator import Integrator

Found = TypeVar("Found")


@contextmanager
def _as_they_are(bodies: Bodies) -> Iterator[None]:
    """Have the bodies afterwards as they are now, whatever is tried with them."""
    kept = bodies.state.copy()
    yield
    bodies.state[:] = kept


class Reports:
    """Tells of an integrator's bodies.

    Args:
        integrator: the `Integrator`.

    Attributes:
        file: the `output.BodyFile` of keyword output, None if there is none (yet).
    """

    def __init__(self, integrator: "Integrator") -> None:
        # no circle: the integrator goes when LAMMPS lets go of it
        self._integrator: Integrator = weakref.proxy(integrator)
        self.file: output.BodyFile | None = None
        self._said: list[str] = []  # of the log's lines
        self._warned: set[str] = set()
        self._heard = False  # whether this run's log tells of velocities that were taken over
        self._known: dict[str, Any] = {}  # what was found out of the bodies
        self._known_when: tuple | None = None  # of which state of the bodies
        # kinetic energy that the end of the last step gives; that was lost as velocities were taken
        # over; and the least that is no rounding
        self._gained_at_end = self._lost = self._least = 0.0

    def begin(self) -> None:
        """A run begins."""
        self._heard, self._lost, self._least = False, 0.0, 0.0
        self.forget()

    def forget(self) -> None:
        """What was found out of the bodies is no longer so."""
        self._known_when = None

    # ------------------------------------------------------------- the log

    def say(self, virial: bool) -> None:
        """Log what the bodies are, if that has changed, and what was taken from velocities."""
        integrator, notes = self._integrator, self._integrator.notes
        lines, removed = log.summary(integrator, virial)
        warnings = log.warnings(integrator)
        said, self._said = self._said, lines[:4]
        if not said or said[:3] != lines[:3]:
            integrator.host.log("\n".join([*lines, *integrator.host.advice(removed), ""]))
        elif said[3] != lines[3] and log.projected(notes.removed, notes.kinetic):
            integrator.host.log(lines[3] + "\n")
        self.warn(warnings)

    def warn(self, lines: Sequence[str]) -> None:
        """Log these lines, each of them once."""
        new = [line for line in lines if line not in self._warned]
        self._warned.update(new)
        if new:
            self._integrator.host.log(self._integrator.line.naming("\n".join([*new, ""])))

    def say_taken_over(self, at: int, fixes: list[str], before: float, now: float) -> None:
        """Log, once a run, that bodies took over the velocities that these fixes gave atoms.

        Args:
            before, now: kinetic energy of these velocities, and of the bodies' motion.
        """
        self._lost += before - now
        self._least = log.ROUNDING * before
        if not self._heard:
            self._heard = True
            names = " or ".join(fixes)
            names = names if fixes[0] == other_fixes.TEMPER else f"fix {names}"
            kept = " (not those of the infile)" if self._integrator.infile else ""
            if self._integrator.keeps_bodies and not kept:
                kept = " (not those with a mass, com or inertia of their molecule template)"
            lost = f"; {before - now:.4g} of the kinetic energy {before:.8g} was none, and is lost"
            lost = lost if log.projected(before - now, before) else ""
            self._integrator.host.log(
                f"The velocities of the bodies' atoms were changed at the end of step {at} (by "
                f"{names}): the bodies take them over, as rigid motion{kept}{lost}\n"
            )

    def say_lost(self) -> None:
        """Log, at the end of a run, how much kinetic energy was lost as velocities were taken
        over."""
        if self._lost > self._least:
            self._integrator.host.log(
                f"In this run {self._lost:.6g} of the kinetic energy that other fixes gave was no "
                "rigid motion, and is lost\n"
            )

    # ------------------------------------------------------------- the table of bodies

    def open(self) -> None:
        """Open the file of keyword output, if there is to be one and it is not open."""
        integrator = self._integrator
        if not integrator.command.output or self.file:
            return
        path = integrator.lammps.text(integrator.command.output.file)
        files = [mate.reports.file for mate in integrator.mates]
        if any(file and file.path == path for file in files):
            raise RunError(
                f"two fixes write their table of bodies (keyword output) to {path}: "
                "give each a file of its own",
                everywhere=True,
            )
        if integrator.respa_dt and not integrator.host.calls_setup:
            raise RunError(
                "keyword output needs the plugin's fix python/move under run_style respa: "
                "this LAMMPS's own knows no end of a step",
                everywhere=True,
            )
        self.file = output.BodyFile(path, integrator.lammps.units, integrator.communicator)

    def write(self) -> None:
        """Write the table of this step, if it is due and not written yet."""
        integrator, asked = self._integrator, self._integrator.command.output
        step = integrator.lammps.step
        if self.file and asked and step % asked.steps == 0 and self.file.last != step:
            integrator.come_to_rest()
            self.file.write(step, output.table(integrator.bodies, integrator.lammps))

    def table(self) -> np.ndarray:
        """The bodies that are counted on this rank as they are now: see `output.table`."""
        return output.table(self.made(), self._integrator.lammps)

    def write_restart_file(self, name: str) -> None:
        """Keep the bodies beside a restart file, to be read as infile, if their atoms do not tell
        all of them; collective."""
        integrator = self._integrator
        if not integrator.keeps_bodies:
            return
        several = sum(mate.keeps_bodies for mate in integrator.mates) > 1
        own = f".{integrator.host.fix_id}" if several else ""
        path = f"{name}{own}.rigid"
        infile.write(path, integrator.counts_from_one, self.made(), integrator.membership)

    def made(self, forces: bool = True) -> Bodies:
        """The bodies, with their forces, if wanted, as a step that is looked at leaves them.

        Raises:
            RunError: on all ranks, before the first run.
        """
        integrator = self._integrator
        if integrator.bodies is None:
            raise RunError(
                "there is nothing to tell of the bodies before the first run: 'run 0' makes them",
                everywhere=True,
            )
        integrator.come_to_rest(forces)
        return integrator.bodies

    # ------------------------------------------------------------- thermodynamics

    def virial_of_all(self) -> np.ndarray:
        """The virial of all bodies on all ranks, between LAMMPS's forces and final_integrate."""
        virial = np.zeros(6)
        for mate in self._integrator.mates:
            mate.reports._add_early(virial)
        return self._integrator.communicator.total(virial)

    def _add_early(self, virial: np.ndarray) -> None:
        integrator = self._integrator
        begun, bodies = integrator.phase == Phase.HALF, integrator.bodies
        if begun and not integrator.host.vflag:
            return
        if integrator.host.atoms_moved() or not begun:
            integrator.post_neighbor()
        with _as_they_are(bodies):
            integrator.do("close" if begun and not integrator.mid_step else "gather")
            integrator.lammps.cells["virial"].set(virial)
            integrator.lammps.cells["atom_virial"].set(np.empty((0, 9)))
            integrator.do("constraint_virial")

    def removed_freedom(self, group: int) -> int:
        """Degrees of freedom that bodies take from LAMMPS's group of this number; collective."""
        integrator = self._integrator
        bodies, running = integrator.bodies, integrator.lammps.running
        command, between = integrator.host.command, integrator.is_over or not running
        sets = command[2:3] if between and "velocity" in command[:1] else ()
        if "create" in sets:
            # all atoms' velocities are scaled now; a body keeps its share of them when the run
            # makes them rigid motion
            return 0
        if not running or bodies is None or "scale" in sets:
            # atoms may be other ones and elsewhere; the bodies of the last run stay as they are
            bodies = making.bodies_of_atoms(integrator)
        bit = 1 << group
        if "scale" in sets and not bodies.spin:
            return thermo.removed_freedom_to_scale(
                bodies, integrator.communicator, bit, integrator.lammps
            )
        inside = integrator.lammps.groups[bodies.index] & bit != 0
        return thermo.removed_freedom(bodies, integrator.communicator, inside, integrator.lammps)

    def energies(self) -> thermo.Energies:
        """Kinetic energies and temperatures: see `thermo.energies`; collective."""
        self._see_changed_velocities()
        return self._once("energies", self._energies, forces=False)

    def _energies(self, bodies: Bodies) -> thermo.Energies:
        integrator = self._integrator
        return thermo.energies(bodies, integrator.communicator, integrator.lammps)

    def temperature_of(self, mask: Callable[[Bodies], np.ndarray]) -> float:
        """The temperature of some components; collective. Args: mask: of `thermo.temperature_of`,
        a function of the bodies."""
        ranks, lammps = self._integrator.communicator, self._integrator.lammps
        return self._once(
            "active",
            lambda bodies: thermo.temperature_of(mask(bodies), bodies, ranks, lammps),
            forces=False,
        )

    def kinetic_at_end(self) -> tuple[float, float]:
        """The kinetic energy of the bodies at the end of the step, and that of the velocities that
        the atoms have, in LAMMPS's units; collective."""
        integrator, now = self._integrator, self.energies().kinetic

        def closed(bodies: Bodies) -> float:
            if integrator.mid_step and integrator.is_over:  # LAMMPS's atoms may be other ones now
                return now + self._gained_at_end
            if not integrator.mid_step or integrator.phase != Phase.WAITING:
                return now
            with _as_they_are(bodies):
                integrator.do("close")
                return self._energies(bodies).kinetic

        return self._once("kinetic", closed, forces=False), now

    def end_run(self) -> None:
        """A run is over: keep what is to be known between runs; collective."""
        end, now = self.kinetic_at_end()
        self._gained_at_end = end - now

    def array(self) -> np.ndarray:
        """What fix rigid gives as its global array: see `output.global_array`; collective."""
        self._see_changed_velocities()
        integrator = self._integrator

        def gathered(bodies: Bodies) -> np.ndarray:
            rows = output.table(bodies, integrator.lammps)
            return output.global_array(integrator.communicator.gather_to_all(rows))

        return self._once("array", gathered)

    def _once(self, name: str, make: Callable[[Bodies], Found], forces: bool = True) -> Found:
        """What make(bodies) returned, if nothing has changed the bodies since it was called.

        Args:
            forces: whether it needs the bodies' forces.
        """
        if self._known_when != self._when() or name not in self._known:
            bodies = self.made(forces)  # which may change them
            if self._known_when != self._when():
                self._known_when, self._known = self._when(), {}
            self._known[name] = make(bodies)
        return self._known[name]

    def _when(self) -> tuple[int, int, int]:
        integrator = self._integrator
        return integrator.lammps.step, integrator.phase, integrator.host.changes

    def _see_changed_velocities(self) -> None:
        integrator = self._integrator
        seen = integrator.phase != Phase.NEW and integrator.host.facts & SEEN
        if integrator.lammps.running and seen:
            velocities.take_late(integrator, integrator.lammps.step)
