"""Probability of exceedance, limits at given failure probabilities, and their intervals.

A lost sample is a failure for every limit.  Theory: docs/theory/reliability.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.errors import UserError
from maglev.uncertainty.samples import (
    check_lost_probability,
    weight_beyond,
    weighted_quantile,
    weighted_sample,
)
from maglev.vocabulary import GIVEN, INFINITE, TOO_FEW

FAILURE_PROBABILITIES = (1e-1, 1e-2, 1e-3)
"""Levels at which limits are given by default."""

CARRIED = 10
"""Expected exceedances, to the nearest whole number, that a sample needs at a level; with fewer, no
limit is given."""

_ROUNDING = 1e-12  # of a sum of probabilities, so that 1000 samples carry exactly one at 1e-3


CLUSTERS_BEYOND = 3.0
"""Expected number of clusters, such as tracks, that a limit needs beyond it; assumed: 32 tracks
then carry the level 0.1.  The coverage is counted in a test."""


@dataclass(frozen=True)
class Limits:
    """Limits of an extreme value: the smallest value whose exceedance is at most the level.

    Attributes
    ----------
    failure_probability : (level,)
        Failure probabilities [-].
    limit : (level,)
        Limits [unit of the value]; NaN where ``status`` is not ``"given"``.
    lower, upper : (level,) or None
        Ends of the interval [unit]; infinite where the sample does not bound that side, NaN
        where ``limit`` is NaN, None where there is no interval.
    expected_exceedances : (level,)
        Number of held samples expected beyond the limit [-].
    status : (level,)
        A word of `maglev.vocabulary.LIMIT_STATUS`; fewer than ten expected exceedances are too few.
    confidence
        Confidence of the interval [-]; None with no interval.
    """

    failure_probability: FloatArray
    limit: FloatArray
    lower: FloatArray | None
    upper: FloatArray | None
    expected_exceedances: FloatArray
    status: tuple[str, ...]
    confidence: float | None

    @property
    def interval(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper ends (level,) of the interval.

        Raises
        ------
        UserError
            If the limits carry no interval.
        """
        if self.lower is None or self.upper is None:
            raise UserError("the limits carry no interval; find them from independent runs")
        return self.lower, self.upper

    @property
    def half_width(self) -> FloatArray:
        """Half the interval (level,) [unit]."""
        lower, upper = self.interval
        return 0.5 * (upper - lower)


def exceedance(
    at: npt.ArrayLike,
    values: npt.ArrayLike,
    probability: npt.ArrayLike | None = None,
    *,
    lost_probability: float = 0.0,
) -> FloatArray:
    """Probability of exceedance from the exact weighted distribution function.

    ``POE(y) = P_lost + (1 - P_lost) sum_q P_q I{Y_q > y}``.

    Parameters
    ----------
    at : (value,)
        Values y [unit of the extreme value].
    values : (sample,)
        Extreme values of the held samples [their unit].
    probability : (sample,), optional
        Their probabilities given that they are held [-]; equal if not given.
    lost_probability
        Probability of the samples that are lost [-].

    Returns
    -------
    exceedance : (value,)
        P(Y > y or lost) [-].

    Raises
    ------
    UserError
        If the sample is faulty, a value y is NaN or ``lost_probability`` lies outside [0, 1).

    References
    ----------
    docs/theory/reliability.md, eq. (2).

    Examples
    --------
    >>> exceedance([1.5, 3.0], [1.0, 2.0, 3.0, 4.0])
    array([0.75, 0.25])
    """
    values, probability = weighted_sample(values, probability)
    check_lost_probability(lost_probability)
    at = _checked_values(at)
    ordered, beyond = weight_beyond(values, probability)
    held = beyond[np.searchsorted(ordered, at, side="right")]
    return lost_probability + (1.0 - lost_probability) * held


def sample_limits(
    values: npt.ArrayLike,
    failure_probability: npt.ArrayLike = FAILURE_PROBABILITIES,
    *,
    n_lost: int = 0,
    confidence: float = 0.95,
) -> Limits:
    """Limits of independent, equally weighted samples, with exact order-statistic intervals.

    Lost samples stand above every held one.  The interval holds the true limit with at least
    ``confidence``, whatever the distribution.

    Parameters
    ----------
    values : (held,)
        Extreme values of the held samples [their unit].
    failure_probability : (level,)
        Failure probabilities [-].
    n_lost
        Number of lost samples beside them.
    confidence
        Two-sided confidence of the intervals [-].

    Returns
    -------
    limits
        One limit per level.

    Raises
    ------
    UserError
        If the sample is faulty, a level or the confidence lies outside (0, 1), or ``n_lost`` is
        negative.

    References
    ----------
    David, Nagaraja, Order Statistics (2003), sec. 7.1; docs/theory/reliability.md, eqs. (4), (5).

    Examples
    --------
    >>> limits = sample_limits(np.arange(1000.0), [0.1, 0.001])
    >>> limits.limit
    array([899.,  nan])
    >>> limits.status
    ('given', 'too_few_exceedances')
    >>> limits.half_width[0].item()
    19.0
    """
    values, _ = weighted_sample(values)
    levels = _checked_levels(failure_probability)
    _check_confidence(confidence)
    if n_lost < 0:
        raise UserError(f"the number of lost samples must be zero or positive, got {n_lost}")
    n = values.size + n_lost
    ranked = np.concatenate((np.sort(values), np.full(n_lost, np.inf)))
    expected = n * levels - n_lost
    status = _status(expected, lost=n_lost / n >= levels)
    given = np.array(status) == GIVEN
    allowed = np.floor(n * levels * (1.0 + _ROUNDING)).astype(int)
    limit = np.where(given, ranked[n - allowed - 1], np.nan)
    first, last = _order_statistics(n, 1.0 - levels, confidence)
    padded = np.concatenate(([-np.inf], ranked, [np.inf]))  # order statistics 0 and n + 1
    return Limits(
        failure_probability=levels,
        limit=limit,
        lower=np.where(given, padded[first], np.nan),
        upper=np.where(given, padded[last], np.nan),
        expected_exceedances=np.maximum(expected, 0.0),
        status=status,
        confidence=confidence,
    )


def surrogate_limits(
    predictions: npt.ArrayLike,
    failure_probability: npt.ArrayLike = FAILURE_PROBABILITIES,
    *,
    residuals: npt.ArrayLike | None = None,
    standard_deviation: npt.ArrayLike | None = None,
    error_range: tuple[float, float] | None = None,
    lost_probability: float = 0.0,
    lost_interval: tuple[float, float] | None = None,
    confidence: float = 0.95,
) -> Limits:
    """Limits from the predictions of a surrogate, with its own error in the interval.

    The surrogate's error is taken to have one sign all over the tail, the worst case: the lower
    end is the order-statistic lower end of ``prediction + low error``, the upper end likewise.
    The low and high errors are conservative quantiles of the leave-one-out residuals, or the
    posterior deviation of each prediction times a normal quantile.  Sampling and surrogate error
    each have ``confidence``, so both together have at least ``2 confidence - 1``.

    Parameters
    ----------
    predictions : (sample,)
        Surrogate's values at independent draws of the inputs that are held [their unit].
    failure_probability : (level,)
        Failure probabilities [-].
    residuals : (training,), optional
        Leave-one-out residuals, computed value less prediction [unit]; where errors differ
        across the domain, only those of training points near the tail.
    standard_deviation : (sample,), optional
        Posterior deviation of each prediction [unit].
    error_range : optional
        Lower and upper end of the surrogate's error, as `error_range_near` gives it [unit].
        Exactly one of the three is to be given.
    lost_probability
        Probability that a sample is lost [-].
    lost_interval
        Lower and upper end of the interval of ``lost_probability`` [-]; without it the
        probability is taken as exact.
    confidence
        Two-sided confidence of each part [-].

    Returns
    -------
    limits
        One limit per level; the limit itself is that of the plain predictions.

    Raises
    ------
    UserError
        If the predictions are faulty, not exactly one of ``residuals``, ``standard_deviation`` and
        ``error_range`` is given, it is faulty, there are too few residuals for the confidence, a
        level or the confidence lies outside (0, 1), or the loss probabilities are out of range or
        order.

    References
    ----------
    Barber et al., Ann. Stat. 49 (2021) 486-507 (rank of a leave-one-out residual); Rasmussen,
    Williams, Gaussian Processes for Machine Learning (2006), eq. 2.26; docs/theory/reliability.md,
    eqs. (6) to (8).

    Examples
    --------
    >>> predictions = np.arange(1000.0)
    >>> limits = surrogate_limits(predictions, [0.1], error_range=(-5.0, 5.0))
    >>> limits.limit
    array([899.])
    >>> lower, upper = limits.interval
    >>> float(upper[0] - lower[0]) > 10.0
    True
    """
    predictions, probability = weighted_sample(predictions)
    levels = _checked_levels(failure_probability)
    check_lost_probability(lost_probability)
    _check_confidence(confidence)
    if lost_interval is None:
        lost_interval = (lost_probability, lost_probability)
    fewest, most = lost_interval
    if not 0.0 <= fewest <= lost_probability <= most < 1.0:
        raise UserError(
            f"the interval of the lost probability must hold it within [0, 1), got {fewest} to "
            f"{most} around {lost_probability}"
        )
    given_errors = [one is not None for one in (residuals, standard_deviation, error_range)]
    if sum(given_errors) != 1:
        raise UserError(
            "the surrogate's error must be given as either residuals or standard_deviation or "
            f"error_range, got {('neither', 'one', 'both', 'all three')[sum(given_errors)]}"
        )
    low: float | FloatArray
    high: float | FloatArray
    if residuals is not None:
        low, high = _residual_quantiles(residuals, confidence)
    elif error_range is not None:
        low, high = error_range
        if not (np.isfinite(low) and np.isfinite(high) and low <= high):
            raise UserError(f"the range of errors must be finite and ascend, got {low} to {high}")
    else:
        spread = np.asarray(standard_deviation, dtype=float)
        if spread.shape != predictions.shape:
            raise UserError(
                f"standard deviations have shape {spread.shape}, expected that of the "
                f"predictions, {predictions.shape}"
            )
        if not np.all(np.isfinite(spread) & (spread >= 0.0)):
            raise UserError("standard deviations must be finite and zero or positive")
        high = float(stats.norm.ppf(0.5 + 0.5 * confidence)) * spread
        low = -high
    n = predictions.size
    held_level = (levels - lost_probability) / (1.0 - lost_probability)
    status = _status(n * held_level, lost=held_level <= 0.0)
    given = np.array(status) == GIVEN

    def end(shift: float | FloatArray, loss: float, side: int) -> FloatArray:
        level = (levels - loss) / (1.0 - loss)
        padded = np.concatenate(([-np.inf], np.sort(predictions + shift), [np.inf]))
        rank = np.full(levels.shape, n + 1)  # no finite end where losses alone exceed the level
        finite = level > 0.0
        rank[finite] = _order_statistics(n, 1.0 - level[finite], confidence)[side]
        return np.where(given, padded[rank], np.nan)

    return Limits(
        failure_probability=levels,
        limit=np.where(given, weighted_quantile(predictions, probability, held_level), np.nan),
        lower=end(low, fewest, 0),
        upper=end(high, most, 1),
        expected_exceedances=np.maximum(n * held_level, 0.0),
        status=status,
        confidence=confidence,
    )


def clustered_limits(
    values: npt.ArrayLike,
    failure_probability: npt.ArrayLike = FAILURE_PROBABILITIES,
    *,
    confidence: float = 0.95,
) -> Limits:
    """Limits of samples that come in equally likely clusters, such as the gains on some tracks.

    The limit is that of all samples together.  Its interval depends on the number of clusters: the
    exceedance at the limit is a mean over clusters with an effective size of its own.  From it
    follows the exact binomial interval of the exceedance; the limits at the ends of that interval
    are the ends of the interval of the limit.

    Parameters
    ----------
    values : (cluster, sample)
        Extreme values [their unit].
    failure_probability : (level,)
        Failure probabilities [-].
    confidence
        Two-sided confidence [-].

    Returns
    -------
    limits
        One limit per level; ``expected_exceedances`` counts clusters, of which at least
        `CLUSTERS_BEYOND` are needed.

    Raises
    ------
    UserError
        If there are fewer than two clusters, a value is not finite, or a level or the confidence
        lies outside (0, 1).

    References
    ----------
    Woodruff, J. Am. Stat. Assoc. 47 (1952) 635-646; Korn, Graubard, Surv. Methodol. 24 (1998)
    193-201; docs/theory/reliability.md, eqs. (16) and (17).

    Examples
    --------
    >>> gains = np.linspace(0.0, 1.0, 100)
    >>> tracks = np.linspace(0.0, 2.0, 30)[:, None]
    >>> limits = clustered_limits(gains + tracks, [0.2])
    >>> limits.limit.round(2)
    array([2.12])
    """
    values = np.asarray(values, dtype=float)
    levels = _checked_levels(failure_probability)
    _check_confidence(confidence)
    if values.ndim != 2 or values.shape[0] < 2 or values.shape[1] < 1:
        raise UserError(
            f"values have shape {values.shape}, expected (cluster, sample) with at least two "
            "clusters"
        )
    ranked = np.sort(weighted_sample(values.ravel())[0])
    n = values.shape[0]
    carried = n * levels >= CLUSTERS_BEYOND

    def at(level: float) -> float:
        """Smallest value that at most a given share of all samples exceeds."""
        allowed = int(ranked.size * level * (1.0 + _ROUNDING))
        return float(ranked[max(ranked.size - allowed - 1, 0)])

    limit, lower, upper = np.full((3, levels.size), np.nan)
    outside = 0.5 * (1.0 - confidence)
    wider = (stats.norm.ppf(outside) / stats.t.ppf(outside, n - 1)) ** 2
    for k in np.flatnonzero(carried):
        limit[k] = at(levels[k])
        of_cluster = (values > limit[k]).mean(axis=1)
        p = of_cluster.mean()
        variance = of_cluster.var(ddof=1) / n
        size = values.size if variance == 0.0 else p * (1.0 - p) / variance
        size = min(size * wider, values.size)
        ends = (
            stats.beta.ppf(outside, size * p, size * (1.0 - p) + 1.0),
            stats.beta.ppf(1.0 - outside, size * p + 1.0, size * (1.0 - p)),
        )
        lower[k] = at(ends[1])
        upper[k] = at(ends[0]) if n * ends[0] > 0.5 else np.inf
    return Limits(
        failure_probability=levels,
        limit=limit,
        lower=lower,
        upper=upper,
        expected_exceedances=n * levels,
        status=tuple(GIVEN if one else TOO_FEW for one in carried),
        confidence=confidence,
    )


def error_range_near(
    at: npt.ArrayLike,
    values: npt.ArrayLike,
    residuals: npt.ArrayLike,
    confidence: float = 0.95,
) -> tuple[FloatArray, FloatArray]:
    """Range of a surrogate's error where its response is near given values.

    The range is that of the leave-one-out residuals of the training samples with the nearest
    values, the fewest that the confidence needs.  With fewer samples in all, the range is Student's
    prediction interval of a further residual, residuals taken as normal.

    Parameters
    ----------
    at : (value,)
        Values near which the error is wanted, such as limits [unit of the value].
    values : (training,)
        Training values [unit].
    residuals : (training,)
        Their leave-one-out residuals, value less prediction [unit].
    confidence
        Two-sided confidence [-].

    Returns
    -------
    low, high : (value,)
        Ends of the range [unit].

    Raises
    ------
    UserError
        If shapes disagree, something is not finite, there are fewer than two samples, or the
        confidence lies outside (0, 1).

    References
    ----------
    Barber et al., Ann. Stat. 49 (2021) 486-507; docs/theory/reliability.md, eqs. (7) and (9).

    Examples
    --------
    >>> values = np.linspace(0.0, 1.0, 200)
    >>> residuals = 0.01 * np.sin(1e3 * values)
    >>> low, high = error_range_near(0.5, values, residuals)
    >>> bool(-0.01 <= low[0] < high[0] <= 0.01)
    True
    """
    at = _checked_values(at)
    values, residuals = np.asarray(values, dtype=float), np.asarray(residuals, dtype=float)
    _check_confidence(confidence)
    n = values.size
    if values.ndim != 1 or residuals.shape != values.shape or n < 2:
        raise UserError(
            f"values and residuals have shapes {values.shape} and {residuals.shape}, expected "
            "(training,) twice, with two samples or more"
        )
    if not (np.isfinite(values).all() and np.isfinite(residuals).all()):
        raise UserError("values and residuals must be finite, got NaN or infinity among them")
    n_near = _fewest_residuals(confidence)
    if n < n_near:
        quantile = stats.t.ppf(0.5 + 0.5 * confidence, n - 1)
        half = quantile * residuals.std(ddof=1) * np.sqrt(1.0 + 1.0 / n)
        mean = residuals.mean()
        return np.full(at.size, mean - half), np.full(at.size, mean + half)
    distance = np.abs(at[:, None] - values)
    near = np.argsort(distance, axis=1, kind="stable")[:, :n_near]
    return residuals[near].min(axis=1), residuals[near].max(axis=1)


def binomial_interval(
    n_beyond: FloatArray | float, n: int, confidence: float
) -> tuple[FloatArray, FloatArray]:
    """Exact (Clopper-Pearson) interval of a probability from ``n_beyond`` of ``n`` samples.

    Parameters
    ----------
    n_beyond : (...)
        Numbers of samples.
    n
        Number of all.
    confidence
        Two-sided confidence [-].

    Returns
    -------
    low, high : (...)
        Ends of the interval [-].

    References
    ----------
    Clopper, Pearson, Biometrika 26 (1934) 404-413.

    Examples
    --------
    >>> low, high = binomial_interval(3, 1000, 0.95)
    >>> print(f"{low:.5f} {high:.5f}")
    0.00062 0.00874
    """
    k = np.asarray(n_beyond, dtype=float)
    outside = 0.5 * (1.0 - confidence)
    low = np.where(k > 0, stats.beta.ppf(outside, np.maximum(k, 1), n - k + 1), 0.0)
    high = np.where(k < n, stats.beta.ppf(1.0 - outside, k + 1, np.maximum(n - k, 1)), 1.0)
    return low, high


def _order_statistics(n: int, quantile: FloatArray, confidence: float) -> tuple[IntArray, IntArray]:
    """Ranks, 0 to n + 1, of order statistics that enclose a quantile with this confidence."""
    outside = 0.5 * (1.0 - confidence)
    first = stats.binom.ppf(outside, n, quantile).astype(np.int64)
    last = stats.binom.ppf(1.0 - outside, n, quantile).astype(np.int64) + 1
    return first, last


def _residual_quantiles(residuals: npt.ArrayLike, confidence: float) -> tuple[float, float]:
    """Conservative lower and upper quantile of leave-one-out residuals, by rank of n + 1."""
    residuals = np.asarray(residuals, dtype=float)
    if residuals.ndim != 1 or not np.all(np.isfinite(residuals)):
        raise UserError(
            f"residuals must be finite and have shape (training,), got shape {residuals.shape}"
        )
    n = residuals.size
    rank = int(np.floor(0.5 * (1.0 - confidence) * (n + 1) * (1.0 + _ROUNDING)))
    if rank < 1:
        raise UserError(
            f"a confidence of {confidence} needs at least {_fewest_residuals(confidence)} "
            f"residuals, got {n}; train on more points or lower the confidence"
        )
    ranked = np.sort(residuals)
    return float(ranked[rank - 1]), float(ranked[n - rank])


def _fewest_residuals(confidence: float) -> int:
    """Fewest residuals whose range is a prediction interval of this confidence."""
    return int(np.ceil(2.0 / (1.0 - confidence) * (1.0 - _ROUNDING))) - 1


def _status(expected: FloatArray, lost: BoolArray) -> tuple[str, ...]:
    return tuple(
        INFINITE if none_finite else GIVEN if round(count) >= CARRIED else TOO_FEW
        for count, none_finite in zip(expected, lost, strict=True)
    )


def _checked_levels(failure_probability: npt.ArrayLike) -> FloatArray:
    levels = np.atleast_1d(np.asarray(failure_probability, dtype=float))
    if levels.ndim != 1 or not np.all((levels > 0.0) & (levels < 1.0)):
        raise UserError(f"failure probabilities must lie in (0, 1), got {failure_probability!r}")
    return levels


def _checked_values(at: npt.ArrayLike) -> FloatArray:
    at = np.atleast_1d(np.asarray(at, dtype=float))
    if at.ndim != 1 or np.any(np.isnan(at)):
        raise UserError(f"values y must have shape (value,) and not be NaN, got shape {at.shape}")
    return at


def _check_confidence(confidence: float) -> None:
    if not 0.0 < confidence < 1.0:
        raise UserError(f"confidence must lie in (0, 1), got {confidence}")
