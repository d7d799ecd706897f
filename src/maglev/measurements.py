"""Measurements on a guideway: values with unit, source and confidence."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import Field

from maglev.config import ConfigError, read_yaml, validated
from maglev.parameters import Parameters

Confidence = Literal["high", "medium", "low"]


class MeasuredFrequency(Parameters):
    """A natural frequency of the guideway."""

    value: float = Field(description="frequency", gt=0, json_schema_extra={"unit": "Hz"})
    source: str = Field(description="where the value was published")
    confidence: Confidence = Field(description="how sure the value is")


class MeasuredDeflection(Parameters):
    """The largest midspan deflection of one passage."""

    value: float = Field(description="deflection, downwards", gt=0, json_schema_extra={"unit": "m"})
    speed: float = Field(description="speed", gt=0, json_schema_extra={"unit": "m/s"})
    source: str = Field(description="where the value was published")
    confidence: Confidence = Field(description="how sure the value is")


class Measurements(Parameters):
    """All that was measured on one line."""

    line: str = Field(description="name of the line")
    first_vertical_frequency: MeasuredFrequency
    peak_deflection: tuple[MeasuredDeflection, ...] = Field(description="one or more passages")


def load_measurements(path: str | Path) -> Measurements:
    """Read a file of measurements.

    Raises
    ------
    ConfigError
        If the file cannot be read, or a key is unknown, missing, or of the wrong kind or unit.
    """
    try:
        measurements: Measurements = validated(Measurements, read_yaml(path))
    except ConfigError as error:
        message = str(error)
        raise ConfigError(message if str(path) in message else f"{path}: {message}") from error
    return measurements
