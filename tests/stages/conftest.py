"""What several tests of stages start from."""

import pytest
from formula_train import FormulaTrain

from maglev.stages import runs


@pytest.fixture
def train(monkeypatch):
    """A train that is a formula in place of the model, in batches of eight runs."""
    one = FormulaTrain()
    monkeypatch.setattr(runs, "simulate", one)
    monkeypatch.setattr(runs, "BATCH", 8)
    return one


@pytest.fixture
def in_config_folder(pytestconfig, monkeypatch):
    """Names of files in the configuration are relative to the folder that holds it."""
    monkeypatch.chdir(pytestconfig.rootpath / "config")
