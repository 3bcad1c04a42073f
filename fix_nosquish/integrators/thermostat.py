"""Thermostats, which act in the middle of a step.

A thermostat is letter O of the splitting B A O A B.  Its position limits the time step: in the
middle, configurations have the correct distribution up to steps three to four times as long as with
a thermostat at the ends (Davidchack, Ouldridge and Tretyakov, J. Chem. Phys. 142, 144114, 2015;
Leimkuhler and Matthews, Proc. R. Soc. A 472, 20160138, 2016; Zhang et al., J. Phys. Chem. A 123,
6056, 2019).

`langevin`, `csvr` and `nose_hoover` implement one each; `nvt.THERMOSTATS` is the list.
"""

import weakref
from collections.abc import Callable, Iterable
from dataclasses import replace
from math import exp, sqrt
from typing import Any, ClassVar, NamedTuple
from zlib import crc32

import numpy as np

from ..errors import refuse
from ..host.command import Command
from ..loops.compiled import F1, L1, F, I, Kind, Loop, inlined, record, untyped
from ..motion.operations import Parameters
from ..motion.philox import normal_pair, words
from ..motion.step import Operation, Scheme
from ..ranks.mpi import Mpi
from ..run.part import Part
from ..run.run import Run
from .nve import NVE

Bath: Any = record(
    "Bath",
    Parameters,
    rate=F,  # 1 / damping time
    start=F,  # k T at the start of the run, at its end and at present, in mass times velocity
    stop=F,  # squared
    kt=F,
    step=I,  # step of the last random numbers, and index of its next draw
    draw=I,
    key_0=I,  # key of random numbers
    key_1=I,
    heat=F,  # energy that this rank has added to the bodies, in that unit, too
    factor=(F, 2),  # last factors of velocities and of angular momenta
)
BODY, ALL_BODIES = 0, 1  # purpose of random numbers: for one body, for the system
# random numbers for the system: first number of translation (or all) and rotation; of the barostat
OF_THERMOSTATS, OF_BAROSTAT = (0, 1024 * 1024), 3 * 1024 * 1024


MOST_STEPS = 5e4  # largest number of steps per TDAMP without a warning


class Steps(NamedTuple):
    """The present step, and the first and last step of the run, (1,) each."""

    step: L1
    begin_step: L1
    end_step: L1


@inlined
def part_of_run(steps):
    """The fraction of the run that is over."""
    length = steps.end_step[0] - steps.begin_step[0]
    return (steps.step[0] - steps.begin_step[0]) / length if length > 0 else 0.0


@inlined
def set_temperature(parameters, steps):
    """Set the temperature of this step, and the index of its next draw.

    Returns:
        as `part_of_run`.
    """
    part = part_of_run(steps)
    parameters.kt = parameters.start + part * (parameters.stop - parameters.start)
    parameters.draw = parameters.draw + 1 if parameters.step == steps.step[0] else 0
    parameters.step = steps.step[0]
    return part


def key_of(command: Command, times_back: float, world: int) -> tuple[int, int]:
    """The key of a fix's random numbers.

    It is different for fixes and for worlds of a partition, because their bodies may have the same
    IDs, and each time the step counter is set back, because steps then repeat.
    """
    whose = " ".join((command.group, command.style, *command.arguments))
    if world:
        whose += f", world {world}"
    if times_back:
        whose += f", {times_back:.0f}"
    return command.seed or 0, crc32(whose.encode()) & 0xFFFFFFFE


@inlined
def words_of_all(parameters, number):
    """Four random words for the system, of this number in this step and draw."""
    key_1 = parameters.key_1 | ALL_BODIES
    return words(float(number), parameters.step, parameters.draw, parameters.key_0, key_1)


# ---------------------------------------------------------------- parts of a thermostat


@inlined
def nothing(mpi, parameters, state, dt, gained):
    """The default of `Thermostat.acts`: nothing depends on sums over all bodies."""
    return 0


@inlined
def not_on_piston(mpi, parameters, cell, state, dt):
    """The default of `Thermostat.on_piston`."""


@inlined
def thermalise_piston(mpi, parameters, cell, state, dt):
    """Apply friction and noise to the strain rates, for the whole time of a change of the box."""
    barostat, rates = cell.barostat, cell.piston.rates
    keep = exp(-barostat.rate * dt * barostat.box_every)
    for group in range(rates.size):
        inertia, before = barostat.inertia[group], rates[group]
        if inertia > 0.0:
            w0, w1, _, _ = words_of_all(parameters, OF_BAROSTAT + group)
            noise, _ = normal_pair(w0, w1)
            heat = parameters.kt * barostat.unit
            spread = sqrt((1.0 - keep * keep) * heat / inertia)
            rates[group] = keep * before + spread * noise
            note_heat(mpi, parameters, barostat, group, before, rates[group])


@inlined
def note_heat(mpi, parameters, barostat, group, before, after):
    """Add the energy that a thermostat adds to a strain rate to the heat of rank 0."""
    if mpi.rank == 0:
        heat = 0.5 * barostat.inertia[group] * (after * after - before * before)
        parameters.heat += heat / barostat.unit


def far_off(name: str, time: float, lammps: Any, most: float) -> Iterable[str]:
    """A warning of a damping time below one time step or above `most` time steps, which may be in
    another unit of time than LAMMPS's."""
    steps = time / abs(lammps.dt) if lammps.dt else 1.0
    if not 1.0 <= steps <= most:
        yield (
            f"WARNING: {name} {time:g} is {steps:.3g} time steps of {lammps.dt:g}, and 100 to "
            f"10000 are usual: it is in the unit of time of units {lammps.units}"
        )


class EnsemblePart(Part):
    """A thermostat or a barostat of an ensemble; this class does nothing.

    Args:
        ensemble: the `ensemble.Ensemble` that it belongs to.

    Attributes:
        keywords: which of `command.OWN_KEYWORDS` it uses, so that its ensemble has them.  If "seed"
            is among them it must be given: leave it out if nothing is drawn.
        state_size: number of values that a restart needs.
        state: these values, a view of `Ensemble.restart_state`.
    """

    keywords: ClassVar[tuple[str, ...]] = ()
    state: np.ndarray

    def __init__(self, ensemble: Any) -> None:
        self.ensemble: Any = weakref.proxy(ensemble)

    @property
    def command(self) -> Command:
        """The words of the fix line."""
        return self.ensemble.command

    @property
    def state_size(self) -> int:
        return 0

    @classmethod
    def step_with(cls, thermostat: type["Thermostat"], module: str) -> tuple[Scheme, Loop]:
        """The step with a thermostat, and the loop that prepares it.

        Args:
            module: name of the module that new loops belong to.
        """
        return thermostat.scheme, thermostat.prepares

    def kind_of_state(self) -> tuple:
        """What identifies the kind of its state in a restart file, besides its class."""
        return ()

    def with_energy(self, scalar: float) -> float:
        """The scalar plus the energy of this part; collective."""
        return scalar


def instability(run: Run, what: str, advice: str) -> str:
    """A message on an instability in this step, with the advice, or with the diagnosis of the start
    of the run if atoms overlapped there."""
    start, step = run.bodies.start, run.lammps.step
    if start.explains(step):
        advice = f"{start.diagnosis}: {start.advice}"
    return f"{what} at step {step}: {advice}"


class Thermostat(EnsemblePart):
    """The base class of thermostats, with the declarations of a derived class.

    To add one, declare `operation`, or derive it from `rescaling.Rescaling` and set `acts` by
    `scaling_by`; declare `method`, and `keywords` if it draws nothing; and name it in
    `nvt.THERMOSTATS`, for fix nosquish/nvt and fix nosquish/npt.  The step, the loops, the keywords
    of the fix line, econserve and restart files follow.  A restart file has a hash of the module
    and the name of the class, see `Ensemble`: renaming them makes the state begin anew.

    Attributes:
        operation: letter O, an `Operation` that is `prepared`.
        merged: an operation that does A O A as one, or None.
        numbers: the record of their parameters; `Bath` or one that extends it.
        work: number of scratch rows of a block that they need.
        acts: inlined function (mpi, parameters, state, dt, gained), called once a step before O.
            `state` is the thermostat's state (`state_size` numbers, not that of bodies), dt the
            time step, and `gained` the increase of twice the kinetic energy since O's `measures`.
            It returns 0, or a negative value to end the run with `failure`.
        on_piston: inlined function (mpi, parameters, cell, state, dt) that acts on the strain rates
            of a piston in steps in which the box changes, and calls `note_heat`; by default
            nothing.  `thermalise_piston` draws random numbers, so it needs the keyword seed.
        scheme, prepares: the step at constant volume and the loop before O, derived from these.

        keeps_momentum: whether it keeps a total momentum of zero.
        freedom_note: text for the log on its degrees of freedom.
        takes_zero: whether a temperature of zero is possible.
    """

    operation: ClassVar[Operation | None] = None
    merged: ClassVar[Operation | None] = None
    numbers: ClassVar[Kind] = Bath
    work: ClassVar[int] = 0
    acts: ClassVar[Callable] = nothing
    on_piston: ClassVar[Callable] = not_on_piston
    scheme: ClassVar[Scheme]
    prepares: ClassVar[Loop]
    keywords: ClassVar[tuple[str, ...]] = ("seed",)
    keeps_momentum, reversible, takes_zero = True, False, False
    freedom_note = ""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        declared, owner = vars(cls).keys(), (cls.__module__, cls.__qualname__)
        if cls.operation and declared & {"operation", "merged", "numbers", "work"}:
            letters, operations = "B A O A B", {"O": cls.operation}
            if cls.merged:
                letters, operations = "B A B", {"A": cls.merged}
            cls.scheme = Scheme(
                owner, letters, {**NVE.operations, **operations}, cls.numbers,
                work=cls.work, ends=(NVE.scheme.lead, NVE.scheme.tail),
            )  # fmt: skip
        # a class that measures bodies may leave `acts` to a derived class
        complete = cls.operation and not (cls.operation.measures and cls.acts is nothing)
        if complete and declared & {"acts", "numbers", "operation"}:
            cls.prepares = _preparing_loop(cls, owner)

    def kind_of_state(self) -> tuple:
        return 0, self.command.separate  # no chain, see `nose_hoover`

    def extra_warnings(self, run: Run) -> Iterable[str]:
        """A warning of an unusual TDAMP."""
        damping = run.lammps.number(self.command.temp[2])
        return far_off("TDAMP", damping, run.lammps, MOST_STEPS)

    def resume(self, run: Run) -> None:
        last = max(run.parameters.step, self.ensemble.restart_record.last_step)
        refuse(
            self.command.seed is not None and run.lammps.step <= last,
            "the step counter has gone back, and with it random numbers: "
            "begin the run with 'pre yes', which takes others",
        )

    def reset_target(self, temperature: float, run: Run) -> None:
        words = (*(repr(temperature),) * 2, self.command.temp[2])
        self.ensemble.command = replace(self.command, temp=words)
        if run:
            unit = run.lammps.boltz / run.lammps.mvv2e
            run.parameters.start = run.parameters.stop = unit * temperature


def _preparing_loop(thermostat: type[Thermostat], owner: tuple[str, str]) -> Loop:
    """The loop before letter O, at constant volume."""
    acts = thermostat.acts

    @untyped
    def prepares(
        mpi: Mpi, parameters: thermostat.numbers, dt: F, steps: Steps,
        thermostat_state: F1,
    ) -> I:  # fmt: skip
        """Set the temperature of the step, and the parameters of letter O."""
        set_temperature(parameters, steps)
        return acts(mpi, parameters, thermostat_state, dt, 0.0)

    return Loop(prepares, owner)
