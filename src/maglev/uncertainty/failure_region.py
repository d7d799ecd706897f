"""Region of lost samples: its learnt border, its probability, their uncertainty.

The outcome of a sample is not random: a border g(u) = βᵀf(u) = 0, sharp but unknown, separates held
from lost.  Its posterior is a set of borders that agree with the samples; their disagreement is the
uncertainty.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from scipy.special import expit
from scipy.stats import binomtest
from sklearn.linear_model import LogisticRegression

from maglev.arrays import FloatArray, IntArray
from maglev.errors import UserError
from maglev.uncertainty._border_kernels import border_chain
from maglev.uncertainty.surrogate import checked_points

PRIOR_DEVIATION = {"constant": 6.0, "linear": 1.0, "quadratic": 0.1}
"""Prior standard deviations of the coefficients of the border [-]; assumed: a plane some three
standard deviations from the mean of the inputs, bent a little."""

SHARPNESS = 20.0
"""Log-odds per unit of g [-]; assumed: it blurs the border over a twentieth of a standard deviation
of the inputs, so that the true border need not be exactly quadratic."""

N_DRAWS, N_BETWEEN, N_BEFORE = 200, 10, 500
"""Borders kept, steps of the chain between two of them, steps before the first; assumed, and
checked against a border whose posterior is known."""

N_POOL = 1024
"""Largest number of candidates compared in full, the most doubtful ones; assumed."""

SETTLED = 1e-6
"""Variance of an outcome below which all borders agree on it [-]; assumed, a thousandth of the
share of one border."""

BLOCK = 8192
"""Points per block in sums over a population; bounds the memory; assumed."""


@dataclass(frozen=True, kw_only=True)
class FailureRegion:
    """Region of lost samples as a set of plausible borders.

    Parameters
    ----------
    borders : (draw, feature)
        Coefficients β of equally likely borders [-], for the features 1, u_i and u_i u_j (i ≤ j).
    n_parameters
        Number of inputs.
    """

    borders: FloatArray
    n_parameters: int

    def lost_probability(self, points: npt.ArrayLike) -> FloatArray:
        """Probability that a sample at each point is lost.

        Parameters
        ----------
        points : (point, parameter)
            Standardised points [-].

        Returns
        -------
        probability : (point,)
            Mean over the borders [-]; near 0.5 where they disagree.

        Raises
        ------
        UserError
            If ``points`` are not finite or have another number of parameters.
        """
        points = checked_points(points, self.n_parameters)
        probability = np.empty(points.shape[0])
        for start in range(0, points.shape[0], BLOCK):
            block = points[start : start + BLOCK]
            probability[start : start + BLOCK] = self._by_border(block).mean(axis=1)
        return probability

    def total_probability(self, population: npt.ArrayLike) -> FloatArray:
        """Probability that a random sample is lost, for each border.

        Parameters
        ----------
        population : (point, parameter)
            Equally likely draws from the input density, standardised [-].

        Returns
        -------
        probability : (draw,)
            P(lost) [-]: the mean is its estimate, the quantiles are its credible interval.  The
            noise of the population itself is not in it.

        Raises
        ------
        UserError
            If the population is empty, not finite or has another number of parameters.
        """
        population = checked_points(population, self.n_parameters)
        if population.shape[0] == 0:
            raise UserError("a population must have at least one point, got none; draw some")
        total = np.zeros(self.borders.shape[0])
        for start in range(0, population.shape[0], BLOCK):
            total += self._by_border(population[start : start + BLOCK]).sum(axis=0)
        return total / population.shape[0]

    def _by_border(self, points: FloatArray) -> FloatArray:
        """Probability (point, draw) to be lost, for each border."""
        return expit(SHARPNESS * (_features(points) @ self.borders.T))


def fit_failure_region(
    points: npt.ArrayLike, lost: npt.ArrayLike, rng: np.random.Generator
) -> FailureRegion:
    """Learn the border between held and lost samples.

    The coefficients of the quadratic border have independent normal priors of zero mean; the
    posterior is drawn by elliptical slice sampling, from a logistic regression on.

    Parameters
    ----------
    points : (sample, parameter)
        Every standardised sample, held or lost [-].
    lost : (sample,) of bool
        Whether each sample was lost.
    rng
        Source of the draws.

    Returns
    -------
    region
        The learnt region.

    Raises
    ------
    UserError
        If ``lost`` is not boolean or does not fit, or if all samples held or all were lost.

    References
    ----------
    Murray, Adams, MacKay, Elliptical slice sampling, Proc. AISTATS (2010), fig. 2.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> points = rng.normal(size=(60, 2))
    >>> region = fit_failure_region(points, points[:, 0] < -1.0, rng)
    >>> probability = region.lost_probability([[-3.0, 0.0], [2.0, 0.0]])
    >>> bool(probability[0] > 0.9 and probability[1] < 0.1)
    True
    """
    points = checked_points(points)
    lost = np.asarray(lost)
    n, s = points.shape
    if lost.dtype != np.bool_ or lost.shape != (n,):
        raise UserError(
            f"lost must be {n} booleans, one per sample, got {lost.dtype} of shape {lost.shape}"
        )
    n_lost = int(lost.sum())
    if n_lost in (0, n):
        raise UserError(
            f"learning a border needs samples on both sides, got {n_lost} lost of {n}; without "
            "any, report the binomial bound of the probability instead"
        )
    features = _features(points)
    prior = np.repeat(list(PRIOR_DEVIATION.values()), [1, s, s * (s + 1) // 2])
    signed = SHARPNESS * np.where(lost, 1.0, -1.0)[:, None] * features * prior

    regression = LogisticRegression(solver="newton-cholesky", fit_intercept=False)
    start = regression.fit(features * prior, lost).coef_[0]
    borders = np.empty((N_DRAWS, prior.size))
    border_chain(signed, start, N_BEFORE, N_BETWEEN, rng, borders)
    return FailureRegion(borders=borders * prior, n_parameters=s)


@dataclass(frozen=True, kw_only=True)
class Loss:
    """Probability of loss with its interval.

    Parameters
    ----------
    probability
        Estimate [-].
    lower, upper
        Ends of its interval [-].
    region
        The learnt region; None where no sample was lost.
    """

    probability: float
    lower: float
    upper: float
    region: FailureRegion | None

    def lost_probability(self, points: npt.ArrayLike) -> FloatArray:
        """Probability (point,) that a sample at each point (point, parameter) is lost [-]."""
        if self.region is None:
            return np.zeros(len(np.asarray(points)))
        return self.region.lost_probability(points)


def learnt_loss(
    points: npt.ArrayLike,
    lost: npt.ArrayLike,
    population: npt.ArrayLike,
    rng: np.random.Generator,
    confidence: float = 0.95,
) -> Loss:
    """Probability of loss from the learnt region, or, without a lost sample, by counting.

    With lost samples the interval is the credible one of the region.  Without, the estimate is
    zero and the upper end the exact binomial one for samples drawn at random; for a design that
    prefers the tails it is too wide.

    Parameters
    ----------
    points : (sample, parameter)
        Every standardised sample, held or lost [-].
    lost : (sample,) of bool
        Whether each sample was lost.
    population : (point, parameter)
        Equally likely draws from the input density, standardised [-].
    rng
        Source of the draws of the border.
    confidence
        Two-sided confidence of the interval [-].

    Returns
    -------
    loss
        Probability, interval and region.

    Raises
    ------
    UserError
        As `fit_failure_region` and `FailureRegion.total_probability`, or if the confidence lies
        outside (0, 1).

    References
    ----------
    Clopper, Pearson, Biometrika 26 (1934) 404-413.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> points, population = rng.normal(size=(60, 2)), rng.normal(size=(1000, 2))
    >>> loss = learnt_loss(points, np.zeros(60, dtype=bool), population, rng)
    >>> loss.probability
    0.0
    >>> round(loss.upper, 3)  # none of 60 lost
    0.06
    """
    lost = np.asarray(lost)
    if not 0.0 < confidence < 1.0:
        raise UserError(f"confidence must lie in (0, 1), got {confidence}")
    if lost.size and not lost.any():
        bound = binomtest(0, lost.size).proportion_ci(confidence, "exact")
        return Loss(probability=0.0, lower=0.0, upper=float(bound.high), region=None)
    region = fit_failure_region(points, lost, rng)
    total = region.total_probability(population)
    outside = 0.5 * (1.0 - confidence)
    lower, upper = np.quantile(total, [outside, 1.0 - outside])
    probability = float(np.clip(total.mean(), lower, upper))
    return Loss(probability=probability, lower=float(lower), upper=float(upper), region=region)


def border_batch(
    region: FailureRegion,
    occupied: npt.ArrayLike,
    candidates: npt.ArrayLike,
    n_new: int,
    *,
    scores: FloatArray | None = None,
) -> IntArray:
    """Candidates that most reduce the variance of the probability of loss.

    With I_d(c) the outcome at c and P_d the probability of being lost, both for border d, the
    variance of P that a run at c takes away is cov(I(c), P)²/var I(c).  After each choice the part
    of I and P that the chosen outcome explains linearly is removed.

    Parameters
    ----------
    region
        The learnt region.
    occupied : (sample, parameter)
        Every sample so far, standardised [-].
    candidates : (candidate, parameter)
        Equally likely draws from the input density, standardised [-].
    n_new
        How many to choose.
    scores : (n_new,), optional
        Receives the variance that each candidate takes away at the time it was chosen [-].

    Returns
    -------
    chosen : (n_new,)
        Indices into ``candidates``, in the order of choice, all different.

    Raises
    ------
    UserError
        If arrays do not fit or fewer than ``n_new`` candidates are new.

    References
    ----------
    docs/theory/adaptive_sampling.md, sec. 5.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> points = rng.normal(size=(60, 2))
    >>> region = fit_failure_region(points, points[:, 0] < -1.0, rng)
    >>> border_batch(region, points, [[2.0, 0.0], [-1.0, 0.0]], 1)
    array([1])
    """
    occupied = checked_points(occupied, region.n_parameters)
    candidates = checked_points(candidates, region.n_parameters)
    new = np.flatnonzero(cKDTree(occupied).query(candidates)[0] > 0.0)
    if not 1 <= n_new <= new.size:
        raise UserError(
            f"a batch must have between 1 and {new.size} points, as many as there are candidates "
            f"not run yet, got {n_new}; draw more candidates"
        )
    total = region.total_probability(candidates)
    total = total - total.mean()
    doubt = region.lost_probability(candidates[new])
    pool = new[np.argsort(-doubt * (1.0 - doubt), kind="stable")[: max(N_POOL, n_new)]]
    outcome = region._by_border(candidates[pool])
    outcome = outcome - outcome.mean(axis=1, keepdims=True)
    chosen = np.empty(n_new, dtype=np.int64)
    free = np.ones(pool.size, dtype=bool)
    for k in range(n_new):
        square = np.einsum("cd,cd->c", outcome, outcome)
        known = square <= SETTLED * outcome.shape[1]
        gain = np.where(known, 0.0, (outcome @ total) ** 2 / np.where(known, 1.0, square))
        best = int(np.argmax(np.where(free, gain, -1.0)))
        free[best] = False
        chosen[k] = pool[best]
        if scores is not None:
            scores[k] = gain[best] / total.size
        if not known[best]:
            explained = outcome[best] / np.sqrt(square[best])
            total = total - (total @ explained) * explained
            outcome = outcome - np.outer(outcome @ explained, explained)
    return chosen


def _features(points: FloatArray) -> FloatArray:
    """Constant, inputs, squares and products (point, feature)."""
    s = points.shape[1]
    products = [points[:, i] * points[:, j] for i in range(s) for j in range(i, s)]
    return np.column_stack([np.ones(points.shape[0]), points, *products])
