"""The stages of the workflow: one module per rule, datasets in, one dataset out."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

_TRAIN_ON_TRACK = ("seed", "train", "guideway", "irregularity", "passage")
_RANDOM_GAINS = (
    "demonstration",
    "seed",
    "gains",
    "cases.{case}.coefficient_of_variation",
    "cases.{case}.random_gains",
    *(  # with what a configuration is checked by: which gains hold the train
        f"train.{kind}_magnet.{key}"
        for kind in ("suspension", "guidance")
        for key in ("gap_reference", "current_reference", "current_max")
    ),
    "passage.gap_contact",
    "passage.gap_lost",
)
_RUNS_OF_CASE = (
    "demonstration",
    *_TRAIN_ON_TRACK,
    "gains",
    "cases.{case}.n_spans",
    "cases.{case}.coefficient_of_variation",
    "cases.{case}.random_gains",
    "cases.{case}.random_track",
)
_N_SAMPLES = ("study.mcm.n_samples", "cases.{case}.n_samples")

_STATISTICS = ("demonstration", "seed", "study.confidence", "study.n_population")
_SURROGATES = tuple(f"study.{method}.surrogate" for method in ("osm", "asm_paper", "asm"))

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
    "points.baseline": (*_RANDOM_GAINS, *_N_SAMPLES),
    "points.representative": (*_RANDOM_GAINS, "study.n_representative", "study.n_counting"),
    "points.osm": (*_RANDOM_GAINS, "study.osm", "study.n_counting"),
    **{  # first design and candidates are drawn together
        f"points.{name}{method}": (*_RANDOM_GAINS, f"study.{method}", "study.n_counting")
        for name in ("", "initial_", "candidates_")
        for method in ("asm_paper", "asm")
    },
    "runs": _RUNS_OF_CASE,
    "runs.track": (*_RUNS_OF_CASE, *_N_SAMPLES),
    "design": (*_RUNS_OF_CASE, "study.failure_probability", "study.{method}"),
    "surrogate": (*_STATISTICS, *_SURROGATES),
    "eev": _STATISTICS,
    "density": _STATISTICS,
    "limits": (*_STATISTICS, "study.failure_probability"),
    "accuracy": (*_STATISTICS, *_SURROGATES, "study.failure_probability"),
    "track_split": ("demonstration", "seed", "study.confidence"),
    "prediction": (*_STATISTICS, *_SURROGATES),
    "stability": ("demonstration", "train", "gains", "control"),
    "train_modes": ("demonstration", "train", "gains", "control"),
    "table1": ("demonstration",),
    "paper_and_ours": ("demonstration",),
    "statistics_check": ("demonstration", "study.confidence", "study.failure_probability"),
}
"""What each stage reads of the configuration: a change elsewhere leaves its file as it is.

``{case}`` and ``{method}`` stand for the names of a case and a method; behind a dot is the part
that the stage makes."""


def config_slice(
    config: Mapping[str, Any], stage: str, case: str | None = None, method: str | None = None
) -> dict[str, Any]:
    """The part of a configuration that a stage reads.

    Parameters
    ----------
    config
        The whole configuration, as `Config.quantities` gives it.
    stage
        A key of `SECTIONS`.
    case
        Name of the case that the stage works on, if it works on one: the others are removed, and
        the guideway has its spans.
    method
        Name of the method that the stage works for, if for one.

    Returns
    -------
    part
        Nested as in ``config``.  Unless the stage reads the methods of the case, they are the one
        method.
    """
    part: dict[str, Any] = {}
    for pattern in SECTIONS[stage]:
        *outer, last = pattern.format(case=case, method=method).split(".")
        source, target = config, part
        for key in outer:
            source, target = source[key], target.setdefault(key, {})
        target[last] = source[last]
    if case is not None:
        own = {"methods": [method or "mcm"], **part.get("cases", {}).get(case, {})}
        part["cases"] = {**dict.fromkeys(config["cases"]), case: own}
        if "guideway" in part:
            n_spans = config["cases"][case]["n_spans"]
            part["guideway"] = {**part["guideway"], "n_spans": n_spans}
    return part


def save(
    dataset: Any,
    path: str | Path,
    stage: str,
    config: Any,
    inputs: Mapping[str, str | Path] | None = None,
    *,
    layout: str | None = None,
    case: str | None = None,
    method: str | None = None,
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
    layout
        A key of `maglev.datasets.LAYOUTS`; the name of the stage if not given.
    case, method
        Names of the case and the method it belongs to, if it belongs to one.

    Raises
    ------
    ValueError
        If the dataset is not what the stage's layout says.
    """
    from maglev import datasets
    from maglev.fingerprint import code_of

    module = stage.split(".")[0]
    names = {"case": case, "method": method}
    datasets.write(
        dataset.assign_attrs({key: name for key, name in names.items() if name is not None}),
        path,
        layout or module,
        config=config_slice(config.quantities(), stage, case, method),
        code=code_of(f"stages.{module}"),
        inputs=inputs,
    )
