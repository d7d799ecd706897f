"""What each sample of a row has of its own: tables of rows for the kernels.

Most numbers of a train occur many times.  Each distinct one is a row of a table, so that all rows
of a passage stay in the processor's nearest cache.  Theory: docs/theory/random_systems.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.mechanics import trains as trains_model
from maglev.mechanics._records import Footprints, Law, MagnetRows, Terms, Timing, Vehicle
from maglev.mechanics.control import failing_magnets, late_current, refuse_too_many
from maglev.mechanics.lanes import LANES
from maglev.mechanics.packing import Ground, mean_pole_force
from maglev.mechanics.train import TrainModel
from maglev.mechanics.trains import Rates, Trains
from maglev.mechanics.varied import LEVELS, with_arrays
from maglev.parameters import Config

_CACHE_LINE = 64  # bytes


@dataclass(frozen=True)
class Distinct:
    """Which numbers of a train are the same in every train: found once, by a train unlike others.

    Attributes
    ----------
    first : (distinct,)
        A place of each distinct number.
    number : (place,)
        Which of them stands at each place.
    """

    first: IntArray
    number: IntArray

    def rows(self, values: FloatArray, samples: slice) -> FloatArray:
        """Rows (distinct, LANES) of some of the samples of numbers (sample, place)."""
        return aligned(values[samples, self.first].T)


def distinct(values: FloatArray) -> Distinct:
    """Places at which all trains have equal numbers (train, place).

    Examples
    --------
    >>> distinct(np.array([[1.0, 2.0, 1.0], [1.0, 3.0, 1.0]])).number
    array([0, 1, 0])
    """
    seen: dict[bytes, int] = {}
    columns = np.ascontiguousarray(values.T)
    number = np.array([seen.setdefault(one.tobytes(), len(seen)) for one in columns], dtype=int)
    return Distinct(np.unique(number, return_index=True)[1], number)


def aligned(rows: FloatArray) -> FloatArray:
    """Copy of rows in C order that begins where a line of the processor's cache does."""
    room = np.empty(rows.size + _CACHE_LINE // 8)
    start = -(room.ctypes.data // 8) % (_CACHE_LINE // 8)
    copy = room[start : start + rows.size].reshape(rows.shape)
    copy[...] = rows
    return copy


@dataclass(frozen=True)
class Numbers:
    """What the kernels read of a kind of magnet (sample, place), `MagnetRows` flat."""

    force: FloatArray
    moment: FloatArray
    constant: FloatArray
    current_max: FloatArray
    alike: FloatArray  # gap and current at rest, mass and inertia of a magnet (sample, 4)

    @property
    def pole_force(self) -> FloatArray:
        """Mean force of a pole at rest (sample,), in N m²/A² over the square of δ₀/i₀ [N]."""
        return self.constant.mean(axis=1) * np.square(self.alike[:, 1] / self.alike[:, 0])


@dataclass(frozen=True)
class Shape:
    """What trains that differ in the numbers at some keys have in common for the kernels.

    Attributes
    ----------
    config, train, kinds
        Of the configuration.
    keys
        Dotted keys of what differs.
    unlike : key of number
        Numbers of a train in which nothing is equal by chance; it stands behind the samples, so
        that no number that may be zero is left out.
    inverse_mass, stiffness, damping, coefficient
        Distinct numbers of the bodies and links.
    magnets : kind of
        Distinct static forces, moments, constants and largest currents.
    vehicle
        Links; each spring or damper with the numbers of its stiffness and its damping.
    own_link, own_pull
        Terms of links and pulls that differ: places among the entries, and the records without
        their rows.
    """

    config: Config
    train: TrainModel
    kinds: tuple[MagnetRows, MagnetRows]
    keys: tuple[str, ...]
    unlike: Mapping[str, float]
    inverse_mass: Distinct
    stiffness: Distinct
    damping: Distinct
    coefficient: Distinct
    magnets: tuple[tuple[Distinct, ...], tuple[Distinct, ...]]
    vehicle: Vehicle


def shape_of(
    config: Config,
    train: TrainModel,
    kinds: tuple[MagnetRows, MagnetRows],
    keys: tuple[str, ...],
) -> Shape:
    """Find what trains have in common that differ in the numbers at some keys."""
    unlike = {key: _unlike(config.number_at(key)[0], k) for k, key in enumerate(keys)}
    values = {key: np.array([config.number_at(key)[0], unlike[key]]) for key in keys}
    own: Config = with_arrays(config, values)
    trains = trains_model.build(own.train, train.magnets, 2)
    numbers = _numbers(own, kinds, trains)
    found = [
        distinct(one) for one in (trains.mass, trains.stiffness, trains.damping, trains.coefficient)
    ]
    magnets = [
        tuple(distinct(one) for one in (kind.force, kind.moment, kind.constant, limits))
        for kind, limits in zip(numbers, _limits(keys, numbers), strict=True)
    ]
    return Shape(
        config=config,
        train=train,
        kinds=kinds,
        keys=keys,
        unlike=unlike,
        inverse_mass=found[0],
        stiffness=found[1],
        damping=found[2],
        coefficient=found[3],
        magnets=(magnets[0], magnets[1]),
        vehicle=_vehicle(train, trains, *found[1:]),
    )


def _limits(keys: Sequence[str], numbers: Sequence[Numbers]) -> list[FloatArray]:
    """Largest currents of both kinds, all of them unlike where the number that fail differs."""
    found = []
    for kind, one in zip(("suspension", "guidance"), numbers, strict=True):
        apart = f"control.{kind}.failed_magnets" in keys
        shift = np.arange(one.current_max.shape[1]) if apart else 0.0
        found.append(one.current_max + shift)
    return found


def _unlike(number: float, k: int) -> float:
    """A number near the given one, by another factor for each of several keys."""
    return number * (1.0 + 1e-3 * math.sqrt(2.0 + k)) + 1e-6 * math.sqrt(3.0 + k)


def _vehicle(
    train: TrainModel,
    trains: Trains,
    stiffness: Distinct,
    damping: Distinct,
    coefficient: Distinct,
) -> Vehicle:
    """Links for the kernels: of the entries that differ, places and numbers alone."""
    link, dof = trains.link, trains.dof
    hangs = np.column_stack([dof, stiffness.number[link], damping.number[link]])
    scaled, number = np.unique(hangs, axis=0, return_inverse=True)
    differs = trains.coefficient[0] != trains.coefficient[1]
    n_links, n_dof = trains.stiffness.shape[1], trains.mass.shape[1]
    number = number.ravel().astype(np.int64)
    links, own_link = _terms(link, number, trains.coefficient[0], coefficient, differs, n_links)
    by_dof = np.lexsort((link, dof))
    pulls, own_pull = _terms(
        dof[by_dof],
        link[by_dof],
        trains.coefficient[0][by_dof],
        Distinct(coefficient.first, coefficient.number[by_dof]),
        differs[by_dof],
        n_dof,
    )
    nothing = np.zeros((0, LANES))
    return Vehicle(
        inverse_mass=nothing,
        mass_number=np.zeros(0, dtype=np.int64),
        scaled_dof=scaled[:, 0].astype(np.int64),
        scaled_stiffness=nothing,
        stiffness_number=scaled[:, 1].astype(np.int64),
        scaled_damping=nothing,
        damping_number=scaled[:, 2].astype(np.int64),
        link_start=links[0],
        link_scaled=links[1],
        link_coefficient=links[2],
        pull_start=pulls[0],
        pull_link=pulls[1],
        pull_coefficient=pulls[2],
        own_link=own_link,
        own_pull=own_pull,
        body_z=np.ascontiguousarray(train.car_body_dof[:, 1], dtype=np.int64),
        body_y=np.ascontiguousarray(train.car_body_dof[:, 0], dtype=np.int64),
        body_pitch=np.ascontiguousarray(train.car_body_dof[:, 3], dtype=np.int64),
        body_yaw=np.ascontiguousarray(train.car_body_dof[:, 4], dtype=np.int64),
        end_distance=train.parameters.end_distance,
    )


def _terms(
    place: IntArray,
    column: IntArray,
    value: FloatArray,
    kinds: Distinct,
    differs: BoolArray,
    n_places: int,
) -> tuple[tuple[IntArray, IntArray, FloatArray], Terms]:
    """Sums by place: starts, columns and values of what all share, and terms of the rest."""
    alike = ~differs
    start = np.searchsorted(place[alike], np.arange(n_places + 1)).astype(np.int64)
    places, first = np.unique(place[differs], return_index=True)
    terms = Terms(
        place=places.astype(np.int64),
        start=np.append(first, differs.sum()).astype(np.int64),
        column=column[differs].astype(np.int64),
        number=kinds.number[differs].astype(np.int64),
        rows=np.zeros((0, LANES)),
    )
    return (start, column[alike].astype(np.int64), np.ascontiguousarray(value[alike])), terms


def _numbers(own: Config, kinds: Sequence[MagnetRows], trains: Trains) -> list[Numbers]:
    """Numbers of the magnets of both kinds."""
    n_samples = trains.mass.shape[0]
    magnets = (own.train.suspension_magnet, own.train.guidance_magnet)
    circuits = (own.control.suspension, own.control.guidance)
    found = []
    for magnet, circuit, rows in zip(magnets, circuits, kinds, strict=True):
        rest = trains.pole_force[:, rows.number][..., : rows.offset.size]
        alike = np.stack(
            [
                np.broadcast_to(one, (n_samples,))
                for one in (
                    magnet.gap_reference,
                    magnet.current_reference,
                    magnet.mass,
                    magnet.inertia,
                )
            ],
            axis=1,
        )
        square = np.square(alike[:, 0] / alike[:, 1])
        whole = (n_samples, rows.number.size)
        most = np.broadcast_to(np.reshape(magnet.current_max, (-1, 1)), whole)
        refuse_too_many(circuit.failed_magnets, rows.number.size, guidance=rows.is_guidance)
        most = np.where(_rank(rows) < np.reshape(circuit.failed_magnets, (-1, 1)), 0.0, most)
        found.append(
            Numbers(
                force=rest.sum(axis=-1).reshape(n_samples, -1),
                moment=(rest * rows.arm).sum(axis=-1).reshape(n_samples, -1),
                constant=rest.reshape(n_samples, -1) * square[:, None],
                current_max=most,
                alike=alike,
            )
        )
    return found


def _rank(rows: MagnetRows) -> IntArray:
    """Place of each magnet (row side,) in the order in which they fail."""
    x, side = np.repeat(rows.x, 2), np.tile([1, -1], rows.x.size)
    return np.argsort(failing_magnets(x, side))


@dataclass(frozen=True)
class OwnTrains:
    """Trains, magnets and circuits of some samples.

    Attributes
    ----------
    shape
        What they have in common.
    trains, magnets
        Numbers of bodies and links, and of both kinds of magnets.
    lag : (kind, sample)
        Of the circuits [s].
    gap_contact, gap_lost : (sample,)
        [m].
    level, sagging : (kind, sample)
        Factors on the irregularity and on the standing sag that magnets of a kind meet [-].
    current_limit : (kind, sample)
        Largest current of magnets that have not failed [A].
    rates
        What the time step has to follow.
    """

    shape: Shape
    trains: Trains
    magnets: tuple[Numbers, Numbers]
    lag: FloatArray
    gap_contact: FloatArray
    gap_lost: FloatArray
    level: FloatArray
    sagging: FloatArray
    current_limit: FloatArray
    rates: Rates

    def vehicle(self, samples: slice) -> Vehicle:
        """Links of a row of samples."""
        shape, trains = self.shape, self.trains
        vehicle = shape.vehicle
        coefficients = shape.coefficient.rows(trains.coefficient, samples)
        return vehicle._replace(
            inverse_mass=1.0 / shape.inverse_mass.rows(trains.mass, samples),
            mass_number=shape.inverse_mass.number,
            scaled_stiffness=shape.stiffness.rows(trains.stiffness, samples),
            scaled_damping=shape.damping.rows(trains.damping, samples),
            own_link=vehicle.own_link._replace(rows=coefficients),
            own_pull=vehicle.own_pull._replace(rows=coefficients),
        )

    def compared_with(
        self, influence: FloatArray, span_length: float, samples: slice
    ) -> dict[str, FloatArray]:
        """What responses of a row of samples are compared with, for `Passages`.

        Parameters
        ----------
        influence : (nose, magnet, pole)
            From `maglev.mechanics.statics.influence`.
        span_length
            [m].
        samples
            Of the row.
        """
        rows = [self.trains.pole_force[k] for k in range(samples.start, samples.stop)]
        flat = influence.reshape(influence.shape[0], -1)
        force = [one[:, : influence.shape[2]].ravel() for one in rows]
        return {
            "gap_reference": np.stack([one.alike[samples, 0] for one in self.magnets], axis=1),
            "current_limit": self.current_limit[:, samples].T,
            "span_length": np.full(len(rows), span_length),
            "static_deflection": np.array([(flat @ one).max() for one in force]),
        }

    def kind(self, number: int, samples: slice) -> MagnetRows:
        """Magnets of one kind of a row of samples."""
        own = self.magnets[number]
        force, moment, constant, current = self.shape.magnets[number]
        gap_reference, current_reference, mass, inertia = (
            aligned(one[None]) for one in own.alike[samples].T
        )
        return self.shape.kinds[number]._replace(
            static_force=force.rows(own.force, samples),
            force_number=force.number,
            static_moment=moment.rows(own.moment, samples),
            moment_number=moment.number,
            constant=constant.rows(own.constant, samples),
            constant_number=constant.number,
            current_max=current.rows(own.current_max, samples),
            current_number=current.number,
            gap_reference=gap_reference,
            current_reference=current_reference,
            mass=mass,
            inertia=inertia,
        )


def own_trains(shape: Shape, values: Mapping[str, FloatArray], n_samples: int) -> OwnTrains:
    """Trains of samples that have numbers of their own.

    Parameters
    ----------
    shape
        From `shape_of` for the same keys.
    values : key of (sample,)
        Numbers in SI.
    n_samples
        Number of samples.

    Raises
    ------
    UserError
        If a pole would have to push at rest.
    """
    config = shape.config
    behind = {key: np.append(values[key], shape.unlike[key]) for key in shape.keys}
    n_samples += 1
    own: Config = with_arrays(config, behind)
    trains = trains_model.build(own.train, shape.train.magnets, n_samples)
    suspension, guidance = _numbers(own, shape.kinds, trains)
    rest = [mean_pole_force(rows) for rows in shape.kinds]

    def each(number: float | FloatArray) -> FloatArray:
        return np.broadcast_to(np.asarray(number, dtype=float), (n_samples,))

    return OwnTrains(
        shape=shape,
        trains=trains,
        magnets=(suspension, guidance),
        lag=np.stack([each(own.control.suspension.lag), each(own.control.guidance.lag)]),
        gap_contact=each(own.passage.gap_contact),
        gap_lost=each(own.passage.gap_lost),
        level=np.stack([each(one) for one in _levels(config, behind)]),
        sagging=np.stack([suspension.pole_force / rest[0], guidance.pole_force / rest[1]]),
        current_limit=np.stack(
            [
                each(own.train.suspension_magnet.current_max),
                each(own.train.guidance_magnet.current_max),
            ]
        ),
        rates=trains_model.rates(trains, own.train, shape.train.magnets),
    )


def _levels(config: Config, values: Mapping[str, FloatArray]) -> list[float | FloatArray]:
    """Factors on the vertical and on the lateral irregularity [-]."""
    found: list[float | FloatArray] = []
    for direction in ("vertical", "lateral"):
        keys = [f"irregularity.{direction}.{name}" for name in LEVELS]
        given = [key for key in keys if key in values]
        found.append(np.sqrt(values[given[0]] / config.number_at(given[0])[0]) if given else 1.0)
    return found


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


def own_timing(timing: Timing, train: OwnTrains, samples: slice) -> Timing:
    """The passage with the bounds on the gap that each sample of a row has of its own."""
    return timing._replace(
        gap_contact=aligned(train.gap_contact[samples]), gap_lost=aligned(train.gap_lost[samples])
    )
