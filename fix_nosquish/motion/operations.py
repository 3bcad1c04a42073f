"""The exactly solvable parts of a step, each for a block of bodies: kick, drift, rotation.

An operation is a function (block, kind, dt, parameters).  It advances all lanes of a block (see
`block`) of bodies of this kind by dt, in the units of the LAMMPS run.  Its parameters are the
record below, or one that extends it.
"""

from collections.abc import Callable
from typing import Any

from ..loops.compiled import F, I, inlined, record
from .block import (
    FORCE,
    LANES,
    LINEAR,
    MASS,
    MOMENT,
    OWN,
    PLANAR,
    ROTOR,
    TORQUE,
    P,
    Q,
    V,
    X,
    four,
    three,
    write,
)
from .exact_rotor import rotate_exactly
from .frames import vector_times
from .rotor import free_linear_rotor, free_rotor, permute_3, rotation, turns_little

# force to mass times acceleration, LAMMPS's force->ftm2v; inner rotation steps (m_rot), or EXACT
Parameters: Any = record("Parameters", ftm2v=F, mrot=I)
EXACT = 0
FAST = OWN  # rows of rotors too fast for the power series: q, p, number of inner steps


@inlined
def kick(block, kind, dt, parameters):
    """Velocity and quaternion momentum from force and torque (2.58).

    The torque tau is in the space frame: the four-force 2 S(q) (0, A tau) (2.60) equals the
    quaternion product 2 (0, tau) q.
    """
    dtf = dt * parameters.ftm2v
    for b in range(LANES):
        for k in range(3):
            block[V + k, b] += dtf / block[MASS, b] * block[FORCE + k, b]
        t1, t2, t3 = three(block, TORQUE, b)
        x, y, z = 2.0 * dtf * t1, 2.0 * dtf * t2, 2.0 * dtf * t3
        p0, p1, p2, p3 = four(block, P, b)
        k0, k1, k2, k3 = vector_times(x, y, z, four(block, Q, b))
        write(block, P, b, (p0 + k0, p1 + k1, p2 + k2, p3 + k3))


@inlined
def drift(block, dt):
    """Advance the centres of mass: x += dt v."""
    for k in range(3):
        for b in range(LANES):
            block[X + k, b] += dt * block[V + k, b]


def free_motion(rotate_rotors: Callable) -> Callable:
    """The operation that combines drift and free rotation.

    Args:
        rotate_rotors: free rotation of a block of rotors, an inlined function (block, dt, mrot).
    """

    @inlined
    def move(block, kind, dt, parameters):
        drift(block, dt)
        if kind == ROTOR:
            rotate_rotors(block, dt, parameters.mrot)
        elif kind == PLANAR:
            rotate_in_plane(block, dt)
        elif kind == LINEAR:
            rotate_linear(block, dt)

    return move


def rotation_by(rotor: Callable) -> Callable:
    """The free rotation of a block of rotors, from that of a single rotor.

    Bodies with small angles per inner step are advanced in all lanes at once, by power series.
    The others are advanced one by one before that.

    Args:
        rotor: an inlined function (q, p, i1, i2, i3, dt, small) that returns q and p.  No angle in
            it exceeds that of a rotation by dt.  See `rotor.free_rotor`.
    Returns:
        the argument of `free_motion`, which does mrot inner steps.
    """

    @inlined
    def rotate(block, dt, mrot):
        inner, fast = dt / mrot, 0
        for b in range(LANES):
            i1, i2, i3 = three(block, MOMENT, b)
            if not turns_little(four(block, P, b), min(i1, min(i2, i3)), inner):
                fast += 1
        if fast:
            for b in range(LANES):
                i1, i2, i3 = three(block, MOMENT, b)
                q, p = four(block, Q, b), four(block, P, b)
                turns = 0 if turns_little(p, min(i1, min(i2, i3)), inner) else mrot
                for _ in range(turns):
                    q, p = rotor(q, p, i1, i2, i3, inner, False)
                write(block, FAST, b, q)
                write(block, FAST + 4, b, p)
                block[FAST + 8, b] = turns
        for _ in range(mrot):
            for b in range(LANES):
                i1, i2, i3 = three(block, MOMENT, b)
                q, p = rotor(four(block, Q, b), four(block, P, b), i1, i2, i3, inner, True)
                write(block, Q, b, q)
                write(block, P, b, p)
        if fast:
            for b in range(LANES):
                if block[FAST + 8, b] > 0.0:
                    write(block, Q, b, four(block, FAST, b))
                    write(block, P, b, four(block, FAST + 4, b))

    return rotate


no_squish = rotation_by(free_rotor)  # (2.53), in mrot inner steps


@inlined
def rotate_rotors(block, dt, mrot):
    """Free rotation of a block of rotors, in mrot inner steps or EXACT."""
    if mrot == EXACT:
        rotate_exactly(block, dt)
    else:
        no_squish(block, dt, mrot)


@inlined
def rotate_in_plane(block, dt):
    """Exact rotation about axis 3 only, as in two dimensions: the motion under h_3 alone."""
    for b in range(LANES):
        q, p = four(block, Q, b), four(block, P, b)
        rate = 0.25 / block[MOMENT + 2, b]
        q, p = rotation(q, p, permute_3(q), permute_3(p), rate, dt, False)
        write(block, Q, b, q)
        write(block, P, b, p)


@inlined
def rotate_linear(block, dt):
    """Exact free rotation of linear bodies."""
    for b in range(LANES):
        q, p = free_linear_rotor(four(block, Q, b), four(block, P, b), block[MOMENT, b], dt)
        write(block, Q, b, q)
        write(block, P, b, p)
