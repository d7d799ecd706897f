"""Numbers of the configuration that differ from sample to sample."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maglev.errors import UserError
from maglev.mechanics.control import failing_magnets
from maglev.parameters import Config, Parameters
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


def numbers_of(section, place):
    """Dotted keys of all numbers of a section that may differ."""
    for name, value in section:
        if isinstance(value, Parameters):
            yield from numbers_of(value, f"{place}.{name}")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            yield f"{place}.{name}"


def late():
    config = small(2, 2, irregularity={"lateral": {"law": "german"}})
    circuit = {"group": "ends", "lag": "1 ms"}
    control = {"suspension": {"lag": "1 ms", "delay": "0.4 ms"}, "guidance": circuit}
    return Config.model_validate(config.quantities() | {"control": control, "cases": {}})


FAILED = [f"control.{kind}.failed_magnets" for kind in ("suspension", "guidance")]
KEYS = [
    key
    for section in ("train", "irregularity", "control", "passage")
    for key in numbers_of(getattr(late(), section), section)
    if key not in FAILED and cost_of(late(), [key])[key] == "sample"
]
SPREAD = 0.25  # 2.5 deviations at a coefficient of variation of 0.1


def test_every_number_of_the_train_is_among_the_samples_own():
    assert len(KEYS) == 49
    assert {"train.rod.pivot_z", "control.guidance.lag", "passage.gap_lost"} < set(KEYS)
    assert {"irregularity.vertical.coefficient", "irregularity.lateral.roughness"} < set(KEYS)


def drawn(config, keys, n_samples, seed=0):
    """Values at both ends of each key, then at random ends of all at once."""
    sign = np.random.default_rng(seed).choice([-1.0, 1.0], size=(n_samples, len(keys)))
    values = {}
    for key, column in zip(keys, sign.T, strict=True):
        number, _ = config.number_at(key)
        values[key] = (number or 0.1) * (1 + SPREAD * column)
    return values


@pytest.mark.parametrize("key", KEYS)
def test_a_row_with_numbers_of_its_own_equals_a_system_built_anew(key):
    config = late()
    number = config.number_at(key)[0] or 0.1
    ends = np.array([1 - SPREAD, 1 + SPREAD]) * number
    together = simulate(config, MEAN * np.ones((2, 1)), values={key: ends})
    plain = simulate(config, MEAN[None])
    moved = 0.0
    for sample, end in enumerate(ends):
        alone = simulate(config.with_numbers({key: float(end)}), MEAN[None])
        for name in EXTREMES:
            assert_allclose(together[name][sample], alone[name][0], rtol=1e-10)
            moved = max(moved, abs(float(alone[name][0] / plain[name][0]) - 1))
    without_effect = ("passage.gap_contact", "passage.gap_lost", "current_max")
    assert moved > 1e-9 or key.endswith(without_effect)


def test_all_numbers_at_once_equal_a_system_built_anew():
    config = late()
    values = drawn(config, KEYS, 20)
    gains = MEAN * np.linspace(0.9, 1.1, 20)[:, None]
    together = simulate(config, gains, values=values)
    for sample in (0, 17):
        numbers = {key: float(column[sample]) for key, column in values.items()}
        alone = simulate(config.with_numbers(numbers), gains[sample : sample + 1])
        for name in EXTREMES:
            assert_allclose(together[name][sample], alone[name][0], rtol=1e-10)


def test_a_sample_of_its_own_does_not_know_its_neighbours():
    config = late()
    values = drawn(config, KEYS, 20)
    seeds = np.arange(20) % 3
    gains = MEAN * np.linspace(0.9, 1.1, 20)[:, None]
    together = simulate(config, gains, values=values, track_seeds=seeds, n_threads=2)
    few = [18, 3]
    alone = simulate(
        config,
        gains[few],
        values={key: column[few] for key, column in values.items()},
        track_seeds=seeds[few],
    )
    for name in EXTREMES:
        assert_array_equal(together[name][few], alone[name])


def test_failed_magnets_of_a_sample_are_those_of_a_system_built_anew():
    config = small(2, 2)
    failed = {FAILED[0]: np.array([0, 2, 0]), FAILED[1]: np.array([2, 0, 1])}
    gains = MEAN * np.ones((3, 1))
    together = simulate(config, gains, values=failed)
    for sample in range(3):
        numbers = {key: float(column[sample]) for key, column in failed.items()}
        alone = simulate(config.with_numbers(numbers), gains[:1])
        assert_array_equal(together["status"][sample], alone["status"][0])
        for name in EXTREMES:
            assert_allclose(together[name][sample], alone[name][0], rtol=1e-10)
    assert np.ptp(together["guidance_gap_max"].values) > 1e-3


def test_a_failed_magnet_has_no_current_and_its_gap_opens():
    config = small().with_numbers({FAILED[1]: 1.0})
    found = simulate(config, MEAN[None], histories=True)
    guidance = np.flatnonzero(found["magnet_kind"].values == 1)
    current, gap = (found[f"{name}_history"].values[0, guidance] for name in ("current", "gap"))
    side, x = (found[f"magnet_{name}"].values[guidance] for name in ("side", "x"))
    failed = failing_magnets(x, side)[0]
    assert side[failed] == 1
    assert np.all(current[failed] == 0.0)
    assert np.all(np.delete(current, failed, axis=0) > 1.0)
    assert gap[:, -1].argmax() == failed


def test_more_failed_magnets_than_there_are_are_refused():
    with pytest.raises(UserError, match="failed_magnets must be at most 14"):
        simulate(small(), MEAN[None], values={FAILED[0]: np.array([15.0])})


@pytest.mark.slow
def test_the_reference_solver_agrees_about_failed_magnets():
    config = small().with_numbers({FAILED[1]: 1.0})
    production, reference = (
        simulate(config, MEAN[None], solver=solver) for solver in ("production", "reference")
    )
    for name in EXTREMES:
        assert_allclose(production[name], reference[name], rtol=0.02)
