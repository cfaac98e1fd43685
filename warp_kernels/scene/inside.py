"""Which points are inside, on a Warp device: parities of crossings, and the sign of distances."""

# mypy: disable-error-code="untyped-decorator, valid-type"

from typing import Any

import warp as wp


@wp.kernel(enable_backward=False)
def odd(counts: wp.array[wp.int32], odd: wp.array[wp.bool]) -> None:
    """Whether each count is odd, of dimension (n,)."""
    i = wp.tid()
    odd[i] = (counts[i] & 1) == 1


@wp.kernel(enable_backward=False)
def negate(inside: wp.array[wp.bool], distance: wp.array[Any]) -> None:
    """Give distances inside a minus sign, of dimension (n,)."""
    i = wp.tid()
    if inside[i]:
        distance[i] = -distance[i]


for number in (wp.float32, wp.float64):
    wp.overload(negate, {"distance": wp.array[number]})
