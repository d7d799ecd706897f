"""Points of the baseline of a case: plain random numbers."""

from __future__ import annotations

import numpy as np
import xarray as xr

from maglev.parameters import Config
from maglev.stage import Stage
from maglev.stages import points
from maglev.stages.points import baseline, marginals, n_samples
from maglev.stages.reads import N_SAMPLES, RANDOM_QUANTITIES
from maglev.uncertainty.pointset import PointSet, gf_discrepancy
from maglev.vocabulary import BASELINE


def dataset(config: Config, case: str) -> xr.Dataset:
    """Independent points of the random gains, equally likely.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.

    Returns
    -------
    dataset
        Layout ``points``.

    Raises
    ------
    UserError
        If there is no such case.
    """
    inputs, n = marginals(config, case), n_samples(config, case)
    standard = baseline(config, case, n)
    drawn, equal = inputs.from_standard(standard), np.full(n, 1.0 / n)
    found = PointSet(
        points=drawn,
        standard=standard,
        probability=equal,
        counting_error=np.zeros(n),
        discrepancy=gf_discrepancy(drawn, equal, inputs),
        n_counting=0,
        n_floored=0,
    )
    return points.dataset(config, case, found)


STAGE = Stage(
    name="baseline_points",
    of="case",
    reads=(*RANDOM_QUANTITIES, *N_SAMPLES),
    takes={"case": str},
    methods=(BASELINE,),
    layout="points",
    compute=dataset,
)
