"""The guideway that each sample of a row has of its own, as rows for the kernels.

Which coordinates there are and which of them meet is that of the mean; a sample has its own numbers
there.  Theory: docs/theory/random_systems.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import scipy.linalg
from threadpoolctl import threadpool_limits

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.mechanics import packing
from maglev.mechanics._records import Spans
from maglev.mechanics.activity import Stretch, stepped_mass, stretches
from maglev.mechanics.course import course
from maglev.mechanics.guideway import GuidewayModel, build
from maglev.mechanics.guideways import FAMILIES, Basis, Piece, make_basis
from maglev.mechanics.own import aligned
from maglev.mechanics.reduction import ReducedGuideway, reduce
from maglev.mechanics.step_limit import (
    DAMPING_MARGIN,
    GUIDEWAY_MARGIN,
    fastest_square,
    largest_phase,
)
from maglev.parameters import Config, Guideway

SPAN_TOPS = tuple(np.concatenate([family, 6 + family]) for family in FAMILIES)
"""Motions of the two pier tops of a span, even and odd, among twelve."""

Pieces = tuple[Piece, Piece]


@dataclass(frozen=True)
class Kind:
    """Own modes of one kind of component: family of each, and its place in the family (mode,)."""

    family: IntArray
    place: IntArray

    def square(self, pieces: Pieces) -> FloatArray:
        """Squared circular frequencies (mode,)."""
        return np.where(
            self.family == 0,
            pieces[0].square[np.where(self.family == 0, self.place, 0)],
            pieces[1].square[np.where(self.family == 1, self.place, 0)],
        )

    def share(self, pieces: Pieces, tops: Sequence[IntArray]) -> FloatArray:
        """Shares (mode, top) of the motion of tops; those of each family are given."""
        found = np.zeros((self.family.size, sum(one.size for one in tops)))
        for family, (one, columns) in enumerate(zip(pieces, tops, strict=True)):
            mine = np.flatnonzero(self.family == family)
            found[np.ix_(mine, columns)] = one.share[self.place[mine]]
        return found


@dataclass(frozen=True)
class Frame:
    """What guideways have in common that differ in some numbers.

    Attributes
    ----------
    config, reduced, spans
        Of the mean.
    basis
        Shapes of the components.
    kinds : (other spans, middle span, piers)
        Their own modes.
    of_passage
        Stretches of the passage.
    factors : stretch of (tops, row, column)
        Pier tops in the order of their factor, and its entries below the diagonal.
    upright, sideways : kind of span of (coordinate,)
        Columns among the modes of the family and the motions with the pier tops, side by side.
    record
        `Spans` without what each sample has of its own.
    mean
        Numbers of the mean.
    fastest
        Largest squared circular frequency of the mean [1/s²].
    softness
        Of the mean's midspan [m/N].
    """

    config: Config
    reduced: ReducedGuideway
    spans: Spans
    basis: Basis
    kinds: tuple[Kind, Kind, Kind]
    of_passage: tuple[Stretch, ...]
    factors: tuple[tuple[IntArray, IntArray, IntArray], ...]
    upright: tuple[IntArray, IntArray]
    sideways: tuple[IntArray, IntArray]
    record: Spans
    mean: Numbers | None
    fastest: float
    softness: float


@dataclass(frozen=True)
class Numbers:
    """A sample's own numbers for `Spans`, flat, and what the mean's are compared by.

    ``structure`` and ``bearing`` are the diagonals of damping by the structure and by the bearings,
    of modes and tops, the former up to a factor that all samples share.
    """

    change: FloatArray
    square: FloatArray
    response: FloatArray
    carried: FloatArray
    stiffness: FloatArray
    factor: FloatArray
    factor_inverse: FloatArray
    root: FloatArray
    midspan: FloatArray
    rest: FloatArray
    opening: FloatArray
    opening_rest: FloatArray
    softness: float  # deflection of midspan under a unit force there [m/N]
    structure: FloatArray
    bearing: FloatArray
    tops: float  # largest squared circular frequency of the tops alone [1/s²]
    slowed: float  # share of Δt² of their stiffness added to the mass of the tops [-]
    holds: bool  # whether the step does


MOST_SLOWED = 0.08
"""Largest share of Δt² times the stiffness that may be added to the mass of pier tops [-]; assumed:
it lowers a frequency of 60 Hz by 0.2 % at the default step."""


@lru_cache(maxsize=2)
@threadpool_limits.wrap(limits=1, user_api="blas")
def frame_of(config: Config, keys: tuple[str, ...]) -> Frame:
    """Find what guideways have in common that differ in the numbers at some keys.

    Parameters
    ----------
    config
        The mean.
    keys
        Dotted keys of the configuration.
    """
    model = build(config.guideway)
    reduced = reduce(model, config.passage.mode_cutoff, config.passage.mode_cutoff_elsewhere)
    spans = packing.spans(reduced, config)
    passage = config.passage
    cutoff = max(passage.mode_cutoff, passage.mode_cutoff_elsewhere)
    of_guideway = [key.removeprefix("guideway.") for key in keys]
    basis = make_basis(config.guideway, of_guideway, cutoff)
    middle = config.guideway.n_spans // 2
    other = 0 if middle else middle
    basis, kinds = _own_modes(basis, model, reduced, (other, middle))
    of_passage = tuple(stretches(config, reduced))
    dt = course(config).time_step
    factors = []
    for stretch in of_passage:
        tops, factor = stepped_mass(reduced, stretch.stepped, dt)
        row, column = np.nonzero(np.tril(factor, -1))
        factors.append((tops - reduced.n_modes, row, column))
    n_modes = [one.shape[1] for one in basis.span_like]
    frame = Frame(
        config=config,
        reduced=reduced,
        spans=spans,
        basis=basis,
        kinds=kinds,
        of_passage=of_passage,
        factors=tuple(factors),
        upright=_columns(
            reduced, spans.upright_start, spans.upright, kinds, 0, (other, middle), n_modes[0]
        ),
        sideways=_columns(
            reduced, spans.sideways_start, spans.sideways, kinds, 1, (other, middle), n_modes[1]
        ),
        record=spans,
        mean=None,
        fastest=fastest_square(reduced, dt),
        softness=1.0,
    )
    mean = numbers_of(frame, config.guideway)
    return replace(frame, mean=mean, softness=mean.softness, record=_record(frame, mean))


def _own_modes(
    basis: Basis, model: GuidewayModel, reduced: ReducedGuideway, spans: tuple[int, int]
) -> tuple[Basis, tuple[Kind, Kind, Kind]]:
    """Own modes of spans and piers among those of the basis, which takes over their signs."""
    pieces = basis.span_pieces(basis.guideway)
    kinds = []
    sign = [np.ones(one.square.size) for one in pieces]
    for span in spans:
        dof = model.span_dof[span]
        shapes = reduced.basis[dof][:, reduced.own_modes(span)].toarray()
        inertia = model.mass[dof][:, dof] @ shapes
        overlap = [(v @ one.shape).T @ inertia for v, one in zip(basis.shapes, pieces, strict=True)]
        kinds.append(_matched(overlap, sign))
    dof = model.pier_dof[0]
    n_piers = len(model.pier_dof)
    first = sum(reduced.own_modes(span).size for span in range(len(model.span_dof)))
    of_pier = np.arange(first, first + (reduced.n_modes - first) // n_piers)
    shapes = reduced.basis[dof][:, of_pier].toarray()
    inertia = (model.mass[dof][:, dof] @ shapes).reshape(-1, 6, of_pier.size)
    pier = basis.pier_pieces(basis.guideway)
    overlap = [
        one.shape.T @ inertia[:, family].reshape(-1, of_pier.size)
        for family, one in zip(FAMILIES, pier, strict=True)
    ]
    pier_sign = [np.ones(one.square.size) for one in pier]
    kinds.append(_matched(overlap, pier_sign))
    signed = replace(
        basis,
        span_like=(basis.span_like[0] * sign[0], basis.span_like[1] * sign[1]),
        pier_like=(basis.pier_like[0] * pier_sign[0], basis.pier_like[1] * pier_sign[1]),
    )
    return signed, (kinds[0], kinds[1], kinds[2])


def _matched(overlap: Sequence[FloatArray], sign: Sequence[FloatArray]) -> Kind:
    """Own modes by their overlap (mode of the family, own mode); notes which change their sign."""
    n = overlap[0].shape[0]
    both = np.concatenate(overlap)
    best = np.abs(both).argmax(axis=0)
    family = (best >= n).astype(np.int64)
    place = np.where(family == 1, best - n, best)
    turned = both[best, np.arange(best.size)] < 0
    for k in (0, 1):
        sign[k][place[turned & (family == k)]] = -1.0
    return Kind(family, place)


def _columns(
    reduced: ReducedGuideway,
    start: IntArray,
    coordinates: IntArray,
    kinds: tuple[Kind, Kind, Kind],
    family: int,
    spans: tuple[int, int],
    n: int,
) -> tuple[IntArray, IntArray]:
    """Columns of a span's coordinates that move its rails, for both kinds of span."""
    found = []
    for kind, span in enumerate(spans):
        own = reduced.own_modes(span)
        columns = []
        for coordinate in coordinates[start[span] : start[span + 1]]:
            if coordinate < reduced.n_modes:
                columns.append(kinds[kind].place[np.searchsorted(own, coordinate)])
                continue
            top = coordinate - reduced.n_modes - 6 * span
            columns.append(n + int(np.flatnonzero(SPAN_TOPS[family] == top)[0]))
        found.append(np.array(columns, dtype=np.int64))
    return found[0], found[1]


def numbers_of(frame: Frame, guideway: Guideway) -> Numbers:
    """Numbers of a guideway in the coordinates of the mean."""
    basis, kinds, config = frame.basis, frame.kinds, frame.config
    spans, piers = basis.span_pieces(guideway), basis.pier_pieces(guideway)
    dt = course(config).time_step
    squares = [kinds[0].square(spans), kinds[1].square(spans), kinds[2].square(piers)]
    shares = [
        kinds[0].share(spans, SPAN_TOPS),
        kinds[1].share(spans, SPAN_TOPS),
        kinds[2].share(piers, FAMILIES),
    ]
    square = np.concatenate(squares)
    stiffness, mass, carried = _tops(frame, spans, piers, shares)
    tops = _fastest(stiffness, mass + dt**2 / 12 * stiffness)
    slowed, holds = _slowed(frame, tops, float(square.max()), guideway.damping_ratio)
    factor, inverse = _factors(frame, mass + (1 / 12 + slowed) * dt**2 * stiffness, shares)
    sides = [np.hstack([one.shape, one.constraint]) for one in spans]
    phase = np.sqrt(square) * dt
    limit = (2 * np.pi * config.passage.mode_cutoff) ** 2
    structure = guideway.damping_ratio * np.concatenate(
        [
            np.sqrt(np.minimum(square, limit)),
            np.sqrt(np.maximum(stiffness.diagonal() * carried, 0.0)),
        ]
    )
    row, column = _pattern(frame)
    found = Numbers(
        change=np.concatenate(
            [
                sides[family][:, columns[kind]].ravel()
                for kind in _unlike_kinds(frame)
                for family, columns in enumerate((frame.upright, frame.sideways))
            ]
        ),
        square=square,
        response=np.sinc(phase / (2 * np.pi)) ** 2,
        carried=np.concatenate([one.ravel() for one in shares]),
        stiffness=stiffness[row, column],
        factor=factor,
        factor_inverse=inverse,
        root=np.ones(0),
        bearing=_by_bearings(frame, guideway, spans),
        midspan=_midspan(frame, sides),
        rest=_rest(frame, spans),
        opening=_opening(frame, sides),
        opening_rest=_opening_rest(frame, spans),
        softness=_softness(frame, spans, stiffness),
        structure=structure,
        tops=tops,
        slowed=slowed,
        holds=holds,
    )
    return replace(found, root=_roots(frame, found, phase))


def _unlike_kinds(frame: Frame) -> tuple[int, ...]:
    """Kinds of spans whose changes to the basis are listed: one, if they are the same."""
    alike = np.array_equal(*frame.upright) and np.array_equal(*frame.sideways)
    return (0,) if alike else (0, 1)


def _fastest(stiffness: FloatArray, mass: FloatArray) -> float:
    """Largest squared circular frequency of the pier tops [1/s²]."""
    n = stiffness.shape[0]
    return float(scipy.linalg.eigvalsh(stiffness, mass, subset_by_index=(n - 1, n - 1))[0])


def _slowed(
    frame: Frame, tops: float, fastest_mode: float, damping_ratio: float
) -> tuple[float, bool]:
    """What must be added to the mass of the pier tops for the step to hold, and whether it does.

    Piers that are stiffer or lighter than those of the mean have tops that are faster than the step
    allows, at hundreds of hertz.  A share of Δt² times their stiffness slows these and hardly
    touches what is slow.
    """
    dt = course(frame.config).time_step
    ratio = np.ceil(500 * damping_ratio) / 500  # rounded up: few are asked for
    phase = GUIDEWAY_MARGIN * largest_phase(float(ratio))
    square = frame.fastest * (tops / frame.mean.tops if frame.mean is not None else 1.0)
    slowed = max(0.0, 1 / phase**2 - 1 / (square * dt**2))
    of_modes = largest_phase(float(DAMPING_MARGIN * ratio), exact=True)
    return slowed, bool(slowed <= MOST_SLOWED and dt * np.sqrt(fastest_mode) < of_modes)


def _pattern(frame: Frame) -> tuple[IntArray, IntArray]:
    """Pier tops that meet in the stiffness of the mean, row by row."""
    start = frame.spans.stiffness_start
    row = np.repeat(np.arange(start.size - 1), np.diff(start))
    return row, frame.spans.stiffness_top - frame.reduced.n_modes


def _tops(
    frame: Frame, spans: Pieces, piers: Pieces, shares: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Stiffness and mass (top, top) of the pier tops, modes at rest; all that a top carries."""
    n_spans = frame.config.guideway.n_spans
    stiffness, mass = np.zeros((2, 6 * (n_spans + 1), 6 * (n_spans + 1)))
    carried = np.zeros(6 * (n_spans + 1))
    blocks = []
    for pieces, tops in ((spans, SPAN_TOPS), (piers, FAMILIES)):
        n = sum(one.size for one in tops)
        both = np.zeros((2, n, n))
        for one, places in zip(pieces, tops, strict=True):
            block = np.ix_(places, places)
            both[0][block], both[1][block] = one.stiffness, one.mass
        blocks.append(both)
    for span in range(n_spans):
        at = slice(6 * span, 6 * span + 12)
        share = shares[1 if span == n_spans // 2 else 0]
        stiffness[at, at] += blocks[0][0]
        mass[at, at] += blocks[0][1] - share.T @ share
        carried[at] += blocks[0][1].diagonal()
    for pier in range(n_spans + 1):
        at = slice(6 * pier, 6 * pier + 6)
        stiffness[at, at] += blocks[1][0]
        mass[at, at] += blocks[1][1] - shares[2].T @ shares[2]
        carried[at] += blocks[1][1].diagonal()
    return stiffness, mass, carried


def _factors(
    frame: Frame, mass: FloatArray, shares: Sequence[FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Entries of the factors of all stretches below the diagonal; inverses of the diagonals.

    Modes that are not stepped follow the tops with their mass.
    """
    reduced, n_spans = frame.reduced, frame.config.guideway.n_spans
    n_own = [reduced.own_modes(span).size for span in range(n_spans)]
    n_pier = (reduced.n_modes - sum(n_own)) // (n_spans + 1)
    entries, inverses = [], []
    for stretch, (tops, row, column) in zip(frame.of_passage, frame.factors, strict=True):
        whole, first = mass.copy(), 0
        for span in range(n_spans):
            stepped = stretch.stepped[first : first + n_own[span]]
            first += n_own[span]
            if not stepped.all():
                share = shares[1 if span == n_spans // 2 else 0][~stepped]
                at = slice(6 * span, 6 * span + 12)
                whole[at, at] += share.T @ share
        for pier in range(n_spans + 1):
            stepped = stretch.stepped[first : first + n_pier]
            first += n_pier
            if not stepped.all():
                share = shares[2][~stepped]
                at = slice(6 * pier, 6 * pier + 6)
                whole[at, at] += share.T @ share
        factor = np.linalg.cholesky(whole[np.ix_(tops, tops)])
        entries.append(factor[row, column])
        n_modes = int(stretch.stepped[: reduced.n_modes].sum())
        inverses += [np.zeros(n_modes), 1.0 / factor.diagonal()]
    return np.concatenate(entries), np.concatenate(inverses)


def _midspan(frame: Frame, sides: Sequence[FloatArray]) -> FloatArray:
    """Motion of midspan, z and y, per unit of each coordinate of the middle span and its tops."""
    kind = frame.kinds[1]
    n = kind.family.size
    found = np.zeros((2, n + 12))
    for family in (0, 1):
        along = frame.basis.midspan[family] @ sides[family]
        mine = np.flatnonzero(kind.family == family)
        found[family, mine] = along[kind.place[mine]]
        found[family, n + SPAN_TOPS[family]] = along[-6:]
    return found.ravel()


def _rest(frame: Frame, spans: Pieces) -> FloatArray:
    """Motion of midspan that the modes of the middle span leave out, under forces on its rails."""
    kind, basis = frame.kinds[1], frame.basis
    rests = [_left_out(kind, spans, family, basis.midspan[family], 0) for family in (0, 1)]
    return np.concatenate(
        [basis.rail[0].T @ rests[0], basis.rail[1].T @ rests[1], basis.rail[2].T @ rests[1]]
    )


def _left_out(kind: Kind, spans: Pieces, family: int, load: FloatArray, number: int) -> FloatArray:
    """Static shape (coordinate,) under a load by the modes of a kind of span that are left out."""
    places = kind.place[kind.family == family]
    shape = spans[family].shape[:, places]
    modal = (shape.T @ load) / spans[family].square[places]
    return spans[family].static[:, number] - shape @ modal


def _opening(frame: Frame, sides: Sequence[FloatArray]) -> FloatArray:
    """Opening of the middle span's bearings per unit coordinate, as `Spans.bearing` has it."""
    kind = frame.kinds[1]
    n = kind.family.size
    found = np.zeros((2, 2, n + 12))
    for family, opening in enumerate(frame.basis.opening):
        n_inner = sides[family].shape[0]
        along = opening[:, :n_inner] @ sides[family]
        along[:, -6:] += opening[:, n_inner:]
        mine = np.flatnonzero(kind.family == family)
        found[:, family, mine] = along[:, kind.place[mine]]
        found[:, family, n + SPAN_TOPS[family]] = along[:, -6:]
    return found.ravel()


def _opening_rest(frame: Frame, spans: Pieces) -> FloatArray:
    """Opening of the middle span's bearings by left-out modes, as `Spans.bearing_rest` has it."""
    basis, found = frame.basis, []
    for end in (0, 1):
        mean, half = (
            _left_out(
                frame.kinds[1], spans, k, basis.opening[k][end, : basis.midspan[k].size], 1 + end
            )
            for k in (0, 1)
        )
        found += [basis.rail[0].T @ mean, basis.rail[1].T @ half, basis.rail[2].T @ half]
    return np.concatenate(found)


def _softness(frame: Frame, spans: Pieces, stiffness: FloatArray) -> float:
    """Deflection of midspan under a unit force there [m/N]."""
    even, midspan = spans[0], frame.basis.midspan[0]
    tops = np.zeros(stiffness.shape[0])
    tops[6 * (frame.config.guideway.n_spans // 2) + SPAN_TOPS[0]] = midspan @ even.constraint
    return float(midspan @ even.static[:, 0] + tops @ np.linalg.solve(stiffness, tops))


def _by_bearings(frame: Frame, guideway: Guideway, spans: Pieces) -> FloatArray:
    """Diagonal of the damping by the bearings, of modes of all kinds and of the tops."""
    n_spans = guideway.n_spans
    modes, tops = [], np.zeros(12)
    for one, ends, places in zip(spans, frame.basis.ends, SPAN_TOPS, strict=True):
        n = one.shape.shape[0]
        rows = ends.reshape(-1, ends.shape[2])
        modes.append(np.square(rows[:, :n] @ one.shape).sum(axis=0))
        tops[places] = np.square(rows[:, :n] @ one.constraint + rows[:, n:]).sum(axis=0)
    whole = np.zeros(6 * (n_spans + 1))
    for span in range(n_spans):
        whole[6 * span : 6 * span + 12] += tops
    of_kinds = [
        np.array([modes[f][k] for f, k in zip(kind.family, kind.place, strict=True)])
        for kind in frame.kinds[:2]
    ]
    nothing = np.zeros(frame.kinds[2].family.size)
    return guideway.bearing.damping * np.concatenate([*of_kinds, nothing, whole])


def _roots(frame: Frame, own: Numbers, phase: FloatArray) -> FloatArray:
    """Roots of the damping on the diagonal over that of the mean, as both are stepped [-]."""
    mean = frame.mean
    if mean is None:
        return np.ones(own.structure.size)
    reduced = frame.reduced
    diagonal = reduced.relative_damping.diagonal()
    of_mean = np.zeros(own.structure.size)
    of_mean[_mode_numbers(frame)] = diagonal[: reduced.n_modes]
    of_mean[own.square.size :] = diagonal[reduced.n_modes :]
    structure = np.maximum(of_mean - mean.bearing, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(mean.structure > 0, own.structure / mean.structure, 1.0)
        share = np.where(of_mean > 0, (structure * ratio + own.bearing) / of_mean, 1.0)
    n, dt = own.square.size, course(frame.config).time_step
    share[:n] *= np.sinc(np.sqrt(mean.square) * dt / np.pi) / np.sinc(phase / np.pi)
    return np.sqrt(share)


def _mode_numbers(frame: Frame) -> IntArray:
    """Which of the numbers of all kinds is that of each mode (mode,)."""
    n_spans = frame.config.guideway.n_spans
    sizes = [kind.family.size for kind in frame.kinds]
    starts = np.cumsum([0, *sizes])
    numbers = [
        starts[kind] + np.arange(sizes[kind])
        for kind in (1 if span == n_spans // 2 else 0 for span in range(n_spans))
    ]
    numbers += [starts[2] + np.arange(sizes[2])] * (n_spans + 1)
    return np.concatenate(numbers).astype(np.int64)


def _record(frame: Frame, mean: Numbers) -> Spans:
    """`Spans` without the rows of samples."""
    spans, reduced = frame.spans, frame.reduced
    n_spans, middle = frame.config.guideway.n_spans, frame.config.guideway.n_spans // 2
    mode = _mode_numbers(frame)
    n_tops = 6 * (n_spans + 1)
    carried = _carried_numbers(frame)
    row = np.repeat(np.arange(reduced.n_modes), np.diff(spans.carried_start))
    number_of = np.full((reduced.n_modes, n_tops), -1)
    top = spans.carried_top - reduced.n_modes
    number_of[row, top] = carried
    always = np.logical_and.reduce([stretch.stepped for stretch in frame.of_passage])
    both = packing.whole_and_short(reduced.carried.T.tocsr(), always[: reduced.n_modes])
    taken_row = np.repeat(np.arange(2 * n_tops), np.diff(both.indptr))
    taken = number_of[spans.taken_mode, taken_row % n_tops]
    even, odd = frame.basis.rail[0].shape[0], frame.basis.rail[1].shape[0]
    alike = len(_unlike_kinds(frame)) == 1
    first = 0 if alike else even * frame.upright[0].size + odd * frame.sideways[0].size
    widest = int(np.diff(spans.upright_start).max() + np.diff(spans.sideways_start).max())
    entries = max(mean.factor.size, 2 * widest + even + odd)
    return spans._replace(
        rail_z=np.ascontiguousarray(frame.basis.rail[0]),
        rail_roll=np.ascontiguousarray(frame.basis.rail[1]),
        rail_y=np.ascontiguousarray(frame.basis.rail[2]),
        change_start=np.array([first if span == middle else 0 for span in range(n_spans)]),
        mode_number=mode,
        carried_number=carried,
        root_number=np.concatenate([mode, mean.square.size + np.arange(n_tops)]),
        taken_number=taken,
        stiffness_number=np.arange(mean.stiffness.size),
        in_order=np.arange(entries),
    )


def _carried_numbers(frame: Frame) -> IntArray:
    """Which of the shares of all kinds is that of each entry of the mean's."""
    spans, reduced = frame.spans, frame.reduced
    n_spans = frame.config.guideway.n_spans
    sizes = [kind.family.size for kind in frame.kinds]
    begin = np.cumsum([0, 12 * sizes[0], 12 * sizes[1]])
    numbers, mode = [], 0
    parts = [(1 if span == n_spans // 2 else 0, span) for span in range(n_spans)]
    parts += [(2, pier) for pier in range(n_spans + 1)]
    for kind, place in parts:
        width = 6 if kind == 2 else 12
        for own in range(sizes[kind]):
            entries = slice(spans.carried_start[mode], spans.carried_start[mode + 1])
            top = spans.carried_top[entries] - reduced.n_modes - 6 * place
            numbers.append(begin[kind] + own * width + top)
            mode += 1
    return np.concatenate(numbers).astype(np.int64)


def own_spans(frame: Frame, guideways: Sequence[Guideway]) -> tuple[Spans, BoolArray, FloatArray]:
    """Guideways of a row of samples, for which of them the step is too large, and their softness.

    The softness of midspan is that over the mean's [-].

    Parameters
    ----------
    frame
        From `frame_of`.
    guideways
        Parameters of each sample.
    """
    found = [numbers_of(frame, one) for one in guideways]

    def rows(name: str) -> FloatArray:
        return aligned(np.array([getattr(one, name) for one in found]).T)

    record = frame.record
    spans = record._replace(
        change=rows("change"),
        square=rows("square"),
        response=rows("response"),
        carried=rows("carried"),
        taken=rows("carried"),
        stiffness=rows("stiffness"),
        damping_root=rows("root"),
        midspan=rows("midspan"),
        rest=rows("rest"),
        bearing=rows("opening"),
        bearing_rest=rows("opening_rest"),
        stretches=record.stretches._replace(
            factor=rows("factor"), factor_inverse=rows("factor_inverse")
        ),
    )
    softer = np.array([one.softness for one in found]) / frame.softness
    return spans, np.array([not one.holds for one in found]), softer


def guideways_of(
    config: Config, values: Mapping[str, FloatArray], samples: Sequence[int]
) -> list[Guideway]:
    """Guideways of some samples with numbers (sample,) of their own at dotted keys."""
    return [
        config.with_numbers({key: float(column[k]) for key, column in values.items()}).guideway
        for k in samples
    ]
