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
    place        positions, orientations and velocities of atoms
    deform       another fix has changed the box: bodies move with it
    flipped      it has taken other vectors of the same lattice for the box
    gather       force and torque of each body
    kick         the begin of a level of run_style respa

An integrator's `own_lists` has those for the pressure, the cell and the flip, and any others; that
of the name behind comes after the second pass over the bodies.

When each of them is done, the `schedule` says.
"""

from typing import TYPE_CHECKING

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

if TYPE_CHECKING:
    from .integrator import Integrator


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
        low = np.searchsorted(pushed, state[ID, b])
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


class Passes:
    """The lists of loops of a run.

    Args:
        integrator: the `Integrator`, with what it has found out of the run.

    Attributes:
        lists: dictionary from the names above to lists of bound loops.
        cells: what the loops are bound to, by name.
        dt, level_dt: cells of the time step of motion, and of the level of run_style respa whose
            forces act; the same without respa.
        begins: cell, whether the motion begins with what stands before it in the splitting; with
            respa each level begins by itself.
    """

    def __init__(self, integrator: "Integrator") -> None:
        bodies, lammps = integrator.bodies, integrator.lammps
        self.dt, self.level_dt, self.begins = Cell(F), Cell(F), Cell(I, 1)
        cells = self.cells = bodies.cells | lammps.cells | integrator.own_cells()
        cells |= {"dt": self.dt, "parameters": Cell(integrator.numbers, integrator.parameters)}
        if integrator.work:
            rows = BLOCK_ROWS + integrator.rows + integrator.work
            cells["block"] = Cell(F64, aligned((rows, LANES)))
        half = cells | {"dt": self.level_dt}
        # the ranks send each other force and torque of bodies that they share, and add what comes
        several = integrator.communicator.size > 1
        sends = [give.bind_to(cells, values=cells["wrench"])] if several else []
        adds = [combine.bind_to(cells, values=cells["wrench"], how=ADD)] if several else []
        torques = [extended.add_torques.bind_to(cells)] if bodies.spin else []
        pushes = self._pushes(integrator)
        gather = [step.gather.bind_to(cells, all_bodies=True), *torques, *sends, *adds, *pushes]
        velocities, orient = self._velocities_and_orient(integrator)
        after = velocities if integrator.half_step_velocities else []
        prepares = [integrator.prepares.bind_to(cells)] if integrator.prepares else []
        own_lists = integrator.own_lists(cells)
        behind = own_lists.pop("behind", [])
        before, rest = prepares, []
        if integrator.go_on:
            before, rest = [], [*prepares, integrator.go_on.bind_to(cells), *behind]
        how = KEEPS if integrator.half_step_velocities else GATHERS
        if torques or pushes:
            whole = [*gather, *before, self._advance(integrator)]
        elif not several:
            whole = [*before, self._advance(integrator, gathers=how)]
        else:  # messages are under way while the bodies that need none move
            some = step.gather.bind_to(cells, all_bodies=False)
            undivided = self._advance(integrator, gathers=how, part=WHOLE)
            divided = self._advance(integrator, gathers=how, part=DIVIDED)
            whole = [some, *sends, *before, undivided, *adds, divided]
        of_bodies = [virial.constraint_virial.bind_to(cells, ftm2v=lammps.ftm2v)]
        self.lists = {
            "gather": gather,
            "begin": [*before, self._advance(integrator, ends=False), *rest, *orient, *after],
            "close": [*gather, integrator.tail.bind_to(half), *orient],
            "whole": [*whole, *rest, *orient, *after],
            "kick": [*gather, integrator.lead.bind_to(half)],
            "velocities": velocities,
            "orient": orient,
            "place": [step.place_atoms.bind_to(cells), *orient, *velocities],
            "constraint_virial": [*gather, *of_bodies] if integrator.mid_step else of_bodies,
            "follow": [bodies.following],
        }
        if "cell" in own_lists:
            own_lists["cell"] += after
        self.lists |= self._follow_box(integrator) | own_lists

    def _advance(self, integrator, ends=True, part=ALL, gathers=0):
        """The bodies' motion to the next forces, behind the end of a step if it `ends` one."""
        how = {"ends": ends, "begins": self.begins, "gathers": gathers, "part": part}
        return integrator.advance.bind_to(self.cells, **how)

    def _pushes(self, integrator):
        """What acts on the bodies besides the forces on their atoms."""
        pushes = []
        if integrator.gravity is not None:
            pushes.append(weigh.bind_to(self.cells, gravity=integrator.gravity))
        if integrator.external.acts:
            pushes.append(push.bind_to(self.cells, **integrator.external.cells))
        return pushes

    def _velocities_and_orient(self, integrator):
        """Two lists of loops: the atoms' velocities, and orientations of those that have one."""
        bodies, velocities = integrator.bodies, [step.set_velocities.bind_to(self.cells)]
        if integrator.streams:
            velocities.append(deform.speed_up.bind_to(self.cells, sign=1.0))
        if bodies.spin:
            velocities.append(extended.set_spins.bind_to(self.cells))
        to = {"orient_atom": integrator.host.orient_atom, "quat": np.empty(4)}
        return velocities, [extended.orient.bind_to(self.cells, **to)] if bodies.oriented else []

    def _follow_box(self, integrator):
        """The lists of loops behind a change of the box by another fix."""
        if integrator.told_box is None:
            return {}
        told = self.cells | {"told_box": Cell(F1, integrator.told_box)}
        follows = deform.stream if integrator.streams else deform.deform
        return {"deform": [follows.bind_to(told)], "flipped": [deform.flipped.bind_to(told)]}

    def do(self, name):
        """Do a list of passes. Returns: what the first that found something wrong says, or 0."""
        for one in self.lists[name]:
            if found := one():
                return found
        return 0
