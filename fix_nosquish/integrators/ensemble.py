"""Ensembles: a splitting with a thermostat and a barostat inserted.

The step is B A O A B: half a kick, drift and free rotation for half a step, the thermostat, the
same again; see `thermostat`.  A piston is another letter, see `mtk`.

At the end of a step velocities are too cold, by the square of the step.  So atoms have those of its
middle then, which are right, and temperature and pressure follow from these.
"""

from collections.abc import Mapping
from importlib import import_module
from typing import Any
from zlib import crc32

import numpy as np

from ..errors import refuse
from ..host.command import Command
from ..host.lammps import Lammps
from ..loops.compiled import F1, L1, Cell, F, record
from ..ranks.communicator import Alone
from ..run.integrator import Integrator
from .momentum import Momentum
from .thermostat import EnsemblePart, Thermostat, key_of

Kept = record(
    "Kept",
    kind=F,  # what the rest is
    energy=F,  # that the bodies have given to the thermostat
    times_back=F,  # how often the step counter has gone back, and where it was
    was_at=F,
    pending=F,  # `Run.pending_half_kick`, nan for None
)  # in a restart file, followed by the states of barostat and thermostat
OWN = len(Kept.dtype.fields or ())
TEMPERATURE = "temp", "thermostat", "seed", "tchain", "separate", "moments"  # words


class Ensemble(Integrator):
    """An integrator with a thermostat, a barostat, or both.

    A derived class maps the words of a keyword to these: each is a class, or, of this package, its
    module and name.  With only one entry no keyword is needed.

    Attributes:
        thermostats, barostats: see above.
        thermostat, barostat: those of the fix line; None for no thermostat, and an `EnsemblePart`
            that does nothing for no barostat.
        momentum: the `Momentum`.
        restart_state: (n,) what goes to a restart file and comes from there; its energy is nan if
            nothing has come.  kept_state: the record at its begin; then come the states of the
            piston and of the thermostat.

    Raises:
        RunError: for words that do not go together, and if no motion is left to keep at a
            temperature.
    """

    thermostats: Mapping[str, Any] = {}
    barostats: Mapping[str, Any] = {}
    mid_step = True
    restart_state: np.ndarray

    def __init__(self, command: Command, dimension: int) -> None:
        super().__init__(command, dimension)
        self.thermostat: Thermostat | None = self._made(self.thermostats, "thermostat")
        self.barostat: EnsemblePart = self._made(self.barostats, "barostat") or EnsemblePart(self)
        kind = type(self.thermostat) if self.thermostat else Thermostat
        self.momentum = Momentum(kind.keeps_momentum, self.thermostat)
        self.scheme, self.prepares = self.barostat.step_with(kind)
        self.numbers, self.work = self.scheme.numbers, self.scheme.work
        of_ensemble = [self.barostat, *([self.thermostat] if self.thermostat else [])]
        self.parts = [self.momentum, *of_ensemble]
        within = self.thermostat and f" with {self.thermostat.method} in the middle of the step"
        self.method = f"NO_SQUISH{within or ''}{self.barostat.method}"
        self.splits = self.has_piston or not kind.merged
        self.respa = not self.barostats
        states = [np.zeros(part.state_size) for part in of_ensemble]
        self.restart_state = np.concatenate([[self._kind, np.nan, 0.0, -1.0, np.nan], *states])
        self.kept_state, rest = Kept.of(self.restart_state), self.restart_state[OWN:]
        for part in of_ensemble:
            part.state, rest = rest[: part.state_size], rest[part.state_size :]
        self._energy = 0.0  # given before this run, in all
        self._targets = 0.0, 0.0, 0.0

    def _made(self, choices: Mapping[str, Any], keyword: str) -> Any:
        """The object of a keyword's word; None where there is nothing to choose."""
        if not choices:
            return None
        word = getattr(self.command, keyword)
        if len(choices) == 1 and word == getattr(Command, keyword):  # the default of another choice
            (word,) = choices
        if word not in choices:
            known = " or ".join(choices)
            raise self.command.wrong(f"keyword {keyword} is {word}, and this fix has {known}")
        kind = choices[word]
        if isinstance(kind, str):
            module, _, name = kind.partition(".")
            kind = getattr(import_module(f".{module}", __package__), name)
        return kind(self)

    @property
    def has_piston(self) -> bool:
        return self.barostat.state_size > 0

    @property
    def _kind(self) -> float:
        """A number that says what its state is of."""
        command = self.command
        length = command.tchain if command.thermostat == "nh" else 0
        thermostat = type(self.thermostat)
        words = thermostat.__module__, thermostat.__qualname__, length, command.separate
        words = *words, *self.barostat.kind_of_state()
        return 1.0 + crc32(" ".join(map(str, (OWN, *words))).encode())

    def failure(self, found: int, run: Any) -> str:
        return "".join(part.failure(found, run) for part in self.parts)

    def temperature(self) -> tuple[float, float, float]:
        """The temperature at the begin and at the end of the run, and the rate of damping, as the
        run began."""
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

    def extra_parameters(self, run: Any) -> dict[str, Any]:
        lammps = run.lammps
        self._targets = start, stop, rate = self._find_targets(lammps)
        if start != stop:
            run.host.need("end of the run")
        if run.mask is not None and lammps.dimension == 3:
            _refuse_parts_of_rotations(run.mask, run.ranks)
        self._take_kept_state(run)
        unit = lammps.boltz / lammps.mvv2e
        key_0, key_1 = key_of(self.command, self.kept_state.times_back, run.host.world)
        return {
            "rate": rate, "start": unit * start, "stop": unit * stop, "kt": unit * start,
            "step": -1, "key_0": key_0, "key_1": key_1, "factor": 1.0,
        }  # fmt: skip

    def extra_cells(self, run: Any) -> dict[str, Cell]:
        begin, end = run.host.span or (np.zeros(1, np.int64), np.zeros(1, np.int64))
        return {
            "step": run.lammps.step_cell, "begin_step": Cell(L1, begin), "end_step": Cell(L1, end),
            "own_state": Cell(F1, self.parts[-1].state),
        }  # fmt: skip

    def _take_kept_state(self, run: Any) -> None:
        """Go on with what a restart file, or the last run, has left."""
        kept = self.kept_state
        if kept.kind != self._kind:
            run.host.log(
                "WARNING: the restart file has the state of another thermostat or barostat: "
                "this one begins anew\n"
            )
            kept.kind = self._kind
        elif run.parameters is not None:  # what a restart file got meanwhile is of an earlier step
            self._energy = self._energy_given(run)
            if run.parameters.step >= 0:  # else there was no step since this was last asked
                kept.was_at = run.parameters.step
        elif np.isfinite(kept.energy):
            self._energy = kept.energy
            run.pending_half_kick = None if np.isnan(kept.pending) else kept.pending
        if run.lammps.step < kept.was_at:
            kept.times_back += 1
            kept.was_at = run.lammps.step

    def _energy_given(self, run: Any) -> float:
        """The energy that the bodies have given to the thermostat, in mass times velocity squared;
        collective."""
        return self._energy - run.ranks.total(np.array([run.parameters.heat]))[0]

    def scalar(self, run: Any) -> float:
        """What has to be added to the potential energy and the kinetic energy of the atoms'
        velocities to make the energy that a correct step conserves; collective.

        It is the energy that went to the thermostat, and the difference of the bodies' kinetic
        energy between the end of the step and its middle; with a piston, its energy and its work,
        too.
        """
        end, middle = run.kinetic_at_end()
        scalar = run.lammps.mvv2e * self._energy_given(run) + end - middle
        return self.barostat.with_energy(scalar)

    def prepare_restart(self, run: Any) -> None:
        kept = self.kept_state
        kept.energy, kept.was_at = self._energy_given(run), run.lammps.step
        run.stepped |= run.steps_made
        run.note_pending()
        pending = run.pending_half_kick
        kept.pending = np.nan if pending is None else pending


def _refuse_parts_of_rotations(mask: np.ndarray, ranks: Alone) -> None:
    """End the run if some but not all components of a torque act; collective.

    Args:
        mask: see `switches.mask`.
    """
    refuse(
        ranks.any((mask[3:] != mask[3]).any()),
        "keyword torque has one component off and another one on, and a thermostat acts on "
        "the whole rotation of a body, or not at all: switch off all three, or use "
        "fix nosquish/nve",
    )
