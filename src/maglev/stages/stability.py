"""Where gains of the suspension hold the train: the static limit and the linearised train."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.linalg
import xarray as xr

from maglev.mechanics import train as train_model
from maglev.mechanics.step_limit import closed_train
from maglev.parameters import Config

PROPORTIONAL_RANGE, DERIVATIVE_RANGE = (0.4, 1.6), (0.4, 1.6)
"""Gains of the map over their means [-]: four deviations on either side at a coefficient of
variation of 0.15."""

N_PROPORTIONAL, N_DERIVATIVE = 37, 19
"""Size of the map, finer along the gain that decides."""


def growth_rate(train: train_model.TrainModel, gains: npt.NDArray[np.float64]) -> float:
    """Fastest growth of a motion of the levitated train on a rigid track [1/s].

    Parameters
    ----------
    train
        Train with open magnets.
    gains : (4,)
        Suspension k_p [A/m], k_d [A s/m], guidance k_p, k_d.

    Returns
    -------
    rate
        Largest real part of the poles; negative where every motion dies out.

    References
    ----------
    docs/theory/train.md, the linearised magnet.
    """
    stiffness, damping = closed_train(train, gains)
    n = train.mass.size
    inverse = 1.0 / train.mass[:, None]
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse * stiffness, -inverse * damping]])
    return float(scipy.linalg.eigvals(state).real.max())


def dataset(config: Config) -> xr.Dataset:
    """Map the growth rate of one car over the two gains of the suspension.

    Guidance has its mean gains.  Neighbouring cars, the elastic guideway, the limits of gap and
    current and the nonlinear force are not in it: the passages say what they change.

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
    mean = np.array(config.gains.as_row)
    proportional = mean[0] * np.linspace(*PROPORTIONAL_RANGE, N_PROPORTIONAL)
    derivative = mean[1] * np.linspace(*DERIVATIVE_RANGE, N_DERIVATIVE)
    rate = [
        [growth_rate(one_car, np.array([k_p, k_d, *mean[2:]])) for k_p in proportional]
        for k_d in derivative
    ]
    magnet = config.train.suspension_magnet
    return xr.Dataset(
        {
            "growth_rate": (("grid_derivative", "grid_proportional"), np.array(rate)),
            "static_limit": ((), magnet.current_reference / magnet.gap_reference),
            "mean_proportional": ((), mean[0]),
            "mean_derivative": ((), mean[1]),
        },
        coords={"grid_proportional": proportional, "grid_derivative": derivative},
    )
