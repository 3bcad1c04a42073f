"""The same bodies, of molecules' size, in all unit styles of LAMMPS:
against fix rigid/nve and the motion in LJ units."""

import numpy as np
import pytest
from systems import LIKE_LAMMPS, OURS, RIGID, UNITS, Units, apart, mixture, tensor

# Length, mass, energy; mass v^2 / energy by LAMMPS's definition; joules in its unit of energy.  Of
# electron LAMMPS's manual says that velocities are in Bohr / 1.03275 fs, but it moves atoms by v dt
# with dt in fs: they are in Bohr / fs.
STYLES = {
    "real": (UNITS["real"], 4184 / 6.02214179e23),
    "metal": (UNITS["metal"], 1.602176487e-19),
    "si": (UNITS["si"], 1.0),
    "cgs": (Units(3.4e-8, 2e-23, 1.66e-14), 1e-7),
    "electron": (Units(6.4, 12.0, 3.8e-4, 1 / 0.937582899), 4.35974394e-18),
    "micro": (Units(3.4e-4, 2e-11, 1.66e-6), 1e-15),
    "nano": (Units(0.34, 2e-5, 1.66), 1e-21),
}
BOLTZMANN = 1.3806504e-23  # J / K, as in LAMMPS


@pytest.fixture
def scaled(monkeypatch):
    """A function that makes the same System as `mixture` does, in a unit style."""

    def make(style, *kinds):
        if style in STYLES:
            monkeypatch.setitem(UNITS, style, STYLES[style][0])
        return mixture(*kinds, units=style)

    return make


def assert_same(a, b, h):
    """Positions and velocities are equal to 1e-10 of the largest."""
    assert apart(a, b, h) < 1e-10 * np.abs(b.x).max()
    np.testing.assert_allclose(a.v, b.v, rtol=0, atol=1e-10 * np.abs(b.v).max())


@pytest.mark.parametrize("style", STYLES)
def test_motion_is_that_of_lj_units(simulate, scaled, style):
    """Locks out absolute thresholds, which stop small bodies in si, cgs, micro and nano, and
    constants of one unit style: trajectory, temperature, energy and pressure tensor of all kinds of
    bodies are those of LJ units."""
    plain, (units, joule) = mixture(), STYLES[style]
    want, run = simulate(plain, OURS, 50), simulate(scaled(style), OURS, 50)
    assert_same(
        run._replace(x=run.x / units.length, v=run.v * (units.time / units.length)), want, plain.h
    )
    # electron's mass v^2 / energy, for energies, is 5e-9 off what it moves atoms with
    np.testing.assert_allclose(
        run.thermo["TotEng"] / units.energy, want.thermo["TotEng"], rtol=1e-8
    )
    temperature = run.thermo["Temp"] * BOLTZMANN / (units.energy * joule)
    np.testing.assert_allclose(
        temperature, want.thermo["Temp"], rtol=2e-6
    )  # the digits of LAMMPS's constants
    # pressure is energy by volume, times a constant of the unit style
    ratio = np.linalg.norm(tensor(run)) / np.linalg.norm(tensor(want))
    np.testing.assert_allclose(
        tensor(run) / ratio, tensor(want), rtol=0, atol=1e-7 * np.abs(tensor(want)).max()
    )


@pytest.mark.parametrize("style", ["lj", *STYLES])
def test_motion_is_that_of_rigid_nve(simulate, scaled, style):
    """Locks out a constant that is wrong in the same way in all unit styles, or degrees of freedom
    or an energy that depend on the unit style."""
    system = scaled(style, "solid planar")
    theirs, ours = simulate(system, RIGID, 50), simulate(system, LIKE_LAMMPS, 50)
    assert_same(ours, theirs, system.h)
    for name in "Temp", "TotEng":
        np.testing.assert_allclose(ours.thermo[name], theirs.thermo[name], rtol=1e-10)
