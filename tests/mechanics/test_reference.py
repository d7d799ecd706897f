"""The reference solver: against the production solver, its order, and where its energy goes."""

from functools import lru_cache
from unittest import mock

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maglev.mechanics import course, integrate, irregularity, reference
from maglev.mechanics.course import n_steps, time_step, track_range
from maglev.parameters import Config

MEAN = np.array(Config().gains.as_row)
GAINS = MEAN * [[1.0, 1.0, 1.0, 1.0], [1.2, 0.85, 1.1, 0.9], [0.4, 1.0, 1.0, 1.0]]
"""Mean, other, and k_p below i₀/δ₀ = 2500 A/m: the last cannot levitate."""

PERIOD = 0.258 / (430 / 3.6)
"""Of pole passing [s]."""


def small(parts, c_frame_spacing=1.548, heavier=1.0, cutoff=2000.0, approach=5.16):
    """A short car on a span of its length; poles enter half-way between steps.

    ``parts`` is the number of steps in the pole-passing period, odd; a guideway ``heavier`` times
    swings as many times slower, squared.
    """
    girder, rail, pier = Config().guideway.girder, Config().guideway.rail, Config().guideway.pier
    length = 8 * c_frame_spacing
    n_poles = round(c_frame_spacing / 0.258)
    return Config.model_validate(
        {
            "train": {
                "n_cars": 1,
                "car_pitch": f"{length} m",
                "bogie": {"c_frame_spacing": f"{c_frame_spacing} m"},
                "suspension_magnet": {"n_poles": n_poles, "pole_pitch": "0.258 m"},
                "guidance_magnet": {
                    "n_poles": 2,
                    "pole_pitch": f"{c_frame_spacing / 2} m",
                    "preload": "10 kN",
                },
            },
            "guideway": {
                "n_spans": 1,
                "span_length": f"{length} m",
                "girder": heavy(girder, heavier),
                "rail": {
                    "section": heavy(rail.section, heavier),
                    "connector_mass": f"{rail.connector_mass * heavier} kg/m",
                    "units_per_span": round(length / 3.096),
                },
                "pier": {"density": f"{pier.density * heavier} kg/m^3"},
            },
            "irregularity": {"fade_in": f"{approach} m"},
            "passage": {
                "approach": f"{approach} m",
                "time_step": f"{PERIOD / parts * 1.0001} s",
                "mode_cutoff": f"{cutoff} Hz",
                "mode_cutoff_elsewhere": f"{cutoff} Hz",
            },
        }
    )


def heavy(section, factor):
    """A section of the same stiffness with more mass."""
    return section.quantities() | {
        "density": f"{section.density * factor} kg/m^3",
        "polar_inertia": f"{section.polar_inertia * factor} kg m",
    }


def profile_of(config):
    return irregularity.profile(config.irregularity, track_range(config), config.seed)


@lru_cache
def reference_passages(config, n_samples, every):
    return reference.integrate(config, profile_of(config), GAINS[:n_samples], record_every=every)


@lru_cache
def both():
    """Passages of both solvers at the same times.

    The production solver keeps modes to 2000 Hz and takes three times finer steps.
    """
    found, _ = reference_passages(small(13), 3, 1)
    fine = small(39)
    production = integrate.integrate(
        integrate.prepare(fine, profile_of(fine)), GAINS, record_every=3
    )
    return found, production


@pytest.mark.parametrize("name", ["girder", "body_z", "body_y", "gap_min", "gap_max"])
def test_extremes_are_those_of_the_production_solver(name):
    found, production = both()
    assert_allclose(getattr(production, name)[:2], getattr(found, name)[:2], rtol=5e-3)


def test_the_largest_current_of_any_pole_is_that_of_the_production_solver():
    """Within 2 %: a pole that meets a joint of the rails feels modes beyond 2000 Hz."""
    found, production = both()
    assert_allclose(production.current_max[:2], found.current_max[:2], rtol=2e-2)


@pytest.mark.parametrize(
    ("name", "peak"),
    [
        ("girder_history", 2e-2),
        ("body_z_history", 1e-2),
        ("body_y_history", 5e-3),
        ("gap_history", 1e-2),
        ("current_history", 3e-2),
    ],
)
def test_histories_are_those_of_the_production_solver(name, peak):
    """Within 0.5 % of their largest departure from rest in the mean square.

    Girder displacements also at every instant; accelerations, gaps and currents have peaks
    where rails meet.
    """
    found, production = both()
    one, other = getattr(found, name)[:2], getattr(production, name)[:2]
    n = min(one.shape[-1], other.shape[-1])
    one, other = one[..., :n], other[..., :n]
    assert_allclose(found.time[:n], production.time[:n], rtol=1e-9)
    rest = {"gap_history": 0.010, "current_history": 25.0}.get(name, 0.0)
    largest = np.abs(one - rest).max(axis=-1, keepdims=True)
    if rest:
        largest = largest.max(axis=1, keepdims=True)
    error = np.abs(one - other) / largest
    assert np.sqrt((error**2).mean(axis=-1)).max() < 5e-3
    assert error.max() < peak
    if name == "girder_history":
        assert error[:, :2].max() < 5e-3


def test_levitation_is_lost_as_in_the_production_solver():
    found, production = both()
    assert_array_equal(found.status, production.status)
    assert found.status[2] in (1, 2)
    half = found.gap_history.shape[1] // 2
    assert found.lost_magnet[2] // half == production.lost_magnet[2] // half == 0  # suspension
    assert_allclose(found.lost_time[2], production.lost_time[2], rtol=1e-2)
    for name in ("girder", "girder_time", "body_z", "body_y"):
        assert np.isnan(getattr(found, name)[2]).all()
        assert np.isfinite(getattr(found, name)[:2]).all()
    assert_array_equal(found.lost_magnet[:2], -1)


def test_the_work_of_the_magnets_is_dissipated_or_stored():
    energy = reference_passages(small(9, cutoff=850.0), 1, 0)[1]
    work = (energy.work_on_train + energy.work_on_guideway)[:, 0]
    dissipated, stored = energy.dissipated[:, 0], energy.stored[:, 0]
    assert np.abs(work - dissipated - stored).max() < 1e-2 * np.abs(work).max()
    assert dissipated[-1] > 0.05 * np.abs(work).max()
    assert stored.max() > 0.05 * np.abs(work).max()


@lru_cache
def orders():
    """Slopes of log error on log step, every pole entering and leaving half-way between steps.

    The guideway is a million times heavier, its modes a thousand times slower, so that steps
    follow all that matter; those of a real rail reach many kHz.  Runs of all steps start at one
    place.
    """
    with mock.patch.object(course, "JOINT_SHARE", 0.0):
        return _orders()


def _orders():
    parts, finest = np.array([5, 7, 9]), 27

    def histories(n):
        found = reference_passages(small(int(n), 0.774, 1e6, 1.0, 2.58), 1, int(n))[0]
        return {
            "car body acceleration": found.body_z_history[0, 0],
            "gap": found.gap_history[0, 0],
            "girder displacement": found.girder_history[0, 0],
        }

    fine = histories(finest)
    errors = {name: [] for name in fine}
    for n in parts:
        for name, history in histories(n).items():
            m = min(history.size, fine[name].size)
            errors[name].append(np.sqrt(((history[:m] - fine[name][:m]) ** 2).mean()))
    slopes = {
        name: np.polyfit(np.log(1 / parts), np.log(error), 1)[0] for name, error in errors.items()
    }
    return slopes


@pytest.mark.parametrize("quantity", ["car body acceleration", "gap", "girder displacement"])
def test_the_error_falls_with_the_square_of_the_step(quantity):
    slope = orders()[quantity]
    assert 1.7 < slope < 2.5, slope


def test_steps_fit_the_pole_passing():
    for upper in (0.1e-3, 0.25e-3, 1e-3):
        config = Config.model_validate({"passage": {"time_step": f"{upper} s"}})
        parts = PERIOD / time_step(config)
        assert_allclose(parts, round(parts), rtol=1e-9)
        assert round(parts) % 2 == 0  # suspension and guidance poles stand half a pitch apart
        assert upper * (1 - 2 / parts) < time_step(config) <= upper * (1 + 1e-9)
    way = 150 + 2 * 5 * 24.768
    assert n_steps(Config()) * time_step(Config()) >= way / (430 / 3.6) - 1e-9
