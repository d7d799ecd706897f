"""Numbers of the configuration that differ from sample to sample, and what that costs.

Three classes: what each sample has in its lane of the kernels; what changes the matrices of the
guideway but not its nodes; what asks for a system built anew, where samples with equal values
share one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.errors import UserError
from maglev.parameters import Config, Parameters

Cost = Literal["sample", "guideway", "rebuild"]
"""What a number costs that differs from sample to sample, from nothing much to a new system."""

_SECTIONS = ("train", "guideway", "irregularity", "control", "passage")
"""Sections of the configuration whose numbers may differ; gains are given on their own."""

_POLES = ("n_poles", "pole_pitch", "pole_length")
_PLACES = (
    "train.n_cars",
    "train.car_pitch",
    "train.bogie.c_frame_spacing",
    "train.car_body.end_distance",
    *(f"train.{kind}_magnet.{name}" for kind in ("suspension", "guidance") for name in _POLES),
)
"""Numbers of the train that say where poles and ends of cars are, which all samples share."""

_ALIKE = (
    "passage.gap_contact",
    "passage.gap_lost",
    *(
        f"control.{kind}.{name}"
        for kind in ("suspension", "guidance")
        for name in ("lag", "failed_magnets")
    ),
)
"""Numbers beyond the train's that each sample has in its lane."""

LEVELS = ("coefficient", "roughness")
"""Factors of a spectrum: the irregularity goes with their root."""


ENDS = {"damping_ratio": (0.0, math.inf), "bearing": (0.25, 4.0), "": (0.6, 1.6)}
"""Multiples of the configured number that the basis is good for: of the damping, which changes no
shape, of bearings, of all others [-]; assumed, checked in the tests."""

_OF_A_SECTION = (
    "elastic_modulus",
    "poisson_ratio",
    "density",
    "area",
    "second_moment_vertical",
    "second_moment_lateral",
    "torsion_constant",
    "polar_inertia",
    "shear_coefficient_vertical",
    "shear_coefficient_lateral",
)
GUIDEWAY = (
    "damping_ratio",
    *(f"girder.{name}" for name in _OF_A_SECTION),
    # others change the rail's shapes between its nodes, which all samples share
    *(
        f"rail.section.{name}"
        for name in ("elastic_modulus", "density", "torsion_constant", "polar_inertia")
    ),
    "rail.connector_mass",
    "bearing.vertical_stiffness",
    "bearing.lateral_stiffness",
    "bearing.fixed_longitudinal_stiffness",
    "bearing.free_longitudinal_stiffness",
    "pier.width_x",
    "pier.width_y",
    "pier.cap_width_y",
    "pier.elastic_modulus",
    "pier.poisson_ratio",
    "pier.density",
    "pier.shear_coefficient",
)
"""Numbers of the guideway that change its matrices but not its nodes."""


def ends_of(key: str) -> tuple[float, float]:
    """Smallest and largest multiple of a number of the guideway that the basis is good for [-]."""
    return next(ends for name, ends in ENDS.items() if key.startswith(name))


def cost_of(config: Config, keys: Iterable[str]) -> dict[str, Cost]:
    """Say what it costs that the numbers at some keys differ from sample to sample.

    Parameters
    ----------
    config
        Parameters of everything.
    keys
        Dotted keys of `maglev.simulate`'s ``values``.

    Returns
    -------
    cost
        For each key ``"sample"``: each sample has its own in its lane of the kernels, at hardly any
        cost; ``"guideway"``: its matrices differ, in a basis that all samples share;
        ``"rebuild"``: the system is built anew for every value, and samples with equal values run
        together.

    Raises
    ------
    UserError
        If a key is no number of the train, guideway, irregularity, control or passage.

    Examples
    --------
    >>> cost_of(Config(), ["train.car_body.mass", "passage.speed"])
    {'train.car_body.mass': 'sample', 'passage.speed': 'rebuild'}
    """
    return {key: _cost(config, key) for key in keys}


def _cost(config: Config, key: str) -> Cost:
    section = key.split(".")[0]
    if section == "gains":
        raise UserError(
            f"{key} must be given in the columns of the gains, not among the further values"
        )
    if section not in _SECTIONS:
        raise UserError(
            f"{key} cannot differ from sample to sample; the sections whose numbers can are "
            f"{', '.join(_SECTIONS)}"
        )
    config.number_at(key)
    if section == "train":
        return "rebuild" if key in _PLACES else "sample"
    if section == "irregularity":
        return "sample" if key.split(".")[-1] in LEVELS else "rebuild"
    if section == "guideway":
        return "guideway" if in_a_basis(config, key) else "rebuild"
    return "sample" if key in _ALIKE else "rebuild"


def in_a_basis(config: Config, key: str) -> bool:
    """Whether guideways that differ in a number share a basis."""
    if key == "guideway.damping_ratio":  # without any, there is none to scale
        return config.guideway.damping_ratio > 0
    return key.removeprefix("guideway.") in GUIDEWAY


def beyond_the_basis(config: Config, key: str, numbers: FloatArray) -> BoolArray:
    """Samples whose number of the guideway is not within what a basis is good for (sample,)."""
    low, high = ends_of(key.removeprefix("guideway."))
    mean, _ = config.number_at(key)
    return (numbers < low * mean) | (numbers > high * mean)


def checked_values(
    config: Config, values: Mapping[str, npt.ArrayLike], n_samples: int
) -> dict[str, FloatArray]:
    """Return the values as doubles (sample,) by their keys, in the order of the keys.

    Parameters
    ----------
    config
        Parameters of everything.
    values
        Numbers in SI by dotted keys.
    n_samples
        Number of samples.

    Raises
    ------
    UserError
        If there is no number at a key, or not one finite value for each sample.
    """
    checked = {}
    for key in sorted(values):
        _cost(config, key)
        numbers = np.asarray(values[key], dtype=np.float64)
        if numbers.shape != (n_samples,):
            raise UserError(
                f"values of {key} must be {n_samples} numbers, one for each sample, "
                f"got an array of shape {numbers.shape}"
            )
        bad = np.flatnonzero(~np.isfinite(numbers))
        if bad.size:
            raise UserError(
                f"values of {key} must be finite, got {numbers[bad[0]]} at sample {bad[0]}"
            )
        checked[key] = numbers
    return checked


def equal_samples(columns: Iterable[FloatArray], n_samples: int) -> list[IntArray]:
    """Samples in groups of equal values, those of a group in their order.

    Parameters
    ----------
    columns : key of (sample,)
        Values.
    n_samples
        Number of samples.

    Examples
    --------
    >>> [group.tolist() for group in equal_samples([np.array([2.0, 1.0, 2.0])], 3)]
    [[1], [0, 2]]
    """
    table = np.column_stack([*columns, np.zeros(n_samples)])
    _, group = np.unique(table, axis=0, return_inverse=True)
    group = group.ravel()
    return [np.flatnonzero(group == number) for number in range(int(group.max()) + 1)]


def with_arrays(section: Parameters, arrays: Mapping[str, float | FloatArray]) -> Any:
    """Copy of parameters with arrays (sample,) in place of numbers at dotted keys, unchecked."""
    inner: dict[str, dict[str, float | FloatArray]] = {}
    changed: dict[str, Any] = {}
    for key, array in arrays.items():
        first, _, rest = key.partition(".")
        if rest:
            inner.setdefault(first, {})[rest] = array
        else:
            changed[first] = array
    for name, nested in inner.items():
        changed[name] = with_arrays(getattr(section, name), nested)
    return section.model_copy(update=changed)
