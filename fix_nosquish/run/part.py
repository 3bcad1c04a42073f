"""Parts of an integrator: thermostats, barostats, trajectories that are tested."""

from collections.abc import Iterable
from typing import Any

from ..loops.compiled import Cell
from . import former_names


class Part:
    """A part of an integrator; this class does nothing.  Methods are collective, and get the
    `run.Run`.

    Attributes:
        method: what the log calls it.
        modules: names of modules whose loops it needs, besides those of its classes.
        box_every: it changes the box in the steps after the multiples of this; 0 for never.
        flips: whether tilts of the box change, so that it may take other vectors of its lattice.
        needs_energy: whether it needs the potential energy at the end of steps that it names, as
            host.energy_step.
        reversible: whether a run can go back in time.
    """

    method: str = ""
    modules: tuple[str, ...] = ()
    box_every = 0
    needs_energy = False
    reversible = True

    def __init_subclass__(cls) -> None:
        former_names.take_over(cls)

    @property
    def flips(self) -> bool:
        return False

    def begin(self, run: Any) -> None:
        """A run begins."""

    def extra_parameters(self, run: Any) -> dict[str, Any]:
        """Fields of the parameters, and their values as a run begins."""
        return {}

    def extra_cells(self, run: Any) -> dict[str, Cell]:
        """Cells that its loops take, by name."""
        return {}

    def extra_lists(self, run: Any, cells: dict[str, Cell]) -> dict[str, list]:
        """Lists of loops; see `integrator.Integrator`."""
        return {}

    def extra_warnings(self, run: Any) -> Iterable[str]:
        """Lines for the log on what is probably not meant."""
        return ()

    def failure(self, found: int, run: Any) -> str:
        """The message that ends the run if a loop returned this number; empty if it was another
        part's."""
        return ""

    def start(self, run: Any) -> None:
        """The first forces of a run are known."""

    def resume(self, run: Any) -> None:
        """The first step of a run begins without a set-up before it."""

    def begin_trajectory(self, run: Any) -> None:
        """The step host.begins is about to begin."""

    def end_trajectory(self, run: Any) -> None:
        """The potential energy of the step host.energy_step is known."""

    def bodies_changed(self, run: Any) -> None:
        """Bodies were added or removed in a run."""

    def reset_target(self, temperature: float, run: Any) -> None:
        """Keep this temperature from now on; run is None before the first run."""

    def end(self, run: Any) -> None:
        """A run is over."""


def box_every(parts: Iterable[Part]) -> int:
    """`Part.box_every` of the part that changes the box; 0 if none does."""
    return max((part.box_every for part in parts), default=0)


def needs_energy(parts: Iterable[Part]) -> bool:
    """Whether one of the parts has `Part.needs_energy`."""
    return any(part.needs_energy for part in parts)
