"""What is done at each point of a step: lists of loops, bound to bodies and LAMMPS's arrays.

    begin        the first half of a step
    close        its second half, when the forces are known
    whole        the end of a step and the begin of the next one, in one pass where possible
    velocities   the atoms' velocities
    constraint_virial
    follow       the bodies follow LAMMPS's atoms
    pressure     the virial for the barostat, every so many steps
    cell         the box changes, in the next step
    flip         where tilts change, the box takes lattice vectors that are less tilted
    orient       the orientations of atoms that have one
    place        positions, orientations and velocities of atoms
    deform       another fix has changed the box: bodies move with it, or with remap v images only
    flipped      it has taken other vectors of the same lattice for the box
    gather       force and torque of each body
    kick         the begin of a level of run_style respa

An integrator's `extra_lists` has those for the pressure, the cell and the flip, and any others; the
list "after_motion" comes after the second pass over the bodies.

The `schedule` says when each of them is run.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from ..bodies import extended
from ..bodies.bodies import Bodies, aligned
from ..box import deform
from ..host.lammps import Lammps
from ..loops.compiled import F1, F64, Cell, F, I
from ..motion import step, virial
from ..motion.block import (
    ALL,
    BLOCK_ROWS,
    LANES,
    SHARED,
    UNSHARED,
)
from ..motion.body_forces import push, weigh
from ..motion.step import DROPS, KEEPS
from ..ranks.sharing import ADD, combine, give
from .conditions import Conditions
from .integrator import Integrator


class Passes:
    """The lists of loops of a run.

    Args:
        integrator: what declares the step.
        bodies, lammps: whose arrays the loops take.
        parameters: the record of the integrator's parameters.
        conditions: the `Conditions` of the run.
        external: cells of the external forces, for the loop `push`; None if there are none.
        orient_atom: see `hosts.Host`.
        extra_cells: the integrator's.
        extra_lists: gives the integrator's lists, bound to the cells that it is called with.

    Attributes:
        lists: dictionary from the names above to lists of bound loops.
        cells: what the loops are bound to, by name.
        dt, level_dt: cells of the time step of motion, and of the level of run_style respa whose
            forces act; the same without respa.
        begins: cell, whether the motion begins with what stands before it in the splitting; with
            respa each level begins separately.
    """

    def __init__(
        self,
        integrator: Integrator,
        bodies: Bodies,
        lammps: Lammps,
        parameters: Any,
        conditions: Conditions,
        external: dict[str, Cell] | None,
        orient_atom: np.ndarray | None,
        extra_cells: dict[str, Cell],
        extra_lists: Callable[[dict[str, Cell]], dict[str, list]],
    ) -> None:
        self.dt, self.level_dt, self.begins = Cell(F), Cell(F), Cell(I, 1)
        self._scheme, self._conditions = integrator.scheme, conditions
        cells = self.cells = bodies.cells | lammps.cells | extra_cells
        cells |= {"dt": self.dt, "parameters": Cell(integrator.numbers, parameters)}
        if integrator.work:
            rows = BLOCK_ROWS + integrator.rows + integrator.work
            cells["block"] = Cell(F64, aligned((rows, LANES)))
        half = cells | {"dt": self.level_dt}
        extra = extra_lists(cells)
        velocities, orient = self._velocities(bodies.spin), []
        if bodies.oriented:
            orient = [extended.orient.bind_to(cells, orient_atom=orient_atom, quat=np.empty(4))]
        after = velocities if conditions.half_step else []
        prepares = [integrator.prepares.bind_to(cells)] if integrator.prepares else []
        rest, after_motion = [], extra.pop("after_motion", [])
        if integrator.scheme.go_on:
            go_on = integrator.scheme.go_on.bind_to(cells)
            prepares, rest = [], [*prepares, go_on, *after_motion]
        torques = [extended.add_torques.bind_to(cells)] if bodies.spin else []
        pushes = []  # what acts on the bodies besides the forces on their atoms
        if conditions.gravity is not None:
            pushes.append(weigh.bind_to(cells, gravity=conditions.gravity))
        if external is not None:
            pushes.append(push.bind_to(cells, **external))
        gather, whole = self._gather_and_whole(lammps.ranks > 1, torques, pushes, prepares)
        of_bodies = [virial.constraint_virial.bind_to(cells, ftm2v=lammps.ftm2v)]
        self.lists = {
            "gather": gather,
            "begin": [*prepares, self._advance(ends=False), *rest, *orient, *after],
            "close": [*gather, self._scheme.tail.bind_to(half), *orient],
            "whole": [*whole, *rest, *orient, *after],
            "kick": [*gather, self._scheme.lead.bind_to(half)],
            "velocities": velocities,
            "orient": orient,
            "place": [step.place_atoms.bind_to(cells), *orient, *velocities],
            "constraint_virial": [*gather, *of_bodies] if conditions.mid_step else of_bodies,
            "follow": [bodies.follow_pass],
        }
        if "cell" in extra:
            extra["cell"] += after
        self.lists |= self._of_new_box() | extra

    def _advance(self, ends: bool = True, part: int = ALL, gathers: int = 0) -> Any:
        """The bodies' motion to the next forces, after the end of a step if it `ends` one."""
        return self._scheme.advance.bind_to(
            self.cells, ends=ends, begins=self.begins, gathers=gathers, part=part
        )

    def _gather_and_whole(
        self, several: bool, torques: list, pushes: list, prepares: list
    ) -> tuple[list, list]:
        """The lists gather, and whole up to the end of the first pass over the bodies.

        Args:
            several: whether there are several ranks.
            torques, pushes, prepares: what adds torques of particles; what acts on the bodies
                besides the forces on their atoms; what sets parameters of the step.
        """
        cells = self.cells
        # the ranks send each other force and torque of bodies that they share, and add what comes
        sends = [give.bind_to(cells, values=cells["wrench"])] if several else []
        adds = [combine.bind_to(cells, values=cells["wrench"], how=ADD)] if several else []
        gather = [step.gather.bind_to(cells, part=ALL), *torques, *sends, *adds, *pushes]
        how = KEEPS if self._conditions.half_step else DROPS
        if torques or pushes:
            return gather, [*gather, *prepares, self._advance()]
        if not several:
            return gather, [*prepares, self._advance(gathers=how)]
        # messages are under way while the bodies that need none move
        of_shared = step.gather.bind_to(cells, part=SHARED)
        unshared = self._advance(gathers=how, part=UNSHARED)
        shared = self._advance(gathers=how, part=SHARED)
        return gather, [of_shared, *sends, *prepares, unshared, *adds, shared]

    def _velocities(self, spin: bool) -> list:
        """The atoms' velocities."""
        velocities = [step.set_velocities.bind_to(self.cells)]
        if self._conditions.remaps_velocities:
            velocities.append(deform.add_image_velocities.bind_to(self.cells, sign=1.0))
        if spin:
            velocities.append(extended.set_spins.bind_to(self.cells))
        return velocities

    def _of_new_box(self) -> dict[str, list]:
        """The lists for a change of the box by another fix."""
        box, remaps = self._conditions.deformed_box, self._conditions.remaps_velocities
        if box is None:
            return {}
        cells = self.cells | {"deformed_box": Cell(F1, box)}
        move = deform.move_images if remaps else deform.move_with_box
        return {"deform": [move.bind_to(cells)], "flipped": [deform.flipped.bind_to(cells)]}

    def run(self, name: str) -> int:
        """Run a list of passes. Returns: what the first that failed has returned, or 0."""
        for bound in self.lists[name]:
            if code := bound():
                return code
        return 0
