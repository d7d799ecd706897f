"""Measured track irregularity from a CSV or NetCDF file."""

from __future__ import annotations

import csv
from pathlib import Path

import netCDF4
import numpy as np

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.mechanics.irregularity import PROFILE_NAMES, Measured

_COLUMNS = ("x", "vertical", "lateral", "vertical_left", "lateral_left")
_REQUIRED = _COLUMNS[:3]
_NETCDF_SUFFIXES = (".nc", ".nc4", ".cdf", ".netcdf")


def read(path: str | Path) -> Measured:
    """Read a measured profile with the columns x, vertical, lateral, all in metres.

    x is zero at the first pier and rises along travel; vertical is positive downwards, lateral to
    the right.  With ``vertical_left`` or ``lateral_left``, the plain column is the right rail's;
    without, both rails share it.  A CSV file has the names in its first row; rows that begin with
    ``#`` are comments.  In a NetCDF file the names are variables of one dimension.

    Parameters
    ----------
    path
        File to read, NetCDF if its name ends in .nc, .nc4, .cdf or .netcdf, otherwise CSV.

    Returns
    -------
    measured
        The profile of both rails.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    UserError
        If it cannot be read as such, a column is missing, of another length or unit, holds what is
        not a finite number, or x does not rise.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "track.csv"
    ...     _ = path.write_text("x,vertical,lateral\\n0,0.001,0\\n1,0.002,0\\n")
    ...     read(path).x
    array([0., 1.])
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"irregularity profile {path} does not exist")
    is_netcdf = path.suffix.lower() in _NETCDF_SUFFIXES
    columns = _netcdf_columns(path) if is_netcdf else _csv_columns(path)
    missing = [name for name in _REQUIRED if name not in columns]
    if missing:
        raise UserError(
            f"irregularity profile {path} must have the columns {', '.join(_REQUIRED)}; "
            f"missing: {', '.join(missing)}"
        )
    x = columns["x"]
    for name, column in columns.items():
        if column.shape != x.shape or x.ndim != 1:
            raise UserError(
                f"irregularity profile {path}: column {name} must have one value per x, "
                f"got shape {column.shape} for x of shape {x.shape}"
            )
        bad = np.flatnonzero(~np.isfinite(column))
        if bad.size:
            raise UserError(
                f"irregularity profile {path}: column {name} must be finite, "
                f"got {column[bad[0]]} in row {bad[0] + 1} of its data"
            )
    if x.size < 2:
        raise UserError(f"irregularity profile {path} must have two rows or more, got {x.size}")
    falls = np.flatnonzero(np.diff(x) <= 0)
    if falls.size:
        k = falls[0]
        raise UserError(
            f"irregularity profile {path}: x must rise from row to row, "
            f"got {x[k]:g} then {x[k + 1]:g} m in rows {k + 1} and {k + 2} of its data"
        )
    rows = {
        "vertical_right": columns["vertical"],
        "vertical_left": columns.get("vertical_left", columns["vertical"]),
        "lateral_right": columns["lateral"],
        "lateral_left": columns.get("lateral_left", columns["lateral"]),
    }
    return Measured(
        source=f"irregularity profile {path}",
        x=x,
        displacement=np.stack([rows[name] for name in PROFILE_NAMES]),
    )


def _csv_columns(path: Path) -> dict[str, FloatArray]:
    """The known columns of a CSV file."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = [row for row in csv.reader(file) if row and not row[0].lstrip().startswith("#")]
    except (UnicodeDecodeError, csv.Error) as error:
        raise UserError(f"irregularity profile {path} cannot be read as CSV: {error}") from error
    names = [name.strip() for name in lines[0]] if lines else []
    columns: dict[str, FloatArray] = {}
    for name in _COLUMNS:
        if name not in names:
            continue
        k = names.index(name)
        values = np.empty(len(lines) - 1)
        for row, cells in enumerate(lines[1:]):
            try:
                values[row] = float(cells[k])
            except (ValueError, IndexError) as error:
                got = repr(cells[k]) if k < len(cells) else "nothing"
                raise UserError(
                    f"irregularity profile {path}: column {name} must hold numbers, got {got} "
                    f"in row {row + 1} of its data"
                ) from error
        columns[name] = values
    return columns


def _netcdf_columns(path: Path) -> dict[str, FloatArray]:
    """The known variables of a NetCDF file, masked values as NaN."""
    try:
        dataset = netCDF4.Dataset(path)
    except OSError as error:
        raise UserError(f"irregularity profile {path} cannot be read as NetCDF: {error}") from error
    with dataset:
        columns: dict[str, FloatArray] = {}
        for name in _COLUMNS:
            if name not in dataset.variables:
                continue
            variable = dataset.variables[name]
            unit = getattr(variable, "units", "m")
            if unit not in ("m", "metre", "meter", "metres", "meters"):
                raise UserError(
                    f"irregularity profile {path}: variable {name} must be in 'm', got {unit!r}"
                )
            if not np.issubdtype(variable.dtype, np.number):
                raise UserError(
                    f"irregularity profile {path}: variable {name} must hold numbers, "
                    f"got {variable.dtype}"
                )
            columns[name] = np.ma.filled(np.ma.asarray(variable[:], dtype=float), np.nan)
        return columns
