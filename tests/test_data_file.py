"""The one writer of LAMMPS data files: LAMMPS reads what was meant, to the last bit."""

import numpy as np
import pytest

from validation.scenes.data_file import data_file

SCRIPT = """
atom_style {style}
bond_style zero
angle_style zero
read_data data.bodies
bond_coeff * 1.0
angle_coeff * 90.0
pair_style zero 1.0
pair_coeff * *
print "BOX $(xlo:%.17g) $(xhi:%.17g) $(ylo:%.17g) $(yhi:%.17g) &
$(zlo:%.17g) $(zhi:%.17g) $(xy:%.17g)"
run 0
write_dump all custom end id mol type mass {more} x y z ix iy iz vx vy vz &
    modify sort id format float %.17g
"""


@pytest.mark.parametrize(("style", "tilt"), [("molecular", 0.0), ("full", 0.7)])
def test_lammps_reads_what_was_meant(run_lammps, tmp_path, style, tilt):
    """Locks out digits, columns, masses, a box or terms that a data file loses."""
    rng = np.random.default_rng(4)
    x, v, charge = rng.uniform(0, 3, (4, 3)), rng.normal(size=(4, 3)), np.array([0.5, -0.5, 0, 0])
    molecule, kind = np.array([7, 7, 7, 9]), np.array([2, 1, 1, 2])
    image = rng.integers(-2, 3, (4, 3))
    box = [(-1 / 3, 4.1), (0, 4 + 1 / 7), (-2.5, 3.9)]
    full = style == "full"
    text = data_file(
        style,
        [molecule, kind, *[charge] * full, x, image],
        box,
        tilt=(tilt, 0, 0),
        mass=[1.0, 1 / 3],
        velocities=[v],
        terms={"bonds": [(1, 1, 2), (2, 1, 3)], "angles": [(1, 2, 1, 3)]},
    )
    script = SCRIPT.format(style=style, more="q" * full)
    log = run_lammps(script, files={"data.bodies": text}).log
    found = np.loadtxt(tmp_path / "end", skiprows=9)
    mass = np.array([1.0, 1 / 3])[kind - 1]
    columns = [np.arange(1, 5), molecule, kind, mass, *[charge] * full, x, image, v]
    np.testing.assert_allclose(found, np.column_stack(columns), rtol=0, atol=4e-15)
    (line,) = [line for line in log.splitlines() if line.startswith("BOX ")]
    assert [float(word) for word in line.split()[1:]] == [*np.ravel(box), tilt]
    assert "2 bonds" in log and "1 angles" in log
