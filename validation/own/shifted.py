"""The energy that a script's forces keep, in the place of one that jumps.

Where a pair potential is cut, its energy jumps as two atoms cross the cutoff, and no force belongs
to the jump.  So the total energy wanders, whatever the integrator and the step, and a drift is hard
to see.  ``pair_modify shift yes`` takes the jump out of the energy, and leaves all forces.
"""

import itertools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from validation.own import finding
from validation.own.script import texts
from validation.own.system import Own

# styles of fixes that accept moves by the energy: another energy gives another ensemble
CHOOSE = frozenset(
    (
        *("atom/swap", "bond/swap", "charge/regulation", "gcmc", "mixed/swap", "neighbor/swap"),
        *("sgcmc", "tfmc", "widom"),
    )
)
NOTE = (
    "'{line}' is added, for the drift and the noise of the energy. All forces stay. Without it "
    "the energy jumps where two atoms cross a cutoff, which no step makes smaller."
)
WITHOUT_TAIL = " Energy and pressure have no tail correction here."


def shifted(own: Own, tell: Callable[[str], object] = print) -> Own:
    """A script whose pair energies end at zero; as it is, where that cannot be or is done.

    Args:
        tell: is given the sentences that say so.
    """
    found = _settings(own.said["commands"])
    styles = {finding.style_of(line) for line in own.said["fixes"].values()}
    if found is None or found["shift"] or styles & CHOOSE:
        return own
    if found["tail"] and own.found.state.press:  # the barostat's pressure is to have it
        return own
    line = "pair_modify shift yes" + " tail no" * found["tail"]
    note = NOTE.format(line=line) + WITHOUT_TAIL * found["tail"]
    tell(note)
    scene = replace(own.scene, then=(*own.scene.then, line))
    return replace(own, scene=scene, notes=(*own.notes, note))


def _settings(commands: Iterable[str]) -> Mapping[str, bool] | None:
    """Whether pair energies are shifted and have tails; None if the script sets no pair style."""
    found: dict[str, bool] | None = None
    for words in map(texts, commands):
        if words[0] == "pair_style":
            none = words[1:2] in (["none"], ["zero"])
            found = None if none else {"shift": False, "tail": False}
        elif words[0] == "pair_modify" and found is not None:
            for name, value in itertools.pairwise(words[1:]):
                if name in found:
                    found[name] = value in ("yes", "on", "true")
    return found
