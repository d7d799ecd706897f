"""The same gains on each of many tracks of the same spectra."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Stage
from maglev.stages.extremes import coordinates, extremes
from maglev.stages.points import marginals, seeds_of_line
from maglev.stages.randomness import generator
from maglev.stages.reads import RESPONSES_OF_STUDY, RUNS_OF_CASE
from maglev.stages.runs import runs
from maglev.uncertainty.pointset import sobol_points
from maglev.vocabulary import GAINS


def dataset(config: Config, case: str, store: str | Path, n_threads: int = 1) -> xr.Dataset:
    """Run one Sobol' set of the gains of a case on every track.

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
        Layout ``tracks``; the first track is that of the seed of the configuration.

    Raises
    ------
    UserError
        If there is no such case, its track is not drawn, or as `stored_runs`.
    """
    track = config.irregularity
    if not track.enabled or track.profile_file is not None:
        raise UserError(
            "tracks: the irregularity must be drawn from its spectra, got "
            f"{'a measured profile' if track.enabled else 'a smooth track'}, of which there is one"
        )
    settings = config.study.tracks
    n_tracks, n = settings.n_tracks, settings.n_gains
    points = sobol_points(marginals(config, case), n, generator(config.seed, "gains on tracks"))
    seeds = seeds_of_line(config, n_tracks)
    whole = runs(
        config,
        case,
        np.tile(points.standard, (n_tracks, 1)),
        np.full(n_tracks * n, 1.0 / (n_tracks * n)),
        store,
        track_seeds=np.repeat(seeds, n),
        n_threads=n_threads,
    )
    first = whole.isel(sample=slice(n))
    responses = config.responses_of_study
    result = xr.Dataset(
        {
            **{name: ("sample", first[name].to_numpy()) for name in GAINS},
            "standard": (("sample", "parameter"), first["standard"].to_numpy()),
            "seed_of_track": ("track", seeds),
            "extreme": (
                ("track", "sample", "response"),
                extremes(whole, responses).reshape(n_tracks, n, -1),
            ),
            "status_on_track": (
                ("track", "sample"),
                whole["status"].to_numpy().reshape(n_tracks, n),
            ),
        },
        coords=coordinates(
            responses,
            track=np.arange(n_tracks),
            sample=np.arange(n),
            parameter=whole["parameter"].to_numpy(),
        ),
    )
    result.attrs["track"] = f"{n_tracks} tracks"
    return result


STAGE = Stage(
    name="tracks",
    of="case",
    reads=(*RUNS_OF_CASE, *RESPONSES_OF_STUDY, "study.tracks.n_tracks", "study.tracks.n_gains"),
    takes={"case": str, "store": Path, "n_threads": int},
    layout="tracks",
    compute=dataset,
)
