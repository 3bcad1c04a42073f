"""What a trial of a script's steps is judged by: targets, their defaults and reasons."""

from collections.abc import Mapping

from ..own import counted, schemes, shapes
from ..own.system import Own

# of the script's steps: the energy's changes in it count.  Errors of the step are as large as they
# get by then.  What is added up later, by noise or by forces that a cutoff ends, is the same at all
# steps: the standard deviation of a whole run is mostly this
SPAN = 96
# times in a ns; in reduced units 1,000 of them stand for it
NS = {"real": 1e6, "electron": 1e6, "metal": 1e3, "nano": 1.0, "micro": 1e-3}
NS |= {"si": 1e-9, "cgs": 1e-9}
ENERGIES = "drift", "energy"  # targets that econserve tells
MEANS = frozenset(("potential", "density", "rdf"))  # that are held against another run
TARGETS = {
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
COUNTED = (
    "what {fixes} does to the energy is not counted; of a fix that adds a force, 'fix_modify ID "
    "energy yes' has LAMMPS count it, if it can"
)
# the default drift with a thermostat: what GROMACS allows by default, 0.005 kJ/mol per ps and atom
# (verlet-buffer-tolerance), of rigid water at 300 K.  With a damping time of 1 ps it heats by 0.2 %
HEATED, WHY_HEATED = 1.0, "as much as GROMACS allows by default; the thermostat takes it out"


def targets(own: Own, wanted: Mapping[str, float]) -> dict[str, float]:
    """Largest errors that are good enough, by name; those that the script has no use for are left
    out of the default ones.

    Raises:
        LookupError: there is no such target; the message lists all. Or the script's atoms are at
            rest, and nothing can be told.
    """
    state = own.found.state
    if not shapes.temperature(own) > 0:
        raise LookupError(
            f"the atoms are at rest at '{schemes.plain(own.said['run'])}', so there is no "
            "temperature to measure errors by: give them velocities (velocity all create T SEED), "
            "and let them come to equilibrium"
        )
    for name in wanted:
        if name not in TARGETS:
            known = "; ".join(f"{key}: {what}" for key, (_, _, what, _) in TARGETS.items())
            raise LookupError(f"there is no target {name}. There are {known}")
    found = {name: default for name, (default, *_) in TARGETS.items()}
    if state.temp:
        found["drift"] = HEATED
    lacking = counted.lacking(own)
    if lacking:
        found = {name: most for name, most in found.items() if name not in ENERGIES}
    if own.said["sized"]:  # such atoms turn, too, and their velocities do not tell it
        del found["temperature"]
    if not state.press:
        del found["density"]
    if not has_rdf(own):
        del found["rdf"]
    if "potential" not in wanted:  # it takes long runs to tell
        del found["potential"]
    missing = [name for name in wanted if name not in found]
    if missing:
        fixes = f"fix {' and fix '.join(lacking)}"
        raise LookupError(
            f"{missing[0]} says nothing of this script: "
            + {
                **dict.fromkeys(ENERGIES, COUNTED.format(fixes=fixes)),
                "temperature": "its atoms may have moments of inertia of their own",
                "density": "its box does not change",
                "rdf": "its box is not periodic, or has less than ten bodies",
            }[missing[0]]
        )
    return {name: wanted.get(name, most) for name, most in found.items()}


def about(own: Own, wanted: Mapping[str, float]) -> dict[str, dict]:
    """What each target is, in words, and its default for this script."""
    words = {"ns": name_of_ns(own), "span": f"{SPAN * own.scene.dt:g} {own.units.time}"}
    found = {}
    for name in wanted:
        usual, *texts = TARGETS[name]
        unit, what, why = (text.format(**words) for text in texts)
        if name == "drift" and own.found.state.temp:
            usual, why = HEATED, WHY_HEATED
        found[name] = {"default": usual, "unit": unit, "what": what, "why": why}
    return found


def judged(point: Mapping, wanted: Mapping[str, float]) -> dict[str, float]:
    """The targets that a row of `trial` has errors for."""
    lost = ENERGIES if point["uncounted"] else ()
    return {name: most for name, most in wanted.items() if name not in lost}


def has_rdf(own: Own) -> bool:
    """Whether g(r) of its bodies says something."""
    return all(own.said["periodic"]) and own.bodies >= 10


def steps_of_cost(own: Own, dt: float) -> float:
    """How many steps the time has that costs are told of."""
    return NS.get(own.scene.units, 1e3) / dt


def name_of_ns(own: Own) -> str:
    """What costs and drifts are told of."""
    return "ns" if own.scene.units in NS else f"1,000 {own.units.time}"
