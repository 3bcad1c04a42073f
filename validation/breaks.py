"""What breaks others: cases of which users of rigid bodies in LAMMPS report that they go wrong, each a number, with ours and with LAMMPS's own fixes.

Each case is a small box of Lennard-Jones bodies (``boxes``) that is run with one fix after the other, and comes to one number that is small where
all is well.  The tests hold ours against the same numbers.
"""

import itertools
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from validation import lammps_log
from validation.boxes import (
    OURS,
    RIGID,
    SHAPES,
    SMALL,
    TOPS,
    UNITS,
    Result,
    Units,
    apart,
    assemble,
    mixture,
    result,
    script,
    tensor,
    turned,
)

FREE = "pair_style zero 2.5\npair_coeff * *\n"
SMOOTH = "pair_style lj/smooth/linear 2.5\npair_coeff * * 1 1\n"


def columns(result, *names):
    """Columns of the thermo table, (steps, names)."""
    return np.stack([result.thermo[name] for name in names], axis=-1)


SUMS = {
    "P": "mass*v{x}", "L": "mass*({y}*v{z}-{z}*v{y})", "F": "f{x}", "N": "{y}*f{z}-{z}*f{y}",
    "p": "abs(mass*v{x})", "l": "abs(mass*{y}*v{z})+abs(mass*{z}*v{y})",
}  # fmt: skip


def sums():
    """Lines that define compute sums: momentum P, angular momentum L about the origin, force F and torque N of all
    atoms, and the sizes p and l of the summands of P and L."""
    formulas = [f.format(x=x, y=y, z=z) for f in SUMS.values() for x, y, z in ("xyz", "yzx", "zxy")]
    variables = [f'variable s{k} atom "{formula}"' for k, formula in enumerate(formulas)]
    return (
        "\n".join(
            [
                *variables,
                "compute sums all reduce sum " + " ".join(f"v_s{k}" for k in range(len(formulas))),
            ]
        )
        + "\n"
    )


def vector(result, name):
    """A printed vector of SUMS, (steps, 3)."""
    first = 3 * list(SUMS).index(name)
    return columns(result, *(f"c_sums[{first + k}]" for k in (1, 2, 3)))


def bent(angle):
    """A triatomic like CO2, its arms 0.5 long, bent by an angle: linear to the fix (and to LAMMPS) below 2e-3."""
    c, s = 0.5 * np.cos(0.5 * angle), 0.5 * np.sin(0.5 * angle)
    return [[-c, s, 0], [0, 0, 0], [c, s, 0]], [2, 3, 2]


def moved_images(system, count):
    """The same system with all image flags moved; a flag that LAMMPS's ten bits do not hold wraps in its hands."""
    head, atoms, tail = system.files["data.bodies"].replace("Velocities", "Atoms").split("Atoms", 2)
    lines = atoms.splitlines()
    for k, line in enumerate(lines):
        words = line.split()
        if len(words) == 9:
            lines[k] = " ".join(words[:6] + [str(int(w) + n) for w, n in zip(words[6:], count)])
    data = head + "Atoms" + "\n".join(lines) + "\nVelocities" + tail
    return system._replace(files={"data.bodies": data})


def restarted(system, file):
    """The system in a script that goes on from this restart file."""
    text = f"read_restart {file}\nneigh_modify every 1 delay 0 check yes exclude molecule/intra all"
    return system._replace(setup=text, files={})


def cluster():
    """A drop of bodies without a periodic box, over the ranks' common corner, kept together by their attraction."""
    h, rng, bodies = 24.0 * np.eye(3), np.random.default_rng(11), []
    for kind, site in zip(
        itertools.cycle("solid planar row single".split()), itertools.product(range(2), repeat=3)
    ):
        bodies.append(turned(kind, 12.0 + 2.2 * (np.array(site) - 0.5), bodies, h, rng))
    return assemble(
        sorted(bodies, key=lambda body: body[0]),
        h,
        temperature=0.3,
        setup="boundary s s s",
        seed=11,
    )


OUR_LABEL = "fix_nosquish.NVE"
FIXES = {OUR_LABEL: OURS, "rigid/nve": RIGID, "rigid/nve/small": SMALL}
SILENCE = 120.0  # s that a run may take


class Ended(Exception):
    """LAMMPS has ended the run with a message."""


# ---- the cases: what is run, and the number that it comes to


def tops():
    """A box with two or three bodies of each of the symmetric kinds."""
    return mixture(" ".join(TOPS), side=3, spacing=2.8, temperature=2.0, seed=8)


def _worst(system, one, other):
    """The largest distance between atoms, and of which kind of body it is."""
    found = {}
    for kind, bodies in re.findall(r"^group (\w+) molecule (.*)$", system.setup, re.M):
        mine = np.isin(system.molecule, [int(body) for body in bodies.split()])
        found[kind] = apart(one._replace(x=one.x[mine]), other._replace(x=other.x[mine]), system.h)
    kind = max(found, key=found.get)
    return found[kind], f"the largest is of {kind}"


def tops_in_two_runs(simulate, fix):
    """Largest distance between symmetric tops after 100 steps and after 50 and 50."""
    system = tops()
    return _worst(
        system, simulate(system, fix, 50, dt=2, after="run 50"), simulate(system, fix, 100, dt=2)
    )


def tops_restarted(simulate, fix, ranks=1):
    """The same with write_restart and read_restart in the middle."""
    system, file = tops(), f"half.{ranks}"
    whole = simulate(system, fix, 100, dt=2)
    simulate(system, fix, 50, dt=2, after=f"write_restart {file}")
    return _worst(system, simulate(restarted(system, file), fix, 50, dt=2, ranks=ranks), whole)


def rod(length):
    """A rod of this length in a box of 10, and a pair of atoms."""
    k = np.arange(12)
    place = np.stack([8.0 + length / 11 * k, 3 + 0.1 * np.cos(k), 3 + 0.1 * np.sin(k)]).T
    pair = np.array([[5.0, 7, 7], [6, 7, 7]])
    return assemble(
        [("rod", place, np.ones(12, int)), ("pair", pair, np.array([1, 2]))], 10 * np.eye(3)
    )


def wrapped(length):
    """A case: the distance between a rod across the face where image counters run over and the same with counters near 0, after 50 steps."""

    def measure(simulate, fix):
        near = rod(length)
        return apart(
            simulate(moved_images(near, (511, 0, 0)), fix, 50), simulate(near, fix, 50), near.h
        )

    return measure


NOISE = "fix 7 all langevin 1.0 1.0 1.0 9371\n"


def out_of_the_plane(simulate, fix):
    """Largest abs(z) + abs(vz) in 10,000 steps in a heat bath in two dimensions, without fix enforce2d."""
    bodies = mixture(
        "planar pair row", side=4, dimension=2
    )  # single atoms are not a rigid fix's to keep there
    largest = 'variable out atom "abs(z)+abs(vz)"\ncompute out all reduce max v_out\n'
    return (
        simulate(bodies, fix, 10000, before=largest + NOISE, columns="c_out", every=500)
        .thermo["c_out"]
        .max()
    )


TWO = "run_style respa 2 4 inner 1 1.3 1.8 outer 2"


def smooth(kinds="solid planar pair row single"):
    """A mixture with a potential that is nearly smooth at the cutoff, so that errors fall with dt^2."""
    system = mixture(kinds, temperature=0.5)
    return system._replace(
        setup=system.setup.replace("lj/cut 2.5", "lj/cut 3.6") + "\npair_modify shift yes"
    )


def respa(simulate, fix):
    """Distances from Verlet's small steps after 0.16, with r-RESPA of two levels and outer steps of 0.016, 0.008 and 0.004."""
    system = smooth()
    exact = simulate(system, fix, 400, dt=0.2, every=400)
    return [
        apart(simulate(system, fix, n, dt=80 / n, before=TWO, every=1), exact, system.h)
        for n in (10, 20, 40)
    ]


def respa_falls(simulate, fix):
    """What is left of the distance when the outer step is a quarter as long: 1/16 where it goes with its square."""
    first, _, last = respa(simulate, fix)
    return last / first


def respa_error(simulate, fix):
    """The distance with outer steps of 0.004."""
    return respa(simulate, fix)[-1]


SHIFTS = [(0.3, 0, 0), (123.456, -7.89, 1e3), (1e4 / 3, 1e4 / 7, -1e4)]


def shifted(boundary):
    """A case: largest relative change of the pressure tensor, at step 0 and 5, when all atoms are moved by up to 1e4 lengths."""

    def measure(simulate, fix):
        h, rng, bodies = 12.0 * np.eye(3), np.random.default_rng(6), []
        for kind, site in zip(
            itertools.cycle("solid planar pair row".split()), itertools.product(range(3), repeat=3)
        ):
            bodies.append(turned(kind, 3.0 + 2.55 * np.array(site), bodies, h, rng))
        system = assemble(sorted(bodies, key=lambda body: body[0]), h, setup=f"boundary {boundary}")
        start, *moved = (
            tensor(
                simulate(
                    system,
                    fix,
                    5,
                    every=5,
                    before="displace_atoms all move {:.17g} {:.17g} {:.17g} units box".format(*d),
                )
            )
            for d in [(0, 0, 0), *SHIFTS]
        )
        return max(np.abs(one - start).max() for one in moved) / np.abs(start).max()

    return measure


def momenta(simulate, fix, ranks=1, steps=10000):
    """Largest change of total momentum and of total angular momentum in a run without a box, over the sum of their parts' sizes."""
    before = SMOOTH + "neigh_modify every 5 delay 0 check no\n" + sums()
    found = simulate(
        cluster(), fix, steps, before=before, columns="c_sums[*]", every=steps // 5, ranks=ranks
    )
    return [
        np.abs(vector(found, name) - vector(found, name)[0]).max()
        / vector(found, name.lower()).sum(axis=1).min()
        for name in "PL"
    ]


def angular_momentum(simulate, fix):
    """The change of the angular momentum, of these."""
    return momenta(simulate, fix)[1]


def momentum_comes_back(simulate, fix):
    """The centre of mass's largest velocity in the ten steps after fix momentum has taken it away, over that in the ten before."""
    system = mixture("solid planar")
    speeds = [f"variable {name} equal {name[0]}cm(all,{name[1]})" for name in ("vx", "vy", "vz")]
    setup = "\n".join(
        ["velocity all set 0.5 0.3 -0.2 sum yes", *speeds, "fix 5 all momentum 10 linear 1 1 1"]
    )
    found = np.abs(
        columns(
            simulate(system, fix, 19, before=FREE + setup, columns="v_vx v_vy v_vz", every=1),
            "v_vx",
            "v_vy",
            "v_vz",
        )
    )
    return found[10:].max() / found[:10].max()


def rescaled(simulate, fix):
    """How far, relative to it, the temperature of free bodies is from the 3.0 that fix temp/rescale has set ten steps before, at worst."""
    found = simulate(
        mixture("solid planar pair row"),
        fix,
        19,
        before=FREE + "fix 5 all temp/rescale 10 3.0 3.0 0.0 1.0",
        every=1,
    )
    return np.abs(found.thermo["Temp"][10:] / 3.0 - 1).max()


def bath(simulate, fix):
    """How far, relative to it, the mean temperature is from the 3.0 that fix temp/csvr holds, after its first steps."""
    found = simulate(
        mixture("solid planar pair row"),
        fix,
        60,
        before="fix 5 all temp/csvr 3.0 3.0 0.01 4928",
        every=4,
    )
    return abs(found.thermo["Temp"][5:].mean() / 3.0 - 1)


def tiny(simulate, fix, size=1e-10, mass=1e-26):
    """Distance, in lengths of the bodies, between bodies with moments of inertia of 1e-46 kg m^2 in SI units and the same in LJ units, after 50 steps."""
    UNITS["si"], usual = Units(size, mass, 1e-21, 1.0), UNITS["si"]
    try:
        plain, scaled = mixture("solid planar"), mixture("solid planar", units="si")
    finally:
        UNITS["si"] = usual
    found = simulate(scaled, fix, 50)
    return apart(Result(found.x / size, None, None, ""), simulate(plain, fix, 50), plain.h)


BENT = 1e-12, 1e-8, 1e-5, 1e-3  # rad


def triatomics(*angles):
    """A box of 27 triatomics, bent by these angles in turn."""
    names = [f"bent{k}" for k in range(len(angles))]
    SHAPES.update({name: bent(angle) for name, angle in zip(names, angles)})
    try:
        return mixture(" ".join(names), seed=4)
    finally:
        for name in names:
            del SHAPES[name]


def nearly_linear(simulate, fix):
    """By how much the energy's range of bent triatomics differs, relative to it, from that of straight ones, at worst."""
    ranges = [
        np.ptp(simulate(triatomics(angle), fix, 400, before=SMOOTH, dt=2).thermo["TotEng"])
        for angle in (0.0, *BENT)
    ]
    return max(abs(one / ranges[0] - 1) for one in ranges[1:])


@dataclass(frozen=True)
class Case:
    """A case.

    Attributes:
        name: short, of the case.
        what: is measured, in words.
        measure: function of a way to run (``Runs``) and a fix to the number, or to it and a remark; raises `Ended`.
        most: what the number is at most where all is well.
        why: that bound.
    """

    name: str
    what: str
    measure: Callable
    most: float
    why: str


ROUNDING = "rounding, after the motion has made it grow"
CASES = {
    case.name: case
    for case in (
        Case("tops-runs", "symmetric tops (methane, cubes, benzene …), 100 steps in one run or in two: largest distance", tops_in_two_runs, 1e-9, ROUNDING),
        Case("tops-restart", "the same, with a restart file in the middle: largest distance", tops_restarted, 1e-9, ROUNDING),
        Case("images-quarter", "a rod of 0.4 box lengths where image counters run over (511 to −512), 50 steps: largest distance from the same with "
             "counters near 0", wrapped(4.0), 1e-10, ROUNDING),
        Case("images-half", "the same, a rod of 0.7 box lengths", wrapped(7.0), 1e-10, ROUNDING),
        Case("plane", "two dimensions, heat bath, no enforce2d, 10,000 steps: largest |z| + |vz|", out_of_the_plane, 0.0, "nothing drives it"),
        Case("respa-order", "r-RESPA of two levels: what is left of the error when the outer step is a quarter as long", respa_falls, 0.09,
             "1/16 in the limit of short steps, for a scheme of second order"),
        Case("respa-error", "the same: distance from small steps of Verlet with outer steps of 0.004", respa_error, 1e-5, "second order; the bound is that of the test before these results"),
        Case("origin-periodic", "all atoms moved by up to 10⁴ lengths in a periodic box: relative change of the pressure", shifted("p p p"), 1e-9, ROUNDING),
        Case("origin-free", "the same in a box that shrinks around them", shifted("s s s"), 1e-9, ROUNDING),
        Case("angular-momentum", "no box, 10,000 steps: relative change of the total angular momentum", angular_momentum, 1e-12, ROUNDING),
        Case("fix-momentum", "fix momentum: the centre of mass's velocity in the ten steps after, over that before", momentum_comes_back, 1e-10, ROUNDING),
        Case("temp-rescale", "fix temp/rescale to 3.0, free bodies: how far the temperature is off in the next ten steps, relative", rescaled, 1e-6, ROUNDING),
        Case("temp-csvr", "fix temp/csvr to 3.0: how far the mean temperature is off, relative", bath, 0.17,
             "chance, in ten samples of few bodies"),
        Case("tiny", "moments of inertia of 10⁻⁴⁶ kg m², 50 steps: distance from the same bodies in LJ units", tiny, 1e-9, ROUNDING),
        Case("nearly-linear", "triatomics bent by 10⁻¹² to 10⁻³ rad: relative difference of the energy's range from that of straight ones", nearly_linear, 0.01,
             "bodies bent by 1e-3 differ by some 1e-3"),
    )
}  # fmt: skip


# ---- running them


class Runs:
    """A way to run: a process for each input, in a folder of its own kind; what was run is not run again."""

    def __init__(self, folder):
        self.folder, self.known = folder, {}

    def __call__(self, system, fix, steps, ranks=1, **how):
        """The `Result` of ``boxes.script``.

        Raises:
            Ended: LAMMPS has ended with a message, or hung.
        """
        text = script(system, fix, steps, **how)
        key = text, *system.files.values()
        if key not in self.known:
            for name, content in {"in.breaks": text, **system.files}.items():
                (self.folder / name).write_text(content)
            command = [
                sys.executable,
                "-m",
                "fix_nosquish",
                "-in",
                "in.breaks",
                "-log",
                "log.breaks",
            ]
            try:
                done = subprocess.run(
                    command, cwd=self.folder, capture_output=True, text=True, timeout=SILENCE
                )
            except subprocess.TimeoutExpired:
                raise Ended(f"no end in {SILENCE:g} s") from None
            if done.returncode:
                why = re.search(r"ERROR.*", done.stdout + done.stderr)
                raise Ended(why[0] if why else f"LAMMPS crashed (exit status {done.returncode})")
            log = (self.folder / "log.breaks").read_text()
            self.known[key] = result(self.folder / "end", lammps_log.thermo(log), log)
        return self.known[key]


def breaks(names, folder, meter):
    """Measure cases with all fixes.

    Args:
        names: in `CASES`.
        folder: for the runs' files.
        meter: a ``console.Meter``.

    Returns:
        (rows, interrupted): plain data, a row for each case and fix.
    """
    rows, simulate = [], Runs(folder)
    for case in (CASES[name] for name in names):
        for label, fix in FIXES.items():
            meter.begin(f"{case.name}, {label}", 1)
            value, note = None, ""
            try:
                value, note = told(case.measure(simulate, fix))
            except Ended as end:
                note = str(end)
            except KeyboardInterrupt:
                meter.end("interrupted")
                return rows, True
            meter.end(note if value is None else None)
            rows.append({"case": case.name, "what": case.what, "integrator": label, "value": value, "most": case.most, "why": case.why,
                         "verdict": verdict(value, case.most), "note": note})  # fmt: skip
    return rows, False


def told(found):
    """A case's number, and what else there is to say of it."""
    value, note = found if isinstance(found, tuple) else (found, "")
    return float(value), note


def verdict(value, most):
    """In a word: what a number says, None where LAMMPS has ended the run."""
    return "ends" if value is None else "pass" if value <= most else "fail"
