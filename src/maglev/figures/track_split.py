"""Contributions of random gains and a random track to the extremes."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from maglev.figures import labels, style

_PARTS: dict[str, tuple[str, style.Look]] = {
    "density_both": ("gains and track random", {"color": "#000000", "ls": "-"}),
    "density_track_only": ("track random, mean gains", {"color": "#D55E00", "ls": "--"}),
    "density_gains_only": ("gains random, one track", {"color": "#0072B2", "ls": "-."}),
}


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw the three densities of every response, with the shares of the variance.

    Parameters
    ----------
    data
        Layout ``track_split``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    fig, panels = labels.response_panels(data, 4.9)
    for response, axis, shown in panels:
        at = data.isel(response=response)
        curves = {name: at[name].to_numpy() / shown.scale for name in _PARTS}
        peaks = {name: one.max() for name, one in curves.items()}
        top = max(peak for peak in peaks.values() if peak <= 6 * min(peaks.values()))
        value = shown.scale * at["value"].to_numpy()
        for name, (word, look) in _PARTS.items():
            axis.plot(value, curves[name], **look, label=word)
        dense = (curves["density_both"] > 4e-3 * peaks["density_both"]) | (
            curves["density_track_only"] > 4e-3 * peaks["density_track_only"]
        )
        axis.set_xlim(value[dense].min(), value[dense].max())
        axis.set_ylim(0, 1.75 * top)
        lines = []
        for name, word in (
            ("gains", "gains"), ("track", "track"), ("interaction", "both together"),
        ):  # fmt: skip
            share, low, high = (float(at[f"{name}_share{end}"]) for end in ("", "_low", "_high"))
            lines.append(f"{word} {share:.2f} [{low:.2f}, {high:.2f}]")
        gone = [name for name, peak in peaks.items() if peak > 1.75 * top]
        lines += [f"peak of {_PARTS[name][0]}: {peaks[name]:.3g}" for name in gone]
        style.note(axis, "\n".join(lines))
        axis.set(xlabel=shown.axis, ylabel=shown.density_axis)
    confidence = labels.confidence(data)
    title = (
        f"in the panels: shares of the variance with {confidence} intervals; "
        f"{int(data['n_runs'])} runs in all"
    )
    style.below(fig, *panels[0][1].get_legend_handles_labels(), columns=3, title=title)
    return fig, data
