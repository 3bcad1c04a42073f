"""Former names in users' classes, which work in this release, with a warning; and wrong ones."""

import weakref
from collections.abc import Callable
from difflib import get_close_matches
from typing import Any

from ..errors import RunError

# declarations, and what they are called now; methods have the argument `run` now
RENAMED = {
    "own_keywords": "extra_keywords",
    "own_parameters": "extra_parameters",
    "own_cells": "extra_cells",
    "own_lists": "extra_lists",
    "own_values": "extra_values",
    "own_warnings": "extra_warnings",
    "warnings": "extra_warnings",
    "crosses": "supports_remap_v",
    "complaint": "failure",
    "compute_scalar": "scalar",
    "write_restart": "prepare_restart",
    "turned_over": "bodies_changed",
}
# what methods could read of self, if it is called otherwise in `run`
OF_RUN = {
    "communicator": "ranks",
    "do": "run_passes",
    "made": "completed_bodies",
    "own_number": "number",
}
# what an integrator cannot have any more, and what to do instead
REMOVED = {
    "unprepared": "define failure(found, run), which returns the message",
    **dict.fromkeys(
        ("vector_extensive", "vector_names"), "declare `values` and define extra_values(run)"
    ),
    **dict.fromkeys(
        (
            *("init", "setup", "initial_integrate", "final_integrate", "post_neighbor", "post_run"),
            *("initial_integrate_respa", "final_integrate_respa", "end_of_step", "start_run"),
            *("end_run", "begin_trajectory", "take_energy", "resumed", "dof"),
            *("compute_vector", "compute_array"),
        ),
        "an integrator declares its step by letters and operations, and has no hooks of LAMMPS. "
        "Write an operation instead",
    ),
}


def take_over(cls: type) -> None:
    """Give a class that uses former names the new ones, and note them for the log.

    Raises:
        RunError: a declaration is misspelt, such as `keyword`, which nothing would read.
    """
    declared, users = vars(cls), cls.__module__.partition(".")[0] != __name__.partition(".")[0]
    inherited = [name for base in cls.__mro__[1:] for name in vars(base)]
    for name in declared.keys() - inherited if users else ():
        if (near := get_close_matches(name, inherited, 1, 0.9)) and name[0] != "_":
            raise RunError(
                f"class {cls.__name__} has {name}, which means nothing here. Did you mean "
                f"{near[0]}? If not, give it another name",
                everywhere=True,
            )
    former = sorted(declared.keys() & RENAMED.keys())
    for old in former:
        value = declared[old]
        setattr(cls, RENAMED[old], _with_run(value) if callable(value) else value)
    if former:
        cls.former_names = former  # type: ignore[attr-defined]
        cls.__getattr__ = _attribute_of_run  # type: ignore[attr-defined]


def refuse_removed(cls: type) -> None:
    """Raise an error if an integrator's class has what it cannot have any more."""
    for name in vars(cls).keys() & REMOVED.keys():
        raise RunError(f"class {cls.__name__} has {name}: {REMOVED[name]}", everywhere=True)


def _with_run(method: Callable) -> Callable:
    """A method with the argument run, from one without it that reads what run has of self."""

    def with_run(self: Any, *arguments: Any) -> Any:
        (run,) = (each for each in arguments if hasattr(each, "run_passes"))
        self._run = weakref.proxy(run)
        return method(self, *(each for each in arguments if each is not run))

    return with_run


def _attribute_of_run(self: Any, name: str) -> Any:
    if name == "_run":
        return None  # before the first run
    return getattr(self._run, OF_RUN.get(name, name))


def warnings(*classes: type) -> list[str]:
    """Lines for the log on former names that these classes use."""
    return [
        f"WARNING: class {cls.__name__} uses {old}, which is called {RENAMED[old]} now: the old "
        "name will go with the next release"
        for cls in classes
        for old in vars(cls).get("former_names", ())
    ]
