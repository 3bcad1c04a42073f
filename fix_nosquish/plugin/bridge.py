"""The Python side of the plugin's ``fix python/move``: makes the class, and lends its methods.

The fix holds a plain C struct, `Bridge`, and passes its address to `attach`, which fills in one C
callback for each method that the instance has.
"""

import atexit
import importlib
import os
import sys
import traceback
from ctypes import (
    CFUNCTYPE,
    PYFUNCTYPE,
    c_char_p,
    c_int32,
    c_void_p,
    memset,
    py_object,
    pythonapi,
)

from .. import of_style
from ..errors import RunError
from ..host.command import Line
from .host import LISTS, Host
from .structs import CHECKSUM, DONE, FAILED_ALIKE, FAILED_HERE, NEW, Bridge

REQUIRED = "initial_integrate", "final_integrate"
HOOKS = {
    name: kind
    for name, kind in Bridge._fields_
    if name
    in (
        *REQUIRED,
        *("init", "setup", "min_setup", "post_neighbor", "reset_dt", "end_of_step", "post_run"),
        *("initial_integrate_respa", "final_integrate_respa", "dof"),
        *("write_restart_file", "write_restart", "renewed", "modify_external", "push"),
        *("zero_momentum", "zero_rotation", "reset_target", "rows_of_rank"),
        *("compute_scalar", "compute_vector", "compute_array"),
    )
}
NUMBERS = {"dof": int, "compute_scalar": float, "compute_vector": float, "compute_array": float}
# in which virial_per_atom can be filled in
WITH_VIRIAL = "setup", "final_integrate", "renewed", "end_of_step"

new_capsule = PYFUNCTYPE(py_object, c_void_p, c_char_p, c_void_p)(("PyCapsule_New", pythonapi))


def failed(bridge, problem):
    """Leave the message of an exception for LAMMPS; return how the run must end."""
    alike = isinstance(problem, RunError) and problem.everywhere
    text = str(problem)
    if not isinstance(problem, RunError):
        kind = type(problem)
        text = f"{kind.__name__}: {text}" if text else kind.__name__
        if sys.stderr:
            trace = problem.__traceback__.tb_next  # from the class's own frame on
            sys.stderr.write("".join(traceback.format_exception(kind, problem, trace)))
            sys.stderr.flush()
    argument = getattr(problem, "argument", None)
    bridge.argument = -1 if argument is None else argument
    room = Bridge.message.size - 1
    bridge.message = text.encode(errors="replace")[:room].decode(errors="ignore").encode()
    return FAILED_ALIKE if alike else FAILED_HERE


_live = {}  # address of a bridge -> the bridge, its instance and host, while the fix exists


def attach(address):
    """Make the instance that a new fix names, and fill in its hooks. Called by the plugin."""
    bridge = Bridge.from_address(address)
    if bridge.checksum != CHECKSUM:
        print("fix_nosquish: the compiled plugin is of another version: reinstall", file=sys.stderr)
        return
    try:
        instance, host = _construct(bridge), None
        if hasattr(instance, "host"):
            instance.host = host = Host(bridge)
            if getattr(instance, "story", None):
                host.log(instance.story)
        if hasattr(instance, "virial"):
            import numpy

            bridge.wants_virial = 1
            instance.virial = numpy.ctypeslib.as_array(bridge.virial, shape=(6,))
        bridge.wants_virial_per_atom = hasattr(instance, "virial_per_atom")
        _announce(bridge, instance)
        for name, signature in HOOKS.items():
            if callable(getattr(instance, name, None)):
                setattr(bridge, name, signature(_hook(bridge, instance, name)))
        bridge.release = _release
    except BaseException as problem:  # no exception may pass into C++
        bridge.outcome = failed(bridge, problem)
    else:
        _live[address] = bridge, instance, host
        bridge.outcome = DONE


def _text(line):
    """The fix line, a word a line, as text.

    Raises:
        RunError: for letters of which LAMMPS has kept a part only.
    """
    try:
        return line.decode()
    except UnicodeDecodeError:
        said = line.decode(errors="replace").replace("\n", " ")
        raise RunError(
            f"'{said}' has letters beyond ASCII, and LAMMPS keeps only "
            "a part of them when it reads a script: use ASCII letters. A file with such a name "
            "can be given by a variable of the command line: lmp -var FILE name, and v_FILE",
            everywhere=True,
        ) from None


def _construct(bridge):
    """Make the instance that the fix line names."""
    style, *words = _text(bridge.line).split("\n")
    capsule = new_capsule(bridge.lammps, None, None)
    if style == "python/move":
        return _of_target("\n".join(words), capsule)
    line = Line.native(bridge.fix_id.decode(), bridge.group.decode(), style, words)
    return of_style(style, words)(capsule, line)


def _of_target(target, capsule):
    """Import, look up and call "module.class words", as LAMMPS's own fix python/move does."""
    if not target.strip():
        raise RunError(
            'the text behind python/move is empty: expected "fix_nosquish.NVE GROUP BODYSTYLE ..."',
            everywhere=True,
        )
    place, space, words = target.partition(" ")
    module_name, dot, name = place.rpartition(".")
    name += space + words
    if "." not in sys.path:
        sys.path.append(".")
    try:
        module = importlib.import_module(module_name if dot else "__main__")
    except ModuleNotFoundError as problem:
        if problem.name and f"{module_name}.".startswith(f"{problem.name}."):
            raise RunError(
                f"no Python module named {problem.name!r} for {target!r}: "
                f"it must be in the current folder or installed for {sys.executable}",
                everywhere=True,
            ) from None
        raise
    try:
        factory = getattr(module, name)
    except AttributeError as problem:
        text = f"cannot find {target!r}: {problem}"
        if target.startswith("fix_nosquish "):
            text = f"{target!r} has no point: write fix_nosquish.{target.split()[1]}"
        first = name.split(" ")[0]
        if isinstance(getattr(module, first, None), type) and not hasattr(module, "__getattr__"):
            text += f". Have in it: __getattr__ = fix_nosquish.of_fix_line({first})"
        raise RunError(text, everywhere=True) from None
    instance = factory(capsule)
    for method in REQUIRED:
        if not callable(getattr(instance, method, None)):
            raise RunError(f"{target!r} has no method {method}()", everywhere=True)
    return instance


def _announce(bridge, instance):
    """Note what LAMMPS must know of the instance from the start, such as its vector's size."""

    def has(method):
        return callable(getattr(instance, method, None))

    if has("write_restart_file"):
        bridge.writes_restart_file = bool(getattr(instance, "restart_file", False))
    template = getattr(instance, "template", None)
    bridge.template_id = template and template.encode()
    bridge.rigid = bool(getattr(instance, "rigid_flag", False))
    bridge.follows_atoms = bool(getattr(instance, "follows_atoms", False))
    bridge.carries = int(getattr(instance, "carries", 0))
    bridge.changes_box = int(getattr(instance, "box_every", 0))
    bridge.flips = bool(getattr(instance, "flips", False))
    bridge.needs_energy = bool(getattr(instance, "needs_energy", False))
    bridge.couples = bool(getattr(instance, "couples", False))
    state = getattr(instance, "restart_state", None)
    if state is not None:
        bridge.restart_size = len(state)
        bridge.restart_state = state.ctypes.data_as(type(bridge.restart_state))
    if has("compute_vector"):
        extensive = tuple(map(bool, instance.vector_extensive))
        bridge.vector_size = len(extensive)
        bridge.vector_extensive = (c_int32 * len(extensive))(*extensive)
    if has("compute_array"):
        rows = getattr(instance, "array_rows", None)
        bridge.array_rows = -1 if rows is None else int(rows)
        bridge.array_columns = int(instance.array_columns)


def _hook(bridge, instance, name):
    """A callback that calls the method of that name, and lets no exception into C++."""

    def call(*arguments):
        try:
            getattr(instance, name)(*arguments)
            return DONE
        except BaseException as problem:
            return failed(bridge, problem)

    def call_with_text(text):
        return call(os.fsdecode(text))

    def call_with_virial(*arguments):
        instance.virial_per_atom = _virial_per_atom(bridge)
        outcome = call(*arguments)
        instance.virial_per_atom = None
        return outcome

    def call_for_number(*arguments):
        *arguments, result = arguments
        try:
            result[0] = NUMBERS[name](getattr(instance, name)(*arguments))
            return DONE
        except BaseException as problem:
            return failed(bridge, problem)

    if name in NUMBERS:
        return call_for_number
    if name in ("write_restart_file", "modify_external"):
        return call_with_text
    return call_with_virial if bridge.wants_virial_per_atom and name in WITH_VIRIAL else call


def _virial_per_atom(bridge):
    """A view (natoms, 9) of the atoms' virial by the fix, zeroed; None if LAMMPS asks for none."""
    if bridge.natoms < 0:
        return None
    import numpy

    if bridge.natoms == 0:
        return numpy.empty((0, 9))
    return numpy.ctypeslib.as_array(bridge.virial_per_atom, shape=(bridge.natoms, 9))


@CFUNCTYPE(None, c_void_p)
def _release(address):
    """Let go of the instance: the fix goes away, and with it the memory of the bridge."""
    bridge, instance, host = _live.pop(address)
    if host:
        host._bridge = None
    if bridge.wants_virial:
        instance.virial = instance.virial.copy()
    for name, signature in HOOKS.items():
        setattr(bridge, name, signature())  # the callbacks hold the instance, which must go now
    if host:
        bridge.phase = NEW
    for name in (*LISTS, "body", "masstotal", "array", "arrays", "body_of", "displace", "state"):
        setattr(bridge, name, None)
    bridge.may_wait = False
    if hasattr(instance, "let_go"):  # what a driver still holds must not reach into freed memory
        instance.let_go()


@atexit.register
def _release_all():
    """Take back every callback: LAMMPS objects may outlive this interpreter."""
    for address in list(_live):
        _release(address)
        memset(address + Bridge.release.offset, 0, Bridge.release.size)
