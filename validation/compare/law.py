"""The error of a mean at a time step, from runs with this step and longer ones."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy import special

from ..statistics import measures
from ..statistics.estimate import CONFIDENCE, Estimate, margin

# even powers of the step in errors of means.  Each above the square is noise of this standard
# deviation at the longest step, in largest errors seen.  So a step near the end of stability, where
# all powers count, tells little of shorter ones
POWERS, HIGHER = 4, 4.0
LEAST = 0.02  # of an error, its standard error by what is still higher
NONE = Estimate(0.0)


def by_law(
    dt: float, found: Mapping[float, Estimate], held: Estimate = NONE, finer: float = 0.0
) -> Estimate | None:
    """An error that grows as a series in the square of the time step: from the run with this step,
    and from those with longer ones.

    The errors of means have even powers of the step only, for integrators are reversible.  So
    longer steps, whose errors are larger, tell the error of a shorter one best.  The square is
    fitted.  The next powers are as large as they can be beside what is seen (`HIGHER`): they are
    part of the noise, with one shape for all steps.  The longest steps are left out until the
    others are such a series within their error bars (chi-squared).  If none are, the run with this
    step counts alone, and the square is for the reference's own error only.

    What is held against something else than a step of the same integrator may have an error that is
    the same at all steps, too.  This is fitted, and all steps tell it.  It counts only where there
    is an error for sure: else it is noise, that of the common start, for example.

    Args:
        found: of each step the mean.
        held: what the mean would be without an error, or, of the same integrator, with a step of
            ``finer``, whose own error follows from all other steps.

    Returns:
        None if no step tells it.
    """
    telling = (step for step in found if step != finer and (step >= dt or dt == finer or not finer))
    steps = sorted(step for step in telling if np.isfinite([*found[step][:2]]).all())
    if not steps:
        return None
    off = np.array([found[other].value - held.value for other in steps])
    errors = np.array([_normal(found[other]) for other in steps])
    for fit in _fits(dt, steps, np.abs(off), errors, _normal(held), finer):
        own = off[: fit.number]
        if special.chdtrc(len(fit.rest), ((fit.rest @ own) ** 2).sum()) > 1 - CONFIDENCE:
            return _counted(
                _with(Estimate(float(part.weights @ own)), part.error) for part in fit.parts
            )
    alone = min((other for other in steps if other >= dt or dt == finer), default=None)
    if alone is None:
        return None
    factor = _of_square(dt, alone, finer)
    return _with(measures.difference(found[alone], held).times(factor))


def _counted(errors: Iterable[Estimate]) -> Estimate:
    """The whole error if there is one for sure, else the step's part of it."""
    whole, of_step = errors
    return whole if abs(whole.value) > whole.margin else of_step


def _with(error: Estimate, *more: float) -> Estimate:
    """An error with further parts of its own standard error, and `LEAST`."""
    parts = (error.error, LEAST * error.value, *more)
    return error._replace(error=float(np.sqrt(sum(part**2 for part in parts))))


def _of_square(dt: float, other: float, finer: float) -> float:
    """The error at a step over how far another is off one of ``finer``, by the square law."""
    return dt**2 / (other**2 - finer**2)


def _free(finer: float) -> int:
    """Parameters of a series: the square, and an error that is the same at all steps, see
    `by_law`."""
    return 1 if finer else 2


class _Part(NamedTuple):
    """The error at the step asked for, whole or without what is the same at all steps."""

    weights: np.ndarray  # (steps,): times how far these are off
    error: float  # standard
    missed: float  # its part by the higher powers


class _Fit(NamedTuple):
    """A series of even powers through how far the first steps are off."""

    number: int  # of steps
    parts: tuple[_Part, _Part]  # the whole error, and the step's
    # (degrees of freedom, number): times these, normal numbers if the series holds
    rest: np.ndarray


def _fits(
    dt: float,
    steps: Sequence[float],
    off: np.ndarray,
    errors: np.ndarray,
    held: float,
    finer: float,
) -> Iterator[_Fit]:
    """See `by_law`: from all steps down to those that leave one degree of freedom.

    Args:
        off: sizes of how far the means at these steps are off.
        errors: standard errors of these means.
        held: that of what they are held against, which all have in common.
    """
    free = _free(finer)
    exponents = 2 * np.arange(2 - free, POWERS + 1)
    powers = (np.array(steps)[:, None] / dt) ** exponents - (finer / dt) ** exponents * bool(finer)
    covariance = np.diag(errors**2) + held**2
    for number in range(len(steps), free, -1):
        if not (errors[:number].all() and np.isfinite(held)):
            continue
        own = covariance[:number, :number]
        fitted, higher = powers[:number, :free], powers[:number, free:]
        seen = np.sqrt(np.max(off[:number] ** 2 + np.diag(own)))
        sizes = HIGHER * seen / np.abs(higher).max(axis=0)
        inverse = np.linalg.inv(own + (sizes * higher) @ (sizes * higher).T)
        fit = np.linalg.solve(fitted.T @ inverse @ fitted, fitted.T @ inverse)
        left = inverse - inverse @ fitted @ fit
        parts = []
        for first in (0, free - 1):  # with and without what is the same at all steps
            # at the step asked for each power is 1: the higher ones are told by what is left
            weights = fit[first:].sum(axis=0) + sizes**2 @ higher.T @ left
            missed = float(np.linalg.norm(sizes * (weights @ higher - 1)))
            error = np.hypot(np.sqrt(weights @ own @ weights), missed)
            parts.append(_Part(weights, float(error), missed))
        squares, axes = np.linalg.eigh(left)
        rest = np.sqrt(np.maximum(squares[free:, None], 0.0)) * axes.T[free:]
        yield _Fit(number, (parts[0], parts[1]), rest)


def _normal(one: Estimate) -> float:
    """The standard error of a normal variable with the same margin."""
    return one.margin / margin(1.0)
