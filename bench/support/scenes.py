"""The meshes that benches run on, and a camera for each."""

import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.contenders.compiled_shim import BenchError

DEFAULT_FOLDER = Path(__file__).resolve().parents[3] / "shared" / "scenes"
TERRAIN = "terrain_jacksboro"
TERRAIN_SPACING = 30.0  # metres between the elevation model's samples, about one arc second

# Scenes made of others: NAME_tiled_4x4, and terrain_1000k of about a million triangles.
TILED = re.compile(r"(?P<base>.+)_tiled_(?P<columns>\d+)x(?P<rows>\d+)")
RESAMPLED = re.compile(r"terrain_(?P<thousands>\d+)k")
TILE_PITCH = 1.05  # distance of neighbouring tiles over their size,
TILE_TURN = 0.12  # largest turn about the up direction in radians, and
TILE_LIFT = 0.02  # highest lift over the height, so that no two tiles are alike


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

    def largest(self) -> str:
        """Name of a scene of more than ten million triangles."""
        furball = "furball_embree_tubes"
        return f"{furball}_tiled_2x2" if furball in self.names() else f"{TERRAIN}_tiled_7x7"

    def check(self, names: Sequence[str]) -> list[str]:
        """The names, or all where there are none; BenchError for one that there is no scene of."""
        for name in names:
            if not self._has(name):
                known = ", ".join(self.names())
                raise BenchError(f"no scene {name!r}: there are {known}, NAME_tiled_4x4 and terrain_1000k")
        return list(names) or self.names()

    def _has(self, name: str) -> bool:
        tiles = TILED.fullmatch(name)
        return self._has(tiles["base"]) if tiles else name in self.names() or bool(RESAMPLED.fullmatch(name))

    def load(self, name: str) -> Mesh:
        """The mesh of that name: a scene, NAME_tiled_4x4 of its copies, or terrain of so many triangles."""
        self.check([name])
        if size := RESAMPLED.fullmatch(name):
            return terrain(int(size["thousands"]) * 1000)
        if tiles := TILED.fullmatch(name):
            return tiled(self.load(tiles["base"]), int(tiles["columns"]), int(tiles["rows"]))
        if self.folder is None:
            return terrain()
        with np.load(self.folder / f"{name}.npz") as arrays:
            vertices = np.ascontiguousarray(arrays["vertices"], dtype=np.float32)
            faces = np.ascontiguousarray(arrays["faces"], dtype=np.int32)
        return Mesh(name, vertices, faces, Camera(**self._cameras[name]))  # type: ignore[arg-type]


def terrain(triangles: int | None = None) -> Mesh:
    """Real terrain that matplotlib ships: 344 x 403 elevations, two triangles between any four neighbours.

    With a number of triangles, elevations are interpolated on a grid that makes about so many.
    """
    from matplotlib import cbook

    with np.load(str(cbook.get_sample_data("jacksboro_fault_dem.npz", asfileobj=False))) as arrays:
        height = np.asarray(arrays["elevation"], dtype=np.float32)
    length, width = (TERRAIN_SPACING * (samples - 1) for samples in height.shape)
    if triangles is not None:
        height = _resampled(height, triangles)
    rows, columns = height.shape
    y, x = np.meshgrid(
        np.linspace(0, length, rows, dtype=np.float32),
        np.linspace(0, width, columns, dtype=np.float32),
        indexing="ij",
    )
    vertices = np.stack([x, -y, height], axis=-1).reshape(-1, 3)
    corner = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    faces = np.concatenate([np.stack(t, axis=-1).reshape(-1, 3) for t in ((a, c, b), (b, c, d))])
    name = TERRAIN if triangles is None else f"terrain_{triangles // 1000}k"
    return Mesh(name, np.ascontiguousarray(vertices), np.ascontiguousarray(faces), TERRAIN_CAMERA)


def _resampled(height: NDArray[np.floating], triangles: int) -> NDArray[np.float32]:
    """Elevations between the given ones, linear in each direction."""
    scale = (triangles / 2 / np.prod([samples - 1 for samples in height.shape])) ** 0.5
    for _ in range(2):
        samples = len(height)
        places = np.linspace(0, samples - 1, max(2, round(scale * (samples - 1)) + 1))
        height = np.stack([np.interp(places, np.arange(samples), line) for line in height.T])
    return height.astype(np.float32)


def tiled(mesh: Mesh, columns: int, rows: int) -> Mesh:
    """Copies of a mesh on a grid across its up direction, each turned and lifted a little, from outside."""
    rng = np.random.default_rng([columns, rows])
    up = int(np.argmax(np.abs(mesh.camera.up)))
    across = [axis for axis in range(3) if axis != up]
    low, high = mesh.vertices.min(axis=0).astype(np.float64), mesh.vertices.max(axis=0).astype(np.float64)
    centre, pitch = (low + high) / 2, TILE_PITCH * (high - low)
    parts = []
    for column, row in np.ndindex(columns, rows):
        angle = rng.uniform(-TILE_TURN, TILE_TURN)
        relative = mesh.vertices - centre
        a, b = relative[:, across[0]], relative[:, across[1]]
        tile = relative.copy()
        tile[:, across[0]] = np.cos(angle) * a - np.sin(angle) * b
        tile[:, across[1]] = np.sin(angle) * a + np.cos(angle) * b
        place = np.zeros(3)
        place[across] = (np.array([column, row]) - np.array([columns - 1, rows - 1]) / 2) * pitch[across]
        place[up] = rng.uniform(0, TILE_LIFT) * (high - low)[up]
        parts.append((tile + centre + place).astype(np.float32))
    first = len(mesh.vertices) * np.arange(len(parts), dtype=np.int32)
    faces = (mesh.faces[None] + first[:, None, None]).reshape(-1, 3)
    eye, target = np.array(mesh.camera.eye), np.array(mesh.camera.target)
    x, y, z = (target + max(columns, rows) * (eye - target)).tolist()
    camera = Camera((x, y, z), mesh.camera.target, mesh.camera.up, mesh.camera.fov)
    return Mesh(f"{mesh.name}_tiled_{columns}x{rows}", np.concatenate(parts), faces, camera)
