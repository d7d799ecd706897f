"""Static deflection against first frequency, and whether one bridge can have the measured pair."""

from __future__ import annotations

import logging

import numpy as np
import xarray as xr

from maglev.measurements import measured_here
from maglev.mechanics import guideway, train
from maglev.mechanics.moving_load import (
    DEFLECTION_BY_FREQUENCY,
    deflection_at_frequency,
    dynamic_factor,
)
from maglev.mechanics.statics import largest_deflection
from maglev.parameters import GRAVITY, Config
from maglev.stage import Input, Stage
from maglev.stages.deflection import load_per_length
from maglev.stages.guideway_modes import euler_span
from maglev.stages.reads import MEASURED

_LOG = logging.getLogger(__name__)

N_POINTS = 201
"""Number of points of the curve; assumed."""

RANGE = (0.7, 1.6)
"""Its ends over the frequency of the model; assumed."""

_VERTICAL = 2


def dataset(config: Config, guideway_modes: xr.Dataset) -> xr.Dataset:
    """Static deflection of a beam of each first frequency, beside model and measurement.

    The measured deflection of a passage, divided by the dynamic coefficient of the moving load at
    its speed, is taken for a static one.  Of several measurements the first is used.

    Parameters
    ----------
    config
        The configuration.
    guideway_modes
        Layout ``modes``.

    Returns
    -------
    dataset
        Layout ``stiffness_check``.

    Raises
    ------
    ConfigError
        If the measurements cannot be read.

    References
    ----------
    docs/verification.md.
    """
    beam, load = euler_span(config), load_per_length(config)
    mass = beam.mass_per_length
    to_car = config.train.car_pitch / GRAVITY  # kg of a car per N/m
    vertical = guideway_modes["frequency"].where(guideway_modes["direction"] == _VERTICAL)
    first = float(vertical.min())
    frequency = first * np.linspace(*RANGE, N_POINTS)
    result = xr.Dataset(
        {
            "beam_deflection": (
                ("beam_frequency",),
                deflection_at_frequency(frequency, load, mass),
            ),
            "model_frequency": ((), first),
            "static_deflection": (
                (),
                largest_deflection(guideway.build(config.guideway), train.build(config.train)),
            ),
            "car_load": ((), load * to_car),
            "mass_per_length": ((), mass),
            "bending_stiffness": ((), beam.bending_stiffness),
        },
        coords={"beam_frequency": frequency},
    )
    here = measured_here(config)
    if here is None or here.first_vertical_frequency is None or not here.peak_deflection:
        return result
    measured, peak = here.first_vertical_frequency, here.peak_deflection[0]
    static = peak.value / dynamic_factor(beam, config.train.length, peak.speed)
    ratio = static * measured.value**2 / DEFLECTION_BY_FREQUENCY  # load over mass [m/s^2]
    _LOG.info(
        "measured %.2f Hz and %.3f mm need %.1f t a car or %.2f t/m",
        measured.value,
        1e3 * peak.value,
        1e-3 * ratio * mass * to_car,
        1e-3 * load / ratio,
    )
    sure = {
        "source": "; ".join(dict.fromkeys((measured.source, peak.source))),
        "confidence": ", ".join(dict.fromkeys((measured.confidence, peak.confidence))),
    }
    return result.assign(
        measured_frequency=((), measured.value, sure),
        measured_static_deflection=((), static, sure),
        needed_car_load=((), ratio * mass * to_car),
        needed_mass_per_length=((), load / ratio),
    )


STAGE = Stage(
    name="stiffness_check",
    of="run",
    reads=("train", "guideway", *MEASURED),
    inputs={"guideway_modes": Input("modes")},
    layout="stiffness_check",
    compute=dataset,
)
