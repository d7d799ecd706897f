"""Small files of the study, as the stages would write them, for the figures to be drawn from."""

import numpy as np
import xarray as xr
from scipy import stats

from maglev import datasets
from maglev.datasets import LAYOUTS
from maglev.vocabulary import GAIN_KEYS, GAINS, PAPER_RESPONSES

KEYS = tuple(f"gains.{key}" for key in GAIN_KEYS)
LEVELS = (0.1, 0.01, 0.001)
MEAN = np.array([3500.0, 17.5, 4500.0, 17.5])
CENTRE = np.array([1.5e-3, 1e-4, 0.5, 0.3, 0.2, 0.4])
WIDTH = np.array([6e-6, 8e-6, 0.05, 0.03, 0.02, 0.05])


def _filled(layout, sizes, **given):
    """A dataset of a layout: what is given, and zeros for the rest."""
    data = dict(given)
    for name in LAYOUTS[layout].variables:
        if name not in data:
            dims = LAYOUTS[layout].variable(name).dims
            data[name] = (dims, np.zeros([sizes[dim] for dim in dims]))
    data = {
        name: (dims, np.asarray(v).astype(LAYOUTS[layout].variable(name).dtype))
        for name, (dims, v) in data.items()
    }
    coords = {
        dim: np.arange(size)
        for dim, size in sizes.items()
        if any(dim in d for d, _ in data.values())
    }
    coords |= {
        dim: np.array(words)[: sizes[dim]]
        for dim, words in (("response", PAPER_RESPONSES), ("parameter", KEYS))
        if dim in coords
    }
    for name in list(data):
        if name in coords:
            coords[name] = data.pop(name)[1]
    if "failure_probability" in coords:
        coords["failure_probability"] = np.array(LEVELS)[: sizes["failure_probability"]]
    return xr.Dataset(data, coords=coords)


def runs(n=400, *, variation=0.1, parameters=(0, 1, 2, 3), seed=1):
    """Independent runs of which those with the smallest suspension gain are lost."""
    rng = np.random.default_rng(seed)
    standard = rng.standard_normal((n, len(parameters)))
    gains = np.tile(MEAN, (n, 1))
    gains[:, parameters] *= 1 + variation * standard
    values = CENTRE + 10 * variation * WIDTH * rng.standard_normal((n, 6))
    values[:, 4] += 0.02 * rng.exponential(size=n) ** 2
    away = gains[:, 0] < 2650.0
    values[away] = np.nan
    given = {name: ("sample", gains[:, k]) for k, name in enumerate(GAINS)}
    given |= {name: ("sample", values[:, k]) for k, name in enumerate(PAPER_RESPONSES)}
    given |= {
        "standard": (("sample", "parameter"), standard),
        "status": ("sample", np.where(away, 2, 0)),
        "parameter": ("parameter", [KEYS[k] for k in parameters]),
    }
    return _filled("runs", {"sample": n, "car": 1, "parameter": len(parameters)}, **given)


def design(n=24, n_rounds=4, **options):
    """A design whose errors fall from round to round."""
    made = runs(n, **options)
    fall = 0.5 ** np.arange(n_rounds)[:, None]
    given = {name: (made[name].dims, made[name].to_numpy()) for name in made.variables}
    given |= {
        "round_n_runs": ("round", np.linspace(n / 2, n, n_rounds).astype(int)),
        "error": (("round", "response"), np.where(fall == 1, np.nan, fall * np.ones(6))),
        "rmse": (("round", "response"), fall * WIDTH),
        "decision": ("round", np.zeros(n_rounds)),
    }
    sizes = {
        "sample": n, "car": 1, "parameter": made.sizes["parameter"], "round": n_rounds,
        "response": 6, "failure_probability": 3,
    }  # fmt: skip
    return _filled("design", sizes, **given)


def density(method="asm", *, variation=0.1, lost=0.003, shift=0.0, n=400):
    """Normal densities, that of a baseline with a band and without the GDEE."""
    z = np.linspace(-4.5, 4.5, 121)
    width = 10 * variation * WIDTH[:, None]
    value = CENTRE[:, None] + width * (z + shift)
    of = (1 - lost) * stats.norm.pdf(z) / width
    beyond = lost + (1 - lost) * stats.norm.sf(z) * np.ones((6, 1))
    mcm = method == "mcm"
    by_cell, by_response = ("response", "cell"), ("response",)
    given = {
        "value": (by_cell, value),
        "density": (by_cell, np.full_like(of, np.nan) if mcm else of),
        "density_direct": (by_cell, of),
        "exceedance": (by_cell, beyond),
        "exceedance_low": (by_cell, 0.8 * beyond),
        "exceedance_high": (by_cell, np.minimum(1.2 * beyond, 1)),
        "bandwidth": (by_response, 0.2 * width[:, 0]),
        "mesh_size": (by_response, np.nan * CENTRE if mcm else 0.1 * width[:, 0]),
        "density_method": (by_response, np.full(6, 2 if mcm else 0)),
        "peak": (by_response, np.nan * CENTRE if mcm else of.max(axis=1)),
        "peak_direct": (by_response, of.max(axis=1)),
        "lost_probability": ((), lost),
        "n_runs": ((), n),
    }
    if mcm:
        given |= {
            f"density_direct_{end}": (by_cell, factor * of)
            for end, factor in (("low", 0.9), ("high", 1.1))
        }
    return _filled("density", {"response": 6, "cell": z.size}, **given)


def limits(*, variation=0.1, lost=0.003, n=104):
    """Limits of which the rarest do not exist, as losses alone are likelier."""
    z = stats.norm.isf(LEVELS)
    held = CENTRE[:, None] + 10 * variation * WIDTH[:, None] * z
    half = 0.3 * variation * 10 * WIDTH[:, None] * np.ones(3)
    infinite = np.tile(np.array(LEVELS) < lost, (6, 1))
    by_level = ("response", "failure_probability")
    given = {"held_limit": (by_level, held), "limit": (by_level, np.where(infinite, np.inf, held))}
    for end, sign in (("low", -1), ("high", 1)):
        given[f"held_limit_{end}"] = (by_level, held + sign * half)
        given[f"limit_{end}"] = (by_level, np.where(infinite, np.inf, held + sign * half))
    given["limit_status"] = (by_level, np.where(infinite, 2, 0))
    given["lost_probability"] = ((), lost)
    given["n_runs"] = ((), n)
    return _filled("limits", {"response": 6, "failure_probability": 3}, **given)


def limit_states(method="asm", *, lost=0.003, n=104):
    """Two limits of one response, one of another far away, and both of them together."""
    names = ["lost", "low", "high", "far", "either"]
    value = np.array([lost, 0.16, 0.02, lost, 0.16])
    if method == "asm":
        value = 1.1 * value
    given = {
        "limit_state": ("limit_state", names),
        "state_response": (
            "limit_state",
            ["none", PAPER_RESPONSES[2], PAPER_RESPONSES[2], PAPER_RESPONSES[4], "none"],
        ),
        "threshold": ("limit_state", [np.nan, 0.55, 0.6, 5.0, np.nan]),
        "target": ("limit_state", [np.nan, 0.2, 0.01, 1e-5, np.nan]),
        "definition": ("limit_state", [f"what {name} says" for name in names]),
        "n_runs": ((), n),
    }
    for prefix, of in (("", value), ("held_", value - lost)):
        for end, by in (("", 1.0), ("_low", 0.8), ("_high", 1.2)):
            given[f"{prefix}probability{end}"] = ("limit_state", by * of)
    return _filled("limit_states", {"limit_state": len(names)}, **given)


def sweep(speeds=(300, 400, 500), others=None, key="control.suspension.group"):
    """Limits that grow with the speed, and with another key if its values are given."""
    settings = [(one, other) for one in speeds for other in (others or [None])]
    grown = np.array([one / speeds[0] for one, _ in settings])
    grown *= np.array([1 + 0.2 * (others or [None]).index(other) for _, other in settings])
    z = stats.norm.isf(LEVELS)
    held = grown[:, None, None] * (CENTRE[:, None] + WIDTH[:, None] * z)
    lost = np.minimum(1e-4 * grown**6, 0.5)
    infinite = lost[:, None, None] > np.array(LEVELS) * np.ones((6, 1))
    by_level = ("setting", "response", "failure_probability")
    given = {
        "limit_status": (by_level, np.where(infinite, 2, 0)),
        "extreme_at_mean": (by_level[:2], grown[:, None] * CENTRE),
        "swept_value": (
            ("setting", "swept_parameter"),
            [[one / 3.6, np.nan][: 1 + bool(others)] for one, _ in settings],
        ),
        "swept_text": (
            ("setting", "swept_parameter"),
            [[f"{one} km/h", str(other)][: 1 + bool(others)] for one, other in settings],
        ),
        "setting": ("setting", [f"fast_{k + 1}" for k in range(len(settings))]),
        "swept_parameter": ("swept_parameter", ["passage.speed", key][: 1 + bool(others)]),
        "n_runs": ("setting", np.full(len(settings), 104)),
    }
    states = limit_states()
    for name in ("limit_state", "state_response", "threshold", "target", "definition"):
        given[name] = (states[name].dims, states[name].to_numpy())
    for end, by in (("", 0.0), ("_low", -0.02), ("_high", 0.02)):
        given[f"held_limit{end}"] = (by_level, (1 + by) * held)
        given[f"limit{end}"] = (by_level, np.where(infinite, np.inf, (1 + by) * held))
        of = np.minimum(np.outer(lost, [1, 50, 10, 1, 60]), 1)
        given[f"probability{end}"] = (("setting", "limit_state"), (1 + 10 * by) * of)
    sizes = {
        "setting": len(settings), "response": 6, "failure_probability": 3, "limit_state": 5,
        "swept_parameter": 1 + bool(others),
    }  # fmt: skip
    made = _filled("sweep", sizes, **given)
    units = ", ".join(["m/s", "1"][: 1 + bool(others)])
    made["swept_value"].attrs["units_by_swept_parameter"] = units
    return made.assign_attrs(method="asm")


def accuracy(methods=("osm", "asm_paper", "asm")):
    """Errors that fall with the number of runs."""
    n_runs = np.tile(np.array([8, 12, 16, 24]), (len(methods), 1))
    fall = (2.0 / n_runs**0.5)[:, :, None] * np.ones(6)
    by_step = ("method", "step")
    given = {
        "step_n_runs": (by_step, n_runs),
        "step_rmse": ((*by_step, "response"), fall * WIDTH),
        "step_error": ((*by_step, "response"), 3 * fall),
        "step_held_limit_error": (
            (*by_step, "response", "failure_probability"), fall[..., None] * np.array([0.1, 0.3, 1])
        ),
        "reference_held_half_width": (
            ("response", "failure_probability"), np.tile([0.02, 0.05, 0.1], (6, 1))
        ),
        "sigma": ("response", WIDTH),
        "method": ("method", np.array(methods)),
    }  # fmt: skip
    sizes = {"method": len(methods), "step": 4, "response": 6, "failure_probability": 3}
    return _filled("accuracy", sizes, **given)


def prediction(n=300, methods=("osm", "asm_paper", "asm")):
    """Predictions with an error of a tenth of a deviation."""
    rng = np.random.default_rng(3)
    made = runs(n)
    computed = np.column_stack([made[name] for name in PAPER_RESPONSES])
    error = 0.1 * WIDTH * rng.standard_normal((len(methods), n, 6))
    away = made["status"].to_numpy() != 0
    given = {
        "computed": (("sample", "response"), computed),
        "status": ("sample", made["status"].to_numpy()),
        "predicted_by": (("method", "sample", "response"), np.nan_to_num(computed) + error),
        "lost_by": (("method", "sample"), np.tile(away, (len(methods), 1)).astype(int)),
        "prediction_rmse": (("method", "response"), np.full((len(methods), 6), 0.1)),
        "method_n_runs": ("method", np.full(len(methods), 24)),
        "sigma": ("response", WIDTH),
        "method": ("method", np.array(methods)),
    }
    return _filled("prediction", {"method": len(methods), "sample": n, "response": 6}, **given)


def surrogate():
    """Sobol' indices of which the first gain has most."""
    share = np.tile([0.7, 0.1, 0.15, 0.02], (6, 1))
    by_gain = ("response", "parameter")
    given = {}
    for name, of in (("sobol_first", share), ("sobol_total", share + 0.05)):
        for end, by in (("", 0.0), ("_low", -0.02), ("_high", 0.02)):
            given[f"{name}{end}"] = (by_gain, of + by)
    given["leave_one_out_error"] = ("response", np.full(6, 0.1))
    return _filled("surrogate", {"response": 6, "parameter": 4}, **given)


def stability():
    """A border at 2600 A/m."""
    k_p, k_d = np.linspace(1400, 5600, 15), np.linspace(7, 28, 8)
    given = {
        "growth_rate": (
            ("grid_derivative", "grid_proportional"), np.tile((2600 - k_p) / 100, (k_d.size, 1))
        ),
        "static_limit": ((), 2500.0),
        "proportional_border_low": ((), 2600.0),
        "proportional_border": (("current_lag", "grid_derivative"), np.full((2, k_d.size), 2600.0)),
        "derivative_border": (
            ("current_lag", "grid_proportional"), np.outer([np.nan, 5.0], np.ones(k_p.size))
        ),
        "current_lag": ("current_lag", [0.0, 2e-3]),
        "mean_proportional": ((), MEAN[0]),
        "mean_derivative": ((), MEAN[1]),
        "grid_proportional": ("grid_proportional", k_p),
        "grid_derivative": ("grid_derivative", k_d),
    }  # fmt: skip
    sizes = {"grid_proportional": k_p.size, "grid_derivative": k_d.size}
    return _filled("stability", sizes, **given)


def track_split():
    """Three normal densities."""
    z = np.linspace(-5, 5, 121)
    given = {"value": (("response", "cell"), CENTRE[:, None] + WIDTH[:, None] * z)}
    for name, width in (("both", 1.0), ("gains_only", 0.4), ("track_only", 0.9)):
        of = stats.norm.pdf(z / width) / width / WIDTH[:, None]
        given[f"density_{name}"] = (("response", "cell"), of)
    for name, share in (("gains", 0.2), ("track", 0.7), ("interaction", 0.1)):
        for end, by in (("", 0.0), ("_low", -0.1), ("_high", 0.1)):
            given[f"{name}_share{end}"] = ("response", np.full(6, share + by))
    given["n_runs"] = ((), 500)
    return _filled("track_split", {"response": 6, "cell": z.size}, **given)


def line(n=5):
    """Tracks whose means differ by three of their deviations."""
    rng = np.random.default_rng(4)
    z = np.linspace(-12, 12, 301)
    place = 3 * rng.standard_normal((n, 6))
    of = stats.norm.pdf(z - place[:, :, None]) / WIDTH[:, None]
    held = CENTRE[:, None] + WIDTH[:, None] * (place[:, :, None] + stats.norm.isf(LEVELS))
    half = 0.3 * WIDTH[:, None]
    by_track = ("track", "response", "failure_probability")
    given = {
        "value": (("response", "cell"), CENTRE[:, None] + WIDTH[:, None] * z),
        "density_of_track": (("track", "response", "cell"), of),
        "density_of_line": (("response", "cell"), of.mean(axis=0)),
        "mean_on_track": (("track", "response"), CENTRE + WIDTH * place),
        "deviation_on_track": (("track", "response"), np.tile(WIDTH, (n, 1))),
        "held_limit_on_track": (by_track, held),
        "held_limit_on_track_low": (by_track, held - half),
        "held_limit_on_track_high": (by_track, held + half),
        "held_limit_of_line": (by_track[1:], held.mean(axis=0)),
        "held_limit_of_line_low": (by_track[1:], held.mean(axis=0) - 3 * half),
        "held_limit_of_line_high": (by_track[1:], np.full((6, 3), np.inf)),
        "held_limit_of_line_status": (by_track[1:], np.tile([0, 1, 1], (6, 1))),
        "seed_of_track": ("track", np.arange(20, 20 + n)),
        "n_runs": ((), 80),
    }
    for name, share in (("gains", 0.1), ("track", 0.8), ("interaction", 0.1)):
        for end, by in (("", 0.0), ("_low", -0.05), ("_high", 0.05)):
            given[f"{name}_share{end}"] = ("response", np.full(6, share + by))
    sizes = {"track": n, "response": 6, "cell": z.size, "failure_probability": 3, "parameter": 4}
    return _filled("line", sizes, **given).assign_attrs(track=f"{n} tracks")


def in_time(n=3):
    """Responses that swing and spread, n of them, with barriers that are reached half-way."""
    t, z = np.linspace(0, 3, 61), np.linspace(-5, 5, 41)
    swing = np.sin(4 * t) * CENTRE[:n, None]
    width = WIDTH[:n, None] * (0.01 + np.abs(np.sin(t)))
    by_time, by_level = ("response", "t"), ("response", "failure_probability")
    shown = ("response", "t", "cell")
    late = 1 - np.array(LEVELS)[:, None] * (t > 1.5)
    given = {
        "response": ("response", np.array(PAPER_RESPONSES[:: 6 // n][:n])),
        "t": ("t", t),
        "value_in_time": (shown, swing[..., None] + width[..., None] * z),
        "density_in_time": (shown, stats.norm.pdf(z) / width[..., None]),
        "held_in_time": ("t", np.ones(t.size)),
        "mean_in_time": (by_time, swing),
        "deviation_in_time": (by_time, width),
        "quantile_in_time": (
            (*by_time, "quantile_level"), swing[..., None] + width[..., None] * [-2, 0, 2]
        ),
        "quantile_level": ("quantile_level", [0.025, 0.5, 0.975]),
        "nose": ("t", -100 + 120 * t),
        "train_length": ((), 124.0),
        "guideway_length": ((), 124.0),
        "barrier": (by_level, np.outer(CENTRE[:n], [1.1, 1.2, 1.3])),
        "reliability": ((*by_level, "t"), np.tile(late, (n, 1, 1))),
        "reliability_of_points": ((*by_level, "t"), np.tile(late, (n, 1, 1))),
        "reliability_of_extreme": (by_level, np.tile(1 - np.array([*LEVELS[:2], 0.0]), (n, 1))),
        "n_runs": ((), 64),
    }  # fmt: skip
    sizes = {
        "response": n, "t": t.size, "cell": z.size, "failure_probability": 3, "quantile_level": 3,
    }  # fmt: skip
    return _filled("density_in_time", sizes, **given)


def circuits(group="pole", lag="0 s"):
    """Both kinds of magnet with such circuits, as a configuration is written."""
    return {
        kind: {"group": group, "lag": lag, "delay": "0 s"} for kind in ("suspension", "guidance")
    }


def write(
    folder, layout, dataset, *, case, method=None, variation=0.1, demonstration=False, control=None
):
    """Write a file as its stage would and return its name."""
    path = folder / f"{layout}_{case}_{method}.nc"
    config = {
        "demonstration": demonstration,
        "study": {"confidence": 0.95},
        "control": control or circuits(),
        "guideway": {"n_spans": 5},
        "cases": {case: {"random": {"gains.a": {"coefficient_of_variation": variation}}}},
    }
    attributes = {"case": case} | ({} if method is None else {"method": method})
    datasets.write(dataset.assign_attrs(attributes), path, layout, config=config, code="abc")
    return path


def study(folder, demonstration=False):
    """Files of every figure of the study, by its name."""

    def one(layout, dataset, case="validation", method=None, variation=0.1, control=None):
        return write(
            folder, layout, dataset, case=case, method=method, variation=variation,
            demonstration=demonstration, control=control,
        )  # fmt: skip

    by_method = [
        one("density", density("mcm"), method="mcm"),
        one("density", density("osm", shift=0.2), method="osm"),
        one("density", density("asm"), method="asm"),
    ]
    states = [
        one("limit_states", limit_states(method), method=method) for method in ("mcm", "osm", "asm")
    ]
    gains = {"only_a": (0,), "only_b": (3,), "all_gains": (0, 1, 2, 3)}
    of_gain = [
        (
            one("density", density(variation=v), case, "asm"),
            one("limits", limits(variation=v), case, "asm"),
            one("design", design(parameters=parameters), case, "asm"),
        )
        for (case, parameters), v in zip(gains.items(), (0.09, 0.01, 0.1), strict=True)
    ]
    of_variation = [
        (
            one("density", density(variation=v, lost=lost), f"cov_{k}", "asm", v),
            one("limits", limits(variation=v, lost=lost), f"cov_{k}", "asm", v),
            one("design", design(variation=v), f"cov_{k}", "asm", v),
        )
        for k, (v, lost) in enumerate(((0.14, 0.02), (0.04, 0.0), (0.1, 0.003)))
    ]
    of_control = [
        (
            one("density", density(shift=shift, lost=lost), case, "asm", 0.1),
            one("limits", limits(lost=lost), case, "asm", 0.1),
            one("design", design(), case, "asm", 0.1, control),
        )
        for case, shift, lost, control in (
            ("validation_too", 0.0, 0.002, circuits()),
            ("group_half", 1.0, 0.14, circuits("half")),
            ("lag_2ms", 0.5, 0.003, circuits(lag="0.002 s")),
        )
    ]
    by_control = list(zip(*of_control, strict=True))
    accurate = one("accuracy", accuracy())
    baseline = one("runs", runs(), method="mcm")
    designs = [
        one("design", design(n_rounds=1), method="osm"), one("design", design(), method="asm")
    ]  # fmt: skip
    by_gain, by_variation = list(zip(*of_gain, strict=True)), list(zip(*of_variation, strict=True))
    return {
        "training": [accurate, *designs],
        "prediction": [one("prediction", prediction())],
        "density_by_method": by_method,
        "exceedance_by_method": by_method,
        "density": by_method,
        "exceedance": [*by_method, *states],
        "limits": [
            one("limits", limits(lost=lost), method=method)
            for method, lost in (("mcm", 0.003), ("osm", 0.0), ("asm", 0.003))
        ],
        "density_by_gain": [*by_gain[0], *by_gain[2]],
        "limits_by_gain": [*by_gain[1], *by_gain[2]],
        "density_by_variation": [*by_variation[0], *by_variation[2]],
        "limits_by_variation": [*by_variation[1], *by_variation[2]],
        "density_by_control": [*by_control[0], *by_control[2]],
        "limits_by_control": [*by_control[1], *by_control[2]],
        "sweep": [one("sweep", sweep(), "fast")],
        "sobol": [one("surrogate", surrogate(), method="asm")],
        "stability": [one("stability", stability()), baseline],
        "accuracy": [accurate],
        "scatter": [baseline],
        "track_split": [one("track_split", track_split())],
        "tracks": [one("line", line())],
        "track_limits": [one("line", line())],
        "in_time": [one("density_in_time", in_time())],
    }
