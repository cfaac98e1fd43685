"""Base colour textures of glTF materials, as means over triangles.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, sections 3.8 and 3.9.2; KHR_texture_transform.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.colours import Colours
from wive._internal.formats.colours.texture import Textures
from wive._internal.formats.colours.texture_mean import CLAMP, MIRROR, REPEAT, Means
from wive._internal.formats.gltf.accessors import describe, values
from wive._internal.formats.gltf.document import Document
from wive._internal.formats.gltf.fields import Fields, index_of, members, numbers, whole
from wive._internal.formats.gltf.reader import Primitive, triangles

WRAPS = {10497: REPEAT, 33071: CLAMP, 33648: MIRROR}
TRANSFORM, WEBP = "KHR_texture_transform", "EXT_texture_webp"


class BaseTextures:
    """The base colour textures of a document."""

    def __init__(self, document: Document) -> None:
        """Read nothing yet."""
        self._document = document
        self._textures, self._means = Textures(), Means()

    def means(self, primitive: Primitive) -> Colours | None:
        """Linear colours (f,3) over a primitive's triangles; None without a texture that can be read."""
        document = self._document
        material = index_of(primitive.fields, "material", primitive.place)
        if material is None:
            return None
        place = f"materials[{material}]"
        surface = members(
            document.item("materials", material, primitive.place), "pbrMetallicRoughness", place
        )
        base = members(surface, "baseColorTexture", place)
        if not base:
            return None
        here = f"{place}: baseColorTexture"
        transform = members(members(base, "extensions", here), TRANSFORM, here)
        attribute = f"TEXCOORD_{whole({**base, **transform}, 'texCoord', here, 0)}"
        index = index_of(members(primitive.fields, "attributes", primitive.place), attribute, primitive.place)
        texture = document.item("textures", whole(base, "index", here), here)
        webp = members(members(texture, "extensions", here), WEBP, here)
        image = index_of({**texture, **webp}, "source", here)
        if index is None or image is None:
            return None
        source = document.image(image, here)
        texels = self._textures.get(source, lambda: document.picture(source, f"images[{image}]"))
        if texels is None:
            return None
        accessor = describe(document, index, f"{primitive.place}: {attribute}", "VEC2")
        if accessor.count != primitive.positions.count:
            raise ValueError(
                f"{primitive.place}: {attribute}: expected {primitive.positions.count} places, "
                f"found {accessor.count}"
            )
        places = values(document, accessor).astype(np.float64)[triangles(document, primitive)]
        return self._means.over(texels, _moved(places, transform, here), self._wrap(texture, here))

    def _wrap(self, texture: Fields, place: str) -> tuple[str, str]:
        index = index_of(texture, "sampler", place)
        sampler = {} if index is None else self._document.item("samplers", index, place)
        found = [whole(sampler, key, f"samplers[{index}]", 10497) for key in ("wrapS", "wrapT")]
        if any(one not in WRAPS for one in found):
            raise ValueError(f"samplers[{index}]: wrap: expected one of {list(WRAPS)}, found {found}")
        return WRAPS[found[0]], WRAPS[found[1]]


def _moved(places: NDArray[np.float64], transform: Fields, place: str) -> NDArray[np.float64]:
    """Places (...,2), scaled, turned against the clock as seen in the texture, then shifted."""
    if not transform:
        return places
    given = {"offset": [0, 0], "scale": [1, 1], "rotation": 0, **transform}
    (angle,) = numbers({"rotation": [given["rotation"]]}, "rotation", place, 1).tolist()
    sine, cosine = np.sin(angle), np.cos(angle)
    turned = np.array([[cosine, sine], [-sine, cosine]])
    matrix = turned * numbers(given, "scale", place, 2)
    return np.asarray(places @ matrix.T + numbers(given, "offset", place, 2))
