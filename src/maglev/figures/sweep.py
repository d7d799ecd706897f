"""Limits, extremes at the mean and probabilities of limit states along one or two swept keys."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from string import ascii_lowercase

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from maglev.arrays import FloatArray
from maglev.figures import labels, style
from maglev.vocabulary import GIVEN, LIMIT_STATUS

_ENDS = ("", "_low", "_high")
_GIVEN = LIMIT_STATUS.index(GIVEN)
_ROW = 1.95
"""Height of a row of panels [inch]."""

_FLOOR = 1e-9
"""Probabilities below are left out of a panel."""


@dataclass(frozen=True)
class _Axis:
    """A swept key as an axis: its label, the places of the settings, and words where no number is.

    Parameters
    ----------
    label
        The key in short with the unit of a person.
    places : (setting,)
        Value of each setting in that unit, or the number of its word.
    words
        Words at the places 0, 1, …; empty for numbers.
    """

    label: str
    places: FloatArray
    words: tuple[str, ...] = ()

    def name(self, place: float) -> str:
        """A value in words."""
        return self.words[int(place)] if self.words else f"{place:.6g}"


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw every response and the limit states over the first swept key, a line for each second.

    With one key, a panel holds the limits at all failure probabilities; with two, the limit at the
    largest of them.

    Parameters
    ----------
    data
        Layout ``sweep``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    axes_of = [_axis(data, number) for number in range(data.sizes["swept_parameter"])]
    x, second = axes_of[0], axes_of[1] if len(axes_of) > 1 else None
    names = [labels.shown(str(one)) for one in data["response"].to_numpy()]
    n_last = 1 if second is None else data.sizes["limit_state"]
    n_panels = len(names) + n_last
    rows = -(-n_panels // labels.COLUMNS)
    fig, panels = style.panels(rows, labels.COLUMNS, style.PAGE, 0.7 + _ROW * rows)
    for axis in panels[n_panels:]:
        axis.remove()
    for response, shown in enumerate(names):
        axis = panels[response]
        style.titled(axis, ascii_lowercase[response], shown.name)
        draw = _draw_levels if second is None else _draw_families(second)
        draw(axis, data.isel(response=response), shown, x.places)
        axis.set_ylabel(shown.axis)
    last = panels[len(names) : n_panels]
    if second is None:
        style.titled(last[0], ascii_lowercase[len(names)], "limit states")
        _draw_states(last[0], data, x.places)
        if n_panels % labels.COLUMNS:
            beside = last[0].legend(fontsize=6.5, loc="upper left", bbox_to_anchor=(1.02, 1.0))
            beside.set_in_layout(False)  # it stands where there is no panel
        else:
            last[0].legend(fontsize=6.5)
    else:
        for k, axis in enumerate(last):
            state = data.isel(limit_state=k)
            style.titled(axis, ascii_lowercase[len(names) + k], str(state["limit_state"].item()))
            _draw_state_families(axis, state, x, second)
    for axis in panels[:n_panels]:
        _along(axis, x)
    handles, words = _legend(data, second)
    method = data.attrs.get("method", "")
    title = f"by {labels.METHOD.get(method, method)}; bands: {labels.confidence(data)}"
    style.below(fig, handles, words, columns=3, title=f"{title} intervals")
    return fig, data


def _axis(data: xr.Dataset, number: int) -> _Axis:
    """A swept key as an axis: a speed in km/h, all else in the unit in which it is written."""
    key = str(data["swept_parameter"].to_numpy()[number])
    name = labels.parameter_name(key)
    values = data["swept_value"].to_numpy()[:, number]
    texts = [str(one) for one in data["swept_text"].to_numpy()[:, number]]
    if not np.isfinite(values).all():
        words = tuple(dict.fromkeys(texts))
        return _Axis(name, np.array([float(words.index(one)) for one in texts]), words)
    unit = data["swept_value"].attrs.get("units_by_swept_parameter", "1").split(", ")[number]
    if unit == "m/s":
        return _Axis(f"{name} [km/h]", style.KMH * values)
    written = [re.fullmatch(r"\s*(\S+)\s+(\S.*?)\s*", one) for one in texts]
    units = {one[2] for one in written if one is not None}
    if all(written) and len(units) == 1:
        in_unit = np.array([float(one[1]) for one in written if one is not None])
        return _Axis(f"{name} [{units.pop()}]", in_unit)
    return _Axis(f"{name} [{'-' if unit == '1' else unit}]", values)


def _along(axis: Axes, x: _Axis) -> None:
    """Label the axis of the swept key."""
    axis.set_xlabel(x.label)
    if x.words:
        axis.set_xticks(range(len(x.words)), x.words)
    else:
        axis.locator_params(axis="x", nbins=5)


def _level_colours(n: int) -> list[str]:
    """Colours of failure probabilities, the darker the rarer."""
    return [to_hex(colormaps["Blues"](share)) for share in np.linspace(0.45, 0.95, n)]


def _second_colours(second: _Axis) -> dict[float, str]:
    """Colour of each value of the second key."""
    values = np.unique(second.places)
    shades = colormaps["viridis"](np.linspace(0.0, 0.85, values.size))
    return {float(value): to_hex(shade) for value, shade in zip(values, shades, strict=True)}


def _given(at: xr.Dataset, prefix: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A limit with the ends of its interval, NaN where there is none."""
    given = at[f"{prefix}limit_status"].to_numpy() == _GIVEN
    middle, low, high = (np.where(given, at[f"{prefix}limit{end}"], np.nan) for end in _ENDS)
    return middle, low, high


def _draw_limit(axis: Axes, x: FloatArray, at: xr.Dataset, scale: float, look: style.Look) -> None:
    """Draw one limit along the sweep: a line given that levitation holds, dots of all passages."""
    order = np.argsort(x)
    middle, low, high = (scale * one[order] for one in _given(at, "held_"))
    colour = look["color"]
    bounded = np.where(np.isinf(high), np.nan, high)
    axis.fill_between(x[order], low, bounded, color=colour, alpha=0.15, lw=0)
    axis.plot(x[order], middle, color=colour, lw=1.1, marker="o", ms=3.5, mfc="white")
    axis.plot(x[order], scale * _given(at, "")[0][order], "o", ms=3.5, color=colour)
    for k in np.flatnonzero(np.isinf(high) & np.isfinite(middle)):
        axis.plot(x[order][k], middle[k], marker="^", ms=6, color=colour, mfc="none", mew=0.6)


def _draw_mean(axis: Axes, x: FloatArray, extreme: FloatArray, look: style.Look) -> None:
    """Draw the extreme at the mean along the sweep."""
    order = np.argsort(x)
    axis.plot(x[order], extreme[order], ls="--", lw=1.0, marker="x", ms=3.5, color=look["color"])


def _draw_levels(axis: Axes, at: xr.Dataset, shown: labels.Shown, x: FloatArray) -> None:
    """Draw the limits of a response at every failure probability."""
    for level, colour in enumerate(_level_colours(at.sizes["failure_probability"])):
        one = at.isel(failure_probability=level)
        _draw_limit(axis, x, one, shown.scale, {"color": colour})
    extreme = shown.scale * at["extreme_at_mean"].to_numpy()
    _draw_mean(axis, x, extreme, {"color": style.REFERENCE})


def _draw_families(second: _Axis) -> Callable[[Axes, xr.Dataset, labels.Shown, FloatArray], None]:
    """Function that draws the likeliest limit of a response, a line for each second value."""

    def draw(axis: Axes, at: xr.Dataset, shown: labels.Shown, x: FloatArray) -> None:
        level = int(np.argmax(at["failure_probability"].to_numpy()))
        for value, colour in _second_colours(second).items():
            of_value = np.flatnonzero(second.places == value)
            one = at.isel(failure_probability=level, setting=of_value)
            _draw_limit(axis, x[of_value], one, shown.scale, {"color": colour})
            extreme = shown.scale * one["extreme_at_mean"].to_numpy()
            _draw_mean(axis, x[of_value], extreme, {"color": colour})

    return draw


_STATE_COLOURS = ("#000000", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_STATE_MARKERS = ("x", "o", "s", "^", "D", "v", "P")


def _draw_states(axis: Axes, data: xr.Dataset, x: FloatArray) -> None:
    """Draw the probability of every limit state along the sweep."""
    for k in range(data.sizes["limit_state"]):
        state = data.isel(limit_state=k)
        look: style.Look = {
            "color": _STATE_COLOURS[k % len(_STATE_COLOURS)],
            "marker": _STATE_MARKERS[k % len(_STATE_MARKERS)],
            "label": str(state["limit_state"].item()),
        }
        _draw_probability(axis, x, state, look)
    _log_from(axis, data)
    axis.set_ylabel("P of a passage [-]")


def _draw_state_families(axis: Axes, state: xr.Dataset, x: _Axis, second: _Axis) -> None:
    """Draw the probability of one limit state, a line for each second value."""
    for value, colour in _second_colours(second).items():
        of_value = np.flatnonzero(second.places == value)
        look: style.Look = {"color": colour, "marker": "o"}
        _draw_probability(axis, x.places[of_value], state.isel(setting=of_value), look)
    _log_from(axis, state)
    axis.set_ylabel("P of a passage [-]")


def _draw_probability(axis: Axes, x: FloatArray, state: xr.Dataset, look: style.Look) -> None:
    """Draw the probability of a limit state with its interval."""
    order = np.argsort(x)
    value, low, high = (state[f"probability{end}"].to_numpy()[order] for end in _ENDS)
    axis.fill_between(x[order], low.clip(min=_FLOOR), high, color=look["color"], alpha=0.1, lw=0)
    line: style.Look = {**look, "ms": 3.5, "lw": 1.0}
    axis.plot(x[order], np.where(value > 0, value, np.nan), **line)


def _log_from(axis: Axes, data: xr.Dataset) -> None:
    """Let probabilities run from below the least that is not zero, or upper end, to one."""
    ends = np.concatenate([data[f"probability{end}"].to_numpy().ravel() for end in ("", "_high")])
    axis.set_yscale("log")
    axis.set_ylim(0.3 * max(float(ends[ends > 0].min(initial=1.0)), _FLOOR), 1.5)


def _legend(data: xr.Dataset, second: _Axis | None) -> tuple[Sequence[Line2D], list[str]]:
    """Handles and words of what all panels share."""
    quiet = style.QUIET if second is not None else style.REFERENCE
    levels = data["failure_probability"].to_numpy()
    if second is None:
        colours = _level_colours(levels.size)
        lines = [Line2D([], [], color=one, marker="o", ms=3.5, mfc="white") for one in colours]
        words = [f"limit at {level:g}" for level in levels]
    else:
        of_value = _second_colours(second)
        lines = [Line2D([], [], color=one, marker="o", ms=3.5) for one in of_value.values()]
        words = [f"{second.label}: {second.name(value)}" for value in of_value]
        lines.append(Line2D([], [], color=quiet, marker="o", ms=3.5, mfc="white"))
        words.append(f"limit at {levels.max():g}")
    lines.append(Line2D([], [], color=quiet, ls="--", marker="x", ms=3.5))
    words.append("extreme at the mean")
    lines.append(Line2D([], [], color=style.QUIET, ls="", marker="o", ms=3.5, mfc="white"))
    words.append("line, hollow: given that levitation holds; filled: of all passages")
    if np.isinf(_given(data, "held_")[2]).any():
        lines.append(Line2D([], [], color=style.QUIET, ls="", marker="^", ms=6, mfc="none"))
        words.append("interval without an upper end")
    return lines, words
