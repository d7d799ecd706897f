"""The adaptive design as a fold over its batches: absorb, propose, stop.

    state = AdaptiveState.empty(n_parameters, n_responses)
    for batch in stored:
        state = absorb(state, batch.points, batch.values, batch.lost, batch.predicted)

Every decision follows from this stored history, so a design is resumed by reading it once more.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.errors import UserError
from maglev.uncertainty.surrogate import Fit, Surrogate, checked_points

Batch = Callable[[Surrogate, FloatArray, FloatArray, int], IntArray]
"""A criterion of ``learning`` with its options bound: (surrogate, occupied, candidates, n_new)."""


@dataclass(frozen=True, kw_only=True)
class AdaptiveState:
    """Samples and outcomes after some batches.

    Parameters
    ----------
    points : (sample, parameter)
        Every sample so far, standardised [-].
    values : (sample, response)
        Responses [unit of the response]; NaN exactly where ``lost``.
    lost : (sample,) of bool
        Which samples have no response.
    round_index : (sample,)
        Round in which each sample was run; 0 is the first design.
    error : (round, response)
        Largest absolute difference between prediction and run in each round, over the standard
        deviation of the first design [-]; NaN exactly where ``tested`` is false.
    tested : (round,) of bool
        Whether the round had a prediction and a sample that held; never so for the first design.
    """

    points: FloatArray
    values: FloatArray
    lost: BoolArray
    round_index: IntArray
    error: FloatArray
    tested: BoolArray

    @classmethod
    def empty(cls, n_parameters: int, n_responses: int) -> "AdaptiveState":
        """The state before any batch."""
        return cls(
            points=np.empty((0, n_parameters)),
            values=np.empty((0, n_responses)),
            lost=np.empty(0, dtype=bool),
            round_index=np.empty(0, dtype=np.int64),
            error=np.empty((0, n_responses)),
            tested=np.empty(0, dtype=bool),
        )

    @property
    def training(self) -> tuple[FloatArray, FloatArray]:
        """Points (held, parameter) and values (held, response) of the samples that held."""
        return self.points[~self.lost], self.values[~self.lost]


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """Points of the next round with their predictions.

    Parameters
    ----------
    points : (new, parameter)
        Standardised points to run [-].
    predicted : (new, response)
        Predictions of the surrogate before the runs [unit of the response]; to be stored
        with the batch and given to ``absorb``.
    surrogate
        The surrogate that the choice is based on.
    """

    points: FloatArray
    predicted: FloatArray
    surrogate: Surrogate


def absorb(
    state: AdaptiveState,
    points: npt.ArrayLike,
    values: npt.ArrayLike,
    lost: npt.ArrayLike | None = None,
    predicted: npt.ArrayLike | None = None,
) -> AdaptiveState:
    """The state after one more batch.

    Parameters
    ----------
    state
        Samples and outcomes so far.
    points : (new, parameter)
        Standardised points that were run [-].
    values : (new, response)
        Their responses [unit of the response]; NaN exactly where ``lost``.
    lost : (new,) of bool
        Which of them have no response; none if not given.
    predicted : (new, response)
        Predictions made before the runs [unit of the response]; without them the round has no
        error and proves nothing.

    Returns
    -------
    state
        The state with the batch.

    Raises
    ------
    UserError
        If shapes disagree, the batch is empty, values are not finite where the sample held or are
        given where it was lost, a point was run before or twice, or the first design has fewer
        than two samples that held or a constant response.

    References
    ----------
    Mo et al., Water Resour. Res. 53 (2017) 10802–10823; docs/theory/adaptive_sampling.md, sec. 3.

    Examples
    --------
    >>> state = AdaptiveState.empty(2, 1)
    >>> state = absorb(state, [[0.0, 0.0], [1.0, 0.0]], [[3.0], [np.nan]], lost=[False, True])
    >>> state.training[1]
    array([[3.]])
    """
    n_parameters, n_responses = state.points.shape[1], state.values.shape[1]
    points = checked_points(points, n_parameters)
    values = np.array(values, dtype=np.float64)
    n = points.shape[0]
    lost = np.zeros(n, dtype=bool) if lost is None else np.array(lost)
    if n == 0:
        raise UserError("a batch must have at least one point, got none; propose one")
    if values.shape != (n, n_responses):
        raise UserError(
            f"values have shape {values.shape}, expected (new, response) = ({n}, {n_responses})"
        )
    if lost.dtype != np.bool_ or lost.shape != (n,):
        raise UserError(
            f"lost must be {n} booleans, one per point, got {lost.dtype} of shape {lost.shape}"
        )
    wrong = np.flatnonzero(np.where(lost, ~np.isnan(values).all(1), ~np.isfinite(values).all(1)))
    if wrong.size:
        expected = "NaN in every response" if lost[wrong[0]] else "finite values"
        raise UserError(
            f"values must be finite where a sample held and NaN where it was lost, got "
            f"{values[wrong[0]]} at point {wrong[0]}, expected {expected}; correct its status"
        )
    together = np.concatenate([state.points, points])
    if np.unique(together, axis=0).shape[0] < together.shape[0]:
        raise UserError(
            f"points of a batch must be new, got {together.shape[0]} samples at only "
            f"{np.unique(together, axis=0).shape[0]} different points; a run is never repeated"
        )

    error, tested = np.full(n_responses, np.nan), False
    if predicted is not None:
        predicted = np.array(predicted, dtype=np.float64)
        if predicted.shape != (n, n_responses) or not np.isfinite(predicted).all():
            raise UserError(
                f"predictions must be finite with shape (new, response) = ({n}, {n_responses}), "
                f"got shape {predicted.shape}"
            )
        first = (state.round_index == 0) & ~state.lost
        if first.sum() < 2:
            raise UserError(
                f"scaling the error needs at least two samples of the first design that held, got "
                f"{first.sum()}; enlarge the first design"
            )
        scale = state.values[first].std(axis=0)
        level = np.flatnonzero(scale == 0.0)
        if level.size:
            raise UserError(
                f"response {level[0]} must vary over the first design to scale the error, got "
                f"{state.values[first][0, level[0]]} everywhere; leave it out"
            )
        tested = not lost.all()
        if tested:
            error = np.abs(predicted - values)[~lost].max(axis=0) / scale
    number = state.tested.size
    return AdaptiveState(
        points=together,
        values=np.concatenate([state.values, values]),
        lost=np.concatenate([state.lost, lost]),
        round_index=np.concatenate([state.round_index, np.full(n, number, dtype=np.int64)]),
        error=np.concatenate([state.error, error[None]]),
        tested=np.append(state.tested, tested),
    )


def propose(
    state: AdaptiveState, fit: Fit, batch: Batch, candidates: npt.ArrayLike, n_new: int
) -> Proposal:
    """Choose the next points and predict their responses.

    Parameters
    ----------
    state
        Samples and outcomes so far.
    fit
        Fits the surrogate to points and values of the samples that held.
    batch
        The criterion of choice, such as ``learning.taylor_batch`` with its options bound.
    candidates : (candidate, parameter)
        Standardised points to choose from [-].
    n_new
        How many to choose.

    Returns
    -------
    proposal
        Points, predictions and the surrogate.

    Raises
    ------
    UserError
        If the samples that held cannot be fitted or the criterion cannot choose.

    Examples
    --------
    >>> from maglev.uncertainty.learning import taylor_batch
    >>> from maglev.uncertainty.rbf import fit_rbf
    >>> points = np.linspace(-2.0, 2.0, 5)[:, None]
    >>> state = absorb(AdaptiveState.empty(1, 1), points, points**2)
    >>> propose(state, fit_rbf, taylor_batch, [[0.1], [3.0]], 1).points
    array([[0.1]])
    """
    candidates = checked_points(candidates, state.points.shape[1])
    surrogate = fit(*state.training)
    points = candidates[batch(surrogate, state.points, candidates, n_new)]
    return Proposal(points=points, predicted=surrogate.predict(points), surrogate=surrogate)


def decision(state: AdaptiveState, *, threshold: float, n_rounds: int, n_largest: int) -> str:
    """Decide whether to go on, or for which reason to stop.

    Parameters
    ----------
    state
        Samples and outcomes so far.
    threshold
        Error of a round, in standard deviations of each response, that counts as small [-].
    n_rounds
        Number of last rounds that must all stay at or below it, each tested, in every response.
    n_largest
        Largest number of runs, lost ones included.

    Returns
    -------
    decision
        A word of `maglev.vocabulary.DECISIONS`; small errors take precedence over the largest
        number of runs.

    Raises
    ------
    UserError
        If a setting is not positive.

    Examples
    --------
    >>> state = absorb(AdaptiveState.empty(1, 1), [[0.0], [1.0]], [[0.0], [1.0]])
    >>> decision(state, threshold=0.01, n_rounds=3, n_largest=100)
    'go_on'
    >>> decision(state, threshold=0.01, n_rounds=3, n_largest=2)
    'largest_number_of_runs'
    """
    if not (threshold > 0.0 and n_rounds >= 1 and n_largest >= 1):
        raise UserError(
            "threshold, number of rounds and largest number of runs must be positive, got "
            f"{threshold}, {n_rounds} and {n_largest}"
        )
    last = slice(max(state.tested.size - n_rounds, 0), None)
    if state.tested.size >= n_rounds and state.tested[last].all():
        if (state.error[last] <= threshold).all():
            return "error_below_threshold"
    if state.lost.size >= n_largest:
        return "largest_number_of_runs"
    return "go_on"
