"""Candidate points for the rounds of an adaptive method."""

from __future__ import annotations

import xarray as xr

from maglev.parameters import Config
from maglev.stage import Stage
from maglev.stages import points
from maglev.stages.points import gf_set, marginals
from maglev.stages.randomness import generator
from maglev.stages.reads import RANDOM_QUANTITIES
from maglev.uncertainty.pointset import sobol_points
from maglev.vocabulary import ADAPTIVE


def dataset(config: Config, case: str, method: str) -> xr.Dataset:
    """GF points for the published method, Sobol' points for ours.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    method
        ``"asm_paper"`` or ``"asm"``.

    Returns
    -------
    dataset
        Layout ``points``.

    Raises
    ------
    UserError
        If there is no such case.
    """
    n, key = getattr(config.study, method).n_candidates, f"candidates_{method}"
    if method == "asm_paper":
        return points.dataset(config, case, gf_set(config, case, n, key))
    found = sobol_points(marginals(config, case), n, generator(config.seed, key))
    return points.dataset(config, case, found)


STAGE = Stage(
    name="candidate_points",
    of="method",
    reads=(*RANDOM_QUANTITIES, "study.{method}", "study.n_counting"),
    takes={"case": str, "method": str},
    methods=ADAPTIVE,
    layout="points",
    compute=dataset,
)
