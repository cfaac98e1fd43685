"""Numbers of meshes, and of triangles within them, on a Warp device."""

# mypy: disable-error-code="untyped-decorator, valid-type"

import warp as wp


@wp.func
def geom_of(first_faces: wp.array[wp.int32], prim: wp.int32) -> wp.int32:
    """The last mesh whose first triangle is no later than `prim`; -1 for -1."""
    low = wp.int32(0)
    high = first_faces.shape[0] - 1
    while low < high:
        middle = low + (high - low) / 2
        if first_faces[middle] <= prim:
            low = middle + 1
        else:
            high = middle
    return low - 1


@wp.kernel(enable_backward=False)
def number_geoms(first_faces: wp.array[wp.int32], prim: wp.array[wp.int32], geom: wp.array[wp.int32]) -> None:
    """The mesh of each triangle `prim`, of dimension (n,)."""
    i = wp.tid()
    geom[i] = geom_of(first_faces, prim[i])


@wp.kernel(enable_backward=False)
def number_within_geoms(
    first_faces: wp.array[wp.int32], prim: wp.array[wp.int32], within: wp.array[wp.int32]
) -> None:
    """The number of each triangle `prim` within its mesh, of dimension (n,)."""
    i = wp.tid()
    geom = geom_of(first_faces, prim[i])
    if geom < 0:
        within[i] = -1
    else:
        within[i] = prim[i] - first_faces[geom]
