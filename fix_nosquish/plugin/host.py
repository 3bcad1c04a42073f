"""The plugin as a host: LAMMPS calls its fix, and this asks it."""

from collections.abc import Callable, Sequence
from ctypes import byref, c_void_p, cast
from functools import partial
from itertools import count, takewhile
from types import SimpleNamespace
from typing import Any, Generic, TypeVar

import numpy as np

from ..errors import refuse
from ..host import hosts
from ..host.hosts import OtherFix
from ..loops.compiled import array
from ..run.schedule import SCHEDULE
from ..structs import FUNCTIONS, Action, Bridge, FixDescription

AT = "at_"  # the fields of lists of actions are this and the hook's name
LISTS = tuple(name for name, _ in Bridge._fields_ if name.startswith(AT))
T = TypeVar("T")


def _step(address: int) -> int:
    """The number of a step at this address."""
    return int(array(address, (1,), np.int64)[0])


class _Shared(Generic[T]):
    """An attribute in the memory that C++ shares, of this kind."""

    def __init__(self, kind: Callable[[Any], T]) -> None:
        self.kind = kind

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, host: "Host", owner: type) -> T:
        return self.kind(getattr(host._bridge, self.name))

    def __set__(self, host: "Host", value: T) -> None:
        setattr(host._bridge, self.name, value)


class Host(hosts.Host):
    """The plugin's fix, as Python sees it; set as ``host`` on an instance that has this
    attribute."""

    phase, facts, vflag, changes = _Shared(int), _Shared(int), _Shared(int), _Shared(int)
    box_every, held, counts, rotor = _Shared(int), _Shared(int), _Shared(int), _Shared(int)
    begins, pushes, remap_group = _Shared(int), _Shared(int), _Shared(int)
    world, min_dof, dmax = _Shared(int), _Shared(int), _Shared(float)
    ghost_velocity, scalar_pressure = _Shared(bool), _Shared(bool)
    next_output, last_step = _Shared(_step), _Shared(_step)

    def __init__(self, bridge: Bridge) -> None:
        self.fix_id = bridge.fix_id.decode()
        self.group = bridge.group.decode(errors="replace")
        self._bridge, self._words = bridge, 0
        steps = bridge.begin_step, bridge.end_step
        self.span = tuple(array(address, (1,), np.int64) for address in steps)
        sizes = {"forces_virial": 6, "rate": 6, "external_sums": 7, "deformed_box": 9}
        for name, size in sizes.items():
            setattr(self, name, array(getattr(bridge, name), (size,), float))
        for name in "set_box", "flip_box", "find_clusters", "orient_atom":
            function = cast(getattr(bridge, name), c_void_p).value
            setattr(self, name, np.array([function, bridge.fix or 0]))
        self._call = SimpleNamespace()  # of C++'s functions; ctypes makes one at each access
        for name in FUNCTIONS:
            setattr(self._call, name, partial(getattr(bridge, name), bridge.fix))
        for name in "log", "removed_freedom", "pair_style", "set_array_rows", "now", "point":
            setattr(self, name, getattr(self._call, name))

    def fixes(self) -> list[OtherFix]:
        described, fixes = FixDescription(), []
        kinds = OtherFix.__annotations__.items()
        for _ in takewhile(lambda n: self._call.nth_fix(n, byref(described)), count()):
            if described.id is not None:  # not this fix itself
                values = [_as(kind, getattr(described, name)) for name, kind in kinds]
                fixes.append(OtherFix(*values))
        return fixes

    @property
    def command(self) -> list[str]:
        return self._call.command().decode(errors="replace").split()

    def shapes(self, natoms: int) -> np.ndarray | None:
        numbers = np.zeros((natoms, 7))
        return numbers if self._call.particles(numbers.ctypes.data) else None

    def inserted(self) -> np.ndarray:
        numbers = array(self._bridge.inserted, (self._bridge.insertions, 10), float).copy()
        self._bridge.insertions = 0
        return numbers

    @property
    def kept_bodies(self) -> np.ndarray:
        return array(self._bridge.kept_bodies, (self._bridge.kept_rows, 3), float).copy()

    def keep_bodies(self, rows: np.ndarray | None) -> None:
        self._rows = np.empty((0, 3)) if rows is None else np.ascontiguousarray(rows)
        self._bridge.kept_bodies, self._bridge.kept_rows = _address(self._rows), len(self._rows)

    def molecule(self, number: int) -> np.ndarray | None:
        numbers = np.empty(13)
        return numbers if self._call.molecule(number, numbers.ctypes.data) else None

    def moved_by(self, fix_id: str, x: np.ndarray) -> np.ndarray:
        original = x.copy()
        x += 1e-3 * (1.0 + np.abs(x).max(initial=0.0))  # it may have nothing to do now
        before = x.copy()
        self._call.begin_step_of(fix_id)
        moved = (x != before).any(axis=1)
        x[:] = original
        return moved

    def gravity(self, fix_id: str) -> np.ndarray | None:
        address = self._call.gravity(fix_id)
        return array(address, (3,), float) if address else None

    def ask_for(self, words: Sequence[str], *, energy: bool, virial: bool) -> None:
        self._words = len(words)
        self._bridge.words = " ".join(words).encode()
        self._bridge.counts_energy, self._bridge.counts_virial = energy, virial

    def values(self) -> list[np.ndarray]:
        address, values = self._bridge.values, []
        for size in array(self._bridge.sizes, (self._words,), np.int32).tolist():
            values.append(array(address, (size,) if size else (), float))
            address += 8 * max(1, size)
        return values

    def cut_cluster(self) -> int:
        return self._call.find_clusters()

    def set_bodies(self, body: np.ndarray | None, mass: np.ndarray | None) -> None:
        self._lent = body, mass
        self._bridge.body, self._bridge.masstotal = map(_address, self._lent)

    def lend_array(self, rows: np.ndarray) -> None:
        self._array, self._bridge.array = rows, _address(rows)

    def set_schedule(
        self, lists: dict | None, *, velocities_every: int = 0, table_every: int = 0
    ) -> None:
        self._bridge.velocities_every, self._bridge.table_every = velocities_every, table_every
        passes = {name: _passes(bound) for name, bound in (lists or {}).items()}
        tables = {name: _actions(name[len(AT) :], passes) for name in LISTS} if passes else {}
        self._kept = lists, passes, tables
        for name in LISTS:
            there = len(tables.get(name, ())) > 1
            setattr(self._bridge, name, _address(tables[name]) if there else None)

    @property
    def energy(self) -> float:
        return self._call.potential()

    @property
    def energy_step(self) -> int:
        return self._bridge.energy_step

    @energy_step.setter
    def energy_step(self, step: int) -> None:
        self._bridge.energy_step = step
        self._call.request_energy(step)

    def go_back(self) -> None:
        refuse(not self._call.go_back(), "LAMMPS has found an error where atoms go back to")

    def carry(self, lammps: Any, bodies: Any) -> None:
        """The class asks for it with an attribute ``carries``: how many numbers go with an atom."""
        self._carried, bridge = bodies, self._bridge
        bridge.arrays = lammps and _address(lammps.table)
        for name, cell in ("body_of", "body"), ("displace", "displace"), ("state", "state"):
            setattr(bridge, name, None if bodies is None else bodies.cells[cell].address)


def _passes(bound: Sequence[Any]) -> np.ndarray:
    """Bound loops as C++ has them, (n + 1, 2): their addresses and those of their arguments."""
    table = np.zeros((len(bound) + 1, 2), np.int64)
    for row, loop in zip(table, bound, strict=False):
        row[:] = loop.func.address, np.frombuffer(loop.args[0], np.int64).ctypes.data
    return table


def _actions(hook: str, passes: dict[str, np.ndarray]) -> np.ndarray:
    """The actions of a hook as C++ has them, (n + 1,), without those whose passes the run lacks."""
    actions = [entry for entry in SCHEDULE[hook] if entry[1].passes in (None, *passes)]
    table = np.zeros(len(actions) + 1, np.dtype(Action))
    for row, (number, action) in zip(table, actions, strict=False):
        row["phases"] = sum(1 << phase for phase in action.phases)
        row["passes"] = 0 if action.passes is None else passes[action.passes].ctypes.data
        row["number"] = number if action.call or action.passes else -1
        row["then"] = -1 if action.then is None else action.then
        for name in "when", "unless", "sets", "clears":
            row[name] = getattr(action, name)
    return table


def _address(array: np.ndarray | None) -> int | None:
    """The address of an array, or None."""
    return None if array is None else array.ctypes.data


def _as(kind: type, value: Any) -> Any:
    """A value of FixDescription as this kind."""
    return value.decode() if isinstance(value, bytes) else kind(value)
