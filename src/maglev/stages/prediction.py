"""Predictions of each method for every run of the baseline."""

from __future__ import annotations

import logging
from collections.abc import Mapping

import numpy as np
import xarray as xr

from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import coordinates, extremes, lost
from maglev.stages.reads import PREDICTING, RESPONSES_OF_STUDY
from maglev.stages.surrogate import stored_predictor
from maglev.vocabulary import METHODS

_LOG = logging.getLogger(__name__)


def dataset(
    config: Config,
    baseline: xr.Dataset,
    design: Mapping[str, xr.Dataset],
    surrogate: Mapping[str, xr.Dataset],
) -> xr.Dataset:
    """Predict every run of the baseline by the surrogate of every method.

    Parameters
    ----------
    config
        The configuration.
    baseline
        Layout ``runs``.
    design
        Layout ``design``, by method.
    surrogate
        Layout ``surrogate``, by method, of these designs.

    Returns
    -------
    dataset
        Layout ``prediction``.  ``computed`` is NaN where the run lost levitation; the predicted
        extremes mean nothing there.

    Raises
    ------
    UserError
        If a method has a design and no surrogate, or the other way round.
    """
    if set(design) != set(surrogate):
        raise UserError(
            f"every method needs a design and a surrogate, got designs of {sorted(design)} and "
            f"surrogates of {sorted(surrogate)}"
        )
    names = sorted(design, key=METHODS.index)
    responses = config.responses_of_study
    truth, away = extremes(baseline, responses), lost(baseline)
    points = baseline["standard"].to_numpy()
    sigma = truth[~away].std(axis=0)
    predicted, without = [], []
    for name in names:
        found = stored_predictor(config, design[name], surrogate[name])
        predicted.append(found.surrogate.predict(points))
        without.append(~found.held(points))
        _LOG.info(
            "%s: %d runs lost, %d predicted so", name, np.count_nonzero(away), without[-1].sum()
        )
    rmse = [np.sqrt(np.mean((one - truth)[~away] ** 2, axis=0)) / sigma for one in predicted]
    return xr.Dataset(
        {
            "computed": (("sample", "response"), truth),
            "status": ("sample", baseline["status"].to_numpy()),
            "predicted_by": (("method", "sample", "response"), np.array(predicted)),
            "lost_by": (("method", "sample"), np.array(without, dtype=np.int8)),
            "prediction_rmse": (("method", "response"), np.array(rmse)),
            "method_n_runs": ("method", [design[name].sizes["sample"] for name in names]),
            "sigma": ("response", sigma),
        },
        coords=coordinates(
            responses,
            method=names,
            sample=baseline["sample"].to_numpy(),
        ),
    )


STAGE = Stage(
    name="prediction",
    of="case",
    reads=(*PREDICTING, *RESPONSES_OF_STUDY),
    inputs={
        "baseline": Input("runs"),
        "design": Input("design", by=("method",)),
        "surrogate": Input("surrogate", by=("method",)),
    },
    layout="prediction",
    compute=dataset,
)
