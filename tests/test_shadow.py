"""The shadow energy, which NVE's steps keep to the fourth order."""

import numpy as np
import pytest
from systems import mixture
from test_nvt import FREE, thermo

from validation.scenes.integrators import target

# on each atom, with its energy
SPRINGS = "fix 2 all spring/self 30.0\nfix_modify 2 energy yes\n"
ROTATIONS = "order 321", "order 123", "mrot 2", "rotor exact"


def fix(words="", group="all", name="Shadowed"):
    return f'fix 1 {group} python/move "{target(name)} {group} molecule {words}"\n'


def spreads(rows):
    """The standard deviations of the energy and of the shadow energy."""
    kept = rows[np.isfinite(rows["f_1[5]"])]
    assert len(kept) > 100
    return kept["TotEng"].std(), kept["f_1[5]"].std()


def runs(run_lammps, system, forces, words, dt, parts):
    """Spreads with steps of dt, and of parts of it."""
    found = []
    for part in parts:
        script = f"{system.setup}\nreset_timestep 0\n{forces}timestep {dt / part}\n"
        script += fix(f"every {part} {words}") + thermo("etotal f_1[5]", part)
        done = run_lammps(script + f"run {200 * part}\n", files=system.files)
        found.append(spreads(done.thermo))
    return np.array(found)


@pytest.mark.parametrize(
    ("forces", "dt", "words"),
    [(FREE + SPRINGS, 0.008, words) for words in ROTATIONS]
    + [(FREE, 0.02, words) for words in ROTATIONS[:3]],  # the exact one has no error
)
def test_fourth_order(run_lammps, forces, dt, words):
    """Locks out a wrong part of the correction, of forces, of torques or of a split rotation, on
    any kind of body, and one that forces hide: the spread falls with the fourth power of the step,
    the energy's with the second."""
    system = mixture(side=2, temperature=20.0)
    of_energy, of_shadow = runs(run_lammps, system, forces, words, dt, (1, 2)).T
    assert of_energy[0] / of_energy[1] == pytest.approx(4, rel=0.1)
    assert of_shadow[0] / of_shadow[1] == pytest.approx(16, rel=0.25)
    assert forces == FREE or of_shadow[1] < 0.1 * of_energy[1]


def test_every(run_lammps):
    """Locks out sums over ranks that count a shared body twice, and another value where fewer steps
    are asked for: the first one is there with the third step of a run."""
    system, values = mixture(side=3, temperature=20.0), []
    for ranks, every in (1, 1), (1, 5), (2, 5), (4, 1), (8, 5):
        script = f"{system.setup}\nreset_timestep 0\n{FREE}{SPRINGS}timestep 0.004\n"
        script += fix(f"every {every}") + thermo("f_1[5]", 5)
        rows = run_lammps(f"{script}run 13\nrun 7\n", files=system.files, ranks=ranks).thermo
        values.append(rows["f_1[5]"][rows["Step"] % 5 == 0])
        np.testing.assert_allclose(values[-1], values[0], rtol=1e-12)
    assert np.isnan(values[0][0])
    assert np.isfinite(values[0][1:]).all()


def test_other_forces_in_the_next_run(run_lammps):
    """Locks out a value of steps under two force fields: the bodies are free until the last of
    three steps, and then are held by springs."""
    script = f"{mixture(side=2).setup}\nreset_timestep 0\n{FREE}timestep 0.004\n"
    script += fix("every 10") + thermo("etotal f_1[5]", 1) + f"run 19\n{SPRINGS}run 21\n"
    rows = run_lammps(script, files=mixture(side=2).files).thermo
    rows = rows[rows["Step"] >= 19][-22:]  # of the second run
    value = rows["f_1[5]"]
    assert np.isnan(value[rows["Step"] < 30]).all()
    np.testing.assert_allclose(value[rows["Step"] >= 30], rows["TotEng"][0], rtol=1e-3)


def test_another_time_step(run_lammps):
    """Locks out a value of steps of different lengths, in a run that goes on with another one."""
    system = mixture(side=2, temperature=20.0)
    script = f"{system.setup}\nreset_timestep 0\n{FREE}{SPRINGS}timestep 0.008\n{fix('every 10')}"
    script += thermo("f_1[5]", 1) + "run 19\ntimestep 0.004\nrun 11 pre no\n"
    rows = run_lammps(script, files=system.files).thermo
    value = dict(zip(rows["Step"], rows["f_1[5]"]))
    assert value[20] == value[10] != value[30]


@pytest.mark.parametrize(
    "line, says",
    [
        (fix("every 0"), "'0' was given where a whole number of at least 1"),
        (fix(group="stiff") + "fix 3 rest nve\n", "fix 3 moves atoms, too"),
        (
            fix(group="stiff") + fix(group="rest", name="NVE").replace("1", "3", 1),
            "fix 3 moves atoms, too",
        ),
        (fix() + SPRINGS.split("fix_modify")[0], "fix_modify 2 energy yes, or leave"),
        (fix() + "fix 2 all viscous 1.0\n", "would drift: unfix it, or leave"),
        (fix() + "run_style respa 2 2 pair 1\n", "use run_style verlet"),
    ],
)
@pytest.mark.parametrize("ranks", [1, 2])
def test_refused(refused, line, says, ranks):
    """Locks out a number that is of other steps than those that move the atoms."""
    system = mixture(side=2)
    groups = "group stiff molecule 1 2 3\ngroup rest subtract all stiff\n"
    refused(f"{system.setup}\n{groups}{FREE}{line}run 10\n", says, system.files, ranks=ranks)
