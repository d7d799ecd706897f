"""Gaps and currents of the magnets while the train passes."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from maglev.errors import UserError
from maglev.figures import style

_KINDS = (("suspension", 0), ("guidance", 1))


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw the range over all magnets and the magnet that moves most, gaps above currents.

    Parameters
    ----------
    data
        Layout ``passage`` with histories.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.

    Raises
    ------
    UserError
        If there are no histories.
    """
    if "gap_history" not in data:
        raise UserError("figure gaps: the passage has no histories")
    fig, axes = style.panels(2, 2, style.PAGE, 4.2)
    first = data.isel(sample=0)
    for column, (kind, code) in enumerate(_KINDS):
        magnets = first.isel(magnet=(first["magnet_kind"] == code).to_numpy())
        swing = magnets["gap_history"].max("t") - magnets["gap_history"].min("t")
        busiest = int(swing.to_numpy().argmax())
        side = "right" if magnets["magnet_side"].to_numpy()[busiest] > 0 else "left"
        place = magnets["magnet_x"].to_numpy()[busiest]
        rows = (("gap", 1e3, "mm"), ("current", 1.0, "A"))
        for axis, (quantity, scale, unit) in zip(axes[column::2], rows, strict=True):
            history = scale * magnets[f"{quantity}_history"]
            axis.fill_between(
                first.t,
                history.min("magnet"),
                history.max("magnet"),
                color=style.QUIET,
                alpha=0.4,
                lw=0,
                label="all magnets",
            )
            axis.plot(
                first.t,
                history.isel(magnet=busiest),
                color=style.MODEL,
                lw=0.6,
                label=f"{side}, {-place:.0f} m behind the nose",
            )
            axis.set_ylabel(f"{kind} {quantity} [{unit}]")
            axis.margins(x=0, y=0.3)
            axis.legend(loc="upper left", ncols=2)
        style.note(
            axes[column],
            f"any pole: {1e3 * first[f'{kind}_gap_min'].item():.1f} to "
            f"{1e3 * first[f'{kind}_gap_max'].item():.1f} mm",
            top=False,
        )
        style.note(
            axes[column + 2], f"largest {first[f'{kind}_current_max'].item():.1f} A", top=False
        )
    for axis in axes[-2:]:
        axis.set_xlabel("time [s]")
    names = [
        f"{kind}_{what}" for kind, _ in _KINDS for what in ("gap_min", "gap_max", "current_max")
    ]
    kept = ["gap_history", "current_history", "magnet_kind", "magnet_side", "magnet_x", *names]
    return fig, data[kept].isel(sample=[0])
