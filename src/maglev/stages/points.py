"""Random gains of a case: their columns, their distributions and their points.

Every set has a random stream of its own, given by the seed and the name of the set.  The names of
the cases play no part: with the same random gains, all cases have the same points in standard
form.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.stats import norm

from maglev.arrays import FloatArray, IntArray
from maglev.errors import UserError
from maglev.parameters import Case, Config
from maglev.stages.randomness import generator
from maglev.uncertainty.distributions import Marginals
from maglev.uncertainty.pointset import PointSet, gf_points
from maglev.vocabulary import GAINS


def case_of(config: Config, name: str) -> Case:
    """Return a case by its name.

    Raises
    ------
    UserError
        If there is no such case.
    """
    if name not in config.cases:
        raise UserError(f"there is no case '{name}', known are: {', '.join(config.cases)}")
    return config.cases[name]


def random_columns(case: Case) -> IntArray:
    """Columns (parameter,) of the random gains in an array of all four, in rising order."""
    return np.flatnonzero([name.removesuffix("_gain") in case.random_gains for name in GAINS])


def marginals(config: Config, case: str) -> Marginals:
    """Distributions of the random gains of a case: independent, normal.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.

    Returns
    -------
    marginals
        One distribution per random gain, in the order of `maglev.vocabulary.GAINS`.

    Raises
    ------
    UserError
        If there is no such case.
    """
    chosen = case_of(config, case)
    mean = np.array(config.with_case_set(case).gains.as_row)[random_columns(chosen)]
    return Marginals([norm(one, chosen.coefficient_of_variation * one) for one in mean])


def gains_at(config: Config, case: str, standard: npt.ArrayLike) -> FloatArray:
    """All four gains at standardised points of the random ones.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    standard : (sample, parameter)
        Standardised random gains [-].

    Returns
    -------
    gains : (sample, 4)
        Gains [A/m, A s/m, A/m, A s/m]; those that are not random at their means.
    """
    standard = np.asarray(standard, dtype=np.float64)
    gains = np.tile(np.array(config.with_case_set(case).gains.as_row), (standard.shape[0], 1))
    columns = random_columns(case_of(config, case))
    gains[:, columns] = marginals(config, case).from_standard(standard)
    return gains


def n_samples(config: Config, case: str) -> int:
    """Number of runs of the baseline of a case."""
    return case_of(config, case).n_samples or config.study.mcm.n_samples


def baseline(config: Config, case: str, n: int, stream: str = "baseline") -> FloatArray:
    """Independent random points (sample, parameter) in standard form [-].

    Sample i does not depend on ``n``.
    """
    shape = (n, random_columns(case_of(config, case)).size)
    return generator(config.seed, stream).standard_normal(shape)


def track_seeds(config: Config, n: int, stream: str = "track") -> IntArray:
    """Seeds (sample,) of the irregularity of each sample; seed i does not depend on ``n``."""
    return generator(config.seed, stream).integers(0, 2**31, size=n)


def dataset(config: Config, case: str, points: PointSet) -> xr.Dataset:
    """A point set of a case in the layout ``points``, with all four gains.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    points
        Points of the random gains of the case.
    """
    gains = gains_at(config, case, points.standard)
    return xr.Dataset(
        {
            **{gain: (("sample",), gains[:, k]) for k, gain in enumerate(GAINS)},
            "standard": (("sample", "parameter"), points.standard),
            "probability": (("sample",), points.probability),
            "discrepancy": ((), points.discrepancy),
            "counting_error": ((), points.counting_error.max()),
        },
        coords={
            "sample": np.arange(points.standard.shape[0]),
            "parameter": random_columns(case_of(config, case)).astype(np.int8),
        },
    )


def gf_set(config: Config, case: str, n: int, key: str) -> PointSet:
    """Points of a case by the least GF-discrepancy.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    n
        Number of points.
    key
        Purpose of the random numbers, see `maglev.stages.randomness.generator`.

    References
    ----------
    docs/theory/point_sets.md.
    """
    rng = generator(config.seed, key)
    return gf_points(marginals(config, case), n, rng, config.study.n_counting)
