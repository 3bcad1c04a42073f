"""CHARMM22 of a GROMACS topology as a LAMMPS data file,
with a rigid body for each heavy atom and its hydrogens.

The file is for atom_style full and units real with pair_style lj/charmm/coul/long, pair_modify mix
arithmetic, bond_style harmonic, angle_style charmm, dihedral_style charmm, improper_style harmonic
and special_bonds charmm.  The molecule-ID is the number of the rigid body, 0 that of an atom in
none.  Needs ParmEd, numpy and scipy.
"""

import gzip
from collections import defaultdict

import numpy as np
import parmed
from scipy.spatial.transform import Rotation

HEAD = "{title}; molecule-ID = rigid body, 0 = in none; real units"
COEFFICIENTS = {  # each kind of term and the style that its coefficients are for
    "bond": "harmonic",
    "angle": "charmm",
    "dihedral": "charmm",
    "improper": "harmonic",
}
MIXING = 1e-6  # kcal/mol and Angstrom: how far a 1-4 pair may be from arithmetic mixing


class Terms:
    """Terms of one kind.

    Attributes:
        number: from the coefficients, a tuple in LAMMPS's order and units,
            to LAMMPS's type, counted from 1.
        rows: (type, atoms ...) of each term; atoms are counted from 0.
    """

    def __init__(self):
        self.number, self.rows = {}, []

    def add(self, coefficients, *atoms):
        # ParmEd's change of units leaves rounding errors, which would make two types of one
        key = tuple(
            round(value, 8) if isinstance(value, float) else value for value in coefficients
        )
        self.rows.append(
            (self.number.setdefault(key, len(self.number) + 1), *(atom.idx for atom in atoms))
        )

    def coefficients(self):
        """A dictionary from the atoms of a term to its coefficients;
        of several for the same atoms, the last."""
        keys = list(self.number)
        return {atoms: keys[kind - 1] for kind, *atoms in self.rows for atoms in [tuple(atoms)]}


class System:
    """A topology in LAMMPS's terms.

    Args:
        path: a GROMACS topology of CHARMM22 without CMAP; water is flexible in it,
            so that it has its bonds and angle.
        folder: of GROMACS's force fields.

    Attributes:
        atoms: ParmEd's atoms.
        terms: a ``Terms`` for each kind of ``COEFFICIENTS``.
        lennard_jones: from atom type to epsilon, sigma and the same two of 1-4 pairs (kcal/mol,
            Angstrom), in LAMMPS's order.
        bodies: the atoms of each rigid body, the heavy atom first.

    Raises ValueError where LAMMPS's styles cannot say what the topology says.
    """

    def __init__(self, path, folder):
        parmed.gromacs.GROMACS_TOPDIR = str(folder)
        self.topology = top = parmed.gromacs.GromacsTopologyFile(
            str(path), defines={"FLEXIBLE": "1"}
        )
        if top.cmaps or top.rb_torsions or top.has_NBFIX():
            raise ValueError("only CHARMM22 without CMAP and without pairs of their own")
        self.atoms = top.atoms
        pairs = {frozenset((pair.atom1, pair.atom2)): pair.type for pair in top.adjusts}
        self.terms = {
            "bond": _bonds(top),
            "angle": _angles(top),
            "dihedral": _dihedrals(top, pairs),
            "improper": _impropers(top),
        }
        self.lennard_jones = _lennard_jones(top, pairs)
        self.bodies = _bodies(top)

    def idealise(self, x):
        """Give each body the force field's bond lengths and angles between hydrogens.

        Args:
            x: positions (atoms, 3) in Angstrom, not cut by periodic faces.

        Returns:
            positions; heavy atoms stay, their hydrogens are turned to where they were nearly.
        """
        x = x.copy()
        length = {
            frozenset(atoms): key[1] for atoms, key in self.terms["bond"].coefficients().items()
        }
        angle = {
            (middle, frozenset(ends)): key[1]
            for (a, middle, b), key in self.terms["angle"].coefficients().items()
            for ends in [(a, b)]
        }
        for heavy, *hydrogens in self.bodies:
            was = x[hydrogens] - x[heavy]
            r = np.array([[length[frozenset((heavy, h))]] for h in hydrogens])
            if len(hydrogens) == 1:
                x[hydrogens] = x[heavy] + was * (r / np.linalg.norm(was))
                continue
            shape = r * _directions(
                np.radians(angle[heavy, frozenset(hydrogens[:2])]), len(hydrogens)
            )
            if len(hydrogens) == 3 and np.linalg.det(was) < 0:
                shape[:, 2] *= -1
            x[hydrogens] = x[heavy] + Rotation.align_vectors(was, shape)[0].apply(shape)
        return x

    def write(self, path, title, x, v, box):
        """Write a data file, gzipped.

        Args:
            x, v: positions and velocities (atoms, 3) in Angstrom and Angstrom/fs.
            box: the three sides, Angstrom; one corner is the origin.
        """
        body = np.zeros(len(x), int)
        for number, atoms in enumerate(self.bodies, 1):
            body[atoms] = number
        kinds = {name: number for number, name in enumerate(self.lennard_jones, 1)}
        mass = {atom.type: atom.mass for atom in self.atoms}
        image = np.floor(x / box).astype(int)
        lines = [
            HEAD.format(title=title),
            "",
            f"{len(x)} atoms",
            *(f"{len(terms.rows)} {kind}s" for kind, terms in self.terms.items()),
        ]
        lines += [
            "",
            f"{len(kinds)} atom types",
            *(f"{len(terms.number)} {kind} types" for kind, terms in self.terms.items()),
            "",
        ]
        lines += [f"0 {side:.12g} {axis}lo {axis}hi" for side, axis in zip(box, "xyz")]
        lines += [
            "",
            "Masses",
            "",
            *(f"{number} {mass[name]:.8g}  # {name}" for name, number in kinds.items()),
        ]
        lines += ["", "Pair Coeffs # lj/charmm/coul/long", ""]
        lines += [
            "{} {:.10g} {:.10g} {:.10g} {:.10g}  # {}".format(kinds[name], *values, name)
            for name, values in self.lennard_jones.items()
        ]
        for kind, style in COEFFICIENTS.items():
            lines += ["", f"{kind.title()} Coeffs # {style}", ""]
            lines += [
                f"{number} " + " ".join(f"{value:.10g}" for value in key)
                for key, number in self.terms[kind].number.items()
            ]
        lines += ["", "Atoms # full", ""]
        for k, (atom, place, turn) in enumerate(zip(self.atoms, x - box * image, image)):
            numbers = f"{k + 1} {body[k]} {kinds[atom.type]} {round(atom.charge, 6):g}"
            lines.append(
                f"{numbers} {place[0]:.12f} {place[1]:.12f} {place[2]:.12f} "
                f"{turn[0]} {turn[1]} {turn[2]}"
            )
        lines += [
            "",
            "Velocities",
            "",
            *(f"{k} {a:.12e} {b:.12e} {c:.12e}" for k, (a, b, c) in enumerate(v, 1)),
        ]
        for kind, terms in self.terms.items():
            lines += ["", f"{kind.title()}s", ""]
            lines += [
                f"{k} {number} " + " ".join(str(a + 1) for a in atoms)
                for k, (number, *atoms) in enumerate(terms.rows, 1)
            ]
        # no time and no name in the file's head: the same numbers give the same bytes
        path.write_bytes(gzip.compress(("\n".join(lines) + "\n").encode(), mtime=0))


def _bonds(top):
    terms = Terms()
    for bond in top.bonds:
        terms.add((bond.type.k, bond.type.req), bond.atom1, bond.atom2)
    return terms


def _angles(top):
    """Angles, with the Urey-Bradley term of their ends."""
    terms = Terms()
    ends = {frozenset((term.atom1, term.atom2)): term.type for term in top.urey_bradleys}
    for angle in top.angles:
        urey = ends.pop(frozenset((angle.atom1, angle.atom3)), None)
        more = (urey.k, urey.req) if urey else (0.0, 0.0)
        terms.add((angle.type.k, angle.type.theteq, *more), angle.atom1, angle.atom2, angle.atom3)
    if ends:
        raise ValueError(
            f"{len(ends)} Urey-Bradley terms are not the ends of an angle of their own"
        )
    return terms


def _dihedrals(top, pairs):
    """Dihedrals; LAMMPS computes a 1-4 pair with the one of weight 1 between its atoms."""
    terms, left = Terms(), set(pairs)
    for dihedral in top.dihedrals:
        several = isinstance(dihedral.type, parmed.DihedralTypeList)
        for term in dihedral.type if several else [dihedral.type]:
            pair = frozenset((dihedral.atom1, dihedral.atom4))
            weight = 1.0 if pair in left else 0.0
            left.discard(pair)
            if term.phase != round(term.phase):
                raise ValueError(
                    f"dihedral_style charmm takes whole degrees only, not {term.phase}"
                )
            key = term.phi_k, int(term.per), int(term.phase), weight
            terms.add(key, dihedral.atom1, dihedral.atom2, dihedral.atom3, dihedral.atom4)
    if left:
        raise ValueError(f"{len(left)} 1-4 pairs are not the ends of a dihedral")
    return terms


def _impropers(top):
    terms = Terms()
    for term in top.impropers:
        terms.add(
            (term.type.psi_k, term.type.psi_eq), term.atom1, term.atom2, term.atom3, term.atom4
        )
    return terms


def _lennard_jones(top, pairs):
    """See ``System.lennard_jones``."""
    parameters = {}
    for atom in top.atoms:
        usual = atom.atom_type.epsilon, atom.atom_type.sigma
        # atom_type.epsilon_14 repeats the usual epsilon: 1-4 pairs have a table of their own
        special = top.parameterset.pair_types.get((atom.type, atom.type))
        parameters[atom.type] = (
            (*usual, special.epsilon, special.sigma) if special else (*usual, *usual)
        )
    for pair, kind in pairs.items():
        (_, _, e, s), (_, _, e2, s2) = (parameters[atom.type] for atom in pair)
        if (
            kind.chgscale != 1
            or abs(kind.epsilon - np.sqrt(e * e2)) > MIXING
            or abs(kind.sigma - (s + s2) / 2) > MIXING
        ):
            raise ValueError(f"the 1-4 pair {pair} does not follow from its atoms")
    return parameters


def _bodies(top):
    """See ``System.bodies``."""
    hydrogens = defaultdict(list)
    for bond in top.bonds:
        for heavy, other in ((bond.atom1, bond.atom2), (bond.atom2, bond.atom1)):
            if heavy.atomic_number > 1 and other.atomic_number == 1:
                hydrogens[heavy.idx].append(other.idx)
    return [[heavy, *sorted(hydrogens[heavy])] for heavy in sorted(hydrogens)]


def _directions(angle, count):
    """Unit vectors (count, 3) with ``angle`` (rad) between any two of them; count is 2 or 3."""
    tilt = np.arcsin(np.sin(angle / 2) / np.sin(np.pi / count))  # from the axis of symmetry, z
    turns = 2 * np.pi / count * np.arange(count)
    return np.stack(
        [np.sin(tilt) * np.cos(turns), np.sin(tilt) * np.sin(turns), np.full(count, np.cos(tilt))],
        axis=1,
    )
