"""What an integrator says of its step; loops, memory and messages follow from it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from ..loops.compiled import Cell, Kind, Loop
from ..motion import step
from ..motion.operations import Parameters

_OF_LOOPS = "splitting", "operations", "rows", "starts"


class Declaration:
    """What a class derived from `integrator.Integrator` may declare, and what holds if it does not.

    The step:
        splitting, operations: what a step is; see `step.stages`.
        numbers: the record of the parameters that its operations take: `operations.Parameters`, or
            one that extends it. A class with the operations of another one extends the other's.
        rows: how many numbers of its own each body has; they go where the body goes, and begin as
            0. In a block they are the rows from BLOCK_ROWS on.
        kept: how many more numbers go where the body goes, behind its rows in the state, which
            operations do not see.
        work: how many more rows of a block its operations need to work with.
        starts: what sets its own rows when the forces of the start are known, or None: a function
            as in an operation, inlined.
        prepares: a loop that sets parameters for the letter that is `prepared`, or None; it returns
            0, or -1 to end the run with the message `unprepared`.
        mid_step: whether the velocities that atoms have at the end of a step are those of its
            middle, before the letters behind the forces: with a thermostat there, these are the
            right ones.  Not with run_style respa.

    What it can do:
        method: what the log calls it.
        splits: whether it has use for the keywords mrot and order.  Keyword rotor exact is for
            those with an operation that says so.
        keywords: which of `command.OWN_KEYWORDS` it has, besides what `command.KEYWORDS` has for
            all.
        own_keywords: others, each with a number behind it: from their names to what that is, for
            messages. `own_number` has the number.
        respa: whether it can have the forces of the levels of run_style respa.
        thermostat: what keeps a temperature, so that no other fix may; None for nothing.
        backwards: whether the time step may be below zero, so that a run goes back in time.
        crosses: whether bodies may get another velocity where they cross a face, as with remap v of
            fix deform. A class with operations of its own says so anew.
        needs_energy: whether it needs the potential energy at the end of steps that it names, as
            host.energy_step.  Then it has a method take_energy for these, which names the next one.
        couples: whether its scalar is an energy that it took from the system, which LAMMPS's
            econserve counts.
        restart_state: (n,) what a restart file keeps, or None: made in __init__, and never replaced
            by another array. The first number, above 0, says what the others are. It is -1 if the
            file has another one there, and the others stay as they were made.
        freedom_said: what the log adds on the degrees of freedom that its thermostat acts on.
        modules: names of modules whose loops it needs, besides those of its classes.

    The box:
        box_every: it changes in the steps after the multiples of this; 0 for never.
        flips: whether tilts of the box change, so that it may take other vectors of its lattice.

    Loops of the splitting:
        advance, go_on: the passes of a step.
        lead, tail: what stands before the motion, and behind the forces, by itself.
        start: of `starts`.
    """

    splitting, rows, kept, work = "", 0, 0, 0
    operations: Mapping[str, step.Operation] = {}
    numbers: Kind = Parameters
    starts: Callable | None = None
    prepares: Loop | None = None
    unprepared, mid_step = "", False
    advance: Loop
    go_on: Loop | None = None
    lead: Loop
    tail: Loop
    start: Loop | None = None

    method, splits, respa = "", False, True
    keywords: tuple[str, ...] = ()
    own_keywords: Mapping[str, str] = MappingProxyType({})
    thermostat: object = None
    crosses = needs_energy = couples = False
    backwards, freedom_said = True, ""
    restart_state: np.ndarray | None = None
    modules: tuple[str, ...] = ()
    box_every, flips = 0, False

    def __init_subclass__(cls) -> None:
        if cls.splitting and not vars(cls).keys().isdisjoint(_OF_LOOPS):
            scheme = step.Scheme(
                (cls.__module__, cls.__qualname__),
                cls.splitting, cls.operations, cls.numbers, cls.rows, cls.starts,
            )  # fmt: skip
            if scheme.prepared and cls.prepares is None:
                raise ValueError(
                    f"{cls.__name__}: an operation is prepared, and there is no loop `prepares`"
                )
            cls.advance, cls.go_on, cls.start = scheme.advance, scheme.go_on, scheme.start
            cls.lead, cls.tail = scheme.lead, scheme.tail
            cls.crosses = vars(cls).get("crosses", False)  # of each motion by itself

    def own_parameters(self) -> dict[str, Any]:
        """Its parameters, besides those of `operations`: a dictionary from fields of `numbers`;
        asked when a run begins.  Fields that it does not name are 0."""
        return {}

    def own_cells(self) -> dict[str, Cell]:
        """A dictionary of the cells that its own loops take."""
        return {}

    def own_lists(self, cells: dict[str, Cell]) -> dict[str, list]:
        """Lists of loops of its own, by name, bound to cells; see `passes`."""
        return {}

    def own_values(self) -> Sequence[float]:
        """Values of f_ID[i] behind those of all integrators, of which `vector_extensive` says
        whether each counts the bodies; collective."""
        return ()

    def own_warnings(self) -> Iterable[str]:
        """Lines for the log on what is probably not meant; collective."""
        return ()

    def turned_over(self) -> None:
        """There are other bodies than before, in a run; collective."""

    def resumed(self) -> None:
        """A run's first step begins without a setup before it; collective.

        So it is with 'pre no', and always with a LAMMPS's own fix.
        """

    def write_restart(self) -> None:
        """LAMMPS writes a restart file: have `restart_state` ready for it; collective."""

    def begin_trajectory(self) -> None:
        """The step ``host.begins`` is about to begin; collective."""

    def complaint(self, found: int) -> str:
        """Why a loop that returned a number below 0 ends the run."""
        return self.unprepared
