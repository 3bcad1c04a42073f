"""LAMMPS's unit styles, as tables and figures call them, and constants."""

from dataclasses import dataclass

BOLTZMANN = 0.0019872067  # kcal/mol/K, LAMMPS's
COULOMB = 332.06371  # kcal/mol Angstrom of two unit charges, LAMMPS's: 1 / (4 pi epsilon_0)
# reduced units are those of argon, whose unit of time is 2.156 ps: sqrt(39.948 amu (3.405 Å)² /
# (k 119.8 K)); so many of them are 1 ns
NS_OF_REDUCED = 464.0


@dataclass(frozen=True)
class Units:
    """Names of units.

    Attributes:
        energy, time, pressure, length, temperature: as in LAMMPS.
        long: a longer time, and ``many``, the number of the shorter ones in it.
    """

    energy: str
    time: str
    long: str
    many: float
    pressure: str
    length: str
    temperature: str = "K"


UNITS = {
    "real": Units("kcal/mol", "fs", "ps", 1000.0, "atm", "Å"),
    "metal": Units("eV", "ps", "ps", 1.0, "bar", "Å"),
    "lj": Units("ε", "τ", "τ", 1.0, "ε/σ³", "σ", "ε/k"),
    "si": Units("J", "s", "s", 1.0, "Pa", "m"),
    "cgs": Units("erg", "s", "s", 1.0, "dyne/cm²", "cm"),
    "electron": Units("Ha", "fs", "ps", 1000.0, "Pa", "bohr"),
    "micro": Units("pg µm²/µs²", "µs", "µs", 1.0, "pg/(µm µs²)", "µm"),
    "nano": Units("ag nm²/ns²", "ns", "ns", 1.0, "ag/(nm ns²)", "nm"),
}
