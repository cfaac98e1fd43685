"""Where a camera shows most of a scene: outside of it, or in the room that it is."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal.pictures.sampling import cosine_directions, pcg4d, to_unit
from wive._internal.pictures.shades import dots
from wive.camera import Camera, framing_points, ground_axes, unit_vector
from wive.hits import Hits, surface_normals, surface_points
from wive.scene import Scene

Float64 = NDArray[np.float64]

# Of larger scenes some triangles at even steps, at least so many.
MOST_TRIANGLES = 1 << 19
# Places on surfaces by which views are compared, and eyes that are tried.
SURFACE_SAMPLES = 1024
COARSE_SAMPLES = 256
EYES = 768
FINALISTS = 24
YAWS = 24
# Vertical degrees, and how far views indoors are tilted down.
OUTDOOR_FOV, INDOOR_FOV = 40.0, 65.0
TILT = math.radians(6)
# Steps about the best eye, as parts of the scene.
REFINED = (0.25, 0.1)
# What a view loses at four times the square of its share of the height off the middle.
LOW_VIEW = 1.2
# A view from inside must show so much more than the one from outside.
ADVANTAGE = 3.0
# If all but this share of triangles, at each end of each axis, is in a part of the scene that is smaller than
# this, the part is framed, with some room about it.
FRINGE, SMALL_PART, FRINGE_ROOM = 0.01, 0.5, 0.08
# Triangles whose corners are framed.
MOST_OUTLINE = 20_000
# A surface nearer than this fraction of the room's size is in the way.
NEAR = 0.12
# An eye is inside if less than this share of all directions misses.
OPEN_SHARE = 0.25
SPHERE_DIRECTIONS, ENCLOSING_DIRECTIONS = 256, 48
# Of paths that hit something: if more than this share stay in the scene, it is dark.
SUNLESS = 0.98
# Horizontal surfaces have this cosine, and must be so much more along z than along y for a room to have z up.
LEVEL = 0.95
MORE_LEVEL = 1.3


class Places(NamedTuple):
    """Points on the surface with their normals, and origins just off their front sides.

    Even rows are picked by area, odd ones by triangle: walls and floors have the area, what stands in a room
    has the triangles.
    """

    points: Float64
    normals: Float64
    origins: Float64
    level: Float64  # (3,) the share of all area whose normal is near each axis

    def first(self, count: int) -> Places:
        """The first ones."""
        return Places(self.points[:count], self.normals[:count], self.origins[:count], self.level)


def default_camera(
    scene: Scene, up: ArrayLike | None = None, fov: float | None = None, aspect: float = 16 / 9
) -> Camera:
    """The camera that frames the scene, or one in it if far more of its front sides is seen from there."""
    framed = Camera.framing(scene.bounds, up, OUTDOOR_FOV if fov is None else fov, aspect)
    places = surface_places(scene)
    if places is None:
        return framed
    outside = framing_points(_outline(scene, places), framed.up, framed.fov, aspect)
    inside, seen = _indoor_camera(scene, places, up, INDOOR_FOV if fov is None else fov, aspect)
    if inside is not None and seen > ADVANTAGE * _share_seen(scene, places, outside, aspect):
        return inside
    return outside


def _outline(scene: Scene, places: Places) -> Float64:
    """Points of the scene that a picture from outside must hold.

    Those of the whole scene, unless nearly all triangles are in a small part of it, as on a large ground.
    """
    low, high = scene.bounds.astype(np.float64)
    corners = scene.vertices[scene.faces[:: len(scene) // MOST_OUTLINE + 1]].reshape(-1, 3)
    triangles = places.points[1::2]
    middle, fringe = np.quantile(triangles, (FRINGE, 1 - FRINGE), axis=0), 0.0
    extent = middle[1] - middle[0]
    if np.linalg.norm(extent) < SMALL_PART * np.linalg.norm(high - low):
        fringe = FRINGE_ROOM * float(np.max(extent))
        low, high = np.maximum(low, middle[0] - fringe), np.minimum(high, middle[1] + fringe)
        return np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(np.concatenate([corners, triangles]), np.float64)


def surface_places(scene: Scene) -> Places | None:
    """Places on triangles picked at random, half of them in proportion to area; None if none has any."""
    random = np.random.default_rng(0)
    step = max(1, len(scene) // MOST_TRIANGLES)
    faces = scene.faces[::step]
    a, b, c = (scene.vertices[faces[:, k]].astype(np.float64) for k in range(3))
    with np.errstate(over="ignore", invalid="ignore"):
        crossed = crosses(b - a, c - a)
        area = np.sqrt(dots(crossed, crossed))
    (real,) = np.nonzero(np.isfinite(area) & (area > 0))
    if len(real) == 0:
        return None
    area, crossed = area[real] / area[real].max(), crossed[real] / area[real].max()
    level = ((abs(crossed) > LEVEL * area[:, None]) * area[:, None]).sum(axis=0) / area.sum()
    half = SURFACE_SAMPLES // 2
    rows = np.empty(2 * half, np.intp)
    until = np.cumsum(area)
    rows[::2] = real[np.searchsorted(until[:-1], random.random(half) * until[-1])]
    rows[1::2] = real[random.integers(0, len(real), half)]
    prim = (step * rows).astype(np.int32)
    uv = random.random((len(prim), 2))
    uv = np.where(uv.sum(axis=1, keepdims=True) > 1, 1 - uv, uv).astype(scene.vertices.dtype)
    normals = surface_normals(scene.vertices, scene.faces, prim)
    origins = scene.spawn(prim, uv, normals)
    points = surface_points(scene.vertices, scene.faces, prim, uv)
    return Places(points, normals, origins.astype(np.float64), level)


def crosses(a: Float64, b: Float64) -> Float64:
    """(n,3) products of rows, in a third of the time of np.cross."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def stands_inside(scene: Scene, eye: Float64) -> tuple[bool, float]:
    """Whether hardly any direction from the eye leaves the scene, and the mean distance to what is hit."""
    hits = scene.intersect(eye, on_sphere(SPHERE_DIRECTIONS))
    distances = np.asarray(hits.t, np.float64)[hits.mask]
    missed = 1 - len(distances) / SPHERE_DIRECTIONS
    return missed < OPEN_SHARE, float(distances.mean()) if len(distances) else np.inf


def on_sphere(count: int) -> Float64:
    """(count,3) unit vectors spread evenly: the spiral of golden angles."""
    step = np.arange(count) + 0.5
    z = 1 - 2 * step / count
    turn = step * (math.pi * (3 - math.sqrt(5)))
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


def _indoor_camera(
    scene: Scene, places: Places, up: ArrayLike | None, fov: float, aspect: float
) -> tuple[Camera | None, float]:
    """The best camera among eyes within the scene, and the share of the places that it sees."""
    upward = _indoor_up(places) if up is None else unit_vector("up", up)
    turns = Turns(upward, fov, aspect)
    heights = places.points @ upward
    size, (floor, ceiling) = _size(places), np.quantile(heights, (0.02, 0.98))
    eyes = _eyes(places)
    eyes = eyes[_enclosed(scene, eyes)]
    if len(eyes) == 0:
        return None, 0.0
    coarse = places.first(COARSE_SAMPLES)
    best = np.argsort(-share_of(seen_from(scene, eyes, coarse)), kind="stable")[:FINALISTS]
    found, most = None, 0.0
    eyes, steps = eyes[best], _nearby(eyes, upward)
    for reach in (*REFINED, 0.0):
        off_middle = (eyes @ upward - (floor + ceiling) / 2) / max(ceiling - floor, 1e-300)
        weights = 1 - LOW_VIEW * off_middle**2
        for eye, visible, weight in zip(eyes, seen_from(scene, eyes, places), weights, strict=True):
            if share_of(visible) * weight <= most:
                continue
            shares = share_of(visible & turns.in_view(places.points - eye)) * weight
            turn = int(np.argmax(shares))
            if shares[turn] > most:
                camera = Camera(eye, eye + size * turns.forward[turn], upward, fov)
                share = float(shares[turn]) * _clearance(scene, camera, aspect)
                if share > most:
                    found, most = camera, share
        if found is None:
            break
        eyes = np.asarray(found.eye) + reach * steps
    return found, most


def _enclosed(scene: Scene, eyes: Float64) -> NDArray[np.bool_]:
    """Which eyes hardly see the sky, as `stands_inside` judges it with fewer directions."""
    directions = on_sphere(ENCLOSING_DIRECTIONS)
    shape = (len(eyes), len(directions), 3)
    real = scene.vertices.dtype
    origins = np.broadcast_to(eyes[:, None], shape).astype(real)
    return np.asarray(
        (~scene.occluded(origins, np.broadcast_to(directions, shape).astype(real))).mean(axis=1) < OPEN_SHARE
    )


class Turns:
    """Views all round, tilted down a little."""

    def __init__(self, upward: Float64, fov: float, aspect: float) -> None:
        """Take what is up, a unit vector, and the picture's vertical degrees and aspect."""
        right, front = ground_axes(upward)
        yaws = np.arange(YAWS)[:, None] * (2 * math.pi / YAWS)
        level = np.cos(yaws) * right - np.sin(yaws) * front
        self.forward = math.cos(TILT) * level - math.sin(TILT) * upward
        self._top = math.sin(TILT) * level + math.cos(TILT) * upward
        self._right = np.cross(self.forward, self._top)
        self._tangents = math.tan(math.radians(fov) / 2) * aspect, math.tan(math.radians(fov) / 2)

    def in_view(self, views: Float64) -> NDArray[np.bool_]:
        """(yaws, n), whether each view holds each vector (n,3) from the eye."""
        depth = self.forward @ views.T
        x, y = self._right @ views.T, self._top @ views.T
        across, upward = self._tangents
        return np.asarray((depth > 0) & (abs(x) <= across * depth) & (abs(y) <= upward * depth))


def share_of(seen: NDArray[np.bool_]) -> Float64:
    """(...,) the share of the places seen (...,p): the geometric mean of those by area and by triangle."""
    areas, triangles = seen[..., ::2].mean(axis=-1), seen[..., 1::2].mean(axis=-1)
    return np.asarray(np.sqrt(areas * triangles))


def _nearby(eyes: Float64, upward: Float64) -> Float64:
    """Steps to other eyes about the one that is best so far, fewer up and down than sideways."""
    spread = eyes[:FINALISTS] - eyes.mean(axis=0)
    return np.asarray(spread - 0.5 * (spread @ upward)[:, None] * upward)


def _indoor_up(places: Places) -> Float64:
    """y, or z if clearly more of the surfaces lies level then."""
    axis = np.zeros(3)
    axis[2 if places.level[2] > MORE_LEVEL * places.level[1] else 1] = 1
    return axis


def _size(places: Places) -> float:
    low, high = np.quantile(places.points, (0.05, 0.95), axis=0)
    return float(np.linalg.norm(high - low)) or 1.0


def _eyes(places: Places) -> Float64:
    """Points spread evenly where the places are: Roberts 2018, the R sequence in three dimensions."""
    low, high = np.quantile(places.points, (0.02, 0.98), axis=0)
    root = 1.2207440846057596
    steps = np.arange(1, EYES + 1)[:, None] / root ** np.arange(1, 4)
    return np.asarray(low + (0.05 + 0.9 * ((0.5 + steps) % 1)) * (high - low))


def seen_from(scene: Scene, eyes: Float64, places: Places) -> NDArray[np.bool_]:
    """(e,p), whether the front side of each place is seen from each eye."""
    views = eyes[:, None] - places.points
    in_front: NDArray[np.bool_] = (views * places.normals).sum(axis=2) > 0
    eye, place = np.nonzero(in_front)
    real = scene.vertices.dtype
    origins = places.origins[place].astype(real)
    ways = (eyes[eye] - places.origins[place]).astype(real)
    in_front[eye, place] = ~scene.occluded(origins, ways, tmax=1.0)
    return in_front


def in_view(camera: Camera, points: Float64, aspect: float) -> NDArray[np.bool_]:
    """(n,), whether a picture of this aspect holds each point."""
    eye, forward, right, top = camera.frame(round(1024 * aspect) or 1, 1024).astype(np.float64)
    views = points - eye
    depth = dots(views, np.broadcast_to(forward, views.shape))
    x = dots(views, np.broadcast_to(right, views.shape)) / dots(right[None], right[None])
    y = dots(views, np.broadcast_to(top, views.shape)) / dots(top[None], top[None])
    return np.asarray((depth > 0) & (abs(x) <= depth) & (abs(y) <= depth))


def _share_seen(scene: Scene, places: Places, camera: Camera, aspect: float) -> float:
    eye = np.asarray(camera.eye, np.float64)[None]
    seen = seen_from(scene, eye, places)[0] & in_view(camera, places.points, aspect)
    return float(share_of(seen))


def _clearance(scene: Scene, camera: Camera, aspect: float) -> float:
    """1 for a view with nothing close by and no back sides, less if these fill part of it."""
    hits: Hits = scene.intersect(*camera.rays(16, max(1, round(16 / aspect))))
    size = float(np.linalg.norm(np.subtract(camera.target, camera.eye)))
    near = (hits.t < NEAR * size).mean()
    wrong = (hits.mask & ~hits.front).mean()
    return float((1 - near) * (1 - 0.5 * wrong) * (1 - 0.5 * (1 - hits.mask.mean())))


def reaches_sky(scene: Scene, frame: Float64, bounces: int) -> bool:
    """Whether some paths from the camera leave the scene after a hit; true if the camera sees no surface."""
    side = 24
    x = (2 * np.arange(side) + 1) / side - 1
    directions = frame[1] + x[:, None, None] * frame[3] + x[:, None] * frame[2]
    origins: Float64 = np.broadcast_to(frame[0], (side * side, 3))
    directions, started = directions.reshape(-1, 3), 0
    pixels = np.arange(side * side, dtype=np.uint32)
    for bounce in range(bounces + 1):
        hits = scene.intersect(origins, directions)
        (hit,) = np.nonzero(hits.mask)
        if bounce == 0:
            started = len(hit)
        if len(hit) < SUNLESS * started or started == 0:
            return True
        normals = hits.normals()[hit]
        facing = np.where((dots(normals, directions[hit]) > 0)[:, None], -normals, normals)
        words = pcg4d(pixels[hit], 0, bounce + 1, 0)
        outward = cosine_directions(facing, *(to_unit(word, np.dtype(np.float64)) for word in words[:2]))
        origins = scene.spawn(hits.prim[hit], hits.uv[hit], facing).astype(np.float64)
        directions, pixels = outward, pixels[hit]
    return False
