"""Further runs of a case with a random track, to separate gains and track."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Stage
from maglev.stages.points import baseline, case_of, n_samples, track_seeds
from maglev.stages.reads import N_SAMPLES, RUNS_OF_CASE
from maglev.stages.runs import runs
from maglev.vocabulary import BASELINE, TRACK_PARTS


def dataset(
    config: Config, case: str, part: str, store: str | Path, n_threads: int = 1
) -> xr.Dataset:
    """Further runs of a case with a random track, to separate gains and track.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of a case with a random track.
    part
        One of `maglev.vocabulary.TRACK_PARTS`; its sample i has the gains or the track of
        sample i of the baseline.
    store
        Folder of the store.
    n_threads
        Rows of samples computed at the same time.

    Returns
    -------
    dataset
        Layout ``runs`` with ``track_seed``.

    Raises
    ------
    UserError
        If there is no such case or part, or the track of the case is not random.
    """
    if part not in TRACK_PARTS:
        raise UserError(f"part must be one of {', '.join(TRACK_PARTS)}, got '{part}'")
    if case_of(config, case).track != "random":
        raise UserError(f"cases.{case}.track must be random for its part '{part}'")
    n = n_samples(config, case)
    standard = baseline(config, case, n, "other gains" if part == "other_gains" else "baseline")
    if part == "track_only":
        standard = np.zeros_like(standard)
    seeds = track_seeds(config, n, "other track" if part == "other_track" else "track")
    probability = np.full(n, 1.0 / n)
    if part == "gains_only":  # the runs of a case without a random track: shared with it
        result = runs(config, case, standard, probability, store, n_threads=n_threads)
        return result.assign(track_seed=(("sample",), np.full(n, config.seed)))
    return runs(config, case, standard, probability, store, track_seeds=seeds, n_threads=n_threads)


STAGE = Stage(
    name="track_runs",
    of="case",
    reads=(*RUNS_OF_CASE, *N_SAMPLES),
    takes={"case": str, "part": str, "store": Path, "n_threads": int},
    methods=(BASELINE,),
    layout="runs",
    compute=dataset,
)
