"""Which coordinates of the guideway are stepped when, and what it costs to leave some alone."""

from dataclasses import replace
from functools import lru_cache
from unittest import mock

import numpy as np
import scipy.linalg
from numpy.testing import assert_allclose, assert_array_equal

from maglev.mechanics import (
    _kernels,
    activity,
    guideway,
    integrate,
    packing,
    reduction,
)
from maglev.mechanics._records import Motion
from maglev.mechanics.course import course
from maglev.mechanics.lanes import LANES
from maglev.parameters import Config
from maglev.simulation import track

LONG = Config.model_validate({"train": {"n_cars": 1}, "guideway": {"n_spans": 12}})
"""One car on twelve spans: most of the guideway has no train."""


@lru_cache
def reduced_guideway():
    passage = LONG.passage
    return reduction.reduce(
        guideway.build(LONG.guideway), passage.mode_cutoff, passage.mode_cutoff_elsewhere
    )


@lru_cache
def stretches():
    return activity.stretches(LONG, reduced_guideway())


def passed(**constants):
    """Extremes of eight samples, with other constants of the activity."""
    spread = 1 + 0.1 * np.random.default_rng(4).standard_normal((8, 4))
    usual = {"QUIET_CUTOFF": activity.QUIET_CUTOFF, "AWAKE_BESIDE": activity.AWAKE_BESIDE}
    with mock.patch.multiple(activity, **(usual | constants)):
        system = integrate.prepare(LONG, track(LONG))
        found = integrate.integrate(system, np.array(LONG.gains.as_row) * spread)
    assert not found.status.any()
    return np.column_stack([found.girder, found.body_z, found.body_y, found.gap_min, found.gap_max])


def test_quiet_spans_cost_no_accuracy():
    everywhere = passed(AWAKE_BESIDE=LONG.guideway.n_spans)
    quiet = passed()
    assert np.abs(quiet / everywhere - 1).max() < 3e-3
    assert np.any(quiet != everywhere)


def test_the_lower_the_modes_that_quiet_spans_keep_the_larger_the_error():
    everywhere = passed(AWAKE_BESIDE=LONG.guideway.n_spans)
    errors = [
        np.abs(passed(QUIET_CUTOFF=cutoff) / everywhere - 1).max() for cutoff in (20.0, 100.0)
    ]
    assert errors[1] < 0.2 * errors[0]


def test_spans_under_the_train_and_beside_it_are_awake_and_so_is_the_middle_one():
    length, n_spans = LONG.guideway.span_length, LONG.guideway.n_spans
    starts = [stretch.first_step for stretch in stretches()] + [course(LONG).n_steps + 1]
    assert np.all(np.diff(starts) > 0)
    for stretch, begin, end in zip(stretches(), starts, starts[1:], strict=False):
        places = course(LONG).nose(np.array([begin, end - 1]) * course(LONG).time_step)
        tail = int(np.floor((places[0] - LONG.train.length) / length))
        head = int(np.floor(places[1] / length))
        reach = range(tail - activity.AWAKE_BESIDE, head + activity.AWAKE_BESIDE + 1)
        for span in {*reach, n_spans // 2} & set(range(n_spans)):
            assert stretch.awake[reduced_guideway().span_coordinates[span]].all()
        assert stretch.stepped[stretch.awake].all()
        assert stretch.stepped[reduced_guideway().n_modes :].all()  # pier tops pass motion on


def test_most_of_a_long_guideway_is_not_stepped():
    share = np.mean([stretch.stepped.mean() for stretch in stretches()])
    assert share < 0.8
    # Each stretch steps as much as the next, whatever the spans beyond: nothing but ends differ.
    counts = [stretch.awake.sum() for stretch in stretches()[4:-6]]
    assert max(counts) - min(counts) < 0.2 * np.mean(counts)


def test_the_guideway_rests_until_the_nose_reaches_it():
    first = stretches()[0].first_step
    assert (
        course(LONG).nose(first * course(LONG).time_step)
        >= 0
        > course(LONG).nose((first - 1) * course(LONG).time_step)
    )


def test_tops_that_modes_follow_have_their_mass():
    """With no mode stepped the tops carry the whole guideway, as in the finite elements."""
    reduced = reduced_guideway()
    stepped = np.arange(reduced.n_coordinates) >= reduced.n_modes
    tops, factor = activity.stepped_mass(reduced, stepped, 0.0)
    carried = reduced.carried.toarray()
    expected = reduced.top_mass + carried.T @ carried
    at = tops - reduced.n_modes
    assert_allclose(factor @ factor.T, expected[np.ix_(at, at)], atol=1e-9 * expected.max())
    # A shift sideways moves all mass above the piers, and of the piers less than all.
    sideways = np.zeros(expected.shape[0])
    sideways[1::6] = 1.0
    model = guideway.build(LONG.guideway)
    everything = (model.component == 1).astype(float)
    above = everything.copy()
    above[np.concatenate(model.pier_dof)] = 0.0
    mass = sideways @ expected @ sideways
    assert above @ model.mass @ above < mass < everything @ model.mass @ everything


def stepped_periods(step):
    """Circular frequencies [rad/s] of the guideway as the kernel steps it, and of its modes."""
    config = Config.model_validate(
        {"train": {"n_cars": 1}, "guideway": {"n_spans": 3}, "passage": {"time_step": f"{step} s"}}
    )
    config = config.model_copy(
        update={"passage": config.passage.model_copy(update={"speed": 0.258 / 4 / step})}
    )
    assert_allclose(course(config).time_step, step, rtol=1e-9)
    passage = config.passage
    reduced = reduction.reduce(
        guideway.build(config.guideway), passage.mode_cutoff, passage.mode_cutoff_elsewhere
    )
    spans, n = packing.spans(reduced, config), reduced.n_coordinates
    operator = np.zeros((n, n))
    for first in range(0, n, LANES):
        motion = _kernels.at_rest(n)
        columns = np.arange(first, min(first + LANES, n))
        motion.position[columns, columns - first] = 1.0
        _kernels._answer(spans, 0, np.zeros_like(motion.force), motion)
        operator[:, columns] = -motion.force[:, : columns.size]
    squares = np.sort(np.linalg.eigvals(operator).real)
    found = 2 / step * np.arcsin(step / 2 * np.sqrt(squares))
    exact = scipy.linalg.eigvalsh(reduced.stiffness.toarray(), reduced.mass.toarray())
    return found, np.sqrt(exact)


def test_what_is_stepped_keeps_the_periods_of_the_guideway():
    """Of second order in the step: all modes in the band within 0.15 % at 0.54 ms."""
    errors = []
    for step in (0.27e-3, 0.54e-3):
        found, exact = stepped_periods(step)
        band = exact < 2 * np.pi * 100.0
        assert band.sum() > 30
        errors.append(np.abs(found / exact - 1)[band].max())
    assert errors[1] < 1.5e-3
    assert errors[0] < 0.3 * errors[1]


def test_swings_of_pier_tops_keep_their_period_to_fourth_order():
    """A plain step would be off by (ωΔt)²/24."""
    reduced, step = reduced_guideway(), 0.54e-3
    everything = np.ones(reduced.n_coordinates, dtype=bool)
    tops, factor = activity.stepped_mass(reduced, everything, step)
    at = np.ix_(tops - reduced.n_modes, tops - reduced.n_modes)
    stiffness = activity.top_stiffness(reduced).toarray()[at]
    exact = np.sqrt(scipy.linalg.eigvalsh(stiffness, reduced.top_mass[at]))
    stepped = np.sqrt(scipy.linalg.eigvalsh(stiffness, factor @ factor.T))
    phase = exact * step
    followed = phase < 1.5
    assert followed.sum() > 10
    assert phase[followed].max() > 0.3
    found = 2 / step * np.arcsin(step / 2 * stepped[followed])
    assert np.all(np.abs(found / exact[followed] - 1) < phase[followed] ** 4 / 300 + 1e-9)


def test_with_all_modes_kept_quiet_spans_change_no_bit():
    kept = passed(QUIET_CUTOFF=1e9)
    assert_array_equal(kept, passed(AWAKE_BESIDE=LONG.guideway.n_spans))


def test_coordinates_that_fall_quiet_are_left_at_rest():
    stretches = integrate.prepare(LONG, track(LONG)).spans.stretches
    n = reduced_guideway().n_coordinates
    ends = np.flatnonzero(np.diff(stretches.stilled_start))
    assert ends.size > 3
    for stretch in ends:
        arrays = Motion(*(np.ones((n, LANES)) for _ in range(5)))
        _kernels._still(stretches, stretch, np.ones((n, LANES)), arrays)
        stilled = stretches.stilled[
            stretches.stilled_start[stretch] : stretches.stilled_start[stretch + 1]
        ]
        assert np.all(stilled < reduced_guideway().n_modes)
        for array in arrays:
            assert not array[stilled].any()
            assert array.sum() == (n - stilled.size) * LANES


def test_poles_meet_the_joints_half_way_between_steps():
    for speed in ("430 km/h", "217 km/h"):
        config = Config.model_validate({"passage": {"speed": speed}})
        advance = config.passage.speed * course(config).time_step
        assert -config.passage.approach - advance < course(config).start <= -config.passage.approach
        system = integrate.prepare(config, track(config))
        for ground in system.grounds:
            joint = np.abs(ground.x % 3.096)
            assert_allclose(np.minimum(joint, 3.096 - joint).min(), advance / 2, rtol=1e-6)


def test_the_train_rests_until_it_meets_the_track():
    """Leaving out the steps before changes nothing but what rounding does to a train at rest."""
    config = Config.model_validate(
        {
            "train": {"n_cars": 1},
            "guideway": {"n_spans": 1},
            "irregularity": {"fade_in": "10 m"},
            "passage": {"approach": "40 m"},
        }
    )
    gains = np.array([config.gains.as_row])
    found = integrate.integrate(integrate.prepare(config, track(config)), gains, record_every=7)
    from_the_start = replace(course(config), first_step=1)
    with mock.patch.object(packing, "course", lambda _: from_the_start):
        whole = integrate.integrate(integrate.prepare(config, track(config)), gains, record_every=7)
    first = course(config).first_step
    assert course(config).nose((first + 1) * course(config).time_step) > -10.0
    assert course(config).nose((first - 1) * course(config).time_step) <= -10.0
    for name in ("girder", "body_z", "body_y", "gap_min", "gap_max", "current_max"):
        assert_allclose(getattr(found, name), getattr(whole, name), rtol=1e-9, err_msg=name)
    assert_allclose(found.gap_history, whole.gap_history, rtol=0, atol=1e-12)
    assert_allclose(found.current_history, whole.current_history, rtol=0, atol=1e-9)
    assert_array_equal(found.time, whole.time)


def test_an_even_number_of_steps_goes_into_the_pole_passing_where_kinds_stand_half_a_pitch_apart():
    period = 0.258 / (430 / 3.6)
    odd = Config.model_validate({"passage": {"time_step": f"{period / 5 * 1.001} s"}})
    assert_allclose(period / course(odd).time_step, 6, rtol=1e-9)
