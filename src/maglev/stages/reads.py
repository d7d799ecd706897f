"""Groups of keys of the configuration that several stages read."""

from __future__ import annotations

from maglev.vocabulary import DESIGNED

TRAIN_ON_GUIDEWAY = ("seed", "train", "guideway", "irregularity", "control", "passage")
"""Sections that decide a run of the model, beside its gains."""

OF_CASE = tuple(f"cases.{{case}}.{key}" for key in ("n_spans", "random", "correlation", "track"))
"""What a case says of its runs."""

RUNS_OF_CASE = (*TRAIN_ON_GUIDEWAY, "gains", *OF_CASE)
"""What the runs of a case depend on."""

MEASURED = ("validation.measurements", "validation.measured_here")
"""Keys of the measurements on the guideway."""

N_SAMPLES = ("study.mcm.n_samples", "cases.{case}.n_samples")
"""Keys that decide the size of a baseline."""

RANDOM_QUANTITIES = RUNS_OF_CASE
"""What points of a case are drawn by: any number may be the mean of one that is random."""

PREDICTING = ("seed", "study.confidence", "study.n_population")
"""What a predictor is made with, beside the kind of its surrogate and the responses."""

RESPONSES_OF_STUDY = ("study.responses",)
"""What is predicted: the responses of the study, those of the limit states among them."""

SURROGATE_OF_METHODS = tuple(f"study.{method}.surrogate" for method in DESIGNED)
"""The kind of surrogate of every method."""
