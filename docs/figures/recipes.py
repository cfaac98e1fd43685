"""Puts the pictures of the recipes into docs/images: runs the programs in examples/ that draw them.

python docs/figures/recipes.py [NAME ...]

examples/NAME.py gives recipe_NAME.png. The picture of gradients needs PyTorch; it is left out without.
"""

from __future__ import annotations

import os
import runpy
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES, IMAGES = ROOT / "examples", ROOT / "docs" / "images"
COLORS = 256  # of a picture, which is a third as large then

PICTURES = (
    "ambient_occlusion", "contains", "dask_heights", "depth_picture", "gradients", "inscribed_balls", "lidar",
    "line_of_sight", "moving", "occlusion_picture", "openness", "rays_of_files", "render", "signed_distance",
    "sky_view", "sun_hours", "thickness", "undercut", "viewshed", "wall_thickness", "xray",
)  # fmt: skip


def main() -> None:
    """Draw the pictures that are named, or all."""
    names = sys.argv[1:] or PICTURES
    sys.path.insert(0, str(EXAMPLES))
    for name in names:
        if name == "gradients" and find_spec("torch") is None:
            print("recipe_gradients.png: left out, there is no PyTorch")
            continue
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            sys.argv = [name]
            runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
            with Image.open(f"{name}.png") as picture:
                few = picture.convert("RGB").quantize(COLORS, kmeans=1)
            few.save(IMAGES / f"recipe_{name}.png", optimize=True)
            os.chdir(ROOT)


if __name__ == "__main__":
    main()
