"""The examples in docstrings run and give what they say."""

import doctest
import importlib
import pkgutil

import pytest

import maglev

MODULES = [one.name for one in pkgutil.walk_packages(maglev.__path__, "maglev.") if not one.ispkg]


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_give_what_they_say(name):
    assert doctest.testmod(importlib.import_module(name)).failed == 0
