"""Pair energies shifted to zero at the cutoff.

Where a pair potential is cut, its energy jumps as two atoms cross the cutoff, and no force belongs
to the jump.  The total energy therefore wanders, whatever the integrator and the step, and hides a
drift.  ``pair_modify shift yes`` removes the jump from the energy and leaves all forces.
"""

import itertools
from collections.abc import Callable, Iterable

from . import conserved_energy, rigid_atoms
from .commands import split_words
from .loader import UserScript

# styles of fixes that accept moves by the energy, or whose forces depend on it: another energy
# gives another ensemble
DEPENDENT = frozenset(
    (
        *("atom/swap", "bond/swap", "charge/regulation", "gcmc", "grem", "hmc", "mixed/swap"),
        *("mol/swap", "msst", "neighbor/swap", "nphug", "sgcmc", "widom"),
        *("nosquish/hmc", "fix_nosquish.HMC"),
    )
)
BAROSTATS = "nph", "npt", "box"  # first words of styles
LINE = "pair_modify shift yes tail no"
NOTE = (
    f"'{LINE}' is added, for the drift and the noise of the energy. All forces stay. Without it "
    "the energy jumps where two atoms cross a cutoff, which no step makes smaller."
)
WITHOUT_TAIL = " Energy and pressure have no tail correction here."


def with_shifted_pairs(script: UserScript, tell: Callable[[str], object] = print) -> UserScript:
    """The script with shifted pair energies.  It is unchanged if they are shifted already, if the
    potential is a many-body one, or if the shift would change the ensemble or be useless.

    Args:
        tell: is called with a note if the script is changed.
    """
    settings = _pair_settings(script.reading["commands"])
    if settings is None or settings["shift"] or conserved_energy.uncounted_fixes(script):
        return script
    if script.reading["manybody"] and not settings["hybrid"]:
        return script
    if any(rigid_atoms.short_name(line) in DEPENDENT for line in script.reading["fixes"].values()):
        return script
    others = conserved_energy.other_fixes(script).values()
    if settings["tail"] and (
        script.rigid.state.press or any(other in BAROSTATS for other in others)
    ):
        return script  # the tail is part of the pressure that the barostat controls
    note = NOTE + WITHOUT_TAIL * settings["tail"]
    return script.changed(note, tell, then=(*script.scene.then, LINE))


def _pair_settings(commands: Iterable[str]) -> dict[str, bool] | None:
    """Whether pair energies are shifted, and whether they may have tails; None without pair style.

    LAMMPS keeps both settings for a style that is set again, and a restart file has them.
    """
    style, settings = None, {"shift": False, "tail": False}
    for words in map(split_words, commands):
        if words[0] == "read_restart":
            settings = {"shift": False, "tail": True}
        elif words[0] == "pair_style":
            if style not in (None, words[1]):
                settings = {"shift": False, "tail": False}
            style = words[1]
        elif words[0] == "pair_modify":
            for name, value in itertools.pairwise(words[1:]):
                if name in settings:
                    settings[name] = value in ("yes", "on", "true")
    settings["hybrid"] = str(style).startswith("hybrid")
    return None if style in (None, "none", "zero") else settings
