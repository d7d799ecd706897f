"""Representative points of a case, at which its extremes are predicted."""

from __future__ import annotations

import xarray as xr

from maglev.parameters import Config
from maglev.stage import Stage
from maglev.stages import points
from maglev.stages.points import gf_set
from maglev.stages.reads import RANDOM_QUANTITIES
from maglev.vocabulary import DESIGNED


def dataset(config: Config, case: str) -> xr.Dataset:
    """GF points of the random gains with their assigned probabilities.

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
    found = gf_set(config, case, config.study.n_representative, "representative")
    return points.dataset(config, case, found)


STAGE = Stage(
    name="representative_points",
    of="case",
    reads=(*RANDOM_QUANTITIES, "study.n_representative", "study.n_counting"),
    takes={"case": str},
    methods=DESIGNED,
    layout="points",
    compute=dataset,
)
