"""Rigid bodies: their state, and how they follow LAMMPS's atoms.

The state of a body is its centre of mass x, velocity v, quaternion q and conjugate quaternion
momentum p, with its mass and principal moments.  Each rank stores the bodies of which it owns an
atom, with only its own atoms.  `build` makes them.
"""

from collections.abc import Callable, Sequence
from copy import copy
from typing import NamedTuple
from weakref import WeakMethod

import numpy as np

from ..errors import RunError, refuse
from ..host.lammps import Box, Lammps
from ..loops.compiled import F2, L1, Cell, I
from ..loops.memory import Memory
from ..motion import block
from ..motion.frames import (
    angular_momentum,
    matrices,
    quaternion_momentum,
    to_body,
    vector_times,
)
from ..motion.periodic import PeriodicBox
from ..motion.step import gather
from ..ranks import migration
from ..ranks.arrangement import OF_BODY
from ..ranks.communicator import ALONE, Ranks
from ..ranks.migration import ARRANGE, FEWER, LOCATE, NOTE, SETTLE
from ..ranks.sharing import Sharers, places
from .membership import FLEXIBLE, Membership, PreviousBodies
from .particles import Particles

OFF_BODY = 1e-9  # deviation from the body, in box sizes, above which something else moved an atom
NO_ID = 2.0**62  # ID of a deleted body
_SOON = 100  # number of steps within which a failure is attributed to the start of the run

# rows of a body's state
ROWS = block.ROWS
MASS, MOMENT, X, V, Q, P, WRENCH, FORCE, TORQUE, NATOMS, IMAGE, HOME, ID = (
    slice(row, row + count)
    for row, count in (
        (block.MASS, 1),
        (block.MOMENT, 3),
        (block.X, 3),
        (block.V, 3),
        (block.Q, 4),
        (block.P, 4),
        (block.FORCE, 6),
        (block.FORCE, 3),
        (block.TORQUE, 3),
        (block.NATOMS, 1),
        (block.IMAGE, 3),
        (block.HOME, 1),
        (block.ID, 1),
    )
)


class StartDiagnosis(NamedTuple):
    """The first step of a run, and the result of `log.forces_at_start`."""

    step: int = 0
    diagnosis: str = ""
    advice: str = ""
    spacing: float = np.inf

    def explains(self, step: int) -> bool:
        """Whether a failure at this step is attributed to the forces at the start."""
        return bool(self.diagnosis) and step <= self.step + _SOON


class _View:
    """An attribute of `Bodies`: a view of the array in a cell, or of some of its rows."""

    def __init__(self, cell: str, rows: int | slice = slice(None)) -> None:
        self._cell, self._rows = cell, rows

    def __get__(self, bodies: "Bodies", owner: type) -> np.ndarray:
        return bodies.cells[self._cell].array[self._rows]


class Bodies:
    """The bodies of which this rank owns atoms, sorted by kind.

    Loops read everything from `cells`.  Array attributes are views of the present contents of the
    cells: do not keep them, because `follow` replaces the contents.

    Attributes:
        id: (n,) body IDs.
        rotors, turning: bodies [0, rotors) have three moments (in two dimensions, one about axis
            3), [rotors, turning) are linear, [turning, n) are points.
        state: (rows, n); mass, moment, x, v, q, p, wrench, force, torque, natoms and image are
            views of its rows.
        mass, natoms: (n,).
        moment: (3, n) principal moments, in descending order (ascending with order 123; in two
            dimensions the third is about z).
        x, v: (3, n) in the space frame; x is wrapped into the box, with image flags `image` (3, n).
        q, p: (4, n).
        wrench: (6, n) force and torque in the space frame, including inactive components: see
            `acting_wrench`.  After the list "gather" of passes they are summed over sharing ranks;
            in a step they may be of this rank's atoms alone, or of an earlier step.
        force, torque: (3, n), the two parts of it.
        index, displace: this rank's atoms in the order of the loops; see `block.Layout`.
        body, tag: (m,) the body of each of these atoms, and its atom ID.
        sharers: the `Sharers` of these bodies.
        start: diagnosis of the start of the run.
        possible_causes: part of the message for an atom that was moved: other fixes that may have
            moved it.
        force_receiver: a weak method that receives external forces: see `add_force`.
        tolerates_shifts: whether atoms may deviate from their positions in the bodies.
        planar: whether bodies rotate in the xy plane only, about their axis 3.
        chosen: `block.Kinds.own_moments`.
        spin: whether an atom of a body, on any rank, has a torque and an angular velocity.
        oriented: whether an atom of a body has an orientation; see `extended`.
        cells: `compiled.Cell` by the names of the loops' arguments.

    Args:
        memory: a `Memory` of `BodyRows` with `state` (rows, n) and `displace` (4 or more, m) in any
            order; both are sorted into the order of the passes.
        body: (m,) column of each atom's body in state.
        here: (m,) indices of these atoms in LAMMPS's arrays, ascending.
        planar, spin, oriented, chosen: see above.
        communicator: the `Communicator` or `ALONE`.
    """

    force_receiver: WeakMethod

    def __init__(
        self,
        memory: Memory,
        body: np.ndarray,
        here: np.ndarray,
        planar: bool,
        spin: bool,
        oriented: bool = False,
        communicator: Ranks = ALONE,
        chosen: int = 0,
    ) -> None:
        self.planar, self.spin, self.oriented, self.chosen = planar, spin, oriented, chosen
        self.start, self.tolerates_shifts, self.possible_causes = StartDiagnosis(), False, ""
        self._communicator, self._memory = communicator, memory
        self._box: Box | None = None
        for name, values in ("body", body), ("here", here), ("place", np.arange(len(here))):
            memory.put(name, values)
        rows, columns = len(memory.cells["state"].array), len(memory.cells["displace"].array)
        self.sharers = Sharers(communicator)
        self.kinds = block.Kinds(planar=planar, own_moments=chosen)
        others = {
            "kinds": self.kinds,
            "block": aligned((block.BLOCK_ROWS + rows, block.LANES)),
            "counts": np.zeros(len(migration.COUNTS)),
            "off": np.zeros(2),
            "arrived": np.empty((0, OF_BODY + rows + columns)),
            **dict.fromkeys(PeriodicBox._fields),  # see `update_box`
        }
        kinds = migration.follow.kinds
        self.cells = self._memory.cells | self.sharers.cells | {"mask": Cell(F2, np.empty((6, 0)))}
        self.cells |= {name: Cell(kinds[name], value) for name, value in others.items()}
        unused = {name: Cell(kind) for name, kind in kinds.items() if name not in self.cells}
        migration.follow.bind_to(unused | self.cells, what=ARRANGE)()

    state, displace, index, body = (_View(name) for name in ("state", "displace", "index", "body"))
    mass, natoms = (_View("state", row) for row in (block.MASS, block.NATOMS))
    moment, x, v, q, p, wrench, force, torque, image = (
        _View("state", rows) for rows in (MOMENT, X, V, Q, P, WRENCH, FORCE, TORQUE, IMAGE)
    )

    @property
    def acting_wrench(self) -> np.ndarray:
        """(6, n) the wrench without the components that keywords switch off; see `block.hold`."""
        mask = self.cells["mask"].array
        return self.wrench * mask if mask.size else self.wrench

    @property
    def rotors(self) -> int:
        return self.kinds.rotors.item()

    @property
    def turning(self) -> int:
        return self.kinds.turning.item()

    @property
    def id(self) -> np.ndarray:
        return self.state[block.ID].astype(np.int64)

    @property
    def tag(self) -> np.ndarray:
        return self.displace[3].astype(np.int64)

    def update_tags(self, lammps: Lammps) -> None:
        """Update the atom IDs from LAMMPS."""
        self.displace[3] = lammps.tags[self.index]

    @property
    def listed(self) -> np.ndarray:
        """Which bodies this rank counts, except flexible atoms, (n,) bool."""
        return self.sharers.owned & (self.state[block.ID] < FLEXIBLE)

    @property
    def flat(self) -> np.ndarray:
        """Which rotors are planar, (rotors,) bool: two moments add up to the largest."""
        moment = self.moments_of_atoms[:, : self.rotors]
        return moment.sum(axis=0) <= moment.max(axis=0) * (2 + 1e-7)

    def __len__(self) -> int:
        return self.cells["state"].numbers[2].item()

    # ------------------------------------------------------------- after LAMMPS has moved atoms

    def bind(self, membership: Membership) -> None:
        """Bind the passes that follow the atoms of this LAMMPS, and `note`, which stores in each
        atom its present rank and index."""
        bound = (
            self.cells
            | membership.lammps.cells
            | {name: Cell(I, mask) for name, mask in membership.masks.items()}
        )
        bound["arrived_cell"] = Cell(L1, membership.lammps.cells["arrived"].numbers)
        follows = LOCATE | ARRANGE | NOTE | SETTLE
        self.follow_pass = migration.follow.bind_to(bound, what=follows)
        self._follow_fewer = migration.follow.bind_to(bound, what=follows | FEWER)
        self.note = migration.follow.bind_to(bound, what=NOTE)
        self._settle = migration.follow.bind_to(bound, what=SETTLE)

    def follow(self, lammps: Lammps) -> bool:
        """Follow the atoms after LAMMPS has moved them between ranks and in its arrays; collective.

        Returns:
            whether the bodies are the same: False if atoms of bodies were added or deleted on any
            rank.
        Raises:
            RunError: on all ranks, if atoms are not at their positions in the bodies.
        """
        self.update_box(lammps.box)
        return self._run(self.follow_pass) != migration.CHANGED

    def change(self, lammps: Lammps, gone: np.ndarray, new: "Bodies | None" = None) -> None:
        """Remove bodies whose atoms are gone, and add others; collective.

        Args:
            gone: (n,) bool, the bodies to remove.
            new: `Bodies` of added atoms; None if there are none on any rank.
        Raises:
            RunError: see `follow`.
        """
        self.state[block.ID, gone] = NO_ID  # a new one may have its ID
        if new is not None:
            # they arrive with their atoms, like bodies from other ranks
            arrived = lammps.cells["arrived"]
            rows = new.rows_of_atoms()
            lammps.cells["origins"].array[new.index] = (
                -2 - len(arrived.array) - np.arange(len(rows))
            )
            arrived.set(np.concatenate([arrived.array, rows]))
        refuse(
            self._run(self._follow_fewer) == migration.CHANGED,
            f"atoms came into bodies by step {lammps.step} that this fix does not know: "
            "unfix it and define it again",
        )

    def settle(self, lammps: Lammps) -> None:
        """Find atoms that LAMMPS stores in another periodic image than their bodies; collective.

        Raises:
            RunError: see `follow`.
        """
        self.update_box(lammps.box)
        self._run(self._settle)

    def refuse_moved_atoms(self, lammps: Lammps) -> None:
        """Raise an error if an atom is not at its position in its body; collective.

        The bodies are unchanged, to the last bit.

        Raises:
            RunError: on all ranks.
        """
        tags = lammps.tags
        now = np.append(tags, 0)[np.minimum(self.index, len(tags))]  # no atom has ID 0
        self._communicator.refuse(
            now != self.tag,
            lambda k: (
                f"atom {self.tag[k]} is not where its rigid body has it: "
                "since the last run it has gone to another rank or to another place in LAMMPS's "
                "arrays, or has another ID. Use 'run N pre yes'"
            ),
        )
        before = {name: self.cells[name].array.copy() for name in ("state", "away", "shift")}
        self.settle(lammps)
        for name, values in before.items():
            self._memory.put(name, values)

    def as_previous(self, lammps: Lammps, followed: bool = True) -> PreviousBodies:
        """The bodies of LAMMPS's atoms on this rank as `PreviousBodies`."""
        origins, arrived = (lammps.cells[name].array for name in ("origins", "arrived"))
        here, came = origins >= 0, origins < -1
        here &= places(origins) < len(self.body)
        atom, row = places(origins[here]), -2 - origins[came]
        height, n = len(self.state), len(origins)
        natoms, q, displace = np.zeros(n), np.zeros((4, n)), np.zeros((len(self.displace), n))
        natoms[here], q[:, here] = self.natoms[self.body[atom]], self.q[:, self.body[atom]]
        displace[:, here] = self.displace[:, atom]
        if len(row):
            columns = arrived[row, OF_BODY:].T
            natoms[came], q[:, came] = columns[block.NATOMS], columns[Q]
            displace[:, came] = columns[height:]
        return PreviousBodies(here | came, natoms, q, displace, followed)

    def rows_of_atoms(self, which: slice | np.ndarray = slice(None)) -> np.ndarray:
        """The rows that move with these atoms to other ranks, one each, without their origins."""
        body, displace = self.body[which], self.displace[:, which]
        return np.vstack([np.zeros((OF_BODY, len(body))), self.state[:, body], displace]).T.copy()

    def update_box(self, box: Box) -> None:
        """Set the cells of the box, if the box has changed."""
        if box is not self._box:
            self._box = box
            near = OFF_BODY * box.size + 8 * np.spacing(box.farthest)
            near = np.inf if self.tolerates_shifts else near
            values = {"h": box.h, "inverse": box.inverse, "lo": box.lo, "periodic": box.wrap}
            for name, value in values.items():
                self.cells[name].set(copy(value))  # a copy, because a barostat changes it in place
            self.cells["near"].set(near)

    def _run(self, passes: Callable[[], int]) -> int:
        """Run passes of `follow`, and return what they return, 0 or CHANGED; collective.

        Raises:
            RunError: on all ranks, if an atom of some rank is off its body.
        """
        if (result := passes()) != migration.OFF:
            return result
        far, atom = self.cells["off"].array
        self._communicator.refuse(
            np.array([not far <= self.cells["near"].number]),
            lambda _: (
                f"atom {self.tag[int(atom)]} is {far:.3g} away from where its rigid body has it: "
                f"something else moved it{self.possible_causes}. Let no other fix integrate atoms "
                "of the bodies, and change positions between runs only, with 'run N pre yes' after "
                "it, and without reinit no or infile, which keep the bodies of the last run"
            ),
        )
        return result

    # ------------------------------------------------------------- motion

    def add_force(
        self,
        ids: Sequence[int],
        force: np.ndarray,
        torque: np.ndarray | Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Set an external force and torque on each of these bodies; collective.

        They act from LAMMPS's next force computation on, in all steps and runs, until they are set
        again.  A body that is deleted loses them.

        Args:
            ids: (n,) body IDs, see `output.table`; all arguments must be the same on all ranks.
            force: (n, 3) on the centres of mass; or (3,), the same for all.
            torque: (n, 3) or (3,), about the centres of mass.  Both are in the space frame and in
                LAMMPS's units.
        Raises:
            RunError: on all ranks, for unknown or repeated IDs, for values that are not finite or
                have another shape, if ranks pass different arguments, and in a run that began
                without external forces.
        """
        receive = self.force_receiver()
        if receive is None:  # nobody holds the fix any more
            raise RunError(
                "add_force: the fix of these bodies no longer exists (unfix, or its LAMMPS was "
                "closed): call rigid_bodies for a fix that exists",
                everywhere=True,
            )
        receive(ids, force, torque)

    def take_velocities(
        self,
        lammps: Lammps,
        particles: Particles | None,
        given: np.ndarray,
        momenta: np.ndarray,
    ) -> None:
        """Set v and p to the rigid motion with the momenta of the atoms' velocities; collective.

        Args:
            particles: spins of the bodies' atoms, (m,); None if all are points.
            given: (k,) indices of bodies with prescribed momenta, or (n,) bool.
            momenta: (6, k) their linear and angular momenta, space frame.
        """
        mass, wrench = lammps.masses, self.wrench.copy()
        gather.bind_to(self.cells, atom_f=mass[:, None] * lammps.v, part=block.ALL)()
        momentum = self.wrench.copy()
        if particles is not None:
            momentum[3:] += [
                np.bincount(self.body, row, minlength=len(self)) for row in particles.momentum
            ]
        self.wrench[:] = wrench
        self.sharers.combine(momentum)
        momentum[:, given] = momenta
        if self.planar:
            momentum[2:5] = 0.0
        self.v[:] = 1.0 / self.mass * momentum[:3]
        self.p[:] = vector_times(*(2.0 * momentum[3:]), self.q)  # (2.60), with L in space
        if self.chosen:
            self.p[:] = quaternion_momentum(self.q, *(self.angular_momentum() * self.slowness))
        if self.turning > self.rotors:  # no angular momentum along the axis of a linear body
            linear = slice(self.rotors, self.turning)
            q, about = self.q[:, linear], self.angular_momentum()[2, linear]
            self.p[:, linear] -= 2.0 * about * np.array([-q[3], q[2], -q[1], q[0]])

    def angular_momentum(self) -> np.ndarray:
        """Angular momentum in the principal frame, (3, n)."""
        return np.array(angular_momentum(self.q, self.p))

    def angular_velocity(self) -> np.ndarray:
        """Angular velocity in the principal frame, (3, n); zero about an axis with zero moment."""
        turns = self.moment > 0
        return np.divide(
            self.angular_momentum(), self.moment, out=np.zeros_like(self.moment), where=turns
        )

    def principal_torque(self) -> np.ndarray:
        """Active torque, principal frame, (3, n); zero about an axis with zero moment."""
        torque = np.array(to_body(matrices(self.q).reshape(9, -1), *self.acting_wrench[3:]))
        return torque * (self.moment > 0)

    @property
    def slowness(self) -> np.ndarray | float:
        """Square root of moment / moment of the atoms, (3, n), or 1.0; see `block.Kinds`."""
        return self.state[self.chosen : self.chosen + 3] if self.chosen else 1.0

    @property
    def moments_of_atoms(self) -> np.ndarray:
        """Principal moments from the atoms, or from the infile, (3, n)."""
        return self.moment / self.slowness**2

    def momenta(self) -> np.ndarray:
        """Linear and angular momentum of the atoms' velocities in the space frame, (6, n)."""
        angular = self.angular_momentum() / self.slowness
        angular = np.einsum("abn,bn->an", matrices(self.q), angular)
        return np.concatenate([self.mass * self.v, angular])

    def instability(self, body: int, lammps: Lammps) -> tuple[str, str]:
        """Why a body, by its index, moves too far in a step, and advice; two empty texts if it does
        not."""
        speeds = self.v, self.angular_velocity()
        move, turn = (lammps.innermost_dt * np.linalg.norm(speed[:, body]) for speed in speeds)
        start = self.start
        if move < 0.5 * start.spacing and turn < 1.0:
            return "", ""
        if start.explains(lammps.step):
            return start.diagnosis, start.advice
        cause = f"a body moves by {move:.3g} and turns by {turn:.2g} rad in it"
        return f"the time step is too long: {cause}", "use a shorter one, or a better start"

    def kinetic_of_atoms(self, lammps: Lammps) -> np.ndarray:
        """Translational kinetic energy of each atom, mass times velocity squared, (m,)."""
        v = lammps.v[self.index]
        return 0.5 * lammps.masses[self.index] * (v**2).sum(axis=1)

    def kinetic(self) -> np.ndarray:
        """Kinetic energy of translation and of rotation, mass times velocity squared, (2, n)."""
        turning = (self.angular_momentum() * self.angular_velocity()).sum(axis=0)
        return 0.5 * np.array([self.mass * (self.v**2).sum(axis=0), turning])


def aligned(shape: tuple[int, int]) -> np.ndarray:
    """An array of ones of this shape, aligned to a cache line."""
    numbers = np.ones(shape[0] * shape[1] + block.LINE)
    begin = -(numbers.ctypes.data // numbers.itemsize) % block.LINE
    return numbers[begin : begin + shape[0] * shape[1]].reshape(shape)
