"""Small trains on small guideways, and their passages: what several tests start from."""

from functools import lru_cache

import numpy as np

from maglev.config import overlay
from maglev.mechanics import integrate
from maglev.parameters import Config
from maglev.simulation import track

MEAN = np.array(Config().gains.as_row)
TOO_SOFT = MEAN * [0.6, 1.0, 1.0, 1.0]
"""k_p below i₀/δ₀ = 2500 A/m: the magnet falls or sticks."""

HALF_SIZE = {
    "train": {
        "n_cars": 1,
        "car_pitch": "12.384 m",
        "bogie": {"c_frame_spacing": "1.548 m"},
        "suspension_magnet": {"n_poles": 6, "pole_pitch": "0.258 m"},
        "guidance_magnet": {"n_poles": 2, "pole_pitch": "0.774 m", "preload": "10 kN"},
    },
    "guideway": {"n_spans": 1, "span_length": "12.384 m", "rail": {"units_per_span": 4}},
    "irregularity": {"fade_in": "5 m"},
    "passage": {"approach": "5 m"},
}


def half_size(**sections):
    """One car half as long as a real one, as fast, on one span half as long; with other values."""
    return Config.model_validate(overlay(HALF_SIZE, sections))


@lru_cache
def system_of(config):
    return integrate.prepare(config, track(config))


def passed(config, gains=None, **options):
    """Passages of the production solver, at the configured gains if none are given."""
    gains = [config.gains.as_row] if gains is None else gains
    return integrate.integrate(system_of(config), np.array(gains, dtype=float), **options)
