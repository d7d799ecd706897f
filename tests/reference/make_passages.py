"""Passages of the reference solver, stored for comparison with the production solver.

Run as ``python tests/reference/make_passages.py [name]``: without arguments all passages, with the
name of one, such as ``430_smooth``, that one.  `430_irregular` is the default train and guideway at
full size with one set of gains, the others are of two cars over three spans with four, drawn as the
study draws them.  The passages are right to the tolerance that each file states.
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

COV, SEED, N_SETS = 0.10, 20, 4
"""Spread of the gains [-], seed of their drawing, how many sets."""


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
    gains
        One set, suspension k_p [A/m], k_d [A s/m], guidance k_p, k_d; drawn ones if empty.
    control
        Of both kinds of magnet, as `maglev.parameters.Circuit` takes it; the default if empty.
    """

    speed_kmh: int
    irregular: bool = True
    n_cars: int = 2
    n_spans: int = 3
    gains: tuple[float, ...] = ()
    control: tuple[tuple[str, str], ...] = ()


PASSAGES = {
    "430_irregular": Case(430, n_cars=5, n_spans=5, gains=(3217.0, 21.3, 4790.0, 12.9)),
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


def gains_of(case: Case, config: Config) -> npt.NDArray[np.float64]:
    """Gains (sample, 4): those of the case, or normal about the means."""
    if case.gains:
        return np.array([case.gains])
    normal = np.random.default_rng(SEED).standard_normal((N_SETS, 4))
    return np.array(config.gains.as_row) * (1 + COV * normal)


def path(name: str) -> Path:
    """File of one stored passage."""
    return HERE / f"passage_{name}.json"


def store(name: str) -> None:
    """Compute and store one passage."""
    config, case = configuration(name), PASSAGES[name]
    gains = gains_of(case, config)
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
