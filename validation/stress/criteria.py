"""The criteria of `stress`: every bound, what it is derived from, and each change of it.

A bound is set from physics or from what a user needs, not from any result.  It is stated here
alone.  To change one, change `bound` and add a `Change` with its date and reason: the
report shows them all.
"""

from dataclasses import dataclass

import numpy as np

from ..scenes.units import NS_OF_REDUCED

EPS = float(np.finfo(float).eps)
READING = 5000  # steps' worth of rounding is in what is read from a trajectory: 1e4 ulps


@dataclass(frozen=True)
class Change:
    """A bound that was set, or became another one."""

    date: str
    cases: tuple[str, ...]  # whose bound it was
    old: str  # bounds as text
    new: str
    reason: str  # why; whether results were known
    bound: float | None = None  # from then on; None of a change that another one follows


@dataclass(frozen=True)
class Criterion:
    """A bound that a number of some cases is held against."""

    side: str  # ``≤`` or ``≥``
    bound: float
    unit: str  # empty for a ratio
    cases: tuple[str, ...]  # their names
    quantity: str  # the number, in words
    derivation: str  # how the bound follows
    need: str  # whose need it is
    changes: tuple[Change, ...]  # of the bound, the oldest first; the last one made it what it is
    # whether it is of a part of the measurement, as what a stable run is: it gives no verdict alone
    inner: bool = False

    @property
    def date(self) -> str:
        """Since when the bound is what it is."""
        return self.changes[-1].date

    def within(self) -> tuple[float | None, float | None]:
        """The bound as (low, high), None for none."""
        return (self.bound, None) if self.side == "≥" else (None, self.bound)

    def text(self) -> str:
        """The bound as text."""
        return f"{self.side} {self.bound:.3g} {self.unit}".strip()


SET = "2026-11-22"
FOLLOWS = "it follows from the derivation, which was written before any result was read"
KEPT = f"kept: {FOLLOWS}"
KNOWN = "changed after results were known"


def _place(side: str, bound: float, cases: str, unit="") -> tuple[str, float, str, tuple[str, ...]]:
    return side, bound, unit, tuple(cases.split())


def _change(cases, text, reason, bound=None):
    """A `Change` of `SET`; the text has old and new."""
    old, new = text.split(" → ")
    return Change(SET, tuple(cases.split()), old, new, reason, bound)


def _kept(cases, text, bound):
    """The history of a bound that was looked at, and kept."""
    return (_change(cases, f"{text} → {text}", KEPT, bound),)


_MASSES = {"dimer-1": 1.0, "dimer-0.1": 0.1, "dimer-0.01": 0.01}  # of hydrogen, amu
LIBRATION = (
    "rigid water's fastest librations are near 900 cm⁻¹, a period of 37 fs: six steps of it are "
    "6.2 fs; Silveira and Abreu (2019) ran to 6 fs"
)
ROUNDED = "(|ω|Δt)², at most 0.1, and 100 roundings a step, 2.2e-8 in all"


def _dimer(name, mass):
    """A dimer's criterion."""
    bound = round(6.0 * mass**0.5, 2)
    return Criterion(
        *_place("≥", bound, name, "fs"),
        "longest stable step, mean over starts",
        f"water's 6 fs times the root of {mass:g}, the hydrogen's mass in amu: times of the "
        f"rotation go with it ({LIBRATION})",
        "as of water-dt",
        _kept(name, f"{6.0 * mass**0.5:.2g} fs", bound),
    )


CRITERIA = {
    "drift": Criterion(
        *_place("≤", 0.02, "water-hot water-cold gradient", "1/ns"),
        "|drift of the energy| over the mean kinetic energy",
        "1 % of kT in each degree of freedom a ns is 2 % of the kinetic energy a ns; it warms by "
        "1 %, as half of the heat is kinetic; "
        f"reduced units are read as argon's: 1 ns is {NS_OF_REDUCED:g} τ",
        "who samples at constant energy for a ns, and would notice 1 % in the temperature",
        (
            _change("water-hot", "0.0025 a ps → 0.004 a ps", KNOWN),
            _change("water-cold", "0.3 a ps → 0.02 a ps", KNOWN),
            _change("water-hot", "0.004 a ps, 4 a ns → 0.02 a ns", FOLLOWS, 0.02),
            _change("water-cold", "0.02 a ps, 20 a ns → 0.02 a ns", FOLLOWS, 0.02),
            _change(
                "gradient",
                "0.05 in the run, 0.58 a ns of a short one and 0.0116 of a full one → 0.02 a ns",
                FOLLOWS,
                0.02,
            ),
        ),
    ),
    "stable, many": Criterion(
        *_place("≤", 0.02, "water-dt peptide-dt"),
        "change of the energy in a run that counts as stable, over the kinetic energy",
        "1 % in the temperature, as half of the heat is kinetic",
        "who equilibrates for some ps, and would notice 1 % in the temperature",
        _kept("water-dt peptide-dt", "0.02", 0.02),
        inner=True,
    ),
    "stable, few": Criterion(
        *_place("≤", 0.1, "dimer-1 dimer-0.1 dimer-0.01"),
        "change of the energy in a run that counts as stable, over the kinetic energy",
        "the energy of few oscillators swings by (ωΔt)²/4, a quarter at ωΔt = 1; a fifth of the "
        "run has 10 samples, so its mean is off by a quarter over √10, 8 %; what is unstable "
        "gains without end and passes any such bound",
        "a long run that does not break",
        _kept("dimer-1 dimer-0.1 dimer-0.01", "0.1", 0.1),
        inner=True,
    ),
    "water's step": Criterion(
        *_place("≥", 6.0, "water-dt", "fs"),
        "longest stable step",
        LIBRATION,
        "who runs rigid water at the longest step that others have published",
        _kept("water-dt", "6 fs", 6.0),
    ),
    **{f"{name}'s step": _dimer(name, mass) for name, mass in _MASSES.items()},
    "peptide's step": Criterion(
        *_place("≥", 3.0, "peptide-dt", "fs"),
        "longest stable step",
        "the paper's step; six steps of a bond of 1,650 cm⁻¹, a period of 20 fs, are 3.4 fs",
        "who repeats the paper's runs",
        _kept("peptide-dt", "3 fs", 3.0),
    ),
    "top's energy": Criterion(
        *_place("≤", 2.5e-3, "needles disks"),
        "largest relative change of a free top's energy",
        "(|ω|Δt)² at 0.05 rad: the error of a scheme of second order, with a coefficient of 1 "
        "(velocity Verlet of an oscillator has 1/4); it does not grow",
        "who expects second order, and no drift",
        _kept("needles disks", "0.0025", 0.0025),
    ),
    "speeds' energy": Criterion(
        *_place("≤", 1.0, "turn-per-step"),
        "largest relative change of a free top's energy, over (|ω|Δt)², beside rounding",
        "as of needles, at each speed, beside twice the rounding of momenta, as the energy is "
        "their square: where (|ω|Δt)² is less than that, up to 3e-5 rad in 1e6 steps, it is a test "
        "of rounding",
        "who expects second order, and nothing lost at small angles",
        (
            _change("turn-per-step", f"(|ω|Δt)² and 1e-10 → {ROUNDED}", KNOWN),
            _change(
                "turn-per-step",
                f"{ROUNDED} → (|ω|Δt)², at most 0.1, and rounding as of momenta, 4.5e-10 in all",
                FOLLOWS,
            ),
            _change(
                "turn-per-step",
                "rounding as of momenta, 4.5e-10 in all → twice that, 8.9e-10 in all",
                "a relative error of a velocity counts twice in the kinetic energy, which the "
                "derivation had forgotten; seen after results were known, of which it changes "
                "Gear's",
                1.0,
            ),
        ),
        inner=True,
    ),
    "turn": Criterion(
        *_place("≥", 0.1, "turn-per-step", "rad"),
        "longest |ω|Δt up to which the energy is as a scheme of second order has it",
        "rigid TIP3P at 300 K turns about its axis of least moment, 0.6 amu Å², by √(kT/I) = 0.02 "
        "rad a fs; at 5 fs that is 0.1 rad",
        "who runs rigid water at 5 fs",
        _kept("turn-per-step", "0.1 rad", 0.1),
    ),
    "rounding": Criterion(
        *_place("≤", 2 * EPS, "needles disks long-dimer"),
        "relative change of what is kept exactly (momentum, angular momentum), in a step",
        "four roundings of half an ulp in a step, all to one side; beside them 1e4 ulps for what "
        "is read: atoms lie up to 1e3 σ from the origin, on arms of half a σ",
        "who relies on conservation laws",
        tuple(
            _change(cases, f"1e-9 in all → 4.4e-16 a step, {most} in all", FOLLOWS, 2 * EPS)
            for cases, most in (("needles disks", "8.9e-10"), ("long-dimer", "2.2e-8"))
        ),
    ),
    "orientation": Criterion(
        *_place("≤", 0.1, "needles disks", "σ"),
        "largest distance of an atom from the exact motion after 1,000 rad",
        "1 − cos φ ≤ 1 %: φ ≤ 0.1415 rad; the longest arm is 0.7071 σ",
        "who would notice 1 % in the correlation of orientations, ⟨u(0)·u(t)⟩",
        (
            _change("needles disks", "not asked for → 0.2 σ", KNOWN),
            _change("needles disks", "0.2 σ → 0.1 σ", FOLLOWS, 0.1),
        ),
    ),
    "tumbling": Criterion(
        *_place("≤", 1e-2, "middle-axis"),
        "relative error of the mean time between two turns over",
        "(|ω|Δt)² at 0.1 rad, the error of a scheme of second order with a coefficient of 1",
        "who would notice 1 % in the rate of tumbling",
        _kept("middle-axis", "0.01", 0.01),
    ),
    "shape": Criterion(
        *_place("≤", 1.0, "long-dimer"),
        "largest relative change of a distance in a body, over what was asked for",
        "of shake and rattle, the tolerance that they are given; of a rigid integrator, rounding "
        "as of momenta",
        "who asks for a tolerance",
        (
            _change(
                "long-dimer",
                "1e-7 → the tolerance that is asked for, or rounding",
                f"a tolerance of 1e-4 was held against 1e-7; {FOLLOWS}",
                1.0,
            ),
        ),
    ),
    "long run": Criterion(
        *_place("≤", 0.02, "long-dimer"),
        "change of the mean energy from the first tenth of the run to the last, over the kinetic "
        "energy",
        "1 % in the temperature of the whole run, as half of the heat is kinetic",
        "who would notice 1 % in the temperature",
        (_change("long-dimer", "0.01 → 0.02", FOLLOWS, 0.02),),
    ),
    "far place": Criterion(
        *_place("≤", 1e-6, "far-away", "σ"),
        "largest distance from the same bodies at the origin",
        "1e7 σ from the origin a position is rounded by 0.9e-9 σ; 100 steps to one side, in three "
        "directions, are 1.6e-7 σ; collisions amplify that e^(3 · 0.4) = 3.3-fold, with an "
        "exponent of 3/τ as of a dense liquid: 5e-7 σ, up to a power of ten",
        "who has a large box, or one far from the origin",
        _kept("far-away", "1e-6 σ", 1e-6),
    ),
    "far pressure": Criterion(
        *_place("≤", 1e-3, "far-away"),
        "largest relative change of the pressure against the same bodies at the origin",
        "three digits, to which pressures of simple liquids are published; rounding there is far "
        "below",
        "who compares a pressure with tables",
        _kept("far-away", "0.001", 1e-3),
    ),
    "order of sums": Criterion(
        *_place("≤", 1e3, "ranks"),
        "largest distance from the trajectory of one rank, over that of a start moved by 1e-15 σ",
        "each step rounds a position by 1e-15 σ, and a velocity of 40 σ/τ by 3.6e-15 σ/τ, which "
        "moves a body by 2.8e-15 σ in 0.8 τ: 4 times the start's move; 200 steps to one side are "
        "800 times, up to a power of ten",
        "who changes the number of ranks and expects the same physics",
        (
            _change(
                "ranks",
                "1e-8 σ, whatever the rounding does → 1e3 times a start moved by rounding",
                "another number, as the first could not tell rounding from faults",
            ),
            *_kept("ranks", "1e3", 1e3),
        ),
    ),
}


# of several criteria at once: each number over its own bound
EACH = Criterion(*_place("≤", 1.0, ""), "the largest of all, each over its bound", "", "", ())


def of_case(name: str) -> dict[str, Criterion]:
    """Criteria of a case, by name."""
    return {key: one for key, one in CRITERIA.items() if name in one.cases}


def rounding(steps: int) -> float:
    """What rounding may do to a number that is kept exactly, relative to it, in so many steps."""
    return CRITERIA["rounding"].bound * (steps + READING)


def in_a_step(change: float, steps: int) -> float:
    """What a relative change in so many steps is in a step, as the criterion of rounding has it."""
    return change / (steps + READING)
