"""Ambient occlusion in your own Warp kernel: how much sky does the ground around a tower see?

    python examples/ambient_occlusion.py --device cpu

Draws ambient_occlusion.png, the ground from above, the darker the less sky is visible.
"""

import argparse

import numpy as np
import warp as wp
from matplotlib.figure import Figure
from meshes import boxes
from pictures import INK, bar, bare, page, save

import wive
from wive.warp_kernels import Bvh, any_hit, check

SAMPLES = 256
SIDE = 160
TOWER = boxes(((-1, -1, 0), (1, 1, 6)), ((-6, -6, -0.1), (6, 6, 0)))  # on its ground


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


def ground_sky(scene: wive.Scene, side: int = SIDE) -> tuple[np.ndarray, np.ndarray]:
    """(side,side) the sky seen from above the ground, north up, and whether the place is on the ground."""
    device = scene.device
    steps = (np.arange(side) + 0.5) / side * 12 - 6
    above = np.stack([*np.meshgrid(steps, -steps), np.full((side, side), 10.0)], axis=-1).reshape(-1, 3)
    hits = scene.intersect(wp.array(above, dtype=wp.vec3, device=device), (0, 0, -1))
    places = hits.spawn((0, 0, 1))  # origins for rays upwards that can't hit the triangle they leave
    sky = wp.zeros(len(places), dtype=float, device=device)
    wp.launch(sky_seen, len(places), inputs=[scene.tree.handle, places, sky], device=device)
    check(scene.tree)
    return sky.numpy().reshape(side, side), places.numpy()[:, 2].reshape(side, side) < 1


def draw(sky: np.ndarray) -> Figure:
    """The ground from above and a scale."""
    figure = page()
    axes = bare(figure, (0.05, 0.02, 0.8, 0.96))
    axes.imshow(sky, cmap="gray", vmin=0.4, vmax=1, extent=(-6, 6, -6, 6))
    axes.text(0, 0, "tower", ha="center", va="center", size=12, color=INK)
    bar(figure, "sky", 0.4, 1, "gray")
    return figure


def main() -> None:
    """Find the places by rays from above, trace the sky from there, and draw it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--device", default="cpu", help="a Warp device: cpu, cuda:0, ...")
    sky, ground = ground_sky(wive.Scene(*TOWER, device=parser.parse_args().device))
    print(f"the ground sees {sky[ground].min():.0%} to {sky[ground].max():.0%} of the sky")
    save(draw(sky), __file__)


if __name__ == "__main__":
    main()
