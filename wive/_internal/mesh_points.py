"""`trimesh.proximity.closest_point` by wive, for meshes whose `ray` is wive's."""

from __future__ import annotations

import functools
from typing import Any

NAME = "closest_point"


def set_closest_point(installed: bool) -> None:
    """Replace trimesh's function, which all of its proximity queries call, or put it back."""
    from trimesh import proximity

    current = getattr(proximity, NAME)
    own = getattr(current, "_wive_replaces", None)
    if installed and own is None:
        setattr(proximity, NAME, _replacing(current))
    elif not installed and own is not None:
        setattr(proximity, NAME, own)


def _replacing(original: Any) -> Any:
    @functools.wraps(original)
    def closest_point(mesh: Any, points: Any) -> Any:
        by_wive = getattr(getattr(mesh, "ray", None), NAME, None)
        if by_wive is None:
            return original(mesh, points)
        if len(mesh.faces) == 0:  # trimesh's own raises as well: its callers take triangle -1 for the last
            raise ValueError("mesh must have triangles for a point to be closest, got none")
        return by_wive(points)

    closest_point._wive_replaces = original  # type: ignore[attr-defined]
    return closest_point
