"""How far t can be from the exact distance: docs/accuracy.md, "The error of t".

The arithmetic is in cpu/core/error_bound.inc, which the core and the Warp kernels compile.
"""

import numpy as np
from numpy.typing import NDArray

from wive import _cpu
from wive._internal.precision import Floats

UNIT_ROUNDOFF = 2.0**-53  # of double
# A term of the residual is rounded at most nine times; three more are for the bound's own rounding.
ROUNDINGS = 12
# What products of doubles lose below the smallest normal one, all together; those of float32 lose nothing.
UNDERFLOW = 2.0**-1070


def constants(precision: str) -> tuple[float, float, float]:
    """Members of ErrorBound (cpu/core/error_bound.inc) for scenes of that precision."""
    underflow = UNDERFLOW if precision == "float64" else 0.0
    return ROUNDINGS * UNIT_ROUNDOFF, 1 + 8 * UNIT_ROUNDOFF, underflow


def t_error_bounds(
    vertices: Floats,
    faces: NDArray[np.int32],
    prim: NDArray[np.int32],
    t: Floats,
    origins: Floats,
    directions: Floats,
) -> NDArray[np.float64]:
    """(n,) bounds on the distance of t (n,) from where rays meet the planes of triangles prim (n,).

    NaN if prim is negative. Vertices and rays are float32, or all float64.
    """
    return _cpu.error_bounds(
        vertices,
        faces,
        np.ascontiguousarray(prim),
        np.ascontiguousarray(t),
        np.ascontiguousarray(origins),
        np.ascontiguousarray(directions),
        constants(vertices.dtype.name),
    )
