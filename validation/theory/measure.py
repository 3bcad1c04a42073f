"""What section II of the paper proves, measured: each statement a number between bounds.

    reversal      forward and back, in LAMMPS, with every integrator
    symplectic    (2.42), of the Jacobian of a whole step
    conserved     the energy error's dt^2 law, its leading term (2.37), the oscillator's exact Hamiltonian (2.51)
    mrot          the free rotor against the exact top
    recursion     (2.30), where a conserved quantity exists and where it does not
    loops         (2.42), volume and reversal of the compiled loops themselves, and how far they are from the equations, for random bodies

All but the first and the last take the same equations in Python (`theory_reference`), complex
numbers and all: these are exact to rounding.
"""

from functools import partial

import numpy as np
from scipy.linalg import expm

from fix_nosquish.rotor import free_rotor
from validation.running import run
from validation.scenes import SCENES
from validation.statistics import measures
from validation.statistics.check import Check
from validation.theory import calculus
from validation.theory import reversal as theory_reversal
from validation.theory.loops import SCHEMES, KINDS, Scene
from validation.theory.reference import FS, Dimer, Oscillator, multiply
from validation.theory.top import free_top

ROUND_OFF = 1e-12  # the most that rounding may leave of numbers of order one
SHOWN = 1e-9  # the least that is not rounding
MULTIPLES = 0.25, 0.5, 1.0, 2.0, 4.0  # of the scene's time step: a factor of 16
TOLERANCES = 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14  # of SHAKE
MROTS = 1, 2, 4, 8, 16, 32
TOPS, TURNS = 20, 50  # of the free rotor: bodies, time steps
TEMPERATURE = 155.0  # K, of the dimer
KT = 0.0019872067 * TEMPERATURE  # kcal/mol, with LAMMPS's Boltzmann constant
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
CURL = 0.3  # of the force without a potential, over dt^2, that breaks a scheme


def theory(parts, out, meter, silence=120.0):
    """Measure parts of the theory.

    Args:
        parts: names of `PARTS`.
        out: folder for the runs of LAMMPS.
        meter: a `console.Meter`.
        silence: s without a word in its log after which a run of LAMMPS is given up.
    Returns:
        (checks, data, interrupted): a list of `Check`; part to what its figure shows, plain data;
        whether a Ctrl-C ended it, which leaves the parts that were complete.
    """
    scene = SCENES["dimer"]
    dimer = Dimer(scene)
    checks, data = [], {}
    try:
        for name in parts:
            function, total = PARTS[name]
            done, data[name] = function(
                scene, dimer, _Ticks(meter, name, total), out=out, silence=silence
            )
            checks += done
    except KeyboardInterrupt:
        return checks, data, True
    return checks, data, False


class _Ticks:
    """A part's line in the meter; a call is a piece done."""

    def __init__(self, meter, name, total):
        self.meter, self.done, self.total = meter, 0, total
        meter.begin(name, total)

    def __call__(self):
        self.done += 1
        self.meter.at(self.done)
        if self.done == self.total:
            self.meter.end(None)


def reversal(scene, dimer, tick, out, silence):
    """Forward and back in LAMMPS; and that the other parts' equations are what runs there."""
    rows = []
    for integrator, tolerance in theory_reversal.INTEGRATORS:
        folder = out / "runs" / run.folder_name(integrator.label)
        rows.append(
            theory_reversal.reverse(scene, integrator, folder, silence) | {"tolerance": tolerance}
        )
        tick()
        if rows[-1]["error"] == run.INTERRUPTED:
            raise KeyboardInterrupt
    check, checks, at = partial(Check, "reversal"), [], theory_reversal.STEPS.index(REVERSED)
    bounds = {
        name: {"high": RETURNED}
        for name in ("NVE", "MatubayasiNakahara", "rigid/nve", "rigid/nve/small")
    }
    bounds |= {name: {"low": SHOWN} for name in ("Gear", "rigid", "rigid/small")}
    far = f"distance from the start after {REVERSED:,} steps and back"
    notes = {"Gear": "its derivatives are made anew at the reversal, of force and torque"}
    for row in rows:
        if row["error"]:
            checks.append(check(row["label"], far, None, note=row["error"]))
        elif row["tolerance"] is None:
            checks.append(
                check(
                    row["label"],
                    far,
                    row["distance"][at],
                    unit="Å",
                    note=notes.get(row["name"], ""),
                    **bounds.get(row["name"], {}),
                )
            )
    for style in "shake", "rattle":
        found = {
            row["tolerance"]: row["distance"][at]
            for row in rows
            if row["name"] == style and not row["error"]
        }
        if len(found) == len(theory_reversal.TOLERANCES):
            *loose, converged = theory_reversal.TOLERANCES
            most = max(found[float(tolerance)] / float(tolerance) for tolerance in loose)
            checks += [
                check(style, f"{far}, tolerance 1e-4", found[1e-4], low=SHOWN, unit="Å"),
                check(
                    style,
                    f"{far}, tolerance {converged}",
                    found[float(converged)],
                    high=RETURNED,
                    unit="Å",
                ),
                check(
                    style,
                    f"{far}, over the tolerance, largest for {loose[0]} to {loose[-1]}",
                    most,
                    high=LENGTH,
                    unit="Å",
                ),
            ]
    n = theory_reversal.COMPARED
    equations = {"NVE": dimer.nosquish, "MatubayasiNakahara": dimer.reference_12}
    for row in rows:
        if row["name"] in equations and not row["error"]:
            x = calculus.repeated(equations[row["name"]], n)(dimer.start, n * scene.dt * FS)
            apart = np.abs(dimer.positions(x).reshape(3, 6).T - row["positions"]).max()
            checks.append(
                check(
                    row["label"],
                    f"LAMMPS less the equations of the other parts, after {n} steps",
                    apart,
                    high=ROUND_OFF,
                    unit="Å",
                )
            )
    rows = [{key: value for key, value in row.items() if key != "positions"} for row in rows]
    return checks, {"steps": theory_reversal.STEPS, "runs": rows, "dt_fs": scene.dt}


def symplectic(scene, dimer, tick, **_):
    """|J g^-1 J^T - g^-1| of a whole step, of all p and q, and as much of it as concerns |q| = 1;
    det J; a model of SHAKE against tolerance."""
    check, checks = partial(Check, "symplectic"), []
    steps = {"NO_SQUISH": dimer.nosquish, "reference 12": dimer.reference_12}
    basis = calculus.tangent(dimer.constraints, dimer.start)
    defect, sphere, volume = ({name: [] for name in steps} for _ in range(3))
    for multiple in MULTIPLES:
        for name, step in steps.items():
            J = calculus.jacobian(partial(step, time=multiple * scene.dt * FS), dimer.start)
            defect[name].append(calculus.symplectic_defect(J))
            sphere[name].append(calculus.restricted(J, basis)[0])
            volume[name].append(float(abs(np.linalg.det(J) - 1)))
            tick()
    largest, usual = f"largest of {len(MULTIPLES)} time steps", MULTIPLES.index(1)
    for what, found in ("|J g⁻¹ Jᵀ − g⁻¹|", defect), ("|Jᵀ g J − g| on |q| = 1, w₀ = 0", sphere):
        checks += [
            check("NO_SQUISH", f"{what}, {largest}", max(found["NO_SQUISH"]), high=ROUND_OFF),
            check(
                "reference 12",
                f"{what} at {scene.dt:g} fs",
                found["reference 12"][usual],
                low=SHOWN,
            ),
            _power(
                check,
                "reference 12",
                f"{what} ∝ Δt to the power of",
                MULTIPLES[:3],
                found["reference 12"][:3],
                2.8,
                3.2,
            ),
        ]
    checks += [
        check(name, f"|det J − 1|, {largest}", max(found), high=ROUND_OFF)
        for name, found in volume.items()
    ]

    shaken, changed = [], []
    basis = calculus.tangent(dimer.atoms.constraints, dimer.atoms.start)
    for tolerance in TOLERANCES:
        step = partial(dimer.atoms.shake_rattle, time=scene.dt * FS, tolerance=tolerance)
        J = calculus.jacobian(step, dimer.atoms.start)
        one, other = calculus.restricted(J, basis)
        shaken.append(one)
        changed.append(abs(other - 1))
        tick()
    model, what, last = (
        "SHAKE/RATTLE in Python",
        "|Jᵀ g J − g| on the phase space of rigid molecules",
        f"tolerance {TOLERANCES[-1]:g}",
    )
    checks += [
        check(model, f"{what}, tolerance 1e-4", shaken[TOLERANCES.index(1e-4)], low=SHOWN),
        check(model, f"{what}, {last}", shaken[-1], high=ROUND_OFF),
        _power(
            check, model, "that ∝ tolerance to the power of", TOLERANCES[:-1], shaken[:-1], 0.8, 1.2
        ),
        check(model, f"change of volume, {last}", changed[-1], high=ROUND_OFF),
    ]
    dt = [multiple * scene.dt for multiple in MULTIPLES]
    return checks, {
        "dt_fs": dt,
        "defect": defect,
        "sphere": sphere,
        "volume": volume,
        "tolerance": TOLERANCES,
        "shake": shaken,
    }


def conserved(scene, dimer, tick, **_):
    """How the spread of H and of H + dt^2 H^(2) along a trajectory falls with dt, for dimer and
    free rotor; and (2.51)."""
    check, checks = partial(Check, "conserved"), []
    dt, radius = np.array(MULTIPLES) * scene.dt * FS, scene.dt * FS / 2
    force, rotor = dimer.second_order_terms(radius)
    force_2, rotor_2 = dimer.second_order_terms(radius, mrot=2)
    free = [part.energy for part in dimer.rotor_parts()]
    runs = {
        "NO_SQUISH": (
            dimer.nosquish,
            dimer.energy,
            {"": [], "force": [force], "rotor": [rotor], "both": [force, rotor]},
        ),
        "NO_SQUISH, m_rot 2": (
            partial(dimer.nosquish, mrot=2),
            dimer.energy,
            {"": [], "both": [force_2, rotor_2]},
        ),
        "free rotor": (
            calculus.strang(dimer.rotor_parts()),
            lambda x: sum(energy(x) for energy in free),
            {"": [], "rotor": [rotor]},
        ),
    }
    spread = {}
    for scheme, (step, energy, corrections) in runs.items():
        spread[scheme] = {which: [] for which in corrections}
        for multiple, length in zip(MULTIPLES, dt):
            states = [dimer.start]
            for _ in range(40):  # at the same times with each time step
                states.append(
                    calculus.repeated(step, round(MULTIPLES[-1] / multiple))(states[-1], dt[-1])
                )
            states = np.stack(states, axis=1)
            for which, terms in corrections.items():
                total = energy(states) + length**2 * sum(term(states) for term in terms)
                spread[scheme][which].append(float(np.sqrt(np.mean((total[1:] - total[0]) ** 2))))
            tick()
        complete = list(corrections)[-1]
        checks.append(
            _power(
                check, scheme, "spread of H ∝ Δt to the power of", dt, spread[scheme][""], 1.9, 2.1
            )
        )
        checks.append(
            _power(
                check,
                scheme,
                "spread of H + Δt² H⁽²⁾ ∝ Δt to the power of",
                dt,
                spread[scheme][complete],
                3.9,
                4.1,
            )
        )
    alone = spread["NO_SQUISH"]
    checks += [
        check("NO_SQUISH", f"spread at {MULTIPLES[0] * scene.dt:g} fs without the {other} splitting's H⁽²⁾, over that with both",
              alone[which][0] / alone["both"][0], low=10)
        for which, other in (("force", "rotor"), ("rotor", "force"))
    ]  # fmt: skip
    what = f"spread at {MULTIPLES[0] * scene.dt:g} fs by the force splitting's H⁽²⁾, over that by the rotor splitting's"
    note = "so little of the energy's error is the rotor's, whatever its scheme"
    checks.append(
        check("NO_SQUISH", what, alone["rotor"][0] / alone["force"][0], low=100, note=note)
    )
    change, motion, term = _oscillator()
    tick()
    checks += [
        check(
            "velocity Verlet, oscillator",
            "relative change of (2.51) in 1,000 steps, largest for ω Δt up to 1.99",
            change,
            high=1e-10,
        ),
        check(
            "velocity Verlet, oscillator",
            "a step less the motion under (2.51), largest",
            motion,
            high=ROUND_OFF,
        ),
        check(
            "velocity Verlet, oscillator",
            "H⁽²⁾ (2.37) less the Δt² term of (2.51)",
            term,
            high=ROUND_OFF,
        ),
    ]
    return checks, {"dt_fs": (dt / FS).tolist(), "spread": spread}


def _oscillator():
    """Velocity Verlet beside (2.51): how much that changes, how far a step is from its motion, and
    its dt^2 term from (2.37)."""
    oscillator, x = Oscillator(mass=1.3, omega=0.7), np.array([0.4, -1.1])
    step, changes, motions = calculus.strang(oscillator.parts()), [], []
    for dt in np.linspace(0.1, 1.99, 20) / oscillator.omega:
        hamiltonian = partial(oscillator.integrator_hamiltonian, dt=dt)
        changes.append(
            abs(hamiltonian(calculus.repeated(step, 1000)(x, 1000 * dt)) / hamiltonian(x) - 1)
        )
        # derivatives; there is no mixed one
        second = np.diag([2 * hamiltonian(axis) for axis in np.eye(2)])
        flow = expm(dt * (second @ calculus.metric(1)).T)  # dx/dt = grad H g^-1 (2.41)
        matrix = np.transpose([step(axis, dt) for axis in np.eye(2)])  # the step is linear
        motions.append(np.abs(flow - matrix).max())
    radius = 0.1 / oscillator.omega
    exact = calculus.taylor(
        lambda dt: oscillator.integrator_hamiltonian(x[:, None], dt), 2, radius
    ).real
    return (
        float(max(changes)),
        float(max(motions)),
        float(abs(exact - calculus.leading_term(oscillator.parts(), radius)(x))),
    )


def mrot(scene, dimer, tick, **_):
    """The error of free rotors after some steps with so many inner steps, against Jacobi's elliptic
    functions."""
    moments, dt = dimer.moments[:, 0], MULTIPLES[-1] * scene.dt * FS
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
        tick()
    check, last = partial(Check, "mrot", "free rotor"), MROTS[-1]
    return [
        _power(
            partial(Check, "mrot"),
            "free rotor",
            f"error of q after {TURNS} steps ∝ m_rot to the power of",
            MROTS,
            errors,
            -2.05,
            -1.95,
        ),
        check(
            f"that error with m_rot {last} times {last}², over that with 1",
            errors[-1] / errors[0] * last**2,
            low=0.95,
            high=1.05,
        ),
    ], {"mrot": MROTS, "error": errors, "dt_fs": dt / FS, "temperature": TEMPERATURE}


def recursion(scene, dimer, tick, **_):
    """(2.30) for n = 1, G^(0) . grad H^(1) + G^(1) . grad H^(0) = 0, where it can be met and where
    it cannot.

    It cannot be met by any H^(1) if the second term has an average along a closed orbit of the
    exact motion, because the first one, the change of H^(1) along it, has none. All orbits of an
    isotropic oscillator are closed. There the force is given an addition dt^2 CURL (-q_2, q_1),
    which has no potential: the scheme stays reversible, of second order, and keeps phase-space
    volume.
    """
    # at half a step some states meet a singularity
    check, radius = (partial(Check, "recursion"), scene.dt * FS / 4)
    force, rotor = dimer.second_order_terms(radius)
    states = [dimer.start]
    for _ in range(8):
        states.append(calculus.repeated(dimer.nosquish, 20)(states[-1], 20 * scene.dt * FS))
    tick()
    terms = calculus.recursion_terms(
        dimer.nosquish,
        calculus.fourth_order(dimer.nosquish),
        dimer.energy,
        lambda x: force(x) + rotor(x),
        np.stack(states, axis=1),
        radius,
    )
    tick()
    what = "|G⁽⁰⁾·∇H⁽¹⁾ + G⁽¹⁾·∇H⁽⁰⁾| over one term, largest"
    checks = [check("NO_SQUISH", f"{what} of {len(states)} states", _rest(terms), high=1e-8)]

    oscillator = Oscillator(mass=1.0, omega=1.0)
    verlet = calculus.strang(oscillator.parts())

    def curl(x, time):
        return x + CURL * time**3 * np.stack([-x[3], x[2], 0 * x[0], 0 * x[0]])

    def broken(x, time):
        return curl(verlet(curl(x, time / 2), time), time / 2)

    start = np.array([0.1, 0.9, 1.0, -0.2])  # p_1, p_2, q_1, q_2
    p, q = np.split(start, 2)
    angles = np.arange(64) * 2 * np.pi / 64
    orbit = np.concatenate(
        [
            np.outer(p, np.cos(angles)) - np.outer(q, np.sin(angles)),
            np.outer(q, np.cos(angles)) + np.outer(p, np.sin(angles)),
        ]
    )
    common = (
        calculus.fourth_order(verlet),
        oscillator.energy,
        calculus.leading_term(oscillator.parts(), 0.1),
        orbit,
        0.1,
    )
    whole, cut = (calculus.recursion_terms(step, *common) for step in (verlet, broken))
    # both half steps add CURL (dt/2)^3; p . (-q_2, q_1) is the angular momentum
    gain = CURL / 4 * (q[0] * p[1] - q[1] * p[0])
    dt, time, energies = 0.05, np.linspace(0, 200, 101), {}
    for name, step in ("velocity Verlet", verlet), ("with a curl", broken):
        x, energies[name] = start, [float(oscillator.energy(start))]
        for passed in np.diff(time):
            x = calculus.repeated(step, round(passed / dt))(x, passed)
            energies[name].append(float(oscillator.energy(x)))
        tick()
    turned = np.array([-1, -1, 1, 1])
    back = turned * calculus.repeated(broken, 1000)(
        turned * calculus.repeated(broken, 1000)(start, 1000 * dt), 1000 * dt
    )
    J = calculus.jacobian(lambda x: broken(x, 0.5), start)
    drift, still = (
        measures.drift(time, np.array(energies[name])).times(1 / (dt**2 * gain)).plain()
        for name in ("with a curl", "velocity Verlet")
    )
    average = "average of G⁽¹⁾·∇H⁽⁰⁾ along a closed orbit"
    checks += [
        check(
            "velocity Verlet, oscillator",
            f"{what} of {len(angles)} states",
            _rest(whole),
            high=1e-8,
        ),
        check(
            "velocity Verlet, oscillator", f"|{average}|", float(abs(whole[1].mean())), high=SHOWN
        ),
        check(
            "velocity Verlet, oscillator",
            "drift of H over Δt² times the power of the curl",
            **still,
            low=-0.01,
            high=0.01,
        ),
        check("oscillator with a curl", average, float(cut[1].mean()), low=SHOWN),
        check(
            "oscillator with a curl",
            "that less the power of the curl",
            float(abs(cut[1].mean() - gain)),
            high=SHOWN,
        ),
        check(
            "oscillator with a curl",
            "drift of H over Δt² times that average",
            **drift,
            low=0.95,
            high=1.05,
        ),
        check(
            "oscillator with a curl",
            "distance from the start after 1,000 steps and back",
            float(np.abs(back - start).max()),
            high=1e-10,
        ),
        check(
            "oscillator with a curl",
            "|det J − 1|",
            float(abs(np.linalg.det(J) - 1)),
            high=ROUND_OFF,
        ),
        check(
            "oscillator with a curl", "|J g⁻¹ Jᵀ − g⁻¹|", calculus.symplectic_defect(J), low=SHOWN
        ),
    ]
    return checks, {"time": time.tolist(), "energy": energies, "gain": float(dt**2 * gain)}


def loops(scene, dimer, tick, **_):
    """What is measured on the machine code that runs in LAMMPS; a pair of bodies of each kind, but
    nearly linear ones, which are too stiff."""
    check, checks = partial(Check, "loops"), []
    names = {"NVE": "NO_SQUISH", "MatubayasiNakahara": "reference 12"}
    largest, form = (
        f"largest of {len(STEPS_OF_LOOPS)} time steps",
        "|Jᵀ g J − g| of the compiled loops",
    )
    for scheme, name in names.items():
        for kind in KINDS:
            if kind != "nearly linear":
                rng = np.random.default_rng(2002)
                pair = Scene(kind, 2, rng, scheme)
                start = pair.random(rng)
                defects, volumes, errors = np.transpose(
                    [pair.defects(start, dt) for dt in STEPS_OF_LOOPS]
                )
                subject = f"{name}, {kind}"
                # where reference 12 is exact, too
                if name == "NO_SQUISH" or kind not in ("solid", "planar"):
                    checks.append(
                        check(
                            subject,
                            f"{form}, {largest}",
                            defects.max(),
                            errors.max(),
                            high=DIFFERENCES,
                        )
                    )
                else:
                    checks.append(
                        check(
                            subject,
                            f"{form} at Δt = {STEPS_OF_LOOPS[-1]}",
                            defects[-1],
                            errors[-1],
                            low=100 * DIFFERENCES,
                        )
                    )
                    checks.append(
                        _power(
                            check,
                            subject,
                            f"{form} ∝ Δt to the power of",
                            STEPS_OF_LOOPS,
                            defects,
                            2.8,
                            3.2,
                        )
                    )
                checks.append(
                    check(
                        subject,
                        f"change of volume, {largest}",
                        volumes.max(),
                        errors.max(),
                        high=DIFFERENCES,
                    )
                )
                checks.append(
                    check(
                        subject,
                        "100 steps forward and back",
                        pair.returned(start, STEPS_OF_LOOPS[-1], 100),
                        high=ROUND_OFF,
                    )
                )
            tick()
    for scheme in SCHEMES:
        for kind in KINDS:
            rng = np.random.default_rng(53)
            scenes = [
                Scene(kind, RANDOM, rng, scheme, order, mrot)
                for order in (321, 123)
                for mrot in (1, 2, 3, 4)
            ]
            apart, slow = np.max([one.apart(rng, scheme) for one in scenes], axis=0)
            what = f"a step of the compiled loops less one by the equations, {len(scenes) * RANDOM:,} random bodies"
            subject = f"{names[scheme]}, {kind}"
            checks.append(
                check(
                    subject,
                    f"{what}, over what a relative change grows by",
                    float(apart),
                    high=TIED,
                )
            )
            if kind != "nearly linear":
                checks.append(
                    check(
                        subject, f"{what}, those that turn by up to 1 rad", float(slow), high=TIED
                    )
                )
            tick()
    return checks, None


def _rest(terms):
    """What two terms leave of each other, over the larger one's size; largest of several states
    each."""
    return float(np.abs(terms.sum(axis=0)).max() / np.abs(terms).max())


def _power(check, scheme, what, x, y, low, high):
    exponent, error = calculus.slope(x, y)
    return check(scheme, what, exponent, error, low, high, freedom=len(x) - 2)


PARTS = {  # name: its function, and how many pieces of work that tells of
    "reversal": (reversal, len(theory_reversal.INTEGRATORS)),
    "symplectic": (symplectic, 2 * len(MULTIPLES) + len(TOLERANCES)),
    "conserved": (conserved, 3 * len(MULTIPLES) + 1),
    "mrot": (mrot, len(MROTS)),
    "recursion": (recursion, 4),
    "loops": (loops, 4 * len(KINDS)),
}
