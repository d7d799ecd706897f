"""The command line: a user's mistake ends in one sentence, never in a traceback."""

import subprocess
import sys

import pytest
from click.testing import CliRunner

from maglev.cli import main


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
