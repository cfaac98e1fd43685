"""Users' own kernels take the handle of one kind of tree: others are refused, and refusals leave no trace."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

wp = pytest.importorskip("warp")

from support.meshes import random_rays, soup

import wive
from wive import _cpu, warp_kernels
from wive.warp_kernels.lanes.precision import PRECISIONS
from wive.warp_kernels.tree.handle import HANDLES

pytestmark = pytest.mark.timeout(120)

MESH = soup(300, 1)
RAYS = random_rays(50, 2, 0.0, 1.0)


@wp.kernel(module="unique", enable_backward=False)
def trace(
    bvh: warp_kernels.Bvh,
    origins: wp.array(dtype=wp.vec3),
    directions: wp.array(dtype=wp.vec3),
    prim: wp.array(dtype=wp.int32),
    occluded: wp.array(dtype=wp.bool),
    counts: wp.array(dtype=wp.int32),
):
    i = wp.tid()
    prim[i] = warp_kernels.closest_hit(bvh, origins[i], directions[i], 0.0, wp.inf).prim
    occluded[i] = warp_kernels.any_hit(bvh, origins[i], directions[i], 0.0, wp.inf)
    counts[i] = warp_kernels.count_hits(bvh, origins[i], directions[i], 0.0, wp.inf)


def launched(handle: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the kernel finds with a handle: prims, whether anything, how many."""
    rays = [wp.array(rows, dtype=wp.vec3, device="cpu") for rows in RAYS]
    found = [wp.full(50, 7, dtype=dtype, device="cpu") for dtype in (wp.int32, wp.bool, wp.int32)]
    wp.launch(trace, 50, [handle, *rays], found, device="cpu")
    prim, occluded, counts = (array.numpy() for array in found)
    return prim, occluded, counts


def scene_of(accuracy: str, precision: str, **options: str) -> wive.Scene:
    vertices, faces = MESH
    return wive.Scene(vertices.astype(precision), faces, device="cpu", accuracy=accuracy, **options)


OTHERS = [kind for kind in HANDLES if kind != ("watertight", "float32")]


@pytest.mark.parametrize(("accuracy", "precision"), OTHERS)
def test_a_handle_of_another_kind_is_refused_in_python(accuracy: str, precision: str) -> None:
    given = HANDLES[accuracy, precision].key
    with pytest.raises(ValueError) as error:
        launched(scene_of(accuracy, precision).tree.handle)
    assert str(error.value) == (
        f"bvh must be a Bvh, got a {given}: annotate bvh as wive.warp_kernels.{given}, "
        "or make the scene with accuracy='watertight' and float32 vertices"
    )


@pytest.mark.parametrize("precision", PRECISIONS)
@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
def test_the_handle_of_a_compressed_tree_can_not_be_taken(accuracy: str, precision: str) -> None:
    tree = scene_of(accuracy, precision, nodes="compressed").tree
    with pytest.raises(ValueError, match="'compressed': make the scene with nodes='float32', or use"):
        _ = tree.handle


def test_the_handle_of_a_tree_that_is_too_deep_can_not_be_taken() -> None:
    tree = scene_of("watertight", "float32").tree
    tree.batch_handle.stack = 129
    with pytest.raises(ValueError, match="it needs 129: use launch_closest, launch_any and launch_count"):
        _ = tree.handle


def unchecked(handle: object) -> object:
    """The handle as a Warp would pass it that does not ask it for its type."""
    return SimpleNamespace(__ctype__=lambda: handle._ctype)


@pytest.mark.parametrize(("accuracy", "precision"), OTHERS)
def test_a_kernel_refuses_a_handle_that_python_let_pass_and_harms_no_later_query(
    accuracy: str, precision: str
) -> None:
    scene, host = scene_of(accuracy, precision), wive.Scene(*MESH, accuracy=accuracy)
    prim, occluded, counts = launched(unchecked(scene.tree.handle))
    assert (prim == -1).all() and not occluded.any() and not counts.any()
    vec3 = PRECISIONS[precision].vec3
    rays = [wp.array(rows.astype(precision), dtype=vec3, device="cpu") for rows in RAYS]
    for given in (rays, [array.numpy() for array in rays]):  # both paths, before the refusal is reported
        hits = scene.intersect(*given)
        np.testing.assert_array_equal(np.asarray(hits.prim), host.intersect(*RAYS).prim)
        np.testing.assert_array_equal(np.asarray(scene.occluded(*given)), host.occluded(*RAYS))
        np.testing.assert_array_equal(np.asarray(scene.count(*given)), host.count(*RAYS))
    with pytest.raises(warp_kernels.CorruptTreeError, match="was given this one's and found nothing"):
        warp_kernels.check(scene.tree)
    warp_kernels.check(scene.tree)  # reported once


def test_a_tree_that_was_overwritten_stays_so_whatever_is_refused() -> None:
    tree = warp_kernels.upload(_cpu.Bvh(*MESH), "cpu")
    tree.error.numpy()[:] = 1
    for _ in range(2):
        with pytest.raises(warp_kernels.CorruptTreeError, match="memory was overwritten"):
            warp_kernels.check(tree)
    prim, occluded, counts = launched(tree.handle)
    assert (prim == -1).all() and not occluded.any() and not counts.any()


def test_a_handle_of_the_right_kind_finds_what_the_core_finds() -> None:
    host = wive.Scene(*MESH)
    prim, occluded, counts = launched(scene_of("watertight", "float32").tree.handle)
    np.testing.assert_array_equal(prim, host.intersect(*RAYS).prim)
    np.testing.assert_array_equal(occluded, host.occluded(*RAYS))
    np.testing.assert_array_equal(counts, host.count(*RAYS))


def test_trees_of_one_kind_share_a_type_and_others_do_not() -> None:
    tree = scene_of("watertight", "float32").tree
    assert tree.handle._cls is warp_kernels.Bvh
    assert dataclasses.replace(tree, accuracy="fast").handle._cls is warp_kernels.Bvh
    assert len({handle.key for handle in HANDLES.values()}) == len(HANDLES)


def test_what_is_no_handle_and_no_tree_is_refused_with_what_to_pass() -> None:
    scene = scene_of("watertight", "float32")
    with pytest.raises(TypeError, match=r"got the Tree itself: pass scene\.tree\.handle$"):
        launched(scene.tree)
    with pytest.raises(TypeError, match=r"got a Scene: pass scene\.tree\.handle$"):
        launched(scene)
    with pytest.raises(
        TypeError, match=r"^tree must be a wive\.warp_kernels\.Tree, got Scene: pass scene\.tree$"
    ):
        warp_kernels.check(scene)
    assert "backend='warp', device='cpu', accuracy=" in repr(scene)
