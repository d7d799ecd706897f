"""The guideway by its components: each span's own modes plus the pier tops that neighbours share.

Craig-Bampton with the interface shapes made mass-orthogonal to the component modes, so that the
mass matrix is the identity on the modes and banded on the pier tops.  Every coordinate belongs to
one span or one pier: no mode runs through the whole line, and cost grows with its length only where
the train is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.linalg
import scipy.sparse as sp

from maglev.mechanics import guideway as full
from maglev.parameters import Guideway

Array = npt.NDArray[np.float64]

SPLINE_INTERVALS = 16
"""Intervals of the cubic B-splines that carry the rails' motion along a span [-]; assumed, checked
in the convergence table."""

DAMPING_SPANS = 9
"""Spans of the line whose damping matrix is formed exactly; a longer line repeats its middle [-];
assumed, checked in the tests."""

DAMPING_DROP = 1e-4
"""Entries of the damping matrix below this share of their diagonals are dropped [-]; assumed,
checked in the tests against the damping ratio of every mode."""


@dataclass(frozen=True)
class ReducedGuideway:
    """Guideway in component coordinates: modes of spans, modes of piers, pier tops, in this order.

    Attributes
    ----------
    n_modes
        Coordinates with unit mass; the remaining ones are pier tops, six each.
    span_coordinates : (span, column)
        Coordinates that move span j: its modes, then its two pier tops.
    top_mass : (6 pier, 6 pier)
        Banded mass matrix of the pier tops [kg, kg m, kg m²].
    stiffness, damping : (coordinate, coordinate)
        Sparse.
    rail_z, rail_roll, rail_y : (coefficient, column)
        B-spline coefficients along a span of a rail's vertical motion on the centre line, of the
        roll times the rail's distance from it, and of its lateral motion, per unit coordinate.
    midspan_z, midspan_y : (column,)
        Motion of the girder axis at midspan per unit coordinate.
    basis : (dof, coordinate)
        Motion of the finite-element model per unit coordinate.
    """

    parameters: Guideway
    n_modes: int
    span_coordinates: npt.NDArray[np.int64]
    top_mass: Array
    stiffness: sp.csr_matrix
    damping: sp.csr_matrix
    rail_z: Array
    rail_roll: Array
    rail_y: Array
    midspan_z: Array
    midspan_y: Array
    basis: sp.csr_matrix

    @property
    def n_coordinates(self) -> int:
        """Number of coordinates [-]."""
        return int(self.stiffness.shape[0])

    @property
    def mass(self) -> sp.csr_matrix:
        """Mass matrix (coordinate, coordinate)."""
        return sp.block_diag([sp.eye(self.n_modes), self.top_mass], format="csr")


def spline_weights(u: Array) -> Array:
    """Weights of the four uniform cubic B-splines that live on an interval.

    Parameters
    ----------
    u : (point,)
        Place in the interval, 0 to 1 [-].

    Returns
    -------
    weights : (point, 4)
        Sum to one [-].

    References
    ----------
    de Boor, A Practical Guide to Splines (2001), ch. X.
    """
    v = 1.0 - u
    return np.stack([v**3, 3 * u**3 - 6 * u**2 + 4, 3 * v**3 - 6 * v**2 + 4, u**3], axis=-1) / 6.0


def reduce(model: full.GuidewayModel, cutoff: float) -> ReducedGuideway:
    """Bring the finite-element guideway to component coordinates.

    Parameters
    ----------
    model
        Finite-element guideway.
    cutoff
        Highest component frequency that is kept, and the frequency up to which damping is a
        share of critical [Hz].

    Returns
    -------
    reduced
        The same guideway in fewer coordinates.

    References
    ----------
    Craig, Bampton, AIAA J. 6(7):1313-1319 (1968).
    """
    basis, n_modes, columns = _basis(model, cutoff)
    mass = (basis.T @ model.mass @ basis).tocsr()
    stiffness = _pruned((basis.T @ model.stiffness @ basis).tocsr())
    rail_z, rail_roll, rail_y = _rail_splines(model, basis, columns[0])
    n_spans, length = model.parameters.n_spans, model.parameters.span_length
    middle = n_spans // 2
    at_midspan = [
        (rows @ basis[:, columns[middle]]).toarray().ravel()
        for rows in model.girder_rows(np.array([(middle + 0.5) * length]))
    ]
    return ReducedGuideway(
        parameters=model.parameters,
        n_modes=n_modes,
        span_coordinates=columns,
        top_mass=mass[n_modes:, n_modes:].toarray(),
        stiffness=stiffness,
        damping=_damping(model, basis, n_modes, columns, cutoff),
        rail_z=rail_z,
        rail_roll=rail_roll,
        rail_y=rail_y,
        midspan_z=at_midspan[0],
        midspan_y=at_midspan[1],
        basis=basis,
    )


def _component_modes(
    model: full.GuidewayModel, dof: npt.NDArray[np.int64], cutoff: float
) -> tuple[Array, Array]:
    """Modes of the component ``dof`` with everything else held, and its circular frequencies."""
    stiffness = model.stiffness[dof][:, dof].toarray()
    mass = model.mass[dof][:, dof].toarray()
    limit = (2 * np.pi * cutoff) ** 2
    squares, shapes = scipy.linalg.eigh(stiffness, mass, subset_by_value=(-np.inf, limit))
    peaks = np.abs(shapes).argmax(axis=0)
    signs = np.sign(shapes[peaks, np.arange(shapes.shape[1])])
    return shapes * signs, np.sqrt(squares)


def _basis(
    model: full.GuidewayModel, cutoff: float
) -> tuple[sp.csr_matrix, int, npt.NDArray[np.int64]]:
    n_dof = model.mass.shape[0]
    tops = model.pier_top_dof.reshape(-1)
    components = [*model.span_dof, *model.pier_dof]
    modes: dict[int, Array] = {}  # by the component's kind: all spans are alike, and all piers
    solved: dict[int, Array] = {}
    blocks, rows, cols = [], [], []
    interface = sp.lil_matrix((n_dof, tops.size))
    interface[tops, np.arange(tops.size)] = 1.0
    interface = interface.tocsr()
    static = sp.csr_matrix((n_dof, tops.size))
    start = 0
    n_span_modes = 0
    for number, dof in enumerate(components):
        kind = 0 if number < len(model.span_dof) else 1
        if kind not in modes:
            modes[kind] = _component_modes(model, dof, cutoff)[0]
        shapes = modes[kind]
        coupling = model.stiffness[dof][:, tops]
        touched = np.unique(coupling.tocoo().col)
        if kind not in solved:
            inner = model.stiffness[dof][:, dof].toarray()
            solved[kind] = -np.linalg.solve(inner, coupling[:, touched].toarray())
        constraint = solved[kind]
        # Take the component's own modes out of the constraint shapes: no mass coupling remains.
        inertia = model.mass[dof][:, dof] @ constraint + model.mass[dof][:, tops[touched]]
        constraint = constraint - shapes @ (shapes.T @ inertia)
        grid = np.meshgrid(dof, touched, indexing="ij")
        static = static + sp.csr_matrix(
            (constraint.ravel(), (grid[0].ravel(), grid[1].ravel())), shape=static.shape
        )
        n = shapes.shape[1]
        grid = np.meshgrid(dof, np.arange(start, start + n), indexing="ij")
        blocks.append(shapes.ravel())
        rows.append(grid[0].ravel())
        cols.append(grid[1].ravel())
        start += n
        if kind == 0:
            n_span_modes = n
    modal = sp.csr_matrix(
        (np.concatenate(blocks), (np.concatenate(rows), np.concatenate(cols))),
        shape=(n_dof, start),
    )
    basis = sp.hstack([modal, interface + static]).tocsr()
    n_spans = model.parameters.n_spans
    columns = np.array(
        [
            [
                *range(j * n_span_modes, (j + 1) * n_span_modes),
                *range(start + 6 * j, start + 6 * j + 12),
            ]
            for j in range(n_spans)
        ]
    )
    return basis, start, columns


def _pruned(matrix: sp.csr_matrix, drop: float = 1e-12) -> sp.csr_matrix:
    """Drop what rounding left: entries below ``drop`` times the root of their diagonals."""
    coo = matrix.tocoo()
    scale = np.sqrt(np.abs(matrix.diagonal()))
    keep = np.abs(coo.data) > drop * scale[coo.row] * scale[coo.col]
    return sp.csr_matrix((coo.data[keep], (coo.row[keep], coo.col[keep])), shape=matrix.shape)


def _damping(
    model: full.GuidewayModel,
    basis: sp.csr_matrix,
    n_modes: int,
    columns: npt.NDArray[np.int64],
    cutoff: float,
) -> sp.csr_matrix:
    n_spans = model.parameters.n_spans
    if n_spans <= DAMPING_SPANS:
        return _exact_damping(model, basis, cutoff)
    short_model = full.build(model.parameters.model_copy(update={"n_spans": DAMPING_SPANS}))
    short_basis, short_modes, short_columns = _basis(short_model, cutoff)
    short = _exact_damping(short_model, short_basis, cutoff).tocoo()
    # Which component (span, pier, pier top) each coordinate of the short line belongs to.
    n = columns.shape[1] - 12
    short_place = _places(short_columns, short_modes, n, DAMPING_SPANS)
    place = _places(columns, n_modes, n, n_spans)
    lookup = {tuple(p): i for i, p in enumerate(place)}
    half = DAMPING_SPANS // 2
    data: dict[tuple[int, int], float] = {}
    for i, j, value in zip(short.row, short.col, short.data, strict=True):
        (kind_i, at_i, k_i), (kind_j, at_j, k_j) = short_place[i], short_place[j]
        last = DAMPING_SPANS if kind_i else DAMPING_SPANS - 1
        if at_i < half:
            targets = [0]
        elif last - at_i < half:
            targets = [n_spans - DAMPING_SPANS]
        elif at_i == half:
            targets = list(range(n_spans - DAMPING_SPANS + 1))
        else:
            targets = [n_spans - DAMPING_SPANS]
        for shift in targets:
            row = lookup.get((kind_i, at_i + shift, k_i))
            col = lookup.get((kind_j, at_j + shift, k_j))
            if row is not None and col is not None:
                data[row, col] = value
    index = np.array(list(data))
    matrix = sp.csr_matrix(
        (np.array(list(data.values())), (index[:, 0], index[:, 1])), shape=(basis.shape[1],) * 2
    )
    return ((matrix + matrix.T) / 2).tocsr()


def _places(
    columns: npt.NDArray[np.int64], n_modes: int, n_span_modes: int, n_spans: int
) -> list[tuple[int, int, int]]:
    """(kind, number along the line, index within) of every coordinate."""
    places = [(0, j, k) for j in range(n_spans) for k in range(n_span_modes)]
    n_pier_modes = (n_modes - n_spans * n_span_modes) // (n_spans + 1)
    places += [(1, j, k) for j in range(n_spans + 1) for k in range(n_pier_modes)]
    places += [(2, j, k) for j in range(n_spans + 1) for k in range(6)]
    return places


def _exact_damping(model: full.GuidewayModel, basis: sp.csr_matrix, cutoff: float) -> sp.csr_matrix:
    """A set share of critical in every mode up to the cut-off, its absolute rate beyond."""
    mass = (basis.T @ model.mass @ basis).toarray()
    stiffness = (basis.T @ model.stiffness @ basis).toarray()
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    omega = np.sqrt(np.maximum(squares, 0.0))
    ratio, corner = model.parameters.damping_ratio, 2 * np.pi * cutoff
    rates = 2 * ratio * np.minimum(omega, corner)
    weighted = mass @ shapes
    damping = (weighted * rates) @ weighted.T
    damping += (basis.T @ model.bearing_damping @ basis).toarray()
    damping = (damping + damping.T) / 2
    return _pruned(sp.csr_matrix(damping), DAMPING_DROP)


def _rail_splines(
    model: full.GuidewayModel, basis: sp.csr_matrix, columns: npt.NDArray[np.int64]
) -> tuple[Array, Array, Array]:
    length = model.parameters.span_length
    n = SPLINE_INTERVALS
    x = (np.arange(24 * n) + 0.5) * (length / (24 * n))
    interval = np.floor(x / length * n).astype(int)
    design = np.zeros((x.size, n + 3))
    weights = spline_weights(x / length * n - interval)
    np.put_along_axis(design, interval[:, None] + np.arange(4), weights, axis=1)
    fit = np.linalg.pinv(design)
    sides = []
    for side in (1, -1):
        rows = model.rail_rows(x, side)
        sides.append([(rows[k] @ basis[:, columns]).toarray() for k in (0, 2)])
    (right_z, right_y), (left_z, left_y) = sides
    z, roll, y = (right_z + left_z) / 2, (right_z - left_z) / 2, (right_y + left_y) / 2
    return fit @ z, fit @ roll, fit @ y
