"""Measurements on a guideway: values with unit, source and confidence."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Literal

from pydantic import Field

from maglev.config import ConfigError, read_yaml, validated
from maglev.parameters import Config, Parameters

_LOG = logging.getLogger(__name__)

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
    span_length: float = Field(
        description="span of the bridge, pier to pier", gt=0, json_schema_extra={"unit": "m"}
    )
    first_vertical_frequency: MeasuredFrequency | None = None
    peak_deflection: tuple[MeasuredDeflection, ...] = Field((), description="of some passages")


SAME_SPAN = 1e-3
"""How far spans of one length may differ [m]; assumed, finer than bridges are built."""


def measured_here(config: Config) -> Measurements | None:
    """Measurements on the guideway of the configuration; None if there are none.

    Raises
    ------
    ConfigError
        As `load_measurements`.

    Examples
    --------
    >>> from maglev.parameters import Config
    >>> bare = Config.model_validate({"validation": {"measurements": None}})
    >>> measured_here(bare) is None
    True
    """
    validation = config.validation
    if validation.measurements is None or not validation.measured_here:
        return None
    found = load_measurements(validation.measurements)
    span = config.guideway.span_length
    if abs(found.span_length - span) > SAME_SPAN:
        _LOG.warning(
            "%s was measured on spans of %g m, not %g m: its values are not shown",
            found.line,
            found.span_length,
            span,
        )
        return None
    return found


def load_measurements(path: str | Path) -> Measurements:
    """Read a file of measurements.

    Raises
    ------
    ConfigError
        If the file cannot be read, or a key is unknown, missing, or of the wrong kind or unit.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder) / "line.yaml"
    ...     _ = path.write_text("{line: a test line, span_length: 24.768 m}")
    ...     load_measurements(path).span_length
    24.768
    """
    try:
        measurements: Measurements = validated(Measurements, read_yaml(path))
    except ConfigError as error:
        message = str(error)
        raise ConfigError(message if str(path) in message else f"{path}: {message}") from error
    return measurements
