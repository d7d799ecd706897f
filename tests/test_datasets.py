"""Files: they explain themselves, appear whole, and equal data give equal bytes."""

import json

import netCDF4
import numpy as np
import pytest
import xarray as xr

from maglev import datasets
from maglev.datasets import LAYOUTS, describe, read, write
from maglev.vocabulary import GAIN_KEYS, PAPER_RESPONSES

WORDS = {
    "response": list(PAPER_RESPONSES),
    "parameter": [f"gains.{key}" for key in GAIN_KEYS],
    "method": ["mcm", "asm"],
    "case": ["validation", "mine"],
    "setting": ["fast_1", "fast_2"],
    "swept_parameter": ["passage.speed", "guideway.n_spans"],
    "limit_state": ["lost", "ride", "out of service"],
}

OF_STAGE = ("parameter_value", "swept_value")
"""Variables whose units their stage knows."""

ORDER = "check_coordinate_variables_strict_monotonicity"

CONFIG = {"seed": 3, "demonstration": False, "passage": {"speed": "100.0 m/s"}}


def filled(layout):
    """A small dataset with every variable of a layout."""
    sizes = {"sample": 2, "car": 2, "magnet": 3, "t": 5, "x": 4, "side": 2, "mode": 3}
    sizes |= {"wavenumber": 4, "speed": 3, "measured_speed": 1, "response": 6, "parameter": 4}
    sizes |= {"method": 2, "failure_probability": 3, "round": 2, "step": 3, "cell": 5, "check": 2}
    sizes |= {"source": 2, "grid_derivative": 2, "grid_proportional": 3}
    sizes |= {"train_part": 9, "current_lag": 2, "track": 3, "curve": 2, "beam_frequency": 4}
    sizes |= {"path_step": 13, "quantile_level": 3}
    sizes |= {"case": 2, "limit_state": 3, "setting": 2, "swept_parameter": 2}
    names = [*LAYOUTS[layout].variables, *LAYOUTS[layout].optional]
    of = {name: LAYOUTS[layout].variable(name) for name in names}
    dims = {dim for name in names for dim in of[name].dims}
    coords = {dim: np.arange(sizes[dim]) for dim in sorted(dims)}
    coords |= {dim: WORDS[dim][: sizes[dim]] for dim in dims & set(WORDS)}
    if "side" in dims:
        coords["side"] = np.array([-1, 1])

    def values(name):
        variable = of[name]
        shape = tuple(sizes[dim] for dim in variable.dims)
        if variable.flags is not None:
            return np.full(shape, next(iter(variable.flags)))
        if variable.dtype == datasets.TEXT:
            return np.full(shape, "girder_displacement_z")
        if variable.dtype.startswith("int"):
            return np.ones(shape, dtype=int)
        return np.arange(1, 1 + np.prod(shape, dtype=int)).reshape(shape) / 8

    return xr.Dataset({n: (of[n].dims, values(n)) for n in names}, coords=coords)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_is_written_reads_back_with_units_and_meaning(tmp_path, layout):
    made = filled(layout)
    write(made, tmp_path / "f.nc", layout, config=CONFIG, code="abc")
    found = read(tmp_path / "f.nc", layout)
    xr.testing.assert_allclose(found, describe(made))
    for name in found.variables:
        assert found[name].attrs["long_name"], name
        explained = {"units", "units_by_response", "units_by_limit_state", "flag_meanings"}
        if found[name].dtype.kind != "U" and name not in OF_STAGE:
            assert explained & set(found[name].attrs), name


@pytest.mark.parametrize("layout", LAYOUTS)
def test_places_are_found_by_their_names_in_every_file(tmp_path, layout):
    made = filled(layout)
    write(made, tmp_path / "f.nc", layout, config=CONFIG, code="abc")
    with xr.open_dataset(tmp_path / "f.nc") as found:
        for dim in set(found.dims) & set(WORDS):
            last = {dim: WORDS[dim][found.sizes[dim] - 1]}
            xr.testing.assert_equal(found.sel(last), made.isel({dim: -1}))
        assert "sample" not in found.dims or found["sample"].dtype.kind == "i"
    numbered = {dim: (dim, np.arange(made.sizes[dim])) for dim in set(made.dims) & set(WORDS)}
    for dim, number in numbered.items():
        with pytest.raises(ValueError, match=f"'{dim}' must name its places in words"):
            datasets.check(describe(made).assign_coords({dim: number}), layout)


def test_each_response_has_the_unit_of_its_name_whatever_their_order():
    made = filled("density").isel(response=[3, 0])
    found = describe(made)
    assert found["value"].attrs["units_by_response"] == "m s-2, m"
    assert found["density"].attrs["units_by_response"] == "m-1 s2, m-1"
    states = filled("limit_states")
    states["state_response"] = ("limit_state", ["none", "girder_acceleration_z", "none"])
    assert describe(states)["threshold"].attrs["units_by_limit_state"] == "1, m s-2, 1"


def test_equal_data_give_equal_bytes_and_no_debris(tmp_path):
    for name in ("a.nc", "b.nc"):
        write(filled("passage"), tmp_path / name, "passage", config=CONFIG, code="abc")
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.nc", "b.nc"]


def test_a_file_says_where_it_comes_from(tmp_path):
    (tmp_path / "measured.yaml").write_text("line: none\n")
    write(
        filled("passage"),
        tmp_path / "f.nc",
        "passage",
        config=CONFIG,
        code="abc",
        inputs={"measurements": tmp_path / "measured.yaml"},
    )
    attributes = read(tmp_path / "f.nc", "passage").attrs
    assert attributes["Conventions"] == "CF-1.11"
    assert attributes["source"].startswith("maglev ")
    assert json.loads(attributes["config"]) == CONFIG
    assert (attributes["seed"], attributes["code"]) == (3, "abc")
    assert attributes["input_measurements"] == (
        f"sha256:{datasets.file_hash(tmp_path / 'measured.yaml')}"
    )


def test_a_demonstration_says_so(tmp_path):
    config = CONFIG | {"demonstration": True}
    write(filled("passage"), tmp_path / "f.nc", "passage", config=config, code="abc")
    attributes = read(tmp_path / "f.nc", "passage").attrs
    assert attributes["demonstration"] == "yes"
    assert "demonstration" in attributes["title"]


def test_extremes_are_double_histories_single_and_both_compressed(tmp_path):
    write(filled("passage"), tmp_path / "f.nc", "passage", config=CONFIG, code="abc")
    with netCDF4.Dataset(tmp_path / "f.nc") as file:
        assert file["girder_displacement_z"].dtype == np.float64
        assert file["gap_history"].dtype == np.float32
        filters = file["gap_history"].filters()
        assert (filters["zlib"], filters["complevel"], filters["shuffle"]) == (True, 4, True)


def test_another_unit_is_refused():
    wrong = describe(filled("passage"))
    wrong["girder_displacement_z"].attrs["units"] = "mm"
    with pytest.raises(ValueError, match="'girder_displacement_z' must be in 'm', got 'mm'"):
        datasets.check(wrong, "passage")


def test_missing_foreign_and_misplaced_variables_are_refused():
    whole = describe(filled("passage"))
    with pytest.raises(ValueError, match="'status' is missing"):
        datasets.check(whole.drop_vars("status"), "passage")
    with pytest.raises(ValueError, match="'frequency' does not belong here"):
        datasets.check(whole.assign(frequency=("mode", [1.0])), "passage")
    with pytest.raises(ValueError, match="'colour' is no variable"):
        describe(whole.assign(colour=1.0))
    with pytest.raises(ValueError, match="must stand on"):
        describe(whole.transpose("t", ...))


def test_a_failed_write_leaves_the_old_file_and_no_debris(tmp_path):
    path = tmp_path / "f.nc"
    write(filled("passage"), path, "passage", config=CONFIG, code="abc")
    before = path.read_bytes()
    broken = filled("passage")
    broken["status"] = broken["status"].astype(object)
    broken["status"][:] = "x"
    with pytest.raises(TypeError):
        write(broken, path, "passage", config=CONFIG, code="abc")
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["f.nc"]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_files_follow_the_cf_conventions(tmp_path, layout):
    runner = pytest.importorskip("compliance_checker.runner")
    runner.CheckSuite.load_all_available_checkers()
    path = tmp_path / "f.nc"
    write(filled(layout), path, layout, config=CONFIG, code="abc")
    suite = runner.CheckSuite()
    dataset = suite.load_dataset(str(path))
    scores = suite.run_all(dataset, ["cf:1.11"])
    results, errors = scores["cf:1.11"]
    dataset.close()
    if set(filled(layout).dims) & set(WORDS):  # the checker takes differences of words too
        assert errors.pop(ORDER)[0].args[0].endswith("'str' and 'str'")
    assert not errors
    messages = [m for r in results if r.value[0] < r.value[1] for m in r.msgs]
    assert not messages
