"""The programs in `examples` that start rays at surfaces find what is known of simple shapes."""

import sys
from pathlib import Path

import numpy as np
import pytest
from support.meshes import sphere
from support.programs import example

import wive


@pytest.fixture
def shell() -> tuple[np.ndarray, np.ndarray]:
    """A hollow sphere of radius 1 whose wall is a tenth thick."""
    vertices, faces = sphere(4)
    return np.concatenate([vertices, 0.9 * vertices]), np.concatenate([faces, faces[:, ::-1] + len(vertices)])


def test_a_shell_is_as_thick_as_its_wall(shell: tuple[np.ndarray, np.ndarray]) -> None:
    found, areas = example("thickness").thickness(wive.Scene(*shell))
    assert (abs(found - 0.1) < 2e-3).all()
    assert areas.sum() == pytest.approx(4 * np.pi * (1 + 0.81), rel=0.01)


def test_a_shell_is_open_outside_and_closed_inside(shell: tuple[np.ndarray, np.ndarray]) -> None:
    openness = example("openness").openness
    found = openness(wive.Scene(*shell), rays=4)
    half = len(found) // 2
    assert (found[:half] == 1).all() and (found[half:] == 0).all()
    assert (openness(wive.Scene(*shell), rays=4, reach=0.01) > 0.5).mean() > 0.9


def test_an_occlusion_picture_is_that_of_the_renderer(tmp_path: Path) -> None:
    vertices, faces = sphere(4)
    ground = np.float32([[-9, -1, -9], [9, -1, -9], [9, -1, 9], [-9, -1, 9]])
    mesh = (
        np.concatenate([vertices, ground]),
        np.concatenate([faces, [[2562, 2564, 2563], [2562, 2565, 2564]]]),
    )
    scene, camera = wive.Scene(*mesh), wive.Camera(eye=(2, 3, 6), target=(0, 0, 0))
    found = example("occlusion_picture").occlusion(scene, camera, 96, 54, rays=64)
    expected = wive.render(scene, camera, shading="ao", width=96, height=54, spp=64)[..., 0]
    assert abs(found - expected).mean() < 0.04 and found.min() < 0.6
    assert found[:4].mean() == pytest.approx(expected[:4].mean(), abs=0.02)


def test_programs_take_files(
    shell: tuple[np.ndarray, np.ndarray],
    tmp_path: Path,
    capsys: pytest.CaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    np.savez("shell.npz", vertices=shell[0], faces=shell[1])
    for name in ("thickness", "openness", "undercut", "xray", "signed_distance", "occlusion_picture"):
        monkeypatch.setattr(sys, "argv", [name, "shell.npz"])
        example(name).main()
        assert (tmp_path / f"{name}.png").exists()
    assert "least 0.099" in (text := capsys.readouterr().out) and "100.0% of the surface" in text
    assert np.load("openness.npy").shape == (len(shell[1]),)
    assert np.load("occlusion_picture.npy").shape == (270, 480)


def test_the_outside_of_a_shell_is_no_undercut_and_all_of_its_inside_is(
    shell: tuple[np.ndarray, np.ndarray],
) -> None:
    found, areas = example("undercut").undercut(wive.Scene(*shell), np.array([0.2, 0.3, 0.9]))
    half = len(found) // 2
    assert not found[:half].any() and found[half:].all()
    assert areas[:half].sum() == pytest.approx(4 * np.pi, rel=0.01)


def test_an_x_ray_of_a_shell_passes_its_wall_twice(shell: tuple[np.ndarray, np.ndarray]) -> None:
    module = example("xray")
    camera = wive.OrthographicCamera((0, -3, 0), (0, 0, 0), up=(0, 0, 1), view_height=2.4)
    found = module.through(wive.Scene(*shell), camera)
    middle = found[module.HEIGHT // 2, module.WIDTH // 2]
    assert middle == pytest.approx(0.2, abs=2e-3) and found[0, 0] == 0
    volume = found.sum() * (2.4 / module.HEIGHT) ** 2
    assert volume == pytest.approx(4 / 3 * np.pi * (1 - 0.9**3), rel=0.01)


def test_a_slice_of_a_ball_has_the_distances_to_it() -> None:
    places, found = example("signed_distance").slice_of(wive.Scene(*sphere(4)))
    np.testing.assert_allclose(found, np.linalg.norm(places, axis=-1) - 1, atol=2e-3)
    assert (found < 0).any() and (found > 0).any()
