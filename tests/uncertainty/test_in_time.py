"""Density in time and first passage of histories whose law is known, and thinned histories."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from maglev.uncertainty.gdee import first_passage
from maglev.uncertainty.in_time import density_in_time, quantiles_in_time, thinned

N = 500
NORMAL = stats.norm.ppf((np.arange(N) + 0.5) / N)
AMPLITUDE = 1.0 + 0.2 * NORMAL
OMEGA, TIME = 2.0 * np.pi, np.linspace(0.0, 1.0, 101)


def sines():
    """Z = A sin(wt) with A ~ N(1, 0.2²): normal at every time."""
    return AMPLITUDE[:, None] * np.sin(OMEGA * TIME)


def difference(found, time, law):
    """Integral of the absolute difference from an exact density at a time."""
    width = found.cell_width[time]
    return np.abs(found.density[time] - law.pdf(found.cell_centre[time])).sum() * width


def test_a_sine_of_normal_amplitude_has_its_normal_density_at_every_time():
    found = density_in_time(sines())
    for time in (10, 25, 45, 60, 75, 99):
        law = stats.norm(np.sin(OMEGA * TIME[time]), 0.2 * abs(np.sin(OMEGA * TIME[time])))
        assert difference(found, time, law) < 0.06
    assert_allclose(found.mean, np.sin(OMEGA * TIME), atol=1e-12)
    assert_allclose(found.deviation, 0.2 * np.abs(np.sin(OMEGA * TIME)), rtol=0.01, atol=1e-12)


def test_two_normals_that_take_turns_have_their_normal_density():
    # Z = A cos wt + B sin wt: every history goes its own way, the law never changes
    one, other = np.random.default_rng(1).permutation(NORMAL), NORMAL
    found = density_in_time(
        one[:, None] * np.cos(OMEGA * TIME) + other[:, None] * np.sin(OMEGA * TIME)
    )
    for time in (30, 50, 80, 100):
        law = stats.norm(found.mean[time], found.deviation[time])
        assert difference(found, time, law) < 0.12
    wide = found.deviation > 0.5
    kernel = np.sqrt(np.mean((found.kernel_deviation / found.deviation)[wide] ** 2))
    assert_allclose(kernel, found.bandwidth, rtol=0.15)


def test_probability_is_kept_to_rounding_and_leaves_with_what_is_lost():
    probability = np.linspace(1.0, 3.0, N)
    probability /= probability.sum()
    until = np.full(N, TIME.size - 1)
    until[:50] = 40
    histories = sines()
    histories[:50, 41:] = np.nan
    found = density_in_time(histories, probability, held_until=until)
    mass = found.density.sum(axis=1) * found.cell_width
    held = np.where(np.arange(TIME.size) <= 40, 1.0, probability[50:].sum())
    assert_allclose(found.held, held, rtol=1e-13)
    assert_allclose(mass, held, rtol=1e-12)
    assert_allclose(found.mean[-26], probability[50:] @ histories[50:, -26] / held[-1], rtol=1e-12)
    assert found.density.min() >= 0.0


def test_the_mean_of_the_density_is_that_of_the_histories():
    found = density_in_time(sines())
    weight = found.density * found.cell_width[:, None]
    mean = (weight * found.cell_centre).sum(axis=1)
    # a limited scheme keeps the mean of a mass but for a part of its kernel
    assert_allclose(mean, found.mean, atol=0.05 * found.kernel_deviation.max())


def test_density_in_time_follows_a_change_of_unit():
    metres, microns = density_in_time(1e-3 + 1e-6 * sines()), density_in_time(1e3 + sines())
    assert_allclose(microns.cell_centre, 1e6 * metres.cell_centre, rtol=1e-9)
    assert_allclose(microns.density, 1e-6 * metres.density, rtol=1e-3, atol=1e-5)


def test_quantiles_are_exact_and_of_those_that_are_there():
    found = quantiles_in_time(sines(), [0.1, 0.5, 0.9])
    exact = stats.norm(1.0, 0.2).ppf([0.1, 0.5, 0.9])
    assert_allclose(found[25], exact, atol=0.003)
    assert_allclose(found[75], -exact[::-1], atol=0.003)
    until = np.where(AMPLITUDE > 1.0, 20, 100)
    assert quantiles_in_time(sines(), [0.5], held_until=until)[25] < 0.9


@pytest.mark.parametrize("barrier", [1.0, 1.2, 1.4])
def test_first_passage_of_sines_has_its_closed_form(barrier):
    # |A sin| first reaches b when |A| > b / the largest |sin| so far
    found = first_passage(sines(), mesh=0.002, lower=-barrier, upper=barrier)
    so_far = np.maximum.accumulate(np.abs(np.sin(OMEGA * TIME)))[1:]
    law = stats.norm(1.0, 0.2)
    exact = law.cdf(barrier / so_far) - law.cdf(-barrier / so_far)
    assert_allclose(found.survival[1:], exact, atol=0.02)
    assert_allclose(found.exact_survival[1:], exact, atol=1.5 / N)
    # at the end it is the distribution function of the extreme
    extreme = np.abs(sines()).max(axis=1)
    assert found.exact_survival[-1] == pytest.approx(np.mean(extreme < barrier), abs=1e-12)


def test_a_history_that_is_lost_leaves_like_one_that_reaches_a_barrier():
    histories = np.zeros((4, 5)) + 0.1 * np.arange(5)
    found = first_passage(histories, mesh=0.05, upper=10.0, held_until=[4, 2, 0, 4])
    for survival in (found.survival, found.exact_survival):
        assert_allclose(survival, [1.0, 0.75, 0.75, 0.5, 0.5])
    assert_allclose(found.density.sum() * found.mesh, 0.5)


def test_a_thinned_history_reaches_what_the_history_reaches():
    rng = np.random.default_rng(3)
    histories = np.cumsum(rng.standard_normal((6, 301)), axis=1)
    histories[:, 0] = 0.0
    ends = np.array([0, 40, 100, 101, 230, 300])
    at = np.abs(histories).argmax(axis=1)
    largest = np.abs(histories)[np.arange(6), at]
    path = thinned(histories, ends, largest, at)
    assert_array_equal(path[:, ::3], histories[:, ends])
    for k, (start, stop) in enumerate(pairwise(ends)):
        inside, turns = histories[:, start + 1 : stop + 1], path[:, 3 * k + 1 : 3 * k + 3]
        assert_array_equal(turns.max(axis=1), inside.max(axis=1))
        assert_array_equal(turns.min(axis=1), inside.min(axis=1))
        first_is_high = inside.argmax(axis=1) <= inside.argmin(axis=1)
        assert_array_equal(turns[:, 0] >= turns[:, 1], first_is_high)


def test_an_extreme_between_two_records_is_put_in_its_place():
    history = [[0.0, 1.0, 3.0, 2.0, -1.0, -4.0, -3.9, 0.0]]
    path = thinned(history, [0, 3, 7], [4.2], [5.5])
    assert_allclose(path, [[0.0, 1.0, 3.0, 2.0, -4.2, 0.0, 0.0]])


def test_a_history_that_ends_is_thinned_as_far_as_it_goes():
    history = [[0.0, 1.0, 2.0, np.nan, np.nan]]
    path = thinned(history, [0, 2, 4], [np.nan], [np.nan])
    assert_array_equal(path, [[0.0, 1.0, 2.0, 2.0, np.nan, np.nan, np.nan]])


def test_faulty_histories_and_meshes_are_refused():
    for histories, options, sentence in (
        (np.ones((3, 4)), {}, "histories must differ"),
        (sines()[0], {}, "two times or more"),
        (sines() * np.nan, {}, "finite while they are there"),
        (sines(), {"mesh": 0.0}, "mesh must be positive"),
        (sines(), {"limiter": "van_leer"}, "limiter must be one of"),
        (sines(), {"held_until": np.full(N, 3)}, "got none at time 4"),
        (sines(), {"held_until": np.full(N, 101)}, "must number one of 101 times"),
        (sines(), {"held_until": np.full(N, 2.0)}, "whole numbers, one for each"),
    ):
        with pytest.raises(ValueError, match=sentence):
            density_in_time(histories, **options)
