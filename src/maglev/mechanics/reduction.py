"""The guideway by its components: each span's own modes plus the pier tops that neighbours share.

Craig-Bampton with the interface shapes made mass-orthogonal to the component modes, so that the
mass matrix is the identity on the modes and banded on the pier tops.  Every coordinate belongs to
one span or one pier: no mode runs through the whole line, and cost grows with its length only where
the train is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy.linalg
import scipy.sparse as sp

from maglev.mechanics import guideway as full
from maglev.parameters import Guideway

Array = npt.NDArray[np.float64]

DAMPING_DROP = 1e-3
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
        Share of a pier top's motion that a component mode takes along; sparse.  Without it a mode's
        coordinate is its motion relative to the pier tops.
    relative_damping : (coordinate, coordinate)
        Acts on the relative rates of the modes and the rates of the pier tops; sparse.
    rail_z, rail_roll, rail_y : span of (column, coefficient)
        Hermite coefficients along a span of a rail's vertical motion on the centre line, of the
        roll times the rail's distance from it, and of its lateral motion, per unit coordinate:
        value and slope times connector spacing at the nodes of each unit, its ends and connectors.
    midspan_z, midspan_y : (column,)
        Motion of the middle span's girder axis at midspan per unit coordinate.
    basis : (dof, coordinate)
        Motion of the finite-element model per unit coordinate.
    """

    parameters: Guideway
    n_modes: int
    span_coordinates: tuple[npt.NDArray[np.int64], ...]
    top_mass: Array
    stiffness: sp.csr_array
    carried: sp.csr_array
    relative_damping: sp.csr_array
    rail_z: tuple[Array, ...]
    rail_roll: tuple[Array, ...]
    rail_y: tuple[Array, ...]
    midspan_z: Array
    midspan_y: Array
    basis: sp.csr_array

    @property
    def n_coordinates(self) -> int:
        """Number of coordinates [-]."""
        return int(self.stiffness.shape[0])

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


def rail_nodes(n_connectors: int) -> Array:
    """Ends and connectors of a unit of rail, from its start in connector spacings (node,) [-].

    Between them the rail is a beam without loads but the poles': cubic pieces from node to node
    follow it, and none bridges the joint of two units.  Units join with a kink, and poles that pass
    kinks one after the other shake the guideway at the rate of pole passing.
    """
    return np.concatenate([[0.0], np.arange(n_connectors) + 0.5, [float(n_connectors)]])


def hermite_weights(u: Array) -> Array:
    """Weights of value and slope at the start, value and slope at the end, of a cubic piece.

    Parameters
    ----------
    u : (point,)
        Place in the piece, 0 to 1 [-].

    Returns
    -------
    weights : (point, 4)
        Slopes count per piece length [-].
    """
    v = 1.0 - u
    return np.stack([(1 + 2 * u) * v**2, u * v**2, u**2 * (3 - 2 * u), -(u**2) * v], axis=-1)


def hermite_slopes(u: Array) -> Array:
    """Derivatives of `hermite_weights` with respect to the place in the piece (point, 4) [-]."""
    v = 1.0 - u
    return np.stack([-6 * u * v, v * (1 - 3 * u), 6 * u * v, u * (3 * u - 2)], axis=-1)


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
        Highest mode of the piers and the other spans, whose own motion nobody asks for [Hz];
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
        basis=basis,
    )
    bearings = (basis.T @ model.bearing_damping @ basis).toarray()
    return replace(reduced, relative_damping=_relative_damping(reduced, bearings, cutoff))


def _component_modes(model: full.GuidewayModel, dof: npt.NDArray[np.int64], cutoff: float) -> Array:
    """Modes of the component ``dof`` with everything else held."""
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
) -> tuple[sp.csr_array, sp.csr_array, list[npt.NDArray[np.int64]]]:
    """Shapes of all coordinates, what the modes take along, and the columns of each span."""
    n_dof = model.mass.shape[0]
    tops = model.pier_top_dof.reshape(-1)
    parts = [(dof, ("span", kind)) for dof, kind in zip(model.span_dof, kinds, strict=True)]
    parts += [(dof, ("pier", 0)) for dof in model.pier_dof]
    modes: dict[tuple[str, int], Array] = {}  # all parts of a kind are alike
    constraints: dict[tuple[str, int], Array] = {}
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
    return basis, _pruned_to(sp.vstack(carried).tocsr(), 1e-12), columns


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


def _relative_damping(reduced: ReducedGuideway, bearings: Array, cutoff: float) -> sp.csr_array:
    """A set share of critical in every mode up to the cut-off, its absolute rate beyond.

    Acts on relative rates, where the matrix is closest to its diagonal.
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


def _rail_pieces(
    model: full.GuidewayModel,
    basis: sp.csr_array,
    span: int,
    columns: npt.NDArray[np.int64],
) -> tuple[Array, Array, Array]:
    """Coefficients (column, coefficient) of the rails' z, roll and y along one span."""
    rail, length = model.parameters.rail, model.parameters.span_length
    n_connectors = rail.connectors_per_unit
    spacing = length / (rail.units_per_span * n_connectors)
    nodes = rail_nodes(n_connectors)
    nodes[-1] -= 1e-9  # just before the joint
    units = n_connectors * np.arange(rail.units_per_span)[:, None]
    x = span * length + spacing * (units + nodes).ravel()
    right_z, right_slope_z, right_y, right_slope_y = model.rail_rows(x, 1)
    left_z, left_slope_z, left_y, left_slope_y = model.rail_rows(x, -1)
    shapes = basis[:, columns].toarray()

    def coefficients(value: sp.csr_array, slope: sp.csr_array) -> Array:
        ends = np.stack([value @ shapes, slope @ shapes * spacing], axis=1)
        return ends.reshape(-1, columns.size).T / 2

    return (
        coefficients(right_z + left_z, right_slope_z + left_slope_z),
        coefficients(right_z - left_z, right_slope_z - left_slope_z),
        coefficients(right_y + left_y, right_slope_y + left_slope_y),
    )
