"""3MF packages for tests."""

import io
import zipfile
from collections.abc import Iterable

import numpy as np

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
PRODUCTION = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"


def mesh(vertices: Iterable, faces: Iterable) -> str:
    points = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in np.asarray(vertices).tolist())
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}" pid="7"/>\n' for a, b, c in faces)
    return f"<mesh><vertices>{points}</vertices><triangles>{triangles}</triangles></mesh>"


def components(*references: str) -> str:
    """References such as 'objectid="1"'."""
    return f"<components>{''.join(f'<component {one}/>' for one in references)}</components>"


def model(objects: dict[str, str], items: Iterable[str], attributes: str = "", declared: str = "") -> str:
    resources = "".join(f'<object id="{key}" type="model">{inner}</object>' for key, inner in objects.items())
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n<model unit="inch" xmlns="{CORE}" xmlns:p="{PRODUCTION}" '
        f'{declared} {attributes}><metadata name="Title">a</metadata><resources>{resources}</resources>'
        f"<build>{''.join(f'<item {one}/>' for one in items)}</build></model>"
    )


def package(root: str | bytes, target: str = "/3D/3dmodel.model", **members: str | bytes) -> bytes:
    """A package with the part `root` and other members, whose names have `__` for each slash."""
    kinds = {
        "openxmlformats.org/thumbnail": "/a.png",
        "microsoft.com/3dmanufacturing/2013/01/3dmodel": target,
    }
    relations = "".join(
        f'<Relationship Type="http://schemas.{kind}" Target="{path}" Id="{path}"/>'
        for kind, path in kinds.items()
    )
    space = "http://schemas.openxmlformats.org/package/2006/relationships"
    relations = f'<Relationships xmlns="{space}">{relations}</Relationships>'
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
        archive.writestr("_rels/.rels", relations)
        archive.writestr(target.lstrip("/"), root)
        for name, data in members.items():
            archive.writestr(name.replace("__", "/"), data)
    return file.getvalue()
