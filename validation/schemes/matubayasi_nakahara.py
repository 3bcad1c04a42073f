"""MatubayasiNakahara: the reversible scheme of Matubayasi and Nakahara, beside NO_SQUISH.

J. Chem. Phys. 110, 3291 (1999).

Reference 12 of Miller et al. (2002), in that paper's form: a body's orientation is the quaternion q
and the angular velocity omega in the principal frame, which obey (2.5).  Their Liouville operator
is split into four parts (2.61):

    iL_1    dq/dt = S(q) (0, omega) / 2
    iL_2    d omega_x/dt = (I_y - I_z) / I_x omega_y omega_z
            d omega_y/dt = (I_z - I_y) / I_y omega_x omega_z
    iL_3    d omega_y/dt = (I_y - I_x) / I_y omega_x omega_z
            d omega_z/dt = (I_x - I_y) / I_z omega_x omega_y
    iL_4    d omega_k/dt = tau_k / I_k

Each part alone is solved exactly: iL_2 and iL_3 leave one component of omega as it is and turn the
other two along an ellipse.  They are combined as in (2.53), which "an approximate evolution
operator analogous to (2.53)" is taken to mean:

    exp(iL_4 dt/2)
        [exp(iL_3 h/2) exp(iL_2 h/2) exp(iL_1 h) exp(iL_2 h/2) exp(iL_3 h/2)]^mrot
        exp(iL_4 dt/2),   h = dt/mrot

No part changes a volume in the space of (q, omega), and the product is a palindrome: the scheme is
time-reversible and preserves phase-space volume.  But the parts are no Hamiltonian motions, so it
is not symplectic.  A free body keeps its kinetic energy, as iL_2 and iL_3 both do, and not its
angular momentum in space (with NO_SQUISH it is the other way round).

(x, y, z) are the principal axes 1, 2, 3 with I_1 >= I_2 >= I_3 (with `order 123` in reverse).  Of a
linear body's rotation and that in a plane only iL_1 is left, about an axis that stays: the exact
rotation that NVE has.  iL_4 is NVE's kick, since p = 2 S(q) (0, I omega): the bodies' state
stores omega as this p.
"""

from collections.abc import Mapping
from math import sqrt

from fix_nosquish import of_fix_line
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.loops.compiled import inlined
from fix_nosquish.motion.block import LANES, MOMENT, P, Q, four, three, write
from fix_nosquish.motion.frames import angular_velocity, quaternion_momentum
from fix_nosquish.motion.operations import free_motion
from fix_nosquish.motion.rotor import dot, mix, s_times, sine_and_versine, turn
from fix_nosquish.motion.step import Operation


@inlined
def along_ellipse(a, b, moment_a, moment_b, rate, dt):
    """Two components of omega after dt.

    da/dt = rate / moment_a b and db/dt = -rate / moment_b a.
    """
    s, versine = sine_and_versine(dt * rate / sqrt(moment_a * moment_b), False)
    shape = sqrt(moment_b / moment_a)
    return a + (s * shape * b - versine * a), b - (s / shape * a + versine * b)


@inlined
def turned(q, wx, wy, wz, dt):
    """q after dt with this omega."""
    w = sqrt(wx * wx + wy * wy + wz * wz)
    if w == 0.0:
        return q
    s, versine = sine_and_versine(0.5 * dt * w, False)
    return turn(s, versine, q, s_times(q, wx / w, wy / w, wz / w))


@inlined
def rotate(block, dt, mrot):
    """Rotate a block of free rotors."""
    h = dt / mrot
    for b in range(LANES):
        ix, iy, iz = three(block, MOMENT, b)
        q = four(block, Q, b)
        wx, wy, wz = angular_velocity(q, four(block, P, b), ix, iy, iz)
        for _ in range(mrot):
            wz, wy = along_ellipse(wz, wy, iz, iy, (ix - iy) * wx, 0.5 * h)  # iL_3
            wx, wy = along_ellipse(wx, wy, ix, iy, (iy - iz) * wz, 0.5 * h)  # iL_2
            q = turned(q, wx, wy, wz, h)  # iL_1
            wx, wy = along_ellipse(wx, wy, ix, iy, (iy - iz) * wz, 0.5 * h)  # iL_2
            wz, wy = along_ellipse(wz, wy, iz, iy, (ix - iy) * wx, 0.5 * h)  # iL_3
        # otherwise rounding errors of |q| would accumulate in omega
        q = mix(1.0 / sqrt(dot(q, q)), 0.0, q, q)
        write(block, Q, b, q)
        write(block, P, b, quaternion_momentum(q, ix * wx, iy * wy, iz * wz))


class MatubayasiNakahara(NVE):
    """fix python/move "fix_nosquish_validation.schemes.matubayasi_nakahara.MatubayasiNakahara GROUP
    BODYSTYLE ...", as `NVE`."""

    operations: Mapping[str, Operation] = {
        **NVE.operations,
        "A": Operation(free_motion(rotate), moves=True, named=False),
    }
    method = "Matubayasi and Nakahara's scheme"


__getattr__ = of_fix_line(MatubayasiNakahara)
