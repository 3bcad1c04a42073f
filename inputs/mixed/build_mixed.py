"""Build data.mixed: flexible chains and rigid bodies of 2 to 200 atoms, Lennard-Jones units, T = 1.

    python build_mixed.py

Eight bodies of each shape: a dumbbell, a bent triatomic, a rod of 5 atoms, and irregular
lumps of 13, 40 and 200 atoms, cut from a simple cubic lattice; between them 32 chains
of 20 atoms.  The largest lumps start on a grid, everything else at random where there is
room; LAMMPS equilibrates with Langevin dynamics (rigid bodies, forcefield.mixed), and the
velocities are scaled to T = 1 at the end.

Random numbers have fixed seeds: the same LAMMPS gives the same file.  That takes 15 seconds.
Needs numpy, scipy and the lammps module.
"""

import contextlib
from pathlib import Path

import numpy as np
from lammps import lammps
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

with contextlib.suppress(ImportError):
    from mpi4py import MPI  # noqa: F401  lets PyPI's lammps find the MPI library

HERE = Path(__file__).resolve().parent
OUTPUT, START = HERE / "data.mixed", HERE / "data.mixed.start"
SEED = 200
BOX = 20.0
EACH = 8
LUMPS = 200, 40, 13  # atoms
CHAINS, BEADS, BOND = 32, 20, 0.97
CLOSEST = 0.95  # distance of two atoms of different bodies at the start
STEPS, DT = 20000, 0.004


def shapes(rng):
    """The bodies, largest first: a list of positions (n, 3)."""
    grid = np.stack(np.meshgrid(*[np.arange(-5, 6.0)] * 3, indexing="ij"), -1).reshape(-1, 3)
    placed = []
    for atoms in LUMPS:
        for _ in range(EACH):
            distance = np.linalg.norm(
                (grid - rng.uniform(0, 0.5, 3)) * rng.uniform(0.9, 1.1, 3), axis=1
            )
            placed.append(grid[np.argsort(distance)[:atoms]])
    small = (
        [[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [4, 0, 0]],
        [[0, 0, 0], [1, 0, 0], [-0.3, 0.9, 0]],
        [[0, 0, 0], [1, 0, 0]],
    )
    return placed + [np.array(shape, float) for shape in small for _ in range(EACH)]


class Crowd:
    """Atoms that are in the box already."""

    def __init__(self):
        self.x = np.empty((0, 3))

    def has_room_for(self, x):
        """Whether no atom of x (n, 3) comes too close to one in the box."""
        if not len(self.x):
            return True
        distance, _ = cKDTree(self.x % BOX, boxsize=BOX).query(x % BOX)
        return distance.min() >= CLOSEST

    def add(self, x):
        self.x = np.concatenate([self.x, x])


def put(crowd, shape, rng, corner):
    """Turn a body and put it where there is room: at the grid's corner if it has one,
    else anywhere."""
    shape = shape - shape.mean(axis=0)
    for _ in range(100000):
        place = corner if corner is not None else rng.uniform(0, BOX, 3)
        x = Rotation.random(random_state=rng).apply(shape) + place
        if crowd.has_room_for(x):
            crowd.add(x)
            return x
    raise SystemExit("no room for a body: enlarge BOX")


def grow(crowd, rng):
    """A chain (BEADS, 3), atom by atom; from the beginning again where it runs into a corner."""
    while True:
        x = rng.uniform(0, BOX, (1, 3))
        while len(x) < BEADS and crowd.has_room_for(x[-1:]):
            for _ in range(50):
                way = rng.normal(size=3)
                new = x[-1] + BOND * way / np.linalg.norm(way)
                if (
                    crowd.has_room_for(new[None])
                    and np.linalg.norm(x[:-1] - new, axis=1).min(initial=9.0) >= CLOSEST
                ):
                    x = np.concatenate([x, new[None]])
                    break
            else:
                break
        if len(x) == BEADS and crowd.has_room_for(x):
            crowd.add(x)
            return x


def write_data(path, x, velocities, molecule):
    """Write the LAMMPS data file; the chains are the last atoms."""
    first = len(x) - CHAINS * BEADS
    image = np.floor(x / BOX).astype(int)
    lines = [
        "flexible chains (molecule 0) and rigid bodies of 2 to 200 atoms, lj units; "
        "written by build_mixed.py",
        "",
    ]
    lines += [
        f"{len(x)} atoms",
        f"{CHAINS * (BEADS - 1)} bonds",
        "",
        "2 atom types",
        "1 bond types",
        "2 extra bond per atom",
        "",
    ]
    lines += [f"0 {BOX} {k}lo {k}hi" for k in "xyz"]
    lines += ["", "Masses", "", "1 1.0  # in bodies", "2 1.0  # in chains", "", "Atoms # bond", ""]
    for i, (place, turn) in enumerate(zip(x - BOX * image, image)):
        words = " ".join(f"{c:.9f}" for c in place)
        lines.append(
            f"{i + 1} {molecule[i]} {1 if i < first else 2} {words} {turn[0]} {turn[1]} {turn[2]}"
        )
    lines += ["", "Velocities", ""]
    lines += [f"{i + 1} " + " ".join(f"{c:.9f}" for c in v) for i, v in enumerate(velocities)]
    lines += ["", "Bonds", ""]
    pairs = [first + BEADS * c + b for c in range(CHAINS) for b in range(1, BEADS)]
    lines += [f"{k + 1} 1 {i} {i + 1}" for k, i in enumerate(pairs)]
    path.write_text("\n".join(lines) + "\n")


def equilibrate(atoms):
    """Langevin dynamics from START; unwrapped positions and velocities (n, 3)."""
    lmp = lammps(cmdargs=["-screen", "none", "-log", "none"])
    lmp.commands_string(f"""
        units lj
        atom_style bond
        read_data {START}
        include {HERE / "forcefield.mixed"}
        comm_modify cutoff 8
        velocity all create 1.0 {SEED} mom yes
        fix 1 bodies rigid/nve/small molecule
        fix 2 chains nve
        fix 3 all langevin 1.0 1.0 1.0 {SEED} zero yes
        timestep {DT / 10}
        run 2000
        timestep {DT}
        run {STEPS}
        unfix 3
        velocity all zero linear
        run 0
    """)
    print(
        f"T {lmp.get_thermo('temp'):.3f}, P {lmp.get_thermo('press'):.3f}, "
        f"E {lmp.get_thermo('etotal'):.3f} per atom"
    )
    lmp.command("velocity all scale 1.0")
    x, v = (np.array(lmp.gather_atoms(name, 1, 3)).reshape(atoms, 3) for name in "xv")
    return x + BOX * np.array(lmp.gather_atoms("image", 0, 3)).reshape(atoms, 3), v


def main():
    rng = np.random.default_rng(SEED)
    crowd = Crowd()
    corners = [BOX * (np.array([i & 1, i >> 1 & 1, i >> 2]) + 0.5) / 2 for i in range(EACH)]
    parts = [put(crowd, shape, rng, corners.pop() if corners else None) for shape in shapes(rng)]
    molecule = np.repeat(np.arange(1, len(parts) + 1), [len(x) for x in parts])
    chains = [grow(crowd, rng) for _ in range(CHAINS)]
    molecule = np.concatenate([molecule, np.zeros(CHAINS * BEADS, int)])
    x = np.concatenate(parts + chains)
    write_data(START, x, np.zeros_like(x), molecule)
    x, v = equilibrate(len(x))
    START.unlink()
    write_data(OUTPUT, x, v, molecule)


if __name__ == "__main__":
    main()
