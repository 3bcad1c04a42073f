"""The criteria of `stress`: every bound, and its derivation.

A bound is derived from physics or from what a user needs, not from any result.  It is stated only
here.  To change one, change `bound`, and add the reason to docs/results/stability.md.
"""

from dataclasses import dataclass

import numpy as np

from ..scenes.units import NS_OF_REDUCED

EPS = float(np.finfo(float).eps)
READING = 5000  # rounding of what is read from a trajectory, in steps: 1e4 ulps


@dataclass(frozen=True)
class Criterion:
    """A bound for a number of some cases."""

    side: str  # ``≤`` or ``≥``
    bound: float
    unit: str  # empty for a ratio
    cases: str  # their names
    quantity: str  # the number, in words
    derivation: str  # how the bound follows
    need: str  # whose need it is
    # whether it bounds a part of the measurement, such as what a stable run is: no verdict alone
    inner: bool = False

    def within(self) -> tuple[float | None, float | None]:
        """The bound as (low, high), None for an open end."""
        return (self.bound, None) if self.side == "≥" else (None, self.bound)

    def text(self) -> str:
        """The bound as text."""
        return f"{self.side} {self.bound:.3g} {self.unit}".strip()


LIBRATION = (
    "rigid water's fastest librations are near 900 cm⁻¹, a period of 37 fs: six steps of it are "
    "6.2 fs; Silveira and Abreu (2019) ran to 6 fs"
)


CRITERIA = {
    "drift": Criterion(
        "≤",
        0.02,
        "1/ns",
        "water-hot water-cold gradient",
        "|drift of the energy| over the mean kinetic energy",
        "1 % of kT in each degree of freedom a ns is 2 % of the kinetic energy a ns; it warms by "
        "1 %, as half of the heat is kinetic; "
        f"reduced units are read as argon's: 1 ns is {NS_OF_REDUCED:g} τ",
        "who samples at constant energy for a ns, and would notice 1 % in the temperature",
    ),
    "stable": Criterion(
        "≤",
        0.02,
        "",
        "water-dt",
        "change of the energy in a run that counts as stable, over the kinetic energy",
        "1 % in the temperature, as half of the heat is kinetic",
        "who equilibrates for some ps, and would notice 1 % in the temperature",
        inner=True,
    ),
    "water's step": Criterion(
        "≥",
        6.0,
        "fs",
        "water-dt",
        "longest stable step",
        LIBRATION,
        "who runs rigid water at the longest step that others have published",
    ),
    "top's energy": Criterion(
        "≤",
        2.5e-3,
        "",
        "needles disks",
        "largest relative change of a free top's energy",
        "(|ω|Δt)² at 0.05 rad: the error of a scheme of second order, with a coefficient of 1 "
        "(velocity Verlet of an oscillator has 1/4); it does not grow",
        "who expects second order, and no drift",
    ),
    "rounding": Criterion(
        "≤",
        2 * EPS,
        "",
        "needles disks long-dimer",
        "relative change of what is kept exactly (momentum, angular momentum), in a step",
        "four roundings of half an ulp in a step, all to one side; beside them 1e4 ulps for what "
        "is read: atoms lie up to 1e3 σ from the origin, on arms of half a σ",
        "who relies on conservation laws",
    ),
    "orientation": Criterion(
        "≤",
        0.1,
        "σ",
        "needles disks",
        "largest distance of an atom from the exact motion after 1,000 rad",
        "1 − cos φ ≤ 1 %: φ ≤ 0.1415 rad; the longest arm is 0.7071 σ",
        "who would notice 1 % in the correlation of orientations, ⟨u(0)·u(t)⟩",
    ),
    "shape": Criterion(
        "≤",
        1.0,
        "",
        "long-dimer",
        "largest relative change of a distance in a body, over what was asked for",
        "of shake and rattle, the tolerance that they are given; of a rigid integrator, rounding "
        "as of momenta",
        "who asks for a tolerance",
    ),
    "long run": Criterion(
        "≤",
        0.02,
        "",
        "long-dimer",
        "change of the mean energy from the first tenth of the run to the last, over the kinetic "
        "energy",
        "1 % in the temperature of the whole run, as half of the heat is kinetic",
        "who would notice 1 % in the temperature",
    ),
    "far place": Criterion(
        "≤",
        1e-6,
        "σ",
        "far-away",
        "largest distance from the same bodies at the origin",
        "1e7 σ from the origin a position is rounded by 0.9e-9 σ; 100 steps to one side, in three "
        "directions, are 1.6e-7 σ; collisions amplify that e^(3 · 0.4) = 3.3-fold, with an "
        "exponent of 3/τ as of a dense liquid: 5e-7 σ, up to a power of ten",
        "who has a large box, or one far from the origin",
    ),
    "far pressure": Criterion(
        "≤",
        1e-3,
        "",
        "far-away",
        "largest relative change of the pressure against the same bodies at the origin",
        "three digits, to which pressures of simple liquids are published; rounding there is far "
        "below",
        "who compares a pressure with tables",
    ),
}


# of several criteria at once: each number relative to its own bound
EACH = Criterion("≤", 1.0, "", "", "the largest of all, each over its bound", "", "")


def rounding(steps: int) -> float:
    """The relative effect of rounding on an exactly conserved number, in so many steps."""
    return CRITERIA["rounding"].bound * (steps + READING)


def in_a_step(change: float, steps: int) -> float:
    """Convert a relative change in so many steps to one per step, as the criterion of rounding
    needs it."""
    return change / (steps + READING)
