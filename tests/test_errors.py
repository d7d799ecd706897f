"""What a user has given and is refused is a `UserError`, whoever refuses it."""

import re
from pathlib import Path

import numpy as np
import pytest

import maglev
from maglev import datasets, profiles
from maglev.errors import ConfigError, UserError
from maglev.measurements import load_measurements
from maglev.mechanics.moving_load import Beam
from maglev.mechanics.timoshenko import shear_flexibility
from maglev.parameters import Config
from maglev.stage import named
from maglev.stages.points import case_of
from maglev.uncertainty.reliability import exceedance
from maglev.uncertainty.selection import fit_selected

GAINS = np.full((1, 4), 9000.0)

REFUSED = {
    "unknown key": lambda _: Config().with_values({"passage.sped": "400 km/h"}),
    "unknown case": lambda _: Config().of_case("none"),
    "unknown case of a stage": lambda _: case_of(Config(), "none"),
    "unknown method": lambda _: named("design").view(Config(), "validation", "mcm"),
    "shape of gains": lambda _: maglev.simulate(Config(), np.zeros(4)),
    "solver": lambda _: maglev.simulate(Config(), GAINS, solver="implicit"),
    "seeds": lambda _: maglev.simulate(Config(), GAINS, track_seeds=[0.5]),
    "profile": lambda folder: profiles.read(written(folder / "p.csv", "x,vertical\n0,0\n")),
    "no NetCDF": lambda folder: datasets.read(written(folder / "a.nc", "text"), "runs"),
    "beam": lambda _: Beam(
        length=-1.0, bending_stiffness=1.0, mass_per_length=1.0, damping_ratio=0.0
    ),
    "element": lambda _: shear_flexibility(Config().guideway.girder, [0.0]),
    "probability": lambda _: exceedance([0.0], [1.0, 2.0], [0.9, 0.9]),
    "surrogate": lambda _: fit_selected(np.eye(3), np.eye(3), "spline"),
}


def written(path, text):
    path.write_text(text)
    return path


@pytest.mark.parametrize("what", REFUSED)
def test_a_refusal_is_a_user_error_of_one_sentence(what, tmp_path):
    with pytest.raises(UserError) as refusal:
        REFUSED[what](tmp_path)
    assert "\n" not in str(refusal.value)


def test_a_mistake_in_a_file_of_parameters_is_a_configuration_error(tmp_path):
    path = written(tmp_path / "c.yaml", "passage: {speed: fast}\n")
    for load in (maglev.load_config, load_measurements):
        with pytest.raises(ConfigError):
            load(path)


def test_a_dataset_of_our_own_that_departs_from_its_layout_is_a_fault(tmp_path):
    with pytest.raises(ValueError) as fault:
        datasets.write(datasets.xr.Dataset(), tmp_path / "a.nc", "runs", config={}, code="")
    assert not isinstance(fault.value, UserError)


def test_who_refuses_what_a_user_gives_says_so():
    """Other modules raise no bare ValueError; in a class of parameters pydantic asks for one."""
    own = {
        "parameters.py",
        "laws.py",
        "units.py",
        "fingerprint.py",
        "datasets.py",
        "packing.py",
    }
    modules = Path(maglev.__file__).parent.rglob("*.py")
    bare = [path.name for path in modules if re.search("raise ValueError", path.read_text())]
    assert set(bare) <= own
