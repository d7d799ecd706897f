"""Layouts of all files: dimensions, unit and meaning of every variable; describe, check, write.

One table names every variable of every file once (`VARIABLES`); one table says which file holds
which (`LAYOUTS`).  Files follow the CF conventions, appear whole or not at all, and two writes of
equal data give equal bytes: no time of writing stands inside.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import xarray as xr

from maglev.errors import UserError
from maglev.fingerprint import file_hash
from maglev.vocabulary import (
    BARRIER_SOURCES,
    CAR_RESPONSES,
    DECISIONS,
    DENSITY_METHODS,
    GAIN_UNITS,
    GAINS,
    GROUPS,
    LIMIT_STATUS,
    PAPER_RESPONSES,
    RESPONSE_TABLE,
    RESPONSE_UNITS,
    RESPONSES,
    SIGNED_RESPONSES,
    SOURCES,
    STATUS,
    SURROGATES,
    TIMED_RESPONSES,
    TRAIN_PARTS,
    ResponseEntry,
)

CONVENTIONS = "CF-1.11"
REFERENCES = (
    "Dynamic reliability of a high-speed EMS maglev train on a guideway bridge by an adaptive "
    "surrogate model and probability density evolution, J. Low Freq. Noise Vib. Act. Control "
    "(2024), doi 10.1177/14613484241279033"
)
AXES = "x along travel from the first pier, y to the right, z down; SI units"

OF_RESPONSE = "of the response"
"""Stands for the unit of each response along ``response``, see `RESPONSE_UNITS`."""

TEXT = "str"
"""Type of a variable that is text: names along a dimension, and other words."""

PER_RESPONSE = "one over that of the response"
"""As `OF_RESPONSE`, for a density."""


OF_PARAMETER = "of the parameter"
"""Stands for the SI unit of each random quantity along ``parameter``, which the file names."""


@dataclass(frozen=True, kw_only=True)
class Variable:
    """One variable of a file: dimensions, unit and meaning.

    Parameters
    ----------
    dims
        Names of its dimensions, in order.
    units
        Unit in the notation of UDUNITS; ``"1"`` for a pure number and for text; `OF_RESPONSE` or
        `PER_RESPONSE` for a variable along ``response``, whose rows have each their own unit.
    long_name
        Meaning, in the words of an axis label.
    dtype
        Type in the file; `TEXT` for words.
    flags
        Meaning of each integer value, for a variable that is a code; empty for a number.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    dtype: str = "float64"
    flags: Mapping[int, str] | None = None

    @property
    def rows(self) -> str | None:
        """Dimension along which each row has a unit of its own; None if all have the same."""
        if self.units not in (OF_RESPONSE, PER_RESPONSE):
            return None
        return "response" if "response" in self.dims else "limit_state"

    def attributes(self, units_of_rows: Mapping[str, Sequence[str]] = MappingProxyType({})) -> dict:
        """Attributes of the variable in a file whose rows have these units by dimension."""
        if self.rows is not None:
            units = list(units_of_rows.get(self.rows, ()))
            if self.units == PER_RESPONSE:
                units = [_inverse(unit) for unit in units]
            return {"long_name": self.long_name, f"units_by_{self.rows}": ", ".join(units)}
        if self.dtype == TEXT or self.units == OF_PARAMETER:
            return {"long_name": self.long_name}
        if self.flags is None:
            return {"units": self.units, "long_name": self.long_name}
        return {
            "long_name": self.long_name,
            "flag_values": np.array(list(self.flags), dtype=self.dtype),
            "flag_meanings": " ".join(self.flags.values()),
        }


def _inverse(unit: str) -> str:
    """One over a unit in the notation of UDUNITS, such as ``m-1 s2`` for ``m s-2``."""
    parts = [re.fullmatch(r"([A-Za-z]+)(-?\d+)?", word) for word in unit.split() if word != "1"]
    powers = [(part[1], -int(part[2] or 1)) for part in parts if part is not None]
    return " ".join(f"{name}{power if power != 1 else ''}" for name, power in powers) or "1"


def _number(dims: str, units: str, long_name: str, dtype: str = "float64") -> Variable:
    """A variable on the named dimensions, given as words in one text."""
    return Variable(dims=tuple(dims.split()), units=units, long_name=long_name, dtype=dtype)


def _words(dims: str, long_name: str) -> Variable:
    """A variable that is text on the named dimensions."""
    return Variable(dims=tuple(dims.split()), units="1", long_name=long_name, dtype=TEXT)


def _code(dims: str, long_name: str, meanings: tuple[str, ...] | Mapping[int, str]) -> Variable:
    """A coded variable on the named dimensions; meanings without numbers are counted from 0."""
    return Variable(
        dims=tuple(dims.split()),
        units="1",
        long_name=long_name,
        dtype="int8",
        flags=meanings if isinstance(meanings, Mapping) else dict(enumerate(meanings)),
    )


def _with_ends(
    name: str, of: Variable, low: str = "low", high: str = "high"
) -> dict[str, Variable]:
    """A variable and the two ends of its confidence interval."""
    table = {name: of}
    for end, word in ((low, "lower"), (high, "upper")):
        meaning = f"{word} end of the confidence interval of the {of.long_name}"
        table[f"{name}_{end}"] = Variable(dims=of.dims, units=of.units, long_name=meaning)
    return table


def _model_table() -> dict[str, Variable]:
    """Variables of the model: passages, irregularity, modes, deflection."""
    table = {
        "sample": _number("sample", "1", "number of the passage", "int64"),
        "car": _number("car", "1", "number of the car, 0 at the nose", "int32"),
        "magnet": _number("magnet", "1", "number of the magnet", "int32"),
        "magnet_kind": _code("magnet", "kind of the magnet", {0: "suspension", 1: "guidance"}),
        "magnet_side": _code(
            "magnet", "side of the magnet, looking along travel", {-1: "left", 1: "right"}
        ),
        "magnet_x": _number(
            "magnet", "m", "centre of the magnet along travel, from the nose of the train"
        ),
        "t": _number("t", "s", "time since the start of the passage"),
        "x": _number("x", "m", "distance along travel from the first pier"),
        "side": _code(
            "side", "side of the guideway, looking along travel", {-1: "left", 1: "right"}
        ),
        "wavenumber": _number("wavenumber", "m-1", "wavenumber, one over the wavelength"),
        "mode": _number("mode", "1", "number of the mode from the lowest", "int32"),
        "speed": _number("speed", "m s-1", "speed of the train"),
        "measured_speed": _number("measured_speed", "m s-1", "speed of the measured passage"),
        "status": _code("sample", "end of the passage", STATUS),
        "lost_t": _number("sample", "s", "time at which levitation was lost"),
        "lost_magnet": _number(
            "sample", "1", "number of the magnet that lost levitation, -1 for none", "int32"
        ),
    }
    for name, unit in GAIN_UNITS.items():
        table[name] = _number("sample", unit, f"{name.replace('_', ' ')} of the magnets")
    for name, entry in RESPONSE_TABLE.items():
        table |= _response_variables(name, entry)
    for kind in ("suspension", "guidance"):
        for end, word in (("min", "smallest"), ("max", "largest")):
            table[f"{kind}_gap_{end}"] = _number("sample", "m", f"{word} gap of any {kind} pole")
        table[f"{kind}_current_max"] = _number(
            "sample", "A", f"largest current of any {kind} magnet"
        )
    table["gap_history"] = _number(
        "sample magnet t", "m", "mean gap of the magnet's poles", "float32"
    )
    table["current_history"] = _number(
        "sample magnet t", "A", "mean current of the magnet's poles", "float32"
    )
    for direction in ("vertical", "lateral"):
        table[f"irregularity_{direction}"] = _number(
            "side x", "m", f"{direction} irregularity of the rail"
        )
        table[f"spectrum_{direction}"] = _number(
            "wavenumber",
            "m3",
            f"one-sided spectrum of the {direction} irregularity, estimated by Welch",
        )
        table[f"target_{direction}"] = _number(
            "wavenumber",
            "m3",
            f"one-sided target spectrum of the {direction} irregularity",
        )
        table[f"deviation_{direction}"] = _number(
            "", "m", f"standard deviation of the {direction} irregularity"
        )
    table["frequency"] = _number("mode", "Hz", "natural frequency of the guideway")
    table["direction"] = _code(
        "mode",
        "motion with most of the mode's kinetic energy",
        {0: "longitudinal", 1: "lateral", 2: "vertical", 3: "torsion"},
    )
    for part, where in (("girder", "the girder axis"), ("rail", "the right rail")):
        for axis, word in (("y", "lateral"), ("z", "vertical")):
            table[f"{part}_shape_{axis}"] = _number(
                "mode x", "1", f"{word} motion of {where} in the mode, largest of all four shapes 1"
            )
    table["frequency_simply_supported"] = _number(
        "", "Hz", "first vertical frequency of one span as a simply supported Euler beam"
    )
    table["measured_frequency"] = _number("", "Hz", "first vertical frequency measured on the line")
    table["deflection"] = _number(
        "t", "m", "vertical deflection at midspan of the middle span under the train"
    )
    table["deflection_moving_load"] = _number(
        "t", "m", "vertical deflection at midspan under a moving uniform load, closed form"
    )
    table["static_deflection"] = _number(
        "", "m", "largest vertical deflection at midspan of the middle span, train at rest"
    )
    table["static_deflection_moving_load"] = _number(
        "", "m", "vertical deflection at midspan of a simply supported beam, uniform load"
    )
    table["passage_speed"] = _number("", "m s-1", "speed of the train")
    table["peak_deflection"] = _number(
        "speed", "m", "largest vertical deflection at midspan of the middle span"
    )
    table["dynamic_factor"] = _number(
        "speed", "1", "dynamic coefficient, largest deflection over static deflection"
    )
    table["dynamic_factor_moving_load"] = _number(
        "speed", "1", "dynamic coefficient of a simply supported beam under a moving uniform load"
    )
    table["passage_status"] = _code("speed", "end of the passage", STATUS)
    table["beam_frequency"] = _number(
        "beam_frequency", "Hz", "first vertical frequency of a simply supported beam"
    )
    table["beam_deflection"] = _number(
        "beam_frequency",
        "m",
        "static deflection of this beam with the mass and the load of the model",
    )
    table["model_frequency"] = _number("", "Hz", "first vertical frequency of the model")
    table["car_load"] = _number("", "kg", "mass of a car, by which the train loads the model")
    table["mass_per_length"] = _number("", "kg m-1", "mass of the bridge per length, with rails")
    table["bending_stiffness"] = _number("", "N m2", "vertical bending stiffness of the girder")
    table["measured_static_deflection"] = _number(
        "", "m", "measured deflection over the dynamic coefficient of a moving uniform load"
    )
    table["needed_car_load"] = _number(
        "", "kg", "mass of a car for which a beam would have the measured pair"
    )
    table["needed_mass_per_length"] = _number(
        "", "kg m-1", "mass of the bridge per length for which a beam would have the measured pair"
    )
    table["measured_deflection"] = _number(
        "measured_speed", "m", "largest vertical deflection at midspan measured on the line"
    )
    return table


def _response_variables(name: str, entry: ResponseEntry) -> dict[str, Variable]:
    """Variables of a response: its value, and what is kept beside it."""
    of_one = entry.words.replace(", largest over the cars", "")
    motion = of_one.removeprefix("largest absolute ")
    table = {name: _number("sample", entry.unit, entry.words)}
    if entry.timed:
        table[f"{name}_t"] = _number("sample", "s", f"time of the {entry.words}")
    if entry.kind == "car":
        table[f"{name}_per_car"] = _number("sample car", entry.unit, of_one)
    if name in PAPER_RESPONSES:
        dims = "sample car t" if entry.kind == "car" else "sample t"
        table[f"{name}_history"] = _number(dims, entry.unit, motion, "float32")
    if name in SIGNED_RESPONSES:
        side = "downwards" if name.endswith("_z") else "to the right"
        other = "upwards" if name.endswith("_z") else "to the left"
        table[f"{name}_positive"] = _number("sample", entry.unit, f"largest {motion}, {side}")
        table[f"{name}_negative"] = _number("sample", entry.unit, f"largest {motion}, {other}")
    return table


def _study_table() -> dict[str, Variable]:
    """Variables of the study: point sets, runs, designs, surrogates, densities, limits."""
    level = "response failure_probability"
    step_level = "method step response failure_probability"
    return {
        # coordinates
        "response": _words("response", "response whose extreme is meant"),
        "parameter": _words("parameter", "key of the configuration that is random"),
        "method": _words("method", "method by which the runs were chosen"),
        "case": _words("case", "case of the configuration"),
        "limit_state": _words("limit_state", "limit state that a passage can exceed"),
        "failure_probability": _number(
            "failure_probability", "1", "probability that the limit is exceeded"
        ),
        "round": _number("round", "1", "number of the round, 0 is the first design", "int32"),
        "step": _number("step", "1", "number of the step towards more runs", "int32"),
        "cell": _number("cell", "1", "number of the value", "int32"),
        "check": _number("check", "1", "number of the check", "int32"),
        # points and runs
        "standard": _number(
            "sample parameter", "1", "random quantity in standard form: normal, mean 0, deviation 1"
        ),
        "parameter_value": _number("sample parameter", OF_PARAMETER, "random quantity in SI"),
        "probability": _number("sample", "1", "probability that the sample represents"),
        "discrepancy": _number("", "1", "GF-discrepancy of the points"),
        "counting_error": _number(
            "", "1", "largest standard error of the probabilities by counting"
        ),
        "track_seed": _number("sample", "1", "seed of the irregularity of the sample", "int64"),
        # designs
        "round_index": _number("sample", "1", "round that added the sample", "int32"),
        "predicted": _number("sample response", OF_RESPONSE, "extreme as predicted before the run"),
        "score": _number("sample", "1", "score by which the sample was chosen"),
        "round_n_runs": _number("round", "1", "number of runs after the round", "int32"),
        "error": _number(
            "round response",
            "1",
            "largest absolute error of the predictions of the round, over the standard deviation "
            "of the first design",
        ),
        "rmse": _number(
            "round response",
            OF_RESPONSE,
            "root mean square error of the surrogate after the round against the baseline",
        ),
        "limit_change": _number(
            "round",
            "1",
            "largest change of a limit in the round, over the standard deviation of the response",
        ),
        "round_limit": _number(
            "round response failure_probability",
            OF_RESPONSE,
            "limit by the surrogate after the round",
        ),
        "decision": _code("round", "decision after the round", DECISIONS),
        # surrogates
        "kind": _code("response", "kind of the surrogate", SURROGATES),
        "leave_one_out_error": _number(
            "response", "1", "root mean square leave-one-out error over the standard deviation"
        ),
        "length": _number(
            "response parameter",
            "1",
            "length of the surrogate in standard deviations of the parameter",
        ),
        **_with_ends("lost_probability", _number("", "1", "probability that levitation is lost")),
        **_with_ends("sobol_first", _number("response parameter", "1", "first-order Sobol' index")),
        **_with_ends("sobol_total", _number("response parameter", "1", "total Sobol' index")),
        "amplitude": _number(
            "response", "1", "prior variance of the Kriging over the squared deviation"
        ),
        # predicted extremes
        "deviation": _number(
            "sample response", OF_RESPONSE, "standard deviation of the predicted extreme"
        ),
        "lost_probability_at": _number(
            "sample", "1", "probability that levitation is lost at these gains"
        ),
        # densities
        "value": _number("response cell", OF_RESPONSE, "extreme"),
        "density": _number(
            "response cell",
            PER_RESPONSE,
            "probability density of the extreme of held samples by the GDEE",
        ),
        "density_direct": _number(
            "response cell",
            PER_RESPONSE,
            "probability density of the extreme of held samples, direct",
        ),
        **_with_ends(
            "exceedance",
            _number(
                "response cell", "1", "probability that the extreme is exceeded or levitation lost"
            ),
        ),
        "density_direct_low": _number(
            "response cell", PER_RESPONSE, "lower end of the confidence band of the direct density"
        ),
        "density_direct_high": _number(
            "response cell", PER_RESPONSE, "upper end of the confidence band of the direct density"
        ),
        "bandwidth": _number("response", OF_RESPONSE, "bandwidth of the direct density"),
        "mesh_size": _number("response", OF_RESPONSE, "mesh size of the GDEE"),
        "density_method": _code("response", "method of the density", DENSITY_METHODS),
        "peak": _number(
            "response", PER_RESPONSE, "largest value of the density by the GDEE on its own mesh"
        ),
        "peak_direct": _number("response", PER_RESPONSE, "largest value of the direct density"),
        "mean": _number("response", OF_RESPONSE, "mean of the extreme of held samples"),
        "standard_deviation": _number(
            "response", OF_RESPONSE, "standard deviation of the extreme of held samples"
        ),
        "skewness": _number("response", "1", "skewness of the extreme of held samples"),
        "n_runs": _number("", "1", "number of runs of the model", "int32"),
        # limits
        **_with_ends(
            "limit",
            _number(level, OF_RESPONSE, "limit that is exceeded with the failure probability"),
        ),
        "limit_status": _code(level, "status of the limit", LIMIT_STATUS),
        **_with_ends(
            "held_limit",
            _number(
                level,
                OF_RESPONSE,
                "limit that is exceeded with the failure probability given that levitation holds",
            ),
        ),
        "held_limit_status": _code(
            level, "status of the limit given that levitation holds", LIMIT_STATUS
        ),
        # limit states
        "definition": _words("limit_state", "what the limit state says"),
        "origin": _words("limit_state", "source and confidence of limit and target"),
        "state_response": _words("limit_state", "response that it limits, none for several"),
        "threshold": _number("limit_state", OF_RESPONSE, "value that must not be exceeded"),
        "target": _number("limit_state", "1", "probability that the limit state may have"),
        "sigma": _number("response", OF_RESPONSE, "standard deviation by which errors are divided"),
        # accuracy
        "step_n_runs": _number(
            "method step", "1", "number of runs, 0 where there is none", "int32"
        ),
        "step_limit": _number(step_level, OF_RESPONSE, "limit from this number of runs"),
        "step_limit_error": _number(
            step_level, "1", "limit less that of the baseline, over the standard deviation"
        ),
        "step_held_limit_error": _number(
            step_level,
            "1",
            "limit given that levitation holds less that of the baseline, over the standard "
            "deviation",
        ),
        "step_lost_probability": _number(
            "method step", "1", "share of the baseline's points predicted to be lost"
        ),
        "step_rmse": _number(
            "method step response",
            OF_RESPONSE,
            "root mean square error of the surrogate of this number of runs against the baseline",
        ),
        "step_error": _number(
            "method step response",
            "1",
            "largest absolute error of the surrogate of this number of runs at the next runs of "
            "the design, as many as a round of the method asm has, over the standard deviation",
        ),
        "reference_limit": _number(level, OF_RESPONSE, "limit from the baseline"),
        "reference_half_width": _number(
            level, "1", "half the interval of the baseline's limit, over the standard deviation"
        ),
        "reference_held_limit": _number(
            level, OF_RESPONSE, "limit from the baseline given that levitation holds"
        ),
        "reference_held_half_width": _number(
            level,
            "1",
            "half the interval of the baseline's limit given that levitation holds, over the "
            "standard deviation",
        ),
        # predictions against the baseline
        "computed": _number("sample response", OF_RESPONSE, "extreme of the run"),
        "predicted_by": _number(
            "method sample response", OF_RESPONSE, "extreme as predicted by the method's surrogate"
        ),
        "lost_by": _code(
            "method sample", "whether the method predicts that levitation is lost", ("no", "yes")
        ),
        "prediction_rmse": _number(
            "method response",
            "1",
            "root mean square error of the predictions at the runs that held, over the standard "
            "deviation",
        ),
        "method_n_runs": _number("method", "1", "number of runs of the method's design", "int32"),
        # stability of the suspension
        "grid_proportional": _number(
            "grid_proportional", "A m-1", "suspension proportional gain of the map"
        ),
        "grid_derivative": _number(
            "grid_derivative", "A s m-1", "suspension derivative gain of the map"
        ),
        "growth_rate": _number(
            "grid_derivative grid_proportional",
            "s-1",
            "fastest growth of a motion of one car, linearised over a rigid track with the "
            "configured control; negative where every motion dies out",
        ),
        "mean_growth_rate": _number(
            "", "s-1", "fastest growth of a motion at the mean gains, with the configured control"
        ),
        **{
            f"{gain}_border_{side}": _number(
                "",
                units,
                f"{word} at the border of stability {where} the mean, the other gains at "
                f"their means; NaN if there is none {how}",
            )
            for gain, units, word in (
                ("proportional", "A m-1", "suspension proportional gain"),
                ("derivative", "A s m-1", "suspension derivative gain"),
            )
            for side, where, how in (
                ("low", "below", "down to zero"),
                ("high", "above", "up to ten times the mean"),
            )
        },
        "current_lag": _number("current_lag", "s", "lag of the suspension's current"),
        "proportional_border": _number(
            "current_lag grid_derivative",
            "A m-1",
            "suspension proportional gain at the lower border of stability for each derivative "
            "gain; NaN if there is none in the map, or the mean is unstable",
        ),
        "derivative_border": _number(
            "current_lag grid_proportional",
            "A s m-1",
            "suspension derivative gain at the lower border of stability for each proportional "
            "gain; NaN if there is none, or the mean is unstable",
        ),
        "static_limit": _number(
            "", "A m-1", "least suspension proportional gain at which a magnet can hold: i0/delta0"
        ),
        "mean_proportional": _number("", "A m-1", "mean suspension proportional gain"),
        "mean_derivative": _number("", "A s m-1", "mean suspension derivative gain"),
        # modes of the train
        "train_part": _code("train_part", "moving part of the train", TRAIN_PARTS),
        "train_frequency": _number(
            "mode",
            "Hz",
            "natural frequency of the levitated car, the modulus of the root over 2 pi",
        ),
        "damping_ratio": _number("mode", "1", "damping over critical damping"),
        "kinetic_share": _number(
            "mode train_part", "1", "share of the mode's kinetic energy in the moving part"
        ),
        "moves": _code("mode", "part with most of the mode's kinetic energy", TRAIN_PARTS),
        # random track
        "density_both": _number(
            "response cell",
            PER_RESPONSE,
            "probability density of the extreme, gains and track random",
        ),
        "density_gains_only": _number(
            "response cell",
            PER_RESPONSE,
            "probability density of the extreme, gains random",
        ),
        "density_track_only": _number(
            "response cell",
            PER_RESPONSE,
            "probability density of the extreme, track random",
        ),
        **_with_ends(
            "gains_share",
            _number("response", "1", "share of the variance due to the gains alone"),
        ),
        **_with_ends(
            "track_share",
            _number("response", "1", "share of the variance due to the track alone"),
        ),
        **_with_ends(
            "interaction_share",
            _number(
                "response", "1", "share of the variance due to the interaction of gains and track"
            ),
        ),
        # who shares a circuit
        **{
            f"{kind}_group": _code("curve", f"sharing of the circuits of the {kind}", GROUPS)
            for kind in ("suspension", "guidance")
        },
        **{
            f"{kind}_{late}": _number("curve", "s", f"{word} of the {kind}")
            for kind in ("suspension", "guidance")
            for late, word in (("lag", "lag of the current"), ("delay", "delay of the signal"))
        },
        "curve_mean": _number(
            "curve response", OF_RESPONSE, "mean of the extreme of the runs that held"
        ),
        **_with_ends(
            "curve_deviation",
            _number(
                "curve response",
                OF_RESPONSE,
                "standard deviation of the extreme of the runs that held",
            ),
        ),
        # the line and its tracks
        "track": _number("track", "1", "number of the track", "int32"),
        "seed_of_track": _number("track", "1", "seed of the irregularity of the track", "int64"),
        "extreme": _number("track sample response", OF_RESPONSE, "largest absolute response"),
        "status_on_track": _code("track sample", "end of the passage", STATUS),
        "density_of_track": _number(
            "track response cell",
            PER_RESPONSE,
            "probability density of the extreme on the track, gains random, direct",
        ),
        "density_of_line": _number(
            "response cell",
            PER_RESPONSE,
            "probability density of the extreme, gains and track random: mean over the tracks",
        ),
        "mean_on_track": _number(
            "track response", OF_RESPONSE, "mean of the extreme on the track, gains random"
        ),
        "deviation_on_track": _number(
            "track response", OF_RESPONSE, "standard deviation due to the gains on the track"
        ),
        "skewness_on_track": _number(
            "track response", "1", "skewness of the extreme on the track, gains random"
        ),
        "deviation_of_track": _number(
            "response", OF_RESPONSE, "standard deviation of the means on the tracks"
        ),
        "first_order_on_track": _number(
            "track response parameter", "1", "first-order Sobol' index of the gain on the track"
        ),
        **_with_ends(
            "held_limit_on_track",
            _number(
                "track response failure_probability",
                OF_RESPONSE,
                "limit on the track that is exceeded with the failure probability given that "
                "levitation holds",
            ),
        ),
        "held_limit_on_track_status": _code(
            "track response failure_probability", "status of the limit", LIMIT_STATUS
        ),
        "narrow_limit_on_track": _number(
            "track response failure_probability",
            OF_RESPONSE,
            "the same limit for gains that vary 0.4 times as much",
        ),
        **_with_ends(
            "held_limit_of_line",
            _number(
                "response failure_probability",
                OF_RESPONSE,
                "limit of gains and track both random that is exceeded with the failure "
                "probability given that levitation holds",
            ),
        ),
        "held_limit_of_line_status": _code(
            "response failure_probability", "status of the limit", LIMIT_STATUS
        ),
        "lost_share_on_track": _number(
            "track", "1", "share of the points of the gains at which levitation is lost"
        ),
        # responses over the time of a passage
        "path_step": _number(
            "path_step", "1", "number of the place along the path, every third at a time", "int32"
        ),
        "path": _number(
            "sample response path_step",
            OF_RESPONSE,
            "response at each time, and its two turning points between two times; that of a car "
            "body is its size, largest over the cars",
        ),
        "extreme_of_path": _number("sample response", OF_RESPONSE, "largest absolute response"),
        "quantile_level": _number("quantile_level", "1", "probability that is not exceeded"),
        "value_in_time": _number("response t cell", OF_RESPONSE, "response"),
        "density_in_time": _number(
            "response t cell",
            PER_RESPONSE,
            "probability density of the response of held samples at the time, by the GDEE",
        ),
        "held_in_time": _number("t", "1", "probability that levitation has held until the time"),
        "mean_in_time": _number("response t", OF_RESPONSE, "mean of the response of held samples"),
        "deviation_in_time": _number(
            "response t", OF_RESPONSE, "standard deviation of the response of held samples"
        ),
        "quantile_in_time": _number(
            "response t quantile_level", OF_RESPONSE, "quantile of the response of held samples"
        ),
        "kernel_in_time": _number(
            "response t", OF_RESPONSE, "standard deviation that the scheme adds to each point"
        ),
        "nose": _number("t", "m", "place of the train's nose along travel, from the first pier"),
        "train_length": _number("", "m", "length of the train"),
        "guideway_length": _number("", "m", "length of the guideway, all spans"),
        "barrier": _number(level, OF_RESPONSE, "size of the response that must not be reached"),
        "barrier_source": _code(level, "what the barrier is", BARRIER_SOURCES),
        "reliability": _number(
            f"{level} t",
            "1",
            "probability that the barrier was not reached and levitation held until the time, by "
            "the GDEE with absorbing barriers",
        ),
        "reliability_of_points": _number(
            f"{level} t", "1", "the same share of the weighted histories themselves"
        ),
        "reliability_of_extreme": _number(
            level, "1", "probability that the extreme stays below the barrier and levitation holds"
        ),
        "reliability_error": _number(
            level, "1", "reliability at the end of the passage less that of the extreme"
        ),
        # sweeps
        "setting": _words("setting", "case that a sweep has made"),
        "swept_parameter": _words("swept_parameter", "dotted key that is swept"),
        "swept_value": _number(
            "setting swept_parameter", OF_PARAMETER, "swept value in SI, NaN where it is no number"
        ),
        "swept_text": _words("setting swept_parameter", "swept value as it is written"),
        "extreme_at_mean": _number(
            "setting response",
            OF_RESPONSE,
            "extreme at the mean, or median, of what is random, on the track of the seed",
        ),
        "status_at_mean": _code("setting", "end of that passage", STATUS),
        # what figures show of several files
        "curve": _number("curve", "1", "case and method of the curve, see flag_meanings", "int32"),
        "curve_value": _number("curve response cell", OF_RESPONSE, "extreme"),
        **_with_ends(
            "curve_density",
            _number(
                "curve response cell",
                PER_RESPONSE,
                "probability density of the extreme of held samples",
            ),
        ),
        **_with_ends(
            "curve_exceedance",
            _number(
                "curve response cell",
                "1",
                "probability that the extreme is exceeded or levitation lost",
            ),
        ),
        "curve_held_exceedance": _number(
            "curve response cell",
            "1",
            "probability that the extreme is exceeded given that levitation holds",
        ),
        "curve_peak": _number("curve response", PER_RESPONSE, "largest value of the density"),
        "curve_peak_error": _number(
            "curve response", "1", "largest value of the density over that of the baseline, less 1"
        ),
        "curve_width": _number(
            "curve response",
            OF_RESPONSE,
            "bandwidth of the direct density or mesh size of the GDEE",
        ),
        **_with_ends(
            "curve_limit",
            _number(
                "curve response failure_probability",
                OF_RESPONSE,
                "limit that is exceeded with the failure probability",
            ),
        ),
        **_with_ends(
            "curve_held_limit",
            _number(
                "curve response failure_probability",
                OF_RESPONSE,
                "limit that is exceeded with the failure probability given that levitation holds",
            ),
        ),
        **_with_ends(
            "curve_lost_probability",
            _number("curve", "1", "probability that levitation is lost"),
        ),
        **_with_ends(
            "curve_state_probability",
            _number(
                "curve limit_state",
                "1",
                "probability that the limit state is exceeded or levitation lost",
            ),
        ),
        "curve_n_runs": _number("curve", "1", "number of runs of the model", "int32"),
        "curve_n_lost": _number("curve", "1", "number of runs that lost levitation", "int32"),
        "curve_variation": _number("curve", "1", "coefficient of variation of the gains"),
        "curve_round_n_runs": _number(
            "curve round", "1", "number of runs after the round, 0 where there is none", "int32"
        ),
        "curve_error": _number(
            "curve round response",
            "1",
            "largest absolute error of the predictions of the round, over the standard deviation",
        ),
        "curve_rmse": _number(
            "curve round response",
            OF_RESPONSE,
            "root mean square error of the surrogate after the round against the baseline",
        ),
        # tables and checks
        **_with_ends(
            "table_limit",
            _number(
                "method response failure_probability",
                OF_RESPONSE,
                "limit that is exceeded with the failure probability",
            ),
        ),
        "table_limit_status": _code(
            "method response failure_probability", "status of the limit", LIMIT_STATUS
        ),
        **_with_ends(
            "table_held_limit",
            _number(
                "method response failure_probability",
                OF_RESPONSE,
                "limit that is exceeded with the failure probability given that levitation holds",
            ),
        ),
        "table_held_limit_status": _code(
            "method response failure_probability",
            "status of the limit given that levitation holds",
            LIMIT_STATUS,
        ),
        **_with_ends(
            "table_lost_probability",
            _number("method", "1", "probability that levitation is lost"),
        ),
        "table_n_runs": _number("method", "1", "number of runs of the model", "int32"),
        "source": _code("source", "source of the number", SOURCES),
        "paper_peak": _number(
            "source method", "m-1", "largest density of the girder's vertical displacement"
        ),
        "paper_peak_error": _number(
            "source method", "1", "largest density less that of the baseline, over the latter"
        ),
        "paper_rmse": _number(
            "source method",
            "m",
            "root mean square error of the girder's vertical displacement against the baseline",
        ),
        "paper_rmse_n_runs": _number(
            "source method", "1", "number of runs of the root mean square error", "int32"
        ),
        "paper_n_runs": _number("source method", "1", "number of runs of the method", "int32"),
        "paper_deviation": _number(
            "source method", "m", "standard deviation of the girder's vertical displacement"
        ),
        "check_kind": _code(
            "check",
            "kind of the check",
            (
                "halves_agree",
                "limit_against_baseline",
                "lost_probability_against_baseline",
                "held_halves_agree",
                "held_limit_against_baseline",
            ),
        ),
        "check_case": _words("check", "case that is checked"),
        "check_method": _words("check", "method that is checked"),
        "check_response": _words("check", "response that is checked, none for the loss"),
        "check_failure_probability": _number(
            "check", "1", "failure probability of the limit, 0 where there is none"
        ),
        "check_value": _number(
            "check",
            "1",
            "checked value: a difference of limits over half the interval of the baseline's, "
            "or a probability",
        ),
        "check_low": _number("check", "1", "least value that passes"),
        "check_high": _number("check", "1", "largest value that passes"),
        "check_passed": _code("check", "whether the check passed", ("no", "yes", "not_decidable")),
    }


VARIABLES: Mapping[str, Variable] = _model_table() | _study_table()
"""Every variable and coordinate of every file, by name."""


@dataclass(frozen=True, kw_only=True)
class Layout:
    """One kind of file: its title, its required and its optional variables.

    Variables in ``own`` have here another meaning or other dimensions than in `VARIABLES`.
    """

    title: str
    variables: tuple[str, ...]
    optional: tuple[str, ...] = ()
    own: Mapping[str, Variable] = field(default_factory=dict)

    def variable(self, name: str) -> Variable:
        """What a variable of this file is."""
        return self.own[name] if name in self.own else VARIABLES[name]


_EXTREMES = (
    *GAINS,
    *RESPONSES,
    *(f"{name}_t" for name in TIMED_RESPONSES),
    *(f"{name}_per_car" for name in CAR_RESPONSES),
    *(f"{name}_{part}" for name in SIGNED_RESPONSES for part in ("positive", "negative")),
    "suspension_gap_min",
    "suspension_gap_max",
    "guidance_gap_min",
    "guidance_gap_max",
    "suspension_current_max",
    "guidance_current_max",
    "status",
    "lost_t",
    "lost_magnet",
)
_HISTORIES = (
    *(f"{name}_history" for name in PAPER_RESPONSES),
    "gap_history",
    "current_history",
    "magnet_kind",
    "magnet_side",
    "magnet_x",
)
_RUNS = (*_EXTREMES, "standard", "parameter_value", "probability")
_ROUNDS = (
    "predicted",
    "score",
    "round_n_runs",
    "error",
    "rmse",
    "round_limit",
    "limit_change",
    "decision",
)


def _ends(*names: str) -> tuple[str, ...]:
    """Variables with the two ends of their intervals."""
    return tuple(f"{name}{end}" for name in names for end in ("", "_low", "_high"))


def _of_states(dims: str) -> dict[str, Variable]:
    """Probabilities of limit states, with their intervals, on the named dimensions."""
    held = "probability that the limit state is exceeded given that levitation holds"
    return {
        **_with_ends(
            "probability",
            _number(dims, "1", "probability that the limit state is exceeded or levitation lost"),
        ),
        **_with_ends("held_probability", _number(dims, "1", held)),
        **_with_ends("beta", _number(dims, "1", "reliability index of the probability")),
    }


def _of_limits(dims: str) -> dict[str, Variable]:
    """Limits, with their intervals and status, on the named dimensions."""
    table: dict[str, Variable] = {}
    for name, given in (("limit", ""), ("held_limit", " given that levitation holds")):
        meaning = f"limit that is exceeded with the failure probability{given}"
        table |= _with_ends(name, _number(dims, OF_RESPONSE, meaning))
        table[f"{name}_status"] = _code(dims, f"status of the limit{given}", LIMIT_STATUS)
    return table


_LIMITS = (*_ends("limit", "held_limit"), "limit_status", "held_limit_status")
_STATES = ("definition", "origin", "state_response", "threshold", "target")


LAYOUTS: Mapping[str, Layout] = {
    "passage": Layout(
        title="Passage of the train over the guideway",
        variables=_EXTREMES,
        optional=(*_HISTORIES, "track_seed", "parameter_value"),
    ),
    "irregularity": Layout(
        title="Track irregularity and its spectra",
        variables=tuple(
            f"{what}_{direction}"
            for what in ("irregularity", "spectrum", "target", "deviation")
            for direction in ("vertical", "lateral")
        ),
    ),
    "modes": Layout(
        title="Natural modes of the guideway",
        variables=(
            "frequency",
            "direction",
            "girder_shape_y",
            "girder_shape_z",
            "rail_shape_y",
            "rail_shape_z",
            "frequency_simply_supported",
        ),
        optional=("measured_frequency",),
    ),
    "train_modes": Layout(
        title="Natural modes of one levitated car at the mean gains",
        variables=("train_frequency", "damping_ratio", "kinetic_share", "moves"),
    ),
    "deflection": Layout(
        title="Midspan deflection under the passing train",
        variables=(
            "deflection",
            "deflection_moving_load",
            "static_deflection_moving_load",
            "passage_speed",
        ),
    ),
    "dynamic_factor": Layout(
        title="Dynamic coefficient of the midspan deflection against speed",
        variables=(
            "peak_deflection",
            "dynamic_factor",
            "dynamic_factor_moving_load",
            "static_deflection",
            "static_deflection_moving_load",
            "passage_status",
        ),
        optional=("measured_deflection",),
    ),
    "stiffness_check": Layout(
        title="Static deflection against first frequency, whatever the stiffness",
        variables=(
            "beam_deflection",
            "model_frequency",
            "static_deflection",
            "car_load",
            "mass_per_length",
            "bending_stiffness",
        ),
        optional=(
            "measured_frequency",
            "measured_static_deflection",
            "needed_car_load",
            "needed_mass_per_length",
        ),
    ),
    "points": Layout(
        title="Points of the random gains",
        variables=(
            *GAINS,
            "standard",
            "parameter_value",
            "probability",
            "discrepancy",
            "counting_error",
        ),
    ),
    "runs": Layout(
        title="Extremes of the runs of a case",
        variables=_RUNS,
        optional=("track_seed",),
    ),
    "design": Layout(
        title="Runs of a design, by the round that added them",
        variables=(*_RUNS, "round_index", *_ROUNDS),
    ),
    "round": Layout(
        title="One round of a design: its runs and its decision",
        variables=(*_RUNS, *_ROUNDS),
    ),
    "surrogate": Layout(
        title="Surrogate of a design: its kinds, errors and Sobol' indices",
        variables=(
            "kind",
            "leave_one_out_error",
            "length",
            "amplitude",
            *_ends("lost_probability", "sobol_first", "sobol_total"),
        ),
    ),
    "eev": Layout(
        title="Predicted extremes at the representative points",
        variables=(
            *GAINS,
            "standard",
            "probability",
            "predicted",
            "deviation",
            "lost_probability_at",
        ),
    ),
    "density": Layout(
        title="Probability density and exceedance of the extremes",
        variables=(
            "value",
            "density",
            "density_direct",
            *_ends("exceedance"),
            "bandwidth",
            "mesh_size",
            "density_method",
            "peak",
            "peak_direct",
            "mean",
            "standard_deviation",
            "skewness",
            "lost_probability",
            "n_runs",
        ),
        optional=("density_direct_low", "density_direct_high"),
    ),
    "limits": Layout(
        title="Limits of the extremes at given failure probabilities",
        variables=(
            *_ends("limit", "held_limit", "lost_probability"),
            "limit_status",
            "held_limit_status",
            "n_runs",
            "sigma",
        ),
    ),
    "limit_states": Layout(
        title="Probabilities of the limit states of a passage",
        variables=(
            *_STATES,
            *_ends("probability", "held_probability", "beta"),
            "n_runs",
        ),
        own=_of_states("limit_state"),
    ),
    "limit_state_table": Layout(
        title="Probabilities of the limit states by every case and method",
        variables=(
            *_STATES,
            *_ends("probability", "held_probability", "beta"),
            "n_runs",
        ),
        own=_of_states("case method limit_state")
        | {
            "n_runs": _number(
                "case method", "1", "number of runs of the model, 0 where there is none", "int32"
            )
        },
    ),
    "limits_table": Layout(
        title="Limits of the extremes by every case and method",
        variables=(*_LIMITS, *_ends("lost_probability"), "n_runs"),
        own=_of_limits("case method response failure_probability")
        | _with_ends(
            "lost_probability", _number("case method", "1", "probability that levitation is lost")
        )
        | {
            "n_runs": _number(
                "case method", "1", "number of runs of the model, 0 where there is none", "int32"
            )
        },
    ),
    "sweep": Layout(
        title="Limits, limit states and extremes at the mean along a swept key",
        variables=(
            "swept_value",
            "swept_text",
            *_LIMITS,
            *_STATES,
            *_ends("probability", "held_probability", "beta"),
            "extreme_at_mean",
            "status_at_mean",
            "n_runs",
        ),
        own=_of_limits("setting response failure_probability")
        | _of_states("setting limit_state")
        | {"n_runs": _number("setting", "1", "number of runs of the model", "int32")},
    ),
    "accuracy": Layout(
        title="Accuracy of limits against number of runs",
        variables=(
            "step_n_runs",
            "step_limit",
            "step_limit_error",
            "step_held_limit_error",
            "step_lost_probability",
            "step_rmse",
            "step_error",
            "reference_limit",
            "reference_half_width",
            "reference_held_limit",
            "reference_held_half_width",
            "sigma",
        ),
    ),
    "prediction": Layout(
        title="Extremes as predicted by the methods against those of the baseline",
        variables=(
            "computed",
            "status",
            "predicted_by",
            "lost_by",
            "prediction_rmse",
            "method_n_runs",
            "sigma",
        ),
    ),
    "stability": Layout(
        title="Stability of the levitated train by the gains of the suspension",
        variables=(
            "growth_rate",
            "mean_growth_rate",
            "static_limit",
            "proportional_border_low",
            "proportional_border_high",
            "derivative_border_low",
            "derivative_border_high",
            "proportional_border",
            "derivative_border",
            "mean_proportional",
            "mean_derivative",
        ),
    ),
    "track_split": Layout(
        title="Contributions of random gains and a random track to the extremes",
        variables=(
            "value",
            "density_both",
            "density_gains_only",
            "density_track_only",
            *_ends("gains_share", "track_share", "interaction_share"),
            "n_runs",
        ),
    ),
    "control_study": Layout(
        title="Effect of the control circuits on losses, deviations and limits",
        variables=(
            *(
                f"{kind}_{key}"
                for kind in ("suspension", "guidance")
                for key in ("group", "lag", "delay")
            ),
            "curve_mean",
            *_ends("curve_deviation", "curve_limit", "curve_held_limit", "curve_lost_probability"),
            "curve_n_runs",
        ),
    ),
    "tracks": Layout(
        title="Extremes of the same gains on each of many tracks",
        variables=(*GAINS, "standard", "seed_of_track", "extreme", "status_on_track"),
    ),
    "line": Layout(
        title="Densities, limits and shares of the variance on the line and on its tracks",
        variables=(
            "seed_of_track",
            "value",
            "density_of_track",
            "density_of_line",
            *_ends("gains_share", "track_share", "interaction_share"),
            "mean_on_track",
            "deviation_on_track",
            "skewness_on_track",
            "deviation_of_track",
            "first_order_on_track",
            *_ends("held_limit_on_track", "held_limit_of_line"),
            "held_limit_on_track_status",
            "held_limit_of_line_status",
            "narrow_limit_on_track",
            "lost_share_on_track",
            "n_runs",
        ),
    ),
    "histories": Layout(
        title="Histories of responses, thinned",
        variables=(*GAINS, "path", "extreme_of_path", "status", "lost_t"),
        optional=("track_seed",),
    ),
    "density_in_time": Layout(
        title="Density and first-passage reliability of responses over the time of a passage",
        variables=(
            "value_in_time",
            "density_in_time",
            "held_in_time",
            "mean_in_time",
            "deviation_in_time",
            "quantile_in_time",
            "kernel_in_time",
            "nose",
            "train_length",
            "guideway_length",
            "barrier",
            "barrier_source",
            "reliability",
            "reliability_of_points",
            "reliability_of_extreme",
            "reliability_error",
            "n_runs",
        ),
    ),
    "table1": Layout(
        title="Limits of the extremes by each method",
        variables=(
            *_ends("table_limit", "table_held_limit", "table_lost_probability"),
            "table_limit_status",
            "table_held_limit_status",
            "table_n_runs",
        ),
    ),
    "paper_and_ours": Layout(
        title="What survives of the paper's numbers, and ours",
        variables=(
            "paper_peak",
            "paper_peak_error",
            "paper_rmse",
            "paper_rmse_n_runs",
            "paper_n_runs",
            "paper_deviation",
        ),
    ),
    "statistics_check": Layout(
        title="Whether the statistics mean something",
        variables=(
            "check_kind",
            "check_case",
            "check_method",
            "check_response",
            "check_failure_probability",
            "check_value",
            "check_low",
            "check_high",
            "check_passed",
        ),
    ),
}
"""Variables of each kind of file, by its name."""


def _known(name: str) -> Iterator[Variable]:
    """Every meaning of a name in any file."""
    if name in VARIABLES:
        yield VARIABLES[name]
    yield from (layout.own[name] for layout in LAYOUTS.values() if name in layout.own)


def _units_of_rows(dataset: xr.Dataset) -> dict[str, list[str]]:
    """Unit of each response and of each limit state of a dataset, by dimension."""
    names = {"response": "response", "limit_state": "state_response"}
    return {
        dim: [str(RESPONSE_UNITS.get(str(one), "1")) for one in dataset[name].to_numpy()]
        for dim, name in names.items()
        if name in dataset.variables
    }


def describe(dataset: xr.Dataset) -> xr.Dataset:
    """Give every variable its unit and meaning from `VARIABLES`; arrays are not copied.

    Raises
    ------
    ValueError
        If a variable is not in `VARIABLES` or stands on other dimensions than written there.

    Examples
    --------
    >>> described = describe(xr.Dataset({"mass_per_length": 6000.0}))
    >>> described["mass_per_length"].attrs["units"]
    'kg m-1'
    """
    described = dataset.copy(deep=False)
    units = _units_of_rows(dataset)
    for name in described.variables:
        known = list(_known(str(name)))
        if not known:
            raise ValueError(f"'{name}' is no variable of any file, see maglev.datasets.VARIABLES")
        fitting = [one for one in known if one.dims == described[name].dims]
        if not fitting:
            raise ValueError(
                f"'{name}' must stand on {known[0].dims}, got {tuple(described[name].dims)}"
            )
        described[name].attrs = {**described[name].attrs, **fitting[0].attributes(units)}
    return described


def check(dataset: xr.Dataset, layout: str) -> None:
    """Refuse a dataset that departs from its layout.

    Parameters
    ----------
    dataset
        As computed or as read from a file.
    layout
        A key of `LAYOUTS`.

    Raises
    ------
    ValueError
        If a variable is missing or unexpected, or has another unit or other dimensions than
        `VARIABLES` says.

    Examples
    --------
    >>> check(xr.Dataset(), "points")
    Traceback (most recent call last):
        ...
    ValueError: points: 'suspension_proportional_gain' is missing
    """
    mistake = _mistake(dataset, layout)
    if mistake is not None:
        raise ValueError(mistake)


def _mistake(dataset: xr.Dataset, layout: str) -> str | None:
    """Where a dataset first departs from its layout, as a sentence."""
    known = LAYOUTS[layout]
    for name in known.variables:
        if name not in dataset.variables:
            return f"{layout}: '{name}' is missing"
    for name in map(str, dataset.dims):
        text = any(one.dtype == TEXT for one in _known(name))
        if text and not (name in dataset.variables and dataset[name].dtype.kind in "UO"):
            return f"{layout}: '{name}' must name its places in words"
    for name in map(str, dataset.variables):
        if name in dataset.dims:
            continue
        if name not in (*known.variables, *known.optional):
            return f"{layout}: '{name}' does not belong here"
        expected, found = known.variable(name), dataset[name]
        if tuple(found.dims) != expected.dims:
            return f"{layout}: '{name}' must stand on {expected.dims}, got {tuple(found.dims)}"
        units = found.attrs.get("units")
        if "units" in expected.attributes() and units != expected.units:
            return f"{layout}: '{name}' must be in '{expected.units}', got '{units}'"
    return None


def provenance(
    layout: str,
    *,
    config: Mapping[str, Any],
    code: str,
    inputs: Mapping[str, str | Path] | None = None,
) -> dict[str, str | int]:
    """Return the global attributes of a file: title, source, configuration, code and inputs.

    Parameters
    ----------
    layout
        A key of `LAYOUTS`.
    config
        The part of the configuration that decides the content, units included; its ``seed``
        and ``demonstration`` are also given on their own.
    code
        Fingerprint of the code that computed it.
    inputs
        Files read, by their role.

    Examples
    --------
    >>> found = provenance("points", config={"seed": 3, "demonstration": False}, code="abc")
    >>> found["seed"]
    3
    """
    attributes: dict[str, str | int] = {
        "Conventions": CONVENTIONS,
        "title": LAYOUTS[layout].title,
        "source": f"maglev {version('maglev')}",
        "history": f"written by the stage '{layout}' of maglev {version('maglev')}",
        "references": REFERENCES,
        "axes": AXES,
        "layout": layout,
        "config": json.dumps(config, sort_keys=True, ensure_ascii=False),
        "code": code,
        "demonstration": "yes" if config.get("demonstration") else "no",
    }
    if "seed" in config:
        attributes["seed"] = int(config["seed"])
    for role, path in sorted((inputs or {}).items()):
        attributes[f"input_{role}"] = f"sha256:{file_hash(path)}"
    if config.get("demonstration"):
        attributes["title"] = f"{attributes['title']} (demonstration, not a result)"
    return attributes


def carried(dataset: xr.Dataset) -> dict[str, Any]:
    """Attributes that a file takes over from its sources: steps and track of the passages.

    Examples
    --------
    >>> carried(xr.Dataset(attrs={"track": "smooth track", "title": "Passage"}))
    {'track': 'smooth track'}
    """
    kept = ("time_step", "n_steps", "track")
    return {name: dataset.attrs[name] for name in kept if name in dataset.attrs}


def write(
    dataset: xr.Dataset,
    path: str | Path,
    layout: str,
    *,
    config: Mapping[str, Any],
    code: str,
    inputs: Mapping[str, str | Path] | None = None,
) -> None:
    """Describe, check and write a dataset; the file appears whole or not at all.

    The parameters beside ``dataset`` and ``path`` are those of `provenance`.

    Raises
    ------
    ValueError
        As `describe` and `check` do.
    """
    described = describe(dataset)
    check(described, layout)
    attributes = provenance(layout, config=config, code=code, inputs=inputs)
    described.attrs = {**dataset.attrs, **attributes}
    write_netcdf(described, path)


def write_netcdf(dataset: xr.Dataset, path: str | Path) -> None:
    """Write a described dataset aside and rename it, byte for byte reproducibly.

    Variables are compressed (zlib 4, shuffled) in the type that `VARIABLES` names; attributes are
    written in alphabetical order.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "mass.nc"
    ...     write_netcdf(describe(xr.Dataset({"mass_per_length": 6000.0})), path)
    ...     xr.load_dataset(path)["mass_per_length"].attrs["long_name"]
    'mass of the bridge per length, with rails'
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    ordered = dataset.copy(deep=False)
    ordered.attrs = dict(sorted(dataset.attrs.items()))
    encoding: dict[str, dict[str, Any]] = {}
    for name in map(str, ordered.variables):
        dtype = next(one.dtype for one in _known(name) if one.dims == ordered[name].dims)
        if dtype == TEXT:
            encoding[name] = {"dtype": str}
            ordered[name].encoding = {}
            continue
        encoding[name] = {"dtype": dtype, "_FillValue": None}
        if ordered[name].ndim:
            encoding[name] |= {"zlib": True, "complevel": 4, "shuffle": True}
    aside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        ordered.to_netcdf(aside, engine="netcdf4", format="NETCDF4", encoding=encoding)
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)


def read(path: str | Path, layout: str) -> xr.Dataset:
    """Read a file into memory and check it against its layout.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    PermissionError
        If it may not be read.
    UserError
        If it is not NetCDF, or not of that layout, as `check` says.
    """
    if not Path(path).is_file():
        raise FileNotFoundError(f"there is no file {path}")
    try:
        dataset = xr.load_dataset(path, engine="netcdf4")
    except PermissionError:
        raise
    except OSError as error:
        raise UserError(f"{path} cannot be read as NetCDF: {error.strerror}") from error
    mistake = _mistake(dataset, layout)
    if mistake is not None:
        raise UserError(f"{path} is not of its layout: {mistake}")
    return dataset
