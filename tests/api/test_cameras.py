"""Cameras and pictures of no sense are refused in one line that begins with the argument's name."""

import fractions
import re
import warnings

import numpy as np
import pytest
from support.meshes import TRIANGLE, sphere

import wive

NAN, INF = float("nan"), float("inf")
BOX = [[0, 0, 0], [1, 1, 1]]
GOOD = {"eye": (0, 0, 5), "target": (0, 0, 0)}
NO_VECTORS = [
    ("abc", TypeError),
    (None, TypeError),
    (["1", "2", "3"], TypeError),
    ([True, False, True], TypeError),
    ([1j, 0, 0], TypeError),
    ([[1, 2], [3]], ValueError),
    (5.0, ValueError),
    ([1, 2], ValueError),
    ([[1, 2, 3]], ValueError),
    ([], ValueError),
    ([1, 2, NAN], ValueError),
    ([1, -INF, 2], ValueError),
    (np.array(["1e4000", "0", "1"], np.longdouble), ValueError),
]
NO_NUMBERS = [
    ("40", TypeError),
    (b"40", TypeError),
    (None, TypeError),
    (1j, TypeError),
    (True, TypeError),
    (np.complex64(1), TypeError),
    ([40], TypeError),
    (np.array([40.0]), TypeError),
    ([[1], [1, 2]], TypeError),
    (NAN, ValueError),
    (INF, ValueError),
    (-INF, ValueError),
    (10**400, ValueError),
    (0, ValueError),
    (-1.0, ValueError),
]


def refused(kind, name: str, make) -> str:
    """The message of the error that `make` must raise, with no warning before it."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(kind) as error:
            make()
    text = str(error.value)
    assert re.match(rf"{name}\b", text), text
    assert "\n" not in text
    assert len(text) < 250
    return text


@pytest.mark.parametrize("name", ["eye", "target", "up"])
@pytest.mark.parametrize(("value", "kind"), NO_VECTORS)
def test_what_is_no_vector(name, value, kind):
    refused(kind, name, lambda: wive.Camera(**{**GOOD, name: value}))


@pytest.mark.parametrize(("value", "kind"), NO_VECTORS)
def test_framing_with_an_up_of_no_sense(value, kind):
    if value is not None:  # leaves the choice to wive
        refused(kind, "up", lambda: wive.Camera.framing(BOX, value))


@pytest.mark.parametrize(
    ("value", "kind"), [*NO_NUMBERS, (180, ValueError), (200, ValueError), (np.ma.masked, TypeError)]
)
def test_a_field_of_view_of_no_sense(value, kind):
    refused(kind, "fov", lambda: wive.Camera(**GOOD, fov=value))
    refused(kind, "fov", lambda: wive.Camera.framing(BOX, fov=value))


@pytest.mark.parametrize(("value", "kind"), NO_NUMBERS)
def test_an_aspect_of_no_sense(value, kind):
    refused(kind, "aspect", lambda: wive.Camera.framing(BOX, aspect=value))


@pytest.mark.parametrize(
    ("bounds", "kind"),
    [
        ("box", TypeError),
        (None, TypeError),
        ([["a"] * 3] * 2, TypeError),
        ([0, 0, 0, 1, 1, 1], ValueError),
        (np.zeros((3, 2)), ValueError),
        (np.zeros((1, 2, 3)), ValueError),
        ([], ValueError),
        ([[0, 0], [1, 1, 1]], ValueError),
        ([[0, 0, NAN], [1, 1, 1]], ValueError),
        ([[INF] * 3, [-INF] * 3], ValueError),
        ([[0, 0, 0], [1, 1, INF]], ValueError),
        ([[0, 2, 0], [1, 1, 1]], ValueError),
        ([[-1e300] * 3, [1e300] * 3], ValueError),
    ],
)
def test_bounds_of_no_sense(bounds, kind):
    refused(kind, "bounds", lambda: wive.Camera.framing(bounds))


@pytest.mark.parametrize("up", [(0, 0, 0), (-0.0, 0, 0), (0, 0, 2), (0, 0, -1e-300), (0, 1e-12, 1)])
def test_up_is_not_zero_and_not_along_the_view(up):
    refused(ValueError, "up", lambda: wive.Camera(**GOOD, up=up))


@pytest.mark.parametrize("eye", [(0, 0, 0), (-0.0, 0, 0), (1e-17 - 1e-17, 0, 0)])
def test_the_eye_is_not_at_the_target(eye):
    refused(ValueError, "eye and target", lambda: wive.Camera(eye, (0, 0, 0)))


@pytest.mark.parametrize("name", ["eye", "target"])
def test_a_camera_is_at_float32_numbers(name):
    refused(ValueError, name, lambda: wive.Camera(**{**GOOD, name: (0, 1e300, 0)}))


@pytest.mark.parametrize("up", [(0, 1e-300, 0), (0, 1e300, 0), (0, 5e-324, 0), (0, 1.7e308, 1.7e308)])
@pytest.mark.parametrize("distance", [5e-324, 1e-200, 1, 1e30])
def test_directions_of_any_length_give_unit_vectors(up, distance):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        frame = wive.Camera((distance, 0, 0), (0, 0, 0), up, 90).frame(100, 100)
    np.testing.assert_allclose(frame[1:3], [[-1, 0, 0], [0, 0, -1]], atol=1e-6) if up[2] == 0 else None
    np.testing.assert_allclose(np.linalg.norm(frame[1:].astype(np.float64), axis=1), 1, rtol=1e-6)


@pytest.mark.parametrize("point", [(0, 0, 0), (1e17, 0, -3), (1e-30, 5, 1e18), (-1e38, 1e38, 1e38)])
@pytest.mark.parametrize("size", [0, 1e-3])
def test_a_point_however_far_away_is_framed(point, size):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        camera = wive.Camera.framing([point, np.add(point, size)])
        eye, forward = camera.frame(16, 9)[:2].astype(np.float64)
    towards = np.asarray(point) - eye
    assert towards @ forward > 0.8 * np.linalg.norm(towards) > 0


@pytest.mark.parametrize(
    "options", [{"fov": 1e-300}, {"fov": 1e-44}, {"aspect": 1e-300}, {"aspect": 1e300}, {"fov": 5e-324}]
)
def test_framing_that_leaves_no_picture_is_refused(options):
    refused(ValueError, "fov", lambda: wive.Camera.framing(BOX, **options))


@pytest.mark.parametrize("fov", [40, np.float32(40), np.int8(40), fractions.Fraction(40), np.array(40.0)])
def test_any_real_number_is_a_field_of_view(fov):
    np.testing.assert_array_equal(
        wive.Camera(**GOOD, fov=fov).frame(4, 3), wive.Camera(**GOOD, fov=40).frame(4, 3)
    )


@pytest.mark.parametrize(
    ("name", "value", "kind"),
    [
        *(
            ("camera", value, TypeError)
            for value in ((0, 0, 5), "front", np.eye(4), wive.Camera, {}, 0, False)
        ),
        *(
            (name, value, kind)
            for name in ("width", "height", "spp", "bounces", "seed", "threads")
            for value, kind in (
                (-1, ValueError),
                (10**30, ValueError),
                (4.0, TypeError),
                (True, TypeError),
                ("4", TypeError),
                (NAN, TypeError),
                ([4], TypeError),
                (np.array([4, 4]), TypeError),
                (np.float32(4), TypeError),
            )
        ),
        *((name, 0, ValueError) for name in ("width", "height", "spp", "threads")),
        *((name, None, TypeError) for name in ("width", "height", "spp", "bounces", "seed")),
        pytest.param("width", 10**5000, ValueError, id="width of 5001 digits"),
        pytest.param("seed", 10**5000, ValueError, id="seed of 5001 digits"),
        ("width", 65_537, ValueError),
        ("albedo", "red", ValueError),
        ("albedo", ["gray"], TypeError),
        ("albedo", np.zeros(4), ValueError),
        ("albedo", np.full(3, np.nan), ValueError),
        ("albedo", [[0, 0, 2.0]], ValueError),
        ("albedo", np.ones((1, 3), int), TypeError),
        ("shading", "fast", ValueError),
        ("shading", None, ValueError),
        ("sky", "blue", ValueError),
        ("sun", (0, 0, 0), ValueError),
        ("sun", (0, 1), ValueError),
        ("sun", (0, 0, np.nan), ValueError),
        ("exposure", "bright", ValueError),
        ("exposure", np.inf, ValueError),
        ("exposure", 61, ValueError),
        ("exposure", None, TypeError),
        ("reach", 0, ValueError),
        ("reach", -np.inf, ValueError),
        ("reach", "far", TypeError),
        ("progress", "no", TypeError),
        ("progress", np.zeros(3), TypeError),
    ],
)
def test_a_picture_refuses_each_argument_of_no_sense(name, value, kind):
    scene = wive.Scene(*TRIANGLE)
    small = {"width": 4, "height": 4, "spp": 1}
    refused(kind, name, lambda: wive.render(scene, **{**small, name: value}))


@pytest.mark.parametrize("scene", [None, TRIANGLE, "scene", wive.Scene, np.zeros((3, 3))])
def test_a_picture_is_of_a_scene(scene):
    assert "wive.Scene" in refused(TypeError, "scene", lambda: wive.render(scene, width=4, height=4))


def test_a_picture_of_a_camera_far_away_has_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        image = wive.render(
            wive.Scene(*sphere(1)), wive.Camera((0, 0, 3e38), (0, 0, -3e38)), width=4, height=4, spp=1
        )
    assert np.isfinite(image).all()


def test_query_options_that_are_no_flags_are_refused():
    scene = wive.Scene(*TRIANGLE)
    for value in ("no", 1, None, np.zeros(2)):
        refused(TypeError, "stats", lambda value=value: scene.intersect([0, 0, 1], [0, 0, -1], stats=value))
    for value in (np.zeros(2), [8], {}, None, 8.0, True, "8"):
        refused(ValueError, "lanes", lambda value=value: scene.intersect([0, 0, 1], [0, 0, -1], lanes=value))
