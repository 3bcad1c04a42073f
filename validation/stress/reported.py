"""Failures that users of rigid bodies in LAMMPS report: numbers that are small if all is well, with
ours and with LAMMPS's own fixes.

Each case is a small box of Lennard-Jones bodies (``boxes``), in their units.  It is a function of a
way to run a box, so the tests can hold ours to the same numbers in their own way.
"""

import re
from collections.abc import Callable

import numpy as np

from ..running.store import digest
from ..scenes import Scene, boxes
from ..scenes.boxes import Result, System, apart, mixture
from .criteria import Criterion
from .measure import EXACT, REPORTED, Case, Number, Runner

FIXES = "nosquish", "rigid/nve", "rigid/nve/small"
ROUNDING = "rounding, after the motion has made it grow"
NEED = "who reported it"
# a way to run a box: from a `System`, steps and keywords to its `Result`
Simulate = Callable[..., Result]
MEASURES: dict[str, Callable[[Simulate], float | Number]] = {}  # of the cases, by name
CASES: list[Case] = []


def simulated(runner: Runner) -> Simulate:
    """The way to run a box with a runner's integrator."""

    def simulate(
        system: System,
        steps: int,
        *,
        dt: float = 1.0,
        every: int = 10,
        before: str = "",
        columns: str = "",
        after: str = "",
    ) -> Result:
        folder = runner.folder / "boxes" / digest(system.files)[:12]
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in system.files.items():
            (folder / name).write_text(text)
        scene = Scene(
            name="box",
            title="",
            folder=folder.resolve(),
            setup=(*filter(None, f"{system.setup}\n{before}".splitlines()),),
            group=system.group,
            bodies="molecule",
            constraints=None,
            others=("fix 2 single nve",) * system.singles,
            columns=(*columns.split(),),
            units="lj",
        )
        more = [f"run {steps}", *filter(None, [after])]
        how: dict = {"dt": dt * system.dt, "every": every, "keeps": "motion", "more": more}
        result, _ = runner.run(scene, digest(system.files, scene.setup, how)[:12], [], **how)
        end = result.positions
        assert end
        return Result(end.x[-1], end.v[-1], result.thermo, "")

    return simulate


def case(name: str, most: float, why: str = ROUNDING) -> Callable:
    """A decorator that makes a function the measure of a `Case`.  Its docstring says what happens
    and, after the last colon, what the number is."""

    def of(measure):
        MEASURES[name] = measure
        physics, _, number = " ".join(measure.__doc__.split()).rpartition(": ")

        def measured(runner, _):
            number = measure(simulated(runner))
            return number if isinstance(number, Number) else Number(float(number))

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
                bounds={name: Criterion("≤", most, "", name, number, why, NEED)},
                part=REPORTED,
            )
        )
        return measure

    return of


def tops() -> System:
    """A box with two or three bodies of each of the symmetric kinds."""
    return mixture(" ".join(boxes.TOPS), side=3, spacing=2.8, temperature=2.0, seed=8)


def _worst(system, first, second):
    """The largest distance between atoms, and the kind of body that has it."""
    distances = {}
    for kind, molecules in re.findall(r"^group (\w+) molecule (.*)$", system.setup, re.M):
        mine = np.isin(system.molecule, [int(number) for number in molecules.split()])
        here, there = (result._replace(x=result.x[mine]) for result in (first, second))
        distances[kind] = apart(here, there, system.h)
    largest, kind = max((value, kind) for kind, value in distances.items())
    return Number(float(largest), note=f"the largest is of {kind}")


@case("tops-runs", 1e-9)
def _tops_in_two_runs(simulate):
    """Symmetric tops (methane, cubes, benzene …), 100 steps in one run or in two: largest
    distance"""
    system = tops()
    return _worst(system, simulate(system, 50, dt=2, after="run 50"), simulate(system, 100, dt=2))


@case("images-half", 1e-10)
def _half(simulate):
    """A rod of 0.7 box lengths where image counters run over (511 to −512), 50 steps: largest
    distance from the same with counters near 0"""
    k, h, ends = np.arange(12), 10 * np.eye(3), []
    rod = np.stack([8.0 + 7.0 / 11 * k, 3 + 0.1 * np.cos(k), 3 + 0.1 * np.sin(k)]).T
    pair = np.array([[5.0, 7, 7], [6, 7, 7]])
    for moved in np.array([[0, 0, 0], [5110, 0, 0]]):
        bodies = ("rod", rod + moved, np.ones(12, int)), ("pair", pair + moved, np.array([1, 2]))
        ends.append(simulate(boxes.assemble(list(bodies), h), 50))
    return apart(ends[0], ends[1], h)


@case("plane", 0.0, why="nothing drives it")
def _out_of_the_plane(simulate):
    """Two dimensions, heat bath, no enforce2d, 10,000 steps: largest |z| + |vz|"""
    # single atoms are not a rigid fix's to keep there
    bodies = mixture("planar pair row", side=4, dimension=2)
    before = 'variable out atom "abs(z)+abs(vz)"\ncompute out all reduce max v_out\n'
    before += "fix 7 all langevin 1.0 1.0 1.0 9371\n"
    result = simulate(bodies, 10000, before=before, columns="c_out", every=500)
    return result.thermo["c_out"].max()


@case("respa-order", 0.09, why="1/16 in the limit of short steps, for a scheme of second order")
def _respa_falls(simulate):
    """r-RESPA of two levels: what is left of the distance from small steps of Verlet when the outer
    step is a quarter as long"""
    system = mixture("solid planar pair row single", temperature=0.5)
    # nearly smooth at the cutoff, so that errors fall with dt²
    system = system._replace(
        setup=system.setup.replace("lj/cut 2.5", "lj/cut 3.6") + "\npair_modify shift yes"
    )
    exact = simulate(system, 400, dt=0.2, every=400)
    two = "run_style respa 2 4 inner 1 1.3 1.8 outer 2"
    runs = (simulate(system, steps, dt=80 / steps, before=two, every=1) for steps in (10, 40))
    first, last = (apart(run, exact, system.h) for run in runs)
    return last / first


@case("temp-csvr", 0.17, why="chance, in ten samples of few bodies")
def _bath(simulate):
    """fix temp/csvr to 3.0: how far the mean temperature is off, relative"""
    kelvin = simulate(
        mixture("solid planar pair row"),
        60,
        before="fix 5 all temp/csvr 3.0 3.0 0.01 4928",
        every=4,
    ).thermo["Temp"]
    return abs(kelvin[5:].mean() / 3.0 - 1)
