"""Barostats: keywords, parameters and checks that `crescale` and `mtk` have in common."""

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np

from ..box import cell, free_atoms
from ..box.cell import MOST, OUT_OF_BOUNDS, XY, BarostatNumbers, flip
from ..errors import RunError, refuse
from ..host.command import PRESSURES, TILTS
from ..host.hosts import OtherFix
from ..host.lammps import Lammps
from ..loops.compiled import F1, L1, Cell, I, Kind, Loop
from ..run.other_boxes import WITH_SWITCHES
from ..run.other_fixes import READERS
from ..run.run import Run
from .thermostat import MOST_STEPS, EnsemblePart, far_off, instability

AXES = "xyz"
PARTS_OF_BOX = *AXES, *TILTS
# changes of the box per PDAMP, by default and at least without a warning: with rare, large changes
# the fast fluctuations of a liquid's pressure make the volume fluctuate too much
PARTS, FEWEST_PARTS = 50, 20
# fixes that change forces, but not the mean virial within bodies, or not along an axis that can
# change
_HARMLESS = (*READERS, "langevin", "temp/", "viscous", "gravity", "enforce2d", "property/", "wall/")
# fixes that constrain atoms by forces, and fixes that set the positions of their atoms
_CLUSTERS = "shake", "rattle"
_PLACES = "rigid", "poems", "move"
_NOISE = "langevin", "qtb", "ttm", "gld"  # fixes whose forces are random
PRESSURE = (*PRESSURES, "couple", "every", "dilate")  # words
COUPLED = {"xyz": (0, 0, 0), "xy": (0, 0, 2), "yz": (0, 1, 1), "xz": (0, 1, 0), "none": (0, 1, 2)}


class Barostat(EnsemblePart):
    """The barostat of an ensemble, which changes the box every `box_every` steps.

    All atoms of the system must be in its bodies or flexible, or keyword dilate must say which of
    the others are remapped with the box.

    Attributes:
        numbers: type of the record of parameters.
        forces_known: the loop that uses the virial of the bodies' forces.
        parameters: that record, the cell `barostat` of its loops; see `cell`.
        axes: the groups of coupled axes and tilts, (6,): see `cell.BarostatNumbers`.
        has_others: whether there are atoms in no body.
        dampings: (6,) PDAMP of each group of coupled axes and of each tilt.

    Raises:
        RunError: for keywords that cannot be combined, for atoms that would not follow the box, and
            for an axis that is not periodic.
    """

    modules = cell.__name__, free_atoms.__name__
    numbers: ClassVar[Kind] = BarostatNumbers
    forces_known: ClassVar[Loop]
    parameters: Any = None
    has_others = False
    box_every = 1  # until a run begins
    reversible = False

    def __init__(self, ensemble: Any) -> None:
        super().__init__(ensemble)
        command = self.command
        coupled = COUPLED["xyz" if "iso" in command.pressure else command.couple]
        groups = zip(PARTS_OF_BOX, (*coupled, 3, 4, 5), strict=True)
        flat = "" if ensemble.dimension == 3 else "z"
        self.axes = np.array(
            [
                group if command.pressure_of(part) and not (flat and flat in part) else -1
                for part, group in groups
            ]
        )
        self.changing_tilts = [tilt for tilt, group in zip(TILTS, self.axes[XY:]) if group >= 0]

    @property
    def flips(self) -> bool:
        return bool(self.changing_tilts)

    def extra_parameters(self, run: Run) -> dict[str, Any]:
        self._refuse(run)
        usual = min(self.damping(run.lammps) / (PARTS * run.lammps.dt) + 1e-9, 2.0**31 - 1.0)
        self.box_every = run.host.box_every = self.command.every or max(1, int(usual))
        return {}

    def start(self, run: Run) -> None:
        """Raise an error if keyword dilate remaps only a part of a cluster of shake; collective."""
        if run.host.held:
            atom = run.host.cut_cluster()
            run.ranks.agree(
                f"fix shake or rattle holds atom {atom}, which keyword dilate moves with the box, "
                "together with an atom that is not in its group: have both in that group, or none"
                if atom
                else None
            )

    def extra_warnings(self, run: Run) -> Iterator[str]:
        """Warnings of rare changes of the box, and of fixes whose forces are missing in LAMMPS's
        virial, although the virial within bodies includes them."""
        if run.external.moves_centres and not run.external.words.virial:
            yield (
                "WARNING: the virial lacks the external forces on the bodies: the box follows a "
                "pressure without them. Give fix_modify external the words virial yes"
            )
        for fix in run.conditions.other_fixes:
            harmless = fix.style.startswith(_HARMLESS) and "region" not in fix.style
            if not fix.post_force or fix.virial_in_press or harmless:
                continue
            if run.acts_on_bodies(fix):
                advice = (
                    f"use 'fix_modify {fix.id} virial yes'"
                    if fix.has_virial
                    else "it has none that fix_modify could add: use constant volume, or take the "
                    "mean of a run without the fix"
                )
                yield (
                    f"WARNING: fix {fix.id} (style {fix.style}) changes forces, and the virial "
                    f"lacks these: the box follows a wrong pressure: {advice}"
                )
        lammps, every = run.lammps, self.box_every
        damping, dt = self.damping(lammps), lammps.dt
        yield from far_off("PDAMP", max(damping, dt), lammps, 10 * MOST_STEPS)
        if (parts := damping / (every * dt)) < FEWEST_PARTS:
            longer = f"a PDAMP of at least {FEWEST_PARTS * dt:g}"
            yield (
                f"WARNING: the box changes {parts:.3g} times in PDAMP: with fewer than "
                f"{FEWEST_PARTS} volumes fluctuate too much, and with barostat mtk a run may "
                f"break. Give {longer if every == 1 else 'keyword every a smaller number'}"
            )

    def failure(self, found: int, run: Run) -> str:
        if found != OUT_OF_BOUNDS:
            return ""
        every = self.box_every
        rare = (
            f"give keyword every 1 (the box changes in one of {every} steps now), and a longer "
            "PDAMP as well if that is not enough"
        )
        return instability(
            run,
            f"an axis of the box would change by more than a factor of {MOST:g} at once, or a "
            "tilt by more than an edge,",
            "the pressure is far from the one asked for, or PDAMP is too short. "
            "Bring the system near this pressure at constant volume first, or "
            f"{'give a longer PDAMP' if every == 1 else rare}",
        )

    def _refuse(self, run: Run) -> None:
        """Raise an error for a system whose box this fix cannot change; collective."""
        run.host.need("box")
        for sibling in run.conditions.siblings:
            raise RunError(
                f'fix {sibling.host.fix_id} ("{sibling.command.text}") has bodies, too, which '
                "would not follow the box that this fix changes: have one fix move all bodies, or "
                "move the other atoms with one of LAMMPS's fixes",
                everywhere=True,
            )
        outside = run.ranks.count(len(run.lammps.groups) - len(run.bodies.index))
        left_out = run.membership.left_out
        note = f"; {left_out} of them have the molecule-ID of a body, see the warning above"
        refuse(
            outside and not self.command.dilate,
            f"{outside} atoms are in no body{note * bool(left_out)}: give their group to keyword "
            "flexible, so that this fix moves them, too, or say by keyword dilate which of them "
            "the box takes along",
        )
        self.has_others = outside > 0
        self._look_at_constraints(run)
        self._look_at_forces(run)
        self._refuse_axes(run.lammps, run.host.scalar_pressure)

    def _refuse_axes(self, lammps: Lammps, scalar_pressure: bool) -> None:
        """Raise an error for axes and tilts that cannot change.

        Args:
            scalar_pressure: see `hosts.Host`.
        """
        flat = {"z", "xz", "yz"} & {*self.command.pressure, self.command.couple}
        refuse(
            lammps.dimension == 2 and flat,
            f"in two dimensions the box has no length along z: leave out {min(flat, default='')}",
        )
        refuse(self.command.force or self.command.torque, WITH_SWITCHES)
        refuse(
            self.flips and not lammps.setting("triclinic"),
            "keywords tri, xy, xz, yz are for a triclinic box, and this one is orthogonal: use "
            "aniso, or make it triclinic (change_box all triclinic) before the fix line",
        )
        refuse(
            scalar_pressure and self.axes.tolist() != [0, 0, 0, -1, -1, -1],
            "kspace_style msm gives the mean pressure of all axes only, and this box has more "
            "than one to follow: use iso, or kspace_modify pressure/scalar no",
        )
        for part, group in zip(PARTS_OF_BOX, self.axes, strict=True):
            fixed = [axis for axis in part if not lammps.box.periodic[AXES.index(axis)]]
            if group >= 0 and fixed:
                raise RunError(
                    f"there is no pressure along {fixed[0]}, which is not periodic: name other "
                    "axes" + (f", and no tilt {part}" if len(part) > 1 else ""),
                    everywhere=True,
                )

    def _look_at_constraints(self, run: Run) -> None:
        """Find whether fixes constrain atoms that are remapped with the box; collective.

        Raises:
            RunError: for a fix that sets the positions of such atoms.
        """
        placing = *_CLUSTERS, *_PLACES
        deciding = [
            fix
            for fix in run.conditions.other_fixes
            if (fix.constrains or fix.style.startswith(placing))
            and self._hits(fix, run, moving=True)
        ]
        for fix in deciding:
            constrains = fix.style.startswith("ilves")
            instead = "use fix shake" if constrains else "have this fix move their bodies, too"
            refuse(
                not fix.style.startswith(_CLUSTERS),
                f"fix {fix.id} (style {fix.style}) says where atoms are that keyword dilate "
                f"moves with the box, and does not follow it: {instead}, or leave them out of the "
                "group of keyword dilate",
            )
        run.host.held = int(self._dilated(run.lammps)) if deciding else 0

    def _look_at_forces(self, run: Run) -> None:
        """Find whether fixes apply forces that LAMMPS's virial does not include to atoms whose
        contribution is subtracted from it; collective.

        Raises:
            RunError: if other fixes apply forces to these atoms that it does include.
        """
        changing = [
            fix
            for fix in run.conditions.other_fixes
            if fix.post_force and not fix.style.startswith((*READERS, *_CLUSTERS))
        ]
        noisy = any(f.style.startswith(_NOISE) and run.acts_on_bodies(f) for f in changing)
        self._noise_on_bodies = noisy
        looked_at = [
            fix
            for fix in changing
            if (run.host.held and self._hits(fix, run, moving=True))
            or self._hits(fix, run, moving=False)
            or (noisy and run.acts_on_bodies(fix))
        ]
        counted = [fix.id for fix in looked_at if fix.virial_in_press]
        others = [fix.id for fix in looked_at if not fix.virial_in_press]
        if counted and others:
            raise RunError(
                f"fixes {counted[0]} and {others[0]} both change forces on atoms that are in "
                "bodies, that shake constrains or that do not move with the box, and the virial "
                "counts those of the first one only. Leave one of them out, or, if the second one "
                "is a thermostat, take one that changes velocities: fix nosquish/npt for bodies, "
                "fix nvt or temp/csvr for other atoms",
                everywhere=True,
            )
        run.host.counts = bool(others)

    def _dilated(self, lammps: Lammps) -> np.int32:
        """The bit of keyword dilate's group, as a C int."""
        return np.array([lammps.group_bit(self.command.dilate or "")], np.uint32).view(np.int32)[0]

    def _hits(self, fix: OtherFix, run: Run, moving: bool) -> bool:
        """Whether a fix acts on atoms in no body that are remapped (`moving`) or are not;
        collective."""
        if not self.has_others:
            return False
        groups = run.lammps.groups
        atoms = (groups & (int(self._dilated(run.lammps)) & 0xFFFFFFFF) != 0) == moving
        atoms[run.bodies.index] = False
        return run.ranks.any(fix.has(groups[atoms]).any())

    def extra_lists(self, run: Run, cells: dict[str, Cell]) -> dict[str, list]:
        host, moving = run.host, []
        of_bodies = cell.virial_about_centres.bind_to(_counted(cells, self._noise_on_bodies))
        lists = {"pressure": [of_bodies]}
        if self.has_others:
            cells = cells | {"dilated": Cell(I, self._dilated(run.lammps))}
            if host.held:
                finder = {"cluster_finder": host.find_clusters}
                lists["pressure"].append(free_atoms.find_clusters.bind_to(cells, **finder))
            virial = free_atoms.virial_of_free_atoms.bind_to(_counted(cells, host.counts > 0))
            lists["pressure"].append(virial)
            moving.append(free_atoms.move_free_atoms.bind_to(cells))
        lists["pressure"].append(self.forces_known.bind_to(cells))
        if self.flips:
            lists["flip"] = [flip.bind_to(cells)]
        return lists | self.box_lists(cells, moving)

    def box_lists(self, cells: dict[str, Cell], moving: list) -> dict[str, list]:
        """The lists that change the box.

        Args:
            moving: loops that remap atoms in no body, after the box has changed.
        """
        raise NotImplementedError

    def damping(self, lammps: Lammps) -> float:
        """PDAMP, the shortest of all axes."""
        damping = min(lammps.number(words[2]) for words in self.command.pressure.values())
        self.command.refuse_unless_positive("PDAMP", damping)
        return damping

    def new_parameters(self, run: Run) -> np.record:
        """The parameters of the barostat at the start of a run; collective."""
        lammps, parameters = run.lammps, self.numbers(axes=self.axes)
        of_group: dict[int, tuple[float, ...]] = {}
        self.dampings = np.full(len(self.axes), self.damping(lammps))
        for k, (part, group) in enumerate(zip(PARTS_OF_BOX, self.axes, strict=True)):
            if group >= 0:
                words = self.command.pressure_of(part)
                start, stop, damping = given = tuple(lammps.number(word) for word in words or ())
                if of_group.setdefault(group, given) != given:
                    theirs, others = ("{:g} {:g} {:g}".format(*x) for x in (given, of_group[group]))
                    raise self.command.wrong(
                        f"keyword couple {self.command.couple}: {part} has PSTART, PSTOP and PDAMP "
                        f"{theirs}, and an axis coupled to it {others}: give both the same"
                    )
                self.dampings[group] = damping
                parameters.p_start[k] = start / lammps.nktv2p
                parameters.p_stop[k] = stop / lammps.nktv2p
        parameters.unit, parameters.box_every = lammps.mvv2e, self.box_every
        parameters.dimension, parameters.tilted = lammps.dimension, self.flips
        # stretching an axis stretches tilts along it, and reduces tilts of which it is the second
        for k, axis in enumerate(AXES):
            along, across = (sum(tilt[n] == axis for tilt in self.changing_tilts) for n in (0, 1))
            parameters.weight[k] = 1.0 + along - across
        return parameters

    def extra_cells(self, run: Run) -> dict[str, Cell]:
        self.parameters, host = self.new_parameters(run), run.host
        return {
            "barostat": Cell(self.numbers, self.parameters),
            "forces_virial": Cell(F1, host.forces_virial),
            "new_box": Cell(F1, np.zeros(12)),
            "set_box": Cell(L1, host.set_box),
            "flip_box": Cell(L1, host.flip_box),
        }


def _counted(cells: dict[str, Cell], counts: bool) -> dict[str, Cell]:
    """Cells with the forces that LAMMPS's virial includes, or with all forces."""
    return cells | {"atom_f": cells["counted_f" if counts else "atom_f"]}
