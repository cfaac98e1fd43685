"""Small mesh files as bytes, and damage done to them."""

from __future__ import annotations

import io
import struct

import numpy as np

TRIANGLE = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
# Five vertices, a quad and a triangle.
POINTS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 2, 0))
TRIANGLES = [[0, 1, 2], [0, 2, 3], [3, 2, 4]]

OBJ = (
    b"# made by hand\nmtllib a.mtl\no box\nv 0 0 0\nv 1.5 0 0 1\nv 1e-3 .5 -0. 1 0 0\nv 0 1. 2\n\tv 3 3 3\n"
    b"vt 0 0\nvn 0 0 1\ng a b\nusemtl red\ns 1\nf 1 2 3\nf 1/1 2//1 3/1/1 4\n"
    b"f -1 -2 -3 \\\n -4 -5\nl 1 2\np 1\n"
)
OFF = (
    b"# c\nCOFF # x\n5 2 0\n0 0 0 255 0 0 255\n1 0 0 1 1 1 1\n1 1 0 1 1 1 1\n"
    b"0 1 0 1 1 1 1\n.5 2 0 1 1 1 1\n4 0 1 2 3 255 0 0\n3 3 2 4\n"
)
FACET = b"""facet normal 0 0 1
  outer loop
   vertex 0 0 0
   vertex 1 0 0
   vertex 0 1e0 0
  endloop
 endfacet
"""
STL_TEXT = b"solid a name\n" + FACET + FACET.replace(b"0 0 1", b"nan 0 1") + b"endsolid a name\n"

PLY_HEADER = """ply
format {form} 1.0
comment x
obj_info y
element vertex 5
property {real} x
property float y
property float z
property uchar red
element face 2
property list {count} {index} vertex_indices
property float quality
element edge 1
property int a
property int b
end_header
"""


def ply_text() -> bytes:
    rows = [" ".join(map(str, (*point, 7))) for point in POINTS]
    rows += ["4 0 1 2 3 .5", "3 3 2 4 1", "0 1"]
    return ply_header() + "\n".join(rows).encode() + b"\n"


def ply_header(form: str = "ascii", real: str = "float", count: str = "uchar", index: str = "int") -> bytes:
    return PLY_HEADER.format(form=form, real=real, count=count, index=index).encode()


def ply_binary(order: str = "<", real: str = "float", count: str = "uchar", index: str = "int") -> bytes:
    """The same mesh, a quad and a triangle, with a property before and behind each list."""
    codes = dict(float="f", double="d", char="b", uchar="B", short="h", ushort="H", int="i", uint="I")
    data = ply_header("binary_little_endian" if order == "<" else "binary_big_endian", real, count, index)
    for point in POINTS:
        data += struct.pack(f"{order}{codes[real]}ffB", *point, 7)
    for corners in ((0, 1, 2, 3), (3, 2, 4)):
        data += struct.pack(
            f"{order}{codes[count]}{len(corners)}{codes[index]}f", len(corners), *corners, 0.5
        )
    return data + struct.pack(f"{order}ii", 0, 1)


def ply_strips(*strips: str) -> bytes:
    """A PLY file of triangle strips over the five points."""
    vertices, _, _ = ply_text().partition(b"element face")
    rows = [" ".join(map(str, (*point, 7))) for point in POINTS] + [
        f"{len(strip.split())} {strip}" for strip in strips
    ]
    lists = f"element tristrips {len(strips)}\nproperty list int int vertex_indices\nend_header\n"
    return vertices + lists.encode() + "\n".join(rows).encode()


def stl_binary(facets: int, count: int | None = None, header: bytes = b"", more: bytes = b"") -> bytes:
    facet = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    return header.ljust(80) + struct.pack("<I", facets if count is None else count) + facet * facets + more


def npz(compressed: bool = False) -> bytes:
    file = io.BytesIO()
    save = np.savez_compressed if compressed else np.savez
    save(file, vertices=np.eye(3), faces=np.array([[0, 1, 2]] * 50, np.uint8), other=np.arange(5))
    return file.getvalue()


WHOLE = {
    "obj": [OBJ, OBJ.replace(b"\n", b"\r\n"), OBJ.decode().encode("utf-16")],
    "ply": [ply_text(), ply_binary(), ply_binary(">", "double"), ply_strips("0 1 2 3 -1 2 3 4", "0 1 2")],
    "off": [OFF],
    "stl": [STL_TEXT, stl_binary(3, header=b"solid")],
    "npz": [npz(), npz(compressed=True)],
}
# What damage writes over bytes or between them: words that mean something to one of the formats.
WORDS = [
    *(b"-1", b"0", b"999999999999", b"4294967295", b"2147483648", b"nan", b"1e999", b"1_0", b"0x10", b","),
    *(b"#", b"\\\n", b"\n", b"\r", b" ", b"/", b"-", b"f ", b"v ", b"\0", b"\xff\xfe", b"list "),
    b"element face 1000000000000\n",
]


def damaged(whole: bytes, random: np.random.Generator) -> bytes:
    """The file cut short, or with up to three bits, bytes or words changed, put in or taken out."""
    data = bytearray(whole)
    if random.random() < 0.2:
        return bytes(data[: random.integers(len(data))])
    for _ in range(random.integers(1, 4)):
        at = int(random.integers(len(data)))
        word = WORDS[random.integers(len(WORDS))]
        match random.integers(5):
            case 0:
                data[at] ^= 1 << int(random.integers(8))
            case 1:
                data[at] = int(random.integers(256))
            case 2:
                data[at:at] = word
            case 3:
                del data[at : at + int(random.integers(1, 20))]
                data += b" "
            case _:
                data[at : at + int(random.integers(1, 4))] = word
    return bytes(data)
