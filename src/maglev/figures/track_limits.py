"""Limits of the extremes on each of many tracks, and of the line, with their intervals."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from maglev.arrays import FloatArray
from maglev.figures import labels, style
from maglev.vocabulary import GIVEN, LIMIT_STATUS

_GIVEN = LIMIT_STATUS.index(GIVEN)
_TRACK: style.Look = {"ls": "", "marker": ".", "ms": 3.5, "color": "#7f7f7f", "mew": 0}
_SEED: style.Look = {"ls": "", "marker": "o", "ms": 3.5, "color": style.MODEL}
_LINE: style.Look = {"ls": "", "marker": "D", "ms": 4, "color": "#000000", "mfc": "white"}
_APART = 0.28


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw the limits of every track side by side, a group for each failure probability.

    Parameters
    ----------
    data
        Layout ``line``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    n, seed = data.sizes["track"], int(data["seed_of_track"][0])
    levels = data["failure_probability"].to_numpy()
    fig, panels = labels.response_panels(data, 4.9)
    for response, axis, shown in panels:
        at = data.isel(response=response)
        for column in range(levels.size):
            one = at.isel(failure_probability=column)
            limit = shown.scale * one["held_limit_on_track"].to_numpy()
            rank = np.argsort(np.argsort(limit[1:]))
            spread = column + _APART * (2.0 * rank / max(n - 2, 1) - 1.0) * 0.75
            axis.plot(spread, limit[1:], **_TRACK)
            _with_interval(axis, column - _APART, one, "held_limit_on_track", shown.scale, _SEED, 0)
            if int(one["held_limit_of_line_status"]) == _GIVEN:
                _with_interval(
                    axis, column + _APART, one, "held_limit_of_line", shown.scale, _LINE, None
                )
        axis.set_xticks(np.arange(levels.size), [f"{level:g}" for level in levels])
        axis.set_xlim(-0.6, levels.size - 0.4)
        axis.set(xlabel="failure probability [-]", ylabel=f"limit, {shown.axis}")
    words = [
        f"each of {n} tracks, in order of the limit",
        f"track of seed {seed}",
        "the line, gains and track random",
    ]
    carried = bool((data["held_limit_of_line_status"] == _GIVEN).any())
    looks = (_TRACK, _SEED, _LINE) if carried else (_TRACK, _SEED)
    handles = [Line2D([], [], **look) for look in looks]
    title = f"limits given that levitation holds; intervals: {labels.confidence(data)}"
    if not carried:
        title += f"; {n} tracks carry none of the line"
    style.below(fig, handles, words[: len(handles)], columns=3, title=title)
    kept = ["seed_of_track", *(str(name) for name in data.data_vars if "held_limit" in str(name))]
    return fig, data[kept]


def _with_interval(
    axis: Axes,
    x: float,
    at: xr.Dataset,
    name: str,
    scale: float,
    look: style.Look,
    track: int | None,
) -> None:
    """Draw a limit with its interval; an arrow stands for an infinite upper end."""
    chosen = at if track is None else at.isel(track=track)
    middle, low, high = (scale * float(chosen[f"{name}{end}"]) for end in ("", "_low", "_high"))
    reach: FloatArray = np.array([[middle - low], [high - middle]])
    reach = np.where(np.isfinite(reach), np.maximum(reach, 0.0), 0.0)
    axis.errorbar([x], [middle], yerr=reach, capsize=1.5, elinewidth=0.8, zorder=3, **look)
    if np.isinf(high):
        arrow = {"arrowstyle": "<-", "color": look["color"], "lw": 0.7, "shrinkA": 0}
        axis.annotate(
            "", xy=(x, middle), xytext=(0, 13), textcoords="offset points", arrowprops=arrow
        )
