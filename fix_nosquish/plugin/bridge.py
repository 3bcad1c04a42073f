"""The Python side of a fix of the plugin: makes the instance, and gives C++ its methods.

The fix passes the address of a `structs.Bridge` to `attach`, which sets a callback for each method
that the instance has.
"""

import atexit
import importlib
import os
import sys
import traceback
from collections.abc import Callable
from ctypes import (
    CFUNCTYPE,
    POINTER,
    PYFUNCTYPE,
    c_char_p,
    c_double,
    c_int64,
    c_void_p,
    py_object,
    pythonapi,
)
from typing import Any

import numpy as np

from .. import fix_of_style
from ..errors import RunError, refuse
from ..host.command import Line
from ..host.lammps import DAMAGED
from ..loops.compiled import array
from ..structs import CHECKSUM, HOOKS, Bridge, Outcome
from .host import LISTS, Host

RESULTS = {POINTER(c_int64): int, POINTER(c_double): float}  # the last argument of some hooks

new_capsule = PYFUNCTYPE(py_object, c_void_p, c_char_p, c_void_p)(("PyCapsule_New", pythonapi))


def failed(bridge: Bridge, problem: BaseException, line: Line | None = None) -> Outcome:
    """Store the message of an exception for LAMMPS, which names fixes as this fix line does; return
    how the run must end."""
    alike = isinstance(problem, RunError) and problem.everywhere
    text = line.naming(str(problem)) if line else str(problem)
    if not isinstance(problem, RunError):
        kind = type(problem)
        text = f"{kind.__name__}: {text}" if text else kind.__name__
        if sys.stderr and problem.__traceback__:
            trace = problem.__traceback__.tb_next  # without the frame of this file
            sys.stderr.write("".join(traceback.format_exception(kind, problem, trace)))
            sys.stderr.flush()
    argument = getattr(problem, "argument", None)
    bridge.argument = -1 if argument is None else argument
    bridge.message = (
        text.encode(errors="replace")[: Bridge.message.size - 1].decode(errors="ignore").encode()
    )
    return Outcome.FAILED_ALIKE if alike else Outcome.FAILED_HERE


# by the address of a bridge: bridge, instance and host, while the fix exists
_live: dict[int, tuple[Bridge, Any, Host]] = {}


def attach(address: int) -> None:
    """Make the `run.fix.Fix` for a new fix, and set its hooks. The plugin calls this."""
    bridge = Bridge.from_address(address)
    if bridge.checksum != CHECKSUM:
        print("fix_nosquish: the compiled plugin is of another version: reinstall", file=sys.stderr)
        return
    try:
        instance = _construct(bridge)
        instance.host = host = Host(bridge)
        if notice := instance.replacement_notice:
            host.log(notice)
        instance.define_bodies()
        instance.virial = array(bridge.virial, (6,), float)
        _announce(bridge, instance)
        for name, kind in HOOKS.items():
            setattr(bridge, name, kind.python(_hook(bridge, instance, name, kind.python)))
        bridge.release = _release
    except BaseException as problem:  # no exception may pass into C++
        bridge.outcome = failed(bridge, problem)
    else:
        _live[address] = bridge, instance, host
        bridge.outcome = Outcome.DONE


def _text(line: bytes) -> str:
    """The fix line, a word a line, as text.

    Raises:
        RunError: for letters beyond ASCII, which LAMMPS has damaged.
    """
    text = line.decode(errors="replace")
    shown = text.replace("\n", " ")
    refuse(
        DAMAGED in text,
        f"'{shown}' has letters beyond ASCII, and LAMMPS keeps only "
        "a part of them when it reads a script: use ASCII letters. A file with such a name "
        "can be given by a variable of the command line: lmp -var FILE name, and v_FILE",
    )
    return text


def _construct(bridge: Bridge) -> Any:
    """Make the instance that the fix line names."""
    style, *words = _text(bridge.line).split("\n")
    capsule = new_capsule(bridge.lammps, None, None)
    if style == "python/move":
        return _of_target("\n".join(words), capsule)
    line = Line.native(bridge.fix_id.decode(), bridge.group.decode(), style, words)
    return fix_of_style(style, words)(capsule, line)


def _of_target(target: str, capsule: object) -> Any:
    """Import the module of "module.class words", and make an instance of the class."""
    refuse(
        not target.strip(),
        'the text after python/move is empty: expected "fix_nosquish.NVE GROUP BODYSTYLE ..."',
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
            text = f"{target!r} has no dot: write fix_nosquish.{target.split()[1]}"
        first = name.split(" ")[0]
        if isinstance(getattr(module, first, None), type) and not hasattr(module, "__getattr__"):
            text += f". Have in it: __getattr__ = fix_nosquish.of_fix_line({first})"
        raise RunError(text, everywhere=True) from None
    instance = factory(capsule)
    missing = [name for name in HOOKS if not callable(getattr(instance, name, None))]
    refuse(
        missing,
        f"{target!r} is no integrator of fix_nosquish (it has no method {', '.join(missing[:1])}). "
        "The plugin's fix python/move drives only these: for other classes use LAMMPS's own, "
        "without the plugin",
    )
    return instance


def _announce(bridge: Bridge, instance: Any) -> None:
    """Tell LAMMPS what it must know when the fix is made, such as the size of its vector."""
    bridge.template_id = instance.template and instance.template.encode()
    numbers = "restart_file flips needs_energy couples carries box_every array_columns"
    for name in numbers.split():
        setattr(bridge, name, int(getattr(instance, name)))
    state, rows = instance.restart_state, instance.array_rows
    if state is not None:
        bridge.restart_size, bridge.restart_state = len(state), state.ctypes.data
    bridge.extensive = np.array(instance.vector_extensive, np.int32)
    bridge.vector_size = len(bridge.extensive)
    bridge.vector_extensive = bridge.extensive.ctypes.data
    bridge.array_rows = -1 if rows is None else rows


def _hook(bridge: Bridge, instance: Any, name: str, signature: Any) -> Callable[..., int]:
    """A callback that calls the method of that name, and passes no exception into C++.

    The method takes texts as `str`. Its result goes to the last argument of the callback, if that
    is an address for numbers.
    """
    result = RESULTS.get(signature._argtypes_[-1]) if signature._argtypes_ else None

    def call(*arguments: Any) -> int:
        *inputs, place = (*arguments, None) if result is None else arguments
        try:
            inputs = [os.fsdecode(text) if isinstance(text, bytes) else text for text in inputs]
            returned = getattr(instance, name)(*inputs)
            if result:
                for k, number in enumerate(returned if isinstance(returned, tuple) else [returned]):
                    place[k] = result(number)
        except BaseException as problem:
            return failed(bridge, problem, instance.line)
        return Outcome.DONE

    return call


@CFUNCTYPE(None, c_void_p)
def _release(address: int) -> None:
    """Release the instance, because the fix and the memory of the bridge end."""
    bridge, instance, host = _live.pop(address)
    instance.virial = instance.virial.copy()
    for name, kind in HOOKS.items():
        setattr(bridge, name, kind.python())  # the callbacks refer to the instance
    bridge.release = type(bridge.release)()
    for name in (*LISTS, "body", "masstotal", "array", "arrays", "body_of", "displace", "state"):
        setattr(bridge, name, None)
    bridge.phase = 0
    instance.let_go()  # a driver may still have it, and must not read freed memory
    vars(host).clear()  # it has addresses of the fix


@atexit.register
def _release_all() -> None:
    """Remove all callbacks, because LAMMPS may outlive this interpreter."""
    for address in list(_live):
        _release(address)
