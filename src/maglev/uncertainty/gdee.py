"""Probability density evolution: from weighted extreme values to their density.

The finite-difference solution smooths the weighted points by a numerical kernel, so the mesh acts
as a bandwidth; a rule chooses it here.  Theory: docs/theory/pdem.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.stats import gaussian_kde, norm

from maglev.arrays import FloatArray, IntArray
from maglev.errors import UserError
from maglev.uncertainty import _kernels
from maglev.uncertainty.samples import (
    check_lost_probability,
    checked_probability,
    effective_size,
    weighted_sample,
)

Process = Literal["sine", "linear"]
Limiter = Literal["superbee", "minmod", "upwind"]

_LIMITERS = {
    "superbee": _kernels.SUPERBEE,
    "minmod": _kernels.MINMOD,
    "upwind": _kernels.UPWIND,
}

COURANT = 0.9
"""Courant number that the time step aims at [-]; 1 would be exact for one point.  Assumed."""

START = 3.0
"""Distance below the smallest value at which a virtual process starts [standard deviations].

A process that starts among the values moves those near its start too little for the scheme to
spread them, and the density keeps their spikes.  Assumed; see docs/theory/pdem.md, section 4.
"""

MOST_STEPS = 20_000
"""Time steps beyond which a density is refused, some ten seconds for 1000 points.  Assumed."""

_SMALLEST_MESH = 1 / 6  # of the bandwidth: bounds the work where a limiter smears more, assumed
_RULE_POINTS = 16  # points whose kernels the mesh rule measures, assumed
_RULE_ROUNDS = 12  # the rule contracts by a half or more per round, assumed
_RULE_TOLERANCE = 0.02  # of the bandwidth, well below its own uncertainty, assumed
_CHUNK = 512  # points whose increments are held in memory at once, assumed


class _TooManySteps(UserError):
    """The values need more than ``MOST_STEPS`` time steps."""


@dataclass(frozen=True)
class EvolvedDensity:
    """Density of an extreme value by the generalised density evolution equation.

    Attributes
    ----------
    cell_centre : (cell,)
        Centres of the cells [unit of the value].
    density : (cell,)
        Mean density in each cell [1/unit]; its integral is one less the lost probability.
    mesh
        Cell width [unit].
    n_steps
        Number of time steps over the virtual process.
    largest_courant
        Largest Courant number of any point and step [-].
    bandwidth
        Kernel deviation that the rule of the mesh aims at, Silverman's [unit].
    kernel_deviation
        Root mean square deviation of the resulting numerical kernel [unit].
    start
        Value at which the virtual process starts [unit].
    """

    cell_centre: FloatArray
    density: FloatArray
    mesh: float
    n_steps: int
    largest_courant: float
    bandwidth: float
    kernel_deviation: float
    start: float


@dataclass(frozen=True)
class FirstPassage:
    """Survival of histories between absorbing barriers.

    Attributes
    ----------
    survival : (time,)
        Probability that no barrier has been reached, by the evolution equation [-].
    exact_survival : (time,)
        The same for the weighted histories themselves, without a numerical kernel [-].
    cell_centre : (cell,)
        Centres of the cells [unit of the histories].
    density : (cell,)
        Density that remains at the last time [1/unit]; its integral is the last ``survival``.
    mesh
        Cell width used [unit].
    """

    survival: FloatArray
    exact_survival: FloatArray
    cell_centre: FloatArray
    density: FloatArray
    mesh: float


def evolved_density(
    values: npt.ArrayLike,
    probability: npt.ArrayLike | None = None,
    *,
    process: Process = "sine",
    limiter: Limiter = "superbee",
    mesh: float | None = None,
    start: float | None = None,
    lost_probability: float = 0.0,
) -> EvolvedDensity:
    """Density of weighted values by PDEM: virtual process, GDEE, finite differences.

    Values are standardised to zero mean and unit deviation, evolved from ``start`` by
    ``Z = start + (Y - start) g(tau)`` with ``g = sin(2.5 pi tau)`` or ``g = tau`` over
    ``0 <= tau <= 1``, and mapped back.  Courant numbers come from exact increments of Z.

    Parameters
    ----------
    values : (sample,)
        Extreme values of the held samples [their unit].
    probability : (sample,), optional
        Their probabilities given that they are held [-]; equal if not given.
    process
        Virtual process, ``"sine"`` or ``"linear"``.
    limiter
        Flux limiter, ``"superbee"``, ``"minmod"`` or ``"upwind"`` (first order).
    mesh
        Cell width [standard deviations].  If not given, the width at which the numerical kernel's
        deviation is Silverman's bandwidth, but not below a sixth of it.
    start
        Where the virtual process starts [standard deviations from the mean].  If not given, three
        deviations below the smallest value; 0 is the mean.
    lost_probability
        Probability of the samples that are lost [-]; the density is that of the held part and
        integrates to one less this.

    Returns
    -------
    evolved
        The density with its mesh, step and kernel.

    Raises
    ------
    UserError
        If the sample is faulty or constant, an option is unknown, ``mesh`` is not positive,
        ``start`` is not finite, ``lost_probability`` lies outside [0, 1), or values far out ask
        for more than ``MOST_STEPS`` time steps.

    References
    ----------
    Li, Chen, Stochastic Dynamics of Structures (2009), ch. 7; Chen, Li, Struct. Saf. 29 (2007)
    77-93 (virtual process of an extreme value); docs/theory/pdem.md, eqs. (1) to (8).

    Examples
    --------
    >>> evolved = evolved_density(np.linspace(-1.0, 1.0, 200))
    >>> mass = float(evolved.density.sum() * evolved.mesh)
    >>> print(f"{mass:.6f}")
    1.000000
    """
    values, probability = weighted_sample(values, probability)
    if process not in ("sine", "linear"):
        raise UserError(f"process must be 'sine' or 'linear', got {process!r}")
    code = limiter_code(limiter)
    check_lost_probability(lost_probability)
    if mesh is not None and not (np.isfinite(mesh) and mesh > 0.0):
        raise UserError(f"mesh must be positive, got {mesh} standard deviations")
    if start is not None and not np.isfinite(start):
        raise UserError(f"start must be finite, got {start} standard deviations")
    mean, deviation = _moments(values, probability)
    standard = (values - mean) / deviation
    origin = float(standard.min()) - START if start is None else float(start)
    bandwidth = silverman_bandwidth(standard, probability)
    if mesh is None:
        mesh = _mesh_by_rule(standard, probability, process, code, origin, bandwidth)
    centre, cell_probability, spread, n_steps, largest = _virtual_evolution(
        standard, probability, process, code, origin, mesh
    )
    filled = np.flatnonzero(cell_probability)
    shown = slice(filled[0] - 1, filled[-1] + 2)  # the filled cells and an empty one on either side
    return EvolvedDensity(
        cell_centre=mean + deviation * centre[shown],
        density=(1.0 - lost_probability) * cell_probability[shown] / (mesh * deviation),
        mesh=mesh * deviation,
        n_steps=n_steps,
        largest_courant=largest,
        bandwidth=bandwidth * deviation,
        kernel_deviation=float(np.sqrt(probability @ spread)) * mesh * deviation,
        start=mean + deviation * origin,
    )


def density_with_strays(
    values: npt.ArrayLike,
    probability: npt.ArrayLike | None = None,
    *,
    lost_probability: float = 0.0,
) -> tuple[EvolvedDensity, bool] | None:
    """Density of the values by PDEM, or of their logarithms if the values spread too far.

    A few values far out need too many time steps.  The logarithms of positive values may need
    fewer; their density p_L is mapped back by ``p(y) = p_L(ln y) / y``.

    Parameters
    ----------
    values, probability, lost_probability
        As `evolved_density` takes them.

    Returns
    -------
    evolved, logarithmic
        The density and whether it was found by the logarithm: ``mesh``, ``bandwidth`` and
        ``kernel_deviation`` are then those at the mean of the values, and the cells grow with the
        value.  None if the evolution refuses both; `direct_density` then remains.

    Raises
    ------
    UserError
        As `evolved_density` does for a faulty sample.

    References
    ----------
    docs/theory/pdem.md, sec. 5.

    Examples
    --------
    >>> density, by_logarithm = density_with_strays(np.linspace(1.0, 2.0, 200))
    >>> by_logarithm
    False
    """
    values, probability = weighted_sample(values, probability)
    mean, _ = _moments(values, probability)
    check_lost_probability(lost_probability)
    try:
        evolved = evolved_density(values, probability, lost_probability=lost_probability)
    except _TooManySteps:
        pass
    else:
        return evolved, False
    if not np.all(values > 0.0):
        return None
    try:
        evolved = evolved_density(np.log(values), probability, lost_probability=lost_probability)
    except _TooManySteps:
        return None
    centre = np.exp(evolved.cell_centre)
    mapped = EvolvedDensity(
        cell_centre=centre,
        density=evolved.density / centre,
        mesh=evolved.mesh * mean,
        n_steps=evolved.n_steps,
        largest_courant=evolved.largest_courant,
        bandwidth=evolved.bandwidth * mean,
        kernel_deviation=evolved.kernel_deviation * mean,
        start=float(np.exp(evolved.start)),
    )
    return mapped, True


def direct_density(
    at: npt.ArrayLike,
    values: npt.ArrayLike,
    probability: npt.ArrayLike | None = None,
    *,
    bandwidth: float | None = None,
    lost_probability: float = 0.0,
) -> FloatArray:
    """Density of weighted values by direct probability integration with a Gaussian kernel.

    ``p(y) = (1 - P_lost) sum_q P_q N(y; Y_q, h)``: the exact solution of the evolution equation
    with each Dirac function replaced by a normal density.

    Parameters
    ----------
    at : (value,)
        Values at which the density is wanted [unit of the value].
    values : (sample,)
        Extreme values of the held samples [their unit].
    probability : (sample,), optional
        Their probabilities given that they are held [-]; equal if not given.
    bandwidth
        Deviation h of the kernel [unit]; Silverman's if not given.
    lost_probability
        Probability of the samples that are lost [-].

    Returns
    -------
    density : (value,)
        Density of the held part [1/unit]; its integral is one less ``lost_probability``.

    Raises
    ------
    UserError
        If the sample is faulty or constant, ``bandwidth`` is not positive, a value is not finite
        or ``lost_probability`` lies outside [0, 1).

    References
    ----------
    Chen, Yang, Comput. Methods Appl. Mech. Eng. 357 (2019) 112612; docs/theory/pdem.md, eq. (9).

    Examples
    --------
    >>> values = np.linspace(-1.0, 1.0, 200)
    >>> at = np.linspace(-3.0, 3.0, 601)
    >>> print(f"{np.trapezoid(direct_density(at, values), at):.4f}")
    1.0000
    """
    values, probability = weighted_sample(values, probability)
    check_lost_probability(lost_probability)
    at = np.asarray(at, dtype=float)
    if at.ndim != 1 or not np.all(np.isfinite(at)):
        raise UserError(f"values must be finite and have shape (value,), got shape {at.shape}")
    mean, deviation = _moments(values, probability)
    if bandwidth is None:
        bandwidth = silverman_bandwidth(values, probability)
    if not (np.isfinite(bandwidth) and bandwidth > 0.0):
        raise UserError(f"bandwidth must be positive, got {bandwidth}")
    standard = (values - mean) / deviation
    kernel = gaussian_kde(standard, bw_method=1.0, weights=probability)
    kernel.set_bandwidth(bandwidth / deviation / float(np.sqrt(kernel.covariance[0, 0])))
    return (1.0 - lost_probability) * kernel((at - mean) / deviation) / deviation


def direct_density_band(
    at: npt.ArrayLike,
    values: npt.ArrayLike,
    n: int,
    *,
    density: FloatArray,
    bandwidth: float,
    lost_probability: float = 0.0,
    confidence: float = 0.95,
) -> tuple[FloatArray, FloatArray]:
    """Pointwise band of the sampling noise of a direct density of independent runs.

    The density is a mean over all runs of the kernel φ_h, its variance that of the kernel over n;
    the mean of φ_h² is the direct density with the bandwidth h/√2, over 2√π h.  The kernel's bias
    is not in it.

    Parameters
    ----------
    at : (value,)
        Values at which the density is given [unit of the value].
    values : (sample,)
        Values that held [their unit].
    n
        Number of all runs.
    density : (value,)
        The direct density [1/unit].
    bandwidth
        Its kernel deviation h [unit].
    lost_probability
        Share of runs that did not hold [-].
    confidence
        Two-sided confidence [-].

    Returns
    -------
    low, high : (value,)
        Ends of the band [1/unit]; the lower one is at least 0.

    References
    ----------
    Silverman, Density Estimation (1986), sec. 3.3.

    Examples
    --------
    >>> values = np.linspace(-1.0, 1.0, 200)
    >>> at, width = np.array([0.0]), silverman_bandwidth(values)
    >>> density = direct_density(at, values, bandwidth=width)
    >>> low, high = direct_density_band(at, values, 200, density=density, bandwidth=width)
    >>> bool(low[0] < density[0] < high[0])
    True
    """
    h = bandwidth
    narrower = direct_density(
        at, values, bandwidth=h / np.sqrt(2.0), lost_probability=lost_probability
    )
    variance = np.maximum(narrower / (2.0 * np.sqrt(np.pi) * h) - density**2, 0.0) / n
    half = norm.ppf(0.5 + 0.5 * confidence) * np.sqrt(variance)
    return np.maximum(density - half, 0.0), density + half


def silverman_bandwidth(values: npt.ArrayLike, probability: npt.ArrayLike | None = None) -> float:
    """Bandwidth ``0.9 min(deviation, quartile range / 1.34) n^(-1/5)`` of a weighted sample.

    n is the effective size ``1 / sum(P^2)``.

    Parameters
    ----------
    values : (sample,)
        Extreme values [their unit].
    probability : (sample,), optional
        Their probabilities [-]; equal if not given.

    Returns
    -------
    bandwidth
        Kernel deviation [unit of the value].

    Raises
    ------
    UserError
        If the sample is faulty or constant.

    References
    ----------
    Silverman, Density Estimation (1986), eq. 3.31; docs/theory/pdem.md, eq. (8).

    Examples
    --------
    >>> width = silverman_bandwidth(np.linspace(-1.0, 1.0, 200))
    >>> print(f"{width:.3f}")
    0.181
    """
    values, probability = weighted_sample(values, probability)
    _, deviation = _moments(values, probability)
    quarter, three_quarters = np.quantile(
        values, [0.25, 0.75], weights=probability, method="inverted_cdf"
    )
    spread = min(deviation, (three_quarters - quarter) / 1.34)
    if spread == 0.0:  # more than half of the probability at one value
        spread = deviation
    return float(0.9 * spread * effective_size(probability) ** -0.2)


def first_passage(
    histories: npt.ArrayLike,
    probability: npt.ArrayLike | None = None,
    *,
    mesh: float,
    lower: float | None = None,
    upper: float | None = None,
    held_until: npt.ArrayLike | None = None,
    limiter: Limiter = "superbee",
) -> FirstPassage:
    """Survival of weighted histories between barriers, by the GDEE with absorbing boundaries.

    Probability that reaches a barrier is removed for good.  Histories are straight between the
    given times; whole cells are gone exactly, the rest of an interval by one step of the scheme.
    The kernel reaches a barrier about its own width early: compare ``exact_survival``.

    Parameters
    ----------
    histories : (sample, time)
        Response Z_q(t) of every point at the same times [its unit].
    probability : (sample,), optional
        Assigned probabilities [-]; equal if not given.
    mesh
        Cell width [unit], at most; made smaller so that the barriers lie on faces.
    lower, upper
        Barriers [unit]; at least one.
    held_until : (sample,), optional
        Number of the last time at which each history is there; it leaves with all its probability
        before the next, as if it had reached a barrier.  All stay to the end if not given.
    limiter
        Flux limiter, ``"superbee"``, ``"minmod"`` or ``"upwind"``.

    Returns
    -------
    passage
        Survival over time and the remaining density.

    Raises
    ------
    UserError
        If the histories or probabilities are faulty, there is no barrier, a history starts at or
        outside one, or ``mesh`` is not positive.

    References
    ----------
    Li, Chen, Stochastic Dynamics of Structures (2009), ch. 8; docs/theory/pdem.md, eq. (10).

    Examples
    --------
    >>> ramps = np.linspace(0.0, 1.0, 5)[:, None] * np.linspace(0.0, 1.0, 21)  # slopes 0 to 1
    >>> found = first_passage(ramps, mesh=0.02, upper=0.6)
    >>> round(float(found.exact_survival[-1]), 3)  # three of five stay below
    0.6
    """
    histories, probability, until = checked_histories(histories, probability, held_until)
    n = len(histories)
    code = limiter_code(limiter)
    if not (np.isfinite(mesh) and mesh > 0.0):
        raise UserError(f"mesh must be positive, got {mesh}")
    if lower is None and upper is None:
        raise UserError("first passage needs a barrier, got neither lower nor upper")
    low = -np.inf if lower is None else float(lower)
    high = np.inf if upper is None else float(upper)
    inside = (histories[:, 0] > low) & (histories[:, 0] < high)
    if not inside.all():
        raise UserError(
            f"every history must start between the barriers {low} and {high}, got "
            f"{np.count_nonzero(~inside)} of {n} that do not"
        )
    if np.isfinite(low) and np.isfinite(high):
        mesh = (high - low) / np.ceil((high - low) / mesh)
    increments = np.diff(histories, axis=1) / mesh
    margin = margin_of(increments.shape[1])
    # Cells outside a barrier stay empty but for the one a step can reach before it is removed.
    face = low if np.isfinite(low) else high
    n_below = int(np.ceil((face - max(low, histories.min())) / mesh)) + margin
    n_above = int(np.ceil((min(high, histories.max()) - face) / mesh)) + margin
    n_cells = n_below + n_above
    centre = face + mesh * (np.arange(n_cells, dtype=float) - n_below + 0.5)
    first_kept = n_below if np.isfinite(low) else 0
    past_kept = n_cells
    if np.isfinite(high):
        past_kept = n_below + round((high - face) / mesh)
    cells = (histories[:, [0, -1]] - centre[0]) / mesh
    total = np.zeros(n_cells)
    survival = np.zeros(histories.shape[1])
    _kernels.evolve(
        increments,
        cells[:, 0],
        cells[:, 1],
        probability,
        until,
        code,
        first_kept,
        past_kept,
        np.zeros(n_cells),
        total,
        survival,
        np.zeros(n),
    )
    gone = (histories <= low) | (histories >= high)
    gone |= np.arange(histories.shape[1]) > until[:, None]
    exact_survival = probability @ ~np.logical_or.accumulate(gone, axis=1)
    return FirstPassage(
        survival=survival,
        exact_survival=exact_survival,
        cell_centre=centre,
        density=total / mesh,
        mesh=float(mesh),
    )


def checked_histories(
    histories: npt.ArrayLike,
    probability: npt.ArrayLike | None = None,
    held_until: npt.ArrayLike | None = None,
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Weighted histories as checked arrays; what they do after their last time is left out.

    Parameters
    ----------
    histories : (sample, time)
        Response of every point at the same times [its unit]; anything after ``held_until``.
    probability : (sample,), optional
        Assigned probabilities [-]; equal if not given.
    held_until : (sample,), optional
        Number of the last time at which each history is there; the last of all if not given.

    Returns
    -------
    histories, probability, held_until
        The same, as arrays; histories stand still after their last time.

    Raises
    ------
    UserError
        If a shape is wrong, a history is not finite while it is there, probabilities are negative
        or do not sum to one, or a last time is none of the times.

    Examples
    --------
    >>> given = [[0.0, 1.0, 2.0], [0.0, 3.0, np.nan]]
    >>> histories, probability, until = checked_histories(given, None, [2, 1])
    >>> histories[1].tolist(), probability.tolist()
    ([0.0, 3.0, 3.0], [0.5, 0.5])
    """
    histories = np.asarray(histories, dtype=float)
    if histories.ndim != 2 or histories.shape[0] < 1 or histories.shape[1] < 2:
        raise UserError(
            f"histories have shape {histories.shape}, expected (sample, time) with two times or "
            "more"
        )
    n, n_times = histories.shape
    weight = np.full(n, 1.0 / n) if probability is None else checked_probability(probability, n)
    until = np.full(n, n_times - 1) if held_until is None else np.asarray(held_until)
    if until.shape != (n,) or until.dtype.kind not in "iu":
        raise UserError(
            f"held_until must be {n} whole numbers, one for each history, got {until.dtype} of "
            f"shape {until.shape}"
        )
    if (until < 0).any() or (until >= n_times).any():
        raise UserError(
            f"held_until must number one of {n_times} times, from 0 to {n_times - 1}, got "
            f"{until.min()} to {until.max()}"
        )
    after = np.arange(n_times) > until[:, None]
    last = np.take_along_axis(histories, until[:, None], axis=1)
    histories = np.where(after, last, histories)
    if not np.all(np.isfinite(histories)):
        raise UserError(
            "histories must be finite while they are there, got NaN or infinity; say with "
            "held_until when a sample is lost"
        )
    return histories, weight, until


def _virtual_evolution(
    standard: FloatArray,
    probability: FloatArray,
    process: Process,
    limiter: int,
    start: float,
    mesh: float,
) -> tuple[FloatArray, FloatArray, FloatArray, int, float]:
    """Cell centres, probability per cell, kernel spread per point [cell^2], steps, Courant.

    The grid has a cell centre at ``start`` and a margin that the widest kernel does not fill.
    """
    travel = (standard - start) / mesh  # cells
    farthest = float(np.abs(travel).max())
    rate = 2.5 * np.pi if process == "sine" else 1.0  # largest slope of g
    n_steps = max(1, int(np.ceil(rate * farthest / COURANT)))
    if n_steps > MOST_STEPS:
        raise _TooManySteps(
            f"a mesh of {mesh:.3g} standard deviations needs {n_steps} time steps over values that "
            f"spread this far, expected {MOST_STEPS} at most; give a wider mesh, take logarithms "
            "of the values, or use direct_density"
        )
    tau = np.arange(n_steps + 1) / n_steps
    g = np.sin(2.5 * np.pi * tau) if process == "sine" else tau
    margin = margin_of(n_steps)
    backward = -min(0.0, float(travel.min()), *([-float(travel.max())] * (process == "sine")))
    forward = max(0.0, float(travel.max()), *([-float(travel.min())] * (process == "sine")))
    n_below, n_above = int(np.ceil(backward)) + margin, int(np.ceil(forward)) + margin
    n_cells = n_below + 1 + n_above
    total, work = np.zeros(n_cells), np.zeros(n_cells)
    survival, spread = np.zeros(n_steps + 1), np.zeros(standard.size)
    increment = np.diff(g)
    for a in range(0, standard.size, _CHUNK):
        part = slice(a, a + _CHUNK)
        _kernels.evolve(
            np.outer(travel[part], increment),
            np.full(travel[part].size, float(n_below)),
            n_below + travel[part],
            probability[part],
            np.full(travel[part].size, n_steps),
            limiter,
            0,
            n_cells,
            work,
            total,
            survival,
            spread[part],
        )
    centre = start + mesh * (np.arange(n_cells, dtype=float) - n_below)
    return centre, total, spread, n_steps, farthest * float(np.abs(increment).max())


def _mesh_by_rule(
    standard: FloatArray,
    probability: FloatArray,
    process: Process,
    limiter: int,
    start: float,
    bandwidth: float,
) -> float:
    """Cell width [deviations] at which the numerical kernel's deviation is ``bandwidth``.

    Fixed-point iteration on the kernels of a few values at even steps of probability and of the
    farthest one, which sets the time step.
    """
    levels = (np.arange(_RULE_POINTS) + 0.5) / _RULE_POINTS
    chosen = np.quantile(standard, levels, weights=probability, method="inverted_cdf")
    farthest = standard[np.argmax(np.abs(standard - start))]
    points = np.append(chosen, farthest)
    weights = np.append(np.full(_RULE_POINTS, 1.0 / _RULE_POINTS), 0.0)
    smallest = _SMALLEST_MESH * bandwidth
    mesh = bandwidth
    for _ in range(_RULE_ROUNDS):
        spread = _virtual_evolution(points, weights, process, limiter, start, mesh)[2]
        deviation = float(np.sqrt(weights @ spread)) * mesh
        if mesh == smallest or abs(deviation / bandwidth - 1.0) < _RULE_TOLERANCE:
            break
        mesh = max(mesh * bandwidth / deviation, smallest)
    return mesh


def margin_of(n_steps: int) -> int:
    """Cells beyond the farthest value: eight deviations of the widest (upwind) kernel.

    Examples
    --------
    >>> margin_of(100)
    44
    """
    return int(np.ceil(4.0 * np.sqrt(n_steps))) + 4  # variance n c (1 - c) <= n / 4, scheme's reach


def _moments(values: FloatArray, probability: FloatArray) -> tuple[float, float]:
    """Mean and deviation of a weighted sample; refuses a constant one."""
    mean = float(probability @ values)
    deviation = float(np.sqrt(probability @ (values - mean) ** 2))
    if not deviation > 1e-12 * float(np.abs(values).max()):  # rounding of the mean
        raise UserError(
            f"values must differ, got {values.size} of the same value {values[0]}: a constant "
            "response has no density"
        )
    return mean, deviation


def limiter_code(limiter: str) -> int:
    """Code of a flux limiter in the kernels.

    Raises
    ------
    UserError
        If there is no such limiter.

    Examples
    --------
    >>> limiter_code("superbee") in _LIMITERS.values()
    True
    """
    if limiter not in _LIMITERS:
        raise UserError(f"limiter must be one of {', '.join(_LIMITERS)}, got {limiter!r}")
    return _LIMITERS[limiter]
