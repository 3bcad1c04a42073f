"""Keyword gravity: the weight of bodies, by a fix gravity with its word disable."""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ..host.command import Command
from ..host.hosts import Host, OtherFix


def acceleration(
    command: Command, host: Host, method: str, *, needs_energy: bool, levels: bool
) -> np.ndarray | None:
    """The acceleration that the fix of keyword gravity gives, (3,); None without the keyword;
    collective.

    Args:
        method: the name of the integrator.  needs_energy: whether it needs the potential energy.
        levels: whether the run has the levels of run_style respa.
    Raises:
        RunError: if the keyword cannot be used in this run.
    """
    name = command.gravity
    if not name:
        return None
    host.need("gravity")
    cannot, instead = "keyword gravity cannot be used with", f"Remove 'disable' from fix {name}"
    if needs_energy:
        raise command.wrong(
            f"{cannot} {method}, because energies would lack that of the weight. "
            f"{instead}, and use fix_modify {name} energy yes"
        )
    if levels:
        raise command.wrong(f"{cannot} run_style respa. {instead} instead")
    gravity = host.gravity(name)
    if gravity is None:
        raise command.wrong(f"keyword gravity: '{name}' is not a fix gravity")
    return gravity


def refuse_twice(
    command: Command,
    fixes: Iterable[OtherFix],
    acts_on_bodies: Callable[[OtherFix], bool],
    scalar_of_fix: Callable[[str], Any],
) -> None:
    """End the run if the fix of keyword gravity acts on atoms of the bodies, too; collective."""
    name = command.gravity
    for fix in fixes if name else ():
        # with the word disable its energy is 0
        acts = fix.id == name and acts_on_bodies(fix)
        if acts and scalar_of_fix(fix.id):
            raise command.wrong(
                f"fix {name} acts on the atoms of the bodies, and keyword gravity on the "
                "bodies: bodies would have their weight twice. Add the word disable to that fix, "
                "or leave keyword gravity out"
            )
