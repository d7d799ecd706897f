"""What no run has visited, against hulls worked by hand, and a stop that knows of it."""

import numpy as np
import pytest
from known_functions import KNOWN
from numpy.testing import assert_allclose
from scipy.stats import chi2, norm

from maglev.errors import UserError
from maglev.uncertainty import exploration
from maglev.uncertainty.exploration import (
    empty_half_space,
    exploring_points,
    may_settle,
    surrounding_directions,
    unvisited_probability,
    with_unvisited,
)


def test_the_ball_within_a_cube_and_a_cross():
    rng = np.random.default_rng(0)
    axes = 3.0 * np.concatenate([np.eye(4), -np.eye(4)])
    assert_allclose(empty_half_space(axes, rng).distance, 1.5)  # 3/√4
    assert_allclose(empty_half_space(axes[:, :1], rng).distance, 3.0)
    assert_allclose(empty_half_space(4.0 * surrounding_directions(4, rng), rng).distance, 8**0.5)
    beside = empty_half_space(axes + np.array([10.0, 0.0, 0.0, 0.0]), rng)
    assert beside.distance < 0.0 and beside.probability > 0.5


def test_directions_find_the_same_half_space_as_the_hull(monkeypatch):
    points = np.random.default_rng(1).standard_normal((120, 4))
    exact = empty_half_space(points, np.random.default_rng(2))
    assert (points @ exact.direction <= exact.distance + 1e-9).all()
    monkeypatch.setattr(exploration, "MOST_HULL_INPUTS", 1)
    searched = empty_half_space(points, np.random.default_rng(2))
    assert exact.distance <= searched.distance + 1e-9
    assert_allclose(searched.distance, exact.distance, rtol=0.03)


def test_forty_runs_leave_no_half_space_of_four_inputs_as_likely_as_1e_3():
    rng = np.random.default_rng(3)
    points = rng.standard_normal((64, 4))
    before = empty_half_space(points, rng).probability
    new = exploring_points(points, 40, norm.isf(1e-3), rng)
    after = empty_half_space(np.concatenate([points, new]), rng).probability
    assert before > 0.05 and after < 1e-3
    assert_allclose(np.linalg.norm(new, axis=1), np.sqrt(2.0) * norm.isf(1e-3))


def test_the_share_out_of_reach_is_that_of_a_ball():
    population = np.random.default_rng(4).standard_normal((200_000, 3))
    found = unvisited_probability([[0.0, 0.0, 0.0]], population, reach=2.0)
    assert_allclose(found, chi2.sf(4.0, 3), rtol=0.02)
    # lengths below one shorten the reach, longer ones do not lengthen it
    assert unvisited_probability([[0.0] * 3], population, reach=2.0, length=50.0) == found
    short = unvisited_probability([[0.0] * 3], population, reach=2.0, length=0.5)
    assert_allclose(short, chi2.sf(1.0, 3), rtol=0.02)
    wide = 2.0 * population
    weight = np.exp(-0.5 * (wide**2).sum(axis=1) * 0.75) * 8.0
    weighted = unvisited_probability([[0.0] * 3], wide, reach=2.0, weight=weight)
    assert_allclose(weighted, found, rtol=0.02)


def test_the_unvisited_takes_the_upper_end_away():
    assert with_unvisited((0.1, 0.2), 0.05) == (0.1, 0.25)
    assert with_unvisited((0.0, 0.9), 0.5)[1] < 1.0


@pytest.mark.parametrize("seed", range(12))
def test_a_stray_tail_never_settles_before_it_was_met(seed):
    """A response constant but for a tail of 0.6 %: sure and wrong without exploration."""
    stray, rng = KNOWN["stray"], np.random.default_rng(seed)
    points = rng.standard_normal((40, 4))
    for _ in range(6):
        met = (stray.run(points)[0] > 1.1).any()
        unvisited = empty_half_space(points, rng).probability
        assert met or not may_settle([0.0, 0.0], 0.05, 2, unvisited, 1e-3)
        points = np.concatenate([points, exploring_points(points, 8, norm.isf(1e-3), rng)])
    assert may_settle([0.0, 0.0], 0.05, 2, empty_half_space(points, rng).probability, 1e-3)


def test_what_moves_does_not_settle():
    assert not may_settle([0.0, np.nan], 0.05, 2, 0.0, 1e-3)
    assert not may_settle([0.0], 0.05, 2, 0.0, 1e-3)
    assert not may_settle([0.01, 0.06], 0.05, 2, 0.0, 1e-3)
    assert may_settle([9.0, 0.01, 0.05], 0.05, 2, 1e-3, 1e-3)


def test_faulty_requests_are_refused_with_a_sentence():
    rng = np.random.default_rng(0)
    for call, sentence in (
        (lambda: empty_half_space(np.empty((0, 2)), rng), "got none"),
        (lambda: exploring_points([[0.0]], 0, 3.0, rng), "at least one new point"),
        (lambda: may_settle([0.0], 0.0, 1, 0.1, 0.1), "must be positive"),
        (lambda: unvisited_probability([[0.0]], [[1.0]], reach=-1.0), "must be positive"),
        (lambda: unvisited_probability([[0.0]], [[1.0]], weight=[1.0, 2.0]), "expected"),
    ):
        with pytest.raises(UserError, match=sentence):
            call()
