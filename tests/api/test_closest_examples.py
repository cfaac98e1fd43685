"""The programs in `examples` that use closest points and insides find what is known of simple shapes."""

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
    vertices, faces = sphere(3)
    return np.concatenate([vertices, 0.9 * vertices]), np.concatenate([faces, faces[:, ::-1] + len(vertices)])


def test_half_a_ball_lies_inside_another() -> None:
    vertices, faces = sphere(3)
    one, other = wive.Scene(vertices, faces), wive.Scene(vertices + np.float32([1, 0, 0]), faces)
    volume, common = example("contains").overlap(one, other, 40_000)
    assert volume == pytest.approx(4 / 3 * np.pi, rel=0.03)
    assert common / volume == pytest.approx(5 / 16, rel=0.05)  # two caps of height 1/2


def test_balls_in_a_shell_are_as_thick_as_its_wall_and_in_a_ball_as_the_ball(
    shell: tuple[np.ndarray, np.ndarray],
) -> None:
    found = example("inscribed_balls").diameters(wive.Scene(*shell))
    assert (abs(found - 0.1) < 5e-3).all()
    solid = example("inscribed_balls").diameters(wive.Scene(*sphere(3)))
    assert (abs(solid - 2) < 0.3).all()  # the flat triangles nearby are in the way


def test_programs_take_files(
    shell: tuple[np.ndarray, np.ndarray],
    tmp_path: Path,
    capsys: pytest.CaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.chdir(tmp_path)
    np.savez("shell.npz", vertices=shell[0], faces=shell[1])
    for name, files in (("inscribed_balls", 1), ("contains", 2)):
        monkeypatch.setattr(sys, "argv", [name, *["shell.npz"] * files])
        example(name).main()
        assert (tmp_path / f"{name}.png").exists()
    text = capsys.readouterr().out
    assert "balls: least 0.09" in text and "100.0% inside the other part" in text


def test_one_file_alone_is_refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(sys, "argv", ["contains", "shell.npz"])
    with pytest.raises(SystemExit):
        example("contains").main()
    assert "expected two mesh files or none" in capsys.readouterr().err
