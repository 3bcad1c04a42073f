"""LAMMPS's unit styles, as tables and figures call them, and its constant of Boltzmann."""

from dataclasses import dataclass

BOLTZMANN = 0.0019872067  # kcal/mol/K


@dataclass(frozen=True)
class Units:
    """Names of units.

    Attributes:
        energy, time, pressure, length, temperature: as LAMMPS has them.
        long: a longer time, and ``many``, how many of the shorter one it has.
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
