"""Vocabulary: names of responses, gains, methods, statuses and decisions.

Configuration, files, stages, rules and figures take them from here, so that a word is spelt once
and its order is the same everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias, get_args

Kind = Literal["girder", "car", "magnet", "bearing"]
"""What a response is of."""


class ResponseEntry(NamedTuple):
    """What is said of a response wherever it is named."""

    unit: str  # in the notation of UDUNITS
    words: str  # meaning of the value
    kind: Kind  # those of a car are the largest over the cars, and are kept for each
    timed: bool = True  # whether the value is of one moment, which is kept


RecordedResponse = Literal[
    "girder_displacement_z",
    "girder_displacement_y",
    "girder_acceleration_z",
    "girder_acceleration_y",
    "car_body_acceleration_z",
    "car_body_acceleration_y",
]
"""A response whose history is recorded."""

_GIRDER = "of the girder at midspan of the middle span"
_CAR = "of the car body, largest over the cars"
_END = "at the ends of the car body's floor, largest over the cars"
_POLE = "from its reference, of any pole"
_SHARE = "as a share of the largest that the chopper gives"
RESPONSE_TABLE: Mapping[str, ResponseEntry] = {
    "girder_displacement_z": ResponseEntry(
        "m", f"largest absolute vertical displacement {_GIRDER}", "girder"
    ),
    "girder_displacement_y": ResponseEntry(
        "m", f"largest absolute lateral displacement {_GIRDER}", "girder"
    ),
    "girder_acceleration_z": ResponseEntry(
        "m s-2", f"largest absolute vertical acceleration {_GIRDER}", "girder"
    ),
    "girder_acceleration_y": ResponseEntry(
        "m s-2", f"largest absolute lateral acceleration {_GIRDER}", "girder"
    ),
    "car_body_acceleration_z": ResponseEntry(
        "m s-2", f"largest absolute vertical acceleration {_CAR}", "car"
    ),
    "car_body_acceleration_y": ResponseEntry(
        "m s-2", f"largest absolute lateral acceleration {_CAR}", "car"
    ),
    "suspension_gap_excursion": ResponseEntry(
        "m", f"largest absolute excursion of the suspension gap {_POLE}", "magnet", timed=False
    ),
    "guidance_gap_excursion": ResponseEntry(
        "m", f"largest absolute excursion of the guidance gap {_POLE}", "magnet", timed=False
    ),
    "suspension_current_share": ResponseEntry(
        "1", f"largest current of any suspension magnet {_SHARE}", "magnet", timed=False
    ),
    "guidance_current_share": ResponseEntry(
        "1", f"largest current of any guidance magnet {_SHARE}", "magnet", timed=False
    ),
    "car_end_acceleration_z": ResponseEntry(
        "m s-2", f"largest absolute vertical acceleration {_END}", "car"
    ),
    "car_end_acceleration_y": ResponseEntry(
        "m s-2", f"largest absolute lateral acceleration {_END}", "car"
    ),
    "sperling_index_z": ResponseEntry(
        "1", f"Sperling index of the vertical vibration {_END}", "car", timed=False
    ),
    "sperling_index_y": ResponseEntry(
        "1", f"Sperling index of the lateral vibration {_END}", "car", timed=False
    ),
    "iso2631_rms_z": ResponseEntry(
        "m s-2",
        f"r.m.s. vertical acceleration weighted by W_k of ISO 2631-1 {_END}",
        "car",
        timed=False,
    ),
    "iso2631_rms_y": ResponseEntry(
        "m s-2",
        f"r.m.s. lateral acceleration weighted by W_d of ISO 2631-1 {_END}",
        "car",
        timed=False,
    ),
    "dynamic_coefficient": ResponseEntry(
        "1",
        f"largest absolute vertical displacement {_GIRDER} over the largest under the train at "
        "rest",
        "girder",
    ),
    "deflection_over_span": ResponseEntry(
        "1", f"largest absolute vertical displacement {_GIRDER} over the span", "girder"
    ),
    "bearing_uplift": ResponseEntry(
        "m",
        "largest lift of the girder off any bearing of the middle span, from rest under dead "
        "weight",
        "bearing",
    ),
}
"""Every response that a passage is judged by: its unit and its meaning, in the order of files."""

RESPONSES: tuple[str, ...] = tuple(RESPONSE_TABLE)
"""All responses in the order in which they are shown."""

PAPER_RESPONSES: tuple[str, ...] = RESPONSES[:6]
"""The responses of the paper: midspan and car bodies."""

if TYPE_CHECKING:
    Response: TypeAlias = str
else:
    Response = Literal[RESPONSES]
"""A response of a passage: a name in `RESPONSE_TABLE`."""

TIMED_RESPONSES: tuple[Response, ...] = tuple(
    name for name, entry in RESPONSE_TABLE.items() if entry.timed
)
"""The responses whose values are each of one moment, kept as ``<name>_t``."""

CAR_RESPONSES: tuple[Response, ...] = tuple(
    name for name, entry in RESPONSE_TABLE.items() if entry.kind == "car"
)
"""The responses of cars, kept for each car as ``<name>_per_car``."""

SIGNED_RESPONSES: tuple[Response, ...] = PAPER_RESPONSES[:4]
"""The responses whose largest values of either sign are kept, as ``<name>_positive`` and
``<name>_negative``."""

RESPONSE_WORDS: Mapping[Response, str] = {
    name: entry.words.removeprefix("largest absolute ") for name, entry in RESPONSE_TABLE.items()
}
"""Meaning of each response, as it stands before "exceeds a limit"."""

RESPONSE_UNITS: Mapping[Response, str] = {
    name: entry.unit for name, entry in RESPONSE_TABLE.items()
}
"""Unit of each response in the notation of UDUNITS."""

Gain = Literal[
    "suspension_proportional",
    "suspension_derivative",
    "guidance_proportional",
    "guidance_derivative",
]
"""A gain, named as in the section ``gains`` of the configuration."""

GAIN_KEYS: tuple[Gain, ...] = get_args(Gain)
"""The gains in the order of the columns of the array that `maglev.simulate` takes."""

GAINS = tuple(f"{key}_gain" for key in GAIN_KEYS)
"""Names of the gains in files, in the same order."""

GAIN_UNITS: Mapping[str, str] = {
    name: "A m-1" if "proportional" in name else "A s m-1" for name in GAINS
}
"""Unit of each gain in the notation of UDUNITS."""

Method = Literal["mcm", "osm", "asm_paper", "asm"]
"""Choice of the runs of a case: plain Monte Carlo, one-stage set, adaptive as published,
adaptive towards the limits."""

METHODS: tuple[Method, ...] = get_args(Method)
"""The methods in the order in which they are shown."""

BASELINE: Method = "mcm"
"""The method whose runs are the baseline, to which others are compared."""

DESIGNED: tuple[Method, ...] = tuple(name for name in METHODS if name != BASELINE)
"""The methods that make a design and predict by a surrogate."""

ADAPTIVE: tuple[Method, ...] = ("asm_paper", "asm")
"""The methods whose designs grow in rounds."""

Surrogate = Literal["rbf", "scaled_rbf", "kriging"]
"""A kind of surrogate."""

SURROGATES: tuple[Surrogate, ...] = get_args(Surrogate)
"""The kinds of surrogate."""

STATUS = {0: "completed", 1: "contact", 2: "gap_lost", 3: "not_finite", 4: "step_too_large"}
"""End of a passage: completed, lost in one of three ways, or not judged."""

STEP_TOO_LARGE = 4
"""Status of a passage that was not judged: its gains need a smaller step."""

Group = Literal["pole", "ends", "half", "lumped"]
"""Sharing of a circuit of the control among poles."""

GROUPS: tuple[Group, ...] = get_args(Group)
"""The groups in the order in which they are shown."""

TRAIN_PARTS = (
    "car_body_lateral",
    "car_body_vertical",
    "car_body_roll",
    "car_body_pitch",
    "car_body_yaw",
    "bogies",
    "rods",
    "suspension_magnets",
    "guidance_magnets",
)
"""Part of the train that moves in a mode."""

DECISIONS = (
    "go_on",
    "error_below_threshold",
    "limits_settled",
    "largest_number_of_runs",
)
"""Decision after a round of an adaptive design."""

GIVEN, TOO_FEW, INFINITE = LIMIT_STATUS = ("given", "too_few_exceedances", "infinite")
"""Status of a limit: given; too few exceedances in the sample; infinite, because losses alone are
likelier than the failure probability."""

DENSITY_METHODS = ("gdee", "gdee_of_the_logarithm", "direct")
"""Method of a density: the GDEE; the GDEE of the logarithm of the extreme, where strays need too
fine a mesh; direct, where there is no GDEE or it refused both."""

BARRIER_SOURCES = ("limit", "mean_and_deviations")
"""What a barrier of the first passage is: the limit of the extreme at the failure probability; or,
where none is given, its mean and as many deviations as a normal variate has at that probability."""

SOURCES = ("paper", "ours")
"""Source of a number."""

LOST = "lost"
"""The limit state that is always there: levitation is lost."""

TRACK_PARTS = ("gains_only", "track_only", "other_track", "other_gains")
"""Further runs of a case whose baseline has gains i on track i: gains i on the configured track;
mean gains on track i; gains i on track n + i; gains n + i on track i (n samples)."""
