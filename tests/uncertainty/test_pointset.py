"""Point sets against the identities of the GF-discrepancy and known moments."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from maglev.uncertainty.distributions import Marginals
from maglev.uncertainty.pointset import (
    COUNTED_INPUTS,
    gf_discrepancy,
    gf_points,
    rearranged,
    sobol_points,
    voronoi_probability,
)

NORMAL = Marginals([stats.norm(5.0, 0.5)] * 4)
MIXED = Marginals([stats.norm(5.0, 0.5), stats.lognorm(0.3), stats.uniform(-1.0, 3.0)])


@pytest.fixture(scope="module")
def thousand():
    return gf_points(NORMAL, 1000, np.random.default_rng(20))


@settings(deadline=None, max_examples=30)
@given(st.integers(2, 60), st.integers(0, 2**32 - 1))
def test_first_rearrangement_has_discrepancy_half_an_equal_weight(n, seed):
    points = MIXED.from_unit_cube(np.random.default_rng(seed).uniform(0.01, 0.99, (n, 3)))
    equal = np.full(n, 1.0 / n)
    assert_allclose(gf_discrepancy(rearranged(points, equal, MIXED), equal, MIXED), 0.5 / n)


@settings(deadline=None, max_examples=30)
@given(st.integers(2, 60), st.integers(0, 2**32 - 1))
def test_weighted_rearrangement_has_discrepancy_half_the_largest_weight(n, seed):
    rng = np.random.default_rng(seed)
    points = MIXED.from_unit_cube(rng.uniform(0.01, 0.99, (n, 3)))
    weights = rng.dirichlet(np.full(n, 2.0))
    moved = rearranged(points, weights, MIXED)
    assert_allclose(gf_discrepancy(moved, weights, MIXED), weights.max() / 2, rtol=1e-9)
    assert_array_equal(rearranged(moved, weights, MIXED), moved)
    assert_array_equal(np.argsort(moved, axis=0), np.argsort(points, axis=0))


def test_discrepancy_of_a_hand_worked_case():
    uniform = Marginals([stats.uniform(0.0, 1.0)])
    # F_n jumps to 0.2 at 0.1 and to 1.0 at 0.4: the farthest is 1.0 - 0.4 at the second jump
    assert_allclose(gf_discrepancy([[0.1], [0.4]], [0.2, 0.8], uniform), 0.6)
    # F_n is still 0.2 just below 0.9: the farthest is 0.9 - 0.2
    assert_allclose(gf_discrepancy([[0.9], [0.6]], [0.8, 0.2], uniform), 0.7)
    # two points on one place jump together: 0 to 1 at 0.3
    assert_allclose(gf_discrepancy([[0.3], [0.3]], [0.5, 0.5], uniform), 0.7)


def test_discrepancy_with_equal_weights_is_the_kolmogorov_statistic():
    points = NORMAL.from_unit_cube(np.random.default_rng(3).random((50, 4)))
    expected = max(stats.kstest(points[:, i], stats.norm(5.0, 0.5).cdf).statistic for i in range(4))
    assert_allclose(gf_discrepancy(points, np.full(50, 0.02), NORMAL), expected, rtol=1e-12)


@pytest.mark.parametrize(("n", "published"), [(100, 0.0101), (200, 0.0058), (1000, 0.0012)])
def test_discrepancy_has_the_size_to_expect_in_four_dimensions(n, published):
    # It is half the largest of n counted cells, which differs from one scrambling to the next.
    found = [
        gf_points(NORMAL, n, np.random.default_rng(seed), counting=2**16).discrepancy
        for seed in range(5)
    ]
    assert 0.6 * published < np.median(found) < 1.25 * published


def test_set_carries_probabilities_discrepancy_and_counting_error(thousand):
    assert thousand.points.shape == (1000, 4)
    assert thousand.n_floored == 0
    assert_allclose(thousand.probability.sum(), 1.0, rtol=1e-12)
    assert_allclose(thousand.discrepancy, thousand.probability.max() / 2, rtol=1e-9)
    assert_allclose(thousand.counting_error, np.sqrt(thousand.probability / 2**20), rtol=1e-12)
    assert_allclose(thousand.points, 5.0 + 0.5 * thousand.standard, rtol=1e-12)


def test_moments_are_kept_because_weights_are_not_counted_again(thousand):
    P, u = thousand.probability, thousand.standard
    assert_allclose(P @ u, 0.0, atol=1e-3)
    assert_allclose(P @ u**2, 1.0, atol=2e-3)
    again, _, _ = voronoi_probability(thousand.points, NORMAL, np.random.default_rng(1), 2**17)
    assert np.all(again @ u**2 < 0.95)
    assert gf_discrepancy(thousand.points, again, NORMAL) > 5 * thousand.discrepancy


@pytest.mark.parametrize("s", [1, COUNTED_INPUTS, COUNTED_INPUTS + 1, 12, 20])
def test_many_inputs_keep_equal_weights_and_every_stratum_its_centre(s):
    inputs, n = Marginals([stats.norm(5.0, 0.5)] * s), 100
    found = gf_points(inputs, n, np.random.default_rng(3), counting=2**14)
    assert_allclose(found.probability.sum(), 1.0, rtol=1e-12)
    assert_allclose(found.discrepancy, found.probability.max() / 2, rtol=1e-9)
    if s <= COUNTED_INPUTS:
        assert found.n_counting == 2**14
        assert np.ptp(found.probability) > 0.1 / n
        return
    assert_array_equal(found.probability, 1.0 / n)
    assert (found.n_counting, found.n_floored, found.counting_error.max()) == (0, 0, 0.0)
    centres = np.tile((np.arange(n)[:, None] + 0.5) / n, s)
    assert_allclose(np.sort(inputs.to_unit_cube(found.points), axis=0), centres, rtol=1e-9)


def test_points_of_four_inputs_are_rearranged_counted_and_rearranged_bit_by_bit():
    n, equal = 100, np.full(100, 0.01)
    found = gf_points(NORMAL, n, np.random.default_rng(5), counting=2**14)
    rng = np.random.default_rng(5)
    first = rearranged(sobol_points(NORMAL, n, rng).points, equal, NORMAL)
    probability, _, _ = voronoi_probability(first, NORMAL, rng, 2**14)
    assert_array_equal(found.probability, probability)
    assert_array_equal(found.points, rearranged(first, probability, NORMAL))


def test_voronoi_probability_on_a_line_is_the_probability_between_midpoints():
    line = Marginals([stats.norm(2.0, 3.0)])
    u = np.array([-1.5, -0.2, 0.3, 1.9])
    probability, error, _ = voronoi_probability(
        line.from_standard(u[:, None]), line, np.random.default_rng(5), 2**16
    )
    faces = np.concatenate(([-np.inf], (u[1:] + u[:-1]) / 2, [np.inf]))
    exact = np.diff(stats.norm.cdf(faces))
    assert_allclose(probability, exact, atol=1e-4)
    assert_allclose(error, np.sqrt(exact / 2**16), rtol=1e-2)


def test_nearness_is_measured_in_standard_form_whatever_the_units():
    in_metres = Marginals([stats.norm(5.0, 0.5), stats.norm(1e6, 2e5)])
    in_millimetres = Marginals([stats.norm(5000.0, 500.0), stats.norm(1.0, 0.2)])
    a = gf_points(in_metres, 40, np.random.default_rng(8), counting=2**14)
    b = gf_points(in_millimetres, 40, np.random.default_rng(8), counting=2**14)
    assert_allclose(a.probability, b.probability, atol=2 / 2**14)
    assert_allclose(a.standard, b.standard, atol=1e-2)


def test_empty_cell_is_floored_and_said_to_be_so():
    far = np.array([[5.0] * 4, [5.2] * 4, [50.0] * 4])
    with pytest.warns(UserWarning, match="1 of 3 Voronoi cells hold none of 1024"):
        probability, _, n_floored = voronoi_probability(far, NORMAL, np.random.default_rng(0), 1024)
    assert n_floored == 1
    assert_allclose(probability[2], 0.5 / 1024.5)
    assert_allclose(probability.sum(), 1.0)
    assert np.all(np.isfinite(rearranged(far, probability, NORMAL)))


@pytest.mark.parametrize("n", [37, 64])
def test_one_stage_sets_have_equal_weights_and_fill_every_stratum(n):
    found = sobol_points(MIXED, n, np.random.default_rng(2))
    assert_allclose(found.probability, 1.0 / n)
    assert_array_equal(found.counting_error, 0.0)
    if n == 64:  # a power of two
        strata = np.floor(MIXED.to_unit_cube(found.points) * n).astype(int)
        assert_array_equal(np.sort(strata, axis=0), np.tile(np.arange(n)[:, None], 3))
        assert found.discrepancy <= 1.0 / n


@pytest.mark.parametrize("make", [gf_points, sobol_points])
def test_a_generator_in_the_same_state_gives_the_same_set(make):
    a, b = (make(MIXED, 20, np.random.default_rng(7)) for _ in range(2))
    assert_array_equal(a.points, b.points)
    assert_array_equal(a.probability, b.probability)
    assert np.any(make(MIXED, 20, np.random.default_rng(9)).points != a.points)


def test_bad_input_is_refused_with_a_sentence():
    rng = np.random.default_rng(0)
    points = sobol_points(NORMAL, 8, rng).points
    equal = np.full(8, 1 / 8)
    with pytest.raises(ValueError, match="at least 2 points, got 1"):
        gf_points(NORMAL, 1, rng)
    with pytest.raises(ValueError, match="power of two of at least the 8 points, got 1000"):
        voronoi_probability(points, NORMAL, rng, 1000)
    with pytest.raises(ValueError, match="power of two of at least the 8 points, got 4"):
        voronoi_probability(points, NORMAL, rng, 4)
    with pytest.raises(ValueError, match="got 1 duplicates among 9"):
        voronoi_probability(np.vstack((points, points[:1])), NORMAL, rng)
    tied = points.copy()
    tied[1, 2] = tied[0, 2]
    with pytest.raises(ValueError, match="input 2 has the same value at several points"):
        rearranged(tied, equal, NORMAL)
    with pytest.raises(ValueError, match=r"weights must sum to 1, got 1\.6"):
        rearranged(points, 1.6 * equal, NORMAL)
    with pytest.raises(ValueError, match="weights must be positive, got 0"):
        rearranged(points, np.append(np.full(7, 1 / 7), 0.0), NORMAL)
    with pytest.raises(ValueError, match="got NaN or infinity"):
        gf_discrepancy(np.full((8, 4), np.nan), equal, NORMAL)
    with pytest.raises(ValueError, match=r"expected \(sample, input = 4\)"):
        gf_discrepancy(points[:, :3], equal, NORMAL)
