"""`Hits.error_bound` holds: t against exact rationals, on hits that are easy and hits that are not."""

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from support.error_bounds import (
    SETS,
    Set,
    all_scales,
    broken,
    crossed_sizes,
    far_away,
    traced,
    well_conditioned,
)
from support.meshes import TRIANGLE, random_rays, soup

import wive
from wive._internal import error_bounds

ACCURACIES = ("fast", "watertight", "exact")
FLOAT_ROUNDOFF = 2.0**-24


@pytest.mark.parametrize("accuracy", ACCURACIES)
@pytest.mark.parametrize("make", SETS)
def test_t_is_within_its_bound_of_the_exact_distance(make: Callable[[], Set], accuracy: str) -> None:
    hits, exact = traced(make, accuracy)
    assert broken(hits, exact, hits.error_bound) == 0
    # and not because the bounds are infinite
    assert np.isfinite(hits.error_bound[hits.mask]).mean() > 0.95


@pytest.mark.parametrize("accuracy", ["fast", "watertight"])
@pytest.mark.parametrize("make", SETS)
def test_a_bound_a_little_smaller_would_be_broken(make: Callable[[], Set], accuracy: str) -> None:
    hits, exact = traced(make, accuracy)
    assert broken(hits, exact, 0.99 * hits.error_bound) > 0


@pytest.mark.parametrize("make", SETS)
def test_half_a_unit_in_the_last_place_is_no_bound_for_fast(make: Callable[[], Set]) -> None:
    hits, exact = traced(make, "fast")
    with np.errstate(invalid="ignore"):
        assert broken(hits, exact, 0.5 * np.spacing(hits.t).astype(np.float64)) > 0


def test_the_error_of_the_bounds_own_arithmetic_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(error_bounds, "ROUNDINGS", 0)
    assert sum(
        broken(hits, exact, hits.error_bound) for hits, exact in (traced(make, "fast") for make in SETS)
    )


def test_a_well_conditioned_watertight_t_is_known_to_half_a_unit_in_the_last_place() -> None:
    for accuracy in ("watertight", "exact"):
        hits, _ = traced(well_conditioned, accuracy)
        assert (hits.error_bound <= 0.501 * np.spacing(hits.t)).all()


@pytest.mark.parametrize("make", [well_conditioned, far_away, all_scales])
def test_the_bound_is_hardly_more_than_the_error(make: Callable[[], Set]) -> None:
    hits, exact = traced(make, "fast")
    t = hits.t[hits.mask]
    error = np.array([float(abs(Fraction(float(a)) - b)) for a, b in zip(t, exact, strict=True)])
    assert np.median(hits.error_bound[hits.mask] / np.maximum(error, 1e-6 * t)) < 1.01


@pytest.mark.parametrize("make", SETS)
def test_fast_errs_no_more_than_the_analysis_of_its_arithmetic_says(make: Callable[[], Set]) -> None:
    hits, exact = traced(make, "fast")
    _, _, origins, directions = make()
    v0, v1, v2 = hits.vertices[hits.faces[hits.prim[hits.mask]]].astype(np.float64).swapaxes(0, 1)
    e1, e2, s = v1 - v0, v2 - v0, origins[hits.mask].astype(np.float64) - v0
    d = directions[hits.mask].astype(np.float32).astype(np.float64)

    def sizes(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
        return (abs(a) * crossed_sizes(b, c)).sum(axis=1)

    t = hits.t[hits.mask].astype(np.float64)
    det = abs((e1 * np.cross(d, e2)).sum(axis=1))
    bound = 1.001 * FLOAT_ROUNDOFF * (9 * sizes(e2, s, e1) + 7 * t * sizes(e1, d, e2)) / det
    # t, scaled back by a power of two, may have become a subnormal number
    bound += 2.0**-149
    whole = np.full(len(hits), np.nan)
    whole[hits.mask] = np.where(det > 1e-10 * sizes(e1, d, e2), bound, np.inf)
    assert broken(hits, exact, whole) == 0


def test_every_backend_has_the_same_bounds(backend: str) -> None:
    vertices, faces = soup(300, seed=1)
    rays = random_rays(500, seed=2, low=-0.5, high=1.5)
    for accuracy in ("fast", "watertight"):
        hits = [
            wive.Scene(vertices, faces, backend=name, accuracy=accuracy).intersect(*rays)
            for name in (backend, "scalar")
        ]
        np.testing.assert_array_equal(hits[0].error_bound, hits[1].error_bound)


def test_misses_have_no_bound_and_t_beyond_float32_an_infinite_one() -> None:
    scene = wive.Scene(*TRIANGLE)
    hits = scene.intersect(
        [[0.2, 0.2, 0], [5, 5, 0], [0.2, 0.2, -1e10]], [[0, 0, 1], [0, 0, 1], [0, 0, 1e-40]]
    )
    assert hits.mask.tolist() == [True, False, True]
    assert hits.error_bound.dtype == np.float64
    assert hits.error_bound[0] < 1e-14
    assert np.isnan(hits.error_bound[1])
    assert hits.t[2] == np.inf and hits.error_bound[2] == np.inf


def test_hits_made_by_hand_give_the_reason_for_having_no_bound() -> None:
    hits = wive.Hits(np.zeros(1, np.float32), np.zeros(1, np.int32), np.zeros((1, 2), np.float32), *TRIANGLE)
    with pytest.raises(ValueError, match=r"^error_bound needs hits that a scene returned"):
        _ = hits.error_bound
    with pytest.raises(ValueError, match=r"^spawn needs hits that a scene returned"):
        hits.spawn([0, 0, 1])
