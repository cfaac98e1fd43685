"""What a traversal and the test of a leaf return, by what the query keeps of hits."""

# mypy: ignore-errors
# Warp compiles these functions: to mypy they are no Python.
import warp as wp

from wive.warp_kernels.queries.query import Best, Best64
from wive.warp_kernels.queries.query_all import Crossings, Crossings64
from wive.warp_kernels.queries.query_exact import ExactBest


@wp.struct
class Traversal:
    """What a thread knows at the end: its own best hit, how the group stands, and the steps taken."""

    best: Best
    tmax: wp.float32  # the group's
    inner_nodes: wp.int32
    leaves: wp.int32
    triangles: wp.int32


@wp.struct
class Crossed:
    """The same of a query for everything along the ray."""

    best: Crossings
    tmax: wp.float32
    inner_nodes: wp.int32
    leaves: wp.int32
    triangles: wp.int32


@wp.struct
class ExactTraversal:
    """The same of the closest hit in an exact tree."""

    best: ExactBest
    tmax: wp.float32
    inner_nodes: wp.int32
    leaves: wp.int32
    triangles: wp.int32


@wp.struct
class Traversal64:
    """The same of a hit in a float64 tree; tmax is for boxes."""

    best: Best64
    tmax: wp.float32
    inner_nodes: wp.int32
    leaves: wp.int32
    triangles: wp.int32


@wp.struct
class Crossed64:
    """The same of a query for everything along the ray in a float64 tree."""

    best: Crossings64
    tmax: wp.float32
    inner_nodes: wp.int32
    leaves: wp.int32
    triangles: wp.int32


@wp.struct
class TestedLeaf:
    """A thread's best hit after a leaf, and the block after which it stopped."""

    best: Best
    last: wp.int32


@wp.struct
class CrossedLeaf:
    """The same of a query for everything along the ray."""

    best: Crossings
    last: wp.int32


@wp.struct
class ExactLeaf:
    """The same of the closest hit in an exact tree."""

    best: ExactBest
    last: wp.int32


@wp.struct
class TestedLeaf64:
    """The same of a hit in a float64 tree."""

    best: Best64
    last: wp.int32


@wp.struct
class CrossedLeaf64:
    """The same of a query for everything along the ray in a float64 tree."""

    best: Crossings64
    last: wp.int32


STATES = {
    Best: Traversal,
    Crossings: Crossed,
    ExactBest: ExactTraversal,
    Best64: Traversal64,
    Crossings64: Crossed64,
}
LEAVES = {
    Best: TestedLeaf,
    Crossings: CrossedLeaf,
    ExactBest: ExactLeaf,
    Best64: TestedLeaf64,
    Crossings64: CrossedLeaf64,
}
