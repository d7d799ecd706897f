"""Midspan deflection while the train passes, beside that under a moving uniform load."""

from __future__ import annotations

import xarray as xr

from maglev.errors import UserError
from maglev.mechanics import train
from maglev.mechanics.course import course
from maglev.mechanics.moving_load import midspan_deflection
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.guideway_modes import euler_span


def load_per_length(config: Config) -> float:
    """Weight of the train over its length [N/m]."""
    return float(train.build(config.train).weight.sum()) / config.train.length


def dataset(config: Config, passage: xr.Dataset) -> xr.Dataset:
    """Deflection at midspan of the middle span against time.

    Parameters
    ----------
    config
        The configuration that ``passage`` was computed from.
    passage
        Layout ``passage`` with histories.

    Returns
    -------
    dataset
        Layout ``deflection``.

    Raises
    ------
    UserError
        If the passage has no histories.
    """
    if "girder_displacement_z_history" not in passage:
        raise UserError("deflection: the passage has no histories")
    beam, load = euler_span(config), load_per_length(config)
    entry = -course(config).start + (config.guideway.n_spans // 2) * beam.length
    time = passage["t"]
    speed = config.passage.speed
    moving = midspan_deflection(beam, load, config.train.length, speed, time - entry / speed)
    history = passage["girder_displacement_z_history"].isel(sample=0, drop=True)
    return xr.Dataset(
        {
            "deflection": (("t",), history.to_numpy()),
            "deflection_moving_load": (("t",), moving),
            "static_deflection_moving_load": ((), beam.static_deflection(load)),
            "passage_speed": ((), speed),
        },
        coords={"t": time.to_numpy()},
    )


STAGE = Stage(
    name="deflection",
    of="run",
    reads=("train", "guideway", "passage"),
    inputs={"passage": Input("passage")},
    layout="deflection",
    compute=dataset,
)
