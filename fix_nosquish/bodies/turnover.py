"""Bodies that are added or deleted with their atoms during a run; all others are unchanged."""

import numpy as np

from ..errors import refuse
from ..ranks.lookup import gone
from ..ranks.sharing import places
from ..structs import IN_NO_BODY
from .bodies import Bodies
from .build import Recipe, build
from .membership import Membership


def update_bodies(bodies: Bodies, recipe: Recipe) -> tuple[list[str], np.ndarray]:
    """Remove the bodies whose atoms are all gone, and make bodies of added atoms; collective.

    Args:
        bodies: the present `Bodies`, changed in place.
        recipe: how bodies are made.
    Returns:
        warnings for the log, and the IDs of new bodies with `Prescribed` properties.
    Raises:
        RunError: on all ranks, if a body has lost some of its atoms, if LAMMPS has lost atoms that
            were not deleted, or if atoms were added to an existing body.
    """
    membership = recipe.membership
    lammps, communicator = membership.lammps, membership.communicator
    dropped = _without_atoms(bodies, membership)
    membership.decide()
    atoms = membership.atoms()
    added = atoms[lammps.cells["origins"].array[atoms] == IN_NO_BODY]
    if not communicator.any(len(added)):
        bodies.change(lammps, dropped)
        return [], np.empty(0, np.int64)
    new, report, _ = build(recipe, atoms=added)
    refuse(
        new.spin > bodies.spin or new.oriented > bodies.oriented,
        f"by step {lammps.step} atoms of finite size or with a dipole came, but the bodies had "
        "none when the run began: give the fix line keyword mol",
    )
    _refuse_joining(bodies.id[~dropped], new, membership)
    bodies.change(lammps, dropped, new)
    return report.warnings, report.prescribed_ids


def _without_atoms(bodies: Bodies, membership: Membership) -> np.ndarray:
    """Which bodies have lost all of their atoms, (n,) bool; collective.

    Raises:
        RunError: see `update_bodies`.
    """
    lammps, communicator = membership.lammps, membership.communicator
    of_atoms = lammps.cells["origins"].array[membership.atoms()]
    arrived = lammps.cells["arrived"].array
    gained = arrived[-2 - of_atoms[of_atoms < -1], 0].copy().view(np.int64)
    lost = np.setdiff1d(np.arange(len(bodies.index)), places(of_atoms[of_atoms >= 0]))
    lost = gone(communicator, lost, gained)
    (missing,) = bodies.sharers.total(bodies.body[lost], [np.ones(len(lost))])
    wrong = (missing > 0) & (missing < bodies.natoms)
    if communicator.count(len(lammps.groups)) != lammps.natoms:
        wrong = missing > 0  # LAMMPS's count still includes them: lost atoms, not deleted ones
    lost = lost[np.argsort(bodies.tag[lost])]
    communicator.refuse(
        wrong[bodies.body[lost]],
        lambda k: _loss_message(bodies, lost[k], membership),
    )
    return missing > 0


def _loss_message(bodies: Bodies, atom: int, membership: Membership) -> str:
    """The message for an atom, by its index among the bodies' atoms, that its body has lost."""
    lammps, body = membership.lammps, bodies.body[atom]
    name = membership.name(int(bodies.id[body]))
    text = f"atom {bodies.tag[atom]} of {name} is gone by step {lammps.step}"
    diagnosis, advice = bodies.instability(body, lammps)
    if diagnosis:
        return f"{diagnosis}, and {text}: {advice}"
    return (
        f"{text}: it left the box, or was deleted or taken out of the group without the rest of "
        "its body. Check the boundary, thermo_modify lost, and fixes that delete atoms: with "
        "body style molecule have them delete whole molecules"
    )


def _refuse_joining(ids: np.ndarray, new: Bodies, membership: Membership) -> None:
    """Raise an error if atoms were added to an existing body; `ids` (n,) of these; collective."""
    communicator = membership.communicator
    of_new = communicator.gather_to_all(new.id)
    in_use = communicator.gather_to_all(np.intersect1d(ids, of_new))
    body = new.id[new.body]
    communicator.refuse(
        np.isin(body, in_use),
        lambda k: (
            f"atom {new.tag[k]} came into {membership.name(int(body[k]))} by step "
            f"{membership.lammps.step}, which has its atoms already: what inserts atoms in a run "
            "must bring whole bodies, each with an ID of its own"
        ),
    )
