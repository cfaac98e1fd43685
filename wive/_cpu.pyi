"""The compiled core: builds the tree, traces batches of rays, renders rows of a picture.

A tree is of float32 or float64: Real below. Its vertices, rays, t and uv have that dtype, none is converted.
Shapes: n rays, v vertices, f faces, m inner nodes, b triangle blocks. Every array is C-contiguous.
Users call `wive.Scene`, which checks arguments; here only what memory safety needs is checked.
"""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

Real: TypeAlias = np.floating[Any]  # float32 or float64, the same for all arrays of a tree
Result = TypeVar("Result")

compiler: str  # the C++ compiler's name and version
exact_source: str  # C++ text of the exact arithmetic, which the Warp kernels compile as well
distance_source: str  # C++ text of TriangleDistance, which the Warp kernels compile as well
surface_source: str  # C++ text of ErrorBound and SpawnOrigin, which the Warp kernels compile as well

def kernels() -> dict[str, str]:
    """Every traversal kernel compiled in, best first, and why this machine can't run it ("" if it can).

    Names: "avx512" (the better of the two forms below), "avx512.full", "avx512.half", "avx2", "scalar".
    """

def avx512_form() -> Literal["full", "half"]:
    """The form of the slab test that kernel "avx512" uses here; the first query with that kernel decides it.

    Raises ValueError if this machine can't run either form, or if the environment variable WIVE_AVX512_FORM
    is none of "full", "half" and "race".
    """

def usable_cores(root: str = "") -> int:
    """The cores that this process may use, by its affinity and the CPU quotas of its control groups.

    root: a folder that holds proc and sys, for tests.
    """

def thread_count(requested: int = 0) -> int:
    """The threads of a call that begins now; requested: 0 is the number set, or one per core not in use."""

def set_thread_count(count: int) -> None:
    """Set the threads of calls that ask for 0; 0 is one per core."""

def available_memory(root: str = "") -> int:
    """Bytes that this process can still fill, the system's and its control groups' limits considered.

    2^64 - 1 if the system doesn't tell. root: a folder that holds proc and sys, for tests.
    """

def report_to(hears: Callable[[float], object], work: Callable[[], Result]) -> Result:
    """The result of `work`. Meanwhile, `hears` is told the fraction that is done of each call at hand.

    Some ten times a second, on the calling thread. Exceptions that it raises end the call.
    """

def checksum(data: NDArray[np.uint8], threads: int = 0) -> int:
    """64 bits of the bytes (n,), which must be C-contiguous."""

def crc32(data: NDArray[np.uint8], before: int = 0) -> int:
    """The CRC-32 of zip archives of the bytes (n,) behind others whose CRC is `before`."""

class RunningChecksum:
    """A checksum of bytes that doesn't depend on the pieces they are added in. Blocks have one each."""

    block_bytes: ClassVar[int]

    def __init__(self) -> None: ...
    def add(self, data: NDArray[np.uint8]) -> None:
        """Add the bytes (n,). The interpreter lock is released."""

    @property
    def both(self) -> tuple[int, int]:
        """64 bits of the whole blocks, and of what is behind them."""

def read_rays(
    file: int,
    place: int,
    origins: NDArray[Real],
    directions: NDArray[Real],
    tmin: NDArray[Real] | None,
    tmax: NDArray[Real] | None,
    checksum: RunningChecksum | None,
) -> int:
    """Read rows of six numbers, or of eight if there are tmin and tmax, of an open file from byte `place` on.

    The arrays (n,3) and (n,) are filled, and the rows' bytes added to the checksum. Returns how many bytes
    the file had. The interpreter lock is released. Not on Windows.
    """

def split_rays(table: NDArray[Real], origins: NDArray[Real], directions: NDArray[Real]) -> None:
    """Write columns 0 to 2 and 3 to 5 of the table (n,k) to two arrays (n,3)."""

def expect_memory(bytes: int) -> None:
    """Raise MemoryError unless as many bytes are available; amounts under 64 MiB are not checked."""

class DefaultFloats:
    """A `with` block in which this thread rounds to nearest, keeps subnormals and has no traps.

    All functions here compute so; the block is for what NumPy and Warp's CPU device compute.
    """

    def __init__(self) -> None: ...
    def __enter__(self) -> None: ...
    def __exit__(self, *error: object) -> None: ...

class Kernels:
    """The kernels of one name, for the queries of `Bvh`: the first query with this handle looks them up."""

    def __init__(self, name: str) -> None:
        """Take a name of `kernels()`; whether it can run here shows at the first query."""
    @property
    def name(self) -> str: ...

def is_unused(holders: tuple[object, Bvh, NDArray[Real]], alike: tuple[object, Bvh, NDArray[Real]]) -> bool:
    """Whether `move_part` would find as few references as in `alike`."""

def move_part(
    holders: tuple[object, Bvh, NDArray[Real]],
    alike: tuple[object, Bvh, NDArray[Real]],
    rows: NDArray[Real],
    starts: NDArray[np.int32],
    i: int,
    forget: tuple[str, ...],
) -> bool:
    """Move mesh i, whose vertices are rows starts[i] to starts[i+1], in place: its vertices are `rows` then.

    holders: what traces, its tree and the vertices. The tree stays, and False is returned, unless the first
        two have as few references as those in `alike`; and if `prepare_part` was not called, or only a new
        tree will do. If the vertices have more references, or their memory is others', they are copied.
    forget: attributes of what traces, which are deleted, as they followed from the old positions. Its
        attribute `vertices` is set.
    """

class Bvh:
    """The 8-wide tree over one mesh: never changed, shared by every backend."""

    def __init__(
        self,
        vertices: NDArray[Real],
        faces: NDArray[np.int32],
        accuracy: Literal["fast", "watertight", "exact"] = "watertight",
        threads: int = 0,
        depth_limit: int = 64,
        nodes: Literal["float32", "compressed"] = "float32",
        quality: Literal["medium", "high"] = "medium",
    ) -> None:
        """Build over vertices (v,3), faces (f,3). threads 0 means every core.

        float64 vertices make a float64 tree, "fast" or "watertight". Raises ValueError naming the first bad
        vertex (NaN, infinite or beyond 1e18) or face (index out of range), and for float64 with "exact".
        """
    def refitted(self, vertices: NDArray[Real], threads: int = 0) -> Bvh:
        """A tree over the same faces and moved vertices (v,3), of the same shape.

        Of another shape if a triangle without an area gains some. Raises ValueError as construction does.
        """
    def prepare_part(self, first_faces: NDArray[np.int32], i: int) -> None:
        """Find the leaves of mesh i for `move_part`; the faces of mesh k begin at row first_faces[k]."""
    @property
    def vertices(self) -> NDArray[Any]:
        """(v,3) the array it was built from."""
    @property
    def precision(self) -> Literal["float32", "float64"]: ...
    @property
    def nodes(self) -> NDArray[np.uint32]:
        """(m,8,8) read-only view, rows lo.x hi.x lo.y hi.y lo.z hi.z child order; planes are float32 bits.

        Compressed: (m,4,8), the 128 bytes of CompressedNode in cpu/core/compressed.h.
        """
    @property
    def blocks(self) -> NDArray[np.uint32]:
        """(b,10,4) read-only view: nine float32 rows (fast: v0 e1 e2; else: v0 v1 v2), the prim row.

        Compressed: (units,8), blocks of three or four units, CompressedBlock in cpu/core/compressed.h.
        float64, whatever the nodes: (b,20,4), nine rows of four float64, the prim row, a row of zeros.
        """
    @property
    def units(self) -> NDArray[np.uint32]:
        """(units,8) read-only view of the whole tree: nodes, then blocks, in units of 32 bytes.

        A child reference holds (unit << 3); a leaf sets bit 31 and its number of blocks less one in the low 3
        bits.
        """
    @property
    def facts(self) -> dict[str, Any]:
        """What `stored_tree` takes besides arrays and options."""
    @property
    def source(self) -> Any:
        """The argument `source` of `stored_tree`; None for a tree that was built here."""
    def checksums(self) -> tuple[int, int, int]:
        """64-bit checksums of `units`, vertices and faces; these are not verified."""
    def verify(self) -> None:
        """Verify a stored tree, unless that is done already; queries and the views of nodes do so first.

        Raises ValueError, with the tree's name, if a checksum is wrong, or a reference, a number or an order
        row that could make a query read outside of the tree or never end.
        """
    @property
    def center(self) -> NDArray[np.float32]:
        """(3,) the point box planes are relative to."""
    @property
    def extent(self) -> NDArray[np.float32]:
        """(3,) the largest |plane| on each axis: the half size of the tree round its center."""
    @property
    def far_distance(self) -> float:
        """The distance from the middle of the bounds beyond which float32 moves rays by too much."""
    @property
    def bounds(self) -> NDArray[Any]:
        """(2,3) lowest and highest corner of the triangles that can be hit; inf, -inf if there are none."""
    @property
    def accuracy(self) -> str: ...
    @property
    def node_form(self) -> str:
        """ "float32" or "compressed"."""
    @property
    def depth(self) -> int:
        """Inner nodes on the longest path from the root down."""
    @property
    def memory(self) -> int:
        """Bytes of nodes and triangle blocks."""
    @property
    def sah(self) -> tuple[float, float]:
        """Surface-area cost of inner nodes and of triangle blocks, relative to the root's area."""
    def intersect(
        self,
        kernel: Kernels | str,
        origins: NDArray[Real],
        directions: NDArray[Real],
        tmin: NDArray[Real],
        tmax: NDArray[Real],
        threads: int = 0,
        in_flight: int = 0,
        stats: bool = False,
    ) -> tuple[NDArray[Any], NDArray[np.int32], NDArray[Any], NDArray[np.int32] | None]:
        """Closest hits: t (n,), prim (n,), uv (n,2), and stats (n,3) or None; inf, -1 and NaN on a miss.

        t and uv have the tree's dtype. tmin and tmax have one element or n. stats columns: inner nodes,
        leaves, triangles tested.
        The interpreter lock is released while rays are traced.
        """
    def occluded(
        self,
        kernel: Kernels | str,
        origins: NDArray[Real],
        directions: NDArray[Real],
        tmin: NDArray[Real],
        tmax: NDArray[Real],
        threads: int = 0,
        in_flight: int = 0,
        stats: bool = False,
    ) -> tuple[NDArray[np.bool_], NDArray[np.int32] | None]:
        """Whether anything lies in [tmin, tmax]: (n,) bool, and stats (n,3) or None."""
    def intersect_all(
        self,
        kernel: Kernels | str,
        origins: NDArray[Real],
        directions: NDArray[Real],
        tmin: NDArray[Real],
        tmax: NDArray[Real],
        threads: int = 0,
        in_flight: int = 0,
        stats: bool = False,
        touching: bool = False,
        max_bytes: int = 0,
    ) -> tuple[
        NDArray[np.int64],
        NDArray[Any],
        NDArray[np.int32],
        NDArray[Any],
        NDArray[np.int32] | None,
    ]:
        """All hits: offsets (n+1,), t (h,), prim (h,), uv (h,2), and stats (n,3) or None.

        Those of ray i are rows offsets[i] to offsets[i+1], by ascending t, then prim. Raises MemoryError as
        soon as the hits take more than max_bytes; 0 is by what memory there is.
        """
    def count(
        self,
        kernel: Kernels | str,
        origins: NDArray[Real],
        directions: NDArray[Real],
        tmin: NDArray[Real],
        tmax: NDArray[Real],
        threads: int = 0,
        in_flight: int = 0,
        stats: bool = False,
        touching: bool = False,
    ) -> tuple[NDArray[np.int32], NDArray[np.int32] | None]:
        """How many hits each ray has in [tmin, tmax]: (n,) int32, and stats (n,3) or None."""
    def closest(
        self, kernel: Kernels | str, points: NDArray[Real], max_distance: NDArray[Real], threads: int = 0
    ) -> tuple[NDArray[Any], NDArray[np.int32], NDArray[Any]]:
        """The closest triangles: distance (n,), prim (n,), uv (n,2); inf, -1 and NaN if none is near enough.

        distance and uv have the tree's dtype. max_distance has one element or n, none negative or NaN.
        """
    def winding(self, points: NDArray[Real], threads: int = 0) -> NDArray[np.float64]:
        """(n,) the generalised winding number round each point; NaN if it is no finite point.

        The first call makes a table over the tree, which takes as long as a small part of building it.
        """
    def intersect_ready(
        self, kernel: Kernels, origins: object, directions: object, tmin: object, tmax: object
    ) -> tuple[NDArray[Any], NDArray[np.int32], NDArray[Any], None] | None:
        """`intersect`, if the arrays need neither conversion nor copying and limits are floats; else None."""
    def occluded_ready(
        self, kernel: Kernels, origins: object, directions: object, tmin: object, tmax: object
    ) -> tuple[NDArray[np.bool_], None] | None:
        """`occluded`, in the same way."""
    def count_ready(
        self, kernel: Kernels, origins: object, directions: object, tmin: object, tmax: object
    ) -> tuple[NDArray[np.int32], None] | None:
        """`count`, in the same way."""
    def render_rows(
        self,
        kernel: Kernels | str,
        camera: NDArray[np.float32],
        image: NDArray[np.float32],
        row_begin: int,
        row_end: int,
        samples: int,
        bounces: int,
        albedo: Literal["gray", "normals", "faces", "vertices"],
        seed: int = 0,
        threads: int = 0,
        in_flight: int = 0,
        tracer: tuple[int, int] | None = None,
        check: bool = True,
        colours: NDArray[np.float32] | None = None,
        light: NDArray[np.float32] | None = None,
    ) -> int:
        """Path-trace rows [row_begin, row_end) of image (height,width,3) in place; returns the rays traced.

        camera (4,3): eye, then the vectors from the eye to the picture's centre, from its centre to the right
        edge's middle, and from its centre to the top edge's middle. Linear radiance. Random numbers come from
        (pixel, sample, bounce) alone, so a picture does not depend on threads or kernel. tracer: addresses of
        a C function that traces in the kernel's place and of its context (ForeignTracer in
        cpu/render/render.h), for comparisons. check: check the mesh first, whose arrays the caller may have
        changed since the tree was built; once per picture is enough. colours: (f,3) or (v,3), with albedo
        "faces" or "vertices". light (5,3): up, radiance of the sky at the horizon and straight up, direction
        to the sun, radiance of a white surface that faces the sun; None is a white sky of radiance 1.
        """

def closest_on(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    prim: NDArray[np.int32],
    points: NDArray[np.float64],
    threads: int = 0,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n,3) the closest point of triangle prim[i] to points[i], (n,) distances; NaN, inf without one."""

def surface_points(
    vertices: NDArray[Real],
    faces: NDArray[np.int32],
    prim: NDArray[np.int32],
    uv: NDArray[Real],
    kernel: str = "",
) -> NDArray[np.float64]:
    """(n,3) points at uv (n,2) of triangles prim (n,), in double; NaN if there is no such triangle.

    kernel: a name of `kernels()`, or "" for the best. The interpreter lock is released.
    """

def points_on_rays(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    prim: NDArray[np.int32],
    uv: NDArray[Real],
    ray: NDArray[np.int64],
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(n,3) points where rays ray (n,) meet the planes of triangles prim (n,); at uv if they graze it."""

def surface_normals(
    vertices: NDArray[Real], faces: NDArray[np.int32], prim: NDArray[np.int32], kernel: str = ""
) -> NDArray[np.float64]:
    """(n,3) unit normals of triangles prim (n,), in double; NaN if there is no such triangle.

    kernel: a name of `kernels()`, or "" for the best. The interpreter lock is released.
    """

def error_bounds(
    vertices: NDArray[Real],
    faces: NDArray[np.int32],
    prim: NDArray[np.int32],
    t: NDArray[Real],
    origins: NDArray[Real],
    directions: NDArray[Real],
    constants: Sequence[float],
    kernel: str = "",
) -> NDArray[np.float64]:
    """(n,) bounds on the error of t (n,), for rays (n,3) that hit triangles prim (n,); NaN for no triangle.

    constants: the members of ErrorBound (cpu/core/error_bound.inc). kernel: a name of `kernels()`, or ""
    for the best. The interpreter lock is released.
    """

def spawn_origins(
    vertices: NDArray[Real],
    faces: NDArray[np.int32],
    prim: NDArray[np.int32],
    uv: NDArray[Real],
    directions: NDArray[Real],
    accuracy: int,
    constants: Sequence[float],
    kernel: str = "",
) -> NDArray[Any]:
    """(n,3) origins for directions (n,3) at uv (n,2) of triangles prim (n,); NaN for no triangle.

    accuracy and constants: the members of SpawnOrigin (cpu/core/spawn.inc) other than is_float. kernel: a
    name of `kernels()`, or "" for the best. The interpreter lock is released.
    """

def segment_rays(
    a: NDArray[np.float64], b: NDArray[np.float64], center: Sequence[float], threads: int = 0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origins and directions (n,3) of rays along segments, t = 0 to 1; ends (n,3), or (1,3) for all.

    A ray starts at the end that is nearer to center (3,), so a segment and its reverse are one ray.
    """

def may_have_far(origins: NDArray[Any], center: Sequence[float], far: float) -> bool:
    """Whether an origin (n,3), float32 or float64, may differ from center by more than far on some axis."""

def bring_near(
    origins: NDArray[Any],
    directions: NDArray[Any],
    rounded_origins: NDArray[Any],
    rounded_directions: NDArray[Any],
    tmin: NDArray[Any],
    tmax: NDArray[Any],
    center: Sequence[float],
    far: float,
    most: float,
    kept: bool,
    threads: int = 0,
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], NDArray[np.float64]] | None:
    """Rays (n,3) farther than far from center (3,), as they come nearest to it; None if there are none.

    Returns origins (n,3), tmin, tmax and how far each ray was moved (n,), in lengths of its direction. tmin
    and tmax: (n,), or (1,) for all. Origins with a coordinate beyond most stay; kept: rays that float32
    holds as well.
    """

def nearest_ahead(
    origins: NDArray[np.float64],
    directions: NDArray[np.float64],
    center: Sequence[float],
    far: float,
    most: float,
    before: float,
    threads: int = 0,
) -> NDArray[np.float64]:
    """(n,3) points on rays, the length `before` in front of their points nearest to center.

    For rays whose origin is farther than far from center and that have it ahead; the origins of others.
    """

def between(
    vertices: NDArray[Real],
    faces: NDArray[np.int32],
    prim: NDArray[np.int32],
    row: NDArray[np.int64],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    constants: Sequence[float],
    errors: Sequence[float],
    threads: int = 0,
) -> NDArray[np.bool_]:
    """(h,) whether the planes of triangles prim (h,) separate the ends of segments row (h,).

    constants: the members of Separation (cpu/core/separation.inc); errors: those of a and of b. False for no
    triangle. The interpreter lock is released.
    """

def stored_tree(
    units: NDArray[np.uint8],
    vertices: NDArray[Real],
    faces: NDArray[np.int32],
    accuracy: str,
    nodes: str,
    quality: str,
    node_count: int,
    triangle_count: int,
    depth: int,
    center: Sequence[float],
    extent: Sequence[float],
    far_away: float,
    bounds: Sequence[Sequence[float]],
    checksums: Sequence[int],
    name: str,
    source: object,
) -> Bvh:
    """A tree that was built before: units, (bytes,) at a multiple of 64, are used where they lie.

    It is verified before its first use, see `Bvh.verify`; only what takes no time is checked here. `source`
    is kept.
    """
