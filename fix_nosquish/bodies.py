"""Rigid bodies: their state, and how they follow LAMMPS's atoms.

The state of a body is its centre of mass x, velocity v, quaternion q and conjugate
quaternion momentum p, with its mass and principal moments.  Every rank keeps the
bodies of which it owns an atom, and of their atoms only its own.  `build` makes them.
"""

import math

import numpy as np

from . import kernels

SPHERE = 0.4  # moment of inertia of a solid sphere of unit mass and radius
_MOVED = 1e-9  # positions further off the rigid body than this part of the box were changed by something else

# rows of a body's state
ROWS = kernels.ROWS
MASS, MOMENT, X, V, Q, P, LOAD, NATOMS, IMAGE, HOME = (slice(row, row + rows) for row, rows in (
    (kernels.MASS, 1), (kernels.MOMENT, 3), (kernels.X, 3), (kernels.V, 3), (kernels.Q, 4), (kernels.P, 4),
    (kernels.FORCE, 6), (kernels.NATOMS, 1), (kernels.IMAGE, 3), (kernels.HOME, 1)))  # fmt: skip


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
        body, tag: (m,) the body and the ID of each of these atoms.
        away, shift, aways: those of them in another periodic image than their body; see `kernels.settle`.
        sharers: the `Sharers` of these bodies.
        plane: whether they turn in the xy plane only, about their axis 3.
        spheres: whether some atom of a body, on any rank, is a sphere, with a torque of its own.
    """

    def __init__(self, ids, state, body, tag, here, d, plane, spheres):
        n, m = len(ids), len(here)
        kind = np.where(state[kernels.MOMENT + 2] > 0, 0, np.where(state[kernels.MOMENT] > 0, 1, 2))
        number, order, atoms, next_ = (np.empty(shape, np.int64) for shape in (n, n, n, (n, 2)))
        buckets, source, found = (np.empty(size, np.int64) for size in (kernels.BUCKETS, m, 5))
        blocks, rounds, self.index = (np.empty(shape, np.int32) for shape in ((n + 1, 2), m + 1, m))
        kernels.arrange(body, here, kind, number, order, atoms, next_, buckets, blocks, rounds, self.index, source, found)
        self.rotors, self.extended, size, n_blocks, n_rounds = found.tolist()
        self.blocks, self.rounds = blocks[: n_blocks + 1].copy(), rounds[: n_rounds + 1].copy()
        order = order[:size]
        self.id, self.state = ids[order], state.take(order, axis=1, out=_aligned(kernels.ROWS, size))
        self.body, self.tag, self.d = number[body[source]], tag[source], d.take(source, axis=1, out=_aligned(3, m))
        self.atoms = self.blocks, self.rounds, self.index, self.d
        self.mass, self.natoms, self.home = (self.state[rows][0] for rows in (MASS, NATOMS, HOME))
        self.moment, self.plane, self.spheres = self.state[MOMENT], plane, spheres
        self.x, self.v, self.q, self.p, self.image, self.load = (self.state[rows] for rows in (X, V, Q, P, IMAGE, LOAD))
        self.force, self.torque = self.load[:3], self.load[3:]
        self.away, self.shift, self.aways = np.empty(m, np.int32), np.empty((m, 3)), np.zeros(1, np.int64)
        self.scratch = _aligned(kernels.SCRATCH)

    def __len__(self):
        return len(self.id)

    def follow(self, lammps, world, membership, host):
        """The same bodies after LAMMPS has moved atoms between ranks and in its arrays; collective.

        Returns:
            Bodies; these ones, if none of their atoms has moved in LAMMPS's arrays.
        Raises:
            RunError: if atoms are missing or new, or stand where this fix has not put them.
        """
        locate, origins, here, place, found = self._locate(lammps, world, membership, host)
        moved = locate()
        result = self
        if world.any(moved):
            if moved:
                result = self._rearranged(lammps, world, membership, origins, here[: found[0]], place[: found[0]])
            else:
                world.fetch(origins[:0], np.empty(0, np.int64), self._rows, lambda missing: None)
            result.find_sharers(world)
            host.note(lammps, world, result.index)
        result.settle(lammps, world)
        return result

    def _rearranged(self, lammps, world, membership, origins, here, place):
        """Bodies with these atoms, of which those with place -1 come from other ranks."""
        gained = np.flatnonzero(place < 0)
        left = np.ones(len(self.tag) + 1, bool)
        left[place] = False  # -1 is the entry too many
        origins, tags = origins[here[gained]], lammps.tags[here].astype(np.int64)
        come = tags[gained[origins < 0]]

        def problem(missing):
            return _atoms_changed(lammps, membership, self, missing, come)

        rows = world.fetch(origins[origins >= 0], np.flatnonzero(left[:-1]), self._rows, problem)
        ids, state, body, d = self.id, self.state, np.empty(len(here), np.int64), np.empty((3, len(here)))
        stayed = slice(None) if not len(gained) else np.flatnonzero(place >= 0)
        body[stayed], d[:, stayed] = self.body[place[stayed]], self.d[:, place[stayed]]
        if len(gained):
            shared, comes = self.sharers.bodies, rows[:, 0].astype(np.int64)
            strange = np.flatnonzero(~np.isin(comes, ids[shared]))  # of bodies that had no atom here
            new, which = np.unique(comes[strange], return_index=True)
            numbers = np.concatenate([shared, len(self) + np.arange(len(new))])
            by_id = np.argsort(np.concatenate([ids[shared], new]))
            ids, state = np.concatenate([ids, new]), np.concatenate([state, rows[strange[which], 4:].T], axis=1)
            numbers = numbers[by_id]
            body[gained] = numbers[np.searchsorted(ids[numbers], comes)]
            d[:, gained] = rows[:, 1:4].T
        return Bodies(ids, state, body, tags, here, d, self.plane, self.spheres)

    def _rows(self, places):
        """What another rank needs to know of atoms: body ID, place in the body, the body's state, (k, 4 + ROWS)."""
        body = self.body[places]
        return np.concatenate([self.id[body, None], self.d[:, places].T, self.state[:, body].T], axis=1)

    def find_sharers(self, world):
        """Find who shares the bodies; collective."""
        self.sharers = world.sharers(self.id, np.bincount(self.body, minlength=len(self)) < self.natoms, self.home.astype(np.int64))
        self.home[:] = self.sharers.home

    def settle(self, lammps, world):
        """Find which periodic image of each atom LAMMPS holds; collective."""
        settle, off = self._settle(lammps)
        wrong = settle()
        far, atom = off
        world.agree(
            None
            if not wrong
            else f"atom {self.tag[int(atom)]} is {far:.3g} away from where its rigid body has it: something else moved "
            "it. Let no other fix integrate atoms of the bodies, and change positions between runs only, "
            "with 'run N pre yes' after it, and not with reinit no or infile, which keep the bodies of the last run"
        )

    def stay(self, lammps, world, membership, host):
        """`follow` as passes, for as long as no atom of the bodies moves in LAMMPS's arrays and these and the box stay."""
        return [self._locate(lammps, world, membership, host)[0], self._settle(lammps)[0]]

    def _locate(self, lammps, world, membership, host):
        groups, origins = lammps.groups.view(np.int32), host.origins(lammps, world)
        here, place, found = np.empty(len(groups), np.int32), np.empty(len(groups), np.int32), np.empty(1, np.int64)
        locate = kernels.locate.bind(groups, *membership.masks, origins, world.rank, self.index, here, place, found)
        return locate, origins, here, place, found

    def _settle(self, lammps):
        box, off = lammps.box, np.empty(2)
        x, periodic, near = lammps.per_atom("x", columns=3), box.periodic.astype(float), _MOVED * np.abs(box.h).max()
        return kernels.settle.bind(self.state, *self.atoms, x, box.h, box.inverse, box.lo, periodic, self.away, self.shift, self.aways,
                                   off, near, self.scratch), off  # fmt: skip

    def take_velocities(self, lammps, given=None):
        """Set v and p to the rigid motion with the linear and angular momentum of the atoms' velocities; collective.

        Args:
            given: (bodies, momenta): places of bodies whose momenta (6, m), linear and angular, are known otherwise.
        """
        mass = lammps.masses
        momentum, load = np.empty_like(self.load), self.load.copy()
        kernels.gather(self.state, *self.atoms, mass[:, None] * lammps.per_atom("v", columns=3), momentum, self.scratch)
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


def _atoms_changed(lammps, membership, bodies, gone, come):
    """The message for atoms (their places) that bodies lost or (their tags) that came in between two steps, None if neither."""
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
    if len(come):
        return (
            f"atom {come[0]} came into the fix's group by step {lammps.step}, but bodies are made when a run starts: "
            "use a static group, and insert atoms between runs"
        )
    return None
