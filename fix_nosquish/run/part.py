"""Parts of an integrator: thermostats, barostats, trajectories that are tested."""

from collections.abc import Iterable, Sequence
from typing import Any

from ..loops.compiled import Cell
from . import former_names


class Declaration:
    """What an integrator and its parts may add to a run.  Methods are collective, and get the
    `run.Run`.

    Attributes:
        method: its name in the log.
    """

    method: str = ""

    def __init_subclass__(cls) -> None:
        former_names.take_over(cls)

    def extra_parameters(self, run: Any) -> dict[str, Any]:
        """Its parameters, besides those of operations: a dictionary from fields of
        `Integrator.numbers`; called when a run begins.  Fields that nothing names are 0."""
        return {}

    def extra_cells(self, run: Any) -> dict[str, Cell]:
        """The cells that its own loops take, by name."""
        return {}

    def extra_lists(self, run: Any, cells: dict[str, Cell]) -> dict[str, list]:
        """Additional lists of loops, by name, bound to cells; see `passes`."""
        return {}

    def extra_warnings(self, run: Any) -> Iterable[str]:
        """Lines for the log on what is probably not meant, when a run begins."""
        return ()

    def failure(self, found: int, run: Any) -> str:
        """The message that ends the run if a loop returned this number below 0; of a part empty if
        it was another part's."""
        return f"{self.method} has failed at step {run.lammps.step}"


class Part(Declaration):
    """A part of an integrator; this class does nothing.  Methods are collective.

    Attributes:
        modules: names of modules whose loops it needs, besides those of its classes.
        box_every: it changes the box in the steps after the multiples of this; 0 for never.
        flips: whether tilts of the box change, so that it may take other vectors of its lattice.
        needs_energy: whether it needs the potential energy at the end of steps that it names, as
            host.energy_step.
        reversible: whether a run can go back in time.
    """

    modules: Sequence[str] = ()
    box_every = 0
    needs_energy = False
    reversible = True

    @property
    def flips(self) -> bool:
        return False

    def begin(self, run: Any) -> None:
        """A run begins."""

    def failure(self, found: int, run: Any) -> str:
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
