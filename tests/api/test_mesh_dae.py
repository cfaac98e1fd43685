"""COLLADA files: triangles are those of the scene, in the order of its nodes, or the file is refused."""

import numpy as np
import pytest
from support.dae_files import document, draw, geometry, node, primitive
from support.refusals import refusal

import wive

POINTS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]]
DRAWN = node(draw("a"))
SQUARE = geometry("a", POINTS, primitive("triangles", [0, 1, 2, 0, 2, 3]))


def mesh(text: str) -> tuple[np.ndarray, np.ndarray]:
    return wive.load_mesh(text.encode(), np.float64, file_type="dae")


def heights(text: str) -> list[float]:
    vertices, faces = mesh(text)
    return vertices[faces][::2, 0, 2].tolist()


def refused(text: str) -> str:
    return refusal(text.encode(), "dae")


def up(z: float) -> str:
    return f"<translate>0 0 {z}</translate>"


def test_geometries_come_in_the_order_of_the_nodes_each_with_all_its_vertices():
    far = geometry("b", np.add(POINTS, [0, 0, 100]), primitive("triangles", [0, 1, 2, 0, 2, 3]))
    shared = node(up(7), draw("b"), key="shared")
    nodes = node(up(1), node(up(10), draw("a")), draw("a"), '<instance_node url="#shared"/>') + node(
        draw("a")
    )
    text = document(SQUARE + far, nodes, library=shared)
    assert heights(text) == [11, 1, 108, 0]
    assert len(mesh(text)[0]) == 4 * 5


def test_primitives_of_every_kind_come_in_their_order():
    points = [[np.cos(at), np.sin(at), 0] for at in range(6)]
    kinds = (
        primitive("lines", [0, 1]),
        primitive("trifans", [0, 1, 2, 3], [3, 4, 5]),
        primitive("polylist", [0, 1, 2, 3, 3, 4, 5], vcount=[4, 3]),
        primitive("triangles", [5, 4, 3]),
        primitive("tristrips", [0, 1, 2, 3, 4], [5, 4, 3]),
        primitive("polygons", [0, 1, 2, 3, 4], [1, 2, 3]),
        primitive("triangles", [], count=0),
    )
    faces = mesh(document(geometry("a", points, *kinds), DRAWN))[1].tolist()
    assert faces == [
        *([0, 1, 2], [0, 2, 3], [3, 4, 5]),
        *([0, 1, 2], [0, 2, 3], [3, 4, 5]),
        [5, 4, 3],
        *([0, 1, 2], [1, 3, 2], [2, 3, 4], [5, 4, 3]),
        *([0, 1, 2], [0, 2, 3], [0, 3, 4], [1, 2, 3]),
    ]


def test_concave_polygons_are_not_filled():
    points = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.5, 0], [0, 2, 0]]
    vertices, faces = mesh(document(geometry("a", points, primitive("polygons", [0, 1, 2, 3, 4])), DRAWN))
    scene = wive.Scene(vertices, faces)
    origins = [[1.5, 1.4, 5], [0.5, 1, 5], [1, 0.25, 5]]
    assert scene.occluded(np.array(origins), np.array([0.0, 0, -1])).tolist() == [False, True, True]


def test_accessors_pick_their_columns():
    rows = [[7, z, x, y] for x, y, z in POINTS]
    picked = geometry("a", rows, primitive("triangles", [0, 1, 2]), params=["", "Z", "X", "Y"])
    assert mesh(document(picked, DRAWN))[0].tolist() == POINTS
    later = geometry("a", POINTS, primitive("triangles", [0, 1, 2]), count=4, offset=3)
    assert mesh(document(later, DRAWN))[0].tolist() == POINTS[1:]


def test_transforms_are_applied_in_their_order():
    nodes = node(
        "<translate>10 0 0</translate><rotate>0 0 2 90</rotate><scale>2 3 -4</scale>",
        node("<matrix>1 0 0 5 0 0 -1 6 0 1 0 7 0 0 0 1</matrix>", draw("a")),
    )
    vertices, faces = mesh(document(SQUARE, nodes))
    x, y, z = np.array(POINTS, float).T
    x, y, z = x + 5, -z + 6, y + 7
    x, y, z = 2 * x, 3 * y, -4 * z
    assert vertices.tolist() == np.stack([-y + 10, x, z], axis=1).tolist()
    assert faces.tolist() == [[0, 2, 1], [0, 3, 2]]  # mirrored


def test_numbers_keep_double_precision_unit_and_up_axis():
    vertices, _ = mesh(document(geometry("a", np.add(POINTS, 0.1), primitive("triangles", [0, 1, 2])), DRAWN))
    assert vertices.tolist() == np.add(POINTS, 0.1).tolist()


def test_cameras_and_what_the_scene_does_not_use_may_be_anything():
    other = '<geometry id="bad"><convex_mesh/></geometry>'
    camera = node("<lookat>0 0 9 0 0 0 0 1 0</lookat><instance_camera url='#c'/>")
    assert heights(document(SQUARE + other, camera + DRAWN)) == [0]


@pytest.mark.parametrize(
    ("geometries", "nodes", "expected"),
    [
        (
            SQUARE,
            node(draw("b")),
            "line 4: instance_geometry: url: expected the id of a geometry, found '#b'",
        ),
        (SQUARE, node('<instance_geometry url="b.dae#b"/>'), "is in another file, which is not read"),
        (SQUARE, node('<instance_controller url="#c"/>'), "is moved by a skin or morph, which is not read"),
        (SQUARE, node("<skew>1 2 3 4 5 6 7</skew>", draw("a")), "line 4: skew: is not read"),
        (SQUARE, node("<scale>1 2</scale>", draw("a")), "line 4: scale: expected 3 numbers, found 2"),
        (SQUARE, node("<scale>1 2 nan</scale>", draw("a")), "line 4: scale: expected finite numbers"),
        (SQUARE, node("<matrix>" + "0 " * 16 + "</matrix>", draw("a")), "a last row of 0 0 0 1"),
        (
            SQUARE,
            node("<rotate>0 0 0 5</rotate>", draw("a")),
            "line 4: rotate: expected an axis and an angle",
        ),
        (SQUARE, node('<instance_node url="#n"/>', key="n"), "line 4: node 'n': holds itself"),
        (
            '<geometry id="a"><convex_mesh/></geometry>',
            DRAWN,
            "geometry 'a': expected a mesh, found convex_mesh",
        ),
        (
            SQUARE.replace('"VERTEX"', '"POSITION"'),
            DRAWN,
            "triangles: expected one input VERTEX, found 0",
        ),
        (SQUARE.replace('"POSITION"', '"NORMAL"'), DRAWN, "expected one input POSITION, found 0"),
        (
            SQUARE.replace(">0.0 ", ">O.0 "),
            DRAWN,
            "line 3: float_array 'a-p-array': could not convert",
        ),
        (
            SQUARE.replace(">0.0 ", ">1_0 "),
            DRAWN,
            "line 3: float_array 'a-p-array': could not convert",
        ),
        (
            SQUARE.replace(">0.0 ", "> "),
            DRAWN,
            "float_array 'a-p-array': expected 15 numbers, found 14",
        ),
        (
            SQUARE.replace('count="5"', 'count="6"'),
            DRAWN,
            "accessor: claims 6 positions of stride 3",
        ),
        (
            SQUARE.replace('count="5"', f'count="{10**17}"'),
            DRAWN,
            f"accessor: claims {10**17} positions",
        ),
        (
            SQUARE.replace('stride="3"', 'stride="2"'),
            DRAWN,
            "expected params X, Y and Z in a stride of 2",
        ),
        (
            SQUARE.replace('count="2"', 'count="3"'),
            DRAWN,
            "triangles: claims a count of 3, holds 2",
        ),
        (
            SQUARE.replace("<p>0 0 ", "<p>5 0 "),
            DRAWN,
            "triangles: has the index 5, expected at most 4",
        ),
        (
            SQUARE.replace("<p>0 0 ", "<p>-1 0 "),
            DRAWN,
            "p: expected whole numbers from 0, found '-1'",
        ),
        (
            SQUARE.replace("<p>0 0 ", "<p>0 "),
            DRAWN,
            "p: expected a multiple of 2 numbers, found 11",
        ),
        (
            SQUARE.replace("<p>0 0 ", "<p>"),
            DRAWN,
            "triangles: expected a multiple of 3 vertices, found 5",
        ),
        (
            geometry("a", POINTS, primitive("polylist", [0, 1, 2, 3], vcount=[3])),
            DRAWN,
            "polylist: claims 1 polygons, vcount has 1 of 3 vertices, p has 4",
        ),
        (
            geometry("a", POINTS, primitive("tristrips", [0, 1])),
            DRAWN,
            "tristrips: expected at least 3 vertices each, found 2",
        ),
        (
            geometry(
                "a", POINTS, primitive("polygons", [0, 1, 2]).replace("</polygons>", "<ph/></polygons>")
            ),
            DRAWN,
            "polygons: has polygons with holes, which are not read",
        ),
        ("", node(), "has no triangles"),
    ],
)
def test_what_a_document_gets_wrong_is_named(geometries, nodes, expected):
    assert expected in refused(document(geometries, nodes))


def test_damaged_documents_are_refused():
    text = document(SQUARE, DRAWN)
    assert "line 5: expected XML (unclosed token): the file is cut off or damaged" in refused(text[:-9])
    assert "line 1: expected XML" in refused("no XML")
    assert "line 1: expected an element 'COLLADA', found 'svg'" in refused("<svg/>")
    assert "has no scene" in refused(text.replace("<scene>", "<other>").replace("</scene>", "</other>"))
    assert "document type declaration" in refused(text.replace("\n", "\n<!DOCTYPE a>", 1))


def test_copies_beyond_the_range_of_indices_are_refused_before_they_are_made():
    twice = [node(f'<instance_node url="#n{n}"/>' * 2, key=f"n{n + 1}") for n in range(60)]
    text = document(SQUARE, '<instance_node url="#n60"/>', node(draw("a"), key="n0") + "".join(twice))
    assert f"has {5 * 2**60} vertices and {2 * 2**60} triangles" in refused(text)
    empty = document("", '<instance_node url="#n60"/>', node(key="n0") + "".join(twice))
    assert "has no triangles" in refused(empty)


def test_nodes_nested_twenty_thousand_deep_are_read():
    assert heights(document(SQUARE, "<node>" * 20_000 + draw("a") + "</node>" * 20_000)) == [0]


def test_curves_and_lines_have_no_triangles():
    curves = '<geometry id="b"><spline/></geometry>' + geometry("c", POINTS, primitive("lines", [0, 1]))
    vertices, faces = mesh(document(SQUARE + curves, node(draw("b"), draw("a"), draw("c"))))
    assert (len(vertices), len(faces)) == (5, 2)


def test_vertices_may_be_any_of_the_indices():
    shape = SQUARE.replace('source="#v" offset="0"', 'source="#v" offset="2"')
    shape = shape.replace("0 0 1 0 2 0 0 0 2 0 3 0", "4 4 0 4 4 1 4 4 2 4 4 0 4 4 2 4 4 3")
    assert mesh(document(shape, DRAWN))[1].tolist() == [[0, 1, 2], [0, 2, 3]]


def test_inputs_may_share_an_offset_and_ids_may_be_escaped():
    shared = SQUARE.replace('offset="1"', 'offset="0"').replace("0 0 1 0 2 0 0 0 2 0 3 0", "0 1 2\n0 2 3 ")
    assert heights(document(shared, DRAWN)) == [0]
    assert heights(document(SQUARE.replace('id="a"', 'id="a b"'), node(draw("a%20b")))) == [0]


def test_encodings_that_are_not_read_are_named():
    whole = document(geometry("g", POINTS, primitive("triangles", [0, 1, 2])), node(draw("g")))
    for encoding, reason in (("shift_jis", "multi-byte encodings are not supported"), ("klingon", "unknown")):
        message = refusal(whole.replace("utf-8", encoding), "dae")
        assert message.startswith(f"line 1: {reason}") and message.endswith("save the file as UTF-8")


def test_copies_of_copies_without_number_are_refused_before_they_are_made():
    library = node(draw("a"), key="n0")
    for level in range(25):
        library += node(*[f'<instance_node url="#n{level}"/>'] * 2, key=f"n{level + 1}")
    text = document(SQUARE, node('<instance_node url="#n25"/>'), library)
    assert "scene: places its copies in" in refused(text)
