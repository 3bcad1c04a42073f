"""How LAMMPS drives an integrator, step by step.

    initial_integrate   begin: what stands before the forces in the splitting; atoms have new places
    (LAMMPS)            moves atoms between ranks if it is time to, computes forces
    post_neighbor       follow the atoms, if they were moved
    final_integrate     end: force and torque of each body (of shared ones: one exchange), what
                        stands behind the forces in the splitting, the atoms' velocities

On a step that nothing looks at, the end is left to the next step, and is one pass with its begin.
The plugin then does both by itself; it calls these methods where Python has something to do.  With
run_style respa each level's forces begin and end a step with its own time step; the innermost level
moves the bodies.
"""

import weakref
from enum import IntEnum
from functools import partial
from itertools import count as count_from_zero
from math import gcd

import numpy as np

from ..bodies import extended, infile, templates, turnover
from ..bodies.build import build, count
from ..bodies.extended import particles_of
from ..bodies.kinds import compare
from ..bodies.membership import Membership
from ..box import deform
from ..errors import RunError
from ..host import rigid_fixes
from ..host.command import Command, Line
from ..host.hosts import driven_by_plugin, hook
from ..host.lammps import Lammps, pointer
from ..host.own_fix import OwnFix
from ..loops import machine_code
from ..motion import step, virial
from ..motion.block import ROWS
from ..motion.operations import EXACT
from ..ranks import lookup, migration, sharing
from ..ranks.communicator import ALONE, Communicator
from . import log, output, passes, reports, threads
from .declaration import Declaration
from .external import External
from .other_fixes import OtherFixes, refuse_other_integrators
from .switches import Switches


class Phase(IntEnum):
    """Where in a run the bodies are; the plugin has the same numbers."""

    NEW = 0  # a run begins: the forces are not known
    SET = 1  # a step is done
    HALF = 2  # a step has begun
    WAITING = 3  # a step has begun, and its end is left to the next one
    OVER = 4  # the run is over: what changes velocities now is a script


class Integrator(Declaration):
    """What LAMMPS's fix python/move drives; a derived class declares how bodies move.

    LAMMPS calls the methods; the documentation says what the words of the fix line mean.

    Args:
        ptr: the pointer to LAMMPS that fix python/move hands over.
        line: the `command.Line`, or the text of one in quotes.
    Raises:
        RunError: with a message for the user, from any method.

    Attributes:
        name: how the fix line calls it.
        bodies: the `Bodies`, from the first use of the fix on.
        exact: whether their free rotation is exact, not split.
        host: what calls this object: see `hosts.Host`.
        virial: (6,) this rank's constraint virial (xx yy zz xy xz yz), in the memory of the
            plugin's fix; None with LAMMPS's own fix python/move.
        virial_per_atom: (atoms, 9), the same of each atom, with yx zx zy, while LAMMPS asks for it.
        parameters: what the operations take, a record: see `Declaration.numbers`.
        mask: what of forces and torques acts, (6, bodies) or (6, 1), as the run begins; None if all
            does.
        rigid_flag: whether pair styles may ask for the bodies' masses, as those of grains do.
        other_fixes: the `OtherFixes` of the run.
        told_box: the host's, if another fix changes the box in this run and bodies move with it;
            else None.
        streams: whether it is with remap v that this happens.
        waiting: with `mid_step`, the time step of the half kick that is left to the next run's
            first step: 0.0 if none is, None if it is that step's own.
        external: the `External` forces.
        gravity: the acceleration by which bodies have weight, (3,); None for none.
        half_step_velocities: whether something may read the atoms' velocities between the halves of
            a step.
    """

    host = parameters = told_box = gravity = None
    streams = rigid_flag = exact = False
    follows_atoms = True
    virial = virial_per_atom = waiting = None
    _all, _numbers = weakref.WeakSet(), count_from_zero()

    @property
    def carries(self):
        """How many numbers go with an atom to another rank."""
        of_body = ROWS + self.rows + self.kept + 3 * bool(self.command.moments)
        return migration.OF_BODY + of_body + (extended.ROWS if self.oriented else extended.ORIENT)

    def __init__(self, ptr, line):
        line = Line.quoted(line) if isinstance(line, str) else line
        self.lammps = Lammps(ptr)
        several = self.lammps.ranks > 1
        self.communicator = Communicator(self.lammps.communicator) if several else ALONE
        self.line, self.name, self.number = line, line.name, next(self._numbers)
        self.bodies = self.passes = self.notes = None
        self._ran = self._lost = self._stepped = self._has_rotors = False
        # of a step: it begins, with the forces of the last one; these are gathered anew; it is of
        # another length
        self._beginning = self._gathers_anew = self._resets = False
        self.other_fixes, self.half_step_velocities = OtherFixes(None), True
        self.external = External(self)
        if not driven_by_plugin():
            self.host = OwnFix(self.lammps, self.communicator)
        self._begin(line)

    @hook
    def _begin(self, line):
        modules = [step, migration, sharing, virial, passes]
        if self.communicator.size > 1 or self.host:
            modules.append(lookup)
        if self.lammps.threads > 1:
            modules.append(threads)
        names = [module.__name__ for module in modules]
        machine_code.load(
            self.communicator,
            *names,
            *(kind.__module__ for kind in type(self).__mro__),
            *self.modules,
        )
        self.command = Command.parse(line, self.keywords)
        self._refuse_other_rotor(self.command.rotor)
        self.membership = Membership(self.lammps, self.communicator, self.command)
        self.infile = self.command.infile and self.lammps.text(self.command.infile)
        self.reports = reports.Reports(self)
        self.oriented = self.communicator.any(self.lammps.orients)
        self._all.add(self)
        self.template = self.command.mol
        self.restart_file = bool(self.infile or self.template)
        if self.template and not self.lammps.has("molecule", self.template):
            raise self.command.wrong(
                f"there is no molecule template '{self.template}' (keyword mol): "
                "define it before the fix, by command molecule"
            )
        self.reset_dt()
        if self.host:
            # LAMMPS's own fix: it takes commands, and so text for its log, only between runs
            self._build()
            self.reports.say(False)
        else:
            self.array_rows = None  # they will be others
            if not self.template:
                self.array_rows = count(self.communicator, self.membership)
            self.rigid_flag = self.lammps.radius is not None

    def _refuse_other_rotor(self, rotor):
        """Raise an error if the words ask for a rotation that this class does not have."""
        problem = None
        if rotor == "split" and not self.splits:
            problem = (
                "keywords mrot and order, and rotor split, are for integrators that split the "
                "rotation, which {} does not"
            )
        elif rotor == "exact" and not self._can_be_exact:
            problem = "keyword rotor exact is for the rotation of fix nosquish/nve, not that of {}"
        if problem:
            raise self.command.wrong(problem.format(self.name))

    @property
    def _can_be_exact(self):
        return any(operation.exact for operation in self.operations.values())

    def _choose_rotor(self):
        """Choose whether the rotation is exact, for the first bodies that turn: these keep it, and
        others that come take it over; collective."""
        own, told = self._exact_by_default(), self.host.rotor
        if not self._has_rotors:
            self.exact = bool(told) if told >= 0 and self._left_to_bodies else own
            self._has_rotors = self.communicator.any(self.bodies.rotors > 0)
        self.host.rotor = -1 if self.exact == own else int(self.exact)

    @property
    def _left_to_bodies(self):
        """Whether neither the words nor the class say how the rotation is done."""
        either = self._can_be_exact and self.splits
        return either and not (self.command.rotor or self.bodies.planar)

    def _exact_by_default(self):
        """Whether the rotation is exact for the bodies as they are; collective.

        By default that of symmetric tops is, whose axes may be chosen in more than one way.
        """
        if not self._left_to_bodies:
            always = self._can_be_exact and not (self.splits or self.bodies.planar)
            return self.command.rotor == "exact" or (always and not self.command.rotor)
        moment = self.bodies.moment[:, : self.bodies.rotors]
        equal = (moment[0] == moment[1]) | (moment[1] == moment[2])
        return not self.communicator.any(not equal.all())

    @classmethod
    def of_fix(cls, lmp, fix_id):
        """The integrator of a LAMMPS that the fix of this ID drives."""
        every = cls._of_lammps(pointer(getattr(lmp, "lmp", lmp)))
        for other in every:
            # LAMMPS's own fix tells no ID
            if other.host.fix_id == fix_id or (other.host.fix_id is None and len(every) == 1):
                return other
        if every and every[0].host.fix_id is None:
            raise RunError(
                "a LAMMPS's own fix python/move does not tell which of several fixes has the ID "
                f"{fix_id}: use the keyword output of each",
                everywhere=True,
            )
        raise RunError(f"there is no fix {fix_id} of fix_nosquish", everywhere=True)

    @property
    def mates(self):
        """All integrators of this LAMMPS, this one among them, in an order alike on all ranks."""
        return sorted(self._of_lammps(self.lammps.handle), key=lambda mate: mate.number)

    @classmethod
    def _of_lammps(cls, handle):
        """Those that a fix of this LAMMPS drives: not one whose making failed, nor one whose fix is
        gone, that somebody still holds."""
        return [one for one in cls._all if one.host and one.lammps.handle == handle]

    def let_go(self):
        """The fix is gone, and what this object knew of LAMMPS's memory with it."""
        name = f"fix {self.host.fix_id} ({self.name})"
        self.__dict__ = {"_gone": name}

    def __getattr__(self, name):
        gone = self.__dict__.get("_gone")
        if gone is None or name[:2] == "__":
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        raise RunError(
            f"{gone} is gone, by unfix or with its LAMMPS: ask for what you need before, or take "
            "the integrator of a fix that there is",
            everywhere=True,
        )

    @property
    def story(self):
        """Lines for the log, if it takes the place of one of LAMMPS's rigid fixes; else None."""
        replaces = self.command.line.replaces
        return rigid_fixes.story(self.host.fix_id, self.command) if replaces else None

    @property
    def phase(self):
        return self.host.phase if self.host else Phase.NEW

    @phase.setter
    def phase(self, phase):
        self.host.phase = phase

    @property
    def ended(self):
        """The phase at the end of a step that is looked at."""
        return Phase.WAITING if self.mid_step else Phase.SET

    has_begun = property(lambda self: self.phase in ({Phase.HALF, Phase.WAITING} - {self.ended}))
    is_set = property(lambda self: self.phase in (self.ended, Phase.SET, Phase.OVER))
    is_over = property(lambda self: self.phase == Phase.OVER)

    # ------------------------------------------------------------- before the first step

    @hook
    def init(self):
        """A run begins: make the bodies of the atoms, leave the atoms rigid motion only."""
        if self.lammps.respa_dt is not None and not self.respa:
            raise RunError(
                f"the integrator {self.name} takes one force a step, "
                "not those of levels: use run_style verlet",
                everywhere=True,
            )
        self._refuse_time_step()
        self.host.call_always()
        self._note_waiting()
        self._first_step = self.lammps.step
        self.mid_step = type(self).mid_step and self.lammps.respa_dt is None
        self.phase = Phase.NEW
        self.reports.begin()
        self.host.set_bodies(None, None)  # the atoms are not those of the last run
        # nor are the groups: deleted ones leave their bits to others
        self.membership = Membership(self.lammps, self.communicator, self.command)
        self._look_at_fixes()
        self._refuse_streams()
        anew = not self._goes_on
        if anew:
            self._build()
        else:
            self.bodies.bind(self.lammps, self.membership)
        self._bind()
        if anew:
            if self.streams:  # velocities are those that bodies have where the box has them
                self.bodies.settle(self.lammps)
                self._take_velocities()
            self.passes.do("turn")
            self.set_velocities()
            if self.streams and not self.runs:
                self._set_plain_velocities()
        refuse_other_integrators(self)
        self._take_time_step()
        if self.mid_step and self.waiting not in (None, self.dt):
            self.passes.level_dt.set(self.waiting)
            self._take_time_step_later()
        self.reports.open()
        self.host.begin_run(self.reports.virial_of_all)
        if not self.host.calls_setup:
            self.reports.say(self.host.has_virial)
        self._tell_count()

    @property
    def told(self):
        """What tells of bodies besides their atoms when a run makes them; see `build`."""
        return partial(infile.read, self.infile, self.counts) if self.infile else None

    @property
    def counts(self):
        """Whether files count bodies of style custom from 1, as LAMMPS's rigid fixes do."""
        return bool(self.command.line.replaces) and self.command.style == "custom"

    @property
    def keeps_bodies(self):
        """Whether of some bodies more is known than their atoms tell."""
        return bool(self.infile or (self.notes and len(self.notes["given"])))

    @property
    def _goes_on(self):
        """Whether the bodies are those of the last run."""
        return self._ran and (not self.command.reinit or self.keeps_bodies)

    @property
    def runs(self):
        """Whether it is a run that LAMMPS sets up: commands between runs do so, too, such as
        write_restart, also where command run names them."""
        first, *_ = *self.host.command, "run"
        return first in ("run", "rerun") or first.startswith("temper")

    @property
    def steps_made(self):
        """Whether this run has made a step, in which a command rerun makes none."""
        return self.lammps.step != self._first_step and self.host.command[:1] != ["rerun"]

    def acts_on_bodies(self, fix):
        """Whether atoms of the bodies are in another fix's group; collective."""
        groups = self.lammps.groups[self.membership.atoms()]
        return self.communicator.any(fix.has(groups).any())

    def _tell_count(self):
        self.host.set_array_rows(self.communicator.count(self.bodies.listed.sum()))

    def _look_at_fixes(self):
        """Find out what other fixes may read and change."""
        ours = {mate.host.fix_id for mate in self.mates}
        self.other_fixes = OtherFixes(self.host.fixes(), ours, self.host.command, self.lammps.step)
        self.half_step_velocities = self.host.ghost_velocity or self.other_fixes.half_step
        deforms = self.other_fixes.deform and self.respa_dt is None and not self.box_every
        self.told_box = self.host.told_box if deforms else None
        self.streams = self.told_box is not None and bool(self.host.stream_group)
        if self.told_box is not None:
            machine_code.load(self.communicator, deform.__name__)
        self._box_may_change = self.other_fixes.change_box and self.told_box is None
        adapts = any(fix.style.startswith("adapt") for fix in self.other_fixes)
        self._masses_may_change = adapts and self.lammps.setting("rmass_flag") > 0

    def _build(self):
        known = self.bodies and (self.bodies.id, self.bodies.wrench.copy())
        former = self.former()
        self.host.carry(None, None)
        self.bodies = self.passes = None  # there may be no room for both
        self._lost = former is not None
        self.bodies, self.notes = build(
            self.lammps, self.communicator, self.membership, self.told, self.rows + self.kept,
            former, **self.particles(),
        )  # fmt: skip
        self._lost = self._started = False
        if not np.isfinite(self.notes["kinetic"]):
            raise RunError(
                "the velocities of the bodies' atoms are too large, or no numbers: their kinetic "
                "energy is not finite. Look at what has set them (velocity, read_data)",
                everywhere=True,
            )
        self._choose_rotor()
        bodies = self.bodies
        kept = self.notes.pop("kept")
        # a rerun is to tell of the atoms as they stand in the file, which has rounded places
        bodies.loose = self.command.reinit and "rerun" in self.host.command[:1]
        if kept and kept.text and not bodies.loose:
            self.lammps.per_atom("x", columns=3)[kept.atoms] += kept.shift
            self.host.log(kept.text)
        if kept and kept.turned:
            self.host.log(
                f"{kept.turned} particles were turned with their bodies, which something has moved "
                "between the runs (an orientation that 'set' gave them there is dropped)\n"
            )
        if known and np.array_equal(np.sort(known[0]), np.sort(bodies.id)):
            # commands like write_data compute no forces
            bodies.wrench[:, np.argsort(bodies.id)] = known[1][:, np.argsort(known[0])]
        bodies.external = self.external
        bodies.bind(self.lammps, self.membership)
        self._mass = self._mass_of_atoms()
        bodies.know_box(self.lammps.box)
        self.host.carry(self.lammps, bodies)
        self.host.point()
        bodies.note()
        self.host.noted()
        self._switches = Switches(self.command, self.lammps.dimension, self.communicator, bodies)
        self._box = self.lammps.box
        if self.notes.pop("new"):
            self.notes["warnings"] += compare(
                bodies, self.lammps, self.communicator, self.membership
            )

    @property
    def _mrot(self):
        """How the rotation is split, as operations have it."""
        return EXACT if self.exact else self.command.mrot

    def _weight(self):
        """What the fix of keyword gravity gives; collective."""
        name = self.command.gravity
        if not name:
            return None
        found = self.host.gravity(name)
        problem = (
            "hybrid Monte Carlo and keyword shadow, whose energy would lack the weight's: "
            f"use fix {name} without its word disable, and fix_modify {name} energy yes"
            if self.needs_energy
            else "with run_style respa: use fix gravity without its word disable"
            if self.lammps.respa_dt is not None
            else "with a LAMMPS's own fix python/move: use fix gravity without its word disable"
            if not self.host.follows
            else f"for '{name}', which is no fix gravity that stands before this fix"
            if found is None
            else None
        )
        if problem:
            raise self.command.wrong(f"keyword gravity does not serve {problem}")
        return found

    def _refuse_weight_twice(self):
        """End the run if the fix of keyword gravity acts by itself, too; collective."""
        name = self.command.gravity
        for fix in self.other_fixes if name else ():
            # with the word disable it knows no energy
            if fix.id == name and self.acts_on_bodies(fix) and self.lammps.scalar_of_fix(name):
                raise self.command.wrong(
                    f"fix {name} acts on the atoms of the bodies, and keyword gravity on the "
                    "bodies: bodies would have their weight twice. Give that fix its word "
                    "disable, or leave keyword gravity out"
                )

    def _refuse_streams(self):
        """End the run if bodies cannot cross faces as with remap v of fix deform; collective."""
        if not self.streams:
            return
        if not self.crosses or self.needs_energy:
            raise RunError(
                "fix deform has remap v, with which bodies get another velocity at periodic faces: "
                f"{self.name} does not do so. Use fix nosquish/nve without keyword "
                "shadow, and fix langevin with fix_modify temp for a temperature",
                everywhere=True,
            )
        atoms, streams = self.membership.atoms(), self.host.stream_group & 0xFFFFFFFF
        if self.communicator.any((self.lammps.groups[atoms] & streams == 0).any()):
            raise RunError(
                "fix deform has remap v for a group that lacks atoms of the bodies: "
                "give it group all",
                everywhere=True,
            )

    def _bind(self):
        self.gravity = self._weight()
        self.external.begin()
        self.bodies.cells["rate"].set(self.host.rate if self.streams else np.zeros(6))
        self.mask = self._switches.mask(self.bodies)
        self.parameters = self.numbers.new(
            ftm2v=self.lammps.ftm2v, mrot=self._mrot, **self.own_parameters()
        )
        self.passes = passes.Passes(
            self, self.bodies, self.lammps, self.communicator, self.mask,
            self.half_step_velocities, self.own_cells(),
        )  # fmt: skip
        self._set_time_step()

    def shapes(self):
        """Shapes and orientations of LAMMPS's atoms; see `hosts.Host.shapes`."""
        return self.host.shapes(len(self.lammps.groups)) if self.oriented else None

    def particles(self):
        """What `build` must know of atoms that are more than points."""
        return {"shapes": self.shapes(), "oriented": self.oriented}

    def bodies_of_atoms(self):
        """The `Bodies` that a run would make of the atoms as they are now; collective."""
        return build(
            self.lammps, self.communicator, self.membership, self.told, former=self.former(),
            **self.particles(),
        )[0]  # fmt: skip

    def former(self):
        """What the atoms were in the bodies of the last run, None if that says nothing; collective.

        An atom that was in a body stays in it; a variable is asked for the others only.  (LAMMPS's
        own fix cannot know which these are.)
        """
        if self._lost:
            raise RunError(
                "the bodies of the last run are gone, because this one could not begin: "
                "unfix this fix and define it again",
                everywhere=True,
            )
        if self.bodies is None:
            return None
        self.host.point()
        former = self.bodies.of_atoms(self.lammps, self.host.follows)
        if self.membership.variable and former.followed:
            self.membership.before = former.id, former.known
        return former if self._ran and not self.infile else None

    @hook
    def setup(self, vflag):
        """The forces of the start are known; LAMMPS is about to print its step."""
        self._refuse_new_masses()
        self._refuse_weight_twice()
        if not self.host.calls_setup:
            self.push()
        self.do("gather")
        self.reports.forget()
        if type(self).mid_step and not self.mid_step:
            self._end_waiting()
        if self.start and not self._started:
            self.start.bind_to(self.passes.cells)()
        self._started = True
        if self._goes_on:
            if not self.streams:  # where LAMMPS has just taken an atom into the box, it is faster
                own = "some have what their molecule template says"
                self._say_ignored(own if self.command.reinit else "reinit no")
            self.set_velocities()
        self.phase, self._ran = self.ended, True
        if vflag:
            self.reports.add_constraint_virial()
        if self._pressure_is_due(self.lammps.step):
            self.do("pressure")
        # LAMMPS asks the fixes behind this one for their forces after it
        self._gathers_anew = self.other_fixes.change_forces and not self.mid_step
        if self._gathers_anew:
            self.host.begins = self.lammps.step + 1
        self._leave_to_host()
        if self.host.calls_setup:
            self.reports.say(bool(vflag))
            self.reports.write()
        cause, remedy, spacing = log.forces_at_start(self)
        self.bodies.start = self.lammps.step, cause, remedy, spacing
        names = " or ".join(f"fix {f.id} (style {f.style})" for f in self.other_fixes.suspects())
        self.bodies.suspects = names and f", perhaps {names}"
        if cause and not self.quenches:
            self.host.log(self.line.naming(f"WARNING: {cause}: {remedy}\n"))

    @hook
    def min_setup(self, vflag):
        """A minimisation begins: it would move the atoms one by one."""
        raise RunError(
            "a minimisation would tear the rigid bodies apart: use fix nosquish/fire and a run "
            "instead, which keep their shapes",
            everywhere=True,
        )

    @hook
    def reset_dt(self):
        """The time step may have changed."""
        self._refuse_time_step()
        if self.mid_step and self.phase in (Phase.WAITING, Phase.OVER):
            # the last step's end has the old one, and is done when the next step begins: until
            # then atoms have the velocities of its middle, which other fixes may change
            self._take_time_step_later()
            return
        if self.phase != Phase.NEW:
            self.catch_up()
        self._take_time_step()

    def _refuse_time_step(self):
        """End the run if the integrator cannot take the time step that there is."""
        dt = self.lammps.dt
        if (dt < 0 and not self.backwards) or (dt == 0 and self.box_every):
            raise RunError(
                f"the time step is {dt:g}, and the integrator {self.name} needs one above zero: "
                "look at the command timestep",
                everywhere=True,
            )

    def _take_time_step_later(self):
        self._resets, self.host.begins = True, self.lammps.step + 1

    def _note_waiting(self):
        """Keep the time step of the last step of a run that has made some."""
        if self._stepped:
            self.waiting, self._stepped = self.dt if self.mid_step else 0.0, False

    def _end_waiting(self):
        """Do what a run without levels has left: with levels a step ends with its second half."""
        if self.waiting:
            self.passes.level_dt.set(self.waiting)
            self.do("close")
            self._set_time_step()
            self.set_velocities()
            self.waiting = 0.0

    def _take_time_step(self):
        self._resets, self.dt, self.respa_dt = False, self.lammps.dt, self.lammps.respa_dt
        self._set_time_step()

    # ------------------------------------------------------------- one step

    @hook
    def initial_integrate(self, vflag):
        """The first half of a step."""
        self._begin_step(vflag)
        if self._gathers_anew:
            self.do("gather")
            self._gathers_anew = False
        if self.lammps.step == self.host.begins:
            self.begin_trajectory()
        self.do("whole" if self.phase == Phase.WAITING else "begin")
        if self._cell_is_due(self.lammps.step - 1):
            self.do("cell")
        self._has_begun()

    @hook
    def post_neighbor(self):
        """LAMMPS has re-neighboured: atoms have new places in its arrays, some on other ranks."""
        self._refuse_new_box(self.lammps.box.periodic)
        bodies = self.bodies
        self.host.point()
        if not bodies.follow(self.lammps):
            self._turn_over()
        self.host.noted()
        self.host.keep_box()
        if self._switches.choices:
            self.passes.mask.set(self._switches.mask(bodies))
        self._refuse_new_masses()
        if self.rigid_flag:
            body = np.full(len(self.lammps.groups), -1, np.int32)
            body[bodies.index] = bodies.body
            self.host.set_bodies(body, bodies.mass)

    def _turn_over(self):
        """Atoms of bodies came or are gone, and their bodies with them; collective."""
        molecules = templates.inserted(self.host, self.communicator)
        told = partial(templates.read, molecules) if molecules else None
        how = {"told": told, "own_rows": self.rows + self.kept, **self.particles()}
        lines, given = turnover.turn_over(
            self.bodies, self.lammps, self.communicator, self.membership, how
        )
        self.notes["given"] = np.union1d(self.notes["given"], given)
        if self.start or self.box_every or self.needs_energy:
            raise RunError(
                f"bodies came or are gone by step {self.lammps.step}, which the integrator "
                f"{self.name} does not do in a run: use fix nosquish/nve or fix nosquish/nvt, "
                "without keyword shadow, or insert and delete between runs, with reinit yes",
                everywhere=True,
            )
        self.reports.warn(lines)
        self._choose_rotor()
        self.parameters.mrot = self._mrot
        self.mask = self._switches.mask(self.bodies)
        self.external.learn()
        self.turned_over()
        self._mass = self._mass_of_atoms()
        self._tell_count()
        self.reports.forget()

    @hook
    def modify_external(self, words):
        """The words of fix_modify behind external."""
        self.external.read(words)

    @hook
    def push(self):
        """The forces of this step are known: find what else acts on the bodies; collective."""
        self.external.find()

    @hook
    def final_integrate(self):
        """The second half of a step, when it is not left to the plugin."""
        self._follow()
        if not self.host.calls_setup:
            self.push()
        self.do("end")
        self.phase = self.ended
        self.reports.forget()
        if self.lammps.step != self.host.energy_step or self.take_energy():
            self._show()

    def _show(self):
        """Tell LAMMPS and the user what they ask of the end of a step."""
        step = self.lammps.step
        if step == self.host.next_output or any(
            step % n == 0 for n in self.other_fixes.velocities_every
        ):
            self.set_velocities()
        if self.host.vflag:
            self.reports.add_constraint_virial()
        if self._pressure_is_due(step):
            self.do("pressure")
        self.reports.write()

    def _cell_is_due(self, step):
        """Whether the forces of this step are followed by a change of the box."""
        return self.box_every and step % self.box_every == 0

    def _pressure_is_due(self, step):
        """Whether the forces of this step are those before or behind a change of the box."""
        return self._cell_is_due(step) or self._cell_is_due(step - 1)

    def catch_up(self):
        """Do what the last step has left to the next one."""
        if self.phase == Phase.WAITING:
            self.do("close")
            self.phase, self.host.velocities_set = Phase.SET, False
            self.reports.forget()

    def come_to_rest(self, forces=True):
        """Have the bodies as a step that is looked at leaves them, with their forces, if wanted."""
        if self.phase == Phase.WAITING:
            if not self.mid_step:
                self.catch_up()
            elif forces:
                self.do("gather")

    def do(self, name):
        """Do a list of passes; see `passes`."""
        found = self.passes.do(name)
        if found < 0:
            raise RunError(self.complaint(found), everywhere=True)
        if found:
            self._blame_forces()

    def _begin_step(self, vflag):
        self._beginning = True
        if self.phase == Phase.NEW:
            self.resumed()
            self.post_neighbor()
            self.setup(0)
        elif self.phase == Phase.OVER:
            self._refuse_new_box(self.lammps.box.periodic)
            self.host.point()
            self.bodies.refuse_moved_atoms(self.lammps)
            self.external.refuse_change()
            self.resumed()
            self._say_ignored("pre no")
            self.phase = self.ended
        elif self.other_fixes.late:
            self.take_changed_velocities(self.lammps.step - 1)
        if self._resets:
            self.catch_up()
            self._take_time_step()
        self.host.vflag = vflag
        self.reports.forget()

    def _has_begun(self):
        self.phase, self.host.velocities_set, self._beginning = Phase.HALF, False, False
        self._stepped = True

    def _set_time_step(self):
        """Have the loops use the time step as it is now."""
        if self.passes:
            respa = self.respa_dt is not None
            self.passes.dt.set(self.respa_dt[0] if respa else self.dt)
            self.passes.level_dt.set(self.dt)
            self.passes.begins.set(not respa)  # there each level begins by itself

    def _leave_to_host(self):
        """Have the plugin do what needs no Python; not what a derived class has a hook of its own
        for."""
        hooks = "initial_integrate", "final_integrate", "post_neighbor"
        own = any(getattr(type(self), name) is not getattr(Integrator, name) for name in hooks)
        if self.respa_dt is None and not own:
            output = self.command.output[:1] if self.reports.file else ()
            self.host.go_alone(
                self.passes.lists,
                velocities_every=gcd(*self.other_fixes.velocities_every),
                python_every=gcd(*output),
                ended=self.ended,
                late=bool(self.other_fixes.late),
                without=self._not_alone(),
            )

    def _not_alone(self):
        """The lists of passes that need something of Python's before or after."""
        if self._box_may_change:
            return tuple(self.passes.lists)
        looks = self.rigid_flag or self._switches.choices or self._masses_may_change
        return ("follow",) if looks else ()

    def _follow(self):
        if self.host.atoms_moved():
            self.post_neighbor()
        if self._box_may_change:
            self._refuse_new_box(True)

    def _refuse_new_box(self, held):
        """End the run if one of the box vectors that are held, (3,) bool, has changed."""
        box = self.lammps.box
        if box is self._box or self.box_every:
            return
        if ((box.h != self.bodies.cells["h"].array) & held).any():
            raise RunError(
                f"the box has changed by step {self.lammps.step}, and bodies do not move with it: "
                "in a run they do so with fix deform alone, with its remap x or v, and run_style "
                "verlet, and with fix nosquish/npt or fix nosquish/nph. The box may change between "
                "runs: bodies keep their shape when the next run makes them anew, with reinit yes "
                "and without infile or 'pre no'",
                everywhere=True,
            )
        self._box = box

    def _mass_of_atoms(self):
        """Of all bodies' atoms; collective."""
        mass = self.lammps.masses[self.bodies.index].sum()
        return self.communicator.total(np.array([mass]))[0]

    def _refuse_new_masses(self):
        """End the run if the bodies' atoms have other masses than at its begin; collective."""
        if not self._masses_may_change:
            return
        now = self._mass_of_atoms()
        if abs(now - self._mass) > 1e-9 * self._mass:
            raise RunError(
                f"the atoms of the bodies have a mass of {now:.9g} in all by step "
                f"{self.lammps.step}, and had one of {self._mass:.9g} when the run began: bodies "
                "keep their masses in a run. Change masses between runs (fix adapt does so in one)",
                everywhere=True,
            )

    def _blame_forces(self):
        bodies, step = self.bodies, self.lammps.step - self._beginning
        bad = (~np.isfinite(bodies.wrench).all(axis=0)).argmax()
        cause, remedy = bodies.instability(bad, self.lammps)
        if self.phase == Phase.NEW:
            cause, remedy = "atoms overlap at the start", log.APART
        advice = (
            "use a shorter time step or a better start, and look for what else acts on the body"
        )
        raise RunError(
            f"{cause or 'the run is unstable'}, and the force on "
            f"{self.membership.name(bodies.id[bad])} is not finite at step {step}: "
            f"{remedy or advice}"
        )

    # ------------------------------------------------------------- velocities of atoms

    def set_velocities(self):
        """Give the atoms the velocities that the bodies' motion gives them."""
        self.passes.do("velocities")
        self.host.velocities_set = self.phase != Phase.HALF

    def _set_plain_velocities(self):
        """As `set_velocities`, but of the body itself, in whatever image of it an atom is."""
        step.set_velocities.bind_to(self.passes.cells)()

    def _velocities_changed(self):
        """Whether the atoms' velocities are not those of the bodies, on any rank; collective."""
        index, v = self.bodies.index, self.lammps.per_atom("v", columns=3)
        expected = np.empty_like(v)
        step.set_velocities.bind_to(self.bodies.cells, atom_v=expected)()
        if self.streams and not self.is_over:
            deform.speed_up.bind_to(self.bodies.cells, atom_v=expected, sign=1.0)()
        return self.communicator.any(not np.array_equal(expected[index], v[index]))

    def _say_ignored(self, why):
        if self._velocities_changed():
            self.host.log(
                "The velocities of the bodies' atoms were changed between runs: "
                f"without effect, because the bodies go on ({why})\n"
            )

    def take_changed_velocities(self, step):
        """If a fix has changed the atoms' velocities at the end of this step, have the bodies move
        with them; collective."""
        due = [fix.id for fix in self.other_fixes.late if step % fix.nevery == 0]
        if not due or not self._velocities_changed():
            return
        if self.streams:
            deform.speed_up.bind_to(self.passes.cells, sign=-1.0)()
        energies = self._take_velocities()
        self.set_velocities()
        self.reports.forget()
        self.reports.say_taken_over(
            step, due, *self.lammps.mvv2e * self.communicator.total(energies)
        )

    def _take_velocities(self):
        """Have the bodies move as their atoms do, but for those of which more is known; collective.

        Returns:
            (2,) the kinetic energy of this rank's atoms before and of its bodies now, but for those
            of which more is known.
        """
        bodies, spins, known = self.bodies, None, None
        given = np.isin(bodies.id, self.notes["given"])
        if given.any():
            known = np.flatnonzero(given), bodies.momenta()[:, given]
        before = bodies.kinetic_of_atoms(self.lammps)
        if bodies.spin:
            particles = particles_of(self.lammps, self.shapes(), bodies.index)
            spins, before = particles.momentum, before + particles.kinetic()
        bodies.take_velocities(self.lammps, spins, known)
        after = bodies.kinetic()[:, bodies.sharers.owned & ~given]
        return np.array([before[~given[bodies.body]].sum(), after.sum()])

    @hook
    def post_run(self):
        """A run is over; what comes now, from a script's commands to another run, finds the bodies
        as their atoms are."""
        if self.phase != Phase.NEW:
            self._stepped |= self.steps_made
            self._refuse_new_masses()
            self.come_to_rest()
            if not self.host.velocities_set:
                self.set_velocities()
            self.take_changed_velocities(self.lammps.step)
            self.reports.say_lost()
            if self.streams:  # a body has one velocity between runs, wherever its atoms are
                self.bodies.settle(self.lammps)
                self._set_plain_velocities()
            self.reports.forget()
            if self.mid_step:
                self.reports.end_run()
            self.phase = Phase.OVER

    # ------------------------------------------------------------- one step of run_style respa

    @hook
    def initial_integrate_respa(self, vflag, ilevel, iloop):
        """A level begins a step; the innermost one moves the bodies."""
        if ilevel == len(self.respa_dt) - 1:
            self._begin_step(vflag)
        elif self.host.atoms_moved():
            self.post_neighbor()
        self.passes.level_dt.set(self.respa_dt[ilevel])
        self.do("kick")
        if ilevel == 0:
            self.do("begin")
            self._has_begun()

    @hook
    def final_integrate_respa(self, ilevel, iloop):
        """A level's new forces end its step."""
        self._follow()
        self.passes.level_dt.set(self.respa_dt[ilevel])
        self.do("close")
        self.reports.forget()
        if ilevel == len(self.respa_dt) - 1 or self.half_step_velocities:
            self.set_velocities()

    @hook
    def end_of_step(self):
        """The step of run_style respa is over, and LAMMPS has added up the forces of its levels."""
        self.phase, self.host.velocities_set = Phase.SET, True  # the outermost level has set them
        self.reports.forget()
        if self.host.vflag or self.reports.due():
            self.do("gather")
        if self.host.vflag:
            self.reports.add_constraint_virial()
        self.reports.write()

    # ------------------------------------------------------------- what LAMMPS asks

    vector_extensive, array_columns = (True, True, False, False), 15

    @hook
    def dof(self, group):
        """Degrees of freedom that the bodies take from LAMMPS's group of this number;
        collective."""
        return self.reports.removed_freedom(group)

    @hook
    def compute_scalar(self):
        """Temperature of the bodies; collective.

        It is of all components, whether force and torque act on them or not; in the place of a fix
        rigid of those that these act on, as there.
        """
        if self.command.line.replaces and (self.command.force or self.command.torque):
            return self.reports.temperature_of(lambda bodies: self._switches.mask(bodies))
        return self.reports.energies()[4]

    @hook
    def compute_vector(self, i):
        """Kinetic energy of translation and of rotation, temperature of each; collective."""
        return self.reports.energies()[i]

    @hook
    def compute_array(self, i, j):
        """Value j of body i: see `output.global_array`; collective."""
        rows = self.reports.array()
        self.host.lend_array(rows)
        return rows[i, j]

    @hook
    def rows_of_rank(self, words, groupbit, found):
        """What compute rigid/local says of the bodies: see `output.rows_of_rank`; collective.

        Args:
            words: bytes, the values, with a space between.  groupbit: of the compute's group.
            found: (2,) gets the address of the rows, which stay until the next call, and how many
                there are.
        """
        bodies = self.reports.made()
        self._rows = output.rows_of_rank(
            bodies, self.lammps, self.communicator, words.decode().split(), groupbit
        )
        found[0], found[1] = self._rows.ctypes.data, len(self._rows)

    @hook
    def zero_momentum(self):
        """Stop the bodies' translation, between runs; collective."""
        self._zero("v")

    @hook
    def zero_rotation(self):
        """Stop the bodies' rotation, between runs; collective."""
        self._zero("p")

    def _zero(self, name):
        """Stop a motion of the bodies that the next run will have: those of the last one, or those
        that it makes of the atoms."""
        if self._goes_on:
            bodies = self.bodies
        else:
            self.membership = Membership(self.lammps, self.communicator, self.command)
            bodies = self.bodies_of_atoms()
            bodies.bind(self.lammps, self.membership)
            bodies.know_box(self.lammps.box)
        getattr(bodies, name)[:] = 0.0
        atom_v = self.lammps.per_atom("v", columns=3)  # before a first run no cell points there
        step.set_velocities.bind_to(bodies.cells, atom_v=atom_v)()
        self.reports.forget()

    @hook
    def write_restart_file(self, name):
        """LAMMPS writes a restart file: keep bodies of which more is known than their atoms beside
        it; collective."""
        self.reports.write_restart_file(name)

    def table(self):
        """The bodies that are counted on this rank as they are now: see `output.table`."""
        return self.reports.table()
