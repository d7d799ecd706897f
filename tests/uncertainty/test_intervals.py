"""Limits of a surrogate alone with their joint error, against refits and known functions."""

import numpy as np
import pytest
from known_functions import KNOWN
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import norm

from maglev.errors import UserError
from maglev.uncertainty.exploration import exploring_points
from maglev.uncertainty.intervals import joint_error_range, joint_limits
from maglev.uncertainty.kriging import conditioned_kriging, fit_kriging
from maglev.vocabulary import GIVEN, INFINITE, TOO_FEW

POPULATION = np.random.default_rng(8).standard_normal((20_000, 2))
RUNS = np.random.default_rng(9).standard_normal((40, 2))


def curved(u):
    return (u[:, 0] + 0.5 * np.sin(2.0 * u[:, 1]))[:, None]


@pytest.fixture(scope="module")
def process():
    return fit_kriging(RUNS, curved(RUNS))


def test_influence_times_residual_is_what_a_prediction_loses_without_a_run(process):
    places = POPULATION[:20]
    k = 7
    kept = np.arange(40) != k
    # the same lengths, and the prior of the same size although the deviation differs
    scale = (process.deviation / process.values[kept].std(axis=0)) ** 2
    without = conditioned_kriging(
        RUNS[kept],
        process.values[kept],
        length=process.length,
        amplitude=process.amplitude * scale,
    )
    lost = process.influence(0, places)[k] * process.leave_one_out()[k, 0]
    change = process.predict(places)[:, 0] - without.predict(places)[:, 0]
    # but for the constant mean, which is that of the values left
    assert_allclose(lost, change, atol=0.05 * np.abs(lost).max() + 2e-4)


def test_a_linear_response_has_hardly_an_error():
    process = fit_kriging(RUNS, RUNS @ [[1.0], [2.0]])
    low, high = joint_error_range([5.2], process, 0, POPULATION)
    assert -0.01 < low[0] < 0.0 < high[0] < 0.01


def test_what_is_not_explained_counts_with_one_sign():
    """Pure noise: the range is at least that of the residuals."""
    noise = np.random.default_rng(1).standard_normal((40, 1))
    process = fit_kriging(RUNS, noise)
    low, high = joint_error_range([0.3], process, 0, POPULATION)
    residuals = np.sort(process.leave_one_out()[:, 0])
    assert low[0] < 0.6 * residuals[1] and high[0] > 0.6 * residuals[-2]


def test_the_unvisited_and_the_lost_move_the_ends(process):
    levels = [0.1, 0.02]
    plain = joint_limits(process, 0, POPULATION, levels)
    more = joint_limits(process, 0, POPULATION, levels, unvisited=0.03)
    assert_array_equal(more.limit, plain.limit)
    assert_array_equal(more.lower, plain.lower)
    assert more.upper[0] == plain.upper[0] and more.upper[1] == np.inf
    worst = joint_limits(process, 0, POPULATION, levels, lost_interval=(0.0, 0.03))
    assert worst.upper[0] > plain.upper[0] and worst.upper[1] == np.inf
    held = POPULATION[:, 0] < norm.isf(0.05)
    cut = joint_limits(process, 0, POPULATION, levels, held=held, lost_interval=(0.03, 0.07))
    assert cut.status == (GIVEN, INFINITE)
    assert cut.limit[0] >= plain.limit[0] - 0.1 and cut.upper[0] > cut.limit[0]
    assert joint_limits(process, 0, POPULATION, [1e-4]).status == (TOO_FEW,)


def test_weights_stand_for_the_law(process):
    wide = 1.7 * POPULATION
    weight = np.exp(-0.5 * (wide**2).sum(axis=1) * (1.0 - 1.7**-2))
    plain = joint_limits(process, 0, POPULATION, [0.05])
    weighted = joint_limits(process, 0, wide, [0.05], weight=weight)
    assert_allclose(weighted.limit, plain.limit, atol=0.06)
    ranges = [
        joint_error_range(plain.limit, process, 0, *population)[1]
        for population in ((POPULATION,), (wide,))
    ]
    of_law = joint_error_range(plain.limit, process, 0, wide, weight=weight)[1]
    assert 0.5 < of_law / ranges[0] < 2.0
    assert ranges[1] / ranges[0] > 2.5  # without weights it is another law


@pytest.mark.slow
@pytest.mark.parametrize("name", ["smooth", "kinked", "jump"])
def test_intervals_hold_the_limits_of_known_functions(name):
    """A small version of docs/benchmarks/coverage.md."""
    known, levels = KNOWN[name], np.array([1e-2, 1e-3])
    exact, sigma = known.limits(levels)
    population = 1.3 * np.random.default_rng(2).standard_normal((30_000, known.n_inputs))
    weight = np.exp(-0.5 * (population**2).sum(axis=1) * (1.0 - 1.3**-2))
    inside, widths = [], []
    for seed in range(5):
        rng = np.random.default_rng(seed)
        points = rng.standard_normal((70, known.n_inputs))
        points = np.concatenate([points, exploring_points(points, 34, norm.isf(1e-3), rng)])
        process = fit_kriging(points, known.run(points)[0])
        found = joint_limits(process, 0, population, levels, weight=weight)
        inside.append((found.lower <= exact) & (exact <= found.upper))
        widths.append(found.half_width / sigma)
    assert np.mean(inside) >= 0.8  # 0.95 is claimed
    assert not known.regular or np.median(widths, axis=0)[0] < 0.5


def test_faulty_requests_are_refused_with_a_sentence(process):
    for call, sentence in (
        (lambda: joint_error_range([np.inf], process, 0, POPULATION), "must be finite"),
        (lambda: joint_limits(process, 0, POPULATION, [1.0]), r"must lie in \(0, 1\)"),
        (lambda: joint_limits(process, 0, POPULATION, [0.1], weight=[1.0]), "20000 numbers"),
        (lambda: joint_limits(process, 0, POPULATION, [0.1], unvisited=2.0), "unvisited"),
        (
            lambda: joint_limits(process, 0, POPULATION, [0.1], lost_interval=(0.2, 0.1)),
            "must have an interval",
        ),
    ):
        with pytest.raises(UserError, match=sentence):
            call()
