"""Ray queries in the shape of the embreex package, which binds Embree: a script changes its imports alone.

>>> from wive.embreex import rtcore_scene  # from embreex import rtcore_scene
>>> from wive.embreex.mesh_construction import TriangleMesh
>>> scene = rtcore_scene.EmbreeScene()
>>> TriangleMesh(scene, vertices, indices)
>>> prim = scene.run(origins, directions)

docs/libraries.md, "Scripts for embreex", lists what differs.
"""

from wive.embreex import mesh_construction, rtcore, rtcore_scene
from wive.embreex.mesh_construction import ElementMesh, TriangleMesh
from wive.embreex.rtcore import EmbreeDevice
from wive.embreex.rtcore_scene import EmbreeScene

__all__ = [
    "ElementMesh",
    "EmbreeDevice",
    "EmbreeScene",
    "TriangleMesh",
    "mesh_construction",
    "rtcore",
    "rtcore_scene",
]
