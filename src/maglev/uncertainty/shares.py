"""How two independent groups of inputs share the variance of a response, by pick-freeze runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import bootstrap

from maglev.arrays import FloatArray, IntArray

N_RESAMPLES = 999
"""Bootstrap samples behind an interval; assumed, SciPy's own choice for such intervals."""


@dataclass(frozen=True, kw_only=True)
class Shares:
    """Shares of the variance of one response with intervals.

    Parameters
    ----------
    first, second, interaction : (3,)
        What the first group alone, the second alone and both together contribute: share, lower
        and upper end [-].  The three shares sum to one; a noisy one may be below zero.
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
    """Closed Sobol' indices of two groups of inputs (a, b) that are all there is.

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
    ValueError
        If shapes disagree, there are fewer than two samples, a value is not finite, all are equal
        or the confidence lies outside (0, 1).

    References
    ----------
    Janon et al., ESAIM Probab. Stat. 18 (2014) 342-364; Efron, Tibshirani, An Introduction to the
    Bootstrap (1993), ch. 13; docs/theory/reliability.md, eq. (13).
    """
    runs = np.array([np.asarray(one, dtype=float) for one in (values, same_first, same_second)])
    if runs.ndim != 2 or runs.shape[1] < 2:
        raise ValueError(
            f"pick-freeze runs have shape {runs.shape[1:]}, expected (sample,) with two or more"
        )
    if not np.isfinite(runs).all():
        raise ValueError("pick-freeze runs must be finite; leave samples with a lost run out")
    if np.ptp(runs) == 0.0:
        raise ValueError(f"pick-freeze runs must differ, got {runs[0, 0]} everywhere")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must lie in (0, 1), got {confidence}")
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
    """Closed index of what two sets of runs have in common."""
    mean = 0.5 * (y + kept).mean(axis=axis)
    covariance = (y * kept).mean(axis=axis) - mean**2
    return covariance / (0.5 * (y**2 + kept**2).mean(axis=axis) - mean**2)
