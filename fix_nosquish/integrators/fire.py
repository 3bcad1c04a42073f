"""FIRE: rigid bodies relaxed to a minimum of the energy, by a quench that keeps their shapes.

Bitzek, Koskinen, Gaehler, Moseler and Gumbsch, Phys. Rev. Lett. 97, 170201 (2006); as FIRE 2.0,
Guenole et al., Comput. Mater. Sci. 175, 109584 (2020), with the words and defaults of LAMMPS's
min_style fire.  With a the acceleration of all bodies and power = v . a, masses and moments being
the metric, a step of the quench is

    power > 0   v <- (1 - alpha) (v + dt a) + alpha |v| / |a| a;  after some such steps in a row, dt
                grows and alpha falls
    else        dt falls, and alpha is that of the start; back by half of dt v; v <- dt a
    x <- x + dt v, and a rotation by dt omega (semi-implicit Euler)

Of rotation, v and a are angular velocity and acceleration in the principal frame.  The gyroscopic
term is left out: the minimum does not depend on how bodies turn on the way, nor on their moments.
These are those of atoms that weigh alike.  Then bodies turn as slowly as they move,
while the light atoms of real molecules make them turn fast.
"""

from collections.abc import Mapping
from math import sqrt
from typing import Any

import numpy as np

from ..errors import refuse
from ..host.command import Line
from ..host.hosts import hook
from ..loops.compiled import F1, L1, Cell, F, I, call, inlined, loop, record
from ..motion.block import (
    BLOCK_ROWS,
    COUNTED,
    FORCE,
    LANES,
    MASS,
    MOMENT,
    TORQUE,
    P,
    Q,
    V,
    four,
    three,
    write,
)  # fmt: skip
from ..motion.frames import (
    angular_velocity,
    product,
    quaternion_momentum,
    rotation_matrix,
    to_body,
)
from ..motion.operations import Parameters, drift
from ..motion.step import Operation
from ..ranks.mpi import Mpi, add_up
from ..run import external
from ..run.integrator import Integrator

Quench = record(
    "Quench",
    Parameters,
    force=F,  # squares of the tolerances
    torque=F,
    dmax=F,  # the words of DEFAULTS
    tmax=F,
    tmin=F,
    dtgrow=F,
    dtshrink=F,
    alpha0=F,
    alphashrink=F,
    delaystep=F,
    halfstepback=F,
    step=F,  # the time step now
    alpha=F,
    steps=I,  # of the run
    in_a_row=I,  # with power
    sums=(F, 4),  # of this rank's bodies, see POWER
    back=F,  # for how long the step goes back
    keep=F,  # what it keeps of v, and what it adds of a
    add=F,
)
# sums over bodies: v . a, a . a, v . v; how many are pushed or turned by more than the tolerances
POWER, AA, VV, RESTLESS = range(4)
# of all such fixes: how many they are, how many of them have asked for this step, and how many
# bodies of these are pushed or turned
Quenches = record("Quenches", fixes=I, asked=I, undone=F)
A, TURN, OF_BODY = BLOCK_ROWS, BLOCK_ROWS + 3, 6  # rows: acceleration, angular acceleration
# of min_modify, where it has the word
DEFAULTS = {
    "dmax": "0.1", "tmax": "10", "tmin": "0.02", "dtgrow": "1.1", "dtshrink": "0.5",
    "alpha0": "0.25", "alphashrink": "0.99", "delaystep": "20", "halfstepback": "1",
}  # fmt: skip
BOUNDS = {
    "tmin": (0.0, 1.0), "dtshrink": (0.0, 1.0), "alpha0": (0.0, 1.0), "alphashrink": (0.0, 1.0),
    "tmax": (1.0, np.inf), "dtgrow": (1.0, np.inf),
}  # fmt: skip


@inlined
def of_turns(torque, moment):
    """The square of a torque about an axis; 0 where there is no moment, and so nothing turns."""
    return torque * torque if moment > 0.0 else 0.0


@inlined
def measure(block, kind, dt, parameters):
    """Keep the bodies' accelerations, and add what the step depends on to the sums."""
    power = aa = vv = restless = 0.0
    unit = parameters.ftm2v
    for b in range(LANES):
        q, mass, (i1, i2, i3) = four(block, Q, b), block[MASS, b], three(block, MOMENT, b)
        (fx, fy, fz), (x, y, z) = three(block, FORCE, b), three(block, TORQUE, b)
        t1, t2, t3 = to_body(rotation_matrix(q), x, y, z)
        counted = block[COUNTED, b]
        ax, ay, az = unit / mass * fx, unit / mass * fy, unit / mass * fz
        a1 = unit / i1 * t1 if i1 > 0.0 else 0.0
        a2 = unit / i2 * t2 if i2 > 0.0 else 0.0
        a3 = unit / i3 * t3 if i3 > 0.0 else 0.0
        write(block, A, b, (ax, ay, az, a1, a2, a3))
        vx, vy, vz = three(block, V, b)
        w1, w2, w3 = angular_velocity(q, four(block, P, b), i1, i2, i3)
        m, m1, m2, m3 = counted * mass, counted * i1, counted * i2, counted * i3
        power += m * (vx * ax + vy * ay + vz * az) + m1 * w1 * a1 + m2 * w2 * a2 + m3 * w3 * a3
        aa += m * (ax * ax + ay * ay + az * az) + m1 * a1 * a1 + m2 * a2 * a2 + m3 * a3 * a3
        vv += m * (vx * vx + vy * vy + vz * vz) + m1 * w1 * w1 + m2 * w2 * w2 + m3 * w3 * w3
        pushed = fx * fx + fy * fy + fz * fz > parameters.force
        turned = of_turns(t1, i1) + of_turns(t2, i2) + of_turns(t3, i3) > parameters.torque
        restless += counted if pushed or turned else 0.0
    parameters.sums[POWER] += power
    parameters.sums[AA] += aa
    parameters.sums[VV] += vv
    parameters.sums[RESTLESS] += restless


@inlined
def turn(q, w1, w2, w3, dt):
    """The quaternion q after a rotation about omega, in the principal frame, by 2 arctan of half of
    dt |omega|, which differs from that angle by its cube."""
    q0, q1, q2, q3 = product(q, (1.0, 0.5 * dt * w1, 0.5 * dt * w2, 0.5 * dt * w3))
    norm = 1.0 / sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
    return norm * q0, norm * q1, norm * q2, norm * q3


@inlined
def relax(block, kind, dt, parameters):
    """A step of the quench; no body's atoms move by more than DMAX, as a root mean square."""
    step, keep, add = parameters.step, parameters.keep, parameters.add
    if parameters.back > 0.0:
        drift(block, -parameters.back)
    for b in range(LANES):
        q, mass, (i1, i2, i3) = four(block, Q, b), block[MASS, b], three(block, MOMENT, b)
        w1, w2, w3 = angular_velocity(q, four(block, P, b), i1, i2, i3)
        q = turn(q, w1, w2, w3, -parameters.back)
        (vx, vy, vz), (ax, ay, az) = three(block, V, b), three(block, A, b)
        a1, a2, a3 = three(block, TURN, b)
        vx, vy, vz = keep * vx + add * ax, keep * vy + add * ay, keep * vz + add * az
        w1, w2, w3 = keep * w1 + add * a1, keep * w2 + add * a2, keep * w3 + add * a3
        square = vx * vx + vy * vy + vz * vz
        square += (i1 * w1 * w1 + i2 * w2 * w2 + i3 * w3 * w3) / mass
        far = step * sqrt(square)
        part = parameters.dmax / far if far > parameters.dmax else 1.0
        w1, w2, w3 = part * w1, part * w2, part * w3
        q = turn(q, w1, w2, w3, step)
        write(block, V, b, (part * vx, part * vy, part * vz))
        write(block, Q, b, q)
        write(block, P, b, quaternion_momentum(q, i1 * w1, i2 * w2, i3 * w3))
    drift(block, step)


@loop
def quench(mpi: Mpi, parameters: Quench, dt: F, sums: F1, quenches: Quenches, stop: L1) -> I:
    """Say what the step does, and end the run behind it if there is nothing to do, for this fix and
    for all others that quench."""
    add_up(mpi, parameters.sums, sums)
    power, aa, vv, restless = sums[POWER], sums[AA], sums[VV], sums[RESTLESS]
    for k in range(4):
        parameters.sums[k] = 0.0
    if aa * 0.0 != 0.0:
        return -1
    quenches.asked += 1
    quenches.undone += restless
    if quenches.asked == quenches.fixes:
        if quenches.undone == 0.0:
            call(stop[0], stop[1])
        quenches.asked, quenches.undone = 0, 0.0
    parameters.back = parameters.keep = parameters.add = 0.0
    if restless == 0.0:  # others may move what pushes these bodies
        return 0
    keep, along = 0.0, 0.0
    if parameters.steps == 0 or vv == 0.0:  # at rest, while another fix's bodies moved
        parameters.step, parameters.alpha = dt, parameters.alpha0
        parameters.steps = parameters.in_a_row = 0
    elif power > 0.0:
        keep, along = 1.0 - parameters.alpha, parameters.alpha * sqrt(vv / aa)
        parameters.in_a_row += 1
        if parameters.in_a_row > parameters.delaystep:
            parameters.step = min(parameters.dtgrow * parameters.step, parameters.tmax * dt)
            parameters.alpha *= parameters.alphashrink
    else:
        parameters.in_a_row = 0
        if parameters.steps + 1 >= parameters.delaystep:
            parameters.alpha = parameters.alpha0
            if parameters.dtshrink * parameters.step >= parameters.tmin * dt:
                parameters.step *= parameters.dtshrink
        if parameters.halfstepback > 0.0:
            parameters.back = 0.5 * parameters.step
    parameters.steps += 1
    parameters.keep = keep
    parameters.add = (keep if keep > 0.0 else 1.0) * parameters.step + along
    return 0


class FIRE(Integrator):
    """fix ID group nosquish/fire BODYSTYLE force FTOL torque TTOL ...

    It ends the run when no force and no torque on a body is above the tolerances.

    Raises:
        RunError: for missing tolerances, for numbers that cannot be, and with a LAMMPS's own fix
            python/move, which cannot end a run.
    """

    splitting, rows, respa, quenches, numbers = "A", OF_BODY, False, True, Quench
    backwards = False
    operations: Mapping[str, Operation] = {
        "A": Operation(relax, moves=True, prepared=True, measures=measure)
    }
    keywords = "force FTOL", "torque TTOL", *DEFAULTS
    method, prepares = "FIRE", quench
    unprepared = (
        "forces are so large that their squares cannot be summed: atoms stand at the same place. "
        "Move them apart by a little before the fix line (displace_atoms ... random)"
    )

    def __init__(self, ptr: Any, line: Line | str) -> None:
        self.of_all = Quenches()
        super().__init__(ptr, line)

    def own_parameters(self) -> dict[str, Any]:
        refuse(
            self.host.stop is None,
            "a LAMMPS's own fix python/move cannot end a run: install this package where its "
            "plugin serves",
        )
        problem = external.not_of_positions(self)
        refuse(problem, f"FIRE finds a minimum of an energy, and {problem}")
        for fix in self.other_fixes:
            refuse(
                fix.box_change,
                f"fix {fix.id} (style {fix.style}) changes the box, and FIRE finds a minimum "
                "in a box that stays: unfix one of the two",
            )
        words = DEFAULTS | self.command.quench
        numbers = {name: self.lammps.number(words[name]) for name in ("force", "torque", *DEFAULTS)}
        for name in "force", "torque", "dmax", "tmin":
            self.command.refuse_unless_positive(f"keyword {name}: it", numbers[name])
        for name, (low, high) in BOUNDS.items():
            if not low <= numbers[name] <= high:
                most = f" and at most {high:g}" if high < np.inf else ""
                raise self.command.wrong(
                    f"keyword {name} is {numbers[name]:g}, and must be at least {low:g}{most}"
                )
        numbers["force"] **= 2
        numbers["torque"] **= 2
        return numbers

    def own_cells(self) -> dict[str, Cell]:
        fixes = [mate for mate in self.mates if mate.quenches]
        quenches = fixes[0].of_all
        quenches.fixes, quenches.asked, quenches.undone = len(fixes), 0, 0.0
        return {
            "sums": Cell(F1, np.zeros(4)),
            "quenches": Cell(Quenches, quenches),
            "stop": Cell(L1, self.host.stop),
        }

    def norms(self) -> np.ndarray:
        """The largest force and the largest torque on a body; collective.

        A torque about an axis without a moment turns nothing, and is left out.
        """
        bodies = self.bodies
        pushes = bodies.acting[:3], bodies.turning_torque()
        norms = [np.linalg.norm(push, axis=0).max(initial=0.0) for push in pushes]
        return self.communicator.gather_to_all(np.array([norms])).max(axis=0)

    @hook
    def post_run(self) -> None:
        super().post_run()
        norms, tolerances = self.norms(), np.sqrt([self.parameters.force, self.parameters.torque])
        why = "as asked for" if (norms <= tolerances).all() else "above what was asked for"
        (force, torque), (ftol, ttol) = norms, tolerances
        self.host.log(
            f"FIRE: at step {self.lammps.step} the largest force on a body is {force:.6g} "
            f"({ftol:g}), the largest torque {torque:.6g} ({ttol:g}): {why}\n"
        )

    # ------------------------------------------------------------- what LAMMPS asks

    vector_extensive = (*Integrator.vector_extensive, False, False, False)
    vector_names = (*Integrator.vector_names, "force", "torque", "dt")

    def own_values(self) -> tuple[float, ...]:
        """The largest force and the largest torque on a body, and the time step of the quench;
        collective."""
        self.made()
        return *self.norms(), self.parameters.step
