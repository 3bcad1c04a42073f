"""Rigid bodies: how they are made of LAMMPS's atoms, and how they follow them.

The state of a body is its centre of mass x, velocity v, quaternion q and conjugate
quaternion momentum p, with its mass and principal moments.  Every rank keeps the
bodies of which it owns an atom, and of their atoms only its own.
"""

from functools import partial

import numpy as np

from . import kernels
from .errors import RunError

ZERO_MOMENT = 1e-7  # a moment below this part of the body's largest is none, as in LAMMPS's fix rigid
_SAME_PLACE = 1e-12  # atoms closer than this part of the box are at one point
_MOVED = 1e-9  # positions further off the rigid body than this part of the box were changed by something else

# rows of a body's state
_MASS, _MOMENT, _X, _V, _Q, _P, _NATOMS = (slice(0, 1), slice(1, 4), slice(4, 7), slice(7, 10),
                                           slice(10, 14), slice(14, 18), slice(18, 19))  # fmt: skip
_ROWS = 19


class Membership:
    """Which body each of this rank's atoms belongs to, as the fix line says it.

    Args:
        lammps: the `Lammps`.  command: the `Command`.
    """

    def __init__(self, lammps, command):
        self.lammps, self.command = lammps, command
        for group in (command.group, *(command.arguments if command.style == "group" else ())):
            if not lammps.has("group", group):
                raise RunError(f"there is no group '{group}': define it before the fix", everywhere=True)
        if command.style == "custom":
            name = command.arguments[0]
            if name[0] == "v" and not lammps.has("variable", name[2:]):
                raise RunError(f"there is no variable '{name[2:]}' (custom {name}): define it before the fix", everywhere=True)
        self.bit = lammps.group_bit(command.group)
        self.bits = [lammps.group_bit(g) for g in command.arguments] if command.style == "group" else [self.bit]

    def atoms(self):
        """Indices of this rank's atoms that are in bodies."""
        groups = self.lammps.groups
        return np.flatnonzero((groups & self.bit != 0) & (groups & np.bitwise_or.reduce(self.bits) != 0))

    def bodies(self, atoms):
        """The body ID of each of these atoms, (n,) int64; collective for v_NAME."""
        style, arguments = self.command.style, self.command.arguments
        if style == "single":
            return np.zeros(len(atoms), np.int64)
        if style == "molecule":
            values = self.lammps.per_atom("molecule", self.lammps.tagint)
            what = "molecule-IDs, which this atom style does not have: use atom_style molecular or full, or another body style"
        elif style == "custom" and arguments[0][0] == "v":
            values = np.trunc(self.lammps.variable(arguments[0][2:], self.command.group))
            if not np.isfinite(values[atoms]).all():
                raise RunError(f"variable {arguments[0][2:]} is not finite for every atom of the group, so it cannot tell bodies apart")
            what = "an atom-style variable"
        elif style == "custom":
            values = self.lammps.per_atom(arguments[0], np.int32)
            what = f"{arguments[0]}: define it with fix property/atom before the fix"
        else:
            groups = self.lammps.groups[atoms]
            inside = np.array([groups & bit != 0 for bit in self.bits])
            if (inside.sum(axis=0) > 1).any():
                tag = self.lammps.tags[atoms[inside.sum(axis=0) > 1][0]]
                both = [g for g, i in zip(arguments, inside[:, inside.sum(axis=0) > 1][:, 0]) if i]
                raise RunError(f"atom {tag} is in more than one body: it is in the groups {' and '.join(both)}; use groups without common atoms")
            return np.argmax(inside, axis=0)
        if values is None:
            raise RunError(f"body style {style} needs {what}")
        return values[atoms].astype(np.int64)

    def name(self, body):
        """How a user would name a body."""
        if self.command.style == "group":
            return f"the body of group {self.command.arguments[body]}"
        if self.command.style == "single":
            return f"the body of group {self.command.group}"
        if self.command.style == "molecule":
            return f"the body of molecule {body}"
        return f"the body of {self.command.arguments[0]} = {body}"


class Bodies:
    """The bodies of which this rank owns atoms, those of one kind side by side.

    Attributes:
        id: (n,) body IDs.
        rotors, extended: bodies [0, rotors) have three moments, [rotors, extended) are
            linear, [extended, n) are single atoms.
        mass (n,), moment (3, n), x, v (3, n), q, p (4, n), natoms (n,): views of `state`;
            x is kept in the box.  x, v and the torque are in the space frame, moments in the principal frame, I_1 >= I_2 >= I_3.
        force, torque: (3, n), views of `load`, which is what the sharing ranks exchange.
        first (n + 1,), index, tag, d, shift: this rank's atoms, body by body; see `kernels`.
        sharers: the `Sharers` of these bodies.
    """

    def __init__(self, ids, state, body, tag, index, d):
        # bodies by kind, then in the order of their atoms in LAMMPS's arrays; none without atoms
        lowest = np.full(len(ids), np.iinfo(np.int64).max)
        np.minimum.at(lowest, body, index)
        kind = (state[_MOMENT][2] == 0).astype(int) + (state[_MOMENT][0] == 0)
        held = np.flatnonzero(lowest < np.iinfo(np.int64).max)
        order = held[np.lexsort((lowest[held], kind[held]))]
        rank = np.empty(len(ids), np.int64)
        rank[order] = np.arange(len(order))
        body = rank[body]
        atoms = np.lexsort((index, body))
        self.id, self.state = ids[order], np.ascontiguousarray(state[:, order])
        self.rotors, self.extended = np.searchsorted(kind[order], [1, 2])
        self.body, self.tag = body[atoms], np.ascontiguousarray(tag[atoms])
        self.index, self.d = index[atoms].astype(np.int32), np.ascontiguousarray(d[atoms])
        self.first = np.searchsorted(self.body, np.arange(len(order) + 1)).astype(np.int32)
        self.shift = np.zeros_like(self.d)
        self.load = np.zeros((6, len(order)))
        self.force, self.torque = self.load[:3], self.load[3:]
        self.mass, self.natoms = self.state[_MASS][0], self.state[_NATOMS][0]
        self.moment = self.state[_MOMENT]
        self.x, self.v, self.q, self.p = (self.state[rows] for rows in (_X, _V, _Q, _P))

    def __len__(self):
        return len(self.id)

    def follow(self, lammps, world, membership):
        """The same bodies after LAMMPS has moved atoms between ranks and in its arrays; collective.

        Returns:
            Bodies.
        Raises:
            RunError: if atoms are missing or new, or stand where this fix has not put them.
        """
        here = membership.atoms()
        tags = lammps.tags[here].astype(np.int64)
        old = kernels.find(self.tag, tags)
        stayed = old >= 0
        lost = np.ones(len(self.tag), bool)
        lost[old[stayed]] = False
        gained = tags[~stayed]
        ids, state = self.id, self.state
        body, d = np.empty(len(here), np.int64), np.empty((len(here), 3))
        body[stayed], d[stayed] = self.body[old[stayed]], self.d[old[stayed]]
        if world.any(lost.any() or len(gained)):
            known = np.concatenate([self.id[self.body[lost], None], self.d[lost], self.state[:, self.body[lost]].T], axis=1)
            known = world.follow(self.tag[lost], known, gained, partial(_atoms_changed, lammps, membership))
            comes = known[:, 0].astype(np.int64)
            new, which = np.unique(comes[~np.isin(comes, ids)], return_index=True)
            state = np.concatenate([state, known[~np.isin(comes, ids)][which, 4:].T], axis=1)
            ids = np.concatenate([ids, new])
            by_id = np.argsort(ids)
            body[~stayed] = by_id[np.searchsorted(ids, comes, sorter=by_id)] if len(comes) else 0
            d[~stayed] = known[:, 1:4]
        result = Bodies(ids, state, body, tags, here, d)
        result.settle(lammps, world)
        return result

    def settle(self, lammps, world):
        """Find who shares the bodies and which periodic image of each atom LAMMPS holds; collective."""
        self.sharers = world.sharers(self.id, np.diff(self.first) < self.natoms)
        box = lammps.box
        self.x -= box.h @ box.cells(self.x.T).T
        actual = lammps.per_atom("x", columns=3)[self.index]
        expected = np.empty_like(actual)
        self.shift[:] = 0.0
        kernels.place(self.first, np.arange(len(self.index), dtype=np.int32), self.d, self.shift, self.x, self.q, expected)
        self.shift[:] = box.lattice(actual - expected) @ box.h.T
        off = np.abs(actual - expected - self.shift).max(axis=1, initial=0.0)
        bad = ~(off <= _MOVED * np.abs(box.h).max())
        world.agree(
            f"atom {self.tag[bad.argmax()]} is {off[bad.argmax()]:.3g} away from where its rigid body has it: something else moved "
            "it. Let no other fix integrate atoms of the bodies, and change positions between runs only, "
            "with 'run N pre yes' after it"
            if bad.any()
            else None
        )


def _atoms_changed(lammps, membership, gone, known, come):
    """The message for atoms (by their tags) that bodies lost or that came in between two steps, None if neither."""
    if len(gone):
        moved = np.linalg.norm(known[0, 4:][_V]) * lammps.dt
        return (
            f"atom {gone[0]} of {membership.name(int(known[0, 0]))} is gone by step {lammps.step}: it left the box, or was deleted "
            f"or taken out of the group. The body was moving by {moved:.3g} a step: if that is too far, the run is unstable and "
            "needs a shorter time step or a better start; if not, check the boundary, thermo_modify lost, and fixes that "
            "delete atoms, because bodies keep their atoms during a run"
        )
    if len(come):
        return (
            f"atom {come[0]} came into the fix's group by step {lammps.step}, but bodies are made when a run starts: "
            "use a static group, and insert atoms between runs"
        )
    return None


def build(lammps, world, membership):
    """Make the bodies from LAMMPS's atoms as they are; collective.

    Returns:
        (Bodies, dict): the bodies, with q and p of the rigid motion that has the linear and
        angular momentum of the atoms' velocities, and notes for the log: the number of
        bodies `rebuilt` by the nearest image, the number of `stray` atoms, which no molecule-ID
        puts in a body, and the kinetic energy `kinetic` of the atoms and the part `removed` of
        it that is not rigid motion.
    Raises:
        RunError: on all ranks, naming the body.
    """
    problem = None
    atoms = membership.atoms()
    try:
        ids_of_atoms = membership.bodies(atoms)
        mass = lammps.masses[atoms]
        tag = lammps.tags[atoms].astype(np.int64)
    except RunError as error:
        if error.everywhere:
            raise
        problem = str(error)
    world.agree(problem)
    if world.total(np.array([len(atoms)]))[0] == 0:
        raise RunError(f"there is no atom to form a body of in group '{membership.command.group}': fill the group before the run", everywhere=True)
    sized = _sized(lammps, atoms)
    world.agree(
        f"atom {tag[sized][0]} has a size or a dipole of its own, whose torque and inertia this fix does not know: use an atom style of points"
        if sized.any()
        else None
    )
    bad = ~(mass >= 0)
    world.agree(f"atom {tag[bad][0]} has mass {mass[bad][0]:g}, which is negative: give it a mass above zero" if bad.any() else None)
    v = lammps.per_atom("v", columns=3)[atoms]
    ids, body = np.unique(ids_of_atoms, return_inverse=True)
    sharers = world.sharers(ids, np.ones(len(ids), bool))
    n = len(ids)

    def total(*columns):
        """Sums over the bodies' atoms, on all ranks, (len(columns), bodies)."""
        sums = np.array([np.bincount(body, c, minlength=n) for c in columns])
        sharers.combine(sums)
        return sums

    def blame(wrong, text):
        """End the run if `wrong` marks a body."""
        k = np.argmax(wrong) if wrong.any() else None
        world.agree(None if k is None else membership.name(ids[k]) + " " + text(k))

    natoms, body_mass = total(np.ones(len(atoms)), mass)
    blame(~(body_mass > 0), lambda k: f"has mass {body_mass[k]:g}: give its atoms a mass above zero")

    reference, delta, rebuilt = _unfold(lammps, world, sharers, ids, body, tag, atoms, blame)
    centre = total(*(mass * delta.T)) / body_mass
    r = delta - centre[:, body].T
    velocity = total(*(mass * v.T)) / body_mass
    u = v - velocity[:, body].T
    angular = total(*(mass * np.cross(r, u).T))
    if lammps.dimension == 2:
        angular[:2] = velocity[2] = 0.0
    rx, ry, rz = r.T
    products = total(*(mass * c for c in (rx * rx, ry * ry, rz * rz, rx * ry, rx * rz, ry * rz)))
    spread = np.sqrt(products[:3].sum(axis=0) / body_mass)
    scale = np.abs(lammps.box.h).max()
    blame(
        (natoms > 1) & ~(spread > _SAME_PLACE * scale),
        lambda k: f"has {natoms[k]:.0f} atoms at one point, so it has no shape: move them apart, or leave them out of the group",
    )
    moment, axes = _principal(products, natoms, membership.command.order)
    state = np.zeros((_ROWS, n))
    state[_MASS], state[_NATOMS], state[_MOMENT], state[_V] = body_mass, natoms, moment, velocity
    state[_X], state[_Q] = reference + centre, _quaternion(axes)
    turn = np.array(kernels.rotation_matrix.py_func(state[_Q], slice(None))).reshape(3, 3, n)
    along = np.einsum("abn,an->bn", turn, angular) * (moment > 0)
    q = state[_Q]
    state[_P] = 2.0 * np.array([
        -q[1] * along[0] - q[2] * along[1] - q[3] * along[2],
        q[0] * along[0] - q[3] * along[1] + q[2] * along[2],
        q[3] * along[0] + q[0] * along[1] - q[1] * along[2],
        -q[2] * along[0] + q[1] * along[1] + q[0] * along[2],
    ])  # fmt: skip
    # every copy of a shared body starts from the lowest rank's numbers, to the last bit
    state[:, ~sharers.owned] = 0.0
    sharers.combine(state)
    turn = np.array(kernels.rotation_matrix.py_func(state[_Q], slice(None))).reshape(3, 3, n)
    d = np.einsum("abn,na->nb", turn[:, :, body], r)
    rotational = np.divide(along**2, moment, out=np.zeros_like(moment), where=moment > 0).sum(axis=0)
    rigid = body_mass * (velocity**2).sum(axis=0) + rotational
    zero = sharers.owned & (ids == 0) & (membership.command.style == "molecule")
    before, after, rebuilt, stray = world.total(
        np.array([(mass * (v * v).T).sum(), rigid[sharers.owned].sum(), rebuilt[sharers.owned].sum(), natoms[zero].sum()])
    )
    result = Bodies(ids, state, body, tag, atoms, d)
    result.settle(lammps, world)
    energy = 0.5 * lammps.mvv2e
    return result, {
        "kinetic": energy * before, "removed": energy * (before - after), "rebuilt": round(rebuilt), "stray": round(stray),
    }  # fmt: skip


def _sized(lammps, atoms):
    """Which of these atoms are more than points, and have a torque of their own, (n,) bool."""
    if lammps.setting("torque_flag") <= 0:
        return np.zeros(len(atoms), bool)
    radius = lammps.per_atom("radius")
    if radius is None or lammps.setting("mu_flag") > 0:
        return np.ones(len(atoms), bool)
    return radius[atoms] > 0


def _unfold(lammps, world, sharers, ids, body, tag, atoms, blame):
    """Put each body's atoms together across the periodic faces.

    Along each box vector the image flags hold where they make the body narrower than half the
    box. Otherwise a body that the nearest images make narrower than a quarter of the box is one
    that a face cuts, and put together by them: flags that were wrong at the start stay so while
    LAMMPS keeps count, so that they differ proves nothing. A body that is wide both ways is left
    as its flags have it if they differ among its atoms and make it narrower than the box, or if
    nothing suggests a cut: no gap inside it is wider than a tenth of the box and than half of
    the gap outside (a substrate that spans the box has small gaps only).

    Returns:
        (reference, delta, rebuilt): a point of each body, (3, n); the place of each atom
        from there, (atoms, 3); the bodies that were put together by the nearest images.
    """
    n, box = len(ids), lammps.box
    x, image = lammps.per_atom("x", columns=3)[atoms], lammps.images[atoms]
    first = np.full((1, n), np.inf)
    np.minimum.at(first[0], body, tag)
    sharers.combine(first, np.minimum)
    lead = tag == first[0, body]
    reference = np.zeros((6, n))
    reference[:, body[lead]] = np.concatenate([x[lead], image[lead]], axis=1).T
    sharers.combine(reference)
    place = reference[:3] + box.h @ reference[3:]
    # differences of the images are whole numbers: far from the origin nothing is lost
    image = image - reference[3:, body].T
    delta = x - reference[:3, body].T
    nearest = delta - box.lattice(delta) @ box.h.T
    delta = delta + image @ box.h.T

    def ends(values):
        """Lowest and highest value over each body's atoms, on all ranks, (3, n) each."""
        low, high = np.full((3, n), np.inf), np.full((3, n), -np.inf)
        for k in range(3):
            np.minimum.at(low[k], body, values[:, k])
            np.maximum.at(high[k], body, values[:, k])
        sharers.combine(low, np.minimum)
        sharers.combine(high, np.maximum)
        return low, high

    parts = delta @ box.inverse.T * box.periodic
    low, high = ends(parts)
    width = high - low
    wide = width >= 0.5
    if not world.any(wide.any()):
        return place, delta, np.zeros(n, bool)
    compact = np.ptp(ends(nearest @ box.inverse.T * box.periodic), axis=0)
    cut = wide & (compact < 0.25)
    unsure = wide & ~cut & ~(np.not_equal(*ends(image)) & (width < 1))
    for k in np.flatnonzero(box.periodic):
        gap = _widest_gap(parts[:, k] - low[k, body], body, n, sharers)
        blame(
            unsure[k] & (gap > np.maximum(0.5 * (1.0 - width[k]), 0.1)),
            lambda b: (
                f"(its first atom is {first[0, b]:.0f}) is wider than half the periodic box along {'xyz'[k]}: {width[k, b]:.2f} box lengths by "
                f"its image flags, with a gap of {gap[b]:.2f} inside. A periodic face may cut it, and which images belong together cannot "
                "be told: set the image flags of its atoms (set ... image, or in the data file)"
            ),
        )
    fold = np.rint((delta - nearest) @ box.inverse.T) * cut[:, body].T
    return place, delta - fold @ box.h.T, cut.any(axis=0)


def _widest_gap(parts, body, n, sharers, cells=64):
    """Widest stretch inside each body without atoms, (n,).

    Args:
        parts: (atoms,) the atoms' distances from the end of their body, 0 to 1 (further ones count as at 1).
    """
    filled = np.zeros((cells, n))
    filled[np.clip((parts * cells).astype(int), 0, cells - 1), body] = 1.0
    sharers.combine(filled, np.maximum)
    widest = run = np.zeros(n)
    for row in filled > 0:
        widest = np.where(row, np.maximum(widest, run), widest)
        run = np.where(row, 0.0, run + 1.0)
    return widest / cells


def _principal(products, natoms, order):
    """Principal moments and axes from the sums of m r r (xx yy zz xy xz yz).

    Args:
        order: 321 numbers the moments from the largest to the smallest, 123 the other way
            round (the rotor turns axis 3 outermost); an axis without moment is the third.
    Returns:
        moment (3, n); axes (n, 3, 3), whose columns are a right-handed frame.
    """
    xx, yy, zz, xy, xz, yz = products
    tensor = np.array([[yy + zz, -xy, -xz], [-xy, xx + zz, -yz], [-xz, -yz, xx + yy]]).transpose(2, 0, 1)
    values, axes = np.linalg.eigh(tensor)
    moment, axes = values[:, ::-1].T.copy(), axes[:, :, ::-1].copy()
    single = natoms == 1
    moment[:, single] = 0.0
    axes[single] = np.eye(3)
    linear = moment[2] <= ZERO_MOMENT * moment[0]
    moment[2, linear] = 0.0
    moment[:2, linear] = 0.5 * (moment[0] + moment[1])[linear]
    if order == 123:
        moment[:, ~linear] = moment[::-1, ~linear]
        axes[~linear] = axes[~linear, :, ::-1]
    axes[np.linalg.det(axes) < 0, :, 2] *= -1.0
    return moment, axes


def _quaternion(axes):
    """Unit quaternions (4, n) of rotation matrices (n, 3, 3) whose columns are the body axes."""
    r = axes.transpose(1, 2, 0)
    # four times the products q_i q_j; the row of the largest component is the quaternion, scaled
    products = np.array([
        [1 + r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], 1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
        [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1]],
        [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 - r[0, 0] - r[1, 1] + r[2, 2]],
    ])  # fmt: skip
    largest = np.argmax([products[k, k] for k in range(4)], axis=0)
    q = products[largest, :, np.arange(len(axes))].T
    return q / np.sqrt((q * q).sum(axis=0))
