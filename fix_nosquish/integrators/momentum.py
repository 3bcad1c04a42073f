"""The total momentum of an ensemble's bodies, which has no part in their temperature."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import refuse
from ..run import thermo
from ..run.other_fixes import pushing_pair_style
from .thermostat import Part

_UNIFORM = "efield", "efield/tip4p"  # fixes of a field that is the same everywhere, or varies
NEUTRAL = 1e-6  # the charge that a neutral whole has, of rounding
CHANGED = 0.1  # of what the total momentum has of heat, by which it has changed in a run for sure
DRIFT = 1e-3  # of the kinetic energy, what that of the total momentum is without a warning


class Momentum(Part):
    """What is known of the total momentum.

    Attributes:
        kept: whether the ensemble leaves it as it is.
        held: degrees of freedom that it has, if it is taken as zero; else 0.
    """

    kept, held = True, 0
    _part = 0.0  # of the kinetic energy that is of the total momentum as a run begins

    def degrees(self) -> np.ndarray:
        """Degrees of freedom of translation and of rotation that are free to change, less those of
        the momentum if nothing changes it: all atoms are in bodies that are free; collective."""
        lammps, bodies, owned = self.lammps, self.bodies, self.bodies.sharers.owned
        dimension, mask = lammps.dimension, np.ones((6, len(bodies)))
        mask *= 1.0 if self.ensemble.mask is None else self.ensemble.mask
        of_rotation = thermo.freedom(bodies, dimension) - dimension
        turns = mask[5] if dimension == 2 else mask[3:].prod(axis=0)
        free = np.array([mask[:dimension].sum(axis=0), of_rotation * turns])[:, owned].sum(axis=1)
        missing = dimension * owned.sum() - free[0] + len(lammps.groups) - len(bodies.index)
        *free, missing = self.communicator.total(np.array([*free, missing]))
        pushed_by = "atoms in no body, or components that are off" if missing else self._pushed_by()
        self.held = held = dimension if self.kept and not pushed_by else 0
        if self.kept:
            self._left = sum(free) - held
            others = f"with the total momentum, because of {pushed_by}"
            momentum = others if pushed_by else "without the total momentum"
            self.ensemble.freedom_said = f"\n  thermostat: {self._left:.0f} of these, {momentum}"
        refuse(
            not sum(free) > held and not self.command.mol,
            f"the bodies have {sum(free):.0f} degrees of freedom, of which the total "
            f"momentum takes {held}: there is none to keep at a temperature",
        )
        return np.array([max(free[0] - held, 0.0), free[1]])

    def _pushed_by(self) -> str | None:
        """What may change the bodies' total momentum, None if nothing does; collective."""
        if self.ensemble.gravity is not None:
            return "keyword gravity"
        if self.ensemble.external.moves_centres:
            return "external forces"
        if style := pushing_pair_style(self.host, self.lammps.setting("newton_pair")):
            return f"pair style {style}"
        found = next(filter(self._pushes, self.other_fixes.pushing()), None)
        return found and f"fix {found.id}"

    def _pushes(self, fix: Any) -> bool:
        """Whether another fix may change the bodies' total momentum; collective."""
        if fix.style not in _UNIFORM or fix.varies:
            return self.ensemble.acts_on_bodies(fix)
        atoms, charge = self.ensemble.membership.atoms(), self.lammps.per_atom("q")
        inside = atoms[fix.has(self.lammps.groups[atoms])]
        charges = np.zeros(1) if charge is None else charge[inside]
        return abs(self.communicator.total(np.array([charges.sum()]))[0]) > NEUTRAL

    def warnings(self) -> Iterator[str]:
        """A line on a total momentum that is taken as zero and is not; collective."""
        self._part = self._part_of_momentum() if self.held else 0.0
        if self._part > DRIFT:
            yield (
                f"WARNING: the bodies' total momentum has {self._part:.2g} of their kinetic "
                "energy, which counts as heat, so all other motion is colder. Remove it before the "
                "run: velocity ... zero linear"
            )

    def look_again(self) -> None:
        """Say if it was taken as constant and has changed in a run; collective."""
        if not self.held or self._part > DRIFT:
            return
        part, of_heat = self._part_of_momentum(), self.held / (self.held + self._left)
        if part > 4.0 * self._part + CHANGED * of_heat:
            self.host.log(
                "WARNING: something has changed the bodies' total momentum in this run, which has "
                f"{part:.2g} of their kinetic energy now. The thermostat took it as conserved, so "
                f"the bodies are too cold by up to {of_heat:.2g} of their temperature: use "
                "thermostat langevin, which does not need the degrees of freedom\n"
            )

    def _part_of_momentum(self) -> float:
        """The part of the kinetic energy that is of the total momentum; collective."""
        bodies, owned = self.bodies, self.bodies.sharers.owned
        mass, v = bodies.mass[owned], bodies.v[:, owned]
        whole, *momentum = self.communicator.total(np.array([mass.sum(), *(mass * v).sum(axis=1)]))
        kinetic = thermo.energies(bodies, self.communicator, self.lammps).kinetic
        return 0.5 * self.lammps.mvv2e * np.square(momentum).sum() / (whole * kinetic or np.inf)
