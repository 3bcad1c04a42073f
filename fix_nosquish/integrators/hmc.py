"""HMC: hybrid Monte Carlo, whose trajectories are steps of `NVE`.

Duane, Kennedy, Pendleton and Roweth, Phys. Lett. B 195, 216 (1987); with momenta that are drawn
anew in part, Horowitz, Phys. Lett. B 268, 247 (1991).  A trajectory

    draws momenta        p <- sqrt(1 - mix) p + sqrt(mix) noise, and keeps where the bodies are
    does so many steps   of NVE, which are reversible and keep volumes in phase space
    is accepted          with probability min(1, exp(-dH / kT)), else the bodies go back to where
                         they were, with their momenta reversed

So configurations have the right distribution at any step, and a long step costs acceptance only.

What a body goes back to is a part of its state, and so goes with it to other ranks.  Its atoms'
places follow from it.  LAMMPS then brings atoms to their ranks, makes new lists of neighbors and
computes the forces once more, in the same step: all that it prints is of the state that stays.
"""

from math import inf, log1p
from typing import Any, ClassVar
from zlib import crc32

import numpy as np

from ..errors import RunError, refuse
from ..host.command import Line
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
from ..run import external, thermo
from ..run.integrator import Integrator
from ..run.other_fixes import pushing_pair_style
from .langevin import WORK, thermalise
from .nve import NVE
from .thermostat import ALL_BODIES, Bath, key_of

# rows of the state: where a body was, X to P, and its image flags
WAS, WAS_IMAGE = ROWS, ROWS + P + 4 - X
KEPT = WAS_IMAGE + 3 - ROWS
Kept = record(
    "Kept",
    kind=F,  # what the rest is
    tried=F,  # trajectories
    accepted=F,
    change=F,  # of the energy by the last one
    last=F,  # whether that was accepted
    times_back=F,  # how often the step counter has gone back, and where it was
    was_at=F,
)  # in a restart file


@inlined
def copy_rows(state, row, until, to):
    """Copy rows of the state to those from `to` on."""
    for r in range(until - row):
        for b in range(state.shape[1]):
            state[to + r, b] = state[row + r, b]


draw_momenta = make_pass("draw_momenta", thermalise, P + 4, (__name__, ""), Bath)


@loop
def keep_bodies(layout: Layout):
    """Keep the bodies as they are when a trajectory begins."""
    copy_rows(layout.state, X, P + 4, WAS)
    copy_rows(layout.state, IMAGE, IMAGE + 3, WAS_IMAGE)


@loop
def go_back(layout: Layout, images: Images, h: F2, atom_x: F2, atom_v: F2):
    """Have the bodies where they were, with their momenta reversed.

    Their image flags stay: they are those of LAMMPS's atoms, which do not move here.  How far these
    are from their places is in place of their velocities.
    """
    state = layout.state
    copy_rows(state, WAS, WAS_IMAGE, X)
    for b in range(state.shape[1]):
        for k in range(3):
            for c in range(k, 3):
                state[X + k, b] += h[k, c] * (state[WAS_IMAGE + c, b] - state[IMAGE + c, b])
            state[V + k, b] *= -1.0
        for k in range(4):
            state[P + k, b] *= -1.0
    place_all(layout, images, atom_v)
    for i in layout.index:
        for k in range(3):
            atom_v[i, k] -= atom_x[i, k]


class HMC(NVE):
    """fix ID group nosquish/hmc BODYSTYLE temp T steps N seed S [mix X] ...

    A trajectory ends in each step that is a multiple of N.

    Attributes:
        restart_state, kept_state: what a restart file keeps, as an array and as a record.

    Raises:
        RunError: for a temperature or a share of noise that cannot be, for a run that ends within a
            trajectory, and for other fixes that change what the test must know.
    """

    keywords = "temp T", "steps", "seed", "mix", "moments"
    kept, work, respa, needs_energy, numbers = KEPT, WORK, False, True, Bath
    crosses = False
    method = "hybrid Monte Carlo with NO_SQUISH"
    kind: ClassVar = float(crc32(b"HMC 7"))
    _has_warned = False

    def __init__(self, ptr: Any, line: Line | str) -> None:
        super().__init__(ptr, line)
        self.restart_state = np.array([self.kind, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0])
        self.kept_state = Kept.of(self.restart_state)

    def own_parameters(self) -> dict[str, Any]:
        self._refuse()
        kept = self.kept_state
        if kept.kind != self.kind:
            self.host.log("WARNING: the restart file has no state of hybrid Monte Carlo\n")
            kept.kind = self.kind
        command, lammps = self.command, self.lammps
        temperature, mix = (lammps.number(word) for word in (*command.temp, command.mix))
        command.refuse_unless_positive("keyword temp: T", temperature)
        if not 0 < mix <= 1:
            raise command.wrong(f"keyword mix is {mix:g}, and must be above 0 and at most 1")
        self._plan(lammps.step)
        if lammps.running and not self.host.dmax and self.host.last_step > lammps.step:
            self._refuse_part()
        kept.times_back += lammps.step < kept.was_at
        kt = lammps.boltz / lammps.mvv2e * temperature
        rate = -0.5 * log1p(-mix) if mix < 1 else inf  # of friction for a time of 1
        key_0, key_1 = key_of(command, kept.times_back, self.host.world)
        return {"rate": rate, "kt": kt, "step": -1, "key_0": key_0, "key_1": key_1}

    def _refuse_part(self) -> None:
        """End a run that would end within a trajectory."""
        last, steps = self.host.last_step, self.command.steps
        refuse(
            last % steps,
            f"the run ends in step {last}, within a trajectory, which would not be tested: "
            f"have it end in a multiple of {steps}, the number of keyword steps",
        )

    def resumed(self) -> None:
        self._refuse_part()
        refuse(
            self.lammps.step != self.host.begins,
            f"step {self.lammps.step} does not follow the last trajectory: "
            "begin the run with 'pre yes'",
        )

    def own_lists(self, cells: dict[str, Cell]) -> dict[str, list]:
        draw = draw_momenta.bind_to(cells, dt=1.0), keep_bodies.bind_to(cells)
        return {"draw": [*draw], "back": [go_back.bind_to(cells)]}

    def _plan(self, step: int) -> None:
        """Have the next trajectory begin behind this step."""
        steps = self.command.steps
        self.host.begins, self.host.energy_step = step + 1, (step // steps + 1) * steps

    def _refuse(self) -> None:
        """Raise an error for a LAMMPS, for forces and for fixes with which no test is right."""
        refuse(
            not self.host.follows,
            "a LAMMPS's own fix python/move gives no potential energy in the steps that need "
            "it, and no forces anew: install this package where its plugin serves, or use "
            "fix nosquish/nvt",
        )
        refuse(
            self.command.force or self.command.torque,
            "keywords force and torque are of no use to hybrid Monte Carlo, which draws all "
            "momenta anew: use fix nosquish/nvt",
        )
        refuse(
            self.host.ghost_velocity,
            "hybrid Monte Carlo needs forces that do not depend on velocities, and ghost atoms "
            "have some here: leave out pair styles with friction, and comm_modify vel yes",
        )
        style = pushing_pair_style(self.host, newton=True)
        refuse(
            style,
            f"pair style {style} has friction or noise, which no energy tests: leave it out, "
            "or use fix nosquish/nvt with thermostat langevin",
        )
        problem = external.without_energy(self)
        refuse(problem, f"hybrid Monte Carlo tests an energy, and {problem}")
        problem = external.not_of_positions(self)
        refuse(problem, f"hybrid Monte Carlo needs forces of an energy, and {problem}")
        for mate in self.mates:
            refuse(
                mate is not self,
                f'fix {mate.host.fix_id} ("{mate.command.text}") moves bodies beside hybrid '
                "Monte Carlo, which tests all motion at once: have one fix move all bodies",
            )
        if found := self.other_fixes.without_energy():
            fix, remedy = found
            raise RunError(
                f"fix {fix.id} (style {fix.style}) may change positions, momenta or forces "
                "with no energy that hybrid Monte Carlo could test: "
                f"{remedy}, or use fix nosquish/nvt",
                everywhere=True,
            )

    # ------------------------------------------------------------- a trajectory

    def _total_energy(self) -> float:
        """Of the bodies, and LAMMPS's potential energy; collective."""
        kinetic = thermo.energies(self.bodies, self.communicator, self.lammps).kinetic
        return kinetic + self.host.energy

    def begin_trajectory(self) -> None:
        """Draw momenta; collective."""
        self._warn_of_output()
        self.parameters.step = self.lammps.step
        self.do("draw")
        self.known.clear()
        self._before = self._total_energy()

    def _warn_of_output(self) -> None:
        """Warn once of output within a trajectory, whose configurations no test has passed."""
        if self._has_warned:
            return
        steps, output = self.command.steps, self.host.next_output
        readers = [fix for fix in self.other_fixes if fix.end_of_step and fix.nevery % steps]
        problem = (
            f"fix {readers[0].id} (style {readers[0].style}) looks every {readers[0].nevery} steps"
            if readers
            else f"LAMMPS writes output in step {output}"
            if output is not None and output < self.host.energy_step
            else None
        )
        if problem:
            self._has_warned = True
            self.host.log(
                f"WARNING: {problem}, within a trajectory of hybrid Monte Carlo: what is there was "
                f"not tested. Have all output in multiples of {steps} steps\n"
            )

    def take_energy(self) -> None:
        """Test the trajectory, and go back if it is not accepted; collective."""
        parameters, kept = self.parameters, self.kept_state
        change = self.communicator.share(self._total_energy() - self._before)
        key_1 = parameters.key_1 | ALL_BODIES
        word, *_ = words(0.0, parameters.step, 0, parameters.key_0, key_1)
        accepted = change <= self.lammps.mvv2e * parameters.kt * minus_log(word)
        kept.change, kept.last, kept.was_at = change, accepted, self.lammps.step
        kept.tried += 1
        kept.accepted += accepted
        self._plan(self.lammps.step)
        if not accepted:
            self.do("back")
            self.do("orient")
            self.host.go_back()
            self.do("gather")
            self.set_velocities()
            self.known.clear()

    def end_run(self) -> None:
        """As of `Integrator`; a run that something else has ended may end within a trajectory."""
        if self.steps_made and self.lammps.step >= self.host.begins:
            self.host.log(
                f"WARNING: the run has ended in step {self.lammps.step}, within a trajectory: its "
                "steps were not tested, and count as if they were accepted\n"
            )
        super().end_run()

    # ------------------------------------------------------------- what LAMMPS asks

    vector_extensive = (*Integrator.vector_extensive, False, False, False)
    vector_names = (*Integrator.vector_names, "acceptance", "dH", "accepted")

    def own_values(self) -> tuple[float, ...]:
        """The part of trajectories that were accepted, and of the last one the change of the energy
        and whether it was accepted."""
        kept = self.kept_state
        accepted = kept.accepted / kept.tried if kept.tried else 0.0
        return accepted, kept.change, kept.last
