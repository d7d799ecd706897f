"""Passages of the reference solver, stored for comparison with the production solver.

Run as ``python tests/reference/make_passages.py [name]``: without arguments all passages, with the
name of one, such as ``430_smooth``, that one.  `430_irregular` is the default train and guideway at
full size with two sets of gains, the others are of two cars over three spans with four.  The gains
are drawn as the study draws them; the passages are right to the tolerance that each file states.
"""

from __future__ import annotations

import json
import logging
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from maglev.mechanics import irregularity, reference
from maglev.mechanics.course import track_range
from maglev.parameters import Config

HERE = Path(__file__).parent

COV, SEED = 0.10, 20
"""Spread of the gains [-], seed of their drawing."""


@dataclass(frozen=True)
class Case:
    """What a stored passage is of.

    Attributes
    ----------
    speed_kmh
        Speed [km/h].
    irregular
        Whether the track is.
    n_cars, n_spans
        Size of train and guideway [-].
    n_sets
        How many sets of gains.
    control
        Of both kinds of magnet, as `maglev.parameters.Circuit` takes it; the default if empty.
    """

    speed_kmh: int
    irregular: bool = True
    n_cars: int = 2
    n_spans: int = 3
    n_sets: int = 4
    control: tuple[tuple[str, str], ...] = ()


PASSAGES = {
    "430_irregular": Case(430, n_cars=5, n_spans=5, n_sets=2),
    "430_smooth": Case(430, irregular=False),
    "200_irregular": Case(200),
    "200_smooth": Case(200, irregular=False),
    "430_ends": Case(430, control=(("group", "ends"),)),
    "430_half": Case(430, control=(("group", "half"),)),
    "430_lumped": Case(430, control=(("group", "lumped"),)),
    "430_late": Case(430, control=(("lag", "2 ms"), ("delay", "1 ms"))),
}
"""The stored passages."""


def configuration(name: str) -> Config:
    """The configuration of a stored passage, with the default time step."""
    case = PASSAGES[name]
    control = {kind: dict(case.control) for kind in ("suspension", "guidance")}
    return Config.model_validate(
        {
            "train": {"n_cars": case.n_cars},
            "guideway": {"n_spans": case.n_spans},
            "passage": {"speed": f"{case.speed_kmh} km/h"},
            "irregularity": {"enabled": case.irregular},
        }
        | ({"control": control} if case.control else {})
    )


def drawn_gains(config: Config, n_sets: int) -> npt.NDArray[np.float64]:
    """Gains (sample, 4), normal about the means."""
    normal = np.random.default_rng(SEED).standard_normal((n_sets, 4))
    return np.array(config.gains.as_row) * (1 + COV * normal)


def path(name: str) -> Path:
    """File of one stored passage."""
    return HERE / f"passage_{name}.json"


def store(name: str) -> None:
    """Compute and store one passage."""
    config, case = configuration(name), PASSAGES[name]
    gains = drawn_gains(config, case.n_sets)
    profile = irregularity.profile(config.irregularity, track_range(config), config.seed)
    passages, effort = reference.solve(config, profile, gains, progress=True)
    record = {
        "made_by": "tests/reference/make_passages.py",
        "speed_kmh": case.speed_kmh,
        "irregular": case.irregular,
        "n_cars": case.n_cars,
        "n_spans": case.n_spans,
        "control": dict(case.control),
        "tolerance": reference.ERROR,
        "time_step": effort.step,
        "error": effort.error.tolist(),
        "gains": gains.tolist(),
        "girder": passages.girder.tolist(),
        "car_body_z": passages.body_z.tolist(),
        "car_body_y": passages.body_y.tolist(),
        "gap_min": passages.gap_min.tolist(),
        "gap_max": passages.gap_max.tolist(),
        "current_max": passages.current_max.tolist(),
        "status": passages.status.tolist(),
    }
    path(name).write_text(json.dumps(record, indent=1) + "\n")


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    for passage in sys.argv[1:] or PASSAGES:
        store(passage)
