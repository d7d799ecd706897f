"""Laws of random quantities: from what a person writes to a distribution in SI.

A law is given by its mean and deviation (or coefficient of variation), by bounds, or by a table.
What cannot be met is refused with the numbers that contradict each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import NormalDist
from typing import TYPE_CHECKING, Any, Literal, Protocol

from maglev.units import in_unit

if TYPE_CHECKING:
    import numpy.typing as npt

Name = Literal[
    "normal",
    "lognormal",
    "uniform",
    "triangular",
    "truncated_normal",
    "gumbel",
    "weibull",
    "beta",
    "quantiles",
    "sample",
    "discrete",
]
"""The laws by name; a configuration may write a space for the underscore."""

LEAST_SAMPLE = 10
"""Fewest values that a sample may have [-]; assumed."""

MOST_EDGES = 200
"""Steps of the distribution function of a sample, at most [-]; assumed: half a per cent each."""


class Distribution(Protocol):
    """What is asked of a distribution, as those of ``scipy.stats`` answer it."""

    def mean(self) -> float:
        """Mean."""

    def std(self) -> float:
        """Standard deviation."""

    def cdf(self, x: npt.ArrayLike) -> Any:
        """Distribution function."""

    def ppf(self, q: npt.ArrayLike) -> Any:
        """Quantiles."""

    def isf(self, q: npt.ArrayLike) -> Any:
        """Quantiles by the probability above."""


_NUMBERS = (
    "mean",
    "coefficient_of_variation",
    "deviation",
    "low",
    "high",
    "mode",
    "quantiles",
    "values",
    "probabilities",
)
"""What a law can say of itself."""


@dataclass(frozen=True)
class Normal:
    """Normal distribution of the standard library: a configuration is checked without SciPy."""

    mean_value: float
    deviation: float

    def mean(self) -> float:
        """Mean."""
        return self.mean_value

    def std(self) -> float:
        """Standard deviation."""
        return self.deviation

    def cdf(self, x: Any) -> float:
        """Distribution function of one number."""
        return 0.5 * math.erfc(-(x - self.mean_value) / (self.deviation * math.sqrt(2.0)))

    def ppf(self, q: Any) -> Any:
        """Quantiles."""
        return self.mean_value + self.deviation * _standard_quantile(q)

    def isf(self, q: Any) -> Any:
        """Quantiles by the probability above."""
        return self.mean_value - self.deviation * _standard_quantile(q)


@dataclass(frozen=True)
class Discrete:
    """Some values with their probabilities.

    Parameters
    ----------
    values
        In rising order [any unit].
    probabilities
        Of each [-].
    """

    values: tuple[float, ...]
    probabilities: tuple[float, ...]

    def mean(self) -> float:
        """Mean."""
        return sum(p * x for p, x in zip(self.probabilities, self.values, strict=True))

    def std(self) -> float:
        """Standard deviation."""
        mean = self.mean()
        squares = (
            p * (x - mean) ** 2 for p, x in zip(self.probabilities, self.values, strict=True)
        )
        return math.sqrt(sum(squares))

    def cdf(self, x: npt.ArrayLike) -> Any:
        """Distribution function."""
        import numpy as np

        reached = np.searchsorted(self.values, x, side="right")
        return np.concatenate([[0.0], np.cumsum(self.probabilities)])[reached]

    def ppf(self, q: npt.ArrayLike) -> Any:
        """The first value whose distribution function reaches a probability."""
        import numpy as np

        steps = np.cumsum(self.probabilities)
        number = np.searchsorted(steps, np.asarray(q) * (1 - 1e-12), side="left")
        return np.asarray(self.values)[np.minimum(number, steps.size - 1)]

    def isf(self, q: npt.ArrayLike) -> Any:
        """As `ppf`, by the probability above."""
        import numpy as np

        return self.ppf(1.0 - np.asarray(q))


def distribution(law: Any, present: float, unit: str, key: str) -> Distribution:
    """Distribution of a random quantity.

    Parameters
    ----------
    law
        As it stands in the configuration: `maglev.parameters.Law`.
    present
        Configured value of the quantity [unit]: the mean where the law names none, and the mode
        of a triangular one.
    unit
        SI unit of the quantity; empty for a pure number.
    key
        What the quantity is called in messages.

    Returns
    -------
    distribution
        In SI: of ``scipy.stats``, but `Normal` and `Discrete`.

    Raises
    ------
    ValueError
        If something is missing or too much, or no such law has these moments.

    Examples
    --------
    >>> from maglev.parameters import Law
    >>> law = Law(law="uniform", low="29 t", high="39 t")
    >>> float(distribution(law, 39e3, "kg", "train.car_body.mass").mean())
    34000.0
    """
    return _MAKERS[law.law](_Numbers(law, present, unit, key))


class _Numbers:
    """Numbers of a law in SI, each asked for by name."""

    def __init__(self, law: Any, present: float, unit: str, key: str) -> None:
        self.law, self.present, self.unit, self.key = law, present, unit, key

    def refuse(self, why: str) -> ValueError:
        """A mistake in this law."""
        return ValueError(f"{self.key}: {why}")

    def in_si(self, value: Any, name: str) -> float:
        """One number in SI."""
        place = f"{self.key}: {name}"
        if isinstance(value, bool) or value is None:
            raise ValueError(f"{place} must be a number, got {value!r}")
        if self.unit and isinstance(value, str):
            found = in_unit(value, self.unit, place)
        elif self.unit:
            raise ValueError(f"{place} must carry its unit, such as '{value} {self.unit}'")
        else:
            try:
                found = float(value)
            except (TypeError, ValueError):
                raise ValueError(f"{place} must be a number, got {value!r}") from None
        if not math.isfinite(found):
            raise ValueError(f"{place} must be finite, got {value!r}")
        return found

    def given(self, name: str) -> bool:
        """Whether the law says it."""
        return getattr(self.law, name) is not None

    def one(self, name: str) -> float:
        """A number that the law must say."""
        if not self.given(name):
            raise self.refuse(f"a law '{self.law.law}' needs {name}")
        return self.in_si(getattr(self.law, name), name)

    def only(self, *names: str) -> None:
        """Refuse what this law does not go by."""
        extra = [name for name in _NUMBERS if name not in names and self.given(name)]
        if extra:
            raise self.refuse(
                f"a law '{self.law.law}' goes by {', '.join(names)}, got {', '.join(extra)} besides"
            )

    def mean(self) -> float:
        """The mean, the configured value if the law names none."""
        return self.one("mean") if self.given("mean") else self.present

    def deviation(self) -> float:
        """The standard deviation, given or by the coefficient of variation."""
        varies, deviates = self.given("coefficient_of_variation"), self.given("deviation")
        if varies == deviates:
            raise self.refuse(
                f"a law '{self.law.law}' needs coefficient_of_variation or deviation, got "
                f"{'both' if varies else 'neither'}"
            )
        if deviates:
            found = self.one("deviation")
        else:
            mean = self.mean()
            if mean == 0.0:
                raise self.refuse(
                    "its mean is zero, so that a coefficient_of_variation says nothing; "
                    "give a deviation"
                )
            assert self.law.coefficient_of_variation is not None
            found = self.law.coefficient_of_variation * abs(mean)
        if not found > 0:
            raise self.refuse(f"the deviation must be greater than zero, got {found:g} {self.unit}")
        return found

    def bounds(self) -> tuple[float, float]:
        """Low and high."""
        low, high = self.one("low"), self.one("high")
        if not low < high:
            raise self.refuse(f"low must be less than high, got {low:g} and {high:g} {self.unit}")
        return low, high


def _standard_quantile(q: Any) -> Any:
    """Standard normal quantiles, of one number without NumPy."""
    if isinstance(q, float):
        return NormalDist().inv_cdf(q)
    from scipy.special import ndtri

    return ndtri(q)


_MOMENTS = ("mean", "coefficient_of_variation", "deviation")


def _normal(n: _Numbers) -> Distribution:
    n.only(*_MOMENTS)
    return Normal(n.mean(), n.deviation())


def _lognormal(n: _Numbers) -> Distribution:
    from scipy.stats import lognorm

    n.only(*_MOMENTS)
    mean, deviation = n.mean(), n.deviation()
    if not mean > 0:
        raise n.refuse(f"a lognormal quantity has a mean above zero, got {mean:g} {n.unit}")
    shape = math.sqrt(math.log1p((deviation / mean) ** 2))
    return lognorm(shape, scale=mean * math.exp(-0.5 * shape**2))


def _uniform(n: _Numbers) -> Distribution:
    from scipy.stats import uniform

    if n.given("low") or n.given("high"):
        n.only("low", "high")
        low, high = n.bounds()
    else:
        n.only(*_MOMENTS)
        half = math.sqrt(3.0) * n.deviation()
        low, high = n.mean() - half, n.mean() + half
    return uniform(low, high - low)


def _triangular(n: _Numbers) -> Distribution:
    from scipy.stats import triang

    if n.given("low") or n.given("high"):
        n.only("low", "high", "mode")
        low, high = n.bounds()
        mode = n.one("mode") if n.given("mode") else n.present
        if not low <= mode <= high:
            raise n.refuse(
                f"mode must lie between low and high, got {mode:g}, {low:g} and {high:g} {n.unit}"
            )
    else:
        n.only(*_MOMENTS)
        mode, half = n.mean(), math.sqrt(6.0) * n.deviation()
        low, high = mode - half, mode + half
    return triang((mode - low) / (high - low), low, high - low)


def _truncated_normal(n: _Numbers) -> Distribution:
    from scipy.stats import truncnorm

    n.only(*_MOMENTS, "low", "high")
    if not n.given("low") and not n.given("high"):
        raise n.refuse("a law 'truncated_normal' needs low or high")
    mean, deviation = n.mean(), n.deviation()
    low = n.one("low") if n.given("low") else -math.inf
    high = n.one("high") if n.given("high") else math.inf
    if not low < high:
        raise n.refuse(f"low must be less than high, got {low:g} and {high:g} {n.unit}")
    return truncnorm((low - mean) / deviation, (high - mean) / deviation, mean, deviation)


def _gumbel(n: _Numbers) -> Distribution:
    import numpy as np
    from scipy.stats import gumbel_r

    n.only(*_MOMENTS)
    scale = n.deviation() * math.sqrt(6.0) / math.pi
    return gumbel_r(n.mean() - float(np.euler_gamma) * scale, scale)


def _weibull(n: _Numbers) -> Distribution:
    from scipy.optimize import brentq
    from scipy.special import gamma
    from scipy.stats import weibull_min

    n.only(*_MOMENTS, "low")
    low = n.one("low") if n.given("low") else 0.0
    mean, deviation = n.mean() - low, n.deviation()
    if not mean > 0:
        raise n.refuse(f"the mean of a Weibull law must exceed its low = {low:g} {n.unit}")
    ratio = deviation / mean

    def misses(shape: float) -> float:
        first, second = gamma(1 + 1 / shape), gamma(1 + 2 / shape)
        return math.sqrt(max(second / first**2 - 1.0, 0.0)) - ratio

    if not misses(500.0) < 0 < misses(0.1):
        raise n.refuse(
            f"no Weibull law has a deviation of {ratio:g} of its mean above low; take another law"
        )
    shape = brentq(misses, 0.1, 500.0)
    return weibull_min(shape, low, mean / gamma(1 + 1 / shape))


def _beta(n: _Numbers) -> Distribution:
    from scipy.stats import beta

    n.only(*_MOMENTS, "low", "high")
    (low, high), mean, deviation = n.bounds(), n.mean(), n.deviation()
    share, spread = (mean - low) / (high - low), deviation / (high - low)
    if not 0 < share < 1 or not spread**2 < share * (1 - share):
        raise n.refuse(
            f"no beta law between {low:g} and {high:g} {n.unit} has the mean {mean:g} and the "
            f"deviation {deviation:g}; widen the bounds or lower the deviation"
        )
    total = share * (1 - share) / spread**2 - 1
    return beta(share * total, (1 - share) * total, low, high - low)


def _quantiles(n: _Numbers) -> Distribution:
    n.only("quantiles")
    table = n.law.quantiles
    if not _is_table(table) or len(table) < 2:
        raise n.refuse(
            "quantiles must be a list of at least two [probability, value], from 0 to 1, "
            f"got {table!r}"
        )
    at = [_probability(n, row[0]) for row in table]
    values = [n.in_si(row[1], "quantiles") for row in table]
    if at[0] != 0 or at[-1] != 1 or not _rises(at) or not _rises(values):
        raise n.refuse(
            "quantiles must rise in probability, from 0 to 1, and in value, got "
            f"{', '.join(f'[{p:g}, {x:g}]' for p, x in zip(at, values, strict=True))}"
        )
    return _stepped(at, values)


def _sample(n: _Numbers) -> Distribution:
    import numpy as np

    n.only("values")
    if not n.given("values"):
        raise n.refuse("a law 'sample' needs file (a CSV column of values) or values")
    values = [n.in_si(value, "values") for value in n.law.values]
    if len(values) < LEAST_SAMPLE:
        raise n.refuse(f"a sample needs at least {LEAST_SAMPLE} values, got {len(values)}")
    at = np.linspace(0.0, 1.0, min(len(values), MOST_EDGES + 1))
    edges = np.quantile(values, at)
    kept = np.concatenate([np.diff(edges) > 0, [True]])  # of equal values the last
    kept[0] = True
    edges, at = edges[kept], at[kept]
    if edges.size < 3 or not _rises(list(edges)):
        raise n.refuse(
            "a sample with few distinct values is no continuous law; give it as 'discrete'"
        )
    return _stepped(list(at), list(edges))


def _discrete(n: _Numbers) -> Distribution:
    n.only("values", "probabilities")
    if not n.given("values"):
        raise n.refuse("a law 'discrete' needs values")
    values = [n.in_si(value, "values") for value in n.law.values]
    if len(values) < 2 or len(set(values)) < len(values):
        raise n.refuse("a law 'discrete' needs at least two values, none twice")
    if n.given("probabilities"):
        shares = [_probability(n, share) for share in n.law.probabilities]
    else:
        shares = [1 / len(values)] * len(values)
    if len(shares) != len(values) or abs(sum(shares) - 1) > 1e-9 or not min(shares) > 0:
        raise n.refuse(
            f"probabilities must be {len(values)} numbers above zero whose sum is 1, got "
            f"{', '.join(f'{share:g}' for share in shares)}"
        )
    order = sorted(range(len(values)), key=values.__getitem__)
    return Discrete(tuple(values[k] for k in order), tuple(shares[k] for k in order))


def _stepped(at: Sequence[float], values: Sequence[float]) -> Distribution:
    """Distribution whose distribution function is linear between given points."""
    import numpy as np
    from scipy.stats import rv_histogram

    return rv_histogram((np.diff(at), np.asarray(values)), density=False).freeze()


def _is_table(table: Any) -> bool:
    return isinstance(table, list | tuple) and all(
        isinstance(row, list | tuple) and len(row) == 2 for row in table
    )


def _probability(n: _Numbers, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= 1:
        raise n.refuse(f"a probability must be a number between 0 and 1, got {value!r}")
    return float(value)


def _rises(numbers: Sequence[float]) -> bool:
    return all(a < b for a, b in pairwise(numbers))


_MAKERS = {
    "normal": _normal,
    "lognormal": _lognormal,
    "uniform": _uniform,
    "triangular": _triangular,
    "truncated_normal": _truncated_normal,
    "gumbel": _gumbel,
    "weibull": _weibull,
    "beta": _beta,
    "quantiles": _quantiles,
    "sample": _sample,
    "discrete": _discrete,
}
