"""What LAMMPS's thermodynamics must know of the bodies, and what its log should say of them."""

import numpy as np

from .. import __version__
from ..bodies.build import least_moment
from ..bodies.extended import DIPOLE, ORIENT

APART = "relax the bodies by fix_nosquish.FIRE and a run, or move them apart"
_FAST = 1.0  # radians in a time step that call for a warning
# of the distance between atoms: unless these overlap, no force moves a body further in a step
_PUSHED = 0.1


def freedom(bodies, dimension):
    """Degrees of freedom of each body, (n,): 6, 5 or 3; in two dimensions 3 or 2."""
    result = np.full(len(bodies), dimension)
    result[: bodies.turning] = 5 if dimension == 3 else 3
    result[: bodies.rotors] = 6 if dimension == 3 else 3
    return result


def removed_freedom(bodies, communicator, inside, lammps):
    """Degrees of freedom that rigidity takes from a group of atoms; collective.

    Args:
        bodies: the `Bodies`.  communicator: the `Communicator` or `ALONE`.
        inside: (m,) bool, which of the bodies' atoms on this rank are in the group.
        lammps: the `Lammps`.
    Returns:
        int: the sum, over the bodies that are wholly in the group, of the degrees of freedom of
        their atoms (3, of a sphere 6; in two dimensions 2 and 3), less their own (as LAMMPS's fix
        rigid counts).
    """
    degrees = np.full(len(inside), lammps.dimension)
    if bodies.spin:
        finite = bodies.displace[ORIENT:DIPOLE].any(axis=0) & bodies.oriented
        if lammps.radius is not None:
            finite |= lammps.radius[bodies.index] > 0
        degrees[finite] = 6 if lammps.dimension == 3 else 3
    whole, (sums,) = _of_whole(bodies, inside, degrees)
    removed = sums[whole].sum() - freedom(bodies, lammps.dimension)[whole].sum()
    return round(communicator.total(np.array([removed]))[0])


def _of_whole(bodies, inside, *of_atoms):
    """Which bodies are counted here and wholly in a group, (n,) bool, and sums over the atoms of
    each, (len(of_atoms), n); collective. Args: inside: as for `removed_freedom`."""
    columns = inside, *of_atoms
    sums = np.array([np.bincount(bodies.body, c, minlength=len(bodies)) for c in columns])
    bodies.sharers.combine(sums)
    return (sums[0] == bodies.natoms) & bodies.sharers.owned, sums[1:]


def removed_freedom_to_scale(bodies, communicator, bit, lammps):
    """What to give for `removed_freedom` so that LAMMPS, which scales the velocities of all atoms
    of a group to a temperature, gives the bodies that temperature; collective.

    A body keeps a part of its atoms' kinetic energy when the run makes their velocities rigid
    motion: all if they are that already, and the part of its degrees of freedom if they were drawn.

    Args:
        bodies: the `Bodies` of these velocities, whose atoms are points.  bit: of the group.
        Else as for `removed_freedom`.
    """
    v, mass = lammps.per_atom("v", columns=3), lammps.masses
    of_group = np.flatnonzero(lammps.groups & bit)
    squares = mass * (v**2).sum(axis=1)
    inside = lammps.groups[bodies.index] & bit != 0
    whole, (of_atoms,) = _of_whole(bodies, inside, squares[bodies.index])
    lost = of_atoms[whole].sum() - 2.0 * bodies.kinetic()[:, whole].sum()
    found = communicator.total(np.array([squares[of_group].sum(), lost, len(of_group)]))
    kinetic, lost, atoms = found
    removed = removed_freedom(bodies, communicator, inside, lammps)
    degrees = lammps.dimension * (atoms - 1)  # compute temp leaves out those of the momentum
    if not kinetic - lost > 0.0:
        return removed
    return round(degrees - (degrees - removed) * kinetic / (kinetic - lost))


def energies(bodies, communicator, lammps):
    """Kinetic energies and temperatures of the bodies; collective.

    Returns:
        (5,): kinetic energy of translation and of rotation, their temperatures, the temperature of
        both together, in LAMMPS's units; a temperature is 0 where there is no such degree of
        freedom.
    """
    owned = bodies.sharers.owned
    translation = np.full(len(bodies), lammps.dimension)
    rotation = freedom(bodies, lammps.dimension) - translation
    sums = communicator.total(
        np.array(
            [
                *bodies.kinetic()[:, owned].sum(axis=1),
                translation[owned].sum(),
                rotation[owned].sum(),
            ]
        )
    )
    energy, degrees = lammps.mvv2e * sums[:2], sums[2:]
    energy, degrees = np.append(energy, energy.sum()), np.append(degrees, degrees.sum())
    return np.append(
        energy[:2],
        np.divide(2 * energy, degrees * lammps.boltz, out=np.zeros(3), where=degrees > 0),
    )


def projected(notes):
    """Whether start velocities were not rigid motion already. Args: notes: what `build` says."""
    return notes["removed"] > 1e-9 * notes["kinetic"]


def summary(integrator, virial):
    """The lines for the log at the start of a run, and the degrees of freedom removed; collective.

    Args:
        integrator: the `Integrator`.  virial: whether LAMMPS asks for it.
    """
    bodies, communicator, lammps = integrator.bodies, integrator.communicator, integrator.lammps
    command, notes, fixes = integrator.command, integrator.notes, integrator.other_fixes
    owned = bodies.sharers.owned
    n, r, e = len(bodies), bodies.rotors, bodies.turning
    flat = bodies.flat
    listed = bodies.listed
    counts = [
        listed.sum(),
        (listed[:r] & ~flat).sum(),
        (listed[:r] & flat).sum(),
        listed[r:e].sum(),
        listed[e:n].sum(),
        bodies.natoms[listed].sum(),
        (owned & ~listed).sum(),
        owned[:r].sum(),  # points may be spheres, which turn
        owned[r:e].sum(),
        len(bodies.sharers.bodies[owned[bodies.sharers.bodies]]),
    ]
    total, solid, planar, linear, single, atoms, points, rotors, lines, shared = communicator.total(
        np.array(counts, float)
    ).astype(int)
    removed = removed_freedom(bodies, communicator, np.ones(len(bodies.tag), bool), lammps)
    own = communicator.total(np.array([freedom(bodies, lammps.dimension)[owned].sum()]))[0]
    kinetic = np.array([notes["kinetic"], notes["kinetic"] - notes["removed"]])
    # as compute temp of these atoms counts them
    degrees = np.array([removed + own, own]) - lammps.dimension
    before, now = np.divide(2 * kinetic, degrees * lammps.boltz, out=np.zeros(2), where=degrees > 0)
    if bodies.planar:
        kinds, turning = (
            ((solid + planar, "in the plane"),),
            ((rotors, "rotation in the plane", "no rotation"),),
        )
    else:
        kinds = (solid, "three-dimensional"), (planar, "planar"), (linear, "linear")
        how = f" (mrot {command.mrot}, order {command.order})" if integrator.splits else ""
        how = " (exact)" if integrator.exact else how
        turning = (
            (rotors, f"rotation of rotors{how}", "no rotors"),
            (lines, "rotation of linear bodies", "no linear bodies"),
        )
    kinds = [f"{k} {what}" for k, what in (*kinds, (single, "single atoms")) if k]
    done, left = [], []
    for needed, pass_, without in (
        *turning,
        (single, "", "no single atoms"),
        (bodies.spin, "torque and spin of particles that are no points", ""),
        (bodies.oriented, "orientation of particles", ""),
        (integrator.thermostat, "thermostat", ""),
        (command.steps, f"momenta anew, and a test, every {command.steps} steps", ""),
        (command.shadow, f"shadow energy, in each step that is a multiple of {command.shadow}", ""),
        (integrator.every, f"box, in one of {integrator.every} steps", ""),
        (integrator.go_on, "a second pass over the bodies, a sum over the ranks before", ""),
        (command.force or command.torque, "forces and torques that are switched off", ""),
        (
            fixes.late,
            f"velocities that {' '.join(fix.id for fix in fixes.late)} may change, "
            "at the end of a step",
            "",
        ),
        (
            command.output,
            f"table of the bodies every {command.output and command.output[0]} steps",
            "",
        ),
        (
            shared,
            f"exchange of {shared} bodies shared between ranks",
            "no body shared between ranks",
        ),
        (
            fixes.velocities_every,
            f"velocities of the atoms {_often(fixes.velocities_every)} and with output",
            "velocities of the atoms on steps without output",
        ),
        (
            integrator.half_step_velocities,
            "velocities at the half step",
            "no reader of velocities at the half step",
        ),
        (virial, "constraint virial on steps that need it", "no virial requested"),
    ):
        if (pass_ and needed) or (without and not needed):
            (done if needed else left).append(pass_ if needed else without)
    lines = [
        f"Rigid bodies by {integrator.method}, fix_nosquish {__version__}: {command.text}",
        f"  {total} rigid bodies with {atoms} atoms: {', '.join(kinds) or 'none yet'}"
        + (f"; {points} points, the atoms of group {command.points}" if command.points else ""),
        f"  {removed} degrees of freedom removed, {round(own)} left to the bodies",
        "  start velocities: "
        + (
            f"{notes['removed']:.8g} of the kinetic energy {notes['kinetic']:.8g} was not "
            f"rigid motion and was removed; temperature {before:.8g} of the atoms before, "
            f"{now:.8g} of the bodies now"
            if projected(notes)
            else f"rigid motion, temperature {now:.8g} of the bodies"
        ),
        "\n    ".join(["  passes in use:", *(done or ["translation"])]),
        "\n    ".join(["  passes left out:", *(left or ["none"])]),
    ]
    if command.moments:
        how, word = command.moments
        value = (
            least_moment(lammps, command) if how == "step"
            else lammps.number(word) if word else 1.0
        )  # fmt: skip
        of_dynamics = (
            ". Averages over configurations and velocities stay as they are; how long bodies take "
            "to turn does not"
        )
        chosen = {
            "equal": f"{value:g} instead of the atoms' own" + of_dynamics,
            "scale": f"{value:g} times those of the atoms' own" + of_dynamics,
            "step": f"at least {value:.4g}, for a step of {lammps.innermost_dt:g}" + of_dynamics,
            "alike": "those of atoms that share the mass of their body alike",
        }[how]
        lines.append(f"  principal moments: {chosen}")
    if notes["rebuilt"]:
        lines.append(
            f"  {notes['rebuilt']} bodies were cut by a periodic face and put together by the "
            "nearest image"
        )
    return lines, removed


def _often(steps):
    """How often something is done that is done every so many steps, for each of these numbers."""
    if 1 in steps:
        return "each step"
    return f"every {' and '.join(str(n) for n in steps)} steps"


def warnings(integrator):
    """Lines for the log on what is probably not meant; collective. Args: as `summary`."""
    lines, group, notes = [], integrator.command.group, integrator.notes
    if integrator.host.group not in (None, group):
        lines.append(
            f"WARNING: the fix line names group {integrator.host.group}, the class group {group}: "
            f"the bodies are of {group}, so give the fix the same group"
        )
    if notes["stray"] > 1:
        lines.append(
            f"WARNING: the {notes['stray']} atoms with molecule-ID 0 are one rigid body: "
            "give every body a molecule-ID of its own, or leave these atoms out of the group"
        )
    warmed = integrator.thermostat or integrator.quenches or integrator.command.steps
    if notes["still"] and projected(notes) and not warmed:
        lines.append(
            "WARNING: the bodies' atoms are no points, and do not spin: velocity create and "
            "velocity scale leave spins as they are. So the bodies' rotation starts colder than "
            "their translation; a thermostat warms it"
        )
    lines += [*notes["warnings"], *integrator.own_warnings]
    dt = integrator.lammps.innermost_dt
    turn, body = _fastest(integrator.bodies, integrator.communicator, dt)
    if turn > _FAST:
        lines.append(
            f"WARNING: {integrator.membership.name(body)} turns by {turn:.2g} rad in a step, "
            "which no time step of this length can follow well: "
            f"use one of about {0.2 * integrator.dt / turn:.2g}, or a better start; "
            "a body that is almost linear can be made linear"
        )
    return lines


def forces_at_start(integrator):
    """What the forces of the start tell of atoms that overlap; collective.

    Returns:
        (cause, remedy, spacing): what to say of the body that is pushed furthest in the first step,
        '' if that is as it should be; what to do; and the distance that atoms have from each other,
        or the size of the largest body if that is more.
    """
    bodies, communicator, lammps = integrator.bodies, integrator.communicator, integrator.lammps
    owned, dimension = bodies.sharers.owned, lammps.dimension
    push = (
        0.5
        * lammps.innermost_dt**2
        * lammps.ftm2v
        * np.sqrt((bodies.force**2).sum(axis=0))
        / bodies.mass
    )
    size = np.sqrt(bodies.moments_of_atoms.max(axis=0) / bodies.mass)
    k = [push.argmax()] if len(push) else []
    pushes, ids, sizes = communicator.gather_to_all(
        np.array([push[k], bodies.id[k], size.max(initial=0.0) * np.ones(len(k))]).T
    ).T
    space = np.linalg.det(lammps.box.h[:dimension, :dimension]) / max(
        1, communicator.count(len(lammps.groups))
    )
    spacing = max(space ** (1 / dimension), sizes.max(initial=0.0))
    many, of = communicator.total(np.array([(push[owned] > _PUSHED * spacing).sum(), owned.sum()]))
    if not many:
        return "", "", spacing
    # forces on few bodies that are much too high speak for the start, on many for the step
    causes = ["atoms overlap at the start", "the time step is too long"]
    remedies = [APART, "use a shorter time step"]
    first, second = (0, 1) if many <= 0.1 * of else (1, 0)
    cause = f"{causes[first]}, or {causes[second]}"
    remedy = f"{remedies[first]}, or {remedies[second]}"
    furthest = integrator.membership.name(int(ids[pushes.argmax()]))
    return (
        f"{cause}: the force on {furthest} moves it by {pushes.max():.3g} in the first step",
        remedy,
        spacing,
    )


def _fastest(bodies, communicator, dt):
    """The angle by which the fastest body turns in a step, and its ID; collective."""
    turns = dt * np.sqrt((bodies.angular_velocity() ** 2).sum(axis=0))
    k = [turns.argmax()] if len(turns) else []
    angles, ids = communicator.gather_to_all(np.array([turns[k], bodies.id[k]]).T).T
    return max(zip(angles, ids.astype(int)), default=(0.0, 0))
