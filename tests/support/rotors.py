"""Free bodies in quaternions, by the paper's own formulas, and bodies of one atom for the loops."""

import numpy as np

from fix_nosquish.bodies.bodies import MASS, MOMENT, Bodies, aligned
from fix_nosquish.bodies.bodies import P as P_ROWS
from fix_nosquish.bodies.bodies import Q as Q_ROWS
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.loops.memory import Memory
from fix_nosquish.motion import block
from fix_nosquish.ranks.arrangement import BodyRows

ASYMMETRIC = np.array([3.0, 1.7, 0.8])
# The matrices P_k of eq. 2.18, and S(q) of eq. 2.14 whose columns are (q, P_1 q, P_2 q, P_3 q).
P = {
    1: np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, -1, 0]]),
    2: np.array([[0, 0, -1, 0], [0, 0, 0, -1], [1, 0, 0, 0], [0, 1, 0, 0]]),
    3: np.array([[0, 0, 0, -1], [0, 0, 1, 0], [0, -1, 0, 0], [1, 0, 0, 0]]),
}


def S(q):
    return np.stack([q, P[1] @ q, P[2] @ q, P[3] @ q], axis=1)


def product(a, b):
    """Hamilton's product of quaternions, (4, n)."""
    return np.array([
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ])  # fmt: skip


def conjugate(q):
    return np.concatenate([q[:1], -q[1:]])


def body_momentum(q, p):
    """(4, n): half of S(q)^T p; the zeroth component, which is to vanish,
    and L in the body frame."""
    return 0.5 * product(conjugate(q), p)


def space_momentum(q, p):
    return 0.5 * product(p, conjugate(q))[1:]


def energy(q, p, moments):
    return (body_momentum(q, p)[1:] ** 2 / (2 * moments[:, None])).sum(axis=0)


def tops(n, moments, seed, speed=1.0):
    """Random orientations, and the angular momenta of thermal equilibrium;
    axes without moment are at rest."""
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(4, n))
    q /= np.linalg.norm(q, axis=0)
    L = speed * rng.normal(size=(3, n)) * np.sqrt(moments)[:, None]
    return q, 2.0 * product(q, np.concatenate([np.zeros((1, n)), L]))


def one_atom_bodies(q, p, moments, own_rows=0):
    """Bodies of mass 1 and one atom each, at rest at the origin, with q and p (4, n);
    moments: (3,) or (3, n)."""
    n = q.shape[1]
    memory = Memory("bodies", BodyRows)
    memory.put("displace", np.zeros((4, n)))
    state = memory.new("state", (block.ROWS + own_rows, n))
    state[:] = 0.0
    state[MASS], state[MOMENT], state[Q_ROWS], state[P_ROWS] = (
        1.0,
        np.reshape(moments, (3, -1)),
        q,
        p,
    )
    state[block.ID] = number = np.arange(n)
    return Bodies(memory, number, number, False, False)


def step_cells(integrator, bodies, dt, mrot=1):
    """What the loops of an integrator's step take, for `one_atom_bodies` in units of ftm2v = 1."""
    n, rows = len(bodies), block.BLOCK_ROWS + integrator.rows + integrator.work
    atoms = {"atom_x": np.empty((n, 3)), "atom_f": np.empty((n, 3))}
    parameters = {"dt": dt, "parameters": integrator.numbers(ftm2v=1.0, mrot=mrot)}
    return bodies.cells | atoms | parameters | {"block": aligned((rows, block.LANES))}


def advance(q, p, moments, dt, steps=1, mrot=1):
    """`one_atom_bodies` without forces: their q and p after some steps."""
    bodies = one_atom_bodies(q, p, moments)
    cells = step_cells(NVE, bodies, dt, mrot)
    step = NVE.scheme.advance.bind_to(cells, gathers=0, ends=0, begins=0, part=block.ALL)
    for _ in range(steps):
        step()
    order = np.argsort(bodies.id)
    return bodies.q[:, order], bodies.p[:, order]
