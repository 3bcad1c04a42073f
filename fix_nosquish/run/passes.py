"""What a run does at each point of a step: lists of loops, bound to bodies and LAMMPS's arrays.

    begin        the first half of a step
    close        its second half, when the forces are known
    whole        the end of a step and the begin of the next one, in one pass where that is possible
    velocities   the atoms' velocities
    constraint_virial
    follow       the bodies follow LAMMPS's atoms
    pressure     what the forces say of the pressure, every so many steps
    cell         the box changes, in the next step
    flip         where tilts change, the box takes vectors of its lattice that are less tilted
    orient       the orientations of atoms that have one
    deform       another fix has changed the box: bodies move with it
    flipped      it has taken other vectors of the same lattice for the box
    gather       force and torque of each body
    kick         the begin of a level of run_style respa

An integrator's `own_lists` has those for the pressure, the cell and the flip, and any others; that
of the name behind comes after the second pass over the bodies.

When each of them is done, the `schedule` says.
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
            mid = (low + high) // 2
            if pushed[mid] < state[ID, b]:
                low = mid + 1
            else:
                high = mid
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
        self.cells = cells
        # the ranks send each other force and torque of bodies that they share, and add what comes
        shared, added = [], []
        if communicator.size > 1:
            shared = [give.bind_to(cells, values=cells["wrench"])]
            added = [combine.bind_to(cells, values=cells["wrench"], how=ADD)]
        gather = self._gather(integrator, bodies, [*shared, *added])
        kick_begins, kick_ends = self._kicks(integrator)
        velocities, orient = self._velocities_and_orient(integrator, bodies)
        after = velocities if half_step_velocities else []
        own_lists = integrator.own_lists(cells)
        before, rest = self._before_and_behind(integrator, own_lists.pop("behind", []))
        how = KEEPS if half_step_velocities else GATHERS
        own = integrator.gravity is not None or integrator.external.acts
        if mask is not None or bodies.spin or own:
            whole = [*gather, *before, self._advance(integrator, True)]
        elif communicator.size == 1:
            whole = [*before, self._advance(integrator, True, ALL, how)]
        else:  # messages are under way while the bodies that need none move
            some = step.gather.bind_to(cells, all_bodies=False)
            undivided = self._advance(integrator, True, WHOLE, how)
            divided = self._advance(integrator, True, DIVIDED, how)
            whole = [some, *shared, *before, undivided, *added, divided]
        close = [*gather, kick_ends, *orient]
        of_bodies = [virial.constraint_virial.bind_to(cells, ftm2v=lammps.ftm2v)]
        self.lists = {
            "gather": gather,
            "begin": [*before, self._advance(integrator, False), *rest, *orient, *after],
            "close": close,
            "whole": [*whole, *rest, *orient, *after],
            "kick": [*gather, kick_begins],
            "velocities": velocities,
            "orient": orient,
            "constraint_virial": [*gather, *of_bodies] if integrator.mid_step else of_bodies,
            "follow": [bodies.following],
        }
        if "cell" in own_lists:
            own_lists["cell"] += after
        self.lists |= _follow_box(integrator, cells) | own_lists

    def _kicks(self, integrator):
        """The kick that begins a level of run_style respa, and the one that ends a step."""
        half = self.cells | {"dt": self.level_dt}
        return integrator.lead.bind_to(half), integrator.tail.bind_to(half)

    def _advance(self, integrator, ends, part=ALL, gathers=0):
        """The bodies' motion to the next forces, behind the end of a step if it `ends` one."""
        how = {"ends": ends, "begins": self.begins, "gathers": gathers, "part": part}
        return integrator.advance.bind_to(self.cells, **how)

    def _before_and_behind(self, integrator, behind):
        """Two lists of loops: before the bodies' motion, and behind it, with those of `behind`."""
        prepares = [integrator.prepares.bind_to(self.cells)] if integrator.prepares else []
        if not integrator.go_on:
            return prepares, []
        second = integrator.go_on.bind_to(self.cells)
        return [], [*prepares, second, *behind]

    def _gather(self, integrator, bodies, exchange):
        """The list of loops for force and torque of each body; `exchange` has those for what other
        ranks know of it."""
        gather = [step.gather.bind_to(self.cells, all_bodies=True)]
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

    def _velocities_and_orient(self, integrator, bodies):
        """Two lists of loops: the atoms' velocities, and orientations of those that have one."""
        velocities = [step.set_velocities.bind_to(self.cells)]
        if integrator.streams:
            velocities.append(deform.speed_up.bind_to(self.cells, sign=1.0))
        if bodies.spin:
            velocities.append(extended.set_spins.bind_to(self.cells))
        if not bodies.oriented:
            return velocities, []
        to = {"orient_atom": integrator.host.orient_atom, "quat": np.empty(4)}
        return velocities, [extended.orient.bind_to(self.cells, **to)]

    def do(self, name):
        """Do a list of passes. Returns: what the first that found something wrong says, or 0."""
        for one in self.lists[name]:
            if found := one():
                return found
        return 0
