"""Probability of loss by lines, against half-spaces, two of them and bent borders."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import norm

from maglev.errors import UserError
from maglev.uncertainty import line_sampling
from maglev.uncertainty.line_sampling import equivalent_runs, lost_by_lines

TURN = np.linalg.qr(np.random.default_rng(4).standard_normal((4, 4)))[0]


def found(lost, seed, n=200, **options):
    """An estimate in turned coordinates v = Q u, and the number of runs that were made."""
    made = []

    def run(points):
        made.append(len(points))
        return lost(points @ TURN.T)

    estimate = lost_by_lines(run, 4, np.random.default_rng(seed), n_largest=n, **options)
    assert estimate.n_runs == sum(made)
    return estimate


@pytest.mark.parametrize(("distance", "reach"), [(2.5, 7.0), (4.75, 7.0), (5.6, 8.0)])
def test_half_spaces_down_to_1e_8_are_known_within_5_percent_by_200_runs(distance, reach):
    exact = norm.sf(distance)
    errors, inside = [], 0
    for seed in range(10):
        estimate = found(lambda v: v[:, 0] > distance, seed, reach=reach)
        assert estimate.n_runs <= 210
        errors.append(abs(estimate.probability / exact - 1.0))
        inside += estimate.lower <= exact <= estimate.upper
    assert np.sort(errors)[8] < 0.05  # nine of ten
    assert inside >= 8


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lost", "exact"),
    [
        (
            lambda v: (v[:, 0] > 4.6) | (v[:, 1] > 4.75),
            norm.sf(4.6) + norm.cdf(4.6) * norm.sf(4.75),
        ),
        (lambda v: (v[:, 0] > 4.6) | (v[:, 0] < -4.3), norm.sf(4.6) + norm.sf(4.3)),
    ],
    ids=["two planes", "both sides"],
)
def test_two_regions_are_both_found_and_counted_once(lost, exact):
    estimates = [found(lost, seed, 400) for seed in range(6)]
    assert all(len(one.regions) == 2 for one in estimates)
    assert_allclose([one.probability for one in estimates], exact, rtol=0.1)
    assert np.median([abs(one.probability / exact - 1.0) for one in estimates]) < 0.03


def test_overlapping_regions_are_not_counted_twice():
    """Planes at 53 degrees, so near that a seventh of one lies within the other."""
    second = np.array([0.6, 0.8, 0.0, 0.0])
    x = np.arange(-9.0, 9.0, 0.001)
    outside = norm.cdf((1.5 - 0.6 * x) / 0.8)
    exact = 1.0 - np.sum(norm.pdf(x) * outside * (x < 1.5)) * 0.001
    for seed in range(3):
        estimate = found(lambda v: (v[:, 0] > 1.5) | (v @ second > 1.5), seed, 400)
        assert abs(estimate.probability / exact - 1.0) < 0.05


@pytest.mark.slow
def test_a_bent_border_is_known_as_well():
    x = np.arange(-9.0, 9.0, 0.001)
    exact = np.sum(norm.pdf(x) * norm.sf(4.7 - 0.08 * x**2)) * 0.001
    estimates = [
        found(lambda v: v[:, 0] > 4.7 - 0.08 * v[:, 1] ** 2, seed, 400) for seed in range(6)
    ]
    errors = [abs(one.probability / exact - 1.0) for one in estimates]
    assert np.median(errors) < 0.04 and max(errors) < 0.15


@pytest.mark.slow
def test_lines_are_unbiased_although_they_share_a_fitted_border():
    """A crossing lies anywhere in its bracket, also where the guess of all lines is off."""
    exact, normal = norm.sf(4.75), TURN[0]
    errors, places = [], []
    for seed in range(16):
        estimate = found(lambda v: v[:, 0] > 4.75, seed)
        (region,) = estimate.regions
        crossing = (4.75 - region.foot @ normal) / (region.direction @ normal)
        places.append((crossing - region.low) / (region.high - region.low))
        errors.append(estimate.probability / exact - 1.0)
    place = np.concatenate(places)
    assert (place >= 0.0).all() and (place <= 1.0).all()
    assert abs(place.mean() - 0.5) < 3.0 * np.sqrt(1.0 / 12.0 / place.size)
    assert abs(np.mean(errors)) < 0.01


def test_lines_that_share_a_wrong_guess_do_not_agree_on_it():
    rng = np.random.default_rng(0)
    search = line_sampling._Search(lambda u: u[:, 0] > 1.004, 2, rng, 10_000, 7.0)
    foot, guess = np.zeros((400, 2)), np.full(400, 1.0)
    nowhere = np.full(400, -np.inf)
    low, high = line_sampling._bracketed(
        search, np.array([1.0, 0.0]), foot, nowhere, guess, 0.015, 0.03
    )
    assert (low <= 1.004).all() and (high > 1.004).all() and (high - low <= 0.0301).all()
    assert abs(np.mean(0.5 * (low + high)) - 1.004) < 3.0 * 0.03 / np.sqrt(12.0 * 400)


def test_without_a_lost_run_the_unvisited_half_space_is_the_upper_end():
    estimate = found(lambda v: v[:, 0] > 30.0, 0, 100)
    assert estimate.probability == 0.0 and estimate.regions == ()
    assert estimate.upper == estimate.unvisited
    assert 0.0 < estimate.unvisited <= norm.sf(7.0 / np.sqrt(2.0)) * 1.0001  # of the 24-cell


def test_the_same_seed_gives_the_same_numbers():
    one, other = (found(lambda v: v[:, 0] > 3.0, 5) for _ in range(2))
    assert (one.probability, one.lower, one.upper) == (other.probability, other.lower, other.upper)


def test_equivalent_runs_are_those_of_the_binomial():
    half = norm.ppf(0.975) * np.sqrt(0.01 * 0.99 / 5000)
    assert_allclose(equivalent_runs(0.01, half), 5000)


def test_faulty_requests_are_refused_with_a_sentence():
    rng = np.random.default_rng(0)
    for call, sentence in (
        (lambda: lost_by_lines(lambda u: u[:, 0] > -1.0, 2, rng), "at the mean of the inputs"),
        (lambda: lost_by_lines(lambda u: u[:, 0] > 3.0, 1, rng), "at least two inputs"),
        (lambda: lost_by_lines(lambda u: u[:, 0] > 3.0, 4, rng, n_largest=10), "takes 25 scouts"),
        (lambda: lost_by_lines(lambda u: u[:, 0] > 3.0, 4, rng, confidence=1.0), "confidence"),
    ):
        with pytest.raises(UserError, match=sentence):
            call()
