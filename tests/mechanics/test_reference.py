"""The reference solver: against the production solver, its order, and where its energy goes."""

from functools import lru_cache
from itertools import pairwise
from unittest import mock

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maglev.errors import UserError
from maglev.mechanics import course as course_module
from maglev.mechanics import (
    guideway,
    integrate,
    reference,
    reference_magnets,
    reference_step,
)
from maglev.mechanics import train as train_model
from maglev.mechanics.course import course
from maglev.mechanics.responses import checked_gains, responses
from maglev.parameters import Config, Control
from maglev.simulation import track
from maglev.vocabulary import RESPONSES
from passages import MEAN

GAINS = MEAN * [[1.0, 1.0, 1.0, 1.0], [1.2, 0.85, 1.1, 0.9], [0.4, 1.0, 1.0, 1.0]]
"""Mean, other, and k_p below i₀/δ₀ = 2500 A/m: the last cannot levitate."""

PERIOD = 0.258 / (430 / 3.6)
"""Of pole passing [s]."""


def small(parts, c_frame_spacing=1.548, heavier=1.0, cutoff=2000.0, approach=5.16):
    """A short car on a span of its length; poles enter half-way between steps.

    ``parts`` is the number of steps in the pole-passing period, odd; a guideway ``heavier`` times
    swings as many times slower, squared.
    """
    girder, rail, pier = Config().guideway.girder, Config().guideway.rail, Config().guideway.pier
    length = 8 * c_frame_spacing
    n_poles = round(c_frame_spacing / 0.258)
    return Config.model_validate(
        {
            "train": {
                "n_cars": 1,
                "car_pitch": f"{length} m",
                "bogie": {"c_frame_spacing": f"{c_frame_spacing} m"},
                "suspension_magnet": {"n_poles": n_poles, "pole_pitch": "0.258 m"},
                "guidance_magnet": {
                    "n_poles": 2,
                    "pole_pitch": f"{c_frame_spacing / 2} m",
                    "preload": "10 kN",
                },
            },
            "guideway": {
                "n_spans": 1,
                "span_length": f"{length} m",
                "girder": heavy(girder, heavier),
                "rail": {
                    "section": heavy(rail.section, heavier),
                    "connector_mass": f"{rail.connector_mass * heavier} kg/m",
                    "units_per_span": round(length / 3.096),
                },
                "pier": {"density": f"{pier.density * heavier} kg/m^3"},
            },
            "irregularity": {"fade_in": f"{approach} m"},
            "passage": {
                "approach": f"{approach} m",
                "time_step": f"{PERIOD / parts * 1.0001} s",
                "mode_cutoff": f"{cutoff} Hz",
                "mode_cutoff_elsewhere": f"{cutoff} Hz",
            },
        }
    )


def heavy(section, factor):
    """A section of the same stiffness with more mass."""
    return section.quantities() | {
        "density": f"{section.density * factor} kg/m^3",
        "polar_inertia": f"{section.polar_inertia * factor} kg m",
    }


@lru_cache
def reference_passages(config, n_samples, every):
    return reference.integrate(config, track(config), GAINS[:n_samples], record_every=every)


@lru_cache
def both():
    """Passages of both solvers at the same times.

    The production solver keeps modes to 2000 Hz and takes three times finer steps.
    """
    found, _ = reference_passages(small(13), 3, 1)
    fine = small(39)
    production = integrate.integrate(integrate.prepare(fine, track(fine)), GAINS, record_every=3)
    return found, production


@pytest.mark.parametrize("name", ["girder", "body_z", "body_y", "gap_min", "gap_max"])
def test_extremes_are_those_of_the_production_solver(name):
    found, production = both()
    assert_allclose(getattr(production, name)[:2], getattr(found, name)[:2], rtol=5e-3)


@pytest.mark.parametrize("name", RESPONSES)
def test_responses_are_those_of_the_production_solver(name):
    """Lift off the bearings within 3.5 %: the rule stretches the periods of what is stiff.

    With steps two and three times finer it is 1.1 and 0.6 % off.
    """
    found, production = (responses(one)[name] for one in both())
    tolerance = {"bearing_uplift": 3.5e-2, "suspension_current_share": 2e-2}.get(name, 5e-3)
    assert_allclose(production.value[:2], found.value[:2], rtol=tolerance)
    assert production.parts.keys() == found.parts.keys()
    for part in ("_per_car", "_positive", "_negative"):
        if part in found.parts:
            assert_allclose(production.parts[part][:2], found.parts[part][:2], rtol=5e-3)
    assert np.isnan(found.value[2]) and np.isnan(production.value[2])


def test_the_largest_current_of_any_pole_is_that_of_the_production_solver():
    """Within 2 %: a pole that meets a joint of the rails feels modes beyond 2000 Hz."""
    found, production = both()
    assert_allclose(production.current_max[:2], found.current_max[:2], rtol=2e-2)


@pytest.mark.parametrize(
    ("name", "peak"),
    [
        ("girder_history", 2e-2),
        ("body_z_history", 1e-2),
        ("body_y_history", 5e-3),
        ("gap_history", 1e-2),
        ("current_history", 5e-2),
    ],
)
def test_histories_are_those_of_the_production_solver(name, peak):
    """Within 0.5 % of their largest departure from rest in the mean square.

    Girder displacements also at every instant; accelerations, gaps and currents have peaks
    where rails meet.
    """
    found, production = both()
    one, other = getattr(found, name)[:2], getattr(production, name)[:2]
    n = min(one.shape[-1], other.shape[-1])
    one, other = one[..., :n], other[..., :n]
    assert_allclose(found.time[:n], production.time[:n], rtol=1e-9)
    rest = {"gap_history": 0.010, "current_history": 25.0}.get(name, 0.0)
    largest = np.abs(one - rest).max(axis=-1, keepdims=True)
    if rest:
        largest = largest.max(axis=1, keepdims=True)
    error = np.abs(one - other) / largest
    assert np.sqrt((error**2).mean(axis=-1)).max() < 5e-3
    assert error.max() < peak
    if name == "girder_history":
        assert error[:, :2].max() < 5e-3


def test_levitation_is_lost_as_in_the_production_solver():
    found, production = both()
    assert_array_equal(found.status, production.status)
    assert found.status[2] in (1, 2)
    half = found.gap_history.shape[1] // 2
    assert found.lost_magnet[2] // half == production.lost_magnet[2] // half == 0  # suspension
    assert_allclose(found.lost_time[2], production.lost_time[2], rtol=1e-2)
    for name in ("girder", "girder_time", "body_z", "body_y"):
        assert np.isnan(getattr(found, name)[2]).all()
        assert np.isfinite(getattr(found, name)[:2]).all()
    assert_array_equal(found.lost_magnet[:2], -1)


GROUPS = ("pole", "ends", "half", "lumped")


def controlled(config, **circuit):
    """The configuration with both kinds of magnet in the same kind of circuit."""
    control = Control.model_validate({"suspension": circuit, "guidance": circuit})
    return config.model_copy(update={"control": control})


def with_faces(config, length):
    """The configuration with faces of one length [m] on all poles."""
    kinds = ("suspension_magnet", "guidance_magnet")
    faces = {
        kind: getattr(config.train, kind).model_copy(update={"pole_length": length})
        for kind in kinds
    }
    return config.model_copy(update={"train": config.train.model_copy(update=faces)})


def drawn(n_sets):
    """Gains (sample, 8) of the study, normal with a CoV of 0.10."""
    factor = 1 + 0.10 * np.random.default_rng(17).standard_normal((n_sets, 4))
    return checked_gains(MEAN * factor)


def six(passages):
    """Extremes (sample, response)."""
    worst = [passages.body_z.max(axis=1), passages.body_y.max(axis=1)]
    return np.column_stack([passages.girder, *worst])


CIRCUITS = {group: {"group": group} for group in GROUPS} | {
    "late": {"group": "pole", "lag": "2 ms", "delay": "1 ms"}
}


@pytest.mark.slow
@pytest.mark.parametrize("circuit", CIRCUITS)
def test_both_solvers_agree_on_gains_drawn_at_random(circuit):
    """Within 0.5 %, the reference right to 0.2 %, production with modes to 2000 Hz and fine steps.

    Modes up to 300 Hz, enough for spans of 25 m, leave up to 0.9 % on these of half the length.
    """
    config = controlled(small(39), **CIRCUITS[circuit])
    gains, profile = drawn(10), track(config)
    found, effort = reference.solve(config, profile, gains, tolerance=2e-3)
    production = integrate.integrate(integrate.prepare(config, profile), gains)
    assert not found.status.any()
    assert not production.status.any()
    assert effort.error.max() <= 2e-3
    assert_allclose(six(production), six(found), rtol=5e-3)


ACCOUNTS = {
    **CIRCUITS,
    "all": {"group": "ends", "lag": "1 ms", "delay": "0.3 ms"},
}


@pytest.mark.parametrize("circuit", ACCOUNTS)
def test_the_work_of_the_magnets_is_dissipated_or_stored(circuit):
    further = (0.2, 2e3, 0.2, 2e3) if circuit == "all" else (0.0,) * 4
    config = controlled(small(5, cutoff=850.0), **ACCOUNTS[circuit])
    gains = checked_gains([MEAN], further)
    _, energy = reference.integrate(config, track(config), gains)
    work = (energy.work_on_train + energy.work_on_guideway)[:, 0]
    dissipated, stored = energy.dissipated[:, 0], energy.stored[:, 0]
    assert np.abs(work - dissipated - stored).max() < 1e-2 * np.abs(work).max()
    assert dissipated[-1] > 0.05 * np.abs(work).max()
    assert stored.max() > 0.05 * np.abs(work).max()


@lru_cache
def plain():
    """Extremes of the plain law with a step of 0.43 ms."""
    return six(once(small(5)))


def once(config):
    return reference.integrate(config, track(config), [MEAN])[0]


@pytest.mark.parametrize("limit", ["lag", "delay"])
def test_short_lags_and_delays_tend_to_the_plain_law(limit):
    """Differences from the plain law fall as the lag or the delay does."""
    several = [controlled(small(5), **{limit: f"{value} ms"}) for value in (0.1, 0.025)]
    far, near = (np.abs(six(once(config)) / plain() - 1).max() for config in several)
    assert near < 0.5 * far
    assert near < 1e-2


def test_a_short_face_sees_what_a_point_sees():
    """Away from joints: the rate of a face across one has a jump that a point's leaves out."""
    model = guideway.build(small(5).guideway)
    x = np.random.default_rng(3).standard_normal(model.n_dof)
    seen = []
    for length in (1e-4, 0.0):
        train = train_model.build(with_faces(small(5), length).train)
        poles = reference_magnets.poles_of(train)
        rails = reference_magnets.Rails(model, poles)
        to_joint = np.abs((8.0 + poles.x) / 3.096 - np.round((8.0 + poles.x) / 3.096))
        rows = rails.under(8.0 + poles.x[None], 100.0, 1e-6)
        seen.append([(of @ (rails.ends @ x))[to_joint > 0.01] for of in rows])
    for face, point in zip(*seen, strict=True):
        assert_allclose(face, point, rtol=1e-3, atol=1e-3 * np.abs(point).max())


@pytest.mark.parametrize("group", GROUPS)
def test_a_train_on_smooth_rigid_track_stays_at_rest(group):
    config = controlled(small(5), group=group, lag="1 ms", delay="0.5 ms")
    smooth = config.irregularity.model_copy(update={"enabled": False})
    config = config.model_copy(update={"irregularity": smooth})
    step = course(config).time_step
    before_the_guideway = int(config.passage.approach / config.passage.speed / step)
    gains, profile = checked_gains([MEAN]), track(config)
    record = reference.passed(config, profile, gains, step, before_the_guideway)
    assert np.abs(record.body_z).max() < 1e-9
    assert np.abs(record.gap_min - 0.010).max() < 1e-12
    assert np.abs(record.current_max - 25.0).max() < 1e-8


def test_a_face_sees_the_mean_of_the_rail_and_its_rate():
    """Against a fine sum over the face, joints included, and against a difference in time."""
    config = small(5)
    model, train = guideway.build(config.guideway), train_model.build(config.train)
    poles = reference_magnets.poles_of(train)
    rails = reference_magnets.Rails(model, poles)
    x = np.random.default_rng(2).standard_normal(model.n_dof)
    speed, step, place = 100.0, 1e-9, 8.0 + poles.x
    mean, travel = rails.under(place[None], speed, step)
    for pole in (0, poles.x.size - 1):
        cells = place[pole] + poles.face[pole] * ((np.arange(20000) + 0.5) / 20000 - 0.5)
        rows = model.rail_rows(cells, int(poles.side[pole]))[2 if poles.is_guidance[pole] else 0]
        assert_allclose((mean @ (rails.ends @ x))[pole], (rows @ x).mean(), rtol=1e-3)
    later, _ = rails.under(place[None] + speed * 1e-6, speed, step)
    assert_allclose(
        (travel @ (rails.ends @ x)) * 1e-6,
        (later - mean) @ (rails.ends @ x),
        rtol=1e-2,
        atol=1e-6 * np.abs(x).max(),
    )


def test_a_current_follows_a_ramp_of_its_command_exactly():
    lag, step = 2e-3, 0.3e-3
    decay, newest = reference_magnets.lag_weights(lag, step)
    time = step * np.arange(40)
    command, current = 7.0 * time, [0.0]
    for before, now in pairwise(command):
        current.append(decay * current[-1] + newest * now + (1 - decay - newest) * before)
    assert_allclose(current, 7.0 * (time - lag * (1 - np.exp(-time / lag))), atol=1e-15)
    assert reference_magnets.lag_weights(0.0, step) == (0.0, 1.0)


@pytest.mark.parametrize("delay", [0.0, 0.1e-3, 0.3e-3, 1e-3])
def test_a_delayed_cubic_is_a_cubic(delay):
    step, now = 0.3e-3, 5e-3
    taps = reference_magnets.delay_taps(delay, step)
    signal = sum(weight * (now - back * step) ** 3 for back, weight in taps.items())
    assert_allclose(signal, (now - delay) ** 3, rtol=1e-12)
    assert min(taps) >= 0


def test_the_estimated_error_is_honest():
    """The extremes of two drawn sets against steps six times shorter than the first."""
    config = small(5, cutoff=300.0)
    gains, profile = drawn(12)[10:], track(config)
    found, effort = reference.solve(config, profile, gains, tolerance=5e-3)
    fine = reference.passed(config, profile, gains, effort.step / 3, 3 * effort.n_steps)
    limit = reference.six_extremes(fine)
    error = np.abs(six(found) / limit - 1)
    assert np.all(error < np.maximum(effort.error, 5e-4))
    assert error.max() < 2e-3


def test_an_error_that_stays_too_large_is_refused():
    config = small(5, cutoff=300.0)
    with (
        mock.patch.object(reference, "MOST_HALVINGS", 1),
        mock.patch.object(reference, "FIRST_STEP", 1e-3),
    ):
        with pytest.raises(UserError, match=r"^reference: expected errors of at most 1e-06 %"):
            reference.solve(config, track(config), [MEAN], tolerance=1e-8)


def test_pole_forces_that_do_not_converge_are_refused():
    config = small(5, cutoff=300.0)
    with (
        mock.patch.object(reference_step, "MOST_ITERATIONS", 1),
        pytest.raises(
            UserError, match=r"^reference: the pole forces must converge in 1 iter.* t ="
        ),
    ):
        reference.integrate(config, track(config), [MEAN])


@lru_cache
def orders():
    """Slopes of log error on log step.

    The guideway is a million times heavier, its modes a thousand times slower, so that steps
    follow all that matter; those of a real rail reach many kHz.  Runs of all steps start at one
    place.  Six steps in a pole-passing period are the fewest: with less, harmonics of the load,
    which has kinks where faces meet joints, fold into its mean.
    """
    with mock.patch.object(course_module, "JOINT_SHARE", 0.0):
        return _orders()


def _orders():
    parts, finest = np.array([6, 8, 12]), 36

    def histories(n):
        found = reference_passages(small(int(n), 0.774, 1e6, 1.0, 2.58), 1, int(n))[0]
        return {
            "car body acceleration": found.body_z_history[0, 0],
            "gap": found.gap_history[0, 0],
            "girder displacement": found.girder_history[0, 0],
        }

    fine = histories(finest)
    errors = {name: [] for name in fine}
    for n in parts:
        for name, history in histories(n).items():
            m = min(history.size, fine[name].size)
            errors[name].append(np.sqrt(((history[:m] - fine[name][:m]) ** 2).mean()))
    slopes = {
        name: np.polyfit(np.log(1 / parts), np.log(error), 1)[0] for name, error in errors.items()
    }
    return slopes


@pytest.mark.parametrize("quantity", ["car body acceleration", "gap", "girder displacement"])
def test_the_error_falls_with_the_square_of_the_step(quantity):
    slope = orders()[quantity]
    assert 1.7 < slope < 2.5, slope


def test_steps_fit_the_pole_passing():
    for upper in (0.1e-3, 0.25e-3, 1e-3):
        config = Config.model_validate({"passage": {"time_step": f"{upper} s"}})
        parts = PERIOD / course(config).time_step
        assert_allclose(parts, round(parts), rtol=1e-9)
        assert round(parts) % 2 == 0  # suspension and guidance poles stand half a pitch apart
        assert upper * (1 - 2 / parts) < course(config).time_step <= upper * (1 + 1e-9)
    way = 150 + 2 * 5 * 24.768
    assert course(Config()).n_steps * course(Config()).time_step >= way / (430 / 3.6) - 1e-9
