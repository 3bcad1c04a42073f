"""What the log says of the bodies as a run begins: what they are, what is done, what is odd."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .. import __version__
from ..bodies.bodies import Bodies, StartDiagnosis
from ..bodies.build import BuildReport, least_moment
from ..host.command import Command, Moments
from ..host.lammps import Lammps
from ..ranks.communicator import Alone
from .thermo import freedom, removed_freedom

if TYPE_CHECKING:
    from .integrator import Integrator

APART = "relax the bodies with minimize while this fix is defined, or move them apart"
ROUNDING = 1e-9  # of the kinetic energy, what projections on rigid motion take of it by rounding
ALL = 1  # the bit of LAMMPS's group all
_TIMES = {"real": ("fs", 1.0), "metal": ("ps", 1000.0)}  # units of time, and femtoseconds in them
_SHORTEST, _LONGEST = 0.005, 200.0  # time steps in fs that somebody may want
_FAST = 1.0  # radians in a time step that call for a warning
# of the distance between atoms: unless these overlap, no force moves a body further in a step
_PUSHED = 0.1


class _Counts(NamedTuple):
    """Numbers of bodies on all ranks; rotors and lines include flexible spheres and ellipsoids."""

    bodies: int
    solid: int
    flat: int
    linear: int
    single: int
    atoms: int
    flexible: int
    rotors: int
    lines: int
    shared: int


def say(integrator: "Integrator", virial: bool) -> None:
    """Log what the bodies are, if that has changed, what was taken from velocities, and what is
    probably not meant; collective. Args: virial: whether LAMMPS asks for it."""
    host, notes = integrator.host, integrator.notes
    lines, removed = _summary(integrator, virial)
    odd = _warnings(integrator)
    said, integrator.said = integrator.said, lines[:4]
    if said[:3] != lines[:3]:
        host.log("\n".join([*lines, *host.advice(removed), ""]))
    elif said[3] != lines[3] and projected(notes.removed, notes.kinetic):
        host.log(lines[3] + "\n")
    warn(integrator, odd)


def warn(integrator: "Integrator", lines: Sequence[str]) -> None:
    """Log these lines, each of them once."""
    new = [line for line in lines if line not in integrator.warned]
    integrator.warned.update(new)
    if new:
        integrator.host.log(integrator.line.naming("\n".join([*new, ""])))


def _summary(integrator: "Integrator", virial: bool) -> tuple[list[str], int]:
    """The lines on the bodies, and the degrees of freedom removed; collective."""
    bodies, command, notes = integrator.bodies, integrator.command, integrator.notes
    communicator, lammps, found = integrator.communicator, integrator.lammps, _counted(integrator)
    removed = removed_freedom(bodies, communicator, lammps, ALL)
    owned = freedom(bodies, lammps.dimension)[bodies.sharers.owned]
    own = communicator.total(np.array([owned.sum()]))[0]
    flexible = f"; {found.flexible} flexible atoms, of group {command.flexible}"
    lines = [
        f"Rigid bodies by {integrator.method}, fix_nosquish {__version__}: {command.text}",
        f"  {found.bodies} rigid bodies with {found.atoms} atoms: {_kinds(bodies, found)}"
        f"{flexible if command.flexible else ''}",
        f"  {removed} degrees of freedom removed, {round(own)} left to the bodies"
        f"{integrator.freedom_said}",
        f"  start velocities: {_start(notes, own, lammps)}",
    ]
    if command.seed is not None and lammps.setting("universe_size") > lammps.ranks:
        lines.append("  random numbers: each world of the partition has its own, whatever the seed")
    lines += integrator.cards.copies(communicator.count(lammps.setting("nmax")))
    if command.moments:
        lines.append(f"  principal moments: {_moments(command.moments, command, lammps)}")
    if notes.rebuilt:
        lines.append(
            f"  {notes.rebuilt} bodies were cut by a periodic face and put together by the "
            "nearest image"
        )
    if command.details:
        lines.append(_work(integrator, found, virial))
    return lines, removed


def _counted(integrator: "Integrator") -> _Counts:
    bodies = integrator.bodies
    owned, listed, flat = bodies.sharers.owned, bodies.listed, bodies.flat
    rotors, turning, shared = bodies.rotors, bodies.turning, bodies.sharers.bodies
    counts = _Counts(
        bodies=listed.sum(),
        solid=(listed[:rotors] & ~flat).sum(),
        flat=(listed[:rotors] & flat).sum(),
        linear=listed[rotors:turning].sum(),
        single=listed[turning : len(bodies)].sum(),
        atoms=bodies.natoms[listed].sum(),
        flexible=(owned & ~listed).sum(),
        rotors=owned[:rotors].sum(),
        lines=owned[rotors:turning].sum(),
        shared=len(shared[owned[shared]]),
    )
    return _Counts(*integrator.communicator.total(np.array(counts, float)).astype(int))


def _kinds(bodies: Bodies, found: _Counts) -> str:
    """How many bodies there are of each kind."""
    if bodies.planar:
        kinds = {"in the plane": found.solid + found.flat}
    else:
        kinds = {"three-dimensional": found.solid, "planar": found.flat, "linear": found.linear}
    kinds["single atoms"] = found.single
    return ", ".join(f"{number} {kind}" for kind, number in kinds.items() if number) or "none yet"


def _start(notes: BuildReport, own: float, lammps: Lammps) -> str:
    """What was taken from the atoms' velocities, so that they are rigid motion.

    There is no temperature of the atoms before: another fix may have held them, with as many
    degrees of freedom as nobody knows.
    """
    degrees = own - lammps.dimension  # as compute temp of these atoms counts them
    left = 2 * (notes.kinetic - notes.removed)
    now = left / (degrees * lammps.boltz) if degrees > 0 else 0.0
    if not projected(notes.removed, notes.kinetic):
        return f"rigid motion, temperature {now:.8g} of the bodies"
    return (
        f"{notes.removed:.8g} of the kinetic energy {notes.kinetic:.8g} was not rigid motion "
        f"and was removed; temperature {now:.8g} of the bodies"
    )


def projected(removed: float, kinetic: float) -> bool:
    """Whether of this kinetic energy more was removed than by rounding, to have rigid motion."""
    return removed > ROUNDING * kinetic


def _work(integrator: "Integrator", found: _Counts, virial: bool) -> str:
    """What the steps of this run do, for keyword details."""
    bodies, command, fixes = integrator.bodies, integrator.command, integrator.other_fixes
    late = " and ".join(f"fix {fix.id}" for fix in fixes.late)
    split = f", mrot {command.mrot}, order {command.order}" if integrator.splits else ""
    how = " in the plane" if bodies.planar else ", exact" if integrator.exact else split
    output = command.output and command.output.steps
    rows = (
        (True, "translation"),
        (found.rotors, f"rotation{how}"),
        (found.lines, "rotation of linear bodies, exact"),
        (bodies.spin, "torque and spin of particles of finite size"),
        (bodies.oriented, "orientation of particles"),
        (integrator.thermostat, "thermostat"),
        (command.steps, f"new momenta and a test every {command.steps} steps"),
        (integrator.box_every, f"change of the box every {integrator.box_every} steps"),
        (integrator.go_on, "second pass over the bodies, after a sum over all ranks"),
        (command.force or command.torque, "components of force and torque switched off"),
        (integrator.external.acts, "external forces and torques"),
        (late, f"velocities that {late} may change at the end of a step"),
        (output, f"table of the bodies every {output} steps"),
        (found.shared, f"messages for {found.shared} bodies shared by ranks"),
        (True, f"velocities of the atoms {_often(fixes.velocities_every)}"),
        (integrator.half_step_velocities, "velocities of the atoms at the half step"),
        (virial, "constraint virial where the pressure is needed"),
    )
    return "\n    ".join(["  in a step:", *(text for needed, text in rows if needed)])


def _often(steps: tuple[int, ...]) -> str:
    """How often the atoms' velocities are set: every so many steps, for each of these numbers."""
    if 1 in steps:
        return "in each step"
    every = f"every {' and '.join(map(str, steps))} steps and " if steps else ""
    return f"{every}with output"


def _moments(moments: Moments, command: Command, lammps: Lammps) -> str:
    """What keyword moments makes of the principal moments."""
    how, word = moments
    if how == "step":
        least = least_moment(lammps, command)
        chosen = f"at least {least:.4g}, for a step of {lammps.innermost_dt:g}"
    else:
        what = {"equal": "instead of the atoms' own", "scale": "times those of the atoms' own"}
        chosen = f"{lammps.number(word):g} {what[how]}"
    return (
        f"{chosen}. Averages over configurations and velocities do not change, but the dynamics do"
    )


def _warnings(integrator: "Integrator") -> list[str]:
    """Lines on what is probably not meant; collective."""
    lines, group, notes = [], integrator.command.group, integrator.notes
    if integrator.host.group not in (None, group):
        lines.append(
            f"WARNING: the fix line names group {integrator.host.group}, the class group {group}: "
            f"the bodies are of {group}, so give the fix the same group"
        )
    if notes.stray > 1:
        lines.append(
            f"WARNING: the {notes.stray} atoms with molecule-ID 0 are one rigid body: "
            "give every body a molecule-ID of its own, or leave these atoms out of the group"
        )
    warmed = integrator.thermostat or integrator.command.steps
    if notes.still and projected(notes.removed, notes.kinetic) and not warmed:
        lines.append(
            "WARNING: the bodies have atoms of finite size without spin, because velocity create "
            "and velocity scale do not set spins. So the bodies' rotation starts colder than "
            "their translation; a thermostat heats it"
        )
    if changes := integrator.membership.changes():
        lines.append(
            f"WARNING: atoms have changed since this fix was defined ({changes}). The bodies stay "
            "those of its definition, as with LAMMPS's rigid fixes. To decide them anew, unfix "
            "this fix and define it again"
        )
    lines += [*notes.warnings, *integrator.own_warnings()]
    bodies, dt = integrator.bodies, integrator.lammps.innermost_dt
    turns = dt * np.linalg.norm(bodies.angular_velocity(), axis=0)
    turn, body = _largest(turns, bodies, integrator.communicator)
    if turn > _FAST:
        lines.append(
            f"WARNING: {integrator.membership.name(body)} turns by {turn:.2g} rad in a step, "
            "which this time step cannot resolve: use one of about "
            f"{0.2 * integrator.dt / turn:.2g}, or a better start. A body that is almost linear "
            "can be made linear"
        )
    return [*lines, *_wide(integrator), *_time_step(integrator.lammps)]


def _wide(integrator: "Integrator") -> Iterator[str]:
    """A line on a body that is as wide as the periodic box; collective."""
    bodies, lammps, mask = integrator.bodies, integrator.lammps, integrator.mask
    distance = np.linalg.norm(bodies.displace[:3], axis=0)
    width = 2 * np.maximum(bodies.sharers.highest(bodies.body, distance)[0], 0.0)
    if mask is not None:
        width = width * mask[3:].any(axis=0)
    widest, body = _largest(width, bodies, integrator.communicator)
    heights = 1 / np.linalg.norm(lammps.box.inverse, axis=1)
    heights = heights[: lammps.dimension][lammps.box.periodic[: lammps.dimension]]
    if widest > min(heights, default=np.inf):
        yield (
            f"WARNING: {integrator.membership.name(body)} is {widest:.4g} wide, and the periodic "
            f"box {min(heights):.4g}: where it turns it meets its own images. Use a larger box, or "
            "keyword torque for a body that does not turn"
        )


def _time_step(lammps: Lammps) -> Iterator[str]:
    """A line on a time step that is in another unit than LAMMPS takes it."""
    unit, femtoseconds = _TIMES.get(lammps.units, ("", 1.0))
    step = abs(lammps.innermost_dt) * femtoseconds
    if unit and step > 0 and not _SHORTEST <= step <= _LONGEST:
        yield (
            f"WARNING: the time step is {step:.4g} fs: with units {lammps.units}, timestep is in "
            f"{unit}"
        )


def forces_at_start(integrator: "Integrator") -> StartDiagnosis:
    """What the forces of the start tell of atoms that overlap, and the distance that atoms have, or
    the size of the largest body if that is more; collective."""
    bodies, communicator, lammps = integrator.bodies, integrator.communicator, integrator.lammps
    owned, dimension = bodies.sharers.owned, lammps.dimension
    force = np.linalg.norm(bodies.acting_wrench[:3], axis=0)
    push = 0.5 * lammps.innermost_dt**2 * lammps.ftm2v * force / bodies.mass
    pushed, furthest = _largest(push, bodies, communicator)
    size, _ = _largest(
        np.sqrt(bodies.moments_of_atoms.max(axis=0) / bodies.mass), bodies, communicator
    )
    atoms = max(1, communicator.count(len(lammps.groups)))
    space = np.linalg.det(lammps.box.h[:dimension, :dimension]) / atoms
    start = StartDiagnosis(lammps.step, spacing=max(space ** (1 / dimension), size))
    above = push[owned] > _PUSHED * start.spacing
    many, of = communicator.total(np.array([above.sum(), owned.sum()]))
    if not many:
        return start
    # forces on few bodies that are much too high speak for the start, on many for the step
    causes = ["atoms overlap at the start", "the time step is too long"]
    advice = [APART, "use a shorter time step"]
    first, second = (0, 1) if many <= 0.1 * of else (1, 0)
    diagnosis = (
        f"{causes[first]}, or {causes[second]}: the force on "
        f"{integrator.membership.name(furthest)} moves it by {pushed:.3g} in the first step"
    )
    return start._replace(diagnosis=diagnosis, advice=f"{advice[first]}, or {advice[second]}")


def _largest(values: np.ndarray, bodies: Bodies, communicator: Alone) -> tuple[float, int]:
    """The largest of the bodies' values, (n,), on all ranks, and whose it is; collective."""
    k = [values.argmax()] if len(values) else []
    found, ids = communicator.gather_to_all(np.array([values[k], bodies.id[k]]).T).T
    return max(zip(found, ids.astype(int)), default=(0.0, 0))
