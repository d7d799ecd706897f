"""Passages of the reference solver, stored for comparison with the production solver.

Run as ``python tests/reference/make_passages.py [speed_kmh track]``: without arguments all four
passages (some hours on one core), with arguments one of them, such as ``430 smooth``.  Each takes
three sets of gains; the passage at 430 km/h over irregular track is that of the default train and
guideway, the others are of two cars over three spans.  Newmark's rule lengthens a period by about
(ωΔt)²/12: 0.05 % at 100 Hz, the upper end of the band, with a step of 0.12 ms.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from maglev.mechanics import irregularity, reference
from maglev.mechanics.course import track_range
from maglev.parameters import Config

HERE = Path(__file__).parent
GAIN_FACTORS = np.array([[1.0, 1.0, 1.0, 1.0], [0.85, 1.2, 0.9, 1.1], [1.2, 0.85, 1.1, 0.9]])
"""Gains of the three samples as shares of the means [-]."""

PASSAGES = {
    (430, "irregular"): (5, 5, 0.12e-3),
    (430, "smooth"): (2, 3, 0.12e-3),
    (200, "irregular"): (2, 3, 0.12e-3),
    (200, "smooth"): (2, 3, 0.12e-3),
}
"""Speed [km/h] and track of each stored passage: its cars, its spans, its largest step [s]."""


def configuration(speed_kmh: int, track: str) -> Config:
    """The configuration of a stored passage, with the default time step."""
    n_cars, n_spans, _ = PASSAGES[speed_kmh, track]
    return Config.model_validate(
        {
            "train": {"n_cars": n_cars},
            "guideway": {"n_spans": n_spans},
            "passage": {"speed": f"{speed_kmh} km/h"},
            "irregularity": {"enabled": track == "irregular"},
        }
    )


def path(speed_kmh: int, track: str) -> Path:
    """File of one stored passage."""
    return HERE / f"passage_{speed_kmh}_{track}.json"


def store(speed_kmh: int, track: str) -> None:
    """Compute and store one passage."""
    config = configuration(speed_kmh, track)
    n_cars, n_spans, step = PASSAGES[speed_kmh, track]
    fine = config.model_copy(
        update={"passage": config.passage.model_copy(update={"time_step": step})}
    )
    gains = np.array(config.gains.as_row) * GAIN_FACTORS
    profile = irregularity.profile(config.irregularity, track_range(config), config.seed)
    passages, energy = reference.integrate(fine, profile, gains, progress=True)
    work = energy.work_on_train + energy.work_on_guideway
    record = {
        "made_by": "tests/reference/make_passages.py",
        "speed_kmh": speed_kmh,
        "track": track,
        "n_cars": n_cars,
        "n_spans": n_spans,
        "time_step": step,
        "gains": gains.tolist(),
        "girder": passages.girder.tolist(),
        "car_body_z": passages.body_z.tolist(),
        "car_body_y": passages.body_y.tolist(),
        "gap_min": passages.gap_min.tolist(),
        "gap_max": passages.gap_max.tolist(),
        "current_max": passages.current_max.tolist(),
        "status": passages.status.tolist(),
        "energy_work": np.abs(work).max(axis=0).tolist(),
        "energy_residual": np.abs(work - energy.dissipated - energy.stored).max(axis=0).tolist(),
    }
    path(speed_kmh, track).write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    chosen = [(int(sys.argv[1]), sys.argv[2])] if len(sys.argv) == 3 else list(PASSAGES)
    for speed, track in chosen:
        store(speed, track)
