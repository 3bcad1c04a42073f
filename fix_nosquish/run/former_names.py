"""Former names of what users' classes declare; they work for one release, with a warning."""

from collections.abc import Callable
from typing import Any

from ..errors import RunError
from .thermo import VALUES

ATTRIBUTES = {"own_keywords": "extra_keywords", "crosses": "supports_remap_v"}
# methods without an argument, which have `run` now
METHODS = {
    "own_parameters": "extra_parameters",
    "own_cells": "extra_cells",
    "own_values": "extra_values",
    "own_warnings": "extra_warnings",
    "warnings": "extra_warnings",
    "compute_scalar": "scalar",
    "write_restart": "prepare_restart",
    "turned_over": "bodies_changed",
}
# their arguments come after run, or before it
OTHERS = {"own_lists": "extra_lists", "complaint": "failure"}
# what a class could override until now
HOOKS = {
    *("init", "setup", "initial_integrate", "final_integrate", "post_neighbor", "post_run"),
    *("initial_integrate_respa", "final_integrate_respa", "end_of_step", "start_run", "end_run"),
    *("begin_trajectory", "take_energy", "resumed", "dof", "compute_vector", "compute_array"),
}


class Declared(type):
    """The class of integrators: what a derived class reads of its base by a former name."""

    def __getattr__(cls, name: str) -> Any:
        if name in ATTRIBUTES:
            return getattr(cls, ATTRIBUTES[name])
        if name == "vector_extensive":
            return *VALUES.values(), *getattr(cls, "values").values()  # noqa: B009
        if name == "vector_names":
            return *VALUES, *getattr(cls, "values")  # noqa: B009
        raise AttributeError(f"type object {cls.__name__!r} has no attribute {name!r}")


class Former:
    """Base class of classes that use former names: these, as attributes of their objects."""

    _run: Any = None

    def __getattr__(self, name: str) -> Any:
        if name in ("own_number", "do", "communicator", "made"):
            name = {"own_number": "number", "do": "run_passes", "communicator": "ranks"}.get(
                name, "completed_bodies"
            )
        new = METHODS.get(name) or OTHERS.get(name)
        if new:  # of super(), which is a class with the new names
            method = _inherited(type(self), new)
            if name == "complaint":
                return lambda found: method(self, found, self._run)
            return lambda *arguments: method(self, self._run, *arguments)
        if name[:1] != "_":
            return getattr(self._run, name)
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")


def take_over(cls: type) -> None:
    """Give a class that uses former names the new ones, and note them for the log.

    Raises:
        RunError: for hooks of LAMMPS, which a class cannot have any more.
    """
    own = vars(cls)
    hooks = HOOKS & own.keys()
    if hooks and not cls.__module__.startswith("fix_nosquish."):
        raise RunError(
            f"class {cls.__name__} has {min(hooks)}(): an integrator declares its step by letters "
            "and operations, and has no hooks of LAMMPS. Write an operation instead",
            everywhere=True,
        )
    found = own.keys() & {
        *ATTRIBUTES, *METHODS, *OTHERS, "unprepared", "couples", "vector_extensive", "vector_names",
    }  # fmt: skip
    if not found:
        return
    for old in found & ATTRIBUTES.keys():
        setattr(cls, ATTRIBUTES[old], own[old])
    for old in found & (METHODS.keys() | OTHERS.keys()):
        setattr(cls, METHODS.get(old) or OTHERS[old], _adapted(old))
    if "unprepared" in found:
        setattr(cls, "failure", lambda self, found, run: self.unprepared)  # noqa: B010
    flags = own.get("vector_extensive", ())[len(VALUES) :]
    if flags:
        names = own.get("vector_names", ())[len(VALUES) :]
        names = names or [f"value_{5 + k}" for k in range(len(flags))]
        setattr(cls, "values", dict(zip(names, flags, strict=True)))  # noqa: B010
    setattr(cls, "_former_names", {*getattr(cls, "_former_names", ()), *found})  # noqa: B010
    if not issubclass(cls, Former):
        cls.__bases__ = (*cls.__bases__, Former)


def _adapted(old: str) -> Callable:
    """A method with the arguments of the new name, that calls the one of the old name."""

    def method(self: Any, *arguments: Any) -> Any:
        runs = [one for one in arguments if not isinstance(one, (int, dict))]
        if runs:
            self._run = runs[0]
        return getattr(self, old)(*(one for one in arguments if isinstance(one, (int, dict))))

    method.__dict__["former"] = True
    return method


def _inherited(cls: type, name: str) -> Callable:
    """The first method of this name in a class that does not use its former name."""
    for one in cls.__mro__:
        method = vars(one).get(name)
        if method and not hasattr(method, "former"):
            return method
    raise AttributeError(name)


def warnings(*classes: type) -> list[str]:
    """Lines for the log on former names that these classes use."""
    renamed = {**ATTRIBUTES, **METHODS, **OTHERS, "unprepared": "failure", "couples": "scalar"}
    renamed |= dict.fromkeys(("vector_extensive", "vector_names"), "values")
    return [
        f"WARNING: class {cls.__name__} uses {old}, which is called {renamed[old]} now: the old "
        "name will go with the next release"
        for cls in classes
        for old in sorted(getattr(cls, "_former_names", ()))
    ]
