"""Rows of 22 numbers, whole rows at a time: what the corrections and the prediction of a covariance
are made of.

A compiler that meets such loops unrolls 22 steps and gathers columns, which costs more than the
arithmetic. Here the vector instructions are said outright: two of eight numbers, one of four, one
of two, whatever the processor makes of them. Each function stands here twice: in plain words, and
for the compiler. Sums run in the order of the rows.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

Array = NDArray[np.float64]

WIDTH = 22
BLOCKS = ((0, 8), (8, 8), (16, 4), (20, 2))  # first number, how many


def combine(
    out: Array, at: int, source: Array, rows: tuple[int, ...], factors: tuple[float, ...]
) -> None:
    """out[at:] becomes sum of factors[k] source[rows[k]:], 22 numbers of each. Flat arrays; out may
    be the source.
    """
    out[at : at + WIDTH] = sum(
        f * source[r : r + WIDTH] for r, f in zip(rows, factors, strict=True)
    )


def add(
    out: Array, at: int, source: Array, rows: tuple[int, ...], factors: tuple[float, ...]
) -> None:
    """out[at:] grows by that sum."""
    out[at : at + WIDTH] += sum(
        f * source[r : r + WIDTH] for r, f in zip(rows, factors, strict=True)
    )


def take_out(P: Array, G: Array, rows: tuple[int, ...]) -> None:
    """P (22 x 22, flat) becomes P - sum of g g^T over the rows g of G (flat) that begin at
    `rows`.
    """
    for r in rows:
        g = G[r : r + WIDTH]
        P.reshape(WIDTH, WIDTH)[:] -= np.outer(g, g)


def scale(P: Array, factors: Array, at: int) -> None:
    """P (22 x 22, flat) becomes diag(f) P diag(f) with f = factors[at:], 22 numbers."""
    f = factors[at : at + WIDTH]
    P.reshape(WIDTH, WIDTH)[:] *= np.outer(f, f)


class _Rows:
    """Loads and stores of blocks of one flat array while code is made."""

    def __init__(self, context: Any, builder: Any, kind: Any, value: Any) -> None:
        self._builder = builder
        self._data = context.make_array(kind)(context, builder, value).data

    def _place(self, index: Any, kind: Any) -> Any:
        return self._builder.bitcast(self._builder.gep(self._data, [index]), kind.as_pointer())

    def number(self, index: Any) -> Any:
        return self._builder.load(self._builder.gep(self._data, [index]))

    def load(self, first: Any, block: tuple[int, int]) -> Any:
        kind = ir.VectorType(ir.DoubleType(), block[1])
        index = self._builder.add(first, ir.Constant(first.type, block[0]))
        return self._builder.load(self._place(index, kind), align=8)

    def store(self, first: Any, block: tuple[int, int], value: Any) -> None:
        index = self._builder.add(first, ir.Constant(first.type, block[0]))
        self._builder.store(value, self._place(index, value.type), align=8)


def _spread(builder: Any, number: Any, size: int) -> Any:
    """A vector of one number."""
    kind = ir.VectorType(number.type, size)
    lane = builder.insert_element(
        ir.Constant(kind, ir.Undefined), number, ir.Constant(ir.IntType(32), 0)
    )
    return builder.shuffle_vector(
        lane,
        ir.Constant(kind, ir.Undefined),
        ir.Constant(ir.VectorType(ir.IntType(32), size), [0] * size),
    )


def _sum(builder: Any, factor: Any, row: Any, so_far: Any) -> Any:
    """factor row + so_far, in one instruction where there is one."""
    if so_far is None:
        return builder.fmul(factor, row)
    kind = ir.FunctionType(row.type, [row.type] * 3)
    function = cgutils.get_or_insert_function(
        builder.module, kind, f"llvm.fmuladd.v{row.type.count}f64"
    )
    return builder.call(function, [factor, row, so_far])


def _combining(grows: bool) -> Any:
    @intrinsic
    def made(typing: Any, out: Any, at: Any, source: Any, rows: Any, factors: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            kinds = signature.args
            target = _Rows(context, builder, kinds[0], arguments[0])
            given = _Rows(context, builder, kinds[2], arguments[2])
            firsts = [
                context.cast(builder, v, t, types.intp)
                for v, t in zip(cgutils.unpack_tuple(builder, arguments[3]), kinds[3], strict=True)
            ]
            numbers = [
                context.cast(builder, v, t, types.float64)
                for v, t in zip(cgutils.unpack_tuple(builder, arguments[4]), kinds[4], strict=True)
            ]
            place = context.cast(builder, arguments[1], kinds[1], types.intp)
            for block in BLOCKS:
                value = target.load(place, block) if grows else None
                for first, number in zip(firsts, numbers, strict=True):
                    value = _sum(
                        builder, _spread(builder, number, block[1]), given.load(first, block), value
                    )
                target.store(place, block, value)
            return context.get_dummy_value()

        return types.none(out, at, source, rows, factors), code

    return made


@intrinsic
def _taking_out(typing: Any, P: Any, G: Any, rows: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds = signature.args
        target = _Rows(context, builder, kinds[0], arguments[0])
        given = _Rows(context, builder, kinds[1], arguments[1])
        firsts = [
            context.cast(builder, v, t, types.intp)
            for v, t in zip(cgutils.unpack_tuple(builder, arguments[2]), kinds[2], strict=True)
        ]
        with cgutils.for_range(builder, ir.Constant(firsts[0].type, WIDTH)) as loop:
            place = builder.mul(loop.index, ir.Constant(loop.index.type, WIDTH))
            numbers = [
                builder.fneg(given.number(builder.add(first, loop.index))) for first in firsts
            ]
            for block in BLOCKS:
                value = target.load(place, block)
                for first, number in zip(firsts, numbers, strict=True):
                    value = _sum(
                        builder, _spread(builder, number, block[1]), given.load(first, block), value
                    )
                target.store(place, block, value)
        return context.get_dummy_value()

    return types.none(P, G, rows), code


@intrinsic
def _scaling(typing: Any, P: Any, factors: Any, at: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds = signature.args
        target = _Rows(context, builder, kinds[0], arguments[0])
        given = _Rows(context, builder, kinds[1], arguments[1])
        first = context.cast(builder, arguments[2], kinds[2], types.intp)
        with cgutils.for_range(builder, ir.Constant(first.type, WIDTH)) as loop:
            place = builder.mul(loop.index, ir.Constant(loop.index.type, WIDTH))
            number = given.number(builder.add(first, loop.index))
            for block in BLOCKS:
                both = builder.fmul(_spread(builder, number, block[1]), given.load(first, block))
                target.store(place, block, builder.fmul(target.load(place, block), both))
        return context.get_dummy_value()

    return types.none(P, factors, at), code


_combined, _added = _combining(False), _combining(True)


@overload(combine, inline="always")
def _combine(out, at, source, rows, factors):  # type: ignore[no-untyped-def]
    return lambda out, at, source, rows, factors: _combined(out, at, source, rows, factors)


@overload(add, inline="always")
def _add(out, at, source, rows, factors):  # type: ignore[no-untyped-def]
    return lambda out, at, source, rows, factors: _added(out, at, source, rows, factors)


@overload(take_out, inline="always")
def _take_out(P, G, rows):  # type: ignore[no-untyped-def]
    return lambda P, G, rows: _taking_out(P, G, rows)


@overload(scale, inline="always")
def _scale(P, factors, at):  # type: ignore[no-untyped-def]
    return lambda P, factors, at: _scaling(P, factors, at)
