"""Whether LAMMPS's ``econserve`` is conserved with a script's fixes."""

import re
from collections.abc import Iterable

from ..scenes.integrators import Integrator
from . import rigid_atoms
from .commands import split_words
from .loader import UserScript

# First words of the styles of fixes that act on atoms besides an integrator.  Their work is in
# econserve only with `fix_modify ID energy yes`, which LAMMPS refuses for fixes that cannot compute
# it; that of thermostats and barostats is missing in some versions
BATHS = frozenset(("langevin", "press", "temp"))
ACTING = BATHS | frozenset(
    (
        *("accelerate", "addforce", "addtorque", "aveforce", "colvars", "deform", "drag", "efield"),
        *("ehex", "electron", "ffl", "flow", "freeze", "gld", "gle", "gravity", "heat", "hyper"),
        *("indent", "lb", "lineforce", "oneway", "orient", "planeforce", "propel"),
        *("qbmsst", "restrain", "setforce", "smd", "spring", "srd", "thermal", "ti", "tmd", "ttm"),
        *("viscosity", "viscous", "wall"),
    )
)
# their f_ID counts the kinetic energy of translation twice (small), or adds a temperature to
# energies (the others)
WRONG = re.compile(r"rigid/n(vt|pt|ph)(/small)?")
WHY = (
    "LAMMPS's econserve is not the conserved quantity: it counts the energy of translation twice, "
    "adds a temperature, or lacks the energy that the thermostat exchanges"
)


def other_fixes(script: UserScript) -> dict[str, str]:
    """The first word of the style of each fix that stays, by ID: all but those that move bodies."""
    return {
        fix_id: rigid_atoms.style_of(line).split("/")[0]
        for fix_id, line in script.reading["fixes"].items()
        if fix_id not in script.rigid.ids
    }


def acting_fixes(script: UserScript) -> list[str]:
    """The IDs of `other_fixes` that act on atoms."""
    return [fix_id for fix_id, first in other_fixes(script).items() if first in ACTING]


def uncounted_fixes(script: UserScript) -> list[str]:
    """The IDs of `acting_fixes` whose work is not in econserve."""
    counted, first = _with_energy(script.reading["commands"]), other_fixes(script)
    return [
        fix_id for fix_id in acting_fixes(script) if fix_id not in counted or first[fix_id] in BATHS
    ]


def _with_energy(commands: Iterable[str]) -> set[str]:
    """The IDs of fixes with ``fix_modify ID energy yes``; the setting ends with the fix."""
    ids: set[str] = set()
    for words in map(split_words, commands):
        if words[0] in ("fix", "unfix"):
            ids.discard(words[1])
        elif words[0] == "fix_modify" and "energy" in words[2:-1]:
            counted = words[words.index("energy", 2) + 1] in ("yes", "on", "true")
            (ids.add if counted else ids.discard)(words[1])
    return ids


def misses_own_error(integrator: Integrator) -> bool:
    """Whether econserve does not show an integrator's own error, see `WHY`."""
    fixes = [line for line in integrator.lines if split_words(line)[0] == "fix"]
    styles = {line: rigid_atoms.style_of(line) for line in fixes}
    return any(
        WRONG.fullmatch(style) or (style.startswith("rigid") and "langevin" in split_words(line))
        for line, style in styles.items()
    )
