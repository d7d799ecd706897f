"""The guideway: weight, rigid motions, closed forms of a simply supported beam, damping."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.signal import lsim
from scipy.sparse.linalg import spsolve

from maglev.mechanics.guideway import (
    LEFT,
    RIGHT,
    build,
    damping,
    modes,
    rectangle_torsion_constant,
)
from maglev.mechanics.timoshenko import PITCH, ROLL, YAW, X, Y, Z
from maglev.parameters import BeamSection, Guideway, Rail

SPAN = 24.768  # [m]
GIRDER_MASS = 2551 * 2.352  # without rails [kg/m]
CAR_WEIGHT = 571e3  # per car length [N], as in the published static case
KINDS = ["sliding", "rigid"]


def with_rail(kind, **changes):
    return Guideway(rail=Rail(connector_longitudinal=kind), **changes)


@pytest.fixture(scope="module", params=KINDS)
def model(request):
    return build(with_rail(request.param))


@pytest.fixture(scope="module")
def small():
    return build(Guideway(n_spans=2))


def simply_supported(shear=False):
    """The bare girder on supports that give way to nothing, an Euler beam unless ``shear``.

    The rails slide and have next to no mass and stiffness of their own; the bearings lie on the
    axis and leave the ends free to yaw.
    """
    default = Guideway()
    slender = {
        "elastic_modulus": default.girder.elastic_modulus * 1e3,
        "second_moment_vertical": default.girder.second_moment_vertical / 1e3,
        "second_moment_lateral": default.girder.second_moment_lateral / 1e3,
    }  # the same EI, no rotary inertia
    if not shear:
        slender["shear_coefficient_vertical"] = slender["shear_coefficient_lateral"] = 1e3
    steel = default.rail.section
    faint = {
        "elastic_modulus": steel.elastic_modulus * 1e-3,
        "density": steel.density * 1e-3,
        "polar_inertia": steel.polar_inertia * 1e-3,
    }
    stiff = {
        "vertical_stiffness": 1e14,
        "lateral_stiffness": 1e14,
        "fixed_longitudinal_stiffness": 1e4,
        "free_longitudinal_stiffness": 1e4,
        "damping": 0.0,
        "z": 0.0,
    }
    return default.model_copy(
        update={
            "n_spans": 1,
            "girder": default.girder.model_copy(update=slender),
            "rail": default.rail.model_copy(
                update={"section": steel.model_copy(update=faint), "connector_mass": 0.0, "z": 0.0}
            ),
            "bearing": default.bearing.model_copy(update=stiff),
            "pier": default.pier.model_copy(update={"elastic_modulus": 1e16}),
        }
    )


def rigid_motion(model, component):
    """Every degree of freedom in a unit motion of the whole guideway about its origin."""
    x, y, z = model.place.T
    one, none = np.ones_like(x), np.zeros_like(x)
    displacement = {
        X: (one, none, none),
        Y: (none, one, none),
        Z: (none, none, one),
        ROLL: (none, -z, y),
        PITCH: (z, none, -x),
        YAW: (-y, x, none),
    }[component]
    motion = np.where(model.component == component, 1.0, 0.0)
    for axis in (X, Y, Z):
        motion[model.component == axis] = displacement[axis][model.component == axis]
    return motion


def static_motion(model, force):
    return spsolve(model.stiffness.tocsc(), force)


def train_at_rest(model):
    """Force of cars all along the guideway, both rails."""
    dx = 0.01032
    x = (np.arange(round(model.parameters.length / dx)) + 0.5) * dx
    weight = np.full(x.size, CAR_WEIGHT / SPAN / 2 * dx)
    return sum(model.rail_rows(x, side)[0].T @ weight for side in (RIGHT, LEFT))


# Weight and stiffness as a whole


@pytest.mark.parametrize("component", [X, Y, Z])
def test_a_span_weighs_seven_tonnes_a_metre(model, component):
    lift = np.where(model.component == component, 1.0, 0.0)
    for dof in model.span_dof:
        mass = lift[dof] @ (model.mass[dof][:, dof] @ lift[dof])
        assert_allclose(mass / SPAN, 7000, rtol=1e-4)


@pytest.mark.parametrize("component", [ROLL, PITCH, YAW])
def test_a_span_turned_as_a_rigid_body_has_the_inertia_of_its_parts(model, component):
    # About the first pier on the girder axis: girder and rails as bars, connectors as points.
    turn, dof = rigid_motion(model, component), model.span_dof[1]
    guideway = model.parameters
    girder, rail = guideway.girder, guideway.rail
    steel = rail.section
    middle, ends = 1.5 * SPAN, SPAN**2 / 12
    connector_x = SPAN + 0.774 * (np.arange(32) + 0.5)
    connector = rail.connector_mass * 0.774
    along = SPAN * (GIRDER_MASS + 2 * 7850 * 0.045) * (middle**2 + ends)
    along += 2 * connector * (connector_x**2).sum()
    of_rails = 2 * (7850 * 0.045 + rail.connector_mass) * SPAN
    bending = {
        PITCH: girder.density * 1.769 + 2 * steel.density * 5e-4,
        YAW: girder.density * 1.2 + 2 * steel.density * 1e-3,
        ROLL: 1967 + 2 * 11.775,
    }[component]
    off_axis = {PITCH: 1.0**2, YAW: 1.1**2, ROLL: 1.0**2 + 1.1**2}[component]
    expected = SPAN * bending + of_rails * off_axis + (along if component != ROLL else 0.0)
    inertia = turn[dof] @ (model.mass[dof][:, dof] @ turn[dof])
    assert_allclose(inertia, expected, rtol=1e-9)
    if component == ROLL:
        assert_allclose(inertia / SPAN, 4200, rtol=1e-3)


def test_a_pier_weighs_its_volume(model):
    lift = np.where(model.component == Z, 1.0, 0.0)
    dof = np.concatenate([model.pier_top_dof[2], model.pier_dof[2]])
    mass = lift[dof] @ (model.mass[dof][:, dof] @ lift[dof])
    # Of the lowest element, one metre, a third moves with its upper node while the foot stays.
    assert_allclose(mass, 2551 * (1.8 * 3.0 * 1 + 1.8 * 1.8 * (9 - 2 / 3)), rtol=1e-12)


def test_a_pier_turns_about_its_axis_with_the_inertia_of_its_volume(model):
    turn = np.where(model.component == YAW, 1.0, 0.0)
    dof = np.concatenate([model.pier_top_dof[2], model.pier_dof[2]])
    inertia = turn[dof] @ (model.mass[dof][:, dof] @ turn[dof])
    cap, shaft = (
        1.8 * 3.0 * (1.8**2 + 3.0**2) / 12,
        1.8**2 * 2 * 1.8**2 / 12,
    )  # per metre and density
    assert_allclose(inertia, 2551 * (cap + shaft * (9 - 2 / 3)), rtol=1e-12)


@pytest.mark.parametrize("component", [X, Y, Z])
def test_the_guideway_moved_as_a_rigid_body_has_its_whole_mass(model, component):
    motion = np.where(model.component == component, 1.0, 0.0)
    moved = motion @ (model.mass @ motion)
    # The feet stay: of each lowest element, 1.8 x 1.8 x 1 m, a third moves along its axis,
    # and across it the square of the deflection under a moving upper node that does not turn.
    if component == Z:
        share = 1 / 3
    else:
        flexibility = 12 * 2 * 1.2 / (5 / 6) * 1.8**2 / 12  # Φ with E / G = 2 (1 + 0.2), 1 m long
        s = (np.arange(2000) + 0.5) / 2000
        shape = (3 * s**2 - 2 * s**3 + flexibility * s) / (1 + flexibility)
        turn = 6 * (s - s**2) / (1 + flexibility)
        share = (shape**2).mean() + 1.8**2 / 12 * (turn**2).mean()
    pier = 2551 * (1.8 * 3.0 * 1 + 1.8 * 1.8 * (8 + share))
    span = GIRDER_MASS + 2 * (7850 * 0.045 + 146.8)
    assert_allclose(moved, 6 * pier + 5 * SPAN * span, rtol=1e-8)
    assert_allclose(span, 7000, rtol=1e-4)


def test_matrices_are_symmetric(model):
    for matrix in (model.mass, model.stiffness, model.bearing_damping):
        difference = abs(matrix - matrix.T).max()
        assert difference <= 1e-12 * abs(matrix).max()


@pytest.mark.parametrize("component", range(6))
def test_a_rigid_motion_strains_only_the_lowest_pier_elements(model, component):
    force = model.stiffness @ rigid_motion(model, component)
    lowest = np.concatenate([dof[-6:] for dof in model.pier_dof])
    scale = np.abs(force[lowest]).max()
    above = np.setdiff1d(np.arange(model.n_dof), lowest)
    assert scale > 1e6
    assert np.abs(force[above]).max() < 1e-6 * scale


@pytest.mark.parametrize("component", range(6))
def test_bearings_resist_only_what_girder_and_pier_do_apart(model, component):
    whole = rigid_motion(model, component)
    assert np.abs(model.bearing_damping @ whole).max() < 1e-9 * 1e5 * max(1, np.abs(whole).max())


@pytest.mark.parametrize("component", [X, Y, Z])
def test_lifting_one_span_moves_four_dashpots(model, component):
    lift = np.zeros(model.n_dof)
    dof = model.span_dof[3]
    lift[dof] = model.component[dof] == component
    force = model.bearing_damping @ lift
    assert_allclose(force[dof] @ lift[dof], 4 * 1e5, rtol=1e-12)
    assert_allclose(force[model.pier_top_dof[3:5, component]], -2e5, rtol=1e-12)


@pytest.mark.parametrize("span", [0, 1])
def test_four_bearings_carry_what_stands_on_their_span(span):
    """Their closing times their stiffness: in sum the load, and its moments about both axes."""
    model = build(Guideway(n_spans=2))
    length, bearing, force, x = 24.768, model.parameters.bearing, 5e4, 7.7
    rows, _, _, _ = model.rail_rows([span * length + x], RIGHT)
    motion = spsolve(model.stiffness.tocsc(), force * rows.toarray()[0])
    right, left, last_right, last_left = -bearing.vertical_stiffness * (
        model.bearing_rows(span) @ motion
    )
    assert_allclose(right + left + last_right + last_left, force, rtol=1e-6)
    assert_allclose((last_right + last_left) * length, force * x, rtol=2e-2)  # piers turn a little
    other = model.bearing_rows(1 - span) @ motion
    assert_allclose(other.sum(), 0.0, atol=1e-6 * force / bearing.vertical_stiffness)


def test_degrees_of_freedom_are_each_named_once(model):
    named = np.concatenate([*model.span_dof, model.pier_top_dof.ravel(), *model.pier_dof])
    assert_array_equal(np.sort(named), np.arange(model.n_dof))
    assert_array_equal(model.component[model.pier_top_dof], np.tile(np.arange(6), (6, 1)))
    assert_allclose(model.place[model.pier_top_dof[:, 0], 0], SPAN * np.arange(6))


def test_spans_touch_only_through_the_pier_tops(model):
    linked = abs(model.stiffness) + abs(model.mass) + abs(model.bearing_damping)
    one, other = model.span_dof[1], model.span_dof[2]
    assert linked[one][:, other].nnz == 0
    assert linked[one][:, model.pier_dof[1]].nnz == 0
    assert linked[one][:, model.pier_top_dof[1]].nnz > 0


# Rows that read and load the rails


@pytest.mark.parametrize("component", range(6))
@pytest.mark.parametrize("side", [RIGHT, LEFT])
def test_rail_rows_read_a_rigid_motion_of_the_rail_axis(model, component, side):
    x = np.array([0.0, 0.1, 0.387, 3.096, 12.384, 40.01, 123.84])
    y, z = side * 1.1, -1.0
    found = [row @ rigid_motion(model, component) for row in model.rail_rows(x, side)]
    zero, one = np.zeros_like(x), np.ones_like(x)
    expected = {
        X: (zero, zero, zero, zero),
        Y: (zero, zero, one, zero),
        Z: (one, zero, zero, zero),
        ROLL: (y * one, zero, -z * one, zero),
        PITCH: (-x, -one, zero, zero),
        YAW: (zero, zero, x, one),
    }[component]
    assert_allclose(found, expected, atol=1e-9)
    girder = [row @ rigid_motion(model, component) for row in model.girder_rows(x)]
    along = {Z: (one, zero), PITCH: (-x, zero), Y: (zero, one), YAW: (zero, x)}
    assert_allclose(girder, along.get(component, (zero, zero)), atol=1e-9)


def test_rows_are_zero_beyond_the_guideway(model):
    for rows in (*model.rail_rows([-1e-6, 123.841, 500.0], RIGHT), *model.girder_rows([-3.0])):
        assert np.abs(rows).max() == 0


def test_slope_rows_are_the_derivative_of_displacement_rows(model):
    motion = static_motion(model, train_at_rest(model)) + rigid_motion(model, YAW)
    x, step = np.array([0.2, 5.0, 30.5, 61.0]), 1e-4
    ahead, at, behind = (model.rail_rows(x + shift, LEFT) for shift in (step, 0, -step))
    for value, slope in ((0, 1), (2, 3)):
        difference = (ahead[value] - behind[value]) @ motion / (2 * step)
        assert_allclose(at[slope] @ motion, difference, rtol=1e-5, atol=1e-10)


def test_a_rail_is_continuous_within_a_unit_and_free_between_units(model):
    # A unit is bent by a load on its overhang; the next one's end does not follow.
    load = model.rail_rows([2 * 3.096 + 1e-9], RIGHT)[0].T @ [1e5]
    motion = static_motion(model, np.asarray(load).ravel())
    connector = 2 * 3.096 + 0.387 + 0.774
    across = model.rail_rows(connector + np.array([-1e-9, 1e-9]), RIGHT)[0] @ motion
    assert_allclose(across[0], across[1], rtol=1e-6)
    behind, ahead = model.rail_rows(2 * 3.096 + np.array([-1e-6, 1e-6]), RIGHT)[0] @ motion
    assert ahead - behind > 1e-5  # [m], the bending and shear of the overhang


@pytest.mark.parametrize(
    ("row", "second_moment", "rotation", "sign"),
    [(0, "second_moment_vertical", PITCH, -1), (2, "second_moment_lateral", YAW, 1)],
)
def test_the_overhang_of_a_unit_bends_as_a_cantilever(row, second_moment, rotation, sign):
    guideway = Guideway(n_spans=1)
    model = build(guideway)
    force, arm = 1e5, 0.387
    load = np.asarray(model.rail_rows([SPAN], RIGHT)[row].T @ [force]).ravel()
    motion = static_motion(model, load)
    tip, slope = (rows @ motion for rows in model.rail_rows([SPAN], RIGHT)[row : row + 2])
    root = model.rail_rows([SPAN - arm], RIGHT)[row] @ motion
    section = guideway.rail.section
    EI = section.elastic_modulus * getattr(section, second_moment)
    shear = 0.4 * section.shear_modulus * section.area
    own = force * arm**3 / (3 * EI) + force * arm / shear
    # The root turns with the girder node to which the last connector is tied.
    dof = model.span_dof[0]
    place, component = model.place[dof], model.component[dof]
    node = np.isclose(place[:, 0], SPAN - arm) & (place[:, 1] == 0) & (component == rotation)
    turn = sign * motion[dof][node].item()
    assert_allclose(tip, root + turn * arm + own, rtol=1e-9)
    assert_allclose(slope - turn, force * arm**2 / (2 * EI) + force / shear, rtol=1e-8)


def test_left_and_right_mirror_each_other(model):
    loads = [np.asarray(model.rail_rows([30.0], s)[0].T @ [1e5]).ravel() for s in (RIGHT, LEFT)]
    right, left = (static_motion(model, load) for load in loads)
    x = np.linspace(0, 123.84, 50)
    for mirrored, row in zip([1, 1, -1, -1], range(4), strict=True):
        assert_allclose(
            model.rail_rows(x, RIGHT)[row] @ right,
            mirrored * (model.rail_rows(x, LEFT)[row] @ left),
            atol=1e-9 * np.abs(right).max(),
        )


def test_a_side_that_is_neither_is_refused(small):
    with pytest.raises(ValueError, match=r"side must be 1 \(right\) or -1 \(left\), got 0"):
        small.rail_rows([1.0], 0)


# Closed forms of the simply supported beam


def test_point_load_at_midspan_deflects_by_bending_and_shear():
    guideway = simply_supported(shear=True)
    model, force = build(guideway), 1e5
    row = model.girder_rows([SPAN / 2])[0]
    deflection = row @ static_motion(model, np.asarray(row.T @ [force]).ravel())
    girder = guideway.girder
    EI = girder.elastic_modulus * girder.second_moment_vertical
    shear = 0.4 * girder.shear_modulus * girder.area
    closed = force * SPAN**3 / (48 * EI) + force * SPAN / (4 * shear)
    assert_allclose(deflection, closed, rtol=1e-4)


def test_uniform_load_on_the_rails_deflects_by_the_closed_form():
    guideway = simply_supported()
    model = build(guideway)
    deflection = model.girder_rows([SPAN / 2])[0] @ static_motion(model, train_at_rest(model))
    EI = guideway.girder.elastic_modulus * guideway.girder.second_moment_vertical
    assert_allclose(deflection, 5 * CAR_WEIGHT * SPAN**3 / (384 * EI), rtol=2e-3)


@pytest.fixture(scope="module")
def simple_modes():
    guideway = simply_supported()
    model = build(guideway)
    frequency, shape = modes(model, 400.0)
    return guideway, model, frequency, shape


@pytest.mark.parametrize(
    ("component", "second_moment"),
    [(0, "second_moment_vertical"), (1, "second_moment_lateral")],
)
def test_simply_supported_euler_limit_has_the_closed_form_frequencies(
    simple_modes, component, second_moment
):
    guideway, model, frequency, shape = simple_modes
    EI = guideway.girder.elastic_modulus * getattr(guideway.girder, second_moment)
    for n in (1, 2, 3):
        closed = (n * np.pi / SPAN) ** 2 * np.sqrt(EI / GIRDER_MASS) / (2 * np.pi)
        antinode = model.girder_rows([SPAN / (2 * n)])[component] @ shape
        moving = np.abs(np.asarray(antinode).ravel()) > 1e-3 * np.sqrt(2 / (GIRDER_MASS * SPAN))
        assert np.abs(frequency[moving] / closed - 1).min() < 2e-3


def modal_history(frequency, ratio, force, dt):
    """Modal coordinates under forces (time, mode), exact for forces linear between samples."""
    t = dt * np.arange(len(force))
    history = np.zeros_like(force)
    for k, w in enumerate(2 * np.pi * frequency):
        system = ([[0, 1], [-(w**2), -2 * ratio * w]], [[0], [1]], [[1, 0]], [[0]])
        history[:, k] = lsim(system, force[:, k], t)[1]
    return history


def test_a_moving_load_follows_the_closed_form(simple_modes):
    guideway, model, frequency, shape = simple_modes
    kept = frequency < 150
    frequency, shape = frequency[kept], shape[:, kept]
    load, speed, dt = 1e5, 600 / 3.6, 2e-4
    x = np.arange(0, SPAN, speed * dt)
    force = load / 2 * sum(model.rail_rows(x, side)[0] @ shape for side in (RIGHT, LEFT))
    found = modal_history(frequency, 0.0, force, dt) @ (model.girder_rows([SPAN / 2])[0] @ shape).T
    EI = guideway.girder.elastic_modulus * guideway.girder.second_moment_vertical
    closed = np.zeros(x.size)
    for n in range(1, 12, 2):
        own = (n * np.pi / SPAN) ** 2 * np.sqrt(EI / GIRDER_MASS)
        passing = n * np.pi * speed / SPAN
        t = dt * np.arange(x.size)
        closed += (
            2 * load / (GIRDER_MASS * SPAN) * np.sin(n * np.pi / 2) / (own**2 - passing**2)
        ) * (np.sin(passing * t) - passing / own * np.sin(own * t))
    assert_allclose(found.ravel(), closed, atol=5e-3 * closed.max())


@pytest.mark.parametrize(
    ("speed_kmh", "factor"),
    # Derived apart from this code, for the bare girder: 6000 kg/m, first frequency 9.68 Hz.
    [(300, 1.025), (350, 1.007), (400, 1.045), (430, 1.059), (500, 1.054), (600, 1.027)],
)
def test_dynamic_factor_of_five_cars_as_a_moving_uniform_load(simple_modes, speed_kmh, factor):
    assert_allclose(dynamic_factor(simple_modes, speed_kmh), factor, atol=4e-3)


@pytest.mark.parametrize("speed_kmh", [50, 100, 150, 200, 250])
def test_dynamic_factor_is_near_one_at_low_speed(simple_modes, speed_kmh):
    assert 0.999 < dynamic_factor(simple_modes, speed_kmh) < 1.008


def dynamic_factor(simple_modes, speed_kmh):
    """Largest midspan deflection over the static one, 2 % damping."""
    _, model, frequency, shape = simple_modes
    middle = np.asarray(model.girder_rows([SPAN / 2])[0] @ shape)
    kept = (frequency < 200) & (np.abs(middle) > 1e-6 * np.abs(middle).max()).ravel()
    frequency, shape, middle = frequency[kept], shape[:, kept], middle[:, kept]
    dx = 0.05
    x = np.arange(0, SPAN, dx) + dx / 2
    density = CAR_WEIGHT / SPAN / 2
    rows = sum(model.rail_rows(x, side)[0] @ shape for side in (RIGHT, LEFT))
    edge = np.append(0, x + dx / 2)
    covered = np.vstack([np.zeros(kept.sum()), density * dx * np.cumsum(rows, axis=0)])
    speed, dt, length = speed_kmh / 3.6, 1e-3, 5 * SPAN
    front = np.arange(0, length + 2 * SPAN, speed * dt)
    force = np.stack(
        [
            np.interp(front, edge, share) - np.interp(front - length, edge, share)
            for share in covered.T
        ],
        axis=1,
    )
    history = modal_history(frequency, 0.02, force, dt) @ middle.T
    static = middle @ (covered[-1] / (2 * np.pi * frequency) ** 2)
    return history.max() / static.item()


# The guideway as it stands


@pytest.mark.parametrize(
    ("kind", "low", "high"), [("sliding", 1.44e-3, 1.49e-3), ("rigid", 1.28e-3, 1.34e-3)]
)
def test_a_static_train_bends_the_girders_by_one_and_a_half_millimetres(kind, low, high):
    model = build(with_rail(kind))
    middle = model.girder_rows(SPAN * (np.arange(5) + 0.5))[0]
    deflection = middle @ static_motion(model, train_at_rest(model))
    assert np.all((low < deflection) & (deflection < high))


@pytest.mark.parametrize(("kind", "low", "high"), [("sliding", 8.4, 8.7), ("rigid", 8.9, 9.2)])
def test_first_vertical_frequency(kind, low, high):
    # Public estimates for this girder span 8.6 to 9.7 Hz; soft piers take 0.1 Hz off.
    model = build(with_rail(kind))
    frequency, shape = modes(model, 12.0)
    middle = np.abs(model.girder_rows(SPAN * (np.arange(5) + 0.5))[0] @ shape).max(axis=0)
    vertical = frequency[middle > 0.5 * middle.max()]
    assert len(vertical) == 5  # one a span
    assert np.all((low < vertical) & (vertical < high))


def test_elements_as_they_are_give_frequencies_of_a_fine_mesh():
    coarse, fine = (modes(build(Guideway(n_spans=1, refinement=r)), 60.0)[0] for r in (1, 3))
    assert len(coarse) == len(fine) > 10
    assert_allclose(coarse, fine, rtol=2e-3)


def test_an_inner_span_bends_alike_in_a_longer_line():
    four, twenty = (build(Guideway(n_spans=n)) for n in (4, 20))
    assert twenty.n_dof - four.n_dof == 16 * (four.span_dof[0].size + 60)
    middle = twenty.girder_rows([SPAN * 10.5])[0] @ static_motion(twenty, train_at_rest(twenty))
    same = four.girder_rows([SPAN * 1.5])[0] @ static_motion(four, train_at_rest(four))
    assert_allclose(middle, same, rtol=1e-3)


@pytest.mark.parametrize("refinement", [1, 2])
def test_a_girder_node_lies_at_midspan(refinement):
    model = build(Guideway(n_spans=3, refinement=refinement))
    for row in model.girder_rows(SPAN * (np.arange(3) + 0.5)):
        assert_allclose(np.sort(row.toarray(), axis=1)[:, -2:], [[0, 1]] * 3, atol=1e-12)


def test_odd_units_with_a_connector_at_midspan_are_built():
    guideway = Guideway(n_spans=1, rail=Rail(units_per_span=5, connectors_per_unit=3))
    model = build(guideway)
    lift = np.where(model.component == Z, 1.0, 0.0)[model.span_dof[0]]
    mass = lift @ (model.mass[model.span_dof[0]][:, model.span_dof[0]] @ lift)
    assert_allclose(mass / SPAN, 7000, rtol=1e-4)


def test_a_sliding_rail_does_not_stiffen_the_girder():
    none = BeamSection.model_construct(
        **{**dict(Guideway().rail.section), "elastic_modulus": 2.06e5}
    )
    deflection = {}
    for name, rail in {
        "sliding": Rail(),
        "rigid": Rail(connector_longitudinal="rigid"),
        "none": Rail().model_copy(update={"section": none}),
    }.items():
        model = build(Guideway().model_copy(update={"n_spans": 1, "rail": rail}))
        row = model.girder_rows([SPAN / 2])[0]
        deflection[name] = (row @ static_motion(model, np.asarray(row.T @ [1e5]).ravel())).item()
    assert_allclose(deflection["sliding"], deflection["none"], rtol=0.01)
    assert deflection["rigid"] < 0.93 * deflection["none"]


# Modes and damping


def test_no_mode_is_missed(small):
    frequency, shape = modes(small, 100.0)
    mass, stiffness = small.mass.toarray(), small.stiffness.toarray()
    root = np.linalg.cholesky(mass)
    half = np.linalg.solve(root, stiffness)
    every = np.sqrt(np.linalg.eigvalsh(np.linalg.solve(root, half.T))) / (2 * np.pi)
    assert_allclose(frequency, every[every <= 100.0], rtol=1e-6)
    assert_allclose(shape.T @ (small.mass @ shape), np.eye(len(frequency)), atol=1e-9)


def test_modes_are_the_same_each_time(small):
    first, second = modes(small, 50.0), modes(small, 50.0)
    assert_array_equal(first[0], second[0])
    assert_array_equal(first[1], second[1])


def test_damping_is_the_ratio_below_the_cutoff_and_its_rate_above(small):
    ratio, cutoff = 0.025, 60.0
    frequency, shape = modes(small, 120.0)
    structural = damping(small, ratio, cutoff)
    projected = shape.T @ np.stack([structural.matvec(column) for column in shape.T], axis=1)
    expected = 2 * ratio * 2 * np.pi * np.minimum(frequency, cutoff)
    assert (frequency > cutoff).sum() > 10 < (frequency < cutoff).sum()
    assert_allclose(projected, np.diag(expected), atol=1e-6 * expected.max())


@pytest.mark.parametrize("cutoff", [0.0, -1.0, float("nan")])
def test_a_cutoff_that_is_not_positive_is_refused(small, cutoff):
    with pytest.raises(ValueError, match="cutoff_hz must be positive"):
        modes(small, cutoff)


def test_a_cutoff_above_every_mode_is_refused(small):
    with pytest.raises(ValueError, match="below the model's highest mode"):
        modes(small, 1e7)


def test_a_damping_ratio_out_of_range_is_refused(small):
    with pytest.raises(ValueError, match=r"damping ratio must lie in \[0, 1\), got 1.5"):
        damping(small, 1.5, 60.0)


def test_a_cutoff_below_every_mode_leaves_the_rate_alone(small):
    structural = damping(small, 0.02, 0.1)
    assert structural.frequency.size == 0
    velocity = np.linspace(-1, 1, small.n_dof)
    expected = 2 * 0.02 * 2 * np.pi * 0.1 * (small.mass @ velocity)
    assert_allclose(structural.matvec(velocity), expected)


# Pier section


@pytest.mark.parametrize(("sides", "share"), [((1, 1), 0.1406), ((2, 1), 0.229), ((1, 10), 0.312)])
def test_torsion_constant_of_a_rectangle_is_as_tabulated(sides, share):
    # Timoshenko and Goodier, table in sec. 109: J / (a b^3).
    constant = rectangle_torsion_constant(*sides)
    assert_allclose(constant / (max(sides) * min(sides) ** 3), share, atol=6e-4)


def test_a_rectangle_without_width_is_refused():
    with pytest.raises(ValueError, match="sides must be positive"):
        rectangle_torsion_constant(0.0, 1.0)
