"""Keywords of LAMMPS's rigid fixes, which ``lmp -sf nosquish`` replaces, with their meaning there.

The styles are rigid, rigid/nve, rigid/nvt, rigid/npt and rigid/nph, also with the suffixes /small,
/omp and /nosquish.  The keywords of this package's integrators are accepted, too.
"""

from collections.abc import Collection
from typing import Any

# no thermostat, except with keyword langevin; f_ID is a temperature
BODIES = "rigid", "rigid/nve"
# keywords that all of these fixes accept, without effect if there is no barostat
OF_BOX = "couple", "dilate"
# additional keywords of a fix, by its `plain` name, besides those of the class
KEYWORDS = {
    "rigid": ("langevin", *OF_BOX),
    "rigid/nve": ("langevin", *OF_BOX),
    "rigid/nvt": ("tparam", *OF_BOX),
    "rigid/npt": ("tparam", "pchain"),
    "rigid/nph": ("langevin", "pchain"),
}
CHAIN, ITERATIONS, ORDER = 10, 1, 3  # defaults of keyword tparam


def plain(style: str) -> str | None:
    """Style without /small, /omp and nosquish; None if it is not a rigid fix of LAMMPS."""
    name = style.removeprefix("nosquish/")
    for part in "/nosquish", "/omp", "/small":
        name = name.removesuffix(part)
    return name if name in KEYWORDS else None


def integrator(name: str, words: Collection[str]) -> str:
    """The name of the class that replaces a fix: NVE, NVT, NPT or NPH.

    Args:
        name: name of the fix, as returned by `plain`.
    """
    thermostat = "langevin" in words
    if name in BODIES:
        return "NVT" if thermostat else "NVE"
    return "NPT" if name == "rigid/nph" and thermostat else name[-3:].upper()


def give_meaning(values: dict[str, Any], known: Collection[str], words: tuple[str, ...]) -> None:
    """Replace the values of keywords by their meaning in LAMMPS's fix, and add its defaults.

    Args:
        values: values by keyword, in the order of the line; changed in place.
        known: the keywords of the class.
        words: words of the line.
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
    if read == ["reinit", "infile"]:  # the last one wins
        values["reinit"] = False
    if "iso" not in known:
        for name in OF_BOX:
            values.pop(name, None)
    else:
        _give_axes(values, words)
        values.setdefault("dilate", "all")
        values.setdefault("every", 1)  # as in LAMMPS's fix


def _give_axes(values: dict[str, Any], words: tuple[str, ...]) -> None:
    """Read the pressure as LAMMPS does: iso means aniso with couple xyz, axes may follow aniso, and
    the last one counts."""
    given, backwards = values.get("pressure", {}), words[::-1]
    if "iso" in given and (len(given) > 1 or "couple" in values):
        if "couple" not in values or backwards.index("iso") < backwards.index("couple"):
            values["couple"] = "xyz"
        given = {"aniso" if word == "iso" else word: value for word, value in given.items()}
    names = list(given)
    before = names[: names.index("aniso")] if "aniso" in names else ()
    values["pressure"] = {word: value for word, value in given.items() if word not in before}
