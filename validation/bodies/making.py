"""What of a script makes its atoms, and what a data file in its place needs beside it."""

import itertools
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..own import finding
from ..own.script import texts

# a data file has their work; delete_bonds stays: a data file has the bonds that it turned off
MAKES = frozenset(
    (
        *("read_data", "read_restart", "create_box", "set", "create_atoms", "delete_atoms"),
        *("create_bonds", "change_box", "replicate", "read_dump", "reset_atoms"),
        *("reset_atom_ids", "displace_atoms"),
    )
)
RANGES = 40  # of atom IDs: a group of more is not printed
KINDS = "pair", "bond", "angle", "dihedral", "improper"


class Beside(NamedTuple):
    """What stands beside read_data in a script.

    Attributes:
        words: behind its file.
        before, behind: commands.
        sentences: what the user has to say again.
    """

    words: str = ""
    before: tuple[str, ...] = ()
    behind: tuple[str, ...] = ()
    sentences: tuple[str, ...] = ()

    def within(self, other: "Beside") -> "Beside":
        """Both, this one nearer to read_data."""
        return Beside(
            f"{other.words} {self.words}".strip(),
            other.before + self.before,
            self.behind + other.behind,
            other.sentences + self.sentences,
        )


NOTHING = Beside()


def gone(said: Mapping) -> list[str]:
    """The script's commands whose work is in a data file of its atoms, in order, each once."""
    kept = {line for line in said["fixes"].values() if _stored(line)}
    return list(dict.fromkeys(one for one in said["commands"] if _makes(one) or one in kept))


def _makes(line: str) -> bool:
    word, *rest = texts(line)
    return word in MAKES and not (word == "change_box" and "boundary" in rest)


def _stored(line: str) -> bool:
    """Whether a command is a fix whose values of atoms a data file has, in a section by its ID."""
    words = texts(line)
    unwritten = ("writedata", "no") in itertools.pairwise(words)
    return finding.style_of(line) == "property/atom" and not unwritten


def beside(said: Mapping, atoms: Mapping[str, np.ndarray]) -> Beside:
    """Words of the script's read_data that its atoms still need, and groups that came with them."""
    stored = {one: line for one, line in said["fixes"].items() if _stored(line)}
    words, behind, sentences = [*_carried(said)], [], []
    words += [f"fix {one} NULL {one}" for one in stored]
    named = {texts(line)[1] for line in said["commands"] if texts(line)[0] == "group"}
    whole = []
    for name in filter(None, said["groups"]):  # None: free for another one
        if name == "all" or name in named:
            continue
        mask = finding.in_group(said, atoms, name)
        if mask.all():
            whole.append(name)
        elif line := group(name, mask, atoms["type"]):
            behind.append(line)
        else:
            sentences.append(
                f"Define group {name} again: its {mask.sum():,} atoms are too scattered to be told."
            )
    words += [f"group {name}" for name in whole[:1]]  # it takes one
    behind += [f"group {name} union all" for name in whole[1:]]
    return Beside(" ".join(words), tuple(stored.values()), tuple(behind), tuple(sentences))


def _carried(said: Mapping) -> Iterator[str]:
    """Keywords of read_data that are about room for each atom, or about sections of fixes whose
    names stay."""
    found = []
    for words in (one for one in map(texts, said["commands"]) if one[0] == "read_data"):
        for at, word in enumerate(words):
            if re.fullmatch(r"extra/\w+/per/atom", word):
                found.append(" ".join(words[at : at + 2]))
            elif at > 1 and word == "fix":
                line = said["fixes"].get(words[at + 1])
                if line and finding.style_of(line) != "property/atom":
                    found.append(" ".join(words[at : at + 4]))
    yield from dict.fromkeys(found)


def group(name: str, mask: np.ndarray, types: np.ndarray) -> str | None:
    """The command that makes a group of some of the atoms, by types or by ranges of IDs; None if
    these are too many."""
    if not mask.any():
        return f"group {name} empty"
    inside = np.unique(types[mask])
    if (np.isin(types, inside) == mask).all():
        return f"group {name} type {' '.join(map(str, inside))}"
    ids = 1 + np.flatnonzero(mask)
    ends = np.flatnonzero(np.diff(ids) > 1)
    first, last = ids[[0, *(ends + 1)]], ids[[*ends, -1]]
    if len(first) > RANGES:
        return None
    return f"group {name} id {' '.join(f'{a}:{b}' for a, b in zip(first, last))}"


def from_restart(said: Mapping) -> bool:
    """Whether the script's box, and with it its styles, is a restart file's."""
    return any(texts(line)[0] == "read_restart" for line in said["commands"])


def header(said: Mapping, known: Mapping) -> list[str]:
    """What a restart file says and a data file does not, in front of read_data.

    Args:
        known: of ``writer``.
    """
    newton = ["on" if known[f"newton_{one}"] else "off" for one in ("pair", "bond")]
    return [
        f"units {said['units']}",
        *[f"dimension {said['dimension']}"] * (said["dimension"] != 3),
        f"boundary {known['boundary']}",
        *[f"newton {' '.join(newton)}"] * ("off" in newton),
        f"atom_style {known['atom_style']}",
    ]


def styles(said: Mapping, coefficients: str) -> tuple[list[str], list[str], str]:
    """What a restart file says of forces: the script's own command pair_style, if there is one;
    styles with words that nobody knows; and commands for the rest, as text.

    Args:
        coefficients: what LAMMPS's write_coeff wrote.
    """
    own: dict[str, str] = {texts(line)[0]: line for line in said["commands"]}
    lost, first, made = [], [], []
    for kind, style, body in re.findall(
        rf"^# ({'|'.join(KINDS)})_style (.*)\n((?:(?!# ).*\n)*)", coefficients, re.M
    ):
        name = f"{kind}_style"
        if name in own and kind != "pair":
            continue  # it forgot the coefficients, so the script says them
        if name in own:
            first.append(own[name])
        elif kind == "pair" or style.startswith("hybrid"):
            lost.append(f"{name} {style}")
        else:
            made.append(f"{name} {style}")
        made += [line for line in body.splitlines() if line.strip()]
    if "special_bonds" not in own:
        lj, coul = (" ".join(f"{one:g}" for one in factors[1:]) for factors in said["special"])
        made.append(f"special_bonds lj {lj} coul {coul}")
    if "timestep" not in own:
        made.append(f"timestep {said['dt']:g}")
    return first, lost, "".join(f"{line}\n" for line in made)


def of_restart(
    said: Mapping, known: Mapping, first: Sequence[str], lost: Sequence[str], file: str
) -> Beside:
    """What a script that reads a restart file needs beside the read_data of a data file.

    Args:
        known: of ``writer``.
        first, lost: of `styles`.
        file: that has the commands of `styles`.
    """
    sentences = [
        f"A restart file does not tell the words behind {' and '.join(lost)}: say "
        f"{'it' if len(lost) == 1 else 'them'} again, with these, in front of the line include."
    ] * bool(lost)
    if known["atom_style"].startswith("hybrid"):
        sentences.append("Nor does it tell those behind atom_style hybrid: say them, too.")
    sentences.append("What else the restart file said, as comm_modify, has to be said again, too.")
    return Beside(
        before=tuple(header(said, known)),
        behind=(*first, f"include {file}"),
        sentences=tuple(sentences),
    )
