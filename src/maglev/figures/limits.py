"""Limits of the extremes of a case by every method and failure probability."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from maglev.figures import curves, labels, style

_APART = 1.12
"""Ratio of the failure probabilities at which neighbouring methods are drawn, to tell them apart
[-]."""


def figure(limits: Sequence[xr.Dataset]) -> tuple[Figure, xr.Dataset]:
    """Draw the limits of every response, a line per method, with their intervals.

    Parameters
    ----------
    limits
        Layout ``limits``, of the methods of one case.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    methods = [labels.method_of(one) for one in limits]
    found = curves.limits(limits)
    levels = found["failure_probability"].to_numpy()
    looks: list[style.Look] = [
        {**labels.METHOD_STYLE[name], "marker": labels.METHOD_MARKER[name]} for name in methods
    ]
    fig, panels = labels.response_panels(found, 4.7)
    for response, axis, shown in panels:
        at = curves.in_shown_unit(found, response)
        for number, look in enumerate(looks):
            apart = _APART ** (number - 0.5 * (len(looks) - 1))
            curves.draw_limits(axis, levels * apart, at.isel(curve=number), look)
        if not np.isfinite(at["curve_held_limit"]).any():
            style.note(axis, "no limit: too few runs")
        curves.levels_along(axis, levels)
        axis.set_ylabel(f"limit, {shown.axis}")
    handles = [Line2D([], [], **look, ms=3.5) for look in looks]
    words = [
        labels.of_runs(labels.METHOD[name], one["n_runs"], one["lost_probability"])
        for name, one in zip(methods, limits, strict=True)
    ]
    if curves.differ(found):
        handles.append(Line2D([], [], ls="", marker="o", ms=3.5, mfc="white", color=style.QUIET))
        words.append("filled: of all passages; hollow, line: given that levitation holds")
    title = f"intervals: {labels.confidence(limits[0])}"
    style.below(fig, handles, words, columns=2, title=title)
    return fig, found
