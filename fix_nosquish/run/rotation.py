"""How the free rotation is done: exactly, or split into rotations about one axis each."""

from typing import TYPE_CHECKING

from ..motion.operations import EXACT

if TYPE_CHECKING:
    from .integrator import Integrator


def _can_be_exact(integrator: "Integrator") -> bool:
    return any(operation.exact for operation in integrator.operations.values())


def refuse_other_rotor(integrator: "Integrator") -> None:
    """Raise an error if the words ask for a rotation that the class does not have."""
    command, name = integrator.command, integrator.name
    if command.rotor == "split" and not integrator.splits:
        raise command.wrong(
            "keywords mrot and order, and rotor split, are for integrators that split the "
            f"rotation, which {name} does not"
        )
    if command.rotor == "exact" and not _can_be_exact(integrator):
        raise command.wrong(
            f"keyword rotor exact is for the rotation of fix nosquish/nve, not that of {name}"
        )


def choose(integrator: "Integrator") -> None:
    """Choose whether the rotation is exact, for the first bodies that turn: these keep it, and
    others that come take it over; collective.

    A restart file keeps a choice that is not that of the bodies which there are (host.rotor).
    """
    host, own = integrator.host, _exact_by_default(integrator)
    if not integrator.has_rotors:
        told = host.rotor >= 0 and _left_to_bodies(integrator)
        integrator.exact = bool(host.rotor) if told else own
        integrator.has_rotors = integrator.communicator.any(integrator.bodies.rotors > 0)
    host.rotor = -1 if integrator.exact == own else int(integrator.exact)


def _left_to_bodies(integrator: "Integrator") -> bool:
    """Whether neither the words nor the class say how the rotation is done."""
    either = _can_be_exact(integrator) and integrator.splits
    return either and not (integrator.command.rotor or integrator.bodies.planar)


def _exact_by_default(integrator: "Integrator") -> bool:
    """Whether the rotation is exact for the bodies as they are; collective.

    By default that of symmetric tops is, whose axes may be chosen in more than one way.
    """
    bodies, rotor = integrator.bodies, integrator.command.rotor
    if not _left_to_bodies(integrator):
        always = _can_be_exact(integrator) and not (integrator.splits or bodies.planar)
        return rotor == "exact" or (always and not rotor)
    moment = bodies.moment[:, : bodies.rotors]
    equal = (moment[0] == moment[1]) | (moment[1] == moment[2])
    return not integrator.communicator.any(not equal.all())


def inner_steps(integrator: "Integrator") -> int:
    """How the rotation is split, as operations have it."""
    return EXACT if integrator.exact else integrator.command.mrot
