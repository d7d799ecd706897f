"""Numbers of the configuration that differ from sample to sample."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maglev.errors import UserError
from maglev.mechanics.control import failing_magnets
from maglev.mechanics.varied import GUIDEWAY
from maglev.parameters import Config, Parameters
from maglev.simulation import cost_of, simulate
from maglev.vocabulary import STEP_TOO_LARGE
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
        for name in together.data_vars:
            assert_allclose(together[name][sample], alone[name][0], rtol=1e-9, err_msg=name)


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


def deviation(key):
    """A coefficient of variation for each number of the guideway [-]; assumed."""
    for part, share in (
        ("damping", 0.3),
        ("bearing", 0.15),
        ("modulus", 0.1),
        ("density", 0.04),
        ("width", 0.02),
    ):
        if part in key:
            return share
    return 0.05


OF_THE_GUIDEWAY = [f"guideway.{name}" for name in GUIDEWAY]
GIRDER_AND_CAR = EXTREMES[:6]


def apart(together, sample, alone):
    """Largest difference of the extremes as a share; that of the lateral acceleration counts half.

    That one hangs most on the damping between modes, which follows the mean's.
    """
    shares = [abs(float(together[n][sample] / alone[n][0]) - 1) for n in GIRDER_AND_CAR]
    shares[3] /= 2
    return max(shares)


FINE = Config.model_validate(
    {
        "train": {"n_cars": 1},
        "guideway": {"n_spans": 3},
        "passage": {"approach": "60 m", "time_step": "0.35 ms"},
    }
)
"""A step at which stiff and light piers can be built anew, too."""


def compared(keys, values, n_samples):
    """Differences of passages in one basis from those of systems built anew, as shares."""
    together = simulate(FINE, MEAN * np.ones((n_samples, 1)), values=values)
    for sample in range(n_samples):
        numbers = {key: float(values[key][sample]) for key in keys}
        alone = simulate(FINE.with_numbers(numbers), MEAN[None])
        yield sample, apart(together, sample, alone)


@pytest.mark.parametrize(
    "keys",
    [
        pytest.param(
            ["girder.elastic_modulus", "bearing.lateral_stiffness", "pier.elastic_modulus"],
            id="few",
        ),
        pytest.param(GUIDEWAY, id="all", marks=pytest.mark.slow),
    ],
)
def test_guideways_in_one_basis_are_those_built_anew(keys):
    """One number after the other at 2.5 deviations to either side.

    With a quarter of the damping the bearings' share of it, scaled with the rest, is seen.
    """
    keys = [f"guideway.{key}" for key in keys]
    rows = [(key, side) for key in keys for side in (-2.5, 2.5)]
    values = {key: np.full(len(rows), FINE.number_at(key)[0]) for key in keys}
    for row, (key, side) in enumerate(rows):
        values[key][row] *= 1 + side * deviation(key)
    for row, difference in compared(keys, values, len(rows)):
        key, _ = rows[row]
        assert difference < (1e-2 if key == "guideway.damping_ratio" else 5e-3), rows[row]


@pytest.mark.slow
def test_drawn_guideways_in_one_basis_are_those_built_anew():
    draws = np.random.default_rng(5).uniform(-1.0, 1.0, size=(20, len(OF_THE_GUIDEWAY)))
    values = {
        key: FINE.number_at(key)[0] * (1 + 2.5 * deviation(key) * column)
        for key, column in zip(OF_THE_GUIDEWAY, draws.T, strict=True)
    }
    found = [difference for _, difference in compared(OF_THE_GUIDEWAY, values, 20)]
    assert max(found) < 1e-2
    assert np.median(found) < 5e-3


def test_the_mean_in_the_basis_is_the_system_without_one():
    config = small(1, 3)
    values = {"guideway.girder.density": np.array([config.guideway.girder.density])}
    together, plain = simulate(config, MEAN[None], values=values), simulate(config, MEAN[None])
    for name in together.data_vars:
        assert_allclose(together[name], plain[name], rtol=1e-6, err_msg=name)


def test_a_guideway_of_its_own_does_not_know_its_neighbours():
    config = small(1, 3, time_step="0.45 ms")
    keys = ["guideway.girder.elastic_modulus", "guideway.damping_ratio", "train.car_body.mass"]
    values = drawn(config, keys, 20)
    values[keys[0]][4] *= 2.0  # beyond the basis: built anew
    gains = MEAN * np.linspace(0.9, 1.1, 20)[:, None]
    together = simulate(config, gains, values=values, n_threads=2)
    few = [18, 4, 3]
    alone = simulate(
        config, gains[few], values={key: column[few] for key, column in values.items()}
    )
    for name in EXTREMES:
        assert_array_equal(together[name][few], alone[name])
    numbers = {key: float(column[4]) for key, column in values.items()}
    anew = simulate(config.with_numbers(numbers), gains[4:5])
    assert anew["status"] == 0
    for name in EXTREMES:
        assert_allclose(together[name][4], anew[name][0], rtol=1e-10)


def test_a_value_for_which_the_step_is_too_large_is_not_judged():
    light = np.array([1.0, 0.2]) * 2551
    found = simulate(
        small(n_spans=2), MEAN * np.ones((2, 1)), values={"guideway.pier.density": light}
    )
    assert found["status"].values.tolist() == [0, STEP_TOO_LARGE]
    assert np.isnan(found["girder_displacement_z"].values).tolist() == [False, True]


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
