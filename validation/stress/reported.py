"""What users of rigid bodies in LAMMPS report as broken, each a number that is small where all is
well, with ours and with LAMMPS's own fixes.

Each case is a small box of Lennard-Jones bodies (``boxes``), in their units. It is a function of a
way to run a box, so the tests hold ours against the same numbers in their own way.
"""

import itertools
import re
from collections.abc import Callable

import numpy as np

from ..running.store import digest
from ..scenes import Scene, boxes
from ..scenes.boxes import Result, System, apart, mixture
from .criteria import Criterion
from .measure import EXACT, REPORTED, Case, Number, Stand

FREE = "pair_style zero 2.5\npair_coeff * *\n"
SMOOTH = "pair_style lj/smooth/linear 2.5\npair_coeff * * 1 1\n"
FIXES = "nosquish", "rigid/nve", "rigid/nve/small"
SUMS = {  # momentum P, angular momentum L about the origin, force F, torque N; sizes of P's and L's
    "P": "mass*v{x}",
    "L": "mass*({y}*v{z}-{z}*v{y})",
    "F": "f{x}",
    "N": "{y}*f{z}-{z}*f{y}",
    "p": "abs(mass*v{x})",
    "l": "abs(mass*{y}*v{z})+abs(mass*{z}*v{y})",
}
ROUNDING = "rounding, after the motion has made it grow"
NEED = "who reported it"
# of a way to run a box: of a `System`, steps and keywords as of ``boxes.script``, its `Result`
Simulate = Callable[..., Result]
MEASURES: dict[str, Callable[[Simulate], float | Number]] = {}  # of the cases, by name
CASES: list[Case] = []


def simulated(stand: Stand) -> Simulate:
    """The way to run a box with a stand's integrator; LAMMPS works in one folder for all boxes, so
    that one finds the restart file of another."""
    folder = stand.folder / "boxes"

    def simulate(
        system: System,
        steps: int,
        *,
        dt: float = 1.0,
        every: int = 10,
        ranks: int = 1,
        before: str = "",
        columns: str = "",
        after: str = "",
    ) -> Result:
        setup, origin = f"{system.setup}\n{before}", digest(system.files)
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in system.files.items():
            kept = f"{origin[:12]}-{name}"
            (folder / kept).write_text(text)
            setup = setup.replace(name, kept)
        scene = Scene(
            name="box",
            title="",
            folder=folder.resolve(),
            setup=(*filter(None, setup.splitlines()),),
            group=system.group,
            bodies="molecule",
            constraints=None,
            others=("fix 2 single nve",) * system.singles,
            columns=(*columns.split(),),
            units="lj",
            origin=origin,
        )
        more = [f"run {steps}", *filter(None, [after])]
        how: dict = {"dt": dt * system.dt, "every": every, "ranks": ranks, "keeps": "motion"}
        label = digest(scene.setup, how, more)[:12]
        result, _ = stand.run(scene, label, [], more=more, **how)
        end = result.positions
        assert end
        return Result(end.x[-1], end.v[-1], result.thermo, "")

    return simulate


def case(name: str, most: float, why: str = ROUNDING) -> Callable:
    """A decorator that makes a function the measure of a `Case`.  Its docstring says what happens
    and, behind the last colon, what the number is."""

    def of(measure):
        MEASURES[name] = measure
        physics, _, number = " ".join(measure.__doc__.split()).rpartition(": ")

        def measured(stand, _):
            found = measure(simulated(stand))
            return found if isinstance(found, Number) else Number(float(found))

        CASES.append(
            Case(
                name,
                f"{physics}.",
                number,
                EXACT,
                measured,
                short=None,
                full=None,
                compared=FIXES,
                few=FIXES,
                bounds={name: Criterion("≤", most, "", (name,), number, why, NEED, ())},
                part=REPORTED,
            )
        )
        return measure

    return of


# ---- what several cases, and tests, need


def sums() -> str:
    """Lines that define compute sums: `SUMS` of all atoms."""
    formulas = [f.format(x=x, y=y, z=z) for f in SUMS.values() for x, y, z in ("xyz", "yzx", "zxy")]
    lines = [f'variable s{k} atom "{formula}"' for k, formula in enumerate(formulas)]
    names = " ".join(f"v_s{k}" for k in range(len(formulas)))
    return "\n".join([*lines, f"compute sums all reduce sum {names}", ""])


def vector(result: Result, name: str) -> np.ndarray:
    """A printed vector of SUMS, (steps, 3)."""
    first = 3 * list(SUMS).index(name)
    return np.stack([result.thermo[f"c_sums[{first + k}]"] for k in (1, 2, 3)], axis=-1)


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


def tops() -> System:
    """A box with two or three bodies of each of the symmetric kinds."""
    return mixture(" ".join(boxes.TOPS), side=3, spacing=2.8, temperature=2.0, seed=8)


def _worst(system, first, second):
    """The largest distance between atoms, and of which kind of body it is."""
    found = {}
    for kind, molecules in re.findall(r"^group (\w+) molecule (.*)$", system.setup, re.M):
        mine = np.isin(system.molecule, [int(number) for number in molecules.split()])
        here, there = (result._replace(x=result.x[mine]) for result in (first, second))
        found[kind] = apart(here, there, system.h)
    largest, kind = max((value, kind) for kind, value in found.items())
    return Number(float(largest), note=f"the largest is of {kind}")


@case("tops-runs", 1e-9)
def _tops_in_two_runs(simulate):
    """Symmetric tops (methane, cubes, benzene …), 100 steps in one run or in two: largest
    distance"""
    system = tops()
    return _worst(system, simulate(system, 50, dt=2, after="run 50"), simulate(system, 100, dt=2))


def _wrapped(simulate, length):
    """A rod of this length and a pair of atoms, with image counters near 0 and near 511."""
    k, h, ends = np.arange(12), 10 * np.eye(3), []
    rod = np.stack([8.0 + length / 11 * k, 3 + 0.1 * np.cos(k), 3 + 0.1 * np.sin(k)]).T
    pair = np.array([[5.0, 7, 7], [6, 7, 7]])
    for moved in np.array([[0, 0, 0], [5110, 0, 0]]):
        bodies = ("rod", rod + moved, np.ones(12, int)), ("pair", pair + moved, np.array([1, 2]))
        ends.append(simulate(boxes.assemble(list(bodies), h), 50))
    return apart(ends[0], ends[1], h)


@case("images-quarter", 1e-10)
def _quarter(simulate):
    """A rod of 0.4 box lengths where image counters run over (511 to −512), 50 steps: largest
    distance from the same with counters near 0"""
    return _wrapped(simulate, 4.0)


@case("images-half", 1e-10)
def _half(simulate):
    """A rod of 0.7 box lengths where image counters run over, 50 steps: largest distance from the
    same with counters near 0"""
    return _wrapped(simulate, 7.0)


@case("plane", 0.0, why="nothing drives it")
def _out_of_the_plane(simulate):
    """Two dimensions, heat bath, no enforce2d, 10,000 steps: largest |z| + |vz|"""
    # single atoms are not a rigid fix's to keep there
    bodies = mixture("planar pair row", side=4, dimension=2)
    before = 'variable out atom "abs(z)+abs(vz)"\ncompute out all reduce max v_out\n'
    before += "fix 7 all langevin 1.0 1.0 1.0 9371\n"
    found = simulate(bodies, 10000, before=before, columns="c_out", every=500)
    return found.thermo["c_out"].max()


def _respa(simulate):
    """Distances from Verlet's small steps after 0.16, with r-RESPA of two levels and outer steps of
    0.016, 0.008 and 0.004; the potential is nearly smooth at the cutoff, so that errors fall with
    dt^2."""
    system = mixture("solid planar pair row single", temperature=0.5)
    setup = system.setup.replace("lj/cut 2.5", "lj/cut 3.6") + "\npair_modify shift yes"
    system = system._replace(setup=setup)
    exact = simulate(system, 400, dt=0.2, every=400)
    two = "run_style respa 2 4 inner 1 1.3 1.8 outer 2"
    runs = (simulate(system, n, dt=80 / n, before=two, every=1) for n in (10, 20, 40))
    return [apart(run, exact, system.h) for run in runs]


@case("respa-order", 0.09, why="1/16 in the limit of short steps, for a scheme of second order")
def _respa_falls(simulate):
    """r-RESPA of two levels: what is left of the error when the outer step is a quarter as long"""
    first, _, last = _respa(simulate)
    return last / first


@case("respa-error", 1e-5, why="second order; the bound is that of the test before these results")
def _respa_error(simulate):
    """r-RESPA of two levels, outer steps of 0.004: distance from small steps of Verlet"""
    return _respa(simulate)[-1]


def momenta(simulate: Simulate, ranks: int = 1, steps: int = 10000) -> list[float]:
    """Largest change of total momentum and of total angular momentum in a run without a box, over
    the sum of their parts' sizes: of a drop of bodies over the ranks' common corner, kept together
    by their attraction."""
    h, kinds = 24.0 * np.eye(3), "solid planar row single"
    bodies = _lattice(kinds, 2, lambda site: 12.0 + 2.2 * (site - 0.5), h, 11)
    drop = boxes.assemble(bodies, h, temperature=0.3, setup="boundary s s s", seed=11)
    before = SMOOTH + "neigh_modify every 5 delay 0 check no\n" + sums()
    how = {"columns": "c_sums[*]", "every": steps // 5, "ranks": ranks}
    found = simulate(drop, steps, before=before, **how)
    changes = {name: np.abs(vector(found, name) - vector(found, name)[0]).max() for name in "PL"}
    sizes = {name: vector(found, name.lower()).sum(axis=1).min() for name in "PL"}
    return [changes[name] / sizes[name] for name in "PL"]


@case("angular-momentum", 1e-12)
def _angular_momentum(simulate):
    """No box, 10,000 steps: relative change of the total angular momentum"""
    return momenta(simulate)[1]


def _temperatures(simulate, steps, before, every):
    """How far they are off 3.0, relative to it."""
    bodies = mixture("solid planar pair row")
    return simulate(bodies, steps, before=before, every=every).thermo["Temp"] / 3.0


@case("temp-rescale", 1e-6)
def _rescaled(simulate):
    """fix temp/rescale to 3.0, free bodies: how far the temperature is off in the next ten steps,
    relative"""
    line = f"{FREE}fix 5 all temp/rescale 10 3.0 3.0 0.0 1.0"
    return np.abs(_temperatures(simulate, 19, line, 1)[10:] - 1).max()


@case("temp-csvr", 0.17, why="chance, in ten samples of few bodies")
def _bath(simulate):
    """fix temp/csvr to 3.0: how far the mean temperature is off, relative"""
    line = "fix 5 all temp/csvr 3.0 3.0 0.01 4928"
    return abs(_temperatures(simulate, 60, line, 4)[5:].mean() - 1)
