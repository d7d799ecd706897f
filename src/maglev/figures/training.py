"""Errors of the surrogates against the number of training runs, for two responses."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from maglev.figures import curves, labels, style

_SHOWN = ("girder_displacement_z", "girder_acceleration_z")
"""The responses of the paper's figure; the first two of the files where they have not both."""


def figure(accuracy: xr.Dataset, designs: Sequence[xr.Dataset]) -> tuple[Figure, xr.Dataset]:
    """Draw root mean square errors against the baseline, and errors at the next runs.

    Parameters
    ----------
    accuracy
        Layout ``accuracy``: for the designs made in one stage, by their first samples.
    designs
        Layout ``design``, of the methods of the same case.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    responses = np.array(
        [
            name
            for name in accuracy["response"].to_numpy()
            if all(name in design["response"] for design in designs)
        ]
    )
    accuracy = accuracy.sel(response=responses)
    rows = [_rounds(accuracy, design.sel(response=responses)) for design in designs]
    longest = max(one[0].size for one in rows)

    def filled(k: int, nothing: float) -> np.ndarray:
        shape = (len(rows), longest, *rows[0][k].shape[1:])
        table = np.full(shape, nothing)
        for row, one in enumerate(rows):
            table[row, : one[k].shape[0]] = one[k]
        return table

    of_response = ("curve", "round", "response")
    plotted = xr.Dataset(
        {
            "curve_round_n_runs": (of_response[:2], filled(0, 0).astype(int)),
            "curve_rmse": (of_response, filled(1, np.nan)),
            "curve_error": (of_response, filled(2, np.nan)),
            "sigma": accuracy["sigma"],
        },
        coords={
            "curve": curves.named(designs),
            "round": np.arange(longest),
            "response": accuracy["response"],
        },
    )
    names = responses.tolist()
    chosen = _SHOWN if set(_SHOWN) <= set(names) else tuple(names[:2])
    fig, axes = style.panels(2, len(chosen), style.PAGE, 4.6)
    for column, name in enumerate(chosen):
        response = names.index(name)
        shown = labels.shown(name)
        upper, lower = axes[column], axes[len(chosen) + column]
        for (n_runs, rmse, error), design in zip(rows, designs, strict=True):
            method = labels.method_of(design)
            look: style.Look = {
                **labels.METHOD_STYLE[method],
                "marker": labels.METHOD_MARKER[method],
                "ms": 2.5,
                "lw": 0.8,
                "label": labels.METHOD[method],
            }
            for axis, values in ((upper, shown.scale * rmse), (lower, error)):
                kept = np.isfinite(values[:, response])
                axis.plot(n_runs[kept], values[kept, response], **look)
        sigma = shown.scale * float(accuracy["sigma"][response])
        upper.axhline(sigma, color=style.QUIET, lw=0.8, ls=":")
        upper.annotate(
            "σ of MCM: no surrogate at all",
            (1.0, sigma),
            xycoords=("axes fraction", "data"),
            ha="right",
            va="bottom",
            fontsize=6.5,
            color="#666666",
        )
        upper.set(yscale="log", ylabel=f"RMSE [{shown.unit}]")
        lower.set(yscale="log", ylabel="AE, largest of the next runs [σ]")
        lower.set_xlabel("number of training runs")
        for axis, letter in ((upper, "abcd"[column]), (lower, "abcd"[len(chosen) + column])):
            axis.set_xlim(0, 1.03 * max(one[0].max() for one in rows))
            style.titled(axis, letter, shown.name)
    style.below(fig, *axes[0].get_legend_handles_labels(), columns=len(designs))
    return fig, plotted


def _rounds(accuracy: xr.Dataset, design: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Number of runs (round,), errors against the baseline and at the next runs of a design.

    The error of a round is that of the predictions before it, and stands at the number of runs
    before it.
    """
    if design.sizes["round"] > 1:
        n_runs = design["round_n_runs"].to_numpy()
        error = design["error"].to_numpy()
        ahead = np.concatenate([error[1:], np.full_like(error[:1], np.nan)])
        return n_runs, design["rmse"].to_numpy(), ahead
    row = accuracy["method"].to_numpy().tolist().index(labels.method_of(design))
    known = accuracy["step_n_runs"].to_numpy()[row] > 0
    of_method = accuracy.isel(method=row)
    n_runs, rmse, error = (
        of_method[name].to_numpy()[known] for name in ("step_n_runs", "step_rmse", "step_error")
    )
    return n_runs, rmse, error
