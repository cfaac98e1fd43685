"""How much of a part lies inside another, by counting random points inside both.

    python examples/contains.py part.stl other.stl

Open or overlapping meshes are taken as solids by their winding numbers.
"""

import argparse

import numpy as np

import wive


def overlap(one: wive.Scene, other: wive.Scene, points: int = 1_000_000) -> tuple[float, float]:
    """The volume of one scene, and of what it has in common with another one."""
    low, high = one.bounds.astype(np.float64)
    places = np.random.default_rng(1).uniform(low, high, (points, 3))
    inside = one.contains(places, sign="winding")
    common = inside & other.contains(places, sign="winding")
    return inside.mean() * np.prod(high - low), common.mean() * np.prod(high - low)


def main() -> None:
    """Read two meshes and print what they have in common."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("meshes", nargs=2, help="mesh files")
    one, other = map(wive.Scene.from_file, parser.parse_args().meshes)
    volume, common = overlap(one, other)
    print(f"volume {volume:.4g}, of which {common / volume if volume else 0:.1%} inside the other part")


if __name__ == "__main__":
    main()
