"""Point sets of random inputs with an assigned probability per point.

``gf_points`` lowers the GF-discrepancy by rearrangement; ``sobol_points`` is a one-stage set of
equal weights.  Theory: docs/theory/point_sets.md.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree
from scipy.stats import qmc

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.uncertainty.distributions import Marginals

COUNTING_POINTS = 2**20
"""Counting points per set: relative counting error below 10 % for a cell of probability 1e-4."""

COUNTED_INPUTS = 4
"""Largest number of inputs whose Voronoi cells are counted.  With more, a few cells near the mean
take most of the probability (of 1000 points, those of 20 inputs are worth 480 of equal weight), and
points of equal weight are the more accurate ones: docs/benchmarks/many.md."""

_SOBOL_BITS = 30  # scipy.stats.qmc.Sobol's own default: points are multiples of 2**-30
_CHUNK = 2**16  # counting points held in memory at once, assumed


@dataclass(frozen=True)
class PointSet:
    """Points of the random inputs and the probability that each represents.

    Attributes
    ----------
    points : (sample, input)
        Physical points [unit of each input].
    standard : (sample, input)
        The same in standard form (x - mean) / deviation [-].
    probability : (sample,)
        Assigned probability of each point [-], sums to one.
    counting_error : (sample,)
        Standard error of ``probability`` by counting, sqrt(P / N) [-]; zero where weights are
        equal by construction.
    discrepancy
        GF-discrepancy of ``points`` with ``probability`` [-].
    n_counting
        Number of counting points N behind ``probability``; zero where nothing was counted.
    n_floored
        Number of cells without a counting point, whose probability was set to that of half a
        counting point before normalising.
    """

    points: FloatArray
    standard: FloatArray
    probability: FloatArray
    counting_error: FloatArray
    discrepancy: float
    n_counting: int
    n_floored: int


def gf_points(
    marginals: Marginals, n: int, rng: np.random.Generator, counting: int = COUNTING_POINTS
) -> PointSet:
    """GF-discrepancy point set: scrambled Sobol' points, rearranged.

    The points are rearranged with equal weights, then, of up to ``COUNTED_INPUTS`` inputs, with the
    probabilities of their Voronoi cells, which are counted once in between (a second count would
    spoil the moments).  Points of more inputs keep their equal weights.  The discrepancy of the
    result is half the largest assigned probability.

    Parameters
    ----------
    marginals
        The random inputs.
    n
        Number of points, two or more.
    rng
        Source of the scrambling of both the points and the counting points.
    counting
        Number of counting points, a power of two, at least ``n``; of no effect on points that keep
        equal weights.

    Returns
    -------
    point_set
        The points of the last rearrangement with the probabilities that it was made with.

    Raises
    ------
    UserError
        If ``n`` is less than two or ``counting`` is not a power of two of at least ``n``.

    Warns
    -----
    UserWarning
        If cells without a counting point had to be given a floor, see ``n_floored``.

    References
    ----------
    Chen, Yang, Li, Structural Safety 59 (2016) 20-31; docs/theory/point_sets.md.

    Examples
    --------
    >>> from scipy.stats import norm
    >>> inputs = Marginals([norm(10.0, 2.0), norm(5.0, 1.0)])
    >>> found = gf_points(inputs, 32, np.random.default_rng(1), counting=2**12)
    >>> print(f"{found.probability.sum():.6f}")
    1.000000
    """
    _check_size(n)
    equal = np.full(n, 1.0 / n)
    first = rearranged(marginals.from_unit_cube(_sobol_unit(marginals.n, n, rng)), equal, marginals)
    if marginals.n > COUNTED_INPUTS:
        return _equal_weights(first, marginals)
    probability, counting_error, n_floored = voronoi_probability(first, marginals, rng, counting)
    points = rearranged(first, probability, marginals)
    return PointSet(
        points=points,
        standard=marginals.to_standard(points),
        probability=probability,
        counting_error=counting_error,
        discrepancy=gf_discrepancy(points, probability, marginals),
        n_counting=counting,
        n_floored=n_floored,
    )


def sobol_points(marginals: Marginals, n: int, rng: np.random.Generator) -> PointSet:
    """One-stage set of scrambled Sobol' points of equal weight.

    They are the first ``n`` points of the sequence; only powers of two are balanced.

    Parameters
    ----------
    marginals
        The random inputs.
    n
        Number of points, two or more.
    rng
        Source of the scrambling.

    Returns
    -------
    point_set
        The points with probability 1/n each.

    Raises
    ------
    UserError
        If ``n`` is less than two.

    References
    ----------
    Owen, J. Complexity 14 (1998) 466-489; scipy.stats.qmc.Sobol.

    Examples
    --------
    >>> from scipy.stats import norm
    >>> found = sobol_points(Marginals([norm(10.0, 2.0)]), 4, np.random.default_rng(1))
    >>> found.probability
    array([0.25, 0.25, 0.25, 0.25])
    """
    _check_size(n)
    return _equal_weights(marginals.from_unit_cube(_sobol_unit(marginals.n, n, rng)), marginals)


def rearranged(points: npt.ArrayLike, weights: npt.ArrayLike, marginals: Marginals) -> FloatArray:
    """Points shifted, input by input and in order, to the quantiles of their weights.

    ``x_qi <- F_i^-1( sum_k w_k I{x_ki < x_qi} + w_q / 2 )``, after which the GF-discrepancy is
    half the largest weight.  A second rearrangement with the same weights changes nothing.

    Parameters
    ----------
    points : (sample, input)
        Physical points [unit of each input], no two alike in any input.
    weights : (sample,)
        Weights of the points [-], positive, summing to one.
    marginals
        The random inputs.

    Returns
    -------
    moved : (sample, input)
        Physical points [unit of each input].

    Raises
    ------
    UserError
        If shapes disagree, a value is not finite, a weight is not positive, the weights do not
        sum to one, or two points share the value of an input.

    References
    ----------
    Chen, Yang, Li, Structural Safety 59 (2016) 20-31, the first and second
    rearrangement; docs/theory/point_sets.md, eqs. (3) and (5).

    Examples
    --------
    >>> from scipy.stats import norm
    >>> inputs = Marginals([norm()])
    >>> rearranged([[3.0], [-2.0]], [0.5, 0.5], inputs).round(4)  # to the quartiles
    array([[ 0.6745],
           [-0.6745]])
    """
    points, weights = _checked_points(points, weights, marginals)
    order = np.argsort(points, axis=0)
    ties = np.diff(np.take_along_axis(points, order, axis=0), axis=0) == 0.0
    if ties.any():
        raise UserError(
            f"input {int(np.flatnonzero(ties.any(axis=0))[0])} has the same value at several "
            "points, expected distinct values; remove duplicate points before rearranging"
        )
    ranked = weights[order]
    centre = np.empty_like(points)
    np.put_along_axis(centre, order, np.cumsum(ranked, axis=0) - 0.5 * ranked, axis=0)
    return marginals.from_unit_cube(centre)


def voronoi_probability(
    points: npt.ArrayLike,
    marginals: Marginals,
    rng: np.random.Generator,
    counting: int = COUNTING_POINTS,
) -> tuple[FloatArray, FloatArray, int]:
    """Probability of each point's Voronoi cell, by counting scrambled Sobol' points.

    Nearness is Euclidean in standard form.  A cell without a counting point would have the
    probability zero; it is given that of half a counting point, and a warning says so.

    Parameters
    ----------
    points : (sample, input)
        Physical points [unit of each input].
    marginals
        The random inputs.
    rng
        Source of the scrambling of the counting points.
    counting
        Number of counting points N, a power of two, at least the number of points.

    Returns
    -------
    probability : (sample,)
        Assigned probability [-], sums to one.
    counting_error : (sample,)
        Standard error of ``probability``, sqrt(P / N) [-]: that of plain random counting, an
        upper estimate for Sobol' points.
    n_floored
        Number of cells without a counting point.

    Raises
    ------
    UserError
        If two points coincide or ``counting`` is not a power of two of at least their number.

    Warns
    -----
    UserWarning
        If a cell holds no counting point.

    References
    ----------
    Chen, Yang, Li, Structural Safety 59 (2016) 20-31; docs/theory/point_sets.md, eq. (4).

    Examples
    --------
    >>> from scipy.stats import norm
    >>> inputs, rng = Marginals([norm()]), np.random.default_rng(1)
    >>> probability, _, _ = voronoi_probability([[-1.0], [1.0]], inputs, rng, counting=2**12)
    >>> probability.round(2)
    array([0.5, 0.5])
    """
    standard = marginals.to_standard(points)
    n = len(standard)
    if len(np.unique(standard, axis=0)) < n:
        raise UserError(
            f"points must be distinct, got {n - len(np.unique(standard, axis=0))} duplicates "
            f"among {n}; a duplicate's Voronoi cell is not defined, remove it"
        )
    if counting < n or counting & (counting - 1):
        raise UserError(
            f"counting points must be a power of two of at least the {n} points, got {counting}; "
            f"use {COUNTING_POINTS}"
        )
    tree = cKDTree(standard)
    sobol = qmc.Sobol(marginals.n, bits=_SOBOL_BITS, rng=rng)
    counts = np.zeros(n, dtype=np.int64)
    chunk = min(counting, _CHUNK)
    for _ in range(counting // chunk):
        sample = marginals.from_unit_cube(sobol.random(chunk) + 0.5 ** (_SOBOL_BITS + 1))
        nearest = tree.query(marginals.to_standard(sample))[1]
        counts += np.bincount(nearest, minlength=n)
    n_floored = int(np.count_nonzero(counts == 0))
    if n_floored:
        warnings.warn(
            f"{n_floored} of {n} Voronoi cells hold none of {counting} counting points; each is "
            "given the probability of half a counting point; use more counting points",
            UserWarning,
            stacklevel=2,
        )
    floored = np.where(counts == 0, 0.5, counts)
    probability = floored / floored.sum()
    return probability, np.sqrt(probability / counting), n_floored


def gf_discrepancy(points: npt.ArrayLike, weights: npt.ArrayLike, marginals: Marginals) -> float:
    """GF-discrepancy, the largest marginal Kolmogorov distance of a weighted point set.

    ``D_GF = max_i sup_x |F_ni(x) - F_i(x)|`` with ``F_ni(x) = sum_q P_q I{x_qi <= x}``.

    Parameters
    ----------
    points : (sample, input)
        Physical points [unit of each input].
    weights : (sample,)
        Weights of the points [-], positive, summing to one.
    marginals
        The random inputs.

    Returns
    -------
    discrepancy
        D_GF [-], between 0 and 1.

    Raises
    ------
    UserError
        If shapes disagree, a value is not finite, a weight is not positive or the weights do not
        sum to one.

    References
    ----------
    Chen, Yang, Li, Structural Safety 59 (2016) 20-31; docs/theory/point_sets.md, eq. (1).

    Examples
    --------
    >>> from scipy.stats import norm
    >>> gf_discrepancy([[0.0]], [1.0], Marginals([norm()]))
    0.5
    """
    points, weights = _checked_points(points, weights, marginals)
    exact = marginals.to_unit_cube(points)
    largest = 0.0
    for i in range(marginals.n):
        _, first, inverse = np.unique(points[:, i], return_index=True, return_inverse=True)
        jump = np.bincount(inverse, weights=weights)
        above = np.cumsum(jump)
        at = exact[first, i]
        largest = max(largest, float(np.max(np.maximum(above - at, at - (above - jump)))))
    return largest


def _sobol_unit(dimension: int, n: int, rng: np.random.Generator) -> FloatArray:
    """First ``n`` scrambled Sobol' points, moved by half their resolution off 0."""
    sobol = qmc.Sobol(dimension, bits=_SOBOL_BITS, rng=rng)
    return sobol.random_base2((n - 1).bit_length())[:n] + 0.5 ** (_SOBOL_BITS + 1)


def _equal_weights(points: FloatArray, marginals: Marginals) -> PointSet:
    n = len(points)
    probability = np.full(n, 1.0 / n)
    return PointSet(
        points=points,
        standard=marginals.to_standard(points),
        probability=probability,
        counting_error=np.zeros(n),
        discrepancy=gf_discrepancy(points, probability, marginals),
        n_counting=0,
        n_floored=0,
    )


def _check_size(n: int) -> None:
    if n < 2:
        raise UserError(f"a point set needs at least 2 points, got {n}")


def _checked_points(
    points: npt.ArrayLike, weights: npt.ArrayLike, marginals: Marginals
) -> tuple[FloatArray, FloatArray]:
    points, weights = np.asarray(points, dtype=float), np.asarray(weights, dtype=float)
    if points.ndim != 2 or points.shape[1] != marginals.n or weights.shape != points.shape[:1]:
        raise UserError(
            f"points and weights have shapes {points.shape} and {weights.shape}, expected "
            f"(sample, input = {marginals.n}) and (sample,)"
        )
    if not np.all(np.isfinite(points)):
        raise UserError("points must be finite, got NaN or infinity; leave those points out")
    if not np.all(weights > 0.0):
        raise UserError(f"weights must be positive, got {np.min(weights)} as the smallest")
    if abs(weights.sum() - 1.0) > 1e-9:  # far above rounding, far below one counted point
        raise UserError(
            f"weights must sum to 1, got {weights.sum()}; divide them by their sum if the rest "
            "was left out on purpose"
        )
    return points, weights
