"""The guideway's natural frequencies by direction, and shapes of the lowest modes."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from maglev.datasets import VARIABLES
from maglev.figures import style

_N_SHAPES, _PER_DIRECTION = 8, 3
_APART = 1.5  # neighbouring modes of one direction are of one family below this ratio


def _families(data: xr.Dataset) -> list[int]:
    """Lowest mode of each of the first families: neighbours in frequency with one direction."""
    lowest = []
    frequency, direction = data["frequency"].to_numpy(), data["direction"].to_numpy()
    for code in np.unique(direction):
        below, of_direction = 0.0, []
        for k in np.flatnonzero(direction == code):
            if frequency[k] > _APART * below:
                of_direction.append(int(k))
                below = frequency[k]
        lowest += of_direction[:_PER_DIRECTION]
    return sorted(lowest)[:_N_SHAPES]


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw the frequencies of each direction and the lowest mode of each family.

    Parameters
    ----------
    data
        Layout ``modes``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    fig = Figure(figsize=(style.PAGE, 5.6), layout="constrained")
    grid = fig.add_gridspec(3, 4, height_ratios=[1.1, 1, 1])
    flags = VARIABLES["direction"].flags or {}
    top = fig.add_subplot(grid[0, :])
    for code, word in flags.items():
        of_direction = data["frequency"].where(data["direction"] == code, drop=True)
        top.plot(of_direction, np.full(of_direction.size, code), "|", color=style.MODEL, ms=9)
        top.text(0.3, code + 0.22, word, fontsize=7)
    closed = data["frequency_simply_supported"].item()
    vertical = next(code for code, word in flags.items() if word == "vertical")
    first = data["frequency"].where(data["direction"] == vertical, drop=True).min().item()
    if "measured_frequency" in data:
        measured = data["measured_frequency"].item()
        confidence = data["measured_frequency"].attrs.get("confidence", "unknown")
        words = f"measured {measured:.2f} Hz ({confidence} confidence)"
        top.plot(measured, vertical, "D", color=style.MEASURED, ms=4, label=words)
    top.plot(
        closed,
        vertical,
        "o",
        mfc="none",
        color=style.REFERENCE,
        ms=6,
        label=f"simply supported Euler beam {closed:.2f} Hz",
    )
    top.set(xlabel="frequency [Hz]", yticks=[], xlim=(0, None), ylim=(-0.5, len(flags) - 0.2))
    top.legend(loc="upper right")
    top.set_title(f"(a) first vertical mode {first:.2f} Hz", loc="left")

    chosen = _families(data)
    for panel, k in enumerate(chosen):
        axis = fig.add_subplot(grid[1 + panel // 4, panel % 4])
        mode = data.isel(mode=k)
        lateral = flags[int(mode["direction"].item())] in ("lateral", "torsion")
        across = "y" if lateral else "z"
        axis.plot(data.x, mode[f"girder_shape_{across}"], color=style.MODEL, label="girder")
        axis.plot(
            data.x, mode[f"rail_shape_{across}"], color=style.REFERENCE, lw=0.6, label="right rail"
        )
        axis.set_ylim(-1.15, 1.15)
        axis.margins(x=0)
        word = flags[int(mode["direction"].item())]
        axis.set_title(
            f"({'bcdefghi'[panel]}) {mode['frequency'].item():.2f} Hz, {word}", loc="left"
        )
        if panel % 4 == 0:
            axis.set_ylabel("shape [-]")
            axis.legend(loc="lower left")
        if panel >= len(chosen) - 4:
            axis.set_xlabel("x [m]")
    return fig, data
