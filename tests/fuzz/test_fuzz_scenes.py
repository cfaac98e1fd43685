"""Scenes and rays of any bits: every backend, node form and way to trace gives the same, right answer.

`pytest tests/fuzz --cases 16000` runs a million rays per test; the seed of a failing case is in its message.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from support.odd_answers import FORMS, answers, case_of, different, scene_of
from support.odd_arrays import LAYOUTS
from support.odd_scenes import odd_case
from support.oracle import truth

import wive

CPU = [name for name, backend in wive.backends().items() if backend.usable and name != "warp"]
MOST_EXACT = 9  # rays and triangles compared with fractions, which take a millisecond per pair


@pytest.mark.parametrize("form", FORMS)
def test_backends_give_the_same_bits_however_rays_are_traced(form: str, seeds: Iterator[int]) -> None:
    for seed in seeds:
        case = case_of(seed, form)
        alone = answers(scene_of(case, form, "scalar"), case, threads=1, in_flight=1)
        for backend in CPU:
            # In "fast" areas of the largest coordinates overflow, and the tree decides what is found.
            is_high = form != "fast" and seed % 2 == 1
            scene = scene_of(case, form, backend, quality="high" if is_high else "medium")
            for in_flight in (1, 5, 24):
                found = answers(scene, case, threads=1 + seed % 3, in_flight=in_flight)
                assert different(alone, found) == [], (seed, backend, in_flight)


@pytest.mark.parametrize(("form", "other"), [("watertight", "compressed"), ("float64", "float64 compressed")])
def test_compressed_nodes_give_the_same_bits(form: str, other: str, seeds: Iterator[int]) -> None:
    for seed in seeds:
        case = case_of(seed, form)
        found, compressed = (answers(scene_of(case, nodes), case) for nodes in (form, other))
        assert different(found, compressed) == [], seed


@pytest.mark.parametrize("form", [form for form in FORMS if form != "fast"])
def test_queries_agree_with_each_other(form: str, seeds: Iterator[int]) -> None:
    for seed in seeds:
        case = case_of(seed, form)
        scene, rays = scene_of(case, form), case[2:]
        hits, many = scene.intersect(*rays), scene.intersect_all(*rays, touching=True)
        assert (hits.mask == scene.occluded(*rays)).all(), seed
        hits.points(), hits.normals(), hits.spawn(rays[1]), hits.error_bound  # without a warning
        assert (hits.mask == (np.diff(many.offsets) > 0)).all(), seed
        first = many.offsets[:-1][hits.mask]
        assert (many.t[first] == hits.t[hits.mask]).all(), seed
        # Several hits may round to the same t.
        tied = (many.t == hits.t[many.ray]) & (many.prim == hits.prim[many.ray])
        assert np.isin(np.flatnonzero(hits.mask), many.ray[tied]).all(), seed
        with np.errstate(over="ignore"):
            tmin, tmax = (limit.astype(hits.t.dtype) for limit in rays[2:])
        assert ((hits.t >= tmin) & (hits.t <= tmax))[hits.mask].all(), seed
        if "fast" not in form:  # which may put the t of a sliver before its box
            assert scene.occluded(*rays[:3], hits.t)[hits.mask].all(), seed
        assert (scene.count(*rays) == np.diff(scene.intersect_all(*rays).offsets)).all(), seed
        for ray in np.flatnonzero(np.diff(many.offsets) > 1):
            t = many.t[slice(*many.offsets[ray : ray + 2])]
            assert (t[1:] >= t[:-1]).all(), seed


@pytest.mark.parametrize("form", FORMS)
def test_neither_order_nor_layout_nor_split_of_rays_changes_their_hits(
    form: str, seeds: Iterator[int]
) -> None:
    for seed in seeds:
        case, random = case_of(seed, form), np.random.default_rng(seed)
        scene = scene_of(case, form)
        hits = scene.intersect(*case[2:])
        order = random.permutation(len(case.origins))
        laid = [LAYOUTS[random.integers(len(LAYOUTS))](random, array[order]) for array in case[2:]]
        for part in np.split(np.arange(len(order)), np.sort(random.integers(len(order) + 1, size=2))):
            found = scene.intersect(*(array[part] for array in laid))
            for name in ("t", "prim", "uv"):
                expected = getattr(hits, name)[order[part]]
                assert getattr(found, name).tobytes() == expected.tobytes(), (seed, name)


@pytest.mark.parametrize("form", ["watertight", "exact", "float64", "float64 rays"])
def test_masked_rays_miss_and_others_are_as_without_masks(form: str, seeds: Iterator[int]) -> None:
    for seed in seeds:
        case, random = case_of(seed, form), np.random.default_rng(seed)
        scene = scene_of(case, form)
        masked = [np.ma.masked_array(array, random.random(array.shape) < 0.05) for array in case[2:]]
        masks = [np.ma.getmaskarray(array).T for array in masked]  # a row per coordinate
        gone = np.any([mask.any(axis=0) if mask.ndim == 2 else mask for mask in masks], axis=0)
        hits, found = scene.intersect(*case[2:]), scene.intersect(*masked)
        assert (found.prim == np.where(gone, -1, hits.prim)).all(), seed
        assert found.t[~gone].tobytes() == hits.t[~gone].tobytes(), seed


def test_exact_hits_are_those_of_fractions(seeds: Iterator[int]) -> None:
    for seed in seeds:
        case = odd_case(seed, np.float32, rays=MOST_EXACT)
        few = case.faces[:MOST_EXACT]
        used = np.zeros_like(case.vertices)
        used[few] = case.vertices[few]
        usable = np.isfinite(case.origins).all(axis=1) & np.isfinite(case.directions).all(axis=1)
        usable &= (abs(case.origins) <= 1e18).all(axis=1) & case.directions.any(axis=1)
        rays = tuple(array[usable] for array in case[2:])
        if not usable.any():
            continue
        hits = wive.Scene(case.vertices, few, accuracy="exact").intersect(*rays)
        right = truth(used, few, *rays)
        assert (hits.prim == right.prim).all(), seed
        assert (hits.t == right.t).all(), seed


# Not "fast": it may put the t of slivers before their boxes, and then the tree decides what is found.
@pytest.mark.parametrize("form", ["watertight", "compressed", "exact", "float64"])
def test_a_refit_there_and_back_gives_the_hits_of_new_scenes(form: str, seeds: Iterator[int]) -> None:
    for seed in seeds:
        one, other = case_of(seed, form), case_of(seed + 1, form)
        vertices = np.zeros_like(one.vertices)
        usable = np.unique(other.faces)
        vertices[:] = other.vertices[usable[np.arange(len(vertices)) % len(usable)]]
        there = one._replace(vertices=vertices)
        scene = scene_of(one, form)
        for case in (there, one):
            scene.refit(case.vertices)
            assert different(answers(scene, one), answers(scene_of(case, form), one)) == [], seed
        broken = one.vertices.copy()
        broken[one.faces[0, 0]] = [np.nan, np.inf, 2e18][seed % 3]
        with pytest.raises(ValueError, match=r"^vertices\[\d+\] = "):
            scene.refit(broken)
        assert different(answers(scene, one), answers(scene_of(one, form), one)) == [], seed


def test_a_saved_scene_gives_the_same_bits(tmp_path: Path, seeds: Iterator[int]) -> None:
    for seed in seeds:
        form = list(FORMS)[seed % len(FORMS)]
        case = case_of(seed, form)
        scene = scene_of(case, form)
        scene.save(tmp_path / "scene")
        assert different(answers(scene, case), answers(wive.load(tmp_path / "scene"), case)) == [], seed
