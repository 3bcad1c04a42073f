"""The paper's equations as they stand, for numbers of any kind: rigid dimers and oscillators, and
integrators of them.

Plain functions of a state x = {p, q} (2.34): momenta first, then coordinates, along the first axis;
further axes are states side by side.  Numbers may be complex, so that derivatives can be taken
through a whole step (see `calculus`).  The free rotor is the package's own,
`fix_nosquish.motion.rotor`.

Units: Angstrom, g/mol, kcal/mol; time in Angstrom sqrt(g/kcal), of which `FS` is a femtosecond.
"""

import re
from collections.abc import Iterator
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from fix_nosquish.motion import rotor

from ..scenes import Scene
from ..scenes.units import COULOMB
from .calculus import Energy, Part, State, composed, leading_term, repeated, strang

FS = 1 / 48.88821291  # LAMMPS's, units real
PERMUTE = {1: rotor.permute_1, 2: rotor.permute_2, 3: rotor.permute_3}


class Dimer:
    """Two rigid molecules of three atoms in empty space, with Lennard-Jones and Coulomb forces
    between them.

    A state has 28 rows: momenta of the centres (3 x 2), conjugate momenta of the quaternions
    (4 x 2), centres (3 x 2), quaternions (4 x 2).  The potential energy depends on q / |q|, so the
    equations hold beside |q| = 1 too, and there they are the paper's.

    Args:
        scene: a `Scene` whose data file and force field are read.

    Attributes:
        mass (2,), moments (3, 2): of the bodies, the largest moment first.
        sites: (3, 2, 3) xyz, body, atom: places in the principal frame.
        start: (28,) the state of the data file.
        atoms: the `Atoms` that the bodies are made of.
    """

    def __init__(self, scene: Scene) -> None:
        mass, charge, kind, r, v, epsilon, sigma = _read(scene)
        self.mass = mass.sum(axis=1)
        centre = np.einsum("ba,iba->ib", mass, r) / self.mass
        momentum, d = np.einsum("ba,iba->ib", mass, v), r - centre[:, :, None]
        spin = np.einsum("ba,iba->ib", mass, np.cross(d, v, axis=0))
        inertia = np.einsum("ba,iba,iba->b", mass, d, d)[:, None, None] * np.eye(3)
        inertia -= np.einsum("ba,iba,jba->bij", mass, d, d)
        moments, axes = np.linalg.eigh(inertia)
        axes = axes[:, :, ::-1]
        axes[:, :, 2] *= np.linalg.det(axes)[:, None]
        q = Rotation.from_matrix(axes).as_quat(scalar_first=True).T
        self.moments, self.sites = moments[:, ::-1].T, np.einsum("bij,iba->jba", axes, d)
        p = 2 * multiply(q, np.concatenate([np.zeros((1, 2)), np.einsum("bij,ib->jb", axes, spin)]))
        self.start, self.atoms = self.join(momentum, p, centre, q), Atoms(self, mass, r, v)
        one, two = kind[0][:, None], kind[1]
        self._epsilon = np.sqrt(epsilon[one] * epsilon[two])
        self._sigma = (sigma[one] + sigma[two]) / 2
        self._charge = COULOMB * charge[0][:, None] * charge[1]

    @staticmethod
    def split(x: State) -> Iterator[np.ndarray]:
        """Momenta of the centres (3, 2, ...) and quaternions (4, 2, ...), centres, quaternions."""
        return (part.reshape(-1, 2, *x.shape[1:]) for part in np.split(x, (6, 14, 20)))

    @staticmethod
    def join(*parts: np.ndarray) -> State:
        """The state of what `split` gives."""
        rest = np.broadcast_shapes(*(np.shape(part)[2:] for part in parts))
        return np.concatenate(
            [np.broadcast_to(part, np.shape(part)[:2] + rest).reshape(-1, *rest) for part in parts]
        )

    def positions(self, x: State) -> np.ndarray:
        """Of the atoms, (3, 2, 3, ...) (2.1)."""
        _, _, centres, q = self.split(x)
        return np.einsum("ijb...,jba->iba...", to_space(q), self.sites) + centres[:, :, None]

    def pair(self, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of atoms at (3, 2, 3, ...): their potential energy, and the forces on them."""
        pairs = self._epsilon, self._sigma, self._charge
        epsilon, sigma, charge = (_beside(value, r, 3) for value in pairs)
        delta = r[:, 0, :, None] - r[:, 1, None]
        r2 = (delta * delta).sum(axis=0)
        sixth, electric = (sigma**2 / r2) ** 3, charge / np.sqrt(r2)
        between = (24 * epsilon * (2 * sixth * sixth - sixth) + electric) / r2 * delta
        energy = 4 * epsilon * (sixth * sixth - sixth) + electric
        forces = np.stack([between.sum(axis=2), -between.sum(axis=1)], axis=1)
        return energy.sum(axis=(0, 1)), forces

    def potential(self, x: State) -> np.ndarray:
        """phi, kcal/mol."""
        return self.pair(self.positions(x))[0]

    def loads(self, x: State) -> tuple[np.ndarray, np.ndarray]:
        """Forces on the centres, space frame, and torques, principal frame, (3, 2, ...) both
        (2.9)."""
        forces = self.pair(self.positions(x))[1]
        *_, q = self.split(x)
        turned = np.einsum("jib...,jba...->iba...", to_space(q), forces)
        torques = np.cross(_beside(self.sites, x), turned, axis=0)
        return forces.sum(axis=2), torques.sum(axis=2)

    def kick(self, x: State, time: float) -> State:
        """The motion under phi alone (2.58, 2.60)."""
        momenta, p, centres, q = self.split(x)
        forces, torques = self.loads(x)
        four = 2 * multiply(q, np.concatenate([0 * torques[:1], torques])) / rotor.dot(q, q)
        return self.join(momenta + time * forces, p + time * four, centres, q)

    def translational(self, x: State) -> np.ndarray:
        """Kinetic energy of the centres."""
        momenta, *_ = self.split(x)
        return ((momenta * momenta).sum(axis=0) / (2 * _beside(self.mass, x))).sum(axis=0)

    def translate(self, x: State, time: float) -> State:
        """The motion of the centres alone."""
        momenta, p, centres, q = self.split(x)
        return self.join(momenta, p, centres + time * momenta / _beside(self.mass, x), q)

    def rotational(self, k: int, x: State) -> np.ndarray:
        """h_k of both bodies (2.18)."""
        _, p, _, q = self.split(x)
        energies = rotor.dot(p, PERMUTE[k](q)) ** 2 / (8 * _beside(self.moments[k - 1], x))
        return energies.sum(axis=0)

    def rotate(self, k: int, x: State, time: float) -> State:
        """The motion under h_k alone (2.56)."""
        momenta, p, centres, q = self.split(x)
        rate = 0.25 / _beside(self.moments[k - 1], x)
        q, p = rotor.rotation(q, p, PERMUTE[k](q), PERMUTE[k](p), rate, time, True)
        return self.join(momenta, np.stack(p), centres, np.stack(q))

    def rotate_freely(self, x: State, time: float) -> State:
        """The package's rotor step."""
        momenta, p, centres, q = self.split(x)
        q, p = rotor.free_rotor(q, p, *_beside(self.moments, x), time, True)
        return self.join(momenta, np.stack(p), centres, np.stack(q))

    def rotor_parts(self) -> list[Part]:
        """h_3, h_2, h_1, outermost first."""
        return [Part(partial(self.rotational, k), partial(self.rotate, k)) for k in (3, 2, 1)]

    def kinetic(self, x: State) -> np.ndarray:
        """Kinetic energy of rotation and translation."""
        return self.translational(x) + sum(part.energy(x) for part in self.rotor_parts())

    def parts(self, mrot: int = 1) -> list[Part]:
        """The force, and all that moves without it, outermost first, as NO_SQUISH has them
        (2.53)."""
        free = composed(self.translate, repeated(self.rotate_freely, mrot))
        return [Part(self.potential, self.kick), Part(self.kinetic, free)]

    def energy(self, x: State) -> np.ndarray:
        """H (2.14), with the kinetic energy of the centres."""
        return self.kinetic(x) + self.potential(x)

    def nosquish(self, x: State, time: float, mrot: int = 1) -> State:
        """One step of (2.53), with velocity Verlet for the centres."""
        return strang(self.parts(mrot))(x, time)

    def second_order_terms(self, radius: float, mrot: int = 1) -> tuple[Energy, Energy]:
        """H^(2) (2.37) of the force splitting and of the rotor splitting, two functions of a state;
        radius: see `taylor`."""
        rotation = leading_term(self.rotor_parts(), radius)
        return leading_term(self.parts(), radius), lambda x: rotation(x) / mrot**2

    def reference_12(self, x: State, time: float) -> State:
        """One step of the paper's reference 12 (2.61): not Hamiltonian, in the Trotter order of
        (2.53).

        The terms of Euler's equations are paired: i L_2 turns w_x and w_y while w_z stays, and
        i L_3 turns w_y and w_z while w_x stays. Both turn at a constant rate, if each w is taken
        times the root of its moment.
        """
        momenta, p, centres, q = self.split(x)
        moments = _beside(self.moments, x)
        w0, *spin = 0.5 * transposed(q, p)  # w0 vanishes, and stays what it is
        forces, torques = self.loads(x)
        momenta, w = momenta + time / 2 * forces, (np.stack(spin) + time / 2 * torques) / moments
        centres = centres + time * momenta / _beside(self.mass, x)
        w = _second(_third(w, moments, time / 2), moments, time / 2)
        size = np.sqrt((w * w).sum(axis=0))
        half = size * time / 2
        # i L_1: dq/dt = S(q) (0, w) / 2
        q = np.cos(half) * q + np.sin(half) / size * multiply(q, np.stack([0 * size, *w]))
        w = _third(_second(w, moments, time / 2), moments, time / 2)
        forces, torques = self.loads(self.join(momenta, p, centres, q))
        momenta, spin = momenta + time / 2 * forces, moments * w + time / 2 * torques
        p = 2 * multiply(q, np.stack([w0 + 0 * size, *spin])) / rotor.dot(q, q)
        return self.join(momenta, p, centres, q)

    def constraints(self, x: State) -> np.ndarray:
        """What is zero where |q| = 1 and w_0 = 0 (2.55), (4, ...)."""
        _, p, _, q = self.split(x)
        return np.concatenate([rotor.dot(q, q) - 1, rotor.dot(q, p)])


class Atoms:
    """The atoms of a `Dimer`, held by their distances: a state has 36 rows, momenta (3 x 6) and
    positions (3 x 6).

    Attributes:
        start: (36,) the state of the data file.
    """

    BONDS = tuple((3 * b + i, 3 * b + j) for b in (0, 1) for i, j in ((0, 1), (0, 2), (1, 2)))

    def __init__(self, dimer: Dimer, mass: np.ndarray, r: np.ndarray, v: np.ndarray) -> None:
        self.dimer, self.mass = dimer, mass.ravel()
        self.start = np.concatenate([(mass * v).ravel(), r.ravel()])
        x = r.reshape(3, 6)
        self.square = {(i, j): ((x[:, i] - x[:, j]) ** 2).sum() for i, j in self.BONDS}

    def shake_rattle(self, x: State, time: float, tolerance: float) -> State:
        """One step of velocity Verlet with SHAKE for positions and RATTLE for velocities, bond
        after bond, round after round.

        Args:
            tolerance: rounds end with one that has found all bonds' |r^2 - d^2| / 2 d^2 within it,
                and for velocities |r . v| time / d^2.
        """
        v, old = self._split(x)
        v = v + time / 2 * self._accelerations(old)

        def bend(r, i, j):
            delta, before = r[:, i] - r[:, j], old[:, i] - old[:, j]
            off = ((delta * delta).sum(axis=0) - self.square[i, j]) / 2
            return off, off / (delta * before).sum(axis=0) * before

        r = self._rounds(bend, old + time * v, tolerance)
        v = (r - old) / time + time / 2 * self._accelerations(r)

        def along(v, i, j):
            delta = r[:, i] - r[:, j]
            off = (delta * (v[:, i] - v[:, j])).sum(axis=0)
            return off * time, off / self.square[i, j] * delta

        momenta = _beside(self.mass, x) * self._rounds(along, v, tolerance)
        return np.concatenate([part.reshape(18, *x.shape[1:]) for part in (momenta, r)])

    def constraints(self, x: State) -> np.ndarray:
        """What is zero where distances are kept and velocities along them vanish, (12, ...)."""
        v, r = self._split(x)
        bonds = [(r[:, i] - r[:, j], v[:, i] - v[:, j], self.square[i, j]) for i, j in self.BONDS]
        lengths = [(d * d).sum(axis=0) - square for d, _, square in bonds]
        return np.stack([*lengths, *((d * u).sum(axis=0) for d, u, _ in bonds)])

    def _split(self, x):
        p, r = (part.reshape(3, 6, *x.shape[1:]) for part in np.split(x, 2))
        return p / _beside(self.mass, x), r

    def _accelerations(self, r):
        forces = self.dimer.pair(r.reshape(3, 2, 3, *r.shape[2:]))[1]
        return forces.reshape(r.shape) / _beside(self.mass, r, 2)

    def _rounds(self, wrong, y, tolerance):
        """Correct y (3, 6, ...) until ``wrong`` (how far off a bond is, and along what its atoms
        must move) finds nothing."""
        y, worst = y.copy(), np.inf
        while worst > tolerance:
            worst = 0.0
            for i, j in self.BONDS:
                off, change = wrong(y, i, j)
                worst = max(worst, np.abs(off.real).max() / self.square[i, j])
                change = change / (1 / self.mass[i] + 1 / self.mass[j])
                y[:, i] -= change / self.mass[i]
                y[:, j] += change / self.mass[j]
        return y


class Oscillator:
    """The isotropic harmonic oscillator (2.50): a state has so many momenta, then as many
    coordinates."""

    def __init__(self, mass: float, omega: float) -> None:
        self.mass, self.omega, self.stiffness = mass, omega, mass * omega**2

    def potential(self, x: State) -> np.ndarray:
        """m w^2 q^2 / 2."""
        return self.stiffness * (np.split(x, 2)[1] ** 2).sum(axis=0) / 2

    def kinetic(self, x: State) -> np.ndarray:
        """p^2 / 2 m."""
        return (np.split(x, 2)[0] ** 2).sum(axis=0) / (2 * self.mass)

    def kick(self, x: State, time: float) -> State:
        """The motion under the potential alone."""
        p, q = np.split(x, 2)
        return np.concatenate([p - time * self.stiffness * q, q + 0 * time])

    def drift(self, x: State, time: float) -> State:
        """The motion without force."""
        p, q = np.split(x, 2)
        return np.concatenate([p + 0 * time, q + time / self.mass * p])

    def parts(self) -> list[Part]:
        """The force, then the motion without it: velocity Verlet."""
        return [Part(self.potential, self.kick), Part(self.kinetic, self.drift)]

    def energy(self, x: State) -> np.ndarray:
        """H (2.50)."""
        return self.kinetic(x) + self.potential(x)

    def integrator_hamiltonian(self, x: State, dt: float) -> np.ndarray:
        """(2.51): what velocity Verlet conserves, and whose motion it is.

        Its arccos(1 - a^2 / 2) is written as 2 arcsin(a / 2), which is the same and can be
        differentiated at a = 0.
        """
        half = self.omega * dt / 2
        stretch = np.sqrt(1 - half**2)
        return (self.kinetic(x) / stretch + self.potential(x) * stretch) * np.arcsin(half) / half


def multiply(q: np.ndarray, a: np.ndarray) -> np.ndarray:
    """S(q) a (2.6), (4, ...)."""
    return sum((np.stack(permute(q)) * a[k] for k, permute in PERMUTE.items()), q * a[0])


def transposed(q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """S(q)^T p, (4, ...)."""
    return np.stack([rotor.dot(q, p), *(rotor.dot(permute(q), p) for permute in PERMUTE.values())])


def to_space(q: np.ndarray) -> np.ndarray:
    """A(q)^T / |q|^2 (2.3), (3, 3, ...): from the principal to the space frame."""
    a, b, c, d = q
    return np.array([
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ]) / rotor.dot(q, q)  # fmt: skip


def _second(w, moments, time):
    """i L_2 of (2.61)."""
    (ix, iy, iz), (wx, wy, wz) = moments, w
    wx, wy = _along_ellipse(wx, wy, ix, iy, time * (iy - iz) * wz)
    return np.stack([wx, wy, wz + 0 * wx])


def _third(w, moments, time):
    """i L_3 of (2.61)."""
    (ix, iy, iz), (wx, wy, wz) = moments, w
    wy, wz = _along_ellipse(wy, wz, iy, iz, time * (iy - ix) * wx)
    return np.stack([wx + 0 * wy, wy, wz])


def _along_ellipse(a, b, moment_a, moment_b, turn):
    """a and b after a turn, which keeps moment_a a^2 + moment_b b^2:

    da = turn / moment_a b
    db = -turn / moment_b a
    """
    root_a, root_b = np.sqrt(moment_a), np.sqrt(moment_b)
    angle = turn / (root_a * root_b)
    c, s = np.cos(angle), np.sin(angle)
    return c * a + s * root_b / root_a * b, c * b - s * root_a / root_b * a


def _beside(values, x, axes=1):
    """Values with as many axes behind as x has behind its first ones."""
    return values.reshape(values.shape + (1,) * (x.ndim - axes))


def _read(scene):
    """Of a scene of two molecules of three atoms: masses, charges, types (2, 3), positions and
    velocities (3, 2, 3), and epsilon and sigma by type."""
    starts = "read_data ", "include "
    words = dict(line.split(maxsplit=1) for line in scene.setup if line.startswith(starts))
    data, field = ((scene.folder / words[key.strip()]).read_text() for key in starts)
    sections = re.findall(r"^(Masses|Atoms|Velocities)\b.*\n\n((?:.+\n)+)", data, re.MULTILINE)
    table = {title: np.loadtxt(rows.splitlines(), ndmin=2) for title, rows in sections}
    sorted_ = (table[name][table[name][:, 0].argsort()] for name in ("Atoms", "Velocities"))
    atoms, velocities = sorted_
    kind, of_type = atoms[:, 2].astype(int).reshape(2, 3), dict(table["Masses"])
    lines = re.findall(r"^pair_coeff\s+(\d+)\s+\1\s+(\S+)\s+(\S+)", field, re.MULTILINE)
    pairs = {int(i): (float(e), float(s)) for i, e, s in lines}
    epsilon, sigma = np.array([pairs.get(i, (0, 0)) for i in range(max(pairs) + 1)]).T
    r, v = (rows.T.reshape(3, 2, 3) for rows in (atoms[:, 4:7], velocities[:, 1:4] / FS))
    return np.vectorize(of_type.get)(kind), atoms[:, 3].reshape(2, 3), kind, r, v, epsilon, sigma
