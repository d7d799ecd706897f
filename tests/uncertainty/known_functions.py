"""Functions of normal inputs whose exceedance is an integral over two of them.

In turned coordinates v = Q u the response is ``h(v_1, v_2) + c (v_3 + ... + v_s)/√(s - 2)``, and
which samples are lost depends on v_1 and v_2.  So the exceedance is a double integral.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import optimize, stats

Array = np.ndarray


def never(a: Array, b: Array) -> Array:
    """No sample is lost."""
    return np.zeros(np.broadcast(a, b).shape, dtype=bool)


@dataclass(frozen=True, kw_only=True)
class Known:
    """A function with known answers.

    Parameters
    ----------
    title
        Words for a table.
    of_two
        h(v_1, v_2), vectorised.
    rest
        c, the deviation of what the other inputs add.
    n_inputs
        s.
    lost_of_two
        Where samples are lost.
    regular
        Whether a smooth surrogate of a hundred runs can be expected to find the tail.
    """

    title: str
    of_two: Callable[[Array, Array], Array]
    rest: float = 0.2
    n_inputs: int = 4
    lost_of_two: Callable[[Array, Array], Array] = never
    regular: bool = False

    @property
    def turn(self) -> Array:
        """Q (input, input), orthogonal and the same at every call."""
        drawn = np.random.default_rng(self.n_inputs).standard_normal((self.n_inputs,) * 2)
        return np.linalg.qr(drawn)[0]

    def run(self, points: Array) -> tuple[Array, Array]:
        """Responses (sample, 1), NaN where lost, and which samples (sample,) were lost."""
        v = points @ self.turn.T
        rest = v[:, 2:].sum(axis=1) / np.sqrt(self.n_inputs - 2)
        lost = self.lost_of_two(v[:, 0], v[:, 1])
        values = self.of_two(v[:, 0], v[:, 1]) + self.rest * rest
        return np.where(lost, np.nan, values)[:, None], lost

    def _grid(self) -> tuple[Array, Array, Array]:
        """h, lost and weight on a fine grid of v_1 and v_2."""
        edge = np.arange(-6.5, 6.5001, 0.0125) + 0.0031
        weight = stats.norm.pdf(edge)
        weight /= weight.sum()
        a, b = edge[:, None], edge[None, :]
        shape = (edge.size, edge.size)
        h, lost = np.broadcast_to(self.of_two(a, b), shape), self.lost_of_two(a, b)
        return h, lost, weight[:, None] * weight

    @property
    def lost_probability(self) -> float:
        """P(lost)."""
        _, lost, weight = self._grid()
        return float(weight[lost].sum())

    def limits(self, levels: Array) -> tuple[Array, float]:
        """Limits (level,), infinite where losses exceed the level, and the deviation of Y."""
        h, lost, weight = self._grid()
        h, weight, away = h[~lost], weight[~lost], weight[lost].sum()
        kept = weight > 1e-16
        h, weight = h[kept], weight[kept]
        mean = np.average(h, weights=weight)
        sigma = np.sqrt(np.average((h - mean) ** 2, weights=weight) + self.rest**2)

        def beyond(y: float) -> float:
            near = h > y - 8.0 * self.rest
            return away + weight[near] @ stats.norm.sf((y - h[near]) / self.rest)

        ends = h.min() - 8.0 * self.rest, h.max() + 8.0 * self.rest
        found = [
            optimize.brentq(lambda y, p=p: beyond(y) - p, *ends, xtol=1e-7 * sigma)
            if p > away
            else np.inf
            for p in np.asarray(levels)
        ]
        return np.array(found), float(sigma)


def _rugged(a: Array, b: Array) -> Array:
    """A standard normal number made of the decimals of a sine: noise that repeats."""
    c = np.abs(np.sin(12.9898 * a + 78.233 * b) * 43758.5453) % 1.0
    return stats.norm.ppf(np.clip(c, 1e-9, 1.0 - 1e-9))


KNOWN = {
    "smooth": Known(
        title="smooth",
        of_two=lambda a, b: np.exp(0.4 * a) + 0.3 * np.sin(1.5 * b),
        regular=True,
    ),
    "smooth_10": Known(
        title="smooth, ten inputs",
        of_two=lambda a, b: np.exp(0.3 * a) + 0.2 * np.sin(b) + 0.1 * a * b,
        n_inputs=10,
        regular=True,
    ),
    "kinked": Known(
        title="kinked",
        of_two=lambda a, b: np.maximum(np.maximum(0.5 * a, 0.4 * b - 0.3 * a), 0.3 * np.abs(b)),
        rest=0.1,
    ),
    "cliff": Known(
        title="cliff (lost beyond a curved border)",
        of_two=lambda a, b: np.exp(-0.4 * a) + 0.2 * np.sin(2.0 * b),
        lost_of_two=lambda a, b: a < -3.4 + 0.1 * b**2,
    ),
    "two_cliffs": Known(
        title="two cliffs",
        of_two=lambda a, b: np.exp(-0.4 * a) + 0.2 * b,
        lost_of_two=lambda a, b: (a < -3.5) | (b > 3.5),
    ),
    "stray": Known(
        title="stray tail behind an unvisited region",
        of_two=lambda a, b: 1.0 + 5.0 * np.maximum(b - 2.5, 0.0) + 0.0 * a,
        rest=0.01,
    ),
    "jump": Known(
        title="jump of the response",
        of_two=lambda a, b: 0.3 * b + 2.0 * (a > 2.6),
    ),
    "noise": Known(title="constant but for noise", of_two=_rugged, rest=0.05),
}
"""Functions by their names in tables."""
