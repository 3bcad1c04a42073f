"""LAMMPS data files, which only this module writes."""

from collections.abc import Mapping, Sequence
from itertools import count

import numpy as np
from numpy.typing import ArrayLike


def data_file(
    style: str,
    atoms: Sequence,
    box: ArrayLike,
    *,
    tilt: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    mass: Sequence[float] | np.ndarray = (),
    velocities: Sequence = (),
    terms: Mapping[str, Sequence] | None = None,
    coefficients: Mapping[str, Sequence] | None = None,
    types: int = 1,
) -> str:
    """The text of a data file. Integers are written as such, others to the last bit.

    Args:
        style: LAMMPS's atom style.
        atoms: the columns of that style after the ID, each (n,) or (n, k), in order of ID.
        box: (3, 2), lowest and highest of x, y, z; a (2,) applies to all.
        tilt: xy, xz, yz.
        mass: of each type; without any there are ``types``.
        velocities: columns of (n,) or (n, k).
        terms: of ``bonds``, ``angles``, ``dihedrals`` and ``impropers``: a row for each, its type
            and the IDs of its atoms.
        coefficients: heading of a section to its rows, of type 1, 2, ...
    """
    terms = terms or {}
    lines = ["bodies", "", f"{len(atoms[0])} atoms", f"{len(mass) or types} atom types"]
    for name, rows in terms.items():
        kinds = max((row[0] for row in rows), default=0)
        lines += [f"{len(rows)} {name}", f"{kinds} {name[:-1]} types"]
    lines += [
        "",
        *(
            f"{_words(ends)} {c}lo {c}hi"
            for ends, c in zip(np.broadcast_to(np.asarray(box, float), (3, 2)), "xyz")
        ),
        *([f"{_words(tilt)} xy xz yz"] if np.any(tilt) else []),
    ]
    sections = {
        "Masses": _numbered(mass),
        **{heading: map(_words, rows) for heading, rows in (coefficients or {}).items()},
        f"Atoms # {style}": _numbered(*atoms),
        "Velocities": _numbered(*velocities),
        **{name.title(): map(_words, rows) for name, rows in terms.items()},
    }
    for heading, rows in sections.items():
        numbered = [f"{number} {row}" for number, row in zip(count(1), rows)]
        lines += ["", heading, "", *numbered] if numbered else []
    return "\n".join(lines) + "\n"


def _numbered(*columns):
    """A row of words for each atom or type."""
    flat = [block.reshape(len(block), -1).T for block in map(np.asarray, columns) if block.size]
    return (" ".join(map(_word, row)) for row in zip(*(line for block in flat for line in block)))


def _words(values):
    return " ".join(map(_word, values))


def _word(value):
    whole = isinstance(value, int | np.integer)
    return str(value) if whole else f"{value:.17g}"
