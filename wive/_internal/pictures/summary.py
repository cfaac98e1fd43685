"""What a notebook shows of a scene: a small picture and its numbers."""

from __future__ import annotations

import base64
import html
from contextlib import suppress

import numpy as np

from wive._internal.cpu_tracer import CpuTracer
from wive._internal.picture import Settings
from wive._internal.pictures.image_files import png_bytes
from wive.backend import resolve_backend
from wive.rendering import render_counted
from wive.scene import Scene

SIZE = Settings(shading="headlight", width=240, height=160, spp=4)
UNITS = "bytes", "KiB", "MiB", "GiB"


def summary(scene: Scene) -> str:
    """HTML; without the picture if the scene has nothing to see, or Pillow is missing."""
    left = 'style="text-align:left"'
    rows = "".join(
        f"<tr><th {left}>{name}</th><td {left}>{html.escape(value)}</td></tr>"
        for name, value in _numbers(scene).items()
    )
    picture = ""
    with suppress(Exception):  # a notebook shows what there is
        picture = f'<img alt="" src="data:image/png;base64,{_picture(scene)}" style="border-radius:4px">'
    return (
        f'<div style="display:flex;gap:1em;align-items:center">{picture}'
        f"<table><caption><b>wive.Scene</b></caption>{rows}</table></div>"
    )


def _picture(scene: Scene) -> str:
    """A PNG file in base 64, traced on the CPU whatever the scene's device is, which may be busy."""
    still = scene._at_rest()
    tracer = still._tracer
    if tracer.device is not None:
        name, _ = resolve_backend("auto", None)
        still._tracer = CpuTracer(tracer.bvh, scene.faces, name, tracer.geoms)
    image = render_counted(still, None, SIZE, progress=False).image
    return base64.b64encode(png_bytes(image)).decode()


def _numbers(scene: Scene) -> dict[str, str]:
    low, high = scene.bounds.astype(np.float64)
    numbers = {"triangles": f"{len(scene):,}", "vertices": f"{len(scene.vertices):,}"}
    if len(scene.geoms) > 1:
        numbers["meshes"] = f"{len(scene.geoms):,}"
    if np.isfinite(high - low).all():
        numbers["size"] = " × ".join(f"{extent:.4g}" for extent in high - low)
    where = scene.backend if scene.device is None else f"{scene.backend} on {scene.device}"
    numbers["traced by"] = f"{where}, {scene.accuracy}, {scene.precision}"
    numbers["tree"] = f"{_bytes(scene.memory)}, {scene.nodes} nodes"
    return numbers


def _bytes(count: float) -> str:
    for unit in UNITS:
        if count < 1024 or unit == UNITS[-1]:
            break
        count /= 1024
    return f"{count:.3g} {unit}" if unit != UNITS[0] else f"{count:,.0f} {unit}"
