"""The guideway by its components: what it keeps of the finite elements, and what it may lose."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose
from scipy.sparse.linalg import spsolve

from maglev.mechanics import guideway as full
from maglev.mechanics.reduction import rail_weights, reduce, standing_sag
from maglev.mechanics.step_limit import step_response
from maglev.parameters import Bearing, Guideway, Passage

CUTOFF, ELSEWHERE = Passage().mode_cutoff, Passage().mode_cutoff_elsewhere
LENGTH = Guideway().span_length
THREE_SPANS = full.build(Guideway(n_spans=3))
REDUCED = reduce(THREE_SPANS, CUTOFF, ELSEWHERE)
MIDDLE = 1
LOAD = 25e3  # N/m, about a train's weight


def undamped(reduced):
    """Frequencies [Hz] and shapes of unit mass."""
    squares, shapes = scipy.linalg.eigh(reduced.stiffness.toarray(), reduced.mass.toarray())
    return np.sqrt(squares) / (2 * np.pi), shapes


def damped(reduced):
    """Frequencies [Hz] and damping ratios of the modes that swing, from the complex roots."""
    n = reduced.n_coordinates
    mass, damping, stiffness = (
        matrix.toarray() for matrix in (reduced.mass, reduced.damping, reduced.stiffness)
    )
    state = np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)],
        ]
    )
    roots = np.linalg.eigvals(state)
    roots = roots[roots.imag > 0]
    return np.abs(roots) / (2 * np.pi), -roots.real / np.abs(roots)


def places(n):
    """Midpoints of ``n`` equal parts of a span [m]."""
    return (np.arange(n) + 0.5) * LENGTH / n


def rail_design(x, *, lateral=False):
    """Weight of each rail coefficient at places along a span."""
    first, weights, _ = rail_weights(Guideway(), x, lateral=lateral)
    design = np.zeros((x.size, REDUCED.rail_z[0].shape[1]))
    np.put_along_axis(design, first[:, None] + np.arange(4), weights, axis=1)
    return design


def uniform_load(model):
    """Forces of a uniform load on both rails of all spans."""
    x = np.concatenate([places(800) + j * LENGTH for j in range(model.parameters.n_spans)])
    force = np.full(x.size, LOAD / 2 * LENGTH / 800)
    return sum(model.rail_rows(x, side)[0].T @ force for side in (1, -1))


def midspan_deflection(reduced, force):
    """Of the middle span under static forces on the finite-element model [m]."""
    motion = spsolve(reduced.stiffness.tocsc(), reduced.basis.T @ force)
    return reduced.midspan_z @ motion[reduced.span_coordinates[MIDDLE]]


STATIC = spsolve(THREE_SPANS.stiffness.tocsc(), uniform_load(THREE_SPANS))
STATIC_MIDSPAN = (THREE_SPANS.girder_rows([(MIDDLE + 0.5) * LENGTH])[0] @ STATIC)[0]


def test_modes_have_unit_mass_and_share_none_with_the_pier_tops():
    basis, n = REDUCED.basis, REDUCED.n_modes
    mass = (basis.T @ THREE_SPANS.mass @ basis).toarray()
    assert_allclose(mass[:n, :n], np.eye(n), atol=1e-10)
    scale = np.sqrt(mass.diagonal())
    assert np.abs(mass[:n, n:] / scale[n:]).max() < 1e-10
    assert_allclose(mass[n:, n:], REDUCED.top_mass, rtol=1e-12, atol=1e-10 * mass.max())
    assert np.linalg.eigvalsh(REDUCED.top_mass).min() > 0
    i, j = np.nonzero(REDUCED.top_mass)
    assert np.abs(i - j).max() < 12  # a pier top meets its neighbours alone


def test_stiffness_is_symmetric_and_that_of_the_finite_elements_in_the_basis():
    stiffness = REDUCED.stiffness.toarray()
    scale = np.sqrt(np.outer(stiffness.diagonal(), stiffness.diagonal()))
    assert_allclose(stiffness / scale, stiffness.T / scale, atol=1e-11)
    exact = (REDUCED.basis.T @ THREE_SPANS.stiffness @ REDUCED.basis).toarray()
    assert_allclose(stiffness / scale, exact / scale, atol=1e-11)
    assert np.linalg.eigvalsh(stiffness / scale).min() > 0


def test_no_mode_leaves_its_span_or_pier():
    for j, columns in enumerate(REDUCED.span_coordinates):
        own = columns[columns < REDUCED.n_modes]
        moved = np.unique(REDUCED.basis[:, own].tocoo().coords[0])
        assert np.isin(moved, THREE_SPANS.span_dof[j]).all()
        tops = columns[columns >= REDUCED.n_modes] - REDUCED.n_modes
        assert_allclose(tops, 6 * j + np.arange(12))


def test_frequencies_are_those_of_the_finite_elements():
    """Within 0.1 % below 50 Hz and 0.3 % below 100 Hz, but for a few modes off the rails.

    A mode leaves the rails at rest where piers or girders stretch and sway along the line; the
    train does not feel it.
    """
    expected, shapes = full.modes(THREE_SPANS, 100.0)
    found = undamped(REDUCED)[0]
    assert (found < 100.0).sum() == expected.size
    error = found[: expected.size] / expected - 1
    x = np.concatenate([places(64) + j * LENGTH for j in range(3)])
    u_z, _, u_y, _ = THREE_SPANS.rail_rows(x, 1)
    motion = np.abs(np.vstack([u_z @ shapes, u_y @ shapes])).max(axis=0)
    felt = motion > 0.05 * motion.max()
    assert error[felt & (expected < 50.0)].max() < 1e-3
    assert error[felt].max() < 3e-3
    assert error.max() < 1e-2
    assert error.min() > -1e-9  # coordinates left out can only stiffen


def test_frequencies_come_closer_with_the_cutoff_elsewhere():
    expected = full.modes(THREE_SPANS, 100.0)[0]
    errors = [
        (undamped(reduce(THREE_SPANS, CUTOFF, elsewhere))[0][: expected.size] / expected - 1).max()
        for elsewhere in (150.0, ELSEWHERE, 2000.0)
    ]
    assert errors[2] < 1e-3 < errors[1] < errors[0]


def test_every_mode_below_the_cutoff_has_the_damping_of_the_configuration():
    """Bearings without damping of their own, which comes on top."""
    model = full.build(Guideway(n_spans=3, bearing=Bearing(damping="0 N s/m")))
    frequency, ratio = damped(reduce(model, CUTOFF, ELSEWHERE))
    below = frequency < 0.99 * CUTOFF
    assert below.sum() > 100
    assert_allclose(ratio[below], 0.025, rtol=2e-2)
    assert_allclose(ratio[frequency < 100.0], 0.025, rtol=5e-3)


def test_bearings_damp_on_top_what_they_damp_in_the_finite_elements():
    model = full.build(Guideway(n_spans=3, bearing=Bearing(damping="0 N s/m")))
    bare = reduce(model, CUTOFF, ELSEWHERE)
    shapes = undamped(REDUCED)[1]
    added = np.einsum("ik,ij,jk->k", shapes, (REDUCED.damping - bare.damping).toarray(), shapes)
    moved = REDUCED.basis @ shapes
    expected = np.einsum("ik,ik->k", moved, THREE_SPANS.bearing_damping @ moved)
    rate = np.einsum("ik,ij,jk->k", shapes, REDUCED.damping.toarray(), shapes)
    assert np.abs((added - expected) / rate).max() < 5e-3
    assert (expected / rate).max() > 0.2


def test_damping_takes_energy_from_every_motion_and_keeps_its_absolute_rate_beyond_the_cutoff():
    low = reduce(THREE_SPANS, 60.0, ELSEWHERE)
    for reduced in (REDUCED, low):
        damping = reduced.damping.toarray()
        assert_allclose(damping, damping.T, atol=1e-12 * np.abs(damping).max())
        assert np.linalg.eigvalsh(damping).min() > 0
    model = full.build(Guideway(n_spans=3, bearing=Bearing(damping="0 N s/m")))
    frequency, ratio = damped(reduce(model, 60.0, ELSEWHERE))
    beyond = (frequency > 61.0) & (frequency < ELSEWHERE)
    assert beyond.sum() > 10
    assert_allclose(ratio[beyond] * frequency[beyond], 0.025 * 60.0, rtol=2e-2)


def test_static_deflection_under_a_uniform_load_is_that_of_the_finite_elements():
    assert 1.4e-3 < STATIC_MIDSPAN < 1.8e-3  # m
    assert_allclose(
        midspan_deflection(REDUCED, uniform_load(THREE_SPANS)), STATIC_MIDSPAN, rtol=1e-3
    )


def test_static_deflection_hangs_on_no_cutoff():
    force = uniform_load(THREE_SPANS)
    chosen = midspan_deflection(REDUCED, force)
    for cutoffs in ((CUTOFF, CUTOFF), (CUTOFF, 60.0), (200.0, ELSEWHERE)):
        other = midspan_deflection(reduce(THREE_SPANS, *cutoffs), force)
        assert_allclose(other, chosen, rtol=2e-4)
    elsewhere = midspan_deflection(reduce(THREE_SPANS, CUTOFF, CUTOFF), force)
    assert_allclose(elsewhere, chosen, rtol=1e-5)


def test_a_load_on_the_pieces_of_rail_deflects_like_a_load_on_the_rails():
    force = np.zeros(REDUCED.n_coordinates)
    pattern = rail_design(places(800)).sum(axis=0) * LOAD * LENGTH / 800
    for columns, shape in zip(REDUCED.span_coordinates, REDUCED.rail_z, strict=True):
        force[columns] += shape @ pattern
    motion = spsolve(REDUCED.stiffness.tocsc(), force)
    deflection = REDUCED.midspan_z @ motion[REDUCED.span_coordinates[MIDDLE]]
    assert_allclose(deflection, STATIC_MIDSPAN, rtol=1e-3)


@pytest.mark.parametrize("name", ["rail_z", "rail_roll", "rail_y"])
def test_pieces_carry_the_rails_motion_in_every_coordinate(name):
    """Between its nodes a rail is a beam element, so nothing is lost, jumps at joints included."""
    x = places(960)
    design = rail_design(x, lateral=name == "rail_y")
    for j in range(3):
        right, left = (THREE_SPANS.rail_rows(x + j * LENGTH, side) for side in (1, -1))
        rows = {
            "rail_z": (right[0] + left[0]) / 2,
            "rail_roll": (right[0] - left[0]) / 2,
            "rail_y": (right[2] + left[2]) / 2,
        }[name]
        columns = REDUCED.span_coordinates[j]
        exact = rows @ REDUCED.basis[:, columns].toarray()
        found = design @ getattr(REDUCED, name)[j].T
        assert_allclose(found, exact, rtol=0, atol=1e-7 * np.abs(exact).max())


def test_pieces_carry_the_rails_deflection_under_a_uniform_load():
    x = places(960)
    motion = spsolve(REDUCED.stiffness.tocsc(), REDUCED.basis.T @ uniform_load(THREE_SPANS))
    for j, columns in enumerate(REDUCED.span_coordinates):
        found = rail_design(x) @ (REDUCED.rail_z[j].T @ motion[columns])
        exact = THREE_SPANS.rail_rows(x + j * LENGTH, 1)[0] @ STATIC
        assert np.abs(found - exact).max() < 1e-3 * exact.max()


@pytest.mark.parametrize("lateral", [False, True])
def test_slopes_of_the_pieces_are_derivatives_of_their_weights(lateral):
    x, h = places(411), 1e-6
    first, _, slope = rail_weights(Guideway(), x, lateral=lateral)
    ahead, behind = (rail_weights(Guideway(), x + d, lateral=lateral) for d in (h, -h))
    inside = (ahead[0] == first) & (behind[0] == first)
    assert inside.sum() > 400
    found = (ahead[1] - behind[1])[inside] / (2 * h)
    assert_allclose(slope[inside], found, atol=1e-7 * np.abs(found).max())


@pytest.mark.parametrize(("lateral", "pitch", "row"), [(False, 0.258, 0), (True, 1.032, 2)])
def test_standing_sag_completes_the_deflection_under_a_row_of_poles(lateral, pitch, row):
    """Static motion of the rails at the poles: all of it is in the modes or in the sag."""
    force, start, n = 4e3, 0.3 * pitch, round(LENGTH / pitch)
    x = start + pitch * np.arange(n)
    rows = [THREE_SPANS.rail_rows(x + MIDDLE * LENGTH, side)[row] for side in (1, -1)]
    outward = rows[0] - rows[1] if lateral else rows[0] + rows[1]
    load = force * (outward.T @ np.ones(n))
    exact = outward @ spsolve(THREE_SPANS.stiffness.tocsc(), load) / 2
    motion = spsolve(REDUCED.stiffness.tocsc(), REDUCED.basis.T @ load)
    kept = outward @ (REDUCED.basis @ motion) / 2
    at, sag, slope = standing_sag(THREE_SPANS, REDUCED, MIDDLE, force, pitch, lateral=lateral)
    found = kept + np.interp(x, at, sag)
    assert np.abs(exact - kept).max() > 1e-8
    assert_allclose(found, exact, atol=0.02 * np.abs(exact - kept).max())
    inner = np.flatnonzero(np.diff(at) > 1e-4)  # not across a joint
    rise = (np.diff(sag) / np.diff(at))[inner]
    error = np.abs(rise - (slope[inner] + slope[inner + 1]) / 2)
    assert np.quantile(error, 0.9) < 0.02 * np.abs(slope).max()  # connectors have kinks


@pytest.mark.parametrize(("direction", "name"), [(0, "rest_z"), (1, "rest_y")])
def test_the_rest_completes_the_static_motion_of_midspan(direction, name):
    """A force on one rail beside midspan: what the modes leave out is in the rest."""
    x, side, force = np.array([0.53 * LENGTH]), 1, 1e5
    load = force * THREE_SPANS.rail_rows(MIDDLE * LENGTH + x, side)[2 * direction].toarray().ravel()
    here = THREE_SPANS.girder_rows([(MIDDLE + 0.5) * LENGTH])[direction].toarray().ravel()
    exact = here @ spsolve(THREE_SPANS.stiffness.tocsc(), load)
    kept = here @ (REDUCED.basis @ spsolve(REDUCED.stiffness.tocsc(), REDUCED.basis.T @ load))
    design = rail_design(x, lateral=direction == 1)[0]
    rest = force * (getattr(REDUCED, name) @ design)
    assert abs(exact - kept) > 1e-5 * abs(exact)
    assert_allclose(kept + rest, exact, rtol=1e-9)


@pytest.mark.parametrize(("row", "both"), [(0, False), (2, True)])
def test_the_rest_completes_the_static_opening_of_the_bearings(row, both):
    """A force down on the right rail, or sideways on both: each of the four bearings."""
    x, force = np.array([0.31 * LENGTH]), 1e5
    sides = (1, -1) if both else (1,)
    load = sum(
        force * THREE_SPANS.rail_rows(MIDDLE * LENGTH + x, side)[row].toarray().ravel()
        for side in sides
    )
    exact = THREE_SPANS.bearing_rows(MIDDLE) @ spsolve(THREE_SPANS.stiffness.tocsc(), load)
    motion = spsolve(REDUCED.stiffness.tocsc(), REDUCED.basis.T @ load)
    kept = REDUCED.bearing @ motion[REDUCED.span_coordinates[MIDDLE]]
    up, across = rail_design(x)[0], rail_design(x, lateral=True)[0]
    rest = np.zeros(4)
    for end in range(2):
        mean, roll, lateral = REDUCED.bearing_rest[3 * end : 3 * end + 3]
        rest[2 * end] = 0.0 if both else force * (mean @ up)
        rest[2 * end + 1] = 2 * force * (lateral @ across) if both else force * (roll @ up)
    pairs = kept + rest
    found = np.array([pairs[0] + pairs[1], pairs[0] - pairs[1]])
    found = np.concatenate([found, [pairs[2] + pairs[3], pairs[2] - pairs[3]]])
    assert np.abs(rest).max() > 1e-2 * np.abs(exact).max()
    assert_allclose(found, exact, rtol=1e-7, atol=1e-9 * np.abs(exact).max())


@pytest.mark.parametrize("step", [0.1e-3, 0.36e-3, 2e-3])
def test_the_stepped_share_of_the_acceleration_makes_an_isolated_mode_exact(step):
    """x(t + Δt) - 2 x + x(t - Δt) = Δt² sinc²(ωΔt/2) (f - ω² x), also for ωΔt beyond 2."""
    response = step_response(REDUCED, step)
    omega = np.sqrt(REDUCED.stiffness.diagonal()[: REDUCED.n_modes])
    force, amplitude, phase = 3.0, 0.7, 0.4

    def exact(t):
        return force / omega**2 + amplitude * np.cos(omega * t + phase)

    acceleration = force - omega**2 * exact(0.0)
    left = exact(step) - 2 * exact(0.0) + exact(-step)
    assert_allclose(
        left, step**2 * response[: omega.size] * acceleration, atol=1e-13 * np.abs(left).max()
    )
    assert np.all(response[omega.size :] == 1.0)
    if step == 2e-3:
        assert (omega * step).max() > 2
