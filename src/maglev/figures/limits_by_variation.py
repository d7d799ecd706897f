"""Limits of the extremes against the coefficient of variation of the gains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from maglev.figures import curves, labels, style

_LOOKS: tuple[style.Look, ...] = (
    {"color": "#0072B2", "ls": "-", "marker": "o"},
    {"color": "#D55E00", "ls": "--", "marker": "s"},
    {"color": "#000000", "ls": "-.", "marker": "^"},
    {"color": "#009E73", "ls": ":", "marker": "D"},
)


def figure(
    limits: Sequence[xr.Dataset], designs: Sequence[xr.Dataset]
) -> tuple[Figure, xr.Dataset]:
    """Draw the limits, a line per failure probability, with their intervals.

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
    variations = np.array([labels.settings(design)[0] for design in designs])
    order = np.argsort(variations, kind="stable")
    found = curves.limits([limits[k] for k in order])
    found["curve_variation"] = ("curve", variations[order])
    variation = variations[order]
    levels = found["failure_probability"].to_numpy()
    step = np.diff(variation).min() if variation.size > 1 else 0.02
    fig, panels = labels.response_panels(found, 4.7)
    for response, axis, shown in panels:
        at = curves.in_shown_unit(found, response)
        for number in range(levels.size):
            look = _LOOKS[number % len(_LOOKS)]
            apart = 0.07 * step * (number - 0.5 * (levels.size - 1))
            chosen = at.isel(failure_probability=number)
            curves.draw_limits(axis, variation + apart, chosen, look)
        axis.set_xlim(variation.min() - 0.6 * step, variation.max() + 0.6 * step)
        axis.set_xticks(variation, [f"{one:.2f}" for one in variation])
        axis.set_xlabel("coefficient of variation [-]")
        axis.set_ylabel(f"limit, {shown.axis}")
    handles = [Line2D([], [], **_LOOKS[k % len(_LOOKS)], ms=3.5) for k in range(levels.size)]
    words = [f"failure probability {level:g}" for level in levels]
    if curves.differ(found):
        handles.append(Line2D([], [], ls="", marker="o", ms=3.5, mfc="white", color=style.QUIET))
        words.append("hollow, line: given that levitation holds")
    lost = ", ".join(
        f"{labels.percent(float(share))} at {at:.2f}"
        for share, at in zip(found["curve_lost_probability"], variation, strict=True)
    )
    runs = found["curve_n_runs"].to_numpy()
    many = f"{runs.min()}" if runs.min() == runs.max() else f"{runs.min()} to {runs.max()}"
    title = f"{many} runs each; intervals: {labels.confidence(limits[0])}; levitation lost: {lost}"
    style.below(fig, handles, words, columns=4, title=title)
    return fig, found
