"""A picture by the path tracer: light of the sky and the sun in a street, with colours per mesh.

    python examples/render.py

Draws render.png. `wive render mesh.ply` does this to a file.
"""

import numpy as np
from meshes import car, street

import wive

WALLS, ROAD, PAINT = (0.75, 0.68, 0.58), (0.32, 0.33, 0.35), (0.85, 0.2, 0.08)  # linear colours
SAMPLES = 32  # per pixel


def scene_and_colors() -> tuple[wive.Scene, np.ndarray]:
    """A street with a car, and (f,3) colours of its triangles."""
    vertices, faces = car()
    scene = wive.Scene.from_meshes([street(), (vertices + np.float32([-12, -1.5, 0]), faces)])
    colors = np.empty((len(scene), 3))
    road, cars = 12, scene.geoms.faces[1]  # the first box of the street is the ground
    colors[:road], colors[road:cars], colors[cars:] = ROAD, WALLS, PAINT
    return scene, colors


def main() -> None:
    """Render and write the picture."""
    scene, colors = scene_and_colors()
    camera = wive.Camera(eye=(-30, -3, 9), target=(0, 0, 1.5), up=(0, 0, 1), fov=40)
    picture = wive.render(
        scene,
        camera,
        shading="path",
        width=640,
        height=360,
        spp=SAMPLES,
        albedo=colors,
        sun=(-0.5, -0.6, 0.7),
    )
    wive.write_picture("render.png", picture)
    print("wrote render.png")


if __name__ == "__main__":
    main()
