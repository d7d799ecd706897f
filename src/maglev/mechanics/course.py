"""Course of a passage: start, end, time step, and the stretch of track under the train."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from maglev.arrays import FloatArray
from maglev.parameters import Config, Magnet

JOINT_SHARE = 0.5
"""Share of a step at which poles meet the joints of the rails [-].

Their force jumps there, which is an error of first order unless the jump falls half-way between two
steps (docs/theory/integration.md).
"""


@dataclass(frozen=True)
class Course:
    """Motion of the train from start to end of a passage, in steps.

    Attributes
    ----------
    time_step
        Δt [s].
    speed
        Of the train [m/s].
    start
        Place of the nose at time zero [m], the first pier at zero.
    n_steps
        Steps until the tail has left the last span [-].
    first_step
        Number of the first step on which anything moves [-].  Until the nose reaches the
        irregularity, or without one the guideway, the train rests in its equilibrium over rigid
        straight track, and the steps are skipped; not with failed magnets.
    """

    time_step: float
    speed: float
    start: float
    n_steps: int
    first_step: int

    @property
    def advance(self) -> float:
        """Distance travelled in one step [m]."""
        return self.speed * self.time_step

    @property
    def duration(self) -> float:
        """Time from start to end [s]."""
        return self.n_steps * self.time_step

    def nose(self, time: npt.ArrayLike) -> FloatArray:
        """Place of the nose at given times [m], zero at the first pier."""
        return self.start + self.speed * np.asarray(time)


def course(config: Config) -> Course:
    """Course of a configuration, its time step a whole fraction of the period of pole passing.

    A pole enters each span with a kink in its force, and poles follow one another at the rate
    v / pole pitch.  A step that divides this period keeps all harmonics of pole passing where they
    are; any other step folds them into the band of the responses.  Poles of suspension and guidance
    magnets stand half a pitch apart; to meet the joints at the same share of a step, the period
    then has an even number of steps.

    The train starts less than a step before ``passage.approach``, so that the poles of the
    suspension meet the joints of the rails, at whole units from the first pier, at `JOINT_SHARE` of
    a step.  That holds for all of them where units and C-frame spacings are whole numbers of pole
    pitches, as by default; else for those of the first magnet at the first pier.

    Parameters
    ----------
    config
        ``passage.time_step`` is the upper bound of the step.

    References
    ----------
    docs/theory/integration.md.

    Examples
    --------
    >>> round(course(Config()).time_step * 1e3, 3)  # of 0.258 m at 430 km/h a quarter
    0.54
    """
    dt, speed = _time_step(config), config.passage.speed
    start = _start(config, speed * dt)
    way = config.guideway.length + config.train.length - start
    fade_in = config.irregularity.fade_in if config.irregularity.enabled else 0.0
    resting = (-start - fade_in) / speed / dt * (1 - 1e-9)
    return Course(
        time_step=dt,
        speed=speed,
        start=start,
        n_steps=math.ceil(way / speed / dt),
        first_step=max(1, math.floor(resting)),
    )


def _time_step(config: Config) -> float:
    """Largest admissible fraction of the period of pole passing [s]."""
    pitch = config.train.suspension_magnet.pole_pitch
    period = pitch / config.passage.speed
    parts = math.ceil(period / config.passage.time_step * (1 - 1e-12))
    apart = (
        _first_pole(config.train.suspension_magnet) - _first_pole(config.train.guidance_magnet)
    ) / pitch
    if abs(2 * apart - round(2 * apart)) < 1e-6 and round(2 * apart) % 2 == 1:
        parts += parts % 2
    return period / parts


def _first_pole(magnet: Magnet) -> float:
    """Place of a magnet's foremost pole ahead of its centre [m]."""
    return 0.5 * (magnet.n_poles - 1) * magnet.pole_pitch


def _start(config: Config, advance: float) -> float:
    """Place of the nose at time zero [m]."""
    pole = _first_pole(config.train.suspension_magnet) - 0.5 * config.train.car_pitch
    beyond = (pole - config.passage.approach) / advance + JOINT_SHARE
    return -config.passage.approach - round(beyond, 6) % 1.0 * advance


def track_range(config: Config) -> tuple[float, float]:
    """First and last place at which the irregularity is needed [m], zero at the first pier.

    Examples
    --------
    >>> start, end = track_range(Config())
    >>> start < 0.0 < Config().guideway.length < end
    True
    """
    length = config.train.length
    margin = config.train.car_pitch  # assumed: room at both ends for whatever stands ahead
    return -config.passage.approach - length - margin, config.guideway.length + length + margin
