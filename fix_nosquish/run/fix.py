"""The fix that LAMMPS drives: its hooks."""

from typing import Any, cast
from weakref import WeakMethod

import numpy as np
from numpy.typing import ArrayLike

from ..bodies import extended, infile
from ..bodies.bodies import Bodies
from ..bodies.build import count
from ..bodies.membership import Membership
from ..errors import refuse
from ..host import rigid_fixes
from ..host.command import Command, Line
from ..host.hosts import Host, Phase
from ..host.lammps import Lammps
from ..host.own_fix import driven
from ..loops import machine_code
from ..motion import body_forces, step, virial
from ..motion.block import ROWS
from ..ranks import migration, mpi, sharing
from ..ranks.arrangement import OF_BODY
from ..ranks.communicator import ALONE, Communicator, Ranks
from . import former_names, output, switches
from .beginning import begin_run
from .conditions import refuse_time_step
from .external import ExternalForces, all_ids
from .integrator import Integrator
from .log import FixLog, of_left_out
from .making import BodyMaker
from .registry import Registered, siblings_of
from .replacement import replacement_notice
from .rotation import Rotation
from .run import Run
from .setting import Setting
from .thermo import VALUES, Thermo
from .velocities import AtomVelocities


def fix_of(kind: type[Integrator], ptr: Any, line: Line) -> Any:
    """What LAMMPS calls for a fix line: a `Fix`, or a driver of one.

    Args:
        kind: the class of the integrator.  ptr: the pointer to LAMMPS that this hands over.
    """
    lammps = Lammps(ptr)
    ranks = Communicator(lammps.communicator) if lammps.ranks > 1 else ALONE
    return driven(lambda: Fix(kind, lammps, ranks, line), lammps, ranks, line)


class Fix(Registered):
    """A fix of this package.

    LAMMPS calls the hooks; `schedule` says what is done at each of them.  Those of each step are
    called from Python with LAMMPS's own fix python/move only: the plugin follows the schedule in
    C++, and calls `run_action`.

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
    """

    array_columns = 15  # of `output.global_array`

    def __init__(self, kind: type[Integrator], lammps: Lammps, ranks: Ranks, line: Line) -> None:
        self.lammps, self.ranks, self.line = lammps, ranks, line
        self.host = cast(Host, None)  # set by what calls it, after this
        self.run: Run | None = None
        self.virial: np.ndarray | None = None
        self.command = command = Command.parse(line, kind.keywords, kind.extra_keywords)
        self.integrator = kind(command, lammps.dimension)
        modules = [step, migration, sharing, virial, body_forces] + [mpi] * (ranks.size > 1)
        names = (module.__name__ for module in modules)
        machine_code.load(ranks, *names, *loop_modules(self.integrator))
        self.membership = Membership(lammps, ranks, command)
        scheme = self.integrator.scheme
        self._rotation = Rotation(command, scheme.operations, self.integrator.splits)
        self._oriented = ranks.any(lammps.orients)
        self._infile = command.infile and lammps.text(command.infile)
        self.template = command.mol
        if self.template and not lammps.has("molecule", self.template):
            raise command.wrong(
                f"there is no molecule template '{self.template}' (keyword mol): "
                "define it before the fix, by command molecule"
            )
        self.restart_file = bool(self._infile or self.template)
        self.rigid_flag = lammps.radius is not None
        refuse_time_step(lammps.dt, self.integrator.parts, line.name)

    def define_bodies(self) -> None:
        """Decide which atom is in which body; the host is there; collective."""
        self.host.carry(self.lammps, None)
        self.host.point()
        self.membership.define(self.host.kept_bodies)
        # None if others may come
        self.array_rows = None if self.template else count(self.membership)
        integrator, line = self.integrator, self.line
        # as LAMMPS's rigid fixes do
        counts_from_one = bool(line.replaces) and self.command.style == "custom"
        self.register()
        self.setting = Setting(
            self.lammps, self.ranks, self.host, self.command, integrator, self.membership,
            BodyMaker(
                self.host, self.membership, self._rotation, self._infile, counts_from_one,
                integrator.rows + integrator.kept, self._oriented,
            ),
            ExternalForces(self.lammps, self.ranks, self.host),
            FixLog(self.host, self.command, integrator, self._rotation, self.membership),
            self.number, self.rigid_flag,
        )  # fmt: skip
        left_out = of_left_out(self.membership.left_out, self.command.group)
        self.setting.log.warn([*former_names.warnings(*_classes(integrator)), *left_out])
        self._declare(integrator)

    def _declare(self, integrator: Integrator) -> None:
        """Have ready what LAMMPS must know of the fix: see `structs.Bridge`."""
        # f_ID of a fix rigid with keyword langevin is a temperature, no energy
        replaces_bodies = self.line.replaces in rigid_fixes.BODIES
        self.couples = integrator.scalar is not None and not replaces_bodies
        self.flips = any(part.flips for part in integrator.parts)
        self.needs_energy = self.setting.needs_energy
        self.box_every = self.setting.box_every
        self.restart_state = integrator.restart_state
        self.vector_extensive = *VALUES.values(), *integrator.values.values()
        of_body = ROWS + integrator.rows + integrator.kept + 3 * bool(self.command.moments)
        of_atom = extended.ROWS if self._oriented else extended.ORIENT
        self.carries = OF_BODY + of_body + of_atom  # numbers that go with an atom

    def report_definition(self) -> None:
        """Log what the bodies are, where LAMMPS takes no text for its log in a run; collective."""
        bodies, report, _ = self.setting.maker.build_of(None)()
        self._rotation.choose(bodies, self.ranks, self.host)
        mask = switches.mask(switches.choices(self.command, self.ranks, bodies), bodies)
        self.setting.log.report(Thermo(bodies, self.lammps, self.ranks), report, mask)

    @property
    def replacement_notice(self) -> str | None:
        """Lines for the log if it replaces one of LAMMPS's rigid fixes; else None."""
        return replacement_notice(cast(str, self.host.fix_id), self.command)  # native: it has one

    # ------------------------------------------------------------- a run

    def init(self) -> None:
        """A run begins."""
        last, self.run = self.run, None
        try:
            self.run = begin_run(self.setting, last)
        except BaseException:
            self.run = last if last and vars(last) else None  # it may have been freed
            raise
        self.run.bodies.force_receiver = WeakMethod(self.give_forces)

    def setup(self, vflag: int) -> None:
        """The first forces of a run are known."""
        self._run.perform("setup")

    def post_neighbor(self) -> None:
        """LAMMPS has re-neighbored."""
        self._run.follow_atoms()

    def push(self) -> None:
        """The forces of a step are known: evaluate external forces."""
        run = self._run
        self.setting.external.evaluate(run.bodies, about_centre=bool(self.setting.box_every))

    def run_action(self, number: int, code: int) -> None:
        """Do what an action of the schedule has for Python: see `Run.act`."""
        self._run.act(number, code)

    def initial_integrate(self, vflag: int) -> None:
        """The first half of a step."""
        self.host.vflag, self._run.stepped = vflag, True
        self._run.perform("begin")

    def final_integrate(self) -> None:
        """The second half of a step."""
        self._run.perform("end")

    def initial_integrate_respa(self, vflag: int, level: int, loop: int) -> None:
        """A level of run_style respa begins a step."""
        self._run.begin_level(vflag, level)

    def final_integrate_respa(self, level: int, loop: int) -> None:
        """A level's new forces end its step."""
        self._run.end_level(level)

    def end_of_step(self) -> None:
        """A step of run_style respa is over, and LAMMPS has added up the forces of its levels."""
        self._run.cache.clear()
        self._run.perform("end_levels")

    def reset_dt(self) -> None:
        """The time step may have changed."""
        refuse_time_step(self.lammps.dt, self.integrator.parts, self.line.name)
        if self.run:
            self.run.perform("reset_dt")

    def post_run(self) -> None:
        """A run is over."""
        self._run.perform("post_run")

    # ------------------------------------------------------------- a minimization

    def min_store(self) -> None:
        """A line search begins."""
        self._minimization.store()

    def min_step(self, alpha: float, direction: int) -> None:
        """Move bodies and atoms by alpha times the direction at this address, from where the line
        search began."""
        self._minimization.move(alpha * self._minimization.at(direction))
        self._run.passes.run("place")
        cast(Any, self.setting.maker.made).started = False

    def min_force(self, forces: int) -> None:
        """Write the forces on the bodies' coordinates to this address."""
        run = self._run
        run.passes.run("gather")
        if self.host.vflag:
            run.passes.run("constraint_virial")
        run.cache.clear()
        self._minimization.at(forces)[:] = self._minimization.forces()

    def max_alpha(self, direction: int) -> float:
        """The largest multiple of the direction at this address that moves no body by more than
        dmax."""
        lengths = np.linalg.norm(self._minimization.at(direction), axis=1)
        return self.host.dmax / lengths.max(initial=1e-300)

    # ------------------------------------------------------------- between runs

    def keep_bodies(self) -> None:
        """LAMMPS writes a restart file: have what the fix line does not say of the bodies ready;
        collective."""
        if not self.lammps.running:
            self.host.point()
        self.host.keep_bodies(self.membership.exceptions())

    def write_restart(self) -> None:
        """LAMMPS writes a restart file: have `restart_state` ready; collective."""
        if self.run:
            self.integrator.prepare_restart(self.run)

    def write_restart_file(self, name: str) -> None:
        """LAMMPS writes a restart file: write bodies of which more is known than their atoms to a
        file beside it, to be read as infile; collective."""
        maker = self.setting.maker
        if not maker.keeps_bodies:
            return
        siblings = siblings_of(self.lammps.handle, self.number)
        several = any(sibling.maker.keeps_bodies for sibling in siblings)
        path = f"{name}{f'.{self.host.fix_id}' if several else ''}.rigid"
        infile.write(path, maker.counts_from_one, self.completed_bodies(), self.membership)

    def zero_momentum(self) -> None:
        """Stop the bodies' translation; collective."""
        self._zero("v")

    def zero_rotation(self) -> None:
        """Stop the bodies' rotation; collective."""
        self._zero("p")

    def _zero(self, name: str) -> None:
        """Stop a motion of the bodies, v or p, that the next run will have: those of the last one,
        or those that it makes of the atoms; collective."""
        maker = self.setting.maker
        if maker.goes_on:
            bodies = cast(Bodies, maker.last)
        else:
            bodies = maker.next_bodies()
            bodies.bind(self.membership)
            bodies.update_box(self.lammps.box)
        getattr(bodies, name)[:] = 0.0
        AtomVelocities(bodies, self.lammps, self.ranks).set_in_body()
        if self.run:
            self.run.cache.clear()

    def reset_target(self, temperature: float) -> None:
        """Keep this temperature from now on."""
        for part in self.integrator.parts:
            part.reset_target(temperature, self.run)

    def modify_external(self, text: str) -> None:
        """Read the words of fix_modify external."""
        self.setting.external.modify(text)

    def give_forces(self, ids: ArrayLike, force: ArrayLike, torque: ArrayLike) -> None:
        """Take what Python hands in: see `bodies.Bodies.add_force`; collective."""
        known = all_ids(self._run.bodies, self.ranks)
        self.setting.external.give(known, ids, force, torque)

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

    def dof(self, group: int) -> int:
        """Degrees of freedom that the bodies take from a group of LAMMPS; collective.

        Args:
            group: its number.
        """
        maker, words = self.setting.maker, self.host.command
        between = self.host.phase == Phase.OVER or not self.lammps.running
        sets = words[2:3] if between and "velocity" in words[:1] else ()
        if "create" in sets:
            # all atoms' velocities are scaled now; a body keeps its share of them when the run
            # makes them rigid motion
            return 0
        if not self.lammps.running or maker.made is None or "scale" in sets:
            # atoms may be other ones and elsewhere; the bodies of the last run stay as they are
            bodies = maker.next_bodies()
        else:
            bodies = maker.made.bodies
        thermo, bit = Thermo(bodies, self.lammps, self.ranks), 1 << group
        if "scale" in sets and not bodies.spin:
            return thermo.removed_freedom_to_scale(bit)
        return thermo.removed_freedom(bit)

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

    def compute_vector(self, i: int) -> float:
        """Kinetic energy of translation and of rotation, temperature of each, and then the
        integrator's own values; collective."""
        run, extra = self._run, i - len(VALUES)
        return run.energies()[i] if extra < 0 else self.integrator.extra_values(run)[extra]

    def compute_array(self, i: int, j: int) -> float:
        """Value j of body i: see `output.global_array`; collective."""
        run = self._run

        def of_all() -> np.ndarray:
            rows = output.table(run.bodies, self.lammps)
            return output.global_array(self.ranks.gather_to_all(rows))

        rows = run.cached("array", of_all)
        self.host.lend_array(rows)
        return rows[i, j]

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
    return [kind for each in (integrator, *integrator.parts) for kind in type(each).__mro__]
