"""The six responses while the train passes."""

from __future__ import annotations

import xarray as xr
from matplotlib.figure import Figure

from maglev.errors import UserError
from maglev.figures import style
from maglev.vocabulary import PAPER_RESPONSES

_LABELS = {
    "girder_displacement_z": ("girder, vertical\ndisplacement [mm]", 1e3, "mm"),
    "girder_displacement_y": ("girder, lateral\ndisplacement [mm]", 1e3, "mm"),
    "girder_acceleration_z": ("girder, vertical\nacceleration [m/s²]", 1.0, "m/s²"),
    "girder_acceleration_y": ("girder, lateral\nacceleration [m/s²]", 1.0, "m/s²"),
    "car_body_acceleration_z": ("car body, vertical\nacceleration [m/s²]", 1.0, "m/s²"),
    "car_body_acceleration_y": ("car body, lateral\nacceleration [m/s²]", 1.0, "m/s²"),
}


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw the histories of the first sample; of the cars, the one that moves most.

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
    names = [f"{name}_history" for name in PAPER_RESPONSES]
    if any(name not in data for name in names):
        raise UserError("figure histories: the passage has no histories")
    fig, axes = style.panels(3, 2, style.PAGE, 5.4)
    first = data.isel(sample=0)
    for axis, response in zip(axes, PAPER_RESPONSES, strict=True):
        label, scale, unit = _LABELS[response]
        history = scale * first[f"{response}_history"]
        where = ""
        if "car" in history.dims:
            car = int(first[f"{response}_per_car"].to_numpy().argmax())
            where = f", car {car + 1} of {first.sizes['car']}"
            history = history.isel(car=car)
        axis.plot(first.t, history, color=style.MODEL, lw=0.6)
        extreme, at = scale * first[response].item(), first[f"{response}_t"].item()
        axis.axvline(at, color=style.REFERENCE, lw=0.6, ls=":")
        axis.set_ylabel(label)
        axis.margins(x=0, y=0.25)
        style.note(axis, f"largest {extreme:.3g} {unit} at {at:.2f} s{where}")
    for axis in axes[-2:]:
        axis.set_xlabel("time [s]")
    extremes = [*PAPER_RESPONSES, *(f"{name}_t" for name in PAPER_RESPONSES)]
    per_car = [f"{name}_per_car" for name in PAPER_RESPONSES if name.startswith("car_body")]
    return fig, data[[*names, *extremes, *per_car]].isel(sample=[0])
