"""Histories of responses at points of a case, thinned, each batch computed once and kept.

As `maglev.stages.runs` keeps extremes: a folder of the store for all that decides the histories,
and in it a small file for each batch of points, written aside and renamed into place.
"""

from __future__ import annotations

import hashlib
import logging
import time
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import xarray as xr

from maglev import datasets
from maglev.arrays import FloatArray, IntArray
from maglev.fingerprint import code_of
from maglev.parameters import Config
from maglev.stages.runs import BATCH, content, key_of, simulated
from maglev.uncertainty.in_time import thinned
from maglev.vocabulary import GAINS, RecordedResponse

_LOG = logging.getLogger(__name__)


@cache
def _code() -> str:
    """Fingerprint of the code at the start of a job; later edits do not count."""
    return code_of("stages.histories", without=["datasets", "mechanics.reference"])


def stored_histories(
    config: Config,
    gains: FloatArray,
    responses: Sequence[RecordedResponse],
    n_times: int,
    store: str | Path,
    *,
    values: Mapping[str, FloatArray] | None = None,
    track_seeds: IntArray | None = None,
    n_threads: int = 1,
) -> xr.Dataset:
    """Thinned histories at given gains and values; batches found in the store are not computed.

    Parameters
    ----------
    config
        The configuration, with the guideway of the case.
    gains : (sample, 4)
        Gains [A/m, A s/m, A/m, A s/m].
    responses
        Which responses.
    n_times
        Times that are kept, at most, from the start to the end of a passage.
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
    dataset
        Layout ``histories``, in the order of ``gains``.

    Raises
    ------
    UserError
        If the time step is too large for some gains, or as `maglev.simulate`.
    """
    varied = {name: (values or {})[name] for name in sorted(values or {})}
    key = key_of(content(config, varied), _code(), list(responses), n_times)
    folder = Path(store) / "histories" / key
    began, parts = time.perf_counter(), []
    for start in range(0, len(gains), BATCH):
        rows = slice(start, start + BATCH)
        seeds = None if track_seeds is None else track_seeds[rows]
        own = {name: column[rows] for name, column in varied.items()}
        path = folder / f"{_name(np.column_stack([gains[rows], *own.values()]), seeds)}.nc"
        if not path.is_file():
            passages = simulated(config, gains[rows], own, seeds, n_threads, "responses")
            computed = _thinned(passages, seeds, responses, n_times)
            datasets.write(
                computed, path, "histories", config=content(config, varied), code=_code()
            )
        parts.append(datasets.read(path, "histories"))
        done = min(start + BATCH, len(gains))
        _LOG.info("%d of %d, %.0f s", done, len(gains), time.perf_counter() - began)
    whole = xr.concat(parts, "sample", data_vars="minimal", coords="minimal", compat="override")
    whole.attrs = datasets.carried(parts[0])
    return whole.assign_coords(sample=np.arange(len(gains)))


def _name(numbers: FloatArray, seeds: IntArray | None) -> str:
    """Name of the file of a batch: a hash of its numbers (sample, number) and seeds."""
    content = np.ascontiguousarray(numbers, dtype="<f8").tobytes()
    if seeds is not None:
        content += seeds.astype("<i8").tobytes()
    return hashlib.sha256(content).hexdigest()[:16]


def _thinned(
    passages: xr.Dataset,
    seeds: IntArray | None,
    responses: Sequence[RecordedResponse],
    n_times: int,
) -> xr.Dataset:
    """Thinned histories of some passages, as a file of the store holds them."""
    record = passages["t"].to_numpy()
    t = np.concatenate([[0.0], record])
    ends = np.unique(np.linspace(0, record.size, min(n_times, t.size)).round().astype(int))
    paths = [_path(passages, name, ends) for name in responses]
    extremes = [passages[name].to_numpy() for name in responses]
    found = xr.Dataset(
        {
            **{name: passages[name] for name in (*GAINS, "status", "lost_t")},
            **({} if seeds is None else {"track_seed": (("sample",), seeds)}),
            "path": (("sample", "response", "path_step"), np.stack(paths, axis=1)),
            "extreme_of_path": (("sample", "response"), np.stack(extremes, axis=1)),
        },
        coords={
            "response": list(responses),
            "t": t[ends],
            "path_step": np.arange(3 * (ends.size - 1) + 1),
        },
    )
    found.attrs = datasets.carried(passages)
    return found


def _path(passages: xr.Dataset, name: RecordedResponse, ends: IntArray) -> FloatArray:
    """Thinned histories (sample, path_step) of a response; a train at rest stands before them."""
    recorded = passages[f"{name}_history"].to_numpy()
    if recorded.ndim == 3:  # one for each car
        recorded = np.abs(recorded).max(axis=1)
    history = np.concatenate([np.zeros((len(recorded), 1)), recorded], axis=1)
    interval = float(passages["t"][0])
    return thinned(history, ends, passages[name], passages[f"{name}_t"].to_numpy() / interval)
