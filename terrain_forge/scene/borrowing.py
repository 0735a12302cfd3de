"""Arrays that kernels borrow."""

from __future__ import annotations

from typing import Any

from numba import types
from numba.extending import intrinsic


def _borrow(_typing, members):  # type: ignore[no-untyped-def]
    """The tuple or named tuple with all its arrays borrowed."""

    def build(context, builder, _signature, arguments):  # type: ignore[no-untyped-def]
        loan = arguments[0]
        for index, member in enumerate(members):
            if isinstance(member, types.Array):
                value = builder.extract_value(loan, index)
                view = context.make_array(member)(context, builder, value)
                view.meminfo = view.meminfo.type(None)
                loan = builder.insert_value(loan, view._getvalue(), index)
        return loan

    return members(members), build


borrow: Any = intrinsic(_borrow)
"""A tuple's arrays handed to kernels without their owner.

Numba counts references to an array at every call that takes it, atomically; in a renderer of many
small functions that costs more than the shading. A borrowed array is not counted: the caller
keeps it.
"""
