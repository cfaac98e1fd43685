"""Scenes of the benches: missing ones are named and make a run partial; other formats are converted."""

import json
from pathlib import Path

import numpy as np
import pytest

from bench.contenders.compiled_shim import BenchError
from bench.support import convert_scene
from bench.support.scenes import SCENES, TERRAIN, SceneFolder

pytest.importorskip("matplotlib", reason="its elevations are a scene")
CAMERA = {"eye": [3, 3, 3], "target": [0, 0, 0], "up": [0, 0, 1], "fov": 45}
SQUARE = "v 0 0 0.1\nv 1 0 0.1\nv 1 1 0.1\nv 0 1 0.1\nv 0 0 0.1\nf 1 2 3\nf 5 3 4\n"  # its first corner twice


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with one scene of the docs and one other, and cameras for two more that have no file."""
    cameras = {name: CAMERA for name in ("living_room", "own", "staircase")}
    (tmp_path / "cameras.json").write_text(json.dumps(cameras))
    for name in ("living_room", "own"):
        np.savez(tmp_path / f"{name}.npz", vertices=np.eye(3), faces=np.array([[0, 1, 2]]))
    return tmp_path


def test_missing_scenes_are_named_and_make_a_run_partial(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenes = SceneFolder(folder).select(())
    assert scenes.names == ["living_room", TERRAIN]
    assert scenes.missing == [name for name in SCENES if name not in scenes.names]
    assert not scenes.whole
    said = capsys.readouterr().err
    assert all(name in said for name in scenes.missing)
    assert "docs/scenes.md" in said


def test_a_run_on_all_usual_scenes_is_whole_and_one_on_scenes_asked_for_is_not(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    here = SceneFolder(folder)
    assert here.select((), ("living_room", "terrain_2k")).whole
    assert not here.select(("living_room",), ("living_room",)).whole
    assert here.select(("own_tiled_2x1",)).names == ["own_tiled_2x1"]
    assert capsys.readouterr().err == ""


def test_terrain_alone_is_no_whole_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cameras.json").write_text("{}")
    monkeypatch.setenv("WIVE_SCENES", str(tmp_path))
    scenes = SceneFolder().select(())
    assert scenes.names == [TERRAIN] and not scenes.whole
    with pytest.raises(BenchError, match="none of the scenes"):
        SceneFolder().select((), ("living_room",))


def test_several_folders_are_read_and_each_needs_cameras(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    more = tmp_path / "more"
    more.mkdir()
    monkeypatch.setenv("WIVE_SCENES", f"{folder}:{more}")
    with pytest.raises(BenchError, match=r"no cameras.json in the scene folder .*more"):
        SceneFolder()
    (more / "cameras.json").write_text(json.dumps({"veach_ajar": CAMERA}))
    np.savez(more / "veach_ajar.npz", vertices=np.eye(3), faces=np.array([[2, 1, 0]]))
    assert SceneFolder().names() == ["living_room", TERRAIN, "veach_ajar", "own"]
    assert SceneFolder().load("veach_ajar").faces.tolist() == [[2, 1, 0]]


def test_conversion_merges_parts_and_joins_equal_positions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("trimesh")
    (tmp_path / "one.obj").write_text(SQUARE)
    (tmp_path / "two.obj").write_text(SQUARE.replace("0.1", "0.2"))
    target = tmp_path / "pair.npz"
    convert_scene.main([str(tmp_path / "one.obj"), str(tmp_path / "two.obj"), "-o", str(target)])
    with np.load(target) as arrays:
        vertices, faces = arrays["vertices"], arrays["faces"]
    assert vertices.dtype == np.float32 and faces.dtype == np.int32
    assert len(vertices) == 8 and len(faces) == 4
    corners = {tuple(map(tuple, vertices[face].tolist())) for face in faces}
    low, high = (float(np.float32(z)) for z in (0.1, 0.2))
    for z in (low, high):
        assert ((0.0, 0.0, z), (1.0, 0.0, z), (1.0, 1.0, z)) in corners
    said = capsys.readouterr().out
    assert "8 vertices, 4 triangles" in said and '"pair": {"eye"' in said


def test_conversion_keeps_slivers_and_coincident_faces(tmp_path: Path) -> None:
    flat = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 0, 0]], np.float64)
    faces = np.array([[0, 1, 2], [0, 3, 2], [0, 1, 3]])
    vertices, merged = convert_scene.merged([(flat, faces), (flat, faces)])
    assert len(vertices) == 3 and len(merged) == 6
    np.testing.assert_array_equal(vertices[merged], np.concatenate([flat[faces], flat[faces]]))


def test_pbrts_ply_is_read(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    header = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 4\n"
        + "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz", "u", "v"))
        + "element face 1\nproperty list uchar int vertex_indices\nproperty int face_indices\nend_header\n"
    )
    rows = np.zeros((4, 8), "<f4")
    rows[:, :2] = [[0, 0], [1, 0], [1, 1], [0, 1]]
    face = bytes([4]) + np.array([0, 1, 2, 3, 0], "<i4").tobytes()
    (tmp_path / "quad.ply").write_bytes(header.encode() + rows.tobytes() + face)
    ((vertices, faces),) = convert_scene.parts(tmp_path / "quad.ply")
    assert len(vertices) == 4 and len(faces) == 2


def test_what_can_not_be_read_is_named(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    (tmp_path / "mesh.unknown").write_text("")
    with pytest.raises(BenchError, match=r"mesh\.unknown can't be read"):
        convert_scene.main([str(tmp_path / "mesh.unknown"), "-o", str(tmp_path / "a.npz")])
    with pytest.raises(BenchError, match=r"expected a file NAME\.npz"):
        convert_scene.main([str(tmp_path / "mesh.unknown"), "-o", str(tmp_path / "a.obj")])
