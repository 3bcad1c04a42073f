"""What a run does at each point of a step: lists of loops, bound to bodies and LAMMPS's arrays.

    begin        the first half of a step
    close        its second half, when the forces are known
    whole        the end of a step and the begin of the next one, in one pass where that is possible
    end          what a step that is looked at ends with: its second half; where atoms carry the
                 velocities of the step's middle, nothing
    velocities   the atoms' velocities
    constraint_virial
    follow       the bodies follow LAMMPS's atoms
    pressure     what the forces say of the pressure, every so many steps
    cell         the box changes, in the next step
    flip         where tilts change, the box takes vectors of its lattice that are less tilted
    turn         the orientations of atoms that have one
    deform       another fix has changed the box: bodies move with it
    flipped      it has taken other vectors of the same lattice for the box
    gather       force and torque of each body
    kick         the begin of a level of run_style respa

The plugin does them by itself; where it does not, or there is none, Python does them, by `do`.
"""

import numpy as np

from ..bodies import extended
from ..bodies.bodies import aligned
from ..box import deform
from ..loops.compiled import F1, F2, F64, Cell, F, I, loop
from ..motion import step, virial
from ..motion.block import (
    ALL,
    BLOCK_ROWS,
    DIVIDED,
    ID,
    LANES,
    MASS,
    MOMENT,
    WHOLE,
    Kinds,
    Q,
    four,
)
from ..motion.frames import rotation_matrix, to_body, to_space
from ..motion.step import GATHERS, KEEPS
from ..ranks.sharing import ADD, combine, give
from .threads import Threads


@loop
def switch_off(wrench: F2, mask: F2):
    """Multiply forces and torques by a mask, (6, bodies), or (6, 1) for all."""
    for row in range(6):
        for b in range(wrench.shape[1]):
            wrench[row, b] *= mask[row, b if mask.shape[1] > 1 else 0]


@loop
def weigh(state: F2, wrench: F2, gravity: F1):
    """Add the bodies' weight, by an acceleration (3,), to their forces."""
    for row in range(3):
        for b in range(wrench.shape[1]):
            wrench[row, b] += state[MASS, b] * gravity[row]


@loop
def push(state: F2, kinds: Kinds, wrench: F2, pushed: F1, external: F2):
    """Add external forces and torques, (n, 6), of the bodies with these IDs, (n,) in order.

    A torque about an axis without moment, which a linear body and a point have, turns nothing.
    """
    for b in range(wrench.shape[1]):
        low, high = 0, pushed.shape[0]
        while low < high:
            middle = (low + high) // 2
            if pushed[middle] < state[ID, b]:
                low = middle + 1
            else:
                high = middle
        if low == pushed.shape[0] or pushed[low] != state[ID, b]:
            continue
        x, y, z = external[low, 3], external[low, 4], external[low, 5]
        if b >= kinds.rotors:
            r = rotation_matrix(four(state, Q, b))
            t1, t2, t3 = to_body(r, x, y, z)
            t1 = t1 if state[MOMENT, b] > 0.0 else 0.0
            t2 = t2 if state[MOMENT + 1, b] > 0.0 else 0.0
            t3 = t3 if state[MOMENT + 2, b] > 0.0 else 0.0
            x, y, z = to_space(r, t1, t2, t3)
        for row in range(3):
            wrench[row, b] += external[low, row]
        wrench[3, b] += x
        wrench[4, b] += y
        wrench[5, b] += z


def _follow_box(integrator, cells):
    """The lists of loops behind a change of the box by another fix."""
    if integrator.told_box is None:
        return {}
    told = cells | {"told_box": Cell(F1, integrator.told_box)}
    follows = deform.stream if integrator.streams else deform.deform
    return {"deform": [follows.bind_to(told)], "flipped": [deform.flipped.bind_to(told)]}


def _sums(integrator):
    """How a loop adds up numbers of all bodies, for `Threads.bind`."""
    return {"sums": "parameters", "count": integrator.numbers.dtype.itemsize // 8}


class Passes:
    """The lists of loops of a run.

    Args:
        integrator: the `Integrator`, with its loops.
        bodies: the `Bodies`.  lammps: the `Lammps`.  communicator: the `Communicator` or `ALONE`.
        mask: what of force and torque acts, (6, bodies) or (6, 1); None for all.
        half_step_velocities: whether something reads the atoms' velocities between the halves of a
            step.
        own_cells: dictionary of cells that the integrator's own loop takes.

    Attributes:
        lists: dictionary from the names above to lists of bound loops.
        cells: what the loops are bound to, by name.
        dt, level_dt: cells of the time step of motion, and of the level of run_style respa whose
            forces act; the same without respa.
        begins: cell, whether the motion begins with what stands before it in the splitting; with
            respa each level begins by itself.
        mask: cell.
        threads: the `Threads`.
    """

    def __init__(
        self, integrator, bodies, lammps, communicator, mask, half_step_velocities, own_cells
    ):
        self.dt, self.level_dt, self.begins = Cell(F), Cell(F), Cell(I, 1)
        self.mask = None if mask is None else Cell(F2, mask)
        cells = bodies.cells | lammps.cells | own_cells
        cells |= {"dt": self.dt, "parameters": Cell(integrator.numbers, integrator.parameters)}
        if self.mask is not None:
            cells["mask"] = self.mask
        if integrator.work:
            rows = BLOCK_ROWS + integrator.rows + integrator.work
            cells["block"] = Cell(F64, aligned((rows, LANES)))
        self.cells, self.threads = cells, Threads(lammps, cells)
        bind = self.threads.bind
        # the ranks send each other force and torque of bodies that they share, and add what comes
        shared, added = [], []
        if communicator.size > 1:
            shared = [give.bind_to(cells, values=cells["wrench"])]
            added = [combine.bind_to(cells, values=cells["wrench"], how=ADD)]
        gather = self._gather(integrator, bodies, [*shared, *added])
        kick_begins, kick_ends = self._kicks(integrator)
        velocities, turn = self._velocities_and_turn(integrator, bodies)
        after = velocities if half_step_velocities else []
        before, rest = self._before_and_behind(integrator)
        how = KEEPS if half_step_velocities else GATHERS
        own = integrator.gravity is not None or integrator.external.acts
        if mask is not None or bodies.spin or own:
            whole = [*gather, *before, self._advance(integrator, True)]
        elif communicator.size == 1:
            whole = [*before, self._advance(integrator, True, ALL, how)]
        else:  # messages are under way while the bodies that need none move
            some = bind(step.gather, cells, all_bodies=False)
            undivided = self._advance(integrator, True, WHOLE, how)
            divided = self._advance(integrator, True, DIVIDED, how)
            whole = [some, *shared, *before, undivided, *added, divided]
        close = [*gather, kick_ends, *turn]
        of_bodies = [bind(virial.constraint_virial, cells, "virial", 6, ftm2v=lammps.ftm2v)]
        self.lists = {
            "gather": gather,
            "begin": [*before, self._advance(integrator, False), *rest, *turn, *after],
            "close": close,
            "whole": [*whole, *rest, *turn, *after],
            "end": [] if integrator.mid_step else close,
            "kick": [*gather, kick_begins],
            "velocities": velocities,
            "turn": turn,
            "constraint_virial": [*gather, *of_bodies] if integrator.mid_step else of_bodies,
            "follow": [bodies.following],
        }
        if integrator.box_every:
            self.lists["pressure"], moves = integrator.cell_loops(cells)
            self.lists["cell"] = [*moves, *after] if moves else []
        if integrator.flips:
            self.lists["flip"] = integrator.flip_loops(cells)
        self.lists |= _follow_box(integrator, cells) | integrator.own_lists(cells)

    def _kicks(self, integrator):
        """The kick that begins a level of run_style respa, and the one that ends a step."""
        half, sums = self.cells | {"dt": self.level_dt}, _sums(integrator)
        begins = self.threads.bind(integrator.kick, half, **sums, ends=False, begins=True)
        ends = self.threads.bind(integrator.kick, half, **sums, ends=True, begins=False)
        return begins, ends

    def _advance(self, integrator, ends, part=ALL, gathers=0):
        """The bodies' motion to the next forces, behind the end of a step if it `ends` one."""
        return self.threads.bind(
            integrator.advance, self.cells, **_sums(integrator),
            ends=ends, begins=self.begins, gathers=gathers, part=part,
        )  # fmt: skip

    def _before_and_behind(self, integrator):
        """Two lists of loops: before the bodies' motion, and behind it."""
        prepares = [integrator.prepares.bind_to(self.cells)] if integrator.prepares else []
        if not integrator.go_on:
            return prepares, []
        second = self.threads.bind(integrator.go_on, self.cells, **_sums(integrator))
        return [], [*prepares, second, *integrator.loops_behind(self.cells)]

    def _gather(self, integrator, bodies, exchange):
        """The list of loops for force and torque of each body; `exchange` has those for what other
        ranks know of it."""
        gather = [self.threads.bind(step.gather, self.cells, all_bodies=True)]
        if bodies.spin:
            gather.append(extended.add_torques.bind_to(self.cells))
        gather += exchange
        if integrator.gravity is not None:
            gather.append(weigh.bind_to(self.cells, gravity=integrator.gravity))
        if integrator.external.acts:
            gather.append(push.bind_to(self.cells, **integrator.external.cells))
        if self.mask is not None:
            gather.append(switch_off.bind_to(self.cells))
        return gather

    def _velocities_and_turn(self, integrator, bodies):
        """Two lists of loops: the atoms' velocities, and orientations of those that have one."""
        velocities = [self.threads.bind(step.set_velocities, self.cells)]
        if integrator.streams:
            velocities.append(deform.speed_up.bind_to(self.cells, sign=1.0))
        if bodies.spin:
            velocities.append(extended.set_spins.bind_to(self.cells))
        if not bodies.oriented:
            return velocities, []
        to = {"turn_atom": integrator.host.turn_atom, "quat": np.empty(4)}
        return velocities, [extended.turn.bind_to(self.cells, **to)]

    def do(self, name):
        """Do a list of passes. Returns: what the first that found something wrong says, or 0."""
        for one in self.lists[name]:
            if found := one():
                return found
        return 0
