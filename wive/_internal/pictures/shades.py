"""Pictures by the scene's own queries, on every backend: ambient occlusion, headlight, normals, depth.

Pixels are traced in bands of rows, sample by sample, so memory is bounded whatever the picture's size.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from wive._internal.picture import Image
from wive._internal.picture_rays import pixel_centres
from wive._internal.pictures.albedo import Albedo
from wive._internal.pictures.sampling import cosine_directions, pcg4d, to_unit
from wive._internal.precision import Floats
from wive._internal.progress import part
from wive.hits import Hits
from wive.scene import Scene

# Pixels per band: some hundred bytes each.
BAND_PIXELS = 1 << 16
# Directions of ambient occlusion from each point that a camera ray hits.
OCCLUSION_RAYS = 4

Float64 = NDArray[np.float64]


class Band:
    """Rows [begin, end) of a picture, and rays through random places of their pixels."""

    def __init__(self, frame: Float64, begin: int, end: int, width: int, height: int, scene: Scene) -> None:
        """Take the camera's frame, (4,3) as `Camera.frame` has it."""
        self.dtype = np.dtype(scene.precision)
        self.scene, self.pixels = scene, np.arange(begin * width, end * width, dtype=np.uint32)
        self._frame, self._size = frame.astype(self.dtype), (width, height)

    def hits(self, sample: int, seed: int, threads: int | None) -> tuple[Hits, Floats, NDArray[np.intp]]:
        """Hits of one ray per pixel that hits something, their directions, and their pixels in the band."""
        width, height = self._size
        words = pcg4d(self.pixels, sample, 0, seed)
        real = self.dtype.type
        column, row = (self.pixels % np.uint32(width)), (self.pixels // np.uint32(width))
        across = 2 * (column.astype(self.dtype) + to_unit(words[0], self.dtype)) / real(width) - 1
        upward = 1 - 2 * (row.astype(self.dtype) + to_unit(words[1], self.dtype)) / real(height)
        eye, centre, right, top = self._frame
        directions = np.empty((len(self.pixels), 3), self.dtype)
        for axis in range(3):
            directions[:, axis] = centre[axis] + right[axis] * across + top[axis] * upward
        hits = self.scene.intersect(eye, directions, threads=threads)
        (hit,) = np.nonzero(hits.mask)
        found = Hits(hits.t[hit], hits.prim[hit], hits.uv[hit], hits.vertices, hits.faces)
        return found, directions[hit], hit


class Shader:
    """One of the shadings; `value` says what a sample of a pixel that hits something adds to the picture."""

    background = 0.0
    # Camera rays per pixel for so many samples.
    rays_per_camera_ray = 1

    def __init__(self, scene: Scene, albedo: Albedo, seed: int, threads: int | None) -> None:
        """Keep what all shadings need."""
        self.scene, self.albedo, self.seed, self.threads = scene, albedo, seed, threads

    def value(
        self, hits: Hits, directions: Floats, pixels: NDArray[np.uint32], sample: int
    ) -> tuple[Floats, int]:
        """(n,3) or (n,1) radiance at the hits, and how many rays were traced for it."""
        raise NotImplementedError

    def render(self, image: Image, frame: Float64, spp: int, begin: int, end: int) -> int:
        """Write the mean of all samples to rows [begin, end); returns how many rays were traced."""
        height, width = image.shape[:2]
        samples = -(-spp // self.rays_per_camera_ray)
        rays = 0
        for first, last in bands(begin, end, width):
            band = Band(frame, first, last, width, height, self.scene)
            sums = np.zeros((len(band.pixels), 3), np.float64)
            for sample in range(samples):
                done, rows = first + (last - first) * sample / samples - begin, (last - first) / samples
                with part(done / (end - begin), (done + rows) / (end - begin)):
                    hits, directions, hit = band.hits(sample, self.seed, self.threads)
                    values, traced = self.value(hits, directions, band.pixels[hit], sample)
                if self.background:
                    sums += self.background
                sums[hit] += values - self.background
                rays += len(band.pixels) + traced
            image[first:last] = (sums / samples).reshape(last - first, width, 3)
        return rays


class NormalColours(Shader):
    """(normal + 1) / 2: red for x, green for y, blue for z."""

    def value(
        self, hits: Hits, directions: Floats, pixels: NDArray[np.uint32], sample: int
    ) -> tuple[Floats, int]:
        """The triangles' own normals, whichever side is seen."""
        return hits.normals() * 0.5 + 0.5, 0


class Headlight(Shader):
    """A lamp at the camera: the cosine between view and normal."""

    def value(
        self, hits: Hits, directions: Floats, pixels: NDArray[np.uint32], sample: int
    ) -> tuple[Floats, int]:
        """The same for both sides of a surface."""
        normals = hits.normals()
        lengths = np.sqrt(dots(directions.astype(np.float64), directions))
        cosines = np.minimum(abs(dots(normals, directions)) / lengths, 1.0)
        return cosines[:, None] * self.albedo.at(hits, normals), 0


class AmbientOcclusion(Shader):
    """The part of a hemisphere of cosine-distributed rays that nothing stops within a reach.

    If the reach is finite, what stops a ray at distance t lets t / reach pass: ambient obscurance, Zhukov,
    Iones and Kronin 1998.
    """

    background = 1.0
    rays_per_camera_ray = OCCLUSION_RAYS

    def __init__(
        self, scene: Scene, albedo: Albedo, seed: int, threads: int | None, reach: float, spp: int
    ) -> None:
        """`reach` in the scene's units, maybe infinite; fewer samples than rays per camera ray are kept."""
        super().__init__(scene, albedo, seed, threads)
        self.reach = reach
        self.rays_per_camera_ray = min(OCCLUSION_RAYS, spp)

    def value(
        self, hits: Hits, directions: Floats, pixels: NDArray[np.uint32], sample: int
    ) -> tuple[Floats, int]:
        """Rays of the side that is seen."""
        dtype = directions.dtype
        normals = hits.normals()
        facing = np.where((dots(normals, directions) > 0)[:, None], -normals, normals).astype(dtype)
        origins = self.scene.spawn(hits.prim, hits.uv, facing)
        free = np.zeros(len(hits), np.float64)
        for k in range(self.rays_per_camera_ray):
            words = pcg4d(pixels, sample, 1 + k, self.seed)
            outward = cosine_directions(facing, to_unit(words[0], dtype), to_unit(words[1], dtype))
            free += self.passed(origins, outward)
        light = free[:, None] / self.rays_per_camera_ray * self.albedo.at(hits, normals)
        return light, self.rays_per_camera_ray * len(hits)

    def passed(self, origins: Floats, directions: Floats) -> Floats:
        """(n,) from 0 to 1, what each ray lets pass."""
        if self.reach == np.inf:
            return np.asarray(~self.scene.occluded(origins, directions, threads=self.threads), np.float64)
        t = self.scene.intersect(origins, directions, tmax=self.reach, threads=self.threads).t
        return np.minimum(t.astype(np.float64) / self.reach, 1.0)


def bands(begin: int, end: int, width: int) -> Iterator[tuple[int, int]]:
    """Those of rows [begin, end) that are traced together."""
    rows = max(1, BAND_PIXELS // width)
    for first in range(begin, end, rows):
        yield first, min(first + rows, end)


def dots(a: NDArray[np.float64], b: Floats) -> NDArray[np.float64]:
    """(n,) products of rows, added in order."""
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def render_depth(
    image: Image, frame: Float64, scene: Scene, threads: int | None, begin: int, end: int
) -> int:
    """Write t of the rays through the pixels' centres, inf on a miss, to rows [begin, end) of image (h,w)."""
    height, width = map(int, image.shape)
    eye, centre, right, top = frame
    x, y = pixel_centres(width), -pixel_centres(height)
    for first, last in bands(begin, end, width):
        directions = (centre + y[first:last, None, None] * top) + x[:, None] * right
        rays = np.ascontiguousarray(directions.reshape(-1, 3), np.dtype(scene.precision))
        with part((first - begin) / (end - begin), (last - begin) / (end - begin)):
            t = scene.intersect(eye, rays, threads=threads).t
        image[first:last] = t.reshape(last - first, width)
    return (end - begin) * width
