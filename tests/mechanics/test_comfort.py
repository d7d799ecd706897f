"""Weightings against their published magnitudes, running filters against SciPy at full rate."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import signal

from maglev.compiled import kernel
from maglev.mechanics import _comfort, comfort, packing
from maglev.mechanics._kernels import at_rest
from maglev.mechanics.comfort import (
    ISO_LATERAL,
    ISO_VERTICAL,
    SPERLING_LATERAL,
    SPERLING_VERTICAL,
    WEIGHTINGS,
    sperling_index,
    sperling_weight,
)
from maglev.mechanics.course import course
from maglev.mechanics.lanes import LANES
from maglev.parameters import Config
from passages import system_of

ISO_TABLE = {
    # centre of the third of an octave [Hz]: W_k and W_d in thousandths, ISO 2631-1:1997 table 3
    0.5: (418, 853), 0.63: (459, 944), 0.8: (477, 992), 1.0: (482, 1011), 1.25: (484, 1008),
    1.6: (494, 968), 2.0: (531, 890), 2.5: (631, 776), 3.15: (804, 642), 4.0: (967, 512),
    5.0: (1039, 409), 6.3: (1054, 323), 8.0: (1036, 253), 10.0: (988, None), 12.5: (902, 161),
    16.0: (768, 125), 20.0: (636, 100), 25.0: (513, 80.0), 31.5: (405, 63.2), 40.0: (314, 49.4),
    50.0: (246, 38.8), 63.0: (186, 29.5), 80.0: (132, 21.1), 100.0: (88.7, 14.1),
}  # fmt: skip
"""Recalled.  W_d at 10 Hz stands there as 212, a misprint of 202: the neighbours are in line."""

SPERLING_BAND = np.geomspace(0.5, 40.0, 400)
"""Frequencies that the standard asks for [Hz]."""


@pytest.mark.parametrize(("column", "weighting"), [(0, ISO_VERTICAL), (1, ISO_LATERAL)])
def test_iso_weightings_are_those_of_the_published_table(column, weighting):
    given = {f: row[column] for f, row in ISO_TABLE.items() if row[column] is not None}
    assert_allclose(weighting.magnitude(list(given)), np.array([*given.values()]) / 1e3, rtol=9e-3)


@pytest.mark.parametrize(
    ("weighting", "lateral", "error"),
    [(SPERLING_VERTICAL, False, 1.6e-2), (SPERLING_LATERAL, True, 1.7e-2)],
)
def test_sperling_filters_follow_the_published_weights(weighting, lateral, error):
    off = weighting.magnitude(SPERLING_BAND) / sperling_weight(SPERLING_BAND, lateral=lateral) - 1
    assert 0.8 * error < np.abs(off).max() < error


@pytest.mark.parametrize("frequency", [0.5, 1.3, 5.0, 12.0, 30.0])
@pytest.mark.parametrize("lateral", [False, True])
def test_the_index_of_a_sine_is_that_of_the_standard(frequency, lateral):
    """W = 0.896 (A³ F(f)/f)^(1/10) with A in cm/s², F by its tabulated pieces."""
    pieces = [(5.4, 0.8 * frequency**2), (26.0, 650 / frequency**2), (np.inf, 1.0)]
    if not lateral:
        pieces = [(5.9, 0.325 * frequency**2), (20.0, 400 / frequency**2), (np.inf, 1.0)]
    factor = next(value for edge, value in pieces if frequency < edge)
    expected = 0.896 * (30.0**3 * factor / frequency) ** 0.1
    weighted = 0.30 * WEIGHTINGS[1 if lateral else 0].magnitude(frequency) / np.sqrt(2)
    assert_allclose(sperling_index(weighted), expected, rtol=6e-3)


def test_two_equal_sines_are_judged_a_little_harder_than_by_the_standard():
    cubes, squares = 2 * 0.2**3, (2 * 0.2**2 / 2) ** 0.5
    assert_allclose(sperling_index(squares) / (3.57 * cubes**0.1), 2**0.05)


@pytest.mark.parametrize("number", range(4))
def test_readings_every_1_6_ms_change_the_weighting_by_little(number):
    """Below 20 Hz by less than 0.7 %, the mean over a reading taken with it."""
    interval, f = 3 * 0.54e-3, np.geomspace(0.5, 20.0, 60)
    _, response = signal.sosfreqz(WEIGHTINGS[number].sections(interval), f, fs=1 / interval)
    mean = np.sinc(f * interval)
    off = np.abs(response) * mean / WEIGHTINGS[number].magnitude(f) - 1
    assert np.abs(off).max() < 7e-3
    assert np.abs(off[f < 10.0]).max() < 2e-3


CONFIG = Config.model_validate({"train": {"n_cars": 2}, "guideway": {"n_spans": 1}})
SYSTEM = system_of(CONFIG)
AMPLITUDE = {"body_z": 0.3, "body_pitch": 0.02, "body_y": 0.2, "body_yaw": -0.01}
"""Of the sines by which the cars' bodies move [m/s², rad/s²]."""


@kernel()
def read_step(comfort_record, vehicle, step, dt, train, weighing, outcome):
    _comfort.weigh(comfort_record, vehicle, step, dt, train, weighing, outcome)


@kernel()
def rest(comfort_record, n_cars):
    return _comfort.empty_weighing(comfort_record, n_cars)


def squares_of(frequency):
    """Squares that the kernel adds up while bodies swing with a frequency of their own a lane."""
    timing = packing.timing(CONFIG, 0)
    outcome = packing.empty_outcome(SYSTEM.train, (SYSTEM.suspension, SYSTEM.guidance), timing)
    weighing, train = rest(timing.comfort, 2), at_rest(SYSTEM.vehicle.inverse_mass.size)
    omega, dt = 2 * np.pi * frequency, timing.time_step
    for step in range(1, timing.n_steps + 1):
        half = (step - 0.5) * dt  # the velocity whose change is the acceleration of full steps
        swing = (np.cos(omega * 0.5 * dt) - np.cos(omega * half)) / (
            2 * np.sin(omega * 0.5 * dt) / dt
        )
        for name, amplitude in AMPLITUDE.items():
            train.velocity[getattr(SYSTEM.vehicle, name)] = amplitude * swing
        read_step(timing.comfort, SYSTEM.vehicle, step, dt, train, weighing, outcome)
    return outcome.squares.reshape(4, 2, 2, LANES)


def test_running_filters_are_those_of_scipy_at_full_rate():
    frequency = np.geomspace(0.7, 18.0, LANES)
    count = comfort.readings(CONFIG).count
    found = np.sqrt(squares_of(frequency).max(axis=2) / count[:, None])
    way = course(CONFIG)
    time = way.time_step * np.arange(1, way.n_steps + 1)
    sine = np.sin(2 * np.pi * frequency * time[:, None])
    arm = CONFIG.train.end_distance
    ends = [
        np.stack([(middle + sign * arm * turn) * sine for sign in (1, -1)], axis=1)
        for middle, turn in (
            (AMPLITUDE["body_z"], AMPLITUDE["body_pitch"]),
            (AMPLITUDE["body_y"], AMPLITUDE["body_yaw"]),
        )
    ]
    ends = [np.repeat(end[:, :, None], 2, axis=2) for end in ends]
    expected = np.moveaxis(comfort.weighted_rms(CONFIG, time, tuple(ends)), 0, 2)
    assert_allclose(found, expected, rtol=5e-3)


def test_a_lane_of_the_filters_does_not_know_its_neighbours():
    frequency = np.geomspace(0.7, 18.0, LANES)
    together, alone = squares_of(frequency), squares_of(np.full(LANES, frequency[5]))
    assert_array_equal(together[..., 5], alone[..., 5])
    assert np.ptp(alone, axis=-1).max() == 0


def test_a_car_is_judged_from_its_front_on_the_guideway_to_its_rear_off_it():
    pitch, speed = CONFIG.train.car_pitch, CONFIG.passage.speed
    for car in range(2):
        enters, leaves = comfort.window(CONFIG, car)
        nose = course(CONFIG).nose
        assert_allclose(nose(enters) - car * pitch, 0.0, atol=1e-9)
        assert_allclose(nose(leaves) - (car + 1) * pitch, CONFIG.guideway.length, atol=1e-9)
        assert_allclose(leaves - enters, (pitch + CONFIG.guideway.length) / speed)
    read = comfort.readings(CONFIG)
    dt = course(CONFIG).time_step
    assert np.all(read.first % read.every == 0)
    assert_allclose(read.count * read.every * dt, leaves - enters, atol=2 * read.every * dt)
