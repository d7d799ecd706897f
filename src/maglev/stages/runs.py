"""Runs of the model, each computed once: a store that all cases and methods share, and baselines.

The store is a folder for all that decides a run but its gains (and its track seed): train,
guideway, irregularity, passage, seed and code.  In it lie small files of some runs each, written
aside and renamed into place, so that a run is there as a whole or not at all.  A run is found again
by the exact bytes of its gains.
"""

from __future__ import annotations

import hashlib
import json
import logging
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import netCDF4
import numpy as np
import numpy.typing as npt
import xarray as xr

from maglev import datasets
from maglev.arrays import FloatArray, IntArray
from maglev.fingerprint import code_of
from maglev.parameters import Config
from maglev.simulation import simulate
from maglev.stages.points import baseline, case_of, gains_at, n_samples, random_columns, track_seeds
from maglev.vocabulary import GAINS, TRACK_PARTS

_LOG = logging.getLogger(__name__)

BATCH = 32
"""Runs computed and stored together, whole rows of samples of the production solver: what a kill
loses at most."""

DECIDING = ("seed", "train", "guideway", "irregularity", "passage")
"""Sections of the configuration that decide a run, beside its gains."""


@cache
def _code() -> str:
    """Fingerprint of the model as it is when a job first asks: an edit must not slip in later.

    `maglev.datasets` only names what the model computes, and the reference solver takes no part.
    """
    return code_of("simulation", without=["datasets", "mechanics.reference"])


def content(config: Config) -> dict[str, object]:
    """All of a configuration that decides a run, beside its gains; files by their bytes."""
    whole = config.quantities()
    part = {name: whole[name] for name in DECIDING}
    profile = config.irregularity.profile_file
    if profile is not None:
        part["irregularity"] |= {"profile_file": f"sha256:{datasets.file_hash(profile)}"}
    return part


def key_of(*parts: object) -> str:
    """First 16 hexadecimal digits of a hash over what can be written as JSON."""
    text = json.dumps(parts, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def folder_of(config: Config, store: str | Path) -> Path:
    """Folder of the store in which the runs of a configuration lie."""
    return Path(store) / "runs" / key_of(content(config), _code())


def _row_keys(gains: FloatArray, seeds: IntArray | None) -> list[bytes]:
    """What each run is found by: the bytes of its gains, and of its track seed if it has one."""
    keys = [row.tobytes() for row in np.ascontiguousarray(gains, dtype="<f8")]
    if seeds is None:
        return keys
    return [key + seed.tobytes() for key, seed in zip(keys, seeds.astype("<i8"), strict=True)]


@cache
def _keys_in(path: Path) -> tuple[bytes, ...]:
    """What the runs of one file are found by; a file of the store never changes."""
    with netCDF4.Dataset(path) as file:
        gains = np.stack([np.asarray(file[name][:], dtype=np.float64) for name in GAINS], axis=1)
        seeds = None
        if "track_seed" in file.variables:
            seeds = np.asarray(file["track_seed"][:], dtype=np.int64)
    return tuple(_row_keys(gains, seeds))


def _stored(folder: Path) -> dict[bytes, tuple[Path, int]]:
    """Where each stored run lies: file and row."""
    return {
        key: (path, row)
        for path in sorted(folder.glob("*.nc"))
        for row, key in enumerate(_keys_in(path))
    }


def stored_runs(
    config: Config,
    gains: npt.ArrayLike,
    store: str | Path,
    *,
    track_seeds: npt.ArrayLike | None = None,
    n_threads: int = 1,
) -> xr.Dataset:
    """Passages at given gains, of which only those are computed that the store does not hold.

    Parameters
    ----------
    config
        The configuration, with the guideway of the case.
    gains : (sample, 4)
        Gains [A/m, A s/m, A/m, A s/m].
    store
        Folder of the store.
    track_seeds : (sample,), optional
        Seed of each sample's irregularity; that of the configuration if not given.
    n_threads
        Rows of samples computed at the same time; the numbers do not depend on it.

    Returns
    -------
    passages
        Layout ``passage`` without histories, in the order of ``gains``; with ``track_seed`` if
        seeds are given.

    Raises
    ------
    ValueError
        If there are no gains, shapes disagree, or as `maglev.simulate`.
    """
    gains = np.array(gains, dtype=np.float64)
    if gains.ndim != 2 or gains.shape[1] != len(GAINS) or gains.shape[0] == 0:
        raise ValueError(
            f"gains have shape {gains.shape}, expected (sample, {len(GAINS)}) with at least one row"
        )
    seeds = None if track_seeds is None else np.array(track_seeds, dtype=np.int64)
    if seeds is not None and seeds.shape != gains.shape[:1]:
        raise ValueError(
            f"track_seeds have shape {seeds.shape}, expected (sample,) = ({gains.shape[0]},)"
        )
    folder, keys = folder_of(config, store), _row_keys(gains, seeds)
    places = _stored(folder)
    missing = list({key: row for row, key in enumerate(keys) if key not in places}.values())
    began = time.perf_counter()
    for start in range(0, len(missing), BATCH):
        rows = np.array(missing[start : start + BATCH])
        path = _compute(
            config, gains[rows], None if seeds is None else seeds[rows], folder, n_threads
        )
        places |= {keys[row]: (path, place) for place, row in enumerate(rows)}
        done = min(start + BATCH, len(missing))
        rate = done / (time.perf_counter() - began)
        _LOG.info(
            "%d of %d runs done (%d of them found), %.2f runs/s, %.0f s left",
            len(keys) - len(missing) + done,
            len(keys),
            len(keys) - len(missing),
            rate,
            (len(missing) - done) / rate,
        )
    if not missing:
        _LOG.info("%d runs found, none to do", len(keys))
    return _gathered([places[key] for key in keys])


def _compute(
    config: Config,
    gains: FloatArray,
    seeds: IntArray | None,
    folder: Path,
    n_threads: int,
) -> Path:
    """Compute some runs and write them as one file of the store."""
    if seeds is None:
        computed = simulate(config, gains, n_threads=n_threads)
    else:
        computed = simulate(config, gains, n_threads=n_threads, track_seeds=seeds)
        computed["track_seed"] = (("sample",), seeds)
    name = hashlib.sha256(b"".join(_row_keys(gains, seeds))).hexdigest()[:16]
    path = folder / f"{name}.nc"
    datasets.write(computed, path, "passage", config=content(config), code=_code())
    return path


def _gathered(places: Sequence[tuple[Path, int]]) -> xr.Dataset:
    """Runs at their places in the store, in order."""
    files = {path: number for number, path in enumerate(dict.fromkeys(path for path, _ in places))}
    parts = [datasets.read(path, "passage") for path in files]
    offset = np.cumsum([0, *(part.sizes["sample"] for part in parts)])
    whole = xr.concat(
        parts,
        "sample",
        data_vars="minimal",
        coords="minimal",
        compat="override",
        combine_attrs="override",
    )
    chosen = whole.isel(sample=[offset[files[path]] + row for path, row in places])
    chosen.attrs = {name: parts[0].attrs[name] for name in ("time_step", "n_steps")}
    return chosen.assign_coords(sample=np.arange(len(places)))


def runs(
    config: Config,
    case: str,
    standard: FloatArray,
    probability: FloatArray,
    store: str | Path,
    *,
    track_seeds: IntArray | None = None,
    n_threads: int = 1,
) -> xr.Dataset:
    """Runs of a case at standardised points.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    standard : (sample, parameter)
        Standardised random gains [-].
    probability : (sample,)
        Probability that each point stands for [-].
    store
        Folder of the store.
    track_seeds : (sample,), optional
        Seed of each sample's irregularity.
    n_threads
        Rows of samples computed at the same time.

    Returns
    -------
    dataset
        Layout ``runs``.

    Raises
    ------
    ValueError
        As `stored_runs`.
    """
    gains = gains_at(config, case, standard)
    passages = stored_runs(
        config.of_case(case), gains, store, track_seeds=track_seeds, n_threads=n_threads
    )
    return passages.assign(
        standard=(("sample", "parameter"), standard), probability=(("sample",), probability)
    ).assign_coords(parameter=random_columns(case_of(config, case)).astype(np.int8))


def chunk(
    config: Config, case: str, rows: range, store: str | Path, n_threads: int = 1
) -> xr.Dataset:
    """Some runs of the baseline of a case.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    rows
        Numbers of the samples, rising by one; how many the baseline has plays no part.
    store
        Folder of the store.
    n_threads
        Rows of samples computed at the same time.

    Returns
    -------
    dataset
        Layout ``runs``, with ``track_seed`` if the case has a random track; each sample under its
        number in the baseline, all equally likely.

    Raises
    ------
    ValueError
        If there are no such samples, or as `stored_runs`.
    """
    if not rows or rows.start < 0 or rows.step != 1:
        raise ValueError(f"samples must be numbered upwards from 0 or more, got {rows}")
    seeds = None
    if case_of(config, case).random_track:
        seeds = track_seeds(config, rows.stop)[rows.start :]
    result = runs(
        config,
        case,
        baseline(config, case, rows.stop)[rows.start :],
        np.full(len(rows), 1.0 / len(rows)),
        store,
        track_seeds=seeds,
        n_threads=n_threads,
    )
    return result.assign_coords(sample=np.array(rows))


def gather(points: xr.Dataset, chunks: Sequence[xr.Dataset]) -> xr.Dataset:
    """Put the chunks of a baseline together.

    Parameters
    ----------
    points
        Layout ``points``: the baseline.
    chunks
        Layout ``runs``, in order.

    Returns
    -------
    dataset
        Layout ``runs``; all samples are equally likely.

    Raises
    ------
    ValueError
        If a sample is missing, stands twice or was run at another point.
    """
    whole = xr.concat(
        chunks,
        "sample",
        data_vars="minimal",
        coords="minimal",
        compat="override",
        combine_attrs="override",
    )
    n = points.sizes["sample"]
    if not np.array_equal(whole["sample"], np.arange(n)):
        raise ValueError(f"the chunks must hold the samples 0 to {n - 1} once each, in order")
    if not np.array_equal(whole["standard"], points["standard"]):
        raise ValueError("the chunks must have been run at the points of the baseline; do it again")
    whole.attrs = {name: chunks[0].attrs[name] for name in ("time_step", "n_steps")}
    whole["probability"] = (("sample",), points["probability"].values)
    return whole


def track_part(
    config: Config, case: str, part: str, store: str | Path, n_threads: int = 1
) -> xr.Dataset:
    """Further runs of a case with a random track, to tell what gains and track contribute.

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
    ValueError
        If there is no such case or part, or the track of the case is not random.
    """
    if part not in TRACK_PARTS:
        raise ValueError(f"part must be one of {', '.join(TRACK_PARTS)}, got '{part}'")
    if not case_of(config, case).random_track:
        raise ValueError(f"cases.{case}.random_track must be true for its part '{part}'")
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
