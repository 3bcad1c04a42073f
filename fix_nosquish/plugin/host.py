"""The `hosts.Host` of a class that the plugin drives."""

from collections.abc import Callable, Sequence
from ctypes import byref, c_void_p, cast
from typing import Any

import numpy as np
from numpy.ctypeslib import as_array

from ..errors import RunError
from ..host.hosts import OtherFix
from ..loops.compiled import array
from ..run.schedule import ACTIONS, SCHEDULE
from ..structs import Action, Bridge, FixFacts

AT = "at_"  # what the fields of lists of actions begin with, behind which the hook's name follows
LISTS = tuple(name for name, _ in Bridge._fields_ if name.startswith(AT))


def _shared(name: str, kind: Callable[[Any], Any]) -> property:
    """An attribute in the memory that C++ shares."""

    def get(self: "Host") -> Any:
        return kind(getattr(self._bridge, name))

    def put(self: "Host", value: int) -> None:
        setattr(self._bridge, name, value)

    return property(get, put)


def _asked(name: str) -> property:
    """An attribute that a function of the fix tells."""
    return property(lambda self: bool(getattr(self._bridge, name)(self._bridge.fix)))


class Host:
    """The fix as its class sees it; set as ``host`` on an instance that has this attribute."""

    calls_setup = follows = True
    has_virial = False  # not known early
    phase, facts = _shared("phase", int), _shared("facts", int)
    vflag, changes = _shared("vflag", int), _shared("changes", int)
    rotor = _shared("rotor", int)
    changes_box, held = _shared("changes_box", int), _shared("held", int)
    counts = _shared("counts", int)
    begins = _shared("begins", int)
    stream_group = _shared("stream_group", int)
    pushes = _shared("pushes", int)
    ghost_velocity = _asked("ghost_velocity")
    scalar_pressure = _asked("scalar_pressure")

    def __init__(self, bridge: Bridge):
        self.fix_id = bridge.fix_id.decode()
        self.group = bridge.group.decode(errors="replace")
        self._bridge = bridge
        self._next_output = bridge.next_output.contents
        self._last_step = bridge.last_step.contents
        self.forces_virial = as_array(bridge.forces_virial, (6,))
        self.told_box = as_array(bridge.told_box, (9,))
        self.told, self._words = as_array(bridge.told, (7,)), 0
        self.rate = as_array(bridge.rate, (6,))
        self.set_box, self.flip_box, self.find_clusters, self.stop, self.orient_atom = (
            np.array([cast(function, c_void_p).value, bridge.fix or 0])
            for function in (
                *(bridge.set_box, bridge.flip_box, bridge.find_clusters),
                *(bridge.stop, bridge.orient),
            )
        )
        self.span = tuple(as_array(step, (1,)) for step in (bridge.begin_step, bridge.end_step))
        self._keep, self._point = (
            bridge.keep,
            bridge.point,
        )  # ctypes makes a function at each access

    def log(self, text: str) -> None:
        self._bridge.log(self._bridge.fix, text.encode())

    def fixes(self) -> list[OtherFix]:
        facts, found, n = FixFacts(), [], 0
        while self._bridge.nth_fix(self._bridge.fix, n, byref(facts)):
            if facts.id is not None:  # not this fix itself
                values = [getattr(facts, name) for name in OtherFix._fields]
                kinds = OtherFix.__annotations__.values()
                words = [v.decode() if isinstance(v, bytes) else v for v in values]
                found.append(OtherFix(*[kind(v) for kind, v in zip(kinds, words, strict=True)]))
            n += 1
        return found

    @property
    def command(self) -> list[str]:
        return self._bridge.command(self._bridge.fix).decode(errors="replace").split()

    @property
    def next_output(self) -> int:
        return self._next_output.value

    @property
    def last_step(self) -> int:
        return self._last_step.value

    def shapes(self, natoms: int) -> np.ndarray | None:
        numbers = np.zeros((natoms, 7))
        known = self._bridge.particles(self._bridge.fix, _as("virial", numbers.ctypes.data))
        return numbers if known else None

    def inserted(self) -> np.ndarray:
        ask, fix = self._bridge.inserted, self._bridge.fix
        numbers = np.empty((ask(fix, None), 10))
        if len(numbers):
            ask(fix, _as("virial", numbers.ctypes.data))
        return numbers

    def molecule(self, number: int) -> np.ndarray | None:
        numbers = np.empty(13)
        known = self._bridge.molecule(self._bridge.fix, number, _as("virial", numbers.ctypes.data))
        return numbers if known else None

    def removed_freedom(self, fix_id: str, group: str) -> int:
        return self._bridge.removed_freedom(self._bridge.fix, fix_id.encode(), group.encode())

    def varies(self, fix_id: str) -> bool:
        return bool(self._bridge.varies(self._bridge.fix, fix_id.encode()))

    def moved_by(self, fix_id: str, x: np.ndarray) -> np.ndarray:
        kept = x.copy()
        x += 1e-3 * (1.0 + np.abs(x).max(initial=0.0))  # it may have nothing to do now
        before = x.copy()
        self._bridge.begin_step_of(self._bridge.fix, fix_id.encode())
        moved = (x != before).any(axis=1)
        x[:] = kept
        return moved

    def pair_style(self, first: str) -> bool:
        return bool(self._bridge.pair_style(self._bridge.fix, first.encode()))

    def gravity(self, fix_id: str) -> np.ndarray | None:
        address = self._bridge.gravity(self._bridge.fix, fix_id.encode())
        return array(address, (3,), float) if address else None

    def ask_for(self, words: Sequence[str], *, energy: bool, virial: bool) -> None:
        self._words = len(words)
        self._bridge.words = " ".join(words).encode()
        self._bridge.tells_energy, self._bridge.tells_virial = energy, virial

    def values(self) -> list[np.ndarray]:
        address, found = cast(self._bridge.values, c_void_p).value, []
        for count in self._bridge.sizes[: self._words]:
            found.append(array(address, (count,) if count else (), float))
            address += 8 * max(1, count)
        return found

    def advice(self, removed: int) -> Sequence[str]:
        return ()

    def begin_run(self, virial: Callable[[], np.ndarray]) -> None:
        """Of no use here, as the next ones."""

    noted = end = lambda self, *_: None

    def atoms_moved(self) -> bool:
        return False  # there is a hook for it

    def cut_cluster(self) -> int:
        return self._bridge.find_clusters(self._bridge.fix)

    def set_bodies(self, body: np.ndarray | None, mass: np.ndarray | None) -> None:
        self._lent = body, mass
        for name, lent in ("body", body), ("masstotal", mass):
            place = None if lent is None else _as(name, lent.ctypes.data)
            setattr(self._bridge, name, place)

    def lend_array(self, rows: np.ndarray) -> None:
        self._array = rows
        self._bridge.array = _as("array", rows.ctypes.data)

    def set_array_rows(self, n: int) -> None:
        self._bridge.set_array_rows(self._bridge.fix, int(n))

    def now(self) -> int:
        return self._bridge.now(self._bridge.fix)

    def follow_schedule(
        self, lists: dict | None, *, velocities_every: int, table_every: int
    ) -> None:
        self._bridge.velocities_every, self._bridge.table_every = velocities_every, table_every
        if lists is not None:
            passes = {name: _passes(some) for name, some in lists.items()}
            tables = {name: _actions(name[len(AT) :], passes) for name in LISTS}
            self._kept: tuple | None = lists, passes, tables
            for name, table in tables.items():
                place = _as(name, table.ctypes.data) if len(table) > 1 else None
                setattr(self._bridge, name, place)

    def follow_no_schedule(self) -> None:
        for name in LISTS:
            setattr(self._bridge, name, None)
        self._kept = None

    @property
    def energy(self) -> float:
        return self._bridge.potential(self._bridge.fix)

    @property
    def energy_step(self) -> int:
        return self._bridge.energy_step

    @energy_step.setter
    def energy_step(self, step: int) -> None:
        self._bridge.energy_step = step
        self._bridge.ask_for_energy(self._bridge.fix, step)

    def go_back(self) -> None:
        if self._bridge.go_back(self._bridge.fix):
            raise RunError("LAMMPS has found an error where atoms go back to", everywhere=True)

    def keep_box(self) -> None:
        self._keep(self._bridge.fix)

    def carry(self, lammps: Any, bodies: Any) -> None:
        """The class asks for it with an attribute ``carries``: how many numbers go with an atom."""
        self._carried, bridge = bodies, self._bridge
        bridge.arrays = lammps and _as("arrays", lammps.table.ctypes.data)
        for name, cell in ("body_of", "body"), ("displace", "displace"), ("state", "state"):
            place = None if bodies is None else bodies.cells[cell].address
            setattr(bridge, name, place and _as(name, place))

    def point(self) -> None:
        self._point(self._bridge.fix)


def _passes(bound: Sequence[Any]) -> np.ndarray:
    """Bound loops as C++ has them, (n + 1, 2): their addresses and those of their arguments."""
    table = np.zeros((len(bound) + 1, 2), np.int64)
    for row, one in zip(table, bound, strict=False):
        row[:] = one.func.address, np.frombuffer(one.args[0], np.int64).ctypes.data
    return table


def _actions(hook: str, passes: dict[str, np.ndarray]) -> np.ndarray:
    """The actions of a hook as C++ has them, (n + 1,), but those whose passes the run has not."""
    some = [one for one in SCHEDULE[hook] if one.passes is None or one.passes in passes]
    table = np.zeros(len(some) + 1, np.dtype(Action))
    for row, one in zip(table, some, strict=False):
        row["phases"] = sum(1 << phase for phase in one.phases)
        row["passes"] = 0 if one.passes is None else passes[one.passes].ctypes.data
        row["number"] = ACTIONS.index(one) if one.call or one.passes else -1
        row["then"] = -1 if one.then is None else one.then
        for name in "when", "unless", "sets", "clears":
            row[name] = getattr(one, name)
    return table


def _as(name: str, place: int) -> Any:
    """An address as the field of this name takes it."""
    return cast(place, dict(Bridge._fields_)[name])
