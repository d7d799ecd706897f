"""How far each of the six extremes is from its limit: the tables that set the defaults.

Run as ``python benchmarks/convergence.py``: some minutes on one core.  One discretisation parameter
at a time is made coarser or finer than the default; the limit has all of them fine.  The largest
deviation over four sets of gains (coefficient of variation 0.10) and two speeds is written to
docs/convergence.md, with that of the default step at other speeds from a fine one, that of quiet
spans on a long line from spans that are all awake, and the girder's raw acceleration as step and
cut-off are refined, for poles with faces of several lengths and for points.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from unittest import mock

import numpy as np

from maglev.mechanics import activity, integrate, reduction
from maglev.mechanics.course import course
from maglev.parameters import Config
from maglev.simulation import track
from maglev.vocabulary import RESPONSES

PAGE = Path(__file__).parents[1] / "docs" / "convergence.md"
SPEEDS_KMH = (430, 200)
COEFFICIENT_OF_VARIATION = 0.10


@dataclass(frozen=True)
class Discretisation:
    """What is approximated: fields in the order of the page's blocks."""

    time_step_ms: float
    mode_cutoff: float
    mode_cutoff_elsewhere: float
    refinement: int
    damping_drop: float


DEFAULT = Discretisation(
    time_step_ms=Config().passage.time_step * 1e3,
    mode_cutoff=Config().passage.mode_cutoff,
    mode_cutoff_elsewhere=Config().passage.mode_cutoff_elsewhere,
    refinement=Config().guideway.refinement,
    damping_drop=reduction.DAMPING_DROP,
)
LIMIT = Discretisation(0.06, 2000, 1000, 1, 1e-4)
VARIATIONS = {
    "time_step_ms": ("time step [ms], upper bound", (0.54, 0.36, 0.27, 0.12)),
    "mode_cutoff": ("mode cut-off of the middle span [Hz]", (150, 200, 300, 500, 700)),
    "mode_cutoff_elsewhere": ("mode cut-off elsewhere [Hz]", (150, 200, 300, 400)),
    "refinement": ("elements between nodes", (1, 2)),
    "damping_drop": ("damping entries dropped below", (1e-2, 3e-3, 1e-3)),
}

OTHER_SPEEDS_KMH = (100, 200, 300, 350, 400, 430, 500, 600)
LONG_LINE = 20
"""Spans of the line on which quiet spans are tried [-]."""
QUIET = ((60.0, 3), (100.0, 1), (100.0, 2), (100.0, 3), (100.0, 5), (150.0, 3))
"""Highest mode of quiet spans that is stepped [Hz], and spans beside the train that are awake."""


def extremes(at: Discretisation, speed_kmh: int, n_spans: int = 5) -> np.ndarray:
    """The six extremes (sample, response) of four passages."""
    config = configuration(at, speed_kmh, n_spans)
    normal = np.random.default_rng(config.seed).standard_normal((4, 4))
    gains = np.array(config.gains.as_row) * (1 + COEFFICIENT_OF_VARIATION * normal)
    with mock.patch.object(reduction, "DAMPING_DROP", at.damping_drop):
        system = integrate.prepare(config, track(config))
        passages = integrate.integrate(system, gains)
    return np.column_stack([passages.girder, passages.body_z.max(1), passages.body_y.max(1)])


def configuration(at: Discretisation, speed_kmh: int, n_spans: int = 5) -> Config:
    """The default configuration with another discretisation, speed and number of spans."""
    return Config.model_validate(
        {
            "guideway": {"refinement": at.refinement, "n_spans": n_spans},
            "passage": {
                "speed": f"{speed_kmh} km/h",
                "time_step": f"{at.time_step_ms} ms",
                "mode_cutoff": f"{at.mode_cutoff} Hz",
                "mode_cutoff_elsewhere": f"{at.mode_cutoff_elsewhere} Hz",
            },
        }
    )


def deviation(at: Discretisation, limits: dict[int, np.ndarray]) -> np.ndarray | None:
    """Largest deviation of each extreme from its limit [%]; ``None`` where a step is unstable."""
    try:
        worst = [
            np.nanmax(np.abs(extremes(at, speed) / limit - 1), axis=0)
            for speed, limit in limits.items()
        ]
    except ValueError as error:
        if "stability limit" not in str(error):
            raise
        return None
    return 100 * np.max(worst, axis=0)


def row_of(cells: list[str], found: np.ndarray, exact: np.ndarray) -> str:
    """A row of a table: largest deviations over the samples [%]."""
    worst = 100 * np.nanmax(np.abs(found / exact - 1), axis=0)
    line = "| " + " | ".join(cells + [f"{one:.2f}" for one in worst]) + " |"
    print(line, file=sys.stderr, flush=True)
    return line


def other_speeds(heads: list[str]) -> list[str]:
    """The default step at other speeds against one of 0.06 ms, all else as by default."""
    lines = [
        "## The default step at other speeds",
        "",
        "Deviation from a step of 0.06 ms at most; the step is that used.",
        "",
        "| speed [km/h] | step [ms] | " + " | ".join(heads) + " |",
        "| --- | ---: |" + " ---: |" * len(heads),
    ]
    for speed in OTHER_SPEEDS_KMH:
        step = course(configuration(DEFAULT, speed)).time_step * 1e3
        exact = extremes(replace(DEFAULT, time_step_ms=0.06), speed)
        lines.append(row_of([f"{speed}", f"{step:.3f}"], extremes(DEFAULT, speed), exact))
    return [*lines, ""]


def quiet_spans(heads: list[str]) -> list[str]:
    """Quiet spans on a long line against spans that are all awake."""
    lines = [
        "## Quiet spans",
        "",
        f"Deviation on {LONG_LINE} spans at 430 km/h from a line whose spans are all awake.",
        "",
        "| modes stepped below [Hz] | spans awake beside the train | " + " | ".join(heads) + " |",
        "| --- | ---: |" + " ---: |" * len(heads),
    ]
    with mock.patch.object(activity, "AWAKE_BESIDE", LONG_LINE):
        exact = extremes(DEFAULT, 430, LONG_LINE)
    usual = (activity.QUIET_CUTOFF, activity.AWAKE_BESIDE)
    for cutoff, beside in QUIET:
        with mock.patch.multiple(activity, QUIET_CUTOFF=cutoff, AWAKE_BESIDE=beside):
            found = extremes(DEFAULT, 430, LONG_LINE)
        mark = "**" if (cutoff, beside) == usual else ""
        cells = [f"{mark}{cutoff:g}{mark}", f"{mark}{beside}{mark}"]
        lines.append(row_of(cells, found, exact))
    return [*lines, ""]


FACES_MM = (0, 85, 170, 258)
"""Lengths of the suspension poles' faces whose raw acceleration is tried [mm]; the guidance poles'
keep their ratio to them."""
RAW = ((0.12, 1000.0), (0.06, 1000.0), (0.06, 2000.0), (0.03, 2000.0), (0.03, 3000.0))
"""Step [ms] and mode cut-off [Hz] of the raw acceleration, one refined after the other."""


def raw_acceleration(pole_length: float, step_ms: float, cutoff: float) -> float:
    """Largest vertical acceleration of midspan without a band [m/s²]: one car, one span, smooth."""
    config = Config.model_validate(
        {
            "train": {"n_cars": 1},
            "guideway": {"n_spans": 1},
            "irregularity": {"enabled": False, "fade_in": "1 m"},
            "passage": {
                "approach": "1 m",
                "time_step": f"{step_ms} ms",
                "mode_cutoff": f"{cutoff} Hz",
                "mode_cutoff_elsewhere": "1000 Hz",
            },
        }
    )
    share = pole_length / config.train.suspension_magnet.pole_length
    magnets = {
        name: magnet.model_copy(update={"pole_length": share * magnet.pole_length})
        for name, magnet in (
            ("suspension_magnet", config.train.suspension_magnet),
            ("guidance_magnet", config.train.guidance_magnet),
        )
    }
    # copies are not validated: points without a band are refused otherwise
    config = config.model_copy(
        update={
            "train": config.train.model_copy(update=magnets),
            "passage": config.passage.model_copy(update={"acceleration_band": None}),
        }
    )
    system = integrate.prepare(config, track(config))
    return float(integrate.integrate(system, np.array([config.gains.as_row])).girder[0, 2])


def raw_accelerations() -> list[str]:
    """The raw acceleration as step and cut-off are refined."""
    heads = [f"{step:g} ms, {cutoff:g} Hz" for step, cutoff in RAW]
    lines = [
        "## Without a band",
        "",
        "Largest vertical acceleration of midspan [m/s²] without a band, one car on one span at",
        "430 km/h, smooth track, by step and mode cut-off.  Guidance poles keep their ratio to the",
        "suspension poles; points step from unit to unit and have no limit.",
        "",
        "| length of a suspension pole [mm] | " + " | ".join(heads) + " |",
        "| --- |" + " ---: |" * len(heads),
    ]
    for face in FACES_MM:
        found = [raw_acceleration(face * 1e-3, *at) for at in RAW]
        lines.append("| " + " | ".join([f"{face}", *(f"{one:.4f}" for one in found)]) + " |")
        print(lines[-1], file=sys.stderr, flush=True)
    return [*lines, ""]


def main() -> None:
    """Compute the table and write the page."""
    limits = {speed: extremes(LIMIT, speed) for speed in SPEEDS_KMH}
    heads = [name.replace("_", " ") for name in RESPONSES]
    lines = [
        "# Convergence",
        "",
        "Written by `python benchmarks/convergence.py`.  Largest deviation of each extreme from",
        "its limit in per cent, over four sets of gains (coefficient of variation 0.10) at "
        + " and ".join(f"{speed}" for speed in SPEEDS_KMH)
        + " km/h, five",
        "cars over five spans, irregular track.  One parameter departs from the default (bold) at",
        "a time.  The limit: "
        + ", ".join(f"{label} {getattr(LIMIT, name):g}" for name, (label, _) in VARIATIONS.items())
        + ".",
        "",
        "The step used is the largest below the bound that divides the period of pole passing",
        "(2.16 ms at 430 km/h).",
        "",
    ]
    default = deviation(DEFAULT, limits)
    for name, (label, values) in VARIATIONS.items():
        lines += [
            f"| {label} | " + " | ".join(heads) + " |",
            "| --- |" + " ---: |" * len(heads),
        ]
        for value in values:
            at = replace(DEFAULT, **{name: value})
            row = default if at == DEFAULT else deviation(at, limits)
            mark = "**" if at == DEFAULT else ""
            cells = ["unstable"] * 6 if row is None else [f"{one:.2f}" for one in row]
            lines.append(f"| {mark}{value:g}{mark} | " + " | ".join(cells) + " |")
            print(lines[-1], file=sys.stderr, flush=True)
        lines.append("")
    lines += other_speeds(heads) + quiet_spans(heads) + raw_accelerations()
    PAGE.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
