"""Stability of the linearised train over the gains of the suspension, and its borders."""

from __future__ import annotations

import numpy as np
import xarray as xr

from maglev.arrays import FloatArray
from maglev.mechanics import train as train_model
from maglev.mechanics.linear import Block, blocks, border, growth_rate
from maglev.mechanics.responses import checked_gains
from maglev.parameters import Config, Control
from maglev.stage import Stage

PROPORTIONAL_RANGE, DERIVATIVE_RANGE = (0.4, 1.6), (0.0, 1.6)
"""Range of the gains of the map over their means [-]: four deviations on either side at a
coefficient of variation of 0.15, and down to no derivative gain, where a lag has its border."""

N_PROPORTIONAL, N_DERIVATIVE = 37, 25
"""Size of the map, finer along the decisive gain."""

LAGS = (0.0, 2e-3)
"""Lags of the suspension's current whose borders are drawn [s]."""

FARTHEST = 10.0
"""Upper end of the search for a border, over the mean gain [-]."""

N_STEPS = 12
"""Steps of the search for a border in the map, each a tenth of the mean or less."""

PROPORTIONAL, DERIVATIVE = 0, 1
"""Columns of the suspension's k_p and k_d among the gains."""


def dataset(config: Config) -> xr.Dataset:
    """Map the growth rate of one car over the two gains of the suspension, and its borders.

    Guidance has its mean gains.  The map leaves out neighbouring cars, the elastic guideway, the
    limits of gap and current and the nonlinear force; the passages show their effect.

    Parameters
    ----------
    config
        The configuration.

    Returns
    -------
    dataset
        Layout ``stability``.
    """
    one_car = train_model.build(config.train.model_copy(update={"n_cars": 1}))
    mean = checked_gains([config.gains.as_row], config.gains.further)[0]
    proportional = mean[PROPORTIONAL] * np.linspace(*PROPORTIONAL_RANGE, N_PROPORTIONAL)
    derivative = mean[DERIVATIVE] * np.linspace(*DERIVATIVE_RANGE, N_DERIVATIVE)
    parts = blocks(one_car, config.control)
    rate = [
        [growth_rate(parts, _moved(mean, k_p, k_d)) for k_p in proportional] for k_d in derivative
    ]
    with_lag = [blocks(one_car, _lagging(config.control, lag)) for lag in LAGS]
    magnet = config.train.suspension_magnet
    ends = {
        f"{name}_border_{side}": ((), _border(parts, mean, gain, limit * mean[gain], 24))
        for name, gain in (("proportional", PROPORTIONAL), ("derivative", DERIVATIVE))
        for side, limit in (("low", 0.0), ("high", FARTHEST))
    }
    return xr.Dataset(
        {
            "growth_rate": (("grid_derivative", "grid_proportional"), np.array(rate)),
            "mean_growth_rate": ((), growth_rate(parts, mean)),
            "static_limit": ((), magnet.current_reference / magnet.gap_reference),
            **ends,
            "proportional_border": (
                ("current_lag", "grid_derivative"),
                [
                    [
                        _border(
                            late,
                            _moved(mean, mean[PROPORTIONAL], k_d),
                            PROPORTIONAL,
                            proportional[0],
                        )
                        for k_d in derivative
                    ]
                    for late in with_lag
                ],
            ),
            "derivative_border": (
                ("current_lag", "grid_proportional"),
                [
                    [
                        _border(
                            late, _moved(mean, k_p, mean[DERIVATIVE]), DERIVATIVE, derivative[0]
                        )
                        for k_p in proportional
                    ]
                    for late in with_lag
                ],
            ),
            "mean_proportional": ((), mean[PROPORTIONAL]),
            "mean_derivative": ((), mean[DERIVATIVE]),
        },
        coords={
            "grid_proportional": proportional,
            "grid_derivative": derivative,
            "current_lag": list(LAGS),
        },
    )


def _moved(mean: FloatArray, k_p: float, k_d: float) -> FloatArray:
    gains = mean.copy()
    gains[[PROPORTIONAL, DERIVATIVE]] = k_p, k_d
    return gains


def _lagging(control: Control, lag: float) -> Control:
    """The control with another lag of the suspension's current."""
    return control.model_copy(
        update={"suspension": control.suspension.model_copy(update={"lag": lag})}
    )


def _border(
    parts: tuple[Block, ...],
    gains: FloatArray,
    gain: int,
    limit: float,
    n_steps: int = N_STEPS,
) -> float:
    """The border from the gains to the limit; NaN if there is none or it begins outside."""
    if growth_rate(parts, gains) >= 0:
        return float("nan")
    return border(parts, gains, gain, limit, n_steps)


STAGE = Stage(
    name="stability",
    of="run",
    reads=("train", "gains", "control"),
    layout="stability",
    compute=dataset,
)
