"""Poles with a length: the rail's mean under a face, its rate, and what faces do to a passage."""

from functools import lru_cache
from itertools import pairwise

import numpy as np
import pytest
import scipy.integrate
from numpy.testing import assert_allclose, assert_array_equal

from maglev.mechanics import integrate, irregularity
from maglev.mechanics.irregularity import displacement, mean_displacement
from maglev.mechanics.reduction import FaceWeights, face_weights, rail_nodes, rail_weights
from maglev.parameters import Config, Guideway, Irregularity
from maglev.simulation import track

GUIDEWAY = Guideway(n_spans=2)
SPACING = GUIDEWAY.span_length / (GUIDEWAY.rail.units_per_span * GUIDEWAY.rail.connectors_per_unit)
UNIT = GUIDEWAY.span_length / GUIDEWAY.rail.units_per_span
NODES = (
    np.arange(2 * GUIDEWAY.rail.units_per_span)[:, None] * UNIT
    + rail_nodes(GUIDEWAY.rail.connectors_per_unit) * SPACING
).ravel()
"""Places of the nodes of all units [m]; two at every joint."""

FACES = [0.17, 0.258, 0.516, 1.7]
"""Lengths [m]: a suspension pole's, a whole pitch, a guidance pole's, and over several pieces."""

KINDS = pytest.mark.parametrize("lateral", [False, True])
LENGTHS = pytest.mark.parametrize("length", FACES)


def mean_under(faces: FaceWeights, coefficients, values=None):
    """Sums of weights (or of what ``values`` is instead) times the coefficients, (place,)."""
    values = faces.weight if values is None else values
    count = np.diff(faces.start)
    place = np.repeat(np.arange(count.size), count)
    at = np.arange(count.sum()) - faces.start[:-1][place] + faces.first[place]
    return np.bincount(place, values * coefficients[at], minlength=count.size)


def some_motion():
    """Coefficients of rails that bend, with a step at every joint."""
    return np.random.default_rng(2).standard_normal(2 * NODES.size)


def motion_at(x, coefficients, lateral):
    """Displacement of the rails at places on the guideway."""
    span = np.clip(np.floor(x / GUIDEWAY.span_length), 0, GUIDEWAY.n_spans - 1).astype(int)
    first, weight, _ = rail_weights(GUIDEWAY, x - span * GUIDEWAY.span_length, lateral=lateral)
    first = first + span * NODES.size // GUIDEWAY.n_spans * 2
    return (weight * coefficients[first[:, None] + np.arange(4)]).sum(axis=1)


def everywhere(length, n=701):
    """Middles of faces from off the guideway's beginning to off its end, none just at a node."""
    return np.linspace(-length - 0.1, GUIDEWAY.length + length + 0.1, n) + 1e-4 * np.sqrt(2)


@LENGTHS
@KINDS
def test_faces_see_a_straight_rail_where_it_is_at_their_middle(length, lateral):
    x = np.linspace(0.5 * length, GUIDEWAY.length - 0.5 * length, 301)
    faces = face_weights(GUIDEWAY, x, length, lateral=lateral)
    ones, line = np.zeros((2, 2 * NODES.size))
    ones[::2] = 1.0
    line[::2], line[1::2] = NODES, SPACING
    assert_allclose(mean_under(faces, ones), 1.0, rtol=1e-12)
    assert_allclose(mean_under(faces, ones, faces.slope), 0.0, atol=1e-10)
    assert_allclose(mean_under(faces, line), x, rtol=1e-12)
    assert_allclose(mean_under(faces, line, faces.slope), 1.0, rtol=1e-10)


@LENGTHS
@KINDS
def test_the_mean_is_the_integral_of_the_motion_under_the_part_that_is_on_the_guideway(
    length, lateral
):
    motion = some_motion()
    x = everywhere(length, 151)
    found = mean_under(face_weights(GUIDEWAY, x, length, lateral=lateral), motion)
    gauss, share = np.polynomial.legendre.leggauss(4)
    expected = np.zeros_like(x)
    for k, middle in enumerate(x):
        near, far = np.clip([middle - 0.5 * length, middle + 0.5 * length], 0, GUIDEWAY.length)
        cuts = np.unique([near, *NODES[(NODES > near) & (NODES < far)], far])
        for low, high in pairwise(cuts):
            inside = 0.5 * (low + high) + 0.5 * (high - low) * gauss
            expected[k] += 0.5 * (high - low) * share @ motion_at(inside, motion, lateral)
    assert_allclose(found, expected / length, rtol=0, atol=1e-12 * np.abs(motion).max())


@LENGTHS
@KINDS
def test_the_slope_is_the_derivative_of_the_mean_also_while_joints_pass(length, lateral):
    motion, h = some_motion(), 1e-6
    x = everywhere(length)
    faces, ahead, behind = (
        face_weights(GUIDEWAY, x + way, length, lateral=lateral) for way in (0.0, h, -h)
    )
    found = mean_under(faces, motion, faces.slope)
    expected = (mean_under(ahead, motion) - mean_under(behind, motion)) / (2 * h)
    joint = np.abs((x - 0.5 * length) // UNIT - (x + 0.5 * length) // UNIT) > 0
    assert joint.sum() > 30  # some faces lie over a joint
    assert_allclose(found, expected, rtol=0, atol=1e-7 * np.abs(expected).max())


@LENGTHS
def test_the_slope_over_an_advance_adds_up_to_what_the_mean_changes_by(length):
    """Wherever in a step the edges meet the joints."""
    motion, advance = some_motion(), 0.0645
    x = -1.0 + advance * np.arange(round((GUIDEWAY.length + 2.0) / advance))
    averaged = face_weights(GUIDEWAY, x, length, lateral=False, advance=advance)
    half = face_weights(GUIDEWAY, np.append(x - 0.5 * advance, x[-1] + 0.5 * advance), length,
                        lateral=False)  # fmt: skip
    change = np.diff(mean_under(half, motion))
    found = mean_under(averaged, motion, averaged.slope) * advance
    assert_allclose(found, change, rtol=0, atol=1e-12 * np.abs(motion).max())
    weight = mean_under(face_weights(GUIDEWAY, x, length, lateral=False), motion)
    assert_allclose(mean_under(averaged, motion), weight, rtol=0, atol=1e-12)


@KINDS
def test_a_face_without_length_is_a_point(lateral):
    motion = some_motion()
    x = everywhere(0.1)
    on = (x > 0) & (x < GUIDEWAY.length)
    points = face_weights(GUIDEWAY, x, 0.0, lateral=lateral, advance=0.06)
    assert_allclose(mean_under(points, motion)[on], motion_at(x[on], motion, lateral), rtol=1e-12)
    h = 1e-6
    rise = [motion_at(x[on] + way, motion, lateral) for way in (-h, h)]
    slope = mean_under(points, motion, points.slope)[on]
    assert_allclose(slope, (rise[1] - rise[0]) / (2 * h), atol=1e-7 * np.abs(slope).max())
    short = face_weights(GUIDEWAY, x, 1e-6, lateral=lateral)
    assert_allclose(mean_under(short, motion)[on], mean_under(points, motion)[on], atol=1e-4)


@pytest.mark.parametrize("length", [0.0, *FACES])
def test_faces_off_the_guideway_see_nothing_of_it(length):
    x = everywhere(length)
    count = np.diff(face_weights(GUIDEWAY, x, length, lateral=False).start)
    off = (x + 0.5 * length < 0) | (x - 0.5 * length > GUIDEWAY.length)
    assert off.sum() > 2
    assert_array_equal(count > 0, ~off)
    assert np.all(count[~off] >= 4)


TRACK = irregularity.profile(Irregularity(), (-60.0, 60.0), seed=3)
PLACES = np.sort(np.random.default_rng(4).uniform(-58.0, 58.0, 60))


@LENGTHS
def test_the_mean_of_a_track_is_its_integral_over_the_face(length):
    found, _ = mean_displacement(TRACK, PLACES, length)
    for k, x in enumerate(PLACES):
        part = np.linspace(x - 0.5 * length, x + 0.5 * length, 2001)
        expected = scipy.integrate.simpson(displacement(TRACK, part)[0], x=part) / length
        assert_allclose(found[:, k], expected, rtol=0, atol=1e-9 * np.abs(TRACK.values).max())


@LENGTHS
def test_the_slope_of_a_tracks_mean_is_its_derivative(length):
    h = 1e-4
    _, slope = mean_displacement(TRACK, PLACES, length)
    (ahead, _), (behind, _) = (mean_displacement(TRACK, PLACES + way, length) for way in (h, -h))
    assert_allclose((ahead - behind) / (2 * h), slope, rtol=0, atol=1e-6 * np.abs(slope).max())


def test_the_mean_of_a_track_over_a_short_face_is_the_track():
    exact = displacement(TRACK, PLACES)
    for found, point in zip(mean_displacement(TRACK, PLACES, 0.0), exact, strict=True):
        assert_array_equal(found, point)
    errors = [
        np.abs(mean_displacement(TRACK, PLACES, length)[0] - exact[0]).max()
        for length in (0.04, 0.02)
    ]
    assert errors[1] < 1e-3 * np.abs(exact[0]).max()
    assert_allclose(errors[0] / errors[1], 4.0, rtol=0.02)


@lru_cache
def girder_acceleration(speed, pole_length=None, **passage):
    """Largest vertical acceleration of midspan under one car on one span, smooth track [m/s²]."""
    config = Config.model_validate(
        {
            "train": {"n_cars": 1},
            "guideway": {"n_spans": 1},
            "irregularity": {"enabled": False, "fade_in": "1 m"},
            "passage": {"speed": speed, "approach": "1 m"},
        }
    )
    if pole_length is not None:
        magnets = {
            name: getattr(config.train, name).model_copy(update={"pole_length": pole_length})
            for name in ("suspension_magnet", "guidance_magnet")
        }
        config = config.model_copy(update={"train": config.train.model_copy(update=magnets)})
    config = config.model_copy(update={"passage": config.passage.model_copy(update=passage)})
    found = integrate.integrate(
        integrate.prepare(config, track(config)), np.array([config.gains.as_row])
    )
    assert not found.status.any()
    return found.girder[0, 2]


def test_the_girder_comes_to_rest_with_the_train_as_points_would_not_let_it():
    """Points that step from unit to unit shake the girder however slow the train is."""
    assert girder_acceleration("10 km/h") < 0.1 * girder_acceleration("50 km/h")
    assert girder_acceleration("10 km/h", 0.0) > 0.3 * girder_acceleration("50 km/h", 0.0)


def test_the_raw_acceleration_has_a_limit_which_that_of_points_has_not():
    """Refined twofold in the step and in the modes of the span."""

    def change(pole_length):
        coarse, fine = (
            girder_acceleration(
                "430 km/h",
                pole_length,
                acceleration_band=None,
                time_step=step,
                mode_cutoff=cutoff,
                mode_cutoff_elsewhere=1000.0,
            )
            for step, cutoff in ((0.06e-3, 1000.0), (0.03e-3, 2000.0))
        )
        return abs(fine / coarse - 1)

    assert change(None) < 0.025
    assert change(0.0) > 0.2
