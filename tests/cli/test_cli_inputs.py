"""The command line never replaces a file that it reads, whatever name the output has for it."""

import os
from pathlib import Path

import numpy as np
import pytest
from support.meshes import sphere

from wive.cli import main

GLTF = '{"asset":{"version":"2.0"},"images":[{"uri":"%s"}]}'


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    vertices, faces = sphere(1)
    np.savez(tmp_path / "mesh.npz", vertices=vertices, faces=faces)
    np.savez(tmp_path / "rays.npz", origins=[[0, 0, 5.0]], directions=[[0, 0, -1.0]])
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(capsys, *command: object) -> str:
    assert main([str(part) for part in command]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    return error


def content(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


SPELLINGS = {
    "its name": lambda path: path.name,
    "its whole path": lambda path: path,
    "a path with detours": lambda path: f"sub/.././{path.name}",
    "a symbolic link": lambda path: linked(os.symlink, path),
    "a link to a link": lambda path: linked(os.symlink, linked(os.symlink, path)),
    "a hard link": lambda path: linked(os.link, path),
    "a linked folder": lambda path: linked(os.symlink, path.parent, "") / path.name,
}


def linked(link, path: Path, suffix: str = ".npz") -> Path:
    name = path.parent / f"other{len(list(path.parent.iterdir()))}{suffix}"
    link(path, name)
    return name


@pytest.mark.parametrize("spelling", SPELLINGS)
@pytest.mark.parametrize("which", ["mesh.npz", "rays.npz"])
@pytest.mark.parametrize("option", [(), ("--all",)])
def test_trace_refuses_to_write_over_its_inputs(folder, capsys, which, spelling, option):
    output = SPELLINGS[spelling](folder / which)
    before = content(folder)
    error = refused(capsys, "trace", "mesh.npz", "rays.npz", "-o", output, *option)
    assert "which would be lost: choose another name" in error
    assert str(output) in error
    assert which in error
    assert content(folder) == before


def test_inputs_that_are_links_are_inputs(folder, capsys):
    (folder / "link.npz").symlink_to("mesh.npz")
    before = content(folder)
    assert "would be lost" in refused(capsys, "trace", "link.npz", "rays.npz", "-o", "mesh.npz")
    assert content(folder) == before


def test_a_name_in_other_case_is_the_same_file_if_the_system_says_so(folder, capsys, monkeypatch):
    """As on macOS and Windows: both names have one inode."""
    real = os.lstat
    monkeypatch.setattr(
        os, "lstat", lambda name, **options: real(str(name).replace("MESH.npz", "mesh.npz"), **options)
    )
    assert "would be lost" in refused(capsys, "trace", "mesh.npz", "rays.npz", "-o", "MESH.npz")


def test_a_picture_does_not_replace_its_mesh(folder, capsys):
    (folder / "mesh.npz").rename(folder / "mesh.png")
    before = content(folder)
    assert "would be lost" in refused(capsys, "render", "mesh.png", "-o", "mesh.png")
    assert content(folder) == before


@pytest.mark.parametrize(
    ("mesh", "text", "material"),
    [
        ("chair.gltf", GLTF % "textures/wood.png", ""),
        ("chair.obj", "mtllib chair.mtl\n", "newmtl wood\nmap_Kd textures/wood.png\n"),
        ("chair.obj", "mtllib chair.mtl\n", "newmtl wood\r\nmap_Kd -s 1 1 1 textures\\WOOD.PNG\r\n"),
        ("chair.gltf", GLTF % "textures%2F%77ood%2Epng", ""),
        ("chair.gltf", GLTF % "textures/w\\u006fod.png", ""),
        ("chair.ply", "ply\nformat ascii 1.0\ncomment TextureFile wood.png\n", ""),
    ],
)
def test_a_picture_does_not_replace_a_texture_of_its_mesh(folder, capsys, mesh, text, material):
    pytest.importorskip("PIL")
    (folder / mesh).write_text(text)
    (folder / "chair.mtl").write_text(material)
    (folder / "textures").mkdir()
    (folder / "textures" / "wood.png").write_bytes(b"texture")
    before = content(folder)
    assert "names it" in refused(capsys, "render", mesh, "-o", "textures/wood.png")
    assert content(folder) == before


def test_an_old_output_is_replaced(folder, capsys):
    pytest.importorskip("PIL")
    (folder / "room.mtl").write_text("map_Kd bedroom.png\n")
    for name in ("room.png", "hits.npz"):
        (folder / name).write_bytes(b"old")
    small = ("--width", "8", "--height", "8", "--spp", "1")
    assert main(["render", "mesh.npz", "-o", "room.png", *small]) == 0
    assert main(["trace", "mesh.npz", "rays.npz", "-o", "hits.npz"]) == 0
    assert (folder / "room.png").read_bytes()[:4] == b"\x89PNG"
    with np.load("hits.npz") as hits:
        assert hits["prim"].shape == (1,)


def test_a_picture_does_not_replace_a_texture_by_a_link_or_one_that_materials_elsewhere_name(folder, capsys):
    pytest.importorskip("PIL")
    (folder / "chair.obj").write_text("mtllib sub/größe 1.mtl\n")
    (folder / "sub" / "größe 1.mtl").write_text("map_Kd a wood.png\n")
    (folder / "a wood.png").write_bytes(b"texture")
    (folder / "link.png").symlink_to("a wood.png")
    (folder / "room.gltf").write_text(GLTF % "a%20wood.png")
    before = content(folder)
    for mesh in ("chair.obj", "room.gltf"):
        for output in ("a wood.png", "link.png"):
            assert "names it" in refused(capsys, "render", mesh, "-o", output)
    assert content(folder) == before


def test_hits_do_not_replace_a_buffer_of_the_mesh(folder, capsys):
    (folder / "mesh.gltf").write_text('{"asset":{"version":"2.0"},"buffers":[{"uri":"buffer.npz"}]}')
    (folder / "buffer.npz").write_bytes(b"buffer")
    before = content(folder)
    assert "names it" in refused(capsys, "trace", "mesh.gltf", "rays.npz", "-o", "buffer.npz")
    assert content(folder) == before
