"""Predicted extremes and predicted losses of levitation at the representative points."""

from __future__ import annotations

import xarray as xr

from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import coordinates, responses_of
from maglev.stages.reads import PREDICTING
from maglev.stages.surrogate import stored_predictor
from maglev.vocabulary import DESIGNED, GAINS


def dataset(
    config: Config,
    design: xr.Dataset,
    surrogate: xr.Dataset,
    representative_points: xr.Dataset,
) -> xr.Dataset:
    """Predict the extremes at the representative points.

    Parameters
    ----------
    config
        The configuration.
    design
        Layout ``design``.
    surrogate
        Layout ``surrogate``, of this design.
    representative_points
        Layout ``points``.

    Returns
    -------
    dataset
        Layout ``eev``.  Extremes are predicted at every point; where it is likely lost
        (``lost_probability_at``), they mean nothing.
    """
    found = stored_predictor(config, design, surrogate)
    points = representative_points
    at = points["standard"].to_numpy()
    of_response = ("sample", "response")
    return xr.Dataset(
        {
            **{name: points[name] for name in (*GAINS, "standard", "probability")},
            "predicted": (of_response, found.surrogate.predict(at)),
            "deviation": (of_response, found.surrogate.standard_deviation(at)),
            "lost_probability_at": ("sample", found.loss.lost_probability(at)),
        },
        coords=coordinates(
            responses_of(surrogate), sample=points["sample"], parameter=points["parameter"]
        ),
    )


STAGE = Stage(
    name="eev",
    of="method",
    reads=PREDICTING,
    inputs={
        "design": Input("design"),
        "surrogate": Input("surrogate"),
        "representative_points": Input("points"),
    },
    methods=DESIGNED,
    layout="eev",
    compute=dataset,
)
