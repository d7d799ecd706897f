"""Active coordinates of the guideway: the spans near the train are stepped, the others rest.

Spans under the train and their neighbours are awake: all of their coordinates are stepped, as are
those of the middle span, which is watched.  Other spans are quiet.  Piers carry motion along the
guideway, so quiet spans do not rest: their pier tops and low modes are stepped; their other modes
follow the pier tops without a motion of their own.  Damping between a mode that a quiet span
keeps and one that its neighbour alone steps acts on the latter only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.mechanics.course import course
from maglev.mechanics.reduction import ReducedGuideway
from maglev.parameters import Config

QUIET_CUTOFF = 100.0
"""Highest mode of quiet spans and their piers that is stepped [Hz]; assumed, checked in
docs/convergence.md."""

AWAKE_BESIDE = 3
"""Spans ahead of the train, and behind it, that are awake [-]; assumed, checked likewise."""


@dataclass(frozen=True)
class Stretch:
    """Consecutive steps with the same active coordinates.

    Attributes
    ----------
    first_step
        Number of the first step.
    awake : (coordinate,)
        Whether a coordinate belongs to spans that are awake, or to their piers.
    stepped : (coordinate,)
        Whether it is stepped.
    """

    first_step: int
    awake: BoolArray
    stepped: BoolArray


def stretches(config: Config, reduced: ReducedGuideway) -> list[Stretch]:
    """Divide a passage into stretches, from the step on which the nose reaches the guideway.

    Parameters
    ----------
    config
        Parameters of everything.
    reduced
        Guideway in component coordinates.

    Returns
    -------
    stretches
        In order; neighbours differ in the coordinates that are awake or stepped.
    """
    length, n_spans = config.guideway.span_length, config.guideway.n_spans
    way = course(config)
    step = np.arange(1, way.n_steps + 1)
    at = way.nose(step * way.time_step)
    step, at = step[at >= 0], at[at >= 0]
    ahead = np.minimum(np.floor(at / length).astype(int) + AWAKE_BESIDE, n_spans - 1)
    behind = np.floor((at - config.train.length) / length).astype(int) - AWAKE_BESIDE
    behind = np.clip(behind, 0, n_spans - 1)
    changes = np.flatnonzero(np.diff(ahead, prepend=-1) | np.diff(behind, prepend=-1))
    of_span, of_pier = _neighbourhood(reduced)
    quiet = _kept_quiet(reduced)
    found = []
    for k in changes:
        spans = np.zeros(n_spans, dtype=bool)
        spans[behind[k] : ahead[k] + 1] = True
        spans[n_spans // 2] = True
        piers = np.concatenate([spans, [False]]) | np.concatenate([[False], spans])
        awake = np.where(of_span >= 0, spans[of_span], piers[of_pier])
        found.append(Stretch(int(step[k]), awake, awake | quiet))
    return found


def _neighbourhood(reduced: ReducedGuideway) -> tuple[IntArray, IntArray]:
    """Span number of each coordinate (-1 for piers), and pier number (piers only)."""
    n, n_modes = reduced.n_coordinates, reduced.n_modes
    n_piers = reduced.parameters.n_spans + 1
    of_span, of_pier = np.full(n, -1), np.zeros(n, dtype=np.int64)
    for span in range(reduced.parameters.n_spans):
        of_span[reduced.own_modes(span)] = span
    in_piers = np.flatnonzero(of_span[:n_modes] < 0)
    of_pier[in_piers] = np.repeat(np.arange(n_piers), in_piers.size // n_piers)
    of_pier[n_modes:] = np.repeat(np.arange(n_piers), (n - n_modes) // n_piers)
    return of_span, of_pier


def _kept_quiet(reduced: ReducedGuideway) -> BoolArray:
    """Coordinates that stay active in quiet spans: low modes and pier tops."""
    kept = np.ones(reduced.n_coordinates, dtype=bool)
    square = reduced.stiffness.diagonal()[: reduced.n_modes]
    kept[: reduced.n_modes] = square < (2 * np.pi * QUIET_CUTOFF) ** 2
    return kept


def top_stiffness(reduced: ReducedGuideway) -> sp.csr_array:
    """Stiffness between pier tops (top, top) when no mode moves relative to them."""
    n = reduced.n_modes
    square = sp.diags_array(reduced.stiffness.diagonal()[:n])
    dense = (reduced.stiffness[n:, n:] - reduced.carried.T @ square @ reduced.carried).toarray()
    return _without_noise(dense)


def top_mass(reduced: ReducedGuideway, time_step: float) -> sp.csr_array:
    """Mass of the pier tops (top, top) in a step of Δt [s] when all modes are stepped."""
    return _without_noise(reduced.top_mass) + time_step**2 / 12 * top_stiffness(reduced)


def _without_noise(matrix: FloatArray) -> sp.csr_array:
    scale = np.sqrt(np.diagonal(matrix))
    return sp.csr_array(np.where(np.abs(matrix) > 1e-10 * np.outer(scale, scale), matrix, 0.0))


def stepped_mass(
    reduced: ReducedGuideway, stepped: BoolArray, time_step: float
) -> tuple[IntArray, FloatArray]:
    """Active pier tops, and the lower Cholesky factor of their mass in a step.

    Modes that are not stepped add their mass to the tops that they follow.  A share Δt²/12 of the
    stiffness is added to the mass, so that the periods of the tops are right to fourth order.

    Parameters
    ----------
    reduced
        Guideway in component coordinates.
    stepped : (coordinate,)
        Whether a coordinate is stepped.
    time_step
        Δt [s].

    Returns
    -------
    tops : (stepped top,)
        Coordinates; coupled ones are adjacent.
    factor : (stepped top, stepped top)
        Lower triangular.

    References
    ----------
    docs/theory/integration.md, eq. 4.
    """
    n = reduced.n_modes
    follows = reduced.carried[np.flatnonzero(~stepped[:n])]
    mass = top_mass(reduced, time_step) + (follows.T @ follows).tocsr()
    tops = np.flatnonzero(stepped[n:])
    _, label = connected_components(mass[tops][:, tops], directed=False)
    tops = tops[np.argsort(label, kind="stable")]
    return n + tops, np.linalg.cholesky(mass[tops][:, tops].toarray())
