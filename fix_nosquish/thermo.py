"""What LAMMPS's thermodynamics must know of the bodies, and what its log should say of them."""

import numpy as np


def freedom(bodies, dimension):
    """Degrees of freedom of each body, (n,): 6, 5 or 3; in two dimensions 3 or 2."""
    result = np.full(len(bodies), dimension)
    result[: bodies.extended] = 5 if dimension == 3 else 3
    result[: bodies.rotors] = 6 if dimension == 3 else 3
    return result


def removed_freedom(bodies, world, inside, dimension):
    """Degrees of freedom that rigidity takes from a group of atoms; collective.

    Args:
        bodies: the `Bodies`.  world: the `World` or `Alone`.
        inside: (m,) bool, which of the bodies' atoms on this rank are in the group.
    Returns:
        int: the sum, over the bodies that are wholly in the group, of dimension times the
        number of their atoms, less their own degrees of freedom (as LAMMPS's fix rigid counts).
    """
    count = np.bincount(bodies.body, inside, minlength=len(bodies))[None, :]
    bodies.sharers.combine(count)
    whole = (count[0] == bodies.natoms) & bodies.sharers.owned
    removed = dimension * bodies.natoms[whole].sum() - freedom(bodies, dimension)[whole].sum()
    return round(world.total(np.array([removed]))[0])


def summary(nve, notes, virial):
    """The lines for the log at the start of a run, and the degrees of freedom removed; collective.

    Args:
        nve: the integrator.  notes: what `build` says.  virial: whether LAMMPS asks for it.
    """
    bodies, world, command = nve.bodies, nve.world, nve.command
    owned = bodies.sharers.owned
    n, r, e = len(bodies), bodies.rotors, bodies.extended
    # a planar body's two smaller moments add up to its largest
    flat = bodies.moment[:, :r].sum(axis=0) <= bodies.moment[:, :r].max(axis=0) * (2 + 1e-7)
    counts = [owned.sum(), (owned[:r] & ~flat).sum(), (owned[:r] & flat).sum(), owned[r:e].sum(), owned[e:n].sum(),
              bodies.natoms[owned].sum(), len(bodies.sharers.bodies[owned[bodies.sharers.bodies]])]  # fmt: skip
    total, solid, planar, linear, points, atoms, shared = world.total(np.array(counts, float)).astype(int)
    removed = removed_freedom(bodies, world, np.ones(len(bodies.tag), bool), nve.lammps.dimension)
    kinds = [f"{k} {what}" for k, what in ((solid, "three-dimensional"), (planar, "planar"), (linear, "linear"),
                                           (points, "single atoms")) if k]  # fmt: skip
    done = [f"rotation of {what}" for k, what in ((solid + planar, f"rotors (mrot {command.mrot}, order {command.order})"), (linear, "linear bodies")) if k]
    left = [what for k, what in ((solid + planar, "no rotors"), (linear, "no linear bodies"), (points, "no single atoms")) if not k]
    for needed, pass_, without in (
        (shared, f"exchange of {shared} bodies shared between ranks", "no body shared between ranks"),
        (nve.half_step_velocities, "velocities at the half step", "no reader of velocities at the half step"),
        (virial, "constraint virial on steps that need it", "no virial requested"),
    ):
        (done if needed else left).append(pass_ if needed else without)
    lines = [
        f"Rigid bodies by NO_SQUISH: {command.text}",
        f"  {total} rigid bodies with {atoms} atoms: {', '.join(kinds)}",
        f"  {removed} degrees of freedom removed, {round(world.total(np.array([freedom(bodies, nve.lammps.dimension)[owned].sum()]))[0])} left to the bodies",
        f"  start velocities: {notes['removed']:.8g} of the kinetic energy {notes['kinetic']:.8g} was not rigid motion and was removed",
        "\n    ".join(["  passes in use:", *(done or ["translation"])]),
        "\n    ".join(["  passes left out:", *(left or ["none"])]),
    ]
    if notes["rebuilt"]:
        lines.append(f"  {notes['rebuilt']} bodies were cut by a periodic face and put together by the nearest image")
    if nve.host.group not in (None, command.group):
        lines.append(
            f"WARNING: the fix line names group {nve.host.group}, the class group {command.group}: the bodies are of {command.group}, "
            "so give the fix the same group"
        )
    if notes["stray"] > 1:
        lines.append(
            f"WARNING: the {notes['stray']} atoms with molecule-ID 0 are one rigid body: give every body a molecule-ID of its own, "
            "or leave these atoms out of the group"
        )
    return lines, removed
