"""What an integrator declares of its step; loops, memory and messages follow from it."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from ..errors import refuse
from ..host.command import Command
from ..loops.compiled import Kind, Loop
from ..motion import step
from ..motion.operations import Parameters
from . import former_names
from .part import Declaration

_OF_LOOPS = "splitting", "operations", "rows", "starts"


class Integrator(Declaration):
    """What a class derived from this one may declare, and the defaults.

    It is made for each fix.  Methods that are called in a run get the `run.Run` as `run`: it has
    the bodies, LAMMPS, the ranks and the other fixes.

    Args:
        command: the words of the fix line, a `command.Command`.
        dimension: of the simulation, 3 or 2.

    The step:
        splitting, operations: the letters of a step and what they do; see `step.stages`.
        numbers: the record of the parameters that its operations take: `operations.Parameters`, or
            one that extends it. A class with the operations of another one extends the other's.
        rows: how many additional values each body has; they go where the body goes, and begin as
            0. In a block they are the rows from BLOCK_ROWS on.
        kept: how many more values go where the body goes, after its rows in the state, which
            operations do not see.
        work: how many more rows of a block its operations need as scratch space.
        starts: sets its rows when the forces of the start are known, or None: a function as in an
            operation, inlined.
        prepares: a loop that sets parameters for the letter that is `prepared`, or None; it returns
            0, or less to end the run with the message `failure`.
        mid_step: whether the velocities that atoms have at the end of a step are those of its
            middle, before the letters after the forces: with a thermostat there, these are the
            right ones.  Not with run_style respa.
        scheme: the loops of the splitting, a `step.Scheme`.

    What it supports:
        splits: whether the keywords mrot and order have a meaning.  Keyword rotor exact needs an
            operation that is `exact`.
        keywords: which of `command.OWN_KEYWORDS` it has, besides `command.KEYWORDS`.
        extra_keywords: others, each followed by a number: from their names to the meaning, for
            messages. `run.number` has the number.
        respa: whether it supports run_style respa.
        thermostat: what keeps a temperature, so that no other fix may; None for nothing.
        supports_remap_v: whether the velocity of a body may change where it crosses a face, as with
            remap v of fix deform. A class with operations of its own declares it again.
        scalar: None, or a method (run) that returns the energy which has left the system, in
            LAMMPS's unit; its econserve counts it.  Without it f_ID is the temperature of the
            bodies.
        values: the names of additional values of f_ID[i], and whether each is extensive.
        restart_state: (n,) what a restart file keeps, or None: made in __init__, and never replaced
            by another array. The first number, above 0, says what the others are. It is -1 if the
            file has another one there, and the others stay as they were made.
        parts: the `part.Part` objects that it consists of.
    """

    splitting, rows, kept, work = "", 0, 0, 0
    operations: Mapping[str, step.Operation] = {}
    numbers: Kind = Parameters
    starts: Callable | None = None
    prepares: Loop | None = None
    mid_step = False
    scheme: step.Scheme

    splits, respa, supports_remap_v = False, True, False
    keywords: tuple[str, ...] = ()
    extra_keywords: Mapping[str, str] = MappingProxyType({})
    thermostat: object = None
    scalar: Callable[[Any], float] | None = None
    values: Mapping[str, bool] = MappingProxyType({})
    restart_state: np.ndarray | None = None
    parts: Sequence[Any] = ()

    def __init__(self, command: Command, dimension: int) -> None:
        self.command, self.dimension = command, dimension

    def __init_subclass__(cls) -> None:
        former_names.refuse_removed(cls)
        super().__init_subclass__()
        if cls.splitting and not vars(cls).keys().isdisjoint(_OF_LOOPS):
            cls.scheme = step.Scheme(
                (cls.__module__, cls.__qualname__),
                cls.splitting, cls.operations, cls.numbers, cls.rows, cls.starts,
            )  # fmt: skip
            refuse(
                cls.scheme.prepared and cls.prepares is None,
                f"{cls.__name__}: an operation is prepared, and there is no loop `prepares`",
            )
            cls.supports_remap_v = vars(cls).get("supports_remap_v", False)

    def extra_values(self, run: Any) -> Sequence[float]:
        """The additional `values` of f_ID[i], in LAMMPS's units; collective."""
        return ()

    def prepare_restart(self, run: Any) -> None:
        """LAMMPS writes a restart file, after a run has begun: update `restart_state`;
        collective."""
