"""The examples in docstrings run and give what they say; what users call has one."""

import doctest
import importlib
import inspect
import pkgutil

import numba
import pytest

import maglev
from maglev import uncertainty

MODULES = [one.name for one in pkgutil.walk_packages(maglev.__path__, "maglev.") if not one.ispkg]

FOR_USERS = [
    f"maglev.{name}" for name in ("config", "fingerprint", "measurements", "profiles", "stage")
]
FOR_USERS += [
    f"maglev.mechanics.{name}"
    for name in (
        "bodies",
        "comfort",
        "control",
        "course",
        "guideway",
        "irregularity",
        "linear",
        "moving_load",
        "responses",
        "statics",
        "timoshenko",
        "train",
    )
]
FOR_USERS += [
    f"maglev.uncertainty.{one.name}"
    for one in pkgutil.iter_modules(uncertainty.__path__)
    if not one.name.startswith("_")
]


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_give_what_they_say(name):
    if numba.config.DISABLE_JIT and name == "maglev.simulation":
        pytest.skip("a passage takes minutes in plain Python")
    assert doctest.testmod(importlib.import_module(name)).failed == 0


@pytest.mark.parametrize("name", FOR_USERS)
def test_what_users_call_carries_an_example(name):
    module = importlib.import_module(name)
    functions = [
        one
        for key, one in inspect.getmembers(module, inspect.isfunction)
        if one.__module__ == name and not key.startswith("_")
    ]
    without = [one.__name__ for one in functions if ">>>" not in inspect.getdoc(one)]
    assert not without
    assert all(">>>" in inspect.getdoc(one) for one in (maglev.simulate, maglev.load_config))
