"""Reported responses: their band, what is watched of passages, and what follows from it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial

import numpy as np
import numpy.typing as npt

from maglev.arrays import FloatArray, IntArray
from maglev.errors import UserError
from maglev.mechanics.comfort import WEIGHTINGS, sperling_index
from maglev.parameters import Config, Passage
from maglev.vocabulary import RESPONSES, STEP_TOO_LARGE, Response

GIRDER_RESPONSES = (
    "girder_displacement_z",
    "girder_displacement_y",
    "girder_acceleration_z",
    "girder_acceleration_y",
)
"""The responses of midspan, in the order of the ``response`` axis."""


@dataclass(frozen=True)
class Passages:
    """Results of a set of passages; girder responses in the order of `GIRDER_RESPONSES`.

    Attributes
    ----------
    girder, girder_time : (sample, response)
        Largest absolute value [m, m/s²] and when it occurred [s]; NaN where levitation was lost.
    girder_positive, girder_negative : (sample, response)
        Largest value downwards or to the right, and largest the other way [m, m/s²]; likewise.
    body_z, body_y, body_z_time, body_y_time : (sample, car)
        Largest absolute acceleration of each car body [m/s²] and when it occurred [s]; likewise.
    end_z, end_y, end_z_time, end_y_time : (sample, car)
        The same of the ends of its floor.
    weighted : (sample, weighting, car)
        Root mean square at the worse end of each car's floor, in the order of
        `maglev.mechanics.comfort.WEIGHTINGS` [m/s²]; likewise.
    lift, lift_time : (sample,)
        Largest lift off a bearing of the middle span [m] and when it occurred [s]; likewise.
    gap_reference, current_limit : (sample, kind)
        Gap at rest [m] and largest current of the chopper [A] of suspension and guidance.
    span_length, static_deflection : (sample,)
        Of the guideway [m], and the largest deflection of midspan under the train at rest [m].
    gap_min, gap_max, current_max : (sample, kind)
        Of suspension and guidance [m, m, A].
    status : (sample,)
        End of the passage: 0 completed, 1 contact, 2 gap lost, 3 not finite, 4 not judged, as
        the step is too large for the gains.
    lost_time : (sample,)
        When levitation was lost [s]; NaN where it was not.
    lost_magnet : (sample,)
        Magnet that lost it, a row of the train's table; -1 where none did.
    time : (record,)
        Elapsed time of the recorded steps [s].
    girder_history : (sample, response, record)
        From the production solver the accelerations of a last record at the end of the passage are
        those of the step before.
    body_z_history, body_y_history : (sample, car, record)
    gap_history, current_history : (sample, magnet, record)
        Mean gap of each magnet's poles [m] and mean current [A].
    """

    girder: FloatArray
    girder_time: FloatArray
    girder_positive: FloatArray
    girder_negative: FloatArray
    body_z: FloatArray
    body_y: FloatArray
    body_z_time: FloatArray
    body_y_time: FloatArray
    end_z: FloatArray
    end_y: FloatArray
    end_z_time: FloatArray
    end_y_time: FloatArray
    weighted: FloatArray
    lift: FloatArray
    lift_time: FloatArray
    gap_reference: FloatArray
    current_limit: FloatArray
    span_length: FloatArray
    static_deflection: FloatArray
    gap_min: FloatArray
    gap_max: FloatArray
    current_max: FloatArray
    status: IntArray
    lost_time: FloatArray
    lost_magnet: IntArray
    time: FloatArray
    girder_history: FloatArray
    body_z_history: FloatArray
    body_y_history: FloatArray
    gap_history: FloatArray
    current_history: FloatArray


@dataclass(frozen=True)
class Found:
    """One response of a set of passages.

    Attributes
    ----------
    value : (sample,)
        NaN where levitation was lost.
    time : (sample,)
        When it occurred [s], of a response that is of one moment.
    per_car : (sample, car)
        Of a response of cars, of which the value is the largest.
    positive, negative : (sample,)
        Largest in the direction of the axis and against it, where both are kept.
    """

    value: FloatArray
    time: FloatArray | None = None
    per_car: FloatArray | None = None
    positive: FloatArray | None = None
    negative: FloatArray | None = None

    @property
    def parts(self) -> dict[str, FloatArray]:
        """What there is, by the end of its name in a file."""
        all_parts = {
            "": self.value,
            "_t": self.time,
            "_per_car": self.per_car,
            "_positive": self.positive,
            "_negative": self.negative,
        }
        return {name: values for name, values in all_parts.items() if values is not None}


def compared_with(
    config: Config, static_deflection: float, n_samples: int
) -> dict[str, FloatArray]:
    """What responses of samples that share a configuration are compared with, for `Passages`.

    Parameters
    ----------
    config
        Their configuration.
    static_deflection
        Largest deflection of midspan under the train at rest [m].
    n_samples
        Number of samples.

    Examples
    --------
    >>> compared_with(Config(), 1.6e-3, 1)["current_limit"].tolist()
    [[120.0, 120.0]]
    """
    magnets = (config.train.suspension_magnet, config.train.guidance_magnet)
    one = {
        "gap_reference": [magnet.gap_reference for magnet in magnets],
        "current_limit": [magnet.current_max for magnet in magnets],
        "span_length": config.guideway.span_length,
        "static_deflection": static_deflection,
    }
    return {name: np.array([value] * n_samples) for name, value in one.items()}


def responses(passages: Passages) -> dict[Response, Found]:
    """All responses of a set of passages, in the order of `maglev.vocabulary.RESPONSES`.

    Parameters
    ----------
    passages
        What was watched, and what it is compared with.

    References
    ----------
    docs/theory/responses.md.

    Examples
    --------
    >>> from maglev.mechanics.integrate import integrate, prepare
    >>> from maglev.simulation import track
    >>> short = {"train": {"n_cars": 1}, "guideway": {"n_spans": 1}}
    >>> config = Config.model_validate(short)
    >>> passages = integrate(prepare(config, track(config)), np.array([config.gains.as_row]))
    >>> bool(1.0 < responses(passages)["dynamic_coefficient"].value[0] < 1.2)
    True
    """
    return {name: _FOUND[name](passages) for name in RESPONSES}


def _of_girder(place: int, passages: Passages) -> Found:
    return Found(
        passages.girder[:, place],
        passages.girder_time[:, place],
        positive=passages.girder_positive[:, place],
        negative=passages.girder_negative[:, place],
    )


def _of_cars(per_car: FloatArray, time: FloatArray | None = None) -> Found:
    """The largest over the cars."""
    worst = np.where(np.isnan(per_car), -1.0, per_car).argmax(axis=1)[:, None]

    def of_worst(values: FloatArray) -> FloatArray:
        return np.take_along_axis(values, worst, axis=1)[:, 0]

    return Found(of_worst(per_car), None if time is None else of_worst(time), per_car)


def _held(values: FloatArray, passages: Passages) -> FloatArray:
    """Values of the passages that were completed."""
    return np.where(passages.status == 0, values, np.nan)


def _gap_excursion(kind: int, passages: Passages) -> Found:
    reference = passages.gap_reference[:, kind]
    closer = reference - passages.gap_min[:, kind]
    return Found(_held(np.maximum(closer, passages.gap_max[:, kind] - reference), passages))


def _current_share(kind: int, passages: Passages) -> Found:
    share = passages.current_max[:, kind] / passages.current_limit[:, kind]
    return Found(_held(share, passages))


def _sperling(weighting: int, passages: Passages) -> Found:
    return _of_cars(sperling_index(passages.weighted[:, weighting]))


def _iso_2631(weighting: int, passages: Passages) -> Found:
    return _of_cars(passages.weighted[:, weighting])


def _dynamic_coefficient(passages: Passages) -> Found:
    largest = passages.girder[:, 0]
    return Found(largest / passages.static_deflection, passages.girder_time[:, 0])


def _deflection_over_span(passages: Passages) -> Found:
    return Found(passages.girder[:, 0] / passages.span_length, passages.girder_time[:, 0])


_FOUND: Mapping[Response, Callable[[Passages], Found]] = {
    "girder_displacement_z": partial(_of_girder, 0),
    "girder_displacement_y": partial(_of_girder, 1),
    "girder_acceleration_z": partial(_of_girder, 2),
    "girder_acceleration_y": partial(_of_girder, 3),
    "car_body_acceleration_z": lambda one: _of_cars(one.body_z, one.body_z_time),
    "car_body_acceleration_y": lambda one: _of_cars(one.body_y, one.body_y_time),
    "suspension_gap_excursion": partial(_gap_excursion, 0),
    "guidance_gap_excursion": partial(_gap_excursion, 1),
    "suspension_current_share": partial(_current_share, 0),
    "guidance_current_share": partial(_current_share, 1),
    "car_end_acceleration_z": lambda one: _of_cars(one.end_z, one.end_z_time),
    "car_end_acceleration_y": lambda one: _of_cars(one.end_y, one.end_y_time),
    "sperling_index_z": partial(_sperling, 0),
    "sperling_index_y": partial(_sperling, 1),
    "iso2631_rms_z": partial(_iso_2631, 2),
    "iso2631_rms_y": partial(_iso_2631, 3),
    "dynamic_coefficient": _dynamic_coefficient,
    "deflection_over_span": _deflection_over_span,
    "bearing_uplift": lambda one: Found(one.lift, one.lift_time),
}
"""How each response follows from what is watched."""


def not_judged(config: Config, n_samples: int) -> Passages:
    """Passages without histories of a system for which the step is too large.

    Examples
    --------
    >>> not_judged(Config(), 2).status.tolist()
    [4, 4]
    """
    n_cars = config.train.n_cars
    more = {
        "girder": (4,),
        "body": (n_cars,),
        "end": (n_cars,),
        "weighted": (len(WEIGHTINGS), n_cars),
        "gap": (2,),
        "current": (2,),
    }
    known: dict[str, npt.NDArray] = {
        **compared_with(config, np.nan, n_samples),
        "status": np.full(n_samples, STEP_TOO_LARGE),
        "lost_magnet": np.full(n_samples, -1),
        "time": np.empty(0),
    }
    for name in (field.name for field in fields(Passages) if field.name not in known):
        of_history = (0, 0) if name.endswith("_history") else more.get(name.split("_")[0], ())
        known[name] = np.full((n_samples, *of_history), np.nan)
    return Passages(**known)


def in_their_order(parts: Sequence[Passages], rows: Sequence[IntArray]) -> Passages:
    """Passages of one set from those of its groups, which may have different trains.

    Parameters
    ----------
    parts
        Passages of each group.
    rows : group of (sample,)
        Numbers of their samples.

    Returns
    -------
    passages
        Of all samples in order; a car that a train does not have is NaN.

    Examples
    --------
    >>> parts = [not_judged(Config(), 1), not_judged(Config(), 2)]
    >>> in_their_order(parts, [np.array([1]), np.array([0, 2])]).status.size
    3
    """
    order = np.argsort(np.concatenate(rows), kind="stable")

    def joined(name: str) -> npt.NDArray:
        arrays = [getattr(part, name) for part in parts]
        if name == "time":
            return arrays[0]
        longest = tuple(np.max([one.shape[1:] for one in arrays], axis=0))
        padded = [
            np.pad(
                one,
                [(0, 0), *((0, most - n) for most, n in zip(longest, one.shape[1:], strict=True))],
                constant_values=np.nan if one.dtype.kind == "f" else 0,
            )
            for one in arrays
        ]
        return np.concatenate(padded)[order]

    return Passages(**{field.name: joined(field.name) for field in fields(Passages)})


def checked_gains(gains: npt.ArrayLike, further: tuple[float, ...] = (0.0,) * 4) -> FloatArray:
    """Return the gains as (sample, 8) doubles.

    Parameters
    ----------
    gains : (sample, 4) or (sample, 8)
        Suspension k_p [A/m], k_d [A s/m], guidance k_p, k_d; then suspension k_a [A s²/m],
        k_i [A/(m s)], guidance k_a, k_i.
    further : (4,)
        Values of the last four where only four are given, from `maglev.parameters.Gains.further`.

    Raises
    ------
    UserError
        If they have another shape, no sample, or a value that is not finite.

    Examples
    --------
    >>> checked_gains([[3500.0, 17.5, 4500.0, 17.5]]).shape
    (1, 8)
    """
    array = np.asarray(gains, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] not in (4, 8):
        hint = "; transpose them" if array.ndim == 2 and array.shape[0] in (4, 8) else ""
        raise UserError(f"gains have shape {array.shape}, expected (sample, gain) = (any, 4){hint}")
    if array.shape[0] == 0:
        raise UserError("gains have no sample, expected at least one row")
    bad = np.flatnonzero(~np.isfinite(array).all(axis=1))
    if bad.size:
        raise UserError(
            f"gains must be finite, got {array[bad[0]].tolist()} at sample {bad[0]}"
            + (f" and {bad.size - 1} more such samples" if bad.size > 1 else "")
        )
    if array.shape[1] == 4:
        array = np.column_stack([array, np.broadcast_to(further, array.shape)])
    return np.ascontiguousarray(array)


def acceleration_filter(passage: Passage, time_step: float) -> FloatArray:
    """Second-order sections of the low-pass on guideway accelerations; the identity without a band.

    Parameters
    ----------
    passage
        Band and order.
    time_step
        Δt [s].

    Returns
    -------
    sections : (section, 6)
        As `scipy.signal.sosfilt` takes them.

    Raises
    ------
    UserError
        If the band reaches half the sampling rate.

    Notes
    -----
    Each section keeps the poles of the analogue filter, z = exp(pΔt), and a numerator that makes
    its response that of the analogue one up to the square of the frequency.  With ωΔt = 0.34 at the
    edge of the band, gain and phase of the whole are within 0.02 % and 0.0006 rad below it; the
    bilinear transformation, bent to fit at the edge, is 0.02 rad off.  The error grows with the
    fourth power of ωΔt: 1.4 % with an edge of 300 Hz and 0.54 ms, so that a wide band needs a
    smaller step.

    References
    ----------
    docs/theory/integration.md, eq. 8.

    Examples
    --------
    >>> acceleration_filter(Passage(), 0.5e-3).shape  # eighth order
    (4, 6)
    """
    band = passage.acceleration_band
    if band is None:
        return np.array([[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]])
    if not band < 0.5 / time_step:
        raise UserError(
            "passage.acceleration_band must be below half the sampling rate, "
            f"{0.5 / time_step:g} Hz, got {band:g} Hz"
        )
    order, dt = passage.acceleration_filter_order, time_step
    edge = 2 * np.pi * band
    angle = np.pi * (2 * np.arange(order // 2) + 1) / (2 * order)
    turn = np.exp(edge * (1j * np.cos(angle) - np.sin(angle)) * dt)  # poles
    feedback = np.stack([np.ones_like(angle), -2 * turn.real, np.abs(turn) ** 2])
    # powers of s in exp(-k s Δt), k = 0, 1, 2
    powers = np.array([[1.0, 1.0, 1.0], [0.0, -dt, -2 * dt], [0.0, dt**2 / 2, 2 * dt**2]])
    d0, d1, d2 = powers @ feedback
    slow, bend = 2 * np.sin(angle) / edge, edge**-2.0  # 1 / H(s) = 1 + slow s + bend s²
    wanted = np.stack([d0, d1 - slow * d0, d2 - slow * d1 + (slow**2 - bend) * d0])
    return np.column_stack([*np.linalg.solve(powers, wanted), *feedback])
