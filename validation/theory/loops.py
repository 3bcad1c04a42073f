"""The compiled loops of the fix, bound without LAMMPS: whole steps of bodies whose atoms attract or
repel each other, as functions of a state.

A state x has 14 n rows, as in `reference`: momenta of the centres (3 n) and conjugate
momenta of the quaternions (4 n), then centres and quaternions.  Its derivatives are central
differences: the machine code takes no complex numbers.
"""

import itertools
from collections.abc import Iterator

import numpy as np

# as LAMMPS imports it: by another name it would be compiled once more
from fix_nosquish_validation.schemes.matubayasi_nakahara import MatubayasiNakahara
from scipy.linalg import block_diag, null_space

from fix_nosquish.bodies.bodies import MASS, MOMENT, Bodies, P, Q, V, X
from fix_nosquish.integrators.nve import NVE
from fix_nosquish.loops.compiled import F2, Cell, F
from fix_nosquish.motion import block, step
from fix_nosquish.motion.operations import Parameters

from .calculus import restricted
from .reference import PERMUTE, _second, _third, multiply, to_space

SCHEMES = {"NVE": NVE, "MatubayasiNakahara": MatubayasiNakahara}
# principal moments, the largest first, of bodies of unit mass; order 123 has them in reverse
KINDS = {
    "solid": (1.0, 0.7, 0.4),
    "planar": (1.0, 0.65, 0.35),
    "equal moments": (0.6, 0.6, 0.6),
    "nearly linear": (1.0, 1.0 - 1e-5, 1e-5),
    "linear": (0.8, 0.8, 0.0),
    "point": (0.0, 0.0, 0.0),
}
ATOMS = 3  # of a body
Sizes = float | np.ndarray
STEP = 0.01  # the longest of the differences' steps; their error falls as its sixth power


class Scene:
    """Bodies of one kind, of three atoms each, in the fix's own loops.

    Args:
        kind: of `KINDS`.  n: number of bodies.  rng: for places of atoms, charges and the start.
        scheme: of `SCHEMES`.  order: 321 or 123.  mrot: number of inner steps.

    Attributes:
        moments: (3,), as the loops have them.
        sites: (3, n, ATOMS) places of the atoms in the principal frames.
    """

    def __init__(
        self,
        kind: str,
        n: int,
        rng: np.random.Generator,
        scheme: str = "NVE",
        order: int = 321,
        mrot: int = 1,
    ) -> None:
        self.kind, self.n, self.mrot = kind, n, mrot
        ordered = order == 321 or kind in ("linear", "point")
        self.moments = np.array(KINDS[kind] if ordered else KINDS[kind][::-1])
        self.sites = rng.uniform(-0.6, 0.6, (3, n, ATOMS))
        if kind == "linear":
            self.sites[:2] = 0.0
        if kind == "nearly linear":
            self.sites[:2] *= np.sqrt(KINDS[kind][2])
        if kind == "point":
            self.sites[:] = 0.0
        self.charge = rng.uniform(-1, 1, (n * ATOMS, n * ATOMS))
        self.charge = np.triu(self.charge, 1) + np.triu(self.charge, 1).T
        self.charge *= np.kron(1 - np.eye(n), np.ones((ATOMS, ATOMS)))  # none within a body
        state = np.zeros((block.ROWS, n))
        state[MASS], state[MOMENT], state[block.Q] = 1.0, self.moments[:, None], 1.0
        state[block.NATOMS], state[block.ID] = ATOMS, np.arange(n)
        body, index = np.repeat(np.arange(n), ATOMS), np.arange(n * ATOMS, dtype=np.int32)
        places = np.concatenate([self.sites.reshape(3, -1), index[None]])
        self.bodies = Bodies(state, body, places, index, False, False)
        self.r, self.f = np.zeros((n * ATOMS, 3)), np.zeros((n * ATOMS, 3))
        cells = self.bodies.cells | {
            "atom_x": Cell(F2, self.r),
            "atom_f": Cell(F2, self.f),
            "atom_v": Cell(F2, np.zeros_like(self.r)),
        }
        self.dt = Cell(F)
        cells |= {"dt": self.dt, "parameters": Parameters.new(ftm2v=1.0, mrot=mrot)}
        whole = {"gathers": step.GATHERS, "ends": False, "begins": True, "part": block.ALL}
        self.gather = step.gather.bind_to(cells, all_bodies=True)
        self.advance = SCHEMES[scheme].advance.bind_to(cells, **whole)
        self.kick = SCHEMES[scheme].tail.bind_to(cells)

    def random(
        self, rng: np.random.Generator, turn: Sizes = 0.3, strength: Sizes = 0.3
    ) -> np.ndarray:
        """A state whose bodies turn by up to `turn` in a unit of time."""
        q = rng.normal(size=(4, self.n))
        q /= np.linalg.norm(q, axis=0)
        spin = rng.normal(size=(3, self.n))
        spin /= np.linalg.norm(spin, axis=0)
        # turns about its axis as fast as that, about the others as its energy has it
        if self.kind == "nearly linear":
            spin[self.moments > 0.5] *= np.sqrt(self.moments.min())
        L = turn * self.moments[:, None] * spin
        p = 2 * multiply(q, np.concatenate([np.zeros((1, self.n)), L]))
        momenta, centres = strength * rng.normal(size=(3, self.n)), rng.normal(size=(3, self.n))
        return np.concatenate([part.ravel() for part in (momenta, p, centres, q)])

    def split(self, x: np.ndarray) -> Iterator[np.ndarray]:
        """Momenta (3, n), p (4, n), centres (3, n), q (4, n)."""
        n = self.n
        return (part.reshape(-1, n) for part in np.split(x, (3 * n, 7 * n, 10 * n)))

    def step(self, x: np.ndarray, dt: float, forces: np.ndarray | None = None) -> np.ndarray:
        """The state after a step of the compiled loops.

        Args:
            forces: on the atoms (atoms, 3), always the same; by default those of the potential.
        """
        state, order = self.bodies.state, self.bodies.id
        momenta, p, centres, q = (part[:, order] for part in self.split(x))
        state[V], state[P], state[X], state[Q] = momenta, p, centres, q
        self.dt.set(float(dt))
        self.f[:] = self.forces(self.positions(x)) if forces is None else forces
        self.gather()
        self.advance()  # half a kick, drift, rotation, places
        if forces is None:
            self.f[:] = self.forces(self.r)
        self.gather()
        self.kick()
        back = np.argsort(order)
        return np.concatenate([state[rows][:, back].ravel() for rows in (V, P, X, Q)])

    def positions(self, x: np.ndarray) -> np.ndarray:
        """Of the atoms, (atoms, 3), by (2.1)."""
        *_, centres, q = self.split(x)
        arms = np.einsum("ijb,jba->iba", to_space(q), self.sites)
        return (arms + centres[:, :, None]).reshape(3, -1).T

    def forces(self, r: np.ndarray) -> np.ndarray:
        """On the atoms (atoms, 3), of the potential sum of c exp(-r^2 / 2) over pairs of atoms in
        different bodies."""
        delta = r[:, None] - r[None]
        size = self.charge * np.exp(-0.5 * (delta**2).sum(axis=2))
        return (size[:, :, None] * delta).sum(axis=1)

    def model(
        self, x: np.ndarray, dt: float, forces: np.ndarray, scheme: str = "NVE"
    ) -> np.ndarray:
        """A step by the paper's equations as they stand, in numpy, with these forces on the atoms
        (atoms, 3)."""
        momenta, p, centres, q = self.split(x)
        f = forces.T.reshape(3, self.n, ATOMS)

        def kicked(momenta, p, q):
            arms = np.einsum("ijb,jba->iba", to_space(q), self.sites)
            torque = np.einsum("jib,jb->ib", to_space(q), np.cross(arms, f, axis=0).sum(axis=2))
            four = multiply(q, np.concatenate([np.zeros((1, self.n)), torque]))
            return momenta + dt / 2 * f.sum(axis=2), p + dt * four

        momenta, p = kicked(momenta, p, q)
        centres = centres + dt * momenta
        for _ in range(self.mrot):
            q, p = self._rotated(q, p, dt / self.mrot, scheme)
        momenta, p = kicked(momenta, p, q)
        return np.concatenate([part.ravel() for part in (momenta, p, centres, q)])

    def _rotated(self, q, p, dt, scheme):
        """Free rotation: (2.53), or (2.61); of a linear body exact in both."""
        if self.kind == "point":
            return q, p
        L = 0.5 * np.stack([(p * np.stack(PERMUTE[k](q))).sum(axis=0) for k in (1, 2, 3)])
        if self.kind == "linear" or scheme != "NVE":
            moments = np.where(self.moments > 0, self.moments, np.inf)[:, None]
            w = L / moments
            if self.kind != "linear":
                w = _second(_third(w, moments, dt / 2), moments, dt / 2)
            size = np.sqrt((w**2).sum(axis=0))
            half = np.sinc(size * dt / 2 / np.pi) * dt / 2
            turn = np.concatenate([np.cos(size * dt / 2)[None], half * w])
            q, p = multiply(q, turn), multiply(p, turn)
            if self.kind != "linear":
                w = _third(_second(w, moments, dt / 2), moments, dt / 2)
                p = 2 * multiply(q, np.concatenate([np.zeros((1, self.n)), moments * w]))
            return q, p
        for k, time in (3, dt / 2), (2, dt / 2), (1, dt), (2, dt / 2), (3, dt / 2):
            angle = time / (4 * self.moments[k - 1]) * (p * np.stack(PERMUTE[k](q))).sum(axis=0)
            c, s = np.cos(angle), np.sin(angle)
            q, p = c * q + s * np.stack(PERMUTE[k](q)), c * p + s * np.stack(PERMUTE[k](p))
        return q, p

    def apart(self, rng: np.random.Generator, scheme: str = "NVE") -> tuple[float, float]:
        """How far a step of the loops and one of `model` lead apart, of bodies that turn by 1e-8 to
        10 rad in it, with random forces.

        That is relative to the size of each momentum, place and quaternion, and to how much larger
        the equations make a relative change of what they start from, if they do: the faster a body
        turns, the more they make of rounding.

        Returns:
            the largest of all bodies, and that of the bodies that turn by at most 1 rad without
            regard to the latter.
        """
        turn, tiny = 10 ** rng.uniform(-8, 1, self.n), 1e-8
        x = self.random(rng, turn, turn)
        least = min((moment for moment in self.moments if moment > 0), default=1.0)
        forces = 0.3 * least * np.repeat(turn, ATOMS)[:, None] * rng.normal(size=self.f.shape)
        model = self.model(x, 1.0, forces, scheme)
        other = self.model(x * (1 + tiny * rng.normal(size=len(x))), 1.0, forces, scheme)
        apart = self._relative(self.step(x, 1.0, forces), model, x)
        response = self._relative(other, model, x) / tiny
        return float((apart / np.maximum(1, response)).max()), float(apart[turn <= 1].max())

    def _relative(self, y, z, x):
        """How far states y and z are apart, by body (n,), over the sizes of what is in z and x."""
        worst = np.zeros(self.n)
        for one, other, start in zip(self.split(y), self.split(z), self.split(x)):
            size = np.linalg.norm(other, axis=0) + np.linalg.norm(start, axis=0)
            off = np.linalg.norm(one - other, axis=0) / np.where(size > 0, size, 1.0)
            worst = np.maximum(worst, off)
        return worst

    # ------------------------------------------------------------- phase space

    def basis(self, x: np.ndarray) -> np.ndarray:
        """Directions (14 n, m) that span the bodies' phase space at x: |q| = 1 and w_0 = 0 (2.55);
        a point has no orientation, a linear body neither spin nor angle about its axis (the
        direction (P_3 p, P_3 q) changes nothing)."""
        _, p, _, q = self.split(x)
        blocks = []
        for b in range(self.n):
            rows = [np.concatenate([0 * q[:, b], q[:, b]]), np.concatenate([q[:, b], p[:, b]])]
            if self.kind == "linear":
                q3, p3 = (np.stack(PERMUTE[3](a[:, b])) for a in (q, p))
                # of p . P_3 q, and along the turn
                rows += [np.concatenate([q3, -p3]), np.concatenate([p3, q3])]
            blocks.append(np.eye(8) if self.kind == "point" else np.stack(rows))
        inner = block_diag(*(null_space(block) for block in blocks))
        full, n = np.zeros((14 * self.n, 6 * self.n + inner.shape[1])), self.n
        centres = np.concatenate([np.arange(3 * n), 7 * n + np.arange(3 * n)])
        full[centres, np.arange(6 * n)] = 1.0
        turning = [
            start + n * k + b for b in range(n) for start in (3 * n, 10 * n) for k in range(4)
        ]
        full[turning, 6 * n :] = inner
        return full

    def derivative(
        self, x: np.ndarray, directions: np.ndarray, dt: float
    ) -> tuple[np.ndarray, float]:
        """The step's derivatives along directions (14 n, m), by central differences extrapolated
        twice.

        Returns:
            (14 n, m); the largest change of it that leaving out the last extrapolation makes, which
            bounds its truncation error.
        """

        def difference(h):
            ends = [(self.step(x + h * v, dt), self.step(x - h * v, dt)) for v in directions.T]
            return np.transpose([(there - back) / (2 * h) for there, back in ends])

        rows = map(difference, (STEP, STEP / 2, STEP / 4))
        once = [(4 * fine - coarse) / 3 for coarse, fine in itertools.pairwise(rows)]
        return (16 * once[1] - once[0]) / 15, float(np.abs(once[1] - once[0]).max() / 15)

    def defects(self, x: np.ndarray, dt: float) -> tuple[float, float, float]:
        """What a step loses of the symplectic property (2.42) and of volume on this phase space,
        and the error of the differences."""
        basis = self.basis(x)
        moved, error = self.derivative(x, basis, dt)
        lost, volume = restricted(moved, basis)
        return lost, abs(volume - 1), error

    def returned(self, x: np.ndarray, dt: float, steps: int) -> float:
        """How far from the start so many steps forward, momenta reversed, and as many steps back
        end, largest of all components."""
        turned = np.concatenate([-np.ones(7 * self.n), np.ones(7 * self.n)])
        y = x
        for _ in range(steps):
            y = self.step(y, dt)
        y = turned * y
        for _ in range(steps):
            y = self.step(y, dt)
        return float(np.abs(turned * y - x).max())
