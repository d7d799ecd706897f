"""Probabilities of the limit states of a passage, with intervals, by each method."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

import numpy as np
import xarray as xr

from maglev.arrays import BoolArray, FloatArray
from maglev.errors import UserError
from maglev.parameters import Config, LimitState
from maglev.stage import Input, Stage
from maglev.stages.extremes import lost, population, responses_of
from maglev.stages.reads import PREDICTING
from maglev.stages.surrogate import Predictor, loss_comment, stored_predictor
from maglev.uncertainty.limit_states import (
    IMPOSSIBLE,
    Probability,
    counted,
    error_growth,
    predicted,
    reliability_index,
    with_losses,
)
from maglev.uncertainty.reliability import error_range_near
from maglev.vocabulary import BASELINE, DESIGNED, LOST

_LOG = logging.getLogger(__name__)

N_POPULATIONS = 2
"""Size of the population over that of the limits: none of 262,144 points bounds a probability by
1.4e-5, half of that of once a year with 36,500 trains."""

_ENDS = {"": "value", "_low": "low", "_high": "high"}


def dataset(
    config: Config,
    baseline: xr.Dataset | None = None,
    design: xr.Dataset | None = None,
    surrogate: xr.Dataset | None = None,
) -> xr.Dataset:
    """Probabilities of the limit states by a baseline, or by what a surrogate predicts.

    Parameters
    ----------
    config
        The configuration.
    baseline
        Layout ``runs``; in its place the two others, as `of_surrogate` takes them.

    Returns
    -------
    dataset
        Layout ``limit_states``.
    """
    if baseline is not None:
        return of_baseline(config, baseline)
    if design is None or surrogate is None:
        raise UserError("limit states: needs a baseline, or a design with its surrogate")
    return of_surrogate(config, design, surrogate)


def exceeded(
    states: Mapping[str, LimitState], beyond: Mapping[str, BoolArray], away: BoolArray
) -> dict[str, BoolArray]:
    """Which samples exceed each limit state, lost levitation first.

    Parameters
    ----------
    states
        The limit states by name.
    beyond : (sample,)
        For each limit state of one response, whether its limit is exceeded; anything where
        ``away``.
    away : (sample,)
        Which samples have lost levitation: they exceed every limit state.

    Returns
    -------
    exceeded : (sample,)
        By name of the limit state.
    """

    def one(name: str) -> BoolArray:
        if name == LOST:
            return away
        state = states[name]
        if state.response is not None:
            return beyond[name] | away
        parts = np.stack([one(part) for part in state.parts])
        joined: BoolArray = np.any(parts, axis=0) if state.any_of else np.all(parts, axis=0)
        return joined

    return {name: one(name) for name in (LOST, *states)}


def _singles(states: Mapping[str, LimitState]) -> dict[str, LimitState]:
    """The limit states of one response."""
    return {name: state for name, state in states.items() if state.response is not None}


def _possible(states: Mapping[str, LimitState]) -> dict[str, bool]:
    """Which limit states a passage that holds can exceed."""
    everything = {name: np.array([True]) for name in _singles(states)}
    return {
        name: bool(one[0]) for name, one in exceeded(states, everything, np.array([False])).items()
    }


def of_baseline(config: Config, runs: xr.Dataset) -> xr.Dataset:
    """Count the limit states of independent runs.

    Parameters
    ----------
    config
        The configuration.
    runs
        Layout ``runs``: the baseline.

    Returns
    -------
    dataset
        Layout ``limit_states``; given that levitation holds NaN if no run held.
    """
    states, away = config.limit_states, lost(runs)
    beyond = {
        name: runs[state.response].to_numpy() > state.threshold
        for name, state in _singles(states).items()
    }
    confidence = config.study.confidence
    of_all = exceeded(states, beyond, away)
    unknown = Probability(np.nan, np.nan, np.nan)

    def held(name: str) -> Probability:
        return unknown if away.all() else counted(of_all[name][~away], confidence)

    result = _put_together(
        states,
        {name: counted(one, confidence) for name, one in of_all.items()},
        _given_held(states, held),
        away.size,
    )
    result["probability"].attrs["comment"] = "counted; the interval is the exact binomial one"
    return result


def of_surrogate(config: Config, design: xr.Dataset, surrogate: xr.Dataset) -> xr.Dataset:
    """Find the probabilities of the limit states on a large population, all responses together.

    The interval moves each response by the range of leave-one-out residuals of the training
    samples nearest to its limit, more where it extrapolates, all of them to the same side, and
    holds the ends of the interval of the lost probability.  Where no run was lost, the upper end
    of that is the binomial one: it then stands in every limit state, not in those given that
    levitation holds.

    Parameters
    ----------
    config
        The configuration.
    design
        Layout ``design``.
    surrogate
        Layout ``surrogate``, of this design.

    Returns
    -------
    dataset
        Layout ``limit_states``.

    Raises
    ------
    UserError
        If all of the population is likely lost, or the surrogate does not predict a response.

    References
    ----------
    docs/theory/reliability.md, eqs. (18) to (20).
    """
    states, responses = config.limit_states, responses_of(surrogate)
    for name, state in _singles(states).items():
        if state.response not in responses:
            raise UserError(
                f"limit_states.{name}.response: the surrogate does not predict {state.response}; "
                "compute it again"
            )
    found = stored_predictor(config, design, surrogate)
    n = N_POPULATIONS * config.study.n_population
    predictions = _held_predictions(found, population(config.seed, n, design.sizes["parameter"]))
    none = np.zeros(len(predictions), dtype=bool)
    training, residuals = found.surrogate.values, found.surrogate.leave_one_out()
    beyond: list[dict[str, BoolArray]] = [{}, {}, {}]
    for name, state in _singles(states).items():
        column = responses.index(str(state.response))
        ends = _with_errors(
            state.threshold,
            predictions[:, column],
            training[:, column],
            residuals[:, column],
            config.study.confidence,
        )
        for of, values in zip(beyond, ends, strict=True):
            of[name] = values > state.threshold
    plain, least, most = (exceeded(states, of, none) for of in beyond)

    def given(name: str) -> Probability:
        return predicted(plain[name], least[name], most[name], config.study.confidence)

    loss = found.loss
    losing = Probability(loss.probability, loss.lower, loss.upper)
    of_held = _given_held(states, given)
    result = _put_together(
        states,
        {name: with_losses(one, losing) for name, one in of_held.items()},
        of_held,
        design.sizes["sample"],
    )
    result["probability"].attrs["comment"] = (
        "on a population of the surrogate, all responses together; interval: leave-one-out "
        "residuals near each limit, grown where it extrapolates, sampling, and losses: "
        f"{loss_comment(loss)}"
    )
    return result


def _held_predictions(found: Predictor, points: FloatArray) -> FloatArray:
    """Predictions (held, response) at points (point, parameter) where levitation likely holds."""
    parts = np.array_split(points, N_POPULATIONS)  # no more memory than the limits take
    kept = [part[found.held(part)] for part in parts]
    if not any(len(part) for part in kept):
        raise UserError(f"all {len(points)} points of the population are predicted to be lost")
    return np.concatenate([found.surrogate.predict(part) for part in kept if len(part)])


def _with_errors(
    threshold: float,
    predictions: FloatArray,
    training: FloatArray,
    residuals: FloatArray,
    confidence: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Predictions (point,) as they are, with the least and with the largest error near a limit."""
    low, high = error_range_near(threshold, training, residuals, confidence)
    growth = error_growth(predictions, training)
    return predictions, predictions + low[0] * growth, predictions + high[0] * growth


def _given_held(
    states: Mapping[str, LimitState], estimate: Callable[[str], Probability]
) -> dict[str, Probability]:
    """Probability of each limit state given that levitation holds, zero where it cannot be."""
    return {
        name: estimate(name) if possible else IMPOSSIBLE
        for name, possible in _possible(states).items()
    }


def _put_together(
    states: Mapping[str, LimitState],
    of_all: Mapping[str, Probability],
    of_held: Mapping[str, Probability],
    n_runs: int,
) -> xr.Dataset:
    """Dataset of the file from the probabilities of each limit state."""
    columns = {
        f"{prefix}probability{end}": np.array([getattr(one, key) for one in found.values()])
        for prefix, found in (("", of_all), ("held_", of_held))
        for end, key in _ENDS.items()
    }
    for end, other in (("", ""), ("_low", "_high"), ("_high", "_low")):
        columns[f"beta{end}"] = reliability_index(columns[f"probability{other}"])
    for name, one in of_all.items():
        _LOG.info("%s: %.3g [%.3g, %.3g]", name, one.value, one.low, one.high)
    every = [None, *states.values()]  # lost levitation first
    return xr.Dataset(
        {
            "definition": (
                "limit_state",
                [state.definition if state else "levitation is lost" for state in every],
            ),
            "origin": ("limit_state", [state.origin if state else "" for state in every]),
            "state_response": (
                "limit_state",
                [state.response or "none" if state else "none" for state in every],
            ),
            "threshold": (
                "limit_state",
                [state.threshold if state else np.nan for state in every],
            ),
            "target": (
                "limit_state",
                [state.target or np.nan if state else np.nan for state in every],
            ),
            **{name: ("limit_state", values) for name, values in columns.items()},
            "n_runs": ((), n_runs),
        },
        coords={"limit_state": list(of_all)},
    )


STAGE = Stage(
    name="limit_states",
    of="method",
    reads=(*PREDICTING, "limit_states"),
    inputs={
        "baseline": Input("runs", methods=(BASELINE,)),
        "design": Input("design", methods=DESIGNED),
        "surrogate": Input("surrogate", methods=DESIGNED),
    },
    layout="limit_states",
    compute=dataset,
)
