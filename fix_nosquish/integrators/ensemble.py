"""Ensembles: a splitting with a thermostat and a barostat put in.

The step is B A O A B: half a kick, drift and free rotation for half a step, the thermostat, the
same again; see `thermostat`.  A piston is another letter, see `mtk`.

At the end of a step velocities are too cold, by the square of the step.  So atoms have those of its
middle then, which are right, and temperature and pressure follow from these.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from importlib import import_module
from typing import Any
from zlib import crc32

import numpy as np

from ..errors import refuse
from ..host import rigid_fixes
from ..host.command import Command
from ..host.hosts import hook
from ..loops.compiled import F1, L1, Cell, F, record
from ..run.integrator import Integrator
from .momentum import Momentum
from .thermostat import Part, Thermostat, key_of

Kept = record(
    "Kept",
    kind=F,  # what the rest is
    energy=F,  # that the bodies have given to the thermostat
    times_back=F,  # how often the step counter has gone back, and where it was
    was_at=F,
    waiting=F,  # as that of `Integrator`, nan for None
)  # in a restart file, where the thermostat's own state is behind
OWN = len(Kept.dtype.fields or ())
TEMPERATURE = "temp", "thermostat", "seed", "tchain", "separate", "moments"  # words


class Ensemble(Integrator):
    """An integrator with a thermostat, a barostat, or both.

    A derived class says by the words of which keyword which ones it has: a class, or, of this
    package, its module and name.  Where there is one only, no word is needed.

    Attributes:
        thermostats, barostats: see above.
        thermostat, barostat: those of the fix line; None for no thermostat, and a `Part` that does
            nothing for no barostat.  parts: both, if they are there.
        momentum: the `Momentum`.
        restart_state: (n,) what goes to a restart file and comes from there; its energy is nan if
            nothing has come.  kept_state: the record at its begin; behind it is the state of the
            piston, and that of the thermostat.

    Raises:
        RunError: for words that do not go together, and if no motion is left to keep at a
            temperature.
    """

    thermostats: Mapping[str, Any] = {}
    barostats: Mapping[str, Any] = {}
    mid_step = True
    host: Any
    parameters: Any
    restart_state: np.ndarray

    def follow_words(self) -> None:
        self.thermostat: Thermostat | None = self._made(self.thermostats, "thermostat")
        self.barostat: Part = self._made(self.barostats, "barostat") or Part(self)
        self.momentum = Momentum(self)
        kind = type(self.thermostat) if self.thermostat else Thermostat
        self.momentum.kept = kind.keeps_momentum
        scheme, self.prepares = self.barostat.step_with(kind)
        self.operations, self.numbers, self.work = scheme.operations, scheme.numbers, scheme.work
        self.advance, self.go_on = scheme.advance, scheme.go_on
        self.lead, self.tail = scheme.lead, scheme.tail
        self.parts: list[Part] = [self.barostat, *([self.thermostat] if self.thermostat else [])]
        self.modules = (
            *(one.__module__ for part in self.parts for one in type(part).__mro__),
            *self.barostat.modules,
            *(one.module for one in (self.prepares, self.advance, self.lead)),
        )
        within = self.thermostat and f" with {self.thermostat.method} in the middle of the step"
        self.method = f"NO_SQUISH{within or ''}{self.barostat.method}"
        self.splits = self.has_piston or not kind.merged
        self.respa, self.box_every = not self.barostats, int(bool(self.barostats))
        self.backwards = kind.reversible and not self.barostats
        # not in the place of a fix rigid with keyword langevin, whose scalar is a temperature
        self.couples = self.command.line.replaces not in rigid_fixes.BODIES
        self.flips = self.barostat.flips
        states = [np.zeros(part.state_size) for part in self.parts]
        self.restart_state = np.concatenate([[self.kind, np.nan, 0.0, -1.0, np.nan], *states])
        self.kept_state, behind = Kept.of(self.restart_state), self.restart_state[OWN:]
        for part in self.parts:
            part.state, behind = behind[: part.state_size], behind[part.state_size :]
        self._energy = 0.0  # given before this run, in all

    def _made(self, choices: Mapping[str, Any], keyword: str) -> Any:
        """What the word of a keyword stands for; None where there is nothing to choose."""
        if not choices:
            return None
        word = getattr(self.command, keyword)
        if len(choices) == 1 and word == getattr(Command, keyword):  # the default of another choice
            (word,) = choices
        if word not in choices:
            known = " or ".join(choices)
            raise self.command.wrong(f"keyword {keyword} is {word}, and this fix has {known}")
        what = choices[word]
        if isinstance(what, str):
            module, _, name = what.partition(".")
            what = getattr(import_module(f".{module}", __package__), name)
        return what(self)

    # ------------------------------------------------------------- of what it is made

    @property
    def has_piston(self) -> bool:
        return self.barostat.state_size > 0

    @property
    def kind(self) -> float:
        """A number for what its own state is of."""
        command = self.command
        length = command.tchain if command.thermostat == "nh" else 0
        thermostat = type(self.thermostat)
        words = thermostat.__module__, thermostat.__qualname__, length, command.separate
        words = *words, *self.barostat.own_words()
        return 1.0 + crc32(" ".join(map(str, (OWN, *words))).encode())

    def own_warnings(self) -> Iterator[str]:
        for part in (self.momentum, *self.parts):
            yield from part.warnings()

    def complaint(self, found: int) -> str:
        """Why what `prepares` or a change of the box returned ends the run."""
        return "".join(part.complaint(found) for part in self.parts)

    def own_cells(self) -> dict[str, Cell]:
        begin, end = self.host.span or (np.zeros(1, np.int64), np.zeros(1, np.int64))
        cells = {
            "step": self.lammps.step_cell, "begin_step": Cell(L1, begin), "end_step": Cell(L1, end),
            "own_state": Cell(F1, self.parts[-1].state),
        }  # fmt: skip
        for part in self.parts:
            cells |= part.own_cells()
        return cells

    def own_lists(self, cells: dict[str, Cell]) -> dict[str, list]:
        return self.barostat.own_lists(cells)

    def turned_over(self) -> None:
        for part in self.parts:
            part.turned_over()

    # ------------------------------------------------------------- a run

    def temperature(self) -> tuple[float, float, float]:
        """The temperature at the begin and at the end of the run, and the rate of damping."""
        if not self.thermostat:
            return 0.0, 0.0, 0.0
        start, stop, damping = (self.lammps.number(word) for word in self.command.temp)
        cools = self.thermostat.takes_zero and not self.has_piston
        for name, value in ("TSTART", start), ("TSTOP", stop), ("TDAMP", damping):
            if value or not cools or name == "TDAMP":
                self.command.refuse_unless_positive(f"keyword temp: {name}", value)
        return start, stop, 1.0 / damping

    @hook
    def reset_target(self, temperature: float) -> None:
        """Keep this temperature from now on."""
        self.command = replace(self.command, temp=(*(repr(temperature),) * 2, self.command.temp[2]))
        if self.parameters is not None:
            unit = self.lammps.boltz / self.lammps.mvv2e
            self.parameters.start = self.parameters.stop = unit * temperature

    def own_parameters(self) -> dict[str, Any]:
        start, stop, rate = self.temperature()
        refuse(
            start != stop and self.host.span is None,
            "keyword temp: a LAMMPS's own fix python/move does not tell where a run ends, "
            "so TSTART and TSTOP must be the same",
        )
        self._refuse_parts_of_rotations()
        self._take_kept_state()
        unit = self.lammps.boltz / self.lammps.mvv2e
        key_0, key_1 = key_of(self.command, self.kept_state.times_back, self.host.world)
        own = {
            "rate": rate, "start": unit * start, "stop": unit * stop, "kt": unit * start,
            "step": -1, "key_0": key_0, "key_1": key_1, "factor": 1.0,
        }  # fmt: skip
        for part in self.parts:
            own |= part.own_parameters()
        return own

    def _take_kept_state(self) -> None:
        """Go on with what a restart file, or the last run, has left."""
        kept = self.kept_state
        if kept.kind != self.kind:
            self.host.log(
                "WARNING: the restart file has the state of another thermostat or barostat: "
                "this one begins anew\n"
            )
            kept.kind = self.kind
        elif self.parameters is not None:  # what a restart file got meanwhile is of an earlier step
            self._energy = self.energy()
            if self.parameters.step >= 0:  # else there was no step since this was last asked
                kept.was_at = self.parameters.step
        elif np.isfinite(kept.energy):
            self._energy = kept.energy
            self.waiting = None if np.isnan(kept.waiting) else kept.waiting
        if self.lammps.step < kept.was_at:
            kept.times_back += 1
            kept.was_at = self.lammps.step

    def _refuse_parts_of_rotations(self) -> None:
        """End the run if some but not all components of a torque act; collective."""
        if self.mask is None or self.lammps.dimension == 2:
            return
        refuse(
            self.communicator.any((self.mask[3:] != self.mask[3]).any()),
            "keyword torque has one component off and another one on, and a thermostat acts on "
            "the whole rotation of a body, or not at all: switch off all three, or use "
            "fix nosquish/nve",
        )

    def start_run(self) -> None:
        """As of `Integrator`; an error for what the barostat cannot move."""
        self.barostat.refuse_cut_clusters()
        super().start_run()

    def resumed(self) -> None:
        last = max(self.parameters.step, self.kept_state.was_at)
        refuse(
            self.command.seed is not None and self.lammps.step <= last,
            "the step counter has gone back, and with it random numbers: "
            "begin the run with 'pre yes', which takes others",
        )

    def end_run(self) -> None:
        """As of `Integrator`; say if the total momentum was taken as constant and has changed."""
        super().end_run()
        if self.thermostat:
            self.momentum.look_again()

    def energy(self) -> float:
        """The energy that the bodies have given to the thermostat, in mass times velocity squared;
        collective."""
        return self._energy - self.communicator.total(np.array([self.parameters.heat]))[0]

    @hook
    def compute_scalar(self) -> float:
        """What the potential energy and that of the atoms' velocities have to be added to make the
        energy that a right step keeps: what went to the thermostat, and what the bodies' kinetic
        energy is more at the end of the step than in its middle; with a piston, its energy and its
        work, too; or, where it does not `couple`, the temperature of the bodies; collective."""
        if self.couples:
            end, middle = self.kinetic_at_end()
            scalar = self.lammps.mvv2e * self.energy() + end - middle
        else:
            scalar = super().compute_scalar()
        return self.barostat.with_energy(scalar)

    @hook
    def write_restart(self) -> None:
        """LAMMPS writes a restart file: have the state ready for it; collective."""
        if self.passes:  # else it is what the last restart file had
            kept = self.kept_state
            kept.energy, kept.was_at = self.energy(), self.lammps.step
            self.stepped |= self.steps_made
            self.note_waiting()
            kept.waiting = np.nan if self.waiting is None else self.waiting
