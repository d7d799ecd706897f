"""Passages from a configuration and gains: the function that users of the model call."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import xarray as xr
from threadpoolctl import threadpool_limits

from maglev import datasets, profiles
from maglev.arrays import FloatArray, IntArray
from maglev.errors import StepTooLarge, UserError
from maglev.fingerprint import file_hash
from maglev.mechanics import integrate
from maglev.mechanics import train as train_model
from maglev.mechanics.course import course, track_range
from maglev.mechanics.irregularity import Profile, profile
from maglev.mechanics.responses import (
    GIRDER_RESPONSES,
    Passages,
    checked_gains,
    in_their_order,
    not_judged,
    responses,
)
from maglev.mechanics.varied import beyond_the_basis, checked_values, cost_of, equal_samples
from maglev.parameters import Config

KEPT_TRACKS = 64
"""Irregularities that are kept while samples run, one for each seed [-]; assumed: 10 MB."""

HISTORY_INTERVAL = 1e-3
"""Time between recorded rows of the histories, at most [s]; assumed: ten points in a period of the
highest frequency in the band of the responses."""


def simulate(
    config: Config,
    gains: npt.ArrayLike,
    histories: bool | Literal["responses"] = False,
    solver: Literal["production", "reference"] = "production",
    *,
    values: Mapping[str, npt.ArrayLike] | None = None,
    track_seeds: npt.ArrayLike | None = None,
    n_threads: int = 1,
    on_progress: Callable[[int], None] | None = None,
) -> xr.Dataset:
    """Take the train over the guideway once for every row of gains.

    A sample's numbers do not depend on its neighbours, on their number or on ``n_threads``.

    Parameters
    ----------
    config
        Parameters of everything, from `maglev.load_config`.
    gains : (sample, 4) or (sample, 8)
        Suspension k_p [A/m], k_d [A s/m], guidance k_p [A/m], k_d [A s/m]; then suspension k_a
        [A s²/m], k_i [A/(m s)], guidance k_a, k_i, those of ``config.gains`` if left out.
    histories
        Whether to keep the time series of responses, gaps and currents; ``"responses"``: without
        gaps and currents, which are most of their size.
    solver
        ``"production"``: compiled, many samples at once; ``"reference"``: full finite elements with
        a step of its own, halved until the extremes are right to 0.1 %, some thousand times slower.
    values : key of (sample,)
        Numbers in SI of each sample in place of those of the configuration, by dotted keys such as
        ``"train.car_body.mass"``; `cost_of` says what they cost.
    track_seeds : (sample,)
        Seed of each sample's irregularity; ``config.seed`` for all if not given.
    n_threads
        Rows of samples that the production solver runs at the same time; the numbers do not depend
        on it.
    on_progress
        Called with the number of samples that have just finished (production solver).

    Returns
    -------
    passages
        Layout ``passage`` of `maglev.datasets`: on ``sample`` the responses of
        `maglev.vocabulary.RESPONSE_TABLE` and the times of those that have one [s], gaps [m],
        currents [A], ``status`` and where and when levitation was lost; with ``histories`` also the
        time series on ``t``.  The responses of a lost sample are NaN, as are those of a sample
        whose gains ask for a smaller step, which is not judged (status ``step_too_large``).
        Attributes ``time_step`` [s], ``n_steps``, both the largest of any sample, and ``track``,
        the words for the track that the numbers are of; of the reference solver also
        ``estimated_error``, the largest of the six responses of the paper as a share of it, and
        ``seconds``.

    Raises
    ------
    UserError
        If the gains have another shape or are not finite, the time step exceeds the stability
        limit, the irregularity does not cover the passage, the solver is unknown, the seeds are
        not whole numbers from zero, one for each sample of the production solver, a value is of no
        number of the configuration, or will not do for it, or the reference solver does not reach
        its accuracy.
    FileNotFoundError
        If the irregularity's file does not exist.

    References
    ----------
    docs/theory/integration.md.

    Examples
    --------
    >>> from maglev.parameters import Config
    >>> from maglev.vocabulary import STATUS
    >>> short = {"train": {"n_cars": 1}, "guideway": {"n_spans": 1}}
    >>> config = Config.model_validate(short)
    >>> passages = simulate(config, [config.gains.as_row])
    >>> deflection = passages["girder_displacement_z"].item()
    >>> 0.0 < deflection < 5e-3
    True
    >>> STATUS[passages["status"].item()]
    'completed'
    """
    gains = checked_gains(gains, config.gains.further)
    if histories not in (False, True, "responses"):
        raise UserError(f"histories must be False, True or 'responses', got {histories!r}")
    if solver not in ("production", "reference"):
        raise UserError(f"solver must be 'production' or 'reference', got {solver!r}")
    seeds = None if track_seeds is None else _checked_seeds(track_seeds, gains.shape[0], solver)
    given = checked_values(config, values or {}, gains.shape[0])
    groups = _groups(config, given, gains.shape[0], solver)
    _refuse_unequal_histories(groups, histories)
    with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(n_threads) as pool:
        found = list(
            pool.map(
                lambda group: _run(
                    group,
                    gains,
                    given,
                    histories,
                    solver,
                    seeds,
                    n_threads if len(groups) == 1 else 1,
                    on_progress,
                ),
                groups,
            )
        )
    passages = in_their_order([one for one, _ in found], [group.rows for group in groups])
    whole = _dataset(groups, gains, passages, histories)
    whole.attrs["track"] = track_words(config, seeds)
    if solver == "reference":
        worst = max((effort for _, effort in found), key=lambda effort: effort["estimated_error"])
        whole.attrs |= worst | {"seconds": sum(effort["seconds"] for _, effort in found)}
    return datasets.describe(whole)


@dataclass(frozen=True)
class _Group:
    """Samples that share a system.

    Their numbers, its configuration, whether that is not the one given, and what else each has of
    its own.
    """

    rows: IntArray
    config: Config
    anew: bool
    own: tuple[str, ...]


def _groups(
    config: Config, values: Mapping[str, FloatArray], n_samples: int, solver: str
) -> list[_Group]:
    """Samples in groups of equal values of what is built anew; all of it for the reference."""
    cost = cost_of(config, values)
    built = [key for key in values if cost[key] == "rebuild" or solver == "reference"]
    own = tuple(key for key in values if key not in built)
    anew = np.zeros(n_samples, dtype=bool)
    for key in own:
        if cost[key] == "guideway":
            anew |= beyond_the_basis(config, key, values[key])
    for sample in range(n_samples if own else 0):  # refused before anything is computed
        numbers = {key: float(values[key][sample]) for key in values}
        config.with_numbers(numbers, f"sample {sample}: ")
    columns = [values[key] for key in built]
    columns += [np.where(anew, values[key], 0.0) for key in own if cost[key] == "guideway"]
    found = []
    for rows in equal_samples([*columns, anew], n_samples):
        whole = [key for key in own if anew[rows[0]] and cost[key] == "guideway"]
        numbers = {key: float(values[key][rows[0]]) for key in [*built, *whole]}
        place = f"sample {rows[0]}: "
        of_group = config.with_numbers(numbers, place) if numbers else config
        rest = tuple(key for key in own if key not in whole)
        found.append(_Group(rows, of_group, bool(numbers), rest))
    return found


def _refuse_unequal_histories(groups: Sequence[_Group], histories: bool | str) -> None:
    """Refuse histories of samples whose steps or magnets are not the same."""
    ways = {(course(one.config).time_step, course(one.config).n_steps) for one in groups}
    trains = {one.config.train.n_cars for one in groups}
    if histories and (len(ways) > 1 or len(trains) > 1):
        raise UserError(
            "histories need the same times and magnets for all samples, but the values change the "
            "run's length, its step or the number of cars; ask for these samples one by one"
        )


def _run(
    group: _Group,
    gains: FloatArray,
    values: Mapping[str, FloatArray],
    histories: bool | str,
    solver: str,
    seeds: list[int] | None,
    n_threads: int,
    on_progress: Callable[[int], None] | None,
) -> tuple[Passages, dict[str, Any]]:
    """Passages of a group, and what the reference solver says of its effort."""
    config, rows = group.config, group.rows
    if solver == "reference":
        from maglev.mechanics import reference  # seldom needed

        interval = HISTORY_INTERVAL if histories else None
        passages, effort = reference.solve(
            config, track(config), gains[rows], record_interval=interval
        )
        return passages, effort.attributes
    step = course(config).time_step
    every = max(1, int(HISTORY_INTERVAL / step * (1 + 1e-9))) if histories else 0
    try:
        system = _system(config, _track_file_hash(config))
    except StepTooLarge:
        if not group.anew or histories:  # the configuration's own step, or no histories to give
            raise
        return not_judged(config, rows.size), {}
    passages = integrate.integrate(
        system,
        gains[rows],
        values={key: values[key][rows] for key in group.own},
        profile_of=None if seeds is None else _tracks_of(config, [seeds[k] for k in rows]),
        record_every=every,
        with_magnets=histories != "responses",
        n_threads=n_threads,
        on_progress=on_progress,
    )
    return passages, {}


def track(config: Config, seed: int | None = None) -> Profile:
    """Irregularity over the whole track under the train.

    Parameters
    ----------
    config
        Parameters of everything.
    seed
        Of its phases; ``config.seed`` if not given.  A measured profile and a smooth track have
        none.

    Raises
    ------
    UserError, FileNotFoundError
        If a measured profile cannot be read or does not cover the passage.

    Examples
    --------
    >>> from maglev.parameters import Config
    >>> found = track(Config(), seed=1)
    >>> found.values.shape[0]  # both rails, vertical and lateral
    4
    """
    irregularity = config.irregularity
    name = irregularity.profile_file if irregularity.enabled else None
    measured = profiles.read(name) if name else None
    chosen = config.seed if seed is None else seed
    return profile(irregularity, track_range(config), chosen, measured)


def track_words(config: Config, seeds: Sequence[int] | None = None) -> str:
    """Name of the track of a configuration in words.

    Parameters
    ----------
    config
        Parameters of everything.
    seeds
        Of the tracks of samples that have each their own.

    Examples
    --------
    >>> from maglev.parameters import Config
    >>> track_words(Config())
    'track of seed 20240919'
    """
    if not config.irregularity.enabled:
        return "smooth track"
    if config.irregularity.profile_file is not None:
        return "measured track"
    if seeds is not None:
        return "a track of its own for every passage"
    return f"track of seed {config.seed}"


def _tracks_of(config: Config, seeds: list[int]) -> Callable[[int], Profile]:
    """The irregularity of a sample by its number; samples of one seed share it."""
    of_seed = lru_cache(maxsize=KEPT_TRACKS)(lambda seed: track(config, seed))
    return lambda sample: of_seed(seeds[sample])


def _checked_seeds(track_seeds: npt.ArrayLike, n_samples: int, solver: str) -> list[int]:
    seeds = np.asarray(track_seeds)
    if seeds.shape != (n_samples,) or seeds.dtype.kind not in "iu" or (seeds < 0).any():
        raise UserError(
            f"track_seeds must be {n_samples} whole numbers from zero, one for each sample, "
            f"got {seeds.dtype} of shape {seeds.shape}"
        )
    if solver != "production":
        raise UserError(
            "the reference solver takes one track for all samples; leave track_seeds out, "
            "or take the production solver"
        )
    return [int(seed) for seed in seeds]


def _track_file_hash(config: Config) -> str:
    """Hash of the measured irregularity; empty without one, or where reading it will fail."""
    irregularity = config.irregularity
    name = irregularity.profile_file if irregularity.enabled else None
    return file_hash(name) if name and Path(name).is_file() else ""


@lru_cache(maxsize=2)
def _system(config: Config, _track_file: str) -> integrate.System:
    """Prepared train, guideway and track of a configuration, cached for the next call."""
    return integrate.prepare(config, track(config))


def _dataset(
    groups: Sequence[_Group], gains: FloatArray, passages: Passages, histories: bool | str
) -> xr.Dataset:
    one, config = ("sample",), groups[0].config
    ways = [course(group.config) for group in groups]
    variables: dict[str, tuple[tuple[str, ...], npt.NDArray]] = {
        name: (one, gains[:, k]) for k, name in enumerate(datasets.GAINS)
    }
    for name, found in responses(passages).items():
        for part, values in found.parts.items():
            variables[f"{name}{part}"] = (one if values.ndim == 1 else ("sample", "car"), values)
    for k, kind in enumerate(("suspension", "guidance")):
        variables[f"{kind}_gap_min"] = (one, passages.gap_min[:, k])
        variables[f"{kind}_gap_max"] = (one, passages.gap_max[:, k])
        variables[f"{kind}_current_max"] = (one, passages.current_max[:, k])
    variables["status"] = (one, passages.status)
    variables["lost_t"] = (one, passages.lost_time)
    variables["lost_magnet"] = (one, passages.lost_magnet)
    coordinates: dict[str, npt.NDArray] = {
        "sample": np.arange(gains.shape[0]),
        "car": np.arange(passages.body_z.shape[1]),
    }
    if histories:
        for k, name in enumerate(GIRDER_RESPONSES):
            variables[f"{name}_history"] = (("sample", "t"), passages.girder_history[:, k])
        of_car = ("sample", "car", "t")
        variables["car_body_acceleration_z_history"] = (of_car, passages.body_z_history)
        variables["car_body_acceleration_y_history"] = (of_car, passages.body_y_history)
        coordinates |= {"t": passages.time}
    if histories and histories != "responses":
        of_magnet = ("sample", "magnet", "t")
        variables["gap_history"] = (of_magnet, passages.gap_history)
        variables["current_history"] = (of_magnet, passages.current_history)
        magnets = train_model.build(config.train).magnets
        variables["magnet_kind"] = (("magnet",), magnets.is_guidance.astype(np.int8))
        variables["magnet_side"] = (("magnet",), magnets.side)
        variables["magnet_x"] = (("magnet",), magnets.x)
        coordinates |= {"magnet": np.arange(magnets.x.size)}
    return xr.Dataset(
        variables,
        coords=coordinates,
        attrs={
            "time_step": max(way.time_step for way in ways),
            "n_steps": max(way.n_steps for way in ways),
        },
    )
