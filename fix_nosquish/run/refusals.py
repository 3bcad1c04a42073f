"""What ends a run because bodies would not move as the user expects; with LAMMPS's other fixes
`other_fixes` does so."""

from typing import TYPE_CHECKING

import numpy as np

from ..errors import RunError, refuse
from . import log
from .schedule import Phase

if TYPE_CHECKING:
    from .integrator import Integrator

_ROUNDING = 1e-9  # of a total mass
PHI = 0.5 * (5**0.5 - 1)  # multiples of it are spread over [0, 1)
# fixes that change types of atoms, and so perhaps their masses
_OF_TYPES = "set", "atom/swap", "atom_swap", "bond/react", "sgcmc", "mol/swap"


def refuse_missing_template(integrator: "Integrator") -> None:
    """Raise an error if the molecule template of keyword mol is not known."""
    name = integrator.template
    if name and not integrator.lammps.has("molecule", name):
        raise integrator.command.wrong(
            f"there is no molecule template '{name}' (keyword mol): "
            "define it before the fix, by command molecule"
        )


def refuse_time_step(integrator: "Integrator") -> None:
    """End the run if the integrator cannot take the time step that there is."""
    dt = integrator.lammps.dt
    refuse(
        (dt < 0 and not integrator.backwards) or (dt == 0 and integrator.box_every),
        f"the time step is {dt:g}, and the integrator {integrator.name} needs one above zero: "
        "look at the command timestep",
    )


def refuse_levels(integrator: "Integrator") -> None:
    """End a run of run_style respa if the integrator takes one force a step."""
    refuse(
        integrator.lammps.respa_dt and not integrator.respa,
        f"the integrator {integrator.name} does not support run_style respa: use run_style verlet",
    )


def weight(integrator: "Integrator") -> np.ndarray | None:
    """What the fix of keyword gravity gives, (3,); None without that keyword; collective.

    Raises:
        RunError: if it cannot serve.
    """
    name = integrator.command.gravity
    if not name:
        return None
    cannot, instead = "keyword gravity cannot be used with", f"Remove 'disable' from fix {name}"
    problem = (
        f"{cannot} {integrator.method}, because energies would lack that of the weight. "
        f"{instead}, and use fix_modify {name} energy yes"
        if integrator.needs_energy
        else f"{cannot} run_style respa. {instead} instead"
        if integrator.lammps.respa_dt
        else f"{cannot} LAMMPS's own fix python/move. {instead} instead"
        if not integrator.host.follows
        else ""
    )
    found = None if problem else integrator.host.gravity(name)
    if found is None:
        raise integrator.command.wrong(problem or f"keyword gravity: '{name}' is not a fix gravity")
    return found


def refuse_weight_twice(integrator: "Integrator") -> None:
    """End the run if the fix of keyword gravity acts by itself, too; collective."""
    name = integrator.command.gravity
    for fix in integrator.other_fixes if name else ():
        # with the word disable it knows no energy
        acts = fix.id == name and integrator.acts_on_bodies(fix)
        if acts and integrator.lammps.scalar_of_fix(fix.id):
            raise integrator.command.wrong(
                f"fix {name} acts on the atoms of the bodies, and keyword gravity on the "
                "bodies: bodies would have their weight twice. Give that fix its word "
                "disable, or leave keyword gravity out"
            )


def refuse_streams(integrator: "Integrator") -> None:
    """End the run if bodies cannot cross faces as with remap v of fix deform; collective."""
    if not integrator.streams:
        return
    refuse(
        not integrator.crosses or integrator.needs_energy,
        "fix deform has remap v, with which bodies get another velocity at periodic faces: "
        f"{integrator.name} does not do so. Use fix nosquish/nve, and "
        "fix langevin with fix_modify temp for a temperature",
    )
    atoms, streams = integrator.membership.atoms(), integrator.host.stream_group & 0xFFFFFFFF
    refuse(
        integrator.communicator.any((integrator.lammps.groups[atoms] & streams == 0).any()),
        "fix deform has remap v for a group that lacks atoms of the bodies: give it group all",
    )


def refuse_turnover(integrator: "Integrator") -> None:
    """End the run, in which bodies came or are gone, if the integrator does not do so."""
    refuse(
        integrator.start or integrator.box_every or integrator.needs_energy,
        f"bodies came or are gone by step {integrator.lammps.step}, which the integrator "
        f"{integrator.name} does not do in a run: use fix nosquish/nve or fix nosquish/nvt, "
        "or insert and delete between runs, with reinit yes",
    )


class Unchanged:
    """What of box and masses must stay as it is when bodies are made.

    Masses, and the places of atoms, are compared at the end of each run that has other fixes, so
    none of these changes them unseen.  An earlier look needs a fix that may change them: masses are
    compared where atoms are followed after LAMMPS has re-neighboured, too, and places where a step
    begins behind a fix that has acted at the end of the last one (`velocities.take_late`).

    Attributes:
        box_may_change: whether another fix may change the box without bodies that move with it.
        masses_may_change: whether another fix is one of those that change masses or types of atoms.
    """

    box_may_change = masses_may_change = False

    def begin_run(self, integrator: "Integrator") -> None:
        """A run begins: find out what may change in it."""
        fixes, lammps = integrator.other_fixes, integrator.lammps
        self.box_may_change = fixes.change_box and integrator.told_box is None
        adapts = ("adapt",) if lammps.setting("rmass_flag") > 0 else ()
        self.masses_may_change = any(fix.style.startswith(_OF_TYPES + adapts) for fix in fixes)

    def note(self, integrator: "Integrator") -> None:
        """The bodies are those that there are now."""
        self._box = integrator.lammps.box
        self.note_masses(integrator)

    def note_masses(self, integrator: "Integrator") -> None:
        """Atoms have their masses of now, whatever they were before the run; collective."""
        self._mass = _mass_of_atoms(integrator)

    def refuse_new_box(self, integrator: "Integrator", held: bool | np.ndarray) -> None:
        """End the run if one of the box vectors that are held, (3,) bool, has changed."""
        box = integrator.lammps.box
        if box is self._box or integrator.box_every:
            return
        if ((box.h != integrator.bodies.cells["h"].array) & held).any():
            raise RunError(
                f"the box has changed by step {integrator.lammps.step}, and bodies do not move "
                "with it. In a run use fix nosquish/npt, fix nosquish/nph, or fix deform with "
                "remap x or v and run_style verlet; between runs any command may change the box, "
                "with reinit yes and without infile or 'pre no'",
                everywhere=True,
            )
        self._box = box

    def refuse_new_masses(self, integrator: "Integrator") -> None:
        """End the run if the bodies' atoms have other masses than at its begin; collective."""
        now, step = _mass_of_atoms(integrator), integrator.lammps.step
        if (abs(now - self._mass) > _ROUNDING * self._mass).any():
            raise RunError(
                f"atoms of the bodies have other masses by step {step} than when the run began "
                f"({now[0]:.9g} in all, and {self._mass[0]:.9g}): bodies keep their masses in a "
                "run. Change masses and types of atoms between runs (fix adapt, fix set and fix "
                "atom/swap do so in one)",
                everywhere=True,
            )


def _mass_of_atoms(integrator: "Integrator") -> np.ndarray:
    """Of all bodies' atoms, and with a weight of each, so that no two change places, (2,);
    collective."""
    bodies = integrator.bodies
    mass = integrator.lammps.masses[bodies.index]
    return integrator.communicator.total(np.array([mass.sum(), mass @ (1 + bodies.tag * PHI % 1)]))


def bad_forces(integrator: "Integrator", step: int) -> RunError:
    """The error for forces of a step that are not finite."""
    bodies, name = integrator.bodies, integrator.membership.name
    bad = (~np.isfinite(bodies.wrench).all(axis=0)).argmax()
    cause, remedy = bodies.instability(bad, integrator.lammps)
    if integrator.host.phase == Phase.NEW:
        cause, remedy = "atoms overlap at the start", log.APART
    advice = "use a shorter time step or a better start, and look for what else acts on the body"
    return RunError(
        f"{cause or 'the run is unstable'}, and the force on {name(bodies.id[bad])} is not finite "
        f"at step {step}: {remedy or advice}"
    )
