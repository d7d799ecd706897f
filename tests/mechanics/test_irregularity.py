"""Track irregularity: on its spectrum, repeatable, smooth, and absent where it should be."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy import integrate, signal

from maglev.mechanics.irregularity import (
    PROFILE_NAMES,
    Measured,
    Profile,
    displacement,
    profile,
    spectral_density,
    wavenumbers,
)
from maglev.parameters import GermanLaw, Irregularity, PowerLaw, RationalLaw

RATIONAL = RationalLaw(law="rational", numerator=(2e-8, 1e-8), denominator=(0.01, 0.0, 1.0, 2.0))
LAWS = {"power": PowerLaw(), "rational": RATIONAL, "german": GermanLaw(law="german")}
TRACK = profile(Irregularity(), (-200.0, 800.0), seed=11)


def constant(value=1.0):
    """A measured track that lies ``value`` metres beside its place everywhere."""
    x = np.linspace(-100.0, 100.0, 41)
    return Measured("test track", x, np.full((4, x.size), value))


def grid(track):
    return track.x0 + track.dx * np.arange(track.values.shape[1])


@pytest.mark.parametrize("law", LAWS)
def test_root_mean_square_is_the_integral_of_the_spectrum(law):
    spectrum = LAWS[law]
    irregularity = Irregularity(vertical=spectrum, lateral=spectrum)
    variance, _ = integrate.quad(lambda n: spectral_density(spectrum, n), 0.01, 1.0, limit=200)
    # Over a stretch of one over the spacing of the wavenumbers the cosines are nearly orthogonal.
    _, spacing = wavenumbers(irregularity)
    track = profile(irregularity, (0.0, 1 / spacing), seed=5)
    full = track.values[::2, grid(track) <= 1 / spacing]
    assert_allclose(np.sqrt(np.mean(full**2, axis=1)), np.sqrt(variance), rtol=0.02)


def test_variance_of_the_default_power_laws_is_the_closed_form():
    for spectrum in (Irregularity().vertical, Irregularity().lateral):
        n, spacing = wavenumbers(Irregularity())
        e = spectrum.exponent - 1
        closed = spectrum.coefficient / e * (100.0**e - 1.0)  # from 1/100 to 1 per metre
        assert_allclose(np.sum(spectral_density(spectrum, n)) * spacing, closed, rtol=1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_welch_spectrum_lies_on_the_target(law):
    irregularity = Irregularity(vertical=LAWS[law], lateral=LAWS[law])
    density = []
    for seed in range(2):
        track = profile(irregularity, (0.0, 1000.0), seed=seed)
        step = 6  # 0.094 m: ten samples in the shortest wave
        n, found = signal.welch(
            track.values[::2, ::step], fs=1 / (step * track.dx), nperseg=2048, window="hann"
        )
        density.append(found)
    mean = np.mean(density, axis=(0, 1))
    edges = np.geomspace(0.03, 0.9, 8)  # 1/m, away from the band's ends and the segment's length
    for low, high in pairwise(edges):
        band = (n >= low) & (n < high)
        target = spectral_density(LAWS[law], n[band])
        assert_allclose(np.mean(mean[band] / target), 1, atol=0.15)
    beyond = n > 1.05
    assert mean[beyond].max() < 1e-3 * spectral_density(LAWS[law], 1.0)


def test_same_seed_gives_the_same_profile_whatever_its_length():
    for start, end in ((-3.3, 40.2), (0.0, 700.0), (123.4, 124.0)):
        part = profile(Irregularity(), (start, end), seed=11)
        first = round((part.x0 - TRACK.x0) / TRACK.dx)
        here = slice(first, first + part.values.shape[1])
        assert part.x0 <= start and part.x0 + (part.values.shape[1] - 1) * part.dx >= end
        assert_array_equal(part.values, TRACK.values[:, here])
        assert_array_equal(part.slopes, TRACK.slopes[:, here])


def test_another_seed_gives_another_profile():
    other = profile(Irregularity(), (-200.0, 800.0), seed=12)
    assert abs(np.corrcoef(other.values[0], TRACK.values[0])[0, 1]) < 0.3


def test_sides_share_one_profile_unless_told_otherwise():
    assert_array_equal(TRACK.values[0], TRACK.values[1])
    assert_array_equal(TRACK.values[2], TRACK.values[3])
    assert abs(np.corrcoef(TRACK.values[0], TRACK.values[2])[0, 1]) < 0.3
    apart = profile(Irregularity(sides="independent"), (-200.0, 800.0), seed=11)
    assert_array_equal(apart.values[::2], TRACK.values[::2])  # the right rail stays as it was
    correlation = np.corrcoef(apart.values)
    assert np.abs(correlation - np.eye(4)).max() < 0.3


def test_interpolation_is_exact_to_a_ten_millionth():
    # With half the points the error is sixteen times as large, and its largest lies midway.
    half = Profile(TRACK.x0, 2 * TRACK.dx, TRACK.values[:, ::2], TRACK.slopes[:, ::2])
    inner = slice(1, half.values.shape[1] * 2 - 2, 2)
    value, slope = displacement(half, grid(TRACK)[inner])
    full = np.abs(TRACK.values).max(axis=1, keepdims=True)
    assert np.abs((value - TRACK.values[:, inner]) / full).max() < 16e-7
    assert_allclose(slope, TRACK.slopes[:, inner], atol=1e-4 * np.abs(TRACK.slopes).max())


def test_interpolation_of_the_shortest_wave_follows_a_cosine():
    # One harmonic: value and slope lie on the circle of its amplitude.
    short = Irregularity(wavelength_min="1 m", wavelength_max="1.0001 m", n_harmonics=1)
    (n,), spacing = wavenumbers(short)
    track = profile(short, (0.0, 20.0), seed=1)
    value, slope = displacement(track, np.random.default_rng(0).uniform(0.0, 20.0, 500))
    amplitude = np.sqrt(2 * 2.3e-8 * n**-1.5 * spacing)
    assert_allclose(np.hypot(value[0], slope[0] / (2 * np.pi * n)), amplitude, rtol=1e-5)
    assert np.abs(value[0]).max() > 0.99 * amplitude
    assert np.abs(slope[0]).max() > 0.99 * amplitude * 2 * np.pi * n


def test_slopes_are_the_derivative_of_the_values():
    central = (TRACK.values[:, 2:] - TRACK.values[:, :-2]) / (2 * TRACK.dx)
    scale = np.abs(TRACK.slopes).max()
    assert_allclose(central, TRACK.slopes[:, 1:-1], atol=1e-3 * scale)


def test_irregularity_fades_in_over_fifty_metres_with_continuous_curvature():
    track = profile(Irregularity(), (-90.0, 90.0), seed=0, measured=constant())
    x = grid(track)
    assert np.all(track.values[:, x <= -50] == 0) and np.all(track.slopes[:, x <= -50] == 0)
    assert_allclose(track.values[:, x >= 0], 1, rtol=1e-12)
    assert_allclose(track.slopes[:, x >= 0], 0, atol=1e-15)
    ramp = (x > -50) & (x < 0)
    assert np.all(np.diff(track.values[0, ramp]) > 0)
    assert_allclose(displacement(track, -25.0)[0], 0.5, rtol=1e-9)
    curvature = np.gradient(track.slopes[0], track.dx)
    largest = 10 / np.sqrt(3) / 50**2  # 1/m, of the quintic ramp
    assert_allclose(np.abs(curvature).max(), largest, rtol=1e-3)
    third = 60 / 50**3  # 1/m^2: the curvature's largest slope, so that it has no jump
    assert np.abs(np.diff(curvature)).max() < 1.001 * third * track.dx


def test_random_irregularity_is_untouched_on_the_guideway_and_absent_before_the_fade_in():
    x = grid(TRACK)
    assert np.all(TRACK.values[:, x <= -50] == 0)
    later = profile(Irregularity(fade_in="10 m"), (-200.0, 100.0), seed=11)
    x_later = grid(later)
    assert_array_equal(
        later.values[:, x_later >= 0], TRACK.values[:, (x >= 0) & (x <= x_later[-1])]
    )
    assert not later.values[:, x_later < -10].any()
    assert np.abs(TRACK.values[:, (x > -40) & (x < -10)]).max() > 0


def test_a_smooth_track_is_zero():
    track = profile(Irregularity(enabled=False), (-10.0, 30.0), seed=4)
    assert track.values.shape == track.slopes.shape == (len(PROFILE_NAMES), grid(track).size)
    assert not track.values.any() and not track.slopes.any()


def test_rational_law_holds_the_power_law():
    n = np.geomspace(0.01, 1, 7)
    rational = RationalLaw(law="rational", numerator=(3e-8,), denominator=(0.0, 0.0, 1.0))
    power = PowerLaw(coefficient=3e-8, exponent=2)
    assert_allclose(spectral_density(rational, n), spectral_density(power, n), rtol=1e-12)


def test_german_law_has_its_closed_variance():
    # Integral of A c^2 / ((W^2 + r^2)(W^2 + c^2)) over all W > 0: A c pi / (2 r (c + r)).
    A, c, r = 4.032e-7, 0.8246, 0.0206
    variance, _ = integrate.quad(
        lambda n: spectral_density(LAWS["german"], n), 0, np.inf, limit=500
    )
    assert_allclose(variance, A * c * np.pi / (2 * r * (c + r)), rtol=1e-6)


def test_a_negative_spectrum_is_refused():
    law = RationalLaw(law="rational", numerator=(1e-8, -3e-8), denominator=(1.0,))
    with pytest.raises(ValueError, match="must be finite and not negative, got -"):
        profile(Irregularity(vertical=law), (0.0, 10.0), seed=0)
    pole = RationalLaw(law="rational", numerator=(1e-8,), denominator=(0.0,))
    with pytest.raises(ValueError, match="must be finite and not negative, got inf"):
        profile(Irregularity(lateral=pole), (0.0, 10.0), seed=0)


def test_a_measured_profile_is_kept_in_its_own_rows():
    x = np.linspace(-60.0, 60.0, 961)
    shapes = np.stack([np.cos(0.3 * (k + 1) * x) for k in range(4)])
    track = profile(Irregularity(), (-150.0, 60.0), seed=0, measured=Measured("track", x, shapes))
    places = np.random.default_rng(2).uniform(0.0, 60.0, 200)
    value, slope = displacement(track, places)
    rate = 0.3 * np.arange(1, 5)[:, None]
    assert_allclose(value, np.cos(rate * places), atol=1e-5)
    assert_allclose(slope, -rate * np.sin(rate * places), atol=1e-3)
    again = profile(Irregularity(), (-150.0, 60.0), seed=9, measured=Measured("track", x, shapes))
    assert_array_equal(again.values, track.values)


@pytest.mark.parametrize("length_range", [(-120.0, 100.5), (-20.0, 150.0)])
def test_a_measured_profile_shorter_than_the_run_is_refused(length_range):
    expected = rf"must cover the passage from .* to {length_range[1]:g} m, got -100 to 100 m"
    with pytest.raises(ValueError, match=expected):
        profile(Irregularity(), length_range, seed=0, measured=constant())
    late = Measured("late", np.linspace(-40.0, 200.0, 9), np.zeros((4, 9)))
    with pytest.raises(ValueError, match="late must cover the passage from -50 to"):
        profile(Irregularity(), (-120.0, 150.0), seed=0, measured=late)


def test_a_measured_profile_need_not_reach_before_the_fade_in():
    track = profile(Irregularity(), (-150.0, 100.0), seed=0, measured=constant())
    assert track.x0 == -150


def test_a_named_profile_file_that_was_not_read_is_refused():
    with pytest.raises(ValueError, match=r"profile_file is 'track.csv' but its profile was not"):
        profile(Irregularity(profile_file="track.csv"), (0.0, 10.0), seed=0)


@pytest.mark.parametrize("length_range", [(5.0, 5.0), (5.0, -5.0), (0.0, np.inf), (np.nan, 1.0)])
def test_an_empty_range_is_refused(length_range):
    with pytest.raises(ValueError, match="length_range must rise"):
        profile(Irregularity(), length_range, seed=0)


def test_places_outside_the_grid_are_refused():
    with pytest.raises(ValueError, match=r"range -200.021 to 800.022 m, got 0 to 800.1 m"):
        displacement(TRACK, [0.0, 800.1])
    assert_allclose(displacement(TRACK, grid(TRACK)[-1])[0], TRACK.values[:, -1], rtol=1e-9)
