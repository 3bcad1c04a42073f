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

import numpy as np

from . import kernels, rotor
from .atoms import Lammps, pointer
from .build import build, count
from .command import Command
from .errors import RunError
from .hosts import OwnFix, driven_by_plugin, hook
from .membership import Membership
from .reports import Reports
from .sharing import Alone, World
from .switches import Switches

_READERS = "ave/", "print", "vector", "store/", "STORE/", "halt"  # fixes that act at the end of a step and change no velocity


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
        virial: (6,) this rank's constraint virial (xx yy zz xy xz yz), in the memory of the
            plugin's fix; None with LAMMPS's own fix python/move.
        virial_per_atom: (atoms, 6), the same of each atom, while LAMMPS asks for it.
        late: other fixes that act at the end of a step, and so may change velocities.
        rigid_flag: whether pair styles may ask for the bodies' masses, as those of grains do.
    """

    host = None
    virial = virial_per_atom = None
    _all = weakref.WeakSet()

    def __init__(self, ptr, words):
        self.lammps = Lammps(ptr)
        self.world = World(self.lammps.communicator) if self.lammps.ranks > 1 else Alone()
        self.bodies = None
        self._notes = self._said = None
        self._warned = set()
        self._settled = self._half = self._ran = self._heard = False
        self._mask = self._file = None
        self._known, self.late = {}, []
        self.half_step_velocities = True
        if not driven_by_plugin():
            self.host = OwnFix(self.lammps, self.world)
        self._begin(words)

    @hook
    def _begin(self, words):
        self.command = Command.parse(words)
        self.membership = Membership(self.lammps, self.command)
        self._infile = self.command.infile and self.lammps.text(self.command.infile)
        self.restart_file = self._infile is not None
        self._all.add(self)
        self.reset_dt()
        if self.host:  # LAMMPS's own fix: it takes commands, and so text for its log, only while nothing runs
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
            if other.lammps.handle == handle and other.host.fix_id in (fix_id, None):  # LAMMPS's own fix tells no ID
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
        self._settled = self._half = self._heard = False
        self._known = {}
        self.host.set_bodies(None, None)  # the atoms are not those of the last run
        ours = {mate.host.fix_id for mate in self._mates}
        fixes = [fix for fix in self.host.fixes() if fix.id not in ours]
        self.late = [fix for fix in fixes if fix.end_of_step and not fix.style.startswith(_READERS)]
        self.half_step_velocities = self.host.ghost_velocity or any(fix.between for fix in fixes)
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
        self.host.set_array_rows(round(self.world.total(np.array([self.bodies.sharers.owned.sum()]))[0]))

    def _build(self):
        known = self.bodies and (self.bodies.id, self.bodies.load)
        self.bodies = None  # there may be no room for both
        self.bodies, self._notes = build(self.lammps, self.world, self.membership, self._infile)
        if known and np.array_equal(np.sort(known[0]), np.sort(self.bodies.id)):  # commands like write_data compute no forces
            self.bodies.load[:, np.argsort(self.bodies.id)] = known[1][:, np.argsort(known[0])]
        self._switches = Switches(self.command, self.lammps.dimension, self.world, self.bodies.id, self.bodies.sharers.owned)
        self._box = self.lammps.box

    def _refuse_second_integrator(self, fixes):
        problem = None
        atoms, groups = self.membership.atoms(), self.lammps.groups
        for fix in fixes:
            if fix.time_integrate:
                both = atoms[groups[atoms] & (fix.groupbit & 0xFFFFFFFF) != 0]
                if len(both):
                    problem = (
                        f'atom {self.lammps.tags[both[0]]} of the rigid bodies ("{self.command.text}") is also integrated by '
                        f"fix {fix.id} (style {fix.style}): give that fix a group without the bodies' atoms"
                    )
        for mate in self._mates:
            both = np.intersect1d(mate.membership.atoms(), atoms) if mate is not self else ()
            if len(both):
                problem = (
                    f"atom {self.lammps.tags[both[0]]} is claimed by two fixes: \"{mate.command.text}\" and \"{self.command.text}\". "
                    "An atom can be in one body only: use groups without common atoms"
                )
        self.world.agree(problem)

    @hook
    def setup(self, vflag):
        """The forces of the start are known; LAMMPS is about to print its step."""
        self._gather()
        if self._ran and not self.command.reinit:
            if self._velocities_changed():
                self.host.log("The velocities of the bodies' atoms were changed between runs: without effect, because the bodies go on (reinit no)\n")
            self._set_velocities()
        if vflag:
            self._constraint_virial()
        self._settled = self._ran = True
        if not isinstance(self.host, OwnFix):  # which comes here in the next step only
            self._say(bool(vflag))
            self._write()

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
        self.dt, self.respa_dt = self.lammps.dt, self.lammps.respa_dt

    # ------------------------------------------------------------- one step

    @hook
    def initial_integrate(self, vflag):
        """Half a kick, a whole step of free motion, new positions."""
        self._begin_step(vflag)
        self._kick(self.dt)
        self._move(self.dt)

    @hook
    def post_neighbor(self):
        """LAMMPS has re-neighboured: atoms have new places in its arrays, some on other ranks."""
        self._refuse_new_box()
        self.bodies = self.bodies.follow(self.lammps, self.world, self.membership)
        self._mask = self._switches.mask(self.bodies.id)
        self._x, self._v, self._f = (self.lammps.per_atom(name, columns=3) for name in "xvf")
        if self.bodies.spheres:
            body = np.full(len(self._x), -1, np.int32)
            body[self.bodies.index] = self.bodies.body
            self.host.set_bodies(body, self.bodies.mass)

    @hook
    def final_integrate(self):
        """The new forces, the second half kick, new velocities."""
        self._new_forces()
        self._kick(self.dt)
        self._set_velocities()
        self._half = False
        if self._vflag:
            self._constraint_virial()
        self._write()

    def _begin_step(self, vflag):
        if not self._settled:
            self.post_neighbor()
            self.setup(0)
        else:
            self._take_changed_velocities(self.lammps.step - 1)
        self._vflag, self._known = vflag, {}

    def _kick(self, dt):
        bodies = self.bodies
        kernels.kick(len(bodies), bodies.extended, bodies.v, bodies.q, bodies.p, bodies.mass,
                     bodies.force, bodies.torque, 0.5 * dt * self.lammps.ftm2v)  # fmt: skip

    def _move(self, dt):
        bodies = self.bodies
        kernels.drift(len(bodies), bodies.x, bodies.v, dt)
        if bodies.plane:
            rotor.rotate_in_plane(0, bodies.rotors, bodies.q, bodies.p, bodies.moment, dt)
        elif bodies.rotors:
            rotor.rotate(0, bodies.rotors, bodies.q, bodies.p, bodies.moment, dt, self.command.mrot)
        if bodies.extended > bodies.rotors:
            rotor.rotate_linear(bodies.rotors, bodies.extended, bodies.q, bodies.p, bodies.moment, dt)
        kernels.place(bodies.first, bodies.index, bodies.d, bodies.shift, bodies.x, bodies.q, self._x)
        if self.half_step_velocities:
            self._set_velocities()
        self._half = True

    def _new_forces(self):
        if self.host.atoms_moved():
            self.post_neighbor()
        self._refuse_new_box()
        self._gather()

    def _refuse_new_box(self):
        box = self.lammps.box
        if box is self._box:
            return
        if ((box.h != self._box.h) & (box.periodic & box.periodic[:, None])).any():
            raise RunError(
                f"the periodic box has changed by step {self.lammps.step}: this fix keeps bodies at constant volume, so use it "
                "without fixes that change the box (fix deform, npt, nph, box/relax), or change the box between runs (with reinit yes)",
                everywhere=True,
            )
        self._box = box  # a face that is not periodic may follow the atoms

    def _gather(self):
        bodies = self.bodies
        finite = kernels.gather(bodies.first, bodies.index, bodies.d, bodies.q, self._f, bodies.force, bodies.torque)
        if bodies.spheres:
            kernels.add_torques(bodies.first, bodies.index, self.lammps.per_atom("torque", columns=3), bodies.torque)
        if not finite:
            bad = ~np.isfinite(bodies.load).all(axis=0)
            name = self.membership.name(bodies.id[bad.argmax()])
            raise RunError(
                f"the force on {name} is not finite at step {self.lammps.step}: atoms overlap or the run is unstable. "
                "Minimise or push the start apart, or use a shorter time step"
            )
        bodies.sharers.combine(bodies.load)
        if self._mask is not None:
            bodies.load *= self._mask

    def _set_velocities(self):
        bodies = self.bodies
        v = self._v if self._settled else self.lammps.per_atom("v", columns=3)
        kernels.set_velocities(bodies.first, bodies.index, bodies.d, bodies.v, bodies.q, bodies.p, bodies.moment, v)
        if bodies.spheres:
            kernels.set_spins(bodies.first, bodies.index, bodies.q, bodies.p, bodies.moment, self.lammps.per_atom("omega", columns=3))

    def _velocities_changed(self):
        """Whether the atoms' velocities are not those that the bodies gave them, on any rank; collective."""
        bodies = self.bodies
        expected = np.empty_like(bodies.d)
        kernels.set_velocities(bodies.first, np.arange(len(expected), dtype=np.int32), bodies.d, bodies.v, bodies.q, bodies.p,
                               bodies.moment, expected)  # fmt: skip
        return self.world.any(not np.array_equal(expected, self._v[bodies.index]))

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
                "them over, as rigid motion" + (" (not those of the infile)" if self._infile else "") + "\n"
            )

    @hook
    def post_run(self):
        """A run is over; what comes now, from a script's commands to another run, finds the bodies as their atoms are."""
        if self._settled:
            self._take_changed_velocities(self.lammps.step)
            self._known = {}

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
            self._move(self.respa_dt[0])

    @hook
    def final_integrate_respa(self, ilevel, iloop):
        """A level's new forces, its second half kick, new velocities."""
        self._new_forces()
        self._kick(self.respa_dt[ilevel])
        if ilevel == len(self.respa_dt) - 1 or self.half_step_velocities:
            self._set_velocities()

    @hook
    def end_of_step(self):
        """The step of run_style respa is over, and LAMMPS has added up the forces of its levels."""
        self._half = False
        if self._vflag or self._due():
            self._gather()
        if self._vflag:
            self._constraint_virial()
        self._write()
