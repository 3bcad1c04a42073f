"""Small boxes of rigid Lennard-Jones bodies of many shapes, and what a run of one leaves: for `breaks`, and for tests."""

import itertools
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

OURS = 'fix 1 {group} python/move "fix_nosquish.NVE {group} {words}"'
LIKE_LAMMPS = OURS.replace("{words}", "{words} order 123")
RIGID = "fix 1 {group} rigid/nve {words}"
SMALL = "fix 1 {group} rigid/nve/small {words}"


# ---- systems


class System(NamedTuple):
    """The first part of an input script, its files, and what is known of the atoms.

    `group` holds all bodies that LAMMPS's fix rigid takes, `singles` are there if it does not take all.
    """

    setup: str
    files: dict
    h: np.ndarray
    dt: float
    group: str = "bodies"
    singles: bool = False
    mass: np.ndarray = None
    molecule: np.ndarray = None


class Units(NamedTuple):
    """A Lennard-Jones system's length, mass and energy in LAMMPS's units, and mass v^2 / energy there."""

    length: float = 1.0
    mass: float = 1.0
    energy: float = 1.0
    mvv2e: float = 1.0

    @property
    def time(self):
        return self.length * np.sqrt(self.mass * self.mvv2e / self.energy)


UNITS = {
    "lj": Units(),
    "real": Units(3.4, 12.0, 0.24, 48.88821291**2),
    "metal": Units(3.4, 12.0, 0.0104, 1.0364269e-4),
    "si": Units(3.4e-10, 2e-26, 1.66e-21, 1.0),
}

# shapes in units of the Lennard-Jones diameter, with the type of each atom
SHAPES = {
    "solid": (
        [[0, 0, 0], [0.9, 0.1, 0], [-0.2, 0.7, 0.1], [0.1, -0.3, 0.8], [-0.6, -0.4, -0.2]],
        [1, 2, 3, 1, 2],
    ),
    "planar": ([[0, 0, 0], [0.9, 0.1, 0], [-0.3, 0.6, 0], [0.2, -0.5, 0]], [2, 1, 3, 1]),
    "pair": ([[-0.5, 0, 0], [0.5, 0, 0]], [1, 2]),
    "row": ([[-0.8, 0, 0], [0, 0, 0], [0.6, 0, 0]], [3, 1, 2]),
    "single": ([[0, 0, 0]], [2]),
}
MASSES = np.array([1.0, 1.6, 0.4])

TETRAHEDRON = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 0.3
CUBE = np.array(list(itertools.product([-0.3, 0.3], repeat=3)))
OCTAHEDRON = np.concatenate([np.eye(3), -np.eye(3)]) * 0.45
OCTAHEDRON_ROUND = 0.6 * np.array(
    [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]]
)
HEXAGON = np.array([[np.cos(a), np.sin(a), 0] for a in np.arange(6) * np.pi / 3]) * 0.5
TOPS = {  # symmetric and spherical
    "methane": ([*TETRAHEDRON, [0, 0, 0]], [3, 3, 3, 3, 1]),
    "tetrahedron": (TETRAHEDRON, [1, 1, 1, 1]),
    "cube": (CUBE, [3] * 8),
    "octahedron": (OCTAHEDRON, [1] * 6),
    "ammonia": ([*TETRAHEDRON[1:], [0, 0, 0]], [3, 3, 3, 1]),
    "chloromethane": ([*TETRAHEDRON, [0, 0, 0]], [2, 3, 3, 3, 1]),
    "benzene": (HEXAGON, [1] * 6),
    # the tags of the same octahedron's atoms go round it otherwise
    "sulfurhexafluoride": (OCTAHEDRON_ROUND, [1] * 6),
    "seleniumhexafluoride": (OCTAHEDRON_ROUND, [2] * 6),
    "uraniumhexafluoride": (OCTAHEDRON_ROUND, [3] * 6),
    "nearlycube": (CUBE * [1, 1 + 1e-8, 1 - 1e-8], [3] * 8),
}
SHAPES |= {name: (np.array(shape), types) for name, (shape, types) in TOPS.items()}


def assemble(
    bodies, h, *, units="lj", dimension=3, flags=True, temperature=1.0, dt=0.002, seed=1, setup=""
):
    """A System of Lennard-Jones atoms with random velocities, which are not rigid motion.

    Args:
        bodies: A list of (kind, positions, types).
        h: The box, columns are its vectors; positions may be outside.
        flags: Whether the data file has the image flags, or says 0 0 0.
    """
    u, rng = UNITS[units], np.random.default_rng(seed)
    molecule = np.concatenate([[k + 1] * len(x) for k, (_, x, _) in enumerate(bodies)])
    x = np.concatenate([x for _, x, _ in bodies])
    kind = np.concatenate([types for *_, types in bodies])
    mass = MASSES[kind - 1]
    image = np.floor(x @ np.linalg.inv(h).T + 1e-12).astype(int)
    if dimension == 2:
        image[:, 2] = 0
    x = x - image @ h.T
    v = rng.normal(size=x.shape) * np.sqrt(temperature / mass)[:, None]
    v[:, dimension:] = 0
    v -= mass @ v / mass.sum()
    low = -0.5 * h[2, 2] if dimension == 2 else 0.0
    tilt = [h[0, 1], h[0, 2], h[1, 2]]
    lines = ["bodies", "", f"{len(x)} atoms", f"{len(MASSES)} atom types", ""]
    lines += [f"0 {h[0, 0] * u.length:.17g} xlo xhi", f"0 {h[1, 1] * u.length:.17g} ylo yhi"]
    lines += [f"{low * u.length:.17g} {(low + h[2, 2]) * u.length:.17g} zlo zhi"]
    lines += (
        ["{:.17g} {:.17g} {:.17g} xy xz yz".format(*np.multiply(tilt, u.length))]
        if any(tilt)
        else []
    )
    lines += ["", "Masses", "", *(f"{k + 1} {m * u.mass:.17g}" for k, m in enumerate(MASSES))]
    lines += ["", "Atoms # molecular", ""]
    for k in range(len(x)):
        place = " ".join(f"{c:.17g}" for c in x[k] * u.length)
        lines += [
            f"{k + 1} {molecule[k]} {kind[k]} {place} " + "{} {} {}".format(*image[k] * flags)
        ]
    lines += ["", "Velocities", ""]
    lines += [
        f"{k + 1} " + " ".join(f"{c:.17g}" for c in v[k] * (u.length / u.time))
        for k in range(len(x))
    ]
    names = [name for name, *_ in bodies]
    groups = {
        name: [k + 1 for k, other in enumerate(names) if other == name]
        for name in sorted(set(names))
    }
    text = [
        f"units {units}", f"dimension {dimension}", "atom_style molecular", "atom_modify map array", setup,
        "read_data data.bodies",
        f"pair_style lj/cut {2.5 * u.length:.17g}", f"pair_coeff * * {u.energy:.17g} {u.length:.17g}",
        f"neighbor {0.4 * u.length:.17g} bin", "neigh_modify every 1 delay 0 check yes exclude molecule/intra all",
        *(f"group {name} molecule " + " ".join(map(str, ids)) for name, ids in groups.items()),
        "group bodies " + ("subtract all single" if "single" in groups else "union all"),
    ]  # fmt: skip
    return System("\n".join(text), {"data.bodies": "\n".join(lines) + "\n"}, h * u.length, dt * u.time,
                  singles="single" in groups, mass=mass * u.mass, molecule=molecule)  # fmt: skip


def turned(kind, place, others, h, rng):
    """A body (kind, positions, types) of a shape at a place, turned at random so that it overlaps with no other."""
    shape, types = SHAPES[kind]
    for _ in range(1000):
        flat = h[2, 2] == 1  # two dimensions
        turn = (
            Rotation.from_rotvec([0, 0, rng.uniform(0, 6.3)])
            if flat
            else Rotation.from_quat(rng.normal(size=4))
        )
        x = turn.apply(shape) + place
        gap = np.inf
        for _, y, _ in others:
            delta = x[:, None] - y
            delta -= np.rint(delta @ np.linalg.inv(h).T) @ h.T
            gap = min(gap, np.linalg.norm(delta, axis=2).min())
        if gap > 0.9:
            return kind, x, np.array(types)
    raise RuntimeError("no room")


def mixture(
    kinds="solid planar pair row single",
    *,
    side=3,
    tilt=0.0,
    spacing=2.55,
    dimension=3,
    seed=1,
    **more,
):
    """Bodies of these kinds in turn, each turned at random, on a lattice that the box's faces cut.

    No distance in the lattice is the cutoff, at which the potential energy jumps."""
    rng = np.random.default_rng(seed)
    count = np.array([side, side, side if dimension == 3 else 1])
    h = spacing * side * np.array([[1, tilt, -tilt / 2], [0, 1, tilt / 3], [0, 0, 1.0]])
    if dimension == 2:
        h[:, 2] = 0, 0, 1
    bodies = []
    for kind, site in zip(itertools.cycle(kinds.split()), itertools.product(*map(range, count))):
        bodies.append(turned(kind, h @ (site / count), bodies, h, rng))
    bodies.sort(key=lambda body: list(SHAPES).index(body[0]))
    return assemble(bodies, h, dimension=dimension, seed=seed, **more)


# ---- runs


class Result(NamedTuple):
    """Atoms in order of ID at the end of a run, the thermo table, and the log."""

    x: np.ndarray
    v: np.ndarray
    thermo: np.ndarray
    log: str


def script(
    system,
    fix,
    steps,
    *,
    words="molecule",
    group=None,
    dt=1.0,
    every=10,
    before="",
    columns="",
    after="",
):
    """The input that runs a `System` with a fix, and writes its atoms to the file ``end``.

    Args:
        fix: a LAMMPS line with the words ``{group}`` and ``{words}``; LAMMPS's own fixes leave single atoms to fix nve.
        dt: time step, in units of the system's own.
        before, after: further lines: before the fix, and after the run.
    """
    ours = "python/move" in fix
    group = group or ("all" if ours else system.group)
    return "\n".join([
        system.setup, before, fix.format(group=group, words=words),
        "" if ours or not system.singles else "fix 2 single nve",
        f"thermo_style custom step temp press pe etotal pxx pyy pzz pxy pxz pyz {columns}",
        "thermo_modify format float %.16g norm no", f"thermo {every}",
        f"timestep {dt * system.dt:.17g}", f"run {steps}", after,
        "write_dump all custom end id x y z vx vy vz modify sort id format float %.16g", "",
    ])  # fmt: skip


def result(path, thermo, log):
    """The `Result` whose atoms `script` has written to a file."""
    atoms = np.loadtxt(path, skiprows=9)
    return Result(atoms[:, 1:4], atoms[:, 4:], thermo, log)


def apart(a, b, h):
    """The largest distance between atoms of two Results, nearest images."""
    delta = a.x - b.x
    delta -= np.rint(delta @ np.linalg.inv(h).T) @ h.T
    return np.linalg.norm(delta, axis=1).max()


def tensor(result):
    """The six pressure components of all printed steps, (steps, 6)."""
    return np.stack(
        [result.thermo[name] for name in ("Pxx", "Pyy", "Pzz", "Pxy", "Pxz", "Pyz")], axis=1
    )
