"""COLLADA documents for tests."""

from collections.abc import Sequence

import numpy as np


def source(values: object, key: str = "points", **accessor: object) -> str:
    """A source of positions."""
    array = np.asarray(values, float)
    fields = {"count": len(array), "stride": array.shape[1], **accessor}
    said = " ".join(f'{name}="{value}"' for name, value in fields.items() if name != "params")
    params = "".join(f'<param name="{name}" type="float"/>' for name in fields.get("params", "XYZ"))
    return (
        f'<source id="{key}"><float_array id="{key}-array" count="{array.size}">'
        f"{' '.join(map(repr, array.ravel().tolist()))}</float_array><technique_common>"
        f'<accessor source="#{key}-array" {said}>{params}</accessor></technique_common></source>'
    )


def primitive(tag: str, *runs: Sequence[int], count: int | None = None, vcount: Sequence[int] = ()) -> str:
    """A primitive element whose vertices have a normal of index 0 behind them."""
    listed = "".join(f"<p>{' '.join(f'{index} 0' for index in run)}</p>" for run in runs)
    if count is None:
        count = len(vcount) or (len(runs[0]) // 3 if tag == "triangles" else len(runs))
    sizes = f"<vcount>{' '.join(map(str, vcount))}</vcount>" if vcount else ""
    return (
        f'<{tag} count="{count}"><input semantic="VERTEX" source="#v" offset="0"/>'
        f'<input semantic="NORMAL" source="#n" offset="1"/>{sizes}{listed}</{tag}>'
    )


def geometry(key: str, points: object, *primitives: str, **accessor: object) -> str:
    vertices = f'<vertices id="{key}-v"><input semantic="POSITION" source="#{key}-p"/></vertices>'
    inner = source(points, f"{key}-p", **accessor) + vertices + "".join(primitives)
    return f'<geometry id="{key}"><mesh>{inner}</mesh></geometry>'


def draw(key: str) -> str:
    return f'<instance_geometry url="#{key}"/>'


def node(*inner: str, key: str = "") -> str:
    return f"<node{f' id={key!r}' if key else ''}>{''.join(inner)}</node>"


def document(geometries: str, nodes: str, library: str = "") -> str:
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n'
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        '<asset><unit meter="0.01" name="centimeter"/><up_axis>Z_UP</up_axis></asset>\n'
        f"<library_geometries>{geometries}</library_geometries><library_nodes>{library}</library_nodes>\n"
        f'<library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>\n'
        '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    )
