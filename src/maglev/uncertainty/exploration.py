"""What no run has visited: its probability, runs that make it smaller, and a stop that knows of it.

Two statements, both of standard normal inputs.  A half-space without a run in it lies outside the
convex hull of the runs, so its probability is at most Φ(−ρ), ρ the radius of the largest ball
about the mean within the hull.  And a share of the law lies farther from all runs than a surrogate
reaches.  The first holds for any response that fails beyond one border; the second needs no shape,
but a reach.  Theory: docs/theory/checked.md, sec. 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError, cKDTree
from scipy.stats import norm

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.uncertainty.surrogate import checked_points

MOST_HULL_INPUTS = 5
"""Inputs up to which the hull itself is built; its facets grow as n^(s/2); assumed."""

N_DIRECTIONS = 4096
"""Directions that are compared beyond that, and for each new run; assumed."""

N_DESCENTS, N_STEPS = 16, 60
"""Worst directions that are turned to the worst near them, and turns; assumed."""

REACH = 1.5
"""Distance that a run vouches for, in lengths of the surrogate but at most in deviations of the
inputs [-]; assumed: half the distance over which a response may well change its kind."""

LEAST_RADIUS = 1.15
"""Smallest radius of an exploring point over the distance to be visited [-]; assumed: seven points
then surround two inputs."""


@dataclass(frozen=True, kw_only=True)
class EmptyHalfSpace:
    """The likeliest half-space without a run.

    Parameters
    ----------
    direction : (parameter,)
        Its unit normal, away from the mean [-].
    distance
        Its distance ρ from the mean [-]; negative if the runs do not surround the mean.
    probability
        Φ(−ρ) [-].
    """

    direction: FloatArray
    distance: float

    @property
    def probability(self) -> float:
        """Φ(−ρ) [-]."""
        return float(norm.sf(self.distance))


def empty_half_space(points: npt.ArrayLike, rng: np.random.Generator) -> EmptyHalfSpace:
    """Find the likeliest half-space that holds no run.

    Up to `MOST_HULL_INPUTS` inputs it is a facet of the convex hull, exactly; beyond, the worst of
    many directions, each turned to the worst near it, which may overlook a slightly worse one.

    Parameters
    ----------
    points : (run, parameter)
        Standard normal points [-].
    rng
        Source of the directions; not used where the hull is built.

    Returns
    -------
    half_space
        Normal, distance and probability.

    Raises
    ------
    UserError
        If there is no point, or points are not finite.

    References
    ----------
    Barber, Dobkin, Huhdanpaa, ACM Trans. Math. Softw. 22 (1996) 469-483 (Quickhull);
    docs/theory/checked.md, eq. (9).

    Examples
    --------
    >>> corners = 3.0 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    >>> found = empty_half_space(corners, np.random.default_rng(0))
    >>> found.distance  # a side of the square
    3.0
    """
    points = checked_points(points)
    n, s = points.shape
    if n == 0:
        raise UserError("an empty half-space needs runs to be empty of, got none; give one or more")
    if s == 1:
        ends = np.array([points.max(), -points.min()])
        return EmptyHalfSpace(
            direction=np.array([[1.0], [-1.0]])[ends.argmin()], distance=ends.min()
        )
    if s <= MOST_HULL_INPUTS and n > s:
        try:
            facets = ConvexHull(points).equations
        except QhullError:
            pass  # all in one plane: no facets, yet directions serve
        else:
            worst = int(np.argmin(-facets[:, -1]))
            return EmptyHalfSpace(direction=facets[worst, :-1], distance=float(-facets[worst, -1]))
    directions = unit(rng.standard_normal((N_DIRECTIONS, s)))
    support = (directions @ points.T).max(axis=1)
    found = _descended(directions[np.argsort(support)[:N_DESCENTS]], points)
    return EmptyHalfSpace(direction=found, distance=float((points @ found).max()))


def exploring_points(
    points: npt.ArrayLike, n_new: int, distance: float, rng: np.random.Generator
) -> FloatArray:
    """New points, each in the likeliest half-space that is still empty.

    Each lies in the direction in which the runs reach least, √(s/2) times as far as asked: as the
    24 corners of the 24-cell do for four inputs, which leave no half-space nearer than
    ``distance`` empty.

    Parameters
    ----------
    points : (run, parameter)
        Standard normal points run so far [-].
    n_new
        How many.
    distance
        Distance up to which half-spaces are to be visited, such as Φ⁻¹(1 − P) for a level P [-].
    rng
        Source of the directions.

    Returns
    -------
    new : (n_new, parameter)
        Standard normal points [-].

    Raises
    ------
    UserError
        If there is no point, points are not finite, or a number is not positive.

    References
    ----------
    docs/theory/checked.md, sec. 4.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> design = rng.standard_normal((40, 2))
    >>> new = exploring_points(design, 8, 3.0, rng)
    >>> after = empty_half_space(np.concatenate([design, new]), rng)
    >>> bool(after.distance > empty_half_space(design, rng).distance)
    True
    """
    points = checked_points(points)
    if points.shape[0] == 0 or n_new < 1 or not distance > 0.0:
        raise UserError(
            "exploring needs runs so far, at least one new point and a positive distance, got "
            f"{points.shape[0]}, {n_new} and {distance}"
        )
    s = points.shape[1]
    radius = distance * max(np.sqrt(0.5 * s), LEAST_RADIUS)
    directions = unit(rng.standard_normal((N_DIRECTIONS, s)))
    support = (directions @ points.T).max(axis=1)
    new = np.empty((n_new, s))
    for place in range(n_new):
        known = np.concatenate([points, new[:place]])
        start = directions[np.argsort(support)[:N_DESCENTS]]
        new[place] = radius * _descended(start, known)
        support = np.maximum(support, directions @ new[place])
    return new


def surrounding_directions(
    n_inputs: int, rng: np.random.Generator, n_random: int = 64
) -> FloatArray:
    """Unit directions that surround the mean: axes and corners, for many inputs random pairs.

    Four inputs have the 24-cell, whose hull holds a ball of radius 1/√2.

    Parameters
    ----------
    n_inputs
        Number of inputs s.
    rng
        Turns them as a whole, so that no axis is preferred.
    n_random
        Directions beside the axes beyond `MOST_HULL_INPUTS` inputs.

    Returns
    -------
    directions : (direction, parameter)
        Unit vectors [-], each with its opposite.

    References
    ----------
    Coxeter, Regular Polytopes (1973), sec. 8.2.

    Examples
    --------
    >>> surrounding_directions(4, np.random.default_rng(0)).shape
    (24, 4)
    """
    axes = np.concatenate([np.eye(n_inputs), -np.eye(n_inputs)])
    if n_inputs == 1:
        return axes
    if n_inputs <= MOST_HULL_INPUTS:
        others = unit(np.array(list(product((-1.0, 1.0), repeat=n_inputs))))
    else:
        half = unit(rng.standard_normal((n_random // 2, n_inputs)))
        others = np.concatenate([half, -half])
    turn = np.linalg.qr(rng.standard_normal((n_inputs, n_inputs)))[0]
    return np.concatenate([axes, others]) @ turn


def unvisited_probability(
    points: npt.ArrayLike,
    population: npt.ArrayLike,
    *,
    length: npt.ArrayLike | float = 1.0,
    reach: float = REACH,
    weight: npt.ArrayLike | None = None,
) -> float:
    """Share of the law that lies farther from all runs than they vouch for.

    A run vouches for an ellipsoid about it with half axes ``reach`` times the length, each length
    counted as at most one deviation of its input: a surrogate trained where nothing happens has
    found long lengths and knows nothing.

    Parameters
    ----------
    points : (run, parameter)
        Standard normal points that were run [-].
    population : (point, parameter)
        Draws from the law, or from a proposal with their weights [-].
    length : (parameter,)
        Lengths of the surrogate [-], in deviations of the inputs.
    reach
        How far a run vouches, in lengths [-].
    weight : (point,), optional
        Weights of the population [-]; equal if not given.

    Returns
    -------
    probability
        Share that is farther [-].

    Raises
    ------
    UserError
        If arrays do not fit, or lengths or reach are not positive.

    References
    ----------
    docs/theory/checked.md, sec. 4.

    Examples
    --------
    >>> population = np.random.default_rng(0).standard_normal((10000, 1))
    >>> round(unvisited_probability([[0.0]], population, reach=1.96), 2)
    0.05
    """
    points = checked_points(points)
    population = checked_points(population, points.shape[1])
    axes = np.minimum(np.broadcast_to(np.asarray(length, float), points.shape[1:]), 1.0)
    if not ((axes > 0.0).all() and reach > 0.0):
        raise UserError(f"lengths and reach must be positive, got {axes} and {reach}")
    share = np.ones(population.shape[0]) if weight is None else np.asarray(weight, float)
    if share.shape != population.shape[:1]:
        raise UserError(
            f"weights have shape {share.shape}, expected (point,) = {population.shape[:1]}"
        )
    distance = cKDTree(points / axes).query(population / axes)[0]
    return float(share[distance > reach].sum() / share.sum())


def may_settle(
    changes: npt.ArrayLike, threshold: float, n_rounds: int, unvisited: float, level: float
) -> bool:
    """Whether limits may count as settled: they rest, and what was not visited is rarer than they.

    Parameters
    ----------
    changes : (round,)
        Largest change of a limit in each round, over the deviation [-]; NaN is not small.
    threshold
        Change that counts as small [-].
    n_rounds
        How many of the last rounds must all stay at or below it.
    unvisited
        Probability that no run has visited, such as `EmptyHalfSpace.probability` [-].
    level
        Smallest failure probability whose limit is wanted [-].

    Returns
    -------
    settled
        True if both hold.

    Raises
    ------
    UserError
        If a setting is not positive.

    Examples
    --------
    >>> may_settle([0.3, 0.01, 0.01], 0.05, 2, unvisited=1e-4, level=1e-3)
    True
    >>> may_settle([0.3, 0.01, 0.01], 0.05, 2, unvisited=1e-2, level=1e-3)
    False
    """
    if not (threshold > 0.0 and n_rounds >= 1 and level > 0.0):
        raise UserError(
            f"threshold, rounds and level must be positive, got {threshold}, {n_rounds}, {level}"
        )
    last = np.asarray(changes, float)[-n_rounds:]
    return bool(last.size == n_rounds and (last <= threshold).all() and unvisited <= level)


def with_unvisited(lost_interval: tuple[float, float], unvisited: float) -> tuple[float, float]:
    """Interval of the probability of loss that allows all that was not visited to be lost.

    Given to `maglev.uncertainty.reliability.surrogate_limits` as ``lost_interval``, it leaves a
    limit without an upper end where the unvisited is as likely as its level.

    Parameters
    ----------
    lost_interval
        Lower and upper end without it [-].
    unvisited
        Probability that no run has visited [-].

    Returns
    -------
    lower, upper
        The same lower and the larger upper end, below one [-].

    Examples
    --------
    >>> lower, upper = with_unvisited((0.0, 0.001), 0.002)
    >>> round(upper, 6)
    0.003
    """
    lower, upper = lost_interval
    return lower, min(upper + unvisited, 1.0 - 1e-12)


def unit(vectors: FloatArray) -> FloatArray:
    """Vectors (vector, parameter) brought to length one.

    Examples
    --------
    >>> unit(np.array([[3.0, 4.0]]))
    array([[0.6, 0.8]])
    """
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _descended(directions: FloatArray, points: FloatArray) -> FloatArray:
    """The direction (parameter,) of least support, from some to the worst near them."""
    best = directions[0]
    least = float((points @ best).max())
    for step in range(N_STEPS):
        farthest = points[(directions @ points.T).argmax(axis=1)]
        support = np.einsum("ij,ij->i", directions, farthest)
        if support.min() < least:
            least, best = float(support.min()), directions[support.argmin()]
        across = farthest - support[:, None] * directions
        size = np.linalg.norm(across, axis=1, keepdims=True)
        directions = unit(directions - 0.3 / (1.0 + step) * across / np.maximum(size, 1e-12))
    return best
