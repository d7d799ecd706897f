"""Initial points of the design of a method; of a one-stage design, all points."""

from __future__ import annotations

import xarray as xr

from maglev.parameters import Config
from maglev.stage import Stage
from maglev.stages import points
from maglev.stages.points import gf_set, parameters
from maglev.stages.reads import RANDOM_QUANTITIES
from maglev.vocabulary import DESIGNED

LEAST_PER_QUANTITY = 2
"""Runs of a first design for each random quantity, at least; assumed: a surrogate needs one for
each and one more, and some may lose levitation.  More at first served limits no better."""


def dataset(config: Config, case: str, method: str) -> xr.Dataset:
    """GF points of the random quantities, fewer where few are random.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    method
        ``"osm"``, ``"asm_paper"`` or ``"asm"``.

    Returns
    -------
    dataset
        Layout ``points``.

    Raises
    ------
    UserError
        If there is no such case.
    """
    design = getattr(config.study, method)
    if method == "osm":
        found = gf_set(config, case, design.n_runs, method)
    else:
        n_random = len(parameters(config, case))
        n = min(design.n_initial, design.initial_per_gain * n_random)
        n = max(n, LEAST_PER_QUANTITY * n_random)
        found = gf_set(config, case, n, f"initial_{method}")
    return points.dataset(config, case, found)


STAGE = Stage(
    name="initial_points",
    of="method",
    reads=(*RANDOM_QUANTITIES, "study.{method}", "study.n_counting"),
    takes={"case": str, "method": str},
    methods=DESIGNED,
    layout="points",
    compute=dataset,
)
