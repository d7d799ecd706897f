"""Compiled: sums and products whose factors are rows of samples."""

from __future__ import annotations

import numpy as np

from maglev.compiled import kernel
from maglev.mechanics.lanes import LANES, WIDE, entry, fma, load, own, own_of, store

CACHE_LINE = 8
"""Doubles in a line of the processor's cache [-]."""


@kernel()
def zeros(n_rows):
    """Rows of zeros ``(n_rows, LANES)`` that begin where a line of the processor's cache does.

    Elsewhere each register of a row is read from two lines, at twice the cost.
    """
    whole = np.zeros(n_rows * LANES + CACHE_LINE)
    start = -(whole.ctypes.data // 8) % CACHE_LINE
    return whole[start : start + n_rows * LANES].reshape((n_rows, LANES))


@kernel()
def weighted_sum(coefficients, columns, start, stop, source, total):
    """``total + Σ_k coefficients[k] source[columns[k]]`` for ``start`` ≤ k < ``stop``."""
    for k in range(start, stop):
        total = fma(load(source, entry(columns, k)), entry(coefficients, k), total)
    return total


@kernel()
def add_terms(terms, sign, source, target):
    """``target[place] += sign Σ rows[number] source[column]`` for each sum of the terms."""
    for n in range(terms.place.size):
        total = load(source, 0) * 0.0
        for k in range(entry(terms.start, n), entry(terms.start, n + 1)):
            coefficient = load(terms.rows, entry(terms.number, k))
            total = fma(load(source, entry(terms.column, k)), coefficient, total)
        at = entry(terms.place, n)
        store(target, at, fma(total, sign, load(target, at)))


@kernel()
def gather(source, columns, start, stop, packed, first):
    """``packed[first + m] = source[columns[start + m]]``, so that products read adjacent rows."""
    for m in range(start, stop):
        store(packed, first + m - start, load(source, entry(columns, m)))


@kernel()
def transform(matrix, start, stop, packed, at, left, right, target, first):
    """``target[first + k] = Σ_m matrix[start + m, k] packed[at + m]`` for ``left`` ≤ k < ``right``.

    As many rows are computed at once as there are registers; the order of each sum is the same.
    """
    none = load(packed, at) * 0.0
    width = matrix.shape[1]
    k = left
    while WIDE and k + 4 <= right:
        a, b, c, d = none, none, none, none
        index = start * width + k
        for m in range(at, at + stop - start):
            one = load(packed, m)
            a = fma(one, entry(matrix, index), a)
            b = fma(one, entry(matrix, index + 1), b)
            c = fma(one, entry(matrix, index + 2), c)
            d = fma(one, entry(matrix, index + 3), d)
            index += width
        store(target, first + k, a)
        store(target, first + k + 1, b)
        store(target, first + k + 2, c)
        store(target, first + k + 3, d)
        k += 4
    while k < right:
        a, b = none, none
        index = start * width + k
        for m in range(at, at + stop - start):
            one = load(packed, m)
            a = fma(one, entry(matrix, index), a)
            b = fma(one, entry(matrix, index + 1), b)
            index += width
        store(target, first + k, a)
        store(target, first + k + 1, b)
        k += 2


@kernel()
def transform_both(
    mean, up, up_end, turn, out, out_end, packed, left, right, right_rail, left_rail, first
):
    """Motion of both rails from that of their mean and the roll, each computed as by `transform`.

    ``packed`` holds the coordinates of the mean, then those of the roll.
    """
    n = up_end - up
    none = load(packed, 0) * 0.0
    width = mean.shape[1]
    k = left
    while WIDE and k + 4 <= right:
        a, b, c, d = none, none, none, none
        e, f, g, h = none, none, none, none
        index = up * width + k
        for m in range(n):
            one = load(packed, m)
            a = fma(one, entry(mean, index), a)
            b = fma(one, entry(mean, index + 1), b)
            c = fma(one, entry(mean, index + 2), c)
            d = fma(one, entry(mean, index + 3), d)
            index += width
        index = out * width + k
        for m in range(n, n + out_end - out):
            one = load(packed, m)
            e = fma(one, entry(turn, index), e)
            f = fma(one, entry(turn, index + 1), f)
            g = fma(one, entry(turn, index + 2), g)
            h = fma(one, entry(turn, index + 3), h)
            index += width
        store(right_rail, first + k, a + e)
        store(left_rail, first + k, a - e)
        store(right_rail, first + k + 1, b + f)
        store(left_rail, first + k + 1, b - f)
        store(right_rail, first + k + 2, c + g)
        store(left_rail, first + k + 2, c - g)
        store(right_rail, first + k + 3, d + h)
        store(left_rail, first + k + 3, d - h)
        k += 4
    while k < right:
        a, b, e, f = none, none, none, none
        index = up * width + k
        for m in range(n):
            one = load(packed, m)
            a = fma(one, entry(mean, index), a)
            b = fma(one, entry(mean, index + 1), b)
            index += width
        index = out * width + k
        for m in range(n, n + out_end - out):
            one = load(packed, m)
            e = fma(one, entry(turn, index), e)
            f = fma(one, entry(turn, index + 1), f)
            index += width
        store(right_rail, first + k, a + e)
        store(left_rail, first + k, a - e)
        store(right_rail, first + k + 1, b + f)
        store(left_rail, first + k + 1, b - f)
        k += 2


@kernel()
def change(matrix, begin, n_rows, n_columns, source, at, target, first):
    """``target[first + r] = Σ_k matrix[begin + r, k] source[at + k]``, own rows of factors."""
    none = load(source, at) * 0.0
    for r in range(n_rows):
        total, more = none, none
        place = begin + r * n_columns
        for k in range(0, n_columns - 1, 2):  # two sums: neither waits for the other
            total = fma(load(source, at + k), own(matrix, place + k), total)
            more = fma(load(source, at + k + 1), own(matrix, place + k + 1), more)
        if n_columns % 2 == 1:
            last = n_columns - 1
            total = fma(load(source, at + last), own(matrix, place + last), total)
        store(target, first + r, total + more)


@kernel()
def change_back(matrix, begin, n_rows, n_columns, source, at, columns, start, target):
    """``target[columns[start + k]] += Σ_r matrix[begin + r, k] source[at + r]``."""
    for k in range(n_columns):
        total = load(target, entry(columns, start + k))
        more = total * 0.0
        for r in range(0, n_rows - 1, 2):
            place = begin + r * n_columns + k
            total = fma(load(source, at + r), own(matrix, place), total)
            more = fma(load(source, at + r + 1), own(matrix, place + n_columns), more)
        if n_rows % 2 == 1:
            last = n_rows - 1
            total = fma(load(source, at + last), own(matrix, begin + last * n_columns + k), total)
        store(target, entry(columns, start + k), total + more)


@kernel()
def own_sum(coefficients, numbers, columns, start, stop, source, total):
    """As `weighted_sum`, with coefficients that each sample may have of its own."""
    for k in range(start, stop):
        total = fma(load(source, entry(columns, k)), own_of(coefficients, numbers, k), total)
    return total


@kernel()
def project(matrix, columns, start, stop, left, right, source, first, target):
    """``target[columns[m]] += Σ_k matrix[m, k] source[first + k]`` for ``left`` ≤ k < ``right``."""
    width = matrix.shape[1]
    m = start
    while WIDE and m + 4 <= stop:
        a, b = load(target, entry(columns, m)), load(target, entry(columns, m + 1))
        c, d = load(target, entry(columns, m + 2)), load(target, entry(columns, m + 3))
        index = m * width
        for k in range(left, right):
            one = load(source, first + k)
            a = fma(one, entry(matrix, index + k), a)
            b = fma(one, entry(matrix, index + width + k), b)
            c = fma(one, entry(matrix, index + 2 * width + k), c)
            d = fma(one, entry(matrix, index + 3 * width + k), d)
        store(target, entry(columns, m), a)
        store(target, entry(columns, m + 1), b)
        store(target, entry(columns, m + 2), c)
        store(target, entry(columns, m + 3), d)
        m += 4
    while m + 2 <= stop:
        a, b = load(target, entry(columns, m)), load(target, entry(columns, m + 1))
        index = m * width
        for k in range(left, right):
            one = load(source, first + k)
            a = fma(one, entry(matrix, index + k), a)
            b = fma(one, entry(matrix, index + width + k), b)
        store(target, entry(columns, m), a)
        store(target, entry(columns, m + 1), b)
        m += 2
    if m < stop:
        a = load(target, entry(columns, m))
        for k in range(left, right):
            a = fma(load(source, first + k), entry(matrix, m * width + k), a)
        store(target, entry(columns, m), a)
