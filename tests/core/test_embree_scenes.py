"""Real scenes against embreex: the same answers, or a difference that float32's rounding explains."""

import json
from dataclasses import dataclass

import numpy as np
import pytest
from support.ray_differences import LABELS, Answers, explain
from support.scene_folder import SCENES

import wive

rtcore_scene = pytest.importorskip("embreex.rtcore_scene", reason="embreex is not installed")
mesh_construction = pytest.importorskip("embreex.mesh_construction")

SEED = 20170728
PICTURE = 160  # pixels per side: 25,600 primary rays
PATHS = 64  # pixels per side: 4,096 paths of up to eight bounces
BOUNCES = 8
SPAWN_OFFSET = 1e-5  # in diagonals of the bounding box
FAR = 1e37  # embreex's tmax

CAMERAS = json.loads((SCENES / "cameras.json").read_text()) if (SCENES / "cameras.json").exists() else {}
TERRAIN = "matplotlib's terrain"  # used if there are no scenes


@dataclass(frozen=True)
class Case:
    """A scene's mesh, its rays, and embreex's results with and without its robust flag."""

    name: str
    mesh: tuple[np.ndarray, np.ndarray]
    origins: np.ndarray
    directions: np.ndarray
    embree: dict[str, Answers]


@pytest.fixture(scope="module", params=sorted(CAMERAS) or [TERRAIN])
def case(request: pytest.FixtureRequest) -> Case:
    name: str = request.param
    mesh, camera = load(name)
    origins, directions = rays(mesh, camera)
    embree = {
        "fast": embree_answers(mesh, origins, directions, robust=False),
        "watertight": embree_answers(mesh, origins, directions, robust=True),
    }
    return Case(name, mesh, origins, directions, embree)


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
def test_scenes_agree_with_embree(
    case: Case, backend: str, accuracy: str, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = wive.Scene(*case.mesh, backend=backend, accuracy=accuracy)
    hits = scene.intersect(case.origins, case.directions, tmax=FAR)
    label = explain(
        case.origins,
        case.directions,
        case.mesh,
        Answers(hits.t, hits.prim),
        case.embree[accuracy],
        fast=accuracy == "fast",
    )
    counts = {name: int(np.count_nonzero(label == name)) for name in LABELS}
    with capsys.disabled():
        tally = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
        print(f"\n{case.name}, {backend}, {accuracy}: {len(label)} rays, {tally or 'all the same'}", end=" ")
    first = int(np.argmax(label == "unexplained"))
    assert counts["unexplained"] == 0, (
        f"ray {first}: {case.origins[first]} + t {case.directions[first]}: "
        f"wive hits {hits.prim[first]} at {hits.t[first]}, "
        f"embree {case.embree[accuracy].prim[first]} at {case.embree[accuracy].t[first]}"
    )


def test_wrong_answers_are_not_explained(case: Case) -> None:
    right = case.embree["watertight"]
    hit = right.prim >= 0
    nobody = np.full_like(right.prim, -1)
    wrong = {
        "missed": Answers(np.full_like(right.t, np.inf), nobody),
        "too near": Answers(right.t * np.float32(0.999), right.prim),
        "another triangle": Answers(right.t, np.where(hit, (right.prim + 12345) % len(case.mesh[1]), -1)),
    }
    for name, answers in wrong.items():
        label = explain(case.origins, case.directions, case.mesh, answers, right, fast=False)[hit]
        # Rays at edges and grazing rays may have such results; at most one in a hundred does.
        assert np.count_nonzero(label == "unexplained") > 0.99 * len(label), name


def load(name: str) -> tuple[tuple[np.ndarray, np.ndarray], dict[str, object]]:
    """Vertices and faces, and a camera: eye, target, up, fov in degrees."""
    if name == TERRAIN:
        from wive._internal.terrain import terrain_camera, terrain_mesh

        camera = terrain_camera()
        return terrain_mesh(), {key: getattr(camera, key) for key in ("eye", "target", "up", "fov")}
    with np.load(SCENES / f"{name}.npz") as arrays:
        return (arrays["vertices"], arrays["faces"]), CAMERAS[name]


def embree_answers(
    mesh: tuple[np.ndarray, np.ndarray], origins: np.ndarray, directions: np.ndarray, *, robust: bool
) -> Answers:
    scene = rtcore_scene.EmbreeScene(robust=robust)
    mesh_construction.TriangleMesh(scene, *mesh)
    answers = scene.run(origins, directions, query="INTERSECT", output=1)
    return Answers(answers["tfar"], answers["primID"])


def rays(mesh: tuple[np.ndarray, np.ndarray], camera: dict) -> tuple[np.ndarray, np.ndarray]:
    """Primary rays of a camera, then cosine-distributed bounces of paths from the same camera."""
    rng = np.random.default_rng(SEED)
    scene = wive.Scene(*mesh)
    offset = SPAWN_OFFSET * float(np.linalg.norm(np.ptp(mesh[0].astype(np.float64), axis=0)))
    batches = [primary(camera, PICTURE, rng)]
    batch = primary(camera, PATHS, rng)
    for _ in range(BOUNCES):
        batch = bounced(scene, *batch, offset, rng)
        batches.append(batch)
    return np.concatenate([batch[0] for batch in batches]), np.concatenate([batch[1] for batch in batches])


def primary(camera: dict, side: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    eye = np.array(camera["eye"])
    forward = unit(np.array(camera["target"]) - eye)
    right = unit(np.cross(forward, camera["up"]))
    y, x = (np.mgrid[:side, :side].reshape(2, -1) + rng.random((2, side * side))) / side * 2 - 1
    half = np.tan(np.radians(camera["fov"]) / 2)
    plane = x[:, None] * right + y[:, None] * np.cross(forward, right)
    directions = unit(forward + half * plane).astype(np.float32)
    return np.broadcast_to(eye.astype(np.float32), directions.shape).copy(), directions


def bounced(
    scene: wive.Scene, origins: np.ndarray, directions: np.ndarray, offset: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Rays from the hits of others, started off the surface so that they are in general position."""
    hits = scene.intersect(origins, directions)
    points, normals = hits.points()[hits.mask], hits.normals()[hits.mask]
    away = np.einsum("ij,ij->i", normals, directions[hits.mask]) > 0
    normals[away] *= -1
    # Points of the unit sphere around the normal's tip are cosine-distributed; 0.999 keeps them from 0.
    leaving = unit(normals + 0.999 * unit(rng.normal(size=normals.shape)))
    return (points + offset * normals).astype(np.float32), leaving.astype(np.float32)


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
