"""Extremes of a set of runs as arrays, and coordinates of the files derived from them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.stats import norm

from maglev.arrays import BoolArray, FloatArray
from maglev.stages.randomness import generator_of_statistics
from maglev.uncertainty.distributions import Marginals
from maglev.uncertainty.pointset import sobol_points
from maglev.vocabulary import Response


def lost(runs: xr.Dataset) -> BoolArray:
    """Samples of a set of runs that have lost levitation (sample,)."""
    return runs["status"].to_numpy() != 0


def extremes(runs: xr.Dataset, responses: Sequence[Response]) -> FloatArray:
    """Extremes (sample, response) of a set of runs [their units], NaN where levitation was lost."""
    return np.column_stack([runs[name].to_numpy() for name in responses])


def responses_of(found: xr.Dataset) -> tuple[Response, ...]:
    """Responses of a file along its ``response``."""
    return tuple(found["response"].to_numpy().tolist())


def population(seed: int, n: int, n_parameters: int) -> FloatArray:
    """Equally likely standard normal points (sample, parameter): a scrambled Sobol' set [-].

    All cases with as many random gains share it, so that differences between them are their own.

    Parameters
    ----------
    seed
        Seed of the configuration.
    n
        Number of points.
    n_parameters
        Number of random gains.
    """
    marginals = Marginals([norm()] * n_parameters)
    return sobol_points(marginals, n, generator_of_statistics(seed, "population")).standard


def coordinates(responses: Sequence[Response], **along: npt.ArrayLike) -> dict[str, npt.ArrayLike]:
    """Coordinates of a file: its responses, and others by name."""
    return {"response": list(responses), **along}
