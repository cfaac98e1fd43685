"""Poses of glTF files: morph targets by their default weights, skins by their joints, or a refusal."""

import numpy as np
import pytest
from support.gltf_files import SQUARE, Model, primitive, square
from support.refusals import refusal

import wive


def test_default_weights_move_morph_targets():
    model, position, indices = square()
    up, aside = model.array(SQUARE * 0 + [0, 0, 1], "f4"), model.array(SQUARE * 0 + [1, 0, 0], "f4")
    targets = [{"POSITION": up}, {"NORMAL": up}, {"POSITION": aside}]
    mesh = model.mesh(primitive(position, indices, targets=targets), weights=[0.5, 1, 0])
    model.node(mesh=mesh)
    model.node(mesh=mesh, weights=[0, 0, 2])
    model.node(mesh=mesh, weights=[0, 0, 0])
    vertices = wive.load_mesh(model.glb())[0]
    assert (
        vertices.tolist()
        == np.concatenate([np.add(SQUARE, [0, 0, 0.5]), np.add(SQUARE, [2, 0, 0]), SQUARE]).tolist()
    )


def skinned() -> tuple[Model, dict]:
    """A square with a skin of two joints, at heights of 1 and 6, and the attributes of its primitive."""
    model, position, indices = square()
    joints = model.array([[0, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0], [0, 1, 9, 9]], "u1")
    weights = [[255, 0, 0, 0], [255, 0, 0, 0], [255, 0, 0, 0], [51, 204, 0, 0]]
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, :3, 3] = [0, 0, -3]
    bound = model.array(bind.transpose(0, 2, 1).reshape(2, 16), "f4")
    attributes = {
        "POSITION": position,
        "JOINTS_0": joints,
        "WEIGHTS_0": model.array(weights, "u1", normalized=True),
    }
    mesh = model.mesh({"attributes": attributes, "indices": indices})
    tip = model.node(root=False, translation=[0, 0, 5])
    hip = model.node(translation=[0, 0, 1], children=[tip])
    model.json["skins"] = [{"joints": [hip, tip], "inverseBindMatrices": bound}]
    model.node(mesh=mesh, skin=0, translation=[1000, 0, 0])  # has no say: joints do
    return model, attributes


def vertices(model: Model) -> np.ndarray:
    return wive.load_mesh(model.glb(), np.float64)[0]


def test_skins_are_in_the_pose_of_their_joints():
    model, _ = skinned()
    expected = SQUARE + np.array([[0, 0, 1], [0, 0, 3], [0, 0, 3], [0, 0, 2.6]])
    assert np.abs(vertices(model) - expected).max() < 1e-12
    del model.json["skins"][0]["inverseBindMatrices"]
    expected = SQUARE + np.array([[0, 0, 1], [0, 0, 6], [0, 0, 6], [0, 0, 5]])
    assert np.abs(vertices(model) - expected).max() < 1e-12


def test_weights_of_a_skin_are_a_mean_over_all_sets():
    model, attributes = skinned()
    attributes["JOINTS_1"] = model.array(np.ones((4, 4)), "u2")
    attributes["WEIGHTS_1"] = model.array(np.tile([1, 0, 0, 0], (4, 1)), "f4")
    heights = [(1 + 3) / 2, 3, 3, (0.2 * 1 + 1.8 * 3) / 2]
    assert np.abs(vertices(model)[:, 2] - heights).max() < 1e-12


def test_normals_of_meshes_that_joints_mirror_point_outwards():
    model, _ = skinned()
    assert wive.load_mesh(model.glb())[1].tolist() == [[0, 1, 2], [0, 2, 3]]
    for node in model.json["nodes"]:
        node["scale"] = [-1, 1, 1]
    model.json["nodes"][0]["scale"] = [1, 1, 1]
    assert wive.load_mesh(model.glb())[1].tolist() == [[0, 2, 1], [0, 3, 2]]


@pytest.mark.parametrize(
    ("key", "value", "dtype", "expected"),
    [
        ("JOINTS_0", np.full((4, 4), 2), "u1", "JOINTS_0: expected integers below 2, the number of joints"),
        ("JOINTS_0", np.zeros((4, 4)), "f4", "JOINTS_0: expected integers below 2, the number of joints"),
        ("JOINTS_0", np.zeros((3, 4)), "u1", "JOINTS_0: expected 4 values, one per position, found 3"),
        (
            "JOINTS_0",
            None,
            None,
            "expected a skin's JOINTS_0 and WEIGHTS_0 with a sum of 1, found a sum of 0",
        ),
        ("WEIGHTS_0", np.zeros((4, 4)), "f4", "expected a skin's JOINTS_0 and WEIGHTS_0 with a sum of 1"),
        ("WEIGHTS_0", None, None, "has no WEIGHTS_0, which its other joints and weights need"),
    ],
)
def test_joints_and_weights_that_pose_nothing_are_refused(key, value, dtype, expected):
    model, attributes = skinned()
    if value is None:
        del attributes[key]
    else:
        attributes[key] = model.array(value, dtype)
    assert refusal(model.glb()).startswith(f"meshes[0].primitives[0]: {expected}")


def test_skins_that_do_not_fit_their_nodes_are_refused():
    model, _ = skinned()
    skin = model.json["skins"][0]
    skin["inverseBindMatrices"] = model.array(np.eye(4).reshape(1, 16), "f4")
    assert "expected 2 matrices of floats for skins[0]" in refusal(model.glb())
    skin["joints"] = [0, 3]
    model.node(root=False)
    assert refusal(model.glb()).startswith("skins[0]: joints: expected nodes of the scene, found 3")
    skin["joints"] = []
    assert refusal(model.glb()).startswith("skins[0]: joints: expected nodes of the scene, found none")
    model.json["nodes"][2]["extensions"] = {"EXT_mesh_gpu_instancing": {}}
    assert refusal(model.glb()).startswith(
        "nodes[2]: EXT_mesh_gpu_instancing: is not read together with a skin"
    )


def test_morph_targets_of_another_length_are_refused():
    model, position, indices = square()
    targets = [{"POSITION": model.array(SQUARE[:3], "f4")}]
    model.node(mesh=model.mesh(primitive(position, indices, targets=targets), weights=[1]))
    assert refusal(model.glb()).startswith(
        "meshes[0].primitives[0]: targets[0]: expected 4 positions, found 3"
    )
    model.json["meshes"][0]["weights"] = [0]
    assert (vertices(model) == SQUARE).all()
