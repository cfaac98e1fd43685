"""3MF files: triangles are those of the build's items, in order and place, or the file is refused."""

import io
import tracemalloc
import zipfile

import numpy as np
import pytest
from support.refusals import refusal
from support.threemf_files import components, mesh, model, package

import wive

POINTS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9]]
FACES = [[0, 1, 2], [2, 1, 0]]
MESH = mesh(POINTS, FACES)


def heights(data: bytes) -> list[float]:
    vertices, faces = wive.load_mesh(data, np.float64)
    return vertices[faces][::2, 0, 2].tolist()


def refused(data: bytes) -> str:
    return refusal(data, "3mf")


def up(z: float) -> str:
    return f'transform="1 0 0 0 1 0 0 0 1 0 0 {z}"'


def test_items_and_components_come_in_order_each_with_all_its_vertices():
    objects = {
        "5": MESH,
        "2": mesh(np.add(POINTS, [0, 0, 100]), FACES),
        "7": components('objectid="2"', f'objectid="5" {up(10)}', f'objectid="5" {up(20)}'),
        "8": components(f'objectid="7" {up(1000)}', 'objectid="5"'),
    }
    items = ['objectid="7"', f'objectid="5" {up(3)}', f'objectid="8" {up(1)}']
    data = package(model(objects, items))
    assert heights(data) == [100, 10, 20, 3, 1101, 1011, 1021, 1]
    vertices, faces = wive.load_mesh(data)
    assert len(vertices) == 4 * 8
    assert faces.tolist() == [[a + 4 * at for a in row] for at in range(8) for row in FACES]


def test_transforms_are_those_of_row_vectors_and_inner_ones_come_first():
    inner = 'objectid="1" transform="0 2 0 -1 0 0 0 0 3 10 0 0"'  # x to 2y, y to -x, z to 3z, then x + 10
    objects = {"1": MESH, "2": components(inner)}
    data = package(model(objects, ['objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0.5 0"']))
    expected = [[10, 0.5, 0], [10, 2.5, 0], [9, 0.5, 0], [1, 18.5, 27]]
    assert wive.load_mesh(data, np.float64)[0].tolist() == expected


def test_normals_of_mirrored_items_point_outwards():
    data = package(model({"1": MESH}, ['objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"']))
    assert wive.load_mesh(data)[1].tolist() == [[0, 2, 1], [2, 0, 1]]


def test_parts_of_the_production_extension_are_read():
    part = model({"1": mesh(np.add(POINTS, [0, 0, 50]), FACES), "2": components('objectid="1"')}, [])
    objects = {"1": MESH, "3": components('objectid="2" p:path="/3D/Objects/a.model"', 'objectid="1"')}
    items = ['objectid="3"', 'objectid="1" p:path="/3d/objects/A.model"']
    root = model(objects, items, 'requiredextensions="p"')
    data = package(root, **{"3D__Objects__a.model": part, "3D__Objects__b.model": "not read"})
    assert heights(data) == [50, 0, 50]


def test_the_root_part_is_what_the_package_says_or_the_usual_one():
    other = package(
        model({"1": MESH}, ['objectid="1"']), target="/Other/My.Model", **{"3D__3dmodel.model": "x"}
    )
    assert heights(other) == [0]
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("3D/3DModel.model", model({"1": MESH}, ['objectid="1"']))
    assert heights(file.getvalue()) == [0]


def test_other_encodings_prefixes_and_foreign_elements_are_ordinary():
    text = model({"1": MESH, "9": "<other/>"}, ['objectid="1"'])
    foreign = 'xmlns:v="http://example.org/v"'
    inner = MESH.replace("<mesh>", "<mesh><!-- é -->").replace(
        "</mesh>", '<v:more x="1"><vertex/></v:more></mesh>'
    )
    prefixed = (
        text.replace("<", "<c:").replace("<c:/", "</c:").replace("<c:?", "<?").replace("xmlns=", "xmlns:c=")
    )
    for root in (
        text.replace("UTF-8", "UTF-16").encode("utf-16"),
        b"\xef\xbb\xbf" + text.encode(),
        text.replace("UTF-8", "ISO-8859-1").replace("Title", "Täger").encode("latin-1"),
        text.replace(' xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"', ""),
        prefixed,
        model({"1": inner}, ['objectid="1"'], declared=foreign),
    ):
        assert heights(package(root)) == [0]


@pytest.mark.parametrize(
    ("objects", "items", "expected"),
    [
        ({"1": MESH}, [], "build: has no item, so no object is placed"),
        ({"1": MESH}, ['objectid="2"'], "3D/3dmodel.model: line 4: item 0: object '2' is not defined"),
        ({"1": MESH}, ["partnumber='3'"], "line 4: item: expected an attribute 'objectid'"),
        (
            {"1": MESH},
            ['objectid="1" transform="1 0 0"'],
            "line 4: item 0: transform: expected 12 numbers, found 3",
        ),
        ({"1": MESH}, [f'objectid="1" {up(0)}'.replace("1 0 0 0", "nan 0 0 0")], "expected finite numbers"),
        (
            {"1": MESH, "2": components('objectid="2"')},
            ['objectid="2"'],
            "object 2: is a component of itself",
        ),
        (
            {"1": MESH, "2": components('objectid="3"'), "3": components('objectid="1"', 'objectid="2"')},
            ['objectid="2"'],
            "is a component of itself",
        ),
        (
            {"1": MESH.replace('x="1"', 'x="one"')},
            ['objectid="1"'],
            "3D/3dmodel.model: object 1: could not convert",
        ),
        (
            {"1": MESH.replace('x="1"', 'x="inf"')},
            ['objectid="1"'],
            "object 1: expected finite numbers, found 'inf'",
        ),
        ({"1": MESH.replace(' z="9"', "")}, ['objectid="1"'], "line 2: vertex: expected an attribute 'z'"),
        (
            {"1": mesh(POINTS, [[0, 1, 2], [0, 1, 4]])},
            ['objectid="1"'],
            "object 1: triangle 1: expected indices below 4",
        ),
        (
            {"1": mesh(POINTS, [[0, 1, -2]])},
            ['objectid="1"'],
            "object 1: triangle 0: expected indices below 4, found",
        ),
        (
            {"1": mesh(POINTS, [[0, 1, 1.5]])},
            ['objectid="1"'],
            "object 1: triangle 0: expected indices below 4, found",
        ),
        ({"1": MESH + MESH}, ['objectid="1"'], "object 1: has a second mesh"),
        ({"1&#10;2": MESH + MESH}, ['objectid="1"'], "object 1\\n2: has a second mesh"),
        ({"1": mesh(POINTS, [])}, ['objectid="1"'], "has no triangles"),
        ({"1": MESH + "</object><object id='1'>"}, ['objectid="1"'], "a second object '1'"),
        (
            {"1": MESH},
            ['objectid="1" p:path="/3D/none.model"'],
            "refers to '/3D/none.model', which is not in the",
        ),
    ],
)
def test_what_a_model_gets_wrong_is_named(objects, items, expected):
    assert expected in refused(package(model(objects, items)))


def test_shapes_and_extensions_that_are_not_triangles_are_refused():
    beams = 'xmlns:b="http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02"'
    lattice = {"1": MESH.replace("</mesh>", "<b:beamlattice/></mesh>")}
    assert "has a beamlattice" in refused(
        package(model(lattice, ['objectid="1"'], 'requiredextensions="b"', beams))
    )
    assert heights(
        package(model(lattice | {"2": MESH}, ['objectid="2"'], 'requiredextensions="b"', beams))
    ) == [0]
    secure = 'xmlns:s="http://schemas.microsoft.com/3dmanufacturing/securecontent/2019/04"'
    data = package(model({"1": MESH}, ['objectid="1"'], 'requiredextensions="s"', secure))
    assert (
        "requires the extension 'http://schemas.microsoft.com/3dmanufacturing/securecontent/2019/04'"
        in refused(data)
    )
    boolean = 'xmlns:o="http://schemas.3mf.io/3dmanufacturing/booleanoperations/2023/07"'
    data = package(model({"1": '<o:booleanshape objectid="2"/>', "2": MESH}, ['objectid="1"'], "", boolean))
    assert "object 1: has a booleanshape" in refused(data)


def test_copies_beyond_the_range_of_indices_are_refused_before_they_are_made():
    doubled = {"0": MESH} | {str(n + 1): components(*[f'objectid="{n}"'] * 2) for n in range(60)}
    data = package(model(doubled, ['objectid="60"']))
    assert f"has {4 * 2**60} vertices and {2 * 2**60} triangles, expected at most 2147483647" in refused(data)
    empty = {"0": mesh([], [])} | {str(n + 1): components(*[f'objectid="{n}"'] * 2) for n in range(60)}
    assert "has no triangles" in refused(package(model(empty, ['objectid="60"'])))


def test_components_nested_twenty_thousand_deep_are_read():
    nested = {"0": MESH} | {str(n + 1): components(f'objectid="{n}"') for n in range(20_000)}
    assert heights(package(model(nested, ['objectid="20000"']))) == [0]


def test_no_more_is_unpacked_than_is_needed_or_than_a_mesh_can_be():
    data = package(model({"1": MESH}, ['objectid="1"']), **{"Metadata__picture.png": bytes(1 << 27)})
    tracemalloc.start()
    assert heights(data) == [0]
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1 << 24
    entry = data.index(b"PK\x01\x02", data.index(b"3D/3dmodel.model") + 100)
    at = data.rindex(b"PK\x01\x02", 0, data.rindex(b"3D/3dmodel.model"))
    assert entry <= at
    bomb = bytearray(data)
    bomb[at + 20 : at + 28] = (20 << 20).to_bytes(4, "little") + (2 << 30).to_bytes(4, "little")
    assert "archive: 3D/3dmodel.model: " in refused(bytes(bomb))


def test_document_types_are_refused():
    bomb = '<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'
    text = model({"1": MESH}, ['objectid="1"']).replace("?>\n", f"?>\n{bomb}")
    assert "3D/3dmodel.model: line 2: has a document type declaration" in refused(package(text))


def test_damaged_packages_are_refused():
    text = model({"1": MESH}, ['objectid="1"'])
    data = package(text)
    assert "archive: expected a 3MF package" in refused(data[:-30])
    assert "archive: expected a 3MF package" in refused(b"no archive")
    assert "line 4: expected XML (" in refused(package(text[:-20]))
    assert "line 1: expected XML (" in refused(package(b"\0\1\2"))
    assert "unknown encoding: x-none: save the file as UTF-8" in refused(
        package(text.replace("UTF-8", "x-none"))
    )
    assert "expected an element `model` first" in refused(package("<a/>"))
    assert "expected a model part" in refused(package(text, target="/a.txt").replace(b".rels", b".rel_"))
    encrypted = data.replace(b"\x14\0\0\0\x08\0", b"\x14\0\1\0\x08\0")
    assert "archive: _rels/.rels: is encrypted" in refused(encrypted)


def test_meshes_of_many_rows_are_read_whole():
    random = np.random.default_rng(1)
    points = random.normal(size=(12_000, 3))
    faces = random.integers(12_000, size=(12_000, 3))
    vertices, read = wive.load_mesh(package(model({"1": mesh(points, faces)}, ['objectid="1"'])), np.float64)
    assert (vertices == points).all() and (read == faces).all()


def test_copies_of_copies_without_number_are_refused_before_they_are_made():
    objects = {"0": mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), "empty": components()}
    for level in range(25):
        objects[str(level + 1)] = components(*[f'objectid="{level}"'] * 2)
    assert "scene: places its copies in" in refused(package(model(objects, ['objectid="25"'])))
    objects = {"0": objects["0"], "empty": components()}
    objects["1"] = components('objectid="0"', *['objectid="empty"'] * 5000)
    objects["2"] = components(*['objectid="1"'] * 5000)
    assert "scene: places its copies in" in refused(package(model(objects, ['objectid="2"'])))
