"""What ``sample`` runs of a scene: schemes with their time steps, how long, and what is printed."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from ..command_line import chosen
from ..experiment import Point
from ..running import run
from ..scenes import Scene, steps
from .schemes import RAW, Scheme

SAMPLED = 24.0  # fs between samples, or as near to it as a step allows
SETTLES, SETTLE = 0.1, 10.0  # of a point's time, and ps at most, that are left out before it
BEGIN = 20.0  # ps at most of a run that makes a start
LEAST = 20.0  # ps of a point: of a shorter one blocks are as short as the energy remembers
TIMES = {False: 300.0, True: 20.0}  # ps of a point, by whether it is --short
SHORT = {  # points of --short, where the scene has the scheme
    "langevin-20": (2.0, 4.0, 8.0),
    "langevin-20-equal": (8.0, 12.0),
    "langevin-20-scaled": (8.0, 12.0),
    "rigid/nvt/small": (2.0,),
    "rigid+langevin": (2.0, 4.0),
    "shake+langevin": (1.0, 2.0, 4.0),
    "npt-langevin": (2.0, 4.0, 6.0),
    "npt-langevin-400atm": (6.0,),
    "rigid/npt/small": (2.0,),
    "shake+npt": (1.0, 2.0),
}
FRAME = 240.0  # fs between frames for g(r), about
SITES = "sites.dump"  # of a run: atoms for g(r)
DIPOLE = "c_dipole[1]", "c_dipole[2]", "c_dipole[3]"
TORQUE = "v_torque"
# the kinetic energy of the bodies, that of their centres, and their torques, for any integrator;
# {1} to {3} are the parts of an atom's force
BODIES = (
    "compute molecules {group} chunk/atom molecule",
    "compute centres {group} temp/chunk molecules kecom",
    "variable moves equal sum(c_centres[1])",
    "compute kinetic {group} ke",
    "compute place {group} property/atom xu yu zu",
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


@dataclass(frozen=True)
class Lengths:
    """How much is done of each point: ps of each start, and the number of these."""

    time: float
    starts: int = 1

    @property
    def folder(self) -> str:
        """Of its runs: those of another length stay beside them."""
        return f"{self.time:.12g}-ps"

    @property
    def settle(self) -> float:
        """ps before it that are left out."""
        return min(SETTLE, SETTLES * self.time)

    @property
    def begin(self) -> float:
        """ps of a run that makes a start."""
        return min(BEGIN, self.time)

    def runs(self, dt: float, stride: int = 1) -> list[int]:
        """Steps that are left out, and steps that are sampled: multiples of ``stride``."""
        return [at_least_one(ps, stride * dt) * stride for ps in (self.settle, self.time)]

    def every(self, dt: float, stride: int = 1) -> int:
        """Steps between samples: of a settled run at least eight of them."""
        sampled = self.runs(dt, stride)[1] // stride
        return stride * max(1, min(round(SAMPLED / (stride * dt)), sampled // 8))


def at_least_one(time: float, dt: float) -> int:
    """How many steps of dt (fs) a time (ps) has; a run without any would sample nothing."""
    return max(1, steps(time, dt))


@dataclass(frozen=True)
class Plan:
    """A scene at its temperature, what is run, and what is looked at of it.

    Attributes:
        schemes: by name.
        starter: makes the starts.
        known: points that users have today: costs are told beside theirs.
        turning: degrees of freedom of all rotation; 0 tells no temperatures of the two motions.
        sites: LAMMPS's words for the atoms of g(r), as a group has them; None for no g(r).
        dipole: whether the whole's dipole is looked at.
    """

    scene: Scene
    temperature: float
    schemes: Mapping[str, Scheme]
    starter: Scheme
    known: tuple[Point, ...]
    turning: int = 0
    sites: str | None = None
    dipole: bool = False

    def label(self, point: Point) -> str:
        """A point, for tables and the terminal."""
        return f"{self.schemes[point.scheme].label}, {point.dt:g} fs"

    def points(
        self,
        only: Collection[str] | None = None,
        dt: Collection[float] | None = None,
        short: bool = False,
    ) -> list[Point]:
        """What is measured, in the order in which it runs; before a point at another state that at
        the first one.

        Args:
            only: names of schemes; None is all of LAMMPS, or with ``short`` those of `SHORT`.
            dt: time steps, fs; None is each scheme's own, or with ``short`` that of `SHORT`.
        """
        names = chosen(list(self.schemes), only)
        usual = {name: scheme.steps for name, scheme in self.schemes.items()}
        if short:
            usual |= {name: some for name, some in SHORT.items() if name in usual}
        if not only:
            names = [name for name in names if self.schemes[name].engine is None]
            names = [name for name in names if not short or name in SHORT] or names
        firsts = [(name, self.schemes[name].first or name) for name in names]
        found = [
            Point(one, step)
            for name, first in firsts
            for step in sorted(dt or usual[name])
            for one in (first, name)
        ]
        return list(dict.fromkeys(found))

    def ordered(self, points: Collection[Point]) -> list[Point]:
        """Points, once each, by scheme and step."""
        places = {name: place for place, name in enumerate(self.schemes)}
        return sorted(set(points), key=lambda point: (places[point.scheme], point.dt))

    def prints(self, scheme: Scheme, every: int, dt: float, folder: Path) -> list[str]:
        """LAMMPS commands of a run in a folder, for what is looked at each so many steps."""
        lines, columns = [], ["vol", "density"]
        if self.turning:
            forces = FORCES[RAW in scheme.lines]
            lines += [_filled(line, self.scene.group, forces) for line in BODIES]
            temperatures = ("f_1[3]", "f_1[4]") if scheme.ours else ("v_moves",)
            columns += ["c_kinetic", *temperatures, TORQUE]
        if self.dipole:
            lines += [f"variable dipole{i} atom q*c_place[{i}]" for i in (1, 2, 3)]
            lines += ["compute dipole all reduce sum v_dipole1 v_dipole2 v_dipole3"]
            columns += DIPOLE
        if self.sites:
            times = max(1, round(FRAME / dt / every))
            lines += [
                f"group sites {self.sites}",
                f'dump sites sites custom {every * times} "{(folder / SITES).resolve()}" x y z',
                "dump_modify sites sort id format float %.3f",
            ]
        return [*lines, *run.thermo(*columns), *self.scene.output]


def _filled(line: str, group: str, forces: Collection[str]) -> str:
    """A command with its words in braces; LAMMPS's own braces stay."""
    for name, word in {"group": group, **dict(zip("123", forces))}.items():
        line = line.replace(f"{{{name}}}", word)
    return line
