"""What LAMMPS's ``econserve`` lacks, or has too much of, with a script's fixes."""

import re
from collections.abc import Collection, Iterable

from ..scenes.integrators import Integrator
from . import rigid_atoms
from .commands import split_words
from .loader import UserScript

# first words of the styles of fixes that act on atoms beside an integrator.  What they give is in
# econserve only with `fix_modify ID energy yes`, which LAMMPS refuses where they do not tell it;
# that of thermostats and barostats is not, or not in all versions
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
# their f_ID has the kinetic energy of translation a second time (small), or the temperature among
# its energies (the others)
WRONG = re.compile(r"rigid/n(vt|pt|ph)(/small)?")
WHY = (
    "LAMMPS's econserve is not what it keeps (it counts the energy of translation twice, adds a "
    "temperature, or lacks what its thermostat gives)"
)


def other_fixes(script: UserScript) -> dict[str, str]:
    """The first word of the style of each of the script's fixes that stay, beside those that move
    the bodies, by ID."""
    kept = (
        (fix_id, line)
        for fix_id, line in script.reading["fixes"].items()
        if fix_id not in script.rigid.ids
    )
    return {fix_id: rigid_atoms.style_of(line).split("/")[0] for fix_id, line in kept}


def acting_fixes(script: UserScript) -> list[str]:
    """IDs of `other_fixes` that act on atoms."""
    return [fix_id for fix_id, first in other_fixes(script).items() if first in ACTING]


def uncounted_fixes(script: UserScript) -> list[str]:
    """IDs of these whose work is not in econserve."""
    counted, first = _asked(script.reading["commands"]), other_fixes(script)
    return [
        fix_id for fix_id in acting_fixes(script) if fix_id not in counted or first[fix_id] in BATHS
    ]


def _asked(commands: Iterable[str]) -> set[str]:
    """IDs of the fixes whose energy `fix_modify` counts; it is forgotten with the fix."""
    found = set()
    for words in map(split_words, commands):
        if words[0] in ("fix", "unfix"):
            found.discard(words[1])
        elif words[0] == "fix_modify" and "energy" in words[2:-1]:
            asks = words[words.index("energy", 2) + 1] in ("yes", "on", "true")
            (found.add if asks else found.discard)(words[1])
    return found


def omission_notice(labels: Collection[str]) -> list[str]:
    """What is to be said of integrators with these labels whose energies are not shown."""
    return [f"Energies of {', '.join(labels)} are left out: {WHY}."] * bool(labels)


def misses_own_error(integrator: Integrator) -> bool:
    """Whether econserve says nothing of an integrator's own error, see `WHY`."""
    lines = [line for line in integrator.lines if split_words(line)[0] == "fix"]
    return any(
        WRONG.fullmatch(style) or (style.startswith("rigid") and "langevin" in split_words(line))
        for line in lines
        for style in [rigid_atoms.style_of(line)]
    )
