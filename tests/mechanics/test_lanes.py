"""Rows of samples: their arithmetic against NumPy, and kernels as plain Python."""

import json
import os
import subprocess
import sys
import types
from fractions import Fraction
from pathlib import Path

import numba
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maglev.mechanics import _kernels, _rows, integrate, packing
from maglev.mechanics.course import course
from maglev.mechanics.lanes import LANES, choose, entry, fma, load, maximum, minimum, store
from maglev.parameters import Config
from maglev.simulation import track

RNG = np.random.default_rng(7)
A, B, C = RNG.normal(size=(3, 4, LANES))
S = 0.3


@numba.njit(error_model="numpy")
def all_operations(a, b, c, s, out):
    for row in range(a.shape[0]):
        x, y, z = load(a, row), load(b, row), load(c, row)
        store(out[0], row, x + y)
        store(out[1], row, x - y)
        store(out[2], row, x * y)
        store(out[3], row, x / y)
        store(out[4], row, x + s)
        store(out[5], row, s + x)
        store(out[6], row, x - s)
        store(out[7], row, s - x)
        store(out[8], row, x * s)
        store(out[9], row, s * x)
        store(out[10], row, x / s)
        store(out[11], row, s / x)
        store(out[12], row, x * 3)
        store(out[13], row, 3 - x)
        store(out[14], row, fma(x, y, z))
        store(out[15], row, fma(x, s, z))
        store(out[16], row, minimum(x, y))
        store(out[17], row, maximum(x, y))
        store(out[18], row, minimum(x, s))
        store(out[19], row, maximum(s, x))
        store(out[20], row, choose(x, y, z, s))
        store(out[21], row, choose(x, s, y, z))


@numba.njit
def copied(source, target, shift):
    for row in range(source.shape[0]):
        store(target, row + shift, load(source, row))


def operated(a, b, c, s):
    out = np.full((22, *a.shape), np.nan)
    all_operations(a, b, c, s, out)
    return out


def rounded_once(a, b, c):
    """``a b + c`` of doubles, exactly, then to the nearest double."""
    return float(Fraction(a) * Fraction(b) + Fraction(c))


def test_arithmetic_of_rows_is_that_of_numpy_bit_for_bit():
    expected = [
        A + B, A - B, A * B, A / B, A + S, S + A, A - S, S - A, A * S, S * A, A / S, S / A,
        A * 3, 3 - A,
    ]  # fmt: skip
    assert_array_equal(operated(A, B, C, S)[:14], expected)


def test_fused_multiply_and_add_rounds_once():
    out = operated(A, B, C, S)
    if numba.config.DISABLE_JIT:
        assert_allclose(out[14:16], [A * B + C, A * S + C], rtol=1e-12)
    else:
        of_arrays = np.vectorize(rounded_once)
        assert_array_equal(out[14:16], [of_arrays(A, B, C), of_arrays(A, S, C)])
        assert np.any(out[14] != A * B + C)


def test_minimum_maximum_and_choose_are_those_of_numpy():
    out = operated(A, B, C, S)
    expected = [np.minimum(A, B), np.maximum(A, B), np.minimum(A, S), np.maximum(A, S)]
    assert_array_equal(out[16:20], expected)
    assert_array_equal(out[20:], [np.where(A > B, C, S), np.where(A > S, B, C)])


def test_a_number_that_is_none_on_the_left_gives_way_and_on_the_right_stays():
    """A gap that is not a number drops out of ``minimum(smallest, gap)`` by the next sound one."""
    a, b = A.copy(), B.copy()
    a[0, 1] = b[0, 2] = np.nan
    out = operated(a, b, C, S)
    for both in out[16:18]:
        assert both[0, 1] == b[0, 1]
        assert np.isnan(both[0, 2])
    assert out[18, 0, 1] == S
    assert np.isnan(out[19, 0, 1])
    assert_array_equal(out[20, 0, 1:3], S)
    untouched = np.isfinite(a) & np.isfinite(b)
    assert_array_equal(out[:, untouched], operated(A, B, C, S)[:, untouched])


def test_rows_are_read_and_written_where_they_lie():
    target = np.zeros((3, 6, LANES))
    copied(A, target[1], 2)
    assert_array_equal(target[1, 2:], A)
    target[1, 2:] = 0.0
    assert not target.any()


def test_an_entry_is_that_of_the_array_as_it_lies():
    table = RNG.normal(size=(3, 5))

    @numba.njit
    def read(array, indices, out):
        for k in range(indices.size):
            out[k] = entry(array, indices[k])

    indices, out = np.array([0, 4, 7, 14]), np.zeros(4)
    read(table, indices, out)
    assert_array_equal(out, table.ravel()[indices])
    if not numba.config.DISABLE_JIT:
        with pytest.raises(numba.core.errors.TypingError, match="entry needs an array in C order"):
            read(np.asfortranarray(table), indices, out)


@pytest.mark.parametrize("n_rows", [1, 7, 64])
def test_rows_of_the_kernels_begin_where_a_cache_line_does(n_rows):
    rows = _rows.zeros(n_rows)
    assert rows.shape == (n_rows, LANES)
    assert not rows.any()
    assert rows.ctypes.data % 64 == 0


def with_rows_at_once(function, wide):
    """A kernel compiled for a processor with many registers or with few."""
    plain = function.py_func
    given = plain.__globals__ | {"WIDE": wide}
    copy = types.FunctionType(plain.__code__, given, plain.__name__, plain.__defaults__)
    return numba.njit(error_model="numpy")(copy)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="about compiled kernels")
def test_how_many_rows_are_taken_at_once_changes_no_bit():
    n, width = 7, 18
    matrix, other = RNG.normal(size=(2, n, width))
    packed = RNG.normal(size=(2 * n, LANES))
    columns = RNG.permutation(2 * n)[:n]
    results = []
    for wide in (False, True):
        out = np.zeros((4, width, LANES))
        with_rows_at_once(_rows.transform, wide)(matrix, 0, n, packed, 2, 0, width, out[0], 0)
        with_rows_at_once(_rows.transform_both, wide)(
            matrix, 0, n, other, 1, n, packed, 2, width, out[1], out[2], 0
        )
        target = np.ones((2 * n, LANES))
        with_rows_at_once(_rows.project, wide)(matrix, columns, 0, n, 3, width, out[0], 0, target)
        results.append((out, target))
    assert_array_equal(results[0][0], results[1][0])
    assert_array_equal(results[0][1], results[1][1])
    (out, target), motion = results[0], matrix.T @ packed[2 : 2 + n]
    assert_allclose(out[0], motion, rtol=0, atol=1e-12)
    mean, turn = matrix.T @ packed[:n], other[1:].T @ packed[n : 2 * n - 1]
    assert_allclose(out[1, 2:], (mean + turn)[2:], rtol=0, atol=1e-12)
    assert_allclose(out[2, 2:], (mean - turn)[2:], rtol=0, atol=1e-12)
    expected = np.ones((2 * n, LANES))
    expected[columns] += matrix[:, 3:] @ motion[3:]
    assert_allclose(target, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("frequency", [20.0, 100.0])
def test_a_peak_between_two_steps_is_kept_with_its_time(frequency):
    dt = 0.54e-3
    crest = 40.3 * dt + np.arange(LANES) * dt / LANES  # one for every share of a step
    config = Config()
    system = integrate.prepare(config, track(config))
    kinds = (system.suspension, system.guidance)
    outcome = packing.empty_outcome(system.train, kinds, packing.timing(config, 0))

    def motion(step):
        ahead = step * dt - crest
        return -np.cos(2 * np.pi * frequency * ahead) * np.exp(-((ahead / 0.02) ** 2))

    watch, largest = _kernels._new_watch(1, 1, 1), np.zeros(LANES)
    watch.recent[:] = motion(-1), motion(0)
    for step in range(1, 81):
        largest = np.maximum(largest, np.abs(motion(step)))
        row = _rows.zeros(1)
        row[0] = motion(step)
        keep_peak(outcome, watch, row, step * dt, dt)
    error = np.abs(outcome.extreme[0] - 1.0)
    assert error.max() < 0.03 * (1 - largest).max() + 2e-6
    period = 1 / frequency
    late = (outcome.extreme_time[0] - crest + period / 4) % (period / 2) - period / 4
    assert np.abs(late).max() < 0.02 * dt


@numba.njit
def keep_peak(outcome, watch, row, time, dt):
    _kernels._keep_peak(outcome, watch, 0, load(row, 0), time, dt)


SHORT = {
    "train": {
        "n_cars": 1,
        "car_pitch": "6.192 m",
        "bogie": {"c_frame_spacing": "0.774 m"},
        "suspension_magnet": {"n_poles": 2, "pole_pitch": "0.387 m"},
        "guidance_magnet": {"n_poles": 2, "pole_pitch": "0.387 m", "preload": "10 kN"},
    },
    "guideway": {"n_spans": 1, "span_length": "6.192 m", "rail": {"units_per_span": 2}},
    "irregularity": {"fade_in": "1 m", "vertical": {"law": "power", "coefficient": 2.3e-10}},
    "passage": {"approach": "1 m", "speed": "1500 m/s"},
}
"""A very short and fast passage: steps by the tens."""


def short_passage():
    """Extremes and histories of two samples."""
    config = Config.model_validate(SHORT)
    assert course(config).n_steps < 80
    gains = np.array(config.gains.as_row) * [[1.0, 1.0, 1.0, 1.0], [1.1, 0.9, 1.2, 0.8]]
    passages = integrate.integrate(integrate.prepare(config, track(config)), gains, record_every=1)
    assert not passages.status.any()
    names = ("girder", "body_z", "body_y", "gap_min", "gap_max", "current_max",
             "girder_history", "gap_history", "current_history")  # fmt: skip
    return {name: getattr(passages, name).tolist() for name in names}


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="compares with the compiled kernels")
def test_kernels_as_plain_python_give_the_compiled_numbers():
    plain = subprocess.run(
        [
            sys.executable,
            "-c",
            "import json, test_lanes as t; print(json.dumps(t.short_passage()))",
        ],
        cwd=Path(__file__).parent,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    compiled = short_passage()
    for name, value in json.loads(plain).items():
        value, expected = np.array(value), np.array(compiled[name])
        scale = np.abs(expected).max(axis=(0, -1), keepdims=True)
        assert_allclose(value / scale, expected / scale, rtol=0, atol=1e-9, err_msg=name)
