"""The sweep of speeds: it resumes, and stopping it changes nothing in what it gives."""

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from maglev.config import from_mapping
from maglev.datasets import LAYOUTS, VARIABLES
from maglev.stages import dynamic_factor, runs
from maglev.vocabulary import GAINS

CONFIG = from_mapping(
    {
        "train": {"n_cars": 1},
        "guideway": {"n_spans": 1},
        "validation": {"speed_min": "100 km/h", "speed_max": "430 km/h", "speed_step": "30 km/h"},
    }
)


class Simulated:
    """Stands in for the model: a deflection of a millimetre and a bit for the speed."""

    def __init__(self, last=None):
        self.speeds, self.last = [], last

    def __call__(self, config, gains, n_threads, **_):
        if self.last is not None and len(self.speeds) == self.last:
            raise KeyboardInterrupt
        self.speeds.append(config.passage.speed)
        data = {}
        for name in LAYOUTS["passage"].variables:
            shape = tuple(config.train.n_cars if d == "car" else 1 for d in VARIABLES[name].dims)
            data[name] = (VARIABLES[name].dims, np.zeros(shape, dtype=VARIABLES[name].dtype))
        data |= {name: (("sample",), gains[:, k]) for k, name in enumerate(GAINS)}
        data["girder_displacement_z"] = (("sample",), [1e-3 + 1e-6 * config.passage.speed])
        attributes = {"time_step": 1e-3, "n_steps": 10}
        return xr.Dataset(data, coords={"sample": [0], "car": [0]}, attrs=attributes)


@pytest.fixture
def config(in_config_folder):
    return CONFIG


def test_a_stopped_sweep_goes_on_where_it_was_and_ends_in_the_same_bytes(
    config, tmp_path, monkeypatch
):
    undisturbed = Simulated()
    monkeypatch.setattr(runs, "simulate", undisturbed)
    whole = dynamic_factor.dataset(config, tmp_path / "whole")
    stopped, resumed = Simulated(last=4), Simulated()
    monkeypatch.setattr(runs, "simulate", stopped)
    with pytest.raises(KeyboardInterrupt):
        dynamic_factor.dataset(config, tmp_path / "store")
    monkeypatch.setattr(runs, "simulate", resumed)
    again = dynamic_factor.dataset(config, tmp_path / "store")
    assert stopped.speeds + resumed.speeds == undisturbed.speeds
    assert len(stopped.speeds) == 4
    dynamic_factor.STAGE.write(whole, tmp_path / "whole.nc", config)
    dynamic_factor.STAGE.write(again, tmp_path / "again.nc", config)
    assert (tmp_path / "whole.nc").read_bytes() == (tmp_path / "again.nc").read_bytes()


def test_a_longer_sweep_computes_only_the_speeds_that_are_new(config, tmp_path, monkeypatch):
    first, more = Simulated(), Simulated()
    monkeypatch.setattr(runs, "simulate", first)
    dynamic_factor.dataset(config, tmp_path)
    monkeypatch.setattr(runs, "simulate", more)
    faster = config.validation.model_copy(update={"speed_max": 460 / 3.6})
    dynamic_factor.dataset(config.model_copy(update={"validation": faster}), tmp_path)
    assert_allclose(more.speeds, [460 / 3.6])


def test_both_ends_of_the_range_are_in_the_sweep(config):
    assert_allclose(3.6 * dynamic_factor.speeds(config)[[0, 1, -1]], [100, 130, 430])
    paper = dynamic_factor.speeds(from_mapping({}))
    assert paper.size == 39
    assert_allclose(3.6 * paper[[0, -1]], [50, 430])


def test_the_coefficient_is_the_deflection_over_that_at_rest(config, tmp_path, monkeypatch):
    monkeypatch.setattr(runs, "simulate", Simulated())
    result = dynamic_factor.dataset(config, tmp_path)
    assert_allclose(result["static_deflection"], 1.5e-3, rtol=0.1)
    assert_allclose(
        result["dynamic_factor"] * result["static_deflection"], result["peak_deflection"]
    )
    assert_allclose(result["measured_deflection"], [1.712e-3])
