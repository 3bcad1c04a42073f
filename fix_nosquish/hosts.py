"""What calls the integrator: this package's plugin, or a LAMMPS's own fix python/move.

The plugin sets `host` to an object that answers what the integrator asks of its
surroundings.  LAMMPS's own fix knows nothing of that; `OwnFix` stands in for it.
"""

import ctypes
import sys
import traceback
import weakref
from functools import wraps

import numpy as np

from .errors import RunError
from .kernels import OF_BODY
from .lookup import describe, find
from .sharing import origin

EXTERNAL = "nosquish_virial"  # the fix external that carries the virial to such a LAMMPS
_callbacks = {}  # LAMMPS's address -> what its fix external calls


def driven_by_plugin():
    """Whether this package's plugin is there, which then is what makes and calls the integrator."""
    return f"{__package__}.plugin.bridge" in sys.modules


class OwnFix:
    """LAMMPS's own fix python/move: no setup, no degrees of freedom, no virial, no news of moved atoms.

    Args:
        lammps: the `Lammps`.  world: the `World` or `Alone`.
    """

    fix_id = group = None
    ghost_velocity = True  # not known: velocities at the half step may be read
    next_output = None  # not known
    creates_velocities = False  # of no use here: dof is not called
    waiting = False

    def __init__(self, lammps, world):
        self.lammps, self.world = lammps, world
        self.virial_fix = self._problem = self._said = None
        self._builds = 0.0

    def log(self, text):
        """Write lines to screen and, outside of runs, to LAMMPS's log; collective."""
        if not self.lammps.running:
            self.lammps.print(text)
        elif self.world.rank == 0:
            print(text, end="", flush=True)

    def fixes(self):
        """The other fixes; not known."""
        return []

    def set_bodies(self, body, mass):
        """Of no use here."""

    def set_array_rows(self, n):
        """Of no use here."""

    def go_alone(self, look_every, step, following):
        """This fix calls always."""

    def call_always(self):
        """This fix does."""

    def keep_box(self):
        """Of no use here."""

    def carry(self, lammps, bodies):
        """As the plugin's; this LAMMPS takes nothing along with its atoms, so other ranks are asked."""
        self._bodies = bodies

    def note(self):
        """As the plugin's: the atoms' IDs are kept."""
        index = self._bodies.index
        self._tags = self.lammps.tags.astype(np.int64)
        self._origins = np.full(len(self._tags), -1)
        self._origins[index] = origin(self.world.rank, np.arange(len(index)))

    def point(self, cells):
        """As the plugin's; collective."""
        for name, of in ("atom_x", "x"), ("atom_v", "v"), ("atom_f", "f"):
            cells[name].set(self.lammps.per_atom(of, columns=3))
        cells["groups"].set(self.lammps.groups.view(np.int32))
        origins, moved = self._find_origins()
        strangers = np.flatnonzero((origins >= 0) & (origins >> 32 != self.world.rank))
        arrived = (
            self.world.fetch(origins[strangers], self._rows) if moved else self._rows(strangers)
        )
        arrived[:, 0] = origins[strangers].view(float)
        origins[strangers] = -2 - np.arange(len(strangers))
        cells["origins"].set(origins)
        cells["arrived"].set(arrived)

    def _rows(self, places):
        bodies = self._bodies
        rows = np.empty((len(places), OF_BODY + len(bodies.state)))
        describe(places, bodies.body, bodies.d, bodies.state, rows)
        return rows

    def _find_origins(self):
        """Where each atom was, and whether any has come to or gone from any rank; collective."""
        world, tags = self.world, self.lammps.tags.astype(np.int64)
        before = find(self._tags, tags)
        stayed = before >= 0
        origins = (
            np.where(stayed, self._origins[before], -1)
            if len(self._tags)
            else np.full(len(tags), -1)
        )
        gone = self._origins >= 0
        gone[before[stayed]] = False
        moved = world.any(gone.any() or not stayed.all())
        if moved:
            origins[~stayed] = world.look_up(self._tags[gone], self._origins[gone], tags[~stayed])
        return origins, moved

    def atoms_moved(self):
        """Whether LAMMPS has re-neighboured since this was last asked."""
        if self._problem:
            raise self._problem
        before, self._builds = self._builds, self.lammps.neighbor_builds
        return self._builds != before

    def advice(self, removed):
        """The input lines with which this LAMMPS prints the right temperature and pressure."""
        return (
            "  this LAMMPS's own fix python/move cannot report degrees of freedom and virial. For a right temp:",
            f"    compute_modify thermo_temp extra/dof {removed + self.lammps.dimension}",
            "  and for a right press, after all other fixes:",
            f"    fix {EXTERNAL} all external pf/callback 1 1",
        )

    def begin_run(self, function):
        """If there is a fix for it, have function() -> virial (xx yy zz xy xz yz, of all ranks) called with new forces."""
        self._builds = 0.0  # LAMMPS counts from zero in each run
        if not self.lammps.has("fix", EXTERNAL):
            return
        self.virial_fix = EXTERNAL
        method = weakref.WeakMethod(function)  # the fix external may outlive the integrator

        def report():
            try:
                self.lammps.set_external_virial(EXTERNAL, method()() if method() else np.zeros(6))
            except (
                BaseException
            ) as error:  # LAMMPS cannot be told from here: the next hook raises it
                self._problem = error

        _callbacks[self.lammps.handle] = self.lammps.call_in_post_force(EXTERNAL, report)

    def end(self, error):
        """Print the message once and end the run on all ranks; on one rank, come back."""
        if self._said is error:
            return
        self._said = error
        text, everywhere = str(error), getattr(error, "everywhere", False)
        if not isinstance(error, RunError):
            text = f"{type(error).__name__}: {text}"
            if self.world.size > 1:  # on one rank LAMMPS prints it
                traceback.print_exception(error)
        if self.world.rank == 0 or not everywhere:
            where = "" if everywhere or self.world.size == 1 else f" on proc {self.world.rank}"
            print(f"ERROR{where}: {text}", file=sys.stderr)
        sys.stderr.flush()
        ctypes.CDLL(None).fflush(None)
        if everywhere:
            self.world.any(True)  # rank 0 has printed
        if self.world.size > 1:
            self.world.abort()


def hook(method):
    """A method that LAMMPS calls: an exception in it ends the run on all ranks."""

    @wraps(method)
    def guarded(self, *arguments):
        try:
            return method(self, *arguments)
        except BaseException as error:
            if isinstance(self.host, OwnFix):
                self.host.end(error)
            raise

    return guarded
