"""Groups of keys of the configuration that several stages read."""

from __future__ import annotations

from maglev.vocabulary import DESIGNED

TRAIN_ON_GUIDEWAY = ("seed", "train", "guideway", "irregularity", "control", "passage")
"""Sections that decide a run of the model, beside its gains."""

RUNS_OF_CASE = (
    *TRAIN_ON_GUIDEWAY,
    "gains",
    "cases.{case}.n_spans",
    "cases.{case}.coefficient_of_variation",
    "cases.{case}.random_gains",
    "cases.{case}.random_track",
)
"""Keys that decide the runs of a case."""

MEASURED = ("validation.measurements", "validation.measured_here")
"""Keys of the measurements on the guideway."""

N_SAMPLES = ("study.mcm.n_samples", "cases.{case}.n_samples")
"""Keys that decide the size of a baseline."""

RANDOM_GAINS = (
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
"""Keys that decide the points of a case."""

PREDICTING = ("seed", "study.confidence", "study.n_population")
"""Keys of a predictor, without the kind of its surrogate."""

SURROGATE_OF_METHODS = tuple(f"study.{method}.surrogate" for method in DESIGNED)
"""The kind of surrogate of every method."""
