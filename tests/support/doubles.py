"""Meshes and rays that float32 can't hold."""

import numpy as np

import wive
from support.meshes import random_rays, soup, sphere

UTM = np.array([448262.25, 5411932.5, 120.0])
CPU = [name for name in ("avx512", "avx2", "scalar") if wive.backends()[name].usable]


def soup64(count: int, seed: int, size: float = 0.2) -> tuple[np.ndarray, np.ndarray]:
    """`meshes.soup`, not rounded to float32."""
    return soup(count, seed, size, dtype=np.float64)


def rays64(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """`meshes.random_rays` in and round the unit cube, not rounded to float32."""
    return random_rays(count, seed, low=-0.5, high=1.5, dtype=np.float64)


def survey(level: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """A sphere of radius 1 m in UTM coordinates, whose floats are half a metre apart."""
    vertices, faces = sphere(level)
    return vertices.astype(np.float64) + UTM, faces
