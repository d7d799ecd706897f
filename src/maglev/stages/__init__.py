"""The stages of the workflow: one module per rule, datasets in, one dataset out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

SECTIONS: Mapping[str, tuple[str, ...]] = {
    "irregularity": ("demonstration", "seed", "train", "guideway", "irregularity", "passage"),
    "modes": ("demonstration", "guideway", "validation.measurements"),
    "passage": ("demonstration", "seed", "train", "guideway", "irregularity", "gains", "passage"),
    "deflection": ("demonstration", "train", "guideway", "passage"),
    "dynamic_factor": (
        "demonstration",
        "seed",
        "train",
        "guideway",
        "irregularity",
        "gains",
        "passage",
        "validation",
    ),
}
"""What each stage reads of the configuration: a change elsewhere leaves its file as it is."""


def config_slice(config: Mapping[str, Any], stage: str) -> dict[str, Any]:
    """The part of a configuration that a stage reads.

    Parameters
    ----------
    config
        The whole configuration, as `Config.quantities` gives it.
    stage
        A key of `SECTIONS`.

    Returns
    -------
    part
        Nested as in ``config``.
    """
    part: dict[str, Any] = {}
    for dotted in SECTIONS[stage]:
        *outer, last = dotted.split(".")
        source, target = config, part
        for key in outer:
            source, target = source[key], target.setdefault(key, {})
        target[last] = source[last]
    return part


def save(
    dataset: Any,
    path: str | Path,
    stage: str,
    config: Any,
    inputs: Mapping[str, str | Path] | None = None,
) -> None:
    """Write a stage's dataset with all that explains it.

    Parameters
    ----------
    dataset : xarray.Dataset
        What the stage has computed.
    path
        File to write.
    stage
        A key of `SECTIONS`.
    config : maglev.parameters.Config
        What it was computed from.
    inputs
        Files it was computed from, by their role.

    Raises
    ------
    ValueError
        If the dataset is not what the stage's layout says.
    """
    from maglev import datasets
    from maglev.fingerprint import code_of

    datasets.write(
        dataset,
        path,
        stage,
        config=config_slice(config.quantities(), stage),
        code=code_of(f"stages.{stage}"),
        inputs=inputs,
    )
