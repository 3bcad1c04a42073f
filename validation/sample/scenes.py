"""The scenes of `sample`, each with its temperature and its schemes: entries of `SCENES`."""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ..experiment import Point
from ..scenes import TEMPERATURE, constrained_peptide, smooth_water
from ..scenes.integrators import OURS, Integrator
from ..scenes.liquids import BENZENE, CARBON_DIOXIDE, Liquid
from ..user_script import conserved_energy, shapes, time_step
from ..user_script.commands import split_words
from ..user_script.loader import UserScript
from ..user_script.shapes import BodyGroup
from . import gromacs_engine, openmm_engine
from .plan import BODIES, Plan
from .schemes import (
    RAW,
    SEED,
    STRONG,
    Bodies,
    Scheme,
    at_pressure,
    by_name,
    constant_volume,
    ours,
)

TITLE = "512 TIP3P molecules at 298 K and 0.997 g/cm³, smooth cutoff at 8.5 Å"
HEAVY = 3.0, 4.0  # amu, of water's hydrogens
# degrees of freedom of the rotation of the peptide's bodies: two for bodies of two atoms, three for
# others
PEPTIDE_TURNS = 4439
OWN_FACTORS = 0.5, 1.0, 2.0, 3.0, 4.0  # in units of a script's step
# longest step times the frequency of the stiffest motion, by mean squares: for water, with its
# libration, this is 8 fs, about two thirds of the step at which it fails
REACH = 0.95
# the words before a seed in a script's lines: the keyword, or a temperature with its damping
SEEDS = re.compile(r"(\sseed\s+|\slangevin(?:\s+[-+\d.][-+\d.eE]*){3}\s+)[^\s\"']+")
# what users have today: for molecules that shake can constrain, for others, at constant pressure
RIGID = Point("rigid+langevin", 2.0), Point("rigid/nvt/small", 2.0)
CONSTRAINED = Point("shake+langevin", 2.0), RIGID[1]
BAROSTATS = Point("shake+npt", 2.0), Point("rigid/npt/small", 2.0)


def _water(_: Path) -> Plan:
    scene, mass = smooth_water("water", TITLE, "water_512", "512", 512), 15.9994 + 2 * 1.008
    heavy = {
        hydrogen: (f"mass 1 {mass - 2 * hydrogen:.8g}", f"mass 2 {hydrogen:g}")
        for hydrogen in HEAVY
    }
    schemes = constant_volume(Bodies(298.0, shake=True, equal=True, heavy=heavy))
    starter, others = schemes["langevin-20"], [*openmm_engine.SCHEMES, *gromacs_engine.SCHEMES]
    schemes |= by_name(others)
    return Plan(scene, 298.0, schemes, starter, CONSTRAINED, 3 * 512, dipole=True)


def _pressure(folder: Path) -> Plan:
    """The same water at constant pressure, from the starts of constant volume."""
    water = _water(folder)
    return Plan(
        replace(water.scene, name="pressure"),
        water.temperature,
        at_pressure(water.temperature),
        water.starter,
        BAROSTATS,
        water.turning,
    )


def _peptide(_: Path) -> Plan:
    bodies = Bodies(
        TEMPERATURE["peptide"],
        flexible=" flexible rest",
        rest="rest",
        everywhere="all",
        shake=True,
        alike=False,  # of four atoms it holds three bonds: averages include the angles' energy
        longest=6.0,
    )
    schemes, scene = constant_volume(bodies), constrained_peptide()
    return Plan(
        scene, bodies.temperature, schemes, schemes["langevin-20"], CONSTRAINED, PEPTIDE_TURNS
    )


def _liquid(liquid: Liquid, folder: Path) -> Plan:
    schemes = constant_volume(Bodies(liquid.temperature))
    # melts the crystal, and cools the melt
    ramp = f" temp {liquid.melt:g} {liquid.temperature:g} {STRONG:g}"
    return Plan(
        liquid.scene(folder / "scenes"),
        liquid.temperature,
        schemes,
        ours("melt", "melt", f"{ramp} thermostat langevin seed {SEED}", "NVT"),
        RIGID,
        liquid.molecules * (2 if np.linalg.matrix_rank(liquid.shape) == 1 else 3),
    )


SCENES: dict[str, Callable[[Path], Plan]] = {  # each writes its files into a folder
    "water": _water,
    "pressure": _pressure,
    "peptide": _peptide,
    "benzene": partial(_liquid, BENZENE),
    "co2": partial(_liquid, CARBON_DIOXIDE),
}


def of_script(script: UserScript) -> Plan:
    """The plan of a user's script, at its constant temperature, and at its pressure if it has one.

    Raises:
        SystemExit: the script has no averages that can be compared with a limit.
    """
    state, scene = script.rigid.state, script.scene
    pressures = {float(start) for _, start, *_ in state.press}
    if scene.units != "real" or not state.temp or len(pressures) > 1 or state.ramps or state.tilts:
        raise SystemExit(
            f"{scene.subject}: sample needs units real and one constant temperature, and at most "
            "one constant pressure, kept by fix nvt or npt, rigid/nvt or rigid/npt, nosquish/nvt "
            "or nosquish/npt"
        )
    temperature, steps = float(state.temp[0]), tuple(factor * scene.dt for factor in OWN_FACTORS)
    schemes = by_name(
        Scheme.of(
            integrator,
            lines=_lines(integrator),
            held=_held(script, integrator),
            temperature=temperature,
            pressure=min(pressures, default=None),
            steps=steps,
            reach=None if "rigid/n" in integrator.label else 2 * scene.dt,
        )
        for integrator in script.integrators.values()
    )
    starter = schemes.get(OURS, schemes[script.reference])
    groups, _ = shapes.body_groups(script)
    stiffest = time_step.stiffest(script)
    longest = max(REACH / stiffest if stiffest else 0.0, scene.dt)
    known, turning = (Point(script.reference, scene.dt),), _turning(script, groups)
    return Plan(scene, temperature, schemes, starter, known, turning, longest=longest)


def _lines(integrator: Integrator) -> tuple[str, ...]:
    """An integrator's lines, with a place for the seed, and forces without a thermostat's noise."""
    lines = tuple(SEEDS.sub(rf"\1{SEED}", line) for line in integrator.lines)
    return (RAW, *lines) if any(split_words(line)[3:4] == ["langevin"] for line in lines) else lines


def _turning(script: UserScript, groups: Sequence[BodyGroup]) -> int:
    """The degrees of freedom of all rotation; 0 if `plan.BODIES` cannot compute the torques: in two
    dimensions, for bodies without molecule numbers, if atoms in no body exist or something else
    acts on them, and in a script that uses such names itself."""
    names = {split_words(line)[1] for line in BODIES}
    if (
        script.rigid.bodies != "molecule"
        or script.reading["dimension"] == 2
        or (script.rigid.body == 0).any()
        or conserved_energy.acting_fixes(script)
        or any(names.intersection(split_words(line)[1:2]) for line in script.reading["commands"])
    ):
        return 0
    return sum(kind.number * (kind.freedom - 3) for kind in shapes.body_kinds(script, groups))


def _held(script: UserScript, integrator: Integrator) -> int:
    """The degrees of freedom of the total momentum that an integrator keeps at zero: all, unless it
    has random forces, or something else acts on the atoms."""
    words = " ".join(integrator.lines)
    random = "langevin" in words or (integrator.kind == "ours" and " thermostat " not in words)
    alone = (
        (script.rigid.body > 0).all()
        and all(script.reading["periodic"])
        and not conserved_energy.acting_fixes(script)
    )
    return 0 if random or not alone else script.reading["dimension"]
