"""Densities in time of a train that is a formula: each batch once, losses said, ends agree."""

import numpy as np
import pytest
import synthetic
import xarray as xr
from formula_train import config
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from maglev import datasets, simulate
from maglev.config import from_mapping
from maglev.stage import named
from maglev.stages import density_in_time, histories, representative_points, runs
from maglev.uncertainty.in_time import thinned
from maglev.vocabulary import BARRIER_SOURCES, PAPER_RESPONSES, STEP_TOO_LARGE

TIME = 1e-3 * np.arange(1, 1501)
PERIOD = 0.5
LEVELS = (0.1, 0.01, 0.001)


class FormulaHistories:
    """Stands in for `maglev.simulate`: A sin(wt), or -A sin²(wt), of extreme A."""

    def __init__(self, status=2):
        self.batches, self.status = [], status

    def __call__(self, config, gains, *, histories, values=None, track_seeds=None, n_threads=1):
        self.batches.append(len(gains))
        self.given = {"values": values, "seeds": track_seeds}
        gains = gains[:, :4]
        standard = (gains / np.array(config.gains.as_row) - 1) / 0.1
        made = synthetic.runs(standard, loses=True).drop_vars(
            ["standard", "probability", "track_seed", "parameter"]
        )
        lost = made["status"].to_numpy() != 0
        made["status"] = ("sample", np.where(lost, self.status, 0))
        made["lost_t"] = ("sample", np.where(lost, 0.7, np.nan))
        for k, name in enumerate(PAPER_RESPONSES):
            extreme = synthetic.extremes(standard)[:, k]
            swing = np.sin(2 * np.pi / PERIOD * TIME)
            swing = -(swing**2) if name == "girder_acceleration_y" else swing
            history = extreme[:, None] * swing
            history[lost] = np.where(TIME < 0.7, history[lost], np.nan)
            of_car = name.startswith("car_body")
            dims = ("sample", "car", "t") if of_car else ("sample", "t")
            made[f"{name}_history"] = (dims, history[:, None] if of_car else history)
            made[f"{name}_t"] = ("sample", np.where(lost, np.nan, 0.25 * PERIOD))
        for k, gain in enumerate(datasets.GAINS):
            made[gain] = ("sample", gains[:, k])
        made = made.assign_coords(t=TIME)
        made.attrs = {"time_step": 1e-3, "n_steps": TIME.size, "track": "smooth track"}
        return datasets.describe(made)


@pytest.fixture
def train(monkeypatch):
    one = FormulaHistories()
    monkeypatch.setattr(runs, "simulate", one)
    monkeypatch.setattr(histories, "BATCH", 50)
    return one


PARAMETERS = config(in_time={"n_times": 60}, mcm={})
POINTS = representative_points.dataset(
    config(in_time={}).model_copy(
        update={"study": PARAMETERS.study.model_copy(update={"n_representative": 400})}
    ),
    "validation",
)


def limits(given=True):
    """Limits of all responses, a normal's of the first; or none that is given."""
    limit = np.ones((6, 3))
    limit[0] = stats.norm(1.5e-3, np.hypot(6e-6, 2e-6)).isf(LEVELS)
    status = np.zeros((6, 3), int) if given else np.ones((6, 3), int)
    by_level = ("response", "failure_probability")
    return xr.Dataset(
        {"limit": (by_level, limit), "limit_status": (by_level, status)},
        coords={"response": list(PAPER_RESPONSES), "failure_probability": list(LEVELS)},
    )


def made(store, given=True, parameters=PARAMETERS):
    found = density_in_time.dataset(parameters, POINTS, {"asm": limits(given)}, "validation", store)
    return datasets.describe(found)


def test_the_end_of_the_first_passage_is_the_distribution_of_the_extreme(train, tmp_path):
    found = made(tmp_path)
    datasets.check(found, "density_in_time")
    assert_array_equal(found["response"], PARAMETERS.study.in_time.responses)
    at = found.sel(response="girder_displacement_z")
    assert (at["barrier_source"] == BARRIER_SOURCES.index("limit")).all()
    assert_allclose(at["barrier"], limits()["limit"][0])
    end = at.isel(t=-1)
    assert_allclose(end["reliability_of_points"], at["reliability_of_extreme"], rtol=1e-13)
    assert_allclose(
        end["reliability"] - at["reliability_of_extreme"], at["reliability_error"], atol=1e-15
    )
    assert np.abs(at["reliability_error"]).max() < 0.01
    # 0.9, 0.99 and 0.999 of those that hold, whose first coordinate is cut off at the border
    drawn = np.random.default_rng(1).standard_normal((400_000, 2))
    extreme = 1.5e-3 + 6e-6 * drawn[:, 0] + 2e-6 * drawn[:, 1]
    below = extreme[:, None] < limits()["limit"][0].to_numpy()
    exact = (below & (drawn[:, :1] > synthetic.BORDER)).mean(axis=0)
    assert_allclose(at["reliability_of_extreme"], exact, atol=0.006)


def test_a_barrier_stands_on_either_side(train, tmp_path):
    parameters = config(in_time={"n_times": 60, "responses": ["girder_acceleration_y"]})
    found = made(tmp_path, given=False, parameters=parameters).isel(response=0)
    assert (found["reliability_of_extreme"] < 0.97).any()
    end = found["reliability_of_points"].isel(t=-1)
    assert_allclose(end, found["reliability_of_extreme"], rtol=1e-13)
    assert np.abs(found["reliability_error"]).max() < 0.01


def test_losses_leave_when_they_happen_and_the_density_holds_the_rest(train, tmp_path):
    found = made(tmp_path)
    lost = POINTS["probability"].to_numpy()[POINTS["standard"][:, 0] < synthetic.BORDER].sum()
    t = found["t"].to_numpy()
    assert_allclose(found["held_in_time"], np.where(t < 0.7, 1.0, 1.0 - lost), rtol=1e-12)
    width = found["value_in_time"].isel(cell=1) - found["value_in_time"].isel(cell=0)
    mass = found["density_in_time"].sum("cell") * width
    assert_allclose(mass, found["held_in_time"].broadcast_like(mass), rtol=1e-9)
    assert (found["reliability"].isel(t=-1) <= 1.0 - lost + 1e-12).all()


def test_the_size_of_the_car_body_is_followed_and_the_sign_of_the_girder(train, tmp_path):
    found = made(tmp_path)
    t = found["t"].to_numpy()
    phase = np.sin(2 * np.pi / PERIOD * t)
    at = found.sel(t=t[t < 0.69])
    mean = at["mean_in_time"].sel(response="girder_displacement_z")
    assert_allclose(mean, 1.5e-3 * phase[t < 0.69], atol=1e-5)
    assert (found["quantile_in_time"].sel(response="car_body_acceleration_z") >= 0.0).all()


def test_a_batch_is_computed_once_whatever_came_between(train, tmp_path):
    first = made(tmp_path / "store")
    assert train.batches == [50] * 8
    again = made(tmp_path / "store")
    assert sum(train.batches) == 400
    xr.testing.assert_identical(again, first)
    next((tmp_path / "store").rglob("*.nc")).unlink()  # as if it had been interrupted
    xr.testing.assert_identical(made(tmp_path / "store"), first)
    assert sum(train.batches) == 450


def test_any_random_quantity_and_a_track_of_its_own_reach_the_model(train, tmp_path):
    law = {"law": "uniform", "low": "29 t", "high": "39 t"}
    parameters = from_mapping(
        {
            "study": {"n_representative": 64, "n_counting": 16384, "in_time": {"n_times": 20}},
            "cases": {
                "validation": {"random": {"train.car_body.mass": law}},
                "moving": {"track": "random", "methods": ["mcm"]},
            },
        }
    )
    drawn = representative_points.dataset(parameters, "validation")
    density_in_time.dataset(parameters, drawn, {"asm": limits()}, "validation", tmp_path)
    assert train.given["seeds"] is None
    assert_array_equal(
        train.given["values"]["train.car_body.mass"],
        drawn["parameter_value"].sel(parameter="train.car_body.mass")[50:],
    )
    drawn = representative_points.dataset(parameters, "moving")
    density_in_time.dataset(parameters, drawn, {"mcm": limits()}, "moving", tmp_path)
    assert np.unique(train.given["seeds"]).size == 14


def test_no_number_depends_on_the_size_of_a_batch(train, tmp_path, monkeypatch):
    first = made(tmp_path / "a")
    monkeypatch.setattr(histories, "BATCH", 37)
    xr.testing.assert_identical(made(tmp_path / "b"), first)


def test_without_limits_barriers_stand_on_the_extremes_mean_and_deviation(train, tmp_path):
    at = made(tmp_path, given=False).sel(response="girder_displacement_z")
    assert (at["barrier_source"] == BARRIER_SOURCES.index("mean_and_deviations")).all()
    held = POINTS["standard"][:, 0] >= synthetic.BORDER
    values = synthetic.extremes(POINTS["standard"].to_numpy())[held, 0]
    weight = POINTS["probability"][held].to_numpy()
    mean = np.average(values, weights=weight)
    deviation = np.sqrt(np.average((values - mean) ** 2, weights=weight))
    assert_allclose(at["barrier"], mean + stats.norm.isf(LEVELS) * deviation, rtol=1e-9)


def test_a_step_that_is_too_large_for_some_gains_is_refused(train, tmp_path):
    train.status = STEP_TOO_LARGE
    with pytest.raises(ValueError, match=r"too large for the gains of .* of 50 samples"):
        made(tmp_path)


def test_a_path_of_the_model_reaches_its_extreme():
    tiny = from_mapping(
        {
            "train": {"n_cars": 1},
            "guideway": {"n_spans": 1},
            "irregularity": {"n_harmonics": 50, "wavelength_max": "20 m"},
        }
    )
    gains = np.array([tiny.gains.as_row]) * [[1.0], [1.05]]
    passages = simulate(tiny, gains, histories="responses")
    assert not {"gap_history", "magnet"} & set(passages.variables)
    whole = simulate(tiny, gains, histories=True)
    assert "gap_history" in whole
    xr.testing.assert_identical(
        passages, whole[list(passages.data_vars)].drop_vars("magnet", errors="ignore")
    )
    ends = np.linspace(0, passages.sizes["t"], 40).astype(int)
    for name in PAPER_RESPONSES:
        path = histories._path(passages, name, ends)
        assert_allclose(np.abs(path).max(axis=1), passages[name], rtol=1e-12, err_msg=name)
        interval = -(-np.abs(path).argmax(axis=1) // 3)
        at = passages[f"{name}_t"].to_numpy() / float(passages["t"][0])
        assert ((ends[interval - 1] <= at) & (at <= ends[interval])).all(), name
        plain = thinned(np.pad(np.abs(passages[f"{name}_history"].to_numpy().reshape(2, -1)),
                               ((0, 0), (1, 0))), ends, [np.nan] * 2, [np.nan] * 2)  # fmt: skip
        # records a millisecond apart miss little of a peak
        assert_allclose(plain.max(axis=1), passages[name], rtol=0.01, err_msg=name)


def test_other_histories_are_refused():
    with pytest.raises(ValueError, match="histories must be False, True or 'responses', got 'all'"):
        simulate(PARAMETERS, [PARAMETERS.gains.as_row], histories="all")


def test_an_unknown_case_is_refused_before_anything_is_computed():
    with pytest.raises(ValueError, match=r"study\.in_time\.cases: there is no case 'valid'"):
        from_mapping({"study": {"in_time": {"cases": ["valid"]}}})
    with pytest.raises(ValueError, match="responses must not name anything twice"):
        from_mapping({"study": {"in_time": {"responses": ["girder_displacement_z"] * 2}}})
    with pytest.raises(ValueError, match=r"study\.in_time\.responses"):
        from_mapping({"study": {"in_time": {"responses": ["suspension_gap"]}}})
    assert "study.in_time.cases" not in named("density_in_time").reads
