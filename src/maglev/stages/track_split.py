"""Contributions of random gains and a random track to the extremes."""

from __future__ import annotations

import logging
from collections.abc import Mapping

import numpy as np
import xarray as xr

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.density import grid
from maglev.stages.extremes import coordinates, extremes, lost
from maglev.stages.randomness import generator_of_statistics
from maglev.stages.reads import RESPONSES_OF_STUDY
from maglev.uncertainty.gdee import direct_density, silverman_bandwidth
from maglev.uncertainty.samples import held_part
from maglev.uncertainty.shares import pick_freeze_shares

_LOG = logging.getLogger(__name__)


def dataset(
    config: Config, baseline: xr.Dataset, track_runs: Mapping[str, xr.Dataset]
) -> xr.Dataset:
    """Densities with gains, track or both random, and the shares of the variance.

    Shares are closed Sobol' indices by pick-freeze, over the samples of which all three runs held.

    Parameters
    ----------
    config
        The configuration.
    baseline
        Layout ``runs``: gains i on track i.
    track_runs
        Layout ``runs``, as many samples, by the names of `maglev.vocabulary.TRACK_PARTS`.

    Returns
    -------
    dataset
        Layout ``track_split``; ``gains_only`` stands on the configured track, ``track_only`` on
        the mean gains.  ``n_runs`` counts all five sets.

    Raises
    ------
    UserError
        If sets differ in size, or fewer than two samples held in all of them.

    References
    ----------
    Janon et al., ESAIM Probab. Stat. 18 (2014) 342-364.
    """
    both, parts = baseline, track_runs
    sizes = {name: part.sizes["sample"] for name, part in parts.items()}
    n = both.sizes["sample"]
    if set(sizes.values()) != {n}:
        raise UserError(f"all sets of runs must have {n} samples, got {sizes}; run them again")
    names = ("gains_only", "track_only")
    sets = {"both": both, **{name: parts[name] for name in names}}
    responses = config.responses_of_study
    values = {name: extremes(part, responses) for name, part in {"both": both, **parts}.items()}
    kept = ~np.logical_or.reduce(
        [lost(part) for part in (both, parts["other_track"], parts["other_gains"])]
    )
    rng = generator_of_statistics(config.seed, "bootstrap of the shares")
    rows, shares = [], []
    for response, name in enumerate(responses):
        held = {key: held_part(values[key][:, response], lost(part)) for key, part in sets.items()}
        together = np.concatenate([one.values for one in held.values()])
        widest = max(silverman_bandwidth(one.values) for one in held.values())
        at = grid(together, np.full(together.size, 1 / together.size), widest)
        rows.append(
            {
                "value": at,
                **{
                    f"density_{key}": direct_density(
                        at, one.values, lost_probability=one.lost_probability
                    )
                    for key, one in held.items()
                },
            }
        )
        share = pick_freeze_shares(
            values["both"][kept, response],
            values["other_track"][kept, response],
            values["other_gains"][kept, response],
            rng,
            config.study.confidence,
        )
        shares.append((share.first, share.second, share.interaction))
        _LOG.info(
            "%s: gains %.2f [%.2f, %.2f], track %.2f [%.2f, %.2f]",
            name,
            *share.first,
            *share.second,
        )
    columns: dict[str, tuple[tuple[str, ...], FloatArray]] = {
        key: (("response", "cell"), np.array([row[key] for row in rows])) for key in rows[0]
    }
    ends = np.array(shares)  # response, share, end
    for k, kind in enumerate(("gains_share", "track_share", "interaction_share")):
        for end, suffix in enumerate(("", "_low", "_high")):
            columns[f"{kind}{suffix}"] = (("response",), ends[:, k, end])
    result = xr.Dataset(
        {**columns, "n_runs": ((), n * (1 + len(parts)))},
        coords=coordinates(responses, cell=np.arange(columns["value"][1].shape[1])),
    )
    result["gains_share"].attrs["comment"] = (
        f"{np.count_nonzero(kept)} of {n} samples, those of which all three runs held"
    )
    return result


STAGE = Stage(
    name="track_split",
    of="case",
    reads=("seed", "study.confidence", *RESPONSES_OF_STUDY),
    inputs={"baseline": Input("runs"), "track_runs": Input("runs", by=("part",))},
    layout="track_split",
    compute=dataset,
)
