"""A chunk of the baseline of a case; runs in the store are not repeated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Stage
from maglev.stages.points import baseline, seeds_of_tracks
from maglev.stages.reads import RUNS_OF_CASE
from maglev.stages.runs import runs
from maglev.vocabulary import BASELINE


def dataset(
    config: Config, case: str, start: int, stop: int, store: str | Path, n_threads: int = 1
) -> xr.Dataset:
    """A chunk of the baseline of a case.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    start, stop
        Number of the first sample and of the one after the last; the size of the baseline plays no
        part.
    store
        Folder of the store.
    n_threads
        Rows of samples computed at the same time.

    Returns
    -------
    dataset
        Layout ``runs``, with ``track_seed`` if runs of the case differ in their track; each sample
        under its number in the baseline, all equally likely.

    Raises
    ------
    UserError
        If there are no such samples, or as `stored_runs`.
    """
    if not 0 <= start < stop:
        raise UserError(f"samples must be numbered upwards from 0 or more, got {start} to {stop}")
    rows = range(start, stop)
    seeds = seeds_of_tracks(config, case, rows.stop)
    result = runs(
        config,
        case,
        baseline(config, case, rows.stop)[rows.start :],
        np.full(len(rows), 1.0 / len(rows)),
        store,
        track_seeds=None if seeds is None else seeds[rows.start :],
        n_threads=n_threads,
    )
    return result.assign_coords(sample=np.array(rows))


STAGE = Stage(
    name="baseline_chunk",
    of="case",
    reads=RUNS_OF_CASE,
    takes={"case": str, "start": int, "stop": int, "store": Path, "n_threads": int},
    methods=(BASELINE,),
    layout="runs",
    compute=dataset,
)
