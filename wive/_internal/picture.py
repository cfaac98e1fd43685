"""The type of a picture, and the settings that `render` takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from wive._internal import arguments

Image = NDArray[np.float32]

ALBEDOS = ("gray", "normals")
LARGEST_SIDE = 65_536


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What a picture depends on besides scene and camera; the fields are the arguments of `render`."""

    width: int = 1280
    height: int = 720
    spp: int = 32
    bounces: int = 8
    albedo: Literal["gray", "normals"] = "gray"
    seed: int = 0
    threads: int | None = None

    def __post_init__(self) -> None:
        """Raise ValueError or TypeError that names a bad field."""
        arguments.integer("width", self.width, 1, LARGEST_SIDE)
        arguments.integer("height", self.height, 1, LARGEST_SIDE)
        arguments.integer("spp", self.spp, 1)
        arguments.integer("bounces", self.bounces, 0)
        arguments.choice("albedo", self.albedo, ALBEDOS)
        arguments.integer("seed", self.seed, 0)
        arguments.threads(self.threads)
