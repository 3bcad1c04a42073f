"""What ``sampling`` runs: scenes, thermostats with their time steps, and what each run prints."""

import gzip
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..command_line import chosen
from ..ensembles import plan as ensembles
from ..ensembles.lengths import Lengths, One, Point, folder, step_of_starts
from ..ensembles.schemes import (
    MOVES,
    SEED,
    Scheme,
    bath,
    beside,
    chains,
    nvt,
    prints,
    state,
)
from ..own import counted
from ..own.system import Own
from ..running import run
from ..scenes import TEMPERATURE, Scene, peptide
from ..scenes.integrators import OURS, Integrator, constrained, nosquish, rigid
from ..scenes.liquids import BENZENE, CARBON_DIOXIDE, Liquid
from ..statistics.limit import Model

WEAK, DAMPING, STRONG = 500.0, 200.0, 50.0  # fs; friction of 2/ps, 5/ps and 20/ps
MOMENT, FACTOR = 6, 4  # amu Angstrom^2 about each axis of water; times those of other molecules
# the same, and the skin (Angstrom), of what is to give most independent samples for its time:
# friction that slows little needs moments that are larger for the same error
LARGE, TIMES_LARGE, SKIN = 9, 6, 3
TRAJECTORY = 10  # steps of a trajectory of hybrid Monte Carlo
HEAVY = 3.0, 4.0  # amu, of water's hydrogens
TIMES = {False: 300.0, True: 20.0}  # ps of a point, by whether it is --short
SHORT = {  # points of --short, where the scene has the scheme
    "langevin-20": (2.0, 4.0, 8.0),
    "langevin-20-equal": (8.0, 12.0),
    "langevin-20-scaled": (8.0, 12.0),
    "rigid/nvt/small": (2.0,),
    "rigid+langevin": (2.0, 4.0),
    "shake+langevin": (1.0, 2.0, 4.0),
}
OWN_FACTORS = 0.5, 1.0, 2.0, 3.0, 4.0  # of a script's step
FRAME = 240.0  # fs between frames for g(r), about
SITES = "sites.dump"  # of a run: atoms for g(r)
DIPOLE = "c_dipole[1]", "c_dipole[2]", "c_dipole[3]"
TORQUE = "v_torque"
WATER_OXYGENS = "type 21"  # in the peptide's box
# the bodies' torques, of forces without those of a thermostat, which fix store/force has before it
RAW = "fix raw {group} store/force"
# what stands before a seed in a script's lines: the keyword, or a temperature with its damping
SEEDS = re.compile(r"(\sseed\s+|\slangevin(?:\s+[-+\d.][-+\d.eE]*){3}\s+)[^\s\"']+")
TORQUES = (
    "compute middle {group} com/chunk molecules",
    "compute middles {group} chunk/spread/atom molecules c_middle[*]",
    *(
        f"variable torque{i} atom (c_place[{j}]-c_middles[{j}])*{{{k}}}"
        f"-(c_place[{k}]-c_middles[{k}])*{{{j}}}"
        for i, j, k in ((1, 2, 3), (2, 3, 1), (3, 1, 2))
    ),
    "compute torques {group} reduce/chunk molecules sum v_torque1 v_torque2 v_torque3",
    "variable torques vector c_torques[1]^2+c_torques[2]^2+c_torques[3]^2",
    "variable torque equal sum(v_torques)",
)
FORCES = ("fx", "fy", "fz"), ("f_raw[1]", "f_raw[2]", "f_raw[3]")


# what users have today, for molecules that shake can hold, and for others
RIGID = Point("rigid+langevin", 2.0), Point("rigid/nvt/small", 2.0)
CONSTRAINED = Point("shake+langevin", 2.0), RIGID[1]


@dataclass(frozen=True)
class Case:
    """A scene at its temperature, and what is run and looked at of it.

    Attributes:
        schemes: by name.  models: of each how its means depend on the step (`limit.Model`); those
            that are missing have a limit of their own.
        starter: makes the starts, as ``melt`` does before it, if there is one.
        turning: degrees of freedom of all rotation; 0 tells no temperatures of the two motions.
        sites: LAMMPS's words for the atoms of g(r), as a group has them; None for no g(r).
        dipole: whether the whole's dipole is looked at.
        known: points that users have today: costs are told beside theirs.
    """

    scene: Scene
    temperature: float
    schemes: Mapping[str, Scheme]
    models: Mapping[str, Model]
    starter: Scheme
    known: tuple[Point, ...]
    turning: int = 0
    sites: str | None = None
    dipole: bool = False

    @property
    def name(self) -> str:
        """Of the scene."""
        return self.scene.name

    def label(self, point: Point) -> str:
        """A point, for tables and the terminal."""
        return f"{self.schemes[point.scheme].label}, {point.dt:g} fs"

    def points(
        self,
        only: Collection[str] | None = None,
        dt: Collection[float] | None = None,
        short: bool = False,
    ) -> list[Point]:
        """What is measured, in the order in which it runs.

        Args:
            only: names of schemes; None is all, or with ``short`` those of `SHORT`.
            dt: time steps, fs; None is each scheme's own, or with ``short`` that of `SHORT`.
        """
        names = chosen(list(self.schemes), only)
        usual = {name: one.steps for name, one in self.schemes.items()}
        if short:
            usual |= {name: some for name, some in SHORT.items() if name in usual}
            names = [one for one in names if only or one in SHORT] or names
        return [Point(name, one) for name in names for one in sorted(dt or usual[name])]

    def runs(self, points: Collection[Point], lengths: Lengths) -> Iterator[tuple[Point, One]]:
        """(point, run) of each run: all points from the first start, then all from the next."""
        for start in range(1, lengths.starts + 1):
            for point in points:
                scheme, label = self.schemes[point.scheme], self.label(point)
                yield point, One(folder(start, *point), label, scheme, point.dt, start)

    def total(self, points: Collection[Point], lengths: Lengths) -> int:
        """Steps of all runs together."""
        each = ((self.schemes[one.scheme], one.dt) for one in points)
        return lengths.total(each, step_of_starts(self.scene))

    def prints(self, lengths: Lengths) -> Callable[[Scheme, float, Path], list[str]]:
        """LAMMPS commands of a run, see `runs.Runs`."""

        def more(scheme: Scheme, dt: float, folder: Path) -> list[str]:
            lines, columns = [], ["vol"]
            if self.turning:
                forces = FORCES[any(RAW in line for line in scheme.integrator.lines)]
                words = {"group": self.scene.group} | dict(zip("123", forces))
                kinetic = "compute kinetic {group} ke"
                place = "compute place {group} property/atom xu yu zu"
                those = *MOVES, kinetic, place, *TORQUES
                lines += [_filled(line, words) for line in those]
                columns += ["c_kinetic", *prints(scheme), TORQUE]
            if self.dipole:
                moments = (f"variable dipole{i} atom q*c_place[{i}]" for i in (1, 2, 3))
                lines += [*moments, "compute dipole all reduce sum v_dipole1 v_dipole2 v_dipole3"]
                columns += DIPOLE
            if self.sites:
                every = lengths.every(dt, scheme.stride)
                times = max(1, round(FRAME / dt / every))
                lines += [
                    f"group sites {self.sites}",
                    f'dump sites sites custom {every * times} "{(folder / SITES).resolve()}" x y z',
                    "dump_modify sites sort id format float %.3f",
                ]
            return [*lines, *run.thermo(*columns), *self.scene.output]

        return more


def _filled(line: str, words: Mapping[str, str]) -> str:
    """A command with its words in braces."""
    for name, word in words.items():
        line = line.replace(f"{{{name}}}", word)
    return line


def _schemes(
    temperature: float,
    *,
    points: str = "",
    rest: str = "",
    everywhere: str = "{group}",
    shake: bool = False,
    alike: bool = True,
    equal: bool = False,
    heavy: Mapping[float, tuple[str, ...]] | None = None,
    longest: float = 14.0,
) -> tuple[dict[str, Scheme], dict[str, Model]]:
    """All schemes, and how their means depend on the step.

    Args:
        points: keyword of ours for atoms that are in no body.
        rest: group of these; empty for none.
        everywhere: group of all atoms that move.
        shake: whether fix shake can hold the molecules, and ``alike`` whether it then holds all
            that bodies do: else its averages are others in the limit, too.
        equal: whether moments of `MOMENT` are of use, else those of the molecules are scaled.
        heavy: of hydrogens' masses the LAMMPS commands that set all masses.
        longest: fs.
    """
    every = _nosquish(temperature, points, bool(rest), equal)
    usual, kicks = state(temperature, DAMPING), (RAW, bath(temperature, DAMPING, everywhere))
    every |= _rigid(usual, kicks, rest)
    if shake:
        held = _constrained(usual, kicks, everywhere, heavy or {})
        every |= held if alike else dict.fromkeys(held)
    made = {
        one.name: replace(
            one, temperature=temperature, steps=tuple(dt for dt in one.steps if dt <= longest)
        )
        for one in every
    }
    return made, {one.name: model for one, model in every.items() if model}


def _nosquish(
    temperature: float, points: str, whole: bool, equal: bool
) -> dict[Scheme, Model | None]:
    """Ours; see `_schemes`.

    Args:
        whole: whether they move all atoms.
    """
    usual, strong = (state(temperature, damping) for damping in (DAMPING, STRONG))
    noise = f"langevin seed {SEED}"
    if equal:
        ending, word, said = "equal", f"equal {MOMENT}", f"moments of {MOMENT} amu Å²"
        large, told = f"equal {LARGE}", f"moments of {LARGE} amu Å²"
    else:
        ending, word, said = "scaled", f"scale {FACTOR}", f"{FACTOR} times the moments"
        large, told = f"scale {TIMES_LARGE}", f"{TIMES_LARGE} times the moments"
    steps = 1.0, 2.0, 4.0, 6.0, 8.0, 10.0
    long = 4.0, 8.0, 10.0, 12.0, 14.0
    ours: dict[Scheme, Model | None] = {
        one: Model(reach)
        for one, reach in (
            (_ours("langevin-5", "NVT langevin 5/ps", usual, noise, steps), 6.0),
            (_ours("langevin-20", "NVT langevin 20/ps", strong, noise, steps), 8.0),
            (
                _ours(
                    f"langevin-5-{ending}", f"NVT langevin 5/ps, {said}", usual,
                    f"{noise} moments {word}", long,
                ),
                10.0,
            ),
            (
                _ours(
                    f"langevin-20-{ending}", f"NVT langevin 20/ps, {said}", strong,
                    f"{noise} moments {word}", long,
                ),
                10.0,
            ),
            (
                _skinned(
                    _ours(
                        f"langevin-2-{ending}", f"NVT langevin 2/ps, {told}, skin of {SKIN} Å",
                        state(temperature, WEAK), f"{noise} moments {large}", long,
                    )
                ),
                10.0,
            ),
            (_ours("csvr", "NVT csvr", usual, f"csvr seed {SEED}", steps[1:5], 3), 6.0),
            (_ours("nh", "NVT nh", usual, "nh", steps[1:5], 3), 6.0),
        )
    }  # fmt: skip
    if equal:  # the step chooses larger moments of such molecules only
        label, words = "NVT langevin 20/ps, moments of the step", f"{noise} moments step"
        # no model: the moments are others at each step
        ours[_ours("langevin-20-step", label, strong, words, (6.0, 8.0, 12.0))] = None
    ours |= dict.fromkeys(_hybrid(temperature, ending, large, told), Model())
    return {
        replace(one, integrator=_with(one.integrator, points), whole=whole): model
        for one, model in ours.items()
    }


def _hybrid(temperature: float, ending: str, large: str, told: str) -> Iterator[Scheme]:
    """Hybrid Monte Carlo: of many bodies no long step is accepted without larger moments."""
    words = f" temp {temperature:g} steps {TRAJECTORY} seed {SEED}"
    label = f"HMC, {TRAJECTORY} steps"
    plain = nosquish("hmc", label, words, "HMC")
    slow = nosquish(f"hmc-{ending}", f"{label}, {told}", f"{words} moments {large}", "HMC")
    for one, steps in (plain, (2.0, 4.0, 6.0)), (slow, (8.0, 10.0)):
        yield Scheme(one, temperature=temperature, steps=steps, stride=TRAJECTORY)


def _rigid(usual: str, kicks: tuple[str, ...], rest: str) -> dict[Scheme, Model | None]:
    """LAMMPS's rigid fixes; see `_schemes`."""
    others = (f"fix rest {rest} nvt{usual}",) if rest else ()
    return {
        # it counts three degrees of freedom more than a whole without momentum has
        _after(chains("rigid/nvt/small", usual, steps=(0.5, 1.0, 2.0, 3.0, 4.0)), others): None,
        beside(
            "rigid+langevin", "rigid/nve/small + langevin", rigid("rigid/nve/small"), *kicks,
            steps=(0.5, 1.0, 2.0, 3.0, 4.0),
        ): Model(4.0),
    }  # fmt: skip


def _ours(name, label, at, words, steps, held=0) -> Scheme:
    return nvt(name, label, at, words, steps=steps, held=held)


def _skinned(scheme: Scheme) -> Scheme:
    """With lists of neighbours that last longer."""
    one = scheme.integrator
    skin = f"neighbor {SKIN} bin"
    return replace(scheme, integrator=replace(one, lines=(skin, *one.lines)))


def _with(integrator, words):
    """One of ours with keywords more."""
    *first, last = integrator.lines
    return replace(integrator, lines=(*first, f"{last}{words}"))


def _after(scheme: Scheme, lines: tuple[str, ...]) -> Scheme:
    """Beside further fixes, that move all atoms that it does not."""
    one = scheme.integrator
    return replace(scheme, integrator=replace(one, lines=(*one.lines, *lines)), whole=bool(lines))


def _constrained(usual, kicks, everywhere, heavy) -> dict[Scheme, Model]:
    """What shake holds: atoms as points, with LAMMPS's thermostats."""
    steps = 0.5, 1.0, 2.0, 3.0, 4.0, 6.0
    one = constrained("shake", "1e-6")
    one = replace(one, lines=tuple(line.replace("{group}", everywhere) for line in one.lines))
    chained = f"fix 1 {everywhere} nvt{usual}", one.lines[1]
    rescaled = f"fix bath {everywhere} temp/csvr" + usual.replace(" temp", "") + f" {SEED}"
    label = "shake + langevin"
    made = [
        beside("shake+langevin", label, one, *kicks, steps=steps),
        Scheme(replace(one, name="shake+nvt", label="shake + nvt", lines=chained), 3, steps=steps),
        beside("shake+csvr", "shake + csvr", one, rescaled, held=3, steps=steps),
        *(
            beside(
                f"shake-{mass:g}+langevin", f"{label}, hydrogens of {mass:g} amu", one, *lines,
                *kicks, steps=(2.0, 3.0, 4.0, 5.0, 6.0, 7.0),
            )
            for mass, lines in heavy.items()
        ),
    ]  # fmt: skip
    return {replace(one, whole=True): Model(6.0 if "-" in one.name else 4.0) for one in made}


def _water(_: Path) -> Case:
    scene, mass = replace(ensembles.scene(), name="water"), 15.9994 + 2 * 1.008
    heavy = {one: (f"mass 1 {mass - 2 * one:.8g}", f"mass 2 {one:g}") for one in HEAVY}
    made, models = _schemes(298.0, shake=True, equal=True, heavy=heavy)
    more: dict = {"sites": "type 1", "dipole": True}
    return Case(scene, 298.0, made, models, made["langevin-20"], CONSTRAINED, 3 * 512, **more)


def _peptide(_: Path) -> Case:
    scene, temperature = peptide.scene(), TEMPERATURE["peptide"]
    how: dict = {"points": " points flexible", "rest": "flexible", "everywhere": "all"}
    # of four atoms shake holds three bonds, so the energy of their angles is in its averages
    made, models = _schemes(temperature, shake=True, alike=False, longest=6.0, **how)
    turning = rotations(scene)
    return Case(
        scene, temperature, made, models, made["langevin-20"], CONSTRAINED, turning, WATER_OXYGENS
    )


def rotations(scene: Scene) -> int:
    """Degrees of freedom of the rotation of all bodies of a scene whose data file is packed: two
    of those of two atoms, three of others."""
    (file,) = (line.split()[1] for line in scene.setup if line.startswith("read_data "))
    with gzip.open(scene.folder / file, "rt") as opened:
        atoms = opened.read().split("\nAtoms", 1)[1].split("\n\n", 2)[1]
    body = np.array([line.split()[1] for line in atoms.splitlines()], int)
    sizes = np.bincount(body)[1:]
    return int(2 * np.sum(sizes == 2) + 3 * np.sum(sizes > 2))


def _liquid(one: Liquid) -> Callable[[Path], Case]:
    def case(out: Path) -> Case:
        made, models = _schemes(one.temperature)
        hot = state(one.temperature, STRONG).replace(
            f" temp {one.temperature:g}", f" temp {one.melt:g}"
        )
        starter = nvt("melt", "melt", hot, f"langevin seed {SEED}")
        turning = one.molecules * (2 if np.linalg.matrix_rank(one.shape) == 1 else 3)
        scene = one.scene(out / "scenes")
        return Case(scene, one.temperature, made, models, starter, RIGID, turning, "type 1")

    return case


CASES: dict[str, Callable[[Path], Case]] = {  # each writes what it needs into a folder
    "water": _water,
    "peptide": _peptide,
    "benzene": _liquid(BENZENE),
    "co2": _liquid(CARBON_DIOXIDE),
}


def of_script(own: Own) -> Case:
    """A script of one's own, at its constant temperature.

    Raises:
        SystemExit: it is no script that averages of can be held against a limit.
    """
    found, scene = own.found.state, own.scene
    if scene.units != "real" or not found.temp or found.press or found.ramps:
        raise SystemExit(
            f"{scene.subject}: sampling needs units real and one constant temperature, kept by the "
            "fix whose place others take, in a box that does not change: give a run with fix nvt, "
            "rigid/nvt or nosquish/nvt"
        )
    temperature = float(found.temp[0])
    made, models = {}, {}
    for name, one in own.integrators.items():
        lines = tuple(SEEDS.sub(rf"\1{SEED}", line) for line in one.lines)
        held = _held(own, one)
        steps = tuple(factor * scene.dt for factor in OWN_FACTORS)
        made[name] = Scheme(replace(one, lines=lines), held, temperature, steps=steps)
        if "rigid/n" not in one.label:
            models[name] = Model(2 * scene.dt)
    starter = made.get(OURS, made[own.reference])
    return Case(scene, temperature, made, models, starter, (Point(own.reference, scene.dt),))


def _held(own: Own, one: Integrator) -> int:
    """Degrees of freedom of the total momentum that an integrator keeps at zero: all, unless it has
    random forces, or something else acts on the atoms."""
    words = " ".join(one.lines)
    ours = one.kind == "ours"
    random = "langevin" in words or (ours and " thermostat " not in words)
    alone = (own.found.body > 0).all() and all(own.said["periodic"]) and not counted.acting(own)
    return 0 if random or not alone else own.said["dimension"]
