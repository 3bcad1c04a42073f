"""The same bodies, of molecules' size, in all unit styles of LAMMPS:
against fix rigid/nve and the motion in LJ units."""

import numpy as np
import pytest

from fix_nosquish.integrators import crescale
from support.systems import (
    LIKE_LAMMPS,
    OURS,
    RIGID,
    UNITS,
    Units,
    apart,
    assert_same,
    mixture,
    tensor,
)

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
# metres in the unit of length, pascals in that of pressure
METRES = {"real": (1e-10, 101325.0), "metal": (1e-10, 1e5), "electron": (5.2917721e-11, 1.0)}
BATH = "temp v_T v_T v_t seed 7"
# words of fix lines, and what they print that is an energy
BATHS = {
    "langevin": (f"nvt molecule {BATH}", "econserve"),
    "csvr": (f"nvt molecule {BATH} thermostat csvr", "econserve"),
    "nh": ("nvt molecule temp v_T v_T v_t thermostat nh", "econserve"),
    "moments": (f"nvt molecule {BATH} moments step", "econserve"),
    "crescale": (f"npt molecule {BATH} iso v_P v_P v_t compressibility v_k", "econserve"),
    "mtk": (f"npt molecule {BATH} iso v_P v_P v_t barostat mtk every 2", "econserve"),
    "NPH": ("nph molecule iso v_P v_P v_t every 2", "econserve"),
    "HMC": ("hmc molecule temp v_T steps 10 seed 7", "f_1[6]"),
}


@pytest.fixture
def scaled(monkeypatch):
    """A function that makes the same System as `mixture` does, in a unit style."""

    def make(style, *kinds):
        if style in STYLES:
            monkeypatch.setitem(UNITS, style, STYLES[style][0])
        return mixture(*kinds, units=style)

    return make


@pytest.mark.quick("real", "si")
@pytest.mark.parametrize("style", STYLES)
def test_motion_is_that_of_lj_units(simulate, scaled, style):
    """Locks out absolute thresholds, which stop small bodies in si, cgs, micro and nano, and
    constants of one unit style: trajectory, temperature, energy and pressure tensor of all kinds of
    bodies are those of LJ units."""
    plain, (units, joule) = mixture(), STYLES[style]
    want, run = simulate(plain, OURS, 50), simulate(scaled(style), OURS, 50)
    scaled_back = run._replace(x=run.x / units.length, v=run.v * (units.time / units.length))
    assert_same(scaled_back, want, plain.h, 1e-10)
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


@pytest.mark.quick("lj", "metal", "real")
@pytest.mark.parametrize("style", ["lj", *STYLES])
def test_motion_is_that_of_rigid_nve(simulate, scaled, style):
    """Locks out a constant that is wrong in the same way in all unit styles, or degrees of freedom
    or an energy that depend on the unit style."""
    system = scaled(style, "solid planar")
    theirs, ours = simulate(system, RIGID, 50), simulate(system, LIKE_LAMMPS, 50)
    assert_same(ours, theirs, system.h, 1e-10)
    for name in "Temp", "TotEng":
        np.testing.assert_allclose(ours.thermo[name], theirs.thermo[name], rtol=1e-10)


@pytest.mark.parametrize("name", BATHS)
@pytest.mark.parametrize("style", METRES)
def test_temperatures_and_pressures_are_those_of_lj_units(simulate, scaled, style, name):
    """Locks out a temperature, a pressure, a test of a trajectory or an energy of a thermostat that
    lacks a constant of the unit style: motion, volume and energies are those of LJ units."""
    units, joule = STYLES[style]
    metre, pascal = METRES[style]
    line, column = BATHS[name]
    heat, pressure = units.energy * joule, units.energy * joule / (units.length * metre) ** 3
    numbers = {"T": heat / BOLTZMANN, "t": units.time, "P": pressure / pascal}
    numbers["k"] = 1.0 / numbers["P"]

    def run(system, **scale):
        values = {"T": 1.0, "t": 0.2, "P": 0.5, "k": 0.2}
        lines = (f"variable {k} equal {v * scale.get(k, 1.0):.17g}" for k, v in values.items())
        fix = f"fix 1 all nosquish/{line}"
        how = dict(before="\n".join(lines), columns=f"vol {column}", dt=2.0)
        return simulate(system, fix, 50, **how)

    plain = mixture()
    want, result = run(plain), run(scaled(style), **numbers)
    result = result._replace(x=result.x / units.length, v=result.v * (units.time / units.length))
    stretched = plain.h * np.cbrt(want.thermo["Volume"][-1] / want.thermo["Volume"][0])
    # the digits of LAMMPS's constants
    assert apart(result, want, stretched) < 1e-4
    assert np.abs(result.v - want.v).max() < 1e-3
    volumes = result.thermo["Volume"] / units.length**3
    np.testing.assert_allclose(volumes, want.thermo["Volume"], rtol=1e-5)
    column = column.capitalize() if column == "econserve" else column
    energies = result.thermo[column] / units.energy
    np.testing.assert_allclose(energies, want.thermo[column], rtol=1e-4, atol=1e-3)
    assert ("WARNING" in result.log) == ("WARNING" in want.log)


@pytest.mark.parametrize("style", METRES)
def test_compressibility_of_water(style):
    """Locks out a default that is that of water in some unit styles only."""
    assert crescale._PER_ATM[style] == pytest.approx(METRES[style][1] / 101325.0)
