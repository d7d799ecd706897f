"""The command line: a user's mistake ends in one sentence, never in a traceback."""

import errno
import os
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner

from maglev.cli import _of_track, main


@pytest.fixture(autouse=True)
def _at_the_root(pytestconfig, monkeypatch):
    monkeypatch.chdir(pytestconfig.rootpath)


def failure(*arguments):
    """Exit code and the only line on standard error."""
    result = CliRunner().invoke(main, list(arguments))
    assert isinstance(result.exception, SystemExit), result.exception
    (line,) = result.stderr.splitlines()
    return result.exit_code, line


def test_a_mistake_in_the_configuration_is_exit_code_2(tmp_path):
    (tmp_path / "bad.yaml").write_text("passage: {sped: 430 km/h}\n")
    assert failure("config", str(tmp_path / "bad.yaml")) == (
        2,
        "Error: passage.sped is not a known key of passage; did you mean 'speed'?",
    )


def test_a_missing_configuration_is_named(tmp_path):
    code, line = failure("config", str(tmp_path / "none.yaml"))
    assert code == 2
    assert line.endswith("none.yaml cannot be read: no such file or directory")


def test_missing_measurements_are_found_before_anything_is_computed(tmp_path):
    (tmp_path / "c.yaml").write_text("validation: {measurements: none.yaml}\n")
    code, line = failure(
        "dynamic-factor", "--config", str(tmp_path / "c.yaml"), "--store", str(tmp_path / "store"),
        "--out", str(tmp_path / "out.nc"),
    )  # fmt: skip
    assert code == 2
    assert "validation.measurements names a file that does not exist" in line
    assert not (tmp_path / "store").exists()


def test_a_missing_input_of_a_figure_is_exit_code_1(tmp_path):
    out = str(tmp_path / "figure")
    code, line = failure("figure", "modes", str(tmp_path / "none.nc"), "--out", out)
    assert (code, line) == (1, f"Error: there is no file {tmp_path / 'none.nc'}")


def test_too_few_inputs_of_a_figure_are_counted(tmp_path):
    out = str(tmp_path / "figure")
    code, line = failure("figure", "deflection", "a.nc", "--out", out)
    assert code == 1
    assert "drawn from 2 files (deflection, dynamic_factor), got 1" in line


def test_the_traceback_is_there_for_who_asks(tmp_path):
    result = CliRunner().invoke(main, ["--traceback", "config", str(tmp_path / "none.yaml")])
    assert isinstance(result.exception, ValueError)


def test_the_configuration_is_printed_in_si_with_units():
    result = CliRunner().invoke(main, ["config", "config/quick.yaml"])
    assert result.exit_code == 0
    assert "  speed: 119.44444444444444 m/s\n" in result.stdout


def test_help_does_not_wait_for_compiled_parts():
    code = "import maglev.cli, sys; assert not {'numba', 'xarray', 'scipy'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_fault_of_the_program_shows_its_traceback(monkeypatch, tmp_path):
    def faulty(*_):
        np.zeros(3).reshape(2, 2)

    monkeypatch.setattr("maglev.figures.draw", faulty)
    given = ["figure", "modes", "a.nc", "--out", str(tmp_path / "figure")]
    result = CliRunner().invoke(main, given)
    assert isinstance(result.exception, ValueError)
    assert "cannot reshape" in str(result.exception)
    assert "Error:" not in result.output


def test_a_file_that_must_not_be_read_is_named_in_one_line(monkeypatch, tmp_path):
    def forbidden(*_):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), "a.nc")

    monkeypatch.setattr("maglev.figures.draw", forbidden)
    code, line = failure("figure", "modes", "a.nc", "--out", str(tmp_path / "figure"))
    assert (code, line) == (1, "Error: a.nc: permission denied")


def test_a_file_of_another_kind_is_refused_in_one_line(tmp_path):
    (tmp_path / "a.nc").write_text("text")
    given = ("figure", "modes", str(tmp_path / "a.nc"), "--out", str(tmp_path / "figure"))
    code, line = failure(*given)
    assert code == 1
    assert f"{tmp_path / 'a.nc'} cannot be read as NetCDF" in line


def test_a_file_names_the_track_of_what_it_is_made_of():
    one, other, none = (xr.Dataset(attrs=a) for a in ({"track": "a"}, {"track": "b"}, {}))
    assert _of_track({"design": one, "limits": {"x": one, "y": none}}) == {"track": "a"}
    assert _of_track({"limits": {"x": one, "y": other}}) == {"track": "a; b"}
    assert _of_track({"points": none}) == {}
