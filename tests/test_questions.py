"""The examples of the configuration: each is planned whole, and the largest is run small."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
import xarray as xr
import yaml

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted(path.stem for path in (ROOT / "config" / "examples").glob("*.yaml"))

SMALL = {
    "train": {"n_cars": 1},
    "guideway": {"n_spans": 2},
    "irregularity": {"n_harmonics": 100},
    "study": {
        "n_representative": 16,
        "n_population": 512,
        "n_counting": 16384,
        "mcm": {"n_samples": 16, "chunk_size": 16},
        "asm": {"n_initial": 16, "n_candidates": 64, "n_largest": 16, "batch_size": 4},
    },
}


def snakemake(folder, *arguments):
    """Exit code and everything printed."""
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")}
    done = subprocess.run(
        ["snakemake", *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A copy of the workflow, with an overlay that makes any example small."""
    copy = tmp_path_factory.mktemp("examples")
    for part in ("Snakefile", "profiles", "workflow", "config", "src"):
        source = ROOT / part
        if source.is_dir():
            shutil.copytree(source, copy / part, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, copy / part)
    (copy / "config" / "small.yaml").write_text(yaml.safe_dump(SMALL))
    return copy


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_planned_whole(folder, name):
    code, text = snakemake(folder, "all", "-n", "--configfile", f"config/examples/{name}.yaml")
    assert code == 0, text
    assert "limit_states" in text


def test_twelve_random_quantities_on_random_tracks_give_limit_states(folder):
    found = "results/line_and_train/line_and_train/mcm/limit_states.nc"
    code, text = snakemake(
        folder,
        found,
        "--cores",
        "1",
        "--configfile",
        "config/examples/line_and_train.yaml",
        "config/small.yaml",
    )
    assert code == 0, text
    with xr.open_dataset(folder / found) as states:
        probability = states["probability"].sel(limit_state="suspension gap")
        assert 0.0 <= float(probability) <= 1.0
        assert (
            float(states["probability_high"].sel(limit_state="lost")) > 0.1
        )  # 16 runs tell little
    with xr.open_dataset(folder / found.replace("/limit_states.nc", ".nc")) as runs:
        assert runs.sizes["parameter"] == 12
        mass = runs["parameter_value"].sel(parameter="train.car_body.mass")
        assert 29e3 <= float(mass.min()) and float(mass.max()) <= 39e3
        assert len(set(runs["track_seed"].to_numpy().tolist())) == 16
