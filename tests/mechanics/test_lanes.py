"""Rows of samples: their arithmetic against NumPy, and kernels as plain Python."""

import json
import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numba
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maglev.mechanics import integrate, irregularity
from maglev.mechanics.course import n_steps, track_range
from maglev.mechanics.lanes import LANES, choose, fma, load, maximum, minimum, store
from maglev.parameters import Config

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
    "passage": {"approach": "1 m", "speed": "1500 m/s", "acceleration_band": None},
}
"""A very short and fast passage: steps by the tens."""


def short_passage():
    """Extremes and histories of two samples."""
    config = Config.model_validate(SHORT)
    assert n_steps(config) < 80
    profile = irregularity.profile(config.irregularity, track_range(config), config.seed)
    gains = np.array(config.gains.as_row) * [[1.0, 1.0, 1.0, 1.0], [1.1, 0.9, 1.2, 0.8]]
    passages = integrate.integrate(integrate.prepare(config, profile), gains, record_every=1)
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
