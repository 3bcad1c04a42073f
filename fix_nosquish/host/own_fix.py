"""LAMMPS's own fix python/move, which has no set-up, degrees of freedom, virial or migration.

It is available if LAMMPS was built with its package PYTHON.  It calls a `Driver`, which calls the
hooks of a fix in the same way as the plugin.
"""

import ctypes
import sys
import traceback
import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import RunError, refuse
from ..loops import machine_code
from ..ranks import mpi
from ..ranks.communicator import Alone, Communicator
from ..ranks.lookup import find, look_up
from ..ranks.migration import IN_NO_BODY, UNDECIDED
from ..ranks.sharing import places
from ..structs import When
from .command import Line
from .hosts import Host, Phase
from .lammps import Lammps

EXTERNAL = "nosquish_virial"  # ID of the fix external that passes the virial to such a LAMMPS
_callbacks: dict[int, Any] = {}  # LAMMPS's address -> callback of its fix external
# features that this host lacks, and what to use instead
MISSING = {
    "trajectories": "LAMMPS's own fix python/move gives no potential energy in the steps that need "
    "it, and computes no forces again: install this package where its plugin can be used, or use "
    "fix nosquish/nvt",
    "box": "LAMMPS's own fix python/move gives no virial and changes no box: install this package "
    "where its plugin can be used, or use fix nosquish/nvt or fix nosquish/nve",
    "end of the run": "keyword temp: TSTART and TSTOP must be the same, because LAMMPS's own fix "
    "python/move does not tell where a run ends",
    "end of a step": "keyword output cannot be used with run_style respa and LAMMPS's own fix "
    "python/move, which knows no end of a step: install this package where its plugin can be used",
    "gravity": "keyword gravity cannot be used with LAMMPS's own fix python/move: remove 'disable' "
    "from fix gravity instead",
}


class OwnFix(Host):
    """The host for LAMMPS's own fix python/move.

    Args:
        lammps: the `Lammps`.  communicator: the `Communicator` or `ALONE`.  line: the fix line.
    """

    fix_id = group = next_output = span = told = None
    forces_virial = set_box = flip_box = deformed_box = find_clusters = None
    orient_atom = rate = None
    phase = facts = vflag = changes = pushes = remap_group = held = counts = dmax = 0
    begins = energy_step = rotor = -1
    scalar_pressure = False
    ghost_velocity = True  # not known: velocities at the half step may be read

    def __init__(self, lammps: Lammps, communicator: Communicator | Alone, line: Line) -> None:
        self.lammps, self.communicator, self._line = lammps, communicator, line
        machine_code.load(communicator, mpi.__name__)
        # the world's number is not known: use the universe's rank of this world's first rank
        self.world = communicator.share(lammps.setting("universe_rank"))
        self._problem: BaseException | None = None
        self._builds = 0.0
        lammps.cells["membership"].set(np.full(len(lammps.tags), UNDECIDED))
        self.carry(lammps, None)

    def need(self, feature: str) -> None:
        raise RunError(MISSING[feature], everywhere=True)

    def now(self) -> int:
        # LAMMPS may read everything in any step; at the start the first step is counted already
        return self.facts | When.SHOWN | (When.TABLE if self.phase != Phase.NEW else 0)

    def previous(self, bodies: Any, lammps: Any) -> Any:
        return bodies.as_previous(lammps, followed=False)

    def refuse_changes(self, membership: Any) -> None:
        changes = membership.changes()
        refuse(
            changes,
            f"atoms have changed since this fix was defined ({changes}), or got other IDs, which "
            "LAMMPS's own fix python/move cannot tell apart: unfix this fix and define it again",
        )

    def log(self, text: str) -> None:
        """Write lines to the screen and, between runs, to LAMMPS's log; collective."""
        if not self.lammps.running:
            self.lammps.print(text)
        elif self.communicator.rank == 0:
            print(text, end="", flush=True)

    def advice(self, removed: int) -> Sequence[str]:
        return (
            "  this LAMMPS's own fix python/move cannot report degrees of freedom and virial. "
            "For temp to be right:",
            f"    compute_modify thermo_temp extra/dof {removed + self.lammps.dimension}",
            "  and for press to be right, after all other fixes:",
            f"    fix {EXTERNAL} all external pf/callback 1 1",
        )

    def carry(self, lammps: Any, bodies: Any) -> None:
        """Keep the bodies: this LAMMPS migrates no data with atoms, so other ranks are asked."""
        self._bodies: Any = bodies
        self.noted()
        self._origins = np.full(len(self._tags), IN_NO_BODY)  # of other bodies before

    def point(self) -> None:
        lammps = self.lammps
        cells, empty = lammps.cells, np.empty(0)
        for name in ("x", "v", "f", "torque", "omega", "angmom", "mu"):
            values = lammps.per_atom(name, columns=4 if name == "mu" else 3)
            if values is not None:
                cells[f"atom_{name}"].set(values)
        mass = lammps.per_atom("rmass")
        cells["atom_mass"].set(empty if mass is None else mass)
        cells["type_mass"].set(empty if mass is not None else lammps.type_masses)
        cells["type"].set(lammps.types)
        cells["atom_virial"].set(np.empty((0, 9)))
        cells["groups"].set(lammps.groups.view(np.int32))
        self._find_origins()

    def noted(self) -> None:
        self._tags = self.lammps.tags.astype(np.int64)
        self._origins, self._membership = (
            self.lammps.cells[name].array for name in ("origins", "membership")
        )

    def _find_origins(self) -> None:
        """Find the origin of each atom, and the data of atoms that arrived; collective."""
        communicator, tags = self.communicator, self.lammps.tags.astype(np.int64)
        before = find(self._tags, tags)
        stayed = before >= 0
        origins, membership = np.full(len(tags), IN_NO_BODY), np.full(len(tags), UNDECIDED)
        origins[stayed] = self._origins[before[stayed]]
        membership[stayed] = self._membership[before[stayed]]
        left = np.ones(len(self._tags), bool)
        left[before[stayed]] = False
        if communicator.any(left.any() or not stayed.all()):
            told = np.column_stack([np.zeros(left.sum(), np.int64), self._membership[left]])
            told = look_up(communicator, self._tags[left], told, tags[~stayed])
            membership[~stayed] = np.where(told[:, 0] == 0, told[:, 1], UNDECIDED)
        self.lammps.cells["membership"].set(membership)
        self.lammps.cells["origins"].set(origins)
        if self._bodies is None:
            return
        gone = left & (self._origins >= 0)
        came = self._bodies.rows_of_atoms(places(self._origins[gone])).view(np.int64)
        came[:, 0] = self._origins[gone]
        moved = communicator.any(gone.any() or not stayed.all())
        came = look_up(communicator, self._tags[gone], came, tags[~stayed]) if moved else came
        known = came[:, 0] != IN_NO_BODY
        origins[np.flatnonzero(~stayed)[known]] = -2 - np.arange(known.sum())
        self.lammps.cells["arrived"].set(came[known].view(float))

    def atoms_moved(self) -> bool:
        """Whether LAMMPS has re-neighbored since the last call."""
        if self._problem:
            raise self._problem
        before, self._builds = self._builds, self.lammps.neighbor_builds
        return self._builds != before

    def count_virial(self, virial: Callable[[], np.ndarray]) -> None:
        """If there is a fix external for the virial, have it read the virial whenever forces are
        new."""
        self._builds = 0.0  # LAMMPS counts from zero in each run
        if not self.lammps.has("fix", EXTERNAL):
            return
        method = weakref.WeakMethod(virial)  # the fix external may outlive the driver

        def report() -> None:
            try:
                found = method()
                self.lammps.set_external_virial(EXTERNAL, found() if found else np.zeros(6))
            except BaseException as error:
                self._problem = error  # cannot be raised from a callback: the next hook raises it

        _callbacks[self.lammps.handle] = self.lammps.call_in_post_force(EXTERNAL, report)

    def end(self, error: BaseException) -> None:
        """Print the message once and end the run on all ranks; with a single rank, return."""
        if getattr(error, "printed", False):
            return
        # not stored: its traceback refers to this object, too
        vars(error)["printed"] = True
        text, everywhere = self._line.naming(str(error)), getattr(error, "everywhere", False)
        several = self.communicator.size > 1
        if not isinstance(error, RunError):
            text = f"{type(error).__name__}: {text}"
            if several:  # on one rank LAMMPS prints it
                traceback.print_exception(error)
        if self.communicator.rank == 0 or not everywhere:
            where = f" on proc {self.communicator.rank}" if several and not everywhere else ""
            print(f"ERROR{where}: {text}", file=sys.stderr)
        sys.stderr.flush()
        ctypes.CDLL(None).fflush(None)
        if everywhere:
            self.communicator.any(True)  # rank 0 has printed
        if isinstance(self.communicator, Communicator):
            self.communicator.abort()


_drivers: "weakref.WeakSet[Driver]" = weakref.WeakSet()


def driven(
    make: Callable[[], Any], lammps: Lammps, communicator: Communicator | Alone, line: Line
) -> Any:
    """The object that LAMMPS calls: the fix itself with the plugin, else its `Driver`.

    Args:
        make: creates the `fix.Fix`.
    """
    if "fix_nosquish.plugin.bridge" in sys.modules:
        return make()
    return Driver(make, OwnFix(lammps, communicator, line))


class Driver:
    """Object that LAMMPS's own fix python/move calls; an exception in it ends the run on all ranks.

    Args:
        make: creates the `fix.Fix`.  host: the `OwnFix`.
    """

    def __init__(self, make: Callable[[], Any], host: OwnFix) -> None:
        self._host = host
        self.fix = self._guarded(make)
        self.fix.host = host
        try:
            self._guarded(self.fix.define_bodies)
            # LAMMPS accepts commands, and therefore text for its log, only between runs
            self._guarded(self.fix.report_definition)
        except BaseException:
            self.fix.host = None  # Python keeps the last traceback: no other fix may find this one
            raise
        _drivers.add(self)

    def _guarded(self, function: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return function(*arguments)
        except BaseException as error:
            self._host.end(error)
            raise

    def init(self) -> None:
        self._guarded(self.fix.init)
        self._host.count_virial(self._virial_of_all)

    def initial_integrate(self, vflag: int) -> None:
        self._guarded(self._begin, vflag)

    def _begin(self, vflag: int) -> None:
        if self._host.phase == Phase.NEW:
            self.fix.push()
        self.fix.initial_integrate(vflag)

    def final_integrate(self) -> None:
        self._guarded(self._end)

    def _end(self) -> None:
        self._follow_atoms()
        self.fix.push()
        self.fix.final_integrate()

    def initial_integrate_respa(self, vflag: int, level: int, loop: int) -> None:
        self._guarded(self._begin_level, vflag, level, loop)

    def _begin_level(self, vflag: int, level: int, loop: int) -> None:
        if self._host.phase == Phase.NEW:
            self.fix.push()
        elif not self.fix.run.is_outermost(level):
            self._follow_atoms()
        self.fix.initial_integrate_respa(vflag, level, loop)

    def final_integrate_respa(self, level: int, loop: int) -> None:
        self._guarded(self._end_level, level, loop)

    def _end_level(self, level: int, loop: int) -> None:
        self._follow_atoms()
        self.fix.final_integrate_respa(level, loop)

    def reset_dt(self) -> None:
        self._guarded(self.fix.reset_dt)

    def _follow_atoms(self) -> None:
        if self._host.atoms_moved():
            self.fix.post_neighbor()

    def _virial_of_all(self) -> np.ndarray:
        """The virial of all bodies, summed over ranks, after LAMMPS's forces and before
        final_integrate."""
        virial, handle = np.zeros(6), self._host.lammps.handle
        drivers = [one for one in _drivers if one._host.lammps.handle == handle]
        for driver in sorted(drivers, key=lambda one: one.fix.number):
            driver._guarded(driver._add_virial, virial)
        return self._host.communicator.total(virial)

    def _add_virial(self, virial: np.ndarray) -> None:
        host = self._host
        begun = host.phase == Phase.HALF
        if begun and not host.vflag:
            return
        if host.atoms_moved() or not begun:
            self.fix.post_neighbor()
        host.lammps.cells["virial"].set(virial)
        host.lammps.cells["atom_virial"].set(np.empty((0, 9)))
        self.fix.run.count_virial(ends=begun)
