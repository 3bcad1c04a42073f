"""The notice in the log if a fix replaces one of LAMMPS's rigid fixes."""

from ..host.command import Command
from ..host.rigid_fixes import ITERATIONS, OF_BOX, ORDER, integrator


def replacement_notice(fix_id: str, command: Command) -> str | None:
    """Lines for the log: what replaces which rigid fix, and what differs; None if nothing does."""
    name, words = command.line.replaces, command.line.words
    if not name:
        return None
    kind, box = integrator(name, words), not {*OF_BOX}.isdisjoint(words)
    how = []
    if command.temp:
        how.append(f"thermostat {command.thermostat}")
        if command.tchain:  # else another thermostat
            separate = "yes" if command.separate else "no"
            how.append(f"tchain {command.tchain} separate {separate}")
    if kind == "NPT":
        how.append(f"barostat {command.barostat}")
    with_words = f" with {' '.join(how)}" if how else ""
    piston = kind == "NPH" or command.barostat == "mtk"
    alike = name == "rigid/npt" and piston and command.temp[0] == command.temp[1]
    source = "the higher of TSTART and TSTOP" if command.temp else "the bodies' first temperature"
    part = "piston" if kind == "NPH" else "thermostat"
    steps = "; ".join(
        difference
        for difference, applies in (
            ("the rotation is that of rigid/nve, whose energy does not drift", name == "rigid"),
            ("linear bodies and symmetric tops rotate exactly", kind == "NVE"),
            (
                f"{part} and velocities of atoms are those of the middle of the step",
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
        if applies
    )
    period = ", the period of the box with this PDAMP" * alike
    return (
        f"Fix {fix_id}: nosquish/{kind.lower()}{with_words} replaces {command.line.name}\n"
        f"  as in LAMMPS: the other keywords, f_{fix_id} and its columns, computes rigid/local, "
        f"ke/rigid, erotate/rigid{period}\n"
        f"  different: {steps}\n"
    )


def _other_order(words: tuple[str, ...]) -> bool:
    """Whether keyword tparam has other iterations or another order than ours."""
    place = words.index("tparam") if "tparam" in words else len(words)
    return words[place + 2 : place + 4] not in ((), (str(ITERATIONS), str(ORDER)))
