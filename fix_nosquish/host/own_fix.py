"""A LAMMPS's own fix python/move: it knows no setup, degrees of freedom, virial or migration."""

import ctypes
import sys
import traceback
import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..errors import RunError
from ..ranks.communicator import Alone, Communicator
from ..ranks.lookup import find, look_up
from ..ranks.migration import IN_NO_BODY, UNDECIDED
from ..ranks.sharing import places
from .hosts import Host
from .lammps import Lammps

EXTERNAL = "nosquish_virial"  # the fix external that carries the virial to such a LAMMPS
_callbacks: dict[int, Any] = {}  # LAMMPS's address -> what its fix external calls


class OwnFix(Host):
    """The host for LAMMPS's own fix python/move.

    Args:
        lammps: the `Lammps`.  communicator: the `Communicator` or `ALONE`.
    """

    fix_id = group = next_output = span = told = None
    forces_virial = set_box = flip_box = told_box = find_clusters = orient_atom = rate = None
    phase = facts = vflag = changes = pushes = stream_group = held = counts = dmax = 0
    begins = energy_step = rotor = -1
    calls_setup = follows = has_virial = scalar_pressure = False
    ghost_velocity = True  # not known: velocities at the half step may be read

    def __init__(self, lammps: Lammps, communicator: Communicator | Alone) -> None:
        self.lammps, self.communicator = lammps, communicator
        # it does not tell how many worlds come before: the universe's rank of this one's first rank
        self.world = communicator.share(lammps.setting("universe_rank"))
        self._problem: BaseException | None = None
        self._builds = 0.0
        lammps.cells["membership"].set(np.full(len(lammps.tags), UNDECIDED))
        self.carry(lammps, None)

    def log(self, text: str) -> None:
        """Write lines to screen and, outside of runs, to LAMMPS's log; collective."""
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
        """This LAMMPS takes nothing along with its atoms, so other ranks are asked."""
        self._bodies: Any = bodies
        self.noted()
        self._origins = np.full(len(self._tags), IN_NO_BODY)  # they were in other ones

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
        """Find where each atom was, and what is known of those that came; collective."""
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
        if self._problem:
            raise self._problem
        before, self._builds = self._builds, self.lammps.neighbor_builds
        return self._builds != before

    def begin_run(self, virial: Callable[[], np.ndarray]) -> None:
        """If there is a fix external for it, have it take the virial whenever forces are new."""
        self._builds = 0.0  # LAMMPS counts from zero in each run
        if not self.lammps.has("fix", EXTERNAL):
            return
        self.has_virial = True
        method = weakref.WeakMethod(virial)  # the fix external may outlive the integrator

        def report() -> None:
            try:
                found = method()
                self.lammps.set_external_virial(EXTERNAL, found() if found else np.zeros(6))
            except BaseException as error:
                self._problem = error  # LAMMPS cannot be told from here: the next hook raises it

        _callbacks[self.lammps.handle] = self.lammps.call_in_post_force(EXTERNAL, report)

    def end(self, error: BaseException) -> None:
        """Print the message once and end the run on all ranks; on one rank, come back."""
        if getattr(error, "said", False):
            return
        # not kept here: it holds all that it came through, this object among it
        vars(error)["said"] = True
        text, everywhere = str(error), getattr(error, "everywhere", False)
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
