"""Sobol' indices of a surrogate in independent standard normal inputs."""

from __future__ import annotations

import numpy as np
from scipy import stats

from maglev.arrays import FloatArray
from maglev.uncertainty.surrogate import Surrogate

N_POINTS, N_SETS = 1024, 16
"""Points of one Saltelli set and number of sets, each with a scrambling of its own; assumed: the
intervals come out at a few hundredths."""


def sobol_indices(
    surrogate: Surrogate, rng: np.random.Generator, confidence: float
) -> tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]]:
    """First-order and total Sobol' indices of a surrogate with intervals.

    Predictions over the whole input density are clipped to the range of the training values, beyond
    which the surrogate extrapolates.  The intervals come from ``N_SETS`` independent scramblings
    and do not contain the surrogate's own error.

    Parameters
    ----------
    surrogate
        Surrogate in standard normal inputs.
    rng
        Source of the scramblings.
    confidence
        Two-sided confidence of the intervals [-].

    Returns
    -------
    first, total : three arrays (response, parameter)
        Index, lower and upper end [-].

    References
    ----------
    Saltelli et al., Comput. Phys. Commun. 181 (2010) 259-270; scipy.stats.sobol_indices.

    Examples
    --------
    >>> from maglev.uncertainty.rbf import fit_rbf
    >>> points = np.random.default_rng(0).normal(size=(12, 2))
    >>> plane = fit_rbf(points, points @ [[2.0], [1.0]])
    >>> (first, _, _), (total, _, _) = sobol_indices(plane, np.random.default_rng(1), 0.95)
    >>> first.round(2)
    array([[0.79, 0.2 ]])
    >>> total.round(2)
    array([[0.8 , 0.21]])
    """
    n_parameters, n_responses = surrogate.points.shape[1], surrogate.values.shape[1]
    lowest, highest = surrogate.values.min(axis=0), surrogate.values.max(axis=0)

    def bounded(points: FloatArray) -> FloatArray:
        return np.clip(surrogate.predict(points.T), lowest, highest).T

    shape = (N_SETS, n_responses, n_parameters)
    first, total = np.empty(shape), np.empty(shape)
    for number in range(N_SETS):
        indices = stats.sobol_indices(
            func=bounded, n=N_POINTS, dists=[stats.norm()] * n_parameters, rng=rng
        )
        first[number] = indices.first_order.reshape(shape[1:])
        total[number] = indices.total_order.reshape(shape[1:])
    quantile = stats.t.ppf(0.5 + 0.5 * confidence, N_SETS - 1)

    def with_ends(sets: FloatArray) -> tuple[FloatArray, ...]:
        mean = sets.mean(axis=0)
        half = quantile * sets.std(axis=0, ddof=1) / np.sqrt(N_SETS)
        return mean, mean - half, mean + half

    return with_ends(first), with_ends(total)
