"""Atoms in no body, in a box that changes: some are remapped with the box, others are not.

Atoms constrained by fix shake or rattle form a cluster, which is remapped by its centre of mass,
as a body is.  Its bonds keep their length, so the constraints do no work.
"""

from ..loops.compiled import F1, F2, I1, L1, I, call, inlined, loop
from ..motion.block import at
from ..motion.periodic import PeriodicBox
from ..structs import IN_NO_BODY
from .cell import ChangingBox, add_products, is_due, sheared, three_of, undone


@loop
def find_clusters(cluster_finder: L1):
    """Call the plugin to fill the array `clusters` for the present positions.

    Args:
        cluster_finder: (2,) address of the plugin's function, and its argument.
    """
    call(cluster_finder[0], cluster_finder[1])


@inlined
def of_cluster(clusters, atom_v, i):
    """The vector from the centre of a cluster to its atom, and the velocity of that centre.

    Args:
        clusters: (natoms, 6) both for each atom; (0, 6) without constraints.
        i: index of the atom.
    """
    if clusters.shape[0] == 0:  # each atom is its own centre
        return (0.0, 0.0, 0.0), vector(atom_v, i)
    return vector(clusters, i), (clusters[i, 3], clusters[i, 4], clusters[i, 5])


@loop
def virial_of_free_atoms(
    groups: I1, origins: L1, dilated: I, atom_x: F2, atom_v: F2, atom_f: F2, atom_mass: F1,
    type_mass: F1, type: I1, clusters: F2, cell: ChangingBox, box: PeriodicBox,
):  # fmt: skip
    """Add the contribution of atoms in no body to the sums of `cell.virial_about_centres`.

    These sums are subtracted from LAMMPS's virial, which assumes that each atom is remapped.  An
    atom that is not remapped adds the virial of its force about the centre of the box; an atom of a
    cluster adds the virial about the cluster's centre.  The kinetic contribution of remapped
    centres is added with a minus sign.  Only forces that LAMMPS's virial includes are counted: not
    those of fix langevin, for example, whose noise would act on the box.

    Args:
        dilated: bits of the groups whose atoms are remapped.
        clusters: see `of_cluster`.
    """
    barostat, h, lo = cell.barostat, box.h, box.lo
    cx = lo[0] + 0.5 * (h[0, 0] + h[0, 1] + h[0, 2])
    cy = lo[1] + 0.5 * (h[1, 1] + h[1, 2])
    cz = lo[2] + 0.5 * h[2, 2]
    for i in range(groups.size):
        if origins[i] == IN_NO_BODY:
            if groups[i] & dilated:
                m = atom_mass[i] if atom_mass.size else type_mass[type[i]]
                place, (vx, vy, vz) = of_cluster(clusters, atom_v, i)
                x, y, z = -m * barostat.unit * vx, -m * barostat.unit * vy, -m * barostat.unit * vz
                add_products(barostat, (x, y, z), (vx, vy, vz))
            else:
                x, y, z = vector(atom_x, i)
                place = x - cx, y - cy, z - cz
            add_products(barostat, place, vector(atom_f, i))


@inlined
def vector(atoms, i):
    """The three numbers of atom i in an array (natoms, 3 or more)."""
    return atoms[at(i), 0], atoms[at(i), 1], atoms[at(i), 2]


@loop
def move_free_atoms(
    groups: I1, origins: L1, dilated: I, atom_x: F2, atom_v: F2, clusters: F2, step: L1,
    cell: ChangingBox,
):  # fmt: skip
    """Remap free atoms and centres of clusters in a step in which the box changes, and scale their
    velocities by the inverse.

    Args:
        dilated, clusters: see `virial_of_free_atoms`.
    """
    barostat = cell.barostat
    if is_due(step, cell):
        shear, (f1, f2, f3) = three_of(barostat.shear), three_of(barostat.stretch)
        c1, c2, c3 = three_of(barostat.centre)
        for i in range(groups.size):
            if origins[i] == IN_NO_BODY and groups[i] & dilated:
                (dx, dy, dz), (ux, uy, uz) = of_cluster(clusters, atom_v, i)
                x, y, z = vector(atom_x, i)
                x, y, z = c1 + f1 * (x - dx - c1), c2 + f2 * (y - dy - c2), c3 + f3 * (z - dz - c3)
                sx, sy = sheared(shear, y - c2, z - c3)
                atom_x[i, 0], atom_x[i, 1], atom_x[i, 2] = x + sx + dx, y + sy + dy, z + dz
                vx, vy, vz = vector(atom_v, i)
                vx, vy, vz = vx - ux, vy - uy, vz - uz  # about the centre
                sx, sy = sheared(undone(shear), uy, uz)
                atom_v[i, 0] = (ux + sx) / f1 + vx
                atom_v[i, 1] = (uy + sy) / f2 + vy
                atom_v[i, 2] = uz / f3 + vz
