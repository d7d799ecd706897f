"""Independent random inputs: marginal distributions, and maps between three spaces of points.

A point is given in the unit cube (c), in standard form (u = (x - mean) / deviation, without a
unit) or in physical form (x, the unit of the input).  Distances between points are measured in u.
"""

from __future__ import annotations

from dataclasses import InitVar, dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.stats import rv_continuous

from maglev.arrays import FloatArray
from maglev.errors import UserError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scipy.stats.distributions import rv_frozen


@dataclass(frozen=True)
class Marginals:
    """Independent continuous random inputs, one frozen distribution of ``scipy.stats`` each.

    Parameters
    ----------
    distributions
        One frozen distribution per input, such as ``scipy.stats.norm(5000.0, 500.0)``, with a
        finite mean and a finite deviation greater than zero.
    correlation : (input, input), optional
        Correlation of the inputs [-].  Only the identity is accepted: the argument exists so that
        a correlated problem is refused rather than solved as an independent one.

    Attributes
    ----------
    mean : (input,)
        Means [unit of each input].
    deviation : (input,)
        Standard deviations [unit of each input].

    Raises
    ------
    UserError
        If there is no input, if one is not a frozen continuous univariate distribution, if a mean
        or deviation is not finite or a deviation not positive, or if inputs are correlated.

    Examples
    --------
    >>> from scipy.stats import norm
    >>> inputs = Marginals([norm(10.0, 2.0), norm(5.0, 1.0)])
    >>> inputs.to_standard([[12.0, 4.0]])
    array([[ 1., -1.]])
    >>> inputs.from_unit_cube([[0.5, 0.5]])
    array([[10.,  5.]])
    """

    distributions: Sequence[rv_frozen]
    correlation: InitVar[npt.ArrayLike | None] = None
    mean: FloatArray = field(init=False, repr=False, compare=False)
    deviation: FloatArray = field(init=False, repr=False, compare=False)

    def __post_init__(self, correlation: npt.ArrayLike | None) -> None:
        distributions = tuple(self.distributions)
        if not distributions:
            raise UserError("Marginals needs at least one distribution, got none")
        for i, distribution in enumerate(distributions):
            if not isinstance(getattr(distribution, "dist", None), rv_continuous):
                raise UserError(
                    f"distribution {i} must be a frozen continuous univariate distribution of "
                    f"scipy.stats such as norm(5000.0, 500.0), got {distribution!r}"
                )
        n = len(distributions)
        if correlation is not None:
            matrix = np.asarray(correlation, dtype=float)
            if matrix.shape != (n, n):
                raise UserError(
                    f"correlation has shape {matrix.shape}, expected (input, input) = ({n}, {n})"
                )
            if not np.array_equal(matrix, np.eye(n)):
                raise UserError(
                    "inputs must be independent: assigned probabilities and the GF-discrepancy "
                    "are defined here from marginals alone, but the correlation given is not the "
                    "identity; transform the inputs to independent ones first"
                )
        mean = np.array([float(d.mean()) for d in distributions])
        deviation = np.array([float(d.std()) for d in distributions])
        for i in range(n):
            if not (np.isfinite(mean[i]) and np.isfinite(deviation[i]) and deviation[i] > 0):
                raise UserError(
                    f"distribution {i} must have a finite mean and a finite positive deviation, "
                    f"got mean {mean[i]} and deviation {deviation[i]}"
                )
        object.__setattr__(self, "distributions", distributions)
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "deviation", deviation)

    @property
    def n(self) -> int:
        """Number of random inputs."""
        return len(self.distributions)

    def to_standard(self, x: npt.ArrayLike) -> FloatArray:
        """Standard form ``u = (x - mean) / deviation`` of physical points.

        Parameters
        ----------
        x : (..., input)
            Physical points [unit of each input].

        Returns
        -------
        u : (..., input)
            The same points in standard form [-].

        Raises
        ------
        UserError
            If the last axis is not ``input`` or a value is not finite.
        """
        return (self._checked(x, "physical points") - self.mean) / self.deviation

    def from_standard(self, u: npt.ArrayLike) -> FloatArray:
        """Physical points ``x = mean + deviation u`` of points in standard form.

        Parameters
        ----------
        u : (..., input)
            Points in standard form [-].

        Returns
        -------
        x : (..., input)
            The same points [unit of each input].

        Raises
        ------
        UserError
            If the last axis is not ``input`` or a value is not finite.
        """
        return self.mean + self.deviation * self._checked(u, "standard points")

    def from_unit_cube(self, c: npt.ArrayLike) -> FloatArray:
        """Physical points whose distribution functions are ``c``, ``x_i = F_i^-1(c_i)``.

        Parameters
        ----------
        c : (..., input)
            Points of the unit cube [-].

        Returns
        -------
        x : (..., input)
            Physical points [unit of each input].

        Raises
        ------
        UserError
            If the last axis is not ``input``, a value lies outside [0, 1], or a value of exactly
            0 or 1 would send an unbounded input to infinity.
        """
        c = self._checked(c, "points of the unit cube")
        if np.any((c < 0.0) | (c > 1.0)):
            raise UserError(
                f"points of the unit cube must lie in [0, 1], got {c.min()} to {c.max()}"
            )
        x = np.empty_like(c)
        for i, distribution in enumerate(self.distributions):
            x[..., i] = distribution.ppf(c[..., i])
        if not np.all(np.isfinite(x)):
            raise UserError(
                "points of the unit cube must lie inside (0, 1) where an input is unbounded, "
                f"got {c.min()} to {c.max()}"
            )
        return x

    def to_unit_cube(self, x: npt.ArrayLike) -> FloatArray:
        """Marginal distribution functions ``c_i = F_i(x_i)`` at physical points.

        Parameters
        ----------
        x : (..., input)
            Physical points [unit of each input].

        Returns
        -------
        c : (..., input)
            Points of the unit cube [-].

        Raises
        ------
        UserError
            If the last axis is not ``input`` or a value is not finite.
        """
        x = self._checked(x, "physical points")
        c = np.empty_like(x)
        for i, distribution in enumerate(self.distributions):
            c[..., i] = distribution.cdf(x[..., i])
        return c

    def _checked(self, points: npt.ArrayLike, what: str) -> FloatArray:
        array = np.asarray(points, dtype=float)
        if array.ndim == 0 or array.shape[-1] != self.n:
            raise UserError(f"{what} have shape {array.shape}, expected (..., input = {self.n})")
        n_bad = np.count_nonzero(~np.isfinite(array))
        if n_bad:
            raise UserError(
                f"{what} must be finite, got {n_bad} values of {array.size} that are not; "
                "leave those points out"
            )
        return array
