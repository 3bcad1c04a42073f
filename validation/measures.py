"""From time series and positions to numbers with errors.  Pure NumPy, no LAMMPS.

Errors are standard errors (one standard deviation of the estimate) that account for
the correlation in time of successive samples.
"""

import numpy as np


def statistical_inefficiency(x):
    """How many successive samples carry as much as one independent sample.

    g = 1 + 2 sum_k rho(k), with rho the normalised autocorrelation, summed to the
    first window of five times its own g/2 (A. Sokal's automatic windowing); at least 1.
    """
    x = np.asarray(x, float) - np.mean(x)
    n = len(x)
    if n < 2 or not np.any(x):
        return 1.0
    spectrum = np.fft.rfft(x, 2 * n)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[:n]
    g = 2 * np.cumsum(correlation / correlation[0]) - 1
    enough = np.arange(n) >= 2.5 * g
    return max(1.0, g[np.argmax(enough) if enough.any() else -1])


def mean(x):
    """Mean and its standard error, sd sqrt(g / n), in units of ``x``."""
    x = np.asarray(x, float)
    return x.mean(), x.std(ddof=1) * np.sqrt(statistical_inefficiency(x) / len(x))


def standard_deviation(x):
    """Standard deviation about the mean, and its standard error, in units of ``x``.

    The error is that of the mean of (x - <x>)^2, divided by 2 sd.
    """
    x = np.asarray(x, float)
    sd = x.std(ddof=1)
    _, error = mean((x - x.mean()) ** 2)
    return sd, error / (2 * sd) if sd > 0 else 0.0


def drift(t, x):
    """Slope of the least-squares line x = a + b t and its standard error.

    error^2 = g s^2 / sum (t - <t>)^2, with s the standard deviation of the residuals
    and g their statistical inefficiency.  In units of ``x`` over units of ``t``.
    """
    t = np.asarray(t, float) - np.mean(t)
    x = np.asarray(x, float) - np.mean(x)
    slope = t @ x / (t @ t)
    rest = x - slope * t
    s2 = rest @ rest / (len(x) - 2)
    return slope, np.sqrt(statistical_inefficiency(rest) * s2 / (t @ t))


def nearest_image(d, cell, periodic):
    """Displacements (..., 3) folded to the nearest periodic image.

    Args:
        d: displacements.
        cell: cell vectors as rows, a along x and b in the xy plane.
        periodic: three flags.
    """
    d = np.array(d, float)
    for axis in (2, 1, 0):
        if periodic[axis]:
            d -= np.round(d[..., axis, None] / cell[axis][axis]) * np.asarray(cell[axis])
    return d


def largest_distance(x, y, cell, periodic):
    """max_i |x_i - y_i| over all atoms, nearest image, in units of ``x``."""
    return np.linalg.norm(nearest_image(x - y, cell, periodic), axis=-1).max()


def body_pairs(bodies, reach=8):
    """Pairs of atoms of the same body, (pairs, 2).

    In a body of up to ``reach`` + 1 atoms all pairs; in a larger one each atom with
    the ``reach`` that follow it in order of ID.  Atoms of body 0 are in no pair.
    """
    bodies = np.asarray(bodies)
    order = np.argsort(bodies, kind="stable")
    order = order[bodies[order] != 0]
    pairs = [np.empty((0, 2), int)]
    for k in range(1, min(reach, len(order) - 1) + 1):
        first, second = order[:-k], order[k:]
        same = bodies[first] == bodies[second]
        pairs.append(np.stack([first[same], second[same]], axis=1))
    return np.concatenate(pairs)


def rigidity_error(start, end, pairs, cell, periodic):
    """Largest change of a distance within a body: max |d_ij(end) - d_ij(start)|."""

    def distances(x):
        return np.linalg.norm(nearest_image(x[pairs[:, 0]] - x[pairs[:, 1]], cell, periodic), axis=1)

    return np.abs(distances(end) - distances(start)).max(initial=0.0)


def spread(values):
    """Median, minimum and maximum, with the values themselves."""
    values = [float(value) for value in values]
    return {
        "median": float(np.median(values)),
        "min": min(values),
        "max": max(values),
        "values": values,
    }
