"""Track irregularity along the guideway: harmonics on a target spectrum, or a measured profile.

Vertical displacements are positive downwards, lateral ones to the right, like z and y; x is zero at
the first pier.  Theory: docs/theory/irregularity.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.fft import ifft, next_fast_len
from scipy.interpolate import CubicSpline

from maglev.arrays import ComplexArray, FloatArray
from maglev.errors import UserError
from maglev.parameters import GermanLaw, Irregularity, PowerLaw, RationalLaw, Spectrum

PROFILE_NAMES = ("vertical_right", "vertical_left", "lateral_right", "lateral_left")
"""Order of the ``profile`` dimension."""

_POINTS_PER_WAVELENGTH = 64
"""Grid points in the shortest wavelength: cubic Hermite interpolation errs by (2 pi / 64)^4 / 384
= 2.4e-7 of the shortest cosine's amplitude, less than 1e-7 of the whole profile's extreme."""


@dataclass(frozen=True)
class Measured:
    """A measured profile, as read from a file.

    Attributes
    ----------
    source
        Where it comes from, for messages.
    x : (station,)
        Position along the guideway [m], strictly rising, zero at the first pier.
    displacement : (4, station)
        In the order of `PROFILE_NAMES` [m].
    """

    source: str
    x: FloatArray
    displacement: FloatArray


@dataclass(frozen=True)
class Profile:
    """Irregularity on a uniform grid, interpolated by cubic Hermite polynomials.

    Attributes
    ----------
    x0
        Position of the first grid point [m].
    dx
        Grid spacing [m].
    values : (profile, grid)
        Displacement of the rail from straight [m], in the order of `PROFILE_NAMES`.
    slopes : (profile, grid)
        Its derivative with respect to x [-].
    """

    x0: float
    dx: float
    values: FloatArray
    slopes: FloatArray


def profile(
    irregularity: Irregularity,
    length_range: tuple[float, float],
    seed: int,
    measured: Measured | None = None,
) -> Profile:
    """Irregularity of both rails in both directions over a stretch of track.

    It is zero before ``x = -fade_in`` and complete from ``x = 0``; in between it is multiplied by a
    ramp with continuous curvature.  The same seed gives the same profile, bit for bit, whatever
    the stretch.

    Parameters
    ----------
    irregularity
        Spectra, wavelengths, fade-in; whether both sides share one profile.
    length_range
        First and last position needed [m]; the grid covers both.
    seed
        Seed of the phases; each row of the profile has its own child seed.
    measured
        Measured profile that replaces the spectra; its file says whether both sides share one.

    Returns
    -------
    profile
        Displacements and slopes on a uniform grid.

    Raises
    ------
    UserError
        If the range is empty, a profile file is named but not given, the measured profile does not
        cover the range from the start of the fade-in, or a spectrum is negative.

    References
    ----------
    Shinozuka, Deodatis, Appl. Mech. Rev. 44 (1991) 191-204, eq. 19; docs/theory/irregularity.md.

    Examples
    --------
    >>> found = profile(Irregularity(), (-50.0, 100.0), seed=1)
    >>> found.values.shape[0]  # both rails, vertical and lateral
    4
    """
    start, end = length_range
    if not (math.isfinite(start) and math.isfinite(end) and start < end):
        raise UserError(f"length_range must rise from finite start to end, got {length_range} m")
    random = irregularity.enabled and measured is None
    dx, period = _grid(irregularity) if random else (_coarse(irregularity), 0)
    first, last = math.floor(start / dx), math.ceil(end / dx)
    if random:  # the spacing has no end, so an end of the range may fall beside its point
        first, last = first - 1, last + 1
    x = np.arange(first, last + 1, dtype=float) * dx
    if not irregularity.enabled:
        zeros = np.zeros((len(PROFILE_NAMES), x.size))
        return Profile(x0=float(x[0]), dx=dx, values=zeros, slopes=zeros.copy())
    if measured is not None:
        values, slopes = _splined(measured, x, max(start, -irregularity.fade_in), end)
    elif irregularity.profile_file is not None:
        raise UserError(
            f"irregularity.profile_file is {irregularity.profile_file!r} but its profile was not "
            "read; give it as 'measured'"
        )
    else:
        values, slopes = _random(irregularity, first, last, period, seed)
    ramp, ramp_slope = _fade_in(x, irregularity.fade_in)
    return Profile(
        x0=float(x[0]),
        dx=dx,
        values=ramp * values,
        slopes=ramp * slopes + ramp_slope * values,
    )


def displacement(profile: Profile, x: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Interpolate a profile by cubic Hermite polynomials.

    Parameters
    ----------
    profile
        The profile.
    x : (...)
        Positions [m].

    Returns
    -------
    value : (profile, ...)
        Displacement [m].
    slope : (profile, ...)
        Derivative with respect to x [-].

    Raises
    ------
    UserError
        If a position lies outside the grid.

    Examples
    --------
    >>> ramp = Profile(x0=0.0, dx=1.0, values=np.array([[0.0, 2.0]]), slopes=np.full((1, 2), 2.0))
    >>> displacement(ramp, 0.25)
    (array([0.5]), array([2.]))
    """
    position = (np.asarray(x, dtype=float) - profile.x0) / profile.dx
    n = profile.values.shape[1]
    if not np.all((position >= 0) & (position <= n - 1)):
        raise UserError(
            f"x must lie in the profile's range {profile.x0:g} to "
            f"{profile.x0 + (n - 1) * profile.dx:g} m, got {np.min(x):g} to {np.max(x):g} m"
        )
    cell = np.minimum(position.astype(int), n - 2)
    t, h = position - cell, profile.dx
    r0, r1 = profile.values[:, cell], profile.values[:, cell + 1]
    s0, s1 = h * profile.slopes[:, cell], h * profile.slopes[:, cell + 1]
    quadratic, cubic = 3 * (r1 - r0) - 2 * s0 - s1, 2 * (r0 - r1) + s0 + s1
    value = r0 + t * (s0 + t * (quadratic + t * cubic))
    slope = (s0 + t * (2 * quadratic + t * 3 * cubic)) / h
    return value, slope


def mean_displacement(
    profile: Profile, x: npt.ArrayLike, length: float
) -> tuple[FloatArray, FloatArray]:
    """Mean of a profile over the faces of poles, and its derivative along travel.

    Parameters
    ----------
    profile
        The profile.
    x : (place,)
        Middles of the faces [m].
    length
        Of a face [m]; zero for points.

    Returns
    -------
    mean : (profile, place)
        Displacement [m].
    slope : (profile, place)
        Derivative of the mean with respect to x [-].

    Raises
    ------
    UserError
        If a face reaches beyond the grid.

    Examples
    --------
    >>> x = np.arange(4.0)
    >>> ramp = Profile(x0=0.0, dx=1.0, values=2.0 * x[None], slopes=np.full((1, 4), 2.0))
    >>> mean_displacement(ramp, [1.5], 1.0)
    (array([[3.]]), array([[2.]]))
    """
    x = np.asarray(x, dtype=float)
    if length == 0:
        return displacement(profile, x)
    (near, _), (far, _) = (displacement(profile, x + part * length) for part in (-0.5, 0.5))
    area = _area(profile, x + 0.5 * length) - _area(profile, x - 0.5 * length)
    return area / length, (far - near) / length


def _area(profile: Profile, x: FloatArray) -> FloatArray:
    """Integral of the Hermite polynomials from the start of the grid (profile, place) [m²]."""
    h = profile.dx
    r, s = profile.values, h * profile.slopes
    cells = h * (0.5 * (r[:, 1:] + r[:, :-1]) + (s[:, :-1] - s[:, 1:]) / 12)
    whole = np.concatenate([np.zeros((r.shape[0], 1)), np.cumsum(cells, axis=1)], axis=1)
    position = (x - profile.x0) / h
    cell = np.clip(position.astype(int), 0, r.shape[1] - 2)
    t = position - cell
    r0, r1, s0, s1 = r[:, cell], r[:, cell + 1], s[:, cell], s[:, cell + 1]
    quadratic, cubic = 3 * (r1 - r0) - 2 * s0 - s1, 2 * (r0 - r1) + s0 + s1
    part = t * (r0 + t * (s0 / 2 + t * (quadratic / 3 + t * cubic / 4)))
    return whole[:, cell] + h * part


def spectral_density(spectrum: Spectrum, wavenumber: npt.ArrayLike) -> FloatArray:
    """One-sided power spectral density S(n); its integral over n > 0 is the variance.

    Parameters
    ----------
    spectrum
        Law and coefficients.
    wavenumber : (...)
        n = 1 / wavelength [1/m], positive.

    Returns
    -------
    density : (...)
        S(n) [m^3].

    Raises
    ------
    UserError
        If the law is negative or not finite somewhere.

    References
    ----------
    docs/theory/irregularity.md, eqs. 1 to 3.

    Examples
    --------
    >>> from maglev.parameters import PowerLaw
    >>> spectral_density(PowerLaw(law="power", coefficient=1e-8, exponent=2.0), [0.1])
    array([1.e-06])
    """
    n = np.asarray(wavenumber, dtype=float)
    match spectrum:
        case PowerLaw():
            density = spectrum.coefficient * n**-spectrum.exponent
        case RationalLaw():
            with np.errstate(divide="ignore", invalid="ignore"):
                density = np.polynomial.polynomial.polyval(
                    n, spectrum.numerator
                ) / np.polynomial.polynomial.polyval(n, spectrum.denominator)
        case GermanLaw():
            A, c, r = spectrum.roughness, spectrum.corner_c, spectrum.corner_r
            omega = 2 * np.pi * n  # rad/m
            density = 2 * np.pi * A * c**2 / ((omega**2 + r**2) * (omega**2 + c**2))
    bad = ~(np.isfinite(density) & (density >= 0))
    if np.any(bad):
        raise UserError(
            f"spectrum with law {spectrum.law!r} must be finite and not negative, got "
            f"{density[bad].flat[0]:g} m^3 at n = {n[bad].flat[0]:g} 1/m"
        )
    return density


def wavenumbers(irregularity: Irregularity) -> tuple[FloatArray, float]:
    """Midpoints of equal cells between the longest and the shortest wavelength.

    With equal cells the sum shows no gaps on a stretch shorter than ``1 / spacing`` (1 km for 1000
    harmonics from 1 to 100 m); cells that widen with n would leave gaps at short waves.

    Parameters
    ----------
    irregularity
        Wavelengths and number of harmonics.

    Returns
    -------
    wavenumber : (harmonic,)
        n_k [1/m].
    spacing
        Width of a cell [1/m].

    Examples
    --------
    >>> wavenumber, spacing = wavenumbers(Irregularity(n_harmonics=100))
    >>> bool(np.isclose(np.diff(wavenumber), spacing).all())
    True
    """
    lowest = 1 / irregularity.wavelength_max
    spacing = (1 / irregularity.wavelength_min - lowest) / irregularity.n_harmonics
    number = np.arange(irregularity.n_harmonics, dtype=float)
    return lowest + (number + 0.5) * spacing, spacing


def _coarse(irregularity: Irregularity) -> float:
    """Grid spacing without random harmonics [m]."""
    return irregularity.wavelength_min / _POINTS_PER_WAVELENGTH


def _grid(irregularity: Irregularity) -> tuple[float, int]:
    """Grid spacing [m], and the points after which every harmonic has gone through whole turns
    beyond those of the longest."""
    _, spacing = wavenumbers(irregularity)
    points = math.ceil(_POINTS_PER_WAVELENGTH / (spacing * irregularity.wavelength_min))
    period = next_fast_len(max(points, irregularity.n_harmonics))
    return 1 / (spacing * period), period


def _random(
    irregularity: Irregularity, first: int, last: int, period: int, seed: int
) -> tuple[FloatArray, FloatArray]:
    """Sums of harmonics on the points ``first`` to ``last`` of the grid, one row a profile."""
    wavenumber, spacing = wavenumbers(irregularity)
    children = np.random.SeedSequence(seed).spawn(len(PROFILE_NAMES))
    rows = []
    for spectrum, (right, left) in (
        (irregularity.vertical, children[:2]),
        (irregularity.lateral, children[2:]),
    ):
        amplitude = np.sqrt(2 * spectral_density(spectrum, wavenumber) * spacing)
        sides = (right,) if irregularity.sides == "shared" else (right, left)
        sums = []
        for child in sides:
            phase = 2 * np.pi * np.random.default_rng(child).random(wavenumber.size)
            coefficient = amplitude * np.exp(1j * phase)
            sums.append(_harmonic_sum(coefficient, wavenumber, spacing, first, last, period))
        rows += [sums[0], sums[-1]]
    return np.stack([value for value, _ in rows]), np.stack([slope for _, slope in rows])


def _harmonic_sum(
    coefficient: ComplexArray,
    wavenumber: FloatArray,
    spacing: float,
    first: int,
    last: int,
    period: int,
) -> tuple[FloatArray, FloatArray]:
    """Real part of sum c_k exp(2 pi i n_k x) and its slope on a stretch of the grid.

    With n_k = n_0 + k spacing and x_j = j / (spacing period), the sum is the turn exp(2 pi i n_0 x)
    of the longest harmonic times a discrete Fourier transform, which repeats after ``period``
    points; so a point has the same bits wherever the stretch begins and ends.
    """
    point = np.arange(first, last + 1)
    turn = np.exp(2j * np.pi * wavenumber[0] / (spacing * period) * point)
    of_slope = 2j * np.pi * wavenumber * coefficient
    values, slopes = (
        (turn * ifft(c, period, norm="forward")[point % period]).real
        for c in (coefficient, of_slope)
    )
    return values, slopes


def _splined(
    measured: Measured, x: FloatArray, start: float, end: float
) -> tuple[FloatArray, FloatArray]:
    """Cubic spline through a measured profile; beyond its ends it keeps its last value."""
    if measured.x[0] > start or measured.x[-1] < end:
        raise UserError(
            f"{measured.source} must cover the passage from {start:g} to {end:g} m, "
            f"got {measured.x[0]:g} to {measured.x[-1]:g} m"
        )
    spline = CubicSpline(measured.x, measured.displacement, axis=1)
    inside = np.clip(x, measured.x[0], measured.x[-1])
    return spline(inside), np.where(inside == x, spline(inside, 1), 0.0)


def _fade_in(x: FloatArray, length: float) -> tuple[FloatArray, FloatArray]:
    """Ramp from 0 at ``x = -length`` to 1 at ``x = 0`` with zero slope and curvature at both."""
    t = np.clip(1 + x / length, 0.0, 1.0)
    ramp = t**3 * (10 + t * (6 * t - 15))
    return ramp, 30 * t**2 * (1 - t) ** 2 / length
