"""A uniform load moving over a simply supported Euler beam: closed form by modes.

The load reaches from its head backwards over its length.  As the beam is linear, the train is a
load without end that enters at t = 0, less another that enters when the train's tail does.  With
the modes sin(nπx/L) each is a harmonic force of frequency Ω = nπv/L on one oscillator while the
head is on the beam, and a constant one afterwards, solved exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from maglev.arrays import FloatArray
from maglev.errors import UserError


@dataclass(frozen=True, kw_only=True)
class Beam:
    """A simply supported Euler beam.

    Parameters
    ----------
    length
        L [m].
    bending_stiffness
        EI [N m^2].
    mass_per_length
        m [kg/m].
    damping_ratio
        Share of critical damping in every mode [-], at least 0 and below 1.

    Raises
    ------
    UserError
        If a value is not positive, or the damping ratio not in [0, 1).
    """

    length: float
    bending_stiffness: float
    mass_per_length: float
    damping_ratio: float

    def __post_init__(self) -> None:
        for name in ("length", "bending_stiffness", "mass_per_length"):
            if not getattr(self, name) > 0:
                raise UserError(f"Beam.{name} must be positive, got {getattr(self, name)}")
        if not 0 <= self.damping_ratio < 1:
            raise UserError(f"Beam.damping_ratio must lie in [0, 1), got {self.damping_ratio}")

    def frequency(self, mode: int = 1) -> float:
        """Natural frequency (nπ/L)² √(EI/m) / 2π [Hz]."""
        wave = mode * math.pi / self.length
        return wave**2 * math.sqrt(self.bending_stiffness / self.mass_per_length) / (2 * math.pi)

    def static_deflection(self, load: float) -> float:
        """Midspan deflection 5pL⁴ / 384EI [m] under a uniform load p [N/m] on the whole beam."""
        return 5 * load * self.length**4 / (384 * self.bending_stiffness)


DEFLECTION_BY_FREQUENCY = 5 * math.pi**2 / 1536
"""Static deflection times first frequency squared of a simply supported beam, over load per mass:
(5pL⁴/384EI) (π²/4L⁴)(EI/m) = 5π²/1536 · p/m = 0.03213 p/m, whatever its stiffness and length."""


def deflection_at_frequency(
    frequency: npt.ArrayLike, load: float, mass_per_length: float
) -> FloatArray:
    """Static midspan deflection of a simply supported beam from its first natural frequency.

    Parameters
    ----------
    frequency
        First natural frequency [Hz].
    load
        Uniform load on the whole beam [N/m].
    mass_per_length
        Of the beam [kg/m].

    Returns
    -------
    deflection
        [m], one for each frequency.

    Examples
    --------
    >>> span = {"length": 24.8, "bending_stiffness": 2.5e10, "mass_per_length": 4000.0}
    >>> beam = Beam(**span, damping_ratio=0.02)
    >>> found = deflection_at_frequency(beam.frequency(), 2e4, beam.mass_per_length)
    >>> bool(np.isclose(found, beam.static_deflection(2e4)))
    True
    """
    frequency = np.asarray(frequency, dtype=float)
    return DEFLECTION_BY_FREQUENCY * load / mass_per_length / frequency**2


def _free(
    time: FloatArray, start: float, rate: float, omega: float, zeta: float
) -> tuple[FloatArray, FloatArray]:
    """Displacement and velocity of a free oscillator at times after its start."""
    damped = omega * math.sqrt(1 - zeta**2)
    decay = np.exp(-zeta * omega * time)
    a, b = start, (rate + zeta * omega * start) / damped
    cos, sin = np.cos(damped * time), np.sin(damped * time)
    displacement = decay * (a * cos + b * sin)
    velocity = -zeta * omega * displacement + decay * damped * (b * cos - a * sin)
    return displacement, velocity


def _entering(
    time: FloatArray, omega: float, zeta: float, drive: float, crossing: float
) -> FloatArray:
    """Response at rest before t = 0 to 1 - cos(Ωt) until the head leaves, constant afterwards.

    Per unit of modal force over modal mass [s^2].  The harmonic part follows from the complex
    frequency response 1 / (ω² - Ω² + 2iζωΩ); undamped resonance Ω = ω is not covered.
    """
    response = 1 / (omega**2 - drive**2 + 2j * zeta * omega * drive)
    constant = 1 / omega**2

    def forced(t: FloatArray) -> tuple[FloatArray, FloatArray]:
        turning = response * np.exp(1j * drive * t)
        return constant - turning.real, -(1j * drive * turning).real

    start, rate = (float(part) for part in forced(np.zeros(())))
    inside = np.clip(time, 0.0, crossing)
    particular, _ = forced(inside)
    free, _ = _free(inside, -start, -rate, omega, zeta)
    on_beam = np.where(time > 0, particular + free, 0.0)

    end_particular, end_rate = forced(np.asarray(crossing))
    end_free, end_free_rate = _free(np.asarray(crossing), -start, -rate, omega, zeta)
    level = (1 - math.cos(drive * crossing)) * constant
    after = np.clip(time - crossing, 0.0, None)
    ringing, _ = _free(
        after,
        float(end_particular + end_free) - level,
        float(end_rate + end_free_rate),
        omega,
        zeta,
    )
    return np.where(time > crossing, level + ringing, on_beam)


def midspan_deflection(
    beam: Beam, load: float, load_length: float, speed: float, time: npt.ArrayLike, n_modes: int = 9
) -> FloatArray:
    """Deflection at midspan while a uniform load passes.

    Parameters
    ----------
    beam
        The beam, at rest before the load comes.
    load
        Load per length p [N/m].
    load_length
        Length of the load, from head to tail [m].
    speed
        Constant speed v [m/s].
    time : (...)
        Time since the head entered [s].
    n_modes
        Highest mode; even ones do not move midspan.

    Returns
    -------
    deflection : (...)
        Downwards [m].

    Raises
    ------
    UserError
        If the speed or the load's length is not positive.

    References
    ----------
    Frýba, Vibration of Solids and Structures under Moving Loads (1999), ch. 3.

    Examples
    --------
    >>> span = {"length": 24.8, "bending_stiffness": 2.5e10, "mass_per_length": 4000.0}
    >>> beam = Beam(**span, damping_ratio=0.02)
    >>> slow = midspan_deflection(beam, 2e4, 100.0, 1.0, [60.0])  # a load of 100 m at 1 m/s
    >>> bool(np.isclose(slow[0], beam.static_deflection(2e4), rtol=1e-2))
    True
    """
    if not (speed > 0 and load_length > 0):
        raise UserError(
            f"speed and load_length must be positive, got {speed} m/s and {load_length} m"
        )
    t = np.asarray(time, dtype=float)
    L, m, zeta = beam.length, beam.mass_per_length, beam.damping_ratio
    deflection = np.zeros_like(t)
    for n in range(1, n_modes + 1, 2):
        omega = 2 * math.pi * beam.frequency(n)
        drive = n * math.pi * speed / L
        # modal force ∫ p sin(nπx/L) dx over the covered part = pL/nπ (1 - cos Ωt); modal mass mL/2
        amplitude = load * L / (n * math.pi) / (m * L / 2)
        history = _entering(t, omega, zeta, drive, L / speed) - _entering(
            t - load_length / speed, omega, zeta, drive, L / speed
        )
        deflection += amplitude * math.sin(n * math.pi / 2) * history
    return deflection


def dynamic_factor(beam: Beam, load_length: float, speed: float) -> float:
    """Largest midspan deflection over the static one under the load on the whole beam.

    Taken over the passage and one more period of the first mode, at 400 times a period.

    Parameters
    ----------
    beam, load_length, speed
        As for `midspan_deflection`; the load must cover the beam.

    Returns
    -------
    factor
        Dynamic coefficient [-].

    Raises
    ------
    UserError
        If the load is shorter than the beam, or as `midspan_deflection`.

    Examples
    --------
    >>> span = {"length": 24.8, "bending_stiffness": 2.5e10, "mass_per_length": 4000.0}
    >>> round(dynamic_factor(Beam(**span, damping_ratio=0.02), 100.0, 5.0), 2)
    1.0
    """
    if load_length < beam.length:
        raise UserError(
            f"the load must cover the beam of {beam.length:g} m, got a length of {load_length:g} m"
        )
    period = 1 / beam.frequency()
    end = (load_length + beam.length) / speed + period
    time = np.linspace(0.0, end, 1 + math.ceil(400 * end / period))
    deflection = midspan_deflection(beam, 1.0, load_length, speed, time)
    return float(np.max(np.abs(deflection))) / beam.static_deflection(1.0)
