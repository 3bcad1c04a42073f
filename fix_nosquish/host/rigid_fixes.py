"""The words of LAMMPS's rigid fixes, as ``lmp -sf nosquish`` takes them: with the meaning that they
have in the fix whose place is taken.

The styles are rigid, rigid/nve, rigid/nvt, rigid/npt and rigid/nph, with /small, /omp and /nosquish
behind.  The words of our own integrators may stand behind those of the fix, too.
"""

from collections.abc import Collection
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # which imports this file
    from .command import Command

# they keep no temperature but by keyword langevin, and f_ID is a temperature
BODIES = "rigid", "rigid/nve"
# words that all of these fixes take, and have no effect without a pressure
OF_BOX = "couple", "dilate"
# of each fix, by its `plain` name: which keywords it has besides those of the class
KEYWORDS = {
    "rigid": ("langevin", *OF_BOX),
    "rigid/nve": ("langevin", *OF_BOX),
    "rigid/nvt": ("tparam", *OF_BOX),
    "rigid/npt": ("tparam", "pchain"),
    "rigid/nph": ("langevin", "pchain"),
}
CHAIN, ITERATIONS, ORDER = 10, 1, 3  # of keyword tparam, in LAMMPS


def plain(style: str) -> str | None:
    """The style without /small, /omp and nosquish; None if it is none of LAMMPS's rigid fixes."""
    name = style.removeprefix("nosquish/")
    for part in "/nosquish", "/omp", "/small":
        name = name.removesuffix(part)
    return name if name in KEYWORDS else None


def integrator(name: str, words: Collection[str]) -> str:
    """The name of the class that replaces a fix: NVE, NVT, NPT or NPH.

    Args:
        name: of the fix, as `plain` gives it.
    """
    warmed = "langevin" in words
    if name in BODIES:
        return "NVT" if warmed else "NVE"
    return "NPT" if name == "rigid/nph" and warmed else name[-3:].upper()


def give_meaning(values: dict[str, Any], known: Collection[str], words: tuple[str, ...]) -> None:
    """Put the meaning that keywords have in LAMMPS's fix, and those that are left out, in the place
    of what was read.

    Args:
        values: dictionary from keywords to what was read.  known: the keywords that the class has.
        words: of the line.
    """
    *temp, seed = values.pop("langevin", (None,))
    length, *_ = values.pop("tparam", (CHAIN,))
    values.pop("pchain", None)
    values.setdefault("order", 123)
    if temp:
        values |= {"temp": tuple(temp), "seed": seed, "thermostat": "langevin"}
    elif "thermostat" in known and values.setdefault("thermostat", "nh") == "nh":
        values.setdefault("tchain", length)
        values.setdefault("separate", True)
    if "barostat" in known:
        values.setdefault("barostat", "mtk")
    read = [name for name in values if name in ("infile", "reinit")]
    if read == ["reinit", "infile"]:  # the last one counts
        values["reinit"] = False
    if "iso" not in known:
        for name in OF_BOX:
            values.pop(name, None)
    else:
        _give_axes(values, words)
        values.setdefault("dilate", "all")
        values.setdefault("every", 1)  # as there: jumps take it elsewhere from a far start


def _give_axes(values: dict[str, Any], words: tuple[str, ...]) -> None:
    """Have words of the pressure mean what they do there, where the last one counts: iso is aniso
    with couple xyz, and axes may stand behind aniso."""
    given, backwards = values.get("pressure", {}), words[::-1]
    if "iso" in given and (len(given) > 1 or "couple" in values):
        if "couple" not in values or backwards.index("iso") < backwards.index("couple"):
            values["couple"] = "xyz"
        given = {"aniso" if word == "iso" else word: said for word, said in given.items()}
    names = list(given)
    before = names[: names.index("aniso")] if "aniso" in names else ()
    values["pressure"] = {word: said for word, said in given.items() if word not in before}


def story(fix_id: str, command: "Command") -> str | None:
    """Lines for the log: what replaces which rigid fix, what stays, and what differs.

    Args:
        command: with the values that `give_meaning` has made.
    Returns:
        None if the line is not that of a rigid fix.
    """
    name, words = command.line.replaces, command.line.words
    if not name:
        return None
    kind, box = integrator(name, words), not {*OF_BOX}.isdisjoint(words)
    how = []
    if command.temp:
        how.append(f"thermostat {command.thermostat}")
        if command.thermostat == "nh":
            separate = "yes" if command.separate else "no"
            how.append(f"tchain {command.tchain} separate {separate}")
    if kind == "NPT":
        how.append(f"barostat {command.barostat}")
    with_words = f" with {' '.join(how)}" if how else ""
    piston = kind == "NPH" or command.barostat == "mtk"
    alike = name == "rigid/npt" and piston and command.temp[0] == command.temp[1]
    source = "the higher of TSTART and TSTOP" if command.temp else "the bodies' first temperature"
    steps = "; ".join(
        said
        for said, so in (
            ("the rotation is that of rigid/nve, whose energy does not drift", name == "rigid"),
            ("linear bodies and symmetric tops rotate exactly", kind == "NVE"),
            (
                f"{'piston' if kind == 'NPH' else 'thermostat'} and velocities of atoms belong to "
                "the middle of a step",
                kind != "NVE",
            ),
            ("iterations and order of tparam are 1 and 3", _other_order(words)),
            (
                "the piston has the thermostat's chain, not that of pchain",
                kind == "NPT" and "pchain" in words,
            ),
            ("the piston has no chain, as of pchain", kind == "NPH"),
            (
                f"the piston's inertia follows from {source}",
                command.pressure and piston and not alike,
            ),
            ("couple and dilate have no effect, as there", not command.pressure and box),
        )
        if so
    )
    period = ", the period of the box with this PDAMP" * alike
    return (
        f"Fix {fix_id}: nosquish/{kind.lower()}{with_words} replaces {command.line.name}\n"
        f"  as in LAMMPS: words, f_{fix_id} and its columns, computes rigid/local, ke/rigid, "
        f"erotate/rigid{period}\n"
        f"  different: {steps}\n"
    )


def _other_order(words: tuple[str, ...]) -> bool:
    """Whether keyword tparam gives iterations or an order that ours does not have."""
    place = words.index("tparam") if "tparam" in words else len(words)
    return words[place + 2 : place + 4] not in ((), (str(ITERATIONS), str(ORDER)))
