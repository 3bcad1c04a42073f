"""The shadow energy: what a long run of `NVE` keeps better than the energy.

A symplectic step does not follow H = K + U, but a Hamiltonian that is near to it (Miller et al.
2002, eq. 2.37): H + h^2 G + O(h^4).  For exp(h/2 P) exp(h R) exp(h/2 P) it is

    G = 1/12 d2P/dt2 along the motion of R alone - 1/24 d2R/dt2 along that of P alone

With P = U and R = K the second is Q = sum F^2 / M + sum tau_k^2 / I_k, and the first is Q more than
d2U/dt2 along the trajectory.  This follows from the potential energies of three steps:

    h^2 G = (U(t + h) - 2 U(t) + U(t - h)) / 12 + h^2 Q(t) / 24

A rotation that is split adds the G of each of its two splittings.
"""

from typing import Any

import numpy as np

from fix_nosquish import of_fix_line
from fix_nosquish.errors import RunError
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.motion.frames import matrices
from fix_nosquish.motion.operations import EXACT
from fix_nosquish.run import external, thermo

STEPS = 3  # whose potential energies are needed


class Shadowed(NVE):
    """fix python/move "fix_nosquish_validation.schemes.shadow.Shadowed GROUP BODYSTYLE every N
    ...", as `NVE`.

    f_ID[5] is the shadow energy, of all atoms, at the middle one of three steps.  The last of them
    is a multiple of N, 1 without this keyword.  There is no number before the first such step.

    Raises:
        RunError: where the energy is not that of these bodies' steps, or not known.
    """

    host: Any
    bodies: Any
    parameters: Any
    keywords: Any = ("every",)
    vector_extensive: Any = (*NVE.vector_extensive, True)
    method, needs_energy, respa = "NO_SQUISH and its shadow energy", True, False
    shadow = np.nan  # the latest one, in LAMMPS's units

    def own_parameters(self) -> dict[str, Any]:
        """A run begins, or a command that sets up as one does: name the first step to take."""
        self._refuse()
        self._taken: list[tuple[int, float, float, float]] = []
        if self.runs:  # bodies and forces may be others than in the last run
            self.shadow = np.nan
        step = self.lammps.step
        if (step + STEPS - 1) % self._every == 0:
            self.host.begins = step + 1  # the start is one of three
        self._name_next()
        return {}

    def begin_trajectory(self) -> None:
        """Take the start of a run, as its first step begins; collective."""
        self._take(self.lammps.step - 1)

    def take_energy(self) -> None:
        """Take a step, at its end; collective."""
        self._take(self.lammps.step)
        self._name_next()

    @property
    def _every(self) -> int:
        return self.command.every or 1

    def _name_next(self) -> None:
        step = self.lammps.step
        self.host.energy_step = step + max(1, self._every - step % self._every - (STEPS - 1))

    def _take(self, step: int) -> None:
        lammps, communicator, bodies = self.lammps, self.communicator, self.bodies
        own = own_part(bodies, self.dt, lammps.ftm2v, self.parameters.mrot)
        own = communicator.total(np.array([own[bodies.sharers.owned].sum()]))[0]
        rest = thermo.energies(bodies, communicator, lammps).kinetic + lammps.mvv2e * own
        self._taken = [*self._taken, (step, self.dt, self.host.energy, rest)][-STEPS:]
        steps, dts, potentials, rests = zip(*self._taken)
        follow = steps == (step - 2, step - 1, step) and len(set(dts)) == 1
        if follow and step % self._every == 0:
            before, here, after = potentials
            self.shadow = here + rests[1] + (before - 2.0 * here + after) / 12.0

    def _refuse(self) -> None:
        problem = None
        others = [fix.id for fix in self.other_fixes if fix.time_integrate]
        others += [str(mate.host.fix_id) for mate in self.mates if mate is not self]
        if not self.host.follows:
            problem = (
                "the shadow energy needs the potential energy, which a LAMMPS's own fix "
                "python/move does not give: install this package where its plugin serves"
            )
        elif others:
            problem = (
                f"fix {others[0]} moves atoms, too, and the shadow energy is that of one fix's "
                "steps: have one fix move all atoms, with keyword flexible"
            )
        elif unknown := external.without_energy(self):
            problem = f"the shadow energy would drift: {unknown}"
        elif (found := self.other_fixes.without_energy()) is not None:
            fix, remedy = found
            problem = (
                f"fix {fix.id} (style {fix.style}) may change positions, momenta or forces with no "
                "energy in the potential energy, so that the shadow energy would drift: "
                f"{remedy}, or leave the shadow energy out"
            )
        if problem:
            raise RunError(problem, everywhere=True)

    def own_values(self) -> tuple[float]:
        """The shadow energy."""
        return (self.shadow,)


def own_part(bodies: Any, dt: float, ftm2v: float, mrot: float) -> np.ndarray:
    """What each body adds to h^2 G by itself: h^2 Q / 24, and that of a split rotation.

    Args:
        bodies: the `Bodies`, with forces and torques.
        dt: h, LAMMPS's unit.  ftm2v: LAMMPS's, force to mass times acceleration.
        mrot: inner steps of a rotation that is split, or EXACT.
    Returns:
        (n,) mass times velocity squared.
    """
    torque = np.einsum("abn,an->bn", matrices(bodies.q), bodies.torque)  # about the principal axes
    squared = np.divide(
        torque**2, bodies.moment, out=np.zeros_like(torque), where=bodies.moment > 0
    )
    Q = ftm2v**2 * ((bodies.force**2).sum(axis=0) / bodies.mass + squared.sum(axis=0))
    own = dt**2 / 24 * Q
    if mrot != EXACT and not bodies.planar:
        rotors = slice(bodies.rotors)
        own[rotors] += (dt / mrot) ** 2 * of_split_rotation(
            bodies.angular_momentum()[:, rotors], bodies.moment[:, rotors]
        )
    return own


def of_split_rotation(momentum: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """G of the free rotation that is split into those about axes 3, 2, 1, 2, 3 (2.53).

    Args:
        momentum, moment: angular momentum in the principal frame, and principal moments, (3, n).
    Returns:
        (n,)
    """
    about_1, about_2, about_3, about_12 = (
        second_derivatives(momentum, moment, np.array(axes)[:, None])
        for axes in ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0))
    )
    outer = about_12[2] / 12 - (about_3[0] + about_3[1]) / 24
    inner = about_1[1] / 12 - about_2[0] / 24
    return outer + inner


def second_derivatives(momentum: np.ndarray, moment: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """d2/dt2 of L_k^2 / 2 I_k, (3, n), where only rotation about these axes, (3, 1), moves."""

    def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        return np.cross(a, b, axis=0)

    spin = axes * momentum / moment
    first = cross(momentum, spin)
    second = cross(first, spin) + cross(momentum, axes * first / moment)
    return (first**2 + momentum * second) / moment


__getattr__ = of_fix_line(Shadowed)
