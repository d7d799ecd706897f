"""What a passage costs, of what the machine could give, and how the cost grows.

    python benchmarks/bench_passage.py            # the whole of it, one to seven minutes
    python benchmarks/bench_passage.py --quick    # a minute's run on small sizes, writes no docs

One process on one core unless stated.  Costs are process time (seconds that the processor worked
for this process, all its threads together), which other work on the machine disturbs least; what
says "wall" is elapsed time.  The results are docs/benchmarks/passage.md with its figure.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.ticker import FuncFormatter, LogLocator
from numba import njit
from threadpoolctl import threadpool_info, threadpool_limits

from maglev import datasets, load_config, simulate
from maglev.figures import style
from maglev.fingerprint import code_of
from maglev.mechanics import integrate, packing, reference
from maglev.mechanics._kernels import (
    _advance_guideway,
    _advance_train,
    _answer,
    _links,
    _load_span,
    _move_span,
    _new_watch,
    at_rest,
)
from maglev.mechanics._magnets import attract, circuits_at_rest, empty_magnet
from maglev.mechanics._records import Motion, Rails
from maglev.mechanics._rows import zeros
from maglev.mechanics.course import course
from maglev.mechanics.lanes import LANES
from maglev.parameters import Circuit, Config
from maglev.simulation import _system, track
from maglev.stages.passage import STAGE

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs" / "benchmarks"
SCRATCH = ROOT / "benchmarks" / "results"

Array = npt.NDArray[np.float64]

TARGET_RATIO, TARGET_STARTUP, TARGET_MINUTES, TARGET_THREADS = 200, 3.0, 10.0, 1.9
TARGET_SPANS, TARGET_MEMORY = 4.0, 4.0
TARGET_FACES, TARGET_ENDS, TARGET_LATE = 1.10, 1.00, 1.15
TARGET_SAMPLE, TARGET_GUIDEWAY, TARGET_TWELVE = 1.15, 2.0, 4.0
N_PASSAGES = 10_000

BUSY = 0.5
"""Load average at the start above which the page says that times are not to be trusted [-]."""

STARTUP = """
import time
marks = [("begin", time.perf_counter(), time.process_time())]
mark = lambda name: marks.append((name, time.perf_counter(), time.process_time()))
import numpy as np
import maglev
from maglev.mechanics import integrate
from maglev.simulation import _system
mark("imports")
config = maglev.load_config()
gains = np.array([config.gains.as_row])
system = _system(config, "")
mark("configuration, matrices and tables")
integrate.integrate(system, gains)
mark("first passage")
integrate.integrate(system, gains)
mark("second passage")
for (_, wall0, cpu0), (name, wall, cpu) in zip(marks, marks[1:]):
    print(f"{name}|{cpu - cpu0}|{wall - wall0}")
"""


@dataclass(frozen=True)
class Sizes:
    """What is run.

    Attributes
    ----------
    spans, cars, samples
        Sizes of the three series; samples run on the default configuration.
    reference_seconds
        Processor time that the reference solver gets [s], half as much more before the guideway.
    law_repeats
        Rounds in which every law of control is timed, one after the other.
    thread_samples
        Samples of the run on two threads against one.
    matrix, copied
        Rows of the square matrices, and doubles copied.
    """

    spans: tuple[int, ...] = (5, 10, 20, 40)
    cars: tuple[int, ...] = (1, 2, 5, 10)
    samples: tuple[int, ...] = (1, 2, 16, 17, 64, 256, 1000)
    reference_seconds: float = 20.0
    law_repeats: int = 9
    thread_samples: int = 64
    matrix: int = 2000
    copied: int = 2**25


QUICK = Sizes(
    spans=(5, 10),
    cars=(2, 5),
    samples=(1, 2, 16, 17),
    reference_seconds=4.0,
    law_repeats=3,
    thread_samples=32,
    matrix=1000,
    copied=2**23,
)


@dataclass(frozen=True)
class Time:
    """Process time and wall time [s]."""

    process: float
    wall: float


def timed(function: Callable[[], object], repeats: int = 1) -> Time:
    """Smallest times of some runs of a function without arguments."""
    runs = []
    for _ in range(repeats):
        wall, process = time.perf_counter(), time.process_time()
        function()
        runs.append((time.process_time() - process, time.perf_counter() - wall))
    return Time(min(run[0] for run in runs), min(run[1] for run in runs))


def gains_of(config: Config, n_samples: int) -> Array:
    """Gains within 5 % of their means (sample, 4): no sample loses levitation."""
    spread = np.random.default_rng(1).uniform(0.95, 1.05, (n_samples, 4))
    return np.array(config.gains.as_row) * spread


def with_part(config: Config, part: str, **values: float) -> Config:
    """A configuration with some values of one of its parts changed."""
    return config.model_copy(update={part: getattr(config, part).model_copy(update=values)})


# ---------------------------------------------------------------- what the machine gives


@dataclass(frozen=True)
class Ceiling:
    """What one core gives: floating-point operations [1/s] and bytes read and written [1/s]."""

    flops: float
    bytes: float


def ceiling(sizes: Sizes) -> Ceiling:
    """Rate of a double-precision matrix product (2n³ operations) and of a copy between arrays."""
    n = sizes.matrix
    a, b = np.random.default_rng(2).uniform(size=(2, n, n))
    product = np.empty_like(a)
    np.matmul(a, b, out=product)
    multiply = timed(lambda: np.matmul(a, b, out=product), 5).process
    source = np.zeros(sizes.copied)
    target = np.ones(sizes.copied)
    copy = timed(lambda: np.copyto(target, source), 5).process
    return Ceiling(2 * n**3 / multiply, 16 * sizes.copied / copy)


def processor() -> str:
    """Name of the processor, its number of cores, and the clock where the system tells."""
    name, clock = platform.processor() or platform.machine(), ""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        lines = dict(
            (part.strip() for part in line.split(":", 1))
            for line in cpuinfo.read_text().splitlines()
            if ":" in line
        )
        name = lines.get("model name", name)
        clock = f" at {float(lines['cpu MHz']) / 1e3:.2f} GHz" if "cpu MHz" in lines else ""
        wide = "AVX-512" if "avx512f" in lines.get("flags", "") else "AVX2"
        clock += f", {wide}" if "avx2" in lines.get("flags", "") else ""
    return f"{name}{clock}, {os.cpu_count()} cores"


def linear_algebra() -> str:
    """The library of linear algebra and the processor that its kernels are made for."""
    names = {f"{one['internal_api']}, {one.get('architecture', '?')}" for one in threadpool_info()}
    return " and ".join(sorted(name for name in names if "blas" in name or "mkl" in name))


# ---------------------------------------------------------------- operations by phase


@dataclass(frozen=True)
class Phase:
    """A part of the step: its operations per step and sample, and its time per step and sample [s].

    A multiplication, an addition and a division count one, a fused multiply-add two, comparisons,
    loads and stores nothing.
    """

    title: str
    operations: float
    seconds: float | None = None


def noses(system: integrate.System) -> Array:
    """Place of the nose at every step (step,) [m]."""
    steps = np.arange(1, course(system.config).n_steps + 1)
    return course(system.config).nose(steps * course(system.config).time_step)


def rail_under_train(system: integrate.System) -> Array:
    """Share (span,) of a span's rail that a mean step moves: its units under the train [-]."""
    spans, place = system.spans, noses(system)
    unit = spans.span_length / spans.n_units
    shares = []
    for span in range(spans.n_spans):
        tail = place - system.config.train.length - span * spans.span_length
        begin = np.clip(np.floor(tail / unit - 1e-6), 0, spans.n_units)
        end = np.clip(
            np.floor((place - span * spans.span_length) / unit + 1e-6) + 1, 0, spans.n_units
        )
        shares.append(np.maximum(end - begin, 0).mean() / spans.n_units)
    return np.array(shares)


def poles_and_coefficients(system: integrate.System) -> tuple[int, float]:
    """Poles of the train, and the rail coefficients under all their faces in a mean step [-]."""
    poles, met = 0, 0
    for footprints in (system.suspension_footprints, system.guidance_footprints):
        n = course(system.config).n_steps
        poles += 2 * footprints.number.size  # right and left
        # footprints follow each other, and so do their coefficients
        met += 2 * int(
            (
                footprints.start[footprints.number + n + 1]
                - footprints.start[footprints.number + 1]
            ).sum()
        )
    return poles, met / course(system.config).n_steps


def steps_of_stretches(system: integrate.System) -> Array:
    """Steps that each stretch of the guideway lasts (stretch,) [-]."""
    begins = system.spans.stretches.first_step
    return np.diff([*begins, course(system.config).n_steps + 1])


def operations(system: integrate.System) -> dict[str, float]:
    """Operations of a mean step of one sample in each phase, from the sizes of its arrays."""
    vehicle, spans = system.vehicle, system.spans
    steps = steps_of_stretches(system)
    n_dof = vehicle.inverse_mass.size
    # links: what they hang on 3, fused; stretch 2m - 1 and force back 2m for m coefficients
    links = 3 * vehicle.scaled_dof.size + 4 * vehicle.link_coefficient.size
    links -= vehicle.link_start.size - 1
    moving = (
        1 - (course(system.config).first_step - 1) / course(system.config).n_steps
    )  # the train rests before
    # poles: gap error 3, its rate 3, gap 1, current 4, pull 3, force and moment 3, means 2;
    # a magnet: signs 4, force and moment on the train 6, means 2
    n_poles, n_under = poles_and_coefficients(system)
    n_magnets = system.train.magnets.x.size
    poles = 19 * n_poles + 12 * n_magnets
    # rail under a face: a coefficient in error, twice in its rate, and in the force back, fused
    under_poles = (3 * 2 + 2) * n_under
    # rails of a span: displacement and velocity of z, roll and y from the coordinates that move
    # them, right and left from mean and roll; back: forces on those coordinates
    rails = 0.0
    for span, share in enumerate(rail_under_train(system)):
        moved = np.diff(spans.upright_start)[span] + 2 * np.diff(spans.sideways_start)[span]
        rails += share * spans.stride * (2 * (2 * moved + 2) + 2 + 2 * moved)
    # guideway, of what is stepped: relative motion and its rate, forces back, stiffness, damping,
    # exact step, pier tops
    guideway, line_states, stretches = 0.0, 0.0, spans.stretches
    for stretch, share in enumerate(steps / course(system.config).n_steps):
        start, tops, stop = (
            stretches.start[stretch],
            stretches.tops[stretch],
            stretches.start[stretch + 1],
        )
        modes = stretches.stepped[start:tops]
        carried = np.diff(spans.carried_start)[modes].sum()
        each = slice(start, stop)
        taken = (stretches.taken_to[each] - stretches.taken_from[each])[tops - start :].sum()
        damping = (stretches.damping_to[each] - stretches.damping_from[each]).sum()
        between = np.diff(spans.stiffness_start)[
            stretches.stepped[tops:stop] - spans.square.size
        ].sum()
        factor = stretches.factor_start[stop] - stretches.factor_start[tops]
        coefficients = carried + taken + modes.size + between + damping + 2 * factor
        guideway += share * (2 * coefficients + (stop - start) + 2 * modes.size + 2 * (stop - tops))
        line_states += share * 8 * (stop - start)
    # states: x 2, velocity 2, predicted 4, fused; the train's forces over its masses 1
    states = 9 * n_dof * moving + line_states
    # outputs: midspan z and y 4 a column, each section of the low-pass 9, peak of a response 9
    n_sections = packing.timing(system.config, 0).sections.shape[0]
    outputs = 2 * (4 * spans.output_column.size + 9 * n_sections)
    outputs += 9 * (4 + 2 * vehicle.body_z.size)
    return {
        "train links": links * moving,
        "poles: gap, current, force": poles * moving,
        "poles: rail under them and force back": under_poles,
        "rails: from modes and back": rails,
        "guideway: stiffness, damping, pier tops": guideway,
        "states: predict and kick": states,
        "outputs": outputs * moving,
    }


@njit
def _repeat_links(n, vehicle, train, scaled, pull):
    for _ in range(n):
        _links(vehicle, train, scaled, pull)


@njit
def _repeat_train(n, vehicle, dt, train):
    for _ in range(n):
        _advance_train(vehicle, dt, train)


@njit
def _repeat_answer(n, spans, stretch, rates, guideway):
    for _ in range(n):
        _answer(spans, stretch, rates, guideway)


@njit
def _repeat_advance(n, spans, stretch, dt, guideway):
    for _ in range(n):
        _advance_guideway(spans.stretches, stretch, dt, guideway)


@njit
def _repeat_rails(n, spans, span, guideway, rails, turn, packed):
    """What the passage does with the rails of one span in a step, there and back."""
    for _ in range(n):
        _move_span(spans, span, 0, spans.stride, guideway.position, packed, rails.motion)
        _move_span(spans, span, 0, spans.stride, guideway.predicted, packed, rails.rate)
        _load_span(spans, span, 0, spans.stride, rails, turn, packed, guideway.force)


@njit
def _every_step(
    stride, first, last, footprints, rows, law, dt, gains, train, rails, magnet, circuits, watch,
    outcome,
):  # fmt: skip
    for step in range(first, last + 1, stride):
        attract(
            footprints, rows, law, step, dt, gains, train, rails, magnet, circuits, False, watch,
            outcome,
        )  # fmt: skip


def phases(system: integrate.System, per_step: float) -> list[Phase]:
    """Operations of each phase, and the time of those that stand in a function of their own.

    Each is run on its own, on states of about the size that a passage has; what they leave of
    ``per_step``, the time of a step and sample in a passage [s], is states, outputs and the loop.
    """
    counted = operations(system)
    spans, rng = system.spans, np.random.default_rng(3)
    vehicle, dt = system.vehicle, course(system.config).time_step
    n_dof, n_line = vehicle.inverse_mass.size, system.reduced.n_coordinates
    n_rail = spans.n_spans * spans.stride

    def rows(n: int, size: float) -> Array:
        """Rows of samples of about a size, where the kernels have theirs."""
        filled = zeros(n)
        filled[:] = size * rng.standard_normal((n, LANES))
        return filled

    def motion(n: int, size: float) -> Motion:
        """Degrees of freedom that move; no forces."""
        return Motion(*(rows(n, size) for _ in range(4)), zeros(n))

    train, resting = motion(n_dof, 1e-5), at_rest(n_dof)
    scaled, link_pull = zeros(vehicle.scaled_dof.size), zeros(vehicle.link_start.size - 1)
    guideway, guideway_resting = motion(n_line, 1e-5), at_rest(n_line)
    rails = Rails(*(rows(3 * n_rail, 1e-5).reshape((3, n_rail, LANES)) for _ in range(3)))
    turn, packed = zeros(spans.stride), zeros(spans.in_order.size)
    rates = zeros(n_line)
    timing = packing.timing(system.config, 0)
    kinds = (system.suspension, system.guidance)
    outcome = packing.empty_outcome(system.train, kinds, timing)
    n_responses = outcome.extreme.shape[0]
    watch = _new_watch(system.train.magnets.x.size, timing.sections.shape[0], n_responses)
    gains = np.concatenate([gains_of(system.config, LANES), np.zeros((LANES, 4))], axis=1)
    lanes = np.ascontiguousarray(gains.T)

    def per_call(n: int, function: Callable[[int], object]) -> float:
        function(1)  # compiles
        return timed(lambda: function(n), 3).process / n / LANES

    moving = 1 - (timing.first_step - 1) / timing.n_steps
    links = moving * per_call(2000, lambda n: _repeat_links(n, vehicle, train, scaled, link_pull))
    states = moving * per_call(2000, lambda n: _repeat_train(n, vehicle, dt, resting))
    stepped = 0.0
    for stretch, share in enumerate(steps_of_stretches(system) / timing.n_steps):
        stepped += share * per_call(
            500, lambda n, at=stretch: _repeat_answer(n, spans, at, rates, guideway)
        )
        states += share * per_call(
            500, lambda n, at=stretch: _repeat_advance(n, spans, at, dt, guideway_resting)
        )
    shares = rail_under_train(system)
    of_rails = sum(
        share
        * per_call(
            1000,
            lambda n, span=span: _repeat_rails(n, spans, span, guideway, rails, turn, packed),
        )
        for span, share in enumerate(shares)
    )
    every = 20  # of all steps, evenly over the passage
    poles = 0.0
    train, rails = motion(n_dof, 1e-5), Rails(*(0.0 * field for field in rails))
    for kind, footprints, circuit in zip(
        kinds,
        (system.suspension_footprints, system.guidance_footprints),
        (system.config.control.suspension, system.config.control.guidance),
        strict=True,
    ):
        law = packing.law(circuit, kind, dt, gains)
        magnet, circuits = empty_magnet(kind, law), circuits_at_rest(kind, law)

        def calls(
            n: int, kind=kind, footprints=footprints, law=law, magnet=magnet, circuits=circuits
        ) -> None:
            last = timing.n_steps if n > 1 else timing.first_step
            _every_step(
                every, timing.first_step, last, footprints, kind, law, dt, lanes, train, rails,
                magnet, circuits, watch, outcome,
            )  # fmt: skip

        steps = timing.n_steps + 1 - timing.first_step
        poles += moving * per_call(-(-steps // every), calls)
    rest = per_step - links - stepped - of_rails - poles - states
    law, under, counted_states = (
        counted.pop(name)
        for name in (
            "poles: gap, current, force",
            "poles: rail under them and force back",
            "states: predict and kick",
        )
    )
    return [
        Phase("train links", counted["train links"], links),
        Phase("poles: gap, current, force", law),
        Phase("poles: rail under them and force back", under),
        Phase("poles, both", law + under, poles),
        Phase("rails: from modes and back", counted["rails: from modes and back"], of_rails),
        Phase(
            "guideway: stiffness, damping, pier tops",
            counted["guideway: stiffness, damping, pier tops"],
            stepped,
        ),
        Phase("states: predict and kick", counted_states, states),
        Phase("outputs and the rest", counted["outputs"], rest),
    ]


def step_bytes(system: integrate.System) -> tuple[int, int]:
    """Bytes that a row of samples goes through in a step: states, and matrices they share."""
    spans, vehicle = system.spans, system.vehicle
    n_dof, n_line = vehicle.inverse_mass.size, system.reduced.n_coordinates
    rows = 5 * n_dof + vehicle.scaled_dof.size + vehicle.link_start.size - 1
    rows += 5 * n_line + 9 * spans.n_spans * spans.stride
    shared = [*spans, *spans.stretches, *vehicle]
    tables = sum(array.nbytes for array in shared if isinstance(array, np.ndarray))
    return rows * LANES * 8, tables


# ---------------------------------------------------------------- the two solvers


@dataclass(frozen=True)
class Reference:
    """The reference solver's time per step [s] before and on the guideway, and what follows.

    Attributes
    ----------
    resting, running
        Process time per step before the nose reaches the guideway, and after.
    steps
        Steps on the guideway that were timed.
    passage
        Process time of a whole passage [s], extrapolated.
    """

    resting: float
    running: float
    steps: int
    passage: float


class _Enough(Exception):
    """Ends a run of the reference solver that has been timed for long enough."""


def step_time(config: Config, seconds: float) -> tuple[float, int]:
    """Process time per step of the reference solver from its start, and the steps timed.

    The run is left alone but for a signal twice a second of processor time, which reads the number
    of the step and, after ``seconds``, ends it.
    """
    seen: list[tuple[float, int]] = []
    profile, gains = track(config), np.array([config.gains.as_row])

    def look(_signal: int, frame: object) -> None:
        while frame is not None and frame.f_code is not reference.passed.__code__:
            frame = frame.f_back
        if frame is not None and "number" in frame.f_locals:
            seen.append((time.process_time(), frame.f_locals["number"]))
            if seen[-1][0] - seen[0][0] > seconds:
                raise _Enough

    before = signal.signal(signal.SIGPROF, look)
    signal.setitimer(signal.ITIMER_PROF, 0.5, 0.5)
    try:
        reference.integrate(config, profile, gains)
    except _Enough:
        pass
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
    steps = seen[-1][1] - seen[0][1]
    return (seen[-1][0] - seen[0][0]) / steps, steps


def reference_time(config: Config, seconds: float) -> Reference:
    """Time the reference solver before the guideway and while the train runs onto it.

    A step grows slower with every pole that reaches the guideway, and the timed steps are those of
    the first of them: a whole passage takes longer than is extrapolated here.
    """
    resting, _ = step_time(config, seconds / 2)
    running, steps = step_time(with_part(config, "passage", approach=1e-3), seconds)
    before = int(-course(config).start / config.passage.speed / course(config).time_step)
    whole = resting * before + running * (course(config).n_steps - before)
    return Reference(resting, running, steps, whole)


# ---------------------------------------------------------------- laws of control and faces

LAG, DELAY = 2e-3, 1e-3
"""Of the current and of the signal where they are timed [s]; what they are costs nothing."""


@dataclass(frozen=True)
class Law:
    """A way of closing the magnets, and the process time of a passage with it [s]."""

    name: str
    cost: float


def closed(config: Config, *, pole_length: float | None = None, **circuit: object) -> Config:
    """A configuration whose magnets all have other circuits, or faces of another length [m]."""
    both = Circuit.model_construct(**(Circuit().model_dump() | circuit))
    kinds = ("suspension", "guidance")
    config = config.model_copy(
        update={"control": config.control.model_copy(update=dict.fromkeys(kinds, both))}
    )
    if pole_length is None:
        return config
    magnets = {
        f"{kind}_magnet": getattr(config.train, f"{kind}_magnet").model_copy(
            update={"pole_length": pole_length}
        )
        for kind in kinds
    }
    return config.model_copy(update={"train": config.train.model_copy(update=magnets)})


def laws(config: Config, repeats: int) -> list[Law]:
    """Passages with every grouping, late circuits and points, in turns; the least of each.

    On a smooth track: grouped circuits may lose levitation on a rough one, and a row of lost
    samples would end early.
    """
    config = with_part(config, "irregularity", enabled=False)
    variants = {
        "pole": closed(config),
        "pole, poles as points": closed(config, pole_length=0.0),
        **{group: closed(config, group=group) for group in ("ends", "half", "lumped")},
        "pole, lag": closed(config, lag=LAG),
        "pole, delay": closed(config, delay=DELAY),
        "pole, lag and delay": closed(config, lag=LAG, delay=DELAY),
    }
    systems = {
        name: integrate.prepare(variant, track(variant)) for name, variant in variants.items()
    }
    gains = gains_of(config, LANES)
    for name, system in systems.items():
        if integrate.integrate(system, gains).status.any():
            raise RuntimeError(f"samples lost levitation with {name!r}")
    best = dict.fromkeys(systems, np.inf)
    for _ in range(repeats):
        for name, system in systems.items():
            once = timed(lambda system=system: integrate.integrate(system, gains))
            best[name] = min(best[name], once.process / LANES)
    for name, cost in best.items():
        tell(f"  {name}: {cost:.4f} s a passage, {cost / best['pole']:.2f} of that of 'pole'")
    return [Law(name, cost) for name, cost in best.items()]


def over(laws: list[Law], name: str, base: str) -> float:
    """Cost of a law over that of another [-]."""
    cost = {law.name: law.cost for law in laws}
    return cost[name] / cost[base]


# ---------------------------------------------------------------- numbers of a sample's own

TRAIN_KEYS = (
    "train.car_body.mass",
    "train.bogie.mass",
    "train.suspension_magnet.mass",
    "train.suspension_magnet.end_stiffness",
    "train.air_spring.stiffness",
    "irregularity.vertical.coefficient",
)
GUIDEWAY_KEYS = (
    "guideway.girder.elastic_modulus",
    "guideway.girder.density",
    "guideway.bearing.vertical_stiffness",
    "guideway.bearing.lateral_stiffness",
    "guideway.damping_ratio",
    "guideway.pier.density",
)
"""Twelve numbers that differ from sample to sample."""

OWN_ROWS = 16
"""Rows of samples that are timed: as many as share the assembly of their trains."""


def own_numbers(config: Config, repeats: int) -> list[Law]:
    """Passages with shared numbers, with trains and with guideways of their own; in turns."""
    system, n_samples = integrate.prepare(config, track(config)), OWN_ROWS * LANES
    spread = np.random.default_rng(4).uniform(0.9, 1.1, size=(12, n_samples))
    values = {
        key: config.number_at(key)[0] * column
        for key, column in zip((*TRAIN_KEYS, *GUIDEWAY_KEYS), spread, strict=True)
    }
    sets = {"shared": {}, "sample": {key: values[key] for key in TRAIN_KEYS}, "guideway": values}
    gains, best = gains_of(config, n_samples), dict.fromkeys(sets, np.inf)
    for chosen in sets.values():  # compiles, and makes the basis
        few = {key: column[:1] for key, column in chosen.items()}
        integrate.integrate(system, gains[:1], values=few)
    for _ in range(repeats):
        for name, chosen in sets.items():
            once = timed(lambda v=chosen: integrate.integrate(system, gains, values=v))
            best[name] = min(best[name], once.process / n_samples)
    for name, cost in best.items():
        tell(f"  {name}: {cost:.4f} s a passage, {cost / best['shared']:.2f} of that of 'shared'")
    return [Law(name, cost) for name, cost in best.items()]


# ---------------------------------------------------------------- how the cost grows


@dataclass(frozen=True)
class Row:
    """One size of a series.

    Attributes
    ----------
    size
        Spans, cars or samples.
    cost
        Process time per passage [s]; in the series over samples per batch.
    steps
        Steps of the passage.
    prepared
        Process time of what is done once [s].
    """

    size: int
    cost: float
    steps: int
    prepared: float = 0.0


def exponent(rows: list[Row], value: Callable[[Row], float]) -> float:
    """Slope of the logarithm of a value over that of the size."""
    size = np.log([row.size for row in rows])
    return float(np.polyfit(size, np.log([value(row) for row in rows]), 1)[0])


def grown(configs: dict[int, Config]) -> list[Row]:
    """One full row of samples at each size."""
    rows = []
    for size, config in configs.items():
        began = time.process_time()
        system = integrate.prepare(config, track(config))
        prepared = time.process_time() - began
        gains = gains_of(config, LANES)
        run = timed(lambda system=system, gains=gains: integrate.integrate(system, gains))
        rows.append(Row(size, run.process / LANES, course(config).n_steps, prepared))
        tell(f"  {size}: {rows[-1].cost:.3f} s a passage, prepared in {prepared:.2f} s")
    return rows


def batches(config: Config, counts: tuple[int, ...]) -> list[Row]:
    """The default configuration with different numbers of samples, one thread."""
    rows = []
    for count in counts:
        gains, begun = gains_of(config, count), time.process_time()
        passages = integrate.integrate(_system(config, ""), gains)
        rows.append(Row(count, time.process_time() - begun, course(config).n_steps))
        if passages.status.any():
            raise RuntimeError(f"{np.count_nonzero(passages.status)} samples lost levitation")
        tell(f"  {count}: {rows[-1].cost:.2f} s, {rows[-1].cost / count:.3f} s a passage")
    return rows


# ---------------------------------------------------------------- start-up, writing


def start_up(runs: int) -> list[tuple[str, Time]]:
    """Times of the parts of a fresh process that runs one passage twice, cached kernel.

    Of several runs the one with the least process time; the first fills the caches and is left out.
    """
    best: list[tuple[str, Time]] = []
    for number in range(runs + 1):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        began = time.perf_counter()
        out = subprocess.run(
            [sys.executable, "-c", STARTUP],
            capture_output=True,
            text=True,
            check=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        ).stdout
        wall = time.perf_counter() - began
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        process = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        parts = []
        for line in out.splitlines():
            name, cpu, elapsed = line.split("|")
            parts.append((name, Time(float(cpu), float(elapsed))))
        inside = Time(sum(p.process for _, p in parts), sum(p.wall for _, p in parts))
        interpreter = Time(process - inside.process, wall - inside.wall)
        parts.insert(0, ("interpreter, beginning and end", interpreter))
        if number and (not best or process < sum(p.process for _, p in best)):
            best = parts
    return best


def beyond_passage(parts: list[tuple[str, Time]]) -> Time:
    """What a fresh process takes beyond the passages themselves."""
    one = dict(parts)["second passage"]
    total = Time(sum(p.process for _, p in parts), sum(p.wall for _, p in parts))
    return Time(total.process - 2 * one.process, total.wall - 2 * one.wall)


def writing(config: Config, n_samples: int) -> Time:
    """Time to describe, check and write the extremes of so many samples."""
    one = simulate(config, gains_of(config, 1))
    many = one.isel(sample=np.zeros(n_samples, dtype=int))
    many = many.assign_coords(sample=np.arange(n_samples))
    content, code = STAGE.slice(config), code_of("simulation")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "passages.nc")
        return timed(lambda: datasets.write(many, path, "passage", config=content, code=code))


# ---------------------------------------------------------------- all of it


@dataclass
class Results:
    """All that is measured, in the order in which it is."""

    machine: str
    load_before: tuple[float, float, float]
    startup: list[tuple[str, Time]] = field(default_factory=list)
    production: Time = Time(0, 0)
    samples: list[Row] = field(default_factory=list)
    memory: float = 0.0
    writing: Time = Time(0, 0)
    threads: dict[int, Time] = field(default_factory=dict)
    ceiling: Ceiling = Ceiling(1, 1)
    phases: list[Phase] = field(default_factory=list)
    bytes: tuple[int, int] = (0, 0)
    reference: Reference = Reference(0, 0, 0, 0)
    laws: list[Law] = field(default_factory=list)
    own: list[Law] = field(default_factory=list)
    cars: list[Row] = field(default_factory=list)
    spans: list[Row] = field(default_factory=list)
    wall: float = 0.0

    @property
    def per_passage(self) -> float:
        """Process time of one passage in a full row [s]."""
        return self.production.process / LANES


def tell(text: str) -> None:
    print(text, flush=True)


def measure(sizes: Sizes) -> Results:
    """Run everything; the memory of many samples before whatever takes more."""
    began = time.perf_counter()
    config = load_config()
    results = Results(processor(), os.getloadavg())
    tell(f"{results.machine}, load {results.load_before[0]:.2f}")
    tell("start-up of a fresh process")
    results.startup = start_up(2)
    tell(f"  {beyond_passage(results.startup).process:.2f} s beyond the passages")
    tell("production solver, one full row")
    system = _system(config, "")
    integrate.integrate(system, gains_of(config, 1))
    results.production = timed(lambda: integrate.integrate(system, gains_of(config, LANES)), 3)
    tell(f"  {results.per_passage:.4f} s a passage")
    tell("laws of control")
    results.laws = laws(config, sizes.law_repeats)
    tell("numbers of a sample's own")
    results.own = own_numbers(config, max(1, sizes.law_repeats // 2))
    tell("samples")
    results.samples = batches(config, sizes.samples)
    results.memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    tell(f"  {results.memory / 1e9:.2f} GB at most so far")
    results.writing = writing(config, sizes.samples[-1])
    tell("threads")
    several = gains_of(config, sizes.thread_samples)
    for n_threads in (1, 2):
        results.threads[n_threads] = timed(
            lambda n=n_threads: integrate.integrate(system, several, n_threads=n)
        )
        tell(f"  {n_threads}: {results.threads[n_threads].wall:.2f} s wall")
    tell("ceiling")
    results.ceiling = ceiling(sizes)
    tell(f"  {results.ceiling.flops / 1e9:.1f} GFLOP/s, {results.ceiling.bytes / 1e9:.1f} GB/s")
    tell("phases")
    results.phases = phases(system, results.per_passage / course(config).n_steps)
    results.bytes = step_bytes(system)
    tell("reference solver")
    results.reference = reference_time(config, sizes.reference_seconds)
    tell(f"  {results.reference.passage:.0f} s a passage")
    tell("cars")
    results.cars = grown({n: with_part(config, "train", n_cars=n) for n in sizes.cars})
    tell("spans")
    results.spans = grown({n: with_part(config, "guideway", n_spans=n) for n in sizes.spans})
    results.wall = time.perf_counter() - began
    return results


# ---------------------------------------------------------------- page and figure


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    """A Markdown table, numbers to the right."""
    return [
        "| " + " | ".join(head) + " |",
        "|---" + "|---:" * (len(head) - 1) + "|",
        *("| " + " | ".join(row) + " |" for row in rows),
        "",
    ]


def phase_rows(results: Results, config: Config) -> list[list[str]]:
    """Operations, time, rate and shares of every phase; whole step last."""
    per_step = results.per_passage / course(config).n_steps
    total = sum(p.operations for p in results.phases if p.seconds is not None)
    rows = []
    for phase in [*results.phases, Phase("**whole step**", total, per_step)]:
        cells = [phase.title, f"{phase.operations:,.0f}", f"{phase.operations / total:.1%}"]
        if phase.seconds is None:
            cells = ["– " + cells[0], *cells[1:], "", "", "", ""]
        else:
            rate = phase.operations / phase.seconds
            cells += [
                f"{phase.seconds * 1e6:.2f}",
                f"{phase.seconds / per_step:.1%}",
                f"{rate / 1e9:.1f}",
                f"{rate / results.ceiling.flops:.0%}",
            ]
        rows.append(cells)
    return rows


def projected(results: Results, seconds: float, prepared: float) -> float:
    """Wall seconds of ten thousand passages on two cores from the process time of one."""
    speed_up = results.threads[1].wall / results.threads[2].wall
    once = beyond_passage(results.startup).process + prepared
    return N_PASSAGES * seconds / speed_up + once + results.writing.process


def judged(value: float, target: float, *, least: bool) -> str:
    return "met" if (value >= target if least else value <= target) else "missed"


def page(results: Results, sizes: Sizes) -> str:
    """The committed summary, in Markdown."""
    config = load_config()
    ratio = results.reference.passage / results.per_passage
    speed_up = results.threads[1].wall / results.threads[2].wall
    beyond = beyond_passage(results.startup)
    spans = {row.size: row for row in results.spans}
    least, most = results.spans[0], results.spans[-1]
    longer = spans.get(20, most)
    many = [row for row in results.samples if row.size % LANES == 0 or row.size >= 10 * LANES]
    rate = results.phases and sum(p.operations for p in results.phases if p.seconds is not None)
    rate = rate * course(config).n_steps / results.per_passage
    base_wall = projected(results, results.per_passage, least.prepared)
    own_cost = {law.name: law.cost for law in results.own}
    twelve = projected(results, own_cost["guideway"], least.prepared)
    long_wall = projected(results, longer.cost, longer.prepared)
    n_most = results.samples[-1].size
    lines = [
        "# What a passage costs",
        "",
        "Written by `make bench` (`benchmarks/bench_passage.py`); do not edit.  How to read it: "
        "`benchmarks/README.md`.",
        "",
        f"Machine: {results.machine}; load average {results.load_before[0]:.2f} at the start; "
        f"Python {platform.python_version()}, NumPy {np.__version__}.  The run took "
        f"{results.wall / 60:.1f} minutes.",
        f"Default configuration: {config.train.n_cars} cars, {config.guideway.n_spans} spans, "
        f"{config.passage.speed * 3.6:.0f} km/h, {course(config).n_steps} steps of "
        f"{course(config).time_step * 1e3:.3f} ms, modes to {config.passage.mode_cutoff:g} Hz at "
        f"midspan and {config.passage.mode_cutoff_elsewhere:g} Hz elsewhere, rows of {LANES} "
        "samples.  Seconds are process time on one core unless they are called wall.",
        "",
        *(
            [
                "**Other work had the machine at the same time: wall times and the gain of a "
                "second thread say little, process times are too long.  Run again on an idle "
                "machine before quoting.**",
                "",
            ]
            if results.load_before[0] > BUSY
            else []
        ),
        "## In short",
        "",
        *table(
            ["", "measured", "target", ""],
            [
                [
                    "production solver, a passage",
                    f"{results.per_passage:.4f} s ({results.production.wall / LANES:.4f} s wall)",
                    "",
                    "",
                ],
                ["reference solver, a passage", f"> {results.reference.passage:.0f} s", "", ""],
                [
                    "reference over production",
                    f"> {ratio:.0f}",
                    f"≥ {TARGET_RATIO}",
                    judged(ratio, TARGET_RATIO, least=True),
                ],
                [
                    "operations a second",
                    f"{rate / 1e9:.1f} GFLOP/s, {rate / results.ceiling.flops:.0%} of the ceiling",
                    "",
                    "",
                ],
                [
                    f"{N_PASSAGES:,} passages, {least.size} spans, 2 cores",
                    f"{base_wall / 60:.1f} min wall, projected",
                    f"≤ {TARGET_MINUTES:g} min",
                    judged(base_wall / 60, TARGET_MINUTES, least=False),
                ],
                [
                    f"{N_PASSAGES:,} passages, {longer.size} spans, 2 cores",
                    f"{long_wall / 60:.1f} min wall, projected",
                    f"≤ {TARGET_SPANS:g} times that",
                    f"{judged(long_wall / base_wall, TARGET_SPANS, least=False)}: "
                    f"{long_wall / base_wall:.1f} times",
                ],
                [
                    "two threads over one",
                    f"{speed_up:.2f} times",
                    f"≥ {TARGET_THREADS}",
                    judged(speed_up, TARGET_THREADS, least=True),
                ],
                [
                    "start of a process beyond its passages",
                    f"{beyond.process:.2f} s ({beyond.wall:.2f} s wall)",
                    f"< {TARGET_STARTUP:g} s",
                    judged(beyond.process, TARGET_STARTUP, least=False),
                ],
                *(
                    [
                        f"{what} over {base}",
                        f"{over(results.laws, name, base_name):.2f} times",
                        f"≤ {target:.2f} times",
                        judged(over(results.laws, name, base_name), target, least=False),
                    ]
                    for what, base, name, base_name, target in (
                        ("faces", "points", "pole", "pole, poles as points", TARGET_FACES),
                        ("`ends`", "`pole`", "ends", "pole", TARGET_ENDS),
                        ("lag and delay", "neither", "pole, lag and delay", "pole", TARGET_LATE),
                    )
                ),
                *(
                    [
                        f"numbers of {what} of each sample's own",
                        f"{over(results.own, name, 'shared'):.2f} times",
                        f"≤ {target:.2f} times",
                        judged(over(results.own, name, "shared"), target, least=False),
                    ]
                    for what, name, target in (
                        ("train and track", "sample", TARGET_SAMPLE),
                        ("the guideway, too,", "guideway", TARGET_GUIDEWAY),
                    )
                ),
                [
                    f"{N_PASSAGES:,} passages, 12 numbers of their own, 2 cores",
                    f"{twelve / 60:.1f} min wall, projected",
                    f"≤ {TARGET_TWELVE:g} min",
                    judged(twelve / 60, TARGET_TWELVE, least=False),
                ],
                [
                    f"memory, {n_most} samples",
                    f"{results.memory / 1e9:.2f} GB",
                    f"< {TARGET_MEMORY:g} GB",
                    judged(results.memory / 1e9, TARGET_MEMORY, least=False),
                ],
            ],
        ),
        "![cost against spans, cars and samples](passage.png)",
        "",
        "## The machine's ceiling",
        "",
        f"One core: {results.ceiling.flops / 1e9:.1f} GFLOP/s in the product of two matrices of "
        f"{sizes.matrix} × {sizes.matrix} doubles ({linear_algebra()}); "
        f"{results.ceiling.bytes / 1e9:.1f} GB/s, read and written together, in a copy of "
        f"{sizes.copied * 8 / 2**20:.0f} MiB.",
        "",
        "## Operations of a step",
        "",
        "Per step and sample, mean over the passage; counted from the sizes of the arrays.  "
        "A fused multiply-add counts two, comparisons nothing.  The time of a phase is that of its "
        "kernel run on its own, where its data lie closer than in a passage; the last but one line "
        "is what the others leave.  Lines with a dash are parts of the line below them.",
        "",
        *table(
            ["phase", "operations", "share", "time [µs]", "share", "GFLOP/s", "of ceiling"],
            phase_rows(results, config),
        ),
        f"A row of samples goes through {results.bytes[0] / 2**10:.0f} KiB of states and "
        f"{results.bytes[1] / 2**10:.0f} KiB of matrices in a step.",
        "",
        "## Laws of control",
        "",
        "Who shares a circuit, and how late its current comes; poles with their faces but where "
        "they are points.  On smooth track, all in turns, the least of "
        f"{sizes.law_repeats} rounds.",
        "",
        *table(
            ["law", "s a passage", "over `pole`"],
            [
                [law.name, f"{law.cost:.4f}", f"{over(results.laws, law.name, 'pole'):.2f}"]
                for law in results.laws
            ],
        ),
        f"Lag {LAG * 1e3:g} ms, delay {DELAY * 1e3:g} ms.",
        "",
        "## Numbers of a sample's own",
        "",
        "Numbers of the configuration that differ from sample to sample: of train and track "
        f"({len(TRAIN_KEYS)}), and of the guideway, too ({len(GUIDEWAY_KEYS)} more).  Set-up "
        f"included, {OWN_ROWS} rows.",
        "",
        *table(
            ["own", "s a passage", "over shared"],
            [
                [law.name, f"{law.cost:.4f}", f"{over(results.own, law.name, 'shared'):.2f}"]
                for law in results.own
            ],
        ),
        "## Reference solver",
        "",
        f"One sample, same configuration: {results.reference.resting * 1e3:.2f} ms a step before "
        f"the guideway and {results.reference.running * 1e3:.2f} ms over the first "
        f"{results.reference.steps} steps on it, extrapolated to {course(config).n_steps} steps: "
        f"{results.reference.passage:.0f} s.  A step grows slower as more of the train is on the "
        "guideway, so a whole passage takes longer than this.",
        "",
        "## How the cost grows",
        "",
        *table(
            ["spans", "s a passage", "steps", "µs a step and sample", "once [s]"],
            [
                [
                    f"{row.size}",
                    f"{row.cost:.3f}",
                    f"{row.steps}",
                    f"{row.cost / row.steps * 1e6:.2f}",
                    f"{row.prepared:.2f}",
                ]
                for row in results.spans
            ],
        ),
        f"Exponent {exponent(results.spans, lambda row: row.cost):.2f} of a passage, "
        f"{exponent(results.spans, lambda row: row.cost / row.steps):.2f} of a step: the longer "
        "the line, the more of the steps have the whole train on it.  " + per_span(results.spans),
        "",
        *table(
            ["cars", "s a passage", "steps", "µs a step and sample", "once [s]"],
            [
                [
                    f"{row.size}",
                    f"{row.cost:.3f}",
                    f"{row.steps}",
                    f"{row.cost / row.steps * 1e6:.2f}",
                    f"{row.prepared:.2f}",
                ]
                for row in results.cars
            ],
        ),
        f"Exponent {exponent(results.cars, lambda row: row.cost):.2f} of a passage, "
        f"{exponent(results.cars, lambda row: row.cost / row.steps):.2f} of a step: the guideway "
        "costs the same under any train.",
        "",
        *table(
            ["samples", "rows", "s", "s a passage", "s a row"],
            [
                [
                    f"{row.size}",
                    f"{-(-row.size // LANES)}",
                    f"{row.cost:.2f}",
                    f"{row.cost / row.size:.3f}",
                    f"{row.cost / -(-row.size // LANES):.3f}",
                ]
                for row in results.samples
            ],
        ),
        (
            f"Exponent {exponent(many, lambda row: row.cost):.2f} from {many[0].size} samples on; "
            if len(many) > 1
            else ""
        )
        + "a row that is not full costs as much as one that is.",
        "",
        "## Two threads",
        "",
        *table(
            ["threads", "wall [s]", "process [s]"],
            [[f"{n}", f"{t.wall:.2f}", f"{t.process:.2f}"] for n, t in results.threads.items()],
        ),
        f"{sizes.thread_samples} samples; {speed_up:.2f} times as fast.",
        "",
        "## Start of a fresh process",
        "",
        *table(
            ["part", "process [s]", "wall [s]"],
            [[name, f"{t.process:.2f}", f"{t.wall:.2f}"] for name, t in results.startup],
        ),
        "Caches warm, kernel compiled by an earlier process.  The first passage contains the "
        "loading of the kernel.",
        f"Writing the extremes of {n_most} samples takes {results.writing.process:.2f} s.",
        "",
    ]
    return "\n".join(lines)


def per_span(rows: list[Row]) -> str:
    """What a further span costs under the whole train, and what it costs when it has none.

    A passage over n spans takes a + b n + c n²: every span adds its steps under the train, and to
    all steps what it costs without one.
    """
    if len(rows) < 3:
        return ""
    size = np.array([row.size for row in rows], dtype=float)
    cost = np.array([row.cost for row in rows])
    c, b, _ = np.polyfit(size, cost, 2, w=1 / cost)
    steps = (rows[-1].steps - rows[0].steps) / (size[-1] - size[0])
    return (
        f"Fitted by a + b n + c n², a step with the whole train on the guideway takes "
        f"{b / steps * 1e6:.2f} µs a sample, and every span without a train adds "
        f"{c / steps * 1e6:.3f} µs, {c / b:.1%} of that."
    )


def draw(results: Results, out: Path) -> None:
    """Cost against spans, cars and samples, each with its fitted power, as PNG and PDF."""
    full = [row for row in results.samples if row.size % LANES == 0 or row.size >= 10 * LANES]
    series = (
        ("spans", results.spans, results.spans, "s a passage"),
        ("cars", results.cars, results.cars, "s a passage"),
        ("samples", results.samples, full, "s a batch"),
    )
    with style.page():
        figure, axes = style.panels(3, 1, style.COLUMN, 6.3)
        for axis, letter, (what, rows, fitted, unit) in zip(axes, "abc", series, strict=True):
            size = np.array([row.size for row in rows], dtype=float)
            axis.loglog(
                size, [row.cost for row in rows], "o", ms=4, color=style.MODEL, label="measured"
            )
            if len(fitted) > 1:
                slope = exponent(fitted, lambda row: row.cost)
                over = np.array([fitted[0].size, fitted[-1].size], dtype=float)
                middle = np.exp(np.mean(np.log([row.size for row in fitted])))
                level = np.exp(np.mean(np.log([row.cost for row in fitted])))
                axis.loglog(
                    over,
                    level * (over / middle) ** slope,
                    "--",
                    color=style.REFERENCE,
                    label=f"∝ {what}$^{{{slope:.2f}}}$",
                )
                style.titled(axis, letter, f"exponent {slope:.2f} in {what}")
            axis.set(xlabel=f"{what} [-]", ylabel=f"process time [{unit}]")
            plain = FuncFormatter(lambda value, _: f"{value:g}")
            marked = [s for before, s in zip([0.0, *size], size, strict=False) if s > 1.2 * before]
            axis.set_xticks(marked, [f"{s:g}" for s in marked])
            axis.minorticks_off()
            axis.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if what != "samples" else (1,)))
            axis.yaxis.set_major_formatter(plain)
            axis.margins(0.08, 0.15)
            axis.legend(loc="upper left")
        style.save(figure, out)


def main() -> None:
    """Measure, print the page, and write it with its figure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small sizes, one minute")
    parser.add_argument("--out", type=Path, help="folder of page and figure (docs/benchmarks)")
    options = parser.parse_args()
    sizes = QUICK if options.quick else Sizes()
    folder = options.out or (SCRATCH if options.quick else DOCS)
    with threadpool_limits(1):  # linear algebra on one core; children are told likewise
        results = measure(sizes)
    text = page(results, sizes)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "passage.md").write_text(text, encoding="utf-8")
    draw(results, folder / "passage")
    print(text)


if __name__ == "__main__":
    main()
