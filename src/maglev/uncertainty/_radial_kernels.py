"""Compiled sums over radial functions: values, gradients and matrices, one pass, no large array."""

import numpy as np
from numba import njit, prange

CUBIC, THIN_PLATE, MULTIQUADRIC, GAUSSIAN, MATERN = range(5)


@njit(cache=True, error_model="numpy", inline="always")
def _radial(basis: int, shape: float, squared: float) -> float:
    """Value of one radial function.

    Parameters
    ----------
    basis
        One of the codes above.
    shape
        Shape parameter of the multiquadric and the Gaussian [1/unit of distance].
    squared
        Squared distance r² [unit of distance squared].
    """
    if basis == CUBIC:
        return squared * np.sqrt(squared)
    if basis == THIN_PLATE:
        return 0.5 * squared * np.log(squared) if squared > 0.0 else 0.0
    if basis == MULTIQUADRIC:
        return np.sqrt(1.0 + shape * shape * squared)
    if basis == GAUSSIAN:
        return np.exp(-shape * shape * squared)
    scaled = np.sqrt(5.0 * squared)
    return (1.0 + scaled + scaled * scaled / 3.0) * np.exp(-scaled)


@njit(cache=True, error_model="numpy", inline="always")
def _slope_over_distance(basis: int, shape: float, squared: float) -> float:
    """φ′(r)/r of one radial function; zero at r = 0 for the thin plate, where it multiplies zero.

    Parameters are those of ``_radial``.
    """
    if basis == CUBIC:
        return 3.0 * np.sqrt(squared)
    if basis == THIN_PLATE:
        return np.log(squared) + 1.0 if squared > 0.0 else 0.0
    if basis == MULTIQUADRIC:
        return shape * shape / np.sqrt(1.0 + shape * shape * squared)
    if basis == GAUSSIAN:
        return -2.0 * shape * shape * np.exp(-shape * shape * squared)
    scaled = np.sqrt(5.0 * squared)
    return -5.0 / 3.0 * (1.0 + scaled) * np.exp(-scaled)


@njit(cache=True, error_model="numpy", parallel=True)
def radial_sum(
    basis: int,
    shape: float,
    centres: np.ndarray,
    weights: np.ndarray,
    points: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add ``Σ_j weights_j φ(‖point − centre_j‖)`` to ``total``.

    Parameters
    ----------
    basis
        One of the codes above.
    shape
        Shape parameter [1/unit of distance].
    centres : (sample, parameter)
        Centres of the radial functions.
    weights : (sample, response)
        Their weights.
    points : (point, parameter)
        Points at which the sum is evaluated.
    total : (point, response)
        Receives the sum, added; one thread computes each row, so that the result does not depend
        on their number.
    """
    for i in prange(points.shape[0]):
        for j in range(centres.shape[0]):
            squared = 0.0
            for d in range(centres.shape[1]):
                difference = points[i, d] - centres[j, d]
                squared += difference * difference
            value = _radial(basis, shape, squared)
            for response in range(weights.shape[1]):
                total[i, response] += weights[j, response] * value


@njit(cache=True, error_model="numpy")
def radial_sum_gradient(
    basis: int,
    shape: float,
    centres: np.ndarray,
    weights: np.ndarray,
    points: np.ndarray,
    total: np.ndarray,
) -> None:
    """Add the gradient of ``radial_sum`` with respect to the point to ``total``.

    Parameters are those of ``radial_sum`` but for

    total : (point, response, parameter)
        Receives the gradient, added.
    """
    for i in range(points.shape[0]):
        for j in range(centres.shape[0]):
            squared = 0.0
            for d in range(centres.shape[1]):
                difference = points[i, d] - centres[j, d]
                squared += difference * difference
            slope = _slope_over_distance(basis, shape, squared)
            for response in range(weights.shape[1]):
                for d in range(centres.shape[1]):
                    difference = points[i, d] - centres[j, d]
                    total[i, response, d] += weights[j, response] * slope * difference


@njit(cache=True, error_model="numpy")
def radial_matrix(
    basis: int, shape: float, rows: np.ndarray, columns: np.ndarray, matrix: np.ndarray
) -> None:
    """Write ``φ(‖row_i − column_j‖)`` into ``matrix``.

    Parameters
    ----------
    basis
        One of the codes above.
    shape
        Shape parameter [1/unit of distance].
    rows : (row, parameter)
        Points of the rows.
    columns : (column, parameter)
        Points of the columns.
    matrix : (row, column)
        Receives the values.
    """
    for i in range(rows.shape[0]):
        for j in range(columns.shape[0]):
            squared = 0.0
            for d in range(columns.shape[1]):
                difference = rows[i, d] - columns[j, d]
                squared += difference * difference
            matrix[i, j] = _radial(basis, shape, squared)


@njit(cache=True, error_model="numpy")
def radial_slope_matrix(basis: int, shape: float, points: np.ndarray, matrix: np.ndarray) -> None:
    """Write ``φ′(r_ij)/r_ij`` between all pairs of points into ``matrix``.

    Parameters
    ----------
    basis
        One of the codes above.
    shape
        Shape parameter [1/unit of distance].
    points : (sample, parameter)
        The points.
    matrix : (sample, sample)
        Receives the values.
    """
    for i in range(points.shape[0]):
        for j in range(points.shape[0]):
            squared = 0.0
            for d in range(points.shape[1]):
                difference = points[i, d] - points[j, d]
                squared += difference * difference
            matrix[i, j] = _slope_over_distance(basis, shape, squared)
