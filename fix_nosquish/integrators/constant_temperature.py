"""What integrators at constant temperature have in common, with the thermostat in mid-step.

The step is B A O A B: half a kick, drift and free rotation for half a step, the thermostat, the
same again.  Where the thermostat stands decides how long a step may be: configurations have the
right distribution there up to steps that are three to four times those of a thermostat at the ends
(Davidchack, Ouldridge and Tretyakov, J. Chem. Phys. 142, 144114, 2015; Leimkuhler and Matthews,
Proc. R. Soc. A 472, 20160138, 2016; Zhang et al., J. Phys. Chem. A 123, 6056, 2019).

At the end of a step velocities are too cold, by the square of the step.  So atoms have those of its
middle then, which are right, and temperature and pressure follow from these.  What the thermostat
does is said by `langevin` and `rescaling`.
"""

from dataclasses import replace
from zlib import crc32

import numpy as np

from ..errors import RunError
from ..host import rigid_fixes
from ..host.hosts import hook
from ..loops.compiled import L1, Cell, F, I, inlined, record
from ..motion.operations import Parameters
from ..motion.philox import words
from ..run import thermo
from ..run.integrator import Integrator, Phase
from ..run.other_fixes import pushing_pair_style

Bath = record(
    "Bath",
    Parameters,
    rate=F,  # of damping
    start=F,  # temperature at the begin of the run, at its end and now, as energies in mass times
    stop=F,  # velocity squared
    kt=F,
    step=I,  # of the last random numbers, and which of its draws the next one is
    draw=I,
    key_0=I,  # of random numbers
    key_1=I,
    heat=F,  # the energy that this rank has given to the bodies
)
BODY, ALL_BODIES = 0, 1  # purposes of random numbers: of one body, of the system
Kept = record(
    "Kept",
    kind=F,  # what the rest is
    energy=F,  # that the bodies have given to the thermostat
    times_back=F,  # how often the step counter has gone back, and where it was
    was_at=F,
    waiting=F,  # as that of `Integrator`, nan for None
)  # in a restart file, where the thermostat's own state is behind
OWN = len(Kept.dtype)
_UNIFORM = "efield", "efield/tip4p"  # fixes of a field that is the same everywhere, or varies
NEUTRAL = 1e-6  # the charge that a neutral whole has, of rounding
CHANGED = 0.1  # of what the total momentum has of heat, by which it has changed in a run for sure
DRIFT = 1e-3  # of the kinetic energy, what that of the total momentum is without a warning
# the system's draws: of translation and of rotation, or both; of the barostat
OF_THERMOSTATS, OF_BAROSTAT = (0, 1024 * 1024), 3 * 1024 * 1024


@inlined
def part_of_run(step, begin_step, end_step):
    """Which part of the run is over."""
    steps = end_step[0] - begin_step[0]
    return (step[0] - begin_step[0]) / steps if steps > 0 else 0.0


@inlined
def prepare(parameters, step, begin_step, end_step):
    """Set the temperature of this step, and which draw of the step comes next.

    Returns:
        as `part_of_run`.
    """
    part = part_of_run(step, begin_step, end_step)
    parameters.kt = parameters.start + part * (parameters.stop - parameters.start)
    parameters.draw = parameters.draw + 1 if parameters.step == step[0] else 0
    parameters.step = step[0]
    return part


def key_of(command, times_back):
    """The key of a fix's random numbers: bodies of two fixes may have the same IDs, and a step
    counter that has gone back, so many times, counts steps that there were."""
    whose = " ".join((command.group, command.style, *command.arguments))
    if times_back:
        whose += f", {times_back:.0f}"
    return command.seed or 0, crc32(whose.encode()) & 0xFFFFFFFE


@inlined
def words_of_all(parameters, number):
    """Four random words for the system: the draw of this number in this step."""
    key_1 = parameters.key_1 | ALL_BODIES
    return words(float(number), parameters.step, parameters.draw, parameters.key_0, key_1)


class ConstantTemperature(Integrator):
    """An integrator with a thermostat.

    Attributes:
        keeps_momentum: whether the thermostat leaves the total momentum at zero.
        restart_state: (n,) what goes to a restart file and comes from there, see Kept; its energy
            is nan if nothing has come.  kept_state: the record at its begin.

    Raises:
        RunError: for words that do not go together, if the bodies are at rest, and if no motion is
            left to keep at a temperature.
    """

    splits = middle = thermostat = keeps_momentum = True
    numbers = Bath
    backwards = False
    keywords = "temp", "thermostat", "seed", "tchain", "separate", "moments"
    method = "NO_SQUISH"
    _held = 0  # degrees of freedom of the total momentum, if that is taken as zero
    _part = 0.0  # of the kinetic energy that is of the total momentum as a run begins

    def __init__(self, ptr, line):
        super().__init__(ptr, line)
        self.restart_state = np.array([self.kind, np.nan, 0.0, -1.0, np.nan, *self.own_state()])
        self.kept_state = Kept.of(self.restart_state)
        self._energy = 0.0  # given before this run, in all

    @property
    def couples(self):
        """Not in the place of a fix rigid with keyword langevin, whose scalar is a temperature."""
        return self.command.line.replaces not in rigid_fixes.BODIES

    def own_state(self):
        """What of the thermostat must be known to go on, besides the energy that it has given."""
        return np.empty(0)

    @property
    def kind(self):
        """A number for what its own state is of."""
        return 1.0 + crc32(" ".join(map(str, (OWN, *self.own_words))).encode())

    @property
    def own_words(self):
        """The thermostat, the length of its chains and what it acts on."""
        command = self.command
        length = command.tchain if command.thermostat == "nh" else 0
        return command.thermostat, length, command.separate

    def degrees(self):
        """Degrees of freedom of translation and of rotation that are free to change, less those of
        the momentum if nothing changes it: all atoms are in bodies that are free; collective."""
        lammps, bodies, owned = self.lammps, self.bodies, self.bodies.sharers.owned
        dimension, mask = lammps.dimension, np.ones((6, len(bodies)))
        mask *= self.mask if self.mask is not None else 1.0
        of_rotation = thermo.freedom(bodies, dimension) - dimension
        turns = mask[5] if dimension == 2 else mask[3:].prod(axis=0)
        free = np.array([mask[:dimension].sum(axis=0), of_rotation * turns])[:, owned].sum(axis=1)
        missing = dimension * owned.sum() - free[0] + len(lammps.groups) - len(bodies.index)
        *free, missing = self.communicator.total(np.array([*free, missing]))
        pushed_by = "atoms in no body, or components that are off" if missing else self._pushed_by()
        held = dimension if self.keeps_momentum and not pushed_by else 0
        self._held = held
        if self.keeps_momentum:
            self._left = sum(free) - held
            others = f"with the total momentum ({pushed_by})"
            momentum = others if pushed_by else "without the total momentum"
            self.freedom_said = f" of {self._left:.0f} degrees of freedom, {momentum}"
        if not sum(free) > held and not self.command.mol:
            raise RunError(
                f"the bodies have {sum(free):.0f} degrees of freedom, of which the total "
                f"momentum takes {held}: there is none to keep at a temperature",
                everywhere=True,
            )
        return np.array([max(free[0] - held, 0.0), free[1]])

    def _pushed_by(self):
        """What may change the bodies' total momentum, None if nothing does; collective."""
        if self.gravity is not None:
            return "keyword gravity"
        if self.external.moves_centres:
            return "external forces"
        if style := pushing_pair_style(self.host, self.lammps.setting("newton_pair")):
            return f"pair style {style}"
        found = next(filter(self._pushes, self.other_fixes.pushing()), None)
        return found and f"fix {found.id}"

    def _pushes(self, fix):
        """Whether another fix may change the bodies' total momentum; collective."""
        if fix.style not in _UNIFORM or self.host.varies(fix.id):
            return self.acts_on_bodies(fix)
        atoms, charge = self.membership.atoms(), self.lammps.per_atom("q")
        inside = atoms[fix.has(self.lammps.groups[atoms])]
        charges = np.zeros(1) if charge is None else charge[inside]
        return abs(self.communicator.total(np.array([charges.sum()]))[0]) > NEUTRAL

    @property
    def own_warnings(self):
        """A line on a total momentum that is taken as zero and is not; collective."""
        self._part = self._part_of_momentum() if self._held else 0.0
        if not self._part > DRIFT:
            return ()
        return (
            f"WARNING: the bodies' total momentum has {self._part:.2g} of their kinetic "
            "energy, which counts as heat here: what is left is colder. Take it off before the "
            "run: velocity ... zero linear",
        )

    def _part_of_momentum(self):
        """The part of the kinetic energy that is of the total momentum; collective."""
        bodies, owned = self.bodies, self.bodies.sharers.owned
        mass, v = bodies.mass[owned], bodies.v[:, owned]
        whole, *momentum = self.communicator.total(np.array([mass.sum(), *(mass * v).sum(axis=1)]))
        kinetic = thermo.energies(bodies, self.communicator, self.lammps)[:2].sum()
        return 0.5 * self.lammps.mvv2e * np.square(momentum).sum() / (whole * kinetic or np.inf)

    @hook
    def post_run(self):
        """As of `Integrator`; say if the total momentum was taken as constant and has changed."""
        ran = self.phase != Phase.NEW
        super().post_run()
        if not (ran and self._held and self.thermostat) or self._part > DRIFT:
            return
        part, of_heat = self._part_of_momentum(), self._held / (self._held + self._left)
        if part > 4.0 * self._part + CHANGED * of_heat:
            self.host.log(
                "WARNING: something has changed the bodies' total momentum in this run, which has "
                f"{part:.2g} of their kinetic energy now. The thermostat took it as constant, so "
                f"the bodies are too cold, by up to {of_heat:.2g} of their temperature: use "
                "thermostat langevin, which does not count degrees of freedom\n"
            )

    def temperature(self):
        """The temperature at the begin and at the end of the run, and the rate of damping."""
        start, stop, damping = (self.lammps.number(word) for word in self.command.temp)
        for name, value in ("TSTART", start), ("TSTOP", stop), ("TDAMP", damping):
            self.command.refuse_unless_positive(f"keyword temp: {name}", value)
        return start, stop, 1.0 / damping

    @hook
    def reset_target(self, temperature):
        """Keep this temperature from now on."""
        self.command = replace(self.command, temp=(*(repr(temperature),) * 2, self.command.temp[2]))
        if self.parameters is not None:
            unit = self.lammps.boltz / self.lammps.mvv2e
            self.parameters.start = self.parameters.stop = unit * temperature

    def own_parameters(self):
        command, (start, stop, rate) = self.command, self.temperature()
        if start != stop and self.host.span is None:
            raise RunError(
                "keyword temp: a LAMMPS's own fix python/move does not tell where a run ends, "
                "so TSTART and TSTOP must be the same",
                everywhere=True,
            )
        self._refuse_parts_of_rotations()
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
            self._energy, self.own_state()[:] = kept.energy, self.restart_state[OWN:]
            self.waiting = None if np.isnan(kept.waiting) else kept.waiting
        if self.lammps.step < kept.was_at:
            kept.times_back += 1
            kept.was_at = self.lammps.step
        unit = self.lammps.boltz / self.lammps.mvv2e
        key_0, key_1 = key_of(command, kept.times_back)
        return {
            "rate": rate, "start": unit * start, "stop": unit * stop, "kt": unit * start,
            "step": -1, "key_0": key_0, "key_1": key_1,
        }  # fmt: skip

    def _refuse_parts_of_rotations(self):
        """End the run if some but not all components of a torque act; collective."""
        if self.mask is None or self.lammps.dimension == 2:
            return
        if self.communicator.any((self.mask[3:] != self.mask[3]).any()):
            raise RunError(
                "keyword torque has one component off and another one on, and a thermostat acts on "
                "the whole rotation of a body, or not at all: switch off all three, or use "
                "fix nosquish/nve",
                everywhere=True,
            )

    def resumed(self):
        last = max(self.parameters.step, self.kept_state.was_at)
        if self.command.seed is not None and self.lammps.step <= last:
            raise RunError(
                "the step counter has gone back, and with it random numbers: "
                "begin the run with 'pre yes', which takes others",
                everywhere=True,
            )

    def own_cells(self):
        begin, end = self.host.span or (np.zeros(1, np.int64), np.zeros(1, np.int64))
        return {
            "step": self.lammps.step_cell, "begin_step": Cell(L1, begin), "end_step": Cell(L1, end)
        }  # fmt: skip

    def energy(self):
        """The energy that the bodies have given to the thermostat, in mass times velocity squared;
        collective."""
        return self._energy - self.communicator.total(np.array([self.parameters.heat]))[0]

    @hook
    def compute_scalar(self):
        """What the potential energy and that of the atoms' velocities have to be added to make the
        energy that a right step keeps: what went to the thermostat, and what the bodies' kinetic
        energy is more at the end of the step than in its middle; or, where it does not `couple`,
        the temperature of the bodies; collective."""
        if not self.couples:
            return super().compute_scalar()
        end, middle = self.reports.kinetic_at_end()
        return self.lammps.mvv2e * self.energy() + end - middle

    @hook
    def write_restart(self):
        """LAMMPS writes a restart file: have the state ready for it; collective."""
        if self.passes:  # else it is what the last restart file had
            kept = self.kept_state
            kept.energy, kept.was_at = self.energy(), self.lammps.step
            self._stepped |= self.steps_made
            self._note_waiting()
            kept.waiting = np.nan if self.waiting is None else self.waiting
            self.restart_state[OWN:] = self.own_state()
