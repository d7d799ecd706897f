"""Tables as text: CSV and Markdown, written whole or not at all."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

SHOWN: Mapping[str, tuple[float, str]] = {"m": (1e3, "mm"), "m s-2": (1.0, "m/s²"), "1": (1.0, "")}
"""Scale and unit for a person of a unit of a response."""


def number(value: Any) -> str:
    """A number with five digits; a word for NaN and infinity."""
    value = float(value)
    return "–" if value != value else f"{value:.5g}"


def markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown, ending with a line break."""
    lines = [header, ["---"] * len(header), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def of_track(found: xr.Dataset) -> str:
    """Sentence on the track of the numbers in a file, and on the file for the whole line."""
    words = found.attrs.get("track", "")
    if "seed" not in words:
        return f"Our numbers are of: {words or 'tracks that the file does not name'}."
    return (
        f"Our numbers are of one track, the {words}, not of the line: `line.md` says what another "
        "track changes."
    )


def csv_text(rows: Sequence[Mapping[str, object]]) -> str:
    """Rows with common keys as CSV; numbers in full precision."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def write(
    stem: str | Path,
    rows: Sequence[Mapping[str, object]],
    text: str,
    *,
    demonstration: bool,
) -> None:
    """Write a table as CSV and Markdown, both marked if it is a demonstration.

    Parameters
    ----------
    stem
        File name without its ending.
    rows
        Rows of the CSV file, by column.
    text
        The Markdown.
    demonstration
        Whether to mark both as a demonstration.
    """
    stem = Path(stem)
    if demonstration:
        rows = [{**row, "demonstration": "yes"} for row in rows]
        text = f"*Demonstration, not a result.*\n\n{text}"
    write_text(stem.with_name(f"{stem.name}.csv"), csv_text(rows))
    write_text(stem.with_name(f"{stem.name}.md"), text)


def write_text(path: str | Path, text: str) -> None:
    """Write a text aside and rename it."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        aside.write_text(text, encoding="utf-8")
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)
