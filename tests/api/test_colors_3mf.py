"""Colours of 3MF files: base and composite materials, colour groups; of objects, triangles and corners."""

import io
import zipfile

import numpy as np
import pytest
from support import threemf_files
from support.damaged_colours import check_damaged
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
        f'<triangle v1="0" v2="{at % 2 + 1}" v3="{at % 2 + 2}" {one}/>' for at, one in enumerate(triangles)
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
        ('pid="5" p1="2"', BASES, "group '5': expected an index below 2, found '2'"),
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


COMPOSITES = (
    f'{BASES}<m:compositematerials id="4" matid="5" matindices="0 1"><m:composite values="0.25 0.75"/>'
    '<m:composite values="1"/><m:composite values="0.2 0.2 7"/><m:composite values="0 0"/>'
    "</m:compositematerials>"
)
MIXED = {0: [0.2, 0, 0.6], 1: RED, 2: [0.4, 0, 0.4], 3: [0.4, 0, 0.4]}


@pytest.mark.parametrize("member", MIXED)
def test_composites_mix_the_display_colours_of_their_materials(member):
    """As spec_materials says, section 4.1: relative to the sum, missing ones are 0, too many don't count."""
    found = colours([f'pid="4" p1="{member}"', 'pid="5" p1="0"'], resources=COMPOSITES)
    np.testing.assert_allclose(found[:, 0], [MIXED[member], RED], rtol=1e-6, atol=1e-12)


def test_composites_are_of_corners_and_of_objects():
    found = colours(['pid="4" p1="0" p2="1" p3="2"', ""], 'pid="4" pindex="3"', COMPOSITES)
    expected = [np.mean([MIXED[0], MIXED[1], MIXED[2]], axis=0), MIXED[3]]
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("base", ['<base name="a"/>', ""])
def test_composites_of_materials_without_colours_have_none(base):
    resources = COMPOSITES.replace('<base name="a" displaycolor="#FF0000"/>', base or "<base/>")
    if not base:
        resources = resources.replace('matid="5"', 'matid="55"')
    found = colours(['pid="4" p1="0"', 'pid="5" p1="1"'], resources=resources)
    np.testing.assert_allclose(found[:, 0], [NONE, BLUE], rtol=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('matindices="0 1"', 'matindices="0 2"', "group '4': expected an index below 2, found '2'"),
        ('matindices="0 1"', 'matindices="0 x"', "found 'x'"),
        ('matindices="0 1"', "", "expected an attribute 'matindices'"),
        ("0.25 0.75", "0.25 nan", "composite: expected finite numbers, found 'nan'"),
        ("0.25 0.75", "0.25 -1", "expected proportions from 0 to 1, found '0.25 -1.0'"),
        ("0.25 0.75", "red", "could not convert string to float"),
        ('values="0.25 0.75"', "", "expected an attribute 'values'"),
    ],
)
def test_damaged_composites_are_refused_by_one_line(old, new, expected):
    with pytest.raises(ValueError, match=r"^mesh \(bytes\): ") as caught:
        colours(['pid="4" p1="0"'], resources=COMPOSITES.replace(old, new, 1))
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


QUARTERS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
# Around the middle of red, at the upper left, and of white, at the lower right; up is positive.
PLACES = [(0.2, 0.7), (0.3, 0.7), (0.2, 0.8), (0.7, 0.2), (0.8, 0.2), (0.7, 0.3)]
ON_TEXTURE = ['pid="8" p1="0" p2="1" p3="2"', 'pid="8" p1="3" p2="4" p3="5"']


def textured(
    triangles=ON_TEXTURE, style="", path="/3D/Textures/t.png", member="3D__Textures__t.png", shift=0.0
) -> bytes:
    """A package of a square on a texture."""
    image = pytest.importorskip("PIL.Image")
    picture = io.BytesIO()
    image.fromarray(QUARTERS).save(picture, "PNG")
    places = "".join(f'<m:tex2coord u="{u + shift}" v="{v}"/>' for u, v in PLACES)
    texture = f'<m:texture2d id="6" path="{path}" contenttype="image/png" {style}/>'
    resources = f'{texture}<m:texture2dgroup id="8" texid="6">{places}</m:texture2dgroup>{BASES}'
    whole = file(triangles, resources=resources)
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        return package(archive.read("3D/3dmodel.model"), **{member: picture.getvalue()})


def test_textures_are_means_over_triangles():
    found = wive.load_colors(textured())
    np.testing.assert_allclose(found[:, 0], [RED, [0.8] * 3], rtol=1e-6)
    found = wive.load_colors(textured(['pid="5" p1="1"', *ON_TEXTURE]))
    np.testing.assert_allclose(found[:, 0], [BLUE, RED, [0.8] * 3], rtol=1e-6)


@pytest.mark.parametrize(
    ("style", "expected"),
    [
        ("", [RED, [0.8] * 3]),
        ('tilestyleu="wrap"', [RED, [0.8] * 3]),
        ('tilestyleu="clamp"', [GREEN, [0.8] * 3]),
        ('tilestyleu="mirror"', [GREEN, BLUE]),
        ('tilestylev="mirror"', [RED, [0.8] * 3]),
    ],
)
def test_what_is_beyond_a_texture_is_as_its_style_says(style, expected):
    np.testing.assert_allclose(wive.load_colors(textured(style=style, shift=1))[:, 0], expected, rtol=1e-6)


@pytest.mark.parametrize("path", ["/3D/none.png", "../t.png", "/etc/passwd", "", "/3D/3dmodel.model"])
def test_a_texture_that_is_missing_or_no_picture_has_no_colour(path):
    assert wive.load_colors(textured(path=path)) is None
    found = wive.load_colors(textured(['pid="5" p1="1"', *ON_TEXTURE], path=path))
    np.testing.assert_allclose(found[:, 0], [BLUE, NONE, NONE], rtol=1e-6)


def test_a_texture_that_is_damaged_has_no_colour():
    data = bytearray(textured())
    at = data.index(b"3D/Textures/t.png") + len(b"3D/Textures/t.png")
    data[at + 30] ^= 0xFF  # in the picture's bytes, of which the archive has a checksum
    assert wive.load_colors(bytes(data)) is None


def test_a_texture_that_is_too_long_has_no_colour(monkeypatch):
    monkeypatch.setattr("wive._internal.formats.threemf.reader.LONGEST_PICTURE", 10)
    assert wive.load_colors(textured()) is None


@pytest.mark.parametrize(
    ("shift", "triangle", "expected"),
    [
        ("x", ON_TEXTURE[0], "could not convert string to float"),
        (np.nan, ON_TEXTURE[0], "tex2coord: expected finite numbers, found 'nan'"),
        (0, 'pid="8" p1="6"', "group '8': expected an index below 6, found '6'"),
    ],
)
def test_damaged_places_on_textures_are_one_line(shift, triangle, expected):
    if shift == "x":
        data = textured()
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            data = package(archive.read("3D/3dmodel.model").replace(b'u="0.2"', b'u="x"'))
    else:
        data = textured([triangle], shift=shift)
    with pytest.raises(ValueError, match=r"^mesh \(bytes\): ") as caught:
        wive.load_colors(data)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_damaged_files_have_colours_that_fit_or_are_one_line():
    with zipfile.ZipFile(io.BytesIO(textured(['pid="9" p1="0" p2="1" p3="2"', *ON_TEXTURE]))) as archive:
        part, picture = archive.read("3D/3dmodel.model"), archive.read("3D/Textures/t.png")
    check_damaged(part, "3mf", 11, lambda data: package(data, **{"3D__Textures__t.png": picture}))
