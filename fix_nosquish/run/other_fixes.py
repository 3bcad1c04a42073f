"""The other fixes of a run: what they read and change, and which ones cannot be used with ours."""

from collections.abc import Collection, Iterable, Sequence
from math import gcd
from typing import NamedTuple

from ..bodies.membership import Membership
from ..errors import refuse
from ..host.command import Command
from ..host.hosts import Host, OtherFix
from ..host.lammps import Lammps
from .other_boxes import REPORTING, why_not

TEMPER = "command temper"  # which changes velocities, as some fixes do

# fixes that compute forces in the place of styles, and change nothing else
_PACKAGES = "GPU", "OMP", "INTEL", "nosquish/pairs"
# fixes that read no velocities but those of their own atoms; and these between the halves of a
# step, if they do not vary; fixes of dynamic groups, which act there without a hook; pair styles
# that read velocities, besides those for which ghost atoms have some
_BLIND = "nve", "rigid", "shake", "rattle", "ilves", "brownian", "recenter", "tmd"
_BLIND_BETWEEN = (*_BLIND, "balance", "deform")
_OF_GROUP = "GROUP"
_READING_PAIRS = "hybrid/scaled", "dsmc", "smd/"
# fixes that keep a temperature
_THERMOSTATS = "langevin", "temp/", "gle", "gld", "ttm", "nvt", "npt", "bocs", "qtb"
# fixes that act at the end of a step and change no velocity; and those that do not even read one,
# if they do not vary
READERS = "ave/", "print", "vector", "store/", "STORE/", "halt"
_IDLE = "deform", "colvars"
_UNCHANGING = *READERS, *REPORTING, "dt/reset"
_DRAWING = "temp/csld"  # a thermostat that draws a velocity for each atom, and counts it as heat
# fixes that exchange velocities of two atoms, and others that move atoms besides their integrator;
# and what to use instead of each
_SWAPPING = {
    "thermal/conductivity": "use two fixes heat, with a region for each",
    "viscosity": "use fix accelerate/cos, or fix deform with remap v and fix nosquish/nve",
}
_MOVING = {
    "ehex": "use fix heat, which changes velocities only",
    "recenter": "use fix momentum with linear 1 1 1, which keeps them from drifting away, or take "
    "the centre of mass off what you write",
    "wall/": "use a wall with a force, such as fix wall/harmonic",
    "drude/transform": "use fix langevin/drude without it",
}
# those of which it is known that they leave the atoms where they are; any other may not
_STAYING = "bond/", "ti/spring", "lb/fluid", "alchemy", "reaxff/"
# those that move atoms at the end of a step, by a correction of third order
_LATE_MOVING = "ehex"
# fixes that change velocities at the end of a step, and surely no places; those that run the user's
# code, and one whose own words can name another group of atoms to be moved
_VELOCITIES = "momentum", "langevin", "temp/", "heat", "thermal/", "viscosity"
_USERS = "python/", "external"
_SHIFTING = "recenter"
# fixes without an energy that change nothing of the bodies
_HARMLESS = (*READERS, "property/", "balance", "enforce2d")
# besides these, the fixes that are known to leave the total momentum as it is; any other may not
_CONSERVING = (
    *("acks2/", "adapt", "addtorque", "amoeba/", "bond/", "box/relax", "cmap", "controller"),
    *("deform", "drude", "dt/reset", "ehex", "heat", "momentum", "nonaffine/", "numdiff", "pair"),
    *("phonon", "qeq/", "qtpie/", "rattle", "reaxff/", "restrain", "rigid", "saed/", "shake"),
    *("ilves", "spring/rg", "tmd", "tune/", "widom"),
)
# pair styles that do not: friction and noise of each atom by itself; those whose noise is of pairs,
# without newton's third law between two that are computed twice
_NOT_CONSERVING, _NOT_WITHOUT_NEWTON = ("brownian", "lubricate"), ("dpd", "edpd", "mdpd", "tdpd")


class Swaps(NamedTuple):
    """Command temper, as one of the fixes that change velocities at the end of a step."""

    id: str
    style: str
    nevery: int


def _swaps(command: Sequence[str], step: int) -> list[Swaps]:
    """The `Swaps` of these words, temper N M ..., from this step on; an empty list for others."""
    if not command or not command[0].startswith("temper"):
        return []
    return [Swaps(TEMPER, "temper", gcd(int(command[2]), step))]


class OtherFixes(list[OtherFix]):
    """The fixes of a run that are not of this package.

    Args:
        fixes: all fixes, of this package too; None if they are not known.
        ours: IDs of this package's.
        command: the words of LAMMPS's last command.
        step: the step at which the run begins.
        siblings_read: whether fixes of this package read atoms' velocities in each step.

    Attributes:
        packages: styles of fixes that are left out, by which accelerator packages compute forces.
        unknown: whether it is not known which fixes there are.
        change_forces: whether forces may change after those that LAMMPS computes.
        late: those that act at the end of a step, and so may change velocities.
        half_step: whether something may read the atoms' velocities between the halves of a step.
        velocities_every: every how many steps something may read them at its end.
        changing_box: those that change the box.
        movers: those that may move atoms besides their integrator.
    """

    def __init__(
        self,
        fixes: Iterable[OtherFix] | None,
        ours: Collection[str | None] = (),
        command: Sequence[str] = (),
        step: int = 0,
        siblings_read: bool = False,
    ) -> None:
        unknown = self.unknown = fixes is None
        known = [fix for fix in fixes or () if fix.id not in ours]
        super().__init__(fix for fix in known if fix.style not in _PACKAGES)
        self.packages = {fix.style for fix in known if fix.style in _PACKAGES}
        self.change_forces = unknown or any(fix.post_force for fix in self)
        ending: list[OtherFix | Swaps] = [
            *(fix for fix in self if fix.end_of_step and (fix.varies or fix.style not in _IDLE)),
            *_swaps(command, step),
        ]
        self.late = [fix for fix in ending if not fix.style.startswith(_UNCHANGING)]
        between = [fix for fix in self if fix.between or fix.style == _OF_GROUP]
        blind = [fix.style.startswith(_BLIND_BETWEEN) and not fix.varies for fix in between]
        self.half_step = unknown or not all(blind)
        reading = any(fix.integrates and not fix.style.startswith(_BLIND) for fix in self)
        each = unknown or reading or siblings_read
        self.velocities_every = (1,) if each else tuple({fix.nevery for fix in ending})
        self.changing_box = [fix for fix in self if fix.box_change]
        moving = [fix for fix in self if fix.moves or fix.style.startswith(_LATE_MOVING)]
        self.movers = [fix for fix in moving if not _stays(fix)]

    def possible_movers(self) -> list[OtherFix]:
        """Those that may have moved atoms that something has moved: also at the end of a step, or
        with the box."""
        late = {fix.id for fix in self.late if may_move(fix)}
        return [
            fix
            for fix in self
            if fix in self.movers
            or fix.box_change
            or fix.id in late
            or fix.style.startswith(_USERS)
        ]

    def pushing(self) -> list[OtherFix]:
        """Those that may change the total momentum of what they act on."""
        return [
            fix
            for fix in self
            if fix.called and not fix.style.startswith(_CONSERVING) and not _is_harmless(fix)
        ]

    def without_energy(self) -> tuple[OtherFix, str] | None:
        """The first one that may change positions, momenta or forces with no energy in LAMMPS's
        potential energy, and a remedy; None if there is no such fix."""
        for fix in self:
            moves = fix.time_integrate or fix.constrains
            known = fix.energy_in_pe and not moves
            if fix.called and not _is_harmless(fix) and (not known or fix.box_change):
                potential = fix.has_energy and not moves
                return fix, f"fix_modify {fix.id} energy yes" if potential else "unfix it"
        return None


def reading_pair_style(host: Host) -> bool:
    """Whether a pair style in use may read the atoms' velocities."""
    return host.ghost_velocity or any(map(host.pair_style, _READING_PAIRS))


def pushing_pair_style(host: Host, newton: bool) -> str | None:
    """The first words of a pair style in use that changes the total momentum, or None.

    Args:
        newton: whether LAMMPS computes each pair of atoms once (newton on, for pairs).
    """
    styles = _NOT_CONSERVING if newton else (*_NOT_CONSERVING, *_NOT_WITHOUT_NEWTON)
    return next(filter(host.pair_style, styles), None)


def may_move(fix: OtherFix | Swaps) -> bool:
    """Whether a fix that acts at the end of a step may move atoms there."""
    return not fix.style.startswith((*_VELOCITIES, "temper"))


def _is_harmless(fix: OtherFix) -> bool:
    return fix.style.startswith(_HARMLESS) or fix.style[0].isupper()


def _stays(fix: OtherFix) -> bool:
    return fix.constrains or fix.style.startswith(_STAYING) or _is_harmless(fix)


def _first(table: dict[str, str], style: str) -> str | None:
    """What a dictionary has for the beginning of a style's name, None for nothing."""
    return next((value for begin, value in table.items() if style.startswith(begin)), None)


class Ours(NamedTuple):
    """This fix, as messages about other fixes need it.

    Attributes:
        fix_id: its ID.  command: its `Command`.
        has_barostat: whether it changes the box.  thermostats: whether it keeps a temperature.
    """

    fix_id: str | None
    command: Command
    has_barostat: bool
    thermostats: bool


def refuse_other_integrators(
    fixes: OtherFixes, ours: Ours, membership: Membership, host: Host
) -> None:
    """End the run if another fix moves, constrains or thermostats atoms of the bodies; collective.

    Raises:
        RunError: on all ranks.
    """
    lammps, problem = membership.lammps, None
    groups, atoms = lammps.groups, membership.atoms()
    for fix in fixes:
        acts = fix.has(groups)
        if fix.style.startswith(_SHIFTING):
            acts = host.moved_by(fix.id, lammps.x)
        both = atoms[acts[atoms]]
        tag = lammps.tags[both[0]] if len(both) else None
        of_box = why_not(fix, ours.command, ours.has_barostat)
        problem = of_box or _of_atom(fix, tag, ours, fix in fixes.movers) or problem
    membership.communicator.agree(problem)


def _of_atom(fix: OtherFix, tag: int | None, ours: Ours, moves: bool) -> str | None:
    """Why a fix cannot act on an atom of the bodies, or None.

    Args:
        tag: ID of the first atom on this rank that both fixes have; None if there is none.
        moves: whether it is one of `OtherFixes.movers`.
    """
    if tag is None:
        return None
    other, text = f"fix {fix.id} (style {fix.style})", ours.command.text
    this, without = f'fix {ours.fix_id} ("{text}")', "a group without the bodies' atoms"
    if swaps := _first(_SWAPPING, fix.style):
        return (
            f"{other} exchanges the velocity of atom {tag} of the rigid bodies with "
            "that of another one: this is no rigid motion, so energy would be lost, and f_"
            f"{fix.id} would count more than was carried: {swaps}"
        )
    if fix.style == _DRAWING:
        return (
            f"{other} gives each atom of the rigid bodies a velocity of its own, most of which is "
            "no rigid motion, but counts as heat: the bodies would be too cold. Use a thermostat "
            "of this package (fix nosquish/nvt, nosquish/npt), fix langevin, or one that scales "
            "velocities, such as temp/csvr"
        )
    if moves:
        return (
            f"{other} moves atom {tag} of the rigid bodies besides {this}, which keeps its "
            f"own places: {_first(_MOVING, fix.style) or f'give that fix {without}'}"
        )
    if fix.time_integrate:
        return (
            f'atom {tag} of the rigid bodies ("{text}") is also integrated by fix '
            f"{fix.id} (style {fix.style}): give that fix {without}"
        )
    if ours.thermostats and fix.style.startswith(_THERMOSTATS):
        return (
            f"{other} keeps a temperature of atom {tag} of the rigid bodies, as {this} does: "
            f"give it {without}, or use fix nosquish/{'nph' if ours.has_barostat else 'nve'}"
        )
    return None


def refuse_constraints(fixes: OtherFixes, ours: Ours, host: Host) -> None:
    """End the run if another fix constrains atoms of the bodies or of keyword flexible; collective.

    Fix ilves finds its constraints after the fixes' init, fix shake in its command.

    Raises:
        RunError: on all ranks.
    """
    command = ours.command
    groups = [[command.group], *([command.arguments] if command.style == "group" else [])]
    for fix in fixes:
        other = f"fix {fix.id} (style {fix.style})"
        refuse(
            command.flexible and host.removed_freedom(fix.id, command.flexible),
            f"{other} constrains atoms of group '{command.flexible}', which "
            "keyword flexible moves without constraints: unfix it, or leave them out of the group",
        )
        refuse(
            all(any(host.removed_freedom(fix.id, group) for group in some) for some in groups),
            f"{other} constrains atoms of the rigid bodies, which fix {ours.fix_id} "
            f'("{command.text}") holds rigid: unfix it, or give it a group without the bodies\' '
            "atoms",
        )


def acts_on_bodies(fix: OtherFix, membership: Membership) -> bool:
    """Whether atoms of the bodies are in another fix's group; collective."""
    lammps: Lammps = membership.lammps
    return membership.communicator.any(fix.has(lammps.groups[membership.atoms()]).any())
