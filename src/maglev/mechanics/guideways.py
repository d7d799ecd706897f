"""Guideways of many samples in one basis: matrices of their own, shapes in common.

All spans are alike, and so are all piers.  Of a span the basis holds the shapes of component modes
and of constraint modes, of the mean and of guideways at both ends of each number that differs; a
sample's own modes are sums of them.  The rails' shapes, the large matrices of a passage, are so the
same for all samples.  Motions that are even from side to side (x, z, pitch) and odd ones (y, roll,
yaw) do not meet.  Theory: docs/theory/random_systems.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from scipy.optimize import linear_sum_assignment

from maglev.arrays import FloatArray, IntArray
from maglev.mechanics import guideway as full
from maglev.mechanics import timoshenko
from maglev.mechanics.reduction import rail_nodes_rows
from maglev.mechanics.timoshenko import PITCH, ROLL, YAW, X, Y, Z
from maglev.mechanics.varied import ends_of, with_arrays
from maglev.parameters import BeamSection, Guideway

FAMILIES = (np.array([X, Z, PITCH]), np.array([Y, ROLL, YAW]))
"""Motions of a node that are even, and that are odd, from side to side."""

TOLERANCE = 0.1
"""Share of a shape at an end, beyond the modes and static shapes of the mean and by the root of its
kinetic energy, that the basis may leave out [-]; assumed, checked in the tests."""

Sections = Callable[[Guideway], BeamSection]


@dataclass(frozen=True)
class Elements:
    """Elements of one section and length: what their matrices make of a component's.

    Attributes
    ----------
    section
        Finds their section among the parameters.
    length
        Of each [m].
    axes
        Of an element, as `timoshenko.turned` takes them.
    entry : (2, entry)
        Row and column of what is not zero in an element's matrices.
    maps : family of (entry, coordinate, coordinate)
        A component's matrix per unit of each entry.
    """

    section: Sections
    length: float
    axes: FloatArray
    entry: tuple[IntArray, IntArray]
    maps: tuple[FloatArray, FloatArray]

    def add_to(self, component: list[Matrices], guideway: Guideway) -> None:
        """Add stiffness and mass of the elements to those of both families."""
        stiffness, mass = self.whole(guideway)
        for matrices, maps in zip(component, self.maps, strict=True):
            flat, shape = maps.reshape(maps.shape[0], -1), maps.shape[1:]
            matrices.stiffness += (stiffness[self.entry] @ flat).reshape(shape)
            matrices.mass += (mass[self.entry] @ flat).reshape(shape)

    def whole(self, guideway: Guideway) -> tuple[FloatArray, FloatArray]:
        """Stiffness and mass (12, 12) of one element."""
        section = self.section(guideway)
        stiffness, mass = timoshenko.stiffness, timoshenko.mass
        return (
            timoshenko.turned(stiffness(section, self.length), self.axes),
            timoshenko.turned(mass(section, self.length), self.axes),
        )


@dataclass
class Matrices:
    """Stiffness and mass (coordinate, coordinate) of a family of a component; pier tops last."""

    stiffness: FloatArray
    mass: FloatArray


def _elements(
    guideway: Guideway,
    section: Sections,
    axes: FloatArray,
    motions: Sequence[FloatArray],
    ends: tuple[IntArray, IntArray],
    lengths: FloatArray,
) -> list[Elements]:
    """Elements in groups of equal length; motions (6 node, coordinate) of both families."""
    found = []
    for length in np.unique(np.round(lengths, 9)):
        these = np.flatnonzero(np.abs(lengths - length) < 1e-8)
        first, second = (end[these, None] for end in ends)
        dof = np.concatenate([6 * first + np.arange(6), 6 * second + np.arange(6)], axis=1)
        bare = Elements(section, float(length), axes, (dof[0], dof[0]), (axes, axes))
        stiffness, mass = bare.whole(guideway)
        row, column = np.nonzero((stiffness != 0) | (mass != 0))
        maps = [
            np.einsum("eki,ekj->kij", motion[dof][:, row], motion[dof][:, column])
            for motion in motions
        ]
        found.append(Elements(section, float(length), axes, (row, column), (maps[0], maps[1])))
    return found


@dataclass(frozen=True)
class Piece:
    """A sample's own modes of one kind of component, and what its ends feel.

    Attributes
    ----------
    square : (mode,)
        Squared circular frequencies [1/s²].
    shape : (coordinate, mode), constraint : (coordinate, top)
        In the basis of a family: modes, and motions with the tops where nothing else moves.
    share : (mode, top)
        What a mode takes along of the tops' motion [-].
    stiffness, mass : (top, top)
        Of the tops when the component follows them, modes at rest; and of all of it.
    static : (coordinate, load)
        Static shapes of a span under a unit force at midspan and at the bearings of either end
        [m/N].
    """

    square: FloatArray
    shape: FloatArray
    constraint: FloatArray
    share: FloatArray
    stiffness: FloatArray
    mass: FloatArray
    static: FloatArray


def piece(matrices: Matrices, n_tops: int, like: FloatArray, loads: FloatArray) -> Piece:
    """Modes and constraint modes of one family of a component.

    Parameters
    ----------
    matrices
        Of the component.
    n_tops
        Coordinates of pier tops among them, the last.
    like : (coordinate, mode)
        Modes of the mean, times its mass: a sample's are put in their order, with their signs.
    loads : (coordinate, load)
        Forces per unit of those whose static shapes are wanted.
    """
    n = matrices.mass.shape[0] - n_tops
    inner, coupling = matrices.stiffness[:n, :n], matrices.stiffness[:n, n:]
    mass, shared = matrices.mass[:n, :n], matrices.mass[:n, n:]
    square, shape = scipy.linalg.eigh(
        inner, mass, subset_by_index=(0, min(n, like.shape[1]) - 1), driver="gvx"
    )
    overlap = like.T @ shape
    row, column = linear_sum_assignment(-np.abs(overlap))
    sign = np.where(overlap[row, column] < 0, -1.0, 1.0)
    square, shape = square[column], shape[:, column] * sign
    solved = np.asarray(np.linalg.solve(inner, np.hstack([-coupling, loads])), dtype=float)
    constraint = solved[:, :n_tops]
    inertia = mass @ constraint + shared
    return Piece(
        square=square,
        shape=shape,
        constraint=constraint,
        share=shape.T @ inertia,
        stiffness=matrices.stiffness[n:, n:] + coupling.T @ constraint,
        mass=matrices.mass[n:, n:] + constraint.T @ inertia + shared.T @ constraint,
        static=solved[:, n_tops:],
    )


@dataclass(frozen=True)
class Basis:
    """Shapes of a span and of a pier that all samples share, and what their matrices are made of.

    Attributes
    ----------
    guideway
        The mean.
    span, pier : elements
        Of one span, of one pier.
    lumped : family of (coordinate, coordinate)
        Mass of a span per connector mass [kg per kg/m].
    ends : family of (end, 6, coordinate)
        Stretch of the bearings of both girder ends, x, y and z of the right and the left one.
    span_like, pier_like : family of (coordinate, mode)
        Modes of the mean.
    rail : (rail_z, rail_roll, rail_y), each (coordinate, coefficient)
        Motion of the rails: of the even family, of the odd one twice.
    midspan : family of (coordinate,)
        Motion of midspan: z, y.
    shapes : family of (dof of a span, coordinate)
        The basis itself.
    """

    guideway: Guideway
    span: tuple[Elements, ...]
    pier: tuple[Elements, ...]
    lumped: tuple[FloatArray, FloatArray]
    ends: tuple[FloatArray, FloatArray]
    span_like: tuple[FloatArray, FloatArray]
    pier_like: tuple[FloatArray, FloatArray]
    rail: tuple[FloatArray, FloatArray, FloatArray]
    midspan: tuple[FloatArray, FloatArray]
    shapes: tuple[FloatArray, FloatArray]

    @property
    def opening(self) -> tuple[FloatArray, FloatArray]:
        """Opening of the bearings at either end (end, coordinate): mean of the even family, half
        the difference of the odd one."""
        even, odd = self.ends
        return -0.5 * (even[:, 2] + even[:, 5]), -0.5 * (odd[:, 2] - odd[:, 5])

    def span_pieces(self, guideway: Guideway) -> tuple[Piece, Piece]:
        """Modes of a span of a guideway, even and odd."""
        families = [Matrices(np.zeros_like(one), np.zeros_like(one)) for one in self.lumped]
        for elements in self.span:
            elements.add_to(families, guideway)
        strength = _strength(guideway)
        found = []
        loads = [self.midspan[k][:, None] for k in (0, 1)]
        loads = [
            np.hstack([load, self.opening[k][:, : load.shape[0]].T]) for k, load in enumerate(loads)
        ]
        for matrices, lumped, ends, like, load in zip(
            families, self.lumped, self.ends, self.span_like, loads, strict=True
        ):
            matrices.mass += guideway.rail.connector_mass * lumped
            for end, of_end in zip(ends, strength, strict=True):
                matrices.stiffness += end.T @ (of_end[:, None] * end)
            found.append(piece(matrices, 6, like, load))
        return found[0], found[1]

    def pier_pieces(self, guideway: Guideway) -> tuple[Piece, Piece]:
        """Modes of a pier of a guideway, even and odd."""
        families = [
            Matrices(np.zeros(maps.shape[1:]), np.zeros(maps.shape[1:]))
            for maps in self.pier[0].maps
        ]
        for elements in self.pier:
            elements.add_to(families, guideway)
        even, odd = (
            piece(matrices, 3, like, np.zeros((like.shape[0], 0)))
            for matrices, like in zip(families, self.pier_like, strict=True)
        )
        return even, odd


def _strength(guideway: Guideway) -> FloatArray:
    """Stiffness (end, 6) of the bearings in x, y and z, right and left [N/m]."""
    bearing = guideway.bearing
    return np.array(
        [
            [longitudinal, bearing.lateral_stiffness, bearing.vertical_stiffness] * 2
            for longitudinal in (
                bearing.fixed_longitudinal_stiffness,
                bearing.free_longitudinal_stiffness,
            )
        ]
    )


def _halves(model: full.GuidewayModel, dof: IntArray) -> tuple[FloatArray, FloatArray]:
    """Orthonormal even and odd motions (dof, coordinate) of some degrees of freedom."""
    place, component = np.round(model.place[dof], 6), model.component[dof]
    sign = np.where(np.isin(component, FAMILIES[0]), 1.0, -1.0)
    seen: dict[tuple, list[int]] = {}  # ends of two units of rail share a place
    for k, (at, kind) in enumerate(zip(place.tolist(), component.tolist(), strict=True)):
        seen.setdefault((*at, kind), []).append(k)
    partner = np.zeros(dof.size, dtype=np.int64)
    for (x, y, z, kind), here in seen.items():
        partner[here] = seen[x, -y + 0.0, z, kind]
    mirrored = np.zeros((dof.size, dof.size))
    mirrored[np.arange(dof.size), partner] = sign
    halves: list[FloatArray] = []
    for parity in (1.0, -1.0):
        both = (np.eye(dof.size) + parity * mirrored) / 2
        first = np.flatnonzero((np.arange(dof.size) <= partner) & (np.abs(both).sum(axis=0) > 0))
        shapes = both[:, first]
        halves.append(shapes / np.sqrt(np.square(shapes).sum(axis=0)))
    return halves[0], halves[1]


def make_basis(guideway: Guideway, keys: Sequence[str], cutoff: float) -> Basis:
    """Make the basis of guideways that differ in some numbers.

    Parameters
    ----------
    guideway
        The mean.
    keys
        Numbers that differ, among `KEYS`.
    cutoff
        Highest mode that is kept of any component [Hz].
    """
    single = full.build(guideway.model_copy(update={"n_spans": 1}))
    halves = _halves(single, single.span_dof[0])
    variants = [
        with_arrays(guideway, {key: guideway_number(guideway, key) * times})
        for key in keys
        if key != "damping_ratio"
        for times in ends_of(key)
    ]
    models = [full.build(one.model_copy(update={"n_spans": 1})) for one in variants]
    shapes, like = [], []
    for number, half in enumerate(halves):
        modes, others = _shapes(single, half, number, cutoff)
        extreme = [_shapes(one, half, number, cutoff) for one in models]
        dof = single.span_dof[0]
        mass = half.T @ (single.mass[dof][:, dof] @ half)
        rest = np.hstack([shape for both in extreme for shape in both])
        vectors = _orthonormal([modes, others, rest], mass)
        shapes.append(half @ vectors)
        like.append(vectors.T @ mass @ modes)
    span = full.one_span(guideway)
    motions = [span.motion @ shape for shape in shapes]
    padded = [np.hstack([motion, np.zeros((motion.shape[0], 6))]) for motion in motions]
    connectors = [
        full.one_span(with_arrays(guideway, {"rail.connector_mass": mass})).mass
        for mass in (0.0, 1.0)
    ]
    per_mass = [shape.T @ ((connectors[1] - connectors[0]) @ shape) for shape in shapes]
    rows = [one[:, single.span_dof[0]] for one in rail_nodes_rows(single, 0)]
    midspan = [
        (row[:, single.span_dof[0]] @ shape).ravel()
        for row, shape in zip(single.girder_rows([0.5 * guideway.span_length]), shapes, strict=True)
    ]
    pier, pier_like = _pier(guideway, cutoff)
    return Basis(
        guideway=guideway,
        span=tuple(_span_elements(guideway, span, padded)),
        pier=tuple(pier),
        lumped=(_bordered(per_mass[0], 6), _bordered(per_mass[1], 6)),
        ends=(
            _bearing_ends(guideway, span, motions[0], 0),
            _bearing_ends(guideway, span, motions[1], 1),
        ),
        span_like=(like[0], like[1]),
        pier_like=pier_like,
        rail=((rows[0] @ shapes[0]).T, (rows[1] @ shapes[1]).T, (rows[2] @ shapes[1]).T),
        midspan=(midspan[0], midspan[1]),
        shapes=(shapes[0], shapes[1]),
    )


def guideway_number(guideway: Guideway, key: str) -> float:
    """Number at a dotted key of the guideway."""
    found: Any = guideway
    for name in key.split("."):
        found = getattr(found, name)
    return float(found)


def _bordered(matrix: FloatArray, n: int) -> FloatArray:
    return np.pad(matrix, (0, n))


def _shapes(
    model: full.GuidewayModel, half: FloatArray, family: int, cutoff: float
) -> tuple[FloatArray, FloatArray]:
    """Component modes of a span, and its constraint modes and the static shape under midspan.

    In the coordinates of a half.
    """
    dof = model.span_dof[0]
    tops = model.pier_top_dof[:, FAMILIES[family]].ravel()
    stiffness = half.T @ (model.stiffness[dof][:, dof] @ half)
    mass = half.T @ (model.mass[dof][:, dof] @ half)
    limit = (2 * np.pi * cutoff) ** 2
    _, modes = scipy.linalg.eigh(stiffness, mass, subset_by_value=(-np.inf, limit))
    midspan = model.girder_rows([0.5 * model.parameters.span_length])[family][:, dof]
    pull = np.hstack([-model.stiffness[dof][:, tops].toarray(), midspan.toarray().T])
    return modes, np.linalg.solve(stiffness, half.T @ pull)


def _orthonormal(shapes: Sequence[FloatArray], mass: FloatArray) -> FloatArray:
    """Modes and static shapes of the mean, and what others have beyond them, with unit mass."""
    root = np.linalg.cholesky(mass).T
    known, least = root @ shapes[0], (1e-9, TOLERANCE)
    for others, share in zip(shapes[1:], least, strict=True):
        more = root @ others
        size = np.sqrt(np.square(more).sum(axis=0))
        more = more[:, size > 0] / size[size > 0]
        for _ in range(2):  # the second time for rounding
            more = more - known @ (known.T @ more)
        beyond, size, _ = np.linalg.svd(more, full_matrices=False)
        known = np.hstack([known, beyond[:, size > share]])
    return np.linalg.solve(root, known)


def _span_elements(
    guideway: Guideway, span: full.SpanModel, motions: Sequence[FloatArray]
) -> list[Elements]:
    """Elements of girder and rails."""
    found = []
    rails = tuple(np.concatenate(ends) for ends in zip(*span.rails, strict=True))
    for section, ends in (
        (lambda one: one.girder, span.girder),
        (lambda one: one.rail.section, rails),
    ):
        lengths = span.node_x[ends[1]] - span.node_x[ends[0]]
        found += _elements(guideway, section, np.eye(3), motions, (ends[0], ends[1]), lengths)
    return found


def _bearing_ends(
    guideway: Guideway, span: full.SpanModel, motion: FloatArray, family: int
) -> FloatArray:
    """`Basis.ends` of a family."""
    bearing, found = guideway.bearing, []
    for number, node in enumerate((0, span.girder[1][-1])):
        of_girder = motion[6 * node : 6 * node + 6]
        rows = np.zeros((6, motion.shape[1] + 6))
        for k, y in enumerate((bearing.y, -bearing.y)):
            at = slice(3 * k, 3 * k + 3)
            rows[at, : motion.shape[1]] = full.rigid_arm(y, bearing.z)[:3] @ of_girder
            tops = motion.shape[1] + 3 * number + np.arange(3)
            rows[at, tops] = -full.rigid_arm(y, 0.0)[:3][:, FAMILIES[family]]
        found.append(rows)
    return np.stack(found)


def _pier(
    guideway: Guideway, cutoff: float
) -> tuple[list[Elements], tuple[FloatArray, FloatArray]]:
    """Elements of a pier, all of its nodes in the basis, the top last; and modes of the mean."""
    _, _, depth = full.one_pier(guideway)
    depth = np.append(depth, guideway.pier.height)
    n = depth.size - 1  # the foot is fixed
    motions = []
    for family in FAMILIES:
        motion = np.zeros((6 * (n + 1), 3 * n))
        order = np.concatenate([np.arange(1, n), [0]])  # top last
        for place, node in enumerate(order):
            motion[6 * node + family, 3 * place + np.arange(3)] = 1.0
        motions.append(motion)
    found = []
    first = np.arange(n)
    cap = depth[1:] <= guideway.pier.cap_height + 1e-9
    for these, section in (
        (cap, lambda one: full.pier_section(one.pier, one.pier.cap_width_y)),
        (~cap, lambda one: full.pier_section(one.pier, one.pier.width_y)),
    ):
        ends = (first[these], first[these] + 1)
        lengths = np.diff(depth)[these]
        found += _elements(guideway, section, full.PIER_AXES, motions, ends, lengths)
    like = []
    for number in range(2):
        shape = found[0].maps[number].shape[1:]
        families = [Matrices(np.zeros(shape), np.zeros(shape)) for _ in FAMILIES]
        for elements in found:
            elements.add_to(families, guideway)
        inner = slice(0, shape[0] - 3)
        mass = families[number].mass[inner, inner]
        limit = (2 * np.pi * cutoff) ** 2
        _, modes = scipy.linalg.eigh(
            families[number].stiffness[inner, inner], mass, subset_by_value=(-np.inf, limit)
        )
        like.append(mass @ modes)
    return found, (like[0], like[1])
