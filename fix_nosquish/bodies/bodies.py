"""Rigid bodies: their state, and how they follow LAMMPS's atoms.

The state of a body is its centre of mass x, velocity v, quaternion q and conjugate quaternion
momentum p, with its mass and principal moments.  Every rank keeps the bodies of which it owns an
atom, and of their atoms only its own.  `build` makes them.
"""

from copy import copy
from typing import NamedTuple

import numpy as np

from ..errors import RunError
from ..loops.compiled import F2, Cell, I
from ..loops.memory import Memory
from ..motion import block
from ..motion.frames import angular_momentum, quaternion_momentum, rotation_matrix, vector_times
from ..motion.periodic import PeriodicBox
from ..motion.step import gather
from ..ranks import migration
from ..ranks.communicator import ALONE
from ..ranks.migration import ARRANGE, FEWER, LOCATE, NOTE, OF_BODY, SETTLE
from ..ranks.sharing import Sharers, places
from .membership import POINTS

OFF_BODY = 1e-9  # positions further off the body than this part of the box were changed by others
NO_ID = 2.0**62  # of a body that is no more
_SOON = 100  # steps after which what happens is no longer due to the start

# rows of a body's state
ROWS = block.ROWS
MASS, MOMENT, X, V, Q, P, WRENCH, NATOMS, IMAGE, HOME, ID = (
    slice(row, row + rows)
    for row, rows in (
        *(
            (block.MASS, 1),
            (block.MOMENT, 3),
            (block.X, 3),
            (block.V, 3),
            (block.Q, 4),
            (block.P, 4),
        ),
        *((block.FORCE, 6), (block.NATOMS, 1), (block.IMAGE, 3), (block.HOME, 1), (block.ID, 1)),
    )
)


class Former(NamedTuple):
    """What LAMMPS's atoms on this rank were in bodies.

    Attributes:
        known: (natoms,) bool, which atoms were in a body.
        id, natoms: (natoms,) the body's ID and number of atoms.  q: (4, natoms) its quaternion.
        displace: (rows, natoms) the atom's column of `Bodies.displace`.
        followed: whether LAMMPS took all that along with the atoms; else their IDs found them.
    """

    known: np.ndarray
    id: np.ndarray
    natoms: np.ndarray
    q: np.ndarray
    displace: np.ndarray
    followed: bool


def _rows(rows):
    """An attribute that is these rows of the state."""
    return property(lambda self: self.state[rows])


def _cell(name):
    """An attribute that is the array in a cell."""
    return property(lambda self: self.cells[name].array)


class Bodies:
    """The bodies of which this rank owns atoms, those of one kind side by side.

    Loops find all of it in `cells`, which `follow` sets anew: arrays here are views of what is
    there when they are asked for, of use until then.

    Attributes:
        id: (n,) body IDs.
        rotors, turning: bodies [0, rotors) have three moments (in a plane: a moment about axis 3),
            [rotors, turning) are linear, [turning, n) are points.
        mass (n,), moment (3, n), x, v, image (3, n), q, p (4, n), natoms (n,): views of `state`; x
            is kept in the box, which image counts.  x, v and the torque are in the space frame,
            moments in the principal frame, from the largest to the smallest (with order 123 the
            other way round; in a plane the third is about z).
        force, torque: (3, n), views of `wrench`, (6, n) of `state`, which sharing ranks exchange.
        index, displace: this rank's atoms as the loops take them; see `block.Layout`.
        body, tag: (m,) the body of each of these atoms, and its ID.
        sharers: the `Sharers` of these bodies.
        start: None, or what is known of the start of the run: its step, and what
            `log.forces_at_start` says.
        external: None, or what takes external forces; see `add_force`.
        loose: whether atoms may stand anywhere near where their bodies have them.
        planar: whether they turn in the xy plane only, about their axis 3.
        chosen: `block.Kinds.own_moments`.
        spin: whether some atom of a body, on any rank, has a torque and a spin of its own.
        oriented: whether some atom of them has an orientation; see `extended`.
        cells: dictionary from the names that the loops' arguments have to `compiled.Cell`.

    Args:
        state (rows, n), body (m,), displace (4 or more, m): the bodies and their atoms, in any
            order.
        here: (m,) indices of these atoms in LAMMPS's arrays, ascending.
        planar, spin, oriented, chosen: see above.
        communicator: the `Communicator` or `ALONE`.
    """

    def __init__(
        self,
        state,
        body,
        displace,
        here,
        planar,
        spin,
        oriented=False,
        communicator=ALONE,
        chosen=0,
    ):
        self.planar, self.spin, self.oriented = planar, spin, oriented
        self.chosen, self.start, self.loose, self.suspects = chosen, None, False, ""
        self._communicator, self._box = communicator, None
        self._memory = Memory(migration.KINDS)
        for name, values in (
            ("state", state),
            ("body", body),
            ("displace", displace),
            ("here", here),
            ("place", np.arange(len(here))),
        ):
            self._memory.put(name, values)
        self.sharers = Sharers(communicator)
        self._found = np.zeros(migration.FOUND, np.int64)
        self._found[migration.COUNT] = len(here)
        lanes = aligned((block.BLOCK_ROWS + state.shape[0], block.LANES))
        self.cells = self._memory.cells | self.sharers.cells
        self.cells["bodies"] = self.cells.pop("memory")
        self.kinds = block.Kinds.new(planar=planar, own_moments=chosen)
        kinds = migration.follow.kinds
        for name, value in (
            ("kinds", self.kinds),
            ("block", lanes),
            ("found", self._found),
            ("aways", np.zeros(1, np.int64)),
            ("off", np.zeros(2)),
            ("arrived", np.empty((0, OF_BODY + len(state) + len(displace)))),
        ):
            self.cells[name] = Cell(kinds[name], value)
        self.cells |= {"rank": Cell(I, communicator.rank), "mask": Cell(F2, np.ones((6, 1)))}
        nothing = {name: Cell(kind) for name, kind in kinds.items() if name not in self.cells}
        migration.follow.bind_to(nothing | self.cells, what=ARRANGE)()

    external = None
    rotors = property(lambda self: self.kinds.rotors.item())
    turning = property(lambda self: self.kinds.turning.item())
    state, displace, index, body = map(_cell, ("state", "displace", "index", "body"))
    mass, natoms, moment, x, v, q, p, wrench, image = map(
        _rows, (block.MASS, block.NATOMS, MOMENT, X, V, Q, P, WRENCH, IMAGE)
    )
    force, torque = map(
        _rows, (slice(block.FORCE, block.TORQUE), slice(block.TORQUE, block.NATOMS))
    )

    @property
    def id(self):
        return self.state[block.ID].astype(np.int64)

    @property
    def listed(self):
        """Which bodies are counted here and are bodies of the fix line, not its points, (n,)."""
        return self.sharers.owned & (self.state[block.ID] < POINTS)

    @property
    def tag(self):
        return self.displace[3].astype(np.int64)

    @property
    def flat(self):
        """Which rotors are planar, (rotors,): two of their moments add up to the largest."""
        moment = self.moments_of_atoms[:, : self.rotors]
        return moment.sum(axis=0) <= moment.max(axis=0) * (2 + 1e-7)

    def __len__(self):
        return self.cells["state"].numbers[2].item()

    # ------------------------------------------------------------- after LAMMPS has moved atoms

    def bind(self, lammps, membership):
        """Bind the pass that follows the atoms of this LAMMPS."""
        masks = dict(zip(("fix_group", "body_groups", "points"), membership.masks, strict=True))
        for name in PeriodicBox._fields:
            self.cells.setdefault(name, Cell(migration.follow.kinds[name]))
        bound = self.cells | lammps.cells | {name: Cell(I, mask) for name, mask in masks.items()}
        follows = LOCATE | ARRANGE | NOTE | SETTLE
        self.following = migration.follow.bind_to(bound, what=follows)
        self._following_fewer = migration.follow.bind_to(bound, what=follows | FEWER)
        self._note = migration.follow.bind_to(bound, what=NOTE)
        self._settle = migration.follow.bind_to(bound, what=SETTLE)

    def note(self):
        """Have each of LAMMPS's atoms take along where it is now."""
        self._note()

    def follow(self, lammps):
        """Be the same bodies after LAMMPS has moved atoms; collective.

        Returns:
            whether that is so: False if atoms of bodies came or are gone on any rank.
        Raises:
            RunError: if atoms stand where this fix has not put them.
        """
        self.know_box(lammps.box)
        problem = self.following()
        if problem == migration.OFF:
            self._communicator.agree(self._off())
        return problem != migration.CHANGED

    def change(self, lammps, gone, new=None):
        """Be without some bodies, whose atoms are gone, and with others; collective.

        Args:
            gone: (n,) bool, which bodies those are.
            new: `Bodies` of other atoms of this LAMMPS, None for none on any rank.
        Raises:
            RunError: as `follow`.
        """
        self.state[block.ID, gone] = NO_ID  # a new one may have its ID
        if new is not None:
            # they come as others come from other ranks: with their atoms
            arrived = lammps.cells["arrived"]
            behind = OF_BODY + len(new.state)
            rows = np.zeros((len(new.index), behind + len(new.displace)))
            rows[:, OF_BODY:behind] = new.state[:, new.body].T
            rows[:, behind:] = new.displace.T
            lammps.cells["origins"].array[new.index] = (
                -2 - len(arrived.array) - np.arange(len(rows))
            )
            arrived.set(np.concatenate([arrived.array, rows]))
        problem = self._following_fewer()
        if problem == migration.OFF:
            self._communicator.agree(self._off())
        elif problem:
            raise RunError(
                f"atoms came into bodies by step {lammps.step} that this fix does not know: "
                "unfix it and define it again",
                everywhere=True,
            )

    def settle(self, lammps):
        """Find which atoms LAMMPS has in another periodic image than their bodies; collective.

        Raises:
            RunError: as `follow`.
        """
        self.know_box(lammps.box)
        if self._settle():
            self._communicator.agree(self._off())

    def refuse_moved_atoms(self, lammps):
        """End the run if an atom is not where its body has it; collective.

        The bodies stay as they are, to the last bit.
        """
        tags, problem = lammps.tags, None
        now = np.append(tags, 0)[np.minimum(self.index, len(tags))]  # 0 is no atom's ID
        other = now != self.tag
        if other.any():
            problem = (
                f"atom {self.tag[other.argmax()]} is not where its rigid body has it: "
                "since the last run it has gone to another rank or to another place in LAMMPS's "
                "arrays, or has another ID. Use 'run N pre yes'"
            )
        self._communicator.agree(problem)
        kept = {name: self.cells[name].array.copy() for name in ("state", "away", "shift", "aways")}
        if self._settle():
            self._communicator.agree(self._off())
        for name in "state", "away", "shift":
            self._memory.put(name, kept[name])
        self.cells["aways"].array[:] = kept["aways"]

    def of_atoms(self, lammps, followed=True):
        """What each of LAMMPS's atoms here is in these bodies: a `Former`."""
        origins, arrived = (lammps.cells[name].array for name in ("origins", "arrived"))
        here, came = origins >= 0, origins < -1
        here &= places(origins) < len(self.body)
        place, row = places(origins[here]), -2 - origins[came]
        rows, behind = np.r_[ID, NATOMS, Q], OF_BODY + len(self.state)
        of_bodies = np.zeros((len(rows), len(origins)))
        displace = np.zeros((len(self.displace), len(origins)))
        of_bodies[:, here] = self.state[rows][:, self.body[place]]
        of_bodies[:, came] = arrived[row[:, None], OF_BODY + rows].T
        displace[:, here], displace[:, came] = self.displace[:, place], arrived[row, behind:].T
        ids, natoms, q = of_bodies[0].astype(np.int64), of_bodies[1], of_bodies[2:]
        return Former(here | came, ids, natoms, q, displace, followed)

    def know_box(self, box):
        """The bodies are in this `lammps.Box` now."""
        if box is not self._box:
            self._box = box
            near = np.inf if self.loose else OFF_BODY * box.size + 8 * np.spacing(box.farthest)
            known = {"h": box.h, "inverse": box.inverse, "lo": box.lo, "periodic": box.wrap}
            for name, value in known.items():
                self.cells[name].set(copy(value))  # a barostat changes what loops have
            self.cells["near"].set(near)

    def _off(self):
        """What to say of the atom that is off its body, None for none on this rank."""
        far, atom = self.cells["off"].array
        if far <= self.cells["near"].number:
            return None
        return (
            f"atom {self.tag[int(atom)]} is {far:.3g} away from where its rigid body has it: "
            f"something else moved it{self.suspects}. Let no other fix integrate atoms of the "
            "bodies, and change positions between runs only, with 'run N pre yes' after it, "
            "and not with reinit no or infile, which keep the bodies of the last run"
        )

    # ------------------------------------------------------------- motion

    def add_force(self, ids, force, torque=(0.0, 0.0, 0.0)):
        """Hand in an external force and torque for each of these bodies; collective.

        They act on the bodies from the next forces that LAMMPS computes, in all steps and runs
        until the same body gets others here.  A body that goes takes them along.

        Args:
            ids: (n,) body IDs, as `output.table` has them; the same on all ranks, as all arguments.
            force: (n, 3), on the centres of mass; or (3,), the same for each of them.
            torque: (n, 3) or (3,), about the centres of mass.  All is in the space frame and in
                LAMMPS's units.
        Raises:
            RunError: on all ranks, for IDs that no body has or that stand twice, for numbers that
                are not finite or of another shape, if ranks hand in different ones, and in a run
                that began without external forces.
        """
        self.external.give(ids, force, torque)

    def take_velocities(self, lammps, spins=None, given=None):
        """Set v and p to the rigid motion with the momenta of the atoms' velocities; collective.

        Args:
            spins: (3, m) the angular momenta of the atoms themselves; None for none.
            given: (bodies, momenta): places of bodies whose momenta (6, m), linear and angular, are
                known otherwise.
        """
        mass, wrench = lammps.masses, self.wrench.copy()
        momenta = mass[:, None] * lammps.per_atom("v", columns=3)
        gather.bind_to(self.cells, atom_f=momenta, all_bodies=True)()
        momentum = self.wrench.copy()
        if spins is not None:
            momentum[3:] += [np.bincount(self.body, row, minlength=len(self)) for row in spins]
        self.wrench[:] = wrench
        self.sharers.combine(momentum)
        if given is not None:
            momentum[:, given[0]] = given[1]
        if self.planar:
            momentum[2:5] = 0.0
        self.v[:] = 1.0 / self.mass * momentum[:3]
        self.p[:] = vector_times(*(2.0 * momentum[3:]), self.q)  # (2.60), with L in space
        if self.chosen:
            slower = self.angular_momentum() * self.slowness
            self.p[:] = quaternion_momentum(self.q, *slower)
        if self.turning > self.rotors:  # nothing turns about the axis of a linear body
            linear = slice(self.rotors, self.turning)
            q, about = self.q[:, linear], self.angular_momentum()[2, linear]
            self.p[:, linear] -= 2.0 * about * np.array([-q[3], q[2], -q[1], q[0]])

    def angular_momentum(self):
        """Angular momentum in the principal frame, (3, n)."""
        return np.array(angular_momentum(self.q, self.p))

    def angular_velocity(self):
        """Angular velocity in the principal frame, (3, n); zero about an axis without moment."""
        turns = self.moment > 0
        return np.divide(
            self.angular_momentum(), self.moment, out=np.zeros_like(self.moment), where=turns
        )

    @property
    def slowness(self):
        """The root of each moment over that of the atoms, (3, n), or 1.0; see `block.Layout`."""
        return self.state[self.chosen : self.chosen + 3] if self.chosen else 1.0

    @property
    def moments_of_atoms(self):
        """Principal moments that follow from the atoms, or the infile, (3, n)."""
        return self.moment / self.slowness**2

    def momenta(self):
        """Linear and angular momentum of the atoms' velocities in the space frame, (6, n)."""
        angular = self.angular_momentum() / self.slowness
        angular = np.einsum("abn,bn->an", matrices(self.q), angular)
        return np.concatenate([self.mass * self.v, angular])

    def instability(self, body, lammps):
        """Why a body moves too far in a step, and what to do; '', '' if it does not."""
        speeds = self.v, self.angular_velocity()
        move, turn = (lammps.innermost_dt * np.linalg.norm(speed[:, body]) for speed in speeds)
        first, cause, remedy, spacing = self.start or (0, "", "", np.inf)
        if move < 0.5 * spacing and turn < 1.0:
            return "", ""
        if cause and lammps.step <= first + _SOON:
            return cause, remedy
        cause = f"a body moves by {move:.3g} and turns by {turn:.2g} rad in it"
        return f"the time step is too long: {cause}", "use a shorter one, or a better start"

    def kinetic_of_atoms(self, lammps):
        """Kinetic energy of the velocity of each atom, mass times velocity squared, (m,)."""
        v = lammps.per_atom("v", columns=3)[self.index]
        return 0.5 * lammps.masses[self.index] * (v**2).sum(axis=1)

    def kinetic(self):
        """Kinetic energy of translation and of rotation, mass times velocity squared, (2, n)."""
        turning = (self.angular_momentum() * self.angular_velocity()).sum(axis=0)
        return 0.5 * np.array([self.mass * (self.v**2).sum(axis=0), turning])


def aligned(shape):
    """An array of ones that begins where one of the processor's lines does."""
    numbers = np.ones(shape[0] * shape[1] + block.LINE)
    begin = -(numbers.ctypes.data // numbers.itemsize) % block.LINE
    return numbers[begin : begin + shape[0] * shape[1]].reshape(shape)


def matrices(q):
    """Rotations (3, 3, n) from the principal to the space frame, of quaternions (4, n)."""
    return np.array(rotation_matrix(q)).reshape(3, 3, -1)


def quaternions(axes):
    """Unit quaternions (4, n) of rotation matrices (n, 3, 3) whose columns are the body axes."""
    r = axes.transpose(1, 2, 0)
    # four times the products q_i q_j; the row of the largest component is the quaternion, scaled
    products = np.array([
        [1 + r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], 1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
        [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1]],
        [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 - r[0, 0] - r[1, 1] + r[2, 2]],
    ])  # fmt: skip
    largest = np.argmax([products[k, k] for k in range(4)], axis=0)
    q = products[largest, :, np.arange(len(axes))].T
    return q / np.sqrt((q * q).sum(axis=0))
