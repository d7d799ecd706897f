"""Accuracy per run: errors of the limits of every method against its number of runs."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from maglev.figures import labels, style

AIM = 0.1
"""Error that counts as good, in standard deviations."""

_FLOOR = 1e-3  # smaller errors are drawn there


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw the error of the rarest limit that the baseline carries, given that levitation holds.

    A response of which it carries none has an empty panel.

    Parameters
    ----------
    data
        Layout ``accuracy``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    levels = data["failure_probability"].to_numpy()
    fig, panels = labels.response_panels(data, 4.5)
    for response, axis, _ in panels:
        at = data.isel(response=response)
        carried = np.flatnonzero(np.isfinite(at["reference_held_limit"].to_numpy()))
        if carried.size == 0:
            style.note(axis, "MCM carries no limit: too few runs")
            continue
        level = carried[np.argmin(levels[carried])]
        at = at.isel(failure_probability=level)
        noise = float(at["reference_held_half_width"])
        axis.axhspan(_FLOOR, noise, color="#000000", alpha=0.1, lw=0, label="MCM's own noise")
        axis.axhline(AIM, color=style.QUIET, ls=":", lw=0.9, label=f"aim: {AIM} σ")
        for row, method in enumerate(data["method"].to_numpy().tolist()):
            n_runs = at["step_n_runs"].to_numpy()[row]
            error = np.abs(at["step_held_limit_error"].to_numpy()[row])
            kept = (n_runs > 0) & np.isfinite(error)
            axis.plot(
                n_runs[kept],
                error[kept].clip(min=_FLOOR),
                **labels.METHOD_STYLE[method],
                marker=labels.METHOD_MARKER[method],
                ms=3,
                lw=0.9,
                label=labels.METHOD[method],
            )
        axis.set(yscale="log", xlim=(0, None))
        axis.set_ylim(_FLOOR, max(5.0, axis.get_ylim()[1]))
        if response % labels.COLUMNS == 0:
            axis.set_ylabel("error of the limit [σ]")
        if labels.lowest(response, data):
            axis.set_xlabel("number of runs")
        style.note(axis, f"at {levels[level]:g}: MCM ± {noise:.2g} σ")
    title = (
        "rarest limit that MCM carries, given that levitation holds; its noise: half its interval"
    )
    legends = [axis.get_legend_handles_labels() for _, axis, _ in panels]
    style.below(fig, *max(legends, key=lambda one: len(one[0])), columns=5, title=title)
    return fig, data
