"""LAMMPS's own fix python/move, which has no set-up, degrees of freedom, virial or migration.

It is available if LAMMPS was built with its package PYTHON.  It calls a `Driver`, which calls the
hooks of a fix in the same way as the plugin.
"""

import ctypes
import sys
import traceback
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

import numpy as np

from ..errors import RunError, refuse
from ..loops import machine_code
from ..ranks import mpi
from ..ranks.communicator import Communicator, Ranks
from ..ranks.lookup import find, look_up
from ..ranks.sharing import places
from ..structs import IN_NO_BODY, UNDECIDED, When
from .command import Line
from .hosts import Host, Phase
from .lammps import Lammps

# features that this host lacks, and what to use instead
MISSING = {
    "trajectories": "LAMMPS's own fix python/move gives no potential energy in the steps that need "
    "it, and computes no forces again: install this package where its plugin can be used, or use "
    "fix nosquish/nvt",
    "box": "LAMMPS's own fix python/move gives no virial and changes no box: install this package "
    "where its plugin can be used, or use fix nosquish/nvt or fix nosquish/nve",
    "end of the run": "keyword temp: TSTART and TSTOP must be the same, because LAMMPS's own fix "
    "python/move does not tell where a run ends",
    "levels": "run_style respa cannot be used with LAMMPS's own fix python/move: install this "
    "package where its plugin can be used, or use run_style verlet",
    "gravity": "keyword gravity cannot be used with LAMMPS's own fix python/move: remove 'disable' "
    "from fix gravity instead",
}


class OwnFix(Host):
    """The host for LAMMPS's own fix python/move.

    Args:
        lammps: the `Lammps`.  communicator: the `Communicator` or `ALONE`.  line: the fix line.
    """

    fix_id = group = next_output = span = external_sums = None
    forces_virial = set_box = flip_box = deformed_box = find_clusters = None
    orient_atom = rate = None
    phase = facts = vflag = changes = pushes = remap_group = held = counts = dmax = 0
    begins = energy_step = rotor = -1
    scalar_pressure = False
    ghost_velocity = True  # not known: velocities at the half step may be read

    def __init__(self, lammps: Lammps, communicator: Ranks, line: Line) -> None:
        self.lammps, self.communicator, self._line = lammps, communicator, line
        machine_code.load(communicator, mpi.__name__)
        # the world's number is not known: use the universe's rank of this world's first rank
        self.world = communicator.share(lammps.setting("universe_rank"))
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
            "  LAMMPS's own fix python/move reports no degrees of freedom. For temp to be right:",
            f"    compute_modify thermo_temp extra/dof {removed + self.lammps.dimension}",
            "  and no virial, so press lacks the forces that hold the bodies rigid: for pressures "
            "install this package where its plugin can be used",
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
            memberships = np.column_stack([np.zeros(left.sum(), np.int64), self._membership[left]])
            memberships = look_up(communicator, self._tags[left], memberships, tags[~stayed])
            membership[~stayed] = np.where(memberships[:, 0] == 0, memberships[:, 1], UNDECIDED)
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

    def end(self, error: BaseException) -> None:
        """Print the message and end the run on all ranks; with a single rank, return."""
        text, everywhere = self._line.naming(str(error)), getattr(error, "everywhere", False)
        several = self.communicator.size > 1
        if not isinstance(error, RunError):
            text = f"{type(error).__name__}: {text}"
            if several:  # on one rank LAMMPS prints it
                traceback.print_exception(error)
        if self.communicator.rank == 0 or not everywhere:
            where = f" on proc {self.communicator.rank}" if several and not everywhere else ""
            print(f"ERROR{where}: {text}", file=sys.stderr, flush=True)
        ctypes.CDLL(None).fflush(None)
        if everywhere:
            self.communicator.any(True)  # rank 0 has printed
        if isinstance(self.communicator, Communicator):
            self.communicator.abort()


def driven(make: Callable[[], Any], lammps: Lammps, communicator: Ranks, line: Line) -> Any:
    """The object that LAMMPS calls: the fix itself with the plugin, else its `Driver`.

    Args:
        make: creates the `fix.Fix`.
    """
    if "fix_nosquish.plugin.bridge" in sys.modules:
        return make()
    return Driver(make, OwnFix(lammps, communicator, line))


def _hook(method: Callable) -> Callable:
    """A method that LAMMPS calls; an exception in it ends the run on all ranks."""

    @wraps(method)
    def call(self: Any, *arguments: Any) -> None:
        try:
            method(self, *arguments)
        except BaseException as error:
            self.host.end(error)
            raise

    return call


class Driver:
    """Object that LAMMPS's own fix python/move calls.

    Args:
        make: creates the `fix.Fix`.  host: the `OwnFix`.
    """

    def __init__(self, make: Callable[[], Any], host: OwnFix) -> None:
        self.host = host
        self._define(make)

    @_hook
    def _define(self, make: Callable[[], Any]) -> None:
        self.fix = fix = make()
        fix.host = self.host
        try:
            fix.define_bodies()
            # LAMMPS accepts commands, and therefore text for its log, only between runs
            fix.report_definition()
        except BaseException:
            fix.host = None  # Python keeps the last traceback: no other fix may find this one
            raise

    @_hook
    def init(self) -> None:
        if self.host.lammps.respa_dt:
            self.host.need("levels")
        self._builds = 0.0  # LAMMPS counts from zero in each run
        self.fix.init()

    @_hook
    def initial_integrate(self, vflag: int) -> None:
        if self.host.phase == Phase.NEW:
            self.fix.push()
        self.fix.initial_integrate(vflag)

    @_hook
    def final_integrate(self) -> None:
        builds = self.host.lammps.neighbor_builds
        if builds != self._builds:
            self._builds = builds
            self.fix.post_neighbor()
        self.fix.push()
        self.fix.final_integrate()

    @_hook
    def reset_dt(self) -> None:
        self.fix.reset_dt()
