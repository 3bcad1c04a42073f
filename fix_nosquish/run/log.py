"""The lines of the log on the bodies, as a run begins: what they are, what is done, warnings."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..bodies.bodies import StartDiagnosis
from ..bodies.build import BuildReport, least_moment
from ..bodies.membership import Membership
from ..errors import RunError
from ..host.command import Command, Moments
from ..host.hosts import Host
from ..host.lammps import Lammps
from ..version import VERSION
from .integrator import Integrator
from .rotation import Rotation
from .thermo import Thermo, freedom
from .velocities import is_projected

APART = "relax the bodies with minimize while this fix is defined, or move them apart"
ALL = 1  # the bit of LAMMPS's group all
OF_WORLDS = "  random numbers: each world of the partition has its own, whatever the seed"
_TIMES = {"real": ("fs", 1.0), "metal": ("ps", 1000.0)}  # units of time, and femtoseconds in them
_SHORTEST, _LONGEST = 0.005, 200.0  # time steps in fs that somebody may want
_FAST = 1.0  # radians in a time step that call for a warning
# of the distance between atoms: unless these overlap, no force moves a body further in a step
_PUSHED = 0.1


@dataclass(frozen=True)
class BodyFacts:
    """Facts about the bodies on all ranks, as a run begins.

    Attributes:
        solid, flat, linear, single: how many bodies there are of each kind; in two dimensions the
            first two are those that rotate.  atoms: how many atoms they have.
        flexible: how many atoms are flexible.
        planar: whether they are in two dimensions.
        removed, left: degrees of freedom that rigidity takes from the atoms, and that bodies have.
        temperature: of the bodies' velocities.
        report: what `build` says of the bodies.
    """

    bodies: int
    solid: int
    flat: int
    linear: int
    single: int
    atoms: int
    flexible: int
    planar: bool
    removed: int
    left: int
    temperature: float
    report: BuildReport


def facts_of(thermo: Thermo, report: BuildReport) -> BodyFacts:
    """Gather the `BodyFacts`; collective."""
    bodies, lammps, ranks = thermo
    owned, listed, flat = bodies.sharers.owned, bodies.listed, bodies.flat
    rotors, turning = bodies.rotors, bodies.turning
    counts = {
        "bodies": listed.sum(),
        "solid": (listed[:rotors] & ~flat).sum(),
        "flat": (listed[:rotors] & flat).sum(),
        "linear": listed[rotors:turning].sum(),
        "single": listed[turning : len(bodies)].sum(),
        "atoms": bodies.natoms[listed].sum(),
        "flexible": (owned & ~listed).sum(),
        "left": freedom(bodies, lammps.dimension)[owned].sum(),
    }
    totals = ranks.total(np.array([*counts.values()], float)).astype(int).tolist()
    facts = dict(zip(counts, totals, strict=True))
    # as compute temp of these atoms counts their degrees of freedom
    degrees = facts["left"] - lammps.dimension
    energy = 2 * (report.kinetic - report.removed)
    return BodyFacts(
        **facts,
        planar=bodies.planar,
        removed=thermo.removed_freedom(ALL),
        temperature=energy / (degrees * lammps.boltz) if degrees > 0 else 0.0,
        report=report,
    )


def summary(
    facts: BodyFacts, method: str, command: Command, freedom_note: str, more: Sequence[str]
) -> list[str]:
    """The lines on the bodies: four that are always there, and more.

    Args:
        method: of the integrator.  freedom_note: what its thermostat adds on degrees of freedom.
        more: lines on what this run has.
    """
    flexible = f"; {facts.flexible} flexible atoms, of group {command.flexible}"
    lines = [
        f"Rigid bodies by {method}, fix_nosquish {VERSION}: {command.text}",
        f"  {facts.bodies} rigid bodies with {facts.atoms} atoms: {_kinds(facts)}"
        f"{flexible if command.flexible else ''}",
        f"  {facts.removed} degrees of freedom removed, {facts.left} left to the bodies"
        f"{freedom_note}",
        f"  start velocities: {_start(facts)}",
        *more,
    ]
    if facts.report.rebuilt:
        lines.append(
            f"  {facts.report.rebuilt} bodies were cut by a periodic face and put together by the "
            "nearest image"
        )
    return lines


def _kinds(facts: BodyFacts) -> str:
    """How many bodies there are of each kind."""
    if facts.planar:
        kinds = {"in the plane": facts.solid + facts.flat}
    else:
        kinds = {"three-dimensional": facts.solid, "planar": facts.flat, "linear": facts.linear}
    kinds["single atoms"] = facts.single
    return ", ".join(f"{number} {kind}" for kind, number in kinds.items() if number) or "none yet"


def _start(facts: BodyFacts) -> str:
    """What was taken from the atoms' velocities, so that they are rigid motion.

    The temperature of the atoms before is not known: another fix may have held them, with an
    unknown number of degrees of freedom.
    """
    removed, kinetic, now = facts.report.removed, facts.report.kinetic, facts.temperature
    if not is_projected(removed, kinetic):
        return f"rigid motion, temperature {now:.8g} of the bodies"
    return (
        f"{removed:.8g} of the kinetic energy {kinetic:.8g} was not rigid motion "
        f"and was removed; temperature {now:.8g} of the bodies"
    )


def of_words(command: Command, lammps: Lammps) -> list[str]:
    """Lines on what words of the fix line mean."""
    lines = []
    if command.seed is not None and lammps.setting("universe_size") > lammps.ranks:
        lines.append(OF_WORLDS)
    if command.moments:
        lines.append(_moments_line(command.moments, command, lammps))
    return lines


def _moments_line(moments: Moments, command: Command, lammps: Lammps) -> str:
    """A line on keyword moments."""
    how, word = moments
    if how == "step":
        least = least_moment(lammps, command)
        chosen = f"at least {least:.4g}, for a step of {lammps.innermost_dt:g}"
    else:
        what = {"equal": "instead of the atoms' own", "scale": "times those of the atoms' own"}
        chosen = f"{lammps.number(word):g} {what[how]}"
    return (
        f"  principal moments: {chosen}. Averages over configurations and velocities do not "
        "change, but the dynamics do"
    )


class FixLog:
    """The lines that a fix has written to the log, so that none is repeated.

    Args:
        host: its host.  command: its fix line.
        integrator: declares its step.  rotation: how its bodies rotate.
        membership: which atom is in which body.
    """

    def __init__(
        self,
        host: Host,
        command: Command,
        integrator: Integrator,
        rotation: Rotation,
        membership: Membership,
    ) -> None:
        self._host, self._command, self._integrator = host, command, integrator
        self._rotation, self._membership = rotation, membership
        self._summary: list[str] = []
        self._warnings: set[str] = set()

    def report(
        self,
        thermo: Thermo,
        report: BuildReport,
        mask: np.ndarray | None,
        lines: Sequence[str] = (),
        warnings: Iterable[str] = (),
    ) -> None:
        """Log what the bodies are, if that has changed, and warnings; collective.

        Args:
            thermo: of the bodies.  report: on how they were made.
            mask: which components of force and torque act; see `switches.mask`.
            lines, warnings: more lines on this run, and warnings.
        """
        command, integrator = self._command, self._integrator
        facts = facts_of(thermo, report)
        lines = [*of_words(command, thermo.lammps), *lines]
        warmed = bool(integrator.thermostat or command.steps)
        warnings = [
            *of_start(report, warmed, (self._host.group, command.group)),
            *of_changes(self._membership.changes()),
            *report.warnings,
            *warnings,
            *of_motion(thermo, mask, self._membership.name),
            *of_time_step(thermo.lammps),
        ]
        note = getattr(integrator.thermostat, "freedom_note", "")
        method, turning = integrator.method, facts.solid + facts.flat
        if turning and self._rotation.exact:
            method += ", exact rotation"
        before, lines = self._summary, summary(facts, method, command, note, lines)
        self._summary = lines[:4]
        if before[:3] != lines[:3]:
            self._host.log("\n".join([*lines, *self._host.advice(facts.removed), ""]))
        elif before[3] != lines[3] and is_projected(report.removed, report.kinetic):
            self._host.log(lines[3] + "\n")
        self.warn(warnings)

    def warn(self, lines: Sequence[str]) -> None:
        """Log these lines, each of them once."""
        new = [line for line in lines if line not in self._warnings]
        self._warnings.update(new)
        if new:
            self._host.log(self._command.line.naming("\n".join([*new, ""])))


# ----------------------------------------------------------------- warnings


def of_left_out(number: int, group: str) -> list[str]:
    """A line on atoms of bodies' molecules that are not in the fix's group; none if there are
    none."""
    return [
        f"WARNING: {number} atoms have the molecule-ID of a body, but are not in group {group}, so "
        "they are not part of the body, and do not move unless another fix moves them. If they "
        "should be part of it, give the fix a group of whole molecules"
    ] * bool(number)


def of_start(report: BuildReport, warmed: bool, groups: tuple[str | None, str]) -> Iterator[str]:
    """Lines on how bodies were made.

    Args:
        warmed: whether a thermostat gives the bodies their temperature.
        groups: of the fix, None if it is not known, and of its words.
    """
    of_fix, group = groups
    if of_fix not in (None, group):
        yield (
            f"WARNING: the fix line names group {of_fix}, the class group {group}: "
            f"the bodies are of {group}, so give the fix the same group"
        )
    if report.stray > 1:
        yield (
            f"WARNING: the {report.stray} atoms with molecule-ID 0 are one rigid body: "
            "give every body a molecule-ID of its own, or leave these atoms out of the group"
        )
    if report.still and is_projected(report.removed, report.kinetic) and not warmed:
        yield (
            "WARNING: the bodies have atoms of finite size without spin, because velocity create "
            "and velocity scale do not set spins. So the bodies' rotation starts colder than "
            "their translation; a thermostat heats it"
        )


def of_changes(changes: str) -> Iterator[str]:
    """A line on atoms that have changed since the fix was defined."""
    if changes:
        yield (
            f"WARNING: atoms have changed since this fix was defined ({changes}). The bodies stay "
            "those of its definition, as with LAMMPS's rigid fixes. To decide them anew, unfix "
            "this fix and define it again"
        )


def of_motion(thermo: Thermo, mask: np.ndarray | None, name: Callable[[int], str]) -> Iterator[str]:
    """Lines on bodies that turn too fast, or are as wide as the periodic box; collective.

    Args:
        mask: which components of force and torque act; see `switches.mask`.
        name: gives the name of a body of an ID.
    """
    bodies, lammps, _ = thermo
    turns = lammps.innermost_dt * np.linalg.norm(bodies.angular_velocity(), axis=0)
    turn, body = _largest(turns, thermo)
    if turn > _FAST:
        yield (
            f"WARNING: {name(body)} turns by {turn:.2g} rad in a step, "
            "which this time step cannot resolve. Was there a minimize before this fix was "
            "defined? It deforms bodies: call it after this line. Otherwise use a time step of "
            f"about {0.2 * lammps.dt / turn:.2g}, or a better start. A body that is almost linear "
            "can be made linear"
        )
    distance = np.linalg.norm(bodies.displace[:3], axis=0)
    width = 2 * np.maximum(bodies.sharers.highest(bodies.body, distance)[0], 0.0)
    if mask is not None:
        width = width * mask[3:].any(axis=0)
    widest, body = _largest(width, thermo)
    heights = 1 / np.linalg.norm(lammps.box.inverse, axis=1)
    heights = heights[: lammps.dimension][lammps.box.periodic[: lammps.dimension]]
    if widest > min(heights, default=np.inf):
        yield (
            f"WARNING: {name(body)} is {widest:.4g} wide, and the periodic "
            f"box {min(heights):.4g}: where it turns it meets its own images. Use a larger box, or "
            "keyword torque for a body that does not turn"
        )


def of_time_step(lammps: Lammps) -> Iterator[str]:
    """A line on a time step that is in another unit than LAMMPS's."""
    unit, femtoseconds = _TIMES.get(lammps.units, ("", 1.0))
    step = abs(lammps.innermost_dt) * femtoseconds
    if unit and step > 0 and not _SHORTEST <= step <= _LONGEST:
        yield (
            f"WARNING: the time step is {step:.4g} fs: with units {lammps.units}, timestep is in "
            f"{unit}"
        )


def forces_at_start(thermo: Thermo, name: Callable[[int], str]) -> StartDiagnosis:
    """What the forces of the start tell of atoms that overlap, and the distance between atoms, or
    the size of the largest body if that is larger; collective.

    Args:
        name: gives the name of a body of an ID.
    """
    bodies, lammps, ranks = thermo
    owned, dimension = bodies.sharers.owned, lammps.dimension
    force = np.linalg.norm(bodies.acting_wrench[:3], axis=0)
    push = 0.5 * lammps.innermost_dt**2 * lammps.ftm2v * force / bodies.mass
    pushed, furthest = _largest(push, thermo)
    size, _ = _largest(np.sqrt(bodies.moments_of_atoms.max(axis=0) / bodies.mass), thermo)
    atoms = max(1, ranks.count(len(lammps.groups)))
    space = np.linalg.det(lammps.box.h[:dimension, :dimension]) / atoms
    start = StartDiagnosis(lammps.step, spacing=max(space ** (1 / dimension), size))
    above = push[owned] > _PUSHED * start.spacing
    many, of = ranks.total(np.array([above.sum(), owned.sum()]))
    if not many:
        return start
    # forces on few bodies that are much too high suggest the start, on many the time step
    order = slice(None, None, 1 if many <= 0.1 * of else -1)
    causes = ", or ".join(("atoms overlap at the start", "the time step is too long")[order])
    advice = ", or ".join((APART, "use a shorter time step")[order])
    moved = f"the force on {name(furthest)} moves it by {pushed:.3g} in the first step"
    return start._replace(diagnosis=f"{causes}: {moved}", advice=advice)


def of_infinite_forces(
    thermo: Thermo, name: Callable[[int], str], at_start: bool, step: int
) -> RunError:
    """The error for forces of a step that are not finite.

    Args:
        name: gives the name of a body of an ID.  at_start: whether these are the first forces.
    """
    bodies, lammps, _ = thermo
    bad = (~np.isfinite(bodies.wrench).all(axis=0)).argmax()
    cause, remedy = bodies.instability(bad, lammps)
    if at_start:
        cause, remedy = "atoms overlap at the start", APART
    advice = "use a shorter time step or a better start, and look for what else acts on the body"
    return RunError(
        f"{cause or 'the run is unstable'}, and the force on {name(bodies.id[bad])} is not finite "
        f"at step {step}: {remedy or advice}"
    )


def _largest(values: np.ndarray, thermo: Thermo) -> tuple[float, int]:
    """The largest of the bodies' values, (n,), on all ranks, and whose it is; collective."""
    k = [values.argmax()] if len(values) else []
    largest, ids = thermo.ranks.gather_to_all(np.array([values[k], thermo.bodies.id[k]]).T).T
    return max(zip(largest, ids.astype(int)), default=(0.0, 0))
