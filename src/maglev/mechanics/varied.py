"""Numbers of the configuration that differ from sample to sample, and what that costs.

Three classes: what each sample has in its lane of the kernels; what changes the matrices of the
guideway but not its nodes; what asks for a system built anew, where samples with equal values
share one.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

import numpy as np
import numpy.typing as npt

from maglev.arrays import FloatArray, IntArray
from maglev.errors import UserError
from maglev.parameters import Config

Cost = Literal["sample", "guideway", "rebuild"]
"""What a number costs that differs from sample to sample, from nothing much to a new system."""

_SECTIONS = ("train", "guideway", "irregularity", "control", "passage")
"""Sections of the configuration whose numbers may differ; gains are given on their own."""

_POLES = ("n_poles", "pole_pitch", "pole_length")
_PLACES = (
    "train.n_cars",
    "train.car_pitch",
    "train.bogie.c_frame_spacing",
    *(f"train.{kind}_magnet.{name}" for kind in ("suspension", "guidance") for name in _POLES),
)
"""Numbers of the train that say where poles are: tables of the whole run stand on them."""

_ALIKE = (
    "passage.gap_contact",
    "passage.gap_lost",
    *(f"control.{kind}.lag" for kind in ("suspension", "guidance")),
)
"""Numbers beyond the train's that each sample has in its lane."""

LEVELS = ("coefficient", "roughness")
"""Factors of a spectrum: the irregularity goes with their root."""


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
    return "sample" if key in _ALIKE else "rebuild"


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
