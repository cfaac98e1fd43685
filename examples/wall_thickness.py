"""Wall thickness and volume of a casing, by trimesh with the rays of wive.

    python examples/wall_thickness.py

Prints the thinnest wall, the share of the surface behind which the wall is thinner than 3, and the volume.
"""

import numpy as np
import trimesh

import wive


def casing() -> trimesh.Trimesh:
    """A box of 40 x 30 x 20 with a cavity of 32 x 22 x 12: the walls are from 2 to 6 thick."""
    box, cavity = trimesh.creation.box((40, 30, 20)), trimesh.creation.box((32, 22, 12))
    cavity.apply_translation((2, -1, 2))
    cavity.invert()
    return box + cavity


def main() -> None:
    """Sample the surface and the space around it."""
    wive.trimesh.install()
    mesh = casing()
    points, faces = trimesh.sample.sample_surface(mesh, 50_000, seed=1)
    thickness = trimesh.proximity.thickness(mesh, points, normals=mesh.face_normals[faces], method="ray")
    places = np.random.default_rng(1).uniform(*mesh.bounds, (500_000, 3))
    volume = mesh.contains(places).mean() * np.prod(mesh.extents)
    print(f"thinnest wall {thickness.min():.3f}, thinner than 3: {(thickness < 3).mean():.1%} of the surface")
    print(f"volume {volume:.0f} by points inside, {mesh.volume:.0f} by the divergence theorem")


if __name__ == "__main__":
    main()
