"""Natural modes of the guideway, and the measured frequency."""

from __future__ import annotations

import numpy as np
import xarray as xr

from maglev.measurements import measured_here
from maglev.mechanics import guideway
from maglev.mechanics.guideway import RIGHT
from maglev.mechanics.moving_load import Beam
from maglev.parameters import Config
from maglev.stage import Stage
from maglev.stages.reads import MEASURED

_CUTOFF = 45.0  # highest mode in the file [Hz], above the second vertical bending of a span
_POINTS_PER_SPAN = 48  # of the shapes
_LONGITUDINAL, _LATERAL, _VERTICAL, _TORSION = range(4)
_DIRECTION_OF_COMPONENT = (  # of x, y, z, φ, θ, ψ; rotations θ and ψ belong to bending
    _LONGITUDINAL,
    _LATERAL,
    _VERTICAL,
    _TORSION,
    _VERTICAL,
    _LATERAL,
)


def euler_span(config: Config) -> Beam:
    """One span as a simply supported Euler beam with the mass of girder and rails."""
    girder, rail = config.guideway.girder, config.guideway.rail
    of_rails = 2 * (rail.section.mass_per_length + rail.connector_mass)
    return Beam(
        length=config.guideway.span_length,
        bending_stiffness=girder.elastic_modulus * girder.second_moment_vertical,
        mass_per_length=girder.mass_per_length + of_rails,
        damping_ratio=config.guideway.damping_ratio,
    )


def dataset(config: Config) -> xr.Dataset:
    """Frequencies and shapes of the guideway's modes.

    Parameters
    ----------
    config
        The configuration.

    Returns
    -------
    dataset
        Layout ``modes``.

    Raises
    ------
    ConfigError
        If the measurements cannot be read.
    """
    here = measured_here(config)
    measured = None if here is None else here.first_vertical_frequency
    model = guideway.build(config.guideway)
    frequency, shape = guideway.modes(model, _CUTOFF)
    energy = shape * (model.mass @ shape)  # sums to 1 over the degrees of freedom of a mode
    share = np.zeros((4, frequency.size))
    np.add.at(share, np.array(_DIRECTION_OF_COMPONENT)[model.component], energy)

    n_points = config.guideway.n_spans * _POINTS_PER_SPAN + 1
    x = np.linspace(0.0, config.guideway.length, n_points)
    girder_z, girder_y = model.girder_rows(x)
    rail_z, _, rail_y, _ = model.rail_rows(x, RIGHT)
    rows = {
        "girder_shape_y": girder_y,
        "girder_shape_z": girder_z,
        "rail_shape_y": rail_y,
        "rail_shape_z": rail_z,
    }
    shapes = {name: (row @ shape).T for name, row in rows.items()}
    largest = np.max([np.abs(values).max(axis=1) for values in shapes.values()], axis=0)
    variables = {name: (("mode", "x"), v / largest[:, None]) for name, v in shapes.items()}
    dataset = xr.Dataset(
        {
            "frequency": (("mode",), frequency),
            "direction": (("mode",), share.argmax(axis=0)),
            **variables,
            "frequency_simply_supported": ((), euler_span(config).frequency()),
        },
        coords={"mode": np.arange(1, frequency.size + 1), "x": x},
    )
    if measured is not None:
        attributes = {"source": measured.source, "confidence": measured.confidence}
        dataset["measured_frequency"] = ((), measured.value, attributes)
    return dataset


STAGE = Stage(
    name="guideway_modes",
    of="run",
    reads=("guideway", *MEASURED),
    layout="modes",
    compute=dataset,
)
