"""Limits of the extremes against failure probability, gains random alone and together."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from maglev.figures import curves, labels, style

_MARKERS = dict(zip(labels.GAIN, ("o", "s", "^", "D"), strict=True))


def figure(
    limits: Sequence[xr.Dataset], designs: Sequence[xr.Dataset]
) -> tuple[Figure, xr.Dataset]:
    """Draw the limits, a line per case, with their intervals.

    Parameters
    ----------
    limits
        Layout ``limits``, one per case.
    designs
        Layout ``design`` (or ``runs`` of a baseline), of the same cases in the same order.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    found = curves.limits(limits)
    levels = found["failure_probability"].to_numpy()
    handles: list[Line2D] = []
    words: list[str] = []
    looks: list[style.Look] = []
    for one, design in zip(limits, designs, strict=True):
        parameters = labels.parameters_of(design)
        name, look = labels.case_style(parameters)
        marker = _MARKERS.get(parameters[0], "P") if len(parameters) == 1 else "v"
        looks.append({**look, "marker": marker})
        words.append(labels.of_runs(name, one["n_runs"], one["lost_probability"]))
        handles.append(Line2D([], [], **looks[-1], ms=3.5))
    fig, panels = labels.response_panels(found, 4.7)
    for response, axis, shown in panels:
        at = curves.in_shown_unit(found, response)
        for number, look in enumerate(looks):
            apart = 1.06 ** (number - 0.5 * (len(looks) - 1))
            curves.draw_limits(axis, levels * apart, at.isel(curve=number), look)
        curves.levels_along(axis, levels)
        axis.set_ylabel(f"limit, {shown.axis}")
    if curves.differ(found):
        handles.append(Line2D([], [], ls="", marker="o", ms=3.5, mfc="white", color=style.QUIET))
        words.append("filled: of all passages; hollow, line: given that levitation holds")
    intervals = f"intervals: {labels.confidence(limits[0])}"
    title = f"{labels.of_settings(designs[0])}; {intervals}"
    style.below(fig, handles, words, columns=2, title=title)
    return fig, found
