"""Ride comfort: published weightings, filters that follow them, and the indices made of them.

The signal is the acceleration at an end of a car body's floor, weighted by a filter; the index is
made of its root mean square while the car is on the guideway.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import signal

from maglev.arrays import FloatArray
from maglev.mechanics.course import Course, course
from maglev.parameters import Config

READING = 2e-3
"""Time between readings of the filters, at most [s]; assumed: car bodies move below 20 Hz, where a
mean over that time is 0.3 % low at most."""


@dataclass(frozen=True)
class Weighting:
    """An analogue filter by its corners, each a pair ``1 + s/Qω + s²/ω²`` of f = ω/2π and Q.

    Attributes
    ----------
    gain
        Of the whole [-].
    zeros, poles : ((f, Q), …)
        Corners [Hz, -]; an f with Q = 0 is the single one ``1 + s/ω``.
    highpass : (f, …)
        Factors s/ω over those of ``poles`` [Hz]: one each for a zero at rest.
    """

    gain: float
    zeros: tuple[tuple[float, float], ...]
    poles: tuple[tuple[float, float], ...]
    highpass: tuple[float, ...]

    def zpk(self) -> tuple[npt.NDArray[np.complex128], npt.NDArray[np.complex128], float]:
        """Zeros and poles [rad/s] and gain of the filter."""
        gain = self.gain
        roots: list[list[complex]] = [[0j] * len(self.highpass), []]
        for sign, corners, found in ((-1, self.zeros, roots[0]), (1, self.poles, roots[1])):
            for frequency, quality in corners:
                omega = 2 * math.pi * frequency
                order = 2 if quality else 1
                pair = [1 / omega**2, 1 / (quality * omega), 1] if quality else [1 / omega, 1]
                found.extend(np.roots(pair))
                gain *= omega ** (sign * order)
        gain /= math.prod(2 * math.pi * frequency for frequency in self.highpass)
        return np.array(roots[0]), np.array(roots[1]), gain

    def magnitude(self, frequency: npt.ArrayLike) -> FloatArray:
        """Size of the filter's response [-] at frequencies [Hz]."""
        zeros, poles, gain = self.zpk()
        _, response = signal.freqs_zpk(zeros, poles, gain, 2 * np.pi * np.asarray(frequency))
        return np.abs(response)

    def sections(self, interval: float) -> FloatArray:
        """Second-order sections (section, 6) for readings so far apart [s], by Tustin's rule."""
        zeros, poles, gain = signal.bilinear_zpk(*self.zpk(), fs=1 / interval)
        return np.ascontiguousarray(signal.zpk2sos(zeros, poles, gain))


_BAND = ((0.4, math.sqrt(0.5)), (100.0, math.sqrt(0.5)))
ISO_VERTICAL = Weighting(
    gain=(2.37 / 3.35) ** 2,
    zeros=((12.5, 0.0), (2.37, 0.91)),
    poles=(*_BAND, (12.5, 0.63), (3.35, 0.91)),
    highpass=(0.4, 0.4),
)
"""W_k of ISO 2631-1:1997, annex A, corners as in ISO 8041: vertical, seated or standing."""

ISO_LATERAL = Weighting(
    gain=1.0, zeros=((2.0, 0.0),), poles=(*_BAND, (2.0, 0.63)), highpass=(0.4, 0.4)
)
"""W_d of ISO 2631-1:1997, likewise: horizontal."""

SPERLING_VERTICAL = Weighting(
    gain=0.6692,
    zeros=((20.9941, 1.2362), (5.9178, 1.9378), (9.9215, 0.1822)),
    poles=((4.9059, 0.5496), (22.4751, 0.9838), (5.9217, 2.4388), (0.3939, 0.0)),
    highpass=(0.3939,),
)
"""Fitted to `sperling_weight` from 0.5 to 40 Hz, at most 1.6 % off: 0.5 % of the index."""

SPERLING_LATERAL = Weighting(
    gain=0.9228,
    zeros=((5.1848, 2.2175), (10.6354, 0.1965), (27.4255, 1.8743)),
    poles=((28.386, 1.6721), (4.4756, 0.6505), (5.2482, 2.6982), (0.4131, 0.0)),
    highpass=(0.4131,),
)
"""Likewise, at most 1.7 % off."""

WEIGHTINGS = (SPERLING_VERTICAL, SPERLING_LATERAL, ISO_VERTICAL, ISO_LATERAL)
"""The weightings in the order of arrays: vertical and lateral in turns."""


def sperling_weight(frequency: npt.ArrayLike, *, lateral: bool) -> FloatArray:
    """Weight of an acceleration in the Sperling index, (F(f)/f)^(1/3), f in Hz.

    Parameters
    ----------
    frequency
        [Hz], above 0; the standard asks for 0.5 to 40 Hz.
    lateral
        Whether the vibration is lateral; else it is vertical.

    Returns
    -------
    weight
        [Hz^(-1/3)], one for each frequency.

    References
    ----------
    GB/T 5599-1985 and -2019 (recalled; the vertical one compared with public programs).

    Examples
    --------
    >>> float(sperling_weight(20.0, lateral=False) ** 3 * 20.0)  # F(20 Hz) = 400 / f²
    1.0
    """
    f = np.asarray(frequency, dtype=float)
    rise, first, fall, second = (0.8, 5.4, 650.0, 26.0) if lateral else (0.325, 5.9, 400.0, 20.0)
    factor = np.where(f < first, rise * f**2, np.where(f < second, fall / f**2, 1.0))
    return np.cbrt(factor / f)


def sperling_index(weighted_rms: npt.ArrayLike) -> FloatArray:
    """Sperling index W = 3.57 (√2 a_w)^0.3 of a weighted root mean square a_w [m/s²].

    For one sine of amplitude A it is the standard's 3.57 (A³ F(f)/f)^(1/10).  For several the
    standard adds their cubes, which depends on how finely a spectrum is resolved; the root mean
    square does not, and is never below: 3.5 % of W above for two equal sines.

    Parameters
    ----------
    weighted_rms
        Of an acceleration weighted by `sperling_weight` [m/s²].

    Returns
    -------
    index
        W [-]: below 2.5 excellent, to 2.75 good, to 3 acceptable by GB/T 5599.

    References
    ----------
    Deng, Zhou, Thompson et al., Vehicle System Dynamics 58 (2020) 313-330.

    Examples
    --------
    >>> amplitude = 0.5 * sperling_weight(1.3, lateral=False)  # 0.5 m/s² at 1.3 Hz
    >>> round(float(sperling_index(amplitude / 2**0.5)), 2)
    2.66
    """
    return 3.57 * (math.sqrt(2.0) * np.asarray(weighted_rms, dtype=float)) ** 0.3


def window(config: Config, car: int) -> tuple[float, float]:
    """Time from which a car's front is on the guideway, and until which its rear is [s].

    Examples
    --------
    >>> enters, leaves = window(Config(), 0)
    >>> round((leaves - enters) * 430 / 3.6, 2)  # five spans and its own length
    148.61
    """
    way, pitch = course(config), config.train.car_pitch
    enters = (car * pitch - way.start) / way.speed
    leaves = ((car + 1) * pitch + config.guideway.length - way.start) / way.speed
    return enters, leaves


@dataclass(frozen=True)
class Readings:
    """When the filters are read, every so many steps.

    Attributes
    ----------
    every
        Steps between two readings [-].
    first, last : (car,)
        Steps of the first and the last reading that counts.
    count : (car,)
        How many count [-].
    """

    every: int
    first: npt.NDArray[np.int64]
    last: npt.NDArray[np.int64]
    count: npt.NDArray[np.int64]


def readings(config: Config) -> Readings:
    """Readings of the filters in the production solver.

    Examples
    --------
    >>> readings(Config()).every  # steps of 0.54 ms
    3
    """
    way: Course = course(config)
    every = max(1, int(READING / way.time_step * (1 + 1e-9)))
    ends = np.array([window(config, car) for car in range(config.train.n_cars)]) / way.time_step
    first = every * np.ceil(ends[:, 0] / every - 1e-9).astype(np.int64)
    last = every * np.floor(np.minimum(ends[:, 1], way.n_steps) / every + 1e-9).astype(np.int64)
    return Readings(every, first, last, (last - first) // every + 1)


def weighted_rms(
    config: Config, time: FloatArray, ends: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Root mean square of weighted histories, while each car is on the guideway.

    Parameters
    ----------
    config
        Train and guideway, for the times.
    time : (step,)
        Evenly spaced [s], from the start.
    ends : two of (step, end, car, sample)
        Vertical and lateral accelerations of the cars' ends [m/s²].

    Returns
    -------
    rms : (sample, weighting, car)
        At the worse end, in the order of `WEIGHTINGS` [m/s²].

    Examples
    --------
    >>> config = Config.model_validate({"train": {"n_cars": 1}})
    >>> time = 1e-3 * np.arange(1, 2500)
    >>> sine = np.sin(2 * np.pi * 8.0 * time)[:, None, None, None]
    >>> rms = weighted_rms(config, time, (sine, 0 * sine))
    >>> bool(abs(rms[0, 2, 0] - 1.036 / 2**0.5) < 0.01)  # W_k of 8 Hz is 1.036
    True
    """
    step = float(time[0])
    squares = []
    for number, weighting in enumerate(WEIGHTINGS):
        weighted = signal.sosfilt(weighting.sections(step), ends[number % 2], axis=0)
        of_cars = []
        for car in range(weighted.shape[2]):
            enters, leaves = window(config, car)
            inside = (time >= enters) & (time <= leaves)
            of_cars.append(np.mean(weighted[inside, :, car] ** 2, axis=0).max(axis=0))
        squares.append(np.stack(of_cars))
    return np.moveaxis(np.sqrt(np.stack(squares)), 2, 0)
