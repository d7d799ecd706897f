"""What each sample of a row has of its own: tables of rows for the kernels.

Most numbers of a train occur many times.  Each distinct one is a row of a table, so that all rows
of a passage stay in the processor's nearest cache.  Theory: docs/theory/random_systems.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from maglev.arrays import FloatArray, IntArray
from maglev.mechanics import trains as trains_model
from maglev.mechanics._records import Footprints, Law, MagnetRows, Timing, Vehicle
from maglev.mechanics.control import late_current
from maglev.mechanics.packing import Ground, mean_pole_force
from maglev.mechanics.train import TrainModel
from maglev.mechanics.trains import Rates, Trains
from maglev.mechanics.varied import LEVELS, with_arrays
from maglev.parameters import Config, Magnet

_CACHE_LINE = 64  # bytes


class Table(NamedTuple):
    """Distinct numbers of samples, and which of them stands at each place."""

    rows: FloatArray  # (distinct, sample)
    number: IntArray  # (place,)

    def of(self, samples: slice) -> FloatArray:
        """Rows (distinct, LANES) of some samples, where a line of the processor's cache begins."""
        return aligned(self.rows[:, samples])


def table(values: FloatArray) -> Table:
    """Distinct columns of numbers (sample, place).

    Examples
    --------
    >>> table(np.array([[1.0, 2.0, 1.0], [1.0, 3.0, 1.0]])).number
    array([0, 1, 0])
    """
    columns = np.ascontiguousarray(values.T)
    seen: dict[bytes, int] = {}
    number = np.array([seen.setdefault(column.tobytes(), len(seen)) for column in columns])
    first = np.unique(number, return_index=True)[1]
    return Table(columns[first], number.astype(np.int64))


def aligned(rows: FloatArray) -> FloatArray:
    """Copy of rows in C order that begins where a line of the processor's cache does."""
    room = np.empty(rows.size + _CACHE_LINE // 8)
    start = -(room.ctypes.data // 8) % (_CACHE_LINE // 8)
    copy = room[start : start + rows.size].reshape(rows.shape)
    copy[...] = rows
    return copy


@dataclass(frozen=True)
class OwnTrain:
    """Trains, magnets and circuits of some samples, a whole number of rows.

    Attributes
    ----------
    kinds
        Suspension and guidance magnets.
    vehicle
        Places and tables of the links.
    lag : (kind, sample)
        Of the circuits [s].
    gap_contact, gap_lost : (sample,)
        [m].
    level, sagging : (kind, sample)
        Factors on the irregularity and on the standing sag that magnets of a kind meet [-].
    rates
        What the time step has to follow.
    """

    kinds: tuple[OwnMagnets, OwnMagnets]
    vehicle: OwnVehicle
    lag: FloatArray
    gap_contact: FloatArray
    gap_lost: FloatArray
    level: FloatArray
    sagging: FloatArray
    rates: Rates


@dataclass(frozen=True)
class OwnVehicle:
    """Tables of `Vehicle`, and what all samples share of it."""

    shared: Vehicle
    inverse_mass: Table
    stiffness: Table
    damping: Table
    link: Table
    pull: Table

    def row(self, samples: slice) -> Vehicle:
        """Record of one row of samples."""
        return self.shared._replace(
            inverse_mass=self.inverse_mass.of(samples),
            mass_number=self.inverse_mass.number,
            scaled_stiffness=self.stiffness.of(samples),
            stiffness_number=self.stiffness.number,
            scaled_damping=self.damping.of(samples),
            damping_number=self.damping.number,
            link_coefficient=self.link.of(samples),
            link_number=self.link.number,
            pull_coefficient=self.pull.of(samples),
            pull_number=self.pull.number,
        )


@dataclass(frozen=True)
class OwnMagnets:
    """Tables of `MagnetRows` of one kind, and what all samples share of it."""

    shared: MagnetRows
    force: Table
    moment: Table
    constant: Table
    current_max: Table
    gap_reference: FloatArray
    current_reference: FloatArray
    mass: FloatArray
    inertia: FloatArray
    sagging: FloatArray

    def row(self, samples: slice) -> MagnetRows:
        """Record of one row of samples."""
        return self.shared._replace(
            static_force=self.force.of(samples),
            force_number=self.force.number,
            static_moment=self.moment.of(samples),
            moment_number=self.moment.number,
            constant=self.constant.of(samples),
            constant_number=self.constant.number,
            current_max=self.current_max.of(samples),
            current_number=self.current_max.number,
            gap_reference=aligned(self.gap_reference[None, samples]),
            current_reference=aligned(self.current_reference[None, samples]),
            mass=aligned(self.mass[None, samples]),
            inertia=aligned(self.inertia[None, samples]),
        )


def own_train(
    config: Config,
    train: TrainModel,
    kinds: tuple[MagnetRows, MagnetRows],
    values: Mapping[str, FloatArray],
    n_samples: int,
) -> OwnTrain:
    """Trains of samples that have numbers of their own.

    Parameters
    ----------
    config, train, kinds
        What all share beyond the values.
    values : key of (sample,)
        Numbers in SI by dotted keys whose cost is that of a sample.
    n_samples
        Number of samples.

    Raises
    ------
    UserError
        If a pole would have to push at rest.
    """
    own: Config = with_arrays(config, values)
    trains = trains_model.build(own.train, train.magnets, n_samples)
    magnets = (own.train.suspension_magnet, own.train.guidance_magnet)

    def each(number: float | FloatArray) -> FloatArray:
        return np.broadcast_to(np.asarray(number, dtype=float), (n_samples,))

    suspension, guidance = (
        _magnets(magnet, rows, trains, n_samples)
        for magnet, rows in zip(magnets, kinds, strict=True)
    )
    return OwnTrain(
        kinds=(suspension, guidance),
        vehicle=_vehicle(train, trains),
        lag=np.stack([each(own.control.suspension.lag), each(own.control.guidance.lag)]),
        gap_contact=each(own.passage.gap_contact),
        gap_lost=each(own.passage.gap_lost),
        level=np.stack([each(one) for one in _levels(config, values)]),
        sagging=np.stack([suspension.sagging, guidance.sagging]),
        rates=trains_model.rates(trains, own.train, train.magnets),
    )


def _levels(config: Config, values: Mapping[str, FloatArray]) -> list[float | FloatArray]:
    """Factors on the vertical and on the lateral irregularity [-]."""
    found: list[float | FloatArray] = []
    for direction in ("vertical", "lateral"):
        keys = [f"irregularity.{direction}.{name}" for name in LEVELS]
        given = [key for key in keys if key in values]
        found.append(np.sqrt(values[given[0]] / config.number_at(given[0])[0]) if given else 1.0)
    return found


def _vehicle(train: TrainModel, trains: Trains) -> OwnVehicle:
    """Links of the trains in the order of the kernels."""
    link, dof = trains.link, trains.dof
    stiffness, damping = table(trains.stiffness), table(trains.damping)
    hangs = np.column_stack([dof, stiffness.number[link], damping.number[link]])
    scaled, number = np.unique(hangs, axis=0, return_inverse=True)
    n_links, n_dof = trains.stiffness.shape[1], trains.mass.shape[1]
    by_dof = np.lexsort((link, dof))
    coefficient = table(trains.coefficient)
    nothing, none = np.zeros(0), np.zeros(0, dtype=np.int64)
    shared = Vehicle(
        inverse_mass=nothing,
        mass_number=none,
        scaled_dof=scaled[:, 0].astype(np.int64),
        scaled_stiffness=nothing,
        stiffness_number=none,
        scaled_damping=nothing,
        damping_number=none,
        link_start=np.searchsorted(link, np.arange(n_links + 1)).astype(np.int64),
        link_scaled=number.ravel().astype(np.int64),
        link_coefficient=nothing,
        link_number=none,
        pull_start=np.searchsorted(dof[by_dof], np.arange(n_dof + 1)).astype(np.int64),
        pull_link=link[by_dof].astype(np.int64),
        pull_coefficient=nothing,
        pull_number=none,
        body_z=np.ascontiguousarray(train.car_body_dof[:, 1], dtype=np.int64),
        body_y=np.ascontiguousarray(train.car_body_dof[:, 0], dtype=np.int64),
    )
    return OwnVehicle(
        shared=shared,
        inverse_mass=table(1.0 / trains.mass),
        stiffness=Table(stiffness.rows, scaled[:, 1].astype(np.int64)),
        damping=Table(damping.rows, scaled[:, 2].astype(np.int64)),
        link=coefficient,
        pull=Table(coefficient.rows, coefficient.number[by_dof]),
    )


def _magnets(magnet: Magnet, rows: MagnetRows, trains: Trains, n_samples: int) -> OwnMagnets:
    """Magnets of one kind, as `maglev.mechanics.packing.magnet_rows` has them of one train."""

    def each(number: float | FloatArray) -> FloatArray:
        return np.broadcast_to(np.asarray(number, dtype=float), (n_samples,))

    rest = trains.pole_force[:, rows.number][..., : rows.offset.size]
    gap, current = each(magnet.gap_reference), each(magnet.current_reference)
    constant = rest * np.square(gap / current)[:, None, None, None]

    def flat(values: FloatArray) -> Table:
        return table(values.reshape(n_samples, -1))

    return OwnMagnets(
        shared=rows,
        force=flat(rest.sum(axis=-1)),
        moment=flat((rest * rows.arm).sum(axis=-1)),
        constant=flat(constant),
        current_max=flat(np.tile(each(magnet.current_max)[:, None], (1, rows.number.size))),
        gap_reference=gap,
        current_reference=current,
        mass=each(magnet.mass),
        inertia=each(magnet.inertia),
        sagging=rest.reshape(n_samples, -1).mean(axis=1) / mean_pole_force(rows),
    )


def own_law(law: Law, lag: FloatArray, delay: float, time_step: float) -> Law:
    """Circuits of one kind with the lag (LANES,) that each sample of a row has of its own."""
    late = [late_current(float(one), delay, time_step) for one in lag]
    return law._replace(
        lags=law.lags or bool(np.any(lag > 0)),
        decay=aligned(np.array([[one.decay for one in late]])),
        command_now=aligned(np.array([[one.now for one in late]])),
        command_before=aligned(np.array([[one.before for one in late]])),
    )


def own_footprints(
    footprints: Footprints, ground: Ground, level: FloatArray, sagging: FloatArray, speed: float
) -> Footprints:
    """What poles of a kind meet, with the level and the sag that each sample (LANES,) has.

    ``footprints`` hold the irregularity alone.
    """
    return footprints._replace(
        level=aligned(level[None]),
        sag=np.ascontiguousarray(ground.sag).ravel(),
        sag_rise=np.ascontiguousarray(ground.sag_slope * speed).ravel(),
        sagging=aligned(sagging[None]),
    )


def own_timing(timing: Timing, train: OwnTrain, samples: slice) -> Timing:
    """The passage with the bounds on the gap that each sample of a row has of its own."""
    return timing._replace(
        gap_contact=aligned(train.gap_contact[samples]), gap_lost=aligned(train.gap_lost[samples])
    )
