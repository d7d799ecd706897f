"""Figures: one module each, named by what it shows; they read datasets and compute nothing new."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

FIGURES: Mapping[str, tuple[str, ...]] = {
    "irregularity": ("irregularity",),
    "deflection": ("deflection", "dynamic_factor"),
    "histories": ("passage",),
    "gaps": ("passage",),
    "modes": ("modes",),
}
"""Every figure with the layouts of the files that it is drawn from, in order."""


def draw(name: str, data: Sequence[str | Path], out: str | Path) -> None:
    """Draw a figure and write it as PNG and PDF, and the numbers in it as NetCDF.

    Parameters
    ----------
    name
        A key of `FIGURES`.
    data
        The files it is drawn from, in the order of `FIGURES`.
    out
        File name without its ending.

    Raises
    ------
    FileNotFoundError
        If a file is missing.
    ValueError
        If there are more or fewer files than the figure needs, or a file is of another layout.
    """
    from importlib import import_module
    from importlib.metadata import version

    from maglev import datasets
    from maglev.figures import style
    from maglev.fingerprint import code_of

    layouts = FIGURES[name]
    if len(data) != len(layouts):
        raise ValueError(
            f"figure {name} is drawn from {len(layouts)} files ({', '.join(layouts)}), "
            f"got {len(data)}"
        )
    read = [datasets.read(path, layout) for path, layout in zip(data, layouts, strict=True)]
    demonstration = any(one.attrs.get("demonstration") == "yes" for one in read)
    with style.page():
        figure, plotted = import_module(f"maglev.figures.{name}").figure(*read)
        if demonstration:
            style.mark_demonstration(figure)
        style.save(figure, Path(out))
    plotted.attrs = {
        "Conventions": datasets.CONVENTIONS,
        "title": f"Numbers in the figure '{name}'",
        "source": f"maglev {version('maglev')}",
        "references": datasets.REFERENCES,
        "code": code_of(f"figures.{name}"),
        "demonstration": "yes" if demonstration else "no",
        **{
            f"input_{layout}": f"sha256:{datasets.file_hash(path)}"
            for path, layout in zip(data, layouts, strict=True)
        },
    }
    datasets.write_netcdf(plotted, Path(out).with_name(f"{Path(out).name}.nc"))
