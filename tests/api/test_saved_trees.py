"""A saved tree is used where it lies, and what is wrong with its file is one line before a ray is traced."""

import copy
import gc
import json
import os
import pickle
import re
import stat
import struct
import subprocess
import sys
import threading

import numpy as np
import pytest
from support.meshes import TRIANGLE, assert_same_hits, random_rays, soup, sphere
from support.stored_trees import header_of, part_places, repaired, with_header

import wive
from wive._internal.tree_file import MAGIC
from wive.cli import main

FORMS = [
    (np.float32, "float32", "watertight"),
    (np.float32, "float32", "fast"),
    (np.float32, "float32", "exact"),
    (np.float32, "compressed", "watertight"),
    (np.float32, "compressed", "fast"),
    (np.float32, "compressed", "exact"),
    (np.float64, "float32", "watertight"),
    (np.float64, "compressed", "fast"),
]
RAYS = random_rays(500, seed=4)


def scene_of(dtype=np.float32, nodes="float32", accuracy="watertight", count=300, **options) -> wive.Scene:
    vertices, faces = soup(count, seed=3)
    return wive.Scene(vertices.astype(dtype), faces, nodes=nodes, accuracy=accuracy, **options)


def saved(path, *form, **options) -> bytes:
    scene_of(*form, **options).save(path)
    return path.read_bytes()


def refusal(path) -> str:
    """The one line that a file is refused with, when it is loaded or by its first query."""
    with pytest.raises(ValueError) as error:
        wive.load(path).intersect(*RAYS)
    text = str(error.value)
    assert text.startswith(f"{path}: ") and text.isprintable() and len(text) < len(str(path)) + 300
    return text


@pytest.mark.parametrize("form", FORMS)
def test_a_loaded_scene_answers_as_the_saved_one_bit_for_bit(tmp_path, form):
    scene = scene_of(*form)
    scene.save(tmp_path / "scene.wive")
    again = wive.load(tmp_path / "scene.wive")
    assert repr(again).startswith(f"{repr(scene)[:-1]}, wive.load('") and (again.nodes, again.memory) == (
        scene.nodes,
        scene.memory,
    )
    assert_same_hits(again.intersect(*RAYS), scene.intersect(*RAYS))
    np.testing.assert_array_equal(again.occluded(*RAYS), scene.occluded(*RAYS))
    np.testing.assert_array_equal(again.count(*RAYS), scene.count(*RAYS))
    for name in ("offsets", "t", "prim", "uv"):
        found, expected = (getattr(one.intersect_all(*RAYS), name) for one in (again, scene))
        np.testing.assert_array_equal(found, expected)
    for name in ("bounds", "vertices", "faces"):
        found, expected = getattr(again, name), getattr(scene, name)
        assert found.dtype == expected.dtype
        np.testing.assert_array_equal(found, expected)
    for name in ("units", "center", "extent", "depth", "sah", "far_distance"):
        np.testing.assert_array_equal(getattr(again._bvh, name), getattr(scene._bvh, name))


@pytest.mark.parametrize("form", FORMS)
def test_a_loaded_scene_is_refitted_and_saved_again(tmp_path, form):
    path = tmp_path / "scene.wive"
    scene = scene_of(*form)
    scene.save(path)
    again = wive.load(path)
    moved = scene.vertices * 1.25 + 0.5
    for one in (scene, again):
        one.refit(moved)
    assert_same_hits(again.intersect(*RAYS), scene.intersect(*RAYS))
    again.save(path)  # over the file that another scene may still map
    assert_same_hits(wive.load(path).intersect(*RAYS), scene.intersect(*RAYS))


def test_the_mesh_of_a_loaded_scene_can_not_be_written_to(tmp_path):
    saved(tmp_path / "scene")
    again = wive.load(tmp_path / "scene")
    for array in (again.vertices, again.faces, again._bvh.units):
        assert not array.flags.writeable
        with pytest.raises(ValueError, match=r"WRITEABLE|writeable"):
            array.flags.writeable = True


def test_scenes_without_triangles_or_with_one_are_saved(tmp_path):
    for vertices, faces in (
        ([[0, 0, 0]], np.zeros((0, 3), np.int32)),
        TRIANGLE,
        (np.zeros((3, 3)), [[0, 1, 2]]),
    ):
        for nodes in ("float32", "compressed"):
            scene = wive.Scene(vertices, faces, nodes=nodes)
            scene.save(tmp_path / "scene")
            again = wive.load(tmp_path / "scene")
            assert_same_hits(again.intersect(*RAYS), scene.intersect(*RAYS))
            assert repr(again.bounds) == repr(scene.bounds)


def test_unused_vertices_that_are_not_finite_are_saved(tmp_path):
    vertices = np.vstack([TRIANGLE[0], np.full((1, 3), np.nan)]).astype(np.float32)
    wive.Scene(vertices, TRIANGLE[1]).save(tmp_path / "scene")
    np.testing.assert_array_equal(wive.load(tmp_path / "scene").vertices, vertices)


def test_a_file_that_is_replaced_leaves_loaded_scenes_as_they_were(tmp_path):
    path = tmp_path / "scene"
    saved(path)
    first = wive.load(path)
    wive.Scene(*sphere(1)).save(path)
    assert_same_hits(first.intersect(*RAYS), scene_of().intersect(*RAYS))
    assert len(wive.load(path)) == 80


@pytest.mark.parametrize("nodes", ["float32", "compressed"])
def test_every_flipped_byte_is_found(tmp_path, nodes):
    path = tmp_path / "scene"
    whole = saved(path, np.float32, nodes, count=2)
    rng = np.random.default_rng(1)
    for at in range(len(whole)):
        damaged = bytearray(whole)
        damaged[at] ^= 1 << rng.integers(8)
        path.write_bytes(damaged)
        refusal(path)


def test_every_truncation_is_found_and_so_is_anything_appended(tmp_path):
    path = tmp_path / "scene"
    whole = saved(path, count=2)
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        refusal(path)
    for more in (b"\0", b" " * 64, whole):
        path.write_bytes(whole + more)
        assert "too long" in refusal(path)


@pytest.mark.parametrize("form", FORMS)
def test_random_wrong_references_with_right_checksums_do_no_harm(tmp_path, form):
    """Refused, or traced to the end within the tree; what other bytes may do to hits is not looked at."""
    path = tmp_path / "scene"
    whole = saved(path, *form, count=120)
    rng = np.random.default_rng(5)
    places = part_places(whole)
    scene = wive.load(path)
    nodes = scene._bvh.nodes.nbytes // 4
    refused = 0
    for _ in range(60):
        data = bytearray(whole)
        begin = places[0].start // 4
        at = (
            begin + int(rng.integers(nodes))
            if rng.random() < 0.7
            else int(rng.integers(begin, len(data) // 4))
        )
        word = struct.unpack_from("<I", data, 4 * at)[0]
        choices = [word ^ 1 << int(rng.integers(32)), int(rng.integers(1 << 32)), 0, 0xFFFFFFFF, word + 8]
        struct.pack_into("<I", data, 4 * at, choices[rng.integers(len(choices))] & 0xFFFFFFFF)
        path.write_bytes(repaired(bytes(data)))
        try:
            again = wive.load(path)
            again.intersect_all(*RAYS)
            again.intersect(*RAYS).points()
        except ValueError as error:
            refused += 1
            assert "\n" not in str(error) and str(error).startswith(str(path))
    assert refused > 10


def child_words(data: bytes, nodes: int) -> list[int]:
    """Where the child references of the nodes are, for float32 nodes."""
    begin = part_places(data)[0].start
    return [begin + 256 * node + 192 + 4 * lane for node in range(nodes) for lane in range(8)]


def changed_child(data: bytes, change) -> bytes:
    """The first inner reference changed."""
    changed = bytearray(data)
    for at in child_words(data, header_of(data)["tree"]["node_count"]):
        (child,) = struct.unpack_from("<I", data, at)
        if child < 0x80000000:
            struct.pack_into("<I", changed, at, change(child) & 0xFFFFFFFF)
            return repaired(bytes(changed))
    raise AssertionError("no inner child")


@pytest.mark.parametrize(
    "change",
    [
        lambda child: 0,  # a cycle through the root
        lambda child: child + 64,  # the next node, which has two parents then
        lambda child: child + 8,  # between two nodes
        lambda child: child | 1,
        lambda child: 0x7FFFFFC0,
        lambda child: child | 0x80000000,  # a node as a leaf
        lambda child: 0xFFFFFFF8,
        lambda child: 0xFFFFFFFF,  # a subtree that is lost
    ],
)
def test_wrong_children_with_right_checksums_are_refused(tmp_path, change):
    path = tmp_path / "scene"
    path.write_bytes(changed_child(saved(path), change))
    assert "is damaged (" in refusal(path)


def test_order_rows_that_visit_a_child_twice_are_refused(tmp_path):
    path = tmp_path / "scene"
    data = bytearray(saved(path))
    at = part_places(data)[0].start + 224
    data[at : at + 4] = data[at + 4 : at + 8]
    path.write_bytes(repaired(bytes(data)))
    assert "permutations" in refusal(path)


def test_a_face_beyond_the_vertices_and_a_triangle_beyond_the_faces_are_refused(tmp_path):
    path = tmp_path / "scene"
    data = bytearray(saved(path, count=3))
    units, _, faces = part_places(data)
    wrong = data.copy()
    struct.pack_into("<i", wrong, faces.start + 4, 10**9)
    path.write_bytes(repaired(bytes(wrong)))
    assert "faces must index" in refusal(path)
    wrong = data.copy()
    struct.pack_into("<i", wrong, units.start + 256 + 144, 3)  # the first prim of the first block
    path.write_bytes(repaired(bytes(wrong)))
    assert "triangles of the mesh" in refusal(path)


@pytest.mark.parametrize(
    "change",
    [
        lambda header: header["tree"].update(depth=0),
        lambda header: header["tree"].update(depth=65),
        lambda header: header["tree"].update(depth=2**70),
        lambda header: header["tree"].update(depth="2"),
        lambda header: header["tree"].update(node_count=0),
        lambda header: header["tree"].update(node_count=-1),
        lambda header: header["tree"].update(node_count=10**6),
        lambda header: header["tree"].update(node_count=True),
        lambda header: header["tree"].update(triangle_count=1),
        lambda header: header["tree"].update(center=[0, 0]),
        lambda header: header["tree"].update(extent=[float("nan")] * 3),
        lambda header: header["tree"].update(far_away=float("inf")),
        lambda header: header["tree"].update(bounds=[[1, 1, 1], [0, 0, 0]]),
        lambda header: header["tree"].update(more=1),
        lambda header: header["tree"].clear(),
        lambda header: header.update(tree=[]),
        lambda header: header.update(precision="float16"),
        lambda header: header.update(precision="float64"),
        lambda header: header.update(bytes=[1, 2]),
        lambda header: header.update(bytes=[-64, 0, 0]),
        lambda header: header.update(bytes=[10**30, 0, 0]),
        lambda header: header.update(bytes=None),
        lambda header: header.update(checksums=[]),
        lambda header: header.update(checksums=["x", "y", "z"]),
        lambda header: header.update(checksums=[1, 2, 3]),
        lambda header: header.update(options=None),
        lambda header: header["options"].update(accuracy="best"),
        lambda header: header["options"].update(accuracy=["fast"]),
        lambda header: header["options"].update(nodes="compressed"),
        lambda header: header["options"].update(quality=1),
        lambda header: header["options"].update(backend="gpu"),
        lambda header: header["options"].update(backend=[]),
        lambda header: header["options"].pop("device"),
        lambda header: header.clear(),
    ],
)
def test_wrong_headers_with_right_digests_are_refused(tmp_path, change):
    path = tmp_path / "scene"
    path.write_bytes(with_header(saved(path), change))
    refusal(path)


def test_other_versions_are_named(tmp_path, capsys):
    path = tmp_path / "scene"
    whole = saved(path)
    path.write_bytes(with_header(whole, lambda header: header.update(wive="3.1.4"), version=3))
    expected = f"{path}: scene file of version 3, written by wive 3.1.4; this is wive {wive.__version__}, "
    expected += "which reads version 2"
    assert refusal(path).startswith(expected)
    with pytest.raises(ValueError, match=re.escape(expected)):
        wive.Scene.from_file(path)
    assert main(["info", str(path)]) == 2
    assert expected in capsys.readouterr().err
    path.write_bytes(with_header(whole, lambda header: header["options"].update(engine=1)))
    assert "with unknown options (engine)" in refusal(path)
    for version in (1, 2**24 * 2):  # of other byte order
        path.write_bytes(with_header(whole, lambda header: None, version=version))
        refusal(path)


@pytest.mark.parametrize(
    "content", [b"", b"\0" * 100, b"PK\x03\x04", MAGIC, MAGIC + b"\xff" * 24, b"solid x\n" * 40]
)
def test_foreign_files_are_refused(tmp_path, content):
    path = tmp_path / "scene"
    path.write_bytes(content)
    refusal(path)
    with pytest.raises(OSError):
        wive.load(tmp_path)
    with pytest.raises(FileNotFoundError):
        wive.load(tmp_path / "missing")


def test_every_use_of_a_damaged_tree_refuses_it_every_time(tmp_path):
    path = tmp_path / "scene"
    data = bytearray(saved(path))
    data[-1] ^= 1
    path.write_bytes(data)
    scene = wive.load(path)
    camera = wive.Camera.framing(scene.bounds)
    uses = {
        "intersect": lambda: scene.intersect(*RAYS),
        "one ray": lambda: scene.intersect(RAYS[0][:1], RAYS[1][:1]),
        "occluded": lambda: scene.occluded(*RAYS),
        "count": lambda: scene.count(*RAYS),
        "intersect_all": lambda: scene.intersect_all(*RAYS),
        "refit": lambda: scene.refit(scene.vertices),
        "save": lambda: scene.save(tmp_path / "copy"),
        "render": lambda: wive.render(scene, camera, width=4, height=4, spp=1),
        "other options": lambda: wive.Scene.from_file(path, accuracy="fast"),
        "again": lambda: scene.intersect(*RAYS),
    }
    for use in uses.values():
        with pytest.raises(ValueError, match=r"is damaged \(wrong checksum of its faces\)"):
            use()
    assert not (tmp_path / "copy").exists()


def test_threads_that_ask_at_once_verify_together(tmp_path):
    path = tmp_path / "scene"
    saved(path, count=5000)
    scene, expected = wive.load(path), scene_of(count=5000).intersect(*RAYS).t
    found = [None] * 8

    def ask(i: int) -> None:
        found[i] = scene.intersect(*RAYS).t

    threads = [threading.Thread(target=ask, args=(i,)) for i in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for t in found:
        np.testing.assert_array_equal(t, expected)


def test_files_in_numpys_format_are_written_and_read(tmp_path):
    scene = scene_of(np.float64)
    for name in ("scene.npz", "SCENE.NPZ"):
        scene.save(tmp_path / name)
        with np.load(tmp_path / name) as arrays:
            np.testing.assert_array_equal(arrays["vertices"], scene.vertices)
            assert json.loads(str(arrays["header"]))["version"] == 1
        for again in (wive.load(tmp_path / name), wive.Scene.from_file(tmp_path / name)):
            assert again.precision == "float64" and again._bvh.source is None
            assert_same_hits(again.intersect(*RAYS), scene.intersect(*RAYS))
    os.rename(tmp_path / "scene.npz", tmp_path / "old.wive")  # as wive 0.1 wrote it under any name
    assert len(wive.load(tmp_path / "old.wive")) == len(scene)


def test_from_file_uses_the_saved_tree_or_builds_one_as_asked(tmp_path):
    saved(tmp_path / "scene.wive", np.float64, "compressed", "fast")
    path = (tmp_path / "scene.wive").rename(tmp_path / "scene.stl")  # the content counts, not the name
    same = wive.Scene.from_file(path)
    assert same._bvh.source is not None
    assert (same.precision, same.nodes, same.accuracy) == ("float64", "compressed", "fast")
    assert wive.Scene.from_file(str(path), nodes="compressed", dtype=np.float64)._bvh is same._bvh
    for given in (
        {"dtype": np.float32},
        {"nodes": "float32"},
        {"accuracy": "watertight"},
        {"quality": "high"},
    ):
        other = wive.Scene.from_file(path, **given)
        assert other._bvh.source is None
        for name, value in given.items():
            if name not in ("dtype", "quality"):
                assert getattr(other, name) == value
        assert other.precision == ("float32" if "dtype" in given else "float64")
    assert wive.Scene.from_file(path, backend="scalar").backend == "scalar"
    with pytest.raises(TypeError, match="engine"):
        wive.Scene.from_file(path, engine=1)
    with pytest.raises(ValueError, match="nodes"):
        wive.Scene.from_file(path, nodes="small")


def test_commands_take_saved_scenes(tmp_path, capsys):
    path = tmp_path / "scene.wive"
    scene = scene_of(np.float32, "compressed", "fast")
    scene.save(path)
    assert main(["info", str(path)]) == 0
    told = capsys.readouterr().out
    assert (
        "fast" in told and "compressed nodes" in told and re.search(r"^load +[0-9.]+ s$", told, re.MULTILINE)
    )
    assert main(["info", str(path), "--accuracy", "watertight"]) == 0
    assert re.search(r"^build ", capsys.readouterr().out, re.MULTILINE)
    np.save(tmp_path / "rays.npy", np.concatenate(RAYS, axis=1))
    output = tmp_path / "hits.npz"
    assert main(["trace", str(path), str(tmp_path / "rays.npy"), "-o", str(output)]) == 0
    with np.load(output) as hits:
        np.testing.assert_array_equal(hits["t"], scene.intersect(*RAYS).t)


@pytest.mark.skipif(os.name != "posix", reason="modes are POSIX's")
def test_a_read_only_file_in_a_read_only_folder_is_loaded(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    saved(folder / "scene")
    (folder / "scene").chmod(stat.S_IRUSR)
    folder.chmod(stat.S_IRUSR | stat.S_IXUSR)
    try:
        assert len(wive.load(folder / "scene").intersect(*RAYS)) == 500
    finally:
        folder.chmod(stat.S_IRWXU)


def test_a_backend_that_is_not_here_is_named_with_the_file(tmp_path):
    path = tmp_path / "scene"
    path.write_bytes(with_header(saved(path), lambda header: header["options"].update(device="cuda:99")))
    with pytest.raises(ValueError, match=re.escape(str(path))):
        wive.load(path)
    assert wive.load(path, backend="scalar").backend == "scalar"


def test_warp_traces_a_loaded_tree(tmp_path):
    pytest.importorskip("warp")
    path = tmp_path / "scene"
    saved(path)
    found = wive.load(path, device="cpu").intersect(*RAYS)
    np.testing.assert_array_equal(found.prim, scene_of().intersect(*RAYS).prim)


OTHER_PROCESS = """
import pickle, sys, numpy as np, wive
scene, rays = pickle.load(open("pickled", "rb"))
hits = scene.intersect(*rays)
pickle.dump(hits, open("hits", "wb"))
print(scene._bvh.source is not None, float(hits.points()[hits.mask].sum()))
"""


def test_another_process_uses_the_file_and_sends_its_hits_back(tmp_path):
    saved(tmp_path / "scene")
    scene = wive.load(tmp_path / "scene")
    (tmp_path / "pickled").write_bytes(pickle.dumps((scene, RAYS)))
    ran = subprocess.run([sys.executable, "-c", OTHER_PROCESS], cwd=tmp_path, capture_output=True, text=True)
    hits = scene.intersect(*RAYS)
    assert ran.stdout == f"True {float(hits.points()[hits.mask].sum())}\n", ran.stderr
    again = pickle.loads((tmp_path / "hits").read_bytes())
    assert again.vertices is scene.vertices
    np.testing.assert_array_equal(again.points(), hits.points())
    assert ran.stderr == ""


def test_a_scene_of_a_file_pickles_as_its_place(tmp_path):
    path = tmp_path / "scene"
    saved(path, count=1000)
    scene = wive.load(os.path.relpath(path), backend="scalar")
    pickled = pickle.dumps(scene)
    assert len(pickled) < 1000
    again = pickle.loads(pickled)
    assert again._bvh is scene._bvh and again.backend == "scalar"
    for one in (copy.copy(scene), copy.deepcopy(scene)):
        assert one._bvh is scene._bvh
        one.refit(scene.vertices + 1)
    assert_same_hits(scene.intersect(*RAYS), again.intersect(*RAYS))
    wive.Scene(*sphere(1)).save(path)
    assert pickle.loads(pickled)._bvh is scene._bvh  # the process holds the tree that was in the file
    path.unlink()
    assert pickle.loads(pickled)._bvh is scene._bvh
    scene.refit(scene.vertices + 1)  # no longer what was in the file
    assert len(pickle.dumps(scene)) > 10_000


def test_pickles_of_one_path_find_the_tree_that_they_were_made_of(tmp_path):
    path = tmp_path / "scene"
    saved(path, count=1000)
    old = wive.load(path)
    wive.Scene(*sphere(1)).save(path)
    new = wive.load(path)
    pickles = pickle.dumps(old), pickle.dumps(new)
    assert [pickle.loads(data)._bvh for data in pickles] == [old._bvh, new._bvh]
    del old
    gc.collect()  # now only the new file's tree is held, and at its path
    with pytest.raises(ValueError, match="has changed since the scene was pickled"):
        pickle.loads(pickles[0])
    assert pickle.loads(pickles[1])._bvh is new._bvh


def test_a_pickle_of_a_file_that_changed_or_went_is_refused(tmp_path):
    path = tmp_path / "scene"
    whole = saved(path, count=1000)
    pickled = pickle.dumps(wive.load(path))
    wive.Scene(*sphere(1)).save(path)
    with pytest.raises(ValueError, match="has changed since the scene was pickled"):
        pickle.loads(pickled)
    path.unlink()
    with pytest.raises(FileNotFoundError, match=re.escape(str(path)) + ": no such file") as error:
        pickle.loads(pickled)
    assert "\n" not in str(error.value)
    path.write_bytes(whole)
    assert len(pickle.loads(pickled)) == len(wive.load(path))


def test_a_tree_that_nobody_uses_is_let_go(tmp_path):
    from wive._internal import stored_scenes

    saved(tmp_path / "scene")
    scene = wive.load(tmp_path / "scene")
    place = scene._bvh.source.place
    assert place in stored_scenes._held
    del scene
    gc.collect()
    assert place not in stored_scenes._held
