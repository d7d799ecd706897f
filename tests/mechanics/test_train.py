"""The train: its degrees of freedom, what its magnets carry, and that it stands."""

import itertools
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maglev.mechanics.train import build, pole_offsets, pole_static_force
from maglev.parameters import GRAVITY, Gains, Rod, Train

FIVE_CARS = build(Train())
TWO_CARS = build(Train(n_cars=2))
ONE_CAR = build(Train(n_cars=1))
NO_GAP = 1e-12  # of a strain beside the motion that should cause none


def direction(model, name):
    """Degrees of freedom that move in one direction, ``phi_front`` and ``phi_rear`` as ``phi``."""
    return np.array([re.fullmatch(rf".*\.{name}(_front|_rear)?", dof) is not None
                     for dof in model.dof_names])  # fmt: skip


def place(dof):
    """x, y, z of the body a degree of freedom belongs to, from its name alone [m].

    x from the nose, y to the right, z below deck level; of a bogie its middle.
    """
    car, body = re.match(r"car(\d+)\.(\w+)\.", dof).groups()
    middle = -24.768 * (int(car) + 0.5)
    kind, number, side = re.fullmatch(r"([a-z]+)(\d*)_?([a-z]*)", body).groups()
    sign = {"right": 1, "left": -1, "": 0}[side]
    first = {"body": 0.0, "bogie": 9.288, "rod": 10.836, "suspension": 9.288, "guidance": 9.288}
    step = {"body": 0.0, "bogie": 6.192, "rod": 3.096, "suspension": 3.096, "guidance": 3.096}
    y = {"body": 0.0, "bogie": 0.0, "rod": 1.2, "suspension": 1.1, "guidance": 1.465}[kind]
    z = {"body": -1.5, "bogie": 0.0, "rod": -0.5, "suspension": 0.0, "guidance": 0.18}[kind]
    return middle + first[kind] - step[kind] * int(number or 0), sign * y, z


def rigid(model, name, x0=0.0, z0=0.0, pivot_z=-0.5):
    """Motion of all degrees of freedom with the whole train, turning about (x0, z0) on its middle.

    A bogie's y and z are those of the middle of the mass that moves with it that way, and its
    C-frames roll about the height of theirs: by hand, half the bogie 1100 kg and two rods of 50 kg
    at each C-frame, and two ends of 300 kg (in y) or 195 kg (in z) for each magnet on one side.
    """
    motion = 1.0 * direction(model, name)
    n_cars = model.car_body_dof.shape[0]
    across, down = {"y": (1, 0), "z": (0, 1)}.get(name, (0, 0))
    for number, dof in enumerate(model.dof_names):
        x, y, z = place(dof)
        bogie = re.match(r"car(\d+)\.bogie(\d)\.", dof)
        u_y = {"phi": -(z - z0), "psi": x - x0}.get(name, across)
        u_z = {"phi": y, "theta": -(x - x0)}.get(name, down)
        if bogie:
            ends = [2, 2]
            if bogie.groups() == ("0", "0"):
                ends[0] = 1
            if bogie.groups() == (str(n_cars - 1), "3"):
                ends[1] = 1
            lateral, vertical = (np.array([1200.0 + m * n for n in ends]) for m in (600.0, 390.0))
            at_y, at_z = (1.548 * (m[0] - m[1]) / m.sum() for m in (lateral, vertical))
            axis = 100 * pivot_z / lateral  # below deck level
            u_z += {"theta": -at_z}.get(name, 0.0)
            # Both C-frames move at deck level by y + psi dx + axis phi.
            u_psi = {"phi": (axis[1] - axis[0]) / 3.096}.get(name, 0.0)
            u_y += {"psi": at_y, "phi": u_psi * (at_y - 1.548) - axis[0]}.get(name, 0.0)
            if name == "phi" and dof.endswith(".psi"):
                motion[number] = u_psi
        if dof.endswith(".y"):
            motion[number] = u_y
        if dof.endswith(".z"):
            motion[number] = u_z
    return motion


def lumps(n_cars):
    """Mass, place, directions it has, and own inertias of everything on the train, one by one.

    What has no freedom in a direction rides in it on the C-frames, half at either end; nothing but
    what turns with a bogie moves along the train.
    """
    stations = [-12.384 + 10.836 - 3.096 * k for k in range(8 * n_cars)]
    found = []
    for car in range(n_cars):
        middle = -24.768 * (car + 0.5)
        found.append((39_000, (middle, 0, -1.5), "yz", (65e3, 2e6, 2e6)))
    for k, x in enumerate(stations):
        found.append((0, (x, 0, 0), "", (1000, 0, 0)))
        if k % 2 == 0:
            found.append((2200, (x - 1.548, 0, 0), "yz", (0, 7000, 7000)))
        for side in (1, -1):
            found.append((50, (x, 1.2 * side, -0.5), "xyz", (8, 0, 0)))
    for front, rear in itertools.pairwise(stations):
        for side in (1, -1):
            found.append((600, (0.5 * (front + rear), 1.1 * side, 0), "z", (0, 480, 0)))
            found.append((390, (0.5 * (front + rear), 1.465 * side, 0.18), "y", (0, 0, 310)))
            for x in (front, rear):
                found.append((300, (x, 1.1 * side, 0), "xy", (0, 0, 0)))
                found.append((195, (x, 1.465 * side, 0.18), "xz", (0, 0, 0)))
    return found


def linearly_closed(model, gains, poles_per_controller):
    """State matrix with the magnets' small motion; the poles of a controller share its mean gap."""
    train, magnets = model.parameters, model.magnets
    stiffness, damping = model.stiffness.toarray(), model.damping.toarray()
    for number, forces in enumerate(pole_static_force(train, magnets)):
        guidance = magnets.is_guidance[number]
        p = train.guidance_magnet if guidance else train.suspension_magnet
        k_p, k_d = gains.as_row[2:] if guidance else gains.as_row[:2]
        force = forces[: p.n_poles]
        dofs = [magnets.translation_dof[number], magnets.rotation_dof[number]]
        arm = pole_offsets(p) if guidance else -pole_offsets(p)
        gap = np.stack([np.ones_like(arm), arm], axis=1)  # (pole, 2)
        together = poles_per_controller[int(guidance)]
        sensed = np.repeat(gap.reshape(-1, together, 2).mean(axis=1), together, axis=0)
        pull = 2 * force[:, None] * gap
        block = np.ix_(dofs, dofs)
        stiffness[block] += pull.T @ (k_p / p.current_reference * sensed - gap / p.gap_reference)
        damping[block] += pull.T @ sensed * k_d / p.current_reference
    n = model.mass.size
    per_mass = -np.hstack([stiffness, damping]) / model.mass[:, None]
    return np.vstack([np.hstack([np.zeros((n, n)), np.eye(n)]), per_mass])


@pytest.mark.parametrize(("n_cars", "n_dof"), [(1, 101), (2, 210), (5, 537)])
def test_a_car_has_101_degrees_of_freedom_and_a_coupling_8(n_cars, n_dof):
    model = build(Train(n_cars=n_cars))
    assert model.mass.size == len(set(model.dof_names)) == n_dof
    assert model.stiffness.shape == model.damping.shape == (n_dof, n_dof)
    per_kind_and_side = 8 * n_cars - 1
    assert model.magnets.x.size == 4 * per_kind_and_side
    moving = np.concatenate([model.magnets.translation_dof, model.magnets.rotation_dof])
    assert np.unique(moving).size == moving.size
    assert not np.isin(moving, model.car_body_dof).any()


@pytest.mark.parametrize("model", [ONE_CAR, TWO_CARS, FIVE_CARS], ids=["1", "2", "5"])
@pytest.mark.parametrize("name", ["y", "z"])
def test_the_train_moved_as_a_rigid_body_has_its_whole_mass(model, name):
    n_cars = model.car_body_dof.shape[0]
    by_hand = n_cars * (39_000 + 4 * 2200 + 16 * 50) + (16 * n_cars - 2) * (600 + 390)
    motion = rigid(model, name)
    assert_allclose(motion @ (model.mass * motion), by_hand, rtol=1e-12)
    assert by_hand / n_cars == {1: 62_460.0, 2: 63_450.0, 5: 64_044.0}[n_cars]


@pytest.mark.parametrize("model", [ONE_CAR, TWO_CARS], ids=["1", "2"])
@pytest.mark.parametrize("about", [(0.0, 0.0), (-30.0, 0.7)])
@pytest.mark.parametrize(("axis", "name"), [(0, "phi"), (1, "theta"), (2, "psi")])
def test_the_train_turned_as_a_rigid_body_has_its_whole_inertia(model, about, axis, name):
    # In pitch and yaw what rides on a bogie also moves along the train, by its height or side.
    x0, z0 = about
    total = 0.0
    for mass, (x, y, z), moves, own in lumps(model.car_body_dof.shape[0]):
        dx, dz = x - x0, z - z0
        arms = (
            {"y": dz, "z": y},
            {"x": z, "z": dx},
            {"x": y, "y": dx},
        )[axis]
        total += mass * sum(arm**2 for way, arm in arms.items() if way in moves) + own[axis]
    motion = rigid(model, name, x0, z0)
    # C-frames of different roll axes make a rigid roll with a yaw of 2e-3 of the end bogies.
    rtol = 1e-5 if name == "phi" else 1e-12
    assert_allclose(motion @ (model.mass * motion), total, rtol=rtol)


def test_inner_magnets_carry_a_sixteenth_of_the_car_and_end_magnets_more():
    magnets = FIVE_CARS.magnets
    force = magnets.static_force[~magnets.is_guidance].reshape(2, 39)
    moment = magnets.static_moment[~magnets.is_guidance].reshape(2, 39)
    share = 39.525e3  # N: (39 000 + 4 x 2200 + 16 x 50) kg / 16 + 600 kg + 390 kg, times g
    assert_allclose(force[:, 1:-1], share, rtol=2e-3)
    # The outermost C-frame hangs on the end magnet alone: half a C-frame's load more, of which its
    # guidance magnets' ends are but one on either side.
    c_frame = share - 990 * GRAVITY
    end = 0.5 * c_frame
    assert_allclose(force[:, [0, -1]], share + end, rtol=1e-2)
    assert_allclose(moment[:, 0], end * 1.548, rtol=2e-2)
    assert_allclose(moment[:, -1], -moment[:, 0], rtol=1e-9)
    assert np.abs(moment[:, 1:-1]).max() < 1e-3 * share
    assert np.all(magnets.static_force[magnets.is_guidance] == 10e3)
    assert np.all(magnets.static_moment[magnets.is_guidance] == 0)


@pytest.mark.parametrize("n_cars", [1, 2, 5])
def test_suspension_poles_carry_the_whole_train_and_its_moments(n_cars):
    model = build(Train(n_cars=n_cars))
    magnets = model.magnets
    held = ~magnets.is_guidance
    pole = pole_static_force(model.parameters, magnets)[held]
    x = magnets.x[held, None] + pole_offsets(model.parameters.suspension_magnet)
    motion = rigid(model, "z")
    weight = GRAVITY * motion @ (model.mass * motion)
    assert_allclose(pole.sum(), weight, rtol=1e-12)
    assert_allclose(model.weight.sum(), weight, rtol=1e-12)
    middle = -0.5 * n_cars * 24.768  # the train is the same seen from either end
    assert_allclose((pole * x).sum(), weight * middle, rtol=1e-12)
    assert_allclose((pole.sum(axis=1) * magnets.side[held]).sum(), 0, atol=1e-9 * weight)


def test_poles_attract_and_carry_their_magnet():
    magnets = FIVE_CARS.magnets
    force = pole_static_force(FIVE_CARS.parameters, magnets)
    for is_guidance, p in ((False, Train().suspension_magnet), (True, Train().guidance_magnet)):
        rows = magnets.is_guidance == is_guidance
        poles = force[rows, : p.n_poles]
        assert np.all(poles > 0)
        assert_allclose(poles.sum(axis=1), magnets.static_force[rows], rtol=1e-12)
        assert_allclose(poles @ pole_offsets(p), magnets.static_moment[rows], atol=1e-6)
        assert np.all(force[rows, p.n_poles :] == 0)
    ends = force[[0, 38]]
    assert_allclose(ends[0], ends[1, ::-1], rtol=1e-9)
    assert np.all(ends[0, :6] == ends[0, 0])
    assert ends[0, 0] > ends[0, 11] == ends[0, 6]


def test_poles_follow_one_another_at_their_pitch_through_the_train():
    magnets = FIVE_CARS.magnets
    for is_guidance, p in ((False, Train().suspension_magnet), (True, Train().guidance_magnet)):
        for side in (1, -1):
            rows = (magnets.is_guidance == is_guidance) & (magnets.side == side)
            poles = (magnets.x[rows, None] + pole_offsets(p)).ravel()
            assert_allclose(np.diff(poles), -p.pole_pitch, rtol=1e-9)
            assert_allclose(poles.mean(), -0.5 * 5 * 24.768, rtol=1e-12)
            assert np.all((poles < 0) & (poles > -5 * 24.768))


def test_magnets_are_listed_suspension_first_right_first_from_the_front():
    magnets = FIVE_CARS.magnets
    rank = np.lexsort((-magnets.x, -magnets.side, magnets.is_guidance))
    assert np.array_equal(rank, np.arange(magnets.x.size))
    shared = np.isclose(magnets.x % 24.768, 0) | np.isclose(magnets.x % 24.768, 24.768)
    assert shared.sum() == 4 * 4
    assert_allclose(magnets.car[shared], -magnets.x[shared] / 24.768 - 1, atol=1e-9)
    names = [FIVE_CARS.dof_names[dof] for dof in magnets.translation_dof]
    assert_allclose([place(name)[0] for name in names], magnets.x, atol=1e-9)


def test_matrices_are_symmetric_and_do_not_feed_energy():
    for matrix in (ONE_CAR.stiffness.toarray(), ONE_CAR.damping.toarray()):
        assert_allclose(matrix, matrix.T, atol=1e-14 * np.abs(matrix).max())
        assert np.linalg.eigvalsh(matrix).min() > -1e-12 * np.abs(matrix).max()
    assert np.all(ONE_CAR.mass > 0)


@pytest.mark.parametrize("name", ["z", "y", "theta", "psi"])
def test_lifting_shifting_pitching_or_yawing_the_whole_train_strains_nothing(name):
    motion = rigid(FIVE_CARS, name)
    assert np.abs(FIVE_CARS.link_rows @ motion).max() < NO_GAP * np.abs(motion).max()


@pytest.mark.parametrize("pivot_z", [-0.5, -0.2])
def test_rolling_the_whole_train_lifts_its_bodies_on_their_rods_and_nothing_else(pivot_z):
    model = build(Train(rod=Rod(pivot_z=f"{pivot_z} m")))
    motion = rigid(model, "phi", pivot_z=pivot_z)
    moment = 5 * 39_000 * GRAVITY * 0.5  # five pendulums of the body's weight, 0.5 m long
    assert_allclose(motion @ model.stiffness @ motion, moment, rtol=1e-9)
    assert abs(motion @ model.damping @ motion) < 1e-9


def test_car_body_hangs_sideways_on_its_rods_like_a_pendulum():
    # C-frames held, body shifted by u without roll: each rod end takes W / l in series with its
    # spring, and turns the rod by the pendulum's share of u.
    fixed = np.zeros(len(ONE_CAR.dof_names))
    body_y = ONE_CAR.car_body_dof[0, 0]
    fixed[body_y] = 1.0
    rods = np.flatnonzero(["rod" in dof for dof in ONE_CAR.dof_names])
    K = ONE_CAR.stiffness.toarray()
    fixed[rods] = -np.linalg.solve(K[np.ix_(rods, rods)], K[rods, body_y])
    pendulum = 39_000 * GRAVITY / 16 / 0.5
    expected = 16 / (1 / 2e5 + 1 / pendulum)
    assert_allclose((K @ fixed)[body_y], expected, rtol=1e-9)
    assert np.all(fixed[rods] < 0)  # phi turns the lower end to the left for positive angles


def test_car_body_bounces_near_1_4_hertz():
    system = linearly_closed(ONE_CAR, Gains(), (1, 1))
    roots, vectors = np.linalg.eig(system)
    energy = np.abs(vectors[: ONE_CAR.mass.size]) ** 2 * ONE_CAR.mass[:, None]
    share = energy[ONE_CAR.car_body_dof[0, 1]] / energy.sum(axis=0)
    frequency = np.abs(roots[np.argmax(share)]) / (2 * np.pi)
    assert share.max() > 0.8
    assert 1.3 < frequency < 1.5


@pytest.mark.parametrize("poles_per_controller", [(1, 1), (6, 1)], ids=["pole", "half magnet"])
def test_no_mode_grows_with_the_mean_gains(poles_per_controller):
    roots = np.linalg.eigvals(linearly_closed(TWO_CARS, Gains(), poles_per_controller))
    assert roots.real.max() < -1e-2  # 1/s
    assert 50 < np.abs(roots).max() / (2 * np.pi) < 80  # Hz: an explicit step can follow


def test_every_motion_of_five_cars_is_held_and_damped_by_a_controller_at_each_pole():
    # Symmetric, definite stiffness and damping: no mode can grow.
    n = FIVE_CARS.mass.size
    forces = -FIVE_CARS.mass[:, None] * linearly_closed(FIVE_CARS, Gains(), (1, 1))[n:]
    for matrix in (forces[:, :n], forces[:, n:]):
        assert_allclose(matrix, matrix.T, atol=1e-12 * np.abs(matrix).max())
        assert np.linalg.eigvalsh(matrix).min() > 1e-9 * np.abs(matrix).max()


@pytest.mark.parametrize(
    ("poles_per_controller", "rotation", "growth"),
    [((12, 1), "theta", 41.32), ((6, 3), "psi", 15.42)],
    ids=["suspension", "guidance"],
)
def test_one_controller_for_a_whole_magnet_lets_the_magnets_tilt_in_a_zigzag(
    poles_per_controller, rotation, growth
):
    # C-frames move to and fro in turn: the gap's mean over each magnet stays, so that no
    # controller acts against the attraction, which grows where the gap closes.
    roots, vectors = np.linalg.eig(linearly_closed(ONE_CAR, Gains(), poles_per_controller))
    assert_allclose(roots.real.max(), growth, rtol=1e-2)  # 1/s
    mode = vectors[: ONE_CAR.mass.size, np.argmax(roots.real)].real
    kind = "suspension" if rotation == "theta" else "guidance"
    of_kind = np.array([f".{kind}" in dof for dof in ONE_CAR.dof_names])
    tilts = mode[of_kind & direction(ONE_CAR, rotation)].reshape(2, 7)  # right, left
    means = mode[of_kind & ~direction(ONE_CAR, rotation)].reshape(2, 7)[:, 1:-1]
    assert_allclose(tilts[0], tilts[1], rtol=1e-6)
    assert np.all(tilts[:, 1:] * tilts[:, :-1] < 0)
    assert np.abs(means).max() < 0.1 * 1.548 * np.abs(tilts).max()


def test_a_mode_grows_below_the_static_limit_of_the_gain():
    gains = Gains(suspension_proportional="2400 A/m")  # i0 / gap0 = 2500 A/m
    roots = np.linalg.eigvals(linearly_closed(ONE_CAR, gains, (1, 1)))
    assert roots.real.max() > 1e-3


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"guidance_magnet": Train().guidance_magnet.model_copy(update={"preload": None})},
            "train.guidance_magnet.preload must be a positive force",
        ),
        (
            {"suspension_magnet": Train().suspension_magnet.model_copy(update={"preload": 3e4})},
            "train.suspension_magnet.preload must be null",
        ),
        (
            {"suspension_magnet": Train().suspension_magnet.model_copy(update={"n_poles": 1})},
            "n_poles must be at least 2",
        ),
        (
            {"suspension_magnet": Train().suspension_magnet.model_copy(update={"pole_pitch": 0.1})},
            "each pole must attract at rest",
        ),
    ],
)
def test_a_train_that_cannot_stand_is_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        build(Train().model_copy(update=changes))
