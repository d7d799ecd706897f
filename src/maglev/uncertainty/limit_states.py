"""Probabilities of limit states with their intervals: counted, predicted, and with losses.

Theory: docs/theory/reliability.md, sec. 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.uncertainty.reliability import binomial_interval


@dataclass(frozen=True)
class Probability:
    """A probability with its interval.

    Attributes
    ----------
    value
        Estimate [-].
    low, high
        Ends of the interval [-], which holds the estimate.
    """

    value: float
    low: float
    high: float


IMPOSSIBLE = Probability(0.0, 0.0, 0.0)
"""Of what cannot be."""


def counted(exceeded: npt.ArrayLike, confidence: float = 0.95) -> Probability:
    """Probability from independent samples, with the exact binomial interval.

    Parameters
    ----------
    exceeded : (sample,) of bool
        Which samples have exceeded the limit state.
    confidence
        Two-sided confidence [-].

    Raises
    ------
    UserError
        If there is no sample or the confidence lies outside (0, 1).

    References
    ----------
    Clopper, Pearson, Biometrika 26 (1934) 404-413.

    Examples
    --------
    >>> found = counted(np.arange(1000) < 3)
    >>> print(f"{found.value} [{found.low:.5f}, {found.high:.5f}]")
    0.003 [0.00062, 0.00874]
    """
    return predicted(exceeded, exceeded, exceeded, confidence)


def predicted(
    exceeded: npt.ArrayLike,
    surely: npt.ArrayLike,
    perhaps: npt.ArrayLike,
    confidence: float = 0.95,
) -> Probability:
    """Probability from a surrogate's predictions, with its own error in the interval.

    The surrogate's error is taken to have one sign everywhere, the worst case: the lower end is
    the binomial one of what is exceeded even with the least error, the upper end that of what is
    exceeded with the largest.  Where nothing is exceeded, the upper end is that of none of all
    samples: what they do not carry stays unknown.

    Parameters
    ----------
    exceeded : (sample,) of bool
        Which predictions, at independent draws of the inputs, exceed the limit state.
    surely, perhaps : (sample,) of bool
        The same with the least and the largest error of the surrogate added.
    confidence
        Two-sided confidence of the sampling [-].

    Raises
    ------
    UserError
        If there is no sample, sizes differ or the confidence lies outside (0, 1).

    References
    ----------
    docs/theory/reliability.md, eq. (19).

    Examples
    --------
    >>> none = np.zeros(1000, dtype=bool)
    >>> found = predicted(none, none, none)
    >>> print(f"{found.value} [{found.low}, {found.high:.4f}]")
    0.0 [0.0, 0.0037]
    """
    shapes = {np.asarray(one).shape for one in (exceeded, surely, perhaps)}
    if len(shapes) > 1 or not (n := np.asarray(exceeded).size):
        raise UserError(
            f"limit states need samples, as many with each error, got shapes {sorted(shapes)}"
        )
    if not 0.0 < confidence < 1.0:
        raise UserError(f"confidence must lie in (0, 1), got {confidence}")
    value = np.count_nonzero(exceeded) / n
    low, _ = binomial_interval(float(np.count_nonzero(surely)), n, confidence)
    _, high = binomial_interval(float(np.count_nonzero(perhaps)), n, confidence)
    return Probability(value, min(float(low), value), max(float(high), value))


def error_growth(predictions: npt.ArrayLike, training: npt.ArrayLike) -> FloatArray:
    """How many times the error of a surrogate is larger where it extrapolates.

    Beyond the largest value that it was trained with, no residual says how far it errs.  Its error
    is taken to grow with the square of the way beyond, in deviations of the training values;
    assumed, the coverage is counted (docs/theory/reliability.md, sec. 6).

    Parameters
    ----------
    predictions : (point,)
        Of the surrogate [unit of the response].
    training : (sample,)
        Values of the runs [unit].

    Returns
    -------
    growth : (point,)
        1 up to the largest training value [-].

    Raises
    ------
    UserError
        If the training values do not vary.

    References
    ----------
    docs/theory/reliability.md, eq. (20).

    Examples
    --------
    >>> error_growth([0.0, 1.0, 2.0], [-1.0, 1.0])
    array([1., 1., 4.])
    """
    training = np.asarray(training, dtype=float)
    deviation = training.std()
    if not deviation > 0.0:
        raise UserError(f"training values must vary, got {training.size} that do not")
    beyond = np.maximum(np.asarray(predictions, dtype=float) - training.max(), 0.0)
    return (1.0 + beyond / deviation) ** 2


def with_losses(held: Probability, lost: Probability) -> Probability:
    """Probability that something is exceeded or levitation lost, from that given that it holds.

    Parameters
    ----------
    held
        Probability given that levitation holds.
    lost
        Probability that levitation is lost.

    References
    ----------
    docs/theory/reliability.md, eq. (18).

    Examples
    --------
    >>> with_losses(Probability(0.1, 0.0, 0.2), Probability(0.5, 0.5, 0.5))
    Probability(value=0.55, low=0.5, high=0.6)
    """
    value, low, high = (
        loss + (1.0 - loss) * one
        for one, loss in zip(
            (held.value, held.low, held.high), (lost.value, lost.low, lost.high), strict=True
        )
    )
    return Probability(value, low, high)


def reliability_index(probability: npt.ArrayLike) -> FloatArray:
    """Reliability index (...) of probabilities (...), minus the standard normal quantile [-].

    Infinite for a probability of 0 or 1.

    References
    ----------
    Ditlevsen, Madsen, Structural Reliability Methods (1996), sec. 2.4.

    Examples
    --------
    >>> reliability_index([0.5, 1e-3]).round(2)
    array([-0.  ,  3.09])
    """
    return -np.asarray(stats.norm.ppf(probability), dtype=float)
