"""Point sets of a case: the baseline, the designs' first points and candidates, representatives.

Every set draws from random numbers of its own, which the seed and the name of the set decide.  The
names of the cases play no part: with the same random gains, all cases have the same points in
standard form.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.stats import norm

from maglev.arrays import FloatArray, IntArray
from maglev.parameters import Case, Config
from maglev.uncertainty.distributions import Marginals
from maglev.uncertainty.pointset import PointSet, gf_discrepancy, gf_points, sobol_points
from maglev.vocabulary import GAINS


def generator(seed: int, *key: str | int) -> np.random.Generator:
    """Random numbers that belong to a seed and a key of words and numbers alone."""
    words = [list(part.encode()) if isinstance(part, str) else [part] for part in key]
    return np.random.default_rng([seed, *(number for word in words for number in word)])


def case_of(config: Config, name: str) -> Case:
    """Return a case by its name.

    Raises
    ------
    ValueError
        If there is no such case.
    """
    if name not in config.cases:
        raise ValueError(f"there is no case '{name}', known are: {', '.join(config.cases)}")
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
    ValueError
        If there is no such case.
    """
    chosen = case_of(config, case)
    mean = np.array(config.gains.as_row)[random_columns(chosen)]
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
    gains = np.tile(np.array(config.gains.as_row), (standard.shape[0], 1))
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
    """Seeds (sample,) of the irregularities that the samples meet; seed i does not depend on n."""
    return generator(config.seed, stream).integers(0, 2**31, size=n)


def _baseline_set(config: Config, case: str) -> PointSet:
    inputs, n = marginals(config, case), n_samples(config, case)
    standard = baseline(config, case, n)
    points, equal = inputs.from_standard(standard), np.full(n, 1.0 / n)
    return PointSet(
        points=points,
        standard=standard,
        probability=equal,
        counting_error=np.zeros(n),
        discrepancy=gf_discrepancy(points, equal, inputs),
        n_counting=0,
        n_floored=0,
    )


def _gf_set(size: Callable[[Config, int], int], name: str) -> Callable[[Config, str], PointSet]:
    def drawn(config: Config, case: str) -> PointSet:
        inputs = marginals(config, case)
        rng = generator(config.seed, name)
        return gf_points(inputs, size(config, inputs.n), rng, config.study.n_counting)

    return drawn


def _initial_size(method: str) -> Callable[[Config, int], int]:
    def size(config: Config, n_parameters: int) -> int:
        design = getattr(config.study, method)
        return min(design.n_initial, design.initial_per_gain * n_parameters)

    return size


def _tail_candidates(config: Config, case: str) -> PointSet:
    rng = generator(config.seed, "candidates_asm")
    return sobol_points(marginals(config, case), config.study.asm.n_candidates, rng)


SETS: Mapping[str, Callable[[Config, str], PointSet]] = {
    "baseline": _baseline_set,
    "representative": _gf_set(lambda c, _: c.study.n_representative, "representative"),
    "osm": _gf_set(lambda c, _: c.study.osm.n_runs, "osm"),
    "initial_asm_paper": _gf_set(_initial_size("asm_paper"), "initial_asm_paper"),
    "candidates_asm_paper": _gf_set(
        lambda c, _: c.study.asm_paper.n_candidates, "candidates_asm_paper"
    ),
    "initial_asm": _gf_set(_initial_size("asm"), "initial_asm"),
    "candidates_asm": _tail_candidates,
}
"""The point sets of a case by name: plain random numbers, GF points, or Sobol' points."""


def dataset(config: Config, case: str, name: str) -> xr.Dataset:
    """One point set of a case.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case.
    name
        A key of `SETS`.

    Returns
    -------
    dataset
        Layout ``points``.

    Raises
    ------
    ValueError
        If there is no such case or set.

    References
    ----------
    docs/theory/point_sets.md.
    """
    if name not in SETS:
        raise ValueError(f"there is no point set '{name}', known are: {', '.join(SETS)}")
    points = SETS[name](config, case)
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
