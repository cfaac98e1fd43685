"""The meshes that benches run on, and a camera for each."""

import json
import os
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.contenders.compiled_shim import BenchError

BESIDE_REPOSITORY = Path(__file__).resolve().parents[3] / "shared"
DEFAULT_FOLDERS = (BESIDE_REPOSITORY / "scenes", BESIDE_REPOSITORY / "scenes_more")
TERRAIN = "terrain_jacksboro"  # made of matplotlib's elevations if no file has it
TERRAIN_SPACING = 30.0  # metres between the elevation model's samples, about one arc second

# The scenes that the docs quote results of, smallest first; docs/scenes.md says where each comes from.
SCENES = (
    "living_room", "kitchen_fatih", "terrain_jacksboro", "staircase", "city_san_francisco", "veach_ajar",
    "bathroom_contemporary", "bmw_m6", "transparent_machines_f542", "bathroom_salledebain",
    "furball_embree_tubes",
)  # fmt: skip
LARGEST = "furball_embree_tubes_tiled_2x2"  # 10.9 million triangles

# Scenes derived from others: NAME_tiled_4x4, and terrain_1000k of about a million triangles.
TILED = re.compile(r"(?P<base>.+)_tiled_(?P<columns>\d+)x(?P<rows>\d+)")
RESAMPLED = re.compile(r"terrain_(?P<thousands>\d+)k")
TILE_PITCH = 1.05  # distance of neighbouring tiles over their size
# No two tiles are equal:
TILE_TURN = 0.12  # largest turn about the up direction, radians
TILE_LIFT = 0.02  # largest lift over the height


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


@dataclass(frozen=True)
class Selection:
    """The scenes of one run, and those that the bench measures by default but this machine lacks."""

    names: list[str]
    missing: list[str]
    by_default: bool

    @property
    def whole(self) -> bool:
        """Whether they are all the scenes that the bench measures by default."""
        return self.by_default and not self.missing


class SceneFolder:
    """Folders of NAME.npz (vertices, faces), each with a cameras.json; terrain needs only matplotlib."""

    def __init__(self, folder: Path | None = None) -> None:
        """Reads the folder given, else those of $WIVE_SCENES, else shared/scenes beside the repository."""
        named = [folder] if folder else [Path(part) for part in _environment_folders()]
        for candidate in named:
            if not (candidate / "cameras.json").is_file():
                raise BenchError(f"no cameras.json in the scene folder {candidate}: docs/scenes.md has one")
        self._files: dict[str, Path] = {}
        self._cameras: dict[str, Camera] = {TERRAIN: TERRAIN_CAMERA}
        for candidate in named or DEFAULT_FOLDERS:
            if (candidate / "cameras.json").is_file():
                for name, camera in json.loads((candidate / "cameras.json").read_text()).items():
                    if (candidate / f"{name}.npz").is_file():
                        self._files[name] = candidate / f"{name}.npz"
                        self._cameras[name] = Camera(**camera)

    def files(self) -> list[Path]:
        """The files of the scenes."""
        return list(self._files.values())

    def names(self) -> list[str]:
        """Every scene that is here, those of the docs first."""
        return [name for name in dict.fromkeys((*SCENES, *self._cameras)) if name in self._cameras]

    def select(self, asked: Sequence[str], usual: Sequence[str] = SCENES) -> Selection:
        """The scenes asked for, or else those of the usual ones that are here; says which are missing.

        Raises BenchError if a scene asked for is missing, or every usual one.
        """
        missing = [name for name in asked or usual if not self._has(name)]
        if asked and missing:
            known = ", ".join(self.names())
            raise BenchError(
                f"no scene {missing[0]!r}: there are {known}, NAME_tiled_4x4 and terrain_1000k; "
                "others need a file NAME.npz and a camera in cameras.json (docs/scenes.md)"
            )
        if missing:
            print(
                f"missing scenes: {', '.join(missing)}\nA run without them is partial. docs/scenes.md says "
                "where they come from; put them into shared/scenes beside the repository or $WIVE_SCENES.",
                file=sys.stderr,
            )
        names = [name for name in asked or usual if name not in missing]
        if not names:
            raise BenchError("none of the scenes that this bench measures is here")
        return Selection(names, missing, by_default=not asked)

    def _has(self, name: str) -> bool:
        tiles = TILED.fullmatch(name)
        return self._has(tiles["base"]) if tiles else name in self._cameras or bool(RESAMPLED.fullmatch(name))

    def load(self, name: str) -> Mesh:
        """The mesh of that name: a scene, NAME_tiled_4x4 of its copies, or terrain of so many triangles."""
        self.select([name])
        if size := RESAMPLED.fullmatch(name):
            return terrain(int(size["thousands"]) * 1000)
        if tiles := TILED.fullmatch(name):
            return tiled(self.load(tiles["base"]), int(tiles["columns"]), int(tiles["rows"]))
        if name not in self._files:
            return terrain()
        with np.load(self._files[name]) as arrays:
            vertices = np.ascontiguousarray(arrays["vertices"], dtype=np.float32)
            faces = np.ascontiguousarray(arrays["faces"], dtype=np.int32)
        return Mesh(name, vertices, faces, self._cameras[name])


def _environment_folders() -> list[str]:
    """The folders of $WIVE_SCENES, separated like those of $PATH."""
    return [part for part in os.environ.get("WIVE_SCENES", "").split(os.pathsep) if part]


def terrain(triangles: int | None = None) -> Mesh:
    """Terrain of matplotlib's sample data: 344 x 403 elevations, two triangles per four neighbours.

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
    """Copies of a mesh on a grid across its up direction, each turned and lifted a little; camera outside."""
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
