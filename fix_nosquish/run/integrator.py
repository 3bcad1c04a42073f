"""What LAMMPS drives: an integrator, whose hooks follow the schedule of a step (see `schedule`)."""

from typing import Any, cast

import numpy as np

from ..bodies import extended
from ..bodies.bodies import Bodies
from ..bodies.build import BuildReport, count
from ..bodies.membership import Membership
from ..errors import RunError
from ..host.command import Command, Line
from ..host.hosts import Host, driven_by_plugin, hook
from ..host.lammps import Lammps
from ..host.own_fix import OwnFix
from ..loops import machine_code
from ..motion import step, virial
from ..motion.block import ROWS
from ..ranks import migration, mpi, sharing
from ..ranks.communicator import ALONE, Alone, Communicator
from . import (
    answers,
    beginning,
    external,
    levels,
    log,
    making,
    passes,
    refusals,
    rotation,
    schedule,
    velocities,
)
from .cards import Cards
from .declaration import Declaration
from .external import External
from .minimization import Minimization
from .other_fixes import OtherFixes
from .output import BodyFile
from .passes import Passes
from .registry import Registered
from .replacement import replacement_notice
from .schedule import SEEN, Phase
from .switches import Choice, mask

# hooks that a class may have of its own: then Python follows the schedule, not the plugin
HOOKS = "setup", "initial_integrate", "final_integrate", "post_neighbor"


class Integrator(Registered, Declaration):
    """What LAMMPS's fix python/move drives; a derived class declares how bodies move.

    LAMMPS calls the hooks; `schedule` says what happens at each of them.  The documentation says
    what the words of the fix line mean.

    Args:
        ptr: the pointer to LAMMPS that fix python/move hands over.
        line: the `command.Line`, or the text of one in quotes.
    Raises:
        RunError: with a message for the user, from any method.

    Attributes:
        name: how the fix line calls it.
        bodies: the `Bodies`, from the first use of the fix on.
        notes: what `build` says of them.
        exact: whether their free rotation is exact, not split.
        host: what calls this object: see `hosts.Host`.
        virial: (6,) this rank's constraint virial (xx yy zz xy xz yz), in the memory of the
            plugin's fix; None with LAMMPS's own fix python/move.
        virial_per_atom: (atoms, 9), the same of each atom, with yx zx zy, while LAMMPS asks for it.
        parameters: what the operations take, a record: see `Declaration.numbers`.
        rigid_flag: whether pair styles may ask for the bodies' masses, as those of grains do.
        other_fixes: the `OtherFixes` of the run; cards: its `Cards`.
        unchanged: the `refusals.Unchanged`.
        told_box: the host's, if bodies move with a box that another fix changes; else None.
        streams: whether it is with remap v that this happens.
        waiting: with `mid_step`, the time step of the half kick that is left to the next run's
            first step: 0.0 if none is, None if it is that step's own.
        minimization: the bodies' coordinates, in a `Minimization` and until the next run.
        external: the `External` forces.
        file: the `BodyFile` of keyword output, None if there is none (yet).
        said, warned: lines that the log has: the first ones on the bodies, and what is odd.
        taken_away: what was `Taken` from velocities that other fixes changed in this run.
        known: what was found out of the bodies, by name, and when: see `answers`.  It is cleared
            where they change and no number says so.
        gained_at_end: kinetic energy that the end of the last step gives, with `mid_step`.
        gravity: the acceleration by which bodies have weight, (3,); None for none.
        half_step_velocities: whether the atoms' velocities may be read in the middle of a step.
        ran, started, stepped: whether a run has begun; numbers of the bodies' own have been set; a
            step was made since `waiting` was noted.
    """

    virial: np.ndarray | None = None
    virial_per_atom: np.ndarray | None = None
    told_box: np.ndarray | None = None
    gravity: np.ndarray | None = None
    waiting: float | None = None
    file: BodyFile | None = None
    cards: Cards = Cards()
    rows_lent: np.ndarray
    said: list[str]
    warned: set[str]
    known: dict[str, Any]
    taken_away: velocities.Taken
    gained_at_end: float
    switches: list[Choice]
    first_step: int
    streams = rigid_flag = exact = ran = started = stepped = has_rotors = False
    follows_atoms = True

    def __init__(self, ptr: Any, line: Line | str) -> None:
        line = Line.quoted(line) if isinstance(line, str) else line
        self.lammps = Lammps(ptr)
        self.communicator: Communicator | Alone = ALONE
        if self.lammps.ranks > 1:
            self.communicator = Communicator(self.lammps.communicator)
        self.line, self.name = line, line.name
        # until bodies are made, and until passes are bound
        self.bodies, self.notes = cast(Bodies, None), cast(BuildReport, None)
        self.passes, self.parameters = cast(Passes, None), cast(Any, None)
        self.minimization = cast(Minimization, None)
        self.other_fixes, self.half_step_velocities = OtherFixes(None), True
        self.external, self.unchanged = External(), refusals.Unchanged()
        self.said, self.warned, self.known = [], set(), {}
        own = None if driven_by_plugin() else OwnFix(self.lammps, self.communicator)
        self.host = cast(Host, own)  # the plugin sets it behind this
        self._define(line)

    @hook
    def _define(self, line: Line) -> None:
        self.command = Command.parse(line, self.keywords, self.own_keywords)
        self.follow_words()
        several = self.communicator.size > 1 or not driven_by_plugin()
        modules = step, migration, sharing, virial, passes, *((mpi,) if several else ())
        machine_code.load(
            self.communicator,
            *(module.__name__ for module in modules),
            *(kind.__module__ for kind in type(self).__mro__),
            *self.modules,
        )
        rotation.refuse_other_rotor(self)
        self.membership = Membership(self.lammps, self.communicator, self.command)
        self.infile = self.command.infile and self.lammps.text(self.command.infile)
        self.oriented = self.communicator.any(self.lammps.orients)
        self.register()
        self.template = self.command.mol
        self.restart_file = bool(self.infile or self.template)
        refusals.refuse_missing_template(self)
        refusals.refuse_time_step(self)
        self.take_time_step()
        if not driven_by_plugin():
            # LAMMPS's own fix: it takes commands, and so text for its log, only between runs
            self.define_bodies()
            making.make(self)
            log.say(self, False)
        else:
            self.rigid_flag = self.lammps.radius is not None

    @hook
    def define_bodies(self) -> None:
        """Decide which atom is in which body; the host is there; collective."""
        self.host.carry(self.lammps, None)
        self.host.point()
        self.membership.define(self.host.kept_bodies)
        # None if others may come
        self.array_rows = None if self.template else count(self.membership)

    @hook
    def keep_bodies(self) -> None:
        """LAMMPS writes a restart file: have ready what the fix line does not say of the bodies;
        collective."""
        if not self.lammps.running:
            self.host.point()
        self.host.keep_bodies(self.membership.exceptions())

    def follow_words(self) -> None:
        """Take what a derived class is made of by the words of its fix line, its `command`; loops
        are loaded behind this."""

    # ------------------------------------------------------------- what holds

    def own_number(self, keyword: str) -> float:
        """The number behind one of `own_keywords`, a variable's as it is now; collective."""
        return self.lammps.number(self.command.own[keyword])

    @property
    def phase(self) -> Phase:
        return Phase(self.host.phase) if self.host else Phase.NEW

    @property
    def counts_from_one(self) -> bool:
        """Whether files count bodies of style custom from 1, as LAMMPS's rigid fixes do."""
        return bool(self.command.line.replaces) and self.command.style == "custom"

    @property
    def keeps_bodies(self) -> bool:
        """Whether of some bodies more is known than their atoms tell."""
        return bool(self.infile or (self.notes and len(self.notes.prescribed_ids)))

    @property
    def goes_on(self) -> bool:
        """Whether the bodies are those of the last run."""
        return self.ran and (not self.command.reinit or self.keeps_bodies)

    @property
    def runs(self) -> bool:
        """Whether it is a run that LAMMPS sets up: commands between runs do so, too, such as
        write_restart, also where command run names them."""
        first, *_ = *self.host.command, "run"
        return first in ("run", "rerun") or first.startswith("temper")

    @property
    def steps_made(self) -> bool:
        """Whether this run has made a step: commands rerun and minimize make none."""
        steps = self.lammps.step != self.first_step and self.minimization is None
        return steps and self.host.command[:1] != ["rerun"]

    @property
    def mask(self) -> np.ndarray | None:
        """What of the bodies' forces and torques acts, (6, n) or (6, 1); None for all of it."""
        return mask(self.switches, self.bodies)

    @property
    def has_own_hooks(self) -> bool:
        """Whether the class has hooks of its own, so that Python follows the schedule."""
        return any(getattr(type(self), name) is not getattr(Integrator, name) for name in HOOKS)

    def acts_on_bodies(self, fix: Any) -> bool:
        """Whether atoms of the bodies are in another fix's group; collective."""
        groups = self.lammps.groups[self.membership.atoms()]
        return self.communicator.any(fix.has(groups).any())

    def shapes(self) -> np.ndarray | None:
        """Shapes and orientations of LAMMPS's atoms; see `hosts.Host.shapes`."""
        return self.host.shapes(len(self.lammps.groups)) if self.oriented else None

    def do(self, name: str, step: int | None = None) -> None:
        """Do a list of passes, with the forces of this step, by default of now; see `passes`."""
        if found := self.passes.do(name):
            self.blame(found, step)

    def blame(self, found: int, step: int | None = None) -> None:
        """Say why a loop that returned this number ends the run."""
        if found < 0:
            raise RunError(self.complaint(found), everywhere=True)
        raise refusals.bad_forces(self, self.lammps.step if step is None else step)

    @hook
    def act(self, number: int, found: int) -> None:
        """Do what the action of this number has for Python.

        Args:
            found: what a pass of it has returned, 0 if none has failed.
        """
        action = schedule.ACTIONS[number]
        if action.call:
            getattr(self, action.call)()
        elif found:  # a step begins with the forces of the last one
            self.blame(found, self.lammps.step - (action.hook == "begin"))

    # ------------------------------------------------------------- a run begins

    init = hook(beginning.init)
    start_run = beginning.start_run
    tell_start = beginning.tell_start
    continue_run = beginning.continue_run

    def tell_count(self) -> None:
        """Tell LAMMPS how many bodies there are; collective."""
        self.host.set_array_rows(self.communicator.count(self.bodies.listed.sum()))

    @hook
    def setup(self, vflag: int) -> None:
        """The forces of the start are known; LAMMPS is about to print its step."""
        if not self.host.calls_setup:
            self.push()
        schedule.follow(self, "setup")

    def set_up(self) -> None:
        """The first step of a run begins, and LAMMPS has called no setup before it."""
        self.resumed()
        self.follow_atoms()
        vflag, self.host.vflag = self.host.vflag, 0  # that is of the step which begins
        self.setup(0)
        self.host.vflag = vflag

    # ------------------------------------------------------------- a minimization

    @hook
    def min_store(self) -> None:
        """A line search begins."""
        self.minimization.store()

    @hook
    def min_step(self, alpha: float, direction: int) -> None:
        """Move bodies and atoms by alpha times the direction at this address, from where the line
        search began."""
        self.minimization.move(alpha * self.minimization.at(direction))
        self.passes.do("place")
        self.started = False

    @hook
    def min_force(self, forces: int) -> None:
        """Write the forces on the bodies' coordinates to this address."""
        self.passes.do("gather")
        if self.host.vflag:
            self.passes.do("constraint_virial")
        self.known.clear()
        self.minimization.at(forces)[:] = self.minimization.forces()

    @hook
    def max_alpha(self, direction: int) -> float:
        """How often the direction at this address may be gone: none by more than dmax."""
        lengths = np.linalg.norm(self.minimization.at(direction), axis=1)
        return self.host.dmax / lengths.max(initial=1e-300)

    # ------------------------------------------------------------- the time step

    @hook
    def reset_dt(self) -> None:
        """The time step may have changed."""
        refusals.refuse_time_step(self)
        schedule.follow(self, "reset_dt")

    def take_time_step(self) -> None:
        """Have the loops use the time step as it is now."""
        self.dt, self.respa_dt = self.lammps.dt, self.lammps.respa_dt
        if self.passes:
            self.passes.dt.set(self.respa_dt[0] if self.respa_dt else self.dt)
            self.passes.level_dt.set(self.dt)
            self.passes.begins.set(not self.respa_dt)  # there each level begins by itself

    def note_waiting(self) -> None:
        """Keep the time step of the last step of a run that has made some."""
        if self.stepped:
            self.waiting, self.stepped = self.dt if self.mid_step else 0.0, False

    # ------------------------------------------------------------- a step

    @hook
    def initial_integrate(self, vflag: int) -> None:
        """The first half of a step."""
        self.host.vflag, self.stepped = vflag, True
        schedule.follow(self, "begin")

    def take_late_velocities(self) -> None:
        """Take over velocities that other fixes may have changed at the end of the last step."""
        velocities.take_late(self, self.lammps.step - 1)

    def follow_atoms(self) -> None:
        """LAMMPS has re-neighboured: atoms have new places in its arrays, some on other ranks, and
        the bodies are the same; collective."""
        self.unchanged.refuse_new_box(self, self.lammps.box.periodic)
        bodies = self.bodies
        self.host.point()
        if not bodies.follow(self.lammps):
            making.turn_over(self)
        self.host.noted()
        if self.switches:
            bodies.cells["mask"].set(cast(np.ndarray, self.mask))
        if self.unchanged.masses_may_change:
            self.unchanged.refuse_new_masses(self)
        if self.rigid_flag:
            body = np.full(len(self.lammps.groups), -1, np.int32)
            body[bodies.index] = bodies.body
            self.host.set_bodies(body, bodies.mass)

    post_neighbor = hook(follow_atoms)

    push = hook(external.push)

    @hook
    def final_integrate(self) -> None:
        """The second half of a step."""
        if self.host.atoms_moved():
            self.follow_atoms()
        if not self.host.calls_setup:
            self.push()
        schedule.follow(self, "end")

    def refuse_new_box(self) -> None:
        """End the run if something has changed the box."""
        self.unchanged.refuse_new_box(self, True)

    write_table = answers.write_table

    def come_to_rest(self, forces: bool = True) -> None:
        """Have the bodies as a step that is looked at leaves them, with their forces, if wanted."""
        schedule.follow(self, "rest")
        if forces:
            schedule.follow(self, "know_forces")

    def set_velocities(self) -> None:
        """Give the atoms the velocities that the bodies' motion gives them."""
        self.passes.do("velocities")
        facts, between = self.host.facts, self.phase == Phase.HALF
        self.host.facts = facts & ~SEEN if between else facts | SEEN

    @hook
    def post_run(self) -> None:
        """A run is over; what comes now, from a script's commands to another run, finds the bodies
        as their atoms are."""
        schedule.follow(self, "post_run")

    def end_run(self) -> None:
        """Have the atoms as the bodies are, now that the run is over."""
        self.stepped |= self.steps_made
        if self.other_fixes or not self.host.follows:  # else nothing has touched the atoms
            self.unchanged.refuse_new_masses(self)
        if self.other_fixes:
            self.bodies.refuse_moved_atoms(self.lammps)
        self.come_to_rest()
        if not self.host.facts & SEEN:
            self.set_velocities()
        velocities.take_late(self, self.lammps.step)
        velocities.say_lost(self)
        if self.streams:  # a body has one velocity between runs, wherever its atoms are
            self.bodies.settle(self.lammps)
            velocities.set_plain(self)
        self.known.clear()
        if self.mid_step:
            end, now = self.kinetic_at_end()
            self.gained_at_end = end - now

    # with run_style respa
    initial_integrate_respa = hook(levels.initial_integrate_respa)
    final_integrate_respa = hook(levels.final_integrate_respa)
    end_of_step = hook(levels.end_of_step)

    # ------------------------------------------------------------- what LAMMPS and others ask

    vector_extensive: tuple[bool, ...] = True, True, False, False
    vector_names: tuple[str, ...] = "ke_trans", "ke_rot", "temp_trans", "temp_rot"
    array_columns = 15

    @property
    def carries(self) -> int:
        """How many numbers go with an atom to another rank."""
        of_body = ROWS + self.rows + self.kept + 3 * bool(self.command.moments)
        return migration.OF_BODY + of_body + (extended.ROWS if self.oriented else extended.ORIENT)

    @property
    def replacement_notice(self) -> str | None:
        """Lines for the log if it replaces one of LAMMPS's rigid fixes; else None."""
        return replacement_notice(cast(str, self.host.fix_id), self.command)  # native: it has one

    made, table = answers.made, answers.table
    kinetic_at_end, virial_of_all = answers.kinetic_at_end, answers.virial_of_all
    dof = hook(answers.dof)
    compute_scalar = hook(answers.compute_scalar)
    compute_vector = hook(answers.compute_vector)
    compute_array = hook(answers.compute_array)
    rows_of_rank = hook(answers.rows_of_rank)
    write_restart_file = hook(answers.write_restart_file)
    zero_momentum = hook(velocities.zero_momentum)
    zero_rotation = hook(velocities.zero_rotation)
    modify_external = hook(external.modify_external)
    give_forces = external.give_forces
