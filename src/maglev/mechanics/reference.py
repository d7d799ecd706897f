"""The reference solver: every degree of freedom, Newmark's rule, and a known error.

It is written to be read and believed, not to be fast.  It shares with the production solver the
physical models of train, guideway and track, and no code of the time integration, the magnets or
the coupling.  Magnets stand in `maglev.mechanics.reference_magnets`, one step in
`maglev.mechanics.reference_step`, whole passages here.  Theory: docs/theory/integration.md,
"Reference solver".
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.interpolate import CubicSpline
from scipy.signal import sosfilt
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.errors import UserError
from maglev.mechanics import guideway as guideway_model
from maglev.mechanics import train as train_model
from maglev.mechanics.comfort import weighted_rms
from maglev.mechanics.control import first_moving_step
from maglev.mechanics.course import course
from maglev.mechanics.irregularity import Profile
from maglev.mechanics.reference_magnets import Poles
from maglev.mechanics.reference_step import State, System, at_rest, held, stepped, system, views
from maglev.mechanics.responses import (
    GIRDER_RESPONSES,
    Passages,
    acceleration_filter,
    checked_gains,
    compared_with,
)
from maglev.mechanics.statics import largest_deflection
from maglev.parameters import Config

FIRST_STEP = 0.36e-3
"""Longest first step [s].  At 100 Hz, the upper end of the band, ωΔt = 0.23 lengthens the period by
0.4 %; half the step leaves 0.1 %, the tolerance, before extrapolation."""

FEWEST_IN_A_PERIOD = 6
"""Fewest first steps in the period of pole passing [-].

With four, harmonics of the load fold into the band, and the error falls with no fixed power of the
step: extrapolated from 0.54 and 0.27 ms at 430 km/h, an acceleration was 0.1 % off."""

MOST_HALVINGS = 5
"""Largest number of halvings of the first step [-]."""

ERROR = 1e-3
"""Largest estimated error of an extreme, as a share of it [-]."""

CAUTION = 0.5
"""Estimated error of an extrapolated extreme, as a share of the change by extrapolation [-].

Where the change was above 0.1 %, a fifth of it or less was left."""

NEGLIGIBLE = 1e-3
"""The error of a lateral extreme is relative to at least this share of the vertical one [-]."""

RESPONSES = (*GIRDER_RESPONSES, "car_body_acceleration_z", "car_body_acceleration_y")
"""The six responses whose error is estimated."""

_EXTRAPOLATED = ("girder", "body_z", "body_y", "body_pitch", "body_yaw", "opening")
"""The histories of a record that are extrapolated."""

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Energy:
    """Energy account of each passage [J], all from zero at the start.

    Attributes
    ----------
    time : (step,)
    work_on_train, work_on_guideway : (step, sample)
        Work of the magnets: on the train by forces beyond those at rest, on the rails by all.
    dissipated : (step, sample)
        Energy dissipated in links, bearings and the guideway's damping.
    stored : (step, sample)
        Kinetic and strain energy of train and guideway.
    """

    time: FloatArray
    work_on_train: FloatArray
    work_on_guideway: FloatArray
    dissipated: FloatArray
    stored: FloatArray


@dataclass
class Fate:
    """End of each passage, as in `maglev.mechanics.responses.Passages`."""

    status: IntArray
    lost_time: FloatArray
    lost_magnet: IntArray

    @classmethod
    def open(cls, n_samples: int) -> Fate:
        """Fate of samples that are all under way."""
        return cls(
            np.zeros(n_samples, dtype=np.int64),
            np.full(n_samples, np.nan),
            np.full(n_samples, -1, dtype=np.int64),
        )


@dataclass
class Record:
    """Histories of passages that are computed together, and the end of each.

    Attributes
    ----------
    time : (step,)
        End of each step [s].
    girder : (step, 4, sample)
        In the order of `GIRDER_RESPONSES` [m, m/s²]; accelerations in their band once finished.
    body_z, body_y : (step, car, sample)
        Accelerations of the car bodies [m/s²].
    body_pitch, body_yaw : (step, car, sample)
        Their angular accelerations [rad/s²].
    opening : (step, 4, sample)
        Of the middle span's bearings, as in `GuidewayModel.bearing_rows` [m].
    gap_min, gap_max, current_max : (step, kind, sample)
        Over all poles of a kind [m, m, A].
    gap, current : (record, magnet, sample)
        Means of magnets, every so many steps [m, A].
    power : (step, 3, sample)
        On the train, on the guideway, and dissipated [W].
    stored : (step, sample)
        Energy [J].
    fate
        End of each passage.
    """

    time: FloatArray
    girder: FloatArray
    body_z: FloatArray
    body_y: FloatArray
    body_pitch: FloatArray
    body_yaw: FloatArray
    opening: FloatArray
    gap_min: FloatArray
    gap_max: FloatArray
    current_max: FloatArray
    gap: FloatArray
    current: FloatArray
    power: FloatArray
    stored: FloatArray
    fate: Fate


def _blank(of: System, n_steps: int, n_records: int) -> Record:
    """Record of a train at rest."""
    train, n_samples = of.config.train, of.n_samples
    kinds = (train.suspension_magnet, train.guidance_magnet)
    first = np.flatnonzero(np.diff(of.poles.magnet, prepend=-1))
    gap, current = (
        np.array([getattr(kind, name) for kind in kinds])[:, None]
        for name in ("gap_reference", "current_reference")
    )

    def filled(n: int, value: npt.ArrayLike) -> FloatArray:
        value = np.asarray(value)
        return np.zeros((n, value.shape[0], n_samples)) + value

    nothing = np.zeros((train.n_cars, 1))
    return Record(
        time=(np.arange(n_steps, dtype=float) + 1) * of.step,
        girder=filled(n_steps, np.zeros((4, 1))),
        body_z=filled(n_steps, nothing),
        body_y=filled(n_steps, nothing),
        body_pitch=filled(n_steps, nothing),
        body_yaw=filled(n_steps, nothing),
        opening=filled(n_steps, np.zeros((4, 1))),
        gap_min=filled(n_steps, gap),
        gap_max=filled(n_steps, gap),
        current_max=filled(n_steps, current),
        gap=filled(n_records, of.poles.gap[first]),
        current=filled(n_records, of.poles.current[first]),
        power=filled(n_steps, np.zeros((3, 1))),
        stored=np.zeros((n_steps, n_samples)),
        fate=Fate.open(n_samples),
    )


@dataclass(frozen=True)
class Watch:
    """Rows and degrees of freedom of the responses.

    Attributes
    ----------
    midspan : csr (2, guideway dof)
        Displacement of midspan of the middle span, down and right [-].
    bearings : csr (4, guideway dof)
        Opening of the middle span's bearings [-, m].
    body : (car, 5)
        Degrees of freedom of the car bodies: y, z, roll, pitch, yaw.
    per_magnet : csr (magnet, pole)
        Mean of the poles of each magnet [-].
    """

    midspan: sp.csr_array
    bearings: sp.csr_array
    body: IntArray
    per_magnet: sp.csr_array


def watch(config: Config, model: guideway_model.GuidewayModel, poles: Poles) -> Watch:
    """Find the rows and degrees of freedom of the responses."""
    middle = (config.guideway.n_spans // 2 + 0.5) * config.guideway.span_length
    share = 1 / np.bincount(poles.magnet)[poles.magnet]
    return Watch(
        midspan=sp.csr_array(sp.vstack(model.girder_rows(np.array([middle])))),
        bearings=model.bearing_rows(config.guideway.n_spans // 2),
        body=train_model.build(config.train).car_body_dof,
        per_magnet=sp.csr_array((share, (poles.magnet, np.arange(poles.magnet.size)))),
    )


def _note(record: Record, step: int, every: int, of: System, at: Watch, state: State) -> None:
    """Record the responses of a step."""
    record.girder[step, :2] = at.midspan @ state.guideway.x
    record.girder[step, 2:] = at.midspan @ state.guideway.a
    of_bodies = (record.body_y, record.body_z, None, record.body_pitch, record.body_yaw)
    for column, history in enumerate(of_bodies):
        if history is not None:
            history[step] = state.train.a[at.body[:, column]]
    record.opening[step] = at.bearings @ state.guideway.x
    gap, current = state.magnets.gap, state.magnets.current
    for kind in range(2):
        of_kind = of.poles.is_guidance == bool(kind)
        record.gap_min[step, kind] = gap[of_kind].min(axis=0)
        record.gap_max[step, kind] = gap[of_kind].max(axis=0)
        record.current_max[step, kind] = current[of_kind].max(axis=0)
    if every and (step + 1) % every == 0:
        row = (step + 1) // every - 1
        record.gap[row], record.current[row] = at.per_magnet @ gap, at.per_magnet @ current


def _power(of: System, state: State) -> FloatArray:
    """Power of the magnets on train and guideway, and dissipated power [W], (3, sample)."""
    v_t, v_g = state.train.v, state.guideway.v
    dissipated = of.train.dissipated(v_t) + of.guideway.dissipated(v_g)
    on_train, on_guideway = (
        (state.on_train * v_t).sum(axis=0),
        (state.on_guideway * v_g).sum(axis=0),
    )
    return np.stack([on_train, on_guideway, dissipated])


def _stored(of: System, state: State) -> FloatArray:
    """Kinetic and strain energy [J], (sample,)."""
    total = np.zeros(of.n_samples)
    for part, motion in ((of.train, state.train), (of.guideway, state.guideway)):
        total += 0.5 * (motion.v * (part.mass @ motion.v)).sum(axis=0)
        total += 0.5 * (motion.x * (part.stiffness @ motion.x)).sum(axis=0)
    return total


def _judge(fate: Fate, of: System, state: State, time: float) -> None:
    """Set the end of samples that lose levitation; they rest from then on."""
    gap, passage = state.magnets.gap, of.config.passage
    lost = (fate.status == 0) & ~held(of, state.magnets)
    for sample in np.flatnonzero(lost):
        here = gap[:, sample]
        outside = ~((here > passage.gap_contact) & (here < passage.gap_lost))
        pole = int(np.flatnonzero(outside)[0]) if outside.any() else 0
        fate.lost_time[sample], fate.lost_magnet[sample] = time, of.poles.magnet[pole]
        finite = bool(np.isfinite(here).all() and outside.any())
        fate.status[sample] = (1 if here[pole] <= passage.gap_contact else 2) if finite else 3
    if lost.any():
        _rest(state, of, lost)


def _rest(state: State, of: System, which: BoolArray) -> None:
    """Put samples back to rest."""
    still = at_rest(of)
    pairs = [
        (getattr(getattr(state, part), name), getattr(getattr(still, part), name))
        for part, names in (
            ("train", ("x", "v", "a")),
            ("guideway", ("x", "v", "a")),
            ("charge", ("error", "integral", "command", "current")),
            ("magnets", ("gap", "current", "force")),
        )
        for name in names
    ]
    pairs += list(zip(state.before, still.before, strict=True))
    pairs += [(signal, np.zeros_like(signal)) for signal in state.charge.signals]
    for array, rest in pairs:
        array[:, which] = rest[:, which]


def passed(
    config: Config,
    profile: Profile,
    gains: FloatArray,
    step: float,
    n_steps: int,
    *,
    record_every: int = 0,
    energy: bool = False,
    progress: bool = False,
) -> Record:
    """Run one passage per row of gains, all at the same time, with one step length.

    Parameters
    ----------
    config, profile
        Parameters of everything, and the track.
    gains : (sample, 8)
        From `checked_gains`.
    step
        Δt [s].
    n_steps
        Steps from the start of `maglev.mechanics.course` to the end [-].
    record_every
        Steps between recorded gaps and currents of magnets; zero records none.
    energy
        Keep the account of the energy.
    progress
        Show a progress bar.
    """
    model = guideway_model.build(config.guideway)
    of = system(config, model, profile, gains, step)
    at = watch(config, model, of.poles)
    record = _blank(of, n_steps, n_steps // record_every if record_every else 0)
    state, fate = at_rest(of), record.fate
    way = course(config)
    resting = first_moving_step(config.control, way.first_step) - 1
    first = int(resting * way.time_step / step)  # until then nothing moves
    bar = tqdm(total=n_steps - first, disable=not progress, desc="reference", unit="step")
    for number, view in enumerate(views(of, first, n_steps), start=first):
        state = stepped(of, state, view, fate.status == 0)
        _judge(fate, of, state, view.time)
        if fate.status.all():
            break
        _note(record, number, record_every, of, at, state)
        if energy:
            record.power[number], record.stored[number] = _power(of, state), _stored(of, state)
        bar.update()
    bar.close()
    band = acceleration_filter(config.passage, step)
    record.girder[:, 2:] = sosfilt(band, record.girder[:, 2:], axis=0)
    return record


def energy_of(record: Record) -> Energy:
    """Energy account of a record."""
    step = record.time[0]
    before = np.concatenate([np.zeros_like(record.power[:1]), record.power[:-1]])
    work = np.cumsum(0.5 * step * (before + record.power), axis=0)
    on_train, on_guideway, dissipated = np.moveaxis(work, 1, 0)
    return Energy(record.time, on_train, on_guideway, dissipated, record.stored)


@threadpool_limits.wrap(limits=1, user_api="blas")
def integrate(
    config: Config,
    profile: Profile,
    gains: npt.ArrayLike,
    *,
    record_every: int = 0,
    progress: bool = False,
) -> tuple[Passages, Energy]:
    """Run one passage per row of gains with the step of the configuration, its error unknown.

    Parameters
    ----------
    config
        Parameters of everything; the step is that of `maglev.mechanics.course`.
    profile
        Track irregularity.
    gains : (sample, 4) or (sample, 8)
        As `maglev.mechanics.responses.checked_gains` takes them.
    record_every
        Steps between recorded rows of the histories; zero records none.
    progress
        Show a progress bar.

    Returns
    -------
    passages
        Extremes, outcomes and histories.
    energy
        Account of the energy.

    Raises
    ------
    UserError
        If the gains have the wrong shape or are not finite, or if a step does not converge.

    References
    ----------
    Newmark, J. Eng. Mech. Div. ASCE 85(EM3):67-94 (1959).
    """
    gains = checked_gains(gains, config.gains.further)
    record = passed(
        config,
        profile,
        gains,
        course(config).time_step,
        course(config).n_steps,
        record_every=record_every,
        energy=True,
        progress=progress,
    )
    return passages_of(record, config, record_every), energy_of(record)


@dataclass(frozen=True)
class Effort:
    """Step, estimated error and computing time of a passage.

    Attributes
    ----------
    step, n_steps
        The shortest step [s], and how many of them a passage has.
    error : (sample, response)
        Estimated error of the extremes, as a share of them [-]; NaN for lost samples.
    seconds
        Time on the clock [s].
    """

    step: float
    n_steps: int
    error: FloatArray
    seconds: float

    @property
    def attributes(self) -> dict[str, float | int]:
        """Attributes of a dataset: step, number of steps, largest estimated error, seconds."""
        return {
            "time_step": self.step,
            "n_steps": self.n_steps,
            "estimated_error": float(_worst(self.error).max()),
            "seconds": self.seconds,
        }


@threadpool_limits.wrap(limits=1, user_api="blas")
def solve(
    config: Config,
    profile: Profile,
    gains: npt.ArrayLike,
    *,
    tolerance: float = ERROR,
    record_interval: float | None = None,
    progress: bool = False,
) -> tuple[Passages, Effort]:
    """Run one passage per row of gains; halve the step until the extremes converge.

    Newmark's rule is of second order.  Of two solutions, with steps Δt and Δt/2, a third of the
    difference is the error of the finer one and is subtracted.  The error left is estimated as half
    of that third; with a third solution, as the change that it brings, or an eighth of the third if
    that is more.  Poles that are points always take three solutions: they strike the rails at
    joints, and the error falls with no fixed power of the step.

    Parameters
    ----------
    config
        Parameters of everything; ``passage.time_step`` only decides where the passage starts.
    profile
        Track irregularity.
    gains : (sample, 4) or (sample, 8)
        As `maglev.mechanics.responses.checked_gains` takes them.
    tolerance
        Largest estimated error of an extreme, as a share of it [-].
    record_interval
        Time between recorded rows of the histories, at most [s]; none if not given.
    progress
        Show progress bars.

    Returns
    -------
    passages
        Extremes, outcomes and histories.
    effort
        Last step, estimated errors and computing time.

    Raises
    ------
    UserError
        If the gains have the wrong shape or are not finite, a step does not converge, or the error
        exceeds the tolerance even with the shortest step.

    References
    ----------
    Richardson, Phil. Trans. R. Soc. A 210:307-357 (1911).
    """
    began, gains = perf_counter(), checked_gains(gains, config.gains.further)
    period = config.train.suspension_magnet.pole_pitch / config.passage.speed
    longest = {"time_step": min(FIRST_STEP, period / FEWEST_IN_A_PERIOD)}
    own = config.model_copy(update={"passage": config.passage.model_copy(update=longest)})
    step = course(own).time_step
    n_steps = math.ceil(course(config).duration / step)
    every = max(1, int(record_interval / step * (1 + 1e-9))) if record_interval else 0
    coarse = passed(config, profile, gains, step, n_steps, record_every=every, progress=progress)
    kinds = (config.train.suspension_magnet, config.train.guidance_magnet)
    before, have_faces = None, all(kind.pole_length > 0 for kind in kinds)
    for halving in range(1, MOST_HALVINGS + 1):
        n, h, rows = n_steps * 2**halving, step / 2**halving, every * 2**halving
        fine = passed(config, profile, gains, h, n, record_every=rows, progress=progress)
        better = extrapolated(coarse, fine)
        error = _estimated_error(six_extremes(better), six_extremes(fine), before)
        effort = Effort(h, n, error, perf_counter() - began)
        _LOG.info("reference: %s", _told(effort))
        if not (error > tolerance).any() and (before is not None or have_faces):
            return passages_of(better, config, rows), effort
        coarse, before = fine, six_extremes(better)
    raise UserError(
        f"reference: expected errors of at most {100 * tolerance:g} %, got {_told(effort)}; "
        "raw accelerations may have no limit: give passage.acceleration_band"
    )


def extrapolated(coarse: Record, fine: Record) -> Record:
    """Richardson extrapolation of the responses from two records, one with twice the step."""

    def better(name: str) -> FloatArray:
        one, other = getattr(coarse, name), getattr(fine, name)
        correction = (other[1::2] - one) / 3
        return other + CubicSpline(coarse.time, correction)(fine.time)

    status = np.where(coarse.fate.status != 0, coarse.fate.status, fine.fate.status)
    fate = replace(fine.fate, status=status) if (status != fine.fate.status).any() else fine.fate
    changed = {name: better(name) for name in _EXTRAPOLATED}
    return replace(fine, fate=fate, **changed)


def six_extremes(record: Record) -> FloatArray:
    """Extremes (sample, response): girder as in `GIRDER_RESPONSES`, then largest of the cars."""
    status = record.fate.status
    girder, z, y = (
        extremes(history, record.time, status)[0]
        for history in (record.girder, record.body_z, record.body_y)
    )
    return np.column_stack([girder, z.max(axis=1), y.max(axis=1)])


def _estimated_error(better: FloatArray, fine: FloatArray, before: FloatArray | None) -> FloatArray:
    """Error of extrapolated extremes (sample, response), as a share of them.

    Parameters
    ----------
    better, fine
        With and without extrapolation.
    before
        Extrapolated from steps twice as long, where there is such a solution.
    """
    error = CAUTION * np.abs(better - fine)
    if before is not None:
        error = np.maximum(error / 4, np.abs(better - before))
    companion = better[:, [0, 0, 2, 2, 4, 4]]  # on smooth track nothing moves sideways
    return error / np.maximum(better, NEGLIGIBLE * companion)


def _told(effort: Effort) -> str:
    """Steps and error of an effort in words."""
    shares = ", ".join(
        f"{name} {100 * worst:.2g} %"
        for name, worst in zip(RESPONSES, _worst(effort.error), strict=True)
    )
    return (
        f"estimated errors with a step of {1e3 * effort.step:.4g} ms: {shares} "
        f"({effort.seconds:.0f} s)"
    )


def _worst(error: FloatArray) -> FloatArray:
    """Largest error of each response over the samples that were not lost; 0 if all were."""
    return np.where(np.isnan(error), 0.0, error).max(axis=0)


def _at_ends(middle: FloatArray, turn: FloatArray, arm: float) -> FloatArray:
    """Accelerations (step, end, car, sample) at both ends of the cars' floors."""
    return np.stack([middle + arm * turn, middle - arm * turn], axis=1)


def passages_of(record: Record, config: Config, every: int) -> Passages:
    """Extremes, outcomes and thinned histories of a record."""
    status = record.fate.status
    arm = config.train.end_distance
    ends = (
        _at_ends(record.body_z, record.body_pitch, -arm),
        _at_ends(record.body_y, record.body_yaw, arm),
    )
    (end_z, end_z_time), (end_y, end_y_time) = (
        _largest(*extremes(history, record.time, status), axis=2) for history in ends
    )
    one_way, other_way = (
        _one_sided(sign * record.girder, record.time, status)[0] for sign in (1.0, -1.0)
    )
    lift, lift_time = _largest(*_one_sided(record.opening, record.time, status), axis=1)
    weighted = weighted_rms(config, record.time, ends)
    weighted[status != 0] = np.nan
    models = guideway_model.build(config.guideway), train_model.build(config.train)
    girder, girder_time = extremes(record.girder, record.time, status)
    body_z, body_z_time = extremes(record.body_z, record.time, status)
    body_y, body_y_time = extremes(record.body_y, record.time, status)
    kept = slice(every - 1, None, every) if every else slice(0, 0)

    def samples_first(history: FloatArray) -> FloatArray:
        return np.moveaxis(history, (0, 1, 2), (2, 1, 0))

    return Passages(
        girder=girder,
        girder_time=girder_time,
        girder_positive=one_way,
        girder_negative=other_way,
        end_z=end_z,
        end_y=end_y,
        end_z_time=end_z_time,
        end_y_time=end_y_time,
        weighted=weighted,
        lift=lift,
        lift_time=lift_time,
        **compared_with(config, largest_deflection(*models), status.size),
        body_z=body_z,
        body_y=body_y,
        body_z_time=body_z_time,
        body_y_time=body_y_time,
        gap_min=record.gap_min.min(axis=0).T,
        gap_max=record.gap_max.max(axis=0).T,
        current_max=record.current_max.max(axis=0).T,
        status=status,
        lost_time=record.fate.lost_time,
        lost_magnet=record.fate.lost_magnet,
        time=record.time[kept],
        girder_history=samples_first(record.girder[kept]),
        body_z_history=samples_first(record.body_z[kept]),
        body_y_history=samples_first(record.body_y[kept]),
        gap_history=samples_first(record.gap),
        current_history=samples_first(record.current),
    )


def _one_sided(
    history: FloatArray, time: FloatArray, status: IntArray
) -> tuple[FloatArray, FloatArray]:
    """As `extremes`, of values above zero alone; the last value may be the largest."""
    above = np.maximum(history, 0.0)
    value, when = extremes(above, time, status)
    last = above[-1].T >= above.max(axis=0).T
    ends = last & (status == 0).reshape(-1, *[1] * (value.ndim - 1)) & (above[-1].T > 0)
    return np.where(ends, above[-1].T, value), np.where(ends, time[-1], when)


def _largest(value: FloatArray, when: FloatArray, axis: int) -> tuple[FloatArray, FloatArray]:
    """Largest of the values along an axis, and when it was; NaN for lost samples."""
    at = np.expand_dims(np.where(np.isnan(value), -1.0, value).argmax(axis), axis)
    largest, its_time = (np.take_along_axis(one, at, axis).squeeze(axis) for one in (value, when))
    return largest, its_time


def extremes(
    history: FloatArray, time: FloatArray, status: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Largest absolute values, as vertices of parabolas through three steps.

    Parameters
    ----------
    history : (step, ..., sample)
        Histories of responses.
    time : (step,)
        Of the steps [s].
    status : (sample,)
        Not zero where levitation was lost.

    Returns
    -------
    value, when : (sample, ...)
        Largest absolute value, and its time [s]; NaN for lost samples.
    """
    size = np.abs(history)
    at = np.clip(size.argmax(axis=0), 1, time.size - 2)[None]
    left, middle, right = (
        np.take_along_axis(history, at + shift, axis=0)[0] for shift in (-1, 0, 1)
    )
    bend, slope = left - 2 * middle + right, 0.5 * (right - left)
    peak = bend != 0
    shift = np.clip(np.where(peak, -slope / np.where(peak, bend, 1.0), 0.0), -1.0, 1.0)
    value = np.abs(middle + shift * (slope + 0.5 * shift * bend)).T.copy()
    when = (time[at[0]] + shift * (time[1] - time[0])).T.copy()
    value[status != 0], when[status != 0] = np.nan, np.nan
    return value, when
