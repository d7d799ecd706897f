"""Where the train is when: the run from start to end, its step, and the track it sees."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from maglev.parameters import Config


def time_step(config: Config) -> float:
    """Step of the time integration [s]: the largest that fits the pole passing.

    A pole enters each span with a kink in its force, and poles follow one another at the rate
    v / pole pitch.  A step that divides this period keeps all harmonics of pole passing where they
    are; any other folds them into the band of the responses.

    Parameters
    ----------
    config
        ``passage.time_step`` is the upper bound.

    References
    ----------
    docs/theory/integration.md.
    """
    period = config.train.suspension_magnet.pole_pitch / config.passage.speed
    return period / math.ceil(period / config.passage.time_step * (1 - 1e-12))


def n_steps(config: Config) -> int:
    """Number of time steps from the start until the tail has left the last span [-]."""
    way = config.passage.approach + config.guideway.length + config.train.length
    return math.ceil(way / config.passage.speed / time_step(config))


def first_step(config: Config) -> int:
    """Number of the first step on which anything moves [-].

    Until the nose reaches the irregularity, or without one the guideway, the train rests in its
    equilibrium over rigid straight track: nothing need be computed.
    """
    fade_in = config.irregularity.fade_in if config.irregularity.enabled else 0.0
    way = config.passage.approach - fade_in
    return max(1, math.floor(way / config.passage.speed / time_step(config) * (1 - 1e-9)))


def nose(config: Config, step: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """Place of the nose at the end of given steps [m], the first pier at zero."""
    return -config.passage.approach + config.passage.speed * (step * time_step(config))


def track_range(config: Config) -> tuple[float, float]:
    """First and last place the irregularity is needed at [m], the first pier at zero."""
    length = config.train.length
    margin = config.train.car_pitch  # assumed: room at both ends for whatever stands ahead
    return -config.passage.approach - length - margin, config.guideway.length + length + margin
