"""Limits of the extremes at the failure probabilities, with intervals and status."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import coordinates, extremes, lost, population, responses_of
from maglev.stages.reads import PREDICTING, RESPONSES_OF_STUDY
from maglev.stages.surrogate import loss_comment, stored_predictor
from maglev.uncertainty.reliability import (
    Limits,
    binomial_interval,
    error_range_near,
    sample_limits,
    surrogate_limits,
)
from maglev.vocabulary import BASELINE, DESIGNED, GIVEN, INFINITE, LIMIT_STATUS, Response

_LOG = logging.getLogger(__name__)


def dataset(
    config: Config,
    baseline: xr.Dataset | None = None,
    design: xr.Dataset | None = None,
    surrogate: xr.Dataset | None = None,
) -> xr.Dataset:
    """Limits of a baseline, or of what a surrogate predicts.

    Parameters
    ----------
    config
        The configuration.
    baseline
        Layout ``runs``; in its place the two others, as `of_surrogate` takes them.

    Returns
    -------
    dataset
        Layout ``limits``.
    """
    if baseline is not None:
        return of_baseline(config, baseline)
    if design is None or surrogate is None:
        raise UserError("limits: needs a baseline, or a design with its surrogate")
    return of_surrogate(config, design, surrogate)


def of_baseline(config: Config, runs: xr.Dataset) -> xr.Dataset:
    """Limits of independent runs with exact order-statistic intervals.

    Parameters
    ----------
    config
        The configuration.
    runs
        Layout ``runs``: the baseline.

    Returns
    -------
    dataset
        Layout ``limits``.
    """
    responses = config.responses_of_study
    values, away = extremes(runs, responses), lost(runs)
    n_lost = int(np.count_nonzero(away))
    low, high = binomial_interval(n_lost, away.size, config.study.confidence)
    result = _put_together(
        config,
        responses,
        baseline_limits(config, values, away),
        baseline_limits(config, values[~away], away[~away]),
        lost_probability=(n_lost / away.size, float(low), float(high)),
        n_runs=away.size,
        sigma=values[~away].std(axis=0),
    )
    result["limit"].attrs["comment"] = "interval: order statistics, exact"
    result["lost_probability"].attrs["comment"] = "counted; the interval is the exact binomial one"
    return result


def baseline_limits(config: Config, values: FloatArray, away: np.ndarray) -> list[Limits]:
    """Limits of each response of independent runs.

    Parameters
    ----------
    config
        The configuration: levels and confidence.
    values : (sample, response)
        Extremes [their unit]; any value where ``away``.
    away : (sample,) of bool
        Whether each sample was lost.
    """
    return [
        sample_limits(
            values[~away, response],
            config.study.failure_probability,
            n_lost=int(np.count_nonzero(away)),
            confidence=config.study.confidence,
        )
        for response in range(values.shape[1])
    ]


def of_surrogate(config: Config, design: xr.Dataset, surrogate: xr.Dataset) -> xr.Dataset:
    """Limits of a surrogate on a large population, with its own error in the interval.

    The population is a scrambled Sobol' set taken for independent draws, which makes the sampling
    part of the interval too wide rather than too narrow.  Where no run was lost, the probability
    of loss enters the limits as zero; its own interval states its uncertainty.

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
        Layout ``limits``.

    Raises
    ------
    UserError
        If all of the population is likely lost.

    References
    ----------
    docs/theory/reliability.md, eqs. (5), (6), (7) and (9).
    """
    found = stored_predictor(config, design, surrogate)
    training, residuals, loss = (
        found.surrogate.values,
        found.surrogate.leave_one_out(),
        found.loss,
    )
    points = population(config.seed, config.study.n_population, design.sizes["parameter"])
    held = found.held(points)
    if not held.any():
        raise UserError(f"all {held.size} points of the population are predicted to be lost")
    predictions = found.surrogate.predict(points[held])
    learnt = loss.region is not None
    losing = {
        "lost_probability": loss.probability,
        "lost_interval": (loss.lower, loss.upper) if learnt else None,
    }
    limits, held_limits = (
        [
            limits_off(
                config, predictions[:, response], training[:, response], residuals[:, response], of
            )
            for response in range(training.shape[1])
        ]
        for of in (losing, {})
    )
    result = _put_together(
        config,
        responses_of(surrogate),
        limits,
        held_limits,
        lost_probability=(loss.probability, loss.lower, loss.upper),
        n_runs=design.sizes["sample"],
        sigma=predictions.std(axis=0),
    )
    result["limit"].attrs["comment"] = (
        "interval: order statistics of the population moved by the range of leave-one-out "
        "residuals of the training samples nearest to the limit"
        + ("" if learnt else "; no run was lost, the lost probability counts as zero")
    )
    result["lost_probability"].attrs["comment"] = loss_comment(loss)
    return result


def limits_off(
    config: Config,
    predictions: FloatArray,
    training: FloatArray,
    residuals: FloatArray,
    losing: dict[str, Any],
) -> Limits:
    """Limits of one response by a surrogate, each with the range of errors near it.

    Parameters
    ----------
    config
        The configuration: levels and confidence.
    predictions : (point,)
        Of the surrogate, at equally likely points that are held [unit of the response].
    training, residuals : (sample,)
        Values of the runs and their leave-one-out residuals [unit].
    losing
        ``lost_probability`` and ``lost_interval``; empty for limits given that levitation holds.
    """
    levels = config.study.failure_probability
    common = {**losing, "confidence": config.study.confidence}
    plain = surrogate_limits(predictions, levels, error_range=(0.0, 0.0), **common)
    # a limit that is not given has no place; any range serves it
    at = np.where(np.isnan(plain.limit), training.max(), plain.limit)
    low, high = error_range_near(at, training, residuals, config.study.confidence)
    ends = [
        surrogate_limits(predictions, level, error_range=(low[k], high[k]), **common)
        for k, level in enumerate(levels)
    ]
    return replace(
        plain,
        lower=np.concatenate([one.interval[0] for one in ends]),
        upper=np.concatenate([one.interval[1] for one in ends]),
    )


def status_numbers(limits: Limits) -> list[int]:
    """Status of each limit (level,), as the code in a file."""
    return [LIMIT_STATUS.index(status) for status in limits.status]


def _put_together(
    config: Config,
    responses: Sequence[Response],
    limits: list[Limits],
    held_limits: list[Limits],
    *,
    lost_probability: tuple[float, float, float],
    n_runs: int,
    sigma: FloatArray,
) -> xr.Dataset:
    level = ("response", "failure_probability")
    columns: dict[str, tuple[tuple[str, ...], np.ndarray]] = {}
    for name, of in (("limit", limits), ("held_limit", held_limits)):
        status = np.array([status_numbers(one) for one in of])
        infinite = status == LIMIT_STATUS.index(INFINITE)
        for end, suffix in (("limit", ""), ("lower", "_low"), ("upper", "_high")):
            values = np.array([getattr(one, end) for one in of])
            if end != "lower":  # losses alone are likelier: no finite limit, no upper end
                values = np.where(infinite, np.inf, values)
            columns[f"{name}{suffix}"] = (level, values)
        columns[f"{name}_status"] = (level, status)
    for response, name in enumerate(responses):
        said = [
            f"{p:g}: {value:.4g}" if LIMIT_STATUS[code] == GIVEN else f"{p:g}: {LIMIT_STATUS[code]}"
            for p, value, code in zip(
                config.study.failure_probability,
                columns["limit"][1][response],
                columns["limit_status"][1][response],
                strict=True,
            )
        ]
        _LOG.info("%s %s", name, ", ".join(said))
    return xr.Dataset(
        {
            **columns,
            "lost_probability": ((), lost_probability[0]),
            "lost_probability_low": ((), lost_probability[1]),
            "lost_probability_high": ((), lost_probability[2]),
            "n_runs": ((), n_runs),
            "sigma": ("response", sigma),
        },
        coords=coordinates(responses, failure_probability=list(config.study.failure_probability)),
    )


STAGE = Stage(
    name="limits",
    of="method",
    reads=(*PREDICTING, *RESPONSES_OF_STUDY, "study.failure_probability"),
    inputs={
        "baseline": Input("runs", methods=(BASELINE,)),
        "design": Input("design", methods=DESIGNED),
        "surrogate": Input("surrogate", methods=DESIGNED),
    },
    layout="limits",
    compute=dataset,
)
