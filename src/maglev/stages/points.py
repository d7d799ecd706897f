"""Random quantities of a case: their laws, their points and their values.

Every set draws from random numbers of its own, which the seed and the name of the set decide.  The
names of the cases play no part: with as many random quantities, all cases have the same points in
standard form.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.stats import norm

from maglev.arrays import FloatArray, IntArray
from maglev.errors import UserError
from maglev.laws import Discrete, Distribution, Normal
from maglev.mechanics.varied import cost_of
from maglev.parameters import Case, Config, Gains
from maglev.stages.randomness import generator
from maglev.uncertainty.dependence import at_normal, nataf
from maglev.uncertainty.distributions import Marginals
from maglev.uncertainty.pointset import PointSet, gf_points
from maglev.vocabulary import BASELINE, GAINS

GAIN_COLUMNS = tuple(f"gains.{name}" for name in Gains.model_fields)
"""Dotted keys of the gains in the order of the columns that `maglev.simulate` takes."""

_FOUR_GAINS = GAIN_COLUMNS[: len(GAINS)]


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


def parameters(config: Config, case: str) -> tuple[str, ...]:
    """Dotted keys of what is random in a case, in their order in files and arrays.

    Examples
    --------
    >>> parameters(Config(), "only_suspension_derivative")
    ('gains.suspension_derivative',)
    """
    return tuple(case_of(config, case).random)


def named_values(config: Config, case: str, values: FloatArray) -> xr.DataArray:
    """Random quantities (sample, parameter) of a case with their keys and units, for a file."""
    keys = parameters(config, case)
    units = ", ".join(config.unit_of(key) or "1" for key in keys)
    return xr.DataArray(
        values,
        dims=("sample", "parameter"),
        coords={"parameter": list(keys)},
        attrs={"units_by_parameter": units},
    )


def laws_of(config: Config, case: str) -> dict[str, Distribution]:
    """Distribution of every random quantity of a case by its dotted key, in SI."""
    keys = parameters(config, case)
    own = config.with_case_set(case)
    return {key: own.distribution(case, key) for key in keys}


def marginals(config: Config, case: str) -> Marginals:
    """Distributions of the coordinates in which the points of a case are drawn.

    Where all quantities are normal and independent these are they themselves; otherwise
    independent standard normal variates, of which `values_at` makes the quantities.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.

    Returns
    -------
    marginals
        One distribution per random quantity, in their order.

    Raises
    ------
    UserError
        If there is no such case.
    """
    laws = laws_of(config, case)
    if _are_coordinates(config, case, laws):
        return Marginals([norm(law.mean(), law.std()) for law in laws.values()])
    return Marginals([norm()] * len(laws))


def _are_coordinates(config: Config, case: str, laws: Mapping[str, Distribution]) -> bool:
    """Whether the points of a case are drawn in its quantities: all normal and independent."""
    independent = not case_of(config, case).correlation
    return independent and all(isinstance(law, Normal) for law in laws.values())


def values_at(config: Config, case: str, standard: npt.ArrayLike) -> FloatArray:
    """Random quantities of a case at points in standard form.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    standard : (sample, parameter)
        Independent standard normal variates [-].

    Returns
    -------
    values : (sample, parameter)
        In the SI units of the quantities.

    Raises
    ------
    UserError
        If there is no such case, or its correlations cannot be met.
    """
    standard = np.asarray(standard, dtype=np.float64)
    laws = laws_of(config, case)
    if _are_coordinates(config, case, laws):
        return marginals(config, case).from_standard(standard)
    if case_of(config, case).correlation:
        matrix = case_of(config, case).correlation_matrix
        return nataf(list(laws.values()), matrix, list(laws)).physical(standard)
    columns = zip(laws.values(), standard.T, strict=True)
    return np.column_stack([at_normal(law, column) for law, column in columns])


def gains_at(config: Config, case: str, values: FloatArray) -> FloatArray:
    """The four gains of samples whose random quantities are given.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    values : (sample, parameter)
        From `values_at`.

    Returns
    -------
    gains : (sample, 4)
        In the order of `maglev.vocabulary.GAINS`; those that are not random as configured.
    """
    of_case = config.with_case_set(case).gains
    gains = np.tile(np.array(of_case.as_row), (values.shape[0], 1))
    for column, key in enumerate(parameters(config, case)):
        if key in _FOUR_GAINS:
            gains[:, _FOUR_GAINS.index(key)] = values[:, column]
    return gains


def others_at(config: Config, case: str, values: FloatArray) -> dict[str, FloatArray]:
    """Random quantities (sample,) of a case besides the four gains, by their dotted keys [SI]."""
    return {
        key: values[:, column]
        for column, key in enumerate(parameters(config, case))
        if key not in _FOUR_GAINS
    }


PREPARATION = 0.7
"""Process time of a system built anew for one sample, with five spans [s]: 0.3 to prepare it, 0.4
for a row of sixteen that one sample fills (docs/benchmarks/passage.md)."""


def cost_words(config: Config, case: str) -> str:
    """Sentence on the cost of random quantities that ask for systems built anew; empty for none.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.

    Examples
    --------
    >>> cost_words(Config(), "validation")
    ''
    """
    own, laws = config.of_case(case), laws_of(config, case)
    others = [key for key in laws if not key.startswith("gains.")]
    dear = [key for key, cost in cost_of(own, others).items() if cost == "rebuild"]
    if not dear:
        return ""
    chosen = case_of(config, case)
    runs = sum(
        n_samples(config, case) if method == BASELINE else _largest(config, method, len(laws))
        for method in chosen.possible_methods
    )
    values = [laws[key] for key in dear]
    if all(isinstance(law, Discrete) for law in values):
        runs = min(runs, math.prod(len(law.values) for law in values if isinstance(law, Discrete)))
    return (
        f"{', '.join(dear)}: every value asks for a system built anew, {runs} of them, about "
        f"{runs * PREPARATION / 60:.0f} min of one core"
    )


def _largest(config: Config, method: str, n_quantities: int) -> int:
    """Largest number of runs of a method with a surrogate."""
    study = config.study
    if method == "asm":
        return study.asm.largest(n_quantities)
    return study.osm.n_runs if method == "osm" else study.asm_paper.n_largest


def n_samples(config: Config, case: str) -> int:
    """Number of runs of the baseline of a case."""
    return case_of(config, case).n_samples or config.study.mcm.n_samples


def baseline(config: Config, case: str, n: int, stream: str = "baseline") -> FloatArray:
    """Independent random points (sample, parameter) in standard form [-].

    Sample i does not depend on ``n``.
    """
    shape = (n, len(parameters(config, case)))
    return generator(config.seed, stream).standard_normal(shape)


def track_seeds(config: Config, n: int, stream: str = "track") -> IntArray:
    """Seeds (sample,) of the irregularity of each sample; seed i does not depend on ``n``."""
    return generator(config.seed, stream).integers(0, 2**31, size=n)


def seeds_of_tracks(config: Config, case: str, n: int, stream: str = "track") -> IntArray | None:
    """Seeds (sample,) of the irregularities of the runs of a case; None if all meet one track.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    n
        Number of runs; seed i does not depend on it.
    stream
        What the random numbers belong to, where each run has a track of its own.
    """
    track = case_of(config, case).track
    if track == "fixed":
        return None
    if track == "random":
        return track_seeds(config, n, stream)
    return np.resize(seeds_of_line(config, int(track)), n)


def seeds_of_line(config: Config, n_tracks: int) -> IntArray:
    """Seeds (track,) of the tracks of the line, the first that of the configuration."""
    return np.concatenate([[config.seed], track_seeds(config, n_tracks - 1, "tracks")])


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
    values = values_at(config, case, points.standard)
    gains = gains_at(config, case, values)
    return xr.Dataset(
        {
            **{gain: (("sample",), gains[:, k]) for k, gain in enumerate(GAINS)},
            "parameter_value": named_values(config, case, values),
            "standard": (("sample", "parameter"), points.standard),
            "probability": (("sample",), points.probability),
            "discrepancy": ((), points.discrepancy),
            "counting_error": ((), points.counting_error.max()),
        },
        coords={
            "sample": np.arange(points.standard.shape[0]),
            "parameter": list(parameters(config, case)),
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
