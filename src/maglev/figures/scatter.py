"""Dependence of the paper's responses: pairs of extremes of the baseline as densities of points."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from maglev.figures import labels, style
from maglev.vocabulary import PAPER_RESPONSES

_SHORT = (
    "midspan\ndispl. vert.",
    "midspan\ndispl. lat.",
    "midspan\naccel. vert.",
    "midspan\naccel. lat.",
    "car body\naccel. vert.",
    "car body\naccel. lat.",
)


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw every pair below the diagonal and every histogram on it.

    Parameters
    ----------
    data
        Layout ``runs``: the baseline of a case.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    held = data["status"].to_numpy() == 0
    values = [labels.shown(name).scale * data[name].to_numpy()[held] for name in PAPER_RESPONSES]
    n, n_lost = held.size, int((~held).sum())
    spans = []
    for one in values:
        low, high = one.min(), np.quantile(one, 0.998)
        margin = 0.06 * (high - low)
        spans.append((low - margin, high + margin))
    size = len(PAPER_RESPONSES)
    layout = ConstrainedLayoutEngine(w_pad=0.02, h_pad=0.02, wspace=0.02, hspace=0.02)
    fig = Figure(figsize=(style.PAGE, 6.8), layout=layout)
    axes = fig.subplots(size, size, sharex="col")
    drawn = None
    for row, column in np.ndindex(size, size):
        axis = axes[row, column]
        axis.tick_params(labelsize=6)
        axis.locator_params(nbins=2)
        if column > row:
            axis.axis("off")
            continue
        axis.set_xlim(spans[column])
        if column == row:
            axis.hist(values[row], bins=40, range=spans[row], color="#0072B2", alpha=0.6)
            axis.set_yticks([])
            axis.grid(visible=False)
        else:
            drawn = axis.hexbin(
                values[column],
                values[row],
                gridsize=26,
                extent=(*spans[column], *spans[row]),
                mincnt=1,
                norm=LogNorm(1, max(10, held.sum() / 20)),
                cmap="viridis",
                linewidths=0.1,
                rasterized=True,
            )
            axis.set_ylim(spans[row])
        if column > 0:
            axis.set_yticklabels([])
        if row == size - 1:
            axis.set_xlabel(
                f"{_SHORT[column]}\n[{labels.shown(PAPER_RESPONSES[column]).unit}]", fontsize=7
            )
        if column == 0:
            axis.set_ylabel(
                f"{_SHORT[row]}\n[{labels.shown(PAPER_RESPONSES[row]).unit}]", fontsize=7
            )
    fig.align_labels()
    assert drawn is not None
    inset = fig.add_axes((0.66, 0.72, 0.25, 0.015))
    fig.colorbar(drawn, cax=inset, orientation="horizontal", label="runs in a cell")
    beyond = sum(
        int(((one < span[0]) | (one > span[1])).sum())
        for one, span in zip(values, spans, strict=True)
    )
    fig.text(
        0.62,
        0.86,
        f"{n} runs of MCM, {n_lost} lost levitation ({labels.percent(n_lost / n)})\nand are left "
        f"out; {beyond} extremes lie beyond\nthe panels (0.2 % of each response)",
        fontsize=8,
        va="center",
    )
    return fig, data[[*PAPER_RESPONSES, "status"]]
