"""Figures draw from tiny files: PNG, PDF and the numbers, byte for byte the same again."""

import numpy as np
import pytest
import xarray as xr

from maglev import datasets
from maglev.datasets import LAYOUTS, VARIABLES
from maglev.figures import FIGURES, draw

VALIDATION = (
    "irregularity",
    "deflection",
    "histories",
    "gaps",
    "modes",
    "train_modes",
    "stiffness_check",
)

SIZES = {
    "sample": 1, "car": 2, "magnet": 4, "t": 400, "x": 60, "side": 2, "mode": 6,
    "wavenumber": 20, "train_part": 9, "speed": 4, "measured_speed": 1, "beam_frequency": 30,
}  # fmt: skip


def tiny(layout):
    """A plausible small dataset of a layout."""
    rng = np.random.default_rng(1)
    names = [*LAYOUTS[layout].variables, *LAYOUTS[layout].optional]
    names = [name for name in names if "parameter" not in VARIABLES[name].dims]
    dims = {dim for name in names for dim in VARIABLES[name].dims}
    coords = {dim: np.arange(1.0, 1 + SIZES[dim]) for dim in sorted(dims)}
    if "side" in dims:
        coords["side"] = np.array([-1, 1])
    data = {}
    for name in names:
        shape = tuple(SIZES[dim] for dim in VARIABLES[name].dims)
        data[name] = (VARIABLES[name].dims, 1e-3 * (1 + rng.random(shape)))
    if layout == "passage":
        data["magnet_kind"] = (("magnet",), np.array([0, 0, 1, 1]))
        data["magnet_side"] = (("magnet",), np.array([1, -1, 1, -1]))
        data["status"] = (("sample",), np.array([0]))
        data["lost_magnet"] = (("sample",), np.array([-1]))
        data["track_seed"] = (("sample",), np.array([1]))
    if layout == "modes":
        data["direction"] = (("mode",), np.array([0, 1, 2, 3, 2, 1]))
        data["frequency"] = (("mode",), np.array([2.0, 3.0, 8.5, 20.0, 28.0, 30.0]))
    if layout == "train_modes":
        data["moves"] = (("mode",), np.array([0, 1, 4, 5, 7, 8]))
    if layout == "stiffness_check":
        data["model_frequency"] = ((), 15.0)
        data["measured_frequency"] = ((), 18.0)
    if layout == "dynamic_factor":
        data["passage_status"] = (("speed",), np.array([0, 0, 1, 0]))
    dataset = xr.Dataset(data, coords=coords)
    if layout == "dynamic_factor":
        dataset["measured_deflection"].attrs["confidence"] = "low"
    if layout in ("modes", "stiffness_check"):
        dataset["measured_frequency"].attrs["confidence"] = "low"
    return dataset


def files(tmp_path, name, demonstration=False):
    paths = []
    for layout in FIGURES[name]:
        paths.append(tmp_path / f"{layout}.nc")
        config = {"demonstration": demonstration}
        datasets.write(tiny(layout), paths[-1], layout, config=config, code="abc")
    return paths


@pytest.mark.parametrize("name", VALIDATION)
def test_a_figure_is_drawn_with_its_numbers_and_the_same_again(tmp_path, name):
    paths = files(tmp_path, name)
    for out in ("one", "two"):
        draw(name, paths, tmp_path / out)
    for ending in ("png", "pdf", "nc"):
        first = (tmp_path / f"one.{ending}").read_bytes()
        assert len(first) > 5000
        assert first == (tmp_path / f"two.{ending}").read_bytes(), ending
    with xr.open_dataset(tmp_path / "one.nc") as plotted:
        assert all(f"input_{layout}" in plotted.attrs for layout in FIGURES[name])
        assert all("long_name" in plotted[variable].attrs for variable in plotted.variables)


def test_a_demonstration_is_marked_on_the_figure(tmp_path):
    (tmp_path / "plain").mkdir()
    (tmp_path / "marked").mkdir()
    draw("irregularity", files(tmp_path / "plain", "irregularity"), tmp_path / "plain" / "f")
    marked = files(tmp_path / "marked", "irregularity", demonstration=True)
    draw("irregularity", marked, tmp_path / "marked" / "f")
    plain_png, marked_png = (tmp_path / d / "f.png" for d in ("plain", "marked"))
    assert plain_png.read_bytes() != marked_png.read_bytes()
    with xr.open_dataset(tmp_path / "marked" / "f.nc") as plotted:
        assert plotted.attrs["demonstration"] == "yes"


def test_a_passage_without_histories_cannot_be_drawn(tmp_path):
    (path,) = files(tmp_path, "gaps")
    bare = datasets.read(path, "passage").drop_vars(LAYOUTS["passage"].optional, errors="ignore")
    datasets.write(bare, path, "passage", config={}, code="abc")
    for name in ("gaps", "histories"):
        with pytest.raises(ValueError, match="the passage has no histories"):
            draw(name, [path], tmp_path / "f")


@pytest.mark.parametrize(
    ("name", "of", "words"),
    [("modes", "modes", "measured"), ("deflection", "dynamic_factor", "measured"),
     ("stiffness_check", "stiffness_check", "measured")],
)  # fmt: skip
def test_without_a_measurement_of_this_bridge_none_is_shown(tmp_path, name, of, words):
    paths = files(tmp_path, name)
    for path, layout in zip(paths, FIGURES[name], strict=True):
        if layout == of:
            optional = LAYOUTS[layout].optional
            bare = datasets.read(path, layout).drop_vars(
                [*optional, "measured_speed"], errors="ignore"
            )
            datasets.write(bare, path, layout, config={}, code="abc")
    draw(name, paths, tmp_path / "f")
    with xr.open_dataset(tmp_path / "f.nc") as plotted:
        assert not [one for one in plotted.variables if words in str(one)]
