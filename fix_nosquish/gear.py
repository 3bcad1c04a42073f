"""Gear: the quaternion predictor-corrector of fifth order, beside NO_SQUISH.

Rigid molecules were moved so since Evans and Murad, Mol. Phys. 34, 327 (1977).  A body has its centre of mass x, angular
velocity omega (principal frame) and quaternion q, each with its first five time derivatives, and the equations of motion

    d2x/dt2 = F / m                   of second order
    d omega/dt as Euler's (2.5)       of first order
    dq/dt = S(q) (0, omega) / 2       of first order

A step predicts all of them by Taylor series, has the force computed once, there, and adds to each derivative the error of the
one that the equation of motion gives, times a coefficient of Gear.  The coefficients, for derivatives times dt^n / n!, are
those for six values in the tables of Allen and Tildesley, Computer Simulation of Liquids (1987), appendix E.  Their program F.5
is this scheme with a derivative less, and with the predicted omega in the equation of q.  Here that is the corrected one: with
six values a libration of angular frequency w is stable up to w dt = 0.41 then, and otherwise up to 0.11, less than water has at 1 fs.

As was the custom the quaternion is made a unit one again, after the corrector and, so that the forces see rigid bodies,
after the predictor.  Nothing else is conserved by construction: the scheme is neither reversible nor symplectic.

The first step has derivatives that follow from the equations of motion as if the force and the torque (in the
principal frame) of the start stayed as they are: those of a free body are exact, others lack the change of the force, which the
corrector finds within a few steps; the energy changes by a term of dt^2 meanwhile.  Each `run` starts so again, except with
`run N pre no` and with `reinit no`, where the derivatives go on.
"""

from math import sqrt

import numpy as np

from .compiled import F1, F2, I1, I2, L1, F, I, inlined, loop
from .errors import RunError
from .hosts import hook
from .kernels import (
    BLOCK, FORCE, MASS, MATRIX, MOMENT, P, Q, ROWS, SCRATCH, TORQUE, V, X, body_frame_angular_velocity, four, move_to_images, nine,
    put, rotation_matrices, set_four, set_three, take, three, to_body, write_atoms,
)  # fmt: skip
from .nve import NVE
from .rotor import dot, mix, s_times

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

# Rows of scratch, behind those of `kernels`: TERM + WIDTH n + k is derivative n, times dt^n / n!, of quantity k, which are x,
# omega and q.  The state keeps derivatives 1 to 5, unscaled, in its rows from ROWS on, in this order (those of x begin with v).
OMEGA, QUATERNION, WIDTH = 3, 6, 10
TERM = SCRATCH // BLOCK
TERM_OMEGA, TERM_Q = TERM + OMEGA, TERM + QUATERNION
RIGHT = TERM + WIDTH * (ORDER + 1)  # what the corrector compares with
ALL_SCRATCH = (RIGHT + WIDTH) * BLOCK


@inlined
def take_terms(scratch, state, begin, end, dt):
    """Copy the bodies [begin, end) and their scaled derivatives; the rest of the block is filled with copies of the first."""
    take(scratch, state, begin, end, MASS, TORQUE + 3)
    rotation_matrices(scratch)
    scale = 1.0
    for n in range(ORDER):
        scale *= dt / (n + 1)
        for k in range(WIDTH):
            for b in range(BLOCK):
                derivative = state[ROWS + WIDTH * n + k, begin + (b if b < end - begin else 0)]
                scratch[(TERM + WIDTH * (n + 1) + k) * BLOCK + b] = scale * derivative
    for b in range(BLOCK):
        q, (x, y, z), (vx, vy, vz) = four(scratch, Q, b), three(scratch, X, b), three(scratch, V, b)
        i1, i2, i3 = three(scratch, MOMENT, b)
        w1, w2, w3 = body_frame_angular_velocity(q, four(scratch, P, b), i1, i2, i3)
        set_three(scratch, TERM, b, x, y, z)
        set_four(scratch, TERM_Q, b, q)
        set_three(scratch, TERM_OMEGA, b, w1, w2, w3)
        set_three(scratch, TERM + WIDTH, b, dt * vx, dt * vy, dt * vz)


@inlined
def put_derivatives(scratch, state, begin, end, dt):
    """Copy the derivatives back."""
    scale = 1.0
    for n in range(ORDER):
        scale *= dt / (n + 1)
        for k in range(WIDTH):
            for b in range(end - begin):
                state[ROWS + WIDTH * n + k, begin + b] = (
                    scratch[(TERM + WIDTH * (n + 1) + k) * BLOCK + b] / scale
                )


@inlined
def put_bodies(scratch, state, begin, end, dt):
    """Copy x, v, q (made a unit quaternion) and p = 2 S(q) (0, I omega) back."""
    for b in range(BLOCK):
        (x, y, z), (vx, vy, vz) = three(scratch, TERM, b), three(scratch, TERM + WIDTH, b)
        i1, i2, i3 = three(scratch, MOMENT, b)
        w1, w2, w3 = three(scratch, TERM_OMEGA, b)
        q = four(scratch, TERM_Q, b)
        q = mix(1.0 / sqrt(dot(q, q)), 0.0, q, q)
        set_three(scratch, X, b, x, y, z)
        set_three(scratch, V, b, vx / dt, vy / dt, vz / dt)
        set_four(scratch, Q, b, q)
        set_four(scratch, P, b, s_times(q, 2.0 * i1 * w1, 2.0 * i2 * w2, 2.0 * i3 * w3))
    put(scratch, state, begin, end, X, P + 4, X)


@inlined
def omega_term(scratch, n, b, dt, ftm2v):
    """Term n + 1 of omega, by Euler's equations from the terms up to n (of a product: the sum over j of its factors' terms j and
    n - j), with a torque that stays as it is in the principal frame; none about an axis without moment."""
    i1, i2, i3 = three(scratch, MOMENT, b)
    a1 = a2 = a3 = 0.0
    if n == 0:
        x, y, z = three(scratch, TORQUE, b)
        t1, t2, t3 = to_body(nine(scratch, MATRIX, b), x, y, z)
        a1, a2, a3 = ftm2v * t1, ftm2v * t2, ftm2v * t3
    for j in range(n + 1):
        u1, u2, u3 = three(scratch, TERM_OMEGA + WIDTH * j, b)
        w1, w2, w3 = three(scratch, TERM_OMEGA + WIDTH * (n - j), b)
        a1, a2, a3 = a1 + (i2 - i3) * u2 * w3, a2 + (i3 - i1) * u3 * w1, a3 + (i1 - i2) * u1 * w2
    scale = dt / (n + 1)
    return (
        scale * a1 / i1 if i1 > 0.0 else 0.0,
        scale * a2 / i2 if i2 > 0.0 else 0.0,
        scale * a3 / i3 if i3 > 0.0 else 0.0,
    )


@inlined
def q_term(scratch, n, b, dt):
    """Term n + 1 of q, by its equation of motion from the terms up to n."""
    q0 = q1 = q2 = q3 = 0.0
    for j in range(n + 1):
        w1, w2, w3 = three(scratch, TERM_OMEGA + WIDTH * (n - j), b)
        s0, s1, s2, s3 = s_times(four(scratch, TERM_Q + WIDTH * j, b), w1, w2, w3)
        q0, q1, q2, q3 = q0 + s0, q1 + s1, q2 + s2, q3 + s3
    half = 0.5 * dt / (n + 1)
    return half * q0, half * q1, half * q2, half * q3


@inlined
def second_term(scratch, b, dt, ftm2v):
    """Term 2 of x, from the force."""
    half, (fx, fy, fz) = 0.5 * dt * dt * ftm2v / scratch[MASS * BLOCK + b], three(scratch, FORCE, b)
    return half * fx, half * fy, half * fz


@inlined
def predict_block(scratch):
    """All Taylor series dt later: of scaled derivatives, Pascal's triangle."""
    for i in range(ORDER):
        for n in range(ORDER - 1, i - 1, -1):
            for k in range(WIDTH * BLOCK):
                scratch[(TERM + WIDTH * n) * BLOCK + k] += scratch[
                    (TERM + WIDTH * (n + 1)) * BLOCK + k
                ]


@inlined
def add_error(scratch, k, known, b, coefficients):
    """Add to each term of quantity k the error of the term `known`, which the equation of motion gave, times a coefficient."""
    error = scratch[(RIGHT + k) * BLOCK + b] - scratch[(TERM + WIDTH * known + k) * BLOCK + b]
    scratch[(TERM + k) * BLOCK + b] += coefficients[0] * error
    scratch[(TERM + WIDTH + k) * BLOCK + b] += coefficients[1] * error
    scratch[(TERM + WIDTH * 2 + k) * BLOCK + b] += coefficients[2] * error
    scratch[(TERM + WIDTH * 3 + k) * BLOCK + b] += coefficients[3] * error
    scratch[(TERM + WIDTH * 4 + k) * BLOCK + b] += coefficients[4] * error
    scratch[(TERM + WIDTH * 5 + k) * BLOCK + b] += coefficients[5] * error


@inlined
def correct_block(scratch, dt, ftm2v):
    """Correct what was predicted: x and omega, then q."""
    for b in range(BLOCK):
        x, y, z = second_term(scratch, b, dt, ftm2v)
        set_three(scratch, RIGHT, b, x, y, z)
        w1, w2, w3 = omega_term(scratch, 0, b, dt, ftm2v)
        set_three(scratch, RIGHT + OMEGA, b, w1, w2, w3)
        for k in range(OMEGA):
            add_error(scratch, k, 2, b, SECOND)
        for k in range(OMEGA, QUATERNION):
            add_error(scratch, k, 1, b, FIRST)
        set_four(scratch, RIGHT + QUATERNION, b, q_term(scratch, 0, b, dt))
        for k in range(QUATERNION, WIDTH):
            add_error(scratch, k, 1, b, FIRST)


@loop
def start(state: F2, blocks: I2, dt: F, ftm2v: F, scratch: F1):
    """Find the derivatives of bodies that have none yet, from force and torque."""
    for k in range(blocks.shape[0] - 1):
        begin, end = blocks[k, 0], blocks[k + 1, 0]
        take_terms(scratch, state, begin, end, dt)
        for b in range(BLOCK):
            fx, fy, fz = second_term(scratch, b, dt, ftm2v)
            set_three(scratch, TERM + 2 * WIDTH, b, fx, fy, fz)
            for n in range(ORDER):
                w1, w2, w3 = omega_term(scratch, n, b, dt, ftm2v)
                set_three(scratch, TERM_OMEGA + WIDTH * (n + 1), b, w1, w2, w3)
                set_four(scratch, TERM_Q + WIDTH * (n + 1), b, q_term(scratch, n, b, dt))
        put_derivatives(scratch, state, begin, end, dt)


@loop
def step(
    corrects: I, state: F2, blocks: I2, rounds: I1, index: I1, d: F2, away: I1, shift: F2, aways: L1, atom_x: F2, dt: F, ftm2v: F,
    scratch: F1,
):  # fmt: skip
    """Correct the bodies with force and torque, or predict them a step later, and place their atoms."""
    for k in range(blocks.shape[0] - 1):
        begin, end = blocks[k, 0], blocks[k + 1, 0]
        take_terms(scratch, state, begin, end, dt)
        if corrects:
            correct_block(scratch, dt, ftm2v)
        else:
            predict_block(scratch)
        put_derivatives(scratch, state, begin, end, dt)
        put_bodies(scratch, state, begin, end, dt)
        rotation_matrices(scratch)
        write_atoms(scratch, X, blocks[k, 1], blocks[k + 1, 1], rounds, index, d, atom_x)
    move_to_images(away, shift, aways, index, atom_x)


class Gear(NVE):
    """fix python/move "fix_nosquish.Gear GROUP BODYSTYLE ...", with the words of `NVE` except mrot and order, and its outputs.

    Each step ends with the corrected positions, at which no force was computed: the potential energy is that of the predicted ones.
    Velocities that another fix changes are taken over as with `NVE`; the derivatives follow within a few steps.

    Raises:
        RunError: for the keywords mrot and order, which tell how rotations are split, and with run_style respa.
    """

    more_rows, method, splits = WIDTH * ORDER, "Gear's predictor-corrector", False

    @hook
    def _begin(self, words):
        super()._begin(words)
        if (self.command.mrot, self.command.order) != (1, 321):
            raise RunError(
                f'keywords mrot and order are for integrators that split the rotation, which Gear does not (in "fix_nosquish.{words}")',
                everywhere=True,
            )

    @hook
    def init(self):
        """As `NVE.init`."""
        if self.lammps.respa_dt is not None:
            raise RunError(
                "fix_nosquish.Gear takes one force a step, not those of levels: use run_style verlet",
                everywhere=True,
            )
        super().init()

    def _build(self):
        super()._build()
        self._started = False

    @hook
    def setup(self, vflag):
        """As `NVE.setup`."""
        super().setup(vflag)
        if not self._started:
            start(
                self.bodies.state,
                self.bodies.blocks,
                self.dt,
                self.lammps.ftm2v,
                np.empty(ALL_SCRATCH),
            )
            self._started = True

    def _bind(self):
        loops = super()._bind()
        more = {"ftm2v": self.lammps.ftm2v, "scratch": np.empty(ALL_SCRATCH)}
        # a step's first half is the prediction, its second half the correction
        loops.advance, loops.kick = (
            step.bind_to(loops.cells, corrects=corrects, **more) for corrects in (False, True)
        )
        return loops

    def _kick(self, dt):
        """Nothing to do: predicted velocities are those of the end of the step."""

    def _leave_to_host(self):
        """Nothing: both halves of a step move the atoms."""
