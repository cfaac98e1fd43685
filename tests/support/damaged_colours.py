"""Damage done to files with colours, and what must come of it."""

from collections.abc import Callable

import numpy as np

import wive
from support.mesh_files import damaged
from support.refusals import LONGEST

CASES = 200


def check_damaged(whole: bytes, kind: str, seed: int, make: Callable[[bytes], bytes] = bytes) -> None:
    """Colours of a damaged file fit its mesh, or one line says what is wrong; `make` puts it into a file."""
    random = np.random.default_rng(seed)
    fitting = 0
    for _ in range(CASES):
        data = make(damaged(whole, random))
        try:
            colours = wive.load_colors(data, file_type=kind)
        except ValueError as error:
            text = str(error)
            assert text.startswith("mesh (bytes): ") and text.isprintable() and len(text) < LONGEST, text
            continue
        if colours is None:
            continue
        assert ((colours >= 0) & (colours <= 0.8)).all()
        try:
            vertices, faces = wive.load_mesh(data, np.float64, file_type=kind)
        except ValueError:  # a number of the mesh that colours have no need of
            continue
        assert colours.shape in ((len(vertices), 3), (len(faces), 1, 3))
        fitting += 1
    assert fitting
