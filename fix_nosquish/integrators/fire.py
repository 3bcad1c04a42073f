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

from math import sqrt

import numpy as np

from ..errors import RunError
from ..host.hosts import hook
from ..loops.compiled import F1, L1, Cell, F, I, call, inlined, loop
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
    matrices,
    product,
    quaternion_momentum,
    rotation_matrix,
    to_body,
)
from ..motion.operations import FTM2V, PARAMETERS, drift
from ..motion.step import Operation
from ..ranks.mpi import Mpi, add_up
from ..run.integrator import Integrator

# parameters behind those of `operations`: squares of the tolerances, and what other words say; the
# time step and alpha now; steps of the run, and in a row with power; of this rank's bodies v . a,
# a . a, v . v, and how many are pushed or turned by more than the tolerances; what a step does: for
# how long it goes back, what it keeps of v and what it adds of a
FTOL, TTOL, DMAX, TMAX, TMIN, DTGROW, DTSHRINK, ALPHA_0, ALPHASHRINK, DELAYSTEP, HALFSTEPBACK = (
    range(PARAMETERS, PARAMETERS + 11)
)
STEP, ALPHA, STEPS, IN_A_ROW = range(HALFSTEPBACK + 1, HALFSTEPBACK + 5)
POWER, AA, VV, RESTLESS = SUMS = range(IN_A_ROW + 1, IN_A_ROW + 5)
BACK, KEEP, ADD, END = range(RESTLESS + 1, RESTLESS + 5)
# of all such fixes: how many they are, how many of them have asked for this step, and how many
# bodies of these are pushed or turned
FIXES, ASKED, UNDONE = QUENCHES = range(3)
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
    unit = parameters[FTM2V]
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
        pushed = fx * fx + fy * fy + fz * fz > parameters[FTOL]
        turned = of_turns(t1, i1) + of_turns(t2, i2) + of_turns(t3, i3) > parameters[TTOL]
        restless += counted if pushed or turned else 0.0
    parameters[POWER] += power
    parameters[AA] += aa
    parameters[VV] += vv
    parameters[RESTLESS] += restless


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
    step, keep, add = parameters[STEP], parameters[KEEP], parameters[ADD]
    if parameters[BACK] > 0.0:
        drift(block, -parameters[BACK])
    for b in range(LANES):
        q, mass, (i1, i2, i3) = four(block, Q, b), block[MASS, b], three(block, MOMENT, b)
        w1, w2, w3 = angular_velocity(q, four(block, P, b), i1, i2, i3)
        q = turn(q, w1, w2, w3, -parameters[BACK])
        (vx, vy, vz), (ax, ay, az) = three(block, V, b), three(block, A, b)
        a1, a2, a3 = three(block, TURN, b)
        vx, vy, vz = keep * vx + add * ax, keep * vy + add * ay, keep * vz + add * az
        w1, w2, w3 = keep * w1 + add * a1, keep * w2 + add * a2, keep * w3 + add * a3
        square = vx * vx + vy * vy + vz * vz
        square += (i1 * w1 * w1 + i2 * w2 * w2 + i3 * w3 * w3) / mass
        far = step * sqrt(square)
        part = parameters[DMAX] / far if far > parameters[DMAX] else 1.0
        w1, w2, w3 = part * w1, part * w2, part * w3
        q = turn(q, w1, w2, w3, step)
        write(block, V, b, (part * vx, part * vy, part * vz))
        write(block, Q, b, q)
        write(block, P, b, quaternion_momentum(q, i1 * w1, i2 * w2, i3 * w3))
    drift(block, step)


@loop
def quench(mpi: Mpi, parameters: F1, dt: F, sums: F1, quenches: F1, stop: L1) -> I:
    """Say what the step does, and end the run behind it if there is nothing to do, for this fix and
    for all others that quench."""
    add_up(mpi, parameters[POWER : RESTLESS + 1], sums)
    power, aa, vv, restless = sums[0], sums[1], sums[2], sums[3]
    for k in range(4):
        parameters[POWER + k] = 0.0
    if aa * 0.0 != 0.0:
        return -1
    quenches[ASKED] += 1.0
    quenches[UNDONE] += restless
    if quenches[ASKED] == quenches[FIXES]:
        if quenches[UNDONE] == 0.0:
            call(stop[0], stop[1])
        quenches[ASKED] = quenches[UNDONE] = 0.0
    parameters[BACK] = parameters[KEEP] = parameters[ADD] = 0.0
    if restless == 0.0:  # others may move what pushes these bodies
        return 0
    delay, keep, along = parameters[DELAYSTEP], 0.0, 0.0
    if parameters[STEPS] == 0.0 or vv == 0.0:  # at rest, while another fix's bodies moved
        parameters[STEP], parameters[ALPHA] = dt, parameters[ALPHA_0]
        parameters[STEPS] = parameters[IN_A_ROW] = 0.0
    elif power > 0.0:
        keep, along = 1.0 - parameters[ALPHA], parameters[ALPHA] * sqrt(vv / aa)
        parameters[IN_A_ROW] += 1.0
        if parameters[IN_A_ROW] > delay:
            parameters[STEP] = min(parameters[DTGROW] * parameters[STEP], parameters[TMAX] * dt)
            parameters[ALPHA] *= parameters[ALPHASHRINK]
    else:
        parameters[IN_A_ROW] = 0.0
        if parameters[STEPS] + 1.0 >= delay:
            parameters[ALPHA], shorter = (
                parameters[ALPHA_0],
                parameters[DTSHRINK] * parameters[STEP],
            )
            if shorter >= parameters[TMIN] * dt:
                parameters[STEP] = shorter
        if parameters[HALFSTEPBACK] > 0.0:
            parameters[BACK] = 0.5 * parameters[STEP]
    parameters[STEPS] += 1.0
    parameters[KEEP] = keep
    parameters[ADD] = (keep if keep > 0.0 else 1.0) * parameters[STEP] + along
    return 0


class FIRE(Integrator):
    """fix ID group nosquish/fire BODYSTYLE force FTOL torque TTOL ...

    It ends the run when no force and no torque on a body is above the tolerances.

    Raises:
        RunError: for missing tolerances, for numbers that cannot be, and with a LAMMPS's own fix
            python/move, which cannot end a run.
    """

    splitting, rows, respa, quenches = "A", OF_BODY, False, True
    backwards = False
    operations = {"A": Operation(relax, moves=True, prepared=True, measures=measure)}  # noqa: RUF012
    keywords = "force FTOL", "torque TTOL", *DEFAULTS
    method, prepares = "FIRE", quench
    unprepared = (
        "forces are so large that their squares cannot be summed: atoms stand at the same place. "
        "Move them apart by a little before the fix line (displace_atoms ... random)"
    )

    def __init__(self, ptr, line):
        self.of_all = np.zeros(len(QUENCHES))
        super().__init__(ptr, line)

    def own_parameters(self):
        if self.host.stop is None:
            raise RunError(
                "a LAMMPS's own fix python/move cannot end a run: install this package where its "
                "plugin serves",
                everywhere=True,
            )
        for fix in self.other_fixes:
            if fix.box_change:
                raise RunError(
                    f"fix {fix.id} (style {fix.style}) changes the box, and FIRE finds a minimum "
                    "in a box that stays: unfix one of the two",
                    everywhere=True,
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
        return *numbers.values(), *[0.0] * (END - STEP)

    def own_cells(self):
        fixes = [mate for mate in self.mates if mate.quenches]
        quenches = fixes[0].of_all
        quenches[:] = len(fixes), 0.0, 0.0
        return {
            "sums": Cell(F1, np.zeros(len(SUMS))),
            "quenches": Cell(F1, quenches),
            "stop": Cell(L1, self.host.stop),
        }

    def norms(self):
        """The largest force and the largest torque on a body; collective.

        A torque about an axis without a moment turns nothing, and is left out.
        """
        bodies = self.bodies
        torque = np.array(to_body(matrices(bodies.q).reshape(9, -1), *bodies.torque))
        pushes = bodies.force, torque * (bodies.moment > 0)
        norms = [np.linalg.norm(push, axis=0).max(initial=0.0) for push in pushes]
        return self.communicator.gather_to_all(np.array([norms])).max(axis=0)

    @hook
    def post_run(self):
        super().post_run()
        norms, tolerances = self.norms(), np.sqrt(self.parameters[[FTOL, TTOL]])
        why = "as asked for" if (norms <= tolerances).all() else "above what was asked for"
        (force, torque), (ftol, ttol) = norms, tolerances
        self.host.log(
            f"FIRE: at step {self.lammps.step} the largest force on a body is {force:.6g} "
            f"({ftol:g}), the largest torque {torque:.6g} ({ttol:g}): {why}\n"
        )

    # ------------------------------------------------------------- what LAMMPS asks

    vector_extensive = (*Integrator.vector_extensive, False, False, False)

    @hook
    def compute_vector(self, i):
        """As of `Integrator`, and behind it the largest force and the largest torque on a body, and
        the time step of the quench; collective."""
        own = i - len(Integrator.vector_extensive)
        if own < 0:
            return super().compute_vector(i)
        self.reports.made()
        return (*self.norms(), self.parameters[STEP])[own]
