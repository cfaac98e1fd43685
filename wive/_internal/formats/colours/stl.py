"""Binary STL: colours of facets, 15 bits in their attributes, in one of two forms.

VisCAM and SolidView set the highest bit of facets that have a colour, and begin with blue at the lowest one.
Materialise Magics writes COLOR= and four bytes into the header, the colour of the facets whose highest bit is
set; others have a colour of their own, which begins with red at the lowest bit.
"""

from __future__ import annotations

import numpy as np

from wive._internal.formats.colours import Colours, linear
from wive._internal.formats.stl import HEADER_BYTES, facets, is_text

HAS_BIT, MOST = 1 << 15, 31
BLUE_FIRST, RED_FIRST = (10, 5, 0), (0, 5, 10)  # where red, green and blue begin
HEADER_COLOUR = b"COLOR="


def read(data: bytes, name: str, folder: str | None) -> Colours | None:
    """(f,1,3); all are sRGB. Text has none."""
    if is_text(data):
        return None
    attributes = facets(data, name)["attribute"]
    of_all = _of_header(data[: HEADER_BYTES - 4])
    if of_all is None:
        is_own, shifts, other = attributes >= HAS_BIT, BLUE_FIRST, np.full(3, np.nan)
    else:  # writers that set the header alone leave all attributes zero, which would be black
        is_own, shifts, other = (attributes < HAS_BIT) & attributes.any(), RED_FIRST, of_all
    if of_all is None and not is_own.any():
        return None
    own = np.stack([attributes >> shift & MOST for shift in shifts], axis=1)
    return np.where(is_own[:, None], linear(own, MOST), other)[:, None]


def _of_header(header: bytes) -> Colours | None:
    """The colour (3,) that a header has for all facets."""
    _, found, rest = header.partition(HEADER_COLOUR)
    return linear(np.frombuffer(rest[:3], np.uint8), 255) if found and len(rest) >= 4 else None
