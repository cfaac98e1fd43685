"""Hits and rays of special numbers, for kernels that compute with hits."""

import numpy as np

from wive import _cpu

# No multiple of a group of lanes, nor of a block of hits.
COUNTS = (0, 1, 2, 3, 5, 7, 9, 63, 65, 131, 4099)


def special_numbers(dtype: type) -> np.ndarray:
    """Zeros, subnormal numbers and their neighbours, ordinary numbers, the largest, infinities and NaN."""
    limits = np.finfo(dtype)
    tiny, small = limits.tiny, limits.smallest_subnormal
    sizes = [0, small, 3 * small, tiny - small, tiny, tiny + small, 1e-20, 0.1, 1, 2, 3, 1e15, limits.max]
    return np.array([*sizes, *(-size for size in sizes[1:]), -0.0, np.inf, -np.inf, np.nan], dtype)


def calls(dtype: type, seed: int) -> tuple[tuple[np.ndarray, ...], ...]:
    """Vertices and faces, some of them broken, and for each of COUNTS prim, uv, directions, t and origins."""
    random = np.random.default_rng(seed)
    special = special_numbers(dtype)

    def mixed(*shape: int) -> np.ndarray:
        ordinary = random.standard_normal(shape) * 10.0 ** random.integers(-3, 4, shape)
        rare = random.random(shape[:1]) < 0.3
        picked = random.random(shape) < 0.4
        return np.where(
            picked & rare.reshape(-1, *[1] * (len(shape) - 1)), random.choice(special, shape), ordinary
        )

    limits = np.finfo(dtype)
    near_zero = np.array([0.0, -0.0, limits.smallest_subnormal, -limits.tiny / 2, limits.tiny])
    tiny = random.integers(-8, 9, (100, 3)) * limits.tiny * 0.5 ** random.integers(0, limits.nmant, (100, 3))
    flat = mixed(100, 3)
    flat[np.arange(100), np.arange(100) // 30 % 3] = random.choice(near_zero, 100)  # in walls at zero
    flat[-10:, 1:] = 0, 0
    flat[-10::2, 1] = -limits.smallest_subnormal
    vertices = np.concatenate([mixed(200, 3), tiny, flat]).astype(dtype)
    faces = (random.integers(0, 40, (400, 1)) * 10 + random.integers(0, 10, (400, 3))).astype(np.int32)
    faces[5], faces[9, 1] = -1, len(vertices)
    given = [(vertices, faces)]
    for count in COUNTS:
        prim = random.integers(-1, len(faces) + 1, count).astype(np.int32)
        given.append(
            (
                prim,
                *(mixed(count, k).astype(dtype) for k in (2, 3)),
                mixed(count).astype(dtype),
                mixed(count, 3).astype(dtype),
            )
        )
    return tuple(given)


def bits(numbers: np.ndarray) -> np.ndarray:
    """The bits of floats; of every NaN those of one, for their signs and payloads differ by processor."""
    one_nan = np.where(np.isnan(numbers), numbers.dtype.type(np.nan), numbers)
    return one_nan.view(f"u{numbers.dtype.itemsize}")


def instruction_sets() -> list[str]:
    """Those of this build that run here."""
    return [name for name in ("avx512", "avx2", "scalar") if not _cpu.kernels()[name]]
