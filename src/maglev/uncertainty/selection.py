"""One surrogate for each response: a named kind, or the best of all by leave-one-out.

A file need hold only the kinds and their few parameters: with the training data they give the same
surrogate again, without a search.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from maglev.arrays import FloatArray, IntArray
from maglev.errors import UserError
from maglev.uncertainty.kriging import Kriging, conditioned_kriging, fit_kriging
from maglev.uncertainty.rbf import RBF, ScaledRBF, fit_rbf, fit_scaled_rbf
from maglev.uncertainty.surrogate import best_by_leave_one_out, checked_training
from maglev.vocabulary import SURROGATES

CHOICES = (*SURROGATES, "best")
"""Choices of a surrogate: one kind for all responses, or the best kind for each."""

_FITS: dict[str, Callable[[FloatArray, FloatArray], RBF | ScaledRBF | Kriging]] = {
    "rbf": fit_rbf,
    "scaled_rbf": fit_scaled_rbf,
    "kriging": fit_kriging,
}


@dataclass(frozen=True, kw_only=True)
class Selected:
    """Surrogates of several kinds on common training points, each of some of the responses.

    Parameters
    ----------
    points : (sample, parameter)
        Standardised training points [-].
    values : (sample, response)
        Training values [unit of the response].
    kinds : (response,)
        One of `maglev.vocabulary.SURROGATES` for each response.
    length : (response, parameter)
        Length of each input [-]; ones for ``"rbf"``, over their geometric mean for
        ``"scaled_rbf"``.
    amplitude : (response,)
        Prior variance over the squared deviation of the values [-]; NaN but for ``"kriging"``.
    parts
        For each kind that occurs, the numbers of its responses and their surrogate.
    """

    points: FloatArray
    values: FloatArray
    kinds: tuple[str, ...]
    length: FloatArray
    amplitude: FloatArray
    parts: tuple[tuple[IntArray, RBF | ScaledRBF | Kriging], ...]

    def predict(self, points: npt.ArrayLike) -> FloatArray:
        """Values (point, response) at standardised ``points`` (point, parameter)."""
        values = np.empty((len(np.asarray(points)), len(self.kinds)))
        for responses, surrogate in self.parts:
            values[:, responses] = surrogate.predict(points)
        return values

    def gradient(self, points: npt.ArrayLike) -> FloatArray:
        """Gradients (point, response, parameter) at ``points`` (point, parameter)."""
        gradient = np.empty((len(np.asarray(points)), len(self.kinds), self.points.shape[1]))
        for responses, surrogate in self.parts:
            gradient[:, responses] = surrogate.gradient(points)
        return gradient

    def leave_one_out(self) -> FloatArray:
        """Residuals (sample, response): value less the prediction made without that sample."""
        residuals = np.empty_like(self.values)
        for responses, surrogate in self.parts:
            residuals[:, responses] = surrogate.leave_one_out()
        return residuals

    def standard_deviation(self, points: npt.ArrayLike) -> FloatArray:
        """Posterior deviations (point, response) of Kriging; NaN for radial basis functions."""
        deviation = np.full((len(np.asarray(points)), len(self.kinds)), np.nan)
        for responses, surrogate in self.parts:
            if isinstance(surrogate, Kriging):
                deviation[:, responses] = surrogate.standard_deviation(points)
        return deviation


def fit_selected(points: npt.ArrayLike, values: npt.ArrayLike, choice: str) -> Selected:
    """Fit the surrogate of a given kind, or all kinds and keep the best for each response.

    Parameters
    ----------
    points : (sample, parameter)
        Standardised training points [-].
    values : (sample, response) or (sample,)
        Training values [unit of the response]; lost samples are left out before.
    choice
        One of ``CHOICES``.  ``"best"`` is the smallest root mean square leave-one-out residual;
        a kind that refuses the training data (points that nearly coincide) is then left out.

    Returns
    -------
    surrogate
        The fitted surrogate.

    Raises
    ------
    UserError
        If the choice is unknown or the training data cannot be used.

    References
    ----------
    docs/theory/surrogates.md, sec. 5.

    Examples
    --------
    >>> points = np.linspace(-2.0, 2.0, 9)[:, None]
    >>> fit_selected(points, np.sin(points), "rbf").kinds
    ('rbf',)
    """
    if choice not in CHOICES:
        raise UserError(f"surrogate must be one of {', '.join(CHOICES)}, got '{choice}'")
    points, values = checked_training(points, values)
    fitted: dict[str, RBF | ScaledRBF | Kriging] = {}
    for kind in SURROGATES if choice == "best" else (choice,):
        try:
            fitted[kind] = _FITS[kind](points, values)
            if choice == "best":
                fitted[kind].leave_one_out()
        except (UserError, np.linalg.LinAlgError):
            fitted.pop(kind, None)
            if choice != "best" or (kind == SURROGATES[-1] and not fitted):
                raise
    kinds = best_by_leave_one_out(fitted) if len(fitted) > 1 else (*fitted,) * values.shape[1]
    length = np.ones((values.shape[1], points.shape[1]))
    amplitude = np.full(values.shape[1], np.nan)
    for response, kind in enumerate(kinds):
        surrogate = fitted[kind]
        if not isinstance(surrogate, RBF):
            length[response] = surrogate.length[response]
        if isinstance(surrogate, Kriging):
            amplitude[response] = surrogate.amplitude[response]
    return rebuilt(points, values, kinds, length, amplitude)


def rebuilt(
    points: npt.ArrayLike,
    values: npt.ArrayLike,
    kinds: tuple[str, ...],
    length: npt.ArrayLike,
    amplitude: npt.ArrayLike,
) -> Selected:
    """Rebuild a surrogate from its training data, kinds and parameters.

    Parameters
    ----------
    points, values, kinds, length, amplitude
        As `Selected` has them.

    Returns
    -------
    surrogate
        The original surrogate, number for number.

    Raises
    ------
    UserError
        If a kind is unknown, shapes disagree or the training data cannot be used.

    Examples
    --------
    >>> points = np.linspace(-2.0, 2.0, 9)[:, None]
    >>> first = fit_selected(points, np.sin(points), "rbf")
    >>> again = rebuilt(first.points, first.values, first.kinds, first.length, first.amplitude)
    >>> bool((again.predict([[0.1]]) == first.predict([[0.1]])).all())
    True
    """
    points, values = checked_training(points, values)
    length, amplitude = np.array(length, dtype=float), np.array(amplitude, dtype=float)
    n_responses = values.shape[1]
    if len(kinds) != n_responses or not set(kinds) <= set(SURROGATES):
        raise UserError(
            f"kinds must be {n_responses} of {', '.join(SURROGATES)}, one per response, got {kinds}"
        )
    if length.shape != (n_responses, points.shape[1]) or amplitude.shape != (n_responses,):
        raise UserError(
            f"lengths and amplitudes have shapes {length.shape} and {amplitude.shape}, expected "
            f"(response, parameter) = ({n_responses}, {points.shape[1]}) and ({n_responses},)"
        )
    parts: list[tuple[IntArray, RBF | ScaledRBF | Kriging]] = []
    for kind in SURROGATES:
        responses = np.flatnonzero([one == kind for one in kinds])
        if not responses.size:
            continue
        some = values[:, responses]
        if kind == "rbf":
            part: RBF | ScaledRBF | Kriging = fit_rbf(points, some)
        elif kind == "scaled_rbf":
            single = (fit_rbf(points, values[:, [r]], length=length[r]) for r in responses)
            part = ScaledRBF(points=points, values=some, responses=tuple(single))
        else:
            part = conditioned_kriging(
                points, some, length=length[responses], amplitude=amplitude[responses]
            )
        parts.append((responses, part))
    return Selected(
        points=points,
        values=values,
        kinds=tuple(kinds),
        length=length,
        amplitude=amplitude,
        parts=tuple(parts),
    )
