"""One run of a case at the middle of its random quantities, on the track of the seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from maglev.parameters import Config
from maglev.stage import Stage
from maglev.stages.points import parameters
from maglev.stages.reads import RUNS_OF_CASE
from maglev.stages.runs import runs


def dataset(config: Config, case: str, store: str | Path, n_threads: int = 1) -> xr.Dataset:
    """One run of a case at the origin of standard coordinates.

    That is the mean of a normal quantity, and the median of any other.  Where runs of the case
    differ in their track, the run is on that of the seed all the same.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    store
        Folder of the store.
    n_threads
        Rows of samples computed at the same time.

    Returns
    -------
    dataset
        Layout ``runs``, with one sample.

    Raises
    ------
    UserError
        If there is no such case, or as `stored_runs`.
    """
    origin = np.zeros((1, len(parameters(config, case))))
    return runs(config, case, origin, np.ones(1), store, n_threads=n_threads)


STAGE = Stage(
    name="mean_run",
    of="case",
    reads=RUNS_OF_CASE,
    takes={"case": str, "store": Path, "n_threads": int},
    layout="runs",
    compute=dataset,
)
