"""Shares of two independent groups of inputs in the variance of a response."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import special, stats
from scipy.stats import bootstrap

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.errors import UserError

N_RESAMPLES = 999
"""Bootstrap samples behind an interval; assumed, SciPy's own choice for such intervals."""


@dataclass(frozen=True, kw_only=True)
class Shares:
    """Shares of the variance of one response with intervals.

    Parameters
    ----------
    first, second, interaction : (3,)
        Contribution of the first group alone, of the second alone and of both together: share,
        lower and upper end [-].  The shares sum to one; by noise, one may be below zero.
    """

    first: FloatArray
    second: FloatArray
    interaction: FloatArray


def pick_freeze_shares(
    values: npt.ArrayLike,
    same_first: npt.ArrayLike,
    same_second: npt.ArrayLike,
    rng: np.random.Generator,
    confidence: float = 0.95,
) -> Shares:
    """Closed Sobol' indices of two groups of inputs (a, b) that together hold all inputs.

    With Y = f(a, b), Y_a = f(a, b') and Y_b = f(a', b), the share of a group is
    ``(mean(Y Y_a) - m^2) / (mean((Y^2 + Y_a^2) / 2) - m^2)`` with ``m = mean((Y + Y_a) / 2)``.

    Parameters
    ----------
    values : (sample,)
        Y [its unit].
    same_first, same_second : (sample,)
        Y_a and Y_b: one group kept, the other drawn anew [unit].
    rng
        Source of the bootstrap.
    confidence
        Two-sided confidence of the intervals [-].

    Returns
    -------
    shares
        Shares with percentile intervals of the bootstrap over samples.

    Raises
    ------
    UserError
        If shapes disagree, there are fewer than two samples, a value is not finite, all are equal
        or the confidence lies outside (0, 1).

    References
    ----------
    Janon et al., ESAIM Probab. Stat. 18 (2014) 342-364; Efron, Tibshirani, An Introduction to the
    Bootstrap (1993), ch. 13; docs/theory/reliability.md, eq. (13).

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> a, b, other_a, other_b = rng.normal(size=(4, 1000))
    >>> found = pick_freeze_shares(2 * a + b, 2 * a + other_b, 2 * other_a + b, rng)
    >>> share, low, high = found.first
    >>> bool(low < 0.8 < high)  # 4 of 5 parts
    True
    """
    runs = np.array([np.asarray(one, dtype=float) for one in (values, same_first, same_second)])
    if runs.ndim != 2 or runs.shape[1] < 2:
        raise UserError(
            f"pick-freeze runs have shape {runs.shape[1:]}, expected (sample,) with two or more"
        )
    if not np.isfinite(runs).all():
        raise UserError("pick-freeze runs must be finite; leave samples with a lost run out")
    if np.ptp(runs) == 0.0:
        raise UserError(f"pick-freeze runs must differ, got {runs[0, 0]} everywhere")
    if not 0.0 < confidence < 1.0:
        raise UserError(f"confidence must lie in (0, 1), got {confidence}")
    runs = (runs - runs[0].mean()) / runs[0].std()  # no cancellation

    def shares(chosen: IntArray, axis: int = -1) -> FloatArray:
        both = [_share(runs[0][chosen], runs[k][chosen], axis) for k in (1, 2)]
        return np.array([*both, 1.0 - both[0] - both[1]])

    numbers = np.arange(runs.shape[1])
    resampled = bootstrap(
        (numbers,),
        shares,
        n_resamples=N_RESAMPLES,
        batch=max(1, 2**22 // numbers.size),
        vectorized=True,
        confidence_level=confidence,
        method="percentile",
        rng=rng,
    ).confidence_interval
    ends = np.array([shares(numbers), resampled.low, resampled.high])
    return Shares(first=ends[:, 0], second=ends[:, 1], interaction=ends[:, 2])


def _share(y: FloatArray, kept: FloatArray, axis: int) -> FloatArray:
    """Closed index of the inputs that two sets of runs have in common."""
    mean = 0.5 * (y + kept).mean(axis=axis)
    covariance = (y * kept).mean(axis=axis) - mean**2
    return covariance / (0.5 * (y**2 + kept**2).mean(axis=axis) - mean**2)


def crossed_shares(values: npt.ArrayLike, confidence: float = 0.95) -> Shares:
    """Shares of the variance from a full cross of first and second inputs.

    The two-way analysis of variance with random effects: with the mean squares of n_a first and
    n_b second inputs, ``s_ab = M_ab``, ``s_a = (M_a - M_ab) / n_b``, ``s_b = (M_b - M_ab) / n_a``.
    Runs have no noise, so the remainder that neither input explains alone is their interaction.

    The intervals are those of the jackknife over either kind of input: variances are added, and
    Student's quantile is that of the second inputs, the fewer ones.  They hold for the logit of a
    share, or for the share itself where leaving one input out takes it out of (0, 1).  A bootstrap
    would draw inputs twice, and equal inputs have no interaction.

    Parameters
    ----------
    values : (second, first)
        The response [its unit].
    confidence
        Two-sided confidence of the intervals [-].

    Returns
    -------
    shares
        Shares with their intervals.

    Raises
    ------
    UserError
        If there are fewer than three second or two first inputs, a value is not finite, all are
        equal or the confidence lies outside (0, 1).

    References
    ----------
    Searle, Casella, McCulloch, Variance Components (1992), sec. 4.3; Arvesen, Schmitz, Biometrics
    26 (1970) 677-686, for the jackknife; docs/theory/reliability.md, eqs. (14) and (15).

    Examples
    --------
    >>> a, b = np.random.default_rng(0).normal(size=(2, 40))
    >>> found = crossed_shares(a + b[:, None])
    >>> bool(abs(found.interaction[0]) < 1e-9)  # a sum
    True
    """
    runs = np.asarray(values, dtype=float)
    if runs.ndim != 2 or runs.shape[0] < 3 or runs.shape[1] < 2:
        raise UserError(
            f"crossed runs have shape {runs.shape}, expected (second, first) with at least three "
            "second and two first inputs"
        )
    if not np.isfinite(runs).all():
        raise UserError("crossed runs must be finite; leave inputs with a lost run out")
    if np.ptp(runs) == 0.0:
        raise UserError(f"crossed runs must differ, got {runs[0, 0]} everywhere")
    if not 0.0 < confidence < 1.0:
        raise UserError(f"confidence must lie in (0, 1), got {confidence}")
    runs = (runs - runs.mean()) / runs.std()  # no cancellation
    whole = _component_shares(runs)
    left_out = [
        np.array([_component_shares(np.delete(runs, k, axis)) for k in range(runs.shape[axis])])
        for axis in (0, 1)
    ]
    inside = np.logical_and.reduce(
        [((one > 0.0) & (one < 1.0)).all(axis=0) for one in (*left_out, whole[None])]
    )
    at = _logit_where(inside, whole)
    variance = np.zeros(3)
    for without in left_out:
        each, n = _logit_where(inside, without), without.shape[0]
        variance += (n - 1) / n * np.square(each - each.mean(axis=0)).sum(axis=0)
    half = stats.t.ppf(0.5 + 0.5 * confidence, runs.shape[0] - 1) * np.sqrt(variance)
    ends = [np.where(inside, special.expit(one), one) for one in (at - half, at + half)]
    found = np.array([whole, *ends])
    return Shares(first=found[:, 0], second=found[:, 1], interaction=found[:, 2])


def _logit_where(inside: BoolArray, shares: FloatArray) -> FloatArray:
    """Logit of the chosen shares (…, share); the others unchanged."""
    safe = np.where(inside, shares, 0.5)
    return np.where(inside, np.log(safe / (1.0 - safe)), shares)


def _component_shares(values: FloatArray) -> FloatArray:
    """Shares (first, second, together) of the components of variance of (second, first)."""
    n_second, n_first = values.shape
    of_first, of_second = values.mean(axis=0), values.mean(axis=1)
    rest = values - of_first - of_second[:, None] + values.mean()
    together = np.square(rest).sum() / ((n_first - 1) * (n_second - 1))
    first = of_first.var(ddof=1) - together / n_second
    second = of_second.var(ddof=1) - together / n_first
    components = np.array([first, second, together])
    return components / components.sum()


N_BINS = 64
"""Bins along an input in a first-order index; assumed, a few hundred points in each."""


def first_order(points: npt.ArrayLike, values: npt.ArrayLike) -> FloatArray:
    """First-order Sobol' indices from one large set of runs, by means in bins of each input.

    Parameters
    ----------
    points : (sample, parameter)
        Equally likely independent inputs.
    values : (sample, response)
        Responses [their units].

    Returns
    -------
    index : (response, parameter)
        Variance of the means in ``N_BINS`` bins of equal numbers, over the variance [-].

    References
    ----------
    Plischke, Reliab. Eng. Syst. Saf. 95 (2010) 354-360, the correlation ratio.

    Examples
    --------
    >>> points = np.random.default_rng(0).normal(size=(10_000, 2))
    >>> first_order(points, points @ [[2.0], [1.0]]).round(1)
    array([[0.8, 0.2]])
    """
    points, values = np.asarray(points, dtype=float), np.asarray(values, dtype=float)
    size = points.shape[0] // N_BINS
    index = np.empty((values.shape[1], points.shape[1]))
    for k in range(points.shape[1]):
        order = np.argsort(points[:, k], kind="stable")[: size * N_BINS]
        means = values[order].reshape(N_BINS, size, -1).mean(axis=1)
        index[:, k] = means.var(axis=0) / values[order].var(axis=0)
    return index
