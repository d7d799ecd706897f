"""The track irregularity along the guideway, and its spectra beside the target spectra."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from maglev.figures import style


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw samples (left) and spectra (right), vertical above lateral.

    Parameters
    ----------
    data
        Layout ``irregularity``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    fig, axes = style.panels(2, 2, style.PAGE, 4.2)
    for row, direction in enumerate(("vertical", "lateral")):
        along, spectrum = axes[2 * row : 2 * row + 2]
        values = 1e3 * data[f"irregularity_{direction}"]
        same = bool((values.sel(side=-1) == values.sel(side=1)).all())
        along.plot(data.x, values.sel(side=1), color=style.MODEL, label="right rail")
        if not same:
            along.plot(data.x, values.sel(side=-1), color=style.REFERENCE, lw=0.7, label="left")
            along.legend(loc="lower left", ncols=2)
        along.set_ylabel(f"{direction} irregularity [mm]")
        along.margins(x=0, y=0.2)
        style.note(along, f"σ = {1e3 * data[f'deviation_{direction}'].item():.2f} mm")

        spectrum.loglog(
            data.wavenumber,
            data[f"spectrum_{direction}"],
            color=style.MODEL,
            lw=0.7,
            label="of the sample (Welch)",
        )
        spectrum.loglog(
            data.wavenumber,
            data[f"target_{direction}"],
            color=style.REFERENCE,
            lw=1.5,
            label="target",
        )
        spectrum.set_ylabel(f"{direction} spectrum [m³]")
        spectrum.legend(loc="lower left")
    axes[2].set_xlabel("distance from the first pier [m]")
    axes[3].set_xlabel("wavenumber 1/λ [1/m]")
    return fig, data
