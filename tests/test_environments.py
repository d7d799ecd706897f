"""Dependencies stand in one place, pyproject.toml; the other lists are written from it."""

import re
import runpy
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ENVIRONMENTS = runpy.run_path(str(ROOT / "workflow/scripts/environments.py"))["environments"]()
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


@pytest.mark.parametrize("path", ENVIRONMENTS, ids=lambda path: path.name)
def test_an_environment_of_conda_is_what_pyproject_says(path):
    assert path.read_text() == ENVIRONMENTS[path], "run `make docs`"


@pytest.mark.parametrize(
    ("lock", "dependencies"),
    [
        ("requirements.lock", PROJECT["dependencies"]),
        (
            "requirements-dev.lock",
            PROJECT["dependencies"] + PROJECT["optional-dependencies"]["dev"],
        ),
    ],
)
def test_a_lock_file_holds_every_dependency_at_its_bound_or_above(lock, dependencies):
    pins = re.findall(r"^([\w.-]+)==([\w.]+)", (ROOT / lock).read_text(), re.MULTILINE)
    locked = {_plain(name): _numbers(version) for name, version in pins}
    for dependency in dependencies:
        name, bound = dependency.split(">=")
        assert locked[_plain(name)] >= _numbers(bound), dependency


def _plain(name):
    return re.sub(r"[-_.]+", "-", name).lower()


def _numbers(version):
    return tuple(int(part) for part in re.findall(r"\d+", version))
