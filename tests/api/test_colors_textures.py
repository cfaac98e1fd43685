"""Textures of OBJ and glTF files: the mean colour of the texture over each triangle."""

import io
import json
import os
import sys

import numpy as np
import pytest
from support.damaged_colours import check_damaged
from support.gltf_files import Model, primitive
from support.mesh_files import damaged

import wive
from wive._internal.formats.colours import linear, texture_mean
from wive._internal.formats.colours.texture import MOST_PIXELS, Textures
from wive._internal.formats.colours.texture_mean import CLAMP, MIRROR, REPEAT, Means

Image = pytest.importorskip("PIL.Image")
RED, GREEN, BLUE, WHITE = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 255)
# Seen from the front: red green above blue white.
QUARTERS = np.array([[RED, GREEN], [BLUE, WHITE]], np.uint8)
# A triangle in the middle of each: red, green, blue, white; from the left and the top.
MIDDLES = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)]
EXPECTED = 0.8 * np.array([RED, GREEN, BLUE, WHITE]) / 255
SMALL = np.array([(-0.1, -0.1), (0.1, -0.1), (0, 0.2)])
GRAY = 0.8 * ((0.5 + 0.055) / 1.055) ** 2.4  # of Kd 0.5, by hand


def means_over(*arguments) -> np.ndarray:
    return Means().over(*arguments)


def file(pixels: np.ndarray, form: str = "PNG", mode: str = "RGB") -> bytes:
    data = io.BytesIO()
    Image.fromarray(pixels).convert(mode).save(data, form)
    return data.getvalue()


def overlap(triangle: np.ndarray, column: int, row: int) -> float:
    """The area of a triangle within a texel, by cutting it at the texel's four sides."""
    polygon = triangle
    for axis, limit, sign in ((0, column, 1), (0, column + 1, -1), (1, row, 1), (1, row + 1, -1)):
        kept = []
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            inside, other = sign * (a[axis] - limit), sign * (b[axis] - limit)
            if inside >= 0:
                kept.append(a)
            if inside * other < 0:
                kept.append(a + (b - a) * inside / (inside - other))
        if len(kept) < 3:
            return 0.0
        polygon = np.array(kept)
    x, y = polygon.T
    return abs(float(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))) / 2


def test_means_are_near_the_exact_ones_by_areas_within_texels():
    random = np.random.default_rng(5)
    texels = random.integers(0, 256, (9, 7, 3), dtype=np.uint8)
    triangles = random.random((60, 3, 2))
    found = means_over(texels, triangles)
    colours = linear(texels, 255)
    for triangle, colour in zip(triangles, found, strict=True):
        areas = np.array([[overlap(triangle * (7, 9), x, y) for x in range(7)] for y in range(9)])
        exact = (areas[..., None] * colours).sum(axis=(0, 1)) / areas.sum()
        np.testing.assert_allclose(colour, exact, atol=0.06)
    halves = np.array([[[0, 0], [1, 0], [0, 1]], [[1, 1], [0, 1], [1, 0]]])
    np.testing.assert_allclose(means_over(texels, halves).mean(axis=0), colours.mean(axis=(0, 1)), atol=0.01)


def test_a_triangle_within_a_texel_has_exactly_its_colour():
    random = np.random.default_rng(6)
    texels = random.integers(0, 256, (5, 8, 3), dtype=np.uint8)
    column, row = random.integers(0, 8, 200), random.integers(0, 5, 200)
    places = (np.stack([column, row], 1)[:, None] + 0.01 + 0.98 * random.random((200, 3, 2))) / (8, 5)
    np.testing.assert_array_equal(means_over(texels, places), linear(texels, 255)[row, column])


def test_colours_that_change_evenly_have_the_mean_at_the_centre():
    levels = np.arange(256)
    share = linear(levels, 255)
    texels = np.repeat(levels[None, :, None], 3, axis=2).astype(np.uint8)
    random = np.random.default_rng(7)
    for triangle in random.random((20, 3, 2)):
        left, right = np.sort(triangle[:, 0])[[0, 2]] * 256
        width = np.arange(max(1, int(left)), int(right))  # strips, by the width of the triangle at each
        x = np.sort(triangle[:, 0]) * 256
        height = np.interp(width + 0.5, x, [0, 1, 0])
        exact = (height * share[width]).sum() / height.sum()
        np.testing.assert_allclose(means_over(texels, triangle[None])[0], exact, atol=0.02)


def test_places_beyond_the_texture_repeat_are_mirrored_or_stay_at_its_border():
    texels = np.arange(4, dtype=np.uint8)[None, :, None].repeat(3, axis=2) * 60
    at = np.array([-1.1, -0.1, 0.1, 0.9, 1.1, 1.9, 2.1])
    places = np.repeat(np.stack([at, 0 * at + 0.5], 1)[:, None], 3, axis=1)
    expected = {
        REPEAT: [3, 3, 0, 3, 0, 3, 0],
        MIRROR: [3, 0, 0, 3, 3, 0, 0],
        CLAMP: [0, 0, 0, 3, 3, 3, 3],
    }
    for wrap, columns in expected.items():
        np.testing.assert_array_equal(
            means_over(texels, places, (wrap, REPEAT)), linear(texels, 255)[0, columns]
        )
        turned = means_over(texels.transpose(1, 0, 2), places[..., ::-1], (REPEAT, wrap))
        np.testing.assert_array_equal(turned, linear(texels, 255)[0, columns])


def test_places_that_are_not_finite_have_no_colour_and_huge_ones_some():
    places = np.zeros((6, 3, 2))
    places[0, 1, 0], places[1, 2, 1], places[2, 0, 0] = np.nan, np.inf, 1.7e308
    places[3, 0, 0], places[4, 0, 0], places[5] = 1e300, -1e-320, 1e18
    found = means_over(QUARTERS, places)
    assert np.isnan(found[:3]).all()
    assert ((found[3:] >= 0) & (found[3:] <= 1)).all()


def test_the_samples_of_all_triangles_of_a_file_are_bounded(monkeypatch):
    monkeypatch.setattr("wive._internal.formats.colours.texture_mean.MOST_SAMPLES", 5000)
    means, sampled = Means(), []
    look_up = texture_mean._texels

    def count(places, weights, *rest):
        sampled.append(len(places) * weights.shape[1])
        return look_up(places, weights, *rest)

    monkeypatch.setattr(texture_mean, "_texels", count)
    large, small = np.array([[0, 0], [1e6, 0], [0, 1e6]]), SMALL / 10
    for triangles, most in (
        (np.array([large]), 4096),
        (np.array([small] * 50 + [large] * 50), 904),
        ([large] * 70, 70),
    ):
        assert np.isfinite(means.over(QUARTERS, np.array(triangles))).all()
        assert len(triangles) <= sum(sampled) <= most
        sampled.clear()


def test_the_pixels_of_all_textures_of_a_file_are_bounded(monkeypatch):
    monkeypatch.setattr("wive._internal.formats.colours.texture.MOST_OF_ALL", 11)
    textures = Textures()
    found = [textures.get(key, lambda: file(QUARTERS)) for key in range(4)]
    assert [one is not None for one in found] == [True, True, False, False]


def gltf(places: np.ndarray, pixels: bytes | None = None, uri: str | None = None, **fields) -> Model:
    """A model of a triangle per row of places (n,3,2) on its texture; `fields` are of its parts."""
    model = Model()
    places = np.asarray(places, np.float32)
    points = np.concatenate([places, np.zeros((*places.shape[:2], 1))], axis=2).reshape(-1, 3)
    attributes = {
        "POSITION": model.array(points, "f4"),
        "TEXCOORD_0": model.array(places.reshape(-1, 2), "f4"),
        **fields.get("attributes", {}),
    }
    model.node(mesh=model.mesh({"attributes": attributes, "material": 0}))
    image = {"uri": uri} if uri is not None else {"bufferView": model.view(pixels), "mimeType": "image/png"}
    surface = {"baseColorTexture": {"index": 0, **fields.get("base", {})}, **fields.get("surface", {})}
    model.json |= {
        "images": [image],
        "textures": [{"source": 0, **fields.get("texture", {})}],
        "samplers": [fields.get("sampler", {})],
        "materials": [{"pbrMetallicRoughness": surface}],
    }
    return model


def middles(scale: float = 1.0) -> np.ndarray:
    return np.array(MIDDLES)[:, None] + scale * SMALL


@pytest.mark.parametrize(("form", "mode"), [("PNG", "RGB"), ("PNG", "P"), ("PNG", "RGBA"), ("BMP", "RGB")])
def test_gltf_textures_may_be_in_the_file(form, mode):
    data = gltf(middles(), file(QUARTERS, form, mode)).glb()
    found = wive.load_colors(data)
    assert found.dtype == np.float32
    assert found.shape == (4, 1, 3)
    np.testing.assert_allclose(found[:, 0], EXPECTED, rtol=1e-6)


def test_gltf_textures_may_be_beside_the_file_or_in_its_text(tmp_path):
    (tmp_path / "a b").mkdir()
    (tmp_path / "a b" / "t.png").write_bytes(file(QUARTERS))
    data = "data:image/png;base64," + __import__("base64").b64encode(file(QUARTERS)).decode()
    for uri in ("a%20b/t.png", "./a b/t.png", data):
        (tmp_path / "m.glb").write_bytes(gltf(middles(), uri=uri).glb())
        np.testing.assert_allclose(wive.load_colors(tmp_path / "m.glb")[:, 0], EXPECTED, rtol=1e-6)


def test_gltf_textures_are_multiplied_by_the_factor_and_the_colours_of_vertices():
    model = gltf(middles(), file(QUARTERS), surface={"baseColorFactor": [0.5, 1, 0.25, 1]})
    np.testing.assert_allclose(wive.load_colors(model.glb())[:, 0], EXPECTED * [0.5, 1, 0.25], rtol=1e-6)
    colours = model.array(np.tile([[1, 0, 1], [0.5, 0, 1], [0, 0, 1]], (4, 1)), "f4")
    model.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = colours
    np.testing.assert_allclose(wive.load_colors(model.glb())[:, 0], EXPECTED * [0.25, 0, 0.25], rtol=1e-6)


def test_gltf_meshes_without_texture_keep_their_colours_beside_those_with_one():
    model = gltf(middles(), file(QUARTERS))
    position = model.array([[0, 0, 1], [1, 0, 1], [0, 1, 1]], "f4")
    model.json["materials"].append({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1, 1]}})
    second = model.mesh(primitive(position, material=1))
    model.node(mesh=second)
    model.node(mesh=0, translation=[0, 0, 3])
    data = model.glb()
    found = wive.load_colors(data)
    np.testing.assert_allclose(found[:, 0], [*EXPECTED, [0.4, 0.2, 0.8], *EXPECTED], rtol=1e-6)
    assert len(found) == len(wive.load_mesh(data)[1])


def test_gltf_samplers_and_transforms_of_textures_are_followed():
    sampler = {"wrapS": 33071, "wrapT": 33648}
    shifted = middles() + np.array([1.0, 1.0])  # right of the border, and mirrored
    found = wive.load_colors(gltf(shifted, file(QUARTERS), sampler=sampler, texture={"sampler": 0}).glb())
    np.testing.assert_allclose(found[:, 0], EXPECTED[[3, 3, 1, 1]], rtol=1e-6)
    # The example of KHR_texture_transform: the lower left quarter, turned by 90 degrees with the clock.
    turned = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]}
    base = {"extensions": {"KHR_texture_transform": turned}}
    corner = np.array([(0.1, 0.1), (0.9, 0.1), (0.1, 0.9)])  # of the mesh, from its left and top
    pixels = np.zeros((4, 4, 3), np.uint8)
    pixels[2:, :2] = QUARTERS
    found = wive.load_colors(gltf(corner[:, None] + 0.1 * SMALL, file(pixels), base=base).glb())
    np.testing.assert_allclose(found[:, 0], EXPECTED[[2, 0, 3]], rtol=1e-6)


def test_gltf_texture_coordinates_may_be_a_second_set_of_whole_numbers():
    model = gltf(middles(), file(QUARTERS), base={"texCoord": 1})
    del model.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]
    second = model.array(np.round(255 * middles().reshape(-1, 2)), "u1", normalized=True)
    model.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = second
    np.testing.assert_allclose(wive.load_colors(model.glb())[:, 0], EXPECTED, rtol=1e-6)
    del model.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"]
    assert wive.load_colors(model.glb()) is None


def test_gltf_and_obj_textures_are_those_of_trimesh(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    random = np.random.default_rng(8)
    pixels = random.integers(0, 256, (4, 4, 3), dtype=np.uint8)
    texture = Image.fromarray(pixels.repeat(16, axis=0).repeat(16, axis=1))  # 4 x 4 fields of one colour
    cells = random.integers(0, 4, (30, 2))
    places = ((cells[:, None] + 0.2 + 0.6 * random.random((30, 3, 2))) / 4).reshape(-1, 2)
    material = trimesh.visual.material.SimpleMaterial(image=texture, diffuse=WHITE)
    visual = trimesh.visual.TextureVisuals(places, material=material)
    mesh = trimesh.Trimesh(random.random((90, 3)), np.arange(90).reshape(-1, 3), visual=visual, process=False)
    expected = 0.8 * linear(mesh.visual.to_color().vertex_colors[::3, :3], 255)
    (tmp_path / "m.glb").write_bytes(mesh.export(file_type="glb"))
    np.testing.assert_allclose(wive.load_colors(tmp_path / "m.glb")[:, 0], expected, rtol=1e-5)
    mesh.export(tmp_path / "m.obj")
    np.testing.assert_allclose(wive.load_colors(tmp_path / "m.obj")[:, 0], expected, rtol=1e-5)


def obj(tmp_path, faces: str, material: str = "Kd 1 1 1\nmap_Kd t.png\n", places: str | None = None) -> str:
    """An OBJ file of five vertices; places 1 to 3 are around red's middle, 10 to 12 around white's."""
    (tmp_path / "t.png").write_bytes(file(QUARTERS))
    (tmp_path / "m.mtl").write_text(f"newmtl a\n{material}newmtl plain\nKd 0.5 0.5 0.5\n")
    listed = "".join(f"vt {u} {1 - v}\n" for u, v in middles().reshape(-1, 2)) if places is None else places
    vertices = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 0.5 0\n"
    (tmp_path / "m.obj").write_text(f"mtllib m.mtl\n{vertices}{listed}usemtl a\n{faces}")
    return tmp_path / "m.obj"


def test_obj_textures_follow_the_corners_of_each_triangle(tmp_path):
    faces = (
        "f 1/1 2/2 3/3\nf 1/4/9 2/5/9 3/6/9\nf 1/-6 2/-5 3/-4\nf -5/10 -4/11 -3/12\nusemtl plain\nf 1 2 3\n"
    )
    found = wive.load_colors(obj(tmp_path, faces))
    np.testing.assert_allclose(found[:, 0], [*EXPECTED, [GRAY] * 3], rtol=1e-6)


def test_obj_textures_of_polygons_are_those_of_their_triangles(tmp_path):
    # Red along the corners 1 2 3, white at the others: the fan's first triangle is red, others mixed.
    faces = "f 1/1 2/2 3/3 4/10 5/11\nf 1/4 2/5 3/6 4/6\n"
    path = obj(tmp_path, faces)
    found = wive.load_colors(path)
    triangles = wive.load_mesh(path)[1]
    assert found.shape == (len(triangles), 1, 3)
    places = dict(zip(range(5), [*middles()[0], *middles()[3][:2]], strict=True))
    exact = means_over(
        QUARTERS, np.array([[places[corner] for corner in each] for each in triangles[:3].tolist()])
    )
    np.testing.assert_allclose(found[:3, 0], 0.8 * exact, rtol=1e-5)
    np.testing.assert_allclose(found[3:, 0], EXPECTED[[1, 1]], rtol=1e-6)


def test_obj_corners_without_texture_have_the_colour_of_their_material(tmp_path):
    faces = "f 1 2 3\nf 1//1 2//1 3//1\nf 1/1 2/99 3/3\nf 1/1 2/-99 3/3\nf 1/0 2/1 3/1\nf 1/1 2/2 3/3\n"
    found = wive.load_colors(obj(tmp_path, faces, "Kd 0.5 0.5 0.5\nmap_Kd t.png\n"))
    np.testing.assert_allclose(found[:, 0], [[GRAY] * 3] * 5 + [[GRAY, 0, 0]], rtol=1e-6)
    found = wive.load_colors(obj(tmp_path, "f 1 2 3\nf 1/1 2/2 3/3\n", "map_Kd t.png\n"))
    np.testing.assert_allclose(found[:, 0], [[0.6] * 3, [0.8, 0, 0]], rtol=1e-6)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ("-o 0.5 0 0 t.png", 1),
        ("-o 0 0.5 t.png", 2),  # up
        ("-s 3 t.png", 1),
        ("-bm 1 -clamp off -o 0.5 0.5 t.png", 3),
        ("-o 7 -clamp on t.png", 1),
        ("-o 7 t.png", 0),
        (".\\t.png", 0),
        ("sub/my  picture.png", 0),
        ("-blendu on -mm 0 1 sub/my  picture.png", 0),
    ],
)
def test_obj_options_of_textures_move_them(tmp_path, options, expected):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "my  picture.png").write_bytes(file(QUARTERS))
    found = wive.load_colors(obj(tmp_path, "f 1/1 2/2 3/3\n", f"\tmap_Kd  {options} \n"))
    np.testing.assert_allclose(found[0, 0], EXPECTED[expected], rtol=1e-6)


@pytest.mark.parametrize(
    ("faces", "places", "expected"),
    [
        ("f 1/1 2/2 3/x\n", None, "expected a corner such as"),
        ("f 1/1 2/+-1 3/1\n", None, "expected an integer, got '2/+-1'"),
        ("f 1/1 2/1 3/1\n", "vt\n", "expected 1 to 3 numbers"),
        ("f 1/1 2/1 3/1\n", "vt 0 x\n", "expected a number, got 'x'"),
    ],
)
def test_damaged_texture_coordinates_of_obj_are_one_line(tmp_path, faces, places, expected):
    with pytest.raises(ValueError, match=r"m\.obj: line \d+: ") as caught:
        wive.load_colors(obj(tmp_path, faces, places=places))
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def bomb(width: int, height: int) -> bytes:
    """A PNG file of some bytes that claims so many pixels."""
    data = bytearray(file(QUARTERS))
    at = data.index(b"IHDR")
    data[at + 4 : at + 12] = width.to_bytes(4, "big") + height.to_bytes(4, "big")
    data[at + 17 : at + 21] = __import__("zlib").crc32(data[at : at + 17]).to_bytes(4, "big")
    return bytes(data)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"no picture",
        file(QUARTERS)[:48],
        file(QUARTERS).replace(b"IDAT", b"IDAX"),
        bomb(MOST_PIXELS, 2),
        bomb(2**31 - 1, 2**31 - 1),
        bomb(8192, 8193),
        b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 1 1\n%%EOF\n",
    ],
)
def test_a_picture_that_can_not_be_read_leaves_the_colour_of_the_material(tmp_path, data):
    model = gltf(middles(), data + b" ", surface={"baseColorFactor": [0.5, 0.5, 0.5, 1]})
    np.testing.assert_allclose(wive.load_colors(model.glb()), np.full((12, 3), 0.4), rtol=1e-6)
    path = obj(tmp_path, "f 1/1 2/2 3/3\n", "Kd 0.5 0.5 0.5\nmap_Kd t.png\n")
    (tmp_path / "t.png").write_bytes(data)
    np.testing.assert_allclose(wive.load_colors(path)[0, 0], [GRAY] * 3, rtol=1e-6)


@pytest.mark.parametrize(
    "name",
    ["../t.png", "/dev/zero", "missing.png", "sub/../../t.png", "fifo", "sub", "a\0b", "C:/t.png", "zero"],
)
def test_pictures_are_looked_for_below_the_folder_alone_and_are_ordinary_files(tmp_path, name):
    folder = tmp_path / "inner"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "t.png").write_bytes(file(QUARTERS))
    if hasattr(os, "mkfifo"):
        os.mkfifo(folder / "fifo")
        (folder / "zero").symlink_to("/dev/zero")
    path = obj(folder, "f 1/1 2/2 3/3\n", f"Kd 0.5 0.5 0.5\nmap_Kd {name}\n")
    np.testing.assert_allclose(wive.load_colors(path)[0, 0], [GRAY] * 3, rtol=1e-6)
    (folder / "m.glb").write_bytes(gltf(middles(), uri=name).glb())
    assert wive.load_colors(folder / "m.glb") is None
    (folder / "m.glb").write_bytes(gltf(middles(), uri="t.png").glb())
    assert wive.load_colors(folder / "m.glb") is not None
    assert wive.load_colors((folder / "m.glb").read_bytes()) is None  # bytes have no folder


def test_without_pillow_surfaces_have_the_colour_of_the_material(monkeypatch):
    model = gltf(middles(), file(QUARTERS), surface={"baseColorFactor": [0.5, 0.5, 0.5, 1]})
    monkeypatch.setitem(sys.modules, "PIL", None)
    np.testing.assert_allclose(wive.load_colors(model.glb()), np.full((12, 3), 0.4), rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda root: root.update(textures=[]), "refers to textures[0], expected an index below 0"),
        (lambda root: root.update(images=[]), "refers to images[0], expected an index below 0"),
        (lambda root: root["textures"][0].update(source="x"), "source: expected a whole number"),
        (lambda root: root["images"][0].update(bufferView=99), "refers to bufferViews[99]"),
        (lambda root: root["images"][0].update(uri=3), "images[0]: uri: expected text, found 3"),
        (lambda root: root["images"][0].update(uri="data:x;base64,!"), "base64 data is damaged"),
        (lambda root: root["accessors"][1].update(count=11), "TEXCOORD_0: expected 12 places, found 11"),
        (lambda root: root["accessors"][1].update(type="VEC3"), "type: expected 'VEC2'"),
        (
            lambda root: root["textures"][0].update(sampler=0) or root["samplers"][0].update(wrapS=7),
            "wrap: expected one of [10497, 33071, 33648], found [7, 10497]",
        ),
        (
            lambda root: root["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"].update(
                extensions={"KHR_texture_transform": {"rotation": "x"}}
            ),
            "rotation: expected 1 finite numbers, found ['x']",
        ),
    ],
)
def test_damaged_textures_of_gltf_are_refused_by_one_line(change, expected):
    model = gltf(middles(), file(QUARTERS))
    change(model.json)
    with pytest.raises(ValueError, match=r"^mesh \(bytes\): ") as caught:
        wive.load_colors(model.glb())
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(wive.load_mesh(model.glb())[1]) == 4


def test_textures_are_read_once_unless_they_are_too_many(monkeypatch):
    monkeypatch.setattr("wive._internal.formats.colours.texture.MOST_HELD", 3 * QUARTERS.nbytes)
    textures, found = Textures(), []

    def find(key: int) -> bytes:
        found.append(key)
        return file(QUARTERS)

    for key in (1, 2, 3, 1, 2, 3, 4, 4, 1):
        np.testing.assert_array_equal(textures.get(key, lambda key=key: find(key)), QUARTERS)
    assert found == [1, 2, 3, 4, 1]


def test_pictures_of_16_bits_keep_their_upper_ones(tmp_path):
    data = io.BytesIO()
    Image.fromarray(np.full((2, 2), 0x8000, np.uint16)).save(data, "PNG")
    half = 0.8 * linear(np.array([0x80]), 255)[0]
    found = wive.load_colors(gltf(middles(), data.getvalue()).glb())
    np.testing.assert_allclose(found[:, 0], np.full((4, 3), half), rtol=1e-6)


def test_a_model_of_json_names_its_textures(tmp_path):
    model = gltf(middles(), uri="t.png")
    model.json["buffers"][0]["uri"] = "b.bin"
    (tmp_path / "b.bin").write_bytes(model.blob)
    (tmp_path / "t.png").write_bytes(file(QUARTERS))
    (tmp_path / "m.gltf").write_text(json.dumps(model.json))
    np.testing.assert_allclose(wive.load_colors(tmp_path / "m.gltf")[:, 0], EXPECTED, rtol=1e-6)


def test_damaged_files_have_colours_that_fit_or_are_one_line(tmp_path):
    turned = {"extensions": {"KHR_texture_transform": {"offset": [0, 1], "rotation": 1.5, "scale": [2, 1]}}}
    model = gltf(middles(), file(QUARTERS), base=turned, sampler={"wrapS": 33071}, texture={"sampler": 0})
    check_damaged(model.glb(), "glb", 16)
    random = np.random.default_rng(17)
    path = obj(
        tmp_path, "f 1/1 2/2 3/3\nf -5/10 -4/11 -3/12 1/1\n", "Kd 1 1 1\nmap_Kd -s 1 2 -clamp on t.png\n"
    )
    for name in ("m.mtl", "t.png") * 100:  # other files never stop the mesh's
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(damaged(whole, random))
        colours = wive.load_colors(path)
        assert colours is None or colours.shape == (3, 1, 3)
        (tmp_path / name).write_bytes(whole)
