"""Densities, limits and shares of the variance on the line (random track) and on each track."""

from __future__ import annotations

import logging

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from maglev.arrays import FloatArray
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import coordinates, population, responses_of
from maglev.stages.limits import limits_off, status_numbers
from maglev.stages.reads import PREDICTING
from maglev.stages.surrogate import predictor
from maglev.stages.tables import markdown, number
from maglev.uncertainty.gdee import direct_density, silverman_bandwidth
from maglev.uncertainty.reliability import Limits, clustered_limits
from maglev.uncertainty.shares import crossed_shares, first_order
from maglev.vocabulary import GIVEN, LIMIT_STATUS, RESPONSE_UNITS

_LOG = logging.getLogger(__name__)

N_POINTS = 2**15
"""Points at which the surrogate of each track is evaluated; assumed: 33 of them lie beyond a limit
at 1e-3, and the intervals include their sampling."""

N_CELLS = 1001
"""Values at which densities are given [-]; assumed: a few per kernel of the narrowest track."""

REACH = 4.0
"""Margin beyond the smallest and the largest value, in bandwidths of the widest track."""

NARROW = 0.4
"""Share of the gains' variation of a second set of limits: 0.04 where gains vary by 0.10, the ends
of the paper's range.  It lies within the range of the runs, so nothing is extrapolated.
"""


def dataset(config: Config, tracks: xr.Dataset) -> xr.Dataset:
    """Shares of the variance, densities and limits of the line and of each track.

    Points of the gains at which levitation is lost on any track are left out: all results but the
    lost shares hold given that levitation holds.

    Parameters
    ----------
    config
        The configuration.
    tracks
        Layout ``tracks``.

    Returns
    -------
    dataset
        Layout ``line``.

    Raises
    ------
    UserError
        If too few points of the gains are held on all tracks, or a surrogate cannot be fitted.

    References
    ----------
    docs/theory/reliability.md, sec. 5.
    """
    away = tracks["status_on_track"].to_numpy() != 0
    kept = ~away.any(axis=0)
    values = tracks["extreme"].to_numpy()[:, kept]
    n_tracks = values.shape[0]
    columns: dict[str, list[FloatArray]] = {}
    for response, name in enumerate(responses_of(tracks)):
        at, of_track = _densities(values[:, :, response])
        share = crossed_shares(values[:, :, response], config.study.confidence)
        for key, one in (
            ("value", at),
            ("density_of_track", of_track),
            ("density_of_line", of_track.mean(axis=0)),
            *((f"gains_share{end}", share.first[k]) for k, end in _ENDS),
            *((f"track_share{end}", share.second[k]) for k, end in _ENDS),
            *((f"interaction_share{end}", share.interaction[k]) for k, end in _ENDS),
        ):
            columns.setdefault(key, []).append(one)
        _LOG.info(
            "%s: gains %.2f [%.2f, %.2f], track %.2f [%.2f, %.2f]",
            name,
            *share.first,
            *share.second,
        )
    mean, deviation = values.mean(axis=1), values.std(axis=1)
    skewness = ((values - mean[:, None]) ** 3).mean(axis=1) / deviation**3
    by_track = _by_track(config, tracks)
    result = xr.Dataset(
        {
            "seed_of_track": tracks["seed_of_track"],
            **{
                key: (_DIMS.get(key, ("response",)), np.stack(rows, axis=key == "density_of_track"))
                for key, rows in columns.items()
            },
            "mean_on_track": (("track", "response"), mean),
            "deviation_on_track": (("track", "response"), deviation),
            "skewness_on_track": (("track", "response"), skewness),
            "deviation_of_track": (("response",), mean.std(axis=0, ddof=1)),
            **by_track,
            "lost_share_on_track": (("track",), away.mean(axis=1)),
            "n_runs": ((), away.size),
        },
        coords=coordinates(
            responses_of(tracks),
            track=np.arange(n_tracks),
            cell=np.arange(N_CELLS),
            parameter=tracks["parameter"].to_numpy(),
            failure_probability=list(config.study.failure_probability),
        ),
    )
    result.attrs["track"] = f"{n_tracks} tracks"
    result["gains_share"].attrs["comment"] = (
        f"{np.count_nonzero(kept)} of {kept.size} points of the gains, those held on all tracks; "
        f"intervals by the jackknife over {n_tracks} tracks and over the gains"
    )
    result["held_limit_of_line"].attrs["comment"] = (
        f"interval: Woodruff's, of the exceedance with the effective size of {n_tracks} tracks; "
        "no limit is given where fewer than three tracks are expected beyond it"
    )
    result["held_limit_on_track"].attrs["comment"] = (
        "off a surrogate of the runs on the track; interval: order statistics moved by the range "
        "of leave-one-out residuals nearest to the limit"
    )
    return result


_ENDS = tuple(enumerate(("", "_low", "_high")))
_DIMS = {
    "value": ("response", "cell"),
    "density_of_track": ("track", "response", "cell"),
    "density_of_line": ("response", "cell"),
}


def _densities(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Values (cell,) and the density (track, cell) on each track, of values (track, sample)."""
    width = [silverman_bandwidth(one) for one in values]
    reach = REACH * max(width)
    at = np.linspace(values.min() - reach, values.max() + reach, N_CELLS)
    return at, np.array(
        [direct_density(at, one, bandwidth=h) for one, h in zip(values, width, strict=True)]
    )


def _by_track(config: Config, tracks: xr.Dataset) -> dict[str, tuple[tuple[str, ...], FloatArray]]:
    """Limits and first-order indices of each track by its surrogate, and limits of the line."""
    points = population(config.seed, N_POINTS, tracks.sizes["parameter"])
    n_tracks, n_responses = tracks.sizes["track"], tracks.sizes["response"]
    predictions = np.empty((n_tracks, N_POINTS, n_responses))
    held = np.ones(N_POINTS, dtype=bool)
    limits: list[list[Limits]] = []
    narrow, first = [], []
    with threadpool_limits(1, "blas"):  # more threads would sum in another order
        for number in range(n_tracks):
            of_track = _of_track(tracks, number)
            choice = config.study.tracks.surrogate
            found = predictor(config, of_track, choice, responses_of(tracks))
            surrogate = found.surrogate
            residuals, training = surrogate.leave_one_out(), surrogate.values
            predictions[number] = surrogate.predict(points)
            narrower = surrogate.predict(NARROW * points)
            own = found.held(points)
            held &= own
            first.append(first_order(points[own], predictions[number][own]))
            of_response = [
                limits_off(config, predictions[number][own, r], training[:, r], residuals[:, r], {})
                for r in range(n_responses)
            ]
            limits.append(of_response)
            levels = 1.0 - np.array(config.study.failure_probability)
            narrow.append(np.quantile(narrower, levels, axis=0).T)
            _LOG.info("track %d of %d done", number + 1, n_tracks)
    of_line = [
        clustered_limits(
            predictions[:, held, r],
            config.study.failure_probability,
            confidence=config.study.confidence,
        )
        for r in range(n_responses)
    ]
    level = ("response", "failure_probability")
    made: dict[str, tuple[tuple[str, ...], FloatArray]] = {
        "first_order_on_track": (("track", "response", "parameter"), np.array(first)),
        "narrow_limit_on_track": (("track", *level), np.array(narrow)),
        "held_limit_of_line_status": (level, np.array([status_numbers(one) for one in of_line])),
        "held_limit_on_track_status": (
            ("track", *level),
            np.array([[status_numbers(one) for one in of_track] for of_track in limits]),
        ),
    }
    for end, suffix in (("limit", ""), ("lower", "_low"), ("upper", "_high")):
        made[f"held_limit_of_line{suffix}"] = (
            level,
            np.array([getattr(one, end) for one in of_line]),
        )
        made[f"held_limit_on_track{suffix}"] = (
            ("track", *level),
            np.array([[getattr(one, end) for one in of_track] for of_track in limits]),
        )
    return made


def _of_track(tracks: xr.Dataset, number: int) -> xr.Dataset:
    """Runs on one track as training data of a surrogate."""
    one = tracks.isel(track=number)
    return xr.Dataset(
        {
            "standard": one["standard"],
            "status": ("sample", one["status_on_track"].to_numpy()),
            **{
                name: ("sample", one["extreme"].isel(response=r).to_numpy())
                for r, name in enumerate(responses_of(tracks))
            },
        }
    )


def rows(found: xr.Dataset) -> list[dict[str, object]]:
    """The table as rows of a CSV file: one per response and failure probability."""
    gains = [one.removeprefix("gains.") for one in found["parameter"].to_numpy().tolist()]
    made: list[dict[str, object]] = []
    for r, response in enumerate(responses_of(found)):
        at = found.isel(response=r)
        leading = at["first_order_on_track"].to_numpy().argmax(axis=1)
        most = int(np.bincount(leading, minlength=len(gains)).argmax())
        skew = at["skewness_on_track"].to_numpy()
        shared: dict[str, object] = {
            "response": response,
            "unit": RESPONSE_UNITS[response],
            "n_tracks": found.sizes["track"],
            "seed": int(found["seed_of_track"][0]),
        }
        for name in ("gains_share", "track_share", "interaction_share"):
            shared |= {f"{name}{end}": float(at[f"{name}{end}"]) for _, end in _ENDS}
        deviation = at["deviation_on_track"].to_numpy()
        shared |= {
            "mean_of_tracks": float(at["mean_on_track"].mean()),
            "deviation_of_track": float(at["deviation_of_track"]),
            "deviation_on_seed": float(deviation[0]),
            **_range("deviation_on_track", deviation),
            **_range("skewness_on_track", skew),
            "leading_gain": gains[most],
            "n_tracks_where_it_leads": int(np.count_nonzero(leading == most)),
        }
        for p, level in enumerate(found["failure_probability"].to_numpy()):
            each = at.isel(failure_probability=p)
            limit = each["held_limit_on_track"].to_numpy()
            rises = limit > each["narrow_limit_on_track"].to_numpy()
            made.append(
                {
                    **shared,
                    "failure_probability": float(level),
                    "limit_on_seed": float(limit[0]),
                    **_range("limit_on_track", limit),
                    **{
                        f"limit_of_line{end}": float(each[f"held_limit_of_line{end}"])
                        for _, end in _ENDS
                    },
                    "status_of_line": LIMIT_STATUS[int(each["held_limit_of_line_status"])],
                    "n_tracks_where_it_rises": int(np.count_nonzero(rises)),
                }
            )
    return made


def _range(name: str, values: FloatArray) -> dict[str, object]:
    """Smallest, middle and largest finite value over the tracks."""
    known = values[np.isfinite(values)]
    ends = (np.nan,) * 3 if not known.size else (known.min(), np.median(known), known.max())
    return {
        f"{name}_{word}": float(one)
        for word, one in zip(("min", "median", "max"), ends, strict=True)
    }


def text(found: xr.Dataset, heading: str) -> str:
    """The table in Markdown: shares of gains, track and both, then the limits."""
    table = rows(found)
    n, seed = found.sizes["track"], int(found["seed_of_track"][0])
    once = [one for one in table if one["failure_probability"] == table[0]["failure_probability"]]

    def share(one: dict[str, object], name: str) -> str:
        low, high = (float(str(one[f"{name}_share_{end}"])) for end in ("low", "high"))
        return f"{float(str(one[f'{name}_share'])):.3f} [{low:.3f}, {high:.3f}]"

    def ends(one: dict[str, object], name: str) -> str:
        return " / ".join(number(one[f"{name}_{word}"]) for word in ("min", "median", "max"))

    variance = [
        [
            f"{one['response']} [{one['unit']}]",
            *(share(one, name) for name in ("gains", "track", "interaction")),
            number(one["mean_of_tracks"]),
            number(one["deviation_of_track"]),
            number(one["deviation_on_seed"]),
            ends(one, "deviation_on_track"),
            ends(one, "skewness_on_track"),
            f"{one['leading_gain']}, {one['n_tracks_where_it_leads']} of {n}",
        ]
        for one in once
    ]
    limits = [
        [
            f"{one['response']} [{one['unit']}]",
            f"{one['failure_probability']:g}",
            number(one["limit_on_seed"]),
            ends(one, "limit_on_track"),
            (
                f"{number(one['limit_of_line'])} [{number(one['limit_of_line_low'])}, "
                f"{number(one['limit_of_line_high'])}]"
                if one["status_of_line"] == GIVEN
                else f"not carried by {n} tracks"
            ),
            f"{one['n_tracks_where_it_rises']} of {n}",
        ]
        for one in table
    ]
    comments = "\n\n".join(
        f"{name}: {found[variable].attrs['comment']}."
        for name, variable in (
            ("Shares", "gains_share"),
            ("Limits on a track", "held_limit_on_track"),
            ("Limits of the line", "held_limit_of_line"),
        )
    )
    return (
        f"# {heading}\n\nShares of the variance with their intervals; deviations on a track are "
        f"due to the gains, that of the track is of the means on the {n} tracks.\n\n"
        + markdown(
            [
                "response",
                "gains",
                "track",
                "both together",
                "mean",
                "deviation due to the track",
                f"deviation on track {seed}",
                "deviation on a track, least / median / largest",
                "skewness on a track, likewise",
                "leading gain, on how many tracks",
            ],
            variance,
        )
        + "\nLimits, given that levitation holds; the last column counts the tracks on which the "
        f"limit is larger than for gains that vary {NARROW} times as much.\n\n"
        + markdown(
            [
                "response",
                "failure probability",
                f"on track {seed}",
                "on a track, least / median / largest",
                "of the line [its interval]",
                "rises with the variation",
            ],
            limits,
        )
        + f"\n{comments}\n\nLevitation lost at "
        f"{100 * float(found['lost_share_on_track'].mean()):.2g} % of the points of the gains, "
        f"{100 * float(found['lost_share_on_track'].min()):.2g} to "
        f"{100 * float(found['lost_share_on_track'].max()):.2g} % on a track.\n"
    )


def table(found: xr.Dataset) -> tuple[list[dict[str, object]], str]:
    """Rows and text of the table of a case."""
    n = found.sizes["track"]
    heading = f"The line of {n} tracks and each of them, case '{found.attrs['case']}'"
    return rows(found), text(found, heading)


STAGE = Stage(
    name="line",
    of="case",
    reads=(*PREDICTING, "study.failure_probability", "study.tracks.surrogate"),
    inputs={"tracks": Input("tracks")},
    layout="line",
    compute=dataset,
    table=table,
)
