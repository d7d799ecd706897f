"""Compiled: a chain of borders that agree with the samples seen."""

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def _log_likelihood(signed: np.ndarray, border: np.ndarray) -> float:
    """Σ ln(1/(1 + exp(−signed · border))) without overflow.

    Parameters
    ----------
    signed : (sample, feature)
        Features times sharpness, with the sign of the outcome.
    border : (feature,)
        Coefficients.
    """
    total = 0.0
    for i in range(signed.shape[0]):
        logit = 0.0
        for j in range(border.size):
            logit += signed[i, j] * border[j]
        total += min(logit, 0.0) - np.log1p(np.exp(-abs(logit)))
    return total


@njit(cache=True, error_model="numpy")
def border_chain(
    signed: np.ndarray,
    start: np.ndarray,
    n_before: int,
    n_between: int,
    rng: np.random.Generator,
    borders: np.ndarray,
) -> None:
    """Draw from a standard normal prior times the logistic likelihood by elliptical slices.

    Parameters
    ----------
    signed : (sample, feature)
        Features times sharpness, with the sign of the outcome.
    start : (feature,)
        Where the chain starts.
    n_before
        Steps before the first draw that is kept.
    n_between
        Steps from one kept draw to the next.
    rng
        Source of the draws.
    borders : (draw, feature)
        Receives the draws.

    References
    ----------
    Murray, Adams, MacKay, Elliptical slice sampling, Proc. AISTATS (2010), fig. 2.
    """
    border = start.copy()
    ellipse, trial = np.empty_like(start), np.empty_like(start)
    likelihood = _log_likelihood(signed, border)
    for step in range(-n_before, borders.shape[0] * n_between):
        for j in range(border.size):
            ellipse[j] = rng.standard_normal()
        level = likelihood + np.log(1.0 - rng.random())
        angle = 2.0 * np.pi * rng.random()
        lower, upper = angle - 2.0 * np.pi, angle
        while True:
            for j in range(border.size):
                trial[j] = border[j] * np.cos(angle) + ellipse[j] * np.sin(angle)
            likelihood = _log_likelihood(signed, trial)
            if likelihood >= level:  # met at angle 0 at the latest
                break
            if angle < 0.0:
                lower = angle
            else:
                upper = angle
            angle = lower + (upper - lower) * rng.random()
        border[:] = trial
        if step >= 0 and step % n_between == 0:
            borders[step // n_between] = border
