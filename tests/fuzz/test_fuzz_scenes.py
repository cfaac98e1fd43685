"""Scenes and rays of any bits: every backend, node form and way to trace gives the same, right answer.

`pytest tests/fuzz --cases 16000` runs a million rays per test; the seed of a failing case is in its message.
"""

from collections.abc import Iterator

import numpy as np
import pytest
from support.batches import Batch
from support.odd_scenes import odd_case
from support.oracle import truth

import wive

CPU = [name for name, backend in wive.backends().items() if backend.usable and name != "warp"]
FORMS = {
    "fast": (np.float32, "fast", "float32"),
    "watertight": (np.float32, "watertight", "float32"),
    "compressed": (np.float32, "watertight", "compressed"),
    "exact": (np.float32, "exact", "float32"),
    "float64": (np.float64, "watertight", "float32"),
    "float64 compressed": (np.float64, "watertight", "compressed"),
}
MOST_EXACT = 9  # rays and triangles compared with fractions, which take a millisecond per pair


def scene_of(case: Batch, form: str, backend: str) -> wive.Scene:
    _, accuracy, nodes = FORMS[form]
    return wive.Scene(case.vertices, case.faces, backend=backend, accuracy=accuracy, nodes=nodes)


def answers(scene: wive.Scene, case: Batch, **work: int) -> dict[str, bytes]:
    """Every query's results as bits."""
    rays = case.origins, case.directions, case.tmin, case.tmax
    hits, many = scene.intersect(*rays, **work), scene.intersect_all(*rays, **work)
    results = {
        "t": hits.t, "prim": hits.prim, "uv": hits.uv, "occluded": scene.occluded(*rays, **work),
        "count": scene.count(*rays, **work), "offsets": many.offsets, "all t": many.t, "all prim": many.prim,
        "all uv": many.uv,
    }  # fmt: skip
    return {name: np.ascontiguousarray(array).tobytes() for name, array in results.items()}


def different(one: dict[str, bytes], other: dict[str, bytes]) -> list[str]:
    return [name for name in one if one[name] != other[name]]


@pytest.mark.parametrize("form", FORMS)
def test_backends_give_the_same_bits_however_rays_are_traced(form: str, seeds: Iterator[int]) -> None:
    for seed in seeds:
        case = odd_case(seed, FORMS[form][0])
        alone = answers(scene_of(case, form, "scalar"), case, threads=1, in_flight=1)
        for backend in CPU:
            scene = scene_of(case, form, backend)
            for in_flight in (1, 5, 24):
                found = answers(scene, case, threads=1, in_flight=in_flight)
                assert different(alone, found) == [], (seed, backend, in_flight)


@pytest.mark.parametrize(("form", "other"), [("watertight", "compressed"), ("float64", "float64 compressed")])
def test_compressed_nodes_give_the_same_bits(form: str, other: str, seeds: Iterator[int]) -> None:
    for seed in seeds:
        case = odd_case(seed, FORMS[form][0])
        found, compressed = (answers(scene_of(case, nodes, "auto"), case) for nodes in (form, other))
        assert different(found, compressed) == [], seed


@pytest.mark.parametrize("form", [form for form in FORMS if form != "fast"])
def test_queries_agree_with_each_other(form: str, seeds: Iterator[int]) -> None:
    for seed in seeds:
        case = odd_case(seed, FORMS[form][0])
        scene = scene_of(case, form, "auto")
        rays = case.origins, case.directions, case.tmin, case.tmax
        hits, many = scene.intersect(*rays), scene.intersect_all(*rays, touching=True)
        assert (hits.mask == scene.occluded(*rays)).all(), seed
        assert (hits.mask == (np.diff(many.offsets) > 0)).all(), seed
        first = many.offsets[:-1][hits.mask]
        assert (many.t[first] == hits.t[hits.mask]).all(), seed
        # Several hits may round to the same t.
        tied = (many.t == hits.t[many.ray]) & (many.prim == hits.prim[many.ray])
        assert np.isin(np.flatnonzero(hits.mask), many.ray[tied]).all(), seed
        assert ((hits.t >= case.tmin) & (hits.t <= case.tmax))[hits.mask].all(), seed
        assert (scene.count(*rays) == np.diff(scene.intersect_all(*rays).offsets)).all(), seed
        for ray in np.flatnonzero(np.diff(many.offsets) > 1):
            t = many.t[slice(*many.offsets[ray : ray + 2])]
            assert (t[1:] >= t[:-1]).all(), seed


def test_exact_hits_are_those_of_fractions(seeds: Iterator[int]) -> None:
    for seed in seeds:
        case = odd_case(seed, np.float32, rays=MOST_EXACT)
        few = case.faces[:MOST_EXACT]
        usable = np.isfinite(case.origins).all(axis=1) & np.isfinite(case.directions).all(axis=1)
        usable &= (abs(case.origins) <= 1e18).all(axis=1) & case.directions.any(axis=1)
        rays = tuple(array[usable] for array in (case.origins, case.directions, case.tmin, case.tmax))
        if not usable.any():
            continue
        hits = wive.Scene(case.vertices, few, accuracy="exact").intersect(*rays)
        right = truth(case.vertices, few, *rays)
        assert (hits.prim == right.prim).all(), seed
        assert (hits.t == right.t).all(), seed


def test_a_refit_gives_the_hits_of_a_new_scene(seeds: Iterator[int]) -> None:
    for seed in seeds:
        one, other = odd_case(seed, np.float32), odd_case(seed + 1, np.float32)
        vertices = other.vertices[np.arange(len(one.vertices)) % len(other.vertices)]
        for nodes in ("float32", "compressed"):
            scene = wive.Scene(one.vertices, one.faces, nodes=nodes)
            scene.refit(vertices)
            fresh = wive.Scene(vertices, one.faces, nodes=nodes)
            assert different(answers(scene, one), answers(fresh, one)) == [], (seed, nodes)
