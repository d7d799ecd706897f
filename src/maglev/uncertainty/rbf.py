"""Radial basis functions with a linear tail: fit, predict, gradient, leave-one-out.

ŷ(u) = Σ_j λ_j φ(‖(u − u_j)/ℓ‖) + b₀ + bᵀu, from the saddle system [[Φ, P], [Pᵀ, 0]].
"""

import warnings
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import LinAlgError, LinAlgWarning, lu_factor, lu_solve
from scipy.optimize import minimize, minimize_scalar

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.uncertainty import _radial_kernels as kernels
from maglev.uncertainty.surrogate import checked_points, checked_training

BASES = {
    "cubic": kernels.CUBIC,
    "thin_plate": kernels.THIN_PLATE,
    "multiquadric": kernels.MULTIQUADRIC,
    "gaussian": kernels.GAUSSIAN,
}
SHAPED = ("multiquadric", "gaussian")

LARGEST_CONDITION = 1e14
"""Largest accepted condition number of the saddle matrix [-]; assumed: a hundredth of that which
leaves no correct digit in double precision."""

SHAPE_RANGE = (1e-2, 1e1)
"""Range of shape parameters, in 1/(typical distance between neighbours) [-]; assumed."""

LENGTH_RANGE = (0.1, 10.0)
"""Range of lengths, over those at the start of the search [-]; assumed."""


@dataclass(frozen=True, kw_only=True)
class RBF:
    """Fitted radial basis functions that share one factorisation among all responses.

    Parameters
    ----------
    points : (sample, parameter)
        Standardised training points [-].
    values : (sample, response)
        Training values [unit of the response].
    basis
        One of ``BASES``.
    shape
        Shape parameter ε of the multiquadric and the Gaussian [-]; 1 for the others.
    length : (parameter,)
        Length ℓ by which each input is divided before distances are taken [-].
    weights : (sample, response)
        Weights λ of the radial functions [unit of the response].
    tail : (1 + parameter, response)
        Constant b₀ and slopes b of the linear tail [unit of the response].
    inverse_diagonal : (sample,)
        (A⁻¹)_kk of the saddle matrix A, first ``sample`` entries.
    condition
        Condition number of A in the 1-norm [-], with Φ over its largest entry.
    """

    points: FloatArray
    values: FloatArray
    basis: str
    shape: float
    length: FloatArray
    weights: FloatArray
    tail: FloatArray
    inverse_diagonal: FloatArray
    condition: float

    def predict(self, points: npt.ArrayLike) -> FloatArray:
        """Values of the surrogate.

        Parameters
        ----------
        points : (point, parameter)
            Standardised points [-].

        Returns
        -------
        values : (point, response)
            Predictions [unit of the response].

        Raises
        ------
        UserError
            If ``points`` are not finite or have another number of parameters.
        """
        points = checked_points(points, self.points.shape[1])
        values = points @ self.tail[1:] + self.tail[0]
        kernels.radial_sum(
            BASES[self.basis],
            self.shape,
            self.points / self.length,
            self.weights,
            points / self.length,
            values,
        )
        return values

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Gradient of the surrogate in closed form: Σ_j λ_j (φ′(r_j)/r_j)(u − u_j)/ℓ² + b.

        Parameters
        ----------
        points : (point, parameter)
            Standardised points [-].

        Returns
        -------
        gradient : (point, response, parameter)
            Slope with respect to each standardised input [unit of the response].

        Raises
        ------
        UserError
            If ``points`` are not finite or have another number of parameters.
        """
        points = checked_points(points, self.points.shape[1])
        gradient = np.zeros((points.shape[0], self.values.shape[1], points.shape[1]))
        kernels.radial_sum_gradient(
            BASES[self.basis],
            self.shape,
            self.points / self.length,
            self.weights,
            points / self.length,
            gradient,
        )
        return gradient / self.length + self.tail[1:].T

    def leave_one_out(self) -> FloatArray:
        """Residual at each training point after a fit without it, shape and length kept.

        e_k = λ_k / (A⁻¹)_kk with the whole saddle matrix A, tail included.

        Returns
        -------
        residuals : (sample, response)
            Value less prediction [unit of the response].

        Raises
        ------
        UserError
            If the remaining points could not carry the linear tail.

        References
        ----------
        Rippa, Adv. Comput. Math. 11 (1999) 193–210; docs/theory/surrogates.md, eq. 4.
        """
        return _leave_one_out(self.points, self.weights, self.inverse_diagonal)


@dataclass(frozen=True, kw_only=True)
class ScaledRBF:
    """Radial basis functions with one length per input, found anew for each response.

    Parameters
    ----------
    points : (sample, parameter)
        Standardised training points [-].
    values : (sample, response)
        Training values [unit of the response].
    responses : (response,)
        One fit per response, each with its own lengths.
    """

    points: FloatArray
    values: FloatArray
    responses: tuple[RBF, ...]

    @property
    def length(self) -> FloatArray:
        """Lengths (response, parameter) [-], each row over its geometric mean."""
        length = np.array([response.length for response in self.responses])
        return length / np.exp(np.mean(np.log(length), axis=1, keepdims=True))

    def predict(self, points: npt.ArrayLike) -> FloatArray:
        """Values (point, response) of the surrogate; see ``RBF.predict``."""
        return np.concatenate([response.predict(points) for response in self.responses], axis=1)

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Gradients (point, response, parameter) of the surrogate; see ``RBF.gradient``."""
        return np.concatenate([response.gradient(points) for response in self.responses], axis=1)

    def leave_one_out(self) -> FloatArray:
        """Residuals (sample, response), lengths kept; see ``RBF.leave_one_out``."""
        return np.concatenate([response.leave_one_out() for response in self.responses], axis=1)


def fit_rbf(
    points: npt.ArrayLike,
    values: npt.ArrayLike,
    *,
    basis: str = "cubic",
    shape: float | None = None,
    length: npt.ArrayLike | None = None,
) -> RBF:
    """Interpolate several responses with one factorisation.

    Parameters
    ----------
    points : (sample, parameter)
        Standardised training points [-].
    values : (sample, response) or (sample,)
        Training values [unit of the response].
    basis
        ``"cubic"`` r³, ``"thin_plate"`` r² ln r, ``"multiquadric"`` √(1 + ε²r²) or
        ``"gaussian"`` exp(−ε²r²).
    shape
        Shape parameter ε [-] of the last two; found by leave-one-out if not given.
    length : (parameter,)
        Length of each input [-]; all 1 if not given.

    Returns
    -------
    surrogate
        The fitted surrogate.

    Raises
    ------
    UserError
        If the training data cannot be used (``checked_training``), the basis is unknown, shape or
        length are not positive or not applicable, or the saddle matrix is singular or its condition
        number exceeds ``LARGEST_CONDITION``.

    References
    ----------
    Buhmann, Radial Basis Functions (2003), ch. 2 and 5; Rippa, Adv. Comput. Math. 11 (1999).

    Examples
    --------
    >>> points = np.array([[0.0], [1.0], [2.0], [3.0]])
    >>> surrogate = fit_rbf(points, points**2)
    >>> surrogate.predict([[2.0], [2.5]]).round(2)  # exact at a training point
    array([[4.  ],
           [6.35]])
    """
    points, values = checked_training(points, values)
    n_parameters = points.shape[1]
    if basis not in BASES:
        raise UserError(f"radial basis must be one of {', '.join(BASES)}, got '{basis}'")
    if shape is not None and basis not in SHAPED:
        raise UserError(f"the {basis} basis has no shape parameter, got {shape}; leave it out")
    length = np.ones(n_parameters) if length is None else np.array(length, dtype=np.float64)
    if length.shape != (n_parameters,) or not (np.isfinite(length).all() and (length > 0).all()):
        raise UserError(
            f"lengths must be {n_parameters} positive numbers, one per parameter, got {length}"
        )
    if shape is None:
        shape = 1.0
        if basis in SHAPED:
            shape = _shape_by_leave_one_out(points, values, basis, length)
    if not (np.isfinite(shape) and shape > 0.0):
        raise UserError(f"shape parameter must be positive, got {shape}")
    return _solved(points, values, basis, float(shape), length)


def fit_scaled_rbf(
    points: npt.ArrayLike, values: npt.ArrayLike, *, basis: str = "cubic"
) -> ScaledRBF:
    """Interpolate each response with lengths per input of least leave-one-out error.

    The mean square of the leave-one-out residuals is minimised over the logarithms of the lengths
    with its exact gradient, from the isotropic fit or, where it is better, from lengths inverse to
    the slopes of a linear fit.  For the shaped bases the lengths take the place of the shape.

    Parameters
    ----------
    points : (sample, parameter)
        Standardised training points [-].
    values : (sample, response) or (sample,)
        Training values [unit of the response].
    basis
        One of ``BASES``.

    Returns
    -------
    surrogate
        The fitted surrogate.

    Raises
    ------
    UserError
        As ``fit_rbf``, or if there are too few points to leave one out.

    Examples
    --------
    >>> points = np.random.default_rng(0).normal(size=(30, 2))
    >>> surrogate = fit_scaled_rbf(points, np.sin(2.0 * points[:, :1]))
    >>> short, long = surrogate.length[0]
    >>> bool(short < long)  # the second input changes nothing
    True
    """
    points, values = checked_training(points, values)
    isotropic = fit_rbf(points, values, basis=basis)
    isotropic.leave_one_out()  # its sentence, should there be too few points
    slopes = np.linalg.lstsq(
        np.column_stack([np.ones(points.shape[0]), points]), values, rcond=None
    )[0][1:]
    responses = []
    for response in range(values.shape[1]):
        slope = np.abs(slopes[:, response])
        # a slope below a tenth of the largest says little about an input (assumed)
        by_slope = 1.0 / np.maximum(slope, 0.1 * np.max(slope) + np.finfo(float).tiny)
        by_slope /= np.exp(np.mean(np.log(by_slope)))
        length = _length_by_leave_one_out(
            points,
            values[:, response],
            basis,
            np.array([np.ones_like(by_slope), by_slope]) / isotropic.shape,
        )
        responses.append(_solved(points, values[:, response, None], basis, 1.0, length))
    return ScaledRBF(points=points, values=values, responses=tuple(responses))


def _saddle_matrix(
    points: FloatArray, basis: str, shape: float, length: FloatArray
) -> tuple[FloatArray, float]:
    """Saddle matrix (sample + 1 + parameter, same), Φ scaled by its largest entry, and that entry.

    The scaling makes the condition number independent of the unit of r³.
    """
    n, s = points.shape
    matrix = np.zeros((n + 1 + s, n + 1 + s))
    scaled = points / length
    kernels.radial_matrix(BASES[basis], shape, scaled, scaled, matrix[:n, :n])
    size = float(np.max(np.abs(matrix)))
    matrix[:n, :n] /= size
    matrix[:n, n] = matrix[n, :n] = 1.0
    matrix[:n, n + 1 :] = points
    matrix[n + 1 :, :n] = points.T
    return matrix, size


def _inverse(matrix: FloatArray) -> tuple[tuple[FloatArray, FloatArray], FloatArray, float]:
    """Factorisation, inverse and 1-norm condition number of ``matrix``; infinite if singular."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", LinAlgWarning)
        try:
            factor = lu_factor(matrix)
        except (LinAlgWarning, LinAlgError):
            return (matrix, np.zeros(0)), np.full_like(matrix, np.nan), np.inf
    inverse = lu_solve(factor, np.eye(matrix.shape[0]))
    condition = np.linalg.norm(matrix, 1) * np.linalg.norm(inverse, 1)
    return factor, inverse, float(condition)


def _solved(
    points: FloatArray, values: FloatArray, basis: str, shape: float, length: FloatArray
) -> RBF:
    """The surrogate for given shape and lengths."""
    n, s = points.shape
    matrix, size = _saddle_matrix(points, basis, shape, length)
    factor, inverse, condition = _inverse(matrix)
    if not condition <= LARGEST_CONDITION:
        raise UserError(
            f"condition number of the {basis} interpolation system must not exceed "
            f"{LARGEST_CONDITION:.0e}, got {condition:.1e} with shape {shape:.3g}; "
            "remove points that nearly coincide, or take a larger shape or the cubic basis"
        )
    solution = lu_solve(factor, np.concatenate([values, np.zeros((1 + s, values.shape[1]))]))
    return RBF(
        points=points,
        values=values,
        basis=basis,
        shape=shape,
        length=length,
        weights=solution[:n] / size,
        tail=solution[n:],
        inverse_diagonal=np.diag(inverse)[:n] / size,
        condition=condition,
    )


def _leave_one_out(
    points: FloatArray, weights: FloatArray, inverse_diagonal: FloatArray
) -> FloatArray:
    """Residuals e_k = λ_k / (A⁻¹)_kk (sample, response)."""
    n, s = points.shape
    if n < s + 2:
        raise UserError(
            f"leaving one point out of a linear tail in {s} parameters needs at least {s + 2} "
            f"points, got {n}; add training points"
        )
    # (A⁻¹)_kk is zero, but for rounding, when only sample k spans some direction
    needed = np.flatnonzero(np.abs(inverse_diagonal) <= 1e-13 * np.max(np.abs(inverse_diagonal)))
    if needed.size:
        raise UserError(
            f"leave-one-out needs points that span all {s} parameters without any one of them, "
            f"got sample {needed[0]} alone off a plane; add training points"
        )
    return weights / inverse_diagonal[:, None]


def _shape_by_leave_one_out(
    points: FloatArray, values: FloatArray, basis: str, length: FloatArray
) -> float:
    """Shape parameter with the smallest leave-one-out error over all standardised responses."""
    n, s = points.shape
    scaled = points / length
    distance = np.empty((n, n))
    kernels.radial_matrix(kernels.CUBIC, 1.0, scaled, scaled, distance)
    distance = np.cbrt(distance)
    np.fill_diagonal(distance, np.inf)
    neighbour = np.median(np.min(distance, axis=1))
    standardised = (values - values.mean(axis=0)) / values.std(axis=0)
    right = np.concatenate([standardised, np.zeros((1 + s, values.shape[1]))])

    def error(log_shape: float) -> float:
        matrix, _ = _saddle_matrix(points, basis, float(np.exp(log_shape)), length)
        factor, inverse, condition = _inverse(matrix)
        if not condition <= LARGEST_CONDITION:
            return np.inf
        weights = lu_solve(factor, right)[:n]
        return float(np.mean(_leave_one_out(points, weights, np.diag(inverse)[:n]) ** 2))

    trial = np.log(np.geomspace(*SHAPE_RANGE, 25) / neighbour)  # a quarter of an octave or so
    errors = np.array([error(log_shape) for log_shape in trial])
    if not np.isfinite(errors).any():
        raise UserError(
            f"no shape parameter of the {basis} basis between {np.exp(trial[0]):.2g} and "
            f"{np.exp(trial[-1]):.2g} keeps the condition number below "
            f"{LARGEST_CONDITION:.0e}; remove points that nearly coincide or take the cubic basis"
        )
    best = int(np.argmin(errors))
    around = np.flatnonzero(np.isfinite(errors))
    lower = trial[max(best - 1, around[0])]
    upper = trial[min(best + 1, around[-1])]
    if lower < upper:
        refined = minimize_scalar(error, bounds=(lower, upper), method="bounded")
        if refined.fun < errors[best]:
            return float(np.exp(refined.x))
    return float(np.exp(trial[best]))


def _length_by_leave_one_out(
    points: FloatArray, values: FloatArray, basis: str, starts: FloatArray
) -> FloatArray:
    """Lengths (parameter,) that minimise the leave-one-out error of one response (sample,)."""
    n, s = points.shape
    right = np.concatenate([(values - values.mean()) / values.std(), np.zeros(1 + s)])
    difference = (points[:, None, :] - points[None, :, :]) ** 2
    slope = np.empty((n, n))

    def error(log_length: FloatArray) -> tuple[float, FloatArray]:
        length = np.exp(log_length)
        matrix, size = _saddle_matrix(points, basis, 1.0, length)
        factor, inverse, condition = _inverse(matrix)
        if not condition <= LARGEST_CONDITION:
            return rejected, np.zeros(s)
        weights = lu_solve(factor, right)[:n]
        inverse = inverse[:n, :n]
        diagonal = np.diag(inverse)
        residual = _leave_one_out(points, weights[:, None], diagonal)[:, 0]
        kernels.radial_slope_matrix(BASES[basis], 1.0, points / length, slope)
        slope[:] /= size  # the residuals do not depend on size, hence neither on its slope
        mean_square = np.mean(residual**2)
        gradient = np.empty(s)
        for d in range(s):
            moved = -inverse @ (slope * difference[:, :, d] / -(length[d] ** 2))
            residual_slope = (moved @ weights - residual * np.sum(moved * inverse, 1)) / diagonal
            gradient[d] = 2.0 * np.mean(residual * residual_slope) / mean_square
        return float(np.log(mean_square)), gradient

    rejected = np.inf
    errors = [error(np.log(start))[0] for start in starts]
    start = np.log(starts[int(np.argmin(errors))])
    if not np.isfinite(min(errors)):
        raise UserError(
            f"the {basis} interpolation system exceeds a condition number of "
            f"{LARGEST_CONDITION:.0e} at every length tried first; remove points that nearly "
            "coincide or take the cubic basis"
        )
    rejected = min(errors) + 10.0  # worse than the start, yet finite for the line search
    reach = np.log(LENGTH_RANGE)
    found = minimize(
        error,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=[(value + reach[0], value + reach[1]) for value in start],
    )
    return np.exp(found.x if found.fun < min(errors) else start)
