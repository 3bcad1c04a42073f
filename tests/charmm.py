"""A small box of CHARMM22 molecules whose CH3, CH2 and NH3 groups and waters can be rigid bodies.

N-methylpropanamide (its peptide group flexes between a CH2 and a CH3), glycine as zwitterion (NH3+
and CH2 on a flexible COO-), butane (two CH3 on flexible CH2) and TIP3P water.  All numbers are in
LAMMPS's units real; `script` writes them in any unit style.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from validation.scenes.data_file import data_file

# MacKerell et al., J. Phys. Chem. B 102, 3586 (1998), the file par_all22_prot; water from Jorgensen
# et al., J. Chem. Phys. 79, 926 (1983), without Lennard-Jones on its hydrogens.

# mass; depth and half the distance of the minimum; the same between atoms three bonds apart
ATOMS = {
    "C": (12.011, 0.11, 2.0, 0.11, 2.0),
    "CC": (12.011, 0.07, 2.0, 0.07, 2.0),
    "CT2": (12.011, 0.055, 2.175, 0.01, 1.9),
    "CT3": (12.011, 0.08, 2.06, 0.01, 1.9),
    "H": (1.008, 0.046, 0.2245, 0.046, 0.2245),
    "HA": (1.008, 0.022, 1.32, 0.022, 1.32),
    "HC": (1.008, 0.046, 0.2245, 0.046, 0.2245),
    "NH1": (14.007, 0.2, 1.85, 0.2, 1.55),
    "NH3": (14.007, 0.2, 1.85, 0.2, 1.85),
    "O": (15.999, 0.12, 1.7, 0.12, 1.4),
    "OC": (15.999, 0.12, 1.7, 0.12, 1.7),
    "HT": (1.008, 0.0, 0.0, 0.0, 0.0),
    "OT": (15.9994, 0.1521, 1.7682, 0.1521, 1.7682),
}
# energy / length^2, length
BONDS = {
    "CT3 CT2": (222.5, 1.528),
    "CT2 CT2": (222.5, 1.53),
    "HA CT3": (322.0, 1.111),
    "HA CT2": (309.0, 1.111),
    "CT2 C": (250.0, 1.49),
    "C O": (620.0, 1.23),
    "C NH1": (370.0, 1.345),
    "NH1 H": (440.0, 0.997),
    "NH1 CT3": (320.0, 1.43),
    "NH3 HC": (403.0, 1.04),
    "NH3 CT2": (200.0, 1.48),
    "CT2 CC": (200.0, 1.522),
    "CC OC": (525.0, 1.26),
    "OT HT": (450.0, 0.9572),
}
# energy / radian^2, degrees; Urey-Bradley: energy / length^2, length
ANGLES = {
    "HA CT3 HA": (35.5, 108.4, 5.4, 1.802),
    "HA CT2 HA": (35.5, 109.0, 5.4, 1.802),
    "HA CT3 CT2": (34.6, 110.1, 22.53, 2.179),
    "HA CT2 CT3": (34.6, 110.1, 22.53, 2.179),
    "HA CT2 CT2": (26.5, 110.1, 22.53, 2.179),
    "CT3 CT2 CT2": (58.0, 115.0, 8.0, 2.561),
    "CT3 CT2 C": (52.0, 108.0, 0.0, 0.0),
    "HA CT2 C": (33.0, 109.5, 30.0, 2.163),
    "CT2 C O": (80.0, 121.0, 0.0, 0.0),
    "CT2 C NH1": (80.0, 116.5, 0.0, 0.0),
    "O C NH1": (80.0, 122.5, 0.0, 0.0),
    "C NH1 H": (34.0, 123.0, 0.0, 0.0),
    "C NH1 CT3": (50.0, 120.0, 0.0, 0.0),
    "CT3 NH1 H": (35.0, 117.0, 0.0, 0.0),
    "NH1 CT3 HA": (51.5, 109.5, 0.0, 0.0),
    "HC NH3 HC": (44.0, 109.5, 0.0, 0.0),
    "HC NH3 CT2": (30.0, 109.5, 20.0, 2.074),
    "NH3 CT2 HA": (51.5, 107.5, 0.0, 0.0),
    "NH3 CT2 CC": (43.7, 110.0, 0.0, 0.0),
    "HA CT2 CC": (33.0, 109.5, 30.0, 2.163),
    "CT2 CC OC": (40.0, 118.0, 50.0, 2.388),
    "OC CC OC": (100.0, 124.0, 70.0, 2.225),
    "HT OT HT": (55.0, 104.52, 0.0, 0.0),
}
# energy, multiplicity, degrees; X is any type, the names' first fit counts
DIHEDRALS = {
    "CT3 CT2 CT2 CT3": [(0.15, 1, 0)],
    "X CT2 CT2 X": [(0.195, 3, 0)],
    "X CT2 CT3 X": [(0.16, 3, 0)],
    "X CT2 C X": [(0.05, 6, 180)],
    "CT2 C NH1 CT3": [(1.6, 1, 0), (2.5, 2, 180)],
    "X C NH1 X": [(2.5, 2, 180)],
    "X CT3 NH1 X": [(0.0, 3, 0)],
    "X CT2 NH3 X": [(0.1, 3, 0)],
    "X CT2 CC X": [(0.05, 6, 180)],
}
# energy / radian^2; the first atom is the one in the middle
IMPROPERS = {"C CT2 O NH1": 120.0, "NH1 C CT3 H": 20.0, "CC CT2 OC OC": 96.0}

# One atom a line: name, type, charge, body (- is none), the earlier atom it is bonded to, two more
# earlier atoms and the dihedral angle that it makes with the three.  Hydrogens of glycine's CH2 are
# those of alkanes.
AMIDE = """
C1  CT3 -0.27 a
C2  CT2 -0.18 b C1
H11 HA   0.09 a C1 C2
H12 HA   0.09 a C1 C2 H11 120
H13 HA   0.09 a C1 C2 H11 240
C   C    0.51 d C2 C1 H11 180
H21 HA   0.09 b C2 C1 H11 60
H22 HA   0.09 b C2 C1 H11 300
O   O   -0.51 d C  C2 C1 0
N   NH1 -0.47 e C  C2 C1 180
H   H    0.31 e N  C  C2 0
C3  CT3 -0.11 c N  C  C2 180
H31 HA   0.09 c C3 N  C  60
H32 HA   0.09 c C3 N  C  180
H33 HA   0.09 c C3 N  C  300
"""
GLYCINE = """
N   NH3 -0.30 a
CA  CT2  0.13 b N
H1  HC   0.33 a N  CA
H2  HC   0.33 a N  CA H1 120
H3  HC   0.33 a N  CA H1 240
C   CC   0.34 - CA N  H1 180
HA1 HA   0.09 b CA N  H1 60
HA2 HA   0.09 b CA N  H1 300
O1  OC  -0.67 - C  CA N 90
O2  OC  -0.67 - C  CA N 270
"""
BUTANE = """
C1  CT3 -0.27 a
C2  CT2 -0.18 - C1
H11 HA   0.09 a C1 C2
H12 HA   0.09 a C1 C2 H11 120
H13 HA   0.09 a C1 C2 H11 240
C3  CT2 -0.18 - C2 C1 H11 180
H21 HA   0.09 - C2 C1 H11 60
H22 HA   0.09 - C2 C1 H11 300
C4  CT3 -0.27 b C3 C2 C1 180
H31 HA   0.09 - C3 C2 C1 60
H32 HA   0.09 - C3 C2 C1 300
H41 HA   0.09 b C4 C3 C2 60
H42 HA   0.09 b C4 C3 C2 180
H43 HA   0.09 b C4 C3 C2 300
"""
WATER = """
O   OT  -0.834 a
H1  HT   0.417 a O
H2  HT   0.417 a O H1
"""
COUNTS = {"amide": (AMIDE, 4), "glycine": (GLYCINE, 3), "butane": (BUTANE, 3), "water": (WATER, 30)}
BOX = np.array([20.0, 18.0, 17.0])
INNER, CUTOFF, SKIN, EWALD = 5.5, 7.0, 1.0, 0.4

# mass v^2 / energy and charge^2 / (length energy), as LAMMPS defines its unit styles
MVV2E = {"real": 48.88821291**2, "metal": 1.0364269e-4, "lj": 1.0}
QQR2E = {"real": 332.06371, "metal": 14.399645, "lj": 1.0}


class Scale(NamedTuple):
    """What the units of length, mass, energy and charge of real are in another unit style."""

    units: str
    length: float
    mass: float
    energy: float
    charge: float

    @property
    def time(self):
        ratio = MVV2E[self.units] / MVV2E["real"]
        return self.length * np.sqrt(self.mass * ratio / self.energy)


# metal's electronvolt such that the charges stay what they are; for lj a length, mass and energy of
# no special value
SCALES = {
    "real": Scale("real", 1.0, 1.0, 1.0, 1.0),
    "metal": Scale("metal", 1.0, 1.0, QQR2E["metal"] / QQR2E["real"], 1.0),
    "lj": Scale("lj", 1 / 3.3, 1 / 14.0, 1 / 0.13, np.sqrt(QQR2E["real"] / (3.3 * 0.13))),
}


class Scene(NamedTuple):
    """The atoms in order of ID: molecule's name, atom's name, type, charge,
    and the terms of the force field.

    `body` numbers the groups of atoms that can be rigid from 0 on; -1 is an atom that never is in
    one. Positions are not wrapped into the box.
    """

    molecule: np.ndarray
    number: np.ndarray
    type: np.ndarray
    charge: np.ndarray
    body: np.ndarray
    x: np.ndarray
    v: np.ndarray
    terms: dict

    @property
    def mass(self):
        return np.array([ATOMS[name][0] for name in self.type])

    @property
    def size(self):
        """How many atoms each atom's body has; 0 for an atom that never is in one."""
        return np.where(self.body < 0, 0, np.bincount(self.body[self.body >= 0])[self.body])


def _lookup(table, types):
    """The key of a table that fits these atom types, in this order or the reverse."""
    for key in table:
        for names in types, types[::-1]:
            if all(a in ("X", b) for a, b in zip(key.split(), names)):
                return key
    raise KeyError(" ".join(types))


def _build(text):
    """Types, charges, bodies, positions and terms of one molecule."""
    rows = [line.split() for line in text.split("\n") if line]
    number = {row[0]: k for k, row in enumerate(rows)}
    types = [row[1] for row in rows]
    x, bonds, near = np.zeros((len(rows), 3)), [], [[] for _ in rows]
    for k, row in enumerate(rows):
        refs = [number[name] for name in row[4:7]]
        if not refs:
            continue
        a = refs[0]
        bonds.append((a, k))
        near[a].append(k)
        near[k].append(a)
        length = BONDS[_lookup(BONDS, (types[a], types[k]))][1]
        if len(refs) == 1:
            x[k] = x[a] + [length, 0, 0]
            continue
        angle = np.radians(ANGLES[_lookup(ANGLES, (types[k], types[a], types[refs[1]]))][1])
        turn = np.radians(float(row[7])) if len(refs) == 3 else 0.0
        axis = x[refs[1]] - x[a]
        axis /= np.linalg.norm(axis)
        side = x[refs[2]] - x[refs[1]] if len(refs) == 3 else np.array([0.3, 1.0, 0.2])
        side = side - side @ axis * axis
        side /= np.linalg.norm(side)
        across = np.cross(axis, side)
        x[k] = x[a] + length * (
            np.cos(angle) * axis + np.sin(angle) * (np.cos(turn) * side + np.sin(turn) * across)
        )
    terms = {"bond": [(_lookup(BONDS, [types[i] for i in pair]), pair) for pair in bonds]}
    angles = [
        (i, j, k) for j in range(len(rows)) for n, i in enumerate(near[j]) for k in near[j][n + 1 :]
    ]
    terms["angle"] = [(_lookup(ANGLES, [types[i] for i in ids]), ids) for ids in angles]
    dihedrals = [
        (i, a, b, k) for a, b in bonds for i in near[a] for k in near[b] if i != b and k != a
    ]
    keyed = [(_lookup(DIHEDRALS, [types[i] for i in ids]), ids) for ids in dihedrals]
    terms["dihedral"] = [((key, n), ids) for key, ids in keyed for n in range(len(DIHEDRALS[key]))]
    terms["improper"] = []
    for middle in range(len(rows)):
        for key in IMPROPERS:
            first, *others = key.split()
            ends = sorted(
                near[middle], key=lambda i: others.index(types[i]) if types[i] in others else 9
            )
            if types[middle] == first and [types[i] for i in ends] == others:
                terms["improper"].append((key, (middle, *ends)))
    return types, [float(row[2]) for row in rows], [row[3] for row in rows], x, terms


def scene(seed=1):
    """A Scene, molecules at random places and turned at random, with random velocities at 300 K."""
    rng = np.random.default_rng(seed)
    columns, x = (
        {name: [] for name in ("molecule", "number", "type", "charge", "body")},
        np.empty((0, 3)),
    )
    terms = {name: [] for name in ("bond", "angle", "dihedral", "improper")}
    bodies = molecules = 0
    for name, (text, count) in COUNTS.items():
        types, charges, letters, shape, own = _build(text)
        for _ in range(count):
            for _ in range(10000):
                place = Rotation.from_quat(rng.normal(size=4)).apply(
                    shape - shape.mean(axis=0)
                ) + rng.uniform(0, BOX)
                delta = place[:, None] - x
                delta -= np.rint(delta / BOX) * BOX
                if (np.linalg.norm(delta, axis=2) > 2.3).all():
                    break
            else:
                raise RuntimeError("no room")
            for kind in terms:
                terms[kind] += [(key, tuple(len(x) + i for i in ids)) for key, ids in own[kind]]
            known = sorted(set(letters) - {"-"})
            columns["molecule"] += [name] * len(types)
            columns["number"] += [molecules] * len(types)
            columns["type"] += types
            columns["charge"] += charges
            columns["body"] += [
                bodies + known.index(letter) if letter in known else -1 for letter in letters
            ]
            bodies, molecules, x = bodies + len(known), molecules + 1, np.concatenate([x, place])
    made = Scene(
        **{name: np.array(column) for name, column in columns.items()}, x=x, v=x, terms=terms
    )
    v = rng.normal(size=x.shape) * np.sqrt(0.0019872 * 300 / (made.mass[:, None] * MVV2E["real"]))
    return made._replace(v=v - made.mass @ v / made.mass.sum())


def data(scene, scale, molecule):
    """The text of a data file with the scene's atoms; `molecule` has each atom's molecule-ID."""
    s, types, names = scale, list(ATOMS), ("bond", "angle", "dihedral", "improper")
    keys = {name: list(dict.fromkeys(key for key, _ in scene.terms[name])) for name in names}
    image = np.floor(scene.x / BOX).astype(int)
    spring = s.energy / s.length**2
    coefficients = {"Pair Coeffs": []}
    for name in types:
        depth, half, depth14, half14 = np.array(ATOMS[name][1:]) * (
            2 * [s.energy, 2 ** (5 / 6) * s.length]
        )
        coefficients["Pair Coeffs"] += [(depth, half, depth14, half14)]
    for name in names:
        rows = coefficients[f"{name.title()} Coeffs"] = []
        for key in keys[name]:
            if name == "bond":
                rows += [np.array(BONDS[key]) * [spring, s.length]]
            elif name == "angle":
                rows += [np.array(ANGLES[key]) * [s.energy, 1, spring, s.length]]
            elif name == "dihedral":
                energy, *others = DIHEDRALS[key[0]][key[1]]
                # several terms of four atoms: one has their 1-4 pair
                rows += [(energy * s.energy, *others, 1 - key[1])]
            else:
                rows += [(IMPROPERS[key] * s.energy, 0)]
    kind = [types.index(name) + 1 for name in scene.type]
    return data_file(
        "full",
        [molecule, kind, scene.charge * s.charge, (scene.x - image * BOX) * s.length, image],
        [(0, length * s.length) for length in BOX],
        mass=[ATOMS[name][0] * s.mass for name in types],
        velocities=[scene.v * (s.length / s.time)],
        terms={
            f"{name}s": [
                (keys[name].index(key) + 1, *(i + 1 for i in ids)) for key, ids in scene.terms[name]
            ]
            for name in names
        },
        coefficients=coefficients,
    )


def script(scale, long=False):
    """The first part of an input script, which reads data.charmm.

    Args:
        long: Whether Coulomb's forces beyond the cutoff come from PPPM. Its mesh, Ewald's parameter
            and a formula in place of tables are set so that the forces are the same in all units.
            Without it the forces of LAMMPS's pair style are not quite the slope of its energy:
            compare trajectories, but not a trajectory's energies.
    """
    s = scale
    pair, mesh = "lj/charmm/coul/charmm", []
    if long:
        pair = "lj/charmm/coul/long"
        mesh = [
            "kspace_style pppm 1e-4",
            f"kspace_modify mesh 18 16 16 gewald {EWALD / s.length:.17g}",
        ]
    return "\n".join(
        [
            f"units {s.units}",
            "atom_style full",
            "atom_modify map array",
            f"pair_style {pair} {INNER * s.length:.17g} {CUTOFF * s.length:.17g}",
            "pair_modify mix arithmetic" + " table 0" * long,
            "bond_style harmonic",
            "angle_style charmm",
            "dihedral_style charmm",
            "improper_style harmonic",
            "special_bonds charmm",
            *mesh,
            "read_data data.charmm",
            f"neighbor {SKIN * s.length:.17g} bin",
            "neigh_modify every 5 delay 0 check yes",
        ]
    )
