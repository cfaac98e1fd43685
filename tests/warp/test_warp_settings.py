"""Warp's process-wide settings are put back, and what takes seconds says so."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.meshes import sphere

import wive
from wive import _cpu, warp_kernels
from wive.warp_kernels.tree import quiet
from wive.warp_kernels.tree.rewriting import rewrite_nodes

pytestmark = pytest.mark.timeout(120)

LEVELS = (wp.LOG_DEBUG, wp.LOG_INFO, wp.LOG_WARNING, wp.LOG_ERROR)


@pytest.fixture
def settings(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Puts back what a test changes."""
    wp.init()
    for name in ("log_level", "enable_cpu_blocks", "kernel_cache_dir"):
        monkeypatch.setattr(wp.config, name, getattr(wp.config, name))
    return monkeypatch


@pytest.mark.parametrize("blocks", [False, True])
@pytest.mark.parametrize("level", LEVELS)
def test_scenes_and_queries_leave_the_settings_of_warp_as_they_were(
    level: int, blocks: bool, settings: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    wp.config.log_level, wp.config.enable_cpu_blocks = level, blocks
    scene = wive.Scene(*sphere(1), device="cpu")
    for lanes in (8, 1):
        scene.intersect(np.zeros((3, 3)), np.ones((3, 3)), lanes=lanes)
    warp_kernels.upload(_cpu.Bvh(*sphere(1)), "cpu")
    assert (wp.config.log_level, wp.config.enable_cpu_blocks) == (level, blocks)


def test_settings_are_put_back_by_the_last_of_blocks_that_overlap(settings: pytest.MonkeyPatch) -> None:
    wp.config.log_level = wp.LOG_INFO
    first, second = quiet.quiet(), quiet.quiet()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert wp.config.log_level == wp.LOG_WARNING
    second.__exit__(None, None, None)
    assert wp.config.log_level == wp.LOG_INFO


def test_a_level_that_is_set_meanwhile_stays(settings: pytest.MonkeyPatch) -> None:
    wp.config.log_level = wp.LOG_INFO
    with quiet.quiet():
        wp.config.log_level = wp.LOG_ERROR
    assert wp.config.log_level == wp.LOG_ERROR


@pytest.mark.parametrize(("level", "says"), [(level, level <= wp.LOG_INFO) for level in LEVELS])
def test_a_kernel_that_is_not_in_the_cache_is_said_to_be_compiled(
    level: int,
    says: bool,
    settings: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    wp.config.kernel_cache_dir, wp.config.log_level = str(tmp_path), level
    kernel = rewrite_nodes
    quiet._say_if_compiled(kernel, device="cpu", block_dim=128)
    said = f"wive: compiling rewrite_nodes for cpu, kept in {tmp_path}\n"
    assert capsys.readouterr().err == (said if says else "")
    folder = tmp_path / kernel.module.get_module_identifier(1)
    folder.mkdir()
    (folder / "kernel.sm90.cubin").touch()  # for another device
    quiet._say_if_compiled(kernel, device="cpu", block_dim=128)
    assert capsys.readouterr().err == (said if says else "")
    (folder / "kernel.o").touch()
    quiet._say_if_compiled(kernel, device="cpu", block_dim=128)
    assert capsys.readouterr().err == ""


def test_a_launch_of_nothing_is_not_said_to_compile(
    settings: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wp.config.kernel_cache_dir, wp.config.log_level = str(tmp_path), wp.LOG_INFO
    settings.setattr(quiet, "_launched", set())
    none = wp.empty(0, dtype=wp.float32, device="cpu")
    for dim in (0, (0, 8), (3, 0)):
        quiet.launch(rewrite_nodes, dim, [none], [], device="cpu")
    assert capsys.readouterr().err == "" and quiet._launched == set()


def test_a_process_says_what_it_compiles_and_nothing_if_all_is_compiled(tmp_path: Path) -> None:
    code = """
import warp as wp, wive
scene = wive.Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], device="cpu")
print(wp.config.log_level == wp.LOG_INFO)"""
    environment = {**os.environ, "WARP_CACHE_PATH": str(tmp_path)}
    for expected in (["wive: compiling rewrite_nodes for cpu, kept in "], []):
        command = [sys.executable, "-c", code]
        ran = subprocess.run(
            command, capture_output=True, text=True, timeout=100, cwd=tmp_path, env=environment, check=True
        )
        assert ran.stdout == "True\n"
        lines = ran.stderr.splitlines()
        assert [line[: len(start)] for line, start in zip(lines, expected, strict=True)] == expected


def user_kernel(options: dict[str, object]) -> wp.Kernel:
    """A kernel of a user's, in a module with these options."""

    @wp.kernel(module="unique", enable_backward=False, module_options=options)
    def occlude(bvh: warp_kernels.FastBvh, occluded: wp.array(dtype=wp.bool)):
        i = wp.tid()
        up = wp.vec3(0.0, 0.0, 1.0)
        occluded[i] = warp_kernels.any_hit(bvh, wp.vec3(0.0, 0.0, 0.0), up, 0.0, wp.inf)

    return occlude


REFUSAL = "wive: compile this kernel's module with fast_math=False"


def test_fast_math_is_refused_on_cuda(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    module = user_kernel({"fast_math": True}).module
    with pytest.raises(Exception, match="CUDA kernel build failed"):
        wp.compile_aot_module(module, arch=90, module_dir=str(tmp_path), use_ptx=True)
    assert REFUSAL in capfd.readouterr().err


def test_compiler_flags_for_fast_math_are_refused_on_the_cpu(capfd: pytest.CaptureFixture[str]) -> None:
    kernel = user_kernel({"cpu_compiler_flags": "-ffast-math"})
    tree = warp_kernels.upload(_cpu.Bvh(*sphere(1), "fast"), "cpu")
    with pytest.raises(Exception, match="failed"):
        wp.launch(kernel, 1, [tree.handle], [wp.zeros(1, dtype=wp.bool, device="cpu")], device="cpu")
    assert REFUSAL in capfd.readouterr().err
