"""Each program in examples/ runs without a file and leaves a picture; its meshes and sensors are right."""

import re
import sys
from functools import partial
from pathlib import Path

import meshes
import numpy as np
import pytest
from support.programs import EXAMPLES, example

import wive

pytest.importorskip("matplotlib")
pillow = pytest.importorskip("PIL.Image")

ROOT = EXAMPLES.parent
SHARED = {"meshes", "pictures"}  # what programs have in common
PROGRAMS = sorted({path.stem for path in EXAMPLES.glob("*.py")} - SHARED)
NEEDS = {
    "ambient_occlusion": "warp", "dask_heights": "dask", "gradients": "torch", "wall_thickness": "trimesh",
}  # fmt: skip

FEWER = {"rays_of_files": {"RAYS": 500_000}, "render": {"SAMPLES": 4}}


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_leaves_a_picture_and_says_so(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [name])
    monkeypatch.setattr(meshes, "vase", partial(meshes.vase, rings=50, sections=50))
    program = example(name)
    for number, fewer in FEWER.get(name, {}).items():
        monkeypatch.setattr(program, number, fewer)
    try:
        program.main()
    finally:
        if NEEDS.get(name) == "trimesh":
            wive.trimesh.uninstall()
    assert f"wrote {name}.png" in capsys.readouterr().out
    with pillow.open(tmp_path / f"{name}.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    assert pixels.shape[1] >= 640
    assert pixels.mean() > 90, "not black"
    assert pixels.std() > 15, "not blank"
    assert len(np.unique(pixels @ [65536, 256, 1])) > 30


def test_pages_name_every_program() -> None:
    pages = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md"))
    named = set(re.findall(r"examples/(\w+)\.py", pages))
    assert named == set(PROGRAMS)


@pytest.mark.parametrize("mesh", ["vase", "street", "car"])
def test_meshes_are_closed_with_normals_outwards(mesh: str) -> None:
    vertices, faces = getattr(meshes, mesh)()
    pairs = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    edges = {tuple(edge) for edge in pairs.tolist()}
    assert len(edges) == len(pairs) and all((b, a) in edges for a, b in edges)
    corners = vertices[faces].astype(np.float64)
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert volume > 0
    assert np.linalg.norm(np.cross(*(corners[:, [1, 2]] - corners[:, :1]).swapaxes(0, 1)), axis=1).min() > 0


def test_a_lidar_over_a_plain_has_the_ranges_of_its_beams() -> None:
    plain = wive.Scene([[-99, -99, 0], [99, -99, 0], [99, 99, 0], [-99, 99, 0]], [[0, 1, 2], [0, 2, 3]])
    hits = example("lidar").turn(plain, (0, 0, 1.8), beams=4, steps=8)
    below = np.radians([25, 10])  # of 20, 5, -10 and -25 degrees
    np.testing.assert_allclose(hits.t[[3, 2]], (1.8 / np.sin(below))[:, None] * np.ones(8), rtol=1e-6)
    assert np.isinf(hits.t[:2]).all()


def test_a_torus_is_seen_with_its_hole() -> None:
    module = example("depth_picture")
    camera = wive.PinholeCamera((175, 175, 79.5, 59.5), module.POSE)
    mask = wive.Scene(*module.torus()).intersect(*camera.rays(160, 120)).mask
    row = mask[59]
    inside = np.flatnonzero(row)
    assert not row[inside[0] : inside[-1]].all(), "background within the torus"
    assert not mask[0].any() and not mask[-1].any(), "background above and below"


def test_a_moved_car_is_hit_where_it_is() -> None:
    module = example("moving")
    vertices, faces = meshes.car()
    scene = wive.Scene.from_meshes([meshes.street(), (vertices, faces)])
    for x in (-20.0, 5.0):
        module.moved(scene, vertices, x)
        hits = scene.intersect([[x, -1.5, 9.0], [x + 5, -1.5, 9.0]], (0, 0, -1))
        assert hits.geom.tolist() == [1, 0]


def test_heights_by_dask_are_those_of_the_land() -> None:
    pytest.importorskip("dask")
    x, y = np.linspace(0, 7, 8), np.linspace(5, 0, 6)
    z = 2 * x + 3 * y[:, None]
    found = example("dask_heights").heights(wive.Scene.from_heightfield(z, x, y)).compute()
    rows, columns = found.shape
    expected = 2 * np.linspace(0, 7, columns) + 3 * np.linspace(5, 0, rows)[:, None]
    np.testing.assert_allclose(found[1:-1, 1:-1], expected[1:-1, 1:-1], atol=1e-9)


def test_all_rays_of_a_file_that_hit_are_counted_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = example("rays_of_files")
    monkeypatch.setattr(module, "RAYS", 5_000)
    monkeypatch.setattr(module, "PIECE", 1_000)
    path = str(tmp_path / "rays.npy")
    module.write_rays(path)
    scene = wive.Scene(*meshes.street())
    edges = np.linspace(-70, 70, 30), np.linspace(-20, 20, 30)
    rays = np.load(path)
    hits = scene.intersect(rays[:, :3].copy(), rays[:, 3:].copy())
    assert module.light(scene, path, edges).sum() == hits.mask.sum() > 1000


def test_colours_of_the_rendered_street_are_per_mesh() -> None:
    module = example("render")
    scene, colors = module.scene_and_colors()
    hits = scene.intersect([[-12, -1.5, 9.0], [20, 0, 9], [-50, -10, 20]], (0, 0, -1))
    np.testing.assert_array_equal(colors[hits.prim], [module.PAINT, module.ROAD, module.WALLS])


def test_gradients_lead_to_the_scanner() -> None:
    torch = pytest.importorskip("torch")
    module = example("gradients")
    room = wive.Scene(*module.ROOM)
    measured = torch.tensor(room.intersect(np.float32(module.SCANNER), module.beams().numpy()).t)
    steps = module.descent(room, measured, module.GUESS)
    np.testing.assert_allclose(steps[-1][:2], module.SCANNER[:2], atol=0.02)


def test_a_tower_hides_the_sky_from_the_ground_beside_it() -> None:
    pytest.importorskip("warp")
    module = example("ambient_occlusion")
    sky, ground = module.ground_sky(wive.Scene(*module.TOWER, device="cpu"), side=24)
    middle = slice(10, 14)  # the tower is 2 wide, the ground 12
    assert not ground[middle, middle].any() and ground.sum() == 24 * 24 - 16
    assert (sky[middle, middle] == 1).all()
    assert sky[9, 12] < 0.75 and sky[12, 9] < 0.75, "beside the tower"
    assert sky[0, 0] > 0.95, "the far corner sees nearly all"


def test_a_script_for_embreex_finds_the_shadow_of_its_ball() -> None:
    sun = np.array([0.7, 0.2, 1.0])
    lit = example("embreex_script").lit(tuple(sun), side=41)
    x, y = np.meshgrid(np.linspace(-4, 4, 41), np.linspace(-4, 4, 41))
    to_middle = np.stack([-x, -y, np.full_like(x, 2)], axis=-1)
    aside = np.linalg.norm(
        np.cross(to_middle, sun / np.linalg.norm(sun)), axis=-1
    )  # of the ray, from the ball
    sure = abs(aside - 1) > 0.02
    assert (lit == (aside > 1))[sure].all() and (~lit).sum() > 90
