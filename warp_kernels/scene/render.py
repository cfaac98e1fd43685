"""Path tracing on a Warp device: the picture of render.cpp, bit for bit, whole wavefronts at a time.

Random numbers come from (pixel, sample, bounce) alone and a pixel's light is added up in a fixed order, so
neither the device nor the order in which paths survive matters.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp

from wive._internal.picture import Image, Look
from wive.warp_kernels import launch_any, launch_closest
from wive.warp_kernels.scene import shading as warp_shading
from wive.warp_kernels.scene.tracer import WarpTracer, choose_lanes
from wive.warp_kernels.tree.quiet import launch
from wive.warp_kernels.tree.tree import check_memory

# The tile and the wave of cpu/render/render.cpp: they say in which order a pixel's light is added up.
TILE_WIDTH = 32
WAVE_SIZE = 4096
# As shading.py numbers them.
ALBEDOS = "gray", "normals", "faces", "vertices"
# Paths traced together: enough to fill a GPU, in some hundred megabytes of its memory.
MOST_PATHS = 1 << 20


class PictureRenderer:
    """Renders one picture band by band; bands share the arrays of their paths."""

    def __init__(self, tracer: WarpTracer, camera: Image, image: Image, look: Look) -> None:
        """Take the camera's vectors (4,3) of `Camera.frame`; image (height,width,3) is written in place."""
        self._image = image
        self._samples = look.spp
        self._tracer = tracer
        self._paths = _Paths(tracer, look)
        self._frame = frame = warp_shading.Frame()
        frame.eye, frame.centre, frame.right, frame.up = _vectors(camera)
        frame.height, frame.width = image.shape[:2]
        frame.seed = look.seed
        frame.albedo = ALBEDOS.index(look.albedo)
        frame.sky_up, frame.horizon, frame.zenith, frame.to_sun, frame.sun = _vectors(look.light)
        frame.has_sun = bool((look.light[4] > 0).any())

    def render_rows(self, begin: int, end: int) -> int:
        """Path-trace rows [begin, end) of the image; returns the rays traced."""
        frame, samples = self._frame, self._samples
        width = self._image.shape[1]
        sums = wp.zeros((end - begin) * width, dtype=wp.vec3, device=self._tracer.device)
        frame.band_row = begin
        rays = 0
        for columns, chunk in _strips(width):
            frame.first_column, frame.columns = columns.start, len(columns)
            rows = max(1, MOST_PATHS // (len(columns) * min(chunk, samples)))
            for first_row in range(begin, end, rows):
                frame.first_row = first_row
                pixels = len(columns) * (min(first_row + rows, end) - first_row)
                for first_sample in range(0, samples, chunk):
                    frame.first_sample = first_sample
                    frame.samples = min(chunk, samples - first_sample)
                    rays += self._paths.trace(frame, pixels, sums)
        mean = sums.numpy().reshape(-1, width, 3) * (np.float32(1) / np.float32(samples))
        self._image[begin:end] = mean
        check_memory(self._tracer.tree)
        return rays


def _vectors(rows: Image) -> list[Any]:
    return [wp.vec3(*map(float, row)) for row in rows]


def _strips(width: int) -> Iterator[tuple[range, int]]:
    """Columns rendered together, and how many samples of a pixel are added up at a time, as on the CPU."""
    whole = width // TILE_WIDTH * TILE_WIDTH
    most = MOST_PATHS // WAVE_SIZE * TILE_WIDTH
    for begin in range(0, whole, most):
        yield range(begin, min(begin + most, whole)), WAVE_SIZE // TILE_WIDTH
    if whole < width:
        yield range(whole, width), WAVE_SIZE // (width - whole)


class _Paths:
    """The state of all paths of a pass; the next pass reuses its arrays."""

    def __init__(self, tracer: WarpTracer, look: Look) -> None:
        self.tracer = tracer
        self.bounces = look.bounces
        colours = np.zeros((1, 3), np.float32) if look.colours is None else look.colours
        self.colours = wp.array(colours, dtype=wp.vec3, device=tracer.device)
        self.tmin = wp.zeros(1, dtype=wp.float32, device=tracer.device)
        self.tmax = wp.full(1, float("inf"), dtype=wp.float32, device=tracer.device)
        self.counts = wp.zeros(2, dtype=wp.int32, device=tracer.device)
        self.has_sun = bool((look.light[4] > 0).any())
        self.capacity = -1

    def reserve(self, count: int) -> None:
        """Room for `count` paths."""
        if count <= self.capacity:
            return
        self.capacity = count

        def array(dtype: Any) -> Any:
            return wp.empty(count, dtype=dtype, device=self.tracer.device)

        self.throughput, self.light = array(wp.vec3), array(wp.vec3)
        self.t, self.prim, self.uv = array(wp.float32), array(wp.int32), array(wp.vec2)
        self.wave = array(wp.int32), array(wp.vec3), array(wp.vec3)
        self.next_wave = array(wp.int32), array(wp.vec3), array(wp.vec3)
        rays = count if self.has_sun else 1
        self.sun = tuple(
            wp.empty(rays, dtype=dtype, device=self.tracer.device)
            for dtype in (wp.int32, wp.vec3, wp.vec3, wp.vec3)
        )
        self.shadowed = wp.empty(rays, dtype=wp.bool, device=self.tracer.device)

    def trace(self, frame: warp_shading.Frame, pixels: int, sums: Any) -> int:
        """Add the light of all samples of a pass to `sums`; returns the rays traced."""
        device = self.tracer.device
        count = pixels * frame.samples
        self.reserve(count)
        path, origins, directions = self.wave
        outputs = [path, self.throughput, self.light, origins, directions]
        launch(warp_shading.start_paths, count, [frame], outputs, device=device)
        rays, bounce = 0, 0
        while count > 0:
            rays += count
            self._bounce(frame, bounce, count)
            self.wave, self.next_wave = self.next_wave, self.wave
            count, shadows = map(int, self.counts.numpy())
            rays += shadows
            self._add_sun(shadows)
            bounce += 1
        launch(warp_shading.accumulate, pixels, [frame, self.light], [sums], device=device)
        return rays

    def _bounce(self, frame: warp_shading.Frame, bounce: int, count: int) -> None:
        """Trace the wave's first `count` rays; those that bounce make the next wave."""
        device = self.tracer.device
        path, origins, directions = self.wave
        launch_closest(
            self.tracer.tree,
            origins[:count],
            directions[:count],
            self.tmin,
            self.tmax,
            self.t[:count],
            self.prim[:count],
            self.uv[:count],
            lanes=choose_lanes(None, count, device != "cpu"),
        )
        self.counts.zero_()
        inputs = [frame, bounce, self.bounces, *self.tracer.mesh, self.colours]
        hits = [self.prim, self.uv, path, directions]
        outputs = [self.throughput, self.light, self.counts, *self.next_wave, *self.sun]
        launch(warp_shading.shade, count, [*inputs, *hits], outputs, device=device)

    def _add_sun(self, count: int) -> None:
        """Trace the first `count` rays towards the sun, and add its light to paths whose ray is free."""
        if count == 0:
            return
        device = self.tracer.device
        path, origins, directions, light = self.sun
        launch_any(
            self.tracer.tree,
            origins[:count],
            directions[:count],
            self.tmin,
            self.tmax,
            self.shadowed[:count],
            lanes=choose_lanes(None, count, device != "cpu"),
        )
        launch(warp_shading.add_sun, count, [path, light, self.shadowed], [self.light], device=device)
