"""Integrators: the LAMMPS lines that define each."""

from contextlib import suppress
from dataclasses import dataclass, replace
from importlib import metadata

from .. import INSTALLED
from . import Scene

OURS = "nosquish"
OLDER = {
    "MatubayasiNakahara": f"{INSTALLED}.schemes.matubayasi_nakahara",
    "Gear": f"{INSTALLED}.schemes.gear",
}  # class: its module, which LAMMPS imports


@dataclass(frozen=True)
class Integrator:
    """LAMMPS commands with placeholders for the scene's words.

    Attributes:
        name: on the command line and in files.
        label: name in tables and figures, with the tolerance.
        lines: LAMMPS commands; ``{group}``, ``{bodies}`` and ``{constraints}``
            are replaced by those of the scene.
        whole_bodies: whether a rank's atoms and ghost atoms must hold the whole of each body.
        kind: ``ours``, ``rigid`` (LAMMPS's rigid fixes), ``constraints`` (shake and its kin) or
            ``free`` (no body is rigid).
        tolerance: of constraints, relative; None for others.
        then: LAMMPS commands after the scene's own that this integrator needs.
    """

    name: str
    label: str
    lines: tuple[str, ...]
    whole_bodies: bool = False
    kind: str = "ours"
    tolerance: float | None = None
    then: tuple[str, ...] = ()

    def can_run(self, scene: Scene) -> bool:
        """Whether this integrator can hold the scene's bodies rigid."""
        return self.kind != "constraints" or scene.constraints is not None

    def commands(self, scene: Scene) -> list[str]:
        """The LAMMPS commands of this integrator for a scene."""
        words = {"group": scene.group, "bodies": scene.bodies, "constraints": scene.constraints}
        return [line.format(**words) for line in self.lines]


def nosquish(name: str, label: str, words: str = "", scheme: str = "NVE") -> Integrator:
    """NO_SQUISH, or another of this package's integrators, with the keywords ``words``; or a
    ``scheme`` of `OLDER`."""
    line = f"fix 1 {{group}} nosquish/{scheme.lower()} {{bodies}}{words}"
    if scheme in OLDER:
        line = f'fix 1 {{group}} python/move "{target(scheme)} {{group}} {{bodies}}{words}"'
    return Integrator(name, label, (line,))


def target(scheme: str) -> str:
    """The class of an integrator as a quoted fix line names it."""
    return f"{OLDER.get(scheme, 'fix_nosquish')}.{scheme}"


def rigid(style: str) -> Integrator:
    """One of LAMMPS's rigid fixes."""
    line = f"fix 1 {{group}} {style} {{bodies}}"
    return Integrator(style, style, (line,), whole_bodies="small" in style, kind="rigid")


def constrained(style: str, tolerance: str, iterations: int = 100) -> Integrator:
    """Velocity Verlet with one of `CONSTRAINING`, to a relative tolerance.

    fix nve comes first: rattle corrects the velocities that nve has set.
    """
    held = f"fix 2 {{group}} {style} {tolerance} {iterations} 0 {{constraints}}"
    label, lines = f"{style} {tolerance} + nve", ("fix 1 {group} nve", held)
    return Integrator(style, label, lines, kind="constraints", tolerance=float(tolerance))


def _constraining() -> tuple[str, ...]:
    """The fixes of the installed LAMMPS that constrain bonds and angles."""
    with suppress(metadata.PackageNotFoundError):
        if int(metadata.version("lammps").split(".")[0]) >= 2026:
            return "shake", "rattle", "ilves"
    return "shake", "rattle"


CONSTRAINING = _constraining()


def _by_name(*integrators: Integrator) -> dict[str, Integrator]:
    return {integrator.name: integrator for integrator in integrators}


INTEGRATORS = _by_name(
    nosquish(OURS, "nosquish/nve"),
    *map(rigid, ("rigid/nve", "rigid/nve/small", "rigid", "rigid/small")),
    *(constrained(style, "1e-4") for style in CONSTRAINING),
)

# what the paper compares, and LAMMPS's own
PAPER = _by_name(
    nosquish(OURS, "NO_SQUISH"),
    nosquish("matubayasi-nakahara", "reference 12", scheme="MatubayasiNakahara"),
    nosquish("gear", "Gear", scheme="Gear"),
    constrained("shake", "1e-8", 200),
    rigid("rigid/nve/small"),
    rigid("rigid/small"),
)

# what the benchmark times; styles with /omp run with one thread
_OTHERS = "rigid/nve", "rigid/nve/small", "rigid", "rigid/small"
BENCHMARKED = _by_name(
    *(INTEGRATORS[name] for name in (OURS, *_OTHERS)),
    *map(rigid, ("rigid/nve/omp", "rigid/omp", "rigid/small/omp")),
    *(INTEGRATORS[name] for name in CONSTRAINING),
)

# error against run time: every scheme with every parameter that trades one for the other
SWEPT = _by_name(
    nosquish(OURS, "NO_SQUISH"),
    nosquish("nosquish-2", "NO_SQUISH mrot 2", " mrot 2"),
    nosquish("nosquish-4", "NO_SQUISH mrot 4", " mrot 4"),
    PAPER["matubayasi-nakahara"],
    PAPER["gear"],
    *map(rigid, _OTHERS),
    *(
        replace(constrained(style, tolerance, 200), name=f"{style}-{tolerance}")
        for style in CONSTRAINING
        for tolerance in ("1e-4", "1e-6", "1e-8")
    ),
)

# atoms that move freely at constant velocity: the cost of a run without rigid bodies
FREE = Integrator("nve/noforce", "nve/noforce", ("fix 1 {group} nve/noforce",), kind="free")
