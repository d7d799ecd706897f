"""Kriging: Gaussian processes with a Matérn 5/2 covariance and one length per input.

scikit-learn supplies the covariance, its likelihood and the factorisation; gradient, leave-one-out,
covariance and fast sums, which it lacks, are computed here from its factors.  So is the likelihood
of many inputs, for whose slope it keeps an array of all pairs of samples for each input.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_solve, lapack, solve_triangular
from scipy.optimize import minimize
from scipy.spatial.distance import cdist
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.uncertainty import _radial_kernels as kernels
from maglev.uncertainty.surrogate import checked_points, checked_training

NUGGET = 1e-10
"""Variance added to the diagonal, over the variance of the response [-]: the default of
scikit-learn, which keeps the factorisation possible and is far below any error of interest."""

LENGTH_RANGE = (0.1, 1e3)
"""Range of lengths, in standard deviations of the input [-]; assumed."""

AMPLITUDE_RANGE = (1e-3, 1e5)
"""Range of prior variances, over the variance of the response [-]; assumed."""

STARTS = (1.0, 3.0, 10.0)
"""Trial lengths, equal for all inputs; the search starts from the likeliest [-]; assumed."""

SEARCHED_BY_LIBRARY = 4
"""Largest number of inputs whose likelihood is that of scikit-learn.  Ours, for more, is the same
to 1e-10 and up to ten times as fast (250 samples of 20 inputs: 2.4 for 27 ms); for fewer, the last
bits of published numbers hang on the library's sums."""

BLOCK = 4096
"""Points per block where a matrix (point, sample) is needed; bounds the memory; assumed."""

Likelihood = Callable[[FloatArray], tuple[float, FloatArray]]
"""Logarithm of the likelihood and its slope, of ln amplitude and ln lengths (1 + parameter,)."""


@dataclass(frozen=True, kw_only=True)
class Kriging:
    """Fitted Gaussian processes, one per response, on common training points.

    Parameters
    ----------
    points : (sample, parameter)
        Standardised training points [-].
    values : (sample, response)
        Training values [unit of the response].
    mean, deviation : (response,)
        Mean and standard deviation of the training values [unit of the response]; the process has
        this constant mean.
    length : (response, parameter)
        Length of each input [-], in its standard deviations.
    amplitude : (response,)
        Prior variance over the squared deviation [-].
    weights : (sample, response)
        K⁻¹ (y − mean)/deviation [-].
    factor : (response, sample, sample)
        Lower Cholesky factor of K [-].
    """

    points: FloatArray
    values: FloatArray
    mean: FloatArray
    deviation: FloatArray
    length: FloatArray
    amplitude: FloatArray
    weights: FloatArray
    factor: FloatArray

    def predict(self, points: npt.ArrayLike) -> FloatArray:
        """Posterior mean.

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
        values = np.empty((points.shape[0], self.mean.size))
        for response, length in enumerate(self.length):
            total = np.zeros((points.shape[0], 1))
            kernels.radial_sum(
                kernels.MATERN,
                1.0,
                self.points / length,
                self.weights[:, response, None] * self.amplitude[response],
                points / length,
                total,
            )
            values[:, response] = total[:, 0]
        return self.mean + self.deviation * values

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Gradient of the posterior mean in closed form.

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
        gradient = np.empty((points.shape[0], self.mean.size, points.shape[1]))
        for response, length in enumerate(self.length):
            total = np.zeros((points.shape[0], 1, points.shape[1]))
            kernels.radial_sum_gradient(
                kernels.MATERN,
                1.0,
                self.points / length,
                self.weights[:, response, None] * self.amplitude[response],
                points / length,
                total,
            )
            gradient[:, response] = self.deviation[response] * total[:, 0] / length
        return gradient

    def leave_one_out(self) -> FloatArray:
        """Residual at each training point after a fit without it, all parameters kept.

        e_k = α_k / (K⁻¹)_kk; mean, deviation, lengths and amplitude stay as they are.

        Returns
        -------
        residuals : (sample, response)
            Value less prediction [unit of the response].

        References
        ----------
        Rasmussen & Williams, Gaussian Processes for Machine Learning (2006), eq. 5.12.
        """
        return self.deviation * self.weights / self._inverse_diagonal()

    def leave_one_out_deviation(self) -> FloatArray:
        """Standard deviation of each leave-one-out residual.

        Returns
        -------
        deviation : (sample, response)
            1/√(K⁻¹)_kk [unit of the response].

        References
        ----------
        Rasmussen & Williams, Gaussian Processes for Machine Learning (2006), eq. 5.12.
        """
        return self.deviation / np.sqrt(self._inverse_diagonal())

    def standard_deviation(self, points: npt.ArrayLike) -> FloatArray:
        """Posterior standard deviation; negative variances from rounding count as zero.

        Parameters
        ----------
        points : (point, parameter)
            Standardised points [-].

        Returns
        -------
        deviation : (point, response)
            Standard deviation [unit of the response].

        Raises
        ------
        UserError
            If ``points`` are not finite or have another number of parameters.
        """
        points = checked_points(points, self.points.shape[1])
        variance = np.empty((points.shape[0], self.mean.size))
        for start in range(0, points.shape[0], BLOCK):
            block = points[start : start + BLOCK]
            for response in range(self.mean.size):
                known = self._whitened(response, block)
                explained = np.einsum("ij,ij->j", known, known)
                variance[start : start + BLOCK, response] = self.amplitude[response] - explained
        return self.deviation * np.sqrt(np.maximum(variance, 0.0))

    def covariance(self, response: int, rows: npt.ArrayLike, columns: npt.ArrayLike) -> FloatArray:
        """Posterior covariance of one response between two sets of points.

        Parameters
        ----------
        response
            Which response.
        rows : (row, parameter)
            Standardised points [-].
        columns : (column, parameter)
            Standardised points [-].

        Returns
        -------
        covariance : (row, column)
            Covariance [unit of the response squared].

        Raises
        ------
        UserError
            If points are not finite or have another number of parameters.
        """
        rows = checked_points(rows, self.points.shape[1])
        columns = checked_points(columns, self.points.shape[1])
        prior = self._prior(response, rows, columns)
        explained = self._whitened(response, rows).T @ self._whitened(response, columns)
        return self.deviation[response] ** 2 * (prior - explained)

    def influence(self, response: int, points: npt.ArrayLike) -> FloatArray:
        """Share of each training value in the posterior mean at points.

        Parameters
        ----------
        response
            Which response.
        points : (point, parameter)
            Standardised points [-].

        Returns
        -------
        influence : (sample, point)
            K⁻¹ k [-]: the change of a prediction per change of a training value, the mean kept.

        Raises
        ------
        UserError
            If points are not finite or have another number of parameters.
        """
        points = checked_points(points, self.points.shape[1])
        prior = self._prior(response, self.points, points)
        return cho_solve((self.factor[response], True), prior)

    def _prior(self, response: int, rows: FloatArray, columns: FloatArray) -> FloatArray:
        """Prior covariance (row, column) of the standardised response."""
        length = self.length[response]
        matrix = np.empty((rows.shape[0], columns.shape[0]))
        kernels.radial_matrix(kernels.MATERN, 1.0, rows / length, columns / length, matrix)
        return self.amplitude[response] * matrix

    def _whitened(self, response: int, points: FloatArray) -> FloatArray:
        """L⁻¹ k (sample, point), whose squares sum to the explained variance."""
        prior = self._prior(response, self.points, points)
        return solve_triangular(self.factor[response], prior, lower=True, overwrite_b=True)

    def _inverse_diagonal(self) -> FloatArray:
        """(K⁻¹)_kk (sample, response)."""
        identity = np.eye(self.points.shape[0])
        return np.column_stack(
            [np.diag(cho_solve((factor, True), identity)) for factor in self.factor]
        )


def fit_kriging(points: npt.ArrayLike, values: npt.ArrayLike) -> Kriging:
    """Find lengths and prior variance of each response by maximum likelihood.

    Every response has a Gaussian process of its own: constant mean, Matérn 5/2 covariance, one
    length per input.  The search starts from the likeliest of ``STARTS``, so the same data give
    the same surrogate.

    Parameters
    ----------
    points : (sample, parameter)
        Standardised training points [-].
    values : (sample, response) or (sample,)
        Training values [unit of the response].

    Returns
    -------
    surrogate
        The fitted surrogate.

    Raises
    ------
    UserError
        If the training data cannot be used (``checked_training``), or points lie so close that
        the covariance matrix cannot be factorised.

    References
    ----------
    Rasmussen & Williams, Gaussian Processes for Machine Learning (2006), ch. 2, 4.2 and 5.4.1.

    Examples
    --------
    >>> points = np.linspace(-2.0, 2.0, 9)[:, None]
    >>> process = fit_kriging(points, np.sin(points))
    >>> print(f"{process.predict([[0.25]])[0, 0]:.3f}, sin 0.25 = {np.sin(0.25):.3f}")
    0.248, sin 0.25 = 0.247
    """
    points, values = checked_training(points, values)
    mean, deviation = values.mean(axis=0), values.std(axis=0)
    likeliest = [_likeliest(points, column) for column in ((values - mean) / deviation).T]
    found = np.exp(np.array(likeliest))
    return conditioned_kriging(points, values, length=found[:, 1:], amplitude=found[:, 0])


def conditioned_kriging(
    points: npt.ArrayLike,
    values: npt.ArrayLike,
    *,
    length: npt.ArrayLike,
    amplitude: npt.ArrayLike,
) -> Kriging:
    """Condition processes of known lengths and prior variances on training data: no search.

    Parameters
    ----------
    points : (sample, parameter)
        Standardised training points [-].
    values : (sample, response) or (sample,)
        Training values [unit of the response].
    length : (response, parameter)
        Length of each input [-], as `Kriging.length`.
    amplitude : (response,)
        Prior variance over the squared deviation [-], as `Kriging.amplitude`.

    Returns
    -------
    surrogate
        The surrogate; that of `fit_kriging` if the parameters are those it found.

    Raises
    ------
    UserError
        As `fit_kriging`, or if lengths or amplitudes do not fit or are not positive.

    References
    ----------
    Rasmussen & Williams, Gaussian Processes for Machine Learning (2006), ch. 2.

    Examples
    --------
    >>> points = np.linspace(-2.0, 2.0, 9)[:, None]
    >>> process = conditioned_kriging(points, np.sin(points), length=[[1.0]], amplitude=[1.0])
    >>> bool(process.standard_deviation(points).max() < 1e-3)  # none where it was trained
    True
    """
    points, values = checked_training(points, values)
    n, s = points.shape
    mean, deviation = values.mean(axis=0), values.std(axis=0)
    n_responses = mean.size
    length, amplitude = np.array(length, dtype=float), np.array(amplitude, dtype=float)
    for what, array, shape in (
        ("lengths", length, (n_responses, s)),
        ("amplitudes", amplitude, (n_responses,)),
    ):
        if array.shape != shape or not (np.isfinite(array).all() and (array > 0.0).all()):
            raise UserError(f"{what} must be positive with shape {shape}, got {array}")
    weights, factor = np.empty((n, n_responses)), np.empty((n_responses, n, n))
    for response in range(n_responses):
        standardised = (values[:, response] - mean[response]) / deviation[response]
        process = _process(amplitude[response], length[response])
        try:
            process.fit(points, standardised)
        except np.linalg.LinAlgError as error:
            raise UserError(
                f"covariance matrix of response {response} must be positive definite, got one "
                "that cannot be factorised; remove points that nearly coincide"
            ) from error
        weights[:, response], factor[response] = process.alpha_, process.L_
    return Kriging(
        points=points,
        values=values,
        mean=mean,
        deviation=deviation,
        length=length,
        amplitude=amplitude,
        weights=weights,
        factor=factor,
    )


def _process(amplitude: float, length: FloatArray) -> GaussianProcessRegressor:
    """A Gaussian process with given parameters, not fitted."""
    kernel = ConstantKernel(amplitude, AMPLITUDE_RANGE) * Matern(length, LENGTH_RANGE, nu=2.5)
    return GaussianProcessRegressor(kernel=kernel, alpha=NUGGET, optimizer=None)


def _likeliest(points: FloatArray, standardised: FloatArray) -> FloatArray:
    """Logarithms of amplitude and lengths (1 + parameter,) that maximise the likelihood."""
    s = points.shape[1]
    of_library = s <= SEARCHED_BY_LIBRARY
    likelihood = (_likelihood_by_library if of_library else _likelihood)(points, standardised)

    def unlikeliness(theta: FloatArray) -> tuple[float, FloatArray]:
        value, slope = likelihood(theta)
        return -value, -slope

    starts = [np.log([1.0] + [length] * s) for length in STARTS]
    start = min(starts, key=lambda theta: unlikeliness(theta)[0])
    bounds = np.log([AMPLITUDE_RANGE, *[LENGTH_RANGE] * s])
    return minimize(unlikeliness, start, jac=True, method="L-BFGS-B", bounds=bounds).x


def _likelihood_by_library(points: FloatArray, standardised: FloatArray) -> Likelihood:
    """Logarithm of the likelihood with its slope, by scikit-learn."""
    process = _process(1.0, np.ones(points.shape[1])).fit(points, standardised)

    def likelihood(theta: FloatArray) -> tuple[float, FloatArray]:
        return process.log_marginal_likelihood(theta, eval_gradient=True, clone_kernel=False)

    return likelihood


def _likelihood(points: FloatArray, standardised: FloatArray) -> Likelihood:
    """Logarithm of the likelihood with its slope, by products of matrices.

    With M = ααᵀ − K⁻¹, its slope in a parameter is tr(M ∂K)/2.  That in ln ℓ_d is the sum over
    pairs of W (u_d − u'_d)²/2ℓ_d² with W = M ∘ (5a/3)(1 + q) e^(−q), from the rows of W and of W u.

    References
    ----------
    Rasmussen & Williams, Gaussian Processes for Machine Learning (2006), eqs. 2.30 and 5.9;
    docs/theory/surrogates.md, eq. (10).
    """
    n = standardised.size

    def likelihood(theta: FloatArray) -> tuple[float, FloatArray]:
        scaled = points / np.exp(theta[1:])
        q = np.sqrt(5.0) * cdist(scaled, scaled)
        decayed = np.exp(theta[0] - q)
        covariance = (1.0 + q + q * q / 3.0) * decayed
        diagonal = np.einsum("ii->i", covariance)
        diagonal += NUGGET
        factor, failed = lapack.dpotrf(covariance, lower=True)
        if failed:
            return -np.inf, np.zeros_like(theta)
        weights, _ = lapack.dpotrs(factor, standardised, lower=True)
        inverse, _ = lapack.dpotri(factor, lower=True)
        inverse += np.tril(inverse, -1).T
        value = -0.5 * standardised @ weights - np.log(np.diag(factor)).sum()
        M = np.outer(weights, weights) - inverse
        diagonal -= NUGGET
        W = M * (5.0 / 3.0) * (1.0 + q) * decayed
        pairs = W.sum(axis=1) @ scaled**2 - np.einsum("id,id->d", scaled, W @ scaled)
        slope = np.concatenate([[0.5 * np.sum(M * covariance)], pairs])
        return value - 0.5 * n * np.log(2.0 * np.pi), slope

    return likelihood
