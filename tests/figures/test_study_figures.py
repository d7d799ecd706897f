"""Figures of the study draw from small files, show what those hold, and refuse what is missing."""

import json
from importlib import import_module
from io import BytesIO

import numpy as np
import pytest
import study_files
import xarray as xr
from matplotlib.figure import Figure
from numpy.testing import assert_allclose
from test_figures import VALIDATION

from maglev import datasets
from maglev.figures import (
    FIGURES,
    accuracy,
    curves,
    density,
    density_by_control,
    density_by_method,
    draw,
    exceedance,
    exceedance_by_method,
    in_time,
    labels,
    layouts_of,
    limits,
    limits_by_control,
    prediction,
    stability,
    style,
    sweep,
)
from maglev.vocabulary import PAPER_RESPONSES


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return study_files.study(tmp_path_factory.mktemp("study"))


@pytest.mark.parametrize("name", [name for name in FIGURES if name not in VALIDATION])
def test_a_figure_of_the_study_is_drawn_with_its_numbers(tmp_path, files, name):
    draw(name, files[name], tmp_path / "one")
    for ending in ("png", "pdf", "nc"):
        assert (tmp_path / f"one.{ending}").stat().st_size > 5000
    with xr.open_dataset(tmp_path / "one.nc") as plotted:
        inputs = [key for key in plotted.attrs if key.startswith("input_")]
        assert len(inputs) == len(files[name])
        for variable in plotted.variables:
            assert "long_name" in plotted[variable].attrs, variable
        assert plotted.attrs["demonstration"] == "no"


OF_RESPONSES = [
    "training", "prediction", "density_by_method", "exceedance_by_method", "exceedance",
    "density", "limits", "sweep",
    "density_by_gain", "limits_by_gain", "limits_by_variation", "sobol", "accuracy",
    "track_split", "tracks", "track_limits",
]  # fmt: skip


@pytest.mark.parametrize("name", OF_RESPONSES)
def test_a_figure_shows_whichever_responses_there_are(files, name):
    few = [PAPER_RESPONSES[4], PAPER_RESPONSES[1]]
    layouts = layouts_of(name, len(files[name]))
    paths, arguments = iter(files[name]), []
    for entry, group in zip(FIGURES[name], layouts, strict=True):
        found = [datasets.read(next(paths), layout) for layout in group]
        found = [one.sel(response=few) if "response" in one.dims else one for one in found]
        arguments.append(found if entry.endswith("*") else found[0])
    fig, plotted = import_module(f"maglev.figures.{name}").figure(*arguments)
    assert plotted["response"].to_numpy().tolist() == few
    titles = [axis.get_title(loc="left") or axis.get_title() for axis in fig.axes]
    words = " ".join(titles).replace("\n", " ")
    assert labels.shown(few[0]).name in words
    assert labels.shown(PAPER_RESPONSES[0]).name not in words


def test_any_number_of_responses_has_panels_in_rows_of_three():
    names = [*PAPER_RESPONSES, *PAPER_RESPONSES[:2]]
    data = xr.Dataset(coords={"response": names})
    fig, panels = labels.response_panels(data, 4.0)
    assert [number for number, _, _ in panels] == list(range(8))
    assert len(fig.axes) == 8
    assert panels[7][1].get_title(loc="left").startswith("(h) ")
    assert fig.get_figheight() > 4.0
    assert [labels.lowest(number, data) for number in range(8)] == [False] * 5 + [True] * 3


def test_predictions_of_more_responses_than_a_row_holds_go_on_below(files):
    (data,) = read(files["prediction"], "prediction")
    more = data.isel(response=[*range(6), 0, 1])
    fig, _ = prediction.figure(more)
    panels = [axis for axis in fig.axes if axis.get_xlabel() != "runs in a cell"]
    assert len(panels) == 3 * 8
    assert len({axis.get_ylabel() for axis in panels} - {""}) == 3
    fig.savefig(BytesIO())  # rows stand where they belong


def test_limits_stand_on_the_exceedance_with_their_probability(tmp_path, files):
    draw("exceedance", files["exceedance"], tmp_path / "f")
    n = len(files["exceedance"]) // 2
    with xr.open_dataset(tmp_path / "f.nc") as plotted:
        for number, path in enumerate(files["exceedance"][n:]):
            one = datasets.read(path, "limit_states")
            assert_allclose(plotted["curve_state_probability"][number], one["probability"])
        assert plotted["threshold"].attrs["units_by_limit_state"] == "1, m s-2, m s-2, m s-2, 1"
    densities = read(files["exceedance"][:n], "density")
    states = read(files["exceedance"][n:], "limit_states")
    fig, _ = exceedance.figure(densities, states)
    words = [[text.get_text() for text in axis.texts] for axis in fig.axes]
    assert words[2][0] == "low, 0.55 m/s²" and words[2][1] == "MCM P = 16 [12.8, 19.2] %"
    assert words[4][0] == "far, 5 m/s² →"
    assert words[0] == words[1] == words[5] == []
    with pytest.raises(ValueError, match="must be of the same methods"):
        exceedance.figure(densities, states[::-1])


def test_the_same_figure_is_the_same_bytes(tmp_path, files):
    for out in ("one", "two"):
        draw("limits_by_gain", files["limits_by_gain"], tmp_path / out)
    for ending in ("png", "pdf", "nc"):
        first, second = ((tmp_path / f"{out}.{ending}").read_bytes() for out in ("one", "two"))
        assert first == second, ending


def test_a_star_takes_as_many_files_of_each_layout():
    assert layouts_of("limits_by_gain", 4) == [("limits",) * 2, ("design",) * 2]
    assert layouts_of("training", 3) == [("accuracy",), ("design",) * 2]
    for name, n in (("limits_by_gain", 3), ("limits_by_gain", 0), ("training", 1), ("sobol", 2)):
        with pytest.raises(ValueError, match=f"figure {name} is drawn from .* got {n}"):
            layouts_of(name, n)


def test_peaks_are_compared_with_the_baseline_and_need_one(tmp_path, files):
    draw("density_by_method", files["density_by_method"], tmp_path / "f")
    with xr.open_dataset(tmp_path / "f.nc") as plotted:
        meanings = plotted["curve"].attrs["flag_meanings"].split()
        assert meanings == ["validation-mcm", "validation-osm", "validation-asm"]
        peak = plotted["curve_peak"].to_numpy()
        assert_allclose(plotted["curve_peak_error"], peak / peak[0] - 1, atol=1e-12)
    for name in ("density_by_method", "exceedance_by_method"):
        with pytest.raises(ValueError, match="no baseline"):
            draw(name, files["density_by_method"][1:], tmp_path / "g")


def test_the_exceedance_given_that_levitation_holds_stands_beside(files):
    found = curves.densities(read(files["exceedance_by_method"], "density"))
    held, lost = curves.held_exceedance(found), found["curve_lost_probability"]
    assert_allclose(held + lost * (1 - held), found["curve_exceedance"], rtol=1e-12)
    fig, plotted = exceedance_by_method.figure(read(files["exceedance_by_method"], "density"))
    assert_allclose(plotted["curve_held_exceedance"], held)
    for panel in fig.axes:
        assert [text.get_text() for text in panel.texts] == ["P(lost) = 0.3 %"]
        zorder = {line.get_label().split(",")[0]: line.get_zorder() for line in panel.get_lines()}
        assert zorder["ASM-PDEM (ours)"] < min(zorder["MCM"], zorder["OSM-PDEM"])


def test_both_motions_of_midspan_have_their_table_of_peaks(files):
    fig, plotted = density_by_method.figure(read(files["density_by_method"], "density"))
    titles = [axis.get_title(loc="left") for axis in fig.axes]
    assert titles[:2] == ["(a) midspan displacement, vert.", "(b) midspan acceleration, vert."]
    for response, table in ((0, fig.axes[2]), (2, fig.axes[3])):
        words = [text.get_text() for text in table.texts]
        scale = 1e3 if response == 0 else 1.0
        peak = float(plotted["curve_peak"][0, response]) / scale
        assert f"{peak:.3g}" in words
        assert sum("± 10.0 %" in one for one in words) == 1


def test_figures_of_a_case_need_no_baseline(files):
    only = read(files["density"][-1:], "density")
    fig, _ = density.figure(only)
    assert [text.get_text() for text in fig.legends[0].get_texts()] == [
        "ASM-PDEM (ours), 400 runs, lost 0.3 %"
    ]
    limits.figure(read(files["limits"][-1:], "limits"))
    states = read(files["exceedance"][-1:], "limit_states")
    exceedance.figure(only, states)


def test_a_baseline_that_carries_no_limit_says_so(files):
    few = read(files["limits"][:1], "limits")[0]
    for name in ("limit", "held_limit"):
        few[f"{name}_status"][:] = 1
    fig, _ = limits.figure([few])
    assert [text.get_text() for text in fig.axes[0].texts] == ["no limit: too few runs"]
    errors = datasets.read(files["accuracy"][0], "accuracy")
    errors["reference_held_limit"][0] = np.nan
    fig, _ = accuracy.figure(errors)
    assert [text.get_text() for text in fig.axes[0].texts] == ["MCM carries no limit: too few runs"]
    assert fig.axes[1].get_lines()


def test_a_sweep_has_a_line_for_each_level_or_for_each_value_of_its_second_key(files):
    one = read(files["sweep"], "sweep")[0]
    fig, _ = sweep.figure(one)
    panel = fig.axes[1]
    mean = panel.get_lines()[-1]
    assert panel.get_xlabel() == "passage speed [km/h]"
    assert_allclose(mean.get_xdata(), [300, 400, 500])
    assert_allclose(mean.get_ydata(), 1e3 * one["extreme_at_mean"][:, 1])
    assert len(panel.get_lines()) == 2 * len(study_files.LEVELS) + 1
    states = [line.get_label() for line in fig.axes[6].get_lines()]
    assert states == ["lost", "low", "high", "far", "either"]
    two = datasets.describe(study_files.sweep(others=["pole", "ends"]))
    fig, _ = sweep.figure(two.assign_attrs(config=one.attrs["config"]))
    assert len(fig.axes) == 6 + 5
    lines = fig.axes[1].get_lines()
    assert [len(line.get_xdata()) for line in lines] == [3] * (2 * 3)
    words = [text.get_text() for text in fig.legends[0].get_texts()]
    assert words[:3] == ["suspension group: pole", "suspension group: ends", "limit at 0.1"]


def test_a_swept_key_has_the_unit_in_which_it_is_written_and_a_speed_that_of_a_person():
    def axis(key, values, texts, unit):
        dims = ("setting", "swept_parameter")
        units = {"units_by_swept_parameter": unit}
        data = xr.Dataset(
            {"swept_value": (dims, np.array(values)[:, None], units),
             "swept_text": (dims, np.array(texts)[:, None])},
            coords={"swept_parameter": [key]},
        )  # fmt: skip
        return sweep._axis(data, 0)

    speed = axis("passage.speed", [100.0, 150.0], ["100 m/s", "540 km/h"], "m/s")
    assert speed.label == "passage speed [km/h]"
    assert_allclose(speed.places, [360, 540])
    lag = axis("control.suspension.lag", [0.001, 0.002], ["1 ms", "2 ms"], "s")
    assert lag.label == "suspension lag [ms]"
    assert_allclose(lag.places, [1, 2])
    mixed = axis("control.suspension.lag", [0.001, 0.002], ["1 ms", "0.002 s"], "s")
    assert mixed.label == "suspension lag [s]"
    group = axis("control.suspension.group", [np.nan] * 2, ["pole", "ends"], "")
    assert (group.words, group.places.tolist()) == (("pole", "ends"), [0, 1])


def read(paths, layout):
    return [datasets.read(path, layout) for path in paths]


def test_where_losses_are_likelier_only_the_limit_given_levitation_is_shown(files):
    paths = files["limits_by_variation"]
    found = curves.limits(read(paths[: len(paths) // 2], "limits"))
    lost = found["curve_lost_probability"].to_numpy()
    likelier = lost[:, None] > np.array(study_files.LEVELS)
    at = curves.in_shown_unit(found, 0)
    np.testing.assert_array_equal(np.isinf(at["curve_limit"]), likelier)
    assert np.isfinite(at["curve_held_limit"]).all()
    assert_allclose(at["curve_held_limit"], 1e3 * found["curve_held_limit"].isel(response=0))
    assert curves.differ(found)
    axis = Figure().subplots()
    one = at.isel(curve=0)  # two of three levels have no limit
    curves.draw_limits(axis, np.arange(3.0), one, {"color": "#000000", "ls": "-", "marker": "o"})
    shown = [len(line.get_xdata()) for line in axis.get_lines() if line.get_marker() == "o"]
    assert shown == [3, int(np.isfinite(one["curve_limit"]).sum())]


def test_a_limit_that_the_sample_does_not_carry_is_not_shown(files):
    (one,) = read(files["limits_by_gain"][:1], "limits")
    one["limit_status"][0, 0] = 1
    assert np.isnan(curves.limits([one])["curve_limit"][0, 0, 0])


def test_cases_are_put_in_order_of_their_variation(tmp_path, files):
    draw("limits_by_variation", files["limits_by_variation"], tmp_path / "f")
    with xr.open_dataset(tmp_path / "f.nc") as plotted:
        assert_allclose(plotted["curve_variation"], [0.04, 0.1, 0.14])
        assert_allclose(plotted["curve_lost_probability"], [0.0, 0.003, 0.02])


def test_the_error_of_a_round_stands_at_the_runs_before_it(tmp_path, files):
    draw("training", files["training"], tmp_path / "f")
    design = datasets.read(files["training"][2], "design")
    with xr.open_dataset(tmp_path / "f.nc") as plotted:
        asm = plotted.isel(curve=1)
        np.testing.assert_array_equal(asm["curve_round_n_runs"], design["round_n_runs"])
        assert_allclose(asm["curve_error"][:-1], design["error"][1:])
        assert np.isnan(asm["curve_error"][-1]).all()


def test_a_range_holds_the_body_and_leaves_out_the_tail(files):
    found = curves.densities(read(files["density_by_method"][:1], "density"))
    low, high = curves.body(found, 2, 5e-3)
    width = study_files.WIDTH[2]
    assert study_files.CENTRE[2] - 4.5 * width < low < study_files.CENTRE[2] - 2.3 * width
    assert study_files.CENTRE[2] + 2.3 * width < high < study_files.CENTRE[2] + 4.5 * width


def second_far_away(paths, layout, variables):
    """Files of which the second has values that lie 1 m/s² above those of the others."""
    found = read(paths, layout)
    for name in variables:
        found[1][name][:] = found[1][name] + 1.0
    return found


def test_a_density_far_from_all_others_is_noted_and_does_not_squeeze_them(files):
    paths = files["density_by_control"]
    n = len(paths) // 2
    densities = second_far_away(paths[:n], "density", ["value"])
    far = curves.apart(curves.densities(densities), 2)
    assert far.tolist() == [k == 1 for k in range(n)]
    fig, _ = density_by_control.figure(densities, read(paths[n:], "design"))
    panel = fig.axes[2]
    assert panel.get_xlim()[1] < study_files.CENTRE[2] + 0.5
    assert len(panel.get_lines()) == n - 1
    (note,) = (text.get_text() for text in panel.texts)
    assert note.startswith("off the panel: 1.")


def test_limits_far_from_all_others_are_noted_and_do_not_squeeze_them(files):
    paths = files["limits_by_control"]
    n = len(paths) // 2
    names = [f"{kind}limit{end}" for kind in ("", "held_") for end in ("", "_low", "_high")]
    found = second_far_away(paths[:n], "limits", names)
    fig, _ = limits_by_control.figure(found, read(paths[n:], "design"))
    panel = fig.axes[2]
    assert panel.get_ylim()[1] < study_files.CENTRE[2] + 0.7
    assert [text.get_text()[:14] for text in panel.texts] == ["off the panel:"]


def test_the_shading_of_the_map_ends_at_the_border_that_parts_it(files):
    border, runs = (
        datasets.read(path, layout)
        for path, layout in zip(files["stability"], ("stability", "runs"), strict=True)
    )
    x = border["grid_proportional"].to_numpy()
    middle = 0.5 * (x[3] + x[4])
    border["growth_rate"][:] = np.where(x < middle, 1.0, -1.0)
    for parted in (True, False):
        border["proportional_border"][0] = middle if parted else x[1]
        border["proportional_border"][1] = np.nan
        chart = stability.figure(border, runs)[0].axes[0]
        clips = [one.get_clip_path() for one in chart.collections]
        ends = [path.get_fully_transformed_path() for path in clips if path is not None]
        edges = [chart.transData.inverted().transform(end.vertices)[:, 0].max() for end in ends]
        assert (np.isclose(edges, middle).any()) == parted


def test_shares_are_written_with_two_digits():
    assert [labels.percent(one) for one in (0.0, 0.0031, 0.25)] == ["0 %", "0.31 %", "25 %"]
    assert labels.percent(1e-7) == "< 0.001 %"


def test_circuits_are_told_apart_by_their_words():
    def words(suspension, guidance=None):
        control = study_files.circuits(**suspension)
        control["guidance"] = study_files.circuits(
            **(suspension if guidance is None else guidance)
        )["guidance"]
        text = json.dumps({"control": control})
        return labels.control_style(xr.Dataset(attrs={"config": text}))[0]

    assert words({}) == "a circuit a pole"
    assert words({"lag": "0.002 s"}) == "a circuit a pole, 2 ms of lag"
    assert words({"group": "half"}, {}) == "suspension half; guidance pole"
    with pytest.raises(ValueError, match="must say how its circuits"):
        labels.control_style(xr.Dataset())


def test_a_run_that_was_not_judged_is_marked_and_not_counted_as_lost(files):
    border, runs = (
        datasets.read(path, layout)
        for path, layout in zip(files["stability"], ("stability", "runs"), strict=True)
    )
    runs["status"][:] = 0
    runs["status"][:3] = [1, 4, 4]
    fig, _ = stability.figure(border, runs)
    chart, count = fig.axes[0], next(axis for axis in fig.axes if axis.get_ylabel() == "runs")
    assert {"lost: contact", "not judged: step too large"} <= set(
        chart.get_legend_handles_labels()[1]
    )
    assert count.get_title(loc="left").startswith("(b) lost 1 of")


def test_a_response_in_time_has_three_panels_and_its_errors_are_said(files):
    data = datasets.read(files["in_time"][0], "density_in_time")
    data["reliability_error"][:] = -0.004
    fig, plotted = in_time.figure(data.isel(response=[0]))
    assert fig.get_size_inches()[0] == style.COLUMN
    titles = [axis.get_title(loc="left") for axis in fig.axes]
    assert titles[:3] == [
        "(a) midspan displacement, vert.",
        "(b) density about the mean",
        "(c) failure by first passage, 1 - R(t)",
    ]
    words = [text.get_text() for text in fig.axes[2].get_legend().get_texts()]
    assert words[0] == f"{1.1e3 * study_files.CENTRE[0]:.4g} mm (0.1), error +0.004"
    # nothing is known of the extreme beyond the last barrier: no circle
    circles = [line for line in fig.axes[2].get_lines() if line.get_marker() == "o"]
    assert len(circles) == 2
    xr.testing.assert_identical(plotted, data.isel(response=[0]))
    fig, _ = in_time.figure(data)  # the third leaves the place of a fourth empty
    assert len([axis for axis in fig.axes if axis.get_title(loc="left")]) == 9


def test_a_figure_says_of_which_track_its_numbers_are(tmp_path, files):
    figure = Figure()
    style.say_track(figure, "track of seed 7")
    assert figure.get_suptitle() == "track of seed 7"
