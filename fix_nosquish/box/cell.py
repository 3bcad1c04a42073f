"""The box of an integrator at constant pressure: its parameters, pressure, and deformation.

The pressure is the molecular pressure, from the translational kinetic energy of the bodies and the
virial of the forces on their centres of mass.  `crescale` and `mtk` implement the barostats.
"""

from math import floor
from typing import Any, NamedTuple

from ..loops.compiled import F1, F2, L1, F, I, address, call, inlined, loop, record
from ..motion.block import IMAGE, Layout, Q, at, take
from ..motion.periodic import PeriodicBox, invert, reflag
from ..motion.step import displaced, rotation_matrices

# components that can change: three axes, three tilts; upper triangular matrices use this order
XX, YY, ZZ, XY, XZ, YZ, COMPONENTS = range(7)
BarostatNumbers: Any = record(
    "BarostatNumbers",
    p_start=(F, 6),  # pressure at the start and the end of the run, energy per volume
    p_stop=(F, 6),
    axes=(I, 6),  # group of coupled components, 0 to 5; -1 for a component that does not change
    weight=(F, 6),  # number of k T / volume that the Jacobian adds to the pressure of an axis
    rate=F,  # compressibility / damping time; for a piston, 1 / damping time
    unit=F,  # energy per mass times velocity squared, LAMMPS's force->mvv2e
    box_every=I,  # steps between two changes of the box
    dimension=I,
    tilted=I,  # whether tilts change
    sums=(F, 12),  # of this rank and of all ranks, see `motion_of` and `spread_of`
    total=(F, 12),
    stretch=(F, 3),  # factors of the axes
    shear=(F, 3),  # shear after the stretch: xy, xz, yz
    centre=(F, 3),
    broken=I,  # whether a factor or a shear was out of bounds
    open=I,  # whether the box has changed and the new forces are not yet known
)
OUT_OF_BOUNDS = -2  # return value of the loops if `broken`
MOST = 2.0  # largest factor by which an axis may change at once; 1 / MOST is the smallest
FLIP = 0.6  # tilt, as a fraction of an edge, above which the box is flipped, as in LAMMPS's fixes


class ChangingBox(NamedTuple):
    """The box of a barostat.

    Attributes:
        barostat: the record.
        forces_virial: (6,) virial of LAMMPS's forces, summed over ranks (xx yy zz xy xz yz).
        new_box: (12,) lowest and highest coordinates; tilts xy, xz, yz; for a flip, the numbers of
            box vectors to add: a to b, a to c, b to c.
        set_box: (2,) address of the function that sets LAMMPS's box, and its first argument.
        flip_box: (2,) the same for a flip.
    """

    barostat: BarostatNumbers
    forces_virial: F1
    new_box: F1
    set_box: L1
    flip_box: L1


@inlined
def motion_of(sums):
    """Twice the translational kinetic energy tensor, sum of m v_i v_j (xx yy zz xy xz yz), (6,)."""
    return sums[0:6]


@inlined
def spread_of(sums):
    """The virial of the forces about the centres of mass (xx yy zz xy xz yz), (6,)."""
    return sums[6:12]


@loop
def virial_about_centres(layout: Layout, atom_f: F2, barostat: BarostatNumbers):
    """Compute the virial of the forces on this rank's atoms about their bodies' centres of mass."""
    block, blocks, rounds, d = layout.block, layout.blocks, layout.rounds, layout.displace
    for k in range(COMPONENTS):
        spread_of(barostat.sums)[k] = 0.0
    for k in range(blocks.shape[0] - 1):
        take(layout, k, Q, Q + 4, Q)
        rotation_matrices(block)
        for r in range(blocks[k, 1], blocks[k + 1, 1]):
            for b in range(rounds[r + 1] - rounds[r]):
                j = rounds[r] + b
                i = at(layout.index[at(j)])
                force = atom_f[i, 0], atom_f[i, 1], atom_f[i, 2]
                add_products(barostat, displaced(block, b, d, j), force)


@inlined
def add_products(barostat, place, force):
    """Add products of position and force components to the sums: xx, yy, zz, xy, xz, yz.

    The tilt xy moves an atom along x in proportion to its y.  Its virial is therefore y times the
    force along x.
    """
    (x, y, z), (fx, fy, fz) = place, force
    spread = spread_of(barostat.sums)
    spread[XX] += x * fx
    spread[YY] += y * fy
    spread[ZZ] += z * fz
    spread[XY] += y * fx
    spread[XZ] += z * fx
    spread[YZ] += z * fy


@inlined
def is_due(step, cell):
    """Whether the box changes in this step."""
    return (step[0] - 1) % cell.barostat.box_every == 0


@inlined
def three_of(numbers):
    """The first three of some numbers."""
    return numbers[0], numbers[1], numbers[2]


@inlined
def volume_of(box, barostat):
    """The volume of the box, in two dimensions its area."""
    return box.h[0, 0] * box.h[1, 1] * (box.h[2, 2] if barostat.dimension == 3 else 1.0)


@inlined
def pressure_now(barostat, k, part):
    """The target pressure of component k, when the fraction `part` of the run is over."""
    return barostat.p_start[k] + part * (barostat.p_stop[k] - barostat.p_start[k])


@inlined
def is_in_bounds(barostat):
    """Whether all changes of axes and tilts are finite and within bounds."""
    inside = True
    for k in range(3):
        inside &= 1.0 / MOST < barostat.stretch[k] < MOST and abs(barostat.shear[k]) < MOST - 1.0
    return inside


@inlined
def stretch_box(cell, box, shift):
    """Stretch the box about its centre, then shear it; update shifts of images and LAMMPS's box.

    Returns:
        OUT_OF_BOUNDS if a factor or a shear is or has been out of bounds, else 0.
    """
    h, lo, barostat = box.h, box.lo, cell.barostat
    if barostat.broken or not is_in_bounds(barostat):
        barostat.broken = 1
        return OUT_OF_BOUNDS
    for k in range(3):
        factor, centre = barostat.stretch[k], lo[k]
        for i in range(3):
            centre += 0.5 * h[k, i]
        barostat.centre[k] = centre
        lo[k] = centre + factor * (lo[k] - centre)
        for i in range(3):
            h[k, i] *= factor
        for i in range(shift.shape[0]):
            shift[i, k] *= factor
    if barostat.tilted:
        shear_box(barostat, h, lo, shift)
    update_new_box(box, cell.new_box)
    call(cell.set_box[0], cell.set_box[1], address(cell.new_box))
    barostat.open = 1
    return 0


@inlined
def update_new_box(box, new_box):
    """Update the inverse of the box vectors, and `new_box` for LAMMPS."""
    h, lo = box.h, box.lo
    for k in range(3):
        new_box[k], new_box[3 + k] = lo[k], lo[k] + h[k, k]
        h[k, k] = new_box[3 + k] - lo[k]  # rounded as in LAMMPS
    new_box[6], new_box[7], new_box[8] = h[0, 1], h[0, 2], h[1, 2]
    invert(h, box.inverse)


@inlined
def shear_box(barostat, h, lo, shift):
    """Shear the box about its centre."""
    shear = three_of(barostat.shear)
    x, y = sheared(shear, lo[1] - barostat.centre[1], lo[2] - barostat.centre[2])
    lo[0] += x
    lo[1] += y
    for k in range(3):
        x, y = sheared(shear, h[1, k], h[2, k])
        h[0, k] += x
        h[1, k] += y
    shear_rows(shift.T, 0, shift.shape[0], shear, 0.0, 0.0)


@inlined
def sheared(shear, y, z):
    """The displacement along x and y by a shear, at y and z relative to its centre."""
    xy, xz, yz = shear
    return xy * y + xz * z, yz * z


@inlined
def undone(shear):
    """The inverse of a shear."""
    xy, xz, yz = shear
    return -xy, xy * yz - xz, -yz


@inlined
def shear_rows(vectors, row, lanes, shear, y0, z0):
    """Shear the vectors in three rows, beginning with `row`, about y0 and z0."""
    for b in range(lanes):
        x, y = sheared(shear, vectors[row + 1, b] - y0, vectors[row + 2, b] - z0)
        vectors[row, b] += x
        vectors[row + 1, b] += y


@inlined
def add_motion(sums, m, x, y, z):
    """Add m v_i v_j of the velocity (x, y, z) to the sums (xx yy zz xy xz yz)."""
    xx, yy, zz, xy, xz, yz = sums
    return (
        xx + m * x * x, yy + m * y * y, zz + m * z * z,
        xy + m * x * y, xz + m * x * z, yz + m * y * z,
    )  # fmt: skip


@loop
def flip(state: F2, cell: ChangingBox, box: PeriodicBox) -> I:
    """Flip the box where a tilt has become large: choose other vectors of the same lattice.

    No body moves; only image flags change, because they count box vectors.  The box keeps its
    centre, about which it stretches, so that a time-reversed run, which flips at other steps, has
    the same trajectory.
    """
    h, lo, new = box.h, box.lo, cell.new_box
    yz = -floor(h[1, 2] / h[1, 1] + 0.5) if abs(h[1, 2]) > FLIP * h[1, 1] else 0.0
    tilt = h[0, 2] + yz * h[0, 1]
    xz = -floor(tilt / h[0, 0] + 0.5) if abs(tilt) > FLIP * h[0, 0] else 0.0
    xy = -floor(h[0, 1] / h[0, 0] + 0.5) if abs(h[0, 1]) > FLIP * h[0, 0] else 0.0
    if xy == 0.0 and xz == 0.0 and yz == 0.0:
        return 0
    lo[0] += 0.5 * (h[0, 2] - tilt - (xy + xz) * h[0, 0])
    lo[1] -= 0.5 * yz * h[1, 1]
    h[0, 2] = tilt + xz * h[0, 0]
    h[1, 2] += yz * h[1, 1]
    h[0, 1] += xy * h[0, 0]
    reflag(state, IMAGE, xy, xz, yz)
    update_new_box(box, new)
    new[9], new[10], new[11] = xy, xz, yz
    call(cell.flip_box[0], cell.flip_box[1], address(new))
    return 0
