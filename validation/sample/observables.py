"""The observables of `sample`: entries of `OBSERVABLES`.

An observable is omitted in scenes without the columns that it needs.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..scenes.units import BOLTZMANN, COULOMB
from ..statistics import measures, refined
from ..statistics.estimate import Estimate
from .plan import DIPOLE, KINETIC, MOTIONS, MOVES, SHADOW, TORQUE, Plan
from .schemes import Scheme

ATM = 68568.415  # atm Angstrom^3 per kcal/mol, as in LAMMPS
FINE = 1e5  # unit of compressibilities: 1e-5/atm
MOLECULE = "kcal/mol a molecule"
# columns of a run's output after equilibration, each (samples,)
Table = Mapping[str, np.ndarray]
Series = Callable[[Table, Plan, Scheme], np.ndarray | None]


@dataclass(frozen=True)
class Observable:
    """A mean that is measured.

    Attributes:
        key: in rows and files.
        unit: of biases; of the mean itself, too, unless biases are ``relative``.
        of_mean: unit of the mean where biases are relative, if it has one.
        series: whose mean it is; returns None if there is none.
        vector: columns of the vector whose square it is, if any.
        relative: whether biases are in per cent of the limit.
        exact: returns the exact value, or None if the limit of small steps is needed.
        moves: whether it depends on velocities.
        refined: the series of all steps, independent of velocities, for refined averages; None if
            the observable is not refined.
        extensive: whether that series is a sum over bodies, and the mean is per body.
    """

    key: str
    title: str
    unit: str
    series: Series
    relative: bool = False
    of_mean: str = ""
    vector: tuple[str, ...] = ()
    exact: Callable[[Plan, Scheme], float | None] = lambda plan, scheme: None
    moves: bool = False
    refined: Series | None = None
    extensive: bool = True

    def of(self, table: Table, plan: Plan, scheme: Scheme) -> np.ndarray | None:
        """The samples, (samples,); a refined series is a few samples shorter than the table."""
        if not scheme.refined or self.refined is None:
            return self.series(table, plan, scheme)
        a = self.refined(table, plan, scheme)
        if a is None:
            return None
        step = float(np.median(np.diff(table["Time"])))
        averages = refined.series(
            a,
            table["PotEng"],
            table[SHADOW],
            step,
            BOLTZMANN * scheme.temperature,
            _freedom(table) - scheme.held,
        )
        return averages / plan.scene.unit if self.extensive else averages


def _freedom(table: Table) -> int:
    """The degrees of freedom of bodies and of atoms in no body."""
    freedoms = [
        2 * table[energy] / BOLTZMANN / table[warm] for energy, warm in MOTIONS if table[warm][0]
    ]
    return round(float(np.sum([values[0] for values in freedoms])))


def _column(name: str, scale: Callable[[Plan], float] | None = None) -> Series:
    """The series of a column, divided by a number if there is one."""

    def series(table: Table, plan: Plan, scheme: Scheme) -> np.ndarray | None:
        column = table.get(name)
        return column if column is None or scale is None else column / scale(plan)

    return series


def _bodies(plan: Plan) -> float:
    return plan.scene.unit


def _capacity(table: Table, plan: Plan, scheme: Scheme) -> np.ndarray | None:
    """A series with the mean var(U) / (kT)^2 per body: the configurational heat capacity at
    constant volume."""
    if scheme.pressure is not None:
        return None
    return (
        measures.squares(table["PotEng"]) / (BOLTZMANN * scheme.temperature) ** 2 / plan.scene.unit
    )


def _compressibility(table: Table, plan: Plan, scheme: Scheme) -> np.ndarray | None:
    """A series with the mean var(V) / (kT <V>)."""
    if scheme.pressure is None:
        return None
    volume = table["Volume"]
    unit = FINE / (BOLTZMANN * ATM * scheme.temperature * np.mean(volume))
    return measures.squares(volume) * unit


def _pressure(table: Table, plan: Plan, scheme: Scheme) -> np.ndarray:
    """The pressure, corrected for a total momentum that is kept at zero."""
    if scheme.pressure is not None:
        return table["Press"]
    return table["Press"] + of_momentum(scheme.held, scheme.temperature, table["Volume"])


def of_momentum(held: int, temperature: float, volume: float | np.ndarray) -> float | np.ndarray:
    """The pressure, atm, of ``held`` degrees of freedom of the total momentum, which is missing in
    schemes that keep it at zero; ``volume`` in Angstrom^3."""
    return held * BOLTZMANN * temperature / (3 * volume) * ATM


def _refined_pressure(table: Table, plan: Plan, scheme: Scheme) -> np.ndarray | None:
    """The pressure with the mean kinetic energy of the centres instead of its fluctuations."""
    moves = table[MOTIONS[0][0]]
    kinetic = 2 * (moves - moves.mean()) / (3 * table["Volume"]) * ATM
    return _pressure(table, plan, scheme) - kinetic


def _dipole(table: Table, plan: Plan, scheme: Scheme) -> np.ndarray | None:
    if DIPOLE[0] not in table:
        return None
    square = sum(table[name] ** 2 for name in DIPOLE)
    return 4 * np.pi * COULOMB * square / (3 * table["Volume"] * BOLTZMANN * scheme.temperature)


def _translation(table: Table, plan: Plan, scheme: Scheme) -> np.ndarray | None:
    if MOVES not in table:
        return None
    return table[MOVES] / (3 * plan.scene.unit * BOLTZMANN / 2)


def _rotation(table: Table, plan: Plan, scheme: Scheme) -> np.ndarray | None:
    if MOVES not in table:
        return None
    return (table[KINETIC] - table[MOVES]) / (plan.turning * BOLTZMANN / 2)


def _apart(table: Table, plan: Plan, scheme: Scheme) -> np.ndarray | None:
    moves, turns = _translation(table, plan, scheme), _rotation(table, plan, scheme)
    return None if moves is None or turns is None else moves - turns


def _moving(plan: Plan, scheme: Scheme) -> float:
    return scheme.temperature * (1 - scheme.held / (3 * plan.scene.unit))


OBSERVABLES = (
    Observable(
        "potential", "U/N", MOLECULE, _column("PotEng", _bodies),
        refined=_column("PotEng"),
    ),
    Observable("capacity", "heat capacity", "%", _capacity, True, "k a molecule"),
    Observable(
        "pressure", "pressure", "atm", _pressure, exact=lambda plan, scheme: scheme.pressure,
        refined=_refined_pressure, extensive=False,
    ),
    Observable(
        "density", "density", "%",
        lambda table, _, scheme: None if scheme.pressure is None else table["Density"],
        True, "g/cm³",
    ),
    Observable("compressibility", "compressibility", "%", _compressibility, True, "1e-5/atm"),
    Observable(
        "torque", "squared torque", "%", _column(TORQUE, _bodies), True, "(kcal/mol)²",
        refined=_column(TORQUE),
    ),
    Observable("dipole", "dipole fluctuation", "%", _dipole, True, vector=DIPOLE),
    Observable(
        "temperature", "temp", "K", _column("Temp"),
        exact=lambda plan, scheme: scheme.temperature, moves=True,
    ),
    Observable("translation", "T_trans", "K", _translation, exact=_moving, moves=True),
    Observable(
        "rotation", "T_rot", "K", _rotation,
        exact=lambda plan, scheme: scheme.temperature, moves=True,
    ),
    Observable(
        "apart", "T_trans − T_rot", "K", _apart,
        exact=lambda plan, scheme: _moving(plan, scheme) - scheme.temperature, moves=True,
    ),
)  # fmt: skip
BY_KEY = {observable.key: observable for observable in OBSERVABLES}
CONFIGURATIONS = [observable.key for observable in OBSERVABLES if not observable.moves]


def warmer(biases: Mapping[str, Mapping], limits: Mapping[str, Mapping]) -> Estimate | None:
    """The bias of U/N divided by the configurational heat capacity: the change of temperature, K,
    that would shift U/N by the same amount.

    Args:
        biases, limits: by the observable's key, as plain data.

    Returns:
        None without both: at constant pressure, and if there is no limit.
    """
    if "potential" not in biases or "capacity" not in limits:
        return None
    bias, capacity = Estimate.of(biases["potential"]), Estimate.of(limits["capacity"])
    return measures.quotient(bias, capacity).times(1 / BOLTZMANN)
