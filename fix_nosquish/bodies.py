"""Rigid bodies: their state, and how they follow LAMMPS's atoms.

The state of a body is its centre of mass x, velocity v, quaternion q and conjugate
quaternion momentum p, with its mass and principal moments.  Every rank keeps the
bodies of which it owns an atom, and of their atoms only its own.  `build` makes them.
"""

from functools import partial

import numpy as np

from . import kernels

SPHERE = 0.4  # moment of inertia of a solid sphere of unit mass and radius
_MOVED = 1e-9  # positions further off the rigid body than this part of the box were changed by something else

# rows of a body's state
MASS, MOMENT, X, V, Q, P, NATOMS, IMAGE = (slice(0, 1), slice(1, 4), slice(4, 7), slice(7, 10),
                                           slice(10, 14), slice(14, 18), slice(18, 19), slice(19, 22))  # fmt: skip
ROWS = 22


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
        force, torque: (3, n), views of `load`, which is what the sharing ranks exchange.
        first (n + 1,), index, tag, d, shift: this rank's atoms, body by body; see `kernels`.
        sharers: the `Sharers` of these bodies.
        plane: whether they turn in the xy plane only, about their axis 3.
        spheres: whether some atom of a body, on any rank, is a sphere, with a torque of its own.
    """

    def __init__(self, ids, state, body, tag, index, d, plane, spheres):
        # bodies by kind, then in the order of their atoms in LAMMPS's arrays; none without atoms
        lowest = np.full(len(ids), np.iinfo(np.int64).max)
        np.minimum.at(lowest, body, index)
        moment = state[MOMENT]
        kind = np.where(moment[2] > 0, 0, np.where(moment[0] > 0, 1, 2))
        held = np.flatnonzero(lowest < np.iinfo(np.int64).max)
        order = held[np.lexsort((lowest[held], kind[held]))]
        rank = np.empty(len(ids), np.int64)
        rank[order] = np.arange(len(order))
        body = rank[body]
        atoms = np.lexsort((index, body))
        self.id, self.state = ids[order], np.ascontiguousarray(state[:, order])
        self.rotors, self.extended = np.searchsorted(kind[order], [1, 2])
        self.body, self.tag = body[atoms], np.ascontiguousarray(tag[atoms])
        self.index, self.d = index[atoms].astype(np.int32), np.ascontiguousarray(d[atoms])
        self.first = np.searchsorted(self.body, np.arange(len(order) + 1)).astype(np.int32)
        self.shift = np.zeros_like(self.d)
        self.load = np.full((6, len(order)), np.nan)  # no force is known yet
        self.force, self.torque = self.load[:3], self.load[3:]
        self.mass, self.natoms = self.state[MASS][0], self.state[NATOMS][0]
        self.moment, self.plane, self.spheres = self.state[MOMENT], plane, spheres
        self.x, self.v, self.q, self.p, self.image = (self.state[rows] for rows in (X, V, Q, P, IMAGE))

    def __len__(self):
        return len(self.id)

    def follow(self, lammps, world, membership):
        """The same bodies after LAMMPS has moved atoms between ranks and in its arrays; collective.

        Returns:
            Bodies.
        Raises:
            RunError: if atoms are missing or new, or stand where this fix has not put them.
        """
        here = membership.atoms()
        tags = lammps.tags[here].astype(np.int64)
        old = kernels.find(self.tag, tags)
        stayed = old >= 0
        lost = np.ones(len(self.tag), bool)
        lost[old[stayed]] = False
        gained = tags[~stayed]
        ids, state = self.id, self.state
        body, d = np.empty(len(here), np.int64), np.empty((len(here), 3))
        body[stayed], d[stayed] = self.body[old[stayed]], self.d[old[stayed]]
        if world.any(lost.any() or len(gained)):
            known = np.concatenate([self.id[self.body[lost], None], self.d[lost], self.state[:, self.body[lost]].T], axis=1)
            known = world.follow(self.tag[lost], known, gained, partial(_atoms_changed, lammps, membership))
            comes = known[:, 0].astype(np.int64)
            new, which = np.unique(comes[~np.isin(comes, ids)], return_index=True)
            state = np.concatenate([state, known[~np.isin(comes, ids)][which, 4:].T], axis=1)
            ids = np.concatenate([ids, new])
            by_id = np.argsort(ids)
            body[~stayed] = by_id[np.searchsorted(ids, comes, sorter=by_id)] if len(comes) else 0
            d[~stayed] = known[:, 1:4]
        result = Bodies(ids, state, body, tags, here, d, self.plane, self.spheres)
        result.settle(lammps, world)
        return result

    def find_sharers(self, world):
        """Find who shares the bodies; collective."""
        self.sharers = world.sharers(self.id, np.diff(self.first) < self.natoms)

    def settle(self, lammps, world):
        """Find who shares the bodies and which periodic image of each atom LAMMPS holds; collective."""
        self.find_sharers(world)
        box = lammps.box
        cells = box.cells(self.x.T).T
        self.x -= box.h @ cells
        self.image += cells
        actual = lammps.per_atom("x", columns=3)[self.index]
        expected = np.empty_like(actual)
        self.shift[:] = 0.0
        kernels.place(self.first, np.arange(len(self.index), dtype=np.int32), self.d, self.shift, self.x, self.q, expected)
        self.shift[:] = box.lattice(actual - expected) @ box.h.T
        off = np.abs(actual - expected - self.shift).max(axis=1, initial=0.0)
        bad = ~(off <= _MOVED * np.abs(box.h).max())
        world.agree(
            f"atom {self.tag[bad.argmax()]} is {off[bad.argmax()]:.3g} away from where its rigid body has it: something else moved "
            "it. Let no other fix integrate atoms of the bodies, and change positions between runs only, "
            "with 'run N pre yes' after it, and not with reinit no or infile, which keep the bodies of the last run"
            if bad.any()
            else None
        )

    def take_velocities(self, lammps, given=None):
        """Set v and p to the rigid motion with the linear and angular momentum of the atoms' velocities; collective.

        Args:
            given: (bodies, momenta): places of bodies whose momenta (6, m), linear and angular, are known otherwise.
        """
        mass = lammps.masses
        momentum = np.empty_like(self.load)
        kernels.gather(self.first, self.index, self.d, self.q, mass[:, None] * lammps.per_atom("v", columns=3), momentum[:3], momentum[3:])
        if self.spheres:
            spin = SPHERE * mass * lammps.per_atom("radius") ** 2
            kernels.add_torques(self.first, self.index, spin[:, None] * lammps.per_atom("omega", columns=3), momentum[3:])
        self.sharers.combine(momentum)
        if given is not None:
            momentum[:, given[0]] = given[1]
        if self.plane:
            momentum[2:5] = 0.0
        self.v[:] = self.p[:] = 0.0
        # a blow of this strength starts the motion
        kernels.kick(len(self), self.extended, self.v, self.q, self.p, self.mass, momentum[:3], momentum[3:], 1.0)
        if self.extended > self.rotors:  # nothing turns about the axis of a linear body
            linear = slice(self.rotors, self.extended)
            q, about = self.q[:, linear], self.angular_momentum()[2, linear]
            self.p[:, linear] -= 2.0 * about * np.array([-q[3], q[2], -q[1], q[0]])

    def angular_momentum(self):
        """Angular momentum in the principal frame, (3, n)."""
        return np.array(kernels.body_frame_angular_momentum.py_func(self.q, self.p, slice(None)))

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


def matrices(q):
    """Rotations (3, 3, n) from the principal to the space frame, of quaternions (4, n)."""
    return np.array(kernels.rotation_matrix.py_func(q, slice(None))).reshape(3, 3, -1)


def _atoms_changed(lammps, membership, gone, known, come):
    """The message for atoms (by their tags) that bodies lost or that came in between two steps, None if neither."""
    if len(gone):
        moved = np.linalg.norm(known[0, 4:][V]) * lammps.dt
        return (
            f"atom {gone[0]} of {membership.name(int(known[0, 0]))} is gone by step {lammps.step}: it left the box, or was deleted "
            f"or taken out of the group. The body was moving by {moved:.3g} a step: if that is too far, the run is unstable and "
            "needs a shorter time step or a better start; if not, check the boundary, thermo_modify lost, and fixes that "
            "delete atoms, because bodies keep their atoms during a run (and with reinit no or infile, from run to run)"
        )
    if len(come):
        return (
            f"atom {come[0]} came into the fix's group by step {lammps.step}, but bodies are made when a run starts: "
            "use a static group, and insert atoms between runs"
        )
    return None
