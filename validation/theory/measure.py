"""What section II of the paper proves, measured: each statement a number between bounds.

    reversal      forward and back, in LAMMPS, with every integrator
    symplectic    (2.42), of the Jacobian of a whole step
    conserved     the energy error's dt^2 law, its leading term (2.37), the oscillator's exact
                  Hamiltonian (2.51)
    mrot          the free rotor against the exact top
    rotors        the free rotation in the compiled loops, split and exact: error and cost
    recursion     (2.30), where a conserved quantity exists and where it does not
    loops         (2.42), volume and reversal of the compiled loops themselves, and how far they are
                  from the equations, for random bodies

All but reversal, rotors and loops take the same equations in Python (`reference`), complex numbers
and all: these are exact to rounding.  Each is a function of a `Bench` that gives what its figure
shows.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from scipy.linalg import expm

from fix_nosquish.motion.rotor import free_rotor

from ..running.run import Meter
from ..scenes import SCENES, TEMPERATURE, Scene
from ..scenes.units import BOLTZMANN
from ..statistics import measures
from ..statistics.check import Check
from ..statistics.estimate import Estimate
from . import calculus, reversal
from . import loops as compiled
from . import rotors as free
from .reference import FS, Dimer, Oscillator, multiply
from .top import free_top

ROUND_OFF = 1e-12  # the most that rounding may leave of numbers of order one
SHOWN = 1e-9  # the least that is not rounding
MULTIPLES = 0.25, 0.5, 1.0, 2.0, 4.0  # of the scene's time step: a factor of 16
TOLERANCES = 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14  # of SHAKE
MROTS = 1, 2, 4, 8, 16, 32
TOPS, TURNS = 20, 50  # of the free rotor: bodies, time steps
KT = BOLTZMANN * TEMPERATURE["dimer"]  # kcal/mol
# A reversal is judged where chaos has not made much of rounding yet: of 1e-15 Angstrom it makes
# 1e-13 in 300 steps and back, 1e-11 to 1e-10 in 1,000, as luck and processor have it, up to 1e-4 in
# 3,000.
REVERSED = 300  # steps
# Angstrom that may be left: converged shake leaves 4e-12, because it first corrects the data file's
# own lengths
RETURNED = 1e-10
LENGTH = 1.0  # Angstrom: about a bond's, of which a tolerance is a part
# The compiled loops' derivatives are differences: steps of 0.01 to 0.0025, extrapolated twice, and
# leave less than the extrapolation once does, 0.005^4 = 6e-10 times a fifth derivative of order
# one, and rounding, 1e-16 / 0.0025; what is said of them is said to 1e-8.
DIFFERENCES = 1e-8
# the most that a step of the loops and of the equations may be apart: some hundred rounding errors
TIED = 1e-13
STEPS_OF_LOOPS = 0.05, 0.07, 0.1, 0.14, 0.2  # with forces and rates of rotation of about a third
RANDOM = 500  # bodies of each kind, order, mrot and scheme
Points = Sequence[float] | np.ndarray
CURL = 0.3  # of the force without a potential, over dt^2, that breaks a scheme


@dataclass
class Bench:
    """What a part works with, and the checks that it makes."""

    part: str
    scene: Scene
    dimer: Dimer
    out: Path  # for runs of LAMMPS
    silence: float  # s without a word in its log after which such a run is given up
    meter: Meter
    pieces: int  # of work, that the part tells of
    done: int = 0
    checks: list[Check] = field(default_factory=list)

    def tick(self) -> None:
        """A piece is done."""
        self.done += 1
        self.meter.at(self.done)
        if self.done == self.pieces:
            self.meter.end(None)

    def check(self, subject: str, what: str, found: Estimate | float | None, **bounds) -> None:
        """A number, and its bounds."""
        self.checks.append(Check.of(self.part, subject, what, found, **bounds))

    def power(
        self, subject: str, what: str, x: Points, y: Points, law: float, within: float
    ) -> None:
        """The exponent of y ~ x^exponent, and what it is to be."""
        what = f"{what} to the power of"
        low, high = round(law - within, 9), round(law + within, 9)
        self.check(subject, what, calculus.slope(x, y), low=low, high=high)


def theory(
    parts: Iterable[str], out: Path, meter: Meter, silence: float = 120.0
) -> tuple[list[Check], dict, bool]:
    """Measure parts of the theory.

    Returns:
        the checks; part to what its figure shows, plain data; whether a Ctrl-C ended it, which
        leaves the parts that were complete.
    """
    scene = SCENES["dimer"]
    dimer = Dimer(scene)
    checks, data = [], {}
    try:
        for name in parts:
            function, pieces = PARTS[name]
            bench = Bench(name, scene, dimer, out, silence, meter, pieces)
            meter.begin(name, pieces)
            data[name] = function(bench)
            checks += bench.checks
    except KeyboardInterrupt:
        return checks, data, True
    return checks, data, False


# ---- forward and back


def reversed_(bench: Bench) -> dict:
    """Forward and back in LAMMPS; and that the other parts' equations are what runs there."""
    scene, rows = bench.scene, []
    for integrator in reversal.INTEGRATORS:
        rows.append(reversal.reverse(scene, integrator, bench.out / "runs", bench.silence))
        bench.tick()
    at = reversal.STEPS.index(REVERSED)
    come_back = "NVE", "MatubayasiNakahara", "rigid/nve", "rigid/nve/small"
    bounds = {name: {"high": RETURNED} for name in come_back}
    bounds |= {name: {"low": SHOWN} for name in ("Gear", "rigid", "rigid/small")}
    far = f"distance from the start after {REVERSED:,} steps and back"
    notes = {"Gear": "its derivatives are made anew at the reversal, of force and torque"}
    for row in rows:
        if row.error:
            bench.check(row.label, far, None, note=row.error)
        elif row.tolerance is None:
            how = {"unit": "Å", "note": notes.get(row.name, "")} | bounds.get(row.name, {})
            bench.check(row.label, far, row.distance[at], **how)
    *loose, converged = reversal.TOLERANCES
    for style in "shake", "rattle":
        mine = [row for row in rows if row.name == style and not row.error]
        found = {row.tolerance: row.distance[at] for row in mine}
        if len(found) == len(reversal.TOLERANCES):
            most = max(found[float(one)] / float(one) for one in loose)
            what = f"{far}, over the tolerance, largest for {loose[0]} to {loose[-1]}"
            check, last = partial(bench.check, style, unit="Å"), found[float(converged)]
            check(f"{far}, tolerance 1e-4", found[1e-4], low=SHOWN)
            check(f"{far}, tolerance {converged}", last, high=RETURNED)
            check(what, most, high=LENGTH)
    n, dimer = reversal.COMPARED, bench.dimer
    equations = {"NVE": dimer.nosquish, "MatubayasiNakahara": dimer.reference_12}
    for row in rows:
        if row.name in equations and not row.error:
            x = calculus.repeated(equations[row.name], n)(dimer.start, n * scene.dt * FS)
            apart = np.abs(dimer.positions(x).reshape(3, 6).T - row.positions).max()
            what = f"LAMMPS less the equations of the other parts, after {n} steps"
            bench.check(row.label, what, apart, high=ROUND_OFF, unit="Å")
    runs = [row.plain() for row in rows]
    return {"steps": reversal.STEPS, "runs": runs, "dt_fs": scene.dt}


# ---- symplectic


def symplectic(bench: Bench) -> dict:
    """|J g^-1 J^T - g^-1| of a whole step, of all p and q, and as much of it as concerns |q| = 1;
    det J; a model of SHAKE against tolerance."""
    scene, dimer = bench.scene, bench.dimer
    steps = {"NO_SQUISH": dimer.nosquish, "reference 12": dimer.reference_12}
    basis = calculus.tangent(dimer.constraints, dimer.start)
    defect: dict[str, list[float]] = {name: [] for name in steps}
    sphere: dict[str, list[float]] = {name: [] for name in steps}
    volume: dict[str, list[float]] = {name: [] for name in steps}
    for multiple in MULTIPLES:
        for name, step in steps.items():
            J = calculus.jacobian(partial(step, time=multiple * scene.dt * FS), dimer.start)
            defect[name].append(calculus.symplectic_defect(J))
            sphere[name].append(calculus.restricted(J @ basis, basis)[0])
            volume[name].append(float(abs(np.linalg.det(J) - 1)))
            bench.tick()
    largest, usual = f"largest of {len(MULTIPLES)} time steps", MULTIPLES.index(1)
    for what, found in ("|J g⁻¹ Jᵀ − g⁻¹|", defect), ("|Jᵀ g J − g| on |q| = 1, w₀ = 0", sphere):
        ours, other = found.values()
        bench.check("NO_SQUISH", f"{what}, {largest}", max(ours), high=ROUND_OFF)
        bench.check("reference 12", f"{what} at {scene.dt:g} fs", other[usual], low=SHOWN)
        bench.power("reference 12", f"{what} ∝ Δt", MULTIPLES[:3], other[:3], 3.0, 0.2)
    for name, lost in volume.items():
        bench.check(name, f"|det J − 1|, {largest}", max(lost), high=ROUND_OFF)
    return {
        "dt_fs": [multiple * scene.dt for multiple in MULTIPLES],
        "defect": defect,
        "sphere": sphere,
        "volume": volume,
        "tolerance": TOLERANCES,
        "shake": _shaken(bench),
    }


def _shaken(bench):
    """The defect of a model of SHAKE with each tolerance."""
    atoms, shaken, changed = bench.dimer.atoms, [], []
    basis = calculus.tangent(atoms.constraints, atoms.start)
    for tolerance in TOLERANCES:
        step = partial(atoms.shake_rattle, time=bench.scene.dt * FS, tolerance=tolerance)
        one, other = calculus.restricted(calculus.jacobian(step, atoms.start) @ basis, basis)
        shaken.append(one)
        changed.append(abs(other - 1))
        bench.tick()
    model, last = "SHAKE/RATTLE in Python", f"tolerance {TOLERANCES[-1]:g}"
    what, loose = "|Jᵀ g J − g| on the phase space of rigid molecules", TOLERANCES.index(1e-4)
    bench.check(model, f"{what}, tolerance 1e-4", shaken[loose], low=SHOWN)
    bench.check(model, f"{what}, {last}", shaken[-1], high=ROUND_OFF)
    bench.power(model, "that ∝ tolerance", TOLERANCES[:-1], shaken[:-1], 1.0, 0.2)
    bench.check(model, f"change of volume, {last}", changed[-1], high=ROUND_OFF)
    return shaken


# ---- a conserved quantity


def conserved(bench: Bench) -> dict:
    """How the spread of H and of H + dt^2 H^(2) along a trajectory falls with dt, for dimer and
    free rotor; and (2.51)."""
    scene, dimer = bench.scene, bench.dimer
    dt, radius = np.array(MULTIPLES) * scene.dt * FS, scene.dt * FS / 2
    force, rotor = dimer.second_order_terms(radius)
    parts, energy = dimer.rotor_parts(), dimer.energy
    whole = {"": [], "force": [force], "rotor": [rotor], "both": [force, rotor]}
    twice = {"": [], "both": dimer.second_order_terms(radius, mrot=2)}
    runs = {
        "NO_SQUISH": (dimer.nosquish, energy, whole),
        "NO_SQUISH, m_rot 2": (partial(dimer.nosquish, mrot=2), energy, twice),
        "free rotor": (
            calculus.strang(parts),
            lambda x: sum(part.energy(x) for part in parts),
            {"": [], "rotor": [rotor]},
        ),
    }
    spread = {}
    for scheme, run in runs.items():
        spread[scheme] = found = _spreads(bench, dt, *run)
        bench.power(scheme, "spread of H ∝ Δt", dt, found[""], 2.0, 0.1)
        complete = list(found.values())[-1]
        bench.power(scheme, "spread of H + Δt² H⁽²⁾ ∝ Δt", dt, complete, 4.0, 0.1)
    alone = {which: values[0] for which, values in spread["NO_SQUISH"].items()}
    at = f"spread at {MULTIPLES[0] * scene.dt:g} fs"
    for which, other in ("force", "rotor"), ("rotor", "force"):
        what = f"{at} without the {other} splitting's H⁽²⁾, over that with both"
        bench.check("NO_SQUISH", what, alone[which] / alone["both"], low=10)
    what = f"{at} by the force splitting's H⁽²⁾, over that by the rotor splitting's"
    note = "so little of the energy's error is the rotor's, whatever its scheme"
    bench.check("NO_SQUISH", what, alone["rotor"] / alone["force"], low=100, note=note)
    _oscillator(partial(bench.check, "velocity Verlet, oscillator"))
    bench.tick()
    return {"dt_fs": (dt / FS).tolist(), "spread": spread}


def _spreads(bench, dt, step, energy, corrections):
    """The spread of an energy with each of some corrections, along a trajectory with each time
    step."""
    found: dict[str, list[float]] = {which: [] for which in corrections}
    start = bench.dimer.start
    for multiple, length in zip(MULTIPLES, dt):
        steps = calculus.repeated(step, round(MULTIPLES[-1] / multiple))
        states = [start]
        for _ in range(40):  # at the same times with each time step
            states.append(steps(states[-1], dt[-1]))
        x = np.stack(states, axis=1)
        for which, terms in corrections.items():
            total = energy(x) + length**2 * sum(term(x) for term in terms)
            found[which].append(float(np.sqrt(np.mean((total[1:] - total[0]) ** 2))))
        bench.tick()
    return found


def _oscillator(check):
    """Velocity Verlet beside (2.51): how much that changes, how far a step is from its motion, and
    its dt^2 term from (2.37)."""
    oscillator, x = Oscillator(mass=1.3, omega=0.7), np.array([0.4, -1.1])
    step, changes, motions = calculus.strang(oscillator.parts()), [], []
    for dt in np.linspace(0.1, 1.99, 20) / oscillator.omega:
        hamiltonian = partial(oscillator.integrator_hamiltonian, dt=dt)
        after = calculus.repeated(step, 1000)(x, 1000 * dt)
        changes.append(abs(hamiltonian(after) / hamiltonian(x) - 1))
        # derivatives; there is no mixed one
        second = np.diag([2 * hamiltonian(axis) for axis in np.eye(2)])
        flow = expm(dt * (second @ calculus.metric(1)).T)  # dx/dt = grad H g^-1 (2.41)
        matrix = np.transpose([step(axis, dt) for axis in np.eye(2)])  # the step is linear
        motions.append(np.abs(flow - matrix).max())
    radius, wide = 0.1 / oscillator.omega, x[:, None]
    exact = calculus.taylor(partial(oscillator.integrator_hamiltonian, wide), 2, radius).real
    term = abs(exact - calculus.leading_term(oscillator.parts(), radius)(x))
    what = "relative change of (2.51) in 1,000 steps, largest for ω Δt up to 1.99"
    check(what, max(changes), high=1e-10)
    check("a step less the motion under (2.51), largest", max(motions), high=ROUND_OFF)
    check("H⁽²⁾ (2.37) less the Δt² term of (2.51)", term, high=ROUND_OFF)


def mrot(bench: Bench) -> dict:
    """The error of free rotors after some steps with so many inner steps, against Jacobi's elliptic
    functions."""
    moments, dt = bench.dimer.moments[:, 0], MULTIPLES[-1] * bench.scene.dt * FS
    rng = np.random.default_rng(2002)
    q = rng.normal(size=(4, TOPS))
    q /= np.linalg.norm(q, axis=0)
    L = rng.normal(size=(3, TOPS)) * np.sqrt(KT * moments)[:, None]
    p = 2 * multiply(q, np.concatenate([np.zeros((1, TOPS)), L]))
    exact = np.transpose([free_top(*top, moments, TURNS * dt)[0] for top in zip(q.T, L.T)])
    errors = []
    for inner in MROTS:
        a, b = q, p
        for _ in range(TURNS * inner):
            a, b = free_rotor(a, b, *moments, dt / inner, True)
        sign = np.sign((a * exact).sum(axis=0))
        errors.append(float(np.abs(a * sign - exact).max()))
        bench.tick()
    last = MROTS[-1]
    what = f"error of q after {TURNS} steps ∝ m_rot"
    bench.power("free rotor", what, MROTS, errors, -2.0, 0.05)
    what, over = f"that error with m_rot {last} times {last}², over that with 1", last**2
    bench.check("free rotor", what, errors[-1] / errors[0] * over, low=0.95, high=1.05)
    return {"mrot": MROTS, "error": errors, "dt_fs": dt / FS, "temperature": TEMPERATURE["dimer"]}


def rotors(bench: Bench) -> dict:
    """The free rotation of water in the compiled loops: its error against Jacobi's elliptic
    functions, and the time of a step beside that of the split one."""
    errors: dict[str, list[float]] = {}
    costs: dict[str, measures.Spread] = {}
    for name, found in free.errors():
        errors[name] = found
        bench.tick()
    for name, ratios in free.costs(bench.tick).items():
        costs[name] = measures.spread(ratios)
    split, *_, exact = free.ROTORS
    few = 4  # of the smallest angles: where the law of the error holds
    what = f"error of the orientation after {free.TOTAL:g} rad ∝ Δt"
    bench.power(split, what, free.ANGLES[:few], errors[split][:few], 2.0, 0.05)
    what = f"error of the orientation after {free.TOTAL:g} rad, largest for "
    what += f"{free.ANGLES[0]:g} to {free.ANGLES[-1]:g} rad in a step"
    bench.check(exact, what, max(errors[exact]), high=ROUND_OFF)
    return {
        "angles": free.ANGLES,
        "total": free.TOTAL,
        "thermal": free.thermal(),
        "error": errors,
        "cost": costs,
    }


# ---- the recursion


def recursion(bench: Bench) -> dict:
    """(2.30) for n = 1, G^(0) . grad H^(1) + G^(1) . grad H^(0) = 0, where it can be met and where
    it cannot.

    It cannot be met by any H^(1) if the second term has an average along a closed orbit of the
    exact motion, because the first one, the change of H^(1) along it, has none. All orbits of an
    isotropic oscillator are closed. There the force is given an addition dt^2 CURL (-q_2, q_1),
    which has no potential: the scheme stays reversible, of second order, and keeps phase-space
    volume.
    """
    # at half a step some states meet a singularity
    dimer, dt = bench.dimer, bench.scene.dt * FS
    force, rotor = dimer.second_order_terms(dt / 4)
    states = [dimer.start]
    for _ in range(8):
        states.append(calculus.repeated(dimer.nosquish, 20)(states[-1], 20 * dt))
    bench.tick()
    exact, x = calculus.fourth_order(dimer.nosquish), np.stack(states, axis=1)
    functions = dimer.nosquish, exact, dimer.energy, lambda x: force(x) + rotor(x)
    terms = calculus.recursion_terms(*functions, x, dt / 4)
    bench.tick()
    what = "|G⁽⁰⁾·∇H⁽¹⁾ + G⁽¹⁾·∇H⁽⁰⁾| over one term, largest"
    bench.check("NO_SQUISH", f"{what} of {len(states)} states", _rest(terms), high=1e-8)
    return _broken(bench, what)


def _broken(bench, what):
    """The same of an oscillator by velocity Verlet, and with a curl."""
    oscillator = Oscillator(mass=1.0, omega=1.0)
    verlet = calculus.strang(oscillator.parts())

    def curl(x, time):
        return x + CURL * time**3 * np.stack([-x[3], x[2], 0 * x[0], 0 * x[0]])

    def broken(x, time):
        return curl(verlet(curl(x, time / 2), time), time / 2)

    start = np.array([0.1, 0.9, 1.0, -0.2])  # p_1, p_2, q_1, q_2
    p, q = np.split(start, 2)
    angles = np.arange(64) * 2 * np.pi / 64
    c, s = np.cos(angles), np.sin(angles)
    orbit = np.concatenate([np.outer(p, c) - np.outer(q, s), np.outer(q, c) + np.outer(p, s)])
    second = calculus.leading_term(oscillator.parts(), 0.1)
    common = calculus.fourth_order(verlet), oscillator.energy, second, orbit, 0.1
    whole, cut = (calculus.recursion_terms(step, *common) for step in (verlet, broken))
    # both half steps add CURL (dt/2)^3; p . (-q_2, q_1) is the angular momentum
    gain = CURL / 4 * (q[0] * p[1] - q[1] * p[0])
    dt, time, energies = 0.05, np.linspace(0, 200, 101), {}
    for name, step in ("velocity Verlet", verlet), ("with a curl", broken):
        x, energies[name] = start, [float(oscillator.energy(start))]
        for passed in np.diff(time):
            x = calculus.repeated(step, round(passed / dt))(x, passed)
            energies[name].append(float(oscillator.energy(x)))
        bench.tick()
    turned, many = np.array([-1, -1, 1, 1]), calculus.repeated(broken, 1000)
    back = turned * many(turned * many(start, 1000 * dt), 1000 * dt)
    J = calculus.jacobian(lambda x: broken(x, 0.5), start)
    still, drift = (
        measures.drift(time, np.array(one)).times(1 / (dt**2 * gain)) for one in energies.values()
    )
    average, mean = "average of G⁽¹⁾·∇H⁽⁰⁾ along a closed orbit", cut[1].mean()
    check = partial(bench.check, "velocity Verlet, oscillator")
    check(f"{what} of {len(angles)} states", _rest(whole), high=1e-8)
    check(f"|{average}|", abs(whole[1].mean()), high=SHOWN)
    check("drift of H over Δt² times the power of the curl", still, low=-0.01, high=0.01)
    check = partial(bench.check, "oscillator with a curl")
    check(average, mean, low=SHOWN)
    check("that less the power of the curl", abs(mean - gain), high=SHOWN)
    check("drift of H over Δt² times that average", drift, low=0.95, high=1.05)
    far = np.abs(back - start).max()
    check("distance from the start after 1,000 steps and back", far, high=1e-10)
    check("|det J − 1|", abs(np.linalg.det(J) - 1), high=ROUND_OFF)
    check("|J g⁻¹ Jᵀ − g⁻¹|", calculus.symplectic_defect(J), low=SHOWN)
    return {"time": time.tolist(), "energy": energies, "gain": float(dt**2 * gain)}


def _rest(terms):
    """What two terms leave of each other, over the larger one's size; largest of several states
    each."""
    return np.abs(terms.sum(axis=0)).max() / np.abs(terms).max()


# ---- the compiled loops

NAMES = {"NVE": "NO_SQUISH", "MatubayasiNakahara": "reference 12"}


def loops(bench: Bench) -> None:
    """What is measured on the machine code that runs in LAMMPS; a pair of bodies of each kind, but
    nearly linear ones, which are too stiff."""
    for scheme in NAMES:
        for kind in compiled.KINDS:
            if kind != "nearly linear":
                _pair(bench, scheme, kind)
            bench.tick()
    for scheme in compiled.SCHEMES:
        for kind in compiled.KINDS:
            _tied(bench, scheme, kind)
            bench.tick()


def _pair(bench, scheme, kind):
    rng = np.random.default_rng(2002)
    pair = compiled.Scene(kind, 2, rng, scheme)
    start, longest = pair.random(rng), STEPS_OF_LOOPS[-1]
    found = np.transpose([pair.defects(start, dt) for dt in STEPS_OF_LOOPS])
    defects, volumes, errors = found
    check = partial(bench.check, f"{NAMES[scheme]}, {kind}")
    largest, form = f"largest of {len(STEPS_OF_LOOPS)} time steps", "|Jᵀ g J − g| of the compiled"
    most = Estimate(defects.max(), errors.max())
    # reference 12 is exact where there is one way to turn
    if scheme == "NVE" or kind not in ("solid", "planar"):
        check(f"{form} loops, {largest}", most, high=DIFFERENCES)
    else:
        last = Estimate(defects[-1], errors[-1])
        check(f"{form} loops at Δt = {longest}", last, low=100 * DIFFERENCES)
        what = f"{form} loops ∝ Δt"
        bench.power(f"{NAMES[scheme]}, {kind}", what, STEPS_OF_LOOPS, defects, 3.0, 0.2)
    volume = Estimate(volumes.max(), errors.max())
    check(f"change of volume, {largest}", volume, high=DIFFERENCES)
    check("100 steps forward and back", pair.returned(start, longest, 100), high=ROUND_OFF)


def _tied(bench, scheme, kind):
    """Loops beside equations."""
    rng, every = np.random.default_rng(53), [(o, m) for o in (321, 123) for m in (1, 2, 3, 4)]
    scenes = [compiled.Scene(kind, RANDOM, rng, scheme, *one) for one in every]
    apart, slow = np.max([one.apart(rng, scheme) for one in scenes], axis=0)
    check = partial(bench.check, f"{NAMES[scheme]}, {kind}")
    what = "a step of the compiled loops less one by the equations"
    what = f"{what}, {len(scenes) * RANDOM:,} random bodies"
    check(f"{what}, over what a relative change grows by", apart, high=TIED)
    if kind != "nearly linear":
        check(f"{what}, those that turn by up to 1 rad", slow, high=TIED)


Part = tuple[Callable[[Bench], dict | None], int]  # and the pieces of work that it tells of
PARTS: dict[str, Part] = {
    "reversal": (reversed_, len(reversal.INTEGRATORS)),
    "symplectic": (symplectic, 2 * len(MULTIPLES) + len(TOLERANCES)),
    "conserved": (conserved, 3 * len(MULTIPLES) + 1),
    "mrot": (mrot, len(MROTS)),
    "rotors": (rotors, len(free.ROTORS) + free.ROUNDS),
    "recursion": (recursion, 4),
    "loops": (loops, 4 * len(compiled.KINDS)),
}
