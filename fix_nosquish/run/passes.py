"""What a run does at each point of a step: lists of loops, bound to bodies and LAMMPS's arrays.

    begin        the first half of a step
    close        its second half, when the forces are known
    whole        the end of a step and the begin of the next one, in one pass where that is possible
    end          what a step that is looked at ends with: its second half; where atoms carry the
                 velocities of the step's middle, nothing
    velocities   the atoms' velocities
    virial       the constraint virial
    follow       the bodies follow LAMMPS's atoms
    pressure     what the forces say of the pressure, every so many steps
    cell         the box changes, in the next step
    flip         where tilts change, the box takes vectors of its lattice that are less tilted
    turn         the orientations of atoms that have one
    deform       another fix has changed the box: bodies move with it
    flipped      it has taken other vectors of the same lattice for the box
    gather       force and torque of each body
    kick         the begin of a level of run_style respa

The plugin does them by itself; with a LAMMPS's own fix python/move, Python does them, by `do`.
"""

import numpy as np

from ..bodies import extended
from ..bodies.bodies import aligned
from ..box import deform
from ..loops.compiled import F1, F2, F64, Cell, F, I, loop
from ..motion import step, virial
from ..motion.block import ALL, BLOCK_ROWS, DIVIDED, LANES, MASS, WHOLE
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
        threads: the `Threads`.
    """

    def __init__(
        self, integrator, bodies, lammps, communicator, mask, half_step_velocities, own_cells
    ):
        self.dt, self.level_dt, self.begins = Cell(F), Cell(F), Cell(I, 1)
        self.mask = None if mask is None else Cell(F2, mask)
        several = communicator.size > 1
        cells = bodies.cells | lammps.cells | own_cells
        cells |= {"dt": self.dt, "parameters": Cell(F1, integrator.parameters)}
        if self.mask:
            cells["mask"] = self.mask
        if integrator.work:
            rows = BLOCK_ROWS + integrator.rows + integrator.work
            cells["block"] = Cell(F64, aligned((rows, LANES)))
        self.cells, self.threads = cells, Threads(lammps, cells)
        bind = self.threads.bind
        sums = {"sums": "parameters", "count": len(integrator.parameters)}

        def kick(ends):
            half = cells | {"dt": self.level_dt}
            return bind(integrator.kick, half, **sums, ends=ends, begins=not ends)

        def advance(ends, part=ALL, gathers=0):
            return bind(
                integrator.advance, cells, **sums,
                ends=ends, begins=self.begins, gathers=gathers, part=part,
            )  # fmt: skip

        prepares = [integrator.prepares.bind_to(cells)] if integrator.prepares else []
        before, rest = prepares, []
        if integrator.go_on:
            second = bind(integrator.go_on, cells, **sums)
            before, rest = [], [*prepares, second, *integrator.loops_behind(cells)]

        shared = [give.bind_to(cells, values=cells["wrench"])] if several else []
        added = [combine.bind_to(cells, values=cells["wrench"], how=ADD)] if several else []
        gather = [bind(step.gather, cells, every=True)]
        if bodies.spin:
            gather.append(extended.add_torques.bind_to(cells))
        gather += [*shared, *added]
        if integrator.gravity is not None:
            gather.append(weigh.bind_to(cells, gravity=integrator.gravity))
        if mask is not None:
            gather.append(switch_off.bind_to(cells))
        velocities = [bind(step.set_velocities, cells)]
        if integrator.streams:
            velocities.append(deform.speed_up.bind_to(cells, sign=1.0))
        turn = []
        if bodies.oriented:
            to = {"turn_atom": integrator.host.turn_atom, "quat": np.empty(4)}
            turn = [extended.turn.bind_to(cells, **to)]
        if bodies.spin:
            velocities.append(extended.set_spins.bind_to(cells))
        if mask is not None or bodies.spin or integrator.gravity is not None:
            whole = [*gather, *before, advance(True)]
        elif several:  # messages are under way while the bodies that need none move
            how = KEEPS if half_step_velocities else GATHERS
            some = bind(step.gather, cells, every=False)
            whole = [some, *shared, *before, advance(True, WHOLE, how), *added]
            whole.append(advance(True, DIVIDED, how))
        else:
            whole = [*before, advance(True, ALL, KEEPS if half_step_velocities else GATHERS)]
        after = velocities if half_step_velocities else []
        self.lists = {
            "gather": gather,
            "begin": [*before, advance(False), *rest, *turn, *after],
            "close": [*gather, kick(ends=True), *turn],
            "whole": [*whole, *rest, *turn, *after],
            "kick": [*gather, kick(ends=False)],
            "velocities": velocities,
            "turn": turn,
            "virial": [bind(virial.constraint_virial, cells, "virial", 6, ftm2v=lammps.ftm2v)],
            "follow": [bodies.following],
        }
        self.lists["end"] = [] if integrator.middle else self.lists["close"]
        if integrator.every:
            self.lists["pressure"], moves = integrator.cell_loops(cells)
            self.lists["cell"] = [*moves, *after] if moves else []
        if integrator.flips:
            self.lists["flip"] = integrator.flip_loops(cells)
        self.lists |= _follow_box(integrator, cells) | integrator.own_lists(cells)
        if integrator.middle:
            self.lists["virial"] = [*gather, *self.lists["virial"]]

    def do(self, name):
        """Do a list of passes. Returns: what the first that found something wrong says, or 0."""
        for one in self.lists[name]:
            if found := one():
                return found
        return 0
