"""The total momentum of an ensemble's bodies, which does not contribute to their temperature."""

import weakref
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..bodies.membership import Membership
from ..errors import refuse
from ..host.hosts import OtherFix
from ..run import thermo
from ..run.other_fixes import acts_on_bodies, pushing_pair_style
from ..run.part import Part
from ..run.run import Run

_UNIFORM = "efield", "efield/tip4p"  # fixes whose field is uniform unless it varies
NEUTRAL = 1e-6  # largest total charge, from rounding, of a neutral system
CHANGED = 0.1  # change of the total momentum's energy, relative to its thermal value, to warn of
DRIFT = 1e-3  # largest fraction of the kinetic energy in the total momentum without a warning


class Momentum(Part):
    """The total momentum of an ensemble's bodies.

    Args:
        conserved: whether the ensemble conserves it.
        thermostat: gets a note on its degrees of freedom; None for no thermostat.

    Attributes:
        freedom: degrees of freedom of the total momentum if it is conserved, taken as zero; else 0.
    """

    freedom = 0
    _part = 0.0  # fraction of the kinetic energy in the total momentum at the start of a run
    _run: Any = None

    def __init__(self, conserved: bool, thermostat: Any) -> None:
        self._conserved, self._thermostat = conserved, thermostat

    def begin(self, run: Run) -> None:
        self._run = weakref.proxy(run)

    def degrees(self) -> np.ndarray:
        """Active degrees of freedom of translation and rotation, (2,); collective.

        Those of the total momentum are subtracted if nothing changes it.  This requires that all
        atoms are in bodies without inactive components.
        """
        run, bodies, owned = self._run, self._run.bodies, self._run.bodies.sharers.owned
        dimension, mask = run.lammps.dimension, np.ones((6, len(bodies)))
        mask *= 1.0 if run.mask is None else run.mask
        of_rotation = thermo.freedom(bodies, dimension) - dimension
        turns = mask[5] if dimension == 2 else mask[3:].prod(axis=0)
        free = np.array([mask[:dimension].sum(axis=0), of_rotation * turns])[:, owned].sum(axis=1)
        missing = dimension * owned.sum() - free[0] + len(run.lammps.groups) - len(bodies.index)
        *free, missing = run.ranks.total(np.array([*free, missing]))
        pushed_by = "atoms in no body, or components that are off" if missing else _pushed_by(run)
        self.freedom = freedom = dimension if self._conserved and not pushed_by else 0
        self._left = sum(free) - freedom
        if self._conserved and self._thermostat:
            others = f"with the total momentum, because of {pushed_by}"
            momentum = others if pushed_by else "without the total momentum"
            note = f"\n  thermostat: {self._left:.0f} of these, {momentum}"
            self._thermostat.freedom_note = note
        refuse(
            not sum(free) > freedom and not run.command.mol,
            f"the bodies have {sum(free):.0f} degrees of freedom, of which the total "
            f"momentum takes {freedom}: there is none to keep at a temperature",
        )
        return np.array([max(free[0] - freedom, 0.0), free[1]])

    def extra_warnings(self, run: Run) -> Iterator[str]:
        """A warning if the total momentum is taken as zero but is not zero."""
        self._part = run.thermo.momentum_part() if self.freedom else 0.0
        if self._part > DRIFT:
            yield (
                f"WARNING: the bodies' total momentum has {self._part:.2g} of their kinetic "
                "energy, which counts as heat, so all other motion is colder. Remove it before the "
                "run: velocity ... zero linear"
            )

    def end(self, run: Run) -> None:
        """Warn if the total momentum was taken as conserved but has changed in the run."""
        if not self._thermostat or not self.freedom or self._part > DRIFT:
            return
        part, of_heat = run.thermo.momentum_part(), self.freedom / (self.freedom + self._left)
        if part > 4.0 * self._part + CHANGED * of_heat:
            run.host.log(
                "WARNING: something has changed the bodies' total momentum in this run, which has "
                f"{part:.2g} of their kinetic energy now. The thermostat took it as conserved, so "
                f"the bodies are too cold by up to {of_heat:.2g} of their temperature: use "
                "thermostat langevin, which does not need the degrees of freedom\n"
            )


def _pushed_by(run: Run) -> str | None:
    """The name of an interaction that may change the total momentum, or None; collective."""
    if run.conditions.gravity is not None:
        return "keyword gravity"
    if run.external.moves_centres:
        return "external forces"
    if style := pushing_pair_style(run.host, run.lammps.setting("newton_pair") > 0):
        return f"pair style {style}"
    pushing = run.conditions.other_fixes.pushing()
    changing = next((fix for fix in pushing if _pushes(fix, run.membership)), None)
    return changing and f"fix {changing.id}"


def _pushes(fix: OtherFix, membership: Membership) -> bool:
    """Whether another fix may change the bodies' total momentum; collective."""
    if fix.style not in _UNIFORM or fix.varies:
        return acts_on_bodies(fix, membership)
    lammps, atoms = membership.lammps, membership.atoms()
    charge, inside = lammps.per_atom("q"), atoms[fix.has(lammps.groups[atoms])]
    charges = np.zeros(1) if charge is None else charge[inside]
    return abs(membership.communicator.total(np.array([charges.sum()]))[0]) > NEUTRAL
