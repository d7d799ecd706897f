"""Interface of all surrogates, checks of training data, and choice by leave-one-out.

All surrogates live in standardised inputs u = (θ − μ)/σ and carry several responses at once.
"""

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np
import numpy.typing as npt

from maglev.arrays import FloatArray
from maglev.errors import UserError


class Surrogate(Protocol):
    """A fitted surrogate of several responses."""

    @property
    def points(self) -> FloatArray:
        """Training points (sample, parameter) [-], standardised."""

    @property
    def values(self) -> FloatArray:
        """Training values (sample, response) [unit of the response]."""

    def predict(self, points: npt.ArrayLike) -> FloatArray:
        """Values (point, response) at ``points`` (point, parameter)."""

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Gradients (point, response, parameter) at ``points`` (point, parameter)."""

    def leave_one_out(self) -> FloatArray:
        """Residuals (sample, response): value less the prediction made without that sample."""


class SurrogateWithDeviation(Surrogate, Protocol):
    """A surrogate with a posterior deviation and covariance."""

    def standard_deviation(self, points: npt.ArrayLike) -> FloatArray:
        """Standard deviations (point, response) at ``points`` (point, parameter)."""

    def covariance(self, response: int, rows: npt.ArrayLike, columns: npt.ArrayLike) -> FloatArray:
        """Covariance (row, column) of one response between two sets of points."""


Fit = Callable[[FloatArray, FloatArray], Surrogate]


def checked_points(points: npt.ArrayLike, n_parameters: int | None = None) -> FloatArray:
    """Points as a contiguous array of floats, checked for shape and finite values.

    Parameters
    ----------
    points : (point, parameter)
        Standardised points [-].
    n_parameters
        How many parameters they must have; any number if not given.

    Returns
    -------
    points : (point, parameter)
        The same points.

    Raises
    ------
    UserError
        If the shape is another one or a coordinate is not finite.

    Examples
    --------
    >>> checked_points([[0.0, 1.0]], 2)
    array([[0., 1.]])
    """
    array = np.ascontiguousarray(points, dtype=np.float64)
    expected = "any" if n_parameters is None else n_parameters
    if array.ndim != 2 or (n_parameters is not None and array.shape[1] != n_parameters):
        raise UserError(
            f"points have shape {array.shape}, expected (point, parameter) = (any, {expected}); "
            "give one row per point"
        )
    unusable = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if unusable.size:
        raise UserError(
            f"points must be finite, got {unusable.size} of {array.shape[0]} that are not; "
            f"first is point {unusable[0]}: leave them out or correct them"
        )
    return array


def checked_training(points: npt.ArrayLike, values: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Training data as arrays, checked for shape, finite values, distinct points and variance.

    Parameters
    ----------
    points : (sample, parameter)
        Standardised training points [-].
    values : (sample, response) or (sample,)
        Their responses [unit of the response].

    Returns
    -------
    points : (sample, parameter)
        The same points.
    values : (sample, response)
        The same values.

    Raises
    ------
    UserError
        If shapes disagree, something is not finite, two points coincide, a response is constant,
        or there are fewer points than a linear tail needs.

    Examples
    --------
    >>> points, values = checked_training([[0.0], [1.0], [2.0]], [[5.0], [6.0], [8.0]])
    >>> values.shape
    (3, 1)
    """
    points = checked_points(points)
    values = np.array(values, dtype=np.float64)
    if values.ndim == 1:
        values = values[:, None]
    n, s = points.shape
    if values.ndim != 2 or values.shape[0] != n or values.shape[1] == 0:
        raise UserError(
            f"values have shape {values.shape}, expected (sample, response) = ({n}, at least 1); "
            "give one row per training point"
        )
    unusable = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if unusable.size:
        raise UserError(
            f"training values must be finite, got {unusable.size} of {n} samples that are not; "
            f"first is sample {unusable[0]}: a lost sample never enters a regression, leave it out"
        )
    if n < s + 1:
        raise UserError(
            f"a linear tail in {s} parameters needs at least {s + 1} points, got {n}; "
            "add training points"
        )
    order = np.lexsort(points.T)
    same = np.flatnonzero((np.diff(points[order], axis=0) == 0.0).all(axis=1))
    if same.size:
        first, second = sorted(order[same[0] : same[0] + 2])
        raise UserError(
            f"training points must be distinct, got the same point as samples {first} and "
            f"{second}; leave one of them out"
        )
    rank = np.linalg.matrix_rank(np.column_stack([np.ones(n), points]))
    if rank < s + 1:
        raise UserError(
            f"training points must span all {s} parameters, got points that span only "
            f"{rank - 1}; add points off that plane or drop the parameter that does not vary"
        )
    constant = np.flatnonzero(np.ptp(values, axis=0) == 0.0)
    if constant.size:
        raise UserError(
            f"every response must vary, got {values[0, constant[0]]} at all {n} points for "
            f"response {constant[0]}; leave it out of the surrogate"
        )
    return points, values


def relative_error(surrogate: Surrogate) -> FloatArray:
    """Root mean square of the leave-one-out residuals over the deviation of the response.

    Parameters
    ----------
    surrogate
        A fitted surrogate.

    Returns
    -------
    error : (response,)
        Relative error [-]: 0 exact, 1 no better than the mean.

    Raises
    ------
    UserError
        If there are too few points to leave one out.

    Examples
    --------
    >>> from maglev.uncertainty.rbf import fit_rbf
    >>> points = np.random.default_rng(0).normal(size=(12, 2))
    >>> bool(relative_error(fit_rbf(points, points)).max() < 1e-9)  # a plane is met
    True
    """
    residuals = surrogate.leave_one_out()
    return np.sqrt(np.mean(residuals**2, axis=0)) / np.std(surrogate.values, axis=0)


def best_by_leave_one_out(surrogates: Mapping[str, Surrogate]) -> tuple[str, ...]:
    """Name of the surrogate with the smallest leave-one-out error, for each response.

    Parameters
    ----------
    surrogates
        Named surrogates of the same training data.

    Returns
    -------
    names : (response,)
        The best name for each response; the first one named wins a tie.

    Raises
    ------
    UserError
        If there is nothing to choose from or the training data differ.

    Examples
    --------
    >>> from maglev.uncertainty.rbf import fit_rbf
    >>> points = np.linspace(-2.0, 2.0, 9)[:, None]
    >>> values = np.sin(points)
    >>> fits = {kind: fit_rbf(points, values, basis=kind) for kind in ("cubic", "thin_plate")}
    >>> best_by_leave_one_out(fits)
    ('cubic',)
    """
    names = list(surrogates)
    if not names:
        raise UserError("choosing a surrogate needs at least one, got none; name one")
    first = surrogates[names[0]]
    for name in names[1:]:
        other = surrogates[name]
        if not (
            np.array_equal(first.points, other.points)
            and np.array_equal(first.values, other.values)
        ):
            raise UserError(
                f"surrogates '{names[0]}' and '{name}' must share their training data, got "
                "different ones; fit them on the same samples"
            )
    errors = np.array([relative_error(surrogates[name]) for name in names])
    return tuple(names[index] for index in np.argmin(errors, axis=0))
