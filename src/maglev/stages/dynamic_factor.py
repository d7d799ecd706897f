"""Dynamic coefficient of the midspan deflection over a range of speeds.

Every passage is kept as a small file of its own as soon as it is computed, under a name made from
all that decides its content.  A sweep that was stopped goes on where it was.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import xarray as xr

from maglev import datasets
from maglev.fingerprint import code_of
from maglev.measurements import load_measurements
from maglev.mechanics import guideway, train
from maglev.mechanics.moving_load import dynamic_factor
from maglev.mechanics.statics import largest_deflection
from maglev.parameters import Config
from maglev.simulation import simulate
from maglev.stages import config_slice
from maglev.stages.deflection import load_per_length
from maglev.stages.modes import euler_span
from maglev.vocabulary import STATUS

_LOG = logging.getLogger(__name__)

_FILES = threading.Lock()
"""Held while a file is open: the NetCDF library serves one thread at a time."""


def speeds(config: Config) -> np.ndarray:
    """Speeds of the sweep (speed,) [m/s], both ends included where the step divides the range."""
    sweep = config.validation
    n_steps = math.floor((sweep.speed_max - sweep.speed_min) / sweep.speed_step + 1e-9)
    return sweep.speed_min + sweep.speed_step * np.arange(n_steps + 1)


def _at_speed(config: Config, speed: float) -> Config:
    passage = config.passage.model_copy(update={"speed": float(speed)})
    return config.model_copy(update={"passage": passage})


def _passage(config: Config, store: Path, code: str) -> tuple[xr.Dataset, bool]:
    """Extremes of one passage at the mean gains; whether they were computed, not found kept."""
    content = config_slice(config.quantities(), "passage")
    key = json.dumps([content, code], sort_keys=True).encode()
    path = store / f"{hashlib.sha256(key).hexdigest()[:16]}.nc"
    is_new = not path.is_file()
    if is_new:
        computed = simulate(config, np.array([config.gains.as_row]))
        with _FILES:
            datasets.write(computed, path, "passage", config=content, code=code)
    with _FILES:
        return datasets.read(path, "passage"), is_new


def _passages(config: Config, sweep: np.ndarray, store: Path, n_threads: int) -> list[xr.Dataset]:
    """Extremes of one passage at each speed; says how far it is after each.

    The time left assumes that a passage takes as long as the train needs, in proportion 1 / speed.
    """
    code = code_of("simulation")
    began, work_done, n_new = time.perf_counter(), 0.0, 0
    passages = []
    with ThreadPoolExecutor(n_threads) as pool:
        found = pool.map(lambda speed: _passage(_at_speed(config, speed), store, code), sweep)
        for k, (one, is_new) in enumerate(found):
            passages.append(one)
            if is_new:
                n_new, work_done = n_new + 1, work_done + 1 / sweep[k]
            seconds = time.perf_counter() - began
            left = seconds * np.sum(1 / sweep[k + 1 :]) / work_done if n_new else 0.0
            _LOG.info(
                "%d of %d speeds done (%d of them found), %.2f s each, %.0f s left",
                k + 1,
                sweep.size,
                k + 1 - n_new,
                seconds / max(n_new, 1),
                left,
            )
    return passages


def dataset(config: Config, store: str | Path, n_threads: int = 1) -> xr.Dataset:
    """Largest deflection and dynamic coefficient at each speed, beside measurement and closed form.

    Parameters
    ----------
    config
        The configuration; its ``passage.speed`` plays no part.
    store
        Folder in which the passages are kept.
    n_threads
        Passages computed at the same time; the numbers do not depend on it.

    Returns
    -------
    dataset
        Layout ``dynamic_factor``.

    Raises
    ------
    ConfigError
        If the measurements cannot be read.
    ValueError
        As `maglev.simulate`.
    """
    measured = load_measurements(config.validation.measurements).peak_deflection
    beam, load = euler_span(config), load_per_length(config)
    static = largest_deflection(guideway.build(config.guideway), train.build(config.train))
    sweep = speeds(config)
    passages = _passages(config, sweep, Path(store), n_threads)
    peaks = np.array([one["girder_displacement_z"].item() for one in passages])
    status = np.array([one["status"].item() for one in passages])
    lost = np.flatnonzero(status != 0)
    if lost.size:
        _LOG.warning(
            "%d of %d passages lost levitation, first at %.0f km/h (%s)",
            lost.size,
            sweep.size,
            3.6 * sweep[lost[0]],
            STATUS[int(status[lost[0]])],
        )
    factors = [dynamic_factor(beam, config.train.length, float(speed)) for speed in sweep]
    result = xr.Dataset(
        {
            "peak_deflection": (("speed",), peaks),
            "dynamic_factor": (("speed",), peaks / static),
            "dynamic_factor_moving_load": (("speed",), factors),
            "static_deflection": ((), static),
            "static_deflection_moving_load": ((), beam.static_deflection(load)),
            "passage_status": (("speed",), status),
            "measured_deflection": (("measured_speed",), [one.value for one in measured]),
        },
        coords={"speed": sweep, "measured_speed": [one.speed for one in measured]},
    )
    result["measured_deflection"].attrs = {
        "source": "; ".join(one.source for one in measured),
        "confidence": ", ".join(one.confidence for one in measured),
    }
    return result
