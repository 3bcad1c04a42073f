"""The fix that LAMMPS drives: its hooks."""

from collections.abc import Callable
from functools import partial, wraps
from typing import Any, cast
from weakref import WeakMethod

import numpy as np
from numpy.typing import ArrayLike

from ..bodies import extended, infile
from ..bodies.bodies import Bodies
from ..bodies.build import count
from ..bodies.membership import Membership
from ..errors import RunError, refuse
from ..host import rigid_fixes
from ..host.command import Command, Line
from ..host.hosts import Host, Phase
from ..host.lammps import Lammps
from ..host.own_fix import driven
from ..loops import machine_code
from ..motion import step, virial
from ..motion.block import ROWS
from ..ranks import migration, mpi, sharing
from ..ranks.communicator import ALONE, Alone, Communicator
from . import former_names, log, output, passes, switches
from .external import ExternalForces, all_ids
from .integrator import Integrator
from .making import BodyMaker
from .other_fixes import OtherFixes
from .part import box_every, needs_energy
from .registry import Registered, siblings_of
from .replacement import replacement_notice
from .rotation import Rotation
from .run import Run, Setting, begin_run, refuse_time_step
from .thermo import VALUES, Thermo
from .velocities import AtomVelocities


def fix_of(kind: type[Integrator], ptr: Any, line: Line) -> Any:
    """What LAMMPS calls for a fix line: a `Fix`, or a driver of one.

    Args:
        kind: the class of the integrator.  ptr: the pointer to LAMMPS that this hands over.
    """
    lammps = Lammps(ptr)
    ranks = Communicator(lammps.communicator) if lammps.ranks > 1 else ALONE
    return driven(lambda: Fix(kind, lammps, ranks, line), lammps, ranks)


def _hook(method: Callable) -> Callable:
    """A method that LAMMPS calls: its errors name integrators as the fix line does."""

    @wraps(method)
    def named(self: Any, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except RunError as error:
            error.args = (self.line.naming(str(error)),)
            raise

    return named


class Fix(Registered):
    """A fix of this package.

    LAMMPS calls the hooks; `schedule` says what is done at each of them.  Those of each step are
    called from Python with LAMMPS's own fix python/move only: the plugin follows the schedule in
    C++, and calls `act`.

    Args:
        kind: the class of its integrator.
        lammps, ranks: LAMMPS, its `Communicator` or `ALONE`.
        line: the fix line.
    Raises:
        RunError: with a message for the user, from any method.

    Attributes:
        host: what calls it: see `hosts.Host`.
        integrator: the `Integrator`.
        setting: what it has for all of its runs, as soon as it is defined.
        run: the `Run` of now, or the last one that could begin; None before the first one, or if
            its bodies are gone.
        virial: (6,) this rank's constraint virial (xx yy zz xy xz yz), in the memory of the
            plugin's fix.
        virial_per_atom: (atoms, 9), the same of each atom, with yx zx zy, while LAMMPS asks for it.
    """

    follows_atoms = True
    array_columns = 15  # of `output.global_array`
    setting: Setting

    @_hook
    def __init__(
        self, kind: type[Integrator], lammps: Lammps, ranks: Communicator | Alone, line: Line
    ) -> None:
        self.lammps, self.ranks, self.line = lammps, ranks, line
        self.host = cast(Host, None)  # set by what calls it, after this
        self.run: Run | None = None
        self.virial: np.ndarray | None = None
        self.virial_per_atom: np.ndarray | None = None
        self.command = command = Command.parse(line, kind.keywords, kind.extra_keywords)
        self.integrator = kind(command, lammps.dimension)
        several = (mpi,) if ranks.size > 1 else ()
        modules = step, migration, sharing, virial, passes, *several
        names = (module.__name__ for module in modules)
        machine_code.load(ranks, *names, *loop_modules(self.integrator))
        scheme = self.integrator.scheme
        self.rotation = Rotation(command, scheme.operations, self.integrator.splits)
        self.membership = Membership(lammps, ranks, command)
        self.infile = command.infile and lammps.text(command.infile)
        self.oriented = ranks.any(lammps.orients)
        self.register()
        self.template = command.mol
        if self.template and not lammps.has("molecule", self.template):
            raise command.wrong(
                f"there is no molecule template '{self.template}' (keyword mol): "
                "define it before the fix, by command molecule"
            )
        self.restart_file = bool(self.infile or self.template)
        self.rigid_flag = lammps.radius is not None
        refuse_time_step(lammps.dt, self.integrator, line.name)

    @_hook
    def define_bodies(self) -> None:
        """Decide which atom is in which body; the host is there; collective."""
        self.host.carry(self.lammps, None)
        self.host.point()
        self.membership.define(self.host.kept_bodies)
        # None if others may come
        self.array_rows = None if self.template else count(self.membership)
        integrator = self.integrator
        self._siblings = partial(siblings_of, self.lammps.handle, self.number)
        maker = BodyMaker(
            self.lammps, self.ranks, self.host, self.membership, self.infile,
            self.counts_from_one, integrator.rows + integrator.kept, self.oriented,
        )  # fmt: skip
        self.external = ExternalForces(self.lammps, self.ranks, self.host)
        self.setting = Setting(
            self.lammps, self.ranks, self.host, self.command, integrator, self.membership, maker,
            self.rotation, self.external, log.LogLines(self.host, self.line), self._siblings,
            self.rigid_flag, self.infile,
        )  # fmt: skip
        self.setting.log.warn(former_names.warnings(*_classes(integrator)))

    @_hook
    def report_definition(self) -> None:
        """Log what the bodies are, where LAMMPS takes no text for its log in a run; collective."""
        setting, command = self.setting, self.command
        bodies, report, _ = setting.maker.prepare(None)()
        self.rotation.choose(bodies, self.ranks, self.host)
        thermo = Thermo(bodies, self.lammps, self.ranks)
        facts, lines = log.facts_of(thermo, report), log.of_words(command, self.lammps)
        if command.details:
            lines.append(log.work(facts, self._first_step_facts(bodies), command, OtherFixes(None)))
        lines = log.summary(facts, self.integrator.method, command, "", lines)
        setting.log.summary(lines, self.host.advice(facts.removed), projected=False)
        warmed = bool(self.integrator.thermostat)
        mask = switches.mask(switches.choices(command, self.ranks, bodies), bodies)
        warnings = [*log.of_start(report, warmed, (self.host.group, command.group))]
        warnings += [*report.warnings, *log.of_motion(thermo, mask, self.membership.name)]
        setting.log.warn([*warnings, *log.of_time_step(self.lammps)])

    def _first_step_facts(self, bodies: Bodies) -> log.StepFacts:
        """Those that are known when the fix is defined."""
        return log.StepFacts(
            splits=self.integrator.splits,
            exact=self.rotation.exact,
            spin=bodies.spin,
            oriented=bodies.oriented,
            thermostat=bool(self.integrator.thermostat),
            box_every=0,
            two_passes=bool(self.integrator.scheme.go_on),
            external=False,
            half_step=True,
            virial=False,
        )

    # ------------------------------------------------------------- what it declares to LAMMPS

    @property
    def flips(self) -> bool:
        return any(part.flips for part in self.integrator.parts)

    @property
    def needs_energy(self) -> bool:
        return needs_energy(self.integrator.parts)

    @property
    def box_every(self) -> int:
        return box_every(self.integrator.parts)

    @property
    def couples(self) -> bool:
        """Whether its scalar is an energy that LAMMPS's econserve counts: f_ID of a fix rigid with
        keyword langevin is a temperature."""
        return self.integrator.scalar is not None and self.line.replaces not in rigid_fixes.BODIES

    @property
    def restart_state(self) -> np.ndarray | None:
        return self.integrator.restart_state

    @property
    def vector_extensive(self) -> tuple[bool, ...]:
        return *VALUES.values(), *self.integrator.values.values()

    @property
    def vector_names(self) -> tuple[str, ...]:
        return *VALUES, *self.integrator.values

    @property
    def carries(self) -> int:
        """How many numbers go with an atom to another rank."""
        integrator = self.integrator
        of_body = ROWS + integrator.rows + integrator.kept + 3 * bool(self.command.moments)
        return migration.OF_BODY + of_body + (extended.ROWS if self.oriented else extended.ORIENT)

    @property
    def replacement_notice(self) -> str | None:
        """Lines for the log if it replaces one of LAMMPS's rigid fixes; else None."""
        return replacement_notice(cast(str, self.host.fix_id), self.command)  # native: it has one

    @property
    def counts_from_one(self) -> bool:
        """Whether files count bodies of style custom from 1, as LAMMPS's rigid fixes do."""
        return bool(self.line.replaces) and self.command.style == "custom"

    @property
    def table_path(self) -> str | None:
        """The file of keyword output; None as long as there is none."""
        table = self.setting.table
        return table.path if table else None

    @property
    def keeps_bodies(self) -> bool:
        """Whether more is known of some bodies than their atoms tell."""
        return self.setting.keeps_bodies

    # ------------------------------------------------------------- a run

    @_hook
    def init(self) -> None:
        """A run begins."""
        last, self.run = self.run, None
        try:
            self.run = begin_run(self.setting, last)
        except BaseException:
            self.run = last if last and last.has_bodies else None
            raise
        self.run.bodies.force_receiver = WeakMethod(self.give_forces)

    @_hook
    def setup(self, vflag: int) -> None:
        """The first forces of a run are known."""
        self._run.follow("setup")

    @_hook
    def post_neighbor(self) -> None:
        """LAMMPS has re-neighbored."""
        self._run.follow_atoms()

    @_hook
    def push(self) -> None:
        """The forces of a step are known: evaluate external forces."""
        self._run.push()

    @_hook
    def act(self, number: int, found: int) -> None:
        """Do what an action of the schedule has for Python: see `Run.act`."""
        self._run.act(number, found)

    @_hook
    def initial_integrate(self, vflag: int) -> None:
        """The first half of a step."""
        self.host.vflag, self._run.stepped = vflag, True
        self._run.follow("begin")

    @_hook
    def final_integrate(self) -> None:
        """The second half of a step."""
        self._run.follow("end")

    @_hook
    def initial_integrate_respa(self, vflag: int, level: int, loop: int) -> None:
        """A level of run_style respa begins a step."""
        self._run.begin_level(vflag, level)

    @_hook
    def final_integrate_respa(self, level: int, loop: int) -> None:
        """A level's new forces end its step."""
        self._run.end_level(level)

    @_hook
    def end_of_step(self) -> None:
        """A step of run_style respa is over, and LAMMPS has added up the forces of its levels."""
        self._run.cache.clear()
        self._run.follow("end_levels")

    @_hook
    def reset_dt(self) -> None:
        """The time step may have changed."""
        refuse_time_step(self.lammps.dt, self.integrator, self.line.name)
        if self.run:
            self.run.follow("reset_dt")

    @_hook
    def post_run(self) -> None:
        """A run is over."""
        self._run.follow("post_run")

    # ------------------------------------------------------------- a minimization

    @_hook
    def min_store(self) -> None:
        """A line search begins."""
        self._minimization.store()

    @_hook
    def min_step(self, alpha: float, direction: int) -> None:
        """Move bodies and atoms by alpha times the direction at this address, from where the line
        search began."""
        self._minimization.move(alpha * self._minimization.at(direction))
        self._run.passes.run("place")
        cast(Any, self.setting.made).started = False

    @_hook
    def min_force(self, forces: int) -> None:
        """Write the forces on the bodies' coordinates to this address."""
        run = self._run
        run.passes.run("gather")
        if self.host.vflag:
            run.passes.run("constraint_virial")
        run.cache.clear()
        self._minimization.at(forces)[:] = self._minimization.forces()

    @_hook
    def max_alpha(self, direction: int) -> float:
        """The largest multiple of the direction at this address that moves no body by more than
        dmax."""
        lengths = np.linalg.norm(self._minimization.at(direction), axis=1)
        return self.host.dmax / lengths.max(initial=1e-300)

    # ------------------------------------------------------------- between runs

    @_hook
    def keep_bodies(self) -> None:
        """LAMMPS writes a restart file: have what the fix line does not say of the bodies ready;
        collective."""
        if not self.lammps.running:
            self.host.point()
        self.host.keep_bodies(self.membership.exceptions())

    @_hook
    def write_restart(self) -> None:
        """LAMMPS writes a restart file: have `restart_state` ready; collective."""
        if self.run:
            self.integrator.prepare_restart(self.run)

    @_hook
    def write_restart_file(self, name: str) -> None:
        """LAMMPS writes a restart file: write bodies of which more is known than their atoms to a
        file beside it, to be read as infile; collective."""
        if not self.keeps_bodies:
            return
        several = any(one.keeps_bodies for one in self._siblings())
        own = f".{self.host.fix_id}" if several else ""
        path, bodies = f"{name}{own}.rigid", self.completed_bodies()
        infile.write(path, self.counts_from_one, bodies, self.membership)

    @_hook
    def zero_momentum(self) -> None:
        """Stop the bodies' translation; collective."""
        self._zero("v")

    @_hook
    def zero_rotation(self) -> None:
        """Stop the bodies' rotation; collective."""
        self._zero("p")

    def _zero(self, name: str) -> None:
        """Stop a motion of the bodies, v or p, that the next run will have: those of the last one,
        or those that it makes of the atoms; collective."""
        setting = self.setting
        if setting.goes_on:
            bodies = cast(Bodies, setting.previous)
        else:
            bodies = setting.maker.of_atoms_now(setting.previous if setting.ran else None)
            bodies.bind(self.membership)
            bodies.update_box(self.lammps.box)
        getattr(bodies, name)[:] = 0.0
        AtomVelocities(bodies, self.lammps, self.ranks).set_in_body()
        if self.run:
            self.run.cache.clear()

    @_hook
    def reset_target(self, temperature: float) -> None:
        """Keep this temperature from now on."""
        for part in self.integrator.parts:
            part.reset_target(temperature, self.run)

    @_hook
    def modify_external(self, text: str) -> None:
        """Read the words of fix_modify external."""
        self.external.modify(text)

    def give_forces(self, ids: ArrayLike, force: ArrayLike, torque: ArrayLike) -> None:
        """Take what Python hands in: see `bodies.Bodies.add_force`; collective."""
        known = all_ids(self._run.bodies, self.ranks)
        self.external.give(known, ids, force, torque)

    # ------------------------------------------------------------- what LAMMPS and others ask

    def completed_bodies(self, forces: bool = True) -> Bodies:
        """The bodies as at the end of a step with output, with their forces, if wanted; collective.

        Raises:
            RunError: on all ranks, before the first run.
        """
        return self._run.completed_bodies(forces)

    def table(self) -> np.ndarray:
        """The bodies that are counted on this rank as they are now: see `output.table`."""
        return output.table(self.completed_bodies(), self.lammps)

    @_hook
    def dof(self, group: int) -> int:
        """Degrees of freedom that the bodies take from a group of LAMMPS; collective.

        Args:
            group: its number.
        """
        setting, words = self.setting, self.host.command
        between = self.host.phase == Phase.OVER or not self.lammps.running
        sets = words[2:3] if between and "velocity" in words[:1] else ()
        if "create" in sets:
            # all atoms' velocities are scaled now; a body keeps its share of them when the run
            # makes them rigid motion
            return 0
        if not self.lammps.running or setting.made is None or "scale" in sets:
            # atoms may be other ones and elsewhere; the bodies of the last run stay as they are
            bodies = setting.maker.of_atoms_now(setting.previous if setting.ran else None)
        else:
            bodies = setting.made.bodies
        thermo, bit = Thermo(bodies, self.lammps, self.ranks), 1 << group
        if "scale" in sets and not bodies.spin:
            return thermo.removed_freedom_to_scale(bit)
        return thermo.removed_freedom(bit)

    @_hook
    def compute_scalar(self) -> float:
        """The integrator's scalar, or the temperature of the bodies; collective.

        That is of all components, whether force and torque act on them or not; in the place of a
        fix rigid of the active ones, as there.
        """
        run, command = self._run, self.command
        if self.couples and self.integrator.scalar:
            return self.integrator.scalar(run)
        if self.line.replaces and (command.force or command.torque):
            mask = cast(np.ndarray, run.mask)  # some are off
            return run.cached("active", lambda: run.thermo.temperature_of(mask), forces=False)
        return run.energies().temperature

    @_hook
    def compute_vector(self, i: int) -> float:
        """Kinetic energy of translation and of rotation, temperature of each, and then the
        integrator's own values; collective."""
        own = i - len(VALUES)
        run = self._run
        return run.energies()[i] if own < 0 else self.integrator.extra_values(run)[own]

    @_hook
    def compute_array(self, i: int, j: int) -> float:
        """Value j of body i: see `output.global_array`; collective."""
        run = self._run
        run.take_seen_velocities()

        def of_all() -> np.ndarray:
            own = output.table(run.bodies, self.lammps)
            return output.global_array(self.ranks.gather_to_all(own))

        rows = run.cached("array", of_all)
        self.host.lend_array(rows)
        return rows[i, j]

    @_hook
    def rows_of_rank(self, words: str, groupbit: int) -> tuple[int, int]:
        """What compute rigid/local says of the bodies: see `output.rows_of_rank`; collective.

        Args:
            words: the values, with a space between.  groupbit: of the compute's group.
        Returns:
            the address of the rows, which stay until the next call, and how many there are.
        """
        bodies = self.completed_bodies()
        rows = output.rows_of_rank(bodies, self.lammps, words.split(), groupbit)
        self._rows_lent = rows
        return rows.ctypes.data, len(rows)

    @property
    def _run(self) -> Run:
        refuse(
            self.run is None,
            "there is nothing to tell of the bodies before the first run, or after one that could "
            "not begin: 'run 0' makes them",
        )
        return cast(Run, self.run)

    @property
    def _minimization(self) -> Any:
        return self._run.minimization


def loop_modules(integrator: Integrator) -> list[str]:
    """The names of the modules that have the loops of an integrator."""
    loops = integrator.prepares, integrator.scheme.advance, integrator.scheme.lead
    return [
        *(kind.__module__ for kind in _classes(integrator)),
        *(name for part in integrator.parts for name in part.modules),
        *(loop.module for loop in loops if loop),
    ]


def _classes(integrator: Integrator) -> list[type]:
    """The classes of an integrator and of its parts, with those from which they derive."""
    return [kind for one in (integrator, *integrator.parts) for kind in type(one).__mro__]
