"""Control circuits of a magnet: the gaps that feed them and the poles that they drive.

A circuit gives the current of one pole, of half a magnet or of a whole one.  Its signal is a mean
of gaps; `Grouping` holds the weights, for the poles of one magnet from the front.  The law itself,
docs/theory/control.md, eq. 1, stands in each solver and in `maglev.mechanics.linear` once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.errors import UserError
from maglev.parameters import Circuit, Control


@dataclass(frozen=True)
class Grouping:
    """Circuits of one magnet.

    Attributes
    ----------
    feed : (circuit, pole)
        Weight of each pole's gap in the signal of a circuit [-]; rows sum to one.
    drive : (pole, circuit)
        Weight of each circuit's current in the current of a pole [-]; rows sum to one.
    mean_gap_force
        Whether a pole's force follows from the mean gap of the magnet instead of its own.
    """

    feed: FloatArray
    drive: FloatArray
    mean_gap_force: bool


def grouping(group: str, n_poles: int) -> Grouping:
    """Circuits of a magnet with ``n_poles`` poles.

    The middle pole of an odd number belongs to both halves: it counts half in either mean, and its
    current is the mean of the two.  The sensor at a magnet's end reads the outermost pole's gap.

    Parameters
    ----------
    group
        ``"pole"``, ``"ends"``, ``"half"`` or ``"lumped"``, see `maglev.parameters.Circuit`.
    n_poles
        Poles of the magnet.

    Returns
    -------
    grouping
        Weights of gaps and currents.

    Raises
    ------
    UserError
        If the group is unknown.

    Examples
    --------
    >>> grouping("half", 3).drive
    array([[1. , 0. ],
           [0.5, 0.5],
           [0. , 1. ]])
    """
    if group == "pole":
        return Grouping(np.eye(n_poles), np.eye(n_poles), mean_gap_force=False)
    if group == "lumped":
        mean = np.full((1, n_poles), 1.0 / n_poles)
        return Grouping(mean, np.ones((n_poles, 1)), mean_gap_force=True)
    if group not in ("ends", "half"):
        raise UserError(f"group must be 'pole', 'ends', 'half' or 'lumped', got {group!r}")
    place = np.arange(n_poles) - 0.5 * (n_poles - 1)
    front = np.where(place < 0, 1.0, np.where(place > 0, 0.0, 0.5))
    drive = np.column_stack([front, 1.0 - front])
    feed = drive.T / drive.sum(axis=0)[:, None]
    if group == "ends":
        feed = np.eye(n_poles)[[0, n_poles - 1]]
    return Grouping(feed, drive, mean_gap_force=False)


@dataclass(frozen=True)
class LateCurrent:
    """Delay and lag of a current behind its signal, in steps.

    ``command = Σ delayed[j] signal[n - behind - j]`` and
    ``current[n] = decay current[n - 1] + now command[n] + before command[n - 1]``.

    Attributes
    ----------
    behind
        Steps back to the latest of the three signals that a delayed one is interpolated from.
    delayed : (3,)
        Weights of the three, by a parabola through them [-].
    decay, now, before
        Weights of the lag, exact for a command that is linear within a step [-].
    """

    behind: int
    delayed: FloatArray
    decay: float
    now: float
    before: float

    @property
    def undelayed(self) -> float:
        """Weight of the signal of this step in the command of this step [-]."""
        return float(self.delayed[0]) if self.behind == 0 else 0.0

    @property
    def direct(self) -> float:
        """Weight of the signal of this step in the current of this step [-]."""
        return self.now * self.undelayed


def late_current(lag: float, delay: float, time_step: float) -> LateCurrent:
    """Weights of stored signals and currents for a given delay and lag.

    Parameters
    ----------
    lag, delay
        Time constant of the current and delay of the signal [s].
    time_step
        Δt [s].

    Returns
    -------
    late
        Weights of signals, commands and currents.

    References
    ----------
    docs/theory/control.md, eqs. 2 and 3.

    Examples
    --------
    >>> late_current(lag=0.0, delay=0.0, time_step=1e-3).direct
    1.0
    """
    whole = math.floor(delay / time_step * (1 + 1e-12))
    behind = max(0, whole - 1)
    t = delay / time_step - behind  # steps before the latest of the three
    delayed = np.array([(t - 1) * (t - 2) / 2, t * (2 - t), t * (t - 1) / 2])
    if lag == 0:
        return LateCurrent(behind, delayed, 0.0, 1.0, 0.0)
    part = time_step / lag
    decay, mean = math.exp(-part), -math.expm1(-part) / part
    return LateCurrent(behind, delayed, decay, 1.0 - mean, mean - decay)


def circuits(circuit: Circuit, n_poles: int) -> Grouping:
    """Circuits of a magnet by the configuration, see `grouping`.

    Examples
    --------
    >>> circuits(Circuit(group="lumped"), 4).feed
    array([[0.25, 0.25, 0.25, 0.25]])
    """
    return grouping(circuit.group, n_poles)


def failing_magnets(x: FloatArray, side: IntArray) -> IntArray:
    """Magnets of one kind in the order in which they are taken to fail.

    The first is the right one in the middle of the train.  Sides take turns, and each place is that
    of van der Corput's sequence, which halves the stretches between those before; then come the
    magnets that face these.

    Parameters
    ----------
    x : (magnet,)
        Centres along the train [m].
    side : (magnet,)
        +1 right, -1 left, as many of each.

    Returns
    -------
    order : (magnet,)
        Numbers of the magnets.

    Examples
    --------
    >>> x = np.tile([-1.0, -2.0, -3.0], 2)
    >>> failing_magnets(x, np.repeat([1, -1], 3)).tolist()
    [1, 3, 2, 4, 0, 5]
    """
    right, left = (
        numbers[np.argsort(-x[numbers], kind="stable")]
        for numbers in (np.flatnonzero(side > 0), np.flatnonzero(side < 0))
    )
    place = _halving(right.size)
    turn = np.arange(right.size) % 2 == 0
    first = np.where(turn, right[place], left[place])
    return np.concatenate([first, np.where(turn, left[place], right[place])])


def _halving(n: int) -> IntArray:
    """Places 0 … n - 1 in the order of van der Corput's sequence, from the middle."""
    found: dict[int, None] = {}
    number = 1
    while len(found) < n:
        share = sum((number >> bit & 1) / 2 ** (bit + 1) for bit in range(number.bit_length()))
        found[int(share * n)] = None
        number += 1
    return np.array(list(found), dtype=np.int64)


def first_moving_step(control: Control, first_step: int) -> int:
    """Number of the first step on which anything moves: with failed magnets, the first of all.

    Examples
    --------
    >>> first_moving_step(Control(), 700)
    700
    """
    fails = control.suspension.failed_magnets or control.guidance.failed_magnets
    return 1 if fails else first_step


def refuse_too_many(n_failed: npt.ArrayLike, n_magnets: int, *, guidance: bool) -> None:
    """Refuse more failed magnets than the train has of the kind.

    Raises
    ------
    UserError
        If a number of failed magnets exceeds ``n_magnets``.

    Examples
    --------
    >>> refuse_too_many(2, 80, guidance=False)  # nothing to refuse
    """
    most = int(np.max(n_failed))
    if most > n_magnets:
        raise UserError(
            f"control.{'guidance' if guidance else 'suspension'}.failed_magnets must be at most "
            f"{n_magnets}, the train's magnets of the kind, got {most}"
        )


def without_current(
    circuit: Circuit, x: FloatArray, side: IntArray, *, guidance: bool
) -> BoolArray:
    """Which magnets of a kind (magnet,) carry no current.

    Parameters
    ----------
    circuit
        Says how many.
    x, side : (magnet,)
        As `failing_magnets` takes them.
    guidance
        The kind, for the message.

    Raises
    ------
    UserError
        If more fail than there are.

    Examples
    --------
    >>> x, side = np.tile([-1.0, -2.0, -3.0], 2), np.repeat([1, -1], 3)
    >>> without_current(Circuit(failed_magnets=1), x, side, guidance=False).tolist()
    [False, True, False, False, False, False]
    """
    refuse_too_many(circuit.failed_magnets, x.size, guidance=guidance)
    failed = np.zeros(x.size, dtype=bool)
    failed[failing_magnets(x, side)[: circuit.failed_magnets]] = True
    return failed
