"""The thermostat is part of the user's request, because it determines the dynamics.  Therefore only
integrators with the script's kind of thermostat and its damping time can be the answer; others are
for averages only."""

from collections.abc import Iterable, Mapping

from . import rigid_atoms
from .commands import split_words
from .loader import UserScript

NAMES = {
    "langevin": "Langevin",
    "csvr": "stochastic velocity rescaling",
    "nh": "Nosé–Hoover chains",
}
EFFECTS = {  # on dynamics
    "langevin": "it slows diffusion and rotation. In TIP3P water, for example, a damping time of "
    "200 fs reduced the diffusion coefficient from 4.2e-5 to 2.9e-5 cm²/s",
    "csvr": "one random factor scales all velocities, which changes dynamics very little",
    "nh": "one factor scales all velocities, which changes dynamics very little",
}
CHAINS = "nvt", "npt"  # styles whose thermostats are chains
DYNAMICS = {  # commands whose results depend on dynamics: of each the styles
    "compute": ("msd", "vacf", "msd/chunk", "vacf/chunk", "msd/nongauss"),
    "fix": ("ave/correlate", "ave/correlate/long"),
}


def kind_of(lines: Iterable[str]) -> str | None:
    """The kind of thermostat that fix lines give the bodies, one of `NAMES`; None for none."""
    fixes = [line for line in lines if split_words(line)[:1] == ["fix"]]
    for line in fixes:
        ours = rigid_atoms.parse_fix(line)
        if ours and "temp" in ours.keywords:
            words = ours.keywords
            return words[words.index("thermostat") + 1] if "thermostat" in words else "langevin"
    styles = [rigid_atoms.style_of(line) for line in fixes]
    if "langevin" in styles or any("langevin" in split_words(line) for line in fixes):
        return "langevin"
    chains = any(part in CHAINS for style in styles for part in style.split("/"))
    return "nh" if chains else None


def of_script(script: UserScript) -> dict | None:
    """The script's thermostat, as plain data: ``kind``, ``damp`` with its unit, and the commands
    that read ``dynamics``; None if the bodies' fixes have none."""
    kind = kind_of(script.rigid.lines)
    if kind is None or not script.rigid.state.temp:
        return None
    read = [
        " ".join((words[0], words[1], words[3]))
        for words in map(split_words, script.reading["commands"])
        if words[3:4] and words[3] in DYNAMICS.get(words[0], ())
    ]
    damp = f"{float(script.rigid.state.temp[2]):g} {script.units.time}"
    return {"kind": kind, "damp": damp, "dynamics": read}


def describe(thermostat: Mapping) -> str:
    """Say what the answer keeps, and why."""
    kind, read = thermostat["kind"], thermostat["dynamics"]
    text = f"{NAMES[kind]} with a damping time of {thermostat['damp']}"
    if read:
        return (
            f"Your script reads dynamics ({', '.join(read)}), so the answer keeps its thermostat: "
            f"{text}."
        )
    return f"The answer keeps your thermostat: {text}."


def of_averages(kind: str | None) -> str:
    """Describe the effect of a thermostat of this kind on dynamics."""
    return f"{NAMES[kind]}: {EFFECTS[kind]}" if kind else "it has no thermostat"
