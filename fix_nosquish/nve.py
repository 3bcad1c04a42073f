"""NVE: rigid bodies at constant energy, as LAMMPS drives them step by step.

One step of eq. 2.53, with velocity Verlet for the centres of mass:

    initial_integrate   kick (half a step of force and torque), drift, rotate, place
    (LAMMPS)            moves atoms between ranks if it is time to, computes forces
    post_neighbor       follow the atoms, if they were moved
    final_integrate     gather force and torque (shared bodies: one exchange), kick, set velocities

With run_style respa the kicks of each level have that level's forces and time step; the
innermost level moves the bodies.
"""

import weakref
from functools import cached_property
from math import gcd

import numpy as np

from . import compiled, kernels, lookup, packing, spheres, thermo
from .atoms import Lammps, pointer
from .build import build, count
from .command import Command
from .compiled import Cell, F, I
from .errors import RunError
from .hosts import OwnFix, driven_by_plugin, hook
from .kinds import compare
from .membership import Membership
from .reports import Reports
from .sharing import ALONE, World
from .switches import Switches

_BLIND = (
    "nve",
    "rigid",
    "shake",
    "rattle",
)  # fixes that read no velocities but those of their own atoms
_READERS = (
    "ave/",
    "print",
    "vector",
    "store/",
    "STORE/",
    "halt",
)  # fixes that act at the end of a step and change no velocity


class Loops:
    """The loops of a step, each bound when it is first used to the cells of the bodies, LAMMPS's arrays and the time step.

    Args:
        advance: the integrator's `kernels.advance`.
        cells: `Bodies.cells` and those of `Lammps`, a dictionary.
        mrot: number of inner steps of the rotation.

    Attributes:
        cells: all that these loops take: beside the above dt, the time step; dtf, what takes a force to half a step's momentum;
            kicks, how many of these begin a step; and gathers, whether a `step` KEEPS force and torque, for who asks between its end and the next.
    """

    def __init__(self, advance, cells, mrot):
        self._advance = advance
        self.cells = cells | {
            "dt": Cell(F),
            "dtf": Cell(F),
            "kicks": Cell(I),
            "gathers": Cell(I),
            "mrot": Cell(I, mrot),
        }

    @cached_property
    def advance(self):
        return self._advance.bind_to(self.cells, gathers=False, part=kernels.ALL)

    @cached_property
    def kick_and_advance(self):
        return self._advance.bind_to(self.cells, gathers=False, kicks=2, part=kernels.ALL)

    @cached_property
    def step(self):
        """`kick_and_advance` that also gathers, where force and torque of a body that is whole here are those that its atoms give."""
        return self._step(kernels.ALL)

    @cached_property
    def step_of_parts(self):
        """`step` of bodies that are whole here, which need no other rank; then of the others."""
        return [self._step(part) for part in (kernels.WHOLE, kernels.DIVIDED)]

    def _step(self, part):
        return self._advance.bind_to(self.cells, kicks=2, part=part)

    @cached_property
    def gather(self):
        return kernels.gather.bind_to(self.cells, every=True)

    @cached_property
    def gather_shared(self):
        return kernels.gather.bind_to(self.cells, every=False)

    @cached_property
    def kick(self):
        return kernels.kick.bind_to(self.cells)

    @cached_property
    def set_velocities(self):
        return kernels.set_velocities.bind_to(self.cells)


class NVE(Reports):
    """Rigid bodies at constant energy: fix python/move "fix_nosquish.NVE GROUP BODYSTYLE ...".

    LAMMPS calls the methods; the README says what the words of the fix line mean.

    Args:
        ptr: the pointer to LAMMPS that fix python/move hands over.
        words: the text of the fix line from the class on.
    Raises:
        RunError: with a message for the user, from any method.

    Attributes:
        bodies: the `Bodies`, from the first use of the fix on.
        host: what calls this object; set by the plugin, see `hosts`.
        follows_atoms: that the plugin is to keep with each atom where it was (see `host.note`).
        carries: how many numbers go with an atom to another rank (see `host.carry`).
        virial: (6,) this rank's constraint virial (xx yy zz xy xz yz), in the memory of the
            plugin's fix; None with LAMMPS's own fix python/move.
        virial_per_atom: (atoms, 6), the same of each atom, while LAMMPS asks for it.
        late: other fixes that act at the end of a step, and so may change velocities.
        rigid_flag: whether pair styles may ask for the bodies' masses, as those of grains do.

    A class derived from this one can have another
        advance: loop of a step's first half, with the arguments of `kernels.advance`.
        more_rows: number of rows of the bodies' state that it has for itself, behind those that `kernels` names; they go where the bodies go.
        method, splits: what the log calls it, and whether it has use for the keywords mrot and order.
    """

    host = None
    follows_atoms = True
    carries = property(lambda self: kernels.OF_BODY + kernels.ROWS + self.more_rows)
    virial = virial_per_atom = None
    rigid_flag = False
    advance, more_rows, method, splits = kernels.advance, 0, "NO_SQUISH", True
    _all = weakref.WeakSet()

    def __init__(self, ptr, words):
        self.lammps = Lammps(ptr)
        self.world = World(self.lammps.communicator) if self.lammps.ranks > 1 else ALONE
        self.bodies = None
        self._notes = self._said = self._loops = None
        self._warned = set()
        self._settled = self._half = self._ran = self._over = self._heard = self._velocities_set = (
            False
        )
        self._lost = False  # whether the bodies of the last run are gone, because the next one could not make them anew
        self._mask = self._file = None
        self._known, self.late = {}, []
        self.half_step_velocities, self.velocities_every = True, (1,)
        if not driven_by_plugin():
            self.host = OwnFix(self.lammps, self.world)
        self._begin(words)

    @hook
    def _begin(self, words):
        more = [packing.__name__] if self.world.size > 1 else []
        if self.host:
            more.append(lookup.__name__)
        compiled.load(
            self.world, kernels.__name__, *(kind.__module__ for kind in type(self).__mro__), *more
        )
        self.command = Command.parse(words)
        self.membership = Membership(self.lammps, self.world, self.command)
        self._infile = self.command.infile and self.lammps.text(self.command.infile)
        self.restart_file = self._infile is not None
        self._all.add(self)
        self.reset_dt()
        if (
            self.host
        ):  # LAMMPS's own fix: it takes commands, and so text for its log, only while nothing runs
            self._build()
            self._say(False)
        else:
            self.array_rows = count(self.lammps, self.world, self.membership)
            self.rigid_flag = self.lammps.finite()[0] is not None

    @classmethod
    def of_fix(cls, lmp, fix_id):
        """The integrator of a LAMMPS that the fix of this ID drives."""
        handle = pointer(getattr(lmp, "lmp", lmp))
        for other in cls._all:
            if other.lammps.handle == handle and other.host.fix_id in (
                fix_id,
                None,
            ):  # LAMMPS's own fix tells no ID
                return other
        raise RunError(f"there is no fix {fix_id} of fix_nosquish", everywhere=True)

    @property
    def _mates(self):
        """All integrators of this LAMMPS, this one among them."""
        return [other for other in self._all if other.lammps.handle == self.lammps.handle]

    # ------------------------------------------------------------- before the first step

    @hook
    def init(self):
        """A run begins: make the bodies of the atoms, leave the atoms rigid motion only."""
        self._settled = self._half = self._heard = self._over = False
        self.host.call_always()
        self.host.waiting = False
        self._known = {}
        self.host.set_bodies(None, None)  # the atoms are not those of the last run
        self.membership = Membership(
            self.lammps, self.world, self.command
        )  # nor are the groups: deleted ones leave their bits to others
        ours = {mate.host.fix_id for mate in self._mates}
        fixes = [fix for fix in self.host.fixes() if fix.id not in ours]
        self.late = [fix for fix in fixes if fix.end_of_step and not fix.style.startswith(_READERS)]
        self.half_step_velocities = self.host.ghost_velocity or any(fix.between for fix in fixes)
        # of steps without output, those at whose end another fix may read the atoms' velocities
        unknown = isinstance(self.host, OwnFix)
        each = unknown or any(
            fix.final_integrate and not fix.style.startswith(_BLIND) for fix in fixes
        )
        self.velocities_every = (
            (1,) if each else tuple({fix.nevery for fix in fixes if fix.end_of_step})
        )
        self._box_may_change = unknown or any(fix.box_change for fix in fixes)
        if self.command.reinit or not self._ran:
            self._build()
            self._set_velocities()
        self._refuse_second_integrator(fixes)
        self.reset_dt()
        if self.command.output and not self._file:
            self._file = self._open()
        if isinstance(self.host, OwnFix):
            self.host.begin_run(self._virial_of_all)
            self._say(self.host.virial_fix is not None)
        self.host.set_array_rows(
            round(self.world.total(np.array([self.bodies.sharers.owned.sum()]))[0])
        )

    def _build(self):
        known = self.bodies and (self.bodies.id, self.bodies.load.copy())
        former = self._former()
        if self.host and self.bodies is not None:
            self.host.carry(None, None)
        self.bodies = self._loops = None  # there may be no room for both
        self._lost = former is not None
        self.bodies, self._notes = build(
            self.lammps, self.world, self.membership, self._infile, self.more_rows, former
        )
        self._lost = False
        if kept := self._notes.pop("kept"):
            self.lammps.per_atom("x", columns=3)[kept.atoms] += kept.shift
            self.host.log(kept.text)
        if known and np.array_equal(
            np.sort(known[0]), np.sort(self.bodies.id)
        ):  # commands like write_data compute no forces
            self.bodies.load[:, np.argsort(self.bodies.id)] = known[1][:, np.argsort(known[0])]
        self.bodies.bind(self.lammps, self.membership)
        self._loops = self._bind()
        self._set_time_step()
        self.host.carry(self.lammps, self.bodies)
        self.host.note()
        self._switches = Switches(
            self.command,
            self.lammps.dimension,
            self.world,
            self.bodies.id,
            self.bodies.sharers.owned,
        )
        self._box = self.lammps.box
        if self._notes.pop("new"):
            self._notes["warnings"] += compare(
                self.bodies, self.lammps, self.world, self.membership
            )

    def _former(self):
        """What the atoms were in the bodies of the last run, None if that says nothing of their shape; collective.

        An atom that was in a body stays in it; a variable is asked for the others only.  (LAMMPS's own fix cannot know which these are.)
        """
        if self._lost:
            raise RunError(
                "the bodies of the last run are gone, because this one could not begin: unfix this fix and define it again",
                everywhere=True,
            )
        if self.bodies is None:
            return None
        self.host.point(self.lammps.cells)
        former = self.bodies.of_atoms(self.lammps, not isinstance(self.host, OwnFix))
        if self.membership.variable and former.followed:
            self.membership.before = former.id, former.known
        return former if self._ran and not self._infile else None

    def _refuse_second_integrator(self, fixes):
        problem = None
        atoms, groups = self.membership.atoms(), self.lammps.groups
        ids = [[self.command.group]] + [self.command.arguments] * (self.command.style == "group")
        for fix in fixes:
            if fix.time_integrate:
                both = atoms[groups[atoms] & (fix.groupbit & 0xFFFFFFFF) != 0]
                if len(both):
                    problem = (
                        f'atom {self.lammps.tags[both[0]]} of the rigid bodies ("{self.command.text}") is also integrated by '
                        f"fix {fix.id} (style {fix.style}): give that fix a group without the bodies' atoms"
                    )
            elif all(
                any(self.host.removed_freedom(fix.id, group) for group in groups) for groups in ids
            ):
                problem = (
                    f"fix {fix.id} (style {fix.style}) constrains atoms of the rigid bodies, which fix {self.host.fix_id} "
                    f'("{self.command.text}") holds rigid: unfix it, or give it a group without the bodies\' atoms'
                )
        for mate in self._mates:
            both = np.intersect1d(mate.membership.atoms(), atoms) if mate is not self else ()
            if len(both):
                problem = (
                    f'atom {self.lammps.tags[both[0]]} is claimed by two fixes: "{mate.command.text}" and "{self.command.text}". '
                    "An atom can be in one body only: use groups without common atoms"
                )
        self.world.agree(problem)

    @hook
    def setup(self, vflag):
        """The forces of the start are known; LAMMPS is about to print its step."""
        self._gather()
        self._known = {}
        if self._ran and not self.command.reinit:
            self._say_ignored("reinit no")
            self._set_velocities()
        if vflag:
            self._constraint_virial()
        self._settled, self._ran, self._over = True, True, False
        self._leave_to_host()
        if not isinstance(self.host, OwnFix):  # which comes here in the next step only
            self._say(bool(vflag))
            self._write()
        cause, remedy, spacing = thermo.forces_at_start(self)
        self.bodies.start = self.lammps.step, cause, remedy, spacing
        if cause:
            self.host.log(f"WARNING: {cause}: {remedy}\n")

    @hook
    def min_setup(self, vflag):
        """A minimisation begins: it would move the atoms one by one."""
        raise RunError(
            "a minimisation would tear the rigid bodies apart: minimise before the fix is defined, or unfix it first",
            everywhere=True,
        )

    @hook
    def reset_dt(self):
        """The time step may have changed."""
        if self._settled:
            self._catch_up()
        self.dt, self.respa_dt = self.lammps.dt, self.lammps.respa_dt
        self._set_time_step()
        if self._settled:
            self._leave_to_host()

    # ------------------------------------------------------------- one step

    @hook
    def initial_integrate(self, vflag):
        """Half a kick, a whole step of free motion, new positions."""
        self._begin_step(vflag)
        if not self.host.waiting:
            self._loops.advance()
        else:
            self._gather()
            self._loops.kick_and_advance()
        self._moved()

    @hook
    def post_neighbor(self):
        """LAMMPS has re-neighboured: atoms have new places in its arrays, some on other ranks."""
        self._refuse_new_box(self.lammps.box.periodic)
        bodies = self.bodies
        bodies.follow(self.lammps, self.membership, self.host)
        self._mask = self._switches.mask(bodies)
        self._direct = self._mask is None and not bodies.spheres
        if self.rigid_flag:
            body = np.full(len(self.lammps.groups), -1, np.int32)
            body[bodies.index] = bodies.body
            self.host.set_bodies(body, bodies.mass)
        if self._settled:
            self._leave_to_host()

    @hook
    def final_integrate(self):
        """The new forces, the second half kick, new velocities.

        The plugin calls it on steps that something looks at; what others leave is done in the next step.
        """
        self._follow()
        self._gather()
        self._loops.kick()
        self._half, self._known = False, {}
        step = self.lammps.step
        if step == self.host.next_output or any(
            step % every == 0 for every in self.velocities_every
        ):
            self._set_velocities()
        if self._vflag:
            self._constraint_virial()
        self._vflag = 0
        self._write()

    def _catch_up(self):
        """Do what the last step has left to the next one."""
        if self.host.waiting:
            self.host.waiting = self._half = self._velocities_set = False
            self._known = {}
            self._gather()
            self._loops.kick()

    def _begin_step(self, vflag):
        if not self._settled:
            self.post_neighbor()
            self.setup(0)
        elif self._over:  # what changes velocities now is a script
            self._refuse_new_box(self.lammps.box.periodic)
            self.host.point(self.lammps.cells)
            self.bodies.refuse_moved_atoms(self.lammps)
            self._over = False
            self._say_ignored("pre no")
        elif self.late:
            self._take_changed_velocities(self.lammps.step - 1)
        self._vflag, self._known = vflag, {}

    def _bind(self):
        """The loops of a step for these bodies."""
        return Loops(self.advance, self.bodies.cells | self.lammps.cells, self.command.mrot)

    def _set_time_step(self):
        """Have the loops use the time step as it is now."""
        if self._loops:
            cells, respa = self._loops.cells, self.respa_dt is not None
            cells["dt"].set(self.respa_dt[0] if respa else self.dt)
            cells["dtf"].set(0.5 * self.dt * self.lammps.ftm2v)
            cells["kicks"].set(not respa)  # there each level kicks by itself

    def _leave_to_host(self):
        """Have the plugin do itself what needs no Python; not what a class derived from this one does otherwise."""
        hooks = "initial_integrate", "final_integrate", "post_neighbor"
        if self.respa_dt is not None or any(
            getattr(type(self), name) is not getattr(NVE, name) for name in hooks
        ):
            return
        self._loops.cells["gathers"].set(
            kernels.KEEPS if self.half_step_velocities else kernels.GATHERS
        )
        every = gcd(*self.velocities_every, *(self.command.output[:1] if self._file else ()))
        step = following = None
        if not self._box_may_change and self._direct:
            loops, sharers = self._loops, self.bodies.sharers
            step = [loops.step]
            if self.world.size > 1:  # messages are under way while the bodies that need none move
                whole, shared = loops.step_of_parts
                step = [loops.gather_shared, *sharers.giving, whole, *sharers.taking, shared]
            if self.half_step_velocities:
                step.append(loops.set_velocities)
            following = None if self.rigid_flag else self.bodies.following()
        self.host.go_alone(every, step, following)

    def _moved(self):
        self._velocities_set, self._half, self.host.waiting = False, True, False
        if self.half_step_velocities:
            self._set_velocities()

    def _kick(self, dt):
        self._loops.cells["dtf"].set(0.5 * dt * self.lammps.ftm2v)
        self._loops.kick()
        self._set_time_step()

    def _follow(self):
        if self.host.atoms_moved():
            self.post_neighbor()
        if self._box_may_change:
            self._refuse_new_box(True)

    def _refuse_new_box(self, held):
        """End the run if one of the box vectors that are held, (3,) bool, has changed."""
        box = self.lammps.box
        if box is self._box:
            return
        if ((box.h != self._box.h) & held).any():
            raise RunError(
                f"the box has changed by step {self.lammps.step}, but in a run bodies move at constant volume: use this fix "
                "without fixes that change the box (fix deform, npt, nph, box/relax). The box may change between runs: bodies keep "
                "their shape when the next run makes them anew, with reinit yes and without infile or 'pre no'",
                everywhere=True,
            )
        self._box = box

    def _gather(self):
        bodies = self.bodies
        wrong = self._loops.gather()
        if bodies.spheres:
            spheres.add_torques(
                bodies.body, bodies.index, self.lammps.per_atom("torque", columns=3), bodies.load
            )
        if wrong:
            self._blame_forces()
        bodies.sharers.add()
        if self._mask is not None:
            np.multiply(bodies.load, self._mask, out=bodies.load)

    def _blame_forces(self):
        bodies, step = self.bodies, self.lammps.step - self.host.waiting
        bad = (~np.isfinite(bodies.load).all(axis=0)).argmax()
        cause, remedy = bodies.instability(bad, self.lammps)
        if not self._settled:
            cause, remedy = (
                "atoms overlap at the start",
                "minimise or move them apart before the fix line",
            )
        raise RunError(
            f"{cause or 'the run is unstable'}, and the force on {self.membership.name(bodies.id[bad])} is not finite at step {step}: "
            + (
                remedy
                or "use a shorter time step or a better start, and look for what else acts on the body"
            )
        )

    def _set_velocities(self):
        bodies, self._velocities_set = self.bodies, not self._half
        if self._settled:
            self._loops.set_velocities()
        else:
            kernels.set_velocities(
                bodies.state, *bodies.atoms, self.lammps.per_atom("v", columns=3), bodies.scratch
            )
        if bodies.spheres:
            spheres.set_spins(
                bodies.state,
                *bodies.atoms[:3],
                self.lammps.per_atom("omega", columns=3),
                bodies.scratch,
            )

    def _velocities_changed(self):
        """Whether the atoms' velocities are not those that the bodies gave them, on any rank; collective."""
        bodies = self.bodies
        n = len(bodies.index)
        expected = np.empty((n, 3))
        kernels.set_velocities(
            bodies.state,
            bodies.blocks,
            bodies.rounds,
            np.arange(n, dtype=np.int32),
            bodies.d,
            expected,
            bodies.scratch,
        )
        return self.world.any(
            not np.array_equal(expected, self.lammps.per_atom("v", columns=3)[bodies.index])
        )

    def _say_ignored(self, why):
        if self._velocities_changed():
            self.host.log(
                f"The velocities of the bodies' atoms were changed between runs: without effect, because the bodies go on ({why})\n"
            )

    def _take_changed_velocities(self, step):
        """If a fix has changed the atoms' velocities at the end of this step, have the bodies move with them; collective."""
        due = [fix.id for fix in self.late if step % fix.nevery == 0]
        if not due or not self._velocities_changed():
            return
        bodies = self.bodies
        kept = np.flatnonzero(np.isin(bodies.id, self._notes["given"]))
        bodies.take_velocities(self.lammps, (kept, bodies.momenta()[:, kept]))
        self._set_velocities()
        self._known = {}
        if not self._heard:
            self._heard = True
            self.host.log(
                f"The velocities of the bodies' atoms were changed at the end of step {step} (by fix {' or '.join(due)}): the bodies take "
                "them over, as rigid motion"
                + (" (not those of the infile)" if self._infile else "")
                + "\n"
            )

    @hook
    def post_run(self):
        """A run is over; what comes now, from a script's commands to another run, finds the bodies as their atoms are."""
        if self._settled:
            self._catch_up()
            if not self._velocities_set:
                self._set_velocities()
            self._take_changed_velocities(self.lammps.step)
            self._known, self._over = {}, True

    # ------------------------------------------------------------- one step of run_style respa

    @hook
    def initial_integrate_respa(self, vflag, ilevel, iloop):
        """Half a kick of a level; the innermost one moves the bodies."""
        if ilevel == len(self.respa_dt) - 1:
            self._begin_step(vflag)
        elif self.host.atoms_moved():
            self.post_neighbor()
        self._gather()
        self._kick(self.respa_dt[ilevel])
        if ilevel == 0:
            self._loops.advance()
            self._moved()

    @hook
    def final_integrate_respa(self, ilevel, iloop):
        """A level's new forces, its second half kick, new velocities."""
        self._follow()
        self._gather()
        self._kick(self.respa_dt[ilevel])
        self._known = {}
        if ilevel == len(self.respa_dt) - 1 or self.half_step_velocities:
            self._set_velocities()

    @hook
    def end_of_step(self):
        """The step of run_style respa is over, and LAMMPS has added up the forces of its levels."""
        self._half, self._known = False, {}
        if self._vflag or self._due():
            self._gather()
        if self._vflag:
            self._constraint_virial()
        self._write()
