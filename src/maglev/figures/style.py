"""How every figure looks: sizes for print, colours that the colour-blind can tell apart."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

COLUMN, PAGE = 3.5, 7.2
"""Widths of one column and of the page [inch]."""

MODEL, REFERENCE, MEASURED, ACCENT, QUIET = "#0072B2", "#D55E00", "#000000", "#009E73", "#999999"
"""Okabe and Ito's colours (2008) by what they stand for."""

KMH = 3.6
"""Kilometres per hour in one metre per second."""


@contextmanager
def page() -> Iterator[None]:
    """Set fonts and lines so that a figure reads at column width."""
    with mpl.rc_context(
        {
            "font.size": 8,
            "axes.titlesize": 8,
            "axes.labelsize": 8,
            "legend.fontsize": 7,
            "legend.frameon": False,
            "xtick.labelsize": 7,
            "ytick.labelsize": 7,
            "lines.linewidth": 1.0,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.grid": True,
            "grid.color": "#e5e5e5",
            "grid.linewidth": 0.5,
            "pdf.fonttype": 42,
            "svg.hashsalt": "maglev",
        }
    ):
        yield


def titled(axis: Axes, letter: str, text: str) -> None:
    """Put a panel's letter, and the number that matters, over its left edge."""
    axis.set_title(f"({letter}) {text}", loc="left")


def panels(rows: int, columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """A figure [inch] of equal panels, lettered (a), (b) … from left to right."""
    figure = Figure(figsize=(width, height), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.07)
    axes = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for letter, axis in zip("abcdefghijklmnop", axes, strict=False):
        axis.set_title(f"({letter})", loc="left")
    return figure, axes


def note(axis: Axes, text: str, *, top: bool = True, right: bool = True) -> None:
    """Write the number that matters into a corner of a panel."""
    axis.text(
        0.98 if right else 0.02,
        0.97 if top else 0.03,
        text,
        transform=axis.transAxes,
        ha="right" if right else "left",
        va="top" if top else "bottom",
        fontsize=7,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5},
        zorder=5,
    )


def mark_demonstration(figure: Figure) -> None:
    """Write 'demonstration' across a figure that shows no result."""
    figure.text(
        0.5,
        0.5,
        "demonstration",
        ha="center",
        va="center",
        rotation=25,
        fontsize=36,
        color="#CC0000",
        alpha=0.22,
        zorder=10,
    )


def save(figure: Figure, out: Path) -> None:
    """Write PNG and PDF, without the time of writing so that equal figures are equal files."""
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out.with_name(f"{out.name}.png"), dpi=300, metadata={"Software": None})
    figure.savefig(out.with_name(f"{out.name}.pdf"), metadata={"CreationDate": None})
