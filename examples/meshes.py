"""Meshes of the programs in this folder: a vase, a street, a car, and real land."""

from pathlib import Path

import numpy as np

import wive

METRES_PER_DEGREE = 111_320.0


def vase(rings: int = 120, sections: int = 120) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a closed vase with walls of uneven thickness, 3 high."""
    z = np.linspace(0, 3, rings)
    outer = 1 + 0.35 * np.sin(2.3 * z + 0.5)
    inner = outer - 0.08 - 0.1 * np.cos(1.5 * z) ** 2
    wall = z > 0.15
    outline = [*zip(outer, z, strict=True), *zip(inner[wall][::-1], z[wall][::-1], strict=True)]
    return revolved(np.array(outline), bottom=0.0, top=0.16, sections=sections)


def revolved(outline: np.ndarray, bottom: float, top: float, sections: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces round the z axis of an outline (n,2) of radii and heights, closed on the axis."""
    turn = np.arange(sections) * 2 * np.pi / sections
    radius, height = outline[:, :1], outline[:, 1:]
    rings = np.stack([radius * np.cos(turn), radius * np.sin(turn), height + 0 * turn], axis=-1)
    vertices = np.concatenate([rings.reshape(-1, 3), [[0, 0, bottom], [0, 0, top]]])
    number = np.arange(rings.shape[0] * sections).reshape(-1, sections)
    a, d = number[:-1], number[1:]
    b, c = np.roll(a, -1, axis=1), np.roll(d, -1, axis=1)
    first, last, ends = number[0], number[-1], len(vertices) - np.array([2, 1])
    faces = [np.stack(three, axis=-1).reshape(-1, 3) for three in ((a, b, c), (a, c, d))]
    faces.append(np.stack([np.roll(first, -1), first, np.full_like(first, ends[0])], axis=-1))
    faces.append(np.stack([last, np.roll(last, -1), np.full_like(last, ends[1])], axis=-1))
    return vertices.astype(np.float32), np.concatenate(faces)


def boxes(
    *corners: tuple[tuple[float, float, float], tuple[float, float, float]],
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of boxes, each given by its lowest and its highest corner."""
    corner = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (0, 2, 6, 4)]
    triangles = np.array([f for a, b, c, d in sides for f in ((a, b, c), (a, c, d))])
    vertices = np.concatenate([np.where(corner, high, low) for low, high in corners])
    return vertices.astype(np.float32), np.concatenate([triangles + 8 * i for i in range(len(corners))])


def street() -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of the ground, which is the first box, and two rows of houses."""
    houses = [((-60.0, -18.0, -0.1), (60.0, 18.0, 0.0))]
    for i, x in enumerate(range(-56, 56, 14)):
        houses += [((x, -16, 0), (x + 10, -7, 6 + i % 3)), ((x + 3, 7, 0), (x + 12, 16, 5 + i % 4))]
    return boxes(*houses)


def car() -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a car in its own coordinates."""
    return boxes(((-2, -0.9, 0.2), (2, 0.9, 0.9)), ((-1.2, -0.8, 0.9), (0.9, 0.8, 1.6)))


def land(step: int = 1) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Heights z (rows, columns), x and y in metres: the Jacksboro fault in Tennessee, from north to south.

    Matplotlib brings the elevations. Of rows and columns each `step`-th is taken.
    """
    from matplotlib import cbook

    with np.load(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False)) as sample:
        z = sample["elevation"][::step, ::step].astype(np.float64)
        x = np.arange(z.shape[1]) * step * float(sample["dx"]) * METRES_PER_DEGREE * np.cos(np.radians(36.6))
        y = np.arange(z.shape[0]) * -step * float(sample["dy"]) * METRES_PER_DEGREE
    return z, x, y


def scene_of(path: Path | None) -> wive.Scene:
    """The scene of a mesh file, or else of the vase."""
    return wive.Scene(*vase()) if path is None else wive.Scene.from_file(path)
