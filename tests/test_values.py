"""Numbers of the configuration that differ from sample to sample."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from maglev.errors import UserError
from maglev.simulation import cost_of, simulate
from test_simulation import MEAN, small

EXTREMES = (
    "girder_displacement_z",
    "girder_displacement_y",
    "girder_acceleration_z",
    "girder_acceleration_y",
    "car_body_acceleration_z",
    "car_body_acceleration_y",
    "suspension_gap_min",
    "guidance_gap_max",
    "suspension_current_max",
)


def with_number(config, key, number):
    """The configuration with a number in SI, written with its unit as a file has it."""
    _, unit = config.number_at(key)
    written = f"{number!r} {unit}" if unit else number
    return config.with_values({key: written})


def test_rows_keep_their_order_whatever_is_built_anew():
    config = small(n_spans=2)
    speeds = np.array([110.0, 90.0, 110.0])
    together = simulate(config, MEAN * [[1.0], [1.1], [0.9]], values={"passage.speed": speeds})
    for sample, speed in enumerate(speeds):
        alone = simulate(
            with_number(config, "passage.speed", float(speed)),
            MEAN[None] * [[1.0], [1.1], [0.9]][sample],
        )
        for name in EXTREMES:
            assert_array_equal(together[name][sample], alone[name][0])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"gains.suspension_proportional": [1.0]}, "columns of the gains"),
        ({"study.confidence": [0.9]}, "cannot differ"),
        ({"train.car_body.weight": [1.0]}, "there is no 'weight'"),
        ({"irregularity.enabled": [1.0]}, "must be a number"),
        ({"train.car_body.mass": [1.0, 2.0]}, "one for each sample"),
        ({"train.car_body.mass": [np.nan]}, "must be finite"),
        ({"train.car_body.mass": [-1.0]}, "train.car_body.mass: .*greater than 0"),
        ({"passage.gap_contact": [0.05]}, "gap_contact must be less"),
        ({"train.n_cars": [1.5]}, "train.n_cars"),
        ({"train.car_pitch": [20.0]}, "eight C-frame spacings"),
    ],
)
def test_a_value_that_will_not_do_is_refused_by_name(values, message):
    with pytest.raises(UserError, match=message):
        simulate(small(), MEAN[None], values=values)


def test_histories_need_one_course():
    with pytest.raises(UserError, match="same times"):
        simulate(
            small(), MEAN * np.ones((2, 1)), histories=True, values={"passage.speed": [90, 100]}
        )


def test_a_number_costs_what_its_kind_costs():
    keys = ["train.rod.mass", "control.guidance.lag", "passage.approach", "guideway.span_length"]
    assert list(cost_of(small(), keys).values()) == ["sample", "sample", "rebuild", "rebuild"]
