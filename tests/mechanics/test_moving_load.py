"""The moving uniform load: known factors, and the same motion integrated in time."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from maglev.mechanics.moving_load import Beam, dynamic_factor, midspan_deflection

GIRDER = Beam(length=24.768, bending_stiffness=8.58e10, mass_per_length=6000.0, damping_ratio=0.02)
FIVE_CARS = 5 * 24.768


@pytest.mark.parametrize(
    ("speed_kmh", "factor"),
    [(300, 1.025), (350, 1.007), (400, 1.045), (430, 1.059), (500, 1.054), (600, 1.027)],
)
def test_five_cars_reach_the_known_dynamic_factors(speed_kmh, factor):
    # derived independently for the girder alone, 6000 kg/m, f = 9.68 Hz; given to three decimals
    assert_allclose(dynamic_factor(GIRDER, FIVE_CARS, speed_kmh / 3.6), factor, atol=1e-3)


@pytest.mark.parametrize("speed_kmh", [50, 100, 150, 200, 250])
def test_slow_trains_deflect_the_beam_as_if_at_rest(speed_kmh):
    assert 1.0 <= dynamic_factor(GIRDER, FIVE_CARS, speed_kmh / 3.6) < 1.0065


def test_first_frequency_is_that_of_a_simply_supported_euler_beam():
    heavy = Beam(length=24.768, bending_stiffness=8.58e10, mass_per_length=7e3, damping_ratio=0)
    assert_allclose(heavy.frequency(), 8.965, atol=5e-4)
    assert_allclose(heavy.frequency(3), 9 * heavy.frequency())


def test_closed_form_is_the_solution_of_the_modal_equations_of_motion():
    speed, load, n_modes = 119.4, 2.0e4, 3
    end = (FIVE_CARS + GIRDER.length) / speed + 0.2
    time = np.linspace(0.0, end, 2001)
    expected = np.zeros_like(time)
    for n in range(1, n_modes + 1):
        omega, wave = 2 * np.pi * GIRDER.frequency(n), n * np.pi / GIRDER.length
        modal_mass = GIRDER.mass_per_length * GIRDER.length / 2

        def rate(t, state, omega=omega, wave=wave, modal_mass=modal_mass):
            head = min(speed * t, GIRDER.length)
            tail = min(max(speed * t - FIVE_CARS, 0.0), GIRDER.length)
            force = load * (np.cos(wave * tail) - np.cos(wave * head)) / wave / modal_mass
            damping = 2 * GIRDER.damping_ratio * omega * state[1]
            return [state[1], force - damping - omega**2 * state[0]]

        solution = solve_ivp(
            rate, (0, end), [0, 0], t_eval=time, max_step=1e-3, rtol=1e-7, atol=1e-12
        )
        expected += solution.y[0] * np.sin(n * np.pi / 2)
    found = midspan_deflection(GIRDER, load, FIVE_CARS, speed, time, n_modes=n_modes)
    assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())


def test_nothing_moves_before_the_head_enters():
    assert np.all(midspan_deflection(GIRDER, 1e4, FIVE_CARS, 100.0, [-1.0, 0.0]) == 0)


def test_a_load_shorter_than_the_beam_has_no_static_reference():
    with pytest.raises(ValueError, match="must cover the beam"):
        dynamic_factor(GIRDER, 10.0, 100.0)
