"""Measured profiles: read as written, and refused with one clear sentence."""

import netCDF4
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from maglev import profiles
from maglev.mechanics.irregularity import PROFILE_NAMES

X = np.array([0.0, 0.25, 0.5, 1.0])
COLUMNS = {"x": X, "vertical": 1e-3 * X, "lateral": -2e-3 * X, "vertical_left": 3e-3 * X**2}


def write_csv(path, columns, header="# measured by nobody\n"):
    rows = [",".join(f"{value!r}" for value in row) for row in
            np.array(list(columns.values())).T.tolist()]  # fmt: skip
    path.write_text(header + ", ".join(columns) + "\n" + "\n".join(rows) + "\n")
    return path


def write_netcdf(path, columns, units="m"):
    with netCDF4.Dataset(path, "w") as dataset:
        dataset.createDimension("x", len(columns["x"]))
        for name, values in columns.items():
            variable = dataset.createVariable(name, "f8", ("x",), fill_value=-999.0)
            variable.units = units
            variable[:] = values
    return path


WRITERS = {"track.csv": write_csv, "track.nc": write_netcdf}


@pytest.mark.parametrize("name", WRITERS)
def test_columns_come_back_as_written(tmp_path, name):
    measured = profiles.read(WRITERS[name](tmp_path / name, COLUMNS))
    rows = dict(zip(PROFILE_NAMES, measured.displacement, strict=True))
    assert_array_equal(measured.x, X)
    assert_array_equal(rows["vertical_right"], COLUMNS["vertical"])
    assert_array_equal(rows["vertical_left"], COLUMNS["vertical_left"])
    assert_array_equal(rows["lateral_right"], COLUMNS["lateral"])
    assert_array_equal(rows["lateral_left"], COLUMNS["lateral"])


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lateral": None}, "must have the columns x, vertical, lateral; missing: lateral"),
        ({"vertical": np.array([0, np.nan, 0, 0])}, "vertical must be finite, got nan in row 2"),
        ({"x": np.array([0, 0.5, 0.5, 1])}, "x must rise .*, got 0.5 then 0.5 m in rows 2 and 3"),
        ({"x": np.array([0, 0.5, 0.4, 1])}, "x must rise .*, got 0.5 then 0.4 m in rows 2 and 3"),
    ],
)
def test_a_spoilt_file_is_refused(tmp_path, name, change, message):
    columns = {key: value for key, value in (COLUMNS | change).items() if value is not None}
    with pytest.raises(ValueError, match=message) as caught:
        profiles.read(WRITERS[name](tmp_path / name, columns))
    assert name in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"nowhere\.csv does not exist"):
        profiles.read(tmp_path / "nowhere.csv")


def test_text_among_the_numbers_is_named(tmp_path):
    path = tmp_path / "track.csv"
    path.write_text("x,vertical,lateral\n0,0,0\n1,high,0\n")
    with pytest.raises(ValueError, match="column vertical must hold numbers, got 'high' in row 2"):
        profiles.read(path)
    path.write_text("x,vertical,lateral\n0,0,0\n1,0\n")
    with pytest.raises(ValueError, match="column lateral must hold numbers, got nothing in row 2"):
        profiles.read(path)


@pytest.mark.parametrize("text", ["", "x,vertical,lateral\n", "x,vertical,lateral\n0,0,0\n"])
def test_a_file_without_rows_is_refused(tmp_path, text):
    path = tmp_path / "track.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=r"two rows or more|must have the columns"):
        profiles.read(path)


def test_a_netcdf_file_in_another_unit_is_refused(tmp_path):
    path = write_netcdf(tmp_path / "track.nc", COLUMNS, units="mm")
    with pytest.raises(ValueError, match="variable x must be in 'm', got 'mm'"):
        profiles.read(path)


def test_masked_values_of_a_netcdf_file_are_refused(tmp_path):
    columns = COLUMNS | {"lateral": np.array([0.0, 0.0, -999.0, 0.0])}
    with pytest.raises(ValueError, match="column lateral must be finite, got nan in row 3"):
        profiles.read(write_netcdf(tmp_path / "track.nc", columns))


def test_a_netcdf_variable_over_two_dimensions_is_refused(tmp_path):
    path = write_netcdf(tmp_path / "track.nc", {key: COLUMNS[key] for key in ("x", "vertical")})
    with netCDF4.Dataset(path, "a") as dataset:
        dataset.createDimension("side", 2)
        dataset.createVariable("lateral", "f8", ("x", "side"))[:] = 0.0
    with pytest.raises(ValueError, match=r"column lateral must have one value per x, got shape"):
        profiles.read(path)


def test_a_file_that_is_no_netcdf_is_refused(tmp_path):
    path = tmp_path / "track.nc"
    path.write_text("x,vertical,lateral\n0,0,0\n")
    with pytest.raises(ValueError, match="cannot be read as NetCDF"):
        profiles.read(path)
