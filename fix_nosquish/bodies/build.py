"""How bodies are made of LAMMPS's atoms: image, mass, centre of mass, inertia, principal frame."""

import numpy as np

from ..errors import RunError
from ..loops import machine_code
from ..motion.frames import product
from . import extended, infile, principal
from .bodies import (
    HOME,
    ID,
    IMAGE,
    MASS,
    MOMENT,
    NATOMS,
    ROWS,
    Bodies,
    Q,
    X,
    matrices,
    quaternions,
)
from .extended import particles_of
from .members import find_members, sharers_of
from .membership import POINTS
from .shapes import keep
from .unfold import unfold

_OFF_CENTRE = 2.0  # radii of gyration that a centre of mass may be from that of the atoms
_OFF_POINT = 1e-3  # of the box, that it may be from a single atom: the file has few digits
TURN = 0.08  # rad in a step, of keyword moments step: TIP3P with 6 amu A^2 at 298 K and 12 fs
_SAME_PLACE = 1e-12  # atoms closer than this part of the box are at one point


def build(
    lammps, communicator, membership, path=None, own_rows=0, former=None, atoms=None,
    shapes=None, oriented=False,
):  # fmt: skip
    """Make the bodies from LAMMPS's atoms as they are; collective.

    Args:
        lammps: the `Lammps`.  communicator: the `Communicator` or `ALONE`.
        membership: the `Membership`.
        path: the file of keyword infile, None for none.
        own_rows: rows of zeros in the bodies' state, behind those that `block` names.
        former: the `Former` of LAMMPS's atoms, if bodies are to keep their shape; None for none.
        atoms: indices of this rank's atoms to make bodies of, ascending; None for all that the
            membership names.
        shapes: see `hosts.Host.shapes`.
        oriented: whether atoms of this atom style can have an orientation, on any rank.
    Returns:
        (Bodies, dict): the bodies, with q and p of the rigid motion that has the linear and
        angular momentum of the atoms' velocities, and notes for the log: the number of
        bodies `rebuilt` by the nearest image, the number of `stray` atoms, which no molecule-ID
        puts in a body, the kinetic energy `kinetic` of the atoms and the part `removed` of
        it that is not rigid motion, whether atoms that have moments of their own are `still`, the
        IDs `given` that the file names, `warnings`, a list of lines, and the `Kept` in `kept`, if
        something has turned or deformed bodies, and whether some of the bodies are `new`.
    Raises:
        RunError: on all ranks, naming the body.
    """
    members = find_members(lammps, communicator, membership, shapes, atoms)
    natoms, atoms_mass = members.total(np.ones(len(members.atoms)), members.mass)
    given = infile.read(path, communicator, members.ids, members.owned) if path else None
    mass = _masses(members, atoms_mass, given)
    place, image, delta, rebuilt, doubt = unfold(lammps, members)
    of_atoms = members.total(*(members.mass * delta.T)) / atoms_mass
    centre = _centres_in_file(lammps, members, given, place, image, of_atoms) if given else of_atoms
    r, kept, new = delta - centre[:, members.body].T, None, True
    shaped = oriented or lammps.radius is not None
    particles = particles_of(lammps, shapes, members.atoms) if shaped else None
    if former is not None:
        r, particles, kept, new = keep(lammps, members, former, r, particles, oriented)
    own = _own_inertia(members, particles)
    inertia = _inertia(members, members.mass, r) + own
    size = np.sqrt(np.trace(inertia) / atoms_mass)
    _refuse_points(lammps, members, natoms, size, given)
    inertia = inertia.transpose(2, 0, 1)
    doubts = [doubt] if doubt else []
    if given:
        inertia[given.bodies] = given.inertia
        doubts += _off_centre(lammps, members, centre - of_atoms, size)

    plane = lammps.dimension == 2
    directed = particles if oriented else None
    moment, axes = principal.moments_and_axes(members, inertia, r, directed, plane)

    def alike():
        shared = _inertia(members, (mass / natoms)[members.body], r) + own
        return np.einsum("nak,abn,nbk->kn", axes, shared, axes)

    chosen, slower = _chosen(lammps, membership.command, moment, plane, alike)
    state = np.concatenate([np.zeros((ROWS + own_rows, len(mass))), slower])
    state[MASS], state[NATOMS], state[MOMENT] = mass, natoms, chosen
    state[HOME], state[ID] = members.sharers.home, members.ids
    state[X], state[IMAGE], state[Q] = place + centre, image, quaternions(axes)
    # every copy of a shared body starts from the lowest rank's numbers, to the last bit
    state[:, ~members.owned] = 0.0
    members.sharers.combine(state)
    row = ROWS + own_rows if len(slower) else 0
    result = _with_atoms(state, members, r, particles, oriented, plane, row)
    if result.spin:  # the bodies have these atoms in another order
        particles = particles_of(lammps, shapes, result.index)
    spins, energy = (particles.momentum, particles.kinetic().sum()) if result.spin else (None, 0.0)
    result.take_velocities(lammps, spins, given and given.momenta(result.id))
    finite = result.spin and np.count_nonzero(particles.moment.any(axis=0))
    _refuse_small_moments(lammps, communicator, membership.command, chosen[2 * plane :])
    notes = _notes(result, lammps, members, rebuilt[members.owned].sum(), energy, finite)
    return result, notes | {
        "given": given.named if given else (),
        "warnings": doubts,
        "kept": kept,
        "new": new,
    }


def _masses(members, mass, given):
    """The bodies' masses (n,): those of the infile, else the `mass` of their atoms."""
    mass = mass.copy()
    if given:
        mass[given.bodies] = given.mass
    members.refuse(~(mass > 0), lambda k: f"has mass {mass[k]:g}: give its atoms a mass above zero")
    return mass


def _refuse_points(lammps, members, natoms, size, given):
    """Raise an error if several atoms are at one point, and no infile says what body they are.

    Args:
        size: (n,) root of the trace of the atoms' inertia over their mass.
    """
    point = ~(size > _SAME_PLACE * np.abs(lammps.box.h).max())
    members.refuse(
        (natoms > 1) & point & (given.absent if given else True),
        lambda k: (
            f"has {natoms[k]:.0f} atoms at one point, so it has no shape: move them apart, "
            "or leave them out of the group"
        ),
    )


def _centres_in_file(lammps, members, given, place, image, of_atoms):
    """Centres of mass (3, n) from the bodies' first atoms, `place` and `image`: those of the file,
    and else those `of_atoms`."""
    here, centre = given.bodies, of_atoms.copy()
    centre[:, here] = (
        given.x
        - place[:, here]
        + lammps.box.h @ lammps.image_difference(given.image - image[:, here].astype(np.int64))
    )
    far = np.abs(lammps.box.inverse @ (centre - of_atoms)) * lammps.box.periodic[:, None] > 0.5
    members.refuse(
        far.any(axis=0),
        lambda k: (
            "has its centre in the infile more than half the box from its atoms: "
            "check the image flags there"
        ),
    )
    return centre


def _off_centre(lammps, members, off, size):
    """A warning of bodies that an infile has far from their atoms, if any; collective.

    Args:
        off: (3, n) how far each body's centre is off.
        size: (n,) root of the trace of the atoms' inertia about that centre over their mass.
    """
    off = np.linalg.norm(off, axis=0)
    radius = np.sqrt(np.maximum(0.5 * size**2 - off**2, 0.0))  # of gyration, about their own centre
    point = radius < 1e-6 * off  # an atom alone, to rounding
    radius[point] = 0.0
    far = np.where(point, _OFF_POINT * lammps.box.size, _OFF_CENTRE * radius)
    odd = members.owned & (off > far)
    here = np.array([off, radius, members.ids], float).T[odd]
    rows = members.communicator.gather_to_all(here)
    if not len(rows):
        return []
    off, radius, worst = rows[rows[:, 0].argmax()]
    name = members.membership.name(int(worst))
    return [
        f"WARNING: the infile has the centres of {len(rows)} bodies far from their atoms: that of "
        f"{name} by {off:.3g}, where its radius of gyration is {radius:.3g}. "
        "Give each fix the file of its own bodies"
    ]


def least_moment(lammps, command):
    """The least moment of a body that turns by `TURN` in a step, or less, as keyword moments step
    has it: with the mean angular velocity, of equipartition, at the temperature of the fix line,
    the higher one of two.
    """
    temperature = max(lammps.number(word) for word in command.temp[:2])
    return lammps.boltz / lammps.mvv2e * temperature * (lammps.innermost_dt / TURN) ** 2


def _refuse_small_moments(lammps, communicator, command, moment):
    """End the run if keyword moments gives bodies so small ones, (k, n), that heat turns them by
    more than half a turn in a step; collective."""
    if not command.moments or command.moments[0] not in ("equal", "scale"):
        return
    good = least_moment(lammps, command)
    least = good * (TURN / np.pi) ** 2
    if communicator.any(((moment > 0) & (moment < least)).any()):
        how, word = command.moments
        raise command.wrong(
            f"keyword moments {how} {word} makes moments of less than {least:.3g}, with which heat "
            f"turns a body by more than half a turn in a step: {good:.3g} and more is good, and "
            "'moments step' chooses it"
        )


def _chosen(lammps, command, moment, plane, alike):
    """The moments that bodies have instead of those of their atoms; see `Command.moments`.

    Args:
        moment: those of the atoms, (3, n).  plane: whether bodies turn about axis 3 only.
        alike: a function that gives those of atoms that share their body's mass alike, (3, n).
    Returns:
        moments (3, n), and the root of each over that of the atoms, (3, n); (0, n) if they are
        those.
    """
    if command.moments is None:
        return moment, moment[:0]
    how, word = command.moments
    if how == "alike":
        value = alike()
    elif how == "step":
        value = np.maximum(moment, least_moment(lammps, command))
    else:
        value = lammps.number(word)
        command.refuse_unless_positive(f"keyword moments: {how}", value)
    turns = (moment > 0) & (value > 0)
    if plane:
        turns[:2] = False  # a moment about these axes only says that the body is no point
    slower = np.ones_like(moment)
    factor = np.full_like(moment, value) / (1.0 if how == "scale" else np.where(turns, moment, 1.0))
    slower[turns] = np.sqrt(factor[turns])
    return moment * slower**2, slower


def count(communicator, membership):
    """How many bodies there are, None if that cannot be told (yet); collective."""
    if membership.variable:
        return None  # the variable may need a run
    ids, problem = np.empty(0, np.int64), False
    try:
        ids = np.unique(membership.bodies(membership.atoms()))
        ids = ids[ids < POINTS]
    except RunError:
        problem = True
    if communicator.any(problem):
        return None
    return communicator.count(sharers_of(communicator, ids).owned.sum()) or None


def _notes(bodies, lammps, members, rebuilt, own, finite):
    """What `build` has to say for the log; collective.

    Args:
        own: kinetic energy of the rotation of this rank's atoms themselves.
        finite: how many of these atoms have moments of their own.
    """
    v, mass, owned = lammps.per_atom("v", columns=3), lammps.masses, bodies.sharers.owned
    before = 0.5 * (mass[bodies.index] * (v[bodies.index] ** 2).T).sum() + own
    zero = owned & (bodies.id == 0) & (members.membership.command.style == "molecule")
    after, stray = bodies.kinetic()[:, owned].sum(), bodies.natoms[zero].sum()
    before, after, rebuilt, stray, own, finite = members.communicator.total(
        np.array([before, after, rebuilt, stray, own, finite])
    )
    return {
        "kinetic": lammps.mvv2e * before,
        "removed": lammps.mvv2e * (before - after),
        "rebuilt": round(rebuilt),
        "stray": round(stray),
        "still": finite > 0 and own == 0,
    }


def _own_inertia(members, particles):
    """What the moments of particles themselves add to their bodies' inertia, (3, 3, n), or 0."""
    if particles is None:
        return 0.0
    return members.total(*particles.inertia().reshape(9, -1)).reshape(3, 3, -1)


def _inertia(members, mass, r):
    """Tensors of inertia (3, 3, n) of atoms with these masses (m,) and places (m, 3)."""
    x, y, z = r.T
    products = x * x, y * y, z * z, x * y, x * z, y * z
    xx, yy, zz, xy, xz, yz = members.total(*(mass * c for c in products))
    return np.array([[yy + zz, -xy, -xz], [-xy, xx + zz, -yz], [-xz, -yz, xx + yy]])


def _with_atoms(state, members, r, particles, oriented, plane, chosen):
    """The `Bodies` of this state and these atoms; collective.

    Args:
        r: (m, 3) places from the bodies' centres, space frame.
        particles: the `Particles` that the atoms are, None if all are points.
        oriented: whether their atom style has orientations.
    """
    communicator, body = members.communicator, members.body
    come = bool(members.membership.command.mol)  # others may, of any kind that the atom style has
    turn = matrices(state[Q])[:, :, body]
    d = np.vstack([np.einsum("abn,na->bn", turn, r), members.tag])
    spin = directed = False
    if particles:
        directed = come and oriented
        directed = communicator.any(directed or particles.quat.any() or particles.dipole.any())
        spin = directed or communicator.any(come or particles.moment.any())
    if oriented:
        d = np.vstack([d, *_in_bodies(particles, state[Q][:, body], turn)])
    if spin:
        machine_code.load(communicator, extended.__name__)
    return Bodies(state, body, d, members.atoms, plane, spin, directed, communicator, chosen)


def _in_bodies(particles, q, turn):
    """The rows of `extended` in the bodies' displace.

    Args:
        q (4, m), turn (3, 3, m): the quaternion of each particle's body, and its matrix.
    """
    back = np.array(product(q * np.array([[1.0], [-1.0], [-1.0], [-1.0]]), particles.quat))
    size = np.sqrt((back * back).sum(axis=0))
    orient = np.divide(back, size, out=np.zeros_like(back), where=size > 0)
    return (
        orient,
        particles.moment * particles.keeps,
        np.einsum("abm,am->bm", turn, particles.dipole),
    )
