"""Colours of COLLADA files: diffuse colours of effects, colours of vertices and corners."""

import re
from pathlib import Path

import numpy as np
import pytest
from support.dae_files import document, geometry, node, primitive, source
from support.damaged_colours import check_damaged

import wive

POINTS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
HALF = 0.8 * ((0.5 + 0.055) / 1.055) ** 2.4  # IEC 61966-2-1, by hand, times the reflectance of white
RED, BLUE, GREEN, GRAY, NONE = [0.8, 0, 0], [0, 0, 0.8], [0, 0.8, 0], [HALF] * 3, [0.6] * 3
FIRST, SECOND = (primitive("triangles", [0, *corners]) for corners in ([1, 2], [2, 3]))


def effect(key: str, colour: str, shader: str = "phong", shown: str = "diffuse", more: str = "") -> str:
    return (
        f'<effect id="{key}"><profile_COMMON>{more}<technique sid="common"><{shader}>'
        f"<{shown}>{colour}</{shown}></{shader}></technique></profile_COMMON></effect>"
    )


def coloured(geometries: str, nodes: str, effects: str) -> bytes:
    """A document with these effects, and a material `m-KEY` of each."""
    keys = re.findall('effect id="(.*?)"', effects)
    materials = "".join(f'<material id="m-{key}"><instance_effect url="#{key}"/></material>' for key in keys)
    library = (
        f"<library_materials>{materials}</library_materials><library_effects>{effects}</library_effects>"
    )
    text = document(geometries, nodes)
    return text.replace("<library_geometries>", f"{library}<library_geometries>").encode()


def draw(key: str, **bound: str) -> str:
    """An instance of a geometry with symbols bound to materials."""
    bindings = "".join(
        f'<instance_material symbol="{symbol}" target="{target}"/>' for symbol, target in bound.items()
    )
    return (
        f'<instance_geometry url="#{key}"><bind_material><technique_common>{bindings}'
        "</technique_common></bind_material></instance_geometry>"
    )


def of(primitive: str, symbol: str) -> str:
    return primitive.replace("count=", f'material="{symbol}" count=')


def colour(text: str) -> str:
    return f'<color sid="c">{text}</color>'


SQUARE = geometry("g", POINTS, of(FIRST, "a"), of(SECOND, "b"))
EFFECTS = effect("red", colour("1 0 0 1")) + effect("half", colour("0.5 0.5 0.5"))


def test_each_instance_binds_materials_of_its_own():
    nodes = node(draw("g", a="#m-red", b="#m-half")) + node(draw("g", b="#m-red", c="#m-half"))
    data = coloured(SQUARE, nodes, EFFECTS)
    found = wive.load_colors(data)
    assert found.dtype == np.float32
    assert found.shape == (len(wive.load_mesh(data)[1]), 1, 3)
    np.testing.assert_allclose(found[:, 0], [RED, GRAY, NONE, RED], rtol=1e-6)


@pytest.mark.parametrize("shader", ["lambert", "phong", "blinn", "constant"])
def test_the_colour_of_each_shader_is_read(shader):
    shown = "emission" if shader == "constant" else "diffuse"
    effects = effect("e", colour("0.5 0.5 0.5 1"), shader, shown)
    found = wive.load_colors(coloured(SQUARE, node(draw("g", a="#m-e", b="#m-e")), effects))
    np.testing.assert_allclose(found[:, 0], [GRAY, GRAY], rtol=1e-6)


def test_a_colour_may_be_a_parameter():
    parameter = '<newparam sid="p"><float3>0 0 1</float3></newparam>'
    effects = effect("e", '<param ref="p"/>', more=parameter)
    found = wive.load_colors(coloured(SQUARE, node(draw("g", a="#m-e")), effects))
    np.testing.assert_allclose(found[:, 0], [BLUE, NONE], rtol=1e-6)


def with_colours(kind: str, text: str) -> str:
    """A geometry of the square's points whose vertices, or corners at offset 1, have these colours."""
    rows = [[float(number) for number in row.split()] for row in text.split(",")]
    colours = source(rows, "k", params="RGBA"[: len(rows[0])])
    if kind == "vertices":
        shape = geometry("g", POINTS, of(primitive("polylist", [0, 1, 2, 3], vcount=[4]), "a"))
        shape = shape.replace("</vertices>", '<input semantic="COLOR" source="#k"/></vertices>')
    else:
        listed = "<p>0 0 1 0 2 1 3 2</p>"
        shape = geometry("g", POINTS, of(primitive("polylist", [0, 1, 2, 3], vcount=[4]), "a"))
        shape = re.sub("<p>.*?</p>", listed, shape).replace('"NORMAL" source="#n"', '"COLOR" source="#k"')
    return shape.replace("<vertices", f"{colours}<vertices")


def test_colours_of_vertices_are_multiplied_by_those_of_the_material():
    shape = with_colours("vertices", "1 0 0 1, 0 1 0 1, 0 0 1 1, 0.5 0.5 0.5 0")
    found = wive.load_colors(coloured(shape, node(draw("g")), ""))
    np.testing.assert_allclose(found, [RED, GREEN, BLUE, GRAY], rtol=1e-6)
    found = wive.load_colors(coloured(shape, node(draw("g", a="#m-half")), EFFECTS))
    expected = np.array([RED, GREEN, BLUE, GRAY]) * HALF / 0.8
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_colours_of_corners_follow_their_polygon():
    found = wive.load_colors(coloured(with_colours("corners", "1 0 0, 0 1 0, 0 0 1"), node(draw("g")), ""))
    np.testing.assert_allclose(found, [RED, RED, GREEN, BLUE], rtol=1e-6)


def test_colours_of_corners_that_disagree_are_means_of_triangles():
    shape = geometry("g", POINTS, primitive("triangles", [0, 1, 2, 0, 2, 3]))
    shape = re.sub("<p>.*?</p>", "<p>0 0 1 0 2 1 0 2 2 2 3 1</p>", shape)
    shape = shape.replace('"NORMAL" source="#n"', '"COLOR" source="#k"')
    shape = shape.replace(
        "<vertices", source([[1, 0, 0], [0, 1, 0], [0, 0, 1]], "k", params="RGB") + "<vertices"
    )
    found = wive.load_colors(coloured(shape, node(draw("g")), ""))
    expected = np.array([[1.6, 0.8, 0], [0, 0.8, 1.6]]) / 3
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-6)


@pytest.mark.parametrize("target", ["#none", "other.dae#m-red", "#red", "", "#g"])
def test_materials_that_are_not_in_the_file_have_no_colour(target):
    data = coloured(SQUARE, node(draw("g", a=target)), EFFECTS)
    assert wive.load_colors(data) is None
    data = coloured(SQUARE, node(draw("g", a=target, b="#m-red")), EFFECTS)
    np.testing.assert_allclose(wive.load_colors(data)[:, 0], [NONE, RED], rtol=1e-6)


@pytest.mark.parametrize(
    ("shape", "effects", "expected"),
    [
        (SQUARE, effect("e", colour("1 0")), "expected 3 or 4 numbers, found 2"),
        (SQUARE, effect("e", colour("1 0 x")), "could not convert string to float: 'x'"),
        (with_colours("corners", "1 0 0, 0 1 0"), "", "has the index 2 for 2 colours"),
        (with_colours("vertices", "1 0 0"), "", "has the index 3 for 1 colours"),
        (with_colours("vertices", "1 0, 1 0"), "", "expected params R, G and B in a stride of 2"),
        (
            with_colours("vertices", "1 0 0").replace('k-array" count="1"', 'k-array" count="9"'),
            "", "claims 9 colours of stride 3",
        ),
    ],
)  # fmt: skip
def test_damaged_colours_are_refused_by_one_line(shape, effects, expected):
    data = coloured(shape, node(draw("g", a="#m-e")), effects)
    with pytest.raises(ValueError, match=r"^mesh \(bytes\): line ") as caught:
        wive.load_colors(data)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(wive.load_mesh(data)[1]) == 2


def test_numbers_out_of_range_are_cut_off_and_those_that_are_none_have_no_colour():
    effects = effect("e", colour("2 -1 0 1")) + effect("f", colour("nan 0 0 1"))
    found = wive.load_colors(coloured(SQUARE, node(draw("g", a="#m-e", b="#m-f")), effects))
    np.testing.assert_allclose(found[0, 0], RED, rtol=1e-6)
    np.testing.assert_allclose(found[1, 0], NONE, rtol=1e-6)


QUARTERS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
# Places around the middle of red, at the upper left, and of white, at the lower right; up is positive.
PLACES = [[0.2, 0.7], [0.3, 0.7], [0.2, 0.8], [0.7, 0.2], [0.8, 0.2], [0.7, 0.3]]
SAMPLER = (
    '<newparam sid="surface"><surface type="2D"><init_from>image</init_from></surface></newparam>'
    '<newparam sid="sampler"><sampler2D><source>surface</source></sampler2D></newparam>'
)
INSTANCE = '<instance_image url="#image"/><wrap_s>CLAMP</wrap_s>'
NEWER = f'<newparam sid="sampler"><sampler2D>{INSTANCE}</sampler2D></newparam>'
FILE = '<image id="image"><init_from>my%20pictures/t.png</init_from></image>'


def textured(
    folder: Path, texture="sampler", more=SAMPLER, image=FILE, places=PLACES, axes="ST", more_inputs=""
) -> Path:
    """A document whose first triangle is on red and whose second one is on white."""
    picture = pytest.importorskip("PIL.Image").fromarray(QUARTERS)
    (folder / "my pictures").mkdir(exist_ok=True)
    picture.save(folder / "my pictures" / "t.png")
    picture.save(folder.parent / "t.png")
    shape = geometry("g", POINTS, of(primitive("triangles", [0, 1, 2, 0, 2, 3]), "a"))
    shape = re.sub("<p>.*?</p>", "<p>0 0 1 1 2 2 0 3 2 4 3 5</p>", shape)
    shape = shape.replace(
        '<input semantic="NORMAL" source="#n" offset="1"/>',
        f'{more_inputs}<input semantic="TEXCOORD" source="#k" offset="1" set="3"/>',
    )
    shape = shape.replace("<vertices", f"{source(places, 'k', params=axes)}<vertices")
    effects = effect("e", f'<texture texture="{texture}" texcoord="UV"/>', more=more)
    bound = draw("g", a="#m-e").replace(
        'target="#m-e"/>',
        'target="#m-e"><bind_vertex_input semantic="UV" input_semantic="TEXCOORD" input_set="3"/>'
        "</instance_material>",
    )
    text = coloured(shape, node(bound), effects)
    path = folder / "m.dae"
    path.write_bytes(
        text.replace(b"<library_eff", f"<library_images>{image}</library_images><library_eff".encode())
    )
    return path


@pytest.mark.parametrize(
    "fields",
    [
        {},
        {"more": NEWER},
        {"texture": "image", "more": ""},
        {"image": FILE.replace("my%20", "./my ")},
        {"image": '<image id="image"><init_from><ref>my%20pictures/t.png</ref></init_from></image>'},
        {"places": [[*row, 0] for row in PLACES], "axes": "STP"},
        {"axes": "UV"},
        {"more_inputs": '<input semantic="TEXCOORD" source="#g-p" offset="0" set="0"/>'},
    ],
)
def test_textures_are_means_over_triangles(tmp_path, fields):
    found = wive.load_colors(textured(tmp_path, **fields))
    np.testing.assert_allclose(found[:, 0], [RED, [0.8] * 3], rtol=1e-6)


def test_what_is_beyond_a_texture_is_as_its_sampler_says(tmp_path):
    right = np.add(PLACES, [1, 0]).tolist()
    found = wive.load_colors(textured(tmp_path, places=right))
    np.testing.assert_allclose(found[:, 0], [RED, [0.8] * 3], rtol=1e-6)
    found = wive.load_colors(textured(tmp_path, places=right, more=NEWER))
    np.testing.assert_allclose(found[:, 0], [GREEN, [0.8] * 3], rtol=1e-6)
    found = wive.load_colors(textured(tmp_path, places=right, more=NEWER.replace("CLAMP", "MIRROR")))
    np.testing.assert_allclose(found[:, 0], [GREEN, BLUE], rtol=1e-6)


@pytest.mark.parametrize(
    "fields",
    [
        {"image": FILE.replace("my%20pictures/", "../")},
        {"image": FILE.replace("my%20pictures/t.png", "file:///etc/passwd")},
        {"image": FILE.replace("t.png", "none.png")},
        {"image": FILE.replace("t.png", "")},
        {"image": '<image id="image"/>'},
        {"image": ""},
        {"texture": "g"},
        {"more": SAMPLER.replace("<source>surface</source>", "")},
        {"more": SAMPLER.replace("<init_from>image</init_from>", "")},
    ],
)
def test_a_texture_that_can_not_be_read_has_no_colour(tmp_path, fields):
    folder = tmp_path / "inner"
    folder.mkdir()
    assert wive.load_colors(textured(folder, **fields)) is None
    path = textured(folder)
    assert wive.load_colors(path) is not None
    assert wive.load_colors(path.read_bytes()) is None  # bytes have no folder


def test_damaged_texture_coordinates_are_one_line(tmp_path):
    with pytest.raises(
        ValueError, match=r"m\.dae: line 3: triangles: has the index 5 for 5 places on a texture"
    ):
        wive.load_colors(textured(tmp_path, places=PLACES[:5]))


def test_damaged_files_have_colours_that_fit_or_are_one_line():
    nodes = node(draw("g", a="#m-red", b="#m-half"))
    check_damaged(coloured(SQUARE, nodes, EFFECTS), "dae", 12)
    check_damaged(coloured(with_colours("corners", "1 0 0, 0 1 0, 0 0 1"), nodes, EFFECTS), "dae", 13)
