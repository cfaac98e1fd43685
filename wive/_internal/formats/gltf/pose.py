"""The pose of a glTF mesh at rest: default weights of morph targets, and joints where their nodes are.

https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html, sections 3.7.2.2 and 3.7.3.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wive._internal.formats.gltf.accessors import describe, values
from wive._internal.formats.gltf.document import Document
from wive._internal.formats.gltf.fields import Fields, index_of, indices, members, numbers, objects
from wive._internal.formats.gltf.nodes import Scene
from wive._internal.formats.placing import moved

Doubles = NDArray[np.float64]


def morphed(
    document: Document, positions: NDArray[Any], primitive: Fields, weights: Doubles, place: str
) -> NDArray[Any]:
    """Positions moved by the primitive's targets, each times its weight."""
    if not weights.any():
        return positions
    targets = objects(primitive, "targets", place)
    if len(weights) != len(targets):
        raise ValueError(f"{place}: targets: expected one per weight, {len(weights)}, found {len(targets)}")
    result: NDArray[Any] = positions.astype(np.float64)
    for at, (target, weight) in enumerate(zip(targets, weights.tolist(), strict=True)):
        here = f"{place}: targets[{at}]"
        index = index_of(target, "POSITION", here)
        if index is not None and weight:
            accessor = describe(document, index, here, "VEC3")
            if accessor.count != len(positions):
                raise ValueError(f"{here}: expected {len(positions)} positions, found {accessor.count}")
            result += weight * values(document, accessor)
    return result


def default_weights(mesh: Fields, node: Fields, place: str) -> Doubles:
    """The weights of morph targets that a node, or else its mesh, starts with."""
    return numbers(node if "weights" in node else mesh, "weights", place, None)


def joint_matrices(document: Document, scene: Scene, skin: int, place: str) -> Doubles:
    """Matrices (j,4,4) from the mesh to the world, one per joint of a skin."""
    here = f"skins[{skin}]"
    fields = document.item("skins", skin, place)
    joints = indices(fields, "joints", here)
    missing = [joint for joint in joints if joint not in scene.worlds]
    if missing or not joints:
        raise ValueError(
            f"{here}: joints: expected nodes of the scene, found {missing[0] if missing else 'none'}"
        )
    worlds = np.stack([scene.worlds[joint] for joint in joints])
    bound = index_of(fields, "inverseBindMatrices", here)
    if bound is None:
        return worlds
    accessor = describe(document, bound, f"{here}: inverseBindMatrices", "MAT4")
    if accessor.dtype != np.float32 or accessor.count < len(joints):
        raise ValueError(f"{accessor.place}: expected {len(joints)} matrices of floats for {here}")
    inverse = values(document, accessor)[: len(joints)].astype(np.float64).reshape(-1, 4, 4)
    return worlds @ inverse.transpose(0, 2, 1)  # column-major


def skinned(
    document: Document, positions: NDArray[Any], primitive: Fields, joints: Doubles, place: str
) -> Doubles:
    """Positions in the world: each by the weighted mean of its joints' matrices."""
    attributes = members(primitive, "attributes", place)
    blend = np.zeros((len(positions), 3, 4))
    total = np.zeros(len(positions))
    for at in range(len(attributes)):
        if f"JOINTS_{at}" not in attributes:
            break
        which = influences(document, attributes, f"JOINTS_{at}", len(positions), place)
        weights = influences(document, attributes, f"WEIGHTS_{at}", len(positions), place).astype(np.float64)
        if which.dtype.kind != "u" or (which[weights != 0] >= len(joints)).any():
            raise ValueError(
                f"{place}: JOINTS_{at}: expected integers below {len(joints)}, the number of joints"
            )
        for slot in range(4):
            weight = weights[:, slot]
            blend += weight[:, None, None] * joints[np.where(weight != 0, which[:, slot], 0), :3]
            total += weight
    if not (total > 0).all():
        raise ValueError(
            f"{place}: expected a skin's JOINTS_0 and WEIGHTS_0 with a sum of 1, found a sum of 0"
        )
    blend /= total[:, None, None]
    return moved(positions, blend)


def influences(document: Document, attributes: Fields, key: str, count: int, place: str) -> NDArray[Any]:
    """The array (count,4) of an attribute of joints or weights."""
    index = index_of(attributes, key, place)
    if index is None:
        raise ValueError(f"{place}: has no {key}, which its other joints and weights need")
    accessor = describe(document, index, f"{place}: {key}", "VEC4")
    if accessor.count != count:
        raise ValueError(f"{place}: {key}: expected {count} values, one per position, found {accessor.count}")
    return values(document, accessor)
