"""Rigid bodies: their state, and how they follow LAMMPS's atoms.

The state of a body is its centre of mass x, velocity v, quaternion q and conjugate
quaternion momentum p, with its mass and principal moments.  Every rank keeps the
bodies of which it owns an atom, and of their atoms only its own.  `build` makes them.
"""

from typing import NamedTuple

import numpy as np

from . import kernels, spheres
from .compiled import F1, F2, I1, I2, L1, L2, Cell, F, I, cells
from .kernels import RENEWED
from .sharing import ALONE, Agreement, Sharers, places

SPHERE = 0.4  # moment of inertia of a solid sphere of unit mass and radius
OFF_BODY = 1e-9  # positions further off the rigid body than this part of the box were changed by something else
_SOON = 100  # steps after which what happens is no longer due to the start

# rows of a body's state
ROWS = kernels.ROWS
MASS, MOMENT, X, V, Q, P, LOAD, NATOMS, IMAGE, HOME, ID = (slice(row, row + rows) for row, rows in (
    (kernels.MASS, 1), (kernels.MOMENT, 3), (kernels.X, 3), (kernels.V, 3), (kernels.Q, 4), (kernels.P, 4),
    (kernels.FORCE, 6), (kernels.NATOMS, 1), (kernels.IMAGE, 3), (kernels.HOME, 1), (kernels.ID, 1)))  # fmt: skip

# what the loops take beside RENEWED, by the names of their arguments: what has an entry for each atom, or each body, and room for more
# (of RENEWED, too), and the rest
_OF_ATOMS = {
    "rounds": I1,
    "index": I1,
    "body": L1,
    "away": I1,
    "shift": F2,
    "here": I1,
    "place": I1,
    "owner": L1,
    "source": L1,
}
_OF_BODIES = {"blocks": I2, "atoms": L1, "number": L1, "order": L1, "first": L1, "next_": L2}
_OTHERS = {"aways": L1, "scratch": F1, "plane": I, "table": L1, "buckets": L1, "room": L1, "found": L1, "sizes": L1, "cells": L2, "off": F1,
           "h": F2, "inverse": F2, "lo": F1, "periodic": F1, "near": F}  # fmt: skip
_WIDTHS = {"blocks": (3,), "shift": (3,), "next_": (2,)}
_REARRANGING = kernels.arrange, kernels.renew, kernels.carry_over
_TO_WORK_WITH = "here", "place", "owner", "source", "number", "order", "first", "next_"


class Former(NamedTuple):
    """What LAMMPS's atoms on this rank were in bodies.

    Attributes:
        known: (natoms,) bool, which atoms were in a body.
        id, natoms: (natoms,) the body's ID and number of atoms.  q: (4, natoms) its quaternion.
        d: (3, natoms) the atom's place in the body's principal frame.
        followed: whether LAMMPS took all that along with the atoms; if not, atoms were found by their IDs.
    """

    known: np.ndarray
    id: np.ndarray
    natoms: np.ndarray
    q: np.ndarray
    d: np.ndarray
    followed: bool


def _rows(rows):
    """An attribute that is these rows of the state."""
    return property(lambda self: self.state[rows])


def _cell(name):
    """An attribute that is the array in a cell."""
    return property(lambda self: self.cells[name].array)


class Bodies:
    """The bodies of which this rank owns atoms, those of one kind side by side.

    The loops find all of it in `cells`, which `follow` sets anew, or the plugin with the same passes: arrays here are views of
    what is there when they are asked for.

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
        away, shift, aways: those of them in another periodic image than their body; see `kernels.settle`.
        sharers: the `Sharers` of these bodies.
        start: None, or what is known of the start of the run: its step, and what `thermo.forces_at_start` says.
        plane: whether they turn in the xy plane only, about their axis 3.
        spheres: whether some atom of a body, on any rank, is a sphere, with a torque of its own.
        cells: dictionary from the names that arguments of the loops in `kernels` have to `compiled.Cell`.

    Args:
        state (rows, n), body (m,), d (4, m): the bodies and their atoms, in any order.
        here: (m,) int32, indices of these atoms in LAMMPS's arrays, ascending.
        plane, spheres: see above.
        world: the `World` or `Alone`.
    """

    def __init__(self, state, body, d, here, plane, spheres, world=ALONE):
        n, m = state.shape[1], len(here)
        self.plane, self.spheres, self._world, self.start = plane, spheres, world, None
        self._room, self._found, self._box = (
            np.zeros(kernels.ROOMS, np.int64),
            np.zeros(kernels.FOUND, np.int64),
            None,
        )
        table, self.cells = cells(RENEWED)
        self.cells |= {
            name: Cell(kind)
            for name, kind in (_OF_ATOMS | _OF_BODIES | _OTHERS).items()
            if name not in RENEWED
        }
        self.sharers = Sharers(world, self.cells["load"])
        self.cells |= {
            "counts": self.sharers.cells["counts"],
            "shared": self.sharers.cells["bodies"],
        }
        for name in _WIDTHS:
            self.cells[name].set(_column(name, 0))
        for name, value in (
            ("cells", table), ("found", self._found), ("room", self._room), ("sizes", np.empty(kernels.GROUPS + 2, np.int64)),
            ("buckets", np.empty(kernels.BUCKETS, np.int64)), ("aways", np.zeros(1, np.int64)), ("off", np.empty(2)),
            ("scratch", _aligned(kernels.SCRATCH)), ("plane", plane), ("state", state), ("d", d), ("body", body),
        ):  # fmt: skip
            self.cells[name].set(value)
        self._make_room(m, n, 1)
        self.cells["here"].array[:m], self.cells["place"].array[:m] = here, np.arange(m)
        self._found[kernels.COUNT] = m
        bound = self.cells | {"arrived": Cell(F2, np.empty((0, kernels.OF_BODY + len(state))))}
        for loop in _REARRANGING:
            loop.bind_to(bound)()
        # what only that takes is not kept: on one rank it may never be done again
        self._room[:] = 0
        for name in _TO_WORK_WITH:
            self.cells[name].set(_column(name, 0))
        for name in "state", "d":
            address = self.cells[name].numbers[0].item()
            self.cells[name].owners = self.cells["old_" + name].owners = {
                address: self.cells[name].owners[address]
            }
        of_sharers = self.sharers.cells | self.cells
        self._sharing, self._concluding = [], []
        if world.size > 1:
            self._sharing = [kernels.partial.bind_to(of_sharers), *self.sharers.finding]
            self._concluding = [
                kernels.set_home.bind_to(of_sharers)
            ]  # when all ranks know: until then they meet where they did

    rotors, extended = (
        property(lambda self, name=name: self.cells[name].number) for name in ("rotors", "extended")
    )
    state, d, blocks, rounds, index, body, away, shift, aways, scratch = map(
        _cell,
        ("state", "d", "blocks", "rounds", "index", "body", "away", "shift", "aways", "scratch"),
    )
    atoms_here = _cell("atoms")
    mass, natoms, moment, x, v, q, p, load, image = map(
        _rows, (kernels.MASS, kernels.NATOMS, MOMENT, X, V, Q, P, LOAD, IMAGE)
    )
    force, torque = (
        property(lambda self, rows=rows: self.load[rows]) for rows in (slice(3), slice(3, 6))
    )

    @property
    def flat(self):
        """Which of the first `rotors` bodies are planar, (rotors,): the two smaller moments add up to the largest."""
        moment = self.moment[:, : self.rotors]
        return moment.sum(axis=0) <= moment.max(axis=0) * (2 + 1e-7)

    @property
    def atoms(self):
        return self.blocks, self.rounds, self.index, self.d

    @property
    def id(self):
        return self.state[kernels.ID].astype(np.int64)

    @property
    def tag(self):
        return self.d[3].astype(np.int64)

    def __len__(self):
        return self.cells["state"].numbers[2].item()

    def _make_room(self, atoms, bodies, entries):
        """Have arrays for so many atoms, bodies (with those that come among them) and entries of the table of `kernels.arrange`."""
        atoms, bodies, entries = self._room[:] = np.maximum(
            self._room, (atoms, bodies, entries)
        ).tolist()
        self.cells["table"].set(np.empty(entries, np.int64))
        for name, size in ("state", bodies), ("d", atoms):
            now, other = self.cells[name], self.cells["old_" + name]
            rows, columns = now.numbers[1:].tolist()
            both = [now.owners.get(cell.numbers[0].item(), np.empty(0)) for cell in (now, other)]
            if both[0].size < rows * size:
                both[0] = _aligned(rows * size)
                both[0][: rows * columns] = now.array.ravel()
            if both[1].size < rows * size:
                both[1] = _aligned(rows * size)
            now.owners = other.owners = {one.ctypes.data: one for one in both}
            for cell, one in zip((now, other), both):
                cell.numbers[:] = one.ctypes.data, rows, columns
        for names, size in (_OF_ATOMS, atoms), (_OF_BODIES, bodies):
            for name in names:
                old = self.cells[name].array
                new = _column(name, max(size + 1, len(old)))
                new[: len(old)] = old
                self.cells[name].set(new)
                if name in RENEWED:
                    self.cells[name].numbers[1] = len(old)

    # ------------------------------------------------------------- after LAMMPS has moved atoms

    def bind(self, lammps, membership):
        """Bind the passes that follow the atoms of this LAMMPS."""
        fix_group, body_groups = membership.masks
        bound = self.cells | lammps.cells
        self._locate = kernels.locate.bind_to(bound, fix_group=fix_group, body_groups=body_groups)
        self._agreement = Agreement(self._world, Cell(L1, self._found[: kernels.MOVED + 1]))
        self._rearranging = [loop.bind_to(bound) for loop in _REARRANGING]
        self._settle = kernels.settle.bind_to(bound)

    def following(self):
        """The passes of `follow`, for the plugin; see `Host.go_alone`."""
        return (
            self._locate,
            self._agreement,
            [*self._rearranging, *self._sharing],
            self._settle,
            self._concluding,
        )

    def follow(self, lammps, membership, host):
        """Be the same bodies after LAMMPS has moved atoms between ranks and in its arrays; collective.

        Raises:
            RunError: if atoms are missing or new, or stand where this fix has not put them.
        """
        host.point(lammps.cells)
        self._locate()
        came, more, _, moved = self._agreement.total()
        if came or more:
            self._world.agree(_atoms_changed(lammps, self._world, membership, self))
        if moved:
            arrived = len(lammps.cells["arrived"].array)
            if self._found[kernels.LACKING]:
                self._make_room_for(self._found[kernels.COUNT].item(), arrived)
                self._locate()
            for one in self._rearranging:
                one()
            self.find_sharers()
            host.note()
        self._find_images(lammps)
        host.keep_box()

    def of_atoms(self, lammps, followed=True):
        """What each of LAMMPS's atoms here is in these bodies, when a host has pointed the cells at them: a `Former`."""
        origins, arrived = (lammps.cells[name].array for name in ("origins", "arrived"))
        here, came = origins >= 0, origins < -1
        here &= places(origins) < len(self.body)
        place, row = places(origins[here]), -2 - origins[came]
        rows = np.r_[ID, NATOMS, Q]
        of_bodies, d = np.zeros((len(rows), len(origins))), np.zeros((3, len(origins)))
        of_bodies[:, here] = self.state[rows][:, self.body[place]]
        of_bodies[:, came] = arrived[row[:, None], kernels.OF_BODY + rows].T
        d[:, here], d[:, came] = self.d[:3, place], arrived[row, 1:4].T
        return Former(
            here | came, of_bodies[0].astype(np.int64), of_bodies[1], of_bodies[2:], d, followed
        )

    def _make_room_for(self, atoms, arrived):
        bodies, entries = (
            len(self) + arrived,
            4 << (2 * (len(self.sharers.bodies) + arrived)).bit_length(),
        )
        if self._world.size > 1:  # on one rank there are always as many
            atoms, bodies = (size * 5 // 4 + kernels.BLOCK for size in (atoms, bodies))
        self._make_room(atoms, bodies, entries)

    def find_sharers(self):
        """Find who shares the bodies; collective."""
        self.sharers.make_room(max(len(self), self._room[kernels.ROOM_BODIES].item()))
        for one in (*self._sharing, *self._concluding):
            self.sharers.do(one)
        if not self._sharing:
            self.sharers.none(len(self))

    def _find_images(self, lammps):
        """Find which periodic image of each atom LAMMPS holds, and end the run if an atom is not where its body has it; collective."""
        box, problem = lammps.box, None
        if box is not self._box:
            self._box = box
            for name, value in (
                ("h", box.h),
                ("inverse", box.inverse),
                ("lo", box.lo),
                ("periodic", box.wrap),
                ("near", OFF_BODY * box.size),
            ):
                self.cells[name].set(value)
        if self._settle():
            problem = self._off()
        self._world.agree(problem)

    def refuse_moved_atoms(self, lammps):
        """End the run if an atom is not where its body has it; the bodies stay as they are, to the last bit; collective."""
        tags, problem = lammps.tags, None
        now = np.append(tags, 0)[np.minimum(self.index, len(tags))]  # 0 is no atom's ID
        other = now != self.tag
        if other.any():
            problem = (
                f"atom {self.tag[other.argmax()]} is not where its rigid body has it: since the last run it has gone to another rank "
                "or to another place in LAMMPS's arrays, or has another ID. Use 'run N pre yes'"
            )
        else:
            copies = {
                name: Cell(self.cells[name].kind, self.cells[name].array.copy())
                for name in ("state", "away", "shift", "aways")
            }
            if kernels.settle.bind_to(self.cells | lammps.cells | copies)():
                problem = self._off()
        self._world.agree(problem)

    def _off(self):
        """What to say of the atom that `kernels.settle` has found off its body."""
        far, atom = self.cells["off"].array
        return (
            f"atom {self.tag[int(atom)]} is {far:.3g} away from where its rigid body has it: something else moved "
            "it. Let no other fix integrate atoms of the bodies, and change positions between runs only, "
            "with 'run N pre yes' after it, and not with reinit no or infile, which keep the bodies of the last run"
        )

    def take_velocities(self, lammps, given=None):
        """Set v and p to the rigid motion with the linear and angular momentum of the atoms' velocities; collective.

        Args:
            given: (bodies, momenta): places of bodies whose momenta (6, m), linear and angular, are known otherwise.
        """
        mass = lammps.masses
        momentum, load = np.empty_like(self.load), self.load.copy()
        kernels.gather(
            self.state,
            *self.atoms,
            mass[:, None] * lammps.per_atom("v", columns=3),
            momentum,
            True,
            self.scratch,
        )
        if self.spheres:
            spin = SPHERE * mass * lammps.per_atom("radius") ** 2
            spheres.add_torques(
                self.body, self.index, spin[:, None] * lammps.per_atom("omega", columns=3), momentum
            )
        self.sharers.combine(momentum)
        if given is not None:
            momentum[:, given[0]] = given[1]
        if self.plane:
            momentum[2:5] = 0.0
        self.v[:] = self.p[:] = 0.0
        self.load[:] = momentum
        kernels.kick(
            self.state, self.blocks, 1.0, self.scratch
        )  # a blow of this strength starts the motion
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
        return np.divide(
            self.angular_momentum(),
            self.moment,
            out=np.zeros_like(self.moment),
            where=self.moment > 0,
        )

    def momenta(self):
        """Linear and angular momentum in the space frame, (6, n)."""
        return np.concatenate(
            [self.mass * self.v, np.einsum("abn,bn->an", matrices(self.q), self.angular_momentum())]
        )

    def instability(self, body, lammps):
        """Why a body moves too far in a step, and what to do; '', '' if it does not."""
        move, turn = (
            lammps.innermost_dt * np.linalg.norm(speed[:, body])
            for speed in (self.v, self.angular_velocity())
        )
        first, cause, remedy, spacing = self.start or (0, "", "", np.inf)
        if move < 0.5 * spacing and turn < 1.0:
            return "", ""
        if cause and lammps.step <= first + _SOON:
            return cause, remedy
        return (
            f"the time step is too long: a body moves by {move:.3g} and turns by {turn:.2g} rad in it",
            "use a shorter one, or a better start",
        )

    def kinetic(self):
        """Kinetic energy of translation and of rotation, mass times velocity squared, (2, n)."""
        turning = (self.angular_momentum() * self.angular_velocity()).sum(axis=0)
        return 0.5 * np.array([self.mass * (self.v**2).sum(axis=0), turning])


def _aligned(size):
    """An array of ones that begins where one of the processor's lines does."""
    numbers = np.ones(size + kernels.LINE)
    begin = -(numbers.ctypes.data // numbers.itemsize) % kernels.LINE
    return numbers[begin : begin + size]


def _column(name, size):
    """A new array for the cell of this name."""
    kind = (RENEWED | _OF_ATOMS | _OF_BODIES)[name]
    return np.empty((size, *_WIDTHS.get(name, ())), kind.dtype)


def matrices(q):
    """Rotations (3, 3, n) from the principal to the space frame, of quaternions (4, n)."""
    return np.array(kernels.rotation_matrix(*q)).reshape(3, 3, -1)


def _atoms_changed(lammps, world, membership, bodies):
    """The message for atoms that bodies lost, or that came in between two steps, None for none on this rank; collective."""
    atoms, origins = membership.atoms(), lammps.cells["origins"].array
    of_atoms = origins[atoms]
    gained = lammps.cells["arrived"].array[-2 - of_atoms[of_atoms < -1], 0].copy().view(np.int64)
    gone = world.gone(
        np.setdiff1d(np.arange(len(bodies.index)), places(of_atoms[of_atoms >= 0])), gained
    )
    if len(gone):
        gone = gone[bodies.tag[gone].argmin()]
        body = bodies.body[gone]
        lost = f"atom {bodies.tag[gone]} of {membership.name(int(bodies.id[body]))} is gone by step {lammps.step}"
        cause, remedy = bodies.instability(body, lammps)
        if cause:
            return f"{cause}, and {lost}: {remedy}"
        return (
            f"{lost}: it left the box, or was deleted or taken out of the group. Check the boundary, thermo_modify lost, and fixes that "
            "delete atoms, because bodies keep their atoms during a run (and with reinit no or infile, from run to run)"
        )
    if not (of_atoms == -1).any():
        return None
    return (
        f"atom {lammps.tags[atoms[of_atoms == -1]].min()} came into the fix's group by step {lammps.step}, but bodies are made when a run "
        "starts: use a static group, and insert atoms between runs"
    )
