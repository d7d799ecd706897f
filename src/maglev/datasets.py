"""Layouts of all files: dimensions, unit and meaning of every variable; describe, check, write.

One table names every variable of every file once (`VARIABLES`); one table says which file holds
which (`LAYOUTS`).  Files follow the CF conventions, appear whole or not at all, and two writes of
equal data give equal bytes: no time of writing stands inside.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from maglev.errors import UserError
from maglev.fingerprint import file_hash
from maglev.vocabulary import (
    DECISIONS,
    DENSITY_METHODS,
    GAIN_UNITS,
    GAINS,
    GROUPS,
    LIMIT_STATUS,
    METHODS,
    RESPONSE_UNITS,
    RESPONSE_WORDS,
    RESPONSES,
    SOURCES,
    STATUS,
    SURROGATES,
    TRAIN_PARTS,
)

CONVENTIONS = "CF-1.11"
REFERENCES = (
    "Dynamic reliability of a high-speed EMS maglev train on a guideway bridge by an adaptive "
    "surrogate model and probability density evolution, J. Low Freq. Noise Vib. Act. Control "
    "(2024), doi 10.1177/14613484241279033"
)
AXES = "x along travel from the first pier, y to the right, z down; SI units"

OF_RESPONSE = "of the response"
"""In place of a unit: that of the response along ``response``, see `RESPONSE_UNITS`."""

PER_RESPONSE = "one over that of the response"
"""As `OF_RESPONSE`, for a density."""


@dataclass(frozen=True, kw_only=True)
class Variable:
    """One variable of a file: dimensions, unit and meaning.

    Parameters
    ----------
    dims
        Names of its dimensions, in order.
    units
        Unit in the notation of UDUNITS; ``"1"`` for a pure number; `OF_RESPONSE` or
        `PER_RESPONSE` for a variable along ``response``, whose rows have each their own unit.
    long_name
        What it is, as an axis label would say it.
    dtype
        Type in the file.
    flags
        Meaning of each integer value, for a variable that is a code; empty for a number.
    """

    dims: tuple[str, ...]
    units: str
    long_name: str
    dtype: str = "float64"
    flags: Mapping[int, str] | None = None

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of the variable in a file."""
        if self.units in (OF_RESPONSE, PER_RESPONSE):
            units = list(RESPONSE_UNITS.values())
            if self.units == PER_RESPONSE:
                units = [{"m": "m-1", "m s-2": "m-1 s2"}[unit] for unit in units]
            return {"long_name": self.long_name, "units_by_response": ", ".join(units)}
        if self.flags is None:
            return {"units": self.units, "long_name": self.long_name}
        return {
            "long_name": self.long_name,
            "flag_values": np.array(list(self.flags), dtype=self.dtype),
            "flag_meanings": " ".join(self.flags.values()),
        }


def _number(dims: str, units: str, long_name: str, dtype: str = "float64") -> Variable:
    """A variable on the named dimensions, given as words in one text."""
    return Variable(dims=tuple(dims.split()), units=units, long_name=long_name, dtype=dtype)


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
        "status": _code("sample", "how the passage ended", STATUS),
        "lost_t": _number("sample", "s", "time at which levitation was lost"),
        "lost_magnet": _number(
            "sample", "1", "number of the magnet that lost levitation, -1 for none", "int32"
        ),
    }
    for name, unit in GAIN_UNITS.items():
        table[name] = _number("sample", unit, f"{name.replace('_', ' ')} of the magnets")
    for name, meaning in RESPONSE_WORDS.items():
        unit = RESPONSE_UNITS[name]
        table[name] = _number("sample", unit, f"largest absolute {meaning}")
        table[f"{name}_t"] = _number("sample", "s", f"time of the largest absolute {meaning}")
        of_car = name.startswith("car_body")
        table[f"{name}_history"] = _number(
            "sample car t" if of_car else "sample t",
            unit,
            meaning.replace(", largest over the cars", ""),
            "float32",
        )
        if of_car:
            table[f"{name}_per_car"] = _number(
                "sample car",
                unit,
                f"largest absolute {meaning.replace(', largest over the cars', '')}",
            )
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
            f"one-sided spectrum that the {direction} irregularity is drawn from",
        )
        table[f"deviation_{direction}"] = _number(
            "", "m", f"standard deviation of the {direction} irregularity"
        )
    table["frequency"] = _number("mode", "Hz", "natural frequency of the guideway")
    table["direction"] = _code(
        "mode",
        "motion that holds most of the mode's kinetic energy",
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
    table["passage_status"] = _code("speed", "how the passage ended", STATUS)
    table["beam_frequency"] = _number(
        "beam_frequency", "Hz", "first vertical frequency of a simply supported beam"
    )
    table["beam_deflection"] = _number(
        "beam_frequency", "m", "its static deflection with the mass and the load of the model"
    )
    table["model_frequency"] = _number("", "Hz", "first vertical frequency of the model")
    table["car_load"] = _number("", "kg", "mass of a car that makes the load of the model")
    table["mass_per_length"] = _number("", "kg m-1", "mass of the bridge per length, with rails")
    table["bending_stiffness"] = _number("", "N m2", "vertical bending stiffness of the girder")
    table["measured_static_deflection"] = _number(
        "", "m", "measured deflection over the dynamic coefficient of a moving uniform load"
    )
    table["needed_car_load"] = _number(
        "", "kg", "mass of a car with which the measured pair would be that of a beam"
    )
    table["needed_mass_per_length"] = _number(
        "", "kg m-1", "mass of the bridge with which the measured pair would be that of a beam"
    )
    table["measured_deflection"] = _number(
        "measured_speed", "m", "largest vertical deflection at midspan measured on the line"
    )
    return table


def _study_table() -> dict[str, Variable]:
    """Variables of the study: point sets, runs, designs, surrogates, densities, limits."""
    level = "response failure_probability"
    step_level = "method step response failure_probability"
    return {
        # coordinates
        "response": _code("response", "response whose extreme is meant", RESPONSES),
        "parameter": _code("parameter", "random gain", GAINS),
        "method": _code("method", "method by which the runs were chosen", METHODS),
        "failure_probability": _number(
            "failure_probability", "1", "probability that the limit is exceeded"
        ),
        "round": _number("round", "1", "number of the round, 0 is the first design", "int32"),
        "step": _number("step", "1", "number of the step towards more runs", "int32"),
        "cell": _number("cell", "1", "number of the value", "int32"),
        "check": _number("check", "1", "number of the check", "int32"),
        # points and runs
        "standard": _number(
            "sample parameter", "1", "gain less its mean, over its standard deviation"
        ),
        "probability": _number("sample", "1", "probability that the sample stands for"),
        "discrepancy": _number("", "1", "GF-discrepancy of the points"),
        "counting_error": _number(
            "", "1", "largest standard error of the probabilities by counting"
        ),
        "track_seed": _number(
            "sample", "1", "seed of the irregularity that the sample meets", "int64"
        ),
        # designs
        "round_index": _number("sample", "1", "round that added the sample", "int32"),
        "predicted": _number(
            "sample response", OF_RESPONSE, "extreme as predicted before it was run"
        ),
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
        "decision": _code("round", "what was decided after the round", DECISIONS),
        # surrogates
        "kind": _code("response", "kind of the surrogate", SURROGATES),
        "leave_one_out_error": _number(
            "response", "1", "root mean square leave-one-out error over the standard deviation"
        ),
        "length": _number(
            "response parameter", "1", "length of the surrogate in standard deviations of the gain"
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
        "density_method": _code("response", "how the density was found", DENSITY_METHODS),
        "peak": _number(
            "response", PER_RESPONSE, "largest value of the density by the GDEE on its own mesh"
        ),
        "peak_direct": _number("response", PER_RESPONSE, "largest value of the direct density"),
        "mean": _number("response", OF_RESPONSE, "mean of the extreme of held samples"),
        "standard_deviation": _number(
            "response", OF_RESPONSE, "standard deviation of the extreme of held samples"
        ),
        "skewness": _number("response", "1", "skewness of the extreme of held samples"),
        "n_runs": _number("", "1", "number of runs of the model behind the file", "int32"),
        # limits
        **_with_ends(
            "limit",
            _number(level, OF_RESPONSE, "limit that is exceeded with the failure probability"),
        ),
        "limit_status": _code(level, "what can be said of the limit", LIMIT_STATUS),
        **_with_ends(
            "held_limit",
            _number(
                level,
                OF_RESPONSE,
                "limit that is exceeded with the failure probability given that levitation holds",
            ),
        ),
        "held_limit_status": _code(
            level, "what can be said of the limit given that levitation holds", LIMIT_STATUS
        ),
        "sigma": _number("response", OF_RESPONSE, "standard deviation that errors are divided by"),
        # accuracy
        "step_n_runs": _number(
            "method step", "1", "number of runs, 0 where there is none", "int32"
        ),
        "step_limit": _number(step_level, OF_RESPONSE, "limit from so many runs"),
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
            "root mean square error of the surrogate of so many runs against the baseline",
        ),
        "step_error": _number(
            "method step response",
            "1",
            "largest absolute error of the surrogate of so many runs at the runs of the design "
            "that come next, as many as one round of the method asm has, over the standard "
            "deviation",
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
                f"{word} at which the car ceases to be stable {where} the mean gains, the other "
                f"gains at their means; NaN if it does not {how}",
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
            "suspension proportional gain below which the car is not stable at each derivative "
            "gain; NaN if there is none in the map, or the mean is not stable",
        ),
        "derivative_border": _number(
            "current_lag grid_proportional",
            "A s m-1",
            "suspension derivative gain below which the car is not stable at each proportional "
            "gain; NaN if there is none, or the mean is not stable",
        ),
        "static_limit": _number(
            "", "A m-1", "suspension proportional gain below which a magnet cannot hold: i0/delta0"
        ),
        "mean_proportional": _number("", "A m-1", "mean suspension proportional gain"),
        "mean_derivative": _number("", "A s m-1", "mean suspension derivative gain"),
        # modes of the train
        "train_part": _code("train_part", "what moves", TRAIN_PARTS),
        "train_frequency": _number(
            "mode", "Hz", "natural frequency of the levitated car: size of the root over 2 pi"
        ),
        "damping_ratio": _number("mode", "1", "damping over critical damping"),
        "kinetic_share": _number(
            "mode train_part", "1", "share of the mode's kinetic energy in what moves"
        ),
        "moves": _code("mode", "what holds most of the mode's kinetic energy", TRAIN_PARTS),
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
            _number("response", "1", "share of the variance that the gains alone contribute"),
        ),
        **_with_ends(
            "track_share",
            _number("response", "1", "share of the variance that the track alone contributes"),
        ),
        **_with_ends(
            "interaction_share",
            _number("response", "1", "share of the variance that gains and track have together"),
        ),
        # who shares a circuit
        **{
            f"{kind}_group": _code("curve", f"who shares a circuit of the {kind}", GROUPS)
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
        "status_on_track": _code("track sample", "how the passage ended", STATUS),
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
            "track response failure_probability", "what can be said of the limit", LIMIT_STATUS
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
            "response failure_probability", "what can be said of the limit", LIMIT_STATUS
        ),
        "lost_share_on_track": _number(
            "track", "1", "share of the points of the gains at which levitation is lost"
        ),
        # what figures show of several files
        "curve": _number(
            "curve", "1", "file that is shown by case and method, see flag_meanings", "int32"
        ),
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
        "curve_n_runs": _number("curve", "1", "number of runs of the model", "int32"),
        "curve_n_lost": _number("curve", "1", "number of them that lost levitation", "int32"),
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
            "method response failure_probability", "what can be said of the limit", LIMIT_STATUS
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
            "what can be said of the limit given that levitation holds",
            LIMIT_STATUS,
        ),
        **_with_ends(
            "table_lost_probability",
            _number("method", "1", "probability that levitation is lost"),
        ),
        "table_n_runs": _number("method", "1", "number of runs of the model", "int32"),
        "source": _code("source", "whose number stands there", SOURCES),
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
        "paper_rmse_n_runs": _number("source method", "1", "number of runs behind it", "int32"),
        "paper_n_runs": _number("source method", "1", "number of runs of the method", "int32"),
        "paper_deviation": _number(
            "source method", "m", "standard deviation of the girder's vertical displacement"
        ),
        "check_kind": _code(
            "check",
            "what is checked",
            (
                "halves_agree",
                "limit_against_baseline",
                "lost_probability_against_baseline",
                "held_halves_agree",
                "held_limit_against_baseline",
            ),
        ),
        "check_case": _number("check", "1", "case that is checked, see flag_meanings", "int32"),
        "check_method": _code("check", "method that is checked", METHODS),
        "check_response": _code("check", "response that is checked", (*RESPONSES, "none")),
        "check_failure_probability": _number(
            "check", "1", "failure probability of the limit, 0 where none is meant"
        ),
        "check_value": _number(
            "check",
            "1",
            "what is checked: a difference of limits over half the interval of the baseline's, "
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
    """One kind of file: its title, its required and its optional variables."""

    title: str
    variables: tuple[str, ...]
    optional: tuple[str, ...] = ()


_EXTREMES = (
    *GAINS,
    *RESPONSES,
    *(f"{name}_t" for name in RESPONSES),
    "car_body_acceleration_z_per_car",
    "car_body_acceleration_y_per_car",
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
    *(f"{name}_history" for name in RESPONSES),
    "gap_history",
    "current_history",
    "magnet_kind",
    "magnet_side",
    "magnet_x",
)
_RUNS = (*_EXTREMES, "standard", "probability")
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


LAYOUTS: Mapping[str, Layout] = {
    "passage": Layout(
        title="Passage of the train over the guideway",
        variables=_EXTREMES,
        optional=(*_HISTORIES, "track_seed"),
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
        variables=(*GAINS, "standard", "probability", "discrepancy", "counting_error"),
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
        title="What one round of a design added and decided",
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
        title="What random gains and a random track contribute to the extremes",
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
        title="What the control's circuits do to losses, deviations and limits",
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
        title="What holds on the line, and what on one of its tracks",
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
"""What each kind of file holds, by its name."""


def describe(dataset: xr.Dataset) -> xr.Dataset:
    """Give every variable its unit and meaning from `VARIABLES`; arrays are not copied.

    Raises
    ------
    ValueError
        If a variable is not in `VARIABLES` or stands on other dimensions than written there.
    """
    described = dataset.copy(deep=False)
    for name in described.variables:
        variable = VARIABLES.get(str(name))
        if variable is None:
            raise ValueError(f"'{name}' is no variable of any file, see maglev.datasets.VARIABLES")
        if described[name].dims != variable.dims:
            raise ValueError(
                f"'{name}' must stand on {variable.dims}, got {tuple(described[name].dims)}"
            )
        described[name].attrs = {**described[name].attrs, **variable.attributes}
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
    for name in map(str, dataset.variables):
        if name in dataset.dims:
            continue
        if name not in (*known.variables, *known.optional):
            return f"{layout}: '{name}' does not belong here"
        expected, found = VARIABLES[name], dataset[name]
        if tuple(found.dims) != expected.dims:
            return f"{layout}: '{name}' must stand on {expected.dims}, got {tuple(found.dims)}"
        units = found.attrs.get("units")
        if "units" in expected.attributes and units != expected.units:
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
        Files read, by the role they play.
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
    """Attributes that a file takes over from its sources: steps and track of the passages."""
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
    """Describe, check and write a dataset: the file appears whole or not at all.

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
    """Write a described dataset aside and rename it into place, byte for byte reproducibly.

    Variables are compressed (zlib 4, shuffled) in the type that `VARIABLES` names; attributes are
    written in alphabetical order.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    ordered = dataset.copy(deep=False)
    ordered.attrs = dict(sorted(dataset.attrs.items()))
    encoding: dict[str, dict[str, Any]] = {}
    for name in map(str, ordered.variables):
        dtype = VARIABLES[name].dtype
        encoding[name] = {"dtype": dtype, "_FillValue": None}
        if ordered[name].ndim:
            encoding[name] |= {"zlib": True, "complevel": 4, "shuffle": True}
        ordered[name].encoding = {}
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
        If it must not be read.
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
