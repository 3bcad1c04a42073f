"""HMC: hybrid Monte Carlo, whose trajectories are steps of `NVE`.

Duane, Kennedy, Pendleton and Roweth, Phys. Lett. B 195, 216 (1987); with partial refreshment of the
momenta, Horowitz, Phys. Lett. B 268, 247 (1991).  A trajectory

    draws momenta        p <- sqrt(1 - mix) p + sqrt(mix) noise, and stores the bodies' state
    is a number of steps of NVE, which are reversible and preserve phase-space volume
    is accepted          with probability min(1, exp(-dH / kT)); otherwise the bodies return to the
                         stored state, with reversed momenta

Configurations therefore have the correct distribution for any time step; a long time step only
lowers the acceptance.

The stored state is part of a body's state, so it migrates with the body to other ranks.  After a
rejection the atoms' positions are set from it; LAMMPS then migrates atoms, rebuilds neighbor lists
and recomputes the forces within the same step, so all its output is of the state that is kept.
"""

from collections.abc import Mapping
from math import inf, log1p
from typing import Any, ClassVar
from zlib import crc32

import numpy as np

from ..errors import RunError, refuse
from ..host.command import Command
from ..loops.compiled import F2, Cell, F, inlined, loop, record
from ..motion.block import (
    IMAGE,
    ROWS,
    Images,
    Layout,
    P,
    V,
    X,
)
from ..motion.philox import minus_log, words
from ..motion.step import make_pass, place_all
from ..run.other_fixes import pushing_pair_style
from ..run.part import Part
from ..run.run import Run
from .langevin import WORK, thermalise
from .nve import NVE
from .thermostat import ALL_BODIES, Bath, key_of

# rows of the state: stored X to P of a body, and stored image flags
STORED, STORED_IMAGE = ROWS, ROWS + P + 4 - X
STORED_ROWS = STORED_IMAGE + 3 - ROWS
RestartState: Any = record(
    "RestartState",
    kind=F,  # identifies the record
    tried=F,  # number of trajectories
    accepted=F,
    change=F,  # energy change of the last trajectory
    last=F,  # whether it was accepted
    times_back=F,  # how often the step counter was set back, and its last value
    last_step=F,
)  # in a restart file


@inlined
def copy_rows(state, row, until, to):
    """Copy rows [row, until) of the state to rows from `to` on."""
    for r in range(until - row):
        for b in range(state.shape[1]):
            state[to + r, b] = state[row + r, b]


draw_momenta = make_pass("draw_momenta", thermalise, P + 4, (__name__, ""), Bath)


@loop
def keep_bodies(layout: Layout):
    """Store the state of the bodies at the start of a trajectory."""
    copy_rows(layout.state, X, P + 4, STORED)
    copy_rows(layout.state, IMAGE, IMAGE + 3, STORED_IMAGE)


@loop
def go_back(layout: Layout, images: Images, h: F2, atom_x: F2, atom_v: F2):
    """Return the bodies to the stored state, with reversed momenta.

    Image flags are unchanged, because they match those of LAMMPS's atoms, which do not move here.
    The displacements of the atoms are written to atom_v.
    """
    state = layout.state
    copy_rows(state, STORED, STORED_IMAGE, X)
    for b in range(state.shape[1]):
        for k in range(3):
            for c in range(k, 3):
                state[X + k, b] += h[k, c] * (state[STORED_IMAGE + c, b] - state[IMAGE + c, b])
            state[V + k, b] *= -1.0
        for k in range(4):
            state[P + k, b] *= -1.0
    place_all(layout, images, atom_v)
    for i in layout.index:
        for k in range(3):
            atom_v[i, k] -= atom_x[i, k]


class Trajectory(Part):
    """Begins and tests trajectories.

    Args:
        steps: length of a trajectory.
        record: the `RestartState`, which it updates.
    """

    needs_energy = True
    _has_warned = False

    def __init__(self, steps: int, record: Any) -> None:
        self._steps, self._record = steps, record

    def extra_parameters(self, run: Run) -> dict[str, Any]:
        """Check the run, and plan the first trajectory."""
        _refuse(run)
        self._plan(run, run.lammps.step)
        in_run = run.lammps.running and not run.host.dmax
        if in_run and run.host.last_step > run.lammps.step:
            self._refuse_part(run.host.last_step)
        return {}

    def extra_lists(self, run: Run, cells: dict[str, Cell]) -> dict[str, list]:
        draw = draw_momenta.bind_to(cells, dt=1.0), keep_bodies.bind_to(cells)
        return {"draw": [*draw], "back": [go_back.bind_to(cells)]}

    def _refuse_part(self, last: int) -> None:
        """End a run that would end within a trajectory, in this step."""
        refuse(
            last % self._steps,
            f"the run ends in step {last}, within a trajectory, which would not be tested: "
            f"have it end in a multiple of {self._steps}, the number of keyword steps",
        )

    def resume(self, run: Run) -> None:
        self._refuse_part(run.host.last_step)
        refuse(
            run.lammps.step != run.host.begins,
            f"step {run.lammps.step} does not follow the last trajectory: "
            "begin the run with 'pre yes'",
        )

    def _plan(self, run: Run, step: int) -> None:
        """Plan the next trajectory to begin after this step."""
        run.host.begins, run.host.energy_step = step + 1, (step // self._steps + 1) * self._steps

    def begin_trajectory(self, run: Run) -> None:
        """Draw momenta."""
        self._warn_of_output(run)
        run.parameters.step = run.lammps.step
        run.run_passes("draw")
        run.cache.clear()
        self._before = _total_energy(run)

    def _warn_of_output(self, run: Run) -> None:
        """Warn once of output within a trajectory, where configurations are not yet tested."""
        if self._has_warned:
            return
        steps, output = self._steps, run.host.next_output
        readers = [
            fix for fix in run.conditions.other_fixes if fix.end_of_step and fix.nevery % steps
        ]
        problem = (
            f"fix {readers[0].id} (style {readers[0].style}) looks every {readers[0].nevery} steps"
            if readers
            else f"LAMMPS writes output in step {output}"
            if output is not None and output < run.host.energy_step
            else None
        )
        if problem:
            self._has_warned = True
            run.host.log(
                f"WARNING: {problem}, within a trajectory of hybrid Monte Carlo: what is there was "
                f"not tested. Have all output in multiples of {steps} steps\n"
            )

    def end_trajectory(self, run: Run) -> None:
        """Test the trajectory, and restore the stored state if it is rejected."""
        parameters, state = run.parameters, self._record
        change = run.ranks.share(_total_energy(run) - self._before)
        key_1 = parameters.key_1 | ALL_BODIES
        word, *_ = words(0.0, parameters.step, 0, parameters.key_0, key_1)
        accepted = change <= run.lammps.mvv2e * parameters.kt * minus_log(word)
        state.change, state.last, state.last_step = change, accepted, run.lammps.step
        state.tried += 1
        state.accepted += accepted
        self._plan(run, run.lammps.step)
        if not accepted:
            run.run_passes("back")
            run.run_passes("orient")
            run.host.go_back()
            run.run_passes("gather")
            run.set_velocities()
            run.cache.clear()

    def end(self, run: Run) -> None:
        """Warn if something else has ended the run within a trajectory."""
        if run.steps_made and run.lammps.step >= run.host.begins:
            run.host.log(
                f"WARNING: the run has ended in step {run.lammps.step}, within a trajectory: its "
                "steps were not tested, and count as if they were accepted\n"
            )


def _total_energy(run: Run) -> float:
    """Kinetic energy of the bodies plus LAMMPS's potential energy; collective."""
    return run.thermo.energies().kinetic + run.host.energy


def _refuse(run: Run) -> None:
    """Raise an error if LAMMPS, the forces or other fixes do not permit a correct test."""
    run.host.need("trajectories")
    refuse(
        run.command.force or run.command.torque,
        "keywords force and torque cannot be used with hybrid Monte Carlo, which draws all "
        "momenta anew: use fix nosquish/nvt",
    )
    refuse(
        run.host.ghost_velocity,
        "hybrid Monte Carlo needs forces that do not depend on velocities, and ghost atoms "
        "have some here: leave out pair styles with friction, and comm_modify vel yes",
    )
    style = pushing_pair_style(run.host, newton=True)
    refuse(
        style,
        f"pair style {style} has friction or noise, which no energy tests: leave it out, "
        "or use fix nosquish/nvt with thermostat langevin",
    )
    refuse(
        run.external.present,
        "external forces (fix_modify external, add_force) cannot be used with hybrid Monte Carlo, "
        "which tests the energy of all forces: use a fix with an energy instead, such as efield, "
        "spring or addforce with fix_modify energy yes",
    )
    for sibling in run.conditions.siblings:
        raise RunError(
            f'fix {sibling.host.fix_id} ("{sibling.command.text}") moves bodies besides hybrid '
            "Monte Carlo, which tests all motion at once: have one fix move all bodies",
            everywhere=True,
        )
    if untested := run.conditions.other_fixes.without_energy():
        fix, advice = untested
        raise RunError(
            f"fix {fix.id} (style {fix.style}) may change positions, momenta or forces "
            "with no energy that hybrid Monte Carlo could test: "
            f"{advice}, or use fix nosquish/nvt",
            everywhere=True,
        )


class HMC(NVE):
    """fix ID group nosquish/hmc BODYSTYLE temp T steps N seed S [mix X] ...

    A trajectory ends in each step that is a multiple of N.

    Attributes:
        restart_state, restart_record: contents of a restart file, as an array and as a record.

    Raises:
        RunError: for an invalid temperature or mix, for a run that ends within a trajectory, and
            for other fixes that change positions, momenta or forces without an energy.
    """

    keywords = "temp T", "steps", "seed", "mix", "moments"
    kept, work, respa, numbers = STORED_ROWS, WORK, False, Bath
    supports_remap_v = False
    method = "hybrid Monte Carlo with NO_SQUISH"
    kind: ClassVar = float(crc32(b"HMC 7"))
    values: Mapping[str, bool] = {"acceptance": False, "dH": False, "accepted": False}

    def __init__(self, command: Command, dimension: int) -> None:
        super().__init__(command, dimension)
        command.refuse_missing("temp T", "steps", "seed")
        self.restart_state = np.array([self.kind, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0])
        self.restart_record = RestartState.of(self.restart_state)
        self.parts = (Trajectory(command.steps, self.restart_record),)

    def extra_parameters(self, run: Run) -> dict[str, Any]:
        state, command, lammps = self.restart_record, self.command, run.lammps
        if state.kind != self.kind:
            run.host.log("WARNING: the restart file has no state of hybrid Monte Carlo\n")
            state.kind = self.kind
        temperature, mix = (lammps.number(word) for word in (*command.temp, command.mix))
        command.refuse_unless_positive("keyword temp: T", temperature)
        if not 0 < mix <= 1:
            raise command.wrong(f"keyword mix is {mix:g}, and must be above 0 and at most 1")
        state.times_back += lammps.step < state.last_step
        kt = lammps.boltz / lammps.mvv2e * temperature
        rate = -0.5 * log1p(-mix) if mix < 1 else inf  # friction, for dt = 1
        key_0, key_1 = key_of(command, state.times_back, run.host.world)
        return {"rate": rate, "kt": kt, "step": -1, "key_0": key_0, "key_1": key_1}

    def extra_values(self, run: Run) -> tuple[float, ...]:
        """The acceptance rate; the energy change of the last trajectory, and whether it was
        accepted."""
        state = self.restart_record
        accepted = state.accepted / state.tried if state.tried else 0.0
        return accepted, state.change, state.last
