"""What `cost` measures: points, each measured as a whole and kept."""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ..scenes import SCENES
from ..scenes.integrators import BENCHMARKED

PARTS = *SCENES, "passes", "start", "memory", "messages"
COUNTED_ON = 1, 2, 4, 8, 16  # ranks of the messages, if no others are named
FULL = 27  # ranks from where on each has its full 26 neighbours: bricks are counted on so many, too


@dataclass(frozen=True)
class Point:
    """A scene of one size on so many ranks, or another part; its result follows from its fields.

    Attributes:
        part: name of a scene, ``passes``, ``start``, ``memory``, ``messages`` or ``link``.
        ranks: how many, or processes; 0 for the passes, of which each has its own.
        bodies: of a scene.
        integrators: those that are compared.
        rounds: how often each integrator has its turn, and ``seconds`` of a timed segment.
        cut: of messages: ``slab`` or ``brick``.
    """

    part: str
    ranks: int = 0
    bodies: int = 0
    integrators: tuple[str, ...] = ()
    rounds: int = 1
    seconds: float = 0.0
    cut: str = ""

    @property
    def name(self) -> str:
        """Of its record."""
        words = self.part, self.cut, self.bodies, self.ranks
        return "-".join(str(word) for word in words if word)

    @property
    def turns(self) -> int:
        """Runs that a meter counts."""
        others = {"passes": 2 * len(PASSES), "start": 3, "memory": 1, "link": 1, "messages": 3}
        runs = others.get(self.part, len(self.integrators) + 1)
        counts = self.part not in others and self.ranks > 1
        return runs * (self.rounds + counts)

    @property
    def inputs(self) -> list[Path]:
        """Folders of its inputs."""
        passes = sorted({one.scene for one in PASSES})
        others = {"passes": passes, "start": ["water"], "messages": ["water"]}
        names = [self.part] if self.part in SCENES else others.get(self.part, [])
        return [SCENES[name].folder for name in names]


def points(
    parts: Iterable[str],
    ranks: tuple[int, ...] | None,
    sizes: Iterable[int],
    integrators: Iterable[str],
    rounds: int,
    seconds: float,
) -> list[Point]:
    """The points of these parts; ``sizes`` are those of the water, other scenes have one."""
    found, few = [], ranks or (1, 2)
    for part in parts:
        if part == "passes":
            found.append(Point(part, rounds=rounds, seconds=seconds))
        elif part == "start":  # a first use takes long: fewer rounds
            found += [Point(part, number, rounds=min(3, rounds)) for number in few]
        elif part == "memory":
            found += [Point(part, number) for number in few]
        elif part == "messages":
            cuts = {"slab": ranks or COUNTED_ON, "brick": sorted({*(ranks or COUNTED_ON), FULL})}
            found += [Point(part, number, cut=cut) for cut in cuts for number in cuts[cut]]
            found.append(Point("link", 2))
        else:
            scene = SCENES[part]
            able = tuple(name for name in integrators if BENCHMARKED[name].can_run(scene))
            own = sizes if scene.cutter else scene.sizes
            found += [
                Point(part, number, size, able, rounds, seconds)
                for number, size in itertools.product(few, own)
            ]
    return found


@dataclass(frozen=True)
class Pass:
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
PASSES = (
    Pass("constraint virial", _PRESS, more=_PRESSURE, less=_TEMPERATURE),
    Pass("virial of each atom", _ATOMS, more=_STRESS, less=_TEMPERATURE),
    Pass("velocities at the half step", "comm_modify vel yes", more=("comm_modify vel yes",)),
    Pass("a second inner rotation", "mrot 2", " mrot 2"),
    Pass("four inner rotations", "mrot 4", " mrot 4"),
    Pass("components switched off", "force and torque off for ten bodies", _OFF),
    Pass("table of bodies", "output 100 FILE", " output 100 v_table"),
    Pass("exchange with a second rank", _BORDER, "", _THROUGH, _APART, _SLABS, "dimer", 2, 2),
)
