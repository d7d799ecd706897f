"""Measurements: of this bridge, of another, of one's own, or none; and what they exclude."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maglev.config import ConfigError, from_mapping
from maglev.datasets import check, describe
from maglev.measurements import load_measurements, measured_here
from maglev.mechanics.moving_load import Beam, deflection_at_frequency
from maglev.stages import dynamic_factor, guideway_modes, stiffness_check

SMALL = {
    "train": {"n_cars": 1},
    "guideway": {"n_spans": 1},
    "irregularity": {"n_harmonics": 50, "wavelength_max": "20 m"},
    "validation": {"speed_min": "400 km/h", "speed_max": "400 km/h"},
}
OWN = """\
line: a line of our own
span_length: {span} m
peak_deflection:
  - {{value: 1.2 mm, speed: 400 km/h, source: own, confidence: high}}
"""

pytestmark = pytest.mark.usefixtures("in_config_folder")


def small(**validation):
    return from_mapping({**SMALL, "validation": {**SMALL["validation"], **validation}})


@pytest.mark.parametrize("stiffness", [2e10, 8.58e10, 3e11])
def test_deflection_and_frequency_of_a_beam_go_together_whatever_its_stiffness(stiffness):
    beam = Beam(length=24.768, bending_stiffness=stiffness, mass_per_length=7e3, damping_ratio=0.0)
    found = deflection_at_frequency(beam.frequency(), 25e3, 7e3)
    assert_allclose(found, beam.static_deflection(25e3), rtol=1e-12)


def test_the_measured_pair_is_that_of_no_beam_with_our_mass_and_load():
    config = from_mapping({})
    modes = describe(guideway_modes.dataset(small()))
    found = describe(stiffness_check.dataset(config, modes))
    check(found, "stiffness_check")
    assert_allclose(float(found["car_load"]), 64.2e3, rtol=0.01)
    assert_allclose(float(found["needed_car_load"]), 98e3, rtol=0.02)
    assert_allclose(float(found["needed_mass_per_length"]), 4.6e3, rtol=0.02)
    on_curve = np.interp(10.35, found["beam_frequency"], found["beam_deflection"])
    assert_allclose(on_curve, 1.09e-3, rtol=0.03)
    model = np.interp(found["model_frequency"], found["beam_frequency"], found["beam_deflection"])
    assert_allclose(model, found["static_deflection"], rtol=0.03)


@pytest.mark.parametrize(
    "config",
    [
        lambda: small(measurements=None),
        lambda: small(measured_here=False),
        lambda: from_mapping({**SMALL, "guideway": {"n_spans": 1, "span_length": "18.576 m",
                                                   "rail": {"units_per_span": 6}}}),
    ],
    ids=["none", "of another bridge", "of another span"],
)  # fmt: skip
def test_what_was_not_measured_on_this_bridge_is_in_no_file(config, tmp_path):
    config = config()
    modes = describe(guideway_modes.dataset(config))
    for made, layout in (
        (modes, "modes"),
        (stiffness_check.dataset(config, modes), "stiffness_check"),
        (dynamic_factor.dataset(config, tmp_path), "dynamic_factor"),
    ):
        check(describe(made), layout)
        assert not [name for name in made.variables if "measured" in str(name)]


def test_an_own_file_may_hold_what_there_is(tmp_path):
    (tmp_path / "own.yaml").write_text(OWN.format(span=24.768))
    config = small(measurements=str(tmp_path / "own.yaml"))
    measured = measured_here(config)
    assert measured.first_vertical_frequency is None
    swept = dynamic_factor.dataset(config, tmp_path)
    assert_allclose(swept["measured_deflection"], [1.2e-3])
    assert swept["measured_deflection"].attrs["confidence"] == "high"
    modes = guideway_modes.dataset(config)
    assert "measured_frequency" not in modes
    assert "needed_car_load" not in stiffness_check.dataset(config, modes)


def test_a_file_must_say_the_span_that_it_was_measured_on(tmp_path):
    (tmp_path / "own.yaml").write_text("line: somewhere\n")
    with pytest.raises(ConfigError, match="span_length is missing"):
        load_measurements(tmp_path / "own.yaml")
