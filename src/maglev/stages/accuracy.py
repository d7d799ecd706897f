"""Accuracy against number of runs: limits of each method against those of the baseline."""

from __future__ import annotations

import logging
from collections.abc import Mapping

import numpy as np
import xarray as xr

from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import coordinates, extremes, lost
from maglev.stages.limits import baseline_limits
from maglev.stages.reads import PREDICTING, RESPONSES_OF_STUDY, SURROGATE_OF_METHODS
from maglev.stages.surrogate import predictor
from maglev.uncertainty.reliability import sample_limits
from maglev.vocabulary import METHODS

_LOG = logging.getLogger(__name__)

N_STEPS = 12
"""Approximate number of sizes at which a method is judged; assumed."""

PAPER_N_RUNS = 273
"""Number of runs for which the paper gives root mean square errors."""


def steps(designs: Mapping[str, xr.Dataset]) -> dict[str, list[int]]:
    """Numbers of runs at which each method is assessed.

    A design that was made in rounds is judged after some of them, evenly spread; a one-stage set
    by its first samples, from as many as the smallest first design of the others has.

    Parameters
    ----------
    designs
        Layout ``design``, by method.

    Returns
    -------
    n_runs
        Ascending, by method.
    """
    ends = {name: design["round_n_runs"].to_numpy() for name, design in designs.items()}
    smallest = min(int(one[0]) for one in ends.values())
    found = {}
    for name, design in designs.items():
        n = design.sizes["sample"]
        if ends[name].size > 1:
            chosen = np.linspace(0, ends[name].size - 1, min(N_STEPS, ends[name].size))
            numbers = set(ends[name][chosen.round().astype(int)].tolist())
        else:
            numbers = set(np.geomspace(min(smallest, n), n, N_STEPS).round().astype(int).tolist())
        if min(numbers) < PAPER_N_RUNS < n:
            numbers.add(PAPER_N_RUNS)
        found[name] = sorted(numbers)
    return found


def dataset(config: Config, baseline: xr.Dataset, design: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Compare every method with the baseline for growing numbers of runs.

    Surrogates are evaluated at the points of the baseline, so its sampling noise cancels in the
    differences.  The noise of the baseline's limits themselves is half their interval, which the
    file also holds.

    Parameters
    ----------
    config
        The configuration.
    baseline
        Layout ``runs``.
    design
        Layout ``design``, by method.

    Returns
    -------
    dataset
        Layout ``accuracy``; NaN where a method has no such step, too few samples held for a
        surrogate, or the limit is not given.

    Raises
    ------
    UserError
        If a design cannot be fitted.
    """
    levels = config.study.failure_probability
    responses = config.responses_of_study
    truth, away = extremes(baseline, responses), lost(baseline)
    points = baseline["standard"].to_numpy()
    sigma = truth[~away].std(axis=0)
    reference = baseline_limits(config, truth, away)
    held_reference = baseline_limits(config, truth[~away], away[~away])
    reference_limit, reference_held = (
        np.array([one.limit for one in of]) for of in (reference, held_reference)
    )
    half_width, held_half_width = (
        np.array([one.half_width for one in of]) / sigma[:, None]
        for of in (reference, held_reference)
    )

    sizes = steps(design)
    n_steps = max(len(one) for one in sizes.values())
    shape = (len(design), n_steps, len(responses))
    n_runs = np.zeros(shape[:2], dtype=int)
    rmse, error = np.full(shape, np.nan), np.full(shape, np.nan)
    share = np.full(shape[:2], np.nan)
    limit, held_limit = (np.full((*shape, len(levels)), np.nan) for _ in range(2))
    names = sorted(design, key=METHODS.index)
    for row, name in enumerate(names):
        choice = getattr(config.study, name).surrogate
        for step, n in enumerate(sizes[name]):
            n_runs[row, step] = n
            part = design[name].isel(sample=slice(0, n))
            if np.count_nonzero(~lost(part)) < part.sizes["parameter"] + 3:
                continue  # no linear tail with one sample left out
            found = predictor(config, part, choice, responses)
            predicted, held = found.surrogate.predict(points), found.held(points)
            rmse[row, step] = np.sqrt(np.mean((predicted - truth)[~away] ** 2, axis=0))
            share[row, step] = 1.0 - held.mean()
            following = design[name].isel(sample=slice(n, n + config.study.asm.batch_size))
            complete = following.sizes["sample"] == config.study.asm.batch_size
            following = following.isel(sample=~lost(following))
            if complete and following.sizes["sample"]:
                ahead = found.surrogate.predict(following["standard"].to_numpy())
                error[row, step] = (
                    np.abs(ahead - extremes(following, responses)).max(axis=0) / sigma
                )
            if not held.any():
                continue
            for of, without in ((limit, int(np.count_nonzero(~held))), (held_limit, 0)):
                of[row, step] = [
                    sample_limits(predicted[held, response], levels, n_lost=without).limit
                    for response in range(len(responses))
                ]
        _LOG.info("%s: judged at %s runs", name, ", ".join(map(str, sizes[name])))
    of_step = ("method", "step", "response")
    level = ("response", "failure_probability")
    return xr.Dataset(
        {
            "step_n_runs": (of_step[:2], n_runs),
            "step_limit": ((*of_step, "failure_probability"), limit),
            "step_limit_error": (
                (*of_step, "failure_probability"),
                (limit - reference_limit) / sigma[:, None],
            ),
            "step_held_limit_error": (
                (*of_step, "failure_probability"),
                (held_limit - reference_held) / sigma[:, None],
            ),
            "step_lost_probability": (of_step[:2], share),
            "step_rmse": (of_step, rmse),
            "step_error": (of_step, error),
            "reference_limit": (level, reference_limit),
            "reference_half_width": (level, half_width),
            "reference_held_limit": (level, reference_held),
            "reference_held_half_width": (level, held_half_width),
            "sigma": ("response", sigma),
        },
        coords=coordinates(
            responses,
            method=names,
            step=np.arange(n_steps),
            failure_probability=list(levels),
        ),
    )


STAGE = Stage(
    name="accuracy",
    of="case",
    reads=(
        *PREDICTING,
        *RESPONSES_OF_STUDY,
        *SURROGATE_OF_METHODS,
        "study.failure_probability",
        "study.asm.batch_size",
    ),
    inputs={"baseline": Input("runs"), "design": Input("design", by=("method",))},
    layout="accuracy",
    compute=dataset,
)
