"""Atoms that are in no body, beside bodies whose box changes: some move with it, others stay."""

from ..loops.compiled import F1, F2, I1, L1, I, inlined, loop
from ..motion.block import at
from ..motion.periodic import PeriodicBox
from ..ranks.migration import IN_NO_BODY
from .cell import (
    CENTRE,
    SHEAR,
    SPREAD,
    STRETCH,
    TILT_SPREAD,
    UNIT,
    Barostat,
    is_due,
    sheared,
    three_of,
    undone,
)  # fmt: skip


@loop
def virial_of_others(
    groups: I1, origins: L1, dilated: I, atom_x: F2, atom_v: F2, atom_f: F2, atom_mass: F1,
    type_mass: F1, type: I1, cell: Barostat, box: PeriodicBox,
):  # fmt: skip
    """Have the sums of `cell.virial_about_centres` tell of atoms that are in no body, too.

    LAMMPS's virial is one for atoms that all move with the box.  So what the forces on those that
    stay do is taken from it.  The motion of those that move counts as that of points.
    """
    numbers, h, lo = cell.barostat, box.h, box.lo
    cx = lo[0] + 0.5 * (h[0, 0] + h[0, 1] + h[0, 2])
    cy = lo[1] + 0.5 * (h[1, 1] + h[1, 2])
    cz = lo[2] + 0.5 * h[2, 2]
    for i in range(groups.size):
        if origins[i] == IN_NO_BODY:
            if groups[i] & dilated:
                m = atom_mass[i] if atom_mass.size else type_mass[type[i]]
                fx, fy, fz = vector(atom_v, i)
                x, y, z = -m * numbers[UNIT] * fx, -m * numbers[UNIT] * fy, -m * numbers[UNIT] * fz
            else:
                (fx, fy, fz), (x, y, z) = vector(atom_f, i), vector(atom_x, i)
                x, y, z = x - cx, y - cy, z - cz
            numbers[SPREAD] += x * fx
            numbers[SPREAD + 1] += y * fy
            numbers[SPREAD + 2] += z * fz
            numbers[TILT_SPREAD] += y * fx
            numbers[TILT_SPREAD + 1] += z * fx
            numbers[TILT_SPREAD + 2] += z * fy


@inlined
def vector(atoms, i):
    """The three numbers of an atom."""
    return atoms[at(i), 0], atoms[at(i), 1], atoms[at(i), 2]


@loop
def move_others(
    groups: I1, origins: L1, dilated: I, atom_x: F2, atom_v: F2, step: L1, cell: Barostat
):  # fmt: skip
    """In a step in which the box changes, stretch and shear with it the atoms that move, and their
    velocities by the inverse."""
    numbers = cell.barostat
    if is_due(step, cell):
        shear = three_of(numbers, SHEAR)
        for i in range(groups.size):
            if origins[i] == IN_NO_BODY and groups[i] & dilated:
                for k in range(3):
                    centre = numbers[CENTRE + k]
                    atom_x[i, k] = centre + numbers[STRETCH + k] * (atom_x[i, k] - centre)
                y, z = atom_x[i, 1] - numbers[CENTRE + 1], atom_x[i, 2] - numbers[CENTRE + 2]
                x, y = sheared(shear, y, z)
                atom_x[i, 0] += x
                atom_x[i, 1] += y
                x, y = sheared(undone(shear), atom_v[i, 1], atom_v[i, 2])
                atom_v[i, 0] += x
                atom_v[i, 1] += y
                for k in range(3):
                    atom_v[i, k] /= numbers[STRETCH + k]
