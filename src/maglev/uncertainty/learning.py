"""Learning functions: scores of candidates, and batches of the next points.

Both criteria have the same form, ``batch(surrogate, occupied, candidates, n_new, ...)``:
``taylor_batch`` is the published one and uses the surrogate alone; ``tail_batch`` uses the input
density and the levels of the limits too, and needs a surrogate with a standard deviation.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from maglev.arrays import FloatArray, IntArray
from maglev.errors import UserError
from maglev.uncertainty.samples import weighted_quantile
from maglev.uncertainty.surrogate import Surrogate, SurrogateWithDeviation, checked_points

AGGREGATES = ("sum", "maximum")
"""Ways to combine the scores of several responses: their sum, or the largest."""

EXCEEDANCES = (1e-1, 1e-2, 1e-3)
"""Probabilities of exceedance whose limits guide the choice, by default [-]."""

BAND = 0.1
"""Half-width of the band around a limit in which the surrogate must be accurate, over the standard
deviation of the response [-]; assumed."""

N_NODES = 256
"""Number of nodes that represent the neighbourhood of one limit; assumed."""

N_POOL = 1024
"""Largest number of candidates compared in full, nodes first; assumed."""

SETTLED = 1e-8
"""Variance, over that of the response, below which a candidate is taken as known [-];
assumed, a hundred times the nugget of the Kriging."""


def taylor_scores(
    distance: npt.ArrayLike, remainder: npt.ArrayLike, diameter: float, aggregate: str = "sum"
) -> FloatArray:
    """Score J = D/max D + w R/max R with w = 1 − D/L, of several responses at once.

    Parameters
    ----------
    distance : (candidate,)
        Distance D to the nearest sample [-].
    remainder : (candidate, response)
        Taylor remainder R [any unit, one per response].
    diameter
        Largest distance L in the domain [-].
    aggregate
        ``"sum"`` or ``"maximum"`` over the responses, each remainder over its own largest.

    Returns
    -------
    score : (candidate,)
        J [-].

    Raises
    ------
    UserError
        If the aggregate is unknown or every candidate is a sample already.

    References
    ----------
    Mo et al., Water Resour. Res. 53 (2017) 10802–10823; docs/theory/adaptive_sampling.md, sec. 1.

    Examples
    --------
    >>> taylor_scores([0.5, 1.0], [[0.2], [0.1]], diameter=2.0)
    array([1.25, 1.25])
    """
    distance, remainder = np.asarray(distance, float), np.asarray(remainder, float)
    _check_aggregate(aggregate)
    farthest = np.max(distance)
    if not farthest > 0.0:
        raise UserError(
            f"all {distance.size} candidates are samples already, expected some that are not; "
            "draw other candidates"
        )
    largest = np.max(remainder, axis=0)
    relative = remainder / np.where(largest > 0.0, largest, 1.0)
    weight = 1.0 - distance / diameter
    score = (distance / farthest)[:, None] + weight[:, None] * relative
    return score.sum(axis=1) if aggregate == "sum" else score.max(axis=1)


def taylor_remainder(surrogate: Surrogate, candidates: npt.ArrayLike) -> FloatArray:
    """Difference between the surrogate and its tangent at the nearest training point.

    R = |ŷ(c) − [Y_nn + ∇ŷ(u_nn)ᵀ(c − u_nn)]|.

    Parameters
    ----------
    surrogate
        The fitted surrogate.
    candidates : (candidate, parameter)
        Standardised points [-].

    Returns
    -------
    remainder : (candidate, response)
        R [unit of the response].

    Raises
    ------
    UserError
        If ``candidates`` are not finite or have another number of parameters.

    References
    ----------
    Mo et al., Water Resour. Res. 53 (2017) 10802–10823; docs/theory/adaptive_sampling.md, sec. 1.

    Examples
    --------
    >>> from maglev.uncertainty.rbf import fit_rbf
    >>> points = np.array([[0.0], [1.0], [2.0]])
    >>> line = fit_rbf(points, 3.0 * points)  # its own tangent everywhere
    >>> bool(np.abs(taylor_remainder(line, [[0.5]])).max() < 1e-9)
    True
    """
    candidates = checked_points(candidates, surrogate.points.shape[1])
    nearest = cKDTree(surrogate.points).query(candidates)[1]
    step = candidates - surrogate.points[nearest]
    slope = surrogate.gradient(surrogate.points)[nearest]
    tangent = surrogate.values[nearest] + np.einsum("crp,cp->cr", slope, step)
    return np.abs(surrogate.predict(candidates) - tangent)


def taylor_batch(
    surrogate: Surrogate,
    occupied: npt.ArrayLike,
    candidates: npt.ArrayLike,
    n_new: int,
    *,
    aggregate: str = "sum",
    held_probability: npt.ArrayLike | None = None,
    scores: FloatArray | None = None,
) -> IntArray:
    """Candidates of the largest score J, chosen one by one.

    After each choice the remainder of the chosen candidate is zero and it counts as a sample for
    D and w; the remainders of the others wait for the next fit.

    Parameters
    ----------
    surrogate
        The surrogate of the samples that held.
    occupied : (sample, parameter)
        Every sample so far, lost ones included [-].
    candidates : (candidate, parameter)
        Standardised points to choose from [-].
    n_new
        How many to choose.
    aggregate
        ``"sum"`` or ``"maximum"`` over the responses.
    held_probability : (candidate,)
        Probability that a candidate is not lost, which multiplies its score; 1 if not given.
    scores : (n_new,), optional
        Receives the score of each candidate at the time it was chosen [-].

    Returns
    -------
    chosen : (n_new,)
        Indices into ``candidates``, in the order of choice, all different.

    Raises
    ------
    UserError
        If the aggregate is unknown, arrays do not fit, or fewer than ``n_new`` candidates are new.

    References
    ----------
    Mo et al., Water Resour. Res. 53 (2017) 10802–10823; docs/theory/adaptive_sampling.md, sec. 1.

    Examples
    --------
    >>> from maglev.uncertainty.rbf import fit_rbf
    >>> points = np.array([[0.0], [1.0], [2.0]])
    >>> curve = fit_rbf(points, points**2)
    >>> taylor_batch(curve, points, [[0.1], [3.0]], 1)
    array([0])
    """
    occupied, candidates, held, distance = _checked(
        surrogate, occupied, candidates, n_new, held_probability
    )
    _check_aggregate(aggregate)
    remainder = taylor_remainder(surrogate, candidates)
    domain = _diameter(np.concatenate([occupied, candidates]))
    chosen = np.empty(n_new, dtype=np.int64)
    for k in range(n_new):
        score = held * taylor_scores(distance, remainder, domain, aggregate)
        score[distance == 0.0] = -np.inf
        best = chosen[k] = np.argmax(score)
        if scores is not None:
            scores[k] = score[best]
        remainder[best] = 0.0
        distance = np.minimum(distance, np.linalg.norm(candidates - candidates[best], axis=1))
    return chosen


def predicted_limits(
    values: npt.ArrayLike,
    exceedances: Sequence[float],
    held_probability: npt.ArrayLike | None = None,
) -> FloatArray:
    """Limits of a predicted sample whose points are lost with given probabilities.

    The smallest y with mean(1 − h) + mean(h · I{Y > y}) ≤ P; infinite if losses alone exceed P.

    Parameters
    ----------
    values : (point, response)
        Predictions at equally likely points [unit of the response].
    exceedances : (level,)
        Probabilities of exceedance P [-].
    held_probability : (point,)
        Probability h that a point is not lost [-]; 1 if not given.

    Returns
    -------
    limits : (level, response)
        Limits [unit of the response].

    Raises
    ------
    UserError
        If a probability does not lie between 0 and 1.

    Examples
    --------
    >>> predicted_limits(np.arange(100.0)[:, None], [0.1, 0.05])
    array([[89.],
           [94.]])
    """
    values = np.asarray(values, float)
    n = values.shape[0]
    held = np.ones(n) if held_probability is None else np.asarray(held_probability, float)
    levels = np.asarray(exceedances, float)
    if levels.ndim != 1 or not ((levels > 0.0) & (levels < 1.0)).all():
        raise UserError(f"exceedances must lie between 0 and 1, got {exceedances}")
    if held.shape != (n,) or not ((held >= 0.0) & (held <= 1.0)).all():
        raise UserError(
            f"held_probability must be {n} numbers between 0 and 1, one per point, got shape "
            f"{held.shape}"
        )
    return _quantiles(values, held / n, levels - np.mean(1.0 - held))


def tail_batch(
    surrogate: SurrogateWithDeviation,
    occupied: npt.ArrayLike,
    candidates: npt.ArrayLike,
    n_new: int,
    *,
    aggregate: str = "sum",
    exceedances: Sequence[float] = EXCEEDANCES,
    held_probability: npt.ArrayLike | None = None,
    scores: FloatArray | None = None,
) -> IntArray:
    """Candidates that most reduce the variance of the surrogate near the limits.

    Every limit of every response is a target.  Its neighbourhood is a set of nodes, drawn from the
    candidates with weight exp(−(ŷ − y_P)²/2v)/√v, v = s² + (b σ)²: points that are predicted near
    the limit, or so uncertain that they may be.  As candidates are draws from the input density, so
    are the nodes.  The gain of a candidate c for a target is the mean over its nodes of the
    reduction of variance by a run at c, cov(node, c)²/s²(c), over the variance of the response.
    After each choice variances and covariances are updated as if the point had been run; this needs
    no value.

    Parameters
    ----------
    surrogate
        The surrogate of the samples that held, with covariances.
    occupied : (sample, parameter)
        Every sample so far, lost ones included [-].
    candidates : (candidate, parameter)
        Equally likely draws from the input density, standardised [-].
    n_new
        How many to choose.
    aggregate
        ``"sum"`` or ``"maximum"`` of the gain over targets.
    exceedances : (level,)
        Probabilities of exceedance whose limits are wanted [-].
    held_probability : (candidate,)
        Probability that a candidate is not lost; weights nodes and gains; 1 if not given.
    scores : (n_new,), optional
        Receives the gain of each candidate at the time it was chosen [-].

    Returns
    -------
    chosen : (n_new,)
        Indices into ``candidates``, in the order of choice, all different.

    Raises
    ------
    UserError
        If the surrogate has no covariance, the aggregate is unknown, arrays do not fit, or fewer
        than ``n_new`` candidates are new.

    References
    ----------
    Picheny et al., J. Mech. Des. 132 (2010) 071008 (targeted mean square error); Chevalier et al.,
    Technometrics 56 (2014) 455–465 (batches); docs/theory/adaptive_sampling.md.

    Examples
    --------
    >>> from maglev.uncertainty.kriging import conditioned_kriging
    >>> points = np.linspace(-2.0, 2.0, 5)[:, None]
    >>> process = conditioned_kriging(points, points, length=[[1.0]], amplitude=[1.0])
    >>> candidates = np.linspace(-3.0, 3.0, 61)[:, None]
    >>> (chosen,) = tail_batch(process, points, candidates, 1, exceedances=(0.05,))
    >>> bool(candidates[chosen, 0] > 2.0)  # the limit is at 2.7
    True
    """
    if not hasattr(surrogate, "covariance"):
        raise UserError(
            f"the tail criterion needs a surrogate with a covariance, got "
            f"{type(surrogate).__name__}; use Kriging or the Taylor criterion"
        )
    occupied, candidates, held, distance = _checked(
        surrogate, occupied, candidates, n_new, held_probability
    )
    _check_aggregate(aggregate)
    values = surrogate.predict(candidates)
    deviation = surrogate.standard_deviation(candidates)
    scale = np.std(surrogate.values, axis=0)
    limits = predicted_limits(values, exceedances, held)
    # where losses alone exceed the probability, the limit of the samples that hold is the target
    standing = _quantiles(values, held / held.sum(), np.asarray(exceedances, float))
    limits = np.where(np.isfinite(limits), limits, standing)

    targets = [
        (response, _nodes(values[:, response] - limit, deviation[:, response], spread, held))
        for response, spread in enumerate(scale)
        for limit in limits[:, response]
    ]
    new = np.flatnonzero(distance > 0.0)
    near = np.unique(np.concatenate([nodes for _, nodes in targets] + [new[:n_new]]))
    near = near[distance[near] > 0.0]
    if near.size > N_POOL:
        near = near[np.linspace(0, near.size - 1, N_POOL).round().astype(int)]
    pool = np.union1d(near, new[: max(N_POOL - near.size, n_new)])

    joint = [  # per target: response, covariance (node, pool)
        (response, surrogate.covariance(response, candidates[nodes], candidates[pool]))
        for response, nodes in targets
    ]
    variance = deviation[pool].T ** 2  # (response, pool)
    rows: list[list[FloatArray]] = [[] for _ in scale]
    free = np.ones(pool.size, dtype=bool)
    chosen = np.empty(n_new, dtype=np.int64)
    for k in range(n_new):
        gains = np.empty((len(joint), pool.size))
        for target, (response, between) in enumerate(joint):
            known = variance[response] <= SETTLED * scale[response] ** 2
            taken = np.mean(between**2, axis=0) / np.where(known, np.inf, variance[response])
            gains[target] = taken / scale[response] ** 2
        gain = gains.sum(axis=0) if aggregate == "sum" else gains.max(axis=0)
        gain = np.where(free, held[pool] * gain, -np.inf)
        best = int(np.argmax(gain))
        free[best] = False
        chosen[k] = pool[best]
        if scores is not None:
            scores[k] = gain[best]
        for response, spread in enumerate(scale):
            if variance[response, best] <= SETTLED * spread**2:
                continue
            root = np.sqrt(variance[response, best])
            row = surrogate.covariance(response, candidates[pool[[best]]], candidates[pool])[0]
            row = (row - sum(earlier[best] * earlier for earlier in rows[response])) / root
            for number, (owner, between) in enumerate(joint):
                if owner == response:
                    joint[number] = (owner, between - np.outer(between[:, best] / root, row))
            variance[response] = np.maximum(variance[response] - row**2, 0.0)
            rows[response].append(row)
    return chosen


CRITERIA = {"taylor": taylor_batch, "tail": tail_batch}
"""Criteria by their names in a configuration."""


def _quantiles(values: FloatArray, weight: FloatArray, beyond: FloatArray) -> FloatArray:
    """Weighted quantile (level, response); infinite where no point may lie beyond."""
    rounding = 1e-6 / values.shape[0]  # of the sums, far below one point's share
    found = [weighted_quantile(one, weight, beyond, rounding) for one in values.T]
    return np.where(beyond[:, None] >= 0.0, np.column_stack(found), np.inf)


def _nodes(excess: FloatArray, deviation: FloatArray, spread: float, held: FloatArray) -> IntArray:
    """Candidates (node,) that represent the neighbourhood of a limit, by systematic sampling."""
    width = np.hypot(deviation, BAND * spread)
    weight = held * np.exp(-0.5 * (excess / width) ** 2) / width
    share = np.cumsum(weight)
    return np.searchsorted(share, (np.arange(N_NODES) + 0.5) / N_NODES * share[-1])


def _checked(
    surrogate: Surrogate,
    occupied: npt.ArrayLike,
    candidates: npt.ArrayLike,
    n_new: int,
    held_probability: npt.ArrayLike | None,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Samples, candidates, their probability to hold and their distance to the nearest sample."""
    n_parameters = surrogate.points.shape[1]
    occupied = checked_points(occupied, n_parameters)
    candidates = checked_points(candidates, n_parameters)
    n = candidates.shape[0]
    held = np.ones(n) if held_probability is None else np.asarray(held_probability, float)
    if held.shape != (n,) or not ((held >= 0.0) & (held <= 1.0)).all():
        raise UserError(
            f"held_probability must be {n} numbers between 0 and 1, one per candidate, got shape "
            f"{held.shape}"
        )
    distance = cKDTree(occupied).query(candidates)[0]
    n_distinct = np.unique(candidates[distance > 0.0], axis=0).shape[0]
    if not 1 <= n_new <= n_distinct:
        raise UserError(
            f"a batch must have between 1 and {n_distinct} points, as many as there are candidates "
            f"not run yet, got {n_new}; draw more candidates"
        )
    return occupied, candidates, held, distance


def _check_aggregate(aggregate: str) -> None:
    if aggregate not in AGGREGATES:
        raise UserError(f"aggregate must be one of {', '.join(AGGREGATES)}, got '{aggregate}'")


def _diameter(points: FloatArray) -> float:
    """Largest distance between two of the points (point, parameter), in blocks of 1024."""
    return max(
        float(cdist(points[start : start + 1024], points[start:]).max())
        for start in range(0, points.shape[0], 1024)
    )
