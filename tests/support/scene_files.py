"""Small files of scenes, with what their readers follow: sparse arrays, skins, copies, components, strips."""

import base64
import io
import json
import zipfile
from collections.abc import Callable

import numpy as np

from support import dae_files, threemf_files
from support.gltf_files import Model, primitive

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
FACES = [[0, 1, 2], [0, 2, 3]]


def model() -> Model:
    """A document with what the reader follows: sparse values, instances, a skin, a morph target."""
    model = Model()
    position, indices = model.array(POINTS, "f4"), model.array(np.ravel(FACES), "u2")
    sparse = {
        "count": 1,
        "indices": {"bufferView": model.view(b"\2\0"), "componentType": 5123},
        "values": {"bufferView": model.view(np.float32([3, 3, 0]).tobytes())},
    }
    moved = model.accessor(**{**model.json["accessors"][position], "sparse": sparse})
    small = model.array(POINTS * 100, "u1", normalized=True)
    rigid = {
        "JOINTS_0": model.array(np.zeros((4, 4)), "u1"),
        "WEIGHTS_0": model.array(np.tile([1, 0, 0, 0], (4, 1)), "f4"),
    }
    first = model.mesh(primitive(moved, indices), primitive(small, mode=5))
    second = model.mesh(primitive(position, indices, targets=[{"POSITION": moved}]), weights=[0.5])
    third = model.mesh({"attributes": {"POSITION": position, **rigid}, "mode": 6})
    child = model.node(root=False, mesh=first, rotation=[0, 0, 0.6, 0.8])
    model.node(mesh=second, scale=[1, -1, 1], children=[child])
    model.json["skins"] = [
        {"joints": [child], "inverseBindMatrices": model.array(np.eye(4).reshape(1, 16), "f4")}
    ]
    model.node(mesh=third, skin=0)
    shifts = {"attributes": {"TRANSLATION": model.array([[0, 0, 1], [0, 0, 2]], "f4")}}
    model.node(mesh=first, extensions={"EXT_mesh_gpu_instancing": shifts})
    return model


def gltf() -> bytes:
    whole = model()
    whole.json["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(whole.blob).decode()
    return json.dumps(whole.json).encode()


def threemf() -> bytes:
    return threemf_files.package(threemf_model())


def threemf_model() -> str:
    objects = {
        "1": threemf_files.mesh(POINTS, FACES),
        "2": threemf_files.components('objectid="1"', 'objectid="1"'),
    }
    return threemf_files.model(objects, ['objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0 5"', 'objectid="1"'])


def threemf_stored() -> bytes:
    """The package without compression, so that damage reaches the XML, and without checksums' help."""
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(threemf())) as packed, zipfile.ZipFile(file, "w") as archive:
        for name in packed.namelist():
            archive.writestr(name, packed.read(name))
    return file.getvalue()


def dae() -> bytes:
    kinds = [
        dae_files.primitive("polylist", [0, 1, 2, 3], vcount=[4]),
        dae_files.primitive("tristrips", [0, 1, 2, 3]),
    ]
    shape = dae_files.geometry("a", POINTS, *kinds)
    inner = dae_files.node("<rotate>0 0 1 30</rotate>", dae_files.draw("a"), key="n")
    return dae_files.document(shape, inner + '<instance_node url="#n"/>').encode()


# Name, kind and maker of each.
FILES: dict[str, tuple[str, Callable[[], bytes]]] = {
    "glb": ("glb", lambda: model().glb()),
    "gltf": ("gltf", gltf),
    "3mf": ("3mf", threemf),
    "3mf, stored": ("3mf", threemf_stored),
    "dae": ("dae", dae),
}
