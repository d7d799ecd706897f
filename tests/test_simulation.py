"""From a configuration and gains to a dataset: what comes out, and what is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import maglev
from maglev import datasets
from maglev.mechanics.course import course, track_range
from maglev.parameters import Config
from maglev.simulation import simulate
from passages import MEAN, half_size


def small(n_cars=1, n_spans=1, irregularity=None, **passage):
    """Half size, with what tests vary."""
    return half_size(
        train={"n_cars": n_cars},
        guideway={"n_spans": n_spans},
        irregularity=irregularity or {},
        passage=passage,
    )


@pytest.fixture(scope="module")
def with_histories():
    return simulate(small(2, 3), MEAN * [[1.0], [1.1]], histories=True)


def test_the_dataset_has_the_layout_of_a_passage(with_histories):
    datasets.check(with_histories, "passage")
    plain = simulate(small(), MEAN[None])
    datasets.check(plain, "passage")
    assert not any(name.endswith("_history") for name in plain)
    assert dict(with_histories.sizes)["car"] == 2
    assert with_histories.sizes["magnet"] == 2 * 30  # 14 a car and kind, 2 a coupling
    assert_allclose(with_histories["suspension_proportional_gain"], [3500, 3850])
    assert with_histories.attrs["time_step"] == course(small(2, 3)).time_step
    assert maglev.simulate is simulate


def test_histories_peak_at_the_extremes(with_histories):
    """Recorded once a millisecond: a peak between two rows stands in the extremes alone."""
    for name, missed in (
        ("girder_displacement_z", 1e-3),
        ("girder_displacement_y", 3e-2),
        ("girder_acceleration_z", 3e-2),
        ("girder_acceleration_y", 3e-2),
        ("car_body_acceleration_z", 2e-2),
        ("car_body_acceleration_y", 2e-2),
    ):
        history = np.abs(with_histories[f"{name}_history"])
        every = [dim for dim in history.dims if dim != "sample"]
        extreme = with_histories[name]
        share = (history.max(every) / extreme).values
        assert np.all(share <= 1 + 1e-6), name
        assert np.all(share > 1 - missed), name
        when = with_histories[f"{name}_t"]
        flat = history.max([dim for dim in every if dim != "t"])
        if missed < 0.05:
            interval = float(with_histories["t"][1] - with_histories["t"][0])
            near = np.abs(with_histories["t"][flat.argmax("t")] - when)
            assert np.all(near.values <= 2 * interval), name
    of_magnets = with_histories["gap_history"]
    suspension = with_histories["magnet_kind"] == 0
    lowest = of_magnets.where(suspension).min(["magnet", "t"])
    assert np.all(lowest >= with_histories["suspension_gap_min"])
    assert np.all(
        of_magnets.where(~suspension).max(["magnet", "t"]).values
        <= with_histories["guidance_gap_max"].values
    )


def test_a_response_of_cars_is_that_of_the_worst_car(with_histories):
    for name in datasets.CAR_RESPONSES:
        per_car = with_histories[f"{name}_per_car"]
        assert_array_equal(with_histories[name], per_car.max("car"))
        assert np.all(per_car.std("car") > 0)


def test_the_larger_of_both_signs_is_the_extreme(with_histories):
    for name in datasets.SIGNED_RESPONSES:
        parts = [with_histories[f"{name}_{part}"] for part in ("positive", "negative")]
        assert_array_equal(np.maximum(*parts), with_histories[name])
        history = with_histories[f"{name}_history"]
        for sign, part in zip((1.0, -1.0), parts, strict=True):
            largest = (sign * history).max("t")
            assert_allclose(part, largest, atol=0.03 * float(with_histories[name].max()))
            assert np.all(part >= largest * (1 - 1e-6))


def test_the_ends_of_a_car_shake_more_than_its_middle_by_its_pitching_and_yawing(with_histories):
    wide, narrow = with_histories, simulate(with_end_distance(1e-6), MEAN * [[1.0], [1.1]])
    for axis in "yz":
        middle = wide[f"car_body_acceleration_{axis}_per_car"]
        assert np.all(wide[f"car_end_acceleration_{axis}_per_car"] > 1.02 * middle)
        assert_allclose(narrow[f"car_end_acceleration_{axis}_per_car"], middle, rtol=1e-5)
        for index in ("sperling_index", "iso2631_rms"):
            name = f"{index}_{axis}_per_car"
            assert np.all(wide[name] > narrow[name])


def with_end_distance(distance):
    config = small(2, 3)
    body = config.train.car_body.model_copy(update={"end_distance": distance})
    return config.model_copy(update={"train": config.train.model_copy(update={"car_body": body})})


def test_a_slow_train_on_a_smooth_track_is_at_rest_everywhere():
    smooth = {"enabled": False}
    found = simulate(small(1, 3, smooth, speed="20 km/h"), MEAN[None]).isel(sample=0)
    assert_allclose(found["dynamic_coefficient"], 1.0, rtol=3e-3)
    span = small().guideway.span_length
    assert_allclose(found["deflection_over_span"] * span, found["girder_displacement_z"])
    assert_allclose(found["suspension_current_share"], 25 / 120, rtol=1e-2)
    assert_allclose(found["guidance_current_share"], 25 / 120, rtol=1e-2)
    assert found["suspension_gap_excursion"] < 2e-4
    assert found["bearing_uplift"] < 1e-7
    assert found["iso2631_rms_z"] < 2e-3
    fast = simulate(small(1, 3, smooth), MEAN[None]).isel(sample=0)
    assert fast["dynamic_coefficient"] > 1.01
    assert fast["bearing_uplift"] > 2e-7


def test_a_lost_sample_has_no_response():
    found = simulate(small(), MEAN * [[1.0], [0.3]])
    assert found["status"][0] == 0 and found["status"][1] != 0
    for name in datasets.RESPONSES:
        assert np.isfinite(found[name][0]), name
        assert np.isnan(found[name][1]), name


def test_histories_do_not_change_the_extremes(with_histories):
    plain = simulate(small(2, 3), MEAN * [[1.0], [1.1]])
    for name in datasets.RESPONSES:
        assert_array_equal(plain[name], with_histories[name])


def test_girder_accelerations_in_a_wider_band_are_larger():
    band = simulate(small(), MEAN[None])
    wide = simulate(small(acceleration_band="300 Hz"), MEAN[None])
    for axis in "yz":
        name = f"girder_acceleration_{axis}"
        assert wide[name] > 1.02 * band[name]
        assert wide[f"girder_displacement_{axis}"] == band[f"girder_displacement_{axis}"]
        assert wide[f"car_body_acceleration_{axis}"] == band[f"car_body_acceleration_{axis}"]


def test_raw_accelerations_ask_for_a_step_and_cut_off_at_which_they_have_a_limit():
    with pytest.raises(ValueError, match="a property of the cut-off and the step, not of the"):
        small(acceleration_band=None)
    fine = {"mode_cutoff": "2000 Hz", "time_step": "0.06 ms"}
    assert small(acceleration_band=None, **fine).passage.acceleration_band is None
    points = {"suspension_magnet": {"pole_length": "0 m"}}
    with pytest.raises(ValueError, match="points step on and off the rail's joints"):
        Config.model_validate(
            {"train": points, "passage": {"acceleration_band": None, **fine}},
        )


def test_a_sample_whose_gains_need_a_smaller_step_is_not_judged_and_others_do_not_notice():
    stiff = MEAN * [1.0, 125 / 17.5, 1.0, 1.0]  # a contact by the step alone, of no train
    found = simulate(small(), np.array([MEAN, stiff]))
    assert found["status"].to_numpy().tolist() == [0, 4]
    assert np.isnan(found["girder_displacement_z"][1])
    alone = simulate(small(), MEAN[None])
    assert found["girder_displacement_z"][0] == alone["girder_displacement_z"][0]
    finer = simulate(small(time_step="0.1 ms"), stiff[None])
    assert finer["status"] == 0


@pytest.mark.parametrize("n_cars", [1, 2, 3])
@pytest.mark.parametrize("n_spans", [1, 2, 3])
def test_any_number_of_cars_passes_any_number_of_spans(n_cars, n_spans):
    config = small(n_cars, n_spans)
    passages = simulate(config, MEAN[None])
    assert passages["status"] == 0
    assert passages.sizes["car"] == n_cars
    for name in datasets.RESPONSES:
        assert np.isfinite(passages[name]).all()
        assert passages[name] > 0
    for name in datasets.TIMED_RESPONSES:
        assert 0 < passages[f"{name}_t"] <= course(config).n_steps * course(config).time_step


@pytest.mark.parametrize(("n_cars", "n_spans"), [(1, 2), (6, 2)])
def test_real_cars_press_real_spans_down_by_some_millimetre_and_a_half(n_cars, n_spans):
    config = Config.model_validate(
        {
            "train": {"n_cars": n_cars},
            "guideway": {"n_spans": n_spans},
            "irregularity": {"fade_in": "20 m"},
            "passage": {"approach": "20 m", "mode_cutoff": "300 Hz"},
        }
    )
    passages = simulate(config, MEAN[None])
    assert passages["status"] == 0
    assert 1.4e-3 < passages["girder_displacement_z"] < 1.8e-3


def test_a_train_three_times_as_long_as_the_guideway_passes():
    config = small(6, 2)
    passages = simulate(config, MEAN[None])
    assert passages["status"] == 0
    one = simulate(small(1, 2), MEAN[None])
    assert passages["girder_displacement_z"] > one["girder_displacement_z"]


def test_lost_levitation_is_a_status_beside_sound_neighbours():
    gains = MEAN * [[1.0, 1, 1, 1], [0.4, 1, 1, 1]]
    passages = simulate(small(approach="40 m"), gains)
    alone = simulate(small(approach="40 m"), gains[:1])
    assert passages["status"][0] == 0 != passages["status"][1]
    assert datasets.STATUS[int(passages["status"][1])] in ("contact", "gap_lost")
    assert np.isfinite(passages["lost_t"][1])
    assert passages["lost_magnet"][0] == -1 < passages["lost_magnet"][1]
    for name in datasets.RESPONSES:
        assert np.isnan(passages[name][1])
        assert passages[name][0] == alone[name][0]


def test_progress_and_threads_change_no_number():
    counts = []
    gains = MEAN * np.linspace(0.95, 1.05, 20)[:, None]
    one = simulate(small(), gains)
    two = simulate(small(), gains, n_threads=2, on_progress=counts.append)
    assert sum(counts) == 20
    for name in datasets.RESPONSES:
        assert_array_equal(one[name], two[name])


@pytest.mark.parametrize(
    ("gains", "message"),
    [
        (np.ones((4, 1000)), r"^gains have shape \(4, 1000\), expected .*; transpose them$"),
        (MEAN, r"^gains have shape \(4,\), expected \(sample, gain\) = \(any, 4\)$"),
        (np.empty((0, 4)), r"^gains have no sample"),
        (np.array([MEAN, [np.inf, 1, 1, 1]]), r"^gains must be finite, got \[inf.* at sample 1$"),
    ],
    ids=["transposed", "one row", "empty", "infinite"],
)
@pytest.mark.parametrize("solver", ["production", "reference"])
def test_gains_are_checked_before_any_computing(gains, message, solver):
    with pytest.raises(ValueError, match=message):
        simulate(Config(), gains, solver=solver)


def test_an_unknown_solver_is_refused():
    with pytest.raises(
        ValueError, match=r"^solver must be 'production' or 'reference', got 'fast'$"
    ):
        simulate(Config(), MEAN[None], solver="fast")


def test_a_band_that_the_step_cannot_carry_is_refused():
    with pytest.raises(ValueError, match=r"^passage\.acceleration_band must be below half"):
        simulate(small(acceleration_band="3000 Hz"), MEAN[None])


def test_a_step_above_the_stability_limit_is_refused_with_the_limit():
    with pytest.raises(ValueError, match=r"^passage\.time_step must be below .* ms, got 1\.08 ms"):
        simulate(small(time_step="1.2 ms"), MEAN[None])


def test_a_missing_irregularity_file_is_named(tmp_path):
    path = tmp_path / "none.csv"
    with pytest.raises(FileNotFoundError, match=f"irregularity profile {path} does not exist"):
        simulate(small(irregularity={"profile_file": str(path)}), MEAN[None])


def written(path, config, stop):
    """A measured profile from before the fade-in to ``stop`` [m]."""
    x = np.arange(-10.0, stop, 0.5)
    rows = np.column_stack([x, 1e-3 * np.sin(x), 1e-3 * np.cos(x)])
    np.savetxt(path, rows, delimiter=",", header="x,vertical,lateral", comments="")
    return path


def test_an_irregularity_file_shorter_than_the_run_is_refused(tmp_path):
    config = small()
    end = track_range(config)[1]
    path = written(tmp_path / "short.csv", config, end - 3.0)
    with pytest.raises(
        ValueError, match=r"must cover the passage from -5 to .* m, got -10 to .* m$"
    ):
        simulate(small(irregularity={"profile_file": str(path)}), MEAN[None])
    path = written(tmp_path / "long.csv", config, end + 3.0)
    measured = simulate(small(irregularity={"profile_file": str(path)}), MEAN[None])
    assert measured["status"] == 0
    assert (
        measured["car_body_acceleration_z"]
        != simulate(small(), MEAN[None])["car_body_acceleration_z"]
    )


def test_an_irregularity_file_edited_between_two_calls_is_seen(tmp_path):
    config = small()
    path = written(tmp_path / "track.csv", config, track_range(config)[1] + 3.0)
    of_file = small(irregularity={"profile_file": str(path)})
    before = simulate(of_file, MEAN[None])["car_body_acceleration_z"]
    rows = np.loadtxt(path, delimiter=",", skiprows=1) * [1.0, 2.0, 2.0]
    np.savetxt(path, rows, delimiter=",", header="x,vertical,lateral", comments="")
    after = simulate(of_file, MEAN[None])["car_body_acceleration_z"]
    assert after > 1.2 * before


def test_every_sample_can_have_a_track_of_its_own():
    config = small()
    gains = np.tile(config.gains.as_row, (19, 1))
    seeds = np.array([config.seed, *range(18)])
    own = simulate(config, gains, track_seeds=seeds)
    for name in ("girder_displacement_y", "car_body_acceleration_z"):
        assert_array_equal(own[name][:1], simulate(config, gains[:1])[name])
        later = simulate(config, gains[7:10], track_seeds=seeds[7:10], n_threads=2)
        assert_array_equal(own[name][7:10], later[name])
        assert np.unique(own[name]).size == 19
    another = config.model_copy(update={"seed": 11})
    assert_array_equal(
        own.girder_acceleration_y[12], simulate(another, gains[:1]).girder_acceleration_y[0]
    )


@pytest.mark.parametrize(
    ("seeds", "solver", "message"),
    [
        ([1], "production", r"track_seeds must be 2 whole numbers .* got int64 of shape \(1,\)"),
        ([1.0, 2.0], "production", "track_seeds must be 2 whole numbers .* got float64"),
        ([1, -2], "production", "from zero"),
        ([1, 2], "reference", "the reference solver takes one track for all samples"),
    ],
)
def test_seeds_of_tracks_are_checked(seeds, solver, message):
    config = small()
    with pytest.raises(ValueError, match=message):
        simulate(config, [config.gains.as_row] * 2, solver=solver, track_seeds=seeds)
