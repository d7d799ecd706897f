"""The irregularity under the train, and its spectra beside the target spectra."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from scipy.signal import welch

from maglev import profiles
from maglev.mechanics.irregularity import (
    PROFILE_NAMES,
    displacement,
    profile,
    spectral_density,
)
from maglev.parameters import Config, Irregularity
from maglev.stage import Stage

_POINTS_PER_WAVELENGTH = 10  # of the shortest wavelength, in the file
_SPECTRUM_LENGTH = 10  # length behind the spectra, in longest wavelengths: harmonics recur in 10
_SEGMENT_LENGTH = 2  # length of Welch's segments, in longest wavelengths


def _sampled(config: Config, end: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions [m] and displacements (profile, x) [m] from the start of the fade-in to the end."""
    irregularity = config.irregularity
    name = irregularity.profile_file if irregularity.enabled else None
    measured = profiles.read(name) if name else None
    step = irregularity.wavelength_min / _POINTS_PER_WAVELENGTH
    start = -irregularity.fade_in
    x = start + step * np.arange(math.floor((end - start) / step) + 1)
    track = profile(irregularity, (float(x[0]), float(x[-1])), config.seed, measured)
    return x, displacement(track, x)[0]


def _spectrum(irregularity: Irregularity, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Wavenumbers [1/m] and one-sided spectrum [m^3], from Welch's method with Hann windows."""
    rate = _POINTS_PER_WAVELENGTH / irregularity.wavelength_min
    segment = round(_SEGMENT_LENGTH * irregularity.wavelength_max * rate)
    wavenumber, density = welch(values, fs=rate, nperseg=min(segment, values.size))
    band = (wavenumber > 1 / irregularity.wavelength_max) & (
        wavenumber < 1 / irregularity.wavelength_min
    )
    return wavenumber[band], density[band]


def dataset(config: Config) -> xr.Dataset:
    """Irregularity of both rails along the guideway, and spectra of both directions.

    The spectra of a drawn profile are estimated from a longer stretch of the same profile, those
    of a measured one from the part that the train meets; both from the first pier on.

    Parameters
    ----------
    config
        The configuration.

    Returns
    -------
    dataset
        Layout ``irregularity``.

    Raises
    ------
    UserError
        If a measured profile cannot be read or does not cover the passage.
    """
    irregularity = config.irregularity
    end = config.guideway.length + config.train.length
    x, values = _sampled(config, end)
    drawn = irregularity.enabled and irregularity.profile_file is None
    long_x, long_values = x, values
    if drawn:
        long_x, long_values = _sampled(config, _SPECTRUM_LENGTH * irregularity.wavelength_max)
    variables: dict[str, tuple[tuple[str, ...], object]] = {}
    for direction in ("vertical", "lateral"):
        sides = [PROFILE_NAMES.index(f"{direction}_{side}") for side in ("left", "right")]
        on_guideway = long_values[sides[1]][long_x >= 0]
        wavenumber, density = _spectrum(irregularity, on_guideway)
        variables |= {
            f"irregularity_{direction}": (("side", "x"), values[sides]),
            f"spectrum_{direction}": (("wavenumber",), density),
            f"target_{direction}": (
                ("wavenumber",),
                spectral_density(getattr(irregularity, direction), wavenumber),
            ),
            f"deviation_{direction}": ((), on_guideway.std()),
        }
    coordinates = {"side": np.array([-1, 1]), "x": x, "wavenumber": wavenumber}
    return xr.Dataset(variables, coords=coordinates)


STAGE = Stage(
    name="irregularity",
    of="run",
    reads=("seed", "train", "guideway", "irregularity", "passage"),
    layout="irregularity",
    compute=dataset,
)
