"""Figures: one module each, named after its content; they read datasets and compute nothing new."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from maglev.errors import UserError

FIGURES: Mapping[str, tuple[str, ...]] = {
    "irregularity": ("irregularity",),
    "deflection": ("deflection", "dynamic_factor"),
    "histories": ("passage",),
    "gaps": ("passage",),
    "modes": ("modes",),
    "train_modes": ("train_modes",),
    "stiffness_check": ("stiffness_check",),
    "training": ("accuracy", "design*"),
    "prediction": ("prediction",),
    "density_by_method": ("density*",),
    "exceedance_by_method": ("density*",),
    "density": ("density*",),
    "exceedance": ("density*", "limit_states*"),
    "limits": ("limits*",),
    "sweep": ("sweep",),
    "density_by_gain": ("density*", "design*"),
    "limits_by_gain": ("limits*", "design*"),
    "density_by_variation": ("density*", "design*"),
    "limits_by_variation": ("limits*", "design*"),
    "density_by_control": ("density*", "design*"),
    "limits_by_control": ("limits*", "design*"),
    "sobol": ("surrogate",),
    "stability": ("stability", "runs"),
    "accuracy": ("accuracy",),
    "scatter": ("runs",),
    "track_split": ("track_split",),
    "tracks": ("line",),
    "track_limits": ("line",),
    "in_time": ("density_in_time",),
}
"""Every figure with the layouts of the files that it is drawn from, in order.

A star stands for any number of files of that layout; two stars stand for equally many files, first
all of the one layout, then all of the other."""


def layouts_of(name: str, n_files: int) -> list[tuple[str, ...]]:
    """Layouts of the files of a figure, grouped by entry of `FIGURES`.

    Parameters
    ----------
    name
        A key of `FIGURES`.
    n_files
        Number of files.

    Raises
    ------
    UserError
        If the figure needs more or fewer files.
    """
    entries = FIGURES[name]
    starred = sum(one.endswith("*") for one in entries)
    left = n_files - (len(entries) - starred)
    if (starred == 0 and left != 0) or (starred and (left < starred or left % starred)):
        many = "any number of each *" if starred else f"{len(entries)} files"
        raise UserError(f"figure {name} is drawn from {many} ({', '.join(entries)}), got {n_files}")
    return [(one[:-1],) * (left // starred) if one.endswith("*") else (one,) for one in entries]


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
    UserError
        If there are more or fewer files than the figure needs, or a file is of another layout.
    """
    from importlib import import_module
    from importlib.metadata import version

    from maglev import datasets
    from maglev.figures import style
    from maglev.fingerprint import code_of

    paths = iter(data)
    roles: dict[str, str | Path] = {}
    arguments: list[object] = []
    read = []
    for entry, layouts in zip(FIGURES[name], layouts_of(name, len(data)), strict=True):
        group = []
        for layout in layouts:
            path = next(paths)
            one = datasets.read(path, layout)
            owner = "_".join(one.attrs[key] for key in ("case", "method") if key in one.attrs)
            roles[f"{layout}_{owner}" if entry.endswith("*") else layout] = path
            group.append(one)
        arguments.append(group if entry.endswith("*") else group[0])
        read += group
    demonstration = any(one.attrs.get("demonstration") == "yes" for one in read)
    with style.page():
        figure, plotted = import_module(f"maglev.figures.{name}").figure(*arguments)
        words = dict.fromkeys(one.attrs["track"] for one in read if "track" in one.attrs)
        if words:
            style.say_track(figure, "; ".join(words))
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
        **{f"input_{role}": f"sha256:{datasets.file_hash(path)}" for role, path in roles.items()},
    }
    datasets.write_netcdf(datasets.describe(plotted), Path(out).with_name(f"{Path(out).name}.nc"))
