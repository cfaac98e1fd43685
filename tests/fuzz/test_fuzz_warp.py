"""Warp gives the bits of the C++ core for scenes and rays of any bits, on its CPU device."""

import itertools
from collections.abc import Iterator
from dataclasses import fields

import pytest

pytest.importorskip("warp")

from support.odd_answers import FORMS, answers, case_of, different, scene_of
from support.warp_launches import assert_bit_identical, cpu_answers, warp_answers

from wive import _cpu
from wive.warp_kernels.tree import tree

# Of rays from far away, the core meets boxes in these from where they come near, in fewer steps.
FINER = {"exact", "float64", "float64 compressed"}
FEW = 4  # rays traced by eight threads each, which are slow fibers on this device


def some(seeds: Iterator[int]) -> Iterator[int]:
    """Every eighth: launches on this device take longer than the core's queries."""
    return itertools.islice(seeds, None, None, 8)


@pytest.mark.parametrize("form", [form for form, (dtype, rays, *_) in FORMS.items() if dtype == rays])
def test_kernels_give_the_bits_of_the_core(form: str, seeds: Iterator[int]) -> None:
    *_, accuracy, nodes = FORMS[form]
    for seed in some(seeds):
        case = case_of(seed, form)
        bvh = _cpu.Bvh(case.vertices, case.faces, accuracy, nodes=nodes)
        for lanes, rays in ((8, case[2:]), (1, tuple(array[:FEW] for array in case[2:]))):
            found, expected = warp_answers(bvh, lanes, *rays), cpu_answers(bvh, "scalar", *rays)
            names = [one.name for one in fields(found) if form not in FINER or "steps" not in one.name]
            try:
                assert_bit_identical(found, expected, names)
            except AssertionError as error:
                raise AssertionError(f"seed {seed}, {lanes} lanes") from error


@pytest.mark.usefixtures("one_stack_size")
@pytest.mark.parametrize("form", ["watertight", "float64 rays"])
def test_scenes_give_the_bits_of_the_core(form: str, seeds: Iterator[int]) -> None:
    for seed in some(seeds):
        case = case_of(seed, form)
        scene = scene_of(case, form, "warp")
        if scene.tree.stack == tree.STACK_SIZES[0]:  # others need kernels that no other test does
            found, expected = answers(scene, case), answers(scene_of(case, form, "scalar"), case)
            assert different(found, expected) == [], seed
