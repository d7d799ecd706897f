"""Density of a response over time, from weighted histories, and histories thinned for it.

The generalised density evolution equation with the true velocities of the histories, in a
coordinate that is standardised at every time.  Theory: docs/theory/pdem.md, section 7.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.errors import UserError
from maglev.uncertainty import _kernels
from maglev.uncertainty.gdee import (
    Limiter,
    checked_histories,
    limiter_code,
    margin_of,
    silverman_bandwidth,
)

SMALLEST_SPREAD = 0.02
"""Least deviation that a time is standardised by, over the largest of all times [-].

Where all histories coincide, as before the train arrives, the density is a spike of this width and
not of none.  Assumed: a fiftieth of the widest density is a line in a figure.
"""

_RULE_POINTS = 24  # histories whose kernels the mesh rule measures, assumed
_RULE_ROUNDS = 6  # the rule halves its error or better per round, assumed
_RULE_TOLERANCE = 0.05  # of the bandwidth, well below its own uncertainty, assumed
_VANISHING = 1e-16  # probability of a cell below which the mesh may end, less than rounding


@dataclass(frozen=True)
class DensityInTime:
    """Density of a response at every time by the generalised density evolution equation.

    Attributes
    ----------
    cell_centre : (time, cell)
        Centres of the cells [unit of the response]; evenly spaced at each time.
    density : (time, cell)
        Mean density in each cell [1/unit]; its integral is ``held``.
    held : (time,)
        Probability of the histories that are still there [-].
    mean, deviation : (time,)
        Of the weighted histories given that they are there [unit].
    cell_width : (time,)
        Width of the cells [unit].
    kernel_deviation : (time,)
        Root mean square deviation of the numerical kernel that came out [unit].
    bandwidth
        Kernel deviation the mesh rule asked for, Silverman's [standard deviations].
    """

    cell_centre: FloatArray
    density: FloatArray
    held: FloatArray
    mean: FloatArray
    deviation: FloatArray
    cell_width: FloatArray
    kernel_deviation: FloatArray
    bandwidth: float


def density_in_time(
    histories: npt.ArrayLike,
    probability: npt.ArrayLike | None = None,
    *,
    held_until: npt.ArrayLike | None = None,
    mesh: float | None = None,
    limiter: Limiter = "superbee",
) -> DensityInTime:
    """Density p(z, t) of weighted histories by the GDEE with their true velocities.

    At every time the response is taken less its mean and over its deviation, X = (Z - m) / s; the
    equation keeps its form in X, with the increments of X_q for velocities, and the density is
    mapped back by p(z, t) = p_X(x, t) / s.  Histories are straight in X between the given times;
    of each increment whole cells are gone exactly, the rest by one step of the scheme.

    Parameters
    ----------
    histories : (sample, time)
        Response Z_q(t) of every point at the same times [its unit]; anything after ``held_until``.
    probability : (sample,), optional
        Assigned probabilities [-]; equal if not given.
    held_until : (sample,), optional
        Number of the last time at which each history is there; it then leaves with all its
        probability.  All stay to the end if not given.
    mesh
        Cell width [standard deviations].  If not given, the width at which the numerical kernel's
        deviation is Silverman's bandwidth.
    limiter
        Flux limiter, ``"superbee"``, ``"minmod"`` or ``"upwind"`` (first order).

    Returns
    -------
    found
        The density with the mesh and the kernel that made it.

    Raises
    ------
    UserError
        If the histories are faulty or never differ, ``mesh`` is not positive, or no history is
        there at some time.

    References
    ----------
    Li, Chen, Stochastic Dynamics of Structures (2009), ch. 7; docs/theory/pdem.md, eq. (12).

    Examples
    --------
    >>> amplitude = np.linspace(-1.0, 1.0, 200)
    >>> found = density_in_time(amplitude[:, None] * np.linspace(0.0, 1.0, 11))
    >>> mass = found.density.sum(axis=1) * found.cell_width
    >>> print(f"{mass[-1]:.6f}, {found.deviation[-1]:.3f}")
    1.000000, 0.580
    """
    histories, probability, until = checked_histories(histories, probability, held_until)
    code = limiter_code(limiter)
    if mesh is not None and not (np.isfinite(mesh) and mesh > 0.0):
        raise UserError(f"mesh must be positive, got {mesh} standard deviations")
    there = np.arange(histories.shape[1]) <= until[:, None]
    held, mean, deviation = _moments(histories, probability, there)
    scale = np.maximum(deviation, SMALLEST_SPREAD * deviation.max())
    standard = (histories - mean) / scale
    last = np.take_along_axis(standard, until[:, None], axis=1)
    standard = np.where(there, standard, last)
    wide = deviation == scale
    bandwidth = _bandwidth(standard, probability, there, wide)
    if mesh is None:
        mesh = _mesh_by_rule(standard, wide, code, bandwidth)
    place, probabilities, square = _evolution(standard, probability, until, code, mesh)
    shown = np.flatnonzero(probabilities.max(axis=0) > _VANISHING)
    kept = slice(shown[0], shown[-1] + 1)
    width = mesh * scale
    return DensityInTime(
        cell_centre=mean[:, None] + scale[:, None] * place[kept],
        density=probabilities[:, kept] / width[:, None],
        held=held,
        mean=mean,
        deviation=deviation,
        cell_width=width,
        kernel_deviation=np.sqrt(square / held) * width,
        bandwidth=bandwidth,
    )


def quantiles_in_time(
    histories: npt.ArrayLike,
    levels: npt.ArrayLike,
    probability: npt.ArrayLike | None = None,
    *,
    held_until: npt.ArrayLike | None = None,
) -> FloatArray:
    """Exact quantiles of weighted histories at every time, given that they are there.

    Parameters
    ----------
    histories, probability, held_until
        As `density_in_time` takes them.
    levels : (level,)
        Probabilities of not being exceeded [-].

    Returns
    -------
    quantiles : (time, level)
        Smallest values whose distribution function reaches the levels [unit].

    Raises
    ------
    UserError
        If the histories are faulty or no history is there at some time.

    Examples
    --------
    >>> ramps = np.linspace(-1.0, 1.0, 201)[:, None] * np.linspace(0.0, 1.0, 3)
    >>> quantiles_in_time(ramps, [0.5, 0.9])[-1].round(2)
    array([0. , 0.8])
    """
    histories, probability, until = checked_histories(histories, probability, held_until)
    asked = np.asarray(levels, dtype=float)
    found = []
    for k, values in enumerate(histories.T):
        weight = np.where(until >= k, probability, 0.0)
        _refuse_empty(weight.sum(), k)
        found.append(np.quantile(values, asked, weights=weight, method="inverted_cdf"))
    return np.array(found)


def thinned(
    histories: npt.ArrayLike,
    ends: npt.ArrayLike,
    largest: npt.ArrayLike,
    largest_at: npt.ArrayLike,
) -> FloatArray:
    """Histories at few times, and their two turning points in every interval between.

    The path goes through the smallest and the largest value of each interval, in the order in
    which they occur, so that it reaches whatever the history reaches.  The largest absolute value,
    which may lie between two records, is put in its place.

    Parameters
    ----------
    histories : (sample, record)
        Values at evenly spaced times [their unit]; NaN from some record on where they end.
    ends : (time,)
        Rising numbers of the records to keep; the first is the start, record 0.
    largest : (sample,)
        Largest absolute value of each history [unit]; NaN if there is none.
    largest_at : (sample,)
        When it occurs, in records from the first [-]; NaN likewise.

    Returns
    -------
    path : (sample, 3 (time - 1) + 1)
        The start, and for each interval its two turning points and its end [unit]; NaN from the
        interval on in which a history ends.

    Examples
    --------
    >>> thinned([[0.0, 1.0, -2.0, 0.5]], [0, 3], [2.1], [2.2])
    array([[ 0. ,  1. , -2.1,  0.5]])
    """
    histories, ends = np.asarray(histories, dtype=float), np.asarray(ends)
    largest, largest_at = np.asarray(largest, dtype=float), np.asarray(largest_at, dtype=float)
    n = len(histories)
    rows = np.arange(n)
    path = np.full((n, 3 * (ends.size - 1) + 1), np.nan)
    path[:, 0] = histories[:, 0]
    for k, (start, stop) in enumerate(pairwise(ends)):
        inside = histories[:, start + 1 : stop + 1]
        whole = np.isfinite(inside).all(axis=1) & np.isfinite(path[:, 3 * k])
        turns = np.sort(np.stack([inside.argmin(axis=1), inside.argmax(axis=1)]), axis=0)
        for turn, column in enumerate((*turns, np.full(n, -1))):
            path[whole, 3 * k + 1 + turn] = inside[rows, column][whole]
    for row in np.flatnonzero(np.isfinite(largest)):
        record = min(round(largest_at[row]), histories.shape[1] - 1)
        sign = np.sign(histories[row, record]) or 1.0
        k = int(np.clip(np.searchsorted(ends, largest_at[row]), 1, ends.size - 1)) - 1
        turns = path[row, 3 * k + 1 : 3 * k + 3]
        turns[(sign * turns).argmax()] = sign * largest[row]
    return path


def _moments(
    histories: FloatArray, probability: FloatArray, there: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Probability of the histories that are there, their mean and their deviation (time,)."""
    weight = np.where(there, probability[:, None], 0.0)
    held = weight.sum(axis=0)
    _refuse_empty(float(held.min()), int(held.argmin()))
    mean = (weight * histories).sum(axis=0) / held
    deviation = np.sqrt((weight * (histories - mean) ** 2).sum(axis=0) / held)
    if not deviation.max() > 1e-12 * float(np.abs(histories).max()):  # rounding of the mean
        raise UserError(
            f"histories must differ, got {len(histories)} that are the same at every time: a "
            "response without spread has no density"
        )
    return held, mean, deviation


def _refuse_empty(held: float, time: int) -> None:
    """Refuse a time at which no history is there any more."""
    if not held > 0.0:
        raise UserError(
            f"at least one history must be there at every time, got none at time {time}: all have "
            "been lost; leave the later times out"
        )


def _bandwidth(
    standard: FloatArray, probability: FloatArray, there: BoolArray, wide: BoolArray
) -> float:
    """Median of Silverman's bandwidths over the times that are wide [deviations]."""
    found = []
    for k in np.flatnonzero(wide):
        weight = probability[there[:, k]]
        found.append(silverman_bandwidth(standard[there[:, k], k], weight / weight.sum()))
    return float(np.median(found))


def _mesh_by_rule(standard: FloatArray, wide: BoolArray, limiter: int, bandwidth: float) -> float:
    """Cell width [deviations] at which the kernel's deviation over wide times is ``bandwidth``.

    Fixed-point iteration on the kernels of a few histories, chosen evenly by their place at the
    middle one of the wide times.
    """
    time = np.flatnonzero(wide)[wide.sum() // 2]
    order = np.argsort(standard[:, time])
    few = order[np.unique(np.linspace(0, order.size - 1, _RULE_POINTS).round().astype(int))]
    weight = np.full(few.size, 1.0 / few.size)
    until = np.full(few.size, standard.shape[1] - 1)
    mesh = bandwidth
    for _ in range(_RULE_ROUNDS):
        square = _evolution(standard[few], weight, until, limiter, mesh)[2]
        deviation = float(np.sqrt(square[wide].mean())) * mesh
        if abs(deviation / bandwidth - 1.0) < _RULE_TOLERANCE:
            break
        mesh *= bandwidth / deviation
    return mesh


def _evolution(
    standard: FloatArray, probability: FloatArray, until: IntArray, limiter: int, mesh: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Cell centres, probability per cell (time, cell) and weighted kernel spread (time,) [cell^2].

    Zero, where histories that start together start, is the centre of a cell.
    """
    place = standard / mesh
    margin = margin_of(standard.shape[1])
    n_below = int(np.ceil(max(0.0, -place.min()))) + margin
    n_cells = n_below + int(np.ceil(max(0.0, place.max()))) + margin + 1
    n_times = standard.shape[1]
    total, square = np.zeros((n_times, n_cells)), np.zeros(n_times)
    _kernels.evolve_in_time(
        place + n_below, probability, until, limiter, np.zeros(n_cells), total, square
    )
    return mesh * (np.arange(n_cells, dtype=float) - n_below), total, square
