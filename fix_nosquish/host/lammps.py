"""Access to LAMMPS: its arrays, box, units and variables.

The C library interface of the LAMMPS in this process is called by ctypes.  The Python module
`lammps` is not needed: it may be missing or of another version.
"""

import ctypes
from collections.abc import Callable
from ctypes import c_char_p, c_double, c_int, c_int64, c_void_p
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ..errors import RunError, refuse
from ..loops import compiled
from ..loops.compiled import L1, Cell, array, cells
from ..motion.periodic import invert
from ..structs import CELLS

_IMAGE_BITS = {4: 10, 8: 21}  # LAMMPS's imageint packs three counters into one integer
_EQUAL, _ATOM_STYLE, _STRING = 0, 1, 3  # styles of LAMMPS's variables
DAMAGED = "\ufffd"  # what decoding puts in place of a letter of which LAMMPS kept only a part
_STYLES = {_EQUAL: "an equal", _ATOM_STYLE: "an atom", _STRING: "a string"}


class _Kind(NamedTuple):
    """A kind of atoms that this fix cannot move correctly.

    Attributes:
        array: per-atom array of the atom styles that have such atoms, of this dtype, (natoms,) or
            (natoms, columns).
        what: the message: what they are, and what this fix does not advance.
        which: function from the array to a mask of these atoms; None for all.
    """

    array: str
    what: str
    which: Callable[[np.ndarray], np.ndarray] | None = None
    dtype: type = float
    columns: int = 0


_MISSING = "this fix does not advance"
_NO_ORIENTATION = (
    "whose orientation is not known for this LAMMPS: use one for which the plugin of this package "
    "can be compiled, and the atom style without a suffix"
)
_WITH_SHAPE = (
    *(
        _Kind(name, f"{what}, {_NO_ORIENTATION}", lambda index: index >= 0, np.int32)
        for name, what in (("ellipsoid", "an ellipsoid"), ("line", "a line"), ("tri", "a triangle"))
    ),
    _Kind("quat", f"a particle of atom style bpm/sphere, {_NO_ORIENTATION}", columns=4),
)
_UNKNOWN = (
    _Kind("body", f"a body particle, whose shape {_MISSING}", lambda body: body >= 0, np.int32),
    _Kind(
        "sp",
        f"a magnetic spin, whose precession {_MISSING}",
        lambda spin: spin[:, 3] > 0,
        columns=4,
    ),
    _Kind(
        "spin", f"an electron, whose radius {_MISSING}", lambda spin: np.abs(spin) == 1, np.int32
    ),
    _Kind(
        "rheo_status",
        f"a fluid particle of RHEO, whose density {_MISSING}; give it rheo/status 1 (solid)",
        lambda phase: phase & 1 == 0,
        np.int32,
    ),
)
# atom styles with extrapolated velocities `vest`, which only special integrators update, and
# another array of each style (tdpd has none; the forces of mdpd, which has rho, depend on v)
_EXTRAPOLATED = {
    "esph": f"an SPH particle, whose density and energy {_MISSING}; use fix rigid/meso",
    "edpd_temp": f"a DPD particle of atom style edpd, whose temperature {_MISSING}",
    "rho": "",
}
_TDPD = f"a DPD particle of atom style tdpd, whose concentrations {_MISSING}"

# the names of the cells for LAMMPS's arrays
ARRAYS = {name: getattr(compiled, kind) for name, kind in CELLS.items()}


def pointer(ptr: Any) -> int:
    """The address of LAMMPS from the argument of a class: a capsule, an integer or c_void_p."""
    if isinstance(ptr, int):
        return ptr
    if isinstance(ptr, c_void_p):
        return ptr.value or 0
    capsule = ctypes.pythonapi.PyCapsule_GetPointer
    capsule.restype, capsule.argtypes = c_void_p, [ctypes.py_object, c_char_p]
    return capsule(ptr, None)


def _library() -> ctypes.CDLL:
    lib = ctypes.CDLL(None)
    for name, result, arguments in (
        ("command", c_void_p, [c_void_p, c_char_p]),
        ("config_accelerator", c_int, [c_char_p, c_char_p, c_char_p]),
        ("extract_atom", c_void_p, [c_void_p, c_char_p]),
        ("extract_fix", c_void_p, [c_void_p, c_char_p, c_int, c_int, c_int, c_int]),
        ("extract_global", c_void_p, [c_void_p, c_char_p]),
        ("extract_setting", c_int, [c_void_p, c_char_p]),
        ("extract_variable", c_void_p, [c_void_p, c_char_p, c_char_p]),
        ("free", None, [c_void_p]),
        ("get_thermo", c_double, [c_void_p, c_char_p]),
        ("get_mpi_comm", c_int, [c_void_p]),
        ("has_id", c_int, [c_void_p, c_char_p, c_char_p]),
        ("id_name", c_int, [c_void_p, c_char_p, c_int, c_char_p, c_int]),
        ("is_running", c_int, [c_void_p]),
    ):
        function = getattr(lib, "lammps_" + name)
        function.restype, function.argtypes = result, arguments
    return lib


class Box:
    """The simulation box; compiled loops use `periodic.PeriodicBox`.

    Attributes:
        h, inverse: (3, 3) upper triangular matrix whose columns are the box vectors; its inverse.
        periodic: (3,) bool; wrap: the same as 0.0 and 1.0.
        lo: (3,) the origin.
        size: the largest component of a box vector.
        farthest: the largest coordinate of a corner.
    """

    def __init__(
        self, lo: np.ndarray, hi: np.ndarray, tilt: list[float], periodic: np.ndarray
    ) -> None:
        xy, yz, xz = tilt
        edge = hi - lo
        self.h = np.array([[edge[0], xy, xz], [0.0, edge[1], yz], [0.0, 0.0, edge[2]]])
        self.inverse = np.zeros((3, 3))
        invert(self.h, self.inverse)
        self.lo, self.periodic, self.wrap = lo, periodic, periodic.astype(float)
        self.size = np.abs(self.h).max()
        self.farthest = max(np.abs(lo).max(), np.abs(lo + self.h.sum(axis=1)).max())

    def lattice(self, vectors: np.ndarray) -> np.ndarray:
        """The integer coordinates, (n, 3), of the nearest lattice vectors (0 if not periodic)."""
        return np.rint(vectors @ self.inverse.T) * self.periodic


class Lammps:
    """One LAMMPS instance on this rank.

    Args:
        ptr: see `pointer`.
    Raises:
        RunError: on all ranks, if LAMMPS has no box, has 32-bit step numbers, or is too old.
    Attributes:
        handle: its address.
        step_cell: cell of the step number, for loops.
        ftm2v, mvv2e, boltz, nktv2p: unit conversions, and Boltzmann's constant.
        units: the unit style.
        tagint: type of atom IDs.
        table, cells: the cells for LAMMPS's arrays, `ARRAYS`; set by a `Host`.
    """

    def __init__(self, ptr: Any) -> None:
        self.handle = pointer(ptr)
        self.lib = _library()
        refuse(
            not self.setting("box_exist"),
            "the fix needs a simulation box: define it after read_data or create_box",
        )
        refuse(
            self.setting("bigint") != 8,
            "a LAMMPS of -DLAMMPS_SMALLSMALL counts steps in 32 bits: build it with "
            "-DLAMMPS_SMALLBIG, the default",
        )
        # their addresses do not change
        self._natoms = self._scalar("nlocal", c_int)
        self._dt = self._scalar("dt", c_double)
        self._step = self._scalar("ntimestep", c_int64)
        self._all_atoms = self._scalar("natoms", c_int64)
        self.step_cell = Cell(L1, array(self._global("ntimestep"), (1,), np.int64))
        self.ftm2v, self.mvv2e, self.boltz, self.nktv2p = (
            self._scalar(name, c_double).value for name in ("ftm2v", "mvv2e", "boltz", "nktv2p")
        )
        self.units = ctypes.string_at(self._global("units")).decode()
        integers, size = {4: np.int32, 8: np.int64}, self.setting("imageint")
        self.tagint = integers[self.setting("tagint")]
        self._imageint, self._image_bits = integers[size], _IMAGE_BITS[size]
        self.dimension = self.setting("dimension")
        self.ranks = self.setting("world_size")
        self._box_then = b""
        self._box: Box
        self.table, self.cells = cells(ARRAYS)

    def _global(self, name: str) -> int:
        address = self.lib.lammps_extract_global(self.handle, name.encode())
        refuse(not address, f"this LAMMPS does not give its {name}: it is too old for the fix")
        return address

    def _scalar(self, name: str, ctype: Any) -> Any:
        return ctype.from_address(self._global(name))

    def setting(self, name: str) -> int:
        """An integer of lammps_extract_setting()."""
        return self.lib.lammps_extract_setting(self.handle, name.encode())

    def has_precision(self, package: str, word: str) -> bool:
        """Whether an accelerator package was built in this precision: single, mixed or double."""
        return bool(
            self.lib.lammps_config_accelerator(package.encode(), b"precision", word.encode())
        )

    @property
    def dt(self) -> float:
        """The time step."""
        return self._dt.value

    @property
    def step(self) -> int:
        """The step number."""
        return self._step.value

    @property
    def natoms(self) -> int:
        """The number of atoms on all ranks."""
        return self._all_atoms.value

    @property
    def time(self) -> float:
        """The simulated time."""
        return self.lib.lammps_get_thermo(self.handle, b"time")

    @property
    def respa_dt(self) -> list[float]:
        """The time steps of the levels of run_style respa, innermost first; [] without respa."""
        levels = self.lib.lammps_extract_global(self.handle, b"respa_levels")
        count = c_int.from_address(levels).value if levels else 0
        return array(self._global("respa_dt"), (count,), float).tolist() if count else []

    @property
    def innermost_dt(self) -> float:
        """The time step with which bodies move."""
        levels = self.respa_dt
        return levels[0] if levels else self.dt

    @property
    def running(self) -> bool:
        """Whether a run or a minimization has begun."""
        return bool(self.lib.lammps_is_running(self.handle))

    @property
    def neighbor_builds(self) -> float:
        """How many times neighbor lists were built in this run."""
        return self.lib.lammps_get_thermo(self.handle, b"nbuild")

    @cached_property
    def _bounds(self) -> tuple[np.ndarray, ...]:
        """Views of LAMMPS's lo (3,), hi (3,), xy (1,), yz (1,), xz (1,) and periodicity (3,)."""
        sizes = {"boxlo": 3, "boxhi": 3, "xy": 1, "yz": 1, "xz": 1}
        bounds = [array(self._global(name), (size,), float) for name, size in sizes.items()]
        return *bounds, array(self._global("periodicity"), (3,), np.int32)

    @property
    def box(self) -> Box:
        """The current box; the same object as long as it does not change."""
        now = b"".join(bound.tobytes() for bound in self._bounds)
        if now != self._box_then:
            lo, hi, *tilts, periodic = self._bounds
            self._box_then = now
            shape = lo.copy(), hi.copy(), [tilt.item() for tilt in tilts]
            self._box = Box(*shape, periodic.astype(bool))
        return self._box

    def per_atom(self, name: str, dtype: type = float, columns: int = 0) -> np.ndarray | None:
        """A view of a per-atom array of this rank, (natoms,) or (natoms, columns); None if the atom
        style does not have it."""
        n = self._natoms.value
        shape = (n, columns) if columns else (n,)
        if n == 0:
            return np.empty(shape, dtype)
        address = self.lib.lammps_extract_atom(self.handle, name.encode())
        if not address:
            return None
        if columns:  # LAMMPS has pointers to the rows, which are contiguous
            address = c_void_p.from_address(address).value
        return array(address, shape, dtype)

    def _each_has(self, name: str, dtype: type = float, columns: int = 0) -> np.ndarray:
        """Same as `per_atom`, for an array that all atom styles have."""
        values = self.per_atom(name, dtype, columns)
        assert values is not None, name
        return values

    @property
    def x(self) -> np.ndarray:
        """Positions of the atoms, (natoms, 3)."""
        return self._each_has("x", columns=3)

    @property
    def v(self) -> np.ndarray:
        """Velocities of the atoms, (natoms, 3)."""
        return self._each_has("v", columns=3)

    @property
    def types(self) -> np.ndarray:
        """Types of the atoms, from 1, (natoms,)."""
        return self._each_has("type", np.int32)

    @property
    def tags(self) -> np.ndarray:
        """Atom IDs, (natoms,)."""
        return self._each_has("id", self.tagint)

    @property
    def masses(self) -> np.ndarray:
        """Mass of each atom, (natoms,)."""
        mass = self.per_atom("rmass")
        return self.type_masses[self.types] if mass is None else mass

    @property
    def type_masses(self) -> np.ndarray:
        """Mass of each atom type, from 1, for atom styles without per-atom masses."""
        address = self.lib.lammps_extract_atom(self.handle, b"mass")
        return array(address, (self.setting("ntypes") + 1,), float)

    @property
    def groups(self) -> np.ndarray:
        """Group bits of each atom, (natoms,)."""
        return self._each_has("mask", np.uint32)

    def images(self, atoms: np.ndarray) -> np.ndarray:
        """The image flags of these atoms, (m, 3)."""
        packed = self._each_has("image", self._imageint)[atoms].astype(np.int64)
        mask, half = (1 << self._image_bits) - 1, 1 << (self._image_bits - 1)
        return np.stack(
            [(packed >> (self._image_bits * k) & mask) - half for k in range(3)], axis=1
        )

    def image_difference(self, difference: np.ndarray) -> np.ndarray:
        """A difference of image flags, corrected for the overflow of their counters."""
        half = 1 << (self._image_bits - 1)
        return (difference + half) % (2 * half) - half

    @property
    def radius(self) -> np.ndarray | None:
        """Radii of the atoms, (natoms,), 0 for points; None if the atom style has none."""
        # from settings, because a rank without atoms must give the same answer
        flags = "radius_flag", "omega_flag", "torque_flag"
        return self.per_atom("radius") if all(self.setting(flag) > 0 for flag in flags) else None

    @property
    def orients(self) -> bool:
        """Whether the atom style has orientations."""
        names = b"ellipsoid", b"line", b"tri", b"mu", b"quat"
        return any(self.lib.lammps_extract_atom(self.handle, name) for name in names)

    def unknown(self, shapes: np.ndarray | None) -> np.ndarray | None:
        """Which atoms this fix cannot move correctly.

        Args:
            shapes: see `hosts.Host.shapes`.
        Returns:
            (natoms,) the message for each atom (see `_Kind.what`), '' for atoms that can be moved;
            None if the atom style has no such atoms.
        """
        reasons = {}
        for kind in (*(_WITH_SHAPE if shapes is None else ()), *_UNKNOWN):
            values = self.per_atom(kind.array, kind.dtype, kind.columns)
            if values is not None:
                reasons[kind.what] = kind.which(values) if kind.which else True
        if self.per_atom("vest", columns=3) is not None:
            styles = (
                what for name, what in _EXTRAPOLATED.items() if self.per_atom(name) is not None
            )
            if what := next(styles, _TDPD):
                reasons[what] = True
        which = [np.broadcast_to(atoms, self._natoms.value) for atoms in reasons.values()]
        return np.select(which, list(reasons), "") if reasons else None

    def has(self, category: str, name: str) -> bool:
        """Whether a group, variable, fix … of this ID is defined."""
        return bool(self.lib.lammps_has_id(self.handle, category.encode(), name.encode()))

    def group_bit(self, name: str) -> int:
        """The bit of a group in the mask of atoms.

        Raises:
            RunError: on all ranks, if there is no such group, or if it is dynamic.
        """
        refuse(
            self.has("fix", f"GROUP_{name}"),  # which LAMMPS defines for a dynamic group
            f"group '{name}' is dynamic, but the atoms of this fix do not change: use a static "
            f"group ('group {name} static' makes it one)",
        )
        buffer = ctypes.create_string_buffer(256)
        for bit in range(32):
            known = self.lib.lammps_id_name(self.handle, b"group", bit, buffer, 256)
            if known and buffer.value == name.encode():
                return 1 << bit
        raise RunError(f"there is no group {name}", everywhere=True)

    def variable(self, name: str, group: str) -> np.ndarray:
        """The values of an atom-style variable, (natoms,); collective."""
        address = self._evaluate(name, group, _ATOM_STYLE)
        values = array(address, (self._natoms.value,), float).copy()
        self.lib.lammps_free(address)
        return values

    def text(self, word: str) -> str:
        """A word of the fix line, or for v_NAME the value of the variable; collective.

        Raises:
            RunError: if there is no string-style variable of this name.
        """
        if word[:2] != "v_":
            return word
        place, name = self._evaluate(self._named(word), None, _STRING), word[2:]
        value = ctypes.string_at(place).decode(errors="replace")
        refuse(
            DAMAGED in value,
            f"the value '{value}' of variable {name} has letters beyond ASCII, and LAMMPS "
            "keeps only a part of them when it reads a script: use ASCII letters, or give the "
            f"value on the command line: lmp -var {name} VALUE",
        )
        return value

    def number(self, word: str) -> float:
        """A word of the fix line as a number, or for v_NAME the value of the variable; collective.

        Raises:
            RunError: if there is no equal-style variable of this name.
        """
        if word[:2] != "v_":
            return float(word)
        return self._read(self._evaluate(self._named(word), None, _EQUAL))

    def scalar_of_fix(self, fix_id: str) -> float:
        """The current value f_ID of a fix; collective."""
        place = self.lib.lammps_extract_fix(self.handle, fix_id.encode(), 0, 0, 0, 0)
        return self._read(place)

    def _read(self, place: int) -> float:
        """A number that LAMMPS has allocated, and free it."""
        value = c_double.from_address(place).value
        self.lib.lammps_free(place)
        return value

    def _named(self, word: str) -> str:
        """The name in v_NAME, if there is such a variable."""
        name = word[2:]
        refuse(
            not self.has("variable", name),
            f"there is no variable '{name}' ({word}): define it before the fix",
        )
        return name

    def _evaluate(self, name: str, group: str | None, style: int) -> int:
        """The address of a variable's value; collective."""
        style_of = getattr(
            self.lib, "lammps_extract_variable_datatype", None
        )  # in LAMMPS since 2022
        if style_of and style_of(c_void_p(self.handle), name.encode()) != style:
            kind = _STYLES[style]
            raise RunError(
                f"variable {name} is not {kind}-style variable: define it with "
                f"'variable {name} {kind.split()[1]} ...'",
                everywhere=True,
            )
        address = self.lib.lammps_extract_variable(
            self.handle, name.encode(), group and group.encode()
        )
        if not address:
            # an atom-style variable may fail on one rank only
            everywhere = style != _ATOM_STYLE
            raise RunError(f"variable {name} cannot be evaluated", everywhere=everywhere)
        return address

    @property
    def communicator(self) -> int:
        """Fortran handle of LAMMPS's communicator."""
        return self.lib.lammps_get_mpi_comm(self.handle)

    def print(self, text: str) -> None:
        """Write lines to screen and log with LAMMPS's command print; collective."""
        for line in text.splitlines():
            self.lib.lammps_command(self.handle, f'print "{line}"'.encode())
