"""The meshes that benches run on, and a camera for each."""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.compiled_shim import BenchError

DEFAULT_FOLDER = Path(__file__).resolve().parents[2] / "shared" / "scenes"
TERRAIN = "terrain_jacksboro"
TERRAIN_SPACING = 30.0  # metres between the elevation model's samples, about one arc second


@dataclass(frozen=True)
class Camera:
    """Eye, the point it looks at, the up direction, and the field of view in degrees of a square picture."""

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    up: tuple[float, float, float]
    fov: float


TERRAIN_CAMERA = Camera((10208.1274, -10019.4819, 3789.5955), (6030.0, -5145.0, 656.0), (0.0, 0.0, 1.0), 45.0)


@dataclass(frozen=True)
class Mesh:
    """A named mesh: vertices (v,3) float32, faces (f,3) int32, both C-contiguous."""

    name: str
    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    camera: Camera

    @property
    def diagonal(self) -> float:
        """Length of the bounding box's diagonal."""
        return float(np.linalg.norm(np.ptp(self.vertices.astype(np.float64), axis=0)))


class SceneFolder:
    """A folder of NAME.npz (vertices, faces) and cameras.json; where there is none, matplotlib's terrain."""

    def __init__(self, folder: Path | None = None) -> None:
        """Folder: the one given, else $WIVE_SCENES, else ../shared/scenes beside the repository."""
        named = folder or (Path(os.environ["WIVE_SCENES"]) if os.environ.get("WIVE_SCENES") else None)
        chosen = named or DEFAULT_FOLDER
        self.folder = chosen if (chosen / "cameras.json").is_file() else None
        if named is not None and self.folder is None:
            raise BenchError(f"no cameras.json in the scene folder {named}")
        self._cameras: dict[str, dict[str, object]] = {}
        if self.folder is not None:
            self._cameras = json.loads((self.folder / "cameras.json").read_text())

    def names(self) -> list[str]:
        """Every scene, smallest file first."""
        if self.folder is None:
            return [TERRAIN]
        files = [self.folder / f"{name}.npz" for name in self._cameras]
        return [file.stem for file in sorted(files, key=lambda file: file.stat().st_size) if file.is_file()]

    def check(self, names: Sequence[str]) -> list[str]:
        """The names, or all where there are none; BenchError for one that there is no scene of."""
        for name in names:
            if name not in self.names():
                raise BenchError(f"no scene {name!r}: there are {', '.join(self.names())}")
        return list(names) or self.names()

    def load(self, name: str) -> Mesh:
        """The mesh of that name."""
        self.check([name])
        if self.folder is None:
            return terrain()
        with np.load(self.folder / f"{name}.npz") as arrays:
            vertices = np.ascontiguousarray(arrays["vertices"], dtype=np.float32)
            faces = np.ascontiguousarray(arrays["faces"], dtype=np.int32)
        return Mesh(name, vertices, faces, Camera(**self._cameras[name]))  # type: ignore[arg-type]


def terrain() -> Mesh:
    """Real terrain that matplotlib ships: 344 x 403 elevations, two triangles between any four neighbours."""
    from matplotlib import cbook

    with np.load(str(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False))) as arrays:
        height = np.asarray(arrays["elevation"], dtype=np.float32)
    rows, columns = height.shape
    y, x = np.mgrid[0:rows, 0:columns].astype(np.float32) * np.float32(TERRAIN_SPACING)
    vertices = np.stack([x, -y, height], axis=-1).reshape(-1, 3)
    corner = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    faces = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, c, b), (b, c, d))])
    return Mesh(TERRAIN, np.ascontiguousarray(vertices), np.ascontiguousarray(faces), TERRAIN_CAMERA)
