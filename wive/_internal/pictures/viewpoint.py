"""Where a camera shows most of a scene: outside of it, or in the room that it is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive import _cpu
from wive._internal.pictures.places import Places, in_view, seen_from, share_of, surface_places
from wive._internal.pictures.surroundings import Sight, enclosed
from wive.camera import Camera, framing_points, ground_axes, unit_vector
from wive.hits import Hits
from wive.scene import Scene

Float64 = NDArray[np.float64]

# Eyes that are tried with the first places alone, those that are tried with all, and directions from each.
EYES, COARSE_SAMPLES, FINALISTS, YAWS = 768, 256, 24, 24
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
# A room has z up if so much more of its area lies across z than across y.
MORE_LEVEL = 1.3


def default_camera(
    scene: Scene,
    up: ArrayLike | None = None,
    fov: float | None = None,
    aspect: float = 16 / 9,
    threads: int | None = None,
) -> Camera:
    """The camera that frames the scene, or one in it if far more of its front sides is seen from there."""
    with _cpu.DefaultFloats():  # as for pictures
        return _best_camera(Sight(scene, threads), up, fov, aspect)


def _best_camera(sight: Sight, up: ArrayLike | None, fov: float | None, aspect: float) -> Camera:
    scene = sight.scene
    framed = Camera.framing(scene.bounds, up, OUTDOOR_FOV if fov is None else fov, aspect)
    places = surface_places(sight)
    if places is None:
        return framed
    outside = framing_points(_outline(scene, places), framed.up, framed.fov, aspect)
    inside, seen = _indoor_camera(sight, places, up, INDOOR_FOV if fov is None else fov, aspect)
    if inside is not None and seen > ADVANTAGE * _share_seen(sight, places, outside, aspect):
        return inside
    return outside


def _outline(scene: Scene, places: Places) -> Float64:
    """Points of the scene that a picture from outside must hold.

    Those of the whole scene, unless nearly all triangles are in a small part of it, as on a large ground.
    """
    low, high = scene.bounds.astype(np.float64)
    corners = scene.vertices[scene.faces[:: len(scene) // MOST_OUTLINE + 1]].reshape(-1, 3)
    within = ((corners >= low) & (corners <= high)).all(axis=1)  # others belong to no triangle with area
    corners = corners[within]
    triangles = places.points[1::2]
    middle = np.quantile(triangles, (FRINGE, 1 - FRINGE), axis=0)
    extent = middle[1] - middle[0]
    if np.linalg.norm(extent) < SMALL_PART * np.linalg.norm(high - low):
        fringe = FRINGE_ROOM * float(np.max(extent))
        low, high = np.maximum(low, middle[0] - fringe), np.minimum(high, middle[1] + fringe)
        return np.stack(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(np.concatenate([corners, triangles]), np.float64)


def _indoor_camera(
    sight: Sight, places: Places, up: ArrayLike | None, fov: float, aspect: float
) -> tuple[Camera | None, float]:
    """The best camera among eyes within the scene, and the share of the places that it sees."""
    upward = _indoor_up(places) if up is None else unit_vector("up", up)
    turns = Turns(upward, fov, aspect)
    heights = places.points @ upward
    size, (floor, ceiling) = _size(places), np.quantile(heights, (0.02, 0.98))
    eyes = _eyes(places)
    eyes = eyes[enclosed(sight, eyes)]
    if len(eyes) == 0:
        return None, 0.0
    coarse = places.first(COARSE_SAMPLES)
    best = np.argsort(-share_of(seen_from(sight, eyes, coarse)), kind="stable")[:FINALISTS]
    found, most = None, 0.0
    eyes, steps = eyes[best], _nearby(eyes, upward)
    for reach in (*REFINED, 0.0):
        off_middle = (eyes @ upward - (floor + ceiling) / 2) / max(ceiling - floor, 1e-300)
        weights = 1 - LOW_VIEW * off_middle**2
        for eye, visible, weight in zip(eyes, seen_from(sight, eyes, places), weights, strict=True):
            if share_of(visible) * weight <= most:
                continue
            shares = share_of(visible & turns.in_view(places.points - eye)) * weight
            turn = int(np.argmax(shares))
            if shares[turn] > most:
                camera = Camera(eye, eye + size * turns.forward[turn], upward, fov)
                share = float(shares[turn]) * _clearance(sight, camera, aspect)
                if share > most:
                    found, most = camera, share
        if found is None:
            break
        eyes = np.asarray(found.eye) + reach * steps
    return found, most


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


def _share_seen(sight: Sight, places: Places, camera: Camera, aspect: float) -> float:
    eye = np.asarray(camera.eye, np.float64)[None]
    seen = seen_from(sight, eye, places)[0] & in_view(camera, places.points, aspect)
    return float(share_of(seen))


def _clearance(sight: Sight, camera: Camera, aspect: float) -> float:
    """1 for a view with nothing close by and no back sides, less if these fill part of it."""
    hits: Hits = sight.intersect(*camera.rays(16, max(1, round(16 / aspect))))
    size = float(np.linalg.norm(np.subtract(camera.target, camera.eye)))
    near = (hits.t < NEAR * size).mean()
    wrong = (hits.mask & ~hits.front).mean()
    return float((1 - near) * (1 - 0.5 * wrong) * (1 - 0.5 * (1 - hits.mask.mean())))
