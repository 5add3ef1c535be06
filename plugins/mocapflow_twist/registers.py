"""Eight floats at a time: numba leaves short loops scalar, which makes adding up small blocks three times slower."""

from __future__ import annotations

from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic

LANES = 8


def _add_scaled(typing_context: Any, target: Any, start: Any, factor: Any, source: Any, first: Any) -> Any:
    """Do target[start : start + 8] += factor * source[first : first + 8] on flat arrays, without bounds checks.

    A product and a sum with their usual roundings: the result is that of the loop.
    """
    signature = types.void(target, types.intp, types.float64, source, types.intp)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector = ir.VectorType(ir.DoubleType(), LANES)

        def address(which: int, index: int) -> Any:
            data = context.make_array(signature.args[which])(context, builder, arguments[which]).data
            return builder.bitcast(builder.gep(data, [arguments[index]]), vector.as_pointer())

        undefined = ir.Constant(vector, ir.Undefined)
        lane = builder.insert_element(undefined, arguments[2], ir.Constant(ir.IntType(32), 0))
        same = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        product = builder.fmul(builder.shuffle_vector(lane, undefined, same), builder.load(address(3, 4), align=8))
        place = address(0, 1)
        builder.store(builder.fadd(builder.load(place, align=8), product), place, align=8)
        return context.get_dummy_value()

    return signature, generate


add_scaled: Any = intrinsic(_add_scaled)
