"""Modes of the levitated train: frequency, damping and moving parts."""

from __future__ import annotations

import re

import numpy as np
import xarray as xr

from maglev.mechanics import train as train_model
from maglev.mechanics.linear import blocks, modes
from maglev.mechanics.responses import checked_gains
from maglev.parameters import Config
from maglev.stage import Stage
from maglev.vocabulary import TRAIN_PARTS

_DEGREES_OF_FREEDOM = (  # in the order of `TRAIN_PARTS`
    r"body\.y",
    r"body\.z",
    r"body\.phi",
    r"body\.theta",
    r"body\.psi",
    r"bogie.*",
    r"rod.*",
    r"suspension.*",
    r"guidance.*",
)


def dataset(config: Config) -> xr.Dataset:
    """Frequency, damping and shares of kinetic energy of one car's modes at the mean gains.

    The car stands on a rigid track, with the configured control.  Motions that do not oscillate are
    left out.

    Parameters
    ----------
    config
        The configuration.

    Returns
    -------
    dataset
        Layout ``train_modes``.
    """
    one_car = train_model.build(config.train.model_copy(update={"n_cars": 1}))
    mean = checked_gains([config.gains.as_row], config.gains.further)[0]
    root, shape = modes(blocks(one_car, config.control), mean)
    energy = one_car.mass * np.abs(shape) ** 2
    names = [name.removeprefix("car0.") for name in one_car.dof_names]
    belongs = [[re.fullmatch(of, name) is not None for name in names] for of in _DEGREES_OF_FREEDOM]
    share = energy @ np.array(belongs).T / energy.sum(axis=1, keepdims=True)
    size = np.abs(root)
    return xr.Dataset(
        {
            "train_frequency": (("mode",), size / (2 * np.pi)),
            "damping_ratio": (("mode",), -root.real / size),
            "kinetic_share": (("mode", "train_part"), share),
            "moves": (("mode",), share.argmax(axis=1)),
        },
        coords={
            "mode": np.arange(1, root.size + 1),
            "train_part": np.arange(len(TRAIN_PARTS)),
        },
    )


STAGE = Stage(
    name="train_modes",
    of="run",
    reads=("train", "gains", "control"),
    layout="train_modes",
    compute=dataset,
)
