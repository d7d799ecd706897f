"""Density of responses over the time of a passage, and their first-passage reliability."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.stats import norm

from maglev.arrays import FloatArray, IntArray
from maglev.datasets import carried
from maglev.mechanics.course import course
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.histories import stored_histories
from maglev.stages.points import others_at, seeds_of_tracks
from maglev.stages.reads import RUNS_OF_CASE
from maglev.uncertainty.gdee import FirstPassage, first_passage
from maglev.uncertainty.in_time import DensityInTime, density_in_time, quantiles_in_time
from maglev.uncertainty.samples import HeldPart, held_part
from maglev.vocabulary import (
    BARRIER_SOURCES,
    DESIGNED,
    GAINS,
    GIVEN,
    LIMIT_STATUS,
    METHODS,
    RecordedResponse,
)

_LOG = logging.getLogger(__name__)

BARRIER_MESH = 0.01
"""Cell width of the first passage, over the standard deviation of the extreme [-].  The kernel
reaches a barrier about as far early, which adds a few per cent to small probabilities; assumed."""


def dataset(
    config: Config,
    representative_points: xr.Dataset,
    limits: Mapping[str, xr.Dataset],
    case: str,
    store: str | Path,
    n_threads: int = 1,
) -> xr.Dataset:
    """Densities in time and reliabilities from runs of the model at the representative points.

    Parameters
    ----------
    config
        The configuration.
    representative_points
        Layout ``points``, of the case.
    limits
        Layout ``limits`` by method; the barriers are those of the last method with a surrogate,
        or of the baseline.
    case
        Name of the case.
    store
        Folder that keeps the histories.
    n_threads
        Rows of samples computed at the same time; the numbers do not depend on it.

    Returns
    -------
    dataset
        Layout ``density_in_time``.

    Raises
    ------
    UserError
        If all samples are lost, a response never differs, or as `stored_histories`.

    References
    ----------
    docs/theory/pdem.md, sections 6 and 7.
    """
    gains = np.column_stack([representative_points[name].to_numpy() for name in GAINS])
    probability = representative_points["probability"].to_numpy()
    n, own = len(gains), config.of_case(case)
    histories = stored_histories(
        own,
        gains,
        config.study.in_time.responses,
        config.study.in_time.n_times,
        store,
        values=others_at(config, case, representative_points["parameter_value"].to_numpy()),
        track_seeds=seeds_of_tracks(config, case, n, "in_time"),
        n_threads=n_threads,
    )
    method = [name for name in METHODS if name in limits][-1]
    columns = [
        _of_response(config, histories.sel(response=name), probability, limits[method], name)
        for name in config.study.in_time.responses
    ]
    way = course(own)
    result = _put_together(config, histories, columns).assign(
        held_in_time=("t", _held(histories, probability)),
        nose=("t", way.nose(histories["t"].to_numpy())),
        train_length=((), own.train.length),
        guideway_length=((), own.guideway.length),
        n_runs=((), n),
    )
    result.attrs = carried(histories)
    result["barrier"].attrs["comment"] = f"limits by the method {method}"
    result["reliability_error"].attrs["comment"] = (
        "the scheme's kernel reaches a barrier early; reliability_of_points has none"
    )
    return result


def _until(path: FloatArray) -> IntArray:
    """Number of the last time (sample,) at which each path (sample, path_step) is there."""
    return np.isfinite(path[:, ::3]).cumprod(axis=1).sum(axis=1) - 1


def _held(histories: xr.Dataset, probability: FloatArray) -> FloatArray:
    """Probability that levitation has held until each time (time,)."""
    until = _until(histories["path"].isel(response=0).to_numpy())
    return probability @ (until[:, None] >= np.arange(histories.sizes["t"]))


def _of_response(
    config: Config,
    histories: xr.Dataset,
    probability: FloatArray,
    limits: xr.Dataset,
    name: RecordedResponse,
) -> tuple[DensityInTime, dict[str, FloatArray | IntArray]]:
    """Density of one response, and its other variables."""
    path = histories["path"].to_numpy()
    until = _until(path)
    weighted = (path[:, ::3], probability)
    evolved = density_in_time(*weighted, held_until=until)
    extreme = held_part(
        histories["extreme_of_path"].to_numpy(), histories["status"].to_numpy() != 0, probability
    )
    barrier, source = _barriers(config, limits, name, extreme)
    passages = [_first_passage(path, probability, until, extreme, one) for one in barrier]
    holding = 1.0 - extreme.lost_probability
    of_extreme = [holding * extreme.probability[extreme.values < one].sum() for one in barrier]
    reliability = np.array([one.survival[::3] for one in passages])
    tail = 0.5 * (1.0 - config.study.confidence)
    _say(name, config.study.failure_probability, reliability, of_extreme)
    return evolved, {
        "quantile_in_time": quantiles_in_time(
            weighted[0], [tail, 0.5, 1.0 - tail], probability, held_until=until
        ),
        "barrier": barrier,
        "barrier_source": source,
        "reliability": reliability,
        "reliability_of_points": np.array([one.exact_survival[::3] for one in passages]),
        "reliability_of_extreme": np.array(of_extreme),
        "reliability_error": reliability[:, -1] - of_extreme,
    }


def _first_passage(
    path: FloatArray, probability: FloatArray, until: IntArray, extreme: HeldPart, barrier: float
) -> FirstPassage:
    """Survival of paths between two barriers; a path of sizes meets the upper one."""
    deviation = float(np.sqrt(np.cov(extreme.values, aweights=extreme.probability, ddof=0)))
    return first_passage(
        path,
        probability,
        mesh=BARRIER_MESH * deviation,
        lower=-barrier,
        upper=barrier,
        held_until=3 * until,
    )


def _barriers(
    config: Config, limits: xr.Dataset, name: RecordedResponse, extreme: HeldPart
) -> tuple[FloatArray, IntArray]:
    """Barriers (level,) of a response and what they are."""
    at = limits.sel(response=name)
    levels = np.array(config.study.failure_probability)
    mean = extreme.probability @ extreme.values
    deviation = np.sqrt(extreme.probability @ (extreme.values - mean) ** 2)
    given = at["limit_status"].to_numpy() == LIMIT_STATUS.index(GIVEN)
    barrier = np.where(given, at["limit"], mean + norm.isf(levels) * deviation)
    source = np.where(given, *(BARRIER_SOURCES.index(one) for one in BARRIER_SOURCES))
    return barrier, source


def _say(
    name: str, levels: tuple[float, ...], reliability: FloatArray, of_extreme: list[float]
) -> None:
    """Log how well both ways to the end of the passage agree."""
    said = [
        f"{level:g}: {1.0 - one:.4g} and {1.0 - other:.4g}"
        for level, one, other in zip(levels, reliability[:, -1], of_extreme, strict=True)
    ]
    _LOG.info("%s, failure by first passage and by the extreme: %s", name, ", ".join(said))


def _put_together(
    config: Config,
    histories: xr.Dataset,
    columns: list[tuple[DensityInTime, dict[str, FloatArray | IntArray]]],
) -> xr.Dataset:
    """Dataset of the file from the density and the other variables of each response."""
    densities = _with_equal_cells([evolved for evolved, _ in columns])
    level = ("response", "failure_probability")
    dims = {
        "quantile_in_time": ("response", "t", "quantile_level"),
        "reliability": (*level, "t"),
        "reliability_of_points": (*level, "t"),
    }
    tail = 0.5 * (1.0 - config.study.confidence)
    return xr.Dataset(
        {
            **densities,
            **{
                name: (dims.get(name, level), np.stack([column[name] for _, column in columns]))
                for name in columns[0][1]
            },
        },
        coords={
            "response": list(config.study.in_time.responses),
            "t": histories["t"].to_numpy(),
            "cell": np.arange(densities["value_in_time"][1].shape[2]),
            "quantile_level": [tail, 0.5, 1.0 - tail],
            "failure_probability": list(config.study.failure_probability),
        },
    )


def _with_equal_cells(
    evolved: list[DensityInTime],
) -> dict[str, tuple[tuple[str, ...], FloatArray]]:
    """Densities of all responses with as many cells, those at the end empty."""
    n_cells = max(one.density.shape[1] for one in evolved)
    value, density = [], []
    for one in evolved:
        further = np.arange(n_cells)
        value.append(one.cell_centre[:, :1] + one.cell_width[:, None] * further)
        density.append(np.pad(one.density, ((0, 0), (0, n_cells - one.density.shape[1]))))
    by_cell, by_time = ("response", "t", "cell"), ("response", "t")
    return {
        "value_in_time": (by_cell, np.stack(value)),
        "density_in_time": (by_cell, np.stack(density)),
        "mean_in_time": (by_time, np.stack([one.mean for one in evolved])),
        "deviation_in_time": (by_time, np.stack([one.deviation for one in evolved])),
        "kernel_in_time": (by_time, np.stack([one.kernel_deviation for one in evolved])),
    }


STAGE = Stage(
    name="density_in_time",
    of="case",
    reads=(
        *RUNS_OF_CASE,
        "study.confidence",
        "study.failure_probability",
        "study.in_time.responses",
        "study.in_time.n_times",
    ),
    inputs={
        "representative_points": Input("points"),
        "limits": Input("limits", by=("method",)),
    },
    takes={"case": str, "store": Path, "n_threads": int},
    methods=DESIGNED,
    layout="density_in_time",
    compute=dataset,
)
