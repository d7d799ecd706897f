"""Dependent random quantities from independent standard normal ones: the Nataf transformation.

Every quantity is a function of a normal variate with its own law, and the variates are correlated.
Their correlation is found pair by pair, so that the quantities have the linear correlation asked
for: with the expansion of each quantity in Hermite polynomials it is the root of a polynomial.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq
from scipy.special import ndtr

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.laws import Distribution

N_TERMS = 120
"""Hermite polynomials of an expansion [-]; assumed: a smooth law needs ten, one with steps many."""

REACH = 9.0
"""Normal variates beyond which nothing is summed [-]; assumed: 1e-19 of the probability."""

N_NODES = 3601
"""Nodes of the sums over a normal variate [-]; assumed: two hundred in a deviation."""


def at_normal(law: Distribution, variate: npt.ArrayLike) -> FloatArray:
    """Quantity of a law at normal variates of the same probability.

    Parameters
    ----------
    law
        Of the quantity.
    variate : (...)
        Standard normal variates [-].

    Returns
    -------
    quantity : (...)
        In the unit of the law; accurate in both tails.

    Examples
    --------
    >>> from scipy.stats import uniform
    >>> float(at_normal(uniform(2.0, 4.0), 0.0))
    4.0
    """
    u = np.asarray(variate, dtype=np.float64)
    share = ndtr(-np.abs(u))  # never above one half, so that no digit is lost
    return np.where(u < 0.0, law.ppf(share), law.isf(share))


@dataclass(frozen=True)
class Nataf:
    """Quantities with given laws and linear correlation.

    Attributes
    ----------
    laws
        One for each quantity.
    root : (quantity, quantity)
        Lower triangle that makes the correlated normal variates of independent ones [-].
    """

    laws: tuple[Distribution, ...]
    root: FloatArray

    def physical(self, standard: npt.ArrayLike) -> FloatArray:
        """Quantities at points of independent standard normal variates.

        Parameters
        ----------
        standard : (sample, quantity)
            Independent standard normal variates [-].

        Returns
        -------
        quantities : (sample, quantity)
            In the units of their laws.
        """
        variates = np.asarray(standard, dtype=np.float64) @ self.root.T
        pairs = zip(self.laws, variates.T, strict=True)
        return np.column_stack([at_normal(law, column) for law, column in pairs])


def nataf(laws: Sequence[Distribution], correlation: npt.ArrayLike, names: Sequence[str]) -> Nataf:
    """Transformation to quantities with given laws and linear correlation.

    Parameters
    ----------
    laws
        One for each quantity, with a finite deviation.
    correlation : (quantity, quantity)
        Linear correlation of the quantities [-], symmetric.
    names
        Of the quantities, for messages.

    Returns
    -------
    transformation
        Whose quantities have these laws exactly and these correlations to 1e-6, of smooth laws.

    Raises
    ------
    UserError
        If no normal variates lead to a correlation, or the correlations contradict each other.

    References
    ----------
    Liu, Der Kiureghian, Probab. Eng. Mech. 1(2):105-112 (1986); docs/theory/point_sets.md.

    Examples
    --------
    >>> from scipy.stats import lognorm, norm
    >>> pair = nataf([norm(10.0, 1.0), lognorm(0.5)], [[1.0, 0.6], [0.6, 1.0]], ["a", "b"])
    >>> rng = np.random.default_rng(1)
    >>> drawn = pair.physical(rng.standard_normal((100_000, 2)))
    >>> float(np.corrcoef(drawn.T)[0, 1].round(2))
    0.6
    """
    target = np.asarray(correlation, dtype=np.float64)
    n = len(laws)
    if target.shape != (n, n):
        raise UserError(f"correlation has shape {target.shape}, expected ({n}, {n})")
    series = {k: _hermite(laws[k]) for k in range(n) if np.any(np.delete(target[k], k))}
    normal = np.eye(n)
    for j in range(n):
        for k in range(j):
            if target[j, k] != 0.0:
                normal[j, k] = normal[k, j] = _of_variates(
                    series[j], series[k], target[j, k], (names[k], names[j])
                )
    try:
        root: FloatArray = np.linalg.cholesky(normal).astype(np.float64)
    except np.linalg.LinAlgError:
        pairs = ", ".join(
            f"{names[k]}, {names[j]}: {target[j, k]:g}"
            for j in range(n)
            for k in range(j)
            if target[j, k] != 0.0
        )
        raise UserError(
            "correlation: these coefficients contradict each other, the correlation of the normal "
            f"variates that they need is not positive definite: {pairs}"
        ) from None
    return Nataf(tuple(laws), root)


def _hermite(law: Distribution) -> FloatArray:
    """Coefficients (term,) of a standardised quantity in normalised Hermite polynomials, from 1."""
    u = np.linspace(-REACH, REACH, N_NODES)
    weight = np.exp(-0.5 * u**2) / np.sqrt(2.0 * np.pi) * (u[1] - u[0])
    quantity = (at_normal(law, u) - law.mean()) / law.std()
    before, now = np.ones_like(u), u
    found = np.empty(N_TERMS)
    for k in range(1, N_TERMS + 1):
        found[k - 1] = np.sum(weight * quantity * now)
        before, now = now, (u * now - np.sqrt(k) * before) / np.sqrt(k + 1.0)
    return found


def _of_variates(
    one: FloatArray, other: FloatArray, target: float, names: tuple[str, str]
) -> float:
    """Correlation of the normal variates at which two quantities have that of ``target``."""
    powers = np.arange(1, N_TERMS + 1)

    def misses(r: float) -> float:
        return float(np.sum(one * other * r**powers)) - target

    low, high = misses(-1.0) + target, misses(1.0) + target
    if not low < target < high:
        raise UserError(
            f"correlation of {names[0]} and {names[1]}: with these laws it can lie between "
            f"{low:.3f} and {high:.3f}, got {target:g}"
        )
    return float(brentq(misses, -1.0, 1.0, xtol=1e-14))
