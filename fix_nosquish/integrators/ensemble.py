"""Ensembles: a splitting with a thermostat and a barostat inserted.

The step is B A O A B: half kick, drift and free rotation for half a step, the thermostat, and the
same in reverse order; see `thermostat`.  A piston adds a letter, see `mtk`.

The temperature of the velocities at the end of a step has an error of second order in the step.
Atoms therefore get the velocities of the middle of the step, which have the correct distribution,
and temperature and pressure are computed from these.
"""

from collections.abc import Mapping
from typing import Any
from zlib import crc32

import numpy as np

from ..errors import refuse
from ..host.command import Command
from ..host.lammps import Lammps
from ..loops.compiled import F1, L1, Cell, F, record
from ..ranks.communicator import Ranks
from ..run.integrator import Integrator
from ..run.run import Run
from .momentum import Momentum
from .thermostat import EnsemblePart, Thermostat, key_of

RestartState: Any = record(
    "RestartState",
    kind=F,  # hash of the kind of thermostat and barostat
    energy=F,  # transferred from the bodies to the thermostat
    times_back=F,  # how often the step counter was set back, and its last value
    last_step=F,
    pending=F,  # `Setting.pending_half_kick`, nan for None
)  # in a restart file, followed by the states of barostat and thermostat
FIELDS = len(RestartState.dtype.fields or ())
TEMPERATURE = "temp", "thermostat", "moments"  # keywords, besides those of each thermostat


class Ensemble(Integrator):
    """An integrator with a thermostat, a barostat, or both.

    A derived class maps the values of a keyword to the classes of thermostats and barostats.  The
    first one is the default.

    It does not support remap v of fix deform: its thermostat is at rest, and would act on the flow
    that velocities then contain.

    Attributes:
        thermostats, barostats: see above.
        keywords: as in `Integrator`, and all those of its thermostats and barostats.
        of_parts: keywords that only some of these have; with another one they are refused.
        thermostat, barostat: those of the fix line; without a thermostat None, without a barostat
            an `EnsemblePart` that does nothing.
        momentum: the `Momentum`.
        restart_state: (n,) contents of a restart file; its energy is nan if none was read.
        restart_record: the record at its beginning; the states of piston and thermostat follow.

    Raises:
        RunError: for keywords that cannot be combined, and if the thermostat has no degrees of
            freedom.
    """

    thermostats: Mapping[str, type[Thermostat]] = {}
    barostats: Mapping[str, type[EnsemblePart]] = {}
    of_parts: tuple[str, ...] = ()
    mid_step = True
    restart_state: np.ndarray

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        parts = *cls.thermostats.values(), *cls.barostats.values()
        words = [word for part in parts for word in part.keywords]
        cls.of_parts = tuple(dict.fromkeys((*cls.of_parts, *words)))
        cls.keywords = tuple(dict.fromkeys((*cls.keywords, *cls.of_parts)))
        for barostat in cls.barostats.values():  # make the loops of all combinations
            for thermostat in cls.thermostats.values() or (Thermostat,):
                barostat.step_with(thermostat, cls.__module__)

    def __init__(self, command: Command, dimension: int) -> None:
        super().__init__(command, dimension)
        thermostat = self._choice(self.thermostats, "thermostat")
        self.thermostat: Thermostat | None = thermostat and thermostat(self)
        self.barostat = (self._choice(self.barostats, "barostat") or EnsemblePart)(self)
        self._check_keywords()
        kind = thermostat or Thermostat
        self.momentum = Momentum(kind.keeps_momentum, self.thermostat)
        self.scheme, self.prepares = self.barostat.step_with(kind, self.__module__)
        self.numbers, self.work = self.scheme.numbers, self.scheme.work
        of_ensemble = [self.barostat, *([self.thermostat] if self.thermostat else [])]
        self.parts = [self.momentum, *of_ensemble]
        within = self.thermostat and f" with {self.thermostat.method} in the middle of the step"
        self.method = f"NO_SQUISH{within or ''}{self.barostat.method}"
        self.splits = self.has_piston or not kind.merged
        self.respa = not self.barostats
        states = [np.zeros(part.state_size) for part in of_ensemble]
        self.restart_state = np.concatenate([[self._kind, np.nan, 0.0, -1.0, np.nan], *states])
        self.restart_record, rest = RestartState.of(self.restart_state), self.restart_state[FIELDS:]
        for part in of_ensemble:
            part.state, rest = rest[: part.state_size], rest[part.state_size :]
        self._energy = 0.0  # transferred before this run, summed over ranks
        self._targets = 0.0, 0.0, 0.0

    def _choice(self, choices: Mapping[str, type], keyword: str) -> Any:
        """The class that a keyword selects, by default the first one; None without choices."""
        word = getattr(self.command, keyword) or next(iter(choices), None)
        if word and word not in choices:
            raise self.command.wrong(
                f"keyword {keyword}: '{word}' was given where one of {', '.join(choices)} is "
                "expected"
            )
        return word and choices[word]

    def _check_keywords(self) -> None:
        """Raise an error for keywords that no part uses, or that are missing."""
        thermostat, barostat = self.thermostat or EnsemblePart(self), self.barostat
        used = *thermostat.keywords, *barostat.keywords
        for word in self.of_parts:
            if word not in used and getattr(self.command, word):
                raise self.command.wrong(
                    f"keyword {word} has no effect with {thermostat.method}{barostat.method}: "
                    "leave it out"
                )
        needed = ["temp"] * bool(self.thermostat) + ["seed"] * ("seed" in used)
        part = "thermostat" if "seed" in thermostat.keywords else "barostat"
        self.command.refuse_missing(*needed, seed=f", because this {part} draws random numbers")

    @property
    def has_piston(self) -> bool:
        return self.barostat.state_size > 0

    @property
    def _kind(self) -> float:
        """A hash of the kind of thermostat and barostat, to which the state belongs."""
        thermostat = self.thermostat
        state = thermostat.kind_of_state() if thermostat else (0, False)
        kind = type(thermostat)
        words = kind.__module__, kind.__qualname__, *state, *self.barostat.kind_of_state()
        return 1.0 + crc32(" ".join(map(str, (FIELDS, *words))).encode())

    def failure(self, found: int, run: Run) -> str:
        return "".join(part.failure(found, run) for part in self.parts)

    def temperature(self) -> tuple[float, float, float]:
        """TSTART, TSTOP and 1 / TDAMP at the start of the run."""
        return self._targets

    def _find_targets(self, lammps: Lammps) -> tuple[float, float, float]:
        if not self.thermostat:
            return 0.0, 0.0, 0.0
        start, stop, damping = (lammps.number(word) for word in self.command.temp)
        cools = self.thermostat.takes_zero and not self.has_piston
        for name, value in ("TSTART", start), ("TSTOP", stop), ("TDAMP", damping):
            if value or not cools or name == "TDAMP":
                self.command.refuse_unless_positive(f"keyword temp: {name}", value)
        return start, stop, 1.0 / damping

    def extra_parameters(self, run: Run) -> dict[str, Any]:
        lammps = run.lammps
        self._targets = start, stop, rate = self._find_targets(lammps)
        if start != stop:
            run.host.need("end of the run")
        if run.mask is not None and lammps.dimension == 3:
            _refuse_parts_of_rotations(run.mask, run.ranks)
        self._continue_state(run)
        unit = lammps.boltz / lammps.mvv2e
        key_0, key_1 = key_of(self.command, self.restart_record.times_back, run.host.world)
        return {
            "rate": rate, "start": unit * start, "stop": unit * stop, "kt": unit * start,
            "step": -1, "key_0": key_0, "key_1": key_1, "factor": 1.0,
        }  # fmt: skip

    def extra_cells(self, run: Run) -> dict[str, Cell]:
        begin, end = run.host.span or (np.zeros(1, np.int64), np.zeros(1, np.int64))
        return {
            "step": run.lammps.step_cell, "begin_step": Cell(L1, begin), "end_step": Cell(L1, end),
            "thermostat_state": Cell(F1, self.parts[-1].state),  # unused without a thermostat
        }  # fmt: skip

    def _continue_state(self, run: Run) -> None:
        """Continue with the state of a restart file, or of the last run."""
        state = self.restart_record
        if state.kind != self._kind:
            run.host.log(
                "WARNING: the restart file has the state of another thermostat or barostat: "
                "this one begins anew\n"
            )
            state.kind = self._kind
        elif run.parameters is not None:  # the state in a restart file may be of an earlier step
            self._energy, run.parameters.heat = self._energy_given(run), 0.0
            if run.parameters.step >= 0:  # otherwise there was no step since the last call
                state.last_step = run.parameters.step
        elif np.isfinite(state.energy):
            self._energy = state.energy
            run.setting.pending_half_kick = None if np.isnan(state.pending) else state.pending
        if run.lammps.step < state.last_step:
            state.times_back += 1
            state.last_step = run.lammps.step

    def _energy_given(self, run: Run) -> float:
        """The energy transferred from the bodies to the thermostat, in mass times velocity squared;
        collective."""
        return self._energy - run.ranks.total(np.array([run.parameters.heat]))[0]

    def scalar(self, run: Run) -> float:
        """The energy to add to the potential and kinetic energy of the atoms to obtain the
        conserved energy; collective.

        It is the energy transferred to the thermostat plus the bodies' kinetic energy at the end of
        the step minus that in the middle; with a piston, also its energy and its work.
        """
        end, middle = run.kinetic_at_end()
        scalar = run.lammps.mvv2e * self._energy_given(run) + end - middle
        return self.barostat.with_energy(scalar)

    def prepare_restart(self, run: Run) -> None:
        state = self.restart_record
        state.energy, state.last_step = self._energy_given(run), run.lammps.step
        run.stepped |= run.steps_made
        run.note_pending()
        pending = run.setting.pending_half_kick
        state.pending = np.nan if pending is None else pending


def _refuse_parts_of_rotations(mask: np.ndarray, ranks: Ranks) -> None:
    """Raise an error if some but not all components of a torque are active; collective.

    Args:
        mask: see `switches.mask`.
    """
    refuse(
        ranks.any((mask[3:] != mask[3]).any()),
        "keyword torque has one component off and another one on, and a thermostat acts on "
        "the whole rotation of a body, or not at all: switch off all three, or use "
        "fix nosquish/nve",
    )
