"""The subject of a comparison, a built-in scene or a user's script, and the largest errors
allowed."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..running import starts
from ..scenes import SCENES, TEMPERATURE, Scene, constrained_peptide
from ..scenes.integrators import OURS, SWEPT, Integrator
from ..scenes.units import BOLTZMANN, UNITS
from ..user_script import candidates, conserved_energy, shapes, thermostat, time_step
from ..user_script.loader import UserScript

# Span of energy changes, in steps of the usual length.  Errors of the step reach their full size
# within it.  Errors that accumulate, from noise or from forces that a cutoff ends, are the same at
# all steps, and dominate the standard deviation of a whole run
SPAN = 96
# units of time per ns; in reduced units 1,000 of them are used instead
NS = {
    "real": 1e6,
    "electron": 1e6,
    "metal": 1e3,
    "nano": 1.0,
    "micro": 1e-3,
    "si": 1e-9,
    "cgs": 1e-9,
}
ENERGIES = "drift", "energy"  # targets measured from econserve
MEANS = frozenset(("potential", "density", "rdf"))  # targets compared with another run
ASKED = "energy_sd", "potential"  # targets only on request
TARGETS = {  # default largest error, unit, description, reason
    "drift": (
        0.01,
        "kT per {ns} and degree of freedom",
        "drift of the energy that is to be kept",
        "in 1 {ns} the temperature changes by some per cent at most",
    ),
    "temperature": (
        0.01,
        "of T",
        "translation against rotation, or against the thermostat",
        "3 K at 300 K: what thermometers of force fields tell apart",
    ),
    "energy": (
        0.2,
        "of the kinetic energy's standard deviation",
        "change of the energy that is to be kept in {span}, rms, over √2",
        "a fifth, the old rule for a step that is short enough",
    ),
    "energy_sd": (
        1.0,
        "{energy}",
        "standard deviation of the energy that is to be kept; it grows with the run, if it drifts",
        "none: it depends on the number of bodies",
    ),
    "potential": (
        0.05,
        "kT per body",
        "mean potential energy",
        "0.03 kcal/mol at 300 K: less than most force fields' own error in a heat of vaporization",
    ),
    "density": (0.005, "of it", "mean density", "half a per cent, as force fields are fitted to"),
    "rdf": (
        0.03,
        "",
        "rms of g(r) of the bodies' heaviest atoms",
        "less than the width of a line in a figure of g(r)",
    ),
}
# relative rise of the temperature by the default drift with a thermostat, which takes the heat out.
# With a damping time of 1 ps the drift is what GROMACS allows by default, 0.005 kJ/mol per ps and
# atom (verlet-buffer-tolerance), of rigid water at 300 K
HEATED, WHY_HEATED = 0.002, "the thermostat takes it out; the temperature rises by 0.2 %"
COUNTED = (
    "what {fixes} does to the energy is not counted; of a fix that adds a force, 'fix_modify ID "
    "energy yes' has LAMMPS count it, if it can"
)
FACTORS = 1.0, 1.5, 2.0, 3.0, 4.0, 6.0  # of a script's step
# accuracy of PPPM: an integrator's error is measured, not the mesh's.  With 1e-5 the energy of the
# peptide at 0.5 fs wanders in 4 ps by 0.072 kcal/mol; with 1e-6 by 0.026, with 1e-7 by 0.022
MESH = "1e-6"
STEPS = {  # fs, of the built-in scenes
    "dimer": (0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.2, 1.5, 2.0, 3.0, 4.0),
    "water": (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 10.0, 12.0),
    "peptide": (0.25, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.5, 10.0),
}
BODIES = {"water": 512}
DIFFERS = (
    "shake and rattle leave the H-X-H angles of CH3 and NH3 free, so they move another model, "
    "whose averages are not held against those of rigid groups"
)


@dataclass(frozen=True)
class Case:
    """A scene and the settings by which its errors are measured.

    Attributes:
        word: name on the command line.
        integrators: integrators that can move it, by name.
        reference: name of the integrator whose shortest step is the reference of means.
        usual: names of the integrators that are compared by default.
        steps: time steps to try, in the scene's units.
        temperature: of the thermostat, or of the start.
        boltzmann: Boltzmann's constant in the scene's units.
        bath: whether a thermostat controls the temperature.
        lost: targets that are meaningless for this case, with reasons.
        unknown: by integrator, targets that its runs cannot measure; ``why`` is the reason.
        thermostat: the script's, see `thermostat.of_script`; None if its bodies' fixes have none.
        unstable: step above which no run is stable, estimated from the forces at the start.
        script: the script, if it is one.
    """

    word: str
    scene: Scene
    integrators: Mapping[str, Integrator]
    reference: str
    usual: tuple[str, ...]
    steps: tuple[float, ...]
    temperature: float
    boltzmann: float = BOLTZMANN
    bath: bool = False
    lost: Mapping[str, str] = field(default_factory=dict)
    unknown: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    why: str = ""
    thermostat: dict | None = None
    unstable: float = math.inf
    notes: tuple[str, ...] = ()
    script: UserScript | None = None

    @property
    def kt(self) -> float:
        """kT in the scene's energy."""
        return self.boltzmann * self.temperature

    @property
    def time(self) -> str:
        """Name of the scene's unit of time."""
        return UNITS[self.scene.units].time

    @property
    def ns(self) -> float:
        """Units of time in the unit of costs and drifts."""
        return NS.get(self.scene.units, 1e3)

    @property
    def heating(self) -> float:
        """The drift, kT per degree of freedom, by which the temperature rises by `HEATED`."""
        damping = float(self.thermostat["damp"].split()[0]) if self.thermostat else self.ns / 1e3
        return HEATED / 2 * self.ns / damping

    @property
    def name_of_ns(self) -> str:
        """Name of the unit of costs and drifts."""
        return "ns" if self.scene.units in NS else f"1,000 {self.time}"

    def written(self, integrator: Integrator) -> tuple[list[str], str, list[str]]:
        """Lines of an input script for an integrator, where they belong, and notices: on commands
        that cannot be used together with them, and on the place of the time step."""
        lines = integrator.commands(self.scene)
        if self.script is None:
            return lines, "These lines replace what moves the atoms", []
        rigid, reading = self.script.rigid, self.script.reading
        replaced, lines = dict(zip(rigid.ids, rigid.lines)), [*rigid.setup, *lines]
        notices = (
            []
            if integrator.then
            else candidates.removal_notice(replaced, reading["commands"], lines)
        )
        notices += [
            f"Set the timestep directly before '{reading['run']}': the runs before it were made "
            "with yours, and a start that is not in equilibrium may need it."
        ] * bool(reading["skipped"]) + [
            "Instead of a new fix line, 'lmp -sf nosquish -in SCRIPT' replaces yours without an "
            "edit, but keeps more of it: two chains (tchain 10 separate yes) in rigid/nvt, for "
            "example. That was not compared."
        ] * (integrator.kind == "ours" and rigid.kind == "rigid" and len(rigid.ids) == 1)
        lines += [line for line in self.scene.then if line == time_step.LISTS]
        return lines, candidates.replacement_notice(replaced), notices


def of_scene(name: str, folder: Path) -> Case:
    """The case of a built-in scene; ``folder`` is for data files of starts."""
    scene = constrained_peptide() if name == "peptide" else SCENES[name]
    if name != "dimer":
        scene = replace(
            scene.on_mesh(MESH),
            title=f"{scene.title}, PPPM {MESH}",
            subject=scene.subject and f"{scene.subject}, PPPM {MESH}",
        )
    scene = starts.of_size(scene, BODIES.get(name, scene.unit), folder)
    if scene.subject:
        scene = replace(scene, title=f"{scene.unit:,} {scene.subject}")
    able = {key: integrator for key, integrator in SWEPT.items() if integrator.can_run(scene)}
    lost = {"density": "its box does not change"}
    if name == "dimer":
        lost["rdf"] = "its box is not periodic"
        lost["temperature"] = "two bodies at constant momenta do not share their energy evenly"
    other = [
        key
        for key, integrator in able.items()
        if integrator.kind == "constraints" and name == "peptide"
    ]
    return Case(
        word=name,
        scene=scene,
        integrators=able,
        reference=OURS,
        usual=(OURS, "rigid/nve"),
        steps=STEPS[name],
        temperature=TEMPERATURE[name],
        lost=lost,
        unknown=dict.fromkeys(other, tuple(sorted(MEANS))),
        why=DIFFERS,
    )


def of_script(script: UserScript) -> Case:
    """The case of a user's script.

    Raises:
        LookupError: its atoms are at rest, so no error can be measured.
    """
    if not shapes.temperature(script) > 0:
        raise LookupError(
            f"the atoms are at rest at '{script.reading['run']}', so there is no "
            "temperature to measure errors by: give them velocities (velocity all create T SEED), "
            "and let them come to equilibrium"
        )
    bath, every = thermostat.of_script(script), script.integrators
    known = {
        key: integrator
        for key, integrator in every.items()
        if bath is None or thermostat.kind_of(integrator.lines) == bath["kind"]
    }
    ours = next(
        (key for key, integrator in known.items() if integrator.kind == "ours"), script.reference
    )
    rivals = script.reference, "rigid/nve/small", "rigid/nvt/small", "rigid/npt/small", *known
    rival = next((key for key in rivals if key in known and known[key].kind != "ours"), ours)
    return Case(
        word=script.options.script,
        scene=script.scene,
        integrators=every,
        reference=ours,
        usual=tuple(name for name in known if name in (ours, rival)),
        steps=tuple(factor * script.scene.dt for factor in FACTORS),
        temperature=shapes.temperature(script),
        boltzmann=script.reading["boltzmann"],
        bath=bool(script.rigid.state.temp),
        lost=_lost(script),
        unknown={
            key: ENERGIES
            for key, integrator in every.items()
            if conserved_energy.misses_own_error(integrator)
        },
        why=conserved_energy.WHY,
        thermostat=bath,
        unstable=max(time_step.UNSTABLE.values()) / max(time_step.stiffest(script), 1e-300),
        notes=script.notes,
        script=script,
    )


def _lost(script: UserScript) -> dict[str, str]:
    lost: dict[str, str] = {}
    lacking = conserved_energy.uncounted_fixes(script)
    if lacking:
        lost |= dict.fromkeys(
            (*ENERGIES, "energy_sd"), COUNTED.format(fixes=f"fix {' and fix '.join(lacking)}")
        )
    if script.reading["sized"]:  # these atoms rotate, too, which their velocities do not show
        lost["temperature"] = "its atoms may have moments of inertia of their own"
    if not script.rigid.state.press:
        lost["density"] = "its box does not change"
    if not all(script.reading["periodic"]) or script.bodies < 10:
        lost["rdf"] = "its box is not periodic, or has less than ten bodies"
    return lost


def targets(case: Case, wanted: Mapping[str, float]) -> dict[str, float]:
    """The largest errors allowed, by name; default targets that are meaningless for the case, and
    those that are infinite, are omitted.

    Raises:
        LookupError: a target does not exist (the message lists all), or is meaningless; or none is
            left.
    """
    for name in wanted:
        if name not in TARGETS:
            known = "; ".join(f"{key}: {target['what']}" for key, target in about(case).items())
            raise LookupError(f"there is no target {name}. There are {known}")
        if name in case.lost:
            raise LookupError(f"{name} says nothing of {case.word}: {case.lost[name]}")
    bounds = {name: default for name, (default, *_) in TARGETS.items() if name not in case.lost}
    if case.bath and "drift" in bounds:
        bounds["drift"] = case.heating
    active = {
        name: wanted.get(name, most)
        for name, most in bounds.items()
        if (name in wanted or name not in ASKED) and wanted.get(name) != math.inf
    }
    if not active:
        raise LookupError(f"no target is left. There are {', '.join(bounds)}")
    return active


def about(case: Case) -> dict[str, dict]:
    """Describe each target, with its default for this case."""
    words = {
        "ns": case.name_of_ns,
        "span": f"{SPAN * case.scene.dt:g} {case.time}",
        "energy": UNITS[case.scene.units].energy,
    }
    descriptions = {}
    for name, (usual, *texts) in TARGETS.items():
        unit, what, why = (text.format(**words) for text in texts)
        if name == "drift" and case.bath:
            usual, why = case.heating, WHY_HEATED
        descriptions[name] = {"default": usual, "unit": unit, "what": what, "why": why}
    return descriptions
