"""Gear: the quaternion predictor-corrector of fifth order, beside NO_SQUISH.

Rigid molecules were moved so since Evans and Murad, Mol. Phys. 34, 327 (1977).  A body has its
centre of mass x, angular velocity omega (principal frame) and quaternion q, each with its first
five time derivatives, and the equations of motion

    d2x/dt2 = F / m                   of second order
    d omega/dt as Euler's (2.5)       of first order
    dq/dt = S(q) (0, omega) / 2       of first order

A step predicts all of them by Taylor series, has the force computed once, there, and adds to each
derivative the error of the one that the equation of motion gives, times a coefficient of Gear.  The
coefficients, for derivatives times dt^n / n!, are those for six values in the tables of Allen and
Tildesley, Computer Simulation of Liquids (1987), appendix E.  Their program F.5 is this scheme with
one derivative less, and with the predicted omega in the equation of q.  Here it is the corrected
one: with six values a libration of angular frequency w is then stable up to w dt = 0.41, and
otherwise up to 0.11, less than water has at 1 fs.

As was usual, the quaternion is normalized after the corrector and, so that the
forces are those of rigid bodies, after the predictor.  Nothing else is conserved: the scheme
is neither reversible nor symplectic.

The first step has derivatives that follow from the equations of motion as if the force and the
torque (in the principal frame) of the start stayed as they are: those of a free body are exact,
others lack the change of the force, which the corrector finds within a few steps; the energy
changes by a term of dt^2 meanwhile.  Each `run` starts so again, except with `run N pre no` and
with `reinit no`, where the derivatives go on.
"""

from collections.abc import Mapping
from math import sqrt

from fix_nosquish import of_fix_line
from fix_nosquish.loops.compiled import inlined
from fix_nosquish.motion.block import (
    BLOCK_ROWS,
    FORCE,
    LANES,
    MASS,
    MATRIX,
    MOMENT,
    TORQUE,
    P,
    Q,
    V,
    X,
    four,
    nine,
    three,
    write,
)
from fix_nosquish.motion.frames import angular_velocity, quaternion_momentum, to_body
from fix_nosquish.motion.rotor import dot, mix, s_times
from fix_nosquish.motion.step import Operation, rotation_matrices
from fix_nosquish.run.integrator import Integrator

ORDER = 5
FIRST = 95 / 288, 1.0, 25 / 24, 35 / 72, 5 / 48, 1 / 120  # for equations of first order
SECOND = (
    3 / 20,
    251 / 360,
    1.0,
    11 / 18,
    1 / 6,
    1 / 60,
)  # of second order, without velocities in them

# A body's extra rows are derivatives 1 to 5 of x, omega and q, in this order (those of x begin with
# v). To work with: TERM + WIDTH n + k is derivative n of quantity k, times dt^n / n!.
OMEGA, QUATERNION, WIDTH = 3, 6, 10
DERIVATIVE = BLOCK_ROWS
TERM = DERIVATIVE + WIDTH * ORDER
TERM_OMEGA, TERM_Q = TERM + OMEGA, TERM + QUATERNION
RIGHT = TERM + WIDTH * (ORDER + 1)  # what the corrector compares with


@inlined
def take_terms(block, dt):
    """Scale the derivatives."""
    scale = 1.0
    for n in range(ORDER):
        scale *= dt / (n + 1)
        for k in range(WIDTH):
            for b in range(LANES):
                derivative = block[DERIVATIVE + WIDTH * n + k, b]
                block[TERM + WIDTH * (n + 1) + k, b] = scale * derivative
    for b in range(LANES):
        q, (x, y, z), (vx, vy, vz) = four(block, Q, b), three(block, X, b), three(block, V, b)
        i1, i2, i3 = three(block, MOMENT, b)
        write(block, TERM, b, (x, y, z))
        write(block, TERM_Q, b, q)
        write(block, TERM_OMEGA, b, angular_velocity(q, four(block, P, b), i1, i2, i3))
        write(block, TERM + WIDTH, b, (dt * vx, dt * vy, dt * vz))


@inlined
def put_derivatives(block, dt):
    """Undo the scaling of the derivatives."""
    scale = 1.0
    for n in range(ORDER):
        scale *= dt / (n + 1)
        for k in range(WIDTH):
            for b in range(LANES):
                term = block[TERM + WIDTH * (n + 1) + k, b]
                block[DERIVATIVE + WIDTH * n + k, b] = term / scale


@inlined
def put_bodies(block, dt):
    """Set x, v, q (normalized) and p = 2 S(q) (0, I omega)."""
    for b in range(LANES):
        vx, vy, vz = three(block, TERM + WIDTH, b)
        i1, i2, i3 = three(block, MOMENT, b)
        w1, w2, w3 = three(block, TERM_OMEGA, b)
        q = four(block, TERM_Q, b)
        q = mix(1.0 / sqrt(dot(q, q)), 0.0, q, q)
        write(block, X, b, three(block, TERM, b))
        write(block, V, b, (vx / dt, vy / dt, vz / dt))
        write(block, Q, b, q)
        write(block, P, b, quaternion_momentum(q, i1 * w1, i2 * w2, i3 * w3))


@inlined
def omega_term(block, n, b, dt, ftm2v):
    """Compute term n + 1 of omega, by Euler's equations from the terms up to n.

    Term n of a product is the sum over j of its factors' terms j and n - j.  The torque is constant
    in the principal frame; there is none about an axis without moment.
    """
    i1, i2, i3 = three(block, MOMENT, b)
    a1 = a2 = a3 = 0.0
    if n == 0:
        x, y, z = three(block, TORQUE, b)
        t1, t2, t3 = to_body(nine(block, MATRIX, b), x, y, z)
        a1, a2, a3 = ftm2v * t1, ftm2v * t2, ftm2v * t3
    for j in range(n + 1):
        u1, u2, u3 = three(block, TERM_OMEGA + WIDTH * j, b)
        w1, w2, w3 = three(block, TERM_OMEGA + WIDTH * (n - j), b)
        a1, a2, a3 = a1 + (i2 - i3) * u2 * w3, a2 + (i3 - i1) * u3 * w1, a3 + (i1 - i2) * u1 * w2
    scale = dt / (n + 1)
    return (
        scale * a1 / i1 if i1 > 0.0 else 0.0,
        scale * a2 / i2 if i2 > 0.0 else 0.0,
        scale * a3 / i3 if i3 > 0.0 else 0.0,
    )


@inlined
def q_term(block, n, b, dt):
    """Compute term n + 1 of q, by its equation of motion from the terms up to n."""
    q0 = q1 = q2 = q3 = 0.0
    for j in range(n + 1):
        w1, w2, w3 = three(block, TERM_OMEGA + WIDTH * (n - j), b)
        s0, s1, s2, s3 = s_times(four(block, TERM_Q + WIDTH * j, b), w1, w2, w3)
        q0, q1, q2, q3 = q0 + s0, q1 + s1, q2 + s2, q3 + s3
    half = 0.5 * dt / (n + 1)
    return half * q0, half * q1, half * q2, half * q3


@inlined
def second_term(block, b, dt, ftm2v):
    """Compute term 2 of x, from the force."""
    half, (fx, fy, fz) = 0.5 * dt * dt * ftm2v / block[MASS, b], three(block, FORCE, b)
    return half * fx, half * fy, half * fz


@inlined
def predict_block(block):
    """Advance all Taylor series by dt: for scaled derivatives, Pascal's triangle."""
    for i in range(ORDER):
        for n in range(ORDER - 1, i - 1, -1):
            for k in range(WIDTH):
                for b in range(LANES):
                    block[TERM + WIDTH * n + k, b] += block[TERM + WIDTH * (n + 1) + k, b]


@inlined
def add_error(block, k, known, b, coefficients):
    """Add to each term of quantity k the error of the term `known`, times a coefficient.

    The term `known` follows from the equation of motion.
    """
    error = block[RIGHT + k, b] - block[TERM + WIDTH * known + k, b]
    block[TERM + k, b] += coefficients[0] * error
    block[TERM + WIDTH + k, b] += coefficients[1] * error
    block[TERM + WIDTH * 2 + k, b] += coefficients[2] * error
    block[TERM + WIDTH * 3 + k, b] += coefficients[3] * error
    block[TERM + WIDTH * 4 + k, b] += coefficients[4] * error
    block[TERM + WIDTH * 5 + k, b] += coefficients[5] * error


@inlined
def correct_block(block, dt, ftm2v):
    """Correct the prediction: x and omega, then q."""
    for b in range(LANES):
        x, y, z = second_term(block, b, dt, ftm2v)
        write(block, RIGHT, b, (x, y, z))
        w1, w2, w3 = omega_term(block, 0, b, dt, ftm2v)
        write(block, RIGHT + OMEGA, b, (w1, w2, w3))
        for k in range(OMEGA):
            add_error(block, k, 2, b, SECOND)
        for k in range(OMEGA, QUATERNION):
            add_error(block, k, 1, b, FIRST)
        write(block, RIGHT + QUATERNION, b, q_term(block, 0, b, dt))
        for k in range(QUATERNION, WIDTH):
            add_error(block, k, 1, b, FIRST)


@inlined
def predict(block, kind, dt, parameters):
    """Advance all Taylor series by dt."""
    take_terms(block, dt)
    predict_block(block)
    put_derivatives(block, dt)
    put_bodies(block, dt)


@inlined
def correct(block, kind, dt, parameters):
    """Correct the prediction with its force and torque."""
    rotation_matrices(block)
    take_terms(block, dt)
    correct_block(block, dt, parameters.ftm2v)
    put_derivatives(block, dt)
    put_bodies(block, dt)


@inlined
def start(block, kind, dt, parameters):
    """Compute the derivatives of bodies that have none yet, from force and torque."""
    rotation_matrices(block)
    take_terms(block, dt)
    ftm2v = parameters.ftm2v
    for b in range(LANES):
        write(block, TERM + 2 * WIDTH, b, second_term(block, b, dt, ftm2v))
        for n in range(ORDER):
            write(block, TERM_OMEGA + WIDTH * (n + 1), b, omega_term(block, n, b, dt, ftm2v))
            write(block, TERM_Q + WIDTH * (n + 1), b, q_term(block, n, b, dt))
    put_derivatives(block, dt)


class Gear(Integrator):
    """fix python/move "fix_nosquish_validation.schemes.gear.Gear GROUP BODYSTYLE ...", with all
    words of `NVE` but two.

    Each step ends with the corrected positions, at which no force was computed: the potential
    energy is that of the predicted ones.  Velocities that another fix changes are taken over as
    with `NVE`; the derivatives follow within a few steps.

    Raises:
        RunError: for the keywords mrot, order and rotor, which define how bodies rotate, and with
            run_style respa.
    """

    splitting = "P F C"
    operations: Mapping[str, Operation] = {
        "P": Operation(predict, moves=True, named=False),
        "C": Operation(correct, moves=True, named=False),
    }
    rows, work, starts = WIDTH * ORDER, WIDTH * (ORDER + 2), start
    method, respa = "Gear's predictor-corrector", False


__getattr__ = of_fix_line(Gear)
