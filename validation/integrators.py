"""Who moves the atoms: each integrator is the LAMMPS lines that set it up."""

from dataclasses import dataclass

REFERENCE = "rigid/nve"  # ratios and distances are taken from this one


@dataclass(frozen=True)
class Integrator:
    """LAMMPS commands with the scene's words left open.

    Attributes:
        name: the word on the command line and in files.
        label: how tables and figures call it, tolerance included.
        lines: LAMMPS commands; ``{group}``, ``{bodies}`` and ``{constraints}``
            are filled from the scene.
    """

    name: str
    label: str
    lines: tuple[str, ...]

    def commands(self, scene):
        """LAMMPS commands of this integrator for a scene."""
        words = {"group": scene.group, "bodies": scene.bodies, "constraints": scene.constraints}
        return [line.format(**words) for line in self.lines]


def nosquish(name, label, words=""):
    """This package's NO_SQUISH with the keywords ``words``."""
    return Integrator(
        name, label, (f'fix 1 {{group}} python/move "fix_nosquish.NVE {{group}} {{bodies}}{words}"',)
    )


def rigid(style):
    """One of LAMMPS's rigid fixes."""
    return Integrator(style, style, (f"fix 1 {{group}} {style} {{bodies}}",))


def constrained(style, tolerance, iterations=100):
    """Velocity Verlet with ``shake`` or ``rattle``, to a relative tolerance.

    fix nve comes first: rattle corrects the velocities that nve has set.
    """
    return Integrator(
        style,
        f"{style} {tolerance} + nve",
        (
            "fix 1 {group} nve",
            f"fix 2 {{group}} {style} {tolerance} {iterations} 0 {{constraints}}",
        ),
    )


INTEGRATORS = {
    integrator.name: integrator
    for integrator in (
        nosquish("nosquish", "fix_nosquish.NVE"),
        # the order of axes that rigid/nve has in the LAMMPS that this package installs
        nosquish("nosquish-123", "fix_nosquish.NVE order 123", " order 123"),
        rigid("rigid/nve"),
        rigid("rigid/nve/small"),
        rigid("rigid"),
        rigid("rigid/small"),
        constrained("shake", "1e-4"),
        constrained("rattle", "1e-4"),
    )
}
