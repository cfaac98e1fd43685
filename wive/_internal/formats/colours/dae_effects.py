"""Materials of COLLADA: the diffuse colours and textures of their effects.

https://www.khronos.org/files/collada_spec_1_4.pdf, chapter 8 (profile_COMMON); version 1.5 names images by
`instance_image` and files by `ref`.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple
from urllib.parse import unquote

import numpy as np

from wive._internal.formats.beside import beside
from wive._internal.formats.colours import Colours, linear
from wive._internal.formats.colours.texture_mean import CLAMP, MIRROR, REPEAT
from wive._internal.formats.dae.tree import Document, Element

# Shaders, and what each shows in white light.
SHADERS = {"lambert": "diffuse", "phong": "diffuse", "blinn": "diffuse", "constant": "emission"}
NUMBERS = "float3", "float4"
WRAPS = {"WRAP": REPEAT, "MIRROR": MIRROR, "CLAMP": CLAMP}


class Surface(NamedTuple):
    """The linear colour (3,) of a material, NaN without one, and its texture, "" without one.

    `coordinates` is what the material calls the texture coordinates, `wrap` what is beyond the texture.
    """

    colour: Colours = np.full(3, np.nan)
    path: str = ""
    coordinates: str = ""
    wrap: tuple[str, str] = (REPEAT, REPEAT)


def surface_of(document: Document, address: str, folder: str | None) -> Surface:
    """The surface of the material that "#id" stands for; one without colour if it is in another file."""
    material = document.find(address)
    instance = None if material is None else material.first("instance_effect")
    effect = None if instance is None else document.find(instance.attributes.get("url", ""))
    profile = None if effect is None else effect.first("profile_COMMON")
    technique = None if profile is None else profile.first("technique")
    if effect is None or profile is None or technique is None:
        return Surface()
    parameters = {
        one.attributes.get("sid", ""): one for holder in (effect, profile) for one in holder.all("newparam")
    }
    for shader in technique.all(*SHADERS):
        for shown in shader.all(SHADERS[shader.tag]):
            for texture in shown.all("texture"):
                return _textured(document, texture, parameters, folder)
            for one in (*shown.all("color"), *_numbers(shown, parameters)):
                numbers = one.numbers()
                if len(numbers) not in (3, 4):
                    raise ValueError(
                        f"{one.place}: expected 3 or 4 numbers, found {len(numbers)}: the file is damaged"
                    )
                return Surface(linear(numbers[:3], 1))
    return Surface()


def _numbers(shown: Element, parameters: dict[str, Element]) -> Iterator[Element]:
    """The numbers of the parameter that a colour refers to."""
    for one in shown.all("param"):
        if one.attributes.get("ref") in parameters:
            yield from parameters[one.attributes["ref"]].all(*NUMBERS)


def _textured(
    document: Document, texture: Element, parameters: dict[str, Element], folder: str | None
) -> Surface:
    """The surface of a texture, which names a sampler, that names a surface, that names an image."""
    name = texture.attributes.get("texture", "")
    wrap = REPEAT, REPEAT
    if name in parameters and (sampler := parameters[name].first("sampler2D")):
        found = [_text(sampler.first(key)) for key in ("wrap_s", "wrap_t")]
        wrap = WRAPS.get(found[0], REPEAT), WRAPS.get(found[1], REPEAT)
        name = _text(sampler.first("source"))
        for instance in sampler.all("instance_image"):
            name = instance.attributes.get("url", "").removeprefix("#")
        if name in parameters and (held := parameters[name].first("surface")):
            name = _text(held.first("init_from"))
    image = document.find(f"#{name}")
    start = image.first("init_from") if image is not None and image.tag == "image" else None
    file = "" if start is None else _text(start.first("ref") or start)
    path = beside(folder, unquote(file)) if folder is not None else None
    return Surface(path=path or "", coordinates=texture.attributes.get("texcoord", ""), wrap=wrap)


def _text(element: Element | None) -> str:
    return "" if element is None else "".join(element.pieces).strip()
