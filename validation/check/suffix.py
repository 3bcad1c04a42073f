"""Whether LAMMPS's suffix nosquish takes our fix in the place of a script's fix rigid."""

from collections.abc import Iterable

from ..own.finding import Found
from ..own.script import texts

THERE = "nosquish", "omp"  # suffixes with which there is a fix rigid


def note(found: Found, commands: Iterable[str]) -> list[str]:
    """What ``lmp -sf nosquish`` makes of a script, in a sentence; none if it has no fix rigid.

    Args:
        commands: of the script, up to the run.
    """
    if found.kind != "rigid":
        return []
    suffixes, on, why = ["nosquish"], True, ""
    for line in commands:
        word, *rest = texts(line) or [""]
        if line in found.lines:
            break
        if word == "suffix":
            why, on = line, rest[0] != "off"
            if rest[0] not in ("off", "on"):
                suffixes = rest[1:] if rest[0] == "hybrid" else rest
        elif word == "package" and "pair/only" in rest:
            why = line
            if rest[rest.index("pair/only") + 1] in ("on", "yes"):
                suffixes = suffixes[1:]
    which, run = f"fix {found.ids[0]} ({found.style})", "'lmp -sf nosquish -in SCRIPT'"
    if on and [one for one in suffixes if one in THERE][:1] == ["nosquish"]:
        return [f"{run} replaces {which} by one of fix_nosquish, without an edit."]
    return [
        f"{run} leaves LAMMPS's own {which} in its place, because of '{why}'. Ours takes it with "
        "'suffix nosquish' before the fix, or 'suffix hybrid nosquish omp', with which pair styles "
        "have threads."
    ]
