"""Ambient occlusion in your own Warp kernel: how much sky does the ground around a tower see?

    python examples/ambient_occlusion.py --device cpu

Prints a map of the ground from above: the darker the character, the less sky is visible. The tower is blank.
"""

import argparse

import numpy as np
import warp as wp

import wive
from wive.warp_kernels import Bvh, any_hit, check

SAMPLES = 256
SIDE = 24
SHADES = "@#*+=-. "


@wp.kernel
def sky_seen(bvh: Bvh, places: wp.array(dtype=wp.vec3), sky: wp.array(dtype=float)):
    """The fraction of cosine-distributed rays into the upper hemisphere that hit nothing, per place."""
    i = wp.tid()
    state = wp.rand_init(1, i)
    free = int(0)
    for _ in range(SAMPLES):
        direction = wp.sample_unit_sphere_surface(state) + wp.vec3(0.0, 0.0, 1.0)
        if not any_hit(bvh, places[i], direction, 0.0, wp.inf):
            free += 1
    sky[i] = float(free) / float(SAMPLES)


def tower() -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a tower of 2 x 2 x 6 on a ground of 12 x 12."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, 6)] + [
        (-6, -6, 0),
        (6, -6, 0),
        (6, 6, 0),
        (-6, 6, 0),
    ]
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (8, 9, 10, 11)]
    faces = [f for a, b, c, d in sides for f in ((a, b, c), (a, c, d))]
    return np.array(corners, np.float32), np.array(faces, np.int32)


def main() -> None:
    """Find the places by rays from above, trace the sky from there, and print the map."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--device", default="cpu", help="a Warp device: cpu, cuda:0, ...")
    device = parser.parse_args().device

    scene = wive.Scene(*tower(), device=device)
    steps = np.linspace(-5.75, 5.75, SIDE)
    above = np.stack([*np.meshgrid(steps, steps), np.full((SIDE, SIDE), 10.0)], axis=-1).reshape(-1, 3)
    hits = scene.intersect(wp.array(above, dtype=wp.vec3, device=device), (0, 0, -1))
    places = hits.spawn((0, 0, 1))  # origins for rays upwards that can't hit the triangle they leave
    sky = wp.zeros(len(places), dtype=float, device=device)
    wp.launch(sky_seen, len(places), inputs=[scene.tree.handle, places, sky], device=device)
    check(scene.tree)
    shade = np.interp(sky.numpy(), (0.5, 1), (0, len(SHADES) - 1)).astype(int).reshape(SIDE, SIDE)
    on_ground = places.numpy()[:, 2].reshape(SIDE, SIDE) < 1
    for row, ground in zip(shade, on_ground, strict=True):
        print("".join(SHADES[s] * 2 if g else "  " for s, g in zip(row, ground, strict=True)))


if __name__ == "__main__":
    main()
