"""What breaks others: cases of which users of rigid bodies in LAMMPS report that they go wrong,
each a number, with ours and with LAMMPS's own fixes.

Each case is a small box of Lennard-Jones bodies (``boxes``) that is run with one fix after the
other, and comes to one number that is small where all is well.  The tests hold ours against the
same numbers.
"""

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass

import numpy as np

from ..scenes import boxes
from ..scenes.boxes import OURS, RIGID, SMALL, apart, mixture

FREE = "pair_style zero 2.5\npair_coeff * *\n"
SMOOTH = "pair_style lj/smooth/linear 2.5\npair_coeff * * 1 1\n"
OUR_LABEL = "fix_nosquish.NVE"
FIXES = {OUR_LABEL: OURS, "rigid/nve": RIGID, "rigid/nve/small": SMALL}
SILENCE = 120.0  # s that a run may take
SUMS = {  # momentum P, angular momentum L about the origin, force F, torque N; sizes of P's and L's
    "P": "mass*v{x}",
    "L": "mass*({y}*v{z}-{z}*v{y})",
    "F": "f{x}",
    "N": "{y}*f{z}-{z}*f{y}",
    "p": "abs(mass*v{x})",
    "l": "abs(mass*{y}*v{z})+abs(mass*{z}*v{y})",
}


class Ended(Exception):
    """LAMMPS has ended the run with a message."""


@dataclass(frozen=True)
class Case:
    """A case: what is measured, and the bound."""

    name: str
    # of a way to run (``Runs``) and a fix: the number, or it and a remark; raises `Ended`
    measure: Callable
    most: float  # what the number is where all is well
    _: KW_ONLY
    why: str  # that bound
    what: str  # in words


CASES: dict[str, Case] = {}
ROUNDING = "rounding, after the motion has made it grow"


def case(name: str, most: float, why: str = ROUNDING) -> Callable:
    """A decorator that makes a function the measure of a `Case`, which its docstring describes."""

    def of(measure):
        CASES[name] = Case(name, measure, most, why=why, what=" ".join(measure.__doc__.split()))
        return measure

    return of


# ---- what several cases, and tests, need


def columns(result: boxes.Result, *names: str) -> np.ndarray:
    """Columns of the thermo table, (steps, names)."""
    return np.stack([result.thermo[name] for name in names], axis=-1)


def sums() -> str:
    """Lines that define compute sums: `SUMS` of all atoms."""
    formulas = [f.format(x=x, y=y, z=z) for f in SUMS.values() for x, y, z in ("xyz", "yzx", "zxy")]
    lines = [f'variable s{k} atom "{formula}"' for k, formula in enumerate(formulas)]
    names = " ".join(f"v_s{k}" for k in range(len(formulas)))
    return "\n".join([*lines, f"compute sums all reduce sum {names}", ""])


def vector(result: boxes.Result, name: str) -> np.ndarray:
    """A printed vector of SUMS, (steps, 3)."""
    first = 3 * list(SUMS).index(name)
    return columns(result, *(f"c_sums[{first + k}]" for k in (1, 2, 3)))


def bent(angle: float) -> tuple[list, list[int]]:
    """A triatomic like CO2, its arms 0.5 long, bent by an angle: linear to the fix (and to LAMMPS)
    below 2e-3."""
    c, s = 0.5 * np.cos(0.5 * angle), 0.5 * np.sin(0.5 * angle)
    return [[-c, s, 0], [0, 0, 0], [c, s, 0]], [2, 3, 2]


def moved_images(system: boxes.System, count: Sequence[int]) -> boxes.System:
    """The same system with all image flags moved; a flag that LAMMPS's ten bits do not hold wraps
    in its hands."""
    head, atoms, tail = system.files["data.bodies"].replace("Velocities", "Atoms").split("Atoms", 2)
    lines = atoms.splitlines()
    for k, line in enumerate(lines):
        words = line.split()
        if len(words) == 9:
            lines[k] = " ".join(words[:6] + [str(int(w) + n) for w, n in zip(words[6:], count)])
    data = head + "Atoms" + "\n".join(lines) + "\nVelocities" + tail
    return system._replace(files={"data.bodies": data})


def restarted(system: boxes.System, file: str) -> boxes.System:
    """The system in a script that goes on from this restart file."""
    text = f"read_restart {file}\nneigh_modify every 1 delay 0 check yes exclude molecule/intra all"
    return system._replace(setup=text, files={})


def _lattice(kinds, side, place, h, seed):
    """Bodies of these kinds in turn on a lattice, turned at random, sorted by kind; ``place`` is of
    three whole numbers."""
    rng = np.random.default_rng(seed)
    bodies: list = []
    sites = itertools.product(range(side), repeat=3)
    for kind, site in zip(itertools.cycle(kinds.split()), sites):
        bodies.append(boxes.turned(kind, place(np.array(site)), bodies, h, rng))
    return sorted(bodies, key=lambda body: body[0])


# ---- the cases: what is run, and the number that it comes to


def tops() -> boxes.System:
    """A box with two or three bodies of each of the symmetric kinds."""
    return mixture(" ".join(boxes.TOPS), side=3, spacing=2.8, temperature=2.0, seed=8)


def _worst(system, one, other):
    """The largest distance between atoms, and of which kind of body it is."""
    found = {}
    for kind, bodies in re.findall(r"^group (\w+) molecule (.*)$", system.setup, re.M):
        mine = np.isin(system.molecule, [int(body) for body in bodies.split()])
        first, second = (result._replace(x=result.x[mine]) for result in (one, other))
        found[kind] = apart(first, second, system.h)
    largest, kind = max((value, kind) for kind, value in found.items())
    return largest, f"the largest is of {kind}"


@case("tops-runs", 1e-9)
def _tops_in_two_runs(simulate, fix):
    """symmetric tops (methane, cubes, benzene …), 100 steps in one run or in two: largest
    distance"""
    system = tops()
    two, one = simulate(system, fix, 50, dt=2, after="run 50"), simulate(system, fix, 100, dt=2)
    return _worst(system, two, one)


@case("tops-restart", 1e-9)
def tops_restarted(simulate: Callable, fix: str, ranks: int = 1) -> tuple[float, str]:
    """the same, with a restart file in the middle: largest distance"""
    system, file = tops(), f"half.{ranks}"
    whole = simulate(system, fix, 100, dt=2)
    simulate(system, fix, 50, dt=2, after=f"write_restart {file}")
    return _worst(system, simulate(restarted(system, file), fix, 50, dt=2, ranks=ranks), whole)


def _rod(length):
    """A rod of this length in a box of 10, and a pair of atoms."""
    k = np.arange(12)
    place = np.stack([8.0 + length / 11 * k, 3 + 0.1 * np.cos(k), 3 + 0.1 * np.sin(k)]).T
    pair = "pair", np.array([[5.0, 7, 7], [6, 7, 7]]), np.array([1, 2])
    return boxes.assemble([("rod", place, np.ones(12, int)), pair], 10 * np.eye(3))


def _wrapped(simulate, fix, length):
    near = _rod(length)
    far = simulate(moved_images(near, (511, 0, 0)), fix, 50)
    return apart(far, simulate(near, fix, 50), near.h)


@case("images-quarter", 1e-10)
def _quarter(simulate, fix):
    """a rod of 0.4 box lengths where image counters run over (511 to −512), 50 steps: largest
    distance from the same with counters near 0"""
    return _wrapped(simulate, fix, 4.0)


@case("images-half", 1e-10)
def _half(simulate, fix):
    """the same, a rod of 0.7 box lengths"""
    return _wrapped(simulate, fix, 7.0)


@case("plane", 0.0, why="nothing drives it")
def _out_of_the_plane(simulate, fix):
    """two dimensions, heat bath, no enforce2d, 10,000 steps: largest |z| + |vz|"""
    # single atoms are not a rigid fix's to keep there
    bodies = mixture("planar pair row", side=4, dimension=2)
    before = 'variable out atom "abs(z)+abs(vz)"\ncompute out all reduce max v_out\n'
    before += "fix 7 all langevin 1.0 1.0 1.0 9371\n"
    found = simulate(bodies, fix, 10000, before=before, columns="c_out", every=500)
    return found.thermo["c_out"].max()


def _respa(simulate, fix):
    """Distances from Verlet's small steps after 0.16, with r-RESPA of two levels and outer steps of
    0.016, 0.008 and 0.004; the potential is nearly smooth at the cutoff, so that errors fall with
    dt^2."""
    system = mixture("solid planar pair row single", temperature=0.5)
    setup = system.setup.replace("lj/cut 2.5", "lj/cut 3.6") + "\npair_modify shift yes"
    system = system._replace(setup=setup)
    exact = simulate(system, fix, 400, dt=0.2, every=400)
    two = "run_style respa 2 4 inner 1 1.3 1.8 outer 2"
    runs = (simulate(system, fix, n, dt=80 / n, before=two, every=1) for n in (10, 20, 40))
    return [apart(run, exact, system.h) for run in runs]


@case("respa-order", 0.09, why="1/16 in the limit of short steps, for a scheme of second order")
def _respa_falls(simulate, fix):
    """r-RESPA of two levels: what is left of the error when the outer step is a quarter as long"""
    first, _, last = _respa(simulate, fix)
    return last / first


@case("respa-error", 1e-5, why="second order; the bound is that of the test before these results")
def _respa_error(simulate, fix):
    """the same: distance from small steps of Verlet with outer steps of 0.004"""
    return _respa(simulate, fix)[-1]


SHIFTS = [(0.3, 0, 0), (123.456, -7.89, 1e3), (1e4 / 3, 1e4 / 7, -1e4)]


def _shifted(simulate, fix, boundary):
    """The pressure tensor, at step 0 and 5."""
    h, kinds, tensors = 12.0 * np.eye(3), "solid planar pair row", []
    bodies = _lattice(kinds, 3, lambda site: 3.0 + 2.55 * site, h, 6)
    system = boxes.assemble(bodies, h, setup=f"boundary {boundary}")
    for d in (0, 0, 0), *SHIFTS:
        move = "displace_atoms all move {:.17g} {:.17g} {:.17g} units box".format(*d)
        tensors.append(boxes.tensor(simulate(system, fix, 5, every=5, before=move)))
    start, *moved = tensors
    return max(np.abs(one - start).max() for one in moved) / np.abs(start).max()


@case("origin-periodic", 1e-9)
def _periodic(simulate, fix):
    """all atoms moved by up to 10⁴ lengths in a periodic box: relative change of the pressure"""
    return _shifted(simulate, fix, "p p p")


@case("origin-free", 1e-9)
def _free(simulate, fix):
    """the same in a box that shrinks around them"""
    return _shifted(simulate, fix, "s s s")


def momenta(simulate: Callable, fix: str, ranks: int = 1, steps: int = 10000) -> list[float]:
    """Largest change of total momentum and of total angular momentum in a run without a box, over
    the sum of their parts' sizes: of a drop of bodies over the ranks' common corner, kept together
    by their attraction."""
    h, kinds = 24.0 * np.eye(3), "solid planar row single"
    bodies = _lattice(kinds, 2, lambda site: 12.0 + 2.2 * (site - 0.5), h, 11)
    drop = boxes.assemble(bodies, h, temperature=0.3, setup="boundary s s s", seed=11)
    before = SMOOTH + "neigh_modify every 5 delay 0 check no\n" + sums()
    how = {"columns": "c_sums[*]", "every": steps // 5, "ranks": ranks}
    found = simulate(drop, fix, steps, before=before, **how)
    changes = {name: np.abs(vector(found, name) - vector(found, name)[0]).max() for name in "PL"}
    sizes = {name: vector(found, name.lower()).sum(axis=1).min() for name in "PL"}
    return [changes[name] / sizes[name] for name in "PL"]


@case("angular-momentum", 1e-12)
def _angular_momentum(simulate, fix):
    """no box, 10,000 steps: relative change of the total angular momentum"""
    return momenta(simulate, fix)[1]


@case("fix-momentum", 1e-10)
def _momentum_comes_back(simulate, fix):
    """fix momentum: the centre of mass's velocity in the ten steps after, over that before"""
    names = "vx", "vy", "vz"
    lines = [f"variable {name} equal vcm(all,{name[1]})" for name in names]
    first, last = "velocity all set 0.5 0.3 -0.2 sum yes", "fix 5 all momentum 10 linear 1 1 1"
    how = {"before": FREE + "\n".join([first, *lines, last]), "every": 1}
    found = simulate(mixture("solid planar"), fix, 19, columns="v_vx v_vy v_vz", **how)
    speeds = np.abs(columns(found, *(f"v_{name}" for name in names)))
    return speeds[10:].max() / speeds[:10].max()


def _temperatures(simulate, fix, steps, before, every):
    """How far they are off 3.0, relative to it."""
    bodies = mixture("solid planar pair row")
    return simulate(bodies, fix, steps, before=before, every=every).thermo["Temp"] / 3.0


@case("temp-rescale", 1e-6)
def _rescaled(simulate, fix):
    """fix temp/rescale to 3.0, free bodies: how far the temperature is off in the next ten steps,
    relative"""
    line = f"{FREE}fix 5 all temp/rescale 10 3.0 3.0 0.0 1.0"
    return np.abs(_temperatures(simulate, fix, 19, line, 1)[10:] - 1).max()


@case("temp-csvr", 0.17, why="chance, in ten samples of few bodies")
def _bath(simulate, fix):
    """fix temp/csvr to 3.0: how far the mean temperature is off, relative"""
    line = "fix 5 all temp/csvr 3.0 3.0 0.01 4928"
    return abs(_temperatures(simulate, fix, 60, line, 4)[5:].mean() - 1)


@case("tiny", 1e-9)
def _tiny(simulate, fix):
    """moments of inertia of 10⁻⁴⁶ kg m², 50 steps: distance from the same bodies in LJ units"""
    units, usual, size = boxes.UNITS, boxes.UNITS["si"], 1e-10
    units["si"] = boxes.Units(size, 1e-26, 1e-21, 1.0)
    try:
        plain, scaled = mixture("solid planar"), mixture("solid planar", units="si")
    finally:
        units["si"] = usual
    found = simulate(scaled, fix, 50)
    found = found._replace(x=found.x / size)
    return apart(found, simulate(plain, fix, 50), plain.h)


def _triatomics(angle):
    """A box of 27 triatomics, bent by an angle."""
    boxes.SHAPES["bent0"] = bent(angle)
    try:
        return mixture("bent0", seed=4)
    finally:
        del boxes.SHAPES["bent0"]


@case("nearly-linear", 0.01, why="bodies bent by 1e-3 differ by some 1e-3")
def _nearly_linear(simulate, fix):
    """triatomics bent by 10⁻¹² to 10⁻³ rad: relative difference of the energy's range from that of
    straight ones"""
    boxed = map(_triatomics, (0.0, 1e-12, 1e-8, 1e-5, 1e-3))
    runs = (simulate(system, fix, 400, before=SMOOTH, dt=2) for system in boxed)
    straight, *others = (np.ptp(run.thermo["TotEng"]) for run in runs)
    return max(abs(one / straight - 1) for one in others)
