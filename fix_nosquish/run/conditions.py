"""What is known of a run before its bodies are made, and what cannot be used with it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..box import deform
from ..errors import refuse
from ..loops import machine_code
from . import gravity
from .other_boxes import followed_box, refuse_remap
from .other_fixes import OtherFixes, reading_pair_style
from .part import Part
from .registry import siblings_of
from .setting import Setting


@dataclass(frozen=True)
class Conditions:
    """What is known of a run before its bodies are made.

    Attributes:
        siblings: the `Setting`s of the other fixes of this package.
        other_fixes: all other ones, `OtherFixes`.
        levels: whether the run has the levels of run_style respa.
        mid_step: whether atoms have the velocities of the middle of the step at its end.
        goes_on: whether the bodies are those of the last run.
        half_step: whether something may read atoms' velocities between the halves of a step.
        deformed_box: the box that another fix changes, if bodies can follow it; else None, and
            a `BoxWatch` ends the run when it changes.
        remaps_velocities: whether this is with remap v, so that velocities change at faces.
        gravity: the acceleration of keyword gravity, (3,); None without it.
    """

    siblings: list[Setting]
    other_fixes: OtherFixes
    levels: bool
    mid_step: bool
    goes_on: bool
    half_step: bool
    deformed_box: np.ndarray | None
    remaps_velocities: bool
    gravity: np.ndarray | None


def refuse_time_step(dt: float, parts: Sequence[Part], name: str) -> None:
    """End the run if the integrator of this name, with these parts, does not support the time
    step."""
    refuse(
        (dt < 0 and not all(part.reversible for part in parts))
        or (dt == 0 and any(part.box_every for part in parts)),
        f"the time step is {dt:g}, and the integrator {name} needs one above zero: "
        "look at the command timestep",
    )


def conditions_of(setting: Setting) -> Conditions:
    """Find out what other fixes may read and change, and whether bodies move with a box that one of
    them changes; collective."""
    host, lammps, integrator = setting.host, setting.lammps, setting.integrator
    levels, name = bool(lammps.respa_dt), setting.command.line.name
    siblings = siblings_of(lammps.handle, setting.number)
    refuse(
        levels and not integrator.respa,
        f"the integrator {name} does not support run_style respa: use run_style verlet",
    )
    ours = {host.fix_id, *(sibling.host.fix_id for sibling in siblings)}
    # a sibling may end its step after this fix
    siblings_read = any(sibling.external.words.named for sibling in siblings)
    fixes = OtherFixes(host.fixes(), ours, host.command, lammps.step, siblings_read)
    reads = siblings_read or setting.external.words.named
    deformed_box = followed_box(
        host, fixes.changing_box, has_barostat=bool(setting.box_every), levels=levels
    )
    remaps = deformed_box is not None and bool(host.remap_group)
    if deformed_box is not None:
        machine_code.load(setting.ranks, deform.__name__)
    if remaps:
        supported = integrator.supports_remap_v and not setting.needs_energy
        refuse_remap(supported, name, setting.membership, host.remap_group)
    return Conditions(
        siblings=siblings,
        other_fixes=fixes,
        levels=levels,
        mid_step=integrator.mid_step and not levels and not host.dmax,
        goes_on=setting.maker.goes_on,
        half_step=bool(fixes.half_step or reads or reading_pair_style(host)),
        deformed_box=deformed_box,
        remaps_velocities=remaps,
        gravity=gravity.acceleration(
            setting.command, host, integrator.method,
            needs_energy=setting.needs_energy, levels=levels,
        ),
    )  # fmt: skip
