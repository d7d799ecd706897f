"""Component reduction of the guideway: modes of each span, and pier tops shared by neighbours.

Craig-Bampton with the interface shapes made mass-orthogonal to the component modes, so that the
mass matrix is the identity on the modes and banded on the pier tops.  Every coordinate belongs to
one span or one pier: no mode runs through the whole guideway, and cost grows with its length only
where the train is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy.linalg
import scipy.sparse as sp
import scipy.sparse.linalg

from maglev.arrays import FloatArray, IntArray
from maglev.mechanics import guideway as full
from maglev.mechanics import timoshenko
from maglev.parameters import Guideway

_SAG_POINTS = 32
"""Points per pole pitch at which the standing sag is tabulated [-]; assumed."""

DAMPING_DROP = 3e-3
"""Entries of the damping matrix below this share of their diagonals are dropped [-]; assumed,
checked in the tests against the damping ratio of every mode."""


@dataclass(frozen=True)
class ReducedGuideway:
    """Guideway in component coordinates: modes of spans, modes of piers, pier tops, in this order.

    Attributes
    ----------
    n_modes
        Coordinates with unit mass; the remaining ones are pier tops, six each.
    span_coordinates : span of (column,)
        Coordinates that move span j: its modes, then its two pier tops.
    top_mass : (top, top)
        Banded mass matrix of the pier tops [kg, kg m, kg m²].
    stiffness : (coordinate, coordinate)
        Sparse.
    carried : (mode, top)
        Motion of a component mode per motion of a pier top that carries it; sparse.  Less this
        share, a mode's coordinate is its motion relative to the pier tops.
    relative_damping : (coordinate, coordinate)
        Acts on the relative rates of the modes and the rates of the pier tops; sparse.
    rail_z, rail_roll, rail_y : span of (column, coefficient)
        Motion of the rails along a span per unit coordinate: vertical on the centre line, roll
        times the rail's distance from it, and lateral.  Displacement, and turn of the section times
        connector spacing, at the nodes of each unit, its ends and connectors.
    midspan_z, midspan_y : (column,)
        Motion of the middle span's girder axis at midspan per unit coordinate.
    rest_z, rest_roll, rest_y : (coefficient,)
        Flexibility of midspan in the left-out modes of the middle span: z under forces on
        ``rail_z``, y under forces on ``rail_roll`` and ``rail_y`` [m/N].
    bearing : (4, column)
        Opening of the middle span's bearings per unit coordinate: at the first end the mean of
        right and left and half their difference, then at the last.
    bearing_rest : (6, coefficient)
        That opening, which its modes leave out, under forces on the rails of the middle span [m/N]:
        at either end the mean under those on ``rail_z``, half the difference under those on
        ``rail_roll`` and on ``rail_y``.
    basis : (dof, coordinate)
        Motion of the finite-element model per unit coordinate.
    """

    parameters: Guideway
    n_modes: int
    span_coordinates: tuple[IntArray, ...]
    top_mass: FloatArray
    stiffness: sp.csr_array
    carried: sp.csr_array
    relative_damping: sp.csr_array
    rail_z: tuple[FloatArray, ...]
    rail_roll: tuple[FloatArray, ...]
    rail_y: tuple[FloatArray, ...]
    midspan_z: FloatArray
    midspan_y: FloatArray
    rest_z: FloatArray
    rest_roll: FloatArray
    rest_y: FloatArray
    bearing: FloatArray
    bearing_rest: FloatArray
    basis: sp.csr_array

    @property
    def n_coordinates(self) -> int:
        """Number of coordinates [-]."""
        return int(self.stiffness.shape[0])

    def own_modes(self, span: int) -> IntArray:
        """Coordinates of a span's own modes, those of its pier tops left out (mode,)."""
        columns = self.span_coordinates[span]
        return columns[columns < self.n_modes]

    @property
    def mass(self) -> sp.csr_array:
        """Mass matrix (coordinate, coordinate)."""
        return sp.block_diag([sp.eye_array(self.n_modes), self.top_mass], format="csr")

    @property
    def relative(self) -> sp.csr_array:
        """Relative rates per unit rate of the coordinates (coordinate, coordinate)."""
        n_tops = self.n_coordinates - self.n_modes
        return sp.block_array(
            [[sp.eye_array(self.n_modes), -self.carried], [None, sp.eye_array(n_tops)]],
            format="csr",
        )

    @property
    def damping(self) -> sp.csr_array:
        """Damping matrix (coordinate, coordinate)."""
        return (self.relative.T @ self.relative_damping @ self.relative).tocsr()


def rail_nodes(n_connectors: int) -> FloatArray:
    """Ends and connectors of a unit of rail, from its start in connector spacings (node,) [-].

    Between them the rail is a beam element; no element bridges the joint of two units.  Units join
    with a kink, and poles that pass the kinks one after the other shake the guideway at the rate
    of pole passing.
    """
    return np.concatenate([[0.0], np.arange(n_connectors) + 0.5, [float(n_connectors)]])


def rail_weights(
    guideway: Guideway, x: npt.ArrayLike, *, lateral: bool
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Weights of the rail coefficients of a span in the motion of points along it.

    Parameters
    ----------
    guideway
        Parameters.
    x : (point,)
        Points along the span, from its start [m].
    lateral
        Whether the motion is ``rail_y``; else ``rail_z`` or ``rail_roll``.

    Returns
    -------
    first : (point,)
        First of the four adjacent coefficients that move a point [-].
    weight, slope : (point, 4)
        Of the coefficients in the motion [-] and in its derivative along travel [1/m].
    """
    rail = guideway.rail
    n_units, n_connectors = rail.units_per_span, rail.connectors_per_unit
    spacing = guideway.span_length / (n_units * n_connectors)
    along = np.asarray(x, dtype=float) / guideway.span_length * n_units
    unit = np.clip(np.floor(along + 1e-9), 0, n_units - 1).astype(np.int64)
    local = np.clip((along - unit) * n_connectors, 0.0, n_connectors)
    nodes = rail_nodes(n_connectors)
    piece = np.clip(np.searchsorted(nodes, local, side="right") - 1, 0, nodes.size - 2)
    extent = np.diff(nodes)[piece] * spacing
    phi = timoshenko.shear_flexibility(rail.section, extent)[1 if lateral else 0]
    inside = (local - nodes[piece]) * spacing
    per_coefficient = np.array([1.0, 1.0 / spacing, 1.0, 1.0 / spacing])
    return (
        2 * (unit * nodes.size + piece),
        timoshenko.deflection_shape(extent, phi, inside) * per_coefficient,
        timoshenko.slope_shape(extent, phi, inside) * per_coefficient,
    )


@dataclass(frozen=True)
class FaceWeights:
    """Weights of the rail coefficients in the mean motion under faces along the guideway.

    Attributes
    ----------
    first : (face,)
        First of the adjacent coefficients under a face, counted span after span.
    start : (face + 1,)
        Where the weights of each face begin; a face with no rail under it has none.
    weight : (coefficient,)
        Of the coefficients in the mean motion [-].
    slope : (coefficient,)
        Of the coefficients in its derivative as the face moves on [1/m].
    """

    first: IntArray
    start: IntArray
    weight: FloatArray
    slope: FloatArray


def face_weights(
    guideway: Guideway, x: npt.ArrayLike, length: float, *, lateral: bool, advance: float = 0.0
) -> FaceWeights:
    """Weights of the mean motion of the rails under faces; off the guideway they do not move.

    A face that passes a joint sees the step between two units as a ramp: the derivative of its mean
    is the difference of the motions under its two edges over its length.  It jumps where an edge
    meets the joint; its mean over ``advance`` does not, and adds up to the whole ramp.

    Parameters
    ----------
    guideway
        Parameters.
    x : (face,)
        Middles of the faces, from the first pier [m].
    length
        Of a face [m]; zero for points.
    lateral
        Whether the motion is ``rail_y``; else ``rail_z`` or ``rail_roll``.
    advance
        Distance over which the slope is averaged, half of it on either side [m]; zero for the slope
        at ``x`` itself, the only one that points (``length`` zero) have.

    Returns
    -------
    weights
        Of the coefficients.

    References
    ----------
    docs/theory/integration.md, poles with a length.
    """
    x = np.asarray(x, dtype=float)
    joints = _pieces(guideway)
    near, far = x - 0.5 * length, x + 0.5 * length
    reach = 0.5 * advance if length > 0 else 0.0
    on = (far + reach > 1e-9) & (near - reach < joints[-1] - 1e-9)
    rear, front = _met(joints, near - reach, far + reach)
    first = _coefficient_of(guideway, rear)
    count = np.where(on, _coefficient_of(guideway, front) + 4 - first, 0)
    start = np.concatenate([[0], np.cumsum(count)])
    weight, slope = np.zeros((2, start[-1]))
    here = start[:-1] - first  # where a place has the weight of the first coefficient of all
    if length == 0:
        _, values, slopes = _piece_weights(guideway, rear[on], x[on], lateral=lateral)
        at = start[:-1][on, None] + np.arange(4)
        weight[at], slope[at] = values, slopes
    else:
        _add_means(guideway, near, far, 1.0, here, weight, lateral=lateral)
        for edge, sign in ((near, -1.0), (far, 1.0)):
            if advance > 0:
                ends = (edge - reach, edge + reach)
                _add_means(guideway, *ends, sign / length, here, slope, lateral=lateral)
                continue
            met = np.flatnonzero(on & (edge >= -1e-9) & (edge <= joints[-1] + 1e-9))
            piece = (rear if sign < 0 else front)[met]
            coefficient, values, _ = _piece_weights(guideway, piece, edge[met], lateral=lateral)
            at = (here[met] + coefficient)[:, None] + np.arange(4)
            np.add.at(slope, at, values * (sign / length))
    return FaceWeights(first, start, weight, slope)


def _met(joints: FloatArray, low: FloatArray, high: FloatArray) -> tuple[IntArray, IntArray]:
    """First and last piece of rail under intervals; off the guideway, the nearest piece."""
    last = joints.size - 2
    rear = np.clip(np.searchsorted(joints, low + 1e-9, side="right") - 1, 0, last)
    front = np.clip(np.searchsorted(joints, high - 1e-9, side="left") - 1, 0, last)
    return rear, np.maximum(front, rear)


def _add_means(
    guideway: Guideway,
    low: FloatArray,
    high: FloatArray,
    factor: float,
    here: IntArray,
    target: FloatArray,
    *,
    lateral: bool,
) -> None:
    """Add ``factor`` times the mean motion of the rails over intervals to their coefficients."""
    joints = _pieces(guideway)
    rear, front = _met(joints, low, high)
    on = (high > 1e-9) & (low < joints[-1] - 1e-9)
    gauss, share = np.polynomial.legendre.leggauss(2)  # exact for the cubic shapes of a piece
    for step in range(int((front - rear)[on].max(initial=-1)) + 1):
        which = np.flatnonzero(on & (rear + step <= front))
        piece = rear[which] + step
        begin = np.maximum(low[which], joints[piece])
        end = np.minimum(high[which], joints[piece + 1])
        at = (here[which] + _coefficient_of(guideway, piece))[:, None] + np.arange(4)
        covered = factor * (end - begin) / (high - low)[which]
        for node, part in zip(gauss, share, strict=True):
            inside = 0.5 * (begin + end) + 0.5 * (end - begin) * node
            _, values, _ = _piece_weights(guideway, piece, inside, lateral=lateral)
            np.add.at(target, at, values * (0.5 * part * covered)[:, None])


def _pieces(guideway: Guideway) -> FloatArray:
    """Joints between pieces of rail, from the first pier to the last [m]."""
    rail = guideway.rail
    spacing = guideway.span_length / (rail.units_per_span * rail.connectors_per_unit)
    nodes = rail_nodes(rail.connectors_per_unit)[:-1] * spacing
    n_units = guideway.n_spans * rail.units_per_span
    unit = guideway.span_length / rail.units_per_span
    return np.append((np.arange(n_units)[:, None] * unit + nodes).ravel(), n_units * unit)


def _coefficient_of(guideway: Guideway, piece: IntArray) -> IntArray:
    """First of the four coefficients of a piece of rail, counted along the whole guideway."""
    per_unit = guideway.rail.connectors_per_unit + 1
    return 2 * (piece + piece // per_unit)


def _piece_weights(
    guideway: Guideway, piece: IntArray, x: FloatArray, *, lateral: bool
) -> tuple[IntArray, FloatArray, FloatArray]:
    """As `rail_weights`, along the whole guideway and for points on known pieces of rail."""
    rail = guideway.rail
    joints = _pieces(guideway)
    spacing = guideway.span_length / (rail.units_per_span * rail.connectors_per_unit)
    extent = np.diff(rail_nodes(rail.connectors_per_unit))[piece % (rail.connectors_per_unit + 1)]
    extent = extent * spacing
    phi = timoshenko.shear_flexibility(rail.section, extent)[1 if lateral else 0]
    inside = np.clip(x - joints[piece], 0.0, extent)
    per_coefficient = np.array([1.0, 1.0 / spacing, 1.0, 1.0 / spacing])
    return (
        _coefficient_of(guideway, piece),
        timoshenko.deflection_shape(extent, phi, inside) * per_coefficient,
        timoshenko.slope_shape(extent, phi, inside) * per_coefficient,
    )


def standing_sag(
    model: full.GuidewayModel,
    reduced: ReducedGuideway,
    span: int,
    force: float,
    pitch: float,
    *,
    lateral: bool,
    pole_length: float = 0.0,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Static sag of the rails under a row of poles, less the part that the kept modes represent.

    The bays between connectors follow the poles at once: their modes lie far above the cut-off.
    As the pole forces hardly vary, the sag of the left-out modes is computed once, for rest.

    Parameters
    ----------
    model, reduced
        Guideway, whole and in component coordinates.
    span
        Number of the span.
    force
        Force of one pole on its rail [N]; down, or away from the centre line.
    pitch
        Distance of neighbouring poles [m].
    lateral
        Whether the poles are those of the guidance magnets.
    pole_length
        Length of a pole's face, over which force and motion are averaged [m].

    Returns
    -------
    x, sag, slope : (point,)
        Points along the span, from its start [m]; sag of the rail at a pole there, in the
        direction of the force, with other poles all along the span [m]; its derivative along travel
        [-].  Both jump at joints of units, where two points coincide.
    """
    length, dof = model.parameters.span_length, model.span_dof[span]
    n_units, n_poles = model.parameters.rail.units_per_span, round(length / pitch)
    n_points = math.lcm(n_units, n_poles)
    n_points *= -(-_SAG_POINTS * n_poles // n_points)
    n_phases = n_points // n_poles
    x = (np.arange(n_points) + 0.5) * length / n_points
    kind = 2 if lateral else 0
    right, left = (model.rail_rows(span * length + x, side)[kind][:, dof] for side in (1, -1))
    outward = (right - left if lateral else right + left).tocsr()
    if pole_length > 0:
        outward = _moving_mean(n_points, pole_length * n_points / length) @ outward
    load = np.stack([outward[k::n_phases].sum(axis=0) for k in range(n_phases)], axis=1) * force
    own = reduced.own_modes(span)
    shapes = reduced.basis[dof][:, own].toarray()
    square = reduced.stiffness.diagonal()[own]
    beyond = scipy.sparse.linalg.splu(model.stiffness[dof][:, dof].tocsc()).solve(load)
    beyond -= shapes @ ((shapes.T @ load) / square[:, None])
    both = outward @ beyond / 2
    sag = both[np.arange(n_points), np.arange(n_points) % n_phases].reshape(n_units, -1)
    slope, half = np.gradient(sag, length / n_points, axis=1), length / n_points / 2
    ends = np.arange(n_units)[:, None] * length / n_units + [0.0, length / n_units - 1e-9]
    x, sag, slope = (
        np.column_stack([first, inner, last]).ravel()
        for first, inner, last in (
            (ends[:, 0], x.reshape(n_units, -1), ends[:, 1]),
            (sag[:, 0] - slope[:, 0] * half, sag, sag[:, -1] + slope[:, -1] * half),
            (slope[:, 0], slope, slope[:, -1]),
        )
    )
    return x, sag, slope


def _moving_mean(n_points: int, width: float) -> sp.csr_array:
    """Mean (point, point) over ``width`` neighbouring points, the first next to the last.

    Faces that reach over a pier continue on the next span, which is taken to be the same.
    """
    reach = int(np.ceil(0.5 * width + 0.5))
    offset = np.arange(-reach, reach + 1)
    share = np.clip(0.5 * width + 0.5 - np.abs(offset), 0.0, 1.0) / width
    offset, share = offset[share > 0], share[share > 0]
    share = share / share.sum()
    row = np.repeat(np.arange(n_points), offset.size)
    column = (row + np.tile(offset, n_points)) % n_points
    return sp.csr_array((np.tile(share, n_points), (row, column)), shape=(n_points, n_points))


def reduce(
    model: full.GuidewayModel, cutoff: float, cutoff_elsewhere: float | None = None
) -> ReducedGuideway:
    """Bring the finite-element guideway to component coordinates.

    Parameters
    ----------
    model
        Finite-element guideway.
    cutoff
        Highest mode of the middle span that is kept, and the frequency up to which damping is a
        share of critical [Hz].
    cutoff_elsewhere
        Highest mode of the piers and the other spans, whose responses are not watched [Hz];
        ``None``: as in the middle span.

    Returns
    -------
    reduced
        The same guideway in fewer coordinates.

    References
    ----------
    Craig, Bampton, AIAA J. 6(7):1313-1319 (1968); docs/theory/integration.md.
    """
    if cutoff_elsewhere is None:
        cutoff_elsewhere = cutoff
    n_spans, length = model.parameters.n_spans, model.parameters.span_length
    middle = n_spans // 2
    kinds = [1 if j == middle else 0 for j in range(n_spans)]
    cutoffs = (cutoff_elsewhere, cutoff)
    basis, carried, columns = _basis(model, kinds, cutoffs)
    n_modes = carried.shape[0]
    mass = (basis.T @ model.mass @ basis).tocsr()
    pieces = {kind: _rail_pieces(model, basis, j, columns[j]) for j, kind in enumerate(kinds)}
    at_midspan = [
        (rows @ basis[:, columns[middle]]).toarray().ravel()
        for rows in model.girder_rows(np.array([(middle + 0.5) * length]))
    ]
    stiffness = _pruned((basis.T @ model.stiffness @ basis).tocsr(), 1e-12)
    reduced = ReducedGuideway(
        parameters=model.parameters,
        n_modes=n_modes,
        span_coordinates=tuple(columns),
        top_mass=mass[n_modes:, n_modes:].toarray(),
        stiffness=stiffness,
        carried=carried,
        relative_damping=sp.csr_array(stiffness.shape),
        rail_z=tuple(pieces[kind][0] for kind in kinds),
        rail_roll=tuple(pieces[kind][1] for kind in kinds),
        rail_y=tuple(pieces[kind][2] for kind in kinds),
        midspan_z=at_midspan[0],
        midspan_y=at_midspan[1],
        rest_z=np.empty(0),
        rest_roll=np.empty(0),
        rest_y=np.empty(0),
        bearing=(_bearing_pairs(model, middle) @ basis[:, columns[middle]]).toarray(),
        bearing_rest=np.empty(0),
        basis=basis,
    )
    bearings = (basis.T @ model.bearing_damping @ basis).toarray()
    rest_z, rest_roll, rest_y = _rest_at_midspan(model, reduced)
    bearing_rest = _rest_at_bearings(model, reduced)
    return replace(
        reduced,
        relative_damping=_relative_damping(reduced, bearings, cutoff),
        rest_z=rest_z,
        rest_roll=rest_roll,
        rest_y=rest_y,
        bearing_rest=bearing_rest,
    )


def _component_modes(model: full.GuidewayModel, dof: IntArray, cutoff: float) -> FloatArray:
    """Modes of the component ``dof`` with all other degrees of freedom fixed."""
    stiffness = model.stiffness[dof][:, dof].toarray()
    mass = model.mass[dof][:, dof].toarray()
    limit = (2 * np.pi * cutoff) ** 2
    _, shapes = scipy.linalg.eigh(stiffness, mass, subset_by_value=(-np.inf, limit))
    if shapes.shape[1] == 0:
        return shapes
    peaks = np.abs(shapes).argmax(axis=0)
    return shapes * np.sign(shapes[peaks, np.arange(shapes.shape[1])])


def _basis(
    model: full.GuidewayModel, kinds: list[int], cutoffs: tuple[float, float]
) -> tuple[sp.csr_array, sp.csr_array, list[IntArray]]:
    """Shapes of all coordinates, shares of modes carried by pier tops, columns of each span."""
    n_dof = model.mass.shape[0]
    tops = model.pier_top_dof.reshape(-1)
    parts = [(dof, ("span", kind)) for dof, kind in zip(model.span_dof, kinds, strict=True)]
    parts += [(dof, ("pier", 0)) for dof in model.pier_dof]
    modes: dict[tuple[str, int], FloatArray] = {}  # all parts of a kind are alike
    constraints: dict[tuple[str, int], FloatArray] = {}
    modal, static, carried = [], [], []
    for dof, kind in parts:
        coupling = model.stiffness[dof][:, tops].tocsr()
        touched = np.unique(coupling.indices)
        to_tops = sp.csr_array(
            (np.ones(touched.size), (np.arange(touched.size), touched)),
            shape=(touched.size, tops.size),
        )
        place = sp.csr_array(
            (np.ones(dof.size), (dof, np.arange(dof.size))), shape=(n_dof, dof.size)
        )
        if kind not in modes:
            modes[kind] = _component_modes(model, dof, cutoffs[kind[1]])
            inner = model.stiffness[dof][:, dof].toarray()
            constraints[kind] = -np.linalg.solve(inner, coupling[:, touched].toarray())
        shapes, constraint = modes[kind], constraints[kind]
        inertia = model.mass[dof][:, dof] @ constraint + model.mass[dof][:, tops[touched]]
        share = shapes.T @ inertia
        modal.append(place @ sp.csr_array(shapes))
        static.append(place @ sp.csr_array(constraint - shapes @ share) @ to_tops)
        carried.append(sp.csr_array(share) @ to_tops)
    interface = sp.csr_array(
        (np.ones(tops.size), (tops, np.arange(tops.size))), shape=(n_dof, tops.size)
    )
    basis = sp.hstack([*modal, sum(static, interface)]).tocsr()
    n_modes = sum(part.shape[1] for part in modal)
    columns, start = [], 0
    for j in range(len(kinds)):
        n = modal[j].shape[1]
        own = np.arange(start, start + n)
        columns.append(np.concatenate([own, n_modes + 6 * j + np.arange(12)]))
        start += n
    return basis, _pruned_to(sp.vstack(carried).tocsr(), 1e-9), columns


def _pruned(matrix: sp.csr_array, drop: float) -> sp.csr_array:
    """Drop entries below ``drop`` times the root of their diagonals."""
    coo = matrix.tocoo()
    scale = np.sqrt(np.abs(matrix.diagonal()))
    keep = np.abs(coo.data) > drop * scale[coo.row] * scale[coo.col]
    keep |= coo.row == coo.col
    return sp.csr_array((coo.data[keep], (coo.row[keep], coo.col[keep])), shape=matrix.shape)


def _pruned_to(matrix: sp.csr_array, drop: float) -> sp.csr_array:
    """Drop entries below ``drop`` times the largest of their column."""
    coo = matrix.tocoo()
    largest = np.abs(matrix).max(axis=0).toarray().ravel()
    keep = np.abs(coo.data) > drop * largest[coo.col]
    return sp.csr_array((coo.data[keep], (coo.row[keep], coo.col[keep])), shape=matrix.shape)


def _relative_damping(
    reduced: ReducedGuideway, bearings: FloatArray, cutoff: float
) -> sp.csr_array:
    """Damping matrix: a given share of critical up to the cut-off, a constant rate beyond.

    It acts on relative rates, for which the matrix is closest to diagonal.
    """
    mass = reduced.mass.toarray()
    squares, shapes = scipy.linalg.eigh(reduced.stiffness.toarray(), mass)
    omega = np.sqrt(np.maximum(squares, 0.0))
    rates = 2 * reduced.parameters.damping_ratio * np.minimum(omega, 2 * np.pi * cutoff)
    weighted = mass @ shapes
    damping = (weighted * rates) @ weighted.T + bearings
    absolute = np.eye(mass.shape[0])
    absolute[: reduced.n_modes, reduced.n_modes :] = reduced.carried.toarray()
    relative = absolute.T @ damping @ absolute
    return _pruned(sp.csr_array((relative + relative.T) / 2), DAMPING_DROP)


def rail_nodes_rows(
    model: full.GuidewayModel, span: int
) -> tuple[sp.csr_array, sp.csr_array, sp.csr_array]:
    """Rows (coefficient, dof) that read z, roll and y at the nodes of a span's rails."""
    rail, length = model.parameters.rail, model.parameters.span_length
    n_connectors = rail.connectors_per_unit
    spacing = length / (rail.units_per_span * n_connectors)
    nodes = rail_nodes(n_connectors)
    nodes[-1] -= 1e-9  # just before the joint
    units = n_connectors * np.arange(rail.units_per_span)[:, None]
    x = span * length + spacing * (units + nodes).ravel()
    in_order = np.arange(2 * x.size).reshape(2, -1).T.ravel()  # a node's displacement, its turn

    def of_side(side: int) -> tuple[sp.csr_array, sp.csr_array]:
        z, _, y, _ = model.rail_rows(x, side)
        turn_z, turn_y = model.rail_section_rows(x, side)
        both = (sp.vstack([z, turn_z * spacing]), sp.vstack([y, turn_y * spacing]))
        return both[0].tocsr()[in_order], both[1].tocsr()[in_order]

    (right_z, right_y), (left_z, left_y) = of_side(1), of_side(-1)
    return (right_z + left_z) / 2, (right_z - left_z) / 2, (right_y + left_y) / 2


def _rest_at_midspan(
    model: full.GuidewayModel, reduced: ReducedGuideway
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Flexibility of midspan to forces on the rails of the middle span by left-out modes [m/N].

    z under forces on the coefficients of z, y under forces on those of roll and of y.
    """
    middle = model.parameters.n_spans // 2
    at = np.array([(middle + 0.5) * model.parameters.span_length])
    up, across = (_left_out(model, reduced, row)[0] for row in model.girder_rows(at))
    z, roll, y = (rows[:, model.span_dof[middle]] for rows in rail_nodes_rows(model, middle))
    return z @ up, roll @ across, y @ across


def _left_out(
    model: full.GuidewayModel, reduced: ReducedGuideway, rows: sp.csr_array
) -> FloatArray:
    """Motion (row, dof of the span) of places in the middle span under a unit force on each of its
    degrees of freedom, by the modes that it leaves out; its pier tops stand still."""
    middle = model.parameters.n_spans // 2
    dof, own = model.span_dof[middle], reduced.own_modes(middle)
    shapes = reduced.basis[dof][:, own].toarray()
    square = reduced.stiffness.diagonal()[own]
    factors = scipy.sparse.linalg.splu(model.stiffness[dof][:, dof].tocsc())
    found = []
    for here in rows[:, dof].toarray():
        found.append(factors.solve(here) - shapes @ (shapes.T @ here / square))
    return np.stack(found)


def _bearing_pairs(model: full.GuidewayModel, span: int) -> sp.csr_array:
    """Rows (4, dof): at either end of a span the mean opening of its two bearings, and half the
    difference."""
    right_and_left = 0.5 * np.array([[1.0, 1.0], [1.0, -1.0]])
    return sp.csr_array(sp.block_diag([right_and_left] * 2) @ model.bearing_rows(span))


def _rest_at_bearings(model: full.GuidewayModel, reduced: ReducedGuideway) -> FloatArray:
    """Flexibility of the middle span's bearings by left-out modes (6, coefficient) [m/N]."""
    middle = model.parameters.n_spans // 2
    left_out = _left_out(model, reduced, _bearing_pairs(model, middle))
    z, roll, y = (rows[:, model.span_dof[middle]] for rows in rail_nodes_rows(model, middle))
    pairs = ((left_out[0], left_out[1]), (left_out[2], left_out[3]))
    return np.stack([one for mean, half in pairs for one in (z @ mean, roll @ half, y @ half)])


def _rail_pieces(
    model: full.GuidewayModel,
    basis: sp.csr_array,
    span: int,
    columns: IntArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Coefficients (column, coefficient) of the rails' z, roll and y along one span."""
    shapes = basis[:, columns].toarray()
    return tuple((rows @ shapes).T for rows in rail_nodes_rows(model, span))
