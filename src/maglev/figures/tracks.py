"""Densities of the extremes on each of many tracks, and over all of them: the line."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from maglev.figures import labels, style

_TRACK: style.Look = {"color": "#7f7f7f", "lw": 0.5, "alpha": 0.7}
_SEED: style.Look = {"color": style.MODEL, "lw": 1.1}
_LINE: style.Look = {"color": "#000000", "lw": 1.4}


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw each track's part of the density of the line, and the shares of the variance.

    A track's density is divided by the number of tracks, so that the line's is the sum of all.

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
    fig, panels = labels.response_panels(data, 4.9)
    for response, axis, shown in panels:
        at = data.isel(response=response)
        value = shown.scale * at["value"].to_numpy()
        tracks = at["density_of_track"].to_numpy() / shown.scale / n
        line = at["density_of_line"].to_numpy() / shown.scale
        for one in tracks[1:]:
            axis.plot(value, one, **_TRACK)
        axis.plot(value, tracks[0], **_SEED)
        axis.plot(value, line, **_LINE)
        lines = []
        for name, word in (("gains", "gains"), ("track", "track"), ("interaction", "both")):
            share, low, high = (float(at[f"{name}_share{end}"]) for end in ("", "_low", "_high"))
            lines.append(f"{word} {share:.2f} [{low:.2f}, {high:.2f}]")
        style.note(axis, "\n".join(lines))
        dense = value[line > 1e-3 * line.max()]
        axis.set_xlim(dense.min(), dense.max())
        axis.set_ylim(0, 1.5 * line.max())
        axis.locator_params(axis="x", nbins=5)
        axis.set(xlabel=shown.axis, ylabel=shown.density_axis)
    handles = [Line2D([], [], **look) for look in (_LINE, _TRACK, _SEED)]
    words = [
        f"the line: gains and track random, {n} tracks",
        f"each track, over {n}",
        f"track of seed {seed}, over {n}",
    ]
    title = (
        f"{int(data['n_runs'])} runs; in the panels: shares of the variance with "
        f"{labels.confidence(data)} intervals, with all points of the gains held"
    )
    style.below(fig, handles, words, columns=3, title=title)
    kept = [
        "value", "density_of_track", "density_of_line", "seed_of_track", "n_runs",
        *(f"{name}_share{end}" for name in ("gains", "track", "interaction")
          for end in ("", "_low", "_high")),
    ]  # fmt: skip
    return fig, data[kept]
