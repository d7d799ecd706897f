"""A row of samples in one processor vector: ``LANES`` doubles that the kernels treat as one number.

Samples lie innermost in every array of the production solver, ``(…, LANES)`` in C order.  `load`
takes one row into registers, arithmetic acts on all samples at once, `store` puts it back.  No
operation mixes lanes, so a sample's numbers cannot depend on its neighbours, bit for bit.
`entry` reads one number that all samples share, ``array.ravel()[index]``; Numba's own indexing
would first ask of every index whether it counts from the end.

`own` and `own_of` read what either all samples share or each has of its own, by the type of what
holds it: numbers ``(…,)`` are shared, rows ``(…, LANES)`` are not.  One source of a kernel so
becomes two pieces of machine code, and that of shared numbers is the same as if there were no rows.
`has_rows` is known when a kernel is compiled, and what it excludes is left out.
`met` is ``value`` where ``level`` is a number, and ``value level + more times`` where it is a row.

With ``NUMBA_DISABLE_JIT=1`` the same names act on NumPy rows, so that kernels run as plain Python.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import binding, ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.core.typing.templates import Signature
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

LANES = 16
"""Samples side by side [-]: two AVX-512 or four AVX2 registers of doubles."""

WIDE = bool(binding.get_host_cpu_features().get("avx512f", False))
"""Whether the processor has 32 vector registers, not 16: kernels then take more rows at once."""

_VECTOR = ir.VectorType(ir.DoubleType(), LANES)


class LaneType(types.Type):
    """Numba's type of one row of samples held in registers."""

    def __init__(self) -> None:
        super().__init__(name=f"Lane{LANES}")


LANE = LaneType()


@register_model(LaneType)
class _LaneModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _VECTOR)


def _splat(builder: Any, value: Any) -> Any:
    zero = ir.Constant(ir.IntType(32), 0)
    single = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, zero)
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(single, ir.Constant(_VECTOR, ir.Undefined), mask)


def _as_lane(context: Any, builder: Any, value: Any, kind: Any) -> Any:
    if isinstance(kind, LaneType):
        return value
    return _splat(builder, context.cast(builder, value, kind, types.float64))


def _define(op: Callable[..., Any], instruction: str) -> None:
    @type_callable(op)
    def _typing(context: Any) -> Any:
        def typer(a: Any, b: Any) -> Any:
            both = (a, b)
            if any(isinstance(k, LaneType) for k in both) and all(
                isinstance(k, LaneType | types.Float | types.Integer) for k in both
            ):
                return LANE
            return None

        return typer

    for left, right in ((LANE, LANE), (LANE, types.Number), (types.Number, LANE)):

        @lower_builtin(op, left if left is LANE else types.Number, right)
        def _lower(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
            a, b = (_as_lane(context, builder, v, k) for v, k in zip(args, sig.args, strict=True))
            return getattr(builder, instruction)(a, b)


for _op, _name in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _define(_op, _name)


def _row_pointer(context: Any, builder: Any, array_type: Any, array: Any, row: Any) -> Any:
    view = context.make_array(array_type)(context, builder, array)
    offset = builder.mul(row, ir.Constant(row.type, LANES))
    pointer = builder.gep(view.data, [offset])
    return builder.bitcast(pointer, _VECTOR.as_pointer())


@intrinsic
def _load(typing_context: Any, array: Any, row: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
        index = context.cast(builder, args[1], sig.args[1], types.intp)
        return builder.load(_row_pointer(context, builder, sig.args[0], args[0], index), align=8)

    return LANE(array, row), codegen


@intrinsic
def _store(typing_context: Any, array: Any, row: Any, value: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
        index = context.cast(builder, args[1], sig.args[1], types.intp)
        lane = _as_lane(context, builder, args[2], sig.args[2])
        builder.store(lane, _row_pointer(context, builder, sig.args[0], args[0], index), align=8)
        return context.get_dummy_value()

    return types.void(array, row, value), codegen


@intrinsic
def _entry(typing_context: Any, array: Any, index: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
        view = context.make_array(sig.args[0])(context, builder, args[0])
        index = context.cast(builder, args[1], sig.args[1], types.intp)
        return builder.load(builder.gep(view.data, [index]))

    if array.layout != "C":
        raise TypingError(f"entry needs an array in C order, got {array}")
    return array.dtype(array, index), codegen


def _is_rows(values: Any) -> bool:
    """Whether an array holds rows of samples; numbers and flat arrays are shared by all."""
    return isinstance(values, types.Array) and values.ndim == 2


def _read(values: Any) -> Any:
    """Result type of reading a number or a row, and how it is read at a place."""

    def codegen(context: Any, builder: Any, kind: Any, held: Any, place: Any) -> Any:
        if not isinstance(kind, types.Array):
            return held
        if _is_rows(kind):
            return builder.load(_row_pointer(context, builder, kind, held, place), align=8)
        view = context.make_array(kind)(context, builder, held)
        return builder.load(builder.gep(view.data, [place]))

    if not isinstance(values, types.Array):
        return values, codegen
    if values.layout != "C" or values.ndim > 2:
        raise TypingError(f"own needs numbers or rows in C order, got {values}")
    return (LANE if _is_rows(values) else values.dtype), codegen


@intrinsic
def _own(typing_context: Any, values: Any, place: Any) -> Any:
    result, read = _read(values)

    def codegen(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
        at = context.cast(builder, args[1], sig.args[1], types.intp)
        return read(context, builder, sig.args[0], args[0], at)

    return result(values, place), codegen


@intrinsic
def _own_of(typing_context: Any, values: Any, numbers: Any, place: Any) -> Any:
    result, read = _read(values)

    def codegen(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
        at = context.cast(builder, args[2], sig.args[2], types.intp)
        if _is_rows(sig.args[0]):
            view = context.make_array(sig.args[1])(context, builder, args[1])
            at = builder.load(builder.gep(view.data, [at]))
        return read(context, builder, sig.args[0], args[0], at)

    return result(values, numbers, place), codegen


@intrinsic
def _has_rows(typing_context: Any, values: Any) -> Any:
    rows = _is_rows(values)

    def codegen(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
        return context.get_constant(types.boolean, rows)

    return types.boolean(values), codegen


@intrinsic
def _met(typing_context: Any, value: Any, level: Any, more: Any, times: Any) -> Any:
    own_level = _is_rows(level)

    def codegen(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
        if not own_level:
            return args[0]
        first = ir.Constant(ir.IntType(64), 0)
        factors = [
            builder.load(_row_pointer(context, builder, sig.args[k], args[k], first), align=8)
            for k in (1, 3)
        ]
        lanes = [_as_lane(context, builder, args[k], sig.args[k]) for k in (0, 2)]
        added = builder.fmul(lanes[1], factors[1])
        return builder.fadd(builder.fmul(lanes[0], factors[0]), added)

    return (LANE if own_level else value)(value, level, more, times), codegen


@intrinsic
def _fma(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
        lanes = [_as_lane(context, builder, v, k) for v, k in zip(args, sig.args, strict=True)]
        name = f"llvm.fma.v{LANES}f64"
        function = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(_VECTOR, [_VECTOR] * 3), name
        )
        return builder.call(function, lanes)

    return LANE(a, b, c), codegen


def _selecting(comparison: str) -> Any:
    @intrinsic
    def pick(typing_context: Any, a: Any, b: Any) -> Any:
        def codegen(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
            x, y = (_as_lane(context, builder, v, k) for v, k in zip(args, sig.args, strict=True))
            return builder.select(builder.fcmp_ordered(comparison, x, y), x, y)

        return LANE(a, b), codegen

    return pick


@intrinsic
def _choose(typing_context: Any, a: Any, b: Any, x: Any, y: Any) -> Any:
    def codegen(context: Any, builder: Any, sig: Signature, args: Any) -> Any:
        p, q, u, v = (
            _as_lane(context, builder, value, kind)
            for value, kind in zip(args, sig.args, strict=True)
        )
        return builder.select(builder.fcmp_ordered(">", p, q), u, v)

    return LANE(a, b, x, y), codegen


_minimum = _selecting("<")
_maximum = _selecting(">")


def _load_python(array: np.ndarray, row: int) -> np.ndarray:
    return array.reshape(-1, LANES)[row].copy()


def _store_python(array: np.ndarray, row: int, value: Any) -> None:
    array.reshape(-1, LANES)[row] = value


def _entry_python(array: np.ndarray, index: int) -> Any:
    return array.reshape(-1)[index]


def _own_python(values: Any, place: int) -> Any:
    if not isinstance(values, np.ndarray):
        return values
    return _load_python(values, place) if values.ndim == 2 else values[place]


def _own_of_python(values: Any, numbers: np.ndarray, place: int) -> Any:
    rows = isinstance(values, np.ndarray) and values.ndim == 2
    return _own_python(values, int(numbers[place]) if rows else place)


def _has_rows_python(values: Any) -> bool:
    return isinstance(values, np.ndarray) and values.ndim == 2


def _met_python(value: Any, level: Any, more: Any, times: Any) -> Any:
    if not isinstance(level, np.ndarray):
        return value
    return value * level.reshape(LANES) + more * times.reshape(LANES)


def _fma_python(a: Any, b: Any, c: Any) -> Any:
    return a * b + c


def _minimum_python(a: Any, b: Any) -> Any:
    return np.where(np.less(a, b), a, b)


def _maximum_python(a: Any, b: Any) -> Any:
    return np.where(np.greater(a, b), a, b)


def _choose_python(a: Any, b: Any, x: Any, y: Any) -> Any:
    return np.where(np.greater(a, b), x, y)


if numba.config.DISABLE_JIT:
    load, store, fma, choose = _load_python, _store_python, _fma_python, _choose_python
    minimum, maximum, entry = _minimum_python, _maximum_python, _entry_python
    own, own_of, met, has_rows = _own_python, _own_of_python, _met_python, _has_rows_python
else:
    load, store, fma, choose = _load, _store, _fma, _choose
    minimum, maximum, entry = _minimum, _maximum, _entry
    own, own_of, met, has_rows = _own, _own_of, _met, _has_rows
