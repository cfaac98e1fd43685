"""The two forms of the slab test on AVX-512 give the same bits; backend "avx512" uses one of them."""

import os
import subprocess
import sys
import tempfile
from typing import Literal

import numpy as np
import pytest
from support.meshes import TRIANGLE, soup

import wive
from wive import _cpu

RUNS = not _cpu.kernels()["avx512"]
needs_avx512 = pytest.mark.skipif(not RUNS, reason="this machine has no AVX-512")

VARIABLE = "WIVE_AVX512_FORM"
# Prints the form, then a digest of every query's results on backend avx512, with both forms of nodes.
ANSWERS = """
import hashlib, itertools, numpy, wive
from wive import _cpu

random = numpy.random.default_rng(17)
corners = (random.uniform(-1, 1, (1500, 1, 3)) + random.normal(0, 0.1, (1500, 3, 3))).astype(numpy.float32)
mesh = corners.reshape(-1, 3), numpy.arange(4500, dtype=numpy.int32).reshape(-1, 3)
rays = random.normal(size=(2, 400, 3)).astype(numpy.float32)
digest = hashlib.sha256()
for accuracy, nodes in itertools.product(("fast", "watertight", "exact"), ("float32", "compressed")):
    scene = wive.Scene(*mesh, backend="avx512", accuracy=accuracy, nodes=nodes)
    hits, steps = scene.intersect(*rays, stats=True)
    found = scene.intersect_all(*rays)
    assert hits.mask.any()
    for array in (
        hits.t, hits.prim, hits.uv[hits.mask], scene.intersect(*rays, in_flight=1).t, scene.occluded(*rays),
        found.offsets, found.t, found.prim, found.uv, scene.count(*rays), steps.inner_nodes,
    ):
        digest.update(numpy.ascontiguousarray(array))
print(_cpu.avx512_form(), digest.hexdigest())
"""


def run(program: str, form: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", program],
        cwd=tempfile.gettempdir(),  # the source folder would hide an installed wive
        env={**os.environ, VARIABLE: form},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


@needs_avx512
@pytest.mark.parametrize("in_flight", [1, 24])
@pytest.mark.parametrize("accuracy", ["fast", "watertight", "exact"])
def test_both_forms_give_the_same_bits_to_every_query(
    accuracy: Literal["fast", "watertight", "exact"], in_flight: int
) -> None:
    bvh = _cpu.Bvh(*soup(3000, seed=91, size=0.1), accuracy)
    random = np.random.default_rng(92)
    origins, directions = random.normal(size=(2, 3000, 3)).astype(np.float32)
    rays = origins, directions, np.full(1, 0.1, np.float32), np.full(1, 2, np.float32)
    assert bvh.count("scalar", *rays)[0].any()
    for query in (bvh.intersect, bvh.occluded, bvh.intersect_all, bvh.count):
        full, half = (query(f"avx512.{form}", *rays, in_flight=in_flight) for form in ("full", "half"))
        for one, other in zip(full, half, strict=True):
            assert (one is None) == (other is None)
            assert one is None or one.tobytes() == other.tobytes()


@needs_avx512
def test_the_backend_uses_the_requested_form_with_the_same_results() -> None:
    answers = {form: run(ANSWERS, form) for form in ("full", "half", "race")}
    for form, answer in answers.items():
        assert answer.returncode == 0, answer.stderr
        assert answer.stdout.split()[0] in ({form} if form != "race" else {"full", "half"})
    assert len({answer.stdout.split()[1] for answer in answers.values()}) == 1


@needs_avx512
def test_an_unknown_form_is_named_by_the_first_query_that_needs_one() -> None:
    program = f"""
import numpy, wive
mesh = numpy.float32({TRIANGLE[0].tolist()}), numpy.int32({TRIANGLE[1].tolist()})
for name in ("scalar", "avx2"):
    print(wive.Scene(*mesh, backend=name).intersect([[0.2, 0.2, 0]], [[0, 0, 1]]).prim[0])
scene = wive.Scene(*mesh, backend="avx512")
for _ in range(2):
    try:
        scene.intersect([[0.2, 0.2, 0]], [[0, 0, 1]])
    except ValueError as error:
        print(error)
"""
    answer = run(program, "fastest")
    assert answer.returncode == 0, answer.stderr
    line = f"{VARIABLE} must be 'full', 'half' or 'race', got 'fastest': unset it to leave the choice to wive"
    assert answer.stdout.splitlines() == ["0", "0", line, line]


def test_only_a_usable_avx512_backend_has_a_form() -> None:
    forms = {name: backend.form for name, backend in wive.backends().items()}
    assert forms.pop("avx512") in (("full", "half") if RUNS else ("",))
    assert set(forms.values()) == {""}
    if not RUNS:
        with pytest.raises(ValueError, match="can't run here"):
            _cpu.avx512_form()
