"""`wive trace --all` writes every hit of every ray."""

import numpy as np
import pytest
from support.meshes import random_rays, soup

import wive
from wive.cli import main


@pytest.mark.parametrize("count", [1003, 0])
def test_trace_all_writes_the_hits_of_the_library(tmp_path, capsys, count):
    vertices, faces = soup(200, seed=1)
    np.savez(tmp_path / "soup.npz", vertices=vertices, faces=faces)
    origins, directions = random_rays(count, seed=2, low=-0.5, high=1.5)
    np.save(tmp_path / "rays.npy", np.column_stack([origins, directions]))
    files = [str(tmp_path / name) for name in ("soup.npz", "rays.npy", "hits.npz")]
    assert main(["trace", "--all", "--piece", "100", *files[:2], "-o", files[2]]) == 0
    expected = wive.Scene(vertices, faces).intersect_all(origins, directions)
    assert f"{count:,} rays in" in (said := capsys.readouterr().out)
    assert f", {len(expected.t):,} hits, " in said
    with np.load(files[2]) as hits:
        assert sorted(hits) == ["offsets", "prim", "t", "uv"]
        for name in hits:
            np.testing.assert_array_equal(hits[name], getattr(expected, name))
            assert hits[name].dtype == getattr(expected, name).dtype


def test_all_hits_have_a_limit(tmp_path, capsys):
    vertices, faces = soup(200, seed=1)
    np.savez(tmp_path / "soup.npz", vertices=vertices, faces=faces)
    np.save(tmp_path / "rays.npy", np.column_stack(random_rays(100, seed=2, low=0, high=1)))
    files = [str(tmp_path / name) for name in ("soup.npz", "rays.npy", "hits.npz")]
    command = ["trace", *files[:2], "-o", files[2]]
    assert main([*command, "--all", "--max-bytes", "100"]) == 2
    error = capsys.readouterr().err
    assert "more than the limit of 100 bytes: pass fewer rays" in error
    assert main([*command, "--max-bytes", "100"]) == 2
    assert (
        capsys.readouterr().err == "wive: error: max_bytes is only for all hits: add --all, or leave it out\n"
    )
    assert not (tmp_path / "hits.npz").exists()
    assert main([*command, "--all", "--max-bytes", "1000000"]) == 0
