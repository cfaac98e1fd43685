"""`mesh.ray` of all trimesh meshes by wive: a property of their class, which changes no mesh."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from wive._internal.mesh_points import set_closest_point

# Of a mesh: what trimesh or the user set as its intersector, and the one that is used in its place.
OWN, HELD = "ray", "_wive_ray"


class Held:
    """The intersector of one mesh, and for what it is used: the options, in place of which intersector.

    Copies and pickles hold None instead: what is pickled can be read without wive.
    """

    def __init__(self, mesh: object, own: Any, options: dict[str, Any], ray: Any) -> None:
        """Keep all four: a copied `__dict__` is another mesh's."""
        self.mesh, self.own, self.options, self.ray = mesh, own, options, ray

    def is_for(self, mesh: object, own: Any, options: dict[str, Any]) -> bool:
        """Whether it may be used."""
        return self.mesh is mesh and self.own is own and self.options == options

    def __reduce__(self) -> tuple[type[None], tuple[()]]:
        """As None."""
        return type(None), ()


class MeshRays:
    """The attribute `ray` of a mesh class: an intersector, made when first read, in place of trimesh's own.

    Those that users assign to it are used instead, and those of other classes that they assigned before.
    """

    def __init__(self, make: Callable[..., Any], options: dict[str, Any]) -> None:
        """Intersectors are `make(mesh, **options)`."""
        self.make, self.options = make, options

    def __get__(self, mesh: object, owner: type | None = None) -> Any:
        """The mesh's intersector; of a class, this property."""
        if mesh is None:
            return self
        attributes = vars(mesh)
        if OWN not in attributes:  # its constructor has not come so far
            raise AttributeError(f"{type(mesh).__name__!r} object has no attribute {OWN!r}")
        own = attributes[OWN]
        if not type(own).__module__.startswith("trimesh."):
            return own
        held = attributes.get(HELD)
        if held is None or not held.is_for(mesh, own, self.options):
            held = attributes[HELD] = Held(mesh, own, self.options, self.make(mesh, **self.options))
        return held.ray

    def __set__(self, mesh: object, ray: Any) -> None:
        """Keep the intersector as the mesh's own, and use it, unless trimesh sets the first one."""
        attributes = vars(mesh)
        attributes[HELD] = Held(mesh, ray, self.options, ray) if OWN in attributes else None
        attributes[OWN] = ray

    def __delete__(self, mesh: object) -> None:
        """Remove the mesh's own intersector."""
        vars(mesh).pop(HELD, None)
        del vars(mesh)[OWN]


def mesh_class() -> Any:
    """`trimesh.Trimesh`; ImportError if trimesh can't be imported."""
    try:
        from trimesh import Trimesh
    except ImportError as error:
        raise ImportError(f"wive.trimesh needs trimesh ({error}): pip install trimesh") from error
    return Trimesh


def rays_of(kind: type) -> MeshRays | None:
    """The property that a mesh class has now, if any."""
    found = vars(kind).get(OWN)
    return found if isinstance(found, MeshRays) else None


def set_rays(kind: Any, rays: MeshRays | None) -> None:
    """Give a mesh class this property, or none; trimesh's closest points go with it."""
    set_closest_point(rays is not None)
    if rays is not None:
        kind.ray = rays
    elif rays_of(kind) is not None:
        del kind.ray
