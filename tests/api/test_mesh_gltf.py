"""glTF files: triangles are the document's in its order and place, or the file is refused."""

import tracemalloc

import numpy as np
import pytest
from support.gltf_files import (
    CORNERS,
    LISTED,
    SQUARE,
    Model,
    corners,
    primitive,
    square,
)
from support.refusals import refusal

import wive


def test_triangles_come_in_the_order_of_nodes_primitives_and_indices():
    model, position, indices = square()
    far = model.array(np.add(SQUARE, [0, 0, 100]), "f4")
    near, two = (
        model.mesh(primitive(position, indices)),
        model.mesh(primitive(far, indices), primitive(position, indices)),
    )
    child = model.node(root=False, mesh=near, translation=[0, 0, 2])
    model.node(mesh=near, translation=[0, 0, 9])
    model.node(mesh=near, translation=[0, 0, 1], children=[child])
    model.node(mesh=two)
    vertices, faces = wive.load_mesh(model.glb())
    assert vertices[faces][::2, 0, 2].tolist() == [9, 1, 3, 100, 0]
    assert len(vertices) == 5 * 4  # nothing merged
    assert faces[:, 0].tolist() == [4 * (at // 2) for at in range(10)]


def test_vertices_that_no_triangle_uses_and_degenerate_triangles_stay():
    model = Model()
    position = model.array(np.vstack([[[7, 7, 7]], SQUARE]), "f4")
    model.node(mesh=model.mesh(primitive(position, model.array([1, 2, 3, 2, 2, 2], "u1"))))
    vertices, faces = wive.load_mesh(model.glb())
    assert len(vertices) == 5
    assert faces.tolist() == [[1, 2, 3], [2, 2, 2]]


def test_strips_and_fans_are_taken_apart_as_the_specification_has_it():
    model = Model()
    position = model.array(np.arange(18).reshape(6, 3), "f4")
    strip = primitive(position, model.array([5, 0, 1, 2, 3], "u1"), mode=5)
    fan = primitive(position, mode=6)
    model.node(mesh=model.mesh(strip, fan))
    faces = wive.load_mesh(model.glb())[1]
    assert faces[:3].tolist() == [[5, 0, 1], [0, 2, 1], [1, 2, 3]]
    assert (faces[3:] - 6).tolist() == [[1, 2, 0], [2, 3, 0], [3, 4, 0], [4, 5, 0]]


def test_a_primitive_without_indices_is_a_list_of_its_positions():
    model = Model()
    model.node(mesh=model.mesh(primitive(model.array(SQUARE[LISTED], "f4"))))
    vertices, faces = wive.load_mesh(model.glb())
    assert faces.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert (vertices[faces] == CORNERS).all()


def test_points_and_lines_and_primitives_without_positions_have_no_triangles():
    model, position, indices = square()
    others = [primitive(position, indices, mode=mode) for mode in (0, 1, 2, 3)]
    model.node(mesh=model.mesh(*others, {"attributes": {}}, primitive(position, indices)))
    assert len(wive.load_mesh(model.glb())[0]) == 4
    model.json["meshes"][0]["primitives"].pop()
    assert "has no triangles" in refusal(model.glb())


def test_matrices_of_nodes_are_multiplied_in_double_precision():
    model, position, indices = square()
    mesh = model.mesh(primitive(position, indices))
    turn = [0, 0, np.sqrt(0.5), np.sqrt(0.5)]  # a quarter about z
    inner = model.node(root=False, mesh=mesh, scale=[2, 3, 4])
    middle = model.node(root=False, rotation=turn, children=[inner])
    column_major = [1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 1e8, 5, 6, 1]  # y to z, z to -y
    model.node(matrix=column_major, children=[middle])
    x, y = SQUARE.astype(np.float64).T[:2] * [[2], [3]]
    expected = np.stack([-y + 1e8, 0 * x + 5, x + 6], axis=1)
    assert np.abs(wive.load_mesh(model.glb(), np.float64)[0] - expected).max() < 1e-7


def test_the_last_row_of_a_matrix_may_have_been_rounded():
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(position, indices)), matrix=[*np.eye(4).ravel()[:15], 0.9999999])
    assert (wive.load_mesh(model.glb())[0] == SQUARE).all()


def test_normals_of_mirrored_meshes_point_outwards():
    model, position, indices = square()
    mesh = model.mesh(primitive(position, indices))
    once = model.node(root=False, mesh=mesh, scale=[-1, 1, 1])
    model.node(mesh=mesh)
    model.node(children=[once])
    twice = model.node(root=False, mesh=mesh, scale=[1, -1, 1])
    model.node(scale=[-1, 1, 1], children=[twice])
    vertices, faces = wive.load_mesh(model.glb())
    assert faces.tolist()[2:4] == [[4, 6, 5], [4, 7, 6]]
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_vertices_shared_by_two_primitives_are_placed_alike():
    model = Model()
    points = np.random.default_rng(1).normal(size=(1000, 3)).astype(np.float32)
    first, second = model.array(points, "f4"), model.array(points[17:500], "f4")
    indices = model.array(np.arange(483) // 3 * 3, "u2")
    rotation = [0.18257419, 0.36514837, 0.54772256, 0.73029674]
    model.node(
        mesh=model.mesh(primitive(first, indices), primitive(second, indices)),
        rotation=rotation,
        translation=[0.1, 1e5, 3],
    )
    vertices = wive.load_mesh(model.glb(), np.float64)[0]
    assert (vertices[17:500] == vertices[1000:]).all()


def test_the_default_scene_is_read_or_the_first_one_or_all_roots():
    model, position, indices = square()
    mesh = model.mesh(primitive(position, indices))
    child = model.node(root=False, mesh=mesh, translation=[0, 0, 1])
    for z in (10, 20):
        model.node(root=False, mesh=mesh, translation=[0, 0, z])
    model.node(root=False, children=[child])
    model.json["scenes"] = [{"nodes": [2]}, {"nodes": [1]}]
    seen = {}
    for name, change in {"1": {"scene": 1}, "0": {"scene": 0}, "none": {"scene": None}}.items():
        model.json.update(change)
        if model.json["scene"] is None:
            del model.json["scene"]
        seen[name] = corners(model.glb())[::2, 0, 2].tolist()
    del model.json["scenes"]
    seen["no scenes"] = corners(model.glb())[::2, 0, 2].tolist()
    assert seen == {"1": [10], "0": [20], "none": [20], "no scenes": [10, 20, 1]}
    del model.json["nodes"]
    assert (corners(model.glb()) == CORNERS).all()


def test_instances_on_the_gpu_are_instances():
    model, position, indices = square()
    instancing = {
        "TRANSLATION": model.array([[0, 0, 1], [0, 0, 2], [0, 0, 3]], "f4"),
        "ROTATION": model.array([[0, 0, 0, 127], [127, 0, 0, 0], [0, 0, 0, 127]], "i1", normalized=True),
        "SCALE": model.array([[1, 1, 1], [1, 1, 1], [-2, 2, 2]], "f4"),
    }
    model.node(
        mesh=model.mesh(primitive(position, indices)),
        translation=[100, 0, 0],
        extensions={"EXT_mesh_gpu_instancing": {"attributes": instancing}},
    )
    model.json["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    vertices, faces = wive.load_mesh(model.glb())
    expected = [
        np.add(SQUARE, [100, 0, 1]),
        SQUARE * [1, -1, 1] + [100, 0, 2],
        SQUARE * [-2, 2, 2] + [100, 0, 3],
    ]
    assert vertices.tolist() == np.concatenate(expected).tolist()
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [8, 10, 9], [8, 11, 10]]


def test_instances_with_attributes_of_their_own_alone_are_copies_in_place():
    model, position, indices = square()
    instancing = {"attributes": {"_ID": model.array([5, 6, 7], "u2")}}
    mesh = model.mesh(primitive(position, indices))
    model.node(mesh=mesh, extensions={"EXT_mesh_gpu_instancing": instancing})
    assert corners(model.glb()).tolist() == np.tile(CORNERS, (3, 1, 1)).tolist()
    instancing["attributes"]["SCALE"] = model.array(np.ones((2, 3)), "f4")
    assert "EXT_mesh_gpu_instancing: expected attributes of one count, found [2, 3]" in refusal(model.glb())


def test_many_copies_keep_their_order():
    model, position, indices = square()
    steps = np.arange(3 * 40_000).reshape(-1, 3)
    instancing = {"attributes": {"TRANSLATION": model.array(steps, "f4")}}
    model.node(
        mesh=model.mesh(primitive(position, indices)), extensions={"EXT_mesh_gpu_instancing": instancing}
    )
    expected = CORNERS[None] + steps[:, None, None, :]
    assert (corners(model.glb()) == expected.reshape(-1, 3, 3)).all()


def test_hidden_nodes_are_left_out():
    model, position, indices = square()
    mesh = model.mesh(primitive(position, indices))
    child = model.node(root=False, mesh=mesh)
    hidden = {"KHR_node_visibility": {"visible": False}}
    model.node(mesh=mesh, children=[child], extensions=hidden)
    model.node(mesh=mesh, translation=[0, 0, 4], extensions={"KHR_node_visibility": {}})
    assert corners(model.glb())[:, 0, 2].tolist() == [4, 4]


def test_a_chain_of_a_hundred_thousand_nodes_is_read():
    model, position, indices = square()
    model.json["nodes"] = [{"children": [at + 1]} for at in range(100_000)]
    model.json["nodes"][99]["translation"] = [0, 0, 5]
    model.json["nodes"].append({"mesh": model.mesh(primitive(position, indices))})
    model.json["scenes"][0]["nodes"] = [0]
    assert (corners(model.glb()) == np.add(CORNERS, [0, 0, 5])).all()


def test_nodes_with_two_parents_or_in_a_circle_are_refused():
    model, position, indices = square()
    shared = model.node(root=False, mesh=model.mesh(primitive(position, indices)))
    model.node(children=[shared])
    model.node(children=[shared])
    assert refusal(model.glb()).startswith("nodes[0]: is reached a second time, by nodes[2]")
    model.json["nodes"] = [{"children": [1]}, {"children": [0]}]
    del model.json["scenes"], model.json["scene"]
    assert refusal(model.glb()).startswith("nodes: each is a child of another")


@pytest.mark.parametrize(("dtype", "restart"), [("u1", 255), ("u2", 65535), ("u4", 2**32 - 1)])
def test_primitive_restart_is_refused(dtype, restart):
    model = Model()
    position = model.array(np.zeros((70_000, 3)), "f4")
    strip = primitive(position, model.array([0, 1, 2, restart, 3, 4, 5], dtype), mode=5)
    model.node(mesh=model.mesh(strip))
    assert refusal(model.glb()).startswith(
        f"accessors[1]: has the index {restart}, which restarts a primitive"
    )


def test_copies_beyond_the_range_of_indices_are_refused_before_they_are_made():
    model = Model()
    position = model.accessor(componentType=5126, count=3_000_000, type="VEC3")
    mesh = model.mesh(primitive(position))
    for _ in range(1000):
        model.node(mesh=mesh)
    assert refusal(model.glb()).startswith("scene: has 3000000000 vertices and 1000000000 triangles")


@pytest.mark.parametrize(
    "name", ["KHR_materials_unlit", "KHR_texture_basisu", "EXT_texture_webp", "KHR_lights_punctual"]
)
def test_required_extensions_of_materials_and_lights_change_nothing(name):
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(position, indices, extensions={name: {}}), extensions={name: {}}))
    model.json["extensionsRequired"] = [name]
    assert (corners(model.glb()) == CORNERS).all()


def test_what_the_scene_does_not_use_may_be_anything():
    model, position, indices = square()
    model.node(mesh=model.mesh(primitive(position, indices)))
    model.json["accessors"].append({"count": -1})
    model.json["bufferViews"].append(None)
    model.json["meshes"].append({"primitives": 3})
    model.json["nodes"].append({"mesh": 99})
    model.json["buffers"].append({"uri": "../animation.bin", "byteLength": 10**15})
    assert (corners(model.glb()) == CORNERS).all()


def test_instances_beyond_the_range_of_indices_are_refused_before_their_matrices_are_made():
    model = Model()
    position = model.accessor(componentType=5126, count=30_000, type="VEC3")
    mesh = model.mesh(primitive(position))
    instancing = {"attributes": {"TRANSLATION": model.array(np.zeros((1000, 3)), "f4")}}
    for _ in range(400):
        model.node(mesh=mesh, extensions={"EXT_mesh_gpu_instancing": instancing})
    data = model.glb()
    tracemalloc.start()
    assert refusal(data).startswith("scene: has 12000000000 vertices")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 5_000_000
