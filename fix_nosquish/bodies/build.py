"""How bodies are made of LAMMPS's atoms: image, mass, centre of mass, inertia, principal frame."""

import numpy as np

from ..errors import RunError
from ..loops import machine_code
from ..motion.frames import product
from . import extended, principal
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
from .given import Start
from .members import find_members, sharers_of
from .membership import POINTS
from .shapes import keep
from .unfold import unfold

TURN = 0.08  # rad in a step, of keyword moments step: TIP3P with 6 amu A^2 at 298 K and 12 fs
_SAME_PLACE = 1e-12  # atoms closer than this part of the box are at one point
# atoms further off a linear body's line than this part of its radius of gyration are beside it: a
# data file may have rounded places
_BESIDE = 1e-2


def build(
    lammps, communicator, membership, told=None, own_rows=0, former=None, atoms=None,
    shapes=None, oriented=False,
):  # fmt: skip
    """Make the bodies from LAMMPS's atoms as they are; collective.

    Args:
        lammps: the `Lammps`.  communicator: the `Communicator` or `ALONE`.
        membership: the `Membership`.
        told: a function of the `Lammps`, the `Members` and the `Start`, collective, that gives what
            is known of bodies besides their atoms, `Given`; None for none.
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
        IDs `given` of bodies of which more is known, `warnings`, a list of lines, and the `Kept` in
        `kept`, if something has turned or deformed bodies, and whether some of the bodies are
        `new`.
    Raises:
        RunError: on all ranks, naming the body.
    """
    members = find_members(lammps, communicator, membership, shapes, atoms)
    natoms, atoms_mass = members.total(np.ones(len(members.atoms)), members.mass)
    place, image, delta, rebuilt, doubt = unfold(lammps, members)
    weight = np.where(atoms_mass > 0, atoms_mass, 1.0)  # those that weigh nothing are refused below
    centre = members.total(*(members.mass * delta.T)) / weight
    shaped = oriented or lammps.radius is not None
    particles = particles_of(lammps, shapes, members.atoms) if shaped else None
    given, mass = None, atoms_mass
    if told:
        own = _own_inertia(members, particles)
        start = Start(place, image, delta, natoms, atoms_mass, centre, own)
        given = told(lammps, members, start)
    if given:
        mass, centre = mass.copy(), centre.copy()
        mass[given.bodies], centre[:, given.bodies] = given.mass, given.centre
    members.refuse(~(mass > 0), lambda k: f"has mass {mass[k]:g}: give its atoms a mass above zero")
    r, kept, new = delta - centre[:, members.body].T, None, True
    if former is not None:
        r, particles, kept, new = keep(lammps, members, former, r, particles, oriented)
    own = _own_inertia(members, particles)
    inertia = members.inertia(members.mass, r) + own
    size = np.sqrt(np.trace(inertia) / atoms_mass)
    _refuse_points(lammps, members, natoms, size, given)
    inertia = inertia.transpose(2, 0, 1)
    doubts = [doubt] if doubt else []
    if given:
        inertia[given.bodies] = given.inertia
        doubts += given.warnings

    plane = lammps.dimension == 2
    directed = particles if oriented else None
    moment, axes = principal.moments_and_axes(members, inertia, r, directed, plane)

    def alike():
        shared = members.inertia((mass / natoms)[members.body], r) + own
        return np.einsum("nak,abn,nbk->kn", axes, shared, axes)

    _refuse_beside_line(members, moment, axes, r, particles, plane, given)
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
    result.take_velocities(lammps, spins, given and given.momenta_among(result.id))
    finite = result.spin and np.count_nonzero(particles.moment.any(axis=0))
    _refuse_small_moments(lammps, communicator, membership.command, chosen[2 * plane :])
    notes = _notes(result, lammps, members, rebuilt[members.owned].sum(), energy, finite)
    return result, notes | {
        "given": given.named if given else (),
        "warnings": doubts,
        "kept": kept,
        "new": new,
    }


def _refuse_points(lammps, members, natoms, size, given):
    """Raise an error if the mass of several atoms is at one point, and nothing else says what they
    are.

    Args:
        size: (n,) root of the trace of the atoms' inertia over their mass.
    """
    point = ~(size > _SAME_PLACE * np.abs(lammps.box.h).max())
    members.refuse(
        (natoms > 1) & point & (given.absent if given else True),
        lambda k: (
            f"has the mass of its {natoms[k]:.0f} atoms at one point, so it has no moment of "
            "inertia: move them apart, give those that are elsewhere a mass, or leave them out of "
            "the group"
        ),
    )


def _refuse_beside_line(members, moment, axes, r, particles, plane, given):
    """End the run if atoms or dipoles beside the line of a linear body may have a torque about it,
    for which the body has no moment of inertia; collective.

    Args:
        moment (3, n), axes (n, 3, 3): see `principal.moments_and_axes`.
        r: (m, 3) the atoms' places from the bodies' centres.
        plane: whether bodies turn about z only.
        given: bodies whose moments were given are as the user wants them.
    """
    linear = (moment[2] == 0) & (moment[0] > 0) & (given.absent if given else True)
    if plane or not members.communicator.any(linear.any()):
        return
    here = linear[members.body]
    line = axes[members.body, :, 2]
    size = np.sqrt(moment[0] / members.total(members.mass)[0])[members.body]

    def beside(vectors):
        return np.linalg.norm(vectors - (vectors * line).sum(axis=1)[:, None] * line, axis=1)

    off, problem = beside(r) * here, None
    wrong, what = off > _BESIDE * size, "is {:.3g} away from it"
    if particles is not None and not wrong.any():
        dipole = particles.dipole.T
        across, what = beside(dipole) * here, "has a dipole of {:.3g} across it"
        off, wrong = across, across > _BESIDE * np.linalg.norm(dipole, axis=1)
    if wrong.any():
        k = np.argmax(off * wrong)
        problem = (
            f"{members.membership.name(members.ids[members.body[k]])} has its mass in a line, and "
            f"atom {members.tag[k]} (mass {members.mass[k]:g}) {what.format(off[k])}: the body has "
            "no moment of inertia about this line (less than 1e-7 of the largest one), so torques "
            "about it would be lost. Give atoms beside the line a larger mass, or move them onto "
            "it; those that feel no force can be left out of the group"
        )
    members.communicator.agree(problem)


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
    owned = bodies.sharers.owned
    zero = owned & (bodies.id == 0) & (members.membership.command.style == "molecule")
    before = bodies.kinetic_of_atoms(lammps).sum() + own
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
