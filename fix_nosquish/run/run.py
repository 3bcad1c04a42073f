"""A run of LAMMPS: what is found out as it begins, and what is done in it."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import gcd
from typing import Any, TypeVar

import numpy as np

from ..bodies.bodies import Bodies
from ..bodies.build import BuildReport
from ..bodies.membership import Membership
from ..bodies.species import compare
from ..box import deform
from ..errors import RunError, refuse
from ..host.command import Command
from ..host.hosts import Host, OtherFix, Phase
from ..host.lammps import Lammps
from ..loops import machine_code
from ..ranks.communicator import Alone
from . import cards, gravity, log, making, schedule, switches, velocities, watch
from .external import ExternalForces
from .integrator import Integrator
from .making import BodyMaker
from .minimization import Minimization
from .other_fixes import (
    OtherFixes,
    Ours,
    acts_on_bodies,
    reading_pair_style,
    refuse_constraints,
    refuse_other_integrators,
)
from .output import BodyFile, table
from .part import box_every, needs_energy
from .passes import Conditions, Passes
from .registry import Sibling, refuse_shared_atoms
from .rotation import Rotation
from .schedule import ACTIONS, GATHERS, LATE, LEVELS, LOOKS, MID_STEP, RESETS, SEEN, WATCHED
from .thermo import Energies, Thermo
from .velocities import AtomVelocities, LostEnergy
from .watch import BoxWatch, MassWatch

T = TypeVar("T")


@dataclass
class MadeBodies:
    """The bodies of a fix, from their making on.

    Attributes:
        bodies: the `Bodies`.  report: on how they were made.  masses: the `MassWatch`.
        switches: what keywords force and torque say of them.
        started: whether the integrator's rows of them have been set.
    """

    bodies: Bodies
    report: BuildReport
    masses: MassWatch
    switches: list[switches.Choice]
    started: bool = False


@dataclass
class Setting:
    """What a fix has for all of its runs.

    Attributes:
        lammps, ranks, host: LAMMPS, its `Communicator` or `ALONE`, and what calls the fix.
        command: the words of the fix line.
        integrator: what declares the step.
        membership: which atom is in which body.  maker: makes the bodies.
        rotation: how they rotate.  external: external forces on them.
        log: the lines that the log has.
        siblings: gives the other fixes of this package.
        rigid_flag: whether pair styles may ask for the bodies' masses, as those of grains do.
        infile: the path of the infile, None for none.
        table: the file of keyword output, None as long as there is none.
        made: the bodies, None before the first run, and if one could not begin.
        ran: whether a run has begun.
        parameters: the record of the integrator's parameters, of the last run that could begin;
            None before it.
        pending_half_kick: with `mid_step`, the time step of the half kick that is left to the next
            run's first step: 0.0 if none is, None if it is that of this step.
    """

    lammps: Lammps
    ranks: Alone
    host: Host
    command: Command
    integrator: Integrator
    membership: Membership
    maker: BodyMaker
    rotation: Rotation
    external: ExternalForces
    log: log.LogLines
    siblings: Callable[[], list[Sibling]]
    rigid_flag: bool
    infile: str | None
    table: BodyFile | None = None
    made: MadeBodies | None = None
    ran: bool = False
    parameters: Any = None
    pending_half_kick: float | None = None

    @property
    def keeps_bodies(self) -> bool:
        """Whether more is known of some bodies than their atoms tell."""
        return bool(self.infile or (self.made and len(self.made.report.prescribed_ids)))

    @property
    def goes_on(self) -> bool:
        """Whether the next run has the bodies of the last one."""
        return self.ran and (not self.command.reinit or self.keeps_bodies)

    @property
    def previous(self) -> Bodies | None:
        """The bodies of the last run, None before the first one.

        Raises:
            RunError: on all ranks, if they are gone.
        """
        refuse(
            self.made is None and self.ran and not self.infile,
            "the bodies of the last run are gone, because this one could not begin: "
            "unfix this fix and define it again",
        )
        return self.made.bodies if self.made else None


class Cache:
    """Values that were computed of the bodies, as long as nothing has changed these.

    Args:
        lammps, host: they tell when the bodies change.
    """

    def __init__(self, lammps: Lammps, host: Host) -> None:
        self._lammps, self._host = lammps, host
        self._values: dict[str, Any] = {}

    def get(self, name: str, make: Callable[[], T]) -> T:
        """What make() has returned for this name, or returns now."""
        when, value = self._values.get(name, (None, None))
        if when != self._now():
            value = make()  # which may change the bodies
            self._values[name] = self._now(), value
        return value

    def clear(self) -> None:
        """The bodies have changed without a number that says so."""
        self._values.clear()

    def _now(self) -> tuple[int, int, int]:
        return self._lammps.step, self._host.phase, self._host.changes


class Run:
    """A run of LAMMPS with a fix of this package.

    `begin_run` makes it.  Methods are collective.

    Attributes:
        lammps, ranks, host, command, integrator, membership, external: see `Setting`.
        bodies, report: see `MadeBodies`.
        siblings: the other fixes of this package.
        other_fixes: all other ones, `OtherFixes`.
        levels: the time steps of run_style respa's levels, innermost first; empty without it.
        mid_step: whether atoms have the velocities of the middle of the step at its end.
        goes_on: whether the bodies are those of the last run.
        half_step: whether atoms' velocities may be read in the middle of a step.
        deformed_box: the box of another fix with which bodies move, None if none does.
        remaps_velocities: whether this is with remap v.
        gravity: the acceleration of keyword gravity, (3,); None without it.
        switches: what keywords force and torque switch off.
        box: the `BoxWatch`.  masses_may_change: whether a fix may change masses.
        passes: the `Passes`.  cards: the `Cards`.
        thermo: the `Thermo` of the bodies.  velocities: those of their atoms.
        minimization: the bodies' coordinates in a minimization; None in a run.
        first_step: the step at which it began.
        stepped: whether it has made a step, so far as it is known.
    """

    passes: Passes

    def __init__(self, setting: Setting, made: MadeBodies, look: "Look") -> None:
        self._setting, self._made = setting, made
        self.lammps, self.ranks, self.host = setting.lammps, setting.ranks, setting.host
        self.command, self.integrator = setting.command, setting.integrator
        self.membership, self.external = setting.membership, setting.external
        self.bodies, self.report = made.bodies, made.report
        self.siblings, self.other_fixes, self.levels = look.siblings, look.fixes, look.levels
        self.mid_step, self.goes_on, self.half_step = look.mid_step, look.goes_on, look.half_step
        self.deformed_box = look.deformed_box
        self.remaps_velocities = look.remaps_velocities
        may_change = look.fixes.change_box and look.deformed_box is None
        self.box = BoxWatch(made.bodies, self.lammps, may_change, bool(self.box_every))
        self.masses_may_change = watch.masses_may_change(look.fixes, self.lammps)
        self.gravity = gravity.acceleration(
            self.command,
            self.host,
            self.integrator.method,
            needs_energy=self.needs_energy,
            levels=bool(self.levels),
        )
        self.switches = made.switches
        self.cards = cards.Cards()
        self.minimization: Minimization | None = None
        self.thermo = Thermo(made.bodies, self.lammps, self.ranks)
        self.velocities = AtomVelocities(
            made.bodies, self.lammps, self.ranks, made.report, setting.maker.shapes,
            self.remaps_velocities,
        )  # fmt: skip
        self.cache = Cache(self.lammps, self.host)
        self.lost = LostEnergy()
        self.first_step, self.stepped = self.lammps.step, False
        self._missing_energy = 0.0  # that the end of the last step would give, with mid_step
        self.ours = Ours(
            self.host.fix_id, self.command, bool(self.box_every), bool(self.integrator.thermostat)
        )

    # ------------------------------------------------------------- facts

    @property
    def box_every(self) -> int:
        """The box changes in the steps after the multiples of this; 0 for never."""
        return box_every(self.integrator.parts)

    @property
    def needs_energy(self) -> bool:
        """Whether the integrator needs the potential energy in some steps."""
        return needs_energy(self.integrator.parts)

    @property
    def phase(self) -> Phase:
        """Where in a run the bodies are."""
        return Phase(self.host.phase)

    @property
    def mask(self) -> np.ndarray | None:
        """Mask of active force and torque components, (6, n) or (6, 1); None if all are active."""
        return switches.mask(self.switches, self.bodies)

    @property
    def has_bodies(self) -> bool:
        """Whether it was not dropped."""
        return "bodies" in vars(self)

    def drop(self) -> None:
        """Free all memory, because the next run makes its bodies: nothing can be asked any more."""
        vars(self).clear()

    @property
    def steps_made(self) -> bool:
        """Whether it has made a step: commands rerun and minimize make none."""
        steps = self.lammps.step != self.first_step and self.minimization is None
        return steps and self.host.command[:1] != ["rerun"]

    @property
    def parameters(self) -> Any:
        """See `Setting`; of this run as soon as it has some."""
        return self._setting.parameters

    @property
    def pending_half_kick(self) -> float | None:
        """See `Setting`."""
        return self._setting.pending_half_kick

    @pending_half_kick.setter
    def pending_half_kick(self, dt: float | None) -> None:
        self._setting.pending_half_kick = dt

    def number(self, keyword: str) -> float:
        """The number of one of `extra_keywords`, or the value of its variable now."""
        return self.lammps.number(self.command.own[keyword])

    def acts_on_bodies(self, fix: OtherFix) -> bool:
        """Whether atoms of the bodies are in another fix's group."""
        return acts_on_bodies(fix, self.membership)

    def is_outermost(self, level: int) -> bool:
        """Whether a level of run_style respa is the outermost."""
        return level == len(self.levels) - 1

    # ------------------------------------------------------------- passes and the schedule

    def run_passes(self, name: str, step: int | None = None) -> None:
        """Run a list of passes, with the forces of this step, by default of now."""
        if found := self.passes.run(name):
            self.raise_failure(found, step)

    def raise_failure(self, found: int, step: int | None = None) -> None:
        """Raise the error of a pass that returned this number."""
        if found < 0:
            raise RunError(self.integrator.failure(found, self), everywhere=True)
        step = self.lammps.step if step is None else step
        name = self.membership.name
        raise log.of_infinite_forces(self.thermo, name, self.phase == Phase.NEW, step)

    def follow(self, hook: str) -> None:
        """Do what the schedule has for a hook."""
        schedule.follow(hook, self.host, self.passes, self.act)

    def act(self, number: int, found: int) -> None:
        """Do what the action of this number has for Python.

        Args:
            found: what a pass of it has returned, 0 if none has failed.
        """
        action = ACTIONS[number]
        if action.call:
            getattr(self, action.call)()
        elif found:  # a step begins with the forces of the last one
            self.raise_failure(found, self.lammps.step - (action.hook == "begin"))

    # ------------------------------------------------------------- a run begins

    def start(self) -> None:
        """Begin to move, now that the first forces are known."""
        made, scheme = self._made, self.integrator.scheme
        for part in self.integrator.parts:
            part.start(self)
        if self.masses_may_change:
            made.masses.refuse_change()
        if self.goes_on:  # with the IDs and masses that a script has given atoms between runs
            self.bodies.update_tags(self.lammps)
            made.masses.note()
        refuse_constraints(self.other_fixes, self.ours, self.host)
        gravity.refuse_twice(
            self.command, self.other_fixes, self.acts_on_bodies, self.lammps.scalar_of_fix
        )
        self.run_passes("gather")
        self.cache.clear()
        if self.integrator.mid_step and not self.mid_step and self.pending_half_kick:
            self._end_half_kick(self.pending_half_kick)
        if scheme.start and not made.started:
            scheme.start.bind_to(self.passes.cells)()
        made.started = True
        if self.goes_on:
            if not self.remaps_velocities:  # where an atom enters the box, LAMMPS changes its own
                given = "some have what their molecule template says"
                self._report_ignored(given if self.command.reinit else "reinit no")
            self.set_velocities()
        self._setting.ran = True
        # LAMMPS asks the fixes after this one for their forces later
        if self.other_fixes.change_forces and not self.mid_step:
            self.host.facts |= GATHERS

    def _end_half_kick(self, dt: float) -> None:
        """Do what a run without levels has left: with levels a step ends with its second half."""
        self.passes.level_dt.set(dt)
        self.run_passes("close")
        self.take_time_step()
        self.set_velocities()
        self.pending_half_kick = 0.0

    def report_start(self) -> None:
        """Log the bodies as a run begins."""
        self.report_bodies(bool(self.host.vflag))
        start = self.bodies.start = log.forces_at_start(self.thermo, self.membership.name)
        movers = self.other_fixes.possible_movers()
        names = " or ".join(f"fix {fix.id} (style {fix.style})" for fix in movers)
        self.bodies.possible_causes = names and f", perhaps {names}"
        if start.diagnosis and not self.minimization:
            self._setting.log.warn([f"WARNING: {start.diagnosis}: {start.advice}"])

    def report_bodies(self, virial: bool) -> None:
        """Log what the bodies are, if that has changed, and warnings.

        Args:
            virial: whether LAMMPS asks for it.
        """
        facts, command = log.facts_of(self.thermo, self.report), self.command
        lines = log.of_words(command, self.lammps)
        lines += self.cards.copies(self.ranks.count(self.lammps.setting("nmax")))
        if command.details:
            lines.append(log.work(facts, self._step_facts(virial), command, self.other_fixes))
        note = getattr(self.integrator.thermostat, "freedom_note", "")
        lines = log.summary(facts, self.integrator.method, command, note, lines)
        warnings = [*self._warnings()]
        projected = velocities.is_projected(self.report.removed, self.report.kinetic)
        self._setting.log.summary(lines, self.host.advice(facts.removed), projected)
        self._setting.log.warn(warnings)

    def _step_facts(self, virial: bool) -> log.StepFacts:
        integrator = self.integrator
        return log.StepFacts(
            splits=integrator.splits,
            exact=self._setting.rotation.exact,
            spin=self.bodies.spin,
            oriented=self.bodies.oriented,
            thermostat=bool(integrator.thermostat),
            box_every=self.box_every,
            two_passes=bool(integrator.scheme.go_on),
            external=self.external.acts,
            half_step=self.half_step,
            virial=virial,
        )

    def _warnings(self) -> Iterator[str]:
        """Lines on what is probably not meant."""
        integrator, command = self.integrator, self.command
        warmed = bool(integrator.thermostat or command.steps)
        yield from log.of_start(self.report, warmed, (self.host.group, command.group))
        yield from log.of_changes(self.membership.changes())
        yield from self.report.warnings
        for part in integrator.parts:
            yield from part.extra_warnings(self)
        yield from integrator.extra_warnings(self)
        yield from log.of_motion(self.thermo, self.mask, self.membership.name)
        yield from log.of_time_step(self.lammps)

    def set_up(self) -> None:
        """The first step begins, and LAMMPS has called no setup before it."""
        self.resume()
        self.follow_atoms()
        host, setting = self.host, self._setting
        vflag, table = host.vflag, setting.table  # they are for the step which begins
        host.vflag, setting.table = 0, None
        self.follow("setup")
        host.vflag, setting.table = vflag, table

    def continue_(self) -> None:
        """Begin a run that goes on from the last one without a set-up, with 'pre no'."""
        self.box.refuse_change(self.lammps.box.periodic)
        self.host.point()
        self.bodies.refuse_moved_atoms(self.lammps)
        self.external.refuse_change()
        self.resume()
        self._report_ignored("pre no")

    def resume(self) -> None:
        """The first step begins without a set-up before it."""
        for part in self.integrator.parts:
            part.resume(self)

    def _report_ignored(self, why: str) -> None:
        """Log that velocities were changed between runs that go on, if they were."""
        if self.velocities.added(self.phase != Phase.OVER) is not None:
            self.host.log(
                "The velocities of the bodies' atoms were changed between runs: "
                f"without effect, because the bodies go on ({why})\n"
            )

    # ------------------------------------------------------------- steps

    def take_time_step(self) -> None:
        """Have the loops use the time step as it is now."""
        self.dt, self.levels = self.lammps.dt, self.lammps.respa_dt
        self.passes.dt.set(self.levels[0] if self.levels else self.dt)
        self.passes.level_dt.set(self.dt)
        self.passes.begins.set(not self.levels)  # there each level begins separately

    def note_pending(self) -> None:
        """Keep the time step of the last step, if there was one."""
        if self.stepped:
            self.pending_half_kick, self.stepped = self.dt if self.mid_step else 0.0, False

    def begin_level(self, vflag: int, level: int) -> None:
        """A level of run_style respa begins a step; the innermost one, 0, moves the bodies."""
        self.host.vflag, self.stepped = vflag, True
        outermost = self.is_outermost(level)
        if outermost:
            self.follow("begin")
        self.passes.level_dt.set(self.levels[level])
        self.run_passes("kick", self.lammps.step - outermost)
        if level == 0:
            self.follow("move")

    def end_level(self, level: int) -> None:
        """A level's new forces end its step."""
        if self.box.may_change:
            self.refuse_new_box()
        self.passes.level_dt.set(self.levels[level])
        self.run_passes("close")
        self.cache.clear()
        if self.is_outermost(level) or self.half_step:
            self.set_velocities()

    def begin_trajectory(self) -> None:
        """The step host.begins is about to begin."""
        for part in self.integrator.parts:
            part.begin_trajectory(self)

    def take_energy(self) -> None:
        """The potential energy of the step host.energy_step is known."""
        for part in self.integrator.parts:
            part.end_trajectory(self)

    def follow_atoms(self) -> None:
        """Follow the atoms after LAMMPS has re-neighbored: they have new indices, and some are on
        other ranks."""
        self.box.refuse_change(self.lammps.box.periodic)
        self.host.point()
        if not self.bodies.follow(self.lammps):
            self._update_membership()
        self.host.noted()
        if self.switches and (mask := self.mask) is not None:
            self.bodies.cells["mask"].set(mask)
        if self.masses_may_change:
            self._made.masses.refuse_change()
        if self._setting.rigid_flag:
            body = np.full(len(self.lammps.groups), -1, np.int32)
            body[self.bodies.index] = self.bodies.body
            self.host.set_bodies(body, self.bodies.mass)

    def _update_membership(self) -> None:
        """Add and remove bodies whose atoms came or are gone."""
        setting, integrator = self._setting, self.integrator
        lines = setting.maker.update(self.bodies, self.report)
        refuse(
            integrator.scheme.start or self.box_every or self.needs_energy,
            f"bodies came or are gone by step {self.lammps.step}, which the integrator "
            f"{self.command.line.name} does not support in a run: use fix nosquish/nvt or fix "
            "nosquish/nve, or insert and delete between runs, with reinit yes",
        )
        setting.log.warn(lines)
        setting.rotation.choose(self.bodies, self.ranks, self.host)
        self.parameters.mrot = setting.rotation.inner_steps
        self.external.set_bodies(self.bodies)
        for part in integrator.parts:
            part.bodies_changed(self)
        self._made.masses.note()
        self.tell_count()
        self.cache.clear()

    def tell_count(self) -> None:
        """Tell LAMMPS how many bodies there are."""
        self.host.set_array_rows(self.ranks.count(self.bodies.listed.sum()))

    def push(self) -> None:
        """The forces of a step are known: evaluate external forces."""
        self.external.evaluate(self.bodies, about_centre=bool(self.box_every))

    def refuse_new_box(self) -> None:
        """End the run if something has changed the box."""
        self.box.refuse_change()

    def set_velocities(self) -> None:
        """Give the atoms the velocities of the bodies' motion."""
        self.run_passes("velocities")
        facts, between = self.host.facts, self.phase == Phase.HALF
        self.host.facts = facts & ~SEEN if between else facts | SEEN

    def take_late_velocities(self) -> None:
        """Take over velocities that other fixes may have changed at the end of the last step."""
        self._take_late(self.lammps.step - 1)

    def take_seen_velocities(self) -> None:
        """Take over velocities that other fixes may have changed in this step, if its end is
        reached."""
        seen = self.phase != Phase.NEW and self.host.facts & SEEN
        if self.lammps.running and seen:
            self._take_late(self.lammps.step)

    def _take_late(self, at: int) -> None:
        """Have the bodies move with velocities that fixes have changed at the end of this step."""
        due = velocities.acting_at(self.other_fixes.late, at)
        if velocities.may_have_moved(due):
            self.bodies.refuse_moved_atoms(self.lammps)
        remapped = self.phase != Phase.OVER
        energies = velocities.take_changes(due, self.velocities, remapped)
        if energies is None:
            return
        self.set_velocities()
        self.cache.clear()
        before, now = energies
        self.lost.total += before - now
        self.lost.least = velocities.ROUNDING * before
        if not self.lost.logged:
            self.lost.logged, excepted = True, ""
            if self._setting.infile:
                excepted = " (not those of the infile)"
            elif self._setting.keeps_bodies:
                excepted = " (not those with a mass, com or inertia of their molecule template)"
            self.host.log(velocities.report_of_changes(at, due, energies, excepted))

    def write_table(self) -> None:
        """Write the table of this step to the file of keyword output, if it is due and not written
        yet."""
        asked, file, step = self.command.output, self._setting.table, self.lammps.step
        if asked and file and step % asked.steps == 0 and file.last != step:
            self.complete_step()
            file.write(step, table(self.bodies, self.lammps))

    def complete_step(self, forces: bool = True) -> None:
        """Have the bodies as at the end of a step with output, with their forces, if wanted."""
        self.follow("complete")
        if forces:
            self.follow("know_forces")

    def end(self) -> None:
        """Have the atoms as the bodies are, now that the run is over."""
        self.stepped |= self.steps_made
        if self.other_fixes or self.other_fixes.unknown:  # else nothing has changed the atoms
            self._made.masses.refuse_change()
        if self.other_fixes:
            self.bodies.refuse_moved_atoms(self.lammps)
        self.complete_step()
        if not self.host.facts & SEEN:
            self.set_velocities()
        self._take_late(self.lammps.step)
        if report := self.lost.report():
            self.host.log(report)
        if self.remaps_velocities:  # a body has one velocity between runs, wherever its atoms are
            self.bodies.settle(self.lammps)
            self.velocities.set_in_body()
        self.cache.clear()
        if self.mid_step:
            end, now = self.kinetic_at_end()
            self._missing_energy = end - now
        for part in self.integrator.parts:
            part.end(self)

    # ------------------------------------------------------------- what is asked of the bodies

    def completed_bodies(self, forces: bool = True) -> Bodies:
        """The bodies as at the end of a step with output, with their forces, if wanted."""
        self.complete_step(forces)
        return self.bodies

    def cached(self, name: str, make: Callable[[], T], forces: bool = True) -> T:
        """What make() returns of the bodies at the end of the step, once for each step.

        Args:
            forces: whether it needs the bodies' forces.
        """

        def made() -> T:
            self.complete_step(forces)
            return make()

        return self.cache.get(name, made)

    def energies(self) -> Energies:
        """Kinetic energies and temperatures of the bodies."""
        self.take_seen_velocities()
        return self.cached("energies", self.thermo.energies, forces=False)

    def kinetic_at_end(self) -> tuple[float, float]:
        """The kinetic energy of the bodies at the end of the step, and that of the velocities that
        the atoms have, in LAMMPS's units."""
        now = self.energies().kinetic

        def at_end() -> float:
            if self.mid_step and self.phase == Phase.OVER:
                return now + self._missing_energy  # LAMMPS's atoms may be other ones now
            if not self.mid_step or self.phase != Phase.WAITING:
                return now
            with _restored(self.bodies):
                self.run_passes("close")
                return self.thermo.energies().kinetic

        return self.cached("kinetic", at_end, forces=False), now

    def count_virial(self, *, ends: bool) -> None:
        """Add the constraint virial to LAMMPS's cell `virial`; the bodies stay as they are.

        Args:
            ends: whether a step ends with the forces of now.
        """
        with _restored(self.bodies):
            self.run_passes("close" if ends and not self.mid_step else "gather")
            self.run_passes("constraint_virial")


@contextmanager
def _restored(bodies: Bodies) -> Iterator[None]:
    """Restore the bodies' state afterwards."""
    kept = bodies.state.copy()
    yield
    bodies.state[:] = kept


# ----------------------------------------------------------------- how a run begins


@dataclass(frozen=True)
class Look:
    """What is found out before the bodies of a run are made: see `Run`."""

    siblings: list[Sibling]
    fixes: OtherFixes
    levels: list[float]
    mid_step: bool
    goes_on: bool
    half_step: bool
    deformed_box: np.ndarray | None
    remaps_velocities: bool


def begin_run(setting: Setting, last: Run | None) -> Run:
    """Begin a run: look, make or keep the bodies, bind the passes, check, plan; collective.

    Args:
        last: the run before; None before the first one.
    Raises:
        RunError: if the run cannot be right.
    """
    lammps, host, integrator = setting.lammps, setting.host, setting.integrator
    if last:
        last.note_pending()
    refuse_time_step(lammps.dt, integrator, setting.command.line.name)
    host.follow_schedule(None)
    host.phase = Phase.NEW
    host.set_bodies(None, None)  # the atoms are not those of the last run
    goes_on = setting.goes_on
    if goes_on:
        setting.membership.find_groups()
    else:
        setting.maker.decide()
    look = look_around(setting, goes_on)
    if goes_on and setting.made:
        setting.made.bodies.bind(setting.membership)
    else:
        setting.made = _make(setting, last)
    run = Run(setting, setting.made, look)
    _bind(run, setting)
    if not goes_on:
        _set_first_velocities(run)
    refuse_other_integrators(look.fixes, run.ours, setting.membership, host)
    refuse_shared_atoms(look.siblings, setting.command.line, setting.membership)
    refuse_constraints(look.fixes, run.ours, host)
    run.take_time_step()
    run.cards = cards.find(lammps, look.fixes.packages)
    wrong = run.cards.problem(
        energy=run.needs_energy, levels=bool(look.levels), counts=bool(host.counts)
    )
    refuse(wrong, wrong)
    _open_table(setting, look)
    _plan(run, setting)
    run.tell_count()
    if host.dmax:
        run.minimization = begin_minimization(run)
    return run


def refuse_time_step(dt: float, integrator: Integrator, name: str) -> None:
    """End the run if the integrator does not support the time step."""
    refuse(
        (dt < 0 and not all(part.reversible for part in integrator.parts))
        or (dt == 0 and box_every(integrator.parts) > 0),
        f"the time step is {dt:g}, and the integrator {name} needs one above zero: "
        "look at the command timestep",
    )


def look_around(setting: Setting, goes_on: bool) -> Look:
    """Find out what other fixes may read and change, and whether bodies move with a box that one of
    them changes; collective."""
    host, lammps, integrator = setting.host, setting.lammps, setting.integrator
    levels, siblings = lammps.respa_dt, setting.siblings()
    refuse(
        levels and not integrator.respa,
        f"the integrator {setting.command.line.name} does not support run_style respa: "
        "use run_style verlet",
    )
    ours = {host.fix_id, *(one.fix_id for one in siblings)}
    fixes = OtherFixes(host.fixes(), ours, host.command, lammps.step)
    reading = any(one.external.may_read_atoms(ours) for one in siblings)
    if reading:  # it may end its step after this one
        fixes.velocities_every = (1,)
    reading |= setting.external.may_read_atoms(ours)
    follows = fixes.tell_of_box and not box_every(integrator.parts) and not levels
    deformed_box = host.deformed_box if follows else None
    remaps = deformed_box is not None and bool(host.remap_group)
    if deformed_box is not None:
        machine_code.load(setting.ranks, deform.__name__)
    if remaps:
        _refuse_remap(setting)
    return Look(
        siblings=siblings,
        fixes=fixes,
        levels=levels,
        mid_step=integrator.mid_step and not levels and not host.dmax,
        goes_on=goes_on,
        half_step=bool(fixes.half_step or reading or reading_pair_style(host)),
        deformed_box=deformed_box,
        remaps_velocities=remaps,
    )


def _refuse_remap(setting: Setting) -> None:
    """End the run if bodies cannot cross faces as with remap v of fix deform; collective."""
    integrator, membership = setting.integrator, setting.membership
    refuse(
        not integrator.supports_remap_v or needs_energy(integrator.parts),
        "fix deform has remap v, with which bodies get another velocity at periodic faces: "
        f"{setting.command.line.name} does not support it. Use fix nosquish/nve, and "
        "fix langevin with fix_modify temp for a temperature",
    )
    atoms, group = membership.atoms(), setting.host.remap_group & 0xFFFFFFFF
    refuse(
        setting.ranks.any((setting.lammps.groups[atoms] & group == 0).any()),
        "fix deform has remap v for a group that lacks atoms of the bodies: give it group all",
    )


def _make(setting: Setting, last: Run | None) -> MadeBodies:
    """Make the bodies of a run of the atoms as they are; collective."""
    before, maker, host = setting.previous, setting.maker, setting.host
    ids, wrench = (before.id, before.wrench.copy()) if before else (np.empty(0), np.empty((6, 0)))
    build = maker.prepare(before if setting.ran else None)
    setting.made = before = None  # there may be no memory for both
    if last:
        last.drop()
    bodies, report, kept = build()
    setting.rotation.choose(bodies, setting.ranks, host)
    # a rerun is of the atoms as they are in the file, which has rounded positions
    bodies.tolerates_shifts = setting.command.reinit and "rerun" in host.command[:1]
    maker.restore_shapes(kept, bodies.tolerates_shifts)
    making.take_wrenches(bodies, ids, wrench)
    maker.keep(bodies)
    if kept.new:
        report.warnings += compare(bodies, setting.membership)
    masses = MassWatch(bodies, setting.lammps, setting.ranks)
    chosen = switches.choices(setting.command, setting.ranks, bodies)
    setting.made = made = MadeBodies(bodies, report, masses, chosen)
    making.refuse_infinite(report)  # with the bodies there, for a run with other velocities
    return made


def _bind(run: Run, setting: Setting) -> None:
    """Bind the passes of the run to its bodies; collective."""
    integrator, cells, host = run.integrator, run.bodies.cells, run.host
    run.external.begin(levels=bool(run.levels))
    run.external.set_bodies(run.bodies)
    cells["rate"].set(host.rate if run.remaps_velocities else np.zeros(6))
    if (mask := run.mask) is not None:
        cells["mask"].set(mask)
    for part in integrator.parts:
        part.begin(run)
    declaring = integrator, *integrator.parts
    given = _joined(one.extra_parameters(run) for one in declaring)
    setting.parameters = integrator.numbers(
        ftm2v=run.lammps.ftm2v, mrot=setting.rotation.inner_steps, **given
    )
    conditions = Conditions(
        several=run.ranks.size > 1,
        mid_step=run.mid_step,
        half_step=run.half_step,
        gravity=run.gravity,
        external=run.external.cells if run.external.acts else None,
        deformed_box=run.deformed_box,
        remaps_velocities=run.remaps_velocities,
        orient_atom=host.orient_atom,
    )
    run.passes = Passes(
        integrator, run.bodies, run.lammps, run.parameters, conditions,
        _joined(one.extra_cells(run) for one in declaring),
        lambda cells: _joined(one.extra_lists(run, cells) for one in declaring),
    )  # fmt: skip


def _joined(dictionaries: Iterable[dict[str, Any]]) -> dict[str, Any]:
    return {name: value for one in dictionaries for name, value in one.items()}


def _set_first_velocities(run: Run) -> None:
    """Have the atoms move as the bodies that were made of them; collective."""
    if run.remaps_velocities:  # velocities are those that bodies have where the box has them
        run.bodies.settle(run.lammps)
        run.velocities.take()
    run.passes.run("orient")
    run.set_velocities()
    # commands between runs set up a run, too, such as write_restart
    first, *_ = *run.host.command, "run"
    is_a_run = first in ("run", "rerun") or first.startswith("temper")
    if run.remaps_velocities and not is_a_run:
        run.velocities.set_in_body()


def _open_table(setting: Setting, look: Look) -> None:
    """Open the file of keyword output, if there is to be one and it is not open; collective."""
    asked = setting.command.output
    if not asked or setting.table:
        return
    path = setting.lammps.text(asked.file)
    refuse(
        any(one.table_path == path for one in look.siblings),
        f"two fixes write their table of bodies (keyword output) to {path}: "
        "give each a file of its own",
    )
    if look.levels:
        setting.host.need("end of a step")
    setting.table = BodyFile(path, setting.lammps.units, setting.ranks)


def _plan(run: Run, setting: Setting) -> None:
    """Tell the host the facts of this run, and have it follow the schedule."""
    fixes, host, pending = run.other_fixes, run.host, run.pending_half_kick
    looks = run.box.may_change or run.masses_may_change or setting.rigid_flag
    facts = {
        SEEN: host.facts & SEEN,
        LATE: fixes.late,
        MID_STEP: run.mid_step,
        LEVELS: bool(run.levels),
        WATCHED: run.box.may_change,
        LOOKS: looks or bool(run.switches),
        RESETS: run.mid_step and pending not in (None, run.dt),
    }
    host.facts = sum(bit for bit, holds in facts.items() if holds)
    if host.facts & RESETS:
        run.passes.level_dt.set(pending)
    asked = run.command.output
    host.follow_schedule(
        run.passes.lists,
        velocities_every=gcd(*fixes.velocities_every),
        table_every=asked.steps if asked else 0,
    )


def begin_minimization(run: Run) -> Minimization:
    """Tell LAMMPS of the bodies' coordinates in a minimization; collective."""
    host = run.host
    unknown = "minimize needs the energy of all forces, which does not include that of "
    refuse(
        run.gravity is not None,
        f"{unknown}keyword gravity: remove 'disable' from fix gravity and use 'fix_modify energy "
        "yes' instead",
    )
    refuse(
        run.external.acts,
        f"{unknown}fix_modify external: use a run with fix nosquish/nvt at a low temperature",
    )
    refuse(
        any(fix.style.startswith("box/relax") for fix in run.other_fixes),
        "fix box/relax would deform the rigid bodies with the box: unfix it before minimize, and "
        "use fix nosquish/npt or fix nosquish/nph and a run for the box",
    )
    begun = Minimization(run.bodies, run.ranks, bool(run.switches))
    host.min_dof = 6 * len(begun.ids)
    host.log(
        f"Minimization: bodies stay rigid. LAMMPS's {host.min_dof} extra global DOFs are their "
        "coordinates, which add no energy\n"
    )
    return begun
