"""The error of a mean at a time step, from runs with this step and longer ones."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy import special

from ..statistics import measures
from ..statistics.estimate import CONFIDENCE, Estimate

# even powers of the step in errors of means.  Each above the square is treated as noise with this
# standard deviation at the longest step, in units of the largest error seen.  A step near the
# stability limit, where all powers matter, therefore says little about shorter ones
POWERS, HIGHER = 4, 4.0
LEAST = 0.02  # standard error by still higher powers, relative to the error
NONE = Estimate(0.0)


def by_law(
    dt: float, means: Mapping[float, Estimate], held: Estimate = NONE, finer: float = 0.0
) -> Estimate | None:
    """Fit an error that is a series in the square of the time step, to the run with this step and
    to those with longer ones.

    The errors of means contain only even powers of the step, because integrators are reversible.
    Longer steps have larger errors, and so determine the error of a shorter one best.  The square
    is fitted.  The next powers may be as large as the data allow (`HIGHER`): they are part of the
    noise, with one shape for all steps.  The longest steps are left out until the others fit such a
    series within their error bars (chi-squared).  If none do, only the run with this step counts,
    and the square is used for the reference's own error only.

    If the reference is not a step of the same integrator, there may also be an error that is the
    same at all steps.  It is fitted to all steps.  It counts only if it is significant; otherwise
    it is noise, for example that of the common start.

    Args:
        means: by step.
        held: the mean without an error, or, of the same integrator, at a step of ``finer``, whose
            own error follows from all other steps.

    Returns:
        None if no step determines it.
    """
    telling = (step for step in means if step != finer and (step >= dt or dt == finer or not finer))
    steps = sorted(step for step in telling if np.isfinite([*means[step][:2]]).all())
    if not steps:
        return None
    off = np.array([means[other].value - held.value for other in steps])
    errors = np.array([means[other].normal_error for other in steps])
    for fit in _fits(dt, steps, np.abs(off), errors, held.normal_error, finer):
        deviations = off[: fit.number]
        if special.chdtrc(len(fit.rest), ((fit.rest @ deviations) ** 2).sum()) > 1 - CONFIDENCE:
            whole, of_step = (
                _with(Estimate(float(part.weights @ deviations)), part.error) for part in fit.parts
            )
            # the whole error if it is significant, else only the step's part
            return whole if abs(whole.value) > whole.margin else of_step
    alone = min((other for other in steps if other >= dt or dt == finer), default=None)
    if alone is None:
        return None
    return _with(measures.difference(means[alone], held).times(dt**2 / (alone**2 - finer**2)))


def _with(error: Estimate, *more: float) -> Estimate:
    """An error with further contributions to its standard error, and `LEAST`."""
    parts = (error.error, LEAST * error.value, *more)
    return error._replace(error=float(np.sqrt(sum(part**2 for part in parts))))


class _Part(NamedTuple):
    """The error at the requested step, either whole or without the part that all steps share."""

    weights: np.ndarray  # (steps,): of the deviations of the steps
    error: float  # standard
    missed: float  # standard error by the higher powers


class _Fit(NamedTuple):
    """A series of even powers through the deviations of the first steps."""

    number: int  # of steps
    parts: tuple[_Part, _Part]  # the whole error, and that of the step
    # (degrees of freedom, number): applied to the deviations, normal variables if the series holds
    rest: np.ndarray


def _fits(
    dt: float,
    steps: Sequence[float],
    off: np.ndarray,
    errors: np.ndarray,
    held: float,
    finer: float,
) -> Iterator[_Fit]:
    """Yield fits as in `by_law`: from all steps down to those that leave one degree of freedom.

    Args:
        off: absolute deviations of the means at these steps.
        errors: standard errors of these means.
        held: standard error of the reference, common to all.
    """
    free = 1 if finer else 2  # the square, and an error that is the same at all steps: see `by_law`
    exponents = 2 * np.arange(2 - free, POWERS + 1)
    powers = (np.array(steps)[:, None] / dt) ** exponents - (finer / dt) ** exponents * bool(finer)
    covariance = np.diag(errors**2) + held**2
    for number in range(len(steps), free, -1):
        if not (errors[:number].all() and np.isfinite(held)):
            continue
        block = covariance[:number, :number]
        fitted, higher = powers[:number, :free], powers[:number, free:]
        seen = np.sqrt(np.max(off[:number] ** 2 + np.diag(block)))
        sizes = HIGHER * seen / np.abs(higher).max(axis=0)
        inverse = np.linalg.inv(block + (sizes * higher) @ (sizes * higher).T)
        fit = np.linalg.solve(fitted.T @ inverse @ fitted, fitted.T @ inverse)
        left = inverse - inverse @ fitted @ fit
        parts = []
        for first in (0, free - 1):  # with and without the error that is the same at all steps
            # at the requested step each power is 1: the residuals determine the higher ones
            weights = fit[first:].sum(axis=0) + sizes**2 @ higher.T @ left
            missed = float(np.linalg.norm(sizes * (weights @ higher - 1)))
            error = np.hypot(np.sqrt(weights @ block @ weights), missed)
            parts.append(_Part(weights, float(error), missed))
        squares, axes = np.linalg.eigh(left)
        yield _Fit(
            number,
            (parts[0], parts[1]),
            np.sqrt(np.maximum(squares[free:, None], 0.0)) * axes.T[free:],
        )
