"""Make bodies from LAMMPS's atoms: images, mass, centre of mass, inertia, principal frame."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..host.command import Command
from ..host.lammps import Lammps
from ..loops import machine_code
from ..loops.memory import Memory
from ..motion.frames import matrices, quaternions
from ..ranks.arrangement import BodyRows
from . import extended, shapes
from .bodies import HOME, ID, IMAGE, MASS, MOMENT, NATOMS, ROWS, Bodies, Q, X
from .members import Members, find_members, sharers_of
from .membership import FLEXIBLE, OUT, Membership, PreviousBodies
from .particles import Particles, particles_of
from .principal import moments_and_axes
from .shapes import ShapeCorrection
from .unwrap import UnwrappedPositions, unwrap

TURN = 0.08  # rad per step, of keyword moments step: TIP3P with 6 amu A^2 at 298 K and 12 fs
_SAME_PLACE = 1e-12  # atoms closer than this fraction of the box are at one point
# largest distance of an atom from a linear body's line, in radii of gyration: positions in a data
# file may be rounded
_BESIDE = 1e-2
_AT_ONCE = 4096  # number of atoms whose rotation matrices are in memory at a time


class Prescribed(NamedTuple):
    """Properties of bodies that are prescribed by an infile or by a molecule template.

    Attributes:
        which: (n,) bool, the m bodies of this rank with prescribed properties.
        ids: IDs of all these bodies, on all ranks.
        mass: (m,).
        centre: (3, m) centre of mass, relative to the body's first atom.
        inertia: (m, 3, 3), space frame.
        momenta: (6, m) linear and angular momentum, space frame.
        warnings: lines for the log.
    """

    which: np.ndarray
    ids: np.ndarray
    mass: np.ndarray
    centre: np.ndarray
    inertia: np.ndarray
    momenta: np.ndarray
    warnings: list[str]


def nothing(unwrapped: UnwrappedPositions) -> Prescribed:
    """`Prescribed` for no body."""
    which = np.zeros(len(unwrapped.members.ids), bool)
    none = np.empty((6, 0))
    return Prescribed(
        which, np.empty(0, np.int64), none[0], none[:3], np.empty((0, 3, 3)), none, warnings=[]
    )


class Recipe(NamedTuple):
    """How bodies are made from atoms.

    Attributes:
        membership: which atoms form which body.
        shapes: see `hosts.Host.shapes`.
        oriented: whether atoms of this atom style can have an orientation.
        find_prescribed: returns the `Prescribed` properties; collective.
        own_rows: number of extra rows of the bodies' state, after those named in `block`.
        keeps_shapes: whether bodies keep their previous shapes.
    """

    membership: Membership
    shapes: np.ndarray | None
    oriented: bool
    find_prescribed: Callable[[UnwrappedPositions], Prescribed] = nothing
    own_rows: int = 0
    keeps_shapes: bool = False


@dataclass
class BuildReport:
    """Statistics of bodies that were made, identical on all ranks.

    Attributes:
        kinetic: kinetic energy of the atoms, in LAMMPS's units.
        removed: the part of it that is not rigid-body motion.
        rebuilt: number of bodies reassembled from nearest images.
        stray: number of atoms with molecule-ID 0.
        still: whether finite-size atoms have no angular velocity.
        prescribed_ids: IDs of the bodies with `Prescribed` properties, on all ranks.
        warnings: lines for the log.
    """

    kinetic: float
    removed: float
    rebuilt: int
    stray: int
    still: bool
    prescribed_ids: np.ndarray
    warnings: list[str]


class Built(NamedTuple):
    """The result of `build`."""

    bodies: Bodies
    report: BuildReport
    correction: ShapeCorrection


def build(
    recipe: Recipe, previous: PreviousBodies | None = None, atoms: np.ndarray | None = None
) -> Built:
    """Make the bodies from the present state of LAMMPS's atoms; collective.

    Their v and p are those of the rigid motion with the linear and angular momentum of the atoms.

    Args:
        previous: the previous bodies of LAMMPS's atoms; None if there are none.
        atoms: indices of this rank's atoms to make bodies from, ascending; None for all atoms of
            the membership.
    Raises:
        RunError: on all ranks, naming the body.
    """
    membership, lammps = recipe.membership, recipe.membership.lammps
    members = find_members(membership, recipe.shapes, recipe.oriented, atoms)
    unwrapped = unwrap(members)
    prescribed = recipe.find_prescribed(unwrapped)
    mass, centre = members.mass.copy(), unwrapped.centre.copy()
    mass[prescribed.which], centre[:, prescribed.which] = prescribed.mass, prescribed.centre
    members.refuse(~(mass > 0), lambda k: f"has mass {mass[k]:g}: give its atoms a mass above zero")
    _refuse_negative_moments(members, prescribed)
    r, correction = unwrapped.delta, ShapeCorrection()
    r -= centre[:, members.body].T  # in place, because there may be many atoms
    if previous is not None and recipe.keeps_shapes:
        members, r, correction = shapes.keep(members, previous, r)

    memory = Memory("bodies", BodyRows)
    warnings = _set_shapes(memory, recipe, members, r, mass, prescribed)
    state = memory.cells["state"].array
    state[X], state[IMAGE] = unwrapped.place + centre, unwrapped.image
    # all copies of a shared body start from the lowest rank's values, to the last bit
    state[:, ~members.owned] = 0.0
    members.sharers.combine(state)
    bodies = _with_atoms(memory, recipe, members, r)
    # again, because the bodies store the atoms in another order
    particles = particles_of(lammps, recipe.shapes, bodies.index) if bodies.spin else None
    places = np.argsort(bodies.id)[prescribed.which]
    bodies.take_velocities(lammps, particles, places, prescribed.momenta)
    warnings = unwrapped.warnings + prescribed.warnings + warnings
    report = _report(bodies, members, particles, unwrapped.rebuilt, prescribed.ids, warnings)
    return Built(bodies, report, correction)


def _set_shapes(
    memory: Memory,
    recipe: Recipe,
    members: Members,
    r: np.ndarray,
    mass: np.ndarray,
    prescribed: Prescribed,
) -> list[str]:
    """Make `state` (see `Bodies`); set masses, moments, quaternions, numbers of atoms, homes and
    IDs, and the rest to zero; collective.

    Args:
        r: (m, 3) positions of the atoms relative to the centre of mass, space frame.
        mass: (n,) of the bodies.
    Returns:
        lines for the log.
    Raises:
        RunError: on all ranks, naming the body.
    """
    inertia = members.inertia(r)
    _refuse_points(members, inertia, prescribed)
    inertia = inertia.transpose(2, 0, 1)
    inertia[prescribed.which] = prescribed.inertia
    moment, axes = moments_and_axes(members, inertia, r)
    warnings = _beside_lines(members, r, moment, axes, prescribed)
    moment, slowness = _chosen(members, moment)
    rows = ROWS + recipe.own_rows
    state = memory.new("state", (rows + len(slowness), len(mass)))
    state[:rows], state[rows:] = 0.0, slowness
    state[MASS], state[NATOMS], state[MOMENT] = mass, members.natoms, moment
    state[HOME], state[ID], state[Q] = members.sharers.home, members.ids, quaternions(axes)
    return warnings


def _refuse_negative_moments(members: Members, prescribed: Prescribed) -> None:
    """Raise an error if a prescribed inertia has a negative principal moment; collective."""
    lowest, wrong = np.zeros(len(members.ids)), np.zeros(len(members.ids), bool)
    moments = np.linalg.eigvalsh(prescribed.inertia)
    lowest[prescribed.which] = moments[:, 0]
    wrong[prescribed.which] = moments[:, 0] < -1e-7 * np.abs(moments).max(axis=1, initial=0.0)
    members.refuse(
        wrong,
        lambda k: (
            f"has a negative principal moment of inertia, {lowest[k]:g}, in the infile or in its "
            "molecule template"
        ),
    )


def _refuse_points(members: Members, inertia: np.ndarray, prescribed: Prescribed) -> None:
    """Raise an error if the mass of several atoms is at one point, unless the body's inertia is
    prescribed; collective.

    Args:
        inertia: (3, 3, n) of the atoms.
    """
    natoms = members.natoms
    size = np.sqrt(np.trace(inertia) / members.mass)
    point = ~(size > _SAME_PLACE * np.abs(members.lammps.box.h).max())
    members.refuse(
        (natoms > 1) & point & ~prescribed.which,
        lambda k: (
            f"has the mass of its {natoms[k]:.0f} atoms at one point, so it has no moment of "
            "inertia: move them apart, give those that are elsewhere a mass, or leave them out of "
            "the group"
        ),
    )


def _beside_lines(
    members: Members,
    r: np.ndarray,
    moment: np.ndarray,
    axes: np.ndarray,
    prescribed: Prescribed,
) -> list[str]:
    """Raise an error if an atom off the line of a linear body could have a torque about the line,
    for which the body has no moment of inertia; collective.

    Args:
        moment (3, n), axes (n, 3, 3): see `principal.moments_and_axes`.
        prescribed: bodies with prescribed moments are not checked.
    Returns:
        a warning if a dipole, on any rank, is not along such a line.
    Raises:
        RunError: on all ranks.
    """
    communicator = members.communicator
    linear = (moment[2] == 0) & (moment[0] > 0) & ~prescribed.which
    if members.lammps.dimension == 2 or not communicator.any(linear.any()):
        return []
    here, line = linear[members.body], axes[members.body, :, 2]
    size = np.sqrt(moment[0] / members.mass)[members.body]

    def beside(vectors: np.ndarray) -> np.ndarray:
        """Length of the component of vectors (m, 3) perpendicular to the line, (m,)."""
        along = (vectors * line).sum(axis=1)[:, None] * line
        return np.linalg.norm(vectors - along, axis=1) * here

    off = beside(r)
    communicator.refuse(
        (off > _BESIDE * size) & (off == off.max(initial=0.0)),
        lambda k: (
            f"{members.membership.name(members.ids[members.body[k]])} has its mass in a line, and "
            f"atom {members.tag[k]} (mass {members.atom_mass[k]:g}) is {off[k]:.3g} away from it: "
            "without a moment of inertia about the line, its torque would be lost. Give the atom a "
            "larger mass, move it onto the line, or, if it feels no force, leave it out of the "
            "group"
        ),
    )
    dipole = np.zeros_like(r) if members.particles is None else members.particles.dipole.T
    across = beside(dipole) > _BESIDE * np.linalg.norm(dipole, axis=1)
    if not communicator.any(across.any()):
        return []
    return [
        "WARNING: dipoles are across the lines of linear bodies, which have no moment of inertia "
        "about these lines: torques about them are lost, as with fix rigid. Particles with a "
        "diameter have one"
    ]


def least_moment(lammps: Lammps, command: Command) -> float:
    """The smallest moment with which a body rotates by at most `TURN` per step, for keyword moments
    step, in mass times length squared.

    The angular velocity is the equipartition value at the higher temperature of the fix line.
    """
    assert command.temp, "keyword moments needs temp"
    temperature = max(lammps.number(word) for word in command.temp[:2])
    return lammps.boltz / lammps.mvv2e * temperature * (lammps.innermost_dt / TURN) ** 2


def _chosen(members: Members, moment: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The moments that replace those of the atoms; see `Command.moments`.

    Args:
        moment: (3, n) moments of the atoms.
    Returns:
        moments (3, n), and the square root of each divided by that of the atoms, (3, n); (0, n) if
        they are not replaced.
    Raises:
        RunError: on all ranks, if a body with such a moment rotates thermally by more than half a
            turn per step.
    """
    lammps, command = members.lammps, members.membership.command
    if command.moments is None:
        return moment, moment[:0]
    (how, word), good = command.moments, least_moment(lammps, command)
    if how == "step":
        value = np.maximum(moment, good)
    else:
        value = lammps.number(word)
        command.refuse_unless_positive(f"keyword moments: {how}", value)
    turns = (moment > 0) & (value > 0)
    if lammps.dimension == 2:
        turns[:2] = False  # moments about these axes only mark the body as no point
    slowness = np.ones_like(moment)
    factor = np.full_like(moment, value) / (1.0 if how == "scale" else np.where(turns, moment, 1.0))
    slowness[turns] = np.sqrt(factor[turns])
    chosen, least = moment * slowness**2, good * (TURN / np.pi) ** 2
    small = turns & (chosen < least) & (how != "step")
    if members.communicator.any(small.any()):
        raise command.wrong(
            f"keyword moments {how} {word} makes moments of less than {least:.3g}, with which heat "
            f"turns a body by more than half a turn in a step: {good:.3g} and more is good, and "
            "'moments step' chooses it"
        )
    return chosen, slowness


def count(membership: Membership) -> int | None:
    """The number of bodies; None if there are none, because their number may change; collective."""
    assigned, communicator = membership.assigned, membership.communicator
    ids = np.unique(assigned[(assigned > OUT) & (assigned < FLEXIBLE)])
    return communicator.count(sharers_of(communicator, ids).owned.sum()) or None


def _report(
    bodies: Bodies,
    members: Members,
    particles: Particles | None,
    rebuilt: np.ndarray,
    prescribed_ids: np.ndarray,
    warnings: list[str],
) -> BuildReport:
    """The `BuildReport` of bodies that were just made; collective.

    Args:
        particles: spins of their atoms, in the bodies' order; None if all are points.
        rebuilt: (n,) bool, see `UnwrappedPositions`.
        prescribed_ids, warnings: see `BuildReport`.
    """
    owned, mvv2e = bodies.sharers.owned, members.lammps.mvv2e
    spin = finite = 0.0
    if particles is not None:
        spin, finite = particles.kinetic().sum(), particles.moment.any(axis=0).sum()
    zero = owned & (bodies.id == 0) & (members.membership.command.style == "molecule")
    before = bodies.kinetic_of_atoms(members.lammps).sum() + spin
    after, stray = bodies.kinetic()[:, owned].sum(), bodies.natoms[zero].sum()
    before, after, put_together, stray, spin, finite = members.communicator.total(
        [before, after, rebuilt[members.owned].sum(), stray, spin, finite]
    )
    return BuildReport(
        mvv2e * before, mvv2e * (before - after), round(put_together), round(stray),
        finite > 0 and spin == 0, prescribed_ids, warnings,
    )  # fmt: skip


def _with_atoms(memory: Memory, recipe: Recipe, members: Members, r: np.ndarray) -> Bodies:
    """The `Bodies` with this state and these atoms; collective.

    Args:
        memory: contains the state.
        r: (m, 3) positions of the atoms relative to the centre of mass, space frame.
    """
    communicator, particles, command = (
        members.communicator, members.particles, members.membership.command,
    )  # fmt: skip
    state, body, come = memory.cells["state"].array, members.body, bool(command.mol)
    spin = directed = False
    if particles is not None:  # with keyword mol any particle of the atom style may be added
        has = particles.quat.any() or particles.dipole.any()
        directed = communicator.any(has or (come and recipe.oriented))
        spin = directed or communicator.any(come or particles.moment.any())
    rows = extended.ROWS if recipe.oriented else extended.ORIENT
    displace = memory.new("displace", (rows, len(body)))
    for begin in range(0, len(body), _AT_ONCE):
        some = slice(begin, begin + _AT_ONCE)
        turn = matrices(state[Q][:, body[some]])
        displace[:3, some] = np.einsum("abn,na->bn", turn, r[some])
    displace[3] = members.tag
    if recipe.oriented and particles is not None:
        displace[extended.ORIENT :] = particles.in_bodies(state[Q][:, body])
    if spin:
        machine_code.load(communicator, extended.__name__)
    slower = len(state) - ROWS - recipe.own_rows
    return Bodies(
        memory, body, members.atoms, members.lammps.dimension == 2, spin, directed, communicator,
        len(state) - slower if slower else 0,
    )  # fmt: skip
