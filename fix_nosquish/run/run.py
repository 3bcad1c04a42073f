"""A run of LAMMPS: what is done in it, and what is asked of its bodies."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar, cast

import numpy as np

from ..bodies.bodies import Bodies
from ..errors import RunError, refuse
from ..host.hosts import OtherFix, Phase
from . import gravity, log, masses, schedule, switches, velocities
from .cards import Cards
from .conditions import Conditions
from .making import MadeBodies
from .minimization import Minimization
from .other_boxes import BoxWatch
from .other_fixes import Ours, acts_on_bodies, may_move, refuse_constraints
from .passes import Passes
from .schedule import ACTIONS, GATHERS, SEEN
from .setting import Setting
from .thermo import Energies, Thermo
from .velocities import AtomVelocities, LostEnergy

T = TypeVar("T")


class Run:
    """A run of LAMMPS with a fix of this package.

    `beginning.begin_run` makes it.  Methods are collective.

    Attributes:
        setting: what the fix has for all of its runs.
        lammps, ranks, host, command, integrator, membership, external: see `Setting`.
        bodies, report, switches: see `making.MadeBodies`.
        conditions: the `Conditions`, with the other fixes.
        box: the `BoxWatch`.  masses_may_change: whether a fix may change masses.
        passes: the `Passes`.  cards: the `Cards`.
        thermo: the `Thermo` of the bodies.  velocities: those of their atoms.
        cache: values that were computed of the bodies, by name, and when: see `cached`.  It is
            cleared where bodies change without a number that says so.
        minimization: the bodies' coordinates in a minimization; None in a run.
        dt, levels: the time step, and those of run_style respa's levels, innermost first; empty
            without it.
        stepped: whether it has made a step, so far as it is known.
    """

    passes: Passes
    cards: Cards
    minimization: Minimization | None = None
    dt: float
    levels: list[float]

    def __init__(self, setting: Setting, made: MadeBodies, conditions: Conditions) -> None:
        self.setting, self._made, self.conditions = setting, made, conditions
        self.lammps, self.ranks, self.host = setting.lammps, setting.ranks, setting.host
        self.command, self.integrator = setting.command, setting.integrator
        self.membership, self.external = setting.membership, setting.external
        self.bodies, self.report, self.switches = made.bodies, made.report, made.switches
        fixes, has_barostat = conditions.other_fixes, bool(setting.box_every)
        followed = conditions.deformed_box is not None
        may_change = not followed and (fixes.unknown or bool(fixes.changing_box))
        self.box = BoxWatch(made.bodies, self.lammps, may_change, has_barostat)
        self.masses_may_change = masses.masses_may_change(fixes, self.lammps)
        self.thermo = Thermo(made.bodies, self.lammps, self.ranks)
        self.velocities = AtomVelocities(
            made.bodies, self.lammps, self.ranks, made.report, setting.maker.shapes,
            conditions.remaps_velocities,
        )  # fmt: skip
        self.cache: dict[str, tuple[tuple, Any]] = {}
        self.lost = LostEnergy()
        self._first_step, self.stepped = self.lammps.step, False
        self._missing_energy = 0.0  # that the end of the last step would give, with mid_step
        thermostats = bool(self.integrator.thermostat)
        self.ours = Ours(self.host.fix_id, self.command, has_barostat, thermostats)

    # ------------------------------------------------------------- facts

    @property
    def phase(self) -> Phase:
        """Where in a run the bodies are."""
        return Phase(self.host.phase)

    @property
    def mask(self) -> np.ndarray | None:
        """Mask of active force and torque components, (6, n) or (6, 1); None if all are active."""
        return switches.mask(self.switches, self.bodies)

    def free(self) -> None:
        """Free all memory, because the next run makes its bodies: nothing can be asked any more."""
        vars(self).clear()

    @property
    def steps_made(self) -> bool:
        """Whether it has made a step: commands rerun and minimize make none."""
        steps = self.lammps.step != self._first_step and self.minimization is None
        return steps and self.host.command[:1] != ["rerun"]

    @property
    def parameters(self) -> Any:
        """See `Setting`; of this run as soon as it has some."""
        return self.setting.parameters

    def number(self, keyword: str) -> float:
        """The number of one of `extra_keywords`, or the value of its variable now."""
        return self.lammps.number(self.command.extra[keyword])

    def acts_on_bodies(self, fix: OtherFix) -> bool:
        """Whether atoms of the bodies are in another fix's group."""
        return acts_on_bodies(fix, self.membership)

    def is_outermost(self, level: int) -> bool:
        """Whether a level of run_style respa is the outermost."""
        return level == len(self.levels) - 1

    # ------------------------------------------------------------- passes and the schedule

    def run_passes(self, name: str, step: int | None = None) -> None:
        """Run a list of passes, with the forces of this step, by default of now."""
        if code := self.passes.run(name):
            self.raise_failure(code, step)

    def raise_failure(self, code: int, step: int | None = None) -> None:
        """Raise the error of a pass that returned this number."""
        if code < 0:
            raise RunError(self.integrator.failure(code, self), everywhere=True)
        step = self.lammps.step if step is None else step
        name = self.membership.name
        raise log.of_infinite_forces(self.thermo, name, self.phase == Phase.NEW, step)

    def perform(self, hook: str) -> None:
        """Do what the schedule has for a hook."""
        schedule.perform(hook, self.host, self.passes, self.act)

    def act(self, number: int, code: int) -> None:
        """Do what the action of this number has for Python.

        Args:
            code: what a pass of it has returned, 0 if none has failed.
        """
        action = ACTIONS[number]
        if action.call:
            getattr(self, action.call)()
        elif code:  # a step begins with the forces of the last one
            self.raise_failure(code, self.lammps.step - (action.hook == "begin"))

    # ------------------------------------------------------------- a run begins

    def start(self) -> None:
        """Begin to move, now that the first forces are known."""
        made, scheme, conditions = self._made, self.integrator.scheme, self.conditions
        for part in self.integrator.parts:
            part.start(self)
        if self.masses_may_change:
            made.masses.refuse_change()
        if conditions.goes_on:  # with the IDs and masses that a script has given atoms between runs
            self.bodies.update_tags(self.lammps)
            made.masses.note()
        refuse_constraints(conditions.other_fixes, self.ours, self.host)
        gravity.refuse_twice(
            self.command, conditions.other_fixes, self.acts_on_bodies, self.lammps.scalar_of_fix
        )
        self.run_passes("gather")
        self.cache.clear()
        pending = self.setting.pending_half_kick
        if self.integrator.mid_step and not conditions.mid_step and pending:
            self._end_half_kick(pending)
        if scheme.start and not made.started:
            scheme.start.bind_to(self.passes.cells)()
        made.started = True
        if conditions.goes_on:
            # with remap v LAMMPS changes the velocity of an atom that enters the box
            if not conditions.remaps_velocities:
                prescribed = "some have what their molecule template says"
                self._report_ignored(prescribed if self.command.reinit else "reinit no")
            self.set_velocities()
        self.setting.maker.ran = True
        # LAMMPS asks the fixes after this one for their forces later
        if conditions.other_fixes.change_forces and not conditions.mid_step:
            self.host.facts |= GATHERS

    def _end_half_kick(self, dt: float) -> None:
        """Do what a run without levels has left: with levels a step ends with its second half."""
        self.passes.level_dt.set(dt)
        self.run_passes("close")
        self.take_time_step()
        self.set_velocities()
        self.setting.pending_half_kick = 0.0

    def report_start(self) -> None:
        """Log the bodies as a run begins, if they have changed, and warnings."""
        fixes, parts = self.conditions.other_fixes, self.integrator.parts
        acting = () if self.minimization else (*parts, self.integrator)  # no thermostat acts in one
        warnings = (line for part in acting for line in part.extra_warnings(self))
        lines = self.cards.copies(self.ranks.count(self.lammps.setting("nmax")))
        if every := self.setting.box_every:
            lines.append(f"  change of the box every {every} steps")
        self.setting.log.report(self.thermo, self.report, self.mask, lines, warnings)
        start = self.bodies.start = log.forces_at_start(self.thermo, self.membership.name)
        names = " or ".join(
            f"fix {fix.id} (style {fix.style}{', which changes the box' * bool(fix.box_change)})"
            for fix in fixes.possible_movers()
        )
        self.bodies.possible_causes = names and f", perhaps {names}"
        if start.diagnosis and not self.minimization:
            self.setting.log.warn([f"WARNING: {start.diagnosis}: {start.advice}"])

    def set_up(self) -> None:
        """The first step begins, and LAMMPS has called no setup before it."""
        self.resume()
        self.follow_atoms()
        host, setting = self.host, self.setting
        vflag, table = host.vflag, setting.table  # they are for the step which begins
        host.vflag, setting.table = 0, None
        self.perform("setup")
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
        if self.velocities.were_changed(self.phase != Phase.OVER):
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
            self.setting.pending_half_kick = self.dt if self.conditions.mid_step else 0.0
            self.stepped = False

    def begin_level(self, vflag: int, level: int) -> None:
        """A level of run_style respa begins a step; the innermost one, 0, moves the bodies."""
        self.host.vflag, self.stepped = vflag, True
        outermost = self.is_outermost(level)
        if outermost:
            self.perform("begin")
        self.passes.level_dt.set(self.levels[level])
        self.run_passes("kick", self.lammps.step - outermost)
        if level == 0:
            self.perform("move")

    def end_level(self, level: int) -> None:
        """A level's new forces end its step."""
        if self.box.may_change:
            self.refuse_new_box()
        self.passes.level_dt.set(self.levels[level])
        self.run_passes("close")
        self.cache.clear()
        if self.is_outermost(level) or self.conditions.half_step:
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
        if self.setting.rigid_flag:
            body = np.full(len(self.lammps.groups), -1, np.int32)
            body[self.bodies.index] = self.bodies.body
            self.host.set_bodies(body, self.bodies.mass)

    def _update_membership(self) -> None:
        """Add and remove bodies whose atoms came or are gone."""
        setting, integrator = self.setting, self.integrator
        lines = setting.maker.update(self.bodies, self.report)
        refuse(
            integrator.scheme.start or setting.box_every or setting.needs_energy,
            f"bodies came or are gone by step {self.lammps.step}, which the integrator "
            f"{self.command.line.name} does not support in a run: use fix nosquish/nvt or fix "
            "nosquish/nve, or insert and delete between runs, with reinit yes",
        )
        setting.log.warn(lines)
        setting.maker.rotation.choose(self.bodies, self.ranks, self.host)
        self.parameters.mrot = setting.maker.rotation.inner_steps
        self.external.set_bodies(self.bodies)
        for part in integrator.parts:
            part.bodies_changed(self)
        self._made.masses.note()
        self.report_count()
        self.cache.clear()

    def report_count(self) -> None:
        """Report the number of bodies to LAMMPS."""
        self.host.set_array_rows(self.ranks.count(self.bodies.listed.sum()))

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
        due = [fix for fix in self.conditions.other_fixes.late if at % fix.nevery == 0]
        if any(map(may_move, due)):
            self.bodies.refuse_moved_atoms(self.lammps)
        if not due or not self.velocities.were_changed(remapped=self.phase != Phase.OVER):
            return
        before, now = self.velocities.take_late()
        self.set_velocities()
        self.cache.clear()
        self.lost.total += before - now
        self.lost.least = velocities.ROUNDING * before
        if not self.lost.logged:
            self.lost.logged, excepted = True, ""
            if self.setting.maker.infile:
                excepted = " (not those of the infile)"
            elif self.setting.maker.keeps_bodies:
                excepted = " (not those with a mass, com or inertia of their molecule template)"
            self.host.log(velocities.report_of_changes(at, due, before, now, excepted))

    def write_table(self) -> None:
        """Write the table of this step to the file of keyword output, if it is due and not written
        yet."""
        output, file, step = self.command.output, self.setting.table, self.lammps.step
        if output and file and step % output.steps == 0 and file.last != step:
            self.complete_step()
            file.write(self.bodies, self.lammps)

    def complete_step(self, forces: bool = True) -> None:
        """Have the bodies as at the end of a step with output, with their forces, if wanted."""
        self.perform("complete")
        if forces:
            self.perform("know_forces")

    def end(self) -> None:
        """Have the atoms as the bodies are, now that the run is over."""
        fixes, self.stepped = self.conditions.other_fixes, self.stepped or self.steps_made
        if fixes or fixes.unknown:  # else nothing has changed the atoms
            self._made.masses.refuse_change()
        if fixes:
            self.bodies.refuse_moved_atoms(self.lammps)
        self.complete_step()
        if not self.host.facts & SEEN:
            self.set_velocities()
        self._take_late(self.lammps.step)
        if report := self.lost.report():
            self.host.log(report)
        # with remap v a body has one velocity between runs, wherever its atoms are
        if self.conditions.remaps_velocities:
            self.bodies.settle(self.lammps)
            self.velocities.set_in_body()
        self.cache.clear()
        if self.conditions.mid_step:
            end, now = self.kinetic_at_end()
            self._missing_energy = end - now
        for part in self.integrator.parts:
            part.end(self)

    # ------------------------------------------------------------- what is asked of the bodies

    def completed_bodies(self, forces: bool = True) -> Bodies:
        """The bodies as at the end of a step with output, with their forces, if wanted, and with
        the velocities that other fixes have given their atoms at this end."""
        self.take_seen_velocities()
        self.complete_step(forces)
        return self.bodies

    def cached(self, name: str, make: Callable[[], T], forces: bool = True) -> T:
        """What make() returns of the `completed_bodies`, computed once for each step.

        Args:
            forces: whether it needs the bodies' forces.
        """

        def now() -> tuple[int, int, int]:
            return self.lammps.step, self.host.phase, self.host.changes

        self.take_seen_velocities()
        when, value = self.cache.get(name, (None, None))
        if when != now():
            self.complete_step(forces)
            value = make()  # which may change the bodies
            self.cache[name] = now(), value
        return cast(T, value)

    def energies(self) -> Energies:
        """Kinetic energies and temperatures of the bodies."""
        return self.cached("energies", self.thermo.energies, forces=False)

    def kinetic_at_end(self) -> tuple[float, float]:
        """The kinetic energy of the bodies at the end of the step, and that of the velocities that
        the atoms have, in LAMMPS's units."""
        now, mid_step = self.energies().kinetic, self.conditions.mid_step

        def at_end() -> float:
            if mid_step and self.phase == Phase.OVER:
                return now + self._missing_energy  # LAMMPS's atoms may be other ones now
            if not mid_step or self.phase != Phase.WAITING:
                return now
            with _restored(self.bodies):
                self.run_passes("close")
                return self.thermo.energies().kinetic

        return self.cached("kinetic", at_end, forces=False), now


@contextmanager
def _restored(bodies: Bodies) -> Iterator[None]:
    """Restore the bodies' state afterwards."""
    before = bodies.state.copy()
    yield
    bodies.state[:] = before
