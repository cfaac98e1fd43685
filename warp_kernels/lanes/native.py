"""Native code of the lane vectors: intrinsics on CUDA, plain C++ on Warp's CPU device.

Names that end in 8 or 4 are for lanes=8, one thread per ray; those in 1 for lanes=1, eight threads per ray.
"""

from wive.warp_kernels.lanes.layout import COMPRESSED_PLANES, COMPRESSED_RANKS, COMPRESSED_STEP, NUMBER_BITS

# Distances from the ray's origin to a row of planes: plane * rdir + bias, fused on CUDA, where a row is two
# loads of 16 bytes.
DISTANCES_8 = """
    const float* row = (const float*)units + at;
    wp::vec_t<8, wp::float32> distances;
#if defined(__CUDA_ARCH__)
    const float4 a = __ldg((const float4*)row), b = __ldg((const float4*)row + 1);
    distances[0] = __fmaf_rn(a.x, rdir, bias); distances[1] = __fmaf_rn(a.y, rdir, bias);
    distances[2] = __fmaf_rn(a.z, rdir, bias); distances[3] = __fmaf_rn(a.w, rdir, bias);
    distances[4] = __fmaf_rn(b.x, rdir, bias); distances[5] = __fmaf_rn(b.y, rdir, bias);
    distances[6] = __fmaf_rn(b.z, rdir, bias); distances[7] = __fmaf_rn(b.w, rdir, bias);
#else
    for (int i = 0; i < 8; ++i) distances[i] = row[i] * rdir + bias;
#endif
    return distances;
"""
DISTANCES_1 = """
    const float* row = (const float*)units + at + lane;
#if defined(__CUDA_ARCH__)
    return wp::vec_t<1, wp::float32>(__fmaf_rn(__ldg(row), rdir, bias));
#else
    return wp::vec_t<1, wp::float32>(*row * rdir + bias);
#endif
"""

# A row of words, for children and ranks.
ROW_8 = """
    const float* row = (const float*)units + at;
    wp::vec_t<8, wp::uint32> words;
#if defined(__CUDA_ARCH__)
    const uint4 a = __ldg((const uint4*)row), b = __ldg((const uint4*)row + 1);
    words[0] = a.x; words[1] = a.y; words[2] = a.z; words[3] = a.w;
    words[4] = b.x; words[5] = b.y; words[6] = b.z; words[7] = b.w;
#else
    for (int i = 0; i < 8; ++i) words[i] = ((const wp::uint32*)row)[i];
#endif
    return words;
"""
ROW_1 = """
    const wp::uint32* row = (const wp::uint32*)units + at + lane;
#if defined(__CUDA_ARCH__)
    return wp::vec_t<1, wp::uint32>(__ldg(row));
#else
    return wp::vec_t<1, wp::uint32>(*row);
#endif
"""

# The slots behind each slot, as bytes: two words of one octant, or the byte of the lane's own slot.
BEHIND_8 = """
    const wp::uint32* row = (const wp::uint32*)units + at;
#if defined(__CUDA_ARCH__)
    const uint2 a = __ldg((const uint2*)row);
    return wp::vec_t<2, wp::uint32>(a.x, a.y);
#else
    return wp::vec_t<2, wp::uint32>(row[0], row[1]);
#endif
"""
BEHIND_1 = """
    const unsigned char* byte = (const unsigned char*)((const wp::uint32*)units + at) + lane;
#if defined(__CUDA_ARCH__)
    return wp::vec_t<2, wp::uint32>(__ldg(byte), 0u);
#else
    return wp::vec_t<2, wp::uint32>(*byte, 0u);
#endif
"""

_COMPRESSED_NODE = f"""
    enum {{ STEP = {COMPRESSED_STEP}, PLANES = {COMPRESSED_PLANES}, RANKS = {COMPRESSED_RANKS} }};
"""

# Distances to a compressed row, whose planes are bytes on a grid:
# byte * (step * rdir) + (origin * rdir + bias).
BYTE_DISTANCES_8 = (
    _COMPRESSED_NODE
    + """
    const float* words = (const float*)units + node;
    wp::vec_t<8, wp::float32> distances;
#if defined(__CUDA_ARCH__)
    const float step = __fmul_rn(__ldg(words + STEP + axis), rdir);
    const float base = __fmaf_rn(__ldg(words + axis), rdir, bias);
    const uint2 bytes = __ldg((const uint2*)(words + PLANES) + row);
    for (int i = 0; i < 4; ++i) {
        distances[i] = __fmaf_rn((float)(bytes.x >> 8 * i & 255u), step, base);
        distances[4 + i] = __fmaf_rn((float)(bytes.y >> 8 * i & 255u), step, base);
    }
#else
    const float step = words[STEP + axis] * rdir, base = words[axis] * rdir + bias;
    const unsigned char* bytes = (const unsigned char*)(words + PLANES) + 8 * row;
    for (int i = 0; i < 8; ++i) distances[i] = (float)bytes[i] * step + base;
#endif
    return distances;
"""
)
BYTE_DISTANCES_1 = (
    _COMPRESSED_NODE
    + """
    const float* words = (const float*)units + node;
    const unsigned char* byte = (const unsigned char*)(words + PLANES) + 8 * row + lane;
#if defined(__CUDA_ARCH__)
    const float base = __fmaf_rn(__ldg(words + axis), rdir, bias);
    const float step = __fmul_rn(__ldg(words + STEP + axis), rdir);
    return wp::vec_t<1, wp::float32>(__fmaf_rn((float)__ldg(byte), step, base));
#else
    return wp::vec_t<1, wp::float32>(
        (float)*byte * (words[STEP + axis] * rdir) + (words[axis] * rdir + bias));
#endif
"""
)

# The ranks of a compressed node, three bytes per lane; the fourth byte of each word returned is undefined.
RANKS_8 = (
    _COMPRESSED_NODE
    + """
    const unsigned* row = (const unsigned*)units + node + RANKS;
    wp::vec_t<8, wp::uint32> ranks;
    for (int half = 0; half < 2; ++half) {
#if defined(__CUDA_ARCH__)
        const unsigned a = __ldg(row + 3 * half), b = __ldg(row + 3 * half + 1);
        const unsigned c = __ldg(row + 3 * half + 2);
#else
        const unsigned a = row[3 * half], b = row[3 * half + 1], c = row[3 * half + 2];
#endif
        ranks[4 * half] = a;
        ranks[4 * half + 1] = a >> 24 | b << 8;
        ranks[4 * half + 2] = b >> 16 | c << 16;
        ranks[4 * half + 3] = c >> 8;
    }
    return ranks;
"""
)
RANKS_1 = (
    _COMPRESSED_NODE
    + """
    const unsigned char* bytes = (const unsigned char*)((const unsigned*)units + node + RANKS) + 3 * lane;
#if defined(__CUDA_ARCH__)
    return wp::vec_t<1, wp::uint32>(__ldg(bytes) | __ldg(bytes + 1) << 8 | __ldg(bytes + 2) << 16);
#else
    return wp::vec_t<1, wp::uint32>(bytes[0] | bytes[1] << 8 | bytes[2] << 16);
#endif
"""
)

# One coordinate of four triangles' corners, or of the lane's own triangle, from a row of shared vertices;
# `numbers` holds their places in the row.
_NUMBERS = f"    enum {{ BITS = {NUMBER_BITS} }};"
PICK_4 = (
    _NUMBERS
    + """
    const float* from = (const float*)units + row;
    wp::vec_t<4, wp::float32> picked;
    for (int i = 0; i < 4; ++i) {
#if defined(__CUDA_ARCH__)
        picked[i] = __ldg(from + (numbers >> BITS * i & 7u));
#else
        picked[i] = from[numbers >> BITS * i & 7u];
#endif
    }
    return picked;
"""
)
PICK_1 = (
    _NUMBERS
    + """
    const float* from = (const float*)units + row + (numbers >> BITS * (lane & 3) & 7u);
#if defined(__CUDA_ARCH__)
    return wp::vec_t<1, wp::float32>(__ldg(from));
#else
    return wp::vec_t<1, wp::float32>(*from);
#endif
"""
)

# A row of a block: the numbers of its four triangles, or that of the lane's own triangle.
TRIANGLES_4 = """
    const float* row = (const float*)units + at;
#if defined(__CUDA_ARCH__)
    const float4 a = __ldg((const float4*)row);
    return wp::vec_t<4, wp::float32>(a.x, a.y, a.z, a.w);
#else
    return wp::vec_t<4, wp::float32>(row[0], row[1], row[2], row[3]);
#endif
"""
DOUBLE_TRIANGLES_4 = """
    const double* row = (const double*)((const float*)units + at);
#if defined(__CUDA_ARCH__)
    const double2 a = __ldg((const double2*)row), b = __ldg((const double2*)row + 1);
    return wp::vec_t<4, wp::float64>(a.x, a.y, b.x, b.y);
#else
    return wp::vec_t<4, wp::float64>(row[0], row[1], row[2], row[3]);
#endif
"""

# Refuses modules whose options let the compiler round otherwise: hits would not be the core's.
ROUNDED_AS_WRITTEN = """
#if (defined(__CUDA_FTZ) && __CUDA_FTZ) || defined(__FAST_MATH__)
#error "wive: compile this kernel's module with fast_math=False: fast_math changes which triangles are hit"
#endif
"""

# Products that no compiler may fuse with an addition, whatever options the module is compiled with: fused,
# the two triangles at an edge would not compute the same numbers.
PRODUCT = """
#if defined(__CUDA_ARCH__)
    return ROUNDED(a, b);
#else
    return a * b;
#endif
"""
PRODUCTS = """
    wp::vec_t<LENGTH, wp::REAL> c;
#if defined(__CUDA_ARCH__)
    for (int i = 0; i < LENGTH; ++i) c[i] = ROUNDED(a[i], b[i]);
#else
    for (int i = 0; i < LENGTH; ++i) c[i] = a[i] * b[i];
#endif
    return c;
"""

# x1 y2 - y1 x2 with the exact sign, as cpu/traverse/triangle_watertight_float64.h.
EXACT_WEIGHT = """
#if defined(__CUDA_ARCH__)
    const double a = __dmul_rn(x1, y2), b = __dmul_rn(y1, x2);
#else
    const double a = x1 * y2, b = y1 * x2;
#endif
    const double a_low = fma(x1, y2, -a), b_low = -fma(y1, x2, -b);
    const double low = a_low + b_low, b_part = low - a_low;
    const double lowest = (a_low - (low - b_part)) + (b_low - b_part);
    return ((a - b) + low) + lowest;
"""

# Writes a hit to the last free one of the ray's places and counts `remaining` down. The count never falls
# below zero: memory stays intact even if the rays were overwritten since their hits were counted. On the CPU
# device the fibers of a ray run one at a time, so no atomics are needed.
LIST_HIT = """
#if defined(__CUDA_ARCH__)
    const int place = atomicSub((int*)remaining, 1) - 1;
    if (place < 0) { atomicAdd((int*)remaining, 1); return; }
#else
    if (*(const int*)remaining <= 0) return;
    const int place = --*(int*)remaining;
#endif
    REAL* hit = (REAL*)hits + 4 * (wp::int64)place;
    hit[0] = t;
    hit[1] = u;
    hit[2] = v;
    *(int*)(hit + 3) = prim;
"""


# An element of an array. On CUDA the product is one instruction, which compilers do not split: strides in 64
# bits, computed before a loop, would take two registers each for the whole of a kernel.
_ELEMENT = """
#if defined(__CUDA_ARCH__)
    wp::int64 offset;
    asm("mul.wide.s32 %0, %1, %2;" : "=l"(offset) : "r"(i), "r"((int)values.strides[0]));
#else
    const wp::int64 offset = (wp::int64)i * values.strides[0];
#endif
    TYPE* element = (TYPE*)((char*)values.data + offset);
"""
READ_ELEMENT = _ELEMENT + "    return *element;"
WRITE_ELEMENT = _ELEMENT + "    *element = value;"


def shared_stack_code(words: int) -> str:
    """Native code for the address of a group's stack of `words`, in memory that its block shares."""
    return f"""
#if defined(__CUDA_ARCH__)
    __shared__ unsigned stack[(WP_TILE_BLOCK_DIM + 7) / 8][{words}];
    return (wp::uint64)&stack[threadIdx.x >> 3][0];
#else
    static unsigned stack[(WP_TILE_BLOCK_DIM + 7) / 8][{words}];
    return (wp::uint64)&stack[WP_TILE_THREAD_IDX >> 3][0];
#endif
"""
