"""The compiled step of the evolution equation: conservation, variation, order, exact cases."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_allclose
from scipy import stats

from maglev.uncertainty._kernels import (
    MINMOD,
    SUPERBEE,
    UPWIND,
    advance,
    evolve,
    evolve_in_time,
    limited_jump,
    tvd_step,
)

LIMITERS = (UPWIND, MINMOD, SUPERBEE)
DENSITIES = hnp.arrays(float, 24, elements=st.floats(0.0, 10.0))
COURANTS = st.floats(-1.0, 1.0)


def advected(density, courant, limiter, steps):
    moved = np.pad(density, steps + 2)
    for _ in range(steps):
        tvd_step(moved, courant, limiter, 1, moved.size - 3)
    return moved


@settings(deadline=None)
@given(DENSITIES, COURANTS, st.sampled_from(LIMITERS))
def test_step_keeps_probability_sign_and_total_variation(density, courant, limiter):
    before, after = np.pad(density, 10), advected(density, courant, limiter, steps=8)
    assert_allclose(after.sum(), before.sum(), rtol=1e-12, atol=1e-12)
    assert np.abs(np.diff(after)).sum() <= np.abs(np.diff(before)).sum() * (1 + 1e-12) + 1e-12
    assert after.min() >= -1e-12


@settings(deadline=None)
@given(DENSITIES, COURANTS, st.sampled_from(LIMITERS))
def test_moving_left_is_the_mirror_image_of_moving_right(density, courant, limiter):
    right = advected(density, courant, limiter, steps=6)
    left = advected(density[::-1], -courant, limiter, steps=6)
    assert_allclose(left[::-1], right, atol=1e-12)


@pytest.mark.parametrize("limiter", LIMITERS)
@pytest.mark.parametrize("sign", [1, -1])
def test_courant_one_moves_cells_whole(limiter, sign):
    density = np.array([0.0, 3.0, 1.0, 4.0, 1.0, 5.0])
    moved = advected(density, float(sign), limiter, steps=5)
    assert_allclose(moved, np.roll(np.pad(density, 7), 5 * sign), atol=1e-13)


def test_limiters_on_hand_worked_jumps():
    # r = 1/2, 3 and -1 times a jump of 2: superbee takes the larger of min(2r, 1) and min(r, 2)
    assert [limited_jump(2.0, b, SUPERBEE) for b in (1.0, 6.0, -2.0)] == [2.0, 4.0, 0.0]
    assert [limited_jump(2.0, b, MINMOD) for b in (1.0, 6.0, -2.0)] == [1.0, 2.0, 0.0]
    assert [limited_jump(-2.0, b, SUPERBEE) for b in (-0.5, -3.0)] == [-1.0, -3.0]
    assert limited_jump(2.0, 1.0, UPWIND) == 0.0


@pytest.mark.parametrize("limiter", [MINMOD, SUPERBEE])
def test_order_is_two_where_the_density_is_smooth_and_monotone(limiter):
    # A front between two levels: cell means are differences of its integral, log cosh.
    def cell_means(faces):
        return 0.5 + 0.5 * np.diff(np.log(np.cosh(faces))) / np.diff(faces)

    cells, errors = np.array([50, 100, 200]), []
    for n in cells:
        faces = np.linspace(-15.0, 15.0, 6 * n + 1)
        width, steps = faces[1] - faces[0], n // 5  # by 0.4 cells a step: 0.4 units in all
        density = cell_means(faces)
        for _ in range(steps):
            tvd_step(density, 0.4, limiter, 1, density.size - 3)
        error = np.abs(density - cell_means(faces - steps * 0.4 * width))
        errors.append(error[n : 5 * n].sum() * width)
    order = -np.polyfit(np.log(cells), np.log(errors), 1)[0]
    assert 1.8 < order < 2.3


def evolved(increment, start, target, limiter, n_cells=160, lower=0, upper=160):
    total, survival = np.zeros(n_cells), np.zeros(increment.shape[1] + 1)
    spread = np.zeros(len(increment))
    probability = np.full(len(increment), 1.0 / len(increment))
    evolve(
        increment,
        np.asarray(start, dtype=float),
        np.asarray(target, dtype=float),
        probability,
        np.full(len(increment), increment.shape[1]),
        limiter,
        lower,
        upper,
        np.zeros(n_cells),
        total,
        survival,
        spread,
    )
    return total, survival, spread


@pytest.mark.parametrize("courant", [0.3, -0.7])
def test_upwind_kernel_is_the_binomial_distribution(courant):
    steps, start = 40, 80
    total, _, spread = evolved(
        np.full((1, steps), courant), [start], [start + steps * courant], UPWIND
    )
    moved = int(np.sign(courant)) * (np.arange(160) - start)
    assert_allclose(total, stats.binom.pmf(moved, steps, abs(courant)), atol=1e-15)
    assert_allclose(spread, steps * abs(courant) * (1 - abs(courant)), rtol=1e-12)


@pytest.mark.parametrize("limiter", LIMITERS)
def test_mass_is_kept_to_rounding_over_a_sine_of_many_steps(limiter):
    increments = 40.0 * np.diff(np.sin(2.5 * np.pi * np.linspace(0.0, 1.0, 401)))
    total, survival, _ = evolved(increments[None, :], [80.0], [120.0], limiter)
    assert_allclose(total.sum(), 1.0, rtol=0, atol=1e-12)
    assert_allclose(survival, 1.0, rtol=0, atol=1e-15)


def test_fractional_start_keeps_its_place_in_the_mean():
    total, _, spread = evolved(np.zeros((1, 1)), [30.25], [30.25], SUPERBEE)
    assert_allclose(total[30:32], [0.75, 0.25])
    assert_allclose(spread, 0.25 * 0.75)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("limiter", LIMITERS)
def test_whole_cells_are_gone_exactly_and_the_rest_by_one_step(limiter, sign):
    start, rest = np.array([0.1, 0.2, 0.4, 0.2, 0.1]), 0.3 * sign
    density, stepped = np.zeros((2, 40))
    for whole in (2, 9):  # less and more than the mass is wide
        density[:] = stepped[:] = 0.0
        density[18:23] = stepped[18 + sign * whole : 23 + sign * whole] = start
        tvd_step(stepped, rest, limiter, 17 + sign * whole, 23 + sign * whole)
        first, last, absorbed = advance(density, sign * whole + rest, limiter, 0, 40, 18, 22)
        assert_allclose(density, stepped, rtol=0, atol=1e-15)
        assert density[first] * density[last] > 0.0
        assert not absorbed


def test_points_leave_nothing_behind_for_one_another():
    slow, fast = np.full((1, 6), 0.3), np.full((1, 6), -2.7)
    alone = evolved(slow, [40.0], [41.8], SUPERBEE)[0]
    together = evolved(np.vstack([fast, slow]), [60.0, 40.0], [43.8, 41.8], SUPERBEE)[0]
    apart = evolved(fast, [60.0], [43.8], SUPERBEE)[0]
    assert_allclose(together, 0.5 * (alone + apart), rtol=0, atol=1e-16)


def test_a_history_shows_where_its_mass_is_at_every_time():
    place = np.array([[40.0, 43.0, 41.0], [50.0, 50.0, 56.0]])
    total, square = np.zeros((3, 100)), np.zeros(3)
    shares, until = np.array([0.25, 0.75]), np.array([2, 1])
    evolve_in_time(place, shares, until, SUPERBEE, np.zeros(100), total, square)
    # whole cells at Courant one are exact; the second point is gone after the second time
    for row, expected in zip(
        total, ({40: 0.25, 50: 0.75}, {43: 0.25, 50: 0.75}, {41: 0.25}), strict=True
    ):
        assert dict(zip(np.flatnonzero(row).tolist(), row[row > 0], strict=True)) == expected
    assert_allclose(square, 0.0, atol=0)


@pytest.mark.parametrize("sign", [1, -1])
def test_mass_past_a_barrier_is_removed_and_does_not_return(sign):
    there_and_back = sign * np.repeat([[0.8, -0.8]], 25, axis=1)
    barrier = {"upper": 60} if sign > 0 else {"lower": 41}
    total, survival, _ = evolved(there_and_back, [50.0], [50.0], SUPERBEE, **barrier)
    assert_allclose(total.sum(), 0.0, atol=1e-6)
    assert survival[0] == 1.0
    assert np.all(np.diff(survival) <= 1e-15)
    total, survival, _ = evolved(-there_and_back, [50.0], [50.0], SUPERBEE, **barrier)
    assert_allclose(survival[-1], 1.0, atol=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_one_interval_far_beyond_a_barrier_takes_all(sign):
    increments = np.array([[sign * 3.5, sign * 500.5, -sign * 500.5]])
    total, survival, _ = evolved(increments, [80.0], [80.0], SUPERBEE, lower=60, upper=101)
    assert_allclose(survival, [1.0, 1.0, 0.0, 0.0])
    assert_allclose(total, 0.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_survival_is_the_mass_inside_the_barriers(sign):
    # 20 cells at half a cell a step, the barrier face 20.5 cells away: not quite half has passed
    total, survival, _ = evolved(
        np.full((1, 40), sign * 0.5), [80.0], [80.0 + sign * 20], UPWIND, lower=60, upper=101
    )
    assert np.all(total[:60] == 0.0)
    assert np.all(total[101:] == 0.0)
    assert_allclose(survival[-1], total.sum(), rtol=1e-12)
    # absorbing: a mass that steps by one cell or none never returns, so it is the binomial itself
    assert_allclose(total.sum(), stats.binom.cdf(20, 40, 0.5), rtol=1e-12)
