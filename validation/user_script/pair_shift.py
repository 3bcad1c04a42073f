"""The energy that a script's forces keep, in the place of one that jumps.

Where a pair potential is cut, its energy jumps as two atoms cross the cutoff, and no force belongs
to the jump.  So the total energy wanders, whatever the integrator and the step, and a drift is hard
to see.  ``pair_modify shift yes`` takes the jump out of the energy, and leaves all forces.
"""

import itertools
from collections.abc import Callable, Iterable
from dataclasses import replace

from . import conserved_energy, rigid_atoms
from .commands import split_words
from .loader import UserScript

# styles of fixes that accept moves by the energy, or whose forces follow from it: another energy
# gives another ensemble
CHOOSE = frozenset(
    (
        *("atom/swap", "bond/swap", "charge/regulation", "gcmc", "grem", "hmc", "mixed/swap"),
        *("mol/swap", "msst", "neighbor/swap", "nphug", "sgcmc", "widom"),
        *("nosquish/hmc", "fix_nosquish.HMC"),
    )
)
# first words of styles that follow a pressure, but for those whose work nobody counts
PRESS = "nph", "npt", "box"
NOTE = (
    "'{line}' is added, for the drift and the noise of the energy. All forces stay. Without it "
    "the energy jumps where two atoms cross a cutoff, which no step makes smaller."
)
WITHOUT_TAIL = " Energy and pressure have no tail correction here."


def with_shifted_pairs(script: UserScript, tell: Callable[[str], object] = print) -> UserScript:
    """A script whose pair energies end at zero; as it is, where that cannot be, is done or is of no
    use.

    Args:
        tell: is given the sentences that say so.
    """
    found = _settings(script.reading["commands"])
    lines = script.reading["fixes"].values()
    if found is None or found["shift"] or conserved_energy.uncounted_fixes(script):
        return script
    if any(rigid_atoms.short_name(line) in CHOOSE for line in lines):
        return script
    baths = conserved_energy.other_fixes(script).values()
    if found["tail"] and (script.rigid.state.press or any(bath in PRESS for bath in baths)):
        return script  # its pressure is to have it
    line = "pair_modify shift yes tail no"
    note = NOTE.format(line=line) + WITHOUT_TAIL * bool(found["tail"])
    tell(note)
    scene = replace(script.scene, then=(*script.scene.then, line))
    return replace(script, scene=scene, notes=(*script.notes, note))


def _settings(commands: Iterable[str]) -> dict[str, bool] | None:
    """Whether pair energies are shifted, and may have tails; None if the script sets no pair style.

    LAMMPS keeps both for a style that is set again, and a restart file has them.
    """
    style, found = None, {"shift": False, "tail": False}
    for words in map(split_words, commands):
        if words[0] == "read_restart":
            found = {"shift": False, "tail": True}
        elif words[0] == "pair_style":
            if style not in (None, words[1]):
                found = {"shift": False, "tail": False}
            style = words[1]
        elif words[0] == "pair_modify":
            for name, value in itertools.pairwise(words[1:]):
                if name in found:
                    found[name] = value in ("yes", "on", "true")
    return None if style in (None, "none", "zero") else found
