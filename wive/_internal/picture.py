"""The type of a picture, and the settings that `render` takes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wive._internal import arguments, options

Image = NDArray[np.float32]
Shading = Literal["auto", "path", "ao", "headlight", "normals", "depth"]
Sky = Literal["day", "cloudy", "white", "black"]
Colours = Literal["gray", "normals"] | ArrayLike | None
Stops = float | Literal["auto"]

SHADINGS = ("auto", "path", "ao", "headlight", "normals", "depth")
SKIES = ("day", "cloudy", "white", "black")
ALBEDOS = ("gray", "normals")
LARGEST_SIDE = 65_536
# Stops of exposure, beyond which float32 pictures are black or infinite.
MOST_STOPS = 60


class How(TypedDict, total=False):
    """Settings that `render` takes by name alone, so that its signature fits on a screen."""

    bounces: int
    sky: Sky
    sun: ArrayLike | None
    exposure: Stops
    reach: float | None


@dataclass(frozen=True, kw_only=True, eq=False)
class Settings:
    """What a picture depends on besides scene and camera; the fields are the arguments of `render`."""

    shading: Shading = "auto"
    width: int = 1280
    height: int = 720
    spp: int = 32
    bounces: int = 8
    albedo: Colours = None
    sky: Sky = "day"
    sun: ArrayLike | None = None
    exposure: Stops = 0.0
    reach: float | None = None
    seed: int = 0
    threads: int | None = None

    def __post_init__(self) -> None:
        """Raise ValueError or TypeError that names a bad field."""
        arguments.choice("shading", self.shading, SHADINGS)
        arguments.integer("width", self.width, 1, LARGEST_SIDE)
        arguments.integer("height", self.height, 1, LARGEST_SIDE)
        arguments.integer("spp", self.spp, 1)
        arguments.integer("bounces", self.bounces, 0)
        if isinstance(self.albedo, str):
            arguments.choice("albedo", self.albedo, ALBEDOS)
        arguments.choice("sky", self.sky, SKIES)
        if self.sun is not None and not arguments.vector("sun", self.sun).any():
            raise ValueError("sun must be a direction towards the sun, got the zero vector")
        if isinstance(self.exposure, str):
            if self.exposure != "auto":
                raise ValueError(f"exposure must be a number of stops or 'auto', got {self.exposure!r:.60}")
        elif abs(arguments.real("exposure", self.exposure)) > MOST_STOPS:
            raise ValueError(
                f"exposure must be from -{MOST_STOPS} to {MOST_STOPS} stops, got {self.exposure:g}"
            )
        if not (self.reach is None or _is_infinite(self.reach)) and arguments.real("reach", self.reach) <= 0:
            raise ValueError(f"reach must be above 0, got {self.reach:g}")
        arguments.integer("seed", self.seed, 0)
        options.threads(self.threads)


def _is_infinite(value: object) -> bool:
    return isinstance(value, float | np.floating) and value == np.inf


class Look(NamedTuple):
    """What the path tracers of core and Warp take, besides camera and image."""

    spp: int
    bounces: int
    albedo: Literal["gray", "normals", "faces", "vertices"]
    colours: Image | None  # (f,3) or (v,3)
    light: Image  # (5,3): up, horizon, zenith, to the sun, sun
    seed: int
    threads: int  # 0 is every core
