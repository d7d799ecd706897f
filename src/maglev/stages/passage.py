"""One passage at the mean gains, with its histories."""

from __future__ import annotations

import numpy as np
import xarray as xr

from maglev.parameters import Config
from maglev.simulation import simulate
from maglev.stage import Stage
from maglev.stages.reads import TRAIN_ON_GUIDEWAY


def dataset(config: Config) -> xr.Dataset:
    """Extremes and histories of one passage at the configured speed and the mean gains.

    Parameters
    ----------
    config
        The configuration.

    Returns
    -------
    dataset
        Layout ``passage`` with histories.

    Raises
    ------
    UserError
        As `maglev.simulate`.
    """
    return simulate(config, np.array([config.gains.as_row]), histories=True)


STAGE = Stage(
    name="passage",
    of="run",
    reads=(*TRAIN_ON_GUIDEWAY, "gains"),
    layout="passage",
    compute=dataset,
)
