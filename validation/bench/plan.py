"""What a benchmark measures: points, each measured as a whole and kept; and the optional passes."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ..scenes import SCENES
from ..scenes.integrators import BENCHMARKED


@dataclass(frozen=True)
class Point:
    """A scene of one size on so many ranks, or another part; its result follows from its fields.

    Attributes:
        part: name of a scene, ``passes``, ``start`` or ``memory``.
        ranks: how many, or processes; 0 for the passes, of which each has its own.
        bodies: of a scene.
        integrators: those that can run the scene.
        rounds: how often each integrator has its turn, and ``seconds`` of a timed segment.
    """

    part: str
    ranks: int = 0
    bodies: int = 0
    integrators: tuple[str, ...] = ()
    rounds: int = 1
    seconds: float = 0.0

    @property
    def name(self) -> str:
        """Of its record."""
        return "-".join(str(one) for one in (self.part, self.bodies, self.ranks) if one)

    @property
    def turns(self) -> int:
        """Runs that a meter counts."""
        others = {"passes": 2 * len(OPTIONAL), "start": 3, "memory": 1}
        runs = others.get(self.part, len(self.integrators) + 1)
        return runs * (self.rounds + (self.bodies > 0 and self.ranks > 1))

    @property
    def folders(self) -> list[Path]:
        """Its inputs."""
        passes = sorted({one.scene for one in OPTIONAL})
        others = {"passes": passes, "start": ["water"], "memory": []}
        return [SCENES[name].folder for name in others.get(self.part, [self.part])]


def points(
    parts: Iterable[str],
    ranks: Iterable[int],
    sizes: Iterable[int],
    integrators: Iterable[str],
    rounds: int,
    seconds: float,
) -> list[Point]:
    """The points of these parts; ``sizes`` are those of the water, other scenes have one."""
    found = []
    for part in parts:
        if part == "passes":
            found.append(Point(part, 0, 0, (), rounds, seconds))
        elif part == "start":  # a first use takes long: fewer rounds
            found += [Point(part, number, rounds=min(3, rounds)) for number in ranks]
        elif part == "memory":
            found += [Point(part, number) for number in ranks]
        else:
            scene = SCENES[part]
            able = tuple(one for one in integrators if BENCHMARKED[one].can_run(scene))
            own = sizes if scene.cutter else scene.sizes
            found += [
                Point(part, number, size, able, rounds, seconds) for number in ranks for size in own
            ]
    return found


@dataclass(frozen=True)
class Optional:
    """A pass that is left out when nothing needs it, and two runs that differ in it.

    Attributes:
        when: what makes it necessary.
        words: keywords of the fix, and ``more``, LAMMPS commands after it, that ask for the pass.
        less: LAMMPS commands in place of ``more`` in the run without.
        before: LAMMPS commands before the scene's, in both.
    """

    name: str
    when: str
    words: str = ""
    more: tuple[str, ...] = ()
    less: tuple[str, ...] = ()
    before: tuple[str, ...] = ()
    scene: str = "water"
    bodies: int = 1000
    ranks: int = 1


_TEMPERATURE = "thermo_style custom step temp", "thermo 1"
_PRESSURE = "thermo_style custom step temp press", "thermo 1"
_STRESS = (
    "compute s all stress/atom NULL virial",
    "compute s1 all reduce sum c_s[1]",
    "thermo_style custom step temp c_s1",
    "thermo 1",
)
# on two ranks, whose border at x = 0 A is between the dimer's molecules, and at -0.8 A goes
# through one
_APART, _THROUGH = (("velocity all set 0 0 0", f"balance 1.0 x {share}") for share in (0.5, 0.48))
_SLABS = ("processors * 1 1",)
_OFF = " force 1*10 off off off torque 1*10 off off off"
_BORDER = "a body on two ranks (dimer; less a body on each rank)"
_ATOMS = "compute stress/atom in each step, which takes the constraint virial too"
_PRESS = "the pressure of each step (thermo 1 with press)"
OPTIONAL = (
    Optional("constraint virial", _PRESS, more=_PRESSURE, less=_TEMPERATURE),
    Optional("virial of each atom", _ATOMS, more=_STRESS, less=_TEMPERATURE),
    Optional("velocities at the half step", "comm_modify vel yes", more=("comm_modify vel yes",)),
    Optional("a second inner rotation", "mrot 2", " mrot 2"),
    Optional("four inner rotations", "mrot 4", " mrot 4"),
    Optional("components switched off", "force and torque off for ten bodies", _OFF),
    Optional("table of bodies", "output 100 FILE", " output 100 v_table"),
    Optional("exchange with a second rank", _BORDER, "", _THROUGH, _APART, _SLABS, "dimer", 2, 2),
)
