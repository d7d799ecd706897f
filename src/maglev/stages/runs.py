"""Runs of the model, each computed once: a store that all cases and methods share.

The store is a folder for all that decides a run but what differs from run to run (gains, further
random quantities, track seed): train, guideway, irregularity, passage, seed and code.  In it lie
small files of some runs each, written aside and renamed into place, so that a run is there as a
whole or not at all.  A run is found again by the exact bytes of its own numbers.
"""

from __future__ import annotations

import hashlib
import json
import logging
import threading
import time
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Literal

import netCDF4
import numpy as np
import numpy.typing as npt
import xarray as xr

from maglev import datasets
from maglev.arrays import FloatArray, IntArray
from maglev.errors import UserError
from maglev.fingerprint import code_of
from maglev.parameters import Config
from maglev.simulation import simulate
from maglev.stages.points import (
    GAIN_COLUMNS,
    gains_at,
    named_values,
    others_at,
    parameters,
    values_at,
)
from maglev.stages.reads import TRAIN_ON_GUIDEWAY
from maglev.vocabulary import GAINS, STEP_TOO_LARGE

_LOG = logging.getLogger(__name__)

_FILES = threading.Lock()
"""Held while a file is open: the NetCDF library serves one thread at a time."""

BATCH = 32
"""Runs computed and stored together, whole rows of samples of the production solver; an
interruption costs at most as many."""


@cache
def _code() -> str:
    """Fingerprint of the model at the start of a job; later edits do not count.

    `maglev.datasets` only names what the model computes, and the reference solver takes no part.
    """
    return code_of("simulation", without=["datasets", "mechanics.reference"])


def content(config: Config, varied: Iterable[str] = ()) -> dict[str, object]:
    """All parameters that decide a run besides its four gains; files by their bytes.

    Parameters
    ----------
    config
        The configuration.
    varied
        Dotted keys of further quantities that differ from run to run.
    """
    whole = config.quantities()
    part = {name: whole[name] for name in TRAIN_ON_GUIDEWAY}
    part["further_gains"] = list(config.gains.further)
    if varied:
        part["varied"] = sorted(varied)
    profile = config.irregularity.profile_file
    if profile is not None:
        part["irregularity"] |= {"profile_file": f"sha256:{datasets.file_hash(profile)}"}
    return part


def key_of(*parts: object) -> str:
    """First 16 hexadecimal digits of a hash over the JSON of a value."""
    text = json.dumps(parts, sort_keys=True, ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def folder_of(config: Config, store: str | Path, varied: Iterable[str] = ()) -> Path:
    """Folder of the store for the runs of a configuration in which further keys vary."""
    return Path(store) / "runs" / key_of(content(config, varied), _code())


def _row_keys(numbers: FloatArray, seeds: IntArray | None) -> list[bytes]:
    """Key of each run: the bytes of its own numbers, and of its track seed if it has one."""
    keys = [row.tobytes() for row in np.ascontiguousarray(numbers, dtype="<f8")]
    if seeds is None:
        return keys
    return [key + seed.tobytes() for key, seed in zip(keys, seeds.astype("<i8"), strict=True)]


@cache
def _keys_in(path: Path, written: int) -> tuple[bytes, ...]:
    """Keys of the runs of one file, cached by its time of modification [ns]."""
    with _FILES, netCDF4.Dataset(path) as file:
        numbers = np.stack([np.asarray(file[name][:], dtype=np.float64) for name in GAINS], axis=1)
        if "parameter_value" in file.variables:
            numbers = np.hstack([numbers, np.asarray(file["parameter_value"][:], dtype=np.float64)])
        seeds = None
        if "track_seed" in file.variables:
            seeds = np.asarray(file["track_seed"][:], dtype=np.int64)
    return tuple(_row_keys(numbers, seeds))


def _stored(folder: Path) -> dict[bytes, tuple[Path, int]]:
    """File and row of each stored run."""
    return {
        key: (path, row)
        for path in sorted(folder.glob("*.nc"))
        for row, key in enumerate(_keys_in(path.absolute(), path.stat().st_mtime_ns))
    }


def stored_runs(
    config: Config,
    gains: npt.ArrayLike,
    store: str | Path,
    *,
    values: Mapping[str, npt.ArrayLike] | None = None,
    track_seeds: npt.ArrayLike | None = None,
    n_threads: int = 1,
) -> xr.Dataset:
    """Passages at given gains and values; only runs missing from the store are computed.

    Parameters
    ----------
    config
        The configuration, with the guideway of the case.
    gains : (sample, 4)
        Gains [A/m, A s/m, A/m, A s/m].
    store
        Folder of the store.
    values
        Further quantities (sample,) that differ from run to run, by their dotted keys [SI].
    track_seeds : (sample,), optional
        Seed of each sample's irregularity; that of the configuration if not given.
    n_threads
        Rows of samples computed at the same time; the numbers do not depend on it.

    Returns
    -------
    passages
        Layout ``passage`` without histories, in the order of ``gains``; with ``track_seed`` if
        seeds are given, and ``parameter_value`` if values are.

    Raises
    ------
    UserError
        If there are no gains, shapes disagree, or as `maglev.simulate`.
    """
    gains = np.array(gains, dtype=np.float64)
    if gains.ndim != 2 or gains.shape[1] != len(GAINS) or gains.shape[0] == 0:
        raise UserError(
            f"gains have shape {gains.shape}, expected (sample, {len(GAINS)}) with at least one row"
        )
    seeds = None if track_seeds is None else np.array(track_seeds, dtype=np.int64)
    if seeds is not None and seeds.shape != gains.shape[:1]:
        raise UserError(
            f"track_seeds have shape {seeds.shape}, expected (sample,) = ({gains.shape[0]},)"
        )
    given = values or {}
    varied = {key: np.array(given[key], dtype=np.float64) for key in sorted(given)}
    for key, column in varied.items():
        if column.shape != gains.shape[:1]:
            raise UserError(f"{key} has shape {column.shape}, expected (sample,) = ({len(gains)},)")
    numbers = np.column_stack([gains, *varied.values()])
    folder, keys = folder_of(config, store, varied), _row_keys(numbers, seeds)
    found = _stored(folder)
    missing = list({key: row for row, key in enumerate(keys) if key not in found}.values())
    began = time.perf_counter()
    for start in range(0, len(missing), BATCH):
        rows = np.array(missing[start : start + BATCH])
        path = _compute(
            config,
            gains[rows],
            {key: column[rows] for key, column in varied.items()},
            None if seeds is None else seeds[rows],
            folder,
            n_threads,
        )
        found |= {keys[row]: (path, index) for index, row in enumerate(rows)}
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
    return _gathered([found[key] for key in keys])


def _compute(
    config: Config,
    gains: FloatArray,
    varied: Mapping[str, FloatArray],
    seeds: IntArray | None,
    folder: Path,
    n_threads: int,
) -> Path:
    """Compute some runs and write them as one file of the store."""
    computed = simulated(config, gains, varied, seeds, n_threads)
    if seeds is not None:
        computed["track_seed"] = (("sample",), seeds)
    if varied:
        computed["parameter_value"] = (
            ("sample", "parameter"),
            np.column_stack(list(varied.values())),
        )
        computed = computed.assign_coords(parameter=list(varied))
    numbers = np.column_stack([gains, *varied.values()])
    name = hashlib.sha256(b"".join(_row_keys(numbers, seeds))).hexdigest()[:16]
    path = folder / f"{name}.nc"
    with _FILES:
        datasets.write(computed, path, "passage", config=content(config, varied), code=_code())
    return path


def simulated(
    config: Config,
    gains: FloatArray,
    varied: Mapping[str, FloatArray],
    seeds: IntArray | None,
    n_threads: int,
    histories: Literal[False, "responses"] = False,
) -> xr.Dataset:
    """Passages by the model at given gains and further quantities; none is looked for in the store.

    Parameters
    ----------
    config
        The configuration, with the guideway of the case.
    gains : (sample, 4)
        Gains [A/m, A s/m, A/m, A s/m].
    varied
        Further quantities (sample,) by their dotted keys [SI].
    seeds : (sample,) or None
        Seed of each sample's irregularity; that of the configuration if not given.
    n_threads
        Rows of samples computed at the same time.
    histories
        Whether to keep the time series of the responses.

    Raises
    ------
    UserError
        If the time step is too large for some gains, or as `maglev.simulate`.
    """
    further = [
        varied.get(key, np.full(gains.shape[0], value))
        for key, value in zip(GAIN_COLUMNS[len(GAINS) :], config.gains.further, strict=True)
    ]
    others = {key: column for key, column in varied.items() if key not in GAIN_COLUMNS}
    computed = simulate(
        _plain(config) if others else config,
        np.column_stack([gains, *further]),
        values=others or None,
        track_seeds=seeds,
        n_threads=n_threads,
        histories=histories,
    )
    _refuse_too_large_steps(gains, computed)
    return computed


def _plain(config: Config) -> Config:
    """The sections that decide a run as a configuration, whose numbers can be replaced."""
    whole = config.quantities()
    sections = {name: whole[name] for name in (*TRAIN_ON_GUIDEWAY, "gains")}
    return Config.model_validate({**sections, "cases": {}})


def _refuse_too_large_steps(gains: FloatArray, computed: xr.Dataset) -> None:
    """Refuse gains for which the time step is too large."""
    too_fast = np.flatnonzero(computed["status"].to_numpy() == STEP_TOO_LARGE)
    if too_fast.size:
        first = ", ".join(f"{gain:.4g}" for gain in gains[too_fast[0]])
        raise UserError(
            f"passage.time_step is too large for the gains of {too_fast.size} of "
            f"{gains.shape[0]} samples, the first with {first}: motions would grow by the step "
            "alone; take a smaller step"
        )


def _gathered(rows: Sequence[tuple[Path, int]]) -> xr.Dataset:
    """Runs at given rows of files of the store, in order."""
    files = {path: number for number, path in enumerate(dict.fromkeys(path for path, _ in rows))}
    with _FILES:
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
    chosen = whole.isel(sample=[offset[files[path]] + row for path, row in rows])
    chosen.attrs = datasets.carried(parts[0])
    return chosen.assign_coords(sample=np.arange(len(rows)))


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
    UserError
        As `stored_runs`.
    """
    drawn = values_at(config, case, standard)
    passages = stored_runs(
        config.of_case(case),
        gains_at(config, case, drawn),
        store,
        values=others_at(config, case, drawn),
        track_seeds=track_seeds,
        n_threads=n_threads,
    )
    return (
        passages.drop_dims("parameter", errors="ignore")
        .assign(
            standard=(("sample", "parameter"), standard),
            parameter_value=named_values(config, case, drawn),
            probability=(("sample",), probability),
        )
        .assign_coords(parameter=list(parameters(config, case)))
    )
