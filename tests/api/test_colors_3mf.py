"""Colours of 3MF files: base materials and colour groups, of objects, triangles and corners."""

import numpy as np
import pytest
from support import threemf_files
from support.threemf_files import components, package

import wive

MATERIAL = 'xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02"'
POINTS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
BASES = (
    '<basematerials id="5"><base name="a" displaycolor="#FF0000"/>'
    '<base name="b" displaycolor="#0000ff80"/></basematerials>'
)
COLOURS = (
    '<m:colorgroup id="9"><m:color color="#00FF00"/><m:color color="#808080FF"/>'
    '<m:color color="#FFF000"/></m:colorgroup>'
)
# IEC 61966-2-1, by hand, times the reflectance of white.
LEVEL = {0: 0.0, 0x80: 0.8 * ((128 / 255 + 0.055) / 1.055) ** 2.4, 255: 0.8}
LEVEL[0xF0] = 0.8 * ((240 / 255 + 0.055) / 1.055) ** 2.4
RED, BLUE, GREEN = [0.8, 0, 0], [0, 0, 0.8], [0, 0.8, 0]
GRAY, YELLOW, NONE = [LEVEL[0x80]] * 3, [0.8, LEVEL[0xF0], 0], [0.6] * 3


def file(
    triangles: list[str], attributes: str = "", resources: str = BASES + COLOURS, items=('objectid="1"',)
):
    """A package of an object of a square whose triangles have these attributes, and what places it."""
    plain = threemf_files.mesh(POINTS, [])
    rows = "".join(
        f'<triangle v1="0" v2="{at + 1}" v3="{at + 2}" {one}/>' for at, one in enumerate(triangles)
    )
    shape = plain.replace("<triangles></triangles>", f"<triangles>{rows}</triangles>")
    objects = {
        "1": shape,
        "2": components('objectid="1"', 'objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 5"'),
    }
    text = threemf_files.model(objects, items, declared=MATERIAL)
    text = text.replace('<object id="1"', f'{resources}<object id="1" {attributes}', 1)
    return package(text)


def colours(*args, **fields) -> np.ndarray | None:
    return wive.load_colors(file(*args, **fields), file_type="3mf")


@pytest.mark.parametrize(
    ("attributes", "triangles", "expected"),
    [
        ('pid="5" pindex="1"', ["", ""], [BLUE, BLUE]),
        ('pid="5" pindex="1"', ['pid="5" p1="0"', ""], [RED, BLUE]),
        ('pid="5" pindex="1"', ['p1="0"', 'pid="9" p1="0" p2="1"'], [RED, GREEN]),
        ("", ['pid="9" p1="1" p2="1" p3="1"', ""], [GRAY, NONE]),
        ("", ['pid="5" p1="0"', 'pid="77" p1="3"'], [RED, NONE]),
    ],
)
def test_a_triangle_has_its_own_colour_else_that_of_its_object(attributes, triangles, expected):
    found = colours(triangles, attributes)
    assert found.shape == (2, 1, 3)
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-6)


def test_colours_that_change_evenly_are_those_of_vertices_if_corners_agree():
    found = colours(['pid="9" p1="0" p2="1" p3="2"', 'pid="9" p1="0" p2="2" p3="0"'])
    np.testing.assert_allclose(found, [GREEN, GRAY, YELLOW, GREEN], rtol=1e-6)


def test_colours_of_corners_that_disagree_at_a_vertex_are_the_means_of_triangles():
    found = colours(['pid="9" p1="0" p2="1" p3="2"', 'pid="9" p1="2" p2="2" p3="0"'])
    expected = [np.mean([GREEN, GRAY, YELLOW], axis=0), np.mean([YELLOW, YELLOW, GREEN], axis=0)]
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-6)


def test_each_copy_has_the_colours_of_its_object_in_the_order_of_the_mesh():
    items = ['objectid="2"', 'objectid="1"']
    found = colours(['pid="5" p1="0"', 'pid="5" p1="1"'], items=items)
    np.testing.assert_allclose(found[:, 0], [RED, BLUE] * 3, rtol=1e-6)
    smooth = file(['pid="9" p1="0" p2="1" p3="2"', 'pid="9" p1="0" p2="2" p3="0"'], items=items)
    found = wive.load_colors(smooth)
    np.testing.assert_allclose(found, [GREEN, GRAY, YELLOW, GREEN] * 3, rtol=1e-6)
    assert found.shape == wive.load_mesh(smooth)[0].shape


def test_objects_of_other_parts_have_the_colours_of_those_parts():
    def part(colour: str, items: list[str]) -> str:
        bases = f'<basematerials id="5"><base name="a" displaycolor="{colour}"/></basematerials>'
        text = threemf_files.model({"1": threemf_files.mesh(POINTS, [[0, 1, 2]])}, items)
        return text.replace('<object id="1"', f'{bases}<object id="1" pid="5" pindex="0"', 1)

    items = ['objectid="1"', 'objectid="1" p:path="/3D/b.model"']
    data = package(part("#FF0000", items), **{"3D__b.model": part("#0000FF", [])})
    np.testing.assert_allclose(wive.load_colors(data)[:, 0], [RED, BLUE], rtol=1e-6)


def test_a_package_without_colours_has_none():
    assert colours(["", 'pid="7"']) is None
    assert (
        colours(['pid="5" p1="0"'], resources='<basematerials id="5"><base name="a"/></basematerials>')
        is None
    )


@pytest.mark.parametrize(
    ("triangle", "resources", "expected"),
    [
        ('pid="5" p1="2"', BASES, "expected an index below 2, the colours of group '5', found '2'"),
        ('pid="5" p1="-1"', BASES, "expected an index below 2"),
        ('pid="5" p1="0" p2="x" p3="0"', BASES, "found 'x'"),
        ('pid="5" p1="00000000000000000000000000"', BASES, "found '0000"),
        ('pid="5" p1="0"', BASES.replace("#FF0000", "red"), "expected #RRGGBB or #RRGGBBAA, found 'red'"),
        ('pid="9" p1="0"', COLOURS.replace("#00FF00", "#0"), "color: color: expected #RRGGBB"),
        ('pid="5" p1="0"', BASES.replace('id="5"', ""), "expected an attribute 'id'"),
    ],
)
def test_damaged_colours_are_refused_by_one_line(triangle, resources, expected):
    with pytest.raises(ValueError, match=r"^mesh \(bytes\): ") as caught:
        colours([triangle], resources=resources)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(wive.load_mesh(file([triangle], resources=resources))[1]) == 1
