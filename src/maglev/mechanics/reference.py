"""The reference solver: every degree of freedom, Newmark's rule, iteration on the pole forces.

Written to be read and believed, not to be fast.  It shares with the production solver the physical
models of train, guideway and track, and no line of the time integration, the magnets or the
coupling.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.interpolate import CubicHermiteSpline
from scipy.signal import sosfilt
from scipy.sparse.linalg import splu
from tqdm import tqdm

from maglev.mechanics import guideway as guideway_model
from maglev.mechanics import train as train_model
from maglev.mechanics.course import n_steps, nose, time_step
from maglev.mechanics.irregularity import Profile
from maglev.mechanics.responses import Passages, acceleration_filter, checked_gains
from maglev.parameters import Config

Array = npt.NDArray[np.float64]

BETA, GAMMA = 0.25, 0.5
"""Newmark's parameters [-]: constant average acceleration, unconditionally stable."""

TOLERANCE = 1e-7
"""Largest change of any pole force in the last iteration, as a share of the static force [-]."""

MOST_ITERATIONS = 30
"""Iterations of one step after which the run is given up [-]; three or four are usual."""


@dataclass(frozen=True)
class Energy:
    """Energy account of each passage [J], all from zero at the start.

    Attributes
    ----------
    time : (step,)
    work_on_train, work_on_guideway : (step, sample)
        Work of the magnets' forces beyond those at rest on the train, and of all on the rails.
    dissipated : (step, sample)
        In links, bearings and the guideway's damping.
    stored : (step, sample)
        Kinetic and strain energy of train and guideway.
    """

    time: Array
    work_on_train: Array
    work_on_guideway: Array
    dissipated: Array
    stored: Array


class _Poles:
    """All poles of the train: where they sit on the magnets, and the rails under them."""

    def __init__(self, train: train_model.TrainModel, profile: Profile) -> None:
        magnets, parameters = train.magnets, train.parameters
        static = train_model.pole_static_force(parameters, magnets)
        kinds = (parameters.suspension_magnet, parameters.guidance_magnet)
        rows: list[tuple[int, int, float, float]] = []
        for magnet in range(magnets.x.size):
            kind = kinds[int(magnets.is_guidance[magnet])]
            for pole, dx in enumerate(train_model.pole_offsets(kind)):
                rows.append((magnet, pole, magnets.x[magnet] + dx, dx))
        self.magnet = np.array([row[0] for row in rows])
        self.x = np.array([row[2] for row in rows])
        dx = np.array([row[3] for row in rows])
        self.static_force = np.array([static[row[0], row[1]] for row in rows])
        self.is_guidance = magnets.is_guidance[self.magnet]
        self.side = magnets.side[self.magnet]
        self.opening = np.where(self.is_guidance, self.side, 1.0)  # of the gap per displacement
        arm = np.where(self.is_guidance, dx, -dx)
        number = np.arange(self.magnet.size)
        self.rows = sp.csr_array(  # displacement of the pole per degree of freedom
            (
                np.concatenate([np.ones(number.size), arm]),
                (
                    np.concatenate([number, number]),
                    np.concatenate(
                        [magnets.translation_dof[self.magnet], magnets.rotation_dof[self.magnet]]
                    ),
                ),
            ),
            shape=(number.size, train.mass.size),
        )

        def of_kind(name: str) -> Array:
            return np.where(self.is_guidance, *(getattr(kind, name) for kind in kinds[::-1]))

        self.gap, self.current = of_kind("gap_reference"), of_kind("current_reference")
        self.current_max = of_kind("current_max")
        self.constant = self.static_force * (self.gap / self.current) ** 2
        grid = profile.x0 + profile.dx * np.arange(profile.values.shape[1])
        self.profiles = [
            CubicHermiteSpline(grid, value, slope)
            for value, slope in zip(profile.values, profile.slopes, strict=True)
        ]
        self.profile = np.where(self.is_guidance, 2, 0) + np.where(self.side > 0, 0, 1)

    def irregularity(self, x: Array) -> tuple[Array, Array]:
        """Irregularity [m] and its slope [-] under each pole."""
        value, slope = np.empty(x.size), np.empty(x.size)
        for number, profile in enumerate(self.profiles):
            at = self.profile == number
            value[at], slope[at] = profile(x[at]), profile(x[at], 1)
        return value, slope

    def rail(
        self, x: Array, model: guideway_model.GuidewayModel
    ) -> tuple[sp.csr_array, sp.csr_array]:
        """Rows of the rail's displacement and slope under each pole; zero off the guideway."""
        on = (x >= 0) & (x <= model.parameters.length)
        order, displacement, slope = [], [], []
        for side in (1, -1):
            for guidance in (False, True):
                at = np.flatnonzero(on & (self.side == side) & (self.is_guidance == guidance))
                rows = model.rail_rows(x[at], side)
                order.append(at)
                displacement.append(rows[2 if guidance else 0])
                slope.append(rows[3 if guidance else 1])
        pole = np.concatenate(order)
        place = sp.csr_array(
            (np.ones(pole.size), (pole, np.arange(pole.size))), shape=(x.size, pole.size)
        )
        return place @ sp.vstack(displacement).tocsr(), place @ sp.vstack(slope).tocsr()


def integrate(
    config: Config,
    profile: Profile,
    gains: npt.ArrayLike,
    *,
    record_every: int = 0,
    progress: bool = False,
) -> tuple[Passages, Energy]:
    """Run one passage per row of gains, all at the same time.

    Parameters
    ----------
    config
        Parameters of everything.
    profile
        Track irregularity.
    gains : (sample, 4)
        Suspension k_p [A/m], k_d [A s/m], guidance k_p, k_d.
    record_every
        Steps between recorded rows of the histories; zero records none.
    progress
        Show a progress bar.

    Returns
    -------
    passages
        Extremes, outcomes and histories.
    energy
        Where the energy went.

    Raises
    ------
    ValueError
        If the gains have the wrong shape or are not finite.
    RuntimeError
        If a step does not converge.

    References
    ----------
    Newmark, J. Eng. Mech. Div. ASCE 85(EM3):67-94 (1959).
    """
    gains = checked_gains(gains)
    n_samples = gains.shape[0]
    train = train_model.build(config.train)
    model = guideway_model.build(config.guideway)
    poles = _Poles(train, profile)
    dt, last = time_step(config), n_steps(config)
    proportional = np.where(poles.is_guidance[:, None], gains[:, 2], gains[:, 0])
    derivative = np.where(poles.is_guidance[:, None], gains[:, 3], gains[:, 1])
    proportional, derivative = (
        proportional.reshape(-1, n_samples),
        derivative.reshape(-1, n_samples),
    )

    train_mass = sp.diags_array(train.mass)
    solve_train = splu(
        sp.csc_array(train_mass + GAMMA * dt * train.damping + BETA * dt**2 * train.stiffness)
    ).solve
    damping = guideway_model.damping(
        model, config.guideway.damping_ratio, config.passage.mode_cutoff
    )
    # The guideway's modal damping is weak and of low rank: it acts at the predicted velocity.
    effective = (1 + GAMMA * dt * damping.rate) * model.mass
    effective = effective + GAMMA * dt * model.bearing_damping + BETA * dt**2 * model.stiffness
    solve_guideway = splu(sp.csc_array(effective)).solve
    to_modes = np.ascontiguousarray(damping.mass_shape.T)
    modal_rate = np.zeros((to_modes.shape[0], n_samples))
    internal_g = np.zeros((model.n_dof, n_samples))

    middle = (config.guideway.n_spans // 2 + 0.5) * config.guideway.span_length
    midspan = sp.vstack(model.girder_rows(np.array([middle]))).tocsr()
    x_t, v_t, a_t = (np.zeros((train.mass.size, n_samples)) for _ in range(3))
    x_g, v_g, a_g, a_g_before = (np.zeros((model.n_dof, n_samples)) for _ in range(4))
    n_cars = config.train.n_cars
    n_magnets = train.magnets.x.size
    girder = np.zeros((last, 4, n_samples))
    body_z, body_y = np.zeros((2, last, n_cars, n_samples))
    gap_bounds = np.zeros((last, 2, 2, n_samples))  # kind, least and most
    current_max = np.zeros((last, 2, n_samples))
    per_magnet = sp.csr_array(
        (1 / np.bincount(poles.magnet)[poles.magnet], (poles.magnet, np.arange(poles.x.size)))
    )
    gap_history, current_history = [], []
    account = np.zeros((last, 4, n_samples))
    power = np.zeros((3, n_samples))
    status = np.zeros(n_samples, dtype=np.int64)
    lost_time = np.full(n_samples, np.nan)
    lost_magnet = np.full(n_samples, -1, dtype=np.int64)
    force = np.repeat(poles.static_force[:, None], n_samples, axis=1)
    before = force

    for step in tqdm(range(last), disable=not progress, desc="reference", unit="step"):
        time = (step + 1) * dt
        place = nose(config, time) + poles.x
        bump, ramp = poles.irregularity(place)
        rail, rail_slope = poles.rail(place, model)
        reached = place.max() >= 0  # until then the guideway rests
        # Newmark's predictors.
        x_t_star = x_t + dt * v_t + dt**2 * (0.5 - BETA) * a_t
        v_t_star = v_t + dt * (1 - GAMMA) * a_t
        x_g_star = x_g + dt * v_g + dt**2 * (0.5 - BETA) * a_g
        v_g_star = v_g + dt * (1 - GAMMA) * a_g
        internal_t = train.damping @ v_t_star + train.stiffness @ x_t_star
        if reached:
            modal_rate = to_modes @ (v_g_star + GAMMA * dt * (2 * a_g - a_g_before))
            internal_g = (
                damping.rate * (model.mass @ v_g_star)
                + damping.mass_shape @ (damping.coefficient[:, None] * modal_rate)
                + model.bearing_damping @ v_g_star
                + model.stiffness @ x_g_star
            )
        a_g_before = a_g
        force, before = 2 * force - before, force  # where the iteration starts
        for _ in range(MOST_ITERATIONS):
            on_train = poles.rows.T @ (
                -poles.opening[:, None] * (force - poles.static_force[:, None])
            )
            on_guideway = rail.T @ (poles.opening[:, None] * force)
            a_t = solve_train(on_train - internal_t)
            if reached:
                a_g = solve_guideway(on_guideway - internal_g)
            x_t, v_t = x_t_star + BETA * dt**2 * a_t, v_t_star + GAMMA * dt * a_t
            x_g, v_g = x_g_star + BETA * dt**2 * a_g, v_g_star + GAMMA * dt * a_g
            rail_rate = rail @ v_g + config.passage.speed * (rail_slope @ x_g + ramp[:, None])
            error = poles.opening[:, None] * (poles.rows @ x_t - rail @ x_g - bump[:, None])
            rate = poles.opening[:, None] * (poles.rows @ v_t - rail_rate)
            gap = poles.gap[:, None] + error
            current = poles.current[:, None] + proportional * error + derivative * rate
            current = np.clip(current, 0.0, poles.current_max[:, None])
            new = poles.constant[:, None] * (current / gap) ** 2
            change = np.abs(new - force)[:, status == 0] / poles.static_force[:, None]
            force = new
            if change.size == 0 or change.max() <= TOLERANCE:
                break
        else:
            raise RuntimeError(
                f"the pole forces did not converge within {MOST_ITERATIONS} iterations at "
                f"t = {time:.4f} s; take a smaller passage.time_step"
            )
        held = (gap > config.passage.gap_contact) & (gap < config.passage.gap_lost)
        for sample in np.flatnonzero((status == 0) & ~held.all(axis=0)):
            pole = np.flatnonzero(~held[:, sample])[0]
            lost_time[sample], lost_magnet[sample] = time, poles.magnet[pole]
            value = gap[pole, sample]
            status[sample] = 1 if value <= config.passage.gap_contact else 2
            if not np.isfinite(value):
                status[sample] = 3
        if status.any():  # a lost sample rests from here on
            for state in (x_t, v_t, a_t, x_g, v_g, a_g, a_g_before):
                state[:, status != 0] = 0.0
            force[:, status != 0] = poles.static_force[:, None]
            if status.all():
                break
        girder[step, :2], girder[step, 2:] = midspan @ x_g, midspan @ a_g
        body_z[step] = a_t[train.car_body_dof[:, 1]]
        body_y[step] = a_t[train.car_body_dof[:, 0]]
        for kind in range(2):
            of_kind = poles.is_guidance == bool(kind)
            gap_bounds[step, kind] = gap[of_kind].min(axis=0), gap[of_kind].max(axis=0)
            current_max[step, kind] = current[of_kind].max(axis=0)
        if record_every and (step + 1) % record_every == 0:
            gap_history.append(per_magnet @ gap)
            current_history.append(per_magnet @ current)
        new_power = np.stack(
            [
                (on_train * v_t).sum(axis=0),
                (on_guideway * v_g).sum(axis=0),
                (v_t * (train.damping @ v_t)).sum(axis=0)
                + (v_g * (damping.rate * (model.mass @ v_g) + model.bearing_damping @ v_g)).sum(
                    axis=0
                )
                + (damping.coefficient[:, None] * modal_rate**2).sum(axis=0),
            ]
        )
        account[step, :3] = account[max(step - 1, 0), :3] + 0.5 * dt * (power + new_power)
        power = new_power
        account[step, 3] = 0.5 * (
            (v_t * (train_mass @ v_t)).sum(axis=0)
            + (x_t * (train.stiffness @ x_t)).sum(axis=0)
            + (v_g * (model.mass @ v_g)).sum(axis=0)
            + (x_g * (model.stiffness @ x_g)).sum(axis=0)
        )
    times = (np.arange(last) + 1) * dt
    girder[:, 2:] = sosfilt(acceleration_filter(config.passage, dt), girder[:, 2:], axis=0)
    extreme, when = _extremes(girder, times, status)
    extreme_z, when_z = _extremes(body_z, times, status)
    extreme_y, when_y = _extremes(body_y, times, status)
    kept = slice(record_every - 1, None, record_every) if record_every else slice(0, 0)

    def samples_first(history: Array) -> Array:
        return np.moveaxis(history[kept], (0, 1, 2), (2, 1, 0))

    def stacked(history: list[Array]) -> Array:
        if not history:
            return np.zeros((n_samples, n_magnets, 0))
        return np.moveaxis(np.array(history), (0, 1, 2), (2, 1, 0))

    passages = Passages(
        girder=extreme,
        girder_time=when,
        body_z=extreme_z,
        body_y=extreme_y,
        body_z_time=when_z,
        body_y_time=when_y,
        gap_min=np.minimum(gap_bounds[:, :, 0].min(axis=0), [[10e9]]).T,
        gap_max=gap_bounds[:, :, 1].max(axis=0).T,
        current_max=current_max.max(axis=0).T,
        status=status,
        lost_time=lost_time,
        lost_magnet=lost_magnet,
        time=times[kept],
        girder_history=samples_first(girder),
        body_z_history=samples_first(body_z),
        body_y_history=samples_first(body_y),
        gap_history=stacked(gap_history),
        current_history=stacked(current_history),
    )
    return passages, Energy(times, *np.moveaxis(account, 1, 0))


def _extremes(history: Array, times: Array, status: npt.NDArray[np.int64]) -> tuple[Array, Array]:
    """Largest absolute value (sample, …) and its time; NaN for lost samples."""
    at = np.abs(history).argmax(axis=0)
    value = np.take_along_axis(np.abs(history), at[None], axis=0)[0].T.copy()
    when = times[at].T.copy()
    value[status != 0], when[status != 0] = np.nan, np.nan
    return value, when
