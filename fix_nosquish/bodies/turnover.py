"""Bodies that come and go with their atoms, while all others go on."""

import numpy as np

from ..errors import RunError
from ..ranks.lookup import gone
from ..ranks.migration import IN_NO_BODY
from ..ranks.sharing import places
from .build import build


def turn_over(bodies, lammps, communicator, membership, how):
    """Drop the bodies whose atoms are all gone, and make those of the atoms that came; collective.

    Args:
        bodies: the `Bodies` of before, which change.  how: further arguments of `build`, by name.
    Returns:
        list of lines for the log, on what is probably not meant, and the IDs of new bodies of which
        more is known than their atoms.
    Raises:
        RunError: on all ranks, if a body has lost some of its atoms, if atoms were lost and not
            deleted, or came into a body that there is.
    """
    dropped = _without_atoms(bodies, lammps, communicator, membership)
    atoms = membership.atoms()
    came = atoms[lammps.cells["origins"].array[atoms] == IN_NO_BODY]
    if not communicator.any(len(came)):
        bodies.change(lammps, dropped)
        return [], ()
    membership.before = None  # for others
    new, notes = build(lammps, communicator, membership, atoms=came, **how)
    if new.spin > bodies.spin or new.oriented > bodies.oriented:
        raise RunError(
            f"by step {lammps.step} atoms came that are more than points, and the bodies had none "
            "such when the run began: give the fix line keyword mol",
            everywhere=True,
        )
    _refuse_joining(bodies.id[~dropped], new, lammps, communicator, membership)
    bodies.change(lammps, dropped, new)
    return notes["warnings"], notes["given"]


def _without_atoms(bodies, lammps, communicator, membership):
    """Which bodies have lost all of their atoms, (n,) bool; collective.

    Raises:
        RunError: as `turn_over`.
    """
    of_atoms = lammps.cells["origins"].array[membership.atoms()]
    arrived = lammps.cells["arrived"].array
    gained = arrived[-2 - of_atoms[of_atoms < -1], 0].copy().view(np.int64)
    lost = np.setdiff1d(np.arange(len(bodies.index)), places(of_atoms[of_atoms >= 0]))
    lost = gone(communicator, lost, gained)
    (missing,) = bodies.sharers.total(bodies.body[lost], np.ones(len(lost)))
    wrong = (missing > 0) & (missing < bodies.natoms)
    if communicator.count(len(lammps.groups)) != lammps.natoms:
        wrong = missing > 0  # LAMMPS has lost atoms, and not deleted them
    lost = lost[wrong[bodies.body[lost]]]
    communicator.agree(_of_lost(bodies, lost, lammps, membership) if len(lost) else None)
    return missing > 0


def _of_lost(bodies, lost, lammps, membership):
    """The message for atoms at these places, which their bodies lost."""
    first = lost[bodies.tag[lost].argmin()]
    body = bodies.body[first]
    name = membership.name(int(bodies.id[body]))
    text = f"atom {bodies.tag[first]} of {name} is gone by step {lammps.step}"
    cause, remedy = bodies.instability(body, lammps)
    if cause:
        return f"{cause}, and {text}: {remedy}"
    return (
        f"{text}: it left the box, or was deleted or taken out of the group without the rest of "
        "its body. Check the boundary, thermo_modify lost, and fixes that delete atoms: with "
        "body style molecule have them delete whole molecules"
    )


def _refuse_joining(ids, new, lammps, communicator, membership):
    """Raise an error if a body that there is, (n,) IDs, is to have new atoms; collective."""
    of_new = communicator.gather_to_all(new.id)
    taken = communicator.gather_to_all(np.intersect1d(ids, of_new))
    joins = np.isin(new.id[new.body], taken)
    problem = None
    if joins.any():
        name = membership.name(int(new.id[new.body[joins]][0]))
        problem = (
            f"atom {new.tag[joins][0]} came into {name} by step {lammps.step}, which has its "
            "atoms already: what inserts atoms in a run must bring whole bodies, each with an ID "
            "of its own"
        )
    communicator.agree(problem)
