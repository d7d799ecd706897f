"""Dynamic coefficient of the midspan deflection over a range of speeds.

Every passage is kept in the store of runs as soon as it is computed, so an interrupted sweep
continues where it stopped.
"""

from __future__ import annotations

import logging
import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import xarray as xr

from maglev.arrays import FloatArray
from maglev.measurements import measured_here
from maglev.mechanics import guideway, train
from maglev.mechanics.moving_load import dynamic_factor
from maglev.mechanics.statics import largest_deflection
from maglev.parameters import Config
from maglev.stage import Stage
from maglev.stages.deflection import load_per_length
from maglev.stages.guideway_modes import euler_span
from maglev.stages.reads import TRAIN_ON_GUIDEWAY
from maglev.stages.runs import stored_runs
from maglev.vocabulary import STATUS

_LOG = logging.getLogger(__name__)


def speeds(config: Config) -> FloatArray:
    """Speeds of the sweep (speed,) [m/s], both ends included where the step divides the range."""
    sweep = config.validation
    n_steps = math.floor((sweep.speed_max - sweep.speed_min) / sweep.speed_step + 1e-9)
    return sweep.speed_min + sweep.speed_step * np.arange(n_steps + 1, dtype=float)


def _at_speed(config: Config, speed: float) -> Config:
    passage = config.passage.model_copy(update={"speed": float(speed)})
    return config.model_copy(update={"passage": passage})


def _passages(config: Config, sweep: FloatArray, store: Path, n_threads: int) -> list[xr.Dataset]:
    """Extremes of one passage at each speed, from the store or computed now."""
    gains = np.array([config.gains.as_row])
    passages = []
    with ThreadPoolExecutor(n_threads) as pool:
        found = pool.map(lambda speed: stored_runs(_at_speed(config, speed), gains, store), sweep)
        for k, one in enumerate(found, start=1):
            passages.append(one)
            _LOG.info("%d of %d speeds done", k, sweep.size)
    return passages


def dataset(config: Config, store: str | Path, n_threads: int = 1) -> xr.Dataset:
    """Largest deflection and dynamic coefficient at each speed, beside measurement and closed form.

    Parameters
    ----------
    config
        The configuration; its ``passage.speed`` plays no part.
    store
        Folder of the store of runs.
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
    UserError
        As `maglev.simulate`.
    """
    here = measured_here(config)
    measured = () if here is None else here.peak_deflection
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
        },
        coords={"speed": sweep},
    )
    if measured:
        attributes = {
            "source": "; ".join(one.source for one in measured),
            "confidence": ", ".join(one.confidence for one in measured),
        }
        values = [one.value for one in measured]
        result = result.assign_coords(measured_speed=[one.speed for one in measured])
        result["measured_deflection"] = (("measured_speed",), values, attributes)
    return result


STAGE = Stage(
    name="dynamic_factor",
    of="run",
    reads=(*TRAIN_ON_GUIDEWAY, "gains", "validation"),
    takes={"store": Path, "n_threads": int},
    layout="dynamic_factor",
    compute=dataset,
)
