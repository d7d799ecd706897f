"""Weighted samples of an extreme value: checks, held part, effective size, quantiles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

from maglev.arrays import FloatArray
from maglev.errors import UserError

SUM_TOLERANCE = 1e-9
"""Largest distance of a sum of probabilities from one, far above rounding and far below the
probability of one point; assumed."""


@dataclass(frozen=True)
class HeldPart:
    """The held samples, and the probability of the lost ones.

    Attributes
    ----------
    values : (held,)
        Extreme values [their unit].
    probability : (held,)
        Probabilities given that the sample is held [-], sum to one.
    lost_probability
        Probability of the samples that are lost [-].
    n_lost
        Number of lost samples.
    """

    values: FloatArray
    probability: FloatArray
    lost_probability: float
    n_lost: int


def deviation_interval(
    values: npt.ArrayLike, confidence: float = 0.95
) -> tuple[float, float, float]:
    """Standard deviation of independent values that need not be normal, with its interval.

    The interval is that of the logarithm, with the kurtosis about a trimmed mean.

    Parameters
    ----------
    values : (sample,)
        Values [their unit].
    confidence
        Two-sided confidence [-].

    Returns
    -------
    deviation, lower, upper
        [unit].

    Raises
    ------
    UserError
        If there are fewer than eight values, or one is not finite.

    References
    ----------
    Bonett, Comput. Stat. Data Anal. 50 (2006) 775-782.

    Examples
    --------
    >>> deviation, low, high = deviation_interval(np.arange(100.0))
    >>> low < deviation < high
    True
    """
    values, _ = weighted_sample(values)
    n = values.size
    if n < 8:
        raise UserError(f"the interval of a deviation needs at least 8 values, got {n}")
    scale = values.std()
    if scale == 0.0:
        return 0.0, 0.0, 0.0
    u = (values - values.mean()) / scale
    middle = stats.trim_mean(u, 0.5 / np.sqrt(n - 4.0))
    kurtosis = n * np.sum((u - middle) ** 4) / np.sum(u**2) ** 2
    z = stats.norm.ppf(0.5 + 0.5 * confidence)
    c = n / (n - z)
    half = z * c * np.sqrt((kurtosis - (n - 3) / n) / (n - 1))
    deviation = values.std(ddof=1)
    ends = deviation * np.sqrt(c * np.exp([-half, half]))
    return float(deviation), float(ends[0]), float(ends[1])


def weighted_sample(
    values: npt.ArrayLike, probability: npt.ArrayLike | None = None
) -> tuple[FloatArray, FloatArray]:
    """Values and probabilities as checked arrays; equal weights if no probability is given.

    Parameters
    ----------
    values : (sample,)
        Extreme values [their unit].
    probability : (sample,), optional
        Assigned probabilities [-].

    Returns
    -------
    values, probability : (sample,)
        The same, as arrays.

    Raises
    ------
    UserError
        If there is no value, a shape is wrong, a value is not finite, a probability is negative
        or they do not sum to one.

    Examples
    --------
    >>> weighted_sample([3.0, 1.0])
    (array([3., 1.]), array([0.5, 0.5]))
    """
    values = np.asarray(values, dtype=float)
    if values.ndim != 1 or values.size == 0:
        raise UserError(f"values have shape {values.shape}, expected (sample,) with one or more")
    n_bad = np.count_nonzero(~np.isfinite(values))
    if n_bad:
        raise UserError(
            f"values must be finite, got {n_bad} of {values.size} that are not; take lost samples "
            "out with held_part first"
        )
    if probability is None:
        return values, np.full(values.size, 1.0 / values.size)
    return values, checked_probability(probability, values.size)


def checked_probability(probability: npt.ArrayLike, n: int) -> FloatArray:
    """Assigned probabilities as a checked array.

    Parameters
    ----------
    probability : (sample,)
        Assigned probabilities [-].
    n
        Number of samples expected.

    Returns
    -------
    probability : (sample,)
        The same, as an array.

    Raises
    ------
    UserError
        If their number is not ``n``, one is negative or NaN, or they do not sum to one.

    Examples
    --------
    >>> checked_probability([0.25, 0.75], 2)
    array([0.25, 0.75])
    """
    probability = np.asarray(probability, dtype=float)
    if probability.shape != (n,):
        raise UserError(
            f"probabilities have shape {probability.shape}, expected (sample,) = ({n},)"
        )
    if not np.all(probability >= 0.0):
        raise UserError(
            f"probabilities must be zero or positive, got {np.min(probability)} as the smallest"
        )
    if abs(probability.sum() - 1.0) > SUM_TOLERANCE:
        raise UserError(
            f"probabilities must sum to 1, got {probability.sum()}; if lost samples were left "
            "out, let held_part do it"
        )
    return probability


def check_lost_probability(lost_probability: float) -> None:
    """Refuse a probability of loss outside [0, 1).

    Parameters
    ----------
    lost_probability
        Probability of the samples that are lost [-].

    Raises
    ------
    UserError
        If it lies outside [0, 1).

    Examples
    --------
    >>> check_lost_probability(0.2)  # at least something is held
    """
    if not 0.0 <= lost_probability < 1.0:
        raise UserError(f"lost probability must lie in [0, 1), got {lost_probability}")


def held_part(
    values: npt.ArrayLike, lost: npt.ArrayLike, probability: npt.ArrayLike | None = None
) -> HeldPart:
    """Split off the lost samples: they have no extreme value and fail every limit.

    Parameters
    ----------
    values : (sample,)
        Extreme values [their unit]; any value, also NaN, where ``lost``.
    lost : (sample,)
        True where the sample is lost.
    probability : (sample,), optional
        Assigned probabilities of all samples [-]; equal if not given.

    Returns
    -------
    held
        The held samples with conditional probabilities, and the probability of the lost ones.

    Raises
    ------
    UserError
        If shapes disagree, ``lost`` is not boolean, no sample is held, a held value is not finite
        or the probabilities do not sum to one.

    References
    ----------
    docs/theory/reliability.md, eq. (2).

    Examples
    --------
    >>> part = held_part([1.0, np.nan, 3.0, 2.0], lost=[False, True, False, False])
    >>> part.values
    array([1., 3., 2.])
    >>> part.lost_probability
    0.25
    """
    values, lost = np.asarray(values, dtype=float), np.asarray(lost)
    if values.ndim != 1 or lost.shape != values.shape or lost.dtype != np.bool_:
        raise UserError(
            f"values and lost have shapes {values.shape} and {lost.shape} and lost has type "
            f"{lost.dtype}, expected (sample,) twice and bool"
        )
    if lost.all():
        raise UserError(f"at least one sample must be held, got {lost.size} lost of {lost.size}")
    if probability is None:
        probability = np.full(values.size, 1.0 / values.size)
    probability = checked_probability(probability, values.size)
    held_values, _ = weighted_sample(values[~lost])
    held_probability = probability[~lost].sum()
    if held_probability == 0.0:
        raise UserError("the held samples must have a positive probability, got 0 in total")
    return HeldPart(
        values=held_values,
        probability=probability[~lost] / held_probability,
        lost_probability=float(probability[lost].sum()),
        n_lost=int(np.count_nonzero(lost)),
    )


def effective_size(probability: npt.ArrayLike) -> float:
    """Effective sample size 1 / sum(P^2): equally weighted samples with the same sum of squares.

    Parameters
    ----------
    probability : (sample,)
        Probabilities [-] that sum to one.

    Returns
    -------
    size
        Between 1 and the number of samples [-].

    References
    ----------
    Kish, Survey Sampling (1965), sec. 11.7.

    Examples
    --------
    >>> effective_size([0.25, 0.25, 0.25, 0.25])
    4.0
    >>> round(effective_size([0.7, 0.1, 0.1, 0.1]), 2)
    1.92
    """
    return float(1.0 / np.sum(np.square(np.asarray(probability, dtype=float))))


def weight_beyond(values: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values in ascending order, and the weight left beyond the first k of them.

    Parameters
    ----------
    values : (sample,)
        Values [their unit].
    weight : (sample,)
        Their weights [-].

    Returns
    -------
    ordered : (sample,)
        The values.
    beyond : (sample + 1,)
        Weight beyond the first k, for k from none to all.

    Examples
    --------
    >>> weight_beyond(np.array([3.0, 1.0]), np.array([0.25, 0.75]))
    (array([1., 3.]), array([1.  , 0.25, 0.  ]))
    """
    order = np.argsort(values, kind="stable")
    return values[order], np.append(np.cumsum(weight[order][::-1])[::-1], 0.0)


def weighted_quantile(
    values: npt.ArrayLike, weight: npt.ArrayLike, beyond: npt.ArrayLike, rounding: float = 1e-12
) -> FloatArray:
    """Smallest value with at most a given weight beyond it.

    Parameters
    ----------
    values : (sample,)
        Values [their unit].
    weight : (sample,)
        Their weights [-]; they need not sum to one.
    beyond : (level,)
        Weights that may lie beyond [-]; below zero, the largest value is given.
    rounding
        Tolerated error of a sum of weights [-], far below one weight.

    Returns
    -------
    quantile : (level,)
        Values of the sample.

    Examples
    --------
    >>> weighted_quantile([1.0, 2.0, 3.0, 4.0], [0.25] * 4, [0.5, 0.25])
    array([2., 3.])
    """
    ordered, left = weight_beyond(np.asarray(values, float), np.asarray(weight, float))
    # left[k + 1] lies beyond the k-th smallest value and does not grow with k
    index = np.searchsorted(-left[1:], -(np.asarray(beyond, float) + rounding), side="left")
    return ordered[np.minimum(index, ordered.size - 1)]
