"""Intervals of the limits that a Kriging surrogate alone gives: sharp where it is right.

The error of a limit is not the worst error near it but the mean one over all points that share its
value.  Its deviation is found twice: from the posterior's covariance between such points, and by
the jackknife, from what the limit loses without each run.  What the surrogate does not explain of
the response counts as before, with one sign everywhere.  Theory: docs/theory/checked.md, sec. 5.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.stats import norm

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.uncertainty.kriging import Kriging
from maglev.uncertainty.reliability import CARRIED, Limits, error_range_near
from maglev.uncertainty.samples import weighted_quantile
from maglev.uncertainty.surrogate import checked_points
from maglev.vocabulary import GIVEN, INFINITE, TOO_FEW

N_NODES = 800
"""Points that stand for those that share the value of a limit; assumed."""

BAND = 0.1
"""Half width of the band about a limit that they are drawn from, in deviations of the response
[-]; assumed."""

N_NEAR = 20
"""Runs nearest by value whose residuals say what is not explained there; assumed."""

TINY = 1e-300
"""Keeps a division by zero away; below any number that occurs."""


def joint_error_range(
    at: npt.ArrayLike,
    process: Kriging,
    response: int,
    points: npt.ArrayLike,
    *,
    weight: npt.ArrayLike | None = None,
    confidence: float = 0.95,
) -> tuple[FloatArray, FloatArray]:
    """Range of the error of a limit of the surrogate, true less predicted.

    Like `maglev.uncertainty.reliability.error_range_near`, whose place it can take.

    Parameters
    ----------
    at : (place,)
        Limits [unit of the response].
    process
        The surrogate.
    response
        Which response.
    points : (point, parameter)
        A population, standardised [-].
    weight : (point,), optional
        Its weights under the law [-]; equal if not given.
    confidence
        Two-sided confidence [-].

    Returns
    -------
    low, high : (place,)
        Ends of the range [unit].

    Raises
    ------
    UserError
        If arrays do not fit, a place is not finite or the confidence lies outside (0, 1).

    References
    ----------
    Efron, The Jackknife, the Bootstrap and Other Resampling Plans (1982), ch. 3; docs/theory/
    checked.md, eqs. (10) to (12); coverage: docs/benchmarks/coverage.md.

    Examples
    --------
    >>> from maglev.uncertainty.kriging import fit_kriging
    >>> rng = np.random.default_rng(0)
    >>> runs, population = rng.standard_normal((40, 2)), rng.standard_normal((5000, 2))
    >>> process = fit_kriging(runs, runs[:, :1] + np.sin(runs[:, 1:]))
    >>> low, high = joint_error_range([2.5], process, 0, population)
    >>> bool(-0.2 < low[0] < 0.0 < high[0] < 0.2)
    True
    """
    at = np.atleast_1d(np.asarray(at, dtype=float))
    points = checked_points(points, process.points.shape[1])
    share = _shares(weight, len(points))
    if not np.isfinite(at).all():
        raise UserError(f"limits must be finite to have an error, got {at}")
    values, residuals = process.values[:, response], process.leave_one_out()[:, response]
    low, high = error_range_near(at, values, residuals, confidence)
    predictions = process.predict(points)[:, response]
    mean = share @ predictions
    sigma = float(np.sqrt(share @ (predictions - mean) ** 2))
    z = norm.ppf(0.5 + 0.5 * confidence)
    for place, limit in enumerate(at):
        nodes = points[_nodes(predictions - limit, BAND * sigma, share)]
        posterior = max(float(process.covariance(response, nodes, nodes).mean()), 0.0)
        lost = process.influence(response, nodes).mean(axis=1) * residuals
        half = z * np.sqrt(posterior + lost @ lost)
        near = np.argsort(np.abs(values - limit), kind="stable")[:N_NEAR]
        unexplained = min(float(np.mean(residuals[near] ** 2)) / max(sigma**2, TINY), 1.0)
        low[place] = -half + unexplained * min(low[place], 0.0)
        high[place] = half + unexplained * max(high[place], 0.0)
    return low, high


def joint_limits(
    process: Kriging,
    response: int,
    points: npt.ArrayLike,
    failure_probability: npt.ArrayLike,
    *,
    weight: npt.ArrayLike | None = None,
    held: npt.ArrayLike | None = None,
    lost_interval: tuple[float, float] = (0.0, 0.0),
    unvisited: float = 0.0,
    confidence: float = 0.95,
) -> Limits:
    """Limits of a surrogate over a population, with the joint error of each and what is unvisited.

    Parameters
    ----------
    process
        The surrogate.
    response
        Which response.
    points : (point, parameter)
        A population, standardised [-].
    failure_probability : (level,)
        Failure probabilities [-].
    weight : (point,), optional
        Weights of the population under the law [-]; equal if not given.
    held : (point,) of bool, optional
        Points not taken for lost; all if not given.  The others exceed every limit.
    lost_interval
        Ends of the interval of the probability of loss [-].
    unvisited
        Probability that no run has visited [-]: a limit at a rarer level has no upper end, as all
        of it may exceed.  To count it below that as well, widen ``lost_interval`` by it.
    confidence
        Two-sided confidence [-].

    Returns
    -------
    limits
        One limit per level; too few are less than ten effective points beyond one.

    Raises
    ------
    UserError
        As `joint_error_range`, or if a level or an end lies outside its range.

    References
    ----------
    docs/theory/checked.md, sec. 5.

    Examples
    --------
    >>> from maglev.uncertainty.kriging import fit_kriging
    >>> rng = np.random.default_rng(0)
    >>> runs, population = rng.standard_normal((40, 2)), rng.standard_normal((5000, 2))
    >>> process = fit_kriging(runs, runs.sum(axis=1))
    >>> limits = joint_limits(process, 0, population, [0.01], unvisited=0.02)
    >>> limits.upper  # what was not visited may be likelier than the level
    array([inf])
    """
    points = checked_points(points, process.points.shape[1])
    levels = np.atleast_1d(np.asarray(failure_probability, dtype=float))
    share = _shares(weight, len(points))
    held = np.ones(len(points), dtype=bool) if held is None else np.asarray(held, dtype=bool)
    if not ((levels > 0.0) & (levels < 1.0)).all():
        raise UserError(f"failure probabilities must lie in (0, 1), got {levels}")
    if not 0.0 <= lost_interval[0] <= lost_interval[1] < 1.0 or not 0.0 <= unvisited <= 1.0:
        raise UserError(
            "the probability of loss must have an interval in [0, 1) and the unvisited one lie in "
            f"[0, 1], got {lost_interval} and {unvisited}"
        )
    predictions = process.predict(points)[:, response]
    away = float(share[~held].sum())
    beyond = np.where(held, predictions, np.inf)
    limit = weighted_quantile(beyond, share, levels)
    noise = np.array([_deviation(share, beyond > one) for one in limit])
    finite = np.isfinite(limit)
    effective = np.square(levels / np.where(finite & (noise > 0.0), noise, np.inf))
    z = norm.ppf(0.5 + 0.5 * confidence)
    low, high = np.zeros((2, levels.size))
    if finite.any():
        low[finite], high[finite] = joint_error_range(
            limit[finite],
            process,
            response,
            points[held],
            weight=share[held],
            confidence=confidence,
        )
    more = levels + (away - lost_interval[0]) + z * noise
    less = levels + (away - lost_interval[1]) - z * noise
    lower = weighted_quantile(beyond, share, more) + low
    bounded = (less > away) & (unvisited <= levels)
    upper = np.where(bounded, weighted_quantile(beyond, share, less) + high, np.inf)
    given = finite & (effective >= CARRIED)
    return Limits(
        failure_probability=levels,
        limit=np.where(given, limit, np.nan),
        lower=np.where(given, lower, np.nan),
        upper=np.where(given, upper, np.nan),
        expected_exceedances=np.where(given, effective, 0.0),
        status=tuple(
            GIVEN if one else TOO_FEW if there else INFINITE
            for one, there in zip(given, finite, strict=True)
        ),
        confidence=confidence,
    )


def _shares(weight: npt.ArrayLike | None, n: int) -> FloatArray:
    """Shares (point,) of a population in the law."""
    share = np.ones(n) if weight is None else np.asarray(weight, dtype=float)
    if share.shape != (n,) or not (share >= 0.0).all() or not share.sum() > 0.0:
        raise UserError(
            f"weights must be {n} numbers, zero or positive, one per point, got shape {share.shape}"
        )
    return share / share.sum()


def _nodes(excess: FloatArray, band: float, share: FloatArray) -> npt.NDArray[np.int64]:
    """Points (node,) that share the value of a limit, by systematic sampling."""
    exponent = -0.5 * (excess / max(band, TINY)) ** 2
    sum_of = np.cumsum(share * np.exp(exponent - exponent.max()))
    return np.searchsorted(sum_of, (np.arange(N_NODES) + 0.5) / N_NODES * sum_of[-1])


def _deviation(share: FloatArray, event: npt.NDArray[np.bool_]) -> float:
    """Standard deviation of the share of an event in a weighted population."""
    mean = float(share @ event)
    return float(np.sqrt(np.sum((share * (event - mean)) ** 2)))
