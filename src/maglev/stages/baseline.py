"""Baseline of a case, joined from its chunks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from maglev.datasets import carried
from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.reads import RUNS_OF_CASE
from maglev.vocabulary import BASELINE


def dataset(
    config: Config,
    baseline_points: xr.Dataset,
    baseline_chunk: Mapping[tuple[str, str], xr.Dataset],
) -> xr.Dataset:
    """Join the chunks of a baseline.

    Parameters
    ----------
    config
        The configuration, of which nothing is read.
    baseline_points
        Layout ``points``.
    baseline_chunk
        Layout ``runs``, by first sample and sample after the last, in order.

    Returns
    -------
    dataset
        Layout ``runs``; all samples are equally likely.

    Raises
    ------
    UserError
        If a sample is missing, stands twice or was run at another point.
    """
    points, chunks = baseline_points, list(baseline_chunk.values())
    whole = xr.concat(
        chunks,
        "sample",
        data_vars="minimal",
        coords="minimal",
        compat="override",
        combine_attrs="override",
    )
    n = points.sizes["sample"]
    if not np.array_equal(whole["sample"], np.arange(n)):
        raise UserError(f"the chunks must hold the samples 0 to {n - 1} once each, in order")
    if not np.array_equal(whole["standard"], points["standard"]):
        raise UserError("the chunks must have been run at the points of the baseline; do it again")
    whole.attrs = carried(chunks[0])
    whole["probability"] = (("sample",), points["probability"].values)
    return whole


STAGE = Stage(
    name="baseline",
    of="case",
    reads=RUNS_OF_CASE,
    inputs={
        "baseline_points": Input("points"),
        "baseline_chunk": Input("runs", by=("start", "stop")),
    },
    methods=(BASELINE,),
    layout="runs",
    compute=dataset,
)
