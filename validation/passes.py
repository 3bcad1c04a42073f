"""What each optional pass of a step costs: Modify of a run with it less that of one without it."""

from dataclasses import dataclass, replace

from validation import rounds, run
from validation.integrators import Integrator, nosquish
from validation.scenes import SCENES


@dataclass(frozen=True)
class Variant:
    """A run of ours.

    Attributes:
        words: keywords of the fix.
        more: LAMMPS commands after the fix's.
        before: LAMMPS commands before the scene's.
    """

    words: str = ""
    more: tuple[str, ...] = ()
    before: tuple[str, ...] = ()


@dataclass(frozen=True)
class Optional:
    """A pass that is left out when nothing needs it.

    Attributes:
        name: in words.
        when: what makes it necessary.
        with_it, without: the two runs.
        scene, bodies, ranks: where it is measured.
    """

    name: str
    when: str
    with_it: Variant
    without: Variant = Variant()
    scene: str = "water"
    bodies: int = 1000
    ranks: int = 1


# the dimer at rest, on two ranks, whose border at x = 0 A is between the molecules and at -0.8 A goes through one
_TWO_RANKS = Variant(before=("processors * 1 1",), more=("velocity all set 0 0 0",))
_TEMPERATURE = Variant(more=("thermo_style custom step temp", "thermo 1"))

OPTIONAL = (
    Optional(
        "constraint virial", "the pressure of each step (thermo 1 with press)",
        Variant(more=("thermo_style custom step temp press", "thermo 1")), _TEMPERATURE,
    ),
    Optional(
        "virial of each atom", "compute stress/atom in each step, which takes the constraint virial too",
        Variant(more=("compute s all stress/atom NULL virial", "compute s1 all reduce sum c_s[1]",
                      "thermo_style custom step temp c_s1", "thermo 1")), _TEMPERATURE,
    ),
    Optional("velocities at the half step", "comm_modify vel yes", Variant(more=("comm_modify vel yes",))),
    Optional("a second inner rotation", "mrot 2", Variant(" mrot 2")),
    Optional("four inner rotations", "mrot 4", Variant(" mrot 4")),
    Optional("components switched off", "force and torque off for ten bodies", Variant(" force 1*10 off off off torque 1*10 off off off")),
    Optional("table of bodies", "output 100 FILE", Variant(" output 100 v_table")),
    Optional(
        "exchange with a second rank", "a body on two ranks (dimer; less a body on each rank)",
        replace(_TWO_RANKS, more=(*_TWO_RANKS.more, "balance 1.0 x 0.48")), replace(_TWO_RANKS, more=(*_TWO_RANKS.more, "balance 1.0 x 0.5")),
        scene="dimer", bodies=2, ranks=2,
    ),
)  # fmt: skip


def measure(optional, folder, *, count, seconds, silence, meter):
    """Time a pass's two runs in turn.

    Args:
        optional: an ``Optional``.
        folder: for the runs' files.
        count: rounds.
        seconds: of a timed segment.
        silence: s without a sign of life after which a run is given up.
        meter: a ``console.Meter``.

    Returns:
        (row, interrupted): plain data: ``cost``, the spread of the difference in us per step; ``with`` and ``without``,
        those of the two; ``error``.
    """
    row = {
        "name": optional.name,
        "when": optional.when,
        "scene": optional.scene,
        "bodies": optional.bodies,
        "ranks": optional.ranks,
    }
    scene = SCENES[optional.scene].of_size(optional.bodies)
    variants = {"without": optional.without, "with": optional.with_it}

    def job(name, runs):
        return _job(
            scene,
            variants[name],
            (folder / name).resolve(),
            runs,
            ranks=optional.ranks,
            silence=silence,
        )

    loop = rounds.calibrate(lambda runs: job("without", runs))
    if not isinstance(loop, float):
        return row | {"error": loop.error}, loop.interrupted
    runs = rounds.lengths(loop, seconds).runs
    jobs = {
        name: (f"{optional.name[:18]}, {name}", lambda _, name=name: job(name, runs))
        for name in variants
    }
    found, errors, interrupted = rounds.in_turn(jobs, count, meter)
    row["error"] = next(iter(errors.values()), None)
    row["lines"] = {name: job(name, runs).commands for name in variants}
    row |= {name: rounds.spread(found[name], "modify") for name in variants}
    row["cost"] = rounds.difference(found["with"], found["without"], lambda one: one["modify"])
    row["cpu"] = min(
        (one["cpu"] for times in found.values() for one in times if "cpu" in one), default=None
    )
    return row, interrupted


def _job(scene, variant, directory, runs, *, ranks, silence):
    ours = nosquish("nosquish", "fix_nosquish.NVE", variant.words)
    if "v_table" in variant.words:
        ours = Integrator(
            ours.name, ours.label, (f"variable table string {directory}/bodies.csv", *ours.lines)
        )
    return run.job(
        replace(scene, setup=(*variant.before, *scene.setup)), ours, directory, runs, dt=scene.dt, every=0, ranks=ranks,
        silence=silence, positions=False, more=variant.more,
    )  # fmt: skip
