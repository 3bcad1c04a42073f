"""Rigid bodies: their state, and how they follow LAMMPS's atoms.

The state of a body is its centre of mass x, velocity v, quaternion q and conjugate
quaternion momentum p, with its mass and principal moments.  Every rank keeps the
bodies of which it owns an atom, and of their atoms only its own.  `build` makes them.
"""

import math
from functools import cached_property

import numpy as np

from . import kernels

SPHERE = 0.4  # moment of inertia of a solid sphere of unit mass and radius
_NONE = np.empty(0, np.int64)
_MOVED = 1e-9  # positions further off the rigid body than this part of the box were changed by something else

# rows of a body's state
ROWS = kernels.ROWS
MASS, MOMENT, X, V, Q, P, LOAD, NATOMS, IMAGE, HOME, ID = (slice(row, row + rows) for row, rows in (
    (kernels.MASS, 1), (kernels.MOMENT, 3), (kernels.X, 3), (kernels.V, 3), (kernels.Q, 4), (kernels.P, 4),
    (kernels.FORCE, 6), (kernels.NATOMS, 1), (kernels.IMAGE, 3), (kernels.HOME, 1), (kernels.ID, 1)))  # fmt: skip


class Bodies:
    """The bodies of which this rank owns atoms, those of one kind side by side.

    Attributes:
        id: (n,) body IDs.
        rotors, extended: bodies [0, rotors) have three moments (in a plane: a moment about axis 3),
            [rotors, extended) are linear, [extended, n) are points.
        mass (n,), moment (3, n), x, v, image (3, n), q, p (4, n), natoms (n,): views of `state`;
            x is kept in the box, which image counts.  x, v and the torque are in the space frame,
            moments in the principal frame, from the largest to the smallest (with order 123 the other
            way round; in a plane the third is about z).
        force, torque: (3, n), views of `load`, (6, n) of `state`, which is what the sharing ranks exchange.
        atoms: (blocks, rounds, index, d), this rank's atoms as the loops take them; see `kernels`.
        blocks, rounds, index, d: these by themselves.
        body: (m,) the body of each of these atoms.
        tag: (m,) their IDs.
        atoms_here: (n,) how many atoms of each body this rank owns.
        home: (n,) the lowest rank that holds the body.
        away, shift, aways: those of them in another periodic image than their body; see `kernels.settle`.
        sharers: the `Sharers` of these bodies.
        plane: whether they turn in the xy plane only, about their axis 3.
        spheres: whether some atom of a body, on any rank, is a sphere, with a torque of its own.

    Args:
        state (rows, k), body (j,), d (4, j): bodies and atoms of before, or new ones in any order.
        here: (m,) int32, indices of this rank's atoms in LAMMPS's arrays, ascending.
        place: (m,) int32, each of these atoms' place among those j, None if they are the same; of one from another rank, -1 minus
            its row of arrived.
        arrived: (i, OF_BODY + rows) what another rank told of such atoms.
        shared: (l,) places of the bodies that other ranks had too.
    """

    def __init__(self, state, body, d, here, plane, spheres, place=None, arrived=None, shared=_NONE):
        rows, m = len(state), len(here)
        if place is None:
            place, arrived = np.arange(m, dtype=np.int32), np.empty((0, kernels.OF_BODY + rows))
        n, k = state.shape[1] + len(arrived), len(arrived)
        number, order, self.atoms_here = (np.empty(n, np.int64) for _ in range(3))
        owner, source, self.body = (np.empty(m, np.int64) for _ in range(3))
        table, first = np.empty(1 << (2 * (len(shared) + k)).bit_length(), np.int64), np.empty(k, np.int64)
        next_, buckets, found = np.empty((n, 2), np.int64), np.empty(kernels.BUCKETS, np.int64), np.empty(kernels.GROUPS + 2, np.int64)
        blocks, rounds, self.index = np.empty((n + 1, 3), np.int32), np.empty(m + 1, np.int32), np.empty(m, np.int32)
        kernels.arrange(here, place, body, state, arrived, shared, table, owner, first, number, order, self.atoms_here, next_, buckets,
                        blocks, rounds, self.index, source, self.body, found)  # fmt: skip
        _, self.rotors, _, self.extended, _, size, n_blocks, n_rounds = found.tolist()
        self.atoms_here = self.atoms_here[:size]
        self.blocks, self.rounds = blocks[: n_blocks + 1], rounds[: n_rounds + 1]
        self.state, self.d = _aligned(rows, size), _aligned(kernels.OF_BODY, m)
        kernels.carry_over(order, first, source, place, arrived, state, d, self.state, self.d)
        self.atoms = self.blocks, self.rounds, self.index, self.d
        self.mass, self.natoms, self.home = self.state[kernels.MASS], self.state[kernels.NATOMS], self.state[kernels.HOME]
        self.moment, self.plane, self.spheres = self.state[MOMENT], plane, spheres
        self.x, self.v, self.q, self.p, self.image, self.load = (self.state[rows] for rows in (X, V, Q, P, IMAGE, LOAD))
        self.force, self.torque = self.load[:3], self.load[3:]
        self.away, self.shift, self.aways = np.empty(m, np.int32), np.empty((m, 3)), np.zeros(1, np.int64)
        self.scratch = _aligned(kernels.SCRATCH)

    @cached_property
    def id(self):
        return self.state[kernels.ID].astype(np.int64)

    @cached_property
    def tag(self):
        return self.d[3].astype(np.int64)

    def __len__(self):
        return self.state.shape[1]

    def follow(self, lammps, world, membership, host):
        """The same bodies after LAMMPS has moved atoms between ranks and in its arrays; collective.

        Returns:
            Bodies; these ones, if none of their atoms has moved in LAMMPS's arrays.
        Raises:
            RunError: if atoms are missing or new, or stand where this fix has not put them.
        """
        locate, origins, here, place, gained, lost, found = self._locate(lammps, world, membership, host)
        result, problem = self, None
        moved = locate()
        changed = world.any(moved)
        if changed:
            count, arrivals, gone, came = found.tolist()
            arrived, missing = world.fetch(gained[:arrivals], lost[:gone], self._rows)
            if came or len(missing):
                problem = _atoms_changed(lammps, membership, self, missing, origins)
            if moved:
                result = Bodies(self.state, self.body, self.d, here[:count], self.plane, self.spheres, place[:count], arrived, self.sharers.bodies)
            result.find_sharers(world)
        result.settle(lammps, world, problem)
        if changed:
            host.note(result.index)  # after all that may refuse: else places would be those of a list that nobody has
        return result

    def _rows(self, places):
        """What another rank needs to know of atoms, (k, OF_BODY + the state's rows)."""
        rows = np.empty((len(places), kernels.OF_BODY + len(self.state)))
        kernels.describe(places, self.body, self.d, self.state, rows)
        return rows

    def find_sharers(self, world):
        """Find who shares the bodies; collective."""
        places = np.flatnonzero(self.atoms_here < self.natoms)  # the others are whole here
        home, ids = self.state[[[kernels.HOME], [kernels.ID]], places].astype(np.int64)
        self.sharers = world.sharers(len(self), places, ids, home)
        self.home[:] = self.sharers.home

    def settle(self, lammps, world, problem=None):
        """Find which periodic image of each atom LAMMPS holds, and end the run for this problem, if there is one; collective."""
        settle, off = self._settle(lammps)
        wrong = settle()
        if wrong and not problem:
            far, atom = off
            problem = (
                f"atom {self.tag[int(atom)]} is {far:.3g} away from where its rigid body has it: something else moved "
                "it. Let no other fix integrate atoms of the bodies, and change positions between runs only, "
                "with 'run N pre yes' after it, and not with reinit no or infile, which keep the bodies of the last run"
            )
        world.agree(problem)

    def stay(self, lammps, world, membership, host):
        """`follow` as passes, for as long as no atom of the bodies moves in LAMMPS's arrays and these and the box stay."""
        return [self._locate(lammps, world, membership, host)[0], self._settle(lammps)[0]]

    def _locate(self, lammps, world, membership, host):
        groups, origins = lammps.groups.view(np.int32), host.origins()
        n = len(groups)
        here, place, gained = np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n, np.int64)
        lost, found = np.empty(len(self.index), np.int64), np.empty(4, np.int64)
        locate = kernels.locate.bind(groups, *membership.masks, origins, world.rank, self.index, here, place, gained, lost, found)
        return locate, origins, here, place, gained, lost, found

    def _settle(self, lammps):
        box, off = lammps.box, np.empty(2)
        x, near = lammps.per_atom("x", columns=3), _MOVED * box.size
        return kernels.settle.bind(self.state, *self.atoms, x, box.h, box.inverse, box.lo, box.wrap, self.away, self.shift, self.aways,
                                   off, near, self.scratch), off  # fmt: skip

    def take_velocities(self, lammps, given=None):
        """Set v and p to the rigid motion with the linear and angular momentum of the atoms' velocities; collective.

        Args:
            given: (bodies, momenta): places of bodies whose momenta (6, m), linear and angular, are known otherwise.
        """
        mass = lammps.masses
        momentum, load = np.empty_like(self.load), self.load.copy()
        kernels.gather(self.state, *self.atoms, mass[:, None] * lammps.per_atom("v", columns=3), momentum, True, self.scratch)
        if self.spheres:
            spin = SPHERE * mass * lammps.per_atom("radius") ** 2
            kernels.add_torques(self.body, self.index, spin[:, None] * lammps.per_atom("omega", columns=3), momentum)
        self.sharers.combine(momentum)
        if given is not None:
            momentum[:, given[0]] = given[1]
        if self.plane:
            momentum[2:5] = 0.0
        self.v[:] = self.p[:] = 0.0
        self.load[:] = momentum
        kernels.kick(self.state, self.blocks, 1.0, self.scratch)  # a blow of this strength starts the motion
        self.load[:] = load
        if self.extended > self.rotors:  # nothing turns about the axis of a linear body
            linear = slice(self.rotors, self.extended)
            q, about = self.q[:, linear], self.angular_momentum()[2, linear]
            self.p[:, linear] -= 2.0 * about * np.array([-q[3], q[2], -q[1], q[0]])

    def angular_momentum(self):
        """Angular momentum in the principal frame, (3, n)."""
        return np.array(kernels.body_frame_angular_momentum(self.q, self.p))

    def angular_velocity(self):
        """Angular velocity in the principal frame, (3, n); zero about an axis without moment."""
        return np.divide(self.angular_momentum(), self.moment, out=np.zeros_like(self.moment), where=self.moment > 0)

    def momenta(self):
        """Linear and angular momentum in the space frame, (6, n)."""
        return np.concatenate([self.mass * self.v, np.einsum("abn,bn->an", matrices(self.q), self.angular_momentum())])

    def kinetic(self):
        """Kinetic energy of translation and of rotation, mass times velocity squared, (2, n)."""
        turning = (self.angular_momentum() * self.angular_velocity()).sum(axis=0)
        return 0.5 * np.array([self.mass * (self.v**2).sum(axis=0), turning])


def _aligned(*shape):
    """An array of ones that begins where one of the processor's lines does."""
    size = math.prod(shape)
    numbers = np.ones(size + kernels.LINE)
    begin = -(numbers.ctypes.data // numbers.itemsize) % kernels.LINE
    return numbers[begin : begin + size].reshape(shape)


def matrices(q):
    """Rotations (3, 3, n) from the principal to the space frame, of quaternions (4, n)."""
    return np.array(kernels.rotation_matrix(*q)).reshape(3, 3, -1)


def _atoms_changed(lammps, membership, bodies, gone, origins):
    """The message for atoms (their places) that bodies lost, or that came in between two steps."""
    if len(gone):
        gone = gone[bodies.tag[gone].argmin()]
        body = bodies.body[gone]
        moved = np.linalg.norm(bodies.v[:, body]) * lammps.dt
        return (
            f"atom {bodies.tag[gone]} of {membership.name(int(bodies.id[body]))} is gone by step {lammps.step}: it left the box, or was "
            f"deleted or taken out of the group. The body was moving by {moved:.3g} a step: if that is too far, the run is unstable and "
            "needs a shorter time step or a better start; if not, check the boundary, thermo_modify lost, and fixes that "
            "delete atoms, because bodies keep their atoms during a run (and with reinit no or infile, from run to run)"
        )
    atoms = membership.atoms()
    return (
        f"atom {lammps.tags[atoms[origins[atoms] < 0]].min()} came into the fix's group by step {lammps.step}, but bodies are made when a run "
        "starts: use a static group, and insert atoms between runs"
    )
