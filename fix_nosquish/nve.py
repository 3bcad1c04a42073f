"""NVE: rigid bodies at constant energy, as LAMMPS drives them step by step.

One step of eq. 2.53, with velocity Verlet for the centres of mass:

    initial_integrate   kick (half a step of force and torque), drift, rotate, place
    (LAMMPS)            moves atoms between ranks if it is time to, computes forces
    post_neighbor       follow the atoms, if they were moved
    final_integrate     gather force and torque (shared bodies: one exchange), kick, set velocities
"""

import weakref

import numpy as np

from . import kernels, rotor, thermo
from .atoms import Lammps
from .bodies import Membership, build
from .command import Command
from .errors import RunError
from .hosts import OwnFix, driven_by_plugin, hook
from .sharing import Alone, World


class NVE:
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
    """

    host = None
    virial = None
    _all = weakref.WeakSet()

    def __init__(self, ptr, words):
        self.lammps = Lammps(ptr)
        self.world = World(self.lammps.communicator) if self.lammps.ranks > 1 else Alone()
        self.bodies = None
        self._notes = self._said = None
        self._settled = self._half = False
        self.half_step_velocities = True
        if not driven_by_plugin():
            self.host = OwnFix(self.lammps, self.world)
        self._begin(words)

    @hook
    def _begin(self, words):
        self.command = Command.parse(words)
        self.membership = Membership(self.lammps, self.command)
        self._all.add(self)
        if self.host:  # LAMMPS's own fix: it takes commands, and so text for its log, only while nothing runs
            self._build()
            self._say(False)

    @property
    def _mates(self):
        """All integrators of this LAMMPS, this one among them."""
        return [other for other in self._all if other.lammps.handle == self.lammps.handle]

    # ------------------------------------------------------------- before the first step

    @hook
    def init(self):
        """A run begins: make the bodies of the atoms, leave the atoms rigid motion only."""
        self._settled = self._half = False
        self._build()
        self._refuse_second_integrator()
        self.half_step_velocities = self.host.ghost_velocity or any(fix.between for fix in self.host.fixes())
        self.reset_dt()
        self._set_velocities()
        if isinstance(self.host, OwnFix):
            self.host.begin_run(self._virial_of_all)
            self._say(self.host.virial_fix is not None)

    def _build(self):
        self.bodies, self._notes = build(self.lammps, self.world, self.membership)
        self._box = self.lammps.box

    def _refuse_second_integrator(self):
        problem = None
        groups = self.lammps.groups
        ours = {mate.host.fix_id for mate in self._mates}
        for fix in self.host.fixes():
            if fix.time_integrate and fix.id not in ours:
                both = groups[self.bodies.index] & (fix.groupbit & 0xFFFFFFFF) != 0
                if both.any():
                    problem = (
                        f"atom {self.bodies.tag[both.argmax()]} of {self.membership.name(self.bodies.id[self.bodies.body[both.argmax()]])} "
                        f"is also integrated by fix {fix.id} (style {fix.style}): give that fix a group without the bodies' atoms"
                    )
        for mate in self._mates:
            both = np.intersect1d(mate.membership.atoms(), self.bodies.index) if mate is not self else ()
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
        if self.virial is not None and vflag:
            self._constraint_virial(self.virial, self.bodies.p)
        self._settled = True
        if not isinstance(self.host, OwnFix):
            self._say(bool(vflag))

    def _say(self, virial):
        """Log what the bodies are, if that has changed, and what was taken from the atoms' velocities."""
        lines, removed = thermo.summary(self, self._notes, virial)
        said, self._said = self._said, lines[:4]
        if not said or said[:3] != lines[:3]:
            advice = self.host.advice(removed) if isinstance(self.host, OwnFix) else ()
            self.host.log("\n".join([*lines, *advice, ""]))
        elif said[3] != lines[3] and self._notes["removed"] > 1e-9 * self._notes["kinetic"]:
            self.host.log(lines[3] + "\n")

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
        self.dt = self.lammps.dt
        self._dtf = 0.5 * self.dt * self.lammps.ftm2v

    # ------------------------------------------------------------- one step

    @hook
    def initial_integrate(self, vflag):
        """Half a kick, a whole step of free motion, new positions."""
        if not self._settled:
            self.post_neighbor()
            self.setup(0)
        self._vflag = vflag
        bodies = self.bodies
        self._kick(bodies.v, bodies.p)
        kernels.drift(len(bodies), bodies.x, bodies.v, self.dt)
        if bodies.rotors:
            rotor.rotate(0, bodies.rotors, bodies.q, bodies.p, bodies.moment, self.dt, self.command.mrot)
        if bodies.extended > bodies.rotors:
            rotor.rotate_linear(bodies.rotors, bodies.extended, bodies.q, bodies.p, bodies.moment, self.dt)
        kernels.place(bodies.first, bodies.index, bodies.d, bodies.shift, bodies.x, bodies.q, self._x)
        if self.half_step_velocities:
            self._set_velocities()
        self._half = True

    @hook
    def post_neighbor(self):
        """LAMMPS has re-neighboured: atoms have new places in its arrays, some on other ranks."""
        self._refuse_new_box()
        self.bodies = self.bodies.follow(self.lammps, self.world, self.membership)
        self._x, self._v, self._f = (self.lammps.per_atom(name, columns=3) for name in "xvf")

    @hook
    def final_integrate(self):
        """The new forces, the second half kick, new velocities."""
        if isinstance(self.host, OwnFix) and self.host.atoms_moved():
            self.post_neighbor()
        self._refuse_new_box()
        self._gather()
        self._kick(self.bodies.v, self.bodies.p)
        self._set_velocities()
        self._half = False
        if self.virial is not None and self._vflag:
            self._constraint_virial(self.virial, self.bodies.p)

    def _refuse_new_box(self):
        box = self.lammps.box
        if box is self._box:
            return
        if ((box.h != self._box.h) & (box.periodic & box.periodic[:, None])).any():
            raise RunError(
                f"the periodic box has changed by step {self.lammps.step}: this fix keeps bodies at constant volume, so use it "
                "without fixes that change the box (fix deform, npt, nph, box/relax), or change the box between runs",
                everywhere=True,
            )
        self._box = box  # a face that is not periodic may follow the atoms

    def _kick(self, v, p):
        bodies = self.bodies
        kernels.kick(0, len(bodies), bodies.extended, v, bodies.q, p, bodies.mass,
                     bodies.force, bodies.torque, self._dtf)  # fmt: skip

    def _gather(self):
        bodies = self.bodies
        finite = kernels.gather(bodies.first, bodies.index, bodies.d, bodies.q, self._f, bodies.force, bodies.torque)
        if not finite:
            bad = ~np.isfinite(bodies.load).all(axis=0)
            name = self.membership.name(bodies.id[bad.argmax()])
            raise RunError(
                f"the force on {name} is not finite at step {self.lammps.step}: atoms overlap or the run is unstable. "
                "Minimise or push the start apart, or use a shorter time step"
            )
        bodies.sharers.combine(bodies.load)

    def _set_velocities(self):
        bodies = self.bodies
        v = self._v if self._settled else self.lammps.per_atom("v", columns=3)
        kernels.set_velocities(bodies.first, bodies.index, bodies.d, bodies.v, bodies.q, bodies.p, bodies.moment, v)

    # ------------------------------------------------------------- what LAMMPS reports

    def _constraint_virial(self, virial, p):
        bodies = self.bodies
        kernels.constraint_virial(bodies.first, bodies.index, bodies.d, bodies.q, p, bodies.moment, bodies.torque,
                                  bodies.sharers.owned, self.lammps.ftm2v, self._f, virial)  # fmt: skip

    def _virial_of_all(self):
        """The virial of all bodies on all ranks, while LAMMPS is between its forces and final_integrate."""
        virial = np.zeros(6)
        for mate in self._mates:
            mate._add_virial(virial)
        return self.world.total(virial)

    def _add_virial(self, virial):
        if self._half and not self._vflag:
            return
        if self.host.atoms_moved() or not self._half:
            self.post_neighbor()
        self._gather()
        bodies = self.bodies
        p = bodies.p.copy()
        if self._half:
            self._kick(bodies.v.copy(), p)
        self._constraint_virial(virial, p)

    @hook
    def dof(self, group):
        """Degrees of freedom that the bodies take from a group of atoms; collective.

        Args:
            group: LAMMPS's number of the group.
        """
        # outside of runs atoms may be other ones and elsewhere; the bodies of the last run stay as they are
        bodies = self.bodies if self.lammps.running and self.bodies is not None else build(self.lammps, self.world, self.membership)[0]
        inside = self.lammps.groups[bodies.index] & (1 << group) != 0
        return thermo.removed_freedom(bodies, self.world, inside, self.lammps.dimension)
