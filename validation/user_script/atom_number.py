"""Scripts whose fixes insert or delete atoms: averages of different runs are then not of the same
system, so `compare` leaves these fixes out."""

from collections.abc import Callable

from . import candidates, rigid_atoms
from .commands import split_words
from .loader import UserScript

CHANGE = frozenset(("deposit", "evaporate", "gcmc", "gemc", "pour"))  # styles of these fixes


def with_constant_atoms(script: UserScript, tell: Callable[[str], object] = print) -> UserScript:
    """The script without fixes that change the number of atoms.

    Args:
        tell: is called with a note if the script is changed.
    """
    fixes = script.reading["fixes"].items()
    gone = {fix_id: line for fix_id, line in fixes if rigid_atoms.style_of(line) in CHANGE}
    if not gone:
        return script

    def without_fixes(lines: tuple[str, ...]) -> tuple[str, ...]:
        words = ((line, split_words(line)) for line in lines)
        return tuple(line for line, (word, *rest) in words
                     if word not in ("fix", "fix_modify") or rest[0] not in gone)  # fmt: skip

    setup, then = without_fixes(script.scene.setup), without_fixes(script.scene.then)
    note = (
        "Left out, because the number of atoms has to be constant here: "
        f"{'; '.join(gone.values())}. The comparison is of the atoms at the start."
    )
    if readers := candidates.commands_naming(gone, [*setup, *then]):
        note += f" These commands use such a fix, and may fail without it: {'; '.join(readers)}."
    return script.changed(note, tell, setup=setup, then=then)
