"""Rooms, closed and open, whose walls face inwards, with things in them."""

import numpy as np

SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]  # outwards


def box(low, high, *, inwards: bool = False, without: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a box; `without` is the number of a side that is left open.

    Sides are x low, x high, y low, y high, z low, z high.
    """
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
    faces = [
        (triangle if not inwards else triangle[::-1])
        for number, (a, b, c, d) in enumerate(SIDES)
        if number != without
        for triangle in ((a, b, c), (a, c, d))
    ]
    low, high = np.array(low, np.float64), np.array(high, np.float64)
    return (low + corners * (high - low)).astype(np.float32), np.array(faces, np.int32)


def joined(*meshes: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """One mesh of several."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [faces + start for (_, faces), start in zip(meshes, starts, strict=False)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(faces).astype(np.int32)


def room(up: int = 1, size=(6.0, 2.6, 4.0), without: int | None = None) -> tuple[np.ndarray, np.ndarray]:
    """A room of that size, (across, high, deep), with a table and a cupboard; `up` is 1 for y or 2 for z."""
    across, high, deep = size
    things = [
        box((0, 0, 0), (across, high, deep), inwards=True, without=without),
        box((0.35 * across, 0.7, 0.4 * deep), (0.6 * across, 0.75, 0.65 * deep)),
        box((0, 0, 0), (0.6, 0.8 * high, 1.2)),
    ]
    vertices, faces = joined(*things)
    if up == 2:
        vertices = vertices[:, [0, 2, 1]]
        faces = faces[:, ::-1].copy()
    return vertices, faces
